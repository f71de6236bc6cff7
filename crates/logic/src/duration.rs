//! Durations as they are written, `1h2m3s4ms`, and back.

const UNITS: [(&str, i128, i128); 7] = [
    ("d", 86_400_000_000_000, i128::MAX),
    ("h", 3_600_000_000_000, 24),
    ("m", 60_000_000_000, 60),
    ("s", 1_000_000_000, 60),
    ("ms", 1_000_000, 1000),
    ("us", 1000, 1000),
    ("ns", 1, 1000),
];

/// Nanoseconds of what stands behind `T#`.
///
/// # Errors
/// The rule that it breaks.
pub(crate) fn parse(text: &str) -> Result<i64, &'static str> {
    let (negative, mut rest) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let mut sum = 0_i128;
    let mut next_unit = 0;
    let mut is_first = true;
    while !rest.is_empty() {
        let digits = rest.find(|letter: char| !letter.is_ascii_digit() && !matches!(letter, '_' | '.'));
        let (number, behind) = rest.split_at(digits.unwrap_or(rest.len()));
        let letters = behind.find(|letter: char| !letter.is_ascii_alphabetic());
        let (unit, behind) = behind.split_at(letters.unwrap_or(behind.len()));
        let known = UNITS.iter().position(|(name, ..)| unit.eq_ignore_ascii_case(name));
        let unit = known.ok_or("each part is a number and one of d h m s ms us ns")?;
        if unit < next_unit {
            return Err("its parts come in the order d h m s ms us ns, each once");
        }
        next_unit = unit + 1;
        let number = number.replace('_', "");
        let (whole, fraction) = number.split_once('.').unwrap_or((&number, ""));
        if whole.is_empty() || number.ends_with('.') || fraction.contains('.') {
            return Err("each part is a number and one of d h m s ms us ns");
        }
        if !fraction.is_empty() && !behind.is_empty() {
            return Err("only its last part has a point");
        }
        let (_, nanoseconds, limit) = UNITS[unit];
        let whole: i128 = whole.parse().map_err(|_| "it is too long")?;
        if !is_first && whole >= limit {
            return Err("only its first part exceeds its range");
        }
        let part = whole.checked_mul(nanoseconds).ok_or("it is too long")?;
        sum = sum.checked_add(part).ok_or("it is too long")?;
        let mut place = nanoseconds;
        for digit in fraction.bytes() {
            // Below a nanosecond nothing counts.
            place /= 10;
            sum += i128::from(digit - b'0') * place;
        }
        is_first = false;
        rest = behind.strip_prefix('_').unwrap_or(behind);
    }
    if is_first {
        return Err("it has at least one part, 5s");
    }
    i64::try_from(if negative { -sum } else { sum }).map_err(|_| "it is too long")
}

/// Nanoseconds as they are written in a program, `T#1s500ms`.
pub(crate) fn print(nanoseconds: i64) -> String {
    let mut rest = i128::from(nanoseconds).abs();
    let mut text = String::from(if nanoseconds < 0 { "T#-" } else { "T#" });
    if rest == 0 {
        return "T#0s".into();
    }
    for (unit, length, _) in UNITS {
        if rest >= length {
            text += &format!("{}{unit}", rest / length);
            rest %= length;
        }
    }
    text
}

/// Nanoseconds in milliseconds, exactly: `10`, `0.25`.
pub fn milliseconds(nanoseconds: i64) -> String {
    let sign = if nanoseconds < 0 { "-" } else { "" };
    let rest = nanoseconds.unsigned_abs();
    let text = format!("{sign}{}.{:06}", rest / 1_000_000, rest % 1_000_000);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The other way; `None`: no number, more than six places behind the point, or too long.
pub fn of_milliseconds(text: &str) -> Option<i64> {
    let (negative, digits) = text.strip_prefix('-').map_or((false, text), |digits| (true, digits));
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, "0"));
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|octet| octet.is_ascii_digit());
    if !is_number(whole) || !is_number(fraction) || fraction.len() > 6 {
        return None;
    }
    let nanoseconds = format!("{whole}{fraction:0<6}").parse::<i128>().ok()?;
    i64::try_from(if negative { -nanoseconds } else { nanoseconds }).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    #[test]
    fn durations_are_read() {
        let cases = [
            ("1h2m3s4ms", 3723 * SECOND + 4_000_000),
            ("-5s", -5 * SECOND),
            ("1.5s", SECOND + SECOND / 2),
            ("2h_30m", 9000 * SECOND),
            ("90m", 5400 * SECOND),
            ("1D", 86_400 * SECOND),
            ("0.1us", 100),
            ("1.23456789us", 1234),
            ("1_000ms", SECOND),
            ("250us10ns", 250_010),
        ];
        for (text, nanoseconds) in cases {
            assert_eq!(parse(text), Ok(nanoseconds), "{text}");
        }
    }

    #[test]
    fn what_is_no_duration_is_refused_with_its_rule() {
        let cases = [
            ("", "it has at least one part, 5s"),
            ("-", "it has at least one part, 5s"),
            ("5", "each part is a number and one of d h m s ms us ns"),
            ("s", "each part is a number and one of d h m s ms us ns"),
            ("5x", "each part is a number and one of d h m s ms us ns"),
            ("5.s", "each part is a number and one of d h m s ms us ns"),
            ("1s2m", "its parts come in the order d h m s ms us ns, each once"),
            ("1s2s", "its parts come in the order d h m s ms us ns, each once"),
            ("1.5m3s", "only its last part has a point"),
            ("1h90m", "only its first part exceeds its range"),
            ("200000d", "it is too long"),
        ];
        for (text, rule) in cases {
            assert_eq!(parse(text), Err(rule), "{text}");
        }
    }

    #[test]
    fn a_duration_that_is_printed_reads_the_same() {
        for nanoseconds in [0, 1, -1, SECOND, 3723 * SECOND + 4_005_006, i64::MAX, i64::MIN] {
            let text = print(nanoseconds);
            assert_eq!(parse(&text[2..]), Ok(nanoseconds), "{text}");
        }
        assert_eq!(print(90 * 60 * SECOND), "T#1h30m");
    }

    #[test]
    fn milliseconds_are_written_exactly_and_read_the_same() {
        for (nanoseconds, text) in [
            (0, "0"),
            (10_000_000, "10"),
            (250_000, "0.25"),
            (-1, "-0.000001"),
            (1_500_000, "1.5"),
        ] {
            assert_eq!(milliseconds(nanoseconds), text);
            assert_eq!(of_milliseconds(text), Some(nanoseconds));
        }
        assert_eq!(of_milliseconds(&milliseconds(i64::MIN)), Some(i64::MIN));
        for text in ["", "1.", ".5", "1e3", "1.0000001", "99999999999999999999", "x"] {
            assert_eq!(of_milliseconds(text), None, "{text}");
        }
    }
}
