//! Lines and arcs that meet at small angles: the path sways within the tolerance, over most of the length of the moves.
//!
//! In:  moves, with the room for corners at their ends.
//! Out: the same; where lines and arcs in one plane met tangentially or nearly so there are short curves instead, joined with
//! continuous position, direction and curvature, from a place on the first such move to one on the last.
//!
//! Curvature jumps where a line meets an arc. A blend of that joint alone uses the tolerance on a short length only, and jerk
//! bounds the speed there. Here, the whole run becomes one spline in time: about how fast each place will be passed is
//! estimated ([`pace`]), and of all curves within the tolerance that with the least jerk at this pace is taken
//! ([`least_jerk`]). So the path turns on long lengths where it is fast and on short ones where it is slow, uses both sides
//! of the tolerance, and keeps some jerk for changes of speed.

mod curve;
mod least_jerk;
mod pace;
mod track;

use curve::{Curve, value, weights};
use least_jerk::{Gate, LeastJerk, Plane};
use pace::{Moment, Pace};
use track::{Track, flat, normal};

use super::Leg;
use super::round::{distance, turning};
use crate::path::{BlendEnd, Group, Piece, Shape};
use crate::plan::program::{Corner, Move};
use crate::plan::travel::{Walls, inside};
use crate::plan::{AxisLimits, Settings};

/// Angle up to which two moves belong to one run, radians.
const GENTLE: f64 = 1.0;
/// Moves in a run at most.
const RUN_MOVES_MAX: usize = 16;
/// Time between knots over that in which acceleration builds up, and its bounds in s.
const KNOTS: f64 = 0.16;
const KNOTS_S: [f64; 2] = [0.003, 0.010];
/// Time before the first joint and behind the last beyond which moves stay as they are, over that in which acceleration builds
/// up; and at the least, s: the tolerance takes its time, too.
const REACH: f64 = 3.0;
const REACH_S: f64 = 0.03;
/// Part of a move at the end of a run that stays as it is.
const UNCHANGED_PART: f64 = 0.2;
/// Part of the tolerance that is used; the rest is for what lies between the places that are looked at, and for what
/// set-points cut off.
const TOLERANCE_PART: f64 = 0.95;
/// Part of the acceleration limit with which the pace is estimated.
const ACCELERATION_PART: f64 = 0.7;
/// Times that the places on the path are computed again.
const PASSES: u32 = 2;
/// Price of being off along the path by the way of one span.
const ALONG_WEIGHT: f64 = 0.03;
/// What is kept of that in the first try with so long between knots or more, and in proportion to the third power of shorter times:
/// curves go beyond it between the places that are looked at, as jerk takes them there. Mostly enough, so that it is the only
/// try.
const BETWEEN: f64 = 0.082;
const BETWEEN_S: f64 = 0.008;
/// Tries, with less of the tolerance where a curve goes beyond it or leaves the travel.
const TRIES: u32 = 3;

/// Speed on an arc over that at which it takes all of the jerk.
const ARC: f64 = 1.1;
/// Speed through a corner of 1 rad over the cube root of tolerance squared times jerk.
const CORNER: f64 = 3.5;
/// Speed through a jump of curvature over that through a quintic blend of it.
const BENT: f64 = 1.6;

/// The run that waits.
#[derive(Debug, Default)]
pub(super) struct MinJerkBlend {
    run: Vec<Leg>,
    entry: Entry,
    pace: Pace,
    solver: LeastJerk,
}

/// How a run begins.
#[derive(Debug, Default)]
enum Entry {
    #[default]
    Rest,
    /// Behind this move.
    Behind(Box<Move>),
    /// In the middle of a move, with this speed.
    Within(f64),
}

impl MinJerkBlend {
    pub(super) fn push(&mut self, leg: Leg, settings: &Settings, out: &mut Vec<Leg>) {
        if let Some(last) = self.run.last().map(|leg| &leg.part) {
            if !self.joins(&leg.part) {
                let last = last.clone();
                self.close(Some(&leg.part), settings, out);
                self.entry = Entry::Behind(last);
            } else if self.run.len() == RUN_MOVES_MAX || self.is_long(settings) {
                let exit = crossing(last, &leg.part, settings);
                self.close_within(exit, settings, out);
            }
        }
        self.run.push(leg);
    }

    /// Nothing follows.
    pub(super) fn flush(&mut self, settings: &Settings, out: &mut Vec<Leg>) {
        self.close(None, settings, out);
        self.entry = Entry::Rest;
    }

