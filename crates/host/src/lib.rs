//! This PC: what real time needs of it, what it can do, what stands in the way.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod calibrate;
pub mod capabilities;
pub mod doctor;
pub mod histogram;
pub mod latency;
pub mod logging;
pub mod netns;
pub mod network_locks;
pub mod other_controls;
pub mod setup;
pub mod signals;
pub mod spin;
pub mod stalls;
pub mod steadiness;
pub mod step_port;
pub mod terminal;
pub mod wait;
pub mod wake_signal;
