//! Text to tokens.
//!
//! In:  the text of a file.
//! Out: tokens with their places, without comments; what is no token is told and left out.

use crate::diagnostic::{Diagnostics, Kind, Span};
use crate::duration;

/// The smallest part of a program that means something.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Token {
    /// A name or a word of the language, as it is written.
    Word(String),
    /// `INT#`, `Colour#`: what stands before a literal or a value of an enumeration.
    Prefix(String),
    Integer(i128),
    Real(f64),
    /// Nanoseconds.
    Time(i64),
    Text(String),
    /// `%IX0.0`
    Address(String),
    /// A literal that is none of ours, and what it is: `D#2020-01-01`.
    Unsupported(&'static str, String),
    /// Bound of the next loop, from `{max_iterations := n}`.
    Bound(u32),
    Sign(&'static str),
    End,
}

/// A token and its place.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) token: Token,
    pub(crate) at: Span,
}

/// Types of dates, with the short names of some.
pub(crate) const DATES: [&str; 11] = [
    "DATE",
    "D",
    "TIME_OF_DAY",
    "TOD",
    "DATE_AND_TIME",
    "DT",
    "LDATE",
    "LD",
    "LTOD",
    "LDT",
    "LTIME_OF_DAY",
];

/// Operators of other languages, and ours.
const FOREIGN: [(&str, &str); 4] = [("==", "="), ("!=", "<>"), ("&&", "AND"), ("||", "OR")];

/// Longer ones first.
const SIGNS: [&str; 24] = [
    ":=", "=>", "<=", ">=", "<>", "**", "..", ";", ":", ",", ".", "(", ")", "[", "]", "+", "-", "*", "/", "<", ">",
    "=", "&", "^",
];

/// All tokens of a text; the last one is `End`.
pub(crate) fn tokens(text: &str, told: &mut Diagnostics<'_>) -> Vec<Placed> {
    let mut lexer = Lexer {
        text,
        at: 0,
        told,
        tokens: Vec::new(),
    };
    while lexer.at < text.len() {
        lexer.next();
    }
    lexer.push(text.len(), Token::End);
    lexer.tokens
}

struct Lexer<'l, 't> {
    text: &'l str,
    /// Octet, at the beginning of a character.
    at: usize,
    told: &'l mut Diagnostics<'t>,
    tokens: Vec<Placed>,
}

impl Lexer<'_, '_> {
    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn span(&self, start: usize) -> Span {
        Span {
            start: start as u32,
            end: self.at as u32,
        }
    }

    fn push(&mut self, start: usize, token: Token) {
        let at = self.span(start);
        self.tokens.push(Placed { token, at });
    }

    fn error(&mut self, start: usize, kind: Kind) {
        let at = self.span(start);
        self.told.error(at, kind);
    }

    /// Goes on as long as characters are such; what was passed.
    fn take(&mut self, is: impl Fn(char) -> bool) -> &str {
        let start = self.at;
        let length = self.rest().find(|letter| !is(letter)).unwrap_or(self.rest().len());
        self.at += length;
        &self.text[start..self.at]
    }

    fn next(&mut self) {
        if self.foreign() {
            return;
        }
        let start = self.at;
        let rest = self.rest();
        let Some(first) = rest.chars().next() else { return };
        match first {
            _ if first.is_whitespace() || first == '\u{feff}' => self.at += first.len_utf8(),
            '(' if rest.starts_with("(*") => self.comment("(*", "*)"),
            '/' if rest.starts_with("/*") => self.comment("/*", "*/"),
            '/' if rest.starts_with("//") => {
                self.take(|letter| letter != '\n');
            }
            '{' => self.pragma(),
            '\'' => self.string(),
            '"' => {
                self.at += 1;
                self.take(|letter| !matches!(letter, '"' | '\n'));
                self.at += usize::from(self.rest().starts_with('"'));
                self.push(start, Token::Unsupported("texts of 16 bits", "WSTRING".into()));
            }
            '%' => self.address(),
            '0'..='9' => self.number(),
            _ if first.is_ascii_alphabetic() || first == '_' => self.word(),
            _ => match SIGNS.iter().find(|sign| rest.starts_with(**sign)) {
                Some(sign) => {
                    self.at += sign.len();
                    self.push(start, Token::Sign(sign));
                }
                None => {
                    self.at += first.len_utf8();
                    self.error(start, Kind::Character(first));
                }
            },
        }
    }

