//! A day on a real veth pair, with the machine in a process of its own: a part with a jog away on the way, a broken tool and a new
//! one of another length is the part of a day on which nothing happened.
//!
//! Where the tool went is found from the frames that came to the machine: they are given to another one, of whose joints every
//! place is looked at. Where the system refuses private networks the test says so and passes.

use super::common::{Control, PATIENCE, machine_file};
use super::{by_hand, done, status};
use isocnc::config;
use isocnc::host::netns::add_wire;
use isocnc::sim::SimMachine;
use nix::sys::signal::{Signal, kill};
use nix::unistd::{Pid, geteuid};
use powerlink::link::pcap::PcapReader;
use serde_json::json;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Instant;

const TEST: &str = "working_day::on_the_wire::a_day_on_the_veth_machine";
/// Set in the process that lives in a network of its own.
const INSIDE: &str = "ISOCNC_TEST_INSIDE";
const PART: &str = "G21 G90 G17 G94 G54 G64 P0.01
T1 M6
G43
M3 S1000
G0 Z5
G0 X5 Y5
G1 Z-1 F900
X40
Y25
G3 X30 Y35 I-10 J0
G1 X5
Y5
G0 Z5
M5
M2
";
/// The node on which the relays hang, and that of the spindle: output 0.
const IO: u8 = 10;
const SPINDLE: u8 = 1;
/// The line that is cut again from its beginning: Y25.
const AGAIN: &str = "9";
/// Lengths of the tool on the day without trouble, on the other one, and of the one that takes the place of the broken one.
const LENGTHS_MM: [f64; 3] = [10.0, 12.0, 15.5];
/// How far the tool may be off the other day's path: what G64 leaves to a corner, and what a drive is behind in it, twice.
const OFF_MM: f64 = 0.03;

#[test]
fn a_day_on_the_veth_machine() {
    if std::env::var_os(INSIDE).is_some() {
        a_day();
        return;
    }
    let private: &[&str] = if geteuid().is_root() { &["-n"] } else { &["-r", "-n"] };
    let unshare = |command: &[&str]| testing::command("unshare").args(private).args(command).status();
    if !unshare(&["true"]).is_ok_and(|status| status.success()) {
        println!("SKIPPED: no private network");
        return;
    }
    let this = std::env::current_exe().unwrap();
    let status = testing::command("unshare")
        .args(private)
        .arg(this)
        .args(["--exact", TEST, "--nocapture", "--test-threads=1"])
        .env(INSIDE, "1")
        .status()
        .unwrap();
    assert!(status.success());
}

/// The machine at the other end of the wire.
struct Machine(Child);

impl Machine {
    fn start(file: &Path, capture: &Path) -> Machine {
        let mut process = testing::command(env!("CARGO_BIN_EXE_isocnc"))
            .arg("simulate")
            .arg(file)
            .args(["--interface", "plk1", "--capture"])
            .arg(capture)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut said = BufReader::new(process.stdout.take().unwrap());
        said.read_line(&mut line).unwrap();
        assert_eq!(line.trim(), "ready");
        // The rest is of no interest, but there must be room for it.
        std::thread::spawn(move || std::io::copy(&mut said, &mut std::io::sink()));
        Machine(process)
    }

