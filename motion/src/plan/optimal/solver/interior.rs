//! Primal-dual interior point method for the fastest profile.

use std::ops::Range;

use super::band::Band;
use super::grid::{CHECKPOINTS, FINE_CHECKPOINTS, Grid, Row};
use super::lanes::{LANES, Lane};
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
const TO_BOUND: f64 = 0.98;
/// What a step aims to leave of the gap: after a nearly full step, a medium one, and at least after a short one.
const LEAVE: [f64; 3] = [0.125, 0.25, 0.1];
/// The gap is not made smaller than this part of the first-order gain that is left (see [`Sums::residual`]): nearer to
/// the bounds, the method would creep along them.
const RESIDUAL_PART: f64 = 0.3;
/// Gap to begin with, as a part of the time: with more, the method would first slow down what is well within the limits.
const FIRST_GAP: f64 = 0.3;
/// Greatest ratio of a multiplier to the one that belongs to its slack, either way.
const CENTRALITY: f64 = 1e4;
/// Second derivative of the time by b, over b^(-5/2) h. That of h / sqrt(b) is 0.75; that of the same function seen
/// over ln(b) is 0.25, whose Newton steps triple a far too low b.
const TIME_CURVATURE: f64 = 0.25;
/// Step below which an iteration counts as stuck, and how many of them in a row start the multipliers anew.
const STUCK: (f64, u32) = (0.02, 3);

/// What came of [`solve`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    /// Iterations taken.
    pub iterations: u32,
    /// Whether the gap was met; the profile is feasible either way.
    pub converged: bool,
    /// Time from end to end as the solver counts it (Simpson), s.
    pub time_s: f64,
}

/// The profile to start from is not strictly feasible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Infeasible {
    /// Span where.
    pub span: usize,
}

/// Buffers of [`solve`], kept between calls to save allocations.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    blocks: Vec<Block>,
    rows: Vec<Pair>,
    duals: Vec<Dual>,
    band: Band,
    /// Coefficients of the spline.
    c: Vec<f64>,
    /// Gradient of the time, and of the barrier at weight 1; then steps.
    time_gradient: Vec<f64>,
    barrier_gradient: Vec<f64>,
    dual_gradient: Vec<f64>,
    /// Spans.
    count: usize,
    /// Joints that move; the others bound nothing.
    joints: Vec<usize>,
    result: Vec<State>,
}

/// What is fixed for [`LANES`] neighbouring spans. Within a span, x = (middle Bézier ordinate of b, u at the beginning,
/// u at the end).
#[derive(Clone, Copy, Debug)]
struct Block {
    h: Lane,
    inverse_h: Lane,
    /// u = k (c[i + 1] - c[i]) at the beginning and end.
    k0: Lane,
    k1: Lane,
    /// 1 / cap of b at the beginning, and of the middle ordinate.
    knot: Lane,
    middle: Lane,
    /// 1, or 0 for lanes behind the last span.
    used: Lane,
    /// Index of its first row, rows of a checkpoint, and its checkpoints.
    first: usize,
    rows: usize,
    checkpoints: &'static [(f64, f64)],
    knot_dual: [Lane; 2],
    middle_dual: [Lane; 2],
}

/// Acceleration and jerk / sqrt(b) of one joint at one checkpoint: linear in x.
#[derive(Clone, Copy, Debug, Default)]
struct Pair {
    acceleration: [Lane; 3],
    jerk: [Lane; 3],
}

/// Multipliers of both bounds of acceleration and jerk; [current, target of the last step].
#[derive(Clone, Copy, Debug)]
struct Dual {
    acceleration: [[Lane; 2]; 2],
    jerk: [[Lane; 2]; 2],
}

#[inline(always)]
fn dot(row: &[Lane; 3], x: &[Lane; 3]) -> Lane {
    row[0] * x[0] + row[1] * x[1] + row[2] * x[2]
}

