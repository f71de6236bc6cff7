//! Tokens to declarations and statements.
//!
//! In:  tokens of a file.
//! Out: the file as it is written; what is wrong is told, and reading goes on behind it.

mod declaration;
mod expression;
mod statement;

use crate::diagnostic::{Diagnostics, Kind, Reported, Span};
use crate::syntax::{File, Name};
use crate::token::{Placed, Token};

/// Words that are no names.
#[rustfmt::skip]
const KEYWORDS: [&str; 62] = [
    "AND", "AND_THEN", "ARRAY", "AT", "BY", "CASE", "CONFIGURATION", "CONSTANT", "CONTINUE", "DO", "ELSE", "ELSIF",
    "END_CASE", "END_CONFIGURATION", "END_FOR", "END_FUNCTION", "END_FUNCTION_BLOCK", "END_IF", "END_PROGRAM",
    "END_REPEAT", "END_RESOURCE", "END_STRUCT", "END_TYPE", "END_VAR", "END_WHILE", "EXIT", "FALSE", "FOR", "FUNCTION",
    "FUNCTION_BLOCK", "IF", "MOD", "NON_RETAIN", "NOT", "OF", "OR", "OR_ELSE", "PERSISTENT", "PROGRAM", "REPEAT",
    "RETAIN", "RETURN", "STRUCT", "THEN", "TO", "TRUE", "TYPE", "UNTIL", "VAR", "VAR_ACCESS",
    "VAR_CONFIG", "VAR_EXTERNAL", "VAR_GLOBAL", "VAR_INPUT", "VAR_IN_OUT", "VAR_OUTPUT", "VAR_TEMP", "WHILE",
    "XOR", "CLASS", "INTERFACE", "METHOD",
];

/// What is not supported, in words.
pub(crate) const POINTERS: &str = "pointers and references";
pub(crate) const STEPS: &str = "SFC, sequential function charts";
pub(crate) const OBJECTS: &str = "object orientation";

/// Statements, types and values are nested so deep at most.
pub(crate) const NESTING_MAX: usize = 32;
/// Operators of an expression are nested so deep at most.
pub(crate) const EXPRESSION_MAX: u32 = 250;

/// Reads a file.
pub(crate) fn file(tokens: Vec<Placed>, told: &mut Diagnostics<'_>) -> File {
    let mut parser = Parser {
        tokens,
        at: 0,
        nesting: 0,
        told,
    };
    parser.file()
}

struct Parser<'p, 't> {
    /// The last one is `End`.
    tokens: Vec<Placed>,
    at: usize,
    nesting: usize,
    told: &'p mut Diagnostics<'t>,
}

type Read<T> = Result<T, Reported>;

impl Parser<'_, '_> {
    fn ahead(&self, count: usize) -> &Placed {
        let last = self.tokens.len() - 1;
        &self.tokens[(self.at + count).min(last)]
    }

    fn token(&self) -> &Token {
        &self.ahead(0).token
    }

    fn span(&self) -> Span {
        self.ahead(0).at
    }

    /// Place of the token that was read last.
    fn last(&self) -> Span {
        self.tokens[self.at.saturating_sub(1)].at
    }

    fn advance(&mut self) {
        self.at = (self.at + 1).min(self.tokens.len() - 1);
    }

    fn is_word_ahead(&self, count: usize, word: &str) -> bool {
        matches!(&self.ahead(count).token, Token::Word(text) if text.eq_ignore_ascii_case(word))
    }

    fn is_word(&self, word: &str) -> bool {
        self.is_word_ahead(0, word)
    }

    fn is_any_word(&self, words: &[&str]) -> bool {
        words.iter().any(|word| self.is_word(word))
    }

    fn is_sign(&self, sign: &str) -> bool {
        matches!(self.token(), Token::Sign(token) if *token == sign)
    }

    fn take_word(&mut self, word: &str) -> bool {
        let is = self.is_word(word);
        if is {
            self.advance();
        }
        is
    }

    fn take_sign(&mut self, sign: &str) -> bool {
        let is = self.is_sign(sign);
        if is {
            self.advance();
        }
        is
    }

    fn expected(&mut self, wanted: &str) -> Reported {
        let got = match self.token() {
            Token::Word(word) | Token::Address(word) => word.clone(),
            Token::Prefix(word) => format!("{word}#"),
            Token::Integer(value) => value.to_string(),
            Token::Real(value) => value.to_string(),
            Token::Time(_) => "a duration".into(),
            Token::Text(_) => "a text".into(),
            Token::Unsupported(_, word) => word.clone(),
            Token::Bound(_) => "max_iterations".into(),
            Token::Sign(sign) => (*sign).into(),
            Token::End => "the end of the file".into(),
        };
        let at = self.span();
        let wanted = wanted.to_owned();
        self.told.error(at, Kind::Expected { wanted, got })
    }

    fn word(&mut self, word: &str) -> Read<()> {
        if self.take_word(word) {
            Ok(())
        } else {
            Err(self.expected(word))
        }
    }

    fn sign(&mut self, sign: &str) -> Read<()> {
        if self.take_sign(sign) {
            Ok(())
        } else {
            Err(self.expected(sign))
        }
    }

    /// `;` behind what has just been read; missing ones are told there, and reading goes on.
    fn semicolon(&mut self, behind: &'static str) {
        if !self.take_sign(";") {
            let at = self.last();
            self.told.error(at, Kind::SemicolonMissing(behind));
        }
    }

    fn is_keyword(&self) -> bool {
        self.is_any_word(&KEYWORDS)
    }

    fn name(&mut self) -> Read<Name> {
        match self.token() {
            Token::Word(_) if self.is_keyword() => {
                let at = self.span();
                let Token::Word(name) = self.token().clone() else {
                    return Err(Reported);
                };
                Err(self.told.error(at, Kind::Keyword { name }))
            }
            Token::Word(text) => {
                let name = Name {
                    text: text.clone(),
                    at: self.span(),
                };
                self.advance();
                Ok(name)
            }
            _ => Err(self.expected("a name")),
        }
    }

    /// One level deeper, and back.
    fn nested<T>(&mut self, read: impl FnOnce(&mut Self) -> Read<T>) -> Read<T> {
        if self.nesting >= NESTING_MAX {
            let at = self.span();
            return Err(self.told.error(at, Kind::TooDeep { most: NESTING_MAX }));
        }
        self.nesting += 1;
        let read = read(self);
        self.nesting -= 1;
        read
    }

    /// Passes all up to one of these words, or the end.
    fn skip_to(&mut self, words: &[&str]) {
        while *self.token() != Token::End && !self.is_any_word(words) {
            self.advance();
        }
    }
}
