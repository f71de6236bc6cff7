//! Where to put knots: about evenly in time, at the speed that a quick pass over the path expects.
//!
//! In:  the path as cells, stretches on which one cap of speed and one acceleration will do.
//! Out: for each cell the lengths of its spans.

use super::super::grid::{JointJet, JointLimits};
use super::super::rise;
use crate::plan::roots::cube_root;

/// A stretch of path within one piece of geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Length of path.
    length: f64,
    /// Greatest b at constant speed, finite.
    cap: f64,
    /// Acceleration along the path that the joints allow on a straight.
    acceleration: f64,
    /// The same of jerk.
    jerk: f64,
    /// Fewest spans to cut it into, at least 1.
    least: u32,
}

/// Fewest spans between two rests, about.
const LEAST_SPANS: f64 = 60.0;
/// Most spans of one cell: beyond, memory runs out before anyone waits that long.
const MOST_SPANS: f64 = 1e6;
/// Greatest relative change of b over a span, about, and how often a span is shortened for it.
const CHANGE: f64 = 0.6;
const SHORTENINGS: u32 = 40;
/// What acceleration and jerk may do between two checkpoints, over the limits.
const BETWEEN: [f64; 2] = [0.004, 0.006];

impl Cell {
    /// A cell from evenly spaced places on it, its ends among them; `cap` is the greatest b by feed.
    pub(super) fn new(limits: &[JointLimits], length: f64, cap: f64, least: u32, places: &[&[JointJet]]) -> Cell {
        let mut cell = Cell {
            length,
            cap: cap.min(1e12),
            acceleration: 1e12,
            jerk: 1e12,
            least: least.max(1),
        };
        for jets in places {
            for (jet, limits) in jets.iter().zip(limits) {
                let v = limits.velocity / jet.d1.abs();
                let root = cube_root(limits.jerk / jet.d3.abs());
                let curved = limits.acceleration / jet.d2.abs();
                cell.cap = cell.cap.min(v * v).min(curved).min(root * root);
                cell.acceleration = cell.acceleration.min(limits.acceleration / jet.d1.abs());
                cell.jerk = cell.jerk.min(limits.jerk / jet.d1.abs());
            }
        }
        // Between checkpoints half a span apart, a function with the second difference d over 1/k of the cell strays
        // from the chord by d k² / 32 n², with n spans to the cell.
        let parts = places.len().saturating_sub(1) as f64;
        let mut wanted: f64 = 0.0;
        for three in places.windows(3) {
            for (joint, limits) in limits.iter().enumerate() {
                let second = |f: fn(&JointJet) -> f64| {
                    (f(&three[0][joint]) - 2.0 * f(&three[1][joint]) + f(&three[2][joint])).abs()
                };
                let acceleration = second(|jet| jet.d2) * cell.cap / limits.acceleration;
                let jerk = second(|jet| jet.d3) * cell.cap * cell.cap.sqrt() / limits.jerk;
                wanted = wanted.max(acceleration / BETWEEN[0]).max(jerk / BETWEEN[1]);
            }
        }
        let wanted = (wanted / 32.0).sqrt() * parts;
        cell.least = (wanted.min(MOST_SPANS) as u32).max(cell.least);
        cell
    }

    fn rise(&self, b: f64, length: f64, cap: f64) -> f64 {
        rise(b, length, [self.acceleration, self.jerk], cap)
    }
}

/// Lengths of spans for cells between two ends with known b (at a rest, that at the end of the launch), about `dt`
/// seconds each. Calls `span(cell, length)` for every span in order; the lengths of a cell add up to its own.
pub(super) fn spacing(cells: &[Cell], from: f64, to: f64, dt: f64, mut span: impl FnMut(usize, f64)) {
    // Greatest b at the borders of cells, backward then forward.
    let mut borders = vec![to; cells.len() + 1];
    for (index, cell) in cells.iter().enumerate().rev() {
        let before = if index > 0 { cells[index - 1].cap } else { from };
        borders[index] = cell.rise(borders[index + 1], cell.length, cell.cap.min(before));
    }
    for (index, cell) in cells.iter().enumerate() {
        borders[index + 1] = cell.rise(borders[index], cell.length, borders[index + 1]);
    }
    let time: f64 = cells
        .iter()
        .zip(borders.windows(2))
        .map(|(cell, b)| cell.time(b[0], b[1]))
        .sum();
    let dt = dt.min(time / LEAST_SPANS);
    let mut lengths = Vec::new();
    for (index, cell) in cells.iter().enumerate() {
        lengths.clear();
        cell.cut(borders[index], borders[index + 1], dt, &mut lengths);
        for &length in &lengths {
            span(index, length);
        }
    }
}

impl Cell {
    /// Seconds over the cell, roughly.
    fn time(&self, from: f64, to: f64) -> f64 {
        let middle = self.expected(from, to, 0.5 * self.length);
        self.length * 2.0 / (0.5 * (from.sqrt() + to.sqrt()) + middle.sqrt()).max(1e-9)
    }

    /// b at a place, between known b at both ends.
    fn expected(&self, from: f64, to: f64, s: f64) -> f64 {
        let cap = self.cap.max(from).max(to);
        self.rise(to, self.length - s, self.rise(from, s, cap))
    }

    /// Cuts the cell by the expected speed.
    fn cut(&self, from: f64, to: f64, dt: f64, lengths: &mut Vec<f64>) {
        let least_step = self.length / MOST_SPANS;
        let mut s = 0.0;
        while s < self.length {
            let here = self.expected(from, to, s);
            let mut h = here.sqrt() * dt;
            for _ in 0..SHORTENINGS {
                let there = self.expected(from, to, (s + h).min(self.length));
                let (low, high) = (here.min(there), here.max(there));
                if high <= (1.0 + CHANGE) * low {
                    h = h.min(low.sqrt() * dt);
                    break;
                }
                h *= 0.7;
            }
            let h = h.max(least_step);
            lengths.push(h);
            s += h;
        }
        let least = self.least as usize;
        if lengths.len() < least {
            // Too few: as many within each as it takes.
            let times = least.div_ceil(lengths.len());
            let coarse = std::mem::take(lengths);
            lengths.extend(
                coarse
                    .iter()
                    .flat_map(|&h| std::iter::repeat_n(h / times as f64, times)),
            );
        }
        // The last one stuck out.
        let scale = self.length / lengths.iter().sum::<f64>();
        for h in lengths.iter_mut() {
            *h *= scale;
        }
    }
}
