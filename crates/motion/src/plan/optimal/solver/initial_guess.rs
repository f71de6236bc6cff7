//! Profiles to start from: slow ones that keep all limits with room to spare.
//!
//! In:  a grid with knots about evenly in time; states at both ends.
//! Out: the feasible profile, a part of the speed for which the knots were placed; and ways from a state to the feasible profile and back.
//!
//! The feasible profile is a local function of the path: its value at a span depends on [`Knotting::reach`] spans on each side and on
//! nothing else, because over so many it grows from next to nothing to all that it can be. So windows that are cut from the
//! same path agree in it.

use std::ops::Range;

use super::grid::{Grid, JointLimits};
use super::interior::Infeasible;
use super::profile::{State, coefficient, worst};
use crate::plan::roots::cube_root;

/// How knots were placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knotting {
    /// Estimated time between knots, s.
    pub step_s: f64,
    /// Spans on each side on which the feasible profile depends.
    pub reach: usize,
    /// Spans on each side over which it is made even: more where jerk takes many of them to build up acceleration.
    pub even: usize,
}

impl Knotting {
    /// Knots `step_s` apart for joints with these limits.
    pub fn new(limits: &[JointLimits], step_s: f64) -> Knotting {
        /// Spans over which the feasible profile grows from next to nothing to where it grows evenly.
        const GROWING: f64 = 32.0;
        /// Spans over which it is made even, over those in which acceleration builds up.
        const EVEN: f64 = 0.15;
        const EVEN_MAX: f64 = 64.0;
        /// Over the time in which it then reaches its greatest value, with room for paths across several joints.
        const ROOM: f64 = 1.5;
        let time_s = limits
            .iter()
            .map(|limits| limits.velocity / (PACE * limits.acceleration))
            .fold(0.0, f64::max);
        let build_up_s = limits
            .iter()
            .map(|limits| limits.acceleration / limits.jerk)
            .fold(0.0, f64::max);
        let even = (EVEN * build_up_s / step_s).floor().min(EVEN_MAX);
        Knotting {
            step_s,
            // At most the greatest integer, whatever the limits are.
            reach: (GROWING + ROOM * time_s / step_s + 2.0 * even).ceil() as usize,
            even: even as usize,
        }
    }
}

/// The feasible profile over the speed for which knots were placed: accelerations shrink by its square, jerk by its cube.
const SPEED_SHARE: f64 = 0.4;
/// Part of the limits of steady motion at the feasible profile.
const STEADY: f64 = 0.3;
/// Part of the acceleration limit that changes of the feasible profile take, before it is scaled by the square of [`SPEED_SHARE`].
const PACE: f64 = 0.5;
/// The feasible profile grows from span to span by this factor at the most.
const GROWTH: f64 = 1.5;
/// Parts of the limits with which a state is left towards the feasible profile.
const SETTLE_JERK: f64 = 0.5;
const SETTLE_ACCELERATION: f64 = 0.1;

/// Greatest |q'| over acceleration and over jerk at the middle of a span.
pub(super) fn tangent(grid: &Grid, span: usize) -> [f64; 2] {
    let mut most = [0.0f64; 2];
    for row in grid.rows(span, 1) {
        most = [most[0].max(row.a1.abs()), most[1].max(row.j1.abs())];
    }
    most
}

/// Speed at the feasible profile by what a span allows on its own; knots are `step_s` apart.
fn own_speed(grid: &Grid, span: usize, step_s: f64) -> f64 {
    let caps = grid.caps(span);
    let mut b = STEADY * caps.begin.min(caps.middle).min(caps.end);
    let (mut a2, mut j3, mut kink) = (0.0f64, 0.0f64, 0.0f64);
    for row in grid.all_rows(span) {
        a2 = a2.max(row.a2.abs());
        j3 = j3.max(row.j3.abs());
        kink = kink.max(row.kink);
    }
    let (root, slow) = (cube_root(STEADY / j3), STEADY / kink);
    b = b.min(STEADY / a2).min(root * root).min(slow * slow);
    b.sqrt()
        .min(SPEED_SHARE * grid.length(span) / step_s.max(grid.time_s(span)))
}

