//! What clients are shown is what the machine is at: modes and offsets of the block that is executed, the mode, the program that Start
//! runs, the length of the tool in force, the periods of the cycle.

use crate::common;

use common::Control;
use isocnc::api::client::{self, Client, ClientError};
use isocnc::config;
use isocnc::operator::rehearsal::rehearse;
use isocnc::rt::cycle_stats::{CycleTimes, recorder};
use isocnc::sim::NetConfig;
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Stdio};

/// Half a minute of motion.
const LONG: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5\nG1 X200 F400\nM2\n";

/// A control whose drives are on and whose joints are homed.
fn ready(name: &str) -> Control {
    let control = Control::start(name, Stdio::null());
    control.wait_for("the network", |status| status["power"] == "off");
    control.ask(&["home"]).unwrap();
    control
}

fn codes(status: &Value) -> Vec<&str> {
    let codes = status["codes"].as_array().unwrap().iter();
    codes.map(|code| code.as_str().unwrap()).collect()
}

fn assert_codes(status: &Value, wanted: &[&str]) {
    let found = codes(status);
    assert!(wanted.iter().all(|word| found.contains(word)), "{wanted:?}: {found:?}");
}

fn number(status: &Value, what: &str, axis: usize) -> f64 {
    status[what][axis].as_f64().unwrap()
}

/// Waits until the program waits in this line for the operator.
fn waits_in(control: &Control, line: u32) -> Value {
    control.wait_for("the stop", |status| {
        status["waiting"]["for"] == "operator" && status["line"] == line
    })
}

#[test]
fn modes_offsets_and_length_are_those_of_the_block_that_is_executed() {
    let control = Control::start("shown-modes", Stdio::null());
    let off = control.wait_for("the network", |status| status["power"] == "off");
    assert_codes(
        &off,
        &["G80", "G17", "G21", "G90", "G54", "G49", "M5", "M9", "S0", "F0"],
    );
    control.ask(&["home"]).unwrap();
    control.ask(&["offset", "set", "G55", "X", "30"]).unwrap();
    control.ask(&["tool", "set", "3", "--length", "40"]).unwrap();
    let program = control.program(
        "modes.ngc",
        "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5\nM0\nG55 G43 H3 S1500 M3 M8 F300\nG1 X10\nM0\nG10 L2 P2 X32\nG92 X5\nM0\nG92.1\nM2\n",
    );
    let before = control.ask(&["status"]).unwrap();
    control
        .ask(&["program", "run", "--no-wait", program.to_str().unwrap()])
        .unwrap();
    // All of the program has been read by now, and this is what the machine is at.
    let first = waits_in(&control, 3);
    assert_codes(&first, &["G0", "G54", "G49", "M5", "M9", "S0", "F0"]);
    assert_eq!(first["work_offset_mm"], before["work_offset_mm"]);
    control.ask(&["resume"]).unwrap();
    let second = waits_in(&control, 6);
    assert_codes(&second, &["G1", "G55", "G43", "S1500", "M3", "M8", "F300"]);
    assert_eq!(number(&second, "work_offset_mm", 0), 30.0);
    assert_eq!(number(&second, "position_mm", 0), 40.0);
    let z = number(&second, "work_offset_mm", 2);
    control.ask(&["resume"]).unwrap();
    // The origin is 2 mm on, and what was X10 reads 5. Nothing moves between the two stops: what is shown of the first may stand beside
    // the line of the second until the operator's next turn.
    control.wait_for("the offsets of line 9", |status| {
        status["line"] == 9 && !status["waiting"].is_null() && number(status, "work_offset_mm", 0) == 35.0
    });
    control.ask(&["resume"]).unwrap();
    let end = control.wait_for("the end", |status| {
        status["program"]["result"] == "completed" && status["activity"] == "idle"
    });
    assert_codes(&end, &["G54", "M5", "M9", "F0"]);
    assert_eq!(number(&end, "work_offset_mm", 0), number(&before, "work_offset_mm", 0));
    // The length stays in force, as for the next line of MDI.
    control.ask(&["mdi", "G55"]).unwrap();
    let after = control.ask(&["status"]).unwrap();
    assert_codes(&after, &["G55", "G43"]);
    assert_eq!(
        (number(&after, "work_offset_mm", 2), number(&after, "work_offset_mm", 0)),
        (z, 32.0)
    );
}

