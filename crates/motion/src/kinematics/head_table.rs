//! Five axes with one rotary axis in the head and one under the work: a swivelling head (A or B) over a rotary table (C), say.
//!
//! The linear joints carry the head's pivot. With the head upright, the spindle nose lies `pivot_mm` from the pivot, and the
//! joints are those of the spindle nose. With tool-centre-point control (p: tip on the work, work and machine coordinates
//! the same while the table stands at zero; L: tool; o: from the spindle nose to the pivot):
//!
//! ```text
//! tip     = turn_table(p)                          about the centre line of the table
//! pivot   = tip + turn_head(o + L z)
//! X, Y, Z of the joints = pivot - o
//! ```
//!
//! A programmed Z counts the tool's length, as after G43: axes = p + L z. At zero angles joints are axes, with any tool.
//! LinuxCNC's `5axiskins` has the pivot length, too; its B turns [`Hand::Left`](super::Hand::Left).

use super::ToolFrame;
use super::number::Number;
use super::rotary::Rotary;
use crate::canon::AXES;

/// Head and table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadTable {
    /// The head. Its centre does not matter: where its pivot is, joints say.
    pub head: Rotary,
    /// From the spindle nose to the pivot with the head upright, mm: (0, 0, pivot length), say.
    pub pivot_mm: [f64; 3],
    /// The table that carries the workpiece.
    pub table: Rotary,
}

impl HeadTable {
    /// From the tip to the pivot, head turned, less the same from the spindle nose, head upright. RT.
    fn lever<N: Number>(&self, degrees: N, length_mm: f64) -> [N; 3] {
        let [x, y, z] = self.pivot_mm;
        let turned = self.head.rotate(degrees, [x, y, z + length_mm].map(N::constant));
        [turned[0] - x, turned[1] - y, turned[2] - z]
    }

    /// Joints for axes with tool-centre-point control. RT.
    pub(super) fn inverse<N: Number>(&self, frame: &ToolFrame, axes: &mut [N; AXES]) {
        let [x, y, z, ..] = *axes;
        let on_work = [x, y, z - frame.length_mm];
        let tip = self.table.turn_point(axes[self.table.axis.axis() as usize], on_work);
        let lever = self.lever(axes[self.head.axis.axis() as usize], frame.length_mm);
        for k in 0..3 {
            axes[k] = tip[k] + lever[k];
        }
    }

    /// Axes for joints with tool-centre-point control. RT.
    pub(super) fn forward(&self, frame: &ToolFrame, axes: &mut [f64; AXES]) {
        let lever = self.lever(axes[self.head.axis.axis() as usize], frame.length_mm);
        let tip = [0, 1, 2].map(|k| axes[k] - lever[k]);
        let on_work = self.table.turn_point(-axes[self.table.axis.axis() as usize], tip);
        (axes[0], axes[1], axes[2]) = (on_work[0], on_work[1], on_work[2] + frame.length_mm);
    }
}
