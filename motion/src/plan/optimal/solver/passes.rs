//! Passes over all constraints: where the time is spent.
//!
//! In:  constraints, coefficients c, a step d of them.
//! Out: the Newton system; how much slack a step uses up; multipliers.
//!
//! Each is compiled a second time for processors with wider vectors, and chosen when the program runs. Both compute the same
//! bits: a vector instruction rounds like a scalar one, and no product is fused with a sum.

use multiversion::multiversion;

use super::band::Band;
use super::constraints::{Block, Bound, Constraints, Pair, PairBounds};
use super::lanes::{LANES, Lane};

/// Second derivative of the time by b, over b^(-5/2) h. That of h / sqrt(b) is 0.75; that of the same function seen
/// over ln(b) is 0.25, whose Newton steps triple a far too low b.
const TIME_CURVATURE: f64 = 0.25;
/// Part of a slack from which on a step is held back by the constraint, and how hard.
const KNEE: f64 = 0.9;
const STIFFENING: f64 = 2.0;

/// Matrix and gradients at some coefficients.
#[derive(Clone, Debug, Default)]
pub(super) struct System {
    pub(super) matrix: Band,
    /// Gradient of the time, and of the barrier at weight 1.
    pub(super) time_gradient: Vec<f64>,
    pub(super) barrier_gradient: Vec<f64>,
}

impl System {
    fn reset(&mut self, size: usize) {
        self.matrix.reset(size);
        for gradient in [&mut self.time_gradient, &mut self.barrier_gradient] {
            gradient.clear();
            gradient.resize(size, 0.0);
        }
    }
}

/// Part of a symmetric matrix (00, 01, 02, 11, 12, 22).
type Square = [Lane; 6];

#[inline(always)]
fn dot(row: &[Lane; 3], x: &[Lane; 3]) -> Lane {
    row[0] * x[0] + row[1] * x[1] + row[2] * x[2]
}

#[inline(always)]
fn add_scaled(to: &mut [Lane; 3], scale: Lane, row: &[Lane; 3]) {
    to[0] += scale * row[0];
    to[1] += scale * row[1];
    to[2] += scale * row[2];
}

/// Adds scale · row rowᵀ.
#[inline(always)]
fn add_square(to: &mut Square, scale: Lane, row: &[Lane; 3]) {
    let scaled = [scale * row[0], scale * row[1], scale * row[2]];
    to[0] += scaled[0] * row[0];
    to[1] += scaled[0] * row[1];
    to[2] += scaled[0] * row[2];
    to[3] += scaled[1] * row[1];
    to[4] += scaled[1] * row[2];
    to[5] += scaled[2] * row[2];
}

/// Adds scale · (a bᵀ + b aᵀ).
#[inline(always)]
fn add_both(to: &mut Square, scale: Lane, a: &[Lane; 3], b: &[Lane; 3]) {
    let a = [scale * a[0], scale * a[1], scale * a[2]];
    let two = Lane::splat(2.0);
    to[0] += two * a[0] * b[0];
    to[1] += a[0] * b[1] + a[1] * b[0];
    to[2] += a[0] * b[2] + a[2] * b[0];
    to[3] += two * a[1] * b[1];
    to[4] += a[1] * b[2] + a[2] * b[1];
    to[5] += two * a[2] * b[2];
}

/// Two reciprocals for the price of one division, on which this code would wait else.
#[inline(always)]
fn both_recip(a: Lane, b: Lane) -> [Lane; 2] {
    let both = (a * b).recip();
    [b * both, a * both]
}

