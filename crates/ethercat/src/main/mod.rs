//! The main device: frames of cycles and of services, how its cycle follows the clock of the bus, set-up and recovery of devices.
//!
//! In:  the configuration, outputs, frames that come, the time. Out: frames to be sent, inputs, events; corrections of dates.
//! RT: no allocation, no locks, bounded.

mod budget;
mod clocks;
pub mod config;
mod cycle;
mod delay;
mod device;
mod eeprom;
mod event;
mod mail;
mod mapping;
mod network;
mod orders;
mod phase;
mod punctuality;
mod survey;

pub use budget::Budget;
pub use cycle::{Answered, Came, CyclicFrames, Member};
pub use delay::{DcDevice, delays};
pub use eeprom::Found;
pub use event::{Break, Event, NoRoom, SetUp, SetupError};
pub use network::{Counters, DeviceState, Diagnosis, MainDevice, Received};
pub use orders::{ORDERS, VALUE_MAX};
pub use phase::{PhaseConfig, PhaseLoop, phase_ns};
pub use punctuality::Punctuality;

#[cfg(test)]
mod cycle_tests;
#[cfg(test)]
mod tests;
