//! Time: edges, pulses, delays, bounces, blinking.

use crate::component::{Component, Options};
use crate::declare::component;
use crate::edge::Edge;
use crate::signals::advanced;

component! {
    /// Pulse at an edge, for one call or a given time.
    EdgePulse = "edge";
    in {
        in_: bool = false, "bit that is watched";
        both: bool = false, "every edge counts";
        in_edge: bool = true, "else: true for falling edges, false for rising ones";
        out_width_ns: i32 = 0, "length of the pulse, ns; one call at least";
    }
    out {
        out: bool = false, "pulse";
        out_invert: bool = true, "not `out`";
        time_left_ns: i32 = 0, "rest of the pulse, ns";
    }
    state { edge: Edge = Edge::default(); }
}

impl Component for EdgePulse {
    fn update(&mut self, period_s: f64) {
        // As an integer, so that a pulse has the same length each time.
        let period_ns = (period_s * 1e9 + 0.5) as i32;
        self.time_left_ns = self.time_left_ns.saturating_sub(period_ns).max(0);
        let (rises, falls) = self.edge.see(self.in_);
        let begins = match (self.both, self.in_edge) {
            (true, _) => rises || falls,
            (false, true) => falls,
            (false, false) => rises,
        };
        if begins {
            self.time_left_ns = self.out_width_ns.max(0);
        }
        self.out = begins || self.time_left_ns > 0;
        self.out_invert = !self.out;
    }
}

component! {
    /// Pulse of a given time at an edge.
    Oneshot = "oneshot";
    in {
        in_: bool = false, "bit that is watched";
        reset: bool = false, "no pulse, and no edge is seen; behind it, what is true has risen";
        width: f64 = 0.0, "length of the pulse, s";
        retriggerable: bool = true, "an edge in the pulse begins it anew";
        rising: bool = true, "rising edges count";
        falling: bool = false, "falling edges count";
    }
    out {
        out: bool = false, "pulse";
        out_not: bool = true, "not `out`";
        time_left: f64 = 0.0, "rest of the pulse, s";
    }
    state { edge: Edge = Edge::default(); }
}

impl Component for Oneshot {
    fn update(&mut self, period_s: f64) {
        if self.reset {
            self.time_left = 0.0;
            self.edge.see(false);
        } else {
            let (rises, falls) = self.edge.see(self.in_);
            let asked = rises && self.rising || falls && self.falling;
            let begins = asked && (self.retriggerable || self.time_left <= 0.0);
            // `max` makes 0 of a width that is no number.
            self.time_left = match begins {
                true => self.width.max(0.0),
                false => (self.time_left - period_s).max(0.0),
            };
        }
        self.out = self.time_left > 0.0;
        self.out_not = !self.out;
    }
}

component! {
    /// Relay with delays: the output follows once the input has differed for so long.
    Timedelay = "timedelay";
    in {
        in_: bool = false, "bit to follow";
        on_delay: f64 = 0.5, "delay until true, s";
        off_delay: f64 = 0.5, "delay until false, s";
    }
    out { out: bool = false, "the delayed bit"; elapsed: f64 = 0.0, "how long they differ, or last differed, s"; }
    state { timer_s: f64 = 0.0; }
}

impl Component for Timedelay {
    fn update(&mut self, period_s: f64) {
        if self.in_ == self.out {
            self.timer_s = 0.0;
            return;
        }
        self.timer_s += period_s;
        self.elapsed = self.timer_s;
        let delay_s = if self.in_ { self.on_delay } else { self.off_delay };
        if self.timer_s >= delay_s {
            self.out = self.in_;
            self.timer_s = 0.0;
        }
    }
}

component! {
    /// On-delay timer: `q` once `in` has been true for `pt`.
    Ton = "ton";
    in { in_: bool = false, "starts and holds the time"; pt: f64 = 0.0, "delay, s"; }
    out { q: bool = false, "the delay is over and `in` still true"; et: f64 = 0.0, "time so far, up to the call that reaches `pt`, s"; }
}

