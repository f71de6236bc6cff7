//! The move of the tool's centre whose end is not known before the next move is.
//!
//! In:  the curve of the centre beside a programmed move, and where the centre gets on it.
//! Out: whether it can leave it at a given point, and how many turns it has made by then.

use std::f64::consts::TAU;

use motion::canon::Call;

use super::geometry::{Curve, Point, dot, length, sub, sweep, wrapped};
use super::join::SMOOTH_RAD;

/// Rounding that a length may be off, mm.
const ROUNDING_MM: f64 = 1e-6;

/// What four decimals do not show, mm.
const SEEN_MM: f64 = 5e-5;

/// Part of a curve of the tool's centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub(super) curve: Curve,
    /// Where the centre gets on the curve.
    pub(super) start: Point,
    /// Where it leaves it if nothing cuts it short: beside the end of the programmed move.
    pub(super) end: Point,
    /// Of a circle, what lies between `start` and `end`, rad. Negative where `start` is past `end`.
    sweep: f64,
    start_kind: Start,
}

/// How the centre got on its curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Start {
    /// From afar: the entry move, which can be cut at any length.
    Entry,
    /// Beside the start of the programmed move.
    Beside,
    /// At the crossing with the curve before, behind an inner corner.
    Cut,
    /// Where the curve before left it, at a corner too flat to matter. If it is past the end of this one by no more than
    /// `slack_mm`, the tool goes back a little; that is how finely divided contours are.
    Flat { slack_mm: f64 },
}

impl Held {
    /// Along a line.
    pub(super) fn line(curve: Curve, start: Point, start_kind: Start, end: Point) -> Held {
        Held {
            curve,
            start,
            end,
            sweep: 0.0,
            start_kind,
        }
    }

    /// Along a circle. `begin` is the point on it beside the start of the programmed move, which turns by `turns` from there.
    /// The centre gets on the circle at `start`: close to `begin` or, where it was cut, anywhere behind it.
    pub(super) fn arc(curve: Curve, begin: Point, start: Point, start_kind: Start, end: Point, turns: i32) -> Held {
        let Curve::Circle { centre, radius, turn } = curve else {
            return Held::line(curve, start, start_kind, end);
        };
        let full_turns = f64::from(turns.unsigned_abs().saturating_sub(1)) * TAU;
        let past_begin = sweep(centre, turn, begin, start);
        // A cut lies behind the begin; otherwise the start may lie on either side of it.
        let past_begin = if start_kind == Start::Cut {
            behind(past_begin)
        } else {
            wrapped(past_begin)
        };
        Held {
            curve,
            start,
            end,
            sweep: whole_turn(sweep(centre, turn, begin, end), radius) + full_turns - past_begin,
            start_kind,
        }
    }

    pub(super) fn is_entry(&self) -> bool {
        self.start_kind == Start::Entry
    }

    /// What there is of the curve up to `leave`, a point on it before `end`: rad on a circle, mm on a line.
    fn travel(&self, leave: Point) -> f64 {
        match self.curve {
            Curve::Line { tangent, .. } => dot(sub(leave, self.start), tangent),
            Curve::Circle { centre, turn, .. } => self.sweep - behind(sweep(centre, turn, leave, self.end)),
        }
    }

    /// By how much the curve is too short to be left at `leave`, mm; `None` if it can be left there.
    pub(super) fn lacks_mm(&self, leave: Point, lenient: bool) -> Option<f64> {
        let travel_mm = match self.curve {
            Curve::Line { .. } => self.travel(leave),
            Curve::Circle { radius, .. } => self.travel(leave) * radius,
        };
        let allowed_mm = match (self.curve, self.start_kind) {
            // An arc could not be reversed; it would become almost a full turn.
            (Curve::Line { .. }, Start::Entry) => return None,
            (_, Start::Flat { slack_mm }) if lenient => slack_mm,
            (_, Start::Entry | Start::Beside | Start::Cut | Start::Flat { .. }) => 0.0,
        };
        (travel_mm < -(ROUNDING_MM + allowed_mm)).then_some(-travel_mm)
    }

