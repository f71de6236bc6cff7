//! PDO mapping strings, like `"0x60FE:1/32"`: what stands in the payloads, and what one node reads from another.
//!
//! In:  arrays of strings, the profile of the node, its device file.
//! Out: objects with their lengths, which the profile and the device take.

use super::document::Item;
use super::drive_profile::{DriveProfile, MappingLimits};
use super::esi::have_padding;
use super::modes::{DriveMode, mode_word, targets};
use super::objects::{Mapped, Profile, digits, parse_object};
use super::section::Section;
use cia402::profile::{axis_of, object_of};
use obd::device::DeviceDescription;
use obd::mapping::Direction;

/// Most octets of process data in one PReq or PRes.
const PAYLOAD_OCTETS_MAX: usize = 1490;
/// Most entries of one mapping object.
const ENTRIES_MAX: usize = 254;

/// What is known of a node when its mappings are read.
pub(super) struct Target<'a> {
    pub(super) profile: Option<Profile>,
    pub(super) device: Option<&'a DeviceDescription>,
    /// What is known of its kind of drive.
    pub(super) drive: Option<&'a DriveProfile>,
    /// What its axes are there for.
    pub(super) axes: &'a [AxisUse],
    /// What it exchanges as it comes, by its ESI file: outputs, inputs.
    pub(super) usual: [Option<Vec<Mapped>>; 2],
}

/// One axis of a drive.
#[derive(Clone, Copy)]
pub(super) struct AxisUse {
    /// Its number at its node.
    pub(super) axis: u8,
    pub(super) mode: DriveMode,
    /// It turns the spindle, and its position is nothing to the control.
    pub(super) is_spindle: bool,
}

impl AxisUse {
    /// Of a drive that nothing uses yet.
    pub(super) const BENCH: AxisUse = AxisUse {
        axis: 0,
        mode: DriveMode::Csp,
        is_spindle: false,
    };
}

/// One of the two payloads of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Payload {
    Outputs,
    Inputs,
}

impl Payload {
    fn key(self) -> &'static str {
        match self {
            Payload::Outputs => "outputs",
            Payload::Inputs => "inputs",
        }
    }

    /// As the node sees it.
    fn direction(self) -> Direction {
        match self {
            Payload::Outputs => Direction::Receive,
            Payload::Inputs => Direction::Transmit,
        }
    }

    fn mapping_index(self) -> u16 {
        match self {
            Payload::Outputs => 0x1600,
            Payload::Inputs => 0x1A00,
        }
    }

    /// What the control must send to and hear from an axis of a drive: of each row one, the usual one first; objects of axis 0.
    fn required_of_drives(self, axis: &AxisUse) -> [&'static [(u16, u8)]; 2] {
        const VELOCITY: [(u16, u8); 1] = [DriveMode::Pv.actual_velocity()];
        const VL_VELOCITY: [(u16, u8); 1] = [DriveMode::Vl.actual_velocity()];
        match self {
            Payload::Outputs => [&[(0x6040, 0)], targets(axis.mode)],
            Payload::Inputs if axis.is_spindle && axis.mode == DriveMode::Vl => [&[(0x6041, 0)], &VL_VELOCITY],
            Payload::Inputs if axis.is_spindle => [&[(0x6041, 0)], &VELOCITY],
            Payload::Inputs => [&[(0x6041, 0)], &[(0x6064, 0)]],
        }
    }

    fn of_profile(self, drive: &DriveProfile) -> &MappingLimits {
        match self {
            Payload::Outputs => &drive.outputs,
            Payload::Inputs => &drive.inputs,
        }
    }

    /// Most octets and objects that the device takes or sends, and who says so of each.
    fn limits(self, target: &Target<'_>) -> [(usize, String); 2] {
        let features = target.device.map(|device| &device.features);
        let (octets, objects) = match self {
            Payload::Outputs => (
                features.and_then(|it| it.preq_octets_max),
                features.and_then(|it| it.rpdo_objects),
            ),
            Payload::Inputs => (
                features.and_then(|it| it.pres_octets_max),
                features.and_then(|it| it.tpdo_objects),
            ),
        };
        let profile = target.drive.map(|drive| (self.of_profile(drive), &drive.name));
        let limit = |own: Option<u16>, of_profile: Option<u16>, most: usize| {
            // A file that says 0 does not know.
            let of_file = own.filter(|own| *own > 0).zip(target.device.map(|device| &device.file));
            let of_profile = of_profile.zip(profile.map(|(_, name)| name));
            let least = of_file.into_iter().chain(of_profile).min_by_key(|(own, _)| *own);
            match least.filter(|(own, _)| usize::from(*own) < most) {
                Some((own, who)) => (usize::from(own), format!(", as {who} says")),
                None => (most, String::new()),
            }
        };
        let of_profile = profile.map(|(limits, _)| limits);
        [
            limit(octets, of_profile.and_then(|it| it.octets_max), PAYLOAD_OCTETS_MAX),
            limit(objects, of_profile.and_then(|it| it.objects_max), ENTRIES_MAX),
        ]
    }
}

