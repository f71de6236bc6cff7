//! Variables, elements and members: what a name means, and where that lies.

use super::expression::{Checker, Read};
use super::tree::{Base, Index, Node, Place};
use super::types::Type;
use super::{State, Variable};
use crate::diagnostic::{Kind, Span};
use crate::scalar::Scalar;
use crate::syntax::{Access, Expression, Name, Section, Step, UnitKind};

/// Why something is not assigned.
const CONSTANT: &str = "a constant";
const INPUT: &str = "an input";

/// A variable of the unit, or a global one, by its place among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    Own(usize),
    Global(usize),
}

impl Checker<'_, '_, '_> {
    /// What a name means; variables of the unit hide global ones.
    pub(super) fn find(&self, name: &Name) -> Option<Found> {
        let key = name.key();
        let own = self.unit.and_then(|unit| self.compiler.units[unit].by_name.get(&key));
        let global = || {
            self.compiler
                .global_by_name
                .get(&key)
                .map(|index| Found::Global(*index))
        };
        own.map(|index| Found::Own(*index)).or_else(global)
    }

    pub(super) fn found(&mut self, found: Found) -> &mut Variable {
        match (found, self.unit) {
            (Found::Own(index), Some(unit)) => &mut self.compiler.units[unit].variables[index],
            (Found::Own(index) | Found::Global(index), _) => &mut self.compiler.globals[index],
        }
    }

    pub(super) fn is_variable(&self, name: &Name) -> bool {
        self.find(name).is_some()
    }

    /// The value of a variable that is constant and single.
    pub(super) fn constant_variable(&mut self, access: &Access) -> Option<Node> {
        if !access.steps.is_empty() {
            return None;
        }
        let found = self.find(&access.name)?;
        let variable = self.found(found);
        Some(Node::constant(variable.ty, variable.value?, access.at))
    }

    fn undeclared<T>(&mut self, name: &Name) -> Read<T> {
        let compiler = &self.compiler;
        // A declaration that is wrong has been told; what depends on it is not told again.
        let is_refused = |unit: Option<usize>| compiler.refused.contains(&(unit, name.key()));
        let extends = |unit: usize| compiler.units[unit].text.is_some_and(|text| text.extends);
        if is_refused(self.unit) || is_refused(None) || self.unit.is_some_and(extends) {
            return Err(crate::diagnostic::Reported);
        }
        let own = self.unit.map_or(&[][..], |unit| &compiler.units[unit].variables);
        let variables = own
            .iter()
            .chain(&compiler.globals)
            .map(|variable| variable.name.as_str());
        let values = compiler.types.enumerations.iter().flat_map(|known| &known.values);
        let names = variables.chain(values.map(|(name, _)| name.as_str()));
        let nearest = compiler.told.nearest(&name.text, names);
        let name_text = name.text.clone();
        self.error(
            name.at,
            Kind::Undeclared {
                name: name_text,
                nearest,
            },
        )
    }

    /// Where something lies.
    pub(super) fn place(&mut self, access: &Access) -> Read<Place> {
        let name = &access.name;
        let Some(found) = self.find(name) else {
            if let (Some(Step::Member(member)), Some(index)) = (
                access.steps.first(),
                self.compiler.types.enumeration_by_name.get(&name.key()),
            ) {
                let (name, value) = (
                    self.compiler.types.enumerations[*index as usize].name.clone(),
                    member.text.clone(),
                );
                return self.error(access.at, Kind::EnumerationPoint { name, value });
            }
            return self.undeclared(name);
        };
        let in_function = self
            .unit
            .is_some_and(|unit| self.compiler.units[unit].kind == UnitKind::Function);
        let variable = self.found(found).clone();
        if in_function && matches!(found, Found::Global(_)) && !variable.constant {
            let name_text = name.text.clone();
            return self.error(name.at, Kind::GlobalInFunction { name: name_text });
        }
        let is_input_address = variable
            .address
            .as_ref()
            .is_some_and(|address| address.starts_with("%I"));
        // VAR_EXTERNAL CONSTANT: of this unit, whatever others do with it.
        let is_constant_here = matches!(found, Found::Global(_))
            && (self.unit).is_some_and(|unit| self.compiler.units[unit].constant_externals.contains(&name.key()));
        let read_only = match variable.section {
            _ if variable.constant || is_constant_here => Some(CONSTANT),
            Section::Input => Some(INPUT),
            _ if is_input_address => Some(INPUT),
            _ => None,
        };
        let (base, offset) = match (found, variable.section) {
            (Found::Global(_), _) => (Base::Global, variable.offset),
            (Found::Own(_), Section::InOut) => (Base::ThisReference(variable.offset), 0),
            // What is read of it is its edge.
            (Found::Own(_), _) if variable.edge.is_some() => (Base::This, variable.offset + 1),
            (Found::Own(_), _) => (Base::This, variable.offset),
        };
        let mut place = Place {
            base,
            offset,
            indices: Vec::new(),
            ty: variable.ty,
            read_only,
            name: name.text.clone(),
            at: access.at,
        };
        for step in &access.steps {
            match step {
                Step::Member(member) => self.member(&mut place, member)?,
                Step::Index(indices, at) => self.element(&mut place, indices, *at)?,
            }
        }
        if let Type::Block(unit) = place.ty {
            // Its size is known only if its variables are.
            if !matches!(self.compiler.units[unit as usize].interface, State::Done(())) {
                return Err(crate::diagnostic::Reported);
            }
            place.read_only = place.read_only.or(Some("an instance of a function block"));
        }
        Ok(place)
    }

    /// Refuses an instance that is an input or a constant: it is a copy, or is not to change, so that a call would have no effect.
    pub(super) fn may_be_called(&mut self, instance: &Place) -> Read<()> {
        match instance.read_only.filter(|what| [CONSTANT, INPUT].contains(what)) {
            Some(what) => {
                let name = instance.name.clone();
                self.error(instance.at, Kind::CalledCopy { name, what })
            }
            None => Ok(()),
        }
    }

    fn member(&mut self, place: &mut Place, member: &Name) -> Read<()> {
        let wanted = member.key();
        let compiler = &self.compiler;
        let found = match place.ty {
            Type::Structure(index) => {
                let structure = &compiler.types.structures[index as usize];
                let found = structure.by_name.get(&wanted).map(|index| &structure.members[*index]);
                let names = structure.members.iter().map(|member| member.name.as_str());
                found
                    .map(|member| (member.ty, member.offset, None))
                    .ok_or_else(|| compiler.told.nearest(&member.text, names))
            }
            Type::Block(unit) => {
                let unit = &compiler.units[unit as usize];
                let visible = |variable: &&Variable| matches!(variable.section, Section::Input | Section::Output);
                let found = unit.by_name.get(&wanted).map(|index| &unit.variables[*index]);
                if found.is_some_and(|variable| !visible(&variable)) {
                    let (name, member_text) = (unit.name.clone(), member.text.clone());
                    return self.error(
                        member.at,
                        Kind::Hidden {
                            name,
                            member: member_text,
                        },
                    );
                }
                let read_only =
                    |section: Section| (section == Section::Output).then_some("an output of a function block");
                let names = unit.variables.iter().filter(visible);
                let names = names.map(|variable| variable.name.as_str());
                found
                    .map(|found| (found.ty, found.offset, read_only(found.section)))
                    .ok_or_else(|| compiler.told.nearest(&member.text, names))
            }
            Type::Enumeration(index)
                if compiler.types.enumerations[index as usize]
                    .by_name
                    .contains_key(&wanted) =>
            {
                let name = compiler.types.enumerations[index as usize].name.clone();
                let value = member.text.clone();
                let at = place.at;
                return self.error(at, Kind::EnumerationPoint { name, value });
            }
            _ => {
                let ty = self.type_name(place.ty);
                return self.error(member.at, Kind::NoStruct { ty });
            }
        };
        let (ty, offset, read_only) = match found {
            Ok(found) => found,
            Err(_) if self.extends(place.ty, &wanted) => return Err(crate::diagnostic::Reported),
            Err(nearest) => {
                let (name, member_text) = (self.type_name(place.ty), member.text.clone());
                return self.error(
                    member.at,
                    Kind::NoMember {
                        name,
                        member: member_text,
                        nearest,
                    },
                );
            }
        };
        (place.ty, place.read_only) = (ty, place.read_only.or(read_only));
        place.offset += offset;
        place.name = format!("{}.{}", place.name, member.text);
        Ok(())
    }

    /// Whether something may have a member of this name that is not supported: that is told where it is declared.
    pub(super) fn extends(&self, ty: Type, member: &str) -> bool {
        match ty {
            Type::Block(unit) => {
                let extends = self.compiler.units[unit as usize].text.is_some_and(|text| text.extends);
                extends
                    || self
                        .compiler
                        .refused
                        .contains(&(Some(unit as usize), member.to_owned()))
            }
            _ => false,
        }
    }

    fn element(&mut self, place: &mut Place, indices: &[Expression], at: Span) -> Read<()> {
        let Type::Array(index) = place.ty else {
            let ty = self.type_name(place.ty);
            return self.error(at, Kind::NoArray { ty });
        };
        let array = self.compiler.types.arrays[index as usize].clone();
        if array.dimensions.len() != indices.len() {
            let (ty, wanted, got) = (self.type_name(place.ty), array.dimensions.len(), indices.len());
            return self.error(at, Kind::Dimensions { ty, wanted, got });
        }
        let mut stride = self.compiler.types.size(array.element, &self.compiler.units);
        // The last index is the fastest one.
        for (value, (low, length)) in indices.iter().zip(&array.dimensions).rev() {
            let node = self.typed(value, Some(Type::Scalar(Scalar::Lint)))?;
            if !node.ty.scalar().is_some_and(Scalar::is_integer) {
                return self.coerce(node, Type::Scalar(Scalar::Dint)).map(|_| ());
            }
            match node.value() {
                Some(value) => {
                    let element = value.wrapping_sub(i64::from(*low));
                    if !(0..i64::from(*length)).contains(&element) {
                        let high = (i64::from(*low) + i64::from(*length) - 1) as i32;
                        let (value, low) = (value.to_string(), *low);
                        return self.error(node.at, Kind::Index { value, low, high });
                    }
                    place.offset += element as u32 * stride;
                }
                None => place.indices.push(Index {
                    value: node,
                    low: *low,
                    length: *length,
                    stride,
                }),
            }
            stride *= length;
        }
        place.ty = array.element;
        place.name = format!("{}[..]", place.name);
        Ok(())
    }
}
