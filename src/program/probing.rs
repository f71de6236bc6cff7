//! Probing moves between the program, which waits for how they end, and the cycle thread, which runs them.
//!
//! In:  results of the cycle thread, machine coordinates.
//! Out: answers to the interpreter, work coordinates.
//!
//! A program that is only looked at has nobody to wait for: its probing moves touch something at their very end. So loops that
//! probe until they touch come to an end, and what follows a touch is seen.

use motion::canon::{Position, ProbeEnd, ProbeMode};
use motion::rt::probe::Probed;
use std::sync::{Arc, Mutex, PoisonError};

/// The line from the interpolation to the program.
pub fn line() -> (rtrb::Producer<Probed>, rtrb::Consumer<Probed>) {
    // The program goes on to the next move only once it has read the result of this one.
    rtrb::RingBuffer::new(1)
}

/// The machine as the interpreter sees it: probing moves end as they were told to have ended, and all else as planned.
pub(super) struct Asked(Arc<Mutex<Option<gcode::Probed>>>);

impl gcode::Machine for Asked {
    fn probed(&mut self, _: Position, to: Position, _: ProbeMode) -> Option<gcode::Probed> {
        let told = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        Some(told.unwrap_or(gcode::Probed {
            end: ProbeEnd::Tripped,
            at: to,
            rest: to,
        }))
    }
}

/// The probing moves of one program.
pub(super) struct Probing {
    results: Option<rtrb::Consumer<Probed>>,
    answer: Arc<Mutex<Option<gcode::Probed>>>,
    under_way: bool,
    count: u64,
}

impl Probing {
    /// Of a program that is only looked at; and what its interpreter asks.
    pub(super) fn new() -> (Probing, Asked) {
        let answer = Arc::default();
        let asked = Asked(Arc::clone(&answer));
        let probing = Probing {
            results: None,
            answer,
            under_way: false,
            count: 0,
        };
        (probing, asked)
    }

    /// Of a program that runs.
    pub(super) fn wait_for(&mut self, results: rtrb::Consumer<Probed>) {
        self.results = Some(results);
    }

    /// A probing move goes to the machine. Whether its end has to be awaited.
    pub(super) fn begin(&mut self) -> bool {
        self.count += 1;
        self.under_way = self.results.is_some();
        self.under_way
    }

    /// Whether a move is under way.
    pub(super) fn is_under_way(&self) -> bool {
        self.under_way
    }

    /// How it ended, once that is known; then nothing is under way any more.
    pub(super) fn receive(&mut self) -> Option<Probed> {
        let result = self.results.as_mut()?.pop().ok()?;
        self.under_way = false;
        Some(result)
    }

    /// What the interpreter is told when it asks.
    pub(super) fn send(&self, probed: gcode::Probed) {
        *self.answer.lock().unwrap_or_else(PoisonError::into_inner) = Some(probed);
    }

    /// Whether there was a move whose end was only assumed.
    pub(super) fn has_assumed(&self) -> bool {
        self.count > 0 && self.results.is_none()
    }
}
