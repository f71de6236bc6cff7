//! `isocnc hal scope` as a user runs it, beside a control that is only its pins.

use hal_pins::scope::Sampler;
use hal_pins::{Hal, Output};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

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

    fn scope(&self, args: &[&str], stdout: Stdio) -> Child {
        let mut command = testing::command(env!("CARGO_BIN_EXE_isocnc"));
        command.args(["hal", "scope", "--machine", &self.name]).args(args);
        let command = command.stdin(Stdio::null()).stdout(stdout).stderr(Stdio::piped());
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
    // Two hours at 1 ms in the long form, half an hour else.
    let cycles: u32 = match std::env::var_os("ISOCNC_SEEDS") {
        Some(_) => 7_200_000,
        None => 1_800_000,
    };
    let folder = tempfile::tempdir().expect("a folder");
    let svg = folder.path().join("hours.svg");
    let mut control = control("hours");
    let svg_path = svg.to_str().expect("text");
    let arguments = ["a.count", "--follow", "--csv", "/dev/null", "--svg", svg_path];
    let mut process = control.scope(&arguments, Stdio::piped());
    let told = BufReader::new(process.stdout.take().expect("a pipe"));
    // How many lines have come, and the value in the last of them.
    let (lines, last) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicU32::new(0)));
    let reader = std::thread::spawn({
        let (lines, last) = (Arc::clone(&lines), Arc::clone(&last));
        move || {
            // The first one is the head.
            for line in told.lines().map_while(Result::ok).skip(1) {
                let value = line.rsplit(',').next().and_then(|value| value.parse().ok());
                last.store(value.expect("a number"), Ordering::Relaxed);
                lines.fetch_add(1, Ordering::Relaxed);
            }
        }
    });
    let next = |control: &mut Control| {
        control.cycles(10_000);
        std::thread::sleep(Duration::from_millis(4));
    };
    let give_up = Instant::now() + testing::PATIENCE;
    while lines.load(Ordering::Relaxed) < 50_000 {
        assert!(Instant::now() < give_up, "it takes no cycles");
        next(&mut control);
    }
    let early_kib = greatest_kib(&process);
    for _ in 0..cycles / 10_000 {
        next(&mut control);
    }
    // The last of them may have found the ring full: a cycle now and then finds room.
    let all = control.cycles;
    while last.load(Ordering::Relaxed) < all {
        assert!(Instant::now() < give_up, "it never comes to the last cycle");
        control.cycles(1);
        std::thread::sleep(Duration::from_millis(4));
    }
    let late_kib = greatest_kib(&process);
    kill(Pid::from_raw(process.id() as i32), Signal::SIGINT).expect("it is ours");
    let output = process.wait_with_output().expect("an end");
    reader.join().expect("lines of numbers");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    eprintln!("{early_kib} KiB early, {late_kib} KiB late: {said}");
    let (taken, lost) = (number_before(&said, " cycles of 1 pin"), number_before(&said, " lost"));
    assert_eq!(taken, lines.load(Ordering::Relaxed), "{said}");
    assert!(taken + lost <= u64::from(control.cycles), "{said}");
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
    let output = control
        .scope(&["a.count"], Stdio::null())
        .wait_with_output()
        .expect("an end");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.contains("scope needs a terminal; without one: --csv FILE, --svg FILE or --follow"),
        "{said}"
    );
    let output = control
        .scope(&["a.cuont", "--follow"], Stdio::null())
        .wait_with_output()
        .expect("an end");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("did you mean 'a.count'?"), "{said}");
    assert_eq!(output.status.code(), Some(1));
}
