//! Functions of the standard: their names, their inputs, what they come to.

use super::{count_of, is_enable};
use crate::arithmetic::{Binary, Unary};
use crate::compile::expression::{Checker, Read};
use crate::compile::tree::{Node, NodeKind};
use crate::compile::types::Type;
use crate::diagnostic::{Kind, Reported, Span};
use crate::scalar::Scalar;
use crate::syntax::{self, Argument, Expression, key};
use std::collections::HashMap;

const LREAL: Type = Type::Scalar(Scalar::Lreal);

/// Inputs of a standard function that takes any number of them: each is one level of what is worked out.
const INPUTS_MAX: usize = 250;

/// A function of the standard.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Standard {
    /// Of a REAL or LREAL.
    Real(Unary),
    Absolute,
    Truncate,
    Move,
    Not,
    /// As the operator, with as many inputs as it takes.
    Operator(syntax::Binary, bool),
    Shift(Binary),
    Extreme(Binary),
    Limit,
    Select,
    Multiplex,
    Convert(Scalar, Scalar),
    /// Of a REAL or LREAL without what is behind its point.
    Cut(Scalar, Scalar),
    /// Of decimal digits of four bits each, and to them.
    OfDigits(Scalar, Scalar),
    ToDigits(Scalar, Scalar),
}

/// Functions with their inputs.
#[rustfmt::skip]
const FUNCTIONS: [(&str, Standard, &[&str]); 38] = {
    use Standard::*;
    use syntax::Binary as Word;
    const IN: &[&str] = &["IN"];
    const PAIR: &[&str] = &["IN1", "IN2"];
    const SHIFT: &[&str] = &["IN", "N"];
    [
        ("ABS", Absolute, IN), ("SQRT", Real(Unary::SquareRoot), IN), ("LN", Real(Unary::Ln), IN), ("LOG", Real(Unary::Log), IN),
        ("EXP", Real(Unary::Exp), IN), ("SIN", Real(Unary::Sin), IN), ("COS", Real(Unary::Cos), IN), ("TAN", Real(Unary::Tan), IN),
        ("ASIN", Real(Unary::Asin), IN), ("ACOS", Real(Unary::Acos), IN), ("ATAN", Real(Unary::Atan), IN),
        ("TRUNC", Truncate, IN), ("MOVE", Move, IN), ("NOT", Not, IN),
        ("EXPT", Operator(Word::Power, false), PAIR),
        ("ADD", Operator(Word::Add, true), PAIR), ("SUB", Operator(Word::Subtract, false), PAIR),
        ("MUL", Operator(Word::Multiply, true), PAIR), ("DIV", Operator(Word::Divide, false), PAIR),
        ("MOD", Operator(Word::Modulo, false), PAIR),
        ("GT", Operator(Word::Greater, true), PAIR), ("GE", Operator(Word::GreaterEqual, true), PAIR),
        ("EQ", Operator(Word::Equal, true), PAIR), ("LE", Operator(Word::LessEqual, true), PAIR),
        ("LT", Operator(Word::Less, true), PAIR), ("NE", Operator(Word::NotEqual, false), PAIR),
        ("AND", Operator(Word::And, true), PAIR), ("OR", Operator(Word::Or, true), PAIR), ("XOR", Operator(Word::Xor, true), PAIR),
        ("SHL", Shift(Binary::ShiftLeft), SHIFT), ("SHR", Shift(Binary::ShiftRight), SHIFT),
        ("ROL", Shift(Binary::RotateLeft), SHIFT), ("ROR", Shift(Binary::RotateRight), SHIFT),
        ("SEL", Select, &["G", "IN0", "IN1"]), ("LIMIT", Limit, &["MN", "IN", "MX"]), ("MUX", Multiplex, &["K", "IN0", "IN1"]),
        ("MAX", Extreme(Binary::Greatest), PAIR), ("MIN", Extreme(Binary::Least), PAIR),
    ]
};

/// A function by its name, with the type that its name gives to its inputs.
pub(super) struct Named {
    name: String,
    function: Standard,
    inputs: &'static [&'static str],
    of: Option<Scalar>,
}

