//! Linear systems of a symmetric positive definite matrix of half bandwidth 2.

use std::ops::Range;

/// The matrix by rows; row i couples with i + 1 and i + 2.
#[derive(Clone, Debug, Default)]
pub(super) struct Band {
    pub(super) rows: Vec<BandRow>,
}

/// One row from its diagonal on; after [`Band::factor`], of its LDLᵀ factor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BandRow {
    /// Diagonal of the matrix; then 1/D.
    pub(super) diagonal: f64,
    /// Next to the diagonal; then the entry of L below the diagonal.
    pub(super) next: f64,
    /// One further; then the entry of L two below.
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

    /// Factors the part of the matrix that belongs to the unknowns `free`.
    pub(super) fn factor(&mut self, free: Range<usize>) {
        // What rows above take: from this diagonal, from the entry next to it, and from the next diagonal.
        let (mut diagonal, mut next, mut next_diagonal) = (0.0, 0.0, 0.0);
        for row in &mut self.rows[free] {
            let pivot = (row.diagonal - diagonal).max(LEAST_PIVOT * row.diagonal);
            let inverse = 1.0 / pivot;
            let below = row.next - next;
            let (l1, l2) = (below * inverse, row.second * inverse);
            diagonal = next_diagonal + l1 * below;
            next = l1 * row.second;
            next_diagonal = l2 * row.second;
            *row = BandRow {
                diagonal: inverse,
                next: l1,
                second: l2,
            };
        }
    }

    /// Solves with the factor; `x` is the right side and becomes the solution, 0 outside `free`.
    pub(super) fn solve(&self, free: Range<usize>, x: &mut [f64]) {
        x[..free.start].fill(0.0);
        x[free.end..].fill(0.0);
        let rows = &self.rows[free.clone()];
        let x = &mut x[free];
        let (mut y1, mut y2) = (0.0, 0.0);
        for (row, x) in rows.iter().zip(x.iter_mut()) {
            let y = *x - y1;
            *x = y * row.diagonal;
            y1 = y2 + row.next * y;
            y2 = row.second * y;
        }
        let (mut below, mut second) = (0.0, 0.0);
        for (row, x) in rows.iter().zip(x.iter_mut()).rev() {
            *x -= row.next * below + row.second * second;
            second = below;
            below = *x;
        }
    }
}
