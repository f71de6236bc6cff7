//! Errors of the machine file: what is wrong, where, and what would be right.
//!
//! In:  from the sections' checks, in any order.
//! Out: text for a terminal (`file:line:column: key = value: rule`, the place underlined) or JSON, in the order of
//! the file.

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

/// Octets of a line that are shown.
const EXCERPT_MAX: usize = 400;

/// One thing wrong with a machine file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigError {
    /// The file as it was named.
    pub file: String,
    /// Line and column, both counted from 1, the column in characters; `None`: the file as a whole.
    pub place: Option<(usize, usize)>,
    /// Path of the key: `joint[0].homing.method`; empty where the text is no TOML.
    pub key: String,
    /// The value as it is written, shortened; `None`: there is none.
    pub value: Option<String>,
    /// What a right value would be.
    pub rule: String,
    /// The nearest valid word, or what to do.
    pub hint: Option<String>,
    /// Line of the file that holds the place, and the octets of it that are meant.
    excerpt: Option<(String, Range<usize>)>,
    /// Order in the file.
    at: usize,
}

impl ConfigError {
    /// An error at octets `span` of `text`. A span outside the text, or inside a character, is moved to the nearest place.
    /// `lines` are the first octets of its lines ([`lines`]).
    pub(super) fn at(
        file: &str,
        (text, lines): (&str, &[usize]),
        span: Range<usize>,
        key: String,
        rule: String,
    ) -> ConfigError {
        let start = char_boundary(text, span.start);
        let number = lines.partition_point(|line| *line <= start).max(1);
        let line_start = lines[number - 1];
        let line_end = lines.get(number).map_or(text.len(), |next| next - 1);
        let line = text[line_start..line_end].trim_end_matches('\r');
        let from = (start - line_start).min(line.len());
        let to = char_boundary(line, span.end.saturating_sub(line_start)).max(from);
        let column = 1 + line[..from].chars().count();
        // Of a line that nobody wrote by hand the part around the place is enough.
        let cut = char_boundary(line, from.saturating_sub(EXCERPT_MAX / 2));
        let cut = if line.len() > EXCERPT_MAX { cut } else { 0 };
        let line = &line[cut..char_boundary(line, cut + EXCERPT_MAX)];
        ConfigError {
            file: file.to_owned(),
            place: Some((number, column)),
            key,
            value: None,
            rule,
            hint: None,
            excerpt: Some((line.to_owned(), from - cut..(to - cut).min(line.len()))),
            at: start,
        }
    }

    /// An error of the file as a whole: it cannot be read.
    pub(super) fn whole(file: &str, rule: String) -> ConfigError {
        ConfigError {
            file: file.to_owned(),
            place: None,
            key: String::new(),
            value: None,
            rule,
            hint: None,
            excerpt: None,
            at: 0,
        }
    }

    fn render(&self) -> String {
        let title = self.to_string();
        let title = Level::ERROR.primary_title(title);
        let group = match (&self.excerpt, self.place) {
            (Some((line, span)), Some((number, _))) => title.element(
                Snippet::source(line.as_str())
                    .line_start(number)
                    .annotation(AnnotationKind::Primary.span(span.clone())),
            ),
            _ => title.elements(std::iter::empty::<annotate_snippets::Element<'_>>()),
        };
        Renderer::plain().render(&[group])
    }
}

/// One line: `mill.toml:42:14: joint[0].velocity_mm_s = -5: must be above 0`.
impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some((line, column)) = self.place {
            write!(f, ":{line}:{column}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        if let Some(value) = &self.value {
            write!(f, " = {value}")?;
        }
        write!(f, ": {}", self.rule)?;
        if let Some(hint) = &self.hint {
            write!(f, "; {hint}")?;
        }
        Ok(())
    }
}

/// Everything wrong with a machine file, in the order of the file; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigErrors {
    errors: Vec<ConfigError>,
    /// Errors that are not told.
    more: usize,
}

impl ConfigErrors {
    /// Sorts by place; of two errors with one text only the first is kept.
    pub(super) fn new(mut errors: Vec<ConfigError>, more: usize) -> ConfigErrors {
        errors.sort_by_key(|error| error.at);
        errors.dedup();
        ConfigErrors { errors, more }
    }

    /// The errors that are told, in the order of the file; never empty.
    pub fn errors(&self) -> &[ConfigError] {
        &self.errors
    }

