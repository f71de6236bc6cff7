//! What the parameters of a request say of an order.

use super::value;
use crate::orders::{Jog, Jogged, Order, Source};
use crate::rpc::{Params, RpcError, code};
use bus::service::MailboxError;
use cia402::profile::AXES_MAX;
use config::JOINTS_MAX;
use config::SimFaultKind;
use glob::Pattern;
use hal_pins::scope::CHANNELS_MAX;
use machine::fault_order::{FAULT, FaultOrder};
use machine::tables::LifeChange;
use motion::canon::Axis;
use obd::AbortCode;
use program::tool_path::TOLERANCE_MIN_MM;
use program::{Change, ToolChange};
use protocol::Nothing;
use protocol::limits::{self, SIM_FAULTS, WORK_SYSTEMS};
use rt::joint_jog::JogMotion;
use scope::record::Mode;
use scope::stream::Wanted;
use scope::trigger::Trigger;
use serde_json::Value;
use std::fmt;

// What clients are told of bounds is what they are.
const _: () = {
    assert!(limits::JOINT_MAX == JOINTS_MAX as u64 - 1);
    assert!(limits::DRIVE_AXIS_MAX == AXES_MAX as u64 - 1);
    assert!(limits::SDO_VALUE_MAX == bus::SDO_VALUE_MAX);
    assert!(limits::PROGRAM_MAX == files::read::PROGRAM_MAX);
    assert!(limits::CHANNELS_MAX == CHANNELS_MAX);
    assert!(limits::SIM_FAULTS.len() == SimFaultKind::WORDS.len() + 1);
};

/// Longest line of MDI, octets.
const LINE_MAX: usize = gcode::LINE_OCTETS_MAX;

/// Lines that come together at the most, octets.
const LINES_OCTETS_MAX: usize = 65_536;

/// What "jog" is to do.
pub(super) fn jog(params: &Params) -> Result<Jog, RpcError> {
    let invalid = |what: &str| Err(RpcError::new(code::INVALID_PARAMS, what));
    let Some(what) = jogged(params)? else {
        return invalid("expected \"axis\" or \"joint\"");
    };
    let velocity_mm_s = params.real("velocity_mm_s")?;
    let motion = match (velocity_mm_s, params.real("distance_mm")?) {
        (None, _) => return invalid("parameter \"velocity_mm_s\": expected a number, it is missing"),
        (Some(0.0), _) => return invalid("parameter \"velocity_mm_s\": expected a velocity, got 0"),
        (Some(velocity_mm_s), None) => JogMotion::Run { velocity_mm_s },
        (Some(velocity_mm_s), Some(distance_mm)) => JogMotion::Advance {
            distance_mm,
            velocity_mm_s,
        },
    };
    Ok(Jog {
        what: Some(what),
        motion,
    })
}

/// What "scope.begin" is to show.
pub(super) fn wanted(params: &Params) -> Result<Wanted, RpcError> {
    let invalid = |what: String| RpcError::new(code::INVALID_PARAMS, what);
    let mode = match params.text("mode")? {
        None => None,
        Some(name) => Some(Mode::from_name(name).ok_or_else(|| {
            let what = format!("parameter \"mode\": expected auto, normal, single or roll, got {name:?}");
            invalid(what)
        })?),
    };
    let trigger = params.text("trigger")?.map(Trigger::parse).transpose();
    Ok(Wanted {
        pins: params.texts("pins", CHANNELS_MAX)?,
        trigger: trigger.map_err(|error| invalid(error.to_string()))?,
        mode,
        seconds: params.real("seconds")?,
        before_percent: params.real("before_percent")?.unwrap_or(0.0),
    })
}

/// The pattern of "hal.list".
pub(super) fn pattern(params: &Params) -> Result<Option<Pattern>, RpcError> {
    let pattern = params.text("pattern")?.map(Pattern::new).transpose();
    pattern.map_err(|error| RpcError::new(code::INVALID_PARAMS, format!("parameter \"pattern\": {error}")))
}

