//! External components: pins of a control whose outputs another process writes.
//!
//! In:  pins of the machine file ([`External::create`]), records of the process ([`External::take`]).
//! Out: its outputs, or their safe values while nobody writes them; what its inputs read, for the process ([`External::give`]).
//!
//! ```text
//!  control                        isocnc-external-NAME.MACHINE                    process
//!  pins ◀─ External::take ─── outputs: two records, number of the latest ◀─── Claim::update
//!  pins ── External::give ──▶ inputs:  two records, number of the latest ───▶ Claim::update
//! ```
//!
//! The pins belong to the control; nothing of the process is read anywhere else than in its own file, and nothing of that but whole
//! records. One process at a time writes: it holds a lock on the file (`flock`), which the kernel takes away with the process. A
//! record renews its heartbeat; if none comes in time, the control shows the safe values and ends the session: what was hung and
//! goes on has to claim the component anew.
//!
//! `docs/external-components.md` says all of it for other languages; `clients/` has C and Python.

mod claim;
mod control;
pub(crate) mod exchange;

pub use claim::{Claim, Lost};
pub use control::External;
pub use exchange::Change;

use crate::{AnyValue, HalError, Kind, NAME_LEN_MAX, Type, check_name};

pub(crate) const MAGIC: u64 = u64::from_le_bytes(*b"isocEXT\n");
pub(crate) const VERSION: u64 = 1;
/// Most pins of an external component.
pub const EXTERNAL_PINS_MAX: usize = 256;
/// Words of the description of a pin: type, direction and length of the name; safe value; name.
const PIN_WORDS: usize = 2 + NAME_LEN_MAX / 8;

/// A pin of an external component.
#[derive(Clone, Debug, PartialEq)]
pub struct ExternalPin {
    /// Name behind that of the component.
    pub name: String,
    /// [`Kind::Output`]: the process writes it; [`Kind::Input`]: it reads it.
    pub kind: Kind,
    /// Of an output what it is while nobody writes it; of an input what it is until somebody sets it. Its type is the pin's.
    pub value: AnyValue,
    /// While nobody writes it any more, it stays as it was: for what is counted, whose fall would be a move.
    pub keeps: bool,
}

impl ExternalPin {
    /// Type of its value.
    pub fn value_type(&self) -> Type {
        self.value.kind()
    }
}

/// Name of the file; dots of the component would hide where the name of the machine begins, and no name of a pin has `_`.
fn file_name(machine: &str, component: &str) -> String {
    format!("isocnc-external-{}.{machine}", component.replace('.', "_"))
}

/// Where everything lies in a file.
#[derive(Clone, Copy, Debug)]
struct Layout {
    outputs: exchange::Channel,
    inputs: exchange::Channel,
    words: usize,
}

impl Layout {
    /// Of so many inputs and outputs. The process is told of outputs, too: as they are now.
    fn new(inputs: usize, outputs: usize) -> Layout {
        let pins = inputs + outputs;
        let of_outputs = exchange::HEADER_WORDS + pins * PIN_WORDS;
        let of_inputs = of_outputs + exchange::channel_words(outputs);
        Layout {
            outputs: exchange::Channel::new(exchange::at::LATEST_OUTPUTS, of_outputs, outputs),
            inputs: exchange::Channel::new(exchange::at::LATEST_INPUTS, of_inputs, pins),
            words: of_inputs + exchange::channel_words(pins),
        }
    }
}

/// The description of a pin.
fn describe(pin: &ExternalPin) -> [u64; PIN_WORDS] {
    let name = pin.name.as_bytes();
    let mut words = [0; PIN_WORDS];
    words[0] = u64::from(pin.value_type() as u8) | u64::from(pin.kind as u8) << 8 | (name.len() as u64) << 16;
    words[1] = pin.value.to_cell();
    for (word, octets) in words[2..].iter_mut().zip(name.chunks(8)) {
        let mut eight = [0; 8];
        eight[..octets.len()].copy_from_slice(octets);
        *word = u64::from_le_bytes(eight);
    }
    words
}

/// A pin of a description that may be damaged.
fn described(words: &[u64]) -> Result<ExternalPin, String> {
    let value_type = Type::from_octet(words[0] as u8).ok_or_else(|| format!("type {}", words[0] as u8))?;
    let kind = Kind::from_octet((words[0] >> 8) as u8).filter(|kind| *kind != Kind::Net);
    let kind = kind.ok_or_else(|| format!("direction {}", (words[0] >> 8) as u8))?;
    let octets: Vec<u8> = words[2..].iter().flat_map(|word| word.to_le_bytes()).collect();
    let len = usize::try_from(words[0] >> 16).unwrap_or(usize::MAX);
    let name = octets.get(..len).and_then(|name| std::str::from_utf8(name).ok());
    let name = name.filter(|name| check_name(name).is_ok());
    Ok(ExternalPin {
        name: name.ok_or("a name that is none")?.to_owned(),
        kind,
        value: AnyValue::from_cell(value_type, words[1]),
        keeps: false,
    })
}

/// Nothing else than inputs and outputs, not too many, inputs first.
fn in_order(pins: &[ExternalPin]) -> Vec<ExternalPin> {
    let of = |kind: Kind| pins.iter().filter(move |pin| pin.kind == kind).cloned();
    of(Kind::Input).chain(of(Kind::Output)).collect()
}

/// Its place among those of that name.
fn index_of(pins: &[ExternalPin], name: &str) -> Result<usize, HalError> {
    let at = pins.iter().position(|pin| pin.name == name);
    at.ok_or_else(|| HalError::Unknown {
        name: name.to_owned(),
        hint: crate::nearest(name, pins.iter().map(|pin| pin.name.as_str())).map(str::to_owned),
    })
}
