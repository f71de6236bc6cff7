//! Motion in time on parts of the path: starts and stops of constant jerk, phases, spans of the spline.
//!
//! In:  parts of the path, states at knots, phases.
//! Out: elements.

use super::joints::{Joints, Steady};
use super::knots::Knotted;
use super::s_curve::s_curve;
use super::sections::{Log, Part, Place};
use super::solver::{self, JointJet, JointLimits, Launch, State};
use crate::element::{Element, Span};
use crate::path::Piece;
use crate::plan::limits::PathLimits;
use crate::plan::profile::{Phase, duration};

/// Time by Simpson's rule over that by the mean speed, up to which it is taken.
const SIMPSON_NEAR: f64 = 1.5;

/// Which end of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Start,
    Stop,
}

/// The launch at the beginning or the end of a part; `None` where geometry leaves none.
pub(super) fn launch(part: Part, side: Side, log: &Log, joints: &Joints, jets: &mut Vec<JointJet>) -> Option<Launch> {
    let stretch = log.stretch(part.item)?;
    let mut feed = log.feed(part.item);
    let mut taken = Vec::new();
    joints.taken(log.kinks(part.item, part.near), &mut taken);
    for kink in log.kinks(part.item, part.near) {
        feed = feed.min(kink.speed);
    }
    // A launch ends at a quarter of the speed, and what follows it rises to about twice as much.
    let limits = joints.left(&taken, if taken.is_empty() { 0.0 } else { 0.6 * feed });
    solver::launch(&limits, feed * feed, part.to - part.from, 1.0, |x, at| {
        let s = match side {
            Side::Start => part.from + x,
            Side::Stop => part.to - x,
        };
        joints.jets(&stretch.piece, s, jets);
        at.copy_from_slice(jets);
    })
}

/// Parts of the speed and acceleration that the solver plans with which straight stretches take: less, so that a new plan can go on
/// from any place on them.
const STRAIGHT_PARTS: [f64; 2] = [0.99995, 0.998];

/// Spans are divided until they take no longer, s: at the end of each, another plan may take over.
const DIVISION_S: f64 = 0.01;
/// Those that take longer stay whole until they are handed over, s: of constant jerk, and of the spline. There may be hours of
/// motion in one.
const LONG_S: [f64; 2] = [5.12, 0.2];

/// An element, and where on the path it ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Made {
    pub(super) element: Element,
    pub(super) end: Place,
    /// Whether another plan may take over at its end.
    pub(super) opens: bool,
}

impl Made {
    /// Into how many elements it is divided when a machine may have to leave its plan on the way; 1: it is as it stays.
    pub(super) fn parts(&self) -> usize {
        match &self.element {
            // Rounding makes no part.
            Element::Span(span) => ((span.duration_s / DIVISION_S * (1.0 - 1e-9)).ceil() as usize).max(1),
            Element::Synced(_) | Element::Probing(_) | Element::Dwell { .. } | Element::Action { .. } => 1,
        }
    }

    /// Takes this many of its parts, of which there must be more, off its beginning.
    pub(super) fn split_off(&mut self, count: usize, out: &mut Vec<Made>) {
        let parts = self.parts();
        let Element::Span(left) = &mut self.element else { return };
        let whole = *left;
        let step = whole.duration_s / parts as f64;
        for k in 0..count {
            let mut part = *left;
            part.duration_s = step;
            let until = step * (k + 1) as f64;
            left.s0 = whole.place(until);
            left.v0 = whole.speed(until);
            left.a0 = whole.a0 + whole.jerk * until + whole.gradient * (left.s0 - whole.s0);
            left.duration_s = whole.duration_s - until;
            let item = self.end.item;
            out.push(Made {
                element: Element::Span(part),
                end: Place { item, s: left.s0 },
                opens: true,
            });
        }
    }
}

/// A place between two knots or phases, with the motion there, as elements.
pub(super) struct Emission<'a> {
    pub(super) log: &'a Log,
    pub(super) out: &'a mut Vec<Made>,
}

