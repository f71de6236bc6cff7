//! Values of pins and how each type is kept in one 64-bit cell.

use crate::error::HalError;
use crate::kind::Type;

mod sealed {
    pub trait Sealed {}
}

/// A Rust type that a pin can have: `bool`, `i32`, `u32`, `i64`, `u64`, `f64`.
pub trait Value: Copy + sealed::Sealed {
    /// The pin's type.
    const TYPE: Type;
    /// RT: the cell that holds this value.
    fn to_cell(self) -> u64;
    /// RT: the value in a cell; any cell is a value.
    fn from_cell(cell: u64) -> Self;
}

macro_rules! value {
    ($rust:ty, $kind:ident, $to:expr, $from:expr) => {
        impl sealed::Sealed for $rust {}
        impl Value for $rust {
            const TYPE: Type = Type::$kind;
            #[inline]
            fn to_cell(self) -> u64 {
                let to: fn($rust) -> u64 = $to;
                to(self)
            }
            #[inline]
            fn from_cell(cell: u64) -> $rust {
                let from: fn(u64) -> $rust = $from;
                from(cell)
            }
        }
        impl From<$rust> for AnyValue {
            fn from(value: $rust) -> AnyValue {
                AnyValue::$kind(value)
            }
        }
    };
}

value!(bool, Bit, u64::from, |cell| cell != 0);
value!(i32, S32, |value| u64::from(value as u32), |cell| cell as u32 as i32);
value!(u32, U32, u64::from, |cell| cell as u32);
value!(i64, S64, |value| value as u64, |cell| cell as i64);
value!(u64, U64, |value| value, |cell| cell);
value!(f64, Float, f64::to_bits, f64::from_bits);

/// A value whose type is known at run time only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AnyValue {
    /// [`Type::Bit`]
    Bit(bool),
    /// [`Type::S32`]
    S32(i32),
    /// [`Type::U32`]
    U32(u32),
    /// [`Type::S64`]
    S64(i64),
    /// [`Type::U64`]
    U64(u64),
    /// [`Type::Float`]
    Float(f64),
}

impl AnyValue {
    /// Type of the value.
    pub const fn kind(self) -> Type {
        match self {
            AnyValue::Bit(_) => Type::Bit,
            AnyValue::S32(_) => Type::S32,
            AnyValue::U32(_) => Type::U32,
            AnyValue::S64(_) => Type::S64,
            AnyValue::U64(_) => Type::U64,
            AnyValue::Float(_) => Type::Float,
        }
    }

    /// The value as a number: 0 or 1 for a bit; integers beyond 2^53 are rounded.
    pub fn to_f64(self) -> f64 {
        match self {
            AnyValue::Bit(value) => f64::from(u8::from(value)),
            AnyValue::S32(value) => value.into(),
            AnyValue::U32(value) => value.into(),
            AnyValue::S64(value) => value as f64,
            AnyValue::U64(value) => value as f64,
            AnyValue::Float(value) => value,
        }
    }

    /// Reads the text of a command line: `1`, `0`, `true`, `false` for a bit; decimal or `0x` for integers.
    ///
    /// # Errors
    /// [`HalError::Text`] with what was expected.
    pub fn parse(kind: Type, text: &str) -> Result<AnyValue, HalError> {
        let bad = |expected| HalError::Text {
            kind,
            text: text.to_owned(),
            expected,
        };
        match kind {
            Type::Bit => match text {
                "1" | "true" => Ok(AnyValue::Bit(true)),
                "0" | "false" => Ok(AnyValue::Bit(false)),
                _ => Err(bad("0, 1, false or true")),
            },
            Type::S32 => integer(text)
                .and_then(|value| i32::try_from(value).ok())
                .map(AnyValue::S32)
                .ok_or_else(|| bad("an integer from -2147483648 to 2147483647")),
            Type::U32 => integer(text)
                .and_then(|value| u32::try_from(value).ok())
                .map(AnyValue::U32)
                .ok_or_else(|| bad("an integer from 0 to 4294967295")),
            Type::S64 => integer(text)
                .and_then(|value| i64::try_from(value).ok())
                .map(AnyValue::S64)
                .ok_or_else(|| bad("a signed 64-bit integer")),
            Type::U64 => integer(text)
                .and_then(|value| u64::try_from(value).ok())
                .map(AnyValue::U64)
                .ok_or_else(|| bad("an unsigned 64-bit integer")),
            Type::Float => text
                .parse()
                .ok()
                .filter(|value: &f64| value.is_finite())
                .map(AnyValue::Float)
                .ok_or_else(|| bad("a finite number")),
        }
    }