/// The objects of one payload; left out: what the device file maps, else what the profile usually has.
pub(super) fn payload(section: &mut Section<'_, '_>, payload: Payload, target: &Target<'_>) -> Option<Vec<Mapped>> {
    let key = payload.key();
    let path = section.key(key);
    let Some(list) = section.optional(key) else {
        return left_out(section, payload, target);
    };
    let mut objects: Vec<Mapped> = Vec::new();
    let items = list.items(&path)?;
    let mut valid = true;
    for (index, item) in items.into_iter().enumerate() {
        match mapped(item, &format!("{path}[{index}]"), payload.direction(), target, &objects) {
            Some(object) => objects.push(object),
            None => valid = false,
        }
    }
    if !valid {
        return None;
    }
    let octets = octets(&objects);
    let [(octets_max, of_octets), (objects_max, of_objects)] = payload.limits(target);
    if octets > octets_max {
        let rule = format!("must not hold more than {octets_max} octets{of_octets}, holds {octets}");
        return section.refused(key, rule);
    }
    if objects.len() > objects_max {
        let rule = format!("must not hold more than {objects_max} objects{of_objects}");
        return section.refused(key, rule);
    }
    let drives = target.axes.iter().filter(|_| target.profile == Some(Profile::Cia402));
    for axis in drives {
        let targets = payload.required_of_drives(axis)[1];
        let own = |object: &&Mapped| {
            let (of, index) = axis_of(object.index);
            of == axis.axis && targets.contains(&(index, object.sub))
        };
        let held: Vec<&Mapped> = objects.iter().filter(own).collect();
        if let [one, other, ..] = held[..] {
            // Only one of them would follow the motion; a drive that takes the other one would jump.
            let rule = format!("must not hold {one} beside {other}: a drive has one target");
            section.wrong(key, rule);
            valid = false;
        }
        for object in missing(payload, axis, &objects) {
            let object = object.to_string();
            let mode = match axis.mode {
                DriveMode::Csp => String::new(),
                other => format!(" in mode {:?}", mode_word(other)),
            };
            let rule = format!("must hold {object:?}: a drive is not run{mode} without it");
            section.wrong(key, rule);
            valid = false;
        }
    }
    valid.then_some(objects)
}

/// What an axis of a drive is not run without and `objects` do not hold.
fn missing(payload: Payload, axis: &AxisUse, objects: &[Mapped]) -> Vec<Mapped> {
    let holds = |(index, sub): &(u16, u8)| {
        let wanted = (object_of(axis.axis, *index), *sub);
        objects.iter().any(|object| (object.index, object.sub) == wanted)
    };
    payload
        .required_of_drives(axis)
        .into_iter()
        .filter(|row| !row.iter().any(holds))
        .filter_map(|row| row.first().copied())
        .map(|(index, sub)| usual(axis.axis, index, sub))
        .collect()
}

/// An object of the drive profile, given as that of the first axis, with its usual length.
fn usual(axis: u8, index: u16, sub: u8) -> Mapped {
    let bits = length_of(index, sub).unwrap_or(32);
    let index = object_of(axis, index);
    Mapped { index, sub, bits }
}

