//! The time-out thread: every time limit is looked at within 50 µs of its end, while the cycle thread computes or sleeps.
//!
//! In:  what the cycle thread says of itself and of the frames it waits for, in [`Watch`] (atomics only).
//! Out: a poll or async slot that is over is taken away from the cycle thread; late and hung cycles are reported; a hung
//!      cycle thread may send no SoC any more, and the drives stop by its loss. Reports go through a fixed ring.
//!
//! A cycle thread hangs that computes and does not come to the end of its cycle. One that does not get the core (of another
//! process, of the host of a virtual machine) is late: it goes on where it was, and nodes that have given up are lost and
//! reported. Its processor time tells the two apart; it costs a system call at each look that finds it overdue for that long.
//!
//! Its ticks lie on a grid in whose gaps the cycle begins. It sleeps over those at which nothing can be due: a tick takes the
//! core from the cycle thread, in a virtual machine for far longer than the thread itself runs (`benches/timeout.rs`).
//!
//! All decisions are in [`Limits`] and [`Watchdog::tick`], which know no clock; [`TimeoutThread`] gives them one.

use crate::config::{Bus, KeepAwake, Rt};
use crate::host::setup::{Process, Role, STACK_SIZE, enter_thread};
use crate::host::wait::{Grid, cpu_ns, monotonic_ns, sleep_until, thread_cpu_clock, thread_cpu_ns, wait_until};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};
use std::thread::JoinHandle;

/// Ticks between two looks at the thread's own processor time, which cost a system call each.
const CPU_TIME_TICKS: u64 = 1024;
/// No tick comes nearer than this to the beginning of a cycle.
const CLEAR_NS: u64 = 15_000;
/// The thread looks at least this often whether it shall end, ns.
const LOOK_AGAIN_NS: u64 = 10_000_000;
/// The thread is given so many of these times to end.
const END_LOOKS: u32 = 500;
/// Reports that fit the ring until somebody reads them; more are counted and dropped.
pub const REPORTS: usize = 256;

/// What is watched. Shared by the cycle thread, the time-out thread and whoever reads the counters.
#[derive(Debug, Default)]
pub struct Watch {
    // Written by the cycle thread.
    /// Date of the cycle that has begun last; 0: none is expected.
    deadline_ns: AtomicU64,
    /// Its number.
    cycle: AtomicU64,
    /// Number of the cycle that has ended last, plus 1.
    finished: AtomicU64,
    /// No wait begins between that end and the next cycle.
    rests: AtomicBool,
    /// Clock of its processor time; 0: not known.
    cpu_clock: AtomicI32,
    /// Outstanding waits, see [`open_wait`]; 0: none. Whoever sets one to 0 has decided it.
    poll: AtomicU64,
    async_slot: AtomicU64,
    // Written by the time-out thread.
    soc_forbidden: AtomicBool,
    ticks: AtomicU64,
    missed_ticks: AtomicU64,
    polls_lost: AtomicU64,
    async_lost: AtomicU64,
    late_cycles: AtomicU64,
    reports_dropped: AtomicU64,
    cpu_ns: AtomicU64,
    wall_ns: AtomicU64,
}

/// Counters of the time-out thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    /// Ticks done.
    pub ticks: u64,
    /// Ticks left out because the thread ran too late.
    pub missed_ticks: u64,
    /// Polls whose PRes did not come in time.
    pub polls_lost: u64,
    /// Async slots that ended without a frame.
    pub async_lost: u64,
    /// Cycles that had not begun when they were later than the limit.
    pub late_cycles: u64,
    /// Reports that found the ring full.
    pub reports_dropped: u64,
    /// Share of one core that the thread uses, 0 to 1.
    pub cpu_share: f64,
}

impl Watch {
    /// The calling thread is the cycle thread.
    pub fn watch_this_thread(&self) {
        self.cpu_clock.store(thread_cpu_clock().unwrap_or(0), Ordering::Release);
    }

