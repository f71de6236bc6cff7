//! The figures of a cycle: recorded every cycle in constant memory, shown on pins, handed out in windows.
//!
//! In:  the times of each cycle ([`CycleTimes`]); wishes to count from now ([`Windows::cut`]).
//! Out: [`CycleFigures`] (everything of a window, with histograms); [`Recent`] (the last second, for the pins).
//!
//! Nothing is cleared in real time: an ordinary thread hands in empty figures through a ring, the cycle thread takes them
//! at the next cycle boundary and sends the full ones back.

use super::phase::{Phase, PhaseFigures};
use super::recent::{Recent, Second};
use host::histogram::{Jitter, Summary};
use nix::sys::resource::{UsageWho, getrusage};
use serde::{Deserialize, Serialize};

/// What a thread has had to bear since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ThreadUsage {
    /// Page faults, minor and major: memory that was not there when it was needed.
    pub page_faults: u64,
    /// Involuntary context switches: another thread was given the core.
    pub preemptions: u64,
}

impl ThreadUsage {
    /// What has come since an earlier look at the same thread.
    pub fn since(self, earlier: ThreadUsage) -> ThreadUsage {
        ThreadUsage {
            page_faults: self.page_faults.saturating_sub(earlier.page_faults),
            preemptions: self.preemptions.saturating_sub(earlier.preemptions),
        }
    }
}

/// RT: what the calling thread has had to bear. A system call: not in every cycle.
pub fn thread_usage() -> ThreadUsage {
    // Exists on every Linux: an error cannot come.
    getrusage(UsageWho::RUSAGE_THREAD).map_or_else(
        |_| ThreadUsage::default(),
        |usage| ThreadUsage {
            page_faults: (usage.minor_page_faults() + usage.major_page_faults()) as u64,
            preemptions: usage.involuntary_context_switches() as u64,
        },
    )
}

/// When what of a cycle happened, ns of CLOCK_MONOTONIC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CycleTimes {
    /// Date of the cycle on the grid.
    pub deadline_ns: u64,
    /// The thread had woken up and waited out its spin.
    pub woke_ns: u64,
    /// The SoC was handed to the network adapter; `None` in a cycle without one (the network boots or is silenced).
    pub soc_ns: Option<u64>,
    /// The exchange was over.
    pub exchanged_ns: u64,
    /// Everything of the cycle was computed.
    pub ended_ns: u64,
    /// Date of the next cycle if none is left out.
    pub next_ns: u64,
    /// Cycles left out before this one.
    pub skipped: u64,
    /// Answers of nodes (PRes) that did not come in time.
    pub pres_lost: u32,
    /// By how much it began behind its date by the clock of the bus, ns, where that clock leads.
    pub phase_ns: Option<i64>,
}

/// Everything recorded of a number of cycles. Some 90 KiB: on the heap.
#[derive(Clone, Debug)]
pub struct CycleFigures {
    /// Cycles that ran.
    pub cycles: u64,
    /// Cycles left out because the one before ended, or this one would have begun, too late.
    pub skipped: u64,
    /// Answers of nodes that did not come in time.
    pub pres_lost: u64,
    /// Distance from one SoC to the next one, as sent.
    pub period: Jitter,
    /// How long after its date the SoC was sent.
    pub lateness: Jitter,
    /// How long after its date the thread was awake; the rest of the lateness is the way to the network adapter.
    pub wake_up: Jitter,
    /// From the SoC to the end of the exchange with all nodes.
    pub exchange: Jitter,
    /// From the end of the exchange to the end of the cycle: drives, pins, interpolation, copies.
    pub compute: Jitter,
    /// From there to the date of the next cycle; 0 where that had passed.
    pub free: Jitter,
    /// How the dates lie to the clock of the bus, where that clock leads.
    pub phase: Phase,
    /// What the cycle thread had to bear meanwhile.
    pub thread: ThreadUsage,
}

/// [`CycleFigures`] without their histograms; times in µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FiguresSummary {
    /// Cycles that ran.
    pub cycles: u64,
    /// Cycles left out.
    pub skipped: u64,
    /// Answers of nodes that did not come in time.
    pub pres_lost: u64,
    /// Distance from one SoC to the next one, as sent.
    pub period: Summary,
    /// How long after its date the SoC was sent.
    pub lateness: Summary,
    /// How long after its date the thread was awake.
    pub wake_up: Summary,
    /// Exchange with all nodes.
    pub exchange: Summary,
    /// Drives, pins, interpolation, copies.
    pub compute: Summary,
    /// Time left up to the next cycle.
    pub free: Summary,
    /// How the dates lie to the clock of the bus, where that clock leads.
    pub phase: Option<PhaseFigures>,
    /// What the cycle thread had to bear.
    pub thread: ThreadUsage,
}

