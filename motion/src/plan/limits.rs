//! How fast a stretch of path may be run so that no axis exceeds its limits, whatever the timing.
//!
//! In:  geometry and axis limits.
//! Out: for a stretch, a speed `v`, an acceleration `a` and a jerk `j` along the path such that *any* motion within
//! them keeps every axis k within its own:
//!
//! ```text
//! |q'k| v                                    <= V
//! |q'k| a + |q''k| v^2  + kink v / T         <= A
//! |q'k| j + 3 |q''k| v a + |q'''k| v^3 + 0.75 bend v^2 / T + kink v / T^2 <= J
//! ```
//!
//! `kink` and `bend` are the jumps of q' and q'' between pieces that are not blended. A jump has no derivative, but
//! set-points come once a cycle T, and what the drive sees is differences over T: the second difference of a jump dv of
//! velocity peaks at dv/T, the third at dv/T^2; the third of a jump da of acceleration at 0.75 da/T.

use super::smooth::round::turning;
use super::{AxisLimits, Settings};
use crate::canon::AXES;
use crate::path::{Jet, Piece, Shape};

/// Part of the limits of acceleration and jerk that is used; the rest is for rounding and for what sampling of curves may miss.
const USE: f64 = 0.985;
/// Part of acceleration and jerk that curvature may take at full speed, unless said otherwise; the rest is left for
/// changes of speed.
pub(super) const CURVED: f64 = 0.6;
/// Part of the jerk that the change of acceleration on a bent path may take of what curvature leaves.
const COUPLED_JERK: f64 = 0.5;

/// Greatest derivatives of each axis over a stretch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bounds {
    d1: [f64; AXES],
    d2: [f64; AXES],
    d3: [f64; AXES],
    /// Jump of q' at a border.
    pub(super) kink: [f64; AXES],
    /// Jump of q'' at a border.
    pub(super) bend: [f64; AXES],
}

/// Limits along the path: speed, acceleration, jerk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PathLimits {
    pub(super) v: f64,
    pub(super) a: f64,
    pub(super) j: f64,
}

impl Bounds {
    pub(super) fn of(piece: &Piece) -> Bounds {
        match piece.shape() {
            Shape::Line(_) => {
                let jet = piece.jet(0.0);
                Bounds {
                    d1: jet.d1.map(f64::abs),
                    ..Bounds::default()
                }
            }
            // One sample every 0.05 rad, 8 for a short arc; a constant radius repeats after one turn.
            Shape::Arc(arc) => {
                let turn = arc.sweep_rad() * piece.length() / arc.length_mm();
                let turn = if arc.is_round() {
                    turn.min(std::f64::consts::TAU)
                } else {
                    turn
                };
                let steps = (turn / 0.05).ceil().clamp(8.0, 50_000.0) as usize;
                let part = arc.length_mm() * turn / arc.sweep_rad();
                let part = part.min(piece.length());
                Bounds::sampled(steps, |x| piece.jet(part * x))
            }
            Shape::Blend(blend) => {
                let (first, last) = (blend.jet_at(0.0), blend.jet_at(1.0));
                let steps = if turning(piece.group(), &first, &last) < 0.3 {
                    16
                } else {
                    96
                };
                Bounds::sampled(steps, |x| blend.jet_at(x))
            }
        }
    }

    /// Maxima over samples; a quarter of the step to the neighbour covers a crest between two samples.
    fn sampled(steps: usize, jet: impl Fn(f64) -> Jet) -> Bounds {
        let mut bounds = Bounds::default();
        let mut last: Option<Jet> = None;
        for k in 0..=steps {
            let jet = jet(k as f64 / steps as f64);
            let before = last.unwrap_or(jet);
            for axis in 0..AXES {
                let crest = |now: f64, then: f64| now.abs().max(then.abs()) + (now - then).abs() / 4.0;
                bounds.d1[axis] = bounds.d1[axis].max(crest(jet.d1[axis], before.d1[axis]));
                bounds.d2[axis] = bounds.d2[axis].max(crest(jet.d2[axis], before.d2[axis]));
                bounds.d3[axis] = bounds.d3[axis].max(crest(jet.d3[axis], before.d3[axis]));
            }
            last = Some(jet);
        }
        bounds
    }

