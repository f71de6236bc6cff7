//! What the control tells an axis and hears from it, and what the drive sends and gets.

use super::fault::AxisFault;
use crate::profile::{controlword, mode};

/// Cyclic mode in which the drive follows the interpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Cyclic synchronous position (8): target in 607A.
    #[default]
    Csp,
    /// Interpolated position (7): target in 60C1:1; older drives.
    Ip,
    /// Cyclic synchronous velocity (9): target in 60FF. Who commands it closes the position loop.
    Csv,
    /// Cyclic synchronous torque (10): target in 6071. Who commands it closes the loops of velocity and position.
    Cst,
}

impl Mode {
    /// The mode's code in 6060 and 6061.
    pub const fn code(self) -> i8 {
        match self {
            Mode::Csp => mode::CYCLIC_SYNCHRONOUS_POSITION,
            Mode::Ip => mode::INTERPOLATED_POSITION,
            Mode::Csv => mode::CYCLIC_SYNCHRONOUS_VELOCITY,
            Mode::Cst => mode::CYCLIC_SYNCHRONOUS_TORQUE,
        }
    }

    /// Index and sub-index of the object that takes the mode's target.
    pub const fn target(self) -> (u16, u8) {
        match self {
            Mode::Csp => (0x607A, 0),
            Mode::Ip => (0x60C1, 1),
            Mode::Csv => (0x60FF, 0),
            Mode::Cst => (0x6071, 0),
        }
    }

    /// Whether the drive itself holds a position.
    pub const fn is_position(self) -> bool {
        matches!(self, Mode::Csp | Mode::Ip)
    }

    /// Controlword bits that the mode needs beside *enable operation*.
    pub(super) const fn controlword(self) -> u16 {
        match self {
            Mode::Csp | Mode::Csv | Mode::Cst => 0,
            Mode::Ip => controlword::MODE_START,
        }
    }
}

/// Settings of an [`Axis`](super::Axis).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisConfig {
    /// Time limit of each step of the state machine, ns.
    pub step_timeout_ns: u64,
    /// Time limit of homing as a whole, ns.
    pub homing_timeout_ns: u64,
    /// Cyclic mode in which it is run.
    pub mode: Mode,
    /// How long an enabled drive may show that it does not follow the target, ns.
    pub follow_grace_ns: u64,
}

impl Default for AxisConfig {
    fn default() -> Self {
        AxisConfig {
            step_timeout_ns: 1_000_000_000,
            homing_timeout_ns: 120_000_000_000,
            mode: Mode::Csp,
            follow_grace_ns: 20_000_000,
        }
    }
}

/// What the drive sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Feedback {
    /// 6041.
    pub statusword: u16,
    /// 6064, counts.
    pub position: i32,
    /// 60F4, counts.
    pub following_error: i32,
    /// 6061.
    pub mode_display: i8,
    /// 60FD.
    pub digital_inputs: u32,
    /// 603F; 0 where it is not mapped.
    pub error_code: u16,
}

/// What motion asks for in one cycle; used in [`Status::Enabled`] only, else the axis asks for standstill itself.
///
/// Which of it leads the drive is the [`Mode`]'s: the position in CSP and IP, the velocity in CSV, the torque in CST. What is
/// below the leading one goes beside it as feed-forward, into 60B1 and 60B2, where these are mapped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Target {
    /// Counts, unwrapped. In CSV and CST the place where the joint is to be; the drive does not hear of it.
    pub position: i64,
    /// In the unit of 60FF and 60B1 of the drive.
    pub velocity: i32,
    /// 1/1000 of the rated torque.
    pub torque: i16,
}

/// A position without feed-forward.
impl From<i64> for Target {
    fn from(position: i64) -> Target {
        Target {
            position,
            ..Target::default()
        }
    }
}

/// What the drive gets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Setpoint {
    /// 6040.
    pub controlword: u16,
    /// 607A or 60C1:1, counts; the low 32 bits of the unwrapped position.
    pub target_position: i32,
    /// 60FF: target of CSV; 0 in other modes and while the axis is not enabled.
    pub target_velocity: i32,
    /// 6071: target of CST; 0 in other modes and while the axis is not enabled.
    pub target_torque: i16,
    /// 60B1: feed-forward of CSP and IP.
    pub velocity_offset: i32,
    /// 60B2: feed-forward of CSP, IP and CSV.
    pub torque_offset: i16,
    /// 6060.
    pub mode: i8,
}

/// What the control wants of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Power off, by the drive's own ramp.
    Disable,
    /// Power on and follow; accepted in [`Status::Disabled`] only.
    Enable,
    /// Stop by the quick-stop ramp, then power off.
    QuickStop,
    /// Power off at once: the motor runs out, and its brake falls in.
    CutPower,
    /// Acknowledge a fault; accepted in [`Status::Faulted`] only. Never enables.
    ResetFault,
    /// Home by the drive's own method (6098); accepted in [`Status::Enabled`] only.
    Home,
}

/// What the axis is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The drive is not on the bus.
    Offline,
    /// No torque, no fault.
    Disabled,
    /// On the way to [`Status::Enabled`].
    Enabling,
    /// Follows the commanded target.
    Enabled,
    /// The drive homes itself; the commanded target is not used.
    Homing,
    /// On the way to [`Status::Disabled`].
    Disabling,
    /// Stopping by the quick-stop ramp.
    QuickStopping,
    /// Stopped by a fault until it is reset.
    Faulted(AxisFault),
}
