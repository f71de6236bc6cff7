//! Corners of the programmed path.
//!
//! In:  moves.
//! Out: stretches: what is left of the moves and the blends between them; halts where the machine must come to rest.
//!
//! On dense programs (short straight moves, small angles) a leg is used up by the corners at both of its ends. There the
//! curvature in its middle is not forced to 0 but taken from the turning at both corners, so that curvature stays even
//! along the path. Therefore a corner waits until the move behind its second leg is known.

use std::collections::VecDeque;

use super::round::{Rounded, distance, join, reach, round, turning};
use crate::canon::AXES;
use crate::path::{Group, Piece, Shape};
use crate::plan::Settings;
use crate::plan::limits::Bounds;
use crate::plan::profile::{reachable, time_lost};
use crate::plan::program::{Corner, Move};

/// A piece of path with all that bounds its speed besides geometry.
#[derive(Clone, Copy, Debug)]
pub(in crate::plan) struct Stretch {
    pub(in crate::plan) piece: Piece,
    pub(in crate::plan) feed: f64,
    pub(in crate::plan) line: u32,
    pub(in crate::plan) rapid: bool,
}

/// What comes out.
#[derive(Clone, Copy, Debug)]
pub(in crate::plan) enum Passed {
    Stretch(Stretch),
    /// Rest before what follows.
    Stop,
}

/// A move of which the beginning is decided.
#[derive(Clone, Copy, Debug)]
struct Leg {
    part: Move,
    /// What the corner before it has taken.
    from: f64,
    /// Curvature there.
    bend: [f64; AXES],
}

/// Rounds corners, with one move of delay.
#[derive(Debug, Default)]
pub(in crate::plan) struct Corners {
    legs: VecDeque<Leg>,
}

impl Corners {
    pub(in crate::plan) fn push(&mut self, part: Move, settings: &Settings, out: &mut Vec<Passed>) {
        self.legs.push_back(Leg {
            part,
            from: 0.0,
            bend: [0.0; AXES],
        });
        if self.legs.len() > 2 {
            self.pass_one(settings, out);
        }
    }

    /// Nothing follows: the last move ends where it is programmed to end.
    pub(in crate::plan) fn flush(&mut self, settings: &Settings, out: &mut Vec<Passed>) {
        while self.legs.len() > 1 {
            self.pass_one(settings, out);
        }
        if let Some(leg) = self.legs.pop_front() {
            rest_of(&leg, 0.0, out);
        }
    }

    /// Decides the corner between the two oldest moves and lets the older one go. There are at least two.
    fn pass_one(&mut self, settings: &Settings, out: &mut Vec<Passed>) {
        let Some(leg) = self.legs.pop_front() else { return };
        let (Some(mut next), after) = (self.legs.front().copied(), self.legs.get(1)) else {
            return;
        };
        let (a, b) = (&leg.part, &next.part);
        let tolerance = match a.corner {
            Corner::Round(tolerance) if joinable(a, b) => tolerance,
            Corner::Exact if joinable(a, b) => {
                rest_of(&leg, 0.0, out);
                return;
            }
            Corner::Exact | Corner::Stop | Corner::Round(_) => {
                rest_of(&leg, 0.0, out);
                out.push(Passed::Stop);
                return;
            }
        };
        match rounded(&leg, b, after.map(|leg| &leg.part), tolerance, settings) {
            Some((corner, bend)) => {
                rest_of(&leg, corner.before, out);
                let feed = a.feed.min(b.feed);
                out.push(Passed::Stretch(Stretch {
                    piece: corner.blend,
                    feed,
                    line: b.line,
                    rapid: b.rapid,
                }));
                next.from = corner.after;
                next.bend = bend;
                self.legs[0] = next;
            }
            None => rest_of(&leg, 0.0, out),
        }
    }
}

/// Whether speed may be carried from one move into the other.
fn joinable(a: &Move, b: &Move) -> bool {
    a.rapid == b.rapid && a.piece.group() == b.piece.group()
}

/// Lets go what the corners have left of a move.
fn rest_of(leg: &Leg, taken: f64, out: &mut Vec<Passed>) {
    let Move {
        piece,
        feed,
        line,
        rapid,
        ..
    } = leg.part;
    if let Some(piece) = piece.cut(leg.from, piece.length() - taken) {
        out.push(Passed::Stretch(Stretch {
            piece,
            feed,
            line,
            rapid,
        }));
    }
}