    /// Bounds that hold on both stretches.
    pub(super) fn union(&self, other: &Bounds) -> Bounds {
        let max = |a: &[f64; AXES], b: &[f64; AXES]| core::array::from_fn(|axis| a[axis].max(b[axis]));
        Bounds {
            d1: max(&self.d1, &other.d1),
            d2: max(&self.d2, &other.d2),
            d3: max(&self.d3, &other.d3),
            kink: max(&self.kink, &other.kink),
            bend: max(&self.bend, &other.bend),
        }
    }

    /// Limits along the path for speeds up to `feed`.
    pub(super) fn limits(&self, feed: f64, settings: &Settings) -> PathLimits {
        self.limits_with(CURVED, feed, settings)
    }

    /// The same where curvature may take the part `curved` of acceleration and jerk at full speed.
    pub(super) fn limits_with(&self, curved: f64, feed: f64, settings: &Settings) -> PathLimits {
        let cycle = settings.cycle_s;
        let mut v = feed;
        for (axis, limits) in existing(settings) {
            v = v.min(limits.velocity / self.d1[axis]);
            v = v.min(root(curved * USE * limits.acceleration, |v| {
                self.d2[axis] * v * v + self.kink[axis] * v / cycle
            }));
            v = v.min(root(curved * USE * limits.jerk, |v| self.fixed_jerk(axis, v, cycle)));
        }
        let mut a = f64::INFINITY;
        for (axis, limits) in existing(settings) {
            let fixed = self.d2[axis] * v * v + self.kink[axis] * v / cycle;
            a = a.min((USE * limits.acceleration - fixed) / self.d1[axis]);
            let left = USE * limits.jerk - self.fixed_jerk(axis, v, cycle);
            a = a.min(COUPLED_JERK * left / (3.0 * self.d2[axis] * v));
        }
        let mut j = f64::INFINITY;
        for (axis, limits) in existing(settings) {
            let left = USE * limits.jerk - self.fixed_jerk(axis, v, cycle);
            j = j.min((left - 3.0 * self.d2[axis] * v * a) / self.d1[axis]);
        }
        PathLimits { v, a, j }
    }

    /// Jerk of an axis at constant speed.
    fn fixed_jerk(&self, axis: usize, v: f64, cycle: f64) -> f64 {
        self.d3[axis] * v * v * v + 0.75 * self.bend[axis] * v * v / cycle + self.kink[axis] * v / (cycle * cycle)
    }
}

fn existing(settings: &Settings) -> impl Iterator<Item = (usize, &AxisLimits)> {
    settings
        .axes
        .iter()
        .enumerate()
        .filter_map(|(axis, limits)| limits.as_ref().map(|limits| (axis, limits)))
}

/// Greatest v with f(v) <= bound, for f rising from 0; infinite when f stays 0. The result is never above the root.
fn root(bound: f64, f: impl Fn(f64) -> f64) -> f64 {
    if f(1.0) == 0.0 {
        return f64::INFINITY;
    }
    let (mut low, mut high) = (0.0, 1.0);
    while f(high) <= bound && high < 1e12 {
        low = high;
        high *= 4.0;
    }
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if f(middle) <= bound {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Jumps of direction and curvature where two pieces meet, or `None` if there are none.
pub(super) fn jumps(before: &Jet, after: &Jet) -> Option<Bounds> {
    let mut bounds = Bounds::default();
    let mut any = false;
    for axis in 0..AXES {
        bounds.kink[axis] = (after.d1[axis] - before.d1[axis]).abs();
        bounds.bend[axis] = (after.d2[axis] - before.d2[axis]).abs();
        // Below this, rounding: at 1 m/s and 1 ms a jump of 1e-12 is 1e-3 mm/s^3.
        any |= bounds.kink[axis] > 1e-12 || bounds.bend[axis] > 1e-9 * (1.0 + before.d2[axis].abs());
    }
    any.then_some(bounds)
}
