//! What crosses the border between the cycle thread and the rest of the process.
//!
//! In:  orders and programs, through a ring.
//! Out: [`RtStatus`] (latest values), [`Notice`]s and [`Trace`] records, through rings that nobody in real time waits for.

use super::overrides::Overrides;
use super::snapshot::SnapshotCells;
use super::times::CycleHistograms;
use crate::desk::Desk;
use crate::joint_jog::JogOrder;
use crate::logic::Desk as LogicDesk;
use crate::tool_pockets::ToolPockets;
use crate::waiting::Waiting;
use bus::BusEvent;
use config::JOINTS_MAX;
use machine::faults::Fault;
use machine::state::State;
use motion::canon::Position;
use motion::element::Action;
use motion::rt::jog::Obstruction;
use motion::rt::{Interpolator, SyncReport};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU8, AtomicU32, AtomicU64, Ordering::Relaxed};

pub use super::snapshot::Snapshot;

/// The operator's ends of the rings between him and the cycle thread.
pub struct OperatorEndpoints {
    pub commands: rtrb::Producer<Command>,
    pub notices: rtrb::Consumer<TimedNotice>,
    pub trace: rtrb::Consumer<Trace>,
    /// Programs that are over.
    pub finished: rtrb::Consumer<Box<Interpolator>>,
    pub live: Arc<RtStatus>,
    /// Programs in Structured Text.
    pub logic: Arc<LogicDesk>,
}

/// What a hand switches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ByHand {
    /// The first spindle turns at this speed, 1/min, clockwise above 0; 0: it stops.
    Spindle(f64),
    /// Flood coolant.
    Flood(bool),
    /// Mist coolant.
    Mist(bool),
}

/// An order for the cycle thread.
#[derive(Debug)]
pub enum Command {
    /// Switch all drives on.
    Enable,
    /// Home the joints of this set (bit n: joint n).
    Home(u64),
    /// The drive of a joint, which is off, still counts from where it was homed in an earlier session.
    TakeHome {
        joint: usize,
        /// Position at which it counts 0, mm.
        zero_mm: f64,
    },
    /// Move joints by hand; only homed joints of a machine that is ready or jogging.
    Jog(JogOrder),
    /// Switch spindle or coolant where no program moves.
    ByHand(ByHand),
    /// Run what the ring behind this interpolator brings. `mdi`: spindle and coolant stay as its last block leaves them.
    Start { program: Box<Interpolator>, mdi: bool },
    /// The operator has put the tool into the spindle that the program waits for.
    ToolChanged,
    /// Come to rest on the path, keep the program.
    Hold,
    /// Go on, forward: after a hold, or with the next block in single block.
    Resume,
    /// Give up this wait, as if what ends it had come, or its time had run out; nothing if it waits for something else by now.
    Skip(Waiting),
    /// Run back along the path that has been run, at this share of its speed (0 to 1), as far as there is a way back.
    Reverse(f64),
    /// Whether to rest at the end of each block.
    SingleBlock(bool),
    /// Whether M1 stops.
    OptionalStop(bool),
    /// Come to rest on the path and give the program up.
    Stop,
    /// Switch all drives off.
    Disable,
    /// Allow motion again after a fault whose cause is gone.
    Acknowledge,
    /// Emergency stop.
    Estop,
    /// The emergency stop is over, if its chain is closed; switches nothing on.
    EstopReset,
    /// Bring the network down.
    ShutDown,
}

/// Something that the rest of the process should hear of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Notice {
    /// The machine changed its state.
    State(State),
    /// The stop pin was pressed.
    StopPressed,
    /// A stop was taken before its order came from the operator, and something moved.
    StopTaken,
    /// A program or homing was ordered in a state in which neither begins.
    NotBegun,
    /// Something happened on the bus.
    Bus(BusEvent),
    /// A fault; the first one since the last acknowledge names the cause.
    Fault {
        /// What is wrong.
        fault: Fault,
        /// Whether it is the first cause of a stop.
        first: bool,
    },
    /// The program reached a block that moves nothing.
    Action(Action),
    /// Something is in the way of an axis that is jogged.
    Obstructed(Obstruction),
    /// The probe came into contact and has stopped a jog.
    Touched,
    /// The machine does not come back to where the program is held on its path.
    NoWayBack,
    /// In a move in step with the spindle, its override acts up to a share only: the axes cannot follow more.
    SpindleHeld {
        /// Line of the program.
        line: u32,
        /// Share of the programmed speed.
        share: f64,
    },
    /// A move in step with the spindle came to its end.
    InStep {
        /// Line of the program.
        line: u32,
        /// How it went.
        report: SyncReport,
    },
    /// The tool is in the spindle: what M6 or M61 wanted is done.
    ToolChanged {
        /// 0: none.
        tool: u32,
    },
    /// A program in Structured Text says something.
    Logic {
        /// Number of the program in the machine file.
        task: usize,
        /// Number of its text in the program.
        text: u32,
    },
    /// A process has taken, given up or lost an external component.
    External {
        /// By its place in the machine file.
        component: usize,
        /// What has happened.
        change: hal_pins::Change,
        /// Process that says it has it.
        pid: u32,
    },
    /// The program came to its end.
    ProgramEnded,
}

