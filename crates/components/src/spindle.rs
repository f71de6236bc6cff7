//! Spindle: at speed, gears, orientation, and one to try them with.

use crate::component::Component;
use crate::declare::component;

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
        spindle_underspeed: bool = false, "it has been too slow, or turned the other way, since then";
    }
    state { watch: Watch = Watch::Off; }
}

/// What is watched for. Each call takes one step.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Watch {
    Off,
    ComesToSpeed,
    KeepsSpeed,
}

impl Component for SpindleMonitor {
    fn update(&mut self, _: f64) {
        let missing = self.spindle_command - self.spindle_feedback;
        if self.watch == Watch::Off {
            (self.spindle_at_speed, self.spindle_underspeed) = (false, false);
        }
        match self.watch {
            Watch::Off if self.spindle_is_on => self.watch = Watch::ComesToSpeed,
            _ if !self.spindle_is_on => self.watch = Watch::Off,
            Watch::ComesToSpeed if missing.abs() < self.threshold => {
                (self.watch, self.spindle_at_speed) = (Watch::KeepsSpeed, true);
            }
            Watch::KeepsSpeed => {
                // In the commanded direction. A speed that is no number is too slow.
                let missing = if self.spindle_command < 0.0 { -missing } else { missing };
                let is_fast = missing <= self.threshold;
                self.spindle_underspeed |= !is_fast;
            }
            Watch::Off | Watch::ComesToSpeed => {}
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
        let speed = match self.speed_in.abs() {
            low if low < min => min,
            high if high > max => max,
            speed => speed,
        } / scale;
        self.speed_out = if self.speed_in < 0.0 { -speed } else { speed };
        self.dir_out = self.dir_in != (self.sel && self.reverse);
    }
}

component! {
    /// Turns a spindle to an angle: the target for its position loop.
    Orient = "orient";
    in {
        enable: bool = false, "orients; the target is worked out as it rises";
        mode: i32 = 0, "0 the shortest way, 1 clockwise, 2 counterclockwise; else the target stays";
        position: f64 = 0.0, "position of the spindle, turns";
        angle: f64 = 0.0, "wanted angle, 0 to 360 degrees";
        tolerance: f64 = 0.5, "greatest error, degrees";
    }
    out {
        command: f64 = 0.0, "target, turns";
        poserr: f64 = 0.0, "position less target, degrees";
        is_oriented: bool = false, "more than 100 calls were within the tolerance";
    }
    state { enabled: bool = false; calls: u32 = 0; }
}

impl Component for Orient {
    fn update(&mut self, _: f64) {
        // One that is enabled from the start has its target from the first call.
        let begins = !std::mem::replace(&mut self.enabled, self.enable) && self.enable;
        self.is_oriented = false;
        if !self.enable {
            return;
        }
        if begins {
            self.calls = 0;
            let (from, target) = (self.position, self.angle / 360.0);
            let command = match self.mode {
                0 => libm::floor(from + 0.5 - target) + target,
                1 => libm::ceil(from - target) + target,
                2 => libm::floor(from - target) + target,
                _ => self.command,
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
        scale: f64 = 1.0, "turns a second for each unit of `velocity-cmd`; 1/60 for rpm";
        index_enable: bool = false, "the position is 0 at the next whole turn";
    }
    out {
        position_fb: f64 = 0.0, "position, turns";
        indexed: bool = false, "the whole turn has been met; until `index-enable` falls";
    }
}

impl Component for SimSpindle {
    fn update(&mut self, period_s: f64) {
        let next = self.position_fb + self.velocity_cmd * self.scale * period_s;
        if !next.is_finite() {
            return;
        }
        let whole = match next < self.position_fb {
            true => libm::ceil(next),
            false => libm::floor(next),
        };
        let crossed = libm::floor(next) != libm::floor(self.position_fb);
        let zero = crossed && self.index_enable && !self.indexed;
        self.indexed = self.index_enable && (self.indexed || zero);
        self.position_fb = if zero { next - whole } else { next };
    }
}