    /// An operator of another language, which is read as ours.
    fn foreign(&mut self) -> bool {
        let start = self.at;
        let found = FOREIGN.iter().find(|(wrong, _)| self.rest().starts_with(wrong));
        let Some((wrong, right)) = found.copied() else {
            return false;
        };
        self.at += wrong.len();
        self.error(start, Kind::Foreign { wrong, right });
        let is_word = right.starts_with(|letter: char| letter.is_ascii_alphabetic());
        let token = if is_word {
            Token::Word(right.into())
        } else {
            Token::Sign(right)
        };
        self.push(start, token);
        true
    }

    /// Comments of one kind nest.
    fn comment(&mut self, open: &'static str, close: &'static str) {
        let start = self.at;
        let mut depth = 0_u32;
        loop {
            if self.rest().starts_with(open) {
                depth += 1;
                self.at += 2;
            } else if self.rest().starts_with(close) {
                depth -= 1;
                self.at += 2;
                if depth == 0 {
                    return;
                }
            } else if let Some(letter) = self.rest().chars().next() {
                self.at += letter.len_utf8();
            } else {
                let at = Span {
                    start: start as u32,
                    end: start as u32 + 2,
                };
                self.told.error(at, Kind::CommentOpen(close));
                return;
            }
        }
    }

    fn pragma(&mut self) {
        let start = self.at;
        let inner = self.take(|letter| letter != '}')[1..].to_owned();
        if self.rest().is_empty() {
            let at = Span {
                start: start as u32,
                end: start as u32 + 1,
            };
            self.told.error(at, Kind::PragmaOpen);
            return;
        }
        self.at += 1;
        let bound = inner.split_once(":=").and_then(|(name, value)| {
            let is_bound = name.trim().eq_ignore_ascii_case("max_iterations");
            is_bound.then(|| value.trim().replace('_', "").parse::<u32>())
        });
        match bound {
            Some(Ok(bound)) if bound > 0 => self.push(start, Token::Bound(bound)),
            Some(_) => self.error(
                start,
                Kind::Number(inner, "a loop is bound to 1 to 4294967295 iterations"),
            ),
            None => {
                let at = self.span(start);
                self.told.note(at, Kind::PragmaSkipped);
            }
        }
    }

    fn string(&mut self) {
        let start = self.at;
        self.at += 1;
        let mut text = String::new();
        loop {
            let mut letters = self.rest().chars();
            match letters.next() {
                Some('\'') => {
                    self.at += 1;
                    self.push(start, Token::Text(text));
                    return;
                }
                None | Some('\n' | '\r') => {
                    self.error(start, Kind::StringOpen);
                    return;
                }
                Some('$') => {
                    let from = self.at;
                    let escape: String = letters.take(2).take_while(|letter| *letter != '\n').collect();
                    self.at += 1;
                    match escaped(&escape) {
                        Some((letter, length)) => {
                            text.push(letter);
                            self.at += length;
                        }
                        None => self.error(from, Kind::StringEscape(escape)),
                    }
                }
                Some(letter) => {
                    text.push(letter);
                    self.at += letter.len_utf8();
                }
            }
        }
    }

    fn address(&mut self) {
        let start = self.at;
        self.at += 1;
        let address = self.take(|letter| letter.is_ascii_alphanumeric() || letter == '.');
        let address = format!("%{}", address.to_ascii_uppercase());
        // Its place is given later.
        if matches!(address.as_str(), "%I" | "%Q" | "%M") && self.rest().starts_with('*') {
            self.at += 1;
            return self.push(start, Token::Address(address + "*"));
        }
        let mut rest = address[1..].strip_prefix(['I', 'Q', 'M']);
        rest = rest.map(|rest| rest.strip_prefix(['X', 'B', 'W', 'D', 'L']).unwrap_or(rest));
        let is_number =
            |part: &str| !part.is_empty() && part.len() <= 6 && part.bytes().all(|octet| octet.is_ascii_digit());
        if rest.is_some_and(|rest| rest.split('.').all(is_number)) {
            self.push(start, Token::Address(address));
        } else {
            self.error(start, Kind::Address(address));
        }
    }

