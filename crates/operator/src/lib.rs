//! The running control as its operator sees it: a session from start to end, programs, manual mode, stand-by, reports.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod bursts;
#[cfg(feature = "cell")]
mod cell;
#[cfg(not(feature = "cell"))]
#[path = "no_cell.rs"]
mod cell;
pub mod circularity;
pub mod console;
pub mod journal_keeper;
mod manual_mode;
pub mod measurements;
mod memory;
pub mod operator_loop;
#[cfg(feature = "panel")]
pub mod panel;
#[cfg(not(feature = "panel"))]
#[path = "no_panel.rs"]
pub mod panel;
mod path_judge;
pub mod program_reports;
pub mod progress;
pub mod recorder;
pub mod rehearsal;
mod remembered;
pub mod report;
mod retain_keeper;
pub mod session;
pub mod single_run;
pub mod standby;
pub mod systemd;
mod table_writer;
#[cfg(test)]
mod tests_kills;