/// The function that a name of the standard calls.
pub(super) fn standard(name: &str) -> Option<Named> {
    let name = name.to_ascii_uppercase();
    let known = |wanted: &str| {
        let found = FUNCTIONS.iter().find(|(known, ..)| *known == wanted);
        found.map(|(_, function, inputs)| (*function, *inputs))
    };
    if let Some((function, inputs)) = known(&name) {
        let of = None;
        return Some(Named {
            name,
            function,
            inputs,
            of,
        });
    }
    if let Some(function) = conversion(&name) {
        let (inputs, of) = (&["IN"][..], None);
        return Some(Named {
            name,
            function,
            inputs,
            of,
        });
    }
    let (base, of) = match name.as_str() {
        "MULTIME" => ("MUL", Scalar::Time),
        "DIVTIME" => ("DIV", Scalar::Time),
        name => {
            let (base, of) = name.rsplit_once('_')?;
            (base, Scalar::of_name(of)?)
        }
    };
    let (function, inputs) = known(base)?;
    let of = Some(of);
    Some(Named {
        name,
        function,
        inputs,
        of,
    })
}

/// `INT_TO_REAL`, `REAL_TRUNC_INT`, `WORD_BCD_TO_UINT`, `UINT_TO_BCD_WORD`.
fn conversion(name: &str) -> Option<Standard> {
    let bits = |name: &str| Scalar::of_name(name).filter(|scalar| scalar.is_bit_string());
    let whole = |name: &str| Scalar::of_name(name).filter(|scalar| scalar.is_integer());
    if let Some((from, to)) = name.split_once("_TRUNC_") {
        let from = Scalar::of_name(from).filter(|from| from.is_real())?;
        return Some(Standard::Cut(from, whole(to)?));
    }
    if let Some((from, to)) = name.split_once("_BCD_TO_") {
        return Some(Standard::OfDigits(bits(from)?, whole(to)?));
    }
    let (from, to) = name.split_once("_TO_")?;
    if let Some(to) = to.strip_prefix("BCD_") {
        return Some(Standard::ToDigits(whole(from)?, bits(to)?));
    }
    let (from, to) = (Scalar::of_name(from)?, Scalar::of_name(to)?);
    (from != Scalar::String && to != Scalar::String).then_some(Standard::Convert(from, to))
}

/// Whether a name is that of a standard function.
pub(in crate::compile) fn is_standard(name: &str) -> bool {
    standard(name).is_some()
}

/// Whether a file may have no function of its own that is called so.
pub(in crate::compile) fn is_reserved(name: &str) -> bool {
    let Some(named) = standard(name) else { return false };
    match named.function {
        Standard::Convert(from, to) => from != to,
        Standard::Cut(..) | Standard::OfDigits(..) | Standard::ToDigits(..) => false,
        _ => named.of.is_none(),
    }
}

/// Names of the functions of the standard, as far as they stand in a table.
pub(super) fn names<'n>() -> impl Iterator<Item = &'n str> {
    FUNCTIONS.iter().map(|(name, ..)| *name)
}

/// A call of a function of the standard.
#[derive(Clone, Copy)]
struct Call<'n> {
    name: &'n str,
    /// The type that its name gives to its inputs.
    of: Option<Type>,
    expected: Option<Type>,
    at: Span,
}

