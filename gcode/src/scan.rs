//! One line of text to words, each with its place.
//!
//! In:  the octets of one line, without its end.
//! Out: [`Token`]s with their [`Span`], or what is wrong at a place; the scan goes on behind it.
//!
//! Blanks, tabs and carriage returns are ignored everywhere outside comments, even inside numbers. Allocates nothing.

use crate::error::{Construct, ErrorKind};

/// Greatest magnitude of a number; it keeps every later sum and product finite.
pub(crate) const NUMBER_MAX: f64 = 1e9;

/// Longest line, octets. LinuxCNC's limit; it also bounds the text kept for messages.
pub const LINE_MAX: usize = 256;

/// Octets of a line, counted from its start; lines are short (see [`LINE_MAX`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) start: u16,
    pub(crate) end: u16,
}

impl Span {
    /// `start` and `end` are at most [`LINE_MAX`].
    pub(crate) fn new(start: usize, end: usize) -> Span {
        debug_assert!(start <= end && end <= LINE_MAX);
        Span {
            start: start as u16,
            end: end as u16,
        }
    }

    /// The octets of `line` that the span covers.
    pub(crate) fn of<'t>(&self, line: &'t [u8]) -> &'t [u8] {
        &line[self.start as usize..self.end as usize]
    }
}

/// What a line is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Token {
    /// `/`
    Slash,
    /// A letter and its number.
    Word {
        /// Capital letter, never `O`.
        letter: u8,
        /// Its number.
        value: f64,
    },
    /// `( ... )`: the text between the parentheses.
    Comment(Span),
}

/// Reads one line from left to right.
pub(crate) struct Scanner<'t> {
    line: &'t [u8],
    at: usize,
}