/// What follows the stop of a program begins as a program does, which is shown.
#[test]
fn a_program_that_is_stopped_leaves_codes_as_a_program_begins() {
    let control = ready("shown-stopped");
    let program = control.program("stopped.ngc", "G21 G90 G54\nG91 G43 H3 F300 M8\nM0\nM2\n");
    control
        .ask(&["program", "run", "--no-wait", program.to_str().unwrap()])
        .unwrap();
    assert_codes(&waits_in(&control, 3), &["G91", "G43", "M8", "F300"]);
    control.ask(&["stop"]).unwrap();
    let stopped = control.wait_for("the stop", |status| status["activity"] == "idle");
    assert_codes(&stopped, &["G90", "G49", "M9", "F0", "G54"]);
}

/// Behind an alarm: acknowledged, and on again.
fn goes_on(control: &Control) {
    control.ask(&["alarm", "acknowledge"]).unwrap();
    control.wait_for("drives off", |status| {
        status["state"] == "disabled" && status["alarm"].is_null()
    });
    control.ask(&["on"]).unwrap();
}

const SYSTEMS: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];

/// At rest codes, offset, the list of offsets and #5220 in the file name this work system and no other; lines of MDI move and touch off
/// in it.
fn assert_work_system(control: &Control, wanted: &str, when: &str) {
    let place = SYSTEMS.iter().position(|system| *system == wanted).unwrap();
    let kept = || {
        let text = std::fs::read_to_string(control.folder.path().join("mill3.var")).unwrap();
        let value = text.lines().find_map(|line| line.strip_prefix("5220")).unwrap().trim();
        value.parse::<f64>().unwrap()
    };
    control.wait_for(&format!("rest and #5220 of {wanted} {when}"), |status| {
        status["activity"] == "idle" && kept() == (place + 1) as f64
    });
    let found = |status: &Value| {
        let all = codes(status).into_iter().filter(|code| SYSTEMS.contains(code));
        all.map(str::to_owned).collect::<Vec<_>>()
    };
    let list = || control.ask(&["offset", "list"]).unwrap();
    let actives = |list: &Value| {
        let systems = list["systems"].as_array().unwrap().iter();
        let active = systems.filter(|system| system["active"] == true);
        active
            .map(|system| system["system"].as_str().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    let origin = |list: &Value| list["systems"][place]["origin"]["X"].as_f64().unwrap();
    let (status, offsets) = (control.ask(&["status"]).unwrap(), list());
    assert_eq!(
        (found(&status), actives(&offsets)),
        (vec![wanted.to_owned()], vec![wanted.to_owned()]),
        "{when}"
    );
    assert_eq!(offset_x(&status), origin(&offsets), "{when}");
    if status["power"] != "on" {
        return;
    }
    control.ask(&["mdi", "G90 G0 X1.5"]).unwrap();
    let at = number(&control.ask(&["status"]).unwrap(), "position_mm", 0);
    assert!((at - origin(&offsets) - 1.5).abs() < 1e-6, "{when}: {at}");
    control.ask(&["touch-off", "X", "2.5"]).unwrap();
    let touched = list();
    for (other, (before, after)) in SYSTEMS.iter().zip(systems(&offsets).zip(systems(&touched))) {
        let moved = after["origin"]["X"].as_f64().unwrap() - before["origin"]["X"].as_f64().unwrap();
        let by = if *other == wanted { -1.0 } else { 0.0 };
        assert!((moved - by).abs() < 1e-6, "{when}: {other} {moved}");
    }
    control.ask(&["touch-off", "X", "1.5"]).unwrap();
}

/// X of the offset in force.
fn offset_x(status: &Value) -> f64 {
    number(status, "work_offset_mm", 0)
}

fn systems(list: &Value) -> impl Iterator<Item = &Value> {
    list["systems"].as_array().unwrap().iter()
}

/// M2 and M30 leave G54; the end of a text without them the system of its last line; whatever is given up, the one before it, however far
/// it has been read.
#[test]
fn every_end_of_a_program_or_a_line_leaves_one_work_system() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mill3.var"), include_str!("../configs/mill3.var")).unwrap();
    let with_file = |text: &str| text.replacen("# parameter_file", "parameter_file", 1);
    let control = Control::start_in(folder, "shown-systems", Stdio::null(), with_file);
    control.wait_for("the network", |status| status["power"] == "off");
    control.ask(&["home"]).unwrap();
    assert_work_system(&control, "G54", "behind homing");
    for (system, x) in [("G55", "40"), ("G56", "60")] {
        control.ask(&["offset", "set", system, "X", x]).unwrap();
    }
    let run = |name: &str, text: &str, more: &[&str]| {
        let program = control.program(name, text);
        let order = [&["program", "run"], more, &[program.to_str().unwrap()]].concat();
        control.ask(&order).unwrap_or_else(|errors| panic!("{name}: {errors}"))
    };
    for end in ["M2", "M30"] {
        run("end.ngc", &format!("G21 G90 G94\nG55\nG0 X1\n{end}\n"), &[]);
        assert_work_system(&control, "G54", end);
        // What names none runs in it.
        run("next.ngc", "G21 G90 G94\nG0 X3\nM2\n", &[]);
        let status = control.ask(&["status"]).unwrap();
        assert!(
            (number(&status, "position_mm", 0) - offset_x(&status) - 3.0).abs() < 1e-6,
            "{status}"
        );
    }
    control.ask(&["mdi", "G55"]).unwrap();
    assert_work_system(&control, "G55", "behind a line of MDI");
    run("percent.ngc", "%\nG21 G90 G94\nG0 X2\nG56\nG0 X1\n%\n", &[]);
    assert_work_system(&control, "G56", "behind %");

    // In mid program, in G54, behind which G57 has been read, and an end that would leave it or G54.
    let begin = |end: &str| {
        run(
            "middle.ngc",
            &format!("%\nG21 G90 G94\nG54\nG0 X2\nM0\nG57\nG0 X1\n{end}\n"),
            &["--no-wait"],
        );
        // The codes of a line may come a turn of the operator behind its number.
        control.wait_for("the codes of the stop", |status| {
            status["waiting"]["for"] == "operator" && status["line"] == 5 && codes(status).contains(&"G54")
        });
        // What is executed is what is listed.
        let list = control.ask(&["offset", "list"]).unwrap();
        assert_eq!(
            systems(&list)
                .map(|system| system["active"] == true)
                .collect::<Vec<_>>()[..3],
            [true, false, false]
        );
    };
    for end in ["M2", "%"] {
        begin(end);
        control.ask(&["stop"]).unwrap();
        assert_work_system(&control, "G56", "behind a stop");
        begin(end);
        control.ask(&["estop"]).unwrap();
        assert_work_system(&control, "G56", "behind an emergency stop");
        control.ask(&["estop", "reset"]).unwrap();
        control.ask(&["on"]).unwrap();
        assert_work_system(&control, "G56", "behind the reset");
        begin(end);
        control.ask(&["fault", "overcurrent", "--node", "1"]).unwrap();
        control.wait_for("the alarm", |status| !status["alarm"].is_null());
        assert_work_system(&control, "G56", "behind a fault");
        goes_on(&control);
        assert_work_system(&control, "G56", "behind the acknowledge");
    }
    // A program that fails by itself.
    run(
        "fails.ngc",
        "G21 G90 G94\nG55\nG38.2 X3 F600\nG57\nM2\n",
        &["--no-wait"],
    );
    control.wait_for("no contact", |status| !status["alarm"].is_null());
    // It stops no drive, and what is ordered next acknowledges it.
    assert_work_system(&control, "G56", "behind a probing move without contact");

    // Lines of MDI.
    control.refused(&["mdi", "G54 G999"], "G999");
    assert_work_system(&control, "G56", "behind a line that is refused");
    let mut line = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["mdi", "G54 G1 X200 F60", "--machine", &control.machine])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // Until the block begins, the codes are those before it.
    let moves = control.wait_for("the move", |status| {
        status["activity"] == "running" && codes(status).contains(&"G1")
    });
    assert_codes(&moves, &["G54", "F60"]);
    control.ask(&["stop"]).unwrap();
    line.wait().unwrap();
    assert_work_system(&control, "G56", "behind a line that was stopped");
    control.ask(&["mdi", "M2"]).unwrap();
    assert_work_system(&control, "G54", "behind M2 as a line");
}

