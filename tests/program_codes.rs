//! Codes by which a program waits for others, reads and writes: M19, M100 to M199, `#<_hal[]>`, logs, M70 to M73, on virtual time.

use hal_pins::Input;
use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::tables::Tables;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::program::{Begin, check};
use isocnc::rt::shared::Command;
use isocnc::rt::waiting::Waiting;
use isocnc::sim::NetConfig;
use motion::cancel::Cancel;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

const MILL: &str = include_str!("../configs/mill3-demo.toml");
const LATHE: &str = include_str!("../configs/lathe2-demo.toml");
const CYCLES_MAX: u64 = 2_000_000;
/// What orients the simulated spindle: an output of the node, and the input that tells that it is there.
const ORIENT: &str = "\n[[hal.net]]\nname = \"orient\"\nsource = \"spindle.0.orient\"\ntargets = [\"io.10.out-15\"]\n\
    [[hal.net]]\nname = \"oriented\"\nsource = \"io.10.in-15\"\ntargets = [\"spindle.0.is-oriented\"]\n";

fn machine(text: &str) -> Config {
    config::parse(text, Path::new("machine.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

fn rehearse_part<T>(config: &Config, text: &str, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    rehearse(config, text.as_bytes(), NetConfig::clean(1), |run| Ok(act(run))).expect("a machine to rehearse on")
}

fn bit(run: &Rehearsal<'_>, name: &str) -> Input<bool> {
    run.hal.reader(name).expect("a pin")
}

/// Runs to the end; what was wrong, if anything.
fn end_of(config: &Config, text: &str) -> Result<Outcome, String> {
    rehearse_part(config, text, |run| {
        run.run(CYCLES_MAX).map_err(|error| error.to_string())
    })
}

/// What a check says of a program.
fn refused(config: &Config, text: &str) -> String {
    let tables = Tables::read(config).expect("tables");
    let checked = check(
        config,
        &tables,
        "p.ngc",
        text.as_bytes(),
        &Begin::at_home(config),
        &Cancel::default(),
    );
    checked.expect_err("a program that is refused").to_string()
}

const ORIENTED: &str = "G21 G90 G18 G94 F1000\nS600 M3\nG4 P0.5\nM19 R0 Q10\nG4 P0.2\nG1 X10\nM3\nG4 P0.2\nM5\nM2\n";

#[test]
fn m19_turns_the_spindle_to_its_angle_and_holds_it_until_it_is_told_something_else() {
    let config = machine(&format!("{LATHE}{ORIENT}"));
    rehearse_part(&config, ORIENTED, |run| {
        let revs: Input<f64> = run.hal.reader("spindle.0.revs").expect("a pin");
        let line: Input<u32> = run.hal.reader("motion.program-line").expect("a pin");
        let pins = ["orient", "locked", "brake", "on"].map(|name| bit(run, &format!("spindle.0.{name}")));
        let mut held = Vec::new();
        let mut seen = Vec::new();
        let ended = run.run_until(CYCLES_MAX, |run| {
            let now = pins.each_ref().map(Input::get);
            if seen.last() != Some(&now) {
                seen.push(now);
            }
            if line.get() == 6 {
                held.push(revs.get());
            }
            run.operator.outcome().is_some()
        });
        assert!(ended.expect("a good program"));
        assert_eq!(
            run.operator.outcome(),
            Some(Outcome::Completed),
            "{:#?}",
            run.operator.journal()
        );
        // orient, locked, brake, on: turns; turns to its angle; is held there; turns again; is off.
        let turning = [false, false, false, true];
        let off = [false; 4];
        assert_eq!(
            seen,
            [
                off,
                turning,
                [true, false, false, false],
                [false, true, true, false],
                turning,
                off
            ]
        );
        // 4096 counts a turn.
        assert!(held.len() > 100);
        assert!(
            held.iter().all(|revs| (revs - revs.round()).abs() < 2e-3),
            "{:?}",
            held.first()
        );
    });
}

#[test]
fn m19_without_q_is_waited_for_before_anything_moves() {
    let config = machine(&format!("{LATHE}{ORIENT}"));
    let text = ORIENTED.replace(" Q10\nG4 P0.2", "");
    rehearse_part(&config, &text, |run| {
        let line: Input<u32> = run.hal.reader("motion.program-line").expect("a pin");
        let (speed, locked): (Input<f64>, _) = (
            run.hal.reader("motion.current-vel").expect("a pin"),
            bit(run, "spindle.0.locked"),
        );
        let mut moved_loose = 0;
        let ended = run.run_until(CYCLES_MAX, |run| {
            moved_loose += u32::from(line.get() == 5 && speed.get() > 0.0 && !locked.get());
            run.operator.outcome().is_some()
        });
        assert!(ended.expect("a good program"));
        assert_eq!((run.operator.outcome(), moved_loose), (Some(Outcome::Completed), 0));
    });
}

#[test]
fn a_bare_m19_is_refused_in_words() {
    let shown = refused(&machine(LATHE), "G21\nM19\nM2\n");
    assert!(
        shown.contains("p.ngc:2:1") && shown.contains("orients nothing"),
        "{shown}"
    );
}

#[test]
fn an_angle_that_is_not_reached_is_a_fault_that_says_so() {
    // Nothing orients this one.
    let alarm = |fault: i32| {
        rehearse_part(&machine(LATHE), ORIENTED, |run| {
            run.hal.set("spindle.0.orient-fault", fault).expect("a pin");
            let _ = run.run_until(60_000, |run| {
                run.operator.alarm().is_some() || run.operator.outcome().is_some()
            });
            assert!(!bit(run, "spindle.0.locked").get());
            run.operator
                .alarm()
                .map(|alarm| alarm.cause.text.clone())
                .unwrap_or_default()
        })
    };
    let late = alarm(0);
    assert!(late.contains("within 10 s") && late.contains("M19"), "{late}");
    let fault = alarm(7);
    assert!(fault.contains("fault 7"), "{fault}");
}

#[test]
fn a_stop_ends_the_wait_for_an_angle_and_nothing_orients_any_more() {
    rehearse_part(&machine(LATHE), ORIENTED, |run| {
        let orient = bit(run, "spindle.0.orient");
        run.run_until(CYCLES_MAX, |_| orient.get()).expect("a good program");
        run.operator.give(Command::Stop);
        run.run(CYCLES_MAX).expect("an end");
        assert!(!orient.get());
    });
}

/// A machine with the programs of the user in a folder.
fn with_user_codes(folder: &Path, timeout_s: f64, programs: &[(&str, &str)]) -> Config {
    let mut config = machine(MILL);
    for (name, text) in programs {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("a program");
    }
    let codes = &mut config.program.user_codes;
    (codes.allowed, codes.directories, codes.timeout_s) = (true, vec![folder.to_owned()], timeout_s);
    config
}

#[test]
fn a_code_of_the_user_runs_at_rest_and_the_program_waits_for_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = folder.path().join("told");
    let script = format!(
        "#!/bin/sh\n{{ echo \"$1 $2 $#\"; grep -E '^(CapEff|CapPrm|NoNewPrivs|NSpgid)' /proc/self/status; ulimit -r; }} >> {}\nsleep 0.05\n",
        told.display()
    );
    let config = with_user_codes(folder.path(), 60.0, &[("M101", &script)]);
    let text = "G21 G90 G64 P0.05 F6000\nG1 X20\nM101 P1.5 Q-2\nG1 X40\nM101\nM2\n";
    rehearse_part(&config, text, |run| {
        let (x, speed): (Input<f64>, Input<f64>) = (
            run.hal.reader("axis.x.pos-cmd").expect("a pin"),
            run.hal.reader("motion.current-vel").expect("a pin"),
        );
        let mut at = None;
        let ended = run.run_until(CYCLES_MAX, |run| {
            if at.is_none() && told.exists() {
                at = Some((x.get(), speed.get()));
            }
            run.operator.outcome().is_some()
        });
        assert!(ended.expect("a good program"));
        assert_eq!(
            run.operator.outcome(),
            Some(Outcome::Completed),
            "{:#?}",
            run.operator.journal()
        );
        let (x, speed) = at.expect("it ran");
        assert!(
            (x - 40.0).abs() < 1e-6 && speed == 0.0,
            "at rest behind the moves before it: {x} {speed}"
        );
    });
    let told = std::fs::read_to_string(told).expect("it ran");
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines[0], "1.500000 -2.000000 2");
    assert!(lines.contains(&"-1.000000 -1.000000 2"), "{told}");
    assert!(lines.contains(&"0"), "no real-time priority: {told}");
}

#[test]
fn a_code_of_the_user_that_fails_is_an_error_at_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let failing = "#!/bin/sh\necho first\necho 'no vacuum' >&2\necho\nexit 3\n";
    let programs = [
        ("M110", failing),
        ("M111", "#!/bin/sh\nkill -9 $$\n"),
        ("M112", "#!/bin/sh\nsleep 100\n"),
        ("M113", "#!/nowhere\n"),
    ];
    let config = with_user_codes(folder.path(), 0.2, &programs);
    let why = |code: &str| end_of(&config, &format!("G21\nG0 X1\n{code}\nG0 X2\nM2\n")).expect_err(code);
    let shown = why("M110");
    assert!(
        shown.contains("program:3:") && shown.contains("exit code 3") && shown.contains("no vacuum"),
        "{shown}"
    );
    assert!(why("M111").contains("signal: 9"));
    assert!(why("M112").contains("longer than 0.2 s"));
    assert!(why("M113").contains("cannot be started"));
    // What is not there is refused when it is read, at its place.
    let shown = refused(&config, "G21\nM150\nM2\n");
    assert!(shown.contains("p.ngc:2:1") && shown.contains("M150"), "{shown}");
}

