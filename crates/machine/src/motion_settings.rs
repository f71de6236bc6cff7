//! What a machine file says to the planner and to the interpolation.
//!
//! In:  the checked machine description, where the machine stands.
//! Out: settings of the planner, the capacity of the ring, how holds, stops and probes come to rest.

use config::{AxisMap, Config, Joint};
use motion::canon::{AXES, Axis, Position};
use motion::kinematics::{JOINTS, Kinematics, ToolFrame, Transform};
use motion::plan::{AxisLimits, JointSpace, Settings};
use motion::rt::probe::StopShares;
use motion::rt::{MotionLimits, ScaleRamp, StopLimits};

/// What the planner is told of a machine that stands at `start`.
pub fn plan_settings(config: &Config, start: Position) -> Settings {
    let kinematics = config.kinematics();
    let follows = kinematics.is_trivial(&ToolFrame::OFF);
    let is_belt = |map: &&AxisMap| matches!(map.axis, Axis::X | Axis::Y);
    let belts: Vec<usize> = config
        .axes
        .iter()
        .filter(is_belt)
        .flat_map(|map| map.joints.clone())
        .collect();
    let mut axes = [const { None }; AXES];
    for map in &config.axes {
        // Several joints of an axis move together: the weakest says what it may do.
        let crossed = matches!(config.transform, Transform::CoreXy) && matches!(map.axis, Axis::X | Axis::Y);
        // Either motor of a CoreXY moves by the sum of both axes: half of the weaker one for each is safe.
        let moving = if crossed { &belts } else { &map.joints };
        let share = if crossed { 0.5 } else { 1.0 };
        let joints = || moving.iter().map(|&joint| &config.joints[joint]);
        let least = |value: fn(&Joint) -> f64| joints().map(value).fold(f64::INFINITY, f64::min);
        axes[map.axis as usize] = Some(AxisLimits {
            velocity: share * least(|joint| joint.limits.velocity_mm_s),
            acceleration: share * least(|joint| joint.limits.acceleration_mm_s2),
            jerk: share * least(|joint| joint.limits.jerk_mm_s3),
            travel: if follows {
                [
                    joints()
                        .map(|joint| joint.travel_mm[0] - joint.squaring_offset_mm)
                        .fold(f64::NEG_INFINITY, f64::max),
                    least(|joint| joint.travel_mm[1] - joint.squaring_offset_mm),
                ]
            } else {
                map.travel_mm.unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
            },
        });
    }
    Settings {
        axes,
        joints: joint_space(config, kinematics),
        cycle_s: f64::from(config.cycle_us) * 1e-6,
        tolerance_mm: config.program.tolerance_mm,
        rapid_tolerance_mm: config.program.rapid_tolerance_mm,
        look_ahead_blocks: config.program.look_ahead_blocks,
        look_ahead_buffer_blocks: config.program.look_ahead_buffer_blocks,
        look_ahead_overlap_blocks: config.program.look_ahead_overlap_blocks,
        spindle_encoder: config.spindle.encoder.is_some(),
        await_spindle: config.spindle.wait_for_speed,
        spindle_rpm_max: config.spindle.rpm_max,
        planner_kind: config.program.planner,
        start,
    }
}

/// Joints of a machine whose kinematics are not trivial.
fn joint_space(config: &Config, kinematics: Kinematics) -> Option<JointSpace> {
    let mut limits = [AxisLimits {
        velocity: 1.0,
        acceleration: 1.0,
        jerk: 1.0,
        travel: [0.0; 2],
    }; JOINTS];
    for (limits, joint) in limits.iter_mut().zip(&config.joints) {
        *limits = AxisLimits {
            velocity: joint.limits.velocity_mm_s,
            acceleration: joint.limits.acceleration_mm_s2,
            jerk: joint.limits.jerk_mm_s3,
            travel: joint.travel_mm,
        };
    }
    (*kinematics.transform() != Transform::Trivial).then_some(JointSpace { kinematics, limits })
}

/// Elements that the ring must hold, so that the planner can hand in whatever it plans at once; many seconds of motion.
pub fn ring_capacity(config: &Config) -> usize {
    plan_settings(config, Position::ZERO).largest_publication()
}

/// Limits of each joint: of planned motion, and of stops.
fn joint_limits(config: &Config) -> impl Iterator<Item = (MotionLimits, StopLimits)> + '_ {
    config.joints.iter().map(|joint| {
        let plan = MotionLimits {
            velocity: joint.limits.velocity_mm_s,
            acceleration: joint.limits.acceleration_mm_s2,
            jerk: joint.limits.jerk_mm_s3,
        };
        let stop = StopLimits {
            acceleration: joint.stop.acceleration_mm_s2,
            jerk: joint.stop.jerk_mm_s3,
        };
        (plan, stop)
    })
}

/// The ramp of holds and stops of a machine.
pub fn stop_ramp(config: &Config) -> ScaleRamp {
    let axes: Vec<(MotionLimits, StopLimits)> = joint_limits(config).collect();
    ScaleRamp::new(&axes, f64::from(config.cycle_us) * 1e-6)
}

/// How much harder than planned motion a probe may stop at its contact.
pub fn stop_shares(config: &Config) -> StopShares {
    StopShares::new(joint_limits(config))
}
