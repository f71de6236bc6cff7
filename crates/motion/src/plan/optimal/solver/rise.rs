//! How fast speed is expected to rise behind a slow place.
//!
//! Speed v cannot rise faster than sqrt(2 J v): that is what constant jerk J from rest gives. So v^(3/2) rises linearly over the
//! path, until acceleration limits it and b does.

use crate::plan::roots::cube_root;

/// Part of the acceleration limit by which the expected speed rises: jerk allows no more on average.
const ACCELERATION_PART: f64 = 0.7;

/// Greatest b expected after a stretch of path that begins with `b`, where joints allow this acceleration and jerk along it;
/// at most `cap`.
pub fn rise(b: f64, length: f64, [acceleration, jerk]: [f64; 2], cap: f64) -> f64 {
    let by_acceleration = b + 2.0 * ACCELERATION_PART * acceleration * length;
    let most = by_acceleration.min(cap);
    let three_halves = (b * b.sqrt()).sqrt() + 1.5 * (2.0 * jerk).sqrt() * length;
    // Mostly it is beyond the cap, and no root needed to see that.
    let square = three_halves * three_halves;
    if square * square >= most * most * most {
        return most;
    }
    most.min(three_halves * cube_root(three_halves))
}
