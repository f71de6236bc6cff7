//! `isocnc interpret`: the canonical calls of a part program, one a line.
//!
//! In:  a part program, and the work offsets of a machine file.
//! Out: on standard output the calls, as LinuxCNC's `rs274 -g` prints them or as JSON; errors on standard error.
//!
//! The printed form counts the calls, names the N-word of the line and gives numbers in the units of the program. U, V
//! and W follow only where one of them is not zero.

use crate::config;
use anyhow::Context;
use gcode::{Error, Interpreter, Settings};
use motion::canon::{AXES, Axis, Call, Event, LengthUnit, PathMode, Plane, Position, SpindleDirection};
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
    let mut printer = Printer::new(&settings);
    let mut events = Interpreter::new(settings).run(text).peekable();
    while let Some(event) = events.next() {
        let event = match event {
            Ok(event) => event,
            Err(error) => return Ok(vec![error]),
        };
        match format {
            Format::Json => writeln!(out, "{}", to_json(&event))?,
            Format::Canon => {
                let next = events.peek().and_then(|next| next.as_ref().ok());
                printer.write(&event, next.map(|next| &next.call), out)?;
            }
        }
    }
    Ok(Vec::new())
}

/// Writes calls in the form of `rs274 -g`.
struct Printer {
    count: u32,
    /// Unit of the program at this call.
    unit: LengthUnit,
    /// Work position before this call and origin of the work system; they only tell what a move moves.
    position: Position,
    origin: Position,
}

impl Printer {
    fn new(settings: &Settings) -> Printer {
        Printer {
            count: 0,
            unit: settings.length_unit,
            position: settings.start,
            origin: Position::ZERO,
        }
    }

    /// `next`: the call behind this one, which tells whether a feed counts millimetres or degrees.
    fn write(&mut self, event: &Event, next: Option<&Call>, out: &mut impl Write) -> io::Result<()> {
        let mut line = |text: String| {
            self.count += 1;
            match event.source.n {
                Some(n) => writeln!(out, "{:5} N{n:<6}{text}", self.count),
                None => writeln!(out, "{:5} N..... {text}", self.count),
            }
        };
        let unit = self.unit;
        let length = |mm: f64| number(mm / unit.mm());
        let name = match &event.call {
            Call::StraightTraverse { to } => {
                self.position = *to;
                format!("STRAIGHT_TRAVERSE({})", position(to, unit))
            }
            Call::StraightFeed { to } => {
                self.position = *to;
                format!("STRAIGHT_FEED({})", position(to, unit))
            }
            Call::ArcFeed {
                to,
                plane,
                centre_mm,
                turns,
            } => {
                self.position = *to;
                let [first, second, normal] = plane.axes().map(|axis| length(to[axis]));
                let [centre_1, centre_2] = centre_mm.map(length);
                let others = axes_from(to, unit, Axis::A);
                format!("ARC_FEED({first}, {second}, {centre_1}, {centre_2}, {turns}, {normal}, {others})")
            }
            Call::Dwell { seconds } => format!("DWELL({})", number(*seconds)),
            Call::SetFeedRate { linear, .. } => {
                let per_minute = linear * 60.0;
                let degrees = matches!(next, Some(Call::StraightFeed { to }) if turns_only(&self.position, to));
                let shown = if degrees {
                    number(per_minute)
                } else {
                    length(per_minute)
                };
                format!("SET_FEED_RATE({shown})")
            }
            Call::SetPathMode(PathMode::ExactPath) => "SET_MOTION_CONTROL_MODE(CANON_EXACT_PATH)".into(),
            Call::SetPathMode(PathMode::ExactStop) => "SET_MOTION_CONTROL_MODE(CANON_EXACT_STOP)".into(),
            Call::SetPathMode(PathMode::Continuous {
                tolerance_mm,
                naive_cam_tolerance_mm,
            }) => {
                let tolerance = tolerance_mm.unwrap_or(0.0) / unit.mm();
                line(format!("SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, {tolerance:.6})"))?;
                format!(
                    "SET_NAIVECAM_TOLERANCE({})",
                    length(naive_cam_tolerance_mm.unwrap_or(0.0))
                )
            }
            Call::SelectPlane(plane) => format!("SELECT_PLANE({})", canon_plane(*plane)),
            Call::UseLengthUnit(unit) => {
                self.unit = *unit;
                match unit {
                    LengthUnit::Millimetre => "USE_LENGTH_UNITS(CANON_UNITS_MM)".into(),
                    LengthUnit::Inch => "USE_LENGTH_UNITS(CANON_UNITS_INCHES)".into(),
                }
            }
            Call::SetG5xOffset { system, origin } => {
                for axis in Axis::ALL {
                    self.position[axis] += self.origin[axis] - origin[axis];
                }
                self.origin = *origin;
                format!("SET_G5X_OFFSET({system}, {})", position(origin, unit))
            }
            Call::SetG92Offset { offset } => format!("SET_G92_OFFSET({})", position(offset, unit)),
            Call::SetXyRotation { degrees } => format!("SET_XY_ROTATION({})", number(*degrees)),
            Call::SetToolLengthOffset { offset } => format!("USE_TOOL_LENGTH_OFFSET({})", position(offset, unit)),
            Call::SetSpindleSpeed { spindle, speed } => format!("SET_SPINDLE_SPEED({spindle}, {})", number(*speed)),
            Call::StartSpindle { spindle, direction, .. } => match direction {
                SpindleDirection::Clockwise => format!("START_SPINDLE_CLOCKWISE({spindle})"),
                SpindleDirection::Counterclockwise => format!("START_SPINDLE_COUNTERCLOCKWISE({spindle})"),
            },
            Call::StopSpindle { spindle } => format!("STOP_SPINDLE_TURNING({spindle})"),
            Call::Mist(true) => "MIST_ON()".into(),
            Call::Mist(false) => "MIST_OFF()".into(),
            Call::Flood(true) => "FLOOD_ON()".into(),
            Call::Flood(false) => "FLOOD_OFF()".into(),
            Call::SelectTool { tool } => format!("SELECT_TOOL({tool})"),
            Call::ChangeTool { tool, .. } => format!("CHANGE_TOOL({tool})"),
            Call::Message(text) => format!("MESSAGE(\"{text}\")"),
            Call::Comment(text) => format!("COMMENT(\"{text}\")"),
            Call::ProgramStop => "PROGRAM_STOP()".into(),
            Call::OptionalProgramStop => "OPTIONAL_PROGRAM_STOP()".into(),
            Call::ProgramEnd => "PROGRAM_END()".into(),
            other => format!("{other:?}"),
        };
        line(name)
    }
}

