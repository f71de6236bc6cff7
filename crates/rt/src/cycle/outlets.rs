//! What leaves real time: notices, traces, programs that are over.
//!
//! In:  what a cycle says. Out: rings for which nobody in real time waits; what finds one full is counted.

use super::{Command, Notice, TimedNotice, Trace};
use crate::shared::RtStatus;
use motion::rt::Interpolator;
use std::sync::Arc;

/// The cycle thread's ends of the rings between it and the operator.
pub struct RtEndpoints {
    pub commands: rtrb::Consumer<Command>,
    pub notices: rtrb::Producer<TimedNotice>,
    /// One record per cycle of a program.
    pub trace: rtrb::Producer<Trace>,
    /// Programs that are over go back, so that nothing is freed in real time.
    pub finished: rtrb::Producer<Box<Interpolator>>,
    pub live: Arc<RtStatus>,
    /// Notices that found their ring full.
    pub notices_lost: u64,
    /// Trace records that did.
    pub trace_lost: u64,
}

impl RtEndpoints {
    /// RT.
    pub(super) fn notice(&mut self, cycle: u64, notice: Notice) {
        let timed = TimedNotice { cycle, notice };
        self.notices_lost += u64::from(self.notices.push(timed).is_err());
    }

    /// RT.
    pub(super) fn trace(&mut self, record: Trace) {
        self.trace_lost += u64::from(self.trace.push(record).is_err());
    }

    /// RT.
    pub(super) fn give_back(&mut self, program: Box<Interpolator>) {
        // The ring holds as many as there can ever be; should it be full all the same, leaking is what real time
        // can afford and freeing is not.
        if let Err(rtrb::PushError::Full(program)) = self.finished.push(program) {
            std::mem::forget(program);
        }
    }
}
