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
//!
//! # Where to read
//!
//! | to learn | file |
//! |---|---|
//! | frames and datagrams; what a command does; registers, AL states and their status codes | `wire/frame.rs`; `wire/command.rs`; `wire/register/` |
//! | EEPROM images; mails; SDO and SDO information | `wire/sii.rs`; `wire/mailbox.rs`; `wire/coe/` |
//! | a simulated device: its chip, its clock, its firmware, its SDO server | `sub/esc/`, `sub/clock.rs`, `sub/device/`, `sub/coe.rs` |
//! | its objects and process data; drives, terminals, couplers ready made | `sub/objects.rs`, `sub/application.rs`; `sub/models.rs` |
//! | the cables between devices: order, delays, breaks; the ESI file of the simulated devices | `sub/segment.rs`; `sub/esi.rs` |
//! | the frames of a cycle, and what came back for each member | `main/cycle.rs` |
//! | all devices from the count to OP, frames of services, recovery; one device, step by step | `main/network/`; `main/device/` |
//! | mails and SDOs of the main device; process data compared, written, read again; orders while devices run | `main/mail.rs`; `main/mapping.rs`; `main/orders.rs` |
//! | what the main device is to make of devices; what it reports, in words | `main/config.rs`; `main/event.rs` |
//! | EEPROMs through registers; where a cable is broken or frames are spoilt | `main/eeprom.rs`; `main/survey.rs` |
//! | what a cycle costs; how frames lie to SYNC0 | `main/budget.rs`; `main/punctuality.rs` |
//! | how our cycle follows the clock of the bus; offsets and delays of devices from the reference clock | `main/phase.rs`; `main/clocks.rs`, `main/delay.rs` |
//!
//! A main device of others, ethercrab, brings the simulated devices to OP (`tests/ethercrab.rs`). Ours does so on virtual time, with
//! every kind of trouble (`tests/network/`). On a network interface, `examples/simulate.rs` answers any main device and
//! `examples/run.rs` is ours. Why ours is our own: `docs/decisions/ethercat.md`.
#![no_std]
#![warn(clippy::missing_errors_doc)]
#![allow(special_module_name, reason = "`main` is the folder of the main device")]

#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod main;
#[cfg(feature = "std")]
pub mod sub;
pub mod wire;
