//! What an operator sets by hand: touched-off axes, offsets, tools.
//!
//! In:  what is to change, where the machine stands, the modes of MDI.
//! Out: offsets, parameters and tools as they are then. Nothing moves, and no mode changes; the length of a tool whose G43 is in force is
//! for who keeps the modes to follow ([`Change::tool`]).
//!
//! The interpreter carries it out (G10), so that a touch-off from outside and one in a program are the same.

use super::settings_with;
use config::Config;
use gcode::{Interpreter, Modes, Settings, Tool, Wear};
use machine::tables::{LifeChange, Tables};
use motion::canon::{Axis, LengthUnit, Position};

/// What the machine remembers otherwise from now on. Values are in the unit of the machine, or degrees.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// In a work system (1: G54; `None`: the one in force) the axis reads this value where it stands.
    TouchOffWork { axis: Axis, value: f64, system: Option<u8> },
    /// With the length of this tool in force, the axis reads this value where it stands.
    TouchOffTool { axis: Axis, value: f64, tool: u32 },
    /// Origin of a work system (1: G54; `None`: the one in force) on one axis, in machine coordinates.
    Offset { axis: Axis, value: f64, system: Option<u8> },
    /// Rotation of a work system (1: G54; `None`: the one in force) about Z of its origin, degrees.
    Rotation { degrees: f64, system: Option<u8> },
    /// What the table has of a tool; what is `None` stays. One that the table does not have is added.
    Tool(ToolChange),
    /// Takes a tool out of the table.
    DeleteTool { number: u32 },
}

/// What of a tool is to be otherwise. Lengths are in the unit of the machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolChange {
    /// The tool.
    pub number: u32,
    /// Its length: it has not worn since.
    pub length: Option<f64>,
    /// Its diameter: it has not worn since.
    pub diameter: Option<f64>,
    /// What has to be added to the length.
    pub length_wear: Option<f64>,
    /// What has to be added to the diameter.
    pub diameter_wear: Option<f64>,
    /// Its place in the magazine.
    pub pocket: Option<u32>,
    /// What is written next to it.
    pub remark: Option<String>,
    /// How long it may be used, and has been; see [`Tables::set_life`].
    pub life: LifeChange,
}

impl Change {
    /// The axis that it is about.
    pub fn axis(&self) -> Option<Axis> {
        match self {
            Change::TouchOffWork { axis, .. } | Change::TouchOffTool { axis, .. } | Change::Offset { axis, .. } => {
                Some(*axis)
            }
            Change::Rotation { .. } | Change::Tool(_) | Change::DeleteTool { .. } => None,
        }
    }

    /// The tool whose measures it sets.
    pub fn tool(&self) -> Option<u32> {
        match self {
            Change::TouchOffTool { tool, .. } => Some(*tool),
            Change::Tool(tool) => Some(tool.number),
            Change::TouchOffWork { .. }
            | Change::Offset { .. }
            | Change::Rotation { .. }
            | Change::DeleteTool { .. } => None,
        }
    }
}

/// Carries out a change. Lengths are in the unit of the machine.
///
/// # Errors
/// Why it cannot be.
pub fn changed(
    config: &Config,
    tables: &Tables,
    at: Position,
    modes: Option<&Modes>,
    change: &Change,
) -> Result<Settings, String> {
    let mut settings = settings_with(config, tables, at);
    let line = match *change {
        Change::TouchOffWork { axis, value, system } => set("L20", u32::from(system.unwrap_or(0)), axis, value),
        Change::Offset { axis, value, system } => set("L2", u32::from(system.unwrap_or(0)), axis, value),
        Change::Rotation { degrees, system } => format!("G10 L2 P{} R{degrees}", system.unwrap_or(0)),
        Change::TouchOffTool { axis, value, tool } => set("L10", tool, axis, value),
        Change::Tool(ref change) => return with_tool(settings, config.unit, change),
        Change::DeleteTool { number } if number == tables.tool_in_spindle() => {
            return Err(format!("tool {number} is in the spindle"));
        }
        Change::DeleteTool { number } => {
            return match settings.tools.remove(number) {
                true => Ok(settings),
                false => Err(format!("the tool table has no tool {number}")),
            };
        }
    };
    let unit = match config.unit {
        LengthUnit::Millimetre => "G21",
        LengthUnit::Inch => "G20",
    };
    let text = format!("{unit}\n{line}\n");
    let mut run = Interpreter::new(settings).run(text.as_bytes()).as_mdi();
    if let Some(modes) = modes {
        run = run.continuing(modes);
    }
    match run.by_ref().find_map(Result::err) {
        Some(error) => Err(error.kind.to_string()),
        None => Ok(run.snapshot()),
    }
}

fn set(how: &str, what: u32, axis: Axis, value: f64) -> String {
    format!("G10 {how} P{what} {}{value}", axis.letter())
}

