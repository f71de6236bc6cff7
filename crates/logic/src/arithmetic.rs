//! What operators and functions do with values of slots; see [`crate::Scalar`] for what a slot holds.
//!
//! RT: no allocation, no locks, bounded. Every operation has a result, whatever it is given: what is wrong is noted in [`Flags`].

use crate::runtime::Wrong;
use crate::scalar::Scalar;

/// Operations on one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[rustfmt::skip]
pub(crate) enum Unary {
    Negate, Not, Absolute, SquareRoot, Ln, Log, Exp, Sin, Cos, Tan, Asin, Acos, Atan, Truncate,
    /// Of decimal digits of four bits each to their number, and back; of the type of the digits.
    OfDigits, ToDigits,
}

/// Operations on two values of one type; those that shift and scale have their own kind of right value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[rustfmt::skip]
pub(crate) enum Binary {
    Add, Subtract, Multiply, Divide, Modulo, Power,
    Less, Greater, LessEqual, GreaterEqual, Equal, NotEqual,
    And, Or, Xor,
    /// Right: an integer.
    ShiftLeft, ShiftRight, RotateLeft, RotateRight,
    Least, Greatest,
    /// The next value of a loop: the sum, or what it was where its type ends.
    Advance,
    /// TIME with an LREAL.
    ScaleUp, ScaleDown,
}

/// What operations had to say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Flags {
    /// Results that did not fit into their type.
    pub(crate) overflows: u64,
    /// The last thing that was wrong.
    pub(crate) wrong: Option<Wrong>,
}

fn real(slot: i64) -> f64 {
    f64::from_bits(slot as u64)
}

/// A value of a REAL or LREAL as a slot.
pub(crate) fn of_real(scalar: Scalar, value: f64) -> i64 {
    let rounded = if scalar == Scalar::Real {
        f64::from(value as f32)
    } else {
        value
    };
    rounded.to_bits() as i64
}

/// The result of a calculation of a REAL or LREAL as a slot: a finite number, whatever was worked out.
fn real_result(scalar: Scalar, value: f64, flags: &mut Flags) -> i64 {
    let slot = of_real(scalar, value);
    if real(slot).is_finite() {
        return slot;
    }
    if value.is_nan() {
        flags.wrong = Some(Wrong::NoNumber);
        return of_real(scalar, 0.0);
    }
    flags.wrong = Some(Wrong::RealRange);
    let most = if scalar == Scalar::Real {
        f64::from(f32::MAX)
    } else {
        f64::MAX
    };
    of_real(scalar, most.copysign(value))
}

fn wrapped(scalar: Scalar, number: i128, flags: &mut Flags) -> i64 {
    let (slot, changed) = scalar.wrap(number);
    flags.overflows += u64::from(changed);
    slot
}

/// A real number as an integer, at the ends of the range where it is beyond.
fn saturated(scalar: Scalar, value: f64, flags: &mut Flags) -> i64 {
    let (low, high) = scalar.range();
    let number = (value as i128).clamp(low, high);
    // A conversion of `f64` is 0 for what is no number.
    let fits = value >= low as f64 && number as f64 == value;
    flags.overflows += u64::from(!fits);
    scalar.wrap(number).0
}

/// RT: no allocation, no locks, bounded.
pub(crate) fn unary(operation: Unary, scalar: Scalar, a: i64, flags: &mut Flags) -> i64 {
    if scalar.is_real() {
        let a = real(a);
        let value = match operation {
            Unary::Negate | Unary::Not | Unary::OfDigits | Unary::ToDigits => -a,
            Unary::Absolute => a.abs(),
            Unary::SquareRoot => a.sqrt(),
            Unary::Ln => libm::log(a),
            Unary::Log => libm::log10(a),
            Unary::Exp => libm::exp(a),
            Unary::Sin => libm::sin(a),
            Unary::Cos => libm::cos(a),
            Unary::Tan => libm::tan(a),
            Unary::Asin => libm::asin(a),
            Unary::Acos => libm::acos(a),
            Unary::Atan => libm::atan(a),
            Unary::Truncate => a.trunc(),
        };
        return real_result(scalar, value, flags);
    }
    match operation {
        Unary::OfDigits | Unary::ToDigits => digits(operation, scalar, a as u64).unwrap_or_else(|| {
            flags.wrong = Some(Wrong::Bcd);
            0
        }),
        Unary::Not => scalar.wrap(!scalar.number(a)).0,
        Unary::Absolute => wrapped(scalar, scalar.number(a).abs(), flags),
        _ => wrapped(scalar, -scalar.number(a), flags),
    }
}