/// Four decimals, and no minus before zero.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    if text == "-0.0000" { "0.0000".into() } else { text }
}

fn position(position: &Position, unit: LengthUnit) -> String {
    axes_from(position, unit, Axis::X)
}

/// Numbers of the axes from `first` on.
fn axes_from(position: &Position, unit: LengthUnit, first: Axis) -> String {
    let with_uvw = position.0[Axis::U as usize..].iter().any(|value| *value != 0.0);
    let last = if with_uvw { AXES } else { Axis::U as usize };
    let shown = Axis::ALL[first as usize..last].iter().map(|axis| {
        let value = position[*axis];
        number(if axis.is_rotary() { value } else { value / unit.mm() })
    });
    shown.collect::<Vec<_>>().join(", ")
}

/// Whether rotary axes alone move.
fn turns_only(from: &Position, to: &Position) -> bool {
    let moves = |axis: &Axis| (from[*axis] - to[*axis]).abs() > 1e-9; // beyond rounding by changes of the origin
    let (rotary, linear): (Vec<Axis>, Vec<Axis>) =
        Axis::ALL.into_iter().filter(moves).partition(|axis| axis.is_rotary());
    !rotary.is_empty() && linear.is_empty()
}

fn canon_plane(plane: Plane) -> &'static str {
    match plane {
        Plane::Xy => "CANON_PLANE_XY",
        Plane::Zx => "CANON_PLANE_XZ",
        Plane::Yz => "CANON_PLANE_YZ",
        Plane::Uv => "CANON_PLANE_UV",
        Plane::Wu => "CANON_PLANE_UW",
        Plane::Vw => "CANON_PLANE_VW",
    }
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
            "SET_FEED_RATE(0.0000)",
            "SET_SPINDLE_MODE",
            "START_CHANGE",
            "ON_RESET",
            "COMMENT(\"interpreter:",
        ];
        let without_count = |line: &str| line.split_once('N').map(|(_, rest)| format!("N{rest}")).unwrap();
        let expected: Vec<String> = include_str!("../../tests/interpret/mill.canon")
            .lines()
            .filter(|line| !LEFT_OUT.iter().any(|left_out| line.contains(left_out)))
            .map(without_count)
            .collect();
        let lines = printed(
            include_str!("../../tests/interpret/mill.ngc"),
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
        // And the feed anew where its unit changes between mm and degrees, with the same number.
        let feed = "N..... SET_FEED_RATE(10.0000)";
        let at = ours.iter().position(|line| line == feed).unwrap();
        assert_eq!(ours[at + 1], feed);
        assert_eq!(ours[at + 3], feed);
        ours.remove(at + 3);
        ours.remove(at + 1);
        for (ours, expected) in ours.iter().zip(&expected) {
            assert_eq!(ours, expected);
        }
        assert_eq!(ours.len(), expected.len());
    }

    #[test]
    fn lines_are_counted_in_five_columns() {
        let lines = printed("N7 M0\nN123456 M2\n", Settings::default(), Format::Canon);
        assert_eq!(lines[0], "    1 N..... USE_LENGTH_UNITS(CANON_UNITS_MM)");
        assert_eq!(lines[5], "    6 N7     PROGRAM_STOP()");
        assert_eq!(lines[10], "   11 N123456PROGRAM_END()");
        assert_eq!(lines.len(), 11);
    }

    #[test]
    fn minus_zero_is_zero_and_uvw_follow_where_they_are_used() {
        let lines = printed("G0 X-0.00001\nG0 W2\nM2\n", Settings::default(), Format::Canon);
        assert_eq!(
            lines[5],
            "    6 N..... STRAIGHT_TRAVERSE(0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)"
        );
        let with_w = "(0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 2.0000)";
        assert_eq!(lines[6], format!("    7 N..... STRAIGHT_TRAVERSE{with_w}"));
    }

    #[test]
    fn feeds_of_rotary_moves_are_told_in_degrees_behind_a_change_of_origin_too() {
        let mut settings = Settings::default();
        settings.work_offsets[1] = Position::xyz(10.1, 20.3, 0.0);
        let lines = printed("G20\nF10\nG55\nG1 A5\nM2\n", settings, Format::Canon);
        let feeds: Vec<_> = lines.iter().filter(|line| line.contains("FEED_RATE")).collect();
        assert_eq!(
            feeds,
            [
                "    7 N..... SET_FEED_RATE(10.0000)",
                "    9 N..... SET_FEED_RATE(10.0000)"
            ]
        );
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
