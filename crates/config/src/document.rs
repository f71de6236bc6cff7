//! Access to a TOML document that notes every error with its place and goes on.
//!
//! In:  the spanned document of `toml`.
//! Out: plain values, `None` where one is missing or wrong; what is wrong stands in the [`Log`].
//!
//! Deserialising with serde would stop at the first wrong type or unknown key and so hide every other error; here each
//! key is read by itself.

use super::error::{ConfigError, lines, nearest};
use std::cell::{Cell, RefCell};
use std::ops::{Range, RangeInclusive};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Errors of a file that are told; the others are counted.
const ERRORS_MAX: usize = 100;
/// Most items of an array: beyond all that a machine has, and few enough to be compared with each other.
const ITEMS_MAX: usize = 4096;

/// What a reader asks of a key. The schema of the machine file and the table of its keys are made of these questions, so that
/// neither can say anything else than the reader.
#[derive(Clone, Debug, PartialEq)]
pub enum Question {
    /// Whether it is there, which is all that is asked of it for now.
    IsThere,
    /// What it is, if it is there.
    Optional,
    /// It must be there.
    Required,
    /// What holds where it is left out.
    Default(serde_json::Value),
    /// A whole number in this range.
    Integer(RangeInclusive<i64>),
    Number(Bound),
    Text,
    /// One of these words.
    Word(Vec<&'static str>),
    /// `true` or `false`.
    Flag,
    /// `true` or `false`, a number or a word: something else decides which.
    Scalar,
    /// An array, of what is asked of its items.
    Array,
    Table,
    /// An array of tables.
    Tables,
    /// All keys of a table, which the user chooses.
    Names,
}

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
    nothing: DeTable<'d>,
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
    fn asked(&self, key: &str, question: Question) {
        self.questions.borrow_mut().push((key.to_owned(), question));
    }

    #[cfg(not(feature = "testing"))]
    fn asked(&self, _key: &str, _question: Question) {}

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
    fn is_full(&self) -> bool {
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

/// What a number must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// Any finite number not greater than this in size.
    Size(f64),
    /// Above 0, up to this.
    Positive(f64),
    /// From, to; both allowed.
    Within(f64, f64),
}

impl Bound {
    fn broken_by(self, value: f64) -> Option<String> {
        if !value.is_finite() {
            return Some("must be a finite number".to_owned());
        }
        match self {
            Bound::Size(size) if value.abs() > size => Some(format!("must lie between -{size} and {size}")),
            Bound::Positive(_) if value <= 0.0 => Some("must be above 0".to_owned()),
            Bound::Positive(most) if value > most => Some(format!("must not be above {most}")),
            Bound::Within(least, most) if !(least..=most).contains(&value) => {
                Some(format!("must lie between {least} and {most}"))
            }
            Bound::Size(_) | Bound::Positive(_) | Bound::Within(..) => None,
        }
    }
}

/// A value and its place.
/// A value whose type something else decides.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Scalar {
    Flag(bool),
    Integer(i64),
    Number(f64),
    Word(String),
}

#[derive(Clone, Copy)]
pub(super) struct Item<'d, 'l> {
    pub(super) log: &'l Log<'d>,
    pub(super) value: &'l Spanned<DeValue<'d>>,
}

impl<'d, 'l> Item<'d, 'l> {
    fn is_no(self, key: &str, wanted: &str) {
        let came = match self.value.get_ref() {
            DeValue::String(_) => "a string",
            DeValue::Integer(_) => "an integer",
            DeValue::Float(_) => "a float",
            DeValue::Boolean(_) => "a boolean",
            DeValue::Datetime(_) => "a date or time",
            DeValue::Array(_) => "an array",
            DeValue::Table(_) => "a table",
        };
        self.log
            .wrong(self.value.span(), key, format!("must be {wanted}, is {came}"), None);
    }

