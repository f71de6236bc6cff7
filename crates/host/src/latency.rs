//! What a core can do by itself, without any control: how late it wakes a thread, and how much time it takes away from one
//! that never sleeps. The floor under every figure of the cycle.
//!
//! In:  a core, a priority, a length, a flag that ends it early.
//! Out: [`WakeUpFigures`] and [`GapFigures`], and what of core and priority could not be had.
//!
//! Each probe runs in a FIFO thread of its own and does not return before it is over. Neither locks memory nor keeps the
//! core awake: where that is wanted, hold a [`super::setup::Process`]. The loops allocate nothing and take no lock.

use super::setup::{Finding, STACK_SIZE, enter_core};
use super::wait::{Grid, monotonic_ns, wait_until};
use crate::histogram::{Jitter, Summary};
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Distance of two windows of the gap scan, ns.
const WINDOW_PERIOD_NS: u64 = 10_000_000;
/// Length of a window. The rest belongs to everybody else: a FIFO thread that leaves a core less than 5 % is stopped for
/// 50 ms in each second, by the throttling up to Linux 6.11 and by the fair server from 6.12 on, and would measure that.
const WINDOW_NS: u64 = 9_000_000;
const _: () = assert!(WINDOW_NS <= WINDOW_PERIOD_NS / 100 * 90);
/// A longer step between two reads is a gap, unless the caller wants another limit, ns.
pub const GAP_NS: u64 = 1_000;

/// The wake-up probe, as `cyclictest -m -p PRIORITY -i PERIOD -a CPU` does it: sleeps to dates on a fixed grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WakeUp {
    /// Core of the thread.
    pub cpu: usize,
    /// SCHED_FIFO priority, 1 to 99.
    pub priority: u8,
    /// Distance of two wake-ups, above 0, ns.
    pub period_ns: u64,
    /// Offset of the dates from whole periods of CLOCK_MONOTONIC, ns.
    pub phase_ns: u64,
    /// Sleep to this long before the date, then spin, ns; 0 measures the wake-up itself.
    pub spin_ns: u64,
    /// How many wake-ups.
    pub cycles: u64,
}

/// What the wake-up probe has seen.
#[derive(Clone, Debug)]
pub struct WakeUpFigures {
    /// How late each wake-up was.
    pub lateness: Jitter,
    /// From one wake-up to the next, where none was left out between them.
    pub period: Jitter,
    /// Dates left out because they had passed when the thread came to them.
    pub skipped: u64,
    /// What could not be had.
    pub findings: Vec<Finding>,
}

/// [`WakeUpFigures`] for a report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WakeUpSummary {
    /// How late each wake-up was.
    pub lateness: Summary,
    /// From one wake-up to the next.
    pub period: Summary,
    /// Dates left out.
    pub skipped: u64,
}

impl WakeUp {
    /// The number of wake-ups that lasts this long.
    #[must_use]
    pub fn lasting(self, duration: Duration) -> WakeUp {
        let cycles = (duration.as_nanos() / u128::from(self.period_ns)).max(1);
        WakeUp {
            cycles: u64::try_from(cycles).unwrap_or(u64::MAX),
            ..self
        }
    }

    /// Runs the probe; `stop` ends it at the next wake-up.
    pub fn run(&self, stop: &AtomicBool) -> WakeUpFigures {
        let mut figures = WakeUpFigures::new(self.period_ns);
        self.run_into(stop, &mut figures);
        figures
    }

    /// As [`WakeUp::run`], on top of what another run with the same period has found.
    pub fn run_into(&self, stop: &AtomicBool, figures: &mut WakeUpFigures) {
        on_a_thread(self.cpu, self.priority, |findings| {
            figures.findings = findings;
            self.measure(&mut System, stop, figures);
        });
    }

    /// RT: the loop of the probe.
    fn measure(&self, clock: &mut impl Clock, stop: &AtomicBool, figures: &mut WakeUpFigures) {
        let grid = Grid {
            period_ns: self.period_ns,
            phase_ns: self.phase_ns,
            late_max_ns: 0,
        };
        let mut deadline_ns = grid.first_after(clock.now_ns() + self.spin_ns);
        let mut last_ns = None;
        for _ in 0..self.cycles {
            if stop.load(Ordering::Relaxed) {
                return;
            }
            let woke_ns = clock.wait_until(deadline_ns, self.spin_ns);
            figures.lateness.record(woke_ns - deadline_ns);
            let next = grid.next(deadline_ns, clock.now_ns());
            if let Some(last_ns) = last_ns {
                figures.period.record(woke_ns - last_ns);
            }
            last_ns = (next.skipped == 0).then_some(woke_ns);
            figures.skipped += next.skipped;
            deadline_ns = next.deadline_ns;
        }
    }
}

