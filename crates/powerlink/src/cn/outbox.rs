//! Ethernet frames that the application wants to be sent, until the node is invited.

use crate::ethernet_queue::EthernetQueue;
use crate::wire::FRAME_LEN_MAX;

/// What the application wants to be sent.
#[derive(Clone, Debug)]
pub(super) struct Outbox {
    pub(super) frames: EthernetQueue,
    /// The last generic frame was one of the application's.
    pub(super) frame_was_last: bool,
}

impl Outbox {
    pub(super) fn new() -> Outbox {
        Outbox {
            frames: EthernetQueue::new(),
            frame_was_last: false,
        }
    }

    /// Forgets what waits.
    pub(super) fn clear(&mut self) {
        self.frames.clear();
    }

    pub(super) fn has_frame(&self) -> bool {
        self.frames.len() > 0
    }

    pub(super) fn pop_frame(&mut self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        self.frames.pop(response)
    }
}
