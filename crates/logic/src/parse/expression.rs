//! Expressions and calls.

use super::{EXPRESSION_MAX, OBJECTS, POINTERS, Parser, Read};
use crate::diagnostic::{Kind, Span};
use crate::syntax::{Access, Argument, ArgumentValue, Binary, Expression, ExpressionKind, Name, Step, Unary};
use crate::token::Token;

impl Parser<'_, '_> {
    pub(super) fn expression(&mut self) -> Read<Expression> {
        self.nested(|parser| parser.operators(0))
    }

    /// Operators that bind at least so strongly.
    fn operators(&mut self, least: u8) -> Read<Expression> {
        let begins_with_minus = self.is_sign("-");
        let mut left = self.operand()?;
        while let Some((operator, strength)) = self.operator().filter(|(_, strength)| *strength >= least) {
            if operator == Binary::Power && begins_with_minus && matches!(left.kind, ExpressionKind::Unary(..)) {
                self.told.warning(left.at, Kind::MinusPower);
            }
            self.advance();
            let right = self.operators(strength + 1)?;
            let (at, depth) = (left.at.to(right.at), left.depth.max(right.depth));
            left = self.node(
                ExpressionKind::Binary(operator, Box::new(left), Box::new(right)),
                at,
                depth,
            )?;
        }
        Ok(left)
    }

    fn operator(&self) -> Option<(Binary, u8)> {
        let word = match self.token() {
            Token::Sign(sign) => sign,
            Token::Word(word) => word.as_str(),
            _ => return None,
        };
        let found = Binary::ALL
            .iter()
            .find(|(_, known, _)| known.eq_ignore_ascii_case(word));
        found.map(|(operator, _, strength)| (*operator, *strength))
    }

    /// An expression around others that are `depth` deep.
    fn node(&mut self, kind: ExpressionKind, at: Span, depth: u32) -> Read<Expression> {
        if depth >= EXPRESSION_MAX {
            let most = EXPRESSION_MAX as usize;
            return Err(self.told.error(at, Kind::TooDeep { most }));
        }
        let depth = depth + 1;
        Ok(Expression { kind, at, depth })
    }

    fn operand(&mut self) -> Read<Expression> {
        let at = self.span();
        let unary = match self.token() {
            Token::Sign("-") => Some(Unary::Minus),
            Token::Sign("+") => Some(Unary::Plus),
            Token::Word(_) if self.is_word("NOT") => Some(Unary::Not),
            _ => None,
        };
        if let Some(unary) = unary {
            self.advance();
            let operand = self.nested(Self::operand)?;
            let (at, depth) = (at.to(operand.at), operand.depth);
            return self.node(ExpressionKind::Unary(unary, Box::new(operand)), at, depth);
        }
        if self.take_sign("(") {
            let mut inner = self.expression()?;
            self.sign(")")?;
            inner.at = at.to(self.last());
            // One level more, so that `(-a) ** b` is told from `-a ** b`.
            if let ExpressionKind::Unary(..) = inner.kind {
                let (at, depth) = (inner.at, inner.depth);
                return self.node(ExpressionKind::Unary(Unary::Plus, Box::new(inner)), at, depth);
            }
            return Ok(inner);
        }
        let literal = match self.token().clone() {
            Token::Integer(value) => ExpressionKind::Integer(value),
            Token::Real(value) => ExpressionKind::Real(value),
            Token::Time(value) => ExpressionKind::Time(value),
            Token::Text(text) => ExpressionKind::Text(text),
            Token::Word(_) if self.is_word("TRUE") => ExpressionKind::Bool(true),
            Token::Word(_) if self.is_word("FALSE") => ExpressionKind::Bool(false),
            Token::Prefix(text) => return self.typed(Name { text, at }),
            Token::Word(_) if self.ahead(1).token == Token::Sign("(") => return self.function_call(),
            Token::Word(_) => {
                let access = self.access()?;
                let at = access.at;
                // The result of a method.
                if let Some(Step::Member(member)) = access.steps.last()
                    && self.is_sign("(")
                {
                    return Err(self.told.unsupported(member.at, OBJECTS, &member.text));
                }
                let deepest = access.steps.iter().map(step_depth).max().unwrap_or(0);
                return self.node(ExpressionKind::Variable(access), at, deepest);
            }
            Token::Unsupported(what, word) => {
                self.advance();
                return Err(self.told.unsupported(at, what, &word));
            }
            Token::Address(address) => {
                let cure = format!("{address} in an expression; a variable may be declared AT it");
                return Err(self.told.error(at, Kind::Unsupported(cure)));
            }
            _ => return Err(self.expected("a value")),
        };
        self.advance();
        self.node(literal, at, 0)
    }

