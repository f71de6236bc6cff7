//! The files that ship: every machine file is good, every program runs on the demo machine within its limits.
//!
//! The rules of the machine file are tested one by one beside its reader.

use gcode::Interpreter;
use isocnc::config::{self, Config, ConfigErrors};
use isocnc::machine::tables::Tables;
use isocnc::program::settings_with;
use motion::canon::{Call, Event, Position};
use motion::plan::{AxisLimits, Settings, check::check, deviation::deviation, plan_offline};
use std::path::{Path, PathBuf};

const DEMO: &str = include_str!("../configs/mill3-demo.toml");

fn parse(text: &str) -> Result<Config, ConfigErrors> {
    config::parse(text, Path::new("m.toml"))
}

/// All files in `configs` whose names end so, by name.
fn shipped(extension: &str) -> Vec<PathBuf> {
    let folder = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/configs")).unwrap();
    let mut paths: Vec<PathBuf> = folder.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|found| found == extension));
    // It is of no machine: isocnc-cell plan reads it.
    paths.retain(|path| !path.ends_with("cell-cost.toml"));
    paths.sort();
    paths
}

#[test]
fn every_machine_file_that_ships_is_good() {
    let files = shipped("toml");
    assert!(files.len() >= 2, "{files:?}");
    for file in files {
        config::read(&file).unwrap_or_else(|errors| panic!("{errors}"));
    }
}

/// A machine file with its commented keys of these names switched on.
fn switched_on(text: &str, keys: &[&str]) -> String {
    let mut text = text.to_owned();
    for key in keys {
        assert_eq!(text.matches(&format!("\n# {key}")).count(), 1, "{key}");
        text = text.replace(&format!("\n# {key}"), &format!("\n{key}"));
    }
    text
}

#[test]
fn the_tables_that_ship_are_those_of_the_example_mills() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let is_mill = |file: &PathBuf| {
        file.file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with("mill3"))
    };
    let mills: Vec<PathBuf> = shipped("toml").into_iter().filter(is_mill).collect();
    assert_eq!(mills.len(), 3, "{mills:?}");
    for file in mills {
        let text = std::fs::read_to_string(&file).unwrap();
        let text = switched_on(&text, &["[tools]", "table =", "changer =", "parameter_file ="]);
        let config = config::parse(&text, &file).unwrap_or_else(|errors| panic!("{errors}"));
        assert_eq!(config.tools.table, Some(folder.join("mill3.tbl")));
        assert_eq!(config.program.parameter_file, Some(folder.join("mill3.var")));

        let table = std::fs::read(config.tools.table.unwrap()).unwrap();
        let table = gcode::ToolTable::parse(&table, config.unit, config.tools.changer).unwrap();
        let tools: Vec<_> = table.tools().map(|tool| (tool.number, tool.diameter_mm)).collect();
        assert_eq!(tools, [(1, 6.0), (2, 3.0), (3, 5.0), (99, 0.0)]);

        // The file is as it is written again, and has the work offset that the machine file has.
        let text = std::fs::read_to_string(config.program.parameter_file.unwrap()).unwrap();
        let parameters = gcode::parameter::file::parse(text.as_bytes()).unwrap();
        assert_eq!(gcode::parameter::file::write(&parameters), text);
        let value = |number: u16| parameters.iter().find(|entry| entry.0 == number).unwrap().1;
        let origin = Position::xyz(value(5221), value(5222), value(5223));
        assert_eq!((origin, value(5220)), (config.work_offsets[0], 1.0));
    }
}

/// The demo machine as the planner sees it, standing at its home points.
fn demo_machine() -> (Config, Settings) {
    let config = parse(DEMO).unwrap_or_else(|errors| panic!("{errors}"));
    let mut settings = Settings {
        tolerance_mm: config.program.tolerance_mm,
        look_ahead_blocks: config.program.look_ahead_blocks,
        planner_kind: config.program.planner,
        ..Settings::new([None; 9], f64::from(config.cycle_us) * 1e-6)
    };
    for map in &config.axes {
        let joint = &config.joints[map.joints[0]];
        settings.start[map.axis] = joint.homing.position_mm;
        settings.axes[map.axis as usize] = Some(AxisLimits {
            velocity: joint.limits.velocity_mm_s,
            acceleration: joint.limits.acceleration_mm_s2,
            jerk: joint.limits.jerk_mm_s3,
            travel: joint.travel_mm,
        });
    }
    (config, settings)
}

