//! `[joint.homing]`: how a joint finds out where it is, by its drive or by the control.
//!
//! | `by` | keys |
//! |---|---|
//! | both | `search_mm_s`, `latch_mm_s`, `position_mm`, `sequence`, `absolute_encoder`, `moved_when_off_mm`, `volatile` |
//! | `"drive"` (default) | `method`, `acceleration_mm_s2` |
//! | `"control"` | `towards`, `switch_mm`, `switch`, `search_distance_mm`, `release_distance_mm`, `resolution_mm`, `bounce_s`, `skew_mm`, `index_distance_mm`, `index_probe` |

use super::document::{Bound, Section};
use super::joints::{ACCELERATION_MAX, LENGTH_MAX, VELOCITY_MAX, ratio};
use super::types::{
    AxisMap, DriveProfile, HomeSwitch, Homing, HomingBy, HomingByControl, HomingIndex, Joint, Net, Node, StopLimits,
    touch_probe_objects,
};
use cia402::profile::object_of;
use motion::canon::Axis;
use motion::kinematics::Transform;

/// Homing of joints of one sequence number may take no longer than 120 s; some of it is for what is not in the sum, s.
const DURATION_MAX_S: f64 = 100.0;
/// Wanted where the file does not say, mm.
const RESOLUTION_USUAL_MM: f64 = 1e-3;
const RELEASE_USUAL_MM: f64 = 5.0;
const BOUNCE_USUAL_S: f64 = 0.02;
/// What an axis sinks into its brake, or is pushed, while nobody looks.
const MOVED_USUAL_MM: f64 = 1.0;
/// Home switch in 60FDh.
const DIGITAL_INPUTS: u16 = 0x60FD;

const OF_DRIVES: [&str; 2] = ["method", "acceleration_mm_s2"];
const OF_THE_CONTROL: [&str; 10] = [
    "towards",
    "switch_mm",
    "switch",
    "search_distance_mm",
    "release_distance_mm",
    "resolution_mm",
    "bounce_s",
    "skew_mm",
    "index_distance_mm",
    "index_probe",
];

pub(super) const METHOD_RULE: &str = "must be a homing method of CiA 402: 1 to 14, 17 to 30, 33, 34, 35 or 37";

/// Homing methods of CiA 402 that a drive does by itself; 15, 16, 31, 32 are reserved, 36 needs a touch probe.
pub(super) fn is_homing_method(method: i64) -> bool {
    matches!(method, 1..=14 | 17..=30 | 33 | 34 | 35 | 37)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum By {
    Drive,
    Control,
}

/// What is known of the joint; `None` where it has errors of its own.
pub(super) struct Known<'n> {
    pub(super) travel_mm: Option<[f64; 2]>,
    pub(super) velocity_mm_s: Option<f64>,
    pub(super) stop: Option<StopLimits>,
    pub(super) counts_per_unit: Option<[u32; 2]>,
    /// Way of a turn of its motor, mm.
    pub(super) turn_mm: Option<f64>,
    /// It has no drive that could search.
    pub(super) is_local: bool,
    /// What is known of its drive.
    pub(super) drive: Option<&'n DriveProfile>,
}