    /// Behind `INT#`.
    fn typed(&mut self, prefix: Name) -> Read<Expression> {
        self.advance();
        let value = self.nested(Self::operand)?;
        let (at, depth) = (prefix.at.to(value.at), value.depth);
        self.node(ExpressionKind::Typed(prefix, Box::new(value)), at, depth)
    }

    fn function_call(&mut self) -> Read<Expression> {
        // AND, OR, XOR, NOT, MOD are functions, too.
        let at = self.span();
        let name = match self.token().clone() {
            Token::Word(text) if self.is_any_word(&["AND", "OR", "XOR", "MOD"]) => {
                self.advance();
                Name { text, at }
            }
            _ => self.name()?,
        };
        let arguments = self.arguments()?;
        let depth = arguments.iter().map(argument_depth).max().unwrap_or(0);
        let at = name.at.to(self.last());
        self.node(ExpressionKind::Call(name, arguments), at, depth)
    }

    /// `(a, IN := b, Q => c)`
    pub(super) fn arguments(&mut self) -> Read<Vec<Argument>> {
        self.sign("(")?;
        let mut arguments = Vec::new();
        if self.take_sign(")") {
            return Ok(arguments);
        }
        loop {
            let inverted = self.is_word("NOT") && self.ahead(2).token == Token::Sign("=>");
            if inverted {
                self.advance();
            }
            let is_name = matches!(self.token(), Token::Word(_));
            let behind = &self.ahead(1).token;
            let (given, taken) = (*behind == Token::Sign(":="), *behind == Token::Sign("=>"));
            let name = if is_name && (given || taken) {
                let name = self.name()?;
                self.advance();
                Some(name)
            } else {
                None
            };
            let value = if is_name && taken {
                ArgumentValue::Taken(self.access()?)
            } else {
                ArgumentValue::Given(self.expression()?)
            };
            arguments.push(Argument { name, inverted, value });
            if !self.take_sign(",") {
                self.sign(")")?;
                return Ok(arguments);
            }
        }
    }

    /// `word.3`, which others have.
    fn bit(&self, name: &Name, steps: &[Step], bit: i128) -> Kind {
        let mut name = name.text.clone();
        for step in steps {
            match step {
                Step::Member(member) => name += &format!(".{}", member.text),
                Step::Index(..) => name += "[..]",
            }
        }
        match u32::try_from(bit).ok().and_then(|bit| 1_u64.checked_shl(bit)) {
            Some(mask) if self.ahead(2).token == Token::Sign(":=") => {
                let mask = format!("16#{mask:X}");
                Kind::BitWritten { name, mask }
            }
            _ => Kind::BitRead { name, bit },
        }
    }

    /// `a`, `a[1, 2].b`
    pub(super) fn access(&mut self) -> Read<Access> {
        let name = self.name()?;
        let mut steps = Vec::new();
        loop {
            if steps.len() > super::NESTING_MAX {
                let most = super::NESTING_MAX;
                return Err(self.told.error(name.at, Kind::TooDeep { most }));
            }
            let start = self.span();
            if self.is_sign("^") {
                let of_object = ["THIS", "SUPER"]
                    .iter()
                    .any(|word| name.text.eq_ignore_ascii_case(word));
                return Err(match of_object {
                    true => self.told.unsupported(name.at, OBJECTS, &name.text),
                    false => self.told.unsupported(start, POINTERS, "^"),
                });
            }
            if self.is_sign(".")
                && let Token::Integer(bit) = self.ahead(1).token
            {
                let at = name.at.to(self.ahead(1).at);
                let kind = self.bit(&name, &steps, bit);
                return Err(self.told.error(at, kind));
            }
            if self.take_sign(".") {
                steps.push(Step::Member(self.name()?));
            } else if self.take_sign("[") {
                let mut indices = vec![self.expression()?];
                while self.take_sign(",") {
                    indices.push(self.expression()?);
                }
                self.sign("]")?;
                steps.push(Step::Index(indices, start.to(self.last())));
            } else {
                let at = name.at.to(self.last());
                return Ok(Access { name, steps, at });
            }
        }
    }
}

fn step_depth(step: &Step) -> u32 {
    match step {
        Step::Member(_) => 0,
        Step::Index(indices, _) => indices.iter().map(|index| index.depth).max().unwrap_or(0),
    }
}

fn argument_depth(argument: &Argument) -> u32 {
    match &argument.value {
        ArgumentValue::Given(value) => value.depth,
        ArgumentValue::Taken(access) => access.steps.iter().map(step_depth).max().unwrap_or(0),
    }
}