/// Two reciprocals for the price of one division, on which this code would wait else.
#[inline(always)]
fn both_recip(a: Lane, b: Lane) -> [Lane; 2] {
    let both = (a * b).recip();
    [b * both, a * both]
}

#[inline(always)]
fn add_scaled(to: &mut [Lane; 3], scale: Lane, row: &[Lane; 3]) {
    for (to, &row) in to.iter_mut().zip(row) {
        *to += scale * row;
    }
}

/// Adds scale · row rowᵀ to a symmetric matrix (00, 01, 02, 11, 12, 22).
#[inline(always)]
fn add_square(to: &mut [Lane; 6], scale: Lane, row: &[Lane; 3]) {
    let scaled = [scale * row[0], scale * row[1], scale * row[2]];
    to[0] += scaled[0] * row[0];
    to[1] += scaled[0] * row[1];
    to[2] += scaled[0] * row[2];
    to[3] += scaled[1] * row[1];
    to[4] += scaled[1] * row[2];
    to[5] += scaled[2] * row[2];
}

impl Block {
    /// b as a linear function of x at a part of the span.
    #[inline(always)]
    fn b_row(&self, part: f64) -> [Lane; 3] {
        let rest = 1.0 - part;
        [
            Lane::splat(1.0),
            Lane::splat(-rest * rest) * self.h,
            Lane::splat(part * part) * self.h,
        ]
    }

    #[inline(always)]
    fn x(&self, c: &[f64]) -> [Lane; 3] {
        let at = |shift: usize| Lane(core::array::from_fn(|lane| c[lane + shift]));
        let (c0, c1, c2) = (at(0), at(1), at(2));
        [c1, self.k0 * (c1 - c0), self.k1 * (c2 - c1)]
    }
}

impl Pair {
    /// Derivatives by (b, u, w) at a part of the span, as derivatives by x.
    fn set(&mut self, lane: usize, row: &Row, part: f64, h: f64) {
        let rest = 1.0 - part;
        let (b1, b2) = (-rest * rest * h, part * part * h);
        let by_w = row.j1 / h;
        self.acceleration[0].0[lane] = row.a2;
        self.acceleration[1].0[lane] = row.a2 * b1 + row.a1 * rest;
        self.acceleration[2].0[lane] = row.a2 * b2 + row.a1 * part;
        self.jerk[0].0[lane] = row.j3;
        self.jerk[1].0[lane] = row.j3 * b1 + row.j2 * rest - by_w;
        self.jerk[2].0[lane] = row.j3 * b2 + row.j2 * part + by_w;
    }
}

/// Where joints move evenly over all of these spans (`None`: no span): the tightest of each bound stands for those of all
/// joints, the same at every checkpoint.
fn straight(grid: &Grid, joints: &[usize], spans: impl Iterator<Item = Option<usize>>) -> Option<[Row; LANES]> {
    let mut tightest = [Row::default(); LANES];
    for (tightest, span) in tightest.iter_mut().zip(spans) {
        let Some(span) = span else { continue };
        if grid.is_fine(span) {
            return None;
        }
        for checkpoint in 0..CHECKPOINTS.len() {
            let rows = grid.rows(span, checkpoint);
            for row in joints.iter().map(|&joint| &rows[joint]) {
                if row.a2 != 0.0 || row.j3 != 0.0 {
                    return None;
                }
                tightest.a1 = tightest.a1.max(row.a1.abs());
                tightest.j1 = tightest.j1.max(row.j1.abs());
            }
        }
    }
    Some(tightest)
}

