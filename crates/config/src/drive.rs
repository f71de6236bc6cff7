//! What a joint says of its drive: the mode in which it is run, feed-forward, and how the drive stops.
//!
//! In:  `mode`, `torque_per_mm_s2` and `[joint.reactions]`, the node with its device file.
//! Out: values that the drive takes, as far as its device file tells.

use super::document::{Bound, Section};
use super::types::{DeviceDescription, DriveProfile, Mapped, Node};
pub use cia402::Mode as DriveMode;
use cia402::profile::AXES_MAX;
use cia402::profile::mode::{HOMING, Offered, supported_bit};
use cia402::profile::object_of;
use obd::device::Value;
use toml::de::DeTable;

/// Objects that take the target of a drive in a mode, the usual one first; one of them stands among the outputs of its node.
///
/// 6062 is the position demand, which the profile has the drive tell. A published controller for two-axis machines writes it
/// instead, and its drives take it for the target.
pub fn targets(mode: DriveMode) -> &'static [(u16, u8)] {
    const POSITION_DEMAND: (u16, u8) = (0x6062, 0);
    const CSP: [(u16, u8); 2] = [DriveMode::Csp.target(), POSITION_DEMAND];
    const IP: [(u16, u8); 2] = [DriveMode::Ip.target(), POSITION_DEMAND];
    const PP: [(u16, u8); 1] = [DriveMode::Pp.target()];
    const VELOCITY: [(u16, u8); 1] = [DriveMode::Csv.target()];
    const TORQUE: [(u16, u8); 1] = [DriveMode::Cst.target()];
    const VL: [(u16, u8); 1] = [DriveMode::Vl.target()];
    match mode {
        DriveMode::Csp => &CSP,
        DriveMode::Ip => &IP,
        DriveMode::Pp => &PP,
        DriveMode::Csv | DriveMode::Pv => &VELOCITY,
        DriveMode::Cst | DriveMode::Tq => &TORQUE,
        DriveMode::Vl => &VL,
    }
}

/// The word of the machine file for a mode.
pub(super) fn mode_word(mode: DriveMode) -> &'static str {
    let found = MODES.iter().chain(&SPINDLE_MODES).find(|(_, other)| *other == mode);
    found.map_or("another", |(word, _)| word)
}

/// What a drive does when it stops, as its manual numbers it; what is `None` stays as the drive has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reactions {
    /// 605A: at a quick stop; left out 2, the quick-stop ramp and then off.
    pub quick_stop: Option<i16>,
    /// 605B: when it is shut down while enabled.
    pub shutdown: Option<i16>,
    /// 605C: when its operation is disabled.
    pub disable: Option<i16>,
    /// 605D: at a halt.
    pub halt: Option<i16>,
    /// 605E: at a fault.
    pub fault: Option<i16>,
    /// 6007: when it hears nothing of the control any more.
    pub connection_lost: Option<i16>,
}

impl Reactions {
    /// Objects and values that are written while the drive is configured.
    pub fn writes(&self) -> impl Iterator<Item = (u16, i16)> {
        /// Without it a drive may hold its position with power on, or run out.
        const QUICK_STOP_RAMP: i16 = 2;
        let all = [
            (0x605A, self.quick_stop.or(Some(QUICK_STOP_RAMP))),
            (0x605B, self.shutdown),
            (0x605C, self.disable),
            (0x605D, self.halt),
            (0x605E, self.fault),
            (0x6007, self.connection_lost),
        ];
        all.into_iter().filter_map(|(index, value)| Some((index, value?)))
    }
}

/// `reactions` of a joint or of the drive of the spindle; what is left out is as the profile of the drive has it.
pub(super) fn reactions(section: &mut Section<'_, '_>, axis: u8, node: Option<&Node>) -> Option<Reactions> {
    let known = node.and_then(|node| node.drive.as_ref());
    let usual = known.map_or(Reactions::default(), |known| known.reactions);
    match section.optional_section("reactions") {
        None if section.has("reactions") => None,
        None => Some(usual),
        Some(mut table) => {
            let device = node.and_then(|node| node.device.as_ref());
            let reactions = reactions_of(&mut table, axis, device, &usual);
            table.done();
            reactions
        }
    }
}

/// The table `reactions`; what is left out is as `usual`.
pub(super) fn reactions_of(
    table: &mut Section<'_, '_>,
    axis: u8,
    device: Option<&DeviceDescription>,
    usual: &Reactions,
) -> Option<Reactions> {
    let mut reaction = |key, index| reaction(table, key, object_of(axis, index), device);
    let quick_stop = reaction("quick_stop", 0x605A);
    let shutdown = reaction("shutdown", 0x605B);
    let disable = reaction("disable", 0x605C);
    let halt = reaction("halt", 0x605D);
    let fault = reaction("fault", 0x605E);
    let connection_lost = reaction("connection_lost", 0x6007);
    Some(Reactions {
        quick_stop: quick_stop?.or(usual.quick_stop),
        shutdown: shutdown?.or(usual.shutdown),
        disable: disable?.or(usual.disable),
        halt: halt?.or(usual.halt),
        fault: fault?.or(usual.fault),
        connection_lost: connection_lost?.or(usual.connection_lost),
    })
}

