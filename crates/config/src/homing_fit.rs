//! What homing needs of the rest of the machine: switches that are wired, zero marks that are told, joints of a gantry and belts that
//! home alike.

use super::axes::AxisMap;
use super::bus_types::Node;
use super::homing::{HomeSwitch, Homing, HomingBy, HomingByControl, HomingIndex, stopping_way_mm};
use super::joints::Joint;
use super::limits::StopLimits;
use super::modes::touch_probe_objects;
use super::net::Net;
use super::section::Section;
use cia402::profile::object_of;
use motion::canon::Axis;
use motion::kinematics::Transform;

/// Home switch in 60FDh.
const DIGITAL_INPUTS: u16 = 0x60FD;

/// What belts of CoreXY need to home by the control: joints of X and Y have the switches, places and speeds of these axes then, and
/// either belt moves by the sum of both.
fn belts(sections: &mut [Option<Section<'_, '_>>], joints: &[Joint], axes: &[AxisMap]) {
    let pulled = axes.iter().filter(|map| matches!(map.axis, Axis::X | Axis::Y));
    let belts: Vec<(&AxisMap, &Joint)> = pulled.map(|map| (map, &joints[map.joints[0]])).collect();
    let least = |value: fn(&Joint) -> f64| {
        let values = belts.iter().map(|(_, joint)| value(joint));
        0.5 * values.fold(f64::INFINITY, f64::min)
    };
    let velocity_mm_s = least(|joint| joint.limits.velocity_mm_s);
    let stop = StopLimits {
        acceleration_mm_s2: least(|joint| joint.stop.acceleration_mm_s2),
        jerk_mm_s3: least(|joint| joint.stop.jerk_mm_s3),
    };
    let [(_, first), (_, second)] = belts[..] else { return };
    for (map, joint) in belts {
        let Some(Some(section)) = sections.get_mut(map.joints[0]) else {
            continue;
        };
        let HomingBy::Control(control) = joint.homing.by else {
            let other = [first, second]
                .iter()
                .any(|joint| matches!(joint.homing.by, HomingBy::Control(_)));
            if other {
                section.wrong("by", "must be \"control\" for both belts of CoreXY, or for none");
            }
            continue;
        };
        if first.homing.sequence != second.homing.sequence {
            let rule = "must be the same for both belts of CoreXY, which move together";
            section.wrong("sequence", rule);
        }
        if control.index.is_some() {
            let rule = "is not for belts of CoreXY, whose zero marks are none of an axis";
            section.wrong("index_distance_mm", rule);
        }
        if joint.compensation.is_some() {
            let rule = "a belt of CoreXY with a compensation homes by its drive: where it is at the switch of the axis, \
                        the other belt says";
            section.wrong("by", rule);
        }
        if joint.homing.search_mm_s > velocity_mm_s {
            let rule = format!("must not be above {velocity_mm_s}: a belt of CoreXY moves by the sum of both axes");
            section.wrong("search_mm_s", rule);
        }
        let stop_mm = stopping_way_mm(joint.homing.search_mm_s, stop);
        if control.release_distance_mm <= stop_mm {
            let rule = format!("must be above {stop_mm:.3}, the way of a stop from search_mm_s behind the switch");
            section.wrong("release_distance_mm", rule);
        }
        let Some([low_mm, high_mm]) = map.travel_mm else {
            continue;
        };
        let letter = map.axis.letter();
        let most_mm = high_mm - low_mm + control.release_distance_mm;
        if control.search_distance_mm > most_mm {
            let rule = format!("must be given, not above {most_mm}, the travel of {letter} and release_distance_mm");
            section.wrong("search_distance_mm", rule);
        }
        if !(low_mm..=high_mm).contains(&joint.homing.position_mm) {
            let rule = format!("must lie in travel_mm of {letter}, {low_mm} to {high_mm}");
            section.wrong("position_mm", rule);
        }
    }
}

