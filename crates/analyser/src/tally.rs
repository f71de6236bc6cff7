//! The measurement itself, on frames that come from anywhere.
//!
//! In:  stamped frames in the order in which they came.
//! Out: [`SocReport`]. Constant memory for any number of cycles.

use super::maxima::Maxima;
use super::report::{Breaks, FrameCounts, SocReport, StampSource};
use super::stamps::Stamps;
use bus::frames::FrameKind;
use host::histogram::Jitter;

/// A gap of more cycles is a network that was stopped and started, unless the window says otherwise.
const RESTART_CYCLES: u64 = 10;

/// What is measured from when until when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Nominal period, µs.
    pub cycle_us: u32,
    /// Measures no more periods than these.
    pub periods_max: u64,
    /// A longer gap is a network that was stopped and started, and no period, ns.
    pub restart_ns: u64,
}

impl Window {
    /// All that comes; a gap of more than ten cycles is a network stopped and started.
    pub fn open(cycle_us: u32) -> Window {
        Window {
            cycle_us,
            periods_max: u64::MAX,
            restart_ns: RESTART_CYCLES * u64::from(cycle_us) * 1000,
        }
    }

    /// All that comes, and every gap is a period: whoever opens the window knows that the network runs throughout.
    pub fn without_restarts(cycle_us: u32) -> Window {
        Window {
            restart_ns: u64::MAX,
            ..Window::open(cycle_us)
        }
    }
}

/// Everything counted in one window.
pub(super) struct Tally {
    window: Window,
    frames: FrameCounts,
    frames_dropped: u64,
    clock_steps: u64,
    kernel: Periods,
    hardware: Periods,
}

impl Tally {
    pub(super) fn new(window: Window) -> Tally {
        Tally {
            window,
            frames: FrameCounts::default(),
            frames_dropped: 0,
            clock_steps: 0,
            kernel: Periods::new(window),
            hardware: Periods::new(window),
        }
    }

    /// Takes a frame in. Sent ones (`incoming` false) are counted only: they were not yet on the wire when they were stamped.
    pub(super) fn add(&mut self, kind: FrameKind, stamps: Stamps, incoming: bool) {
        let Tally { frames, .. } = self;
        match kind {
            FrameKind::Soc => frames.soc += 1,
            FrameKind::PReq => frames.preq += 1,
            FrameKind::PRes => frames.pres += 1,
            FrameKind::SoA => frames.soa += 1,
            FrameKind::Asnd => frames.asnd += 1,
            FrameKind::Other => frames.other += 1,
            FrameKind::Foreign => frames.foreign += 1,
        }
        for (periods, stamp_ns) in [
            (&mut self.kernel, stamps.kernel_ns),
            (&mut self.hardware, stamps.hardware_ns),
        ] {
            match stamp_ns {
                Some(stamp_ns) if kind == FrameKind::Soc && incoming => periods.soc(stamp_ns),
                Some(_) => {}
                None => {
                    periods.unstamped += 1;
                    if kind == FrameKind::Soc {
                        periods.last_ns = None;
                    }
                }
            }
        }
    }

    /// The frame that comes next is one of EtherCAT, or not.
    pub(super) fn is_of(&mut self, ethercat: bool) {
        self.frames.ethercat += u64::from(ethercat);
    }

    /// Counts a frame whose stamp is not to be believed.
    pub(super) fn add_unmeasured(&mut self, kind: FrameKind) {
        self.add(kind, Stamps::default(), false);
        self.kernel.unstamped -= 1;
        self.hardware.unstamped -= 1;
    }

    /// The kernel's clock was stepped: what came before is no measure for what comes now.
    pub(super) fn clock_stepped(&mut self) {
        self.clock_steps += 1;
        self.kernel.last_ns = None;
    }

    /// Frames were lost for lack of room.
    pub(super) fn dropped(&mut self, frames: u64) {
        self.frames_dropped += frames;
    }

    /// What is known so far. The card's stamps are used if it stamped the most part of the SoC.
    pub(super) fn report(&self, interface: &str) -> SocReport {
        let hardware = self.hardware.periods.n() > self.kernel.periods.n() / 2;
        let (stamps, of) = match hardware {
            true => (StampSource::Hardware, &self.hardware),
            false => (StampSource::Kernel, &self.kernel),
        };
        let figures = of.periods.summary();
        SocReport {
            interface: interface.to_owned(),
            cycle_us: self.window.cycle_us,
            stamps,
            why_not_hardware: None,
            duration_s: of.span_ns as f64 * 1e-9,
            n: figures.n,
            period_mean_us: figures.mean_us,
            period_std_us: figures.std_us,
            period_min_us: figures.min_us,
            period_max_us: figures.max_us,
            period_range_us: figures.range_us,
            period_p50_us: figures.p50_us,
            period_p99_us: figures.p99_us,
            period_p99_9_us: figures.p99_9_us,
            period_p99_99_us: figures.p99_99_us,
            deviation: of.deviations.summary(),
            breaks: Breaks {
                clock_steps: of.breaks.clock_steps + if hardware { 0 } else { self.clock_steps },
                ..of.breaks
            },
            frames: self.frames,
            frames_dropped: self.frames_dropped,
            frames_unstamped: of.unstamped,
            interval_s: of.maxima.width_s(),
            interval_maxima_us: of.maxima.values().iter().map(|ns| *ns as f64 / 1000.0).collect(),
            histogram: of.periods.buckets().collect(),
        }
    }
}

/// The periods by one clock.
struct Periods {
    window: Window,
    last_ns: Option<u64>,
    /// Time since the first SoC, without steps of the clock.
    span_ns: u64,
    periods: Jitter,
    deviations: Jitter,
    maxima: Maxima,
    breaks: Breaks,
    unstamped: u64,
}

impl Periods {
    fn new(window: Window) -> Periods {
        Periods {
            window,
            last_ns: None,
            span_ns: 0,
            periods: Jitter::new(u64::from(window.cycle_us) * 1000),
            deviations: Jitter::new(0),
            maxima: Maxima::default(),
            breaks: Breaks::default(),
            unstamped: 0,
        }
    }

    fn soc(&mut self, stamp_ns: u64) {
        if self.periods.n() >= self.window.periods_max {
            return;
        }
        let Some(last_ns) = self.last_ns.replace(stamp_ns) else {
            return;
        };
        let Some(period_ns) = stamp_ns.checked_sub(last_ns) else {
            // No frame comes before the one before it.
            self.breaks.clock_steps += 1;
            return;
        };
        self.span_ns = self.span_ns.saturating_add(period_ns);
        if period_ns > self.window.restart_ns {
            self.breaks.restarts += 1;
            self.breaks.restart_longest_us = self.breaks.restart_longest_us.max(period_ns as f64 / 1000.0);
            return;
        }
        let cycle_ns = u64::from(self.window.cycle_us) * 1000;
        self.periods.record(period_ns);
        self.deviations.record(period_ns.abs_diff(cycle_ns));
        self.maxima.add(self.span_ns, period_ns);
        // To the nearest: 1.4 cycles are a late SoC, 1.5 and more one that was left out.
        let cycles = period_ns.saturating_add(cycle_ns / 2) / cycle_ns.max(1);
        if cycles > 1 {
            self.breaks.overruns += 1;
            self.breaks.soc_missing = self.breaks.soc_missing.saturating_add(cycles - 1);
        }
    }
}
