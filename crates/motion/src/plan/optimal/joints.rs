//! The path as the joints see it: limits, and derivatives of every joint by path length.
//!
//! In:  derivatives of the axes.
//! Out: derivatives of the joints, and the speed that they allow.

use std::f64::consts::TAU;

use super::solver::{JointJet, JointLimits, Taken};
use crate::kinematics::{JOINTS, Jet3, Kinematics};
use crate::path::{Piece, Shape};
use crate::plan::junctions::Kink;
use crate::plan::limits::{Bounds, PathLimits, uneven_steps};
use crate::plan::{AxisLimits, Settings};

/// Motion of joints over motion of axes where no joints belong to them.
const BEYOND: f64 = 1e6;

/// Joints of the machine.
#[derive(Clone, Debug)]
pub(super) struct Joints {
    limits: Vec<JointLimits>,
    follow: Follow,
}

/// How joints come from axes.
#[derive(Clone, Debug)]
enum Follow {
    /// Each is one of these axes.
    Axes(Vec<usize>),
    Kinematics(Kinematics),
}

/// What the joints allow at a point of the path, each of them taken alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Allowed {
    /// Square of the speed, by speed limits and by acceleration and jerk of steady motion.
    pub(super) b: f64,
    /// Acceleration along the path.
    pub(super) a: f64,
    /// Jerk along the path.
    pub(super) j: f64,
}

impl Joints {
    pub(super) fn new(settings: &Settings) -> Joints {
        let limits = |axis: &AxisLimits| JointLimits {
            velocity: axis.velocity,
            acceleration: axis.acceleration,
            jerk: axis.jerk,
        };
        if let Some(space) = &settings.joints {
            return Joints {
                limits: space.limits[..space.count()].iter().map(limits).collect(),
                follow: Follow::Kinematics(space.kinematics),
            };
        }
        let existing = || {
            settings
                .axes
                .iter()
                .enumerate()
                .filter_map(|(k, axis)| Some((k, axis.as_ref()?)))
        };
        Joints {
            limits: existing().map(|(_, axis)| limits(axis)).collect(),
            follow: Follow::Axes(existing().map(|(k, _)| k).collect()),
        }
    }

    pub(super) fn limits(&self) -> &[JointLimits] {
        &self.limits
    }

