//! Access to a TOML document that notes every error with its place and goes on.
//!
//! In:  the spanned document of `toml`.
//! Out: plain values, `None` where one is missing or wrong; what is wrong stands in the [`Log`].
//!
//! Deserialising with serde would stop at the first wrong type or unknown key and so hide every other error; here each
//! key is read by itself.

use super::error::{ConfigError, lines, nearest};
use super::question::{Bound, Question};
use std::cell::{Cell, RefCell};
use std::ops::{Range, RangeInclusive};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Errors of a file that are told; the others are counted.
const ERRORS_MAX: usize = 100;
/// Most items of an array: beyond all that a machine has, and few enough to be compared with each other.
const ITEMS_MAX: usize = 4096;

/// Collects the errors of one file.
pub(super) struct Log<'d> {
    file: &'d str,
    text: &'d str,
    /// First octet of each line.
    lines: Vec<usize>,
    errors: RefCell<Vec<ConfigError>>,
    /// Errors beyond those that are told.
    more: Cell<usize>,
    /// Stands for a section that is left out.
    pub(super) nothing: DeTable<'d>,
    #[cfg(feature = "testing")]
    questions: RefCell<Vec<(String, Question)>>,
}

impl<'d> Log<'d> {
    pub(super) fn new(file: &'d str, text: &'d str) -> Log<'d> {
        Log {
            file,
            text,
            lines: lines(text),
            errors: RefCell::default(),
            more: Cell::default(),
            nothing: DeTable::new(),
            #[cfg(feature = "testing")]
            questions: RefCell::default(),
        }
    }

    /// Notes what is asked of a key.
    #[cfg(feature = "testing")]
    pub(super) fn asked(&self, key: &str, question: Question) {
        self.questions.borrow_mut().push((key.to_owned(), question));
    }

    #[cfg(not(feature = "testing"))]
    pub(super) fn asked(&self, _key: &str, _question: Question) {}

    /// All that was asked, in its order.
    #[cfg(feature = "testing")]
    pub(super) fn into_questions(self) -> Vec<(String, Question)> {
        self.questions.into_inner()
    }

    /// Notes an error about the value at `span`.
    pub(super) fn wrong(&self, span: Range<usize>, key: &str, rule: impl Into<String>, hint: Option<String>) {
        let value = self.text.get(span.clone()).map(shortened);
        self.note(span, key, value, rule.into(), hint);
    }

    /// Notes an error about a key that is missing or not wanted.
    pub(super) fn misplaced(&self, span: Range<usize>, key: &str, rule: impl Into<String>, hint: Option<String>) {
        self.note(span, key, None, rule.into(), hint);
    }

    fn note(&self, span: Range<usize>, key: &str, value: Option<String>, rule: String, hint: Option<String>) {
        let mut errors = self.errors.borrow_mut();
        if errors.len() == ERRORS_MAX {
            self.more.set(self.more.get() + 1);
            return;
        }
        let mut error = ConfigError::at(self.file, (self.text, &self.lines), span, key.to_owned(), rule);
        (error.value, error.hint) = (value, hint);
        errors.push(error);
    }

    /// Whether more errors would only be counted.
    pub(super) fn is_full(&self) -> bool {
        self.errors.borrow().len() == ERRORS_MAX
    }

    /// The errors, and how many more there are.
    pub(super) fn into_errors(self) -> (Vec<ConfigError>, usize) {
        (self.errors.into_inner(), self.more.get())
    }
}

/// One line of the source, not too long for a message.
fn shortened(source: &str) -> String {
    let line = source.lines().next().unwrap_or("");
    if line.len() == source.len() && line.chars().count() <= 60 {
        line.to_owned()
    } else {
        line.chars().take(57).chain("...".chars()).collect()
    }
}

/// A value whose type something else decides.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Scalar {
    Flag(bool),
    Integer(i64),
    Number(f64),
    Word(String),
}

/// An integer of a type that a range names.
pub(super) trait Whole: Copy {
    fn narrow(value: i64) -> Option<Self>;
    fn wide(self) -> i64;
}

macro_rules! whole {
    ($($type:ty)*) => {
        $(impl Whole for $type {
            fn narrow(value: i64) -> Option<$type> {
                value.try_into().ok()
            }

            fn wide(self) -> i64 {
                self as i64
            }
        })*
    };
}
whole!(i8 u8 i16 u16 i32 u32 i64 usize);

/// A value and its place.
#[derive(Clone, Copy)]
pub(super) struct Item<'d, 'l> {
    pub(super) log: &'l Log<'d>,
    pub(super) value: &'l Spanned<DeValue<'d>>,
}

impl<'d, 'l> Item<'d, 'l> {
    /// Notes an error about it.
    pub(super) fn wrong(self, key: &str, rule: impl Into<String>) {
        self.log.wrong(self.value.span(), key, rule, None);
    }

    /// Whether it is this text; notes nothing.
    pub(super) fn is(self, text: &str) -> bool {
        self.value.get_ref().as_str() == Some(text)
    }

    /// As [`Item::refused`], with what is near to it: a word.
    pub(super) fn no_word<T>(self, key: &str, rule: impl Into<String>, near: Option<&str>) -> Option<T> {
        let hint = near.map(|near| format!("did you mean {near:?}?"));
        self.log.wrong(self.value.span(), key, rule, hint);
        None
    }

