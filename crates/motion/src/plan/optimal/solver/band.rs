//! Linear systems of a symmetric positive definite matrix of half bandwidth 2.

use std::ops::Range;

/// The matrix by rows; row i couples with i + 1 and i + 2.
#[derive(Clone, Debug, Default)]
pub(super) struct Band {
    pub(super) rows: Vec<BandRow>,
}

/// One row from its diagonal on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BandRow {
    pub(super) diagonal: f64,
    /// Next to the diagonal.
    pub(super) next: f64,
    /// One further.
    pub(super) second: f64,
}

/// Least pivot over the diagonal entry it came from: below, it is rounding and no more.
const LEAST_PIVOT: f64 = 1e-15;

impl Band {
    /// All zero, with `size` rows.
    pub(super) fn reset(&mut self, size: usize) {
        self.rows.clear();
        self.rows.resize(size, BandRow::default());
    }
}

/// Buffer of a factorisation.
#[derive(Clone, Debug, Default)]
pub(super) struct Factor {
    /// What the two unknowns that an elimination leaves take in the one eliminated.
    below: Vec<[f64; 2]>,
}

/// Elimination of one unknown after the other from one end: what those before take from the next diagonal, the entry beside
/// it, and the diagonal after; from the next right side and the one after.
#[derive(Clone, Copy, Debug, Default)]
struct Sweep {
    diagonal: f64,
    next: f64,
    next_diagonal: f64,
    right: [f64; 2],
}

impl Sweep {
    #[inline(always)]
    fn eliminate(&mut self, row: BandRow, right: f64) -> ([f64; 2], f64) {
        let pivot = (row.diagonal - self.diagonal).max(LEAST_PIVOT * row.diagonal);
        let inverse = 1.0 / pivot;
        let below = row.next - self.next;
        let (l1, l2) = (below * inverse, row.second * inverse);
        let y = right - self.right[0];
        *self = Sweep {
            diagonal: self.next_diagonal + l1 * below,
            next: l1 * row.second,
            next_diagonal: l2 * row.second,
            right: [self.right[1] + l1 * y, l2 * y],
        };
        ([l1, l2], y * inverse)
    }
}

impl Factor {
    /// Solves for the unknowns `free`; the others are 0.
    ///
    /// Eliminates from both ends at once, until two unknowns in the middle are left: each elimination waits for the one before
    /// it, so two of them take no longer than one.
    pub(super) fn solve(&mut self, matrix: &Band, free: Range<usize>, right: &[f64], x: &mut Vec<f64>) {
        x.clear();
        x.resize(right.len(), 0.0);
        let (rows, right, x) = (&matrix.rows[free.clone()], &right[free.clone()], &mut x[free]);
        let count = rows.len();
        if count < 2 {
            for ((x, row), right) in x.iter_mut().zip(rows).zip(right) {
                *x = right / row.diagonal;
            }
            return;
        }
        // What was there before is written over.
        self.below.resize(count, [0.0; 2]);
        let below = &mut self.below[..count];
        let middle = (count - 2) / 2;
        let (mut forward, mut backward) = (Sweep::default(), Sweep::default());
        // From the other end, the entries beside the diagonal are in the rows before.
        let mirrored = |k: usize| BandRow {
            diagonal: rows[k].diagonal,
            next: rows[k - 1].next,
            second: rows[k - 2].second,
        };
        for k in 0..middle {
            (below[k], x[k]) = forward.eliminate(rows[k], right[k]);
            let k = count - 1 - k;
            (below[k], x[k]) = backward.eliminate(mirrored(k), right[k]);
        }
        if middle + 2 < count - middle {
            let k = middle + 2;
            (below[k], x[k]) = backward.eliminate(mirrored(k), right[k]);
        }
        let (a, b) = (middle, middle + 1);
        let first = BandRow {
            diagonal: rows[a].diagonal - forward.diagonal - backward.next_diagonal,
            next: rows[a].next - forward.next - backward.next,
            second: 0.0,
        };
        let mut last = Sweep::default();
        let (l, z) = last.eliminate(first, right[a] - forward.right[0] - backward.right[1]);
        let second = BandRow {
            diagonal: rows[b].diagonal - forward.next_diagonal - backward.diagonal,
            ..BandRow::default()
        };
        (_, x[b]) = last.eliminate(second, right[b] - forward.right[1] - backward.right[0]);
        x[a] = z - l[0] * x[b];
        let (mut up, mut down) = ([x[a], x[b]], [x[b], x[a]]);
        let put = |x: &mut f64, l: [f64; 2], near: &mut [f64; 2]| {
            *x -= l[0] * near[0] + l[1] * near[1];
            *near = [*x, near[0]];
        };
        for k in 0..middle {
            put(&mut x[a - 1 - k], below[a - 1 - k], &mut up);
            put(&mut x[b + 1 + k], below[b + 1 + k], &mut down);
        }
        if b + 1 + middle < count {
            put(&mut x[count - 1], below[count - 1], &mut down);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_of_any_size_is_solved() {
        for count in 0..12_usize {
            let at = |k: usize| 1.0 + 0.3 * ((k * k) as f64).sin();
            // The first and the last two are not free.
            let matrix = Band {
                rows: (0..count + 4)
                    .map(|k| BandRow {
                        diagonal: 4.0 * at(k),
                        next: at(k + 50),
                        second: -0.5 * at(k + 90),
                    })
                    .collect(),
            };
            let right: Vec<f64> = (0..count + 4).map(|k| at(k + 7)).collect();
            let mut x = Vec::new();
            Factor::default().solve(&matrix, 2..count + 2, &right, &mut x);
            assert!(x[..2].iter().chain(&x[count + 2..]).all(|x| *x == 0.0));
            for k in 2..count + 2 {
                let row = |k: usize| matrix.rows[k];
                let sum = row(k).diagonal * x[k]
                    + row(k).next * x[k + 1]
                    + row(k).second * x[k + 2]
                    + row(k - 1).next * x[k - 1]
                    + row(k - 2).second * x[k - 2];
                assert!((sum - right[k]).abs() < 1e-12, "{k} of {count}: {sum} {}", right[k]);
            }
        }
    }
}
