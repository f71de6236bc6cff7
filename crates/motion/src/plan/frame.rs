//! Where the work lies in the machine.
//!
//! In:  offset calls and end points in work coordinates.
//! Out: machine positions by `machine = rotate_xy(work + g92) + g5x + tool`.

use crate::canon::{AXES, Axis, Position};

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
