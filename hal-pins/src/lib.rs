//! Pins: named, typed values of a running control in shared memory, connected by nets.
//!
//! In:  names and types claimed at start-up ([`Hal::output`], [`Hal::input`]), nets of the machine file ([`Hal::link`]),
//!      values written by the one writer of each pin ([`Output::set`]).
//! Out: the same values to any number of readers: [`Input::get`] in this process, [`Attached`] in every other one.
//!
//! ```text
//!  component A                     shared memory                     component B
//!  Output "joint.0.f-error" ──▶ [ one 64-bit cell ] ──net "x-error"──▶ Input "scope.0.in"
//!                                      ▲
//!                 isocnc hal list|get|watch, from another process
//! ```
//!
//! An output has one writer: the handle that [`Hal::output`] gave out; a second claim is an error. An input that no net
//! reaches has a value of its own, which [`Hal::set`] and [`Attached::set`] change. A net has one source and any number of
//! targets, all of one type. Everything is claimed and linked before the cycle starts; afterwards `set` and `get` are one
//! atomic access each: RT, wait-free, without allocation.
//!
//! The file holds 64-bit words only and is read with atomic loads and checked indices, so a damaged or foreign file is
//! an error and never undefined behaviour. It lies in a folder of one user alone and goes with the process; what a killed
//! process leaves behind is recognised by its lost lock, and removed when the next control starts. One that is cut short while
//! it is mapped is seen ([`Memory::is_lost`]) and kills no process.
//!
//! ```
//! use hal_pins::{Attached, Hal};
//!
//! let machine = format!("front-page-{}", std::process::id());
//! let mut hal = Hal::create(&machine, 8)?;
//! let mut command = hal.output::<f64>("joint.0.motor-pos-cmd")?;
//! let target = hal.input("drive.0.target", 0.0)?;
//! hal.link("x-pos-cmd", "joint.0.motor-pos-cmd", &["drive.0.target"])?;
//! command.set(12.5);
//! assert_eq!(target.get(), 12.5);
//! // Another process: two pins and a net.
//! assert_eq!(Attached::attach(&machine)?.list()?.len(), 3);
//! # Ok::<(), hal_pins::HalError>(())
//! ```
//!
//! | to learn | file |
//! |---|---|
//! | the folder of one user in which pins and sockets are, and what is swept from it | `file.rs` |
//! | what happens to a process whose mapped file is cut short | `guard.rs` |
//! | how other processes write pins: the records and whom the control believes; its two sides | `external/exchange.rs`; `external/control.rs`, `external/claim.rs`; the same in C and Python in `clients/` |
//! | the oscilloscope's ring, and why it is made so | `scope/mod.rs` |
#![warn(clippy::missing_errors_doc)]

mod attached;
mod cell;
mod error;
mod external;
mod file;
mod guard;
mod hal;
mod kind;
mod layout;
mod mapped;
mod name;
pub mod scope;
mod value;

pub use attached::{Attached, PinInfo};
pub use error::HalError;
pub use external::{Change, Claim, EXTERNAL_PINS_MAX, External, ExternalPin, Lost};
pub use file::{Found, directories, find};
pub use hal::{Hal, Input, Memory, Output, View};
pub use kind::{Kind, Type};
pub use layout::{CAPACITY_MAX, UNIT_LEN_MAX, file_len};
pub use name::{NAME_LEN_MAX, check_name, nearest};
pub use value::{AnyValue, Value};
