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

    /// As indices of a line.
    pub(crate) fn range(self) -> std::ops::Range<usize> {
        self.start.into()..self.end.into()
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

/// A broken rule and the octets of the line that break it.
pub(crate) type Fault = (Span, ErrorKind);

/// What stands next on a line. The number of a letter and the assignment to a parameter are read next, with
/// [`Cursor::value`] and [`Cursor::parameter_target`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Item {
    /// `/` as first octet of the line.
    BlockDelete,
    /// Capital letter, or one of `@ ^ $`.
    Letter(u8),
    /// `#`
    Parameter,
    /// `( ... )`: the text between the parentheses.
    Comment(Span),
    /// `; ...`: the text behind the semicolon.
    Remark(Span),
}

/// A place in a line; reads from left to right.
#[derive(Clone, Debug)]
pub(crate) struct Cursor<'l> {
    pub(crate) line: &'l [u8],
    pub(crate) at: usize,
    /// First octet of the item taken last.
    start: usize,
}

impl<'l> Cursor<'l> {
    /// `line` is at most [`LINE_MAX`] octets long.
    pub(crate) fn new(line: &'l [u8]) -> Cursor<'l> {
        debug_assert!(line.len() <= LINE_MAX);
        Cursor { line, at: 0, start: 0 }
    }

    /// Next octet that is no blank, in upper case, without taking it.
    #[inline]
    pub(crate) fn peek(&mut self) -> Option<u8> {
        while let Some(&octet) = self.line.get(self.at) {
            if !is_blank(octet) {
                return Some(octet.to_ascii_uppercase());
            }
            self.at += 1;
        }
        None
    }

    /// Takes the next octet that is no blank if it is `octet`, an upper case letter or a sign.
    #[inline]
    pub(crate) fn take(&mut self, octet: u8) -> bool {
        let found = self.peek() == Some(octet);
        self.at += usize::from(found);
        found
    }

    /// Takes `word`, of upper case letters, if it stands here in any case and with any blanks.
    pub(crate) fn take_word(&mut self, word: &[u8]) -> bool {
        let before = self.at;
        let found = word.iter().all(|octet| self.take(*octet));
        if !found {
            self.at = before;
        }
        found
    }

    /// The letters that stand here, in upper case, without the blanks between them. Takes them.
    pub(crate) fn take_letters(&mut self) -> String {
        let mut letters = String::new();
        while let Some(letter @ b'A'..=b'Z') = self.peek() {
            letters.push(letter.into());
            self.at += 1;
        }
        letters
    }

    /// Takes what stands next on the line; its octets so far are [`Self::span`]. `None`: nothing is left.
    /// After a fault, reading goes on behind what is wrong.
    #[inline]
    pub(crate) fn item(&mut self) -> Option<Result<Item, Fault>> {
        let octet = self.peek()?;
        self.start = self.at;
        if octet.is_ascii_uppercase() {
            self.at += 1;
            return Some(Ok(Item::Letter(octet)));
        }
        Some(self.other_item(octet))
    }

    fn other_item(&mut self, octet: u8) -> Result<Item, Fault> {
        self.at += 1;
        match octet {
            b'@' | b'^' | b'$' => Ok(Item::Letter(octet)),
            b'#' => Ok(Item::Parameter),
            b'(' => self.comment().map(Item::Comment),
            b';' => {
                let text = Span::new(self.at, self.line.len());
                self.at = self.line.len();
                Ok(Item::Remark(text))
            }
            b'/' if is_empty(&self.line[..self.start]) => Ok(Item::BlockDelete),
            b'/' => Err((self.span(), ErrorKind::MisplacedSlash)),
            b')' => Err((self.span(), ErrorKind::StrayParenthesis)),
            _ => Err(self.bad_character()),
        }
    }

    /// The octet before the cursor means nothing here; all octets of a character in UTF-8 are one mistake.
    #[cold]
    pub(crate) fn bad_character(&mut self) -> Fault {
        let start = self.at - 1;
        if self.line[start] >= 0xC0 {
            let rest = &self.line[self.at..];
            self.at += rest.iter().take_while(|octet| is_continuation(**octet)).count().min(3);
        }
        let text = String::from_utf8_lossy(&self.line[start..self.at]);
        let character = text.chars().next().unwrap_or(char::REPLACEMENT_CHARACTER);
        (Span::new(start, self.at), ErrorKind::BadCharacter(character))
    }

    /// The text of a comment whose parenthesis is taken.
    fn comment(&mut self) -> Result<Span, Fault> {
        let start = self.at;
        let length = self.line[start..].iter().position(|octet| matches!(octet, b'(' | b')'));
        let Some(length) = length else {
            self.at = self.line.len();
            return Err((Span::new(start - 1, self.at), ErrorKind::UnclosedComment));
        };
        let end = start + length;
        if self.line[end] == b'(' {
            self.at = self.line.len();
            return Err((Span::new(end, end + 1), ErrorKind::NestedComment));
        }
        self.at = end + 1;
        Ok(Span::new(start, end))
    }

    /// The octets of the item taken last and of the value behind it, as far as they are read.
    #[inline]
    pub(crate) fn span(&self) -> Span {
        self.span_from(self.start)
    }

    /// The octets from `start` to the cursor, without blanks at their end.
    #[inline]
    pub(crate) fn span_from(&self, start: usize) -> Span {
        let mut end = self.at;
        while end > start && is_blank(self.line[end - 1]) {
            end -= 1;
        }
        Span::new(start, end)
    }
}

/// Whether a line has nothing but blanks.
pub(crate) fn is_empty(octets: &[u8]) -> bool {
    octets.iter().all(|octet| is_blank(*octet))
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

    fn items(line: &str) -> Vec<Result<(Item, Span), Fault>> {
        let mut cursor = Cursor::new(line.as_bytes());
        let mut items = Vec::new();
        while let Some(item) = cursor.item() {
            if item == Ok(Item::Letter(b'X')) {
                crate::number::read(cursor.line, &mut cursor.at).unwrap();
            }
            items.push(item.map(|item| (item, cursor.span())));
        }
        items
    }

    #[test]
    fn items_of_a_line_with_their_places() {
        assert_eq!(
            items(" / x1 . 5 @^$#(a b); c"),
            [
                Ok((Item::BlockDelete, Span::new(1, 2))),
                Ok((Item::Letter(b'X'), Span::new(3, 9))),
                Ok((Item::Letter(b'@'), Span::new(10, 11))),
                Ok((Item::Letter(b'^'), Span::new(11, 12))),
                Ok((Item::Letter(b'$'), Span::new(12, 13))),
                Ok((Item::Parameter, Span::new(13, 14))),
                Ok((Item::Comment(Span::new(15, 18)), Span::new(14, 19))),
                Ok((Item::Remark(Span::new(20, 22)), Span::new(19, 22))),
            ]
        );
    }

    #[test]
    fn what_is_wrong_between_words_is_told_and_passed() {
        assert_eq!(
            items("X1/)=\u{e4}"),
            [
                Ok((Item::Letter(b'X'), Span::new(0, 2))),
                Err((Span::new(2, 3), ErrorKind::MisplacedSlash)),
                Err((Span::new(3, 4), ErrorKind::StrayParenthesis)),
                Err((Span::new(4, 5), ErrorKind::BadCharacter('='))),
                Err((Span::new(5, 7), ErrorKind::BadCharacter('\u{e4}'))),
            ]
        );
        assert_eq!(items("(a (b"), [Err((Span::new(3, 4), ErrorKind::NestedComment))]);
        assert_eq!(items(" (a"), [Err((Span::new(1, 3), ErrorKind::UnclosedComment))]);
        assert_eq!(items(";(a"), [Ok((Item::Remark(Span::new(1, 3)), Span::new(0, 3)))]);
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
