//! Declarations and statements to instructions: names, types, layout of the memory, the longest way through a scan.
//!
//! In:  a file as it is written.
//! Out: a [`Logic`], or what is wrong with the file.
//!
//! `declare` lays out variables, `expression` and `statement` turn what is written into a tree whose names and types are known,
//! `emit` turns that into instructions. A unit is compiled before the first one that calls it, so a call of one that is under way is a recursion.

mod assign;
mod call;
mod declare;
mod emit;
mod expression;
mod function;
mod memory;
mod operator;
mod place;
mod statement;
mod text;
mod tree;
mod types;

use crate::block::Block;
use crate::code::{Op, Switch};
use crate::diagnostic::{Diagnostic, Diagnostics, Kind, Lines, Span};
use crate::logic::{Leaf, Logic, Names, Role, Unbound, Variable as LogicVariable};
use crate::scalar::Scalar;
use crate::syntax::{self, Section, UnitKind};
use crate::{parse, token};
use memory::Memory;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use text::Texts;
use types::Type;

pub use memory::MEMORY_MAX;

/// Octets of a program at most.
pub const TEXT_MAX: usize = 1 << 20;
/// Iterations to which a loop is bound where the program tells nothing else.
pub const ITERATIONS_MAX: u32 = 1000;
/// Instructions of a program at most.
const CODE_MAX: usize = 1 << 20;
/// Octets of the names of all single values at most.
const NAMES_MAX: usize = 1 << 24;
/// Types and calls are nested so deep at most.
const DEPTH_MAX: usize = 32;

/// Compiles a file.
///
/// # Errors
/// All that is wrong with it, with warnings and notes, in the order of the text.
pub fn compile(text: &str) -> Result<Logic, Vec<Diagnostic>> {
    let mut told = Diagnostics::new(text);
    if text.len() > TEXT_MAX {
        told.error(Span::default(), Kind::TooLong { most: TEXT_MAX });
        return Err(told.finish());
    }
    if is_xml(text) {
        told.error(Span::default(), Kind::Xml);
        return Err(told.finish());
    }
    let tokens = token::tokens(text, &mut told);
    let file = parse::file(tokens, &mut told);
    let mut compiler = Compiler::new(&file, told);
    compiler.declare();
    compiler.bodies();
    compiler.finish()
}

/// Whether a text is the file of a tool that keeps programs in XML: no program begins so.
fn is_xml(text: &str) -> bool {
    let text = text.trim_start_matches(|letter: char| letter.is_whitespace() || letter == '\u{feff}');
    let behind = text.strip_prefix('<').and_then(|rest| rest.chars().next());
    behind.is_some_and(|letter| letter.is_ascii_alphabetic() || matches!(letter, '?' | '!'))
}

/// Where the compilation of something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State<T> {
    Untouched,
    UnderWay,
    Done(T),
    /// Told already.
    Wrong,
}

/// A variable of a unit, or a global one.
#[derive(Clone, Debug)]
struct Variable {
    name: String,
    section: Section,
    constant: bool,
    retain: bool,
    ty: Type,
    /// Slots behind the first one of its unit; of a global variable its slot.
    offset: u32,
    /// Of a constant of an elementary type.
    value: Option<i64>,
    address: Option<String>,
    /// The block that sees the edges of an input, whose first slot it is.
    edge: Option<Block>,
    at: Span,
    /// Some statement assigns it.
    assigned: bool,
}

/// A unit: those of the file, and the standard blocks.
#[derive(Debug)]
struct Unit<'a> {
    name: String,
    kind: UnitKind,
    /// `None`: a standard block.
    text: Option<&'a syntax::Unit>,
    block: Option<Block>,
    variables: Vec<Variable>,
    by_name: BTreeMap<String, usize>,
    result: Option<Type>,
    /// Names of VAR_EXTERNAL CONSTANT.
    constant_externals: BTreeSet<String>,
    /// Of its variables, and of its code.
    interface: State<()>,
    body: State<Body>,
    /// Values of its variables at the start.
    image: Vec<i64>,
    /// First slot of a program or function.
    frame: u32,
}

/// The code of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Body {
    entry: u32,
    /// Of the longest way through it, those of the call not counted.
    steps: u64,
    /// Values on the stack at most, calls that are under way at most.
    stack: usize,
    nesting: usize,
}

