//! Comparisons. A value that is no number is never near, inside or beyond anything.

use crate::component::Component;
use crate::declare::component;

component! {
    /// Whether one number is above the other, with hysteresis.
    Comp = "comp";
    in {
        in0: f64 = 0.0, "reference";
        in1: f64 = 0.0, "number";
        hyst: f64 = 0.0, "width of the zone around the reference in which nothing changes";
    }
    out { out: bool = false, "`in1` is above `in0`"; equal: bool = false, "the difference is within half the hysteresis"; }
}

impl Component for Comp {
    fn update(&mut self, _: f64) {
        let (above, half) = (self.in1 - self.in0, self.hyst / 2.0);
        let (is_below, is_above) = (above < -half, above > half);
        self.equal = above.abs() <= half;
        if is_below || is_above {
            self.out = !is_below;
        }
    }
}

component! {
    /// Whether a number lies in a window.
    Wcomp = "wcomp";
    in {
        in_: f64 = 0.0, "number";
        min: f64 = 0.0, "lower edge of the window";
        max: f64 = 0.0, "upper edge";
    }
    out {
        out: bool = false, "strictly between the edges";
        under: bool = false, "at the lower edge or below";
        over: bool = false, "at the upper edge or above";
    }
}

impl Component for Wcomp {
    fn update(&mut self, _: f64) {
        self.under = self.in_ <= self.min;
        self.over = self.in_ >= self.max;
        self.out = self.min < self.in_ && self.in_ < self.max;
    }
}

component! {
    /// Whether two numbers are about equal: by a factor or by a difference. For a spindle at speed.
    Near = "near";
    in {
        in1: f64 = 0.0, "one number";
        in2: f64 = 0.0, "the other";
        scale: f64 = 1.0, "factor between them, above 1; else only the difference counts";
        difference: f64 = 0.0, "difference between them";
    }
    out { out: bool = false, "they are near"; }
}

impl Component for Near {
    fn update(&mut self, _: f64) {
        // Both with the sign that makes the first one positive.
        let (a, b) = match self.in1 < 0.0 {
            true => (-self.in1, -self.in2),
            false => (self.in1, self.in2),
        };
        let by_factor = self.scale > 1.0 && a / self.scale <= b && b <= a * self.scale;
        self.out = by_factor || (self.in1 - self.in2).abs() <= self.difference;
    }
}

component! {
    /// Home switch of a simulated axis.
    SimHomeSwitch = "sim_home_switch";
    in {
        cur_pos: f64 = 0.0, "position";
        home_pos: f64 = 1.0, "place of the switch; closed from there away from 0";
        hysteresis: f64 = 0.1, "way back until it opens";
        index_enable: bool = false, "looks for an index";
        index_delay_ms: f64 = 10.0, "how long it takes to meet it, ms";
    }
    out {
        home_sw: bool = false, "switch is closed";
        indexed: bool = false, "the index has been met; until `index-enable` falls";
    }
    state { looked_ms: Option<f64> = None; }
}

impl Component for SimHomeSwitch {
    fn update(&mut self, period_s: f64) {
        // Outward is away from 0.
        let (at, home) = match self.home_pos >= 0.0 {
            true => (self.cur_pos, self.home_pos),
            false => (-self.cur_pos, -self.home_pos),
        };
        if at >= home {
            self.home_sw = true;
        } else if at <= home - self.hysteresis {
            self.home_sw = false;
        }
        // The call in which it begins takes no time.
        self.looked_ms = match (self.index_enable, self.looked_ms) {
            (false, _) => None,
            (true, None) => Some(0.0),
            (true, Some(looked_ms)) => Some(looked_ms + period_s * 1e3),
        };
        // A rest that is rounding is none; a delay that is no number is none.
        let delay_ms = self.index_delay_ms;
        let is_over = |looked_ms: f64| looked_ms + period_s * 500.0 >= delay_ms || delay_ms.is_nan();
        self.indexed = self.looked_ms.is_some_and(is_over);
    }
}