impl Checker<'_, '_, '_> {
    /// The inputs of a standard function in their order.
    pub(super) fn in_order<'e>(
        &mut self,
        named: &Named,
        arguments: &'e [Argument],
        at: Span,
    ) -> Read<Vec<&'e Expression>> {
        let Named {
            name, function, inputs, ..
        } = named;
        let extends = matches!(
            function,
            Standard::Operator(_, true) | Standard::Extreme(_) | Standard::Multiplex
        );
        if let Some(enable) = arguments
            .iter()
            .find_map(|one| one.name.as_ref().filter(|name| is_enable(name)))
        {
            return Err(self.compiler.told.unsupported(enable.at, "EN and ENO", &enable.text));
        }
        let got = arguments.len();
        if got != inputs.len() && !(extends && got > inputs.len()) {
            let wanted = if extends {
                format!("{} inputs or more", inputs.len())
            } else {
                count_of(inputs.len())
            };
            let name = name.clone();
            return self.error(at, Kind::ArgumentCount { name, wanted, got });
        }
        if got > INPUTS_MAX {
            let (name, wanted) = (name.clone(), format!("{INPUTS_MAX} inputs at most"));
            return self.error(at, Kind::ArgumentCount { name, wanted, got });
        }
        let named = arguments.iter().filter(|argument| argument.name.is_some()).count();
        if named != 0 && named != got {
            return self.error(at, Kind::ArgumentsMixed);
        }
        // IN1, IN2, IN3 ..; of MUX K, IN0, IN1 ..
        let names = (0..got).map(|place| match inputs.get(place) {
            Some(name) => (*name).to_owned(),
            None if *function == Standard::Multiplex => format!("IN{}", place - 1),
            None => format!("IN{}", place + 1),
        });
        let names: Vec<String> = names.collect();
        let by_name: HashMap<String, usize> = names.iter().map(|name| key(name)).zip(0..).collect();
        let mut ordered: Vec<Option<&Expression>> = vec![None; got];
        for (place, argument) in arguments.iter().enumerate() {
            let index = match &argument.name {
                None => place,
                Some(wanted) => self.input_named(name, wanted, &by_name, names.iter().map(String::as_str))?,
            };
            let value = self.given(argument, name)?;
            if ordered[index].replace(value).is_some() {
                let argument = names[index].clone();
                return self.error(value.at, Kind::ArgumentTwice { argument });
            }
        }
        Ok(ordered.into_iter().flatten().collect())
    }

    pub(super) fn standard(
        &mut self,
        named: &Named,
        values: &[&Expression],
        expected: Option<Type>,
        at: Span,
    ) -> Read<Node> {
        let call = Call {
            name: &named.name,
            of: named.of.map(Type::Scalar),
            // What a name gives to inputs is what is wanted of them.
            expected: named.of.map(Type::Scalar).or(expected),
            at,
        };
        // Each has one input at least.
        let first = values[0];
        match named.function {
            Standard::Real(operation) => self.real(&call, operation, first),
            Standard::Absolute => self.unary_of(&call, Unary::Absolute, first, Scalar::is_number),
            Standard::Truncate => self.truncate(&call, first),
            Standard::Move => self.typed_input(&call, first),
            Standard::Not => {
                let is_bits = |scalar: Scalar| scalar == Scalar::Bool || scalar.is_bit_string();
                self.unary_of(&call, Unary::Not, first, is_bits)
            }
            Standard::Operator(word, _) if word.compares() => self.compare(&call, word, values),
            Standard::Operator(word, _) => self.operate(&call, word, values),
            Standard::Shift(operation) => self.shift(&call, operation, [first, values[1]]),
            Standard::Extreme(operation) => self.extreme(&call, operation, values),
            Standard::Limit => self.limit(&call, values),
            Standard::Select => self.select(&call, first, &values[1..]),
            Standard::Multiplex => self.multiplex(&call, first, &values[1..]),
            Standard::Convert(from, to) => self.convert(&call, from, to, first),
            Standard::Cut(from, to) => {
                let node = self.expression_of(first, Type::Scalar(from))?;
                let cut = self.folded(Unary::Truncate, from, Node { at, ..node });
                Ok(self.converted(from, to, cut))
            }
            Standard::OfDigits(from, to) => {
                let node = self.expression_of(first, Type::Scalar(from))?;
                let mut number = self.folded(Unary::OfDigits, from, Node { at, ..node });
                number.ty = Type::Scalar(Scalar::Ulint);
                Ok(self.converted(Scalar::Ulint, to, number))
            }
            Standard::ToDigits(from, to) => {
                let node = self.expression_of(first, Type::Scalar(from))?;
                // A negative number has too many digits then.
                let number = self.converted(from, Scalar::Ulint, Node { at, ..node });
                let mut digits = self.folded(Unary::ToDigits, to, number);
                digits.ty = Type::Scalar(to);
                Ok(digits)
            }
        }
    }

    fn real(&mut self, call: &Call<'_>, operation: Unary, input: &Expression) -> Read<Node> {
        let wanted = call
            .expected
            .filter(|ty| ty.scalar().is_some_and(Scalar::is_real))
            .unwrap_or(LREAL);
        let of_real = Call {
            expected: Some(wanted),
            ..*call
        };
        let mut node = self.typed_input(&of_real, input)?;
        let scalar = node.ty.scalar().filter(|scalar| scalar.is_integer());
        if let Some(real) = scalar.and_then(|scalar| scalar.common(wanted.scalar()?)) {
            node = self.coerce(node, Type::Scalar(real))?;
        }
        self.folded_of(call, operation, node, Scalar::is_real)
    }

    fn unary_of(
        &mut self,
        call: &Call<'_>,
        operation: Unary,
        input: &Expression,
        takes: impl Fn(Scalar) -> bool,
    ) -> Read<Node> {
        let node = self.typed_input(call, input)?;
        self.folded_of(call, operation, node, takes)
    }

    fn folded_of(
        &mut self,
        call: &Call<'_>,
        operation: Unary,
        node: Node,
        takes: impl Fn(Scalar) -> bool,
    ) -> Read<Node> {
        match node.ty.scalar().filter(|scalar| takes(*scalar)) {
            Some(scalar) => Ok(self.folded(operation, scalar, Node { at: call.at, ..node })),
            None => self.no_operand(call.name, &node),
        }
    }

    fn truncate(&mut self, call: &Call<'_>, input: &Expression) -> Read<Node> {
        let node = self.typed(input, Some(LREAL))?;
        let Some(scalar) = node.ty.scalar().filter(|scalar| scalar.is_real()) else {
            return self.no_operand(call.name, &node);
        };
        let to = call
            .expected
            .and_then(Type::scalar)
            .filter(|scalar| scalar.is_integer());
        let cut = self.folded(Unary::Truncate, scalar, Node { at: call.at, ..node });
        Ok(self.converted(scalar, to.unwrap_or(Scalar::Dint), cut))
    }

    fn compare(&mut self, call: &Call<'_>, word: syntax::Binary, values: &[&Expression]) -> Read<Node> {
        let mut nodes: Vec<Node> = Vec::new();
        for value in values {
            let enumeration = nodes.first().map(|node| node.ty);
            let enumeration = enumeration.filter(|ty| matches!(ty, Type::Enumeration(_)));
            nodes.push(self.input(value, enumeration, call.of)?);
        }
        self.comparison(word, nodes, call.at)
    }

    fn operate(&mut self, call: &Call<'_>, word: syntax::Binary, values: &[&Expression]) -> Read<Node> {
        let Call { of, expected, at, .. } = *call;
        // What TIME is multiplied by is a number, and so is an exponent.
        let scales = matches!(word, syntax::Binary::Multiply | syntax::Binary::Divide);
        let is_alike = word != syntax::Binary::Power && !(scales && of == Some(Type::Scalar(Scalar::Time)));
        let others = of.filter(|_| is_alike);
        let mut sum = self.input(values[0], expected, of)?;
        for value in &values[1..] {
            let right = self.input(value, others.or(expected.filter(|_| is_alike)), others)?;
            sum = self.operator(word, sum, right, expected, at)?;
        }
        Ok(sum)
    }

    fn shift(&mut self, call: &Call<'_>, operation: Binary, [bits, count]: [&Expression; 2]) -> Read<Node> {
        let node = self.typed_input(call, bits)?;
        let Some(scalar) = node.ty.scalar().filter(|scalar| scalar.is_bit_string()) else {
            return self.no_operand(call.name, &node);
        };
        let count = self.typed(count, None)?;
        if !count.ty.scalar().is_some_and(Scalar::is_integer) {
            return self.no_operand(call.name, &count);
        }
        let ty = node.ty;
        self.folded_pair(operation, scalar, [node, count], ty, call.at)
    }

    fn extreme(&mut self, call: &Call<'_>, operation: Binary, values: &[&Expression]) -> Read<Node> {
        let (ty, nodes) = self.alike(call, values)?;
        let scalar = self.ordered(call.name, ty, &nodes)?;
        let mut nodes = nodes.into_iter();
        let Some(mut extreme) = nodes.next() else {
            return Err(Reported);
        };
        for node in nodes {
            extreme = self.folded_pair(operation, scalar, [extreme, node], ty, call.at)?;
        }
        Ok(extreme)
    }

    fn limit(&mut self, call: &Call<'_>, values: &[&Expression]) -> Read<Node> {
        let (ty, nodes) = self.alike(call, values)?;
        let scalar = self.ordered(call.name, ty, &nodes)?;
        let Ok([low, value, high]) = <[Node; 3]>::try_from(nodes) else {
            return Err(Reported);
        };
        let above = self.folded_pair(Binary::Greatest, scalar, [value, low], ty, call.at)?;
        self.folded_pair(Binary::Least, scalar, [above, high], ty, call.at)
    }

    fn select(&mut self, call: &Call<'_>, selector: &Expression, values: &[&Expression]) -> Read<Node> {
        let selector = self.expression_of(selector, Type::Scalar(Scalar::Bool))?;
        let (ty, nodes) = self.alike(call, values)?;
        let Ok([for_false, for_true]) = <[Node; 2]>::try_from(nodes) else {
            return Err(Reported);
        };
        let kind = NodeKind::Select(Box::new([selector, for_false, for_true]));
        Ok(Node { ty, kind, at: call.at })
    }

    fn multiplex(&mut self, call: &Call<'_>, selector: &Expression, values: &[&Expression]) -> Read<Node> {
        let selector = self.typed(selector, None)?;
        if !selector.ty.scalar().is_some_and(Scalar::is_integer) {
            return self.no_operand(call.name, &selector);
        }
        let (ty, mut nodes) = self.alike(call, values)?;
        nodes.insert(0, selector);
        let kind = NodeKind::Choose(nodes);
        Ok(Node { ty, kind, at: call.at })
    }

    fn convert(&mut self, call: &Call<'_>, from: Scalar, to: Scalar, input: &Expression) -> Read<Node> {
        let node = self.expression_of(input, Type::Scalar(from))?;
        let sums = matches!(
            node.kind,
            NodeKind::Binary(Binary::Add | Binary::Subtract | Binary::Multiply, ..)
        );
        if sums && from.is_integer() && from.bits() < 32 && to.is_number() && from.bits() < to.bits() {
            let (name, ty) = (call.name.to_owned(), from.name());
            self.compiler.told.warning(node.at, Kind::NarrowConversion { name, ty });
        }
        Ok(self.converted(from, to, Node { at: call.at, ..node }))
    }

    /// An input; `of`: the type that the name of the function gives it.
    fn input(&mut self, value: &Expression, expected: Option<Type>, of: Option<Type>) -> Read<Node> {
        match of {
            Some(of) => self.expression_of(value, of),
            None => self.expression(value, expected),
        }
    }

    fn typed_input(&mut self, call: &Call<'_>, value: &Expression) -> Read<Node> {
        let node = self.input(value, call.expected, call.of)?;
        self.settle(node, call.expected)
    }

    /// Inputs of one type.
    fn alike(&mut self, call: &Call<'_>, values: &[&Expression]) -> Read<(Type, Vec<Node>)> {
        let Call { expected, of, at, .. } = *call;
        let mut nodes = Vec::new();
        for value in values {
            nodes.push(self.input(value, expected, of)?);
        }
        let Some(common) = self.common(&nodes, expected) else {
            let different = nodes
                .iter()
                .find(|node| node.ty != nodes[0].ty)
                .map_or(nodes[0].ty, |node| node.ty);
            let (left, right) = (self.type_name(nodes[0].ty), self.type_name(different));
            let operator = call.name.to_owned();
            return self.error(
                at,
                Kind::Operands {
                    operator,
                    left,
                    right,
                    cure_text: None,
                },
            );
        };
        let open = matches!(common, Type::AnyInteger | Type::AnyReal);
        let mut common = common;
        if open {
            // The type that holds all of them.
            for node in &nodes {
                let ty = self.settle(node.clone(), expected)?.ty;
                let wider = match (common.scalar(), ty.scalar()) {
                    (Some(a), Some(b)) => a.common(b).map(Type::Scalar),
                    _ => Some(ty),
                };
                common = wider.unwrap_or(ty);
            }
        }
        if !common.is_single() {
            let node = nodes.swap_remove(0);
            return self.no_operand(call.name, &node);
        }
        let nodes = nodes.into_iter().map(|node| self.coerce(node, common));
        Ok((common, nodes.collect::<Read<_>>()?))
    }

    /// A type whose values have an order.
    fn ordered(&mut self, name: &str, ty: Type, nodes: &[Node]) -> Read<Scalar> {
        match ty.scalar() {
            Some(scalar) if scalar != Scalar::String => Ok(scalar),
            _ => {
                let node = nodes[0].clone();
                self.no_operand(name, &node)
            }
        }
    }
}
