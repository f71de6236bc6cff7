//! CiA 402 drive profile (IEC 61800-7-201), both sides of the wire.
//!
//! In:  statusword and actual values of a drive, and what its user wants ([`axis`], the controller);
//!      controlword and set-points of a controller, and what its motor does ([`device`], the drive).
//! Out: the next controlword and set-point of a cycle; the next statusword and demand of a cycle.
//!
//! The two sides share [`profile`], the tables of the standard, and nothing else. `no_std`, no allocation; everything
//! that runs in a cycle is RT: bounded, no locks, no panics that outside data could reach.
#![no_std]

pub mod axis;
pub mod device;
pub mod error_codes;
pub mod profile;

pub use axis::{
    Axis, AxisConfig, AxisFault, Feedback, HomingFault, HomingState, Mode, Request, Setpoint, Status, Step,
};
pub use error_codes::error_text;
pub use profile::{Command, State, state};
