//! Arithmetic: sums, products, curves. A value that is no number is handed on.

use crate::component::{Component, Options};
use crate::declare::component;

component! {
    /// A number that a net can read.
    Constant = "constant";
    in { value: f64 = 0.0, "number"; }
    out { out: f64 = 0.0, "`value`"; }
}

impl Component for Constant {
    fn update(&mut self, _: f64) {
        self.out = self.value;
    }
}

component! {
    /// Sum of two numbers, each with its gain, and an offset.
    Sum2 = "sum2";
    in {
        in0: f64 = 0.0, "one operand";
        in1: f64 = 0.0, "the other";
        gain0: f64 = 1.0, "gain of `in0`";
        gain1: f64 = 1.0, "gain of `in1`";
        offset: f64 = 0.0, "is added";
    }
    out { out: f64 = 0.0, "`in0 * gain0 + in1 * gain1 + offset`"; }
}

impl Component for Sum2 {
    fn update(&mut self, _: f64) {
        self.out = self.in0 * self.gain0 + self.in1 * self.gain1 + self.offset;
    }
}

component! {
    /// Product of two numbers.
    Mult2 = "mult2";
    in { in0: f64 = 0.0, "one operand"; in1: f64 = 0.0, "the other"; }
    out { out: f64 = 0.0, "`in0 * in1`"; }
}

impl Component for Mult2 {
    fn update(&mut self, _: f64) {
        self.out = self.in0 * self.in1;
    }
}

component! {
    /// Quotient of two numbers.
    Div2 = "div2";
    in {
        in0: f64 = 0.0, "dividend";
        in1: f64 = 0.0, "divisor";
        deadband: f64 = 0.0, "a divisor nearer to 0 is taken as this, with its sign; 1e-12 at least";
    }
    out { out: f64 = 0.0, "`in0 / in1`"; }
}

impl Component for Div2 {
    fn update(&mut self, _: f64) {
        let least = self.deadband.max(1e-12);
        let divisor = match self.in1 {
            near if near.abs() < least && near < 0.0 => -least,
            near if near.abs() < least => least,
            divisor => divisor,
        };
        self.out = self.in0 / divisor;
    }
}

component! {
    /// Reciprocal of a number.
    Invert = "invert";
    in { in_: f64 = 0.0, "operand"; deadband: f64 = 0.0, "a number nearer to 0, or 0 itself, gives 0"; }
    out { out: f64 = 0.0, "`1 / in`"; }
}

impl Component for Invert {
    fn update(&mut self, _: f64) {
        let is_near_0 = self.in_ == 0.0 || self.in_.abs() < self.deadband;
        self.out = if is_near_0 { 0.0 } else { 1.0 / self.in_ };
    }
}

component! {
    /// Absolute value and sign.
    Abs = "abs";
    in { in_: f64 = 0.0, "operand"; }
    out {
        out: f64 = 0.0, "its absolute value";
        sign: bool = false, "it is below 0";
        is_positive: bool = false, "it is above 0";
        is_negative: bool = false, "it is below 0";
    }
}

impl Component for Abs {
    fn update(&mut self, _: f64) {
        self.out = self.in_.abs();
        self.is_negative = self.in_ < 0.0;
        self.is_positive = self.in_ > 0.0;
        self.sign = self.is_negative;
    }
}

component! {
    /// Absolute value and sign of an integer.
    AbsS32 = "abs_s32";
    in { in_: i32 = 0, "operand"; }
    out {
        out: i32 = 0, "its absolute value, within the range of its type";
        sign: bool = false, "it is below 0";
        is_positive: bool = false, "it is above 0";
        is_negative: bool = false, "it is below 0";
    }
}

impl Component for AbsS32 {
    fn update(&mut self, _: f64) {
        self.out = self.in_.saturating_abs();
        self.is_negative = self.in_ < 0;
        self.is_positive = self.in_ > 0;
        self.sign = self.is_negative;
    }
}

component! {
    /// Length of a vector.
    Hypot = "hypot";
    in { in0: f64 = 0.0, "a component"; in1: f64 = 0.0, "a component"; in2: f64 = 0.0, "a component"; }
    out { out: f64 = 0.0, "root of the sum of their squares"; }
}

impl Component for Hypot {
    fn update(&mut self, _: f64) {
        self.out = (self.in0 * self.in0 + self.in1 * self.in1 + self.in2 * self.in2).sqrt();
    }
}

component! {
    /// Gain and offset. The gain is 0 until it is set.
    Scale = "scale";
    in { in_: f64 = 0.0, "operand"; gain: f64 = 0.0, "gain"; offset: f64 = 0.0, "is added"; }
    out { out: f64 = 0.0, "`in * gain + offset`"; }
}

impl Component for Scale {
    fn update(&mut self, _: f64) {
        self.out = self.in_ * self.gain + self.offset;
    }
}

component! {
    /// Adds an offset to a command and takes it from the feedback, both in one call.
    Offset = "offset";
    in {
        offset: f64 = 0.0, "offset";
        in_: f64 = 0.0, "command";
        fb_in: f64 = 0.0, "feedback";
    }
    out { out: f64 = 0.0, "`in + offset`"; fb_out: f64 = 0.0, "`fb-in - offset`"; }
}

impl Component for Offset {
    fn update(&mut self, _: f64) {
        self.out = self.in_ + self.offset;
        self.fb_out = self.fb_in - self.offset;
    }
}

