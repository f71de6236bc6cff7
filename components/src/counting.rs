//! Counting: keys, pulses, encoders, knobs. Pulses are seen once a call, so none may be shorter.

use crate::component::Component;
use crate::declare::component;
use crate::edge::Edge;

component! {
    /// Counts up and down at rising edges, with limits or round and round.
    Updown = "updown";
    in {
        countup: bool = false, "counts up as it rises";
        countdown: bool = false, "counts down as it rises";
        reset: bool = false, "to 0 while true";
        clamp: bool = false, "stops at `min` and `max`";
        wrap: bool = false, "goes from `max` to `min` and back; beats `clamp`";
        max: i32 = i32::MAX, "greatest count";
        min: i32 = 0, "least count";
    }
    out { count: i32 = 0, "count"; }
    state { up: Edge = Edge::default(); down: Edge = Edge::default(); }
}

impl Component for Updown {
    fn update(&mut self, _: f64) {
        let step = i32::from(self.up.rises(self.countup)) - i32::from(self.down.rises(self.countdown));
        let count = if self.reset {
            0
        } else {
            i64::from(self.count) + i64::from(step)
        };
        let (min, max) = (i64::from(self.min), i64::from(self.max));
        let (above, below) = if self.wrap { (min, max) } else { (max, min) };
        let count = match self.wrap || self.clamp {
            true if count > max => above,
            true if count < min => below,
            _ => count,
        };
        self.count = count as i32;
    }
}

/// Speed from the time between counts. Between counts it is at most that of a count now. RT.
#[derive(Clone, Copy, Debug, Default)]
struct Speed {
    since_s: f64,
    counts_s: f64,
    /// Sign of the last count.
    direction: i32,
}

impl Speed {
    fn see(&mut self, counts: i32, least_counts_s: f64, period_s: f64) {
        self.since_s += period_s;
        if counts != 0 {
            // Back and forth over one edge is rest.
            let goes_on = std::mem::replace(&mut self.direction, counts.signum()) == counts.signum();
            self.counts_s = if goes_on { f64::from(counts) / self.since_s } else { 0.0 };
            self.since_s = 0.0;
        } else if self.counts_s != 0.0 {
            let most = 1.0 / self.since_s;
            if most < least_counts_s {
                self.counts_s = 0.0;
            } else {
                self.counts_s = self.counts_s.clamp(-most, most);
            }
        }
    }

    /// Counts since the last one.
    fn ahead(&self) -> f64 {
        (self.counts_s * self.since_s).clamp(-1.0, 1.0)
    }
}

/// A scale that can be divided by. RT.
fn divisor(scale: f64) -> f64 {
    if scale == 0.0 || !scale.is_finite() { 1.0 } else { scale }
}

component! {
    /// Counts pulses of one phase.
    Counter = "counter";
    in {
        phase_a: bool = false, "pulses; rising edges count";
        phase_z: bool = false, "index";
        index_enable: bool = false, "counts are 0 at the next index";
        reset: bool = false, "counts are 0 while true";
        position_scale: f64 = 1.0, "counts a unit; 0 as 1";
    }
    out {
        rawcounts: i32 = 0, "all counts since the start";
        counts: i32 = 0, "counts since the reset or index";
        position: f64 = 0.0, "`counts / position-scale`";
        velocity: f64 = 0.0, "units/s";
        indexed: bool = false, "the index has been met; until `index-enable` falls";
    }
    state { edge_a: Edge = Edge::default(); edge_z: Edge = Edge::default(); zero: i32 = 0; speed: Speed = Speed::default(); }
}

impl Component for Counter {
    fn update(&mut self, period_s: f64) {
        let step = i32::from(self.edge_a.rises(self.phase_a));
        self.rawcounts = self.rawcounts.wrapping_add(step);
        let at_index = self.edge_z.rises(self.phase_z) && self.index_enable && !self.indexed;
        self.indexed = self.index_enable && (self.indexed || at_index);
        if at_index || self.reset {
            self.zero = self.rawcounts;
        }
        self.counts = self.rawcounts.wrapping_sub(self.zero);
        self.speed.see(step, 0.0, period_s);
        let scale = divisor(self.position_scale);
        self.position = f64::from(self.counts) / scale;
        self.velocity = self.speed.counts_s / scale;
    }
}

component! {
    /// Counts a quadrature encoder.
    Encoder = "encoder";
    in {
        phase_a: bool = false, "first phase";
        phase_b: bool = false, "second phase; counts up where it follows the first";
        phase_z: bool = false, "index";
        index_enable: bool = false, "counts are 0 at the next index";
        reset: bool = false, "counts are 0 while true";
        x4_mode: bool = true, "every edge counts; else one of four";
        counter_mode: bool = false, "rising edges of `phase-a` count up, `phase-b` is not read";
        position_scale: f64 = 1.0, "counts a unit; 0 as 1";
        min_speed_estimate: f64 = 1.0, "a lower speed is shown as 0, units/s";
        latch_input: bool = false, "keeps the counts at its edges";
        latch_rising: bool = true, "at rising edges";
        latch_falling: bool = true, "at falling edges";
    }
    out {
        rawcounts: i32 = 0, "all counts since the start";
        counts: i32 = 0, "counts since the reset or index";
        position: f64 = 0.0, "`counts / position-scale`";
        position_interpolated: f64 = 0.0, "the same, between counts as well, by the speed";
        velocity: f64 = 0.0, "units/s, from the time between counts";
        velocity_rpm: f64 = 0.0, "the same a minute";
        counts_latched: i32 = 0, "counts at the last edge of `latch-input`";
        position_latched: f64 = 0.0, "position there";
        indexed: bool = false, "the index has been met; until `index-enable` falls";
    }
    state { phase: Option<i32> = None; edge_a: Edge = Edge::default(); edge_z: Edge = Edge::default(); latch: Edge = Edge::default(); zero: i32 = 0; quarters: i32 = 0; speed: Speed = Speed::default(); }
}

