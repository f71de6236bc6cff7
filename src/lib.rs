//! isocnc: the process, the only place where motion, pins, drives and bus meet.
//!
//! In:  a machine file ([`config`]) and a part program ([`program`]).
//! Out: set-points to drives over the field bus ([`bus`]), every cycle ([`rt`]).

pub mod bus;
pub mod cli;
pub mod config;
pub mod doctor;
pub mod machine;
pub mod program;
pub mod rt;
pub mod service;
pub mod sim;