impl CycleFigures {
    /// Nothing recorded yet, for cycles of this period. Not in real time.
    pub fn new(period_ns: u64) -> Box<CycleFigures> {
        Box::new(CycleFigures {
            cycles: 0,
            skipped: 0,
            pres_lost: 0,
            period: Jitter::new(period_ns),
            lateness: Jitter::new(0),
            wake_up: Jitter::new(0),
            exchange: Jitter::new(0),
            compute: Jitter::new(0),
            free: Jitter::new(0),
            phase: Phase::default(),
            thread: ThreadUsage::default(),
        })
    }

    /// The same without histograms.
    pub fn summary(&self) -> FiguresSummary {
        FiguresSummary {
            cycles: self.cycles,
            skipped: self.skipped,
            pres_lost: self.pres_lost,
            period: self.period.summary(),
            lateness: self.lateness.summary(),
            wake_up: self.wake_up.summary(),
            exchange: self.exchange.summary(),
            compute: self.compute.summary(),
            free: self.free.summary(),
            phase: self.phase.figures(),
            thread: self.thread,
        }
    }
}

/// What the pins show of the time of a cycle, ns. The seconds change once a second; all zero before the first is over.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Timing {
    /// Lateness of the SoC in this cycle.
    pub lateness_ns: u64,
    /// What the distance from the SoC before to that of this cycle differs from the cycle; `None`: there was none, or cycles were left
    /// out.
    pub period_difference_ns: Option<i64>,
    /// Greatest lateness so far.
    pub late_max_ns: u64,
    /// Exchange in this cycle.
    pub exchange_ns: u64,
    /// Computing in this cycle.
    pub compute_ns: u64,
    /// Time left in this cycle.
    pub free_ns: u64,
    /// Cycles so far.
    pub cycles: u64,
    /// Cycles left out so far.
    pub skipped: u64,
    /// Answers that did not come so far.
    pub pres_lost: u64,
    /// The last whole second.
    pub second: LastSecond,
}

/// The last whole second of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LastSecond {
    /// Distance from SoC to SoC.
    pub period: Second,
    /// Lateness of the SoC.
    pub lateness: Second,
    pub exchange: Second,
    pub compute: Second,
    pub free: Second,
}

/// The cycle thread's end: takes every cycle in.
pub struct Recorder {
    figures: Box<CycleFigures>,
    fresh: rtrb::Consumer<Box<CycleFigures>>,
    full: rtrb::Producer<Box<CycleFigures>>,
    thread_began: ThreadUsage,
    soc_before_ns: Option<u64>,
    timing: Timing,
    period: Recent,
    lateness: Recent,
    exchange: Recent,
    compute: Recent,
    free: Recent,
}

/// The other end, for one ordinary thread: cuts the run into windows while it goes on.
pub struct Windows {
    period_ns: u64,
    fresh: rtrb::Producer<Box<CycleFigures>>,
    full: rtrb::Consumer<Box<CycleFigures>>,
}

/// A recorder for cycles of this period, and what cuts its windows. Not in real time.
pub fn recorder(period_ns: u64) -> (Recorder, Windows) {
    let (fresh, fresh_out) = rtrb::RingBuffer::new(1);
    let (full_in, full) = rtrb::RingBuffer::new(1);
    let cycles_a_second = (1_000_000_000 / period_ns.max(1)).clamp(1, u64::from(u16::MAX)) as u32;
    let recorder = Recorder {
        figures: CycleFigures::new(period_ns),
        fresh: fresh_out,
        full: full_in,
        thread_began: ThreadUsage::default(),
        soc_before_ns: None,
        timing: Timing::default(),
        period: Recent::new(period_ns, cycles_a_second),
        lateness: Recent::new(0, cycles_a_second),
        exchange: Recent::new(0, cycles_a_second),
        compute: Recent::new(0, cycles_a_second),
        free: Recent::new(0, cycles_a_second),
    };
    let windows = Windows { period_ns, fresh, full };
    (recorder, windows)
}

impl Windows {
    /// Ends the window under way at the next cycle boundary and counts from there again; what it held is then to be had from
    /// [`Windows::last`]. `false`: the end of the window before has not been taken yet, nothing happens.
    pub fn cut(&mut self) -> bool {
        // Both rings hold one: there is room for the full one before the empty one leaves.
        self.full.is_empty() && self.fresh.push(CycleFigures::new(self.period_ns)).is_ok()
    }

