//! Probing moves between the program, which waits for how they end, and the cycle thread, which runs them.
//!
//! In:  results of the cycle thread, machine coordinates.
//! Out: answers to the interpreter, work coordinates.
//!
//! A program that is only looked at has nobody to wait for: its probing moves touch something at their very end. So loops that
//! probe until they touch come to an end, and what follows a touch is seen.

use motion::canon::{Call, Position, ProbeEnd, ProbeMode};
use motion::rt::probe::Probed;
use std::sync::{Arc, Mutex, PoisonError, mpsc};

/// The line from the interpolation to the program.
pub fn line() -> (rtrb::Producer<Probed>, rtrb::Consumer<Probed>) {
    // The program goes on to the next move only once it has read the result of this one.
    rtrb::RingBuffer::new(1)
}

/// Where answers to the interpreter come from; nobody gives any: `None`.
type Answered = Arc<Mutex<Option<mpsc::Receiver<gcode::Probed>>>>;

/// The machine as the interpreter sees it: probing moves end as they were told to have ended, and all else as planned.
pub(super) struct Asked(Answered);

impl gcode::Machine for Asked {
    fn probed(&mut self, _: Position, to: Position, _: ProbeMode) -> Option<gcode::Probed> {
        let answered = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // Waits where the move is still under way; told nothing, where nobody wants to know any more.
        let told = answered.as_ref().and_then(|answers| answers.recv().ok());
        Some(told.unwrap_or(gcode::Probed {
            end: ProbeEnd::Tripped,
            at: to,
            rest: to,
        }))
    }
}

/// Whether the interpreter asks how a call ended before it goes on.
pub(super) fn is_asked_behind(call: &Call) -> bool {
    matches!(call, Call::StraightProbe { .. })
}

/// Who tells the interpreter how probing moves ended.
pub(super) struct Answers(mpsc::Sender<gcode::Probed>);

impl Answers {
    /// To be told once for each probing move, before the interpreter is asked for what follows it.
    pub(super) fn send(&self, probed: gcode::Probed) {
        // The interpreter may have come to its end.
        let _ = self.0.send(probed);
    }
}

/// The probing moves of one program.
pub(super) struct Probing {
    results: Option<rtrb::Consumer<Probed>>,
    answered: Answered,
    under_way: bool,
    count: u64,
}

impl Probing {
    /// Of a program that is only looked at; and what its interpreter asks.
    pub(super) fn new() -> (Probing, Asked) {
        let answered = Answered::default();
        let asked = Asked(Arc::clone(&answered));
        let probing = Probing {
            results: None,
            answered,
            under_way: false,
            count: 0,
        };
        (probing, asked)
    }

    /// Of a program that runs.
    pub(super) fn wait_for(&mut self, results: rtrb::Consumer<Probed>) -> Answers {
        let (sender, receiver) = mpsc::channel();
        *self.answered.lock().unwrap_or_else(PoisonError::into_inner) = Some(receiver);
        self.results = Some(results);
        Answers(sender)
    }

    /// A probing move goes to the machine; it is under way if its end has to be awaited.
    pub(super) fn begin(&mut self) {
        self.count += 1;
        self.under_way = self.results.is_some();
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

    /// Whether there was a move whose end was only assumed.
    pub(super) fn has_assumed(&self) -> bool {
        self.count > 0 && self.results.is_none()
    }
}
