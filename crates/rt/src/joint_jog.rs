//! Joints moved by hand: jog orders to positions, with a dead-man's switch.
//!
//! In:  orders for one joint each; a sign of life while the hand is on the key.
//! Out: commanded joint positions, mm.
//!
//! An order holds for [`HOLDS_S`]; whoever gave it renews it before that. A client that is lost, slow or killed is therefore
//! a key let go: the joint comes to rest within its limits. A renewal never begins a motion, so that what was held or stopped
//! stays at rest until it is ordered again.
//!
//! A joint that is not homed runs slowly, as far to either side as its travel is long: where it may end nobody knows.
//!
//! The joints of an axis move together: the first one leads, the others keep their distance from it.
//!
//! RT: nothing allocates but [`JointJog::new`].

use crate::axis_jog::AxisJog;
use config::{Config, JOINTS_MAX};
use motion::canon::Axis;
use motion::rt::jog::{Jog, JogLimits, Obstruction};
use motion::rt::{MotionLimits, StopLimits};

/// How long an order holds without a renewal, s.
pub const HOLDS_S: f64 = 0.2;

/// What a joint shall do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JogMotion {
    /// Run at this velocity, mm/s, as far as the soft limit.
    Run {
        /// Velocity; its sign is the direction.
        velocity_mm_s: f64,
    },
    /// Move by a distance; distances add up.
    Advance {
        /// Distance; its sign is the direction.
        distance_mm: f64,
        velocity_mm_s: f64,
    },
    /// Go on with what was ordered: the hand is still on the key.
    Keep,
    /// Come to rest.
    Release,
}

/// An order for joints and those that move with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JogOrder {
    /// Which joints (bit n: joint n).
    pub joints: u64,
    /// An axis, where joints are not axes; then `joints` are those that it may move: all.
    pub axis: Option<Axis>,
    /// What each of them shall do.
    pub motion: JogMotion,
    /// Share of the acceleration with which it sets out from rest, above 0; anything else than a share: all of it.
    pub acceleration_share: f64,
    /// Joints that are not homed may be moved, too: it is for joints, not for an axis.
    pub unhomed: bool,
}

#[derive(Clone, Copy, Debug)]
struct Joint {
    /// The joint that it keeps its distance from; itself if it leads.
    leader: usize,
    travel_mm: [f64; 2],
    /// Where it stood when jogging began.
    start_mm: f64,
    /// Cycles for which the last order still holds.
    holds: u64,
    fastest_mm_s: f64,
    /// The same of what moves with it, before all of that is homed.
    unhomed_mm_s: f64,
    /// All that moves with it is.
    homed: bool,
}

/// The operator's hand on the joints.
#[derive(Debug)]
pub struct JointJog {
    jog: Jog,
    joints: Box<[Joint]>,
    holds: u64,
    active: bool,
    /// `None`: joints are axes.
    world: Option<AxisJog>,
    /// Axes are jogged, not joints.
    in_world: bool,
}

impl JointJog {
    /// Off all joints.
    pub fn new(config: &Config) -> JointJog {
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        let leader = |joint| {
            let map = config.axes.iter().find(|map| map.joints.contains(&joint));
            map.and_then(|map| map.joints.first().copied()).unwrap_or(joint)
        };
        let limits: Box<[JogLimits]> = (0..config.joints.len()).map(|joint| limits(config, joint)).collect();
        let joints = config.joints.iter().enumerate().map(|(number, joint)| Joint {
            leader: leader(number),
            travel_mm: joint.travel_mm,
            start_mm: 0.0,
            holds: 0,
            fastest_mm_s: limits[number].motion.velocity,
            unhomed_mm_s: joint.unhomed_jog_mm_s,
            homed: true,
        });
        let holds = (HOLDS_S / cycle_s).round() as u64;
        JointJog {
            jog: Jog::new(&limits, cycle_s),
            joints: joints.collect(),
            holds,
            active: false,
            world: AxisJog::new(config, &limits, holds),
            in_world: false,
        }
    }

