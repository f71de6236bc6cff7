//! The protocol of Grbl 1.1 (serial senders of G-code) as a server, sans I/O: this crate opens nothing and has no clock.
//!
//! In:  octets of the sender; answers of the control to orders ([`Answer`]).
//! Out: octets for the sender; [`Order`]s for the control, each with a number under which its answer comes back.
//!
//! | to learn | file |
//! |---|---|
//! | real-time octets, which are taken out at once; lines | `octets.rs` |
//! | words of a line and everything that Grbl finds wrong with it, before the control sees it | `words.rs`, `block.rs`, `moves.rs` |
//! | what lines leave in force | `modes.rs` |
//! | numbers of errors and alarms | `number.rs` |
//! | what is told: status, settings, offsets, modes | `status.rs`, `reports.rs` |
//! | a sender, from its greeting to its end | `session/mod.rs` |
//!
//! # How a job runs without stops between its lines
//!
//! A line that passes the check here is answered with `ok` as soon as there is room for it, not when it has been executed, and goes
//! to the control behind those before it, by [`Order::Lines`]. The control runs all lines that come in time as one growing program,
//! so that its look-ahead reaches over them. How far a sender can be ahead is limited by [`Order::Lines`] being answered only when
//! the control has read so far, and by [`WAITING_MAX`] octets here; beyond that, `ok` waits. Lines that Grbl answers only once the
//! machine has come to them (dwells, pauses, the end of a program, probing moves) are answered so here, too.

mod block;
mod modes;
mod moves;
mod number;
mod octets;
mod reports;
mod session;
mod status;
mod words;

#[cfg(test)]
mod property_tests;

pub use number::{AlarmNumber, ErrorNumber};
pub use octets::{Input, Inputs, LINE_MAX};
pub use reports::Offsets;
pub use session::{Answer, Order, Session, TAKE_MAX, WAITING_MAX};
pub use status::{Activity, Axis, Machine, Overrides, Spindle, Status};