impl Block {
    /// Adds the matrix of its unknowns to that of the coefficients: x0 = c1, x1 = k0 (c1 - c0), x2 = k1 (c2 - c1).
    #[inline(always)]
    fn add_matrix(&self, [h00, h01, h02, h11, h12, h22]: Square, at: usize, to: &mut Band) {
        let (zero, two) = (Lane::splat(0.0), Lane::splat(2.0));
        let (k0, k1) = (self.k0, self.k1);
        let c00 = k0 * k0 * h11;
        let c01 = k0 * (k1 * h12 - h01 - k0 * h11);
        let c02 = zero - k0 * k1 * h12;
        let c11 = h00 + c00 + k1 * k1 * h22 + two * (k0 * h01 - k1 * h02 - k0 * k1 * h12);
        let c12 = k1 * (h02 + k0 * h12 - k1 * h22);
        let c22 = k1 * k1 * h22;
        let rows = &mut to.rows[at..at + LANES + 2];
        for lane in 0..LANES {
            rows[lane].diagonal += c00.0[lane];
            rows[lane].next += c01.0[lane];
            rows[lane].second += c02.0[lane];
            rows[lane + 1].diagonal += c11.0[lane];
            rows[lane + 1].next += c12.0[lane];
            rows[lane + 2].diagonal += c22.0[lane];
        }
    }

    /// The same for a gradient.
    #[inline(always)]
    fn add_gradient(&self, g: [Lane; 3], at: usize, to: &mut [f64]) {
        let (g1, g2) = (self.k0 * g[1], self.k1 * g[2]);
        let by_c = [Lane::splat(0.0) - g1, g[0] + g1 - g2, g2];
        let to = &mut to[at..at + LANES + 2];
        for lane in 0..LANES {
            to[lane] += by_c[0].0[lane];
            to[lane + 1] += by_c[1].0[lane];
            to[lane + 2] += by_c[2].0[lane];
        }
    }
}

/// Values, gradients and matrix at `c`; returns the time. Multipliers are kept within a factor of `centrality` of those that
/// belong to the slacks and the weight `mu` of the barrier: with 1, they restart.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn assemble(
    constraints: &mut Constraints,
    c: &[f64],
    mu: f64,
    centrality: [f64; 2],
    to: &mut System,
) -> f64 {
    to.reset(c.len());
    let (zero, one, two) = (Lane::splat(0.0), Lane::splat(1.0), Lane::splat(2.0));
    let mut time = zero;
    let mut pairs = &constraints.pairs[..];
    let mut bounds = &mut constraints.bounds[..];
    let mut places = &mut constraints.places[..];
    for (index, block) in constraints.blocks.iter_mut().enumerate() {
        let at = index * LANES;
        let used = block.used;
        let (low, high) = (
            Lane::splat(mu * centrality[0]) * used,
            Lane::splat(mu * centrality[1]) * used,
        );
        // Weight of a constraint in the matrix.
        let weigh = |bound: &mut Bound, inverse: Lane| {
            *bound = Bound {
                inverse,
                dual: bound.dual.max(low * inverse).min(high * inverse),
            };
            bound.dual * inverse
        };
        let x = block.x(&c[at..]);
        let mut matrix = [zero; 6];
        let mut by_time = [zero; 3];
        let mut by_barrier = [zero; 3];

        let b_begin = block.b_row(0.0);
        let [of_knot, of_middle] = both_recip(one - block.knot * dot(&b_begin, &x), one - block.middle * x[0]);
        let weight = weigh(&mut block.knot_bound, of_knot);
        add_square(&mut matrix, weight * block.knot * block.knot, &b_begin);
        add_scaled(&mut by_barrier, of_knot * block.knot, &b_begin);
        let weight = weigh(&mut block.middle_bound, of_middle);
        matrix[0] += weight * block.middle * block.middle;
        by_barrier[0] += of_middle * block.middle;

        let (own, rest) = std::mem::take(&mut places).split_at_mut(block.checkpoints.len());
        places = rest;
        for (place, &(part, weight)) in own.iter_mut().zip(block.checkpoints) {
            let b_row = &block.b_row(part);
            let inverse_b = dot(b_row, &x).recip();
            let beta = inverse_b.sqrt();
            // d(1/sqrt(b))/db
            let slope = Lane::splat(-0.5) * beta * inverse_b;
            place.inverse_b = inverse_b;
            place.slope = slope;
            let (mut both, mut turned, mut barrier, mut duals) = (zero, [zero; 3], zero, zero);
            let (these, rest) = pairs.split_at(block.rows);
            pairs = rest;
            let (own, rest) = std::mem::take(&mut bounds).split_at_mut(block.rows);
            bounds = rest;
            for (pair, bounds) in these.iter().zip(own) {
                let a = dot(&pair.acceleration, &x);
                let q = dot(&pair.jerk, &x);
                let [minus, plus] = [one - a, one + a];
                let room = beta - pair.kink;
                let [lower, upper] = [room - q, room + q];
                let [of_a, of_q] = both_recip(minus * plus, lower * upper);
                let [first, second] = &mut bounds.acceleration;
                let weight = weigh(first, plus * of_a) + weigh(second, minus * of_a);
                add_square(&mut matrix, weight, &pair.acceleration);
                add_scaled(&mut by_barrier, two * a * of_a, &pair.acceleration);

                let [first, second] = &mut bounds.jerk;
                let (weight, opposite) = (weigh(first, upper * of_q), weigh(second, lower * of_q));
                add_square(&mut matrix, weight + opposite, &pair.jerk);
                both += weight + opposite;
                add_scaled(&mut turned, weight - opposite, &pair.jerk);
                add_scaled(&mut by_barrier, two * q * of_q, &pair.jerk);
                barrier += two * room * of_q;
                duals += first.dual + second.dual;
            }
            let weight = Lane::splat(weight) * block.h * used;
            time += weight * beta;
            add_scaled(&mut by_time, weight * slope, b_row);
            add_scaled(&mut by_barrier, zero - barrier * slope, b_row);
            // Jerk bounds are convex in b: their second derivative counts against that of the time, and is left out
            // beyond, so that the matrix stays positive definite.
            let curvature = Lane::splat(TIME_CURVATURE) * (weight - duals).max(zero) * beta * inverse_b * inverse_b;
            add_square(&mut matrix, both * slope * slope + curvature, b_row);
            add_both(&mut matrix, zero - slope, b_row, &turned);
        }
        block.add_matrix(matrix, at, &mut to.matrix);
        block.add_gradient(by_time, at, &mut to.time_gradient);
        block.add_gradient(by_barrier, at, &mut to.barrier_gradient);
    }
    time.sum()
}

