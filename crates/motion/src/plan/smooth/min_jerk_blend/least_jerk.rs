//! The cubic spline of least jerk within a tube.
//!
//! In:  coefficients of a spline with even knots, the first three and the last three of which stay; places that it should
//! pass at given parameters, each with a direction along the path and one across it.
//! Out: coefficients for which the sum of the squared third differences is least, no place is off across by more than the
//! tolerance, and being off along the path costs a little.
//!
//! A quadratic programme with bounds on both sides, solved by a primal-dual interior point method. Two components of one
//! coefficient are next to each other, so that the matrix is a band: a span couples four coefficients.

use std::ops::Range;

use multiversion::multiversion;

/// A point or direction of the plane.
pub(super) type Plane = [f64; 2];

/// Unknowns that one span couples, which is the width of the band from the diagonal on.
const WIDTH: usize = 8;
/// Components of the coefficients at either end that stay.
const FIXED: usize = 6;
const ITERATIONS: u32 = 15;
/// Mean of slack times price at which the result is near enough.
const NEAR: f64 = 3e-3;
/// Part of the way to the border of what is allowed that a step may go.
const STEP: f64 = 0.98;

/// Where the spline should be at one parameter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    /// The span, and weights of the four coefficients that decide there.
    pub(super) span: usize,
    pub(super) weights: [f64; 4],
    pub(super) place: Plane,
    /// Unit vector along the path; the one across it is a quarter turn to the left.
    pub(super) along: Plane,
    /// What being off along the path by 1 costs, as the square root of the price.
    pub(super) stiffness: f64,
}

impl Gate {
    fn across(&self) -> Plane {
        [-self.along[1], self.along[0]]
    }

    /// Where the spline is, measured from the place along `direction`.
    pub(super) fn off(&self, spline: &[Plane], direction: Plane) -> f64 {
        let mut off = 0.0;
        for (weight, c) in self.weights.iter().zip(&spline[self.span..]) {
            off += weight * ((c[0] - self.place[0]) * direction[0] + (c[1] - self.place[1]) * direction[1]);
        }
        off
    }
}

/// Slack to a bound and its price, and how both change in a step.
#[derive(Clone, Copy, Debug)]
struct Bound {
    slack: f64,
    price: f64,
    slack_step: f64,
    price_step: f64,
}

/// A gate while the spline moves: how far it is off, over the tolerance across and by its price along, and the bounds of that.
#[derive(Clone, Copy, Debug)]
struct Off {
    /// Directions in which that is measured.
    across: Plane,
    stiff: Plane,
    y: f64,
    along: f64,
    /// Changes in a step.
    y_step: f64,
    along_step: f64,
    bounds: [Bound; 2],
}

/// Working memory.
#[derive(Clone, Debug, Default)]
pub(super) struct LeastJerk {
    /// What third differences alone make of the matrix: it stays.
    thirds: Vec<[f64; WIDTH]>,
    rows: Vec<[f64; WIDTH]>,
    x: Vec<f64>,
    offs: Vec<Off>,
    /// Rows and right sides, of both ends.
    pairs: Vec<[Pair; WIDTH]>,
    rights: Vec<Pair>,
}

const THIRD: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

impl LeastJerk {
    /// Improves `spline`. `scale` makes third differences numbers about 1 where they are at the limit.
    pub(super) fn solve(&mut self, spline: &mut [Plane], gates: &[Gate], tolerance: f64, scale: f64) {
        self.offs.clear();
        self.offs.extend(gates.iter().map(|gate| {
            let across = gate.across().map(|x| x / tolerance);
            let stiff = gate.along.map(|x| x * gate.stiffness);
            let y = gate.off(spline, across);
            Off {
                across,
                stiff,
                y,
                along: gate.off(spline, stiff),
                y_step: 0.0,
                along_step: 0.0,
                bounds: [-y, y].map(|y| Bound {
                    slack: (1.0 + y).max(0.1),
                    price: 1.0,
                    slack_step: 0.0,
                    price_step: 0.0,
                }),
            }
        }));
        let square = scale * scale;
        self.thirds.clear();
        self.thirds.resize(2 * spline.len(), [0.0; WIDTH]);
        for span in 0..spline.len() - 3 {
            add(&mut self.thirds, span, &THIRD, [square, 0.0, square]);
        }
        let count = 2.0 * gates.len() as f64;
        let mut centring = 0.3;
        for _ in 0..ITERATIONS {
            let (mut gap, mut outside) = (0.0, 0.0f64);
            for off in &self.offs {
                let [upper, lower] = off.bounds;
                gap += upper.slack * upper.price;
                gap += lower.slack * lower.price;
                outside = outside.max((off.y + upper.slack - 1.0).abs());
            }
            gap /= count;
            if gap < NEAR && outside < 1e-6 {
                break;
            }
            let step = self.step(spline, gates, square, centring * gap);
            centring = if step > 0.9 { 0.08 } else { 0.4 };
        }
    }

