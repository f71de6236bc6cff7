//! A simulated spindle with an encoder.
//!
//! In:  the ordered speed, once a cycle. Out: what an encoder of so many counts and one index per turn shows.
//!
//! The speed follows the order with a constant acceleration. On it lie a ripple (once or more per turn: the load of a cut that
//! is not even) and a drop under load that comes and goes at random.

use crate::rt::SpindleFeedback;

/// Time constant of a drop under load, s.
pub(in crate::rt) const DROP_S: f64 = 0.05;

/// What a simulated spindle does.
#[derive(Clone, Copy, Debug)]
pub(in crate::rt) struct Turning {
    /// As programmed, negative with M4.
    pub(in crate::rt) turns_s: f64,
    /// Turns/s².
    pub(in crate::rt) acceleration: f64,
    /// Share of the speed, each way.
    pub(in crate::rt) ripple: f64,
    /// How often per turn.
    pub(in crate::rt) ripples_per_turn: f64,
    /// Share of the speed that is lost under load.
    pub(in crate::rt) drop: f64,
    pub(in crate::rt) counts: f64,
    pub(in crate::rt) seed: u64,
}

#[derive(Clone, Debug)]
pub(in crate::rt) struct Spindle {
    turning: Turning,
    cycle_s: f64,
    ordered: f64,
    /// As far as acceleration has brought it.
    base: f64,
    drop: f64,
    loaded: bool,
    turns: f64,
    /// Count at the index, once there has been one.
    index: Option<f64>,
    random: u64,
}

impl Spindle {
    pub(in crate::rt) fn new(turning: Turning, cycle_s: f64) -> Spindle {
        let mut spindle = Spindle {
            turning,
            cycle_s,
            ordered: turning.turns_s,
            base: turning.turns_s,
            drop: 0.0,
            loaded: false,
            turns: 0.0,
            index: None,
            random: turning.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1,
        };
        spindle.turns = 100.0 * spindle.random();
        spindle
    }

    /// xorshift64*, 0 to 1.
    fn random(&mut self) -> f64 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        (self.random.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The speed that is wanted from here on, of that programmed; `Some`: the other way round.
    pub(in crate::rt) fn order(&mut self, reversal: Option<f64>) {
        self.ordered = self.turning.turns_s * reversal.map_or(1.0, |scale| -scale);
    }

    /// The true angle, counted from an index if there was one.
    pub(in crate::rt) fn turns(&self) -> f64 {
        self.turns - self.index.unwrap_or(0.0)
    }

    /// One cycle further, in tenths of one.
    pub(in crate::rt) fn step(&mut self) -> SpindleFeedback {
        let Turning {
            acceleration,
            ripple,
            ripples_per_turn,
            counts,
            ..
        } = self.turning;
        if self.random() < 0.005 {
            self.loaded = !self.loaded;
        }
        let aim = if self.loaded { self.turning.drop } else { 0.0 };
        let dt = self.cycle_s / 10.0;
        for _ in 0..10 {
            let change = acceleration * dt;
            self.base += (self.ordered - self.base).clamp(-change, change);
            self.drop += (aim - self.drop) * dt / DROP_S;
            let wave = (std::f64::consts::TAU * ripples_per_turn * self.turns).sin();
            let before = self.turns;
            self.turns += self.base * (1.0 - self.drop + ripple * wave) * dt;
            if before.floor() != self.turns.floor() && self.index.is_none() {
                self.index = Some(before.floor().max(self.turns.floor()));
            }
        }
        SpindleFeedback {
            turns: (self.turns() * counts).floor() / counts,
            indexed: self.index.is_some(),
        }
    }
}
