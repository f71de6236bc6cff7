//! What is on the wire: frames and their datagrams, registers of devices, EEPROM images, mailboxes.
//!
//! In:  untrusted octets. Out: plain structs, or why they are none; and back: `emit` writes into a dirty buffer, zeros in all
//! reserved and padding octets.
//! RT: no allocation, no locks, bounded. Parsing never panics; unknown values are kept.
//!
//! All numbers are little endian, only the EtherType is not.

pub mod coe;
mod command;
mod frame;
pub mod mailbox;
pub mod register;
pub mod sii;

pub use command::{Addressing, Command};
pub use frame::{
    BROADCAST, DATA_MAX, DATAGRAM_HEADER_LEN, DATAGRAM_OVERHEAD, Datagram, Datagrams, ETHER_TYPE, FRAME_LEN_MAX,
    FRAME_LEN_MIN, Frame, FrameWriter, HEADER_LEN, MAC_PASSED, Mac, answers,
};

/// Why octets are not what they should be, or cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireError {
    /// They end before a field that must be there.
    TooShort {
        /// Octets there must be at least.
        need: usize,
        /// Octets there are.
        got: usize,
    },
    /// The frame is longer than Ethernet allows.
    TooLong {
        /// Octets it has.
        got: usize,
    },
    /// EtherType other than 0x88A4.
    EtherType {
        /// What stands in its place.
        got: u16,
    },
    /// The frame holds no datagrams but, for example, network variables.
    FrameType {
        /// Its type; 1 is datagrams.
        got: u8,
    },
    /// A datagram or a field reaches beyond what holds it.
    Overrun {
        /// Octets it asks for.
        need: usize,
        /// Octets that are left for it.
        got: usize,
    },
    /// The frame header counts more octets than its datagrams have.
    Rest {
        /// Octets behind the last datagram.
        octets: usize,
    },
    /// A mail of another protocol than the one that was expected.
    MailboxType {
        /// Type of the mail; 3 is CoE.
        got: u8,
    },
    /// A CoE service, an SDO command or an opcode that there is not.
    Service {
        /// The number or the command octet.
        got: u8,
    },
    /// Emitting: the buffer or the frame is too small for what shall be sent.
    NoRoom {
        /// Octets that it needs.
        need: usize,
        /// Octets there are.
        got: usize,
    },
}

impl core::fmt::Display for WireError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            WireError::TooShort { need, got } => write!(f, "{got} octets, at least {need} are needed"),
            WireError::TooLong { got } => write!(f, "frame has {got} octets, Ethernet allows {FRAME_LEN_MAX}"),
            WireError::EtherType { got } => write!(f, "EtherType is {got:#06x}, expected {ETHER_TYPE:#06x}"),
            WireError::FrameType { got } => write!(f, "frame of type {got} holds no datagrams"),
            WireError::Overrun { need, got } => write!(f, "{need} octets are announced, {got} are left"),
            WireError::Rest { octets } => write!(f, "{octets} octets behind the last datagram"),
            WireError::MailboxType { got } => write!(f, "mail of type {got} was not expected"),
            WireError::Service { got } => write!(f, "unknown service {got:#04x}"),
            WireError::NoRoom { need, got } => write!(f, "{need} octets do not fit into {got}"),
        }
    }
}

impl core::error::Error for WireError {}

/// `count` octets from `at` on.
pub(crate) fn slice(octets: &[u8], at: usize, count: usize) -> Result<&[u8], WireError> {
    octets.get(at..at.saturating_add(count)).ok_or(WireError::TooShort {
        need: at.saturating_add(count),
        got: octets.len(),
    })
}

/// The octets from `at` on as an array.
pub(crate) fn array<const N: usize>(octets: &[u8], at: usize) -> Result<[u8; N], WireError> {
    let mut out = [0; N];
    out.copy_from_slice(slice(octets, at, N)?);
    Ok(out)
}

pub(crate) fn u16_at(octets: &[u8], at: usize) -> Result<u16, WireError> {
    array(octets, at).map(u16::from_le_bytes)
}

pub(crate) fn u32_at(octets: &[u8], at: usize) -> Result<u32, WireError> {
    array(octets, at).map(u32::from_le_bytes)
}

/// The first `need` octets of a buffer, set to zero.
pub(crate) fn cleared(buffer: &mut [u8], need: usize) -> Result<&mut [u8], WireError> {
    let got = buffer.len();
    let out = buffer.get_mut(..need).ok_or(WireError::NoRoom { need, got })?;
    out.fill(0);
    Ok(out)
}

/// Writes octets at a place that is known to be there.
pub(crate) fn put<const N: usize>(octets: &mut [u8], at: usize, value: [u8; N]) {
    octets[at..at + N].copy_from_slice(&value);
}

#[cfg(test)]
mod tests;
