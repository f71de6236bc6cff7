//! A day at the machine, by the commands that a person types: on, home, touch off, MDI, run, hold, stop, change the tool,
//! emergency stop, run again, off. Nothing here looks at times: the PC may be busy.

use crate::common;
#[path = "working_day/on_the_wire.rs"]
mod on_the_wire;

use common::Control;
use serde_json::Value;
use std::process::{Command, Stdio};

/// Ends at X 30 Y 20 in the work.
const PART: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5\nG1 X30 F3000\nY20\nM2\n";
/// Half a minute of motion.
const LONG: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5\nG1 X200 F400\nM2\n";

fn day(name: &str, changed: fn(&str) -> String) -> Control {
    let control = Control::start_in(tempfile::tempdir().unwrap(), name, Stdio::null(), changed);
    control.wait_for("the network", |status| {
        status["power"] != "starting" && status["step"] == "standing_by"
    });
    control
}

/// A command that is carried out, and the last line of what it says.
fn done(control: &Control, arguments: &[&str], last: &str) {
    let (code, said) = control.words(arguments);
    assert_eq!(
        (code, said.lines().last()),
        (Some(0), Some(last)),
        "{arguments:?}: {said}"
    );
}

fn status(control: &Control) -> Value {
    control.ask(&["status"]).unwrap()
}

/// Place of the axes in the work, mm.
fn work_mm(control: &Control) -> [f64; 3] {
    let status = status(control);
    [0, 1, 2].map(|axis| {
        let [machine, offset] = ["position_mm", "work_offset_mm"].map(|what| status[what][axis].as_f64().unwrap());
        machine - offset
    })
}

fn assert_near(found: f64, wanted: f64) {
    assert!((found - wanted).abs() < 1e-6, "{found}, wanted {wanted}");
}