    /// The window that ended with the last cut, once the cycle thread has come by. The last window of all is what
    /// `thread::run` returns.
    pub fn last(&mut self) -> Option<Box<CycleFigures>> {
        self.full.pop().ok()
    }
}

impl Recorder {
    /// RT: the thread begins; what it has had to bear up to now does not count.
    pub fn begin(&mut self) {
        self.thread_began = thread_usage();
    }

    /// RT: takes a cycle in, after its end. A constant time; one system call where a window is cut.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn record(&mut self, times: &CycleTimes) {
        if let Ok(fresh) = self.fresh.pop() {
            self.cut(fresh);
        }
        let figures = &mut *self.figures;
        let timing = &mut self.timing;
        figures.cycles += 1;
        figures.skipped += times.skipped;
        figures.pres_lost += u64::from(times.pres_lost);
        timing.cycles += 1;
        timing.skipped += times.skipped;
        timing.pres_lost += u64::from(times.pres_lost);

        timing.period_difference_ns = None;
        figures.wake_up.record(times.woke_ns.saturating_sub(times.deadline_ns));
        if let Some(soc_ns) = times.soc_ns {
            let lateness_ns = soc_ns.saturating_sub(times.deadline_ns);
            figures.lateness.record(lateness_ns);
            timing.lateness_ns = lateness_ns;
            timing.late_max_ns = timing.late_max_ns.max(lateness_ns);
            if let Some(second) = self.lateness.record(lateness_ns) {
                timing.second.lateness = second;
            }
            // Over cycles left out there is no period.
            if let Some(before_ns) = self.soc_before_ns
                && times.skipped == 0
            {
                let period_ns = soc_ns - before_ns;
                figures.period.record(period_ns);
                timing.period_difference_ns = Some(period_ns as i64 - figures.period.nominal_ns() as i64);
                if let Some(second) = self.period.record(period_ns) {
                    timing.second.period = second;
                }
            }
            timing.exchange_ns = times.exchanged_ns.saturating_sub(soc_ns);
            figures.exchange.record(timing.exchange_ns);
            if let Some(second) = self.exchange.record(timing.exchange_ns) {
                timing.second.exchange = second;
            }
        }
        self.soc_before_ns = times.soc_ns;
        if let Some(phase_ns) = times.phase_ns {
            figures.phase.record(phase_ns);
        }

