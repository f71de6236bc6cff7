//! Simulated devices, and the segment that they make: what any main device finds at the other end of the wire.
//!
//! In:  frames and the time. Out: the frames as they come back, and when; what drives demand of their motors.
//!
//! Everything runs on virtual time: the same frames at the same times give the same octets. What the registers do is what
//! several masters and emulators ask of them; where devices on sale differ, the stricter way was taken.

mod application;
mod clock;
mod coe;
mod device;
mod eeprom;
mod esc;
pub mod esi;
pub mod models;
mod objects;
mod segment;

pub use application::{Application, Cycle, Drive, IdealMotor, Motor, NoProcessData, Terminal};
pub use clock::ClockConfig;
pub use coe::Abilities;
pub use device::{Faults, SubDevice, SubDeviceConfig};
pub use objects::{
    COMMUNICATION, Description, ENTRIES, OCTETS, ObjectRef, ObjectStore, PDO_ENTRIES, Part, ProcessData, WriteCheck,
};
pub use segment::{Answer, Segment};

#[cfg(test)]
mod tests;
