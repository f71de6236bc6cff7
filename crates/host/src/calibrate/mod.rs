//! What the machine file leaves open of the timing is chosen at the start, by less than half a second of measuring: how the
//! core is kept awake, where in the millisecond the cycle begins, how long the cycle thread spins before it.
//!
//! In:  `[rt]` of the machine file; a prepared process, whose rights allow a real-time thread.
//! Out: [`Calibration`]: each value, who chose it and what was measured; it is printed and stands in the report.
//!
//! A real-time thread wakes up at several phases of each cycle, in short rounds that take turns between the ways to keep the
//! core awake. `decide` then compares medians of rounds, so that a burst of other work in one of them changes nothing, and
//! stays with the defaults unless something else is clearly better. The spin is the longest that any wake-up wanted, and is made
//! longer while the control runs where that is not enough: [`Calibration::spin`]. Ticks of the time-out thread are no candidate: what they
//! take from the core shows in everything but a wake-up.

mod decide;
#[cfg(test)]
mod tests;

use super::setup::{Item, Process, usual_keep_awake};
use super::spin::Spin;
use super::wait::Grid;
use crate::latency::{Clock, System, on_a_thread};
use config::{Config, KeepAwake, Rt};
use decide::decide;
use serde::{Deserialize, Serialize};

/// Rounds of each way to keep the core awake; an odd number has a middle.
const ROUNDS: usize = 5;
/// Length of a round, µs, if a cycle is no longer than half of it.
const ROUND_US: u32 = 20_000;
/// Phases at which a cycle is probed, at most.
const PHASES: u32 = 5;
/// Least distance of two of them, µs.
const PHASE_STEP_US: u32 = 100;
/// Between a change of the way to keep awake and the first wake-up of a round, ns.
const SETTLE_NS: u64 = 1_000_000;

/// Who chose a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// It stands in the machine file.
    File,
    /// It was the best of what was measured.
    Measured,
    /// Nothing was measured.
    Default,
}

/// A value and who chose it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Chosen<T> {
    pub value: T,
    /// Who chose it.
    pub source: Source,
}

/// The timing of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// How the core is kept awake.
    pub keep_awake: Chosen<KeepAwake>,
    /// Cycles start at `k * cycle_us + phase_us` of CLOCK_MONOTONIC.
    pub phase_us: Chosen<u32>,
    /// The cycle thread sleeps until this long before a cycle and then spins, µs.
    pub spin_us: Chosen<u32>,
    /// To how much the spin was raised while the control ran, µs; `None`: it was not.
    pub spin_raised_us: Option<u32>,
    /// What was measured; `None`: nothing.
    pub measured: Option<Measured>,
    /// Why nothing was measured.
    pub unmeasured: Option<String>,
}

/// What the choice rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Wake-ups with the chosen way to keep the core awake.
    pub wake_ups: usize,
    /// How late half of them were at most, µs.
    pub p50_us: f64,
    /// The same of 99 %.
    pub p99_us: f64,
    /// The same of 99.9 %.
    pub p99_9_us: f64,
    /// How late 90 % of the wake-ups of a typical round were at most, for each way to keep the core awake.
    pub keep_awake: Vec<Compared<KeepAwake>>,
    /// The same for each phase, µs, with the chosen way.
    pub phase_us: Vec<Compared<u32>>,
}

/// One of several that were compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compared<T> {
    pub value: T,
    /// How late 90 % of the wake-ups of a typical round were at most.
    pub late_us: f64,
}

/// Latenesses of one round, ns, by phase.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Round {
    keep_awake: KeepAwake,
    late_ns: Vec<Vec<u64>>,
}

/// What is probed.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Plan {
    cycle_us: u32,
    /// In the order of preference.
    keep_awake: Vec<KeepAwake>,
    /// From the earliest to the latest.
    phases_us: Vec<u32>,
    cycles: usize,
    spin_max_us: u32,
}

impl Plan {
    /// `usual`: the default of this PC for keeping awake. `busy_us`: what the exchange of a cycle can take at worst.
    fn new(rt: &Rt, cycle_us: u32, usual: KeepAwake, busy_us: u32) -> Plan {
        let mut keep_awake = vec![rt.keep_awake.unwrap_or(usual)];
        if rt.keep_awake.is_none() {
            let others = [KeepAwake::DmaLatency, KeepAwake::IdleThread, KeepAwake::None];
            keep_awake.extend(others.into_iter().filter(|way| *way != usual));
        }
        // Whole ticks of the time-out thread from the default, which lies in the middle between two of them.
        let least_us = (cycle_us / PHASES).max(PHASE_STEP_US);
        let step_us = if cycle_us.is_multiple_of(rt.timeout_us) {
            least_us.next_multiple_of(rt.timeout_us)
        } else {
            least_us
        };
        let count = (cycle_us / step_us).clamp(1, PHASES);
        let mut phases_us: Vec<u32> = (0..count)
            .map(|step| (rt.phase_us(cycle_us) + step * step_us) % cycle_us)
            .collect();
        phases_us.sort_unstable();
        Plan {
            cycle_us,
            keep_awake,
            phases_us,
            cycles: (ROUND_US / cycle_us).max(2) as usize,
            spin_max_us: spin_max_us(cycle_us, busy_us),
        }
    }
}

/// The longest spin that is chosen, µs: a fifth of the cycle, and no more than the exchange leaves.
fn spin_max_us(cycle_us: u32, busy_us: u32) -> u32 {
    (cycle_us / 5)
        .min(cycle_us.saturating_sub(busy_us))
        .max(Rt::SPIN_DEFAULT_US)
}

