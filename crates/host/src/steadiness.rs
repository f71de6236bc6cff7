//! Whether this PC keeps the cycle of a machine file, by less than half a second of waking up as the cycle thread would.
//!
//! In:  the core and the priority of the cycle thread; a machine file.
//! Out: [`Steadiness`]: the shortest cycle that is kept, and which keys of the file bear too little for this PC.

use super::setup::{Item, usual_core};
use crate::histogram::Summary;
use crate::latency::{WakeUp, WakeUpFigures};
use config::{Config, Rt};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Length of the measurement.
const LENGTH: Duration = Duration::from_millis(400);
/// Distance of two wake-ups, ns.
const PERIOD_NS: u64 = 1_000_000;
/// Longest cycle of a machine file, µs.
const CYCLE_MAX_US: u32 = 10_000;
/// What a shared PC without real time needs to get through a second: the demo machine has it.
const LATE_SHARE: u32 = 2;
const PRES_LOST: u32 = 20;
const SOC_LOST: u32 = 100;

/// How a PC wakes a thread up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steadiness {
    pub late: Summary,
    /// The thread had a core and SCHED_FIFO.
    pub real_time: bool,
}

impl Steadiness {
    /// Measures on the core of the real-time threads.
    pub fn measure(rt: &Rt) -> Steadiness {
        let probe = WakeUp {
            cpu: rt.cpu.unwrap_or_else(usual_core),
            priority: rt.priority,
            period_ns: PERIOD_NS,
            phase_ns: 0,
            spin_ns: 0,
            cycles: 0,
        };
        Steadiness::from_figures(&probe.lasting(LENGTH).run(&AtomicBool::new(false)))
    }

    fn from_figures(figures: &WakeUpFigures) -> Steadiness {
        let lacks = |item| figures.findings.iter().any(|finding| finding.item == item);
        Steadiness {
            late: figures.lateness.summary(),
            real_time: !lacks(Item::Priority) && !lacks(Item::Core),
        }
    }

    /// The shortest of this cycle and its double, fourfold and so on that a thread keeps: 99 of 100 wake-ups are late by a
    /// quarter of it at most. `None`: a cycle of 10 ms is not kept either.
    pub fn kept_cycle_us(&self, cycle_us: u32) -> Option<u32> {
        let cycles = std::iter::successors(Some(cycle_us), |cycle_us| cycle_us.checked_mul(2));
        cycles
            .take_while(|cycle_us| *cycle_us <= CYCLE_MAX_US)
            .find(|cycle_us| self.late.p99_us <= f64::from(*cycle_us) / 4.0)
    }

    /// The keys of a machine file that bear too little for this PC, with what a shared PC needs, and why.
    pub fn advice(&self, config: &Config) -> Option<String> {
        let late_max_us = config.rt.late_max_us(config.cycle_us);
        let wanted_us = config.cycle_us / LATE_SHARE;
        let rarely = !self.real_time;
        let is_late = rarely || self.late.p99_9_us > f64::from(late_max_us);
        let stalls_us = f64::from(config.bus.pres_lost_max) * f64::from(config.cycle_us);
        let stalls = rarely || self.late.max_us > stalls_us;
        let mut keys = Vec::new();
        if is_late && late_max_us < wanted_us {
            keys.push(format!("rt.late_us_max = {wanted_us} (is {late_max_us})"));
        }
        if stalls && config.bus.pres_lost_max < PRES_LOST {
            keys.push(format!(
                "bus.pres_lost_max = {PRES_LOST} (is {})",
                config.bus.pres_lost_max
            ));
        }
        if let Some(lost_max) = config.bus.soc_lost_max.filter(|lost_max| *lost_max < SOC_LOST)
            && stalls
        {
            keys.push(format!("bus.soc_lost_max = {SOC_LOST} (is {lost_max})"));
        }
        if let Some(cycle_us) = self.kept_cycle_us(config.cycle_us)
            && cycle_us > config.cycle_us
        {
            keys.push(format!("machine.cycle_us = {cycle_us} (is {})", config.cycle_us));
        }
        if keys.is_empty() {
            return None;
        }
        let why = match self.real_time {
            true => "",
            false => ", without SCHED_FIFO on a core of its own",
        };
        Some(format!(
            "a thread wakes up {:.0} us late on this PC (99.9 %, longest {:.0} us{why}): the machine may stop with an alarm \
             within seconds. To try things here: {}. For a machine: isocnc doctor",
            self.late.p99_9_us,
            self.late.max_us,
            keys.join(", ")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn late(p99_us: f64, p99_9_us: f64, max_us: f64) -> Steadiness {
        let late = Summary {
            n: 400,
            p99_us,
            p99_9_us,
            max_us,
            ..Summary::default()
        };
        Steadiness { late, real_time: true }
    }

    fn machine(late_us_max: &str, pres_lost_max: u32) -> Config {
        let text = include_str!("../../../configs/mill3-demo.toml")
            .replace("late_us_max = 500 ", late_us_max)
            .replace("pres_lost_max = 20", &format!("pres_lost_max = {pres_lost_max}"));
        config::parse(&text, Path::new("m.toml")).unwrap()
    }

    #[test]
    fn a_cycle_is_kept_that_is_four_times_as_long_as_wake_ups_are_late() {
        assert_eq!(late(250.0, 300.0, 9e3).kept_cycle_us(1000), Some(1000));
        assert_eq!(late(251.0, 300.0, 9e3).kept_cycle_us(1000), Some(2000));
        assert_eq!(late(1900.0, 2e3, 9e3).kept_cycle_us(1000), Some(8000));
        assert_eq!(late(2100.0, 2200.0, 9e3).kept_cycle_us(1000), None);
        assert_eq!(late(2100.0, 2200.0, 9e3).kept_cycle_us(10_000), Some(10_000));
    }

    #[test]
    fn keys_that_bear_too_little_are_named() {
        let usual = machine("", 3);
        assert_eq!(late(10.0, 40.0, 90.0).advice(&usual), None);
        let advice = late(10.0, 260.0, 300.0).advice(&usual).unwrap();
        assert!(
            advice.contains(": rt.late_us_max = 500 (is 250). For a machine"),
            "{advice}"
        );
        let advice = late(10.0, 40.0, 3100.0).advice(&usual).unwrap();
        assert!(advice.contains(": bus.pres_lost_max = 20 (is 3). For"), "{advice}");
        let shared = Steadiness {
            real_time: false,
            ..late(10.0, 40.0, 90.0)
        };
        let advice = shared.advice(&usual).unwrap();
        assert!(
            advice.contains("rt.late_us_max = 500 (is 250), bus.pres_lost_max = 20 (is 3)"),
            "{advice}"
        );
        // The machine of the demo bears it.
        assert_eq!(shared.advice(&machine("late_us_max = 500 ", 20)), None);
        let advice = late(600.0, 700.0, 800.0)
            .advice(&machine("late_us_max = 500 ", 20))
            .unwrap();
        assert!(advice.contains(": machine.cycle_us = 4000 (is 1000). For"), "{advice}");
    }
}
