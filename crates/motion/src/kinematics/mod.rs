//! Axis positions to joint positions and back.
//!
//! In:  positions of the nine axes, plain ([`Position`]) or with derivatives by path length ([`Jet`]), and how the tool is
//!      held ([`ToolFrame`]).
//! Out: one value per joint, likewise plain or with derivatives ([`Jet3`]); and positions of the axes for joints.
//!
//! The planner and the cycle thread use the same [`Kinematics::inverse`], generic over [`Number`]: what is planned with
//! derivatives is what runs. RT: nothing here allocates, panics or loops without bound.
//!
//! A map has two steps. The *transform* of the family gives one value per axis letter; on a trivial machine these are the
//! axes themselves. Then each joint follows the value of one letter, several the same on a gantry ([`Follows`]). Which
//! joint is which part of a machine is therefore said by letters everywhere:
//!
//! | family | X | Y | Z | A B C | derivations in |
//! |---|---|---|---|---|---|
//! | trivial, gantry | X | Y | Z | as programmed | `joint_map.rs` |
//! | CoreXY | first motor | second motor | Z | as programmed | `corexy.rs` |
//! | table-table, head-table | X | Y | Z | as programmed | `table_table.rs`, `head_table.rs` |
//! | SCARA | shoulder | elbow | Z | C: wrist | `scara.rs` |
//! | linear delta | carriage 1 | carriage 2 | carriage 3 | as programmed | `linear_delta.rs` |
//!
//! Rotary axes are programmed as angles, never as tool vectors: table-table and head-table machines therefore have no
//! singularity of their own. A tip far from a centre line moves the linear joints fast, and their limits slow it down.

mod corexy;
mod head_table;
mod joint_map;
mod linear_delta;
mod number;
mod rotary;
mod scara;
mod table_table;
#[cfg(test)]
mod tests;

use crate::canon::{AXES, Axis, Position};
use crate::path::Jet;
use std::fmt;

pub use head_table::HeadTable;
use joint_map::JointMap;
pub use joint_map::{Follows, JOINTS};
pub use linear_delta::LinearDelta;
pub use number::{Jet3, Number};
pub use rotary::{Hand, Rotary, RotaryAxis};
pub use scara::{Elbow, Scara};
pub use table_table::TableTable;

/// A reason, for messages.
type Why = &'static str;

/// How the tool is held and what the programmed point is: all that the inverse needs besides the axes. Holds for a move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolFrame {
    /// Tool-centre-point control: X Y Z are those of the tool's tip on the work-piece, wherever the rotary axes stand.
    /// Without it, X Y Z are what the linear joints do.
    pub tcp: bool,
    /// Length of the tool, mm, by which a programmed Z lies above the tip. Only with `tcp` does the inverse need it.
    pub length_mm: f64,
}

impl ToolFrame {
    /// Without tool-centre-point control.
    pub const OFF: ToolFrame = ToolFrame {
        tcp: false,
        length_mm: 0.0,
    };
}

/// A position that the machine cannot take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreachable {
    /// The joint that cannot follow.
    pub joint: usize,
    /// Why, for messages: "the arms are too short", say.
    pub why: &'static str,
}

impl fmt::Display for Unreachable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "joint {} cannot follow: {}", self.joint, self.why)
    }
}

impl std::error::Error for Unreachable {}

/// The family of a machine, with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    /// Each axis moves joints of its own.
    Trivial,
    /// X and Y by two motors that stand still.
    CoreXy,
    /// Both rotary axes under the work.
    TableTable(TableTable),
    /// One rotary axis in the head, one under the work.
    HeadTable(HeadTable),
    /// Two arms that swing.
    Scara(Scara),
    /// Three carriages with rods.
    LinearDelta(LinearDelta),
}

/// From axes to joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    transform: Transform,
    map: JointMap,
}

impl Kinematics {
    /// A machine of a family; `joints` says, joint by joint, which letter each follows. There are [`JOINTS`] at most.
    pub fn new(transform: Transform, joints: &[Follows]) -> Kinematics {
        Kinematics {
            transform,
            map: JointMap::new(joints),
        }
    }

    /// Each joint follows one axis, several the same on a gantry; a joint without one stands at zero.
    pub fn trivial(axis_of_joint: &[Option<Axis>]) -> Kinematics {
        let mut joints = [Follows::default(); JOINTS];
        for (joint, axis) in joints.iter_mut().zip(axis_of_joint) {
            joint.axis = *axis;
        }
        Kinematics::new(Transform::Trivial, &joints[..axis_of_joint.len().min(JOINTS)])
    }

    /// The transform between axes and joints.
    pub fn transform(&self) -> &Transform {
        &self.transform
    }

    /// What each joint follows; as many as there are joints.
    pub fn joints(&self) -> &[Follows] {
        self.map.joints()
    }

    /// First joint that follows an axis.
    pub fn joint_of(&self, axis: Axis) -> Option<usize> {
        self.map.joint_of(axis)
    }

    /// Whether positions of a joint are degrees and not millimetres.
    pub fn is_rotary(&self, joint: usize) -> bool {
        let Some(axis) = self.map.joints().get(joint).and_then(|follows| follows.axis) else {
            return false;
        };
        let swings = matches!(self.transform, Transform::Scara(_)) && matches!(axis, Axis::X | Axis::Y);
        swings || axis.is_rotary()
    }

    /// Whether each joint just follows its axis under this frame.
    pub fn is_trivial(&self, frame: &ToolFrame) -> bool {
        match self.transform {
            Transform::Trivial => true,
            Transform::TableTable(_) | Transform::HeadTable(_) => !frame.tcp,
            Transform::CoreXy | Transform::Scara(_) | Transform::LinearDelta(_) => false,
        }
    }

