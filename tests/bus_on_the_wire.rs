//! `isocnc bus` on a real veth pair: alone on the interface, and beside a control that does not get on with a node.
//!
//! This program has no test harness, for a namespace is entered by a process of one thread. Where the system refuses private
//! networks, it prints the reason and passes. Nothing here looks at times.

use isocnc::host::netns::private_wire;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use testing::PATIENCE;

const DEMO: &str = include_str!("../configs/mill3-demo.toml");

pub(crate) fn main() {
    if let Err(refused) = private_wire("plk0", "plk1") {
        println!("bus_on_the_wire ... SKIPPED: {refused}");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let machine = folder.path().join("machine.toml");
    std::fs::write(&machine, DEMO).expect("our folder");
    let simulated = Simulated::start(&machine);
    alone_on_the_interface();
    a_machine_file_from_the_nodes_that_answer(folder.path());
    beside_a_control(folder.path());
    one_sender_of_an_interface(folder.path(), &simulated);
    drop(simulated);
    a_machine_without_anybody_to_hear_it_ends(&machine);
    println!("bus_on_the_wire ... ok");
}

/// The machine at the far end.
struct Simulated(Child);

impl Simulated {
    fn start(machine: &Path) -> Simulated {
        let mut process = Command::new(env!("CARGO_BIN_EXE_isocnc"))
            .arg("simulate")
            .arg(machine)
            .args(["--interface", "plk1"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary runs");
        let mut line = String::new();
        BufReader::new(process.stdout.take().expect("a pipe"))
            .read_line(&mut line)
            .expect("a line");
        assert_eq!(line.trim(), "ready");
        Simulated(process)
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        // Ours, and of no more use.
        let _ = self.0.kill();
        let _ = self.0.wait();
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

fn alone_on_the_interface() {
    let scan = bus(&["scan", "--interface", "plk0"]);
    let said = text(&scan);
    assert!(scan.status.success(), "{said}");
    assert!(said.starts_with("4 nodes on plk0\n"), "{said}");
    let ids: Vec<&str> = (said.lines().skip(3))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(ids, ["1", "2", "3", "10"], "{said}");

    let get = bus(&["sdo", "get", "--interface", "plk0", "--node", "3", "0x1018:4", "0x1008"]);
    let expected = "0x1018/4     4 octets  3 (0x00000003)                            identity\n\
                    0x1008       7 octets  \"z-drive\"                                 device name\n";
    assert_eq!(text(&get), expected);
    let refused = bus(&["sdo", "set", "--interface", "plk0", "--node", "3", "0x1000", "1"]);
    assert_eq!(refused.status.code(), Some(1));
    assert_eq!(
        text(&refused),
        "0x1000      refused: attempt to write a read-only object (0x06010002)\n"
    );
}

fn a_machine_file_from_the_nodes_that_answer(folder: &Path) {
    let file = folder.join("found.toml");
    let isocnc = |command: &str, options: &[&str]| {
        let mut isocnc = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        isocnc.arg(command).arg(&file).args(options).stdin(Stdio::null());
        isocnc.output().expect("the binary runs")
    };
    let init = isocnc("init", &["--scan", "plk0"]);
    assert!(init.status.success(), "{}", text(&init));
    let checked = isocnc("check", &[]);
    assert!(checked.status.success(), "{}", text(&checked));
    let written = std::fs::read_to_string(&file).expect("the file");
    for (id, name, device_type) in [(3, "z-drive", "0x00020192"), (10, "io", "0x000F0191")] {
        let node = format!("[[bus.node]]\nid = {id}\nname = \"{name}\"\n");
        let node = written
            .split_once(&node)
            .unwrap_or_else(|| panic!("no node {id}:\n{written}"))
            .1;
        let key = node.lines().find_map(|line| line.strip_prefix("device_type = "));
        assert_eq!(key, Some(device_type), "node {id}");
    }
}

/// Nobody reads its first line; or whoever started it has gone before it asked the kernel to watch him.
fn a_machine_without_anybody_to_hear_it_ends(machine: &Path) {
    let ends = |arguments: &[&str], why: &str| {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        command
            .arg("simulate")
            .arg(machine)
            .args(["--interface", "plk1"])
            .args(arguments);
        let mut process = command
            .stdout(writer)
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary runs");
        let give_up = Instant::now() + PATIENCE;
        while process.try_wait().expect("our own child").is_none() {
            if Instant::now() > give_up {
                let _ = process.kill();
            }
            sleep(Duration::from_millis(20));
        }
        let output = process.wait_with_output().expect("our own child");
        assert_eq!(output.status.code(), Some(1), "{}", text(&output));
        assert!(text(&output).contains(why), "{}", text(&output));
    };
    ends(&[], "nobody hears that the machine is ready");
    // No process of this number can be the parent.
    ends(
        &["--with-parent", "4194305"],
        "process 4194305, for which this machine was to be, has ended",
    );
}

/// Two machines at one end of the wire would both answer; one that was killed holds nothing any more.
fn one_sender_of_an_interface(folder: &Path, simulated: &Simulated) {
    let machine = folder.join("machine.toml");
    let simulate = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        command.arg("simulate").arg(&machine).args(["--interface", "plk1"]);
        command
    };
    let second = simulate().output().expect("the binary runs");
    let taken = format!("isocnc: interface plk1: process {} (", simulated.0.id());
    assert_eq!(second.status.code(), Some(1));
    assert!(text(&second).starts_with(&taken), "{}", text(&second));
    let get = bus(&["sdo", "get", "--interface", "plk1", "--node", "3", "0x1000"]);
    assert!(text(&get).starts_with(&taken), "{}", text(&get));
    let scan = bus(&["scan", "--interface", "plk0", "--listen", "0.3"]);
    assert!(scan.status.success(), "killed controls hold nothing: {}", text(&scan));
}

/// A control that expects another vendor of node 3.
fn beside_a_control(folder: &Path) {
    let line = 1 + DEMO.lines().position(|line| line == "id = 3").expect("node 3");
    let mut lines: Vec<&str> = DEMO.lines().collect();
    lines.insert(line, "vendor_id = 0x12D");
    let text_of_machine = lines
        .join("\n")
        .replace("name = \"mill3-demo\"", "name = \"wrong-vendor\"");
    let machine = folder.join("wrong-vendor.toml");
    std::fs::write(&machine, text_of_machine).expect("our folder");
    let program = folder.join("program.ngc");
    std::fs::write(&program, "G21 G90 G94 G54\nG0 X5\nM2\n").expect("our folder");
    let mut control = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("run")
        .arg(&machine)
        .arg(&program)
        .arg("--out")
        .arg(folder.join("out"))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary runs");
    let expected = "node 3 (z-drive) not operational: 0x1018/1 vendor id is 0x00000000, expected 0x0000012D";
    let place = format!("([[bus.node]] line {})", line - 1);
    let machine = machine.display().to_string();
    let give_up = Instant::now() + PATIENCE;
    let found = loop {
        let state = bus(&["state", &machine]);
        let said = text(&state);
        if said
            .lines()
            .any(|line| line.starts_with(expected) && line.ends_with(&place))
        {
            assert_eq!(state.status.code(), Some(1));
            break true;
        }
        let ended = control.try_wait().expect("our own child").is_some();
        if ended || Instant::now() > give_up {
            println!("{said}");
            break false;
        }
        sleep(Duration::from_millis(50));
    };
    // On its interface nobody else may send: no control of another name either, which would not be heard by the first one.
    let other = folder.join("other-name.toml");
    std::fs::write(&other, DEMO.replace("name = \"mill3-demo\"", "name = \"other-name\"")).expect("our folder");
    let second = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("run")
        .arg(&other)
        .output();
    let second = second.expect("the binary runs");
    let second = (
        second.status.code(),
        String::from_utf8_lossy(&second.stderr).into_owned(),
    );
    let taken = format!("isocnc: interface plk0: process {} (", control.id());
    let scan = bus(&["scan", "--interface", "plk0"]);
    let busy = "isocnc: the control of machine \"wrong-vendor\" is at work on plk0: ask it, without --interface and with \
                --machine wrong-vendor\n";
    let said = (scan.status.code(), text(&scan));
    // At the far end it is heard; whoever answers there is heard, too.
    let far = bus(&["scan", "--interface", "plk1", "--listen", "0.5"]);
    // Ours, and of no more use; the nodes stop for want of frames.
    let _ = control.kill();
    let _ = control.wait();
    assert!(found, "never told: {expected}");
    assert_eq!(said, (Some(1), busy.to_owned()));
    assert_eq!(second.0, Some(1), "{}", second.1);
    assert!(
        second.1.starts_with(&taken) && second.1.contains("nothing was sent"),
        "{}",
        second.1
    );
    assert_eq!(far.status.code(), Some(1));
    assert!(
        text(&far).starts_with("a managing node is at work on this wire ("),
        "{}",
        text(&far)
    );
    for file in ["isocnc-control.wrong-vendor", "isocnc-hal.wrong-vendor"] {
        for folder in hal_pins::directories() {
            // In one of the folders, left behind by a control that was killed.
            let _ = std::fs::remove_file(folder.join(file));
        }
    }
}
