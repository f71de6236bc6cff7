//! Parameters: `#1` to `#5601`, `#<local>`, `#<_global>`.
//!
//! In:  assignments of the program, and the state for those that only tell something.
//! Out: values for expressions; what is kept in a parameter file.
//!
//! What the interpreter predefines is in `predefined`; parameter files in `file`.

pub mod file;
mod predefined;

use crate::Settings;
use motion::canon::{AXES, Position};
use std::collections::HashMap;

pub(crate) use predefined::{is_read_only, is_read_only_number};

/// Greatest number of a parameter; the smallest one is 1.
pub const PARAMETER_MAX: u16 = 5601;

/// Arguments of a subroutine: #1 to #30.
pub(crate) const ARGUMENTS_MAX: usize = 30;

/// First parameter of the stored point of G28; the other axes follow.
pub(crate) const G28_POINT: u32 = 5161;
/// First parameter of the stored point of G30.
pub(crate) const G30_POINT: u32 = 5181;
/// 1 where the offset of G92 and G52 is in effect.
pub(crate) const G92_ACTIVE: u32 = 5210;
/// First parameter of the offset of G92 and G52.
pub(crate) const G92_OFFSET: u32 = 5211;
/// Active work system, 1 to 9.
pub(crate) const ACTIVE_SYSTEM: u32 = 5220;
/// First parameter of the point where the probe tripped, work coordinates in program units.
pub(crate) const PROBED_POINT: u32 = 5061;
/// 1 where the last probing move tripped.
pub(crate) const PROBED: u32 = 5070;
/// Result of M66.
pub(crate) const INPUT_RESULT: u32 = 5399;

/// First parameter of the origin of a work system, 1 to 9; its rotation stands behind its nine axes.
pub(crate) fn system_origin(system: u8) -> u32 {
    5201 + 20 * u32::from(system)
}

/// Rotation of a work system, degrees.
pub(crate) fn system_rotation(system: u8) -> u32 {
    system_origin(system) + AXES as u32
}

/// Named parameters of one level of subroutine calls.
type Names = HashMap<Box<str>, f64>;

/// What parameters hold.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Parameters {
    /// By number; 0 is not used.
    numbered: Box<[f64]>,
    globals: Names,
    /// One a level of calls, the present one last.
    locals: Vec<Names>,
    /// Numbers that a parameter file keeps, besides those that it always does.
    kept: Vec<u16>,
}

impl Parameters {
    pub(crate) fn new(settings: &Settings) -> Parameters {
        let mut parameters = Parameters {
            numbered: vec![0.0; usize::from(PARAMETER_MAX) + 1].into_boxed_slice(),
            globals: Names::new(),
            locals: vec![Names::new()],
            kept: settings.parameters.keys().copied().collect(),
        };
        parameters.numbered[5599] = 1.0; // DEBUG comments are shown
        for (index, value) in &settings.parameters {
            if let Some(slot) = parameters.numbered.get_mut(usize::from(*index)) {
                *slot = *value;
            }
        }
        let unit = settings.machine_unit;
        parameters.set_position(G28_POINT, settings.g28, unit);
        parameters.set_position(G30_POINT, settings.g30, unit);
        parameters.set_position(G92_OFFSET, settings.g92_offset, unit);
        parameters.set(G92_ACTIVE, f64::from(settings.g92_active));
        parameters.set(ACTIVE_SYSTEM, f64::from(settings.work_system.clamp(1, 9)));
        for (system, (origin, degrees)) in (1..).zip(settings.work_offsets.iter().zip(settings.work_rotations_degrees))
        {
            parameters.set_position(system_origin(system), *origin, unit);
            parameters.set(system_rotation(system), degrees);
        }
        parameters
    }

    /// A parameter by its number, at most [`PARAMETER_MAX`].
    pub(crate) fn get(&self, index: u32) -> f64 {
        self.numbered[index as usize]
    }

    /// Sets a parameter by its number, at most [`PARAMETER_MAX`].
    pub(crate) fn set(&mut self, index: u32, value: f64) {
        self.numbered[index as usize] = value;
    }

    /// Nine parameters in machine units as a position.
    pub(crate) fn position(&self, first: u32, unit: motion::canon::LengthUnit) -> Position {
        let mut position = Position::ZERO;
        for axis in motion::canon::Axis::ALL {
            let value = self.get(first + axis as u32);
            position[axis] = if axis.is_rotary() { value } else { value * unit.mm() };
        }
        position
    }

    /// Keeps a position in nine parameters, in machine units.
    pub(crate) fn set_position(&mut self, first: u32, position: Position, unit: motion::canon::LengthUnit) {
        for axis in motion::canon::Axis::ALL {
            let value = position[axis];
            let value = if axis.is_rotary() { value } else { value / unit.mm() };
            self.set(first + axis as u32, value);
        }
    }

    /// #1 to #30.
    pub(crate) fn arguments(&self) -> [f64; ARGUMENTS_MAX] {
        std::array::from_fn(|at| self.numbered[at + 1])
    }

    /// Sets #1 to #30.
    pub(crate) fn set_arguments(&mut self, values: [f64; ARGUMENTS_MAX]) {
        self.numbered[1..=ARGUMENTS_MAX].copy_from_slice(&values);
    }

    /// A named parameter of the program, local or global by its first character.
    pub(crate) fn named(&self, name: &str) -> Option<f64> {
        self.names(name).get(name).copied()
    }

    /// Sets a named parameter.
    pub(crate) fn set_named(&mut self, name: &str, value: f64) {
        let names = if name.starts_with('_') {
            &mut self.globals
        } else {
            self.locals.last_mut().expect("the level of the program is never left")
        };
        match names.get_mut(name) {
            Some(slot) => *slot = value,
            None => {
                names.insert(name.into(), value);
            }
        }
    }

    fn names(&self, name: &str) -> &Names {
        if name.starts_with('_') {
            &self.globals
        } else {
            self.locals.last().expect("the level of the program is never left")
        }
    }

    /// Takes over what another text has left and no file keeps: global names, numbers below those of stored points, result of M66.
    pub(crate) fn take_over(&mut self, left: &Parameters) {
        self.globals.clone_from(&left.globals);
        for index in (1..G28_POINT as u16).chain([INPUT_RESULT as u16]) {
            if !self.kept.contains(&index) {
                self.set(u32::from(index), left.get(u32::from(index)));
            }
        }
    }

    /// Begins a level of calls without named parameters.
    pub(crate) fn enter(&mut self) {
        self.locals.push(Names::new());
    }

    /// Ends a level of calls.
    pub(crate) fn leave(&mut self) {
        if self.locals.len() > 1 {
            self.locals.pop();
        }
    }

    /// The name that was probably meant by one that is not defined.
    pub(crate) fn nearest(&self, name: &str) -> Option<String> {
        let known = self
            .globals
            .keys()
            .chain(self.names("local").keys())
            .map(|name| &**name);
        crate::near_miss::nearest(name, known.chain(predefined::NAMES.iter().copied())).map(String::from)
    }

    /// Numbers and values that a parameter file keeps, ascending.
    pub(crate) fn kept(&self) -> impl Iterator<Item = (u16, f64)> {
        self.kept.iter().map(|index| (*index, self.get(u32::from(*index))))
    }
}
