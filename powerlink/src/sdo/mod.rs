//! SDO: reading and writing objects of another node, as service data of ASnd frames.
//!
//! In:  service data of received SDO frames (ASnd service 0x05: the Ethernet frame from octet 18 on), the time, and on the
//!      client's side the wishes of the application.
//! Out: service data of frames to be sent when the node may use the asynchronous slot, and results.
//!
//! Three layers, each in its own file: [`sequence`] (numbers that find losses and duplicates), [`command`] (what is read or
//! written), and the two ends of a connection, [`Server`] and [`Client`]. Nothing here does I/O, waits or allocates.
//!
//! Commands are WriteByIndex and ReadByIndex, WriteMultipleByIndex and ReadMultipleByIndex ([`multiple`]), in one frame or in
//! segments. The server answers every other command with abort
//! [`AbortCode::UNKNOWN_COMMAND`](obd::AbortCode::UNKNOWN_COMMAND).

pub mod client;
pub mod command;
pub mod datagram;
pub mod multiple;
pub mod sequence;
pub mod server;
#[cfg(feature = "std")]
pub mod udp;

pub use client::{Client, ClientError, Timing};
pub use server::Server;

/// First octet of the service data in the Ethernet frame.
pub const SERVICE_DATA_OFFSET: usize = 18;

/// Longest service data this crate sends. An IP packet of the least AsyncMTU (0x1F98/8 = 300 octets), which every node must
/// accept, holds it behind the IP, UDP and POWERLINK headers; so does an ASnd frame.
pub const SERVICE_DATA_MAX: usize = 300 - 20 - 8 - 4;

const _: () = assert!(SERVICE_DATA_MAX == sequence::HEADER_LEN + command::HEADER_LEN + command::SEGMENT_MAX);

/// Longest value that fits in one frame when it is written: behind the object address.
pub const EXPEDITED_WRITE_MAX: usize = command::SEGMENT_MAX - command::ADDRESS_LEN;

/// Longest value that fits in one frame when it is read.
pub const EXPEDITED_READ_MAX: usize = command::SEGMENT_MAX;

/// Length of service data without a command: the command header is sent as zero.
pub(crate) const EMPTY_LEN: usize = sequence::HEADER_LEN + command::HEADER_LEN;

#[cfg(test)]
mod tests;
