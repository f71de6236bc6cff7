//! Commands about pins: those of a running control, and what LinuxCNC's HAL files come to here.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod hal;
pub mod hal_import;
