//! Lines of a program.
//!
//! In:  comments and moves, mm. Out: text with words of at most four decimals; a word that says nothing new is omitted.

use crate::fields::{Common, Coolant, Wrong};
use protocol::message;
use std::fmt::Write as _;

/// Lines of the longest program.
pub const LINES_MAX: u32 = 10_000;
/// How far corners are rounded, mm: P of G64.
const TOLERANCE_MM: f64 = 0.003;
/// Tool above the surface where it changes from rapid to feed, mm.
const CLEARANCE_MM: f64 = 1.0;
/// Units of a coordinate in a word: 1/10000 mm.
const UNITS: f64 = 1e4;

/// A number as it is written: at most four decimals, none that says nothing.
pub(crate) fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "-0" => "0".to_owned(),
        text => text.to_owned(),
    }
}

/// A program that is being written.
#[derive(Debug)]
pub(crate) struct Writer {
    text: String,
    lines: u32,
    /// Where the tool is as far as it was written, in units; `None`: not known.
    at: [Option<i64>; 3],
    feed: Option<String>,
    pub(crate) safe_height: f64,
    /// Z down to which the tool goes rapidly.
    pub(crate) clearance: f64,
    spindle: bool,
    coolant: bool,
}

impl Writer {
    /// A program with its head: what it makes (`title` and `numbers`, a comment each), the tool, modes, tool change, spindle, coolant, and the
    /// tool at the safe height.
    ///
    /// # Errors
    /// The safe height is not above the surface.
    pub(crate) fn new(title: &str, numbers: &[String], tool: &str, common: &Common) -> Result<Writer, Wrong> {
        if common.safe_height <= common.top {
            return Wrong::at(
                "safe_height",
                message!(
                    "job.safe_height",
                    "a safe height of {safe} mm is not above the surface, which is at {top} mm: set it higher",
                    safe = common.safe_height,
                    top = common.top
                ),
            );
        }
        let mut writer = Writer {
            text: String::new(),
            lines: 0,
            at: [None; 3],
            feed: None,
            safe_height: common.safe_height,
            clearance: common.safe_height.min(common.top + CLEARANCE_MM),
            spindle: common.spindle > 0.0,
            coolant: common.coolant != Coolant::Off,
        };
        writer.comment(title)?;
        for line in numbers {
            writer.comment(line)?;
        }
        writer.comment(&format!(
            "Surface at Z{}, safe height Z{}",
            number(common.top),
            number(common.safe_height)
        ))?;
        match common.tool {
            0 => writer.comment(&format!("Tool in the spindle: {tool}"))?,
            tool_number => writer.comment(&format!("Tool {tool_number}: {tool}"))?,
        }
        writer.line("G17 G21 G40 G49 G80 G90 G91.1 G94 G98")?;
        writer.line(&format!("G64 P{}", number(TOLERANCE_MM)))?;
        if common.tool > 0 {
            writer.line(&format!("T{} M6", common.tool))?;
        }
        writer.line("G43")?;
        if writer.spindle {
            writer.line(&format!("S{} M3", number(common.spindle)))?;
        }
        match common.coolant {
            Coolant::Off => {}
            Coolant::Flood => writer.line("M8")?,
            Coolant::Mist => writer.line("M7")?,
        }
        writer.retract()?;
        Ok(writer)
    }

    /// The whole text, the tool at the safe height, all off.
    pub(crate) fn end(mut self) -> Result<String, Wrong> {
        self.retract()?;
        match (self.spindle, self.coolant) {
            (true, true) => self.line("M5 M9")?,
            (true, false) => self.line("M5")?,
            (false, true) => self.line("M9")?,
            (false, false) => {}
        }
        self.line("M2")?;
        Ok(self.text)
    }

    /// A line as it is.
    pub(crate) fn line(&mut self, line: &str) -> Result<(), Wrong> {
        if self.lines >= LINES_MAX {
            return Err(Wrong {
                field: None,
                message: message!(
                    "job.too_long",
                    "the program would have more than {most} lines: take larger steps or make it in parts",
                    most = LINES_MAX
                ),
            });
        }
        self.lines += 1;
        self.text.push_str(line);
        self.text.push('\n');
        Ok(())
    }

