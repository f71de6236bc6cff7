//! Filters, derivative, integral. A value that is no number is left out, so that it does not stay inside for ever.

use crate::component::Component;
use crate::declare::component;
use crate::edge::Edge;
use std::f64::consts::PI;

component! {
    /// Low-pass filter of first order.
    Lowpass = "lowpass";
    in {
        in_: f64 = 0.0, "number";
        load: bool = false, "jumps";
        gain: f64 = 0.0, "part of the difference that is taken a call: 1 - exp(-2 pi f T)";
    }
    out { out: f64 = 0.0, "smoothed number"; }
}

impl Component for Lowpass {
    fn update(&mut self, _: f64) {
        let next = match self.load {
            true => self.in_,
            false => self.out + (self.in_ - self.out) * self.gain,
        };
        if next.is_finite() {
            self.out = next;
        }
    }
}

component! {
    /// Low-pass filter for counts of a hand wheel: finer counts, smoother motion.
    Ilowpass = "ilowpass";
    in {
        in_: i32 = 0, "counts";
        scale: f64 = 1024.0, "counts of the output for one of the input";
        gain: f64 = 0.5, "part of the difference that is taken a call, 0 to 1";
    }
    out { out: i32 = 0, "smoothed counts, wrapping around"; }
    state { value: f64 = 0.0; }
}

impl Component for Ilowpass {
    fn update(&mut self, _: f64) {
        let next = self.value + (f64::from(self.in_) - self.value) * self.gain;
        if next.is_finite() {
            self.value = next;
        }
        // Jogging takes differences of counts, which go on over the end of their type.
        self.out = libm::floor(self.value * self.scale + 0.5) as i64 as i32;
    }
}

component! {
    /// Filter of second order: low-pass, notch, or coefficients of your own.
    Biquad = "biquad";
    in {
        in_: f64 = 0.0, "number";
        enable: bool = false, "filters; coefficients are worked out as it rises, and for types 1 and 2 it begins anew";
        type_: u32 = 0, "0 own coefficients, 1 low-pass, 2 notch";
        f0: f64 = 250.0, "corner frequency, Hz; at most half the rate of calls";
        q: f64 = 7071.0 / 10_000.0, "quality, 0.5 to 2";
        d1: f64 = 0.0, "own coefficient of the denominator";
        d2: f64 = 0.0, "own coefficient of the denominator";
        n0: f64 = 1.0, "own coefficient of the numerator";
        n1: f64 = 0.0, "own coefficient of the numerator";
        n2: f64 = 0.0, "own coefficient of the numerator";
    }
    out {
        out: f64 = 0.0, "filtered number; the number itself while not `valid` or not `enable`";
        valid: bool = false, "there are coefficients, those of the last rise of `enable`";
    }
    state { edge: Edge = Edge::default(); known: bool = false; numerator: [f64; 3] = [0.0; 3]; denominator: [f64; 2] = [0.0; 2]; sums: [f64; 2] = [0.0; 2]; }
}

impl Biquad {
    /// Coefficients from the bilinear transform, with `w = 2 pi f0 T` and `alpha = sin w / 2Q`; whether there are any. RT.
    fn design(&mut self, period_s: f64) -> bool {
        let fits = self.f0 > 0.0 && self.f0 <= 0.5 / period_s && (0.5..=2.0).contains(&self.q);
        let (sin, cos) = libm::sincos(2.0 * PI * self.f0 * period_s);
        let alpha = sin / (2.0 * self.q);
        let numerator = match (self.type_, fits) {
            (0, _) => {
                self.numerator = [self.n0, self.n1, self.n2];
                self.denominator = [self.d1, self.d2];
                return self
                    .numerator
                    .iter()
                    .chain(&self.denominator)
                    .all(|value| value.is_finite());
            }
            (1, true) => [(1.0 - cos) / 2.0, 1.0 - cos, (1.0 - cos) / 2.0],
            (2, true) => [1.0, -2.0 * cos, 1.0],
            _ => return false,
        };
        let a0 = 1.0 + alpha;
        self.numerator = numerator.map(|value| value / a0);
        self.denominator = [-2.0 * cos / a0, (1.0 - alpha) / a0];
        true
    }
}

