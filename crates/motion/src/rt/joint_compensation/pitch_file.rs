//! The file of pitch errors. Not real time.
//!
//! In:  text: a line for each measured position with three numbers in mm, what the joint was told, and of each way, forward and
//! backward, what the kind of the file says; `#` and `;` begin a remark.
//! Out: the table, or the first place at which it cannot be one.

use super::{PitchBounds, PitchError, PitchRow, PitchTable};

/// Rows of a file; a table for each tenth of a millimetre of ten metres.
const ROWS_MAX: usize = 100_000;

/// What the second and the third number of a line are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PitchFileKind {
    /// Where the joint was found.
    Positions,
    /// What is added to the position: what it was told less where it was found.
    Corrections,
}

impl PitchFileKind {
    fn columns(self) -> &'static str {
        match self {
            PitchFileKind::Positions => "three numbers: position, measured forward, measured backward, mm",
            PitchFileKind::Corrections => "three numbers: position, correction forward, correction backward, mm",
        }
    }
}

/// Why a text is no table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{line}:{column}: {rule}")]
pub struct PitchFileError {
    /// Line, from 1.
    pub line: usize,
    /// Character in the line, from 1.
    pub column: usize,
    /// What is wrong there, and what was expected.
    pub rule: String,
    /// What is wrong with a row that could be read.
    pub cause: Option<PitchError>,
}

impl PitchTable {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn parse(text: &str, kind: PitchFileKind, bounds: &PitchBounds) -> Result<PitchTable, PitchFileError> {
        let columns = kind.columns();
        let wrong = |line, column, rule| {
            Err(PitchFileError {
                line,
                column,
                rule,
                cause: None,
            })
        };
        let (mut rows, mut lines) = (Vec::new(), Vec::new());
        for (line, content) in (1..).zip(text.lines()) {
            let content = content.split(['#', ';']).next().unwrap_or_default();
            let mut values = Vec::new();
            for word in content.split_whitespace() {
                // Words are parts of the line: their distance from its beginning is their place.
                let octets = word.as_ptr() as usize - content.as_ptr() as usize;
                let column = content[..octets].chars().count() + 1;
                match word.parse::<f64>() {
                    Ok(value) if value.is_finite() => values.push(value),
                    Ok(_) | Err(_) => {
                        return wrong(line, column, format!("{word} is not a number; a line is {columns}"));
                    }
                }
            }
            let [position_mm, forward_mm, backward_mm] = values[..] else {
                if values.is_empty() {
                    continue;
                }
                return wrong(line, 1, format!("{} numbers; a line is {columns}", values.len()));
            };
            if rows.len() == ROWS_MAX {
                return wrong(line, 1, format!("must not be more than {ROWS_MAX} rows"));
            }
            lines.push(line);
            let correction_mm = |value_mm: f64| match kind {
                PitchFileKind::Positions => position_mm - value_mm,
                PitchFileKind::Corrections => value_mm,
            };
            rows.push(PitchRow {
                position_mm,
                forward_mm: correction_mm(forward_mm),
                backward_mm: correction_mm(backward_mm),
            });
        }
        if rows.is_empty() {
            return wrong(1, 1, format!("no row; a line is {columns}"));
        }
        PitchTable::new(&rows, bounds).map_err(|cause| PitchFileError {
            line: lines[cause.row()],
            column: 1,
            rule: cause.to_string(),
            cause: Some(cause),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: PitchBounds = PitchBounds {
        correction_mm: 0.5,
        slope: 0.01,
    };

    #[test]
    fn a_table_is_read_and_a_mistake_has_its_place() {
        let parse = |text| PitchTable::parse(text, PitchFileKind::Positions, &BOUNDS);
        let table = parse("# screw 3\n0 0 0.01 ; home\n\n100 100.02 100.01\n").unwrap();
        assert!((table.correction_mm(50.0, true) + 0.01).abs() < 1e-12);
        let place = |text| {
            let error = parse(text).unwrap_err();
            (error.line, error.column)
        };
        assert_eq!(place(""), (1, 1));
        assert_eq!(place("0 0 0\n ä 1 2\n"), (2, 2));
        assert_eq!(place("0 0 0\n1 inf 2\n"), (2, 3));
        assert_eq!(place("0 0 0\n#\n1 2\n"), (3, 1));
        assert_eq!(place("0 0 0\n\n0 0 0\n"), (3, 1));
        assert_eq!(place(&"1 2 3 4\n".repeat(2)), (1, 1));
    }

    /// The same screw, measured and as corrections; and one taken for the other.
    #[test]
    fn positions_and_corrections_are_told_apart() {
        const CORRECTIONS: &str = "0 0.001 0.002\n2 0.003 0.002\n9 0.01 0.011\n";
        const POSITIONS: &str = "0 -0.001 -0.002\n2 1.997 1.998\n9 8.99 8.989\n";
        let [one, other] = [
            (CORRECTIONS, PitchFileKind::Corrections),
            (POSITIONS, PitchFileKind::Positions),
        ]
        .map(|(text, kind)| PitchTable::parse(text, kind, &BOUNDS).unwrap());
        for (place_mm, forward, wanted_mm) in [
            (5.5, true, 0.0065),
            (5.5, false, 0.0065),
            (2.0, false, 0.002),
            (20.0, true, 0.01),
        ] {
            for table in [&one, &other] {
                assert!(
                    (table.correction_mm(place_mm, forward) - wanted_mm).abs() < 1e-12,
                    "{place_mm}"
                );
            }
        }
        for (text, kind, line, cause) in [
            (
                CORRECTIONS,
                PitchFileKind::Positions,
                2,
                "corrects by 1.997 mm at 2 mm, more than 0.5",
            ),
            (
                POSITIONS,
                PitchFileKind::Corrections,
                2,
                "corrects by 1.997 mm at 2 mm, more than 0.5",
            ),
        ] {
            let error = PitchTable::parse(text, kind, &BOUNDS).unwrap_err();
            assert_eq!((error.line, error.rule.as_str()), (line, cause));
            assert!(
                matches!(error.cause, Some(PitchError::TooLarge { row: 1, .. })),
                "{error:?}"
            );
        }
    }
}
