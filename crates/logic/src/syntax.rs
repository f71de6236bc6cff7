//! A file as it is written: declarations and statements with their places, before anything is known of types.

use crate::diagnostic::Span;
use std::rc::Rc;

/// A name as it is written; compared without its case.
#[derive(Clone, Debug)]
pub(crate) struct Name {
    pub(crate) text: String,
    pub(crate) at: Span,
}

impl Name {
    /// What two names are compared by.
    pub(crate) fn key(&self) -> String {
        key(&self.text)
    }
}

/// What a name is compared by.
pub(crate) fn key(name: &str) -> String {
    name.to_ascii_lowercase()
}

/// A whole file.
#[derive(Debug, Default)]
pub(crate) struct File {
    pub(crate) types: Vec<TypeDeclaration>,
    pub(crate) globals: Vec<Variable>,
    pub(crate) units: Vec<Unit>,
    /// VAR_CONFIG.
    pub(crate) placed: Vec<Placed>,
    /// RESOURCE, and programs of CONFIGURATION with their types.
    pub(crate) resources: Vec<Name>,
    pub(crate) instances: Vec<(Name, Name)>,
}

/// `resource.program.variable AT %IX0.0 : BOOL;`
#[derive(Debug)]
pub(crate) struct Placed {
    pub(crate) path: Vec<Name>,
    pub(crate) address: (String, Span),
    pub(crate) ty: TypeText,
}

/// `name : ty := initial;` in TYPE.
#[derive(Debug)]
pub(crate) struct TypeDeclaration {
    pub(crate) name: Name,
    pub(crate) ty: TypeText,
    pub(crate) initial: Option<Initial>,
}

/// A type as it is written.
#[derive(Clone, Debug)]
pub(crate) struct TypeText {
    pub(crate) kind: TypeKind,
    pub(crate) at: Span,
}

#[derive(Clone, Debug)]
pub(crate) enum TypeKind {
    Named(Name),
    Array(Vec<(Expression, Expression)>, Box<TypeText>),
    /// `STRING[20]`
    Text(Box<Expression>),
    /// In TYPE only.
    Struct(Vec<Variable>),
    /// In TYPE only; values that are given.
    Enumeration(Vec<(Name, Option<Expression>)>),
    /// What is wrong with it has been told.
    Wrong,
}

/// Behind `:=` of a declaration.
#[derive(Clone, Debug)]
pub(crate) enum Initial {
    Value(Expression),
    /// `[1, 2(0)]`, each with how often it comes.
    List(Vec<(Option<Expression>, Initial)>, Span),
    /// In a list what is repeated as it is: `3()`
    Default(Span),
    /// `(x := 1, y := 2)`
    Members(Vec<(Name, Initial)>, Span),
}

impl Initial {
    /// Where it stands.
    pub(crate) fn at(&self) -> Span {
        match self {
            Initial::Value(value) => value.at,
            Initial::List(_, at) | Initial::Members(_, at) | Initial::Default(at) => *at,
        }
    }
}

/// What kind of VAR a variable stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Section {
    Local,
    Input,
    Output,
    InOut,
    Temporary,
    /// VAR_IN_OUT of a program: a variable of its own, which the outside reads or writes.
    Shared,
    Global,
    External,
}

/// A declaration of one variable.
#[derive(Clone, Debug)]
pub(crate) struct Variable {
    pub(crate) name: Name,
    pub(crate) section: Section,
    pub(crate) constant: bool,
    pub(crate) retain: bool,
    /// `AT %IX0.0`, `AT 'io.5.in-03'`
    pub(crate) address: Option<(String, Span)>,
    /// R_EDGE: true, F_EDGE: false.
    pub(crate) edge: Option<bool>,
    /// Shared by all names of a declaration.
    pub(crate) ty: Rc<TypeText>,
    pub(crate) initial: Option<Rc<Initial>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnitKind {
    Program,
    Function,
    Block,
}

impl UnitKind {
    pub(crate) fn name(self) -> &'static str {
        match self {
            UnitKind::Program => "PROGRAM",
            UnitKind::Function => "FUNCTION",
            UnitKind::Block => "FUNCTION_BLOCK",
        }
    }
}

/// A PROGRAM, FUNCTION or FUNCTION_BLOCK.
#[derive(Debug)]
pub(crate) struct Unit {
    pub(crate) kind: UnitKind,
    pub(crate) name: Name,
    pub(crate) result: Option<TypeText>,
    pub(crate) variables: Vec<Variable>,
    /// It has more variables than these, which are not supported.
    pub(crate) extends: bool,
    /// Methods and actions, which are not supported either.
    pub(crate) refused: Vec<Name>,
    pub(crate) body: Vec<Statement>,
}

#[derive(Clone, Debug)]
pub(crate) struct Expression {
    pub(crate) kind: ExpressionKind,
    pub(crate) at: Span,
    /// How deep it is nested: what walks through it calls itself so often.
    pub(crate) depth: u32,
}

