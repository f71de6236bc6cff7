//! Arcs, curves, probing and lathe cycles with any numbers: never a panic, and never a place that is no number.

use gcode::{Interpreter, Settings, Splines};
use motion::canon::{Call, Position};
use proptest::prelude::*;

/// A number as programs have it: mostly usual, at times at a limit.
fn number() -> impl Strategy<Value = String> {
    prop_oneof![
        8 => (-20_i32..21).prop_map(|number| number.to_string()),
        4 => (-9999_i32..10_000).prop_map(|number| format!("{:.3}", f64::from(number) / 500.0)),
        1 => prop::sample::select(vec!["0", "-0", "0.0000001", "999999999", "-999999999", "359.99999"]).prop_map(String::from),
    ]
}

/// A line of a code and words with the letters given.
fn line(codes: &'static [&'static str], letters: &'static str) -> impl Strategy<Value = String> {
    let words = prop::sample::subsequence(letters.chars().collect::<Vec<_>>(), 0..=letters.len());
    let numbers = prop::collection::vec(number(), letters.len());
    (prop::sample::select(codes.to_vec()), words, numbers).prop_map(|(code, letters, numbers)| {
        let words: Vec<String> = letters
            .iter()
            .zip(&numbers)
            .map(|(letter, number)| format!("{letter}{number}"))
            .collect();
        format!("{code} {}\n", words.join(" "))
    })
}

/// What is told of a program up to its first error; all of it finite.
fn run(program: &str, settings: Settings) -> Result<usize, TestCaseError> {
    let finite = |position: &Position| position.0.iter().all(|number| number.is_finite());
    let as_arcs = settings.splines != Splines::Nurbs;
    let mut events = 0;
    for event in Interpreter::new(settings).run(program.as_bytes()) {
        let Ok(event) = event else { break };
        events += 1;
        let fine = match &event.call {
            Call::StraightTraverse { to } | Call::StraightFeed { to } | Call::StraightProbe { to, .. } => finite(to),
            Call::ArcFeed {
                to, centre_mm, turns, ..
            } => finite(to) && centre_mm.iter().all(|number| number.is_finite()) && *turns != 0,
            Call::NurbsFeed { points, order, .. } => !as_arcs && points.len() >= *order as usize,
            _ => true,
        };
        prop_assert!(fine, "{event:?} of\n{program}");
    }
    Ok(events)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1024))]
    #[test]
    fn any_moves_are_told_or_refused(
        lines in prop::collection::vec(
            prop_oneof![
                line(&["G2", "G3", "G2 G90.1", "G3 G91.1", "G91 G2", "G90 G3", "G18 G2", "G17 G3", "G19 G2"], "XYZAIJKRP@^"),
                line(&["G5", "G5.1"], "XYIJPQ"),
                line(&["G5.2", "", "", "", "G5.3"], "XYPL"),
                line(&["G38.2", "G38.3", "G38.4", "G38.5", "G0", "G1", "G53 G0", "G20", "G21", "G7", "G8"], "XYZAC@^"),
            ],
            1..12,
        ),
    ) {
        let program = format!("F100 G0 X1 Y2\n{}M2\n", lines.concat());
        let mut settings = Settings::default();
        settings.wrapped_rotary[3] = true;
        run(&program, settings.clone())?;
        settings.splines = Splines::Arcs { tolerance_mm: 0.01 };
        run(&program, settings)?;
    }

    #[test]
    fn any_profile_is_cut_or_refused(
        moves in prop::collection::vec(line(&["G0", "G1", "G1", "G1", "G2", "G3", ""], "XZIKRACUW"), 1..10),
        cycle in line(&["G70", "G71", "G71.1", "G71.2", "G72", "G72.1", "G72.2"], "XZDIREPUW"),
    ) {
        let program = format!("o1 sub\n{}o1 endsub\nF100 G18 G0 X15 Z5\nQ1 {cycle}M2\n", moves.concat());
        run(&program, Settings::default())?;
    }
}
