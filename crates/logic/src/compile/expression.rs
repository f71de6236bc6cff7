//! Expressions: names and types of what is written, constants worked out. Operators are in `operator`.

use super::Compiler;
use super::emit::Emitter;
use super::tree::{Node, NodeKind};
use super::types::Type;
use crate::arithmetic::{self, Binary, Flags, Unary};
use crate::diagnostic::{Kind, Reported, Span};
use crate::scalar::Scalar;
use crate::syntax::{self, Access, Expression, ExpressionKind, Name};

pub(super) type Read<T> = Result<T, Reported>;

pub(super) const BOOL: Type = Type::Scalar(Scalar::Bool);
pub(super) const LREAL: Type = Type::Scalar(Scalar::Lreal);

/// Checks what stands in one unit, and makes its instructions.
pub(super) struct Checker<'c, 'a, 't> {
    pub(super) compiler: &'c mut Compiler<'a, 't>,
    /// `None`: a declaration outside of units.
    pub(super) unit: Option<usize>,
    /// Control variables of the loops around.
    pub(super) controls: Vec<String>,
    /// What TO and BY of the loops around read.
    pub(super) limits: Vec<Access>,
    pub(super) emitter: Emitter,
    /// What is declared takes constants only.
    pub(super) is_declaration: bool,
}

