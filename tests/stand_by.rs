//! A control that stands by: on virtual time, where every cycle can be looked at; and as a process with its clients.

use cia402::State as Power;
use common::{Control, PATIENCE};
use isocnc::config;
use isocnc::machine::sequence::{Job, Outcome, Step};
use isocnc::machine::state::State;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::{Rehearsal, rehearse_with};
use isocnc::rt::shared::Command;
use isocnc::sim::{Disturbance, NetConfig};
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;
use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};
use tempfile::TempDir;

use crate::common;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const PART: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5 Z0\nG1 X15 F3000\nG0 Z5\nM2\n";
/// Half a minute of motion.
const LONG: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5 Z0\nG1 X200 F400\nM2\n";
const CYCLES_MAX: u64 = 60_000;

fn stand_by(text: &str, act: impl FnOnce(&mut Rehearsal<'_>)) {
    let config = config::parse(MACHINE, Path::new("mill3-demo.toml")).unwrap();
    let net = NetConfig::clean(7);
    println!("seed {}", net.seed);
    rehearse_with(&config, text.as_bytes(), net, Operator::standing_by, |run| {
        act(run);
        Ok(())
    })
    .unwrap();
}

fn reach(run: &mut Rehearsal<'_>, what: &str, done: impl FnMut(&mut Rehearsal<'_>) -> bool) {
    let reached = run.run_until(CYCLES_MAX, done).unwrap();
    assert!(reached, "never {what}: {:#?}", run.operator.journal());
}

fn powers(run: &mut Rehearsal<'_>) -> [Option<Power>; 3] {
    [1, 2, 3].map(|id| run.net().machine().drive_state(id))
}

fn positions(run: &mut Rehearsal<'_>) -> [u64; 3] {
    [0, 1, 2].map(|joint| run.net().machine().joint_position_mm(joint).unwrap().to_bits())
}

fn begin(run: &mut Rehearsal<'_>) -> bool {
    let now_ns = run.now_ns();
    let home = run.operator.homing_order(run.operator.not_homed());
    run.operator.begin(now_ns, Job::Program { home, runs: 1 })
}

fn off(run: &mut Rehearsal<'_>) {
    let now_ns = run.now_ns();
    run.operator.off(now_ns);
    reach(run, "off", |run| {
        run.operator.step() == Step::StandBy && run.control.state() == State::Disabled
    });
    assert!(!powers(run).contains(&Some(Power::OperationEnabled)));
}

#[test]
fn nothing_moves_before_a_program_and_the_next_one_finds_drives_on_and_joints_homed() {
    stand_by(PART, |run| {
        assert!(!begin(run), "the network is not up");
        reach(run, "disabled", |run| run.control.state() == State::Disabled);
        let rest = positions(run);
        for _ in 0..2000 {
            run.cycle(0).unwrap();
            assert_eq!(run.control.state(), State::Disabled);
            assert!(!powers(run).contains(&Some(Power::OperationEnabled)));
        }
        assert_eq!(positions(run), rest);
        let homings = |run: &Rehearsal<'_>| {
            let entries = run.operator.journal().iter();
            entries.filter(|entry| entry.text == "machine homing").count()
        };
        let mut homed = 0;
        for programs in 1..=3 {
            assert!(begin(run));
            assert!(!begin(run), "one at a time");
            reach(run, "standing by", |run| run.operator.step() == Step::StandBy);
            assert_eq!(run.operator.program_outcome(), Some(Outcome::Completed));
            assert_eq!((run.operator.programs(), run.control.state()), (programs, State::Ready));
            assert_eq!(powers(run), [Some(Power::OperationEnabled); 3]);
            if programs == 1 {
                homed = homings(run);
            }
            if programs == 2 {
                // Feedback is read with drives off, too: joints stay homed.
                off(run);
            }
        }
        assert!(homed > 0);
        assert_eq!(homings(run), homed, "homed once");
        off(run);
        let now_ns = run.now_ns();
        run.operator.end(now_ns);
        assert_eq!(run.run(CYCLES_MAX).unwrap(), Outcome::Completed);
    });
}

/// Nothing says M2 there.
#[test]
fn a_program_between_percent_signs_comes_to_its_end() {
    stand_by("%\nG21 G90\nG0 X5 Y5\n%\n", |run| {
        reach(run, "disabled", |run| run.control.state() == State::Disabled);
        assert!(begin(run));
        reach(run, "standing by", |run| run.operator.step() == Step::StandBy);
        assert_eq!(run.operator.program_outcome(), Some(Outcome::Completed));
    });
}

