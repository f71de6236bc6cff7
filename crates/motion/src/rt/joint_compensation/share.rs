//! What a joint can do, divided between its own motion and its compensation.
//!
//! In:  the limits of the joint; the table of its pitch errors.
//! Out: what plan and stops may use, what taking up may use, and the table with its bends rounded.
//!
//! With V, A and J what the whole command of the motor may never pass (for A and J the limits of stops), s the slope of the table:
//!
//! ```text
//! velocity      plan (1 + s) + take-up                          = V    the take-up has a twentieth of V
//! acceleration  stop + table (see PitchTable) + take-up         = A    both together half of what stops have more than the plan
//! jerk          likewise                                        = J    of which the table may have a quarter
//! ```

use super::{MotionLimits, PitchTable, RoundError, StopLimits};

/// Share of a joint's velocity that is kept for the take-up.
const VELOCITY_SHARE: f64 = 0.05;
/// Share of what stops have more than the plan that is kept for the compensation.
const STOP_SHARE: f64 = 0.5;
/// Share of that which a table may have.
const TABLE_SHARE: f64 = 0.25;

/// A joint whose motion and compensation together stay within its limits.
#[derive(Clone, Debug, PartialEq)]
pub struct CompensationShare {
    /// What plans may use.
    pub motion: MotionLimits,
    /// What stops may use.
    pub stop: StopLimits,
    /// What taking up a difference may use.
    pub take_up: MotionLimits,
    /// With rounded bends.
    pub table: PitchTable,
}

impl CompensationShare {
    /// Divides limits, of which those of stops are above those of plans.
    ///
    /// # Errors
    ///
    /// The table takes more than there is.
    pub fn new(mut table: PitchTable, motion: MotionLimits, stop: StopLimits) -> Result<CompensationShare, RoundError> {
        let velocity = motion.velocity * VELOCITY_SHARE;
        let kept = [
            (stop.acceleration - motion.acceleration) * STOP_SHARE,
            (stop.jerk - motion.jerk) * STOP_SHARE,
        ];
        let fastest = MotionLimits {
            velocity: (motion.velocity - velocity) / (1.0 + table.slope()),
            acceleration: stop.acceleration - kept[0],
            jerk: stop.jerk - kept[1],
        };
        let taken = table.round(&fastest, kept.map(|kept| kept * TABLE_SHARE))?;
        Ok(CompensationShare {
            motion: MotionLimits {
                velocity: fastest.velocity,
                ..motion
            },
            stop: StopLimits {
                acceleration: fastest.acceleration,
                jerk: fastest.jerk,
            },
            take_up: MotionLimits {
                velocity,
                acceleration: kept[0] - taken[0],
                jerk: kept[1] - taken[1],
            },
            table,
        })
    }
}