fn reaction(
    table: &mut Section<'_, '_>,
    key: &'static str,
    index: u16,
    device: Option<&DeviceDescription>,
) -> Option<Option<i16>> {
    let value = table.optional_integer(key, i16::MIN.into()..=i16::MAX.into())?;
    let (Some(value), Some(device)) = (value, device) else {
        return Some(value.map(|value| value as i16));
    };
    let Some(object) = device.object(index, 0) else {
        table.wrong(
            key,
            format!("the drive has no 0x{index:04X}: it does not stand in {}", device.file),
        );
        return None;
    };
    let limit = |limit: &Option<Value>| limit.as_ref().and_then(Value::integer);
    let (low, high) = (limit(&object.low), limit(&object.high));
    let value_of_file = i128::from(value);
    if low.is_some_and(|low| value_of_file < low) || high.is_some_and(|high| value_of_file > high) {
        let side = |limit: Option<i128>| limit.map_or_else(|| "any".to_owned(), |limit| limit.to_string());
        let rule = format!(
            "this drive offers {} to {} for 0x{index:04X}, as {} says",
            side(low),
            side(high),
            device.file
        );
        table.wrong(key, rule);
        return None;
    }
    Some(Some(value as i16))
}

/// `drive_axis`: which axis of its node a drive is; judged by the profile, and by the device file where the mapping is.
pub(super) fn drive_axis(section: &mut Section<'_, '_>, node: Option<&Node>) -> Option<u8> {
    let axis = section.integer("drive_axis", 0..=i64::from(AXES_MAX) - 1, 0)? as u8;
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
    let Some(item) = section.optional("torque_per_mm_s2") else {
        return Some(None);
    };
    let value = item.number(&section.key("torque_per_mm_s2"), Bound::Positive(MOST))?;
    let offset = (object_of(axis, 0x60B2), 0);
    if node.is_some_and(|node| node.outputs.iter().all(|object| (object.index, object.sub) != offset)) {
        let rule = format!("\"0x{:04X}/16\" must be among the outputs of its node", offset.0);
        section.wrong("torque_per_mm_s2", rule);
        return None;
    }
    Some(Some(value))
}

/// Objects of a touch probe of an axis: function, status, and the positions of its rising and its falling edge.
pub fn touch_probe_objects(axis: u8, number: u8) -> [u16; 4] {
    let [rising, falling] = if number == 1 {
        [0x60BA, 0x60BB]
    } else {
        [0x60BC, 0x60BD]
    };
    [0x60B8, 0x60B9, rising, falling].map(|index| object_of(axis, index))
}

/// The touch probe of the drive at which the machine's probe is wired; its objects must be mapped.
pub(super) fn touch_probe(section: &mut Section<'_, '_>, axis: u8, node: Option<&Node>) -> Option<Option<u8>> {
    let Some(number) = section.optional_integer("touch_probe", 1..=2)? else {
        return Some(None);
    };
    let [function, inputs @ ..] = touch_probe_objects(axis, number as u8);
    let Some(node) = node else {
        return Some(Some(number as u8));
    };
    let has = |list: &[Mapped], index: u16| list.iter().any(|object| (object.index, object.sub) == (index, 0));
    let mut complete = true;
    if !has(&node.outputs, function) {
        section.wrong(
            "touch_probe",
            format!("\"0x{function:04X}/16\" must be among the outputs of its node"),
        );
        complete = false;
    }
    for index in inputs.into_iter().filter(|index| !has(&node.inputs, *index)) {
        let bits = if index == inputs[0] { 16 } else { 32 };
        let rule = format!("\"0x{index:04X}/{bits}\" must be among the inputs of its node");
        section.wrong("touch_probe", rule);
        complete = false;
    }
    complete.then_some(Some(number as u8))
}

/// Modes of a drive that turns the spindle.
pub(super) const SPINDLE_MODES: [(&str, DriveMode); 3] =
    [("vl", DriveMode::Vl), ("pv", DriveMode::Pv), ("csv", DriveMode::Csv)];

const MODES: [(&str, DriveMode); 4] = [
    ("csp", DriveMode::Csp),
    ("ip", DriveMode::Ip),
    ("csv", DriveMode::Csv),
    ("cst", DriveMode::Cst),
];

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
