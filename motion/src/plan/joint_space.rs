//! Joints of a machine whose kinematics are not trivial, and whether a move stays inside what they can reach.
//!
//! In:  kinematics, limits by joint, pieces of path.
//! Out: nothing, or the joint that would leave its travel and the place where it would.
//!
//! Between two samples a joint is followed by the cubic that has its positions and slopes at both; that lies inside the
//! polygon of its four Bézier points. Where this polygon leaves the travel, the samples are brought closer together, until
//! one of them is outside or all that is left of the polygon's excess is rounding.

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

/// Way between samples at the start, mm, and turn of each rotary axis, degrees: what a joint does beyond its cubic over
/// these is far below a micrometre.
const SAMPLE_MM: f64 = 5.0;
const SAMPLE_DEGREES: f64 = 1.0;
/// Samples of one piece at the start.
const SAMPLES_MAX: f64 = 20_000.0;
/// How often an interval may be halved.
const HALVINGS: u32 = 24;
/// What rounding adds to a position at the limit is no excess.
const ROUNDING: f64 = 1e-6;

type Joints = [Jet3; JOINTS];

impl JointSpace {
    /// How many joints there are.
    pub fn count(&self) -> usize {
        self.kinematics.joints().len()
    }

    /// Whether all joints reach every place of a piece within their travel.
    pub(super) fn check(&self, piece: &Piece) -> Result<(), PlanErrorKind> {
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
            self.check_between(piece, &from, &to, HALVINGS)?;
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
        from: &(f64, Joints),
        to: &(f64, Joints),
        halvings: u32,
    ) -> Result<(), PlanErrorKind> {
        let third = (to.0 - from.0) / 3.0;
        let mut doubtful = false;
        for joint in 0..self.count() {
            let (a, b) = (&from.1[joint], &to.1[joint]);
            for (s, end) in [(from.0, a), (to.0, b)] {
                if let Some(limit) = self.excess(joint, end.q) {
                    return Err(PlanErrorKind::JointTravel {
                        joint,
                        rotary: self.kinematics.is_rotary(joint),
                        value: end.q,
                        limit,
                        place: Box::new(piece.position(s)),
                    });
                }
            }
            let inner = [a.q + third * a.d1, b.q - third * b.d1];
            doubtful |= inner.into_iter().any(|q| self.excess(joint, q).is_some());
        }
        if !doubtful || halvings == 0 {
            return Ok(());
        }
        let s = 0.5 * (from.0 + to.0);
        let middle = (s, self.joints(piece, s)?);
        self.check_between(piece, from, &middle, halvings - 1)?;
        self.check_between(piece, &middle, to, halvings - 1)
    }

    /// The limit that a joint position is beyond.
    fn excess(&self, joint: usize, value: f64) -> Option<f64> {
        let [low, high] = self.limits[joint].travel;
        if value < low - ROUNDING {
            Some(low)
        } else if value > high + ROUNDING {
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
