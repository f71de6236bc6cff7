//! HAL components: small functions with named pins, run once a cycle in a fixed order.
//!
//! In:  values of input pins, the period \[s\].
//! Out: values of output pins.
//!
//! ```text
//!  shared memory          Instance                      shared memory
//!  input pins ──copy──▶ [ fields of a struct ] ──copy──▶ output pins
//!                         └─ Component::update: plain arithmetic
//! ```
//!
//! Names, pins and behaviour are LinuxCNC's where LinuxCNC has the component; names of pins are lower case here. A parameter is an
//! input that nothing is linked with. A pin has one writer: what is `io` in LinuxCNC is an output, or an input and an output.
//!
//! Rules of all components: state is zero at the start and the first call makes no edge; arithmetic hands NaN on, whatever
//! remembers or limits holds what it had. `update` is RT: bounded, without allocation, lock or panic.
//!
//! | to learn | file |
//! |---|---|
//! | what a component is, and how it is declared | `component.rs`, `declare.rs` |
//! | a component with its pins in shared memory | `instance.rs` |
//! | all of them, by name | `catalogue.rs` |
//!
//! ```
//! use components::{Instance, find};
//! use hal_pins::Hal;
//!
//! let mut hal = Hal::create(&format!("components-{}", std::process::id()), 8)?;
//! let and2 = find("and2").unwrap().make(&[]).unwrap();
//! let mut both = Instance::claim(&mut hal, "and2.0", and2)?;
//! let out = hal.reader::<bool>("and2.0.out")?;
//! hal.set("and2.0.in0", true)?;
//! hal.set("and2.0.in1", true)?;
//! both.update(0.001);
//! assert!(out.get());
//! # Ok::<(), hal_pins::HalError>(())
//! ```
#![warn(clippy::missing_errors_doc)]

mod arithmetic;
mod carousel;
mod catalogue;
mod compare;
mod component;
mod convert;
mod counting;
mod declare;
mod differences;
mod edge;
mod filters;
mod instance;
mod keys;
mod limits;
mod logic;
mod machine;
mod pid;
mod safety;
mod select;
mod signals;
mod spindle;
mod timing;

pub use catalogue::{CATALOGUE, RegisterError, find, kinds, register};
pub use component::{Component, Direction, Field, Kind, OptionError, OptionSpec, Options, Pin, PinSpec, Pins, Slot};
pub use differences::{DIFFERENCES, Difference};
pub use instance::Instance;