impl Component for Biquad {
    fn update(&mut self, period_s: f64) {
        // A filter that is enabled from the start is designed in the first call.
        let begins = self.edge.rises(self.enable) || !std::mem::replace(&mut self.known, true) && self.enable;
        if begins {
            self.valid = self.design(period_s);
            if self.type_ != 0 && self.valid {
                self.sums = [0.0; 2];
            }
        }
        if !(self.enable && self.valid) {
            self.out = self.in_;
            return;
        }
        let ([n0, n1, n2], [d1, d2], [s1, s2]) = (self.numerator, self.denominator, self.sums);
        let out = n0 * self.in_ + s1;
        if out.is_finite() {
            self.out = out;
            self.sums = [n1 * self.in_ - d1 * out + s2, n2 * self.in_ - d2 * out];
        }
    }
}

component! {
    /// Speed of a number.
    Ddt = "ddt";
    in { in_: f64 = 0.0, "number"; }
    out { out: f64 = 0.0, "its speed, 1/s"; }
    state { before: Option<f64> = None; }
}

impl Component for Ddt {
    fn update(&mut self, period_s: f64) {
        self.out = (self.in_ - self.before.unwrap_or(self.in_)) / period_s;
        if self.in_.is_finite() {
            self.before = Some(self.in_);
        }
    }
}

component! {
    /// Integral of a number over time.
    Integ = "integ";
    in {
        in_: f64 = 0.0, "number";
        gain: f64 = 1.0, "gain";
        reset: bool = false, "to 0, and stays there";
        min: f64 = -1e20, "least integral";
        max: f64 = 1e20, "greatest integral";
    }
    out { out: f64 = 0.0, "integral"; }
}

impl Component for Integ {
    fn update(&mut self, period_s: f64) {
        let next = match self.reset {
            true => 0.0,
            false => self.out + self.gain * self.in_ * period_s,
        };
        if !next.is_nan() {
            self.out = next.min(self.max).max(self.min);
        }
    }
}

component! {
    /// Least and greatest value so far, 0 among them until it is reset.
    Minmax = "minmax";
    in { in_: f64 = 0.0, "number"; reset: bool = false, "begins anew with the number"; }
    out { max: f64 = 0.0, "greatest"; min: f64 = 0.0, "least"; }
}

impl Component for Minmax {
    fn update(&mut self, _: f64) {
        if self.in_.is_nan() {
            return;
        }
        if self.reset {
            (self.min, self.max) = (self.in_, self.in_);
        } else {
            (self.min, self.max) = (self.min.min(self.in_), self.max.max(self.in_));
        }
    }
}

component! {
    /// Cleans the signal of a touch probe: a contact counts after some calls in a row, and is then held for a time.
    ProbeFilter = "probe_filter";
    in {
        in_: bool = false, "probe";
        enable: bool = true, "else the probe is handed on as it is";
        delay: u32 = 2, "calls in a row that a contact, or its end, must last";
        dead_time: f64 = 0.0, "how long nothing changes after a change, s";
    }
    out {
        out: bool = false, "probe, cleaned";
        bounces: u32 = 0, "changes of the probe that did not count";
    }
    state { same: u32 = 0; left_s: f64 = 0.0; edge: Edge = Edge::default(); }
}

impl Component for ProbeFilter {
    fn update(&mut self, period_s: f64) {
        let (rises, falls) = self.edge.see(self.in_);
        self.left_s = (self.left_s - period_s).max(0.0);
        if !self.enable {
            (self.out, self.same, self.left_s) = (self.in_, 0, 0.0);
            return;
        }
        if self.in_ == self.out {
            if (rises || falls) && self.same > 0 {
                self.bounces = self.bounces.wrapping_add(1);
            }
            self.same = 0;
            return;
        }
        self.same = self.same.saturating_add(1);
        // A rest that is rounding is none.
        if self.same >= self.delay && self.left_s <= period_s / 2.0 {
            (self.out, self.same) = (self.in_, 0);
            self.left_s = self.dead_time.max(0.0);
        }
    }
}