    /// Begins with all joints at rest at `positions_mm`, to carry out `order`; joints of `homed` know where they are (bit n: joint n).
    pub fn begin(&mut self, positions_mm: &[f64], homed: u64, order: &JogOrder) {
        self.active = true;
        self.in_world = order.axis.is_some();
        if let Some(world) = &mut self.world {
            // Joints that are nowhere in the world rest where they are.
            self.in_world &= world.begin(positions_mm);
        }
        self.jog.rest_at(positions_mm);
        for (joint, &position_mm) in self.joints.iter_mut().zip(positions_mm) {
            joint.start_mm = position_mm;
            joint.holds = 0;
        }
        for number in 0..self.joints.len() {
            if self.joints[number].leader == number {
                self.joints[number].homed = self.together(number) & !homed == 0;
                self.jog.set_range(number, self.range_mm(number));
            }
        }
    }

    /// Where a leading joint may go so that those that follow keep their soft limits, too.
    fn range_mm(&self, leader: usize) -> [f64; 2] {
        let mut range_mm = [f64::NEG_INFINITY, f64::INFINITY];
        let Joint { start_mm, homed, .. } = self.joints[leader];
        for joint in self.joints.iter().filter(|joint| joint.leader == leader) {
            if !homed {
                let length_mm = joint.travel_mm[1] - joint.travel_mm[0];
                range_mm[0] = range_mm[0].max(start_mm - length_mm);
                range_mm[1] = range_mm[1].min(start_mm + length_mm);
                continue;
            }
            let ahead_mm = joint.start_mm - start_mm;
            range_mm[0] = range_mm[0].max(joint.travel_mm[0] - ahead_mm);
            range_mm[1] = range_mm[1].min(joint.travel_mm[1] - ahead_mm);
        }
        range_mm
    }

    /// Carries out an order; one for an axis while joints move, or the other way round, is of no effect.
    pub fn obey(&mut self, order: &JogOrder) {
        if let Some(world) = self.world.as_mut().filter(|_| self.in_world) {
            let of_all = matches!(order.motion, JogMotion::Keep | JogMotion::Release) && order.joints == u64::MAX;
            if order.axis.is_some() || of_all {
                world.obey(order.axis, order.motion, order.acceleration_share);
            }
            return;
        }
        if order.axis.is_some() {
            return;
        }
        for leader in 0..self.joints.len() {
            if self.joints[leader].leader == leader && self.together(leader) & order.joints != 0 {
                self.lead(leader, order);
            }
        }
    }

    fn lead(&mut self, leader: usize, order: &JogOrder) {
        if order.motion != JogMotion::Keep {
            self.jog.set_acceleration_share(leader, order.acceleration_share);
        }
        let most_mm_s = self.fastest(leader);
        match order.motion {
            JogMotion::Run { velocity_mm_s } => {
                self.jog.run(leader, velocity_mm_s.clamp(-most_mm_s, most_mm_s));
                self.joints[leader].holds = self.holds;
            }
            JogMotion::Advance {
                distance_mm,
                velocity_mm_s,
            } => {
                self.jog
                    .advance(leader, distance_mm, velocity_mm_s.abs().min(most_mm_s));
                self.joints[leader].holds = self.holds;
            }
            JogMotion::Keep if self.joints[leader].holds > 0 => self.joints[leader].holds = self.holds,
            JogMotion::Keep => {}
            JogMotion::Release => self.release(leader),
        }
    }

    /// These joints and all that move with them (bit n: joint n).
    pub fn moved_with(&self, joints: u64) -> u64 {
        let named = self
            .joints
            .iter()
            .enumerate()
            .filter(|(number, _)| joints >> number & 1 == 1);
        named.fold(0, |mask, (_, joint)| mask | self.together(joint.leader))
    }

    /// A leading joint and those that follow it (bit n: joint n).
    fn together(&self, leader: usize) -> u64 {
        let joints = self.joints.iter().enumerate();
        joints.fold(0, |mask, (number, joint)| {
            mask | u64::from(joint.leader == leader) << number
        })
    }

    fn release(&mut self, leader: usize) {
        self.joints[leader].holds = 0;
        self.jog.release(leader);
    }

