//! Spindle and coolant by hand, also of a machine whose program rests.
//!
//! In:  what a hand wants. Out: spindle and coolant; before the program goes on, they are again what it had made of them.

use super::*;
use crate::shared::ByHand;
use crate::spindle::Commanded;

/// What the program goes on with once its spindle is at speed again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Continuation {
    Resume,
    Reverse(f64),
    Skip(Waiting),
}

/// What a program had made of spindle and coolant before a hand changed it.
pub(super) struct Programmed {
    spindle: Option<Commanded>,
    flood: bool,
    mist: bool,
}

impl MotionController<dyn CyclicBus + '_> {
    /// Does what a hand wants where no program moves: not in the middle of a move that the spindle or a probe leads.
    pub(super) fn by_hand(&mut self, what: ByHand) {
        if let Some(run) = &mut self.program {
            let is_led = run.program.is_probing() || self.sample.turns_s_max.is_some();
            let waits = self.state == State::Running && run.waiting != Some(Action::ProgramStop);
            if is_led || waits || !run.program.is_at_rest() {
                return;
            }
            let parts = &self.parts;
            run.programmed.get_or_insert_with(|| Programmed {
                spindle: parts.spindles.first.commanded(),
                flood: parts.program_outputs.has_flood(),
                mist: parts.program_outputs.has_mist(),
            });
            run.continuation = None;
        }
        match what {
            ByHand::Spindle(rpm) => self.parts.spindles.first.turn(rpm),
            ByHand::Flood(on) => self.parts.program_outputs.set_flood(on),
            ByHand::Mist(on) => self.parts.program_outputs.set_mist(on),
        }
    }

    /// Whether the program may go on now. Otherwise spindle and coolant are made again what they were before a hand changed them, and
    /// it goes on by itself once the spindle is at speed.
    pub(super) fn has_own_spindle(&mut self, then: Continuation) -> bool {
        let Some(run) = &mut self.program else { return true };
        if let Some(programmed) = run.programmed.take() {
            let parts = &mut self.parts;
            parts.spindles.first.restore(programmed.spindle);
            parts.program_outputs.set_flood(programmed.flood);
            parts.program_outputs.set_mist(programmed.mist);
            run.continuation = Some(then);
        } else if run.continuation.is_some() {
            // The last order counts.
            run.continuation = Some(then);
        }
        run.continuation.is_none()
    }

    /// Lets the program go on whose spindle has come to its speed.
    pub(super) fn see_continuation(&mut self) {
        let Some(then) = self.program.as_ref().and_then(|run| run.continuation) else {
            return;
        };
        if self.parts.spindles.first.is_at_speed() {
            self.drop_continuation();
            self.obey(match then {
                Continuation::Resume => Command::Resume,
                Continuation::Reverse(share) => Command::Reverse(share),
                Continuation::Skip(waiting) => Command::Skip(waiting),
            });
        } else if let Some(late) = self.parts.spindles.late() {
            self.drop_continuation();
            self.fault(Fault::SpindleLate { late });
        }
    }

    /// What was to go on does not.
    pub(super) fn drop_continuation(&mut self) {
        if let Some(run) = &mut self.program {
            run.continuation = None;
        }
    }
}
