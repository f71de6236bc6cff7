//! Commands to a running control, over its socket.
//!
//! In:  arguments, keys; the control socket of a machine, or of the only one that runs.
//! Out: orders; lines, JSON, or a screen.
//!
//! `control/mod.rs` has the orders and `status`, `jog.rs` the keys that move a machine. Of `isocnc top`, `top/app.rs` is what keys do,
//! without a clock or terminal of its own, `top/view.rs` the picture, `top/link.rs` the thread that waits for the control.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod buttons;
pub mod control;
pub mod jog;
mod place;
mod progress;
pub mod tables;
pub mod top;