    /// Its capture is whole then.
    fn end(mut self) {
        kill(Pid::from_raw(self.0.id() as i32), Signal::SIGINT).unwrap();
        let give_up = Instant::now() + PATIENCE;
        while self.0.try_wait().unwrap().is_none() {
            assert!(Instant::now() < give_up, "the machine does not end");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        // Gone already where the test went well.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn a_day() {
    for note in add_wire("plk0", "plk1").unwrap() {
        println!("{note}");
    }
    let folder = tempfile::tempdir().unwrap();
    let name = format!("veth-day-{}", std::process::id());
    let text = by_hand(&machine_file(&name));
    let [file, capture] = ["machine.toml", "day.pcap"].map(|name| folder.path().join(name));
    std::fs::write(&file, &text).unwrap();
    let machine = Machine::start(&file, &capture);
    let control = Control::run(folder, name, Stdio::null());
    let origin_mm = the_day_itself(&control);
    machine.end();
    let places = places(&config::parse(&text, &file).unwrap(), &std::fs::read(&capture).unwrap());
    // While it cuts, its tip is one millimetre below the work's zero.
    let [quiet, before, after] = LENGTHS_MM.map(|length_mm| {
        let depth_mm = origin_mm + length_mm - 1.0;
        cuts(&places, depth_mm)
    });
    println!("cut: {} places, then {} and {}", quiet.len(), before.len(), after.len());
    let disturbed = [before, after].concat();
    for (found, wanted, what) in [
        (&disturbed, &quiet, "the tool cut where it did not on a quiet day"),
        (&quiet, &disturbed, "the tool did not cut where it did on a quiet day"),
    ] {
        let farthest = farthest(found, wanted);
        println!("{} mm off at {:?}", farthest.0, farthest.1);
        assert!(farthest.0 < OFF_MM, "{what}: {:?}, {} mm off", farthest.1, farthest.0);
    }
}

/// Works as a machinist does; the work's zero in Z, in the machine.
fn the_day_itself(control: &Control) -> f64 {
    let part = control.program("part.ngc", PART);
    let part = part.to_str().unwrap();
    control.wait_for("the network", |status| {
        status["power"] != "starting" && status["step"] == "standing_by"
    });
    // The emergency stop is pulled, in the morning as at night.
    control.ask(&["estop"]).unwrap();
    control.wait_for("the stop", |status| status["power"] == "estop");
    control.refused(&["on"], "isocnc estop reset");
    done(control, &["estop", "reset"], "reset; drives stay off: isocnc on");
    done(control, &["on"], "drives are on");
    done(control, &["home"], "homed; drives are on");
    control.ask(&["jog", "X", "20", "--speed", "60"]).unwrap();
    control.ask(&["jog", "Y", "15", "--speed", "60"]).unwrap();
    control.ask(&["jog", "Z", "-40", "--speed", "60"]).unwrap();
    for axis in ["X", "Y", "Z"] {
        control.ask(&["touch-off", axis, "0"]).unwrap();
    }
    let origin_mm = status(control)["position_mm"][2].as_f64().unwrap();
    control.ask(&["mdi", "G0 Z30"]).unwrap();
    let lengths = LENGTHS_MM.map(|length_mm| length_mm.to_string());
    let tool_1 = |length: &str| control.ask(&["tool", "set", "1", "--length", length]).unwrap();

    // A quiet part.
    tool_1(&lengths[0]);
    control.ask(&["program", "load", part]).unwrap();
    control.ask(&["program", "start", "--no-wait"]).unwrap();
    change_tool(control);
    completed(control);

    // The same with trouble: away to look at it, and back.
    tool_1(&lengths[1]);
    control.ask(&["program", "start", "--no-wait"]).unwrap();
    // Its tool is in the spindle: nobody is asked for it.
    at_line(control, 8);
    control.ask(&["hold"]).unwrap();
    control.ask(&["jog", "Z", "8", "--speed", "60"]).unwrap();
    control.ask(&["jog", "Y", "6", "--speed", "60"]).unwrap();
    control.wait_for("away", |status| status["activity"] == "away");
    control.ask(&["resume"]).unwrap();
    control.ask(&["resume"]).unwrap();
    // The tool breaks: another one, longer, and on from the line before.
    at_line(control, 10);
    done(control, &["stop"], "at rest, drives are on");
    control.ask(&["jog", "Z", "20", "--speed", "60"]).unwrap();
    tool_1(&lengths[2]);
    done(
        control,
        &["program", "start", "--from-line", AGAIN, "--yes"],
        "completed; drives are on",
    );
    done(control, &["off"], "at rest, drives are off");
    assert_eq!(status(control)["homed"], json!([0, 1, 2]));
    origin_mm
}

fn change_tool(control: &Control) {
    control.wait_for("the wait for a tool", |status| {
        status["waiting"]["for"] == "tool_change"
    });
    control.ask(&["tool-changed"]).unwrap();
}

fn at_line(control: &Control, line: u64) {
    control.wait_for("the line", |status| status["line"].as_u64() >= Some(line));
}

fn completed(control: &Control) {
    let ended = control.wait_for("the end", |status| {
        status["activity"] == "idle" && status["job"] != "running"
    });
    assert_eq!(ended["job"], "completed", "{ended}");
}

/// Where the joints of a machine are, mm, that hears the frames of a capture, while its spindle turns.
fn places(config: &config::Config, capture: &[u8]) -> Vec<[f64; 3]> {
    let mut machine = SimMachine::new(config).unwrap();
    let mut places = Vec::new();
    let mut begin_ns = None;
    for captured in PcapReader::new(capture).unwrap() {
        let captured = captured.unwrap();
        let now_ns = captured.stamp_ns - *begin_ns.get_or_insert(captured.stamp_ns);
        while machine.next_poll_ns() <= now_ns {
            let due_ns = machine.next_poll_ns();
            machine.poll(due_ns, &mut |_| {});
            if machine.next_poll_ns() <= due_ns {
                break;
            }
        }
        machine.receive(now_ns, captured.frame, &mut |_| {});
        let [relays, _] = machine.outputs(IO).unwrap();
        if relays & SPINDLE == 0 {
            continue;
        }
        let place = [0, 1, 2].map(|joint| machine.joint_position_mm(joint).unwrap());
        if places.last() != Some(&place) {
            places.push(place);
        }
    }
    places
}

/// Where in the plane the tool is while it is at this depth.
fn cuts(places: &[[f64; 3]], depth_mm: f64) -> Vec<[f64; 2]> {
    let deep = places.iter().filter(|place| (place[2] - depth_mm).abs() < 0.01);
    deep.map(|place| [place[0], place[1]]).collect()
}

/// The place of `found` that is the farthest from all of `wanted`, and how far, mm.
fn farthest(found: &[[f64; 2]], wanted: &[[f64; 2]]) -> (f64, [f64; 2]) {
    let near = |from: &[f64; 2], at: &[f64; 2]| (from[0] - at[0]).hypot(from[1] - at[1]);
    let far = found.iter().map(|place| {
        let nearest = wanted
            .iter()
            .map(|other| near(place, other))
            .fold(f64::INFINITY, f64::min);
        (nearest, *place)
    });
    far.fold((0.0, [0.0; 2]), |most, next| if next.0 > most.0 { next } else { most })
}
