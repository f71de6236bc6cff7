//! The programmed contour, one move at a time.
//!
//! In:  a programmed move in the plane.
//! Out: its directions at both ends, and the curve of a tool's centre beside it.

use super::NEGLIGIBLE_MM;
use super::geometry::{Curve, Point, add, left, length, scale, sub, unit};

/// A move of the program that goes somewhere in the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contour {
    pub(super) from: Point,
    pub(super) to: Point,
    pub(super) shape: Shape,
}

/// Line or arc.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    Line,
    Arc { centre: Point, turns: i32 },
}

impl Shape {
    /// +1: a counter-clockwise arc, -1: a clockwise one, 0: a line.
    pub(super) fn turn_sign(self) -> f64 {
        match self {
            Shape::Line => 0.0,
            Shape::Arc { turns, .. } => f64::from(turns.signum()),
        }
    }
}

impl Contour {
    /// Whether it is a line that goes nowhere in the plane.
    pub(super) fn is_still(&self) -> bool {
        matches!(self.shape, Shape::Line) && length(sub(self.to, self.from)) < NEGLIGIBLE_MM
    }

    /// Unit vector of the motion at the start.
    pub(super) fn tangent_at_start(&self) -> Point {
        self.tangent(self.from)
    }

    /// Unit vector of the motion at the end.
    pub(super) fn tangent_at_end(&self) -> Point {
        self.tangent(self.to)
    }

    fn tangent(&self, at: Point) -> Point {
        match self.shape {
            Shape::Line => unit(sub(self.to, self.from)),
            Shape::Arc { centre, .. } => scale(left(unit(sub(at, centre))), self.shape.turn_sign()),
        }
    }

    /// Radius at the end; an endless line has none.
    pub(super) fn radius(&self) -> Option<f64> {
        match self.shape {
            Shape::Line => None,
            Shape::Arc { centre, .. } => Some(length(sub(self.to, centre))),
        }
    }

    /// From the start to where it would be at the radius of the end. The two radii of an arc differ by what its numbers are
    /// rounded to, and its curve has that of the end.
    pub(super) fn start_to_curve(&self) -> Point {
        match (self.shape, self.radius()) {
            (Shape::Arc { centre, .. }, Some(radius)) => {
                let arm = sub(self.from, centre);
                scale(arm, radius / length(arm) - 1.0)
            }
            (Shape::Arc { .. } | Shape::Line, _) => [0.0; 2],
        }
    }

    /// Whether a tool on `side` goes inside the circle of the arc: left of a counter-clockwise one, right of a clockwise one.
    pub(super) fn is_around_tool(&self, side: f64) -> bool {
        self.shape.turn_sign() == side
    }

    /// Whether a tool on `side` goes around the outside of the arc.
    pub(super) fn is_before_tool(&self, side: f64) -> bool {
        self.shape.turn_sign() == -side
    }

    /// Curve of the centre of a tool that touches the move from the left at a distance of `offset` (right: negative).
    pub(super) fn beside(&self, offset: f64) -> Curve {
        match self.shape {
            Shape::Line => {
                let tangent = self.tangent_at_start();
                Curve::Line {
                    through: add(self.from, scale(left(tangent), offset)),
                    tangent,
                }
            }
            Shape::Arc { centre, .. } => {
                let turn = self.shape.turn_sign();
                // The left of a counter-clockwise arc is its inside: the centre's circle is smaller there.
                // Where it is smaller than nothing the centre is on the far side of the circle's.
                let radius = (length(sub(self.to, centre)) - turn * offset).abs();
                Curve::Circle { centre, radius, turn }
            }
        }
    }
}
