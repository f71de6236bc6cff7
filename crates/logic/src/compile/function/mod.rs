//! Calls of functions: those of the file, and those of the standard.

mod standard;

pub(super) use standard::{is_reserved, is_standard};

use super::CODE_MAX;
use super::expression::{Checker, Read};
use super::tree::{Node, NodeKind};
use super::types::Type;
use crate::diagnostic::{Kind, Reported, Span};
use crate::syntax::{Argument, ArgumentValue, Expression, Name, Section, UnitKind, key};
use std::collections::HashMap;

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
        if let Some(named) = standard::standard(&name.text) {
            let values = self.in_order(&named, arguments, at)?;
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
            return Err(Reported);
        }
        let units = self
            .compiler
            .units
            .iter()
            .filter(|unit| unit.kind == UnitKind::Function);
        let known = units.map(|unit| unit.name.as_str()).chain(standard::names());
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
            return Err(Reported);
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
