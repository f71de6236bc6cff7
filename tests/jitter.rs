//! `isocnc jitter` as a user runs it: rounds on a private wire, counts, files, a signal in its midst, refusals.
//!
//! Where the system refuses private networks the tests say so and pass. Counts are compared, never times: the PC may be busy.

use crate::toy_machine;

use isocnc::jitter::report::{Ended, JitterReport, Round};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// What the command says where namespaces are not allowed.
const NO_WIRE: &str = "no private wire";
/// Runs on a PC that may stand still for longer than lost polls are ridden out.
const ATTEMPTS: u32 = 4;
const NOBODY: u32 = 65_534;
const ROUNDS: usize = 2;
const CYCLES: u64 = 4_000;
/// Cycles by which windows of the control and the analyser may differ: both are begun and ended by ordinary threads.
const EDGES: u64 = 700;

/// Less than a second of motion that begins and ends where the machine stands after homing.
const SHORT: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X-20 Y-20 Z60\nG1 X-15 F3000\nG3 X-10 Y-15 J5\nG0 X-20 Y-20\nM2\n";

/// A folder that every user may enter and write.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o777)).expect("our folder");
    folder
}

fn binary() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_isocnc"))
}

fn command(binary: &Path, arguments: &[&str]) -> Command {
    let mut command = testing::command(binary);
    command
        .arg("jitter")
        .args(arguments)
        .current_dir("/")
        .stdin(Stdio::null());
    command
}

fn said(output: &Output) -> String {
    let text = |octets| String::from_utf8_lossy(octets).into_owned();
    format!("{}{}", text(&output.stdout), text(&output.stderr))
}

fn report(out: &Path) -> JitterReport {
    let text = std::fs::read_to_string(out.join("jitter.json")).expect("jitter.json is written");
    serde_json::from_str(&text).expect("the report can be read back")
}

/// Two rounds of a short program, on the machine of this file; `None`: refused, and the reason was printed.
fn measure(user: Option<u32>, machine: Option<&str>) -> Option<(TempDir, PathBuf, JitterReport)> {
    for attempt in 1.. {
        let folder = folder();
        let (program, out) = (folder.path().join("short.ngc"), folder.path().join("out"));
        std::fs::write(&program, SHORT).expect("our folder");
        // Where other users may not look into the folders of this one, they need a copy.
        let copy = folder.path().join("isocnc");
        std::fs::copy(binary(), &copy).expect("our folder");
        let mut command = command(
            &copy,
            &["--rounds", &ROUNDS.to_string(), "--cycles", &CYCLES.to_string()],
        );
        command.arg("--program").arg(&program).arg("--out").arg(&out);
        if let Some(text) = machine {
            let file = folder.path().join("machine.toml");
            std::fs::write(&file, text).expect("our folder");
            command.arg("--machine").arg(file);
        }
        if let Some(id) = user {
            command.uid(id).gid(id);
        }
        let output = match command.output() {
            Ok(output) => output,
            Err(cause) => {
                println!("SKIPPED: this program cannot run so: {cause}");
                return None;
            }
        };
        let said = said(&output);
        if said.contains(NO_WIRE) {
            println!("SKIPPED: {said}");
            return None;
        }
        let measured = output.status.code() == Some(0);
        if measured && report(&out).result == Ended::Completed {
            return Some((folder, out.clone(), report(&out)));
        }
        assert!(attempt < ATTEMPTS, "{}\n{said}", output.status);
        println!("ONCE MORE: the PC was too busy: {said}");
    }
    unreachable!("the last attempt returns")
}

fn check_round(round: &Round) {
    let control = &round.control;
    let wanted = CYCLES / ROUNDS as u64;
    assert!(
        (wanted..wanted + EDGES).contains(&control.cycles),
        "{} cycles",
        control.cycles
    );
    assert!(
        control.programs >= 2,
        "the short program was begun {} times",
        control.programs
    );
    assert_eq!(control.lateness.figures.n, control.cycles, "each cycle has a SoC");
    assert_eq!(control.exchange.n, control.cycles);
    assert!(control.timeout_thread.ticks > control.cycles);
    assert_eq!(control.faults, [] as [String; 0]);

    let soc = round.soc_period.as_ref().expect("an analyser at the far end");
    assert_eq!(soc.frames.soc, soc.n + 1, "each SoC but the first ends a period");
    assert_eq!((soc.frames.foreign, soc.frames_dropped, soc.breaks.restarts), (0, 0, 0));
    assert_eq!(soc.histogram.iter().map(|bucket| bucket.count).sum::<u64>(), soc.n);
    let dates = control.cycles + control.overruns;
    assert!(
        dates.abs_diff(soc.n + soc.breaks.soc_missing) < EDGES,
        "{dates} dates, {} periods",
        soc.n
    );

    let floor = &round.floor;
    assert_eq!(floor.wakeup.as_ref().expect("our own probe").figures.n, wanted);
    assert!(floor.gaps.as_ref().expect("a scan").scanned_s > 0.0);
    assert!(round.over_wakeup.is_some());
    match &floor.cyclictest {
        Some(cyclictest) => assert!(cyclictest.latency.figures.n > 0 && round.over_cyclictest.is_some()),
        None => println!("without cyclictest: {:?}", floor.notes),
    }
}

