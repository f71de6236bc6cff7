//! Five axes with both rotary axes under the work: a trunnion (A or B) that carries a rotary table (C), say.
//!
//! The *primary* axis stands on the machine and carries the *secondary* one, on which the work is clamped. With
//! tool-centre-point control (p: tip on the work, work and machine coordinates the same while both stand at zero; L: tool):
//!
//! ```text
//! tip     = turn1(turn2(p))            each about its own centre line, as it lies with both at zero
//! X, Y, Z of the joints = tip + L z    the spindle stands upright, whatever the table does
//! ```
//!
//! A programmed Z counts the tool's length, as after G43: axes = p + L z. At zero angles joints are axes, with any tool.
//!
//! Offsets between the rotary axes are in their centres. In the terms of LinuxCNC's `xyzac-trt`: the centre of C is
//! (x-rot-point, y-rot-point), that of A (y-rot-point + y-offset, z-rot-point + z-offset); both [`Hand::Right`].
//!
//! [`Hand::Right`]: super::Hand::Right

use super::ToolFrame;
use super::number::Number;
use super::rotary::Rotary;
use crate::canon::AXES;

/// Both rotary axes of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableTable {
    /// Stands on the machine.
    pub primary: Rotary,
    /// Is carried by the primary one and carries the work.
    pub secondary: Rotary,
}

impl TableTable {
    /// Joints for axes with tool-centre-point control. RT.
    pub(super) fn inverse<N: Number>(&self, frame: &ToolFrame, axes: &mut [N; AXES]) {
        let [x, y, z, ..] = *axes;
        let on_work = [x, y, z - frame.length_mm];
        let on_trunnion = self
            .secondary
            .turn_point(axes[self.secondary.axis.axis() as usize], on_work);
        let tip = self
            .primary
            .turn_point(axes[self.primary.axis.axis() as usize], on_trunnion);
        (axes[0], axes[1], axes[2]) = (tip[0], tip[1], tip[2] + frame.length_mm);
    }

    /// Axes for joints with tool-centre-point control. RT.
    pub(super) fn forward(&self, frame: &ToolFrame, axes: &mut [f64; AXES]) {
        let [x, y, z, ..] = *axes;
        let tip = [x, y, z - frame.length_mm];
        let on_trunnion = self.primary.turn_point(-axes[self.primary.axis.axis() as usize], tip);
        let on_work = self
            .secondary
            .turn_point(-axes[self.secondary.axis.axis() as usize], on_trunnion);
        (axes[0], axes[1], axes[2]) = (on_work[0], on_work[1], on_work[2] + frame.length_mm);
    }
}