/// Whether a process is there and not only a number that nobody has asked for yet.
fn lives(pid: &str) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    status
        .rsplit_once(") ")
        .is_some_and(|(_, rest)| !rest.starts_with(['Z', 'X']))
}

#[test]
fn a_stop_ends_a_code_of_the_user_and_all_that_it_has_started() {
    let folder = tempfile::tempdir().expect("a folder");
    let pids = folder.path().join("pids");
    let script = format!(
        "#!/bin/sh\nsleep 1000 &\necho $! $$ > {0}.new\nmv {0}.new {0}\nwait\n",
        pids.display()
    );
    let config = with_user_codes(folder.path(), 60.0, &[("M120", &script)]);
    rehearse_part(&config, "G21\nM120\nG0 X2\nM2\n", |run| {
        assert!(run.run_until(CYCLES_MAX, |_| pids.exists()).expect("a good program"));
        run.operator.give(Command::Stop);
        assert_ne!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
    });
    let pids = std::fs::read_to_string(&pids).expect("it ran");
    // They have been killed; when they are gone, the kernel says.
    for pid in pids.split_whitespace() {
        let gone = (0..1000).any(|_| {
            std::thread::sleep(std::time::Duration::from_millis(10));
            !lives(pid)
        });
        assert!(gone, "{pid}");
    }
}

