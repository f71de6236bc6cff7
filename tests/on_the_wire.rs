//! The binary runs whole programs on a real veth pair, as a user would run it: results, files, signals, failures.
//!
//! Where the system refuses private networks the tests say so and pass. They run one at a time: a machine's name belongs
//! to one control only. Nothing here looks at times: the PC may be busy.

use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::Pid;
use serde_json::Value;
use std::fs::read_to_string;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use testing::PATIENCE;

/// What the demo says where it falls back to the wire in memory: without a private network, and on a busy PC.
const NO_NETWORK: &str = "over a wire in memory";
/// Runs of a program on a PC that may stand still for longer than lost polls are ridden out.
const ATTEMPTS: u32 = 4;
const NOBODY: u32 = 65_534;

/// About 1.5 s of motion.
const SHORT: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5 Z0\nG1 X15 F3000\nG3 X20 Y10 J5\nG1 Y20\nG0 Z5\nM2\n";
/// Half a minute of motion, to be stopped in its midst.
const LONG: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5 Z0\nG1 X200 F400\nG1 Y100\nM2\n";

static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    // A test that failed leaves nothing behind that matters to the others.
    ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A folder that every user may enter and write.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o777)).expect("our folder");
    folder
}

/// A running demo.
struct Demo {
    process: Child,
    out: PathBuf,
    lines: Receiver<String>,
    said: Vec<String>,
    errors: Option<JoinHandle<String>>,
}

/// How a demo ended.
struct Ended {
    status: ExitStatus,
    said: Vec<String>,
    errors: String,
    out: PathBuf,
}

impl Demo {
    fn start(binary: &Path, folder: &Path, program: &str, arguments: &[&str], user: Option<u32>) -> Demo {
        let path = folder.join("program.ngc");
        std::fs::write(&path, program).expect("our folder");
        let out = folder.join("out");
        let mut command = testing::command(binary);
        command.arg("demo").arg("--program").arg(&path).arg("--out").arg(&out);
        command.args(arguments).current_dir("/").stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        // As a shell starts it: a signal from the terminal then reaches all that it has started, too.
        command.process_group(0);
        if let Some(id) = user {
            command.uid(id).gid(id);
        }
        let mut process = command.spawn().expect("the binary runs");
        let stdout = BufReader::new(process.stdout.take().expect("a pipe"));
        let mut stderr = process.stderr.take().expect("a pipe");
        let (sender, lines) = channel();
        spawn(move || {
            stdout
                .lines()
                .map_while(Result::ok)
                .try_for_each(|line| sender.send(line))
        });
        let errors = spawn(move || {
            let mut text = String::new();
            // What came before an error is what there is to show.
            let _ = stderr.read_to_string(&mut text);
            text
        });
        Demo {
            process,
            out,
            lines,
            said: Vec::new(),
            errors: Some(errors),
        }
    }