    /// Lets all joints come to rest.
    pub fn release_all(&mut self) {
        if let Some(world) = self.world.as_mut().filter(|_| self.in_world) {
            world.release_all();
        }
        for joint in &mut self.joints {
            joint.holds = 0;
        }
        self.jog.release_all();
    }

    /// Brings all joints to rest as quickly as their stop limits allow.
    pub fn stop(&mut self) {
        if let Some(world) = self.world.as_mut().filter(|_| self.in_world) {
            world.stop();
        }
        for joint in &mut self.joints {
            joint.holds = 0;
        }
        self.jog.stop_all();
    }

    /// Begins with all joints at rest at `positions_mm`, to be sent to places by [`JointJog::go_by`]: of axes, where joints are not
    /// axes.
    pub fn begin_to_go(&mut self, positions_mm: &[f64]) {
        // Who sends them has a program, and that only homed joints can have.
        let nothing = JogOrder {
            acceleration_share: 1.0,
            unhomed: false,
            joints: 0,
            axis: self.world.as_ref().map(|_| Axis::Z),
            motion: JogMotion::Keep,
        };
        self.begin(positions_mm, u64::MAX, &nothing);
    }

    /// Whether axes are moved, not joints.
    pub fn is_in_world(&self) -> bool {
        self.world().is_some()
    }

    /// Where an axis or a joint that leads is; `None`: there is no such one.
    pub fn place(&self, number: usize) -> Option<f64> {
        if let Some(world) = self.world() {
            return world.place(number);
        }
        let leads = self.joints.get(number).is_some_and(|joint| joint.leader == number);
        self.jog.state(number).filter(|_| leads).map(|state| state.position)
    }

    /// Its greatest speed by hand, mm/s.
    pub fn fastest(&self, number: usize) -> f64 {
        match self.world() {
            Some(world) => world.fastest(number),
            None => match self.joints.get(number) {
                Some(joint) if joint.homed => joint.fastest_mm_s,
                Some(_) => self.fastest_lost(number),
                None => 0.0,
            },
        }
    }

    /// Greatest speed of a joint that is not homed, mm/s: of the slowest of those that move together.
    fn fastest_lost(&self, number: usize) -> f64 {
        let Some(leader) = self.joints.get(number) else {
            return 0.0;
        };
        let joints = self.joints.iter().filter(|joint| joint.leader == leader.leader);
        joints.fold(leader.fastest_mm_s, |least, joint| least.min(joint.unhomed_mm_s))
    }

    /// Greatest speed by hand of a joint, of those that are `homed` (bit n: joint n), before the hand has begun, mm/s.
    pub fn fastest_of_joint(&self, number: usize, homed: u64) -> f64 {
        match self.joints.get(number) {
            Some(joint) if self.together(joint.leader) & !homed == 0 => joint.fastest_mm_s,
            _ => self.fastest_lost(number),
        }
    }

    /// Moves it by a distance, from rest; no hand has to stay on a key for it.
    pub fn go_by(&mut self, number: usize, distance: f64, velocity: f64) {
        if let Some(world) = self.world.as_mut().filter(|_| self.in_world) {
            world.go_by(number, distance, velocity);
        } else {
            self.jog.advance(number, distance, velocity);
        }
    }

    /// How far an axis or a joint that leads still has to go for the increments that it was given, mm; 0 once the hand is off.
    pub fn arrears(&self, number: usize) -> f64 {
        match self.world() {
            _ if !self.active => 0.0,
            Some(world) => world.arrears(number),
            None => self.jog.arrears(number),
        }
    }

    /// Whether an order still holds for it: nothing else has ended its motion.
    pub fn is_held(&self, number: usize) -> bool {
        let held = match self.world() {
            Some(world) => world.is_held(number),
            None => self.joints.get(number).is_some_and(|joint| joint.holds > 0),
        };
        self.active && held
    }