/// How far the way of a program may be off, mm.
pub(super) fn tolerance_mm(params: &Params) -> Result<f64, RpcError> {
    let tolerance_mm = params.real("tolerance_mm")?.unwrap_or(0.01);
    if tolerance_mm >= TOLERANCE_MIN_MM {
        return Ok(tolerance_mm);
    }
    let what = format!("parameter \"tolerance_mm\": expected a number from {TOLERANCE_MIN_MM} on, got {tolerance_mm}");
    Err(RpcError::new(code::INVALID_PARAMS, what))
}

/// What "parts.set" is to set.
pub(super) fn parts(params: &Params) -> Result<Order, RpcError> {
    let number = |name| match params.has(name) {
        true => params.number(name, 0, u64::from(u32::MAX)).map(Some),
        false => Ok(None),
    };
    match (number("count")?, number("target")?) {
        (None, None) => Err(RpcError::new(
            code::INVALID_PARAMS,
            "expected \"count\", \"target\" or both",
        )),
        (count, target) => Ok(Order::Parts { count, target }),
    }
}

/// What "spindle" is to do.
pub(super) fn spindle(params: &Params, rpm_max: f64) -> Result<Order, RpcError> {
    let invalid = |what: String| RpcError::new(code::INVALID_PARAMS, format!("parameter \"speed_rpm\": {what}"));
    match params.real("speed_rpm")? {
        None => Err(invalid("expected a number, it is missing".into())),
        Some(rpm) if rpm.abs() > rpm_max => Err(invalid(format!(
            "expected at most {rpm_max}, the highest speed of this spindle, got {rpm}"
        ))),
        Some(rpm) => Ok(Order::Spindle(rpm)),
    }
}

/// What "coolant" is to do.
pub(super) fn coolant(params: &Params) -> Result<Order, RpcError> {
    let flag = |name| params.has(name).then(|| params.flag(name)).transpose();
    match (flag("flood")?, flag("mist")?) {
        (None, None) => Err(RpcError::new(
            code::INVALID_PARAMS,
            "expected \"flood\", \"mist\" or both",
        )),
        (flood, mist) => Ok(Order::Coolant { flood, mist }),
    }
}

/// The share of "reverse".
pub(super) fn reverse_share(params: &Params) -> Result<f64, RpcError> {
    let percent = params.real("percent")?.unwrap_or(100.0);
    if percent > 0.0 && percent <= 100.0 {
        return Ok(percent / 100.0);
    }
    let what = format!("parameter \"percent\": expected a number above 0 and up to 100, got {percent}");
    Err(RpcError::new(code::INVALID_PARAMS, what))
}

/// The axis or joint of a jog, if one is given.
pub(super) fn jogged(params: &Params) -> Result<Option<Jogged>, RpcError> {
    let invalid = |what: String| RpcError::new(code::INVALID_PARAMS, what);
    let axis = axis(params)?.map(Jogged::Axis);
    if !params.has("joint") {
        return Ok(axis);
    }
    let joint = params.number("joint", 0, JOINTS_MAX as u64 - 1)? as usize;
    match axis {
        None => Ok(Some(Jogged::Joint(joint))),
        Some(_) => Err(invalid("expected \"axis\" or \"joint\", not both".into())),
    }
}

/// What concerns jogs under way: of one axis or joint, or all.
pub(super) fn jogging(params: &Params, motion: JogMotion) -> Result<Order, RpcError> {
    let what = jogged(params)?;
    Ok(Order::Jog(Jog { what, motion }))
}

