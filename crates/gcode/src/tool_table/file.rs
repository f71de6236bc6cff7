//! LinuxCNC's tool table file: one tool a line, `T1 P1 X0 Z+0.511 D3 ;remark`.
//!
//! In:  octets; every line is read, so that all errors are told at once.
//! Out: [`ToolTable`]; its text. A line that did not change is written as it was read.
//!
//! An entry is a letter with its number and no blank between them; entries stand in any order, in either case, with
//! blanks or tabs between. T and P must be there. LinuxCNC skips lines that it cannot read; here they are errors,
//! but for headlines and entries with other letters, which are told and passed over.

use super::table::{
    Line, NUMBER_MAX, TOOLS_MAX, Tool, ToolChanger, ToolTable, VALUE_MAX, one_line, pocket_max, values,
};
use crate::located::{Located, MISTAKES_MAX, lines, text_of};
use motion::canon::{Axis, LengthUnit};
use std::collections::HashMap;
use std::fmt::Write;
use std::ops::Range;

/// Letters of entries.
const LETTERS: &str = "TPXYZABCUVWDIJQ";

/// A mistake in a tool table.
pub type TableError = Located<TableErrorKind>;

/// What is wrong with a tool table; `Display` tells rule and remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableErrorKind {
    /// No letter of the format.
    #[error(
        "an entry is one of the letters T P X Y Z A B C U V W D I J Q with a number right behind it; \
         remarks stand behind ;"
    )]
    UnknownEntry,
    /// An entry of another format, or a word.
    #[error(
        "this counts for nothing: an entry is one of the letters T P X Y Z A B C U V W D I J Q with a number right behind it; \
         remarks stand behind ;"
    )]
    PassedOver,
    /// The same letter twice in a line.
    #[error("{letter} appears twice in this line: once is allowed")]
    RepeatedEntry {
        /// Letter of the word.
        letter: char,
    },
    /// A letter without number.
    #[error("{letter} needs a number right behind it, without a blank between")]
    NumberMissing {
        /// Letter of the word.
        letter: char,
    },
    /// Not a number, or more than one entry without a blank between.
    #[error("{letter} needs a plain number such as -1.5, and a blank before the next entry")]
    NotNumber {
        /// Letter of the word.
        letter: char,
    },
    /// Beyond any machine.
    #[error("the number of {letter} is too large: at most {VALUE_MAX}")]
    TooLarge {
        /// Letter of the word.
        letter: char,
    },
    /// Not an integer of the range.
    #[error("{letter} ({meaning}) is an integer from 0 to {max}, with a blank before the next entry")]
    NotInteger {
        /// Letter of the word.
        letter: char,
        /// What it stands for.
        meaning: &'static str,
        /// Greatest value allowed.
        max: u32,
    },
    /// A line without T, the number of the tool.
    #[error("T is missing: each line names its tool")]
    NumberOfToolMissing,
    /// A line without P, the number of the pocket.
    #[error("P is missing: each tool has a pocket number; with a fixed tool changer any number will do, 1 say")]
    PocketMissing,
    /// A tool number twice in the file.
    #[error("T{number} is already in line {first_line}: each tool number may stand once")]
    RepeatedTool {
        /// Number of the tool.
        number: u32,
        /// Where it stood first.
        first_line: u32,
    },
    /// A pocket twice in the file of a random tool changer.
    #[error("P{pocket} is already in line {first_line}: one tool in each pocket of a random tool changer")]
    RepeatedPocket {
        /// Number of the pocket.
        pocket: u32,
        /// Where it stood first.
        first_line: u32,
    },
    /// Too many tools.
    #[error("more than {TOOLS_MAX} tools")]
    TooManyTools,
}

