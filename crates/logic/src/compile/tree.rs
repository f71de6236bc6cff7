//! Expressions whose names and types are known.

use super::types::Type;
use crate::arithmetic::{Binary, Unary};
use crate::diagnostic::Span;
use crate::scalar::Scalar;

#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) ty: Type,
    pub(super) kind: NodeKind,
    pub(super) at: Span,
}

#[derive(Clone, Debug)]
pub(super) enum NodeKind {
    /// A literal that has no type yet.
    Integer(i128),
    Real(f64),
    Constant(i64),
    Load(Box<Place>),
    Unary(Unary, Scalar, Box<Node>),
    Binary(Binary, Scalar, Box<Node>, Box<Node>),
    Convert(Scalar, Scalar, Box<Node>),
    /// The first so many characters of a text.
    Cut(u32, Box<Node>),
    /// The place of a text in the order of all.
    Rank(Box<Node>),
    /// Whether each stands so to the next one.
    Row(Binary, Scalar, Vec<Node>),
    AndThen(Box<Node>, Box<Node>),
    OrElse(Box<Node>, Box<Node>),
    Select(Box<[Node; 3]>),
    Choose(Vec<Node>),
    /// Unit; values with the offsets of the inputs that they go to.
    Call(usize, Vec<(u32, Node)>),
}

/// What the address of something is counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Base {
    Global,
    This,
    /// The address that a slot holds; a slot of `this`.
    GlobalReference(u32),
    ThisReference(u32),
}

/// A variable, element or member.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) base: Base,
    pub(super) offset: u32,
    /// Indices that are not constant.
    pub(super) indices: Vec<Index>,
    pub(super) ty: Type,
    /// Why it is not assigned.
    pub(super) read_only: Option<&'static str>,
    /// What it is, as it is written.
    pub(super) name: String,
    pub(super) at: Span,
}

#[derive(Clone, Debug)]
pub(super) struct Index {
    pub(super) value: Node,
    pub(super) low: i32,
    pub(super) length: u32,
    pub(super) stride: u32,
}

impl Node {
    pub(super) fn constant(ty: Type, value: i64, at: Span) -> Node {
        let kind = NodeKind::Constant(value);
        Node { ty, kind, at }
    }

    /// Whether operators make it of other values.
    pub(super) fn is_worked_out(&self) -> bool {
        match &self.kind {
            NodeKind::Unary(..) | NodeKind::Binary(..) => true,
            NodeKind::Select(operands) => operands[1..].iter().any(Node::is_worked_out),
            NodeKind::Choose(nodes) => nodes[1..].iter().any(Node::is_worked_out),
            _ => false,
        }
    }

    /// The slot of a constant that has a type.
    pub(super) fn value(&self) -> Option<i64> {
        match self.kind {
            NodeKind::Constant(value) => Some(value),
            _ => None,
        }
    }
}
