//! The decisions of the time-out thread, on time that comes from outside.
//!
//! In:  [`Watch`], the time now, the [`Limits`]. Out: [`Report`]s, waits that are taken away, the date by which to look again.

use bus::watch::{Watch, date_ns, take_expired};
use config::{Bus, KeepAwake, Rt};
use host::wait::{Grid, cpu_ns};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// No tick comes nearer than this to the beginning of a cycle.
const CLEAR_NS: u64 = 15_000;
/// The thread looks at least this often whether it shall end, ns.
pub(super) const LOOK_AGAIN_NS: u64 = 10_000_000;

/// What the time-out thread has seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// When, ns of CLOCK_MONOTONIC.
    pub at_ns: u64,
    pub event: Event,
}

/// Kinds of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The PRes of a node did not come in time.
    PresTimeout { node: u8 },
    /// The frame of the async slot did not come in time.
    AsyncTimeout {
        /// Node id that had the slot.
        node: u8,
    },
    /// A cycle has not begun although it is later than the limit. Once per cycle.
    CycleLate {
        /// Number of the cycle that should have begun.
        cycle: u64,
        /// How late it is already.
        late_ns: u64,
        /// Whether the cycle before it is still computing; if not, the cycle thread does not get the core.
        computing: bool,
    },
    /// The cycle thread hangs: it may send no SoC any more.
    CycleHung {
        /// Number of the last cycle that began.
        cycle: u64,
        /// How long the next one is overdue.
        overdue_ns: u64,
    },
    /// The cycle thread is overdue for as long and has hardly computed: it does not get the core. Once per cycle.
    CycleStarved {
        /// Number of the last cycle that began.
        cycle: u64,
        /// How long the next one is overdue.
        overdue_ns: u64,
        /// How long of that it computed.
        ran_ns: u64,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    pub period_ns: u64,
    /// A cycle that has not begun this long after its date is late.
    pub late_ns: u64,
    /// A cycle thread that has missed this many cycles in a row hangs.
    pub hung_cycles: u32,
    /// Offset of the cycles from whole periods.
    pub phase_ns: u64,
    /// Distance of the dates at which the time-out thread may look: its resolution.
    pub tick_ns: u64,
    /// No wait for a node is shorter; 0: unknown, so that every tick is needed.
    pub shortest_wait_ns: u64,
    /// Look at every tick, needed or not: keeps the core awake where nothing else shall.
    pub every_tick: bool,
}

impl Limits {
    /// Limits for a cycle and a tick: late by a quarter cycle; hung two cycles after the nodes have begun to count lost SoCs,
    /// which they do after `soc_lost_max` cycles. Every tick is looked at.
    pub fn new(period_ns: u64, tick_ns: u64, soc_lost_max: u32) -> Limits {
        Limits {
            period_ns,
            late_ns: period_ns / 4,
            hung_cycles: soc_lost_max.saturating_add(2),
            phase_ns: 0,
            tick_ns,
            shortest_wait_ns: 0,
            every_tick: true,
        }
    }

    /// The limits of a machine whose cycle runs on this grid, `rt` as it was found best for this PC.
    pub fn for_machine(bus: &Bus, rt: &Rt, cycle: Grid) -> Limits {
        // Where nodes bear any loss, none has given up when the thread is given up: that is for a simulated machine.
        let soc_lost_max = bus.soc_lost_max.unwrap_or(u32::MAX);
        let waits_us = bus.nodes.iter().map(|node| node.pres_timeout_us);
        let shortest_us = waits_us.fold(bus.async_slot_timeout_us, u32::min);
        Limits {
            phase_ns: cycle.phase_ns,
            shortest_wait_ns: u64::from(shortest_us) * 1000,
            late_ns: cycle.late_max_ns,
            every_tick: rt.keep_awake == Some(KeepAwake::Ticks),
            ..Limits::new(cycle.period_ns, u64::from(rt.timeout_us) * 1000, soc_lost_max)
        }
    }

    /// RT: a cycle thread that computes hangs when it is overdue for longer, ns.
    fn hung_ns(&self) -> u64 {
        u64::from(self.hung_cycles) * self.period_ns
    }

    /// RT: number of the cycle in which a date lies.
    pub fn cycle_at(&self, date_ns: u64) -> u64 {
        date_ns.saturating_sub(self.phase_ns % self.period_ns) / self.period_ns
    }

    /// RT: when a cycle begins.
    pub fn begins_at(&self, cycle: u64) -> u64 {
        cycle * self.period_ns + self.phase_ns % self.period_ns
    }

