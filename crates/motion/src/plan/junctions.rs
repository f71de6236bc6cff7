//! Where pieces meet that are not rounded.
//!
//! In:  stretches and halts.
//! Out: the same with bounds. Where direction or curvature jumps a little, both sides get a short zone of their own that
//! is slow enough for the jump; where it jumps too much, a halt. The jumps of rounded numbers are none.
//!
//! A zone is as long as the path run in three cycles at its speed, so that no difference of set-points up to the third
//! reaches from a jump beyond its zone, and none sees two jumps.
//!
//! The classic planner gets zones as stretches of their own, with bounds that count the jump ([`Junctions`]). For the optimal
//! planner, a jump is a part of the limits that it takes within its zone ([`meeting`]): speed may change there, too.

use super::limits::{Bounds, PathLimits, jumps};
use super::optimal::solver::Taken;
use super::profile::{change_length, reachable};
use super::smooth::{Passed, Stretch};
use super::{FEED_OVERRIDE_MAX, Settings};
use crate::canon::AXES;

/// A stretch with the bounds of its geometry.
#[derive(Debug)]
pub(super) struct Bounded {
    pub(super) stretch: Box<Stretch>,
    pub(super) bounds: Bounds,
}

/// What comes out.
#[derive(Debug)]
pub(super) enum Joined {
    Stretch(Bounded),
    Stop,
}

/// Looks at both sides of each meeting point, with one stretch of delay.
#[derive(Debug, Default)]
pub(super) struct Junctions {
    last: Option<Bounded>,
}

impl Junctions {
    pub(super) fn push(&mut self, passed: Passed, settings: &Settings, out: &mut Vec<Joined>) {
        match passed {
            Passed::Stop => {
                self.flush(out);
                out.push(Joined::Stop);
            }
            Passed::Stretch(stretch) => self.go_on(stretch, settings, out),
            Passed::Seam(seam) => {
                for stretch in seam.rounded {
                    self.go_on(stretch, settings, out);
                }
            }
        }
    }

    fn go_on(&mut self, mut stretch: Box<Stretch>, settings: &Settings, out: &mut Vec<Joined>) {
        let known = stretch.bounds.take();
        let mut next = Bounded {
            bounds: known.map_or_else(|| Bounds::new(&stretch.piece), |bounds| *bounds),
            stretch,
        };
        if let Some(last) = self.last.take() {
            meet(last, &mut next, settings, out);
        }
        self.last = Some(next);
    }

    pub(super) fn flush(&mut self, out: &mut Vec<Joined>) {
        out.extend(self.last.take().map(Joined::Stretch));
    }
}

/// A jump of direction or curvature that is passed at speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kink {
    /// Greatest speed within `zone` of it, on both sides, mm/s.
    pub(super) speed: f64,
    /// Path that this speed takes in three cycles, mm; no longer than either side.
    pub(super) zone: f64,
    /// What set-points beside it take of the limits of every axis.
    pub(super) taken: [Taken; AXES],
}

/// What there is where two stretches meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meeting {
    /// Direction and curvature go on.
    Smooth,
    /// A jump that is passed at speed.
    Slow(Kink),
    /// A jump that is passed at rest.
    Stop,
}

/// Part of the limits that a kink may take.
const KINK_PART: f64 = 0.9;
/// What passing a kink at speed must gain over a rest, of the time in which speed rises from the rest: a rest divides what is
/// planned.
const LEAST_GAIN: f64 = 0.02;

/// How the end of `a` and the beginning of `b` meet, at any override.
pub(super) fn meeting(a: &Stretch, b: &Stretch, settings: &Settings) -> Meeting {
    let Some(jump) = jumps(&a.piece.jet(a.piece.length()), &b.piece.jet(0.0)) else {
        return Meeting::Smooth;
    };
    if settings.joints.is_some() {
        // What a jump of the axes is for joints depends on the place.
        return Meeting::Stop;
    }
    let cycle_s = settings.cycle_s;
    let reach_s = 3.0 * cycle_s;
    let fastest = |stretch: &Stretch| match stretch.enables.feed_override {
        true => FEED_OVERRIDE_MAX * stretch.feed,
        false => stretch.feed,
    };
    let feed = fastest(a).min(fastest(b));
    let lengths = [a, b].map(|stretch| stretch.piece.length());
    let own = Bounds::new(&a.piece).union(&Bounds::new(&b.piece));
    if is_rounding(&jump, &own, feed, lengths, settings) {
        return Meeting::Smooth;
    }
    // No more than the shorter side in three cycles: no difference of set-points up to the third sees two kinks.
    let speed = jump
        .speed_with(KINK_PART, feed, settings)
        .min(lengths[0].min(lengths[1]) / reach_s);
    if !is_worth_passing(a, b, speed, settings) {
        return Meeting::Stop;
    }
    let most = acceleration_at(&jump, [a, b], speed, settings);
    let taken = core::array::from_fn(|axis| {
        let (kink, limits) = (jump.kink[axis], settings.axes[axis]);
        Taken {
            acceleration: limits.map_or(0.0, |limits| {
                (kink * speed / cycle_s).max(limits.acceleration - most.axis)
            }),
            // The speed that a difference of set-points sees is that of up to a cycle before or after.
            jerk: kink * most.path / cycle_s,
            jerk_by_speed: kink / (cycle_s * cycle_s) + 0.75 * jump.bend[axis] * speed / cycle_s,
        }
    });
    Meeting::Slow(Kink {
        speed,
        zone: reach_s * speed,
        taken,
    })
}

/// Greatest acceleration beside a kink: of every axis, and so along the path.
struct Most {
    axis: f64,
    path: f64,
}