/// Else the next line of MDI would switch on what the dry run has not.
#[test]
fn a_dry_run_shows_spindle_and_coolant_off_and_leaves_them_off() {
    let control = ready("shown-dry");
    let program = control.program("dry.ngc", "%\nG21 G90 G54\nS900 M3 M8 F300\nG1 X5\nM0\nX6\n%\n");
    control.ask(&["program", "load", program.to_str().unwrap()]).unwrap();
    control
        .ask(&["program", "start", "--dry-run", "2000", "--no-wait"])
        .unwrap();
    assert_codes(&waits_in(&control, 5), &["G1", "M5", "M9", "S900"]);
    control.ask(&["resume"]).unwrap();
    control.wait_for("the end", |status| {
        status["program"]["result"] == "completed" && status["activity"] == "idle"
    });
    control.ask(&["mdi", "G0 X1"]).unwrap();
    let after = control.ask(&["status"]).unwrap();
    assert_codes(&after, &["M5", "M9"]);
    assert_eq!(
        (&after["spindle"]["on"], &after["coolant"]["flood"]),
        (&false.into(), &false.into())
    );
}

#[test]
fn the_mode_is_that_of_the_program_again_once_it_returns_from_a_jog() {
    let control = ready("shown-mode");
    let program = control.program("long.ngc", LONG);
    control
        .ask(&["program", "run", "--no-wait", program.to_str().unwrap()])
        .unwrap();
    let running = control.wait_for("running", |status| status["state"] == "running" && status["line"] == 3);
    assert_eq!(running["mode"], "auto");
    control.ask(&["hold"]).unwrap();
    assert_eq!(control.ask(&["status"]).unwrap()["mode"], "auto");
    control.ask(&["jog", "Z", "2", "--speed", "50"]).unwrap();
    let away = control.wait_for("away", |status| status["activity"] == "away");
    assert_eq!(away["mode"], "manual");
    control.ask(&["resume"]).unwrap();
    let held = control.wait_for("on the path", |status| status["activity"] == "held");
    assert_eq!(held["mode"], "auto");
    control.ask(&["resume"]).unwrap();
    let running = control.wait_for("running", |status| status["activity"] == "running");
    assert_eq!(running["mode"], "auto");
    control.ask(&["stop"]).unwrap();
}

