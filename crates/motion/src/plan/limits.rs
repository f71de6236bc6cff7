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

use super::roots::cubic;
use super::{AxisLimits, Settings};
use crate::canon::AXES;
use crate::path::{Blend, Derivatives, Jet, Piece, Shape};

/// Part of the limits of acceleration and jerk that is used; the rest is for rounding and for what sampling of curves may miss.
const LIMIT_PART: f64 = 0.985;
/// Part of acceleration and jerk that curvature may take at full speed, unless said otherwise; the rest is left for
/// changes of speed.
pub(super) const CURVED: f64 = 0.6;
/// Part of the jerk that the change of acceleration on a bent path may take of what curvature leaves.
const COUPLED_JERK: f64 = 0.5;

/// Samples of a blend along which the length grows evenly with the parameter; the less evenly it does, the more: where the length
/// nearly stands still, the crest of the third derivative is as much narrower as it is higher. No more than so many for that.
const UNEVEN_STEPS: f64 = 8.0;
const UNEVEN_STEPS_MAX: f64 = 2000.0;

/// What samples of a curve may miss of its direction, as a part: all of the limit of speed is used, with no room for it.
const SLOPE_MISSED: f64 = 1e-4;

/// Equal steps of the parameter of a blend that show how its derivatives by length change.
pub(super) fn uneven_steps(blend: &Blend) -> usize {
    let uneven = UNEVEN_STEPS / blend.evenness();
    uneven.max((uneven / blend.evenness()).min(UNEVEN_STEPS_MAX)) as usize
}

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
    pub(super) fn new(piece: &Piece) -> Bounds {
        if let Some([d1, d2, d3]) = piece.greatest_derivatives() {
            return Bounds {
                d1,
                d2,
                d3,
                ..Bounds::default()
            };
        }
        let of_jet = |jet: Jet| [jet.d1, jet.d2, jet.d3];
        match piece.shape() {
            Shape::Line(_) => Bounds::sampled(3, |x| of_jet(piece.jet(piece.length() * x))),
            // A spiral: one sample every 0.05 rad, 8 for a short one.
            Shape::Arc(arc) => {
                let [from, to] = piece.turn_range();
                let steps = (arc.sweep_rad() * (to - from) / 0.05).ceil().clamp(8.0, 50_000.0) as usize;
                Bounds::sampled(steps, |x| of_jet(arc.jet_at(from + (to - from) * x)))
            }
            Shape::Blend(blend) => {
                if blend.axes() == 3 {
                    Bounds::of_blend::<3>(blend)
                } else {
                    Bounds::of_blend::<AXES>(blend)
                }
            }
        }
    }

    fn of_blend<const N: usize>(blend: &Blend) -> Bounds {
        let first = blend.group().first();
        let [from, middle, to] = [0.0, 0.5, 1.0].map(|x| blend.derivatives_at::<N>(x)[0]);
        let cosine = |a: &[f64; N], b: &[f64; N]| (first..first + 3).map(|axis| a[axis] * b[axis]).sum::<f64>();
        // One that turns back again turns twice as far as to its middle.
        let half = cosine(&from, &middle).min(cosine(&middle, &to));
        let ends = cosine(&from, &to);
        let cosine = if ends > half { 2.0 * half * half - 1.0 } else { ends };
        // The sharper the corner, the shorter the place where most of it turns: up to 0.3, 1 and 2 radians.
        let steps = match cosine {
            0.955.. => 12,
            0.54.. => 16,
            -0.416.. => 24,
            _ => 64,
        };
        let steps = steps.max(uneven_steps(blend));
        Bounds::sampled(steps, |x| blend.derivatives_at::<N>(x))
    }

    /// From so many samples at equal steps, and one more; at least 4.
    fn sampled<const N: usize>(steps: usize, at: impl Fn(f64) -> Derivatives<N>) -> Bounds {
        let mut crests = at(0.0).map(|values| values.map(Crest::new));
        for k in 1..=steps {
            let now = at(k as f64 / steps as f64);
            for (crests, now) in crests.iter_mut().zip(&now) {
                for (crest, now) in crests.iter_mut().zip(now) {
                    crest.push(*now);
                }
            }
        }
        let [d1, d2, d3] = crests.map(|crests| {
            let mut most = [0.0; AXES];
            for (most, crest) in most.iter_mut().zip(&crests) {
                *most = crest.most();
            }
            most
        });
        Bounds {
            d1: d1.map(|slope| slope * (1.0 + SLOPE_MISSED)),
            d2,
            d3,
            ..Bounds::default()
        }
    }

    /// Greatest first, second and third derivative of an axis, in amount.
    pub(super) fn of_axis(&self, axis: usize) -> [f64; 3] {
        [self.d1[axis], self.d2[axis], self.d3[axis]]
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

    /// Whether nothing but the direction bounds the motion.
    pub(super) fn is_straight(&self) -> bool {
        let rest = [&self.d2, &self.d3, &self.kink, &self.bend];
        rest.iter().all(|values| values.iter().all(|x| *x == 0.0))
    }

    /// Limits along the path for speeds up to `feed`.
    pub(super) fn limits(&self, feed: f64, settings: &Settings) -> PathLimits {
        self.limits_at(self.speed_with(CURVED, feed, settings), settings)
    }

    /// Greatest speed, up to `feed`, at which curvature takes the part `curved` of acceleration and jerk at the most.
    pub(super) fn speed_with(&self, curved: f64, feed: f64, settings: &Settings) -> f64 {
        let cycle = settings.cycle_s;
        let mut v = feed;
        for (axis, limits) in self.moving(settings) {
            v = v.min(limits.velocity / self.d1[axis]);
            let (kink, bend) = (self.kink[axis] / cycle, 0.75 * self.bend[axis] / cycle);
            let share = curved * LIMIT_PART;
            v = least(v, kink, self.d2[axis], 0.0, share * limits.acceleration);
            v = least(v, kink / cycle, bend, self.d3[axis], share * limits.jerk);
        }
        v
    }

    /// Limits along the path for speeds up to `v`, at which curvature leaves something of acceleration and jerk.
    pub(super) fn limits_at(&self, v: f64, settings: &Settings) -> PathLimits {
        let cycle = settings.cycle_s;
        let mut a = f64::INFINITY;
        for (axis, limits) in self.moving(settings) {
            let fixed = self.d2[axis] * v * v + self.kink[axis] * v / cycle;
            a = a.min((LIMIT_PART * limits.acceleration - fixed) / self.d1[axis]);
            let left = LIMIT_PART * limits.jerk - self.fixed_jerk(axis, v, cycle);
            a = a.min(COUPLED_JERK * left / (3.0 * self.d2[axis] * v));
        }
        let mut j = f64::INFINITY;
        for (axis, limits) in self.moving(settings) {
            let left = LIMIT_PART * limits.jerk - self.fixed_jerk(axis, v, cycle);
            j = j.min((left - 3.0 * self.d2[axis] * v * a) / self.d1[axis]);
        }
        PathLimits { v, a, j }
    }

    /// Axes that are bounded and move.
    fn moving<'a>(&'a self, settings: &'a Settings) -> impl Iterator<Item = (usize, &'a AxisLimits)> {
        settings.axes.iter().enumerate().filter_map(|(axis, limits)| {
            let moves = [&self.d1, &self.kink, &self.bend]
                .iter()
                .any(|values| values[axis] > 0.0);
            limits.as_ref().filter(|_| moves).map(|limits| (axis, limits))
        })
    }

    /// Jerk of an axis at constant speed.
    fn fixed_jerk(&self, axis: usize, v: f64, cycle: f64) -> f64 {
        self.d3[axis] * v * v * v + 0.75 * self.bend[axis] * v * v / cycle + self.kink[axis] * v / (cycle * cycle)
    }
}

