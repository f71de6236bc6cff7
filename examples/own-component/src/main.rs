//! A control of isocnc with one more component: everything that `isocnc` does, and `type = "tank"` in machine files.
//!
//! ```toml
//! [[hal.component]]
//! name = "coolant-tank"           # pins coolant-tank.level and so on
//! type = "tank"
//! set = { low = 15.0, high = 85.0 }
//! ```

use isocnc::components::{Component, component};
use std::process::ExitCode;

component! {
    /// Keeps a tank filled: the valve opens below one level and closes above another.
    Tank = "tank";
    in {
        level: f64 = 0.0, "level, percent; what is no number closes the valve";
        low: f64 = 20.0, "opens below it, percent";
        high: f64 = 80.0, "closes above it, percent";
        longest: f64 = 60.0, "longest time that the valve may be open without reaching `high`, s";
        reset: bool = false, "clears `stuck` while true";
    }
    out {
        valve: bool = false, "fills";
        stuck: bool = false, "the tank did not fill in time; the valve stays closed until `reset`";
    }
    state { open_s: f64 = 0.0; }
}

impl Component for Tank {
    fn update(&mut self, period_s: f64) {
        if self.reset {
            self.stuck = false;
        }
        let may_open = !self.stuck && self.level.is_finite();
        self.valve = may_open && (self.level < self.low || self.valve && self.level < self.high);
        self.open_s = if self.valve { self.open_s + period_s } else { 0.0 };
        if self.open_s > self.longest {
            (self.stuck, self.valve) = (true, false);
        }
    }
}

fn main() -> ExitCode {
    isocnc::main_with(&[Tank::KIND])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_fills_between_two_levels_and_gives_up_in_time() {
        let mut tank = Tank {
            level: 50.0,
            low: 20.0,
            high: 80.0,
            longest: 0.0105,
            reset: false,
            valve: false,
            stuck: false,
            open_s: 0.0,
        };
        for (level, open) in [
            (50.0, false),
            (19.0, true),
            (79.0, true),
            (80.0, false),
            (50.0, false),
            (f64::NAN, false),
        ] {
            tank.level = level;
            tank.update(0.001);
            assert_eq!(tank.valve, open, "{level}");
        }
        tank.level = 0.0;
        let open = (0..20).filter(|_| {
            tank.update(0.001);
            tank.valve
        });
        assert_eq!((open.count(), tank.stuck), (10, true));
        tank.reset = true;
        tank.update(0.001);
        assert!(tank.valve && !tank.stuck);
    }
}
