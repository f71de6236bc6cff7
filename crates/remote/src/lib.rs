//! Commands to a running control, over its socket.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod control;
pub mod jog;
mod progress;
pub mod tables;
pub mod top;
