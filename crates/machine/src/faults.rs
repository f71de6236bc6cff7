//! What a fault does: the one table.
//!
//! In:  a fault, from wherever it was seen.
//! Out: the reaction of the whole machine, and a sentence for the operator.
//!
//! What is ridden out by itself is no fault: answers lost up to the limit are counted by the managing node, cycles that
//! begin late by the cycle thread.

pub use super::fault_causes::{ForeignMaster, LinkFailure, LogicError, OrientFailure, SpeedNotReached};
use super::fault_causes::{drive, homing, in_step};
use super::overruns::CYCLES;
use cia402::axis::AxisFault;
use config::NodeIndex;
use motion::rt::homing::HomingFailure;
use motion::rt::{Order, SyncFault};
pub use protocol::Reaction;
use protocol::{Message, message};

/// What is said of a control whose cycle thread hung, by what the machine has: a network, joints with step pulses. Without either,
/// nobody knows what leads the machine.
pub fn silenced(network: bool, steps: bool) -> Message {
    match (network, steps) {
        (true, false) => message!(
            "control.silenced_network",
            "the network is silenced, because the cycle thread hung: drives stop by themselves for want of frames; this control ends \
             and has to be restarted"
        ),
        (false, true) => message!(
            "control.silenced_steps",
            "step pulses have ended, because the cycle thread hung: motors stand where the last cycle led them; this control ends and \
             has to be restarted"
        ),
        (true, true) => message!(
            "control.silenced_network_and_steps",
            "network and step pulses are silenced, because the cycle thread hung: drives stop by themselves for want of frames; motors \
             stand where the last cycle led them; this control ends and has to be restarted"
        ),
        (false, false) => message!(
            "control.silenced",
            "the control is silenced, because its cycle thread hung: nothing leads the machine any more, which stops by itself; this \
             control ends and has to be restarted"
        ),
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

/// The same with its place in a program, if it was in one.
fn in_line(what: Message, line: u32) -> Message {
    match line {
        0 => what,
        line => message!("fault.in_line", "{what}: line {line}", what = what, line = line),
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

    /// What the operator is told; `node`, `joint` and `external` name those of the machine file, `logic` a program, or says a text of it.
    pub fn message(
        &self,
        node: impl Fn(NodeIndex) -> Message,
        joint: impl Fn(usize) -> Message,
        logic: impl Fn(usize, Option<u32>) -> String,
        external: impl Fn(usize) -> String,
    ) -> Message {
        let what = self.sentence(logic, external);
        match self.joint().map(joint).or_else(|| self.node().map(node)) {
            Some(place) => message!("fault.at", "{place}: {what}", place = place, what = what),
            None => what,
        }
    }

    /// The same without the joint or the node that it is about.
    fn sentence(&self, logic: impl Fn(usize, Option<u32>) -> String, external: impl Fn(usize) -> String) -> Message {
        let of_spindle = |what: Message| message!("fault.spindle", "spindle: {what}", what = what);
        match *self {
            Fault::NodeLost { .. } => message!("fault.node_lost", "lost, it does not answer any more"),
            Fault::Drive { fault, .. } => drive(fault),
            Fault::DriveWarning { .. } => {
                message!(
                    "fault.drive_warning",
                    "the drive warns (bit 7 of its statusword): look at its display"
                )
            }
            Fault::FollowingError { error_mm, limit_mm, .. } => message!(
                "fault.following_error",
                "following error {error:.3} mm above {limit:.3} mm",
                error = error_mm,
                limit = limit_mm
            ),
            Fault::Homing { failure, .. } => message!("fault.homing", "not homed: {why}", why = homing(failure)),
            Fault::SoftLimit { position_mm, line, .. } => in_line(
                message!(
                    "fault.soft_limit",
                    "command {position:.3} mm beyond its travel",
                    position = position_mm
                ),
                line,
            ),
            Fault::IllegalCommand { line, .. } => in_line(
                message!(
                    "fault.illegal_command",
                    "command that is NaN or far from where it stands: a defect of the planner"
                ),
                line,
            ),
            Fault::LimitExceeded {
                order,
                value,
                limit,
                line,
                ..
            } => in_line(limit_exceeded(order, value, limit), line),
            Fault::OutOfStep { fault } => of_spindle(in_step(fault)),
            Fault::SpindleDrive { fault } => of_spindle(drive(fault)),
            Fault::SpindleLate { late } => of_spindle(late.message()),
            Fault::SpindleOrient { failure } => of_spindle(failure.message()),
            Fault::CountsLost { counts, .. } => of_spindle(counts_lost(counts)),
            Fault::InputRange { object, raw, limit, .. } => input_range(object, raw, limit),
            Fault::CyclesSkipped { cycles } => {
                message!("fault.cycles_skipped", "{cycles} cycles left out", cycles = cycles)
            }
            Fault::ManyOverruns { cycles } => message!(
                "fault.many_overruns",
                "{cycles} of the last {of} cycles were skipped: `isocnc doctor` says what keeps this PC from real time",
                cycles = cycles,
                of = CYCLES
            ),
            Fault::TooManyOverruns { cycles } => message!(
                "fault.too_many_overruns",
                "{cycles} of the last {of} cycles were skipped, more than rt.overruns_stop tolerates: `isocnc doctor` says what keeps \
                 this PC from real time",
                cycles = cycles,
                of = CYCLES
            ),
            Fault::CycleHung => silenced(true, false),
            Fault::PinsLost => message!(
                "fault.pins_lost",
                "the file of the pins was cut short by another process: pins are lost; end this control and start it again"
            ),
            Fault::ExternalLost {
                component,
                cut_short: true,
                ..
            } => message!(
                "fault.external_cut_short",
                "external component {name}: its file was cut short by another process; end this control and start it again; its \
                 outputs have their safe values",
                name = external(component)
            ),
            Fault::ExternalLost {
                component,
                cut_short: false,
                ..
            } => message!(
                "fault.external_lost",
                "external component {name}: its process does not renew its heartbeat: it has died or hangs; its outputs have their \
                 safe values",
                name = external(component)
            ),
            Fault::EmergencyStop { cause } => cause.message(),
            Fault::LimitSwitch { above: true, .. } => message!(
                "fault.upper_limit_switch",
                "its upper limit switch has closed; it can be jogged the other way"
            ),
            Fault::LimitSwitch { above: false, .. } => message!(
                "fault.lower_limit_switch",
                "its lower limit switch has closed; it can be jogged the other way"
            ),
            Fault::MainsLost => message!("fault.mains_lost", "the mains have failed (iocontrol.0.mains-ok)"),
            Fault::ForeignMaster { sign } => {
                message!(
                    "fault.foreign_master",
                    "{who}; disconnect it or end it",
                    who = sign.message()
                )
            }
            Fault::LinkFailed { error } => link_failed(error),
            Fault::LogicError { task, error } => error.message(&logic(task, None)),
            Fault::LogicLate { task, scans } => message!(
                "fault.logic_late",
                "{file}: {scans} scans in a row were not over when the next one was due; the program stands, its outputs have their \
                 safe values; it restarts when you acknowledge",
                file = logic(task, None),
                scans = scans
            ),
            Fault::LogicAlarm { task, text } => logic(task, Some(text)).into(),
        }
    }
}

impl EstopCause {
    fn message(self) -> Message {
        match self {
            EstopCause::Order => message!("estop.order", "emergency stop by order"),
            EstopCause::Chain => message!(
                "estop.chain",
                "emergency stop: the chain is open (iocontrol.0.emc-enable-in)"
            ),
            EstopCause::Unwired => message!(
                "estop.unwired",
                "emergency stop: a net that the machine file calls \"unwired\" keeps the chain open; `isocnc check` names it"
            ),
            EstopCause::Sto { .. } => message!(
                "estop.sto",
                "emergency stop: the safety circuit (STO) of its drive is open"
            ),
        }
    }
}

/// The network adapter does not send or receive.
pub fn link_failed(error: LinkFailure) -> Message {
    message!("link.failed", "network adapter: {why}", why = error.message())
}

fn limit_exceeded(order: Order, value: f64, limit: f64) -> Message {
    match order {
        Order::Velocity => message!(
            "fault.velocity_exceeded",
            "commanded velocity {value:.1} mm/s above its limit, {limit:.1} mm/s: a defect of the planner",
            value = value,
            limit = limit
        ),
        Order::Acceleration => message!(
            "fault.acceleration_exceeded",
            "commanded acceleration {value:.1} mm/s² above its limit, {limit:.1} mm/s²: a defect of the planner",
            value = value,
            limit = limit
        ),
        Order::Jerk => message!(
            "fault.jerk_exceeded",
            "commanded jerk {value:.1} mm/s³ above its limit, {limit:.1} mm/s³: a defect of the planner",
            value = value,
            limit = limit
        ),
    }
}

fn counts_lost(counts: i64) -> Message {
    let lost = counts.unsigned_abs();
    match counts < 0 {
        true => message!(
            "fault.counts_less",
            "its encoder counted {counts} less than whole turns between two indexes: look at its cable, its shield and counts_per_turn",
            counts = lost
        ),
        false => message!(
            "fault.counts_more",
            "its encoder counted {counts} more than whole turns between two indexes: look at its cable, its shield and counts_per_turn",
            counts = lost
        ),
    }
}

fn input_range((index, sub): (u16, u8), raw: i64, limit: i64) -> Message {
    let object = format!("0x{index:04X}:{sub}");
    match raw < limit {
        true => message!(
            "fault.input_below",
            "analog input {object} reads {raw}, below raw_min, {limit}: look for an open wire or a sensor without power",
            object = object.as_str(),
            raw = raw,
            limit = limit
        ),
        false => message!(
            "fault.input_above",
            "analog input {object} reads {raw}, above raw_max, {limit}: look for a short circuit",
            object = object.as_str(),
            raw = raw,
            limit = limit
        ),
    }
}
