//! CiA 402 drive profile (IEC 61800-7-201), both sides of the wire.
//!
//! In:  statusword and actual values of a drive, and what its user wants ([`axis`], the controller);
//!      controlword and set-points of a controller, and what its motor does ([`device`], the drive).
//! Out: the next controlword and set-point of a cycle; the next statusword and demand of a cycle.
//!
//! The two sides share [`profile`], the tables of the standard, and nothing else. `no_std`, no allocation; everything
//! that runs in a cycle is RT: bounded, no locks, no panics that outside data could reach.
//!
//! The controller gives one command for each state that it sees (`examples/move_axis.rs` moves a simulated drive):
//!
//! ```
//! use cia402::{Axis, AxisConfig, Feedback, Request, Status};
//!
//! let mut axis = Axis::new(AxisConfig::default());
//! let mut now_ns = 0;
//! let mut cycle = |axis: &mut Axis, statusword| {
//!     now_ns += 1_000_000;
//!     let feedback = Feedback { statusword, position: 1000, mode_display: 8, ..Feedback::default() };
//!     axis.cycle(now_ns, true, &feedback, 1000).controlword
//! };
//! assert_eq!(cycle(&mut axis, 0x0250), 0x0000); // switch on disabled: nothing happens without a request
//! axis.request(Request::Enable);
//! assert_eq!(cycle(&mut axis, 0x0250), 0x0006); // shutdown
//! assert_eq!(cycle(&mut axis, 0x0231), 0x0007); // ready to switch on: switch on
//! assert_eq!(cycle(&mut axis, 0x0233), 0x000F); // switched on: enable operation
//! assert_eq!(cycle(&mut axis, 0x1237), 0x000F); // operation enabled: the target follows the motion from here on
//! assert_eq!(axis.status(), Status::Enabled);
//! ```
#![no_std]
#![warn(clippy::missing_errors_doc)]

pub mod axis;
pub mod device;
pub mod error_codes;
pub mod profile;

pub use axis::{
    Axis, AxisConfig, AxisFault, Feedback, HomingFault, HomingState, Mode, Request, Setpoint, Status, Step, Target,
};
pub use error_codes::error_text;
pub use profile::{Command, State, state};
