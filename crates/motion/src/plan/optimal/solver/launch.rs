//! Starts and stops: from rest to the feasible profile, and the other way.
//!
//! At rest b grows like s^(4/3), which no polynomial follows. So motion begins with a launch, constant jerk for a time;
//! the spline begins where the launch ends. A stop is the same in reverse.

use super::grid::{CREST, Grid, JointJet, JointLimits, SPEED_USE, uses};
use super::profile::{State, coefficient, span_value};
use crate::plan::roots::cube_root;

/// Part of the jerk limit of a launch; the solver needs some room to go on from there.
const LAUNCH_JERK: f64 = 0.99;
/// Greatest acceleration at the end of a launch, over the limit.
const LAUNCH_ACCELERATION: f64 = 0.35;
/// Greatest duration of a launch over that of one of the four equal phases in which the whole section could be run.
const LAUNCH_PART: f64 = 0.4;
/// Greatest speed at the end of a launch, over the feed.
const LAUNCH_SPEED: f64 = 0.25;
/// Path behind a launch over its own length until acceleration can be back to zero, at the speed of [`RISEN`] launches.
const REACH: f64 = 7.0;
/// Speed then, over that at the end of the launch.
const RISEN: f64 = 2.2;
/// Places at which a launch is checked, and how often it is shortened.
const CHECKS: u32 = 12;
const ATTEMPTS: u32 = 60;

/// Motion of constant jerk from rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Launch {
    /// Jerk along the path, per s³.
    pub jerk: f64,
    /// How long the jerk lasts, s.
    pub duration_s: f64,
}

impl Launch {
    /// Path from rest to its end.
    pub fn length(&self) -> f64 {
        self.jerk * self.duration_s.powi(3) / 6.0
    }

    /// Motion at the end of a launch from rest.
    pub fn start(&self) -> State {
        let v = 0.5 * self.jerk * self.duration_s * self.duration_s;
        State {
            b: v * v,
            u: self.jerk * self.duration_s,
        }
    }

    /// Motion at the beginning of a launch in reverse, to rest.
    pub fn stop(&self) -> State {
        let State { b, u } = self.start();
        State { b, u: -u }
    }
}

/// The launch at one end of a section of `length`, feed cap of b `cap`; `None` if there is none within the limits.
///
/// `jets(s, &mut jets)` gives the derivatives of all joints at the distance `s` from the rest. For a stop, s counts
/// backward; derivatives may be given either way round. `vigour` is the
/// part of its greatest duration: 1, or less for another try where `between` found no way on.
pub fn launch(
    limits: &[JointLimits],
    cap: f64,
    length: f64,
    vigour: f64,
    mut jets: impl FnMut(f64, &mut [JointJet]),
) -> Option<Launch> {
    let mut at = vec![JointJet::default(); limits.len()];
    jets(0.0, &mut at);
    let (mut a, mut j) = (f64::INFINITY, f64::INFINITY);
    let mut cap = cap;
    let [acceleration_use, jerk_use] = uses(&at, CREST);
    for (jet, limits) in at.iter().zip(limits) {
        let d1 = jet.d1.abs();
        a = a.min(acceleration_use * limits.acceleration / d1);
        j = j.min(jerk_use * limits.jerk / d1);
        let v = limits.velocity / d1;
        cap = cap.min(v * v);
    }
    let jerk = j * LAUNCH_JERK;
    if !(jerk > 0.0 && jerk < f64::INFINITY && cap > 0.0 && length > 0.0) {
        return None;
    }
    // A section of length 2 J T³ is run in four phases of jerk ±J and duration T.
    let phase = cube_root(0.5 * length / jerk);
    let mut duration = (LAUNCH_ACCELERATION * a / jerk).min(LAUNCH_PART * phase);
    duration = duration.min((2.0 * LAUNCH_SPEED * SPEED_USE * cap.sqrt() / jerk).sqrt());
    duration *= vigour;
    for _ in 0..ATTEMPTS {
        let launch = Launch {
            jerk,
            duration_s: duration,
        };
        if launch.length() > 0.0 && allows(limits, &launch, &mut jets, &mut at) {
            return Some(launch);
        }
        duration *= 0.8;
    }
    None
}

/// Whether the limits hold along a launch, and the path behind it can be run at the speed it leads to.
fn allows(
    limits: &[JointLimits],
    launch: &Launch,
    jets: &mut impl FnMut(f64, &mut [JointJet]),
    at: &mut [JointJet],
) -> bool {
    for check in 1..=CHECKS {
        let t = launch.duration_s * f64::from(check) / f64::from(CHECKS);
        let (v, a) = (0.5 * launch.jerk * t * t, launch.jerk * t);
        jets(launch.jerk * t * t * t / 6.0, at);
        let [acceleration_use, jerk_use] = uses(at, CREST);
        for (jet, limits) in at.iter().zip(limits) {
            // Either sign of the odd derivatives, so that a stop is the same as a start.
            let acceleration = (jet.d1 * a).abs() + (jet.d2 * v * v).abs();
            let jerk = (jet.d1 * launch.jerk).abs() + 3.0 * (jet.d2 * v * a).abs() + (jet.d3 * v * v * v).abs();
            if !(acceleration < acceleration_use * limits.acceleration && jerk < jerk_use * limits.jerk) {
                return false;
            }
        }
    }
    let v = RISEN * launch.start().b.sqrt();
    for check in 0..=CHECKS {
        let part = f64::from(check) / f64::from(CHECKS);
        jets(launch.length() * (1.0 + (REACH - 1.0) * part), at);
        for (jet, limits) in at.iter().zip(limits) {
            let fits = (jet.d2 * v * v).abs() < 0.4 * limits.acceleration
                && (jet.d3 * v * v * v).abs() < 0.4 * limits.jerk
                && (jet.d1 * v).abs() < 0.9 * limits.velocity;
            if !fits {
                return false;
            }
        }
    }
    true
}