/// What a cycle of a program is spent on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Moves at feed.
    Cut = 0,
    Rapid,
    /// Held, or away from the path.
    Hold,
    /// At rest within the program: a dwell, a tool, a spindle.
    Wait,
}

impl Phase {
    /// All of them, by their numbers.
    pub const ALL: [Phase; 4] = [Phase::Cut, Phase::Rapid, Phase::Hold, Phase::Wait];

    /// As it is written.
    pub const fn name(self) -> &'static str {
        match self {
            Phase::Cut => "cut",
            Phase::Rapid => "rapid",
            Phase::Hold => "hold",
            Phase::Wait => "wait",
        }
    }
}

/// A notice and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedNotice {
    /// Cycle in which it was given.
    pub cycle: u64,
    /// What it is.
    pub notice: Notice,
}

/// One cycle of a program, for reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trace {
    pub cycle: u64,
    /// Commanded axis positions in the machine, mm or degrees.
    pub command: Position,
    /// Actual axis positions in the machine.
    pub actual: Position,
    /// Line of the program.
    pub line: u32,
    /// Whether the move is a rapid one (G0).
    pub rapid: bool,
    /// Greatest following error of all joints, mm.
    pub following_error_mm: f64,
    /// The program has begun to move, and now rests only because nothing more has been planned yet.
    pub starved: bool,
    /// The joint that [`RtStatus::trace_joint`] has chosen.
    pub joint: JointTrace,
}

/// One cycle of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointTrace {
    /// Command that goes to its drive, mm.
    pub command_mm: f64,
    /// What the drive has told, mm.
    pub actual_mm: f64,
    /// As [`Drive::following_error_mm`](super::drives::Drive::following_error_mm) says.
    pub following_error_mm: f64,
    /// What the position loop of the control asks of the amplifier, mm/s or a share of the rated torque; NaN where there is none.
    pub output: f64,
    /// Torque that the drive tells of (6077), 1/1000 of the rated torque; NaN where it is not mapped.
    pub torque: f64,
    /// Whether the drive has answered in this cycle.
    pub fresh: bool,
}

impl JointTrace {
    /// Of a joint that is not there.
    pub const NONE: JointTrace = JointTrace {
        command_mm: 0.0,
        actual_mm: 0.0,
        following_error_mm: 0.0,
        output: f64::NAN,
        torque: f64::NAN,
        fresh: false,
    };
}

/// What brings the machine to rest, and waits for no other thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtOnce {
    /// As [`Command::Hold`].
    Hold,
    /// As [`Command::Stop`].
    Stop,
    /// As [`Command::Estop`].
    Estop,
}

/// Latest values, readable by any thread at any time; each value is whole, the values are not of one instant.
#[derive(Debug)]
pub struct RtStatus {
    /// What the operator has turned overrides to: the one thing here that anyone may set.
    pub overrides: Overrides,
    /// Switches and counters that the operator's loop keeps.
    pub desk: Desk,
    /// Shown in place of every state of the cycle thread, which may be unable to show one.
    silenced: AtomicBool,
    /// What was ordered and acts at once, and is not taken yet: bit [`AtOnce`].
    at_once: AtomicU8,
    /// What the cycle thread shows after each cycle.
    latest: SnapshotCells,
    order_taken_ns: AtomicU64,
    /// Pieces at the beginning of the program's path, above their length (f32).
    lead: AtomicU64,
    /// Where the tools are.
    pub pockets: ToolPockets,
    /// One more than the number of the tool that the last change brought; 0: there was none.
    tool: AtomicU64,
    /// Joint of which the trace tells.
    traced_joint: AtomicU32,
    /// How long the parts of cycles took.
    pub times: CycleHistograms,
    /// Cycles of programs, by what they were spent on.
    phases: [AtomicU64; Phase::ALL.len()],
    places: [PlaceCell; JOINTS_MAX],
}

/// Where a drive is.
#[derive(Debug, Default)]
struct PlaceCell {
    online: AtomicBool,
    counts: AtomicI64,
    zero_mm: AtomicU64,
}

/// Where a drive is, or was when it was last on line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivePlace {
    /// It is read in every cycle.
    pub online: bool,
    /// What it counts, over more than 32 bits where it has come so far.
    pub counts: i64,
    /// Position at which it counts 0, mm.
    pub zero_mm: f64,
}

impl Default for RtStatus {
    fn default() -> RtStatus {
        RtStatus::new(Overrides::default())
    }
}

