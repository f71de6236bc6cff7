//! What a reader asks of the keys of a file, of which the schema and the references are made.

use std::ops::RangeInclusive;

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
    /// The rule that a value breaks.
    pub(super) fn broken_by(self, value: f64) -> Option<String> {
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