/// Decimal digits of four bits each to their number, or the other way; `None`: they are none, or are too many.
fn digits(operation: Unary, scalar: Scalar, value: u64) -> Option<i64> {
    let (from, to) = match operation {
        Unary::OfDigits => (16, 10),
        _ => (10, 16),
    };
    let (mut rest, mut result, mut place) = (value, 0_u64, 1_u64);
    for _ in 0..scalar.bits() / 4 {
        let digit = rest % from;
        rest /= from;
        if digit > 9 {
            return None;
        }
        result += digit * place;
        place = place.wrapping_mul(to);
    }
    (rest == 0).then_some(result as i64)
}

/// RT: no allocation, no locks, bounded.
#[inline]
pub(crate) fn binary(operation: Binary, scalar: Scalar, a: i64, b: i64, flags: &mut Flags) -> i64 {
    match operation {
        Binary::And => a & b,
        Binary::Or => a | b,
        Binary::Xor => a ^ b,
        _ if scalar.is_real() => of_reals(operation, scalar, real(a), real(b), flags),
        _ => of_integers(operation, scalar, a, b, flags),
    }
}

fn of_reals(operation: Binary, scalar: Scalar, a: f64, b: f64, flags: &mut Flags) -> i64 {
    let value = match operation {
        Binary::Less => return i64::from(a < b),
        Binary::Greater => return i64::from(a > b),
        Binary::LessEqual => return i64::from(a <= b),
        Binary::GreaterEqual => return i64::from(a >= b),
        Binary::Equal => return i64::from(a == b),
        Binary::NotEqual => return i64::from(a != b),
        Binary::Add => a + b,
        Binary::Subtract => a - b,
        Binary::Multiply => a * b,
        Binary::Divide | Binary::Modulo if b == 0.0 => {
            flags.wrong = Some(Wrong::DivisionByZero);
            0.0
        }
        Binary::Divide => a / b,
        Binary::Modulo => libm::fmod(a, b),
        Binary::Power => libm::pow(a, b),
        Binary::Least => {
            if b < a {
                b
            } else {
                a
            }
        }
        Binary::Greatest => {
            if b > a {
                b
            } else {
                a
            }
        }
        // The type check gives these to no REAL.
        Binary::And | Binary::Or | Binary::Xor | Binary::ScaleUp | Binary::ScaleDown | Binary::Advance => a,
        Binary::ShiftLeft | Binary::ShiftRight | Binary::RotateLeft | Binary::RotateRight => a,
    };
    real_result(scalar, value, flags)
}

