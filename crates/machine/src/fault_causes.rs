//! Why something is wrong: what a fault carries, each with its words.
//!
//! In:  what was seen. Out: words for the operator. What other crates know of has its sentence there, and its code here.

use cia402::axis::{AxisFault, HomingFault, Step};
use cia402::error_codes::error_entry;
use cia402::profile::State;
use motion::rt::homing::HomingFailure;
use motion::rt::{PATIENCE_S, SyncFault};
use protocol::{Message, Param, message};

/// What a drive supervisor saw.
pub fn drive(fault: AxisFault) -> Message {
    let said = |code: &str| Message::new(code, fault, []);
    let in_step = |code: &str, of: Step| Message::new(code, fault, [("step", step(of).into())]);
    match fault {
        AxisFault::Drive { error_code: 0 } => said("drive.fault_without_code"),
        AxisFault::Drive { error_code } => {
            let (number, what) = (format!("{error_code:04X}h"), drive_error(error_code));
            Message::new("drive.fault", fault, [("number", number.into()), ("what", what.into())])
        }
        AxisFault::StepTimeout {
            step: step @ (Step::Shutdown | Step::SwitchOn | Step::EnableOperation),
        } => in_step("drive.no_answer_perhaps_sto", step),
        AxisFault::StepTimeout { step } => in_step("drive.no_answer", step),
        AxisFault::LocalControl { step } => in_step("drive.local_control", step),
        AxisFault::Lost => said("drive.lost"),
        AxisFault::UnexpectedDisable { state } => {
            let code = match state {
                State::SwitchOnDisabled => "drive.left_enabled_perhaps_sto",
                _ => "drive.left_enabled",
            };
            Message::new(code, fault, [("state", state.to_string().into())])
        }
        AxisFault::Interlock => said("drive.interlock"),
        AxisFault::UnknownState { statusword } => {
            let word = format!("{statusword:04X}h");
            Message::new("drive.unknown_state", fault, [("word", word.into())])
        }
        AxisFault::CommandIgnored { mode_display } => {
            let mode = i32::from(mode_display);
            Message::new("drive.command_ignored", fault, [("mode", mode.into())])
        }
        AxisFault::Homing(HomingFault::Drive) => said("drive.homing_error"),
        AxisFault::Homing(HomingFault::Stopped) => said("drive.homing_stopped"),
        AxisFault::Homing(HomingFault::Timeout) => said("drive.homing_late"),
    }
}

/// What an error code of a drive (603F) means.
fn drive_error(code: u16) -> Message {
    match error_entry(code) {
        Some((number, text)) => Message::new(&format!("drive_error.{number:04x}"), text, []),
        None => message!("drive_error.unknown", "code unknown to the profile"),
    }
}

fn step(step: Step) -> Message {
    let code = match step {
        Step::SelfTest => "drive_step.self_test",
        Step::Shutdown => "drive_step.shutdown",
        Step::SwitchOn => "drive_step.switch_on",
        Step::Mode => "drive_step.mode",
        Step::EnableOperation => "drive_step.enable_operation",
        Step::DisableOperation => "drive_step.disable_operation",
        Step::DisableVoltage => "drive_step.disable_voltage",
        Step::QuickStop => "drive_step.quick_stop",
        Step::LeaveQuickStop => "drive_step.leave_quick_stop",
        Step::FaultReset => "drive_step.fault_reset",
        Step::HomingMode => "drive_step.homing_mode",
    };
    Message::new(code, step, [])
}

/// Why a joint could not be homed.
pub fn homing(failure: HomingFailure) -> Message {
    match failure {
        HomingFailure::NoSwitch => message!("homing.no_switch", "no home switch within the search distance"),
        HomingFailure::StaysClosed => {
            message!(
                "homing.stays_closed",
                "the home switch does not open when the joint leaves it"
            )
        }
        HomingFailure::Lost => {
            message!(
                "homing.lost",
                "the home switch was not found again when it was approached slowly"
            )
        }
        HomingFailure::Unsteady => {
            message!(
                "homing.unsteady",
                "the home switch is not steady enough for the wanted resolution"
            )
        }
        HomingFailure::NoIndex => message!("homing.no_index", "no index pulse behind the home switch"),
        HomingFailure::Skewed => message!("homing.skewed", "the joints of the gantry are too far from square"),
        HomingFailure::Aborted => message!("homing.aborted", "ended by the operator"),
    }
}

/// Why a move in step with the spindle was given up.
pub fn in_step(fault: SyncFault) -> Message {
    let patience = || [("patience", Param::from(PATIENCE_S))];
    match fault {
        SyncFault::NoIndex => Message::new("sync.no_index", fault, patience()),
        SyncFault::SpindleStands => Message::new("sync.spindle_stands", fault, patience()),
        SyncFault::TooFast => Message::new("sync.too_fast", fault, patience()),
        SyncFault::NotReversed => Message::new("sync.not_reversed", fault, []),
        SyncFault::NoNumber => Message::new("sync.no_number", fault, []),
        SyncFault::Aborted => Message::new("sync.aborted", fault, []),
    }
}

