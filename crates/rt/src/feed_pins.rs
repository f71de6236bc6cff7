//! Pins that scale the speed of a program: the switch for feed hold, adaptive feed, overrides.
//!
//! In:  pins, the settings of the overrides. Out: shares of the planned speed; the settings, as pins want them. RT.

use super::override_pins::OverridePins;
use super::overrides::Overrides;
use hal_pins::Input;
use motion::rt::Shares;

/// All of them.
pub struct FeedPins {
    pub(super) hold: Input<bool>,
    pub(super) adaptive: Input<f64>,
    pub(super) overrides: OverridePins,
}

impl FeedPins {
    /// Whether the switch for feed hold is on.
    pub fn is_held(&self) -> bool {
        self.hold.get()
    }

    /// Shares of the planned speed for a program that runs.
    ///
    /// `motion.adaptive-feed` may change in every cycle, far too often to plan again each time: it scales time, which the
    /// interpolation does along a ramp within the stop limits, whatever comes how often. NaN holds the machine.
    pub fn shares(&self, overrides: &Overrides) -> Shares {
        let [feed, rapid] = overrides.of_time();
        // Not `clamp`, which lets NaN pass: any component may write this pin.
        #[allow(clippy::manual_clamp, reason = "max and min turn NaN into 0")]
        let adaptive = self.adaptive.get().max(0.0).min(1.0);
        Shares {
            switch: if self.is_held() { 0.0 } else { 1.0 },
            feed,
            rapid,
            adaptive,
            ..Shares::FULL
        }
    }

    /// Takes in what pins want of the overrides, and shows where they stand.
    pub fn follow(&mut self, overrides: &Overrides) {
        self.overrides.update(overrides);
    }
}
