//! `[program]`, `[tools]` and what belongs to them: values, and one case per rule with its message and place.

use super::tests::{SMALL, changed};
use super::*;
use motion::canon::LengthUnit;

/// A folder with the files that a machine file may name.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["programs", "subs", "codes"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    for name in ["tool.tbl", "programs/drill.ngc", "subs/change.ngc"] {
        std::fs::write(folder.path().join(name), "").unwrap();
    }
    folder
}

fn with(folder: &Path, sections: &str) -> Result<Config, Vec<String>> {
    let path = folder.join("m.toml");
    let text = format!("{SMALL}{sections}");
    parse(&text, &path).map_err(|errors| {
        let shown = |error: &ConfigError| {
            let (line, column) = error.place.unwrap();
            let line = line - SMALL.lines().count();
            let value = error
                .value
                .as_ref()
                .map(|value| format!(" = {value}"))
                .unwrap_or_default();
            let hint = error.hint.as_ref().map(|hint| format!("; {hint}")).unwrap_or_default();
            let rule = error.rule.replace(&folder.display().to_string(), "HERE");
            format!("{line}:{column}: {}{value}: {rule}{hint}", error.key)
        };
        errors.errors().iter().map(shown).collect()
    })
}

#[test]
fn what_is_left_out_is_as_in_linuxcnc() {
    let config = parse(SMALL, Path::new("m.toml")).unwrap();
    assert_eq!(config.program, Program::default());
    assert_eq!(config.tools, Tools::default());
    assert_eq!(config.spindle, Spindle::default());
    assert_eq!(config.unit, LengthUnit::Millimetre);
    assert!(!config.axes[0].wrapped);
    let program = config.program;
    assert_eq!((program.tolerance_mm, program.look_ahead_blocks), (0.01, 10_000));
    assert_eq!(program.rapid_tolerance_mm, None);
    let buffers = (program.look_ahead_buffer_blocks, program.look_ahead_overlap_blocks);
    assert_eq!((program.threads, buffers), (None, (300, 50)));
    assert_eq!((program.parameter_file, program.directory), (None, None));
    assert_eq!((program.digital_pins, program.analog_pins), (4, 4));
    assert!(!program.user_codes.allowed && !program.block_delete && !program.dialect.diameter_mode);
    assert!(program.dialect.keep_g92 && program.dialect.fanuc_subroutines);
    assert_eq!(
        (program.pecks.chip_breaking_mm, program.pecks.deep_hole_mm),
        (None, None)
    );
    assert!((program.arc_radius_tolerance.mm - 0.028_284).abs() < 1e-6);
    assert!((program.arc_radius_tolerance.inch - 0.002_828_4).abs() < 1e-7);
    assert_eq!((config.tools.table, config.tools.changer), (None, ToolChanger::Fixed));
    assert_eq!((config.spindle.count, config.spindle.orient_offset_degrees), (1, 0.0));
}

