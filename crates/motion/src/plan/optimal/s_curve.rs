//! The fastest motion over a straight stretch between known states: constant limits have a closed form.
//!
//! In:  speed and acceleration at both ends, length, limits.
//! Out: up to seven phases of constant jerk: away from the first acceleration to one peak of speed, and from there to the last.

use super::solver::State;
use crate::plan::limits::PathLimits;
use crate::plan::profile::Phase;

/// Bisections of the peak of speed at the most; mostly, false position needs a few.
const HALVINGS: u32 = 60;
/// Part of the length at which the peak is near enough: the rest is run at the peak.
const NEAR: f64 = 1e-9;

/// A change of speed from a state to acceleration 0: jerk, none, jerk the other way round.
#[derive(Clone, Copy, Debug)]
struct Rise {
    /// How long the three phases are, s.
    times: [f64; 3],
    /// Greatest acceleration.
    a: f64,
    length: f64,
}

impl Rise {
    /// From a state up to a speed; there must be room for it: [`least_peak`].
    fn new(v: f64, a: f64, peak: f64, limits: &PathLimits) -> Rise {
        let j = limits.j;
        let square = (j * (peak - v) + 0.5 * a * a).max(0.0);
        let most = square.sqrt().max(a).min(limits.a.max(a));
        let steady = ((square - most * most) / (j * most)).max(0.0);
        let times = [(most - a) / j, if most > 0.0 { steady } else { 0.0 }, most / j];
        let mut length = 0.0;
        let mut speed = v;
        for (t, a, j) in [(times[0], a, j), (times[1], most, 0.0), (times[2], most, -j)] {
            length += t * (speed + t * (0.5 * a + t * j / 6.0));
            speed += t * (a + 0.5 * t * j);
        }
        Rise { times, a: most, length }
    }
}

/// Speed at which acceleration is gone if jerk takes it away at once.
fn least_peak(v: f64, a: f64, j: f64) -> f64 {
    v + 0.5 * a * a.abs() / j
}

/// The phases from one state to another over a length; `None` where the motion has no peak of speed with acceleration 0 between,
/// or would stop on the way.
pub(super) fn s_curve(from: State, to: State, length: f64, limits: &PathLimits) -> Option<Vec<Phase>> {
    // The end is a rise seen backward.
    let ends = [(from.b.sqrt(), from.u), (to.b.sqrt(), -to.u)];
    let least = ends.map(|(v, a)| least_peak(v, a, limits.j));
    let rises = |peak: f64| ends.map(|(v, a)| Rise::new(v, a, peak, limits));
    let room = |peak: f64| {
        let [first, last] = rises(peak);
        length - first.length - last.length
    };
    let lowest = least[0].max(least[1]);
    let within = least.iter().all(|speed| *speed > 0.0) && ends.iter().all(|(_, a)| a.abs() <= limits.a);
    let mut low = (lowest, room(lowest));
    if !(within && lowest <= limits.v && low.1 >= 0.0) {
        return None;
    }
    let mut high = (limits.v, room(limits.v));
    if high.1 >= 0.0 {
        low = high;
    }
    // False position, of which the side that stays is taken for half as far (Illinois).
    let (mut weight, mut below) = (1.0, false);
    for _ in 0..HALVINGS {
        if low.1 <= NEAR * length || high.1 >= 0.0 {
            break;
        }
        let [a, b] = if below {
            [low.1, weight * high.1]
        } else {
            [weight * low.1, high.1]
        };
        let peak = (low.0 + (high.0 - low.0) * a / (a - b)).clamp(low.0, high.0);
        let found = (peak, room(peak));
        let is_low = found.1 >= 0.0;
        weight = if is_low == below { 0.5 * weight } else { 1.0 };
        below = is_low;
        *(if is_low { &mut low } else { &mut high }) = found;
    }
    let (peak, left) = low;
    if left > NEAR * length && high.1 < 0.0 {
        return None;
    }
    let [first, last] = rises(peak);
    let j = limits.j;
    let mut phases = Vec::with_capacity(7);
    let mut s = 0.0;
    let (mut v, mut a) = ends[0];
    let [up, steady, down] = first.times;
    let [end, before, begin] = last.times;
    let cruise = left.max(0.0) / peak;
    for (duration, jerk, after) in [
        (up, j, first.a),
        (steady, 0.0, first.a),
        (down, -j, 0.0),
        (cruise, 0.0, 0.0),
        (begin, -j, -last.a),
        (before, 0.0, -last.a),
        (end, j, to.u),
    ] {
        if duration > 0.0 {
            let phase = Phase {
                duration,
                s,
                v,
                a,
                jerk,
            };
            s = phase.place(duration);
            v = phase.speed(duration);
            phases.push(phase);
        }
        a = after;
    }
    Some(phases)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::profile;
    use proptest::prelude::*;

    const LIMITS: PathLimits = PathLimits {
        v: 100.0,
        a: 1000.0,
        j: 20_000.0,
    };

    #[test]
    fn between_speeds_without_acceleration_it_is_the_seven_phases_of_a_run() {
        for (v0, v1, length) in [(20.0, 50.0, 100.0), (20.0, 50.0, 5.0), (90.0, 1.0, 40.0)] {
            let state = |v: f64| State { b: v * v, u: 0.0 };
            let found = s_curve(state(v0), state(v1), length, &LIMITS).unwrap();
            let time: f64 = found.iter().map(|phase| phase.duration).sum();
            let known = profile::duration(v0, v1, length, &LIMITS);
            assert!((time - known).abs() < 1e-8 * known, "{time} {known}");
        }
    }

    proptest! {
        #[test]
        fn it_leads_from_state_to_state_within_the_limits(
            v in [0.1f64..100.0, 0.1f64..100.0], a in [-1000.0f64..1000.0, -1000.0f64..1000.0], length in 1e-3f64..200.0,
            j in 1e3f64..1e6,
        ) {
            let limits = PathLimits { j, ..LIMITS };
            let [from, to] = [0, 1].map(|k| State { b: v[k] * v[k], u: a[k] });
            let Some(phases) = s_curve(from, to, length, &limits) else { return Ok(()) };
            let (mut s, mut speed, mut acceleration) = (0.0, v[0], a[0]);
            for phase in phases {
                prop_assert!((phase.s - s).abs() < 1e-9 * length.max(1.0));
                prop_assert!((phase.v - speed).abs() < 1e-7 && (phase.a - acceleration).abs() < 1e-6);
                let t = phase.duration;
                s = phase.place(t);
                speed = phase.speed(t);
                acceleration = phase.a + t * phase.jerk;
                prop_assert!(phase.jerk.abs() <= j && acceleration.abs() <= limits.a * (1.0 + 1e-9));
                prop_assert!(speed <= limits.v * (1.0 + 1e-9) && speed > 0.0);
            }
            prop_assert!((s - length).abs() < 1e-8 * length.max(1.0), "{s} {length}");
            prop_assert!((speed - v[1]).abs() < 1e-7 && (acceleration - a[1]).abs() < 1e-6);
        }
    }
}