/// Reads the homing of one joint.
pub(super) fn homing(joint: &mut Section<'_, '_>, known: &Known<'_>) -> Option<Homing> {
    joint.required(
        "homing",
        "how the drive finds its reference point: { method = 35, ... }",
    )?;
    let mut section = joint.section("homing")?;
    let by = section.word("by", &[("drive", By::Drive), ("control", By::Control)], By::Drive)?;
    let method = match by {
        By::Drive => method(&mut section, known.drive),
        By::Control => None,
    };
    if known.is_local && method.is_some_and(|method| !matches!(method, 35 | 37)) {
        section.wrong(
            "method",
            "must be 37 (it is homed where it stands), or by = \"control\": there is no drive that could search",
        );
    }
    let search_mm_s = section.number("search_mm_s", Bound::Positive(VELOCITY_MAX), None);
    let latch_mm_s = section.number("latch_mm_s", Bound::Positive(VELOCITY_MAX), None);
    let acceleration_mm_s2 = match by {
        By::Drive => section.number("acceleration_mm_s2", Bound::Positive(ACCELERATION_MAX), None),
        By::Control => None,
    };
    let position_mm = section.number("position_mm", Bound::Size(LENGTH_MAX), 0.0);
    let sequence = section.optional_integer("sequence", 0..=99);
    let absolute_encoder = section.flag("absolute_encoder", false);
    let moved_when_off_mm = section.number("moved_when_off_mm", Bound::Positive(LENGTH_MAX), MOVED_USUAL_MM);
    let volatile = section.flag("volatile", false);
    if (absolute_encoder, volatile) == (Some(true), Some(true)) {
        section.wrong(
            "volatile",
            "is not for a joint with absolute_encoder = true: that stays homed",
        );
    }
    if let (Some(search), Some(most)) = (search_mm_s, known.velocity_mm_s)
        && search > most
    {
        section.wrong(
            "search_mm_s",
            format!("must not be above velocity_mm_s of the joint, {most}"),
        );
    }
    if let (Some(latch), Some(search)) = (latch_mm_s, search_mm_s)
        && latch > search
    {
        section.wrong("latch_mm_s", format!("must not be above search_mm_s, {search}"));
    }
    if let (Some(position), Some([lower, upper])) = (position_mm, known.travel_mm)
        && !(lower..=upper).contains(&position)
    {
        section.wrong("position_mm", format!("must lie in travel_mm, {lower} to {upper}"));
    }
    let by = match by {
        By::Drive => {
            if let Some(counts) = known.counts_per_unit {
                // The drive is told whole increments per second (squared).
                for (key, value) in [
                    ("search_mm_s", search_mm_s),
                    ("latch_mm_s", latch_mm_s),
                    ("acceleration_mm_s2", acceleration_mm_s2),
                ] {
                    let fits = |value: f64| (1.0..=f64::from(u32::MAX)).contains(&(value * ratio(counts)));
                    if value.is_some_and(|value| !fits(value)) {
                        section.wrong(key, "must be 1 to 4294967295 in increments of the drive");
                    }
                }
            }
            refuse(&mut section, &OF_THE_CONTROL, "is for by = \"control\"");
            method
                .zip(acceleration_mm_s2)
                .map(|(method, acceleration_mm_s2)| HomingBy::Drive {
                    method,
                    acceleration_mm_s2,
                })
        }
        By::Control => {
            let control = by_control(&mut section, known, search_mm_s, latch_mm_s);
            refuse(&mut section, &OF_DRIVES, "is for by = \"drive\"");
            control.map(HomingBy::Control)
        }
    };
    section.done();
    Some(Homing {
        search_mm_s: search_mm_s?,
        latch_mm_s: latch_mm_s?,
        position_mm: position_mm?,
        sequence: sequence?.map(|sequence| sequence as u8),
        absolute_encoder: absolute_encoder?,
        moved_when_off_mm: moved_when_off_mm?,
        volatile: volatile?,
        by: by?,
    })
}