impl<'t> Scanner<'t> {
    /// `line` is at most [`LINE_MAX`] octets long.
    pub(crate) fn new(line: &'t [u8]) -> Scanner<'t> {
        debug_assert!(line.len() <= LINE_MAX);
        Scanner { line, at: 0 }
    }

    /// Next octet that is no blank, without taking it.
    fn peek(&mut self) -> Option<u8> {
        while let Some(&octet) = self.line.get(self.at) {
            if !is_blank(octet) {
                return Some(octet);
            }
            self.at += 1;
        }
        None
    }

    fn comment(&mut self, start: usize) -> (Span, Result<Token, ErrorKind>) {
        let text = &self.line[start + 1..];
        let length = text.iter().position(|&octet| octet == b'(' || octet == b')');
        match length.map(|length| (length, text[length])) {
            Some((length, b')')) => {
                self.at = start + 1 + length + 1;
                (
                    Span::new(start, self.at),
                    Ok(Token::Comment(Span::new(start + 1, self.at - 1))),
                )
            }
            Some((length, _)) => {
                let inner = start + 1 + length;
                self.at = self.line.len();
                (Span::new(inner, inner + 1), Err(ErrorKind::NestedComment))
            }
            None => {
                self.at = self.line.len();
                (Span::new(start, self.at), Err(ErrorKind::UnclosedComment))
            }
        }
    }

    fn word(&mut self, start: usize, letter: u8) -> (Span, Result<Token, ErrorKind>) {
        self.at = start + 1;
        let value = match self.peek() {
            Some(b'#') => Err(ErrorKind::UnsupportedConstruct(Construct::Parameter)),
            Some(b'[') => Err(ErrorKind::UnsupportedConstruct(Construct::Expression)),
            Some(octet) if octet.is_ascii_alphabetic() && self.is_function() => {
                Err(ErrorKind::UnsupportedConstruct(Construct::Expression))
            }
            Some(_) | None => self.number(letter),
        };
        if let Err(ErrorKind::UnsupportedConstruct(_)) = value {
            // What follows belongs to the expression; reading it as words would only raise errors that follow.
            self.at = self.line.len();
        }
        let value = value.map(|value| Token::Word { letter, value });
        (Span::new(start, self.end_without_blanks(start)), value)
    }

    /// Whether a function name of LinuxCNC's expressions stands here.
    fn is_function(&self) -> bool {
        const NAMES: [&[u8]; 14] = [
            b"ABS[", b"ACOS[", b"ASIN[", b"ATAN[", b"COS[", b"EXISTS[", b"EXP[", b"FIX[", b"FUP[", b"LN[", b"ROUND[",
            b"SIN[", b"SQRT[", b"TAN[",
        ];
        let letters = || {
            self.line[self.at..]
                .iter()
                .filter(|octet| !is_blank(**octet))
                .map(u8::to_ascii_uppercase)
        };
        NAMES
            .iter()
            .any(|name| letters().take(name.len()).eq(name.iter().copied()))
    }

    /// Optional sign, digits, optional point, digits. On an error the scan stands behind what was read.
    ///
    /// Up to 15 digits are collected in a `u64` and divided once by a power of ten: both are exact, so the quotient is
    /// the nearest `f64`. Longer numbers go to the standard library.
    fn number(&mut self, letter: u8) -> Result<f64, ErrorKind> {
        let start = self.at;
        let mut mantissa = 0_u64;
        let mut digits = 0_usize; // without leading zeros
        let mut decimals = 0_usize;
        let (mut any_digit, mut point, mut negative) = (false, false, false);
        if let Some(sign @ (b'+' | b'-')) = self.peek() {
            negative = sign == b'-';
            self.at += 1;
        }
        while let Some(octet) = self.peek() {
            match octet {
                b'0'..=b'9' => {
                    any_digit = true;
                    mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(octet - b'0'));
                    digits += usize::from(digits > 0 || octet != b'0');
                    decimals += usize::from(point);
                }
                b'.' if !point => point = true,
                b'.' | b'+' | b'-' => {
                    while matches!(self.peek(), Some(b'0'..=b'9' | b'.' | b'+' | b'-')) {
                        self.at += 1;
                    }
                    return Err(ErrorKind::NumberMalformed { letter: letter.into() });
                }
                _ => break,
            }
            self.at += 1;
        }
        if !any_digit {
            return Err(if point {
                ErrorKind::NumberMalformed { letter: letter.into() }
            } else {
                ErrorKind::NumberMissing { letter: letter.into() }
            });
        }
        let magnitude = if digits <= 15 && decimals < POWERS_OF_TEN.len() {
            mantissa as f64 / POWERS_OF_TEN[decimals]
        } else {
            long_number(&self.line[start..self.at])
        };
        if magnitude > NUMBER_MAX {
            return Err(ErrorKind::NumberTooLarge {
                letter: letter.into(),
                max: NUMBER_MAX,
            });
        }
        Ok(if negative { -magnitude } else { magnitude })
    }

    /// Blanks behind a word do not belong to it.
    fn end_without_blanks(&self, start: usize) -> usize {
        let used = &self.line[start..self.at];
        start
            + used
                .iter()
                .rposition(|octet| !is_blank(*octet))
                .map_or(0, |last| last + 1)
    }
}

impl Iterator for Scanner<'_> {
    type Item = (Span, Result<Token, ErrorKind>);

    fn next(&mut self) -> Option<Self::Item> {
        let octet = self.peek()?;
        let start = self.at;
        let rest_is = |construct| Err(ErrorKind::UnsupportedConstruct(construct));
        let (end, token) = match octet.to_ascii_uppercase() {
            b';' => {
                self.at = self.line.len();
                return None;
            }
            b'(' => return Some(self.comment(start)),
            b')' => (start + 1, Err(ErrorKind::StrayParenthesis)),
            b'/' => (start + 1, Ok(Token::Slash)),
            b'#' => (self.line.len(), rest_is(Construct::Parameter)),
            b'[' | b']' => (self.line.len(), rest_is(Construct::Expression)),
            b'O' => (self.line.len(), rest_is(Construct::OWord)),
            b'@' | b'^' => (self.line.len(), rest_is(Construct::Polar)),
            b'$' => (self.line.len(), rest_is(Construct::SpindleNumber)),
            letter @ b'A'..=b'Z' => return Some(self.word(start, letter)),
            _ => {
                // All octets of a character in UTF-8 are one mistake.
                let rest = &self.line[start + 1..];
                let more = rest.iter().take_while(|octet| is_continuation(**octet)).count();
                let end = start + 1 + if octet >= 0xC0 { more } else { 0 };
                let character = String::from_utf8_lossy(&self.line[start..end]).chars().next();
                (
                    end,
                    Err(ErrorKind::BadCharacter(
                        character.unwrap_or(char::REPLACEMENT_CHARACTER),
                    )),
                )
            }
        };
        self.at = end;
        Some((Span::new(start, self.end_without_blanks(start)), token))
    }
}

