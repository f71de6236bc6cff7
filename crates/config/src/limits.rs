//! Limits of a joint: of planned motion and of stops.

use super::question::Bound;
use super::section::Section;
use super::values::{ACCELERATION_MAX, VELOCITY_MAX};

const JERK_MAX: f64 = 1e10;

/// Limits of planned motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// mm/s
    pub velocity_mm_s: f64,
    /// mm/s²
    pub acceleration_mm_s2: f64,
    /// mm/s³
    pub jerk_mm_s3: f64,
}

/// Limits of stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopLimits {
    /// mm/s²
    pub acceleration_mm_s2: f64,
    /// mm/s³
    pub jerk_mm_s3: f64,
}

/// What the keys of the limits say; `None` where they are wrong.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub(super) velocity_mm_s: Option<f64>,
    acceleration_mm_s2: Option<f64>,
    jerk_mm_s3: Option<f64>,
    pub(super) stop: Option<StopLimits>,
}

impl Limits {
    pub(super) fn read(section: &mut Section<'_, '_>) -> Limits {
        let velocity_mm_s = section.number("velocity_mm_s", Bound::Positive(VELOCITY_MAX), None);
        let acceleration_mm_s2 = section.number("acceleration_mm_s2", Bound::Positive(ACCELERATION_MAX), None);
        let jerk_mm_s3 = section.number("jerk_mm_s3", Bound::Positive(JERK_MAX), None);
        let mut stop = |key, most, of_plan, ratio| stop_limit(section, key, most, of_plan, ratio);
        let acceleration = stop("stop_acceleration_mm_s2", ACCELERATION_MAX, acceleration_mm_s2, 2.0);
        let jerk = stop("stop_jerk_mm_s3", JERK_MAX, jerk_mm_s3, 4.0);
        Limits {
            velocity_mm_s,
            acceleration_mm_s2,
            jerk_mm_s3,
            stop: acceleration
                .zip(jerk)
                .map(|(acceleration_mm_s2, jerk_mm_s3)| StopLimits {
                    acceleration_mm_s2,
                    jerk_mm_s3,
                }),
        }
    }

    /// Those of the plan.
    pub(super) fn plan(self) -> Option<JointLimits> {
        Some(JointLimits {
            velocity_mm_s: self.velocity_mm_s?,
            acceleration_mm_s2: self.acceleration_mm_s2?,
            jerk_mm_s3: self.jerk_mm_s3?,
        })
    }
}

/// A limit of stops; left out it is a multiple of that of the plan.
fn stop_limit(
    section: &mut Section<'_, '_>,
    key: &'static str,
    most: f64,
    of_plan: Option<f64>,
    default_ratio: f64,
) -> Option<f64> {
    // Slowing down on the path while the plan uses all of its acceleration takes more than the plan has.
    const RATIO_MIN: f64 = 1.2;
    let Some(stop) = section.optional_number(key, Bound::Positive(most))? else {
        return of_plan.map(|limit| limit * default_ratio);
    };
    if let Some(limit) = of_plan.filter(|limit| stop < RATIO_MIN * limit) {
        let rule = format!("must be at least {RATIO_MIN} times the limit of the plan, {limit}");
        section.wrong(key, rule);
    }
    Some(stop)
}