impl WakeUpFigures {
    /// Nothing seen yet.
    pub fn new(period_ns: u64) -> WakeUpFigures {
        WakeUpFigures {
            lateness: Jitter::new(0),
            period: Jitter::new(period_ns),
            skipped: 0,
            findings: Vec::new(),
        }
    }

    /// For a report.
    pub fn summary(&self) -> WakeUpSummary {
        WakeUpSummary {
            lateness: self.lateness.summary(),
            period: self.period.summary(),
            skipped: self.skipped,
        }
    }
}

/// The gap scan: a FIFO thread reads a counter without pause and notes every step that is too long. What it finds is what
/// takes a running thread off the core: interrupts, the hypervisor, firmware (SMI). It looks during 9 of each 10 ms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GapScan {
    /// Core of the thread.
    pub cpu: usize,
    /// SCHED_FIFO priority, 1 to 99.
    pub priority: u8,
    /// A step from this on is a gap, ns: [`GAP_NS`].
    pub threshold_ns: u64,
    /// How long, with the pauses.
    pub duration: Duration,
}

/// What the gap scan has seen.
#[derive(Clone, Debug)]
pub struct GapFigures {
    /// Length of each gap.
    pub gaps: Jitter,
    /// All gaps together, ns.
    pub lost_ns: u64,
    /// Time that was looked at, ns.
    pub scanned_ns: u64,
    /// Reads of the counter.
    pub reads: u64,
    /// What could not be had.
    pub findings: Vec<Finding>,
}

/// [`GapFigures`] for a report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapSummary {
    /// Length of each gap.
    pub gaps: Summary,
    /// All gaps together, µs.
    pub lost_us: f64,
    /// The same as a share of the time that was looked at, 0 to 1.
    pub lost_share: f64,
    /// Time that was looked at, s.
    pub scanned_s: f64,
    /// Mean distance of two reads between the gaps: nothing shorter can be seen, ns.
    pub step_ns: f64,
}

impl GapScan {
    /// Runs the scan; `stop` ends it at the next window.
    pub fn run(&self, stop: &AtomicBool) -> GapFigures {
        let mut figures = GapFigures::new();
        self.run_into(stop, &mut figures);
        figures
    }

    /// As [`GapScan::run`], on top of what another run has found.
    pub fn run_into(&self, stop: &AtomicBool, figures: &mut GapFigures) {
        on_a_thread(self.cpu, self.priority, |findings| {
            figures.findings = findings;
            #[cfg(target_arch = "x86_64")]
            if let Some(ticks_per_ns) = tsc::ticks_per_ns() {
                return self.measure(tsc::read, ticks_per_ns, stop, figures);
            }
            self.measure(monotonic_ns, 1.0, stop, figures);
        });
    }

    /// RT: the windows of the scan and the pauses between them.
    fn measure(&self, read: impl Fn() -> u64, ticks_per_ns: f64, stop: &AtomicBool, figures: &mut GapFigures) {
        let ticks = |ns: u64| (ns as f64 * ticks_per_ns) as u64;
        let ns = |ticks: u64| (ticks as f64 / ticks_per_ns) as u64;
        let grid = Grid {
            period_ns: WINDOW_PERIOD_NS,
            phase_ns: 0,
            late_max_ns: 0,
        };
        let over_ns = monotonic_ns().saturating_add(u64::try_from(self.duration.as_nanos()).unwrap_or(u64::MAX));
        let mut deadline_ns = grid.first_after(monotonic_ns());
        while deadline_ns < over_ns && !stop.load(Ordering::Relaxed) {
            wait_until(deadline_ns, 0);
            let window = scan(&read, ticks(WINDOW_NS), ticks(self.threshold_ns), |gap| {
                figures.gaps.record(ns(gap));
                figures.lost_ns += ns(gap);
            });
            figures.scanned_ns += ns(window.ticks);
            figures.reads += window.reads;
            deadline_ns = grid.next(deadline_ns, monotonic_ns()).deadline_ns;
        }
    }
}

impl Default for GapFigures {
    fn default() -> GapFigures {
        GapFigures::new()
    }
}

impl GapFigures {
    /// Nothing seen yet.
    pub fn new() -> GapFigures {
        GapFigures {
            gaps: Jitter::new(0),
            lost_ns: 0,
            scanned_ns: 0,
            reads: 0,
            findings: Vec::new(),
        }
    }

    /// For a report.
    pub fn summary(&self) -> GapSummary {
        let scanned_ns = self.scanned_ns as f64;
        let lost_ns = self.lost_ns as f64;
        let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        GapSummary {
            gaps: self.gaps.summary(),
            lost_us: lost_ns / 1e3,
            lost_share: share(lost_ns, scanned_ns),
            scanned_s: scanned_ns / 1e9,
            step_ns: share(scanned_ns - lost_ns, self.reads as f64 - self.gaps.n() as f64),
        }
    }
}

