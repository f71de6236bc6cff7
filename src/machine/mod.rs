//! Machine state, order of steps and what faults do.

pub mod faults;
pub mod motion_settings;
pub mod overruns;
pub mod safe_file;
pub mod sequence;
pub mod state;
pub mod tables;