impl Emission<'_> {
    /// Constant jerk from a place on.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn span(&mut self, item: u64, s0: f64, v0: f64, a0: f64, jerk: f64, gradient: f64, duration_s: f64) {
        if let Some(stretch) = self.log.stretch(item)
            && duration_s > 0.0
        {
            let span = Span {
                s0,
                v0,
                a0,
                jerk,
                gradient,
                duration_s,
                ..stretch.span()
            };
            let end = span.place(duration_s);
            self.divided(item, &span, end, LONG_S[0]);
        }
    }

    /// A span that ends at `end`, in parts if it takes long, but not if it takes very long.
    fn divided(&mut self, item: u64, span: &Span, end: f64, long_s: f64) {
        let parts = match span.duration_s > long_s {
            true => 1.0,
            false => (span.duration_s / DIVISION_S).ceil().max(1.0),
        };
        let step = span.duration_s / parts;
        let mut part = *span;
        for k in 1..=parts as u32 {
            let (begin, until) = (step * f64::from(k - 1), step * f64::from(k));
            let last = f64::from(k) == parts;
            part.duration_s = if last { span.duration_s - begin } else { step };
            let s = if last { end } else { span.place(until) };
            self.out.push(Made {
                element: Element::Span(part),
                end: Place { item, s },
                opens: true,
            });
            if !last {
                part.s0 = s;
                part.v0 = span.speed(until);
                part.a0 = span.a0 + span.jerk * until + span.gradient * (s - span.s0);
            }
        }
    }

    /// A start on the first part of a section.
    pub(super) fn start(&mut self, part: Part, launch: &Launch) {
        self.span(part.item, part.from, 0.0, 0.0, launch.jerk, 0.0, launch.duration_s);
    }

    /// A stop on the last part of a section.
    pub(super) fn stop(&mut self, part: Part, launch: &Launch) {
        let State { b, u } = launch.stop();
        let s = part.to - launch.length();
        self.span(part.item, s, b.sqrt(), u, launch.jerk, 0.0, launch.duration_s);
    }

    /// A span of the spline: from state to state over a part.
    pub(super) fn spline(&mut self, part: Part, from: State, to: State) {
        let length = part.to - part.from;
        let gradient = (to.u - from.u) / length;
        let (v0, v1) = (from.b.sqrt(), to.b.sqrt());
        let mean_s = 2.0 * length / (v0 + v1);
        if gradient.abs() * mean_s * mean_s > 0.7 * Span::GRADIENT_TIME2_MAX {
            // The series would lose digits: two halves.
            let half = 0.5 * length;
            let u = from.u + gradient * half;
            let middle = State {
                b: from.b + (from.u + u) * half,
                u,
            };
            let s = part.from + half;
            if middle.b > 0.0 {
                self.spline(Part { to: s, ..part }, from, middle);
                self.spline(Part { from: s, ..part }, middle, to);
                return;
            }
        }
        let Some(stretch) = self.log.stretch(part.item) else {
            return;
        };
        let mut span = Span {
            s0: part.from,
            v0,
            a0: from.u,
            gradient,
            duration_s: mean_s,
            ..stretch.span()
        };
        // Simpson's rule is near; where the motion nearly stands still at one end it is not, nor is any other.
        let middle = from.b + length * (from.u + 0.25 * length * gradient);
        let simpson_s = length / 6.0 * (1.0 / v0 + 4.0 / middle.sqrt() + 1.0 / v1);
        if simpson_s < SIMPSON_NEAR * mean_s {
            span.duration_s = simpson_s;
        }
        // Newton's steps within a bracket. The place rises until the end; behind it the motion may turn round soon, where speed
        // has nearly come down to nothing.
        let (mut low, mut high) = (0.0, f64::INFINITY);
        for _ in 0..60 {
            let t = span.duration_s;
            let (error, speed) = (span.place(t) - part.to, span.speed(t));
            if error > 0.0 || speed <= 0.0 {
                high = t;
            } else {
                low = t;
            }
            let newton = t - error / speed;
            if speed > 0.0 && (newton - t).abs() <= 1e-15 + 1e-15 * t {
                break;
            }
            let within = newton > low && newton < high;
            span.duration_s = match (within, high < f64::INFINITY) {
                (true, _) => newton,
                (false, true) => 0.5 * (low + high),
                (false, false) => 2.0 * t,
            };
        }
        self.divided(part.item, &span, part.to, LONG_S[1]);
    }

    /// Spans of the spline from state to state. Where a straight stretch takes several of them, the fastest motion between its
    /// ends takes their place: it may be faster than a spline with few knots, and is never slower.
    pub(super) fn spans(&mut self, spans: &[Knotted], states: &[State], joints: &Joints, jets: &mut Vec<JointJet>) {
        let mut first = 0;
        for group in spans.chunk_by(|a, b| a.item == b.item && a.near == b.near) {
            let states = &states[first..=first + group.len()];
            first += group.len();
            if !self.straight(group, states, joints, jets) {
                for (span, states) in group.iter().zip(states.windows(2)) {
                    self.spline(span.part(), states[0], states[1]);
                }
            }
        }
    }

    /// Several spans on one piece, in closed form; whether there is one.
    fn straight(&mut self, spans: &[Knotted], states: &[State], joints: &Joints, jets: &mut Vec<JointJet>) -> bool {
        let ([first, .., last], [from, .., to]) = (spans, states) else {
            return false;
        };
        let Some(stretch) = self.log.stretch(first.item) else {
            return false;
        };
        // A new plan that is faster than the feed comes down to it by its spans.
        if first.near != [false; 2] || first.ease > 0.0 || !joints.are_even(&stretch.piece) {
            return false;
        }
        joints.jets(&stretch.piece, first.from, jets);
        let most = solver::even_limits(joints.limits(), jets, self.log.feed(first.item));
        let limits = PathLimits {
            v: (STRAIGHT_PARTS[0] * most.v).max(from.b.max(to.b).sqrt()),
            a: (STRAIGHT_PARTS[1] * most.a).max(from.u.abs()).max(to.u.abs()),
            ..most
        };
        let part = Part {
            to: last.to,
            ..first.part()
        };
        let Some(phases) = s_curve(*from, *to, part.to - part.from, &limits) else {
            return false;
        };
        self.phases(&[part], &phases);
        true
    }

    /// Phases along parts that follow each other; returns where they end.
    pub(super) fn phases(&mut self, parts: &[Part], phases: &[Phase]) -> Place {
        let mut index = 0;
        let mut before = 0.0;
        let mut last = parts.first().map_or(Place { item: 0, s: 0.0 }, |part| Place {
            item: part.item,
            s: part.from,
        });
        for phase in phases {
            let mut t = 0.0;
            while let Some(part) = parts.get(index) {
                let border = before + part.to - part.from;
                let ends_here = index + 1 == parts.len() || phase.place(phase.duration) <= border;
                let until = if ends_here {
                    phase.duration
                } else {
                    phase.time_at(border, t)
                };
                let s = part.from + phase.place(t) - before;
                self.span(
                    part.item,
                    s,
                    phase.speed(t).max(0.0),
                    phase.a + t * phase.jerk,
                    phase.jerk,
                    0.0,
                    until - t,
                );
                last = Place {
                    item: part.item,
                    s: (part.from + phase.place(until) - before).min(part.to),
                };
                t = until;
                if ends_here {
                    break;
                }
                before = border;
                index += 1;
            }
        }
        last
    }
}

