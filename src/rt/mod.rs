//! Real time: the cycle thread, the time-out thread and what they need from the system.

pub mod assemble;
pub mod axis_jog;
pub mod counter;
pub mod cycle;
pub mod cycle_stats;
pub mod desk;
pub mod drives;
pub mod encoder;
pub mod homing;
pub mod io_channels;
pub mod io_pins;
pub mod jog_pins;
pub mod joint_jog;
pub mod loop_pins;
pub mod override_pins;
pub mod overrides;
pub mod pins;
pub mod recent;
pub mod shared;
pub mod spindle;
pub mod thread;
pub mod timeout;
pub mod tool_pockets;
pub mod waiting;
pub mod way_back;
