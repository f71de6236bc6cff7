//! What the modes of operation do with an enabled motor.
//!
//! In:  the objects of the mode, the motor's sensors. Out: the set-point generator one period on.

use super::homing::{Homing, Method, Progress, Sensors};
use super::motion::round;
use super::{Device, HomingIndication};
use crate::profile::controlword;
use obd::{Dictionary, Key};

impl Device {
    /// CSP and IP.
    pub(super) fn follow<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        target: Key<i32>,
    ) {
        let target = objects.get(match self.quirks.target_in_demand {
            true => self.keys.position_demand,
            false => target,
        });
        let here = self.shown(round(self.generator.position));
        let target = here + i64::from(target.wrapping_sub(here as i32));
        let (low, high) = self.soft_limits(objects);
        let allowed = if low < high { target.clamp(low, high) } else { target };
        let blocked = sensors.blocked((allowed - here) as f64);
        self.limited = blocked || allowed != target;
        self.follows = !self.limited;
        let position = if blocked {
            self.generator.position
        } else {
            self.counts(allowed)
        };
        self.generator.follow(position, self.period_s());
        if self.follows {
            let velocity = f64::from(objects.get(self.keys.velocity_offset));
            self.generator.feed_forward = self.factors.speed(velocity);
            self.generator.torque = f64::from(objects.get(self.keys.torque_offset));
        }
    }

    /// 607D as far as it limits, positions of the network.
    pub(super) fn soft_limits<const E: usize, const B: usize>(&self, objects: &Dictionary<E, B>) -> (i64, i64) {
        let (low, high) = (objects.get(self.keys.limit_low), objects.get(self.keys.limit_high));
        // An end of the range stands for no limit, so that an axis without limits wraps.
        let low = if low == i32::MIN { i64::MIN } else { i64::from(low) };
        let high = if high == i32::MAX { i64::MAX } else { i64::from(high) };
        (low, high)
    }

    /// CSV: 60FF and 60B1, with 60B2 as torque beside the velocity loop. A limit switch lets the motor only back.
    pub(super) fn follow_velocity<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
    ) {
        let keys = self.keys;
        let wanted = f64::from(objects.get(keys.target_velocity)) + f64::from(objects.get(keys.velocity_offset));
        let wanted = self.factors.speed(wanted);
        self.limited = sensors.blocked(wanted);
        self.follows = !self.limited;
        let velocity = if self.limited { 0.0 } else { wanted };
        let torque = f64::from(objects.get(keys.torque_offset));
        self.generator.run(sensors.position, velocity, torque, self.period_s());
    }

    /// CST: 6071 and 60B2, up to 6072.
    pub(super) fn follow_torque<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
    ) {
        let keys = self.keys;
        let most = f64::from(objects.get(keys.torque_max));
        let wanted = f64::from(objects.get(keys.target_torque)) + f64::from(objects.get(keys.torque_offset));
        let torque = wanted.clamp(-most, most);
        let blocked = sensors.blocked(torque);
        self.limited = blocked || torque != wanted;
        self.follows = !blocked;
        let torque = if blocked { 0.0 } else { torque };
        self.generator.push(sensors.position, sensors.velocity, torque);
    }

    /// HM.
    pub(super) fn home<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        word: u16,
    ) {
        let keys = self.keys;
        let start = word & controlword::MODE_START != 0;
        if start && !self.start_bit {
            let number = objects.get(keys.homing_method);
            let has = u32::try_from(number).is_ok_and(|bit| bit < 64 && self.quirks.homing_methods >> bit & 1 == 1);
            self.homing = match Method::from_number(number).filter(|_| has) {
                Some(method) => HomingIndication::Running(Homing::new(method, sensors)),
                None => HomingIndication::Failed,
            };
        }
        let mut velocity = 0.0;
        if let HomingIndication::Running(mut homing) = self.homing {
            let search = self.speed_of(objects, keys.homing_search);
            let latch = self.speed_of(objects, keys.homing_latch);
            self.homing = match homing.step(sensors, search, latch, self.generator.at_rest()) {
                _ if !start => HomingIndication::Idle,
                Progress::Move(wanted) => {
                    velocity = wanted;
                    HomingIndication::Running(homing)
                }
                Progress::Home(position) => {
                    // By the profile zero = home + offset, so that the position at home is minus the offset.
                    let offset = i64::from(objects.get(keys.home_offset));
                    self.offset =
                        -self.factors.units(position) + if self.quirks.home_offset_adds { offset } else { -offset };
                    HomingIndication::Attained
                }
                Progress::Failed => HomingIndication::Failed,
            };
        }
        let acceleration = self.speed_of(objects, keys.homing_acceleration);
        self.generator.approach(velocity, acceleration, self.period_s());
    }
}
