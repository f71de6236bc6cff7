//! Offsets: work systems and their rotation, G92 and G52, tool lengths.
//!
//! In:  an offset that a call sets, mm and degrees, and those that the reader of the text has.
//! Out: G10 L2 and G54 to G59.3, G52, G43.1 and G49, with the axes that change; the axes stay where they are in the
//!      machine, so their work coordinates are others behind it.

use super::{FlatWriter, SAME_MM_OR_DEGREES, Unwritable};
use crate::state::Offsets;
use motion::canon::{Axis, Position};

impl FlatWriter {
    pub(super) fn g5x(&mut self, system: u8, origin: Position) -> Result<(), Unwritable> {
        let system = system.clamp(1, 9);
        let index = usize::from(system) - 1;
        self.line.begin("G10 L2").word('P', system);
        let changed = self.push_changed(self.origins[index], origin);
        if changed {
            self.end_line()?;
        }
        self.origins[index] = origin;
        if system != self.offsets.system {
            const CODES: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
            self.plain(CODES[index])?;
        }
        self.set_offsets(Offsets {
            system,
            g5x: origin,
            rotation_degrees: self.rotations_degrees[index],
            ..self.offsets
        });
        Ok(())
    }

    pub(super) fn rotation(&mut self, degrees: f64) -> Result<(), Unwritable> {
        let known = &mut self.rotations_degrees[usize::from(self.offsets.system) - 1];
        if (*known - degrees).abs() > SAME_MM_OR_DEGREES {
            *known = degrees;
            let system = self.offsets.system;
            self.line.begin("G10 L2").word('P', system).word('R', degrees);
            self.end_line()?;
        }
        self.set_offsets(Offsets {
            rotation_degrees: degrees,
            ..self.offsets
        });
        Ok(())
    }

    pub(super) fn g92(&mut self, offset: Position) -> Result<(), Unwritable> {
        self.line.begin("G52");
        if self.push_changed(self.offsets.g92, offset) {
            self.end_line()?;
        }
        self.set_offsets(Offsets {
            g92: offset,
            ..self.offsets
        });
        Ok(())
    }

    pub(super) fn tool_length(&mut self, offset: Position) -> Result<(), Unwritable> {
        let old = self.offsets.tool;
        if offset == Position::ZERO {
            self.plain("G49")?;
        } else {
            self.line.begin("G43.1");
            if self.push_changed(old, offset) {
                self.end_line()?;
            }
        }
        self.set_offsets(Offsets {
            tool: offset,
            ..self.offsets
        });
        Ok(())
    }

    /// Adds words for the axes on which two positions differ; whether there are any.
    pub(super) fn push_changed(&mut self, old: Position, new: Position) -> bool {
        let mut any = false;
        for axis in Axis::ALL {
            // Not finite: refused when the line is written.
            if (new[axis] - old[axis]).abs() > SAME_MM_OR_DEGREES || !new[axis].is_finite() {
                self.line.word(axis.letter(), new[axis]);
                any = true;
            }
        }
        any
    }

    /// The axes stay where they are in the machine, and read otherwise.
    fn set_offsets(&mut self, offsets: Offsets) {
        let old = self.offsets;
        let machine = old.machine(self.at);
        self.offsets = offsets;
        self.at = offsets.work(machine);
        let turned = old.rotation_degrees != 0.0 || offsets.rotation_degrees != 0.0;
        for axis in Axis::ALL {
            let shifts = [old, offsets].iter().any(|offsets| {
                [offsets.g5x, offsets.g92, offsets.tool]
                    .iter()
                    .any(|offset| offset[axis] != 0.0)
            });
            // What the reader of the text comes to may differ in the last bit.
            if shifts || (turned && matches!(axis, Axis::X | Axis::Y)) {
                self.known[axis as usize] = false;
            }
        }
    }
}