    pub(super) fn integer(self, key: &str, range: RangeInclusive<i64>) -> Option<i64> {
        self.log.asked(key, Question::Integer(range.clone()));
        let Some(integer) = self.value.get_ref().as_integer() else {
            self.is_no(key, "an integer");
            return None;
        };
        match i64::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(value) if range.contains(&value) => Some(value),
            _ => {
                let rule = format!("must be an integer from {} to {}", range.start(), range.end());
                self.log.wrong(self.value.span(), key, rule, None);
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
                self.log.wrong(self.value.span(), key, rule, None);
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
        if found.is_none() {
            let hint = nearest(text, words.iter().map(|(word, _)| *word));
            let hint = hint.map(|word| format!("did you mean {word:?}?"));
            let rule = format!("must be {}", alternatives(words));
            self.log.wrong(self.value.span(), key, rule, hint);
        }
        found
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
    fn scalar(self, key: &str) -> Option<Scalar> {
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
    fn is_short(self, key: &str, count: usize) -> bool {
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
}

/// Words as a message lists them: `"a" or "b"`.
fn alternatives<T>(words: &[(&'static str, T)]) -> String {
    let quoted: Vec<String> = words.iter().map(|(word, _)| format!("{word:?}")).collect();
    quoted.join(" or ")
}

/// A table whose keys are read one by one; [`Section::done`] then names the keys that nobody asked for.
pub(super) struct Section<'d, 'l> {
    log: &'l Log<'d>,
    path: String,
    span: Range<usize>,
    table: &'l DeTable<'d>,
    known: Vec<&'static str>,
}

impl<'d, 'l> Section<'d, 'l> {
    pub(super) fn root(log: &'l Log<'d>, table: &'l DeTable<'d>) -> Section<'d, 'l> {
        Section {
            log,
            path: String::new(),
            span: 0..0,
            table,
            known: Vec::new(),
        }
    }

    /// Full path of a key of this section.
    pub(super) fn key(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    /// Whether a key stands here.
    pub(super) fn has(&self, key: &str) -> bool {
        self.log.asked(&self.key(key), Question::IsThere);
        self.table.contains_key(key)
    }

    /// The value of a key if it stands here.
    pub(super) fn optional(&mut self, key: &'static str) -> Option<Item<'d, 'l>> {
        if !self.known.contains(&key) {
            self.known.push(key);
            self.log.asked(&self.key(key), Question::Optional);
        }
        self.table.get(key).map(|value| Item { log: self.log, value })
    }

    /// The value of a key; missing is an error that says `what` it is.
    pub(super) fn required(&mut self, key: &'static str, what: &str) -> Option<Item<'d, 'l>> {
        self.log.asked(&self.key(key), Question::Required);
        let item = self.optional(key);
        if item.is_none() {
            self.log
                .misplaced(self.span.clone(), &self.key(key), format!("is missing: {what}"), None);
        }
        item
    }

    /// The value of a key that has a default.
    pub(super) fn or(&mut self, key: &'static str, default: impl Fn() -> serde_json::Value) -> Option<Item<'d, 'l>> {
        self.log.asked(&self.key(key), Question::Default(default()));
        self.optional(key)
    }

    /// An integer; left out: `default`.
    pub(super) fn integer(
        &mut self,
        key: &'static str,
        range: RangeInclusive<i64>,
        default: impl Into<Option<i64>>,
    ) -> Option<i64> {
        // Also where it is left out: the range may be another one in another machine.
        self.log.asked(&self.key(key), Question::Integer(range.clone()));
        let item = match default.into() {
            None => self.required(key, &format!("an integer from {} to {}", range.start(), range.end()))?,
            Some(default) => match self.or(key, || default.into()) {
                None => return Some(default),
                Some(item) => item,
            },
        };
        item.integer(&self.key(key), range)
    }

    /// A number; left out: `default`.
    pub(super) fn number(&mut self, key: &'static str, bound: Bound, default: impl Into<Option<f64>>) -> Option<f64> {
        let item = match default.into() {
            None => self.required(key, "a number")?,
            Some(default) => match self.or(key, || default.into()) {
                None => return Some(default),
                Some(item) => item,
            },
        };
        item.number(&self.key(key), bound)
    }

    /// `true` or `false`; left out: `default`.
    pub(super) fn flag(&mut self, key: &'static str, default: bool) -> Option<bool> {
        match self.or(key, || default.into()) {
            None => Some(default),
            Some(item) => item.flag(&self.key(key)),
        }
    }

    /// One of some words; left out: `default`.
    pub(super) fn word<T: Copy + PartialEq>(
        &mut self,
        key: &'static str,
        words: &[(&'static str, T)],
        default: impl Into<Option<T>>,
    ) -> Option<T> {
        let item = match default.into() {
            None => self.required(key, &alternatives(words))?,
            Some(default) => {
                let named = || {
                    words
                        .iter()
                        .find(|(_, value)| *value == default)
                        .map(|(word, _)| *word)
                        .into()
                };
                match self.or(key, named) {
                    None => return Some(default),
                    Some(item) => item,
                }
            }
        };
        item.word(&self.key(key), words)
    }

    /// One of some words; left out: `Some(None)`.
    pub(super) fn optional_word<T: Copy>(
        &mut self,
        key: &'static str,
        words: &[(&'static str, T)],
    ) -> Option<Option<T>> {
        match self.optional(key) {
            None => Some(None),
            Some(item) => item.word(&self.key(key), words).map(Some),
        }
    }

    /// An integer; left out: `Some(None)`.
    pub(super) fn optional_integer(&mut self, key: &'static str, range: RangeInclusive<i64>) -> Option<Option<i64>> {
        self.log.asked(&self.key(key), Question::Integer(range.clone()));
        match self.optional(key) {
            None => Some(None),
            Some(item) => item.integer(&self.key(key), range).map(Some),
        }
    }

    /// A table inside this one; left out: one without keys.
    pub(super) fn section(&mut self, key: &'static str) -> Option<Section<'d, 'l>> {
        let path = self.key(key);
        self.log.asked(&path, Question::Table);
        match self.optional(key) {
            None => Some(Section {
                log: self.log,
                path,
                span: self.span.clone(),
                table: &self.log.nothing,
                known: vec![],
            }),
            Some(item) => self.inner(item, path),
        }
    }

    /// A table inside this one if it stands here.
    pub(super) fn optional_section(&mut self, key: &'static str) -> Option<Section<'d, 'l>> {
        self.log.asked(&self.key(key), Question::Table);
        let item = self.optional(key)?;
        self.inner(item, self.key(key))
    }

    /// All keys that stand here in the order of the file, for sections whose keys the user chooses.
    pub(super) fn names(&self) -> Vec<String> {
        self.log.asked(&self.path, Question::Names);
        let mut keys: Vec<_> = self.table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.into_iter().map(|key| key.get_ref().to_string()).collect()
    }

    /// The table behind a key that the user chose.
    pub(super) fn any_section(&mut self, name: &str) -> Option<Section<'d, 'l>> {
        self.log.asked(&self.key(name), Question::Table);
        let item = self.any(name)?;
        self.inner(item, self.key(name))
    }

    /// The number behind a key that the user chose.
    pub(super) fn any_number(&mut self, name: &str, bound: Bound) -> Option<f64> {
        self.any(name)?.number(&self.key(name), bound)
    }

    /// What stands behind a key that the user chose.
    pub(super) fn any_scalar(&mut self, name: &str) -> Option<Scalar> {
        self.any(name)?.scalar(&self.key(name))
    }

    fn any(&self, name: &str) -> Option<Item<'d, 'l>> {
        self.table.get(name).map(|value| Item { log: self.log, value })
    }

    /// An array of tables; left out: none.
    pub(super) fn sections(&mut self, key: &'static str) -> Vec<Section<'d, 'l>> {
        let path = self.key(key);
        self.log.asked(&path, Question::Tables);
        let Some(item) = self.optional(key) else {
            return Vec::new();
        };
        let Some(items) = item.value.get_ref().as_array() else {
            item.is_no(&path, &format!("an array of tables: [[{path}]]"));
            return Vec::new();
        };
        if !item.is_short(&path, items.len()) {
            return Vec::new();
        }
        let items = items.iter().enumerate();
        items
            .filter_map(|(index, value)| self.inner(Item { log: self.log, value }, format!("{path}[{index}]")))
            .collect()
    }

    /// An array of at least one table; none is an error.
    pub(super) fn some_sections(&mut self, key: &'static str) -> Vec<Section<'d, 'l>> {
        self.log.asked(&self.key(key), Question::Required);
        let is_empty = |value: &Spanned<DeValue<'d>>| value.get_ref().as_array().is_some_and(|array| array.is_empty());
        if self.table.get(key).is_none_or(is_empty) {
            self.wrong(key, format!("is missing: at least one [[{}]] is needed", self.key(key)));
        }
        self.sections(key)
    }

    fn inner(&self, item: Item<'d, 'l>, path: String) -> Option<Section<'d, 'l>> {
        let Some(table) = item.value.get_ref().as_table() else {
            item.is_no(&path, "a table");
            return None;
        };
        Some(Section {
            log: self.log,
            path,
            span: item.value.span(),
            table,
            known: Vec::new(),
        })
    }

    /// Notes an error about the value of a key, or about the whole section where the key is left out.
    pub(super) fn wrong(&self, key: &str, rule: impl Into<String>) {
        match self.table.get(key) {
            // Of a table only its header could be shown, which says nothing.
            Some(value) if is_tables(value.get_ref()) => self.log.misplaced(value.span(), &self.key(key), rule, None),
            Some(value) => self.log.wrong(value.span(), &self.key(key), rule, None),
            None => self.log.misplaced(self.span.clone(), &self.key(key), rule, None),
        }
    }

    /// Keys that are read elsewhere or only where another one asks for them.
    pub(super) fn known(&mut self, keys: &[&'static str]) {
        self.known.extend(keys);
    }

    /// Notes a key of machine files of before that has another name now.
    pub(super) fn renamed(&mut self, key: &'static str, now: &'static str) {
        self.known.push(key);
        if let Some((name, _)) = self.table.get_key_value(key) {
            let rule = format!("is called `{now}` now");
            self.log.misplaced(name.span(), &self.key(key), &rule, None);
        }
    }

    /// Notes keys that are another kind's, with the reason why they cannot be here.
    pub(super) fn foreign(&mut self, keys: &[(&'static str, &'static str)]) {
        for (key, reason) in keys {
            self.known.push(key);
            if let Some((name, _)) = self.table.get_key_value(*key) {
                let rule = format!("cannot be here: {reason}");
                self.log.misplaced(name.span(), &self.key(key), rule, None);
            }
        }
    }

    /// Names the keys that nobody asked for.
    pub(super) fn done(self) {
        for key in self.table.keys() {
            let name = key.get_ref().as_ref();
            if !self.known.contains(&name) {
                if self.log.is_full() {
                    self.log.misplaced(key.span(), name, "unknown key", None);
                    continue;
                }
                let hint = match nearest(name, self.known.iter().copied()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("known here: {}", self.known.join(", ")),
                };
                self.log
                    .misplaced(key.span(), &self.key(name), "unknown key", Some(hint));
            }
        }
    }
}

fn is_tables(value: &DeValue<'_>) -> bool {
    match value.as_array() {
        Some(array) => array.first().is_some_and(|first| first.get_ref().is_table()),
        None => value.is_table(),
    }
}
