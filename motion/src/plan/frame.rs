//! Where the work lies in the machine, and whether a move stays inside it.
//!
//! In:  offset calls and end points in work coordinates.
//! Out: machine positions by `machine = rotate_xy(work + g92) + g5x + tool`, or the axis that would leave its travel.

use super::{AxisLimits, PlanErrorKind};
use crate::canon::{AXES, Axis, Position};
use crate::path::{Piece, Shape};

/// Work coordinate system in the machine.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Frame {
    pub(super) g5x: Position,
    pub(super) g92: Position,
    pub(super) tool: Position,
    rotation_deg: f64,
    /// Sine and cosine of the rotation.
    turn: Option<(f64, f64)>,
}

impl Frame {
    pub(super) fn rotate(&mut self, degrees: f64) {
        self.rotation_deg = degrees;
        self.turn = (degrees != 0.0).then(|| libm::sincos(degrees.to_radians()));
    }

    /// Turns the XY part of a vector into machine directions.
    pub(super) fn turned(&self, mut vector: [f64; 3]) -> [f64; 3] {
        if let Some((sin, cos)) = self.turn {
            (vector[0], vector[1]) = (vector[0] * cos - vector[1] * sin, vector[0] * sin + vector[1] * cos);
        }
        vector
    }

    /// A work axis of X, Y and Z as a machine direction.
    pub(super) fn direction(&self, axis: Axis) -> [f64; 3] {
        let mut unit = [0.0; 3];
        unit[axis as usize] = 1.0;
        self.turned(unit)
    }

    pub(super) fn machine(&self, work: &Position) -> Position {
        let shifted: [f64; AXES] = core::array::from_fn(|axis| work.0[axis] + self.g92.0[axis]);
        let turned = self.turned([shifted[0], shifted[1], shifted[2]]);
        Position(core::array::from_fn(|axis| {
            turned.get(axis).copied().unwrap_or(shifted[axis]) + self.g5x.0[axis] + self.tool.0[axis]
        }))
    }

    /// The other way.
    pub(super) fn work(&self, machine: &Position) -> Position {
        let mut shifted: [f64; AXES] =
            core::array::from_fn(|axis| machine.0[axis] - self.g5x.0[axis] - self.tool.0[axis]);
        if let Some((sin, cos)) = self.turn {
            (shifted[0], shifted[1]) = (shifted[0] * cos + shifted[1] * sin, shifted[1] * cos - shifted[0] * sin);
        }
        Position(core::array::from_fn(|axis| shifted[axis] - self.g92.0[axis]))
    }
}

/// Whether every axis that moves along `piece` exists.
pub(super) fn check_axes(piece: &Piece, limits: &[Option<AxisLimits>; AXES]) -> Result<(), PlanErrorKind> {
    let (start, end) = (piece.position(0.0), piece.position(piece.length()));
    let moved = |axis: &Axis| {
        // An arc computes its end by trigonometry, so that an axis at rest may show rounding.
        let k = *axis as usize;
        limits[k].is_none() && (end.0[k] - start.0[k]).abs() > 1e-9
    };
    match Axis::ALL.into_iter().find(moved) {
        Some(axis) => Err(PlanErrorKind::NoSuchAxis { axis }),
        None => Ok(()),
    }
}

/// Whether every axis exists and stays inside its travel all along `piece`, which begins inside.
pub(super) fn check_travel(piece: &Piece, limits: &[Option<AxisLimits>; AXES]) -> Result<(), PlanErrorKind> {
    check_axes(piece, limits)?;
    let end = piece.position(piece.length());
    for axis in Axis::ALL {
        let k = axis as usize;
        let Some(limits) = limits[k] else { continue };
        within(axis, end.0[k], &limits)?;
        let (low, high) = match piece.shape() {
            Shape::Line(_) => continue,
            Shape::Arc(arc) => arc.reach(k),
            Shape::Blend(blend) => blend.reach(k),
        };
        within(axis, low, &limits)?;
        within(axis, high, &limits)?;
    }
    Ok(())
}

fn within(axis: Axis, value: f64, limits: &AxisLimits) -> Result<(), PlanErrorKind> {
    // What rounding adds to a position programmed at the limit is no excess.
    const ROUNDING: f64 = 1e-6;
    let [low, high] = limits.travel;
    let limit = if value < low - ROUNDING {
        low
    } else if value > high + ROUNDING {
        high
    } else {
        return Ok(());
    };
    Err(PlanErrorKind::Travel { axis, value, limit })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::Circle;

    #[test]
    fn offsets_add_up_in_the_order_of_the_formula() {
        let mut frame = Frame {
            g5x: Position::xyz(100.0, 200.0, 300.0),
            g92: Position::xyz(1.0, 2.0, 3.0),
            tool: Position::xyz(0.0, 0.0, 50.0),
            ..Frame::default()
        };
        frame.rotate(90.0);
        let got = frame.machine(&Position::xyz(10.0, 20.0, 30.0));
        for (got, want) in got.0.iter().zip([100.0 - 22.0, 200.0 + 11.0, 383.0]) {
            assert!((got - want).abs() < 1e-12);
        }
        for (back, there) in frame.work(&got).0.iter().zip([10.0, 20.0, 30.0]) {
            assert!((back - there).abs() < 1e-12);
        }
        frame.rotate(0.0);
        assert_eq!(frame.machine(&Position::ZERO), Position::xyz(101.0, 202.0, 353.0));
        frame.rotate(30.0);
        let there = Position::xyz(10.0, 20.0, 30.0);
        for (got, want) in frame.work(&frame.machine(&there)).0.iter().zip(there.0) {
            assert!((got - want).abs() < 1e-12);
        }
    }

    #[test]
    fn an_arc_may_leave_the_travel_between_its_ends() {
        let limits = |travel| AxisLimits {
            velocity: 1.0,
            acceleration: 1.0,
            jerk: 1.0,
            travel,
        };
        let mut axes = [None; AXES];
        axes[0] = Some(limits([-20.0, 20.0]));
        axes[1] = Some(limits([-20.0, 4.9]));
        // Half a turn counter-clockwise from (5, 0) to (-5, 0) rises to Y5.
        let circle = Circle {
            start: Position::xyz(5.0, 0.0, 0.0),
            end: Position::xyz(-5.0, 0.0, 0.0),
            centre_mm: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: std::f64::consts::PI,
        };
        let piece = Piece::arc(&circle).unwrap();
        let PlanErrorKind::Travel { axis, value, limit } = check_travel(&piece, &axes).unwrap_err() else {
            panic!("travel expected");
        };
        assert_eq!((axis, limit), (Axis::Y, 4.9));
        assert!((value - 5.0).abs() < 1e-12);
        axes[1] = Some(limits([-20.0, 5.0]));
        assert_eq!(check_travel(&piece, &axes), Ok(()));
        axes[0] = None;
        assert_eq!(
            check_travel(&piece, &axes),
            Err(PlanErrorKind::NoSuchAxis { axis: Axis::X })
        );
    }
}
