//! The numbers of a job: name, unit, default and bounds of each, said once at its field.
//!
//! In:  the struct of a kind, in [`job!`]; values by name. Out: the table of its fields; the struct with these values, each within its
//! bounds, or which one is wrong.

use protocol::{Message, message};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// Values by the names of their fields.
pub type Values = Map<String, Value>;

/// A number of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// What it means.
    pub doc: &'static str,
    /// `mm`, `degrees`, `mm/min`, `1/min`, `s`; empty for what has none.
    pub unit: &'static str,
    /// What it may be.
    pub what: What,
}

/// What a field may be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "a default and its bounds")]
pub enum What {
    Number {
        default: f64,
        min: f64,
        max: f64,
    },
    Whole {
        default: u32,
        min: u32,
        max: u32,
    },
    /// One of these words; the first is the default.
    Choice {
        of: &'static [&'static str],
    },
    /// So many characters at most.
    Text {
        default: &'static str,
        length_max: usize,
    },
}

/// A value that cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub struct Wrong {
    /// Of which field; `None`: the kind.
    pub field: Option<&'static str>,
    /// What is wrong, and what to do about it.
    pub message: Message,
}

impl Wrong {
    pub(crate) fn at<T>(field: &'static str, message: Message) -> Result<T, Wrong> {
        Err(Wrong {
            field: Some(field),
            message,
        })
    }
}

/// Coolant of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Coolant {
    /// None.
    #[default]
    Off,
    /// M8.
    Flood,
    /// M7.
    Mist,
}

impl Coolant {
    pub(crate) const WORDS: &'static [&'static str] = &["off", "flood", "mist"];
}

/// What all kinds have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Common {
    pub(crate) tool: u32,
    pub(crate) spindle: f64,
    pub(crate) coolant: Coolant,
    /// mm/min.
    pub(crate) feed: f64,
    /// Z of the surface, mm.
    pub(crate) top: f64,
    /// Z, mm.
    pub(crate) safe_height: f64,
}

/// The type of a field.
macro_rules! field_type {
    (number $($rest:tt)*) => {
        f64
    };
    (whole $($rest:tt)*) => {
        u32
    };
    (choice $of:ident) => {
        $of
    };
    (text $($rest:tt)*) => {
        String
    };
}

/// What a field may be.
macro_rules! field_what {
    (number $unit:literal, $default:expr, $min:expr, $max:expr) => {
        (
            $unit,
            $crate::fields::What::Number {
                default: $default,
                min: $min,
                max: $max,
            },
        )
    };
    (whole $default:expr, $min:expr, $max:expr) => {
        (
            "",
            $crate::fields::What::Whole {
                default: $default,
                min: $min,
                max: $max,
            },
        )
    };
    (choice $of:ident) => {
        ("", $crate::fields::What::Choice { of: $of::WORDS })
    };
    (text $default:expr, $length_max:expr) => {
        (
            "",
            $crate::fields::What::Text {
                default: $default,
                length_max: $length_max,
            },
        )
    };
}

/// The default of a field.
macro_rules! field_default {
    (number $unit:literal, $default:expr, $min:expr, $max:expr) => {
        $default
    };
    (whole $default:expr, $min:expr, $max:expr) => {
        $default
    };
    (choice $of:ident) => {
        $of::default()
    };
    (text $default:expr, $length_max:expr) => {
        String::from($default)
    };
}

