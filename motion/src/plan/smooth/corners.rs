//! Corners of the programmed path.
//!
//! In:  moves, with the room for corners at their ends.
//! Out: stretches: what is left of the moves and the blends between them; halts where the machine must come to rest.

use super::round::{Rounded, round, turning};
use super::{Leg, Passed, Stretch};
use crate::path::Group;
use crate::plan::Settings;
use crate::plan::limits::Bounds;
use crate::plan::profile::{reachable, time_lost};
use crate::plan::program::{Corner, Move};

/// Part of the tolerance that a rounded corner uses; the rest is for what set-points cut off between them.
const USE: f64 = 0.95;

/// Part of the room for a corner that it may use.
const ROOM: f64 = 0.97;

/// Rounds corners, with one move of delay.
#[derive(Debug, Default)]
pub(super) struct Corners {
    /// The last move, and what the corner before it has taken of it.
    last: Option<(Leg, f64)>,
}

impl Corners {
    pub(super) fn push(&mut self, next: Leg, settings: &Settings, out: &mut Vec<Passed>) {
        let taken = match &self.last {
            None => 0.0,
            Some((leg, from)) => meet(leg, *from, &next, settings, out),
        };
        self.last = Some((next, taken));
    }

    /// Nothing follows: the last move ends where it is programmed to end.
    pub(super) fn flush(&mut self, out: &mut Vec<Passed>) {
        if let Some((leg, from)) = self.last.take() {
            rest_of(&leg.part, from, 0.0, out);
        }
    }
}

/// Lets `leg` go, from `from` on, and the corner behind it; what that takes of `next`.
fn meet(leg: &Leg, from: f64, next: &Leg, settings: &Settings, out: &mut Vec<Passed>) -> f64 {
    let (a, b) = (&leg.part, &next.part);
    let tolerance = match a.corner {
        Corner::Round(tolerance) if joinable(a, b) => tolerance,
        Corner::Exact if joinable(a, b) => {
            rest_of(a, from, 0.0, out);
            return 0.0;
        }
        Corner::Exact | Corner::Stop | Corner::Round(_) => {
            rest_of(a, from, 0.0, out);
            out.push(Passed::Stop);
            return 0.0;
        }
    };
    let corner = if a.piece.group() == Group::Rotary {
        None
    } else {
        // Two corners that share a leg must not leave a sliver of it, on which knots would be next to each other.
        let room = [(a.piece.length() - from).min(leg.room[1]), next.room[0]].map(|room| ROOM * room);
        round(&a.piece, room[0], &b.piece, room[1], USE * tolerance)
            .filter(|corner| flat(a, b) || worth_it(corner, leg, next, settings))
    };
    let Some(corner) = corner else {
        rest_of(a, from, 0.0, out);
        return 0.0;
    };
    rest_of(a, from, corner.before, out);
    out.push(Passed::Stretch(Stretch {
        piece: corner.blend,
        feed: a.feed.min(b.feed),
        line: b.line,
        rapid: b.rapid,
        enables: b.enables,
    }));
    corner.after
}

/// Whether speed may be carried from one move into the other.
fn joinable(a: &Move, b: &Move) -> bool {
    a.rapid == b.rapid && a.piece.group() == b.piece.group()
}

/// Lets go what the corners have left of a move.
fn rest_of(part: &Move, from: f64, taken: f64, out: &mut Vec<Passed>) {
    if let Some(piece) = part.piece.cut(from, part.piece.length() - taken) {
        out.push(Passed::Stretch(Stretch {
            piece,
            feed: part.feed,
            line: part.line,
            rapid: part.rapid,
            enables: part.enables,
        }));
    }
}

/// Whether a corner turns so little that a stop is never better.
fn flat(a: &Move, b: &Move) -> bool {
    const ANGLE: f64 = 0.2;
    turning(a.piece.group(), &a.piece.jet(a.piece.length()), &b.piece.jet(0.0)) < ANGLE
}

/// Whether running through a blend takes less time than a stop at the corner. Where the tolerance is small against what
/// the jerk allows, it may not; and a stop keeps to the path.
fn worth_it(corner: &Rounded, a: &Leg, b: &Leg, settings: &Settings) -> bool {
    let blend = Bounds::of(&corner.blend).limits(a.part.feed.min(b.part.feed), settings);
    let (mut stopping, mut rounding) = (0.0, corner.blend.length() / blend.v);
    for (leg, used) in [(a, corner.before), (b, corner.after)] {
        let limits = Bounds::of(&leg.part.piece).limits(leg.part.feed, settings);
        // What the leg allows in its middle, coming from rest.
        let speed = reachable(0.0, limits.v, leg.whole / 2.0, &limits);
        stopping += time_lost(speed, 0.0, &limits);
        rounding += time_lost(speed, blend.v.min(speed), &limits) - used / speed;
    }
    rounding < stopping
}
