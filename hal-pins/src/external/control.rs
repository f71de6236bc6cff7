//! The control's side of an external component.

use super::exchange::{Change, Receiver, at};
use super::{EXTERNAL_PINS_MAX, ExternalPin, Layout, MAGIC, VERSION, describe, file_name, in_order};
use crate::file::{OwnFile, create_beside};
use crate::mapped::{AtomicU64, Mapped};
use crate::{AnyValue, Hal, HalError, Input, Kind, Output, Value};
use std::sync::atomic::Ordering::{Relaxed, Release};

/// Words of the file that are looked at in a cycle: all of the largest one within some 40 cycles.
const MENDED_AT_ONCE: usize = 64;

/// An external component of this control. Dropping it ends its session and removes its file.
pub struct External {
    mapped: Mapped,
    layout: Layout,
    receiver: Receiver,
    inputs: Box<[Reader]>,
    outputs: Box<[Writer]>,
    /// What outputs are while nobody writes them; `None`: as they were.
    safe: Box<[Option<u64>]>,
    scratch: Box<[u64]>,
    alive: Output<bool>,
    losses: Output<u32>,
    /// What does not change in the file: any process may have written there.
    image: Box<[u64]>,
    /// Word of the image that is mended next.
    mended: usize,
    /// Number of the last record of inputs.
    given: u64,
    is_cut: bool,
    _file: OwnFile,
}

macro_rules! handles {
    ($($kind:ident $rust:ty),*) => {
        /// Reads the cell of a pin.
        enum Reader { $($kind(Input<$rust>)),* }
        /// Writes the cell of a pin.
        enum Writer { $($kind(Output<$rust>)),* }

        impl Reader {
            fn claim(hal: &mut Hal, name: &str, first: AnyValue) -> Result<Reader, HalError> {
                match first {
                    $(AnyValue::$kind(value) => hal.input(name, value).map(Reader::$kind)),*
                }
            }

            /// RT.
            fn cell(&self) -> u64 {
                match self {
                    $(Reader::$kind(pin) => pin.get().to_cell()),*
                }
            }
        }

        impl Writer {
            fn claim(hal: &mut Hal, name: &str, first: AnyValue) -> Result<Writer, HalError> {
                match first {
                    $(AnyValue::$kind(value) => {
                        let mut pin = hal.output(name)?;
                        pin.set(value);
                        Ok(Writer::$kind(pin))
                    }),*
                }
            }

            /// RT.
            fn set(&mut self, cell: u64) {
                match self {
                    $(Writer::$kind(pin) => pin.set(<$rust>::from_cell(cell))),*
                }
            }

            /// RT.
            fn cell(&self) -> u64 {
                match self {
                    $(Writer::$kind(pin) => pin.get().to_cell()),*
                }
            }
        }
    };
}

handles!(Bit bool, S32 i32, U32 u32, S64 i64, U64 u64, Float f64);

impl External {
    /// Claims the pins of a component, `NAME.alive` and `NAME.losses`, and makes the file by which a process writes its outputs.
    /// `cycles_max`: cycles without a record that are borne; `heartbeat_ms`: the same for the process to know.
    ///
    /// # Errors
    /// Names that are taken or break the rules, shared memory too small, too many pins, what the system refuses.
    pub fn create(
        hal: &mut Hal,
        name: &str,
        pins: &[ExternalPin],
        heartbeat_ms: u64,
        cycles_max: u64,
    ) -> Result<External, HalError> {
        let pins = in_order(pins);
        if pins.len() > EXTERNAL_PINS_MAX {
            return Err(HalError::Capacity {
                capacity: pins.len(),
                max: EXTERNAL_PINS_MAX,
            });
        }
        let (mut inputs, mut outputs, mut safe) = (Vec::new(), Vec::new(), Vec::new());
        for pin in &pins {
            let whole = format!("{name}.{}", pin.name);
            if pin.kind == Kind::Input {
                inputs.push(Reader::claim(hal, &whole, pin.value)?);
            } else {
                outputs.push(Writer::claim(hal, &whole, pin.value)?);
                safe.push((!pin.keeps).then(|| pin.value.to_cell()));
            }
        }
        let (alive, losses) = (
            hal.output(&format!("{name}.alive"))?,
            hal.output(&format!("{name}.losses"))?,
        );
        let layout = Layout::new(inputs.len(), outputs.len());
        let machine = hal.machine();
        let (file, mapped) = create_beside(hal.path(), &file_name(machine, name), 8 * layout.words)?;
        let mut image = vec![0; super::exchange::HEADER_WORDS];
        image[at::MAGIC] = MAGIC;
        image[at::VERSION] = VERSION;
        image[at::FILE_LEN] = 8 * layout.words as u64;
        image[at::PINS] = pins.len() as u64;
        image[at::INPUTS] = inputs.len() as u64;
        image[at::HEARTBEAT_MS] = heartbeat_ms;
        image[at::PID] = u64::from(std::process::id());
        image.extend(pins.iter().flat_map(describe));
        let mut external = External {
            mapped,
            receiver: Receiver::new(layout.outputs, cycles_max),
            layout,
            scratch: vec![0; outputs.len()].into(),
            inputs: inputs.into(),
            outputs: outputs.into(),
            safe: safe.into(),
            alive,
            losses,
            image: image.into(),
            mended: 0,
            given: 0,
            is_cut: false,
            _file: file,
        };
        while external.mend() != 0 {}
        external.give();
        Ok(external)
    }