component! {
    /// Sum of the weights of those bits that are set.
    WeightedSum = "weighted_sum";
    options { personality: 4, 1..=32, [], "number of bits"; }
    in {
        bit as "bit.#.in": Vec<bool> = vec![false; 4], "its weight counts";
        weight as "bit.#.weight": Vec<i32> = vec![0; 4], "weight";
        offset: i32 = 0, "is added";
        hold: bool = false, "keeps the sum";
    }
    out { sum: i32 = 0, "sum, wrapping around"; }
}

impl Component for WeightedSum {
    fn shape(&mut self, options: &Options<'_>) {
        let count = options.count("personality");
        self.bit = vec![false; count];
        // As in LinuxCNC: the bits of a number.
        self.weight = (0..count as u32).map(|bit| 1i32.wrapping_shl(bit)).collect();
    }

    fn update(&mut self, _: f64) {
        if !self.hold {
            let set = self.bit.iter().zip(&self.weight).filter(|(bit, _)| **bit);
            self.sum = set.fold(self.offset, |sum, (_, weight)| sum.wrapping_add(*weight));
        }
    }
}

component! {
    /// Sum of integers, each with its scale.
    ScaledS32Sums = "scaled_s32_sums";
    in {
        in_ as "in#": [i32; 4] = [0; 4], "operand";
        scale as "scale#": [f64; 4] = [1.0; 4], "its scale";
    }
    out { out_f: f64 = 0.0, "sum"; out_s: i32 = 0, "sum without its fraction, within the range of its type"; }
}

impl Component for ScaledS32Sums {
    fn update(&mut self, _: f64) {
        let parts = self.in_.iter().zip(&self.scale);
        self.out_f = parts.map(|(value, scale)| f64::from(*value) * scale).sum();
        self.out_s = self.out_f as i32;
    }
}

component! {
    /// From one number to another, linearly.
    Blend = "blend";
    in {
        in1: f64 = 0.0, "number at `select` 1";
        in2: f64 = 0.0, "number at `select` 0";
        select: f64 = 0.0, "where between them";
        open: bool = false, "goes on outside of 0 to 1";
    }
    out { out: f64 = 0.0, "number between them"; }
}

impl Component for Blend {
    fn update(&mut self, _: f64) {
        let select = if self.open {
            self.select
        } else {
            self.select.clamp(0.0, 1.0)
        };
        self.out = self.in1 * select + self.in2 * (1.0 - select);
    }
}

component! {
    /// In proportion to speed: what depends on the feed, like the power of a laser.
    Feedcomp = "feedcomp";
    in {
        in_: f64 = 0.0, "value at the reference speed";
        enable: bool = false, "compensates; else hands it on";
        vel: f64 = 0.0, "speed now";
        feed: f64 = 0.0, "reference speed, in the unit of `vel`; 0 gives 0";
    }
    out { out: f64 = 0.0, "`in * vel / feed`"; }
}

impl Component for Feedcomp {
    fn update(&mut self, _: f64) {
        self.out = match (self.enable, self.feed == 0.0) {
            (false, _) => self.in_,
            (true, true) => 0.0,
            (true, false) => self.in_ * (self.vel / self.feed),
        };
    }
}

component! {
    /// Table with straight lines between its points, held outside.
    Lincurve = "lincurve";
    options { personality: 4, 1..=16, [], "number of points"; }
    in {
        in_: f64 = 0.0, "place";
        x_val as "x-val-##": Vec<f64> = vec![0.0; 4], "place of a point, none below that of the point before";
        y_val as "y-val-##": Vec<f64> = vec![0.0; 4], "value there";
    }
    out { out: f64 = 0.0, "value at `in`"; out_io: f64 = 0.0, "the same"; }
}

impl Component for Lincurve {
    fn shape(&mut self, options: &Options<'_>) {
        let count = options.count("personality");
        (self.x_val, self.y_val) = (vec![0.0; count], vec![0.0; count]);
    }

    fn update(&mut self, _: f64) {
        self.out = linear(&self.x_val, &self.y_val, self.in_);
        self.out_io = self.out;
    }
}

/// Value of a table at a place. Where it steps, at a place that two points have, that of the first one. RT.
fn linear(x: &[f64], y: &[f64], at: f64) -> f64 {
    let (Some(end), Some(first), Some(last)) = (x.last(), y.first(), y.last()) else {
        return 0.0;
    };
    if at.is_nan() {
        return at;
    }
    if at >= *end {
        return *last;
    }
    let Some(above) = x.iter().position(|x| at <= *x) else {
        return *last;
    };
    if above == 0 {
        return *first;
    }
    let (x0, x1, y0, y1) = (x[above - 1], x[above], y[above - 1], y[above]);
    match x1 > x0 {
        true => y0 + (y1 - y0) * ((at - x0) / (x1 - x0)),
        false => y1,
    }
}

component! {
    /// Light of a lamp as the eye sees it: brightness to luminance (CIE 1931).
    LedDim = "led_dim";
    in { in_: f64 = 0.0, "brightness, 0 to 1"; }
    out { out: f64 = 0.0, "luminance, 0 to 1"; }
}

impl Component for LedDim {
    fn update(&mut self, _: f64) {
        // L* / 100: the cube law, and a straight line near black.
        let brightness = self.in_.clamp(0.0, 1.0);
        self.out = match brightness <= 0.08 {
            true => brightness / 9.033,
            false => {
                let root = (brightness + 0.16) / 1.16;
                root * root * root
            }
        };
    }
}
