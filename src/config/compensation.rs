//! Backlash and pitch errors of a joint.
//!
//! In:  `backlash_mm` and `compensation_file` of a `[[joint]]`; the file: a line for each measured position with three numbers
//! in mm, what the joint was told, where it was coming forward, where it was coming backward; `#` and `;` begin a remark.
//! Out: the table. A mistake in the file is noted at the line of the machine file that names it, with its own place.

use super::document::{Bound, Section};
use super::types::{Compensation, JointLimits, StopLimits};
use motion::rt::{PitchRow, PitchTable, TakeUpLimits};
use std::path::Path;

/// What is worn more than that is repaired, mm.
const BACKLASH_MAX_MM: f64 = 10.0;
/// Rows of a file; a table for each tenth of a millimetre of ten metres.
const ROWS_MAX: usize = 100_000;
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
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) => {
            section.wrong("compensation_file", format!("cannot be read: {error}"));
            return None;
        }
    };
    match table(&text) {
        Ok(table) => Some(Some((backlash_mm?, table))),
        Err((line, column, rule)) => {
            let place = format!("{}:{line}:{column}", path.display());
            section.wrong(
                "compensation_file",
                format!("is no table that can be used: {place}: {rule}"),
            );
            None
        }
    }
}

/// Line and column, from 1, and what is wrong there.
type Mistake = (usize, usize, String);

fn table(text: &str) -> Result<PitchTable, Mistake> {
    const COLUMNS: &str = "three numbers: position, measured forward, measured backward, mm";
    let (mut rows, mut lines) = (Vec::new(), Vec::new());
    for (line, content) in (1..).zip(text.lines()) {
        let content = content.split(['#', ';']).next().unwrap_or_default();
        let mut values = Vec::new();
        for word in content.split_whitespace() {
            // Words are parts of the line: their distance from its beginning is their place.
            let octets = word.as_ptr() as usize - content.as_ptr() as usize;
            let column = content[..octets].chars().count() + 1;
            let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
            let value = value.ok_or_else(|| (line, column, format!("{word} is no number; a line is {COLUMNS}")))?;
            values.push(value);
        }
        let [position_mm, forward_mm, backward_mm] = values[..] else {
            if values.is_empty() {
                continue;
            }
            return Err((line, 1, format!("{} numbers; a line is {COLUMNS}", values.len())));
        };
        if rows.len() == ROWS_MAX {
            return Err((line, 1, format!("must not be more than {ROWS_MAX} rows")));
        }
        lines.push(line);
        rows.push(PitchRow {
            position_mm,
            forward_mm,
            backward_mm,
        });
    }
    if rows.is_empty() {
        return Err((1, 1, format!("no row; a line is {COLUMNS}")));
    }
    PitchTable::new(&rows).map_err(|error| (lines[error.row()], 1, error.to_string()))
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
