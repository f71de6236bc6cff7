//! PDO mapping strings, like `"0x60FE:1/32"`: what stands in the payloads, and what one node reads from another.
//!
//! In:  arrays of strings, the profile of the node, its device file.
//! Out: objects with their lengths, which the profile and the device take.

use super::document::{Item, Section};
use super::drive::mode_word;
use super::types::{DeviceDescription, DriveMode, Mapped, Profile, targets};
use obd::mapping::Direction;

/// Most octets of process data in one PReq or PRes.
const PAYLOAD_OCTETS_MAX: usize = 1490;
/// Most entries of one mapping object.
const ENTRIES_MAX: usize = 254;

/// What is known of a node when its mappings are read.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    pub(super) profile: Option<Profile>,
    pub(super) device: Option<&'a DeviceDescription>,
    /// In which its drive is run.
    pub(super) mode: DriveMode,
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

    /// What the control must send to and hear from a drive in a mode: of each row one, the usual one first.
    fn required_of_drives(self, mode: DriveMode) -> [&'static [(u16, u8)]; 2] {
        match self {
            Payload::Outputs => [&[(0x6040, 0)], targets(mode)],
            Payload::Inputs => [&[(0x6041, 0)], &[(0x6064, 0)]],
        }
    }

    /// Most octets and objects that the device takes or sends.
    fn limits(self, device: Option<&DeviceDescription>) -> (usize, usize) {
        let features = device.map(|device| &device.features);
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
        // A file that says 0 does not know.
        let limit = |own: Option<u16>, most| {
            own.map(usize::from)
                .filter(|own| *own > 0)
                .map_or(most, |own| own.min(most))
        };
        (limit(octets, PAYLOAD_OCTETS_MAX), limit(objects, ENTRIES_MAX))
    }
}

/// The objects of one payload; left out: what the device file maps, else what the profile usually has.
pub(super) fn payload(section: &mut Section<'_, '_>, payload: Payload, target: Target<'_>) -> Option<Vec<Mapped>> {
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
    let octets: usize = objects.iter().map(|object| usize::from(object.bits / 8)).sum();
    let (octets_max, objects_max) = payload.limits(target.device);
    let of = |of_all| match target.device {
        Some(device) if of_all => format!(", as {} says", device.file),
        Some(_) | None => String::new(),
    };
    if octets > octets_max {
        let said = of(octets_max < PAYLOAD_OCTETS_MAX);
        section.wrong(
            key,
            format!("must not hold more than {octets_max} octets{said}, holds {octets}"),
        );
        return None;
    }
    if objects.len() > objects_max {
        let said = of(objects_max < ENTRIES_MAX);
        section.wrong(key, format!("must not hold more than {objects_max} objects{said}"));
        return None;
    }
    if target.profile == Some(Profile::Cia402) {
        let targets = payload.required_of_drives(target.mode)[1];
        let held: Vec<&Mapped> = objects
            .iter()
            .filter(|object| targets.contains(&(object.index, object.sub)))
            .collect();
        if let [one, other, ..] = held[..] {
            // Only one of them would follow the motion; a drive that takes the other one would jump.
            section.wrong(
                key,
                format!("must not hold {one} beside {other}: a drive has one target"),
            );
            valid = false;
        }
        for (index, sub) in missing(payload, target.mode, &objects) {
            let object = usual(index, sub).to_string();
            let mode = match target.mode {
                DriveMode::Csp => String::new(),
                other => format!(" in mode {:?}", mode_word(other)),
            };
            section.wrong(
                key,
                format!("must hold {object:?}: a drive is not run{mode} without it"),
            );
            valid = false;
        }
    }
    valid.then_some(objects)
}

/// What a drive is not run without and `objects` do not hold.
fn missing(payload: Payload, mode: DriveMode, objects: &[Mapped]) -> Vec<(u16, u8)> {
    let holds = |wanted: &(u16, u8)| objects.iter().any(|object| (object.index, object.sub) == *wanted);
    payload
        .required_of_drives(mode)
        .into_iter()
        .filter(|row| !row.iter().any(holds))
        .filter_map(|row| row.first().copied())
        .collect()
}

/// An object of the drive profile with its usual length.
fn usual(index: u16, sub: u8) -> Mapped {
    let bits = length_of(index, sub).unwrap_or(32);
    Mapped { index, sub, bits }
}