    /// One Newton step towards prices and slacks whose product is `target`; returns how much of it was taken. `square`: the
    /// price of third differences.
    fn step(&mut self, spline: &mut [Plane], gates: &[Gate], square: f64, target: f64) -> f64 {
        let size = 2 * spline.len();
        self.rows.clear();
        self.rows.extend_from_slice(&self.thirds);
        self.x.clear();
        self.x.resize(size, 0.0);
        for (span, around) in spline.windows(4).enumerate() {
            let third = |axis: usize| -> f64 { (0..4).map(|k| THIRD[k] * around[k][axis]).sum() };
            pull_at(&mut self.x, span, &THIRD, [-square * third(0), -square * third(1)]);
        }
        for (gate, off) in gates.iter().zip(&self.offs) {
            let Off { across, stiff, y, .. } = *off;
            let [upper, lower] = off.bounds;
            let inverse = 1.0 / (upper.slack * lower.slack);
            let pull = |bound: &Bound, beyond: f64, inverse: f64| (target + bound.price * beyond) * inverse;
            let (by_upper, by_lower) = (lower.slack * inverse, upper.slack * inverse);
            let push = pull(&upper, y + upper.slack - 1.0, by_upper) - pull(&lower, lower.slack - 1.0 - y, by_lower);
            let weight = upper.price * by_upper + lower.price * by_lower;
            let square = |i: usize, j: usize| stiff[i] * stiff[j] + weight * across[i] * across[j];
            let pull = [0, 1].map(|i| -off.along * stiff[i] - push * across[i]);
            add(
                &mut self.rows,
                gate.span,
                &gate.weights,
                [square(0, 0), square(0, 1), square(1, 1)],
            );
            pull_at(&mut self.x, gate.span, &gate.weights, pull);
        }
        self.factor_and_solve(FIXED..size - FIXED);
        // How far the step may go.
        let mut most = 1.0f64;
        for (gate, off) in gates.iter().zip(&mut self.offs) {
            let mut moved = [0.0; 2];
            for (weight, step) in gate.weights.iter().zip(self.x[2 * gate.span..].chunks_exact(2)) {
                moved[0] += weight * step[0];
                moved[1] += weight * step[1];
            }
            let along = |direction: Plane| moved[0] * direction[0] + moved[1] * direction[1];
            (off.y_step, off.along_step) = (along(off.across), along(off.stiff));
            let y = off.y + off.y_step;
            for (bound, side) in off.bounds.iter_mut().zip([1.0, -1.0]) {
                bound.slack_step = 1.0 - bound.slack - side * y;
                bound.price_step = (target - bound.price * bound.slack_step) / bound.slack - bound.price;
                for (value, step) in [(bound.slack, bound.slack_step), (bound.price, bound.price_step)] {
                    if -STEP * value > most * step {
                        most = -STEP * value / step;
                    }
                }
            }
        }
        for off in &mut self.offs {
            off.y += most * off.y_step;
            off.along += most * off.along_step;
            for bound in &mut off.bounds {
                bound.slack += most * bound.slack_step;
                bound.price += most * bound.price_step;
            }
        }
        for (c, step) in spline.iter_mut().zip(self.x.chunks_exact(2)) {
            c[0] += most * step[0];
            c[1] += most * step[1];
        }
        most
    }

    /// Factors the part of the matrix of the unknowns that are free, and solves; 0 for the others.
    ///
    /// Eliminates from both ends at once, until a few unknowns in the middle are left: the same arithmetic on two numbers is
    /// one instruction.
    fn factor_and_solve(&mut self, free: Range<usize>) {
        self.x[..free.start].fill(0.0);
        self.x[free.end..].fill(0.0);
        let x = &mut self.x[free.clone()];
        let rows = &mut self.rows[free];
        let count = x.len();
        // Nothing couples with what is not free.
        for (k, row) in rows.iter_mut().enumerate().skip(count.saturating_sub(WIDTH)) {
            row[count - k..].fill(0.0);
        }
        let each = count.saturating_sub(WIDTH) / 2;
        let middle = count - 2 * each;
        self.pairs.resize(each + MIDDLE, [[0.0; 2]; WIDTH]);
        self.rights.resize(each + MIDDLE, [0.0; 2]);
        // The middle begins with 0 on both sides: what eliminations take from it.
        self.pairs[each..].fill([[0.0; 2]; WIDTH]);
        self.rights[each..].fill([0.0; 2]);
        for k in 0..each {
            let far = count - 1 - k;
            for (b, pair) in self.pairs[k].iter_mut().enumerate() {
                *pair = [rows[k][b], rows[far - b][b]];
            }
            self.rights[k] = [x[k], x[far]];
        }
        eliminate(&mut self.pairs, &mut self.rights, each);
        let mut matrix = [[0.0; MIDDLE]; MIDDLE];
        let mut right = [0.0; MIDDLE];
        let (pairs, rights) = (&self.pairs[each..], &self.rights[each..]);
        for k in 0..middle {
            right[k] = x[each + k] + rights[k][0] + rights[middle - 1 - k][1];
            for b in 0..WIDTH.min(middle - k) {
                let far = middle - 1 - k;
                matrix[k][k + b] += rows[each + k][b] + pairs[k][b][0];
                matrix[far - b][far] += pairs[k][b][1];
            }
        }
        solve_dense(&mut matrix, &mut right, middle);
        for k in 0..middle {
            x[each + k] = right[k];
            self.rights[each + k] = [right[k], right[middle - 1 - k]];
        }
        for k in (0..each).rev() {
            let [own, others @ ..] = &mut self.rights[k..] else {
                return;
            };
            for (factor, other) in self.pairs[k][1..].iter().zip(others) {
                own[0] -= factor[0] * other[0];
                own[1] -= factor[1] * other[1];
            }
            (x[k], x[count - 1 - k]) = (own[0], own[1]);
        }
    }
}

