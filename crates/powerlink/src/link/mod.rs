//! What carries frames: one trait, and behind it a raw socket, a second one on libpnet, memory; and a simulated network.
//!
//! In:  whole Ethernet frames without FCS to send. Out: frames of others, each with the time it was received, if known.
//! Nothing in `send` and `receive` allocates or locks.

#[cfg(feature = "std")]
mod clock;
#[cfg(feature = "std")]
pub mod memory;
#[cfg(feature = "std")]
pub mod pcap;
#[cfg(feature = "pnet")]
pub mod pnet;
#[cfg(feature = "std")]
pub mod raw;
#[cfg(feature = "std")]
pub mod simulated;

/// Why a frame could not be sent or awaited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkError {
    /// The interface is down or gone, or the other end of a memory link was dropped.
    Down,
    /// The transmit queue is full; the frame was not sent.
    NoBuffers,
    /// The frame is longer or shorter than the link can carry.
    FrameLength {
        /// Octets of the frame.
        got: usize,
        /// Octets the link can carry at most.
        max: usize,
    },
    /// Any other error of the operating system.
    Os {
        /// The `errno` of the system call.
        errno: i32,
    },
}

impl core::fmt::Display for LinkError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            LinkError::Down => f.write_str("the interface is down"),
            LinkError::NoBuffers => f.write_str("the transmit queue is full"),
            LinkError::FrameLength { got, max } => write!(f, "a frame of {got} octets, the link carries 14 to {max}"),
            LinkError::Os { errno } => write!(f, "system error {errno}"),
        }
    }
}

impl core::error::Error for LinkError {}

/// A frame lies in the caller's buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// Octets of the frame, padding included.
    pub length: usize,
    /// When the kernel received it, CLOCK_REALTIME, in ns since 1970; `None` where the link has no such stamp.
    pub stamp_ns: Option<u64>,
}

/// A wire as one node sees it. RT unless the implementation says otherwise.
pub trait Link {
    /// The clock all deadlines are meant in: CLOCK_MONOTONIC, or virtual time, in ns.
    fn now_ns(&mut self) -> u64;

    /// Sends one Ethernet frame without FCS. Does not wait: a full queue is an error.
    ///
    /// # Errors
    /// [`LinkError`]: a frame of a length that Ethernet does not have, no room, or the interface is down.
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError>;

    /// Waits for one POWERLINK frame of another node until `deadline_ns`; a deadline in the past only looks.
    /// A frame longer than the buffer is cut; a buffer of 1514 octets holds every frame.
    ///
    /// # Errors
    /// [`LinkError`]: the interface is down, or what the system refuses; a time-out is none.
    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError>;
}

#[cfg(feature = "std")]
impl<L: Link + ?Sized> Link for std::boxed::Box<L> {
    fn now_ns(&mut self) -> u64 {
        (**self).now_ns()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        (**self).send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        (**self).receive(buffer, deadline_ns)
    }
}