fn of_integers(operation: Binary, scalar: Scalar, left: i64, right: i64, flags: &mut Flags) -> i64 {
    let (a, b) = (scalar.number(left), scalar.number(right));
    match operation {
        Binary::Less => i64::from(a < b),
        Binary::Greater => i64::from(a > b),
        Binary::LessEqual => i64::from(a <= b),
        Binary::GreaterEqual => i64::from(a >= b),
        Binary::Equal => i64::from(a == b),
        Binary::NotEqual => i64::from(a != b),
        Binary::Add => wrapped(scalar, a + b, flags),
        Binary::Subtract => wrapped(scalar, a - b, flags),
        Binary::Advance => match scalar.wrap(a + b) {
            (_, true) => left,
            (next, false) => next,
        },
        // Of two ULINT the product may wrap here, to a negative number that is out of range as well.
        Binary::Multiply => wrapped(scalar, a.wrapping_mul(b), flags),
        Binary::Divide | Binary::Modulo if b == 0 => {
            flags.wrong = Some(Wrong::DivisionByZero);
            0
        }
        Binary::Divide => wrapped(scalar, a / b, flags),
        Binary::Modulo => scalar.wrap(a % b).0,
        Binary::Least => {
            if b < a {
                right
            } else {
                left
            }
        }
        Binary::Greatest => {
            if b > a {
                right
            } else {
                left
            }
        }
        Binary::ShiftLeft | Binary::ShiftRight | Binary::RotateLeft | Binary::RotateRight => {
            shifted(operation, scalar, a, right)
        }
        Binary::ScaleUp => saturated(Scalar::Time, (left as f64 * real(right)).round_ties_even(), flags),
        Binary::ScaleDown if real(right) == 0.0 => {
            flags.wrong = Some(Wrong::DivisionByZero);
            0
        }
        Binary::ScaleDown => saturated(Scalar::Time, (left as f64 / real(right)).round_ties_even(), flags),
        Binary::And | Binary::Or | Binary::Xor | Binary::Power => left,
    }
}

/// Shifted out is lost: by the width or more, or by a negative count, nothing is left. Rotation goes by the count modulo the width.
fn shifted(operation: Binary, scalar: Scalar, bits: i128, count: i64) -> i64 {
    let width = i64::from(scalar.bits().max(1));
    let within = (0..width).contains(&count);
    let turn = count.rem_euclid(width) as u32;
    let back = (width as u32 - turn) % width as u32;
    let result = match operation {
        Binary::ShiftLeft if within => bits << turn,
        Binary::ShiftRight if within => bits >> turn,
        Binary::RotateLeft => (bits << turn) | ((bits >> back) * i128::from(turn > 0)),
        Binary::RotateRight => (bits >> turn) | ((bits << back) * i128::from(turn > 0)),
        _ => 0,
    };
    scalar.wrap(result).0
}

/// Nanoseconds of a millisecond, in which TIME is converted to and from numbers.
const MILLISECOND_NS: i64 = 1_000_000;

