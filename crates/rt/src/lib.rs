//! Real time: the cycle thread, the time-out thread and what they need from the system.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod analog;
pub mod assemble;
pub mod axis_jog;
pub mod components;
pub mod counter;
pub mod cycle;
pub mod cycle_stats;
pub mod desk;
pub mod drives;
pub mod encoder;
pub mod external;
pub mod homing;
pub mod io_channels;
pub mod io_pins;
pub mod jog_pins;
pub mod joint_jog;
pub mod local_drive;
pub mod logic;
pub mod loop_pins;
pub mod override_pins;
pub mod overrides;
pub mod phase;
pub mod pins;
pub mod recent;
pub mod shared;
pub mod spindle;
mod spindle_drive;
pub mod step_pins;
pub mod steps;
pub mod thread;
pub mod timeout;
pub mod times;
pub mod tool_pockets;
pub mod waiting;
pub mod way_back;