#[test]
fn a_stop_leads_back_to_stand_by() {
    stand_by(LONG, |run| {
        reach(run, "disabled", |run| run.control.state() == State::Disabled);
        assert!(begin(run));
        reach(run, "running", |run| run.control.state() == State::Running);
        let now_ns = run.now_ns();
        run.operator.stop(now_ns);
        reach(run, "standing by", |run| run.operator.step() == Step::StandBy);
        assert_eq!(run.operator.program_outcome(), Some(Outcome::Stopped));
        assert_eq!(run.control.state(), State::Ready, "drives stay on");
        assert!(begin(run), "ready for the next one");
        reach(run, "running", |run| run.control.state() == State::Running);
        off(run);
        assert_eq!(run.operator.program_outcome(), Some(Outcome::Stopped));
    });
}

#[test]
fn a_fault_lets_nothing_begin_before_it_is_acknowledged() {
    stand_by(LONG, |run| {
        reach(run, "disabled", |run| run.control.state() == State::Disabled);
        assert!(begin(run));
        reach(run, "running", |run| run.control.state() == State::Running);
        let now_ns = run.now_ns();
        run.net().at(
            now_ns,
            Disturbance::DriveFault {
                node: 1,
                error_code: 0x7305,
            },
        );
        reach(run, "faulted", |run| run.operator.step() == Step::StandBy);
        assert_eq!(run.operator.program_outcome(), Some(Outcome::Faulted));
        let cause = run.operator.alarm().expect("an alarm").cause.text.clone();
        assert!(cause.contains("axis X"), "{cause}");
        assert!(!begin(run));
        run.operator.acknowledge();
        assert_eq!(run.operator.alarm(), None);
        reach(run, "disabled", |run| run.control.state() == State::Disabled);
        for _ in 0..500 {
            run.cycle(0).unwrap();
            assert_eq!(
                run.control.state(),
                State::Disabled,
                "an acknowledge switches nothing on"
            );
        }
        assert!(begin(run));
        reach(run, "running", |run| run.control.state() == State::Running);
    });
}

/// The chain opens before a cycle: the state is that of this cycle, and the drives hear of it in the next exchange; whatever goes on.
#[test]
fn an_open_chain_stops_every_drive_by_the_next_exchange_and_closing_it_starts_nothing() {
    let mut reached = 0;
    for wanted in [State::Ready, State::Running, State::Held] {
        stand_by(LONG, |run| {
            reach(run, "disabled", |run| run.control.state() == State::Disabled);
            assert!(begin(run));
            reach(run, "running", |run| run.control.state() == State::Running);
            run.run_until(300, |_| false).unwrap();
            match wanted {
                State::Held => run.operator.give(Command::Hold),
                State::Ready => {
                    let now_ns = run.now_ns();
                    run.operator.stop(now_ns);
                }
                _ => {}
            }
            reach(run, "there", |run| run.control.state() == wanted);
            run.hal.set("iocontrol.0.emc-enable-in", false).unwrap();
            run.cycle(0).unwrap();
            assert_eq!(run.control.state(), State::Estop, "from {wanted:?}");
            // What this cycle has computed leaves with the next one, and drives act on it at the SoC behind that.
            let mut cycles = 0;
            while powers(run).contains(&Some(Power::OperationEnabled)) {
                run.cycle(0).unwrap();
                cycles += 1;
                assert!(cycles <= 10, "{:?}", powers(run));
            }
            assert_eq!(cycles, 2, "from {wanted:?}");
            run.run_until(1000, |_| false).unwrap();
            let rest = positions(run);
            run.hal.set("iocontrol.0.emc-enable-in", true).unwrap();
            run.run_until(1000, |_| false).unwrap();
            assert_eq!((run.control.state(), positions(run)), (State::Estop, rest));
            assert!(!begin(run), "nothing begins before a reset");
            run.operator.acknowledge();
            run.run_until(100, |_| false).unwrap();
            assert_eq!(run.control.state(), State::Estop, "an acknowledge is no reset");
            run.operator.reset_estop();
            reach(run, "off", |run| run.control.state() == State::Disabled);
            run.run_until(500, |_| false).unwrap();
            assert_eq!((run.control.state(), positions(run)), (State::Disabled, rest));
            reach(run, "standing by", |run| run.operator.step() == Step::StandBy);
            assert_eq!(run.operator.not_homed(), 0, "its place was read all the time");
            let over: Vec<_> = run.control.peaks().iter().map(|peaks| peaks.over).collect();
            assert!(over.iter().all(|over| *over == [0; 3]), "{over:?}");
            reached += 1;
        });
    }
    assert_eq!(reached, 3);
}

