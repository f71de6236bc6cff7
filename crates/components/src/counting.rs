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

/// Speed from the time between counts. It is known from the third count on; between counts it is at most that of a count now.
#[derive(Clone, Copy, Debug, Default)]
struct Speed {
    /// From the last count to this call.
    since_s: f64,
    counts_s: f64,
    /// Counts since it rested, up to 2.
    seen: u8,
}

impl Speed {
    /// One call, in which there were counts or none. `holds`: what it was counts on. RT.
    fn see(&mut self, counts: Option<i32>, least_counts_s: f64, holds: bool, period_s: f64) {
        self.since_s += period_s;
        if let Some(counts) = counts {
            match self.seen {
                2.. => self.counts_s = f64::from(counts) / self.since_s,
                _ => self.seen += 1,
            }
            self.since_s = 0.0;
        } else if self.seen > 0 && !holds {
            let most = 1.0 / (self.since_s + period_s);
            if most > least_counts_s {
                self.counts_s = self.counts_s.clamp(-most, most);
            } else {
                // So slow a count tells no speed, nor does the next one that comes so late.
                (self.counts_s, self.seen) = (0.0, 0);
            }
        }
    }

    /// Counts since the last one, by the end of this call.
    fn ahead(&self, period_s: f64) -> f64 {
        self.counts_s * (self.since_s + period_s)
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
        index_enable: bool = false, "counts are 0 at the next index behind this call";
        reset: bool = false, "counts are 0 while true";
        position_scale: f64 = 1.0, "counts a unit; 0 as 1";
    }
    out {
        rawcounts: i32 = 0, "all counts since the reset";
        counts: i32 = 0, "counts since the reset or index";
        position: f64 = 0.0, "`counts / position-scale`";
        velocity: f64 = 0.0, "counts of this call by its period, units/s";
        indexed: bool = false, "the index has been met; until `index-enable` falls";
    }
    state { edge_a: Edge = Edge::default(); edge_z: Edge = Edge::default(); index_armed: bool = false; zero: i32 = 0; }
}

impl Component for Counter {
    fn update(&mut self, period_s: f64) {
        let rises = self.edge_a.rises(self.phase_a);
        self.rawcounts = self.rawcounts.wrapping_add(i32::from(rises));
        let at_index = self.edge_z.rises(self.phase_z) && self.index_armed;
        self.indexed = self.index_enable && (self.indexed || at_index);
        self.index_armed = self.index_enable && !self.indexed;
        if at_index {
            self.zero = self.rawcounts;
        }
        if self.reset {
            (self.rawcounts, self.zero) = (0, 0);
        }
        self.counts = self.rawcounts.wrapping_sub(self.zero);
        let scale = divisor(self.position_scale);
        self.position = f64::from(self.counts) / scale;
        let counted = f64::from(u8::from(rises && !self.reset));
        self.velocity = counted / scale / period_s;
    }
}

component! {
    /// Counts a quadrature encoder.
    Encoder = "encoder";
    in {
        phase_a: bool = false, "first phase";
        phase_b: bool = false, "second phase; counts up where it follows the first";
        phase_z: bool = false, "index";
        index_enable: bool = false, "counts are 0 at the next index behind this call";
        reset: bool = false, "counts are 0 while true";
        x4_mode: bool = true, "every edge counts; else those of `phase-a` while `phase-b` is false: up as it rises, down as it falls";
        counter_mode: bool = false, "rising edges of `phase-a` count up, `phase-b` is not read";
        position_scale: f64 = 1.0, "counts a unit; 0 as 1";
        min_speed_estimate: f64 = 1.0, "a lower speed is shown as 0, units/s; 0 as 1";
        latch_input: bool = false, "keeps the counts at its edges";
        latch_rising: bool = true, "at rising edges";
        latch_falling: bool = true, "at falling edges";
        missing_teeth: i32 = 0, "teeth that the gap of a toothed wheel has too few: they count, and the count behind the gap is an index; 0: no gap";
    }
    out {
        rawcounts: i32 = 0, "all counts since the start";
        counts: i32 = 0, "counts since the reset or index";
        position: f64 = 0.0, "`counts / position-scale`";
        position_interpolated: f64 = 0.0, "the same, between counts as well, by the speed";
        velocity: f64 = 0.0, "units/s, from the time between counts";
        velocity_rpm: f64 = 0.0, "the same a minute";
        counts_latched: i32 = 0, "counts at the last edge of `latch-input`, from the reset or index of now";
        position_latched: f64 = 0.0, "position there";
        indexed: bool = false, "the index has been met; until `index-enable` falls";
    }
    state {
        phase: Option<i32> = None; edge_a: Edge = Edge::default(); edge_z: Edge = Edge::default(); latch: Edge = Edge::default();
        index_armed: bool = false; zero: i32 = 0; latched: i32 = 0; speed: Speed = Speed::default(); gap_s: f64 = 0.0;
    }
}

