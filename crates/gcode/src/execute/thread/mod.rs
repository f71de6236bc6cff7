//! Moves in step with the spindle: G33, G33.1; the threading cycle G76 is in `cycle`.
//!
//! In:  the words of a line, a spindle that turns.
//! Out: moves between the begin and the end of synchronisation.

mod cycle;
#[cfg(test)]
mod tests;

use crate::block::Block;
use crate::error::{CycleError, ErrorKind, ThreadError};
use crate::scan::Fault;
use crate::state::{Calls, State};
use motion::canon::Call;

/// M codes that make a spindle turn, for messages.
const START_CODES: &str = "M3 or M4";

impl State {
    /// G33: a straight move, K per turn.
    pub(super) fn spindle_synchronised(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let sync = self.start_sync(block)?;
        let to = self.end(block)?;
        calls.extend([sync, Call::StraightFeed { to }, Call::StopSpindleSync]);
        self.at = to;
        Ok(())
    }

    /// G33.1: the same and back, to where it began.
    pub(super) fn rigid_tap(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let sync = self.start_sync(block)?;
        let to = self.end(block)?;
        // As fast out as in unless I says otherwise; LinuxCNC lets a factor of 0 or below pass, without effect.
        let return_scale = block.word_value(b'I').filter(|scale| *scale > 0.0).unwrap_or(1.0);
        calls.extend([sync, Call::RigidTap { to, return_scale }, Call::StopSpindleSync]);
        Ok(())
    }

    /// What can be told of the words of G33 and G33.1 before anything of the line is run.
    pub(super) fn check_synchronised(&self, block: &Block) -> Result<(), Fault> {
        let code = || self.motion_name(block);
        if block.first_axis().is_none() {
            return Err((block.motion_span(), ErrorKind::AxisMissing { code: code() }));
        }
        let Some(pitch) = block.word_value(b'K') else {
            return Err((
                block.motion_span(),
                missing(code(), b'K', "the way per turn of the spindle"),
            ));
        };
        if pitch == 0.0 {
            return Err(block.span(b'K').fault(ThreadError::Pitch {
                code: code(),
                letter: 'K',
                rule: "other than 0",
                value: pitch,
            }));
        }
        if block.word_value(b'F').is_some() {
            return Err(block.span(b'F').fault(ThreadError::WithFeed { code: code() }));
        }
        Ok(())
    }

    fn start_sync(&mut self, block: &Block) -> Result<Call, Fault> {
        self.need_no_compensation(block)?;
        let spindle = self.select_spindle(block)?;
        self.need_turning(block, spindle, START_CODES)?;
        Ok(Call::StartSpindleSync {
            spindle,
            mm_per_turn: block.word_value(b'K').unwrap_or(0.0) * self.modal.unit.mm(),
            velocity: false,
        })
    }
}

fn missing(code: String, letter: u8, meaning: &'static str) -> ErrorKind {
    ErrorKind::Cycle(CycleError::WordMissing {
        code,
        letter: letter.into(),
        meaning,
    })
}
