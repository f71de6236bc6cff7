//! Memory of the control: all of it is locked, so it is bounded.
//!
//! Measured is the process of the control, in which a demo over the wire in memory has its simulated machine as well; over a
//! private wire that and the analyser are processes of their own.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// What the control may take, KiB.
const MEMORY_MAX_KIB: u64 = 64 * 1024;
/// Runs on a PC that may stand still for longer than lost polls are ridden out.
const ATTEMPTS: u32 = 4;

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

fn demo(out: &Path) -> Child {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let machine = std::fs::read_to_string(configs.join("mill3-demo.toml")).expect("the demo's machine");
    let own = out.join("machine.toml");
    let name = format!("name = \"memory-{}\"", std::process::id());
    std::fs::write(&own, machine.replacen("name = \"mill3-demo\"", &name, 1)).expect("our folder");
    Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["demo", "--memory", "--machine"])
        .arg(own)
        .arg("--program")
        .arg(configs.join("short-part.ngc"))
        .arg("--out")
        .arg(out)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("isocnc")
}

#[test]
fn the_control_takes_no_more_than_64_mib_from_its_start_to_its_report() {
    for _ in 0..ATTEMPTS {
        let out = TempDir::new().expect("a folder");
        let [resident_kib, locked_kib] = greatest_memory(&mut demo(out.path()));
        eprintln!("resident {resident_kib} KiB, locked {locked_kib} KiB");
        let report = std::fs::read_to_string(out.path().join("run.json")).unwrap_or_default();
        assert!(
            (1..=MEMORY_MAX_KIB).contains(&resident_kib) && locked_kib <= MEMORY_MAX_KIB,
            "resident {resident_kib} KiB, locked {locked_kib} KiB, at most {MEMORY_MAX_KIB} each"
        );
        if report.contains("\"result\": \"completed\"") {
            return;
        }
    }
    panic!("the program came to its end in none of {ATTEMPTS} runs");
}
