//! Words of a line: letters with their numbers.

use crate::number::ErrorNumber;

/// A letter and its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Word {
    pub(crate) letter: char,
    pub(crate) value: f64,
}

impl Word {
    /// The number in hundredths, as codes are told apart: 38.2 is 3820. `None`: it has more places.
    pub(crate) fn code(self) -> Option<u16> {
        let hundredths = (self.value * 100.0).round();
        let is_code = (0.0..=65_000.0).contains(&hundredths) && (hundredths / 100.0 - self.value).abs() < 1e-6;
        is_code.then_some(hundredths as u16)
    }
}

/// Takes a line without spaces and comments apart.
///
/// # Errors
/// The first word that is none.
pub(crate) fn words(line: &str) -> Result<Vec<Word>, ErrorNumber> {
    let mut rest = line;
    let mut words = Vec::new();
    while let Some(letter) = rest.chars().next() {
        if !letter.is_ascii_uppercase() {
            return Err(ErrorNumber::ExpectedLetter);
        }
        rest = &rest[1..];
        let end = rest.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(rest.len());
        let value = number(&rest[..end]).ok_or(ErrorNumber::BadNumber)?;
        words.push(Word { letter, value });
        rest = &rest[end..];
    }
    Ok(words)
}

/// Digits, a sign and a point; no exponent.
fn number(text: &str) -> Option<f64> {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    let is_number =
        digits.chars().all(|c| c.is_ascii_digit() || c == '.') && digits.contains(|c: char| c.is_ascii_digit());
    text.parse().ok().filter(|value: &f64| is_number && value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_letters_with_numbers() {
        let word = |letter, value| Word { letter, value };
        assert_eq!(
            words("G1X-1.5Y+.5F100."),
            Ok(vec![word('G', 1.0), word('X', -1.5), word('Y', 0.5), word('F', 100.0)])
        );
        assert_eq!(words(""), Ok(vec![]));
        assert_eq!(words("1X"), Err(ErrorNumber::ExpectedLetter));
        for line in ["G", "GX1", "X1.2.3", "X--1", "X1-", "X."] {
            assert_eq!(words(line), Err(ErrorNumber::BadNumber), "{line}");
        }
        // E is a letter, and no exponent.
        assert_eq!(words("X1E"), Err(ErrorNumber::BadNumber));
    }

    #[test]
    fn codes_have_two_places() {
        let code = |value| Word { letter: 'G', value }.code();
        assert_eq!([code(38.2), code(1.0), code(92.1)], [Some(3820), Some(100), Some(9210)]);
        assert_eq!([code(1.005), code(-1.0), code(1e9)], [None; 3]);
    }
}
