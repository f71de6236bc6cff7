//! The position loop of a joint: its drive's own, or one of the control.
//!
//! In:  `loop`, `pid` and the mode of a `[[joint]]`.
//! Out: gains of the loop that the control closes; nothing where the drive does.

use super::bus_types::{Exchange, Mapped, Node};
use super::modes::{DriveMode, mode_word};
use super::question::Bound;
use super::section::Section;
use cia402::profile::object_of;
use motion::rt::PidGains;

/// Greatest gain of any kind.
pub const GAIN_MAX: f64 = 1e6;
/// Longest lag of an amplifier that is believed, ms.
const LAG_MS_MAX: f64 = 1000.0;
/// Greatest share of the rated torque that 6071 holds.
const TORQUE_MAX: f64 = 32.767;
/// Share of a joint's velocity that its drive may be told, where the machine file says nothing: room for the loop to catch up.
const VELOCITY_SHARE: f64 = 1.2;

/// Gains, and what the amplifier takes until it follows, s, if that is known.
pub(super) type Loop = (PidGains, Option<f64>);

/// `Some(None)`: the drive holds the position that it is told.
pub(super) fn keys(
    section: &mut Section<'_, '_>,
    mode: Option<DriveMode>,
    velocity_mm_s: Option<f64>,
) -> Option<Option<Loop>> {
    let by_control = section.word("loop", &[("drive", false), ("pid", true)], false)?;
    let table = section.optional_section("pid");
    let gains = table.map(|table| table.whole(|table| gains(table, mode, velocity_mm_s)));
    match (mode?.is_position(), by_control, gains) {
        (true, true, _) => {
            let rule = "must be \"drive\" where the drive is told positions; \"pid\" is for mode = \"csv\" and \"cst\"";
            section.refused("loop", rule)
        }
        (true, false, Some(_)) => section.refused("pid", "is for loop = \"pid\""),
        (true, false, None) => Some(None),
        (false, false, _) => {
            let rule = "needs loop = \"pid\" beside it, as the drive holds no position then; or \"csp\", \"ip\"";
            section.refused("mode", rule)
        }
        (false, true, None) => {
            if !section.has("pid") {
                section.wrong("loop", "needs the gains beside it: pid = { p = 30.0 }");
            }
            None
        }
        (false, true, Some(gains)) => gains.map(Some),
    }
}

fn gains(table: &mut Section<'_, '_>, mode: Option<DriveMode>, velocity_mm_s: Option<f64>) -> Option<Loop> {
    let is_torque = mode == Some(DriveMode::Cst);
    let gain = Bound::Within(0.0, GAIN_MAX);
    let p = table.number("p", Bound::Positive(GAIN_MAX), None);
    let i = table.number("i", gain, 0.0);
    let d = table.number("d", gain, 0.0);
    let ff = [
        table.number("ff0", Bound::Size(GAIN_MAX), 0.0),
        table.number("ff1", Bound::Size(GAIN_MAX), if is_torque { 0.0 } else { 1.0 }),
        table.number("ff2", Bound::Size(GAIN_MAX), 0.0),
        table.number("ff3", Bound::Size(GAIN_MAX), 0.0),
    ];
    let bias = table.number("bias", Bound::Size(GAIN_MAX), 0.0);
    let dead_band = table.number("dead_band_mm", gain, 0.0);
    let error_max = table.number("error_max_mm", gain, 0.0);
    let integral_max = table.number("integral_max_mm_s", gain, 0.0);
    let derivative_max = table.number("derivative_max_mm_s", gain, 0.0);
    let ff_max = [
        table.number("ff1_max_mm_s", gain, 0.0),
        table.number("ff2_max_mm_s2", Bound::Within(0.0, 1e9), 0.0),
        table.number("ff3_max_mm_s3", Bound::Within(0.0, 1e12), 0.0),
    ];
    let most = if is_torque { TORQUE_MAX } else { GAIN_MAX };
    let output_max = match table.optional_number("output_max", Bound::Positive(most)) {
        Some(None) if is_torque => Some(1.0),
        Some(None) => velocity_mm_s.map(|velocity| VELOCITY_SHARE * velocity),
        given => given.flatten(),
    };
    if let (Some(output_max), Some(velocity)) = (output_max, velocity_mm_s.filter(|_| !is_torque))
        && output_max <= velocity
    {
        let rule = format!("must be above velocity_mm_s, {velocity}: the loop needs room to catch up");
        table.wrong("output_max", rule);
    }
    let lag_ms = table.optional_number("lag_ms", Bound::Within(0.0, LAG_MS_MAX))?;
    let [ff0, ff1, ff2, ff3] = ff;
    let [velocity_max, acceleration_max, jerk_max] = ff_max;
    let gains = PidGains {
        p: p?,
        i: i?,
        d: d?,
        ff: [ff0?, ff1?, ff2?, ff3?],
        bias: bias?,
        dead_band: dead_band?,
        error_max: error_max?,
        integral_max: integral_max?,
        derivative_max: derivative_max?,
        ff_max: [velocity_max?, acceleration_max?, jerk_max?],
        output_max: output_max?,
    };
    Some((gains, lag_ms.map(|lag_ms| lag_ms / 1000.0)))
}

/// Notes what of a joint and its node does not suit a loop of the control.
pub(super) fn suits(
    section: &mut Section<'_, '_>,
    mode: DriveMode,
    goes_on_alone: bool,
    node: Option<&Node>,
    axis: u8,
) {
    if goes_on_alone {
        let rule = "must not have connection_lost = 0: the drive has no position to hold, and would run on with its last set-point";
        section.wrong("reactions", rule);
    }
    if section.has("torque_per_mm_s2") {
        section.known(&["torque_per_mm_s2"]);
        let rule = "is for drives that hold their position themselves; a loop has ff2";
        section.wrong("torque_per_mm_s2", rule);
    }
    let Some(node) = node else { return };
    if !matches!(node.exchange, Exchange::Polled | Exchange::Chained) {
        section.wrong("loop", "needs a node whose process data are exchanged in every cycle");
    }
    let lacks = |payload: &[Mapped], index: u16| payload.iter().all(|object| object.index != index);
    for (payload, name, object) in [(&node.outputs, "outputs", 0x6060), (&node.inputs, "inputs", 0x6061)] {
        let object = object_of(axis, object);
        if lacks(payload, object) {
            let word = mode_word(mode);
            section.wrong(
                "mode",
                format!("needs \"0x{object:04X}/8\" among the {name} of its node: a drive that is not in mode {word:?} takes no target of it"),
            );
        }
    }
}
