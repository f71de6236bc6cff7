//! Values at the start: those that stand behind `:=`, and those of what is given none.

use super::Read;
use crate::compile::expression::Checker;
use crate::compile::types::Type;
use crate::compile::{Compiler, Variable};
use crate::diagnostic::{Kind, Span};
use crate::scalar::Scalar;
use crate::syntax::{Initial, Name, Section};

impl<'a> Compiler<'a, '_> {
    /// Values of something that is given none.
    pub(super) fn image(&mut self, ty: Type, at: Span) -> Read<Vec<i64>> {
        let size = self.types.size(ty, &self.units) as usize;
        self.memory.lay_out(size, at)?;
        Ok(self.types.image(ty, &self.units))
    }

    /// Values that stand behind `:=`.
    pub(super) fn initial(&mut self, unit: Option<usize>, ty: Type, initial: &'a Initial) -> Read<Vec<i64>> {
        match (initial, ty) {
            (Initial::Value(value), _) if ty.is_single() => {
                self.memory.lay_out(1, value.at)?;
                Ok(vec![Checker::new(self, unit).constant(value, ty)?])
            }
            (Initial::Default(at), _) => self.image(ty, *at),
            (Initial::List(values, at), Type::Array(index)) => {
                let array = self.types.arrays[index as usize].clone();
                let mut image = self.image(ty, *at)?;
                let stride = self.types.size(array.element, &self.units) as usize;
                let (mut element, wanted) = (0_usize, array.count());
                for (count, value) in values {
                    let count = match count {
                        Some(count) => Checker::new(self, unit).constant(count, Type::Scalar(Scalar::Lint))?,
                        None => 1,
                    };
                    let value = match value {
                        Initial::Default(_) => None,
                        value => Some(self.initial(unit, array.element, value)?),
                    };
                    let count = usize::try_from(count).unwrap_or(usize::MAX);
                    let got = element.saturating_add(count);
                    if got > wanted {
                        return Err(self.told.error(*at, Kind::InitialCount { wanted, got }));
                    }
                    // What is repeated without a value stays as it is.
                    let Some(value) = value else {
                        element = got;
                        continue;
                    };
                    for place in image[element * stride..got * stride].chunks_exact_mut(stride.max(1)) {
                        place.copy_from_slice(&value);
                    }
                    element = got;
                }
                Ok(image)
            }
            (Initial::Members(members, at), Type::Structure(_) | Type::Block(_)) => {
                let mut image = self.image(ty, *at)?;
                for (name, value) in members {
                    let (member, offset) = self.member_at_start(ty, name)?;
                    let values = self.initial(unit, member, value)?;
                    let start = offset as usize;
                    image[start..start + values.len()].copy_from_slice(&values);
                }
                Ok(image)
            }
            _ => {
                let ty = self.types.name(ty, &self.units);
                Err(self.told.error(initial.at(), Kind::InitialShape(ty)))
            }
        }
    }

    /// A member that is given a value at the start: any of a structure, an input of a block.
    fn member_at_start(&mut self, ty: Type, name: &Name) -> Read<(Type, u32)> {
        let wanted = name.key();
        let nearest = match ty {
            Type::Structure(index) => {
                let structure = &self.types.structures[index as usize];
                if let Some(index) = structure.by_name.get(&wanted) {
                    let member = &structure.members[*index];
                    return Ok((member.ty, member.offset));
                }
                let names = structure.members.iter().map(|member| member.name.as_str());
                self.told.nearest(&name.text, names)
            }
            Type::Block(unit) => {
                let unit = self.unit(unit as usize);
                let is_input = |variable: &&Variable| variable.section == Section::Input;
                let found = unit.by_name.get(&wanted).map(|index| &unit.variables[*index]);
                if let Some(input) = found.filter(is_input) {
                    return Ok((input.ty, input.offset));
                }
                let inputs = unit.variables.iter().filter(is_input);
                self.told.nearest(&name.text, inputs.map(|input| input.name.as_str()))
            }
            _ => None,
        };
        let (owner, member) = (self.types.name(ty, &self.units), name.text.clone());
        Err(self.told.error(
            name.at,
            Kind::NoMember {
                name: owner,
                member,
                nearest,
            },
        ))
    }
}
