//! Parts of the main device: the frame of a cycle, how the cycle follows the clock of the bus, how far devices are from the
//! reference clock.
//!
//! In:  outputs, and what comes back. Out: frames to be sent, inputs; corrections of dates, delays.
//! RT: no allocation, no locks, bounded.

mod cycle;
mod delay;
mod phase;

pub use cycle::{Answered, Came, CyclicFrames, Member};
pub use delay::{DcDevice, delays};
pub use phase::{PhaseConfig, PhaseLoop, phase_ns};

#[cfg(test)]
mod cycle_tests;
#[cfg(test)]
mod tests;
