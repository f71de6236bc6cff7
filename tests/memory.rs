//! Memory of the control: all of it is locked, so it is bounded, however long a program is; and of a plan.
//!
//! Measured is the process of the control, which has its simulated machine in it as well: a demo over the wire in memory, and
//! the same with the real-time threads.

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// What the control may take beside the program and its libraries, which are larger the less a build is optimised, KiB: heap, stacks, and
/// the memory that it shares. After a minute of the long program it is 41 MiB.
const MEMORY_MAX_KIB: u64 = 44 * 1024;

/// The greatest of that in a process until its end, KiB.
fn greatest_memory(process: &mut Child) -> u64 {
    let mut greatest = 0;
    while process.try_wait().expect("it is ours").is_none() {
        // One that has just ended has no memory any more.
        let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap_or_default();
        let kib = |key: &str| -> u64 {
            let line = status.lines().find_map(|line| line.strip_prefix(key));
            let kib = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
            kib.unwrap_or(0)
        };
        greatest = greatest.max(kib("RssAnon:") + kib("RssShmem:"));
        std::thread::sleep(Duration::from_millis(5));
    }
    greatest
}

/// A folder with the machine and a program.
fn folder(program: &str) -> TempDir {
    let folder = TempDir::new().expect("a folder");
    let name = format!("name = \"memory-{}\"", std::process::id());
    let machine = include_str!("../configs/mill3-demo.toml")
        .replacen("name = \"mill3-demo\"", &name, 1)
        .replacen("kind = \"powerlink\"", "kind = \"memory\"", 1);
    std::fs::write(folder.path().join("machine.toml"), machine).expect("our folder");
    std::fs::write(folder.path().join("part.ngc"), program).expect("our folder");
    folder
}

/// Starts `isocnc COMMAND` in a folder; with what it prints, or without.
fn start(command: &[&str], folder: &Path, stdout: Stdio) -> Child {
    testing::command(env!("CARGO_BIN_EXE_isocnc"))
        .args(command)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(stdout)
        .spawn()
        .expect("isocnc")
}

fn assert_bounded(command: &[&str], process: &mut Child) {
    let kib = greatest_memory(process);
    eprintln!("{command:?}: {kib} KiB");
    assert!(
        (1..=MEMORY_MAX_KIB).contains(&kib),
        "{command:?}: {kib} KiB, at most {MEMORY_MAX_KIB}"
    );
}

/// Runs `isocnc COMMAND` on the short part; the report it wrote.
fn report_of(command: &[&str]) -> String {
    let out = folder(include_str!("../configs/short-part.ngc"));
    let command = [command, &["--out", "."]].concat();
    assert_bounded(&command, &mut start(&command, out.path(), Stdio::null()));
    std::fs::read_to_string(out.path().join("run.json")).expect("a report")
}

/// Three hundred thousand lines of a tenth of a millimetre, around and around: more than an hour of motion.
fn long_program() -> String {
    let mut text = String::from("G21 G90 G64 P0.01 F3000\nG0 X60 Y50 Z0\n");
    for k in 0..300_000 {
        let turn = f64::from(k) * 0.01;
        let radius = 10.0 + 2.0 * (turn * 0.13).sin();
        let (x, y) = (50.0 + radius * turn.cos(), 50.0 + radius * turn.sin());
        writeln!(text, "G1 X{x:.4} Y{y:.4}").expect("memory");
    }
    text.push_str("M2\n");
    text
}

#[test]
fn the_control_takes_no_more_than_44_mib_from_its_start_to_its_report() {
    let report = report_of(&["demo", "--memory", "--machine", "machine.toml", "--program", "part.ngc"]);
    assert!(report.contains("\"result\": \"completed\""), "{report}");
    // Whether a PC without real time brings this one to its end is not asked.
    report_of(&["run", "machine.toml", "part.ngc"]);
}

#[test]
fn a_plan_takes_no_more_than_44_mib_however_long_the_program_is() {
    let folder = folder(&long_program());
    for planner in ["optimal", "classic"] {
        let command = ["plan", "machine.toml", "part.ngc", "--planner", planner];
        let mut process = start(&command, folder.path(), Stdio::null());
        assert_bounded(&command, &mut process);
        assert!(testing::end(&mut process).success(), "{planner}");
    }
}

#[test]
fn a_run_takes_no_more_than_44_mib_however_long_the_program_is() {
    let folder = folder(&long_program());
    let command = [
        "demo",
        "--memory",
        "--machine",
        "machine.toml",
        "--program",
        "part.ngc",
        "--out",
        ".",
    ];
    let mut process = start(&command, folder.path(), Stdio::piped());
    let output = BufReader::new(process.stdout.take().expect("a pipe"));
    let pid = Pid::from_raw(process.id() as i32);
    // Stopped once the machine cuts: as much is planned ahead of it as ever will be.
    let reader = std::thread::spawn(move || {
        for line in output.lines().map_while(Result::ok) {
            let words: Vec<&str> = line.split_whitespace().collect();
            if let ["line", number, "of", ..] = words[..]
                && number.parse::<u32>().is_ok_and(|number| number > 1000)
            {
                let _ = kill(pid, Signal::SIGINT);
            }
        }
    });
    assert_bounded(&command, &mut process);
    reader.join().expect("it reads");
    let report = std::fs::read_to_string(folder.path().join("run.json")).expect("a report");
    assert!(
        report.contains("\"result\": \"stopped\"") && report.contains("\"command_max_mm\""),
        "{report}"
    );
}
