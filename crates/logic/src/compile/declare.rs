//! Types, variables and units: what is declared, and where it lies in memory.

use super::expression::Checker;
use super::types::{ArrayType, Enumeration, Member, Structure, Type};
use super::{Compiler, DEPTH_MAX, Declared, LAYOUT_MAX, MEMORY_MAX, State, Unit, Variable};
use crate::block::Block;
use crate::code::NOWHERE;
use crate::diagnostic::{Kind, Reported, Span};
use crate::scalar::Scalar;
use crate::syntax::{self, Expression, Initial, Name, Section, TypeKind, TypeText, UnitKind, key};
use std::collections::{BTreeMap, BTreeSet, HashMap};

type Read<T> = Result<T, Reported>;

/// Octets of the name of an enumeration that is given none, about.
const NAME_MAX: usize = 100;

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
        variable.offset = self.allocate(&image, text.name.at);
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
                        self.lay_out(initial.len(), text.name.at)?;
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

    /// Type of this name.
    fn named_type(&mut self, name: &Name) -> Read<Declared> {
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
            return Err(self.too_great(needed, name.at));
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

    fn type_of(&mut self, unit: Option<usize>, text: &'a TypeText) -> Read<Type> {
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
                    return Err(self.too_great(needed, text.at));
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

    /// So many values more are laid out.
    fn lay_out(&mut self, values: usize, at: Span) -> Read<()> {
        self.laid_out = self.laid_out.saturating_add(values);
        if self.laid_out <= LAYOUT_MAX {
            return Ok(());
        }
        // Told at the end, once.
        self.needed = self.needed.saturating_add(values);
        self.beyond = self.beyond.or(Some(at));
        Err(Reported)
    }

    /// Values of something that is given none.
    fn image(&mut self, ty: Type, at: Span) -> Read<Vec<i64>> {
        let size = self.types.size(ty, &self.units) as usize;
        self.lay_out(size, at)?;
        Ok(self.types.image(ty, &self.units))
    }

    /// Values that stand behind `:=`.
    fn initial(&mut self, unit: Option<usize>, ty: Type, initial: &'a Initial) -> Read<Vec<i64>> {
        match (initial, ty) {
            (Initial::Value(value), _) if ty.is_single() => {
                self.lay_out(1, value.at)?;
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
            self.units[unit].frame = self.allocate(&image, text.name.at);
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