/// Greatest magnitude of a smooth function of which samples come at equal steps: that of parabolas through three of them,
/// and a little.
///
/// In one step of three, such a parabola misses the function by at most 0.065 of its third derivative, if that is counted in
/// steps, which is about the third difference. The greater one of those on both sides counts.
#[derive(Clone, Copy, Debug)]
struct Crest {
    most: f64,
    last: f64,
    /// Differences that end with the last sample; not a number where too few are known.
    first: f64,
    second: f64,
    third: f64,
    /// Greatest magnitude of the last parabola near its middle sample.
    crest: f64,
}

impl Crest {
    const MISSED: f64 = 0.07;

    fn new(value: f64) -> Crest {
        Crest {
            most: value.abs(),
            last: value,
            first: f64::NAN,
            second: f64::NAN,
            third: f64::NAN,
            crest: f64::NAN,
        }
    }

    #[inline]
    fn push(&mut self, now: f64) {
        let first = now - self.last;
        let second = first - self.first;
        let third = second - self.second;
        let twist = greater(self.third.abs(), third.abs());
        let rise = self.first + first;
        // Its vertex, if it lies between the three.
        let inside = rise.abs() < 2.0 * second.abs();
        let beyond = if inside { rise * rise / (8.0 * second) } else { 0.0 };
        *self = Crest {
            most: greater(self.crest + Crest::MISSED * twist, self.most),
            crest: greater((self.last - beyond).abs(), self.last.abs()),
            last: now,
            first,
            second,
            third,
        };
    }

