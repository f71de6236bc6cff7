//! Time scaling: how a hold or a stop leaves the planned speed without leaving the path.
//!
//! In:  the wanted share of the planned speed.
//! Out: plan time that passes in a cycle.
//!
//! The plan is q(tau), real time is t, the share is r = dtau/dt. With ' for d/dtau and dots for d/dt of r:
//!
//! ```text
//! velocity      q' r
//! acceleration  q'' r^2 + q' r.
//! jerk          q''' r^3 + 3 q'' r r. + q' r..
//! ```
//!
//! A plan within V, A, J therefore stays within `A r^2 + V |r.|` and `J r^3 + 3 A r |r.| + V |r..|`. [`ScaleRamp`] bounds
//! |r..| and with it |r.|; [`ScaleRamp::new`] finds the quickest ramp for which both stay within the stop limits at
//! every point of it. A share that changes again on its way is slower in |r.| at the same r, so it is covered: all that
//! keeps r between 0 and 1 and |r..| within its bound is.
//!
//! Who may let only so much plan time pass (to the end of a block, to the end of the way back) takes
//! [`ScaleRamp::step_within`], which comes to rest just there. Run backward, a plan is another one within the same limits.

use super::braking::{Braking, Pace};

/// Limits that a plan keeps on one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// mm/s (degrees/s).
    pub velocity: f64,
    /// mm/s² (degrees/s²).
    pub acceleration: f64,
    /// mm/s³ (degrees/s³).
    pub jerk: f64,
}

/// Limits that holds and stops keep on one axis; above those of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopLimits {
    /// mm/s² (degrees/s²).
    pub acceleration: f64,
    /// mm/s³ (degrees/s³).
    pub jerk: f64,
}

/// Shortest and longest ramp from full speed to rest that is ever used, s.
const RAMP_S: [f64; 2] = [0.02, 5.0];

/// The share of the planned speed and how it changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleRamp {
    cycle_s: f64,
    /// Bound of |r..|, 1/s².
    curvature: f64,
    share: f64,
    /// r., 1/s.
    rate: f64,
    /// On the way to rest at a given place.
    braking: Option<Braking>,
}

impl ScaleRamp {
    /// A ramp at rest, as quick as the limits of all axes allow.
    pub fn new(axes: &[(MotionLimits, StopLimits)], cycle_s: f64) -> ScaleRamp {
        let ramp_s = axes
            .iter()
            .map(|(plan, stop)| shortest_ramp_s(plan, stop))
            .fold(RAMP_S[0], f64::max);
        ScaleRamp {
            cycle_s,
            curvature: curvature(ramp_s),
            share: 0.0,
            rate: 0.0,
            braking: None,
        }
    }

    /// Time from full speed to rest, s.
    pub fn ramp_s(&self) -> f64 {
        2.0 / self.curvature.sqrt()
    }

    /// Cycle time, s.
    pub(super) fn cycle_s(&self) -> f64 {
        self.cycle_s
    }

    /// Share of the planned speed, 0 to 1.
    #[inline]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Whether plan time stands still.
    #[inline]
    pub fn is_at_rest(&self) -> bool {
        self.share == 0.0 && self.rate == 0.0
    }

    /// Whether the share is on its way to another one.
    pub fn is_changing(&self) -> bool {
        self.rate != 0.0 || self.braking.is_some()
    }

    /// Takes a share at once: where the plan itself is at rest.
    pub fn jump(&mut self, share: f64) {
        self.share = share.clamp(0.0, 1.0);
        self.rate = 0.0;
        self.braking = None;
    }

    /// One cycle towards `target` (0 to 1); returns the plan time that passes in it, s. RT.
    #[inline]
    pub fn step(&mut self, target: f64) -> f64 {
        self.braking = None;
        let (cycle, curvature) = (self.cycle_s, self.curvature);
        let target = target.clamp(0.0, 1.0);
        let change = curvature * cycle;
        let missing = target - self.share;
        // The greatest rate w at the end of this cycle from which the rest of the way suffices to brake: this cycle
        // covers (rate + w)/2, braking by `change` a cycle then w²/(2 change), both in cycles; together `missing`.
        let toward = missing.signum();
        let distance = missing.abs() / cycle - self.rate * toward / 2.0;
        let next_rate = ((change * change + 8.0 * change * distance.max(0.0)).sqrt() - change) / 2.0 * toward;
        let next_rate = next_rate.clamp(self.rate - change, self.rate + change);
        // Never more than all of the cycle: rounding must not make a plan faster than it is.
        let passed = (cycle * (self.share + cycle * (self.rate / 3.0 + next_rate / 6.0))).min(cycle);
        let share = self.share + (self.rate + next_rate) / 2.0 * cycle;
        self.rate = next_rate;
        self.share = share;
        // The last steps shrink without end; what they still would change is a hundredth of what a cycle may.
        if (target - self.share).abs() <= change * cycle * 1e-3 && self.rate.abs() <= change * 1e-2 {
            self.share = target;
            self.rate = 0.0;
        }
        self.share = self.share.clamp(0.0, 1.0);
        passed.max(0.0)
    }

