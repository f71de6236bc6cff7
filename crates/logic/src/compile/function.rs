//! Calls of functions: those of the file, and those of the standard.

use super::CODE_MAX;
use super::expression::{Checker, Read};
use super::tree::{Node, NodeKind};
use super::types::Type;
use crate::arithmetic::{Binary, Unary};
use crate::diagnostic::{Kind, Span};
use crate::scalar::Scalar;
use crate::syntax::{self, Argument, ArgumentValue, Expression, Name, Section, UnitKind, key};
use std::collections::HashMap;

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
struct Named {
    name: String,
    function: Standard,
    inputs: &'static [&'static str],
    of: Option<Scalar>,
}

fn standard(name: &str) -> Option<Named> {
    let name = name.to_ascii_uppercase();
    let known = |wanted: &str| FUNCTIONS.iter().find(|(known, ..)| *known == wanted);
    if let Some((_, function, inputs)) = known(&name) {
        let (function, inputs, of) = (*function, *inputs, None);
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
    let (_, function, inputs) = known(base)?;
    let (function, inputs, of) = (*function, *inputs, Some(of));
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
pub(super) fn is_standard(name: &str) -> bool {
    standard(name).is_some()
}

/// Whether a file may have no function of its own that is called so.
pub(super) fn is_reserved(name: &str) -> bool {
    let Some(named) = standard(name) else { return false };
    match named.function {
        Standard::Convert(from, to) => from != to,
        Standard::Cut(..) | Standard::OfDigits(..) | Standard::ToDigits(..) => false,
        _ => named.of.is_none(),
    }
}

impl Checker<'_, '_, '_> {
    pub(super) fn function(
        &mut self,
        name: &Name,
        arguments: &[Argument],
        expected: Option<Type>,
        at: Span,
    ) -> Read<Node> {
        if let Some(unit) = self.compiler.unit_by_name.get(&name.key()).copied() {
            return self.own_function(unit, name, arguments, at);
        }
        if let Some(named) = standard(&name.text) {
            let values = self.in_order(&named.name, named.function, named.inputs, arguments, at)?;
            return self.standard(&named, &values, expected, at);
        }
        let name_text = name.text.clone();
        if let Some(found) = self.find(name) {
            let ty = self.found(found).ty;
            return match ty {
                Type::Block(_) => self.error(at, Kind::BlockInExpression { name: name_text }),
                _ => self.error(
                    at,
                    Kind::NoFunction {
                        name: name_text,
                        nearest: None,
                    },
                ),
            };
        }
        if let Some(what) = unsupported(&name.text) {
            return Err(self.compiler.told.unsupported(name.at, what, &name_text));
        }
        if self.compiler.refused.contains(&(None, name.key())) {
            return Err(crate::diagnostic::Reported);
        }
        let units = self
            .compiler
            .units
            .iter()
            .filter(|unit| unit.kind == UnitKind::Function);
        let known = units
            .map(|unit| unit.name.as_str())
            .chain(FUNCTIONS.iter().map(|(name, ..)| *name));
        let nearest = self.compiler.told.nearest(&name.text, known);
        self.error(
            name.at,
            Kind::NoFunction {
                name: name_text,
                nearest,
            },
        )
    }

    /// A function of the file.
    fn own_function(&mut self, unit: usize, name: &Name, arguments: &[Argument], at: Span) -> Read<Node> {
        let name_text = name.text.clone();
        match self.compiler.units[unit].kind {
            UnitKind::Function => {}
            UnitKind::Block => return self.error(at, Kind::BlockAsFunction { name: name_text }),
            UnitKind::Program => return self.error(at, Kind::ProgramCalled { name: name_text }),
        }
        if self.is_declaration {
            return self.error(at, Kind::Constant);
        }
        self.compiler.body(unit, name.at)?;
        let called = &self.compiler.units[unit];
        let Some(result) = called.result else {
            return Err(crate::diagnostic::Reported);
        };
        let inputs = called
            .variables
            .iter()
            .filter(|variable| variable.section == Section::Input);
        let inputs: Vec<_> = inputs
            .map(|input| (input.name.clone(), input.ty, input.offset))
            .collect();
        self.compiler.given += inputs.len();
        if self.compiler.given > CODE_MAX {
            return self.error(at, Kind::Code { most: CODE_MAX });
        }
        let by_name: HashMap<String, usize> = match arguments.first() {
            Some(Argument { name: Some(_), .. }) => inputs.iter().map(|(input, ..)| key(input)).zip(0..).collect(),
            _ => HashMap::new(),
        };
        let named = arguments.iter().filter(|argument| argument.name.is_some()).count();
        if named != 0 && named != arguments.len() {
            return self.error(at, Kind::ArgumentsMixed);
        }
        if named == 0 && arguments.len() != inputs.len() {
            let (wanted, got) = (count_of(inputs.len()), arguments.len());
            return self.error(
                at,
                Kind::ArgumentCount {
                    name: name_text,
                    wanted,
                    got,
                },
            );
        }
        let mut given: Vec<Option<Node>> = vec![None; inputs.len()];
        for (place, argument) in arguments.iter().enumerate() {
            let index = match &argument.name {
                None => place,
                Some(wanted) => {
                    let names = inputs.iter().map(|(input, ..)| input.as_str());
                    self.input_named(&name_text, wanted, &by_name, names)?
                }
            };
            let value = self.given(argument, &name_text)?;
            if given[index].is_some() {
                let argument = inputs[index].0.clone();
                return self.error(value.at, Kind::ArgumentTwice { argument });
            }
            given[index] = Some(self.expression_of(value, inputs[index].1)?);
        }
        let mut values = Vec::new();
        for ((input, ty, offset), given) in inputs.into_iter().zip(given) {
            let value = match given {
                Some(value) => value,
                // What is left out has the value of its declaration.
                None if ty.is_single() => {
                    let image = &self.compiler.units[unit].image;
                    Node::constant(ty, image[offset as usize], at)
                }
                None => {
                    return self.error(
                        at,
                        Kind::ArgumentMissing {
                            name: name_text,
                            argument: input,
                        },
                    );
                }
            };
            values.push((offset, value));
        }
        let kind = NodeKind::Call(unit, values);
        Ok(Node { ty: result, kind, at })
    }

    fn input_named<'n>(
        &mut self,
        name: &str,
        wanted: &Name,
        by_name: &HashMap<String, usize>,
        known: impl Iterator<Item = &'n str>,
    ) -> Read<usize> {
        if let Some(index) = by_name.get(&wanted.key()) {
            return Ok(*index);
        }
        if is_enable(wanted) {
            return Err(self.compiler.told.unsupported(wanted.at, "EN and ENO", &wanted.text));
        }
        let (nearest, argument) = (self.compiler.told.nearest(&wanted.text, known), wanted.text.clone());
        let name = name.to_owned();
        self.error(
            wanted.at,
            Kind::NoArgument {
                name,
                argument,
                direction: "input",
                nearest,
            },
        )
    }

    fn given<'e>(&mut self, argument: &'e Argument, name: &str) -> Read<&'e Expression> {
        match &argument.value {
            ArgumentValue::Given(value) => Ok(value),
            ArgumentValue::Taken(access) => {
                if let Some(name) = argument.name.as_ref().filter(|name| is_enable(name)) {
                    return Err(self.compiler.told.unsupported(name.at, "EN and ENO", &name.text));
                }
                let argument = argument
                    .name
                    .as_ref()
                    .map_or_else(String::new, |name| name.text.clone());
                let name = name.to_owned();
                self.error(
                    access.at,
                    Kind::NoArgument {
                        name,
                        argument,
                        direction: "output",
                        nearest: None,
                    },
                )
            }
        }
    }

    /// The inputs of a standard function in their order.
    fn in_order<'e>(
        &mut self,
        name: &str,
        function: Standard,
        inputs: &[&str],
        arguments: &'e [Argument],
        at: Span,
    ) -> Read<Vec<&'e Expression>> {
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
            let name = name.to_owned();
            return self.error(at, Kind::ArgumentCount { name, wanted, got });
        }
        if got > INPUTS_MAX {
            let (name, wanted) = (name.to_owned(), format!("{INPUTS_MAX} inputs at most"));
            return self.error(at, Kind::ArgumentCount { name, wanted, got });
        }
        let named = arguments.iter().filter(|argument| argument.name.is_some()).count();
        if named != 0 && named != got {
            return self.error(at, Kind::ArgumentsMixed);
        }
        // IN1, IN2, IN3 ..; of MUX K, IN0, IN1 ..
        let names = (0..got).map(|place| match inputs.get(place) {
            Some(name) => (*name).to_owned(),
            None if function == Standard::Multiplex => format!("IN{}", place - 1),
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

    fn standard(&mut self, named: &Named, values: &[&Expression], expected: Option<Type>, at: Span) -> Read<Node> {
        const LREAL: Type = Type::Scalar(Scalar::Lreal);
        let (name, of) = (named.name.as_str(), named.of.map(Type::Scalar));
        // What a name gives to inputs is what is wanted of them.
        let expected = of.or(expected);
        // Each has one input at least.
        let first = values[0];
        match named.function {
            Standard::Real(operation) => {
                let wanted = expected
                    .filter(|ty| ty.scalar().is_some_and(Scalar::is_real))
                    .unwrap_or(LREAL);
                let mut node = self.typed_input(first, Some(wanted), of)?;
                let scalar = node.ty.scalar().filter(|scalar| scalar.is_integer());
                if let Some(real) = scalar.and_then(|scalar| scalar.common(wanted.scalar()?)) {
                    node = self.coerce(node, Type::Scalar(real))?;
                }
                match node.ty.scalar() {
                    Some(scalar) if scalar.is_real() => Ok(self.folded(operation, scalar, Node { at, ..node })),
                    _ => self.no_operand(name, &node),
                }
            }
            Standard::Absolute => {
                let node = self.typed_input(first, expected, of)?;
                match node.ty.scalar() {
                    Some(scalar) if scalar.is_number() => Ok(self.folded(Unary::Absolute, scalar, Node { at, ..node })),
                    _ => self.no_operand(name, &node),
                }
            }
            Standard::Truncate => {
                let node = self.typed(first, Some(LREAL))?;
                let Some(scalar) = node.ty.scalar().filter(|scalar| scalar.is_real()) else {
                    return self.no_operand(name, &node);
                };
                let to = expected.and_then(Type::scalar).filter(|scalar| scalar.is_integer());
                let cut = self.folded(Unary::Truncate, scalar, Node { at, ..node });
                Ok(self.converted(scalar, to.unwrap_or(Scalar::Dint), cut))
            }
            Standard::Move => self.typed_input(first, expected, of),
            Standard::Not => {
                let node = self.typed_input(first, expected, of)?;
                match node.ty.scalar() {
                    Some(scalar) if scalar == Scalar::Bool || scalar.is_bit_string() => {
                        Ok(self.folded(Unary::Not, scalar, Node { at, ..node }))
                    }
                    _ => self.no_operand(name, &node),
                }
            }
            Standard::Operator(word, _) => {
                if word.compares() {
                    let mut nodes: Vec<Node> = Vec::new();
                    for value in values {
                        let enumeration = nodes.first().map(|node| node.ty);
                        let enumeration = enumeration.filter(|ty| matches!(ty, Type::Enumeration(_)));
                        nodes.push(self.input(value, enumeration, of)?);
                    }
                    return self.comparison(word, nodes, at);
                }
                // What TIME is multiplied by is a number, and so is an exponent.
                let scales = matches!(word, syntax::Binary::Multiply | syntax::Binary::Divide);
                let is_alike = word != syntax::Binary::Power && !(scales && named.of == Some(Scalar::Time));
                let others = of.filter(|_| is_alike);
                let mut sum = self.input(first, expected, of)?;
                for value in &values[1..] {
                    let right = self.input(value, others.or(expected.filter(|_| is_alike)), others)?;
                    sum = self.operator(word, sum, right, expected, at)?;
                }
                Ok(sum)
            }
            Standard::Shift(operation) => {
                let node = self.typed_input(first, expected, of)?;
                let Some(scalar) = node.ty.scalar().filter(|scalar| scalar.is_bit_string()) else {
                    return self.no_operand(name, &node);
                };
                let count = self.typed(values[1], None)?;
                if !count.ty.scalar().is_some_and(Scalar::is_integer) {
                    return self.no_operand(name, &count);
                }
                let ty = node.ty;
                self.folded_pair(operation, scalar, [node, count], ty, at)
            }
            Standard::Extreme(operation) => {
                let (ty, nodes) = self.alike(name, values, expected, of, at)?;
                let scalar = self.ordered(name, ty, &nodes)?;
                let mut nodes = nodes.into_iter();
                let Some(mut extreme) = nodes.next() else {
                    return Err(crate::diagnostic::Reported);
                };
                for node in nodes {
                    extreme = self.folded_pair(operation, scalar, [extreme, node], ty, at)?;
                }
                Ok(extreme)
            }
            Standard::Limit => {
                let (ty, nodes) = self.alike(name, values, expected, of, at)?;
                let scalar = self.ordered(name, ty, &nodes)?;
                let Ok([low, value, high]) = <[Node; 3]>::try_from(nodes) else {
                    return Err(crate::diagnostic::Reported);
                };
                let above = self.folded_pair(Binary::Greatest, scalar, [value, low], ty, at)?;
                self.folded_pair(Binary::Least, scalar, [above, high], ty, at)
            }
            Standard::Select => {
                let selector = self.expression_of(first, Type::Scalar(Scalar::Bool))?;
                let (ty, nodes) = self.alike(name, &values[1..], expected, of, at)?;
                let mut nodes = nodes.into_iter();
                let (Some(for_false), Some(for_true)) = (nodes.next(), nodes.next()) else {
                    return Err(crate::diagnostic::Reported);
                };
                let kind = NodeKind::Select(Box::new([selector, for_false, for_true]));
                Ok(Node { ty, kind, at })
            }
            Standard::Multiplex => {
                let selector = self.typed(first, None)?;
                if !selector.ty.scalar().is_some_and(Scalar::is_integer) {
                    return self.no_operand(name, &selector);
                }
                let (ty, mut nodes) = self.alike(name, &values[1..], expected, of, at)?;
                nodes.insert(0, selector);
                let kind = NodeKind::Choose(nodes);
                Ok(Node { ty, kind, at })
            }
            Standard::Convert(from, to) => {
                let node = self.expression_of(first, Type::Scalar(from))?;
                let sums = matches!(
                    node.kind,
                    NodeKind::Binary(Binary::Add | Binary::Subtract | Binary::Multiply, ..)
                );
                if sums && from.is_integer() && from.bits() < 32 && to.is_number() && from.bits() < to.bits() {
                    let (name, ty) = (name.to_owned(), from.name());
                    self.compiler.told.warning(node.at, Kind::NarrowConversion { name, ty });
                }
                Ok(self.converted(from, to, Node { at, ..node }))
            }
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

    /// An input; `of`: the type that the name of the function gives it.
    fn input(&mut self, value: &Expression, expected: Option<Type>, of: Option<Type>) -> Read<Node> {
        match of {
            Some(of) => self.expression_of(value, of),
            None => self.expression(value, expected),
        }
    }

    fn typed_input(&mut self, value: &Expression, expected: Option<Type>, of: Option<Type>) -> Read<Node> {
        let node = self.input(value, expected, of)?;
        self.settle(node, expected)
    }

    /// Inputs of one type.
    fn alike(
        &mut self,
        name: &str,
        values: &[&Expression],
        expected: Option<Type>,
        of: Option<Type>,
        at: Span,
    ) -> Read<(Type, Vec<Node>)> {
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
            let operator = name.to_owned();
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
            return self.no_operand(name, &node);
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

/// What a function belongs to that others have.
fn unsupported(name: &str) -> Option<&'static str> {
    let name = name.to_ascii_uppercase();
    match name.as_str() {
        "LEN" | "LEFT" | "RIGHT" | "MID" | "CONCAT" | "INSERT" | "DELETE" | "REPLACE" | "FIND" => {
            Some("functions of strings")
        }
        "ADR" | "REF" | "ADRINST" | "SIZEOF" | "MEMCPY" | "MEMSET" => Some(crate::parse::POINTERS),
        _ if name.ends_with("_TO_STRING") || name.starts_with("STRING_TO_") => Some("functions of strings"),
        _ if name.contains("_TIME_OF_DAY") || name.contains("_TOD") || name.contains("DATE_") => Some("dates"),
        _ => None,
    }
}

/// Whether an input or output is EN or ENO.
pub(super) fn is_enable(name: &Name) -> bool {
    ["EN", "ENO"]
        .iter()
        .any(|enable| name.text.eq_ignore_ascii_case(enable))
}

pub(super) fn count_of(inputs: usize) -> String {
    match inputs {
        1 => "1 input".into(),
        count => format!("{count} inputs"),
    }
}
