//! What a control knows again after a restart, whatever ended it: the whole program, killed and started anew.

use crate::common;

use common::Control;
use serde_json::{Value, json};
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::TempDir;

const PART: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5\nG1 X30 F3000\nM2\n";
/// Half a minute of motion.
const LONG: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5\nG1 X200 F400\nM2\n";
const KILLS: u64 = 8;

/// The encoders of the machine are absolute, and it has a state folder.
fn with_state(machine: &str) -> String {
    let files = "state_directory = \"state\"\n";
    let machine = machine.replace("\n[machine]\n", &format!("\n[machine]\n{files}"));
    // However busy this PC is.
    let machine = machine.replace("following_error_mm = 2.0", "following_error_mm = 200.0");
    machine.replace("position_mm = 0.0 }", "position_mm = 0.0, absolute_encoder = true }")
}

/// A control of this folder, its network up.
fn started(folder: TempDir, name: &str) -> Control {
    let control = Control::start_in(folder, name, Stdio::null(), with_state);
    control.wait_for("the network", |status| status["power"] == "off");
    control
}

/// Killed, not ended.
fn killed(mut control: Control) -> TempDir {
    control.process.kill().unwrap();
    testing::end(&mut control.process);
    std::mem::replace(&mut control.folder, tempfile::tempdir().unwrap())
}

fn status(control: &Control) -> Value {
    control.ask(&["status"]).unwrap()
}

/// Where a joint was last seen at rest, as the disk knows it, mm.
fn kept_place_mm(control: &Control, joint: usize) -> f64 {
    let state = std::fs::read_to_string(control.folder.path().join("state/state.json")).unwrap();
    let state: Value = serde_json::from_str(state.split_once('\n').unwrap().1).unwrap();
    state["joints"][joint]["motor_mm"].as_f64().unwrap()
}

#[test]
fn a_day_goes_on_where_a_kill_has_ended_it() {
    let control = started(tempfile::tempdir().unwrap(), "known");
    let [part, long] = [("part.ngc", PART), ("long.ngc", LONG)].map(|(name, text)| control.program(name, text));
    let [part, long] = [&part, &long].map(|path| path.to_str().unwrap());
    assert_eq!(status(&control)["homed"], json!([]));
    control.ask(&["home"]).unwrap();
    control.ask(&["offset", "set", "G55", "X", "7"]).unwrap();
    control.ask(&["parts", "target", "3"]).unwrap();
    control.ask(&["program", "run", part]).unwrap();
    control.ask(&["program", "start"]).unwrap();
    assert_eq!(status(&control)["parts"], json!({ "count": 2, "target": 3 }));
    control.ask(&["mdi", "G0 X1"]).unwrap();
    // Where the simulated drives count 0, as they do behind a restart.
    control.ask(&["mdi", "G53 G0 X0 Y0 Z0"]).unwrap();
    control.wait_for("its places on the disk", |_| {
        (0..3).all(|joint| kept_place_mm(&control, joint).abs() < 0.01)
    });

    let again = started(killed(control), "known");
    let known = again.wait_for("its joints", |status| status["homed"] == json!([0, 1, 2]));
    assert_eq!(known["parts"], json!({ "count": 2, "target": 3 }));
    assert_eq!(
        known["last_program"],
        json!({ "name": part, "line": 4, "result": "completed" })
    );
    assert_eq!(
        again.ask(&["offset", "list"]).unwrap()["systems"][1]["origin"]["X"],
        7.0
    );
    let (_, typed) = again.words(&["mdi", "--history"]);
    assert_eq!(typed, "G0 X1\nG53 G0 X0 Y0 Z0\n");
    let (_, told) = again.words(&["journal"]);
    assert!(told.contains("homed, as its absolute encoder says"), "{told}");
    // It works without being homed; then it is killed in mid-program.
    again.ask(&["on"]).unwrap();
    again.ask(&["mdi", "G53 G0 X23"]).unwrap();
    again.wait_for("its place on the disk", |_| {
        (kept_place_mm(&again, 0) - 23.0).abs() < 0.1
    });
    again.ask(&["program", "load", long]).unwrap();
    again.ask(&["program", "start", "--no-wait"]).unwrap();
    again.wait_for("line 3 on the disk", |_| {
        let state = std::fs::read_to_string(again.folder.path().join("state/state.json")).unwrap();
        state.contains("\"line\": 3")
    });

    let last = started(killed(again), "known");
    let known = last.wait_for("why joints are not homed", |_| {
        last.words(&["journal"])
            .1
            .contains("axis X (joint 0): to be homed: its drive counts")
    });
    assert!(!known["homed"].as_array().unwrap().contains(&json!(0)), "{known}");
    assert_eq!(
        known["last_program"],
        json!({ "name": long, "line": 3, "result": "interrupted" })
    );
    let (_, told) = last.words(&["journal"]);
    let told = told
        .lines()
        .find(|line| line.contains("the control ended in mid-program"))
        .expect("it is told");
    assert!(told.ends_with("long.ngc, line 3 was reached"), "{told}");

    // A file that nobody can use keeps no machine from starting, and is not lost.
    let folder = killed(last);
    let state = folder.path().join("state/state.json");
    let whole = std::fs::read(&state).unwrap();
    std::fs::write(&state, &whole[..whole.len() - 9]).unwrap();
    let bad = started(folder, "known");
    assert_eq!(status(&bad)["parts"], json!({ "count": 0, "target": null }));
    let (_, told) = bad.words(&["journal"]);
    assert!(
        told.contains("state.json: it is cut short") && told.contains("state.json.bad-1"),
        "{told}"
    );
    assert_eq!(
        std::fs::read(bad.folder.path().join("state/state.json.bad-1")).unwrap(),
        whole[..whole.len() - 9]
    );
    bad.ask(&["parts", "reset", "41"]).unwrap();
    assert_eq!(status(&started(killed(bad), "known"))["parts"]["count"], 41);
}

