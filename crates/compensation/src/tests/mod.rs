//! Tests of the stage.

mod errors;
mod gouge;
mod lathe;
mod random;
mod reader;
mod rings;
mod speed;

use super::geometry::{add, left, scale};
use super::*;

/// LinuxCNC's rules.
const AS_LINUXCNC: Settings = Settings {
    corner: Corner::Arc,
    gouge: Gouge::NeighboursOnly,
    number_by_release: false,
};

/// Printed output of a program by LinuxCNC's rules, with the error as its last line if there is one.
pub(super) fn run(program: &str) -> Vec<String> {
    run_with(AS_LINUXCNC, program)
}

/// The same by other rules.
pub(super) fn run_with(settings: Settings, program: &str) -> Vec<String> {
    let mut compensator = Compensator::with_settings(settings);
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
    } else if !matches!(&result, Err(error) if error.kind.is_gouge()) {
        compensator.release(&mut out);
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

/// With the whole contour looked at, a program of the golden cases gives the same or is one that cuts into its contour.
#[test]
fn golden_cases_are_the_same_with_look_ahead() {
    let (mut same, mut refused) = (0, Vec::new());
    for case in include_str!("golden.txt").split("\n==\n") {
        let (name, rest) = case.split_once('\n').expect("name");
        let (program, _) = rest.split_once("\n--\n").expect("expected output");
        let lines = run_with(Settings::default(), program);
        if lines == run(program) {
            same += 1;
        } else {
            let error = lines.last().map_or("nothing", String::as_str);
            assert!(error.contains(" would cut "), "{name}: {error}");
            refused.push(name);
        }
    }
    assert_eq!(same, 59);
    assert_eq!(refused, CUT_INTO_THEIR_CONTOUR);
}

/// Golden cases in which LinuxCNC's path cuts into the contour without a word: by the entry or the exit in the first three
/// and the others but for the full circles, which are entered through their own wall or from their own corner.
const CUT_INTO_THEIR_CONTOUR: [&str; 9] = [
    "# inner and outer corner, left",
    "# the same contour, right",
    "# a negative diameter changes the side",
    "# line to arc, outer corner, arc inside",
    "# cusp: down the wall, then over the arc",
    "# full circle inside, tangent entry and exit",
    "# full circle that begins in an inner corner",
    "# helix of three turns",
    "# lathe tool enters by an arc",
];

/// A full circle whose neighbours are not quite tangent must not shrink to the small angle between its ends.
#[test]
fn full_circles_remain_full() {
    for (height, circle) in [
        // Too little to be seen: the circle ends where it begins.
        ("0.0001", "ARC_FEED(10.0000, 1.0001, 10.0000, 5.0001, 1, 0.0000)"),
        ("-0.0001", "ARC_FEED(10.0000, 0.9999, 10.0000, 4.9999, 1, 0.0000)"),
        // The tool gets on the circle a little before its end, or behind it: a turn and a bit, or a bit less than a turn.
        ("0.02", "ARC_FEED(10.0000, 1.0200, 10.0000, 5.0200, 2, 0.0000)"),
        ("-0.02", "ARC_FEED(10.0000, 0.9800, 10.0000, 4.9800, 1, 0.0000)"),
    ] {
        for end in ["G1 X20", "G40", "G1 X0"] {
            let lines = run(&format!("G41.1 D2\nG1 X10 Y{height}\nG3 J5\n{end}"));
            let arc = lines.iter().find(|line| line.starts_with("ARC")).expect("the circle");
            assert_eq!(arc, circle, "Y{height} {end}");
        }
    }
}