/// How much of every slack of a joint at a checkpoint the step `dx` takes, as a part of it.
#[inline(always)]
fn closings(pair: &Pair, bounds: &PairBounds, dx: &[Lane; 3], dbeta: Lane) -> [Lane; 4] {
    let zero = Lane::splat(0.0);
    let da = dot(&pair.acceleration, dx);
    let dq = dot(&pair.jerk, dx);
    [
        bounds.acceleration[0].inverse * da,
        zero - bounds.acceleration[1].inverse * da,
        bounds.jerk[0].inverse * (dq - dbeta),
        zero - bounds.jerk[1].inverse * (dq + dbeta),
    ]
}

/// Makes the constraints stiffer that would not allow the step `d`: raises their multipliers, and the matrix with them.
/// Returns whether there are any.
///
/// A constraint that is far from its bound does not show in the matrix, and a step may pass far beyond it. It alone would make
/// the whole step short.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn stiffen(constraints: &mut Constraints, mu: f64, d: &[f64], matrix: &mut Band) -> bool {
    let zero = Lane::splat(0.0);
    let mut found = false;
    let mut pairs = &constraints.pairs[..];
    let mut bounds = &mut constraints.bounds[..];
    let mut places = &constraints.places[..];
    for (index, block) in constraints.blocks.iter_mut().enumerate() {
        let at = index * LANES;
        let mu = Lane::splat(mu);
        let mut more = [zero; 6];
        let mut any = false;
        let dx = block.x(&d[at..]);
        // Adds to the multiplier, and returns what that adds to the weight in the matrix.
        let raise = |bound: &mut Bound, closing: Lane| {
            let over = (closing - Lane::splat(KNEE)).max(zero);
            let added = Lane::splat(STIFFENING) * over * bound.dual.max(bound.inverse * mu);
            bound.dual += added;
            added * bound.inverse
        };
        let b_begin = block.b_row(0.0);
        let closing = block.knot_bound.inverse * block.knot * dot(&b_begin, &dx);
        if closing.exceeds(KNEE) {
            any = true;
            let weight = raise(&mut block.knot_bound, closing);
            add_square(&mut more, weight * block.knot * block.knot, &b_begin);
        }
        let closing = block.middle_bound.inverse * block.middle * dx[0];
        if closing.exceeds(KNEE) {
            any = true;
            more[0] += raise(&mut block.middle_bound, closing) * block.middle * block.middle;
        }
        let (own, rest) = places.split_at(block.checkpoints.len());
        places = rest;
        for (place, &(part, _)) in own.iter().zip(block.checkpoints) {
            let b_row = &block.b_row(part);
            let dbeta = place.slope * dot(b_row, &dx);
            let (these, rest) = pairs.split_at(block.rows);
            pairs = rest;
            let (own, rest) = std::mem::take(&mut bounds).split_at_mut(block.rows);
            bounds = rest;
            for (pair, bounds) in these.iter().zip(own) {
                let [a, b, c, d] = closings(pair, bounds, &dx, dbeta);
                if a.max(b).exceeds(KNEE) {
                    any = true;
                    let [first, second] = &mut bounds.acceleration;
                    let weight = raise(first, a) + raise(second, b);
                    add_square(&mut more, weight, &pair.acceleration);
                }
                if c.max(d).exceeds(KNEE) {
                    any = true;
                    let [first, second] = &mut bounds.jerk;
                    let (weight, opposite) = (raise(first, c), raise(second, d));
                    let both = weight + opposite;
                    add_square(&mut more, both, &pair.jerk);
                    add_square(&mut more, both * place.slope * place.slope, b_row);
                    add_both(&mut more, (opposite - weight) * place.slope, b_row, &pair.jerk);
                }
            }
        }
        if any {
            block.add_matrix(more, at, matrix);
            found = true;
        }
    }
    found
}

