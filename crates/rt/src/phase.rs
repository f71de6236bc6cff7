//! How the dates of cycles lie to those of the clock of the bus, where that clock leads, in constant memory.
//!
//! In:  by how much each cycle began behind its date there. Out: [`PhaseFigures`], which reports hold against SYNC0.

use config::Config;
use serde::{Deserialize, Serialize};

/// Count, mean, spread and extremes of what was recorded (Welford).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Phase {
    n: u64,
    mean_ns: f64,
    m2_ns2: f64,
    min_ns: i64,
    max_ns: i64,
}

/// How dates lie to the clock of the bus; times in µs, all zero if there were none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhaseFigures {
    /// Cycles whose time by the clock of the bus is known.
    pub n: u64,
    /// By how much a cycle began behind its date there; below 0: before it.
    pub mean_us: f64,
    /// Standard deviation (of the population).
    pub std_us: f64,
    pub min_us: f64,
    pub max_us: f64,
    /// Greatest minus least.
    pub range_us: f64,
}

impl Phase {
    /// RT: takes a cycle in.
    pub fn record(&mut self, late_ns: i64) {
        if self.n == 0 {
            (self.min_ns, self.max_ns) = (late_ns, late_ns);
        }
        self.n += 1;
        let from_mean = late_ns as f64 - self.mean_ns;
        self.mean_ns += from_mean / self.n as f64;
        self.m2_ns2 += from_mean * (late_ns as f64 - self.mean_ns);
        self.min_ns = self.min_ns.min(late_ns);
        self.max_ns = self.max_ns.max(late_ns);
    }

    /// `None`: no clock of the bus has led.
    pub fn figures(&self) -> Option<PhaseFigures> {
        let us = |ns: f64| ns / 1000.0;
        (self.n > 0).then(|| PhaseFigures {
            n: self.n,
            mean_us: us(self.mean_ns),
            std_us: us((self.m2_ns2 / self.n as f64).max(0.0).sqrt()),
            min_us: us(self.min_ns as f64),
            max_us: us(self.max_ns as f64),
            range_us: us((self.max_ns - self.min_ns) as f64),
        })
    }
}

/// So long after the date of a cycle SYNC0 of the first node that follows it comes, µs; `None`: no node follows one.
pub fn sync0_us(config: &Config) -> Option<f64> {
    let mut nodes = config.bus.nodes.iter();
    let clock = nodes.find_map(|node| node.ethercat.as_ref()?.clock)?;
    Some(f64::from(clock.shift_ns) / 1000.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_by_hand() {
        let mut phase = Phase::default();
        assert_eq!(phase.figures(), None);
        // -3, -1, 1, 3 us and 1 us more: variance (9 + 1 + 1 + 9) / 4 = 5.
        for late_ns in [-2_000, 0, 2_000, 4_000] {
            phase.record(late_ns);
        }
        let figures = phase.figures().expect("some");
        assert_eq!((figures.n, figures.mean_us, figures.range_us), (4, 1.0, 6.0));
        assert_eq!((figures.min_us, figures.max_us), (-2.0, 4.0));
        assert!((figures.std_us - 5f64.sqrt()).abs() < 1e-12, "{figures:?}");
    }
}
