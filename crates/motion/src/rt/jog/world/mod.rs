//! Jogging in the world: axes of any machine moved by hand, joints follow by its kinematics.
//!
//! In:  for each axis, at any cycle: run at a velocity, advance by an increment, release; how the tool is held.
//! Out: one position per joint and cycle; what is in the way, if something is.
//!
//! The axes are generated each for itself, then turned into joints. Joints have limits of their own, which no limit of an
//! axis can stand for near a singularity. So no cycle is taken before it is known to be good: its joints, and those of the
//! shortest way to rest behind it, are computed with their exact derivatives by time at [`SAMPLES`] places and must keep the
//! travel, velocity, acceleration and jerk of every joint. If they do not, the axes take the way to rest of the cycle before,
//! which has been found good. All axes together are slowed down in advance where joints become fast; a way that is still not
//! good at a small share of the wanted speed ends in rest, with the joint and the reason named.
//!
//! RT: nothing allocates but [`WorldJog::new`]; bounded by axes, joints and [`SAMPLES`].

use super::JogLimits;
use crate::canon::{AXES, Axis, Position};
use crate::kinematics::{JOINTS, Jet3, Kinematics, ToolFrame};
use crate::rt::TrajectoryGenerator;
use crate::rt::otg::{Moving, RestWay};

/// Places on a way to rest that are looked at.
const SAMPLES: u8 = 16;
/// How far beside a jump of jerk is looked, s.
const BESIDE_S: f64 = 1e-7;
/// Share of the limits of joints that may be used: for what lies between two places.
const MARGIN: f64 = 0.85;
/// Shares of velocity, acceleration and jerk limits that the wanted motion itself may use; the rest is for changes of it.
const STEADY: [f64; 3] = [0.85, 0.5, 0.3];
/// The axes are not slowed down to less than this share of what is wanted; they rest instead.
const SHARE_MIN: f64 = 1.0 / 256.0;
/// Cycles that go well before a share that had to be halved is doubled again.
const RECOVERY_CYCLES: u32 = 50;
/// A change of the share by less than this one is left out.
const SHARE_STEP: f64 = 0.01;

/// Why a joint cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// Its travel ends.
    Travel,
    /// Near a singularity it would have to be too fast.
    Speed,
    /// The machine cannot take a position further on.
    Reach(&'static str),
}

/// What is in the way of a jog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Obstruction {
    /// The joint that cannot go on.
    pub joint: usize,
    /// What stops it.
    pub why: Obstacle,
}

/// What an axis was told last.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wanted {
    Rest,
    /// To the end of its travel, if it has one.
    Run {
        velocity: f64,
        end: Option<f64>,
    },
    /// To a place; `velocity` above 0.
    Advance {
        target: f64,
        velocity: f64,
    },
}

/// Moves the axes of a machine by hand.
#[derive(Debug)]
pub struct WorldJog {
    kinematics: Kinematics,
    frame: ToolFrame,
    axes: Box<[TrajectoryGenerator]>,
    limits: Box<[JogLimits]>,
    joints: [f64; JOINTS],
    /// Where each axis may go by limits of its own.
    ranges: [[f64; 2]; AXES],
    wanted: [Wanted; AXES],
    /// Share of the wanted velocities that was ordered last; what it is held to after a way that was not good.
    share: f64,
    share_max: f64,
    /// Cycles since the last way that was not good.
    good_cycles: u32,
    obstruction: Option<Obstruction>,
    stopping: bool,
}

impl WorldJog {
    /// All axes at rest at zero, which need not be a place of the machine; see [`WorldJog::rest_at`]. `axes`: in the order of
    /// [`Axis::ALL`], their limits in the world, infinite where it has none of its own; `joints`: the limits of the joints.
    pub fn new(kinematics: Kinematics, axes: &[JogLimits; AXES], joints: &[JogLimits], cycle_s: f64) -> WorldJog {
        let axis = |limits: &JogLimits| TrajectoryGenerator::new(0.0, limits.motion, limits.stop, cycle_s);
        WorldJog {
            kinematics,
            frame: ToolFrame::OFF,
            axes: axes.iter().map(axis).collect(),
            limits: joints.into(),
            joints: [0.0; JOINTS],
            ranges: axes.map(|limits| limits.range),
            wanted: [Wanted::Rest; AXES],
            share: 0.0,
            share_max: 1.0,
            good_cycles: 0,
            obstruction: None,
            stopping: false,
        }
    }

