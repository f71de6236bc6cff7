//! Speed over time along one run: seven phases of constant jerk.
//!
//! In:  length, speeds at both ends (acceleration 0 there), limits.
//! Out: the phases. Speed never exceeds the limit, and the end is met exactly: what rounding leaves of the length goes
//! into the phase of constant speed.

use super::limits::PathLimits;
use super::roots::{cubic, greatest};

/// A time of constant jerk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Phase {
    pub(super) duration: f64,
    /// Length run before this phase.
    pub(super) s: f64,
    /// Speed at its beginning.
    pub(super) v: f64,
    /// Acceleration at its beginning.
    pub(super) a: f64,
    pub(super) jerk: f64,
}

impl Phase {
    /// Length run after `t` of the phase.
    pub(super) fn place(&self, t: f64) -> f64 {
        self.s + t * (self.v + t * (self.a / 2.0 + t * self.jerk / 6.0))
    }

    pub(super) fn speed(&self, t: f64) -> f64 {
        self.v + t * (self.a + t * self.jerk / 2.0)
    }

    /// Time after `from` at which `place` is reached, at most the end of the phase.
    pub(super) fn time_at(&self, place: f64, from: f64) -> f64 {
        let (mut low, mut high) = (from, self.duration);
        let mut t = 0.5 * (low + high);
        for _ in 0..80 {
            let error = self.place(t) - place;
            if error > 0.0 {
                high = t;
            } else {
                low = t;
            }
            // Newton's step where it stays inside the bracket, else the middle.
            let newton = t - error / self.speed(t);
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            if (next - t).abs() <= 1e-16 {
                break;
            }
            t = next;
        }
        t.clamp(from, self.duration)
    }
}

/// Times of a change of speed by `dv` from and to acceleration 0: each jerk phase, and the phase between.
fn change_times(dv: f64, limits: &PathLimits) -> (f64, f64) {
    let PathLimits { a, j, .. } = *limits;
    if dv * j <= a * a {
        ((dv / j).sqrt(), 0.0)
    } else {
        (a / j, dv / a - a / j)
    }
}

/// Length of the change of speed between `x` and `y`, acceleration 0 at both.
pub(super) fn change_length(x: f64, y: f64, limits: &PathLimits) -> f64 {
    let (jerked, steady) = change_times((x - y).abs(), limits);
    0.5 * (x + y) * (2.0 * jerked + steady)
}

/// Change of [`change_length`] between `x` and a higher speed `y` with the root `z` of a part of their difference.
fn change_slope(x: f64, y: f64, z: f64, limits: &PathLimits) -> f64 {
    let (jerked, steady) = change_times(y - x, limits);
    let time_slope = if steady > 0.0 {
        2.0 * z / limits.a
    } else {
        2.0 * z / (limits.j * jerked)
    };
    z * (2.0 * jerked + steady) + 0.5 * (x + y) * time_slope
}

/// Time lost by slowing down from `x` to `y`, or speeding up the other way, against running on at `x`.
pub(super) fn time_lost(x: f64, y: f64, limits: &PathLimits) -> f64 {
    let (jerked, steady) = change_times(x - y, limits);
    (2.0 * jerked + steady) * (x - y) / (2.0 * x)
}

/// What is kept back of a length so that rounding never makes a change too long for it.
const KEEP: f64 = 1.0 - 1e-10;

/// Greatest speed of at most `cap` to which `from` can rise over `length`, or from which it can be braked to.
pub(super) fn reachable(from: f64, cap: f64, length: f64, limits: &PathLimits) -> f64 {
    let length = length * KEEP;
    if cap <= from || change_length(from, cap, limits) <= length {
        return cap.max(from).min(cap.max(0.0));
    }
    let PathLimits { a, j, .. } = *limits;
    let build_up = a * a / j;
    let speed = if change_length(from, from + build_up, limits) >= length {
        // (2 from + z^2) z = length sqrt(j), with z^2 the change of speed.
        let z = cubic(2.0 * from, 0.0, 1.0, length * j.sqrt());
        from + z * z
    } else {
        // (y + from) (y - from + a^2 / j) = 2 a length
        let square = (from - 0.5 * build_up) * (from - 0.5 * build_up) + 2.0 * a * length;
        square.sqrt() - 0.5 * build_up
    };
    // Where the change is but some last digits of the speed, rounding up the sum is more than what is kept back.
    (speed * (1.0 - f64::EPSILON)).clamp(from, cap)
}