#[test]
fn m66_and_a_probing_move_on_one_line_are_answered_in_their_order() {
    // The probe goes its whole way: 0.01 of it would be what the input says.
    let text = "G21 G90 F600\nM66 P0 L0 G38.3 Z-10\nG0 X[10 + #5063 + #5399]\nM2\n";
    rehearse_part(&machine(MILL), text, |run| {
        run.hal.set("motion.digital-in-00", true).expect("a pin");
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        let x: Input<f64> = run.hal.reader("axis.x.pos-cmd").expect("a pin");
        // G54 is at X20.
        assert!((x.get() - (20.0 + 10.0 - 10.0 + 1.0)).abs() < 1e-3, "{}", x.get());
    });
}

#[test]
fn a_program_reads_pins_as_they_are_and_a_check_what_the_machine_file_states() {
    let text = "G21 G90\n#1 = #<_hal[motion.analog-in-02]>\nG0 X[#1 * 10]\nM2\n";
    let mut config = machine(MILL);
    let shown = refused(&config, text);
    assert!(
        shown.contains("p.ngc:2:") && shown.contains("_hal[motion.analog-in-02]") && shown.contains("program.pins"),
        "{shown}"
    );
    config.program.pins.insert("motion.analog-in-02".into(), 1.0);
    let tables = Tables::read(&config).expect("tables");
    check(
        &config,
        &tables,
        "p.ngc",
        text.as_bytes(),
        &Begin::at_home(&config),
        &Cancel::default(),
    )
    .unwrap_or_else(|errors| panic!("{errors}"));
    rehearse_part(&config, text, |run| {
        run.hal.set("motion.analog-in-02", 3.5).expect("a pin");
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        let x: Input<f64> = run.hal.reader("axis.x.pos-cmd").expect("a pin");
        assert!((x.get() - 55.0).abs() < 1e-3, "{}", x.get());
    });
    let shown = end_of(&config, &text.replace("analog-in-02", "analog-in-77")).expect_err("no such pin");
    assert!(
        shown.contains("program:2:") && shown.contains("analog-in-77"),
        "{shown}"
    );
}

