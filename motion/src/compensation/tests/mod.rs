//! Tests of the stage.

mod errors;
mod random;
mod reader;

use super::geometry::{left, scale};
use super::*;

/// Printed output of a program, with the error as its last line if there is one.
pub(super) fn run(program: &str) -> Vec<String> {
    let mut compensator = Compensator::new();
    let mut out = Vec::new();
    let mut result = Ok(());
    for event in reader::read(program) {
        result = compensator.push(event, &mut out);
        if result.is_err() {
            break;
        }
    }
    if result.is_ok() {
        result = compensator.finish(&mut out);
    }
    let mut lines: Vec<String> = out.iter().map(|event| reader::print(&event.call)).collect();
    lines.extend(result.err().map(|error| format!("line {}: {error}", error.source.line)));
    lines
}

/// Programs and what LinuxCNC's stand-alone interpreter prints.
#[test]
fn golden_cases_equal_linuxcnc() {
    let mut cases = 0;
    for case in include_str!("golden.txt").split("\n==\n") {
        let (name, rest) = case.split_once('\n').expect("name");
        let (program, expected) = rest.split_once("\n--\n").expect("expected output");
        let actual = run(program);
        let expected: Vec<&str> = expected.lines().filter(|line| !line.is_empty()).collect();
        assert_eq!(actual.len(), expected.len(), "{name}: {actual:#?}");
        for (actual, expected) in actual.iter().zip(&expected) {
            let same = if *expected == "error" {
                actual.starts_with("line ")
            } else {
                actual == expected
            };
            assert!(same, "{name}:\n{actual}\n{expected}");
        }
        cases += 1;
    }
    assert!(cases >= 20, "{cases}");
}
