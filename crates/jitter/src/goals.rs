//! What the cycle is to keep: as ratios over the wake-up latency of the same PC, and as figures on a tuned one.
//!
//! Constants only, for the table, the picture and whoever else judges a report.

use super::ratios::Ratios;

/// Ratios of the SoC period over `cyclictest` that a control should not be above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// For which PC.
    pub name: &'static str,
    pub ratios: Ratios,
    /// Cycles left out per 10,000.
    pub overruns_per_10000: f64,
    /// Standard deviation of the period, µs; none where the neighbours decide on it.
    pub std_us: Option<f64>,
}

/// A PC, or a virtual machine, whose neighbours leave it alone.
pub const QUIET: Goal = Goal {
    name: "quiet PC",
    ratios: Ratios {
        p50: 0.05,
        p99: 0.2,
        p99_9: 0.15,
        std: 0.1,
    },
    overruns_per_10000: 0.0,
    std_us: Some(2.0),
};

/// A virtual machine whose neighbours are busy.
pub const BUSY: Goal = Goal {
    name: "busy PC",
    ratios: Ratios {
        p50: 0.15,
        p99: 0.8,
        p99_9: 1.5,
        std: 1.0,
    },
    overruns_per_10000: 5.0,
    std_us: None,
};

/// Both, the harder first.
pub const GOALS: [Goal; 2] = [QUIET, BUSY];

/// The class of a tuned PC with PREEMPT_RT and a network card of its own: range of the period, µs.
pub const TUNED_RANGE_US: f64 = 12.0;
/// The same: standard deviation, µs.
pub const TUNED_STD_US: f64 = 1.0;
/// The same: number of cycles.
pub const TUNED_CYCLES: u64 = 20_000_000;