/// The program of "program.run".
pub(super) fn source(params: &Params) -> Result<Source, RpcError> {
    let invalid = |what: &str| Err(RpcError::new(code::INVALID_PARAMS, what));
    match (params.text("path")?, params.text("name")?, params.text("text")?) {
        (Some(path), None, None) if path.starts_with('/') => Ok(Source::File(path.into())),
        (Some(path), None, None) => {
            let what = format!("parameter \"path\": expected an absolute path, got \"{path}\"");
            Err(RpcError::new(code::INVALID_PARAMS, what))
        }
        (None, name, Some(text)) => {
            let name = name.unwrap_or("program").to_owned();
            let text = text.to_owned();
            Ok(Source::Text { name, text })
        }
        (None, _, None) => invalid("expected \"path\", \"upload\", or \"text\" and \"name\""),
        (Some(_), _, _) => invalid("expected \"path\" alone, or \"text\" and \"name\""),
    }
}

/// The axis of a letter, if one is given.
fn axis(params: &Params) -> Result<Option<Axis>, RpcError> {
    let Some(text) = params.text("axis")? else {
        return Ok(None);
    };
    let mut letters = text.chars();
    let axis = letters.next().filter(|_| letters.as_str().is_empty());
    let axis = axis.and_then(Axis::from_letter);
    let wrong = || {
        let what = format!("parameter \"axis\": expected one of X Y Z A B C U V W, got \"{text}\"");
        RpcError::new(code::INVALID_PARAMS, what)
    };
    axis.ok_or_else(wrong).map(Some)
}

pub(super) fn needed<T>(value: Option<T>, name: &str, what: &str) -> Result<T, RpcError> {
    value.ok_or_else(|| {
        let what = format!("parameter \"{name}\": expected {what}, it is missing");
        RpcError::new(code::INVALID_PARAMS, what)
    })
}

/// The work system of a word, 1 for G54 to 9 for G59.3, if one is given.
fn system(params: &Params) -> Result<Option<u8>, RpcError> {
    let Some(text) = params.text("system")? else {
        return Ok(None);
    };
    let number = (1..)
        .zip(WORK_SYSTEMS)
        .find(|(_, word)| word.eq_ignore_ascii_case(text));
    let wrong = || {
        let what = format!("parameter \"system\": expected one of G54 to G59, G59.1 to G59.3, got \"{text}\"");
        RpcError::new(code::INVALID_PARAMS, what)
    };
    number.map(|(number, _)| Some(number)).ok_or_else(wrong)
}

/// The line of "mdi".
pub(super) fn line(params: &Params) -> Result<String, RpcError> {
    let invalid = |what: String| Err(RpcError::new(code::INVALID_PARAMS, what));
    match needed(params.text("line")?, "line", "a text")? {
        line if line.trim().is_empty() => invalid("parameter \"line\": expected a line of G-code, it is empty".into()),
        line if line.contains(['\n', '\r']) => invalid("parameter \"line\": expected one line, got several".into()),
        line if line.len() > LINE_MAX => invalid(format!("parameter \"line\": expected {LINE_MAX} octets at the most")),
        line => Ok(line.to_owned()),
    }
}

/// The lines of "mdi.stream".
pub(super) fn lines(params: &Params) -> Result<Order, RpcError> {
    let text = needed(params.text("text")?, "text", "a text")?;
    if text.len() > LINES_OCTETS_MAX {
        let what = format!("parameter \"text\": expected {LINES_OCTETS_MAX} octets at the most");
        return Err(RpcError::new(code::INVALID_PARAMS, what));
    }
    if !text.is_empty() && !text.ends_with('\n') {
        let what = "parameter \"text\": expected whole lines, the last one has no end";
        return Err(RpcError::new(code::INVALID_PARAMS, what));
    }
    let wait = params.has("wait") && params.flag("wait")?;
    let text = text.to_owned();
    Ok(Order::Lines { text, wait })
}

