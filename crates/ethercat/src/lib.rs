//! EtherCAT: frames, registers, mailboxes, simulated devices, a main device.
//!
//! In:  octets of Ethernet frames with EtherType 0x88A4, the time. Out: what they say; what devices make of them.
//!
//! Protocol code does no I/O and never asks for the time. Without the feature `std` everything builds without `std` and
//! without `alloc`.
//!
//! A frame that asks all devices for their state, and its answer as a device would change it:
//!
//! ```
//! use ethercat::wire::{BROADCAST, Command, FRAME_LEN_MAX, Frame, FrameWriter, register};
//!
//! let mut buffer = [0; FRAME_LEN_MAX];
//! let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6])?;
//! writer.push(Command::Brd, 7, u32::from(register::AL_STATUS) << 16, 2)?;
//! let length = writer.finish();
//! let frame = Frame::parse(&buffer[..length])?;
//! let datagram = frame.datagrams().next().expect("one was written");
//! assert_eq!((datagram.command, datagram.ado(), datagram.data), (Command::Brd, 0x0130, &[0, 0][..]));
//! # Ok::<(), ethercat::wire::WireError>(())
//! ```
#![no_std]
#![warn(clippy::missing_errors_doc)]
#![allow(special_module_name, reason = "`main` is the folder of the main device")]

#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod main;
#[cfg(feature = "std")]
pub mod sub;
pub mod wire;
