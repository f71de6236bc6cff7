//! What a fault does: the one table.
//!
//! In:  a fault, from wherever it was seen.
//! Out: the reaction of the whole machine, and a sentence for the operator.
//!
//! What is ridden out by itself is no fault: answers lost up to the limit are counted by the managing node, cycles that
//! begin late by the cycle thread.

pub use super::fault_causes::{ForeignMaster, LinkFailure, LogicError, OrientFailure, SpeedNotReached};
use super::overruns::CYCLES;
use cia402::axis::AxisFault;
use config::NodeIndex;
use motion::rt::homing::HomingFailure;
use motion::rt::{Order, SyncFault};
pub use protocol::Reaction;

/// What every command says of a control whose cycle thread hung, where it does not know what leads the machine.
pub const SILENCED: &str = "the control is silenced, because its cycle thread hung: nothing leads the machine any more, which stops by \
                            itself; this control ends and has to be restarted";

/// The same, by what the machine has: a network, joints with step pulses.
pub const fn silenced(network: bool, steps: bool) -> &'static str {
    match (network, steps) {
        (true, false) => {
            "the network is silenced, because the cycle thread hung: drives stop by themselves for want of frames; this control ends \
             and has to be restarted"
        }
        (false, true) => {
            "step pulses have ended, because the cycle thread hung: motors stand where the last cycle led them; this control ends and \
             has to be restarted"
        }
        (true, true) => {
            "network and step pulses are silenced, because the cycle thread hung: drives stop by themselves for want of frames; motors \
             stand where the last cycle led them; this control ends and has to be restarted"
        }
        (false, false) => SILENCED,
    }
}

/// Something that is wrong. Joints and nodes by their place in the machine file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// A mandatory node did not answer more polls in a row than are ridden out, or left the network.
    NodeLost { node: NodeIndex },
    /// A drive is in fault, refuses a step or does not follow.
    Drive {
        joint: usize,
        /// What the drive supervisor saw.
        fault: AxisFault,
    },
    /// A drive warns (bit 7 of the statusword): it goes on now and says that it may not for long.
    DriveWarning { joint: usize },
    /// Distance between command and actual position above the limit.
    FollowingError {
        joint: usize,
        /// Distance, mm.
        error_mm: f64,
        /// Limit, mm.
        limit_mm: f64,
        /// The control closes its position loop: the loop that would bring it to rest on its path is the one that has failed.
        led: bool,
    },
    /// The control could not home a joint, and has come to rest.
    Homing { joint: usize, failure: HomingFailure },
    /// A command that leads beyond the travel of a joint, which was not sent; the planner should have refused it.
    SoftLimit {
        joint: usize,
        /// Where the joint would have come to rest, mm.
        position_mm: f64,
        /// Line of the program; 0: none.
        line: u32,
    },
    /// A command that is NaN, which was not sent, or a program that begins where the joint does not stand; a defect of the planner.
    IllegalCommand {
        joint: usize,
        /// Line of the program; 0: none.
        line: u32,
    },
    /// A command more than a hundredth above a limit of the joint; one above velocity or acceleration was not sent. A defect of the
    /// planner.
    LimitExceeded {
        joint: usize,
        /// Line of the program; 0: none.
        line: u32,
        /// Velocity, acceleration or jerk.
        order: Order,
        /// Commanded, in mm and s.
        value: f64,
        /// Limit, in mm and s.
        limit: f64,
    },
    /// A move in step with the spindle was given up, and has come to rest.
    OutOfStep { fault: SyncFault },
    /// The drive of the spindle is in fault, refuses a step or does not follow.
    SpindleDrive {
        /// What the drive supervisor saw.
        fault: AxisFault,
    },
    /// The spindle did not get to its speed in time.
    SpindleLate {
        /// How far it came.
        late: SpeedNotReached,
    },
    /// The spindle did not get to the angle of M19.
    SpindleOrient {
        /// Why.
        failure: OrientFailure,
    },
    /// An index of the spindle's encoder came a number of counts away from where whole turns are.
    CountsLost {
        /// Counts, below 0 where some were lost.
        counts: i64,
        /// Whether a move in step with the spindle is under way.
        in_step: bool,
    },
    /// An analog input reads what its channel says it never does: `raw_min`, `raw_max`.
    InputRange {
        /// Index into the nodes of the machine file.
        node: usize,
        /// The object: index and sub-index.
        object: (u16, u8),
        /// What it reads.
        raw: i64,
        /// The limit that it is beyond.
        limit: i64,
    },
    /// Whole cycles had to be left out.
    CyclesSkipped {
        /// How many in a row.
        cycles: u64,
    },
    /// More of the last thousand cycles were skipped than one should have (`rt.overruns_warn`).
    ManyOverruns { cycles: u64 },
    /// More of the last thousand cycles were skipped than is borne (`rt.overruns_stop`).
    TooManyOverruns { cycles: u64 },
    /// The time-out thread took the cycle thread for hung and forbade further cycles.
    CycleHung,
    /// The file of the pins was cut short by another process.
    PinsLost,
    /// Another managing node is on the wire.
    ForeignMaster {
        /// Who was heard.
        sign: ForeignMaster,
    },
    /// The emergency stop chain is open, or somebody ordered an emergency stop.
    EmergencyStop {
        /// Which of them came first.
        cause: EstopCause,
    },
    /// A limit switch closed; `above`: the one at the upper end.
    LimitSwitch { joint: usize, above: bool },
    /// The process of an external component has not renewed its heartbeat in time, or its file was cut short.
    ExternalLost {
        /// By its place in the machine file.
        component: usize,
        /// The file was cut short by another process.
        cut_short: bool,
        /// The machine file wants the machine to stop (`on_loss`).
        stops: bool,
    },
    /// The mains have failed: what energy is left is for a stop.
    MainsLost,
    /// The network adapter does not send or receive.
    LinkFailed { error: LinkFailure },
    /// Something went wrong in a scan of a program in Structured Text.
    LogicError {
        /// Number of the program in the machine file.
        task: usize,
        /// What, and where.
        error: LogicError,
    },
    /// Scans of a program in a row were not over when the next one was due, as many as its `overruns_stop`.
    LogicLate { task: usize, scans: u32 },
    /// A program gives an alarm.
    LogicAlarm {
        task: usize,
        /// Number of its text in the program.
        text: u32,
    },
}

