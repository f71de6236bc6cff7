//! Programs in Structured Text of a running control, from other processes: looked at, forced, released, replaced.

use crate::common;

use common::Control;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Stdio;

const CELL: &str = "PROGRAM cell
VAR_INPUT press : BOOL; END_VAR
VAR_OUTPUT lamp : BOOL; END_VAR
VAR n : DINT; step : INT := 1; t : TON; many : ARRAY[1..1200] OF SINT; END_VAR
n := n + step;
t(IN := press, PT := T#50ms);
lamp := t.Q;
END_PROGRAM
";

fn start(folder: tempfile::TempDir, name: &str) -> Control {
    let control = Control::start_in(folder, name, Stdio::null(), |text| {
        format!("{text}[[logic]]\nfile = \"cell.st\"\nperiod_ms = 10\noverruns_stop = 0\n")
    });
    control.wait_for("the network", |status| {
        status["power"] == "off" && status["step"] == "standing_by"
    });
    control
}

fn up(name: &str) -> Control {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("cell.st"), CELL).expect("our folder");
    start(folder, name)
}

/// A variable as `watch` shows it.
fn variable(control: &Control, name: &str) -> Value {
    let shown = control
        .ask(&["logic", "watch", "--once", "--variable", name])
        .expect("a look");
    shown["variables"][0].clone()
}

