//! A run as a path in a plane.
//!
//! In:  moves of one plane.
//! Out: places, directions and distances in coordinates of that plane, and back.

use super::least_jerk::Plane;
use crate::canon::AXES;
use crate::path::{Group, Jet, Piece, Shape};
use crate::plan::smooth::Leg;
use crate::plan::smooth::round::nearest;

/// A run as a path in a plane.
pub(super) struct Track {
    /// Where each piece begins.
    pub(super) legs: Vec<(f64, Piece)>,
    origin: [f64; AXES],
    axes: [[f64; 3]; 2],
}

impl Track {
    pub(super) fn new(run: &[Leg], normal: [f64; 3]) -> Track {
        let mut s = 0.0;
        let legs = run
            .iter()
            .map(|leg| {
                let start = s;
                s += leg.part.piece.length();
                (start, leg.part.piece)
            })
            .collect();
        // An axis of the machine where one lies in the plane, so that others do not move by rounding.
        let unit = |k: usize| [0, 1, 2].map(|i| if i == k { 1.0 } else { 0.0 });
        let jet = run[0].part.piece.jet(0.0);
        let first = (0..3)
            .find(|&k| normal[k] == 0.0)
            .map_or(Group::Main.pick(&jet.d1), unit);
        let second = [
            normal[1] * first[2] - normal[2] * first[1],
            normal[2] * first[0] - normal[0] * first[2],
            normal[0] * first[1] - normal[1] * first[0],
        ];
        Track {
            legs,
            origin: jet.q,
            axes: [first, second],
        }
    }

    pub(super) fn start(&self, leg: usize) -> f64 {
        self.legs[leg].0
    }

    pub(super) fn direction(&self, d: &[f64; AXES]) -> Plane {
        self.axes.map(|axis| (0..3).map(|i| axis[i] * d[i]).sum())
    }

    pub(super) fn flat(&self, q: &[f64; AXES]) -> Plane {
        let mut from = *q;
        for i in 0..3 {
            from[i] -= self.origin[i];
        }
        self.direction(&from)
    }

    pub(super) fn space(&self, p: &Plane) -> [f64; AXES] {
        let mut q = [0.0; AXES];
        for i in 0..3 {
            q[i] = p[0] * self.axes[0][i] + p[1] * self.axes[1][i];
        }
        q
    }

    pub(super) fn position(&self, p: &Plane) -> [f64; AXES] {
        let mut q = self.space(p);
        for i in 0..AXES {
            q[i] += self.origin[i];
        }
        q
    }

    pub(super) fn leg_at(&self, s: f64) -> usize {
        self.legs.partition_point(|leg| leg.0 <= s).clamp(1, self.legs.len()) - 1
    }

    /// Place and direction.
    pub(super) fn place(&self, s: f64) -> (Plane, Plane) {
        let (start, piece) = &self.legs[self.leg_at(s)];
        let (q, d1) = piece.tangent(s - start);
        (self.flat(&q), self.direction(&d1))
    }

    /// The place next to `q` between two places, and how far it is. Only what is due may be found: a path may come back to
    /// where it was.
    pub(super) fn nearest(&self, q: &Plane, [from, to]: [f64; 2]) -> (f64, f64) {
        let q = self.position(q);
        let mut best = (from, f64::INFINITY);
        for (start, piece) in &self.legs[self.leg_at(from)..=self.leg_at(to)] {
            let [low, high] = [from, to].map(|s| (s - start).clamp(0.0, piece.length()));
            let (off, s) = nearest(piece, &q, low, high, 0.5 * (low + high));
            if off < best.1 {
                best = (start + s, off);
            }
        }
        best
    }
}

/// Unit vector about which an arc turns.
pub(super) fn normal(piece: &Piece) -> Option<[f64; 3]> {
    match piece.shape() {
        Shape::Arc(arc) => Some(arc.turns_about()),
        Shape::Line(_) | Shape::Blend(_) => None,
    }
}

/// The same for each mm, of pieces that are next to nothing.
const RISE_MAX: f64 = 1e-9;

/// Whether a line or arc stays in a plane of which this is the normal, and nothing but X, Y and Z moves.
pub(super) fn flat(piece: &Piece, normal: &[f64; 3]) -> bool {
    /// What rounding lets a piece rise, mm: what is flat is laid into the plane, and any more would be a jump at its end.
    const RISE_MM: f64 = 1e-10;
    let rise = RISE_MM / piece.length();
    let still = |jet: &Jet| jet.d1[3..].iter().all(|&d| d == 0.0);
    let level = |d: &[f64; AXES]| (0..3).map(|i| d[i] * normal[i]).sum::<f64>().abs() < rise.min(RISE_MAX);
    piece.group() == Group::Main
        && match piece.shape() {
            Shape::Blend(_) => false,
            Shape::Line(_) | Shape::Arc(_) => [0.0, 0.5, 1.0].iter().all(|x| {
                let jet = piece.jet(x * piece.length());
                still(&jet) && level(&jet.d1) && level(&jet.d2)
            }),
        }
}
