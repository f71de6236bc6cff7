//! Operators: which types they take together, and what that makes.

use super::expression::{BOOL, Checker, LREAL, Read};
use super::tree::{Node, NodeKind};
use super::types::Type;
use crate::arithmetic::Binary;
use crate::diagnostic::{Kind, Span};
use crate::scalar::Scalar;
use crate::syntax;

impl Checker<'_, '_, '_> {
    /// `a + b` of what has been checked.
    pub(super) fn operator(
        &mut self,
        operator: syntax::Binary,
        left: Node,
        right: Node,
        expected: Option<Type>,
        at: Span,
    ) -> Read<Node> {
        use syntax::Binary as Word;
        match operator {
            Word::Add | Word::Subtract | Word::Multiply | Word::Divide | Word::Modulo => {
                self.arithmetic(operator, left, right, expected, at)
            }
            Word::Power => self.power(left, right, expected, at),
            Word::And | Word::Or | Word::Xor => self.bitwise(operator, [left, right], expected, at),
            Word::AndThen | Word::OrElse => {
                let left = self.coerce(left, BOOL)?;
                let right = Box::new(self.coerce(right, BOOL)?);
                let kind = match operator {
                    Word::AndThen => NodeKind::AndThen(Box::new(left), right),
                    _ => NodeKind::OrElse(Box::new(left), right),
                };
                Ok(Node { ty: BOOL, kind, at })
            }
            Word::Less | Word::Greater | Word::LessEqual | Word::GreaterEqual | Word::Equal | Word::NotEqual => {
                self.comparison(operator, vec![left, right], at)
            }
        }
    }

    fn no_operands<T>(&mut self, operator: &str, left: Type, right: Type, at: Span) -> Read<T> {
        let cure_text = match (left, right) {
            (Type::Scalar(Scalar::Bool), Type::AnyInteger) | (Type::AnyInteger, Type::Scalar(Scalar::Bool)) => {
                Some("write TRUE or FALSE".to_owned())
            }
            (Type::Scalar(left), Type::Scalar(right)) if left.is_integer() && right.is_real() => {
                Some(format!("write {}_TO_{}(..)", left.name(), right.name()))
            }
            (Type::Scalar(left), Type::Scalar(right)) if left.is_real() && right.is_integer() => {
                Some(format!("write {}_TO_{}(..)", right.name(), left.name()))
            }
            (Type::Scalar(left), Type::Scalar(right)) if left.is_bit_string() && right.is_bit_string() => {
                let (narrow, wide) = if left.bits() < right.bits() {
                    (left, right)
                } else {
                    (right, left)
                };
                Some(format!("write {}_TO_{}(..)", narrow.name(), wide.name()))
            }
            (Type::Scalar(scalar), Type::AnyReal) | (Type::AnyReal, Type::Scalar(scalar)) if scalar.is_integer() => {
                Some(format!("write {}_TO_LREAL(..)", scalar.name()))
            }
            _ => None,
        };
        let (left, right) = (self.type_name(left), self.type_name(right));
        let operator = operator.to_owned();
        self.error(
            at,
            Kind::Operands {
                operator,
                left,
                right,
                cure_text,
            },
        )
    }

    fn arithmetic(
        &mut self,
        word: syntax::Binary,
        left: Node,
        right: Node,
        expected: Option<Type>,
        at: Span,
    ) -> Read<Node> {
        use syntax::Binary as Word;
        let operation = match word {
            Word::Add => Binary::Add,
            Word::Subtract => Binary::Subtract,
            Word::Multiply => Binary::Multiply,
            Word::Divide => Binary::Divide,
            _ => Binary::Modulo,
        };
        const TIME: Type = Type::Scalar(Scalar::Time);
        let scales = matches!(word, Word::Multiply | Word::Divide);
        if left.ty == TIME && scales && right.ty != TIME {
            return self.scaled(operation, left, right, at);
        }
        if right.ty == TIME && word == Word::Multiply && left.ty != TIME {
            return self.scaled(operation, right, left, at);
        }
        let types = (left.ty, right.ty);
        let pair = [left, right];
        let Some(common) = self.common(&pair, expected) else {
            return self.no_operands(word.word(), types.0, types.1, at);
        };
        let common = wide_enough(common, &pair, expected);
        let scalar = match common {
            Type::AnyInteger | Type::AnyReal => return self.literals(operation, &pair, common, at),
            Type::Scalar(Scalar::Time) if !scales && word != Word::Modulo => Scalar::Time,
            Type::Scalar(scalar) if scalar.is_integer() || scalar.is_real() && word != Word::Modulo => scalar,
            _ => {
                let [left, right] = &pair;
                let culprit = if matches!(left.ty, Type::AnyInteger | Type::AnyReal) {
                    right
                } else {
                    left
                };
                let culprit = culprit.clone();
                return self.no_operand(word.word(), &culprit);
            }
        };
        let [left, right] = pair;
        let pair = [self.coerce(left, common)?, self.coerce(right, common)?];
        self.folded_pair(operation, scalar, pair, common, at)
    }

    /// Two literals together are a literal.
    fn literals(&mut self, operation: Binary, pair: &[Node; 2], common: Type, at: Span) -> Read<Node> {
        let [NodeKind::Integer(a), NodeKind::Integer(b)] = [&pair[0].kind, &pair[1].kind] else {
            let [left, right] = [
                self.settle(pair[0].clone(), Some(LREAL))?,
                self.settle(pair[1].clone(), Some(LREAL))?,
            ];
            if operation == Binary::Modulo {
                return self.no_operand("MOD", &left);
            }
            let mut node = self.folded_pair(operation, Scalar::Lreal, [left, right], LREAL, at)?;
            if let Some(slot) = node.value() {
                (node.ty, node.kind) = (common, NodeKind::Real(f64::from_bits(slot as u64)));
            }
            return Ok(node);
        };
        let result = match operation {
            Binary::Add => a.checked_add(*b),
            Binary::Subtract => a.checked_sub(*b),
            Binary::Multiply => a.checked_mul(*b),
            _ if *b == 0 => return self.error(pair[1].at, Kind::DivisionByZero),
            Binary::Divide => a.checked_div(*b),
            _ => a.checked_rem(*b),
        };
        // Beyond all types, but small enough that no sum of such overflows.
        match result.filter(|value| value.unsigned_abs() < 1 << 100) {
            Some(value) => Ok(Node {
                ty: common,
                kind: NodeKind::Integer(value),
                at,
            }),
            None => {
                let (low, high) = Scalar::Lint.range();
                let (value, low, high) = ("this".into(), low.to_string(), high.to_string());
                self.error(
                    at,
                    Kind::OutOfRange {
                        value,
                        ty: "LINT",
                        low,
                        high,
                    },
                )
            }
        }
    }

    /// TIME times or through a number.
    fn scaled(&mut self, operation: Binary, time: Node, number: Node, at: Span) -> Read<Node> {
        let mut number = self.settle(number, None)?;
        if number.ty.scalar().is_some_and(|scalar| scalar.widens_to(Scalar::Lint)) {
            number = self.coerce(number, Type::Scalar(Scalar::Lint))?;
        }
        let ty = time.ty;
        match number.ty {
            Type::Scalar(Scalar::Lint) => {
                // As a count of nanoseconds both are of one type.
                self.folded_pair(operation, Scalar::Time, [time, number], ty, at)
            }
            Type::Scalar(scalar) if scalar.is_real() => {
                let operation = if operation == Binary::Multiply {
                    Binary::ScaleUp
                } else {
                    Binary::ScaleDown
                };
                self.folded_pair(operation, Scalar::Time, [time, number], ty, at)
            }
            other => {
                let word = if operation == Binary::Multiply { "*" } else { "/" };
                self.no_operands(word, ty, other, at)
            }
        }
    }

    fn power(&mut self, left: Node, right: Node, expected: Option<Type>, at: Span) -> Read<Node> {
        let is_real = |ty: &Type| ty.scalar().is_some_and(Scalar::is_real);
        let of_literal = expected.filter(is_real).or(Some(right.ty).filter(is_real));
        let base = self.settle(left, of_literal.or(Some(LREAL)))?;
        let exponent = self.settle(right, Some(LREAL))?;
        let Some(scalar) = base.ty.scalar().filter(|scalar| scalar.is_real()) else {
            return self.no_operand("**", &base);
        };
        let Some(of_exponent) = exponent.ty.scalar().filter(|scalar| scalar.is_number()) else {
            return self.no_operand("**", &exponent);
        };
        let ty = base.ty;
        let exponent = if of_exponent.widens_to(Scalar::Lreal) {
            self.coerce(exponent, LREAL)?
        } else {
            self.converted(of_exponent, Scalar::Lreal, exponent)
        };
        self.folded_pair(Binary::Power, scalar, [base, exponent], ty, at)
    }

    fn bitwise(&mut self, word: syntax::Binary, pair: [Node; 2], expected: Option<Type>, at: Span) -> Read<Node> {
        let operation = match word {
            syntax::Binary::And => Binary::And,
            syntax::Binary::Or => Binary::Or,
            _ => Binary::Xor,
        };
        let suits = |ty: Type| matches!(ty, Type::Scalar(scalar) if scalar == Scalar::Bool || scalar.is_bit_string());
        // Two literals are bits where nothing else is wanted.
        if let [NodeKind::Integer(a), NodeKind::Integer(b)] = [&pair[0].kind, &pair[1].kind]
            && *a >= 0
            && *b >= 0
            && expected.is_none_or(suits)
        {
            let value = match operation {
                Binary::And => a & b,
                Binary::Or => a | b,
                _ => a ^ b,
            };
            let (ty, kind) = (Type::AnyInteger, NodeKind::Integer(value));
            return Ok(Node { ty, kind, at });
        }
        let common = self.common(&pair, None);
        let [left, right] = pair;
        match common {
            Some(ty @ Type::Scalar(scalar)) if suits(ty) => {
                let pair = [self.coerce(left, ty)?, self.coerce(right, ty)?];
                self.folded_pair(operation, scalar, pair, ty, at)
            }
            _ => {
                let is_open = |node: &Node| matches!(node.ty, Type::AnyInteger | Type::AnyReal);
                if suits(left.ty) && suits(right.ty) {
                    return self.no_operands(word.word(), left.ty, right.ty, at);
                }
                let culprit = if suits(left.ty) || (is_open(&left) && !suits(right.ty)) {
                    &right
                } else {
                    &left
                };
                let culprit = culprit.clone();
                self.no_operand(word.word(), &culprit)
            }
        }
    }

    /// Values in a row, each compared with the next one.
    pub(super) fn comparison(&mut self, word: syntax::Binary, mut nodes: Vec<Node>, at: Span) -> Read<Node> {
        use syntax::Binary as Word;
        let operation = match word {
            Word::Less => Binary::Less,
            Word::Greater => Binary::Greater,
            Word::LessEqual => Binary::LessEqual,
            Word::GreaterEqual => Binary::GreaterEqual,
            Word::Equal => Binary::Equal,
            _ => Binary::NotEqual,
        };
        let equality = matches!(word, Word::Equal | Word::NotEqual);
        let first = nodes.first().map_or(BOOL, |node| node.ty);
        let other = nodes
            .iter()
            .map(|node| node.ty)
            .find(|ty| *ty != first)
            .unwrap_or(first);
        let Some(mut common) = self.common(&nodes, None) else {
            return self.no_operands(word.word(), first, other, at);
        };
        common = match common {
            Type::AnyInteger => Type::Scalar(Scalar::Lint),
            Type::AnyReal => LREAL,
            Type::Text(_) => Type::Scalar(Scalar::String),
            // What is worked out of integers below 32 bits is worked out in 32 bits, as others do it.
            Type::Scalar(scalar)
                if scalar.is_integer() && scalar.bits() < 32 && nodes.iter().any(Node::is_worked_out) =>
            {
                Type::Scalar(Scalar::Dint)
            }
            other => other,
        };
        let mut scalar = match common {
            Type::Scalar(scalar) => scalar,
            Type::Enumeration(_) if equality => Scalar::Dint,
            _ => return self.no_operands(word.word(), first, other, at),
        };
        if scalar.is_real() && equality {
            let ty = scalar.name();
            self.compiler.told.warning(at, Kind::RealEqual { ty });
        }
        for node in &mut nodes {
            *node = self.coerce(node.clone(), common)?;
        }
        // Equal texts have one number; which of others comes first is looked up.
        if scalar == Scalar::String && !equality {
            scalar = Scalar::Dint;
            self.ranks(&mut nodes);
        }
        let mut rest = nodes.into_iter();
        match (rest.next(), rest.next(), rest.next()) {
            (Some(left), Some(right), None) => self.folded_pair(operation, scalar, [left, right], BOOL, at),
            (first, second, third) => {
                let nodes = [first, second, third].into_iter().flatten().chain(rest).collect();
                let kind = NodeKind::Row(operation, scalar, nodes);
                Ok(Node { ty: BOOL, kind, at })
            }
        }
    }

    /// Texts to their places in the order of all.
    fn ranks(&self, nodes: &mut [Node]) {
        let text = |node: &Node| {
            let number = usize::try_from(node.value()?).ok()?;
            self.compiler.texts.get(number).cloned()
        };
        let known: Option<Vec<String>> = nodes.iter().map(text).collect();
        let sorted = known.clone().map(|mut texts| {
            texts.sort();
            texts
        });
        for (index, node) in nodes.iter_mut().enumerate() {
            let rank = match (&known, &sorted) {
                (Some(texts), Some(sorted)) => {
                    NodeKind::Constant(sorted.partition_point(|text| *text < texts[index]) as i64)
                }
                _ => NodeKind::Rank(Box::new(node.clone())),
            };
            (node.kind, node.ty) = (rank, Type::Scalar(Scalar::Dint));
        }
    }
}

/// The type in which two values of a common one are worked out: the one that is wanted where that is wider, and one that holds
/// the literals where none is wanted.
fn wide_enough(common: Type, pair: &[Node; 2], expected: Option<Type>) -> Type {
    let Type::Scalar(scalar) = common else { return common };
    let wanted = expected.and_then(Type::scalar).filter(|wanted| wanted.is_number());
    let is_alike = |wanted: Scalar| wanted.is_integer() == scalar.is_integer();
    match wanted {
        Some(wanted) if is_alike(wanted) && scalar.widens_to(wanted) => return Type::Scalar(wanted),
        Some(wanted) if is_alike(wanted) => return common,
        _ if !scalar.is_integer() => return common,
        _ => {}
    }
    let holds = |wide: &Scalar| {
        let (low, high) = wide.range();
        pair.iter().all(|node| match node.kind {
            NodeKind::Integer(value) => (low..=high).contains(&value),
            _ => true,
        })
    };
    let mut wider = Scalar::ALL
        .into_iter()
        .filter(|wide| wide.is_integer() && scalar.widens_to(*wide));
    wider.find(holds).map_or(common, Type::Scalar)
}
