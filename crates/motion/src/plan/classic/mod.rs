//! The classic planner: corner speeds, backward and forward pass, seven-phase slope.
//!
//! In:  stretches and halts of the smoothed path.
//! Out: elements to the ring.
//!
//! Acceleration is 0 where runs meet. It never breaks a limit, it costs little to compute, and it leaves time on the
//! table: the baseline of the optimal planner.

mod buffers;
mod runs;
mod steps;

pub(super) use steps::{Steps, largest_publication};
