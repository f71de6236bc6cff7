//! Object dictionary for POWERLINK nodes and CiA 402 devices.
//!
//! In:  const tables of object definitions ([`EntryDef`]), SDO accesses from the network, values from the application.
//! Out: values with the exact SDO abort code of every refusal, PDO copy plans ([`mapping`]), concise DCF ([`cdc`]).
//!
//! Values are kept as they travel, little endian, in one byte array of fixed size; nothing allocates. Whoever needs a value
//! in every cycle looks it up once ([`Dictionary::key`], [`mapping::CopyPlan`]) and then reads and writes without look-up.
//!
//! ```
//! use obd::{AbortCode, DataType, Dictionary, EntryDef, lines_of, octets_of};
//!
//! const DEVICE: &[EntryDef] = &[
//!     EntryDef::rw(0x6060, DataType::I8, "mode of operation").limits(0, 10),
//!     EntryDef::ro(0x6064, DataType::I32, "position").tpdo(),
//! ];
//! let mut objects = Dictionary::<{ lines_of(DEVICE) }, { octets_of(DEVICE) }>::new(&[DEVICE])?;
//! // What comes from the network is checked, and refused with the code of the profile.
//! objects.write(0x6060, 0, &[8])?;
//! assert_eq!(objects.write(0x6060, 0, &[11]), Err(AbortCode::VALUE_TOO_HIGH));
//! assert_eq!(objects.write(0x6064, 0, &[0; 4]), Err(AbortCode::WRITE_OF_READ_ONLY));
//! // The application has looked its objects up.
//! let position = objects.key::<i32>(0x6064, 0)?;
//! objects.set(position, -5);
//! assert_eq!(objects.read(0x6064, 0)?, (-5_i32).to_le_bytes());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Device files (XDD, XDC, EDS, DCF) become what a node is and contains in `device/`, ESI files of EtherCAT devices in
//! `device/esi/`; both need the feature `device`.
#![no_std]
#![warn(clippy::missing_errors_doc)]

#[cfg(any(test, feature = "device"))]
extern crate std;

mod abort;
pub mod cdc;
mod data_type;
mod definition;
#[cfg(feature = "device")]
pub mod device;
mod dictionary;
mod expected;
pub mod mapping;
mod objects;

pub use abort::AbortCode;
pub use data_type::{DataType, Scalar};
pub use definition::{Access, EntryDef, PdoAccess, Value, lines_of, octets_of};
pub use dictionary::{BuildError, Dictionary, Handle, Key};
pub use expected::Expected;
pub use objects::Objects;