    /// Whether joints are a linear function of the axes under this frame: then a straight line of the axes is one of the
    /// joints, too.
    pub fn is_linear(&self, frame: &ToolFrame) -> bool {
        match self.transform {
            Transform::Trivial | Transform::CoreXy => true,
            Transform::TableTable(_) | Transform::HeadTable(_) => !frame.tcp,
            Transform::Scara(_) | Transform::LinearDelta(_) => false,
        }
    }

    /// Whether tool-centre-point control can be switched on.
    pub fn has_tcp(&self) -> bool {
        match self.transform {
            Transform::TableTable(_) | Transform::HeadTable(_) => true,
            Transform::Trivial | Transform::CoreXy | Transform::Scara(_) | Transform::LinearDelta(_) => false,
        }
    }

    /// Joints for axes. On an error, `joints` are left as they were. RT.
    ///
    /// # Errors
    /// The machine cannot take this position.
    pub fn inverse<N: Number>(&self, frame: &ToolFrame, axes: &[N; AXES], joints: &mut [N]) -> Result<(), Unreachable> {
        if self.is_trivial(frame) {
            self.map.inverse(axes, joints);
            return Ok(());
        }
        let letters = self.letters(frame, axes)?;
        self.map.inverse(&letters, joints);
        Ok(())
    }

    /// The first step of the inverse: what the joints of each letter follow.
    fn letters<N: Number>(&self, frame: &ToolFrame, axes: &[N; AXES]) -> Result<[N; AXES], Unreachable> {
        let mut letters = *axes;
        let result = match &self.transform {
            Transform::Trivial => Ok(()),
            Transform::CoreXy => {
                corexy::inverse(&mut letters);
                Ok(())
            }
            Transform::TableTable(table) => {
                if frame.tcp {
                    table.inverse(frame, &mut letters);
                }
                Ok(())
            }
            Transform::HeadTable(head) => {
                if frame.tcp {
                    head.inverse(frame, &mut letters);
                }
                Ok(())
            }
            Transform::Scara(scara) => scara.inverse(&mut letters),
            Transform::LinearDelta(delta) => delta.inverse(&mut letters),
        };
        match result {
            Ok(()) => Ok(letters),
            Err((letter, why)) => Err(Unreachable {
                joint: self.map.joint_of(Axis::ALL[letter]).unwrap_or(0),
                why,
            }),
        }
    }

    /// Joints with their derivatives by path length for a state of the path. On an error, `joints` hold nothing of use. RT.
    ///
    /// # Errors
    /// The machine cannot take this position, or cannot leave it in a finite time.
    pub fn jets(&self, frame: &ToolFrame, jet: &Jet, joints: &mut [Jet3]) -> Result<(), Unreachable> {
        let axes = std::array::from_fn(|k| Jet3::new(jet.q[k], jet.d1[k], jet.d2[k], jet.d3[k]));
        self.inverse(frame, &axes, joints)?;
        if self.is_linear(frame) {
            return Ok(());
        }
        match joints.iter().position(|joint| !joint.is_finite()) {
            None => Ok(()),
            Some(joint) => Err(Unreachable {
                joint,
                why: "the position is singular, so that a move through it would take for ever",
            }),
        }
    }

    /// Axes for joints; `None` where no position of the axes belongs to them. RT.
    pub fn forward(&self, frame: &ToolFrame, joints: &[f64]) -> Option<Position> {
        let mut axes = self.map.forward(joints);
        match &self.transform {
            Transform::Trivial => {}
            Transform::CoreXy => corexy::forward(&mut axes),
            Transform::TableTable(table) => {
                if frame.tcp {
                    table.forward(frame, &mut axes);
                }
            }
            Transform::HeadTable(head) => {
                if frame.tcp {
                    head.forward(frame, &mut axes);
                }
            }
            Transform::Scara(scara) => {
                scara.forward(&mut axes);
                if self.map.joint_of(Axis::C).is_none() {
                    axes[Axis::C as usize] = 0.0;
                }
            }
            Transform::LinearDelta(delta) => delta.forward(&mut axes)?,
        }
        Some(Position(axes))
    }

    /// Why joints must move fast near a position, in words; `None` where nothing is singular nearby.
    pub fn singularity(&self, frame: &ToolFrame, position: &Position) -> Option<&'static str> {
        match &self.transform {
            Transform::Trivial | Transform::CoreXy | Transform::TableTable(_) | Transform::HeadTable(_) => None,
            Transform::Scara(scara) => match self.letters(frame, &position.0) {
                Ok(joints) => scara.singularity(&joints),
                Err(unreachable) => Some(unreachable.why),
            },
            Transform::LinearDelta(delta) => match self.letters(frame, &position.0) {
                Ok(joints) => delta.singularity(&joints, position[Axis::Z]),
                Err(unreachable) => Some(unreachable.why),
            },
        }
    }

    /// Where the axes are under another frame while no joint moves.
    ///
    /// # Errors
    /// The machine cannot take this position.
    pub fn reframe(&self, position: &Position, from: &ToolFrame, to: &ToolFrame) -> Result<Position, Unreachable> {
        if !(from.tcp || to.tcp) || !self.has_tcp() {
            return Ok(*position);
        }
        let mut joints = [0.0; JOINTS];
        let joints = &mut joints[..self.map.joints().len()];
        self.inverse(from, &position.0, joints)?;
        self.forward(to, joints).ok_or(Unreachable {
            joint: 0,
            why: "no position of the axes belongs to the joints",
        })
    }
}