    /// Waits for a line that contains `text`; false if the output ended before.
    fn wait_for(&mut self, text: &str) -> bool {
        loop {
            match self.lines.recv_timeout(PATIENCE) {
                Ok(line) => {
                    let found = line.contains(text);
                    self.said.push(line);
                    if found {
                        return true;
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return false,
                Err(RecvTimeoutError::Timeout) => panic!("never said {text:?} but\n{}", self.said.join("\n")),
            }
        }
    }

    fn signal(&self, signal: Signal) {
        killpg(Pid::from_raw(self.process.id() as i32), signal).expect("our own child");
    }

    fn end(mut self) -> Ended {
        let give_up = Instant::now() + PATIENCE;
        let status = loop {
            if let Some(status) = self.process.try_wait().expect("our own child") {
                break status;
            }
            assert!(Instant::now() < give_up, "hangs after\n{}", self.said.join("\n"));
            sleep(Duration::from_millis(20));
        };
        self.said.extend(self.lines.iter());
        let errors = self
            .errors
            .take()
            .map_or_else(String::new, |thread| thread.join().expect("no panic"));
        let ended = Ended {
            status,
            said: std::mem::take(&mut self.said),
            errors,
            out: self.out.clone(),
        };
        println!("{}\n{}{}", ended.said.join("\n"), ended.errors, ended.status);
        ended
    }

    /// The simulated machine: the process that this demo has started.
    fn machine(&self) -> Option<Pid> {
        let parent = self.process.id().to_string();
        let processes = std::fs::read_dir("/proc").ok()?.flatten();
        processes
            .filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok())
            .find(|id| {
                let stat = read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
                let behind_name = stat.rsplit_once(") ").map_or("", |(_, rest)| rest);
                behind_name.split(' ').nth(1) == Some(parent.as_str())
            })
            .map(Pid::from_raw)
    }
}

impl Drop for Demo {
    fn drop(&mut self) {
        // Ended already, but for a test that failed.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Ended {
    fn without_network(&self) -> bool {
        let without = self.errors.contains(NO_NETWORK);
        if without {
            println!("SKIPPED: {}", self.errors.trim());
        }
        without
    }

    fn report(&self) -> Value {
        let text = read_to_string(self.out.join("run.json")).expect("run.json is written");
        serde_json::from_str(&text).expect("run.json is JSON")
    }

    fn picture(&self, name: &str) {
        let text = read_to_string(self.out.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(
            text.contains("<svg ") && text.trim_end().ends_with("</svg>"),
            "{name} is no SVG"
        );
        assert_eq!(text.matches("<text").count(), text.matches("</text>").count(), "{name}");
    }

    fn causes(&self) -> Vec<String> {
        let report = self.report();
        let alarms = report["alarms"].as_array().expect("a list").iter();
        alarms
            .map(|alarm| alarm["cause"].as_str().expect("text").to_owned())
            .collect()
    }
}

fn binary() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_isocnc"))
}

/// Runs a demo, with `act` while the program moves the machine; again if the PC itself stood still for so long that it
/// never came to that.
fn demo_once(program: &str, arguments: &[&str], mut act: impl FnMut(&mut Demo)) -> (TempDir, Ended) {
    for attempt in 1.. {
        let folder = folder();
        let mut demo = Demo::start(binary(), folder.path(), program, arguments, None);
        let runs = demo.wait_for("machine running");
        if runs {
            act(&mut demo);
        }
        let ended = demo.end();
        if runs || arguments.contains(&"--json") || attempt == ATTEMPTS {
            return (folder, ended);
        }
        println!("ONCE MORE: it never ran: {:?}", ended.causes());
    }
    unreachable!("the last attempt returns")
}

/// The same for a run that shall end without an alarm: again if the PC itself stood still for so long that there was one.
fn demo(program: &str, arguments: &[&str], mut act: impl FnMut(&mut Demo)) -> (TempDir, Ended) {
    for _ in 1..ATTEMPTS {
        let (folder, ended) = demo_once(program, arguments, &mut act);
        if ended.causes().is_empty() {
            return (folder, ended);
        }
        println!("ONCE MORE: the PC was too busy: {:?}", ended.causes());
    }
    demo_once(program, arguments, act)
}

/// Everything that a completed run promises.
fn assert_completed(ended: &Ended) {
    let report = ended.report();
    assert_eq!(ended.status.code(), Some(0), "{report:#}");
    assert_eq!(report["result"], "completed");
    assert_eq!(report["alarms"], Value::Array(Vec::new()));
    for peaks in report["peaks"].as_array().expect("a list") {
        assert_eq!(peaks["over"], 0, "{peaks}");
    }
    let deviation = &report["deviation"];
    let (off_mm, tolerance_mm) = (&deviation["command_max_mm"], &deviation["tolerance_mm"]);
    assert!(
        off_mm.as_f64().expect("mm") <= tolerance_mm.as_f64().expect("mm") + 1e-9,
        "{deviation}"
    );
    for node in report["nodes"].as_array().expect("a list") {
        assert!(node["answers"].as_u64().expect("a count") > 1000, "{node}");
    }
    ended.picture("toolpath.svg");
}

#[test]
fn a_program_runs_to_its_end_over_the_wire() {
    let _alone = alone();
    let (_folder, ended) = demo(SHORT, &["--json"], |_| {});
    assert_completed(&ended);
    // The report on the output is the one in the file.
    let said: Value = serde_json::from_str(&ended.said.join("\n")).expect("JSON and nothing else");
    assert_eq!(said, ended.report());
    if ended.without_network() {
        return;
    }
    assert!(
        said["soc_period"]["n"].as_u64().expect("measured at the far end") > 1000,
        "{said:#}"
    );
    assert_eq!(said["soc_period"]["frames"]["foreign"], 0);
    ended.picture("soc-period.svg");
}

#[test]
fn a_program_runs_to_its_end_in_memory() {
    let _alone = alone();
    let (_folder, ended) = demo(SHORT, &["--memory"], |_| {});
    assert_completed(&ended);
    assert_eq!(ended.report()["soc_period"], Value::Null);
}

#[test]
fn signals_stop_the_program_in_order() {
    let _alone = alone();
    for (signal, code) in [(Signal::SIGINT, 130), (Signal::SIGTERM, 143)] {
        let (_folder, ended) = demo(LONG, &[], |demo| {
            sleep(Duration::from_millis(500));
            demo.signal(signal);
        });
        assert_eq!(ended.status.code(), Some(code), "{signal}");
        let report = ended.report();
        assert_eq!(report["result"], "stopped");
        assert_eq!(report["alarms"], Value::Array(Vec::new()));
        let journal: Vec<&str> = report["journal"]
            .as_array()
            .expect("a list")
            .iter()
            .filter_map(|entry| entry["text"].as_str())
            .collect();
        let place = |text: &str| journal.iter().position(|entry| *entry == text).expect(text);
        assert!(place("machine running") < place("machine stopping"));
        assert!(place("machine stopping") < place("machine disabling"));
        assert!(place("machine disabling") < place("network down"));
        ended.picture("toolpath.svg");
        if !ended.without_network() {
            ended.picture("soc-period.svg");
        }
    }
}

/// The machine file chooses libpnet: the whole control, boot to switching off, on that link.
#[test]
fn a_program_runs_to_its_end_over_libpnet() {
    let _alone = alone();
    let folder = folder();
    let machine = folder.path().join("pnet.toml");
    let demo_file = include_str!("../configs/mill3-demo.toml");
    let text = demo_file.replace("interface = \"plk0\"", "interface = \"plk0\"\nlink = \"pnet\"");
    assert_ne!(text, demo_file);
    std::fs::write(&machine, text).expect("our folder");
    let (_folder, ended) = demo(SHORT, &["--machine", machine.to_str().expect("a path")], |_| {});
    assert_completed(&ended);
    if !ended.without_network() {
        let warning = "warning: plk0: each frame passes libpnet";
        assert!(ended.errors.contains(warning), "{}", ended.errors);
    }
}

#[test]
fn a_signal_during_boot_ends_the_demo_in_order() {
    let _alone = alone();
    let folder = folder();
    let mut demo = Demo::start(binary(), folder.path(), LONG, &[], None);
    if demo.wait_for("network booting") {
        demo.signal(Signal::SIGINT);
    }
    let ended = demo.end();
    assert_eq!(ended.status.code(), Some(130));
    assert_eq!(ended.report()["result"], "stopped");
}

#[test]
fn a_reader_that_goes_away_stops_nothing() {
    let _alone = alone();
    let folder = folder();
    let (program, out) = (folder.path().join("program.ngc"), folder.path().join("out"));
    std::fs::write(&program, SHORT).expect("our folder");
    let mut process = testing::command(binary())
        .arg("demo")
        .arg("--program")
        .arg(&program)
        .arg("--out")
        .arg(&out)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary runs");
    // As `isocnc demo | head` does: nobody reads any more.
    drop(process.stdout.take());
    testing::end(&mut process);
    let report: Value = serde_json::from_str(&read_to_string(out.join("run.json")).expect("the report")).expect("JSON");
    assert!(report["alarms"].as_array().is_some(), "{report:#}");
}

#[test]
fn a_machine_that_dies_stops_the_control_with_an_alarm() {
    let _alone = alone();
    let (_folder, ended) = demo_once(LONG, &[], |demo| {
        sleep(Duration::from_millis(500));
        match demo.machine() {
            Some(machine) => kill(machine, Signal::SIGKILL).expect("a child of our child"),
            // The wire in memory: there is no such process, and nothing to be killed.
            None => demo.signal(Signal::SIGTERM),
        }
    });
    if ended.without_network() {
        return;
    }
    assert_eq!(ended.status.code(), Some(1));
    assert_eq!(ended.report()["result"], "faulted");
    let causes = ended.causes();
    assert!(causes[0].contains("(node ") && causes[0].contains("lost"), "{causes:?}");
    ended.picture("toolpath.svg");
}

#[test]
fn another_process_sees_the_pins_and_stops_the_program() {
    let _alone = alone();
    let (_folder, ended) = demo(LONG, &[], |demo| {
        let machine = format!("mill3-demo-{}", demo.process.id());
        let hal = |arguments: &[&str]| {
            let output = testing::command(binary())
                .arg("hal")
                .args(arguments)
                .args(["--machine", &machine, "--json"])
                .output()
                .expect("the binary runs");
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            serde_json::from_slice::<Value>(&output.stdout).expect("JSON")
        };
        let list = hal(&["list"]);
        let pins = list.as_array().expect("a list");
        for name in [
            "joint.0.motor-pos-cmd",
            "joint.2.motor-pos-fb",
            "cia402.1.statusword",
            "plk.10.state",
            "rt.cycles",
        ] {
            assert!(pins.iter().any(|pin| pin["name"] == name), "no {name} in {list:#}");
        }
        let enabled = hal(&["get", "joint.0.amp-enabled"]);
        assert!(enabled.to_string().contains("true"), "{enabled}");
        hal(&["set", "halui.program.stop", "true"]);
    });
    // Stopped as ordered, yet not done.
    assert_eq!(ended.status.code(), Some(1));
    let report = ended.report();
    assert_eq!(report["result"], "stopped");
    assert_eq!(report["alarms"], Value::Array(Vec::new()));
}

#[test]
fn a_wrong_program_is_refused_before_anything_moves() {
    let _alone = alone();
    let folder = folder();
    let ended = Demo::start(
        binary(),
        folder.path(),
        "G21\nG1 X1 F100\nG777\nM2\n",
        &["--memory"],
        None,
    )
    .end();
    assert_eq!(ended.status.code(), Some(1));
    assert!(
        ended.errors.contains("program.ngc:3") && ended.errors.contains("G777"),
        "{}",
        ended.errors
    );
    assert!(ended.errors.contains("nothing was moved"), "{}", ended.errors);
}

#[test]
fn an_ordinary_user_runs_the_same_or_is_told_what_is_missing() {
    let _alone = alone();
    if !nix::unistd::geteuid().is_root() {
        println!("SKIPPED: only root can become another user, and this test runs as an ordinary one already");
        return;
    }
    let folder = folder();
    let copy = folder.path().join("isocnc");
    std::fs::copy(binary(), &copy).expect("our folder");
    std::fs::set_permissions(&copy, PermissionsExt::from_mode(0o755)).expect("our file");
    let ended = Demo::start(&copy, folder.path(), SHORT, &[], Some(NOBODY)).end();
    // Without real time the drives may be lost to a busy PC; then the alarm says so, and the warning why.
    if ended.status.code() == Some(0) {
        assert_completed(&ended);
    } else {
        assert_eq!(ended.status.code(), Some(1), "{}", ended.errors);
        assert!(!ended.causes().is_empty());
        assert!(ended.errors.contains("warning: "), "{}", ended.errors);
    }
}
