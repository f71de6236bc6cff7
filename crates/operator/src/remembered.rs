//! What the machine remembers, for whoever asks: work offsets and tools.
//!
//! Lengths are in the unit of the machine, angles in degrees.

use crate::console::Operator;
use config::Config;
use machine::tables::Tables;
use motion::canon::{Axis, LengthUnit, Position};
use program::settings_with;
use serde_json::{Map, Value, json};

/// Entries of one answer.
const ENTRIES_MAX: usize = 500;

/// Values of the axes that are there.
fn by_letter(position: &Position, axes: impl Iterator<Item = Axis>, unit: LengthUnit) -> Value {
    let values = axes.map(|axis| {
        let scale = if axis.is_rotary() { 1.0 } else { unit.mm() };
        (axis.letter().to_string(), json!(position[axis] / scale))
    });
    Value::Object(values.collect::<Map<_, _>>())
}

fn unit_word(unit: LengthUnit) -> &'static str {
    match unit {
        LengthUnit::Millimetre => "mm",
        LengthUnit::Inch => "inch",
    }
}

/// G54 to G59.3 and G92: origins in machine coordinates, rotations. `system`: the one in force, 1 for G54.
pub(super) fn offsets(tables: &Tables, config: &Config, system: u8) -> Value {
    let settings = settings_with(config, tables, Position::ZERO);
    let axes = || config.axes.iter().map(|map| map.axis);
    let systems = settings.work_offsets.iter().zip(settings.work_rotations_degrees);
    let systems: Vec<Value> = (1..=9_u8)
        .zip(systems)
        .map(|(number, (origin, degrees))| {
            json!({
                "system": system_word(number),
                "active": number == system,
                "origin": by_letter(origin, axes(), config.unit),
                "rotation_degrees": degrees,
            })
        })
        .collect();
    json!({
        "unit": unit_word(config.unit),
        "systems": systems,
        "g92": by_letter(&settings.g92_offset, axes(), config.unit),
        "g92_active": settings.g92_active,
    })
}

/// The tool table, and which one is in the spindle.
pub(super) fn tools(tables: &Tables, unit: LengthUnit) -> Value {
    let tools: Vec<Value> = tables
        .tools()
        .tools()
        .map(|tool| {
            json!({
                "tool": tool.number,
                "pocket": tool.pocket,
                "length": tool.offset[Axis::Z] / unit.mm(),
                "diameter": tool.diameter_mm / unit.mm(),
                "remark": tool.remark,
            })
        })
        .collect();
    json!({ "unit": unit_word(unit), "in_spindle": tables.tool_in_spindle(), "tools": tools })
}

/// Entries of the journal behind a number, the oldest first, as many as one answer holds.
pub(super) fn journal(operator: &Operator, since: u64) -> Value {
    let entries = operator.journal();
    let behind = entries.partition_point(|entry| entry.seq <= since);
    let rest = &entries[behind..];
    let told = &rest[..rest.len().min(ENTRIES_MAX)];
    json!({
        "entries": told,
        "more": told.len() < rest.len(),
        "last": operator.log().last(),
        "on_disk": operator.log().last_on_disk(),
    })
}

/// G54 to G59.3.
fn system_word(number: u8) -> String {
    match number {
        7..=9 => format!("G59.{}", number - 6),
        _ => format!("G{}", 53 + number),
    }
}
