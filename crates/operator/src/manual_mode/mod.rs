//! The machine in the hands of the operator: jogging, between programs.
//!
//! In:  orders of clients, how the machine is.
//! Out: orders to the cycle thread, or why not.
//!
//! A jog is refused here with words; the cycle thread looks at the same conditions again, in the cycle that begins it.

use crate::console::Operator;
use api::orders::{Jog, Jogged};
use config::Config;
use machine::sequence::Step;
use machine::state::State;
use motion::canon::Axis;
use motion::kinematics::ToolFrame;
use protocol::{JogOutlook, Message, message};
use rt::joint_jog::{JogMotion, JogOrder};
use rt::shared::{Command, Snapshot};

/// Moves joints by hand. Gives what comes of the order: `axis` and its `unit`, the greatest speed, and the soft limit where the
/// motion ends there.
pub(super) fn jog(jog: &Jog, config: &Config, operator: &mut Operator) -> Result<JogOutlook, Message> {
    if config.joints.is_empty() {
        return Err(config.without_joints().into());
    }
    let live = operator.live();
    match (operator.step(), live.state) {
        (Step::StandBy, State::Ready | State::Jogging) | (Step::Program, State::Held | State::Away) => {}
        _ => return Err(not_now(operator)),
    }
    let axis = match jog.what {
        Some(Jogged::Axis(axis)) if !config.kinematics().is_trivial(&ToolFrame::OFF) => Some(axis),
        Some(Jogged::Axis(_) | Jogged::Joint(_)) | None => None,
    };
    let joints = match jog.what {
        Some(what) => joints(what, config)?,
        // Those that do not move take no notice.
        None => u64::MAX,
    };
    let begins = match jog.motion {
        JogMotion::Run { .. } | JogMotion::Advance { .. } => true,
        JogMotion::Keep | JogMotion::Release => false,
    };
    if begins && live.jog_barred {
        return Err(message!(
            "refused.jog_barred",
            "jogs are barred: motion.feed-hold, motion.jog-inhibit or motion.jog-stop is on (isocnc hal get 'motion.*')"
        ));
    }
    let unhomed = matches!(jog.what, Some(Jogged::Joint(_)));
    let lost = joints & !live.homed;
    if begins && lost != 0 && !(unhomed && matches!(live.state, State::Ready | State::Jogging)) {
        let joint = lost.trailing_zeros();
        return Err(message!(
            "refused.joint_not_homed",
            "joint {joint} is not homed: isocnc home; before that it can be jogged by its number, slowly: isocnc jog {joint} 1",
            joint = joint
        ));
    }
    if let Some(switch) = in_the_way(jog.motion, axis.is_some(), joints, live.limits) {
        return Err(switch);
    }
    // What was ordered a moment ago may not have begun yet.
    if !begins && !matches!(live.state, State::Jogging | State::Away) && operator.is_up_to_date() {
        let nothing = || message!("refused.not_jogging", "nothing is being jogged");
        return Err(operator.obstruction().cloned().unwrap_or_else(nothing));
    }
    if begins {
        operator.forget_obstruction();
    }
    let motion = jog.motion;
    operator.give(Command::Jog(JogOrder {
        acceleration_share: 1.0,
        unhomed,
        joints,
        axis,
        motion,
    }));
    Ok(match axis {
        // How fast and how far is found on the way, by the kinematics.
        Some(axis) => JogOutlook {
            axis: Some(axis.letter().to_string()),
            unit: Some(unit(axis).to_owned()),
            ..JogOutlook::default()
        },
        None => outlook(motion, joints, config, &live),
    })
}