    /// Says where the axes stand and how the tool is held: before jogging begins. False: the machine cannot be there. RT.
    pub fn rest_at(&mut self, position: &Position, frame: ToolFrame) -> bool {
        self.frame = frame;
        for (axis, &position) in self.axes.iter_mut().zip(&position.0) {
            axis.rest_at(position);
        }
        self.forget();
        let joints = &mut self.joints[..self.limits.len()];
        self.kinematics.inverse(&frame, &position.0, joints).is_ok()
    }

    /// Share of its acceleration that an axis uses from now on; see [`TrajectoryGenerator::set_acceleration_share`]. RT.
    pub fn set_acceleration_share(&mut self, axis: Axis, share: f64) {
        self.axes[axis as usize].set_acceleration_share(share);
    }

    /// Runs along an axis at a velocity, to the end of its travel if it has one of its own; other axes go on as they do. Said
    /// again while it runs, it changes nothing. RT.
    pub fn run(&mut self, axis: Axis, velocity: f64) {
        let number = axis as usize;
        if !velocity.is_finite() || velocity == 0.0 {
            return self.want(axis, Wanted::Rest);
        }
        if let Wanted::Run { velocity: before, .. } = self.wanted[number]
            && before == velocity
        {
            return;
        }
        let [low, high] = self.ranges[number];
        let end = if velocity > 0.0 { high } else { low };
        let end = end.is_finite().then_some(end);
        // An axis that cannot come to rest before the end, or stands behind it, goes no farther; nor does it turn back.
        let room = end.map_or(f64::INFINITY, |end| {
            (end - self.axes[number].resting_place()) * velocity.signum()
        });
        self.want(
            axis,
            if room > 0.0 {
                Wanted::Run { velocity, end }
            } else {
                Wanted::Rest
            },
        );
    }

    /// Moves along an axis by `distance` from where it is or will be at rest after the increments before, at no more than
    /// `velocity`. Gives the distance that it will be if no joint is in the way: less at the end of its own travel, 0 where it
    /// is not a number. RT.
    pub fn advance(&mut self, axis: Axis, distance: f64, velocity: f64) -> f64 {
        let number = axis as usize;
        let from = match self.wanted[number] {
            Wanted::Advance { target, .. } => target,
            Wanted::Rest | Wanted::Run { .. } => self.axes[number].resting_place(),
        };
        let [low, high] = self.ranges[number];
        // Behind an end only the way back is open, and that as far as it was meant.
        let target = if distance >= 0.0 {
            (from + distance).min(high.max(from))
        } else {
            (from + distance).max(low.min(from))
        };
        let velocity = velocity.abs();
        let possible = distance.is_finite() && target.is_finite() && target >= low && target <= high;
        if !possible || target == from || velocity.is_nan() || velocity == 0.0 {
            return 0.0;
        }
        self.want(axis, Wanted::Advance { target, velocity });
        target - from
    }

    fn want(&mut self, axis: Axis, wanted: Wanted) {
        if self.wanted[axis as usize] != wanted {
            self.wanted[axis as usize] = wanted;
            // No share at all, so that whatever comes next is ordered.
            self.share = f64::NAN;
            self.share_max = 1.0;
            self.obstruction = None;
        }
    }

    /// All axes come to rest. RT.
    pub fn release_all(&mut self) {
        self.forget();
        for axis in &mut self.axes {
            axis.set_acceleration_share(1.0);
            axis.run_at(0.0);
        }
    }

    /// All axes come to rest as quickly as their stop limits allow. RT.
    pub fn stop_all(&mut self) {
        self.forget();
        for axis in &mut self.axes {
            axis.stop();
        }
    }

    /// One cycle further: the positions of the joints; gives that of the axes. RT.
    pub fn step(&mut self, joints: &mut [f64]) -> Position {
        // An emergency stop leaves no choice of ways.
        let stops = self.axes.iter().any(TrajectoryGenerator::is_in_a_stop);
        if !stops {
            self.steer();
            if let Err(obstruction) = self.look_ahead() {
                for axis in &mut self.axes {
                    axis.run_at(0.0);
                }
                self.share = f64::NAN;
                self.good_cycles = 0;
                self.share_max = match obstruction.why {
                    Obstacle::Speed if self.share_max > SHARE_MIN => self.share_max / 2.0,
                    Obstacle::Speed | Obstacle::Travel | Obstacle::Reach(_) => {
                        self.obstruction = Some(obstruction);
                        self.wanted = [Wanted::Rest; AXES];
                        1.0
                    }
                };
            } else {
                self.recover();
            }
        }
        self.stopping = stops;
        let mut position = [0.0; AXES];
        for ((axis, wanted), position) in self.axes.iter_mut().zip(&mut self.wanted).zip(&mut position) {
            *position = axis.step().position;
            if let Wanted::Advance { target, .. } = *wanted
                && *position == target
                && axis.is_at_rest()
            {
                *wanted = Wanted::Rest;
            }
        }
        // A place that cannot be taken leaves the joints where they are.
        let count = self.limits.len();
        let _ = self
            .kinematics
            .inverse(&self.frame, &position, &mut self.joints[..count]);
        for (to, from) in joints.iter_mut().zip(&self.joints[..count]) {
            *to = *from;
        }
        Position(position)
    }

