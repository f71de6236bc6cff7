//! What methods tell of, in the types that travel.
//!
//! In:  the machine file; what the operator shows and the journal keeps. Out: the same as [`protocol`] has it.

use crate::orders;
use ::machine::state_file;
use config::{AxisMap, Config, Does, Panel, PanelButton, PanelValue};
use motion::canon::LengthUnit;
use motion::kinematics::Transform;
use protocol::{
    Described, DescribedAxis, DescribedButton, DescribedJoint, DescribedQuestion, DescribedValue, LastProgram, Parts,
    Role, StatusProgram,
};
use std::path::Path;

/// Unit of positions of an axis.
pub(super) fn unit(map: &AxisMap) -> &'static str {
    if map.axis.is_rotary() { "degrees" } else { "mm" }
}

/// The joint that is this axis alone.
pub(super) fn joint_of(config: &Config, map: &AxisMap) -> Option<usize> {
    match map.joints[..] {
        [joint] if config.transform == Transform::Trivial => Some(joint),
        _ => None,
    }
}

/// What of a machine does not change.
pub(super) fn machine(config: &Config) -> Described {
    let axes = config.axes.iter().map(|map| {
        let joint = map.joints.first().and_then(|joint| config.joints.get(*joint));
        DescribedAxis {
            axis: map.axis.letter().to_string(),
            unit: unit(map).to_owned(),
            joints: map.joints.clone(),
            joint: joint_of(config, map),
            travel: map.travel_mm.or(joint.map(|joint| joint.travel_mm)),
            velocity_per_s: joint.map(|joint| joint.limits.velocity_mm_s),
            acceleration_per_s2: joint.map(|joint| joint.limits.acceleration_mm_s2),
        }
    });
    let joints = config.joints.iter().enumerate().map(|(number, joint)| DescribedJoint {
        joint: number,
        travel: joint.travel_mm,
        velocity_per_s: joint.limits.velocity_mm_s,
        following_error: joint.following_error_mm,
    });
    let unit = match config.unit {
        LengthUnit::Millimetre => "mm",
        LengthUnit::Inch => "inch",
    };
    Described {
        machine: config.name.clone(),
        unit: unit.to_owned(),
        cycle_us: config.cycle_us,
        axes: axes.collect(),
        joints: joints.collect(),
        spindles: usize::from(config.spindle.count),
        spindle_rpm_max: config.spindle.rpm_max,
        programs: false,
        buttons: items(config, |panel| panel.buttons.iter().map(button).collect()),
        values: items(config, |panel| panel.values.iter().map(shown).collect()),
        pages: items(config, |panel| panel.pages.as_deref().map_or_else(Vec::new, pages)),
    }
}

/// What of the panel the user has added.
fn items<T>(config: &Config, of: impl Fn(&Panel) -> Vec<T>) -> Vec<T> {
    config.panel.as_ref().map_or_else(Vec::new, of)
}

fn button(of: &PanelButton) -> DescribedButton {
    let (mdi, program) = match &of.does {
        Does::Mdi(lines) => (lines.clone(), None),
        Does::Program(name) => (Vec::new(), Some(name.clone())),
    };
    let questions = of.questions.iter().map(|question| DescribedQuestion {
        name: question.name.clone(),
        label: question.label.clone(),
        default: question.default,
        min: question.min,
        max: question.max,
    });
    DescribedButton {
        name: of.name.clone(),
        label: of.label.clone(),
        ask: of.ask.clone(),
        mdi,
        program,
        role: if of.set_up { Role::SetUp } else { Role::Operate },
        lamp: of.lamp.clone(),
        questions: questions.collect(),
    }
}

fn shown(of: &PanelValue) -> DescribedValue {
    DescribedValue {
        label: of.label.clone(),
        pin: of.pin.clone(),
        unit: of.unit.clone(),
        decimals: of.decimals,
    }
}

/// Pages of a folder, as it is at the start.
fn pages(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names
        .filter(|name| name.ends_with(".html") && files::is_name(name))
        .collect();
    names.sort();
    names
}

impl From<orders::ShownProgram> for StatusProgram {
    fn from(of: orders::ShownProgram) -> StatusProgram {
        StatusProgram {
            name: of.name,
            revision: of.revision,
            lines: of.lines,
            planned_time_s: of.planned_time_s,
            tools: of.tools,
            dry_run: of.dry_run,
            result: of.result,
        }
    }
}

/// The counter of parts.
pub(super) fn parts(state_file::Parts { count, target }: state_file::Parts) -> Parts {
    Parts { count, target }
}

/// The program that was loaded or begun last.
pub(super) fn last_program(of: state_file::LastProgram) -> LastProgram {
    let state_file::LastProgram { name, line, result } = of;
    LastProgram { name, line, result }
}