/// How "program.start" begins.
pub(super) fn start(params: &Params) -> Result<Order, RpcError> {
    let from_line = match params.has("from_line") {
        true => Some(params.number("from_line", 1, u64::from(u32::MAX))? as u32),
        false => None,
    };
    let yes = params.has("yes") && params.flag("yes")?;
    let runs = match params.has("repeat") {
        true => params.number("repeat", 1, u64::from(u32::MAX))? as u32,
        false => 1,
    };
    if from_line.is_some() && runs > 1 {
        let what = "expected \"from_line\" or \"repeat\", not both";
        return Err(RpcError::new(code::INVALID_PARAMS, what));
    }
    let dry_feed_min = params.real("dry_run_feed_mm_min")?;
    if let Some(feed) = dry_feed_min.filter(|feed| *feed <= 0.0) {
        let what = format!("parameter \"dry_run_feed_mm_min\": expected a feed above 0, got {feed}");
        return Err(RpcError::new(code::INVALID_PARAMS, what));
    }
    let revision = match params.has("revision") {
        true => Some(params.number("revision", 0, u64::MAX)?),
        false => None,
    };
    Ok(Order::Start {
        from_line,
        yes,
        runs,
        dry_feed_min,
        revision,
    })
}

/// What "touch_off" is to do.
pub(super) fn touch_off(params: &Params) -> Result<Change, RpcError> {
    let axis = needed(axis(params)?, "axis", "a letter")?;
    let value = needed(params.real("value")?, "value", "a number")?;
    let system = system(params)?;
    match (params.has("tool"), system) {
        (false, system) => Ok(Change::TouchOffWork { axis, value, system }),
        (true, None) => Ok(Change::TouchOffTool {
            axis,
            value,
            tool: tool_number(params)?,
        }),
        (true, Some(_)) => Err(RpcError::new(
            code::INVALID_PARAMS,
            "expected \"system\" or \"tool\", not both",
        )),
    }
}

/// What "offset.set" is to do.
pub(super) fn offset(params: &Params) -> Result<Change, RpcError> {
    if let Some(degrees) = params.real("rotation_degrees")? {
        if let Some(other) = ["axis", "value"].iter().find(|name| params.has(name)) {
            let what = format!("expected \"rotation_degrees\" alone, got \"{other}\", too");
            return Err(RpcError::new(code::INVALID_PARAMS, what));
        }
        let system = system(params)?;
        return Ok(Change::Rotation { degrees, system });
    }
    Ok(Change::Offset {
        axis: needed(axis(params)?, "axis", "a letter")?,
        value: needed(params.real("value")?, "value", "a number")?,
        system: system(params)?,
    })
}

/// What "tool.set" is to do.
pub(super) fn tool(params: &Params) -> Result<Change, RpcError> {
    let count = |name| match params.has(name) {
        true => params
            .number(name, 0, u64::from(u32::MAX))
            .map(|count| Some(count as u32)),
        false => Ok(None),
    };
    let minutes = |name| match params.real(name)? {
        Some(minutes) if !(0.0..=MINUTES_MAX).contains(&minutes) => Err(RpcError::new(
            code::INVALID_PARAMS,
            format!("\"{name}\" is a number from 0 to {MINUTES_MAX}"),
        )),
        minutes => Ok(minutes),
    };
    let change = ToolChange {
        number: 0,
        length: params.real("length")?,
        diameter: params.real("diameter")?,
        pocket: count("pocket")?,
        remark: params.text("remark")?.map(str::to_owned),
        length_wear: params.real("length_wear")?,
        diameter_wear: params.real("diameter_wear")?,
        life: LifeChange {
            minutes: minutes("life_minutes")?,
            parts: count("life_parts")?,
            used_minutes: minutes("used_minutes")?,
            used_parts: count("used_parts")?,
            sister: count("sister")?,
        },
    };
    if change == ToolChange::default() {
        return Err(RpcError::new(
            code::INVALID_PARAMS,
            "expected \"length\", \"diameter\", \"pocket\", \"remark\", \"length_wear\", \"diameter_wear\", \"life_minutes\", \
             \"life_parts\", \"used_minutes\", \"used_parts\" or \"sister\"",
        ));
    }
    let number = tool_number(params)?;
    Ok(Change::Tool(ToolChange { number, ..change }))
}

