//! Signals for tests: waves.

use crate::component::Component;
use crate::declare::component;
use std::f64::consts::TAU;

component! {
    /// Waves of one frequency.
    Siggen = "siggen";
    in {
        frequency: f64 = 1.0, "waves a second, Hz; half the rate of calls at most";
        amplitude: f64 = 1.0, "half the height of a wave";
        offset: f64 = 0.0, "is added";
        reset: bool = false, "keeps the phase at half a wave";
    }
    out {
        sine: f64 = 0.0, "sine";
        cosine: f64 = 0.0, "a quarter of a wave before `sine`";
        square: f64 = 0.0, "high in the second half";
        triangle: f64 = 0.0, "falls in the first half, rises in the second";
        sawtooth: f64 = 0.0, "rises, and falls at once where `triangle` is highest";
        clock: bool = false, "`square` is high";
    }
    state { phase: f64 = 0.0; }
}

impl Component for Siggen {
    fn update(&mut self, period_s: f64) {
        self.phase = match self.reset {
            true => 0.5,
            false => advanced(self.phase, self.frequency, period_s),
        };
        let (sin, cos) = libm::sincos(self.phase * TAU);
        self.clock = self.phase > 0.5;
        let side = if self.clock { 1.0 } else { -1.0 };
        let ramp = self.phase * 2.0 - 1.0;
        let wave = |unit: f64| unit * self.amplitude + self.offset;
        (self.sine, self.cosine) = (wave(sin), wave(cos));
        (self.square, self.sawtooth) = (wave(side), wave(ramp));
        self.triangle = wave(2.0 * ramp * side - 1.0);
    }
}

/// A phase one call later, 0 to below 1: at most half a wave a call, and none where the frequency is no number. RT.
#[allow(clippy::manual_clamp, reason = "max and min turn NaN into 0")]
pub(crate) fn advanced(phase: f64, frequency: f64, period_s: f64) -> f64 {
    let next = phase + (frequency * period_s).max(0.0).min(0.5);
    if next >= 1.0 { next - 1.0 } else { next }
}
