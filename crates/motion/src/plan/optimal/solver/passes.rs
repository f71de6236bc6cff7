//! Passes over all constraints: where the time is spent.
//!
//! In:  constraints, coefficients c, a step d of them.
//! Out: the Newton system; how much slack a step uses up; multipliers.
//!
//! Each is compiled again for processors with wider vectors, and chosen when the program runs. All compute the same
//! bits: a vector instruction rounds like a scalar one, and no product is fused with a sum.

use multiversion::{inherit_target, multiversion};

use super::band::Band;
use super::constraints::{Block, Bound, Constraints, Pair, PairBounds, Place};
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

/// Those of one lane.
#[inline(always)]
fn lane(of: &[Lane; 3], l: usize) -> [f64; 3] {
    [of[0].0[l], of[1].0[l], of[2].0[l]]
}

#[inline(always)]
fn dot_lane(row: [f64; 3], x: [f64; 3]) -> f64 {
    row[0] * x[0] + row[1] * x[1] + row[2] * x[2]
}

/// The greater one; never keeps a NaN of `b`.
#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The smaller one; never keeps a NaN of `b`.
#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

/// Adds scale · row to one lane.
#[inline(always)]
fn add_lane_scaled(to: &mut [Lane; 3], l: usize, scale: f64, row: [f64; 3]) {
    to[0].0[l] += scale * row[0];
    to[1].0[l] += scale * row[1];
    to[2].0[l] += scale * row[2];
}

/// Adds scale · row rowᵀ to one lane.
#[inline(always)]
fn add_lane_square(to: &mut Square, l: usize, scale: f64, row: [f64; 3]) {
    let scaled = row.map(|x| scale * x);
    to[0].0[l] += scaled[0] * row[0];
    to[1].0[l] += scaled[0] * row[1];
    to[2].0[l] += scaled[0] * row[2];
    to[3].0[l] += scaled[1] * row[1];
    to[4].0[l] += scaled[1] * row[2];
    to[5].0[l] += scaled[2] * row[2];
}

