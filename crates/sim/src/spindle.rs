//! The simulated spindle, with its frequency converter and its encoder.
//!
//! In:  the speed that it is told; the time.
//! Out: the count of its encoder and the count at the last index, both wrapped.
//!
//! It changes its speed evenly. Nothing is random.

use config::{Config, SpindleCounter, SpindleEncoder};

/// Change of the speed, 1/min per second.
const RAMP_RPM_S: f64 = 2000.0;
/// Speed at which it turns to its index at the most, turns/s, and the speed for each turn that is left, 1/s.
const ORIENT_TURNS_S: f64 = 2.0;
const ORIENT_GAIN: f64 = 10.0;
/// What it may be off, turns, and move still, turns/s.
const ORIENTED_TURNS: f64 = 1e-3;
/// Place of the index, turns behind where the spindle stands at power-on.
const INDEX: f64 = 0.37;

/// Spindle and encoder.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spindle {
    period_s: f64,
    /// Speed at the greatest value of the object that sets it, turns/s.
    greatest_turns_s: f64,
    encoder: Option<SpindleCounter>,
    turns: f64,
    turns_s: f64,
    latched: u64,
    /// It is told to turn to its index.
    pub(super) orient: bool,
    /// A drive of CiA 402 turns it: to here, turns.
    pub(super) led: Option<f64>,
    /// The shaft is held: it stands, whatever it is told.
    pub(super) blocked: bool,
    /// Counts that came from nowhere; below 0: that got lost.
    pub(super) slipped: i64,
}

impl Spindle {
    /// The spindle of the machine file, at rest.
    pub(super) fn new(config: &Config) -> Spindle {
        let encoder = match config.spindle.encoder {
            Some(SpindleEncoder::Counter(counter)) => Some(counter),
            Some(SpindleEncoder::Pins) | None => None,
        };
        Spindle {
            period_s: f64::from(config.cycle_us) * 1e-6,
            greatest_turns_s: config.spindle.rpm_max / 60.0,
            encoder,
            turns: 0.0,
            turns_s: 0.0,
            latched: 0,
            orient: false,
            led: None,
            blocked: false,
            slipped: 0,
        }
    }

    /// One cycle towards the speed that `told` says: 32767 is the highest.
    pub(super) fn advance(&mut self, told: i16) {
        let wanted = match self.orient {
            true => self.towards_index(),
            false => f64::from(told) / f64::from(i16::MAX) * self.greatest_turns_s,
        };
        let step = RAMP_RPM_S / 60.0 * self.period_s;
        let before = self.turns_s;
        self.turns_s = if self.blocked {
            0.0
        } else {
            before + (wanted - before).clamp(-step, step)
        };
        let (from, mut to) = (self.turns, self.turns + (before + self.turns_s) / 2.0 * self.period_s);
        if let Some(turns) = self.led {
            (self.turns_s, to) = ((turns - from) / self.period_s, turns);
        }
        self.turns = to;
        let passed = |turns: f64| (turns - INDEX).floor();
        if passed(from) != passed(to) {
            self.latched = self.count_at(passed(from.max(to)) + INDEX);
        }
    }

    /// Speed that leads to the nearest place of the index, turns/s.
    fn towards_index(&self) -> f64 {
        let off = self.turns_from_index();
        let way = off.round() - off;
        (ORIENT_GAIN * way).clamp(-ORIENT_TURNS_S, ORIENT_TURNS_S)
    }

    /// Whether it is told to be at its index, and is.
    pub(super) fn is_oriented(&self) -> bool {
        let off = self.turns_from_index();
        self.orient && (off - off.round()).abs() < ORIENTED_TURNS && self.turns_s.abs() < ORIENTED_TURNS
    }

    /// Count of the encoder.
    pub(super) fn count(&self) -> u64 {
        self.count_at(self.turns)
    }

    /// Count at the last index; 0 before the first.
    pub(super) fn latched(&self) -> u64 {
        self.latched
    }

    /// Turns since power-on, less the place of the index: what a mark on the chuck would show.
    pub(super) fn turns_from_index(&self) -> f64 {
        self.turns - INDEX
    }

    /// Wrapped by whoever reads fewer bits of it.
    fn count_at(&self, turns: f64) -> u64 {
        let counts = self.encoder.map_or(0.0, |encoder| f64::from(encoder.counts_per_turn));
        // Far below the numbers that an f64 holds exactly: a day at 24,000 1/min are 3.5e11 counts of 10,000 a turn.
        ((turns * counts).floor() as i64).wrapping_add(self.slipped) as u64
    }
}
