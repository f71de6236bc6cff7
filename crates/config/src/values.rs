//! Values that keys of several tables have: letters of axes, ranges, ratios, objects.

use super::objects::parse_object;
use super::question::Bound;
use super::section::Section;
use motion::canon::Axis;

/// No machine tool is larger or faster; keeps every later calculation far from overflow. mm or degrees.
pub(super) const LENGTH_MAX: f64 = 1e6;
pub(super) const VELOCITY_MAX: f64 = 1e5;
pub(super) const ACCELERATION_MAX: f64 = 1e7;

/// The value of a ratio.
pub(super) fn ratio([above, below]: [u32; 2]) -> f64 {
    f64::from(above) / f64::from(below)
}

impl Section<'_, '_> {
    /// The axis that a key names.
    pub(super) fn axis(&mut self, key: &'static str) -> Option<Axis> {
        const LETTERS: &str = "one of X Y Z A B C U V W";
        let mut letters = self.text(key, LETTERS)?.chars();
        let axis = letters.next().filter(|_| letters.next().is_none());
        let axis = axis.and_then(Axis::from_letter);
        if axis.is_none() {
            self.wrong(key, format!("must be {LETTERS}"));
        }
        axis
    }

    /// A lower and an upper limit, mm.
    pub(super) fn range(&mut self, key: &'static str, what: &str) -> Option<[f64; 2]> {
        let item = self.required(key, what)?;
        let rule = "must be two numbers: lower and upper limit";
        let range: [f64; 2] = self.array(key, item, rule, |item, path| item.number(path, Bound::Size(LENGTH_MAX)))?;
        if range[0] >= range[1] {
            return self.refused(key, "the lower limit must be below the upper one");
        }
        Some(range)
    }

    /// A ratio of two integers above 0, of which `what` says what they are; left out: `Some(None)`.
    pub(super) fn ratio(&mut self, key: &'static str, what: &str) -> Option<Option<[u32; 2]>> {
        let Some(item) = self.optional(key) else {
            return Some(None);
        };
        let rule = format!("must be two integers: {what}");
        self.array(key, item, &rule, |item, path| item.integer(path, 1..=u32::MAX))
            .map(Some)
    }

    /// Index and sub-index of an object like `example`; left out: `Some(None)` unless it is required.
    pub(super) fn object(&mut self, key: &'static str, required: bool, example: &str) -> Option<Option<(u16, u8)>> {
        let text = match required {
            true => self.text(key, &format!("an object of the node, like {example:?}"))?,
            false => match self.optional_text(key)? {
                Some(text) => text,
                None => return Some(None),
            },
        };
        let object = parse_object(text);
        if object.is_none() {
            self.wrong(key, format!("must be an object like {example:?}"));
        }
        object.map(Some)
    }
}

pub(super) const NAME_RULE: &str = "must be 1 to 48 letters, digits, dashes, underscores or dots, a letter first";

/// Whether a text may name a machine or a node; such names stand in file names and messages.
pub fn is_name(text: &str) -> bool {
    (1..=48).contains(&text.len())
        && text.starts_with(|first: char| first.is_ascii_alphabetic())
        && text
            .bytes()
            .all(|octet| octet.is_ascii_alphanumeric() || b"-_.".contains(&octet))
}
