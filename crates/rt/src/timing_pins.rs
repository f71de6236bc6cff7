//! Pins that show how the cycle keeps its time.
//!
//! In:  times of the last cycle and of the last second. Out: pins. RT: nothing allocates but [`TimingPins::new`].

use super::recent::Second;
use crate::cycle_stats::Timing;
use hal_pins::{Hal, HalError, Output};

/// All of them.
pub(super) struct TimingPins {
    lateness_ns: Output<i64>,
    late_max_ns: Output<i64>,
    exchange_ns: Output<i64>,
    compute_ns: Output<i64>,
    free_ns: Output<i64>,
    cycles: Output<u64>,
    skipped: Output<u64>,
    pres_lost: Output<u64>,
    /// The last second: period, lateness, exchange, computing, free time.
    seconds: [SecondPins; 5],
}

/// One quantity over the last second.
struct SecondPins {
    mean_ns: Output<f64>,
    std_ns: Output<f64>,
    min_ns: Output<i64>,
    p99_ns: Output<i64>,
    max_ns: Output<i64>,
}

impl SecondPins {
    fn new(hal: &mut Hal, quantity: &str) -> Result<SecondPins, HalError> {
        let name = |figure: &str| format!("rt.{quantity}-{figure}-ns");
        Ok(SecondPins {
            mean_ns: hal.output(&name("mean"))?,
            std_ns: hal.output(&name("std"))?,
            min_ns: hal.output(&name("min"))?,
            p99_ns: hal.output(&name("p99"))?,
            max_ns: hal.output(&name("max"))?,
        })
    }

    /// RT.
    fn show(&mut self, second: &Second) {
        self.mean_ns.set(second.mean_ns);
        self.std_ns.set(second.std_ns);
        self.min_ns.set(second.min_ns as i64);
        self.p99_ns.set(second.p99_ns as i64);
        self.max_ns.set(second.max_ns as i64);
    }
}

impl TimingPins {
    pub(super) fn new(hal: &mut Hal) -> Result<TimingPins, HalError> {
        Ok(TimingPins {
            lateness_ns: hal.output("rt.servo-jitter-ns")?,
            late_max_ns: hal.output("rt.servo-late-max-ns")?,
            exchange_ns: hal.output("rt.exchange-ns")?,
            compute_ns: hal.output("rt.compute-ns")?,
            free_ns: hal.output("rt.free-ns")?,
            cycles: hal.output("rt.cycles")?,
            skipped: hal.output("rt.cycles-skipped")?,
            pres_lost: hal.output("rt.pres-lost")?,
            seconds: [
                SecondPins::new(hal, "period")?,
                SecondPins::new(hal, "servo-jitter")?,
                SecondPins::new(hal, "exchange")?,
                SecondPins::new(hal, "compute")?,
                SecondPins::new(hal, "free")?,
            ],
        })
    }

    /// RT.
    pub(super) fn show(&mut self, timing: &Timing) {
        self.lateness_ns.set(timing.lateness_ns as i64);
        self.late_max_ns.set(timing.late_max_ns as i64);
        self.exchange_ns.set(timing.exchange_ns as i64);
        self.compute_ns.set(timing.compute_ns as i64);
        self.free_ns.set(timing.free_ns as i64);
        self.cycles.set(timing.cycles);
        self.skipped.set(timing.skipped);
        self.pres_lost.set(timing.pres_lost);
        let second = &timing.second;
        let seconds = [
            &second.period,
            &second.lateness,
            &second.exchange,
            &second.compute,
            &second.free,
        ];
        for (pins, second) in self.seconds.iter_mut().zip(seconds) {
            pins.show(second);
        }
    }
}
