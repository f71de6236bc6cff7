//! The report of a jitter measurement: everything that was found, in the form in which it is written as JSON.
//!
//! In:  rounds as they are measured.
//! Out: the same with ratios, medians over the rounds and distributions of all rounds together.
//!
//! Times are µs where a name does not say otherwise. A round that met a stall of the PC is marked and stays among the others.

use super::distribution::Distribution;
use super::ratios::Ratios;
use analyser::SocReport;
use host::histogram::Summary;
use host::latency::{GAP_NS, GapFigures};
use rt::cycle_stats::ThreadUsage;
use rt::phase::PhaseFigures;
use rt::timeout::Counters;
use serde::{Deserialize, Serialize};

/// A whole measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JitterReport {
    /// Version of this program.
    pub version: String,
    /// How it ended.
    pub result: Ended,
    /// What kept it from being complete, or should be known when reading it; one sentence each.
    pub notes: Vec<String>,
    pub pc: Pc,
    /// What was asked for.
    pub settings: Settings,
    /// The rounds, in order.
    pub rounds: Vec<Round>,
    /// Medians over all rounds, bad ones too.
    pub medians: Medians,
    /// Medians over the rounds that are not bad; absent where that are all or none.
    pub medians_good_rounds: Option<Medians>,
    /// All rounds together.
    pub all: Merged,
}

/// How a measurement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// All cycles were measured.
    Completed,
    /// A signal cut it; what was measured until then is here.
    Cut,
    /// The machine stopped by itself; the notes say why.
    Faulted,
}

/// The PC on which it was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pc {
    /// Release and build of the kernel, as `uname -rv` prints them.
    pub kernel: String,
    /// Whether the kernel is PREEMPT_RT.
    pub preempt_rt: bool,
    /// Whether it is a virtual machine: its lateness has no bound.
    pub virtual_machine: bool,
    /// Model of the processor.
    pub cpu_model: String,
    /// Cores that are online; 0: not known.
    pub cores: usize,
    /// The core of the real-time threads, on which the floor was measured too.
    pub core: usize,
    /// Whether that core is isolated from the scheduler.
    pub core_isolated: bool,
    /// What the PC does not give to real time.
    pub findings: Vec<String>,
}

/// What was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Name of the machine.
    pub machine: String,
    /// The program that ran.
    pub program: String,
    /// Interface of the control.
    pub interface: String,
    /// "powerlink" or "ethercat"; of EtherCAT, SoC is the first frame of a cycle.
    #[serde(default)]
    pub protocol: String,
    /// Who is at the other end of the wire, and where the SoC was stamped.
    pub far_end: String,
    /// Cycles wanted in all rounds together.
    pub cycles: u64,
    pub rounds: u32,
    pub cycle_us: u32,
    /// Period of the time-out thread.
    pub timeout_us: u32,
    /// SCHED_FIFO priority of the cycle thread.
    pub priority: u8,
    /// Offset of the cycle from whole periods.
    pub phase_us: u32,
    /// So long after the date of a cycle SYNC0 comes, where a clock of the bus leads nodes by it.
    #[serde(default)]
    pub sync0_us: Option<f64>,
    /// The cycle thread sleeps until this long before its date, then spins.
    pub spin_us: u32,
    /// What keeps the core awake.
    pub keep_awake: String,
    /// How these were found, one line each; empty if they were given.
    pub calibration: Vec<String>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// 1, 2, ...
    pub number: u32,
    /// When it began, UTC.
    pub began: String,
    /// The PC while the program ran.
    pub load_with_program: Load,
    /// The PC while the floor was measured.
    pub load_at_floor: Load,
    /// SoC period at the far end of the wire while the program ran; absent where nobody of ours was there.
    pub soc_period: Option<SocReport>,
    /// What the control measured of itself while the program ran.
    pub control: ControlFigures,
    /// What the core can do without us.
    pub floor: Floor,
    /// SoC period over `cyclictest`.
    pub over_cyclictest: Option<Ratios>,
    /// SoC period over our own wake-up probe.
    pub over_wakeup: Option<Ratios>,
    /// Why this round says more of the PC than of the control; empty: it is a good one.
    pub stalls: Vec<String>,
}

impl Round {
    /// Whether the PC stood still in this round.
    pub fn is_bad(&self) -> bool {
        !self.stalls.is_empty()
    }
}

/// What else the PC did during a part of a round.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Load {
    /// Length of the part, s.
    pub seconds: f64,
    /// Load average of the last minute at the beginning.
    pub load_average_before: f64,
    /// The same at the end.
    pub load_average_after: f64,
    /// Time that the host gave to others although the core wanted to run, ms; the kernel counts in steps of 10 ms.
    pub steal_ms: f64,
}

