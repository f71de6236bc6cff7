//! The spline that a run becomes.
//!
//! In:  coefficients, the run.
//! Out: how far the one is from the other; moves on quintics.

use super::Blended;
use super::least_jerk::Plane;
use super::pace::Pace;
use super::track::Track;
use crate::canon::AXES;
use crate::path::{BlendEnd, Group, Jet};
use crate::plan::program::{Corner, Move};
use crate::plan::smooth::Leg;
use crate::plan::smooth::round::curve;

/// Steps a span in which a curve is compared with the run; finer ones next to a vertex.
const STEPS: usize = 4;
const FINE: u32 = 8;

/// A curve compared with the run.
pub(super) struct Walk {
    /// Places next to it, [`STEPS`] a span.
    pub(super) places: Vec<f64>,
    /// Greatest distance, mm, a little on the safe side.
    pub(super) off: f64,
}

/// A spline with even knots.
pub(super) struct Curve {
    pub(super) spline: Vec<Plane>,
    pub(super) ends: [BlendEnd; 2],
}

impl Curve {
    /// Position, first and second derivative at a knot.
    pub(super) fn knot(&self, k: usize) -> [Plane; 3] {
        let [a, b, c] = [self.spline[k], self.spline[k + 1], self.spline[k + 2]];
        let each = |of: fn(f64, f64, f64) -> f64| [0, 1].map(|i| of(a[i], b[i], c[i]));
        [
            each(|a, b, c| (a + 4.0 * b + c) / 6.0),
            each(|a, _, c| 0.5 * (c - a)),
            each(|a, b, c| a - 2.0 * b + c),
        ]
    }

    /// Looks at it in small steps: where it is next to, and how far it is off.
    pub(super) fn walk(&self, track: &Track, from: f64) -> Walk {
        let spans = self.spline.len() - 3;
        let mut walk = Walk {
            places: vec![from],
            off: 0.0,
        };
        let (mut last, mut q) = (from, value(&self.spline, 0.0));
        // To the left of the same move, at the last two steps.
        let mut beside = [f64::NAN; 2];
        for k in 1..=STEPS * spans {
            let x = k as f64 / STEPS as f64;
            let next = value(&self.spline, x);
            let way = libm::hypot(next[0] - q[0], next[1] - q[1]);
            let window = [last, last + 2.0 * way];
            let near = track.nearest(&next, window);
            walk.off = walk.off.max(near.1);
            let [leg, next_leg] = [last, near.0].map(|s| track.leg_at(s));
            let (place, along) = track.place(near.0);
            let left = along[0] * (next[1] - place[1]) - along[1] * (next[0] - place[0]);
            if leg == next_leg {
                walk.off = walk.off.max(crest([beside[0], beside[1], left]));
                beside = [beside[1], left];
            } else {
                beside = [f64::NAN, left];
                // The distance has a kink at the vertex.
                for fine in 1..FINE {
                    let x = x - (1.0 - f64::from(fine) / f64::from(FINE)) / STEPS as f64;
                    walk.off = walk.off.max(track.nearest(&value(&self.spline, x), window).1);
                }
                // All of the way between is due, too.
                for leg in leg..next_leg {
                    let vertex = track.flat(&track.legs[leg].1.jet(f64::INFINITY).q);
                    let there = [0, 1].map(|i| vertex[i] - 0.5 * (q[i] + next[i]));
                    walk.off = walk.off.max(libm::hypot(there[0], there[1]) - 0.5 * way);
                }
            }
            walk.places.push(near.0);
            (last, q) = (near.0, next);
        }
        walk.off *= 1.005;
        walk
    }

    pub(super) fn into_legs(
        self,
        run: &[Leg],
        [from, to]: [f64; 2],
        track: &Track,
        walk: &Walk,
        pace: &Pace,
    ) -> Option<Blended> {
        let spans = self.spline.len() - 3;
        let mut legs = Vec::with_capacity(spans);
        let mut begin = self.ends[0];
        let mut owner = &run[0].part;
        for span in 0..spans {
            let end = if span + 1 == spans {
                self.ends[1]
            } else {
                let [q, first, second] = self.knot(span + 1);
                let pace = libm::hypot(first[0], first[1]);
                let along = first.map(|x| x / pace);
                let pace_change = second[0] * along[0] + second[1] * along[1];
                let bend = [0, 1].map(|i| (second[i] - pace_change * along[i]) / (pace * pace));
                let leg = Jet {
                    q: track.position(&q),
                    d1: track.space(&along),
                    d2: track.space(&bend),
                    d3: [0.0; AXES],
                };
                BlendEnd { leg, pace, pace_change }
            };
            let next = if span + 1 == spans {
                &run[run.len() - 1].part
            } else {
                &run[track.leg_at(walk.places[STEPS * (span + 1)])].part
            };
            legs.push(Leg {
                part: Box::new(Move {
                    piece: curve(&begin, &end, Group::Main)?.in_frame(*next.piece.frame()),
                    feed: owner.feed.min(next.feed),
                    corner: Corner::Exact,
                    ..**next
                }),
                room: [0.0; 2],
                whole: next.piece.length(),
            });
            owner = next;
            begin = end;
        }
        let speed = pace.at(pace.time_at(track.start(run.len() - 1) + to)).v;
        Some(Blended { legs, from, to, speed })
    }
}

/// Greatest magnitude of the parabola through three values at even steps, if it has its vertex between them; 0 where it has not.
fn crest([a, b, c]: [f64; 3]) -> f64 {
    let (rise, bend) = (c - a, a - 2.0 * b + c);
    if rise.abs() < 2.0 * bend.abs() {
        (b - rise * rise / (8.0 * bend)).abs()
    } else {
        0.0
    }
}

/// Weights of four coefficients at a parameter, counted in spans, and the first of them.
pub(super) fn weights(x: f64, spans: usize) -> (usize, [f64; 4]) {
    let span = (x as usize).min(spans - 1);
    let u = x - span as f64;
    let w = 1.0 - u;
    let inner = |u: f64| (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0;
    (span, [w * w * w / 6.0, inner(u), inner(w), u * u * u / 6.0])
}

/// Where a spline is at a parameter.
pub(super) fn value(spline: &[Plane], x: f64) -> Plane {
    let (span, weights) = weights(x, spline.len() - 3);
    [0, 1].map(|i| (0..4).map(|k| weights[k] * spline[span + k][i]).sum())
}