    fn word(&mut self) {
        let start = self.at;
        let word = self
            .take(|letter| letter.is_ascii_alphanumeric() || letter == '_')
            .to_owned();
        if self.rest().starts_with('#') {
            self.at += 1;
            let is_time = ["T", "TIME", "LT", "LTIME"]
                .iter()
                .any(|name| word.eq_ignore_ascii_case(name));
            let is_date = DATES.iter().any(|name| word.eq_ignore_ascii_case(name));
            if is_date && self.rest().starts_with(|letter: char| letter.is_ascii_digit()) {
                self.take(|letter| letter.is_ascii_digit() || matches!(letter, '-' | ':' | '.' | '_'));
                return self.push(start, Token::Unsupported("dates", format!("{word}#")));
            }
            return if is_time {
                self.time(start)
            } else {
                self.push(start, Token::Prefix(word))
            };
        }
        if word.contains("__") || word.ends_with('_') {
            let at = self.span(start);
            self.told.warning(at, Kind::Underscores(word.clone()));
        }
        self.push(start, Token::Word(word));
    }

    /// Behind `T#`.
    fn time(&mut self, start: usize) {
        let from = self.at;
        self.take(|letter| matches!(letter, '-' | '+'));
        self.take(|letter| letter.is_ascii_alphanumeric() || letter == '_' || letter == '.');
        // A range `T#1s..T#2s` is none of the language's, but its points are no part of the duration.
        match duration::parse(&self.text[from..self.at]) {
            Ok(nanoseconds) => self.push(start, Token::Time(nanoseconds)),
            Err(rule) => {
                let written = self.text[start..self.at].to_owned();
                self.error(start, Kind::Duration(written, rule));
                self.push(start, Token::Time(0));
            }
        }
    }

    fn number(&mut self) {
        let start = self.at;
        let digits = |lexer: &mut Self| {
            lexer
                .take(|letter| letter.is_ascii_digit() || letter == '_')
                .replace('_', "")
        };
        let mut written = digits(self);
        let mut rule = None;
        let mut token = Token::Integer(0);
        if self.rest().starts_with('#') {
            self.at += 1;
            let value = self
                .take(|letter| letter.is_ascii_alphanumeric() || letter == '_')
                .replace('_', "");
            match written.as_str() {
                "2" | "8" | "16" => {
                    let base = written.parse().unwrap_or(16);
                    match i128::from_str_radix(&value, base) {
                        Ok(value) => token = Token::Integer(value),
                        Err(_) => rule = Some("its digits are none of its base, or too many"),
                    }
                }
                _ => rule = Some("the base is 2, 8 or 16"),
            }
        } else {
            let digit_behind =
                |rest: &str, skip: usize| rest[skip..].starts_with(|letter: char| letter.is_ascii_digit());
            let is_real = self.rest().starts_with('.') && digit_behind(self.rest(), 1);
            if is_real {
                self.at += 1;
                written = format!("{written}.{}", digits(self));
                if self.rest().starts_with(['e', 'E']) {
                    let sign = usize::from(self.rest()[1..].starts_with(['+', '-']));
                    if digit_behind(self.rest(), 1 + sign) {
                        written += &self.text[self.at..self.at + 1 + sign];
                        self.at += 1 + sign;
                        written += &digits(self);
                    }
                }
                match written.parse::<f64>() {
                    Ok(value) if value.is_finite() => token = Token::Real(value),
                    _ => rule = Some("it is too great"),
                }
            } else {
                match written.parse::<i128>() {
                    Ok(value) => token = Token::Integer(value),
                    Err(_) => rule = Some("it is too great"),
                }
                let point = self.rest().starts_with('.') && !self.rest().starts_with("..");
                if point && !self.rest()[1..].starts_with(|letter: char| letter.is_ascii_alphabetic()) {
                    self.at += 1;
                    rule = Some("a digit stands on both sides of the point");
                }
            }
            if self
                .rest()
                .starts_with(|letter: char| letter.is_ascii_alphabetic() || letter == '_')
            {
                self.take(|letter| letter.is_ascii_alphanumeric() || letter == '_');
                rule = rule.or(Some("letters follow it; exponents belong to numbers with a point"));
            }
        }
        if matches!(token, Token::Integer(value) if value > i128::from(u64::MAX)) {
            rule = rule.or(Some("it is too great"));
            token = Token::Integer(0);
        }
        if let Some(rule) = rule {
            let written = self.text[start..self.at].to_owned();
            self.error(start, Kind::Number(written, rule));
        }
        self.push(start, token);
    }
}