#[test]
fn a_day_at_the_machine() {
    let control = day("working-day", by_hand);
    let [part, long] = [("part.ngc", PART), ("long.ngc", LONG)].map(|(name, text)| control.program(name, text));
    let [part, long] = [&part, &long].map(|path| path.to_str().unwrap());

    // In the wrong order: each refusal names the next step.
    control.refused(&["program", "start"], "drives are off: isocnc on");
    control.refused(&["mdi", "G0 X1"], "drives are off: isocnc on");
    let (_, said) = control.words(&["power"]);
    assert!(
        said.starts_with("power     off\nhomed     no joint\nnext      isocnc on"),
        "{said}"
    );
    done(&control, &["on"], "drives are on");
    done(&control, &["on"], "drives are on");
    control.refused(&["mdi", "G0 X1"], "not all joints are homed: isocnc home");
    control.refused(&["touch-off", "X", "0"], "not all joints are homed: isocnc home");
    done(&control, &["home", "2"], "homed; drives are on");
    assert_eq!(status(&control)["homed"], serde_json::json!([2]));
    assert_eq!(status(&control)["next"], "home");
    done(&control, &["home"], "homed; drives are on");
    control.refused(&["program", "start"], "no program is loaded: isocnc program load FILE");

    // By hand, then touched off, then by lines of MDI, whose modes last.
    control.ask(&["jog", "X", "40", "--speed", "50"]).unwrap();
    done(
        &control,
        &["touch-off", "X", "10"],
        "X reads 10 in the work system in force",
    );
    assert_near(work_mm(&control)[0], 10.0);
    let x_mm = status(&control)["position_mm"][0].as_f64().unwrap();
    let offsets = control.ask(&["offset", "list"]).unwrap();
    assert_near(offsets["systems"][0]["origin"]["X"].as_f64().unwrap(), x_mm - 10.0);
    done(
        &control,
        &["offset", "set", "G55", "Y", "12.5"],
        "the origin of G55 is at Y 12.5 in the machine",
    );
    assert_eq!(
        control.ask(&["offset", "list"]).unwrap()["systems"][1]["origin"]["Y"],
        12.5
    );
    control.ask(&["mdi", "G91 G0 X5"]).unwrap();
    control.ask(&["mdi", "X-2 M3 S1000"]).unwrap();
    assert_near(work_mm(&control)[0], 13.0);
    let spindle = |control: &Control| control.ask(&["hal", "get", "spindle.0.on"]).unwrap();
    assert_eq!(spindle(&control)["value"], true);
    let codes = status(&control)["codes"].to_string();
    assert!(codes.contains("\"G91\"") && codes.contains("\"M3\""), "{codes}");
    // Where it would go too far, it is refused as a whole.
    control.refused(&["mdi", "G90 G0 X5000"], "MDI:1:");
    assert_near(work_mm(&control)[0], 13.0);
    control.ask(&["stop"]).unwrap();
    assert_eq!(spindle(&control)["value"], false);

    // Neither a stop, which this was, nor an emergency stop lets the next line start the spindle again; other modes stay.
    control.ask(&["mdi", "G0 X1"]).unwrap();
    assert_eq!(spindle(&control)["value"], false);
    control.ask(&["mdi", "M3 S500 M8"]).unwrap();
    assert_eq!(spindle(&control)["value"], true);
    control.ask(&["estop"]).unwrap();
    control.wait_for("the stop", |status| status["power"] == "estop");
    done(&control, &["estop", "reset"], "reset; drives stay off: isocnc on");
    done(&control, &["on"], "drives are on");
    control.ask(&["mdi", "G0 X1"]).unwrap();
    assert_eq!(spindle(&control)["value"], false);
    assert!(status(&control)["codes"].to_string().contains("\"G91\""));
    control.ask(&["mdi", "G90"]).unwrap();

    // A tool: set, changed by hand while a line waits, its length measured.
    done(
        &control,
        &["tool", "set", "5", "--length", "12.3", "--diameter", "6"],
        "tool 5, length 12.3, diameter 6",
    );
    control.ask(&["mdi", "T5 M6", "--no-wait"]).unwrap();
    let waiting = control.wait_for("the wait for a tool", |status| {
        status["waiting"]["for"] == "tool_change"
    });
    assert_eq!(waiting["waiting"]["what"]["text"], "put tool 5 into the spindle");
    control.ask(&["tool-changed"]).unwrap();
    control.wait_for("the change", |status| {
        status["tool"] == 5 && status["job"] == "completed"
    });
    control.refused(&["tool-changed"], "no program runs or is held");
    let z_mm = work_mm(&control)[2];
    control.ask(&["mdi", "G43"]).unwrap();
    assert_near(work_mm(&control)[2], z_mm - 12.3);
    control.ask(&["mdi", "G49"]).unwrap();

    // A program: loaded, started, held, gone on with, stopped; drives stay on, and it runs again without homing.
    let loaded = control.ask(&["program", "load", long]).unwrap();
    assert_eq!(loaded["lines"], 4);
    control.ask(&["program", "start", "--no-wait"]).unwrap();
    control.wait_for("running", |status| status["state"] == "running");
    control.refused(&["mdi", "G0 X1"], "a program runs");
    control.refused(&["jog", "X", "1"], "a program runs");
    done(&control, &["hold"], "at rest on the path; go on with: isocnc resume");
    assert_eq!(status(&control)["activity"], "held");
    done(&control, &["hold"], "at rest on the path; go on with: isocnc resume");
    // Away by hand, to look at the work, and back, with the way told.
    let held = work_mm(&control);
    done(
        &control,
        &["jog", "Y", "3", "--speed", "50"],
        &format!(
            "Y at rest at {:.3} mm",
            status(&control)["position_mm"][1].as_f64().unwrap() + 3.0
        ),
    );
    control.ask(&["jog", "Z", "4", "--speed", "50"]).unwrap();
    let away = control.wait_for("away", |status| status["activity"] == "away");
    assert_eq!(away["waiting"]["for"], "operator");
    control.refused(&["reverse"], "isocnc resume returns to it");
    control.refused(&["mdi", "G0 X1"], "a program is held, away from its path");
    let (code, said) = control.words(&["resume"]);
    assert!(
        code == Some(0) && said.contains("returns to the path: Y") && said.contains("then Z down to"),
        "{said}"
    );
    assert_eq!(
        said.lines().last(),
        Some("on the path again; go on with: isocnc resume")
    );
    assert_eq!(status(&control)["activity"], "held");
    for (back, held) in work_mm(&control).into_iter().zip(held) {
        assert_near(back, held);
    }
    control.ask(&["resume"]).unwrap();
    control.wait_for("running again", |status| status["activity"] == "running");
    done(&control, &["stop"], "at rest, drives are on");
    done(&control, &["on"], "drives are on");
    control.ask(&["jog", "Y", "3", "--speed", "50"]).unwrap();
    done(&control, &["program", "run", part], "completed; drives are on");
    let at = work_mm(&control);
    assert_near(at[0], 30.0);
    assert_near(at[1], 20.0);

    // From a line: first what that means, then the way there, Z first.
    control.ask(&["program", "load", part]).unwrap();
    let said = control
        .ask(&["program", "start", "--from-line", "4"])
        .expect_err("a question");
    for what in [
        "first moves: Z to the upper end",
        "X30.000 Y5.000",
        "G1",
        "isocnc program start --from-line 4 --yes",
    ] {
        assert!(said.contains(what), "{what}: {said}");
    }
    control.refused(&["program", "start", "--from-line", "40", "--yes"], "line 40");
    done(
        &control,
        &["program", "start", "--from-line", "4", "--yes"],
        "completed; drives are on",
    );
    assert_near(work_mm(&control)[0], 30.0);
    assert_near(work_mm(&control)[1], 20.0);

    let (_, journal) = control.words(&["journal"]);
    for entry in [
        "order: touch-off",
        "MDI: G91 G0 X5",
        "part.ngc: completed, ",
        "long.ngc: stopped, ",
    ] {
        assert!(journal.contains(entry), "{entry}: {journal}");
    }
    control.refused(&["offset", "set", "G55", "W", "1"], "the machine has no axis W");

    // Emergency stop in mid-program, by software; three acts to get on.
    control.ask(&["program", "run", "--no-wait", long]).unwrap();
    control.wait_for("running", |status| status["state"] == "running");
    control.ask(&["estop"]).unwrap();
    control.wait_for("the stop", |status| {
        status["state"] == "estop" && status["job"] == "faulted"
    });
    control.refused(&["on"], "isocnc estop reset");
    control.refused(&["alarm", "acknowledge"], "isocnc estop reset");
    done(&control, &["estop", "reset"], "reset; drives stay off: isocnc on");
    control.refused(&["program", "start"], "drives are off: isocnc on");
    done(&control, &["on"], "drives are on");
    assert_eq!(
        status(&control)["homed"],
        serde_json::json!([0, 1, 2]),
        "its place was read all the time"
    );
    done(&control, &["program", "run", part], "completed; drives are on");
    let again = work_mm(&control);
    for (again, at) in again.into_iter().zip(at).take(2) {
        assert_near(again, at);
    }
    done(&control, &["off"], "at rest, drives are off");
    done(&control, &["off"], "at rest, drives are off");
}

