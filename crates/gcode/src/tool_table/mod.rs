//! The tools of a machine, in LinuxCNC's tool table.
//!
//! In:  the octets of the file and the unit of its lengths ([`ToolTable::parse`]); what a program sets (G10 L1, L10,
//!      L11) and what a random tool changer moves.
//! Out: tools by number or pocket, in mm and degrees; the text of the file again ([`ToolTable::write`]).
//!
//! ```
//! use gcode::{ToolChanger, ToolTable};
//! use motion::canon::LengthUnit;
//!
//! let text = b"; mill\nT1 P1 Z+0.5 D0.125 ;1/8 end mill\n";
//! let table = ToolTable::parse(text, LengthUnit::Inch, ToolChanger::Fixed).unwrap();
//! assert_eq!(table.by_number(1).unwrap().diameter_mm, 0.125 * 25.4);
//! assert_eq!(table.write().as_bytes(), text);
//! ```

mod file;
mod table;
#[cfg(test)]
mod tests;

pub use file::{TableError, TableErrorKind};
pub use table::{POCKET_MAX, SetToolError, TOOLS_MAX, Tool, ToolChanger, ToolTable, Wear};
