//! Real time: the cycle thread, the time-out thread and what they need from the system.

pub mod jitter;
pub mod setup;
pub mod timeout;
pub mod wait;
