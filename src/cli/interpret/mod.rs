//! `isocnc interpret`: the canonical calls of a part program, one a line.
//!
//! In:  a part program, and the work offsets of a machine file.
//! Out: on standard output the calls, as LinuxCNC's `rs274 -g` prints them or as JSON; errors on standard error.
//!
//! The printed form counts the calls, names the N-word of the line and gives numbers in the units of the program
//! ([`gcode::CanonPrinter`]).

mod json;
#[cfg(test)]
mod json_tests;

use crate::config;
use anyhow::Context;
use gcode::{CanonPrinter, Error, Interpreter, Settings};
use json::JsonPrinter;
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
    let name = args.program.display().to_string();
    let errors = if args.check {
        gcode::check(&text, settings)
    } else {
        let mut out = io::BufWriter::new(io::stdout().lock());
        match write_calls(&text, &name, settings, args.format, &mut out).and_then(|errors| out.flush().map(|()| errors))
        {
            // The reader of a pipe may have seen enough.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Vec::new(),
            result => result?,
        }
    };
    for error in &errors {
        eprintln!("{}", error.render(&name));
    }
    Ok(if errors.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Writes the calls up to the first error, which is returned.
fn write_calls(
    text: &[u8],
    name: &str,
    settings: Settings,
    format: Format,
    out: &mut impl Write,
) -> io::Result<Vec<Error>> {
    let mut printer = CanonPrinter::new(settings.length_unit);
    let mut json = JsonPrinter::default();
    for event in Interpreter::new(settings).run(text) {
        let event = match event {
            Ok(event) => event,
            Err(error) => return Ok(vec![*error]),
        };
        match format {
            Format::Json => writeln!(out, "{}", json.object(&event, name))?,
            Format::Canon => printer.write(&event, out)?,
        }
    }
    Ok(Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value as Json, json};

    fn printed(text: &str, settings: Settings, format: Format) -> Vec<String> {
        let mut out = Vec::new();
        let errors = write_calls(text.as_bytes(), "part.ngc", settings, format, &mut out).unwrap();
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
        let at = |line, span| json!({ "file": "part.ngc", "line": line, "span": span });
        let with = |mut object: Json, fields: Json| {
            object
                .as_object_mut()
                .unwrap()
                .extend(fields.as_object().unwrap().clone());
            object
        };
        let first = with(at(1, [0, 12]), json!({ "n": 5 }));
        assert_eq!(
            parsed[4],
            with(first.clone(), json!({ "call": "use_length_unit", "unit": "inch" }))
        );
        let to = [25.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(parsed[5], with(first, json!({ "call": "straight_traverse", "to": to })));
        assert_eq!(
            parsed.last(),
            Some(&with(at(2, [13, 15]), json!({ "call": "program_end" })))
        );
    }

    #[test]
    fn calls_before_an_error_are_written() {
        let mut out = Vec::new();
        let errors = write_calls(
            b"G0 X1\nG1 X2\n",
            "part.ngc",
            Settings::default(),
            Format::Canon,
            &mut out,
        )
        .unwrap();
        assert_eq!(errors.len(), 1);
        assert_eq!(errors[0].to_string(), "2:1: G1 needs a feed: F is not set");
        assert!(String::from_utf8(out).unwrap().ends_with("0.0000)\n"));
    }
}
