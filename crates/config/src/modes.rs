//! What CiA 402 lets a drive be told: modes, homing methods, touch probes, and reactions to stops.

use super::section::{Section, keys};
pub use cia402::Mode as DriveMode;
use cia402::profile::object_of;
use obd::device::{DeviceDescription, Value};

/// Modes of a drive that turns the spindle.
pub(super) const SPINDLE_MODES: [(&str, DriveMode); 3] =
    [("vl", DriveMode::Vl), ("pv", DriveMode::Pv), ("csv", DriveMode::Csv)];

pub(super) const MODES: [(&str, DriveMode); 4] = [
    ("csp", DriveMode::Csp),
    ("ip", DriveMode::Ip),
    ("csv", DriveMode::Csv),
    ("cst", DriveMode::Cst),
];

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

keys! {
    /// What a drive does when it stops, as its manual numbers it; what is `None` stays as the drive has it. What is left out is as `usual`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Reactions(table, axis: u8, device: Option<&DeviceDescription>, usual: &Reactions) {
        /// 605A: at a quick stop; left out 2, the quick-stop ramp and then off.
        pub quick_stop: Option<i16> = reaction(table, "quick_stop", object_of(axis, 0x605A), device, usual.quick_stop),
        /// 605B: when it is shut down while enabled.
        pub shutdown: Option<i16> = reaction(table, "shutdown", object_of(axis, 0x605B), device, usual.shutdown),
        /// 605C: when its operation is disabled.
        pub disable: Option<i16> = reaction(table, "disable", object_of(axis, 0x605C), device, usual.disable),
        /// 605D: at a halt.
        pub halt: Option<i16> = reaction(table, "halt", object_of(axis, 0x605D), device, usual.halt),
        /// 605E: at a fault.
        pub fault: Option<i16> = reaction(table, "fault", object_of(axis, 0x605E), device, usual.fault),
        /// 6007: when it hears nothing of the control any more.
        pub connection_lost: Option<i16> =
            reaction(table, "connection_lost", object_of(axis, 0x6007), device, usual.connection_lost),
    }
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

fn reaction(
    table: &mut Section<'_, '_>,
    key: &'static str,
    index: u16,
    device: Option<&DeviceDescription>,
    usual: Option<i16>,
) -> Option<Option<i16>> {
    let value = table.optional_integer(key, i16::MIN..=i16::MAX)?;
    let (Some(value), Some(device)) = (value, device) else {
        return Some(value.or(usual));
    };
    let Some(object) = device.object(index, 0) else {
        let rule = format!("the drive has no 0x{index:04X}: it does not stand in {}", device.file);
        return table.refused(key, rule);
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
        return table.refused(key, rule);
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

pub(super) const METHOD_RULE: &str = "must be a homing method of CiA 402: 1 to 14, 17 to 30, 33, 34, 35 or 37";

/// Homing methods of CiA 402 that a drive does by itself; 15, 16, 31, 32 are reserved, 36 needs a touch probe.
pub(super) fn is_homing_method(method: i8) -> bool {
    matches!(method, 1..=14 | 17..=30 | 33 | 34 | 35 | 37)
}
