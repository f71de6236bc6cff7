//! What the interpreter is told before a program: the machine file's keys and what the machine remembers.
//!
//! In:  [`Config`], [`Tables`], the place where the machine stands.
//! Out: [`gcode::Settings`].

use super::user_code;
use config::{self, Config};
use machine::tables::{Tables, without_file};
use motion::canon::{AXES, Position};

/// A file of `programs/probing`: its path and its text.
macro_rules! cycle {
    ($name:literal) => {
        (
            concat!("programs/probing/", $name, ".ngc"),
            include_str!(concat!("../../../programs/probing/", $name, ".ngc")),
        )
    };
}

/// Cycles that come with the control, `programs/probing`: docs/probing.md.
const CYCLES: &[(&str, &str)] = &[
    cycle!("probe-angle"),
    cycle!("probe-back"),
    cycle!("probe-begin"),
    cycle!("probe-block"),
    cycle!("probe-bore"),
    cycle!("probe-boss"),
    cycle!("probe-calibrate"),
    cycle!("probe-corner-inside"),
    cycle!("probe-corner-outside"),
    cycle!("probe-edge"),
    cycle!("probe-inside"),
    cycle!("probe-move"),
    cycle!("probe-outside"),
    cycle!("probe-pocket"),
    cycle!("probe-set"),
    cycle!("probe-settings"),
    cycle!("probe-surface"),
    cycle!("probe-tool-check"),
    cycle!("probe-tool-length"),
    cycle!("probe-tool-measure"),
    cycle!("probe-touch"),
];

/// Codes of the user.
const USER_CODES: std::ops::RangeInclusive<u8> = 100..=199;

/// Settings for a program that begins at `start`, a machine position.
pub fn settings_with(config: &Config, tables: &Tables, start: Position) -> gcode::Settings {
    let mut settings = gcode::Settings {
        tools: tables.tools_to_call(),
        tool_in_spindle: tables.tool_in_spindle(),
        block_delete: tables.block_delete,
        ..interpreter_settings(config, start)
    };
    settings.set_parameters(tables.parameters());
    settings
}

/// The modes in which a program begins.
pub fn modes_at_start(config: &Config, tables: &Tables) -> gcode::Modes {
    gcode::Interpreter::new(settings_with(config, tables, Position::ZERO))
        .run(b"")
        .modes()
}

/// The same without the files that keep tools and parameters.
pub fn interpreter_settings(config: &Config, start: Position) -> gcode::Settings {
    let program = &config.program;
    let listed = program.subroutine_directories.iter();
    let mut wrapped_rotary = [false; AXES];
    for map in &config.axes {
        wrapped_rotary[map.axis as usize] = map.wrapped;
    }
    gcode::Settings {
        start,
        work_offsets: config.work_offsets,
        length_unit: config.unit,
        machine_unit: config.unit,
        tools: without_file(config),
        block_delete: program.block_delete,
        diameter_mode: program.dialect.diameter_mode,
        spindles: config.spindle.count,
        wrapped_rotary,
        kinematics: config.kinematics(),
        arc_radius_tolerance_mm: program.arc_radius_tolerance.own_mm(config.unit),
        chip_breaking_clearance_mm: program.pecks.chip_breaking_mm,
        peck_clearance_mm: program.pecks.deep_hole_mm,
        fanuc_subprograms: program.dialect.fanuc_subroutines,
        cutter_corner: program.cutter.corner,
        gouge: program.cutter.gouge,
        contour_feed: program.cutter.feed,
        digital_pins: program.digital_pins,
        analog_pins: program.analog_pins,
        orient_offset_degrees: config.spindle.orient_offset_degrees,
        subroutine_folders: program.directory.iter().chain(listed).cloned().collect(),
        subroutine_files: CYCLES,
        user_codes: Some(user_codes(&program.user_codes)),
        remaps: program.remaps.iter().map(remap).collect(),
        ini_values: program.values.clone(),
        pin_values: program.pins.clone(),
        startup_code: program.startup_code.clone(),
        ..gcode::Settings::default()
    }
}

/// Those of M100 to M199 for which there is a program that may be started.
fn user_codes(codes: &config::UserCodes) -> Vec<u8> {
    USER_CODES
        .filter(|number| user_code::file(codes, *number).is_some())
        .collect()
}