    /// What kinks take of the limits of each joint, of each the most; nothing is pushed where there are none.
    pub(super) fn taken<'a>(&self, kinks: impl Iterator<Item = &'a Kink>, out: &mut Vec<Taken>) {
        out.clear();
        // Other joints come to rest at kinks.
        let Follow::Axes(axes) = &self.follow else { return };
        for kink in kinks {
            out.resize(axes.len(), Taken::default());
            for (taken, &axis) in out.iter_mut().zip(axes) {
                *taken = taken.max(kink.taken[axis]);
            }
        }
    }

    /// What is left of the limits at a speed where kinks take this.
    pub(super) fn left(&self, taken: &[Taken], speed: f64) -> Vec<JointLimits> {
        let mut left = self.limits.clone();
        for (limits, taken) in left.iter_mut().zip(taken) {
            limits.acceleration -= taken.acceleration;
            limits.jerk -= taken.jerk + taken.jerk_by_speed * speed;
        }
        left
    }

    /// Whether the joints move evenly along a piece.
    pub(super) fn are_even(&self, piece: &Piece) -> bool {
        let line = matches!(piece.shape(), Shape::Line(_));
        line && match &self.follow {
            Follow::Axes(_) => true,
            Follow::Kinematics(kinematics) => kinematics.is_linear(piece.frame()),
        }
    }

    /// Greatest first, second and third derivative of every joint on a whole piece, in amount, where joints are axes.
    pub(super) fn greatest(&self, piece: &Piece) -> Option<[[f64; 3]; JOINTS]> {
        let Follow::Axes(axes) = &self.follow else { return None };
        let bounds = Bounds::new(piece);
        let mut greatest = [[0.0; 3]; JOINTS];
        for (greatest, &axis) in greatest.iter_mut().zip(axes) {
            *greatest = bounds.of_axis(axis);
        }
        Some(greatest)
    }

    /// Derivatives of all joints at a place of a piece.
    pub(super) fn jets(&self, piece: &Piece, s: f64, out: &mut Vec<JointJet>) {
        let jet = piece.jet(s);
        out.clear();
        match &self.follow {
            Follow::Axes(axes) => out.extend(axes.iter().map(|&axis| JointJet {
                d1: jet.d1[axis],
                d2: jet.d2[axis],
                d3: jet.d3[axis],
            })),
            Follow::Kinematics(kinematics) => {
                let mut joints = [Jet3::ZERO; JOINTS];
                let joints = &mut joints[..self.limits.len()];
                // Every place of a programmed move has been found to be within reach. A blend may leave it by its
                // tolerance: there, the machine all but stops.
                if kinematics.jets(piece.frame(), &jet, joints).is_err() {
                    joints.fill(Jet3::new(0.0, BEYOND, 0.0, 0.0));
                }
                out.extend(joints.iter().map(|joint| JointJet {
                    d1: joint.d1,
                    d2: joint.d2,
                    d3: joint.d3,
                }));
            }
        }
    }

    /// Shows `see` the derivatives of all joints from `from` to `to` of a piece, as close together as they change.
    pub(super) fn sample(
        &self,
        piece: &Piece,
        [from, to]: [f64; 2],
        jets: &mut Vec<JointJet>,
        mut see: impl FnMut(&[JointJet]),
    ) {
        /// Steps of a curve along which the length grows evenly, or of a turn; and of many turns.
        const STEPS: usize = 16;
        const STEPS_MAX: f64 = 50_000.0;
        let mut at = |s: f64| {
            self.jets(piece, s, jets);
            see(jets);
        };
        at(from);
        if self.are_even(piece) {
            return;
        }
        let steps = match piece.shape() {
            Shape::Blend(blend) => uneven_steps(blend),
            Shape::Arc(arc) => {
                let [begin, end] = piece.turn_range();
                let part = (end - begin) * (to - from) / piece.length();
                let turns = part * arc.sweep_rad().abs() / TAU;
                // Rounding makes no step.
                (STEPS as f64 * turns * (1.0 - 1e-9)).min(STEPS_MAX).ceil() as usize
            }
            Shape::Line(_) => 0,
        };
        // Equal steps of the length would leap over where it nearly stands still.
        let place = (steps > STEPS).then(|| piece.by_parameter(from, to));
        let steps = steps.max(STEPS);
        for k in 1..=steps {
            let part = k as f64 / steps as f64;
            at(place.as_ref().map_or(from + (to - from) * part, |place| place(part)));
        }
    }

    /// The speed along a piece at which the first joint somewhere reaches its speed limit, mm/s.
    pub(super) fn fastest(&self, piece: &Piece, jets: &mut Vec<JointJet>) -> f64 {
        let mut fastest = f64::INFINITY;
        self.sample(piece, [0.0, piece.length()], jets, |jets| {
            for (jet, limits) in jets.iter().zip(&self.limits) {
                fastest = fastest.min(limits.velocity / jet.d1.abs());
            }
        });
        fastest
    }

    /// What limits leave at a point with these derivatives, for speeds up to `feed`.
    pub(super) fn allowed(&self, jets: &[JointJet], feed: f64) -> Allowed {
        let mut allowed = Allowed {
            b: feed * feed,
            a: f64::INFINITY,
            j: f64::INFINITY,
        };
        for (jet, limits) in jets.iter().zip(&self.limits) {
            let (d1, d2, d3) = (jet.d1.abs(), jet.d2.abs(), jet.d3.abs());
            let speed = limits.velocity / d1;
            let turning = libm::cbrt(limits.jerk / d3);
            allowed.b = allowed
                .b
                .min(speed * speed)
                .min(limits.acceleration / d2)
                .min(turning * turning);
            allowed.a = allowed.a.min(limits.acceleration / d1);
            allowed.j = allowed.j.min(limits.jerk / d1);
        }
        allowed
    }
}

/// Limits along the path that hold for any motion over a stretch, found from samples of it or from its greatest derivatives.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Steady {
    /// Greatest first, second and third derivative of every joint, in amount.
    greatest: [[f64; 3]; JOINTS],
    /// The sample before.
    last: Option<[[f64; 3]; JOINTS]>,
}