impl Workspace {
    fn pack(&mut self, grid: &Grid, spans: Range<usize>, profile: &[State]) {
        let count = spans.len();
        let blocks = count.div_ceil(LANES);
        self.count = count;
        let moves = |joint: usize| {
            let mut rows = spans.clone().flat_map(|span| {
                (0..grid.checkpoints(span).len()).map(move |checkpoint| &grid.rows(span, checkpoint)[joint])
            });
            rows.any(|row| *row != Row::default())
        };
        self.joints.clear();
        self.joints.extend((0..grid.joints()).filter(|&joint| moves(joint)));
        self.blocks.clear();
        self.rows.clear();
        for block in 0..blocks {
            let mut lanes = Block {
                first: 0,
                rows: self.joints.len(),
                checkpoints: &CHECKPOINTS,
                h: Lane::splat(1.0),
                inverse_h: Lane::splat(1.0),
                k0: Lane::splat(0.0),
                k1: Lane::splat(0.0),
                knot: Lane::splat(0.0),
                middle: Lane::splat(0.0),
                used: Lane::splat(0.0),
                knot_dual: [Lane::splat(0.0); 2],
                middle_dual: [Lane::splat(0.0); 2],
            };
            for lane in 0..LANES {
                let index = block * LANES + lane;
                if index >= count {
                    continue;
                }
                let span = spans.start + index;
                let h = grid.length(span);
                let before = if index > 0 { grid.length(span - 1) } else { 0.0 };
                let after = if index + 1 < count { grid.length(span + 1) } else { 0.0 };
                lanes.h.0[lane] = h;
                lanes.inverse_h.0[lane] = 1.0 / h;
                lanes.k0.0[lane] = 1.0 / (before + h);
                lanes.k1.0[lane] = 1.0 / (h + after);
                // The first knot is fixed.
                lanes.knot.0[lane] = if index > 0 { 1.0 / grid.knot_cap(span) } else { 0.0 };
                lanes.middle.0[lane] = 1.0 / grid.caps(span).middle;
                lanes.used.0[lane] = 1.0;
            }
            let own = |lane: usize| {
                let index = block * LANES + lane;
                (index < count).then_some(spans.start + index)
            };
            lanes.first = self.rows.len();
            if let Some(pair) = straight(grid, &self.joints, (0..LANES).map(own)) {
                lanes.rows = 1;
                for &(part, _) in lanes.checkpoints {
                    let mut at = Pair::default();
                    for (lane, row) in pair.iter().enumerate() {
                        at.set(lane, row, part, lanes.h.0[lane]);
                    }
                    self.rows.push(at);
                }
                self.blocks.push(lanes);
                continue;
            }
            let fine = (0..LANES).filter_map(own).any(|span| grid.is_fine(span));
            lanes.checkpoints = if fine { &FINE_CHECKPOINTS } else { &CHECKPOINTS };
            for (checkpoint, &(part, _)) in lanes.checkpoints.iter().enumerate() {
                for &joint in &self.joints {
                    let mut pair = Pair::default();
                    for lane in 0..LANES {
                        let Some(span) = own(lane) else { continue };
                        // Beside a span that has quarters, one that has none: nothing to hold there.
                        let row = match (fine, grid.is_fine(span)) {
                            (true, false) if checkpoint % 2 == 1 => continue,
                            (true, false) => &grid.rows(span, checkpoint / 2)[joint],
                            _ => &grid.rows(span, checkpoint)[joint],
                        };
                        pair.set(lane, row, part, lanes.h.0[lane]);
                    }
                    self.rows.push(pair);
                }
            }
            self.blocks.push(lanes);
        }
        self.c.clear();
        self.c.push(profile[0].b);
        for (index, span) in spans.enumerate() {
            self.c.push(coefficient(profile[index], grid.length(span)));
        }
        self.c.push(profile[count].b);
        self.c.resize(blocks * LANES + 2, profile[count].b);
    }

