//! The operator's overrides: to how much of what is programmed he has turned feed, rapid moves and spindle.
//!
//! In:  orders of clients, pins. Whoever turns last counts.
//! Out: the latest setting, to any thread at any time; shares for the interpolation.
//!
//! How a setting acts:
//!
//! | | planner `optimal` | planner `classic` |
//! |---|---|---|
//! | feed, rapid above 0 | a new plan from a place a little ahead of the machine, by the program thread | interpolation: plan time passes more slowly, so up to 100 % |
//! | 0 % | interpolation: a hold of these moves, of which those that rest are not begun; a new plan that rests before them | interpolation: the same hold |
//! | spindle | a factor on S, at once | the same |
//!
//! 0 % is a hold and no speed to plan with, because a hold stops within the stop limits from the next cycle on; a plan for no
//! speed would have to creep to the next place where it can end. What is planned anew is where the machine waits: a rapid move
//! ends at rest before a move at feed that is held, and the other way round. RT but where it says otherwise.

use host::wake_signal::WakeSignal;
use motion::plan::{FEED_OVERRIDE_MAX, PlannerKind};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::Duration;

/// What can be overridden.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overridden {
    Feed,
    /// Rapid moves (G0).
    Rapid,
    /// Programmed speed of the spindle (S).
    Spindle,
}

impl Overridden {
    /// All of them.
    pub const ALL: [Overridden; 3] = [Overridden::Feed, Overridden::Rapid, Overridden::Spindle];

    /// Its name, as in orders and pins.
    pub const fn name(self) -> &'static str {
        match self {
            Overridden::Feed => "feed",
            Overridden::Rapid => "rapid",
            Overridden::Spindle => "spindle",
        }
    }
}

/// What a setting is kept in: percent times this.
const STEPS_PER_PERCENT: f64 = 100.0;
/// As programmed.
const AS_PROGRAMMED: u32 = 100 * STEPS_PER_PERCENT as u32;
/// Least and greatest override of the spindle, percent: a tool bears little more than its speed, and much less rubs.
const SPINDLE_PERCENT: [f64; 2] = [50.0, 120.0];

/// The latest setting.
#[derive(Debug)]
pub struct Overrides {
    settings: [AtomicU32; 3],
    planner_kind: PlannerKind,
    bell: WakeSignal,
}

impl Default for Overrides {
    fn default() -> Overrides {
        Overrides::new(PlannerKind::default())
    }
}

impl Overrides {
    /// Everything as programmed, on a machine with this planner.
    pub fn new(planner_kind: PlannerKind) -> Overrides {
        Overrides {
            settings: [const { AtomicU32::new(AS_PROGRAMMED) }; 3],
            planner_kind,
            bell: WakeSignal::default(),
        }
    }

    /// Percent of what is programmed.
    pub fn percent(&self, what: Overridden) -> f64 {
        f64::from(self.settings[what as usize].load(Relaxed)) / STEPS_PER_PERCENT
    }

    /// The same as a share.
    pub fn share(&self, what: Overridden) -> f64 {
        self.percent(what) / 100.0
    }

    /// Least and greatest percentage.
    pub fn range_percent(&self, what: Overridden) -> [f64; 2] {
        match (what, self.planner_kind) {
            (Overridden::Feed, PlannerKind::Optimal) => [0.0, 100.0 * FEED_OVERRIDE_MAX],
            // Time cannot pass faster than it was planned to: more would break limits.
            (Overridden::Feed, PlannerKind::Classic) | (Overridden::Rapid, _) => [0.0, 100.0],
            (Overridden::Spindle, _) => SPINDLE_PERCENT,
        }
    }

    /// Turns one as far as its range goes; NaN is left out. Whoever plans looks a few milliseconds later.
    pub fn set_percent(&self, what: Overridden, percent: f64) {
        let [least, greatest] = self.range_percent(what);
        if percent.is_finite() {
            let steps = (percent.clamp(least, greatest) * STEPS_PER_PERCENT).round();
            self.settings[what as usize].store(steps as u32, Relaxed);
        }
    }

    /// Turns one, if it goes so far, and wakes whoever plans. Not RT.
    ///
    /// # Errors
    /// What cannot be, and why.
    pub fn order(&self, what: Overridden, percent: f64) -> Result<(), String> {
        self.check(what, percent)?;
        self.set_percent(what, percent);
        self.bell.ring();
        Ok(())
    }

