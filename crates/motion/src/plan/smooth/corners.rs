//! Corners of the programmed path.
//!
//! In:  moves, with the room for corners at their ends.
//! Out: stretches: what is left of the moves and the blends between them; halts where the machine must come to rest.

use super::overlap::{Overlap, Pace, Vertex};
use super::round::{Rounded, fast_ratios, overlap, round_as, slow_ratios, turning};
use super::{Leg, Passed, Seam, Stretch};
use crate::path::{Group, Piece};
use crate::plan::limits::{Bounds, PathLimits};
use crate::plan::profile::{reachable, time_lost};
use crate::plan::program::{Corner, Move};
use crate::plan::travel::inside;
use crate::plan::{PlannerKind, Settings};

/// Part of the tolerance that a rounded corner uses; the rest is for what set-points cut off between them. Less where it would
/// leave the travel.
const TOLERANCE_PARTS: [f64; 4] = [0.95, 0.5, 0.25, 0.1];

/// A corner that turns less is flat, radians.
pub(super) const FLAT: f64 = 0.2;

/// Part of the room for a corner that it may use.
const ROOM: f64 = 0.97;

/// Rounds corners, with one move of delay.
#[derive(Debug, Default)]
pub(super) struct Corners {
    last: Option<Last>,
}

/// The last move.
#[derive(Debug)]
struct Last {
    leg: Leg,
    /// What the corner before it has taken of it.
    from: f64,
    /// Known where the corner before it needed it.
    pace: Option<Pace>,
}

impl Corners {
    pub(super) fn push(&mut self, next: Leg, settings: &Settings, out: &mut Vec<Passed>) {
        let mut next = Last {
            leg: next,
            from: 0.0,
            pace: None,
        };
        if let Some(last) = self.last.take() {
            meet(&last, &mut next, settings, out);
        }
        self.last = Some(next);
    }

    /// Nothing follows: the last move ends where it is programmed to end.
    pub(super) fn flush(&mut self, out: &mut Vec<Passed>) {
        if let Some(last) = self.last.take() {
            last.let_go(0.0, out);
        }
    }
}

/// Lets `last` go, and the corner behind it.
fn meet(last: &Last, next: &mut Last, settings: &Settings, out: &mut Vec<Passed>) {
    let (a, b) = (&last.leg.part, &next.leg.part);
    let tolerance = match a.corner {
        Corner::Round(tolerance) if joinable(a, b, settings) => match settings.rapid_tolerance_mm {
            Some(of_rapid) if a.rapid && b.rapid => of_rapid,
            Some(_) | None => tolerance,
        },
        Corner::Exact if joinable(a, b, settings) && a.rapid == b.rapid => {
            last.let_go(0.0, out);
            return;
        }
        Corner::Exact | Corner::Stop | Corner::Round(_) => {
            last.let_go(0.0, out);
            out.push(Passed::Stop);
            return;
        }
    };
    let Some((corner, bounds)) = rounded(last, next, tolerance, settings) else {
        last.let_go(0.0, out);
        return;
    };
    last.let_go(corner.before, out);
    next.from = corner.after;
    let (a, b) = (&last.leg.part, &next.leg.part);
    let seam = a.rapid != b.rapid;
    let stretch = |piece, part: &Move| {
        let mut stretch = stretch_of(piece, part);
        stretch.bounds = bounds.map(Box::new);
        (stretch.feed, stretch.seam) = (a.feed.min(b.feed), seam);
        stretch
    };
    // The move changes in the middle of a corner, if there is one.
    let rounded = match corner.second {
        Some(second) => Some([corner.blend, second]),
        None if seam => halves(&corner.blend),
        None => None,
    };
    let Some([first, second]) = rounded else {
        out.push(Passed::Stretch(stretch(corner.blend, b)));
        return;
    };
    let rounded = [stretch(first, a), stretch(second, b)];
    let length = a.piece.length();
    let taken = [
        a.piece.cut(length - corner.before, length),
        b.piece.cut(0.0, corner.after),
    ];
    match taken {
        [Some(before), Some(after)] if seam => out.push(Passed::Seam(Seam {
            rounded,
            exact: [stretch_of(before, a), stretch_of(after, b)],
        })),
        _ => out.extend(rounded.map(Passed::Stretch)),
    }
}

fn halves(blend: &Piece) -> Option<[Piece; 2]> {
    let [middle, end] = [0.5, 1.0].map(|part| part * blend.length());
    Some([blend.cut(0.0, middle)?, blend.cut(middle, end)?])
}

/// Whether speed may be carried from one move into the other. The classic planner, whose plan overrides do not change, comes to
/// rest between a rapid move and one at feed, so that the machine can wait there. Both do where the spindle begins or ceases to lead the
/// feed: a share of the speed that holds for one of the moves alone may change at rest only.
fn joinable(a: &Move, b: &Move, settings: &Settings) -> bool {
    let paced_alike = a.rapid == b.rapid || settings.planner_kind == PlannerKind::Optimal;
    let paced_alike = paced_alike && a.is_led() == b.is_led();
    paced_alike && a.piece.group() == b.piece.group()
}

/// A piece of a move.
fn stretch_of(piece: Piece, part: &Move) -> Box<Stretch> {
    Box::new(Stretch {
        piece,
        bounds: None,
        feed: part.feed,
        line: part.line,
        rapid: part.rapid,
        seam: false,
        enables: part.enables,
        auxiliary: part.auxiliary,
        modes: part.modes,
    })
}

