//! Real time: the cycle thread, the time-out thread and what they need from the system.

pub mod assemble;
pub mod calibrate;
pub mod cycle;
pub mod diagnosis;
pub mod drives;
pub mod encoder;
pub mod figures;
pub mod hand;
pub mod homing;
pub mod jitter;
pub mod network_locks;
pub mod override_pins;
pub mod overrides;
pub mod pins;
pub mod probe;
pub mod recent;
pub mod rights;
pub mod setup;
pub mod shared;
pub mod spin;
pub mod spindle;
pub mod steadiness;
pub mod thread;
pub mod timeout;
pub mod wait;
pub mod world_hand;