    /// Multipliers from the start: complementarity `mu` everywhere.
    fn start_duals(&mut self, mu: f64) {
        self.duals.clear();
        for (index, block) in self.blocks.iter_mut().enumerate() {
            let x = block.x(&self.c[index * LANES..]);
            let mu = Lane::splat(mu) * block.used;
            let one = Lane::splat(1.0);
            let b_begin = block.b_row(0.0);
            block.knot_dual = [mu * (one - block.knot * dot(&b_begin, &x)).recip(); 2];
            block.middle_dual = [mu * (one - block.middle * x[0]).recip(); 2];
            for (checkpoint, &(part, _)) in block.checkpoints.iter().enumerate() {
                let beta = dot(&block.b_row(part), &x).sqrt().recip();
                let first = block.first + checkpoint * block.rows;
                for pair in &self.rows[first..first + block.rows] {
                    let a = dot(&pair.acceleration, &x);
                    let q = dot(&pair.jerk, &x);
                    self.duals.push(Dual {
                        acceleration: [[mu * (one - a).recip(); 2], [mu * (one + a).recip(); 2]],
                        jerk: [[mu * (beta - q).recip(); 2], [mu * (beta + q).recip(); 2]],
                    });
                }
            }
        }
    }
}

/// What one pass over the constraints found.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Sum of multiplier times slack.
    gap: f64,
    /// Time, s.
    time: f64,
    /// What changing every coefficient by its own size would gain at first order, s: 0 where the multipliers balance
    /// the time.
    residual: f64,
}

