//! Part program text to canonical calls.
//!
//! In:  the octets of a program in LinuxCNC's RS274/NGC dialect, and what the machine remembers ([`Settings`]).
//! Out: canonical calls ([`motion::canon`]) in the order in which they happen, or located errors ([`Error`]).
//!
//! Knows no machine limits, no time and no bus.

mod arc;
mod block;
mod error;
mod modal;
mod scan;

pub use error::{Construct, Error, ErrorKind};
pub use scan::LINE_MAX;
