//! Tools, and what a program and a tool changer do to them.

use super::TableError;
use motion::canon::{Axis, LengthUnit, Position, ToolEntry};
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// Most entries of a table, LinuxCNC's limit: pockets 0 (the spindle) to 1000.
pub const TOOLS_MAX: usize = 1001;

/// Greatest pocket number of a random tool changer.
pub const POCKET_MAX: u32 = 1000;

/// Greatest tool number, and pocket number of a fixed changer: LinuxCNC keeps them in 32 bits with a sign.
pub(super) const NUMBER_MAX: u32 = i32::MAX as u32;

/// Greatest magnitude of a length or angle, units of the file; it keeps every later sum and product finite.
pub(super) const VALUE_MAX: f64 = 1e9;

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

/// A tool of the table: its numbers, offset and geometry.
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

impl Tool {
    /// What is told of it; `pocket` is its line of the table or its pocket, as the listener counts.
    pub(crate) fn entry(&self, pocket: u32) -> ToolEntry {
        ToolEntry {
            tool: self.number,
            pocket,
            offset: self.offset,
            diameter_mm: self.diameter_mm,
            front_angle_degrees: self.front_angle_deg,
            back_angle_degrees: self.back_angle_deg,
            orientation: self.orientation,
        }
    }
}

/// How far a tool has worn since it was measured: what has to be added to its length and its diameter. LinuxCNC's file has no place for
/// it; whoever keeps it sets it with [`ToolTable::set_wear`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wear {
    /// Along Z, mm; a tool that has become shorter has a negative one.
    pub length_mm: f64,
    /// Of the diameter, mm.
    pub diameter_mm: f64,
}

/// A line of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Line {
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
    pub(super) lines: Vec<Line>,
    pub(super) unit: LengthUnit,
    changer: ToolChanger,
    /// By the number of the tool; without those that have not worn.
    wear: BTreeMap<u32, Wear>,
    /// Tools that are called in the place of others: see [`ToolTable::set_sisters`].
    sisters: BTreeMap<u32, u32>,
    /// What of the file was passed over when it was read.
    pub(super) passed_over: Vec<TableError>,
}