fn octets(objects: &[Mapped]) -> usize {
    objects.iter().map(|object| usize::from(object.bits / 8)).sum()
}

fn left_out(section: &Section<'_, '_>, payload: Payload, target: &Target<'_>) -> Option<Vec<Mapped>> {
    let profile = target.profile?;
    let [outputs, inputs] = &target.usual;
    let usual = match payload {
        Payload::Outputs => outputs,
        Payload::Inputs => inputs,
    };
    let own = target.device.and_then(|device| device_mapping(device, payload));
    let own = own.or_else(|| usual.clone());
    let enough = |own: &Vec<Mapped>| match profile {
        Profile::Cia402 => !have_padding(own) && target.axes.iter().all(|axis| missing(payload, axis, own).is_empty()),
        Profile::Io => true,
    };
    if let Some(own) = own.filter(enough) {
        return Some(own);
    }
    let objects = default_mapping(payload, profile, target);
    let mut valid = true;
    for object in &objects {
        if let Some(refusal) = refusal(object, payload.direction(), target) {
            let rule = format!("is missing: of what the profile usually has, {object} {refusal}");
            section.wrong(payload.key(), rule);
            valid = false;
        }
    }
    valid.then_some(objects)
}

/// Why an object cannot be mapped, as far as the device file or the profile of the drive tell.
fn refusal(object: &Mapped, direction: Direction, target: &Target<'_>) -> Option<String> {
    if let Some(device) = target.device
        && let Err(refusal) = device.may_map(object.index, object.sub, object.bits.into(), direction)
    {
        return Some(format!("does not fit {}: {refusal}", device.file));
    }
    let drive = target.drive?;
    let limits = match direction {
        Direction::Receive => &drive.outputs,
        Direction::Transmit => &drive.inputs,
    };
    if limits.takes(object) {
        return None;
    }
    let all = limits.objects.iter().flatten();
    let all: Vec<_> = all
        .map(|(index, sub)| match sub {
            0 => format!("0x{index:04X}"),
            sub => format!("0x{index:04X}:{sub}"),
        })
        .collect();
    Some(format!("cannot be mapped in {}, only {}", drive.name, all.join(", ")))
}

/// What the device file maps, if it maps whole octets without gaps.
fn device_mapping(device: &DeviceDescription, payload: Payload) -> Option<Vec<Mapped>> {
    let mut end = 0_u32;
    let objects: Option<Vec<_>> = device
        .mapping(payload.mapping_index())
        .into_iter()
        .map(|entry| {
            let bits = u8::try_from(entry.bit_length)
                .ok()
                .filter(|bits| matches!(bits, 8 | 16 | 32 | 64))?;
            let follows = u32::from(entry.bit_offset) == end;
            end += u32::from(bits);
            follows.then_some(Mapped {
                index: entry.index,
                sub: entry.sub,
                bits,
            })
        })
        .collect();
    objects.filter(|objects| !objects.is_empty())
}

/// One mapping string; noted if the profile or the device do not take it, or if it stands among those `before`.
pub(super) fn mapped(
    item: Item<'_, '_>,
    key: &str,
    direction: Direction,
    target: &Target<'_>,
    before: &[Mapped],
) -> Option<Mapped> {
    let text = item.text(key)?;
    let twice = |object: &Mapped| {
        before
            .iter()
            .any(|other| (other.index, other.sub) == (object.index, object.sub))
    };
    let rule = match parse_mapped(text) {
        None => "must be an object with its length, like \"0x6041/16\" or \"0x60FE:1/32\"".to_owned(),
        Some(object) if object.index < 0x1000 => "must be an object from 0x1000 on; below are data types".to_owned(),
        Some(object) if !matches!(object.bits, 8 | 16 | 32 | 64) => {
            "must have a length of 8, 16, 32 or 64 bits".to_owned()
        }
        Some(object) if twice(&object) => "is mapped twice".to_owned(),
        Some(object) => match length_of(object.index, object.sub) {
            Some(bits) if target.profile == Some(Profile::Cia402) && bits != object.bits => {
                format!("must have the length {bits} that the drive profile gives it")
            }
            Some(_) | None => match refusal(&object, direction, target) {
                None => return Some(object),
                Some(rule) => rule,
            },
        },
    };
    item.refused(key, rule)
}