/// Greatest speed of at most `cap` before a run after which any speed of at most `after` will do.
///
/// Braking all the way to rest can be shorter than braking to a low speed, because it is over at lower speeds; the
/// length needed has its greatest values in between, so the two ends of the choice suffice.
pub(super) fn brakeable(after: f64, cap: f64, length: f64, limits: &PathLimits) -> f64 {
    let part = reachable(after, cap, length, limits);
    if part >= cap {
        cap
    } else {
        part.max(reachable(0.0, cap, length, limits))
    }
}

/// Greatest speed of at most `cap` after a run that begins with `from`, where some such speed exists.
pub(super) fn end_speed(from: f64, cap: f64, length: f64, limits: &PathLimits) -> f64 {
    if cap >= from {
        return reachable(from, cap, length, limits);
    }
    if change_length(from, cap, limits) <= length {
        return cap;
    }
    // Too short to brake to `cap`; some lower speed is within reach (see `brakeable`).
    let (mut low, mut high) = (0.0, cap);
    for _ in 0..54 {
        let middle = 0.5 * (low + high);
        if change_length(from, middle, limits) <= length {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Least speed after a run that begins with `from`.
pub(super) fn least_end_speed(from: f64, length: f64, limits: &PathLimits) -> f64 {
    if change_length(from, 0.0, limits) <= length {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, from);
    for _ in 0..54 {
        let middle = 0.5 * (low + high);
        if change_length(from, middle, limits) <= length {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// Highest speed of a run of `length` from speed `v0` to `v1`, both within reach of each other, and the length that is
/// needed for the changes of speed.
fn peak(v0: f64, v1: f64, length: f64, limits: &PathLimits) -> (f64, f64) {
    let need = |peak: f64| change_length(v0, peak, limits) + change_length(peak, v1, limits);
    let base = v0.max(v1);
    if limits.v <= base {
        return (base, need(base));
    }
    let most = need(limits.v);
    if most <= length {
        return (limits.v, most);
    }
    // By the root of the change of speed, of which the length is a smooth function.
    let rise = |z: f64| {
        let peak = base + z * z;
        (
            need(peak),
            change_slope(v0, peak, z, limits) + change_slope(v1, peak, z, limits),
        )
    };
    let z = greatest(0.0, (limits.v - base).sqrt(), length, rise);
    let peak = base + z * z;
    (peak, need(peak))
}

/// Time of the run of [`profile`], s.
pub(super) fn duration(v0: f64, v1: f64, length: f64, limits: &PathLimits) -> f64 {
    let (peak, need) = peak(v0, v1, length, limits);
    let change = |dv: f64| {
        let (jerked, steady) = change_times(dv, limits);
        2.0 * jerked + steady
    };
    change(peak - v0) + ((length - need) / peak).max(0.0) + change(peak - v1)
}

/// The phases of a run of `length` from speed `v0` to `v1`, both within reach of each other. Empty phases are left out.
pub(super) fn profile(v0: f64, v1: f64, length: f64, limits: &PathLimits) -> Vec<Phase> {
    let (peak, need) = peak(v0, v1, length, limits);
    let mut phases = Vec::with_capacity(7);
    let mut s = 0.0;
    let mut add = |duration: f64, v: f64, a: f64, jerk: f64| {
        if duration > 0.0 {
            phases.push(Phase {
                duration,
                s,
                v,
                a,
                jerk,
            });
            s += duration * (v + duration * (a / 2.0 + duration * jerk / 6.0));
        }
    };
    let j = limits.j;
    let (up, steady) = change_times(peak - v0, limits);
    let a = j * up;
    add(up, v0, 0.0, j);
    add(steady, v0 + 0.5 * a * up, a, 0.0);
    add(up, v0 + a * (0.5 * up + steady), a, -j);
    add(((length - need) / peak).max(0.0), peak, 0.0, 0.0);
    let (down, steady) = change_times(peak - v1, limits);
    let a = j * down;
    add(down, peak, 0.0, -j);
    add(steady, peak - 0.5 * a * down, -a, 0.0);
    add(down, v1 + 0.5 * a * down, -a, j);
    phases
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: PathLimits = PathLimits {
        v: 100.0,
        a: 1000.0,
        j: 20_000.0,
    };

    #[test]
    fn a_long_run_has_seven_phases_with_the_textbook_times() {
        // 0.05 s to 1000 mm/s2, 0.05 s steady, 0.05 s back: 7.5 mm; the same to brake; 85 mm at 100 mm/s.
        let phases = profile(0.0, 0.0, 100.0, &LIMITS);
        let durations: Vec<_> = phases.iter().map(|phase| phase.duration).collect();
        for (got, want) in durations.iter().zip([0.05, 0.05, 0.05, 0.85, 0.05, 0.05, 0.05]) {
            assert!((got - want).abs() < 1e-12, "{durations:?}");
        }
        assert_eq!(durations.len(), 7);
    }

    #[test]
    fn a_short_run_rises_to_what_its_length_allows() {
        // Rest to rest over L with jerk alone: L = 2 v sqrt(v / j), here v = 5 mm/s over 0.158 mm.
        let length = 10.0 * (5.0f64 / 20_000.0).sqrt();
        let peak = profile(0.0, 0.0, length, &LIMITS)
            .iter()
            .map(|phase| phase.v)
            .fold(0.0, f64::max);
        assert!((peak - 5.0).abs() < 1e-9);
    }

    #[test]
    fn braking_to_rest_may_be_shorter_than_braking_to_a_low_speed() {
        let short = change_length(9.0, 0.0, &LIMITS);
        assert!(change_length(9.0, 2.0, &LIMITS) > short);
        let before = brakeable(2.0, 100.0, short, &LIMITS);
        assert!((before - 9.0).abs() < 1e-6);
        assert!(end_speed(before, 2.0, short, &LIMITS) < 1e-3);
    }

    proptest! {
        #[test]
        fn the_end_is_met_and_no_limit_exceeded(
            after in 0.0f64..90.0, before in 0.0f64..1.0, length in 1e-6f64..200.0, v in 1.0f64..500.0,
            a in 10.0f64..5000.0, j in 1e2f64..1e6,
        ) {
            let limits = PathLimits { v, a, j };
            let after = after.min(v);
            let v0 = before * brakeable(after, v, length, &limits);
            let v1 = end_speed(v0, after, length, &limits);
            prop_assert!(v1 <= after);
            prop_assert!(change_length(v0, v1, &limits) <= length);
            let (mut s, mut speed, mut acceleration) = (0.0, v0, 0.0);
            for phase in profile(v0, v1, length, &limits) {
                prop_assert!((phase.s - s).abs() < 1e-9 * length.max(1.0));
                prop_assert!((phase.v - speed).abs() < 1e-9 * v);
                prop_assert!((phase.a - acceleration).abs() < 1e-9 * a);
                let t = phase.duration;
                s += t * (phase.v + t * (phase.a / 2.0 + t * phase.jerk / 6.0));
                speed = phase.v + t * (phase.a + t * phase.jerk / 2.0);
                acceleration = phase.a + t * phase.jerk;
                prop_assert!(phase.jerk.abs() <= j * (1.0 + 1e-12) && acceleration.abs() <= a * (1.0 + 1e-9));
                prop_assert!(speed <= v * (1.0 + 1e-9) && speed >= -1e-9 * v);
            }
            prop_assert!((s - length).abs() < 1e-12 * length.max(1.0), "{s} {length}");
            let sum: f64 = profile(v0, v1, length, &limits).iter().map(|phase| phase.duration).sum();
            prop_assert!((duration(v0, v1, length, &limits) - sum).abs() <= 1e-12 * sum);
            prop_assert!((speed - v1).abs() < 1e-9 * v && acceleration.abs() < 1e-9 * a);
        }

        #[test]
        fn every_speed_below_a_brakeable_one_can_go_on(
            after in 0.0f64..50.0, part in 0.0f64..1.0, length in 1e-4f64..20.0,
        ) {
            let start = part * brakeable(after, 100.0, length, &LIMITS);
            let end = end_speed(start, after, length, &LIMITS);
            prop_assert!(end <= after && change_length(start, end, &LIMITS) <= length);
            let least = least_end_speed(start, length, &LIMITS);
            prop_assert!(least <= end.max(start) && change_length(start, least, &LIMITS) <= length);
        }
    }
}
