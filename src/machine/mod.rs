//! Machine state, order of steps and what faults do.

pub mod faults;
pub mod overruns;
pub mod sequence;
pub mod state;
