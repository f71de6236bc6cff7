//! The constraints of a range of spans, [`LANES`] neighbouring spans at once.
//!
//! In:  a grid.
//! Out: blocks, and the rows of joints at their checkpoints, in the unknowns of their own span.

use std::ops::Range;

use super::grid::{CHECKPOINTS, FINE_CHECKPOINTS, Grid, Row};
use super::lanes::{LANES, Lane};

/// All constraints, and what is known of them at the current coefficients.
#[derive(Clone, Debug, Default)]
pub(super) struct Constraints {
    pub(super) blocks: Vec<Block>,
    /// By block, checkpoint, joint.
    pub(super) pairs: Vec<Pair>,
    pub(super) bounds: Vec<PairBounds>,
    /// By block, checkpoint.
    pub(super) places: Vec<Place>,
    /// Spans.
    pub(super) count: usize,
    /// Joints that move; the others bound nothing.
    joints: Vec<usize>,
}

/// What is fixed for [`LANES`] neighbouring spans, and its bounds on b. Within a span, x = (middle Bézier ordinate of b, u at
/// the beginning, u at the end).
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub(super) h: Lane,
    /// u = k (c[i + 1] - c[i]) at the beginning and end.
    pub(super) k0: Lane,
    pub(super) k1: Lane,
    /// 1 / cap of b at the beginning, and of the middle ordinate.
    pub(super) knot: Lane,
    pub(super) middle: Lane,
    /// 1, or 0 for lanes behind the last span.
    pub(super) used: Lane,
    /// Rows of a checkpoint, and its checkpoints.
    pub(super) rows: usize,
    pub(super) checkpoints: &'static [(f64, f64)],
    pub(super) knot_bound: Bound,
    pub(super) middle_bound: Bound,
}

/// Acceleration and jerk / sqrt(b) of one joint at one checkpoint: linear in x.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pair {
    pub(super) acceleration: [Lane; 3],
    pub(super) jerk: [Lane; 3],
    /// What a kink takes of it, in amount.
    pub(super) kink: Lane,
}

/// One constraint: 1 / slack, and its multiplier.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bound {
    pub(super) inverse: Lane,
    pub(super) dual: Lane,
}

/// Both bounds of acceleration and of jerk.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PairBounds {
    pub(super) acceleration: [Bound; 2],
    pub(super) jerk: [Bound; 2],
}

/// A checkpoint: 1 / b, and the derivative of 1 / sqrt(b) by b.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    pub(super) inverse_b: Lane,
    pub(super) slope: Lane,
}

impl Block {
    /// b as a linear function of x at a part of the span.
    #[inline(always)]
    pub(super) fn b_row(&self, part: f64) -> [Lane; 3] {
        let rest = 1.0 - part;
        [
            Lane::splat(1.0),
            Lane::splat(-rest * rest) * self.h,
            Lane::splat(part * part) * self.h,
        ]
    }

    /// The unknowns of its spans from the coefficients that begin with the first of them.
    #[inline(always)]
    pub(super) fn x(&self, c: &[f64]) -> [Lane; 3] {
        let from = |k: usize| Lane(c[k..].first_chunk().copied().unwrap_or_default());
        let (c0, c1, c2) = (from(0), from(1), from(2));
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
        self.kink.0[lane] = row.kink;
    }
}

/// Where joints move evenly over all of these spans (`None`: no span): the tightest of each bound stands for those of all
/// joints, the same at every checkpoint.
fn straight(grid: &Grid, joints: &[usize], spans: impl Iterator<Item = Option<usize>>) -> Option<[Row; LANES]> {
    let mut tightest = [Row::default(); LANES];
    for (tightest, span) in tightest.iter_mut().zip(spans) {
        let Some(span) = span else { continue };
        for rows in grid.all_rows(span).chunks_exact(grid.joints()) {
            for row in joints.iter().map(|&joint| &rows[joint]) {
                if row.a2 != 0.0 || row.j3 != 0.0 {
                    return None;
                }
                tightest.a1 = tightest.a1.max(row.a1.abs());
                tightest.j1 = tightest.j1.max(row.j1.abs());
                tightest.kink = tightest.kink.max(row.kink);
            }
        }
    }
    Some(tightest)
}

impl Constraints {
    /// Takes the constraints of a range of spans, at least one, from a grid.
    pub(super) fn pack(&mut self, grid: &Grid, spans: Range<usize>) {
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
        self.pairs.clear();
        for block in 0..blocks {
            let mut lanes = Block {
                rows: self.joints.len(),
                checkpoints: &CHECKPOINTS,
                h: Lane::splat(1.0),
                k0: Lane::splat(0.0),
                k1: Lane::splat(0.0),
                knot: Lane::splat(0.0),
                middle: Lane::splat(0.0),
                used: Lane::splat(0.0),
                knot_bound: Bound::default(),
                middle_bound: Bound::default(),
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
            let fine = (0..LANES).filter_map(own).any(|span| grid.is_fine(span));
            lanes.checkpoints = if fine { &FINE_CHECKPOINTS } else { &CHECKPOINTS };
            if let Some(pair) = straight(grid, &self.joints, (0..LANES).map(own)) {
                lanes.rows = 1;
                for &(part, _) in lanes.checkpoints {
                    let mut at = Pair::default();
                    for (lane, row) in pair.iter().enumerate() {
                        at.set(lane, row, part, lanes.h.0[lane]);
                    }
                    self.pairs.push(at);
                }
                self.blocks.push(lanes);
                continue;
            }
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
                    self.pairs.push(pair);
                }
            }
            self.blocks.push(lanes);
        }
        self.bounds.clear();
        self.bounds.resize(self.pairs.len(), PairBounds::default());
        let places = self.blocks.iter().map(|block| block.checkpoints.len()).sum();
        self.places.clear();
        self.places.resize(places, Place::default());
    }

    /// Every span has two caps, and per checkpoint and joint two bounds of acceleration and two of jerk.
    pub(super) fn number(&self) -> usize {
        let blocks = self.blocks.iter().enumerate();
        let pairs: usize = blocks
            .map(|(k, block)| LANES.min(self.count - k * LANES) * block.rows * block.checkpoints.len())
            .sum();
        2 * self.count + 4 * pairs
    }
}
