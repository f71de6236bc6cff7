//! Curves: G5, G5.1, G5.2 and G6.2 as pieces of path.
//!
//! In:  control points of a NURBS in its plane, weights, order, knots.
//! Out: lines and quintics in machine coordinates that follow it within [`fit::TOLERANCE_MM`] and have no jump of direction or
//! curvature but those of the curve itself.
//!
//! ```text
//! bezier  the curve between two knots, and what its control points tell about it
//! fit     quintics along it
//! ```

mod bezier;
mod fit;

use crate::canon::{AXES, Position};
use crate::path::{BlendEnd, Group, Jet, Piece};
use fit::{End, Part};

/// Greatest order of a curve: degree 31. Work goes with its third power.
pub(super) const ORDER_MAX: u32 = 32;

/// Why there are no pieces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// Order or number of points, a weight, or the knots.
    Malformed,
    NotFinite,
    /// It would take too many pieces.
    Wild,
}

/// How the plane of a curve lies in the machine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// Machine position of the first control point.
    pub(super) start: Position,
    /// Unit vectors of the plane's axes in the machine.
    pub(super) first: [f64; 3],
    pub(super) second: [f64; 3],
}

/// Pieces along a curve, which ends at `end`; none if all control points are one.
pub(super) fn pieces(
    points: &[([f64; 2], f64)],
    order: u32,
    knots: &[f64],
    plane: &Plane,
    end: &Position,
) -> Result<Vec<Piece>, Fault> {
    let Some(((origin, _), order)) = points.first().zip(usize::try_from(order).ok()) else {
        return Err(Fault::Malformed);
    };
    if order < 2 || order > ORDER_MAX as usize || points.len() < order {
        return Err(Fault::Malformed);
    }
    let local: Vec<([f64; 2], f64)> = points.iter().map(|(at, w)| (bezier::minus(at, origin), *w)).collect();
    if !local
        .iter()
        .all(|(at, w)| at[0].is_finite() && at[1].is_finite() && w.is_finite())
    {
        return Err(Fault::NotFinite);
    }
    if local.iter().any(|(_, w)| *w <= 0.0) {
        return Err(Fault::Malformed);
    }
    let knots = bezier::knots(local.len(), order, knots).ok_or(Fault::Malformed)?;
    let parts = fit::follow(bezier::spans(&local, order, &knots)).ok_or(Fault::Wild)?;
    let last = parts.len().saturating_sub(1);
    let piece = |(index, part): (usize, &Part)| {
        // The ends of the whole are what others continue from: not a digit off.
        let exact = |place: Position, other: usize, as_is: &Position| if index == other { *as_is } else { place };
        match part {
            Part::Line { from, to } => Piece::line(
                exact(plane.place(from), 0, &plane.start),
                exact(plane.place(to), last, end),
            ),
            Part::Quintic { from, to } => {
                let mut ends = [plane.end(from), plane.end(to)];
                ends[0].leg.q = exact(Position(ends[0].leg.q), 0, &plane.start).0;
                ends[1].leg.q = exact(Position(ends[1].leg.q), last, end).0;
                Piece::blend(&ends[0], &ends[1], Group::Main)
            }
        }
    };
    parts
        .iter()
        .enumerate()
        .map(piece)
        .collect::<Option<_>>()
        .ok_or(Fault::NotFinite)
}

impl Plane {
    fn turned(&self, vector: &[f64; 2]) -> [f64; AXES] {
        let mut turned = [0.0; AXES];
        for (axis, x) in turned[..3].iter_mut().enumerate() {
            *x = vector[0] * self.first[axis] + vector[1] * self.second[axis];
        }
        turned
    }

    fn place(&self, q: &[f64; 2]) -> Position {
        let arm = self.turned(q);
        Position(std::array::from_fn(|axis| self.start.0[axis] + arm[axis]))
    }

    fn end(&self, end: &End) -> BlendEnd {
        BlendEnd {
            leg: Jet {
                q: self.place(&end.q).0,
                d1: self.turned(&end.d1),
                d2: self.turned(&end.d2),
                d3: [0.0; AXES],
            },
            pace: end.pace,
            pace_change: end.pace_change,
        }
    }
}

#[cfg(test)]
mod tests;
