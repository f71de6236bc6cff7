//! Ethernet POWERLINK V2 (EPSG DS 301): frames, network management, managing node, controlled node, links to a wire.
//!
//! In:  octets of Ethernet frames with EtherType 0x88AB, the time, process data of the application.
//! Out: the frames to send and when; process data of the other nodes; events.
//!
//! Protocol code does no I/O and never asks for the time: [`mn`] and [`cn`] are told what arrived and when, and say
//! what to send and until when to wait. [`link`] holds what carries frames: a raw socket, memory, a pcap file.
//! Without the feature `std` everything but those links builds without `std` and without `alloc`.
#![no_std]

#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod cn;
pub mod error_code;
mod ethernet_queue;
pub mod link;
pub mod mn;
pub mod nmt;
pub mod sdo;
pub mod wire;
