//! Walking a TOML document: every key is asked for once, and what nobody asks for is an error.
//!
//! In:  a parsed table with the place of every key and value.
//! Out: leaf values through serde; errors in one list, so that one mistake does not hide another.

use super::errors::{ConfigError, nearest};
use serde::de::DeserializeOwned;
use std::cell::RefCell;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Errors found so far, and the text that they point into.
pub(super) struct Findings<'t> {
    text: &'t str,
    errors: RefCell<Vec<ConfigError>>,
}

impl<'t> Findings<'t> {
    pub(super) fn new(text: &'t str) -> Findings<'t> {
        Findings {
            text,
            errors: RefCell::default(),
        }
    }

    pub(super) fn into_errors(self) -> Vec<ConfigError> {
        self.errors.into_inner()
    }

    pub(super) fn add(&self, span: Range<usize>, key: &str, value: &str, rule: impl Into<String>) {
        self.errors
            .borrow_mut()
            .push(ConfigError::at(self.text, span, key, value, rule.into()));
    }

    /// An error of a value that could be read; shows it as written.
    pub(super) fn add_found<T>(&self, found: &Located<T>, rule: impl Into<String>) {
        self.add(found.span.clone(), &found.key, &self.source(&found.span), rule);
    }

    fn add_with_hint(&self, span: Range<usize>, key: &str, rule: String, hint: Option<&str>) {
        let mut error = ConfigError::at(self.text, span, key, "", rule);
        error.hint = hint.map(String::from);
        self.errors.borrow_mut().push(error);
    }

    fn source(&self, span: &Range<usize>) -> String {
        const LONGEST: usize = 60;
        let source = self.text.get(span.clone()).unwrap_or_default();
        match source.char_indices().nth(LONGEST) {
            Some((end, _)) => format!("{}...", &source[..end]),
            None => source.into(),
        }
    }
}

/// A value and where it stands.
#[derive(Clone, Debug)]
pub(super) struct Located<T> {
    pub(super) value: T,
    pub(super) span: Range<usize>,
    /// Path of the key.
    pub(super) key: String,
}

/// One table of the document.
pub(super) struct Cursor<'f, 't> {
    findings: &'f Findings<'t>,
    table: DeTable<'t>,
    /// Where the table stands.
    pub(super) span: Range<usize>,
    /// Path of the table, empty for the document.
    pub(super) path: String,
    known: Vec<&'static str>,
}

impl<'f, 't> Cursor<'f, 't> {
    pub(super) fn new(findings: &'f Findings<'t>, table: Spanned<DeTable<'t>>, path: &str) -> Cursor<'f, 't> {
        let span = table.span();
        Cursor {
            findings,
            table: table.into_inner(),
            span,
            path: path.into(),
            known: Vec::new(),
        }
    }

    fn key_path(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.into()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    fn take(&mut self, key: &'static str) -> Option<(Range<usize>, Spanned<DeValue<'t>>)> {
        self.known.push(key);
        let (found, value) = self.table.remove_entry(key)?;
        Some((found.span(), value))
    }

    /// A value that may be left out.
    pub(super) fn optional<T: DeserializeOwned>(&mut self, key: &'static str) -> Option<Located<T>> {
        let (_, value) = self.take(key)?;
        self.leaf(&self.key_path(key), value)
    }

    /// A value that may be left out; `Err`: it is there but cannot be read, which is reported.
    pub(super) fn optional_or_error<T: DeserializeOwned>(
        &mut self,
        key: &'static str,
    ) -> Result<Option<Located<T>>, ()> {
        match self.take(key) {
            None => Ok(None),
            Some((_, value)) => self.leaf(&self.key_path(key), value).map(Some).ok_or(()),
        }
    }

    /// A value that must be there.
    pub(super) fn required<T: DeserializeOwned>(&mut self, key: &'static str) -> Option<Located<T>> {
        match self.take(key) {
            Some((_, value)) => self.leaf(&self.key_path(key), value),
            None => {
                self.missing(key);
                None
            }
        }
    }

    fn missing(&self, key: &str) {
        self.findings.add(self.header(), &self.key_path(key), "", "is missing");
    }

    /// The first line of the table: where a missing key is reported.
    fn header(&self) -> Range<usize> {
        let rest = &self.findings.text[self.span.start..self.span.end.max(self.span.start)];
        self.span.start..self.span.start + rest.find('\n').unwrap_or(rest.len())
    }

    fn leaf<T: DeserializeOwned>(&self, key: &str, value: Spanned<DeValue<'t>>) -> Option<Located<T>> {
        let span = value.span();
        match T::deserialize(ValueDeserializer::from(value)) {
            Ok(value) => Some(Located {
                value,
                span,
                key: key.into(),
            }),
            Err(error) => {
                let place = error.span().unwrap_or(span.clone());
                self.findings
                    .add(place, key, &self.findings.source(&span), error.message());
                None
            }
        }
    }

    /// A table that may be left out.
    pub(super) fn table(&mut self, key: &'static str) -> Option<Cursor<'f, 't>> {
        let path = self.key_path(key);
        let (key_span, value) = self.take(key)?;
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => {
                let span = if span.is_empty() { key_span } else { span };
                Some(Cursor {
                    findings: self.findings,
                    table,
                    span,
                    path,
                    known: Vec::new(),
                })
            }
            other => {
                let rule = format!("must be a table, not a {}", other.type_str());
                self.findings.add(span, &path, "", rule);
                None
            }
        }
    }

    /// A table that must be there.
    pub(super) fn required_table(&mut self, key: &'static str) -> Option<Cursor<'f, 't>> {
        if !self.table.contains_key(key) {
            self.known.push(key);
            self.findings
                .add(0..0, &self.key_path(key), "", format!("the table [{key}] is missing"));
            return None;
        }
        self.table(key)
    }

    /// An array of tables; left out it is empty.
    pub(super) fn tables(&mut self, key: &'static str) -> Vec<Cursor<'f, 't>> {
        let path = self.key_path(key);
        let Some((_, value)) = self.take(key) else {
            return Vec::new();
        };
        let span = value.span();
        let DeValue::Array(items) = value.into_inner() else {
            self.findings
                .add(span, &path, "", format!("must be an array of tables: [[{path}]]"));
            return Vec::new();
        };
        let mut cursors = Vec::new();
        for (index, item) in items.into_iter().enumerate() {
            let (path, span) = (format!("{path}[{index}]"), item.span());
            match item.into_inner() {
                DeValue::Table(table) => {
                    cursors.push(Cursor {
                        findings: self.findings,
                        table,
                        span,
                        path,
                        known: Vec::new(),
                    });
                }
                other => {
                    self.findings
                        .add(span, &path, "", format!("must be a table, not a {}", other.type_str()));
                }
            }
        }
        cursors
    }

    /// Keys that are part of the design but not of this version: a named error instead of silence.
    pub(super) fn refuse_unsupported(&mut self, keys: &[&'static str]) {
        for key in keys {
            if let Some((span, _)) = self.take(key) {
                self.findings.add(span, &self.key_path(key), "", "is not supported yet");
            }
        }
    }

    /// Reports every key that nobody asked for.
    pub(super) fn finish(self) {
        for key in self.table.keys() {
            let name: &str = key.get_ref();
            let hint = nearest(name, self.known.iter().copied());
            self.findings
                .add_with_hint(key.span(), &self.key_path(name), "unknown key".into(), hint);
        }
    }
}