#[test]
fn a_pc_that_stands_still_while_drives_are_off_is_warned_of_and_nothing_has_to_be_acknowledged() {
    stand_by(PART, |run| {
        reach(run, "disabled", |run| run.control.state() == State::Disabled);
        // Short stalls, of which the nodes notice nothing; then one in which they all give up.
        for late_ms in [1; 80].into_iter().chain([2_000]) {
            run.cycle(late_ms * 1_000_000 + 600_000).unwrap();
            assert!(run.control.state() != State::Faulted);
        }
        reach(run, "booting", |run| run.control.state() == State::Booting);
        reach(run, "disabled again", |run| run.control.state() == State::Disabled);
        assert_eq!(run.operator.alarm(), None);
        let told = |run: &Rehearsal<'_>, what: &str| {
            let journal = run.operator.journal().iter();
            journal
                .filter(|entry| entry.text.starts_with("warning: ") && entry.text.contains(what))
                .count()
        };
        let (overruns, lost) = (told(run, "cycles were skipped"), told(run, "lost"));
        assert!(
            (1..=3).contains(&overruns) && lost >= 1,
            "{:#?}",
            run.operator.journal()
        );
        assert!(begin(run), "nothing to acknowledge");
        // With drives on it is a fault.
        reach(run, "running", |run| run.control.state() == State::Running);
        run.cycle(2_000_600_000).unwrap();
        reach(run, "faulted", |run| run.control.state() == State::Faulted);
        assert!(run.operator.alarm().is_some());
    });
}

#[test]
fn a_reader_who_does_not_read_keeps_nobody_from_stopping_the_machine() {
    let (_reader, mut full) = std::io::pipe().unwrap();
    fcntl(&full, FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).unwrap();
    while full.write(&[b'\n'; 4096]).is_ok() {}
    fcntl(&full, FcntlArg::F_SETFL(OFlag::empty())).unwrap();
    let control = Control::start("not-read", full);
    control.wait_for("standing by", |status| status["state"] == "disabled");
    let long = control.program("long.ngc", LONG);
    control
        .ask(&["program", "run", "--no-wait", long.to_str().unwrap()])
        .unwrap();
    control.wait_for("running", |status| status["state"] == "running");
    control.ask(&["stop", "--no-wait"]).unwrap();
    control.wait_for("the stop", |status| status["program"]["result"] == "stopped");
}

#[test]
fn ctrl_c_ends_the_wait_for_a_check_and_nothing_begins() {
    let control = Control::start("check-given-up", Stdio::null());
    control.wait_for("standing by", |status| status["state"] == "disabled");
    let text = "G21 G90 F100\no1 while [1]\nG1 X1\nX2\no1 endwhile\nM2\n";
    let endless = control.program("endless.ngc", text);
    let client = testing::command(env!("CARGO_BIN_EXE_isocnc"))
        .args(["program", "run", "--machine", &control.machine])
        .arg(&endless)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    control.wait_for("the check", |status| status["activity"] == "checking");
    kill(Pid::from_raw(client.id() as i32), Signal::SIGINT).unwrap();
    let output = client.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(
        (output.status.code(), said.lines().last()),
        (Some(130), Some("given up before it began"))
    );
    let status = control.wait_for("the end of the check", |status| status["activity"] == "idle");
    assert_eq!(status["power"], "off");
}

#[test]
fn a_button_starts_the_program_that_is_loaded() {
    let control = Control::start("button", Stdio::null());
    let program = control.program("part.ngc", PART);
    control.wait_for("standing by", |status| status["power"] == "off");
    control.ask(&["on"]).unwrap();
    control.ask(&["home"]).unwrap();
    control.ask(&["program", "load", program.to_str().unwrap()]).unwrap();
    let (code, said) = control.words(&["hal", "set", "halui.program.run", "true"]);
    assert_eq!(code, Some(0), "{said}");
    control.wait_for("its end", |status| status["program"]["result"] == "completed");
}

