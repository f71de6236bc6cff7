//! Statements.

use super::{KEYWORDS, Parser, Read};
use crate::diagnostic::{Kind, Reported};
use crate::syntax::{Label, Statement, StatementKind};
use crate::token::Token;

/// Words that begin a statement.
const BEGINNINGS: [&str; 8] = ["IF", "CASE", "FOR", "WHILE", "REPEAT", "EXIT", "CONTINUE", "RETURN"];

impl Parser<'_, '_> {
    /// Statements up to one of these words, or what ends a unit.
    pub(super) fn statements(&mut self, ends: &[&str]) -> Vec<Statement> {
        let mut statements = Vec::new();
        let read = self.nested(|parser| {
            while !parser.at_end_of_list(ends) {
                let before = parser.at;
                match parser.statement() {
                    Ok(statement) => statements.extend(statement),
                    Err(Reported) => parser.recover(before),
                }
            }
            Ok(())
        });
        if read.is_err() {
            self.skip_to(&["END_PROGRAM", "END_FUNCTION", "END_FUNCTION_BLOCK"]);
        }
        statements
    }

    fn at_end_of_list(&self, ends: &[&str]) -> bool {
        if *self.token() == Token::End || self.is_any_word(ends) {
            return true;
        }
        // What closes something else ends the list, too: its own end is missing.
        let closes = self.is_keyword() && !self.is_any_word(&BEGINNINGS);
        closes || (ends.contains(&"END_CASE") && self.at_label())
    }

    /// Behind the statement that is wrong: its `;`, or what can only be the next one.
    fn recover(&mut self, before: usize) {
        if self.at == before {
            self.advance();
        }
        loop {
            if self.take_sign(";") || *self.token() == Token::End || self.is_any_word(&BEGINNINGS) {
                return;
            }
            let ends = |word: &str| word.starts_with("END_") || matches!(word, "ELSE" | "ELSIF" | "UNTIL");
            if KEYWORDS.iter().any(|word| ends(word) && self.is_word(word)) {
                return;
            }
            self.advance();
        }
    }

    fn statement(&mut self) -> Read<Option<Statement>> {
        let start = self.span();
        if self.take_sign(";") {
            return Ok(None);
        }
        let bound = match *self.token() {
            Token::Bound(bound) => {
                self.advance();
                if !self.is_any_word(&["FOR", "WHILE", "REPEAT"]) {
                    return Err(self.expected("a loop"));
                }
                Some(bound)
            }
            _ => None,
        };
        let kind = match self.token() {
            Token::Word(_) if self.is_word("IF") => self.choice()?,
            Token::Word(_) if self.is_word("CASE") => self.case()?,
            Token::Word(_) if self.is_word("FOR") => self.count(bound)?,
            Token::Word(_) if self.is_word("WHILE") => self.repeat_while(bound)?,
            Token::Word(_) if self.is_word("REPEAT") => self.repeat_until(bound)?,
            Token::Word(_) if self.is_word("EXIT") => self.leave("EXIT", StatementKind::Exit),
            Token::Word(_) if self.is_word("CONTINUE") => self.leave("CONTINUE", StatementKind::Continue),
            Token::Word(_) if self.is_word("RETURN") => self.leave("RETURN", StatementKind::Return),
            Token::Word(_) => self.assignment_or_call()?,
            _ => return Err(self.expected("a statement")),
        };
        let at = start.to(self.last());
        Ok(Some(Statement { kind, at }))
    }

    fn leave(&mut self, word: &'static str, kind: StatementKind) -> StatementKind {
        self.advance();
        self.semicolon(word);
        kind
    }

    fn assignment_or_call(&mut self) -> Read<StatementKind> {
        let access = self.access()?;
        if self.is_sign("(") {
            let arguments = self.arguments()?;
            self.semicolon("the call");
            return Ok(StatementKind::Call(access, arguments));
        }
        if self.is_sign("=") {
            let at = self.span();
            self.told.error(at, Kind::EqualAssigns);
            self.advance();
        } else {
            self.sign(":=")?;
        }
        let value = self.expression()?;
        self.semicolon("the statement");
        Ok(StatementKind::Assign(access, value))
    }

