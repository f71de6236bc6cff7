//! Interior point method for the fastest profile.
//!
//! In:  a grid; a strictly feasible profile to start from.
//! Out: a faster one, strictly feasible.
//!
//! Every iteration is a Newton step of the time and the barriers of all constraints, in which multipliers say how stiff each
//! constraint is (primal-dual). The step goes on until shortly before the first bound. One constraint of thousands that was
//! not seen in time would make it short; so those that a step would break are made stiffer, and the step is computed again,
//! before any of it is done. The weight of the barriers sinks with what steps still gain.

use std::ops::Range;

use super::band::Factor;
use super::constraints::Constraints;
use super::grid::Grid;
use super::lanes::LANES;
use super::passes::{System, advance, assemble, stiffen};
use super::profile::{State, coefficient, span_value};

/// How far to solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Stop when the estimated gap to the optimum is below this part of the time.
    pub gap: f64,
    /// Most iterations; the profile is feasible after any number of them.
    pub iterations: u32,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            gap: 1e-3,
            iterations: 80,
        }
    }
}

/// Part of the way to the nearest bound that a step takes.
const TO_BOUND: f64 = 0.995;
/// What is left of the weight of the barrier after a nearly full step, a medium one, and at least after a short one.
const LEAVE: [f64; 3] = [0.125, 0.25, 0.1];
/// The gap is not made smaller than this part of what the last step was to gain: nearer to the bounds, the method would creep
/// along them.
const GAIN_PART: f64 = 0.3;
/// Gap to begin with, as a part of the time: with more, the method would first slow down what is well within the limits.
const FIRST_GAP: f64 = 0.3;
/// Least and greatest ratio of a multiplier to the one that belongs to its slack.
const CENTRALITY: [f64; 2] = [0.1, 1e4];
/// The same where multipliers restart.
const RESTART_CENTRALITY: [f64; 2] = [1.0, 1.0];
/// Step below which an iteration counts as stuck, and how many of them in a row restart the multipliers.
const STUCK: (f64, u32) = (0.02, 3);

/// What came of [`solve`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    /// Newton steps that were taken.
    pub iterations: u32,
    /// Whether the gap was met; the profile is feasible either way.
    pub converged: bool,
    /// Time from end to end as the solver counts it (Simpson), s.
    pub time_s: f64,
}

/// The profile to start from is not strictly feasible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Infeasible {
    /// First span where it is not.
    pub span: usize,
}

/// Buffers of [`solve`], kept between calls to save allocations.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    constraints: Constraints,
    system: System,
    factor: Factor,
    /// Coefficients of the spline, their step, and the right side of the system that gives it.
    c: Vec<f64>,
    d: Vec<f64>,
    right: Vec<f64>,
    result: Vec<State>,
}

impl Workspace {
    fn begin(&mut self, grid: &Grid, spans: Range<usize>, profile: &[State]) {
        let count = spans.len();
        self.constraints.pack(grid, spans.clone());
        self.c.clear();
        self.c.push(profile[0].b);
        for (index, span) in spans.enumerate() {
            self.c.push(coefficient(profile[index], grid.length(span)));
        }
        self.c.push(profile[count].b);
        self.c.resize(count.next_multiple_of(LANES) + 2, profile[count].b);
    }
}

/// The fastest profile between the first and last state of `profile`, which must be strictly feasible (see
/// [`worst`](super::worst)) and becomes the result. One state per knot: one more than `spans`.
///
/// Every iterate is feasible: the result is, whether or not it converged.
pub fn solve(
    grid: &Grid,
    spans: Range<usize>,
    profile: &mut [State],
    options: &Options,
    workspace: &mut Workspace,
) -> Result<Solved, Infeasible> {
    if let Some(span) = infeasible(grid, spans.clone(), profile) {
        return Err(Infeasible { span });
    }
    let count = spans.len();
    let mut solved = Solved {
        iterations: 0,
        converged: true,
        time_s: simpson_time(grid, spans.clone(), profile),
    };
    // The end states fix two coefficients each.
    if count <= 2 {
        return Ok(solved);
    }
    workspace.begin(grid, spans.clone(), profile);
    solved.converged = workspace.iterate(options, &mut solved);
    let mut result = std::mem::take(&mut workspace.result);
    workspace.unpack(grid, spans.clone(), profile, &mut result);
    // Not to be expected: rounding at a bound.
    if infeasible(grid, spans.clone(), &result).is_none() {
        profile.copy_from_slice(&result);
    } else {
        solved.converged = false;
    }
    solved.time_s = simpson_time(grid, spans, profile);
    workspace.result = result;
    Ok(solved)
}

