//! Straight stretch.

use super::{Group, Jet, distance, snapped};
use crate::canon::{AXES, Position};

/// Straight stretch in nine axes.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    start: [f64; AXES],
    end: [f64; AXES],
    length: f64,
    group: Group,
}

impl Line {
    pub(super) fn is(&self, other: &Line) -> bool {
        self.start == other.start && self.end == other.end
    }

    /// `None` when nothing moves or a number is not finite.
    pub(super) fn new(start: Position, end: Position) -> Option<Line> {
        let mut delta = [0.0; AXES];
        for (axis, delta) in delta.iter_mut().enumerate() {
            *delta = end.0[axis] - start.0[axis];
        }
        let group = Group::from_delta(&delta)?;
        let length = group.norm(&delta);
        delta.iter().all(|x| x.is_finite()).then_some(Line {
            start: start.0,
            end: end.0,
            length,
            group,
        })
    }

    pub(super) fn length(&self) -> f64 {
        self.length
    }

    pub(super) fn group(&self) -> Group {
        self.group
    }

    /// RT.
    pub(super) fn position(&self, s: f64) -> Position {
        // Counted from the nearer end, so that both end points come out as programmed.
        let u = snapped(s / self.length);
        let (base, u) = if u <= 0.5 {
            (&self.start, u)
        } else {
            (&self.end, u - 1.0)
        };
        let mut q = *base;
        for (axis, q) in q.iter_mut().enumerate() {
            *q += (self.end[axis] - self.start[axis]) * u;
        }
        Position(q)
    }

    /// See [`super::Piece::nearest`].
    pub(super) fn nearest(&self, q: &[f64; AXES], [from, to]: [f64; 2]) -> (f64, f64) {
        let (mut along, mut square) = (0.0, 0.0);
        for (q, (start, end)) in q.iter().zip(self.start.iter().zip(self.end.iter())) {
            let delta = end - start;
            along += (q - start) * delta;
            square += delta * delta;
        }
        let s = (along / square * self.length).clamp(from, to);
        (distance(q, &self.position(s).0), s)
    }

    /// RT.
    pub(super) fn jet(&self, s: f64) -> Jet {
        let mut jet = Jet {
            q: self.position(s).0,
            ..Jet::default()
        };
        for axis in 0..AXES {
            jet.d1[axis] = (self.end[axis] - self.start[axis]) / self.length;
        }
        jet
    }
}
