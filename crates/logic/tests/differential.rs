//! The compiled program beside an evaluator of its own kind: random programs, written as text and walked as trees, which share
//! nothing but the rules of the language.

use crate::common;

use common::{get, set, start};
use proptest::prelude::*;
use std::fmt::Write as _;

/// Integers by their widths; whether they are signed.
const TYPES: [(&str, u32, bool); 8] = [
    ("SINT", 8, true),
    ("INT", 16, true),
    ("DINT", 32, true),
    ("LINT", 64, true),
    ("USINT", 8, false),
    ("UINT", 16, false),
    ("UDINT", 32, false),
    ("ULINT", 64, false),
];
const VARIABLES: usize = 4;
const LENGTH: i128 = 5;

/// An integer expression of the program's type, or a condition.
#[derive(Clone, Debug)]
enum Tree {
    Number(i128),
    Variable(usize),
    Element(Box<Tree>),
    Operation(&'static str, Box<Tree>, Box<Tree>),
    Select(Box<Tree>, Box<Tree>, Box<Tree>),
    Function(Box<Tree>, Box<Tree>),
    Compare(&'static str, Box<Tree>, Box<Tree>),
    Logic(&'static str, Box<Tree>, Box<Tree>),
    Not(Box<Tree>),
}

#[derive(Clone, Debug)]
enum Step {
    Assign(usize, Tree),
    AssignElement(Tree, Tree),
    If(Tree, Vec<Step>, Vec<Step>),
    Case(Tree, Vec<Step>, Vec<Step>, Vec<Step>),
    For(i128, i128, i128, Vec<Step>),
    While(Tree, u32, Vec<Step>),
    Repeat(Tree, u32, Vec<Step>),
    Exit,
    Continue,
}

fn number() -> impl Strategy<Value = Tree> {
    prop_oneof![Just(0), Just(1), Just(2), Just(3), Just(7), Just(100), Just(127)].prop_map(Tree::Number)
}

fn condition(tree: impl Strategy<Value = Tree> + Clone + 'static) -> impl Strategy<Value = Tree> + Clone {
    let compare = (
        prop::sample::select(vec!["<", ">", "<=", ">=", "=", "<>"]),
        tree.clone(),
        tree,
    )
        .prop_map(|(word, a, b)| Tree::Compare(word, Box::new(a), Box::new(b)));
    compare.prop_recursive(2, 6, 2, |inner| {
        let words = prop::sample::select(vec!["AND", "OR", "XOR", "AND_THEN", "OR_ELSE"]);
        prop_oneof![
            (words, inner.clone(), inner.clone()).prop_map(|(word, a, b)| Tree::Logic(word, Box::new(a), Box::new(b))),
            inner.prop_map(|a| Tree::Not(Box::new(a))),
        ]
    })
}

fn tree() -> impl Strategy<Value = Tree> + Clone {
    let leaf = prop_oneof![number(), (0..VARIABLES).prop_map(Tree::Variable)];
    leaf.prop_recursive(4, 20, 3, |inner| {
        let words = prop::sample::select(vec!["+", "-", "*", "/", "MOD"]);
        prop_oneof![
            4 => (words, inner.clone(), inner.clone()).prop_map(|(word, a, b)| Tree::Operation(word, Box::new(a), Box::new(b))),
            1 => inner.clone().prop_map(|a| Tree::Element(Box::new(a))),
            1 => (condition(inner.clone()), inner.clone(), inner.clone())
                .prop_map(|(c, a, b)| Tree::Select(Box::new(c), Box::new(a), Box::new(b))),
            1 => (inner.clone(), inner).prop_map(|(a, b)| Tree::Function(Box::new(a), Box::new(b))),
        ]
    })
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let leaf = prop_oneof![
        6 => (0..VARIABLES, tree()).prop_map(|(variable, value)| Step::Assign(variable, value)),
        2 => (tree(), tree()).prop_map(|(index, value)| Step::AssignElement(index, value)),
        1 => Just(Step::Exit),
        1 => Just(Step::Continue),
    ];
    let step = leaf.prop_recursive(3, 16, 4, |inner| {
        let list = prop::collection::vec(inner, 1..4);
        prop_oneof![
            (condition(tree()), list.clone(), list.clone()).prop_map(|(c, a, b)| Step::If(c, a, b)),
            (tree(), list.clone(), list.clone(), list.clone()).prop_map(|(s, a, b, c)| Step::Case(s, a, b, c)),
            (0..5_i128, 0..9_i128, 1..3_i128, list.clone()).prop_map(|(a, b, by, body)| Step::For(a, b, by, body)),
            (condition(tree()), 1..6_u32, list.clone()).prop_map(|(c, most, body)| Step::While(c, most, body)),
            (condition(tree()), 1..6_u32, list).prop_map(|(c, most, body)| Step::Repeat(c, most, body)),
        ]
    });
    prop::collection::vec(step, 1..6)
}

// Written as text.

fn text_of(tree: &Tree) -> String {
    match tree {
        // The type is put in at the end; without one a literal alone has a type of its own.
        Tree::Number(value) => format!("?#{value}"),
        Tree::Variable(index) => format!("v{index}"),
        // An index or a divisor that is constant and wrong would be refused; with a zero of a variable it is wrong in the scan.
        Tree::Element(index) => format!("l[zero + {}]", text_of(index)),
        Tree::Operation(word @ ("/" | "MOD"), a, b) => format!("({} {word} (zero + {}))", text_of(a), text_of(b)),
        Tree::Operation(word, a, b) | Tree::Compare(word, a, b) | Tree::Logic(word, a, b) => {
            format!("({} {word} {})", text_of(a), text_of(b))
        }
        Tree::Select(c, a, b) => format!("SEL({}, {}, {})", text_of(c), text_of(a), text_of(b)),
        Tree::Function(a, b) => format!("f({}, b := {})", text_of(a), text_of(b)).replacen("f(", "f(a := ", 1),
        Tree::Not(a) => format!("NOT {}", text_of(a)),
    }
}

/// Statements; `loops`: how many are around, each with a control variable of its own.
fn write_steps(steps: &[Step], loops: usize, text: &mut String) {
    for step in steps {
        let _ = match step {
            Step::Assign(variable, value) => writeln!(text, "v{variable} := {};", text_of(value)),
            Step::AssignElement(index, value) => writeln!(text, "l[zero + {}] := {};", text_of(index), text_of(value)),
            Step::If(condition, then, otherwise) => {
                let _ = writeln!(text, "IF {} THEN", text_of(condition));
                write_steps(then, loops, text);
                let _ = writeln!(text, "ELSE");
                write_steps(otherwise, loops, text);
                writeln!(text, "END_IF;")
            }
            Step::Case(selector, first, second, otherwise) => {
                let _ = writeln!(text, "CASE {} OF 0, 2:", text_of(selector));
                write_steps(first, loops, text);
                let _ = writeln!(text, "3..7:");
                write_steps(second, loops, text);
                let _ = writeln!(text, "ELSE");
                write_steps(otherwise, loops, text);
                writeln!(text, "END_CASE;")
            }
            Step::For(from, to, by, body) => {
                // Constant limits and others are counted in different ways.
                let open = if loops % 2 == 1 { "none + " } else { "" };
                let _ = writeln!(text, "FOR i{loops} := {from} TO {open}{to} BY {by} DO");
                write_steps(body, loops + 1, text);
                writeln!(text, "END_FOR;")
            }
            Step::While(condition, most, body) => {
                let _ = writeln!(text, "{{max_iterations := {most}}} WHILE {} DO", text_of(condition));
                write_steps(body, loops + 1, text);
                writeln!(text, "END_WHILE;")
            }
            Step::Repeat(condition, most, body) => {
                let _ = writeln!(text, "{{max_iterations := {most}}} REPEAT");
                write_steps(body, loops + 1, text);
                writeln!(text, "UNTIL {} END_REPEAT;", text_of(condition))
            }
            Step::Exit if loops > 0 => writeln!(text, "EXIT;"),
            Step::Continue if loops > 0 => writeln!(text, "CONTINUE;"),
            Step::Exit | Step::Continue => writeln!(text, ";"),
        };
    }
}

// Walked as trees.

#[derive(Debug, PartialEq)]
enum Flow {
    On,
    Exit,
    Continue,
}

struct Evaluator {
    /// Of the type of the program.
    own: (u32, bool),
    /// Width and sign in which is worked out just now.
    bits: u32,
    signed: bool,
    variables: Vec<i128>,
    list: Vec<i128>,
    faults: u64,
    overflows: u64,
}

/// Whether operators make a value of others.
fn is_worked_out(tree: &Tree) -> bool {
    match tree {
        Tree::Operation(..) => true,
        Tree::Select(_, a, b) => is_worked_out(a) || is_worked_out(b),
        _ => false,
    }
}

impl Evaluator {
    fn fit(&mut self, value: i128) -> i128 {
        let span = 1_i128 << self.bits;
        let mut low = value.rem_euclid(span);
        if self.signed && low >= span / 2 {
            low -= span;
        }
        self.overflows += u64::from(low != value);
        low
    }

    /// As something of this width and sign.
    fn within<T>(&mut self, (bits, signed): (u32, bool), work: impl FnOnce(&mut Self) -> T) -> T {
        let before = (self.bits, self.signed);
        (self.bits, self.signed) = (bits, signed);
        let result = work(self);
        (self.bits, self.signed) = before;
        result
    }

    fn index(&mut self, index: &Tree) -> Option<usize> {
        // An index is a LINT, which an ULINT does not become.
        let wide = if self.own == (64, false) { self.own } else { (64, true) };
        let index = self.within(wide, |evaluator| evaluator.value(index));
        if (0..LENGTH).contains(&index) {
            return Some(index as usize);
        }
        self.faults += 1;
        None
    }

    fn value(&mut self, tree: &Tree) -> i128 {
        match tree {
            Tree::Number(value) => *value,
            Tree::Variable(index) => self.variables[*index],
            Tree::Element(index) => self.index(index).map_or(0, |index| self.list[index]),
            Tree::Operation(word, a, b) => {
                let (a, b) = (self.value(a), self.value(b));
                match *word {
                    "+" => self.fit(a + b),
                    "-" => self.fit(a - b),
                    "*" => self.fit(a.checked_mul(b).unwrap_or_else(|| a.wrapping_mul(b))),
                    _ if b == 0 => {
                        self.faults += 1;
                        0
                    }
                    "/" => self.fit(a / b),
                    _ => a % b,
                }
            }
            Tree::Select(c, a, b) => {
                // SEL works out all of its inputs.
                let (c, a, b) = (self.holds(c), self.value(a), self.value(b));
                if c { b } else { a }
            }
            Tree::Function(a, b) => self.within(self.own, |evaluator| {
                let (a, b) = (evaluator.value(a), evaluator.value(b));
                let sum = evaluator.fit(a + b);
                if a > b { sum } else { evaluator.fit(sum - 1) }
            }),
            Tree::Compare(..) | Tree::Logic(..) | Tree::Not(_) => i128::from(self.holds(tree)),
        }
    }

    fn holds(&mut self, tree: &Tree) -> bool {
        match tree {
            Tree::Compare(word, a, b) => {
                let made = [a, b].iter().any(|side| is_worked_out(side));
                let width = if made && self.own.0 < 32 { (32, true) } else { self.own };
                let order = self.within(width, |evaluator| evaluator.value(a).cmp(&evaluator.value(b)));
                match *word {
                    "<" => order.is_lt(),
                    ">" => order.is_gt(),
                    "<=" => order.is_le(),
                    ">=" => order.is_ge(),
                    "=" => order.is_eq(),
                    _ => order.is_ne(),
                }
            }
            Tree::Logic("AND_THEN", a, b) => self.holds(a) && self.holds(b),
            Tree::Logic("OR_ELSE", a, b) => self.holds(a) || self.holds(b),
            Tree::Logic(word, a, b) => {
                let (a, b) = (self.holds(a), self.holds(b));
                match *word {
                    "AND" => a & b,
                    "OR" => a | b,
                    _ => a ^ b,
                }
            }
            Tree::Not(a) => !self.holds(a),
            _ => self.value(tree) != 0,
        }
    }

    fn run(&mut self, steps: &[Step], loops: usize) -> Flow {
        for step in steps {
            let flow = self.step(step, loops);
            if flow != Flow::On {
                return flow;
            }
        }
        Flow::On
    }

    fn step(&mut self, step: &Step, loops: usize) -> Flow {
        match step {
            Step::Assign(variable, value) => self.variables[*variable] = self.value(value),
            Step::AssignElement(index, value) => {
                let index = self.index(index);
                let value = self.value(value);
                if let Some(index) = index {
                    self.list[index] = value;
                }
            }
            Step::If(condition, then, otherwise) => {
                return if self.holds(condition) {
                    self.run(then, loops)
                } else {
                    self.run(otherwise, loops)
                };
            }
            Step::Case(selector, first, second, otherwise) => {
                return match self.value(selector) {
                    0 | 2 => self.run(first, loops),
                    3..=7 => self.run(second, loops),
                    _ => self.run(otherwise, loops),
                };
            }
            Step::For(from, to, by, body) => {
                let mut control = *from;
                while control <= *to {
                    if self.run(body, loops + 1) == Flow::Exit {
                        break;
                    }
                    control += by;
                }
            }
            Step::While(condition, most, body) => {
                let mut left = *most;
                while self.holds(condition) {
                    if left == 0 {
                        self.faults += 1;
                        break;
                    }
                    left -= 1;
                    if self.run(body, loops + 1) == Flow::Exit {
                        break;
                    }
                }
            }
            Step::Repeat(condition, most, body) => {
                let mut left = *most;
                loop {
                    if left == 0 {
                        self.faults += 1;
                        break;
                    }
                    left -= 1;
                    if self.run(body, loops + 1) == Flow::Exit || self.holds(condition) {
                        break;
                    }
                }
            }
            Step::Exit if loops > 0 => return Flow::Exit,
            Step::Continue if loops > 0 => return Flow::Continue,
            Step::Exit | Step::Continue => {}
        }
        Flow::On
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, ..ProptestConfig::default() })]

    #[test]
    fn compiled_programs_do_what_the_tree_does(
        kind in 0..TYPES.len(),
        steps in steps(),
        values in prop::collection::vec(any::<i64>(), VARIABLES),
    ) {
        let (name, bits, signed) = TYPES[kind];
        let mut text = format!(
            "FUNCTION f : {name} VAR_INPUT a, b : {name}; END_VAR f := a + b; IF NOT (a > b) THEN f := f - 1; END_IF; END_FUNCTION\n\
             PROGRAM p VAR v0, v1, v2, v3, zero : {name}; l : ARRAY[0..4] OF {name} := [1, 2, 3, 4, 5]; i0, i1, i2, i3, none : INT; END_VAR\n"
        );
        write_steps(&steps, 0, &mut text);
        text += "END_PROGRAM";
        let text = text.replace('?', name);
        let mut runtime = start(&text);
        let mut evaluator = Evaluator { own: (bits, signed), bits, signed, variables: Vec::new(), list: vec![1, 2, 3, 4, 5], faults: 0, overflows: 0 };
        for (index, value) in values.iter().enumerate() {
            // Small ones more often than not.
            let value = if value % 2 == 0 { i128::from(value % 12) } else { i128::from(*value) };
            let value = evaluator.fit(value);
            set(&mut runtime, &format!("v{index}"), &value.to_string());
            evaluator.variables.push(value);
        }
        evaluator.overflows = 0;
        for scan in 0..3 {
            let steps_taken = runtime.scan(scan * 10_000_000);
            prop_assert!(steps_taken <= runtime.logic().steps_max(), "{text}");
            evaluator.run(&steps, 0);
            for index in 0..VARIABLES {
                prop_assert_eq!(get(&runtime, &format!("v{index}")), evaluator.variables[index].to_string(), "v{} in\n{}", index, text);
            }
            for index in 0..LENGTH as usize {
                prop_assert_eq!(get(&runtime, &format!("l[{index}]")), evaluator.list[index].to_string(), "l[{}] in\n{}", index, text);
            }
            prop_assert_eq!((runtime.faults(), runtime.overflows()), (evaluator.faults, evaluator.overflows), "{}", text);
        }
    }
}
