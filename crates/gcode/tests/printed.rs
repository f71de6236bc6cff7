//! Small programs and what is printed of them, call by call.
//!
//! Each text of `printed/` lists programs, one a line with ` / ` between its blocks, and below each the calls behind the
//! prelude, indented. A refusal begins with `!`. Where a program ends as an empty one does, its end is left out. All calls
//! were printed by LinuxCNC 2.9 (in the form of the newest), but those in `differing.txt`, which says why they are not.

use gcode::{CanonPrinter, Interpreter, Settings, ToolChanger, ToolTable, parameter};
use motion::canon::LengthUnit;

const TOOLS: &str =
    "T1 P1 X0.1 Z0.5 D0.25 ;one\nT2 P3 Z1 D0.5 I30 J60 Q2\nT3 P2 X0.25 Y0.5 Z0.75 A10 D-0.125\nT10 P0 Z2 D0.1\n";
const PARAMETERS: &str = "5161 1\n5162 2\n5163 3\n5181 4\n5182 5\n5183 6\n5220 1\n5241 1\n5242 0.5\n5250 30\n5270 90\n5381 2\n5382 3\n5383 1\n";

/// Calls before the first block.
const PRELUDE: usize = 6;

/// The calls behind the prelude, without count and N column, and the refusal.
fn printed(program: &str) -> Vec<String> {
    let unit = LengthUnit::Inch;
    let mut settings = Settings {
        machine_unit: unit,
        spindles: 1,
        tools: ToolTable::parse(TOOLS.as_bytes(), unit, ToolChanger::Fixed).expect("the tools"),
        user_codes: Some(vec![100]),
        ..Settings::default()
    };
    settings.set_parameters(&parameter::file::parse(PARAMETERS.as_bytes()).expect("the parameters"));
    let mut printer = CanonPrinter::new(unit);
    let mut text = Vec::new();
    let mut refusal = None;
    for event in Interpreter::new(settings).run(program.as_bytes()).limit_steps(1000) {
        match event {
            Ok(event) => printer.write(&event, &mut text).expect("memory"),
            Err(error) => refusal = Some(format!("! {error}")),
        }
    }
    let text = String::from_utf8(text).expect("calls are plain text");
    let calls = text.lines().map(|line| line.chars().skip(13).collect());
    calls.skip(PRELUDE).chain(refusal).collect()
}

/// Every program of a text against its calls; `count` programs must be there.
fn check(text: &str, count: usize) {
    let end = printed("M2\n");
    let mut checked = 0;
    let mut wrong = String::new();
    let mut lines = text
        .lines()
        .filter(|line| !line.starts_with('#') && !line.is_empty())
        .peekable();
    while let Some(program) = lines.next() {
        let mut expected = Vec::new();
        while let Some(call) = lines.next_if(|line| line.starts_with("    ")) {
            expected.push(call.trim_start().to_owned());
        }
        let mut calls = printed(&(program.replace(" / ", "\n") + "\n"));
        if calls.ends_with(&end) {
            calls.truncate(calls.len() - end.len());
        }
        if calls != expected {
            wrong += &format!("{program}\n expected {expected:#?}\n printed {calls:#?}\n");
        }
        checked += 1;
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert_eq!(checked, count);
}

#[test]
fn tools() {
    check(include_str!("printed/tools.txt"), 152);
}

#[test]
fn offsets_and_what_belongs_to_a_line() {
    check(include_str!("printed/offsets.txt"), 168);
}

#[test]
fn switches_spindles_and_feeds() {
    check(include_str!("printed/switches.txt"), 167);
}

#[test]
fn saved_modes() {
    check(include_str!("printed/saved.txt"), 75);
}

#[test]
fn what_compensation_allows() {
    check(include_str!("printed/compensation.txt"), 86);
}

#[test]
fn known_differences() {
    check(include_str!("printed/differing.txt"), 30);
}