fn client(control: &Control) -> Client {
    client::connect(Some(&control.machine)).unwrap()
}

fn refusal(answer: Result<Value, ClientError>) -> String {
    match answer {
        Err(ClientError::Refused(error)) => error.message.text,
        other => panic!("{other:?}"),
    }
}

/// Asserts that this program is shown everywhere, and not how another one has ended; gives its revision.
fn assert_shown(client: &mut Client, loaded: &Value, first_line: &str) -> Value {
    let status = client.call("status", json!({})).unwrap();
    for (of_program, of_answer) in [
        ("name", "program"),
        ("revision", "revision"),
        ("lines", "lines"),
        ("planned_time_s", "planned_time_s"),
    ] {
        assert_eq!(status["program"][of_program], loaded[of_answer], "{of_program}");
    }
    assert_eq!(status["program"]["result"], Value::Null);
    assert_eq!(status["program"]["dry_run"], false);
    assert_eq!(status["last_program"]["name"], loaded["program"]);
    let text = client
        .call("program.text", json!({ "from_line": 1, "lines": 1 }))
        .unwrap();
    assert_eq!(text["lines"], json!([first_line]));
    assert_eq!(text["revision"], loaded["revision"]);
    loaded["revision"].clone()
}

#[test]
fn what_was_loaded_last_is_shown_from_the_answer_on_and_is_what_a_start_runs() {
    let control = ready("shown-loaded");
    let mut hand = client(&control);
    let [first, second] = [("first", 10), ("second", 20)].map(|(name, x)| {
        json!({ "name": name, "text": format!("({name})\nG21 G90 G94 G54 G64 P0.01\nG0 X{x}\nG1 X{} F3000\nM2\n", x + 2) })
    });
    let ended = |hand: &mut Client, name: &str, x: f64| {
        let status = control.wait_for("the end", |status| {
            status["activity"] == "idle" && status["program"]["result"] == "completed"
        });
        assert_eq!(status["program"]["name"], name);
        assert_eq!(
            number(&status, "position_mm", 0) - number(&status, "work_offset_mm", 0),
            x
        );
        let report = hand.call("program.report", json!({})).unwrap();
        assert_eq!(report["program"], name);
    };
    let loaded = hand.call("program.load", first.clone()).unwrap();
    let of_first = assert_shown(&mut hand, &loaded, "(first)");
    hand.call("program.start", json!({ "revision": of_first })).unwrap();
    ended(&mut hand, "first", 12.0);

    // Another one behind a run, a dry run, and one in mid program.
    for start in [
        json!({}),
        json!({ "dry_run_feed_mm_min": 2000 }),
        json!({ "from_line": 4, "yes": true }),
    ] {
        let loaded = hand.call("program.load", first.clone()).unwrap();
        let of_first = assert_shown(&mut hand, &loaded, "(first)");
        hand.call("program.start", start.clone()).unwrap();
        ended(&mut hand, "first", 12.0);
        let loaded = hand.call("program.load", second.clone()).unwrap();
        let of_second = assert_shown(&mut hand, &loaded, "(second)");
        assert_ne!(of_first, of_second);
        // Whoever still sees the one before starts nothing.
        for start in [
            json!({ "revision": of_first }),
            json!({ "revision": of_first, "from_line": 4, "yes": true }),
        ] {
            let said = refusal(hand.call("program.start", start));
            assert!(said.contains("another program is loaded by now: second"), "{said}");
        }
        assert_shown(&mut hand, &loaded, "(second)");
        hand.call("program.start", json!({ "revision": of_second })).unwrap();
        ended(&mut hand, "second", 22.0);
    }

    // Lines of MDI change nothing of it.
    let loaded = hand.call("program.load", first).unwrap();
    hand.call("mdi", json!({ "line": "G0 X5" })).unwrap();
    control.wait_for("the line", |status| status["activity"] == "idle");
    assert_shown(&mut hand, &loaded, "(first)");
}

