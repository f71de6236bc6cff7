//! Axis positions to joint positions and back. RT.

use crate::canon::{Axis, Position};

/// Which axis each joint follows: one joint per axis, or several (gantry).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kinematics {
    axis_of_joint: Box<[Option<Axis>]>,
}

impl Kinematics {
    /// Each joint follows one axis; a joint without one stands at zero.
    pub fn trivial(axis_of_joint: &[Option<Axis>]) -> Kinematics {
        Kinematics {
            axis_of_joint: axis_of_joint.into(),
        }
    }

    /// Joint positions for an axis position. RT.
    pub fn inverse(&self, position: &Position, joints: &mut [f64]) {
        for (joint, axis) in joints.iter_mut().zip(&self.axis_of_joint) {
            *joint = axis.map_or(0.0, |axis| position[axis]);
        }
    }

    /// Axis position for joint positions: of several joints of an axis the first tells. RT.
    pub fn forward(&self, joints: &[f64]) -> Position {
        let mut position = Position::ZERO;
        for (joint, axis) in joints.iter().zip(&self.axis_of_joint).rev() {
            if let Some(axis) = axis {
                position[*axis] = *joint;
            }
        }
        position
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gantry_moves_both_joints_and_is_read_from_the_first() {
        let kinematics = Kinematics::trivial(&[Some(Axis::X), Some(Axis::Y), Some(Axis::Y), Some(Axis::Z)]);
        let mut joints = [0.0; 4];
        kinematics.inverse(&Position::xyz(1.0, 2.0, 3.0), &mut joints);
        assert_eq!(joints, [1.0, 2.0, 2.0, 3.0]);
        assert_eq!(kinematics.forward(&[1.0, 2.0, 2.5, 3.0]), Position::xyz(1.0, 2.0, 3.0));
    }
}