    /// RT: processor time of the cycle thread, ns, where it is known. A system call.
    fn ran_ns(&self) -> Option<u64> {
        match self.cpu_clock.load(Ordering::Acquire) {
            0 => None,
            clock => cpu_ns(clock),
        }
    }

    /// RT: the cycle thread leaves cycles out and waits for the one of `deadline_ns`: it is late and alive.
    pub fn leave_out(&self, deadline_ns: u64, period_ns: u64) {
        self.deadline_ns
            .store(deadline_ns.saturating_sub(period_ns), Ordering::Release);
    }

    /// RT: the cycle thread begins a cycle. `deadline_ns` is the date it was planned for, not the time now.
    pub fn begin_cycle(&self, cycle: u64, deadline_ns: u64) {
        self.cycle.store(cycle, Ordering::Relaxed);
        self.deadline_ns.store(deadline_ns, Ordering::Release);
    }

    /// RT: the cycle thread has done everything of a cycle and goes to sleep. `rests`: no wait begins before the next cycle.
    pub fn end_cycle(&self, cycle: u64, rests: bool) {
        self.rests.store(rests, Ordering::Relaxed);
        self.finished.store(cycle + 1, Ordering::Release);
    }

    /// RT: no more cycles are expected (orderly end, or a pause of the network).
    pub fn disarm(&self) {
        self.deadline_ns.store(0, Ordering::Release);
    }

    /// RT: a PReq has left; the PRes of `node` is due by `deadline_ns`.
    pub fn begin_poll(&self, node: u8, deadline_ns: u64) {
        self.poll.store(open_wait(node, deadline_ns), Ordering::Release);
    }

    /// RT: whether the PRes may still come; false once its time is over.
    pub fn is_poll_open(&self) -> bool {
        self.poll.load(Ordering::Acquire) != 0
    }

    /// RT: the PRes has come. False: too late, the time-out thread has counted it as lost. Exactly one of both decides.
    pub fn end_poll(&self) -> bool {
        self.poll.swap(0, Ordering::AcqRel) != 0
    }

    /// RT: a SoA has given the async slot to `node`; its frame is due by `deadline_ns`.
    pub fn begin_async(&self, node: u8, deadline_ns: u64) {
        self.async_slot.store(open_wait(node, deadline_ns), Ordering::Release);
    }

    /// RT: whether the async slot is still open.
    pub fn is_async_open(&self) -> bool {
        self.async_slot.load(Ordering::Acquire) != 0
    }

    /// RT: the async frame has come. False: too late.
    pub fn end_async(&self) -> bool {
        self.async_slot.swap(0, Ordering::AcqRel) != 0
    }

    /// RT: whether the cycle thread may send a SoC. Ask before each one; once false, it stays so: what the
    /// cycle thread was about nobody knows, and the nodes have left the network. The control is started anew.
    pub fn soc_allowed(&self) -> bool {
        !self.soc_forbidden.load(Ordering::Acquire)
    }

    /// The counters now.
    pub fn counters(&self) -> Counters {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let wall_ns = read(&self.wall_ns);
        Counters {
            ticks: read(&self.ticks),
            missed_ticks: read(&self.missed_ticks),
            polls_lost: read(&self.polls_lost),
            async_lost: read(&self.async_lost),
            late_cycles: read(&self.late_cycles),
            reports_dropped: read(&self.reports_dropped),
            cpu_share: if wall_ns == 0 {
                0.0
            } else {
                read(&self.cpu_ns) as f64 / wall_ns as f64
            },
        }
    }
}

/// What the time-out thread has seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// When, ns of CLOCK_MONOTONIC.
    pub at_ns: u64,
    /// What.
    pub event: Event,
}

/// Kinds of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The PRes of a node did not come in time.
    PresTimeout {
        /// Node id.
        node: u8,
    },
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

