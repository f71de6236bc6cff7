//! `isocnc jitter`: how exactly the cycle is kept while a program runs, beside what the PC can do at all.
//!
//! In:  a machine file, a program, a number of cycles.
//! Out: [`JitterReport`]: for each round the SoC period at the far end of the wire, the control's own figures and the floor
//!      of the PC (wake-up latency, `cyclictest`, gaps in which the core did not run), and their ratios.
//!
//! A round is a part of the cycles with the program running, then the floor on the same core with nothing of ours on it, so
//! that both meet the same neighbours. All of it takes constant memory whatever the number of cycles.
//!
//! `run.rs` is the order of a measurement.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod bar;
pub mod csv;
pub mod cyclictest;
pub mod distribution;
pub mod floor;
pub mod goals;
pub mod output;
pub mod pc;
pub mod plot;
mod processes;
pub mod program;
pub mod ratios;
pub mod report;
pub mod run;
#[cfg(test)]
pub mod samples;
pub mod table;
mod window;
mod words;

pub use distribution::Distribution;
pub use report::JitterReport;