impl PartialEq for ToolTable {
    fn eq(&self, other: &ToolTable) -> bool {
        self.changer == other.changer && self.wear == other.wear && self.tools().eq(other.tools())
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
            wear: BTreeMap::new(),
            sisters: BTreeMap::new(),
            passed_over: Vec::new(),
        }
    }

    /// Unit of its file.
    pub fn unit(&self) -> LengthUnit {
        self.unit
    }

    /// What the pockets mean.
    pub fn changer(&self) -> ToolChanger {
        self.changer
    }

    /// What of the file counts for nothing, about a hundred places at the most: a headline, entries that nobody knows.
    pub fn passed_over(&self) -> &[TableError] {
        &self.passed_over
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

    /// The wear of a tool since it was measured.
    pub fn wear(&self, number: u32) -> Wear {
        self.wear.get(&number).copied().unwrap_or_default()
    }

    /// Sets it; a tool that is not in the table has none.
    ///
    /// # Errors
    /// What no file could hold as length or diameter.
    pub fn set_wear(&mut self, number: u32, wear: Wear) -> Result<(), SetToolError> {
        for (letter, value) in [('Z', wear.length_mm), ('D', wear.diameter_mm)] {
            if !(-VALUE_MAX..=VALUE_MAX).contains(&(value / self.unit.mm())) {
                return Err(SetToolError::OutOfRange { letter });
            }
        }
        match wear != Wear::default() && self.by_number(number).is_some() {
            true => self.wear.insert(number, wear),
            false => self.wear.remove(&number),
        };
        Ok(())
    }

    /// Takes over the wear of those tools that measure the same as there.
    pub fn take_wear_of(&mut self, other: &ToolTable) {
        for number in other.wear.keys() {
            let wear = match (self.by_number(*number), other.by_number(*number)) {
                (Some(tool), Some(before)) => left_of(other.wear(*number), before, tool),
                (None, _) | (_, None) => continue,
            };
            let _ = self.set_wear(*number, wear); // it was good there
        }
    }

    /// The tool with its wear, as G43 and G41 count with it.
    pub fn with_wear(&self, number: u32) -> Option<Tool> {
        let mut tool = self.by_number(number)?.clone();
        let wear = self.wear(number);
        tool.offset[Axis::Z] += wear.length_mm;
        tool.diameter_mm += wear.diameter_mm;
        Some(tool)
    }

    /// Tools that are called in the place of others, whose life is over: where T, H and D name the first, the second is meant.
    pub fn set_sisters(&mut self, sisters: BTreeMap<u32, u32>) {
        self.sisters = sisters;
    }

    /// The number of the tool that is meant where a program calls `number`.
    pub fn called(&self, number: u32) -> u32 {
        self.sisters.get(&number).copied().unwrap_or(number)
    }

    /// Replaces the tool of the same number where it stands, or adds one at the end. What is measured anew has not worn: another length
    /// or diameter ends its wear.
    ///
    /// # Errors
    /// What the file could not hold; the table is as it was.
    pub fn set(&mut self, mut tool: Tool) -> Result<(), SetToolError> {
        let number = tool.number;
        tool.remark = one_line(&tool.remark);
        check_values(&tool, self.unit, self.changer)?;
        let taken = |other: &Tool| other.number != number && other.pocket == tool.pocket;
        if self.changer == ToolChanger::Random && self.tools().any(taken) {
            return Err(SetToolError::PocketTaken { pocket: tool.pocket });
        }
        let same = |line: &&mut Line| matches!(line, Line::Tool { tool, .. } if tool.number == number);
        if let Some(line) = self.lines.iter_mut().find(same) {
            if let Line::Tool { tool: before, .. } = &*line
                && *before != tool
            {
                if let Some(worn) = self.wear.get_mut(&number) {
                    *worn = left_of(*worn, before, &tool);
                }
                *line = Line::Tool { tool, text: None };
            }
            self.wear.retain(|_, wear| *wear != Wear::default());
            return Ok(());
        }
        if self.tools().count() >= TOOLS_MAX {
            return Err(SetToolError::Full);
        }
        self.lines.push(Line::Tool { tool, text: None });
        Ok(())
    }

    /// Takes a tool out of the table, with its line; false: it has none of this number.
    pub fn remove(&mut self, number: u32) -> bool {
        let before = self.lines.len();
        self.wear.remove(&number);
        self.lines
            .retain(|line| !matches!(line, Line::Tool { tool, .. } if tool.number == number));
        self.lines.len() < before
    }

    /// Tools are in the pockets in which another table has them; those that it does not have stay where they are.
    pub fn take_pockets_of(&mut self, other: &ToolTable) {
        for line in &mut self.lines {
            if let Line::Tool { tool, text } = line
                && let Some(pocket) = other.by_number(tool.number).map(|tool| tool.pocket)
                && pocket != tool.pocket
            {
                tool.pocket = pocket;
                *text = None;
            }
        }
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

/// What is left of a wear where the measures of a tool are no longer those of before.
fn left_of(wear: Wear, before: &Tool, now: &Tool) -> Wear {
    let kept = |worn: f64, same: bool| if same { worn } else { 0.0 };
    Wear {
        length_mm: kept(wear.length_mm, before.offset[Axis::Z] == now.offset[Axis::Z]),
        diameter_mm: kept(wear.diameter_mm, before.diameter_mm == now.diameter_mm),
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
        /// Number of the pocket.
        pocket: u32,
    },
    /// A value beyond what the file may hold.
    #[error("{letter} of the tool is out of range")]
    OutOfRange {
        /// Letter of the entry.
        letter: char,
    },
}

/// Whether [`ToolTable::parse`] would read all values again.
fn check_values(tool: &Tool, unit: LengthUnit, changer: ToolChanger) -> Result<(), SetToolError> {
    let wrong = |letter| Err(SetToolError::OutOfRange { letter });
    if tool.number > NUMBER_MAX {
        return wrong('T');
    }
    if tool.pocket > pocket_max(changer) {
        return wrong('P');
    }
    if tool.orientation > 9 {
        return wrong('Q');
    }
    for (letter, value, scale) in values(tool, unit) {
        // A NaN is not at most anything.
        if !matches!(
            (value / scale).abs().partial_cmp(&VALUE_MAX),
            Some(Ordering::Less | Ordering::Equal)
        ) {
            return wrong(letter);
        }
    }
    Ok(())
}

pub(super) fn pocket_max(changer: ToolChanger) -> u32 {
    match changer {
        ToolChanger::Fixed => NUMBER_MAX,
        ToolChanger::Random => POCKET_MAX,
    }
}

/// A remark without what would end its line.
pub(super) fn one_line(remark: &str) -> String {
    remark.replace(['\n', '\r'], " ")
}

/// The real values in the order in which LinuxCNC writes them: letter, value, and what one unit of the file is.
pub(super) fn values(tool: &Tool, unit: LengthUnit) -> impl Iterator<Item = (char, f64, f64)> {
    let axes = Axis::ALL.map(|axis| {
        let scale = if axis.is_rotary() { 1.0 } else { unit.mm() };
        (axis.letter(), tool.offset[axis], scale)
    });
    let angles = [('I', tool.front_angle_deg, 1.0), ('J', tool.back_angle_deg, 1.0)];
    [('D', tool.diameter_mm, unit.mm())]
        .into_iter()
        .chain(axes)
        .chain(angles)
}
