//! What is wrong with a program, or may not be meant, and where.
//!
//! In:  from every step of the compilation.
//! Out: to whoever writes the program: one line by `Display`, or with the line of the program around it by
//!      [`Diagnostic::render`].

pub(crate) mod kind;

pub use kind::Kind;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

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

/// Line and column of an octet of a text, both counted from 1.
pub(crate) fn place(text: &str, at: u32) -> (u32, u32) {
    let before = text.get(..at as usize).unwrap_or(text);
    let line = before.bytes().filter(|octet| *octet == b'\n').count() + 1;
    let start = before.rfind('\n').map_or(0, |end| end + 1);
    (line as u32, before[start..].chars().count() as u32 + 1)
}

/// An error has been told; whoever sees this leaves out what depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reported;

/// All that is told about one program.
#[derive(Debug)]
pub(crate) struct Diagnostics<'t> {
    text: &'t str,
    told: Vec<Diagnostic>,
    errors: usize,
}

impl<'t> Diagnostics<'t> {
    pub(crate) fn new(text: &'t str) -> Diagnostics<'t> {
        Diagnostics {
            text,
            told: Vec::new(),
            errors: 0,
        }
    }

    pub(crate) fn error(&mut self, at: Span, kind: Kind) -> Reported {
        self.errors += 1;
        self.tell(Severity::Error, at, kind);
        Reported
    }

    pub(crate) fn warning(&mut self, at: Span, kind: Kind) {
        self.tell(Severity::Warning, at, kind);
    }

    pub(crate) fn note(&mut self, at: Span, kind: Kind) {
        self.tell(Severity::Note, at, kind);
    }

    fn tell(&mut self, severity: Severity, at: Span, kind: Kind) {
        let all = self.told.iter().filter(|told| told.severity == severity).count();
        if all >= TOLD_MAX {
            return;
        }
        let start = (at.start as usize).min(self.text.len());
        let line_start = self.text[..start].rfind('\n').map_or(0, |end| end + 1);
        let rest = &self.text[line_start..];
        let line_text = rest.split(['\n', '\r']).next().unwrap_or_default();
        let from = (start - line_start).min(line_text.len());
        let end = (at.end as usize)
            .saturating_sub(line_start)
            .clamp(from, line_text.len());
        let again = |told: &Diagnostic| told.kind == kind && told.severity == severity;
        let (line, column) = place(self.text, start as u32);
        if self
            .told
            .iter()
            .any(|told| again(told) && (told.line, told.column) == (line, column))
        {
            return;
        }
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
        self.errors > 0
    }

    /// All in the order of the text.
    pub(crate) fn finish(mut self) -> Vec<Diagnostic> {
        self.told.sort_by_key(|told| (told.line, told.column));
        self.told
    }
}