/// The corner between `leg` and `b`, and the curvature with which it ends.
fn rounded(
    leg: &Leg,
    b: &Move,
    after: Option<&Move>,
    tolerance: f64,
    settings: &Settings,
) -> Option<(Rounded, [f64; AXES])> {
    let a = &leg.part;
    if a.piece.group() == Group::Rotary {
        return None;
    }
    let straight = [0.0; AXES];
    if dense(a, b) {
        let bend = match after {
            Some(c) if dense(b, c) && joinable(b, c) => middle_bend(&a.piece, &b.piece, &c.piece),
            Some(_) | None => straight,
        };
        if let Some(corner) = join(&a.piece, &leg.bend, &b.piece, &bend, tolerance) {
            return Some((corner, bend));
        }
        if let Some(corner) = join(&a.piece, &leg.bend, &b.piece, &straight, tolerance) {
            return Some((corner, straight));
        }
    }
    if leg.bend != straight {
        return None;
    }
    let (length, other) = (a.piece.length(), b.piece.length());
    let room = (length - leg.from).min(length / 2.0);
    let corner = round(&a.piece, room, &b.piece, other / 2.0, tolerance)?;
    worth_it(&corner, a, b, settings).then_some((corner, straight))
}

/// Whether running through a blend takes less time than a stop at the corner. Where the tolerance is small against what
/// the jerk allows, it may not; and a stop keeps to the path.
fn worth_it(corner: &Rounded, a: &Move, b: &Move, settings: &Settings) -> bool {
    let blend = Bounds::of(&corner.blend).limits(a.feed.min(b.feed), settings);
    let (mut stopping, mut rounding) = (0.0, corner.blend.length() / blend.v);
    for (leg, used) in [(a, corner.before), (b, corner.after)] {
        let limits = Bounds::of(&leg.piece).limits(leg.feed, settings);
        // What the leg allows in its middle, coming from rest.
        let speed = reachable(0.0, limits.v, leg.piece.length() / 2.0, &limits);
        stopping += time_lost(speed, 0.0, &limits);
        rounding += time_lost(speed, blend.v.min(speed), &limits) - used / speed;
    }
    rounding < stopping
}

/// Whether a corner is one of a sampled curve: short straight legs of similar length, a small angle, and so well within
/// the tolerance that it takes all it can get of both.
fn dense(a: &Move, b: &Move) -> bool {
    const ANGLE: f64 = 0.35;
    const RATIO: f64 = 4.0;
    let (Corner::Round(tolerance), Shape::Line(_), Shape::Line(_)) = (a.corner, a.piece.shape(), b.piece.shape())
    else {
        return false;
    };
    let (la, lb) = (a.piece.length(), b.piece.length());
    if la > RATIO * lb || lb > RATIO * la || a.piece.group() != b.piece.group() {
        return false;
    }
    let (end, start) = (a.piece.jet(la), b.piece.jet(0.0));
    let group = a.piece.group();
    turning(group, &end, &start) < ANGLE
        && (distance(&end.d1, &start.d1) < 1e-9 || reach(group, &end, &start, tolerance) > la.max(lb))
}

/// Curvature in the middle of `b`: the mean of how the path turns at its two ends.
fn middle_bend(a: &Piece, b: &Piece, c: &Piece) -> [f64; AXES] {
    let (ta, tb, tc) = (a.jet(0.0).d1, b.jet(0.0).d1, c.jet(0.0).d1);
    let (first, second) = ((a.length() + b.length()) / 2.0, (b.length() + c.length()) / 2.0);
    let mut bend: [f64; AXES] = core::array::from_fn(|i| 0.5 * ((tb[i] - ta[i]) / first + (tc[i] - tb[i]) / second));
    let along: f64 = b
        .group()
        .pick(&bend)
        .iter()
        .zip(b.group().pick(&tb))
        .map(|(x, t)| x * t)
        .sum();
    for (bend, t) in bend.iter_mut().zip(tb) {
        *bend -= along * t;
    }
    bend
}