/// The limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Cycle.
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
    pub fn of(bus: &Bus, rt: &Rt, cycle: Grid) -> Limits {
        let waits_us = bus.nodes.iter().map(|node| node.pres_timeout_us);
        let shortest_us = waits_us.fold(bus.async_slot_timeout_us, u32::min);
        Limits {
            phase_ns: cycle.phase_ns,
            shortest_wait_ns: u64::from(shortest_us) * 1000,
            late_ns: cycle.late_max_ns,
            every_tick: rt.keep_awake == Some(KeepAwake::Ticks),
            ..Limits::new(cycle.period_ns, u64::from(rt.timeout_us) * 1000, bus.soc_lost_max)
        }
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
    /// Processor time of the cycle thread at the first look that found it overdue.
    ran_ns: Option<u64>,
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
            ran_ns: None,
            observed_ns: 0,
        }
    }

    /// RT: looks at every limit and gives the date by which to look again. At most four reports; no lock, no allocation, and no
    /// system call but for the processor time of a cycle thread that is overdue.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn tick(&mut self, now_ns: u64, report: impl FnMut(Report)) -> u64 {
        self.look(now_ns, report, Watch::ran_ns)
    }

    /// `ran_ns` gives the processor time of the cycle thread, where it is known.
    fn look(&mut self, now_ns: u64, mut report: impl FnMut(Report), ran_ns: impl Fn(&Watch) -> Option<u64>) -> u64 {
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
        self.due_ns = if overdue || self.limits.every_tick {
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
        self.observed_ns += observed_to_ns.saturating_sub(self.last_tick_ns).min(overdue_ns);
        let cycle = watch.cycle.load(Ordering::Relaxed);
        if overdue_ns > self.limits.late_ns && !self.late_reported {
            self.late_reported = true;
            self.ran_ns = ran_ns(watch);
            watch.late_cycles.fetch_add(1, Ordering::Relaxed);
            let computing = watch.finished.load(Ordering::Acquire) <= cycle;
            report(Event::CycleLate {
                cycle: cycle + 1,
                late_ns: overdue_ns,
                computing,
            });
        }
        let limit_ns = u64::from(self.limits.hung_cycles) * self.limits.period_ns;
        if self.observed_ns > limit_ns && !self.hung_reported {
            // A thread whose processor time is not known is taken to compute.
            let ran_ns = self
                .ran_ns
                .zip(ran_ns(watch))
                .map(|(before, now)| now.saturating_sub(before));
            match ran_ns {
                // More than half of the limit for a cycle that takes a part of one: less is waiting for the core.
                Some(ran_ns) if ran_ns <= limit_ns / 2 => {
                    if !self.starved_reported {
                        self.starved_reported = true;
                        report(Event::CycleStarved {
                            cycle,
                            overdue_ns,
                            ran_ns,
                        });
                    }
                }
                Some(_) | None => {
                    self.hung_reported = true;
                    watch.soc_forbidden.store(true, Ordering::Release);
                    report(Event::CycleHung { cycle, overdue_ns });
                }
            }
        }
        !self.hung_reported
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
        if self.deadline_ns != 0 {
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

/// RT: a wait for a node in one word: the lowest 8 bits of the date make room for the node, the date is rounded up to whole
/// 256 ns. A PC runs for years; shifted by 8 bits, dates would last for two.
fn open_wait(node: u8, deadline_ns: u64) -> u64 {
    (deadline_ns.saturating_add(0xFF) & !0xFF) | u64::from(node)
}

/// RT: when a wait is over.
fn date_ns(wait: u64) -> u64 {
    wait & !0xFF
}

/// RT: takes an expired wait away from the cycle thread, unless its answer comes in this very moment.
fn take_expired(wait: &AtomicU64, now_ns: u64) -> Option<u8> {
    let waiting = wait.load(Ordering::Acquire);
    if waiting == 0 || now_ns < date_ns(waiting) {
        return None;
    }
    wait.compare_exchange(waiting, 0, Ordering::AcqRel, Ordering::Acquire)
        .ok()
        .map(|_| waiting as u8)
}

/// The running thread. Dropping it ends it.
pub struct TimeoutThread {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl TimeoutThread {
    /// Starts the thread; reports go into `reports`.
    ///
    /// # Errors
    /// If no thread can be had.
    pub fn spawn(
        process: Arc<Process>,
        watch: Arc<Watch>,
        limits: Limits,
        mut reports: rtrb::Producer<Report>,
    ) -> std::io::Result<TimeoutThread> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let run = move || {
            // What is missing was found and told by `prepare_process`.
            drop(enter_thread(Role::Timeout, &process));
            run(&stopped, watch, limits, &mut reports);
        };
        let thread = std::thread::Builder::new()
            .name("rt-timeout".into())
            .stack_size(STACK_SIZE)
            .spawn(run)?;
        Ok(TimeoutThread {
            stop,
            thread: Some(thread),
        })
    }
}

impl Drop for TimeoutThread {
    /// Waits for its end, which comes with its next look. One that hangs is left behind: it has nothing of anybody else's.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else { return };
        for _ in 0..END_LOOKS {
            if thread.is_finished() {
                // A panic of the thread has been printed; there is nothing more to do about it here.
                let _ = thread.join();
                return;
            }
            sleep_until(monotonic_ns() + LOOK_AGAIN_NS);
        }
    }
}

/// RT: the loop of the thread.
fn run(stop: &AtomicBool, watch: Arc<Watch>, limits: Limits, reports: &mut rtrb::Producer<Report>) {
    let mut watchdog = Watchdog::new(watch.clone(), limits);
    let start_ns = monotonic_ns();
    let mut date_ns = limits.tick_at_or_after(start_ns);
    let mut ticks = 0u64;
    while !stop.load(Ordering::Acquire) {
        let now_ns = wait_until(date_ns, 0);
        let due_ns = watchdog.tick(now_ns, |report| {
            if reports.push(report).is_err() {
                watch.reports_dropped.fetch_add(1, Ordering::Relaxed);
            }
        });
        ticks += 1;
        if ticks.is_multiple_of(CPU_TIME_TICKS) {
            watch.cpu_ns.store(thread_cpu_ns(), Ordering::Relaxed);
            watch.wall_ns.store(now_ns - start_ns, Ordering::Relaxed);
        }
        // Later than half a tick: the ticks that would have been there meanwhile are missed, needed or not.
        let missed = (now_ns - date_ns + limits.tick_ns / 2) / limits.tick_ns;
        watch.missed_ticks.fetch_add(missed, Ordering::Relaxed);
        date_ns = limits.tick_at_or_after(due_ns.max(date_ns + 1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        period_ns: 1_000_000,
        late_ns: 250_000,
        hung_cycles: 5,
        phase_ns: 0,
        tick_ns: 50_000,
        shortest_wait_ns: 0,
        every_tick: true,
    };

    struct Rig {
        watch: Arc<Watch>,
        watchdog: Watchdog,
        seen: Vec<Report>,
    }

    impl Rig {
        fn new() -> Rig {
            let watch = Arc::new(Watch::default());
            Rig {
                watchdog: Watchdog::new(watch.clone(), LIMITS),
                watch,
                seen: Vec::new(),
            }
        }

        /// Ticks every 50 µs from one time to before another.
        fn run(&mut self, from_ns: u64, to_ns: u64) {
            for now_ns in (from_ns..to_ns).step_by(50_000) {
                self.watchdog.tick(now_ns, |report| self.seen.push(report));
            }
        }

        fn take(&mut self) -> Vec<(u64, Event)> {
            self.seen.drain(..).map(|report| (report.at_ns, report.event)).collect()
        }
    }

    #[test]
    fn a_poll_is_lost_within_one_tick_of_its_limit() {
        let mut rig = Rig::new();
        rig.watch.begin_poll(7, 1_120_000);
        rig.run(1_000_000, 1_120_000);
        assert!(rig.watch.is_poll_open());
        rig.run(1_150_000, 1_400_000);
        assert!(!rig.watch.is_poll_open());
        assert!(!rig.watch.end_poll(), "an answer after the limit is too late");
        assert_eq!(rig.take(), [(1_150_000, Event::PresTimeout { node: 7 })]);
        assert_eq!(rig.watch.counters().polls_lost, 1);
    }

    #[test]
    fn an_answer_in_time_is_never_lost() {
        let mut rig = Rig::new();
        rig.watch.begin_poll(1, 1_120_000);
        rig.watch.begin_async(3, 1_500_000);
        rig.run(1_000_000, 1_100_000);
        assert!(rig.watch.end_poll());
        rig.watch.begin_poll(2, 1_220_000);
        rig.run(1_100_000, 1_200_000);
        assert!(rig.watch.end_poll());
        assert!(rig.watch.is_async_open());
        rig.run(1_200_000, 1_450_000);
        assert!(rig.watch.end_async());
        rig.run(1_450_000, 2_000_000);
        assert_eq!(rig.take(), []);
    }

    #[test]
    fn an_async_slot_that_stays_empty_is_reported() {
        let mut rig = Rig::new();
        rig.watch.begin_async(240, 1_490_000);
        rig.run(1_000_000, 2_000_000);
        assert_eq!(rig.take(), [(1_500_000, Event::AsyncTimeout { node: 240 })]);
        assert!(!rig.watch.end_async());
    }

    #[test]
    fn waits_last_as_long_however_long_the_pc_has_run() {
        const TEN_YEARS_NS: u64 = 10 * 365 * 86_400 * 1_000_000_000;
        let mut rig = Rig::new();
        rig.watch.begin_poll(254, TEN_YEARS_NS + 120_001);
        rig.run(TEN_YEARS_NS, TEN_YEARS_NS + 120_000);
        assert_eq!(rig.take(), []);
        rig.run(TEN_YEARS_NS + 150_000, TEN_YEARS_NS + 160_000);
        assert_eq!(rig.take(), [(TEN_YEARS_NS + 150_000, Event::PresTimeout { node: 254 })]);
        assert!((1..=256).all(|ns| (ns..ns + 256).contains(&date_ns(open_wait(0xFF, ns)))));
    }

    #[test]
    fn cycles_in_time_raise_nothing() {
        let mut rig = Rig::new();
        for cycle in 1..=100 {
            rig.watch.begin_cycle(cycle, cycle * 1_000_000);
            rig.run(cycle * 1_000_000, cycle * 1_000_000 + 400_000);
            rig.watch.end_cycle(cycle, true);
            rig.run(cycle * 1_000_000 + 400_000, (cycle + 1) * 1_000_000);
        }
        assert_eq!(rig.take(), []);
        assert_eq!(rig.watch.counters().ticks, 2000);
    }

    #[test]
    fn a_late_cycle_is_reported_once_and_the_network_goes_on() {
        let mut rig = Rig::new();
        rig.watch.begin_cycle(8, 8_000_000);
        rig.run(8_000_000, 10_000_000);
        let late = Event::CycleLate {
            cycle: 9,
            late_ns: 300_000,
            computing: true,
        };
        assert_eq!(rig.take(), [(9_300_000, late)]);
        rig.watch.begin_cycle(10, 10_000_000);
        rig.watch.end_cycle(10, true);
        rig.run(10_000_000, 11_600_000);
        let late = Event::CycleLate {
            cycle: 11,
            late_ns: 300_000,
            computing: false,
        };
        assert_eq!(rig.take(), [(11_300_000, late)]);
        assert!(rig.watch.soc_allowed());
        assert_eq!(rig.watch.counters().late_cycles, 2);
    }

    #[test]
    fn a_hung_cycle_thread_may_send_no_soc_any_more() {
        let mut rig = Rig::new();
        rig.watch.begin_cycle(3, 3_000_000);
        rig.run(3_000_000, 9_000_001);
        assert!(rig.watch.soc_allowed());
        rig.seen.clear();
        rig.run(9_050_000, 20_000_000);
        assert_eq!(
            rig.take(),
            [(
                9_050_000,
                Event::CycleHung {
                    cycle: 3,
                    overdue_ns: 5_050_000
                }
            )]
        );
        assert!(!rig.watch.soc_allowed());
        rig.watch.begin_cycle(4, 20_000_000);
        rig.run(20_000_000, 20_500_000);
        assert!(!rig.watch.soc_allowed(), "coming back is not enough");
    }

    #[test]
    fn a_pc_that_stood_still_is_late_but_its_cycle_thread_does_not_hang() {
        let mut rig = Rig::new();
        rig.watch.begin_cycle(1, 1_000_000);
        rig.run(1_000_000, 1_500_000);
        rig.run(60_000_000, 60_100_000);
        assert!(matches!(rig.take()[..], [(60_000_000, Event::CycleLate { .. })]));
        assert!(rig.watch.soc_allowed());
        rig.watch.begin_cycle(2, 60_000_000);
        rig.run(60_100_000, 61_000_000);
        assert_eq!(rig.take(), []);
    }

    #[test]
    fn a_cycle_thread_that_does_not_get_the_core_is_starved_and_one_that_computes_hangs() {
        for (share, hangs_at_ns) in [(0, None), (10, None), (60, Some(10_000_000)), (100, Some(9_050_000))] {
            let mut rig = Rig::new();
            rig.watch.begin_cycle(3, 3_000_000);
            for now_ns in (3_000_000..20_000_000).step_by(50_000) {
                let ran_ns = Some(7_000_000 + now_ns * share / 100);
                let report = |report| rig.seen.push(report);
                rig.watchdog.look(now_ns, report, |_| ran_ns);
            }
            let hung = rig.seen.iter().find_map(|report| match report.event {
                Event::CycleHung { cycle: 3, .. } => Some(report.at_ns),
                _ => None,
            });
            assert!(
                hung.is_some() == hangs_at_ns.is_some() && hung <= hangs_at_ns,
                "{share} %: {hung:?}"
            );
            assert_eq!(rig.watch.soc_allowed(), hung.is_none(), "{share} %");
            let starved = |report: &&Report| matches!(report.event, Event::CycleStarved { cycle: 3, .. });
            let starved = rig.seen.iter().filter(starved).count();
            assert_eq!(starved, usize::from(share < 60), "{share} %: told of once");
            // It goes on where it was.
            rig.watch.begin_cycle(30, 30_000_000);
            rig.seen.clear();
            rig.run(30_000_000, 31_000_000);
            assert_eq!(rig.take(), []);
        }
    }

    #[test]
    fn a_cycle_thread_that_leaves_every_cycle_out_is_late_and_alive() {
        let mut rig = Rig::new();
        rig.watch.begin_cycle(1, 1_000_000);
        for cycle in 2..40 {
            let date_ns = cycle * 1_000_000;
            rig.run(date_ns - 600_000, date_ns + 350_000);
            rig.watch.leave_out(date_ns + LIMITS.period_ns, LIMITS.period_ns);
            rig.run(date_ns + 350_000, date_ns + 400_000);
        }
        let late = |report: &Report| matches!(report.event, Event::CycleLate { .. });
        assert!(rig.seen.len() >= 38 && rig.seen.iter().all(late), "{:?}", rig.seen);
        assert!(rig.watch.soc_allowed());
    }

    #[test]
    fn nothing_is_expected_before_the_first_cycle_and_after_the_last() {
        let mut rig = Rig::new();
        rig.run(0, 20_000_000);
        rig.watch.begin_cycle(1, 20_000_000);
        rig.run(20_000_000, 20_500_000);
        rig.watch.disarm();
        rig.run(20_500_000, 60_000_000);
        assert_eq!(rig.take(), []);
        assert!(rig.watch.soc_allowed());
    }

    /// Limits of the demo's machine.
    const SPARING: Limits = Limits {
        phase_ns: 375_000,
        shortest_wait_ns: 120_000,
        every_tick: false,
        ..LIMITS
    };

    #[test]
    fn ticks_lie_between_the_beginnings_of_cycles() {
        let dates = |limits: Limits| {
            let mut date_ns = limits.tick_at_or_after(0);
            let mut dates = Vec::new();
            while date_ns < 7_000_000 {
                dates.push(date_ns);
                let next_ns = limits.tick_at_or_after(date_ns + 1);
                assert!(next_ns > date_ns && next_ns - date_ns <= limits.tick_ns + 2 * CLEAR_NS);
                date_ns = next_ns;
            }
            dates
        };
        let regular = dates(SPARING);
        assert_eq!(regular[..2], [0, 50_000], "25 us from 375 us");
        assert!(regular.windows(2).all(|pair| pair[1] - pair[0] == 50_000));
        // Ticks that do not divide the cycle, and ones that are hardly longer than what is kept clear.
        for (period_ns, tick_ns) in [
            (1_000_000, 70_000),
            (333_000, 50_000),
            (1_000_000, 31_000),
            (250_000, 20_000),
        ] {
            let limits = Limits {
                period_ns,
                tick_ns,
                ..SPARING
            };
            for date_ns in dates(limits) {
                let phase_ns = limits.phase_ns % period_ns;
                let behind_ns = (date_ns + period_ns - phase_ns) % period_ns;
                assert!(
                    behind_ns >= CLEAR_NS && period_ns - behind_ns >= CLEAR_NS,
                    "{date_ns} in {limits:?}"
                );
            }
        }
    }

    /// What a cycle thread does at a date.
    #[derive(Clone, Copy, Debug)]
    enum Act {
        BeginCycle(u64),
        EndCycle(u64),
        BeginPoll(u8, u64),
        EndPoll,
        BeginAsync(u8, u64),
    }

    /// Ticks as the thread does, over what a cycle thread does; gives the ticks and the reports.
    fn play(limits: Limits, acts: &[(u64, Act)], to_ns: u64) -> (u64, Vec<(u64, Event)>) {
        let mut rig = Rig::new();
        rig.watchdog = Watchdog::new(rig.watch.clone(), limits);
        let mut acts = acts.iter().peekable();
        let mut date_ns = limits.tick_at_or_after(1_000_000);
        let mut ticks = 0;
        while date_ns < to_ns {
            while let Some((_, act)) = acts.next_if(|(at_ns, _)| *at_ns <= date_ns) {
                let watch = &rig.watch;
                match *act {
                    Act::BeginCycle(deadline_ns) => watch.begin_cycle(deadline_ns / 1_000_000, deadline_ns),
                    Act::EndCycle(deadline_ns) => watch.end_cycle(deadline_ns / 1_000_000, true),
                    Act::BeginPoll(node, due_ns) => watch.begin_poll(node, due_ns),
                    Act::EndPoll => _ = watch.end_poll(),
                    Act::BeginAsync(node, due_ns) => watch.begin_async(node, due_ns),
                }
            }
            let due_ns = rig.watchdog.tick(date_ns, |report| rig.seen.push(report));
            ticks += 1;
            date_ns = limits.tick_at_or_after(due_ns.max(date_ns + 1));
        }
        (ticks, rig.take())
    }

    proptest::proptest! {
        #[test]
        fn no_limit_is_looked_at_later_for_the_ticks_that_are_slept_over(
            cycles in proptest::collection::vec(
                (0_u64..60_000, proptest::collection::vec((120_000_u64..200_000, 0_u64..300_000), 0..4), 0_u64..2), 1..12),
        ) {
            let mut acts = Vec::new();
            let mut lost = Vec::new();
            let mut end_ns = 0;
            for (k, (late_ns, polls, slot)) in cycles.iter().enumerate() {
                let deadline_ns = (k as u64 + 2) * 1_000_000 + SPARING.phase_ns;
                let mut now_ns = deadline_ns + late_ns;
                acts.push((now_ns, Act::BeginCycle(deadline_ns)));
                for (node, (wait_ns, answer_ns)) in (1..).zip(polls) {
                    let due_ns = now_ns + wait_ns;
                    acts.push((now_ns, Act::BeginPoll(node, due_ns)));
                    // One that stays unanswered is left behind only when it has been looked at.
                    let end_ns = if answer_ns < wait_ns { now_ns + answer_ns } else { due_ns + SPARING.tick_ns + 256 };
                    if answer_ns >= wait_ns {
                        lost.push((due_ns, Event::PresTimeout { node }));
                    }
                    acts.push((end_ns, Act::EndPoll));
                    now_ns = end_ns + 1;
                    if now_ns + 450_000 > deadline_ns + 1_000_000 {
                        break;
                    }
                }
                if *slot == 1 {
                    acts.push((now_ns, Act::BeginAsync(9, now_ns + 150_000)));
                    lost.push((now_ns + 150_000, Event::AsyncTimeout { node: 9 }));
                }
                acts.push((now_ns + 10_000, Act::EndCycle(deadline_ns)));
                end_ns = deadline_ns + 999_000;
            }
            let (_, seen) = play(SPARING, &acts, end_ns);
            proptest::prop_assert_eq!(seen.len(), lost.len(), "{:?} {:?}", seen, lost);
            for ((seen_ns, seen), (due_ns, lost)) in seen.iter().zip(&lost) {
                proptest::prop_assert_eq!(seen, lost);
                proptest::prop_assert!(seen_ns >= due_ns && seen_ns - due_ns <= SPARING.tick_ns + 256, "{} for {}", seen_ns, due_ns);
            }
        }
    }

    #[test]
    fn ticks_at_which_nothing_can_be_due_are_slept_over_and_lateness_and_hang_are_seen_all_the_same() {
        let mut acts = Vec::new();
        for cycle in 2..102 {
            let deadline_ns = cycle * 1_000_000 + SPARING.phase_ns;
            acts.push((deadline_ns, Act::BeginCycle(deadline_ns)));
            for poll in 0..3 {
                let now_ns = deadline_ns + poll * 30_000;
                acts.push((now_ns, Act::BeginPoll(poll as u8 + 1, now_ns + 120_000)));
                acts.push((now_ns + 25_000, Act::EndPoll));
            }
            acts.push((deadline_ns + 95_000, Act::EndCycle(deadline_ns)));
        }
        let (ticks, seen) = play(SPARING, &acts, 102_300_000);
        assert_eq!(seen, []);
        assert!(ticks < 350, "{ticks} ticks in 100 cycles of 20");
        // Then it hangs: late by a quarter of a cycle, hung once five cycles have gone by.
        let (_, seen) = play(SPARING, &acts, 120_000_000);
        let last_ns = 101_375_000;
        let [
            (late_ns, Event::CycleLate { cycle: 102, .. }),
            (hung_ns, Event::CycleHung { cycle: 101, .. }),
        ] = seen[..]
        else {
            panic!("{seen:?}");
        };
        assert!(
            (last_ns + 1_250_000..=last_ns + 1_350_000).contains(&late_ns),
            "{late_ns}"
        );
        assert!(
            (last_ns + 6_000_000..=last_ns + 6_200_000).contains(&hung_ns),
            "{hung_ns}"
        );
    }

    #[test]
    fn the_thread_ticks_reports_and_ends() {
        let rt = Rt {
            keep_awake: Some(KeepAwake::None),
            lock_memory: false,
            ..Rt::default()
        };
        let process = Arc::new(crate::host::setup::prepare_process(&rt).unwrap());
        let watch = Arc::new(Watch::default());
        let (producer, mut consumer) = rtrb::RingBuffer::new(REPORTS);
        watch.begin_poll(5, 1);
        let thread = TimeoutThread::spawn(process, watch.clone(), LIMITS, producer).unwrap();
        while watch.counters().ticks < 2 * CPU_TIME_TICKS {
            std::thread::yield_now();
        }
        drop(thread);
        let counters = watch.counters();
        assert_eq!(counters.polls_lost, 1);
        assert_eq!(consumer.pop().unwrap().event, Event::PresTimeout { node: 5 });
        assert!(consumer.pop().is_err());
        assert!(counters.cpu_share > 0.0 && counters.cpu_share <= 1.0, "{counters:?}");
        assert_eq!(Arc::strong_count(&watch), 1);
    }
}