#[test]
fn a_program_writes_into_the_one_folder_of_the_machine_file_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut config = machine(MILL);
    let text = "G21 G90\n#1 = 2.5\n(LOGOPEN,part.txt)\n(LOG,width #1)\n(LOGCLOSE)\n(LOG,nowhere)\n(LOGAPPEND,part.txt)\n(LOG,more)\n\
                (PROBEOPEN points.txt)\nG53 G0 Z-80\nG38.2 Z-44.5 F600\n(PROBECLOSE)\nM2\n";
    let shown = end_of(&config, text).expect_err("no folder");
    assert!(
        shown.contains("program:3:") && shown.contains("log_directory"),
        "{shown}"
    );
    config.program.log_directory = Some(folder.path().to_owned());
    assert_eq!(end_of(&config, text), Ok(Outcome::Completed));
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("a file");
    assert_eq!(read("part.txt"), "width 2.500000\nmore\n");
    let points = read("points.txt");
    let point: Vec<f64> = points
        .split_whitespace()
        .map(|word| word.parse().expect("a number"))
        .collect();
    assert_eq!((points.lines().count(), point.len()), (1, 9));
    assert!((point[2] - -40.0).abs() < 0.02, "{points}");
    // Nothing leads out.
    std::os::unix::fs::symlink("/tmp", folder.path().join("out")).expect("a link");
    for name in ["/tmp/x.txt", "../x.txt", "a/../../x.txt", "out/x.txt", "nowhere/x.txt"] {
        let shown = end_of(&config, &format!("G21\n(LOGOPEN,{name})\nM2\n")).expect_err(name);
        assert!(shown.contains("program:2:"), "{name}: {shown}");
    }
}

