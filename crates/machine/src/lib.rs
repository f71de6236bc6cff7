//! Machine state, order of steps and what faults do.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod fault_order;
pub mod faults;
pub mod journal;
pub mod modules;
pub mod motion_settings;
pub mod overruns;
pub mod permission;
pub mod retain_file;
pub mod safe_file;
pub mod sequence;
pub mod state;
pub mod state_file;
pub mod tables;