/// Keys that all joints of an axis must have alike, and how to compare them.
type Alike = (&'static str, fn(&Homing, &HomingByControl) -> f64);
const ALIKE: [Alike; 8] = [
    ("search_mm_s", |homing, _| homing.search_mm_s),
    ("latch_mm_s", |homing, _| homing.latch_mm_s),
    ("towards", |_, control| f64::from(u8::from(control.towards_positive))),
    ("release_distance_mm", |_, control| control.release_distance_mm),
    ("resolution_mm", |_, control| control.resolution_mm),
    ("bounce_s", |_, control| control.bounce_s),
    ("skew_mm", |_, control| control.skew_mm.unwrap_or(f64::INFINITY)),
    ("index_distance_mm", |_, control| {
        control.index.map_or(f64::INFINITY, |index| index.distance_mm)
    }),
];

/// What homing by the control needs of the rest of the machine: switches that are wired, joints of a gantry that home alike.
pub(super) fn fit(
    root: &mut Section<'_, '_>,
    joints: &[Joint],
    axes: &[AxisMap],
    transform: &Transform,
    nodes: &[Node],
    nets: &[Net],
) {
    let mut sections: Vec<_> = root
        .sections("joint")
        .into_iter()
        .map(|mut joint| joint.section("homing"))
        .collect();
    if let Transform::CoreXy = transform {
        belts(&mut sections, joints, axes);
    }
    for map in axes {
        for (place, &number) in map.joints.iter().enumerate() {
            let Some(Some(section)) = sections.get_mut(number) else {
                continue;
            };
            let homing = &joints[number].homing;
            let first = &joints[map.joints[0]].homing;
            let HomingBy::Control(control) = &homing.by else {
                if let HomingBy::Control(_) = first.by {
                    section.wrong("by", together(map, "\"control\"".to_owned()));
                }
                continue;
            };
            wired(section, (number, &joints[number]), control, nodes, nets);
            if let Some(index) = control.index {
                latched(section, &joints[number], index, nodes.get(joints[number].node));
            }
            match (map.joints.len(), control.skew_mm) {
                (1, Some(_)) => section.wrong("skew_mm", "is for joints that move an axis together"),
                (1, None) => {}
                (_, None) => section.wrong(
                    "skew_mm",
                    "is missing: how far the joints of the axis may be moved against each other while they home, mm",
                ),
                (_, Some(_)) => {}
            }
            if place == 0 {
                continue;
            }
            let HomingBy::Control(of_first) = &first.by else {
                section.wrong("by", together(map, "\"drive\"".to_owned()));
                continue;
            };
            for (key, value) in ALIKE {
                if value(homing, control) != value(first, of_first) {
                    section.wrong(key, together(map, "the same".to_owned()));
                }
            }
            if homing.sequence != first.sequence {
                section.wrong("sequence", together(map, "the same".to_owned()));
            }
            let square_mm =
                first.position_mm - joints[map.joints[0]].squaring_offset_mm + joints[number].squaring_offset_mm;
            if (homing.position_mm - square_mm).abs() > 1e-9 {
                let rule = together(map, format!("{square_mm}, where the axis is square,"));
                section.wrong("position_mm", rule);
            }
        }
    }
}

fn together(map: &AxisMap, value: String) -> String {
    let (first, letter) = (map.joints[0], map.axis.letter());
    format!("must be {value} for joint {first} and this one, which move {letter} together")
}

/// Whether the drive tells of its zero mark, by a touch probe that is free for it.
fn latched(section: &mut Section<'_, '_>, joint: &Joint, index: HomingIndex, node: Option<&Node>) {
    let number = index.probe;
    let Some(node) = node else {
        let rule = "is not for a joint with step pulses: it has no drive that could tell";
        section.wrong("index_distance_mm", rule);
        return;
    };
    if joint.touch_probe == Some(number) {
        let rule = format!(
            "touch probe {number} of the drive has the machine's probe (touch_probe): index_probe must be the other one"
        );
        section.wrong("index_distance_mm", rule);
    }
    let [function, status, rising, _] = touch_probe_objects(joint.drive_axis, number);
    for (payload, name, object, bits) in [
        (&node.outputs, "outputs", function, 16),
        (&node.inputs, "inputs", status, 16),
        (&node.inputs, "inputs", rising, 32),
    ] {
        if payload.iter().all(|mapped| (mapped.index, mapped.sub) != (object, 0)) {
            let rule = format!("\"0x{object:04X}/{bits}\" must be among the {name} of its node");
            section.wrong("index_distance_mm", rule);
        }
    }
}

/// Whether somebody tells of the switch: nothing would stop a joint that searches for one that is not wired.
fn wired(
    section: &Section<'_, '_>,
    (number, joint): (usize, &Joint),
    control: &HomingByControl,
    nodes: &[Node],
    nets: &[Net],
) {
    match control.switch {
        HomeSwitch::Pin => {
            let pin = format!("joint.{number}.home-sw-in");
            if !nets.iter().any(|net| !net.is_unwired() && net.targets.contains(&pin)) {
                section.wrong(
                    "switch",
                    format!(
                        "no [[hal.net]] with a source has {pin:?} among its targets: nobody would tell of the switch"
                    ),
                );
            }
        }
        HomeSwitch::Drive => {
            let Some(node) = nodes.get(joint.node) else {
                let rule = "must be \"pin\": there is no drive on the bus that could tell";
                section.wrong("switch", rule);
                return;
            };
            let wanted = object_of(joint.drive_axis, DIGITAL_INPUTS);
            if node.inputs.iter().all(|object| object.index != wanted) {
                let name = &node.name;
                let rule = format!("\"0x{wanted:04X}/32\" must be among the inputs of {name}");
                section.wrong("switch", rule);
            }
        }
    }
}
