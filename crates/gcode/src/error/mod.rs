//! What is wrong with a program, and where.
//!
//! In:  from every step of the interpretation.
//! Out: to the operator: one line by `Display`, or with the text of the program around it by [`Error::render`].

mod arc;
mod cycle;
mod expression;
mod kind;
mod o_word;
mod probe;
mod set_data;
mod spline;
mod thread;
mod turning;

pub use arc::ArcError;
pub use cycle::CycleError;
pub use expression::ExpressionError;
pub use kind::ErrorKind;
pub use o_word::OWordError;
pub use probe::ProbeError;
pub use set_data::SetDataError;
pub use spline::SplineError;
pub use thread::ThreadError;
pub use turning::TurningError;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

/// A mistake in a part program.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// File of the subroutine in which it is; empty: the program itself.
    pub file: String,
    /// Line, counted from 1.
    pub line: u32,
    /// Character in the line, counted from 1.
    pub column: u32,
    /// The line, without its end.
    pub text: String,
    /// Octets of `text` that are wrong.
    pub span: Range<usize>,
    /// What is wrong.
    pub kind: ErrorKind,
    /// Subroutine calls that led there, the last one first.
    pub calls: Vec<CallSite>,
}

/// A call of a subroutine under way.
#[derive(Clone, Debug, PartialEq)]
pub struct CallSite {
    /// Label of the subroutine.
    pub subroutine: String,
    /// File with the call; empty: the program itself.
    pub file: String,
    /// Line with the call, counted from 1.
    pub line: u32,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.file.is_empty() {
            write!(f, "{}:", self.file)?;
        }
        write!(f, "{}:{}: {}", self.line, self.column, self.kind)
    }
}

impl std::error::Error for Error {}

impl Error {
    /// An error at `span` of a line.
    pub(crate) fn at(file: &str, line: u32, octets: &[u8], span: Range<usize>, kind: ErrorKind) -> Error {
        // Octets that are no UTF-8 grow when shown, so places are counted in what is shown.
        let unseen = |letter: char| letter.is_control() && letter != '\t';
        let shown = |octets: &[u8]| String::from_utf8_lossy(octets).replace(unseen, " ");
        let end = span.end.min(octets.len());
        let start = span.start.min(end);
        let before = shown(&octets[..start]);
        let marked = shown(&octets[start..end]);
        let column = 1 + before.chars().count() as u32;
        let span = before.len()..before.len() + marked.len();
        Error {
            file: file.into(),
            line,
            column,
            text: format!("{before}{marked}{}", shown(&octets[end..])),
            span,
            kind,
            calls: Vec::new(),
        }
    }

    /// The message with the line of the program and a mark under what is wrong; plain text of several lines.
    ///
    /// `path`: name of the program.
    pub fn render(&self, path: &str) -> String {
        let name = |file: &str| if file.is_empty() { path } else { file }.to_string();
        let file = name(&self.file);
        let title = self.kind.to_string();
        let snippet = Snippet::source(self.text.as_str())
            .path(file.as_str())
            .line_start(self.line as usize)
            .annotation(AnnotationKind::Primary.span(self.span.clone()));
        let report = [Level::ERROR.primary_title(title.as_str()).element(snippet)];
        let mut shown = Renderer::plain().render(&report);
        for call in &self.calls {
            shown += &format!(
                "\n  in {}, called at {}:{}",
                call.subroutine,
                name(&call.file),
                call.line
            );
        }
        shown
    }
}
