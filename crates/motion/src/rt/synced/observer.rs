//! Where the spindle is, how fast it turns and how its speed changes, from the counts of its encoder.
//!
//! In:  turns as measured, once a cycle, in steps of a count.
//! Out: turns, speed and acceleration without the steps.
//!
//! A filter of the second degree with fading memory: the parabola that fits the past best where what is n cycles old counts
//! [`MEMORY`]`^n`. It follows constant speed and constant acceleration without lag; a spindle whose acceleration changes by
//! `w` each second (turns/s³) is estimated `w T³ (MEMORY/(1 - MEMORY))³` behind. RT.

/// What a measurement counts for in comparison with the one a cycle later.
pub(super) const MEMORY: f64 = 0.7;
/// Cycles after which what was assumed at the beginning has faded: `MEMORY^40` is 6e-7.
const SETTLED: u32 = 40;

/// Estimates the motion of the spindle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observer {
    cycle_s: f64,
    turns: f64,
    speed: f64,
    acceleration: f64,
    /// Measurements so far, at most [`SETTLED`].
    seen: u32,
    /// Whether the last measurement counted from the index.
    indexed: bool,
}

impl Observer {
    pub(super) fn new(cycle_s: f64) -> Observer {
        Observer {
            cycle_s,
            turns: 0.0,
            speed: 0.0,
            acceleration: 0.0,
            seen: 0,
            indexed: false,
        }
    }

    /// Takes the measurement of this cycle. Where the count restarts, as it does at the first index, so does the filter. RT.
    pub(super) fn update(&mut self, turns: f64, indexed: bool) {
        if !turns.is_finite() {
            self.seen = 0;
            return;
        }
        if self.seen == 0 || indexed != self.indexed {
            *self = Observer {
                turns,
                seen: 1,
                indexed,
                ..Observer::new(self.cycle_s)
            };
            return;
        }
        if self.seen == 1 {
            self.speed = (turns - self.turns) / self.cycle_s;
            self.turns = turns;
            self.seen = 2;
            return;
        }
        let t = self.cycle_s;
        let forget = 1.0 - MEMORY;
        let expected = self.turns + t * (self.speed + t * self.acceleration / 2.0);
        let off = turns - expected;
        self.turns = expected + off * (1.0 - MEMORY * MEMORY * MEMORY);
        self.speed += t * self.acceleration + off * 1.5 * (1.0 + MEMORY) * forget * forget / t;
        self.acceleration += off * forget * forget * forget / (t * t);
        self.seen = (self.seen + 1).min(SETTLED);
    }

    /// Whether there have been enough measurements, counted from the index. RT.
    pub(super) fn is_settled(&self) -> bool {
        self.indexed && self.seen == SETTLED
    }

    /// Turns, speed (1/s) and acceleration (1/s²) one cycle ago. RT.
    pub(super) fn one_cycle_ago(&self) -> [f64; 3] {
        let t = self.cycle_s;
        [
            self.turns - t * (self.speed - t * self.acceleration / 2.0),
            self.speed - t * self.acceleration,
            self.acceleration,
        ]
    }

    /// Speed, turns/s. RT.
    pub(super) fn speed(&self) -> f64 {
        self.speed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_accelerating_spindle_is_followed_without_lag_and_a_step_to_it_fades() {
        let mut observer = Observer::new(1e-3);
        let turns = |t: f64| 3.0 + 10.0 * t + 20.0 * t * t;
        for k in 0..400 {
            observer.update(turns(f64::from(k) * 1e-3), true);
        }
        let [place, speed, acceleration] = observer.one_cycle_ago();
        let t = 0.398;
        assert!((place - turns(t)).abs() < 1e-9);
        assert!((speed - (10.0 + 40.0 * t)).abs() < 1e-6);
        assert!((acceleration - 40.0).abs() < 1e-3);
        assert!(observer.is_settled());
        observer.update(0.0, false);
        assert!(!observer.is_settled());
    }
}