/// A value of one elementary type as one of another.
///
/// RT: no allocation, no locks, bounded.
pub(crate) fn convert(from: Scalar, to: Scalar, a: i64, flags: &mut Flags) -> i64 {
    match (from, to) {
        _ if from == to => a,
        _ if from.is_real() && to.is_real() => real_result(to, real(a), flags),
        (_, Scalar::Bool) if from.is_real() => i64::from(real(a) != 0.0),
        (_, Scalar::Bool) => i64::from(a != 0),
        (_, Scalar::Time) if from.is_real() => {
            saturated(to, (real(a) * MILLISECOND_NS as f64).round_ties_even(), flags)
        }
        (_, Scalar::Time) => {
            let exact = from.number(a) * i128::from(MILLISECOND_NS);
            let (low, high) = to.range();
            flags.overflows += u64::from(!(low..=high).contains(&exact));
            to.wrap(exact.clamp(low, high)).0
        }
        (Scalar::Time, _) if to.is_real() => of_real(to, a as f64 / MILLISECOND_NS as f64),
        (Scalar::Time, _) => {
            let whole = i128::from(a / MILLISECOND_NS);
            let (low, high) = to.range();
            flags.overflows += u64::from(!(low..=high).contains(&whole));
            to.wrap(whole.clamp(low, high)).0
        }
        _ if from.is_real() => saturated(to, real(a).round_ties_even(), flags),
        _ if to.is_real() => of_real(to, from.number(a) as f64),
        _ => to.wrap(from.number(a)).0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Scalar::*;

    fn of(operation: Binary, scalar: Scalar, a: i64, b: i64) -> (i64, Flags) {
        let mut flags = Flags::default();
        (binary(operation, scalar, a, b, &mut flags), flags)
    }

    #[test]
    fn division_cuts_towards_zero_and_the_remainder_has_the_sign_of_the_dividend() {
        let rows = [(7, 2, 3, 1), (-7, 2, -3, -1), (7, -2, -3, 1), (-7, -2, 3, -1)];
        for (a, b, quotient, remainder) in rows {
            assert_eq!(of(Binary::Divide, Int, a, b), (quotient, Flags::default()));
            assert_eq!(of(Binary::Modulo, Int, a, b), (remainder, Flags::default()));
        }
    }

    #[test]
    fn what_is_divided_by_zero_is_zero_and_an_error() {
        for (scalar, zero) in [
            (Int, 0),
            (Ulint, 0),
            (Real, of_real(Real, 0.0)),
            (Lreal, of_real(Lreal, -0.0)),
        ] {
            let (value, flags) = of(Binary::Divide, scalar, of_real(scalar, 7.0), zero);
            assert_eq!((value, flags.wrong), (0, Some(Wrong::DivisionByZero)), "{scalar:?}");
        }
        assert_eq!(of(Binary::Modulo, Dint, 7, 0).1.wrong, Some(Wrong::DivisionByZero));
        assert_eq!(
            of(Binary::ScaleDown, Time, 7, of_real(Lreal, 0.0)).1.wrong,
            Some(Wrong::DivisionByZero)
        );
    }

    #[test]
    fn what_is_no_number_is_zero_and_what_is_beyond_its_type_is_at_its_end() {
        let slot = |scalar: Scalar, value: f64| of_real(scalar, value);
        let mut told = Vec::new();
        let mut check = |what: &str, (value, flags): (i64, Flags), wanted: f64| {
            assert_eq!(real(value), wanted, "{what}");
            told.push(flags.wrong);
        };
        let one = |operation: Unary, a: f64| {
            let mut flags = Flags::default();
            (unary(operation, Lreal, slot(Lreal, a), &mut flags), flags)
        };
        for operation in [Unary::SquareRoot, Unary::Ln, Unary::Log, Unary::Asin, Unary::Acos] {
            check(&format!("{operation:?}"), one(operation, -1.5), 0.0);
        }
        check(
            "-1.5 ** 0.5",
            of(Binary::Power, Lreal, slot(Lreal, -1.5), slot(Lreal, 0.5)),
            0.0,
        );
        assert!(told.drain(..).all(|wrong| wrong == Some(Wrong::NoNumber)));
        let mut check = |what: &str, (value, flags): (i64, Flags), wanted: f64| {
            assert_eq!(real(value), wanted, "{what}");
            told.push(flags.wrong);
        };
        check("LN(0)", one(Unary::Ln, 0.0), f64::MIN);
        check("EXP(1000)", one(Unary::Exp, 1000.0), f64::MAX);
        let most = f64::from(f32::MAX);
        let pair = |operation, scalar: Scalar, a: f64, b: f64| of(operation, scalar, slot(scalar, a), slot(scalar, b));
        check("REAL *", pair(Binary::Multiply, Real, 1e30, -1e30), -most);
        check("REAL /", pair(Binary::Divide, Real, 1e30, 1e-30), most);
        check("LREAL +", pair(Binary::Add, Lreal, f64::MAX, f64::MAX), f64::MAX);
        check("LREAL -", pair(Binary::Subtract, Lreal, f64::MIN, f64::MAX), f64::MIN);
        check("0 ** -1", pair(Binary::Power, Lreal, 0.0, -1.0), f64::MAX);
        let mut flags = Flags::default();
        let narrow = convert(Lreal, Real, slot(Lreal, 1e300), &mut flags);
        check("LREAL_TO_REAL", (narrow, flags), most);
        assert!(told.iter().all(|wrong| *wrong == Some(Wrong::RealRange)));
    }

    #[test]
    fn integers_wrap_and_are_counted() {
        let cases = [
            (Binary::Add, Sint, 127, 1, -128),
            (Binary::Subtract, Usint, 0, 1, 255),
            (Binary::Multiply, Int, 256, 256, 0),
            (Binary::Divide, Sint, -128, -1, -128),
            (Binary::Add, Lint, i64::MAX, 1, i64::MIN),
            (Binary::Multiply, Ulint, -1, -1, 1),
            (Binary::Add, Time, i64::MAX, 1, i64::MIN),
        ];
        for (operation, scalar, a, b, result) in cases {
            let (value, flags) = of(operation, scalar, a, b);
            assert_eq!((value, flags.overflows), (result, 1), "{operation:?} {scalar:?}");
        }
        assert_eq!(
            of(Binary::Divide, Lint, i64::MIN, -1),
            (
                i64::MIN,
                Flags {
                    overflows: 1,
                    wrong: None
                }
            )
        );
        assert_eq!(of(Binary::Modulo, Lint, i64::MIN, -1), (0, Flags::default()));
        assert_eq!(of(Binary::Divide, Ulint, -1, 2), (i64::MAX, Flags::default()));
    }

    #[test]
    fn shifts_lose_and_rotations_keep() {
        let cases = [
            (Binary::ShiftLeft, Byte, 0x81, 1, 0x02),
            (Binary::ShiftRight, Byte, 0x81, 1, 0x40),
            (Binary::ShiftLeft, Byte, 0x81, 8, 0),
            (Binary::ShiftRight, Lword, -1, 63, 1),
            (Binary::ShiftRight, Byte, 0x81, -1, 0),
            (Binary::RotateLeft, Byte, 0x81, 1, 0x03),
            (Binary::RotateRight, Byte, 0x81, 1, 0xC0),
            (Binary::RotateLeft, Byte, 0x81, 9, 0x03),
            (Binary::RotateLeft, Word, 0x1234, 0, 0x1234),
            (Binary::RotateLeft, Lword, i64::MIN, 1, 1),
            (Binary::RotateRight, Lword, 1, 1, i64::MIN),
        ];
        for (operation, scalar, a, b, result) in cases {
            assert_eq!(
                of(operation, scalar, a, b).0,
                result,
                "{operation:?} {scalar:?} {a:x} {b}"
            );
        }
    }

    #[test]
    fn conversions_round_to_even_and_saturate() {
        let to = |from: Scalar, to: Scalar, a: i64| {
            let mut flags = Flags::default();
            (convert(from, to, a, &mut flags), flags.overflows)
        };
        let lreal = |value: f64| of_real(Lreal, value);
        for (value, whole) in [(0.5, 0), (1.5, 2), (2.5, 2), (-0.5, 0), (-1.5, -2), (2.4, 2)] {
            assert_eq!(to(Lreal, Int, lreal(value)), (whole, 0), "{value}");
        }
        assert_eq!(to(Lreal, Int, lreal(1e9)), (32_767, 1));
        assert_eq!(to(Lreal, Usint, lreal(-1.0)), (0, 1));
        assert_eq!(to(Lreal, Int, lreal(f64::NAN)), (0, 1));
        assert_eq!(to(Lreal, Lint, lreal(9.3e18)), (i64::MAX, 1));
        assert_eq!(to(Dint, Int, 70_000), (4464, 0));
        assert_eq!(to(Int, Uint, -1), (65_535, 0));
        assert_eq!(to(Int, Bool, 2), (1, 0));
        assert_eq!(to(Lreal, Bool, lreal(0.1)), (1, 0));
        assert_eq!(to(Time, Dint, 1_999_999), (1, 0));
        assert_eq!(to(Time, Int, i64::MAX), (32_767, 1));
        assert_eq!(to(Dint, Time, 1500), (1_500_000_000, 0));
        assert_eq!(to(Lreal, Time, lreal(1.5)), (1_500_000, 0));
        assert_eq!(to(Time, Lreal, 1_500_000), (lreal(1.5), 0));
        assert_eq!(to(Lreal, Real, lreal(0.1)), (lreal(f64::from(0.1_f32)), 0));
        assert_eq!(to(Ulint, Lreal, -1), (lreal(u64::MAX as f64), 0));
    }
}
