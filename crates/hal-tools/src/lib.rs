//! Commands about pins: those of a running control, and what LinuxCNC's HAL files come to here.
//!
//! In:  the pins of a running control, in shared memory; HAL files.
//! Out: tables, graphs, curves; TOML for a machine file.
//!
//! | to learn | file |
//! |---|---|
//! | HAL files to components and nets of a machine file | `hal_import/mod.rs` |
//! | the oscilloscope in a terminal | `hal/scope/mod.rs` |
//! | nets as a graph | `hal/graph.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod hal;
pub mod hal_import;