/// `0x60FE:1/32`; the sub-index is decimal and may be left out.
fn parse_mapped(text: &str) -> Option<Mapped> {
    let (object, bits) = text.split_once('/')?;
    let (index, sub) = parse_object(object)?;
    let bits = digits(bits).then(|| bits.parse().ok()).flatten()?;
    Some(Mapped { index, sub, bits })
}

/// Length in bits of objects that CiA 402 lets be mapped; `None`: not in this table.
fn length_of(index: u16, sub: u8) -> Option<u8> {
    Some(match (axis_of(index).1, sub) {
        (0x6060 | 0x6061, 0) => 8,
        (0x603F..=0x6044 | 0x6071 | 0x6072 | 0x6074 | 0x6077 | 0x6078 | 0x60B2 | 0x60B8 | 0x60B9, 0) => 16,
        (
            0x6062..=0x6065 | 0x6069 | 0x606B | 0x606C | 0x607A | 0x60B0 | 0x60B1 | 0x60F4 | 0x60FC | 0x60FD | 0x60FF,
            0,
        ) => 32,
        (0x60BA..=0x60BD, 0) | (0x60FE | 0x60C1, 1) | (0x60FE, 2) => 32,
        _ => return None,
    })
}

/// What is mapped where the machine file does not say. Positions stand last: network analysers guess safety frames from
/// the first octets of a payload, and a position can look like one. What a drive can be run without is left out where its profile
/// does not take it.
fn default_mapping(payload: Payload, profile: Profile, target: &Target<'_>) -> Vec<Mapped> {
    let object = |index, sub, bits| Mapped { index, sub, bits };
    match (profile, payload) {
        (Profile::Cia402, _) => {
            let axes = target.axes.iter();
            let mut objects: Vec<(Mapped, bool)> = axes.flat_map(|axis| default_of_axis(payload, axis)).collect();
            let takes = |object: &Mapped| refusal(object, payload.direction(), target).is_none();
            if target.drive.is_some() {
                objects.retain(|(object, is_needed)| *is_needed || takes(object));
                let [(octets_max, _), (objects_max, _)] = payload.limits(target);
                let too_much = |all: &[(Mapped, bool)]| {
                    let bits: usize = all.iter().map(|(object, _)| usize::from(object.bits)).sum();
                    all.len() > objects_max || bits / 8 > octets_max
                };
                while too_much(&objects)
                    && let Some(last) = objects.iter().rposition(|(_, is_needed)| !is_needed)
                {
                    objects.remove(last);
                }
            }
            objects.into_iter().map(|(object, _)| object).collect()
        }
        (Profile::Io, Payload::Outputs) => vec![object(0x6200, 1, 8), object(0x6200, 2, 8)],
        (Profile::Io, Payload::Inputs) => vec![object(0x6000, 1, 8), object(0x6000, 2, 8)],
    }
}

/// The usual objects of an axis, and whether it is not run without.
fn default_of_axis(payload: Payload, axis: &AxisUse) -> Vec<(Mapped, bool)> {
    let (target, velocity) = (axis.mode.target(), axis.mode.actual_velocity());
    let objects: &[(u16, u8)] = match (payload, axis.is_spindle) {
        (Payload::Outputs, false) => &[(0x6040, 0), (0x6060, 0), (0x60FE, 1), target],
        (Payload::Inputs, false) => &[
            (0x6041, 0),
            (0x6061, 0),
            (0x60FD, 0),
            (0x603F, 0),
            (0x6064, 0),
            (0x60F4, 0),
        ],
        (Payload::Outputs, true) => &[(0x6040, 0), (0x6060, 0), target],
        (Payload::Inputs, true) => &[(0x6041, 0), (0x6061, 0), (0x603F, 0), (0x6077, 0), velocity],
    };
    let needed = payload.required_of_drives(axis).map(|row| row[0]);
    let objects = objects.iter();
    objects
        .map(|(index, sub)| (usual(axis.axis, *index, *sub), needed.contains(&(*index, *sub))))
        .collect()
}