/// The whole program, killed while clients change what it remembers: whatever was answered is there, and the journal has no gap.
#[test]
fn kills_lose_nothing_that_was_answered() {
    let mut control = started(tempfile::tempdir().unwrap(), "killed");
    let mut answered = 0;
    for kill in 0..KILLS {
        let stop = AtomicBool::new(false);
        let (before, now) = (answered, &control);
        answered = std::thread::scope(|scope| {
            let stop = &stop;
            let (told, first) = std::sync::mpsc::channel();
            let clerk = scope.spawn(move || {
                let mut answered = before;
                while !stop.load(Ordering::Relaxed) {
                    let next = (answered + 1).to_string();
                    let orders: [&[&str]; 2] = [&["offset", "set", "G56", "Y", &next], &["parts", "reset", &next]];
                    if !orders.iter().all(|order| now.words(order).0 == Some(0)) {
                        break;
                    }
                    answered += 1;
                    // Nobody waits for another than the first.
                    let _ = told.send(());
                }
                answered
            });
            first.recv().expect("an answer");
            std::thread::sleep(Duration::from_millis(kill * 37 % 200));
            let pid = nix::unistd::Pid::from_raw(now.process.id() as i32);
            nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGKILL).unwrap();
            stop.store(true, Ordering::Relaxed);
            clerk.join().unwrap()
        });
        control = started(killed(control), "killed");
        let offsets = control.ask(&["offset", "list"]).unwrap();
        let offset = offsets["systems"][2]["origin"]["Y"].as_f64().unwrap() as u64;
        let count = status(&control)["parts"]["count"].as_u64().unwrap();
        for found in [offset, count] {
            assert!(
                (answered..=answered + 1).contains(&found),
                "kill {kill}: {found}, answered {answered}"
            );
        }
        answered = offset.min(count);
        let (_, journal) = control.words(&["journal"]);
        let numbers: Vec<u64> = journal
            .lines()
            .map(|line| line.split_whitespace().next().unwrap().parse().unwrap())
            .collect();
        assert!(
            numbers.iter().copied().eq(1..=numbers.len() as u64),
            "kill {kill}: {numbers:?}"
        );
    }
    assert!(answered >= KILLS, "only {answered} orders");
}

/// A change of tool that nobody has seen end: the next control says so, once.
#[test]
fn a_kill_in_a_change_of_tool_is_told() {
    let by_hand = |machine: &str| {
        let net = machine.find("[[hal.net]]\nname = \"tool-change-loop\"").unwrap();
        let (before, net) = machine.split_at(net);
        let end = net[2..].find("[[").unwrap() + 2;
        with_state(&format!("{before}{}", &net[end..]))
    };
    let begun = |folder: TempDir| {
        let control = Control::start_in(folder, "changer", Stdio::null(), by_hand);
        control.wait_for("the network", |status| status["power"] == "off");
        control
    };
    let told = |control: &Control| {
        let entries = journal(control);
        let of_tool = |entry: &&Value| {
            let text = entry["text"].as_str().unwrap();
            text.contains("ended during the change to tool 7: look which tool is in the spindle")
        };
        entries.iter().filter(of_tool).count()
    };
    let control = begun(tempfile::tempdir().unwrap());
    control.ask(&["home"]).unwrap();
    control.ask(&["mdi", "--no-wait", "T7 M6"]).unwrap();
    control.wait_for("M6", |status| status["waiting"]["for"] == "tool_change");
    let state = control.folder.path().join("state/state.json");
    while !std::fs::read_to_string(&state)
        .unwrap_or_default()
        .contains("\"changing\": 7")
    {
        std::thread::sleep(Duration::from_millis(5));
    }
    let control = begun(killed(control));
    assert_eq!((told(&control), &status(&control)["tool"]), (1, &json!(0)));
    // Of one that came to its end nothing is said.
    control.ask(&["home"]).unwrap();
    control.ask(&["mdi", "--no-wait", "T7 M6"]).unwrap();
    control.wait_for("M6", |status| status["waiting"]["for"] == "tool_change");
    control.ask(&["tool-changed"]).unwrap();
    control.wait_for("the end", |status| status["job"] == "completed");
    let control = begun(killed(control));
    assert_eq!((told(&control), &status(&control)["tool"]), (1, &json!(7)));
}