/// Joints home first: what is loaded meanwhile would be shown in the place of what is about to run.
#[test]
fn nothing_is_loaded_in_the_place_of_a_program_that_is_about_to_run() {
    let control = Control::start("shown-about", Stdio::null());
    control.wait_for("the network", |status| status["power"] == "off");
    let mut hand = client(&control);
    hand.call("program.run", json!({ "name": "long", "text": LONG }))
        .unwrap();
    control.wait_for("homing", |status| status["activity"] == "homing");
    let said = refusal(hand.call("program.load", json!({ "name": "other", "text": "M2\n" })));
    assert!(said.starts_with("a program is about to run"), "{said}");
    let running = control.wait_for("the program", |status| status["activity"] == "running");
    assert_eq!(running["program"]["name"], "long");
    hand.call("stop", json!({})).unwrap();
}

#[test]
fn a_length_that_is_touched_off_while_it_is_in_force_counts_at_once() {
    let control = ready("shown-length");
    let read = |status: &Value| number(status, "position_mm", 2) - number(status, "work_offset_mm", 2);
    let status = || control.ask(&["status"]).unwrap();
    let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-6, "{found}, wanted {wanted}");
    control.ask(&["tool", "set", "3", "--length", "40"]).unwrap();
    control.ask(&["mdi", "G43 H3"]).unwrap();
    control.ask(&["touch-off", "Z", "1.5", "--tool", "3"]).unwrap();
    near(read(&status()), 1.5);
    assert_codes(&status(), &["G43"]);
    // The next move goes by it: 2 mm down, and not by the 40 mm of before.
    let before = number(&status(), "position_mm", 2);
    control.ask(&["mdi", "G0 Z-0.5"]).unwrap();
    near(number(&status(), "position_mm", 2), before - 2.0);
    near(read(&status()), -0.5);
    // So does a length that is typed.
    let tools = control.ask(&["tool", "list"]).unwrap();
    let length = tools["tools"]
        .as_array()
        .unwrap()
        .iter()
        .find(|tool| tool["tool"] == 3)
        .unwrap()["length"]
        .as_f64()
        .unwrap();
    control
        .ask(&["tool", "set", "3", "--length", &format!("{}", length + 0.25)])
        .unwrap();
    near(read(&status()), -0.75);
    // Not that of another tool, nor one that is off.
    control.ask(&["tool", "set", "4", "--length", "11"]).unwrap();
    near(read(&status()), -0.75);
    control.ask(&["mdi", "G49"]).unwrap();
    let off = read(&status());
    control.ask(&["touch-off", "Z", "3", "--tool", "3"]).unwrap();
    near(read(&status()), off);
    assert_codes(&status(), &["G49"]);
    control.ask(&["mdi", "G43 H3"]).unwrap();
    near(read(&status()), 3.0);
}

