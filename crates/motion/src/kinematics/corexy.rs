//! CoreXY: two motors that stand still pull X and Y together by crossed belts.
//!
//! ```text
//! first motor (joint of X) = x + y        x = (first + second) / 2
//! second motor (joint of Y) = x - y       y = (first - second) / 2
//! ```
//!
//! Signs as in LinuxCNC's `corexykins`. Where a motor turns the other way, its drive's polarity says so.

use super::number::Number;
use crate::canon::AXES;

/// Motors for axes. RT.
pub(super) fn inverse<N: Number>(axes: &mut [N; AXES]) {
    let [x, y, ..] = *axes;
    (axes[0], axes[1]) = (x + y, x - y);
}

/// Axes for motors. RT.
pub(super) fn forward(axes: &mut [f64; AXES]) {
    let [first, second, ..] = *axes;
    (axes[0], axes[1]) = (0.5 * (first + second), 0.5 * (first - second));
}
