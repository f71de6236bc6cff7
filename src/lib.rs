//! isocnc: the process, the only place where motion, pins, drives and bus meet.
//!
//! In:  a machine file ([`config`]) and a part program ([`program`]).
//! Out: set-points to drives over the field bus ([`bus`]), every cycle ([`rt`]).

// The state of a control is one large JSON object.
#![recursion_limit = "256"]
// An application: what is public here is so for its binary and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub use ::analyser;
pub use ::api;
pub use ::bus;
pub mod cli;
mod services;
pub use ::bus_tools;
pub use ::config;
pub use ::hal_tools;
pub use ::host;
pub use ::jitter;
pub use ::jobs;
pub use ::machine;
pub use ::operator;
pub use ::plan_report;
pub use ::plot;
pub use ::program;
pub use ::protocol;
pub use ::remote;
pub use ::rt;
pub use ::scope;
pub use ::sim;
pub use ::terminal;
pub use ::tune;

#[doc = include_str!("../ARCHITECTURE.md")]
pub mod architecture {}

/// What components are made of, for those that are compiled in: [`main_with`].
pub use ::components;

/// The command line of a control with components of its own beside those of the catalogue; `examples/own-component` is one.
pub fn main_with(own: &'static [components::Kind]) -> std::process::ExitCode {
    if let Err(error) = components::register(own) {
        files::errln!("isocnc: {error}");
        return std::process::ExitCode::from(2);
    }
    cli::main()
}