/// A type that has a name, and the values it gives at the start where it gives some.
type Declared = (Type, Option<Rc<[i64]>>);

struct Compiler<'a, 't> {
    file: &'a syntax::File,
    told: Diagnostics<'t>,
    types: types::Types,
    /// By name: place in the file, and what became of it.
    declared: BTreeMap<String, (usize, State<Declared>)>,
    values: BTreeMap<String, Vec<(u32, i64)>>,
    /// Enumerations without a name, by the octet at which they begin.
    unnamed: BTreeMap<u32, Type>,
    units: Vec<Unit<'a>>,
    unit_by_name: BTreeMap<String, usize>,
    globals: Vec<Variable>,
    global_by_name: BTreeMap<String, usize>,
    memory: Memory,
    /// Names that were declared wrongly, of units and of VAR_GLOBAL: told once.
    refused: BTreeSet<(Option<usize>, String)>,
    /// Inputs of functions that calls give values to.
    given: usize,
    depth: usize,
    code: Vec<Op>,
    /// Octets of the text.
    places: Vec<u32>,
    switches: Vec<Switch>,
    /// Loops whose bound is missing, and their steps.
    unbound: Vec<(Span, u64)>,
    texts: Texts,
    falling_edge_told: bool,
}

/// Single values of variables, as they are found.
#[derive(Default)]
struct Leaves {
    all: Vec<LogicVariable>,
    /// Of their names.
    octets: usize,
}

impl<'a, 't> Compiler<'a, 't> {
    fn new(file: &'a syntax::File, told: Diagnostics<'t>) -> Compiler<'a, 't> {
        Compiler {
            file,
            told,
            types: types::Types::default(),
            declared: BTreeMap::new(),
            values: BTreeMap::new(),
            unnamed: BTreeMap::new(),
            units: Vec::new(),
            unit_by_name: BTreeMap::new(),
            globals: Vec::new(),
            global_by_name: BTreeMap::new(),
            memory: Memory::default(),
            refused: BTreeSet::new(),
            given: 0,
            depth: 0,
            code: Vec::new(),
            places: Vec::new(),
            switches: Vec::new(),
            unbound: Vec::new(),
            texts: Texts::new(),
            falling_edge_told: false,
        }
    }