impl Component for Ton {
    fn update(&mut self, period_s: f64) {
        if !self.in_ {
            (self.q, self.et) = (false, 0.0);
        } else if self.et < self.pt {
            self.et += period_s;
        } else {
            // A time that is no number is none.
            self.q = true;
        }
    }
}

component! {
    /// Off-delay timer: `q` until `in` has been false for `pt`.
    Tof = "tof";
    in { in_: bool = false, "sets at once, and stops the time"; pt: f64 = 0.0, "delay, s"; }
    out { q: bool = false, "`in` is true, or was so within the delay"; et: f64 = 0.0, "time since it fell, up to the call that reaches `pt`, s"; }
}

impl Component for Tof {
    fn update(&mut self, period_s: f64) {
        if self.in_ {
            (self.q, self.et) = (true, 0.0);
        } else if self.et < self.pt {
            self.et += period_s;
        } else {
            self.q = false;
        }
    }
}

/// Counts up while the input is true, down while it is false, and follows in the call behind the end. RT.
#[derive(Clone, Copy, Debug, Default)]
struct Bounce(u32);

impl Bounce {
    fn filter(&mut self, now: bool, delay: u32, out: &mut bool) {
        match now {
            true if self.0 < delay => self.0 += 1,
            true => (self.0, *out) = (delay, true),
            false if self.0 > 0 => self.0 = self.0.min(delay) - u32::from(delay > 0),
            false => *out = false,
        }
    }
}

component! {
    /// Follows a switch once it has stopped bouncing.
    Dbounce = "dbounce";
    in { in_: bool = false, "switch"; delay: u32 = 5, "calls that it must be the same, less those that it was not"; }
    out { out: bool = false, "switch without bounces"; }
    state { bounce: Bounce = Bounce::default(); }
}

impl Component for Dbounce {
    fn update(&mut self, _: f64) {
        self.bounce.filter(self.in_, self.delay, &mut self.out);
    }
}

component! {
    /// Follows several switches once they have stopped bouncing.
    Debounce = "debounce";
    options { cfg: 1, 1..=32, [], "number of switches"; }
    in {
        in_ as "#.in": Vec<bool> = vec![false; 1], "switch";
        delay: i32 = 5, "calls that each must be the same, less those that it was not";
    }
    out { out as "#.out": Vec<bool> = vec![false; 1], "switch without bounces"; }
    state { bounces: Vec<Bounce> = vec![Bounce::default(); 1]; }
}

impl Component for Debounce {
    fn shape(&mut self, options: &Options<'_>) {
        let count = options.count("cfg");
        (self.in_, self.out) = (vec![false; count], vec![false; count]);
        self.bounces = vec![Bounce::default(); count];
    }

    fn update(&mut self, _: f64) {
        let delay = self.delay.max(0).unsigned_abs();
        for ((bounce, now), out) in self.bounces.iter_mut().zip(&self.in_).zip(&mut self.out) {
            bounce.filter(*now, delay, out);
        }
    }
}

component! {
    /// Push on, push off: changes at each press of a key.
    Toggle = "toggle";
    in { in_: bool = false, "key"; debounce: u32 = 2, "calls that a press must last; 1 to 10000, else 2"; }
    out { out: bool = false, "changes at each press"; }
    state { count: u32 = 0; pressed: bool = false; known: bool = false; }
}

impl Component for Toggle {
    fn update(&mut self, _: f64) {
        let debounce = if (1..=10_000).contains(&self.debounce) {
            self.debounce
        } else {
            2
        };
        // A key that is held at the start was pressed before.
        if !std::mem::replace(&mut self.known, true) && self.in_ {
            (self.count, self.pressed) = (debounce, true);
        }
        if self.in_ {
            self.count = (self.count + 1).min(debounce);
            if self.count == debounce && !std::mem::replace(&mut self.pressed, true) {
                self.out = !self.out;
            }
        } else {
            self.count = self.count.saturating_sub(1);
            self.pressed &= self.count > 0;
        }
    }
}