fn infeasible(grid: &Grid, spans: Range<usize>, profile: &[State]) -> Option<usize> {
    let below = |&(index, span): &(usize, usize)| span_value(grid, span, profile[index], profile[index + 1]) < 1.0;
    spans.enumerate().find(|at| !below(at)).map(|(_, span)| span)
}

fn simpson_time(grid: &Grid, spans: Range<usize>, profile: &[State]) -> f64 {
    let mut time = 0.0;
    for (index, span) in spans.enumerate() {
        let h = grid.length(span);
        let (from, to) = (profile[index], profile[index + 1]);
        let middle = coefficient(from, h) + 0.25 * h * (to.u - from.u);
        time += h / 6.0 * (1.0 / from.b.sqrt() + 4.0 / middle.sqrt() + 1.0 / to.b.sqrt());
    }
    time
}

impl Workspace {
    /// Improves `c`; whether the gap was met.
    fn iterate(&mut self, options: &Options, solved: &mut Solved) -> bool {
        let number = self.constraints.number() as f64;
        let free = 2..self.constraints.count;
        let mut mu = FIRST_GAP * solved.time_s / number;
        let mut centrality = RESTART_CENTRALITY;
        let mut stuck = 0;
        while solved.iterations < options.iterations {
            let time_s = assemble(&mut self.constraints, &self.c, mu, centrality, &mut self.system);
            let System {
                matrix,
                time_gradient,
                barrier_gradient,
            } = &mut self.system;
            self.right.clear();
            let gradients = time_gradient.iter().zip(barrier_gradient.iter());
            self.right.extend(gradients.map(|(time, barrier)| -time - mu * barrier));
            self.factor.solve(matrix, free.clone(), &self.right, &mut self.d);
            // Once more would shorten iterations less than it costs.
            if stiffen(&mut self.constraints, mu, &self.d, matrix) {
                self.factor.solve(matrix, free.clone(), &self.right, &mut self.d);
            }
            let most = advance(&mut self.constraints, mu, &self.d);
            // At first order.
            let gain = -time_gradient.iter().zip(&self.d).map(|(g, d)| g * d).sum::<f64>();
            if !(time_s + gain + most).is_finite() {
                return false;
            }
            let alpha = (TO_BOUND / most).min(1.0);
            for (c, d) in self.c[free.clone()].iter_mut().zip(&self.d[free.clone()]) {
                *c += alpha * d;
            }
            solved.iterations += 1;
            if (mu * number).max(gain) < options.gap * time_s {
                return true;
            }
            let leave = if alpha > 0.9 {
                LEAVE[0]
            } else if alpha > 0.5 {
                LEAVE[1]
            } else {
                (1.0 - alpha).max(LEAVE[2])
            };
            mu = (leave * mu).max(GAIN_PART * gain / number).min(mu);
            centrality = CENTRALITY;
            stuck = if alpha < STUCK.0 { stuck + 1 } else { 0 };
            if stuck >= STUCK.1 {
                mu *= 10.0;
                centrality = RESTART_CENTRALITY;
                stuck = 0;
            }
        }
        false
    }

    /// The profile that belongs to `c`; end states as they were.
    fn unpack(&self, grid: &Grid, spans: Range<usize>, profile: &[State], result: &mut Vec<State>) {
        result.clear();
        result.extend_from_slice(profile);
        for (index, state) in result.iter_mut().enumerate().take(self.constraints.count).skip(1) {
            let span = spans.start + index;
            let (before, here) = (grid.length(span - 1), grid.length(span));
            let u = (self.c[index + 1] - self.c[index]) / (before + here);
            *state = State {
                b: self.c[index] + u * before,
                u,
            };
        }
    }
}
