//! Values: numbers, parameters, functions and expressions, computed while they are read.
//!
//! In:  a [`Cursor`] in front of a value, and the [`Values`] of parameters.
//! Out: one finite number, or what is wrong and where.
//!
//! `value = ("+" | "-")* ( number | "[" expression "]" | "#" parameter | function "[" expression "]" )`, where
//! `expression = value (operator value)*`. Operators bind by level ([`Operator::level`]), each level from left to right.
//! Signs belong to the value behind them, so `-2**2` is 4.
//!
//! A value that is not known before the program runs is NaN, as [`Values`] may answer. What depends on one is unknown
//! too and breaks no rule, so that a program can be checked without running it. Nothing else is ever NaN or infinite.

use crate::degrees;
use crate::error::{ErrorKind, ExpressionError};
use crate::near_miss::nearest;
use crate::number::{self, NumberFault};
use crate::octet::is_blank;
use crate::operator::{Function, Operator};
use crate::scan::{Cursor, Fault, Span, number_with_exponent};
use std::borrow::Cow;

/// Highest number of a parameter.
pub(crate) const PARAMETER_MAX: u32 = crate::parameter::PARAMETER_MAX as u32;

/// What the parameters hold.
pub(crate) trait Values {
    /// The parameter with a number from 1 to [`PARAMETER_MAX`]; `None`: it may not be read now.
    fn numbered(&self, index: u32) -> Option<f64>;

    /// The parameter of a name in lower case without blanks, global if it begins with `_`; `None`: not defined.
    fn named(&self, name: &str) -> Option<f64>;

    /// The name of a parameter that was probably meant by one that is not defined.
    fn nearest(&self, name: &str) -> Option<String>;

    /// Which remapped code a word is.
    #[inline]
    fn remapped(&self, _letter: u8, _number: f64) -> Option<usize> {
        None
    }
}

/// Left side of an assignment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Assigned<'l> {
    /// `#5`, from 1 to [`PARAMETER_MAX`].
    Numbered(u32),
    /// `#<name>`, in lower case without blanks.
    Named(Cow<'l, str>),
    /// The number is not known before the program runs.
    Unknown,
}

/// A part of an expression.
struct Part {
    value: f64,
    /// The operator behind it; `None`: the bracket that ends the expression.
    next: Option<Operator>,
    /// Octet behind its last one.
    end: usize,
}

impl<'l> Cursor<'l> {
    /// Takes a value. After a fault, reading goes on behind what looks like a value.
    #[inline]
    pub(crate) fn value(&mut self, values: &impl Values) -> Result<f64, Fault> {
        // Nearly all values are plain numbers.
        let start = self.at;
        let negative = self.consume(b'-');
        if let Some(b'0'..=b'9' | b'.') = self.peek()
            && let Ok(number) = number::read(self.line, &mut self.at)
        {
            return Ok(if negative { -number } else { number });
        }
        self.at = start;
        self.any_value(values)
    }

    fn any_value(&mut self, values: &impl Values) -> Result<f64, Fault> {
        let start = self.at;
        let value = self.operand(values);
        if value.is_err() {
            self.at = start;
            self.skip_value();
        }
        value
    }