#[test]
fn clients_wait_for_the_end_of_what_they_order() {
    let control = Control::start("waited-for", Stdio::null());
    control.wait_for("standing by", |status| status["state"] == "disabled");
    let (code, said) = control.words(&["home"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("homed; drives are on"), "{said}");
    let status = control.ask(&["status"]).unwrap();
    assert_eq!(
        (&status["step"], &status["homed"]),
        (&"standing_by".into(), &serde_json::json!([0, 1, 2]))
    );

    // Faster than the axis can, and farther than it may.
    let (code, said) = control.words(&["jog", "Z", "50", "--speed", "4000"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(
        said,
        "speed cut from 4000 to 100 mm/s, the limit of Z\nZ at rest at 5.000 mm, its soft limit\n"
    );
    // Drives stay on, and what is homed stays so: the program follows the hand.

    let part = control.program("part.ngc", PART);
    let (code, said) = control.words(&["program", "run", part.to_str().unwrap()]);
    assert_eq!(
        (code, said.lines().last()),
        (Some(0), Some("completed; drives are on")),
        "{said}"
    );
    let (code, said) = control.words(&["off"]);
    assert_eq!((code, said.lines().last()), (Some(0), Some("at rest, drives are off")));
    assert_eq!(control.ask(&["status"]).unwrap()["state"], "disabled");

    // Whoever does not want to wait any longer stops nothing; a program that is stopped is not done.
    let long = control.program("long.ngc", LONG);
    let waits = || {
        let mut client = testing::command(env!("CARGO_BIN_EXE_isocnc"));
        client.args(["program", "run", long.to_str().unwrap(), "--machine", &control.machine]);
        client.stdout(Stdio::piped()).spawn().unwrap()
    };
    let client = waits();
    control.wait_for("running", |status| status["state"] == "running");
    kill(Pid::from_raw(client.id() as i32), Signal::SIGINT).unwrap();
    let output = client.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("the control goes on"), "{said}");
    assert_eq!(control.ask(&["status"]).unwrap()["state"], "running");
    assert_eq!(control.words(&["stop"]).0, Some(0));
    let client = waits();
    control.wait_for("running", |status| status["state"] == "running");
    control.ask(&["stop"]).unwrap();
    let output = client.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stdout).contains("stopped before its end"));
}

#[test]
fn errors_have_one_shape_where_json_is_asked_for() {
    let binary = env!("CARGO_BIN_EXE_isocnc");
    for (arguments, code) in [
        (&["status", "--machine", "nobody", "--json"][..], 1),
        (&["run", "/nowhere.toml", "--json"], 1),
        (&["run", "configs/mill3-demo.toml", "/nowhere.ngc", "--json"], 1),
        (&["check", "/nowhere.toml", "--json"], 1),
        (&["plan", "/nowhere.toml", "/nowhere.ngc", "--json"], 1),
        (&["doctor", "/nowhere.toml", "--json"], 2),
        (&["bus", "nodes", "/nowhere.toml", "--json"], 1),
        (&["hal", "list", "--machine", "nobody", "--json"], 1),
        (&["stop", "--json", "--no-such-option"], 2),
    ] {
        let output = testing::command(binary).args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        let errors: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{arguments:?}: {error}"));
        let rule = errors["errors"][0]["rule"]
            .as_str()
            .unwrap_or_else(|| panic!("{arguments:?}: {errors}"));
        assert!(
            !rule.is_empty() && errors.get("file").is_some(),
            "{arguments:?}: {errors}"
        );
    }
}

#[test]
fn signals_that_are_no_wish_to_stop_do_nothing_and_the_others_stop_in_order() {
    let mut control = Control::start("signals", Stdio::null());
    control.wait_for("standing by", |status| status["state"] == "disabled");
    let long = control.program("long.ngc", LONG);
    control
        .ask(&["program", "run", "--no-wait", long.to_str().unwrap()])
        .unwrap();
    let pid = Pid::from_raw(control.process.id() as i32);
    let mut status = control.wait_for("running", |status| status["state"] == "running");
    for signal in [
        Signal::SIGUSR1,
        Signal::SIGUSR2,
        Signal::SIGALRM,
        Signal::SIGPROF,
        Signal::SIGIO,
        Signal::SIGTSTP,
        Signal::SIGTTOU,
    ] {
        kill(pid, signal).unwrap();
        status = control.wait_for("further on", |now| {
            now["state"] == "running" && now["position_mm"] != status["position_mm"]
        });
    }
    kill(pid, Signal::SIGQUIT).unwrap();
    assert_eq!(
        testing::end(&mut control.process).code(),
        Some(131),
        "in order, not by the signal"
    );
}

