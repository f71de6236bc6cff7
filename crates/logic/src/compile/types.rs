//! Types that a file declares, and how much memory their values take.

use super::Unit;
use crate::scalar::Scalar;
use std::collections::HashMap;

/// A type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Type {
    /// A literal that becomes any type that holds it.
    AnyInteger,
    AnyReal,
    Scalar(Scalar),
    /// A STRING of so many characters at most.
    Text(u32),
    /// By their places in [`Types`]; blocks among the units.
    Enumeration(u32),
    Structure(u32),
    Array(u32),
    Block(u32),
}

impl Type {
    pub(super) fn scalar(self) -> Option<Scalar> {
        match self {
            Type::Scalar(scalar) => Some(scalar),
            Type::Text(_) => Some(Scalar::String),
            _ => None,
        }
    }

    /// One slot.
    pub(super) fn is_single(self) -> bool {
        matches!(self, Type::Scalar(_) | Type::Text(_) | Type::Enumeration(_))
    }
}

#[derive(Clone, Debug)]
pub(super) struct Enumeration {
    pub(super) name: String,
    pub(super) values: Vec<(String, i64)>,
    /// By the keys of their names.
    pub(super) by_name: HashMap<String, i64>,
    pub(super) initial: i64,
}

#[derive(Clone, Debug)]
pub(super) struct Structure {
    pub(super) name: String,
    pub(super) members: Vec<Member>,
    /// By the keys of their names.
    pub(super) by_name: HashMap<String, usize>,
    /// Values at the start.
    pub(super) image: Vec<i64>,
}

#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) name: String,
    pub(super) ty: Type,
    pub(super) offset: u32,
}

/// Equal if their shapes are.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct ArrayType {
    /// First index and length.
    pub(super) dimensions: Vec<(i32, u32)>,
    pub(super) element: Type,
}

impl ArrayType {
    /// Indices of an element, `1,2`.
    pub(super) fn indices(&self, element: usize) -> String {
        let mut rest = element;
        let mut indices: Vec<String> = Vec::new();
        for (first, length) in self.dimensions.iter().rev() {
            let length = *length as usize;
            indices.insert(0, (i64::from(*first) + (rest % length) as i64).to_string());
            rest /= length;
        }
        indices.join(",")
    }

    pub(super) fn count(&self) -> usize {
        let lengths = self.dimensions.iter().map(|(_, length)| *length as usize);
        lengths.fold(1, usize::saturating_mul)
    }
}

#[derive(Debug, Default)]
pub(super) struct Types {
    pub(super) enumerations: Vec<Enumeration>,
    pub(super) structures: Vec<Structure>,
    pub(super) enumeration_by_name: HashMap<String, u32>,
    pub(super) arrays: Vec<ArrayType>,
    array_by_shape: HashMap<ArrayType, u32>,
}

impl Types {
    pub(super) fn name(&self, ty: Type, units: &[Unit<'_>]) -> String {
        match ty {
            Type::AnyInteger => "an integer".into(),
            Type::AnyReal => "a real number".into(),
            Type::Scalar(scalar) => scalar.name().into(),
            Type::Text(length) => format!("STRING[{length}]"),
            Type::Enumeration(index) => self.enumerations[index as usize].name.clone(),
            Type::Structure(index) => self.structures[index as usize].name.clone(),
            Type::Block(unit) => units[unit as usize].name.clone(),
            Type::Array(index) => {
                let array = &self.arrays[index as usize];
                let bounds = array.dimensions.iter();
                let bounds =
                    bounds.map(|(first, length)| format!("{first}..{}", i64::from(*first) + i64::from(*length) - 1));
                let bounds = bounds.collect::<Vec<_>>().join(", ");
                format!("ARRAY [{bounds}] OF {}", self.name(array.element, units))
            }
        }
    }

    /// Slots of a value.
    pub(super) fn size(&self, ty: Type, units: &[Unit<'_>]) -> u32 {
        match ty {
            Type::Structure(index) => self.structures[index as usize].image.len() as u32,
            Type::Block(unit) => units[unit as usize].image.len() as u32,
            Type::Array(index) => {
                let array = &self.arrays[index as usize];
                // Arrays that are greater than the memory are refused where they are declared.
                (array.count() as u32).saturating_mul(self.size(array.element, units))
            }
            _ => 1,
        }
    }

    /// Values at the start of something of this type.
    pub(super) fn image(&self, ty: Type, units: &[Unit<'_>]) -> Vec<i64> {
        match ty {
            Type::Enumeration(index) => vec![self.enumerations[index as usize].initial],
            Type::Structure(index) => self.structures[index as usize].image.clone(),
            Type::Block(unit) => units[unit as usize].image.clone(),
            Type::Array(index) => {
                let array = &self.arrays[index as usize];
                self.image(array.element, units).repeat(array.count())
            }
            _ => vec![0],
        }
    }

    /// The array of this shape.
    pub(super) fn array(&mut self, array: ArrayType) -> Type {
        let next = self.arrays.len() as u32;
        let index = *self.array_by_shape.entry(array.clone()).or_insert(next);
        if index == next {
            self.arrays.push(array);
        }
        Type::Array(index)
    }
}
