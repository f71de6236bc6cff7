//! What the machine remembers, for whoever asks: work offsets and tools.
//!
//! Lengths are in the unit of the machine, angles in degrees.

use crate::console::{Operator, changed};
use config::Config;
use machine::tables::Tables;
use motion::canon::{Axis, LengthUnit, Position};
use program::settings_with;
use protocol::{Journal, Message, Offsets, Tool, ToolLife, Tools, WorkSystem, message};
use std::collections::BTreeMap;

/// Entries of one answer.
const ENTRIES_MAX: usize = 500;

/// Values of the axes that are there.
fn by_letter(position: &Position, axes: impl Iterator<Item = Axis>, unit: LengthUnit) -> BTreeMap<String, f64> {
    let values = axes.map(|axis| {
        let scale = if axis.is_rotary() { 1.0 } else { unit.mm() };
        (axis.letter().to_string(), position[axis] / scale)
    });
    values.collect()
}

fn unit_word(unit: LengthUnit) -> &'static str {
    match unit {
        LengthUnit::Millimetre => "mm",
        LengthUnit::Inch => "inch",
    }
}

/// G54 to G59.3 and G92: origins in machine coordinates, rotations. `system`: the one in force, 1 for G54.
pub(super) fn offsets(tables: &Tables, config: &Config, system: u8) -> Offsets {
    let settings = settings_with(config, tables, Position::ZERO);
    let axes = || config.axes.iter().map(|map| map.axis);
    let systems = settings.work_offsets.iter().zip(settings.work_rotations_degrees);
    let systems = (1..=9_u8).zip(systems).map(|(number, (origin, degrees))| WorkSystem {
        system: system_word(number),
        active: number == system,
        origin: by_letter(origin, axes(), config.unit),
        rotation_degrees: degrees,
    });
    Offsets {
        unit: unit_word(config.unit).to_owned(),
        systems: systems.collect(),
        g92: by_letter(&settings.g92_offset, axes(), config.unit),
        g92_active: settings.g92_active,
        g28: kept(tables, config, G28),
        g30: kept(tables, config, G30),
    }
}

/// First parameters of the places of G28 and G30, and of G92.
const G28: u16 = 5161;
const G30: u16 = 5181;
const G92: u16 = 5211;
/// First parameter of the origin of G54; those of the other systems follow, 20 apart, each with its rotation behind.
const ORIGINS: u16 = 5221;
const SYSTEMS: u16 = 9;
const AXES: u16 = 9;

/// Values of axes that are kept from this parameter on; lengths are in the unit of the machine.
fn kept(tables: &Tables, config: &Config, first: u16) -> BTreeMap<String, f64> {
    let value = |number: u16| {
        let parameters = tables.parameters();
        let found = parameters.binary_search_by_key(&number, |entry| entry.0);
        found.map_or(0.0, |at| parameters[at].1)
    };
    let axes = config.axes.iter().map(|map| map.axis);
    axes.map(|axis| (axis.letter().to_string(), value(first + axis as u16)))
        .collect()
}

/// What a parameter is that an operator knows by another name.
fn parameter(number: u16) -> Option<Message> {
    let axis = |first: u16| Axis::ALL[usize::from(number - first)].letter().to_string();
    let of = |first: u16| (first..first + AXES).contains(&number);
    if of(G28) {
        return Some(message!(
            "changed.place",
            "{code} {axis}",
            code = "G28",
            axis = axis(G28)
        ));
    }
    if of(G30) {
        return Some(message!(
            "changed.place",
            "{code} {axis}",
            code = "G30",
            axis = axis(G30)
        ));
    }
    if of(G92) {
        return Some(message!(
            "changed.place",
            "{code} {axis}",
            code = "G92",
            axis = axis(G92)
        ));
    }
    let (system, rest) = (number.checked_sub(ORIGINS)? / 20, (number - ORIGINS) % 20);
    let name = system_word(system as u8 + 1);
    match rest {
        _ if system >= SYSTEMS => None,
        0..AXES => Some(message!(
            "changed.origin",
            "{system} {axis}, origin",
            system = name,
            axis = Axis::ALL[usize::from(rest)].letter().to_string()
        )),
        AXES => Some(message!("changed.rotation", "{system}, rotation", system = name)),
        _ => None,
    }
}

