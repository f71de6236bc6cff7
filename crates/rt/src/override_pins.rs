//! Pins of the operator's overrides: a potentiometer, a hand wheel or keys that turn them, and what they stand at.
//!
//! In:  pins of one override. Out: its setting, in [`Overrides`], and a pin that shows it.
//!
//! Names and meaning are those of LinuxCNC's user interface pins. With `direct-value`, the setting is `counts` times `scale`
//! (1: as programmed), else it goes up and down as `counts` does; `increase` and `decrease` change it by `scale` at a rising
//! edge, `reset` makes it 1. `counts` acts only while `count-enable` is true. Made at start-up, then RT.

use super::overrides::{Overridden, Overrides};
use hal_pins::{Hal, HalError, Input, Output};

struct OneOverride {
    what: Overridden,
    value: Output<f64>,
    counts: Input<i32>,
    count_enable: Input<bool>,
    scale: Input<f64>,
    direct_value: Input<bool>,
    increase: Input<bool>,
    decrease: Input<bool>,
    reset: Input<bool>,
    /// What was seen in the last cycle.
    counts_before: i32,
    direct_before: f64,
    edges_before: [bool; 3],
}

/// Pins of all overrides.
pub struct OverridePins([OneOverride; 3]);

impl OneOverride {
    fn new(hal: &mut Hal, what: Overridden) -> Result<OneOverride, HalError> {
        let group = match what {
            Overridden::Feed => "halui.feed-override",
            Overridden::Rapid => "halui.rapid-override",
            Overridden::Spindle => "halui.spindle.0.override",
        };
        let name = |pin: &str| format!("{group}.{pin}");
        Ok(OneOverride {
            what,
            value: hal.output(&name("value"))?,
            counts: hal.input(&name("counts"), 0)?,
            count_enable: hal.input(&name("count-enable"), true)?,
            scale: hal.input(&name("scale"), 0.0)?,
            direct_value: hal.input(&name("direct-value"), false)?,
            increase: hal.input(&name("increase"), false)?,
            decrease: hal.input(&name("decrease"), false)?,
            reset: hal.input(&name("reset"), false)?,
            counts_before: 0,
            direct_before: f64::NAN,
            edges_before: [false; 3],
        })
    }

    fn update(&mut self, overrides: &Overrides) {
        let now = overrides.share(self.what);
        let scale = self.scale.get();
        let counts = self.counts.get();
        let counted = counts.wrapping_sub(self.counts_before);
        self.counts_before = counts;
        let edges = [self.increase.get(), self.decrease.get(), self.reset.get()];
        let [up, down, reset] = std::array::from_fn(|k| edges[k] && !self.edges_before[k]);
        self.edges_before = edges;
        let mut wanted = now;
        if self.count_enable.get() && self.direct_value.get() {
            // A potentiometer says where it stands all the time: only where it has been turned does it take back an order.
            let direct = f64::from(counts) * scale;
            if direct != self.direct_before && direct.is_finite() {
                (wanted, self.direct_before) = (direct, direct);
            }
        } else {
            self.direct_before = f64::NAN;
            if self.count_enable.get() {
                wanted += f64::from(counted) * scale;
            }
        }
        wanted += scale * (f64::from(u8::from(up)) - f64::from(u8::from(down)));
        if reset {
            wanted = 1.0;
        }
        if wanted != now {
            overrides.set_percent(self.what, 100.0 * wanted);
        }
        self.value.set(overrides.share(self.what));
    }
}

impl OverridePins {
    /// Makes them.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal) -> Result<OverridePins, HalError> {
        Ok(OverridePins([
            OneOverride::new(hal, Overridden::Feed)?,
            OneOverride::new(hal, Overridden::Rapid)?,
            OneOverride::new(hal, Overridden::Spindle)?,
        ]))
    }

    /// Does what they want, and shows where the overrides stand.
    pub fn update(&mut self, overrides: &Overrides) {
        for one in &mut self.0 {
            one.update(overrides);
        }
    }
}
