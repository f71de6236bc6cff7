//! `isocnc bus` beside a running control: what a user types, what comes back, and that the control does not mind.
//!
//! The control is a demo over the wire in memory: no rights are needed. Nothing here looks at times.

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use testing::PATIENCE;

/// Half a minute of motion, to be stopped in its midst.
const LONG: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5 Z0\nG1 X200 F400\nG1 Y100\nM2\n";

/// A running demo.
struct Demo {
    process: Child,
    machine: String,
    _folder: TempDir,
}

impl Demo {
    fn start() -> Demo {
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("program.ngc");
        std::fs::write(&program, LONG).expect("our folder");
        let process = Command::new(env!("CARGO_BIN_EXE_isocnc"))
            .args(["demo", "--memory", "--program"])
            .arg(&program)
            .arg("--out")
            .arg(folder.path().join("out"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the binary runs");
        let machine = format!("mill3-demo-{}", process.id());
        let demo = Demo {
            process,
            machine,
            _folder: folder,
        };
        let give_up = Instant::now() + PATIENCE;
        // Exit code 1 until every node is operational.
        while !demo.bus(&["state"]).status.success() {
            assert!(Instant::now() < give_up, "{}", text(&demo.bus(&["state"])));
            sleep(Duration::from_millis(50));
        }
        demo
    }

    /// `isocnc bus ARGUMENTS --machine NAME`
    fn bus(&self, arguments: &[&str]) -> Output {
        bus(&[arguments, &["--machine", &self.machine]].concat())
    }

    fn socket(&self) -> PathBuf {
        let name = format!("isocnc-control.{}", self.machine);
        let places = hal_pins::directories().into_iter().map(|folder| folder.join(&name));
        places.into_iter().find(|path| path.exists()).expect("a socket")
    }
}

impl Drop for Demo {
    fn drop(&mut self) {
        // Gone already in the ordinary case.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn bus(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("bus")
        .args(arguments)
        .output()
        .expect("the binary runs")
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
}

#[test]
fn a_running_control_tells_of_its_network_and_lets_parameters_be_read() {
    let demo = Demo::start();
    let nodes = demo.bus(&["nodes"]);
    let said = text(&nodes);
    assert!(nodes.status.success(), "{said}");
    assert!(
        said.starts_with(&format!("{}: network OPERATIONAL on a wire in memory", demo.machine)),
        "{said}"
    );
    for node in [" 1  x-drive  is  0x00020192", "10  io       is  0x000F0191"] {
        assert!(said.contains(node), "{said}");
    }

    let report = demo.bus(&["report", "--json"]);
    let report: Value = serde_json::from_slice(&report.stdout).expect("JSON");
    assert_eq!(report["trouble"], json!([]));
    assert_eq!(report["nodes"].as_array().expect("nodes").len(), 4);
    assert_eq!(report["nodes"][2]["live"]["identity"]["serial"], 3);
    assert!(report["nodes"][2]["live"]["polls"].as_u64().expect("a number") > 0);

    let get = demo.bus(&["sdo", "get", "--node", "3", "0x1018:4", "0x1008", "0x9999"]);
    let said = text(&get);
    assert_eq!(get.status.code(), Some(1), "{said}");
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(
        lines,
        [
            "0x1018/4     4 octets  3 (0x00000003)                            identity",
            "0x1008       7 octets  \"z-drive\"                                 device name",
            "0x9999      refused: object does not exist in the object dictionary (0x06020000)",
        ]
    );
    let set = demo.bus(&["sdo", "set", "--node", "10", "0x1F9A", "panel"]);
    assert_eq!(text(&set), "0x1F9A before: \"io\"\n0x1F9A after:  \"panel\"\n");
    let unknown = demo.bus(&["sdo", "get", "--node", "9", "0x1000"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert_eq!(text(&unknown), "isocnc: no node has the id 9; nodes are 1, 2, 3, 10\n");
    let no_node = demo.bus(&["sdo", "get", "0x1000"]);
    assert_eq!(no_node.status.code(), Some(2), "{}", text(&no_node));
}

#[test]
fn the_socket_is_private_takes_any_line_and_goes_with_the_control() {
    let mut demo = Demo::start();
    let path = demo.socket();
    let mode = std::fs::symlink_metadata(&path).expect("the socket").mode();
    assert_eq!(mode & 0o777, 0o600);

    let stream = UnixStream::connect(&path).expect("the control listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
    let mut lines = BufReader::new(stream.try_clone().expect("a socket")).lines();
    let mut line = || -> Value { serde_json::from_str(&lines.next().expect("a line").expect("text")).expect("JSON") };
    (&stream)
        .write_all(b"hello\n{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"status\"}\n\x00\xFF\n{\"jsonrpc\":\"2.0\",\"id\":2,\"method\":\"jump\"}\n")
        .expect("the control reads");
    assert_eq!(line()["error"]["code"], -32700);
    assert_eq!(line()["result"]["machine"], demo.machine.as_str());
    assert_eq!(line()["error"]["code"], -32700);
    let refusal = line();
    assert_eq!((&refusal["id"], &refusal["error"]["code"]), (&json!(2), &json!(-32601)));

    // A client that is still connected keeps nobody.
    kill(Pid::from_raw(demo.process.id() as i32), Signal::SIGTERM).expect("our own child");
    let status = testing::end(&mut demo.process);
    // 143, or 1 where the PC stood still so long that there was an alarm before.
    assert!(matches!(status.code(), Some(143 | 1)), "{status}");
    assert!(!path.exists());
    let gone = demo.bus(&["nodes"]);
    assert_eq!(gone.status.code(), Some(1));
    let expected = format!(
        "isocnc: no control of machine \"{}\" is running (or it runs as another user)\n",
        demo.machine
    );
    assert_eq!(text(&gone), expected);
}

#[test]
fn the_socket_of_a_killed_control_stays_behind_and_hurts_nobody() {
    let mut demo = Demo::start();
    let path = demo.socket();
    demo.process.kill().expect("our own child");
    testing::end(&mut demo.process);
    assert!(path.exists());
    assert_eq!(demo.bus(&["nodes"]).status.code(), Some(1));
    std::fs::remove_file(&path).expect("our file");
    let pins = path.with_file_name(format!("isocnc-hal.{}", demo.machine));
    std::fs::remove_file(pins).expect("our file");
}

#[test]
fn without_a_control_the_machine_file_is_told() {
    let machine = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/mill3-powerlink.toml");
    let said = bus(&["pdo", machine]);
    assert!(said.status.success(), "{}", text(&said));
    assert!(
        text(&said)
            .lines()
            .next()
            .expect("a line")
            .contains("no control is running; this is what")
    );
    let missing = bus(&["nodes", "/nowhere.toml"]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(
        text(&missing).starts_with("error: /nowhere.toml: cannot be read: "),
        "{}",
        text(&missing)
    );
}

#[test]
fn wrong_usage_is_said_with_exit_code_2() {
    for arguments in [
        &["sdo", "get", "--node", "0", "0x1000"][..],
        &["sdo", "get", "--node", "1", "1000"],
        &["scan"],
        &["scan", "--interface", "eth0", "--listen", "0"],
        &["trace"],
        &["walk"],
    ] {
        assert_eq!(bus(arguments).status.code(), Some(2), "{arguments:?}");
    }
    for arguments in [&["scan", "--interface", "nowhere0"][..], &["trace", "/nowhere.pcap"]] {
        let output = bus(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(text(&output).contains("nowhere"), "{}", text(&output));
    }
}