impl ToolTable {
    /// Reads a file; lengths in it are in `unit`.
    ///
    /// # Errors
    /// What is wrong, in the order of the file; about a hundred mistakes are told.
    pub fn parse(text: &[u8], unit: LengthUnit, changer: ToolChanger) -> Result<ToolTable, Vec<TableError>> {
        let mut table = ToolTable::new(unit, changer);
        let mut errors = Vec::new();
        let mut tools = HashMap::new();
        let mut pockets = HashMap::new();
        for (index, line) in lines(text).enumerate() {
            if errors.len() >= MISTAKES_MAX {
                break;
            }
            let line = text_of(line);
            if let Some(span) = headline(&line) {
                table.pass_over(Located::at(index, &line, span, TableErrorKind::PassedOver));
                table.lines.push(Line::Text(line));
                continue;
            }
            let found = match read_line(index, &line, &mut table, &mut errors) {
                Read::Text => {
                    table.lines.push(Line::Text(line));
                    continue;
                }
                Read::Wrong => continue,
                Read::Tool(found) => found,
            };
            let number = u32::try_from(index + 1).unwrap_or(u32::MAX);
            let FoundTool { tool, t, p } = found;
            if let Some(&first_line) = tools.get(&tool.number) {
                let kind = TableErrorKind::RepeatedTool {
                    number: tool.number,
                    first_line,
                };
                errors.push(Located::at(index, &line, t, kind));
                continue;
            }
            if changer == ToolChanger::Random
                && let Some(&first_line) = pockets.get(&tool.pocket)
            {
                let kind = TableErrorKind::RepeatedPocket {
                    pocket: tool.pocket,
                    first_line,
                };
                errors.push(Located::at(index, &line, p, kind));
                continue;
            }
            if tools.len() == TOOLS_MAX {
                errors.push(Located::at(index, &line, 0..line.len(), TableErrorKind::TooManyTools));
                break;
            }
            tools.insert(tool.number, number);
            pockets.insert(tool.pocket, number);
            table.lines.push(Line::Tool { tool, text: Some(line) });
        }
        if errors.is_empty() { Ok(table) } else { Err(errors) }
    }

    /// The text of the file: lines in their order, unchanged ones as they were read, others as LinuxCNC writes them
    /// (entries that are zero left out), with as many decimals as it takes to read the same values again, six at least.
    pub fn write(&self) -> String {
        let mut text = String::new();
        for line in &self.lines {
            match line {
                Line::Text(line) | Line::Tool { text: Some(line), .. } => text.push_str(line),
                Line::Tool { tool, text: None } => write_tool(&mut text, tool, self.unit),
            }
            text.push('\n');
        }
        text
    }
}

/// What a line is.
enum Read {
    Text,
    Wrong,
    Tool(FoundTool),
}

/// A tool and the places of its T and P.
struct FoundTool {
    tool: Tool,
    t: Range<usize>,
    p: Range<usize>,
}

impl ToolTable {
    fn pass_over(&mut self, what: TableError) {
        if self.passed_over.len() < MISTAKES_MAX {
            self.passed_over.push(what);
        }
    }
}

/// What of a line is a headline: words alone.
fn headline(line: &str) -> Option<Range<usize>> {
    let (entries, _) = line.split_once(';').unwrap_or((line, ""));
    let mut found = words(entries).peekable();
    found.peek()?;
    found.all(|(_, entry)| is_word(entry)).then(|| {
        let start = entries.len() - entries.trim_start_matches(is_blank).len();
        start..entries.trim_end_matches(is_blank).len()
    })
}

/// Whether an entry is a word of a language: letters, and no number that somebody could have meant.
fn is_word(entry: &str) -> bool {
    let is_number = |text: &str| text.parse::<f64>().is_ok();
    entry.chars().count() > 2
        && entry
            .chars()
            .all(|letter| letter.is_alphabetic() || matches!(letter, '.' | '-' | '_'))
        && !entry
            .char_indices()
            .nth(1)
            .is_some_and(|(at, _)| is_number(&entry[at..]))
}

fn read_line(index: usize, line: &str, table: &mut ToolTable, errors: &mut Vec<TableError>) -> Read {
    let (unit, changer) = (table.unit, table.changer());
    let (entries, remark) = line.split_once(';').unwrap_or((line, ""));
    if entries.chars().all(is_blank) {
        return Read::Text;
    }
    let before = errors.len();
    let mut tool = Tool {
        remark: one_line(remark),
        ..Tool::default()
    };
    let mut seen: Vec<(char, Range<usize>)> = Vec::new();
    for (start, entry) in words(entries) {
        let span = start..start + entry.len();
        let mut wrong = |kind| errors.push(Located::at(index, line, span.clone(), kind));
        let mut characters = entry.chars();
        let letter = characters.next().map_or(' ', |letter| letter.to_ascii_uppercase());
        if is_word(entry) || letter.is_alphabetic() && !LETTERS.contains(letter) {
            table.pass_over(Located::at(index, line, span, TableErrorKind::PassedOver));
            continue;
        }
        if !LETTERS.contains(letter) {
            wrong(TableErrorKind::UnknownEntry);
            continue;
        }
        if seen.iter().any(|(other, _)| *other == letter) {
            wrong(TableErrorKind::RepeatedEntry { letter });
            continue;
        }
        seen.push((letter, span.clone()));
        if let Err(kind) = read_entry(&mut tool, letter, characters.as_str(), unit, changer) {
            wrong(kind);
        }
    }
    let place = |letter| {
        seen.iter()
            .find(|(seen, _)| *seen == letter)
            .map(|(_, span)| span.clone())
    };
    let end = entries.trim_end_matches(is_blank).len();
    match (place('T'), place('P')) {
        (Some(t), Some(p)) if errors.len() == before => return Read::Tool(FoundTool { tool, t, p }),
        (Some(_), Some(_)) => {}
        (None, _) if errors.len() > before => {} // the entry that could not be read may be the one that is missing
        (None, _) => errors.push(Located::at(index, line, 0..end, TableErrorKind::NumberOfToolMissing)),
        (_, None) if errors.len() > before => {}
        (_, None) => errors.push(Located::at(index, line, 0..end, TableErrorKind::PocketMissing)),
    }
    Read::Wrong
}

