//! A table of a TOML document, whose keys are read one by one, and `keys!`, which declares a table and its reader at once.
//!
//! In:  a table of the document. Out: plain values; `None` where one is wrong, which the [`Log`] then says.

use super::document::{Item, Log, Scalar, Whole, alternatives};
use super::error::nearest;
use super::question::{Bound, Question};
use std::ops::{Range, RangeInclusive};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Declares a table of the machine file: its struct, and of each field what it is, its range and its default, by the call that reads its
/// key. They are read in this order, which is that of the reference.
///
/// ```text
/// keys! {
///     /// `[mains]`: what is done with the energy that is left when the mains fail.
///     #[derive(Clone, Copy, Debug, PartialEq)]
///     pub struct Mains(section) {
///         /// The axis that takes the tool out of the work.
///         pub retract_axis: Axis = section.axis("retract_axis", Axis::Z),
///     }
///     rules {
///         // What holds between keys; here they are all `Option`, `None` where one is wrong.
///     }
/// }
/// ```
///
/// What stands behind `section` are further arguments of `Mains::read`.
macro_rules! keys {
    (
        $(#[$meta:meta])*
        $visible:vis struct $Name:ident($section:ident $(, $argument:ident: $given:ty)*) {
            $($(#[$doc:meta])* $of_field:vis $field:ident: $type:ty = $read:expr,)*
        }
        $(rules $rules:block)?
    ) => {
        $(#[$meta])*
        $visible struct $Name {
            $($(#[$doc])* $of_field $field: $type,)*
        }

        impl $Name {
            /// Reads the table; `None` where something is wrong.
            pub(crate) fn read($section: &mut $crate::section::Section<'_, '_> $(, $argument: $given)*) -> Option<$Name> {
                $(let $field = $read;)*
                $($rules)?
                Some($Name { $($field: $field?,)* })
            }
        }
    };
}
pub(super) use keys;

/// What a table says that is left out.
pub(super) fn left_out<T>(read: impl FnOnce(&mut Section<'_, '_>) -> Option<T>) -> T {
    let (log, table) = (Log::new("", ""), DeTable::new());
    read(&mut Section::root(&log, &table)).expect("each key has a default")
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

    /// Whether a key has this text: for what no reference is to name, nobody is told that this was asked.
    #[cfg(feature = "testing")]
    pub(super) fn says(&mut self, key: &'static str, text: &str) -> bool {
        let says = |value: &Spanned<DeValue<'_>>| value.get_ref().as_str() == Some(text);
        let is_it = self.table.get(key).is_some_and(says);
        if is_it {
            self.known.push(key);
        }
        is_it
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

    /// What `read` makes of the value of a key; left out: `Some(None)`.
    pub(super) fn maybe<T>(
        &mut self,
        key: &'static str,
        read: impl FnOnce(Item<'d, 'l>, &str) -> Option<T>,
    ) -> Option<Option<T>> {
        match self.optional(key) {
            None => Some(None),
            Some(item) => read(item, &self.key(key)).map(Some),
        }
    }

    /// An integer; left out: `default`.
    pub(super) fn integer<T: Whole>(
        &mut self,
        key: &'static str,
        range: RangeInclusive<T>,
        default: impl Into<Option<T>>,
    ) -> Option<T> {
        let (least, most) = (range.start().wide(), range.end().wide());
        // Also where it is left out: the range may be another one in another machine.
        self.log.asked(&self.key(key), Question::Integer(least..=most));
        let item = match default.into() {
            None => self.required(key, &format!("an integer from {least} to {most}"))?,
            Some(default) => match self.or(key, || default.wide().into()) {
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
        self.maybe(key, |item, path| item.word(path, words))
    }

    /// An integer; left out: `Some(None)`.
    pub(super) fn optional_integer<T: Whole>(
        &mut self,
        key: &'static str,
        range: RangeInclusive<T>,
    ) -> Option<Option<T>> {
        let whole = range.start().wide()..=range.end().wide();
        self.log.asked(&self.key(key), Question::Integer(whole));
        self.maybe(key, |item, path| item.integer(path, range))
    }

    /// A number; left out: `Some(None)`.
    pub(super) fn optional_number(&mut self, key: &'static str, bound: Bound) -> Option<Option<f64>> {
        self.maybe(key, |item, path| item.number(path, bound))
    }

    /// A text; missing is an error that says `what` it is.
    pub(super) fn text(&mut self, key: &'static str, what: &str) -> Option<&'l str> {
        self.required(key, what)?.text(&self.key(key))
    }

    /// A text; left out: `Some(None)`.
    pub(super) fn optional_text(&mut self, key: &'static str) -> Option<Option<&'l str>> {
        self.maybe(key, |item, path| item.text(path))
    }

    /// The values of an array, each read by itself; left out: none.
    pub(super) fn list<T>(
        &mut self,
        key: &'static str,
        read: impl FnMut(Item<'d, 'l>, &str) -> Option<T>,
    ) -> Option<Vec<T>> {
        Some(self.maybe(key, |item, path| item.list(path, read))?.unwrap_or_default())
    }

    /// `N` values of the array `item`, which stands at `key`; `rule` is told of another number of them.
    pub(super) fn array<T, const N: usize>(
        &self,
        key: &str,
        item: Item<'d, 'l>,
        rule: &str,
        read: impl FnMut(Item<'d, 'l>, &str) -> Option<T>,
    ) -> Option<[T; N]> {
        let path = self.key(key);
        if item.items(&path)?.len() != N {
            self.wrong(key, rule);
            return None;
        }
        item.list(&path, read)?.try_into().ok()
    }

    /// What `read` makes of a table inside this one; left out: of one without keys.
    pub(super) fn table<T>(
        &mut self,
        key: &'static str,
        read: impl FnOnce(&mut Section<'d, 'l>) -> Option<T>,
    ) -> Option<T> {
        self.section(key)?.whole(read)
    }

    /// What `read` makes of a table inside this one; left out: `Some(None)`.
    pub(super) fn optional_table<T>(
        &mut self,
        key: &'static str,
        read: impl FnOnce(&mut Section<'d, 'l>) -> Option<T>,
    ) -> Option<Option<T>> {
        match self.optional_section(key) {
            Some(table) => table.whole(read).map(Some),
            None => (!self.table.contains_key(key)).then_some(None),
        }
    }

    /// What `read` makes of each table of an array, and of what it has made of those above; left out: nothing.
    pub(super) fn tables<T>(
        &mut self,
        key: &'static str,
        read: impl FnMut(&mut Section<'d, 'l>, &[T]) -> Option<T>,
    ) -> Option<Vec<T>> {
        all_of(self.sections(key), read)
    }

    /// All of this table; a key that `read` does not ask for is an error.
    pub(super) fn whole<T>(mut self, read: impl FnOnce(&mut Section<'d, 'l>) -> Option<T>) -> Option<T> {
        let found = read(&mut self);
        self.done();
        found
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

    /// All keys that stand here in the order of the file.
    fn names(&self) -> Vec<String> {
        self.log.asked(&self.path, Question::Names);
        let mut keys: Vec<_> = self.table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.into_iter().map(|key| key.get_ref().to_string()).collect()
    }

    /// What `read` makes of each of the keys that stand here, for sections whose keys the user chooses.
    pub(super) fn each<T>(&mut self, mut read: impl FnMut(&mut Self, &str) -> Option<T>) -> Option<Vec<T>> {
        let found: Vec<_> = self.names().iter().map(|name| read(self, name)).collect();
        found.into_iter().collect()
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

    /// As [`Section::wrong`], in place of what was to be read.
    pub(super) fn refused<T>(&self, key: &str, rule: impl Into<String>) -> Option<T> {
        self.wrong(key, rule);
        None
    }

    /// Keys that are read elsewhere or only where another one asks for them.
    pub(super) fn known(&mut self, keys: &[&'static str]) {
        self.known.extend(keys);
    }

    /// Notes those of some keys that stand here, where they mean nothing.
    pub(super) fn refuse(&mut self, keys: &[&'static str], rule: &str) {
        for key in keys.iter().filter(|key| self.has(key)) {
            self.wrong(key, rule);
        }
        let unknown: Vec<_> = keys.iter().copied().filter(|key| !self.known.contains(key)).collect();
        self.known(&unknown);
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

/// What `read` makes of each of some tables, and of what it has made of those above; `None` where one is wrong.
pub(super) fn all_of<'d, 'l, T>(
    tables: Vec<Section<'d, 'l>>,
    mut read: impl FnMut(&mut Section<'d, 'l>, &[T]) -> Option<T>,
) -> Option<Vec<T>> {
    let (count, mut found) = (tables.len(), Vec::new());
    for table in tables {
        let one = table.whole(|table| read(table, &found));
        found.extend(one);
    }
    (found.len() == count).then_some(found)
}
