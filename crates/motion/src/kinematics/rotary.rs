//! One rotary axis of a machine: about what, where and which way it turns.

use super::number::Number;
use crate::canon::Axis;

/// Which way a positive angle turns the part that moves, be it table or head, seen along the positive machine axis.
///
/// ISO 841 names motion of the tool against the work-piece: a head turns right-handed, a table left-handed, so that the tool
/// goes round the work right-handed. LinuxCNC's table kinematics (`xyzac-trt`, `xyzbc-trt`) turn tables right-handed, its
/// head kinematics (`5axiskins`) turn B left-handed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    /// As a screw that goes forward.
    Right,
    /// Against it.
    Left,
}

/// A rotary axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotary {
    /// A turns about X, B about Y, C about Z.
    pub axis: RotaryAxis,
    /// Which way a positive angle turns.
    pub hand: Hand,
    /// A point of its centre line with all rotary axes at zero, machine coordinates, mm. The coordinate along the line does
    /// not matter.
    pub centre_mm: [f64; 3],
}

/// The letters that turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RotaryAxis {
    /// About X.
    A,
    /// About Y.
    B,
    /// About Z.
    C,
}

impl RotaryAxis {
    /// Among all axes.
    pub const fn axis(self) -> Axis {
        match self {
            RotaryAxis::A => Axis::A,
            RotaryAxis::B => Axis::B,
            RotaryAxis::C => Axis::C,
        }
    }

    /// The two linear axes that it moves, the first towards the second when it turns right-handed.
    const fn plane(self) -> [usize; 2] {
        match self {
            RotaryAxis::A => [1, 2],
            RotaryAxis::B => [2, 0],
            RotaryAxis::C => [0, 1],
        }
    }
}

impl Rotary {
    /// Turns a direction by this axis at an angle. RT.
    pub(super) fn rotate<N: Number>(&self, degrees: N, mut vector: [N; 3]) -> [N; 3] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let sin = match self.hand {
            Hand::Right => sin,
            Hand::Left => -sin,
        };
        let [i, j] = self.axis.plane();
        (vector[i], vector[j]) = (cos * vector[i] - sin * vector[j], sin * vector[i] + cos * vector[j]);
        vector
    }

    /// Turns a point about the centre line. RT.
    pub(super) fn turn_point<N: Number>(&self, degrees: N, point: [N; 3]) -> [N; 3] {
        let centre = self.centre_mm;
        let [x, y, z] = self.rotate(
            degrees,
            [point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]],
        );
        [x + centre[0], y + centre[1], z + centre[2]]
    }
}