/// Ignored outside comments.
pub(crate) fn is_blank(octet: u8) -> bool {
    matches!(octet, b' ' | b'\t' | b'\r')
}

/// Second and further octets of a character in UTF-8.
pub(crate) fn is_continuation(octet: u8) -> bool {
    octet & 0xC0 == 0x80
}

/// Powers of ten that an `f64` holds exactly.
const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// Magnitude of a number with more digits than fit the short way; `text` was found well formed.
#[cold]
fn long_number(text: &[u8]) -> f64 {
    let digits: String = text
        .iter()
        .copied()
        .filter(|octet| octet.is_ascii_digit() || *octet == b'.')
        .map(char::from)
        .collect();
    digits.parse().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn words(line: &str) -> Vec<(u8, f64)> {
        Scanner::new(line.as_bytes())
            .map(|(_, token)| match token {
                Ok(Token::Word { letter, value }) => (letter, value),
                other => panic!("{other:?}"),
            })
            .collect()
    }

    #[test]
    fn blanks_and_case_do_not_count() {
        assert_eq!(
            words(" g 0\tx 1 0 . 5 y- . 2 5\r"),
            [(b'G', 0.0), (b'X', 10.5), (b'Y', -0.25)]
        );
        assert_eq!(words("G01X+1.Z.5"), [(b'G', 1.0), (b'X', 1.0), (b'Z', 0.5)]);
    }

    #[test]
    fn an_exponent_is_a_word_of_its_own() {
        assert_eq!(words("X1e3"), [(b'X', 1.0), (b'E', 3.0)]);
    }

    #[test]
    fn spans_cover_the_word_without_blanks_around_it() {
        let spans: Vec<_> = Scanner::new(b"  G1  X 1 2  (a b) ")
            .map(|(span, _)| (span.start, span.end))
            .collect();
        assert_eq!(spans, [(2, 4), (6, 11), (13, 18)]);
    }

    #[test]
    fn comments_keep_their_text() {
        let tokens: Vec<_> = Scanner::new(b"(MSG, a) ; (not read").map(|(_, token)| token).collect();
        assert_eq!(tokens, [Ok(Token::Comment(Span::new(1, 7)))]);
    }

    proptest! {
        #[test]
        fn numbers_equal_those_of_the_standard_library(text in "[+-]?([0-9]{1,9}(\\.[0-9]{0,40})?|\\.[0-9]{1,40})") {
            let expected: f64 = text.parse().unwrap();
            let (_, token) = Scanner::new(format!("X{text}").as_bytes()).next().unwrap();
            match token {
                Ok(Token::Word { value, .. }) => prop_assert_eq!(value.to_bits(), expected.to_bits()),
                other => prop_assert!(false, "{:?}", other),
            }
        }

        #[test]
        fn any_line_is_scanned_to_its_end(line in prop::collection::vec(any::<u8>(), 0..LINE_MAX)) {
            let mut last = 0;
            for (span, _) in Scanner::new(&line) {
                prop_assert!(span.start >= last && span.end >= span.start && usize::from(span.end) <= line.len());
                last = span.start;
            }
        }
    }
}