#[test]
fn pins_that_are_cut_short_stop_the_machine_and_kill_nobody() {
    let mut control = Control::start("cut-short", Stdio::null());
    control.wait_for("standing by", |status| status["state"] == "disabled");
    let long = control.program("long.ngc", LONG);
    control
        .ask(&["program", "run", "--no-wait", long.to_str().unwrap()])
        .unwrap();
    control.wait_for("running", |status| status["state"] == "running");
    let name = format!("isocnc-hal.{}", control.machine);
    let mut places = hal_pins::directories().into_iter().map(|folder| folder.join(&name));
    let pins = places.find(|path| path.exists()).expect("the pins");
    let file = std::fs::OpenOptions::new().write(true).open(pins).unwrap();
    file.set_len(0).unwrap();
    let status = control.wait_for("the stop", |status| !status["program"]["result"].is_null());
    assert_eq!(
        (&status["program"]["result"], &status["state"]),
        (&"faulted".into(), &"faulted".into())
    );
    let alarm = status["alarm"]["text"].as_str().unwrap();
    assert!(alarm.contains("the pins was cut short by another process"), "{alarm}");
    kill(Pid::from_raw(control.process.id() as i32), Signal::SIGTERM).unwrap();
    assert_eq!(testing::end(&mut control.process).code(), Some(143));
}

#[test]
fn idle_connections_keep_no_stop_out() {
    let control = Control::start("crowded", Stdio::null());
    control.wait_for("standing by", |status| status["state"] == "disabled");
    let long = control.program("long.ngc", LONG);
    control
        .ask(&["program", "run", "--no-wait", long.to_str().unwrap()])
        .unwrap();
    control.wait_for("running", |status| status["state"] == "running");
    let name = format!("isocnc-control.{}", control.machine);
    let mut places = hal_pins::directories().into_iter().map(|folder| folder.join(&name));
    let socket = places.find(|path| path.exists()).expect("the socket");
    let folder = std::fs::metadata(socket.parent().unwrap()).unwrap();
    assert_eq!(
        (folder.mode() & 0o7777, folder.uid()),
        (0o700, nix::unistd::geteuid().as_raw())
    );
    let _idle: Vec<UnixStream> = (0..40).map(|_| UnixStream::connect(&socket).unwrap()).collect();
    control.ask(&["stop"]).unwrap();
    control.wait_for("the stop", |status| status["program"]["result"] == "stopped");
}

#[test]
fn clients_run_hold_and_stop_programs() {
    let mut control = Control::start("stand-by", Stdio::null());
    let standing_by = |status: &Value| status["state"] == "disabled" && status["step"] == "standing_by";
    let status = control.wait_for("standing by", standing_by);
    assert_eq!((&status["program"], &status["alarm"]), (&Value::Null, &Value::Null));
    control.refused(&["hold"], "nothing runs that could be held");
    control.refused(&["stop"], "there is nothing to stop");
    control.refused(&["reverse"], "no program runs or is held");
    control.refused(&["program", "start"], "drives are off: isocnc on");
    for (switch, on) in [("on", true), ("off", false)] {
        control.ask(&["single-block", switch]).unwrap();
        control.wait_for("single block", |status| status["single_block"] == on);
    }
    control.refused(&["alarm", "acknowledge"], "there is nothing to acknowledge");
    let bad = control.program("bad.ngc", "G1 X5\nG77\nM2\n");
    control.refused(&["program", "run", bad.to_str().unwrap()], "G77");
    control.refused(&["program", "run", "/nowhere.ngc"], "/nowhere.ngc: No such file");

    let part = control.program("part.ngc", PART);
    let begun = control
        .ask(&["program", "run", "--no-wait", part.to_str().unwrap()])
        .unwrap();
    assert_eq!(
        (&begun["program"], &begun["lines"]),
        (&part.to_str().unwrap().into(), &5.into())
    );
    let busy = control
        .ask(&["program", "run", part.to_str().unwrap()])
        .expect_err("a refusal");
    assert!(busy.contains("wait"), "{busy}");
    let status = control.wait_for("the end of the part", |status| !status["program"]["result"].is_null());
    assert_eq!(status["program"]["result"], "completed", "{status}");

    let long = control.program("long.ngc", LONG);
    control
        .ask(&["program", "run", "--no-wait", long.to_str().unwrap()])
        .unwrap();
    control.wait_for("running", |status| status["state"] == "running");
    control.ask(&["hold"]).unwrap();
    let held = control.wait_for("held", |status| status["state"] == "held");
    control.ask(&["resume"]).unwrap();
    control.wait_for("on the way again", |status| {
        status["position_mm"] != held["position_mm"]
    });
    // Some way to go back on.
    control.wait_for("a few millimetres on", |status| {
        status["position_mm"][0].as_f64() > held["position_mm"][0].as_f64().map(|x_mm| x_mm + 8.0)
    });
    control.ask(&["reverse", "50"]).unwrap();
    let back = control.wait_for("on the way back", |status| {
        status["direction"] == "reverse" && status["state"] == "running"
    });
    control.wait_for("further back", |status| {
        status["position_mm"][0].as_f64() < back["position_mm"][0].as_f64()
    });
    control.ask(&["resume"]).unwrap();
    control.wait_for("forward", |status| status["direction"] == "forward");
    control.ask(&["stop", "--no-wait"]).unwrap();
    let status = control.wait_for("at rest", |status| status["job"] == "stopped");
    assert_eq!(
        (&status["program"]["result"], &status["power"]),
        (&"stopped".into(), &"on".into())
    );

    kill(Pid::from_raw(control.process.id() as i32), Signal::SIGTERM).unwrap();
    assert_eq!(testing::end(&mut control.process).code(), Some(143));
    control.refused(&["status"], "no control of machine");
}

