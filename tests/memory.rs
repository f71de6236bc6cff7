//! Memory of the control: all of it is locked, so it is bounded.
//!
//! Measured is the process of the control, which has its simulated machine in it as well: a demo over the wire in memory, and
//! the same with the real-time threads.

use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// What the control may take, KiB.
const MEMORY_MAX_KIB: u64 = 64 * 1024;
/// The greatest memory of a process until its end, KiB: resident (kept by the kernel) and locked.
fn greatest_memory(process: &mut Child) -> [u64; 2] {
    let mut greatest = [0; 2];
    while process.try_wait().expect("it is ours").is_none() {
        // One that has just ended has no memory any more.
        let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap_or_default();
        for (greatest, key) in greatest.iter_mut().zip(["VmHWM:", "VmLck:"]) {
            let line = status.lines().find_map(|line| line.strip_prefix(key));
            let kib = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
            *greatest = kib.unwrap_or(0).max(*greatest);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    greatest
}

/// Runs `isocnc COMMAND` in a folder that holds the machine; the report it wrote.
fn report_of(command: &[&str]) -> String {
    let out = TempDir::new().expect("a folder");
    let name = format!("name = \"memory-{}\"", std::process::id());
    let machine = include_str!("../configs/mill3-demo.toml")
        .replacen("name = \"mill3-demo\"", &name, 1)
        .replacen("kind = \"powerlink\"", "kind = \"memory\"", 1);
    std::fs::write(out.path().join("machine.toml"), machine).expect("our folder");
    std::fs::write(out.path().join("part.ngc"), include_str!("../configs/short-part.ngc")).expect("our folder");
    let mut process = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(command)
        .args(["--out", "."])
        .current_dir(out.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("isocnc");
    let [resident_kib, locked_kib] = greatest_memory(&mut process);
    eprintln!("{command:?}: resident {resident_kib} KiB, locked {locked_kib} KiB");
    assert!(
        (1..=MEMORY_MAX_KIB).contains(&resident_kib) && locked_kib <= MEMORY_MAX_KIB,
        "{command:?}: resident {resident_kib} KiB, locked {locked_kib} KiB, at most {MEMORY_MAX_KIB} each"
    );
    std::fs::read_to_string(out.path().join("run.json")).expect("a report")
}

#[test]
fn the_control_takes_no_more_than_64_mib_from_its_start_to_its_report() {
    let report = report_of(&["demo", "--memory", "--machine", "machine.toml", "--program", "part.ngc"]);
    assert!(report.contains("\"result\": \"completed\""), "{report}");
    // Whether a PC without real time brings this one to its end is not asked.
    report_of(&["run", "machine.toml", "part.ngc"]);
}
