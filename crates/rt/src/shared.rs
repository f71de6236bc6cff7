//! What crosses the border between the cycle thread and the rest of the process.
//!
//! In:  orders and programs, through a ring.
//! Out: [`RtStatus`] (latest values), [`Notice`]s and [`Trace`] records, through rings that nobody in real time waits for.

use super::overrides::Overrides;
use super::times::CycleHistograms;
use crate::desk::Desk;
use crate::joint_jog::JogOrder;
use crate::logic::Desk as LogicDesk;
use crate::tool_pockets::ToolPockets;
use crate::waiting::{Waiting, WaitingCell};
use bus::BusEvent;
use config::JOINTS_MAX;
use machine::faults::Fault;
use machine::state::State;
use motion::canon::{AXES, Position};
use motion::element::{Action, Enables};
use motion::rt::jog::Obstruction;
use motion::rt::{Interpolator, SyncReport};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU8, AtomicU32, AtomicU64, Ordering::Relaxed};

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
    state: AtomicU8,
    enables: AtomicU8,
    orders_taken: AtomicU64,
    order_taken_ns: AtomicU64,
    cycles: AtomicU64,
    homed: AtomicU64,
    line: AtomicU32,
    modes: AtomicU32,
    reversing: AtomicBool,
    single_block: AtomicBool,
    optional_stop: AtomicBool,
    velocity_mm_s: AtomicU64,
    position: [AtomicU64; AXES],
    late_max_ns: AtomicU64,
    cycles_skipped: AtomicU64,
    remaining_s: AtomicU64,
    way: AtomicU64,
    elapsed_s: AtomicU64,
    /// Pieces at the beginning of the program's path, above their length (f32).
    lead: AtomicU64,
    /// Where the tools are.
    pub pockets: ToolPockets,
    /// One more than the number of the tool that the last change brought; 0: there was none.
    tool: AtomicU64,
    /// Joint of which the trace tells.
    traced_joint: AtomicU32,
    /// What a program waits for.
    waiting: WaitingCell,
    switched_off: AtomicU64,
    chain_open: AtomicBool,
    jog_barred: AtomicBool,
    /// Not numbers: the machine is not away from a path.
    held_at: [AtomicU64; AXES],
    /// Not numbers: nothing moves along a path.
    piece_end: [AtomicU64; AXES],
    /// How long the parts of cycles took.
    pub times: CycleHistograms,
    /// Cycles of programs, by what they were spent on.
    phases: [AtomicU64; Phase::ALL.len()],
    limits: [AtomicU64; 2],
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
            enables: AtomicU8::new(0),
            state: AtomicU8::new(State::Booting as u8),
            orders_taken: AtomicU64::new(0),
            order_taken_ns: AtomicU64::new(0),
            cycles: AtomicU64::new(0),
            homed: AtomicU64::new(0),
            line: AtomicU32::new(0),
            modes: AtomicU32::new(0),
            reversing: AtomicBool::new(false),
            single_block: AtomicBool::new(false),
            optional_stop: AtomicBool::new(false),
            velocity_mm_s: AtomicU64::new(0),
            position: [const { AtomicU64::new(0) }; AXES],
            late_max_ns: AtomicU64::new(0),
            cycles_skipped: AtomicU64::new(0),
            remaining_s: AtomicU64::new(0),
            way: AtomicU64::new(0),
            elapsed_s: AtomicU64::new(0),
            lead: AtomicU64::new(0),
            pockets: ToolPockets::default(),
            tool: AtomicU64::new(0),
            traced_joint: AtomicU32::new(0),
            waiting: WaitingCell::default(),
            switched_off: AtomicU64::new(0),
            chain_open: AtomicBool::new(false),
            jog_barred: AtomicBool::new(false),
            held_at: [const { AtomicU64::new(f64::NAN.to_bits()) }; AXES],
            piece_end: [const { AtomicU64::new(f64::NAN.to_bits()) }; AXES],
            times: CycleHistograms::default(),
            phases: Default::default(),
            limits: Default::default(),
            places: Default::default(),
        }
    }
}