/// What one window came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Window {
    /// From the first read to the last.
    ticks: u64,
    /// Steps between two reads.
    reads: u64,
}

/// RT: reads a counter until it has gone on by `length`; every step of at least `threshold` goes to `gap`.
fn scan(read: impl Fn() -> u64, length: u64, threshold: u64, mut gap: impl FnMut(u64)) -> Window {
    let first = read();
    let mut last = first;
    let mut reads = 0;
    while last - first < length {
        // A counter that went back would be a fault of the PC, not of this loop: it is taken as standing still.
        let now = read().max(last);
        if now - last >= threshold {
            gap(now - last);
        }
        last = now;
        reads += 1;
    }
    Window {
        ticks: last - first,
        reads,
    }
}

/// The time-stamp counter: the cheapest look at time that there is, some 10 ns.
#[cfg(target_arch = "x86_64")]
mod tsc {
    use super::{Duration, monotonic_ns};

    /// Between two comparisons with CLOCK_MONOTONIC.
    const INTERVAL: Duration = Duration::from_millis(5);

    /// RT: the counter.
    pub(super) fn read() -> u64 {
        // SAFETY: reads a counter; every x86_64 has the instruction, and Linux lets ordinary programs use it.
        unsafe { core::arch::x86_64::_rdtsc() }
    }

    /// How fast the counter runs; `None`: not at one speed, so it is no clock.
    pub(super) fn ticks_per_ns() -> Option<f64> {
        let stamps = [(); 3].map(|()| {
            std::thread::sleep(INTERVAL);
            stamp()
        });
        rate(&stamps)
    }

    /// Counter and clock at one time: the closest of a few tries.
    fn stamp() -> (u64, u64) {
        let tries = [(); 8].map(|()| {
            let before = read();
            let now_ns = monotonic_ns();
            (read().saturating_sub(before), before, now_ns)
        });
        let (width, before, now_ns) = tries.into_iter().min().unwrap_or_default();
        (before + width / 2, now_ns)
    }

    /// Ticks per ns over three stamps, if both halves agree within 1 %.
    pub(super) fn rate(stamps: &[(u64, u64); 3]) -> Option<f64> {
        let rate = |from: (u64, u64), to: (u64, u64)| {
            let (ticks, ns) = (to.0.checked_sub(from.0)?, to.1.checked_sub(from.1)?);
            (ticks > 0 && ns > 0).then(|| ticks as f64 / ns as f64)
        };
        let [first, middle, last] = *stamps;
        let halves = rate(first, middle)? / rate(middle, last)?;
        (0.99..=1.01).contains(&halves).then(|| rate(first, last)).flatten()
    }
}

/// The clock of the wake-up probe; tests have another one.
pub(super) trait Clock {
    fn now_ns(&mut self) -> u64;
    /// Returns at `deadline_ns` or later, with the time now.
    fn wait_until(&mut self, deadline_ns: u64, spin_ns: u64) -> u64;
}

/// CLOCK_MONOTONIC.
pub(super) struct System;

impl Clock for System {
    fn now_ns(&mut self) -> u64 {
        monotonic_ns()
    }

    fn wait_until(&mut self, deadline_ns: u64, spin_ns: u64) -> u64 {
        wait_until(deadline_ns, spin_ns)
    }
}