    /// How far an axis still has to go for the increments that it was given. RT.
    pub fn arrears(&self, axis: Axis) -> f64 {
        match self.wanted[axis as usize] {
            Wanted::Advance { target, .. } => target - self.axes[axis as usize].state().position,
            Wanted::Rest | Wanted::Run { .. } => 0.0,
        }
    }

    /// Where a joint is; NaN: there is no such one. RT.
    pub fn joint(&self, joint: usize) -> f64 {
        self.joints[..self.limits.len()].get(joint).copied().unwrap_or(f64::NAN)
    }

    /// Why the axes rest although they were told to run. RT.
    pub fn obstruction(&self) -> Option<Obstruction> {
        self.obstruction
    }

    /// Whether nothing moves nor will without an order. RT.
    pub fn is_at_rest(&self) -> bool {
        self.wanted == [Wanted::Rest; AXES] && self.axes.iter().all(TrajectoryGenerator::is_at_rest)
    }

    /// Whether the last cycle was part of an emergency stop. RT.
    pub fn is_stopping(&self) -> bool {
        self.stopping
    }

    /// What was in the way of a fast jog may lie behind.
    fn recover(&mut self) {
        self.good_cycles += 1;
        if self.good_cycles >= RECOVERY_CYCLES {
            self.good_cycles = 0;
            self.share_max = (2.0 * self.share_max).min(1.0);
        }
    }

    fn forget(&mut self) {
        self.wanted = [Wanted::Rest; AXES];
        self.share = 0.0;
        self.share_max = 1.0;
        self.obstruction = None;
    }

    /// Orders as much of the wanted velocities as the joints can do here and on the way to rest.
    fn steer(&mut self) {
        if self.wanted == [Wanted::Rest; AXES] {
            if self.share != 0.0 {
                self.share = 0.0;
                self.axes.iter_mut().for_each(|axis| axis.run_at(0.0));
            }
            return;
        }
        // With the least share it is the look ahead that finds out what is in the way.
        let share = self.steady_share().min(self.share_max).max(SHARE_MIN);
        if self.share.is_nan() || (share - self.share).abs() > SHARE_STEP * self.share {
            self.share = share;
            for (axis, wanted) in self.axes.iter_mut().zip(&self.wanted) {
                match *wanted {
                    Wanted::Rest => axis.run_at(0.0),
                    Wanted::Run { velocity, end: None } => axis.run_at(velocity * share),
                    Wanted::Run {
                        velocity,
                        end: Some(end),
                    } => axis.go_to(end, velocity * share),
                    Wanted::Advance { target, velocity } => axis.go_to(target, velocity * share),
                }
            }
        }
    }

    /// Velocity at which an axis goes on if nothing slows it down.
    fn wanted_velocity(&self, axis: usize) -> f64 {
        match self.wanted[axis] {
            Wanted::Rest => 0.0,
            Wanted::Run { velocity, .. } => velocity,
            Wanted::Advance { target, velocity } => velocity.copysign(target - self.axes[axis].state().position),
        }
    }

    /// Share of the wanted velocities with which the joints keep their limits while nothing changes.
    fn steady_share(&self) -> f64 {
        let ways: [RestWay; AXES] = std::array::from_fn(|axis| self.axes[axis].rest_from(self.axes[axis].state()));
        let duration_s = longest(&ways);
        let mut share = 1.0_f64;
        for sample in [0.0, 0.5, 1.0] {
            let axes: [Jet3; AXES] = std::array::from_fn(|axis| {
                let place = ways[axis].at(duration_s * sample).state.position;
                Jet3::new(place, self.wanted_velocity(axis), 0.0, 0.0)
            });
            let mut joints = [Jet3::ZERO; JOINTS];
            let joints = &mut joints[..self.limits.len()];
            if self.kinematics.inverse(&self.frame, &axes, joints).is_err() {
                continue;
            }
            for (joint, limits) in joints.iter().zip(&self.limits) {
                // The k-th derivative grows with the k-th power of the share.
                let motion = &limits.motion;
                share = share.min(STEADY[0] * motion.velocity / joint.d1.abs());
                share = share.min((STEADY[1] * motion.acceleration / joint.d2.abs()).sqrt());
                share = share.min(libm::cbrt(STEADY[2] * motion.jerk / joint.d3.abs()));
            }
        }
        share
    }