#[test]
fn a_program_prints_and_logs_as_the_machine_comes_to_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut config = machine(MILL);
    config.program.log_directory = Some(folder.path().to_owned());
    // On the move and at rest, and with a message among them.
    let text = "G21 G90 G64 P0.01 F6000\n(LOGOPEN,part.txt)\nG1 X10\n(LOG,ten)\n(MSG,between)\nX20\n(LOG,twenty)\nG4 P0.2\n(LOG,rest)\n\
                G1 X40\n(LOG,forty)\n(LOGCLOSE)\nM2\n";
    let path = folder.path().join("part.txt");
    let read = || std::fs::read_to_string(&path).unwrap_or_default();
    let written_at = |stop_at: f64| {
        let _ = std::fs::remove_file(&path);
        let mut places = Vec::new();
        rehearse_part(&config, text, |run| {
            let x: Input<f64> = run.hal.reader("axis.x.pos-cmd").expect("a pin");
            run.run_until(CYCLES_MAX, |run| {
                while places.len() < read().lines().count() {
                    places.push(x.get());
                }
                if x.get() >= stop_at {
                    run.operator.give(Command::Stop);
                }
                run.operator.outcome().is_some()
            })
            .expect("a good program");
        });
        (read(), places)
    };
    let (text, places) = written_at(f64::INFINITY);
    assert_eq!(text, "ten\ntwenty\nrest\nforty\n");
    for (at, wanted) in places.iter().zip([30.0, 40.0, 40.0, 60.0]) {
        assert!((at - wanted).abs() < 2.0 && at - wanted > -0.1, "{places:?}");
    }
    // What is not reached is not written; G54 is 20 mm from home.
    let (text, _) = written_at(35.0);
    assert_eq!(text, "ten\n");
}

#[test]
fn a_random_changer_prepares_on_the_way_and_exchanges_pockets_as_the_machine_changes() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = folder.path().join("tool.tbl");
    std::fs::write(&table, "T3 P0\nT5 P7\nT9 P2\n").expect("our folder");
    let mut config = machine(MILL);
    config.nets.retain(|net| net.name != "tool-change-loop");
    config.tools.table = Some(table);
    config.tools.changer = config::ToolChanger::Random;
    rehearse_part(&config, "G21 G90\nT5\nG1 X30 F600\nM6\nT3\nG1 X40\nM6\nM2\n", |run| {
        let [prepare, change] = ["tool-prepare", "tool-change"].map(|name| bit(run, &format!("iocontrol.0.{name}")));
        let number: Input<u32> = run.hal.reader("iocontrol.0.tool-prep-number").expect("a pin");
        let pocket: Input<i32> = run.hal.reader("iocontrol.0.tool-prep-pocket").expect("a pin");
        let until = |run: &mut Rehearsal<'_>, what: &str, done: &dyn Fn(&Rehearsal<'_>) -> bool| {
            let there = run.run_until(CYCLES_MAX, |run| done(run)).expect("a good program");
            assert!(there, "never {what}: {:#?}", run.operator.journal());
        };
        let set =
            |run: &Rehearsal<'_>, name: &str, on: bool| run.hal.set(&format!("iocontrol.0.{name}"), on).expect("a pin");
        set(run, "tool-prepared", false);
        until(run, "prepares", &|_| prepare.get());
        assert_eq!((number.get(), pocket.get()), (5, 7));
        assert!(run.operator.live().position[motion::canon::Axis::X] < 1.0, "on the way");
        until(run, "M6", &|run| {
            run.operator.live().waiting == Some(Waiting::ToolChange { tool: 5 })
        });
        run.run_until(500, |_| false).expect("a good program");
        assert!(!change.get(), "the magazine still turns");
        set(run, "tool-prepared", true);
        until(run, "changes", &|_| change.get());
        assert!(!prepare.get());
        set(run, "tool-prepared", false);
        set(run, "tool-changed", true);
        until(run, "goes on", &|_| !change.get());
        set(run, "tool-changed", false);
        // Where tool 5 was.
        until(run, "prepares again", &|_| prepare.get());
        assert_eq!((number.get(), pocket.get()), (3, 7));
        set(run, "tool-prepared", true);
        until(run, "changes again", &|_| change.get());
        run.run_until(20, |_| false).expect("a good program");
        assert_eq!(run.operator.changing_tool(), Some(3));
        run.operator.give(Command::Stop);
        until(run, "ends", &|run| run.operator.outcome().is_some());
        assert!(!change.get() && !prepare.get());
        let journal: Vec<&str> = run.operator.journal().iter().map(|entry| entry.text.as_str()).collect();
        let told = |what: &str| journal.iter().filter(|text| text.contains(what)).count();
        assert_eq!(
            told("stopped during the change to tool 3: look which tool"),
            1,
            "{journal:#?}"
        );
    });
}

