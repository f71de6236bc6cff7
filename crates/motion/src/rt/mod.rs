//! The synchronous functions: plan to joint positions, once a cycle.
//!
//! In:  elements of the ring; the wanted share of the planned speed (feed override, hold, stop); where the spindle is.
//! Out: axis positions ([`Sample`]), from which [`kinematics`](crate::kinematics) make joint positions.
//!
//! RT: nothing here allocates, locks or asks the system.

mod braking;
pub mod dda;
pub mod homing;
mod interpolator;
pub mod jog;
mod joint_compensation;
mod monitor;
mod otg;
mod pid;
pub mod probe;
mod scale;
mod shares;
mod synced;
mod track;

pub use interpolator::{Interpolator, Sample, SampleState};
pub use joint_compensation::{
    CompensationShare, JointCompensation, PitchBounds, PitchError, PitchFileError, PitchFileKind, PitchRow, PitchTable,
    RoundError,
};
pub use monitor::{Monitor, MonitorLimits, Order, Peaks, Trip, Watched};
pub use otg::{State, TrajectoryGenerator};
pub use pid::{Pid, PidGains};
pub use scale::{MotionLimits, ScaleRamp, StopLimits};
pub use shares::Shares;
pub use synced::{Follower, PATIENCE_S, SpindleFeedback, SyncFault, SyncReport, run_in_mm};