/// What went wrong in a scan of a program in Structured Text.
pub fn wrong(wrong: logic::Wrong) -> Message {
    let code = match wrong {
        logic::Wrong::DivisionByZero => "logic.division_by_zero",
        logic::Wrong::NoNumber => "logic.no_number",
        logic::Wrong::RealRange => "logic.real_range",
        logic::Wrong::Index => "logic.index",
        logic::Wrong::Selector => "logic.selector",
        logic::Wrong::Bcd => "logic.bcd",
        logic::Wrong::StepZero => "logic.step_zero",
        logic::Wrong::Iterations => "logic.iterations",
        logic::Wrong::Steps => "logic.steps",
    };
    Message::new(code, wrong, [])
}

/// Why the spindle is not at the angle of M19.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OrientFailure {
    /// The time of Q is over.
    Late {
        /// Wanted angle, degrees.
        degrees: f64,
        /// The time, s.
        timeout_s: f64,
    },
    /// `spindle.0.orient-fault` is not 0.
    Fault {
        /// Its value.
        code: i32,
    },
}

impl OrientFailure {
    /// In words.
    pub fn message(self) -> Message {
        match self {
            OrientFailure::Late { degrees, timeout_s } => message!(
                "spindle.orient_late",
                "spindle.0.is-oriented does not tell within {timeout} s that {angle} degrees are reached (M19)",
                timeout = timeout_s,
                angle = degrees
            ),
            OrientFailure::Fault { code } => message!(
                "spindle.orient_fault",
                "what orients it reports fault {number} (spindle.0.orient-fault, M19)",
                number = code
            ),
        }
    }
}

/// Speed of a spindle that has been waited for too long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedNotReached {
    /// Number of the spindle.
    pub spindle: u8,
    /// Wanted, 1/min, above 0 with M3.
    pub wanted_rpm: f64,
    /// Measured; `None` without an encoder.
    pub measured_rpm: Option<f64>,
}

impl SpeedNotReached {
    /// In words.
    pub fn message(self) -> Message {
        match self.measured_rpm {
            Some(measured_rpm) => message!(
                "spindle.wrong_speed",
                "turns at {measured:.0} 1/min, wanted are {wanted:.0}: its drive, its encoder and spindle.0.at-speed tell why",
                measured = measured_rpm,
                wanted = self.wanted_rpm
            ),
            None => message!(
                "spindle.not_at_speed",
                "spindle.{spindle}.at-speed does not tell that {wanted:.0} 1/min are reached",
                spindle = self.spindle,
                wanted = self.wanted_rpm
            ),
        }
    }
}

/// Why the network adapter does not send or receive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkFailure {
    /// The interface is down or gone.
    Down,
    /// The transmit queue is full; the frame was not sent.
    QueueFull,
    /// The frame is longer or shorter than the link can carry.
    FrameLength {
        /// Octets of the frame.
        octets: usize,
        /// Octets that the link can carry at most.
        max: usize,
    },
    /// Any other error of the operating system.
    Os {
        /// `errno`.
        errno: i32,
    },
}

impl LinkFailure {
    /// In words.
    pub fn message(self) -> Message {
        match self {
            LinkFailure::Down => message!("link.down", "the interface is down"),
            LinkFailure::QueueFull => message!("link.queue_full", "the transmit queue is full"),
            LinkFailure::FrameLength { octets, max } => message!(
                "link.frame_length",
                "a frame of {octets} octets, the link carries 14 to {max}",
                octets = octets,
                max = max
            ),
            LinkFailure::Os { errno } => message!("link.os", "system error {errno}", errno = errno),
        }
    }
}

/// Another master of the bus on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForeignMaster {
    /// Who was heard: the other master, or a node that answers it; `None`: its frames do not tell.
    pub node: Option<u8>,
    /// MAC of the sender.
    pub mac: [u8; 6],
    /// The master itself was heard, and not only a node that answers it.
    pub is_itself: bool,
}

impl ForeignMaster {
    /// In words.
    pub fn message(self) -> Message {
        let [a, b, c, d, e, g] = self.mac;
        let mac = format!("{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}");
        match (self.node, self.is_itself) {
            (None, _) => message!(
                "bus.foreign_main",
                "another main device is on the wire: {mac}",
                mac = &mac
            ),
            (Some(node), true) => message!(
                "bus.foreign_managing",
                "another managing node is on the wire: {mac}, node id {node}",
                mac = &mac,
                node = node
            ),
            (Some(node), false) => message!(
                "bus.foreign_answered",
                "another managing node is on the wire, perhaps on this PC: node {node} ({mac}) answers one",
                node = node,
                mac = &mac
            ),
        }
    }
}

/// Something that went wrong in a scan of a program in Structured Text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogicError {
    /// What.
    pub wrong: logic::Wrong,
    /// Place in the program, counted from 1.
    pub line: u32,
    pub column: u32,
    /// The outputs of the scan count, and the next one comes.
    pub goes_on: bool,
}

impl LogicError {
    /// In words; `file`: that of the program.
    pub fn message(self, file: &str) -> Message {
        let then = match self.goes_on {
            true => message!("logic.goes_on", "it goes on (on_error)"),
            false => message!(
                "logic.stands",
                "the program stands, its outputs have their safe values; it restarts when you acknowledge"
            ),
        };
        message!(
            "logic.error",
            "{file}:{line}:{column}: {wrong}; {then}",
            file = file,
            line = self.line,
            column = self.column,
            wrong = wrong(self.wrong),
            then = then
        )
    }
}