#[test]
fn the_tool_that_is_in_the_spindle_is_asked_for_by_nobody() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = folder.path().join("tool.tbl");
    let mut config = machine(MILL);
    config.nets.retain(|net| net.name != "tool-change-loop");
    config.tools.table = Some(table.clone());
    for (changer, tools) in [
        (config::ToolChanger::Fixed, "T1 P1\nT2 P2\n"),
        (config::ToolChanger::Random, "T1 P0\nT2 P2\n"),
    ] {
        std::fs::write(&table, tools).expect("our folder");
        config.tools.changer = changer;
        let text = "G21 G90\nM61 Q1\nT1 M6\nG1 X5 F600\nT2 M6\nM2\n";
        rehearse_part(&config, text, |run| {
            let change = bit(run, "iocontrol.0.tool-change");
            let prepare = bit(run, "iocontrol.0.tool-prepare");
            let (mut asked, mut prepared) = (false, false);
            let there = run.run_until(CYCLES_MAX, |run| {
                asked |= change.get() && run.operator.live().waiting != Some(Waiting::ToolChange { tool: 2 });
                prepared |= prepare.get() && run.operator.live().position[motion::canon::Axis::X] < 1.0;
                run.operator.live().waiting == Some(Waiting::ToolChange { tool: 2 })
            });
            assert!(
                there.expect("a good program"),
                "{changer:?}: {:#?}",
                run.operator.journal()
            );
            assert!(!asked, "{changer:?}: {:#?}", run.operator.journal());
            assert!(!prepared || changer == config::ToolChanger::Fixed);
            // Another one is, until somebody answers.
            run.run_until(20, |_| false).expect("a good program");
            assert!(change.get(), "{changer:?}");
            run.operator.give(Command::ToolChanged);
            let ended = run.run_until(CYCLES_MAX, |run| run.operator.outcome().is_some());
            assert!(ended.expect("a good program"), "{changer:?}");
            assert_eq!(run.operator.outcome(), Some(Outcome::Completed), "{changer:?}");
        });
    }
}

/// Runs dry with this feed, mm/min.
fn dry<T>(config: &Config, text: &'static str, feed: f64, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    let begin = Begin::Dry {
        begin: Box::new(Begin::at_home(config)),
        feed_s: feed / 60.0,
    };
    let tables = Tables::read(config).expect("tables");
    rehearse(config, text.as_bytes(), NetConfig::clean(1), |run| {
        run.set_program(text.as_bytes(), tables.clone(), begin.clone(), false);
        Ok(act(run))
    })
    .expect("a machine to rehearse on")
}

#[test]
fn a_dry_run_has_one_feed_and_neither_spindle_nor_coolant() {
    let config = machine(MILL);
    let text = "G21 G90 G94 G61 M7\nS1000 M3 M8\nG1 X20 F100\nG95 F0.01\nG1 X40\nG93\nG1 X60 F0.2\nG94 F150\nG0 X30\nG38.3 X35\nG1 Z-3 F50\n\
                M5 M9\nM2\n";
    dry(&config, text, 3000.0, |run| {
        let pins = ["spindle.0.on", "iocontrol.0.coolant-flood", "iocontrol.0.coolant-mist"].map(|name| bit(run, name));
        let mut fastest = std::collections::BTreeMap::<u32, f64>::new();
        let ended = run.run_until(CYCLES_MAX, |run| {
            assert!(pins.iter().all(|pin| !pin.get()));
            let live = run.operator.live();
            let fastest = fastest.entry(live.line).or_default();
            *fastest = fastest.max(live.velocity_mm_s);
            run.operator.outcome().is_some() || live.line == 13
        });
        assert!(ended.expect("a good program"));
        let alarms = run.operator.alarms();
        assert!(alarms.is_empty(), "{alarms:#?}");
        // 3000 mm/min on all at feed, and what the probe bears on its move.
        for (line, mm_s) in [(3, 50.0), (5, 50.0), (7, 50.0), (10, 2.5)] {
            assert!((fastest[&line] - mm_s).abs() < 0.01 * mm_s, "{line}: {fastest:?}");
        }
        assert!(fastest[&9] > 60.0, "rapid moves as they are: {fastest:?}");
    });
}

