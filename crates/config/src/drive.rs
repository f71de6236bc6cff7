//! What a joint says of its drive: the mode in which it is run, feed-forward, its units, and how it stops.
//!
//! In:  `mode`, `torque_per_mm_s2` and `[joint.reactions]`, the node with its device file.
//! Out: values that the drive takes, as far as its device file tells.

use super::bus_types::{Mapped, Node};
use super::drive_profile::DriveProfile;
use super::factor_group::{self, FactorGroup};
use super::modes::{DriveMode, MODES, Reactions, SPINDLE_MODES, mode_word, touch_probe_objects};
use super::question::Bound;
use super::section::Section;
use cia402::profile::mode::{HOMING, Offered, supported_bit};
use cia402::profile::{AXES_MAX, object_of};
use toml::de::DeTable;

/// `reactions` of a joint or of the drive of the spindle; what is left out is as the profile of the drive has it.
pub(super) fn reactions(section: &mut Section<'_, '_>, axis: u8, node: Option<&Node>) -> Option<Reactions> {
    let known = node.and_then(|node| node.drive.as_ref());
    let usual = known.map_or(Reactions::default(), |known| known.reactions);
    let device = node.and_then(|node| node.device.as_ref());
    let given = section.optional_table("reactions", |table| Reactions::read(table, axis, device, &usual))?;
    Some(given.unwrap_or(usual))
}

/// `drive_axis`: which axis of its node a drive is; judged by the profile, and by the device file where the mapping is.
pub(super) fn drive_axis(section: &mut Section<'_, '_>, node: Option<&Node>) -> Option<u8> {
    let axis = section.integer("drive_axis", 0..=AXES_MAX - 1, 0)?;
    let known = node.and_then(|node| node.drive.as_ref());
    if let Some(known) = known.filter(|known| axis >= known.axes) {
        let rule = match known.axes {
            1 => format!("must be left out: {} has one axis", known.name),
            axes => format!("must be below {axes}, the axes of {}, counted from 0", known.name),
        };
        section.wrong("drive_axis", rule);
    }
    Some(axis)
}

/// Feed-forward of torque; the drive must get 60B2.
pub(super) fn torque_per_mm_s2(section: &mut Section<'_, '_>, axis: u8, node: Option<&Node>) -> Option<Option<f64>> {
    /// Ten times the rated torque for 1 mm/s².
    const MOST: f64 = 10_000.0;
    let Some(value) = section.optional_number("torque_per_mm_s2", Bound::Positive(MOST))? else {
        return Some(None);
    };
    let offset = (object_of(axis, 0x60B2), 0);
    if node.is_some_and(|node| node.outputs.iter().all(|object| (object.index, object.sub) != offset)) {
        let rule = format!("\"0x{:04X}/16\" must be among the outputs of its node", offset.0);
        return section.refused("torque_per_mm_s2", rule);
    }
    Some(Some(value))
}

/// The touch probe of the drive at which the machine's probe is wired; its objects must be mapped.
pub(super) fn touch_probe(section: &mut Section<'_, '_>, axis: u8, node: Option<&Node>) -> Option<Option<u8>> {
    let Some(number) = section.optional_integer("touch_probe", 1..=2)? else {
        return Some(None);
    };
    let [function, inputs @ ..] = touch_probe_objects(axis, number);
    let Some(node) = node else {
        return Some(Some(number));
    };
    let has = |list: &[Mapped], index: u16| list.iter().any(|object| (object.index, object.sub) == (index, 0));
    let mut complete = true;
    if !has(&node.outputs, function) {
        let rule = format!("\"0x{function:04X}/16\" must be among the outputs of its node");
        section.wrong("touch_probe", rule);
        complete = false;
    }
    for index in inputs.into_iter().filter(|index| !has(&node.inputs, *index)) {
        let bits = if index == inputs[0] { 16 } else { 32 };
        let rule = format!("\"0x{index:04X}/{bits}\" must be among the inputs of its node");
        section.wrong("touch_probe", rule);
        complete = false;
    }
    complete.then_some(Some(number))
}

/// What a drive is there for, as far as mappings ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DriveUse {
    /// Id of its node.
    pub(super) node: i64,
    /// Which axis of that it is.
    pub(super) axis: u8,
    /// `None`: the usual one of the drive.
    pub(super) mode: Option<DriveMode>,
    /// It turns the spindle, and its position is nothing to the control.
    pub(super) is_spindle: bool,
}