/// Distance of a point from the polygon of set-points.
fn distance_mm(samples: &[Position], point: Position) -> f64 {
    let distance_mm = |pair: &[Position]| {
        let along = [0, 1, 2].map(|i| pair[1].0[i] - pair[0].0[i]);
        let to_point = [0, 1, 2].map(|i| point.0[i] - pair[0].0[i]);
        let square = along.iter().map(|a| a * a).sum::<f64>();
        let dot = along.iter().zip(&to_point).map(|(a, b)| a * b).sum::<f64>();
        let share = if square > 0.0 {
            (dot / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let off = [0, 1, 2].map(|i| to_point[i] - share * along[i]);
        off.iter().map(|a| a * a).sum::<f64>().sqrt()
    };
    samples.windows(2).map(distance_mm).fold(f64::INFINITY, f64::min)
}

/// Interprets and plans a program on the demo machine; its set-points must keep travel, speed, acceleration, jerk and
/// tolerance. Returns what it does and how long it moves.
fn run(program: &Path) -> (Vec<Event>, f64) {
    let (config, settings) = demo_machine();
    let tables = Tables::read(&config).unwrap();
    let of_gcode = settings_with(&config, &tables, settings.start);
    let name = program.display();
    let text = std::fs::read(program).unwrap();
    let errors = gcode::check(&text, of_gcode.clone());
    let shown: Vec<String> = errors.iter().map(|error| error.render(&name.to_string())).collect();
    assert!(shown.is_empty(), "{}", shown.join("\n"));
    let events: Result<Vec<Event>, _> = Interpreter::new(of_gcode).run(&text).collect();
    let events = events.unwrap();
    let plan = plan_offline(&events, settings).unwrap_or_else(|error| panic!("{name}: {error}"));
    for (axis, limits) in settings.axes.iter().enumerate() {
        let Some(AxisLimits {
            travel: [low, high], ..
        }) = *limits
        else {
            continue;
        };
        let outside = plan
            .samples
            .iter()
            .find(|position| !(low..=high).contains(&position.0[axis]));
        assert_eq!(outside, None, "{name}: axis {axis}");
    }
    assert_eq!(
        check(&plan.samples, settings.cycle_s, &settings.axes).over(),
        0,
        "{name}"
    );
    let path = deviation(&plan.samples, &plan.ideal, settings.tolerance_mm);
    assert!(path.off_mm <= settings.tolerance_mm, "{name}: {path:?}");
    assert!(path.length_mm - path.reached_mm < 0.1, "{name}: {path:?}");
    for part in &plan.ideal {
        let end = part.piece.position(part.piece.length());
        let missed_mm = distance_mm(&plan.samples, end);
        assert!(
            missed_mm <= settings.tolerance_mm,
            "{name}:{}: end missed by {missed_mm} mm",
            part.line
        );
    }
    (events, plan.motion_time_s)
}

#[test]
fn every_program_that_ships_runs_on_the_demo_machine() {
    let programs = shipped("ngc");
    assert!(programs.len() >= 2, "{programs:?}");
    for program in programs {
        let (events, _) = run(&program);
        let name = program.display();
        let mut last = events
            .iter()
            .rev()
            .map(|event| &event.call)
            .skip_while(|call| **call == Call::Reset);
        assert_eq!(last.next(), Some(&Call::ProgramEnd), "{name}");
    }
}

#[test]
fn the_sample_part_takes_one_to_two_minutes_and_the_short_one_seconds() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let (events, time_s) = run(&folder.join("sample-part.ngc"));
    assert!((60.0..=120.0).contains(&time_s), "{time_s} s");
    // A part that shows what the control can do: straight lines, arcs, helices, tool lifts.
    let arcs = events
        .iter()
        .filter(|event| matches!(event.call, Call::ArcFeed { .. }))
        .count();
    let lifts = events
        .iter()
        .filter(|event| matches!(event.call, Call::StraightTraverse { .. }))
        .count();
    assert!(arcs >= 20 && lifts >= 10, "{arcs} arcs, {lifts} rapids");
    let (_, time_s) = run(&folder.join("short-part.ngc"));
    assert!((3.0..=10.0).contains(&time_s), "{time_s} s");
}

#[test]
fn one_mistake_does_not_hide_another() {
    let text = DEMO
        .replace("priority = 80", "prio = 80")
        .replace("jerk_mm_s3 = 20000.0", "jerk_mm_s3 = 0")
        .replace("letter = \"Y\"", "letter = \"X\"");
    let errors = parse(&text).unwrap_err();
    let keys: Vec<&str> = errors.errors().iter().map(|error| error.key.as_str()).collect();
    assert_eq!(keys, ["rt.prio", "joint[2].jerk_mm_s3", "axis[1].letter"]);
}

/// The check before a run tells what the report of the run judges by.
#[test]
fn the_tolerance_of_a_program_is_what_it_allows_its_moves() {
    let config = parse(DEMO).unwrap();
    let tables = Tables::read(&config).unwrap();
    let cancel = motion::cancel::Cancel::default();
    let tolerance_mm = |text: &str| {
        let begin = isocnc::program::Begin::at_home(&config);
        let checked = isocnc::program::check(&config, &tables, "part.ngc", text.as_bytes(), &begin, &cancel);
        checked.unwrap_or_else(|errors| panic!("{errors}")).tolerance_mm
    };
    assert_eq!(tolerance_mm("G21 G64 P0.05\nG1 X1 F100\nG64 P0.5\nM2\n"), 0.05);
    assert_eq!(
        tolerance_mm("G21 G64 P0.05 F100\nG5.2 P1 L3 X0 Y0\nX1 Y1 P1\nX2 Y0 P1\nG5.3\nM2\n"),
        0.05
    );
    assert_eq!(tolerance_mm("G21 G61\nG1 X1 F100\nM2\n"), 0.0);
    assert_eq!(tolerance_mm("G21 G64\nG1 X1 F100\nM2\n"), config.program.tolerance_mm);
}

/// No joints and no axes are a machine if the file says so.
#[test]
fn a_machine_of_inputs_and_outputs_runs_no_programs_and_says_why() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/io-only.toml");
    let config = config::read(&file).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(
        (config.joints.len(), config.axes.len(), config.bus.nodes.len()),
        (0, 0, 2)
    );
    let tables = Tables::read(&config).unwrap();
    let cancel = motion::cancel::Cancel::default();
    let begin = isocnc::program::Begin::at_home(&config);
    let refused = isocnc::program::check(&config, &tables, "part.ngc", b"M2\n", &begin, &cancel).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "part.ngc: cannot be run: io-only has no joints: it exchanges inputs and outputs, and moves nothing"
    );
    let text = std::fs::read_to_string(&file).unwrap();
    // Not by leaving something out.
    let errors = parse(&text.replace("kinematics = \"none\"", ""))
        .unwrap_err()
        .to_string();
    assert!(
        errors.contains("joint: is missing: at least one [[joint]] is needed"),
        "{errors}"
    );
    // Not by leaving something out.
    let errors = parse(&text.replace("kinematics = \"none\"", ""))
        .unwrap_err()
        .to_string();
    assert!(
        errors.contains("joint: is missing: at least one [[joint]] is needed"),
        "{errors}"
    );
    for (half, refused) in [
        (
            "[[axis]]\nletter = \"X\"\njoints = []\n",
            "axis: cannot be: machine.kinematics is \"none\"",
        ),
        (
            "[[joint]]\nnode = 10\n",
            "joint: cannot be: machine.kinematics is \"none\"",
        ),
    ] {
        let errors = parse(&format!("{text}{half}")).unwrap_err().to_string();
        assert!(errors.contains(refused), "{errors}");
    }
}

