//! Mistakes in a device description, each with its place.

use std::fmt;
use std::string::{String, ToString};
use std::vec::Vec;

/// Mistakes that are kept; the rest is only counted.
const MISTAKES_MAX: usize = 100;
/// Characters of a value that are shown.
const SHOWN_MAX: usize = 60;

/// One mistake in a device file, with its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceMistake {
    /// Line and column, both from 1, the column in characters; `None`: the file as a whole.
    pub place: Option<(u32, u32)>,
    /// What it is about: `object 0x1018:1 defaultValue`.
    pub subject: String,
    /// What came, shortened.
    pub got: Option<String>,
    /// What was expected.
    pub rule: String,
}

impl DeviceMistake {
    /// With the name of its file: `x.xdd:12:40: object 0x1018:1 defaultValue = "x": expected ...`.
    pub fn line(&self, file: &str) -> String {
        let mut line = file.to_string();
        if let Some((row, column)) = self.place {
            line += &std::format!(":{row}:{column}");
        }
        if !self.subject.is_empty() {
            line += &std::format!(": {}", self.subject);
        }
        if let Some(got) = &self.got {
            line += &std::format!(" = {got:?}");
        }
        line + ": " + &self.rule
    }
}

/// Every mistake of a file, in its order; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceErrors {
    /// The file as it was named.
    pub file: String,
    /// The first hundred mistakes.
    pub mistakes: Vec<DeviceMistake>,
    /// How many more there are.
    pub more: usize,
}

impl DeviceErrors {
    pub(super) fn whole(file: &str, rule: String) -> DeviceErrors {
        let mistake = DeviceMistake {
            place: None,
            subject: String::new(),
            got: None,
            rule,
        };
        DeviceErrors {
            file: file.to_string(),
            mistakes: Vec::from([mistake]),
            more: 0,
        }
    }

    /// One line for each mistake.
    pub fn lines(&self) -> impl Iterator<Item = String> + '_ {
        self.mistakes.iter().map(|mistake| mistake.line(&self.file))
    }
}

impl fmt::Display for DeviceErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (row, line) in self.lines().enumerate() {
            write!(f, "{}{line}", if row > 0 { "\n" } else { "" })?;
        }
        if self.more > 0 {
            write!(f, "\n{}: {} more mistakes", self.file, self.more)?;
        }
        Ok(())
    }
}

impl std::error::Error for DeviceErrors {}

/// Octet offsets to lines and columns.
struct Lines<'t> {
    text: &'t str,
    starts: Vec<usize>,
}

impl Lines<'_> {
    /// Number, from 1. For every object, so nothing is counted: a file may be one line.
    fn line(&self, offset: usize) -> usize {
        self.starts.partition_point(|start| *start <= offset).max(1)
    }

    fn place(&self, offset: usize) -> (u32, u32) {
        let offset = (0..=offset.min(self.text.len()))
            .rev()
            .find(|at| self.text.is_char_boundary(*at))
            .unwrap_or(0);
        let line = self.line(offset);
        let column = self.text[self.starts[line - 1]..offset].chars().count();
        (line as u32, column as u32 + 1)
    }
}

/// Collects the mistakes of one file.
pub(super) struct Log<'t> {
    pub(super) file: &'t str,
    lines: Lines<'t>,
    mistakes: Vec<DeviceMistake>,
    more: usize,
    notes: Vec<DeviceMistake>,
}

impl<'t> Log<'t> {
    pub(super) fn new(file: &'t str, text: &'t str) -> Log<'t> {
        let newlines = text.bytes().enumerate().filter(|(_, octet)| *octet == b'\n');
        let starts = std::iter::once(0).chain(newlines.map(|(at, _)| at + 1)).collect();
        Log {
            file,
            lines: Lines { text, starts },
            mistakes: Vec::new(),
            more: 0,
            notes: Vec::new(),
        }
    }

    /// The line of an octet, from 1.
    pub(super) fn line(&self, offset: usize) -> u32 {
        self.lines.line(offset) as u32
    }

    fn mistake(&self, offset: usize, subject: String, got: Option<&str>, rule: String) -> DeviceMistake {
        let shown = |got: &str| match got.char_indices().nth(SHOWN_MAX) {
            Some((end, _)) => std::format!("{}...", &got[..end]),
            None => got.to_string(),
        };
        DeviceMistake {
            place: Some(self.lines.place(offset)),
            subject,
            got: got.map(shown),
            rule,
        }
    }

    /// Notes what makes the file unusable.
    pub(super) fn wrong(
        &mut self,
        offset: usize,
        subject: impl Into<String>,
        got: Option<&str>,
        rule: impl Into<String>,
    ) {
        if self.mistakes.len() == MISTAKES_MAX {
            self.more += 1;
        } else {
            let mistake = self.mistake(offset, subject.into(), got, rule.into());
            self.mistakes.push(mistake);
        }
    }

    /// Notes what is odd but changes nothing that is used.
    pub(super) fn odd(
        &mut self,
        offset: usize,
        subject: impl Into<String>,
        got: Option<&str>,
        rule: impl Into<String>,
    ) {
        if self.notes.len() < MISTAKES_MAX {
            let note = self.mistake(offset, subject.into(), got, rule.into());
            self.notes.push(note);
        }
    }

    /// Takes out what has been wrong since there were `before` mistakes: it makes a part of the file unusable, not the file.
    pub(super) fn take_since(&mut self, before: usize) -> Vec<DeviceMistake> {
        self.more = 0;
        self.mistakes.split_off(before.min(self.mistakes.len()))
    }

    /// Mistakes so far.
    pub(super) fn count(&self) -> usize {
        self.mistakes.len()
    }

    /// Puts mistakes back that were taken out: they make the file unusable after all.
    pub(super) fn put_back(&mut self, mistakes: &[DeviceMistake]) {
        let room = MISTAKES_MAX.saturating_sub(self.mistakes.len());
        self.more += mistakes.len().saturating_sub(room);
        self.mistakes.extend(mistakes.iter().take(room).cloned());
    }

    /// Puts mistakes that were taken out among the notes.
    pub(super) fn note(&mut self, mistakes: &[DeviceMistake]) {
        let room = MISTAKES_MAX.saturating_sub(self.notes.len());
        self.notes.extend(mistakes.iter().take(room).cloned());
    }

    /// The notes if nothing is wrong.
    pub(super) fn finish(mut self) -> Result<Vec<DeviceMistake>, DeviceErrors> {
        if self.mistakes.is_empty() {
            self.notes.sort_by_key(|note| note.place);
            return Ok(self.notes);
        }
        self.mistakes.sort_by_key(|mistake| mistake.place);
        Err(DeviceErrors {
            file: self.file.to_string(),
            mistakes: self.mistakes,
            more: self.more,
        })
    }
}