/// The struct of a kind, its defaults and the table of its fields; those that all kinds have come last.
macro_rules! job {
    ($about:literal $name:ident { $(#[doc = $doc:literal] $field:ident = $kind:ident($($spec:tt)*);)* }) => {
        $crate::fields::job! {
            @all $about $name {
                $(#[doc = $doc] $field = $kind($($spec)*);)*
                #[doc = " Number of the tool. 0: the tool in the spindle, no change."]
                tool = whole(1, 0, 99_999);
                #[doc = " Speed of the spindle, clockwise. 0: it stays off."]
                spindle = number("1/min", 6000.0, 0.0, 200_000.0);
                #[doc = " Coolant."]
                coolant = choice(Coolant);
                #[doc = " Feed of the cut."]
                feed = number("mm/min", 600.0, 1.0, 100_000.0);
                #[doc = " Z of the surface."]
                top = number("mm", 0.0, -10_000.0, 10_000.0);
                #[doc = " Z at which the tool passes over clamps."]
                safe_height = number("mm", 10.0, -10_000.0, 10_000.0);
            }
        }

        impl $name {
            fn common(&self) -> $crate::fields::Common {
                $crate::fields::Common {
                    tool: self.tool,
                    spindle: self.spindle,
                    coolant: self.coolant,
                    feed: self.feed,
                    top: self.top,
                    safe_height: self.safe_height,
                }
            }
        }
    };
    (@all $about:literal $name:ident { $(#[doc = $doc:literal] $field:ident = $kind:ident($($spec:tt)*);)* }) => {
        #[doc = $about]
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $(#[doc = $doc] pub $field: $crate::fields::field_type!($kind $($spec)*),)*
        }

        impl Default for $name {
            fn default() -> $name {
                $name { $($field: $crate::fields::field_default!($kind $($spec)*),)* }
            }
        }

        impl $name {
            /// What it makes.
            pub const ABOUT: &'static str = $about;

            /// Its fields, in the order of a form.
            pub fn fields() -> Vec<$crate::fields::Field> {
                vec![$({
                    let (unit, what) = $crate::fields::field_what!($kind $($spec)*);
                    $crate::fields::Field { name: stringify!($field), doc: $doc, unit, what }
                },)*]
            }
        }
    };
}

pub(crate) use {field_default, field_type, field_what, job};

/// A value as it is typed, for a field.
///
/// # Errors
/// It is no number where one is expected.
pub fn value(field: &Field, text: &str) -> Result<Value, Wrong> {
    match field.what {
        What::Choice { .. } | What::Text { .. } => Ok(json!(text)),
        What::Whole { .. } if text.parse::<u32>().is_ok() => Ok(json!(text.parse::<u32>().unwrap_or_default())),
        What::Number { .. } | What::Whole { .. } => match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(json!(number)),
            _ => not_a_number(field, text),
        },
    }
}

fn not_a_number<T>(field: &Field, got: &str) -> Result<T, Wrong> {
    let short: String = got.chars().take(40).collect();
    Wrong::at(
        field.name,
        message!(
            "job.not_a_number",
            "{field}: expected a number, got {got}",
            field = field.name,
            got = short
        ),
    )
}

fn check(field: &Field, value: &Value) -> Result<(), Wrong> {
    match field.what {
        What::Number { min, max, .. } => match value.as_f64() {
            None => not_a_number(field, &value.to_string()),
            Some(got) => within(field, got, min, max),
        },
        What::Whole { min, max, .. } => match value.as_f64() {
            None => not_a_number(field, &value.to_string()),
            Some(got) if got.fract() != 0.0 => Wrong::at(
                field.name,
                message!(
                    "job.not_whole",
                    "{field}: expected a whole number, got {got}",
                    field = field.name,
                    got = got
                ),
            ),
            Some(got) => within(field, got, f64::from(min), f64::from(max)),
        },
        What::Choice { of } => match value.as_str() {
            Some(got) if of.contains(&got) => Ok(()),
            _ => Wrong::at(
                field.name,
                message!(
                    "job.not_a_choice",
                    "{field}: expected one of {choices}",
                    field = field.name,
                    choices = of.join(", ")
                ),
            ),
        },
        What::Text { length_max, .. } => match value.as_str() {
            Some(got) if got.chars().count() <= length_max => Ok(()),
            _ => Wrong::at(
                field.name,
                message!(
                    "job.text_length",
                    "{field}: expected a text of at most {most} characters",
                    field = field.name,
                    most = length_max
                ),
            ),
        },
    }
}

fn within(field: &Field, got: f64, min: f64, max: f64) -> Result<(), Wrong> {
    if (min..=max).contains(&got) {
        return Ok(());
    }
    if field.name == "depth" && got <= 0.0 {
        return Wrong::at(
            field.name,
            message!(
                "job.depth",
                "a depth of {got} mm is not below the surface: depth is measured downwards and is above 0",
                got = got
            ),
        );
    }
    Wrong::at(
        field.name,
        message!(
            "job.out_of_range",
            "{field}: expected {min} to {max}, got {got}",
            field = field.name,
            min = min,
            max = max,
            got = got
        ),
    )
}

/// The struct of a kind with these values.
pub(crate) fn read<T: DeserializeOwned>(values: &Values, fields: &[Field]) -> Result<T, Wrong> {
    let mut checked = Values::new();
    for (name, value) in values {
        let Some(field) = fields.iter().find(|field| field.name == name) else {
            let short: String = name.chars().take(40).collect();
            let known: Vec<&str> = fields.iter().map(|field| field.name).collect();
            let message = message!(
                "job.no_field",
                "there is no number \"{field}\": {fields}",
                field = short,
                fields = known.join(", ")
            );
            return Err(Wrong { field: None, message });
        };
        check(field, value)?;
        let value = match field.what {
            // 3.0 is 3.
            What::Whole { .. } => json!(value.as_f64().unwrap_or_default() as u32),
            _ => value.clone(),
        };
        checked.insert(name.clone(), value);
    }
    serde_json::from_value(Value::Object(checked)).map_err(|error| Wrong {
        field: None,
        message: Message::from(error.to_string()),
    })
}

/// How many equal steps a way takes, none longer than `most`.
pub(crate) fn steps(way: f64, most: f64) -> u32 {
    ((way / most - 1e-6).ceil().clamp(1.0, 1e9)) as u32
}
