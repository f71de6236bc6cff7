//! Linear least squares with a few unknowns.
//!
//! In:  rows of regressors and what they are to make. Out: the coefficients that come nearest, and how near that is.

/// Sums of `N` regressors, row by row.
#[derive(Clone, Debug)]
pub struct LeastSquares<const N: usize> {
    normal: [[f64; N]; N],
    right: [f64; N],
    squares: f64,
}

impl<const N: usize> Default for LeastSquares<N> {
    fn default() -> Self {
        LeastSquares {
            normal: [[0.0; N]; N],
            right: [0.0; N],
            squares: 0.0,
        }
    }
}

impl<const N: usize> LeastSquares<N> {
    /// One row: `value` is to be the sum of the regressors, each times its coefficient.
    pub fn add(&mut self, regressors: &[f64; N], value: f64) {
        for row in 0..N {
            for column in 0..N {
                self.normal[row][column] += regressors[row] * regressors[column];
            }
            self.right[row] += regressors[row] * value;
        }
        self.squares += value * value;
    }

    /// Coefficients, and the share of the values that they do not explain (root of the mean square). A regressor that the rows do not tell from the others gets 0.
    pub fn solve(&self) -> ([f64; N], f64) {
        let mut matrix = self.normal;
        let mut right = self.right;
        // Scaled to ones on the diagonal, so that units do not matter.
        let scale: [f64; N] = std::array::from_fn(|at| match matrix[at][at].sqrt() {
            size if size > 0.0 => 1.0 / size,
            _ => 0.0,
        });
        for row in 0..N {
            for column in 0..N {
                matrix[row][column] *= scale[row] * scale[column];
            }
            right[row] *= scale[row];
        }
        let mut solved = [false; N];
        for _ in 0..N {
            let open = (0..N).filter(|&at| !solved[at]);
            let Some(pivot) = open.max_by(|&a, &b| matrix[a][a].total_cmp(&matrix[b][b])) else {
                break;
            };
            if matrix[pivot][pivot] < 1e-12 {
                break;
            }
            solved[pivot] = true;
            let share = 1.0 / matrix[pivot][pivot];
            matrix[pivot] = matrix[pivot].map(|value| value * share);
            let pivot_row = matrix[pivot];
            right[pivot] *= share;
            for row in (0..N).filter(|&row| row != pivot) {
                let factor = matrix[row][pivot];
                for (value, of_pivot) in matrix[row].iter_mut().zip(pivot_row) {
                    *value -= factor * of_pivot;
                }
                right[row] -= factor * right[pivot];
            }
        }
        let found = std::array::from_fn(|at| if solved[at] { right[at] * scale[at] } else { 0.0 });
        (found, self.left_by(&found))
    }

    fn left_by(&self, found: &[f64; N]) -> f64 {
        let mut left = self.squares;
        for row in 0..N {
            let made: f64 = (0..N).map(|column| self.normal[row][column] * found[column]).sum();
            left += found[row] * (made - 2.0 * self.right[row]);
        }
        (left.max(0.0) / self.squares.max(f64::MIN_POSITIVE)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_of_any_unit_are_found_and_what_is_not_told_apart_is_0() {
        let mut rows = LeastSquares::default();
        for step in 0..50 {
            let x = f64::from(step);
            rows.add(&[1e3 * x, 1e-3 * x * x, 1.0, 0.0], 2e3 * x - 3e-3 * x * x + 5.0);
        }
        let (found, left) = rows.solve();
        for (found, expected) in found.into_iter().zip([2.0, -3.0, 5.0, 0.0]) {
            assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        }
        assert!(left < 1e-6, "{left}");
    }
}