/// What of work systems, places and tools is otherwise than before, a sentence each.
pub(super) fn changes(before: &Tables, after: &Tables) -> Vec<Message> {
    let mut told = Vec::new();
    let known = before.parameters();
    for (number, to) in after.parameters() {
        let found = known.binary_search_by_key(number, |entry| entry.0);
        let from = found.map_or(0.0, |at| known[at].1);
        if from != *to
            && let Some(what) = parameter(*number)
        {
            told.push(changed(what, from, *to));
        }
    }
    let unit = after.tools().unit().mm();
    for tool in after.tools().tools() {
        let number = tool.number;
        let Some(old) = before.tools().by_number(number) else {
            told.push(message!(
                "changed.tool_added",
                "T{tool} added to the tool table",
                tool = number
            ));
            continue;
        };
        let [was, is] = [before, after].map(|tables| tables.tools().wear(number));
        for (what, from, to) in [
            (
                message!("changed.tool_length_wear", "T{tool}, wear of the length", tool = number),
                was.length_mm,
                is.length_mm,
            ),
            (
                message!(
                    "changed.tool_diameter_wear",
                    "T{tool}, wear of the diameter",
                    tool = number
                ),
                was.diameter_mm,
                is.diameter_mm,
            ),
        ] {
            if from != to {
                told.push(changed(what, from / unit, to / unit));
            }
        }
        if old == tool {
            continue;
        }
        let lengths = Axis::ALL
            .into_iter()
            .filter(|axis| old.offset[*axis] != tool.offset[*axis]);
        for axis in lengths {
            let scale = if axis.is_rotary() { 1.0 } else { unit };
            let what = match axis {
                Axis::Z => message!("changed.tool_length", "T{tool}, length", tool = number),
                _ => message!(
                    "changed.tool_offset",
                    "T{tool}, offset {axis}",
                    tool = number,
                    axis = axis.letter().to_string()
                ),
            };
            told.push(changed(what, old.offset[axis] / scale, tool.offset[axis] / scale));
        }
        if old.diameter_mm != tool.diameter_mm {
            let what = message!("changed.tool_diameter", "T{tool}, diameter", tool = number);
            told.push(changed(what, old.diameter_mm / unit, tool.diameter_mm / unit));
        }
        if old.pocket != tool.pocket {
            let what = message!("changed.tool_pocket", "T{tool}, pocket", tool = number);
            told.push(changed(what, f64::from(old.pocket), f64::from(tool.pocket)));
        }
        if old.remark != tool.remark {
            let what = message!("changed.tool_remark", "T{tool}, remark", tool = number);
            told.push(message!(
                "changed.text",
                "{what}: \"{from}\" -> \"{to}\"",
                what = what,
                from = &old.remark,
                to = &tool.remark
            ));
        }
    }
    for tool in before.tools().tools() {
        if after.tools().by_number(tool.number).is_none() {
            told.push(message!(
                "changed.tool_deleted",
                "T{tool} deleted from the tool table",
                tool = tool.number
            ));
        }
    }
    // A program that sets up everything anew would bury the rest.
    if told.len() > TOLD_MAX {
        let left = told.len() - TOLD_MAX;
        told.truncate(TOLD_MAX);
        told.push(message!(
            "changed.more",
            "{count} more values of offsets and tools",
            count = left
        ));
    }
    told
}

/// Changes of one order or program that are told one by one.
const TOLD_MAX: usize = 20;

/// The tool table, and which one is in the spindle.
pub(super) fn tools(tables: &Tables, unit: LengthUnit) -> Tools {
    let tools = tables.tools().tools().map(|tool| Tool {
        tool: tool.number,
        pocket: tool.pocket,
        length: tool.offset[Axis::Z] / unit.mm(),
        diameter: tool.diameter_mm / unit.mm(),
        remark: tool.remark.clone(),
        length_wear: tables.tools().wear(tool.number).length_mm / unit.mm(),
        diameter_wear: tables.tools().wear(tool.number).diameter_mm / unit.mm(),
        life: tables.life(tool.number),
        worn_out: tables.life(tool.number).is_over(),
    });
    Tools {
        unit: unit_word(unit).to_owned(),
        in_spindle: tables.tool_in_spindle(),
        tools: tools.collect(),
    }
}

