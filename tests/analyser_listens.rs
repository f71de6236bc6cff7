//! `isocnc jitter --listen` on a real veth pair: what is sent at one end is measured at the other.
//!
//! This program has no test harness, for a namespace is entered by a process of one thread: it runs itself again and checks
//! what the other one says. Where the system refuses, it prints the reason and passes.

use isocnc::analyser::{SocReport, StampSource};
use isocnc::host::netns::{NetnsError, private_wire};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use powerlink::link::Link;
use powerlink::link::raw::{RawConfig, RawLink};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};
use testing::PATIENCE;

const ROLE: &str = "ISOCNC_TEST_ANALYSER_LISTENS";

pub(crate) fn main() {
    if std::env::var_os(ROLE).is_some() {
        listen();
        return;
    }
    let mut command = testing::command(std::env::current_exe().unwrap());
    let output = command.env(ROLE, "1").output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}\n{complaint}");
    match said.split_once("REFUSED: ") {
        Some((_, reason)) => println!("analyser_listens ... SKIPPED: {}", reason.trim()),
        None => println!("analyser_listens ... ok"),
    }
}

/// Runs in a process of its own.
fn listen() {
    match private_wire("plk0", "plk1") {
        Ok(_) => {}
        Err(error @ NetnsError::Forbidden { .. }) => {
            println!("REFUSED: {error}");
            return;
        }
        Err(error) => panic!("{error}"),
    }
    let mut near = RawLink::open("plk0", RawConfig::default()).unwrap();
    counts_as_many_periods_as_wanted(&mut near);
    serves_another_process(&mut near);
    says_that_nothing_was_heard();
}

fn frame(message_type: u8) -> [u8; 60] {
    let mut frame = [0; 60];
    frame[..6].copy_from_slice(&[0x01, 0x11, 0x1E, 0, 0, message_type]);
    frame[12..15].copy_from_slice(&[0x88, 0xAB, message_type]);
    frame
}

fn isocnc(arguments: &str) -> Child {
    testing::command(env!("CARGO_BIN_EXE_isocnc"))
        .args(arguments.split(' '))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn counts_as_many_periods_as_wanted(near: &mut RawLink) {
    let mut child = isocnc("jitter --interface plk1 --listen --period-us 2000 --cycles 30 --json");
    let give_up = Instant::now() + PATIENCE;
    while child.try_wait().unwrap().is_none() {
        assert!(Instant::now() < give_up, "it does not end by itself");
        near.send(&frame(0x01)).unwrap();
        near.send(&frame(0x05)).unwrap();
        std::thread::sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().unwrap();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{complaint}");
    let report: SocReport = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (report.interface.as_str(), report.cycle_us, report.n),
        ("plk1", 2000, 30)
    );
    assert!(report.frames.soc > 30 && report.frames.soa > 0, "{:?}", report.frames);
    assert_eq!((report.frames.foreign, report.frames_dropped), (0, 0));
    // A veth pair has no clock of its own.
    assert_eq!(report.stamps, StampSource::Kernel);
    assert!(
        report.why_not_hardware.is_some_and(|why| why.contains("takes none")),
        "the reason stands in the report"
    );
}

fn serves_another_process(near: &mut RawLink) {
    let mut child = isocnc("jitter --interface plk1 --listen --orders --period-us 1000");
    let mut orders = child.stdin.take().unwrap();
    let mut answers = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut answer = || answers.next().unwrap().unwrap();
    assert_eq!(answer(), "ready");
    // When an order is carried out only the figures say: windows are tried until two have seen something.
    let give_up = Instant::now() + PATIENCE;
    let mut windows = 0;
    while windows < 2 {
        assert!(Instant::now() < give_up, "no window sees a frame");
        writeln!(orders, "begin").unwrap();
        for _ in 0..50 {
            near.send(&frame(0x01)).unwrap();
            std::thread::sleep(Duration::from_millis(2));
        }
        writeln!(orders, "end").unwrap();
        let report: SocReport = serde_json::from_str(&answer()).unwrap();
        // Nothing of an earlier window.
        assert!(report.frames.soc <= 50, "{:?}", report.frames);
        // The kernel may leave the first frames unstamped; the others make periods, gaps or not.
        assert!(
            report.n + report.frames_unstamped + 1 >= report.frames.soc,
            "{report:?}"
        );
        assert_eq!(report.breaks.restarts, 0);
        windows += u32::from(report.n > 0);
    }
    drop(orders);
    assert!(testing::end(&mut child).success());
}

fn says_that_nothing_was_heard() {
    let mut child = isocnc("jitter --interface plk1 --listen");
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    output.read_line(&mut line).unwrap();
    assert!(line.starts_with("listening at plk1"), "{line}");
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(
        complaint.contains("plk1: no frame at all. Listen at a network tap"),
        "{complaint}"
    );
}