/// Greatest life of a tool, min: some years.
const MINUTES_MAX: f64 = 1e7;

/// The tool of "tool.delete".
pub(super) fn deleted_tool(params: &Params) -> Result<Change, RpcError> {
    Ok(Change::DeleteTool {
        number: tool_number(params)?,
    })
}

fn tool_number(params: &Params) -> Result<u32, RpcError> {
    Ok(params.number("tool", 0, u64::from(u32::MAX))? as u32)
}

/// What mends all.
const NO_FAULT: &str = "none";

/// What "sim.fault" asks of a drive.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    /// In words.
    pub(super) drive: String,
    pub(super) axis: u8,
    kind: String,
    pub(super) order: FaultOrder,
}

/// The node of "sim.fault", and what is asked of it.
pub(super) fn sim_fault(params: &Params) -> Result<(u64, Fault), RpcError> {
    /// What the object holds.
    const LONGEST_S: f64 = 6553.5;
    let invalid = |what: String| Err(RpcError::new(code::INVALID_PARAMS, what));
    let node = params.number("node", 1, 239)?;
    let axis = match params.has("axis") {
        true => params.number("axis", 0, u64::from(AXES_MAX) - 1)? as u8,
        false => 0,
    };
    let word = needed(params.text("kind")?, "kind", "a text")?;
    let found = SimFaultKind::WORDS.iter().find(|(known, _)| *known == word);
    if found.is_none() && word != NO_FAULT {
        let known = SIM_FAULTS.join(", ");
        return invalid(format!("parameter \"kind\": expected one of {known}, got \"{word}\""));
    }
    let lasts_100ms = match params.real("for_s")? {
        None => 0,
        Some(_) if word == NO_FAULT => return invalid("parameter \"for_s\": \"none\" has no time".into()),
        Some(seconds) if (0.1..=LONGEST_S).contains(&seconds) => (10.0 * seconds).round() as u16,
        Some(seconds) => {
            return invalid(format!(
                "parameter \"for_s\": expected a number from 0.1 to {LONGEST_S}, got {seconds}"
            ));
        }
    };
    let order = FaultOrder {
        kind: found.map(|(_, kind)| *kind),
        lasts_100ms,
    };
    let fault = Fault {
        drive: String::new(),
        axis,
        kind: word.to_owned(),
        order,
    };
    Ok((node, fault))
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Fault {
            drive,
            axis,
            kind,
            order,
        } = self;
        write!(f, "simulated fault asked of {drive}, axis {axis}: {kind}")?;
        match order.lasts_100ms {
            0 => Ok(()),
            tenths => write!(f, " for {:.1} s", f64::from(tenths) / 10.0),
        }
    }
}

impl Fault {
    /// What the drive has made of it.
    pub(super) fn answer(&self, result: Result<Vec<u8>, MailboxError>) -> Result<Value, RpcError> {
        let (drive, sub) = (&self.drive, self.axis + 1);
        match result {
            Ok(_) => value(&Nothing {}),
            Err(MailboxError::Aborted(AbortCode::NO_SUB_INDEX)) => {
                let what = format!(
                    "{drive} has no axis {}, if it is a simulated drive: it has no 0x{FAULT:04X}:{sub}",
                    self.axis
                );
                Err(RpcError::new(code::NODE_ABORT, what))
            }
            Err(MailboxError::Aborted(abort)) => {
                let what = format!(
                    "{drive} is no simulated drive: 0x{FAULT:04X}:{sub}: {} (0x{:08X})",
                    abort.text(),
                    abort.0
                );
                let kind = match abort {
                    AbortCode::NO_OBJECT => code::NODE_NO_OBJECT,
                    _ => code::NODE_ABORT,
                };
                Err(RpcError::new(kind, what))
            }
            Err(MailboxError::Failed(what)) => Err(RpcError::new(code::NODE, format!("{drive}: {what}"))),
        }
    }
}
