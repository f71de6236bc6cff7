//! What can go wrong with an axis, in words that name what to look at.

use crate::error_codes::error_text;
use crate::profile::State;
use core::fmt;

/// A step of the state machine that has a time limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The drive's self-test.
    SelfTest,
    /// Command *shutdown*.
    Shutdown,
    /// Command *switch on*.
    SwitchOn,
    /// 6061 shows the cyclic mode.
    Mode,
    /// Command *enable operation*.
    EnableOperation,
    /// Command *disable operation*.
    DisableOperation,
    /// Command *disable voltage*.
    DisableVoltage,
    /// Command *quick stop*.
    QuickStop,
    /// Command *disable voltage* after a quick stop.
    LeaveQuickStop,
    /// Command *fault reset*.
    FaultReset,
    /// 6061 shows homing mode.
    HomingMode,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Step::SelfTest => "end of the drive's self-test",
            Step::Shutdown => "command shutdown",
            Step::SwitchOn => "command switch on",
            Step::Mode => "change to the cyclic mode (6060 to 6061)",
            Step::EnableOperation => "command enable operation",
            Step::DisableOperation => "command disable operation",
            Step::DisableVoltage => "command disable voltage",
            Step::QuickStop => "command quick stop",
            Step::LeaveQuickStop => "command disable voltage after a quick stop",
            Step::FaultReset => "command fault reset",
            Step::HomingMode => "change to homing mode (6060 to 6061)",
        })
    }
}

/// How homing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingFault {
    /// The drive shows *homing error*.
    Drive,
    /// The drive stopped before it was done.
    Stopped,
    /// It took too long.
    Timeout,
}

/// Why an axis is stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisFault {
    /// The drive reports a fault.
    Drive {
        /// 603F; 0: none shown, or not mapped.
        error_code: u16,
    },
    /// The drive did not take a step in time.
    StepTimeout {
        /// The step that took too long.
        step: Step,
    },
    /// As `StepTimeout`, and the statusword says (bit 9) that the drive does not obey the controlword.
    LocalControl {
        /// The step in which it happened.
        step: Step,
    },
    /// The drive went off line while it was powered.
    Lost,
    /// The drive left OPERATION ENABLED by itself.
    UnexpectedDisable {
        /// Where it went.
        state: State,
    },
    /// The drive does not get on, or left OPERATION ENABLED, and bit 3 of 60FD says why.
    Interlock,
    /// The statusword shows a pattern that is no state.
    UnknownState {
        /// 6041.
        statusword: u16,
    },
    /// The enabled drive does not follow its target.
    CommandIgnored {
        /// 6061.
        mode_display: i8,
    },
    /// The drive or a time limit ended its homing.
    Homing(HomingFault),
}

impl fmt::Display for AxisFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AxisFault::Drive { error_code: 0 } => f.write_str("drive fault without an error code (603F)"),
            AxisFault::Drive { error_code } => {
                write!(f, "drive fault {error_code:04X}h: {}", error_text(*error_code))
            }
            AxisFault::StepTimeout {
                step: step @ (Step::Shutdown | Step::SwitchOn | Step::EnableOperation),
            } => write!(
                f,
                "the drive did not answer in time: {step}; is its safety circuit (STO) closed?"
            ),
            AxisFault::StepTimeout { step } => write!(f, "the drive did not answer in time: {step}"),
            AxisFault::LocalControl { step } => {
                write!(
                    f,
                    "the drive is under local control (statusword bit 9 = 0) and did not answer: {step}"
                )
            }
            AxisFault::Lost => f.write_str("the drive was lost from the bus"),
            AxisFault::UnexpectedDisable {
                state: state @ State::SwitchOnDisabled,
            } => write!(
                f,
                "the drive left OPERATION ENABLED for {state}; was its safety circuit (STO) opened?"
            ),
            AxisFault::UnexpectedDisable { state } => write!(f, "the drive left OPERATION ENABLED for {state}"),
            AxisFault::Interlock => {
                f.write_str("the safety circuit (STO) of the drive is open: bit 3 of 60FDh, interlock, is set")
            }
            AxisFault::UnknownState { statusword } => write!(f, "statusword {statusword:04X}h shows no state"),
            AxisFault::CommandIgnored { mode_display } => {
                write!(
                    f,
                    "the enabled drive does not follow its target (mode shown in 6061: {mode_display})"
                )
            }
            AxisFault::Homing(HomingFault::Drive) => f.write_str("homing: the drive shows a homing error"),
            AxisFault::Homing(HomingFault::Stopped) => f.write_str("homing: the drive stopped before it was done"),
            AxisFault::Homing(HomingFault::Timeout) => f.write_str("homing: not done in time"),
        }
    }
}

impl core::error::Error for AxisFault {}