#[test]
fn the_chain_and_limit_switches_stop_the_machine_and_say_how_to_go_on() {
    // Both hang on pins that the test sets.
    let control = day("chain", str::to_owned);
    let set = |pin: &str, value: &str| control.ask(&["hal", "set", pin, value]).unwrap();
    done(&control, &["home"], "homed; drives are on");
    set("iocontrol.0.emc-enable-in", "false");
    control.wait_for("the stop", |status| status["power"] == "estop_open");
    control.refused(&["on"], "release the button");
    let (code, said) = control.words(&["estop", "reset"]);
    assert!(code == Some(1) && said.contains("its chain is still open"), "{said}");
    set("iocontrol.0.emc-enable-in", "true");
    control.wait_for("the chain", |status| status["power"] == "estop");
    done(&control, &["estop", "reset"], "reset; drives stay off: isocnc on");
    done(&control, &["on"], "drives are on");

    // Whoever has ordered what was stopped is told why.
    let mut hand = Command::new(env!("CARGO_BIN_EXE_isocnc"));
    hand.args(["jog", "X", "+", "--speed", "20", "--machine", &control.machine]);
    let hand = hand.stdout(Stdio::piped()).spawn().unwrap();
    control.wait_for("the jog", |status| status["activity"] == "jogging");
    set("joint.0.pos-lim-sw-in", "true");
    let output = hand.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.code() == Some(1) && said.contains("upper limit switch"),
        "{said}"
    );
    let stopped = control.wait_for("the stop", |status| {
        status["alarm"].is_object() && status["power"] == "alarm"
    });
    assert!(
        stopped["alarm"]["text"]
            .as_str()
            .unwrap()
            .contains("upper limit switch"),
        "{stopped}"
    );
    control.ask(&["alarm", "acknowledge"]).unwrap();
    control.wait_for("off", |status| status["power"] == "off");
    done(&control, &["on"], "drives are on");
    control.refused(&["mdi", "G0 X1"], "a limit switch is closed");
    let (_, said) = control.words(&["status"]);
    assert!(said.contains("the upper switch of joint 0 is closed"), "{said}");
    control.refused(&["jog", "X", "1"], "joint 0 stands on its upper limit switch");
    control.ask(&["jog", "X", "-5", "--speed", "20"]).unwrap();
    set("joint.0.pos-lim-sw-in", "false");
    control.wait_for("free", |status| {
        status["limit_switches"]["upper"] == serde_json::json!([])
    });
    control.ask(&["mdi", "G53 G0 X10"]).unwrap();
    assert_near(status(&control)["position_mm"][0].as_f64().unwrap(), 10.0);
}

