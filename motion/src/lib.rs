//! Canonical moves to joint positions per cycle.
//!
//! In:  canonical moves ([`canon`]).
//! Out: one position per joint and cycle (`rt`).
//!
//! Everything left of the ring plans and may allocate; everything right of it runs in the cycle thread and may not.

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