    fn most(&self) -> f64 {
        let most = greater(self.crest + Crest::MISSED * self.third.abs(), self.most);
        greater(self.last.abs(), most)
    }
}

/// The greater one; `y` where `x` is not a number. One instruction, unlike `max`.
#[inline]
fn greater(x: f64, y: f64) -> f64 {
    if x > y { x } else { y }
}

/// The greatest speed up to `v` with c1 v + c2 v² + c3 v³ <= bound.
fn least(v: f64, c1: f64, c2: f64, c3: f64, bound: f64) -> f64 {
    // An infinite speed times no coefficient is not a number, of which nothing is known.
    if v * (c1 + v * (c2 + v * c3)) <= bound {
        v
    } else {
        v.min(cubic(c1, c2, c3, bound))
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canon::Position;
    use crate::path::{BlendEnd, Group};
    use crate::plan::smooth::round::round;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bounds_of_a_corner_are_those_of_many_samples(degrees in 2.0f64..150.0, tolerance in 1e-3f64..0.1, tilt in -1.0f64..1.0) {
            let corner = Position::xyz(10.0, 0.0, 0.0);
            let a = Piece::line(Position::ZERO, corner).unwrap();
            let (sin, cos) = degrees.to_radians().sin_cos();
            let b = Piece::line(corner, Position::xyz(10.0 + 10.0 * cos, 10.0 * sin, tilt)).unwrap();
            let blend = round(&a, 5.0, &b, 5.0, tolerance).unwrap().blend;
            let Shape::Blend(curve) = blend.shape() else { panic!("a corner is a blend") };
            let bounds = Bounds::new(&blend);
            let most = Bounds::sampled(4000, |x| curve.derivatives_at::<3>(x));
            let pairs = [(bounds.d1, most.d1), (bounds.d2, most.d2), (bounds.d3, most.d3)];
            for (bounds, most) in pairs {
                let greatest = most.into_iter().fold(0.0, f64::max);
                for axis in 0..AXES {
                    prop_assert!(bounds[axis] >= most[axis] - 1e-3 * greatest, "{} < {}", bounds[axis], most[axis]);
                    prop_assert!(bounds[axis] <= most[axis] + 0.05 * greatest, "{} > {}", bounds[axis], most[axis]);
                }
            }
        }

        #[test]
        fn bounds_of_a_curve_on_which_the_length_nearly_stands_still_are_those_of_many_samples(
            paces in prop::array::uniform2(0.002f64..0.05), rise in -0.05f64..0.05, turn in 0.1f64..20.0,
        ) {
            let end = |x: f64, y: f64, a: f64, pace: f64| {
                let mut leg = Jet::default();
                (leg.q[0], leg.q[1], leg.q[3], leg.d1[0]) = (x, y, a, 1.0);
                BlendEnd { leg, pace, pace_change: 0.0 }
            };
            let blend = Piece::blend(&end(0.0, 0.0, 0.0, paces[0]), &end(0.02, rise, turn, paces[1]), Group::Main);
            // Too sharp a curve is none.
            let Some(blend) = blend else { return Ok(()) };
            let Shape::Blend(curve) = blend.shape() else { panic!("a blend") };
            let bounds = Bounds::new(&blend);
            let most = Bounds::sampled(4000, |x| curve.derivatives_at::<AXES>(x));
            for axis in [0, 1, 3] {
                prop_assert!(bounds.d2[axis] >= 0.9 * most.d2[axis] - 1e-6, "{} < {}", bounds.d2[axis], most.d2[axis]);
                prop_assert!(bounds.d3[axis] >= 0.9 * most.d3[axis] - 1e-6, "{} < {}", bounds.d3[axis], most.d3[axis]);
            }
        }

        #[test]
        fn samples_count_the_same_from_both_ends(samples in prop::collection::vec(-1.0f64..1.0, 5..30)) {
            let most = |mut samples: Box<dyn Iterator<Item = f64>>| {
                let mut crest = Crest::new(samples.next().unwrap());
                samples.for_each(|sample| crest.push(sample));
                crest.most()
            };
            let (there, back) = (samples.clone().into_iter(), samples.clone().into_iter().rev());
            let (there, back) = (most(Box::new(there)), most(Box::new(back)));
            prop_assert!((there - back).abs() < 1e-12, "{there} {back}");
            prop_assert!(samples.iter().all(|sample| there >= sample.abs()));
        }
    }
}