    pub(crate) fn to_cell(self) -> u64 {
        match self {
            AnyValue::Bit(value) => value.to_cell(),
            AnyValue::S32(value) => value.to_cell(),
            AnyValue::U32(value) => value.to_cell(),
            AnyValue::S64(value) => value.to_cell(),
            AnyValue::U64(value) => value.to_cell(),
            AnyValue::Float(value) => value.to_cell(),
        }
    }

    pub(crate) fn from_cell(kind: Type, cell: u64) -> AnyValue {
        match kind {
            Type::Bit => AnyValue::Bit(Value::from_cell(cell)),
            Type::S32 => AnyValue::S32(Value::from_cell(cell)),
            Type::U32 => AnyValue::U32(Value::from_cell(cell)),
            Type::S64 => AnyValue::S64(Value::from_cell(cell)),
            Type::U64 => AnyValue::U64(Value::from_cell(cell)),
            Type::Float => AnyValue::Float(Value::from_cell(cell)),
        }
    }
}

impl std::fmt::Display for AnyValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            AnyValue::Bit(value) => f.pad(if *value { "true" } else { "false" }),
            AnyValue::S32(value) => value.fmt(f),
            AnyValue::U32(value) => value.fmt(f),
            AnyValue::S64(value) => value.fmt(f),
            AnyValue::U64(value) => value.fmt(f),
            AnyValue::Float(value) => value.fmt(f),
        }
    }
}

fn integer(text: &str) -> Option<i128> {
    match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).ok().map(i128::from),
        None => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_hold_the_twos_complement_of_the_type_s_own_width() {
        assert_eq!((-1i32).to_cell(), 0xFFFF_FFFF);
        assert_eq!((-1i64).to_cell(), u64::MAX);
        assert_eq!(1.0f64.to_cell(), 0x3FF0_0000_0000_0000);
        assert_eq!(true.to_cell(), 1);
        assert!(bool::from_cell(2));
        assert_eq!(i32::from_cell(0xFFFF_FFFF), -1);
        assert_eq!(u32::from_cell(0x1_0000_0007), 7);
    }

    #[test]
    fn text_is_read_within_the_range_of_the_type() {
        assert_eq!(
            AnyValue::parse(Type::S32, "-2147483648").unwrap(),
            AnyValue::S32(i32::MIN)
        );
        assert_eq!(
            AnyValue::parse(Type::U32, "0xFFFFFFFF").unwrap(),
            AnyValue::U32(u32::MAX)
        );
        assert_eq!(
            AnyValue::parse(Type::U64, "18446744073709551615").unwrap(),
            AnyValue::U64(u64::MAX)
        );
        assert_eq!(AnyValue::parse(Type::Bit, "true").unwrap(), AnyValue::Bit(true));
        assert_eq!(AnyValue::parse(Type::Float, "-1e3").unwrap(), AnyValue::Float(-1000.0));
        for (kind, text) in [
            (Type::S32, "2147483648"),
            (Type::U32, "-1"),
            (Type::S64, "9223372036854775808"),
            (Type::U64, "1.5"),
            (Type::Bit, "2"),
            (Type::Float, "nan"),
        ] {
            assert!(
                matches!(AnyValue::parse(kind, text), Err(HalError::Text { .. })),
                "{kind} {text}"
            );
        }
    }

    #[test]
    fn type_octets_are_one_to_one() {
        for octet in 0..=u8::MAX {
            assert_eq!(
                Type::from_octet(octet).map(|kind| kind as u8),
                (1..=6).contains(&octet).then_some(octet)
            );
        }
    }
}