/// Machine file with a parameter file and a tool table beside it.
fn with_tables(machine: &str) -> String {
    let text = machine.replace("\n[program]\n", "\n[program]\nparameter_file = \"m.var\"\n");
    text.replace("\n# [tools]\n", "\n[tools]\ntable = \"m.tbl\"\n")
}

#[test]
fn what_programs_leave_behind_is_there_for_the_next_one_and_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let write = |folder: &TempDir, name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write(&folder, "m.var", "100 3\n5221 20\n5222 20\n5223 -60\n");
    write(&folder, "m.tbl", "T1 P1 Z5 ;mine\n");
    let mut control = Control::start_in(folder, "tables", Stdio::null(), with_tables);
    let standing_by = |status: &Value| !status["job"].is_null();
    let file = |control: &Control, name: &str| std::fs::read_to_string(control.folder.path().join(name)).unwrap();
    let kept = |control: &Control, value: &str| {
        let give_up = Instant::now() + PATIENCE;
        while !file(control, "m.var").starts_with(&format!("100\t{value}\n")) {
            assert!(Instant::now() < give_up, "never {value}: {}", file(control, "m.var"));
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    control.wait_for("standing by", |status| status["power"] == "off");
    let double = control.program("double.ngc", &format!("#100=[#100*2]\n{PART}"));
    let run =
        |control: &Control, program: &Path| control.ask(&["program", "run", "--no-wait", program.to_str().unwrap()]);
    run(&control, &double).unwrap();
    control.wait_for("the end of the part", standing_by);
    kept(&control, "6.000000");
    assert!(file(&control, "m.var").contains("\n5223\t-60.000000\n"));
    assert!(file(&control, "m.var.bak").starts_with("100 3\n"));

    // A mistake in a table that somebody edits keeps the next program from beginning.
    write(&control.folder, "m.tbl", "T1 P1 Z5 Z6\n");
    control.refused(&["program", "run", double.to_str().unwrap()], "m.tbl:1:10");
    write(&control.folder, "m.tbl", "T1 P1 Z5 ;mine\n");

    // Stopped in the middle: what was said before is kept all the same.
    let long = control.program("long.ngc", &format!("#100=[#100*2]\n{LONG}"));
    run(&control, &long).unwrap();
    control.wait_for("running", |status| status["state"] == "running");
    control.ask(&["stop", "--no-wait"]).unwrap();
    control.wait_for("standing by", standing_by);
    kept(&control, "12.000000");

    kill(Pid::from_raw(control.process.id() as i32), Signal::SIGTERM).unwrap();
    assert_eq!(testing::end(&mut control.process).code(), Some(143));
    let folder = std::mem::replace(&mut control.folder, tempfile::tempdir().unwrap());
    let control = Control::start_in(folder, "tables-again", Stdio::null(), with_tables);
    control.wait_for("standing by", |status| status["power"] == "off");
    let double = control.program("double.ngc", &format!("#100=[#100*2]\n{PART}"));
    run(&control, &double).unwrap();
    control.wait_for("the end of the part", |status| !status["program"]["result"].is_null());
    kept(&control, "24.000000");
    assert_eq!(file(&control, "m.tbl"), "T1 P1 Z5 ;mine\n", "nobody changed a tool");
}
