//! Machine state, order of steps and what faults do.
//!
//! In:  what was seen (a fault, a wish, a state), a checked machine file.
//! Out: what follows from it; files that keep what a machine remembers.
//!
//! | to learn | file |
//! |---|---|
//! | what a fault does: the one table; what it comes of | `faults.rs`; `fault_causes.rs` |
//! | what may be ordered when: the one table, from which `docs/states.md` is made | `permission.rs` |
//! | steps from power-on to power-off, each with a time limit | `sequence.rs` |
//! | how many skipped cycles are too many | `overruns.rs` |
//! | what is known again after a restart; the journal; RETAIN variables | `state_file.rs`; `journal.rs`; `retain_file.rs` |
//! | what a machine remembers between programs: tools, parameters | `tables/mod.rs` |
//! | how a file is replaced so that no crash spoils it | `safe_file/mod.rs` |
//! | which module is missing, moved or swapped, in words, for a start and for `bus scan` | `modules.rs` |
//! | what the machine file says to planner and interpolation | `motion_settings.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod fault_causes;
pub mod fault_order;
pub mod faults;
pub mod journal;
pub mod modules;
pub mod motion_settings;
pub mod overruns;
pub mod permission;
pub mod retain_file;
pub mod safe_file;
pub mod sequence;
pub mod state;
pub mod state_file;
pub mod tables;
