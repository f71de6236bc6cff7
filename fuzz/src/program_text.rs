//! Part programs: any octets, and programs that the octets choose from a grammar. Nothing panics, what is told is finite,
//! and every error can be shown.

use crate::program_grammar::program;
use gcode::{CanonPrinter, CheckLimits, Interpreter, Settings, check_reader};
use motion::canon::{Call, LengthUnit};
use std::io::Cursor;

/// Lines that are run at most.
const STEPS: u64 = 2000;
/// Events that are looked at.
const EVENTS: usize = 20_000;

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    look_at(octets);
    look_at(program(octets).as_bytes());
}

/// Checks and runs a program.
pub fn look_at(text: &[u8]) {
    let limits = CheckLimits {
        steps: STEPS,
        errors: 20,
        ..CheckLimits::default()
    };
    let open = || Ok(Cursor::new(text));
    let errors =
        check_reader(Cursor::new(text), open, Settings::default(), limits.clone()).expect("memory can be read");
    assert!(errors.len() <= limits.errors + 1);
    for error in &errors {
        assert!(error.line > 0 && error.column > 0);
        assert!(!error.render("program.ngc").is_empty());
        assert!(!error.to_string().is_empty());
    }

    let mut printer = CanonPrinter::new(LengthUnit::Millimetre);
    let mut printed = Vec::new();
    let mut wrong = false;
    for event in Interpreter::new(Settings::default())
        .run(text)
        .limit_steps(STEPS)
        .take(EVENTS)
    {
        let Ok(event) = event else {
            wrong = true;
            continue;
        };
        assert!(!wrong, "an event behind an error");
        if !matches!(event.call, Call::Message(_) | Call::Comment(_) | Call::Record(_)) {
            let shown = format!("{:?}", event.call);
            assert!(!shown.contains("NaN") && !shown.contains("inf"), "{shown}");
        }
        printed.clear();
        printer.write(&event, &mut printed).expect("memory can be written");
    }
    assert!(!wrong || !errors.is_empty(), "a program that fails passes the check");
}
