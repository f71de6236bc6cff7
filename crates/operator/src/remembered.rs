//! What the machine remembers, for whoever asks: work offsets and tools.
//!
//! Lengths are in the unit of the machine, angles in degrees.

use crate::console::Operator;
use config::Config;
use machine::tables::Tables;
use motion::canon::{Axis, LengthUnit, Position};
use program::settings_with;
use protocol::{Journal, Offsets, Tool, Tools, WorkSystem};
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
    }
}

/// The tool table, and which one is in the spindle.
pub(super) fn tools(tables: &Tables, unit: LengthUnit) -> Tools {
    let tools = tables.tools().tools().map(|tool| Tool {
        tool: tool.number,
        pocket: tool.pocket,
        length: tool.offset[Axis::Z] / unit.mm(),
        diameter: tool.diameter_mm / unit.mm(),
        remark: tool.remark.clone(),
    });
    Tools {
        unit: unit_word(unit).to_owned(),
        in_spindle: tables.tool_in_spindle(),
        tools: tools.collect(),
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
