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
#[cfg(test)]
mod tests;

pub use file::{TableError, TableErrorKind};
use motion::canon::{LengthUnit, Position};

/// Most entries of a table, LinuxCNC's limit: pockets 0 (the spindle) to 1000.
pub const TOOLS_MAX: usize = 1001;

/// Greatest pocket number of a random tool changer.
pub const POCKET_MAX: u32 = 1000;

/// What the pocket number P of an entry means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToolChanger {
    /// By hand, or every tool goes back to its own pocket: P is only kept. T0 is no tool.
    #[default]
    Fixed,
    /// The tool in the spindle and the one in the changer trade places: P is where the tool is now, 0 the spindle, at
    /// most [`POCKET_MAX`], each pocket once. T0 is a tool like any other.
    Random,
}

/// One tool.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tool {
    /// T: number by which programs call it.
    pub number: u32,
    /// P: its place, see [`ToolChanger`].
    pub pocket: u32,
    /// X Y Z A B C U V W: what G43 adds; mm, degrees.
    pub offset: Position,
    /// D: diameter, mm; a negative one is a difference to the nominal diameter or a taper of the shop's own meaning.
    pub diameter_mm: f64,
    /// I: front angle of a lathe tool, degrees.
    pub front_angle_deg: f64,
    /// J: back angle of a lathe tool, degrees.
    pub back_angle_deg: f64,
    /// Q: orientation of a lathe tool, 1 to 9; 0: not given.
    pub orientation: u8,
    /// What stands behind `;`.
    pub remark: String,
}

/// A line of the file.
#[derive(Clone, Debug)]
enum Line {
    /// Blank, or a comment of its own.
    Text(String),
    /// A tool, and its text as it was read; that is lost when a value changes.
    Tool { tool: Tool, text: Option<String> },
}

/// The tools of a machine in the order of their file, with all remarks.
///
/// Two tables are equal when they have the same tools in the same order.
#[derive(Clone, Debug)]
pub struct ToolTable {
    lines: Vec<Line>,
    unit: LengthUnit,
    changer: ToolChanger,
}

impl PartialEq for ToolTable {
    fn eq(&self, other: &ToolTable) -> bool {
        self.changer == other.changer && self.tools().eq(other.tools())
    }
}

impl Default for ToolTable {
    fn default() -> ToolTable {
        ToolTable::new(LengthUnit::Millimetre, ToolChanger::Fixed)
    }
}

impl ToolTable {
    /// A table without tools; its file is written in `unit`.
    pub fn new(unit: LengthUnit, changer: ToolChanger) -> ToolTable {
        ToolTable {
            lines: Vec::new(),
            unit,
            changer,
        }
    }

    /// What the pockets mean.
    pub fn changer(&self) -> ToolChanger {
        self.changer
    }

    /// All tools in the order of the file.
    pub fn tools(&self) -> impl Iterator<Item = &Tool> {
        self.lines.iter().filter_map(|line| match line {
            Line::Tool { tool, .. } => Some(tool),
            Line::Text(_) => None,
        })
    }

    /// The tool that programs call `number`.
    pub fn by_number(&self, number: u32) -> Option<&Tool> {
        self.tools().find(|tool| tool.number == number)
    }

    /// The tool whose P is `pocket`; where a fixed changer's file names it twice, the first one.
    pub fn in_pocket(&self, pocket: u32) -> Option<&Tool> {
        self.tools().find(|tool| tool.pocket == pocket)
    }

    /// Replaces the tool of the same number where it stands, or adds one at the end.
    ///
    /// # Errors
    /// What the file could not hold; the table is as it was.
    pub fn set(&mut self, mut tool: Tool) -> Result<(), SetToolError> {
        let number = tool.number;
        tool.remark = file::one_line(&tool.remark);
        file::check_values(&tool, self.unit, self.changer)?;
        let taken = |other: &Tool| other.number != number && other.pocket == tool.pocket;
        if self.changer == ToolChanger::Random && self.tools().any(taken) {
            return Err(SetToolError::PocketTaken { pocket: tool.pocket });
        }
        let same = |line: &&mut Line| matches!(line, Line::Tool { tool, .. } if tool.number == number);
        if let Some(line) = self.lines.iter_mut().find(same) {
            if !matches!(&*line, Line::Tool { tool: before, .. } if *before == tool) {
                *line = Line::Tool { tool, text: None };
            }
            return Ok(());
        }
        if self.tools().count() >= TOOLS_MAX {
            return Err(SetToolError::Full);
        }
        self.lines.push(Line::Tool { tool, text: None });
        Ok(())
    }

    /// What a random tool changer does at a change: whatever is in one pocket comes into the other.
    pub fn swap_pockets(&mut self, one: u32, other: u32) {
        if one == other {
            return;
        }
        for line in &mut self.lines {
            if let Line::Tool { tool, text } = line {
                let to = match tool.pocket {
                    pocket if pocket == one => other,
                    pocket if pocket == other => one,
                    _ => continue,
                };
                tool.pocket = to;
                *text = None;
            }
        }
    }
}

/// Why a tool cannot be put into the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetToolError {
    /// No entry can be added.
    #[error("the tool table is full: it holds at most {TOOLS_MAX} tools")]
    Full,
    /// A random tool changer has another tool there.
    #[error("pocket {pocket} of the random tool changer holds another tool")]
    PocketTaken {
        /// The pocket.
        pocket: u32,
    },
    /// A value beyond what the file may hold.
    #[error("{letter} of the tool is out of range")]
    OutOfRange {
        /// Letter of the entry.
        letter: char,
    },
}
