//! One line of text to words, each with its place.
//!
//! In:  the octets of one line, without its end.
//! Out: [`Token`]s with their [`Span`], or what is wrong at a place; the scan goes on behind it.
//!
//! Blanks, tabs and carriage returns are ignored everywhere outside comments, even inside numbers. Allocates nothing.

use crate::error::{ErrorKind, ExpressionError};
use crate::number;
use crate::octet::{is_blank, is_continuation, is_empty};

/// Greatest magnitude of a number; it keeps every later sum and product finite.
pub(crate) const NUMBER_MAX: f64 = 1e9;

/// Longest line, octets. LinuxCNC's limit; it also bounds the text kept for messages.
pub const LINE_OCTETS_MAX: usize = 256;

/// Octets of a line, counted from its start; lines are short (see [`LINE_OCTETS_MAX`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) start: u16,
    pub(crate) end: u16,
}

impl Span {
    /// `start` and `end` are at most [`LINE_OCTETS_MAX`].
    pub(crate) fn new(start: usize, end: usize) -> Span {
        debug_assert!(start <= end && end <= LINE_OCTETS_MAX);
        Span {
            start: start as u16,
            end: end as u16,
        }
    }

    /// What breaks a rule here.
    pub(crate) fn fault(self, kind: impl Into<ErrorKind>) -> Fault {
        (self, kind.into())
    }

    /// As indices of a line.
    pub(crate) fn range(self) -> std::ops::Range<usize> {
        self.start.into()..self.end.into()
    }

    /// The octets of `line` that the span covers.
    pub(crate) fn slice<'t>(&self, line: &'t [u8]) -> &'t [u8] {
        &line[self.start as usize..self.end as usize]
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
    /// `line` is at most [`LINE_OCTETS_MAX`] octets long.
    pub(crate) fn new(line: &'l [u8]) -> Cursor<'l> {
        debug_assert!(line.len() <= LINE_OCTETS_MAX);
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
    pub(crate) fn consume(&mut self, octet: u8) -> bool {
        let found = self.peek() == Some(octet);
        self.at += usize::from(found);
        found
    }

    /// Takes `word`, of upper case letters, if it stands here in any case and with any blanks.
    pub(crate) fn consume_word(&mut self, word: &[u8]) -> bool {
        let before = self.at;
        let found = word.iter().all(|octet| self.consume(*octet));
        if !found {
            self.at = before;
        }
        found
    }

    /// The letters that stand here, in upper case, without the blanks between them. Takes them.
    pub(crate) fn consume_letters(&mut self) -> String {
        let mut letters = String::new();
        while let Some(letter @ b'A'..=b'Z') = self.peek() {
            letters.push(letter.into());
            self.at += 1;
        }
        letters
    }

    /// Takes a letter with a plain number, as nearly all words are; none of O, which may be an O-word. `None`: something
    /// else stands here, and nothing is taken.
    #[inline]
    pub(crate) fn plain_word(&mut self) -> Option<(u8, f64)> {
        let letter = self
            .peek()
            .filter(|octet| octet.is_ascii_uppercase() && *octet != b'O')?;
        let start = self.at;
        self.at += 1;
        let negative = self.consume(b'-');
        if let Some(b'0'..=b'9' | b'.') = self.peek()
            && let Ok(number) = number::read(self.line, &mut self.at)
        {
            self.start = start;
            return Some((letter, if negative { -number } else { number }));
        }
        self.at = start;
        None
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

    /// Takes `-05` of `X1.5e-05`, whose E was taken last. `None`: without a sign that E may be a word.
    #[cold]
    pub(crate) fn exponent(&mut self) -> Option<Fault> {
        let has_sign = matches!(self.line.get(self.at), Some(b'-' | b'+'));
        let (span, kind) = number_with_exponent(self.line, self.start).filter(|_| has_sign)?;
        self.at = span.end.into();
        Some((span, kind))
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

/// The number around the E at a place of a line, if it is one with an exponent, as programs for a computer write it.
#[cold]
pub(crate) fn number_with_exponent(line: &[u8], e: usize) -> Option<Fault> {
    let digits = |octets: &[u8]| octets.iter().take_while(|octet| octet.is_ascii_digit()).count();
    let is_part = |octet: &&u8| octet.is_ascii_digit() || **octet == b'.';
    let before = line[..e].iter().rev().take_while(is_part).count();
    let behind = line.get(e + 1..)?;
    let sign = usize::from(matches!(behind.first(), Some(b'-' | b'+')));
    let count = digits(&behind[sign..]);
    if before == 0 || count == 0 {
        return None;
    }
    let start = e - before;
    let start = start - usize::from(start > 0 && line[start - 1] == b'-');
    let end = e + 1 + sign + count;
    let written = String::from_utf8_lossy(&line[start..end]).into_owned();
    let number: f64 = written.parse().ok()?;
    if number.abs() > NUMBER_MAX {
        return None;
    }
    // Nobody means less than that, and it would fill the line.
    let plain = if number.abs() < 1e-15 { 0.0 } else { number }.to_string();
    Some((
        Span::new(start, end),
        ExpressionError::Exponent { written, plain }.into(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