fn check_measurement(out: &Path, report: &JitterReport) {
    assert_eq!((report.rounds.len(), report.settings.cycles), (ROUNDS, CYCLES));
    assert_eq!(
        (report.settings.rounds, report.settings.cycle_us),
        (ROUNDS as u32, 1000)
    );
    assert_eq!(
        report.rounds.iter().map(|round| round.number).collect::<Vec<_>>(),
        [1, 2]
    );
    report.rounds.iter().for_each(check_round);
    let periods = report
        .rounds
        .iter()
        .filter_map(|round| Some(round.soc_period.as_ref()?.n))
        .sum::<u64>();
    assert_eq!(report.all.soc_period.figures.n, periods);
    assert_eq!(report.medians.rounds, 2);
    assert!(report.medians.over_wakeup.is_some());
    assert!(!report.pc.kernel.trim().is_empty() && report.pc.cores > 0);
    for name in ["machine.toml", "jitter-histogram.csv", "jitter.svg"] {
        let octets = std::fs::metadata(out.join(name))
            .unwrap_or_else(|error| panic!("{name}: {error}"))
            .len();
        assert!(octets > 500, "{name}: {octets} octets");
    }
}

#[test]
fn two_rounds_on_a_private_wire() {
    if let Some((_folder, out, report)) = measure(None, None) {
        check_measurement(&out, &report);
    }
}

#[test]
fn two_rounds_as_an_ordinary_user() {
    if !nix::unistd::geteuid().is_root() {
        println!("SKIPPED: two_rounds_on_a_private_wire runs as an ordinary user already");
        return;
    }
    if let Some((_folder, out, report)) = measure(Some(NOBODY), None) {
        check_measurement(&out, &report);
        assert!(!report.pc.findings.is_empty(), "what is missing is in the report");
    }
}

#[test]
fn two_rounds_on_the_toy_bus() {
    if let Some((_folder, _, report)) = measure(None, Some(&toy_machine::text())) {
        assert_eq!(report.settings.protocol, "toy");
        report.rounds.iter().for_each(check_round);
    }
}

/// A measurement that would take hours, sent a signal once it has said a line that ends so; `None`: refused, and the reason
/// was printed.
fn interrupted_after(line_end: &str) -> Option<(TempDir, PathBuf, Output)> {
    let folder = folder();
    let out = folder.path().join("out");
    let mut command = command(binary(), &["--rounds", "2", "--cycles", "20000000"]);
    command
        .arg("--out")
        .arg(&out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    // As a shell starts it: a signal from the terminal reaches all that it has started, too.
    let mut process = command.process_group(0).spawn().expect("the binary runs");
    let lines = BufReader::new(process.stdout.take().expect("a pipe")).lines();
    let mut lines = lines.map_while(Result::ok);
    if lines.any(|line| line.contains(line_end)) {
        nix::sys::signal::killpg(Pid::from_raw(process.id() as i32), Signal::SIGINT).expect("our own child");
    }
    // What it says behind that must not fill the pipe.
    lines.for_each(drop);
    let output = process.wait_with_output().expect("our own child");
    let said = said(&output);
    if said.contains(NO_WIRE) {
        println!("SKIPPED: {said}");
        return None;
    }
    Some((folder, out, output))
}

#[test]
fn ctrl_c_keeps_what_was_measured() {
    // The line comes with the first cycles that count.
    let Some((_folder, out, output)) = interrupted_after(" of 2: program") else {
        return;
    };
    assert_eq!(output.status.code(), Some(130), "{}", said(&output));
    let report = report(&out);
    assert_eq!((report.result, report.rounds.len()), (Ended::Cut, 1));
    let round = &report.rounds[0];
    assert!(round.control.cycles > 0);
    assert!(round.soc_period.is_some(), "an analyser at the far end");
    assert!(round.floor.wakeup.is_none(), "nothing was begun after the signal");
}

#[test]
fn ctrl_c_before_anything_was_measured_says_so() {
    // While the network boots: the program cannot have begun.
    let Some((_folder, out, output)) = interrupted_after("calibration: ") else {
        return;
    };
    let said = said(&output);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(
        said.contains("nothing was measured: ") && said.contains("a signal came before"),
        "{said}"
    );
    assert!(!out.join("jitter.json").exists());
}

#[test]
fn what_cannot_be_measured_is_refused_with_a_reason() {
    let folder = folder();
    let out = folder.path().display().to_string();
    for (arguments, code, reason) in [
        (&["--cycles", "0"][..], 2, "0 is not in 1.."),
        (&["--rounds", "0"], 2, "0 is not in 1..=1000"),
        (&["--listen"], 2, "--interface"),
        (
            &["--listen", "--interface", "plk0", "--program", "x.ngc"],
            2,
            "--program",
        ),
        (&["--interface", "lo"], 1, "say which it is with --machine"),
        (&["--period-us", "100"], 1, "cycle_us = 100"),
        (&["--program", "/no/such.ngc"], 1, "/no/such.ngc"),
        (&["--machine", "/no/such.toml"], 1, "/no/such.toml"),
    ] {
        let output = command(binary(), arguments)
            .args(["--out", &out])
            .output()
            .expect("the binary runs");
        let said = said(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(reason), "{arguments:?}: {said}");
    }
}

#[test]
fn nothing_is_left_behind_when_the_command_is_killed() {
    let folder = folder();
    let mut command = command(binary(), &["--out"]);
    command.arg(folder.path()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut process = command.spawn().expect("the binary runs");
    let mut errors = process.stderr.take().expect("a pipe");
    // Long enough on most PCs that the helpers run; where it is not, there is nothing to be left behind.
    std::thread::sleep(Duration::from_secs(2));
    kill(Pid::from_raw(process.id() as i32), Signal::SIGKILL).expect("our own child");
    testing::end(&mut process);
    // The pipe is closed once the last process that has it is gone.
    let mut said = String::new();
    errors.read_to_string(&mut said).expect("text");
}
