//! Ethernet frames of the application (IP, for instance) that wait for the asynchronous slot, on either side of the network.
//!
//! In:  frames that are not POWERLINK, at any time. Out: one a slot, padded, in their order.
//! RT: no allocation, no locks, bounded.

use core::fmt;

use crate::wire::{ETHER_TYPE, FRAME_LEN_MAX, FRAME_LEN_MIN};

/// Ethernet frames that can wait.
pub const ETHERNET_FRAMES: usize = 4;
/// Octets of an Ethernet header.
const ETHERNET_HEADER_LEN: usize = 14;

/// Why something of the application was not queued for the asynchronous slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QueueError {
    /// As many wait as there is room for.
    Full,
    /// The frame is no Ethernet frame, or longer than AsyncMTU (0x1F98/8) allows.
    Length {
        /// Octets of the frame.
        octets: usize,
        /// Octets a frame may have, Ethernet header included.
        most: usize,
    },
    /// POWERLINK frames are the node's own.
    Powerlink,
}

impl fmt::Display for QueueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            QueueError::Full => write!(f, "no more room in the queue for the asynchronous slot"),
            QueueError::Length { octets, most } => {
                write!(
                    f,
                    "an Ethernet frame of {octets} octets, {ETHERNET_HEADER_LEN}..={most} can be sent"
                )
            }
            QueueError::Powerlink => write!(f, "a POWERLINK frame cannot be sent by the application"),
        }
    }
}

impl core::error::Error for QueueError {}

/// The frames that wait.
#[derive(Clone, Debug)]
pub(crate) struct EthernetQueue {
    frames: [[u8; FRAME_LEN_MAX]; ETHERNET_FRAMES],
    /// Octets of each frame.
    lengths: [usize; ETHERNET_FRAMES],
    first: usize,
    len: usize,
}

impl EthernetQueue {
    pub(crate) const fn new() -> EthernetQueue {
        EthernetQueue {
            frames: [[0; FRAME_LEN_MAX]; ETHERNET_FRAMES],
            lengths: [0; ETHERNET_FRAMES],
            first: 0,
            len: 0,
        }
    }

    /// Forgets what waits.
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Frames that wait.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Takes a frame of at most `async_mtu` octets behind the Ethernet header.
    pub(crate) fn push(&mut self, frame: &[u8], async_mtu: u16) -> Result<(), QueueError> {
        let octets = frame.len();
        let most = (ETHERNET_HEADER_LEN + usize::from(async_mtu)).min(FRAME_LEN_MAX);
        if !(ETHERNET_HEADER_LEN..=most).contains(&octets) {
            return Err(QueueError::Length { octets, most });
        }
        if frame[12..14] == ETHER_TYPE.to_be_bytes() {
            return Err(QueueError::Powerlink);
        }
        if self.len == ETHERNET_FRAMES {
            return Err(QueueError::Full);
        }
        let at = (self.first + self.len) % ETHERNET_FRAMES;
        let padded = octets.max(FRAME_LEN_MIN);
        self.frames[at][..octets].copy_from_slice(frame);
        self.frames[at][octets..padded].fill(0);
        self.lengths[at] = padded;
        self.len += 1;
        Ok(())
    }

    /// Writes the frame that waits longest into `buffer`; returns its length.
    pub(crate) fn pop(&mut self, buffer: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        if self.len == 0 {
            return None;
        }
        let octets = self.lengths[self.first];
        buffer[..octets].copy_from_slice(&self.frames[self.first][..octets]);
        self.first = (self.first + 1) % ETHERNET_FRAMES;
        self.len -= 1;
        Some(octets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_leave_in_their_order_padded_and_only_if_they_are_not_powerlink() {
        let mut queue = EthernetQueue::new();
        let mut frame = [0x11; 100];
        frame[12..14].copy_from_slice(&[0x08, 0x00]);
        for round in 0..3 {
            for number in 0..4 {
                frame[20] = number;
                queue.push(&frame[..42 + usize::from(number) * 10], 300).unwrap();
            }
            assert_eq!(queue.push(&frame, 300), Err(QueueError::Full), "round {round}");
            for number in 0..4 {
                let mut buffer = [0xEE; FRAME_LEN_MAX];
                let len = queue.pop(&mut buffer).unwrap();
                assert_eq!((len, buffer[20]), (60.max(42 + usize::from(number) * 10), number));
                if number == 0 {
                    assert_eq!(buffer[42..60], [0; 18]);
                }
            }
            assert_eq!(queue.pop(&mut [0; FRAME_LEN_MAX]), None);
        }
        assert_eq!(
            queue.push(&[0; 315], 300),
            Err(QueueError::Length { octets: 315, most: 314 })
        );
        assert_eq!(
            queue.push(&[0; 13], 300),
            Err(QueueError::Length { octets: 13, most: 314 })
        );
        frame[12..14].copy_from_slice(&[0x88, 0xAB]);
        assert_eq!(queue.push(&frame, 300), Err(QueueError::Powerlink));
        assert_eq!(queue.len(), 0);
    }
}