component! {
    /// Blinks a lamp.
    Blink = "blink";
    in {
        enable: bool = true, "blinks; else off";
        frequency: f64 = 1.0, "flashes a second, Hz; half the rate of calls at most, 0 for steady light";
        duty: f64 = 0.5, "part of the time that it is lit, 0 to 1";
    }
    out { out: bool = false, "lamp"; }
    state { phase: f64 = 0.0; }
}

impl Component for Blink {
    fn update(&mut self, period_s: f64) {
        if !self.enable {
            (self.out, self.phase) = (false, 0.0);
            return;
        }
        self.out = self.phase < self.duty || self.frequency == 0.0;
        self.phase = advanced(self.phase, self.frequency, period_s);
    }
}

component! {
    /// Clock for a charge pump, the proof that the cycle runs: changes with every call.
    ChargePump = "charge_pump";
    in { enable: bool = true, "runs; else all outputs are off"; }
    out {
        out: bool = false, "square wave of half the rate of calls";
        out_2: bool = false, "half as fast";
        out_4: bool = false, "a quarter as fast";
    }
    state { count: u32 = 0; }
}

impl Component for ChargePump {
    fn update(&mut self, _: f64) {
        self.count = self.count.wrapping_add(u32::from(self.enable));
        let bit = |number: u32| self.enable && self.count >> number & 1 != 0;
        (self.out, self.out_2, self.out_4) = (bit(0), bit(1), bit(2));
    }
}

component! {
    /// Running time in hours, minutes and seconds; counts while started, from 0 at each start, and rests in a pause.
    Time = "time";
    in { start: bool = false, "counts"; pause: bool = false, "rests, and goes on from there"; }
    out {
        seconds: u32 = 0, "0 to 59, s";
        minutes: u32 = 0, "0 to 59, min";
        hours: u32 = 0, "h";
    }
    state { ran: bool = false; total_ns: u64 = 0; }
}

impl Component for Time {
    fn update(&mut self, period_s: f64) {
        let runs = self.start || self.pause;
        if runs && !std::mem::replace(&mut self.ran, runs) {
            self.total_ns = 0;
        }
        self.ran = runs;
        if self.start && !self.pause {
            self.total_ns = self.total_ns.saturating_add((period_s * 1e9 + 0.5) as u64);
            let total_s = self.total_ns / 1_000_000_000;
            self.seconds = (total_s % 60) as u32;
            self.minutes = (total_s / 60 % 60) as u32;
            self.hours = u32::try_from(total_s / 3600).unwrap_or(u32::MAX);
        }
    }
}

component! {
    /// Whether a message is to be shown, for a text of a program (docs/logic.md) or a lamp.
    Message = "message";
    in {
        trigger: bool = false, "what the message is about";
        force: bool = false, "shows it once more as it rises";
        edge: bool = true, "it is due while `trigger` is true; false: while it is false";
    }
    out {
        show: bool = false, "it is due; for 0.1 s behind a rise of `force` it is not, so that its text comes anew";
        count: u32 = 0, "times that it has become due, or was forced";
    }
    state { is_due: bool = false; forced: Edge = Edge::default(); rest_s: f64 = 0.0; }
}

impl Component for Message {
    fn update(&mut self, period_s: f64) {
        const REST_S: f64 = 0.1;
        let is_due = self.trigger == self.edge;
        let becomes_due = !std::mem::replace(&mut self.is_due, is_due) && is_due;
        let is_forced = self.forced.rises(self.force) && is_due;
        self.count = self.count.wrapping_add((becomes_due || is_forced).into());
        self.rest_s = match is_forced && !becomes_due {
            true => REST_S,
            false => (self.rest_s - period_s).max(0.0),
        };
        self.show = is_due && self.rest_s < period_s / 2.0;
    }
}