impl Encoder {
    /// Counts of this call. RT.
    fn step(&mut self) -> i32 {
        let rises = self.edge_a.rises(self.phase_a);
        // Gray code to a place on the circle of four: 0 both false, 1 `phase-a` alone, 2 both, 3 `phase-b` alone.
        let phase = 2 * i32::from(self.phase_b) + i32::from(self.phase_a != self.phase_b);
        let before = self.phase.replace(phase).unwrap_or(phase);
        if self.counter_mode {
            return i32::from(rises);
        }
        match (self.x4_mode, before, phase) {
            (true, ..) => match (phase - before) & 3 {
                1 => 1,
                3 => -1,
                // Two places on is a lost edge of unknown direction: it counts nothing.
                _ => 0,
            },
            (false, 0, 1) => 1,
            (false, 1, 0) => -1,
            (false, ..) => 0,
        }
    }

    /// Teeth that are missing before this count: it comes late by the time between those before. RT.
    fn teeth_missed(&mut self, step: i32, period_s: f64) -> i32 {
        let missing = self.missing_teeth.max(0);
        let since_s = self.speed.since_s + period_s;
        // Half a tooth beyond those that are missing is late.
        let limit_s = (f64::from(missing) + 0.5) * self.gap_s;
        let is_gap = missing > 0 && step > 0 && self.gap_s > 0.0 && since_s > limit_s;
        let missed = if is_gap { missing } else { 0 };
        if missing > 0 && step > 0 && self.speed.seen > 0 {
            let tooth_s = since_s / (f64::from(step) + f64::from(missed));
            self.gap_s = match self.gap_s > 0.0 {
                true => 0.9 * self.gap_s + 0.1 * tooth_s,
                false => tooth_s,
            };
        }
        missed
    }
}

impl Component for Encoder {
    fn update(&mut self, period_s: f64) {
        let step = self.step();
        let missed = self.teeth_missed(step, period_s);
        let counted = step.wrapping_add(missed);
        self.rawcounts = self.rawcounts.wrapping_add(counted);
        let index = self.edge_z.rises(self.phase_z || missed > 0);
        let at_index = index && self.index_armed;
        self.indexed = self.index_enable && (self.indexed || at_index);
        self.index_armed = self.index_enable && !self.indexed;
        let (rises, falls) = self.latch.see(self.latch_input);
        if rises && self.latch_rising || falls && self.latch_falling {
            self.latched = self.rawcounts;
        }
        if at_index || self.reset {
            self.zero = self.rawcounts;
        }
        self.counts = self.rawcounts.wrapping_sub(self.zero);
        self.counts_latched = self.latched.wrapping_sub(self.zero);
        let scale = divisor(self.position_scale);
        let least = if self.min_speed_estimate == 0.0 {
            1.0
        } else {
            self.min_speed_estimate.abs()
        };
        // A gap is no reason to be slower.
        let holds = self.missing_teeth > 0 && self.speed.since_s < (f64::from(self.missing_teeth) + 1.0) * self.gap_s;
        let counts = (step != 0).then_some(if self.reset { 0 } else { counted });
        self.speed.see(counts, least * scale.abs(), holds, period_s);
        self.position = f64::from(self.counts) / scale;
        self.position_latched = f64::from(self.counts_latched) / scale;
        self.position_interpolated = self.position + self.speed.ahead(period_s) / scale;
        self.velocity = self.speed.counts_s / scale;
        self.velocity_rpm = self.velocity * 60.0;
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

component! {
    /// Phases and index of a simulated encoder: one edge a call at most.
    SimEncoder = "sim_encoder";
    in {
        speed: f64 = 0.0, "speed, in the unit of `scale`; counts from the next call on";
        ppr: u32 = 100, "pulses a turn, of four counts each";
        scale: f64 = 1.0, "units of `speed` for a turn a second; 60 for rpm, 0 as 1";
    }
    out {
        phase_a: bool = false, "first phase";
        phase_b: bool = false, "second phase, which follows the first one forward";
        phase_z: bool = false, "index, as long as the first quarter of the first pulse";
        rawcounts: i32 = 0, "counts since the start";
    }
    state { counts_a_call: f64 = 0.0; part: f64 = 0.0; place: u32 = 0; }
}

impl Component for SimEncoder {
    fn update(&mut self, period_s: f64) {
        // Counts that are owed: one is given as soon as it is whole.
        self.part += self.counts_a_call;
        let step = if self.part >= 1.0 {
            1
        } else {
            -i32::from(self.part < 0.0)
        };
        self.part -= f64::from(step);
        self.rawcounts = self.rawcounts.wrapping_add(step);
        let turn = self.ppr.clamp(1, 1 << 29) * 4;
        let next = (i64::from(self.place) + i64::from(step)).rem_euclid(i64::from(turn));
        self.place = next as u32;
        self.phase_a = matches!(next % 4, 0 | 1);
        self.phase_b = matches!(next % 4, 1 | 2);
        self.phase_z = next == 0;
        let counts_a_call = self.speed / divisor(self.scale) * f64::from(turn) * period_s;
        self.counts_a_call = if counts_a_call.is_nan() {
            0.0
        } else {
            counts_a_call.clamp(-1.0, 1.0)
        };
    }
}
