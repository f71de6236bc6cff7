mod curves;
mod laps;
mod motion;
mod paths;
mod slow_profile;
mod spacing;

use super::*;

const LIMITS: JointLimits = JointLimits {
    velocity: 500.0,
    acceleration: 5000.0,
    jerk: 1e5,
};