fn until(what: &str, mut done: impl FnMut() -> bool) {
    let give_up = std::time::Instant::now() + common::PATIENCE;
    while !done() {
        assert!(std::time::Instant::now() < give_up, "never {what}");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

fn number(control: &Control, name: &str) -> i64 {
    let value = variable(control, name);
    value["value"]
        .as_str()
        .and_then(|text| text.parse().ok())
        .expect("a number")
}

#[test]
fn a_forced_variable_holds_is_told_everywhere_and_is_released() {
    let mut control = up("forced");
    let press = variable(&control, "press");
    let is = |key: &str| press[key].clone();
    assert_eq!(
        [is("value"), is("role"), is("line"), is("pin"), is("forced")],
        [
            json!("0"),
            json!("input"),
            json!(2),
            json!("logic.cell.press"),
            json!(false)
        ]
    );
    control.refused(
        &["logic", "force", "pres", "1"],
        "there is no variable pres; did you mean press?",
    );
    control.refused(
        &["logic", "force", "t", "1"],
        "t has 6 values: name one of them, such as t.IN",
    );
    control.refused(&["logic", "force", "press", "2"], "\"2\" is no BOOL: TRUE or FALSE");
    control.refused(
        &["logic", "watch", "--once", "cel"],
        "no program is called \"cel\"; there are cell",
    );
    assert_eq!(control.ask(&["status"]).expect("a status")["forced"], json!([]));
    // More than come in one answer.
    let all = control.ask(&["logic", "watch", "--once"]).expect("a look");
    let names: Vec<&str> = (all["variables"].as_array().into_iter().flatten())
        .filter_map(|variable| variable["name"].as_str())
        .collect();
    assert_eq!(
        (names.len(), names.first(), names.last()),
        (1210, Some(&"press"), Some(&"many[1200]"))
    );

    let said = control.ask(&["logic", "force", "press", "TRUE"]).expect("forced");
    assert_eq!(said["forced"], "press = 1");
    until("the lamp", || variable(&control, "lamp")["value"] == "1");
    // Against the pin, too, which nobody has pressed.
    assert_eq!(control.words(&["hal", "get", "logic.cell.press"]).1, "false\n");
    let told = "FORCED    press = 1 in logic cell: isocnc logic force --program cell --release press";
    assert!(control.words(&["status"]).1.contains(told));
    assert!(control.words(&["logic", "watch", "--once"]).1.contains("FORCED"));
    let doctor = std::process::Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["doctor", "--no-tests"])
        .output()
        .expect("the binary runs");
    let doctor = String::from_utf8_lossy(&doctor.stdout).into_owned();
    assert!(doctor.contains("FORCED: press = 1 in logic cell"), "{doctor}");
    control.wait_for("the journal", |status| {
        status["messages"].to_string().contains("logic cell: forced: press = 1")
    });

    control
        .ask(&["logic", "force", "--release", "press"])
        .expect("released");
    until("dark", || variable(&control, "lamp")["value"] == "0");
    control.refused(&["logic", "force", "--release", "press"], "press is not forced");
    assert_eq!(control.ask(&["status"]).expect("a status")["forced"], json!([]));

    // It ends with the control.
    control.ask(&["logic", "force", "press", "1"]).expect("forced");
    control.process.kill().expect("our child");
    testing::end(&mut control.process);
    let folder = std::mem::replace(&mut control.folder, tempfile::tempdir().expect("a folder"));
    let again = start(folder, "forced");
    assert_eq!(again.ask(&["status"]).expect("a status")["forced"], json!([]));
    assert_eq!(variable(&again, "press")["value"], "0");
}

#[test]
fn a_changed_program_takes_the_place_of_the_one_that_runs_only_at_rest() {
    let control = up("replaced");
    let write = |text: &str| std::fs::write(control.folder.path().join("cell.st"), text).expect("our folder");
    until("scans", || number(&control, "n") > 5);
    control.ask(&["logic", "force", "n", "1000000"]).expect("forced");
    until("the force", || number(&control, "n") == 1_000_000);

    write(&CELL.replace("n + step", "n - step"));
    let said = control.ask(&["logic", "reload", "cell"]).expect("replaced");
    // n, step, lamp, press, and those of the timer.
    assert!(said["carried"].as_u64().expect("a number") >= 5, "{said}");
    assert_eq!(
        control.ask(&["status"]).expect("a status")["forced"],
        json!([]),
        "what was forced belongs to the program that is gone"
    );
    until("it counts down, from where the old one was", || {
        (900_000..1_000_000).contains(&number(&control, "n"))
    });

    // One that is wrong is told with its place, and the other goes on.
    write(&CELL.replace("lamp := t.Q", "lamp := 7"));
    control.refused(&["logic", "reload"], "cell.st:7:");
    write(&CELL.replace("lamp : BOOL;", "lamp, horn : BOOL;"));
    control.refused(&["logic", "reload"], "line 3: horn is new");
    let before = number(&control, "n");
    until("it still runs", || number(&control, "n") < before);

    write(CELL);
    control.ask(&["on"]).expect("on");
    control.ask(&["home"]).expect("homed");
    control.ask(&["mdi", "G53 G1 X150 F100", "--no-wait"]).expect("begun");
    control.wait_for("motion", |status| status["state"] == "running");
    control.refused(&["logic", "reload"], "a program is only replaced while it rests");
    control.ask(&["stop"]).expect("stopped");
    control.wait_for("rest", |status| status["state"] == "ready");
    // By its file, from wherever that is named.
    let file = control.folder.path().join("cell.st");
    control
        .ask(&["logic", "reload", file.to_str().expect("UTF-8")])
        .expect("replaced");
    let before = number(&control, "n");
    until("it counts up", || number(&control, "n") > before);
}

/// A program whose RETAIN variables belong together: `twice` is two times `n` behind every scan.
const KEPT: &str = "PROGRAM cell
VAR RETAIN n : LINT; twice : LINT; END_VAR
n := n + 1;
twice := 2 * n;
END_PROGRAM
";
const KILLS: u32 = 4;

#[test]
fn retained_variables_outlast_kills_as_a_whole_and_what_was_on_the_disk_is_kept() {
    let mut folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("cell.st"), KEPT).expect("our folder");
    let kept = |folder: &Path, name: &str| -> i64 {
        // It is not there at once.
        let Ok(file) = std::fs::read(folder.join("state/logic-cell.retain")) else {
            return 0;
        };
        let kept = isocnc::machine::retain_file::parse(&file).expect("a whole file");
        let of = kept.variables.iter().find(|variable| variable.name == name);
        of.and_then(|variable| variable.value.parse().ok()).expect("a number")
    };
    // What has been on the disk.
    let mut safe = 0;
    for kill in 0..KILLS {
        let mut control = Control::start_in(folder, "retained", Stdio::null(), |text| {
            text.replace("\n[machine]\n", "\n[machine]\nstate_directory = \"state\"\n")
                + "[[logic]]\nfile = \"cell.st\"\nperiod_ms = 10\n"
        });
        control.wait_for("the socket", |_| true);
        let first = number(&control, "n");
        assert!(first >= safe, "kill {kill}: {first}, and {safe} was kept");
        let twice = number(&control, "twice");
        assert!(twice >= 2 * first && twice % 2 == 0, "kill {kill}: {first} {twice}");
        let status = control.ask(&["status"]).expect("a status");
        let warned = status["messages"].to_string();
        assert!(!warned.contains("RETAIN"), "kill {kill}: {warned}");
        until("it counts", || number(&control, "n") >= first + 50);
        safe = number(&control, "n");
        until("it is on the disk", || kept(control.folder.path(), "cell.n") >= safe);
        std::thread::sleep(std::time::Duration::from_millis(u64::from(kill) * 197));
        control.process.kill().expect("our child");
        testing::end(&mut control.process);
        folder = std::mem::replace(&mut control.folder, tempfile::tempdir().expect("a folder"));
        let [n, twice] = ["cell.n", "cell.twice"].map(|name| kept(folder.path(), name));
        assert_eq!(twice, 2 * n, "of one scan");
        assert!(n >= safe, "kill {kill}: {n} of {safe}");
    }
    assert!(safe >= 50 * i64::from(KILLS), "{safe}");
}
