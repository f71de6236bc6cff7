//! Digits to the nearest `f64`.
//!
//! In:  a line and a place in it, blanks allowed between any two digits.
//! Out: the same number as the standard library reads from the digits without blanks, and the place behind it.
//!
//! Signs belong to the value around the number (`-[2]` and `+-2` are values too), see [`crate::expression`]. There is no
//! exponent: `1e3` is 1 and an E word.

use crate::octet::is_blank;

/// Why no number stands here; the place is then behind what was looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberFault {
    /// Neither a digit nor a point.
    Missing,
    /// A point without any digit.
    NoDigit,
    /// A second point, which stands where reading ended.
    SecondPoint,
}

/// Reads digits, an optional point and digits, at least one digit.
#[inline]
pub(crate) fn read(line: &[u8], at: &mut usize) -> Result<f64, NumberFault> {
    // The usual number has no blanks within and few digits. Whatever is not clearly one goes the long way.
    let start = *at;
    let (mut mantissa, mut place) = digits(line, start, 0);
    let mut count = place - start;
    let mut decimals = 0;
    if line.get(place) == Some(&b'.') {
        let point = place;
        (mantissa, place) = digits(line, point + 1, mantissa);
        decimals = place - point - 1;
        count += decimals;
    }
    let goes_on = |octet: u8| octet.is_ascii_digit() || octet == b'.' || is_blank(octet);
    let ends = match line.get(place) {
        None => true,
        Some(b' ') => !line.get(place + 1).is_some_and(|octet| goes_on(*octet)),
        Some(octet) => !goes_on(*octet),
    };
    // 18 digits cannot overflow. Below 2^53 both the mantissa and the power of ten are exact, so that their quotient is
    // the nearest f64.
    if ends && (1..=18).contains(&count) && mantissa < 1 << 53 {
        *at = place;
        return Ok(mantissa as f64 / POWERS_OF_TEN[decimals]);
    }
    read_any(line, at)
}

/// Appends the digits at `place` to a mantissa, and goes behind them. The mantissa is wrong if it has too many digits.
#[inline(always)]
fn digits(line: &[u8], mut place: usize, mut mantissa: u64) -> (u64, usize) {
    while let Some(octet) = line.get(place) {
        let digit = octet.wrapping_sub(b'0');
        if digit > 9 {
            break;
        }
        mantissa = mantissa.wrapping_mul(10).wrapping_add(digit.into());
        place += 1;
    }
    (mantissa, place)
}

/// As [`read`], for every number.
fn read_any(line: &[u8], at: &mut usize) -> Result<f64, NumberFault> {
    let start = *at;
    let mut place = start;
    let (mut any_digit, mut point) = (false, false);
    while let Some(&octet) = line.get(place) {
        match octet {
            b'0'..=b'9' => any_digit = true,
            b'.' if !point => point = true,
            octet if is_blank(octet) => {}
            _ => break,
        }
        place += 1;
    }
    *at = place;
    if !any_digit {
        return Err(if point {
            NumberFault::NoDigit
        } else {
            NumberFault::Missing
        });
    }
    if point && line.get(place) == Some(&b'.') {
        return Err(NumberFault::SecondPoint);
    }
    let octets = line[start..place].iter().filter(|octet| !is_blank(**octet));
    let digits: String = octets.map(|octet| char::from(*octet)).collect();
    Ok(digits.parse().unwrap_or(f64::INFINITY))
}

/// Powers of ten that an `f64` holds exactly.
const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(text: &str) -> (Result<f64, NumberFault>, usize) {
        let mut at = 0;
        let number = read(text.as_bytes(), &mut at);
        (number, at)
    }

    #[test]
    fn digits_around_an_optional_point() {
        assert_eq!(number("12.5Y"), (Ok(12.5), 4));
        assert_eq!(number(".5"), (Ok(0.5), 2));
        assert_eq!(number("5."), (Ok(5.0), 2));
        assert_eq!(number("007"), (Ok(7.0), 3));
        assert_eq!(number("1e3"), (Ok(1.0), 1));
    }

    #[test]
    fn blanks_between_digits_do_not_count() {
        assert_eq!(number("1 0\t. 2 5 X"), (Ok(10.25), 10));
        assert_eq!(number(" 1 2345678901234567 8901"), (Ok(123456789012345678901.0), 24));
    }

    #[test]
    fn at_least_one_digit() {
        assert_eq!(number("X"), (Err(NumberFault::Missing), 0));
        assert_eq!(number(""), (Err(NumberFault::Missing), 0));
        assert_eq!(number(". X"), (Err(NumberFault::NoDigit), 2));
        assert_eq!(number("."), (Err(NumberFault::NoDigit), 1));
    }

    #[test]
    fn one_point_at_most() {
        assert_eq!(number("1.2.3"), (Err(NumberFault::SecondPoint), 3));
        assert_eq!(number("1. ."), (Err(NumberFault::SecondPoint), 3));
    }

    proptest! {
        #[test]
        fn equal_to_the_standard_library(text in "[0-9]{1,40}(\\.[0-9]{0,40})?|\\.[0-9]{1,40}|0{0,9}\\.0{0,30}[0-9]{1,20}") {
            let expected: f64 = text.parse().unwrap();
            let (number, at) = number(&text);
            prop_assert_eq!(number.map(f64::to_bits), Ok(expected.to_bits()));
            prop_assert_eq!(at, text.len());
        }

        #[test]
        fn equal_to_the_standard_library_with_blanks(text in "[0-9 ]{0,9}[0-9](\\.[0-9 \t]{0,20})?") {
            let expected: f64 = text.replace([' ', '\t'], "").parse().unwrap();
            prop_assert_eq!(number(&text).0.map(f64::to_bits), Ok(expected.to_bits()));
        }
    }
}
