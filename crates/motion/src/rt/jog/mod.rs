//! Jogging: joints moved by hand, each for itself, several at once ([`Jog`]); or axes of a machine whose joints are not its
//! axes ([`WorldJog`]).
//!
//! In:  for each joint, at any cycle: run at a velocity, advance by an increment, release, or an emergency stop of all.
//! Out: one position per joint and cycle, within the limits of the joint.
//!
//! With soft limits a run is a way to the one it moves towards, which it reaches at rest; without them (a joint that is not
//! homed) it is a velocity. Increments add up: two orders of 0.1 mm in a row move 0.2 mm, however quickly they come.
//! What has to be true before anything may jog, and who may say so for how long, is the caller's business.
//!
//! RT: nothing allocates but [`Jog::new`].

mod world;

pub use world::{Obstacle, Obstruction, WorldJog};

use super::otg::{State, TrajectoryGenerator};
use super::scale::{MotionLimits, StopLimits};

/// What a joint keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JogLimits {
    /// In all but emergency stops.
    pub motion: MotionLimits,
    /// In emergency stops.
    pub stop: StopLimits,
    /// Soft limits: lowest and highest position, mm (degrees); infinite where there is none.
    pub range: [f64; 2],
}

/// What a joint was told last.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    Rest,
    Run { velocity: f64 },
    Increment,
}

#[derive(Debug)]
struct Joint {
    otg: TrajectoryGenerator,
    range: [f64; 2],
    order: Order,
}

/// Moves joints by hand.
#[derive(Debug)]
pub struct Jog {
    joints: Box<[Joint]>,
}

impl Jog {
    /// All joints at rest at zero; see [`Jog::rest_at`].
    pub fn new(joints: &[JogLimits], cycle_s: f64) -> Jog {
        let joint = |limits: &JogLimits| {
            let mut otg = TrajectoryGenerator::new(0.0, limits.motion, limits.stop, cycle_s);
            otg.set_range(limits.range);
            Joint {
                otg,
                range: limits.range,
                order: Order::Rest,
            }
        };
        Jog {
            joints: joints.iter().map(joint).collect(),
        }
    }

    /// Says where the joints stand: before jogging begins, and whenever something else has moved them. RT.
    pub fn rest_at(&mut self, positions: &[f64]) {
        for (joint, &position) in self.joints.iter_mut().zip(positions) {
            joint.otg.rest_at(position);
            joint.order = Order::Rest;
        }
    }

    /// Soft limits of a joint from now on, for what it is told next: infinite before it is homed. RT.
    pub fn set_range(&mut self, joint: usize, range: [f64; 2]) {
        if let Some(joint) = self.joints.get_mut(joint) {
            joint.range = range;
            joint.otg.set_range(range);
        }
    }

    /// Share of its acceleration that a joint uses from now on; see [`TrajectoryGenerator::set_acceleration_share`]. RT.
    pub fn set_acceleration_share(&mut self, joint: usize, share: f64) {
        if let Some(joint) = self.joints.get_mut(joint) {
            joint.otg.set_acceleration_share(share);
        }
    }

    /// Runs at a velocity until it is told something else or a soft limit is reached, where it comes to rest. Said again, it
    /// changes nothing. RT.
    pub fn run(&mut self, joint: usize, velocity: f64) {
        let Some(joint) = self.joints.get_mut(joint) else {
            return;
        };
        if joint.order == (Order::Run { velocity }) {
            return;
        }
        joint.order = Order::Run { velocity };
        let [low, high] = joint.range;
        let end = if velocity > 0.0 { high } else { low };
        if end.is_finite() {
            // A joint that cannot come to rest before the limit, or stands behind it, goes no farther; nor does it turn back.
            let room = (end - joint.otg.resting_place()) * velocity;
            if room > 0.0 {
                joint.otg.go_to(end, velocity);
            } else {
                joint.otg.run_at(0.0);
            }
        } else {
            joint.otg.run_at(velocity);
        }
    }

    /// Moves by `distance` from where the joint is or will be at rest after the increments before, at no more than
    /// `velocity`. Gives the distance that it will really be: less at a soft limit, 0 where it is not a number. RT.
    pub fn advance(&mut self, joint: usize, distance: f64, velocity: f64) -> f64 {
        let Some(joint) = self.joints.get_mut(joint) else {
            return 0.0;
        };
        let from = match joint.order {
            Order::Increment => joint.otg.destination(),
            Order::Rest | Order::Run { .. } => joint.otg.resting_place(),
        };
        let [low, high] = joint.range;
        // Behind a limit only the way back is open, and that as far as it was meant.
        let target = if distance >= 0.0 {
            (from + distance).min(high.max(from))
        } else {
            (from + distance).max(low.min(from))
        };
        if !(distance.is_finite() && target.is_finite() && target >= low && target <= high) || target == from {
            return 0.0;
        }
        joint.order = Order::Increment;
        joint.otg.go_to(target, velocity);
        target - from
    }

    /// Comes to rest, as a key does that is let go. RT.
    pub fn release(&mut self, joint: usize) {
        if let Some(joint) = self.joints.get_mut(joint) {
            joint.order = Order::Rest;
            joint.otg.run_at(0.0);
        }
    }

    /// All joints come to rest. RT.
    pub fn release_all(&mut self) {
        for joint in 0..self.joints.len() {
            self.set_acceleration_share(joint, 1.0);
            self.release(joint);
        }
    }

    /// All joints come to rest as quickly as their stop limits allow. RT.
    pub fn stop_all(&mut self) {
        for joint in &mut self.joints {
            joint.order = Order::Rest;
            joint.otg.stop();
        }
    }

    /// One cycle further: the position of each joint. RT.
    pub fn step(&mut self, positions: &mut [f64]) {
        for (joint, position) in self.joints.iter_mut().zip(positions) {
            *position = joint.otg.step().position;
        }
    }

    /// How far a joint still has to go for the increments that it was given. RT.
    pub fn arrears(&self, joint: usize) -> f64 {
        let joint = self.joints.get(joint).filter(|joint| joint.order == Order::Increment);
        joint.map_or(0.0, |joint| joint.otg.destination() - joint.otg.state().position)
    }

    /// Where a joint is and how it moves. RT.
    pub fn state(&self, joint: usize) -> Option<State> {
        self.joints.get(joint).map(|joint| joint.otg.state())
    }

    /// Whether no joint moves nor will without an order. RT.
    pub fn is_at_rest(&self) -> bool {
        self.joints.iter().all(|joint| joint.otg.is_at_rest())
    }

    /// Whether the last cycle was part of an emergency stop of some joint, for which the limits of stops count. RT.
    pub fn is_stopping(&self) -> bool {
        self.joints.iter().any(|joint| joint.otg.is_stopping())
    }
}

#[cfg(test)]
mod tests;