    /// Whether all joints are at these positions, but for a slack, mm.
    pub fn is_at(&self, positions_mm: &[f64], slack_mm: f64) -> bool {
        let mut joints = self.joints.iter().zip(positions_mm).enumerate();
        joints.all(|(number, (joint, wanted_mm))| {
            let ahead_mm = joint.start_mm - self.joints[joint.leader].start_mm;
            let at_mm = match self.world() {
                Some(world) => world.joint(number),
                None => self
                    .jog
                    .state(joint.leader)
                    .map_or(f64::NAN, |state| state.position + ahead_mm),
            };
            (at_mm - wanted_mm).abs() <= slack_mm
        })
    }

    /// Takes the hand off.
    pub fn end(&mut self) {
        self.active = false;
    }

    /// One cycle further: positions of all joints, mm.
    pub fn step(&mut self, command_mm: &mut [f64]) {
        if let Some(world) = self.world.as_mut().filter(|_| self.in_world) {
            world.step(command_mm);
            return;
        }
        for number in 0..self.joints.len() {
            match self.joints[number].holds {
                0 => {}
                1 => {
                    self.jog.set_acceleration_share(number, 1.0);
                    self.release(number);
                }
                holds => self.joints[number].holds = holds - 1,
            }
        }
        let mut positions_mm = [0.0; JOINTS_MAX];
        self.jog.step(&mut positions_mm);
        for (joint, command_mm) in self.joints.iter().zip(command_mm) {
            // The distance first, so that a leader has none and ends exactly where it is told to.
            let ahead_mm = joint.start_mm - self.joints[joint.leader].start_mm;
            *command_mm = positions_mm[joint.leader] + ahead_mm;
        }
    }

    /// Whether the hand is on some joint.
    pub fn is_active(&self) -> bool {
        self.active
    }

    /// Whether all joints rest and no order holds any more.
    pub fn is_over(&self) -> bool {
        if let Some(world) = self.world() {
            return world.is_over();
        }
        self.jog.is_at_rest() && self.joints.iter().all(|joint| joint.holds == 0)
    }

    /// Whether all joints rest.
    pub fn is_at_rest(&self) -> bool {
        self.world().map_or(self.jog.is_at_rest(), AxisJog::is_at_rest)
    }

    /// Whether the last cycle was part of a stop, for which the limits of stops count.
    pub fn is_stopping(&self) -> bool {
        // Between the places that it looks at, a jog of axes may pass the jerk of a joint by a little: it may use that of stops.
        self.world().is_some() || self.jog.is_stopping()
    }

    /// What was in the way of an axis, told once.
    pub fn take_obstruction(&mut self) -> Option<Obstruction> {
        self.world.as_mut()?.take_obstruction()
    }

    /// The hand on the axes, if that is where it is.
    fn world(&self) -> Option<&AxisJog> {
        self.world.as_ref().filter(|_| self.in_world)
    }

    /// Greatest speed of all joints, mm/s.
    pub fn speed_mm_s(&self) -> f64 {
        if let Some(world) = self.world() {
            return world.speed_mm_s();
        }
        let speeds = (0..self.joints.len()).filter_map(|joint| self.jog.state(joint));
        speeds.fold(0.0, |most, state| most.max(state.velocity.abs()))
    }
}