    /// Whether a move goes on with the run.
    fn joins(&self, next: &Move) -> bool {
        let Some(last) = self.run.last().map(|leg| &leg.part) else {
            return false;
        };
        let arc = |part: &Move| matches!(part.piece.shape(), Shape::Arc(_));
        let Some(normal) = (arc(last) || arc(next))
            .then(|| self.normal().or_else(|| normal(&next.piece)))
            .flatten()
        else {
            return false;
        };
        matches!(last.corner, Corner::Round(tolerance) if tolerance > 0.0)
            && last.rapid == next.rapid
            && last.enables == next.enables
            && flat(&last.piece, &normal)
            && flat(&next.piece, &normal)
            && turned(last, next) < GENTLE
    }

    /// Of the plane of the run.
    fn normal(&self) -> Option<[f64; 3]> {
        self.run.iter().take(2).find_map(|leg| normal(&leg.part.piece))
    }

    /// The run ends with its last move; `next` follows.
    fn close(&mut self, next: Option<&Move>, settings: &Settings, out: &mut Vec<Leg>) {
        if let [.., last] = &self.run[..]
            && self.run.len() > 1
            && let exit = next.map_or(0.0, |next| crossing(&last.part, next, settings))
            && let Some(blended) = self.blend(Exit::Speed(exit), settings)
        {
            self.let_go(blended, out);
        }
        out.append(&mut self.run);
    }

    /// Whether the last move of several is so long that what happens at its ends has nothing to do with each other.
    fn is_long(&self, settings: &Settings) -> bool {
        let [_, .., last] = &self.run[..] else { return false };
        limits([&last.part.piece].into_iter(), settings)
            .is_some_and(|limits| last.part.piece.length() > 2.0 * reach_s(&limits) * cap(&last.part, &limits))
    }

    /// The run ends in the middle of its last move, the rest of which begins the next one; `exit`: the speed at its end.
    fn close_within(&mut self, exit: f64, settings: &Settings, out: &mut Vec<Leg>) {
        if let Some(blended) = self.blend(Exit::Within(exit), settings) {
            self.entry = Entry::Within(blended.speed);
            self.let_go(blended, out);
        } else if let [.., before, _] = &self.run[..] {
            self.entry = Entry::Behind(before.part.clone());
            out.extend(self.run.drain(..self.run.len() - 1));
        }
    }

    /// Lets go all of a run but what is left of its last move.
    fn let_go(&mut self, blended: Blended, out: &mut Vec<Leg>) {
        if let ([first, .., last], Blended { from, to, legs, .. }) = (&self.run[..], blended) {
            out.extend(part_of(first, 0.0, from).map(|mut leg| {
                leg.part.corner = Corner::Exact;
                leg.room[1] = 0.0;
                leg
            }));
            out.extend(legs);
            let rest = part_of(last, to, last.part.piece.length());
            let rest = rest.map(|leg| Leg {
                room: [0.0, leg.room[1]],
                ..leg
            });
            self.run.clear();
            self.run.extend(rest);
        }
    }

    /// What the run becomes; `None`: it stays as it is.
    fn blend(&mut self, exit: Exit, settings: &Settings) -> Option<Blended> {
        let normal = self.normal()?;
        let run = &self.run;
        let last = run.len() - 1;
        let [first_length, last_length] = [run[0].part.piece.length(), run[last].part.piece.length()];
        let (from, enters) = match &self.entry {
            Entry::Rest => (UNCHANGED_PART * first_length, 0.0),
            Entry::Behind(before) => (UNCHANGED_PART * first_length, crossing(before, &run[0].part, settings)),
            Entry::Within(speed) => (0.0, *speed),
        };
        let (to, exits) = match exit {
            Exit::Speed(speed) => ((1.0 - UNCHANGED_PART) * last_length, speed),
            Exit::Within(speed) => (0.5 * last_length, speed),
        };
        let limits = limits(run.iter().map(|leg| &leg.part.piece), settings)?;
        let mut tolerance = f64::INFINITY;
        let mut angle = 0.0f64;
        self.pace.begin(enters);
        for (k, leg) in run.iter().enumerate() {
            let part = &leg.part;
            let end = if k < last {
                let next = &run[k + 1].part;
                if let Corner::Round(most) = part.corner {
                    tolerance = tolerance.min(most);
                }
                angle = angle.max(turned(part, next));
                crossing(part, next, settings)
            } else {
                exits
            };
            self.pace.push(part.piece.length(), cap(part, &limits), end);
        }
        self.pace.finish(ACCELERATION_PART * limits.acceleration);
        let track = Track::new(run, normal);
        // What is farther from the joints stays as it is.
        let reach_s = reach_s(&limits);
        let [first_s, last_s] = [first_length, track.start(last)].map(|joint| self.pace.time_at(joint));
        let whole = [from, to];
        let mut ends = [
            from.max(self.pace.at(first_s - reach_s).s),
            to.min(self.pace.at(last_s + reach_s).s - track.start(last)),
        ];
        // Inside a bend, the borders of the tolerance of both moves meet further from its vertex.
        let tolerance = TOLERANCE_PART * tolerance * libm::cos(0.5 * angle);
        let mut tube = tolerance * (1.0 - BETWEEN * (knot_s(&limits) / BETWEEN_S).min(1.0).powi(3));
        let mut walls = None;
        for _ in 0..TRIES {
            let curve = self.curve(&track, ends, &limits, tube, walls.as_ref())?;
            let walk = curve.walk(&track, ends[0]);
            let end = track.start(last) + ends[1];
            if walk.off <= tolerance && walk.places.last().is_some_and(|s| (s - end).abs() < 1e-6) {
                let blended = curve.into_legs(&self.run, ends, &track, &walk, &self.pace)?;
                if blended.legs.iter().all(|leg| inside(&leg.part.piece, settings)) {
                    return Some(blended);
                }
                // Half the tolerance on both sides of what is as far as that from the limits of the travel: to get there takes
                // its way.
                ends = whole;
                tube = 0.5 * tolerance;
                walls = Some(Walls::new(settings).drawn_in(tube));
            } else {
                tube *= 0.98 * (tolerance / walk.off).min(1.0);
            }
        }
        None
    }