impl Calibration {
    /// The defaults, where the machine file gives nothing.
    pub fn unmeasured(rt: &Rt, cycle_us: u32, keep_awake: KeepAwake, reason: &str) -> Calibration {
        Calibration {
            keep_awake: Chosen::default_or_given(rt.keep_awake, keep_awake),
            phase_us: Chosen::default_or_given(rt.phase_us, rt.phase_us(cycle_us)),
            spin_us: Chosen::default_or_given(rt.spin_us, rt.spin_us()),
            spin_raised_us: None,
            measured: None,
            unmeasured: Some(reason.into()),
        }
    }

    /// The settings of a machine file with what was chosen in place of what was left out.
    pub fn applied(&self, rt: &Rt) -> Rt {
        Rt {
            keep_awake: Some(self.keep_awake.value),
            phase_us: Some(self.phase_us.value),
            spin_us: Some(self.spin_raised_us.unwrap_or(self.spin_us.value)),
            ..rt.clone()
        }
    }

    /// The spin to begin with; it may be raised while the control runs unless the machine file gives it or wants no calibration.
    pub fn spin(&self, config: &Config) -> Spin {
        let spin_us = self.spin_us.value;
        let most_us = if self.spin_us.source == Source::File || !config.rt.calibrate {
            spin_us
        } else {
            spin_max_us(config.cycle_us, busy_us(config))
        };
        Spin::new(spin_us, most_us)
    }

    /// The phase, ns.
    pub fn phase_ns(&self) -> u64 {
        u64::from(self.phase_us.value) * 1000
    }
}

impl<T> Chosen<T> {
    /// `otherwise`: the default, or what is in force.
    fn default_or_given(given: Option<T>, otherwise: T) -> Chosen<T> {
        let source = if given.is_some() { Source::File } else { Source::Default };
        Chosen {
            value: otherwise,
            source,
        }
    }

    fn measured_or_given(given: Option<T>, measured: T) -> Chosen<T> {
        match given {
            Some(value) => Chosen {
                value,
                source: Source::File,
            },
            None => Chosen {
                value: measured,
                source: Source::Measured,
            },
        }
    }
}

/// Chooses what the machine file leaves open and has the process keep its core awake accordingly. Takes less than half a
/// second if it measures, which it does not without need or right to.
pub fn calibrate(config: &Config, process: &mut Process) -> Calibration {
    let rt = &config.rt;
    let refused = |item| process.findings.iter().any(|finding| finding.item == item);
    let unmeasured = if rt.keep_awake.is_some() && rt.phase_us.is_some() && rt.spin_us.is_some() {
        Some("the machine file gives all")
    } else if !rt.calibrate {
        Some("rt.calibrate = false")
    } else if refused(Item::Priority) || refused(Item::Core) {
        Some("it takes SCHED_FIFO on a core")
    } else {
        None
    };
    if let Some(reason) = unmeasured {
        return Calibration::unmeasured(rt, config.cycle_us, process.kept_awake(), reason);
    }
    let mut plan = Plan::new(rt, config.cycle_us, usual_keep_awake(), busy_us(config));
    let rounds = measure(&mut plan, process);
    let calibration = decide(rt, &plan, &rounds);
    if process.kept_awake() != calibration.keep_awake.value {
        // It could be had a moment ago.
        let missing = process.keep_awake(calibration.keep_awake.value).err();
        process.findings.extend(missing);
    }
    calibration
}

/// The longest that the exchange of a cycle can take, µs: a spin must not begin before it is over.
fn busy_us(config: &Config) -> u32 {
    let worst_ns = bus::worst_exchange_ns(config);
    u32::try_from(worst_ns.div_ceil(1000)).unwrap_or(u32::MAX)
}

/// All rounds. Ways to keep awake that cannot be had are taken out of the plan.
fn measure(plan: &mut Plan, process: &mut Process) -> Vec<Round> {
    let mut rounds = Vec::new();
    for round in 0..ROUNDS {
        let ways = plan.keep_awake.clone();
        for way in ways {
            // Changing to what holds already would change it all the same: a thread would be restarted.
            let changed = process.kept_awake() != way;
            if changed && process.keep_awake(way).is_err() && round == 0 && plan.keep_awake.len() > 1 {
                plan.keep_awake.retain(|other| *other != way);
                continue;
            }
            let mut late_ns = vec![Vec::with_capacity(plan.cycles); plan.phases_us.len()];
            on_a_thread(process.cpu, process.priority, |_| {
                probe(&mut System, plan, &mut late_ns)
            });
            rounds.push(Round {
                keep_awake: way,
                late_ns,
            });
        }
    }
    rounds
}

/// RT: wakes up at each phase of each cycle of a round; a date that has passed is left out. The vectors have room.
fn probe(clock: &mut impl Clock, plan: &Plan, late_ns: &mut [Vec<u64>]) {
    let phase_ns = |phase: usize| u64::from(plan.phases_us[phase]) * 1000;
    let grid = Grid {
        period_ns: u64::from(plan.cycle_us) * 1000,
        phase_ns: phase_ns(0),
        late_max_ns: 0,
    };
    let first_ns = grid.first_after(clock.now_ns() + SETTLE_NS);
    for cycle in 0..plan.cycles as u64 {
        for (phase, late_ns) in late_ns.iter_mut().enumerate() {
            let deadline_ns = first_ns + cycle * grid.period_ns + phase_ns(phase) - phase_ns(0);
            if clock.now_ns() < deadline_ns {
                late_ns.push(clock.wait_until(deadline_ns, 0) - deadline_ns);
            }
        }
    }
}