    fn unit(&self, unit: usize) -> &Unit<'a> {
        &self.units[unit]
    }

    fn bodies(&mut self) {
        for unit in 0..self.units.len() {
            // What is wrong has been told.
            let _ = self.body(unit, Span::default());
        }
        if !self.file.units.iter().any(|unit| unit.kind == UnitKind::Program) && !self.told.has_errors() {
            self.told.error(Span::default(), Kind::NoProgram);
        }
    }

    fn finish(mut self) -> Result<Logic, Vec<Diagnostic>> {
        let entry = self.code.len() as u32;
        let (mut steps_max, mut stack, mut nesting) = (1_u64, 0, 0);
        for unit in 0..self.units.len() {
            let State::Done(body) = self.units[unit].body else {
                continue;
            };
            if self.units[unit].kind != UnitKind::Program {
                continue;
            }
            self.code.push(Op::Address(self.units[unit].frame));
            self.code.push(Op::Call(body.entry));
            steps_max = steps_max.saturating_add(body.steps).saturating_add(2);
            stack = stack.max(1 + body.stack);
            nesting = nesting.max(1 + body.nesting);
        }
        self.code.push(Op::Return);
        self.memory.tell_what_is_beyond(&mut self.told);
        if self.code.len() > CODE_MAX {
            self.told.error(Span::default(), Kind::Code { most: CODE_MAX });
        }
        if self.told.has_errors() {
            return Err(self.told.finish());
        }
        self.addresses();
        let cuts = self.texts.cuts(&self.code, &mut self.told);
        let ranks = self.texts.ranks(&self.code);
        if self.told.has_errors() {
            return Err(self.told.finish());
        }
        let lines = Rc::clone(&self.told.lines);
        let mut places: Vec<(u32, u32)> = self.places.iter().map(|at| lines.place(*at)).collect();
        places.resize(self.code.len(), (1, 1));
        let variables = self.leaves(&lines);
        if self.told.has_errors() {
            return Err(self.told.finish());
        }
        let mut retained: Vec<u32> = variables
            .iter()
            .filter(|variable| variable.retain)
            .map(|variable| variable.slot)
            .collect();
        retained.sort_unstable();
        let unbound = self.unbound.iter().map(|(at, steps)| {
            let (line, column) = lines.place(at.start);
            Unbound {
                line,
                column,
                steps: *steps,
            }
        });
        let mut unbound: Vec<Unbound> = unbound.collect();
        unbound.sort_unstable_by_key(|found| (found.line, found.column));
        let enumerations = self.types.enumerations.drain(..).map(|enumeration| enumeration.values);
        Ok(Logic {
            enumerations: enumerations.collect(),
            code: self.code.into(),
            places: places.into(),
            switches: self.switches.into(),
            texts: self.texts.into_all(),
            cuts: cuts.into(),
            ranks: ranks.into(),
            memory: self.memory.into_values(),
            entry,
            stack,
            nesting,
            steps_max,
            unbound: unbound.into(),
            names: Names::of(&variables),
            variables,
            retained: retained.into(),
            warnings: self.told.finish(),
        })
    }

    /// No two variables are at one address: neither would know what the other assigns.
    fn addresses(&mut self) {
        let mut known = BTreeSet::new();
        let own = self.units.iter().flat_map(|unit| &unit.variables);
        for variable in self.globals.iter().chain(own) {
            let Some(address) = variable.address.as_ref().filter(|address| !address.ends_with('*')) else {
                continue;
            };
            let bit = address
                .strip_prefix('%')
                .filter(|rest| rest.as_bytes().get(1).is_some_and(u8::is_ascii_digit));
            let address = bit.map_or_else(|| address.clone(), |bit| format!("%{}X{}", &bit[..1], &bit[1..]));
            if !known.insert(address.clone()) {
                let name = variable.name.clone();
                self.told.error(variable.at, Kind::AddressTwice { name, address });
            }
        }
    }

    /// All variables of programs and all global ones by their single values, in the order of the file.
    fn leaves(&mut self, lines: &Lines<'_>) -> Vec<LogicVariable> {
        let mut leaves = Leaves::default();
        let globals = self.globals.iter().map(|variable| ("", 0, variable));
        let programs = self.units.iter().filter(|unit| unit.kind == UnitKind::Program);
        let own = programs.flat_map(|unit| {
            unit.variables
                .iter()
                .map(|variable| (unit.name.as_str(), unit.frame, variable))
        });
        let mut all: Vec<_> = globals.chain(own).collect();
        all.sort_by_key(|(.., variable)| variable.at.start);
        for (program, frame, variable) in all {
            if matches!(variable.section, Section::InOut | Section::External) {
                continue;
            }
            let address = variable.address.as_deref();
            let role = match (
                variable.section,
                address.map(|address| address.get(..2).unwrap_or_default()),
            ) {
                (Section::Input, _) | (_, Some("%I")) => Role::Input,
                (Section::Output, _) | (_, Some("%Q")) => Role::Output,
                (Section::Shared, _) if variable.assigned => Role::Output,
                (Section::Shared, _) => Role::Input,
                (_, Some(pin)) if !pin.starts_with('%') => {
                    if variable.assigned {
                        Role::Output
                    } else {
                        Role::Input
                    }
                }
                _ => Role::Internal,
            };
            let whole = LogicVariable {
                name: variable.name.clone(),
                program: program.to_owned(),
                ty: String::new(),
                role,
                retain: variable.retain,
                constant: variable.constant,
                address: variable.address.clone(),
                line: lines.place(variable.at.start).0,
                slot: frame + variable.offset,
                kind: Leaf::Scalar(Scalar::Bool),
            };
            self.leaves_of(variable.ty, &whole, &mut leaves);
        }
        if leaves.octets > NAMES_MAX {
            self.told.error(Span::default(), Kind::Names { most: NAMES_MAX });
        }
        self.place(&mut leaves.all);
        leaves.all
    }

    /// Gives variables that are declared AT %I* and the like the addresses of VAR_CONFIG. One that has none there is read and
    /// written by its name.
    fn place(&mut self, variables: &mut [LogicVariable]) {
        let file = self.file;
        if !file.placed.is_empty() {
            let taken = variables.iter().filter_map(|variable| variable.address.clone());
            let mut taken: BTreeSet<String> = taken.collect();
            let names = variables.iter().enumerate();
            let known: BTreeMap<String, usize> = names
                .map(|(index, one)| (one.full_name().to_ascii_lowercase(), index))
                .collect();
            for placed in &file.placed {
                let mut path: Vec<String> = placed.path.iter().map(syntax::Name::key).collect();
                if file
                    .resources
                    .iter()
                    .any(|resource| Some(&resource.key()) == path.first())
                {
                    path.remove(0);
                }
                let ty = file
                    .instances
                    .iter()
                    .find(|(instance, _)| Some(&instance.key()) == path.first());
                if let (Some((_, ty)), Some(program)) = (ty, path.first_mut()) {
                    *program = ty.key();
                }
                let (address, at) = &placed.address;
                // A pin may be read or written, whichever the program does.
                let letters = address
                    .get(..2)
                    .filter(|letters| letters.starts_with('%'))
                    .unwrap_or("%");
                let found = known.get(&path.join(".")).map(|index| &mut variables[*index]);
                let same_type = |one: &&mut LogicVariable| match &placed.ty.kind {
                    syntax::TypeKind::Named(name) => one.ty.eq_ignore_ascii_case(&name.text),
                    _ => false,
                };
                let is_open = |one: &&mut LogicVariable| {
                    one.address
                        .as_ref()
                        .is_some_and(|open| open.ends_with('*') && open.starts_with(letters))
                };
                let Some(found) = found.filter(is_open).filter(same_type) else {
                    let names: Vec<&str> = placed.path.iter().map(|name| name.text.as_str()).collect();
                    let (name, address) = (names.join("."), format!("{letters}*"));
                    self.told.error(*at, Kind::NotToBePlaced { name, address });
                    continue;
                };
                let ty = found.scalar().map_or(Type::AnyInteger, Type::Scalar);
                if self.address(ty, address, *at, true).is_ok() {
                    if !taken.insert(address.clone()) {
                        let (name, address) = (found.name.clone(), address.clone());
                        self.told.error(*at, Kind::AddressTwice { name, address });
                    }
                    found.address = Some(address.clone());
                }
            }
        }
        for variable in variables {
            variable.address = variable.address.take().filter(|address| !address.ends_with('*'));
        }
    }

    fn leaves_of(&self, ty: Type, whole: &LogicVariable, leaves: &mut Leaves) {
        leaves.octets += whole.name.len() + whole.program.len();
        if leaves.octets > NAMES_MAX {
            return;
        }
        let part = |name: String, offset: u32| LogicVariable {
            name,
            slot: whole.slot + offset,
            ..whole.clone()
        };
        let kind = match ty {
            Type::Scalar(scalar) => Leaf::Scalar(scalar),
            Type::Text(length) => Leaf::Text(length),
            Type::Enumeration(index) => Leaf::Enumeration(index),
            Type::Structure(index) => {
                for member in &self.types.structures[index as usize].members {
                    self.leaves_of(
                        member.ty,
                        &part(format!("{}.{}", whole.name, member.name), member.offset),
                        leaves,
                    );
                }
                return;
            }
            Type::Array(index) => {
                let array = &self.types.arrays[index as usize];
                let stride = self.types.size(array.element, &self.units);
                let count = array
                    .dimensions
                    .iter()
                    .map(|(_, length)| *length as usize)
                    .product::<usize>();
                for element in 0..count {
                    let name = format!("{}[{}]", whole.name, array.indices(element));
                    self.leaves_of(array.element, &part(name, element as u32 * stride), leaves);
                }
                return;
            }
            Type::Block(unit) => {
                for variable in &self.units[unit as usize].variables {
                    if variable.section != Section::InOut {
                        self.leaves_of(
                            variable.ty,
                            &LogicVariable {
                                role: match variable.address.as_deref() {
                                    Some("%I*") => Role::Input,
                                    Some("%Q*") => Role::Output,
                                    _ => whole.role,
                                },
                                address: variable.address.clone().or_else(|| whole.address.clone()),
                                retain: whole.retain || variable.retain,
                                constant: whole.constant || variable.constant,
                                ..part(format!("{}.{}", whole.name, variable.name), variable.offset)
                            },
                            leaves,
                        );
                    }
                }
                return;
            }
            Type::AnyInteger | Type::AnyReal => return,
        };
        leaves.all.push(LogicVariable {
            ty: self.types.name(ty, &self.units),
            kind,
            ..whole.clone()
        });
    }
}
