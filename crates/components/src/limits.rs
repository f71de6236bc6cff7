//! Limits of value, speed and acceleration; filters of small motion. What is no number changes nothing.

use crate::component::Component;
use crate::declare::component;

/// Between `min` and `max`, `max` last. RT.
fn limited(value: f64, min: f64, max: f64) -> f64 {
    let value = if value < min { min } else { value };
    if value > max { max } else { value }
}

component! {
    /// Limits a number.
    Limit1 = "limit1";
    in {
        in_: f64 = 0.0, "number";
        min: f64 = -1e20, "least";
        max: f64 = 1e20, "greatest";
    }
    out { out: f64 = 0.0, "number between them"; }
}

impl Component for Limit1 {
    fn update(&mut self, _: f64) {
        let out = limited(self.in_, self.min, self.max);
        if !(out.is_nan() || self.min.is_nan() || self.max.is_nan()) {
            self.out = out;
        }
    }
}

component! {
    /// Limits a number and its speed.
    Limit2 = "limit2";
    in {
        in_: f64 = 0.0, "number";
        load: bool = false, "jumps, whatever the speed";
        min: f64 = -1e20, "least";
        max: f64 = 1e20, "greatest";
        maxv: f64 = 1e20, "greatest speed, 1/s";
    }
    out { out: f64 = 0.0, "follows the number"; }
}

impl Component for Limit2 {
    fn update(&mut self, period_s: f64) {
        let target = limited(self.in_, self.min, self.max);
        let step = self.maxv.max(0.0) * period_s;
        if target.is_nan() || self.min.is_nan() || self.max.is_nan() {
            return;
        }
        self.out = match self.load {
            true => target,
            false => limited(target, self.out - step, self.out + step),
        };
    }
}

component! {
    /// Limits a number, its speed and its acceleration; without overshoot beyond `min`, `max` or a number that rests.
    Limit3 = "limit3";
    in {
        in_: f64 = 0.0, "number";
        enable: bool = true, "follows; else goes to 0, within the same limits";
        load: bool = false, "jumps, and rests there";
        min: f64 = -1e20, "least";
        max: f64 = 1e20, "greatest";
        maxv: f64 = 1e20, "greatest speed, 1/s";
        maxa: f64 = 1e20, "greatest acceleration, 1/s^2";
    }
    out { out: f64 = 0.0, "follows the number"; }
    state { velocity: f64 = 0.0; target_before: f64 = 0.0; }
}

/// Greatest speed from which `distance` suffices to come to rest in `n` calls, the last step being any part of `aT`.
///
/// `v T + (v - aT) T + .. = n v T - aT² n (n - 1) / 2 = distance`, with the least `n` for which `aT² n (n + 1) / 2` is no less. RT.
fn speed_to_rest(distance: f64, acceleration: f64, period_s: f64) -> f64 {
    let distance = distance.max(0.0);
    let step = acceleration * period_s;
    let calls = libm::ceil((1.0 + 8.0 * distance / (step * period_s)).sqrt() / 2.0 - 0.5).max(1.0);
    if !calls.is_finite() {
        return f64::INFINITY;
    }
    distance / (calls * period_s) + step * (calls - 1.0) / 2.0
}

impl Component for Limit3 {
    fn update(&mut self, period_s: f64) {
        let wanted = if self.enable { self.in_ } else { 0.0 };
        let wanted = limited(wanted, self.min, self.max);
        let limits = [self.min, self.max, self.maxv, self.maxa];
        let is_sound = wanted.is_finite() && !limits.iter().any(|limit| limit.is_nan());
        let target = if is_sound { wanted } else { self.target_before };
        if self.load {
            (self.out, self.velocity, self.target_before) = (target, 0.0, target);
            return;
        }
        let maxv = if self.maxv.is_nan() { 0.0 } else { self.maxv.max(0.0) };
        let maxa = if self.maxa > 0.0 { self.maxa.min(1e20) } else { return };
        // Beside the target, as fast as it moves: what is left is the way to where it was.
        let target_velocity = limited((target - self.target_before) / period_s, -maxv, maxv);
        let behind = target - target_velocity * period_s - self.out;
        let catch_up = speed_to_rest(behind.abs(), maxa, period_s).copysign(behind);
        let mut velocity = limited(target_velocity + catch_up, -maxv, maxv);
        if is_sound {
            let up = speed_to_rest(self.max - self.out, maxa, period_s);
            let down = speed_to_rest(self.out - self.min, maxa, period_s);
            velocity = limited(velocity, -down, up);
        }
        let step = maxa * period_s;
        self.velocity = limited(velocity, self.velocity - step, self.velocity + step);
        self.out += self.velocity * period_s;
        self.target_before = target;
    }
}

component! {
    /// Holds a number at the centre as long as it is near.
    Deadzone = "deadzone";
    in {
        in_: f64 = 0.0, "number";
        center: f64 = 0.0, "centre";
        threshold: f64 = 1.0, "width of the zone; outside, the number is nearer by half of it";
    }
    out { out: f64 = 0.0, "number without the zone"; }
}

impl Component for Deadzone {
    fn update(&mut self, _: f64) {
        let half = self.threshold / 2.0;
        self.out = if self.in_ < self.center - half {
            self.in_ + half
        } else if self.in_ > self.center + half {
            self.in_ - half
        } else if self.in_.is_nan() {
            self.in_
        } else {
            self.center
        };
    }
}
