//! Our interpreter on a case, as the oracle is run on it.

use std::path::Path;

use ::compensation::Gouge;
use gcode::{CanonPrinter, Interpreter, Remap, Settings, ToolChangePlace, ToolChanger, ToolTable, parameter};
use motion::canon::{Axis, Call, LengthUnit, Position, Record};

use super::{Version, case::Case};

/// The packaged interpreter's unit is the inch, and no setting changes it.
const MACHINE_UNIT: LengthUnit = LengthUnit::Inch;

/// What our interpreter made of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The printed calls.
    pub canon: String,
    /// Texts of PRINT, one a line.
    pub printed: String,
    /// What was refused, in order: `line:column: text`, of a subroutine's file `file:line:column: text`.
    pub errors: Vec<String>,
    /// Lines of the refusals, counted from 1, in the file they are in.
    pub error_lines: Vec<u32>,
    /// The parameter file afterwards.
    pub parameters: String,
}

/// Runs a case.
pub fn run(case: &Case, version: Version) -> Outcome {
    // Subroutine files are looked for in a folder.
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder for the case");
    if !case.files.is_empty() {
        case.write_to(folder.path());
    }
    let mut printer = CanonPrinter::new(MACHINE_UNIT);
    let mut canon = Vec::new();
    let mut printed = String::new();
    let mut errors = Vec::new();
    let mut error_lines = Vec::new();
    let mut run = Interpreter::new(settings(case, folder.path(), version))
        .run(&case.program)
        .number_by_release();
    if case.options.continue_after_error {
        run = run.continue_after_errors();
    }
    // An endless program is stopped: no case and no generated program is that long.
    for event in run.by_ref().take(1_000_000) {
        match event {
            Ok(event) => {
                if let Call::Record(Record::Print(text)) = &event.call {
                    printed.push_str(text);
                    printed.push('\n');
                }
                printer.write(&event, &mut canon).expect("memory");
            }
            Err(error) => {
                // Files are named as the program sees them.
                let place = folder.path().display().to_string();
                errors.push(error.to_string().replace(&format!("{place}/"), "").replace(&place, "."));
                error_lines.push(error.line);
                if !case.options.continue_after_error {
                    printer.write_end_after_error(&mut canon).expect("memory");
                    break;
                }
            }
        }
    }
    let left: Vec<(u16, f64)> = run.snapshot().parameters.into_iter().collect();
    Outcome {
        canon: String::from_utf8_lossy(&canon).into_owned(),
        printed,
        errors,
        error_lines,
        parameters: parameter::file::write(&left),
    }
}

/// The settings of a case: its tables and what its INI values say.
pub fn settings(case: &Case, folder: &Path, version: Version) -> Settings {
    let value = |section: &str, key: &str| case.options.ini.get(section).and_then(|keys| keys.get(key));
    let number = |section: &str, key: &str| value(section, key).map(|text| text.parse::<f64>().expect("a number"));
    let flag = |section: &str, key: &str| number(section, key).is_some_and(|number| number != 0.0);
    let changer = if flag("EMCIO", "RANDOM_TOOLCHANGER") {
        ToolChanger::Random
    } else {
        ToolChanger::Fixed
    };
    let clearance_mm = match version {
        Version::Packaged => Some(0.254),
        Version::Newest => None,
    };
    let mut settings = Settings {
        machine_unit: MACHINE_UNIT,
        tools: ToolTable::parse(case.tool_table.as_bytes(), MACHINE_UNIT, changer).expect("a tool table"),
        block_delete: case.options.block_delete,
        spindles: number("TRAJ", "SPINDLES").map_or(1, |count| count as u8),
        orient_offset_degrees: number("RS274NGC", "ORIENT_OFFSET").unwrap_or(0.0),
        chip_breaking_clearance_mm: number("RS274NGC", "G73_PECK_CLEARANCE").or(clearance_mm),
        peck_clearance_mm: number("RS274NGC", "G83_PECK_CLEARANCE").or(clearance_mm),
        // A greater one than the usual is not taken.
        arc_radius_tolerance_mm: number("RS274NGC", "CENTER_ARC_RADIUS_TOLERANCE_MM").filter(|mm| *mm < 0.0282),
        user_codes: Some(Vec::new()),
        tool_change: ToolChangePlace {
            spindle_on: flag("EMCIO", "TOOL_CHANGE_WITH_SPINDLE_ON"),
            quill_up: flag("EMCIO", "TOOL_CHANGE_QUILL_UP"),
            at_g30: flag("EMCIO", "TOOL_CHANGE_AT_G30"),
        },
        gouge: Gouge::NeighboursOnly,
        fanuc_subprograms: !flag("RS274NGC", "DISABLE_FANUC_STYLE_SUB"),
        keep_tool_offset: flag("RS274NGC", "RETAIN_G43"),
        ..Settings::default()
    };
    settings.set_parameters(&parameter::file::parse(case.parameters.as_bytes()).expect("a parameter file"));
    if flag("RS274NGC", "DISABLE_G92_PERSISTENCE") {
        settings.g92_active = false;
        settings.g92_offset = Position::ZERO;
    }
    settings.subroutine_folders.push(folder.to_owned());
    for inside in value("RS274NGC", "SUBROUTINE_PATH")
        .into_iter()
        .flat_map(|path| path.split(':'))
    {
        settings.subroutine_folders.push(folder.join(inside));
    }
    for (letter, section) in [(Axis::A, "AXIS_A"), (Axis::B, "AXIS_B"), (Axis::C, "AXIS_C")] {
        settings.wrapped_rotary[letter as usize] = flag(section, "WRAPPED_ROTARY");
    }
    if let Some(remap) = value("RS274NGC", "REMAP") {
        settings.remaps.push(remap_of(remap));
    }
    for (section, keys) in &case.options.ini {
        for (key, text) in keys {
            if let Ok(number) = text.parse() {
                settings
                    .ini_values
                    .insert((section.to_lowercase(), key.to_lowercase()), number);
            }
        }
    }
    settings
}

fn remap_of(text: &str) -> Remap {
    let mut parts = text.split_whitespace();
    let mut remap = Remap {
        code: parts.next().expect("a code").to_owned(),
        subroutine: String::new(),
        arguments: String::new(),
        modal_group: 0,
    };
    for part in parts {
        match part.split_once('=').expect("key=value") {
            ("modalgroup", group) => remap.modal_group = group.parse().expect("a group"),
            ("argspec", words) => remap.arguments = words.to_owned(),
            ("ngc", name) => remap.subroutine = name.to_owned(),
            (other, _) => panic!("{other} of a remap"),
        }
    }
    remap
}
