//! A slow feasible profile everywhere, from which the solver starts and at which windows end.

use super::super::grid::Grid;
use super::super::profile::{State, span_value};
use crate::plan::roots::cube_root;

/// Spans of one step of the slow profile: it is a quadratic spline on every so many-th knot, which keeps u and w small.
const STEP_SPANS: usize = 8;

/// Part of the limits of acceleration, jerk and b that the slow profile uses where the path is bent.
const CURVED_USE: f64 = 0.3;
/// The same for changes of its speed.
const CHANGE_USE: f64 = 0.2;
/// Greatest growth of b from step to step.
const GROWTH: f64 = 3.0;
/// Steps over which a slow place slows down its surroundings.
const GROWTH_ROUNDS: usize = 16;
/// Times that the slow profile is halved around places where it is not feasible.
const REPAIR_ROUNDS: usize = 6;
/// A repaired slow profile keeps clear of the bounds by this factor.
const CLEAR: f64 = 0.9;

/// Several spans between two knots of the slow profile.
#[derive(Clone, Copy, Debug)]
struct Step {
    first: usize,
    end: usize,
    length: f64,
    /// Greatest acceleration and jerk along the path that any joint allows on a straight.
    acceleration: f64,
    jerk: f64,
    /// Middle Bézier ordinate of b.
    ordinate: f64,
}

/// The slow profile over a whole grid: one state per knot. `skipped` is the number of spans between the beginning of the
/// section and that of the grid.
///
/// Feasible except on paths that are out of all proportion; see [`worst`](super::worst).
pub(super) fn slow_profile(grid: &Grid, skipped: usize) -> Vec<State> {
    let mut steps = steps(grid, skipped);
    if steps.is_empty() {
        return Vec::new();
    }
    // An ordinate has a say in the steps next to its own.
    spread(&mut steps, |near, _, own| near.ordinate.min(own.ordinate));
    for _ in 0..GROWTH_ROUNDS {
        spread(&mut steps, |near, far, own| {
            let b = near.ordinate;
            let distance = near.length.min(far);
            let by_jerk = near.jerk * distance * distance / b.sqrt();
            let rise = (2.0 * distance * near.acceleration).min(by_jerk) * CHANGE_USE;
            own.ordinate.min(b + rise.min((GROWTH - 1.0) * b))
        });
    }
    let mut profile = states(grid, &steps);
    for _ in 0..REPAIR_ROUNDS {
        let broken: Vec<bool> = steps
            .iter()
            .map(|step| {
                let feasible = |span| span_value(grid, span, profile[span], profile[span + 1]) < CLEAR;
                !(step.first..step.end).all(feasible)
            })
            .collect();
        if !broken.contains(&true) {
            break;
        }
        for (index, step) in steps.iter_mut().enumerate() {
            let near = index.saturating_sub(2)..(index + 3).min(broken.len());
            if broken[near].contains(&true) {
                step.ordinate *= 0.5;
            }
        }
        profile = states(grid, &steps);
    }
    profile
}

/// Cuts the grid into steps, each with the greatest b that curvature allows at constant speed.
fn steps(grid: &Grid, skipped: usize) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::with_capacity(grid.spans() / STEP_SPANS + 2);
    for span in 0..grid.spans() {
        if steps.is_empty() || (skipped + span).is_multiple_of(STEP_SPANS) {
            steps.push(Step {
                first: span,
                end: span,
                length: 0.0,
                acceleration: f64::INFINITY,
                jerk: f64::INFINITY,
                ordinate: f64::INFINITY,
            });
        }
        let Some(step) = steps.last_mut() else { continue };
        step.end = span + 1;
        step.length += grid.length(span);
        let caps = grid.caps(span);
        let mut b = 0.5 * caps.begin.min(caps.middle).min(caps.end);
        for checkpoint in 0..grid.checkpoints(span).len() {
            for row in grid.rows(span, checkpoint) {
                b = b.min(CURVED_USE / row.a2.abs());
                let root = cube_root(CURVED_USE / row.j3.abs());
                b = b.min(root * root);
                step.acceleration = step.acceleration.min(1.0 / row.a1.abs());
                step.jerk = step.jerk.min(1.0 / row.j1.abs());
            }
        }
        step.ordinate = step.ordinate.min(b);
    }
    // A path without any limit, which there is not: some number.
    for step in &mut steps {
        step.ordinate = step.ordinate.min(1e12);
    }
    steps
}

/// New ordinate of every step from itself and each neighbour: `f(neighbour, own length, own)`.
fn spread(steps: &mut [Step], f: impl Fn(&Step, f64, &Step) -> f64) {
    let mut before: Option<Step> = None;
    for index in 0..steps.len() {
        let own = steps[index];
        let mut ordinate = own.ordinate;
        for near in [before.as_ref(), steps.get(index + 1)].into_iter().flatten() {
            ordinate = ordinate.min(f(near, own.length, &own));
        }
        before = Some(own);
        steps[index].ordinate = ordinate;
    }
}

/// The spline on the coarse knots, at all knots; at constant speed at both ends.
fn states(grid: &Grid, steps: &[Step]) -> Vec<State> {
    let mut profile = Vec::with_capacity(grid.spans() + 1);
    let mut here = State {
        b: steps[0].ordinate,
        u: 0.0,
    };
    for (index, step) in steps.iter().enumerate() {
        let next = match steps.get(index + 1) {
            Some(next) => {
                let u = (next.ordinate - step.ordinate) / (step.length + next.length);
                State {
                    b: step.ordinate + u * step.length,
                    u,
                }
            }
            None => State {
                b: step.ordinate,
                u: 0.0,
            },
        };
        let w = (next.u - here.u) / step.length;
        let mut s = 0.0;
        for span in step.first..step.end {
            profile.push(State {
                b: here.b + s * (2.0 * here.u + s * w),
                u: here.u + s * w,
            });
            s += grid.length(span);
        }
        here = next;
    }
    profile.push(here);
    debug_assert_eq!(profile.len(), grid.spans() + 1);
    profile
}