    /// RT: the first date of a tick at or after `from_ns`. Ticks lie in the middle between the multiples of their distance
    /// from the beginning of a cycle; one that would meet a beginning all the same, because the distance does not divide
    /// the cycle, waits until it has passed.
    pub fn tick_at_or_after(&self, from_ns: u64) -> u64 {
        let ceil = |from_ns: u64, period_ns: u64, phase_ns: u64| {
            let phase_ns = phase_ns % period_ns;
            phase_ns + from_ns.saturating_sub(phase_ns).div_ceil(period_ns) * period_ns
        };
        let tick_ns = ceil(from_ns, self.tick_ns, self.phase_ns + self.tick_ns / 2);
        let beginning_ns = ceil(tick_ns.saturating_sub(CLEAR_NS), self.period_ns, self.phase_ns);
        if beginning_ns < tick_ns + CLEAR_NS {
            beginning_ns + CLEAR_NS
        } else {
            tick_ns
        }
    }
}

/// The decisions, on time that comes from outside.
pub struct Watchdog {
    watch: Arc<Watch>,
    limits: Limits,
    last_tick_ns: u64,
    /// What the last tick gave as the date of the next one.
    due_ns: u64,
    /// Date of the cycle that is watched, and what has been seen of its successor since.
    deadline_ns: u64,
    late_reported: bool,
    starved_reported: bool,
    hung_reported: bool,
    /// Processor time of the cycle thread at the last look that found it late; none: not known.
    cpu_ns: Option<u64>,
    /// What it computed since it is late, as far as looks in time have seen it.
    ran_ns: u64,
    /// Overdue time during which this watchdog was running itself. Where the whole PC stood still (a virtual machine that
    /// was not scheduled), the cycle thread is not to blame and gets its time first.
    observed_ns: u64,
}

impl Watchdog {
    /// A watchdog that has seen nothing yet.
    pub fn new(watch: Arc<Watch>, limits: Limits) -> Watchdog {
        Watchdog {
            watch,
            limits,
            last_tick_ns: 0,
            due_ns: 0,
            deadline_ns: 0,
            late_reported: false,
            starved_reported: false,
            hung_reported: false,
            cpu_ns: None,
            ran_ns: 0,
            observed_ns: 0,
        }
    }