/// For how long a tool has been used.
fn used(life: &ToolLife) -> Message {
    let tenths = |minutes: f64| (minutes * 10.0).round() / 10.0;
    let minutes = tenths(life.used_minutes);
    let parts = life.used_parts;
    match (life.minutes.map(tenths), life.parts) {
        (None, None) => message!(
            "tool.used",
            "used for {minutes} min, {parts} parts",
            minutes = minutes,
            parts = parts
        ),
        (Some(of), None) => message!(
            "tool.used_minutes",
            "used for {minutes} of {of} min",
            minutes = minutes,
            of = of
        ),
        (None, Some(of)) => message!(
            "tool.used_parts",
            "used for {parts} of {of} parts",
            parts = parts,
            of = of
        ),
        (Some(of_minutes), Some(of_parts)) => message!(
            "tool.used_both",
            "used for {minutes} of {of_minutes} min, {parts} of {of_parts} parts",
            minutes = minutes,
            of_minutes = of_minutes,
            parts = parts,
            of_parts = of_parts
        ),
    }
}

/// What of a tool's life is otherwise than before.
pub(super) fn life_changes(tool: u32, before: &ToolLife, after: &ToolLife) -> Vec<Message> {
    let mut told = Vec::new();
    let [was, is] = [before, after].map(|life| ToolLife { sister: None, ..*life });
    if was != is {
        let used = used(after);
        told.push(message!(
            "changed.tool_life",
            "T{tool}: {used}",
            tool = tool,
            used = used
        ));
    }
    if before.sister != after.sister {
        let what = message!("changed.tool_sister", "T{tool}, sister tool", tool = tool);
        let number = |sister: Option<u32>| f64::from(sister.unwrap_or(0));
        told.push(changed(what, number(before.sister), number(after.sister)));
    }
    told
}

/// The life of a tool is over.
pub(super) fn life_over(tool: u32, tables: &Tables) -> Message {
    let used = used(&tables.life(tool));
    match tables.sisters().get(&tool) {
        Some(sister) => message!(
            "tool.life_over",
            "T{tool}: its life is over ({used}); from the next program on T{sister} takes its place",
            tool = tool,
            used = used,
            sister = *sister
        ),
        None => message!(
            "tool.life_over_alone",
            "T{tool}: its life is over ({used}), and no sister tool can take its place: put in a new one, and set its use to 0",
            tool = tool,
            used = used
        ),
    }
}

/// Entries of the journal behind a number, the oldest first, as many as one answer holds.
pub(super) fn journal(operator: &Operator, since: u64) -> Journal {
    let entries = operator.journal();
    let behind = entries.partition_point(|entry| entry.seq <= since);
    let rest = &entries[behind..];
    let told = &rest[..rest.len().min(ENTRIES_MAX)];
    Journal {
        entries: told.to_vec(),
        more: told.len() < rest.len(),
        last: operator.log().last(),
        on_disk: operator.log().last_on_disk(),
    }
}

/// G54 to G59.3.
fn system_word(number: u8) -> String {
    match number {
        7..=9 => format!("G59.{}", number - 6),
        _ => format!("G{}", 53 + number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use program::{Change, ToolChange, changed as change};
    use std::path::Path;

    #[test]
    fn a_change_is_told_with_what_was_before() {
        let config = config::parse(include_str!("../../../configs/mill3-demo.toml"), Path::new("demo.toml")).unwrap();
        let mut tables = Tables::read(&config).unwrap();
        let origin = tables.work_offset(config.unit)[0][Axis::X];
        let mut told = |what: &Change| {
            let before = tables.clone();
            tables.adopt(change(&config, &tables, Position::ZERO, None, what).unwrap());
            let told = changes(&before, &tables);
            told.into_iter().map(|message| message.text).collect::<Vec<_>>()
        };
        let tool = |length, remark: &str| {
            Change::Tool(ToolChange {
                number: 5,
                length,
                remark: Some(remark.into()),
                ..ToolChange::default()
            })
        };
        let offset = Change::Offset {
            axis: Axis::X,
            value: 12.5,
            system: None,
        };
        assert_eq!(told(&offset), [format!("G54 X, origin: {origin} -> 12.5")]);
        assert!(told(&offset).is_empty(), "it is so already");
        let rotation = Change::Rotation {
            degrees: 15.0,
            system: Some(9),
        };
        assert_eq!(told(&rotation), ["G59.3, rotation: 0 -> 15"]);
        assert_eq!(
            told(&tool(Some(80.25), "drill")),
            ["T5, length: 0 -> 80.25", "T5, remark: \"\" -> \"drill\""]
        );
        assert_eq!(
            told(&Change::DeleteTool { number: 5 }),
            ["T5 deleted from the tool table"]
        );
        assert_eq!(told(&tool(None, "again")), ["T5 added to the tool table"]);
    }
}
