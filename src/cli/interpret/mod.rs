//! `isocnc interpret`: the canonical calls of a part program, one a line.
//!
//! In:  a part program, and the work offsets of a machine file.
//! Out: on standard output the calls, as LinuxCNC's `rs274 -g` prints them or as JSON; errors on standard error.
//!
//! The printed form counts the calls, names the N-word of the line and gives numbers in the units of the program
//! ([`gcode::CanonPrinter`]).

use crate::config;
use anyhow::Context;
use gcode::{CanonPrinter, Error, Interpreter, Settings};
use motion::canon::{Call, Event, LengthUnit, PathMode, Plane, SpindleDirection};
use serde_json::{Value as Json, json};
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `isocnc interpret`.
#[derive(Clone, Debug, clap::Args)]
pub struct InterpretArgs {
    /// Part program
    pub program: PathBuf,
    /// Machine file whose work offsets are used; without one they are zero
    #[arg(long, value_name = "MACHINE.toml")]
    pub machine: Option<PathBuf>,
    /// Form of the output
    #[arg(long, value_enum, default_value = "canon")]
    pub format: Format,
    /// Print all errors of the program and no calls
    #[arg(long)]
    pub check: bool,
}

/// Form of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// As LinuxCNC's rs274 -g
    Canon,
    /// One JSON object a line; lengths in mm, times in seconds
    Json,
}