    fn choice(&mut self) -> Read<StatementKind> {
        self.advance();
        let mut branches = Vec::new();
        let mut otherwise = None;
        let ends = ["ELSIF", "ELSE", "END_IF"];
        loop {
            let condition = self.expression()?;
            self.word("THEN")?;
            branches.push((condition, self.statements(&ends)));
            if self.take_word("ELSIF") {
                continue;
            }
            let at = self.span();
            if self.take_word("ELSE") {
                otherwise = Some((at, self.statements(&["END_IF"])));
            }
            self.word("END_IF")?;
            self.semicolon("END_IF");
            return Ok(StatementKind::If(branches, otherwise));
        }
    }

    fn case(&mut self) -> Read<StatementKind> {
        self.advance();
        let selector = self.expression()?;
        self.word("OF")?;
        let mut branches = Vec::new();
        let mut otherwise = None;
        while !self.is_any_word(&["ELSE", "END_CASE"]) {
            let mut labels = vec![self.label()?];
            while self.take_sign(",") {
                labels.push(self.label()?);
            }
            self.sign(":")?;
            branches.push((labels, self.statements(&["ELSE", "END_CASE"])));
        }
        let at = self.span();
        if self.take_word("ELSE") {
            otherwise = Some((at, self.statements(&["END_CASE", "\0"])));
        }
        self.word("END_CASE")?;
        self.semicolon("END_CASE");
        Ok(StatementKind::Case {
            selector,
            branches,
            otherwise,
        })
    }

    fn label(&mut self) -> Read<Label> {
        let first = self.expression()?;
        let last = if self.take_sign("..") {
            Some(self.expression()?)
        } else {
            None
        };
        Ok(Label { first, last })
    }

    /// Whether what follows is a label of CASE: no statement begins so.
    fn at_label(&self) -> bool {
        match self.token() {
            Token::Integer(_) | Token::Prefix(_) | Token::Sign("-" | "+" | "(") => true,
            Token::Word(_) => matches!(self.ahead(1).token, Token::Sign(":" | "," | "..")),
            _ => false,
        }
    }

    fn count(&mut self, bound: Option<u32>) -> Read<StatementKind> {
        self.advance();
        let control = self.name()?;
        if !self.is_sign(":=") {
            let at = self.span();
            return Err(match self.token() {
                Token::Sign("=") => self.told.error(at, Kind::EqualAssigns),
                Token::Sign("." | "[") => self.told.error(control.at, Kind::ControlVariable),
                _ => self.expected(":="),
            });
        }
        self.advance();
        let from = self.expression()?;
        self.word("TO")?;
        let to = self.expression()?;
        let by = if self.take_word("BY") {
            Some(self.expression()?)
        } else {
            None
        };
        self.word("DO")?;
        let body = self.statements(&["END_FOR"]);
        self.word("END_FOR")?;
        self.semicolon("END_FOR");
        Ok(StatementKind::For {
            control,
            from,
            to,
            by,
            bound,
            body,
        })
    }

    fn repeat_while(&mut self, bound: Option<u32>) -> Read<StatementKind> {
        self.advance();
        let condition = self.expression()?;
        self.word("DO")?;
        let body = self.statements(&["END_WHILE"]);
        self.word("END_WHILE")?;
        self.semicolon("END_WHILE");
        Ok(StatementKind::While { condition, bound, body })
    }

    fn repeat_until(&mut self, bound: Option<u32>) -> Read<StatementKind> {
        self.advance();
        let body = self.statements(&["UNTIL", "END_REPEAT"]);
        self.word("UNTIL")?;
        let until = self.expression()?;
        self.take_sign(";");
        self.word("END_REPEAT")?;
        self.semicolon("END_REPEAT");
        Ok(StatementKind::Repeat { until, bound, body })
    }
}
