//! What holds for any text.

use gcode::{CheckLimits, Interpreter, Settings, check_reader};
use motion::canon::{Call, Position};
use proptest::prelude::*;
use std::io::Cursor;

/// Text that is often nearly a program: pieces of real words, and octets that are not.
fn programs() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        4 => "[GgMm][0-9]{1,2}(\\.[0-9])? ?",
        6 => "[A-Z]-?[0-9]{1,3}(\\.[0-9]{0,3})? ?",
        2 => Just("F100 ".into()),
        2 => Just("\n".into()),
        1 => "[ \t\r%/();#<>\\[\\]@^$\"ä]",
        1 => "\\(MSG,.{0,4}\\)",
    ];
    let octets = prop_oneof![8 => piece.prop_map(String::into_bytes), 1 => prop::collection::vec(any::<u8>(), 0..4)];
    prop::collection::vec(octets, 0..60).prop_map(|pieces| pieces.concat())
}

/// Moves and modes only, so that most programs are right.
fn moves() -> impl Strategy<Value = String> {
    let line = prop_oneof![
        "G[01] X-?[0-9]{1,3}\\.[0-9] Y-?[0-9]{1,3} Z[0-9]{1,2} F[1-9][0-9]{1,3}",
        "G(20|21|90|91|17|18|19|54|55|59\\.3|94 F9|61|64 P1)",
        "G28 X[0-9]",
        "G90 G53 G0 X[0-9] A[0-9]",
        "F5 G17 G[23] I[1-9] Z[0-9]",
    ];
    prop::collection::vec(line, 0..30).prop_map(|lines| lines.join("\n") + "\nM2\n")
}

fn settings() -> Settings {
    Settings {
        work_offsets: std::array::from_fn(|index| Position::xyz(7.0 * index as f64, -3.0 * index as f64, 1.0)),
        start: Position::xyz(1.0, 2.0, 3.0),
        ..Settings::default()
    }
}

/// Lines that are run at most: a few characters can make a loop that never ends.
const STEPS: u64 = 10_000;

/// Runs a program to its end; every promise of the calls is looked at.
fn run(text: &[u8]) -> Option<gcode::Error> {
    let mut origin = Position::ZERO;
    let mut error = None;
    for event in Interpreter::new(settings()).run(text).limit_steps(STEPS) {
        assert!(error.is_none());
        let event = match event {
            Ok(event) => event,
            Err(found) => {
                error = Some(*found);
                continue;
            }
        };
        assert!(event.source.start <= event.source.end && event.source.end as usize <= text.len());
        match event.call {
            Call::StraightTraverse { to } | Call::StraightFeed { to } => {
                assert!(to.0.iter().chain(&origin.0).all(|value| value.is_finite()));
            }
            Call::ArcFeed {
                to, centre_mm, turns, ..
            } => {
                assert!(to.0.iter().chain(&centre_mm).all(|value| value.is_finite()));
                assert_ne!(turns, 0);
            }
            Call::SetFeedRate { linear, angular } => {
                assert!(linear >= 0.0 && linear.is_finite() && angular >= 0.0 && angular.is_finite());
            }
            Call::Dwell { seconds } => assert!(seconds >= 0.0),
            Call::SetG5xOffset { origin: new, .. } => origin = new,
            _ => {}
        }
    }
    error
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn any_octets_end_without_panic(text in prop_oneof![prop::collection::vec(any::<u8>(), 0..400), programs()]) {
        let error = run(&text);
        let limits = CheckLimits { steps: STEPS, ..CheckLimits::default() };
        let errors = check_reader(Cursor::new(&text), || Ok(Cursor::new(&text)), settings(), limits).unwrap();
        prop_assert!(errors.is_sorted_by_key(|error| error.line));
        // A check finds what a run ends with.
        prop_assert!(error.is_none_or(|error| errors.contains(&error)));
        for error in &errors {
            prop_assert!(error.text.get(error.span.clone()).is_some());
            prop_assert!(error.line as usize <= 1 + text.iter().filter(|octet| **octet == b'\n').count());
            prop_assert!(error.render("any.ngc").starts_with("error: "));
        }
    }

    #[test]
    fn every_cut_of_a_program_ends_without_panic(text in moves()) {
        for end in 0..text.len() {
            run(&text.as_bytes()[..end]);
        }
    }

    #[test]
    fn the_machine_stands_still_while_systems_and_units_change(text in moves()) {
        // The work position as a listener follows it; a G0 without words tells the interpreter's own.
        let mut machine = Position::xyz(1.0, 2.0, 3.0);
        let mut origin = Position::ZERO;
        let text: String = text.lines().flat_map(|line| match line {
            "M2" => [String::new(), "M2\n".into()],
            line => [format!("{line}\n"), "G0\n".into()],
        }).collect();
        for event in Interpreter::new(settings()).run(text.as_bytes()) {
            let event = event.unwrap();
            let own = event.source.line % 2 == 0;
            match event.call {
                Call::SetG5xOffset { origin: new, .. } => origin = new,
                Call::StraightTraverse { to } | Call::StraightFeed { to } | Call::ArcFeed { to, .. } => {
                    let there = Position(std::array::from_fn(|index| to.0[index] + origin.0[index]));
                    if own {
                        for (there, machine) in there.0.iter().zip(&machine.0) {
                            prop_assert!((there - machine).abs() < 1e-6, "{text}");
                        }
                    }
                    machine = there;
                }
                _ => {}
            }
        }
    }
}
