//! Numbers and names as the table and the picture print them.

use super::report::{Ended, JitterReport};

/// A time in µs with about three digits: `0.123`, `12.3`, `1,234`; `-` for what is none.
pub(super) fn us(value_us: f64) -> String {
    match value_us.abs() {
        abs if !abs.is_finite() => "-".into(),
        abs if abs < 9.9995 => format!("{value_us:.3}"),
        abs if abs < 99.995 => format!("{value_us:.2}"),
        abs if abs < 999.95 => format!("{value_us:.1}"),
        _ => grouped_signed(value_us.round()),
    }
}

/// A time in µs for running text: as short as three digits allow, with the unit that fits.
pub(super) fn short_time(value_us: f64) -> String {
    let (value, unit) = match value_us.abs() {
        abs if !abs.is_finite() => return "-".into(),
        abs if abs < 0.9995 => (value_us * 1e3, "ns"),
        abs if abs < 999.5 => (value_us, "µs"),
        abs if abs < 999_500.0 => (value_us * 1e-3, "ms"),
        _ => (value_us * 1e-6, "s"),
    };
    format!("{} {unit}", three_digits(value))
}

/// `1.23`, `12.3`, `123`, without zeros behind the point.
pub(super) fn three_digits(value: f64) -> String {
    let text = match value.abs() {
        abs if !abs.is_finite() => return "-".into(),
        abs if abs < 9.995 => format!("{value:.2}"),
        abs if abs < 99.95 => format!("{value:.1}"),
        _ => return grouped_signed(value.round()),
    };
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// A ratio: `0.04`, `1.25`, `>999`.
pub(super) fn ratio(value: f64) -> String {
    match value {
        value if value.is_nan() => "-".into(),
        value if value > 999.0 => ">999".into(),
        value if value < 0.1 => format!("{value:.3}"),
        value => format!("{value:.2}"),
    }
}

/// `20,000,000`.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn grouped_signed(whole: f64) -> String {
    let sign = if whole < 0.0 { "-" } else { "" };
    format!("{sign}{}", grouped(whole.abs() as u64))
}

/// A name from outside, shortened in its middle, without control characters.
pub(super) fn elided(name: &str, length: usize) -> String {
    let characters: Vec<char> = name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if characters.len() <= length {
        return characters.into_iter().collect();
    }
    let (head, tail) = (length.saturating_sub(1) / 2, length / 2);
    let mut text: String = characters[..head].iter().collect();
    text.push('…');
    text.extend(&characters[characters.len() - tail..]);
    text
}

/// A sentence on lines of a width, as words.
pub(super) fn wrapped(sentence: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in sentence.split_whitespace() {
        let word = elided(word, width);
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(&word);
            }
            Some(_) | None => lines.push(word),
        }
    }
    lines
}

/// How a measurement ended, for people.
pub(super) fn ended(report: &JitterReport) -> &'static str {
    match report.result {
        Ended::Completed => "completed",
        Ended::Cut => "cut short by a signal: what was measured until then",
        Ended::Faulted => "ended by a fault of the machine: what was measured until then",
    }
}

/// The PC in one sentence.
pub(super) fn pc(report: &JitterReport) -> String {
    let pc = &report.pc;
    format!(
        "{}, kernel {} ({}), core {} of {} ({}){}",
        if pc.cpu_model.is_empty() {
            "unknown processor"
        } else {
            &pc.cpu_model
        },
        pc.kernel,
        if pc.preempt_rt { "PREEMPT_RT" } else { "not PREEMPT_RT" },
        pc.core,
        pc.cores,
        if pc.core_isolated { "isolated" } else { "not isolated" },
        if pc.virtual_machine {
            "; a virtual machine: no lateness is bounded"
        } else {
            ""
        },
    )
}

/// Whether the SoC period is that at the far end of the wire. Else it is by the control's own clock.
pub(super) fn far_end_listened(report: &JitterReport) -> bool {
    report.rounds.iter().any(|round| round.soc_period.is_some())
}

/// Sum over all rounds.
pub(super) fn total(report: &JitterReport, of: impl Fn(&super::report::Round) -> u64) -> u64 {
    report.rounds.iter().map(of).fold(0, u64::saturating_add)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_have_three_digits_or_so() {
        let values = [0.0, 0.0104, 1.2345, 9.9996, 12.345, 123.45, 1234.5, 1e7, -3.5, -1234.5];
        let expected = [
            "0.000",
            "0.010",
            "1.234",
            "10.00",
            "12.35",
            "123.5",
            "1,235",
            "10,000,000",
            "-3.500",
            "-1,235",
        ];
        for (value, text) in values.into_iter().zip(expected) {
            assert_eq!(us(value), text);
        }
        let values = [0.0, 0.25, 0.999, 1.0, 11.24, 480.0, 6088.0, 2.5e6, -0.001];
        let expected = [
            "0 ns", "250 ns", "999 ns", "1 µs", "11.2 µs", "480 µs", "6.09 ms", "2.5 s", "-1 ns",
        ];
        for (value, text) in values.into_iter().zip(expected) {
            assert_eq!(short_time(value), text);
        }
        assert_eq!(
            [0.0412, 0.5, 12.3, 5000.0].map(ratio),
            ["0.041", "0.50", "12.30", ">999"]
        );
        assert_eq!(
            [0, 999, 1000, 20_000_000].map(grouped),
            ["0", "999", "1,000", "20,000,000"]
        );
        assert_eq!(
            [us(f64::NAN), short_time(f64::INFINITY), ratio(f64::NAN)],
            ["-", "-", "-"]
        );
    }

    #[test]
    fn long_names_lose_their_middle() {
        assert_eq!(elided("part.ngc", 8), "part.ngc");
        assert_eq!(elided("/home/user/parts/bracket.ngc", 14), "/home/…ket.ngc");
        assert_eq!(elided("a\nb", 3), "a b");
        assert_eq!(wrapped("one two  three four", 9), ["one two", "three", "four"]);
    }

    proptest! {
        #[test]
        fn no_number_and_no_name_panics(value in any::<f64>(), name in ".*", length in 0usize..40) {
            let texts = [us(value), short_time(value), three_digits(value), ratio(value)];
            prop_assert!(texts.iter().all(|text| !text.is_empty()));
            prop_assert!(elided(&name, length).chars().count() <= length.max(1));
            prop_assert!(wrapped(&name, length.max(1)).iter().all(|line| line.chars().count() <= length.max(1)));
        }
    }
}
