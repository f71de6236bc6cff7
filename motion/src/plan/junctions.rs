//! Where pieces meet that are not rounded.
//!
//! In:  stretches and halts.
//! Out: the same with bounds. Where direction or curvature jumps a little, both sides get a short zone of their own that
//! is slow enough for the jump; where it jumps too much, a halt. The jumps of rounded numbers are none.
//!
//! A zone is as long as the path run in three cycles at its speed, so that no difference of set-points up to the third
//! reaches from a jump beyond its zone, and none sees two jumps.

use super::Settings;
use super::limits::{Bounds, jumps};
use super::profile::reachable;
use super::smooth::{Passed, Stretch};

/// A stretch with the bounds of its geometry.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounded {
    pub(super) stretch: Stretch,
    pub(super) bounds: Bounds,
}

/// What comes out.
#[derive(Clone, Copy, Debug)]
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
    pub(super) fn push(&mut self, passed: &Passed, settings: &Settings, out: &mut Vec<Joined>) {
        match passed {
            Passed::Stop => {
                self.flush(out);
                out.push(Joined::Stop);
            }
            Passed::Stretch(stretch) => {
                let mut next = Bounded {
                    stretch: *stretch,
                    bounds: stretch.bounds.unwrap_or_else(|| Bounds::new(&stretch.piece)),
                };
                if let Some(last) = &self.last {
                    meet(last, &mut next, settings, out);
                }
                self.last = Some(next);
            }
        }
    }

    pub(super) fn flush(&mut self, out: &mut Vec<Joined>) {
        out.extend(self.last.take().map(Joined::Stretch));
    }
}

/// What there is where two stretches meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meeting {
    /// Direction and curvature go on.
    Smooth,
    /// A jump that is passed at this speed, constant over `zone` (mm) on both sides.
    Slow { speed: f64, zone: f64 },
    /// A jump that is passed at rest.
    Stop,
}

/// How the end of `a` and the beginning of `b` meet, of which `lengths` may be used. Every speed up to that of a slow
/// meeting can be reached from any other within either stretch.
pub(super) fn meeting(a: &Stretch, b: &Stretch, lengths: [f64; 2], settings: &Settings) -> Meeting {
    let Some(jump) = jumps(&a.piece.jet(a.piece.length()), &b.piece.jet(0.0)) else {
        return Meeting::Smooth;
    };
    if settings.joints.is_some() {
        // What a jump of the axes is for joints depends on the place.
        return Meeting::Stop;
    }
    let reach_s = 3.0 * settings.cycle_s;
    let own = Bounds::new(&a.piece).union(&Bounds::new(&b.piece));
    let feed = a.feed.min(b.feed);
    if is_rounding(&jump, &own, feed, lengths, settings) {
        return Meeting::Smooth;
    }
    let limits = jump.union(&own).limits(feed, settings);
    // A quarter of a stretch at each end for its zone; what is left for changing speed. A change to a third of a speed
    // takes 9 % more length than one to rest.
    let shortest = lengths[0].min(lengths[1]);
    let speed = limits.v.min(0.25 * shortest / reach_s);
    let speed = reachable(0.0, speed, 0.9 * 0.5 * shortest, &limits);
    // Slower than what a few cycles of jerk give, rest is no worse.
    if speed < limits.j * (2.0 * settings.cycle_s) * (2.0 * settings.cycle_s) {
        return Meeting::Stop;
    }
    Meeting::Slow {
        speed,
        zone: reach_s * speed,
    }
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
fn meet(last: &Bounded, next: &mut Bounded, settings: &Settings, out: &mut Vec<Joined>) {
    let (a, b) = (&last.stretch.piece, &next.stretch.piece);
    let Some(jump) = jumps(&a.jet(a.length()), &b.jet(0.0)) else {
        out.push(Joined::Stretch(*last));
        return;
    };
    let reach_s = 3.0 * settings.cycle_s;
    let own = last.bounds.union(&next.bounds);
    let feed = last.stretch.feed.min(next.stretch.feed);
    if is_rounding(&jump, &own, feed, [a.length(), b.length()], settings) {
        out.push(Joined::Stretch(*last));
        return;
    }
    let limits = jump.union(&own).limits(feed, settings);
    let speed = limits.v.min(0.5 * a.length().min(b.length()) / reach_s);
    // Slower than what a few cycles of jerk give, rest is no worse.
    if speed < limits.j * (2.0 * settings.cycle_s) * (2.0 * settings.cycle_s) {
        out.push(Joined::Stretch(*last));
        out.push(Joined::Stop);
        return;
    }
    let zone = reach_s * speed;
    let part = |whole: &Bounded, from: f64, to: f64| {
        whole
            .stretch
            .piece
            .cut(from, to)
            .map(|piece| Stretch { piece, ..whole.stretch })
    };
    let slow = |stretch: Stretch, own: &Bounds| {
        Joined::Stretch(Bounded {
            stretch: Stretch {
                feed: speed.min(stretch.feed),
                ..stretch
            },
            bounds: jump.union(own),
        })
    };
    let end = a.length();
    let (main, before) = (part(last, 0.0, end - zone), part(last, end - zone, end));
    let (after, rest) = (part(next, 0.0, zone), part(next, zone, b.length()));
    out.extend(main.map(|stretch| Joined::Stretch(Bounded { stretch, ..*last })));
    out.extend(before.map(|stretch| slow(stretch, &last.bounds)));
    out.extend(after.map(|stretch| slow(stretch, &next.bounds)));
    if let Some(stretch) = rest {
        next.stretch = stretch;
    }
}
