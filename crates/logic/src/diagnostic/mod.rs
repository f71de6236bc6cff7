//! What is wrong with a program, or may not be meant, and where.
//!
//! In:  from every step of the compilation.
//! Out: to whoever writes the program: one line by `Display`, or with the line of the program around it by
//!      [`Diagnostic::render`].

pub(crate) mod kind;

pub use kind::Kind;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use std::collections::BTreeSet;
use std::fmt;
use std::ops::Range;
use std::rc::Rc;

/// Of each severity so many are told: behind them, the file is not what it is taken for.
const TOLD_MAX: usize = 100;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The program cannot run.
    Error,
    /// It runs; what it does may not be meant.
    Warning,
    /// Something was read and has no effect.
    Note,
}

/// Something to say about a place of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// Line, counted from 1.
    pub line: u32,
    /// Character in the line, counted from 1.
    pub column: u32,
    /// The line, without its end.
    pub text: String,
    /// Octets of `text` that it is about.
    pub span: Range<usize>,
    /// What it is.
    pub kind: Kind,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "",
            Severity::Warning => "warning: ",
            Severity::Note => "note: ",
        };
        write!(f, "{}:{}: {severity}{}", self.line, self.column, self.kind)
    }
}

impl std::error::Error for Diagnostic {}

impl Diagnostic {
    /// The message with the line of the program and a mark under what it is about; plain text of several lines.
    ///
    /// `path`: name of the program.
    pub fn render(&self, path: &str) -> String {
        let title = self.kind.to_string();
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
            Severity::Note => Level::NOTE,
        };
        let snippet = Snippet::source(self.text.as_str())
            .path(path)
            .line_start(self.line as usize)
            .annotation(AnnotationKind::Primary.span(self.span.clone()));
        let report = [level.primary_title(title.as_str()).element(snippet)];
        Renderer::plain().render(&report)
    }
}

/// Octets of the program, from its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) struct Span {
    pub(crate) start: u32,
    pub(crate) end: u32,
}

impl Span {
    /// From the start of this to the end of the other.
    pub(crate) fn to(self, other: Span) -> Span {
        Span {
            start: self.start,
            end: other.end.max(self.start),
        }
    }
}

/// Where lines and characters of a text begin.
#[derive(Debug)]
pub(crate) struct Lines<'t> {
    text: &'t str,
    /// First octet of each line.
    lines: Vec<usize>,
    /// Characters before each stretch of [`Lines::STRETCH`] octets: a long line is not counted through for each of its places.
    characters: Vec<u32>,
}

impl<'t> Lines<'t> {
    const STRETCH: usize = 64;

    fn new(text: &'t str) -> Lines<'t> {
        let ends = text.bytes().enumerate().filter(|(_, octet)| *octet == b'\n');
        let mut sum = 0;
        let stretches = text.as_bytes().chunks(Self::STRETCH).map(|stretch| {
            let before = sum;
            sum += characters(stretch);
            before
        });
        Lines {
            text,
            lines: std::iter::once(0).chain(ends.map(|(at, _)| at + 1)).collect(),
            characters: stretches.collect(),
        }
    }

    /// Characters that begin before an octet.
    fn before(&self, at: usize) -> u32 {
        let at = at.min(self.text.len());
        let stretch = (at / Self::STRETCH).min(self.characters.len().saturating_sub(1));
        let rest = &self.text.as_bytes()[stretch * Self::STRETCH..at];
        self.characters.get(stretch).copied().unwrap_or(0) + characters(rest)
    }

    /// Line and column of an octet, both counted from 1.
    pub(crate) fn place(&self, at: u32) -> (u32, u32) {
        let line = self.lines.partition_point(|start| *start <= at as usize).max(1);
        let start = self.lines[line - 1];
        (line as u32, self.before(at as usize) - self.before(start) + 1)
    }
}

/// Characters that begin in a part of a text.
fn characters(octets: &[u8]) -> u32 {
    octets.iter().filter(|octet| **octet & 0xC0 != 0x80).count() as u32
}

/// An error has been told; whoever sees this leaves out what depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reported;

/// All that is told about one program.
#[derive(Debug)]
pub(crate) struct Diagnostics<'t> {
    text: &'t str,
    pub(crate) lines: Rc<Lines<'t>>,
    told: Vec<Diagnostic>,
    /// How many were told of each severity.
    counts: [usize; 3],
    has_errors: bool,
    /// What is not supported and has been told, in words.
    unsupported: BTreeSet<&'static str>,
}

