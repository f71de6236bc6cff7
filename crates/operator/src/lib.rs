//! The running control as its operator sees it: a session from start to end, programs, manual mode, stand-by, reports.
//!
//! In:  a machine, a program or the wish to stand by; orders, notices and trace records.
//! Out: orders to the cycle thread; journal, alarms, reports, tables on the disk; the exit code.
//!
//! | to learn | file |
//! |---|---|
//! | how the threads of a session start and end | `session.rs` |
//! | the operator's loop; what is shown while something runs | `operator_loop.rs`; `progress.rs` |
//! | one program and its report; the control without one | `single_run.rs`, `report.rs`; `standby/mod.rs` |
//! | how orders of clients are checked against `machine::permission` and carried out | `standby/clients/mod.rs` |
//! | which modes the block under way has: each element carries their number (`Source::modes`) | `standby/clients/executed.rs` |
//! | what is kept for a restart, and whether a homed mark of an earlier session can be believed | `memory.rs` |
//! | when tool table and parameters go to the disk; an answer waits until what it confirms is there (`Mark`) | `table_writer.rs`; `tests_kills.rs` kills all of it two hundred times |
//! | reports of programs that stand-by has run | `program_reports.rs` |
//! | how far set-points are from the programmed path, judged during the run | `path_judge.rs` |
//! | circles judged by what drives report | `circularity.rs` |
//! | a whole control on virtual time in one thread (`bench-servo`, tests) | `rehearsal.rs` |
//! | what the program serves beside the socket, such as the panel | `service.rs` |
//! | what a service manager hears | `systemd.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod bursts;
pub mod circularity;
pub mod console;
pub mod journal_keeper;
mod manual_mode;
pub mod measurements;
mod memory;
pub mod operator_loop;
mod path_judge;
pub mod program_reports;
pub mod progress;
pub mod recorder;
pub mod rehearsal;
mod remembered;
pub mod report;
mod retain_keeper;
pub mod service;
pub mod session;
pub mod single_run;
pub mod standby;
pub mod systemd;
mod table_writer;
#[cfg(test)]
mod tests_kills;