#[test]
fn every_key_is_read_and_paths_start_at_the_machine_file() {
    let folder = folder();
    let here = |name: &str| folder.path().join(name);
    let config = with(
        folder.path(),
        r#"[program]
tolerance_mm = 0.02
rapid_tolerance_mm = 1.5
look_ahead_blocks = 500
look_ahead_buffer_blocks = 200
look_ahead_overlap_blocks = 0
planner = "classic"
threads = 3
parameter_file = "made-later.var"
directory = "programs"
subroutine_directories = ["subs", "codes"]
user_codes = true
user_code_directories = ["codes"]
user_code_timeout_s = 5
log_directory = "subs"
startup_code = "G61"
pins."Motion.digital-in-00" = 1
digital_pins = 64
analog_pins = 16
block_delete = true
optional_stop = true
diameter_mode = true
keep_g92 = false
fanuc_subroutines = false
chip_breaking_clearance_mm = 1
peck_clearance_mm = 0.5
cutter_corner = "intersection"
cutter_corner_limit_degrees = 95
gouge = "drop-loop"
feed_at_contour = true
inside_corner_feed = 0.5
inside_corner_mm = 3
inside_corner_degrees = 45
arc_radius_tolerance_mm = 0.01
arc_radius_tolerance_inch = 0.001
values.Probe = { Height = 12.5, speed = -3 }
[[program.remap]]
code = "m0400"
modal_group = 7
args = "@Pq>"
subroutine = "Drill"
[[program.remap]]
code = "T"
subroutine = "change"
[[program.remap]]
code = "g88.1"
args = "XYZn"
subroutine = "drill"
[tools]
table = "tool.tbl"
changer = "random"
[spindle]
count = 2
orient_offset_degrees = -90
"#,
    )
    .unwrap();
    let remap = |code: &str, modal_group, arguments: &str, subroutine: &str| Remap {
        code: code.into(),
        modal_group,
        arguments: arguments.into(),
        subroutine: subroutine.into(),
    };
    let value = |name: &str, value: f64| (("probe".to_owned(), name.to_owned()), value);
    let expected = Program {
        tolerance_mm: 0.02,
        rapid_tolerance_mm: Some(1.5),
        look_ahead_blocks: 500,
        look_ahead_buffer_blocks: 200,
        look_ahead_overlap_blocks: 0,
        planner: motion::plan::PlannerKind::Classic,
        threads: Some(3),
        parameter_file: Some(here("made-later.var")),
        directory: Some(here("programs")),
        subroutine_directories: vec![here("subs"), here("codes")],
        user_codes: UserCodes {
            allowed: true,
            directories: vec![here("codes")],
            timeout_s: 5.0,
        },
        log_directory: Some(here("subs")),
        startup_code: "G61".into(),
        pins: [("motion.digital-in-00".to_owned(), 1.0)].into(),
        digital_pins: 64,
        analog_pins: 16,
        block_delete: true,
        optional_stop: true,
        dialect: Dialect {
            diameter_mode: true,
            keep_g92: false,
            fanuc_subroutines: false,
        },
        pecks: Pecks {
            chip_breaking_mm: Some(1.0),
            deep_hole_mm: Some(0.5),
        },
        cutter: Cutter {
            corner: ::compensation::Corner::Intersection { limit_degrees: 95.0 },
            gouge: ::compensation::Gouge::DropLoop,
            feed: ::compensation::FeedSettings {
                arcs: true,
                inside_corners: Some(::compensation::InsideCorners {
                    share: 0.5,
                    distance_mm: Some(3.0),
                    bend_degrees: 45.0,
                }),
            },
        },
        arc_radius_tolerance: ArcTolerance { mm: 0.01, inch: 0.001 },
        values: [value("height", 12.5), value("speed", -3.0)].into(),
        remaps: vec![
            remap("M400", 7, "@Pq>", "drill"),
            remap("T", 0, "", "change"),
            remap("G88.1", 1, "XYZn", "drill"),
        ],
    };
    assert_eq!(config.program, expected);
    assert_eq!(
        config.tools,
        Tools {
            table: Some(here("tool.tbl")),
            changer: ToolChanger::Random
        }
    );
    assert_eq!((config.spindle.count, config.spindle.orient_offset_degrees), (2, -90.0));
}

#[test]
fn units_and_wrapped_axes_are_read() {
    let text =
        changed("\n[bus]", "\nunits = \"inch\"\n[bus]").replace("letter = \"X\"", "letter = \"B\"\nwrapped = true");
    let config = parse(&text, Path::new("m.toml")).unwrap();
    assert_eq!(config.unit, LengthUnit::Inch);
    assert!(config.axes[0].wrapped);
    let text = changed("letter = \"X\"", "letter = \"X\"\nwrapped = true");
    assert_eq!(
        super::tests::messages(&text),
        ["m.toml:27:11: axis[0].wrapped = true: only A, B and C turn without end"]
    );
}

