//! A way from any state on a plan down to the feasible profile: where a new plan takes over from an old one.
//!
//! In:  a grid; a state that is within the limits, as fast as it may be and in the middle of any change of speed.
//! Out: a feasible profile that brakes towards the feasible profile, as firmly as every place allows.

use std::ops::Range;

use super::grid::Grid;
use super::initial_guess::{between, initial_guess, settle, tangent};
use super::interior::Infeasible;
use super::profile::{State, coefficient, worst};

/// Parts of acceleration and jerk with which speed is taken back, one try after the other.
const FIRMNESS: [[f64; 2]; 4] = [[0.75, 0.75], [0.6, 0.9], [0.5, 0.5], [0.3, 0.5]];
/// Part of that jerk with which braking ends.
const LANDING: f64 = 0.5;
/// Part of the limits that a span may come to, and where that leaves no way.
const ROOM: [f64; 2] = [0.98, 0.9995];
/// Speed for which braking aims, over the feasible profile: it must get below.
const BELOW: f64 = 0.97;

/// A feasible profile over spans from a state on a plan to another state, at the feasible profile between them where there is room. `feasible` has
/// one state per knot of the spans.
///
/// # Errors
/// None was found.
pub fn first_braking(
    grid: &Grid,
    spans: Range<usize>,
    from: State,
    to: State,
    feasible: &[State],
) -> Result<Vec<State>, Infeasible> {
    let count = spans.len();
    if count < 3 {
        return Err(Infeasible { span: spans.start });
    }
    let slow: Vec<f64> = feasible
        .iter()
        .zip(spans.clone())
        .map(|(&state, span)| coefficient(state, grid.length(span)))
        .collect();
    for firmness in FIRMNESS {
        let mut values = slow.clone();
        brake(grid, spans.clone(), from, &slow, firmness, &mut values);
        let mirrored = State { b: to.b, u: -to.u };
        values.reverse();
        let reversed: Vec<f64> = slow.iter().rev().copied().collect();
        settle(grid, spans.clone().rev().collect(), mirrored, &reversed, &mut values);
        values.reverse();
        let mut states = Vec::with_capacity(count + 1);
        states.push(from);
        states.extend((1..count).map(|k| {
            let span = spans.start + k;
            between([grid.length(span - 1), grid.length(span)], [values[k - 1], values[k]])
        }));
        states.push(to);
        if worst(grid, spans.clone(), &states).value < 1.0 - 1e-7 {
            return Ok(states);
        }
    }
    initial_guess(grid, spans, from, to, feasible)
}

/// Coefficients from a state down to the feasible profile.
fn brake(grid: &Grid, spans: Range<usize>, from: State, feasible: &[f64], [a, j]: [f64; 2], values: &mut [f64]) {
    let State { mut b, mut u } = from;
    for (k, span) in spans.clone().enumerate() {
        let h = grid.length(span);
        values[k] = b + u * h;
        if k + 1 == spans.len() {
            return;
        }
        let v = b.sqrt();
        let [acceleration, jerk] = tangent(grid, span).map(|tangent| 1.0 / tangent);
        // As much as can be taken back to nothing until the feasible profile is reached, seen from the end of this span: spans may take so
        // long that a few of them are all that is left.
        let ahead = (b + 2.0 * u.min(0.0) * h).max(0.0).sqrt();
        let excess = (ahead - BELOW * feasible[k].sqrt()).max(0.0);
        let wanted = -(a * acceleration).min((2.0 * LANDING * j * jerk * excess).sqrt());
        let change = j * jerk * h / v;
        let wanted = wanted.clamp(u - change, u + change);
        let Some(next) = ROOM
            .iter()
            .find_map(|&room| nearest(grid, span, State { b, u }, wanted, room))
        else {
            return;
        };
        b += (u + next) * h;
        u = next;
        let ahead = b + u * grid.length(span + 1);
        if ahead <= feasible[k + 1] || ahead.is_nan() {
            return;
        }
    }
}

/// The acceleration at the end of a span that is nearest to the wanted one and keeps all limits on the span.
fn nearest(grid: &Grid, span: usize, State { b, u }: State, wanted: f64, room: f64) -> Option<f64> {
    let h = grid.length(span);
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut bound = |fixed: f64, slope: f64, most: f64| {
        if slope == 0.0 {
            return;
        }
        let ends = [(-most - fixed) / slope, (most - fixed) / slope];
        low = low.max(ends[0].min(ends[1]));
        high = high.min(ends[0].max(ends[1]));
    };
    for (checkpoint, &(part, _)) in grid.checkpoints(span).iter().enumerate() {
        // u and b there are linear in u at the end.
        let (u_fixed, u_slope) = ((1.0 - part) * u, part);
        let (b_fixed, b_slope) = (b + h * (2.0 * part - part * part) * u, h * part * part);
        let v = (b_fixed + b_slope * u).sqrt();
        for row in grid.rows(span, checkpoint) {
            bound(
                row.a1 * u_fixed + row.a2 * b_fixed,
                row.a1 * u_slope + row.a2 * b_slope,
                room,
            );
            bound(
                -row.j1 * u / h + row.j2 * u_fixed + row.j3 * b_fixed,
                row.j1 / h + row.j2 * u_slope + row.j3 * b_slope,
                room / v - row.kink,
            );
        }
    }
    (low <= high).then(|| wanted.max(low).min(high))
}