/// From the dates of SoCs to the pins of each second and to the sums of Prometheus and `cycle.times`.
#[test]
fn the_mean_period_that_is_shown_is_that_of_the_periods_that_were() {
    const PERIOD_NS: u64 = 1_000_000;
    let file = include_str!("../configs/io-only.toml");
    let config = config::parse(file, Path::new("io-only.toml")).unwrap();
    rehearse(&config, b"", NetConfig::clean(1), |run| {
        let pin = |name: &str| run.hal.reader::<f64>(name).unwrap();
        let (mean, std) = (pin("rt.period-mean-ns"), pin("rt.period-std-ns"));
        let (mut recorder, _windows) = recorder(PERIOD_NS);
        let (mut periods, mut before_ns, mut seconds) = (Vec::new(), None, 0);
        for k in 1..=3_300_u64 {
            let deadline_ns = k * PERIOD_NS + 370_000;
            let soc_ns = deadline_ns + 1_000 + k * k * 7_919 % 90_000;
            let times = CycleTimes {
                deadline_ns,
                woke_ns: soc_ns,
                soc_ns: Some(soc_ns).filter(|_| k % 450 != 0),
                exchanged_ns: soc_ns + 60_000,
                ended_ns: soc_ns + 64_000,
                next_ns: deadline_ns + PERIOD_NS,
                skipped: u64::from(k % 700 == 0),
                pres_lost: 0,
                phase_ns: None,
            };
            let before = mean.get();
            recorder.record(&times);
            run.control.show_timing(recorder.timing());
            let period_ns = times
                .soc_ns
                .zip(before_ns)
                .map(|(now_ns, before_ns): (u64, u64)| now_ns - before_ns);
            periods.extend(period_ns.filter(|_| times.skipped == 0));
            before_ns = times.soc_ns;
            if mean.get() != before {
                seconds += 1;
                assert_eq!(periods.len(), 1000 * seconds, "cycle {k}");
                let second = &periods[periods.len() - 1000..];
                let of_second = second.iter().sum::<u64>() as f64 / 1000.0;
                assert!((mean.get() - of_second).abs() < 1e-3, "{} {of_second}", mean.get());
                let squares = second.iter().map(|ns| (*ns as f64 - of_second).powi(2));
                let of_second = (squares.sum::<f64>() / 1000.0).sqrt();
                assert!((std.get() - of_second).abs() < 1e-3, "{} {of_second}", std.get());
            }
        }
        assert_eq!(seconds, 3);
        let all = &run.operator.shared().times.period;
        assert_eq!(all.counts().sum::<u64>(), periods.len() as u64);
        let differences = periods.iter().map(|ns| *ns as i64 - PERIOD_NS as i64);
        assert_eq!(all.sum_ns(), differences.sum::<i64>());
        let whole = recorder.end().summary().period;
        let of_all = periods.iter().sum::<u64>() as f64 / periods.len() as f64 / 1000.0;
        assert_eq!(whole.n, periods.len() as u64);
        assert!((whole.mean_us - of_all).abs() < 1e-6, "{} {of_all}", whole.mean_us);
        Ok(())
    })
    .unwrap();
}