    /// One line for each error.
    pub fn lines(&self) -> impl Iterator<Item = String> + '_ {
        self.errors.iter().map(ConfigError::to_string)
    }

    /// The `file` and its `errors`: objects with `line`, `column`, `key`, `value`, `rule` and `hint`.
    pub fn to_json(&self) -> serde_json::Value {
        let errors = self.errors.iter().map(|error| {
            serde_json::json!({
                "line": error.place.map(|place| place.0),
                "column": error.place.map(|place| place.1),
                "key": error.key,
                "value": error.value,
                "rule": error.rule,
                "hint": error.hint,
            })
        });
        serde_json::json!({ "file": self.errors.first().map(|error| &error.file), "errors": errors.collect::<Vec<_>>(), "more": self.more })
    }
}

/// All errors, each with the line of the file and the place in it underlined.
impl fmt::Display for ConfigErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for error in &self.errors {
            writeln!(f, "{}", error.render())?;
        }
        match self.errors.len() + self.more {
            1 => writeln!(f, "1 error in the machine file"),
            count => writeln!(f, "{count} errors in the machine file"),
        }
    }
}

impl std::error::Error for ConfigErrors {}

/// The first octet of each line of a text.
pub(super) fn lines(text: &str) -> Vec<usize> {
    let behind = text.match_indices('\n').map(|(newline, _)| newline + 1);
    std::iter::once(0).chain(behind).collect()
}

/// The start of the character at `at`, or the end of the text.
fn char_boundary(text: &str, at: usize) -> usize {
    let at = at.min(text.len());
    (0..=at).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// The word of `known` that was most likely meant by `word`.
pub(super) fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word: Vec<char> = word.chars().take(64).flat_map(char::to_lowercase).collect();
    let near_enough = (word.len() / 3).max(1);
    known
        .into_iter()
        .map(|candidate| {
            let letters: Vec<char> = candidate.chars().flat_map(char::to_lowercase).collect();
            // A unit that was left off is no misspelling: `acceleration` for `acceleration_mm_s2`.
            let part = word.len() >= 4 && (letters.starts_with(&word) || letters.ends_with(&word));
            (if part { 0 } else { edits(&word, &letters) }, candidate)
        })
        .filter(|(distance, _)| *distance <= near_enough)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Least number of letters to change, add, drop or swap with the neighbour.
fn edits(a: &[char], b: &[char]) -> usize {
    let mut before = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let change = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = change.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_word_is_found_or_none() {
        let known = ["velocity_mm_s", "acceleration_mm_s2", "jerk_mm_s3", "node"];
        assert_eq!(nearest("acceleration_mm_s", known), Some("acceleration_mm_s2"));
        assert_eq!(nearest("acceleration", known), Some("acceleration_mm_s2"));
        assert_eq!(nearest("VELOCITY_mm_s", known), Some("velocity_mm_s"));
        assert_eq!(nearest("ndoe", known), Some("node"));
        assert_eq!(nearest("spindle", known), None);
        assert_eq!(nearest("", known), None);
    }

    #[test]
    fn edits_counts_a_swap_as_one() {
        let count = |a: &str, b: &str| edits(&a.chars().collect::<Vec<_>>(), &b.chars().collect::<Vec<_>>());
        assert_eq!(count("node", "node"), 0);
        assert_eq!(count("ndoe", "node"), 1);
        assert_eq!(count("kitten", "sitting"), 3);
        assert_eq!(count("", "abc"), 3);
    }

    #[test]
    fn columns_count_characters_and_the_place_is_underlined() {
        let text = "a = 1\nname = \"µ\" # x\nb = 2\n";
        let start = text.find('#').unwrap();
        let error = ConfigError::at(
            "m.toml",
            (text, &lines(text)),
            start..start + 3,
            "name".into(),
            "no".into(),
        );
        assert_eq!(error.place, Some((2, 12)));
        assert_eq!(
            ConfigErrors::new(vec![error], 0).to_string(),
            "error: m.toml:2:12: name: no\n  |\n2 | name = \"µ\" # x\n  |            ^^^\n1 error in the machine file\n"
        );
    }

    #[test]
    fn any_span_finds_a_place() {
        let text = "ä\r\n\nö";
        for start in 0..8 {
            for end in 0..8 {
                let error = ConfigError::at("m", (text, &lines(text)), start..end, String::new(), String::new());
                assert!(!error.render().is_empty());
            }
        }
    }
}