    /// The curve of least jerk between two places of the run.
    fn curve(
        &mut self,
        track: &Track,
        [from, to]: [f64; 2],
        limits: &AxisLimits,
        tube: f64,
        walls: Option<&Walls>,
    ) -> Option<Curve> {
        let begin = self.pace.time_at(from);
        let duration = self.pace.time_at(track.start(track.legs.len() - 1) + to) - begin;
        let spans = (duration / knot_s(limits)).ceil();
        if !spans.is_finite() || spans > 10_000.0 {
            return None;
        }
        let spans = (spans as usize).max(8);
        let h = duration / spans as f64;
        let mut spline: Vec<Plane> = (0..spans + 3)
            .map(|k| track.place(self.pace.at(begin + (k as f64 - 1.0) * h).s).0)
            .collect();
        let ends = [begin, begin + duration].map(|t| {
            let moment = self.pace.at(t);
            let leg = if t == begin { 0 } else { track.legs.len() - 1 };
            let jet = track.legs[leg].1.jet(if t == begin { from } else { to });
            BlendEnd {
                leg: jet,
                pace: moment.v * h,
                pace_change: moment.a * h * h,
            }
        });
        for (end, at) in ends.iter().zip([0, spans]) {
            let q = track.flat(&end.leg.q);
            let (d1, d2) = (track.direction(&end.leg.d1), track.direction(&end.leg.d2));
            let first = d1.map(|x| x * end.pace);
            let second = [0, 1].map(|i| d2[i] * end.pace * end.pace + d1[i] * end.pace_change);
            for i in 0..2 {
                let middle = q[i] - second[i] / 6.0;
                spline[at][i] = middle - first[i] + 0.5 * second[i];
                spline[at + 1][i] = middle;
                spline[at + 2][i] = middle + first[i] + 0.5 * second[i];
            }
        }
        // Parameter and place of what the curve has to keep to: evenly, and both directions at every vertex.
        let even: Vec<f64> = (2..2 * spans - 1).map(|k| 0.5 * k as f64).collect();
        let moments: Vec<Moment> = even.iter().map(|x| self.pace.at(begin + h * x)).collect();
        let mut places: Vec<f64> = moments.iter().map(|moment| moment.s).collect();
        let scale = 1.0 / (limits.jerk * h * h * h);
        let mut gates = Vec::with_capacity(even.len() + 2 * track.legs.len());
        for pass in 0..PASSES {
            if pass > 0 {
                let mut last = 0.0f64;
                for ((x, place), moment) in even.iter().zip(&mut places).zip(&moments) {
                    let around = moment.v * h;
                    let window = [(*place - around).max(last), (*place + around).max(last)];
                    last = track.nearest(&value(&spline, *x), window).0;
                    *place = last;
                }
            }
            gates.clear();
            let mut gate = |x: f64, v: f64, (place, along): (Plane, Plane)| {
                let (span, weights) = weights(x, spans);
                let place = walls.map_or(place, |walls| track.flat(&walls.between(&track.position(&place))));
                gates.push(Gate {
                    span,
                    weights,
                    place,
                    along,
                    stiffness: ALONG_WEIGHT.sqrt() / (v * h),
                });
            };
            for ((x, s), moment) in even.iter().zip(&places).zip(&moments) {
                gate(*x, moment.v, track.place(*s));
            }
            for pair in track.legs.windows(2) {
                let vertex = pair[1].0;
                let k = places.partition_point(|s| *s <= vertex);
                if k == 0 || k == places.len() {
                    continue;
                }
                let part = (vertex - places[k - 1]) / (places[k] - places[k - 1]);
                let x = even[k - 1] + 0.5 * part;
                let v = self.pace.at(begin + h * x).v;
                for jet in [pair[0].1.jet(f64::INFINITY), pair[1].1.jet(0.0)] {
                    gate(x, v, (track.flat(&jet.q), track.direction(&jet.d1)));
                }
            }
            self.solver.solve(&mut spline, &gates, tube, scale);
        }
        spline
            .iter()
            .flatten()
            .all(|x| x.is_finite())
            .then_some(Curve { spline, ends })
    }
}

