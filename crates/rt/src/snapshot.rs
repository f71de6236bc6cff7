//! The latest values of a cycle, which any thread may read.
//!
//! In:  what the cycle thread shows after a cycle. Out: the same, each value whole, all of them not of one instant.

use crate::waiting::{Waiting, WaitingCell};
use machine::state::State;
use motion::canon::{AXES, Position};
use motion::element::Enables;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering::Relaxed};

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
    /// The spindle is on.
    pub spindle_on: bool,
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

/// A [`Snapshot`] in shared cells.
#[derive(Debug, Default)]
pub(super) struct SnapshotCells {
    state: AtomicU8,
    enables: AtomicU8,
    orders_taken: AtomicU64,
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
    waiting: WaitingCell,
    switched_off: AtomicU64,
    spindle_on: AtomicBool,
    chain_open: AtomicBool,
    jog_barred: AtomicBool,
    /// Not numbers: the machine is not away from a path.
    held_at: [AtomicU64; AXES],
    /// Not numbers: nothing moves along a path.
    piece_end: [AtomicU64; AXES],
    limits: [AtomicU64; 2],
}

impl SnapshotCells {
    /// Nothing has been shown yet.
    pub(super) fn new() -> SnapshotCells {
        SnapshotCells {
            state: AtomicU8::new(State::Booting as u8),
            held_at: [const { AtomicU64::new(f64::NAN.to_bits()) }; AXES],
            piece_end: [const { AtomicU64::new(f64::NAN.to_bits()) }; AXES],
            ..SnapshotCells::default()
        }
    }

    pub(super) fn single_block(&self) -> bool {
        self.single_block.load(Relaxed)
    }

    /// RT.
    pub(super) fn show(&self, snapshot: &Snapshot) {
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
        self.spindle_on.store(snapshot.spindle_on, Relaxed);
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

    pub(super) fn read(&self) -> Snapshot {
        let float = |cell: &AtomicU64| f64::from_bits(cell.load(Relaxed));
        let place = |cells: &[AtomicU64; AXES]| {
            let place = Position(std::array::from_fn(|axis| float(&cells[axis])));
            place.0.iter().all(|value| value.is_finite()).then_some(place)
        };
        let orders_taken = self.orders_taken.load(std::sync::atomic::Ordering::Acquire);
        Snapshot {
            orders_taken,
            state: State::from_u8(self.state.load(Relaxed)).unwrap_or(State::Down),
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
            spindle_on: self.spindle_on.load(Relaxed),
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