impl Workspace {
    /// Values, gradients and matrix at `c`; takes the part `take` of the last dual step.
    fn assemble(&mut self, take: f64, mu: f64) -> Sums {
        let size = self.c.len();
        self.band.reset(size);
        self.time_gradient.clear();
        self.time_gradient.resize(size, 0.0);
        self.barrier_gradient.clear();
        self.barrier_gradient.resize(size, 0.0);
        self.dual_gradient.clear();
        self.dual_gradient.resize(size, 0.0);
        let (zero, one, two) = (Lane::splat(0.0), Lane::splat(1.0), Lane::splat(2.0));
        let half = Lane::splat(0.5);
        let mut gap = zero;
        let mut time = zero;
        let take = Lane::splat(take);
        for (index, block) in self.blocks.iter_mut().enumerate() {
            let used = block.used;
            let (low, high) = (Lane::splat(mu / CENTRALITY) * used, Lane::splat(mu * CENTRALITY) * used);
            let dual = |dual: &mut [Lane; 2], inverse: Lane| {
                let value = dual[0] + take * (dual[1] - dual[0]);
                dual[0] = value.max(low * inverse).min(high * inverse);
                dual[0]
            };
            let x = block.x(&self.c[index * LANES..]);
            let mut hessian = [zero; 6];
            let mut by_time = [zero; 3];
            let mut by_barrier = [zero; 3];
            let mut by_dual = [zero; 3];
            let b_begin = block.b_row(0.0);

            let slack = one - block.knot * dot(&b_begin, &x);
            let inverse = slack.recip();
            let multiplier = dual(&mut block.knot_dual, inverse);
            gap += multiplier * slack;
            add_square(&mut hessian, multiplier * inverse * block.knot * block.knot, &b_begin);
            add_scaled(&mut by_barrier, inverse * block.knot, &b_begin);
            add_scaled(&mut by_dual, multiplier * block.knot, &b_begin);

            let slack = one - block.middle * x[0];
            let inverse = slack.recip();
            let multiplier = dual(&mut block.middle_dual, inverse);
            gap += multiplier * slack;
            hessian[0] += multiplier * inverse * block.middle * block.middle;
            by_barrier[0] += inverse * block.middle;
            by_dual[0] += multiplier * block.middle;

            for (checkpoint, &(part, weight)) in block.checkpoints.iter().enumerate() {
                let first = block.first + checkpoint * block.rows;
                let b_row = &block.b_row(part);
                let b = dot(b_row, &x);
                let inverse_b = b.recip();
                let beta = inverse_b.sqrt();
                // d(1/sqrt(b))/db
                let slope = zero - half * beta * inverse_b;
                let (mut both, mut turned, mut barrier) = (zero, [zero; 3], zero);
                let mut duals_of_b = zero;
                let pairs = &self.rows[first..first + block.rows];
                for (pair, duals) in pairs.iter().zip(&mut self.duals[first..first + block.rows]) {
                    let a = dot(&pair.acceleration, &x);
                    let q = dot(&pair.jerk, &x);
                    let [inverse, inverse_of_jerk] = both_recip((one - a) * (one + a), (beta - q) * (beta + q));
                    let (plus, minus) = (one - a, one + a);
                    let (inverse_plus, inverse_minus) = (minus * inverse, plus * inverse);
                    let l_plus = dual(&mut duals.acceleration[0], inverse_plus);
                    let l_minus = dual(&mut duals.acceleration[1], inverse_minus);
                    gap += l_plus * plus + l_minus * minus;
                    add_square(
                        &mut hessian,
                        l_plus * inverse_plus + l_minus * inverse_minus,
                        &pair.acceleration,
                    );
                    add_scaled(&mut by_barrier, two * a * inverse, &pair.acceleration);
                    add_scaled(&mut by_dual, l_plus - l_minus, &pair.acceleration);

                    let inverse = inverse_of_jerk;
                    let (plus, minus) = (beta - q, beta + q);
                    let (inverse_plus, inverse_minus) = (minus * inverse, plus * inverse);
                    let l_plus = dual(&mut duals.jerk[0], inverse_plus);
                    let l_minus = dual(&mut duals.jerk[1], inverse_minus);
                    gap += l_plus * plus + l_minus * minus;
                    let (weight_plus, weight_minus) = (l_plus * inverse_plus, l_minus * inverse_minus);
                    let sum = weight_plus + weight_minus;
                    add_square(&mut hessian, sum, &pair.jerk);
                    both += sum;
                    add_scaled(&mut turned, weight_plus - weight_minus, &pair.jerk);
                    add_scaled(&mut by_barrier, two * q * inverse, &pair.jerk);
                    barrier += two * beta * inverse;
                    add_scaled(&mut by_dual, l_plus - l_minus, &pair.jerk);
                    duals_of_b += l_plus + l_minus;
                }
                let weight = Lane::splat(weight) * block.h * used;
                time += weight * beta;
                add_scaled(&mut by_time, weight * slope, b_row);
                add_scaled(&mut by_barrier, zero - barrier * slope, b_row);
                add_scaled(&mut by_dual, (weight - duals_of_b) * slope, b_row);
                // Jerk bounds are convex in b: their second derivative counts against that of the time, and is left out
                // beyond, so that the matrix stays positive definite.
                let curvature =
                    Lane::splat(TIME_CURVATURE) * (weight - duals_of_b).max(zero) * beta * inverse_b * inverse_b;
                add_square(&mut hessian, both * slope * slope + curvature, b_row);
                // - slope (b turnedᵀ + turned bᵀ)
                let t = [slope * turned[0], slope * turned[1], slope * turned[2]];
                hessian[0] = hessian[0] - two * t[0] * b_row[0];
                hessian[1] = hessian[1] - (t[0] * b_row[1] + t[1] * b_row[0]);
                hessian[2] = hessian[2] - (t[0] * b_row[2] + t[2] * b_row[0]);
                hessian[3] = hessian[3] - two * t[1] * b_row[1];
                hessian[4] = hessian[4] - (t[1] * b_row[2] + t[2] * b_row[1]);
                hessian[5] = hessian[5] - two * t[2] * b_row[2];
            }

            // To the coefficients: x0 = c1, x1 = k0 (c1 - c0), x2 = k1 (c2 - c1).
            let (k0, k1) = (block.k0, block.k1);
            let [h00, h01, h02, h11, h12, h22] = hessian;
            let c00 = k0 * k0 * h11;
            let c01 = k0 * (k1 * h12 - h01 - k0 * h11);
            let c02 = zero - k0 * k1 * h12;
            let c11 = h00 + k0 * k0 * h11 + k1 * k1 * h22 + two * (k0 * h01 - k1 * h02 - k0 * k1 * h12);
            let c12 = k1 * (h02 + k0 * h12 - k1 * h22);
            let c22 = k1 * k1 * h22;
            let to_coefficients = |g: &[Lane; 3]| {
                let (g1, g2) = (k0 * g[1], k1 * g[2]);
                [zero - g1, g[0] + g1 - g2, g2]
            };
            let by_time = to_coefficients(&by_time);
            let by_barrier = to_coefficients(&by_barrier);
            let by_dual = to_coefficients(&by_dual);
            for lane in 0..LANES {
                let at = index * LANES + lane;
                let rows = &mut self.band.rows[at..at + 3];
                rows[0].diagonal += c00.0[lane];
                rows[0].next += c01.0[lane];
                rows[0].second += c02.0[lane];
                rows[1].diagonal += c11.0[lane];
                rows[1].next += c12.0[lane];
                rows[2].diagonal += c22.0[lane];
                for k in 0..3 {
                    self.time_gradient[at + k] += by_time[k].0[lane];
                    self.barrier_gradient[at + k] += by_barrier[k].0[lane];
                    self.dual_gradient[at + k] += by_dual[k].0[lane];
                }
            }
        }
        let coefficients = self.c[2..self.count].iter();
        let residual = coefficients
            .zip(&self.dual_gradient[2..self.count])
            .map(|(c, g)| (c * g).abs())
            .sum();
        Sums {
            gap: gap.sum(),
            time: time.sum(),
            residual,
        }
    }