    /// RT: looks at every limit and gives the date by which to look again. At most four reports; no lock, no allocation, and no
    /// system call but for the processor time of a cycle thread that is overdue.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn tick(&mut self, now_ns: u64, report: impl FnMut(Report)) -> u64 {
        self.check(now_ns, report, ran_ns)
    }

    /// `ran_ns` gives the processor time of the cycle thread, where it is known.
    fn check(&mut self, now_ns: u64, mut report: impl FnMut(Report), ran_ns: impl Fn(&Watch) -> Option<u64>) -> u64 {
        self.watch.ticks.fetch_add(1, Ordering::Relaxed);
        let mut report = |event| report(Report { at_ns: now_ns, event });
        if let Some(node) = take_expired(&self.watch.poll, now_ns) {
            self.watch.polls_lost.fetch_add(1, Ordering::Relaxed);
            report(Event::PresTimeout { node });
        }
        if let Some(node) = take_expired(&self.watch.async_slot, now_ns) {
            self.watch.async_lost.fetch_add(1, Ordering::Relaxed);
            report(Event::AsyncTimeout { node });
        }
        let overdue = self.watch_cycle(now_ns, &mut report, ran_ns);
        self.last_tick_ns = now_ns;
        self.due_ns = if overdue && self.late_reported {
            self.next_due(now_ns).min(self.next_look(now_ns))
        } else if overdue || self.limits.every_tick {
            // The very next tick, however late this one is.
            now_ns + 1
        } else {
            self.next_due(now_ns)
        };
        self.due_ns
    }

    /// Looks whether the next cycle has begun in time; whether it is overdue and the cycle thread not yet given up.
    fn watch_cycle(
        &mut self,
        now_ns: u64,
        report: &mut impl FnMut(Event),
        ran_ns: impl Fn(&Watch) -> Option<u64>,
    ) -> bool {
        let watch = &*self.watch;
        let deadline_ns = watch.deadline_ns.load(Ordering::Acquire);
        if deadline_ns != self.deadline_ns {
            self.deadline_ns = deadline_ns;
            (self.late_reported, self.starved_reported, self.hung_reported) = (false, false, false);
            self.observed_ns = 0;
        }
        let due_ns = deadline_ns + self.limits.period_ns;
        if deadline_ns == 0 || now_ns <= due_ns {
            return false;
        }
        let overdue_ns = now_ns - due_ns;
        // A look is due at the next tick; one that comes more than a tick later than that has observed no longer.
        let observed_to_ns = now_ns.min(self.due_ns + 2 * self.limits.tick_ns);
        let observed_ns = observed_to_ns.saturating_sub(self.last_tick_ns).min(overdue_ns);
        self.observed_ns += observed_ns;
        let cycle = watch.cycle.load(Ordering::Relaxed);
        if self.late_reported {
            let before_ns = std::mem::replace(&mut self.cpu_ns, ran_ns(watch));
            let ran_ns = self
                .cpu_ns
                .zip(before_ns)
                .map(|(now, before)| now.saturating_sub(before));
            // What the host of a virtual machine takes may be counted as the thread's own: a look that comes late tells nothing
            // of it. One whose processor time is not known is taken to compute.
            if observed_to_ns == now_ns {
                self.ran_ns += ran_ns.map_or(observed_ns, |ran_ns| ran_ns.min(observed_ns));
            }
        } else if overdue_ns > self.limits.late_ns {
            self.late_reported = true;
            (self.cpu_ns, self.ran_ns) = (ran_ns(watch), 0);
            watch.late_cycles.fetch_add(1, Ordering::Relaxed);
            let computing = watch.finished.load(Ordering::Acquire) <= cycle;
            report(Event::CycleLate {
                cycle: cycle + 1,
                late_ns: overdue_ns,
                computing,
            });
        }
        let limit_ns = self.limits.hung_ns();
        if self.observed_ns > limit_ns && !self.hung_reported {
            // More than half of the limit for a cycle that takes a part of one: less is waiting for the core.
            if self.ran_ns > limit_ns / 2 {
                self.hung_reported = true;
                watch.soc_forbidden.store(true, Ordering::Release);
                report(Event::CycleHung { cycle, overdue_ns });
            } else if !self.starved_reported {
                self.starved_reported = true;
                report(Event::CycleStarved {
                    cycle,
                    overdue_ns,
                    ran_ns: self.ran_ns,
                });
            }
        }
        !self.hung_reported
    }

    /// When to look again at a cycle that is late: when it may hang, else after a quarter of a cycle. Each look takes the core
    /// from a thread that wants to come to its end, in a virtual machine for far longer than the look itself takes.
    fn next_look(&self, now_ns: u64) -> u64 {
        let to_limit_ns = match self.limits.hung_ns().checked_sub(self.observed_ns) {
            Some(left_ns) => left_ns + 1,
            None => u64::MAX,
        };
        now_ns + to_limit_ns.min(self.limits.period_ns / 4)
    }

    /// The date before which no limit can be over.
    ///
    /// A wait that is open now ends at its own date. One that begins after this tick ends no sooner than the shortest of
    /// all waits, and is seen open by then. So each is looked at within one tick of its end, however few ticks there are; one
    /// whose frame is just being sent, and that is shown only behind that, by so much later.
    ///
    /// No order of these reads and of the writes of the cycle thread lets a date be missed. Both threads share a core: this
    /// one runs between two writes of the other, never the reverse. Between the two of [`Watch::begin_cycle`] it finds a
    /// cycle that has not ended, between those of [`Watch::end_cycle`], too: neither rests. Where the core was refused, the
    /// date read first is the oldest of all, and older dates are due earlier.
    fn next_due(&self, now_ns: u64) -> u64 {
        let watch = &*self.watch;
        let cycle_due_ns = self.deadline_ns + self.limits.period_ns;
        let resting = self.deadline_ns != 0
            && watch.finished.load(Ordering::Acquire) > watch.cycle.load(Ordering::Relaxed)
            && watch.rests.load(Ordering::Relaxed);
        let new_waits_from_ns = if resting { now_ns.max(cycle_due_ns) } else { now_ns };
        let mut due_ns = new_waits_from_ns + self.limits.shortest_wait_ns;
        if self.deadline_ns != 0 && !self.late_reported {
            due_ns = due_ns.min(cycle_due_ns + self.limits.late_ns);
        }
        for wait in [&watch.poll, &watch.async_slot] {
            match wait.load(Ordering::Acquire) {
                0 => {}
                waiting => due_ns = due_ns.min(date_ns(waiting)),
            }
        }
        due_ns.clamp(now_ns + 1, now_ns + LOOK_AGAIN_NS)
    }
}

/// RT: processor time of the cycle thread, ns, where it is known. A system call.
fn ran_ns(watch: &Watch) -> Option<u64> {
    watch.cpu_clock().and_then(cpu_ns)
}

#[cfg(test)]
mod tests;
