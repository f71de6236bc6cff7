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

/// Buffer of a factorisation LDLᵀ.
#[derive(Clone, Debug, Default)]
pub(super) struct Factor {
    /// The two entries of L below the diagonal, by column.
    below: Vec<[f64; 2]>,
}

impl Factor {
    /// Solves for the unknowns `free`; the others are 0.
    pub(super) fn solve(&mut self, matrix: &Band, free: Range<usize>, right: &[f64], x: &mut Vec<f64>) {
        self.below.clear();
        x.clear();
        x.resize(right.len(), 0.0);
        let unknowns = &mut x[free.clone()];
        // What rows above take: from this diagonal, from the entry next to it, and from the next diagonal; and from this right
        // side and the next.
        let (mut diagonal, mut next, mut next_diagonal) = (0.0, 0.0, 0.0);
        let (mut y1, mut y2) = (0.0, 0.0);
        for ((row, right), x) in matrix.rows[free.clone()]
            .iter()
            .zip(&right[free])
            .zip(unknowns.iter_mut())
        {
            let pivot = (row.diagonal - diagonal).max(LEAST_PIVOT * row.diagonal);
            let inverse = 1.0 / pivot;
            let below = row.next - next;
            let (l1, l2) = (below * inverse, row.second * inverse);
            diagonal = next_diagonal + l1 * below;
            next = l1 * row.second;
            next_diagonal = l2 * row.second;
            self.below.push([l1, l2]);
            let y = right - y1;
            *x = y * inverse;
            y1 = y2 + l1 * y;
            y2 = l2 * y;
        }
        let (mut below, mut second) = (0.0, 0.0);
        for ([l1, l2], x) in self.below.iter().zip(unknowns.iter_mut()).rev() {
            *x -= l1 * below + l2 * second;
            second = below;
            below = *x;
        }
    }
}
