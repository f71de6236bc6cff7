//! A mistake at a place of a table file: tool table, parameter file.
//!
//! In:  from the readers of those files.
//! Out: to whoever set the machine up: one line by `Display`, or with the line of the file around it by
//!      [`Located::render`].

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

/// Mistakes of a file that are told: behind so many, the file is not what it is taken for.
pub(crate) const MISTAKES_MAX: usize = 100;

/// What is wrong (`kind`), and where.
#[derive(Clone, Debug, PartialEq)]
pub struct Located<Kind> {
    /// Line, counted from 1.
    pub line: u32,
    /// Character in the line, counted from 1.
    pub column: u32,
    /// Octets of the line, without its end, that are wrong.
    pub span: Range<usize>,
    /// What is wrong.
    pub kind: Kind,
}

impl<Kind: fmt::Display> fmt::Display for Located<Kind> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.line, self.column, self.kind)
    }
}

impl<Kind: fmt::Debug + fmt::Display> std::error::Error for Located<Kind> {}

impl<Kind: fmt::Display> Located<Kind> {
    /// `index` counts lines from 0; `span` are octets of `text`, the line, at character boundaries.
    pub(crate) fn at(index: usize, text: &str, span: Range<usize>, kind: Kind) -> Located<Kind> {
        let characters = text[..span.start].chars().count();
        Located {
            line: u32::try_from(index + 1).unwrap_or(u32::MAX),
            column: u32::try_from(characters + 1).unwrap_or(u32::MAX),
            span,
            kind,
        }
    }

    /// The message with the line of the file and a mark under what is wrong; plain text of several lines.
    ///
    /// `text` is the file that was read, `path` its name.
    pub fn render(&self, path: &str, text: &[u8]) -> String {
        self.rendered(Level::ERROR, path, text)
    }

    /// The same of what is no mistake, but should be known.
    pub fn render_warning(&self, path: &str, text: &[u8]) -> String {
        self.rendered(Level::WARNING, path, text)
    }

    fn rendered(&self, level: Level<'_>, path: &str, text: &[u8]) -> String {
        let line = lines(text)
            .nth((self.line as usize).saturating_sub(1))
            .map(text_of)
            .unwrap_or_default();
        // Another text than the one that was read must not end in a panic.
        let span = Some(self.span.clone()).filter(|span| line.get(span.clone()).is_some());
        let title = self.kind.to_string();
        let snippet = Snippet::source(line.as_str())
            .path(path)
            .line_start(self.line as usize)
            .annotation(AnnotationKind::Primary.span(span.unwrap_or_default()));
        let report = [level.primary_title(title.as_str()).element(snippet)];
        Renderer::plain().render(&report)
    }
}

/// The lines of a file without their ends.
pub(crate) fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let lines = files::without_mark(text).split_inclusive(|octet| *octet == b'\n');
    lines.map(|line| {
        let end = line.iter().rposition(|octet| !matches!(octet, b'\n' | b'\r'));
        &line[..end.map_or(0, |last| last + 1)]
    })
}

/// A line as text. One that is no UTF-8 is taken as Latin-1, in which old files were written.
pub(crate) fn text_of(line: &[u8]) -> String {
    match std::str::from_utf8(line) {
        Ok(text) => text.to_owned(),
        Err(_) => line.iter().map(|octet| char::from(*octet)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_with_either_mark_or_the_text() {
        let read = |text: &'static [u8]| lines(text).map(text_of).collect::<Vec<_>>();
        assert_eq!(read(b"\xEF\xBB\xBFa\r\nb\n\nc"), ["a", "b", "", "c"]);
        assert_eq!(read(b"a\n"), ["a"]);
        assert!(read(b"").is_empty());
        assert_eq!(read(b"fr\xE4ser\nfr\xC3\xA4ser"), ["fräser", "fräser"]);
    }

    #[test]
    fn the_mark_stands_under_the_text() {
        let text = b"first\nfr\xE4ser xx\n";
        let line = text_of(lines(text).nth(1).unwrap());
        let error = Located::at(1, &line, 8..10, "no number");
        assert_eq!(error.to_string(), "2:8: no number");
        let shown = error.render("tool.tbl", text);
        let rows: Vec<&str> = shown.lines().collect();
        assert_eq!(rows[0], "error: no number");
        assert!(rows[1].ends_with("tool.tbl:2:8"), "{shown}");
        assert!(error.render("tool.tbl", b"").contains("no number"));
        let at = rows[3].find("xx").map(|at| rows[3][..at].chars().count());
        assert_eq!(at, rows[4].find("^^"), "{shown}");
    }
}