/// What drives all joints and the spindle, as far as that can be read; what is wrong with it is told where it is read.
pub(super) fn uses(document: &DeTable<'_>) -> Vec<DriveUse> {
    let read = |table: &DeTable<'_>, is_spindle| {
        let number = |key: &str| {
            let number = table.get(key)?.get_ref().as_integer()?;
            i64::from_str_radix(number.as_str(), number.radix()).ok()
        };
        let word = table.get("mode").and_then(|mode| mode.get_ref().as_str());
        let words: &[(&str, DriveMode)] = if is_spindle { &SPINDLE_MODES } else { &MODES };
        let mode = word.and_then(|word| words.iter().find(|(name, _)| *name == word));
        Some(DriveUse {
            node: number("node")?,
            axis: number("drive_axis")
                .and_then(|axis| u8::try_from(axis).ok())
                .unwrap_or(0),
            mode: mode.map(|(_, mode)| *mode),
            is_spindle,
        })
    };
    let tables = document.get("joint").and_then(|joints| joints.get_ref().as_array());
    let tables = tables
        .into_iter()
        .flatten()
        .filter_map(|joint| joint.get_ref().as_table());
    let spindle = document.get("spindle").and_then(|spindle| spindle.get_ref().as_table());
    let spindle = spindle.and_then(|spindle| spindle.get("drive")?.get_ref().as_table());
    // Without a mode it is an output that takes a speed.
    let spindle = spindle.filter(|drive| drive.contains_key("mode"));
    tables
        .filter_map(|joint| read(joint, false))
        .chain(spindle.and_then(|drive| read(drive, true)))
        .collect()
}

/// The mode in which the drive is run.
pub(super) fn mode(section: &mut Section<'_, '_>, drive: Option<&DriveProfile>) -> Option<DriveMode> {
    section.word("mode", &MODES, drive.map_or(DriveMode::Csp, DriveProfile::usual_mode))
}

/// Whether the drive has the modes in which it is to be run, as far as its profile or its device file says (6502).
pub(super) fn modes_are_offered(
    section: &mut Section<'_, '_>,
    (node, axis): (&Node, u8),
    mode: DriveMode,
    homes: bool,
) {
    let mode_object = object_of(axis, 0x6060);
    let tells_mode = node.outputs.iter().any(|object| object.index == mode_object);
    if homes && node.drive.is_some() && !tells_mode {
        let rule = format!(
            "must be by = \"control\": \"0x{mode_object:04X}/8\" is not among the outputs of its node, and the drive could not be \
             changed to homing"
        );
        section.wrong("homing", rule);
    }
    let of_profile = node.drive.as_ref().and_then(|drive| Some((drive.modes?, &drive.name)));
    let of_file = || {
        let device = node.device.as_ref()?;
        let object = device.object(object_of(axis, 0x6502), 0)?;
        let value = object.actual.as_ref().or(object.default.as_ref())?.integer()?;
        Some((u32::try_from(value).ok()?, &device.file))
    };
    let Some((supported, file)) = of_profile.or_else(of_file) else {
        return;
    };
    // A file that says 0 does not know.
    if supported != 0 && supported & supported_bit(mode.code()) == 0 {
        let word = mode_word(mode);
        section.wrong(
            "mode",
            format!(
                "must be one that {file} offers (6502h): {}; it is {word:?}",
                Offered(supported)
            ),
        );
    }
    if supported != 0 && homes && supported & supported_bit(HOMING) == 0 {
        section.wrong(
            "homing",
            format!(
                "must be by = \"control\": {file} offers no homing (6502h), only {}",
                Offered(supported)
            ),
        );
    }
}

/// Position units of a turn of the motor: of the group, else of the profile.
pub(super) fn units_per_turn(group: &FactorGroup, known: Option<&DriveProfile>) -> Option<[u64; 2]> {
    let of_profile = || known?.increments_per_turn.map(|increments| [increments.into(), 1]);
    group.units_per_turn().or_else(of_profile)
}

/// `factor_group` of a joint or of the drive of the spindle; what is left out is as the profile of the drive has it.
pub(super) fn factor_group(section: &mut Section<'_, '_>, axis: u8, node: Option<&Node>) -> Option<FactorGroup> {
    let usual = node.and_then(|node| node.drive.as_ref());
    let usual = usual.map_or(FactorGroup::default(), |known| known.factor_group);
    let Some(mut table) = section.optional_section("factor_group") else {
        return (!section.has("factor_group")).then_some(usual);
    };
    let group = FactorGroup::read(&mut table, &usual)?;
    if let Some(node) = node {
        judge(&mut table, &group, axis, node);
    }
    table.done();
    Some(group)
}

/// Whether the drive has the objects, and whether its `sdo` says the same of them.
fn judge(table: &mut Section<'_, '_>, group: &FactorGroup, axis: u8, node: &Node) {
    for (of_first, sub, value) in group.objects() {
        let index = object_of(axis, of_first);
        let key = factor_group::OBJECTS
            .iter()
            .find(|(_, object)| *object == of_first)
            .map(|(key, _)| *key);
        let Some(key) = key.filter(|key| table.has(key)) else {
            continue;
        };
        let without = node
            .drive
            .as_ref()
            .filter(|drive| drive.without.contains(&(of_first, sub)));
        let file = node
            .device
            .as_ref()
            .filter(|device| device.object(index, sub).is_none());
        let lacks = without.map(|drive| &drive.name).or(file.map(|device| &device.file));
        if let Some(name) = lacks {
            table.wrong(key, format!("the drive has no 0x{index:04X}:{sub}, as {name} says"));
            continue;
        }
        let other = node
            .writes
            .iter()
            .find(|write| (write.index, write.sub) == (index, sub));
        if other.is_some_and(|write| write.value != value.to_le_bytes()) {
            table.wrong(
                key,
                format!("must be what `sdo` of the node writes into 0x{index:04X}:{sub}, or stand there no more"),
            );
        }
    }
}
