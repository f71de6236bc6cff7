//! Canonical moves to joint positions per cycle.
//!
//! In:  canonical moves ([`canon`]).
//! Out: one position per joint and cycle (`rt`).
//!
//! Everything left of the ring plans and may allocate; everything right of it runs in the cycle thread and may not.
//!
//! ```text
//! canon -> compensation -> plan -> ring -> rt -> kinematics
//! calls    cutter radius   speed           positions per cycle    joints
//! ```
//!
//! Lengths are mm, angles degrees, times seconds, if nothing else is said. The same calls give the same positions, to the last
//! bit, on every machine.
//!
//! ```
//! use motion::canon::{AXES, Call, Event, Position, Source};
//! use motion::plan::{AxisLimits, Settings, plan_offline};
//!
//! let axis = AxisLimits { velocity: 100.0, acceleration: 1000.0, jerk: 20_000.0, travel: [-500.0, 500.0] };
//! let settings = Settings::new([Some(axis); AXES], 1e-3);
//! let calls = [
//!     Call::SetFeedRate { linear: 50.0, angular: 50.0 },
//!     Call::StraightFeed { to: Position::xyz(30.0, 40.0, 0.0) },
//! ];
//! let events = calls.map(|call| Event { source: Source::default(), call });
//! let plan = plan_offline(&events, settings)?;
//! // 50 mm at 50 mm/s, and as long as it takes to reach that speed.
//! assert!(plan.motion_time_s > 1.0 && plan.motion_time_s < 1.2);
//! assert_eq!(plan.samples.last(), Some(&Position::xyz(30.0, 40.0, 0.0)));
//! # Ok::<(), motion::plan::PlanError>(())
//! ```

#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, reason = "tests may use the PC's own functions")
)]

pub mod cancel;
pub mod canon;
pub mod compensation;
pub mod element;
pub mod kinematics;
pub mod path;
pub mod plan;
pub mod ring;
pub mod rt;

#[cfg(test)]
#[path = "../../../tests/common/counting.rs"]
mod counting;
#[cfg(test)]
mod no_allocation_tests;
