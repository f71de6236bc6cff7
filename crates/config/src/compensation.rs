//! Backlash and pitch errors of a joint.
//!
//! In:  `backlash_mm`, and `compensation_file` with the keys beside it, of a `[[joint]]`; the file: see [`PitchTable::parse`].
//! Out: the table. A mistake in the file is noted at the line of the machine file that names it, with its own place.

use super::limits::{JointLimits, StopLimits};
use super::question::Bound;
use super::section::Section;
use motion::rt::{
    CompensationShare, MotionLimits, PitchBounds, PitchError, PitchFileError, PitchFileKind, PitchTable, RoundError,
};
use std::path::Path;

/// What the motor is told beside the position of its joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Compensation {
    /// Way that is lost when the joint turns round, mm.
    pub backlash_mm: f64,
    pub table: PitchTable,
    /// How fast a difference may be taken up, mm and s.
    pub take_up: MotionLimits,
}

/// What is worn more than that is repaired, mm.
const BACKLASH_MAX_MM: f64 = 10.0;
/// Bounds of corrections that nobody has raised: a machine that needs more is rarely one, and a wrong file is beyond them.
const BOUNDS: PitchBounds = PitchBounds {
    correction_mm: 0.5,
    slope: 0.01,
};
/// How far they can be raised.
const BOUNDS_MAX: PitchBounds = PitchBounds {
    correction_mm: 10.0,
    slope: 0.1,
};
const KINDS: [(&str, PitchFileKind); 2] = [
    ("positions", PitchFileKind::Positions),
    ("corrections", PitchFileKind::Corrections),
];

/// Backlash and table, `Some(None)` where neither is asked for.
pub(super) fn keys(section: &mut Section<'_, '_>, folder: &Path) -> Option<Option<(f64, PitchTable)>> {
    const OF_FILES: [&str; 3] = ["compensation_type", "compensation_max_mm", "compensation_slope_max"];
    let backlash_mm = section.number("backlash_mm", Bound::Within(0.0, BACKLASH_MAX_MM), 0.0);
    let kind = section.word("compensation_type", &KINDS, PitchFileKind::Positions);
    let correction_mm = section.number(
        "compensation_max_mm",
        Bound::Positive(BOUNDS_MAX.correction_mm),
        BOUNDS.correction_mm,
    );
    let slope = section.number(
        "compensation_slope_max",
        Bound::Positive(BOUNDS_MAX.slope),
        BOUNDS.slope,
    );
    let Some(item) = section.optional("compensation_file") else {
        for key in OF_FILES.into_iter().filter(|key| section.has(key)) {
            section.wrong(key, "is about a compensation_file, and there is none");
        }
        let asked_for = |backlash_mm| (backlash_mm > 0.0).then(|| (backlash_mm, PitchTable::default()));
        return backlash_mm.map(asked_for);
    };
    let path = folder.join(item.text(&section.key("compensation_file"))?);
    if backlash_mm.is_some_and(|backlash_mm| backlash_mm > 0.0) {
        section.wrong(
            "backlash_mm",
            "beside a compensation_file would count twice: the backlash is the difference between the two columns of the file; leave \
             out the one or the other (LinuxCNC takes no account of BACKLASH where there is a COMP_FILE)",
        );
    }
    let text = match files::read_text(&path, files::read::TEXT_MAX) {
        Ok(text) => text,
        Err(error) => {
            return section.refused("compensation_file", format!("cannot be read: {error}"));
        }
    };
    let (kind, bounds) = (
        kind?,
        PitchBounds {
            correction_mm: correction_mm?,
            slope: slope?,
        },
    );
    match PitchTable::parse(&text, kind, &bounds) {
        Ok(table) => Some(Some((backlash_mm?, table))),
        Err(error) => {
            let rule = format!(
                "is no table that can be used: {}:{error}{}",
                path.display(),
                cure(&error, &text, kind, &bounds)
            );
            section.refused("compensation_file", rule)
        }
    }
}

/// What to do about a row that is out of bounds: a file of the other kind is told by its fitting.
fn cure(error: &PitchFileError, text: &str, kind: PitchFileKind, bounds: &PitchBounds) -> String {
    let key = match error.cause {
        Some(PitchError::TooLarge { .. }) => "compensation_max_mm",
        Some(PitchError::TooSteep { .. }) => "compensation_slope_max",
        Some(PitchError::Illegal { .. } | PitchError::NotRising { .. }) | None => return String::new(),
    };
    let (now, other) = match kind {
        PitchFileKind::Positions => ("positions", PitchFileKind::Corrections),
        PitchFileKind::Corrections => ("corrections", PitchFileKind::Positions),
    };
    match PitchTable::parse(text, other, bounds) {
        Ok(_) => {
            let other = if now == "positions" { "corrections" } else { "positions" };
            format!(
                "; the file was read as {now}, and fits as {other}: write compensation_type = {other:?} if that is what it holds"
            )
        }
        Err(_) => format!("; correct the file, or raise {key} if the machine is really that far off"),
    }
}

/// Divides what a joint can do between the plan, stops and its compensation, so that the sum never passes it.
pub(super) fn share(
    section: &Section<'_, '_>,
    (backlash_mm, table): (f64, PitchTable),
    limits: &mut JointLimits,
    stop: &mut StopLimits,
) -> Option<Compensation> {
    let motion = MotionLimits {
        velocity: limits.velocity_mm_s,
        acceleration: limits.acceleration_mm_s2,
        jerk: limits.jerk_mm_s3,
    };
    let stops = motion::rt::StopLimits {
        acceleration: stop.acceleration_mm_s2,
        jerk: stop.jerk_mm_s3,
    };
    let share = match CompensationShare::new(table, motion, stops) {
        Ok(share) => share,
        Err(error) => {
            let cure = match error {
                RoundError::Steep(_) | RoundError::Rough(_) => {
                    "; raise stop_acceleration_mm_s2 and stop_jerk_mm_s3: half of what they have more than the plan is kept for the compensation, of which the table may have a quarter"
                }
                RoundError::Dense(_) => "",
            };
            let rule = format!("cannot be followed within the limits of the joint: {error}{cure}");
            return section.refused("compensation_file", rule);
        }
    };
    limits.velocity_mm_s = share.motion.velocity;
    stop.acceleration_mm_s2 = share.stop.acceleration;
    stop.jerk_mm_s3 = share.stop.jerk;
    Some(Compensation {
        backlash_mm,
        table: share.table,
        take_up: share.take_up,
    })
}