/// Adds scale · (a bᵀ + b aᵀ) to one lane.
#[inline(always)]
fn add_lane_both(to: &mut Square, l: usize, scale: f64, a: [f64; 3], b: [f64; 3]) {
    let a = a.map(|x| scale * x);
    to[0].0[l] += 2.0 * a[0] * b[0];
    to[1].0[l] += a[0] * b[1] + a[1] * b[0];
    to[2].0[l] += a[0] * b[2] + a[2] * b[0];
    to[3].0[l] += 2.0 * a[1] * b[1];
    to[4].0[l] += a[1] * b[2] + a[2] * b[1];
    to[5].0[l] += 2.0 * a[2] * b[2];
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

impl Bound {
    /// A new slack, and the multiplier within what belongs to it; returns the weight of the constraint in the matrix.
    #[inline(always)]
    fn renew(&mut self, inverse: Lane, low: Lane, high: Lane) -> Lane {
        *self = Bound {
            inverse,
            dual: self.dual.max(low * inverse).min(high * inverse),
        };
        self.dual * inverse
    }

    /// The same of one lane; returns the multiplier.
    #[inline(always)]
    fn renew_lane(&mut self, lane: usize, inverse: f64, [low, high]: [f64; 2]) -> f64 {
        let dual = smaller(greater(self.dual.0[lane], low * inverse), high * inverse);
        self.inverse.0[lane] = inverse;
        self.dual.0[lane] = dual;
        dual
    }
}

/// What the spans of a block come to. In memory, as are all the arrays of the loops over lanes: such a loop in a function of its
/// own becomes vector instructions, one for one; inlined into a longer function, lanes get mixed up, and half of the
/// instructions sort them out again.
#[derive(Default)]
struct Sums {
    /// Unknowns, and the bounds of multipliers over 1 / slack.
    x: [Lane; 3],
    centrality: [Lane; 2],
    matrix: Square,
    by_time: [Lane; 3],
    by_barrier: [Lane; 3],
    time: Lane,
    /// Of a checkpoint: 1 / sqrt(b), and what its jerk bounds come to.
    beta: Lane,
    both: Lane,
    turned: [Lane; 3],
    barrier: Lane,
    duals: Lane,
}

impl Sums {
    /// Another block; the time goes on.
    #[inline(always)]
    fn begin(&mut self, x: [Lane; 3], centrality: [f64; 2], block: &Block) {
        *self = Sums {
            x,
            centrality: centrality.map(|part| Lane::splat(part) * block.used),
            time: self.time,
            ..Sums::default()
        };
    }

    /// Adds a checkpoint, at a part of the span and with this weight in the integral over it.
    #[inline(always)]
    fn add(
        &mut self,
        block: &Block,
        (part, weight): (f64, f64),
        pairs: &[Pair],
        bounds: &mut [PairBounds],
        place: &mut Place,
    ) {
        let rest = 1.0 - part;
        let row = |h: f64| [-rest * rest * h, part * part * h];
        for l in 0..LANES {
            let [b1, b2] = row(block.h.0[l]);
            let inverse_b = 1.0 / (self.x[0].0[l] + b1 * self.x[1].0[l] + b2 * self.x[2].0[l]);
            let beta = inverse_b.sqrt();
            place.inverse_b.0[l] = inverse_b;
            // d(1/sqrt(b))/db
            place.slope.0[l] = -0.5 * beta * inverse_b;
            self.beta.0[l] = beta;
            self.both.0[l] = 0.0;
            self.barrier.0[l] = 0.0;
            self.duals.0[l] = 0.0;
            for turned in &mut self.turned {
                turned.0[l] = 0.0;
            }
        }
        for (pair, bounds) in pairs.iter().zip(bounds) {
            for l in 0..LANES {
                self.add_pair(pair, bounds, l);
            }
        }
        for l in 0..LANES {
            let h = block.h.0[l];
            let (inverse_b, slope, beta) = (place.inverse_b.0[l], place.slope.0[l], self.beta.0[l]);
            let [b1, b2] = row(h);
            let b_row = [1.0, b1, b2];
            let weight = weight * h * block.used.0[l];
            self.time.0[l] += weight * beta;
            let (by_time, by_barrier) = (weight * slope, 0.0 - self.barrier.0[l] * slope);
            add_lane_scaled(&mut self.by_time, l, by_time, b_row);
            add_lane_scaled(&mut self.by_barrier, l, by_barrier, b_row);
            // Jerk bounds are convex in b: their second derivative counts against that of the time, and is left out
            // beyond, so that the matrix stays positive definite.
            let left = greater(weight - self.duals.0[l], 0.0);
            let curvature = TIME_CURVATURE * left * beta * inverse_b * inverse_b;
            add_lane_square(&mut self.matrix, l, self.both.0[l] * slope * slope + curvature, b_row);
            let turned = lane(&self.turned, l);
            add_lane_both(&mut self.matrix, l, 0.0 - slope, b_row, turned);
        }
    }

    /// Adds one joint.
    #[inline(always)]
    fn add_pair(&mut self, pair: &Pair, bounds: &mut PairBounds, l: usize) {
        let x = lane(&self.x, l);
        let centrality = [self.centrality[0].0[l], self.centrality[1].0[l]];
        let (acceleration, jerk) = (lane(&pair.acceleration, l), lane(&pair.jerk, l));
        let (a, q) = (dot_lane(acceleration, x), dot_lane(jerk, x));
        let [minus, plus] = [1.0 - a, 1.0 + a];
        let room = self.beta.0[l] - pair.kink.0[l];
        let [lower, upper] = [room - q, room + q];
        // Two reciprocals for the price of one division, on which this code would wait else.
        let (of_both, a_room, q_room) = (1.0 / (minus * plus * (lower * upper)), minus * plus, lower * upper);
        let [of_a, of_q] = [q_room * of_both, a_room * of_both];
        let renew = |bound: &mut Bound, inverse: f64| {
            let dual = bound.renew_lane(l, inverse, centrality);
            (dual * inverse, dual)
        };
        let [first, second] = &mut bounds.acceleration;
        let weight = renew(first, plus * of_a).0 + renew(second, minus * of_a).0;
        add_lane_square(&mut self.matrix, l, weight, acceleration);
        let [first, second] = &mut bounds.jerk;
        let (weight, dual) = renew(first, upper * of_q);
        let (opposite, opposite_dual) = renew(second, lower * of_q);
        add_lane_square(&mut self.matrix, l, weight + opposite, jerk);
        self.both.0[l] += weight + opposite;
        self.barrier.0[l] += 2.0 * room * of_q;
        self.duals.0[l] += dual + opposite_dual;
        add_lane_scaled(&mut self.turned, l, weight - opposite, jerk);
        add_lane_scaled(&mut self.by_barrier, l, 2.0 * a * of_a, acceleration);
        add_lane_scaled(&mut self.by_barrier, l, 2.0 * q * of_q, jerk);
    }
}

/// Values, gradients and matrix at `c`; returns the time. Multipliers are kept within a factor of `centrality` of those that
/// belong to the slacks and the weight `mu` of the barrier: with 1, they restart.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn assemble(
    constraints: &mut Constraints,
    c: &[f64],
    mu: f64,
    centrality: [f64; 2],
    to: &mut System,
) -> f64 {
    #[inherit_target]
    #[inline(never)]
    fn weigh_all(
        block: &Block,
        checkpoint: (f64, f64),
        pairs: &[Pair],
        bounds: &mut [PairBounds],
        place: &mut Place,
        sums: &mut Sums,
    ) {
        sums.add(block, checkpoint, pairs, bounds, place);
    }
    to.reset(c.len());
    let one = Lane::splat(1.0);
    let mut sums = Sums::default();
    let mut pairs = &constraints.pairs[..];
    let mut bounds = &mut constraints.bounds[..];
    let mut places = &mut constraints.places[..];
    for (index, block) in constraints.blocks.iter_mut().enumerate() {
        let at = index * LANES;
        sums.begin(block.x(&c[at..]), [mu * centrality[0], mu * centrality[1]], block);
        let b_begin = block.b_row(0.0);
        let closeness = [
            one - block.knot * dot(&b_begin, &sums.x),
            one - block.middle * sums.x[0],
        ];
        let [of_knot, of_middle] = both_recip(closeness[0], closeness[1]);
        let [low, high] = sums.centrality;
        let weight = block.knot_bound.renew(of_knot, low, high);
        add_square(&mut sums.matrix, weight * block.knot * block.knot, &b_begin);
        add_scaled(&mut sums.by_barrier, of_knot * block.knot, &b_begin);
        let weight = block.middle_bound.renew(of_middle, low, high);
        sums.matrix[0] += weight * block.middle * block.middle;
        sums.by_barrier[0] += of_middle * block.middle;

        let (own, rest) = std::mem::take(&mut places).split_at_mut(block.checkpoints.len());
        places = rest;
        for (place, &checkpoint) in own.iter_mut().zip(block.checkpoints) {
            let (these, rest) = pairs.split_at(block.rows);
            pairs = rest;
            let (own, rest) = std::mem::take(&mut bounds).split_at_mut(block.rows);
            bounds = rest;
            weigh_all(block, checkpoint, these, own, place, &mut sums);
        }
        block.add_matrix(sums.matrix, at, &mut to.matrix);
        block.add_gradient(sums.by_time, at, &mut to.time_gradient);
        block.add_gradient(sums.by_barrier, at, &mut to.barrier_gradient);
    }
    sums.time.sum()
}

