//! Statements.

use super::{KEYWORDS, Parser, Read};
use crate::diagnostic::{Kind, Reported};
use crate::syntax::{Expression, ExpressionKind, Label, Name, Statement, StatementKind};
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
        if ends.contains(&"ELSIF") && self.at_elsif() {
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

    /// What stands in the head of a statement, up to this word. A slip in it is told, and reading goes on behind the word.
    fn head(&mut self, end: &str) -> Expression {
        let start = self.span();
        let mut depth = 1;
        let read = self.expression();
        if let Ok(expression) = read {
            // Where a statement follows, the word is missing.
            if self.word(end).is_ok() || self.begins_statement() {
                return expression;
            }
            depth = expression.depth;
        }
        self.pass_to(end);
        self.take_word(end);
        let (kind, at) = (ExpressionKind::Wrong, start.to(self.last()));
        Expression { kind, at, depth }
    }

    /// Passes what is wrong in a head, up to its end or what is behind it.
    fn pass_to(&mut self, end: &str) {
        while !self.is_word(end) && !self.is_sign(";") && !self.closes() && !self.is_any_word(&BEGINNINGS) {
            self.advance();
        }
    }

    /// Whether a list of statements ends here, or the file.
    fn closes(&self) -> bool {
        let closes = |word: &&str| word.starts_with("END_") || matches!(*word, "ELSE" | "ELSIF" | "UNTIL");
        *self.token() == Token::End
            || KEYWORDS
                .iter()
                .filter(|word| closes(word))
                .any(|word| self.is_word(word))
    }

    fn begins_statement(&self) -> bool {
        let behind = &self.ahead(1).token;
        self.is_any_word(&BEGINNINGS)
            || (matches!(self.token(), Token::Word(_)) && matches!(behind, Token::Sign(":=" | "(" | "." | "[")))
    }

    /// ELSIF, and what it is taken for.
    fn at_elsif(&self) -> bool {
        self.is_word("ELSIF")
            || (self.is_any_word(&["ELSEIF", "ELSE_IF", "ELIF"])
                && !matches!(self.ahead(1).token, Token::Sign(":=" | "." | "[")))
    }

    fn choice(&mut self) -> Read<StatementKind> {
        self.advance();
        let mut branches = Vec::new();
        let mut otherwise = None;
        let ends = ["ELSIF", "ELSE", "END_IF"];
        loop {
            let condition = self.head("THEN");
            branches.push((condition, self.statements(&ends)));
            if self.at_elsif() {
                let at = self.span();
                if let Token::Word(word) = self.token().clone()
                    && !word.eq_ignore_ascii_case("ELSIF")
                {
                    self.told.error(at, Kind::ElseIfWord(word));
                }
                self.advance();
                continue;
            }
            let at = self.span();
            let mut else_if = None;
            if self.take_word("ELSE") {
                else_if = self.is_word("IF").then(|| at.to(self.span()));
                otherwise = Some((at, self.statements(&["END_IF"])));
            }
            match else_if {
                Some(at) if !self.is_word("END_IF") => {
                    self.told.error(at, Kind::ElseIf);
                }
                _ => {
                    self.word("END_IF")?;
                    self.semicolon("END_IF");
                }
            }
            return Ok(StatementKind::If(branches, otherwise));
        }
    }

    fn case(&mut self) -> Read<StatementKind> {
        self.advance();
        let selector = self.head("OF");
        let mut branches = Vec::new();
        let mut otherwise = None;
        while !self.closes() {
            let before = self.at;
            let labels = match self.labels() {
                Ok(labels) => labels,
                // Behind its colon the statements may be good.
                Err(Reported) => {
                    while !self.take_sign(":")
                        && !self.take_sign(";")
                        && !self.closes()
                        && !self.is_any_word(&BEGINNINGS)
                    {
                        self.advance();
                    }
                    if self.at == before {
                        return Err(Reported);
                    }
                    Vec::new()
                }
            };
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

    /// `1, 3..5:`
    fn labels(&mut self) -> Read<Vec<Label>> {
        let mut labels = vec![self.label()?];
        while self.take_sign(",") {
            labels.push(self.label()?);
        }
        self.sign(":")?;
        Ok(labels)
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
            Token::Word(_) => {
                // `Phase.idle:`, which is told where it is looked up.
                let is_member =
                    self.ahead(1).token == Token::Sign(".") && matches!(self.ahead(2).token, Token::Word(_));
                let behind = if is_member { 3 } else { 1 };
                matches!(self.ahead(behind).token, Token::Sign(":" | "," | ".."))
            }
            _ => false,
        }
    }

    fn count(&mut self, bound: Option<u32>) -> Read<StatementKind> {
        self.advance();
        let start = self.span();
        let head = self.count_head();
        if head.is_err() {
            self.pass_to("DO");
            self.take_word("DO");
        }
        let body = self.statements(&["END_FOR"]);
        self.word("END_FOR")?;
        self.semicolon("END_FOR");
        let Ok((control, from, to, by)) = head else {
            // Its statements may be wrong, too.
            let (kind, at, depth) = (ExpressionKind::Wrong, start, 1);
            let condition = Expression { kind, at, depth };
            return Ok(StatementKind::While { condition, bound, body });
        };
        Ok(StatementKind::For {
            control,
            from,
            to,
            by,
            bound,
            body,
        })
    }

    /// `i := 1 TO 9 BY 2 DO`
    fn count_head(&mut self) -> Read<(Name, Expression, Expression, Option<Expression>)> {
        let control = self.name()?;
        if !self.take_sign(":=") {
            let at = self.span();
            match self.token() {
                // What it is meant for is clear.
                Token::Sign("=") => {
                    self.told.error(at, Kind::EqualAssigns);
                    self.advance();
                }
                Token::Sign("." | "[") => return Err(self.told.error(control.at, Kind::ControlVariable)),
                _ => return Err(self.expected(":=")),
            }
        }
        let from = self.expression()?;
        self.word("TO")?;
        let to = self.expression()?;
        let by = if self.take_word("BY") {
            Some(self.expression()?)
        } else {
            None
        };
        if self.word("DO").is_err() && !self.begins_statement() {
            return Err(Reported);
        }
        Ok((control, from, to, by))
    }

    fn repeat_while(&mut self, bound: Option<u32>) -> Read<StatementKind> {
        self.advance();
        let condition = self.head("DO");
        let body = self.statements(&["END_WHILE"]);
        self.word("END_WHILE")?;
        self.semicolon("END_WHILE");
        Ok(StatementKind::While { condition, bound, body })
    }

    fn repeat_until(&mut self, bound: Option<u32>) -> Read<StatementKind> {
        self.advance();
        let body = self.statements(&["UNTIL", "END_REPEAT"]);
        self.word("UNTIL")?;
        let until = match self.expression() {
            Ok(until) => until,
            Err(Reported) => {
                let (kind, at, depth) = (ExpressionKind::Wrong, self.span(), 1);
                self.pass_to("END_REPEAT");
                Expression { kind, at, depth }
            }
        };
        self.take_sign(";");
        self.word("END_REPEAT")?;
        self.semicolon("END_REPEAT");
        Ok(StatementKind::Repeat { until, bound, body })
    }
}