/// Entries of the journal, as JSON.
fn journal(control: &Control) -> Vec<Value> {
    let (code, said) = control.words(&["journal", "--json"]);
    assert_eq!(code, Some(0), "{said}");
    said.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn programs_leave_their_reports_and_alarms_their_records() {
    let control = started(tempfile::tempdir().unwrap(), "records");
    let [part, long] = [("part.ngc", PART), ("long.ngc", LONG)].map(|(name, text)| control.program(name, text));
    let [part, long] = [&part, &long].map(|path| path.to_str().unwrap());
    control.refused(&["program", "report"], "no program has been run");
    control.ask(&["home"]).unwrap();
    control.ask(&["program", "load", part]).unwrap();
    control.ask(&["program", "start", "--repeat", "3"]).unwrap();
    assert_eq!(status(&control)["parts"]["count"], 3);
    let entries = journal(&control);
    let ended = entries.iter().filter(|entry| entry["program"]["result"] == "completed");
    let reports: Vec<&Value> = ended.map(|entry| &entry["program"]["report"]).collect();
    assert_eq!(reports, [&json!(1), &json!(2), &json!(3)]);
    let begun = entries
        .iter()
        .filter(|entry| entry["text"] == format!("program {part}: begun"));
    assert_eq!(begun.count(), 3);
    for number in ["1", "3"] {
        let report = control.ask(&["program", "report", number]).unwrap();
        assert_eq!(
            (&report["result"], &report["line_reached"]),
            (&json!("completed"), &json!(4))
        );
        assert_eq!(report["parts"]["count"].to_string(), number);
        let deviation = &report["deviation"];
        assert!(deviation["command_max_mm"].as_f64().unwrap() < 0.02, "{report}");
        assert!(
            report["motion_time_s"].as_f64().unwrap() > 0.5 * report["planned_time_s"].as_f64().unwrap(),
            "{report}"
        );
        assert_eq!(report["alarms"], json!([]));
    }
    control.refused(
        &["program", "report", "9"],
        "there is no such report: the last ones are 1 to 3",
    );
    let both = ["program", "start", "--from-line", "3", "--repeat", "2"];
    assert_eq!(control.words(&both).0, Some(2));

    // An alarm says what it is, where and behind what; then who knows of it.
    control.ask(&["program", "run", "--no-wait", long]).unwrap();
    control.wait_for("line 3", |status| status["state"] == "running" && status["line"] == 3);
    control.ask(&["hal", "set", "joint.0.pos-lim-sw-in", "true"]).unwrap();
    control.wait_for("the end", |status| status["job"] == "faulted");
    let alarm = |control: &Control| {
        let found = journal(control).into_iter().find(|entry| entry["kind"] == "alarm");
        found.expect("an alarm")
    };
    let found = alarm(&control);
    for (name, wanted) in [
        ("code", json!("J-206")),
        ("severity", json!("stop")),
        ("reaction", json!("controlled_stop")),
        ("first_cause", found["seq"].clone()),
        ("joint", json!(0)),
        ("node", json!("x-drive (node 1)")),
        ("program", json!(long)),
        ("line", json!(3)),
        ("state", json!("running")),
        ("acknowledged", Value::Null),
    ] {
        assert_eq!(found["alarm"][name], wanted, "{name}: {found}");
    }
    let report = control.ask(&["program", "report"]).unwrap();
    assert_eq!(
        (&report["result"], &report["alarms"][0]["cause"]),
        (&json!("faulted"), &status(&control)["alarm"]["text"])
    );
    control.ask(&["alarm", "acknowledge"]).unwrap();
    assert_eq!(alarm(&control)["alarm"]["acknowledged"]["by"], "alarm acknowledge");
    let (_, told) = control.words(&["journal"]);
    let line = told.lines().find(|line| line.contains("alarm: ")).unwrap();
    let said = format!("[J-206 stop, {long}:3, was running, acknowledged by alarm acknowledge]");
    assert!(line.ends_with(&said), "{line}");
    assert_eq!(status(&control)["parts"]["count"], 3);

    // A dry run is no part, and the next start is none.
    control.ask(&["program", "load", part]).unwrap();
    control.ask(&["on"]).unwrap();
    control.ask(&["hal", "set", "joint.0.pos-lim-sw-in", "false"]).unwrap();
    control.ask(&["home"]).unwrap();
    control.ask(&["program", "start", "--dry-run", "3000"]).unwrap();
    let dry = status(&control);
    assert_eq!(
        (&dry["parts"]["count"], &dry["program"]["dry_run"]),
        (&json!(3), &json!(true))
    );
    control.refused(&["skip"], "no program runs or is held");
    let report = control.ask(&["program", "report"]).unwrap();
    assert_eq!(report["result"], "completed");

    // All of it behind a restart.
    let again = started(killed(control), "records");
    assert_eq!(alarm(&again)["alarm"]["acknowledged"]["by"], "alarm acknowledge");
    assert_eq!(again.ask(&["program", "report"]).unwrap(), report);
    let (_, said) = again.words(&["program", "report", "2"]);
    assert!(
        said.starts_with("report 2 ") && said.contains("result                 completed\n"),
        "{said}"
    );
}
