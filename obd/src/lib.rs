//! Object dictionary for POWERLINK nodes and CiA 402 devices.
//!
//! In:  const tables of object definitions ([`EntryDef`]), SDO accesses from the network, values from the application.
//! Out: values with the exact SDO abort code of every refusal, PDO copy plans ([`mapping`]), concise DCF ([`cdc`]).
//!
//! Values are kept as they travel, little endian, in one byte array of fixed size; nothing allocates. Whoever needs a value
//! in every cycle looks it up once ([`Dictionary::key`], [`mapping::CopyPlan`]) and then reads and writes without look-up.
#![no_std]

#[cfg(any(test, feature = "device"))]
extern crate std;

mod abort;
pub mod cdc;
mod data_type;
mod definition;
#[cfg(feature = "device")]
pub mod device;
mod dictionary;
pub mod mapping;

pub use abort::AbortCode;
pub use data_type::{DataType, Scalar};
pub use definition::{Access, EntryDef, PdoAccess, Value, lines_of, octets_of};
pub use dictionary::{BuildError, Dictionary, Handle, Key};

/// What an SDO server reads and writes: a plain [`Dictionary`], or a node that adds effects to some of its objects.
pub trait Objects {
    /// Copies the value to the start of `out` and returns its length; [`AbortCode::OUT_OF_MEMORY`] when `out` is too short.
    fn sdo_read(&mut self, index: u16, sub: u8, out: &mut [u8]) -> Result<usize, AbortCode>;

    /// Takes a value from the network; either stored as a whole, or refused and nothing changed.
    fn sdo_write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode>;
}