#[test]
fn what_needs_the_spindle_is_no_dry_run() {
    let config = machine(LATHE);
    let begin = Begin::Dry {
        begin: Box::new(Begin::at_home(&config)),
        feed_s: 10.0,
    };
    let tables = Tables::read(&config).expect("tables");
    let text = "G21 G18 S500 M3\nG33 Z-5 K1\nM2\n";
    let checked = check(&config, &tables, "p.ngc", text.as_bytes(), &begin, &Cancel::default());
    let said = checked.expect_err("a thread").to_string();
    assert!(said.contains("p.ngc:2:") && said.contains("dry run"), "{said}");
}

#[test]
fn waits_are_skipped_and_nothing_else() {
    let config = machine(MILL);
    let text = "G21 G90\nG4 P100\nM0\nM66 P0 L3 Q100\nG1 X[10 + #5399] F600\nM2\n";
    rehearse_part(&config, text, |run| {
        let mut waited = Vec::new();
        let ended = run.run_until(40_000, |run| {
            let live = run.operator.live();
            if let Some(waiting) = live.waiting.filter(|waiting| waited.last() != Some(waiting)) {
                // Of something else, it comes to nothing.
                run.operator.give(Command::Skip(Waiting::Queue));
                if waiting.can_be_skipped() {
                    run.operator.give(Command::Skip(waiting));
                }
                waited.push(waiting);
            }
            run.operator.outcome().is_some()
        });
        assert!(ended.expect("a good program"), "{waited:?}");
        let input = Waiting::Input {
            input: motion::canon::Input::Digital(0),
        };
        waited.retain(|waiting| waiting.can_be_skipped());
        assert_eq!(waited, [Waiting::Dwell, Waiting::Operator, input]);
        // The time of M66 ran out: -1; G54 is at 20.
        let x: Input<f64> = run.hal.reader("axis.x.pos-cmd").expect("a pin");
        assert!((x.get() - 29.0).abs() < 1e-3, "{}", x.get());
    });
}

#[test]
fn states_are_saved_and_restored_and_an_abort_starts_nothing() {
    let text = "G21 G90 G64 P0.05 F6000\nS1000 M3\nG1 X10\no1 sub\nM73\nG91 G20 M5\nG1 X0.5\nM66 P0 L3 Q5\no1 endsub\no1 call\nG1 X30\nM70\n\
                G91 M5\nG1 X1\nM72\nG1 X40\nM5\nM2\n";
    let config = machine(MILL);
    let run = |stop: bool| {
        rehearse_part(&config, text, |run| {
            let on = bit(run, "spindle.0.on");
            let mut edges = Vec::new();
            let mut stopped = false;
            run.hal.set("motion.digital-in-00", !stop).expect("a pin");
            let x: Input<f64> = run.hal.reader("axis.x.pos-cmd").expect("a pin");
            run.run_until(CYCLES_MAX, |run| {
                if edges.last() != Some(&on.get()) {
                    edges.push(on.get());
                }
                if stop && !stopped && run.operator.live().line == 8 {
                    stopped = true;
                    run.operator.give(Command::Stop);
                }
                run.operator.outcome().is_some()
            })
            .expect("a good program");
            (edges, x.get())
        })
    };
    let (edges, x) = run(false);
    assert_eq!(edges, [false, true, false, true, false, true, false]);
    assert!((x - 60.0).abs() < 1e-3, "G90 and G21 came back: {x}");
    assert_eq!(run(true).0, [false, true, false], "nothing starts behind a stop");
}

