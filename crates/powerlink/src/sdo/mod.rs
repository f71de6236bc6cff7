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
mod service_data;
#[cfg(feature = "std")]
pub mod udp;

pub use client::{Client, ClientError, Timing};
pub use server::Server;
pub use service_data::{EXPEDITED_READ_MAX, EXPEDITED_WRITE_MAX, SERVICE_DATA_MAX, SERVICE_DATA_OFFSET};

#[cfg(test)]
mod tests;
