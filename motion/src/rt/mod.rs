//! The synchronous functions: plan to joint positions, once a cycle.
//!
//! In:  elements of the ring; the wanted share of the planned speed (feed override, hold, stop).
//! Out: axis positions ([`Sample`]), joint positions ([`Kinematics`]).
//!
//! RT: nothing here allocates, locks or asks the system.

pub mod dda;
mod interpolator;
mod kinematics;
mod monitor;
mod scale;

pub use interpolator::{Interpolator, Sample, SampleState};
pub use kinematics::Kinematics;
pub use monitor::{Monitor, MonitorLimits, Peaks};
pub use scale::{MotionLimits, ScaleRamp, StopLimits};
