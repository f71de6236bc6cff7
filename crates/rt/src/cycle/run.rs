//! A program in the cycle, and how it is run.

use super::by_hand::{Continuation, Programmed};
use super::{Action, Interpolator, Place, Sample, SampleState, State, Waiting};

/// A program from its start to its end.
pub(super) struct Run {
    pub(super) program: Box<Interpolator>,
    /// It is a line of MDI.
    pub(super) is_mdi: bool,
    pub(super) hold: bool,
    /// Backward along the path, at this share of its speed.
    pub(super) reverse: Option<f64>,
    /// The action that is not done yet.
    pub(super) waiting: Option<Action>,
    /// Where it is held while the machine is elsewhere.
    pub(super) away_from: Option<Place>,
    /// The machine is to return there, once the hand is off.
    pub(super) goes_back: bool,
    /// The tool is to leave the work behind the stop.
    pub(super) retracts: bool,
    /// An override or a switch lets feed or rapid moves rest.
    pub(super) is_fed_nothing: bool,
    pub(super) cycles: u64,
    pub(super) has_moved: bool,
    /// Spindle and coolant as the program had them, while a hand has changed them.
    pub(super) programmed: Option<Programmed>,
    /// Waits until the spindle has the speed of the program again.
    pub(super) continuation: Option<Continuation>,
}

impl Run {
    pub(super) fn new(program: Box<Interpolator>, is_mdi: bool) -> Run {
        Run {
            program,
            is_mdi,
            hold: false,
            reverse: None,
            waiting: None,
            away_from: None,
            goes_back: false,
            retracts: false,
            is_fed_nothing: false,
            cycles: 0,
            has_moved: false,
            programmed: None,
            continuation: None,
        }
    }

    /// Goes on after whatever held it: forward, or backward with a share of the speed. In single block that is the next block,
    /// backward the one before.
    pub(super) fn go_along(&mut self, reverse: Option<f64>) {
        self.hold = false;
        self.reverse = reverse;
        self.program.next_block();
    }

    /// The action that it waits for is done.
    pub(super) fn end_wait(&mut self) {
        self.waiting = None;
        self.program.acknowledge_action();
    }

    /// What it waits for where it stands still, or probes.
    pub(super) fn waits_for(&self, state: State, sample: &Sample) -> Option<Waiting> {
        match state {
            State::Away => return Some(Waiting::Return),
            State::Running => {}
            _ => return None,
        }
        if let Some(action) = self.waiting {
            return Waiting::of(action);
        }
        let rests = sample.velocity_mm_s == 0.0;
        match sample.state {
            SampleState::Moving | SampleState::Starved if rests && self.is_fed_nothing => Some(Waiting::Feed),
            _ if self.program.is_probing() => Some(Waiting::Probe),
            _ if self.program.is_dwelling() => Some(Waiting::Dwell),
            SampleState::Starved if self.has_moved => Some(Waiting::Queue),
            _ => None,
        }
    }
}