/// What an emergency stop comes of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EstopCause {
    /// Somebody ordered it.
    Order,
    /// The pin of the chain is false.
    Chain,
    /// A net of the machine file still lacks its source.
    Unwired,
    /// A drive says that its safety circuit is open.
    Sto { joint: usize },
}

/// Code of the alarm of a control whose time-out thread hung.
pub const UNWATCHED_CODE: &str = "C-405";
/// The same of a program that turned out to be wrong.
pub const PROGRAM_CODE: &str = "P-601";

/// Where in a program, if it was in one.
fn in_line(line: u32) -> String {
    match line {
        0 => String::new(),
        line => format!(": line {line}"),
    }
}

impl Fault {
    /// The only place that says what a fault does to the machine.
    pub fn reaction(&self) -> Reaction {
        match self {
            // A full queue loses one frame, which shows as an answer lost.
            Fault::CyclesSkipped { .. }
            | Fault::LinkFailed {
                error: LinkFailure::QueueFull,
            } => Reaction::Count,
            // Turns count from the new index on, as the next thread does.
            Fault::ManyOverruns { .. }
            | Fault::CountsLost { in_step: false, .. }
            | Fault::InputRange { .. }
            | Fault::ExternalLost { stops: false, .. }
            | Fault::LogicError {
                error: LogicError { goes_on: true, .. },
                ..
            } => Reaction::Warn,
            Fault::NodeLost { .. }
            | Fault::Drive { .. }
            | Fault::DriveWarning { .. }
            | Fault::FollowingError { led: false, .. }
            | Fault::Homing { .. }
            | Fault::SoftLimit { .. }
            | Fault::IllegalCommand { .. }
            | Fault::LimitExceeded { .. }
            | Fault::OutOfStep { .. }
            | Fault::SpindleDrive { .. }
            | Fault::SpindleLate { .. }
            | Fault::SpindleOrient { .. }
            | Fault::CountsLost { in_step: true, .. }
            | Fault::TooManyOverruns { .. }
            | Fault::PinsLost
            | Fault::ExternalLost { stops: true, .. }
            | Fault::LimitSwitch { .. }
            | Fault::MainsLost
            | Fault::LogicError { .. }
            | Fault::LogicLate { .. }
            | Fault::LogicAlarm { .. }
            | Fault::ForeignMaster { .. }
            | Fault::LinkFailed {
                error: LinkFailure::Down | LinkFailure::FrameLength { .. } | LinkFailure::Os { .. },
            } => Reaction::ControlledStop,
            Fault::FollowingError { led: true, .. } => Reaction::QuickStop,
            Fault::EmergencyStop { .. } => Reaction::EmergencyStop,
            Fault::CycleHung => Reaction::Silence,
        }
    }

