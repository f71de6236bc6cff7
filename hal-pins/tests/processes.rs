//! Two processes: this test program runs itself again as the control or as the client.

use hal_pins::{AnyValue, Attached, Hal, HalError};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};

const DIR: &str = "ISOCNC_TEST_HAL_DIR";

/// Runs one of the `role_` tests below in a process of its own.
fn role(name: &str, dir: &std::path::Path) -> (Child, BufReader<ChildStdout>) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([
            "--exact",
            &format!("processes::{name}"),
            "--nocapture",
            "--test-threads=1",
        ])
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
    testing::end(&mut child);
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
fn what_killed_controls_left_goes_with_the_next_start_and_what_runs_stays() {
    let dir = tempfile::tempdir().unwrap();
    let (mut child, mut stdout) = role("role_control", dir.path());
    wait_for(&mut stdout, "CONTROL READY");
    let path = |name: &str| dir.path().join(name);
    // Its socket, a draft of a control that was killed while it began; a stranger's file.
    for name in ["isocnc-control.mill", ".isocnc-hal.router.77.1", "notes.txt"] {
        std::fs::write(path(name), "").unwrap();
    }
    let names = || {
        let entries = std::fs::read_dir(dir.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    let dirs = [dir.path().to_owned()];
    let lathe = Hal::create_in(&dirs, "lathe", 8).unwrap();
    assert_eq!(
        names(),
        [
            "isocnc-control.mill",
            "isocnc-hal.lathe",
            "isocnc-hal.mill",
            "notes.txt"
        ]
    );
    child.kill().unwrap();
    testing::end(&mut child);
    drop(lathe);
    assert_eq!(names(), ["isocnc-control.mill", "isocnc-hal.mill", "notes.txt"]);
    drop(Hal::create_in(&dirs, "lathe", 8).unwrap());
    assert_eq!(names(), ["notes.txt"]);
}

#[test]
fn a_file_that_is_cut_short_kills_neither_the_control_nor_its_clients() {
    let dir = tempfile::tempdir().unwrap();
    let dirs = [dir.path().to_owned()];
    let mut hal = Hal::create_in(&dirs, "mill", 1000).unwrap();
    let mut first = hal.output::<i32>("a.first").unwrap();
    for pin in 0..997 {
        hal.input(&format!("b.{pin}"), 7i32).unwrap();
    }
    let last = hal.input("c.last", 8i32).unwrap();
    let far = Attached::attach_in(&dirs, "mill").unwrap();
    let (memory, other) = (hal.memory(), Hal::create_in(&dirs, "lathe", 8).unwrap());
    first.set(5);
    assert!(!memory.is_lost());
    let file = std::fs::OpenOptions::new().write(true).open(hal.path()).unwrap();
    // Where the first page ends, then everything.
    file.set_len(4096).unwrap();
    assert_eq!((first.get(), last.get(), memory.is_lost()), (5, 0, true));
    file.set_len(0).unwrap();
    first.set(6);
    assert_eq!((first.get(), last.get()), (6, 0));
    assert!(!other.memory().is_lost());
    let said = far.list().unwrap_err().to_string();
    assert!(said.ends_with("was cut short by another process"), "{said}");
}

#[test]
fn a_bus_error_of_anything_else_still_ends_the_process() {
    let dir = tempfile::tempdir().unwrap();
    let (mut child, mut stdout) = role("role_bus_error", dir.path());
    wait_for(&mut stdout, "NOW");
    assert_eq!(testing::end(&mut child).signal(), Some(libc::SIGBUS));
}

/// Touches a page behind the end of a file that is no control's.
#[test]
fn role_bus_error() {
    let Some(dirs) = role_dir() else { return };
    let _hal = Hal::create_in(&dirs, "mill", 8).unwrap();
    let file = tempfile::tempfile().unwrap();
    file.set_len(4096).unwrap();
    let map = memmap2::MmapOptions::new().len(4096).map_raw(&file).unwrap();
    file.set_len(0).unwrap();
    println!("NOW");
    // SAFETY: inside of the mapping; that it ends the process is what is tried.
    unsafe { map.as_ptr().read_volatile() };
}

#[test]
fn a_control_that_ends_removes_its_file() {
    let dir = tempfile::tempdir().unwrap();
    let (mut child, mut stdout) = role("role_control", dir.path());
    wait_for(&mut stdout, "CONTROL READY");
    drop(child.stdin.take());
    assert!(testing::end(&mut child).success());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}
