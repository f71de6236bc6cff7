//! Which pocket of the tool changer holds which tool, as the machine itself knows it: a random changer exchanges two at each change.
//!
//! In:  the tool table, before a program; changes as they are done.
//! Out: the pocket of a tool, for the changer. RT but where it says otherwise.

use gcode::{TOOLS_MAX, Tool, ToolChanger, ToolTable};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// Tools and pockets.
#[derive(Debug)]
pub struct ToolPockets {
    is_random: AtomicBool,
    /// One more than the number of a tool, above its pocket; the first 0 is the end.
    entries: Box<[AtomicU64]>,
}

impl Default for ToolPockets {
    fn default() -> ToolPockets {
        ToolPockets {
            is_random: AtomicBool::new(false),
            entries: (0..TOOLS_MAX).map(|_| AtomicU64::new(0)).collect(),
        }
    }
}

const fn entry(tool: u32, pocket: u32) -> u64 {
    (tool as u64 + 1) << 32 | pocket as u64
}

impl ToolPockets {
    /// Takes those of a table; while no program runs. Not RT.
    pub fn set(&self, table: &ToolTable) {
        self.is_random.store(table.changer() == ToolChanger::Random, Relaxed);
        let known = table.tools().map(|Tool { number, pocket, .. }| entry(*number, *pocket));
        for (cell, value) in self.entries.iter().zip(known.chain(std::iter::repeat(0))) {
            cell.store(value, Relaxed);
        }
    }

    fn known(&self) -> impl Iterator<Item = (&AtomicU64, u32, u32)> {
        let entries = self.entries.iter().map(|cell| (cell, cell.load(Relaxed)));
        entries
            .take_while(|(_, value)| *value != 0)
            .map(|(cell, value)| (cell, ((value >> 32) - 1) as u32, value as u32))
    }

    /// The pocket that holds a tool; `None`: nobody knows.
    pub fn pocket(&self, tool: u32) -> Option<u32> {
        self.known()
            .find(|(_, number, _)| *number == tool)
            .map(|(.., pocket)| pocket)
    }

    /// The tool is in the spindle from now on. Of a random changer that is pocket 0, and what was there is where it comes from.
    pub fn change(&self, tool: u32) {
        let Some(from) = self.pocket(tool).filter(|_| self.is_random.load(Relaxed)) else {
            return;
        };
        for (cell, number, pocket) in self.known() {
            if pocket == from {
                cell.store(entry(number, 0), Relaxed);
            } else if pocket == 0 {
                cell.store(entry(number, from), Relaxed);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::canon::LengthUnit;

    #[test]
    fn a_random_changer_exchanges_two_pockets_and_a_fixed_one_none() {
        let table = |changer| ToolTable::parse(b"T3 P0\nT5 P7\nT9 P2\n", LengthUnit::Millimetre, changer).unwrap();
        let pockets = ToolPockets::default();
        assert_eq!(pockets.pocket(5), None);
        pockets.set(&table(ToolChanger::Random));
        let of = |tools: [u32; 3]| tools.map(|tool| pockets.pocket(tool));
        assert_eq!(of([3, 5, 9]), [Some(0), Some(7), Some(2)]);
        pockets.change(5);
        assert_eq!(of([3, 5, 9]), [Some(7), Some(0), Some(2)]);
        // Again the same, and one that nobody knows.
        pockets.change(5);
        pockets.change(77);
        assert_eq!(of([3, 5, 9]), [Some(7), Some(0), Some(2)]);
        pockets.change(9);
        assert_eq!(of([3, 5, 9]), [Some(7), Some(2), Some(0)]);
        pockets.set(&table(ToolChanger::Fixed));
        pockets.change(9);
        assert_eq!(of([3, 5, 9]), [Some(0), Some(7), Some(2)]);
    }
}