/// The corner between two moves, if it is worth rounding, and the bounds of the blend if they were needed for that.
fn rounded(last: &Last, next: &mut Last, tolerance: f64, settings: &Settings) -> Option<(Rounded, Option<Bounds>)> {
    let (a, b) = (&last.leg.part, &next.leg.part);
    if a.piece.group() == Group::Rotary {
        return None;
    }
    // Two corners that share a leg must not leave a sliver of it, on which knots would be next to each other.
    let room = [(a.piece.length() - last.from).min(last.leg.room[1]), next.leg.room[0]].map(|room| ROOM * room);
    let (end, start) = (a.piece.jet(a.piece.length()), b.piece.jet(0.0));
    let turning = turning(a.piece.group(), &end, &start);
    let ratios = fast_ratios(turning);
    // So flat, a stop is never better.
    if turning < FLAT {
        return quintic(ratios, a, b, room, tolerance, settings).map(|corner| (corner, None));
    }
    let legs = [
        last.pace.unwrap_or_else(|| pace(&last.leg, settings)),
        *next.pace.insert(pace(&next.leg, settings)),
    ];
    if settings.planner_kind == PlannerKind::Classic {
        let corner = quintic(ratios, a, b, room, tolerance, settings)?;
        let bounds = Bounds::new(&corner.blend);
        let blend = bounds.limits(a.feed.min(b.feed), settings);
        let paces = [(legs[0], corner.before), (legs[1], corner.after)];
        return worth_it(corner.blend.length(), &blend, &paces).then_some((corner, Some(bounds)));
    }
    let vertex = Vertex {
        directions: [&end.d1, &start.d1],
        turning,
        feed: a.feed.min(b.feed),
        legs,
    };
    fastest(a, b, &vertex, room, tolerance, settings).map(|corner| (corner, None))
}

/// The corner as one quintic that stays inside the travel.
fn quintic(
    ratios: (f64, f64),
    a: &Move,
    b: &Move,
    room: [f64; 2],
    tolerance: f64,
    settings: &Settings,
) -> Option<Rounded> {
    TOLERANCE_PARTS.into_iter().find_map(|part| {
        round_as(ratios, &a.piece, room[0], &b.piece, room[1], part * tolerance)
            .filter(|corner| is_inside(corner, a, settings))
    })
}

fn is_inside(corner: &Rounded, a: &Move, settings: &Settings) -> bool {
    let mut pieces = [Some(corner.blend), corner.second].into_iter().flatten();
    pieces.all(|piece| inside(&piece.in_frame(*a.piece.frame()), settings))
}

/// The corner that takes the least time, unless a stop takes less: passed fast, or slowly in one of several shapes.
fn fastest(
    a: &Move,
    b: &Move,
    vertex: &Vertex<'_>,
    room: [f64; 2],
    tolerance: f64,
    settings: &Settings,
) -> Option<Rounded> {
    let stop: f64 = vertex
        .legs
        .iter()
        .map(|leg| time_lost(leg.speed, 0.0, &leg.limits))
        .sum();
    let [from, to] = vertex.directions;
    let most = room[0].min(room[1]);
    let ratios = [fast_ratios(vertex.turning), slow_ratios(vertex.turning)];
    let quintics = ratios.map(|ratios| (Overlap::quintic(ratios), Some(ratios)));
    let swings = Overlap::swings(vertex.turning).map(|shape| (shape, None));
    let mut candidates: Vec<_> = quintics
        .into_iter()
        .chain(swings)
        .map(|(shape, ratios)| {
            let size = (TOLERANCE_PARTS[0] * tolerance / shape.off(from, to)).min(most);
            (shape.time_lost(size, vertex, settings), size, shape, ratios)
        })
        .filter(|(time_s, ..)| *time_s < stop)
        .collect();
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    candidates
        .into_iter()
        .find_map(|(_, size, shape, ratios)| match ratios {
            Some(ratios) => quintic(ratios, a, b, room, tolerance, settings),
            None => overlap(&shape, &a.piece, &b.piece, size, TOLERANCE_PARTS[0] * tolerance)
                .filter(|corner| is_inside(corner, a, settings)),
        })
}

impl Last {
    /// Lets go what the corners have left of a move.
    fn let_go(&self, taken: f64, out: &mut Vec<Passed>) {
        let part = &self.leg.part;
        if let Some(piece) = part.piece.cut(self.from, part.piece.length() - taken) {
            out.push(Passed::Stretch(stretch_of(piece, part)));
        }
    }
}

/// How fast a leg can be run: in its middle, coming from rest.
fn pace(leg: &Leg, settings: &Settings) -> Pace {
    let limits = Bounds::new(&leg.part.piece).limits(leg.part.feed, settings);
    let speed = reachable(0.0, limits.v, leg.whole / 2.0, &limits);
    Pace { limits, speed }
}

/// Whether running through a blend takes less time than a stop at the corner. Where the tolerance is small against what
/// the jerk allows, it may not; and a stop keeps to the path. Both legs come with what the blend takes of them.
fn worth_it(length: f64, blend: &PathLimits, legs: &[(Pace, f64); 2]) -> bool {
    let (mut stopping, mut rounding) = (0.0, length / blend.v);
    for (Pace { limits, speed }, used) in legs {
        stopping += time_lost(*speed, 0.0, limits);
        rounding += time_lost(*speed, blend.v.min(*speed), limits) - used / speed;
    }
    rounding < stopping
}