/// How much of every slack of a joint at a checkpoint the step `dx` takes, as a part of it, in one lane.
#[inline(always)]
fn closings(pair: &Pair, bounds: &PairBounds, dx: [f64; 3], dbeta: f64, l: usize) -> [f64; 4] {
    let da = dot_lane(lane(&pair.acceleration, l), dx);
    let dq = dot_lane(lane(&pair.jerk, l), dx);
    [
        bounds.acceleration[0].inverse.0[l] * da,
        0.0 - bounds.acceleration[1].inverse.0[l] * da,
        bounds.jerk[0].inverse.0[l] * (dq - dbeta),
        0.0 - bounds.jerk[1].inverse.0[l] * (dq + dbeta),
    ]
}

/// A step at the checkpoints of a block, and what is made stiffer for it.
#[derive(Default)]
struct Stiffening {
    x: [Lane; 3],
    mu: Lane,
    more: Square,
    /// Change of 1 / sqrt(b), and the greatest part of a slack of one joint that is taken.
    dbeta: Lane,
    most: Lane,
}

impl Stiffening {
    /// A checkpoint at a part of the span; returns whether anything is made stiffer.
    #[inline(always)]
    fn add(&mut self, block: &Block, part: f64, pairs: &[Pair], bounds: &mut [PairBounds], place: &Place) -> bool {
        let rest = 1.0 - part;
        let row = |l: usize| [1.0, -rest * rest * block.h.0[l], part * part * block.h.0[l]];
        for l in 0..LANES {
            self.dbeta.0[l] = place.slope.0[l] * dot_lane(row(l), lane(&self.x, l));
        }
        let mut any = false;
        for (pair, bounds) in pairs.iter().zip(bounds) {
            for l in 0..LANES {
                let [a, b, c, d] = closings(pair, bounds, lane(&self.x, l), self.dbeta.0[l], l);
                self.most.0[l] = greater(greater(a, b), greater(c, d));
            }
            if !self.most.exceeds(KNEE) {
                continue;
            }
            any = true;
            for l in 0..LANES {
                let closings = closings(pair, bounds, lane(&self.x, l), self.dbeta.0[l], l);
                let mu = self.mu.0[l];
                let raise = |bound: &mut Bound, closing: f64| {
                    let (inverse, dual) = (bound.inverse.0[l], bound.dual.0[l]);
                    let over = greater(closing - KNEE, 0.0);
                    let added = STIFFENING * over * greater(dual, inverse * mu);
                    bound.dual.0[l] = dual + added;
                    added * inverse
                };
                let [first, second] = &mut bounds.acceleration;
                let weight = raise(first, closings[0]) + raise(second, closings[1]);
                add_lane_square(&mut self.more, l, weight, lane(&pair.acceleration, l));
                let [first, second] = &mut bounds.jerk;
                let (weight, opposite) = (raise(first, closings[2]), raise(second, closings[3]));
                let (both, slope, jerk) = (weight + opposite, place.slope.0[l], lane(&pair.jerk, l));
                add_lane_square(&mut self.more, l, both, jerk);
                add_lane_square(&mut self.more, l, both * slope * slope, row(l));
                add_lane_both(&mut self.more, l, (opposite - weight) * slope, row(l), jerk);
            }
        }
        any
    }
}