    /// New multipliers for the step `d` of the coefficients; returns the greatest part of a slack (or of b, to 9/10)
    /// that the step would use up, and the greatest relative fall of a multiplier.
    fn step(&mut self, mu: f64, d: &[f64]) -> (f64, f64) {
        let (zero, one) = (Lane::splat(0.0), Lane::splat(1.0));
        let half = Lane::splat(0.5);
        // A multiplier that is 0 belongs to no span.
        let least = Lane::splat(1e-150);
        let mut most = zero;
        let mut fall = zero;
        let mut sinking = zero;
        for (index, block) in self.blocks.iter_mut().enumerate() {
            let mu = Lane::splat(mu) * block.used;
            let x = block.x(&self.c[index * LANES..]);
            let dx = block.x(&d[index * LANES..]);
            let b_begin = block.b_row(0.0);
            // `closing`: how much of the slack the step takes, as a part of it.
            let mut pair_of_duals = |[plus, minus]: [&mut [Lane; 2]; 2], inverse: [Lane; 2], closing: [Lane; 2]| {
                most = most.max(closing[0]).max(closing[1]);
                plus[1] = inverse[0] * mu + plus[0] * closing[0];
                minus[1] = inverse[1] * mu + minus[0] * closing[1];
                // fall = 1 - new / old
                let [a, b] = both_recip(plus[0].max(least), minus[0].max(least));
                fall = fall.max(one - plus[1] * a).max(one - minus[1] * b);
            };
            let knot = block.knot * dot(&b_begin, &dx);
            let middle = block.middle * dx[0];
            let [of_knot, of_middle] = both_recip(one - block.knot * dot(&b_begin, &x), one - block.middle * x[0]);
            pair_of_duals(
                [&mut block.knot_dual, &mut block.middle_dual],
                [of_knot, of_middle],
                [of_knot * knot, of_middle * middle],
            );
            for (checkpoint, &(part, _)) in block.checkpoints.iter().enumerate() {
                let first = block.first + checkpoint * block.rows;
                let b_row = &block.b_row(part);
                let b = dot(b_row, &x);
                let db = dot(b_row, &dx);
                let inverse_b = b.recip();
                let beta = inverse_b.sqrt();
                let dbeta = zero - half * beta * inverse_b * db;
                let pairs = &self.rows[first..first + block.rows];
                for (pair, duals) in pairs.iter().zip(&mut self.duals[first..first + block.rows]) {
                    let (a, da) = (dot(&pair.acceleration, &x), dot(&pair.acceleration, &dx));
                    let (q, dq) = (dot(&pair.jerk, &x), dot(&pair.jerk, &dx));
                    let [of_a, of_q] = both_recip((one - a) * (one + a), (beta - q) * (beta + q));
                    let inverse = [(one + a) * of_a, (one - a) * of_a];
                    let closing = [inverse[0] * da, zero - inverse[1] * da];
                    let [plus, minus] = &mut duals.acceleration;
                    pair_of_duals([plus, minus], inverse, closing);
                    let inverse = [(beta + q) * of_q, (beta - q) * of_q];
                    let closing = [inverse[0] * (dq - dbeta), zero - inverse[1] * (dq + dbeta)];
                    let [plus, minus] = &mut duals.jerk;
                    pair_of_duals([plus, minus], inverse, closing);
                }
                sinking = sinking.max(Lane::splat(-1.1) * db * inverse_b);
            }
        }
        (most.max(sinking).greatest(), fall.greatest())
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
    workspace.pack(grid, spans.clone(), profile);
    solved.converged = workspace.iterate(options, &mut solved);
    let mut result = std::mem::take(&mut workspace.result);
    workspace.unpack(grid, spans.clone(), profile, &mut result);
    // Not to be expected: rounding at a bound.
    if infeasible(grid, spans, &result).is_none() {
        profile.copy_from_slice(&result);
    } else {
        solved.converged = false;
    }
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
        // Every span has two caps, and per checkpoint and joint two bounds of acceleration and two of jerk.
        let constraints = (2 * self.count + 4 * LANES * self.rows.len()) as f64;
        let free = 2..self.count;
        let mut mu = FIRST_GAP * solved.time_s / constraints;
        self.start_duals(mu);
        let (mut take, mut leave, mut stuck) = (0.0, LEAVE[1], 0);
        loop {
            let sums = self.assemble(take, mu);
            solved.time_s = sums.time;
            if sums.gap < options.gap * sums.time && sums.residual < options.gap * sums.time {
                return true;
            }
            if solved.iterations >= options.iterations || !(sums.gap + sums.residual).is_finite() {
                return false;
            }
            mu = (leave * sums.gap).max(RESIDUAL_PART * sums.residual) / constraints;
            let mut d = std::mem::take(&mut self.time_gradient);
            for (d, barrier) in d.iter_mut().zip(&self.barrier_gradient) {
                *d = -*d - mu * barrier;
            }
            self.band.factor(free.clone());
            self.band.solve(free.clone(), &mut d);
            let (most, fall) = self.step(mu, &d);
            let alpha = (TO_BOUND / most).min(1.0);
            take = (TO_BOUND / fall).min(1.0);
            for (c, d) in self.c[free.clone()].iter_mut().zip(&d[free.clone()]) {
                *c += alpha * d;
            }
            self.time_gradient = d;
            leave = if alpha > 0.9 {
                LEAVE[0]
            } else if alpha > 0.5 {
                LEAVE[1]
            } else {
                (1.0 - alpha).max(LEAVE[2])
            };
            stuck = if alpha < STUCK.0 { stuck + 1 } else { 0 };
            if stuck >= STUCK.1 {
                mu = 10.0 * sums.gap / constraints;
                self.start_duals(mu);
                (take, stuck) = (0.0, 0);
            }
            solved.iterations += 1;
        }
    }

    /// The profile that belongs to `c`; end states as they were.
    fn unpack(&self, grid: &Grid, spans: Range<usize>, profile: &[State], result: &mut Vec<State>) {
        result.clear();
        result.extend_from_slice(profile);
        for (index, state) in result.iter_mut().enumerate().take(self.count).skip(1) {
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