    /// As [`Item::wrong`], in place of what was to be read.
    pub(super) fn refused<T>(self, key: &str, rule: impl Into<String>) -> Option<T> {
        self.wrong(key, rule);
        None
    }

    pub(super) fn is_no(self, key: &str, wanted: &str) {
        let came = match self.value.get_ref() {
            DeValue::String(_) => "a string",
            DeValue::Integer(_) => "an integer",
            DeValue::Float(_) => "a float",
            DeValue::Boolean(_) => "a boolean",
            DeValue::Datetime(_) => "a date or time",
            DeValue::Array(_) => "an array",
            DeValue::Table(_) => "a table",
        };
        self.wrong(key, format!("must be {wanted}, is {came}"));
    }

    pub(super) fn integer<T: Whole>(self, key: &str, range: RangeInclusive<T>) -> Option<T> {
        let range = range.start().wide()..=range.end().wide();
        self.log.asked(key, Question::Integer(range.clone()));
        let Some(integer) = self.value.get_ref().as_integer() else {
            self.is_no(key, "an integer");
            return None;
        };
        match i64::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(value) if range.contains(&value) => T::narrow(value),
            _ => {
                self.wrong(
                    key,
                    format!("must be an integer from {} to {}", range.start(), range.end()),
                );
                None
            }
        }
    }

    pub(super) fn number(self, key: &str, bound: Bound) -> Option<f64> {
        self.log.asked(key, Question::Number(bound));
        let value = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
                .ok()
                .map(|value| value as f64),
            _ => {
                self.is_no(key, "a number");
                return None;
            }
        };
        // What does not even parse is out of every range.
        let value = value.unwrap_or(f64::INFINITY);
        match bound.broken_by(value) {
            None => Some(value),
            Some(rule) => {
                self.wrong(key, rule);
                None
            }
        }
    }

    pub(super) fn text(self, key: &str) -> Option<&'l str> {
        self.log.asked(key, Question::Text);
        let text = self.value.get_ref().as_str();
        if text.is_none() {
            self.is_no(key, "a string");
        }
        text
    }

    pub(super) fn word<T: Copy>(self, key: &str, words: &[(&'static str, T)]) -> Option<T> {
        let listed = words.iter().map(|(word, _)| *word).collect();
        self.log.asked(key, Question::Word(listed));
        let Some(text) = self.value.get_ref().as_str() else {
            self.is_no(key, &alternatives(words));
            return None;
        };
        let found = words.iter().find(|(word, _)| *word == text).map(|(_, value)| *value);
        found.or_else(|| {
            let near = nearest(text, words.iter().map(|(word, _)| *word));
            self.no_word(key, format!("must be {}", alternatives(words)), near)
        })
    }

    pub(super) fn flag(self, key: &str) -> Option<bool> {
        self.log.asked(key, Question::Flag);
        let flag = self.value.get_ref().as_bool();
        if flag.is_none() {
            self.is_no(key, "true or false");
        }
        flag
    }

    /// A value of any of these types; a float is finite.
    pub(super) fn scalar(self, key: &str) -> Option<Scalar> {
        self.log.asked(key, Question::Scalar);
        let finite = |value: &f64| value.is_finite();
        let scalar = match self.value.get_ref() {
            DeValue::Boolean(value) => Some(Scalar::Flag(*value)),
            DeValue::String(word) => Some(Scalar::Word(word.to_string())),
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
                .ok()
                .map(Scalar::Integer),
            DeValue::Float(float) => float.as_str().parse().ok().filter(finite).map(Scalar::Number),
            DeValue::Datetime(_) | DeValue::Array(_) | DeValue::Table(_) => None,
        };
        if scalar.is_none() {
            self.is_no(key, "true, false, a finite number or a word");
        }
        scalar
    }

    /// Whether an array is as short as one may be; else notes an error.
    pub(super) fn is_short(self, key: &str, count: usize) -> bool {
        if count > ITEMS_MAX {
            let rule = format!("must not have more than {ITEMS_MAX} items, has {count}");
            self.log.misplaced(self.value.span(), key, rule, None);
        }
        count <= ITEMS_MAX
    }

    pub(super) fn items(self, key: &str) -> Option<Vec<Item<'d, 'l>>> {
        self.log.asked(key, Question::Array);
        let array = self.value.get_ref().as_array();
        if array.is_none() {
            self.is_no(key, "an array");
        }
        let array = array.filter(|array| self.is_short(key, array.len()))?;
        Some(array.iter().map(|value| Item { log: self.log, value }).collect())
    }

    /// The items of an array, each read by itself.
    pub(super) fn list<T>(self, key: &str, mut read: impl FnMut(Item<'d, 'l>, &str) -> Option<T>) -> Option<Vec<T>> {
        let items = self.items(key)?.into_iter().enumerate();
        let found: Vec<_> = items.map(|(at, item)| read(item, &format!("{key}[{at}]"))).collect();
        found.into_iter().collect()
    }
}

/// Words as a message lists them: `"a" or "b"`.
pub(super) fn alternatives<T>(words: &[(&'static str, T)]) -> String {
    let quoted: Vec<String> = words.iter().map(|(word, _)| format!("{word:?}")).collect();
    quoted.join(" or ")
}
