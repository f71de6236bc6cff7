//! What the longest scan of a program takes on this PC.
//!
//! In:  a compiled program. Out: time, and whether its period bears it.

use config::{self, Config, ConfigErrors};
use logic::{Logic, Runtime};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a program is run to see what its steps take on this PC.
const LOOK: Duration = Duration::from_millis(20);
/// Steps between two looks at the clock: a scan may have so many that it would not end for minutes.
const SLICE: u64 = 10_000;
/// A step takes so long at least on any PC, ns: what is too long by that is not run at all.
const STEP_NS_MIN: f64 = 0.1;

/// The longest scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    pub steps: u64,
    pub scan_us: f64,
    /// Of the period.
    pub share: f64,
}

/// Runs the program for a moment to see what the longest scan takes.
pub fn measure(logic: &Arc<Logic>, period_ns: u64) -> Budget {
    let mut runtime = Runtime::new(Arc::clone(logic));
    let (begin, mut steps, mut now_ns) = (Instant::now(), 0_u64, 0_i64);
    while begin.elapsed() < LOOK {
        steps += runtime.scan_within(now_ns, SLICE);
        now_ns = now_ns.saturating_add(period_ns as i64);
    }
    let step_ns = begin.elapsed().as_nanos() as f64 / steps.max(1) as f64;
    Budget::new(logic, period_ns, step_ns)
}

impl Budget {
    /// `step_ns`: what a step takes.
    fn new(logic: &Logic, period_ns: u64, step_ns: f64) -> Budget {
        let scan_us = logic.steps_max() as f64 * step_ns / 1000.0;
        Budget {
            steps: logic.steps_max(),
            scan_us,
            share: scan_us * 1000.0 / period_ns as f64,
        }
    }
}

/// The longest scan takes too much of the period.
#[derive(Debug)]
pub struct TooLong {
    /// Line and column of each loop without a bound; none: the program as a whole is too long.
    pub loops: Vec<(u32, u32)>,
    pub rule: String,
}

impl TooLong {
    /// In one line, at the first of the places.
    pub fn at(&self, file: &str) -> String {
        let TooLong { loops, rule } = self;
        let Some(((line, column), others)) = loops.split_first() else {
            return format!("{file}: {rule}");
        };
        let others: Vec<String> = others.iter().map(|(line, _)| line.to_string()).collect();
        match others.is_empty() {
            true => format!("{file}:{line}:{column}: {rule}"),
            false => format!(
                "{file}:{line}:{column}: {rule}; so do those of the lines {}",
                others.join(", ")
            ),
        }
    }
}

/// The same, where the period bears it.
///
/// # Errors
/// It takes more than this share of the period.
pub fn check(logic: &Arc<Logic>, period_ns: u64, share_max: f64) -> Result<Budget, TooLong> {
    let at_least = Budget::new(logic, period_ns, STEP_NS_MIN);
    let (about, budget) = match at_least.share <= share_max {
        true => ("about", measure(logic, period_ns)),
        false => ("at least", at_least),
    };
    if budget.share <= share_max {
        return Ok(budget);
    }
    let takes = format!(
        "the longest scan has {} steps, which take {about} {:.0} us on this PC: more than {:.0} % of a period of {} ms",
        budget.steps,
        budget.scan_us,
        share_max * 100.0,
        logic::duration::milliseconds(period_ns as i64)
    );
    let loops: Vec<(u32, u32)> = logic.unbound().iter().map(|found| (found.line, found.column)).collect();
    let rule = match loops.is_empty() {
        true => format!("{takes}; fewer iterations of its loops shorten it"),
        false => format!(
            "the loop names no bound and counts with {} iterations: write {{max_iterations := n}} before it; {takes}",
            logic::ITERATIONS_MAX
        ),
    };
    Err(TooLong { loops, rule })
}

/// The same of all programs of a machine.
///
/// # Errors
/// The first one whose period does not bear it, at its place in the machine file.
pub fn of_machine(config: &Config) -> Result<Vec<Budget>, ConfigErrors> {
    let budgets = config.logics.iter().enumerate().map(|(number, task)| {
        let period_ns = task.every * u64::from(config.cycle_us) * 1000;
        check(&task.logic, period_ns, task.share_max).map_err(|too_long| {
            let told = too_long.at(&task.file.display().to_string());
            config::logic_error(config, number, &format!("{told} (or raise budget_percent)"))
        })
    });
    budgets.collect()
}
