//! Spindle: at speed, gears, orientation, and one to try them with.

use crate::component::Component;
use crate::declare::component;
use crate::edge::Edge;

component! {
    /// Whether the spindle has come to its speed, and whether it has lost it again.
    SpindleMonitor = "spindle_monitor";
    in {
        spindle_is_on: bool = false, "the spindle is switched on";
        spindle_command: f64 = 0.0, "wanted speed";
        spindle_feedback: f64 = 0.0, "actual speed, in the same unit";
        threshold: f64 = 0.0, "difference that is borne";
    }
    out {
        spindle_at_speed: bool = false, "it has come to its speed since it was switched on";
        spindle_underspeed: bool = false, "it has been too slow since then";
    }
}

impl Component for SpindleMonitor {
    fn update(&mut self, _: f64) {
        if !self.spindle_is_on {
            (self.spindle_at_speed, self.spindle_underspeed) = (false, false);
        } else if !self.spindle_at_speed {
            self.spindle_at_speed = (self.spindle_command - self.spindle_feedback).abs() < self.threshold;
        } else {
            // A speed that is no number is too slow.
            let is_fast = self.spindle_command.abs() - self.spindle_feedback.abs() <= self.threshold;
            self.spindle_underspeed |= !is_fast;
        }
    }
}

component! {
    /// Speed command for a gearbox of two gears.
    Gearchange = "gearchange";
    in {
        sel: bool = false, "second gear";
        speed_in: f64 = 0.0, "wanted speed of the spindle";
        dir_in: bool = false, "wanted direction";
        min1: f64 = 0.0, "least speed in the first gear";
        max1: f64 = 100_000.0, "greatest speed in the first gear";
        min2: f64 = 0.0, "least speed in the second gear";
        max2: f64 = 100_000.0, "greatest speed in the second gear";
        scale2: f64 = 1.0, "how much faster the second gear is, 1 at least";
        reverse: bool = false, "the second gear turns the other way";
    }
    out { speed_out: f64 = 0.0, "speed for the drive"; dir_out: bool = false, "direction for the drive"; }
}

impl Component for Gearchange {
    fn update(&mut self, _: f64) {
        let (min, max, scale) = match self.sel {
            false => (self.min1, self.max1, 1.0),
            true => (self.min2, self.max2, self.scale2.max(1.0)),
        };
        if self.speed_in.is_nan() || min.is_nan() || max.is_nan() {
            return;
        }
        let speed = self.speed_in.abs().max(min).min(max) / scale;
        self.speed_out = if self.speed_in < 0.0 { -speed } else { speed };
        self.dir_out = self.dir_in != (self.sel && self.reverse);
    }
}

component! {
    /// Turns a spindle to an angle: the target for its position loop.
    Orient = "orient";
    in {
        enable: bool = false, "orients; the target is worked out as it rises";
        mode: i32 = 0, "0 the shortest way, 1 clockwise, 2 counterclockwise";
        position: f64 = 0.0, "position of the spindle, turns";
        angle: f64 = 0.0, "wanted angle, 0 to 360 degrees";
        tolerance: f64 = 0.5, "greatest error, degrees";
    }
    out {
        command: f64 = 0.0, "target, turns";
        poserr: f64 = 0.0, "position less target, degrees";
        is_oriented: bool = false, "more than 100 calls were within the tolerance";
    }
    state { edge: Edge = Edge::default(); calls: u32 = 0; }
}

impl Component for Orient {
    fn update(&mut self, _: f64) {
        let rises = self.edge.rises(self.enable);
        self.is_oriented = false;
        if !self.enable {
            return;
        }
        if rises {
            self.calls = 0;
            let (from, target) = (self.position, self.angle / 360.0);
            let command = match self.mode {
                1 => libm::ceil(from - target) + target,
                2 => libm::floor(from - target) + target,
                _ => libm::floor(from + 0.5 - target) + target,
            };
            if command.is_finite() {
                self.command = command;
            }
        }
        self.poserr = (self.position - self.command) * 360.0;
        if self.poserr.abs() < self.tolerance && self.calls <= 100 {
            self.calls += 1;
        }
        self.is_oriented = self.calls > 100;
    }
}

component! {
    /// Position and index of a simulated spindle.
    SimSpindle = "sim_spindle";
    in {
        velocity_cmd: f64 = 0.0, "speed, in the unit of `scale`";
        scale: f64 = 1.0, "units of `velocity-cmd` for a turn a second; 60 for rpm, 0 as 1";
        index_enable: bool = false, "the position is 0 at the next whole turn";
    }
    out {
        position_fb: f64 = 0.0, "position, turns";
        indexed: bool = false, "the whole turn has been met; until `index-enable` falls";
    }
}

impl Component for SimSpindle {
    fn update(&mut self, period_s: f64) {
        let scale = if self.scale == 0.0 { 1.0 } else { self.scale };
        let next = self.position_fb + self.velocity_cmd / scale * period_s;
        if !next.is_finite() {
            return;
        }
        let whole = libm::floor(next.max(self.position_fb));
        let crossed = whole != libm::floor(next.min(self.position_fb));
        let zero = crossed && self.index_enable && !self.indexed;
        self.indexed = self.index_enable && (self.indexed || zero);
        self.position_fb = if zero { next - whole } else { next };
    }
}