/// Another program on the socket, which knows the documents only.
#[test]
fn a_client_in_python_drives_a_day() {
    let Ok(version) = Command::new("python3").arg("--version").output() else {
        println!("there is no python3");
        return;
    };
    assert!(version.status.success());
    let control = day("python-day", by_hand);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/python/day.py");
    let output = Command::new("python3")
        .args(["-B", script, &control.machine])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{said}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    for line in [
        "refused, as it should be: drives are off: isocnc on",
        "homed: [0, 1, 2]",
        "X reads 13.0",
        "the part ends at [30.0, 20.0]",
        "waits: put tool 5 into the spindle",
    ] {
        assert!(said.lines().any(|said| said == line), "{line}: {said}");
    }
}

/// Tools are changed by hand: no net answers for the operator.
fn by_hand(machine: &str) -> String {
    let begin = machine
        .find("[[hal.net]]\nname = \"tool-change-loop\"")
        .expect("the net");
    let (before, net) = machine.split_at(begin);
    let rest = net[2..].find("[[").expect("another one") + 2;
    format!("{before}{}", &net[rest..])
}

fn with_state(machine: &str) -> String {
    machine.replace("\n[machine]\n", "\n[machine]\nstate_directory = \"state\"\n")
}

/// Numbers go on, and nothing that was told before a kill is lost.
#[test]
fn the_journal_goes_on_behind_a_kill() {
    let mut control = day("journal", with_state);
    done(&control, &["on"], "drives are on");
    let entries = |control: &Control| {
        let (code, said) = control.words(&["journal"]);
        assert_eq!(code, Some(0), "{said}");
        said.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let file = control.folder.path().join("state/journal.jsonl");
    let before = entries(&control);
    let written = || std::fs::read_to_string(&file).unwrap_or_default().lines().count();
    control.wait_for("the disk", |_| written() >= before.len());
    control.process.kill().unwrap();
    testing::end(&mut control.process);
    let folder = std::mem::replace(&mut control.folder, tempfile::tempdir().unwrap());
    let again = Control::start_in(folder, "journal-again", Stdio::null(), with_state);
    again.wait_for("the network", |status| status["power"] == "off");
    let after = entries(&again);
    assert_eq!(after[..before.len()], before);
    assert!(after.len() > before.len());
    let numbers: Vec<u64> = after
        .iter()
        .map(|line| line.split_whitespace().next().unwrap().parse().unwrap())
        .collect();
    assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "{numbers:?}");
}