#[test]
fn modes_of_the_machine_file_hold_before_every_program() {
    let mut config = machine(MILL);
    config.program.startup_code = "G91 G21\nF6000".into();
    rehearse_part(&config, "G1 X10\nX10\nM2\n", |run| {
        let x: Input<f64> = run.hal.reader("axis.x.pos-cmd").expect("a pin");
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        // From where it stood behind homing.
        assert!((x.get() - 20.0).abs() < 0.1, "{}", x.get());
    });
    for (code, what) in [
        ("G0 X1", "nothing that moves"),
        ("G21\nM2", "no end"),
        ("G1234", "G1234"),
        ("M66 P0 L0", "nothing that moves"),
    ] {
        config.program.startup_code = code.into();
        let shown = refused(&config, "G21\nM2\n");
        assert!(
            shown.contains("startup_code") && shown.contains(what),
            "{code}: {shown}"
        );
    }
}

#[test]
fn a_second_spindle_turns_by_its_number_and_is_waited_for() {
    let config = machine(&MILL.replace("rpm_max = 24000.0", "rpm_max = 24000.0\ncount = 2"));
    let text = "G21 G90 F6000\nS1000 M3 $0\nS500 $1\nM4 $1\nG1 X20\nS700 $1\nM5 $1\nG1 X30\nM4 $1\nM2\n";
    rehearse_part(&config, text, |run| {
        let (first, speed): (Input<f64>, Input<f64>) = (
            run.hal.reader("spindle.0.speed-out").expect("a pin"),
            run.hal.reader("spindle.1.speed-out").expect("a pin"),
        );
        let [on, forward, reverse] = ["on", "forward", "reverse"].map(|pin| bit(run, &format!("spindle.1.{pin}")));
        let (mut seen, mut waited) = (Vec::new(), 0);
        run.hal.set("spindle.1.at-speed", false).expect("a pin");
        run.run_until(CYCLES_MAX, |run| {
            let now = (on.get(), forward.get(), reverse.get(), speed.get());
            if seen.last() != Some(&now) {
                seen.push(now);
            }
            waited += u32::from(run.operator.live().line == 4);
            if waited == 500 {
                run.hal.set("spindle.1.at-speed", true).expect("a pin");
            }
            assert!(
                run.operator.live().line < 6 || first.get() == 1000.0 || run.operator.live().line >= 9,
                "the first goes on"
            );
            run.operator.outcome().is_some()
        })
        .expect("a good program");
        assert_eq!(
            run.operator.outcome(),
            Some(Outcome::Completed),
            "{:#?}",
            run.operator.journal()
        );
        assert!((500..510).contains(&waited), "{waited}");
        let off = (false, false, false, 0.0);
        let turns = |rpm: f64| (true, false, true, -rpm);
        assert_eq!(seen, [off, turns(500.0), turns(700.0), off, turns(700.0), off]);
    });
    for (line, what) in [
        ("M19 R0 $1", "second spindle"),
        ("G96 S100 D1000 $1", "second spindle"),
        ("M3 $2", "$2"),
    ] {
        let shown = refused(&config, &format!("G21 G90 F100\n{line}\nG1 X1\nM2\n"));
        assert!(shown.contains("p.ngc:2:") && shown.contains(what), "{line}: {shown}");
    }
    // The one that is late is named.
    rehearse_part(&config, "G21\nS500 M3 $1\nM2\n", |run| {
        run.hal.set("spindle.1.at-speed", false).expect("a pin");
        run.run_until(60_000, |run| run.operator.alarm().is_some())
            .expect("a good program");
        let cause = run
            .operator
            .alarm()
            .map(|alarm| alarm.cause.text.clone())
            .unwrap_or_default();
        assert!(cause.contains("spindle.1.at-speed"), "{cause}");
        run.run_until(1000, |_| false).expect("a good program");
        assert!(!bit(run, "spindle.1.on").get());
    });
}
