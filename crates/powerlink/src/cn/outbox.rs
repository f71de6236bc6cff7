//! What the application wants to be sent, until the node is invited.

use crate::ethernet_queue::{EthernetQueue, QueueError};
use crate::nmt::NmtCommand;
use crate::wire::{FRAME_LEN_MAX, NmtRequestFrame, node};

/// NMT requests that can wait.
pub const NMT_REQUESTS: usize = 8;

/// What the application wants to be sent.
#[derive(Clone, Debug)]
pub(super) struct Outbox {
    pub(super) requests: [NmtRequestFrame; NMT_REQUESTS],
    pub(super) requests_len: usize,
    pub(super) frames: EthernetQueue,
    /// The last generic frame was one of the application's.
    pub(super) frame_was_last: bool,
}

impl Outbox {
    pub(super) fn new() -> Outbox {
        Outbox {
            requests: [NmtRequestFrame::plain(NmtCommand::IdentRequest, node::INVALID); NMT_REQUESTS],
            requests_len: 0,
            frames: EthernetQueue::new(),
            frame_was_last: false,
        }
    }

    /// Forgets what waits.
    pub(super) fn clear(&mut self) {
        self.requests_len = 0;
        self.frames.clear();
    }

    pub(super) fn has_frame(&self) -> bool {
        self.frames.len() > 0
    }

    pub(super) fn push_request(&mut self, request: NmtRequestFrame) -> Result<(), QueueError> {
        let place = self.requests.get_mut(self.requests_len).ok_or(QueueError::Full)?;
        *place = request;
        self.requests_len += 1;
        Ok(())
    }

    pub(super) fn pop_request(&mut self) -> Option<NmtRequestFrame> {
        let request = *self.requests[..self.requests_len].first()?;
        self.requests.copy_within(1..self.requests_len, 0);
        self.requests_len -= 1;
        Some(request)
    }

    pub(super) fn pop_frame(&mut self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        self.frames.pop(response)
    }
}
