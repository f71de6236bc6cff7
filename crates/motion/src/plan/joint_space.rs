//! Joints of a machine whose kinematics are not trivial, and whether a move stays inside what they can reach.
//!
//! In:  kinematics, limits by joint, pieces of path.
//! Out: nothing, or the joint that would leave its travel and the place where it would.
//!
//! Between two samples a joint is followed by the quintic that has its positions and first two derivatives at both; that lies
//! inside the polygon of its six Bézier points. What the joint does beyond that is far less than what the quintic does beyond
//! the cubic of positions and slopes, by which the polygon is widened. Where it leaves the travel, the samples are brought
//! closer together, until one of them is outside or all that is left of the polygon's excess is rounding.

use super::{AxisLimits, PlanErrorKind};
use crate::canon::{Axis, Position};
use crate::kinematics::{JOINTS, Jet3, Kinematics, Unreachable};
use crate::path::Piece;

/// What the joints of a machine can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSpace {
    /// From axes to joints.
    pub kinematics: Kinematics,
    /// By joint; as many as the kinematics have joints.
    pub limits: [AxisLimits; JOINTS],
}

/// Way between samples at the start, mm, and turn of each rotary axis, degrees.
const SAMPLE_MM: f64 = 5.0;
const SAMPLE_DEGREES: f64 = 1.0;
/// Samples of one piece at the start.
const SAMPLES_MAX: f64 = 20_000.0;
/// How often an interval may be halved.
const HALVINGS: u32 = 24;

type Joints = [Jet3; JOINTS];

impl JointSpace {
    /// How many joints there are.
    pub fn count(&self) -> usize {
        self.kinematics.joints().len()
    }

    /// Whether all joints reach every place of a piece within their travel, but for `rounding`.
    pub(super) fn check(&self, piece: &Piece, rounding: f64) -> Result<(), PlanErrorKind> {
        let length = piece.length();
        let (start, end) = (piece.position(0.0), piece.position(length));
        let turned = Axis::ALL
            .into_iter()
            .filter(|axis| axis.is_rotary())
            .map(|axis| (end[axis] - start[axis]).abs())
            .fold(0.0, f64::max);
        let samples = (length / SAMPLE_MM)
            .max(turned / SAMPLE_DEGREES)
            .clamp(2.0, SAMPLES_MAX)
            .ceil();
        let mut from = (0.0, self.joints(piece, 0.0)?);
        for k in 1..=samples as usize {
            let s = length * k as f64 / samples;
            let to = (s, self.joints(piece, s)?);
            self.check_between(piece, [&from, &to], rounding, HALVINGS)?;
            from = to;
        }
        Ok(())
    }

    fn joints(&self, piece: &Piece, s: f64) -> Result<Joints, PlanErrorKind> {
        let jet = piece.jet(s);
        let mut joints = [Jet3::ZERO; JOINTS];
        match self.kinematics.jets(piece.frame(), &jet, &mut joints[..self.count()]) {
            Ok(()) => Ok(joints),
            Err(unreachable) => Err(PlanErrorKind::Unreachable {
                unreachable,
                place: Box::new(Position(jet.q)),
            }),
        }
    }

    fn check_between(
        &self,
        piece: &Piece,
        [from, to]: [&(f64, Joints); 2],
        rounding: f64,
        halvings: u32,
    ) -> Result<(), PlanErrorKind> {
        let h = to.0 - from.0;
        let mut doubtful = false;
        for joint in 0..self.count() {
            let (a, b) = (&from.1[joint], &to.1[joint]);
            for (s, end) in [(from.0, a), (to.0, b)] {
                if let Some(limit) = self.excess(joint, end.q, rounding) {
                    return Err(PlanErrorKind::JointTravel {
                        joint,
                        rotary: self.kinematics.is_rotary(joint),
                        value: end.q,
                        limit,
                        place: Box::new(piece.position(s)),
                    });
                }
            }
            let (slopes, bends) = ([a, b].map(|q| q.d1 * h), [a, b].map(|q| q.d2 * h * h));
            let polygon = [
                a.q + slopes[0] / 5.0,
                a.q + 2.0 * slopes[0] / 5.0 + bends[0] / 20.0,
                b.q - 2.0 * slopes[1] / 5.0 + bends[1] / 20.0,
                b.q - slopes[1] / 5.0,
            ];
            // Second derivatives of the cubic at both ends: unlike ones make a difference of a 64th in the middle.
            let rise = 6.0 * (b.q - a.q);
            let cubic = [
                rise - 4.0 * slopes[0] - 2.0 * slopes[1],
                4.0 * slopes[1] + 2.0 * slopes[0] - rise,
            ];
            let missed = ((bends[0] - cubic[0]).abs() + (bends[1] - cubic[1]).abs()) / 64.0;
            let widened = polygon.into_iter().flat_map(|q| [q - missed, q + missed]);
            doubtful |= widened.into_iter().any(|q| self.excess(joint, q, rounding).is_some());
        }
        if !doubtful || halvings == 0 {
            return Ok(());
        }
        let s = 0.5 * (from.0 + to.0);
        let middle = (s, self.joints(piece, s)?);
        self.check_between(piece, [from, &middle], rounding, halvings - 1)?;
        self.check_between(piece, [&middle, to], rounding, halvings - 1)
    }

    /// The limit that a joint position is beyond.
    fn excess(&self, joint: usize, value: f64, rounding: f64) -> Option<f64> {
        let [low, high] = self.limits[joint].travel;
        if value < low - rounding {
            Some(low)
        } else if value > high + rounding {
            Some(high)
        } else {
            None
        }
    }
}

/// Letters and values of the axes that exist, for messages.
pub(super) fn place(position: &Position) -> String {
    let shown = |axis: &Axis| (*axis as usize) < 3 || position[*axis] != 0.0;
    let words: Vec<String> = Axis::ALL
        .into_iter()
        .filter(shown)
        .map(|axis| format!("{}{:.3}", axis.letter(), position[axis]))
        .collect();
    words.join(" ")
}

/// The same for a place that cannot be reached.
pub(super) fn unreachable(unreachable: &Unreachable, at: &Position) -> String {
    format!("{} at {} (machine coordinates)", unreachable, place(at))
}