        timing.compute_ns = times.ended_ns.saturating_sub(times.exchanged_ns);
        figures.compute.record(timing.compute_ns);
        if let Some(second) = self.compute.record(timing.compute_ns) {
            timing.second.compute = second;
        }
        timing.free_ns = times.next_ns.saturating_sub(times.ended_ns);
        figures.free.record(timing.free_ns);
        if let Some(second) = self.free.record(timing.free_ns) {
            timing.second.free = second;
        }
    }

    /// RT: what the pins show.
    pub fn timing(&self) -> &Timing {
        &self.timing
    }

    /// The last window. The thread has done its last cycle.
    pub fn end(mut self) -> Box<CycleFigures> {
        self.figures.thread = thread_usage().since(self.thread_began);
        self.figures
    }

    /// RT: from here on into empty figures.
    fn cut(&mut self, fresh: Box<CycleFigures>) {
        let now = thread_usage();
        let mut full = std::mem::replace(&mut self.figures, fresh);
        full.thread = now.since(std::mem::replace(&mut self.thread_began, now));
        // `Windows::cut` has seen to the room; should there be none, leaking is what real time can afford.
        if let Err(rtrb::PushError::Full(full)) = self.full.push(full) {
            std::mem::forget(full);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// Cycle `k`, its SoC this late.
    fn cycle(k: u64, late_ns: u64) -> CycleTimes {
        let deadline_ns = k * PERIOD_NS + 370_000;
        CycleTimes {
            deadline_ns,
            woke_ns: deadline_ns + late_ns - 500,
            soc_ns: Some(deadline_ns + late_ns),
            exchanged_ns: deadline_ns + late_ns + 60_000,
            ended_ns: deadline_ns + late_ns + 64_000,
            next_ns: deadline_ns + PERIOD_NS,
            skipped: 0,
            pres_lost: 0,
            phase_ns: None,
        }
    }

    #[test]
    fn a_cycle_is_cut_into_its_parts() {
        let (mut recorder, _windows) = recorder(PERIOD_NS);
        recorder.begin();
        recorder.record(&cycle(1, 1_000));
        recorder.record(&cycle(2, 3_000));
        let timing = recorder.timing();
        assert_eq!(
            (
                timing.lateness_ns,
                timing.exchange_ns,
                timing.compute_ns,
                timing.free_ns
            ),
            (3_000, 60_000, 4_000, 933_000)
        );
        let figures = recorder.end();
        assert_eq!(figures.period.value_at_quantile(1.0), 1_002_000);
        assert_eq!(figures.wake_up.max_ns(), Some(2_500));
        let summary = figures.summary();
        assert_eq!((summary.cycles, summary.period.n, summary.lateness.n), (2, 1, 2));
        assert_eq!((summary.exchange.mean_us, summary.compute.mean_us), (60.0, 4.0));
        assert_eq!((summary.free.min_us, summary.free.max_us), (933.0, 935.0));
    }

    #[test]
    fn cycles_left_out_make_no_period_and_are_counted_with_lost_answers() {
        let (mut recorder, _windows) = recorder(PERIOD_NS);
        recorder.record(&cycle(1, 1_000));
        let overrun = CycleTimes {
            skipped: 2,
            pres_lost: 3,
            ..cycle(4, 1_000)
        };
        recorder.record(&overrun);
        // One without SoC breaks the chain of periods, too, and one that ends behind its successor's date has no time left.
        let silent = CycleTimes {
            soc_ns: None,
            ..cycle(5, 1_000)
        };
        recorder.record(&silent);
        let long = CycleTimes {
            ended_ns: 7 * PERIOD_NS + 400_000,
            ..cycle(6, 1_000)
        };
        recorder.record(&long);
        assert_eq!(recorder.timing().free_ns, 0);
        recorder.record(&cycle(7, 1_000));
        let figures = recorder.end();
        assert_eq!((figures.cycles, figures.skipped, figures.pres_lost), (5, 2, 3));
        assert_eq!(
            (figures.period.n(), figures.lateness.n(), figures.compute.n()),
            (1, 4, 5)
        );
    }

    #[test]
    fn windows_are_cut_at_a_cycle_boundary_and_lose_nothing() {
        let (mut recorder, mut windows) = recorder(PERIOD_NS);
        recorder.record(&cycle(1, 1_000));
        assert!(windows.cut());
        assert!(!windows.cut(), "the first cut is still to come");
        assert!(windows.last().is_none());
        recorder.record(&cycle(2, 5_000));
        assert!(!windows.cut(), "what came of the first cut has not been taken");
        let first = windows.last().expect("the first window");
        assert_eq!((first.cycles, first.lateness.max_ns()), (1, Some(1_000)));
        recorder.record(&cycle(3, 5_000));
        assert!(windows.cut());
        recorder.record(&cycle(4, 7_000));
        let second = windows.last().expect("the second window");
        // The period that reaches over the border belongs to the window in which it ends.
        assert_eq!((second.cycles, second.period.n()), (2, 2));
        assert_eq!(recorder.end().lateness.max_ns(), Some(7_000));
    }

    #[test]
    fn the_last_second_is_shown_once_it_is_over() {
        let (mut recorder, _windows) = recorder(PERIOD_NS);
        for k in 1..1000 {
            recorder.record(&cycle(k, 1_000 + k % 2 * 1_000));
        }
        assert_eq!(recorder.timing().second, LastSecond::default());
        recorder.record(&cycle(1000, 1_000));
        recorder.record(&cycle(1001, 9_000));
        let timing = recorder.timing();
        assert_eq!(
            (timing.second.lateness.mean_ns, timing.second.lateness.std_ns),
            (1_500.0, 500.0)
        );
        assert_eq!((timing.second.period.max_ns, timing.late_max_ns), (1_008_000, 9_000));
        assert_eq!(
            (timing.second.free.min_ns, timing.second.free.max_ns),
            (934_000, 935_000)
        );
    }

    #[test]
    fn usage_is_what_the_kernel_counts_for_this_thread() {
        let kernel = || {
            let stat = std::fs::read_to_string("/proc/thread-self/stat").expect("Linux");
            // Behind the name, which may hold blanks: state is the first, minflt the 8th, majflt the 10th.
            let (_, fields) = stat.rsplit_once(')').expect("a name");
            let fields: Vec<&str> = fields.split_whitespace().collect();
            let number = |at: usize| fields[at].parse::<u64>().expect("a number");
            number(7) + number(9)
        };
        let before = kernel();
        let usage = thread_usage();
        let after = kernel();
        assert!(
            (before..=after).contains(&usage.page_faults),
            "{before} {usage:?} {after}"
        );
        let later = ThreadUsage {
            page_faults: usage.page_faults + 2,
            preemptions: usage.preemptions + 1,
        };
        let since = later.since(usage);
        assert_eq!((since.page_faults, since.preemptions), (2, 1));
    }
}