/// Notes keys that belong to the other way of homing.
fn refuse(section: &mut Section<'_, '_>, keys: &[&'static str], rule: &str) {
    for key in keys {
        if section.has(key) {
            section.known(&[key]);
            section.wrong(key, rule);
        }
    }
}

fn method(section: &mut Section<'_, '_>, drive: Option<&DriveProfile>) -> Option<i8> {
    let method = section.integer("method", -128..=127, None)?;
    if !is_homing_method(method) {
        section.wrong("method", METHOD_RULE);
        return None;
    }
    let method = method as i8;
    if let Some(drive) = drive.filter(|it| !it.homing_methods.is_empty() && !it.homing_methods.contains(&method)) {
        let methods: Vec<_> = drive.homing_methods.iter().map(i8::to_string).collect();
        let rule = format!("does not work with {}, only {}", drive.name, methods.join(", "));
        section.wrong("method", rule);
        return None;
    }
    Some(method)
}

fn by_control(
    section: &mut Section<'_, '_>,
    known: &Known<'_>,
    search_mm_s: Option<f64>,
    latch_mm_s: Option<f64>,
) -> Option<HomingByControl> {
    let towards_positive = section.word("towards", &[("negative", false), ("positive", true)], None);
    let switch_mm = section.number("switch_mm", Bound::Size(LENGTH_MAX), None);
    let switch = section.word(
        "switch",
        &[("pin", HomeSwitch::Pin), ("drive", HomeSwitch::Drive)],
        HomeSwitch::Pin,
    );
    let release_distance_mm = section.number("release_distance_mm", Bound::Positive(LENGTH_MAX), RELEASE_USUAL_MM);
    // From the far end of the travel to the switch, and a little.
    let usual_mm = match (towards_positive, switch_mm, known.travel_mm, release_distance_mm) {
        (Some(positive), Some(switch_mm), Some([low, high]), Some(release_mm)) => {
            let way_mm = if positive { switch_mm - low } else { high - switch_mm };
            if way_mm <= 0.0 {
                let (far, end) = if positive { ("below", low) } else { ("above", high) };
                section.wrong(
                    "switch_mm",
                    format!(
                        "lies {far} all of travel_mm ({end}): a joint that searches the other way never gets there"
                    ),
                );
                return None;
            }
            Some(way_mm + release_mm)
        }
        _ => None,
    };
    let search_distance_mm = match section.optional("search_distance_mm") {
        None => usual_mm,
        Some(item) => item.number(&section.key("search_distance_mm"), Bound::Positive(LENGTH_MAX)),
    };
    let increment_mm = known.counts_per_unit.map_or(0.0, |counts| 1.0 / ratio(counts));
    let resolution_mm = section.number(
        "resolution_mm",
        Bound::Positive(LENGTH_MAX),
        RESOLUTION_USUAL_MM.max(increment_mm),
    );
    let bounce_s = section.number("bounce_s", Bound::Within(0.0, 1.0), BOUNCE_USUAL_S);
    let skew_mm = match section.optional("skew_mm") {
        None => Some(None),
        Some(item) => item
            .number(&section.key("skew_mm"), Bound::Positive(LENGTH_MAX))
            .map(Some),
    };
    let index_distance_mm = match section.optional("index_distance_mm") {
        None => Some(None),
        Some(item) => item
            .number(&section.key("index_distance_mm"), Bound::Positive(LENGTH_MAX))
            .map(Some),
    };
    if let (Some(Some(distance_mm)), Some(turn_mm)) = (index_distance_mm, known.turn_mm)
        && distance_mm > turn_mm
    {
        let rule = format!(
            "must not be above {turn_mm}, the way of a turn of the motor: a zero mark that is missed would not be told, and the next \
             one be taken for it"
        );
        section.wrong("index_distance_mm", rule);
    }
    let index_probe = section.optional_integer("index_probe", 1..=2);
    if let (Some(Some(_)), Some(None)) = (index_probe, index_distance_mm) {
        section.wrong("index_probe", "is for a joint with index_distance_mm");
    }
    if resolution_mm.is_some_and(|resolution_mm| resolution_mm < increment_mm) {
        let rule = format!("must not be below one increment of the drive, {increment_mm}");
        section.wrong("resolution_mm", rule);
    }
    if let (Some(release_mm), Some(search_mm_s), Some(stop)) = (release_distance_mm, search_mm_s, known.stop) {
        let stop_mm = stopping_way_mm(search_mm_s, stop);
        if release_mm <= stop_mm {
            let rule = format!("must be above {stop_mm:.3}, the way of a stop from search_mm_s behind the switch");
            section.wrong("release_distance_mm", rule);
        }
    }
    if let (Some(search_mm), Some(release_mm), Some(search_mm_s), Some(latch_mm_s)) =
        (search_distance_mm, release_distance_mm, search_mm_s, latch_mm_s)
    {
        let index_mm = index_distance_mm.flatten().unwrap_or(0.0);
        let duration_s = search_mm / search_mm_s + (2.0 * release_mm + index_mm) / latch_mm_s;
        if duration_s > DURATION_MAX_S {
            let rule = format!(
                "must be quicker: {search_mm} mm of search and twice release_distance_mm with latch_mm_s may take \
                 {duration_s:.0} s, above {DURATION_MAX_S} s"
            );
            section.wrong("search_mm_s", rule);
        }
    }
    Some(HomingByControl {
        towards_positive: towards_positive?,
        switch_mm: switch_mm?,
        switch: switch?,
        search_distance_mm: search_distance_mm?,
        release_distance_mm: release_distance_mm?,
        resolution_mm: resolution_mm?,
        bounce_s: bounce_s?,
        skew_mm: skew_mm?,
        index: index_distance_mm?.map(|distance_mm| HomingIndex {
            distance_mm,
            probe: index_probe.flatten().map_or(1, |number| number as u8),
        }),
    })
}

/// Way of the quickest stop.
fn stopping_way_mm(velocity_mm_s: f64, stop: StopLimits) -> f64 {
    let (a, j) = (stop.acceleration_mm_s2, stop.jerk_mm_s3);
    let duration_s = if velocity_mm_s > a * a / j {
        velocity_mm_s / a + a / j
    } else {
        2.0 * (velocity_mm_s / j).sqrt()
    };
    0.5 * velocity_mm_s * duration_s
}

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
            section.wrong(
                "sequence",
                "must be the same for both belts of CoreXY, which move together",
            );
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
                section.wrong(
                    "position_mm",
                    together(map, format!("{square_mm}, where the axis is square,")),
                );
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
        section.wrong(
            "index_distance_mm",
            "is not for a joint with step pulses: it has no drive that could tell",
        );
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
                section.wrong(
                    "switch",
                    "must be \"pin\": there is no drive on the bus that could tell",
                );
                return;
            };
            let wanted = object_of(joint.drive_axis, DIGITAL_INPUTS);
            if node.inputs.iter().all(|object| object.index != wanted) {
                let name = &node.name;
                section.wrong(
                    "switch",
                    format!("\"0x{wanted:04X}/32\" must be among the inputs of {name}"),
                );
            }
        }
    }
}