/// Between load and start the tool table is edited by hand: what it says now is checked, and refused where it does not fit.
#[test]
fn a_table_that_is_edited_behind_the_load_counts_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("tools.tbl");
    std::fs::write(&table, "T5 P5 Z10\n").unwrap();
    let control = Control::start_in(folder, "edited-table", Stdio::null(), |machine| {
        format!("{machine}\n[tools]\ntable = \"tools.tbl\"\n")
    });
    control.wait_for("the network", |status| status["power"] == "off");
    done(&control, &["home"], "homed; drives are on");
    let part = control.program("part.ngc", "G21 G90 G94 G54 G49\nG43 H5\nG0 Z-20\nM2\n");
    control.ask(&["program", "load", part.to_str().unwrap()]).unwrap();
    std::fs::write(&table, "T5 P5 Z-500\n").unwrap();
    control.refused(&["program", "start"], "part.ngc:3:");
    std::fs::write(&table, "T5 P5 Z11\n").unwrap();
    done(&control, &["program", "start"], "completed; drives are on");
    // Nor does what is set then overwrite it.
    std::fs::write(&table, "T5 P5 Z11\nT7 P7 Z3\n").unwrap();
    control.ask(&["tool", "set", "5", "--length", "12"]).unwrap();
    let written = std::fs::read_to_string(&table).unwrap();
    assert!(written.contains("T7") && written.contains("12"), "{written}");
}

/// M1 stops with its switch on, as it is reached; lines behind a slash are run or not, as the switch stood at the start.
#[test]
fn the_switches_for_m1_and_for_slashes_count() {
    let control = day("switches", by_hand);
    done(&control, &["home"], "homed; drives are on");
    let part = control.program("part.ngc", "G21 G90 G94 G54\nG0 X5 Y5\nM1\n/G0 X20\nG0 Y7\nM2\n");
    let path = part.to_str().unwrap();
    done(&control, &["program", "run", path], "completed; drives are on");
    assert_near(work_mm(&control)[0], 20.0);

    done(&control, &["optional-stop", "on"], "stops at M1");
    done(
        &control,
        &["block-delete", "on"],
        "lines that begin with / are left out",
    );
    assert_eq!(
        control
            .ask(&["hal", "get", "halui.program.optional-stop.is-on"])
            .unwrap()["value"],
        true
    );
    control.ask(&["program", "start", "--no-wait"]).unwrap();
    let waiting = control.wait_for("the stop", |status| status["waiting"]["for"] == "operator");
    assert_eq!(
        (&waiting["optional_stop"], &waiting["block_delete"]),
        (&Value::Bool(true), &Value::Bool(true))
    );
    // What has stopped goes on by an order only; the lines of a program under way stay what they are.
    done(
        &control,
        &["optional-stop", "off"],
        "does not stop at M1; one that has stopped goes on with: isocnc resume",
    );
    control.refused(&["block-delete", "off"], "a program runs");
    assert_eq!(status(&control)["waiting"]["for"], "operator");
    control.ask(&["resume"]).unwrap();
    control.wait_for("the end", |status| status["job"] == "completed");
    assert_near(work_mm(&control)[0], 5.0);
    assert_near(work_mm(&control)[1], 7.0);
    done(&control, &["block-delete", "off"], "lines that begin with / are run");
    done(&control, &["program", "start"], "completed; drives are on");
    assert_near(work_mm(&control)[0], 20.0);
}
