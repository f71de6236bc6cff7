//! A compiled program.

use crate::arithmetic::of_real;
use crate::code::{Op, Switch};
use crate::diagnostic::Diagnostic;
use crate::scalar::Scalar;
use crate::value::Value;
use std::collections::HashMap;

/// What a variable is for the outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// VAR_INPUT of a program, a variable at `%I`, one at a pin that no statement assigns.
    Input,
    /// VAR_OUTPUT of a program, a variable at `%Q`, one at a pin that a statement assigns.
    Output,
    /// Any other.
    Internal,
}

/// One value of a program: a variable of an elementary type or an enumeration, or such an element or member.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// As it is written in the program that it belongs to: `spindle`, `delay.Q`, `pocket[3].tool`.
    pub name: String,
    /// Name of its program; empty: VAR_GLOBAL.
    pub program: String,
    /// Name of its type.
    pub ty: String,
    /// What it is for the outside.
    pub role: Role,
    /// Whether it survives a restart.
    pub retain: bool,
    /// Whether no statement may assign it.
    pub constant: bool,
    /// What it is bound to: `%IX0.0`, `io.5.in-03`.
    pub address: Option<String>,
    /// Line of its declaration, counted from 1.
    pub line: u32,
    pub(crate) slot: u32,
    pub(crate) kind: Leaf,
}

impl Variable {
    /// Its place in [`crate::Runtime::memory`].
    pub fn place(&self) -> usize {
        self.slot as usize
    }

    /// Its elementary type; `None`: it is an enumeration.
    pub fn scalar(&self) -> Option<Scalar> {
        match self.kind {
            Leaf::Scalar(scalar) => Some(scalar),
            Leaf::Text(_) => Some(Scalar::String),
            Leaf::Enumeration(_) => None,
        }
    }

    /// How a value of it is written for [`Logic::read`], behind a colon; empty where that needs no words.
    pub fn form(&self) -> &'static str {
        match self.kind {
            Leaf::Scalar(Scalar::Bool) => ": TRUE or FALSE",
            Leaf::Scalar(Scalar::Time) => ": T#1s500ms, or milliseconds",
            Leaf::Scalar(Scalar::String) | Leaf::Text(_) => ": a text of the program",
            Leaf::Scalar(_) | Leaf::Enumeration(_) => "",
        }
    }

    pub(crate) fn full_name(&self) -> String {
        match self.program.as_str() {
            "" => self.name.clone(),
            program => format!("{program}.{}", self.name),
        }
    }
}

/// What a single slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leaf {
    Scalar(Scalar),
    /// A STRING of so many characters.
    Text(u32),
    Enumeration(u32),
}

/// A loop for which the program names no bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unbound {
    /// Line of the loop, counted from 1.
    pub line: u32,
    /// Character in the line, counted from 1.
    pub column: u32,
    /// Steps that it counts with, by [`crate::ITERATIONS_MAX`] iterations.
    pub steps: u64,
}

/// A program that has been compiled; [`crate::Runtime`] runs it.
#[derive(Clone, Debug, PartialEq)]
pub struct Logic {
    pub(crate) code: Box<[Op]>,
    /// Line and column of each instruction.
    pub(crate) places: Box<[(u32, u32)]>,
    pub(crate) switches: Box<[Switch]>,
    pub(crate) texts: Box<[String]>,
    /// Of each text its place in the order of all; empty where none is needed.
    pub(crate) ranks: Box<[u32]>,
    /// Length, text, and the text of its first so many characters; ordered.
    pub(crate) cuts: Box<[(u32, u32, u32)]>,
    /// Names of the values of each enumeration.
    pub(crate) enumerations: Box<[Vec<(String, i64)>]>,
    /// As it is at the start.
    pub(crate) memory: Box<[i64]>,
    pub(crate) entry: u32,
    pub(crate) stack: usize,
    pub(crate) nesting: usize,
    pub(crate) steps_max: u64,
    pub(crate) unbound: Box<[Unbound]>,
    pub(crate) variables: Vec<Variable>,
    pub(crate) names: Names,
    /// Places of RETAIN variables, ascending.
    pub(crate) retained: Box<[u32]>,
    pub(crate) warnings: Vec<Diagnostic>,
}

/// Variables by their names, in lower case.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Names {
    /// `None`: several are called so.
    own: HashMap<String, Option<usize>>,
    /// With the name of the program before it.
    full: HashMap<String, usize>,
}

impl Names {
    pub(crate) fn of(variables: &[Variable]) -> Names {
        let mut names = Names::default();
        for (at, variable) in variables.iter().enumerate() {
            let own = names.own.entry(variable.name.to_ascii_lowercase());
            own.and_modify(|several| *several = None).or_insert(Some(at));
            names
                .full
                .entry(variable.full_name().to_ascii_lowercase())
                .or_insert(at);
        }
        names
    }
}

