//! The file of measured pitch errors. Not real time.
//!
//! In:  text: a line for each measured position with three numbers in mm, what the joint was told, where it was coming
//! forward, where it was coming backward; `#` and `;` begin a remark.
//! Out: the table, or the first place at which it cannot be one.

use super::{PitchRow, PitchTable};

/// Rows of a file; a table for each tenth of a millimetre of ten metres.
const ROWS_MAX: usize = 100_000;
const COLUMNS: &str = "three numbers: position, measured forward, measured backward, mm";

/// Why a text is no table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{line}:{column}: {rule}")]
pub struct PitchFileError {
    /// Line, from 1.
    pub line: usize,
    /// Character in the line, from 1.
    pub column: usize,
    /// What is wrong there, and what was expected.
    pub rule: String,
}

impl PitchTable {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn parse(text: &str) -> Result<PitchTable, PitchFileError> {
        let wrong = |line, column, rule| Err(PitchFileError { line, column, rule });
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
                        return wrong(line, column, format!("{word} is not a number; a line is {COLUMNS}"));
                    }
                }
            }
            let [position_mm, forward_mm, backward_mm] = values[..] else {
                if values.is_empty() {
                    continue;
                }
                return wrong(line, 1, format!("{} numbers; a line is {COLUMNS}", values.len()));
            };
            if rows.len() == ROWS_MAX {
                return wrong(line, 1, format!("must not be more than {ROWS_MAX} rows"));
            }
            lines.push(line);
            rows.push(PitchRow {
                position_mm,
                forward_mm,
                backward_mm,
            });
        }
        if rows.is_empty() {
            return wrong(1, 1, format!("no row; a line is {COLUMNS}"));
        }
        PitchTable::new(&rows).or_else(|error| wrong(lines[error.row()], 1, error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_and_a_mistake_has_its_place() {
        let table = PitchTable::parse("# screw 3\n0 0 0.01 ; home\n\n100 100.02 100.01\n").unwrap();
        assert!((table.correction_mm(50.0, true) + 0.01).abs() < 1e-12);
        let place = |text| {
            let error = PitchTable::parse(text).unwrap_err();
            (error.line, error.column)
        };
        assert_eq!(place(""), (1, 1));
        assert_eq!(place("0 0 0\n ä 1 2\n"), (2, 2));
        assert_eq!(place("0 0 0\n1 inf 2\n"), (2, 3));
        assert_eq!(place("0 0 0\n#\n1 2\n"), (3, 1));
        assert_eq!(place("0 0 0\n\n0 0 0\n"), (3, 1));
        assert_eq!(place(&"1 2 3 4\n".repeat(2)), (1, 1));
    }
}