/// Makes the constraints stiffer that would not allow the step `d`: raises their multipliers, and the matrix with them.
/// Returns whether there are any.
///
/// A constraint that is far from its bound does not show in the matrix, and a step may pass far beyond it. It alone would make
/// the whole step short.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn stiffen(constraints: &mut Constraints, mu: f64, d: &[f64], matrix: &mut Band) -> bool {
    #[inherit_target]
    #[inline(never)]
    fn stiffen_all(
        block: &Block,
        part: f64,
        pairs: &[Pair],
        bounds: &mut [PairBounds],
        place: &Place,
        stiff: &mut Stiffening,
    ) -> bool {
        stiff.add(block, part, pairs, bounds, place)
    }
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
        let mut stiff = Stiffening {
            x: dx,
            mu,
            more,
            ..Stiffening::default()
        };
        for (place, &(part, _)) in own.iter().zip(block.checkpoints) {
            let (these, rest) = pairs.split_at(block.rows);
            pairs = rest;
            let (own, rest) = std::mem::take(&mut bounds).split_at_mut(block.rows);
            bounds = rest;
            any |= stiffen_all(block, part, these, own, place, &mut stiff);
        }
        more = stiff.more;
        if any {
            block.add_matrix(more, at, matrix);
            found = true;
        }
    }
    found
}

/// A step at the checkpoints of a block, and the greatest part of a slack that it uses up.
struct Passed {
    x: [Lane; 3],
    mu: Lane,
    most: Lane,
}

impl Passed {
    /// A checkpoint at a part of the span.
    #[inline(always)]
    fn add(&mut self, block: &Block, part: f64, pairs: &[Pair], bounds: &mut [PairBounds], place: &Place) {
        let rest = 1.0 - part;
        let db = |x: [f64; 3], l: usize| dot_lane([1.0, -rest * rest * block.h.0[l], part * part * block.h.0[l]], x);
        for (pair, bounds) in pairs.iter().zip(bounds) {
            for l in 0..LANES {
                let x = lane(&self.x, l);
                let closings = closings(pair, bounds, x, place.slope.0[l] * db(x, l), l);
                let both = bounds.acceleration.iter_mut().chain(&mut bounds.jerk);
                for (bound, closing) in both.zip(closings) {
                    self.most.0[l] = greater(self.most.0[l], closing);
                    bound.dual.0[l] = bound.inverse.0[l] * self.mu.0[l] + bound.dual.0[l] * closing;
                }
            }
        }
        for l in 0..LANES {
            let sinking = -1.1 * db(lane(&self.x, l), l) * place.inverse_b.0[l];
            self.most.0[l] = greater(self.most.0[l], sinking);
        }
    }
}

/// New multipliers for the step `d`; returns the greatest part of a slack (or of b, to 9/10) that the step would use up.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn advance(constraints: &mut Constraints, mu: f64, d: &[f64]) -> f64 {
    #[inherit_target]
    #[inline(never)]
    fn pass_all(
        block: &Block,
        part: f64,
        pairs: &[Pair],
        bounds: &mut [PairBounds],
        place: &Place,
        passed: &mut Passed,
    ) {
        passed.add(block, part, pairs, bounds, place);
    }
    let mut most = Lane::splat(0.0);
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
        let (own, rest) = places.split_at(block.checkpoints.len());
        places = rest;
        let mut passed = Passed { x: dx, mu, most };
        for (place, &(part, _)) in own.iter().zip(block.checkpoints) {
            let (these, rest) = pairs.split_at(block.rows);
            pairs = rest;
            let (own, rest) = std::mem::take(&mut bounds).split_at_mut(block.rows);
            bounds = rest;
            pass_all(block, part, these, own, place, &mut passed);
        }
        most = passed.most;
    }
    most.greatest()
}
