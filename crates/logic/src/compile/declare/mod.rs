//! Types, variables and units: what is declared, and where it lies in memory.

mod initial;
mod types;

use super::types::Type;
use super::{Compiler, State, Unit, Variable};
use crate::block::Block;
use crate::code::NOWHERE;
use crate::diagnostic::{Kind, Reported, Span};
use crate::scalar::Scalar;
use crate::syntax::{self, Name, Section, TypeKind, UnitKind, key};
use std::collections::{BTreeMap, BTreeSet};

type Read<T> = Result<T, Reported>;

impl<'a> Compiler<'a, '_> {
    /// Declares all that the file does; what is wrong is told.
    pub(super) fn declare(&mut self) {
        let file = self.file;
        for (name, block) in Block::all() {
            // Many programs bring their own one.
            let is_own = |own: &syntax::Unit| own.name.text.eq_ignore_ascii_case(&name);
            if block != Block::Semaphore || !file.units.iter().any(is_own) {
                self.standard_block(name, block);
            }
        }
        for (index, declaration) in file.types.iter().enumerate() {
            if self.is_free(&declaration.name) {
                self.declared.insert(declaration.name.key(), (index, State::Untouched));
            }
        }
        for unit in &file.units {
            if self.is_free(&unit.name) {
                self.unit_by_name.insert(unit.name.key(), self.units.len());
            }
            self.units.push(Unit {
                name: unit.name.text.clone(),
                kind: unit.kind,
                text: Some(unit),
                block: None,
                variables: Vec::new(),
                by_name: BTreeMap::new(),
                result: None,
                constant_externals: BTreeSet::new(),
                interface: State::Untouched,
                body: State::Untouched,
                image: Vec::new(),
                frame: 0,
            });
        }
        // Bounds of arrays and values of enumerations may be global constants.
        let is_simple = |variable: &syntax::Variable| {
            let named = matches!(&variable.ty.kind, TypeKind::Named(name) if Scalar::of_name(&name.text).is_some());
            variable.constant && named
        };
        let (simple, others): (Vec<_>, Vec<_>) = file.globals.iter().partition(|variable| is_simple(variable));
        self.globals_of(&simple);
        for declaration in &file.types {
            let _ = self.named_type(&declaration.name);
        }
        self.globals_of(&others);
        for unit in 0..self.units.len() {
            let _ = self.interface(unit, Span::default());
        }
        // Where they are in the file, whatever was laid out first.
        self.globals.sort_by_key(|variable| variable.at.start);
        let keys = self
            .globals
            .iter()
            .enumerate()
            .map(|(index, variable)| (key(&variable.name), index));
        self.global_by_name = keys.collect();
    }

    fn standard_block(&mut self, name: String, block: Block) {
        let variables: Vec<Variable> = block
            .variables()
            .into_iter()
            .zip(0..)
            .map(|((name, section, scalar), offset)| Variable {
                name: name.to_owned(),
                section,
                constant: false,
                retain: false,
                ty: Type::Scalar(scalar),
                offset,
                value: None,
                address: None,
                edge: None,
                at: Span::default(),
                assigned: true,
            })
            .collect();
        let by_name = variables.iter().enumerate();
        let by_name = by_name.map(|(index, variable)| (key(&variable.name), index)).collect();
        self.unit_by_name.insert(key(&name), self.units.len());
        self.units.push(Unit {
            name,
            kind: UnitKind::Block,
            text: None,
            block: Some(block),
            image: vec![0; variables.len()],
            variables,
            by_name,
            result: None,
            constant_externals: BTreeSet::new(),
            interface: State::Done(()),
            body: State::Wrong,
            frame: 0,
        });
    }

    /// Whether a type or unit may be called so.
    fn is_free(&mut self, name: &Name) -> bool {
        let key = name.key();
        let is_known = Scalar::of_name(&key).is_some()
            || super::function::is_reserved(&key)
            || self.declared.contains_key(&key)
            || self.unit_by_name.contains_key(&key);
        if is_known {
            let name_text = name.text.clone();
            self.told.error(name.at, Kind::Twice { name: name_text });
            self.refused.insert((None, key));
        }
        !is_known
    }

    fn globals_of(&mut self, variables: &[&'a syntax::Variable]) {
        for variable in variables {
            if self.global(variable).is_err() {
                self.refused.insert((None, variable.name.key()));
            }
        }
    }

    fn global(&mut self, text: &'a syntax::Variable) -> Read<()> {
        if self.global_by_name.contains_key(&text.name.key()) {
            let name = text.name.text.clone();
            return Err(self.told.error(text.name.at, Kind::Twice { name }));
        }
        let (mut variable, image) = self.variable(None, text)?;
        variable.offset = self.memory.allocate(&image, text.name.at);
        self.global_by_name.insert(text.name.key(), self.globals.len());
        self.globals.push(variable);
        Ok(())
    }

    /// Type and values of a variable, wherever it will lie.
    fn variable(&mut self, unit: Option<usize>, text: &'a syntax::Variable) -> Read<(Variable, Vec<i64>)> {
        let ty = self.type_of(unit, &text.ty)?;
        let image = match &text.initial {
            Some(initial) => self.initial(unit, ty, initial)?,
            None if text.constant => return Err(self.told.error(text.name.at, Kind::ConstantWithoutValue)),
            None => match &text.ty.kind {
                TypeKind::Named(name) => match self.named_type(name)?.1 {
                    Some(initial) => {
                        self.memory.lay_out(initial.len(), text.name.at)?;
                        initial.to_vec()
                    }
                    None => self.image(ty, text.name.at)?,
                },
                _ => self.image(ty, text.name.at)?,
            },
        };
        let kind = unit.map(|unit| self.units[unit].kind);
        if text.edge.is_some() {
            let keeps = matches!(kind, Some(UnitKind::Block | UnitKind::Program));
            if !keeps || text.section != Section::Input || ty != Type::Scalar(Scalar::Bool) {
                return Err(self.told.error(text.ty.at, Kind::EdgePlace));
            }
        }
        if let Some((address, at)) = &text.address {
            // One whose place is given later may be in a block, too.
            let is_open = address.ends_with('*') && kind == Some(UnitKind::Block);
            let in_program = matches!(kind, None | Some(UnitKind::Program)) || is_open;
            self.address(ty, address, *at, in_program)?;
        }
        let variable = Variable {
            name: text.name.text.clone(),
            section: text.section,
            constant: text.constant,
            retain: text.retain,
            ty,
            offset: 0,
            value: (text.constant && ty.is_single()).then_some(image.first().copied().unwrap_or(0)),
            address: text.address.as_ref().map(|(address, _)| address.clone()),
            edge: None,
            at: text.name.at,
            assigned: false,
        };
        Ok((variable, image))
    }

    /// Whether something may be at this address.
    pub(super) fn address(&mut self, ty: Type, address: &str, at: Span, in_program: bool) -> Read<()> {
        let Some(scalar) = ty.scalar().filter(|scalar| in_program && *scalar != Scalar::String) else {
            return Err(self.told.error(at, Kind::AddressPlace));
        };
        if let Some(letters) = address.strip_prefix('%').filter(|letters| !letters.ends_with('*')) {
            let bits = match letters.as_bytes().get(1) {
                Some(b'B') => 8,
                Some(b'W') => 16,
                Some(b'D') => 32,
                Some(b'L') => 64,
                _ => 1,
            };
            if bits != scalar.bits() {
                let (address, ty) = (address.to_owned(), scalar.name().to_owned());
                return Err(self.told.error(at, Kind::AddressWidth { address, bits, ty }));
            }
        }
        Ok(())
    }

    /// Variables of a unit, which may be needed from another one first.
    pub(super) fn interface(&mut self, unit: usize, at: Span) -> Read<()> {
        match self.units[unit].interface {
            State::Done(()) => return Ok(()),
            State::Wrong => return Err(Reported),
            State::UnderWay => {
                let name = self.unit(unit).name.clone();
                return Err(self.told.error(at, Kind::Recursive { name }));
            }
            State::Untouched => {}
        }
        self.units[unit].interface = State::UnderWay;
        let done = self.variables_of(unit);
        self.units[unit].interface = done.map_or(State::Wrong, |()| State::Done(()));
        done
    }

    fn variables_of(&mut self, unit: usize) -> Read<()> {
        let Some(text) = self.unit(unit).text else {
            return Ok(());
        };
        let mut all_good = Ok(());
        let refused = text.refused.iter().map(|name| (Some(unit), name.key()));
        self.refused.extend(refused);
        for variable in &text.variables {
            let good = self.own_variable(unit, text.kind, variable);
            if good.is_err() {
                self.refused.insert((Some(unit), variable.name.key()));
            }
            all_good = good.and(all_good);
        }
        if let Some(result) = &text.result {
            let ty = self.type_of(Some(unit), result).inspect_err(|_| {
                self.refused.insert((Some(unit), text.name.key()));
            })?;
            if !ty.is_single() {
                return Err(self.told.error(result.at, Kind::ResultType));
            }
            let image = self.image(ty, result.at)?;
            let variable = Variable {
                name: text.name.text.clone(),
                section: Section::Local,
                constant: false,
                retain: false,
                ty,
                offset: 0,
                value: None,
                address: None,
                edge: None,
                at: text.name.at,
                assigned: false,
            };
            self.add_variable(unit, variable, &image)?;
            self.units[unit].result = Some(ty);
        }
        if text.kind != UnitKind::Block {
            let image = self.units[unit].image.clone();
            self.units[unit].frame = self.memory.allocate(&image, text.name.at);
        }
        all_good
    }

    fn own_variable(&mut self, unit: usize, kind: UnitKind, text: &'a syntax::Variable) -> Read<()> {
        let section = match text.section {
            Section::Global => Some("VAR_GLOBAL"),
            Section::InOut if kind == UnitKind::Function => Some("VAR_IN_OUT"),
            Section::Output if kind == UnitKind::Function => Some("VAR_OUTPUT"),
            Section::External if kind == UnitKind::Function => Some("VAR_EXTERNAL"),
            Section::Input | Section::Output | Section::InOut | Section::Temporary if text.constant => Some("CONSTANT"),
            Section::Temporary if text.retain => Some("RETAIN"),
            _ => None,
        };
        if let Some(section) = section {
            let unit = kind.name();
            return Err(self.told.error(text.name.at, Kind::Section { section, unit }));
        }
        if text.section == Section::External {
            return self.external(unit, text);
        }
        let (mut variable, image) = self.variable(Some(unit), text)?;
        let keeps = text.retain || text.address.is_some() || matches!(variable.ty, Type::Block(_));
        let forgets = kind == UnitKind::Function || text.section == Section::Temporary;
        if forgets && keeps {
            let name = text.name.text.clone();
            return Err(self.told.error(text.name.at, Kind::StateInFunction { name }));
        }
        let image = match (text.section, kind) {
            (Section::InOut, UnitKind::Program) => {
                variable.section = Section::Shared;
                image
            }
            // A variable that is passed by reference is the address of another one.
            (Section::InOut, _) => vec![NOWHERE],
            _ => image,
        };
        let Some(is_rising) = text.edge else {
            return self.add_variable(unit, variable, &image);
        };
        // The input is the first one of the slots of a block that sees its edges; the others have names that no program writes.
        variable.edge = Some(if is_rising {
            Block::RisingEdge
        } else {
            Block::FallingEdge
        });
        let hidden = ["Q", "M"].map(|name| Variable {
            name: format!("{}.{name}", variable.name),
            section: Section::Local,
            edge: None,
            ..variable.clone()
        });
        self.add_variable(unit, variable, &image)?;
        for variable in hidden {
            self.add_variable(unit, variable, &[0])?;
        }
        Ok(())
    }

    fn add_variable(&mut self, unit: usize, mut variable: Variable, image: &[i64]) -> Read<()> {
        let at = variable.at;
        let own = &mut self.units[unit];
        if own.by_name.contains_key(&key(&variable.name)) {
            let name = variable.name;
            return Err(self.told.error(at, Kind::Twice { name }));
        }
        variable.offset = own.image.len() as u32;
        own.image.extend_from_slice(image);
        own.by_name.insert(key(&variable.name), own.variables.len());
        own.variables.push(variable);
        Ok(())
    }

    /// VAR_EXTERNAL names a global variable, which is there without it, too; its type must be that one's.
    fn external(&mut self, unit: usize, text: &'a syntax::Variable) -> Read<()> {
        let ty = self.type_of(Some(unit), &text.ty)?;
        let name = text.name.text.clone();
        let Some(global) = self.global_by_name.get(&text.name.key()) else {
            if self.refused.contains(&(None, text.name.key())) {
                return Err(Reported);
            }
            let nearest = self
                .told
                .nearest(&name, self.globals.iter().map(|global| global.name.as_str()));
            return Err(self.told.error(text.name.at, Kind::Undeclared { name, nearest }));
        };
        let global = &self.globals[*global];
        let declared = global.ty;
        if let Some(initial) = &text.initial {
            return Err(self.told.error(initial.at(), Kind::ExternalInitial { name }));
        }
        if text.constant {
            self.units[unit].constant_externals.insert(text.name.key());
        }
        if declared != ty {
            let wanted = self.types.name(declared, &self.units);
            return Err(self.told.error(text.ty.at, Kind::ExternalType { name, wanted }));
        }
        Ok(())
    }
}
