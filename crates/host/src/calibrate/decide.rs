//! The choice, from numbers that somebody has measured or made up; and how it is told.

use super::{Calibration, Chosen, Compared, Measured, Plan, Round, Source};
use crate::spin::covering_ns;
use config::{KeepAwake, Rt};
use std::fmt;

/// What takes the place of a default is earlier by this share of its lateness, and by this many ns: less is chance.
const CLEARLY_SHARE: f64 = 0.2;
const CLEARLY_NS: u64 = 1_000;
/// Rounds are compared by this quantile of their latenesses.
const COMPARED: f64 = 0.9;

/// The timing for a plan and the rounds that it has led to.
pub(super) fn decide(rt: &Rt, plan: &Plan, rounds: &[Round]) -> Calibration {
    let ways: Vec<(KeepAwake, u64)> = plan
        .keep_awake
        .iter()
        .filter_map(|way| Some((*way, typical(rounds, *way, None)?)))
        .collect();
    // The usual way stands first.
    let Some(best_way) = clearly_best(&ways, plan.keep_awake.first().copied()) else {
        return Calibration::unmeasured(rt, plan.cycle_us, KeepAwake::None, "no thread could be had");
    };
    let way = Chosen::measured_or_given(rt.keep_awake, best_way);
    let phases: Vec<(u32, u64)> = plan
        .phases_us
        .iter()
        .enumerate()
        .filter_map(|(index, phase_us)| Some((*phase_us, typical(rounds, way.value, Some(index))?)))
        .collect();
    let default_us = rt.phase_us(plan.cycle_us);
    let best_phase_us = clearly_best(&phases, Some(default_us)).unwrap_or(default_us);
    let all_ns = sorted(of_way(rounds, way.value).flat_map(|round| round.late_ns.iter().flatten()));
    Calibration {
        keep_awake: way,
        phase_us: Chosen::measured_or_given(rt.phase_us, best_phase_us),
        spin_us: Chosen::measured_or_given(rt.spin_us, spin_us(&all_ns, plan.spin_max_us)),
        measured: Some(Measured {
            wake_ups: all_ns.len(),
            p50_us: us(quantile(&all_ns, 0.5).unwrap_or(0)),
            p99_us: us(quantile(&all_ns, 0.99).unwrap_or(0)),
            p99_9_us: us(quantile(&all_ns, 0.999).unwrap_or(0)),
            keep_awake: compared(&ways),
            phase_us: compared(&phases),
        }),
        unmeasured: None,
        spin_raised_us: None,
    }
}

/// How long to spin so that every wake-up of these latenesses is in time that a spin can have in time, µs. Less than the default
/// is never chosen: half a second does not show the rare late ones. What no spin could cover (a machine that stood still) is not
/// covered.
fn spin_us(sorted_ns: &[u64], most_us: u32) -> u32 {
    let mut wanted_us = sorted_ns.iter().rev().map(|late_ns| covering_ns(*late_ns) / 1000);
    let covered_us = wanted_us.find(|wanted_us| *wanted_us <= u64::from(most_us));
    covered_us
        .map_or(0, |covered_us| covered_us as u32)
        .max(Rt::SPIN_DEFAULT_US)
}

/// The default, unless another one is clearly earlier; without the default, the earliest.
fn clearly_best<T: Copy + PartialEq>(late_ns: &[(T, u64)], default: Option<T>) -> Option<T> {
    let (best, best_ns) = late_ns.iter().copied().min_by_key(|(_, late_ns)| *late_ns)?;
    let usual = late_ns.iter().copied().find(|(value, _)| Some(*value) == default);
    match usual {
        Some((usual, usual_ns)) => {
            let gain_ns = usual_ns - best_ns;
            let clear = gain_ns > CLEARLY_NS && gain_ns as f64 > CLEARLY_SHARE * usual_ns as f64;
            Some(if clear { best } else { usual })
        }
        None => Some(best),
    }
}

/// The middle of the rounds of one way, by the compared quantile of each; of one phase or of all.
fn typical(rounds: &[Round], way: KeepAwake, phase: Option<usize>) -> Option<u64> {
    let of_round = |round: &Round| {
        let phases = round.late_ns.iter().enumerate();
        let wanted = phases.filter(|(index, _)| phase.is_none_or(|phase| phase == *index));
        quantile(&sorted(wanted.flat_map(|(_, late_ns)| late_ns)), COMPARED)
    };
    let of_rounds: Vec<u64> = of_way(rounds, way).filter_map(of_round).collect();
    quantile(&sorted(&of_rounds), 0.5)
}

fn of_way(rounds: &[Round], way: KeepAwake) -> impl Iterator<Item = &Round> {
    rounds.iter().filter(move |round| round.keep_awake == way)
}

fn sorted<'a>(values: impl IntoIterator<Item = &'a u64>) -> Vec<u64> {
    let mut sorted: Vec<u64> = values.into_iter().copied().collect();
    sorted.sort_unstable();
    sorted
}

/// Least value that this share of all is not above.
fn quantile(sorted: &[u64], share: f64) -> Option<u64> {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1000.0
}

fn compared<T: Copy>(late_ns: &[(T, u64)]) -> Vec<Compared<T>> {
    late_ns
        .iter()
        .map(|(value, late_ns)| Compared {
            value: *value,
            late_us: us(*late_ns),
        })
        .collect()
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Source::File => "from the machine file",
            Source::Measured => "measured",
            Source::Default => "default",
        })
    }
}

/// One line, and a second one with what it rests on.
impl fmt::Display for Calibration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (way, phase, spin) = (self.keep_awake, self.phase_us, self.spin_us);
        write!(
            f,
            "calibration: spin {} µs ({}), phase {} µs ({}), core kept awake by {} ({})",
            spin.value,
            spin.source,
            phase.value,
            phase.source,
            way.value.name(),
            way.source,
        )?;
        if let Some(raised_us) = self.spin_raised_us {
            write!(
                f,
                "\n  spin raised to {raised_us} µs while it ran: wake-ups came later than at the start"
            )?;
        }
        if let Some(reason) = &self.unmeasured {
            write!(f, "\n  not measured: {reason}")?;
        }
        let Some(measured) = &self.measured else {
            return Ok(());
        };
        let ways = measured.keep_awake.iter();
        let ways: Vec<String> = ways
            .map(|way| format!("{} {:.1}", way.value.name(), way.late_us))
            .collect();
        let phases = measured.phase_us.iter();
        let phases: Vec<String> = phases
            .map(|phase| format!("{}: {:.1}", phase.value, phase.late_us))
            .collect();
        write!(
            f,
            "\n  {} wake-ups late by p50 {:.1}, p99 {:.1}, p99.9 {:.1} µs; p90 with {}; p90 at phase {} µs",
            measured.wake_ups,
            measured.p50_us,
            measured.p99_us,
            measured.p99_9_us,
            ways.join(", "),
            phases.join(", "),
        )
    }
}
