//! Pins of the variables of a program.
//!
//! In:  the interface of the program. Out: a reader for each input, a writer for each output.
//!
//! RT: [`Reader::get`], [`Writer::set`], [`Writer::set_safe`]; the rest is made at start-up.

use super::convert::cell_of;
use super::shared::NO_TEXT;
use config::{End, LogicPin, LogicTask};
use hal_pins::{Hal, HalError, Input, Output, Type, Value};
use logic::Logic;

/// What a variable reads.
pub(super) enum Reader {
    Bit(Input<bool>),
    S32(Input<i32>),
    U32(Input<u32>),
    S64(Input<i64>),
    U64(Input<u64>),
    Float(Input<f64>),
    /// Not there yet.
    Unbound,
}

impl Reader {
    /// The pin of an input, with the value that the program gives it at the start; one of another's pin is bound later.
    pub(super) fn claim(hal: &mut Hal, logic: &Logic, pin: &LogicPin) -> Result<Reader, HalError> {
        let End::Own { pin: name, kind } = &pin.end else {
            return Ok(Reader::Unbound);
        };
        let slot = logic
            .slot_value(&pin.variable, logic.initial(&pin.variable))
            .unwrap_or(0);
        let cell = cell_of(pin.variable.scalar(), slot);
        let reader = match kind {
            Type::Bit => Reader::Bit(hal.input(name, bool::from_cell(cell))?),
            Type::S32 => Reader::S32(hal.input(name, i32::from_cell(cell))?),
            Type::U32 => Reader::U32(hal.input(name, u32::from_cell(cell))?),
            Type::S64 => Reader::S64(hal.input(name, i64::from_cell(cell))?),
            Type::U64 => Reader::U64(hal.input(name, u64::from_cell(cell))?),
            Type::Float => Reader::Float(hal.input(name, f64::from_cell(cell))?),
        };
        unit(hal, name, pin)?;
        Ok(reader)
    }

    /// The pin of something else.
    pub(super) fn bind(&mut self, hal: &Hal, pin: &LogicPin) -> Result<(), HalError> {
        if let End::Elsewhere { pin, kind, .. } = &pin.end {
            *self = match kind {
                Type::Bit => Reader::Bit(hal.reader(pin)?),
                Type::S32 => Reader::S32(hal.reader(pin)?),
                Type::U32 => Reader::U32(hal.reader(pin)?),
                Type::S64 => Reader::S64(hal.reader(pin)?),
                Type::U64 => Reader::U64(hal.reader(pin)?),
                Type::Float => Reader::Float(hal.reader(pin)?),
            };
        }
        Ok(())
    }

    /// The cell of the pin.
    pub(super) fn get(&self) -> u64 {
        match self {
            Reader::Bit(pin) => pin.get().to_cell(),
            Reader::S32(pin) => pin.get().to_cell(),
            Reader::U32(pin) => pin.get().to_cell(),
            Reader::S64(pin) => pin.get().to_cell(),
            Reader::U64(pin) => pin.get().to_cell(),
            Reader::Float(pin) => pin.get().to_cell(),
            Reader::Unbound => 0,
        }
    }
}

/// What a variable writes, and its safe value.
pub(super) struct Writer {
    pin: Target,
    safe: u64,
}

enum Target {
    Bit(Output<bool>),
    S32(Output<i32>),
    U32(Output<u32>),
    S64(Output<i64>),
    U64(Output<u64>),
    Float(Output<f64>),
    /// A text.
    None,
}

impl Writer {
    /// The pin of an output, which begins with its safe value.
    pub(super) fn claim(hal: &mut Hal, task: &LogicTask, pin: &LogicPin) -> Result<Writer, HalError> {
        let (End::Own { pin: name, kind } | End::Elsewhere { own: name, kind, .. }) = &pin.end else {
            return Ok(Writer {
                pin: Target::None,
                safe: NO_TEXT,
            });
        };
        let safe = task.safe_value(&task.logic.name(&pin.variable));
        let target = match kind {
            Type::Bit => Target::Bit(hal.output(name)?),
            Type::S32 => Target::S32(hal.output(name)?),
            Type::U32 => Target::U32(hal.output(name)?),
            Type::S64 => Target::S64(hal.output(name)?),
            Type::U64 => Target::U64(hal.output(name)?),
            Type::Float => Target::Float(hal.output(name)?),
        };
        unit(hal, name, pin)?;
        let mut writer = Writer {
            pin: target,
            safe: cell_of(pin.variable.scalar(), safe),
        };
        writer.set_safe();
        Ok(writer)
    }

    pub(super) fn set(&mut self, cell: u64) {
        match &mut self.pin {
            Target::Bit(pin) => pin.set(bool::from_cell(cell)),
            Target::S32(pin) => pin.set(i32::from_cell(cell)),
            Target::U32(pin) => pin.set(u32::from_cell(cell)),
            Target::S64(pin) => pin.set(i64::from_cell(cell)),
            Target::U64(pin) => pin.set(u64::from_cell(cell)),
            Target::Float(pin) => pin.set(f64::from_cell(cell)),
            Target::None => {}
        }
    }

    pub(super) fn set_safe(&mut self) {
        self.set(self.safe);
    }
}

fn unit(hal: &mut Hal, name: &str, pin: &LogicPin) -> Result<(), HalError> {
    match pin.variable.scalar() {
        Some(logic::Scalar::Time) => hal.set_unit(name, "s"),
        _ => Ok(()),
    }
}
