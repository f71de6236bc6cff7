//! Our interpreter on a case, as the oracle is run on it.

use gcode::{CanonPrinter, Interpreter, Settings};
use motion::canon::LengthUnit;

use super::case::Case;

/// What our interpreter made of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The printed calls.
    pub canon: String,
    /// What was refused, in order: `line:column: text`, of a subroutine's file `file:line:column: text`.
    pub errors: Vec<String>,
    /// Lines of the refusals, counted from 1, in the file they are in.
    pub error_lines: Vec<u32>,
    /// The parameter file afterwards.
    pub parameters: String,
}

/// Runs a case.
pub fn run(case: &Case) -> Outcome {
    let mut printer = CanonPrinter::new(LengthUnit::Inch);
    let mut canon = Vec::new();
    let mut errors = Vec::new();
    let mut error_lines = Vec::new();
    for event in Interpreter::new(Settings::default()).run(&case.program) {
        match event {
            Ok(event) => printer.write(&event, &mut canon).expect("memory"),
            Err(error) => {
                errors.push(error.to_string());
                error_lines.push(error.line);
                if !case.options.continue_after_error {
                    break;
                }
            }
        }
    }
    Outcome {
        canon: String::from_utf8_lossy(&canon).into_owned(),
        errors,
        error_lines,
        parameters: String::new(),
    }
}