    /// Takes what the process has written, `cycles` after the last call, and tells what has become of it. RT: no lock, no wait; bounded by
    /// the pins.
    pub fn take(&mut self, cycles: u64) -> Option<Change> {
        if self.is_cut {
            return None;
        }
        let (fresh, change) = self.receiver.look(self.mapped.words(), cycles, &mut self.scratch);
        let change = match self.mapped.is_lost() {
            true => {
                self.is_cut = true;
                Some(Change::CutShort)
            }
            false => change,
        };
        match change {
            Some(Change::Released | Change::Lost | Change::CutShort) => self.fall_to_safe_values(),
            Some(Change::Attached | Change::TakenOver) | None if fresh => {
                for (pin, cell) in self.outputs.iter_mut().zip(&self.scratch) {
                    pin.set(*cell);
                }
            }
            Some(Change::Attached | Change::TakenOver) | None => {}
        }
        self.alive.set(self.receiver.is_alive() && !self.is_cut);
        if let Some(Change::Lost | Change::CutShort) = change {
            self.losses.set(self.losses.get().wrapping_add(1));
        }
        change
    }

    /// Shows the process what its inputs read, and what its outputs are. RT.
    pub fn give(&mut self) {
        if self.is_cut {
            return;
        }
        self.given = self.given.wrapping_add(1).max(1);
        let words = self.mapped.words();
        let inputs = self.inputs.iter().map(Reader::cell);
        let values = inputs.chain(self.outputs.iter().map(Writer::cell));
        self.layout.inputs.put(words, self.given, 0, values);
        words[at::ENDED].store(self.receiver.ended(), Release);
        self.mend();
    }

    /// Whether a process writes its outputs.
    pub fn is_alive(&self) -> bool {
        self.alive.get()
    }

    /// Process that says it has claimed it. As it says: anybody may have written it.
    pub fn holder(&self) -> u32 {
        match self.is_cut {
            true => 0,
            false => u32::try_from(self.mapped.words()[at::HOLDER].load(Relaxed)).unwrap_or(0),
        }
    }

    /// RT.
    fn fall_to_safe_values(&mut self) {
        for (pin, cell) in self.outputs.iter_mut().zip(&self.safe) {
            if let Some(cell) = cell {
                pin.set(*cell);
            }
        }
    }

    /// Writes anew what somebody has written over, some words a call; gives the word to go on with, 0 after the last one. RT.
    fn mend(&mut self) -> usize {
        let written_otherwise = at::SESSION..at::LATEST_INPUTS + 1;
        let end = (self.mended + MENDED_AT_ONCE).min(self.image.len());
        for at in (self.mended..end).filter(|at| !written_otherwise.contains(at)) {
            let (word, value) = (&self.mapped.words()[at], self.image[at]);
            if word.load(Relaxed) != value {
                word.store(value, Release);
            }
        }
        self.mended = if end == self.image.len() { 0 } else { end };
        self.mended
    }
}

impl Drop for External {
    fn drop(&mut self) {
        let store = |word: &AtomicU64, value| word.store(value, Release);
        if !self.is_cut {
            // So that a process that goes on hears of it at once.
            let words = self.mapped.words();
            store(&words[at::MAGIC], 0);
        }
    }
}
