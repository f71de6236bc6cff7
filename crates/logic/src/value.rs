//! A value as the outside sees it.

use crate::duration;
use std::fmt;

/// A value of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<'t> {
    /// BOOL
    Bool(bool),
    /// An integer or a bit string.
    Integer(i128),
    /// REAL
    Real(f32),
    /// LREAL
    Lreal(f64),
    /// TIME, nanoseconds.
    Time(i64),
    /// STRING, or the name of a value of an enumeration.
    Text(&'t str),
}

impl fmt::Display for Value<'_> {
    /// As it stands in a table: BOOL as 0 or 1, TIME in milliseconds.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Bool(value) => write!(f, "{}", u8::from(*value)),
            Value::Integer(value) => write!(f, "{value}"),
            Value::Real(value) => write!(f, "{value}"),
            Value::Lreal(value) => write!(f, "{value}"),
            Value::Time(nanoseconds) => f.write_str(&duration::milliseconds(*nanoseconds)),
            Value::Text(text) => f.write_str(text),
        }
    }
}
