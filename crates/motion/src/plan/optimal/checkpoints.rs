//! Derivatives of the joints at the checkpoints of a span, and whether three checkpoints are enough.
//!
//! In:  a span between two knots.
//! Out: the span with its checkpoints in the grid; where the joints turn too unevenly, its parts.

use super::joints::Joints;
use super::knots::Knotted;
use super::solver::{CREST, JointJet, Taken, crest};
use super::windows::Uncut;
use crate::path::Shape;
use crate::plan::smooth::Stretch;

/// Acceleration or jerk, over its limit, by which what happens between checkpoints may differ from what they show.
const UNSEEN: f64 = 0.004;
/// Speed over that for which knots were placed, at which this is judged.
const FASTER: f64 = 2.0;
/// The same in a curve that is passed slowly, where joints allow little more than knots were placed for; and its
/// [`evenness`](crate::path::Blend::evenness) at the most.
const FASTER_IN_SLOW: (f64, f64) = (1.3, 0.5);
/// How often a span may be halved.
const HALVINGS: u32 = 5;

/// The end of a span, at which the next one may begin.
#[derive(Debug, Default)]
pub(super) struct Seen {
    place: Option<(u64, f64)>,
    jets: Vec<JointJet>,
}

/// Checkpoints on a stretch.
pub(super) struct Checkpoints<'a> {
    pub(super) joints: &'a Joints,
    pub(super) stretch: &'a Stretch,
    /// Greatest speed along it, mm/s.
    pub(super) feed: f64,
    /// The same by kinks that are near.
    pub(super) slowest: f64,
    /// What they take of the limits of each joint; empty where there are none.
    pub(super) taken: &'a [Taken],
}

impl Checkpoints<'_> {
    fn at(&self, s: f64) -> Vec<JointJet> {
        let mut jets = Vec::with_capacity(self.joints.limits().len());
        self.joints.jets(&self.stretch.piece, s, &mut jets);
        jets
    }

    /// Adds a span; `seen`: the end of the one before.
    pub(super) fn add(&self, span: Knotted, uncut: &mut Uncut, seen: &mut Seen) {
        let begin = if seen.place == Some((span.item, span.from)) {
            std::mem::take(&mut seen.jets)
        } else {
            self.at(span.from)
        };
        seen.place = None;
        if self.joints.are_even(&self.stretch.piece) {
            self.push(span, [&begin, &begin, &begin], uncut);
        } else {
            let (middle, end) = (self.at(0.5 * (span.from + span.to)), self.at(span.to));
            self.divide(span, [&begin, &middle, &end], HALVINGS, uncut);
            *seen = Seen {
                place: Some((span.item, span.to)),
                jets: end,
            };
        }
    }

    fn push(&self, span: Knotted, checkpoints: [&[JointJet]; 3], uncut: &mut Uncut) {
        let cap = (self.feed * self.feed).max(span.ease).min(self.slowest * self.slowest);
        uncut
            .push(span)
            .push_span(span.to - span.from, span.time_s, cap, checkpoints, self.taken);
    }

    fn divide(&self, span: Knotted, [begin, middle, end]: [&[JointJet]; 3], halvings: u32, uncut: &mut Uncut) {
        let s = 0.5 * (span.from + span.to);
        let (first, third) = (self.at(0.5 * (span.from + s)), self.at(0.5 * (s + span.to)));
        let v = self.faster() * (span.to - span.from) / span.time_s;
        let unseen = self
            .unseen(v, [begin, middle, end], &first)
            .max(self.unseen(v, [end, middle, begin], &third));
        // Checkpoints at the quarters, which the grid adds by itself, make a crest four times lower.
        let crest = crest(self.joints.limits(), span.to - span.from, [begin, middle, end]);
        if halvings == 0 || (unseen <= UNSEEN && crest <= 4.0 * CREST) {
            self.push(span, [begin, middle, end], uncut);
            return;
        }
        let half = Knotted {
            time_s: 0.5 * span.time_s,
            ..span
        };
        self.divide(Knotted { to: s, ..half }, [begin, &first, middle], halvings - 1, uncut);
        self.divide(Knotted { from: s, ..half }, [middle, &third, end], halvings - 1, uncut);
    }

    fn faster(&self) -> f64 {
        match self.stretch.piece.shape() {
            Shape::Blend(blend) if blend.evenness() <= FASTER_IN_SLOW.1 => FASTER_IN_SLOW.0,
            Shape::Line(_) | Shape::Arc(_) | Shape::Blend(_) => FASTER,
        }
    }

    /// How far the joints at the quarter next to the first of three checkpoints are from the parabola through them.
    fn unseen(&self, v: f64, [near, middle, far]: [&[JointJet]; 3], quarter: &[JointJet]) -> f64 {
        let mut most = 0.0f64;
        for (joint, limits) in self.joints.limits().iter().enumerate() {
            let differs = |of: fn(&JointJet) -> f64| {
                let parabola = 0.375 * of(&near[joint]) + 0.75 * of(&middle[joint]) - 0.125 * of(&far[joint]);
                (of(&quarter[joint]) - parabola).abs()
            };
            let (second, third) = (differs(|jet| jet.d2), differs(|jet| jet.d3));
            let jerk = third * v * v * v + 1.5 * second * v * limits.acceleration;
            most = most.max(second * v * v / limits.acceleration).max(jerk / limits.jerk);
        }
        most
    }
}