/// Part of acceleration and jerk that the bend of the path may take where nothing is known of the motion.
const BEND_PART: f64 = 0.65;

/// Limits along a part that hold for any motion over it, of joints with these limits; the kinks at its ends are not passed.
pub(super) fn steady_limits(
    part: Part,
    limits: &[JointLimits],
    log: &Log,
    joints: &Joints,
    jets: &mut Vec<JointJet>,
) -> PathLimits {
    match log.stretch(part.item) {
        Some(stretch) => sampled(part, &stretch.piece, joints, jets).limits(limits, log.feed(part.item), BEND_PART),
        None => Steady::default().limits(limits, f64::INFINITY, BEND_PART),
    }
}

fn sampled(part: Part, piece: &Piece, joints: &Joints, jets: &mut Vec<JointJet>) -> Steady {
    let mut steady = Steady::default();
    joints.sample(piece, [part.from, part.to], jets, |jets| steady.include(jets));
    steady
}

/// The limits along a part, of those that hold for any motion over it, with which it takes the shortest time from rest to rest.
pub(super) fn limits_from_rest_to_rest(part: Part, log: &Log, joints: &Joints, jets: &mut Vec<JointJet>) -> PathLimits {
    let Some(stretch) = log.stretch(part.item) else {
        return steady_limits(part, joints.limits(), log, joints, jets);
    };
    let steady = match joints.greatest(&stretch.piece) {
        Some(greatest) => Steady::new(greatest),
        None => sampled(part, &stretch.piece, joints, jets),
    };
    fastest(&steady, part.to - part.from, log.feed(part.item), joints).1
}

/// Time from rest to rest over a length, s, and the limits with which it is the shortest.
fn fastest(steady: &Steady, length: f64, feed: f64, joints: &Joints) -> (f64, PathLimits) {
    /// The faster the motion, the more of acceleration and jerk the bend takes, and the less is left for changes of speed.
    const BEND_PARTS: [f64; 6] = [0.9, 0.75, BEND_PART, 0.5, 0.35, 0.25];
    let tries = BEND_PARTS.map(|bend| {
        let limits = steady.limits(joints.limits(), feed, bend);
        (duration(0.0, 0.0, length, &limits), limits)
    });
    let [first, others @ ..] = tries;
    others
        .into_iter()
        .fold(first, |best, next| if next.0 < best.0 { next } else { best })
}

/// Whether seven phases run a piece from rest to rest about as fast as if it were straight.
pub(super) fn is_as_good_as_straight(piece: &Piece, feed: f64, joints: &Joints) -> bool {
    /// Their time over that of a straight one: the spline takes longer.
    const LONGER: f64 = 1.01;
    if joints.are_even(piece) {
        return true;
    }
    let Some(greatest) = joints.greatest(piece) else {
        return false;
    };
    let steady = Steady::new(greatest);
    let [bent, straight] = [steady, steady.straight()].map(|steady| fastest(&steady, piece.length(), feed, joints).0);
    bent <= LONGER * straight
}