fn read_entry(
    tool: &mut Tool,
    letter: char,
    number: &str,
    unit: LengthUnit,
    changer: ToolChanger,
) -> Result<(), TableErrorKind> {
    match letter {
        'T' => tool.number = integer(letter, "tool number", number, NUMBER_MAX)?,
        'P' => tool.pocket = integer(letter, "pocket number", number, pocket_max(changer))?,
        'Q' => tool.orientation = integer(letter, "orientation", number, 9)? as u8, // checked: at most 9
        'D' => tool.diameter_mm = real(letter, number)? * unit.mm(),
        'I' => tool.front_angle_deg = real(letter, number)?,
        'J' => tool.back_angle_deg = real(letter, number)?,
        letter => {
            let value = real(letter, number)?;
            if let Some(axis) = Axis::from_letter(letter) {
                tool.offset[axis] = if axis.is_rotary() { value } else { value * unit.mm() };
            }
        }
    }
    Ok(())
}

/// Sign, digits with at most one point, and perhaps an exponent as programs that write tables use it.
fn real(letter: char, number: &str) -> Result<f64, TableErrorKind> {
    if number.is_empty() {
        return Err(TableErrorKind::NumberMissing { letter });
    }
    let plain = number
        .bytes()
        .all(|octet| matches!(octet, b'0'..=b'9' | b'.' | b'+' | b'-' | b'e' | b'E'));
    match number.parse::<f64>() {
        Ok(value) if plain && value.abs() <= VALUE_MAX => Ok(value + 0.0), // -0 is 0
        Ok(_) if plain => Err(TableErrorKind::TooLarge { letter }),
        Ok(_) | Err(_) => Err(TableErrorKind::NotNumber { letter }),
    }
}

fn integer(letter: char, meaning: &'static str, number: &str, max: u32) -> Result<u32, TableErrorKind> {
    if number.is_empty() {
        return Err(TableErrorKind::NumberMissing { letter });
    }
    // Some programs write all numbers with a point.
    let whole = number
        .split_once('.')
        .filter(|(_, rest)| rest.bytes().all(|digit| digit == b'0'));
    match whole.map_or(number, |(whole, _)| whole).parse::<u32>() {
        Ok(value) if value <= max => Ok(value),
        Ok(_) | Err(_) => Err(TableErrorKind::NotInteger { letter, meaning, max }),
    }
}

/// The parts of a text between blanks, each with its first octet.
fn words(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        at += text[at..].find(|character| !is_blank(character))?;
        let start = at;
        at += text[at..].find(is_blank).unwrap_or(text.len() - at);
        Some((start, &text[start..at]))
    })
}

fn is_blank(character: char) -> bool {
    matches!(character, ' ' | '\t' | '\r')
}

fn write_tool(text: &mut String, tool: &Tool, unit: LengthUnit) {
    // Writing into a String cannot fail.
    let _ = write!(text, "T{:<3} P{:<3}", tool.number, tool.pocket);
    for (letter, value, scale) in values(tool, unit).filter(|(_, value, _)| *value != 0.0) {
        let _ = write!(text, " {letter}{}", number_text(value, scale));
    }
    if tool.orientation != 0 {
        let _ = write!(text, " Q{}", tool.orientation);
    }
    if !tool.remark.is_empty() {
        let _ = write!(text, " ;{}", tool.remark);
    }
}

/// A number with sign that, times `scale`, gives `value` again where any number does: six decimals if they are enough,
/// else the shortest that is.
fn number_text(value: f64, scale: f64) -> String {
    let six = format!("{:+.6}", value / scale);
    let quotient = value / scale;
    let candidates = [quotient, quotient.next_up(), quotient.next_down()];
    if six.parse::<f64>().is_ok_and(|read| read * scale == value) {
        return six;
    }
    let exact = candidates.into_iter().find(|candidate| candidate * scale == value);
    format!("{:+}", exact.unwrap_or(quotient))
}