fn remap(remap: &config::Remap) -> gcode::Remap {
    gcode::Remap {
        code: remap.code.clone(),
        subroutine: remap.subroutine.clone(),
        arguments: remap.arguments.clone(),
        modal_group: remap.modal_group,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::compensation::{Corner, Gouge};
    use config::Remap;
    use motion::canon::{Axis, LengthUnit};
    use std::os::unix::fs::PermissionsExt;
    use std::path::{Path, PathBuf};

    fn demo() -> Config {
        let text = include_str!("../../../configs/mill3-demo.toml");
        config::parse(text, Path::new("demo.toml")).unwrap()
    }

    fn settings(config: &Config) -> gcode::Settings {
        settings_with(config, &Tables::read(config).unwrap(), Position::xyz(1.0, 2.0, 3.0))
    }

    #[test]
    fn a_machine_file_that_says_little_gives_linuxcncs_settings() {
        let found = settings(&demo());
        let mut expected = gcode::Settings {
            start: Position::xyz(1.0, 2.0, 3.0),
            spindles: 1,
            digital_pins: 4,
            analog_pins: 4,
            subroutine_files: CYCLES,
            ini_values: [(("probe".to_owned(), "tool".to_owned()), 99.0)].into(),
            user_codes: Some(Vec::new()),
            kinematics: demo().kinematics(),
            tools: found.tools.clone(),
            parameters: found.parameters.clone(),
            ..gcode::Settings::default()
        };
        expected.work_offsets[0] = Position::xyz(20.0, 20.0, -60.0);
        assert_eq!(found, expected);
        assert_eq!(found.parameters[&5223], -60.0);
    }

    #[test]
    fn every_key_has_its_setting() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for (name, mode) in [("M100", 0o755), ("M150", 0o644), ("M199", 0o700), ("M200", 0o755)] {
            std::fs::write(path(name), "").unwrap();
            std::fs::set_permissions(path(name), std::fs::Permissions::from_mode(mode)).unwrap();
        }
        std::fs::create_dir(path("M101")).unwrap();
        let mut config = demo();
        config.unit = LengthUnit::Inch;
        config.axes[2].axis = Axis::B;
        config.axes[2].wrapped = true;
        config.spindle.count = 3;
        config.spindle.orient_offset_degrees = 15.0;
        let program = &mut config.program;
        program.directory = Some(PathBuf::from("parts"));
        program.subroutine_directories = vec![PathBuf::from("one"), PathBuf::from("two")];
        program.user_codes.allowed = true;
        program.user_codes.directories = vec![PathBuf::from("nowhere"), folder.path().to_owned()];
        program.digital_pins = 64;
        program.analog_pins = 16;
        program.block_delete = true;
        program.dialect.diameter_mode = true;
        program.pecks.chip_breaking_mm = Some(1.0);
        program.pecks.deep_hole_mm = Some(2.0);
        program.dialect.fanuc_subroutines = false;
        program.cutter.corner = Corner::Intersection { limit_degrees: 60.0 };
        program.cutter.gouge = Gouge::DropLoop;
        program.arc_radius_tolerance.inch = 0.001;
        program.pins = [("a.b".to_owned(), 1.0)].into();
        program.startup_code = "G61".into();
        program.values = [(("probe".to_owned(), "height".to_owned()), 5.0)].into();
        program.remaps = vec![Remap {
            code: "M400".into(),
            modal_group: 7,
            arguments: "P".into(),
            subroutine: "warm-up".into(),
        }];
        let found = settings(&config);
        assert_eq!(
            (found.length_unit, found.machine_unit),
            (LengthUnit::Inch, LengthUnit::Inch)
        );
        assert_eq!(found.parameters[&5221], 20.0 / 25.4);
        assert!((found.work_offsets[0][Axis::X] - 20.0).abs() < 1e-12);
        assert!(found.block_delete && found.diameter_mode);
        assert_eq!((found.digital_pins, found.analog_pins), (64, 16));
        assert_eq!((found.spindles, found.orient_offset_degrees), (3, 15.0));
        assert_eq!(found.wrapped_rotary.map(usize::from), [0, 0, 0, 0, 1, 0, 0, 0, 0]);
        assert_eq!(found.arc_radius_tolerance_mm, Some(0.0254));
        assert_eq!(
            (found.chip_breaking_clearance_mm, found.peck_clearance_mm),
            (Some(1.0), Some(2.0))
        );
        assert!(!found.fanuc_subprograms);
        assert_eq!(found.cutter_corner, Corner::Intersection { limit_degrees: 60.0 });
        assert_eq!(found.gouge, Gouge::DropLoop);
        assert_eq!(found.subroutine_folders, ["parts", "one", "two"].map(PathBuf::from));
        assert_eq!(found.user_codes, Some(vec![100, 199]));
        assert_eq!(found.remaps[0].code, "M400");
        assert_eq!((found.ini_values.len(), found.pin_values.len()), (1, 1));
        assert_eq!(found.startup_code, "G61");

        config.program.user_codes.allowed = false;
        config.unit = LengthUnit::Millimetre;
        config.program.arc_radius_tolerance.mm = 0.005;
        let found = settings(&config);
        assert_eq!(found.user_codes, Some(Vec::new()));
        assert_eq!(found.arc_radius_tolerance_mm, Some(0.005));
    }
}
