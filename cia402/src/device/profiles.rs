//! The profile modes: the drive makes its own way to a position (PP), a speed (PV, VL) or a torque (TQ).
//!
//! In:  the objects of the mode, the controlword, the motor's sensors. Out: the set-point generator one period on, and what
//!      the mode shows in the statusword.

use super::Device;
use super::homing::Sensors;
use super::motion::round;
use crate::profile::{controlword, mode, statusword};
use obd::{Dictionary, Key};

/// Set-points of PP: one under way, one that waits.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SetPoints {
    /// Motor counts; `None`: none has come yet.
    goal: Option<i64>,
    next: Option<i64>,
    /// Do not stop at the goal where another one waits (controlword bit 9).
    through: bool,
    /// Statusword bit 12.
    acknowledged: bool,
}

/// For how long actual values have been within their windows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Windows {
    /// The position is within 6067 of its demand.
    pub(super) position: Since,
    /// The velocity is within 606D of its target.
    velocity: Since,
    /// The motor is slower than 606F.
    standstill: Since,
}

/// For how long something has been so, ns.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Since(u64);

impl Since {
    /// Whether it has been so for `window_ms`, this period of `period_ns` included.
    pub(super) fn holds(&mut self, is_so: bool, period_ns: u32, window_ms: u16) -> bool {
        self.0 = if is_so {
            self.0.saturating_add(u64::from(period_ns))
        } else {
            0
        };
        is_so && self.0 > u64::from(window_ms) * 1_000_000
    }
}

impl Device {
    /// What a mode has of its own is forgotten when another one is chosen.
    pub(super) fn begin_mode(&mut self) {
        self.set_points = SetPoints::default();
        self.start_bit = false;
        self.reached = false;
    }

    /// Greatest speed of the profile modes, counts/s: 607F and 6080.
    fn speed_max<const E: usize, const B: usize>(&self, objects: &Dictionary<E, B>) -> f64 {
        let of_motor = f64::from(objects.get(self.keys.motor_speed_max)) * self.counts_per_rpm(objects);
        self.speed_of(objects, self.keys.profile_velocity_max).min(of_motor)
    }

    /// counts/s for one revolution of the motor a minute: 608F.
    pub(super) fn counts_per_rpm<const E: usize, const B: usize>(&self, objects: &Dictionary<E, B>) -> f64 {
        let increments = f64::from(objects.get(self.keys.encoder_increments));
        increments / f64::from(objects.get(self.keys.encoder_revolutions).max(1)) / 60.0
    }

