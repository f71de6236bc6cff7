//! Two processes: this test program runs itself again as the control or as the client.

use hal_pins::{AnyValue, Attached, Hal, HalError};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};

const DIR: &str = "ISOCNC_TEST_HAL_DIR";

/// Runs one of the `role_` tests below in a process of its own.
fn role(name: &str, dir: &std::path::Path) -> (Child, BufReader<ChildStdout>) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--nocapture", "--test-threads=1"])
        .env(DIR, dir)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let stdout = BufReader::new(child.stdout.take().unwrap());
    (child, stdout)
}

fn wait_for(stdout: &mut BufReader<ChildStdout>, word: &str) -> String {
    let mut line = String::new();
    loop {
        line.clear();
        assert!(
            stdout.read_line(&mut line).unwrap() > 0,
            "the other process ended before it said '{word}'"
        );
        // The test harness may have begun the line.
        if let Some(at) = line.find(word) {
            return line[at..].trim().to_owned();
        }
    }
}

fn role_dir() -> Option<Vec<PathBuf>> {
    std::env::var_os(DIR).map(|dir| vec![PathBuf::from(dir)])
}

/// Control: answers each line on its input with twice the value of its input pin.
#[test]
fn role_control() {
    let Some(dirs) = role_dir() else { return };
    let mut hal = Hal::create_in(&dirs, "mill", 8).unwrap();
    let ask = hal.input("client.ask", 0i32).unwrap();
    let mut answer = hal.output::<i32>("control.answer").unwrap();
    println!("CONTROL READY");
    for _line in std::io::stdin().lines().map_while(Result::ok) {
        answer.set(2 * ask.get());
        println!("CONTROL DONE");
    }
}

#[test]
fn values_cross_between_processes_and_a_killed_control_is_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let dirs = [dir.path().to_owned()];
    let (mut child, mut stdout) = role("role_control", dir.path());
    wait_for(&mut stdout, "CONTROL READY");

    let far = Attached::attach_in(&dirs, "mill").unwrap();
    assert_eq!(far.pid(), child.id());
    for ask in [21, -4] {
        far.set("client.ask", AnyValue::S32(ask)).unwrap();
        writeln!(child.stdin.as_mut().unwrap(), "go").unwrap();
        wait_for(&mut stdout, "CONTROL DONE");
        assert_eq!(far.get("control.answer").unwrap().value, AnyValue::S32(2 * ask));
    }
    let running = Hal::create_in(&dirs, "mill", 8).err().unwrap();
    assert!(
        matches!(running, HalError::Running { pid, .. } if pid == child.id()),
        "{running}"
    );

    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!far.is_running());
    assert_eq!(
        far.get("control.answer").unwrap().value,
        AnyValue::S32(-8),
        "the memory stays readable"
    );
    assert!(far.path().exists(), "a killed process leaves its file behind");
    assert!(matches!(
        Attached::attach_in(&dirs, "mill"),
        Err(HalError::NotRunning { .. })
    ));

    let hal = Hal::create_in(&dirs, "mill", 8).unwrap();
    assert_eq!(Attached::attach_in(&dirs, "mill").unwrap().pid(), std::process::id());
    drop(hal);
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn a_control_that_ends_removes_its_file() {
    let dir = tempfile::tempdir().unwrap();
    let (mut child, mut stdout) = role("role_control", dir.path());
    wait_for(&mut stdout, "CONTROL READY");
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}