impl Encoder {
    /// Counts of this call. RT.
    fn step(&mut self) -> i32 {
        let rises = self.edge_a.rises(self.phase_a);
        // Gray code to a place on the circle of four.
        let phase = 2 * i32::from(self.phase_b) + i32::from(self.phase_a != self.phase_b);
        let before = self.phase.replace(phase).unwrap_or(phase);
        if self.counter_mode {
            return i32::from(rises);
        }
        // Two places on is a lost edge of unknown direction: it counts nothing.
        let quarter = match (phase - before) & 3 {
            1 => 1,
            3 => -1,
            _ => 0,
        };
        let quarters = self.quarters.wrapping_add(quarter);
        let whole = quarters.div_euclid(4).wrapping_sub(self.quarters.div_euclid(4));
        self.quarters = quarters;
        if self.x4_mode { quarter } else { whole }
    }
}

impl Component for Encoder {
    fn update(&mut self, period_s: f64) {
        let step = self.step();
        self.rawcounts = self.rawcounts.wrapping_add(step);
        let at_index = self.edge_z.rises(self.phase_z) && self.index_enable && !self.indexed;
        self.indexed = self.index_enable && (self.indexed || at_index);
        if at_index || self.reset {
            self.zero = self.rawcounts;
        }
        self.counts = self.rawcounts.wrapping_sub(self.zero);
        let scale = divisor(self.position_scale);
        self.speed.see(step, self.min_speed_estimate * scale.abs(), period_s);
        self.position = f64::from(self.counts) / scale;
        self.position_interpolated = self.position + self.speed.ahead() / scale;
        self.velocity = self.speed.counts_s / scale;
        self.velocity_rpm = self.velocity * 60.0;
        let (rises, falls) = self.latch.see(self.latch_input);
        if rises && self.latch_rising || falls && self.latch_falling {
            (self.counts_latched, self.position_latched) = (self.counts, self.position);
        }
    }
}

component! {
    /// A value that is turned by a knob with an encoder.
    Knob2float = "knob2float";
    in {
        counts: i32 = 0, "counts of the knob";
        enable: bool = false, "the knob turns the value";
        scale: f64 = 0.0, "change of the value a count";
        max_out: f64 = 1.0, "greatest value";
        min_out: f64 = 0.0, "least value";
    }
    out { out: f64 = 0.0, "value"; }
    state { before: Option<i32> = None; }
}

impl Component for Knob2float {
    fn update(&mut self, _: f64) {
        let turned = self
            .counts
            .wrapping_sub(self.before.replace(self.counts).unwrap_or(self.counts));
        let next = self.out + f64::from(turned) * self.scale;
        if self.enable && !next.is_nan() {
            self.out = next.max(self.min_out).min(self.max_out);
        }
    }
}

component! {
    /// Hand wheel for several axes: gives its counts to the axis that a switch names, at the step that another one names.
    HandWheel = "hand_wheel";
    options { personality: 3, 1..=9, [], "number of axes"; }
    in {
        counts: i32 = 0, "counts of the wheel";
        enable: bool = false, "the wheel acts, such as the key at its side";
        axis: i32 = -1, "number of the axis, below 0: none";
        step: u32 = 0, "number of the step";
        step_size as "step-size-#": [f64; 4] = [0.001, 0.01, 0.1, 1.0], "way a count, mm or degrees";
    }
    out {
        jog_counts: i32 = 0, "counts for all `axis.L.jog-counts`";
        jog_scale: f64 = 0.0, "way a count for all `axis.L.jog-scale`; the first step where the number is outside";
        jog_enable as "jog-enable-#": Vec<bool> = vec![false; 3], "for `axis.L.jog-enable` of an axis; off for a call at each change of axis or step";
    }
    state { before: Option<(i32, u32)> = None; }
}

impl Component for HandWheel {
    fn shape(&mut self, options: &crate::component::Options<'_>) {
        self.jog_enable = vec![false; options.count("personality")];
    }

    fn update(&mut self, _: f64) {
        let choice = (self.axis, self.step);
        let is_settled = self.before.replace(choice) == Some(choice);
        let sizes = &self.step_size;
        let size = sizes.get(self.step as usize).or(sizes.first());
        self.jog_scale = size.copied().filter(|size| size.is_finite()).unwrap_or(0.0);
        self.jog_counts = self.counts;
        for (number, enable) in (0..).zip(&mut self.jog_enable) {
            *enable = self.enable && is_settled && self.axis == number;
        }
    }
}