/// Enough to reach the speed, and so little that it takes little of the jerk.
fn acceleration_at(jump: &Bounds, sides: [&Stretch; 2], speed: f64, settings: &Settings) -> Most {
    /// Part of the greatest acceleration on the way from rest to the speed by jerk alone.
    const PART: f64 = 0.5;
    /// Part of the jerk limit that need not be saved.
    const LITTLE: f64 = 0.003;
    let mut path = f64::INFINITY;
    let mut enough = f64::INFINITY;
    for (kink, limits) in jump.kink.iter().zip(&settings.axes) {
        if let Some(limits) = limits
            && *kink > 0.0
        {
            path = path.min(LITTLE * limits.jerk * settings.cycle_s / kink);
            enough = enough.min(PART * (limits.jerk * speed).sqrt());
        }
    }
    path = path.max(enough);
    let mut axis = f64::INFINITY;
    for (stretch, s) in sides.into_iter().zip([sides[0].piece.length(), 0.0]) {
        let jet = stretch.piece.jet(s);
        let steepest = jet.d1.iter().fold(0.0f64, |most, d| most.max(d.abs()));
        axis = axis.min(path * steepest);
    }
    Most { axis, path }
}

/// Whether it takes less time to pass a kink at this speed, steady for three cycles on both sides, than at rest. What lies on
/// either side is run up to its middle.
fn is_worth_passing(a: &Stretch, b: &Stretch, speed: f64, settings: &Settings) -> bool {
    let reach_s = 3.0 * settings.cycle_s;
    let limits = |stretch: &Stretch| Bounds::new(&stretch.piece).limits(stretch.feed, settings);
    // Slower than what a few cycles of jerk give, rest is no worse: beside a move that is next to nothing.
    let [of_a, of_b] = [limits(a), limits(b)];
    if speed < of_a.j.min(of_b.j) * (2.0 * settings.cycle_s).powi(2) {
        return false;
    }
    let gain_s = |(stretch, limits): (&Stretch, PathLimits)| {
        let length = 0.5 * stretch.piece.length();
        let [_, passed_s] = run_up_s(speed, length - reach_s * speed, &limits);
        let [rising_s, rest_s] = run_up_s(0.0, length, &limits);
        rest_s - LEAST_GAIN * rising_s - (reach_s + passed_s)
    };
    speed > 0.0 && gain_s((a, of_a)) + gain_s((b, of_b)) > 0.0
}

/// Time over a length that begins with a speed, s: while speed rises, and all of it.
fn run_up_s(from: f64, length: f64, limits: &PathLimits) -> [f64; 2] {
    let to = reachable(from, limits.v, length, limits);
    let change = change_length(from, to, limits).min(length);
    let rising_s = 2.0 * change / (from + to);
    [rising_s, rising_s + (length - change) / to]
}

/// Whether a jump is that of rounded numbers: as many of it as lie within the reach of a difference take next to nothing of any
/// limit, however fast they are passed.
fn is_rounding(jump: &Bounds, own: &Bounds, feed: f64, lengths: [f64; 2], settings: &Settings) -> bool {
    /// Part of the limits; both planners leave more.
    const PART: f64 = 0.002;
    let cycle = settings.cycle_s;
    let speed = own.speed_with(1.0, feed, settings);
    let count = 1.0 + 3.0 * cycle * speed / lengths[0].min(lengths[1]);
    settings.axes.iter().enumerate().all(|(axis, limits)| {
        let Some(limits) = limits else { return true };
        let kink = count * jump.kink[axis] * speed / cycle;
        let bend = count * 0.75 * jump.bend[axis] * speed * speed / cycle;
        kink <= PART * limits.acceleration && kink / cycle + bend <= PART * limits.jerk
    })
}

/// Lets `last` go; puts zones or a halt between it and `next`, which is shortened by its zone.
fn meet(last: Bounded, next: &mut Bounded, settings: &Settings, out: &mut Vec<Joined>) {
    let (a, b) = (&last.stretch.piece, &next.stretch.piece);
    let Some(jump) = jumps(&a.jet(a.length()), &b.jet(0.0)) else {
        out.push(Joined::Stretch(last));
        return;
    };
    let reach_s = 3.0 * settings.cycle_s;
    let own = last.bounds.union(&next.bounds);
    let feed = last.stretch.feed.min(next.stretch.feed);
    if is_rounding(&jump, &own, feed, [a.length(), b.length()], settings) {
        out.push(Joined::Stretch(last));
        return;
    }
    let limits = jump.union(&own).limits(feed, settings);
    let speed = limits.v.min(0.5 * a.length().min(b.length()) / reach_s);
    // Slower than what a few cycles of jerk give, rest is no worse.
    if speed < limits.j * (2.0 * settings.cycle_s) * (2.0 * settings.cycle_s) {
        out.push(Joined::Stretch(last));
        out.push(Joined::Stop);
        return;
    }
    let zone = reach_s * speed;
    let part = |whole: &Bounded, [from, to]: [f64; 2], is_zone: bool| {
        let piece = whole.stretch.piece.cut(from, to)?;
        let mut stretch = whole.stretch.clone();
        stretch.piece = piece;
        let mut bounds = whole.bounds;
        if is_zone {
            stretch.feed = speed.min(stretch.feed);
            bounds = jump.union(&bounds);
        }
        Some(Bounded { stretch, bounds })
    };
    let (end, length) = (a.length(), b.length());
    let before = [
        part(&last, [0.0, end - zone], false),
        part(&last, [end - zone, end], true),
    ];
    let after = [part(next, [0.0, zone], true), part(next, [zone, length], false)];
    let [zone, rest] = after;
    out.extend(before.into_iter().chain([zone]).flatten().map(Joined::Stretch));
    if let Some(rest) = rest {
        *next = rest;
    }
}
