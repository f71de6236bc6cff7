//! `isocnc hal scope` as a user runs it, beside a control that is only its pins.

use hal_pins::scope::Sampler;
use hal_pins::{Hal, Output};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::process::{Child, Stdio};
use std::time::Duration;

struct Control {
    name: String,
    count: Output<u32>,
    sampler: Sampler,
    cycles: u32,
    _hal: Hal,
}

fn control(of: &str) -> Control {
    let name = format!("scope-{of}-{}", std::process::id());
    let mut hal = Hal::create(&name, 8).expect("pins");
    let count = hal.output("a.count").expect("a pin");
    let sampler = Sampler::new(&hal, 1_000_000).expect("an oscilloscope");
    Control {
        name,
        count,
        sampler,
        cycles: 0,
        _hal: hal,
    }
}

impl Control {
    fn cycles(&mut self, count: u32) {
        for _ in 0..count {
            self.count.set(self.cycles);
            self.sampler.sample(u64::from(self.cycles) * 1_000_000);
            self.cycles += 1;
        }
    }

    fn scope(&self, args: &[&str]) -> Child {
        let mut command = testing::command(env!("CARGO_BIN_EXE_isocnc"));
        command.args(["hal", "scope", "--machine", &self.name]).args(args);
        let command = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        command.spawn().expect("isocnc")
    }
}

/// Greatest resident memory so far, KiB.
fn greatest_kib(process: &Child) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok())
        .unwrap_or(0)
}

fn number_before(text: &str, word: &str) -> u64 {
    let (before, _) = text.split_once(word).unwrap_or_else(|| panic!("no {word}: {text}"));
    let number = before.rsplit(' ').next().and_then(|number| number.parse().ok());
    number.unwrap_or_else(|| panic!("no number before {word}: {text}"))
}

/// Two hours at 1 ms, at the speed of this PC.
#[test]
fn hours_of_recording_take_constant_memory_and_ctrl_c_ends_them() {
    const CYCLES: u32 = 7_200_000;
    let folder = tempfile::tempdir().expect("a folder");
    let svg = folder.path().join("hours.svg");
    let mut control = control("hours");
    let process = control.scope(&["a.count", "--csv", "/dev/null", "--svg", svg.to_str().expect("text")]);
    // It has begun once it takes cycles.
    std::thread::sleep(Duration::from_millis(500));
    let mut early_kib = 0;
    while control.cycles < CYCLES {
        control.cycles(10_000);
        std::thread::sleep(Duration::from_millis(4));
        if control.cycles == CYCLES / 10 {
            early_kib = greatest_kib(&process);
        }
    }
    std::thread::sleep(Duration::from_millis(500));
    let late_kib = greatest_kib(&process);
    kill(Pid::from_raw(process.id() as i32), Signal::SIGINT).expect("it is ours");
    let output = process.wait_with_output().expect("an end");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    eprintln!("{early_kib} KiB early, {late_kib} KiB late: {said}");
    let (taken, lost) = (number_before(&said, " cycles of 1 pin"), number_before(&said, " lost"));
    assert!(taken > 100_000, "{said}");
    assert!(taken + lost <= u64::from(CYCLES), "{said}");
    assert!(
        early_kib > 0 && late_kib < early_kib + 2048,
        "{early_kib} KiB, then {late_kib} KiB"
    );
    let picture = std::fs::read_to_string(&svg).expect("a picture");
    assert!(picture.len() < 200_000 && picture.contains(">a.count<"));
    assert_eq!(output.status.code(), Some(i32::from(lost > 0)), "{said}");
}

#[test]
fn without_a_terminal_it_says_what_to_ask_for() {
    let control = control("terminal");
    let output = control.scope(&["a.count"]).wait_with_output().expect("an end");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.contains("scope needs a terminal; without one: --csv FILE, --svg FILE or --follow"),
        "{said}"
    );
    let output = control
        .scope(&["a.cuont", "--follow"])
        .wait_with_output()
        .expect("an end");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("did you mean 'a.count'?"), "{said}");
    assert_eq!(output.status.code(), Some(1));
}