impl<'t> Diagnostics<'t> {
    pub(crate) fn new(text: &'t str) -> Diagnostics<'t> {
        Diagnostics {
            text,
            lines: Rc::new(Lines::new(text)),
            told: Vec::new(),
            counts: [0; 3],
            has_errors: false,
            unsupported: BTreeSet::new(),
        }
    }

    /// Which of some known names was probably meant; nobody looks for it for an error that is not told any more.
    pub(crate) fn nearest<'k>(&self, name: &str, known: impl IntoIterator<Item = &'k str>) -> Option<String> {
        let is_told = self.counts[Severity::Error as usize] < TOLD_MAX;
        is_told.then(|| kind::nearest(name, known)).flatten()
    }

    pub(crate) fn error(&mut self, at: Span, kind: Kind) -> Reported {
        self.has_errors = true;
        self.tell(Severity::Error, at, kind);
        Reported
    }

    /// That something is not supported, once a program, however often it comes. `word`: how it is written there.
    pub(crate) fn unsupported(&mut self, at: Span, what: &'static str, word: &str) -> Reported {
        self.has_errors = true;
        if self.unsupported.insert(what) {
            let word = word.to_owned();
            self.error(at, Kind::UnsupportedOf { word, what });
        }
        Reported
    }

    pub(crate) fn warning(&mut self, at: Span, kind: Kind) {
        self.tell(Severity::Warning, at, kind);
    }

    pub(crate) fn note(&mut self, at: Span, kind: Kind) {
        self.tell(Severity::Note, at, kind);
    }

    fn tell(&mut self, severity: Severity, at: Span, kind: Kind) {
        if self.counts[severity as usize] >= TOLD_MAX {
            return;
        }
        let start = (at.start as usize).min(self.text.len());
        let (line, column) = self.lines.place(start as u32);
        let line_start = self.lines.lines[line as usize - 1];
        let rest = &self.text[line_start..];
        let line_text = rest.split(['\n', '\r']).next().unwrap_or_default();
        let from = (start - line_start).min(line_text.len());
        let end = (at.end as usize)
            .saturating_sub(line_start)
            .clamp(from, line_text.len());
        let again = |told: &Diagnostic| told.kind == kind && told.severity == severity;
        if self
            .told
            .iter()
            .any(|told| again(told) && (told.line, told.column) == (line, column))
        {
            return;
        }
        self.counts[severity as usize] += 1;
        self.told.push(Diagnostic {
            severity,
            line,
            column,
            text: line_text.to_owned(),
            span: from..end,
            kind,
        });
    }

    pub(crate) fn has_errors(&self) -> bool {
        self.has_errors
    }

    /// All in the order of the text.
    pub(crate) fn finish(mut self) -> Vec<Diagnostic> {
        self.told.sort_by_key(|told| (told.line, told.column));
        self.told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_counted_in_characters_of_their_line() {
        let text = format!("é{}\n\r\n{}ü", "a".repeat(200), "ä".repeat(100));
        let lines = Lines::new(&text);
        let mut wanted = (1, 1);
        for (at, letter) in text.char_indices() {
            assert_eq!(lines.place(at as u32), wanted, "{at}");
            wanted = if letter == '\n' {
                (wanted.0 + 1, 1)
            } else {
                (wanted.0, wanted.1 + 1)
            };
        }
        assert_eq!(lines.place(text.len() as u32), wanted);
        assert_eq!(lines.place(u32::MAX), wanted);
        assert_eq!(Lines::new("").place(5), (1, 1));
    }
}
