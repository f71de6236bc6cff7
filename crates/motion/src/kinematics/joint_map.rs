//! Which joint follows which axis: trivial machines and gantries.
//!
//! In:  nine values, one per axis letter. Out: one value per joint, and back. RT.
//!
//! On a trivial machine each axis has a joint of its own. On a gantry an axis has several, side by side, which move alike;
//! where their home switches do not stand square, each joint is set off by its own *squaring offset*:
//! `joint = axis + offset`.

use super::number::Number;
use crate::canon::{AXES, Axis};

/// Most joints that one machine can have.
pub const JOINTS: usize = 16;

/// What one joint follows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Follows {
    /// The axis; `None`: the joint stands at zero.
    pub axis: Option<Axis>,
    /// Squaring offset: how far the joint stands ahead of its axis, mm or degrees.
    pub offset: f64,
}

/// What each joint follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JointMap {
    follows: [Follows; JOINTS],
    count: usize,
}

impl JointMap {
    /// The map of the first [`JOINTS`] entries.
    pub(super) fn new(joints: &[Follows]) -> JointMap {
        let count = joints.len().min(JOINTS);
        let mut follows = [Follows::default(); JOINTS];
        follows[..count].copy_from_slice(&joints[..count]);
        JointMap { follows, count }
    }

    pub(super) fn joints(&self) -> &[Follows] {
        &self.follows[..self.count]
    }

    /// First joint of an axis.
    pub(super) fn joint_of(&self, axis: Axis) -> Option<usize> {
        self.joints().iter().position(|follows| follows.axis == Some(axis))
    }

    /// Joints for axes. RT.
    pub(super) fn inverse<N: Number>(&self, axes: &[N; AXES], joints: &mut [N]) {
        for (joint, follows) in joints.iter_mut().zip(self.joints()) {
            *joint = match follows.axis {
                Some(axis) => axes[axis as usize] + follows.offset,
                None => N::constant(0.0),
            };
        }
    }

    /// Axes for joints: of several joints of an axis the first tells; axes without a joint stand at zero. RT.
    pub(super) fn forward(&self, joints: &[f64]) -> [f64; AXES] {
        let mut axes = [0.0; AXES];
        for (joint, follows) in joints.iter().zip(self.joints()).rev() {
            if let Some(axis) = follows.axis {
                axes[axis as usize] = joint - follows.offset;
            }
        }
        axes
    }
}