/// Coefficients of the feasible profile, one per span of the grid in the range.
fn coefficients(grid: &Grid, spans: Range<usize>, knotting: &Knotting) -> Vec<f64> {
    let first = spans.start.saturating_sub(knotting.reach);
    let last = (spans.end + knotting.reach).min(grid.spans());
    let mut speeds: Vec<f64> = (first..last)
        .map(|span| own_speed(grid, span, knotting.step_s))
        .collect();
    let gains: Vec<f64> = (first..last)
        .map(|span| SPEED_SHARE * PACE * knotting.step_s / tangent(grid, span)[0])
        .collect();
    let growth = |speed: f64, gain: f64| (GROWTH * speed).min(speed + gain);
    for k in 1..speeds.len() {
        speeds[k] = speeds[k].min(growth(speeds[k - 1], gains[k]));
    }
    for k in (1..speeds.len()).rev() {
        speeds[k - 1] = speeds[k - 1].min(growth(speeds[k], gains[k - 1]));
    }
    // The mean of least ones is never above any of them.
    let around = |k: usize, count: usize| k.saturating_sub(knotting.even)..(k + knotting.even + 1).min(count);
    let least: Vec<f64> = (0..speeds.len())
        .map(|k| {
            speeds[around(k, speeds.len())]
                .iter()
                .copied()
                .fold(f64::INFINITY, f64::min)
        })
        .collect();
    (spans.start - first..spans.end - first)
        .map(|k| {
            let least = &least[around(k, least.len())];
            least.iter().map(|speed| speed * speed).sum::<f64>() / least.len() as f64
        })
        .collect()
}

/// State at the knot between two spans of these lengths and coefficients.
pub(super) fn between(lengths: [f64; 2], coefficients: [f64; 2]) -> State {
    let sum = lengths[0] + lengths[1];
    State {
        b: (coefficients[0] * lengths[1] + coefficients[1] * lengths[0]) / sum,
        u: (coefficients[1] - coefficients[0]) / sum,
    }
}

/// The feasible profile at all knots of a range of spans; at the ends of the grid, as if its first and last span went on.
pub fn feasible_profile(grid: &Grid, spans: Range<usize>, knotting: &Knotting) -> Vec<State> {
    let first = spans.start.saturating_sub(1);
    let last = (spans.end + 1).min(grid.spans());
    let values = coefficients(grid, first..last, knotting);
    (spans.start..=spans.end)
        .map(|knot| {
            let before = knot.saturating_sub(1).max(first);
            let behind = knot.min(last - 1);
            between(
                [grid.length(before), grid.length(behind)],
                [values[before - first], values[behind - first]],
            )
        })
        .collect()
}

/// A feasible profile over spans from one state to another, at the feasible profile between them where there is room. `feasible` has one state
/// per knot of the spans.
///
/// # Errors
/// The states are too far from the feasible profile for the length.
pub fn initial_guess(
    grid: &Grid,
    spans: Range<usize>,
    from: State,
    to: State,
    feasible: &[State],
) -> Result<Vec<State>, Infeasible> {
    let infeasible = |span| Err(Infeasible { span });
    let count = spans.len();
    if count < 3 {
        return infeasible(spans.start);
    }
    let slow: Vec<f64> = feasible
        .iter()
        .zip(spans.clone())
        .map(|(&state, span)| coefficient(state, grid.length(span)))
        .collect();
    let mut values = slow.clone();
    settle(grid, spans.clone().collect(), from, &slow, &mut values);
    let mirrored = State { b: to.b, u: -to.u };
    values.reverse();
    let reversed: Vec<f64> = slow.iter().rev().copied().collect();
    settle(grid, spans.clone().rev().collect(), mirrored, &reversed, &mut values);
    values.reverse();
    let mut states = Vec::with_capacity(count + 1);
    states.push(from);
    for (k, span) in spans.clone().enumerate().skip(1) {
        states.push(between(
            [grid.length(span - 1), grid.length(span)],
            [values[k - 1], values[k]],
        ));
    }
    states.push(to);
    let found = worst(grid, spans.clone(), &states);
    // Not below 1: a NaN is infeasible, too.
    if found.value < 0.999 {
        Ok(states)
    } else {
        // Another way, with more patience: bends near the ends, or little room.
        let part = grid.part(spans);
        let mut states = feasible.to_vec();
        let ends = [(from, states[0]), (to, states[count])].map(|(end, feasible)| (end != feasible).then_some(end));
        match super::launch::between(&part, &mut states, ends[0], ends[1]) {
            Ok(()) if worst(&part, 0..count, &states).value < 1.0 => Ok(states),
            Ok(()) | Err(_) => infeasible(found.span),
        }
    }
}

/// Leaves a state: acceleration goes to a slow braking until the feasible profile is met. `spans` and coefficients in that order.
pub(super) fn settle(grid: &Grid, spans: Vec<usize>, from: State, feasible: &[f64], values: &mut [f64]) {
    let (mut b, mut u) = (coefficient(from, grid.length(spans[0])), from.u);
    values[0] = b;
    for k in 1..spans.len() {
        let run = 0.5 * (grid.length(spans[k - 1]) + grid.length(spans[k]));
        let [acceleration, jerk] = tangent(grid, spans[k]);
        let next = (u - SETTLE_JERK / jerk * run / b.sqrt()).max(-SETTLE_ACCELERATION / acceleration);
        let ahead = b + (u + next) * run;
        if ahead <= feasible[k] || ahead.is_nan() {
            return;
        }
        (b, u) = (ahead, next);
        values[k] = values[k].max(b);
    }
}