/// What the cycle thread shows after a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// What the machine is doing.
    pub state: State,
    /// What acts on the move under way from outside.
    pub enables: Enables,
    /// Orders taken so far.
    pub orders_taken: u64,
    /// Cycles so far.
    pub cycles: u64,
    /// Joints that are homed (bit n: joint n).
    pub homed: u64,
    /// Line of the program.
    pub line: u32,
    /// Number of the modes in force there, as [`Source::modes`](motion::canon::Source::modes) says; 0: none has been told.
    pub modes: u32,
    /// Whether the program was last sent back along its path.
    pub reversing: bool,
    /// Whether each block ends at rest.
    pub single_block: bool,
    /// Whether M1 stops.
    pub optional_stop: bool,
    /// Speed on the path, mm/s.
    pub velocity_mm_s: f64,
    /// Commanded axis positions in the machine.
    pub position: Position,
    /// Worst lateness of a cycle, ns.
    pub late_max_ns: u64,
    /// Cycles left out.
    pub cycles_skipped: u64,
    /// Motion still to come as far as it has been planned, s.
    pub remaining_s: f64,
    /// How far the program has come, as [`Element::way`](motion::element::Element::way) says.
    pub way: f64,
    /// Time since the program began, s.
    pub elapsed_s: f64,
    /// What the program waits for.
    pub waiting: Option<Waiting>,
    /// How often a stop, a fault or power-off has switched spindle and coolant off.
    pub switched_off: u64,
    /// The emergency stop chain is open.
    pub chain_open: bool,
    /// A pin keeps jogs from beginning.
    pub jog_barred: bool,
    /// Where the program is held while the machine is elsewhere.
    pub held_at: Option<Position>,
    /// Where the piece of path under way ends.
    pub piece_end: Option<Position>,
    /// Joints whose lower, and whose upper limit switch is closed (bit n: joint n).
    pub limits: [u64; 2],
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
        self.single_block.load(Relaxed)
    }

    /// Shows new values. RT.
    pub fn show(&self, snapshot: &Snapshot) {
        self.enables.store(bits(snapshot.enables), Relaxed);
        self.cycles.store(snapshot.cycles, Relaxed);
        self.homed.store(snapshot.homed, Relaxed);
        self.line.store(snapshot.line, Relaxed);
        self.modes.store(snapshot.modes, Relaxed);
        self.reversing.store(snapshot.reversing, Relaxed);
        self.single_block.store(snapshot.single_block, Relaxed);
        self.optional_stop.store(snapshot.optional_stop, Relaxed);
        self.velocity_mm_s.store(snapshot.velocity_mm_s.to_bits(), Relaxed);
        for (cell, value) in self.position.iter().zip(snapshot.position.0) {
            cell.store(value.to_bits(), Relaxed);
        }
        self.late_max_ns.store(snapshot.late_max_ns, Relaxed);
        self.cycles_skipped.store(snapshot.cycles_skipped, Relaxed);
        self.remaining_s.store(snapshot.remaining_s.to_bits(), Relaxed);
        self.way.store(snapshot.way.to_bits(), Relaxed);
        self.elapsed_s.store(snapshot.elapsed_s.to_bits(), Relaxed);
        self.waiting.set(snapshot.waiting);
        self.switched_off.store(snapshot.switched_off, Relaxed);
        self.chain_open.store(snapshot.chain_open, Relaxed);
        self.jog_barred.store(snapshot.jog_barred, Relaxed);
        for (cells, place) in [(&self.held_at, snapshot.held_at), (&self.piece_end, snapshot.piece_end)] {
            let place = place.unwrap_or(Position([f64::NAN; AXES]));
            for (cell, value) in cells.iter().zip(place.0) {
                cell.store(value.to_bits(), Relaxed);
            }
        }
        for (cell, limit) in self.limits.iter().zip(snapshot.limits) {
            cell.store(limit, Relaxed);
        }
        self.state.store(snapshot.state as u8, Relaxed);
        // Release: who sees an order taken sees the state that it led to.
        self.orders_taken
            .store(snapshot.orders_taken, std::sync::atomic::Ordering::Release);
    }

    pub fn snapshot(&self) -> Snapshot {
        let float = |cell: &AtomicU64| f64::from_bits(cell.load(Relaxed));
        let place = |cells: &[AtomicU64; AXES]| {
            let place = Position(std::array::from_fn(|axis| float(&cells[axis])));
            place.0.iter().all(|value| value.is_finite()).then_some(place)
        };
        let orders_taken = self.orders_taken.load(std::sync::atomic::Ordering::Acquire);
        let shown = State::from_u8(self.state.load(Relaxed)).unwrap_or(State::Down);
        let silenced = self.silenced.load(Relaxed) && shown != State::Down;
        Snapshot {
            orders_taken,
            state: if silenced { State::Silenced } else { shown },
            enables: enables(self.enables.load(Relaxed)),
            cycles: self.cycles.load(Relaxed),
            homed: self.homed.load(Relaxed),
            line: self.line.load(Relaxed),
            modes: self.modes.load(Relaxed),
            reversing: self.reversing.load(Relaxed),
            single_block: self.single_block.load(Relaxed),
            optional_stop: self.optional_stop.load(Relaxed),
            velocity_mm_s: float(&self.velocity_mm_s),
            position: Position(std::array::from_fn(|axis| float(&self.position[axis]))),
            late_max_ns: self.late_max_ns.load(Relaxed),
            cycles_skipped: self.cycles_skipped.load(Relaxed),
            remaining_s: float(&self.remaining_s),
            way: float(&self.way),
            elapsed_s: float(&self.elapsed_s),
            waiting: self.waiting.get(),
            switched_off: self.switched_off.load(Relaxed),
            chain_open: self.chain_open.load(Relaxed),
            jog_barred: self.jog_barred.load(Relaxed),
            held_at: place(&self.held_at),
            piece_end: place(&self.piece_end),
            limits: std::array::from_fn(|end| self.limits[end].load(Relaxed)),
        }
    }
}

/// One bit each, of those that differ from how a program begins: what was never shown is that.
fn bits(enables: Enables) -> u8 {
    let initial = Enables::INITIAL;
    let differ = [
        enables.feed_override != initial.feed_override,
        enables.spindle_override != initial.spindle_override,
        enables.adaptive_feed != initial.adaptive_feed,
        enables.feed_hold != initial.feed_hold,
    ];
    let bits = differ.iter().enumerate();
    bits.fold(0, |word, (bit, differs)| word | u8::from(*differs) << bit)
}

fn enables(bits: u8) -> Enables {
    let initial = Enables::INITIAL;
    let differs = |bit: u8| bits >> bit & 1 == 1;
    Enables {
        feed_override: initial.feed_override ^ differs(0),
        spindle_override: initial.spindle_override ^ differs(1),
        adaptive_feed: initial.adaptive_feed ^ differs(2),
        feed_hold: initial.feed_hold ^ differs(3),
        ..initial
    }
}