/// What the control measured of itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControlFigures {
    /// Cycles that ran with the program.
    pub cycles: u64,
    /// How often the program was begun.
    pub programs: u64,
    /// Cycles left out because they could not begin in time.
    pub overruns: u64,
    /// The same per 10,000 cycles.
    pub overruns_per_10000: f64,
    /// Answers of nodes that did not come in time.
    pub pres_lost: u64,
    /// Causes of stops.
    pub faults: Vec<String>,
    /// Distance from one SoC to the next one, as sent.
    pub period: Distribution,
    /// How long after its date the SoC was sent.
    pub lateness: Distribution,
    /// How long after its date the thread was awake.
    pub wake_up: Summary,
    /// From the SoC to the last answer.
    pub exchange: Summary,
    /// Computing after the exchange: drives, pins, motion, set-points.
    pub compute: Summary,
    /// From the end of computing to the next cycle's date.
    pub free: Summary,
    /// How the dates of cycles lie to the clock of the bus, where that clock leads.
    #[serde(default)]
    pub phase: Option<PhaseFigures>,
    /// Page faults and preemptions of the cycle thread.
    pub thread: ThreadUsage,
    /// What the time-out thread counted from power-on to power-off.
    pub timeout_thread: Counters,
}

/// What the core can do without us.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Floor {
    /// Lateness of a thread that only sleeps and wakes up, once a cycle.
    pub wakeup: Option<Distribution>,
    /// Dates that it had to leave out because they had passed: its overruns, to be held against those of the control.
    pub wakeup_skipped: u64,
    /// The same by `cyclictest`.
    pub cyclictest: Option<Cyclictest>,
    /// Times in which a spinning thread did not run.
    pub gaps: Option<Gaps>,
    /// What could not be measured, and why.
    pub notes: Vec<String>,
}

impl Floor {
    /// Wake-up latency by `cyclictest`.
    pub fn cyclictest_latency(&self) -> Option<&Distribution> {
        self.cyclictest.as_ref().map(|found| &found.latency)
    }

    /// Wake-up latency, and who measured it: `cyclictest`, else our own probe.
    pub fn latency(&self) -> Option<(&'static str, &Distribution)> {
        let own = || Some(("own probe", self.wakeup.as_ref()?));
        self.cyclictest_latency()
            .map(|latency| ("cyclictest", latency))
            .or_else(own)
    }
}

/// What `cyclictest` found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cyclictest {
    pub version: String,
    /// How it was called.
    pub command: String,
    /// Wake-up latency in steps of 1 µs.
    pub latency: Distribution,
    /// Values beyond its histogram, which count as its greatest.
    pub overflows: u64,
}

/// What a thread saw that reads the clock all the time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gaps {
    /// Differences of two readings from this on are gaps.
    pub threshold_us: f64,
    /// Time that was looked at, s.
    pub scanned_s: f64,
    /// Sum of all gaps.
    pub lost_us: f64,
    /// Share of the time that was lost, 0 to 1.
    pub lost_share: f64,
    /// Gaps by length.
    pub gaps: Distribution,
}

impl From<&GapFigures> for Gaps {
    fn from(figures: &GapFigures) -> Gaps {
        let summary = figures.summary();
        Gaps {
            threshold_us: GAP_NS as f64 / 1000.0,
            scanned_s: summary.scanned_s,
            lost_us: summary.lost_us,
            lost_share: summary.lost_share,
            gaps: Distribution::from(&figures.gaps),
        }
    }
}

/// Medians over rounds; of an even number the mean of the two in the middle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Medians {
    /// Number of rounds.
    pub rounds: u32,
    /// SoC period over `cyclictest`, figure by figure.
    pub over_cyclictest: Option<Ratios>,
    /// SoC period over our own wake-up probe.
    pub over_wakeup: Option<Ratios>,
    /// Cycles left out per 10,000.
    pub overruns_per_10000: f64,
}

/// All rounds together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Merged {
    /// SoC period at the far end; where nobody of ours was there, by the control's own clock.
    pub soc_period: Distribution,
    /// How late the control's cycles began.
    pub lateness: Distribution,
    /// Wake-up latency by our own probe.
    pub wakeup: Distribution,
    /// Wake-up latency by `cyclictest`.
    pub cyclictest: Distribution,
    /// Cycles left out per 10,000.
    pub overruns_per_10000: f64,
}
