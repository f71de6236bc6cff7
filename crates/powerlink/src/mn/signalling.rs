//! Error signalling of one controlled node, the managing node's side.
//!
//! In:  EN of PRes and StatusResponse, EC of the StatusResponse. Out: whether a StatusRequest is needed, ER and EA for it.
//! RT: no allocation, no locks, bounded.
//!
//! It starts with a hand-shake: StatusRequests with ER=1 until the node says EC=1, then with ER=0 until it says EC=0 (its
//! answers may lag behind by one). From then on EN flips when there are new error entries, and EA follows once they were
//! read.

use crate::wire::StatusResponse;

/// StatusRequests after which a node that never ends the hand-shake is taken as having no error signalling.
const TRIES_MAX: u32 = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// ER=1 until EC=1.
    Reset,
    /// ER=0 until EC=0.
    Clear,
    /// Signalling.
    Running,
}

/// Where error signalling with one node stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Signalling {
    step: Step,
    tries: u32,
    /// EA: the EN we acknowledged last.
    acknowledged: bool,
    /// EN as seen last.
    exception_new: bool,
}

impl Signalling {
    /// Before the hand-shake.
    pub(super) fn new() -> Signalling {
        Signalling {
            step: Step::Reset,
            tries: 0,
            acknowledged: false,
            exception_new: false,
        }
    }

    /// A StatusRequest is needed.
    pub(super) fn wants_status(&self) -> bool {
        self.step != Step::Running || self.exception_new != self.acknowledged
    }

    /// ER for the SoA of a StatusRequest.
    pub(super) fn exception_reset(&self) -> bool {
        self.step == Step::Reset
    }

    /// EA for PReq and SoA.
    pub(super) fn exception_acknowledge(&self) -> bool {
        self.acknowledged
    }

    /// EN of a PRes.
    pub(super) fn polled(&mut self, exception_new: bool) {
        if self.step == Step::Running {
            self.exception_new = exception_new;
        }
    }

    /// A StatusResponse came; whether its error entries are new.
    pub(super) fn status(&mut self, status: &StatusResponse<'_>) -> bool {
        match (self.step, status.exception_clear) {
            (Step::Reset, true) => self.step = Step::Clear,
            (Step::Clear, false) => self.run(status.exception_new),
            (Step::Reset, false) | (Step::Clear, true) => {
                self.tries += 1;
                if self.tries >= TRIES_MAX {
                    self.run(status.exception_new);
                }
            }
            (Step::Running, _) => {
                let new = status.exception_new != self.acknowledged;
                self.acknowledged = status.exception_new;
                self.exception_new = status.exception_new;
                return new;
            }
        }
        false
    }

    /// The node does not answer StatusRequests, but lives: it does without error signalling until EN flips again.
    pub(super) fn give_up(&mut self) {
        self.run(self.exception_new);
    }

    fn run(&mut self, exception_new: bool) {
        self.step = Step::Running;
        self.acknowledged = exception_new;
        self.exception_new = exception_new;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nmt::NmtState;
    use crate::wire::{ErrorEntries, Requests};

    fn status(exception_clear: bool, exception_new: bool) -> StatusResponse<'static> {
        StatusResponse {
            exception_clear,
            exception_new,
            requests: Requests::default(),
            nmt_state: NmtState::PreOperational2,
            static_errors: [0; 8],
            entries: ErrorEntries(&[]),
        }
    }

    /// As in openpowerlink-mn-3cn-10ms.pcap, node 110, frames 965 to 1215: ER 1 1 0 0, EC 1 1 1 0.
    #[test]
    fn the_hand_shake_as_recorded() {
        let mut signalling = Signalling::new();
        assert!(signalling.exception_reset());
        assert!(!signalling.status(&status(true, false)));
        assert!(!signalling.exception_reset());
        for _ in 0..2 {
            assert!(!signalling.status(&status(true, false)), "the answer lags behind");
            assert!(signalling.wants_status());
        }
        assert!(!signalling.status(&status(false, false)));
        assert!(!signalling.wants_status());
    }

    #[test]
    fn a_flip_of_en_is_fetched_and_acknowledged() {
        let mut signalling = Signalling::new();
        signalling.polled(true);
        signalling.status(&status(true, false));
        signalling.status(&status(false, false));
        assert!(!signalling.wants_status(), "EN before the hand-shake means nothing");
        for flipped in [true, false] {
            signalling.polled(flipped);
            assert!(signalling.wants_status());
            assert_eq!(signalling.exception_acknowledge(), !flipped);
            assert!(signalling.status(&status(false, flipped)));
            assert_eq!(signalling.exception_acknowledge(), flipped);
            assert!(!signalling.wants_status());
            assert!(!signalling.status(&status(false, flipped)), "read twice, new once");
        }
    }

    #[test]
    fn a_node_that_never_ends_the_hand_shake_is_left_alone() {
        for exception_clear in [false, true] {
            let mut signalling = Signalling::new();
            for _ in 0..TRIES_MAX {
                assert!(signalling.wants_status());
                signalling.status(&status(exception_clear, true));
            }
            signalling.status(&status(exception_clear, true));
            assert!(!signalling.wants_status());
        }
    }
}
