//! The cubic spline of least jerk within a tube.
//!
//! In:  coefficients of a spline with even knots, the first three and the last three of which stay; places that it should
//! pass at given parameters, each with a direction along the path and one across it.
//! Out: coefficients for which the sum of the squared third differences is least, no place is off across by more than the
//! tolerance, and being off along the path costs a little.
//!
//! A quadratic programme with bounds on both sides, solved by a primal-dual interior point method. Two components of one
//! coefficient are next to each other, so that the matrix is a band: a span couples four coefficients.

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

/// Working memory.
#[derive(Clone, Debug, Default)]
pub(super) struct LeastJerk {
    rows: Vec<[f64; WIDTH]>,
    x: Vec<f64>,
    bounds: Vec<[Bound; 2]>,
}

impl LeastJerk {
    /// Improves `spline`. `scale` makes third differences numbers about 1 where they are at the limit.
    pub(super) fn solve(&mut self, spline: &mut [Plane], gates: &[Gate], tolerance: f64, scale: f64) {
        let fresh = Bound {
            slack: 1.0,
            price: 1.0,
            slack_step: 0.0,
            price_step: 0.0,
        };
        self.bounds.clear();
        self.bounds.extend(gates.iter().map(|gate| {
            let y = gate.off(spline, gate.across()) / tolerance;
            [-y, y].map(|y| Bound {
                slack: (1.0 + y).max(0.1),
                ..fresh
            })
        }));
        let count = 2.0 * gates.len() as f64;
        let mut centring = 0.3;
        for _ in 0..ITERATIONS {
            let gap = self.bounds.iter().flatten().map(|b| b.slack * b.price).sum::<f64>() / count;
            let outside = gates
                .iter()
                .zip(&self.bounds)
                .fold(0.0f64, |worst, (gate, [upper, _])| {
                    let y = gate.off(spline, gate.across()) / tolerance;
                    worst.max((y + upper.slack - 1.0).abs())
                });
            if gap < NEAR && outside < 1e-6 {
                break;
            }
            let step = self.step(spline, gates, tolerance, scale, centring * gap);
            centring = if step > 0.9 { 0.08 } else { 0.4 };
        }
    }

    /// One Newton step towards prices and slacks whose product is `target`; returns how much of it was taken.
    fn step(&mut self, spline: &mut [Plane], gates: &[Gate], tolerance: f64, scale: f64, target: f64) -> f64 {
        let size = 2 * spline.len();
        self.rows.clear();
        self.rows.resize(size, [0.0; WIDTH]);
        self.x.clear();
        self.x.resize(size, 0.0);
        const THIRD: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];
        let square = scale * scale;
        for span in 0..spline.len() - 3 {
            let third = |axis: usize| -> f64 { (0..4).map(|k| THIRD[k] * spline[span + k][axis]).sum() };
            let pull = [-square * third(0), -square * third(1)];
            self.add(span, &THIRD, [square, 0.0, square], pull);
        }
        for (k, gate) in gates.iter().enumerate() {
            let [upper, lower] = self.bounds[k];
            let across = gate.across().map(|x| x / tolerance);
            let y = gate.off(spline, across);
            let pull = |bound: &Bound, beyond: f64| (target + bound.price * beyond) / bound.slack;
            let push = pull(&upper, y + upper.slack - 1.0) - pull(&lower, lower.slack - 1.0 - y);
            let weight = upper.price / upper.slack + lower.price / lower.slack;
            let stiff = gate.along.map(|x| x * gate.stiffness);
            let along = gate.off(spline, stiff);
            let square = |i: usize, j: usize| stiff[i] * stiff[j] + weight * across[i] * across[j];
            let pull = [0, 1].map(|i| -along * stiff[i] - push * across[i]);
            self.add(
                gate.span,
                &gate.weights,
                [square(0, 0), square(0, 1), square(1, 1)],
                pull,
            );
        }
        self.factor_and_solve(FIXED..size - FIXED);
        // How far the step may go.
        let mut most = 1.0f64;
        for (gate, pair) in gates.iter().zip(&mut self.bounds) {
            let y = gate.off(spline, gate.across()) / tolerance;
            let mut y_step = 0.0;
            let across = gate.across();
            for k in 0..4 {
                let i = 2 * (gate.span + k);
                y_step += gate.weights[k] * (self.x[i] * across[0] + self.x[i + 1] * across[1]) / tolerance;
            }
            for (bound, side) in pair.iter_mut().zip([1.0, -1.0]) {
                bound.slack_step = 1.0 - bound.slack - side * (y + y_step);
                bound.price_step = (target - bound.price * bound.slack_step) / bound.slack - bound.price;
                for (value, step) in [(bound.slack, bound.slack_step), (bound.price, bound.price_step)] {
                    if step < 0.0 {
                        most = most.min(-STEP * value / step);
                    }
                }
            }
        }
        for bound in self.bounds.iter_mut().flatten() {
            bound.slack += most * bound.slack_step;
            bound.price += most * bound.price_step;
        }
        for (c, step) in spline.iter_mut().zip(self.x.chunks_exact(2)) {
            c[0] += most * step[0];
            c[1] += most * step[1];
        }
        most
    }

    /// Adds a quadratic form (xx, xy, yy) of the point that these weights of four coefficients make, and what pulls at it.
    fn add(&mut self, span: usize, weights: &[f64; 4], [xx, xy, yy]: [f64; 3], pull: Plane) {
        let rows = &mut self.rows[2 * span..2 * span + WIDTH];
        let x = &mut self.x[2 * span..2 * span + WIDTH];
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
            x[2 * i] += weights[i] * pull[0];
            x[2 * i + 1] += weights[i] * pull[1];
        }
    }

    /// Factors the part of the matrix of the unknowns that are free, and solves; 0 for the others.
    fn factor_and_solve(&mut self, free: std::ops::Range<usize>) {
        self.x[..free.start].fill(0.0);
        // Nothing couples with what is not free, nor with what is behind the end.
        self.rows.resize(free.end + WIDTH, [0.0; WIDTH]);
        self.x.truncate(free.end);
        self.x.resize(free.end + WIDTH, 0.0);
        for i in free.end.saturating_sub(WIDTH).max(free.start)..free.end {
            self.rows[i][free.end - i..].fill(0.0);
        }
        for i in free.clone() {
            let [row, below @ ..] = &mut self.rows[i..i + WIDTH] else {
                return;
            };
            let [x, right @ ..] = &mut self.x[i..i + WIDTH] else {
                return;
            };
            let inverse = 1.0 / row[0].max(1e-300);
            for a in 1..WIDTH {
                let factor = row[a] * inverse;
                for b in a..WIDTH {
                    below[a - 1][b - a] -= factor * row[b];
                }
                right[a - 1] -= factor * *x;
            }
            // What is left of the row is its inverse and the factors.
            *x *= inverse;
            for a in 1..WIDTH {
                row[a] *= inverse;
            }
        }
        for i in free.rev() {
            let row = &self.rows[i];
            let [x, right @ ..] = &mut self.x[i..i + WIDTH] else {
                return;
            };
            for a in 1..WIDTH {
                *x -= row[a] * right[a - 1];
            }
        }
    }
}