/// The same of both ends.
type Pair = [f64; 2];

/// Unknowns that are left in the middle, at the most.
const MIDDLE: usize = WIDTH + 1;

/// Eliminates the first `count` unknowns from the rows behind them. What is left of their rows is the factors.
#[multiversion(targets("x86_64+avx2"))]
fn eliminate(rows: &mut [[Pair; WIDTH]], rights: &mut [Pair], count: usize) {
    for k in 0..count {
        let [row, below @ ..] = &mut rows[k..k + WIDTH] else {
            return;
        };
        let [right, rights @ ..] = &mut rights[k..k + WIDTH] else {
            return;
        };
        let inverse = row[0].map(|pivot| 1.0 / pivot.max(1e-300));
        let times = |a: Pair, b: Pair| [a[0] * b[0], a[1] * b[1]];
        let take = |from: &mut Pair, x: Pair| {
            from[0] -= x[0];
            from[1] -= x[1];
        };
        for a in 1..WIDTH {
            let factor = times(row[a], inverse);
            for b in a..WIDTH {
                take(&mut below[a - 1][b - a], times(factor, row[b]));
            }
            take(&mut rights[a - 1], times(factor, *right));
        }
        for pair in [right].into_iter().chain(&mut row[1..]) {
            *pair = times(*pair, inverse);
        }
    }
}

/// Solves for a few unknowns that all couple, from the upper half of the matrix.
fn solve_dense(matrix: &mut [[f64; MIDDLE]; MIDDLE], x: &mut [f64; MIDDLE], count: usize) {
    for k in 0..count {
        let row = matrix[k];
        let inverse = 1.0 / row[k].max(1e-300);
        for a in k + 1..count {
            let factor = row[a] * inverse;
            for b in a..count {
                matrix[a][b] -= factor * row[b];
            }
            x[a] -= factor * x[k];
            matrix[k][a] = factor;
        }
        x[k] *= inverse;
    }
    for k in (0..count).rev() {
        for a in k + 1..count {
            x[k] -= matrix[k][a] * x[a];
        }
    }
}

/// Adds a quadratic form (xx, xy, yy) of the point that these weights of four coefficients make.
fn add(rows: &mut [[f64; WIDTH]], span: usize, weights: &[f64; 4], [xx, xy, yy]: [f64; 3]) {
    let rows = &mut rows[2 * span..2 * span + WIDTH];
    for i in 0..4 {
        for j in i..4 {
            let both = weights[i] * weights[j];
            rows[2 * i][2 * (j - i)] += both * xx;
            rows[2 * i][2 * (j - i) + 1] += both * xy;
            rows[2 * i + 1][2 * (j - i)] += both * yy;
            if j > i {
                rows[2 * i + 1][2 * (j - i) - 1] += both * xy;
            }
        }
    }
}

/// Adds what pulls at that point.
fn pull_at(x: &mut [f64], span: usize, weights: &[f64; 4], pull: Plane) {
    for (x, weight) in x[2 * span..2 * span + WIDTH].chunks_exact_mut(2).zip(weights) {
        x[0] += weight * pull[0];
        x[1] += weight * pull[1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_of_any_size_is_solved() {
        for count in 0..40_usize {
            let at = |k: usize| ((k * k) as f64).sin();
            let size = count + 2 * FIXED;
            let mut solver = LeastJerk {
                rows: (0..size)
                    .map(|k| std::array::from_fn(|b| if b == 0 { 9.0 + at(k) } else { at(k + 31 * b) }))
                    .collect(),
                x: (0..size).map(|k| at(k + 7)).collect(),
                ..LeastJerk::default()
            };
            let (rows, right) = (solver.rows.clone(), solver.x.clone());
            let free = FIXED..size - FIXED;
            solver.factor_and_solve(free.clone());
            for k in 0..size {
                if !free.contains(&k) {
                    assert_eq!(solver.x[k], 0.0);
                    continue;
                }
                let entry = |j: usize| match j.abs_diff(k) {
                    far if far >= WIDTH => 0.0,
                    far => rows[j.min(k)][far],
                };
                let sum: f64 = free.clone().map(|j| entry(j) * solver.x[j]).sum();
                assert!((sum - right[k]).abs() < 1e-12, "{k} of {count}: {sum} {}", right[k]);
            }
        }
    }
}
