//! Numbers with four decimals, as C's `%.4f` prints them.
//!
//! In:  any `f64`.
//! Out: digits at the end of a buffer, rounded from the exact binary value, ties to even; never `-0.0000`.
//!
//! A canonical call has up to nine numbers, so this is most of the work of printing. The formatting machinery of `core`
//! takes about ten times as long; the property test below holds the two equal.

use std::io::Write;

const DECIMALS: usize = 4;
const SCALE: u64 = 10_u64.pow(DECIMALS as u32);

/// Below this a value times [`SCALE`] fits an `i64`.
const EXACT_MAX: f64 = (1_u64 << 49) as f64;

/// Appends `value` with four decimals.
pub(super) fn push_fixed4(out: &mut Vec<u8>, value: f64) {
    // Written so that NaN takes the long way, too.
    if value.abs() < EXACT_MAX {
        let scaled = scaled_magnitude(value);
        if value < 0.0 && scaled != 0 {
            out.push(b'-');
        }
        push_scaled(out, scaled);
    } else {
        push_long(out, value);
    }
}

#[cold]
fn push_long(out: &mut Vec<u8>, value: f64) {
    // A Vec takes all that is written.
    let _ = write!(out, "{value:.DECIMALS$}");
}

/// `|value| * 10^4`, rounded half to even; `value` is below [`EXACT_MAX`].
fn scaled_magnitude(value: f64) -> u64 {
    let bits = value.to_bits();
    let exponent_bits = (bits >> 52 & 0x7FF) as i32;
    let fraction = bits & ((1 << 52) - 1);
    // value = mantissa * 2^exponent, exactly
    let (mantissa, exponent) = match exponent_bits {
        0 => (fraction, -1074),
        _ => (fraction | 1 << 52, exponent_bits - 1075),
    };
    let product = u128::from(mantissa) * u128::from(SCALE); // below 2^67
    let shift = exponent.unsigned_abs(); // below EXACT_MAX the exponent is negative
    if shift > 68 {
        return 0; // below a half
    }
    let whole = (product >> shift) as u64;
    let rest = product & ((1 << shift) - 1);
    let half = 1 << (shift - 1);
    whole + u64::from(rest > half || rest == half && whole & 1 == 1)
}

/// Appends `scaled / 10^4` with four decimals.
fn push_scaled(out: &mut Vec<u8>, scaled: u64) {
    let mut digits = [b'0'; 24];
    let mut at = digits.len();
    let mut decimals = scaled % SCALE;
    for _ in 0..DECIMALS {
        at -= 1;
        digits[at] = b'0' + (decimals % 10) as u8;
        decimals /= 10;
    }
    at -= 1;
    digits[at] = b'.';
    let mut whole = scaled / SCALE;
    loop {
        at -= 1;
        digits[at] = b'0' + (whole % 10) as u8;
        whole /= 10;
        if whole == 0 {
            break;
        }
    }
    out.extend_from_slice(&digits[at..]);
}

/// Appends a whole number, right-aligned in `width` columns.
pub(super) fn push_integer(out: &mut Vec<u8>, value: u64, width: usize, fill: u8) {
    let mut digits = [0; 20];
    let mut at = digits.len();
    let mut rest = value;
    loop {
        at -= 1;
        digits[at] = b'0' + (rest % 10) as u8;
        rest /= 10;
        if rest == 0 {
            break;
        }
    }
    let count = digits.len() - at;
    out.resize(out.len() + width.saturating_sub(count), fill);
    out.extend_from_slice(&digits[at..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn fixed4(value: f64) -> String {
        let mut out = Vec::new();
        push_fixed4(&mut out, value);
        String::from_utf8(out).unwrap()
    }

    fn by_core(value: f64) -> String {
        let text = format!("{value:.4}");
        if text == "-0.0000" { "0.0000".into() } else { text }
    }

    #[test]
    fn ties_go_to_the_even_digit_and_zero_has_no_sign() {
        // Multiples of 1/32 are exact in binary and end in 5 behind the fourth decimal.
        for (value, text) in [
            (0.03125, "0.0312"),
            (0.09375, "0.0938"),
            (-0.15625, "-0.1562"),
            (1e-5, "0.0000"),
            (-0.00004, "0.0000"),
            (-0.0, "0.0000"),
            (0.00005, "0.0001"), // a little above the tie in binary
            (0.00015, "0.0001"), // a little below
            (5e-324, "0.0000"),
            (999.99996, "1000.0000"),
            (1e30, "1000000000000000019884624838656.0000"),
        ] {
            assert_eq!(fixed4(value), text, "{value}");
            assert_eq!(by_core(value), text, "{value}");
        }
    }

    #[test]
    fn whole_numbers_are_aligned() {
        let mut out = Vec::new();
        push_integer(&mut out, 0, 5, b' ');
        push_integer(&mut out, 42, 4, b'0');
        push_integer(&mut out, u64::MAX, 5, b' ');
        assert_eq!(out, b"    0004218446744073709551615");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]
        #[test]
        fn any_number_is_printed_as_core_prints_it(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            prop_assert_eq!(fixed4(value), by_core(value));
        }

        #[test]
        fn numbers_of_the_size_of_machines_are_printed_as_core_prints_them(value in -1e6..1e6_f64) {
            prop_assert_eq!(fixed4(value), by_core(value));
        }

        /// Near ties: halves of the fourth decimal and their neighbours.
        #[test]
        fn ties_are_rounded_as_core_rounds_them(halves in -40_000_000_i64..40_000_000, ulps in -2_i64..=2, binary in any::<bool>()) {
            let tie = halves as f64 / if binary { 32.0 } else { 20_000.0 };
            let value = f64::from_bits(tie.to_bits().wrapping_add_signed(ulps));
            prop_assert_eq!(fixed4(value), by_core(value));
        }
    }
}