/// A program that changes the tool must not wait for ever at a machine that nobody stands beside.
#[test]
fn what_is_simulated_answers_the_tool_change_of_each_program_that_it_can_run() {
    const CHANGED: &str = "iocontrol.0.tool-changed";
    let cancel = motion::cancel::Cancel::default();
    let (mut machines, mut waiting) = (0, Vec::new());
    for file in shipped("toml")
        .iter()
        .filter(|file| file.to_string_lossy().ends_with("-demo.toml"))
    {
        let config = config::read(file).unwrap_or_else(|errors| panic!("{errors}"));
        let tables = Tables::read(&config).unwrap();
        let changes_tools = |program: &PathBuf| {
            let text = std::fs::read_to_string(program).unwrap();
            let begin = isocnc::program::Begin::at_home(&config);
            text.contains("M6")
                && isocnc::program::check(&config, &tables, "p.ngc", text.as_bytes(), &begin, &cancel).is_ok()
        };
        let Some(program) = shipped("ngc").into_iter().find(changes_tools) else {
            continue;
        };
        machines += 1;
        let mut targets = config.nets.iter().flat_map(|net| &net.targets);
        if !targets.any(|pin| pin == CHANGED) {
            waiting.push(format!("{} waits in {}", file.display(), program.display()));
        }
    }
    assert!(waiting.is_empty(), "{CHANGED}: {waiting:#?}");
    assert!(machines >= 3, "{machines} machines run a program with a tool change");
}

