//! How the follower gets back to the place where the spindle wants it.
//!
//! In:  where the follower is, where the spindle wants it, both with their speed and acceleration.
//! Out: the jerk of one cycle.
//!
//! A cascade: the distance asks for a speed relative to the spindle, the missing speed for an acceleration, the missing
//! acceleration for jerk. Near the wanted place all three are linear, with one time constant `tau`:
//!
//! ```text
//! e... + 3/tau e.. + 3/tau² e. + e/tau³ = - jerk of the spindle's motion
//! ```
//!
//! so that constant speed and constant acceleration of the spindle are followed exactly, and a motion of it with jerk `w`
//! (mm/s³) is left by `w tau³` at the most. Far away, speed and acceleration are those from which the rest of the way suffices to
//! brake. RT.

use super::super::scale::MotionLimits;
use crate::rt::otg::State;

/// Time constant, cycles.
pub(super) const TAU_CYCLES: f64 = 5.0;
/// Share of the jerk that braking towards the wanted place may take.
const JERK_SHARE: f64 = 0.5;
/// Share of the acceleration for the same.
const ACCELERATION_SHARE: f64 = 0.5;

/// The jerk of the cycle that begins at `now`, not above the limit.
pub(super) fn jerk(now: &State, wanted: &State, limits: &MotionLimits, cycle_s: f64) -> f64 {
    let MotionLimits { acceleration, jerk, .. } = *limits;
    let tau = TAU_CYCLES * cycle_s;
    let e = wanted.position - now.position;
    // On the curve speed = c distance^(2/3) the jerk is the same everywhere, 2/9 c³.
    let share = JERK_SHARE * jerk;
    let approach = (e.abs() / (3.0 * tau))
        .min(libm::cbrt(share * e * e))
        .min((2.0 * ACCELERATION_SHARE * acceleration * e.abs()).sqrt());
    let missing = wanted.velocity + approach.copysign(e) - now.velocity;
    let change = (missing.abs() / tau).min((jerk * missing.abs()).sqrt());
    let wanted_acceleration = (wanted.acceleration + change.copysign(missing)).clamp(-acceleration, acceleration);
    let wanted_jerk = (wanted_acceleration - now.acceleration) * 3.0 / tau;
    wanted_jerk.clamp(-jerk, jerk)
}
