//! All errors of a program at once.
//!
//! In:  program text and [`Settings`].
//! Out: what is wrong with the form of any line ([`syntax`]), and the first thing that goes wrong when it is run.

use crate::error::Error;
use crate::interpreter::{Interpreter, ReadSeek};
use crate::machine::{Machine, NoMachine};
use crate::{Settings, syntax};
use motion::cancel::Cancel;
use std::io;
use std::time::Duration;

/// What a check does at most, as a program may never end.
#[derive(Clone, Debug)]
pub struct CheckLimits {
    /// Lines that are run, those of loops counted each time.
    pub steps: u64,
    /// Lines that are run one after the other while nothing moves and nothing is waited for.
    pub idle_steps: u64,
    /// Time for running them.
    pub time: Duration,
    /// Mistakes that are told.
    pub errors: usize,
    /// Gives it up from outside: the last error is [`ErrorKind::Cancelled`](crate::ErrorKind::Cancelled) then.
    pub cancel: Cancel,
}

impl Default for CheckLimits {
    /// A hundred million lines, ten million without a move, ten minutes, a hundred mistakes.
    fn default() -> CheckLimits {
        CheckLimits {
            steps: 100_000_000,
            idle_steps: 10_000_000,
            time: Duration::from_secs(600),
            errors: 100,
            cancel: Cancel::default(),
        }
    }
}

/// All errors of a program in memory, in the order of its lines.
pub fn check(text: &[u8], settings: Settings) -> Vec<Error> {
    check_on(text, settings, NoMachine, CheckLimits::default())
}

/// The same with a machine that answers while the program is run: which lines follow a probing move may depend on it.
pub fn check_on(
    text: &[u8],
    settings: Settings,
    machine: impl Machine + Send + 'static,
    limits: CheckLimits,
) -> Vec<Error> {
    let again = || Ok(io::Cursor::new(text));
    let interpreter = Interpreter::new(settings).with_machine(machine);
    match check_run(io::Cursor::new(text), again, interpreter, limits) {
        Ok(errors) => errors,
        Err(error) => unreachable!("memory can be read: {error}"),
    }
}

/// All errors of a program of any length, in the order of its lines.
///
/// `again` opens the text a second time. The lines are run, too, as far as the limits allow: what depends on the state
/// (a feed that is missing, a radius that does not fit) is found at the first line that fails. A line whose form is
/// wrong is told once.
///
/// # Errors
/// The text cannot be read.
pub fn check_reader<R: ReadSeek>(
    text: R,
    again: impl FnOnce() -> io::Result<R>,
    settings: Settings,
    limits: CheckLimits,
) -> io::Result<Vec<Error>> {
    check_run(text, again, Interpreter::new(settings), limits)
}

fn check_run<R: ReadSeek>(
    text: R,
    again: impl FnOnce() -> io::Result<R>,
    interpreter: Interpreter,
    limits: CheckLimits,
) -> io::Result<Vec<Error>> {
    let mut errors = syntax::errors(text, limits.errors, &limits.cancel)?;
    let run = interpreter.run_reader(again()?).within(limits);
    for error in run.filter_map(Result::err) {
        if !errors.contains(&error) {
            errors.push(*error);
        }
    }
    errors.sort_by_key(|error| error.line);
    Ok(errors)
}
