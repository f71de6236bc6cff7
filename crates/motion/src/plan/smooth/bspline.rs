//! Splines of degree 5 on any knots.
//!
//! In:  knots, coefficients.
//! Out: values and derivatives of the six basis functions that are not zero at a place; the least-squares system of a fit.
//!
//! Basis function `j` lives from knot `j` to knot `j + 6`. At both ends of a fit the knot is there six times, so that the
//! first three coefficients alone decide position, first and second derivative there (the fourth the third).

use crate::canon::AXES;

/// Degree of all splines here.
pub(super) const DEGREE: usize = 5;
/// Basis functions that are not zero in a span.
pub(super) const ORDER: usize = DEGREE + 1;

/// The basis functions `span - 5 ..= span` at `t` in the span that begins at knot `span`, derived `derivative` times
/// (Cox and de Boor).
pub(super) fn basis(knots: &[f64], span: usize, t: f64, derivative: usize) -> [f64; ORDER] {
    let mut n = [0.0; ORDER];
    n[DEGREE] = 1.0;
    for degree in 1..=DEGREE {
        let derived = degree > DEGREE - derivative;
        // Of degree - 1, over its own support; shared by two neighbours.
        let mut left = 0.0;
        for i in DEGREE - degree..=DEGREE {
            let first = span + i - DEGREE;
            let right = if i < DEGREE {
                n[i + 1] / (knots[first + degree + 1] - knots[first + 1])
            } else {
                0.0
            };
            n[i] = if derived {
                degree as f64 * (left - right)
            } else {
                (t - knots[first]) * left + (knots[first + degree + 1] - t) * right
            };
            left = right;
        }
    }
    n
}

/// Normal equations with a band of six, for several right-hand sides at once. Only the upper half is kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Band {
    /// Row `i` holds the columns `i ..= i + 5`.
    rows: Vec<[f64; ORDER]>,
    right: Vec<[f64; AXES]>,
    axes: usize,
}

impl Band {
    pub(super) fn clear(&mut self, unknowns: usize, axes: usize) {
        self.rows.clear();
        self.rows.resize(unknowns, [0.0; ORDER]);
        self.right.clear();
        self.right.resize(unknowns, [0.0; AXES]);
        self.axes = axes;
    }

    /// Asks that the spline `sum n_i x_(first + i)` be `target`, with a weight.
    pub(super) fn ask(&mut self, first: usize, n: &[f64; ORDER], target: &[f64; AXES], weight: f64) {
        for i in 0..ORDER {
            let wn = weight * n[i];
            let row = &mut self.rows[first + i];
            for k in 0..ORDER - i {
                row[k] += wn * n[i + k];
            }
            let right = &mut self.right[first + i];
            for (right, target) in right.iter_mut().zip(target).take(self.axes) {
                *right += wn * target;
            }
        }
    }

    /// Asks that a combination be zero.
    pub(super) fn ask_zero(&mut self, first: usize, n: &[f64; ORDER], weight: f64) {
        for i in 0..ORDER {
            let wn = weight * n[i];
            let row = &mut self.rows[first + i];
            for k in 0..ORDER - i {
                row[k] += wn * n[i + k];
            }
        }
    }

    /// Solves for the unknowns between the first `before` and the last `after`, which are given in `x`.
    pub(super) fn solve(&mut self, x: &mut [[f64; AXES]], before: usize, after: usize) {
        let (axes, end) = (self.axes, self.rows.len() - after);
        // What is given goes to the right-hand side.
        for (given, value) in x.iter().enumerate().filter(|(k, _)| *k < before || *k >= end) {
            for row in given.saturating_sub(DEGREE)..(given + ORDER).min(self.rows.len()) {
                if row >= before && row < end {
                    let factor = if row <= given {
                        self.rows[row][given - row]
                    } else {
                        self.rows[given][row - given]
                    };
                    for axis in 0..axes {
                        self.right[row][axis] -= factor * value[axis];
                    }
                }
            }
        }
        // L D L^T in place.
        for row in before..end {
            let pivot = self.rows[row];
            let right = self.right[row];
            for k in 1..ORDER.min(end - row) {
                let factor = pivot[k] / pivot[0];
                let below = &mut self.rows[row + k];
                for i in k..ORDER {
                    below[i - k] -= factor * pivot[i];
                }
                for axis in 0..axes {
                    self.right[row + k][axis] -= factor * right[axis];
                }
            }
        }
        for row in (before..end).rev() {
            let pivot = self.rows[row];
            let mut value = self.right[row];
            for k in 1..ORDER.min(end - row) {
                for axis in 0..axes {
                    value[axis] -= pivot[k] * x[row + k][axis];
                }
            }
            for axis in 0..axes {
                x[row][axis] = value[axis] / pivot[0];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knots() -> Vec<f64> {
        let mut knots = vec![0.0; 6];
        knots.extend([0.3, 1.0, 1.1, 2.5]);
        knots.extend([4.0; 6]);
        knots
    }

    #[test]
    fn basis_functions_add_up_to_one_and_their_derivatives_to_zero() {
        let knots = knots();
        for span in 5..10 {
            for x in [0.0, 0.2, 0.9, 1.0] {
                let t = knots[span] + x * (knots[span + 1] - knots[span]);
                let sum = |derivative| basis(&knots, span, t, derivative).iter().sum::<f64>();
                assert!((sum(0) - 1.0).abs() < 1e-14);
                for derivative in 1..=3 {
                    assert!(sum(derivative).abs() < 1e-9, "{derivative} at {t}");
                }
            }
        }
    }

    #[test]
    fn a_polynomial_is_found_again_with_its_ends_given() {
        let knots = knots();
        let f = |t: f64| 3.0 + t * (1.0 - t * (0.5 - 0.1 * t * (t - 2.0)));
        let mut band = Band::default();
        band.clear(10, 1);
        let mut x = vec![[0.0; AXES]; 10];
        let target = |t: f64| {
            let mut q = [0.0; AXES];
            q[0] = f(t);
            q
        };
        for span in 5..10 {
            for k in 0..5 {
                let t = knots[span] + (f64::from(k) + 0.5) / 5.0 * (knots[span + 1] - knots[span]);
                band.ask(span - 5, &basis(&knots, span, t, 0), &target(t), 1.0 + t);
            }
        }
        // The ends alone are the first and the last coefficient.
        (x[0], x[9]) = (target(0.0), target(4.0));
        band.solve(&mut x, 1, 1);
        for span in 5..10 {
            let t = 0.5 * (knots[span] + knots[span + 1]);
            let n = basis(&knots, span, t, 0);
            let value: f64 = n.iter().zip(&x[span - 5..]).map(|(n, x)| n * x[0]).sum();
            assert!((value - f(t)).abs() < 1e-11, "{value} {}", f(t));
            let third: f64 = basis(&knots, span, t, 3)
                .iter()
                .zip(&x[span - 5..])
                .map(|(n, x)| n * x[0])
                .sum();
            let h = 1e-2;
            let want = (f(t + 2.0 * h) - 2.0 * f(t + h) + 2.0 * f(t - h) - f(t - 2.0 * h)) / (2.0 * h * h * h);
            assert!((third - want).abs() < 1e-6, "{third} {want}");
        }
    }
}