    /// The same where no more than `way_s` of plan time may pass until rest; with a target above 0 all of it does in the end.
    /// To be asked again with what is left of it, cycle by cycle; another length is possible if [`ScaleRamp::can_rest_in`]
    /// says so. RT.
    pub fn step_within(&mut self, target: f64, way_s: f64) -> f64 {
        if !self.braking.is_some_and(|braking| braking.fits(way_s)) {
            let mut next = *self;
            let passed = next.step(target);
            let left_s = way_s - passed;
            // A hold needs less than a stop that begins with an even share.
            let hold = target <= 0.0 && next.shortest(left_s).left_s() <= left_s;
            if next.needed_s() <= left_s || hold {
                *self = next;
                return passed;
            }
            self.braking = Some(if self.is_at_rest() {
                Braking::little(self.cycle_s, way_s.max(0.0))
            } else {
                Braking::over(self.pace(), self.curvature, self.cycle_s, way_s).unwrap_or_else(|| self.shortest(way_s))
            });
        }
        let (pace, cycle_s) = (self.pace(), self.cycle_s);
        let Some(braking) = &mut self.braking else { return 0.0 };
        let (next, passed) = braking.step(pace, cycle_s);
        match next {
            Some(pace) => (self.share, self.rate) = (pace.share, pace.rate),
            None => self.jump(0.0),
        }
        passed
    }

    /// Whether [`ScaleRamp::step_within`] can come to rest after just this much plan time. RT.
    pub fn can_rest_in(&self, way_s: f64) -> bool {
        match &self.braking {
            Some(braking) if braking.fits(way_s) => true,
            Some(_) | None => self.needed_s() <= way_s,
        }
    }

    fn pace(&self) -> Pace {
        Pace {
            share: self.share,
            rate: self.rate,
        }
    }

    fn shortest(&self, way_s: f64) -> Braking {
        Braking::shortest(self.pace(), self.curvature, way_s)
    }

    fn needed_s(&self) -> f64 {
        Braking::needed_s(self.pace(), self.curvature)
    }
}

/// |r..| of a ramp of this length: half of it speeds the change up, half slows it down.
fn curvature(ramp_s: f64) -> f64 {
    4.0 / (ramp_s * ramp_s)
}

/// Shortest ramp for which every plan within `plan` stays within `stop`, s.
fn shortest_ramp_s(plan: &MotionLimits, stop: &StopLimits) -> f64 {
    let [mut low, mut high] = RAMP_S;
    if keeps(plan, stop, low) {
        return low;
    }
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if keeps(plan, stop, middle) {
            high = middle
        } else {
            low = middle
        }
    }
    high
}