fn left_out(section: &Section<'_, '_>, payload: Payload, target: Target<'_>) -> Option<Vec<Mapped>> {
    let profile = target.profile?;
    let Some(device) = target.device else {
        return Some(default_mapping(payload, profile, target.mode));
    };
    let own = device_mapping(device, payload);
    let enough = match profile {
        Profile::Cia402 => own
            .as_ref()
            .is_some_and(|own| missing(payload, target.mode, own).is_empty()),
        Profile::Io => own.is_some(),
    };
    if let Some(own) = own.filter(|_| enough) {
        return Some(own);
    }
    let objects = default_mapping(payload, profile, target.mode);
    let mut valid = true;
    for object in &objects {
        let refusal = device
            .may_map(object.index, object.sub, object.bits.into(), payload.direction())
            .err();
        if let Some(refusal) = refusal {
            let rule = format!(
                "is missing: of what the profile usually has, {object} does not fit {}: {refusal}",
                device.file
            );
            section.wrong(payload.key(), rule);
            valid = false;
        }
    }
    valid.then_some(objects)
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
    target: Target<'_>,
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
            Some(_) | None => {
                let fits = |device: &DeviceDescription| {
                    let refusal = device
                        .may_map(object.index, object.sub, object.bits.into(), direction)
                        .err()?;
                    Some(format!("does not fit {}: {refusal}", device.file))
                };
                match target.device.and_then(fits) {
                    None => return Some(object),
                    Some(rule) => rule,
                }
            }
        },
    };
    item.log.wrong(item.value.span(), key, rule, None);
    None
}

/// `0x60FE:1/32`; the sub-index is decimal and may be left out.
fn parse_mapped(text: &str) -> Option<Mapped> {
    let (object, bits) = text.split_once('/')?;
    let (index, sub) = parse_object(object)?;
    let bits = digits(bits).then(|| bits.parse().ok()).flatten()?;
    Some(Mapped { index, sub, bits })
}

/// `0x60FE:1`; the sub-index is decimal and may be left out.
pub(super) fn parse_object(text: &str) -> Option<(u16, u8)> {
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let index = index.strip_prefix("0x").or(index.strip_prefix("0X"))?;
    if !digits(index) || !digits(sub) {
        return None;
    }
    Some((u16::from_str_radix(index, 16).ok()?, sub.parse().ok()?))
}

fn digits(text: &str) -> bool {
    text.bytes().next().is_some_and(|octet| octet.is_ascii_hexdigit())
}

/// Length in bits of objects that CiA 402 lets be mapped; `None`: not in this table.
fn length_of(index: u16, sub: u8) -> Option<u8> {
    Some(match (index, sub) {
        (0x6060 | 0x6061, 0) => 8,
        (0x603F | 0x6040 | 0x6041 | 0x6071 | 0x6072 | 0x6074 | 0x6077 | 0x6078 | 0x60B2 | 0x60B8 | 0x60B9, 0) => 16,
        (
            0x6062..=0x6065 | 0x6069 | 0x606B | 0x606C | 0x607A | 0x60B0 | 0x60B1 | 0x60F4 | 0x60FC | 0x60FD | 0x60FF,
            0,
        ) => 32,
        (0x60BA..=0x60BD, 0) | (0x60FE | 0x60C1, 1) | (0x60FE, 2) => 32,
        _ => return None,
    })
}

/// What is mapped where the machine file does not say. Positions stand last: network analysers guess safety frames from
/// the first octets of a payload, and a position can look like one.
fn default_mapping(payload: Payload, profile: Profile, mode: DriveMode) -> Vec<Mapped> {
    let object = |index, sub, bits| Mapped { index, sub, bits };
    match (profile, payload) {
        (Profile::Cia402, Payload::Outputs) => {
            let (index, sub) = mode.target();
            vec![
                object(0x6040, 0, 16),
                object(0x6060, 0, 8),
                object(0x60FE, 1, 32),
                usual(index, sub),
            ]
        }
        (Profile::Cia402, Payload::Inputs) => vec![
            object(0x6041, 0, 16),
            object(0x6061, 0, 8),
            object(0x60FD, 0, 32),
            object(0x603F, 0, 16),
            object(0x6064, 0, 32),
            object(0x60F4, 0, 32),
        ],
        (Profile::Io, Payload::Outputs) => vec![object(0x6200, 1, 8), object(0x6200, 2, 8)],
        (Profile::Io, Payload::Inputs) => vec![object(0x6000, 1, 8), object(0x6000, 2, 8)],
    }
}
