//! Types: those with names, and those that stand at a variable.
//!
//! In:  what stands in TYPE, and behind the colon of a declaration.
//! Out: types, each known once, with the values that they give at the start.

use super::Read;
use crate::compile::expression::Checker;
use crate::compile::memory::MEMORY_MAX;
use crate::compile::types::{ArrayType, Enumeration, Member, Structure, Type};
use crate::compile::{Compiler, DEPTH_MAX, Declared, State};
use crate::diagnostic::{Kind, Reported, Span};
use crate::scalar::Scalar;
use crate::syntax::{self, Expression, Name, TypeKind, TypeText, UnitKind};
use std::collections::HashMap;

/// Octets of the name of an enumeration that is given none, about.
const NAME_MAX: usize = 100;

impl<'a> Compiler<'a, '_> {
    /// Type of this name.
    pub(super) fn named_type(&mut self, name: &Name) -> Read<Declared> {
        let key = name.key();
        if let Some(scalar) = Scalar::of_name(&key) {
            return Ok((Type::Scalar(scalar), None));
        }
        if let Some((index, state)) = self.declared.get(&key) {
            let index = *index;
            match state {
                State::Done((ty, initial)) => return Ok((*ty, initial.clone())),
                State::Wrong => return Err(Reported),
                State::UnderWay => {
                    let name_text = name.text.clone();
                    return Err(self.told.error(name.at, Kind::Recursive { name: name_text }));
                }
                State::Untouched => {}
            }
            self.declared.insert(key.clone(), (index, State::UnderWay));
            let declared = self.deeper(name.at, |compiler| compiler.declared_type(index));
            let state = declared
                .as_ref()
                .map_or(State::Wrong, |declared| State::Done(declared.clone()));
            self.declared.insert(key, (index, state));
            return declared;
        }
        if let Some(unit) = self
            .unit_by_name
            .get(&key)
            .copied()
            .filter(|unit| self.unit(*unit).kind == UnitKind::Block)
        {
            self.deeper(name.at, |compiler| compiler.interface(unit, name.at))?;
            return Ok((Type::Block(unit as u32), None));
        }
        if self.refused.contains(&(None, key)) {
            return Err(Reported);
        }
        let known = Scalar::ALL.map(Scalar::name);
        let own = self.file.types.iter().map(|declaration| declaration.name.text.as_str());
        let blocks = self
            .units
            .iter()
            .filter(|unit| unit.kind == UnitKind::Block)
            .map(|unit| unit.name.as_str());
        let nearest = self
            .told
            .nearest(&name.text, known.into_iter().chain(own).chain(blocks));
        let name_text = name.text.clone();
        Err(self.told.error(
            name.at,
            Kind::NoType {
                name: name_text,
                nearest,
            },
        ))
    }

    /// One type inside another one.
    fn deeper<T>(&mut self, at: Span, work: impl FnOnce(&mut Self) -> Read<T>) -> Read<T> {
        if self.depth >= DEPTH_MAX {
            return Err(self.told.error(at, Kind::TooDeep { most: DEPTH_MAX }));
        }
        self.depth += 1;
        let done = work(self);
        self.depth -= 1;
        done
    }

    /// What stands in TYPE.
    fn declared_type(&mut self, index: usize) -> Read<Declared> {
        let file = self.file;
        let declaration = &file.types[index];
        let (ty, inherited) = match &declaration.ty.kind {
            TypeKind::Struct(members) => (self.structure(&declaration.name, members)?, None),
            TypeKind::Enumeration(values) => (self.enumeration(&declaration.name, values)?, None),
            TypeKind::Named(name) => self.named_type(name)?,
            TypeKind::Wrong => return Err(Reported),
            TypeKind::Array(..) | TypeKind::Text(_) => (self.type_of(None, &declaration.ty)?, None),
        };
        let initial = match &declaration.initial {
            Some(initial) => Some(self.initial(None, ty, initial)?.into()),
            None => inherited,
        };
        if let (Type::Enumeration(index), Some(initial)) = (ty, &initial) {
            // An enumeration of its own; another name of one begins as that does.
            if matches!(declaration.ty.kind, TypeKind::Enumeration(_)) {
                self.types.enumerations[index as usize].initial = initial.first().copied().unwrap_or(0);
            }
        }
        Ok((ty, initial))
    }

    fn structure(&mut self, name: &Name, members: &'a [syntax::Variable]) -> Read<Type> {
        let (mut image, mut known, mut by_name) = (Vec::new(), Vec::new(), HashMap::new());
        let mut needed = 0;
        for member in members {
            if let Some((_, at)) = &member.address {
                return Err(self.told.error(*at, Kind::AddressPlace));
            }
            let (variable, values) = self.variable(None, member)?;
            if by_name.insert(member.name.key(), known.len()).is_some() {
                let name = member.name.text.clone();
                return Err(self.told.error(member.name.at, Kind::Twice { name }));
            }
            known.push(Member {
                name: variable.name,
                ty: variable.ty,
                offset: image.len() as u32,
            });
            needed += values.len();
            if needed <= MEMORY_MAX {
                image.extend(values);
            }
        }
        if needed > MEMORY_MAX {
            return Err(self.memory.too_great(needed, name.at, &mut self.told));
        }
        self.types.structures.push(Structure {
            name: name.text.clone(),
            members: known,
            by_name,
            image,
        });
        Ok(Type::Structure(self.types.structures.len() as u32 - 1))
    }

    fn enumeration(&mut self, name: &Name, values: &'a [(Name, Option<Expression>)]) -> Read<Type> {
        let index = self.types.enumerations.len() as u32;
        let (mut known, mut by_name) = (Vec::new(), HashMap::new());
        let mut next = 0_i64;
        for (value, number) in values {
            if let Some(number) = number {
                next = Checker::new(self, None).constant(number, Type::Scalar(Scalar::Dint))?;
            }
            if by_name.insert(value.key(), next).is_some() {
                let name = value.text.clone();
                return Err(self.told.error(value.at, Kind::Twice { name }));
            }
            known.push((value.text.clone(), next));
            self.values.entry(value.key()).or_default().push((index, next));
            next += 1;
        }
        self.types.enumeration_by_name.entry(name.key()).or_insert(index);
        self.types.enumerations.push(Enumeration {
            name: name.text.clone(),
            initial: known.first().map_or(0, |(_, value)| *value),
            values: known,
            by_name,
        });
        Ok(Type::Enumeration(index))
    }

    /// One that stands at a variable, once for all variables that are declared together.
    fn enumeration_without_a_name(&mut self, at: Span, values: &'a [(Name, Option<Expression>)]) -> Read<Type> {
        if let Some(ty) = self.unnamed.get(&at.start) {
            return Ok(*ty);
        }
        let mut text = String::from("(");
        for (name, _) in values {
            let comma = if text.len() > 1 { ", " } else { "" };
            // Each element of an array of them has this name of its type.
            if text.len() > NAME_MAX {
                text += &format!("{comma}..");
                break;
            }
            text += &format!("{comma}{}", name.text);
        }
        text += ")";
        let ty = self.enumeration(&Name { text, at }, values)?;
        self.unnamed.insert(at.start, ty);
        Ok(ty)
    }

    pub(super) fn type_of(&mut self, unit: Option<usize>, text: &'a TypeText) -> Read<Type> {
        match &text.kind {
            TypeKind::Named(name) => self.named_type(name).map(|(ty, _)| ty),
            TypeKind::Array(bounds, element) => {
                let element = self.deeper(text.at, |compiler| compiler.type_of(unit, element))?;
                let mut dimensions = Vec::new();
                for (first, last) in bounds {
                    let whole = Type::Scalar(Scalar::Lint);
                    let low = Checker::new(self, unit).constant(first, whole)?;
                    let high = Checker::new(self, unit).constant(last, whole)?;
                    let bounds = (i32::try_from(low), i32::try_from(high));
                    let (Ok(low), Ok(high), true) = (bounds.0, bounds.1, low <= high) else {
                        return Err(self.told.error(first.at.to(last.at), Kind::Bounds));
                    };
                    let length = (i64::from(high) - i64::from(low) + 1).min(i64::from(u32::MAX)) as u32;
                    dimensions.push((low, length));
                }
                let array = ArrayType { dimensions, element };
                let size = self.types.size(element, &self.units).max(1) as usize;
                let needed = array.count().saturating_mul(size);
                if needed > MEMORY_MAX {
                    return Err(self.memory.too_great(needed, text.at, &mut self.told));
                }
                Ok(self.types.array(array))
            }
            TypeKind::Enumeration(values) => self.enumeration_without_a_name(text.at, values),
            TypeKind::Text(length) => {
                let whole = Type::Scalar(Scalar::Lint);
                let value = Checker::new(self, unit).constant(length, whole)?;
                match u16::try_from(value) {
                    Ok(length) if length > 0 => Ok(Type::Text(u32::from(length))),
                    _ => Err(self.told.error(length.at, Kind::TextLength)),
                }
            }
            TypeKind::Struct(_) | TypeKind::Wrong => Err(Reported),
        }
    }
}
