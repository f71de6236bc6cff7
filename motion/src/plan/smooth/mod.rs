//! Smoothing: moves to a path on which speed can be carried.
//!
//! In:  moves, in program order.
//! Out: stretches that follow each other, most of them with continuous direction and curvature; halts where the machine
//! must come to rest.

mod corners;
pub(super) mod round;

pub(super) use corners::{Corners, Passed, Stretch};