    /// PP: from set-point to set-point by 6081, 6083 and 6084.
    pub(super) fn position_profile<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        word: u16,
    ) {
        let keys = self.keys;
        let has = |bit: u16| word & bit != 0;
        let edge = has(controlword::MODE_START) && !self.start_bit;
        let mut points = self.set_points;
        if edge && !points.acknowledged {
            let here = round(self.generator.position);
            let target = objects.get(keys.target);
            let at_once = has(controlword::MODE_5);
            let before = points.next.filter(|_| !at_once).or(points.goal).unwrap_or(here);
            let before = self.shown(before);
            let way = match has(controlword::MODE_6) {
                true => target,
                // The nearest one of those that look so in 32 bits.
                false => target.wrapping_sub(before as i32),
            };
            let target = self.within_limits(objects, before + i64::from(way));
            match points.goal {
                Some(_) if !at_once => points.next = Some(target),
                Some(_) | None => (points.goal, points.next) = (Some(target), None),
            }
            points.acknowledged = true;
        }
        points.through = has(controlword::MODE_9);
        let speed = self
            .speed_of(objects, keys.profile_velocity)
            .min(self.speed_max(objects));
        let acceleration = self.speed_of(objects, keys.acceleration);
        let deceleration = self.speed_of(objects, keys.deceleration);
        let period_s = self.period_s();
        let blocked = points
            .goal
            .is_some_and(|goal| sensors.blocked(goal as f64 - self.generator.position));
        self.limited = blocked;
        let arrived = match points.goal {
            Some(goal) if !blocked => {
                let onward = points.next.filter(|_| points.through).is_some_and(|next| {
                    let way = goal as f64 - self.generator.position;
                    (next - goal) as f64 * way > 0.0
                });
                let end = if onward { speed } else { 0.0 };
                self.generator
                    .go(goal as f64, [speed, end], [acceleration, deceleration], period_s)
            }
            Some(_) | None => {
                self.generator.approach(0.0, deceleration, period_s);
                points.goal.is_none()
            }
        };
        if arrived && points.next.is_some() {
            (points.goal, points.next) = (points.next.take(), None);
        }
        let rests = arrived && points.goal.is_none_or(|goal| goal as f64 == self.generator.position);
        // A goal that has been reached makes room for the next one.
        if rests && self.generator.at_rest() {
            points.goal = None;
        }
        if !has(controlword::MODE_START) && points.next.is_none() {
            points.acknowledged = false;
        }
        self.reached = points.goal.is_none();
        self.set_points = points;
    }

    /// Motor counts of a position of the network, as far as 607D allows it.
    fn within_limits<const E: usize, const B: usize>(&self, objects: &Dictionary<E, B>, shown: i64) -> i64 {
        let (low, high) = self.soft_limits(objects);
        let allowed = if low < high { shown.clamp(low, high) } else { shown };
        round(self.counts(allowed))
    }

    /// PV: to the speed of 60FF by 6083 and 6084.
    pub(super) fn velocity_profile<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
    ) {
        let keys = self.keys;
        let wanted = self.factors.speed(f64::from(objects.get(keys.target_velocity)));
        let ramps = [keys.acceleration, keys.deceleration].map(|ramp| self.speed_of(objects, ramp));
        self.reached = self.speed_up_to(objects, sensors, wanted, ramps);
    }

    /// VL: to the speed of 6042, in 1/min, between those of 6046 and by the ramps of 6048 and 6049.
    pub(super) fn speed<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        word: u16,
    ) {
        let keys = self.keys;
        let unit = self.counts_per_rpm(objects);
        let ramp = |delta: Key<u32>, time: Key<u16>| {
            let seconds = f64::from(objects.get(time).max(1));
            f64::from(objects.get(delta)) * unit / seconds
        };
        let ramps = [
            ramp(keys.vl_acceleration_speed, keys.vl_acceleration_time),
            ramp(keys.vl_deceleration_speed, keys.vl_deceleration_time),
        ];
        let [least, most] = [keys.vl_least, keys.vl_most].map(|limit| f64::from(objects.get(limit)));
        let target = f64::from(objects.get(keys.vl_target));
        // Standstill is standstill, whatever the least speed is.
        let size = if target == 0.0 {
            0.0
        } else {
            target.abs().max(least).min(most)
        };
        let wanted = if target < 0.0 { -size } else { size } * unit;
        let has = |bit: u16| word & bit != 0;
        let wanted = match (
            has(controlword::MODE_START),
            has(controlword::MODE_5),
            has(controlword::MODE_6),
        ) {
            // The ramp is off, or its input is.
            (false, _, _) | (true, true, false) => 0.0,
            // It is locked.
            (true, false, _) => self.generator.velocity,
            (true, true, true) => wanted,
        };
        self.reached = self.speed_up_to(objects, sensors, wanted, ramps);
    }

    /// One period towards a speed, counts/s; true when it is there.
    fn speed_up_to<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        wanted: f64,
        [acceleration, deceleration]: [f64; 2],
    ) -> bool {
        let most = self.speed_max(objects);
        let blocked = sensors.blocked(wanted);
        let velocity = if blocked { 0.0 } else { wanted.clamp(-most, most) };
        self.limited = velocity != wanted;
        let before = self.generator.velocity;
        let quicker = velocity * before >= 0.0 && velocity * velocity > before * before;
        let ramp = if quicker { acceleration } else { deceleration };
        self.generator.approach(velocity, ramp, self.period_s())
    }

    /// TQ: to the torque of 6071 by 6087, up to 6072.
    pub(super) fn torque_profile<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
    ) {
        let keys = self.keys;
        let most = f64::from(objects.get(keys.torque_max));
        let wanted = f64::from(objects.get(keys.target_torque));
        let allowed = if sensors.blocked(wanted) {
            0.0
        } else {
            wanted.clamp(-most, most)
        };
        self.limited = allowed != wanted;
        let step = f64::from(objects.get(keys.torque_slope)) * self.period_s();
        let before = self.generator.torque;
        let torque = allowed.clamp(before - step, before + step);
        self.reached = torque == wanted;
        self.generator.push(sensors.position, sensors.velocity, torque);
    }

    /// Bits 10, 12 and 13 of the profile modes.
    pub(super) fn profile_bits<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        follows_badly: bool,
    ) -> u16 {
        let keys = self.keys;
        let velocity = self.velocity_shown(sensors.velocity as f64);
        let speed = velocity.unsigned_abs();
        let period_ns = self.period_ns;
        let bit = |on: bool, bits: u16| if on { bits } else { 0 };
        match self.mode {
            mode::PROFILE_POSITION => {
                bit(self.reached && self.in_position, statusword::TARGET_REACHED)
                    | bit(self.set_points.acknowledged, statusword::MODE_ACK)
                    | bit(follows_badly, statusword::MODE_ERROR)
            }
            mode::PROFILE_VELOCITY => {
                let off = velocity.abs_diff(i64::from(objects.get(keys.target_velocity)));
                let near = off <= u64::from(objects.get(keys.velocity_window));
                let near = self
                    .windows
                    .velocity
                    .holds(near, period_ns, objects.get(keys.velocity_window_ms));
                let stands = speed <= u64::from(objects.get(keys.standstill));
                let stands = self
                    .windows
                    .standstill
                    .holds(stands, period_ns, objects.get(keys.standstill_ms));
                bit(near, statusword::TARGET_REACHED) | bit(stands, statusword::MODE_ACK)
            }
            mode::PROFILE_TORQUE => bit(self.reached, statusword::TARGET_REACHED),
            _ => 0,
        }
    }
}