    /// Whether the next cycle, and the way to rest behind it, are good for every joint.
    fn look_ahead(&self) -> Result<(), Obstruction> {
        let next: [Moving; AXES] = std::array::from_fn(|axis| self.axes[axis].next());
        self.judge(&next)?;
        let ways: [RestWay; AXES] = std::array::from_fn(|axis| self.axes[axis].rest_from(next[axis].state));
        let duration_s = longest(&ways);
        if duration_s == 0.0 {
            return Ok(());
        }
        let step_s = duration_s / f64::from(SAMPLES);
        let mut before: Option<[Jet3; JOINTS]> = None;
        for sample in 0..=SAMPLES {
            let time_s = step_s * f64::from(sample);
            let joints = self.judge(&std::array::from_fn(|axis| ways[axis].at(time_s)))?;
            if let Some(before) = before {
                self.judge_turns(&before, &joints, step_s)?;
            }
            before = Some(joints);
        }
        // Where the jerk of an axis jumps, so does that of joints: both sides count.
        for border_s in ways.iter().flat_map(RestWay::borders) {
            for time_s in [border_s - BESIDE_S, border_s + BESIDE_S] {
                let time_s = time_s.clamp(0.0, duration_s);
                self.judge(&std::array::from_fn(|axis| ways[axis].at(time_s)))?;
            }
        }
        Ok(())
    }

    /// A joint that turns round between two samples goes beyond both of them.
    fn judge_turns(&self, before: &[Jet3; JOINTS], after: &[Jet3; JOINTS], step_s: f64) -> Result<(), Obstruction> {
        for (joint, limits) in self.limits.iter().enumerate() {
            let (before, after) = (before[joint], after[joint]);
            let beyond = limits.motion.acceleration * step_s * step_s / 8.0;
            let [low, high] = limits.range;
            let out = before.q.min(after.q) - beyond < low || before.q.max(after.q) + beyond > high;
            if before.d1 * after.d1 < 0.0 && out && !self.returns(joint, after.q) {
                let why = Obstacle::Travel;
                return Err(Obstruction { joint, why });
            }
        }
        Ok(())
    }

    /// Whether a state of the axes is good for every joint; gives the joints.
    fn judge(&self, axes: &[Moving; AXES]) -> Result<[Jet3; JOINTS], Obstruction> {
        let axes: [Jet3; AXES] = std::array::from_fn(|axis| {
            let Moving { state, jerk } = axes[axis];
            Jet3::new(state.position, state.velocity, state.acceleration, jerk)
        });
        let mut all = [Jet3::ZERO; JOINTS];
        let joints = &mut all[..self.limits.len()];
        if let Err(unreachable) = self.kinematics.inverse(&self.frame, &axes, joints) {
            return Err(Obstruction {
                joint: unreachable.joint,
                why: Obstacle::Reach(unreachable.why),
            });
        }
        let moves = axes
            .iter()
            .any(|axis| axis.d1 != 0.0 || axis.d2 != 0.0 || axis.d3 != 0.0);
        for (number, (joint, limits)) in joints.iter().zip(&self.limits).enumerate() {
            let found = |why| Err(Obstruction { joint: number, why });
            let [low, high] = limits.range;
            let inside = joint.q >= low && joint.q <= high;
            if !inside && !self.returns(number, joint.q) {
                return found(Obstacle::Travel);
            }
            let motion = &limits.motion;
            let within = joint.d1.abs() <= MARGIN * motion.velocity
                && joint.d2.abs() <= MARGIN * motion.acceleration
                && joint.d3.abs() <= MARGIN * motion.jerk;
            if moves && !within {
                return found(Obstacle::Speed);
            }
        }
        Ok(all)
    }

    /// Whether a joint that stands out of its travel comes back.
    fn returns(&self, joint: usize, to: f64) -> bool {
        let (from, [low, high]) = (self.joints[joint], self.limits[joint].range);
        from > high && to <= from || from < low && to >= from
    }
}

fn longest(ways: &[RestWay; AXES]) -> f64 {
    ways.iter().fold(0.0, |longest, way| longest.max(way.duration_s()))
}

#[cfg(test)]
mod tests;