/// New multipliers for the step `d`; returns the greatest part of a slack (or of b, to 9/10) that the step would use up.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn advance(constraints: &mut Constraints, mu: f64, d: &[f64]) -> f64 {
    let zero = Lane::splat(0.0);
    let mut most = zero;
    let mut pairs = &constraints.pairs[..];
    let mut bounds = &mut constraints.bounds[..];
    let mut places = &constraints.places[..];
    for (index, block) in constraints.blocks.iter_mut().enumerate() {
        let mu = Lane::splat(mu) * block.used;
        let dx = block.x(&d[index * LANES..]);
        let mut next = |bound: &mut Bound, closing: Lane| {
            most = most.max(closing);
            bound.dual = bound.inverse * mu + bound.dual * closing;
        };
        let b_begin = block.b_row(0.0);
        let closing = block.knot_bound.inverse * block.knot * dot(&b_begin, &dx);
        next(&mut block.knot_bound, closing);
        let closing = block.middle_bound.inverse * block.middle * dx[0];
        next(&mut block.middle_bound, closing);
        let mut sinking = zero;
        let (own, rest) = places.split_at(block.checkpoints.len());
        places = rest;
        for (place, &(part, _)) in own.iter().zip(block.checkpoints) {
            let db = dot(&block.b_row(part), &dx);
            let (these, rest) = pairs.split_at(block.rows);
            pairs = rest;
            let (own, rest) = std::mem::take(&mut bounds).split_at_mut(block.rows);
            bounds = rest;
            for (pair, bounds) in these.iter().zip(own) {
                let [a, b, c, d] = closings(pair, bounds, &dx, place.slope * db);
                next(&mut bounds.acceleration[0], a);
                next(&mut bounds.acceleration[1], b);
                next(&mut bounds.jerk[0], c);
                next(&mut bounds.jerk[1], d);
            }
            sinking = sinking.max(Lane::splat(-1.1) * db * place.inverse_b);
        }
        most = most.max(sinking);
    }
    most.greatest()
}