fn keeps(plan: &MotionLimits, stop: &StopLimits, ramp_s: f64) -> bool {
    const POINTS: usize = 200;
    let curvature = curvature(ramp_s);
    (0..=POINTS).all(|point| {
        let share = point as f64 / POINTS as f64;
        // Braking from 1 and the way down to 0, mirrored at the middle.
        let rate = (2.0 * curvature * share.min(1.0 - share)).sqrt();
        let acceleration = plan.acceleration * share * share + plan.velocity * rate;
        let jerk = plan.jerk * share.powi(3) + 3.0 * plan.acceleration * share * rate + plan.velocity * curvature;
        acceleration <= stop.acceleration && jerk <= stop.jerk
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CYCLE_S: f64 = 1e-3;

    fn mill() -> ScaleRamp {
        let plan = MotionLimits {
            velocity: 150.0,
            acceleration: 1500.0,
            jerk: 30_000.0,
        };
        ScaleRamp::new(
            &[(
                plan,
                StopLimits {
                    acceleration: 3000.0,
                    jerk: 120_000.0,
                },
            )],
            CYCLE_S,
        )
    }

    #[test]
    fn the_ramp_is_as_quick_as_the_stop_limits_allow() {
        let ramp = mill();
        // V r. alone must stay below 3000 - ...: between V*2/T = 3000 (0.1 s) and half a second.
        assert!(ramp.ramp_s() > 0.1 && ramp.ramp_s() < 0.5, "{}", ramp.ramp_s());
        let plan = MotionLimits {
            velocity: 150.0,
            acceleration: 1500.0,
            jerk: 30_000.0,
        };
        let stop = StopLimits {
            acceleration: 3000.0,
            jerk: 120_000.0,
        };
        assert!(keeps(&plan, &stop, ramp.ramp_s()));
        assert!(!keeps(&plan, &stop, ramp.ramp_s() * 0.99));
    }

    #[test]
    fn full_speed_and_rest_are_reached_exactly_and_in_time() {
        let mut ramp = mill();
        // The last steps, which shrink without end, take a few cycles more.
        let cycles = (ramp.ramp_s() / CYCLE_S).ceil() as usize + 40;
        for target in [1.0, 0.0, 0.25, 0.0] {
            for _ in 0..cycles {
                ramp.step(target);
            }
            assert_eq!(ramp.share(), target);
        }
        assert!(ramp.is_at_rest());
        assert_eq!(ramp.step(0.0), 0.0);
    }

    #[test]
    fn at_full_speed_plan_time_is_real_time() {
        let mut ramp = mill();
        for _ in 0..1000 {
            ramp.step(1.0);
        }
        assert_eq!(ramp.step(1.0), CYCLE_S);
    }

    /// Runs to rest within a way; gives what passed in each cycle.
    fn run_within(ramp: &mut ScaleRamp, target: f64, way_s: f64) -> Vec<f64> {
        let (mut left_s, mut all) = (way_s, Vec::new());
        for _ in 0..20_000 {
            let passed = ramp.step_within(target, left_s);
            left_s -= passed;
            all.push(passed);
            if ramp.is_at_rest() && left_s < 1e-12 {
                break;
            }
        }
        all
    }

    #[test]
    fn rest_is_reached_just_where_it_is_wanted() {
        for way_s in [1e-12, 1e-9, 3e-7, 1e-5, 1e-3, 0.02, 0.1, 0.5, 3.0] {
            let mut ramp = mill();
            let passed = run_within(&mut ramp, 1.0, way_s);
            let sum: f64 = passed.iter().sum();
            assert!(ramp.is_at_rest() && (sum - way_s).abs() < 1e-13, "{sum} of {way_s}");
            // As quick as it can be but for what a cycle is: four equal parts, or the ramp up, full speed, the ramp down.
            let ramp_s = mill().ramp_s();
            let least_s = if way_s > ramp_s {
                way_s + ramp_s
            } else {
                4.0 * libm::cbrt(way_s / (2.0 * mill().curvature))
            };
            let cycles = (least_s / CYCLE_S).ceil() as usize + 45;
            assert!(
                passed.len() <= cycles,
                "{} of {cycles} cycles for {way_s} s",
                passed.len()
            );
        }
    }

    #[test]
    fn full_speed_is_kept_up_to_the_ramp_before_the_end() {
        let mut ramp = mill();
        ramp.jump(1.0);
        let way_s = 1.23456;
        let passed = run_within(&mut ramp, 1.0, way_s);
        let steady = passed.iter().take_while(|&&passed| passed == CYCLE_S).count();
        let braking_s = way_s - steady as f64 * CYCLE_S;
        assert!(
            braking_s >= ramp.ramp_s() / 2.0 && braking_s <= ramp.ramp_s() / 2.0 + CYCLE_S,
            "{braking_s}"
        );
    }

    #[test]
    fn a_way_too_short_is_known() {
        let mut ramp = mill();
        assert!(ramp.can_rest_in(0.0));
        ramp.jump(1.0);
        assert!(ramp.can_rest_in(ramp.ramp_s() / 2.0 * 1.000001));
        assert!(!ramp.can_rest_in(ramp.ramp_s() / 2.0 * 0.999));
    }

    proptest! {
        /// Whatever is wanted whenever: |r..| keeps its bound, r stays between 0 and 1, plan time never runs back.
        #[test]
        fn the_bound_holds_for_any_wish(wishes in prop::collection::vec((0.0..=1.0_f64, 1_usize..200), 1..30)) {
            let mut ramp = mill();
            let bound = ramp.curvature * CYCLE_S;
            for (target, cycles) in wishes {
                for _ in 0..cycles {
                    let before = ramp.rate;
                    let passed = ramp.step(target);
                    prop_assert!((ramp.rate - before).abs() <= bound * 1.011, "{} -> {}", before, ramp.rate);
                    prop_assert!((0.0..=1.0).contains(&ramp.share));
                    prop_assert!((0.0..=CYCLE_S * 1.000001).contains(&passed));
                }
            }
        }

        /// Whatever is wanted on the way: rest just at its end, |r..| within its bound, r between 0 and 1.
        #[test]
        fn the_bound_holds_on_any_way_to_a_place(
            way_s in prop_oneof![1e-9..1e-5_f64, 1e-5..0.05_f64, 0.05..2.0_f64],
            wishes in prop::collection::vec((prop_oneof![Just(0.0), Just(1.0), 0.0..=1.0_f64], 1_usize..120), 0..30),
        ) {
            let mut ramp = mill();
            let bound = ramp.curvature * CYCLE_S;
            let ends = std::iter::repeat_n(1.0, 6000);
            let wishes = wishes.iter().flat_map(|&(target, cycles)| std::iter::repeat_n(target, cycles));
            let mut left_s = way_s;
            for target in wishes.chain(ends) {
                let (share, rate) = (ramp.share, ramp.rate);
                let passed = ramp.step_within(target, left_s);
                left_s -= passed;
                prop_assert!((ramp.rate - rate).abs() <= bound * 1.011, "{} -> {}", rate, ramp.rate);
                prop_assert!((ramp.share - share).abs() <= (rate.abs() + bound) * CYCLE_S);
                prop_assert!((0.0..=1.0).contains(&ramp.share));
                prop_assert!((0.0..=CYCLE_S * 1.000001).contains(&passed));
                prop_assert!(left_s >= -1e-14, "{} beyond", left_s);
            }
            prop_assert!(ramp.is_at_rest() && left_s.abs() < 1e-13, "{} left, {:?}", left_s, ramp);
        }
    }
}