    /// Takes the left side of an assignment and its `=`, behind the `#`. After a fault, reading goes on behind the
    /// assignment.
    pub(crate) fn parameter_target(&mut self, values: &impl Values) -> Result<Assigned<'l>, Fault> {
        let start = self.at;
        let target = self.target(values);
        if target.is_err() {
            self.at = start;
            self.skip_value();
        }
        target
    }

    fn target(&mut self, values: &impl Values) -> Result<Assigned<'l>, Fault> {
        let start = self.at - 1;
        let target = if self.peek() == Some(b'<') {
            Assigned::Named(self.name()?)
        } else {
            match self.index(values)? {
                Some(index) => Assigned::Numbered(self.in_range(index, start)?),
                None => Assigned::Unknown,
            }
        };
        if !self.consume(b'=') {
            return Err((self.span_from(start), ExpressionError::AssignmentMissing.into()));
        }
        Ok(target)
    }

    /// Takes `<name>`: the name in lower case, without blanks.
    pub(crate) fn name(&mut self) -> Result<Cow<'l, str>, Fault> {
        let opened = self.consume(b'<');
        debug_assert!(opened);
        let start = self.at;
        let rest = &self.line[start..];
        let Some(length) = rest.iter().position(|octet| *octet == b'>') else {
            self.at = self.line.len();
            return Err((self.span_from(start - 1), ExpressionError::NameNotClosed.into()));
        };
        self.at += length + 1;
        let name = std::str::from_utf8(&rest[..length]).map_err(|error| {
            let mut cursor = self.clone();
            cursor.at = start + error.valid_up_to() + 1;
            cursor.bad_character()
        })?;
        Ok(
            if name.bytes().any(|octet| is_blank(octet) || octet.is_ascii_uppercase()) {
                let is_kept = |letter: &char| !u8::try_from(*letter).is_ok_and(is_blank);
                let kept = name.chars().filter(is_kept);
                Cow::Owned(kept.map(|letter| letter.to_ascii_lowercase()).collect())
            } else {
                Cow::Borrowed(name)
            },
        )
    }

    /// Takes digits and a point as after `N`, which takes nothing else.
    pub(crate) fn unsigned(&mut self) -> Result<f64, Fault> {
        let start = self.at;
        let number = number::read(self.line, &mut self.at);
        number.map_err(|fault| {
            let fault = self.number_fault(fault, start);
            self.at = start;
            self.skip_value();
            fault
        })
    }

    /// Signs and a value without sign.
    fn operand(&mut self, values: &impl Values) -> Result<f64, Fault> {
        let mut negative = false;
        loop {
            if self.consume(b'-') {
                negative = !negative;
            } else if !self.consume(b'+') {
                break;
            }
        }
        let start = self.at;
        let value = match self.peek() {
            Some(b'0'..=b'9' | b'.') => {
                number::read(self.line, &mut self.at).map_err(|fault| self.number_fault(fault, start))?
            }
            Some(b'[') => self.brackets(values)?,
            Some(b'#') => {
                self.at += 1;
                self.parameter(values)?
            }
            Some(b'A'..=b'Z') => self.function(values)?,
            Some(_) | None => return Err(self.value_missing()),
        };
        Ok(if negative { -value } else { value })
    }

    /// `[ expression ]`
    #[inline]
    fn brackets(&mut self, values: &impl Values) -> Result<f64, Fault> {
        let open = self.at;
        self.at += 1;
        let read = self.expression(values, open, 1)?;
        debug_assert_eq!(read.next, None);
        Ok(read.value)
    }

    /// Values joined by operators of `level` and above, and the operator behind them. The `[` stands at `open`.
    fn expression(&mut self, values: &impl Values, open: usize, level: u8) -> Result<Part, Fault> {
        let start = self.at;
        let mut value = self.operand(values)?;
        let mut end = self.at;
        let mut next = self.operator(open)?;
        while let Some(operator) = next
            && operator.level() >= level
        {
            let right_start = self.at;
            let right = self.expression(values, open, operator.level() + 1)?;
            value = operator.apply(value, right.value).map_err(|kind| {
                let divisor = matches!(
                    kind,
                    ErrorKind::Expression(ExpressionError::DivideByZero { operator: "/" | "MOD" })
                );
                (self.span_of(if divisor { right_start } else { start }, right.end), kind)
            })?;
            (next, end) = (right.next, right.end);
        }
        Ok(Part { value, next, end })
    }

    /// Takes an operator; `None`: took `]`.
    fn operator(&mut self, open: usize) -> Result<Option<Operator>, Fault> {
        let start = self.at;
        let operator = match self.peek() {
            Some(b']') => {
                self.at += 1;
                return Ok(None);
            }
            Some(b'+') => Operator::Plus,
            Some(b'-') => Operator::Minus,
            Some(b'/') => Operator::Divide,
            Some(b'*') => {
                self.at += 1;
                if self.peek() != Some(b'*') {
                    return Ok(Some(Operator::Times));
                }
                Operator::Power
            }
            Some(b'A'..=b'Z') => {
                let found = Operator::WORDS
                    .into_iter()
                    .find(|operator| self.consume_word(operator.name().as_bytes()));
                return match found {
                    Some(operator) => Ok(Some(operator)),
                    None => Err(self.unknown_operator()),
                };
            }
            None | Some(b'(' | b';') => {
                self.at = start;
                return Err((
                    self.span_of(open, self.line.len()),
                    ExpressionError::BracketNotClosed.into(),
                ));
            }
            Some(_) => return Err(self.unknown_operator()),
        };
        self.at += 1;
        Ok(Some(operator))
    }

    /// What stands behind a `#`.
    fn parameter(&mut self, values: &impl Values) -> Result<f64, Fault> {
        let start = self.at - 1;
        if self.peek() == Some(b'<') {
            let name = self.name()?;
            return values.named(&name).ok_or_else(|| {
                let nearest = values.nearest(&name);
                self.span_from(start).fault(ExpressionError::ParameterUndefined {
                    name: name.into_owned(),
                    nearest,
                })
            });
        }
        let Some(index) = self.index(values)? else {
            return Ok(f64::NAN);
        };
        let index = self.in_range(index, start)?;
        values
            .numbered(index)
            .ok_or_else(|| (self.span_from(start), ExpressionError::ParameterHidden { index }.into()))
    }

    /// The number of a parameter, an integer of any size; `None`: it depends on an unknown value.
    fn index(&mut self, values: &impl Values) -> Result<Option<f64>, Fault> {
        let start = self.at;
        let value = self.operand(values)?;
        let rounded = value.round();
        if (value - rounded).abs() > 1e-4 {
            return Err(self
                .span_of(start, self.at)
                .fault(ExpressionError::ParameterIndexNotInteger { value }));
        }
        Ok((!value.is_nan()).then_some(rounded))
    }

    /// The number of a parameter whose `#` stands at `start`.
    fn in_range(&self, index: f64, start: usize) -> Result<u32, Fault> {
        if (1.0..=f64::from(PARAMETER_MAX)).contains(&index) {
            return Ok(index as u32);
        }
        Err(self.span_from(start).fault(ExpressionError::ParameterIndexRange {
            index,
            max: PARAMETER_MAX,
        }))
    }

    /// A function and its argument in brackets.
    fn function(&mut self, values: &impl Values) -> Result<f64, Fault> {
        let start = self.at;
        let name = self.consume_letters();
        let function = Function::ALL.into_iter().find(|function| function.name() == name);
        let name_span = self.span_from(start);
        if self.peek() != Some(b'[') {
            return Err(match function {
                Some(function) => name_span.fault(ExpressionError::FunctionBracketMissing {
                    function: function.name(),
                }),
                None => {
                    self.at = start;
                    self.value_missing()
                }
            });
        }
        let Some(function) = function else {
            if name.len() == 1 {
                // Rather the next word.
                self.at = start;
                return Err(self.value_missing());
            }
            let hint = nearest(&name, Function::ALL.map(Function::name));
            return Err((
                name_span,
                ExpressionError::UnknownFunction { name, nearest: hint }.into(),
            ));
        };
        match function {
            Function::Exists => self.exists(values, name_span),
            Function::Atan => {
                let y = self.brackets(values)?;
                if !self.consume(b'/') || self.peek() != Some(b'[') {
                    return Err((self.span_of(start, self.at), ExpressionError::AtanSlashMissing.into()));
                }
                let x = self.brackets(values)?;
                Ok(degrees::atan2(y, x))
            }
            Function::Abs
            | Function::Acos
            | Function::Asin
            | Function::Cos
            | Function::Exp
            | Function::Fix
            | Function::Fup
            | Function::Ln
            | Function::Round
            | Function::Sin
            | Function::Sqrt
            | Function::Tan => {
                let argument_start = self.at;
                let argument = self.brackets(values)?;
                function
                    .apply(argument)
                    .map_err(|kind| (self.span_from(argument_start), kind))
            }
        }
    }

    /// `[#name]` behind EXISTS.
    fn exists(&mut self, values: &impl Values, name_span: Span) -> Result<f64, Fault> {
        self.at += 1;
        if !self.consume(b'#') {
            return Err((name_span, ExpressionError::ExistsNeedsParameter.into()));
        }
        let exists = if self.peek() == Some(b'<') {
            // Unknown for a checker that knows the name but not the value.
            match values.named(&self.name()?) {
                Some(value) if value.is_nan() => value,
                Some(_) => 1.0,
                None => 0.0,
            }
        } else {
            match self.index(values)? {
                Some(index) => f64::from((1.0..=f64::from(PARAMETER_MAX)).contains(&index)),
                None => f64::NAN,
            }
        };
        if !self.consume(b']') {
            return Err((name_span, ExpressionError::ExistsNeedsParameter.into()));
        }
        Ok(exists)
    }

    /// Leaves out what looks like a value: signs, digits, names, functions, everything in brackets,
    /// and what is assigned.
    #[cold]
    fn skip_value(&mut self) {
        while let Some(octet) = self.peek() {
            match octet {
                b'0'..=b'9' | b'.' | b'+' | b'-' | b'#' | b'=' => self.at += 1,
                b'<' => self.skip_to(b'>'),
                b'[' => {
                    self.skip_brackets();
                    // The second part of ATAN[y]/[x].
                    let behind = self.at;
                    if !(self.consume(b'/') && self.peek() == Some(b'[')) {
                        self.at = behind;
                        return;
                    }
                }
                b'A'..=b'Z' => {
                    let before = self.at;
                    let letters = self.consume_letters().len();
                    if letters == 1 || self.peek() != Some(b'[') {
                        self.at = before;
                        return;
                    }
                }
                _ => return,
            }
        }
    }

    /// Leaves out everything to a closing octet, or to the end of the line.
    fn skip_to(&mut self, close: u8) {
        let rest = &self.line[self.at..];
        let length = rest
            .iter()
            .position(|octet| *octet == close)
            .map_or(rest.len(), |at| at + 1);
        self.at += length;
    }

    /// Leaves out `[ ]` with all that are within, or everything to the end of the line.
    fn skip_brackets(&mut self) {
        let mut depth = 0_usize;
        for (index, octet) in self.line.iter().enumerate().skip(self.at) {
            match octet {
                b'[' => depth += 1,
                b']' => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                self.at = index + 1;
                return;
            }
        }
        self.at = self.line.len();
    }

    /// No value stands at the cursor; tells what stands before it.
    #[cold]
    fn value_missing(&mut self) -> Fault {
        let before = &self.line[..self.at];
        let end = before
            .iter()
            .rposition(|octet| !is_blank(*octet))
            .map_or(0, |at| at + 1);
        let is_letter = |octet: &u8| octet.is_ascii_alphabetic();
        let letters = before[..end].iter().rev().take_while(|octet| is_letter(octet)).count();
        let start = end - letters.max(1).min(end);
        // `X1 YX` is no function: only the last letter is a word. Within brackets the letters are an operator.
        let within = self.line[..start].iter().filter(|octet| **octet == b'[').count()
            > self.line[..start].iter().filter(|octet| **octet == b']').count();
        let start = if within { start } else { end - 1.min(end) };
        let after = String::from_utf8_lossy(&self.line[start..end]).to_ascii_uppercase();
        (Span::new(start, end), ExpressionError::ValueMissing { after }.into())
    }

    #[cold]
    fn number_fault(&mut self, fault: NumberFault, start: usize) -> Fault {
        match fault {
            NumberFault::Missing => self.value_missing(),
            NumberFault::NoDigit => (self.span_of(start, self.at), ExpressionError::DigitMissing.into()),
            NumberFault::SecondPoint => {
                self.at += 1;
                (self.span_of(start, self.at), ExpressionError::SecondPoint.into())
            }
        }
    }

    /// Something that is no operator stands at the cursor.
    #[cold]
    fn unknown_operator(&mut self) -> Fault {
        const SIGNS: [(&str, &str); 11] = [
            ("==", "EQ"),
            ("!=", "NE"),
            ("<>", "NE"),
            (">=", "GE"),
            ("<=", "LE"),
            ("&&", "AND"),
            ("||", "OR"),
            ("=", "EQ"),
            (">", "GT"),
            ("<", "LT"),
            ("%", "MOD"),
        ];
        let start = self.at;
        for (sign, meant) in SIGNS {
            if self.consume_word(sign.as_bytes()) {
                let kind = ExpressionError::UnknownOperator {
                    found: sign.into(),
                    nearest: Some(meant),
                }
                .into();
                return (self.span_from(start), kind);
            }
        }
        let found = self.consume_letters();
        if found.is_empty() {
            self.at += 1;
            if !self.line[start].is_ascii() {
                return self.bad_character();
            }
            let found = char::from(self.line[start]).into();
            return self
                .span_from(start)
                .fault(ExpressionError::UnknownOperator { found, nearest: None });
        }
        if found == "E"
            && let Some(fault) = number_with_exponent(self.line, start)
        {
            self.at = fault.0.end.into();
            return fault;
        }
        let nearest = nearest(&found, Operator::WORDS.map(Operator::name));
        (
            self.span_from(start),
            ExpressionError::UnknownOperator { found, nearest }.into(),
        )
    }

    /// The octets from `start` to `end` without blanks around them.
    #[cold]
    fn span_of(&self, start: usize, end: usize) -> Span {
        let blanks = self.line[start..end]
            .iter()
            .take_while(|octet| is_blank(**octet))
            .count();
        let mut cursor = self.clone();
        cursor.at = end;
        cursor.span_from(start + blanks)
    }
}

#[cfg(test)]
mod tests;
