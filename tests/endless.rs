//! Programs whose check would take for ever, from outside: a signal ends every command that checks one, and nothing was moved.

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::process::Stdio;
use std::time::Duration;

/// Twenty seconds at least until the limit of lines is reached.
const ENDLESS: &str = "G21 G90 F100\no1 while [1]\nG1 X1\nX2\no1 endwhile\nM2\n";

/// Whether a process has a handler for a signal.
fn catches(process: u32, signal: Signal) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let caught = caught.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok());
    caught.is_some_and(|bits| bits & 1 << (signal as u64 - 1) != 0)
}

#[test]
fn a_signal_ends_the_check_of_a_program_in_every_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("endless.ngc"), ENDLESS).expect("our folder");
    let machine = include_str!("../configs/mill3-demo.toml");
    let machine = machine.replace("kind = \"powerlink\"", "kind = \"memory\"");
    std::fs::write(path("m.toml"), machine).expect("our folder");
    let checked = "stopped while the program was checked; nothing was moved";
    let commands: [(&[&str], Signal, &str); 3] = [
        (&["run", "m.toml", "endless.ngc"], Signal::SIGINT, checked),
        (
            &["demo", "--memory", "--program", "endless.ngc"],
            Signal::SIGTERM,
            checked,
        ),
        (
            &["jitter", "--program", "endless.ngc"],
            Signal::SIGINT,
            "nothing was measured",
        ),
    ];
    for (command, signal, expected) in commands {
        let process = testing::command(env!("CARGO_BIN_EXE_isocnc"))
            .args(command)
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary runs");
        while !catches(process.id(), signal) {
            std::thread::sleep(Duration::from_millis(5));
        }
        kill(Pid::from_raw(process.id() as i32), signal).expect("our process");
        let output = process.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(128 + signal as i32), "{command:?}: {said}");
        assert!(said.contains(expected), "{command:?}: {said}");
    }
}