impl Expression {
    /// Variables that it reads are added to these, but no more than so many in all.
    pub(crate) fn reads(&self, all: &mut Vec<Access>, most: usize) {
        if all.len() >= most {
            return;
        }
        match &self.kind {
            ExpressionKind::Variable(access) => {
                for step in &access.steps {
                    if let Step::Index(indices, _) = step {
                        indices.iter().for_each(|index| index.reads(all, most));
                    }
                }
                all.push(access.clone());
            }
            ExpressionKind::Unary(_, operand) | ExpressionKind::Typed(_, operand) => operand.reads(all, most),
            ExpressionKind::Binary(_, left, right) => {
                left.reads(all, most);
                right.reads(all, most);
            }
            ExpressionKind::Call(_, arguments) => {
                for argument in arguments {
                    if let ArgumentValue::Given(value) = &argument.value {
                        value.reads(all, most);
                    }
                }
            }
            ExpressionKind::Integer(_)
            | ExpressionKind::Real(_)
            | ExpressionKind::Bool(_)
            | ExpressionKind::Time(_)
            | ExpressionKind::Text(_)
            | ExpressionKind::Wrong => {}
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) enum ExpressionKind {
    Integer(i128),
    Real(f64),
    Bool(bool),
    Time(i64),
    Text(String),
    /// `INT#5`, `Colour#Red`
    Typed(Name, Box<Expression>),
    Variable(Access),
    Unary(Unary, Box<Expression>),
    Binary(Binary, Box<Expression>, Box<Expression>),
    Call(Name, Vec<Argument>),
    /// What is wrong with it has been told.
    Wrong,
}

/// A variable, an element or a member.
#[derive(Clone, Debug)]
pub(crate) struct Access {
    pub(crate) name: Name,
    pub(crate) steps: Vec<Step>,
    pub(crate) at: Span,
}

#[derive(Clone, Debug)]
pub(crate) enum Step {
    Member(Name),
    Index(Vec<Expression>, Span),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unary {
    Minus,
    Plus,
    Not,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[rustfmt::skip]
pub(crate) enum Binary {
    Power, Multiply, Divide, Modulo, Add, Subtract, Less, Greater, LessEqual, GreaterEqual, Equal, NotEqual,
    And, AndThen, Xor, Or, OrElse,
}

impl Binary {
    /// Each operator with its word and how strongly it binds. All are left-associative.
    #[rustfmt::skip]
    pub(crate) const ALL: [(Binary, &'static str, u8); 18] = [
        (Binary::Power, "**", 8),
        (Binary::Multiply, "*", 7), (Binary::Divide, "/", 7), (Binary::Modulo, "MOD", 7),
        (Binary::Add, "+", 6), (Binary::Subtract, "-", 6),
        (Binary::Less, "<", 5), (Binary::Greater, ">", 5), (Binary::LessEqual, "<=", 5), (Binary::GreaterEqual, ">=", 5),
        (Binary::Equal, "=", 4), (Binary::NotEqual, "<>", 4),
        (Binary::And, "AND", 3), (Binary::And, "&", 3), (Binary::AndThen, "AND_THEN", 3),
        (Binary::Xor, "XOR", 2),
        (Binary::Or, "OR", 1), (Binary::OrElse, "OR_ELSE", 1),
    ];

    pub(crate) fn word(self) -> &'static str {
        let found = Binary::ALL.iter().find(|(operator, ..)| *operator == self);
        found.map_or("", |(_, word, _)| word)
    }

    /// Whether the result is a BOOL whatever is compared.
    pub(crate) fn compares(self) -> bool {
        use Binary::*;
        matches!(self, Less | Greater | LessEqual | GreaterEqual | Equal | NotEqual)
    }
}

/// An argument of a call.
#[derive(Clone, Debug)]
pub(crate) struct Argument {
    pub(crate) name: Option<Name>,
    /// `NOT Q => y`
    pub(crate) inverted: bool,
    pub(crate) value: ArgumentValue,
}

#[derive(Clone, Debug)]
pub(crate) enum ArgumentValue {
    /// `x`, `IN := x`
    Given(Expression),
    /// `Q => y`
    Taken(Access),
}

#[derive(Clone, Debug)]
pub(crate) struct Statement {
    pub(crate) kind: StatementKind,
    pub(crate) at: Span,
}

#[derive(Clone, Debug)]
pub(crate) enum StatementKind {
    Assign(Access, Expression),
    Call(Access, Vec<Argument>),
    /// Conditions with what they lead to; what else.
    If(Vec<(Expression, Vec<Statement>)>, Option<(Span, Vec<Statement>)>),
    Case {
        selector: Expression,
        branches: Vec<(Vec<Label>, Vec<Statement>)>,
        otherwise: Option<(Span, Vec<Statement>)>,
    },
    For {
        control: Name,
        from: Expression,
        to: Expression,
        by: Option<Expression>,
        bound: Option<u32>,
        body: Vec<Statement>,
    },
    While {
        condition: Expression,
        bound: Option<u32>,
        body: Vec<Statement>,
    },
    Repeat {
        until: Expression,
        bound: Option<u32>,
        body: Vec<Statement>,
    },
    Exit,
    Continue,
    Return,
}

/// One value, or the first and last of a range.
#[derive(Clone, Debug)]
pub(crate) struct Label {
    pub(crate) first: Expression,
    pub(crate) last: Option<Expression>,
}