impl Logic {
    /// Steps of the longest possible scan.
    pub fn steps_max(&self) -> u64 {
        self.steps_max
    }

    /// Loops whose iterations nothing in the program bounds, in the order of the text.
    pub fn unbound(&self) -> &[Unbound] {
        &self.unbound
    }

    /// Instructions.
    pub fn instructions(&self) -> usize {
        self.code.len()
    }

    /// Values that are kept in memory.
    pub fn values(&self) -> usize {
        self.memory.len()
    }

    /// Warnings and notes of the compilation, in the order of the text.
    pub fn warnings(&self) -> &[Diagnostic] {
        &self.warnings
    }

    /// All variables, in the order of their declaration.
    pub fn all_variables(&self) -> impl Iterator<Item = &Variable> {
        self.variables.iter()
    }

    /// What the program reads from outside.
    pub fn inputs(&self) -> impl Iterator<Item = &Variable> {
        self.variables.iter().filter(|variable| variable.role == Role::Input)
    }

    /// What the program tells the outside.
    pub fn outputs(&self) -> impl Iterator<Item = &Variable> {
        self.variables.iter().filter(|variable| variable.role == Role::Output)
    }

    /// The variable of this name; with the name of its program and a point before it where several programs have one.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        let name = name.to_ascii_lowercase();
        let own = self.names.own.get(&name).copied().flatten();
        self.variables.get(own.or_else(|| self.names.full.get(&name).copied())?)
    }

    /// The variable of this name, or all values of a structure, an array or a block of this name: `pocket`, `pocket[3]`, `delay`.
    pub fn variables_of(&self, name: &str) -> Vec<&Variable> {
        if let Some(variable) = self.variable(name) {
            return vec![variable];
        }
        let wanted = name.to_ascii_lowercase();
        let begins = |name: &str| {
            let rest = name.to_ascii_lowercase();
            rest.strip_prefix(&wanted)
                .is_some_and(|rest| rest.starts_with(['.', '[']))
        };
        let is_part = |variable: &&Variable| begins(&variable.name) || begins(&variable.full_name());
        self.variables.iter().filter(is_part).collect()
    }

    /// A text of the program by its number, as a slot of a STRING holds it.
    pub fn text(&self, number: u32) -> Option<&str> {
        self.texts.get(number as usize).map(String::as_str)
    }

    /// The number of the first so many characters of a text.
    ///
    /// RT: no allocation, no locks, bounded by the logarithm of the texts.
    pub(crate) fn cut(&self, text: i64, length: u32) -> i64 {
        let key = |(of_length, of_text, _): &(u32, u32, u32)| (*of_length, i64::from(*of_text));
        let found = self.cuts.binary_search_by_key(&(length, text), key);
        found.map_or(text, |found| i64::from(self.cuts[found].2))
    }

    /// The place of a text in the order of all.
    ///
    /// RT: no allocation, no locks, bounded.
    pub(crate) fn rank(&self, text: i64) -> i64 {
        let rank = usize::try_from(text).ok().and_then(|text| self.ranks.get(text));
        rank.map_or(0, |rank| i64::from(*rank))
    }

    /// The shortest name under which [`Logic::variable`] finds a variable.
    pub fn name(&self, variable: &Variable) -> String {
        match self.variable(&variable.name) {
            Some(found) if found == variable => variable.name.clone(),
            _ => variable.full_name(),
        }
    }

    /// The value of a variable at the start.
    pub fn initial(&self, variable: &Variable) -> Value<'_> {
        self.value(variable, self.memory.get(variable.place()).copied().unwrap_or(0))
    }

    /// Places of variables of a program that ran before, and of the same ones here: of RETAIN variables or of all, by name and type.
    /// Constants have the values of this program, and a text is not known to another one.
    pub fn same_variables(&self, before: &Logic, only_retained: bool) -> Vec<(usize, usize)> {
        let key = |variable: &Variable| {
            [&variable.program, &variable.name, &variable.ty].map(|part| part.to_ascii_lowercase())
        };
        let kept = |variable: &&Variable| {
            !variable.constant && (variable.retain || !only_retained) && variable.scalar() != Some(Scalar::String)
        };
        let old = before.variables.iter().filter(|old| !old.constant);
        let old: HashMap<_, _> = old.map(|old| (key(old), old)).collect();
        let same = self.variables.iter().filter(kept);
        let same = same.filter_map(|variable| Some((old.get(&key(variable))?, variable)));
        // A value that an enumeration has no more is none of its type.
        let fits = |(old, new): &(&&Variable, &Variable)| match (old.kind, new.kind) {
            (Leaf::Enumeration(old), Leaf::Enumeration(new)) => {
                before.enumerations.get(old as usize) == self.enumerations.get(new as usize)
            }
            _ => true,
        };
        same.filter(fits).map(|(old, new)| (old.place(), new.place())).collect()
    }

    /// What a slot of a variable holds: integers and bit strings by their number (those of 64 bits by their bits), REAL and LREAL by
    /// the bits of an `f64`, TIME in nanoseconds, BOOL as 0 or 1.
    pub fn value(&self, variable: &Variable, slot: i64) -> Value<'_> {
        match variable.kind {
            Leaf::Scalar(Scalar::Bool) => Value::Bool(slot != 0),
            Leaf::Scalar(Scalar::Real) => Value::Real(f64::from_bits(slot as u64) as f32),
            Leaf::Scalar(Scalar::Lreal) => Value::Lreal(f64::from_bits(slot as u64)),
            Leaf::Scalar(Scalar::Time) => Value::Time(slot),
            Leaf::Scalar(Scalar::String) | Leaf::Text(_) => {
                let text = usize::try_from(slot).ok().and_then(|index| self.texts.get(index));
                Value::Text(text.map_or("", String::as_str))
            }
            Leaf::Scalar(scalar) => Value::Integer(scalar.number(slot)),
            Leaf::Enumeration(index) => {
                let values = self.enumerations.get(index as usize).map_or(&[][..], Vec::as_slice);
                let name = values.iter().find(|(_, value)| *value == slot);
                name.map_or(Value::Integer(i128::from(slot)), |(name, _)| Value::Text(name))
            }
        }
    }

    /// The other way; `None`: no value of the type.
    pub fn slot_value(&self, variable: &Variable, value: Value<'_>) -> Option<i64> {
        match (variable.kind, value) {
            (Leaf::Scalar(Scalar::Bool), Value::Bool(value)) => Some(i64::from(value)),
            (Leaf::Scalar(Scalar::Time), Value::Time(nanoseconds)) => Some(nanoseconds),
            (Leaf::Scalar(scalar), Value::Real(value)) if scalar.is_real() => finite(scalar, f64::from(value)),
            (Leaf::Scalar(scalar), Value::Lreal(value)) if scalar.is_real() => finite(scalar, value),
            (Leaf::Scalar(scalar), Value::Integer(value)) if scalar.is_integer() || scalar.is_bit_string() => {
                let (slot, changed) = scalar.wrap(value);
                (!changed).then_some(slot)
            }
            (Leaf::Scalar(Scalar::String), Value::Text(text)) => {
                let index = self.texts.iter().position(|known| known == text);
                index.map(|index| index as i64)
            }
            (Leaf::Text(length), Value::Text(text)) => {
                let index = self.texts.iter().position(|known| known == text);
                let index = index.filter(|_| text.chars().count() <= length as usize);
                index.map(|index| index as i64)
            }
            (Leaf::Enumeration(index), value) => {
                let values = self.enumerations.get(index as usize)?;
                let is_meant = |(name, number): &&(String, i64)| match value {
                    Value::Text(text) => name.eq_ignore_ascii_case(text),
                    Value::Integer(value) => i128::from(*number) == value,
                    _ => false,
                };
                values.iter().find(is_meant).map(|(_, number)| *number)
            }
            _ => None,
        }
    }

    /// Reads a value as it stands in a table: BOOL as 0 or 1, or FALSE or TRUE; TIME in milliseconds, or as `T#1s500ms`; a value of an
    /// enumeration by its name or its number.
    pub fn read<'t>(&self, variable: &Variable, text: &'t str) -> Option<Value<'t>> {
        let value = match variable.kind {
            Leaf::Scalar(Scalar::Bool) => match text {
                "0" => Value::Bool(false),
                "1" => Value::Bool(true),
                word if word.eq_ignore_ascii_case("FALSE") => Value::Bool(false),
                word if word.eq_ignore_ascii_case("TRUE") => Value::Bool(true),
                _ => return None,
            },
            Leaf::Scalar(Scalar::Time) => Value::Time(match text.split_once('#') {
                Some((word, time)) if ["T", "TIME"].iter().any(|known| word.eq_ignore_ascii_case(known)) => {
                    crate::duration::parse(time).ok()?
                }
                _ => crate::duration::of_milliseconds(text)?,
            }),
            Leaf::Scalar(scalar) if scalar.is_real() => Value::Lreal(text.parse().ok()?),
            Leaf::Scalar(Scalar::String) | Leaf::Text(_) => Value::Text(text),
            Leaf::Enumeration(_) => text.parse().map_or(Value::Text(text), Value::Integer),
            Leaf::Scalar(_) => Value::Integer(text.parse().ok()?),
        };
        self.slot_value(variable, value).map(|_| value)
    }
}

/// The slot of a REAL or LREAL; `None`: it is beyond it, or no number.
fn finite(scalar: Scalar, value: f64) -> Option<i64> {
    let slot = of_real(scalar, value);
    f64::from_bits(slot as u64).is_finite().then_some(slot)
}
