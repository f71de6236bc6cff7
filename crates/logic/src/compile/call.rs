//! Calls of function blocks.

use super::expression::{Checker, Read};
use super::function::{count_of, is_enable};
use super::tree::{Base, Place};
use super::types::Type;
use super::{State, Variable};
use crate::arithmetic::Unary;
use crate::block::Block;
use crate::code::Op;
use crate::diagnostic::{Kind, Reported};
use crate::scalar::Scalar;
use crate::syntax::{Access, Argument, ArgumentValue, ExpressionKind, Name, Section, UnitKind};
use std::collections::BTreeSet;

impl Checker<'_, '_, '_> {
    /// `instance(IN := x, Q => y);`
    pub(super) fn call(&mut self, access: &Access, arguments: &[Argument]) -> Read<()> {
        let instance = self.instance(access)?;
        let Type::Block(unit) = instance.ty else {
            let name = instance.name;
            return self.error(access.at, Kind::NoBlock { name });
        };
        self.may_be_called(&instance)?;
        self.told_of_limit(access);
        let unit = unit as usize;
        if self.compiler.units[unit].block.is_none() {
            self.compiler.body(unit, access.at)?;
        }
        if self.compiler.units[unit].block == Some(Block::FallingEdge) {
            self.compiler.told_of_falling_edge(access.at);
        }
        let named = self.named(unit, access, arguments)?;
        let arguments = named.as_deref().unwrap_or(arguments);
        let instance = self.fixed(instance)?;
        let mut given = BTreeSet::new();
        let mut good = Ok(());
        for argument in arguments {
            good = self.argument(unit, &instance, argument, &mut given).and(good);
        }
        good?;
        let in_out = self.compiler.units[unit].variables.iter();
        let mut in_out = in_out.filter(|variable| variable.section == Section::InOut);
        if let Some(missing) = in_out.find(|variable| !given.contains(&variable.name)) {
            let (name, argument) = (self.compiler.units[unit].name.clone(), missing.name.clone());
            return self.error(access.at, Kind::ArgumentMissing { name, argument });
        }
        self.emitter.address(self.compiler, &instance);
        match (self.compiler.units[unit].block, self.compiler.units[unit].body) {
            (Some(block), _) => {
                self.emitter.op(Op::Block(block), access.at);
            }
            (None, State::Done(body)) => self.emitter.call(body, access.at),
            _ => return Err(Reported),
        }
        for argument in arguments {
            if let (Some(name), ArgumentValue::Taken(target)) = (&argument.name, &argument.value) {
                let output = self.part(unit, &instance, &name.text, name.at)?;
                let target = self.target(target)?;
                let mut value = Self::read(output, name.at);
                if argument.inverted {
                    value = match value.ty.scalar() {
                        Some(scalar) if scalar == Scalar::Bool || scalar.is_bit_string() => {
                            self.folded(Unary::Not, scalar, value)
                        }
                        _ => return self.no_operand("NOT", &value),
                    };
                }
                let value = self.coerce(value, target.ty)?;
                self.store(&target, &value);
            }
        }
        Ok(())
    }

    /// Inputs that are given by place, with their names; `None`: all have names.
    fn named(&mut self, unit: usize, access: &Access, arguments: &[Argument]) -> Read<Option<Vec<Argument>>> {
        let by_place = arguments.iter().filter(|argument| argument.name.is_none()).count();
        if by_place == 0 {
            return Ok(None);
        }
        if by_place < arguments.len() {
            return self.error(access.at, Kind::ArgumentsMixed);
        }
        let called = &self.compiler.units[unit];
        let is_input = |variable: &&Variable| matches!(variable.section, Section::Input | Section::InOut);
        let inputs: Vec<String> = called
            .variables
            .iter()
            .filter(is_input)
            .map(|input| input.name.clone())
            .collect();
        if arguments.len() > inputs.len() {
            let (name, wanted, got) = (called.name.clone(), count_of(inputs.len()), arguments.len());
            return self.error(access.at, Kind::ArgumentCount { name, wanted, got });
        }
        let at = |argument: &Argument| match &argument.value {
            ArgumentValue::Given(value) => value.at,
            ArgumentValue::Taken(access) => access.at,
        };
        let named = inputs.into_iter().zip(arguments).map(|(text, argument)| Argument {
            name: Some(Name { text, at: at(argument) }),
            ..argument.clone()
        });
        Ok(Some(named.collect()))
    }

    /// What is called; names that are none of an instance are told with what they are.
    fn instance(&mut self, access: &Access) -> Read<Place> {
        let name = access.name.text.clone();
        if self.is_variable(&access.name) || !access.steps.is_empty() {
            return self.place(access);
        }
        let unit = self.compiler.unit_by_name.get(&access.name.key());
        match unit.map(|unit| self.compiler.units[*unit].kind) {
            Some(UnitKind::Block) => self.error(access.at, Kind::BlockAsFunction { name }),
            Some(UnitKind::Program) => self.error(access.at, Kind::ProgramCalled { name }),
            Some(UnitKind::Function) => self.error(access.at, Kind::FunctionAsStatement { name }),
            None if super::function::is_standard(&name) => self.error(access.at, Kind::FunctionAsStatement { name }),
            None => self.place(access),
        }
    }

    /// An instance whose address is worked out once.
    fn fixed(&mut self, instance: Place) -> Read<Place> {
        if instance.indices.is_empty() {
            return Ok(instance);
        }
        let slot = self.compiler.memory.allocate(&[0], instance.at);
        self.emitter.address(self.compiler, &instance);
        self.emitter.op(Op::Store(slot), instance.at);
        Ok(Place {
            base: Base::GlobalReference(slot),
            offset: 0,
            indices: Vec::new(),
            ..instance
        })
    }

    /// A variable of an instance.
    fn part(&self, unit: usize, instance: &Place, name: &str, at: crate::diagnostic::Span) -> Read<Place> {
        let unit = &self.compiler.units[unit];
        let index = unit.by_name.get(&crate::syntax::key(name)).ok_or(Reported)?;
        let variable = &unit.variables[*index];
        Ok(Place {
            offset: instance.offset + variable.offset,
            ty: variable.ty,
            at,
            ..instance.clone()
        })
    }

    /// Gives an input its value, and a VAR_IN_OUT its variable; looks at outputs.
    fn argument(
        &mut self,
        unit: usize,
        instance: &Place,
        argument: &Argument,
        given: &mut BTreeSet<String>,
    ) -> Read<()> {
        let called = &self.compiler.units[unit];
        let name = called.name.clone();
        let Some(wanted) = &argument.name else {
            return Err(Reported);
        };
        let takes = matches!(argument.value, ArgumentValue::Taken(_));
        let fits = |section: Section| match section {
            Section::Input | Section::InOut => !takes,
            Section::Output => takes,
            _ => false,
        };
        let found = called
            .by_name
            .get(&wanted.key())
            .map(|index| called.variables[*index].clone());
        let Some(variable) = found.filter(|variable| fits(variable.section)) else {
            if is_enable(wanted) {
                return Err(self.compiler.told.unsupported(wanted.at, "EN and ENO", &wanted.text));
            }
            if self.extends(instance.ty, &wanted.key()) {
                return Err(Reported);
            }
            let direction = if takes { "output" } else { "input" };
            let known = called.variables.iter().filter(|variable| fits(variable.section));
            let known = known.map(|variable| variable.name.as_str());
            let nearest = self.compiler.told.nearest(&wanted.text, known);
            let argument = wanted.text.clone();
            return self.error(
                wanted.at,
                Kind::NoArgument {
                    name,
                    argument,
                    direction,
                    nearest,
                },
            );
        };
        if !given.insert(variable.name.clone()) {
            let argument = variable.name;
            return self.error(wanted.at, Kind::ArgumentTwice { argument });
        }
        let place = self.part(unit, instance, &wanted.text, wanted.at)?;
        match &argument.value {
            ArgumentValue::Given(value) if variable.section == Section::InOut => {
                let ExpressionKind::Variable(access) = &value.kind else {
                    let argument = variable.name;
                    return self.error(value.at, Kind::InOut { argument });
                };
                let target = match self.place(access)? {
                    // An instance is passed on, though it is not assigned.
                    block if matches!(block.ty, Type::Block(_)) => {
                        self.may_be_called(&block)?;
                        self.told_of_limit(access);
                        block
                    }
                    _ => self.target(access)?,
                };
                if target.ty != variable.ty {
                    let (from, to) = (self.type_name(target.ty), self.type_name(variable.ty));
                    return self.error(
                        value.at,
                        Kind::Mismatch {
                            from,
                            to,
                            cure_text: None,
                        },
                    );
                }
                let slot = Place {
                    ty: Type::Scalar(Scalar::Lint),
                    ..place
                };
                let compiler = &*self.compiler;
                let emitter = &mut self.emitter;
                emitter.store(compiler, &slot, |emitter| emitter.address(compiler, &target));
            }
            ArgumentValue::Given(value) => {
                let node = self.expression_of(value, variable.ty)?;
                self.store(&place, &node);
            }
            // Once the block has run.
            ArgumentValue::Taken(_) => {}
        }
        Ok(())
    }
}