/// Runs `probe` in a real-time thread of its own; it is told what the thread could not get.
pub(super) fn on_a_thread(cpu: usize, priority: u8, probe: impl FnOnce(Vec<Finding>) + Send) {
    let run = || probe(enter_core(cpu, priority));
    std::thread::scope(|scope| {
        // Where no thread can be had the figures stay as they are: empty, n = 0.
        let _ = std::thread::Builder::new()
            .name("rt-probe".into())
            .stack_size(STACK_SIZE)
            .spawn_scoped(scope, run);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// A clock on which each wake-up is late by the next of some times, and each look at the time takes 10 ns.
    struct Made<'a> {
        now_ns: u64,
        late_ns: std::slice::Iter<'a, u64>,
        dates: Vec<u64>,
    }

    impl Clock for Made<'_> {
        fn now_ns(&mut self) -> u64 {
            self.now_ns += 10;
            self.now_ns
        }

        fn wait_until(&mut self, deadline_ns: u64, spin_ns: u64) -> u64 {
            assert_eq!(spin_ns, 7);
            self.dates.push(deadline_ns);
            self.now_ns = deadline_ns + self.late_ns.next().expect("no more wake-ups than wanted");
            self.now_ns
        }
    }

    const PROBE: WakeUp = WakeUp {
        cpu: 0,
        priority: 80,
        period_ns: 1000,
        phase_ns: 370,
        spin_ns: 7,
        cycles: 5,
    };

    #[test]
    fn lateness_and_period_count_what_was_and_leave_out_what_has_passed() {
        let late_ns = [1, 3, 2000, 0, 4];
        let mut clock = Made {
            now_ns: 5000,
            late_ns: late_ns.iter(),
            dates: Vec::new(),
        };
        let mut figures = WakeUpFigures::new(1000);
        PROBE.measure(&mut clock, &AtomicBool::new(false), &mut figures);
        // The third wake-up, of 7370, came at 9370: 8370 and (the look at the time takes 10 ns) 9370 have passed.
        assert_eq!(clock.dates, [5370, 6370, 7370, 10370, 11370]);
        assert_eq!((figures.skipped, figures.lateness.n(), figures.period.n()), (2, 5, 3));
        let summary = figures.summary();
        assert_eq!((summary.lateness.min_us, summary.lateness.max_us), (0.0, 2.0));
        // 5371 to 6373, 6373 to 9370, (nothing over the gap), 10370 to 11374.
        assert_eq!((summary.period.min_us, summary.period.max_us), (1.002, 2.997));
    }

    #[test]
    fn a_probe_that_is_told_to_stop_stops() {
        let mut clock = Made {
            now_ns: 0,
            late_ns: [].iter(),
            dates: Vec::new(),
        };
        let mut figures = WakeUpFigures::new(1000);
        PROBE.measure(&mut clock, &AtomicBool::new(true), &mut figures);
        assert_eq!((figures.summary(), clock.dates), (WakeUpSummary::default(), vec![]));
    }

    #[test]
    fn a_duration_is_whole_cycles_and_at_least_one() {
        let lasting = |ns| PROBE.lasting(Duration::from_nanos(ns)).cycles;
        assert_eq!((lasting(10_999), lasting(10), lasting(2000)), (10, 1, 2));
    }

    #[test]
    fn a_scan_sees_every_step_from_the_threshold_on() {
        // Steps of 1, one of 50, one of 49.
        let times = [100, 101, 151, 152, 201, 202, 203];
        let at = Cell::new(0);
        let read = || {
            let now = times[at.get()];
            at.set(at.get() + 1);
            now
        };
        let mut gaps = Vec::new();
        let window = scan(read, 102, 50, |gap| gaps.push(gap));
        assert_eq!((gaps, window), (vec![50], Window { ticks: 102, reads: 5 }));
    }

    #[test]
    fn lost_time_is_a_share_of_the_time_looked_at() {
        let mut figures = GapFigures::new();
        assert_eq!(figures.summary(), GapSummary::default());
        figures.gaps.record(3000);
        figures.lost_ns = 3000;
        figures.scanned_ns = 30_000;
        figures.reads = 2701;
        let summary = figures.summary();
        assert_eq!((summary.lost_us, summary.lost_share, summary.step_ns), (3.0, 0.1, 10.0));
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn a_counter_is_a_clock_if_it_runs_at_one_speed() {
        assert_eq!(tsc::rate(&[(0, 0), (2000, 1000), (4000, 2000)]), Some(2.0));
        assert_eq!(tsc::rate(&[(0, 0), (2000, 1000), (4100, 2000)]), None);
        assert_eq!(tsc::rate(&[(0, 0), (2000, 1000), (2000, 2000)]), None);
        assert_eq!(tsc::rate(&[(5000, 0), (2000, 1000), (4000, 2000)]), None);
    }

    #[test]
    fn both_probes_run_on_this_pc_with_or_without_rights() {
        let stop = AtomicBool::new(false);
        let probe = WakeUp {
            period_ns: 1_000_000,
            spin_ns: 0,
            ..PROBE
        };
        let mut figures = probe.run(&stop);
        assert_eq!((figures.lateness.n(), figures.period.nominal_ns()), (5, 1_000_000));
        probe.run_into(&stop, &mut figures);
        assert_eq!(figures.lateness.n(), 10);

        let scan = GapScan {
            cpu: 0,
            priority: 80,
            threshold_ns: GAP_NS,
            duration: Duration::from_millis(40),
        };
        let gaps = scan.run(&stop);
        assert!(gaps.scanned_ns >= WINDOW_NS && gaps.reads > 0, "{gaps:?}");
        assert!(gaps.lost_ns <= gaps.scanned_ns);
        assert_eq!(
            gaps.findings, figures.findings,
            "both ask for the same core and priority"
        );
        stop.store(true, Ordering::Relaxed);
        assert_eq!(scan.run(&stop).reads, 0);
    }
}