/// Time between knots, s.
fn knot_s(limits: &AxisLimits) -> f64 {
    (KNOTS * limits.acceleration / limits.jerk).clamp(KNOTS_S[0], KNOTS_S[1])
}

/// How far a joint reaches, s.
fn reach_s(limits: &AxisLimits) -> f64 {
    (REACH * limits.acceleration / limits.jerk).max(REACH_S)
}

/// How a run ends.
#[derive(Clone, Copy, Debug)]
enum Exit {
    /// With its last move, and with this speed.
    Speed(f64),
    /// In the middle of its last move, at the end of which the speed is this.
    Within(f64),
}

/// What became of a run.
struct Blended {
    legs: Vec<Leg>,
    /// Where on the first and on the last move.
    from: f64,
    to: f64,
    /// Speed at the end.
    speed: f64,
}

/// Part of a leg.
fn part_of(leg: &Leg, from: f64, to: f64) -> Option<Leg> {
    let piece = leg.part.piece.cut(from, to)?;
    Some(Leg {
        part: Box::new(Move { piece, ..*leg.part }),
        room: leg.room,
        whole: leg.whole,
    })
}

/// Angle between two moves, radians.
fn turned(a: &Move, b: &Move) -> f64 {
    turning(Group::Main, &a.piece.jet(a.piece.length()), &b.piece.jet(0.0))
}

/// The least limits of the axes that move.
fn limits<'a>(pieces: impl Iterator<Item = &'a Piece>, settings: &Settings) -> Option<AxisLimits> {
    let mut moves = [false; 3];
    for piece in pieces {
        for x in [0.0, 0.3, 0.8] {
            let jet = piece.jet(x * piece.length());
            for (moves, d) in moves.iter_mut().zip(&jet.d1) {
                *moves |= d.abs() > 1e-9;
            }
        }
    }
    let mut least: Option<AxisLimits> = None;
    for (axis, _) in settings.axes.iter().zip(moves).filter(|(_, moves)| *moves) {
        let axis = (*axis)?;
        least = Some(least.map_or(axis, |least| AxisLimits {
            velocity: least.velocity.min(axis.velocity),
            acceleration: least.acceleration.min(axis.acceleration),
            jerk: least.jerk.min(axis.jerk),
            ..least
        }));
    }
    least
}

/// Speed that a move allows.
fn cap(part: &Move, limits: &AxisLimits) -> f64 {
    let bend = Group::Main.norm(&part.piece.jet(0.5 * part.piece.length()).d2);
    part.feed
        .min(limits.velocity)
        .min((limits.acceleration / bend).sqrt())
        .min(ARC * libm::cbrt(limits.jerk / (bend * bend)))
}

/// About the speed at which a corner between two moves will be passed.
fn crossing(a: &Move, b: &Move, settings: &Settings) -> f64 {
    let Corner::Round(tolerance) = a.corner else { return 0.0 };
    let paced_alike = a.rapid == b.rapid && a.is_led() == b.is_led();
    if !paced_alike || a.piece.group() != Group::Main || b.piece.group() != Group::Main {
        return 0.0;
    }
    let Some(limits) = limits([&a.piece, &b.piece].into_iter(), settings) else {
        return 0.0;
    };
    let (end, start) = (a.piece.jet(a.piece.length()), b.piece.jet(0.0));
    let bend = distance(&end.d2, &start.d2);
    // Third derivatives of the path.
    let sharp = (turning(Group::Main, &end, &start) / CORNER).powi(3) / (tolerance * tolerance);
    let bent = 1.2 * bend * (bend / tolerance).sqrt() * 0.1 / BENT.powi(3);
    libm::cbrt(limits.jerk / (sharp + bent))
}
