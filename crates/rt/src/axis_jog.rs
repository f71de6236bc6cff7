//! Axes of a machine whose joints are not its axes, moved by hand.
//!
//! In:  orders for one axis each; a sign of life while the hand is on the key.
//! Out: commanded positions of all joints; what is in the way, if something is.
//!
//! RT: nothing allocates but [`AxisJog::new`].

use crate::joint_jog::JogMotion;
use config::Config;
use machine::motion_settings::{plan_settings, stop_shares};
use motion::canon::{AXES, Axis, Position};
use motion::kinematics::{Kinematics, ToolFrame};
use motion::plan::AxisLimits;
use motion::rt::MotionLimits;
use motion::rt::jog::{JogLimits, Obstruction, WorldJog};

/// The operator's hand on the axes.
#[derive(Debug)]
pub struct AxisJog {
    kinematics: Kinematics,
    jog: WorldJog,
    /// For each axis: cycles for which the last order still holds.
    holds: [u64; AXES],
    /// Cycles for which an order holds.
    holds_max: u64,
    cycle_s: f64,
    fastest: [f64; AXES],
    position: Position,
    speed_mm_s: f64,
    obstruction: Option<Obstruction>,
}

impl AxisJog {
    /// Off all axes; `None` where the joints are the axes. `joints`: the limits of each joint.
    pub fn new(config: &Config, joints: &[JogLimits], holds_max: u64) -> Option<AxisJog> {
        let kinematics = config.kinematics();
        if kinematics.is_trivial(&ToolFrame::OFF) {
            return None;
        }
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        let shares = stop_shares(config);
        let settings = plan_settings(config, Position::ZERO);
        let axes = settings.axes.map(|limits| {
            let motion = axis_limits(limits.as_ref());
            JogLimits {
                motion,
                stop: shares.along(motion),
                range: limits.map_or([f64::NEG_INFINITY, f64::INFINITY], |limits| limits.travel),
            }
        });
        Some(AxisJog {
            jog: WorldJog::new(kinematics, &axes, joints, cycle_s),
            kinematics,
            holds: [0; AXES],
            holds_max,
            cycle_s,
            fastest: axes.map(|axis| axis.motion.velocity),
            position: Position::ZERO,
            speed_mm_s: 0.0,
            obstruction: None,
        })
    }

    /// Begins with all joints at rest at `positions_mm`; false: no position of the axes belongs to them.
    pub fn begin(&mut self, positions_mm: &[f64]) -> bool {
        self.holds = [0; AXES];
        self.speed_mm_s = 0.0;
        self.obstruction = None;
        let Some(position) = self.kinematics.forward(&ToolFrame::OFF, positions_mm) else {
            return false;
        };
        self.position = position;
        self.jog.rest_at(&position, ToolFrame::OFF)
    }

    /// Carries out an order; `None`: for all axes.
    pub fn obey(&mut self, axis: Option<Axis>, motion: JogMotion, acceleration_share: f64) {
        for one in Axis::ALL {
            if axis.is_some_and(|axis| axis != one) {
                continue;
            }
            let holds = &mut self.holds[one as usize];
            if motion != JogMotion::Keep {
                self.jog.set_acceleration_share(one, acceleration_share);
            }
            match motion {
                // Only for one axis: nobody means all of them.
                JogMotion::Run { velocity_mm_s } if axis.is_some() => {
                    *holds = self.holds_max;
                    self.jog.run(one, velocity_mm_s);
                }
                JogMotion::Advance {
                    distance_mm,
                    velocity_mm_s,
                } if axis.is_some() => {
                    *holds = self.holds_max;
                    self.jog.advance(one, distance_mm, velocity_mm_s);
                }
                JogMotion::Keep if *holds > 0 => *holds = self.holds_max,
                JogMotion::Release => {
                    *holds = 0;
                    self.jog.run(one, 0.0);
                }
                JogMotion::Run { .. } | JogMotion::Keep | JogMotion::Advance { .. } => {}
            }
        }
    }

    /// Lets all axes come to rest.
    pub fn release_all(&mut self) {
        self.holds = [0; AXES];
        self.jog.release_all();
    }

    /// Brings all axes to rest as quickly as the stop limits allow.
    pub fn stop(&mut self) {
        self.holds = [0; AXES];
        self.jog.stop_all();
    }

    /// One cycle further: positions of all joints, mm.
    pub fn step(&mut self, command_mm: &mut [f64]) {
        for axis in Axis::ALL {
            match self.holds[axis as usize] {
                0 => {}
                1 => self.obey(Some(axis), JogMotion::Release, 1.0),
                holds => self.holds[axis as usize] = holds - 1,
            }
        }
        let before = self.position;
        self.position = self.jog.step(command_mm);
        let way = Axis::ALL
            .iter()
            .map(|&axis| self.position[axis] - before[axis])
            .fold(0.0, f64::hypot);
        self.speed_mm_s = way / self.cycle_s;
        if let Some(obstruction) = self.jog.obstruction()
            && self.holds != [0; AXES]
        {
            // What cannot go on is over, so that the hand on the key notices.
            self.obstruction = Some(obstruction);
            self.holds = [0; AXES];
        }
    }

    /// Where an axis is.
    pub fn place(&self, axis: usize) -> Option<f64> {
        self.position.0.get(axis).copied()
    }

    /// How far an axis still has to go for the increments that it was given.
    pub fn arrears(&self, axis: usize) -> f64 {
        Axis::ALL.get(axis).map_or(0.0, |axis| self.jog.arrears(*axis))
    }

    /// Whether an order still holds for an axis.
    pub fn is_held(&self, axis: usize) -> bool {
        self.holds.get(axis).is_some_and(|holds| *holds > 0)
    }

    /// Where a joint is, mm.
    pub fn joint(&self, joint: usize) -> f64 {
        self.jog.joint(joint)
    }

    /// Greatest speed of an axis by hand, mm/s.
    pub fn fastest(&self, axis: usize) -> f64 {
        self.fastest.get(axis).copied().unwrap_or(0.0)
    }

    /// Moves an axis by a distance, from rest.
    pub fn go_by(&mut self, axis: usize, distance: f64, velocity: f64) {
        if let Some(axis) = Axis::ALL.get(axis) {
            self.jog.advance(*axis, distance, velocity);
        }
    }

    /// What was in the way, told once.
    pub fn take_obstruction(&mut self) -> Option<Obstruction> {
        self.obstruction.take()
    }

    /// Whether all axes rest and no order holds any more.
    pub fn is_over(&self) -> bool {
        self.jog.is_at_rest() && self.holds == [0; AXES]
    }

    /// Whether all axes rest.
    pub fn is_at_rest(&self) -> bool {
        self.jog.is_at_rest()
    }

    /// Speed of the axes together, mm/s.
    pub fn speed_mm_s(&self) -> f64 {
        self.speed_mm_s
    }
}

/// Share of its limits that an axis uses by hand: one that is a joint as well stays within what [`WorldJog`] allows joints.
const AXIS_SHARE: f64 = 0.8;

/// What an axis may do in the world; joints have the last word.
fn axis_limits(limits: Option<&AxisLimits>) -> MotionLimits {
    let finite = |value: Option<f64>| value.filter(|value| value.is_finite()).unwrap_or(1.0);
    MotionLimits {
        velocity: AXIS_SHARE * finite(limits.map(|limits| limits.velocity)),
        acceleration: AXIS_SHARE * finite(limits.map(|limits| limits.acceleration)),
        jerk: AXIS_SHARE * finite(limits.map(|limits| limits.jerk)),
    }
}