    /// Whether [`Overrides::order`] would do it. Not RT.
    ///
    /// # Errors
    /// What cannot be, and why.
    pub fn check(&self, what: Overridden, percent: f64) -> Result<(), String> {
        let [least, greatest] = self.range_percent(what);
        if (least..=greatest).contains(&percent) {
            return Ok(());
        }
        let name = what.name();
        Err(match (what, self.planner_kind) {
            (Overridden::Feed, PlannerKind::Classic) if percent <= 100.0 * FEED_OVERRIDE_MAX && percent > 100.0 => {
                format!(
                    "{name} {percent} %: more than 100 % is without effect with planner = \"classic\", whose plan cannot run faster \
                 than planned; expected {least} to {greatest} %, or planner = \"optimal\" in the machine file"
                )
            }
            _ => format!("{name} {percent} %: expected {least} to {greatest} %"),
        })
    }

    /// What a plan is to be made with, feed and rapid; 0 is a hold, for which the share before stays: `None`.
    pub fn planned(&self) -> [Option<f64>; 2] {
        [Overridden::Feed, Overridden::Rapid].map(|what| Some(self.share(what)).filter(|share| *share > 0.0))
    }

    /// What is left to the interpolation: shares of time for feed and rapid moves.
    pub fn of_time(&self) -> [f64; 2] {
        [Overridden::Feed, Overridden::Rapid].map(|what| match (self.share(what), self.planner_kind) {
            (share, PlannerKind::Classic) => share.min(1.0),
            (0.0, PlannerKind::Optimal) => 0.0,
            (_, PlannerKind::Optimal) => 1.0,
        })
    }

    /// Pauses until an order comes, `most` at the longest. Not RT.
    pub fn wait(&self, most: Duration) {
        self.bell.wait(most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Overridden::{Feed, Rapid, Spindle};

    #[test]
    fn settings_stay_in_their_range_and_refusals_say_why() {
        let overrides = Overrides::new(PlannerKind::Optimal);
        for (what, percent) in [
            (Feed, 120.0),
            (Feed, 0.0),
            (Feed, 62.55),
            (Rapid, 25.0),
            (Spindle, 50.0),
        ] {
            overrides.order(what, percent).unwrap();
            assert_eq!(overrides.percent(what), percent, "{what:?}");
        }
        let refused = |what, percent| overrides.order(what, percent).unwrap_err();
        assert_eq!(refused(Feed, 121.0), "feed 121 %: expected 0 to 120 %");
        assert_eq!(refused(Feed, -1.0), "feed -1 %: expected 0 to 120 %");
        assert_eq!(refused(Rapid, 100.5), "rapid 100.5 %: expected 0 to 100 %");
        assert_eq!(refused(Spindle, 0.0), "spindle 0 %: expected 50 to 120 %");
        assert_eq!(refused(Feed, f64::NAN), "feed NaN %: expected 0 to 120 %");
        assert_eq!(overrides.percent(Feed), 62.55);
        for (percent, got) in [
            (500.0, 120.0),
            (-3.0, 0.0),
            (f64::NAN, 0.0),
            (f64::INFINITY, 0.0),
            (80.004, 80.0),
        ] {
            overrides.set_percent(Feed, percent);
            assert_eq!(overrides.percent(Feed), got, "{percent}");
        }
    }

    #[test]
    fn the_classic_planner_says_that_more_than_planned_is_without_effect() {
        let overrides = Overrides::new(PlannerKind::Classic);
        let refused = overrides.order(Feed, 110.0).unwrap_err();
        assert!(refused.starts_with("feed 110 %: more than 100 % is without effect with planner = \"classic\""));
        assert_eq!(
            overrides.order(Feed, 130.0).unwrap_err(),
            "feed 130 %: expected 0 to 100 %"
        );
        overrides.order(Feed, 40.0).unwrap();
        assert_eq!(
            (overrides.of_time(), overrides.planned()),
            ([0.4, 1.0], [Some(0.4), Some(1.0)])
        );
    }

    #[test]
    fn nothing_is_a_hold_and_leaves_the_plan() {
        let overrides = Overrides::new(PlannerKind::Optimal);
        overrides.order(Feed, 0.0).unwrap();
        overrides.order(Rapid, 50.0).unwrap();
        assert_eq!(
            (overrides.of_time(), overrides.planned()),
            ([0.0, 1.0], [None, Some(0.5)])
        );
    }
}
