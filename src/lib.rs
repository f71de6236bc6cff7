//! isocnc: the process, the only place where motion, pins, drives and bus meet.
//!
//! In:  a machine file ([`config`]) and a part program ([`program`]).
//! Out: set-points to drives over the field bus ([`bus`]), every cycle ([`rt`]).

pub mod analyser;
pub mod api;
pub mod bus;
pub mod cli;
pub mod config;
pub mod host;
pub mod jitter;
pub mod machine;
pub mod operator;
pub mod plot;
pub mod program;
pub mod rt;
pub mod sim;
