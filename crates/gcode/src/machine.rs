//! What the interpreter asks the machine.
//!
//! An answer is asked for when it is needed: after the call that brings it about (a probing move, M66, M6) was handed
//! out, and before the next line is read. Who runs the calls answers when they have been run.

use std::fmt;
use std::sync::Arc;

use motion::canon::{Input, Position, ProbeEnd, ProbeMode, WaitMode};

/// How a probing move ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probed {
    /// Whether the contact changed, or why the move ended else.
    pub end: ProbeEnd,
    /// Where it changed or, if it did not, where the move ended; work coordinates, mm and degrees.
    pub at: Position,
    /// Where the axes came to rest, work coordinates, mm and degrees.
    pub rest: Position,
}

/// The machine, as far as a program can look at it.
///
/// Every function has the answer of a machine that does all at once and has neither probe nor inputs.
pub trait Machine {
    /// How the probing move to `to`, begun at `from`, ended. No change of the contact is an error where `mode` demands
    /// one.
    ///
    /// `None`: nothing was moved. The program goes on as in LinuxCNC's stand-alone interpreter: #5070 is 0, the probed
    /// point is the end of the move, the axes rest 0.254 mm before it, and no contact is missed.
    fn probed(&mut self, from: Position, to: Position, mode: ProbeMode) -> Option<Probed> {
        let _ = (from, to, mode);
        None
    }

    /// What M66 read, 1 or 0 of a digital input; `None`: the time ran out.
    fn waited(&mut self, input: Input, mode: WaitMode, timeout_s: f64) -> Option<f64> {
        let _ = (input, mode, timeout_s);
        Some(0.0)
    }

    /// The program of a code of the user (M100 to M199) has ended.
    ///
    /// # Errors
    /// Why it counts as failed.
    fn user_code_ended(&mut self, number: u8, p: f64, q: f64) -> Result<(), String> {
        let _ = (number, p, q);
        Ok(())
    }

    /// The tool that is in the spindle after a change to `tool`.
    fn tool_changed(&mut self, tool: u32) -> u32 {
        tool
    }

    /// Where the axes stand behind a tool change on a line that also changed the length offset, work coordinates: `now`
    /// if they did not move; `before` is what this place read before the offset changed.
    fn place_after_tool_change(&mut self, before: Position, now: Position) -> Position {
        let _ = before;
        now
    }
}

/// A machine that is not there, as in LinuxCNC's stand-alone interpreter. That forgets the change of the length offset
/// when it takes over the place of the axes after a tool change: for looking at programs only, never to run them.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoMachine;

impl Machine for NoMachine {
    fn place_after_tool_change(&mut self, before: Position, _now: Position) -> Position {
        before
    }
}

/// Pins of a running control, by name, for `#<_hal[name]>`.
#[derive(Clone)]
pub struct PinReader(Arc<PinValue>);

type PinValue = dyn Fn(&str) -> Option<f64> + Send + Sync;

impl PinReader {
    /// Pins as this function gives them; `None`: there is none of that name.
    pub fn new(value: impl Fn(&str) -> Option<f64> + Send + Sync + 'static) -> PinReader {
        PinReader(Arc::new(value))
    }

    pub(crate) fn value(&self, name: &str) -> Option<f64> {
        (self.0)(name)
    }
}

impl fmt::Debug for PinReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("PinReader")
    }
}