    /// A code that stays the same from version to version: J of a joint, N of the network, S of a spindle, C of the control, E of the
    /// emergency stop, I of inputs, L of programs in Structured Text.
    pub const fn code(&self) -> &'static str {
        match self {
            Fault::Drive { .. } => "J-201",
            Fault::DriveWarning { .. } => "J-202",
            Fault::FollowingError { .. } => "J-203",
            Fault::Homing { .. } => "J-204",
            Fault::SoftLimit { .. } => "J-205",
            Fault::LimitSwitch { .. } => "J-206",
            Fault::IllegalCommand { .. } => "J-207",
            Fault::LimitExceeded { .. } => "J-208",
            Fault::NodeLost { .. } => "N-101",
            Fault::LinkFailed { .. } => "N-102",
            Fault::ForeignMaster { .. } => "N-103",
            Fault::OutOfStep { .. } => "S-301",
            Fault::SpindleLate { .. } => "S-302",
            Fault::SpindleOrient { .. } => "S-303",
            Fault::CountsLost { .. } => "S-304",
            Fault::SpindleDrive { .. } => "S-305",
            Fault::InputRange { .. } => "I-701",
            Fault::CyclesSkipped { .. } => "C-401",
            Fault::ManyOverruns { .. } => "C-402",
            Fault::TooManyOverruns { .. } => "C-403",
            Fault::CycleHung => "C-404",
            Fault::PinsLost => "C-406",
            Fault::ExternalLost { .. } => "C-407",
            Fault::EmergencyStop { .. } => "E-501",
            Fault::MainsLost => "E-502",
            Fault::LogicError { .. } => "L-801",
            Fault::LogicLate { .. } => "L-802",
            Fault::LogicAlarm { .. } => "L-803",
        }
    }

    /// The joint that it is about.
    pub const fn joint(&self) -> Option<usize> {
        match *self {
            Fault::Drive { joint, .. }
            | Fault::DriveWarning { joint }
            | Fault::FollowingError { joint, .. }
            | Fault::Homing { joint, .. }
            | Fault::SoftLimit { joint, .. }
            | Fault::LimitSwitch { joint, .. }
            | Fault::IllegalCommand { joint, .. }
            | Fault::LimitExceeded { joint, .. }
            | Fault::EmergencyStop {
                cause: EstopCause::Sto { joint },
            } => Some(joint),
            _ => None,
        }
    }

    /// The node that it is about, where that is not the one of a joint.
    pub const fn node(&self) -> Option<NodeIndex> {
        match *self {
            Fault::NodeLost { node } | Fault::InputRange { node, .. } => Some(node),
            _ => None,
        }
    }

    /// The input that it is about: its node, and its object.
    pub const fn input(&self) -> Option<(NodeIndex, (u16, u8))> {
        match *self {
            Fault::InputRange { node, object, .. } => Some((node, object)),
            _ => None,
        }
    }

    /// The external component that it is about.
    pub const fn external(&self) -> Option<usize> {
        match *self {
            Fault::ExternalLost { component, .. } => Some(component),
            _ => None,
        }
    }

    /// Whether boot-up goes on in spite of it: the time limit of boot-up is the operator's, and what stays wrong shows again
    /// behind it. Another managing node is no such thing: it is told of once and may only fall silent by itself.
    pub fn is_usual_in_boot(&self) -> bool {
        // A control that has just begun may miss cycles until everything of it has run once.
        matches!(
            self,
            Fault::NodeLost { .. } | Fault::LinkFailed { .. } | Fault::TooManyOverruns { .. }
        )
    }

    /// A sentence for the operator; `node`, `joint` and `external` name those of the machine file, `logic` a program, or says a text of it.
    pub fn text(
        &self,
        node: impl Fn(NodeIndex) -> String,
        joint: impl Fn(usize) -> String,
        logic: impl Fn(usize, Option<u32>) -> String,
        external: impl Fn(usize) -> String,
    ) -> String {
        let sentence = self.sentence(logic, external);
        match self.joint().map(joint).or_else(|| self.node().map(node)) {
            Some(place) => format!("{place}: {sentence}"),
            None => sentence,
        }
    }

    /// The same without the joint or the node that it is about.
    fn sentence(&self, logic: impl Fn(usize, Option<u32>) -> String, external: impl Fn(usize) -> String) -> String {
        match *self {
            Fault::NodeLost { .. } => "lost, it does not answer any more".into(),
            Fault::Drive { fault, .. } => fault.to_string(),
            Fault::DriveWarning { .. } => "the drive warns (bit 7 of its statusword): look at its display".into(),
            Fault::FollowingError { error_mm, limit_mm, .. } => {
                format!("following error {error_mm:.3} mm above {limit_mm:.3} mm")
            }
            Fault::Homing { failure, .. } => format!("not homed: {}", failure.words()),
            Fault::SoftLimit { position_mm, line, .. } => {
                format!("command {position_mm:.3} mm beyond its travel{}", in_line(line))
            }
            Fault::IllegalCommand { line, .. } => format!(
                "command that is NaN or far from where it stands: a defect of the planner{}",
                in_line(line)
            ),
            Fault::LimitExceeded {
                order,
                value,
                limit,
                line,
                ..
            } => {
                let (unit, in_line) = (order.unit(), in_line(line));
                format!("commanded {order} {value:.1} {unit} above its limit, {limit:.1} {unit}: a defect of the planner{in_line}")
            }
            Fault::OutOfStep { fault } => format!("spindle: {fault}"),
            Fault::SpindleDrive { fault } => format!("spindle: {fault}"),
            Fault::SpindleLate { late } => format!("spindle: {late}"),
            Fault::SpindleOrient { failure } => format!("spindle: {failure}"),
            Fault::CountsLost { counts, .. } => format!(
                "spindle: its encoder counted {} {} than whole turns between two indexes: look at its cable, its shield and \
                 counts_per_turn",
                counts.unsigned_abs(),
                if counts < 0 { "less" } else { "more" }
            ),
            Fault::InputRange {
                object: (index, sub),
                raw,
                limit,
                ..
            } => {
                let (beyond, look_for) = match raw < limit {
                    true => ("below raw_min,", "an open wire or a sensor without power"),
                    false => ("above raw_max,", "a short circuit"),
                };
                format!("analog input 0x{index:04X}:{sub} reads {raw}, {beyond} {limit}: look for {look_for}")
            }
            Fault::CyclesSkipped { cycles } => format!("{cycles} cycles left out"),
            Fault::ManyOverruns { cycles } => format!(
                "{cycles} of the last {CYCLES} cycles were skipped: `isocnc doctor` says what keeps this PC from real time"
            ),
            Fault::TooManyOverruns { cycles } => format!(
                "{cycles} of the last {CYCLES} cycles were skipped, more than rt.overruns_stop tolerates: `isocnc doctor` says what \
                 keeps this PC from real time"
            ),
            Fault::CycleHung => silenced(true, false).into(),
            Fault::PinsLost => {
                "the file of the pins was cut short by another process: pins are lost; end this control and start it again".into()
            }
            Fault::ExternalLost {
                component, cut_short, ..
            } => {
                let name = external(component);
                let why = match cut_short {
                    true => "its file was cut short by another process; end this control and start it again",
                    false => "its process does not renew its heartbeat: it has died or hangs",
                };
                format!("external component {name}: {why}; its outputs have their safe values")
            }
            Fault::EmergencyStop { cause } => match cause {
                EstopCause::Order => "emergency stop by order",
                EstopCause::Chain => "emergency stop: the chain is open (iocontrol.0.emc-enable-in)",
                EstopCause::Unwired => {
                    "emergency stop: a net that the machine file calls \"unwired\" keeps the chain open; `isocnc check` names it"
                }
                EstopCause::Sto { .. } => "emergency stop: the safety circuit (STO) of its drive is open",
            }
            .into(),
            Fault::LimitSwitch { above, .. } => format!(
                "its {} limit switch has closed; it can be jogged the other way",
                if above { "upper" } else { "lower" }
            ),
            Fault::MainsLost => "the mains have failed (iocontrol.0.mains-ok)".into(),
            Fault::ForeignMaster { sign } => format!("{sign}; disconnect it or end it"),
            Fault::LinkFailed { error } => format!("network adapter: {error}"),
            Fault::LogicError { task, error } => format!("{}:{error}", logic(task, None)),
            Fault::LogicLate { task, scans } => format!(
                "{}: {scans} scans in a row were not over when the next one was due; the program stands, its outputs have their safe \
                 values; it restarts when you acknowledge",
                logic(task, None)
            ),
            Fault::LogicAlarm { task, text } => logic(task, Some(text)),
        }
    }
}