/// The character that stands for what follows `$`, and how many octets that is.
fn escaped(escape: &str) -> Option<(char, usize)> {
    let first = escape.chars().next()?;
    let one = match first.to_ascii_uppercase() {
        '$' | '\'' => Some(first),
        'N' | 'L' => Some('\n'),
        'P' => Some('\u{c}'),
        'R' => Some('\r'),
        'T' => Some('\t'),
        _ => None,
    };
    if let Some(letter) = one {
        return Some((letter, 1));
    }
    let code = u8::from_str_radix(escape, 16).ok()?;
    (escape.len() == 2 && !escape.starts_with('+')).then_some((char::from(code), 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tokens as they are printed, and what was told.
    fn read(text: &str) -> (Vec<Token>, Vec<String>) {
        let mut told = Diagnostics::new(text);
        let tokens = tokens(text, &mut told);
        let told = told.finish().iter().map(ToString::to_string).collect();
        (tokens.into_iter().map(|placed| placed.token).collect(), told)
    }

    #[test]
    fn every_literal_of_the_language_is_read() {
        let integers = [
            ("123", 123),
            ("1_000", 1000),
            ("16#FF", 255),
            ("16#ff_00", 0xFF00),
            ("8#17", 15),
            ("2#1010_1010", 170),
        ];
        for (text, value) in integers {
            assert_eq!(read(text), (vec![Token::Integer(value), Token::End], vec![]), "{text}");
        }
        for (text, value) in [("1.0", 1.0), ("1.0E-3", 1e-3), ("1_0.5", 10.5), ("2.5e+2", 250.0)] {
            assert_eq!(read(text).0[0], Token::Real(value), "{text}");
        }
        assert_eq!(read("INT#5").0[..2], [Token::Prefix("INT".into()), Token::Integer(5)]);
        assert_eq!(read("'it$'s $$5$N$41'").0[0], Token::Text("it's $5\nA".into()));
        assert_eq!(
            read("1..5").0[..3],
            [Token::Integer(1), Token::Sign(".."), Token::Integer(5)]
        );
        assert_eq!(read("T#1h2m3s4ms").0[0], Token::Time(3_723_004_000_000));
        assert_eq!(read("time#-5S").0[0], Token::Time(-5_000_000_000));
        assert_eq!(read("%ix0.1").0[0], Token::Address("%IX0.1".into()));
    }

    #[test]
    fn what_is_no_literal_is_told_with_its_place() {
        let cases = [
            (
                "x 1.",
                "1:3: 1. is no number: a digit stands on both sides of the point",
            ),
            (
                "1E3",
                "1:1: 1E3 is no number: letters follow it; exponents belong to numbers with a point",
            ),
            ("7#1", "1:1: 7#1 is no number: the base is 2, 8 or 16"),
            (
                "2#12",
                "1:1: 2#12 is no number: its digits are none of its base, or too many",
            ),
            (
                "99999999999999999999",
                "1:1: 99999999999999999999 is no number: it is too great",
            ),
            ("a\n 'x", "2:2: the text is not closed: ' is missing in its line"),
            (
                "'$q'",
                "1:2: $q' is none of $$ $' $N $L $P $R $T or two hexadecimal digits",
            ),
            ("(* a (* b *)", "1:1: the comment is not closed: *) is missing"),
            (
                "%K1",
                "1:1: %K1 is no address: it is %, one of I Q M, one of X B W D L or none, and numbers with points between them",
            ),
            ("a ? b", "1:3: '?' is nothing in Structured Text"),
            ("{x", "1:1: the pragma is not closed: } is missing"),
            ("{x}", "1:1: note: the pragma has no effect"),
            (
                "a__b",
                "1:1: warning: a__b: the standard has no name with two _ in a row or one at its end",
            ),
        ];
        for (text, message) in cases {
            assert_eq!(read(text).1, [message], "{text}");
        }
    }

    #[test]
    fn comments_nest_and_mean_nothing() {
        let text = "a (* 1 (* 2 *) 3 *) b // c\n/* d /* e */ */ f {max_iterations := 20}";
        let (tokens, told) = read(text);
        let word = |name: &str| Token::Word(name.into());
        assert_eq!(tokens, [word("a"), word("b"), word("f"), Token::Bound(20), Token::End]);
        assert!(told.is_empty());
    }
}
