//! Backlash and pitch errors of a joint.
//!
//! In:  `backlash_mm` and `compensation_file` of a `[[joint]]`; the file: see [`PitchTable::parse`].
//! Out: the table. A mistake in the file is noted at the line of the machine file that names it, with its own place.

use super::document::{Bound, Section};
use super::types::{Compensation, JointLimits, StopLimits};
use motion::rt::{PitchTable, TakeUpLimits};
use std::path::Path;

/// What is worn more than that is repaired, mm.
const BACKLASH_MAX_MM: f64 = 10.0;
/// Share of a joint's velocity that is kept for the take-up.
const VELOCITY_SHARE: f64 = 0.05;

/// Backlash and table, `Some(None)` where neither is asked for.
pub(super) fn keys(section: &mut Section<'_, '_>, folder: &Path) -> Option<Option<(f64, PitchTable)>> {
    let backlash_mm = section.number("backlash_mm", Bound::Within(0.0, BACKLASH_MAX_MM), 0.0);
    let Some(item) = section.optional("compensation_file") else {
        let asked_for = |backlash_mm| (backlash_mm > 0.0).then(|| (backlash_mm, PitchTable::default()));
        return backlash_mm.map(asked_for);
    };
    let path = folder.join(item.text(&section.key("compensation_file"))?);
    let text = match files::read_text(&path, files::read::TEXT_MAX) {
        Ok(text) => text,
        Err(error) => {
            section.wrong("compensation_file", format!("cannot be read: {error}"));
            return None;
        }
    };
    match PitchTable::parse(&text) {
        Ok(table) => Some(Some((backlash_mm?, table))),
        Err(error) => {
            section.wrong(
                "compensation_file",
                format!("is no table that can be used: {}:{error}", path.display()),
            );
            None
        }
    }
}

/// Divides what a joint can do between the plan, stops and the take-up of its compensation, so that the sum never passes it:
/// of the velocity a twentieth is the take-up's, of what stops have more than the plan, half.
pub(super) fn share(
    (backlash_mm, table): (f64, PitchTable),
    limits: &mut JointLimits,
    stop: &mut StopLimits,
) -> Compensation {
    let take_up = TakeUpLimits {
        velocity_mm_s: limits.velocity_mm_s * VELOCITY_SHARE,
        acceleration_mm_s2: (stop.acceleration_mm_s2 - limits.acceleration_mm_s2) / 2.0,
        jerk_mm_s3: (stop.jerk_mm_s3 - limits.jerk_mm_s3) / 2.0,
    };
    limits.velocity_mm_s -= take_up.velocity_mm_s;
    stop.acceleration_mm_s2 -= take_up.acceleration_mm_s2;
    stop.jerk_mm_s3 -= take_up.jerk_mm_s3;
    Compensation {
        backlash_mm,
        table,
        take_up,
    }
}
