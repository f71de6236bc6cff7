//! Words and bounds of parameters: what the control refuses beyond them, and what its schemas say.
//!
//! Those that follow from another part of the control are compared with it where that is known (`crates/api/src/methods/arguments.rs`).

/// Octets of a program.
pub const PROGRAM_MAX: u64 = 1 << 30;
/// Letters of axes, in the order of positions.
pub const LETTERS: [&str; 9] = ["X", "Y", "Z", "A", "B", "C", "U", "V", "W"];
/// Work systems, from 1 on.
pub const WORK_SYSTEMS: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
/// What can go wrong with a simulated drive, and what mends it.
pub const SIM_FAULTS: [&str; 8] = [
    "overcurrent",
    "following-error",
    "limit-switch",
    "index-missing",
    "slow-enable",
    "power-off",
    "sto",
    "none",
];
/// Number of the last joint that a machine can have.
pub const JOINT_MAX: u64 = 15;
/// Number of the last axis of a drive.
pub const DRIVE_AXIS_MAX: u64 = 7;
/// Octets of an object of a node.
pub const SDO_VALUE_MAX: usize = 4096;
/// Octets of one part of an upload.
pub const PART_MAX: usize = 24 * 1024;
/// Octets of a SHA-256.
pub const SHA256: usize = 32;
/// Lines of a program in one answer.
pub const LINES_MAX: u64 = 500;
/// States a second that a subscriber can be told, but for events.
pub const STATE_RATE_MAX_HZ: u64 = 20;
/// Notifications a second of an oscilloscope.
pub const SCOPE_RATE_MAX_HZ: u64 = 50;
/// Channels of an oscilloscope.
pub const CHANNELS_MAX: usize = 32;
/// Pins whose values are asked for at once.
pub const VALUES_MAX: usize = 64;
/// The parameter that every order may have: its id.
pub const REQUEST_ID: &str = "request_id";
/// Longest id of an order, octets.
pub const ID_MAX: usize = 64;