/// Runs the command; exit code 1 if the program or the machine file has errors.
///
/// # Errors
/// Files that cannot be read, output that cannot be written.
pub fn interpret(args: &InterpretArgs) -> anyhow::Result<ExitCode> {
    let mut settings = Settings::default();
    if let Some(machine) = &args.machine {
        match config::read(machine) {
            Ok(config) => settings.work_offsets = config.work_offsets,
            Err(errors) => {
                eprint!("{errors}");
                return Ok(ExitCode::FAILURE);
            }
        }
    }
    let text = std::fs::read(&args.program).with_context(|| args.program.display().to_string())?;
    let errors = if args.check {
        gcode::check(&text, settings)
    } else {
        let mut out = io::BufWriter::new(io::stdout().lock());
        match write_calls(&text, settings, args.format, &mut out).and_then(|errors| out.flush().map(|()| errors)) {
            // The reader of a pipe may have seen enough.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Vec::new(),
            result => result?,
        }
    };
    for error in &errors {
        eprintln!("{}", error.render(&args.program.display().to_string(), &text));
    }
    Ok(if errors.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Writes the calls up to the first error, which is returned.
fn write_calls(text: &[u8], settings: Settings, format: Format, out: &mut impl Write) -> io::Result<Vec<Error>> {
    let mut printer = CanonPrinter::new(settings.length_unit);
    for event in Interpreter::new(settings).run(text) {
        let event = match event {
            Ok(event) => event,
            Err(error) => return Ok(vec![error]),
        };
        match format {
            Format::Json => writeln!(out, "{}", to_json(&event))?,
            Format::Canon => printer.write(&event, out)?,
        }
    }
    Ok(Vec::new())
}

/// `{"line": .., "n": .., "call": "..", ...}`; `n` only where there is an N-word, `line` 0 before the first line.
fn to_json(event: &Event) -> Json {
    let mut object = match &event.call {
        Call::StraightTraverse { to } => json!({ "call": "straight_traverse", "to_mm": to.0 }),
        Call::StraightFeed { to } => json!({ "call": "straight_feed", "to_mm": to.0 }),
        Call::ArcFeed {
            to,
            plane,
            centre_mm,
            turns,
        } => json!({
            "call": "arc_feed", "to_mm": to.0, "plane": json_plane(*plane), "centre_mm": centre_mm, "turns": turns,
        }),
        Call::Dwell { seconds } => json!({ "call": "dwell", "seconds": seconds }),
        Call::SetFeedRate { linear, angular } => {
            json!({ "call": "set_feed_rate", "linear": linear, "angular": angular })
        }
        Call::SetPathMode(PathMode::ExactPath) => json!({ "call": "set_path_mode", "mode": "exact_path" }),
        Call::SetPathMode(PathMode::ExactStop) => json!({ "call": "set_path_mode", "mode": "exact_stop" }),
        Call::SetPathMode(PathMode::Continuous {
            tolerance_mm,
            naive_cam_tolerance_mm,
        }) => json!({
            "call": "set_path_mode", "mode": "continuous",
            "tolerance_mm": tolerance_mm, "naive_cam_tolerance_mm": naive_cam_tolerance_mm,
        }),
        Call::SelectPlane(plane) => json!({ "call": "select_plane", "plane": json_plane(*plane) }),
        Call::UseLengthUnit(LengthUnit::Millimetre) => json!({ "call": "use_length_unit", "unit": "mm" }),
        Call::UseLengthUnit(LengthUnit::Inch) => json!({ "call": "use_length_unit", "unit": "inch" }),
        Call::SetG5xOffset { system, origin } => {
            json!({ "call": "set_g5x_offset", "system": system, "origin_mm": origin.0 })
        }
        Call::SetG92Offset { offset } => json!({ "call": "set_g92_offset", "offset_mm": offset.0 }),
        Call::SetXyRotation { degrees } => json!({ "call": "set_xy_rotation", "degrees": degrees }),
        Call::SetToolLengthOffset { offset } => json!({ "call": "set_tool_length_offset", "offset_mm": offset.0 }),
        Call::SetSpindleSpeed { spindle, speed } => {
            json!({ "call": "set_spindle_speed", "spindle": spindle, "speed": speed })
        }
        Call::StartSpindle { spindle, direction, .. } => {
            let direction = match direction {
                SpindleDirection::Clockwise => "clockwise",
                SpindleDirection::Counterclockwise => "counterclockwise",
            };
            json!({ "call": "start_spindle", "spindle": spindle, "direction": direction })
        }
        Call::StopSpindle { spindle } => json!({ "call": "stop_spindle", "spindle": spindle }),
        Call::Mist(on) => json!({ "call": "mist", "on": on }),
        Call::Flood(on) => json!({ "call": "flood", "on": on }),
        Call::SelectTool { tool } => json!({ "call": "select_tool", "tool": tool }),
        Call::ChangeTool { tool, pocket } => json!({ "call": "change_tool", "tool": tool, "pocket": pocket }),
        Call::Message(text) => json!({ "call": "message", "text": text }),
        Call::Comment(text) => json!({ "call": "comment", "text": text }),
        Call::ProgramStop => json!({ "call": "program_stop" }),
        Call::OptionalProgramStop => json!({ "call": "optional_program_stop" }),
        Call::ProgramEnd => json!({ "call": "program_end" }),
        other => json!({ "call": format!("{other:?}") }),
    };
    object["line"] = event.source.line.into();
    if let Some(n) = event.source.n {
        object["n"] = n.into();
    }
    object
}

fn json_plane(plane: Plane) -> &'static str {
    match plane {
        Plane::Xy => "xy",
        Plane::Zx => "zx",
        Plane::Yz => "yz",
        Plane::Uv => "uv",
        Plane::Wu => "wu",
        Plane::Vw => "vw",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn printed(text: &str, settings: Settings, format: Format) -> Vec<String> {
        let mut out = Vec::new();
        let errors = write_calls(text.as_bytes(), settings, format, &mut out).unwrap();
        assert_eq!(errors, []);
        String::from_utf8(out).unwrap().lines().map(String::from).collect()
    }

    /// `mill.canon` is what LinuxCNC 2.9 printed for `mill.ngc` (`rs274 -g` with a tool 1 in the table).
    #[test]
    fn calls_are_printed_as_linuxcnc_prints_them() {
        // Calls of LinuxCNC that our vocabulary does not have.
        const LEFT_OUT: [&str; 9] = [
            "SET_G92_OFFSET(0.0000",
            "SET_XY_ROTATION(0.0000",
            "SET_FEED_REFERENCE",
            "SET_FEED_MODE",
            "SET_FEED_RATE",
            "SET_SPINDLE_MODE",
            "START_CHANGE",
            "ON_RESET",
            "COMMENT(\"interpreter:",
        ];
        let without_count = |line: &str| line.split_once('N').map(|(_, rest)| format!("N{rest}")).unwrap();
        let newest = |line: &str| match line.split_once("CHANGE_TOOL(") {
            Some((front, _)) => format!("{front}CHANGE_TOOL()"),
            None => line.to_string(),
        };
        let expected: Vec<String> = include_str!("../../../tests/interpret/mill.canon")
            .lines()
            .filter(|line| !LEFT_OUT.iter().any(|left_out| line.contains(left_out)))
            .map(without_count)
            .map(|line| newest(&line))
            .collect();
        let lines = printed(
            include_str!("../../../tests/interpret/mill.ngc"),
            Settings::default(),
            Format::Canon,
        );
        let mut ours: Vec<String> = lines.iter().map(|line| without_count(line)).collect();
        // At the start we also tell plane and path mode.
        assert_eq!(
            ours.drain(2..5).collect::<Vec<_>>(),
            [
                "N..... SELECT_PLANE(CANON_PLANE_XY)",
                "N..... SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.000000)",
                "N..... SET_NAIVECAM_TOLERANCE(0.0000)",
            ]
        );
        // A move of rotary axes alone tells its feed anew.
        ours.retain(|line| !line.contains("SET_FEED_RATE"));
        for (ours, expected) in ours.iter().zip(&expected) {
            assert_eq!(ours, expected);
        }
        assert_eq!(ours.len(), expected.len());
    }

    #[test]
    fn json_is_one_object_a_line() {
        let lines = printed("N5 G20 G0 X1\nM2\n", Settings::default(), Format::Json);
        let parsed: Vec<Json> = lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(
            parsed[4],
            json!({ "line": 1, "n": 5, "call": "use_length_unit", "unit": "inch" })
        );
        let to_mm = [25.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(
            parsed[5],
            json!({ "line": 1, "n": 5, "call": "straight_traverse", "to_mm": to_mm })
        );
        assert_eq!(parsed.last(), Some(&json!({ "line": 2, "call": "program_end" })));
    }

    #[test]
    fn calls_before_an_error_are_written() {
        let mut out = Vec::new();
        let errors = write_calls(b"G0 X1\nG1 X2\n", Settings::default(), Format::Canon, &mut out).unwrap();
        assert_eq!(errors.len(), 1);
        assert_eq!(errors[0].to_string(), "2:1: G1 needs a feed: F is not set");
        assert!(String::from_utf8(out).unwrap().ends_with("0.0000)\n"));
    }
}