    /// Where to leave a circle at about `leave` so that it is read as it is meant.
    ///
    /// A full circle whose start is not exactly its end, because the corner before it was flat but not quite, would shrink
    /// to the small angle between them. If this is less than can be seen, the circle ends where it began.
    pub(super) fn settled(&self, leave: Point) -> Point {
        match self.curve {
            Curve::Circle { radius, .. }
                if self.travel(leave) * radius > SEEN_MM && length(sub(leave, self.start)) < SEEN_MM =>
            {
                self.start
            }
            Curve::Circle { .. } | Curve::Line { .. } => leave,
        }
    }

    /// Makes a call that goes along the curve fit the part of it up to `leave`: the turns of an arc.
    pub(super) fn shape(&self, call: &mut Call, leave: Point) {
        let (Curve::Circle { centre, radius, turn }, Call::ArcFeed { to, turns, .. }) = (self.curve, &mut *call) else {
            return;
        };
        let travel = self.travel(leave);
        if travel * radius < ROUNDING_MM {
            // Nothing is left of the arc; as an arc without length it would be read as a full turn.
            *call = Call::StraightFeed { to: *to };
            return;
        }
        // An event tells only end points and turns. Who reads it sees the angle between them and adds full turns.
        let seen = whole_turn(sweep(centre, turn, self.start, leave), length(sub(self.start, centre)));
        let full_turns = ((travel - seen) / TAU).round().clamp(0.0, f64::from(i32::MAX - 1));
        *turns = (turn * (full_turns + 1.0)) as i32;
    }
}

/// An angle from a point to one that lies behind it on the circle, except for rounding: where the two paths of a corner
/// almost touch, their crossing may come to lie a little before. No cut takes all but so little of a turn.
fn behind(angle: f64) -> f64 {
    if TAU - angle < SMOOTH_RAD { angle - TAU } else { angle }
}

/// An angle of nothing between the ends of an arc is a full turn, even if rounding put them a little apart.
fn whole_turn(angle: f64, radius: f64) -> f64 {
    if angle * radius < 1e-9 || (TAU - angle) * radius < 1e-9 {
        TAU
    } else {
        angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::canon::{Plane, Position};

    fn at(angle: f64) -> Point {
        [2.0 * libm::cos(angle), 2.0 * libm::sin(angle)]
    }

    /// An arc about zero from -0.5 to 0.5 rad, and full turns, of which corners leave the part between two angles.
    fn part(turns: i32, from: f64, to: f64) -> (Option<f64>, Call) {
        let curve = Curve::Circle {
            centre: [0.0; 2],
            radius: 2.0,
            turn: 1.0,
        };
        let held = Held::arc(curve, at(-0.5), at(from), Start::Cut, at(0.5), turns);
        let mut call = Call::ArcFeed {
            to: Position::ZERO,
            plane: Plane::Xy,
            centre_mm: [0.0; 2],
            turns,
        };
        held.shape(&mut call, at(to));
        (held.lacks_mm(at(to), false), call)
    }

    #[test]
    fn corners_may_take_all_of_an_arc_and_no_more() {
        let arc = |call| match call {
            Call::ArcFeed { turns, .. } => turns,
            _ => 0,
        };
        let left_of = |turns, from, to| {
            let (lacks, call) = part(turns, from, to);
            (lacks, arc(call))
        };
        assert_eq!(left_of(1, -0.5, 0.5), (None, 1));
        assert_eq!(left_of(1, -0.1, 0.1), (None, 1));
        // As an arc this would be read as a full turn.
        assert_eq!(left_of(1, 0.1, 0.1), (None, 0));
        let lacks = part(1, 0.1, -0.1).0.expect("too short");
        assert!((lacks - 2.0 * 0.2).abs() < 1e-9, "{lacks}");
        // Of a turn and a bit the corners take more than the bit.
        assert_eq!(left_of(2, -0.1, 0.1), (None, 2));
        assert_eq!(left_of(2, 0.1, -0.1), (None, 1));
    }
}
