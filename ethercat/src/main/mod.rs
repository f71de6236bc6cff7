//! Parts of the main device: how its cycle follows the clock of the bus, how far devices are from the reference clock.
//!
//! In:  times that frames bring. Out: corrections of dates, delays.
//! RT: no allocation, no locks, bounded.

mod delay;
mod phase;

pub use delay::{DcDevice, delays};
pub use phase::{PhaseConfig, PhaseLoop, phase_ns};

#[cfg(test)]
mod tests;
