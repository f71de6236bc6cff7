//! Machine functions: gantry, thermal growth, sticks.

use crate::component::{Component, Options};
use crate::declare::component;

component! {
    /// Several joints that move one axis, squared at their own home switches.
    ///
    /// While the command goes toward the switches, a joint whose switch is closed waits for the others; what it waited is its
    /// offset from then on.
    Gantry = "gantry";
    options { personality: 2, 1..=7, [], "number of joints"; }
    in {
        pos_fb as "joint.##.pos-fb": Vec<f64> = vec![0.0; 2], "actual position of a joint";
        home_sw as "joint.##.home": Vec<bool> = vec![false; 2], "home switch of a joint";
        position_cmd: f64 = 0.0, "command of the axis";
        search_vel: f64 = 0.0, "its sign is the direction toward the switches";
    }
    out {
        pos_cmd as "joint.##.pos-cmd": Vec<f64> = vec![0.0; 2], "command of a joint";
        offset as "joint.##.offset": Vec<f64> = vec![0.0; 2], "how far a joint is behind the axis";
        position_fb: f64 = 0.0, "actual position of the axis: that of a joint that still moves";
        home: bool = false, "all switches are closed; then until all are open";
        limit: bool = false, "a switch is closed";
    }
    state { before: Option<f64> = None; feedback_joint: usize = 0; }
}

impl Component for Gantry {
    fn shape(&mut self, options: &Options<'_>) {
        let count = options.count("personality");
        (self.pos_fb, self.home_sw) = (vec![0.0; count], vec![false; count]);
        (self.pos_cmd, self.offset) = (vec![0.0; count], vec![0.0; count]);
    }

    fn update(&mut self, _: f64) {
        let closed = self.home_sw.iter().filter(|switch| **switch).count();
        self.limit = closed > 0;
        self.home = match self.home {
            false => closed == self.home_sw.len(),
            true => self.limit,
        };
        let is_closed = |joint: usize| self.home_sw.get(joint).is_some_and(|switch| *switch);
        if !self.home && is_closed(self.feedback_joint) {
            let moving = self.home_sw.iter().position(|switch| !switch);
            self.feedback_joint = moving.unwrap_or(self.feedback_joint);
        }
        // With the offset that the position answers to, which is that of the command before.
        let joint = self.feedback_joint;
        if let (Some(position), Some(offset)) = (self.pos_fb.get(joint), self.offset.get(joint)) {
            self.position_fb = position + offset;
        }
        let moved = self.position_cmd - self.before.unwrap_or(self.position_cmd);
        if moved.is_nan() {
            return;
        }
        self.before = Some(self.position_cmd);
        let squares = moved * self.search_vel > 0.0 && !self.home;
        for ((offset, switch), pos_cmd) in self.offset.iter_mut().zip(&self.home_sw).zip(&mut self.pos_cmd) {
            if squares && *switch {
                *offset += moved;
            }
            *pos_cmd = self.position_cmd - *offset;
        }
    }
}

component! {
    /// Offset against the growth of a screw or a frame with its temperature.
    ThermalCompensation = "thermal_compensation";
    in {
        temperature: f64 = 20.0, "temperature, degrees Celsius";
        reference: f64 = 20.0, "temperature at which nothing is to be compensated, degrees Celsius";
        coefficient: f64 = 0.0, "growth of a length a kelvin, 1/K; steel 11.5e-6";
        position: f64 = 0.0, "position, mm";
        fixed_point: f64 = 0.0, "position that does not move, mm";
        max: f64 = 0.1, "greatest offset, mm";
        maxv: f64 = 0.01, "greatest speed of the offset, mm/s";
        enable: bool = true, "compensates; else the offset goes to 0";
    }
    out {
        offset: f64 = 0.0, "is to be added to the command, mm; holds where an input is no number";
        limited: bool = false, "more than `max` would be needed, or an input is no number";
    }
}

impl Component for ThermalCompensation {
    fn update(&mut self, period_s: f64) {
        let growth = self.coefficient * (self.temperature - self.reference) * (self.position - self.fixed_point);
        // What has grown is farther away than it should be.
        let wanted = if self.enable { -growth } else { 0.0 };
        let most = self.max.max(0.0);
        let step = self.maxv.max(0.0) * period_s;
        self.limited = wanted.is_nan() || wanted.abs() > most;
        if !wanted.is_nan() {
            let target = wanted.max(-most).min(most);
            self.offset = target.max(self.offset - step).min(self.offset + step);
        }
    }
}

component! {
    /// Response of a stick: dead zone, curve, scale.
    Joyhandle = "joyhandle";
    in {
        in_: f64 = 0.0, "deflection, -1 to 1";
        power: f64 = 2.0, "curve, 1 (straight) and above";
        deadband: f64 = 0.0, "deflection that is none, 0 to 0.99";
        scale: f64 = 1.0, "output at full deflection, less `offset`";
        offset: f64 = 0.0, "output at the edge of the dead zone";
        inverse: bool = false, "steep at first, instead of at the end";
    }
    out { out: f64 = 0.0, "`scale * (a x^power + b x) + offset`, 0 at the edge of the dead zone and 1 at full deflection in brackets; the same to both sides"; }
}

impl Component for Joyhandle {
    fn update(&mut self, _: f64) {
        let dead = self.deadband.clamp(0.0, 0.99);
        let power = self.power.max(1.0);
        let x = self.in_.abs().min(1.0);
        // Through (dead, 0) and (1, 1).
        let curve = |x: f64| match power == 1.0 {
            true => (x - dead) / (1.0 - dead),
            false => {
                let a = 1.0 / (1.0 - libm::pow(dead, power - 1.0));
                a * libm::pow(x, power) + (1.0 - a) * x
            }
        };
        // The inverse is the curve turned around the middle.
        let share = match self.inverse {
            false => curve(x),
            true => 1.0 - curve(1.0 + dead - x),
        };
        self.out = match x <= dead {
            true => 0.0,
            false => (self.scale * share + self.offset) * self.in_.signum(),
        };
    }
}