fn with_tool(mut settings: Settings, unit: LengthUnit, change: &ToolChange) -> Result<Settings, String> {
    let number = change.number;
    let known = settings.tools.by_number(number).cloned();
    if number == 0 && known.is_none() {
        return Err("tool 0 stands for none: numbers of tools begin at 1".into());
    }
    let mut tool = known.unwrap_or(Tool {
        number,
        pocket: number,
        ..Tool::default()
    });
    if let Some(length) = change.length {
        tool.offset[Axis::Z] = length * unit.mm();
    }
    if let Some(diameter) = change.diameter {
        tool.diameter_mm = diameter * unit.mm();
    }
    if let Some(pocket) = change.pocket {
        tool.pocket = pocket;
    }
    if let Some(remark) = &change.remark {
        tool.remark.clone_from(remark);
    }
    settings.tools.set(tool).map_err(|error| error.to_string())?;
    // What was measured has not worn, also where it measures the same as before.
    let worn = settings.tools.wear(number);
    let left = |worn: f64, to: Option<f64>, measured: Option<f64>| match to {
        Some(to) => to * unit.mm(),
        None if measured.is_some() => 0.0,
        None => worn,
    };
    let wear = Wear {
        length_mm: left(worn.length_mm, change.length_wear, change.length),
        diameter_mm: left(worn.diameter_mm, change.diameter_wear, change.diameter),
    };
    let tools = &mut settings.tools;
    tools.set_wear(number, wear).map_err(|error| error.to_string())?;
    if let Some(sister) = change.life.sister.filter(|sister| *sister != 0) {
        if sister == number {
            return Err("a tool is no sister of its own".into());
        }
        if tools.by_number(sister).is_none() {
            return Err(format!("the tool table has no tool {sister}"));
        }
    }
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn demo() -> (Config, Tables) {
        let config = config::parse(include_str!("../../../configs/mill3-demo.toml"), Path::new("demo.toml")).unwrap();
        let tables = Tables::read(&config).unwrap();
        (config, tables)
    }

    #[test]
    fn an_axis_reads_what_it_was_touched_off_to_where_it_stands() {
        let (config, mut tables) = demo();
        let at = Position::xyz(30.0, 40.0, -10.0);
        let mut change = |change: &Change| -> Result<Settings, String> {
            let changed = changed(&config, &tables, at, None, change)?;
            tables.adopt(changed.clone());
            Ok(changed)
        };
        let touch_off = |axis, value, system| Change::TouchOffWork { axis, value, system };
        let found = change(&touch_off(Axis::X, 2.5, None)).unwrap();
        assert_eq!(found.work_offsets[0][Axis::X], 27.5);
        let found = change(&touch_off(Axis::Y, 0.0, Some(3))).unwrap();
        assert_eq!(found.work_offsets[2][Axis::Y], 40.0);
        assert_eq!(found.work_offsets[0][Axis::X], 27.5, "the others stay");
        let found = change(&Change::Offset {
            axis: Axis::Z,
            value: -7.25,
            system: Some(9),
        });
        assert_eq!(found.unwrap().work_offsets[8][Axis::Z], -7.25);
        let found = change(&Change::Rotation {
            degrees: 15.0,
            system: Some(2),
        });
        let found = found.unwrap();
        assert_eq!(
            (found.work_rotations_degrees[1], found.work_rotations_degrees[0]),
            (15.0, 0.0)
        );
        assert_eq!(found.work_offsets[2][Axis::Y], 40.0, "origins stay");
        let refused = change(&Change::TouchOffTool {
            axis: Axis::Z,
            value: 0.0,
            tool: 500,
        });
        assert!(refused.is_err());
    }

    #[test]
    fn a_tool_is_set_by_value_and_by_touching_the_work() {
        let (config, mut tables) = demo();
        let at = Position::xyz(0.0, 0.0, -10.0);
        let length = |settings: &Settings, tool| settings.tools.by_number(tool).unwrap().offset[Axis::Z];
        let set = Change::Tool(ToolChange {
            number: 5,
            length: Some(12.3),
            diameter: Some(6.0),
            pocket: Some(7),
            remark: Some("end mill\n2 flutes".into()),
            ..ToolChange::default()
        });
        let found = changed(&config, &tables, at, None, &set).unwrap();
        assert_eq!(length(&found, 5), 12.3);
        let tool = found.tools.by_number(5).unwrap();
        assert_eq!((tool.diameter_mm, tool.pocket), (6.0, 7));
        assert_eq!(tool.remark, "end mill 2 flutes", "the table has one line for it");
        let none = Change::Tool(ToolChange {
            length: Some(1.0),
            ..ToolChange::default()
        });
        let refused = changed(&config, &tables, at, None, &none).unwrap_err();
        assert_eq!(refused, "tool 0 stands for none: numbers of tools begin at 1");
        tables.adopt(found);
        let origin = settings_with(&config, &tables, at).work_offsets[0][Axis::Z];
        let touch_off = Change::TouchOffTool {
            axis: Axis::Z,
            value: 1.0,
            tool: 5,
        };
        let found = changed(&config, &tables, at, None, &touch_off).unwrap();
        // machine = work + origin + length
        assert!((length(&found, 5) - (-10.0 - 1.0 - origin)).abs() < 1e-9);
        assert_eq!(
            found.tools.by_number(5).unwrap().diameter_mm,
            6.0,
            "what was not named stays"
        );
    }

    #[test]
    fn a_tool_is_taken_out_of_the_table_unless_it_is_in_the_spindle() {
        let (config, mut tables) = demo();
        let delete =
            |tables: &Tables, number| changed(&config, tables, Position::ZERO, None, &Change::DeleteTool { number });
        let found = delete(&tables, 5).unwrap();
        assert!(found.tools.by_number(5).is_none() && found.tools.by_number(4).is_some());
        tables.adopt(found);
        assert_eq!(delete(&tables, 5).unwrap_err(), "the tool table has no tool 5");
        tables.set_tool_in_spindle(4);
        assert_eq!(delete(&tables, 4).unwrap_err(), "tool 4 is in the spindle");
    }
}