/// Parts of the jerk limit, and numbers of spans, that are tried on the way from a launch to the feasible profile.
const EASE: [f64; 4] = [0.85, 0.6, 0.4, 0.25];
const MERGE: [usize; 6] = [4, 8, 16, 32, 64, 128];
/// Greatest value over limit along that way.
const CLEAR: f64 = 0.995;

/// No feasible way from rest to the feasible profile was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoStart;

/// Makes a slow profile over a whole grid begin and end in states that may be left at once towards acceleration 0.
///
/// Changes at most the first and last half of the profile, and not more than [`START_REACH`] spans of each.
pub(super) fn between(
    grid: &Grid,
    profile: &mut [State],
    from: Option<State>,
    to: Option<State>,
) -> Result<(), NoStart> {
    let spans = grid.spans();
    if profile.len() != spans + 1 || spans < 4 {
        return Err(NoStart);
    }
    let original = profile.to_vec();
    let both = from.is_some() && to.is_some();
    let room = if both { spans / 2 } else { spans };
    let ends = [(from, false), (to, true)];
    let merge_all = |profile: &mut [State]| {
        ends.iter()
            .all(|&(end, reverse)| end.is_none_or(|end| merge(grid, profile, end, reverse, room)))
    };
    if merge_all(profile) {
        return Ok(());
    }
    // A short section between two rests may not have room for the feasible profile: run through it at one low speed.
    if both && spans <= 4 * START_REACH {
        let least = original.iter().map(|state| state.b).fold(f64::INFINITY, f64::min);
        for b in [least, 0.25 * least, 0.0625 * least] {
            let risen = [from, to].into_iter().flatten().map(|end| RISEN * RISEN * end.b);
            profile.fill(State {
                b: risen.fold(b, f64::min),
                u: 0.0,
            });
            if merge_all(profile)
                && (0..spans).all(|span| span_value(grid, span, profile[span], profile[span + 1]) < 1.0)
            {
                return Ok(());
            }
        }
    }
    profile.copy_from_slice(&original);
    Err(NoStart)
}

/// Spans from an end beyond which [`between`] leaves a profile as it was.
const START_REACH: usize = 256;

/// Replaces the profile near one end by the way from (or to) a launch, within `room` spans.
fn merge(grid: &Grid, profile: &mut [State], end: State, reverse: bool, room: usize) -> bool {
    let spans = grid.spans();
    // Everything as if at the beginning.
    let span = |index: usize| if reverse { spans - 1 - index } else { index };
    let knot = |index: usize| if reverse { spans - index } else { index };
    let turn = |state: State| State {
        b: state.b,
        u: if reverse { -state.u } else { state.u },
    };
    for ease in EASE {
        let Some(risen) = rise(grid, turn(end), ease, room.min(START_REACH / 2), span) else {
            continue;
        };
        let first = risen.len() - 1;
        let plateau = risen[first].b;
        for count in MERGE {
            let last = first + count;
            if last >= room {
                break;
            }
            // Coefficients by span: of the rise, then a smooth step by path length from its plateau to the profile.
            let length = |index: usize| grid.length(span(index));
            let own = |index: usize| coefficient(turn(profile[knot(index)]), length(index));
            let total: f64 = (first..last).map(length).sum();
            let mut s = 0.0;
            let mut coefficients: Vec<f64> = (0..first)
                .map(|index| coefficient(risen[index], length(index)))
                .collect();
            for index in first..last {
                let x = (s + 0.5 * length(index)) / total;
                coefficients.push(plateau + (own(index) - plateau) * x * x * (3.0 - 2.0 * x));
                s += length(index);
            }
            coefficients.push(own(last));
            let mut states = vec![risen[0]];
            for index in 1..=last {
                let u = (coefficients[index] - coefficients[index - 1]) / (length(index - 1) + length(index));
                states.push(State {
                    b: coefficients[index - 1] + u * length(index - 1),
                    u,
                });
            }
            let kept: Vec<State> = (0..=last).map(|index| profile[knot(index)]).collect();
            for (index, &state) in states.iter().enumerate() {
                profile[knot(index)] = turn(state);
            }
            let feasible = |index: usize| {
                let span = span(index);
                span_value(grid, span, profile[span], profile[span + 1]) < CLEAR
            };
            if (0..=last).all(feasible) {
                return true;
            }
            for (index, &state) in kept.iter().enumerate() {
                profile[knot(index)] = state;
            }
        }
    }
    false
}

/// From the end of a launch to acceleration 0: states at knots, the last one with u = 0.
fn rise(grid: &Grid, from: State, ease: f64, room: usize, span: impl Fn(usize) -> usize) -> Option<Vec<State>> {
    let mut state = from;
    let mut states = vec![state];
    for index in 0..room {
        let h = grid.length(span(index));
        // sqrt(b) is greatest at the end of the span.
        let v = (state.b + 2.0 * state.u * h).sqrt();
        let mut jerk = f64::INFINITY;
        for checkpoint in 0..grid.checkpoints(span(index)).len() {
            for row in grid.rows(span(index), checkpoint) {
                jerk = jerk.min((1.0 - row.kink * v).max(0.0) / row.j1.abs());
            }
        }
        let w = ease * jerk / v;
        let u = (state.u - w * h).max(0.0);
        state = State {
            b: state.b + (state.u + u) * h,
            u,
        };
        states.push(state);
        if u == 0.0 {
            return Some(states);
        }
    }
    None
}
