//! What an axis holds from cycle to cycle, and where it stands.

use super::fault::{AxisFault, Step};
use super::interface::AxisConfig;
use crate::profile::{Command, State};

/// Whether a drive is homed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingState {
    /// Not since it came on line.
    NotHomed,
    /// The drive homes itself.
    Running,
    /// The position counts from home.
    Homed,
    /// Tried, and failed.
    Failed,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Homing {
    pub(super) step: HomingStep,
    /// Start of homing as a whole; set in its first cycle.
    pub(super) started_ns: Option<u64>,
}

impl Homing {
    pub(super) fn new() -> Homing {
        Homing {
            step: HomingStep::SetMode,
            started_ns: None,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) enum HomingStep {
    /// 6060 = 6, until 6061 shows it.
    SetMode,
    /// Bit 4 is set.
    Run {
        /// When the edge was made.
        edge_ns: u64,
        /// *Attained* was shown before the edge and has not been taken back yet.
        stale: bool,
        /// *Running* has been seen.
        ran: bool,
        /// Since when *stopped* is shown after *running*.
        stopped_ns: Option<u64>,
    },
    /// 6060 = cyclic mode, until 6061 shows it.
    Return,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Phase {
    Offline,
    Disabled,
    Enabling,
    Enabled,
    Homing(Homing),
    Disabling,
    /// As `Disabling`, without a ramp.
    CuttingPower,
    QuickStopping,
    Faulted {
        fault: AxisFault,
        reset: Reset,
    },
}

/// Progress of a fault reset.
#[derive(Clone, Copy, Debug)]
pub(super) enum Reset {
    NotAsked,
    /// Bit 7 is shown as 0 for this many more cycles.
    Low(u8),
    /// Bit 7 is shown as 1.
    High,
}

/// A time limit at work.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timer {
    pub(super) step: Step,
    pub(super) since_ns: u64,
}

/// Supervisor of one drive.
#[derive(Clone, Debug)]
pub struct Axis {
    pub(super) config: AxisConfig,
    pub(super) phase: Phase,
    /// As told to the last cycle.
    pub(super) online: bool,
    pub(super) drive: Option<State>,
    pub(super) statusword: u16,
    /// Bit 3 of 60FD.
    pub(super) interlock: bool,
    pub(super) position: i32,
    pub(super) actual: i64,
    /// PP: the new set-point has not been acknowledged.
    pub(super) new_set_point: bool,
    pub(super) target: i64,
    /// Velocity and torque of this cycle; 0 unless enabled.
    pub(super) velocity: i32,
    pub(super) torque: i16,
    pub(super) timer: Option<Timer>,
    /// When enabling began, or when the enabled drive was last seen to follow.
    pub(super) mark_ns: u64,
    pub(super) homed: HomingState,
}

impl Axis {
    /// An axis whose drive has not been seen yet.
    pub fn new(config: AxisConfig) -> Axis {
        Axis {
            config,
            phase: Phase::Offline,
            online: false,
            drive: None,
            statusword: 0,
            interlock: false,
            position: 0,
            actual: 0,
            new_set_point: false,
            target: 0,
            velocity: 0,
            torque: 0,
            timer: None,
            mark_ns: 0,
            homed: HomingState::NotHomed,
        }
    }
}

/// The command that brings a drive one step nearer to SWITCH ON DISABLED by its own ramp.
pub(super) fn command_down(drive: State) -> Command {
    match drive {
        State::OperationEnabled => Command::SwitchOn,
        State::SwitchedOn => Command::Shutdown,
        State::ReadyToSwitchOn
        | State::QuickStopActive
        | State::NotReadyToSwitchOn
        | State::SwitchOnDisabled
        | State::FaultReactionActive
        | State::Fault => Command::DisableVoltage,
    }
}

/// As [`command_down`], but a drive that moves stops by the quick-stop ramp.
pub(super) fn command_stop(drive: State) -> Command {
    match drive {
        State::OperationEnabled | State::QuickStopActive => Command::QuickStop,
        State::NotReadyToSwitchOn
        | State::SwitchOnDisabled
        | State::ReadyToSwitchOn
        | State::SwitchedOn
        | State::FaultReactionActive
        | State::Fault => command_down(drive),
    }
}
