//! What the control tells an axis and hears from it, and what the drive sends and gets.

use super::fault::AxisFault;
use crate::profile::{controlword, mode};

/// Mode in which an axis is run: the cyclic ones follow the interpolation; in the others the drive makes its own way, as auxiliary
/// axes and spindles do.
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
    /// Profile position (1): goes to 607A by its own ramps; each new position is handed over by bits 4 and 12, and taken at once.
    Pp,
    /// Velocity (2) of a frequency converter: target in 6042, 1/min.
    Vl,
    /// Profile velocity (3): runs up to 60FF by its own ramps.
    Pv,
    /// Profile torque (4): goes to the torque of 6071 by its own slope.
    Tq,
}

impl Mode {
    /// The mode's code in 6060 and 6061.
    pub const fn code(self) -> i8 {
        match self {
            Mode::Csp => mode::CYCLIC_SYNCHRONOUS_POSITION,
            Mode::Ip => mode::INTERPOLATED_POSITION,
            Mode::Csv => mode::CYCLIC_SYNCHRONOUS_VELOCITY,
            Mode::Cst => mode::CYCLIC_SYNCHRONOUS_TORQUE,
            Mode::Pp => mode::PROFILE_POSITION,
            Mode::Vl => mode::VELOCITY,
            Mode::Pv => mode::PROFILE_VELOCITY,
            Mode::Tq => mode::PROFILE_TORQUE,
        }
    }

    /// Index and sub-index of the object that takes the mode's target.
    pub const fn target(self) -> (u16, u8) {
        match self {
            Mode::Csp | Mode::Pp => (0x607A, 0),
            Mode::Ip => (0x60C1, 1),
            Mode::Csv | Mode::Pv => (0x60FF, 0),
            Mode::Cst | Mode::Tq => (0x6071, 0),
            Mode::Vl => (0x6042, 0),
        }
    }

    /// Index and sub-index of the object that tells the velocity in the unit of the mode's target.
    pub const fn actual_velocity(self) -> (u16, u8) {
        match self {
            Mode::Vl => (0x6044, 0),
            Mode::Csp | Mode::Ip | Mode::Csv | Mode::Cst | Mode::Pp | Mode::Pv | Mode::Tq => (0x606C, 0),
        }
    }

    /// Whether the drive itself holds a position.
    pub const fn is_position(self) -> bool {
        matches!(self, Mode::Csp | Mode::Ip | Mode::Pp)
    }

    /// Whether bit 12 of the statusword says that the drive follows its target.
    pub(super) const fn tells_following(self) -> bool {
        matches!(self, Mode::Csp | Mode::Ip | Mode::Csv | Mode::Cst)
    }

    /// Controlword bits that the mode needs beside *enable operation*.
    pub(super) const fn controlword(self) -> u16 {
        match self {
            Mode::Csp | Mode::Csv | Mode::Cst | Mode::Pv | Mode::Tq => 0,
            Mode::Ip => controlword::MODE_START,
            // A new position does not wait for the one before.
            Mode::Pp => controlword::MODE_5,
            Mode::Vl => controlword::MODE_START | controlword::MODE_5 | controlword::MODE_6,
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
/// Which of it leads the drive is the [`Mode`]'s: the position in CSP, IP and PP, the velocity in CSV, PV and VL, the torque in
/// CST and TQ. In the cyclic modes, what is
/// below the leading one goes beside it as feed-forward, into 60B1 and 60B2, where these are mapped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Target {
    /// Counts, unwrapped. In CSV and CST the place where the joint is to be; the drive does not hear of it.
    pub position: i64,
    /// In the unit of 60FF and 60B1 of the drive; in VL in that of 6042, 1/min.
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
    /// 607A (CSP, PP) or 60C1:1 (IP), counts; the low 32 bits of the unwrapped position.
    pub target_position: i32,
    /// 60FF: target of CSV and PV; 6042, within its 16 bits: of VL; 0 in other modes and while the axis is not enabled.
    pub target_velocity: i32,
    /// 6071: target of CST and TQ; 0 in other modes and while the axis is not enabled.
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