    /// A comment; what would end it or mean something to a control is omitted.
    pub(crate) fn comment(&mut self, comment: &str) -> Result<(), Wrong> {
        let comment: String = comment
            .chars()
            .map(|letter| match letter {
                '(' => '[',
                ')' => ']',
                '%' | ';' => ' ',
                letter if letter.is_control() => ' ',
                letter => letter,
            })
            .collect();
        self.line(&format!("({comment})"))
    }

    /// Rapidly up to the safe height.
    pub(crate) fn retract(&mut self) -> Result<(), Wrong> {
        self.moves("G0", [None, None, Some(self.safe_height)], None, None)
    }

    /// Rapidly to a place in XY, at the height where the tool is.
    pub(crate) fn rapid(&mut self, [x, y]: [f64; 2]) -> Result<(), Wrong> {
        self.moves("G0", [Some(x), Some(y), None], None, None)
    }

    /// Rapidly to a height.
    pub(crate) fn rapid_z(&mut self, z: f64) -> Result<(), Wrong> {
        self.moves("G0", [None, None, Some(z)], None, None)
    }

    /// Rapidly over a place, and down to where feed begins.
    pub(crate) fn approach(&mut self, to: [f64; 2]) -> Result<(), Wrong> {
        self.retract()?;
        self.rapid(to)?;
        self.rapid_z(self.clearance)
    }

    /// At feed along Z.
    pub(crate) fn plunge(&mut self, z: f64, feed: f64) -> Result<(), Wrong> {
        self.moves("G1", [None, None, Some(z)], None, Some(feed))
    }

    /// At feed in XY.
    pub(crate) fn cut(&mut self, [x, y]: [f64; 2], feed: f64) -> Result<(), Wrong> {
        self.moves("G1", [Some(x), Some(y), None], None, Some(feed))
    }

    /// At feed in X, Y and Z.
    pub(crate) fn slope(&mut self, [x, y]: [f64; 2], z: f64, feed: f64) -> Result<(), Wrong> {
        self.moves("G1", [Some(x), Some(y), Some(z)], None, Some(feed))
    }

    /// An arc about a centre, a whole turn if it ends where it begins; with `z` a helix.
    pub(crate) fn arc(
        &mut self,
        counter_clockwise: bool,
        [x, y]: [f64; 2],
        z: Option<f64>,
        centre: [f64; 2],
        feed: f64,
    ) -> Result<(), Wrong> {
        let code = if counter_clockwise { "G3" } else { "G2" };
        self.moves(code, [Some(x), Some(y), z], Some(centre), Some(feed))
    }

    fn moves(
        &mut self,
        code: &str,
        to: [Option<f64>; 3],
        centre: Option<[f64; 2]>,
        feed: Option<f64>,
    ) -> Result<(), Wrong> {
        let before = self.at;
        let mut line = code.to_owned();
        let mut says = centre.is_some();
        for (index, letter) in ["X", "Y", "Z"].into_iter().enumerate() {
            let Some(value) = to[index] else { continue };
            let unit = (value * UNITS).round();
            let is_new = self.at[index] != Some(unit as i64);
            self.at[index] = Some(unit as i64);
            if is_new || centre.is_some() && index < 2 {
                says |= is_new;
                let _ = write!(line, " {letter}{}", number(unit / UNITS));
            }
        }
        if !says {
            return Ok(());
        }
        if let Some(centre) = centre {
            for (index, letter) in ["I", "J"].into_iter().enumerate() {
                let from = before[index].map_or(0.0, |unit| unit as f64 / UNITS);
                let _ = write!(line, " {letter}{}", number(centre[index] - from));
            }
        }
        if let Some(feed) = feed.map(number)
            && self.feed.as_ref() != Some(&feed)
        {
            let _ = write!(line, " F{feed}");
            self.feed = Some(feed);
        }
        self.line(&line)
    }

    /// Holes of a cycle (`G81 Z-5 R1`), from the safe height and back to it; feed once.
    pub(crate) fn cycle(&mut self, cycle: &str, holes: &[[f64; 2]], feed: f64) -> Result<(), Wrong> {
        self.retract()?;
        for (index, [x, y]) in holes.iter().enumerate() {
            let place = format!("X{} Y{}", number(*x), number(*y));
            match index {
                0 => self.line(&format!("G98 {cycle} {place} F{}", number(feed)))?,
                _ => self.line(&place)?,
            }
        }
        self.at = [None, None, self.at[2]];
        self.feed = Some(number(feed));
        self.line("G80")
    }
}