/// What a control would not start with is found by `check`, too, and told with its place where it has one.
#[test]
fn a_check_refuses_what_a_start_refuses() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let isocnc = |words: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_isocnc"))
            .args(words)
            .current_dir(folder.path())
            .output()
            .unwrap();
        let text = |octets: Vec<u8>| String::from_utf8(octets).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    write("bad.tbl", "T1 P1 D6.0\nT2 P2 D-\n");
    write("good.ngc", "M2\n");
    let cases = [
        ("[tools]\ntable = \"bad.tbl\"\n", "bad.tbl:2:", &["good.ngc"][..]),
        ("[program]\nstartup_code = \"G61.7\"\n", "G61.7", &["good.ngc"]),
        ("[[logic]]\nfile = \"none.st\"\nperiod_ms = 10\n", "none.st", &[]),
        #[cfg(not(feature = "cell"))]
        (
            "[cell]\nsupervisor = \"a:1\"\ncertificate = \"c\"\nkey = \"k\"\nca = \"a\"\n",
            "built without the link to a supervisor",
            &[],
        ),
    ];
    for (text, expected, program) in cases {
        let machine = DEMO.replacen("[machine]\n", "[machine]\nstate_directory = \"state\"\n", 1);
        let machine = machine.replacen("kind = \"powerlink\"", "kind = \"memory\"", 1);
        match text.starts_with("[program]") {
            true => write("m.toml", &machine.replacen("[program]\n", text, 1)),
            false => write("m.toml", &format!("{machine}\n{text}")),
        }
        let (code, _, said) = isocnc(&["check", "m.toml"]);
        assert!(code == Some(1) && said.contains(expected), "{text}: {said}");
        let (code, _, said) = isocnc(&[&["run", "m.toml"][..], program].concat());
        assert!(code == Some(1) && said.contains(expected), "{text}: {said}");
        let (_, json, _) = isocnc(&["check", "m.toml", "--json"]);
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert!(json["errors"][0]["rule"].is_string(), "{text}: {json}");
    }
    // Of a table each mistake has its line and column, in words alone.
    write("m.toml", &format!("{DEMO}\n[tools]\ntable = \"bad.tbl\"\n"));
    let (_, json, _) = isocnc(&["check", "m.toml", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (&json["file"], &json["errors"][0]["line"]),
        (&"bad.tbl".into(), &2.into())
    );
    assert!(!json["errors"][0]["rule"].as_str().unwrap().contains('\n'), "{json}");
    write("m.toml", DEMO);
    assert_eq!(isocnc(&["check", "m.toml"]).0, Some(0));
    // So has one of a program; nothing is drawn for people in it.
    write("m.toml", &DEMO.replacen("kind = \"powerlink\"", "kind = \"memory\"", 1));
    write("bad.ngc", "G21\nG1 X1 F100\n  X2 Q\nM2\n");
    let (code, json, _) = isocnc(&["run", "m.toml", "bad.ngc", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let error = &json["errors"][0];
    assert_eq!(
        (code, &json["file"], &error["line"]),
        (Some(1), &"bad.ngc".into(), &3.into())
    );
    assert!(error["column"].as_u64().is_some_and(|column| column > 1), "{json}");
    assert!(!error["rule"].as_str().unwrap().contains('\n'), "{json}");
    // What is in the way of a report is told before the program is looked at.
    assert!(!folder.path().join("isocnc-out").exists());
    write("isocnc-out", "");
    let (code, _, said) = isocnc(&["run", "m.toml", "bad.ngc"]);
    assert!(
        code == Some(1) && said.contains("isocnc-out") && !said.contains("bad.ngc"),
        "{said}"
    );
    let (code, _, said) = isocnc(&["plan", "m.toml", "bad.ngc", "--svg", "none/a.svg"]);
    assert!(
        code == Some(1) && said.contains("none/a.svg") && !said.contains("bad.ngc"),
        "{said}"
    );
    // Wrong usage that only several options show.
    let (code, _, said) = isocnc(&["bus", "trace", "x.pcap", "--from", "2", "--to", "1"]);
    assert_eq!((code, said.as_str()), (Some(2), "isocnc: --from 2 is behind --to 1\n"));
}
