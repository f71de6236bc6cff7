//! Errors of a machine file: what is wrong where, and what would be right.

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use serde::Serialize;
use std::fmt;
use std::ops::Range;

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ConfigError {
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
    /// Octets of the place in the file.
    pub span: Range<usize>,
    /// Where it belongs, for example `joint[1].travel_mm`; empty for the file as a whole.
    pub key: String,
    /// The value as written, shortened; empty if the key itself is wrong or missing.
    pub value: String,
    /// What was expected.
    pub rule: String,
    /// What was probably meant.
    pub hint: Option<String>,
}

/// Everything that is wrong with a machine file, in the order of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigErrors {
    path: String,
    text: String,
    errors: Vec<ConfigError>,
}

impl ConfigErrors {
    pub(super) fn new(path: &str, text: &str, mut errors: Vec<ConfigError>) -> ConfigErrors {
        errors.sort_by_key(|error| (error.span.start, error.span.end));
        ConfigErrors {
            path: path.into(),
            text: text.into(),
            errors,
        }
    }

    /// The errors in the order of the file; never empty.
    pub fn errors(&self) -> &[ConfigError] {
        &self.errors
    }

    /// The errors with the file's name, as a JSON value.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::json!({ "file": self.path, "errors": self.errors })
    }

    /// One line for each error: `file:line:column: key = value: rule`.
    pub fn lines(&self) -> impl Iterator<Item = String> + '_ {
        self.errors
            .iter()
            .map(|error| format!("{}:{}:{}: {}", self.path, error.line, error.column, error.text()))
    }
}

impl ConfigError {
    /// An error at a place of the text.
    pub(super) fn at(text: &str, span: Range<usize>, key: &str, value: &str, rule: String) -> ConfigError {
        let before = text.get(..span.start).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        ConfigError {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            span,
            key: key.into(),
            value: value.into(),
            rule,
            hint: None,
        }
    }

    fn text(&self) -> String {
        let mut text = match (self.key.as_str(), self.value.as_str()) {
            ("", _) => self.rule.clone(),
            (key, "") => format!("{key}: {}", self.rule),
            (key, value) => format!("{key} = {value}: {}", self.rule),
        };
        if let Some(hint) = &self.hint {
            text += &format!(" (did you mean `{hint}`?)");
        }
        text
    }
}

impl fmt::Display for ConfigErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let renderer = Renderer::plain();
        for error in &self.errors {
            let title = error.text();
            let end = error.span.end.max(error.span.start).min(self.text.len());
            let snippet = Snippet::source(&self.text)
                .path(&self.path)
                .annotation(AnnotationKind::Primary.span(error.span.start.min(end)..end));
            let report = [Level::ERROR.primary_title(&title).element(snippet)];
            writeln!(f, "{}\n", renderer.render(&report))?;
        }
        match self.errors.len() {
            1 => writeln!(f, "1 error in {}", self.path),
            count => writeln!(f, "{count} errors in {}", self.path),
        }
    }
}

impl std::error::Error for ConfigErrors {}

/// The candidate that is nearest to `word`, if one is near enough to be meant.
pub(super) fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let near = candidates
        .into_iter()
        .map(|candidate| (distance(word, candidate), candidate));
    let (distance, candidate) = near.min_by_key(|(distance, _)| *distance)?;
    (distance <= word.chars().count().max(3) / 3).then_some(candidate)
}

/// Edit distance of Levenshtein.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, to) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_pen_finds_its_word() {
        let words = ["velocity_mm_s", "acceleration_mm_s2", "jerk_mm_s3"];
        assert_eq!(nearest("acceleraton_mm_s2", words), Some("acceleration_mm_s2"));
        assert_eq!(nearest("colour", words), None);
    }

    #[test]
    fn the_place_counts_characters_and_lines_from_one() {
        let error = ConfigError::at("a = 1\nü = 2\n", 11..12, "ü", "2", "is wrong".into());
        assert_eq!((error.line, error.column), (2, 5));
    }
}
