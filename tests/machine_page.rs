//! docs/first-machine.md, followed to the letter: its commands, in their order, by a shell in a network of its own.
//!
//! A shell is root there, so `sudo` is left out. Where no such network may be made, the test says so and passes.

use crate::common::PATIENCE;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const PAGE: &str = include_str!("../docs/first-machine.md");

/// Waits in the script for what the page's reader sees before he goes on.
const UNTIL: &str = r#"
until_status() {
    for _ in $(seq TRIES); do
        isocnc status 2>/dev/null | grep -q "$1" && return
        sleep 0.2
    done
    isocnc status
    exit 1
}
"#;

/// The commands of the page as a script; what the reader waits for is between them.
fn script() -> String {
    // What was started ends with the shell, also where a command fails.
    let mut script = String::from("set -eux\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n")
        + &UNTIL.replace("TRIES", &(PATIENCE.as_secs() * 5).to_string());
    let mut is_command = false;
    for line in PAGE.lines() {
        match line {
            "```sh" => is_command = true,
            "```" => is_command = false,
            // The one that asks, which needs a terminal: the next one does the same without questions.
            _ if line.ends_with("init machine.toml --scan eth1") => {}
            _ if is_command => {
                let mut line = line.replace("sudo ", "").replace("--panel", "--panel 127.0.0.1:0");
                if line.starts_with("isocnc doctor") {
                    // Its exit code tells that something is missing.
                    line += " || true";
                }
                script += &line;
                script.push('\n');
                if line.starts_with("isocnc simulate") {
                    script += "sleep 1\n";
                } else if line.starts_with("isocnc run") {
                    script += "control=$!\nuntil_status 'power     off'\n";
                }
            }
            _ => {}
        }
    }
    // The control ends as by Ctrl-C.
    script + "kill -INT $control\nwait $control || true\n"
}

fn run(folder: &Path, script: &str) -> Output {
    let program = Path::new(env!("CARGO_BIN_EXE_isocnc")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    let mut command = Command::new("unshare");
    command
        .args(["--map-root-user", "--net", "--mount", "bash", "-c", script])
        .current_dir(folder)
        .env("PATH", path)
        .env("ISOCNC_MACHINE", "machine")
        .stdin(Stdio::null());
    testing::usual_signals(&mut command);
    command.output().expect("unshare")
}

#[test]
fn a_drive_on_a_wire_becomes_an_axis_as_the_page_says() {
    let folder = tempfile::tempdir().unwrap();
    if !run(folder.path(), "ip link set lo up").status.success() {
        println!("skipped: no network of its own may be made here");
        return;
    }
    let configs = folder.path().join("configs");
    std::fs::create_dir(&configs).unwrap();
    let drive = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/first-drive.toml");
    std::fs::copy(drive, configs.join("first-drive.toml")).unwrap();
    let output = run(folder.path(), &script());
    let [said, steps] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(output.status.success(), "{said}\n{steps}");
    // The node that answered, the axis that was homed and has moved.
    for wanted in [
        "cia402",
        "machine.toml is written",
        "machine.toml is good",
        "\nX             10.000      10.000\n",
    ] {
        assert!(said.contains(wanted), "{wanted:?} is not in\n{said}\n{steps}");
    }
}
