//! Keys: clicks, and devices that are switched by an input for on and another for off.

use crate::component::Component;
use crate::declare::component;

component! {
    /// Tells single, double, triple and quadruple clicks of a key.
    ///
    /// A click is a press of `max-hold-ns` at most; clicks belong together where no more than `max-space-ns` lies between them.
    Multiclick = "multiclick";
    in {
        in_: bool = false, "key, without bounces";
        invert_input: bool = false, "the key is pressed while `in` is false";
        max_hold_ns: u32 = 250_000_000, "longest press of a click, ns";
        max_space_ns: u32 = 250_000_000, "longest time between two clicks, ns";
        output_hold_ns: u32 = 100_000_000, "length of the pulses of outputs, ns";
    }
    out {
        single_click: bool = false, "one click, at once";
        single_click_only: bool = false, "one click, and no other follows";
        double_click: bool = false, "two clicks, at once";
        double_click_only: bool = false, "two clicks, and no other follows";
        triple_click: bool = false, "three clicks, at once";
        triple_click_only: bool = false, "three clicks, and no other follows";
        quadruple_click: bool = false, "four clicks, at once";
        quadruple_click_only: bool = false, "four clicks, and no other follows";
        state: i32 = 0, "0 at rest; odd, 1 to 7: the key is pressed, even, 2 to 8: it was let go; 9 pressed for too long or too often";
    }
    state { timer_ns: u64 = 0; at_once: [Option<u64>; 4] = [None; 4]; only: [Option<u64>; 4] = [None; 4]; }
}

impl Multiclick {
    const REST: i32 = 0;
    /// Where a press behind the fourth click leads, too.
    const TOO_LONG: i32 = 9;

    /// Begins the pulse of an output. RT.
    fn pulse(pulses: &mut [Option<u64>; 4], clicks: i32, length_ns: u32) {
        if let Some(left_ns) = usize::try_from(clicks - 1).ok().and_then(|at| pulses.get_mut(at)) {
            *left_ns = Some(length_ns.into());
        }
    }
}

impl Component for Multiclick {
    fn update(&mut self, period_s: f64) {
        let period_ns = (period_s * 1e9 + 0.5) as u64;
        let is_pressed = self.in_ != self.invert_input;
        for left_ns in self.at_once.iter_mut().chain(&mut self.only) {
            *left_ns = left_ns
                .and_then(|left_ns| left_ns.checked_sub(period_ns))
                .filter(|left_ns| *left_ns > 0);
        }
        self.timer_ns = self.timer_ns.saturating_add(period_ns);
        let was_pressed = self.state % 2 == 1;
        match self.state {
            Self::TOO_LONG if !is_pressed => self.state = Self::REST,
            Self::TOO_LONG => {}
            state if is_pressed != was_pressed => {
                (self.state, self.timer_ns) = (state + 1, 0);
                if was_pressed {
                    Self::pulse(&mut self.at_once, self.state / 2, self.output_hold_ns);
                }
            }
            Self::REST => {}
            state => {
                let most_ns = if was_pressed {
                    self.max_hold_ns
                } else {
                    self.max_space_ns
                };
                match self.timer_ns > most_ns.into() {
                    true if was_pressed => self.state = Self::TOO_LONG,
                    true => {
                        Self::pulse(&mut self.only, state / 2, self.output_hold_ns);
                        self.state = Self::REST;
                    }
                    false => {}
                }
            }
        }
        let [single, double, triple, quadruple] = self.at_once.map(|left_ns| left_ns.is_some());
        (self.single_click, self.double_click) = (single, double);
        (self.triple_click, self.quadruple_click) = (triple, quadruple);
        let [single, double, triple, quadruple] = self.only.map(|left_ns| left_ns.is_some());
        (self.single_click_only, self.double_click_only) = (single, double);
        (self.triple_click_only, self.quadruple_click_only) = (triple, quadruple);
    }
}

/// A key without bounces, and the pulse that it has begun.
#[derive(Clone, Copy, Debug, Default)]
struct OnOff {
    /// The key as it was at the start, or as it has been for long enough since.
    key: Option<bool>,
    /// Calls in which it has been otherwise.
    otherwise: u32,
    /// `on` or `off` is true.
    pulse: Option<bool>,
    /// Calls in which it has been.
    length: u32,
}

impl OnOff {
    /// One call: what is switched now, as `on` and `off`. `asks`: what the key as it has become asks for of a device that is on or off. RT.
    fn see(
        &mut self,
        now: bool,
        is_on: bool,
        debounce: u32,
        longest: u32,
        asks: impl Fn(bool) -> Option<bool>,
    ) -> (bool, bool) {
        let debounce = if (1..=10_000).contains(&debounce) { debounce } else { 2 };
        self.length = self.length.saturating_add(1);
        if self.pulse == Some(is_on) || self.length > longest {
            self.pulse = None;
        }
        let key = *self.key.get_or_insert(now);
        self.otherwise = if now == key { 0 } else { self.otherwise + 1 };
        if self.otherwise >= debounce {
            (self.key, self.otherwise) = (Some(now), 0);
            if let Some(wanted) = asks(now).filter(|wanted| *wanted != is_on) {
                (self.pulse, self.length) = (Some(wanted), 1);
            }
        }
        (self.pulse == Some(true), self.pulse == Some(false))
    }
}

component! {
    /// A switch that stays to the two inputs of a device for on and off: on as it rises, off as it falls.
    Toggle2nist = "toggle2nist";
    in {
        in_: bool = false, "switch";
        is_on: bool = false, "the device is on";
        debounce: u32 = 2, "calls that a change of the switch must last; 1 to 10000, else 2";
        max_pulse_length: u32 = 100, "calls after which `on` or `off` ends, though the device has not followed";
    }
    out { on: bool = false, "switch the device on; until it is"; off: bool = false, "switch it off; until it is"; }
    state { switch: OnOff = OnOff::default(); }
}

impl Component for Toggle2nist {
    fn update(&mut self, _: f64) {
        let asks = Some;
        (self.on, self.off) = self
            .switch
            .see(self.in_, self.is_on, self.debounce, self.max_pulse_length, asks);
    }
}

component! {
    /// A key to the two inputs of a device for on and off: each press changes what the device is.
    Momentary2nist = "momentary2nist";
    in {
        in_: bool = false, "key";
        is_on: bool = false, "the device is on";
        debounce: u32 = 2, "calls that a change of the key must last; 1 to 10000, else 2";
        max_pulse_length: u32 = 100, "calls after which `on` or `off` ends, though the device has not followed";
    }
    out { on: bool = false, "switch the device on; until it is"; off: bool = false, "switch it off; until it is"; }
    state { switch: OnOff = OnOff::default(); }
}

impl Component for Momentary2nist {
    fn update(&mut self, _: f64) {
        let is_on = self.is_on;
        let asks = |pressed: bool| pressed.then_some(!is_on);
        (self.on, self.off) = self
            .switch
            .see(self.in_, is_on, self.debounce, self.max_pulse_length, asks);
    }
}