impl RtStatus {
    /// Nothing has been shown yet.
    pub fn new(overrides: Overrides) -> RtStatus {
        RtStatus {
            overrides,
            desk: Desk::default(),
            silenced: AtomicBool::new(false),
            at_once: AtomicU8::new(0),
            latest: SnapshotCells::new(),
            order_taken_ns: AtomicU64::new(0),
            lead: AtomicU64::new(0),
            pockets: ToolPockets::default(),
            tool: AtomicU64::new(0),
            traced_joint: AtomicU32::new(0),
            times: CycleHistograms::default(),
            phases: Default::default(),
            places: Default::default(),
        }
    }
}

impl RtStatus {
    /// So many pieces of the path of the program have been planned, and are so long, mm; of the first ones only. Not of real time.
    pub fn set_lead(&self, (pieces, length): (u32, f64)) {
        let length = (length as f32).to_bits();
        self.lead.store(u64::from(pieces) << 32 | u64::from(length), Relaxed);
    }

    /// What was set last.
    pub fn lead(&self) -> (u32, f64) {
        let word = self.lead.load(Relaxed);
        ((word >> 32) as u32, f64::from(f32::from_bits(word as u32)))
    }

    /// From now on the trace of a program tells of this joint. Not of real time.
    pub fn trace_joint(&self, joint: usize) {
        self.traced_joint.store(joint as u32, Relaxed);
    }

    /// The joint of which the trace tells. RT.
    pub fn traced_joint(&self) -> usize {
        self.traced_joint.load(Relaxed) as usize
    }

    /// Orders what brings the machine to rest, from any thread: the next cycle takes it, whatever other threads do.
    pub fn order(&self, what: AtOnce) {
        self.at_once.fetch_or(1 << what as u8, Relaxed);
    }

    /// What was so ordered since the last call: whether it was, by [`AtOnce`]. RT.
    pub fn take_at_once(&self) -> [bool; 3] {
        let bits = match self.at_once.load(Relaxed) {
            0 => 0,
            _ => self.at_once.swap(0, Relaxed),
        };
        [AtOnce::Hold, AtOnce::Stop, AtOnce::Estop].map(|what| bits >> what as u8 & 1 == 1)
    }

    /// The spindle holds this tool from now on. RT.
    pub fn set_tool(&self, tool: u32) {
        self.pockets.change(tool);
        self.tool.store(u64::from(tool) + 1, Relaxed);
    }

    /// The tool that the last change brought, 0: none; `None`: there was no change since the start.
    pub fn tool(&self) -> Option<u32> {
        let number = self.tool.load(Relaxed).checked_sub(1)?;
        u32::try_from(number).ok()
    }

    /// An order was taken now, ns of the monotonic clock. RT.
    pub fn show_order(&self, now_ns: u64) {
        self.order_taken_ns.store(now_ns, Relaxed);
    }

    /// When the last order was taken, ns of the monotonic clock; `None`: there was none.
    pub fn order_taken_ns(&self) -> Option<u64> {
        Some(self.order_taken_ns.load(Relaxed)).filter(|ns| *ns > 0)
    }

    /// Where the drive of a joint is; `None`: it is off line. RT.
    pub fn show_place(&self, joint: usize, place: Option<(i64, f64)>) {
        let Some(cell) = self.places.get(joint) else {
            return;
        };
        cell.online.store(place.is_some(), Relaxed);
        if let Some((counts, zero_mm)) = place {
            cell.counts.store(counts, Relaxed);
            cell.zero_mm.store(zero_mm.to_bits(), Relaxed);
        }
    }

    /// Where the drive of a joint is. What it counts and what that means belong together where it rests.
    pub fn place(&self, joint: usize) -> Option<DrivePlace> {
        let cell = self.places.get(joint)?;
        Some(DrivePlace {
            online: cell.online.load(Relaxed),
            counts: cell.counts.load(Relaxed),
            zero_mm: f64::from_bits(cell.zero_mm.load(Relaxed)),
        })
    }

    /// Another cycle of a program went to this. RT.
    pub fn count_phase(&self, phase: Phase) {
        let count = &self.phases[phase as usize];
        // One thread counts.
        count.store(count.load(Relaxed) + 1, Relaxed);
    }

    /// Cycles of programs that went to this, since the start.
    pub fn phase(&self, phase: Phase) -> u64 {
        self.phases[phase as usize].load(Relaxed)
    }

    /// The cycle thread hung and may send nothing any more: from now on the state is [`State::Silenced`].
    pub fn show_silenced(&self) {
        self.silenced.store(true, Relaxed);
    }

    /// Whether each block ends at rest: what is planned from now on is to end so.
    pub fn single_block(&self) -> bool {
        self.latest.single_block()
    }

    /// Shows new values. RT.
    pub fn show(&self, snapshot: &Snapshot) {
        self.latest.show(snapshot);
    }

    /// The latest values.
    pub fn snapshot(&self) -> Snapshot {
        let shown = self.latest.read();
        let silenced = self.silenced.load(Relaxed) && shown.state != State::Down;
        Snapshot {
            state: if silenced { State::Silenced } else { shown.state },
            ..shown
        }
    }
}