/// Part of what is left of the jerk that the change of acceleration on a bent path may take.
const COUPLED_PART: f64 = 0.5;
/// Part of the speed limits: less than what the solver plans with, so that it can go on from there.
const SPEED_PART: f64 = 0.9997;
/// Part of the limits that is used at all: samples may miss a crest.
const LIMIT_PART: f64 = 0.985;

impl Steady {
    /// With these greatest derivatives.
    pub(super) fn new(greatest: [[f64; 3]; JOINTS]) -> Steady {
        Steady { greatest, last: None }
    }

    /// Takes the next sample in; a quarter of the step from the one before covers a crest between the two.
    pub(super) fn include(&mut self, jets: &[JointJet]) {
        let mut here = [[0.0; 3]; JOINTS];
        for (values, jet) in here.iter_mut().zip(jets) {
            *values = [jet.d1, jet.d2, jet.d3];
        }
        let last = self.last.replace(here).unwrap_or(here);
        for (joint, greatest) in self.greatest.iter_mut().enumerate() {
            for (order, most) in greatest.iter_mut().enumerate() {
                let (now, then) = (here[joint][order], last[joint][order]);
                *most = most.max(now.abs().max(then.abs()) + (now - then).abs() / 4.0);
            }
        }
    }

    /// The limits for speeds up to `feed` of joints with these limits, of whose acceleration and jerk the bend of the path may take
    /// this part at full speed; the rest is for changes of speed.
    pub(super) fn limits(&self, joints: &[JointLimits], feed: f64, bend: f64) -> PathLimits {
        let all = || self.greatest.iter().zip(joints);
        let mut v = feed;
        for ([d1, d2, d3], limits) in all() {
            v = v.min(SPEED_PART * limits.velocity / d1);
            v = v.min((bend * LIMIT_PART * limits.acceleration / d2).sqrt());
            v = v.min(libm::cbrt(bend * LIMIT_PART * limits.jerk / d3));
        }
        let (mut a, mut j) = (f64::INFINITY, f64::INFINITY);
        for ([d1, d2, d3], limits) in all() {
            a = a.min((LIMIT_PART * limits.acceleration - d2 * v * v) / d1);
            let left = LIMIT_PART * limits.jerk - d3 * v * v * v;
            a = a.min(COUPLED_PART * left / (3.0 * d2 * v));
        }
        for ([d1, d2, d3], limits) in all() {
            j = j.min((LIMIT_PART * limits.jerk - d3 * v * v * v - 3.0 * d2 * v * a) / d1);
        }
        PathLimits { v, a, j }
    }

    /// The same as if the path were straight.
    pub(super) fn straight(&self) -> Steady {
        let mut straight = Steady::default();
        for (straight, greatest) in straight.greatest.iter_mut().zip(self.greatest) {
            straight[0] = greatest[0];
        }
        straight
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canon::{AXES, Position};
    use crate::path::Circle;

    #[test]
    fn turn_after_turn_every_joint_is_seen_where_it_bends_most() {
        let limits = AxisLimits {
            velocity: 100.0,
            acceleration: 1000.0,
            jerk: 20_000.0,
            travel: [-1e3, 1e3],
        };
        let mut axes = [None; AXES];
        axes[..3].fill(Some(limits));
        let joints = Joints::new(&Settings::new(axes, 1e-3));
        // Sixteen steps of eight turns are half turns: there X bends most, and Y not at all.
        let helix = Piece::arc(&Circle {
            start: Position::xyz(5.0, 0.0, 0.0),
            end: Position::xyz(5.0, 0.0, -8.0),
            centre_mm: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: 8.0 * TAU,
        });
        let helix = helix.expect("a helix");
        let mut most = [0.0_f64; 3];
        joints.sample(&helix, [0.0, helix.length()], &mut Vec::new(), |jets| {
            for (most, jet) in most.iter_mut().zip(jets) {
                *most = most.max(jet.d2.abs());
            }
        });
        let [x, y, _] = most;
        assert!(x > 0.19 && y > 0.98 * x, "{x} {y}");
    }
}