#[test]
fn each_rule_has_its_message() {
    let folder = folder();
    let cases: &[(&str, &[&str])] = &[
        (
            "[program]\nparameter_file = \"no/m.var\"\ndirectory = \"nowhere\"\nlog_directory = \"x\"\noptional_stop = 1\nstartup_code = 5\ndigital_pins = 0\nanalog_pins = 17",
            &[
                "2:18: program.parameter_file = \"no/m.var\": there is no folder HERE/no",
                "3:13: program.directory = \"nowhere\": there is no folder HERE/nowhere",
                "4:17: program.log_directory = \"x\": there is no folder HERE/x",
                "5:17: program.optional_stop = 1: must be true or false, is an integer",
                "6:16: program.startup_code = 5: must be a string, is an integer",
                "7:16: program.digital_pins = 0: must be an integer from 1 to 64",
                "8:15: program.analog_pins = 17: must be an integer from 1 to 16",
            ],
        ),
        (
            "[program]\nparameter_file = \"subs\"\ndirectory = \"\"\nsubroutine_directories = [\"subs\", \"x\", 5]\nblock_delete = 1",
            &[
                "2:18: program.parameter_file = \"subs\": is no file: HERE/subs",
                "3:13: program.directory = \"\": must be a path",
                "4:35: program.subroutine_directories[1] = \"x\": there is no folder HERE/x",
                "4:40: program.subroutine_directories[2] = 5: must be a string, is an integer",
                "5:16: program.block_delete = 1: must be true or false, is an integer",
            ],
        ),
        (
            "[program]\nuser_codes = true\nchip_breaking_clearance_mm = -1\npeck_clearance_mm = 101\narc_radius_tolerance_mm = 0.03\narc_radius_tolerance_inch = 0.00001\n",
            &[
                "2:14: program.user_codes = true: needs user_code_directories, where the files M100 to M199 are",
                "3:30: program.chip_breaking_clearance_mm = -1: must lie between 0 and 100",
                "4:21: program.peck_clearance_mm = 101: must lie between 0 and 100",
                "5:27: program.arc_radius_tolerance_mm = 0.03: must lie between 0.001 and 0.028284271247461905",
                "6:29: program.arc_radius_tolerance_inch = 0.00001: must lie between 0.00004 and 0.0028284271247461905",
            ],
        ),
        (
            "[program]\nsubroutine_directories = [\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\"]\noptional_stop = 2\nstartupcode = \"\"\n",
            &[
                "2:26: program.subroutine_directories = [\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\",\"a\"]: must not be more than 10 folders, are 11",
                "3:17: program.optional_stop = 2: must be true or false, is an integer",
                "4:1: program.startupcode: unknown key; did you mean `startup_code`?",
            ],
        ),
        (
            "[program]\ncutter_corner = \"arcs\"\ngouge = \"drop-lop\"\ncutter_corner_limit_degrees = 180\n",
            &[
                "2:17: program.cutter_corner = \"arcs\": must be \"arc\" or \"intersection\"; did you mean \"arc\"?",
                "3:9: program.gouge = \"drop-lop\": must be \"error\" or \"drop-loop\" or \"neighbours-only\"; did you mean \"drop-loop\"?",
                "4:31: program.cutter_corner_limit_degrees = 180: must lie between 1 and 160",
            ],
        ),
        (
            "[program]\ncutter_corner_limit_degrees = 80\n",
            &["2:31: program.cutter_corner_limit_degrees = 80: needs cutter_corner = \"intersection\""],
        ),
        (
            "[program]\ninside_corner_mm = 2\n",
            &["2:20: program.inside_corner_mm = 2: needs inside_corner_feed"],
        ),
        (
            "[program]\ninside_corner_feed = 0\n",
            &["2:22: program.inside_corner_feed = 0: must lie between 0.05 and 1"],
        ),
        (
            "[program.values]\nprobe = 5\n[program.values.a]\nx = 1\nX = 2\ny = \"z\"\n",
            &[
                "2:9: program.values.probe = 5: must be a table, is an integer",
                "5:5: program.values.a.X = 2: stands here twice: case does not matter to programs",
                "6:5: program.values.a.y = \"z\": must be a number, is a string",
            ],
        ),
        (
            "[tools]\ntable = \"tol.tbl\"\nchanger = \"randm\"\n",
            &[
                "2:9: tools.table = \"tol.tbl\": HERE/tol.tbl: No such file or directory (os error 2)",
                "3:11: tools.changer = \"randm\": must be \"fixed\" or \"random\"; did you mean \"random\"?",
            ],
        ),
        (
            "[spindle]\ncount = 9\norient_offset_degrees = 361\n",
            &[
                "2:9: spindle.count = 9: must be an integer from 1 to 8",
                "3:25: spindle.orient_offset_degrees = 361: must lie between -360 and 360",
            ],
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(with(folder.path(), text).unwrap_err(), *expected, "{text}");
    }
}

#[test]
fn codes_that_may_be_remapped_are_linuxcncs() {
    let folder = folder();
    let remap = |code: &str, rest: &str| {
        let text = format!(
            "[program]\ndirectory = \"programs\"\n[[program.remap]]\ncode = \"{code}\"\nsubroutine = \"drill\"\n{rest}"
        );
        with(folder.path(), &text).map(|config| config.program.remaps[0].clone())
    };
    for (code, name, group) in [
        ("M0", "M0", 10),
        ("m1", "M1", 10),
        ("M6", "M6", 10),
        ("M060", "M60", 10),
        ("M61", "M61", 10),
        ("M10", "M10", 10),
        ("M100", "M100", 10),
        ("M999", "M999", 10),
        ("G28", "G28", 1),
        ("g30.1", "G30.1", 1),
        ("G0.1", "G0.1", 1),
        ("G01.5", "G1.5", 1),
        ("G99.9", "G99.9", 1),
        ("F", "F", 0),
        ("s", "S", 0),
    ] {
        let found = remap(code, "").unwrap();
        assert_eq!((found.code.as_str(), found.modal_group), (name, group), "{code}");
    }
    let kept_m = "keeps its meaning; M0, M1, M6, M60, M61 and unused codes up to M999 may be remapped";
    let kept_g = "keeps its meaning; G28, G28.1, G30, G30.1 and unused codes may be remapped";
    let form = "must be a G code from G0.1 to G99.9 with one decimal at most, such as \"G88.1\"";
    for (code, rule) in [
        ("M3", format!("M3 {kept_m}")),
        ("M98", format!("M98 {kept_m}")),
        ("M1000", "must not be above M999".into()),
        ("M99999", "must not be above M999".into()),
        ("G1", format!("G1 {kept_g}")),
        ("G38.2", format!("G38.2 {kept_g}")),
        ("G100", form.into()),
        ("G1.23", form.into()),
        ("G", form.into()),
        ("M", "must be a G code, an M code, \"T\", \"S\" or \"F\"".into()),
        ("T1", "must be a G code, an M code, \"T\", \"S\" or \"F\"".into()),
        ("µ", "must be a G code, an M code, \"T\", \"S\" or \"F\"".into()),
        ("", "must be a G code, an M code, \"T\", \"S\" or \"F\"".into()),
    ] {
        let expected = format!("4:8: program.remap[0].code = \"{code}\": {rule}");
        assert_eq!(remap(code, "").unwrap_err(), [expected]);
    }
    assert_eq!(
        remap("T", "modal_group = 5").unwrap_err(),
        ["6:15: program.remap[0].modal_group = 5: must be left out: T, S and F have their own place in a block"]
    );
    assert_eq!(
        remap("G5.5", "modal_group = 2").unwrap_err(),
        ["6:15: program.remap[0].modal_group = 2: must be an integer from 1 to 1"]
    );
    assert_eq!(
        remap("M400", "modal_group = 3").unwrap_err(),
        ["6:15: program.remap[0].modal_group = 3: must be an integer from 4 to 10"]
    );
    assert_eq!(
        remap("M50", "args = \"Pp\"").unwrap_err()[1],
        "6:8: program.remap[0].args = \"Pp\": 'p' stands here twice"
    );
    let words = remap("M400", "args = \"PM\"").unwrap_err();
    assert!(words[0].starts_with("6:8: program.remap[0].args = \"PM\": 'M' is no word that can be handed on: "));
}

#[test]
fn a_remap_needs_its_subroutine_and_stands_once() {
    let folder = folder();
    let head = "[program]\ndirectory = \"programs\"\nsubroutine_directories = [\"subs\"]\n";
    let cases: &[(&str, &[&str])] = &[
        (
            "[[program.remap]]\n",
            &[
                "4:1: program.remap[0].code: is missing: the code, such as \"M400\", \"G88.1\", \"M6\" or \"T\"",
                "4:1: program.remap[0].subroutine: is missing: the name of the subroutine and of its file, without .ngc",
            ],
        ),
        (
            "[[program.remap]]\ncode = \"M400\"\nsubroutine = \"dril\"\n",
            &["6:14: program.remap[0].subroutine = \"dril\": there is no file dril.ngc in HERE/programs, HERE/subs"],
        ),
        (
            "[[program.remap]]\ncode = \"M400\"\nsubroutine = \"drill.ngc\"\n",
            &[
                "6:14: program.remap[0].subroutine = \"drill.ngc\": must be a name of letters, digits, _ and -, without .ngc",
            ],
        ),
        (
            "[[program.remap]]\ncode = \"M400\"\nsubroutine = \"drill\"\n[[program.remap]]\ncode = \"m0400\"\nsubroutine = \"change\"\npython = \"x\"\n",
            &[
                "8:8: program.remap[1].code = \"m0400\": is remapped above already",
                "10:1: program.remap[1].python: unknown key; known here: code, modal_group, args, subroutine",
            ],
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(
            with(folder.path(), &format!("{head}{text}")).unwrap_err(),
            *expected,
            "{text}"
        );
    }
    let alone = "[[program.remap]]\ncode = \"M400\"\nsubroutine = \"drill\"\n";
    assert_eq!(
        with(folder.path(), alone).unwrap_err(),
        [
            "3:14: program.remap[0].subroutine = \"drill\": there is no file drill.ngc: neither program.directory nor \
          program.subroutine_directories is given"
        ]
    );
}
