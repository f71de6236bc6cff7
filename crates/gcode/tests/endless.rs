//! Programs that never end, and checks that nobody wants any more.

use gcode::{CheckLimits, Error, ErrorKind, Interpreter, Settings, check_reader};
use std::io::Cursor;
use std::time::Duration;

const IDLE: &str = "G21\n(before)\no1 while [1]\n#1 = [#1 + 1]\nS100\no1 endwhile\nM2\n";
const MOVING: &str = "G21 G90 F100\no1 while [1]\nG1 X1\nX2\no1 endwhile\nM2\n";

fn check_within(text: &str, limits: CheckLimits) -> Vec<Error> {
    let again = || Ok(Cursor::new(text));
    check_reader(Cursor::new(text), again, Settings::default(), limits).expect("memory can be read")
}

fn last(text: &str, limits: CheckLimits) -> (u32, ErrorKind) {
    let errors = check_within(text, limits);
    let error = errors.last().expect("it never ends");
    (error.line, error.kind.clone())
}

#[test]
fn a_loop_that_moves_nothing_is_told_long_before_one_that_moves() {
    let limits = || CheckLimits {
        steps: 100_000,
        idle_steps: 1000,
        ..CheckLimits::default()
    };
    // Lines 1 to 6, then 3 to 6 again and again: the thousandth line.
    assert_eq!(last(IDLE, limits()), (4, ErrorKind::TooManyIdleSteps { steps: 1000 }));
    assert_eq!(last(MOVING, limits()).1, ErrorKind::TooManySteps { steps: 100_000 });
    // What asks for nothing, but comes to an end, is none.
    let long = format!("{}G0 X1\n{}M2\n", "#1 = 2\n".repeat(900), "#1 = 2\n".repeat(900));
    assert_eq!(check_within(&long, limits()), []);
}

#[test]
fn a_check_ends_when_its_time_is_over() {
    let limits = CheckLimits {
        time: Duration::ZERO,
        ..CheckLimits::default()
    };
    let (line, kind) = last(MOVING, limits);
    assert_eq!(kind, ErrorKind::OutOfTime { seconds: 0 });
    assert!((2..=5).contains(&line), "{line}");
}

#[test]
fn a_run_that_is_cancelled_ends_with_the_next_event() {
    let limits = CheckLimits::default();
    let cancel = limits.cancel.clone();
    let mut run = Interpreter::new(Settings::default())
        .run(MOVING.as_bytes())
        .within(limits);
    assert!(run.by_ref().take(1000).all(|event| event.is_ok()));
    cancel.cancel();
    let error = run.next().expect("an error").expect_err("cancelled");
    assert_eq!(error.kind, ErrorKind::Cancelled);
    assert!(run.next().is_none());
    // One that has ended has nothing to give up.
    let mut ended = Interpreter::new(Settings::default()).run(b"M2\n").within(CheckLimits {
        cancel: cancel.clone(),
        ..CheckLimits::default()
    });
    assert!(ended.next().expect("an error").is_err() && ended.next().is_none());
    let limits = CheckLimits {
        cancel,
        ..CheckLimits::default()
    };
    assert_eq!(last("o1 while [1]\n", limits).1, ErrorKind::Cancelled);
}