/// What the joints of an axis can do together; soft limits are set when jogging begins.
pub(super) fn limits(config: &Config, joint: usize) -> JogLimits {
    let map = config.axes.iter().find(|map| map.joints.contains(&joint));
    let together = map.map_or(std::slice::from_ref(&joint), |map| &map.joints);
    let least = |value: fn(&config::Joint) -> f64| {
        let values = together.iter().map(|&joint| value(&config.joints[joint]));
        values.fold(f64::INFINITY, f64::min)
    };
    JogLimits {
        motion: MotionLimits {
            velocity: least(|joint| joint.limits.velocity_mm_s),
            acceleration: least(|joint| joint.limits.acceleration_mm_s2),
            jerk: least(|joint| joint.limits.jerk_mm_s3),
        },
        stop: StopLimits {
            acceleration: least(|joint| joint.stop.acceleration_mm_s2),
            jerk: least(|joint| joint.stop.jerk_mm_s3),
        },
        range: config.joints[joint].travel_mm,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// The demo mill with X and Y as the two sides of a gantry.
    fn gantry() -> Config {
        let machine = include_str!("../../../configs/mill3-demo.toml");
        let mut config = config::parse(machine, Path::new("demo.toml")).unwrap();
        config.axes.remove(1);
        config.axes[0].joints = vec![0, 1];
        config.joints[0].travel_mm = [-5.0, 305.0];
        config.joints[1].travel_mm = [-5.0, 205.0];
        config.joints[1].limits.velocity_mm_s = 60.0;
        config
    }

    #[test]
    fn a_joint_that_is_not_homed_goes_as_far_as_its_travel_is_long_and_no_faster_than_it_may() {
        let mut config = gantry();
        config.joints[0].unhomed_jog_mm_s = 50.0;
        config.joints[1].unhomed_jog_mm_s = 40.0;
        for (velocity_mm_s, end_mm) in [(150.0, 10_210.0), (-150.0, 9_790.0)] {
            let mut hand = JointJog::new(&config);
            let mut command_mm = [10_000.0, 10_000.3, -7.0];
            let order = |motion| JogOrder {
                acceleration_share: 1.0,
                unhomed: true,
                joints: 1,
                axis: None,
                motion,
            };
            // One side that is homed is not enough.
            hand.begin(&command_mm, 0b101, &order(JogMotion::Run { velocity_mm_s }));
            hand.obey(&order(JogMotion::Run { velocity_mm_s }));
            let mut fastest_mm_s = 0.0_f64;
            for _ in 0..8000 {
                hand.obey(&order(JogMotion::Keep));
                hand.step(&mut command_mm);
                fastest_mm_s = fastest_mm_s.max(hand.speed_mm_s());
            }
            assert!(
                (fastest_mm_s - 40.0).abs() < 1e-6,
                "the slower side counts: {fastest_mm_s}"
            );
            assert!(
                (command_mm[0] - end_mm).abs() < 1e-9,
                "the shorter travel counts: {command_mm:?}"
            );
            assert!((command_mm[1] - command_mm[0] - 0.3).abs() < 1e-9, "{command_mm:?}");
            hand.obey(&order(JogMotion::Release));
            hand.begin(&command_mm, 0b111, &order(JogMotion::Release));
            assert_eq!(hand.fastest(0), 60.0);
        }
    }

    #[test]
    fn the_sides_of_a_gantry_move_together_and_the_first_end_of_travel_ends_both() {
        let mut hand = JointJog::new(&gantry());
        assert_eq!((hand.moved_with(0b010), hand.moved_with(0b100)), (0b011, 0b100));
        let mut command_mm = [10.0, 10.3, -7.0];
        let run = |joints| JogOrder {
            acceleration_share: 1.0,
            unhomed: false,
            joints,
            axis: None,
            motion: JogMotion::Run { velocity_mm_s: 150.0 },
        };
        hand.begin(&command_mm, u64::MAX, &run(0b010));
        // By either of its joints.
        hand.obey(&run(0b010));
        let keep = JogOrder {
            acceleration_share: 1.0,
            unhomed: false,
            joints: u64::MAX,
            axis: None,
            motion: JogMotion::Keep,
        };
        let mut fastest_mm_s = 0.0_f64;
        for _ in 0..8000 {
            hand.obey(&keep);
            hand.step(&mut command_mm);
            fastest_mm_s = fastest_mm_s.max(hand.speed_mm_s());
            assert!((command_mm[1] - command_mm[0] - 0.3).abs() < 1e-9, "{command_mm:?}");
        }
        assert_eq!(command_mm[2], -7.0);
        assert!((command_mm[1] - 205.0).abs() < 1e-9, "{command_mm:?}");
        assert!(
            (fastest_mm_s - 60.0).abs() < 1e-6,
            "the slower side counts: {fastest_mm_s}"
        );
        assert!(hand.is_at_rest() && !hand.is_over(), "the hand is still on the key");
        for _ in 0..200 {
            hand.step(&mut command_mm);
        }
        assert!(hand.is_over());
    }
}