/// The limit switch that a motion would lead further onto, in words.
fn in_the_way(motion: JogMotion, by_several: bool, joints: u64, [lower, upper]: [u64; 2]) -> Option<Message> {
    let way = match motion {
        JogMotion::Run { velocity_mm_s } => velocity_mm_s,
        JogMotion::Advance { distance_mm, .. } => distance_mm,
        JogMotion::Keep | JogMotion::Release => return None,
    };
    let first = |joints: u64| (joints != 0).then(|| joints.trailing_zeros());
    let on_lower = || {
        first(lower & joints).map(|joint| {
            message!(
                "refused.on_lower_switch",
                "joint {joint} stands on its lower limit switch: jog joint {joint} the other way",
                joint = joint
            )
        })
    };
    let on_upper = || {
        first(upper & joints).map(|joint| {
            message!(
                "refused.on_upper_switch",
                "joint {joint} stands on its upper limit switch: jog joint {joint} the other way",
                joint = joint
            )
        })
    };
    if let Some(joint) = first(lower & upper & joints) {
        return Some(message!(
            "refused.on_both_switches",
            "joint {joint} has both limit switches closed, and nobody knows which way leads off them: look at the switches and their \
             wires, or turn its motor by hand with drives off",
            joint = joint
        ));
    }
    match by_several {
        true => on_lower().or_else(on_upper),
        false if way < 0.0 => on_lower(),
        false => on_upper(),
    }
}

/// What will come of a motion of joints that are those of one axis.
fn outlook(motion: JogMotion, joints: u64, config: &Config, live: &Snapshot) -> JogOutlook {
    let is_homed = joints & !live.homed == 0;
    let moved = || (0..config.joints.len()).filter(|joint| joints >> joint & 1 == 1);
    let axis = config
        .axes
        .iter()
        .find(|map| moved().any(|joint| map.joints.contains(&joint)));
    let Some(axis) = axis.map(|map| map.axis) else {
        return JogOutlook::default();
    };
    let fastest = moved()
        .map(|joint| match is_homed {
            true => config.joints[joint].limits.velocity_mm_s,
            false => config.joints[joint].unhomed_jog_mm_s,
        })
        .fold(f64::INFINITY, f64::min);
    let ends = moved().map(|joint| config.joints[joint].travel_mm);
    let [low, high] = ends.fold([f64::NEG_INFINITY, f64::INFINITY], |[low, high], end| {
        [low.max(end[0]), high.min(end[1])]
    });
    let (speed, wanted) = match motion {
        JogMotion::Run { velocity_mm_s } => (velocity_mm_s, velocity_mm_s.signum() * f64::INFINITY),
        JogMotion::Advance {
            distance_mm,
            velocity_mm_s,
        } => (velocity_mm_s, live.position[axis] + distance_mm),
        JogMotion::Keep | JogMotion::Release => return JogOutlook::default(),
    };
    let soft_limit = (is_homed && !(low..=high).contains(&wanted)).then(|| wanted.clamp(low, high));
    JogOutlook {
        axis: Some(axis.letter().to_string()),
        unit: Some(unit(axis).to_owned()),
        velocity_mm_s: Some(speed.abs().min(fastest)),
        soft_limit_mm: Some(soft_limit),
    }
}

fn unit(axis: Axis) -> &'static str {
    if axis.is_rotary() { "degrees" } else { "mm" }
}

/// The joints that something moves (bit n: joint n).
pub(super) fn joints(what: Jogged, config: &Config) -> Result<u64, String> {
    let mask = |joints: &[usize]| joints.iter().fold(0, |mask, joint| mask | 1 << joint);
    match what {
        Jogged::Axis(axis) => match config.axes.iter().find(|map| map.axis == axis) {
            // To move an axis takes several joints in step there, and all of them must know where they are.
            Some(_) if !config.kinematics().is_trivial(&ToolFrame::OFF) => Ok((1 << config.joints.len()) - 1),
            Some(map) => Ok(mask(&map.joints)),
            None => {
                let axes: Vec<String> = config.axes.iter().map(|map| map.axis.letter().to_string()).collect();
                let letter = axis.letter();
                Err(format!(
                    "the machine has no axis {letter}; axes are {}",
                    axes.join(", ")
                ))
            }
        },
        Jogged::Joint(joint) if joint < config.joints.len() => {
            let map = config.axes.iter().find(|map| map.joints.contains(&joint));
            Ok(map.map_or(1 << joint, |map| mask(&map.joints)))
        }
        Jogged::Joint(joint) => {
            let last = config.joints.len() - 1;
            Err(format!("there is no joint {joint}; joints are 0 to {last}"))
        }
    }
}

fn not_now(operator: &Operator) -> Message {
    message!(
        "refused.not_now",
        "not while the machine is {state} ({step})",
        state = operator.live().state.message(),
        step = operator.step_code().message()
    )
}

#[cfg(test)]
mod tests;
