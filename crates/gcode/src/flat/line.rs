//! One line of plain G-code.
//!
//! In:  codes, and words with their numbers.
//! Out: a line that is short enough to be read back, its numbers with as many digits as they need to come back to the bit.

use std::fmt::Write;

/// Octets of a line at most: LinuxCNC takes a few more.
pub(super) const LINE_CHARACTERS_MAX: usize = 250;

/// Digits behind the point at most. Numbers of 0.001 and more need no more; smaller ones are off by less than 1e-20.
const DECIMALS: usize = 20;

/// Digits behind the point in lines that would be too long otherwise: nine axes with all their digits.
const DECIMALS_SHORT: usize = 9;

/// Codes and words of a line, in the order in which they are added.
#[derive(Clone, Debug, Default)]
pub(super) struct Line {
    codes: String,
    words: Vec<(char, f64)>,
}

/// How exactly a line could be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exactness {
    /// Every number comes back to the bit.
    Bits,
    /// Numbers were rounded so that the line fits.
    Rounded,
}

/// Why a line cannot be written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LineError {
    NotFinite(char),
    TooLong,
}

impl Line {
    /// Empties the line and begins a new one.
    pub(super) fn begin(&mut self, codes: &str) -> &mut Line {
        self.codes.clear();
        self.codes.push_str(codes);
        self.words.clear();
        self
    }

    pub(super) fn code(&mut self, code: &str) -> &mut Line {
        if !self.codes.is_empty() {
            self.codes.push(' ');
        }
        self.codes.push_str(code);
        self
    }

    pub(super) fn word(&mut self, letter: char, number: impl Into<f64>) -> &mut Line {
        self.words.push((letter, number.into() + 0.0)); // zero has no sign
        self
    }

    /// The same for a number whose sign counts although it is zero.
    pub(super) fn signed_word(&mut self, letter: char, number: f64) -> &mut Line {
        self.words.push((letter, number));
        self
    }

    /// `$`, which may be left out for the first spindle.
    pub(super) fn spindle(&mut self, spindle: u8) -> &mut Line {
        if spindle == 0 {
            return self;
        }
        self.word('$', spindle)
    }

    pub(super) fn has_words(&self) -> bool {
        !self.words.is_empty()
    }

    /// Appends the line to `text`, with its end.
    pub(super) fn push_to(&self, text: &mut String) -> Result<Exactness, LineError> {
        let start = text.len();
        for (decimals, exactness) in [(DECIMALS, Exactness::Bits), (DECIMALS_SHORT, Exactness::Rounded)] {
            text.push_str(&self.codes);
            for (letter, number) in &self.words {
                if !number.is_finite() {
                    text.truncate(start);
                    return Err(LineError::NotFinite(*letter));
                }
                if text.len() > start {
                    text.push(' ');
                }
                text.push(*letter);
                push_number(text, *number, decimals);
            }
            if text.len() - start <= LINE_CHARACTERS_MAX {
                text.push('\n');
                return Ok(exactness);
            }
            text.truncate(start);
        }
        Err(LineError::TooLong)
    }
}

/// The shortest digits that are read back as `number`, at most `decimals` of them behind the point.
fn push_number(text: &mut String, number: f64, decimals: usize) {
    let start = text.len();
    let _ = write!(text, "{number}"); // a String takes all that is written
    let behind_point = text[start..].find('.').map_or(0, |at| text.len() - start - at - 1);
    if behind_point > decimals {
        text.truncate(start);
        let _ = write!(text, "{number:.decimals$}");
        let kept = text.trim_end_matches('0').trim_end_matches('.').len();
        text.truncate(kept);
        if &text[start..] == "-0" {
            text.truncate(start);
            text.push('0');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(number: f64) -> String {
        let mut text = String::new();
        push_number(&mut text, number, DECIMALS);
        text
    }

    #[test]
    fn numbers_are_plain_and_as_short_as_can_be() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "-0"),
            (1.0, "1"),
            (-25.4, "-25.4"),
            (0.1 + 0.2, "0.30000000000000004"),
            (1e-5, "0.00001"),
            (1e-300, "0"),
            (-1e-300, "0"),
            (1e21, "1000000000000000000000"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn a_line_that_would_be_too_long_has_fewer_digits() {
        let mut text = String::new();
        let mut line = Line::default();
        line.begin("G18 G2");
        for letter in "XYZABCUVWIKF".chars() {
            line.word(letter, -0.123_456_123_456_789_01 / 7000.0);
        }
        assert_eq!(line.push_to(&mut text), Ok(Exactness::Rounded));
        assert!(text.starts_with("G18 G2 X-0.000017637 Y"), "{text}");
        for letter in "PQRSTE".chars() {
            line.word(letter, 1e60);
        }
        assert_eq!(line.push_to(&mut text), Err(LineError::TooLong));
        line.begin("G1").word('X', f64::NAN);
        assert_eq!(line.push_to(&mut text), Err(LineError::NotFinite('X')));
        assert_eq!(text.lines().count(), 1);
    }

    proptest! {
        #[test]
        fn numbers_come_back_to_the_bit(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            prop_assume!(value.is_finite());
            let back: f64 = number(value).parse().unwrap();
            if value.abs() >= 1e-3 || value == 0.0 {
                prop_assert_eq!(back, value);
            } else {
                prop_assert!((back - value).abs() <= 1e-20);
            }
        }
    }
}