impl<'c, 'a, 't> Checker<'c, 'a, 't> {
    /// For what is declared.
    pub(super) fn new(compiler: &'c mut Compiler<'a, 't>, unit: Option<usize>) -> Checker<'c, 'a, 't> {
        Checker {
            compiler,
            unit,
            controls: Vec::new(),
            limits: Vec::new(),
            emitter: Emitter::default(),
            is_declaration: true,
        }
    }

    pub(super) fn error<T>(&mut self, at: Span, kind: Kind) -> Read<T> {
        Err(self.compiler.told.error(at, kind))
    }

    pub(super) fn type_name(&self, ty: Type) -> String {
        self.compiler.types.name(ty, &self.compiler.units)
    }

    /// The slot of a constant expression.
    pub(super) fn constant(mut self, expression: &Expression, ty: Type) -> Read<i64> {
        self.constant_value(expression, ty)
    }

    pub(super) fn constant_value(&mut self, expression: &Expression, ty: Type) -> Read<i64> {
        let node = self.expression_of(expression, ty)?;
        match node.value() {
            Some(value) => Ok(value),
            None => self.error(expression.at, Kind::Constant),
        }
    }

    /// An expression whose value goes to something of this type.
    pub(super) fn expression_of(&mut self, expression: &Expression, ty: Type) -> Read<Node> {
        let node = self.expression(expression, Some(ty))?;
        self.coerce(node, ty)
    }

    /// An expression that has a type; `expected` decides where it is open.
    pub(super) fn typed(&mut self, expression: &Expression, expected: Option<Type>) -> Read<Node> {
        let node = self.expression(expression, expected)?;
        self.settle(node, expected)
    }

    /// Gives a literal a type: the expected one if it fits, else DINT, LINT or LREAL.
    pub(super) fn settle(&mut self, node: Node, expected: Option<Type>) -> Read<Node> {
        let expected = expected.and_then(Type::scalar);
        let ty = match node.kind {
            NodeKind::Integer(value) => {
                let fits = |scalar: Scalar| (scalar.range().0..=scalar.range().1).contains(&value);
                let wanted =
                    expected.filter(|scalar| scalar.is_integer() || scalar.is_bit_string() || scalar.is_real());
                let whole = [Scalar::Dint, Scalar::Lint].into_iter().find(|scalar| fits(*scalar));
                wanted.or(whole).unwrap_or(Scalar::Ulint)
            }
            NodeKind::Real(_) => expected.filter(|scalar| scalar.is_real()).unwrap_or(Scalar::Lreal),
            _ => return Ok(node),
        };
        self.coerce(node, Type::Scalar(ty))
    }

    /// `expected` helps where what is written does not decide: values of enumerations.
    pub(super) fn expression(&mut self, expression: &Expression, expected: Option<Type>) -> Read<Node> {
        let at = expression.at;
        let constant = |ty: Scalar, value: i64| Ok(Node::constant(Type::Scalar(ty), value, at));
        match &expression.kind {
            ExpressionKind::Integer(value) => Ok(Node {
                ty: Type::AnyInteger,
                kind: NodeKind::Integer(*value),
                at,
            }),
            ExpressionKind::Real(value) => Ok(Node {
                ty: Type::AnyReal,
                kind: NodeKind::Real(*value),
                at,
            }),
            ExpressionKind::Bool(value) => constant(Scalar::Bool, i64::from(*value)),
            ExpressionKind::Time(value) => constant(Scalar::Time, *value),
            ExpressionKind::Text(text) => {
                let number = self.compiler.texts.number(text);
                constant(Scalar::String, number)
            }
            ExpressionKind::Typed(prefix, value) => self.literal_of(prefix, value),
            ExpressionKind::Variable(access) => self.variable(access, expected),
            ExpressionKind::Unary(operator, operand) => self.unary(*operator, operand, expected, at),
            ExpressionKind::Binary(operator, left, right) => {
                let expected = expected.filter(|_| !operator.compares());
                let left = self.expression(left, expected)?;
                // The value of an enumeration on the right is one of that on the left, a NOT of a literal one of its bits.
                let wanted = Some(left.ty).filter(|ty| match ty {
                    Type::Enumeration(_) => true,
                    ty => ty.scalar().is_some_and(Scalar::is_bit_string),
                });
                let right = self.expression(right, wanted.or(expected))?;
                self.operator(*operator, left, right, expected, at)
            }
            ExpressionKind::Call(name, arguments) => self.function(name, arguments, expected, at),
            ExpressionKind::Wrong => Err(Reported),
        }
    }

    /// `INT#5`, `Colour#Red`.
    fn literal_of(&mut self, prefix: &Name, value: &Expression) -> Read<Node> {
        let at = prefix.at.to(value.at);
        if let Some(scalar) = Scalar::of_name(&prefix.text) {
            let mut node = self.expression(value, None)?;
            if node.value().is_none() && !matches!(node.kind, NodeKind::Integer(_) | NodeKind::Real(_)) {
                return self.error(value.at, Kind::Constant);
            }
            node.at = at;
            return self.coerce(node, Type::Scalar(scalar));
        }
        let types = &self.compiler.types;
        let found = types.enumeration_by_name.get(&prefix.key());
        let (Some(index), ExpressionKind::Variable(access)) = (found, &value.kind) else {
            let known = types.enumerations.iter().map(|known| known.name.as_str());
            let nearest = self
                .compiler
                .told
                .nearest(&prefix.text, known.chain(Scalar::ALL.map(Scalar::name)));
            let name = prefix.text.clone();
            return self.error(prefix.at, Kind::NoType { name, nearest });
        };
        let enumeration = &types.enumerations[*index as usize];
        if let Some(number) = enumeration.by_name.get(&access.name.key()) {
            return Ok(Node::constant(Type::Enumeration(*index), *number, at));
        }
        let names = enumeration.values.iter().map(|(known, _)| known.as_str());
        let nearest = self.compiler.told.nearest(&access.name.text, names);
        let (name, member) = (enumeration.name.clone(), access.name.text.clone());
        self.error(value.at, Kind::NoMember { name, member, nearest })
    }

    fn variable(&mut self, access: &Access, expected: Option<Type>) -> Read<Node> {
        if access.steps.is_empty()
            && !self.is_variable(&access.name)
            && let Some(value) = self.value_of_enumeration(&access.name, expected)?
        {
            return Ok(value);
        }
        if access.steps.is_empty()
            && let Some(Type::Enumeration(index)) = expected
            && let Some(found) = self.find(&access.name)
        {
            let (variable, ty) = (self.found(found).name.clone(), self.found(found).ty);
            let enumeration = &self.compiler.types.enumerations[index as usize];
            if Some(ty) != expected && enumeration.by_name.contains_key(&access.name.key()) {
                let (value, name) = (access.name.text.clone(), enumeration.name.clone());
                return self.error(access.at, Kind::ValueHidden { value, variable, name });
            }
        }
        if let Some(value) = self.constant_variable(access) {
            return Ok(value);
        }
        let place = self.place(access)?;
        if self.is_declaration {
            return self.error(access.at, Kind::Constant);
        }
        Ok(Node {
            ty: place.ty,
            at: access.at,
            kind: NodeKind::Load(Box::new(place)),
        })
    }

    /// The value of this name of an enumeration, if there is one.
    fn value_of_enumeration(&mut self, name: &Name, expected: Option<Type>) -> Read<Option<Node>> {
        let Some(values) = self.compiler.values.get(&name.key()) else {
            return Ok(None);
        };
        let wanted = values
            .iter()
            .find(|(index, _)| expected == Some(Type::Enumeration(*index)));
        match wanted.or(values.first().filter(|_| values.len() == 1)) {
            Some((index, value)) => Ok(Some(Node::constant(Type::Enumeration(*index), *value, name.at))),
            None => {
                let example = values.first().map_or(0, |(index, _)| *index as usize);
                let example = self.compiler.types.enumerations.get(example);
                let example = example.map_or_else(String::new, |known| known.name.clone());
                let value = name.text.clone();
                self.error(name.at, Kind::Ambiguous { value, example })
            }
        }
    }

    fn unary(&mut self, operator: syntax::Unary, operand: &Expression, expected: Option<Type>, at: Span) -> Read<Node> {
        let mut node = self.expression(operand, expected)?;
        node.at = at;
        if operator == syntax::Unary::Not {
            let node = self.settle(node, expected)?;
            return match node.ty {
                Type::Scalar(scalar) if scalar == Scalar::Bool || scalar.is_bit_string() => {
                    Ok(self.folded(Unary::Not, scalar, node))
                }
                _ => self.no_operand("NOT", &node),
            };
        }
        let minus = operator == syntax::Unary::Minus;
        match (&mut node.kind, node.ty) {
            (NodeKind::Integer(value), _) if minus => *value = -*value,
            (NodeKind::Real(value), _) if minus => *value = -*value,
            (NodeKind::Integer(_) | NodeKind::Real(_), _) => {}
            (_, Type::Scalar(scalar)) if scalar.is_signed() || scalar.is_real() || scalar == Scalar::Time => {
                if minus {
                    return Ok(self.folded(Unary::Negate, scalar, node));
                }
            }
            // Brackets around a NOT are a plus that changes nothing.
            _ if !minus => {}
            _ => return self.no_operand("-", &node),
        }
        Ok(node)
    }

    pub(super) fn no_operand<T>(&mut self, operator: &str, node: &Node) -> Read<T> {
        let ty = self.type_name(node.ty);
        let cure_text = match node.ty {
            Type::Scalar(scalar) if scalar.is_integer() && is_bitwise(operator) => {
                let bits = ["BYTE", "WORD", "DWORD", "LWORD"][(scalar.bits() / 8).ilog2() as usize];
                Some(format!("write {}_TO_{bits}(..)", scalar.name()))
            }
            Type::Scalar(scalar) if scalar.is_integer() => Some(format!("write {}_TO_LREAL(..)", scalar.name())),
            Type::Scalar(scalar) if scalar.is_bit_string() => {
                let whole = ["USINT", "UINT", "UDINT", "ULINT"][(scalar.bits() / 8).ilog2() as usize];
                Some(format!("write {}_TO_{whole}(..)", scalar.name()))
            }
            _ => None,
        };
        let operator = operator.to_owned();
        self.error(
            node.at,
            Kind::Operand {
                operator,
                ty,
                cure_text,
            },
        )
    }

    /// An operation on one value, worked out if that is constant.
    pub(super) fn folded(&self, operation: Unary, scalar: Scalar, node: Node) -> Node {
        let (ty, at) = (node.ty, node.at);
        if let Some(value) = node.value() {
            let mut flags = Flags::default();
            let value = arithmetic::unary(operation, scalar, value, &mut flags);
            if flags == Flags::default() {
                return Node::constant(ty, value, at);
            }
        }
        let kind = NodeKind::Unary(operation, scalar, Box::new(node));
        Node { ty, kind, at }
    }

    /// An operation on two values of `scalar`, worked out if they are constant.
    pub(super) fn folded_pair(
        &mut self,
        operation: Binary,
        scalar: Scalar,
        pair: [Node; 2],
        ty: Type,
        at: Span,
    ) -> Read<Node> {
        let [left, right] = pair;
        let divides = matches!(operation, Binary::Divide | Binary::Modulo | Binary::ScaleDown);
        let is_real = scalar.is_real() || operation == Binary::ScaleDown;
        let is_zero = |value: i64| {
            if is_real {
                f64::from_bits(value as u64) == 0.0
            } else {
                value == 0
            }
        };
        if divides && right.value().is_some_and(is_zero) {
            return self.error(right.at, Kind::DivisionByZero);
        }
        if let (Some(a), Some(b)) = (left.value(), right.value()) {
            let mut flags = Flags::default();
            let value = arithmetic::binary(operation, scalar, a, b, &mut flags);
            if flags == Flags::default() {
                return Ok(Node::constant(ty, value, at));
            }
        }
        let kind = NodeKind::Binary(operation, scalar, Box::new(left), Box::new(right));
        Ok(Node { ty, kind, at })
    }

    /// A conversion, worked out if the value is constant.
    pub(super) fn converted(&self, from: Scalar, to: Scalar, node: Node) -> Node {
        let (ty, at) = (Type::Scalar(to), node.at);
        if let Some(value) = node.value() {
            let mut flags = Flags::default();
            let value = arithmetic::convert(from, to, value, &mut flags);
            if flags == Flags::default() {
                return Node::constant(ty, value, at);
            }
        }
        // Among integers that hold each other, and REAL and LREAL, a slot is the same.
        let same = from.widens_to(to) && (from.is_integer() == to.is_integer());
        let kind = if same {
            node.kind
        } else {
            NodeKind::Convert(from, to, Box::new(node))
        };
        Node { ty, kind, at }
    }

    /// A text as a STRING of so many characters.
    fn cut(&mut self, node: Node, length: u32) -> Node {
        let (ty, at) = (Type::Text(length), node.at);
        let Some(number) = node.value() else {
            let kind = NodeKind::Cut(length, Box::new(node));
            return Node { ty, kind, at };
        };
        let text = usize::try_from(number)
            .ok()
            .and_then(|number| self.compiler.texts.get(number));
        let text = text.map_or("", String::as_str);
        let Some((end, _)) = text.char_indices().nth(length as usize) else {
            return Node::constant(ty, number, at);
        };
        let short = text[..end].to_owned();
        let short = self.compiler.texts.number(&short);
        let name = self.type_name(ty);
        self.compiler.told.warning(at, Kind::TextCut { ty: name, length });
        Node::constant(ty, short, at)
    }

    /// A value of a type that becomes a wider one: operators and functions that choose work in the wider one, so that nothing is
    /// lost before it becomes wider.
    fn worked_out_in(&mut self, node: Node, to: Scalar) -> Read<Node> {
        let (ty, at) = (node.ty, node.at);
        let wide = Type::Scalar(to);
        let is_same = |node: &Node| node.ty == ty;
        match node.kind {
            // A conversion that is written says what goes into it.
            NodeKind::Unary(operation, scalar, operand) if ty == Type::Scalar(scalar) && is_same(&operand) => {
                let operand = self.worked_out_in(*operand, to)?;
                Ok(self.folded(operation, to, Node { at, ..operand }))
            }
            NodeKind::Binary(operation, scalar, left, right)
                if ty == Type::Scalar(scalar) && is_same(&left) && (is_same(&right) || operation == Binary::Power) =>
            {
                let left = self.worked_out_in(*left, to)?;
                let right = match operation {
                    Binary::Power => *right,
                    _ => self.worked_out_in(*right, to)?,
                };
                self.folded_pair(operation, to, [left, right], wide, at)
            }
            NodeKind::Select(operands) if operands[1..].iter().all(is_same) => {
                let [selector, for_false, for_true] = *operands;
                let (for_false, for_true) = (self.worked_out_in(for_false, to)?, self.worked_out_in(for_true, to)?);
                let kind = NodeKind::Select(Box::new([selector, for_false, for_true]));
                Ok(Node { ty: wide, kind, at })
            }
            NodeKind::Choose(mut nodes) if nodes[1..].iter().all(is_same) => {
                let values = nodes.split_off(1).into_iter();
                for value in values {
                    nodes.push(self.worked_out_in(value, to)?);
                }
                let kind = NodeKind::Choose(nodes);
                Ok(Node { ty: wide, kind, at })
            }
            kind => {
                let node = Node { ty, kind, at };
                match ty {
                    Type::Scalar(from) => Ok(self.converted(from, to, node)),
                    _ => Ok(node),
                }
            }
        }
    }

    /// A value as one of this type, which it becomes by itself or not at all.
    pub(super) fn coerce(&mut self, node: Node, to: Type) -> Read<Node> {
        let at = node.at;
        match (&node.kind, node.ty, to) {
            (_, from, to) if from == to => Ok(node),
            (_, Type::Text(short), Type::Text(length)) if short < length => Ok(Node { ty: to, ..node }),
            (_, Type::Text(_), Type::Scalar(Scalar::String)) => Ok(Node { ty: to, ..node }),
            (_, from, Type::Text(length)) if from.scalar() == Some(Scalar::String) => Ok(self.cut(node, length)),
            (NodeKind::Integer(value @ (0 | 1)), _, Type::Scalar(Scalar::Bool)) => {
                Ok(Node::constant(to, *value as i64, at))
            }
            (NodeKind::Integer(value), _, Type::Scalar(Scalar::Bool)) => {
                let value = value.to_string();
                self.error(at, Kind::NumberForBool { value })
            }
            (NodeKind::Integer(value), _, Type::Scalar(scalar)) if scalar.is_integer() || scalar.is_bit_string() => {
                let (low, high) = scalar.range();
                // A bit string takes what is written as it is.
                let slot = scalar.wrap(*value);
                if !slot.1 {
                    return Ok(Node::constant(to, slot.0, at));
                }
                let value = value.to_string();
                let (low, high) = (low.to_string(), high.to_string());
                self.error(
                    at,
                    Kind::OutOfRange {
                        value,
                        ty: scalar.name(),
                        low,
                        high,
                    },
                )
            }
            (NodeKind::Integer(value), _, Type::Scalar(scalar)) if scalar.is_real() => {
                Ok(Node::constant(to, arithmetic::of_real(scalar, *value as f64), at))
            }
            (NodeKind::Real(value), _, Type::Scalar(scalar)) if scalar.is_real() => {
                let slot = arithmetic::of_real(scalar, *value);
                if f64::from_bits(slot as u64).is_finite() {
                    return Ok(Node::constant(to, slot, at));
                }
                let (value, low, high) = (value.to_string(), f32::MIN.to_string(), f32::MAX.to_string());
                self.error(
                    at,
                    Kind::OutOfRange {
                        value,
                        ty: scalar.name(),
                        low,
                        high,
                    },
                )
            }
            (_, Type::Scalar(from), Type::Scalar(scalar)) if from.widens_to(scalar) => {
                // Below a real number `/` and MOD are those of integers.
                let is_whole = from.is_integer() && scalar.is_real();
                let node = self.worked_out_in(node, if is_whole { Scalar::Lint } else { scalar })?;
                let from = node.ty.scalar().unwrap_or(from);
                Ok(self.converted(from, scalar, node))
            }
            (_, from, to) => {
                let cure_text = match (from, to) {
                    (Type::Scalar(from), Type::Scalar(to)) if from != Scalar::String && to != Scalar::String => {
                        Some(format!("write {}_TO_{}(..)", from.name(), to.name()))
                    }
                    (Type::AnyReal, Type::Scalar(to)) if to.is_integer() => {
                        Some(format!("write LREAL_TO_{}(..)", to.name()))
                    }
                    (Type::AnyInteger, Type::Scalar(Scalar::Time)) => time_cure(&node),
                    (Type::AnyReal, Type::Scalar(Scalar::Time)) => Some("write T#1.5s".into()),
                    _ => None,
                };
                let (from, to) = (self.type_name(from), self.type_name(to));
                self.error(at, Kind::Mismatch { from, to, cure_text })
            }
        }
    }

    /// Values that become one type by themselves; `None` if there is none. Beside a real literal integers become REAL or LREAL,
    /// whichever is expected and holds them.
    pub(super) fn common(&mut self, nodes: &[Node], expected: Option<Type>) -> Option<Type> {
        let real = if expected == Some(LREAL) {
            Scalar::Lreal
        } else {
            Scalar::Real
        };
        let typed = nodes.iter().map(|node| node.ty);
        let mut common = None;
        for ty in typed {
            common = match (common, ty) {
                (None, ty) => Some(ty),
                (Some(known), ty) if known == ty => Some(known),
                (Some(Type::AnyInteger), Type::AnyReal) | (Some(Type::AnyReal), Type::AnyInteger) => {
                    Some(Type::AnyReal)
                }
                (Some(Type::AnyReal), Type::Scalar(scalar)) | (Some(Type::Scalar(scalar)), Type::AnyReal)
                    if scalar.is_integer() =>
                {
                    Some(Type::Scalar(scalar.common(real)?))
                }
                (Some(Type::AnyInteger | Type::AnyReal), ty) => Some(ty),
                (Some(known), Type::AnyInteger | Type::AnyReal) => Some(known),
                (Some(a), b) if [a, b].iter().all(|ty| ty.scalar() == Some(Scalar::String)) => {
                    Some(Type::Scalar(Scalar::String))
                }
                (Some(Type::Scalar(a)), Type::Scalar(b)) => Some(Type::Scalar(a.common(b)?)),
                _ => return None,
            };
        }
        common
    }
}

/// Whether an operator or function takes bit strings.
fn is_bitwise(operator: &str) -> bool {
    let base = operator.split('_').next().unwrap_or(operator);
    matches!(base, "NOT" | "AND" | "OR" | "XOR" | "SHL" | "SHR" | "ROL" | "ROR")
}

/// What an integer is written like where a TIME is meant.
fn time_cure(node: &Node) -> Option<String> {
    match node.kind {
        NodeKind::Integer(value) => Some(format!("write T#{value}ms")),
        _ => None,
    }
}
