//! docs/day.md, followed to the letter: its commands, in their order, by a shell, on a machine in memory.
//!
//! A block that starts the control again follows a failure of power, which is a kill here.

use crate::common::{PATIENCE, machine_file};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const PAGE: &str = include_str!("../docs/day.md");

/// Blocks of a page in this language, as lines.
fn blocks(language: &str) -> Vec<Vec<&'static str>> {
    let mut found = Vec::new();
    let mut parts = PAGE.split("```");
    // What stands between the first pair of fences, the second one ...
    while let (Some(_), Some(block)) = (parts.next(), parts.next()) {
        if let Some(text) = block.strip_prefix(language).and_then(|rest| rest.strip_prefix('\n')) {
            found.push(text.lines().collect());
        }
    }
    found
}

/// A shell in which the commands of the page are those of this build.
struct Shell<'a> {
    folder: &'a Path,
    machine: String,
    control: Option<Child>,
}

impl Shell<'_> {
    fn command(&self, line: &str) -> Command {
        let program = Path::new(env!("CARGO_BIN_EXE_isocnc")).parent().unwrap();
        let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
        let mut command = Command::new("sh");
        command
            .args(["-c", line])
            .current_dir(self.folder)
            .env("PATH", path)
            .env("ISOCNC_MACHINE", &self.machine);
        testing::usual_signals(&mut command);
        command
    }

    /// What a line prints; it has to go well.
    fn run(&self, line: &str) -> String {
        let output = self.command(line).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{line}: {text}");
        text
    }

    fn until(&self, line: &str, wanted: &str) -> String {
        let give_up = Instant::now() + PATIENCE;
        loop {
            let output = self.command(line).output().unwrap();
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            if text.contains(wanted) {
                return text;
            }
            assert!(Instant::now() < give_up, "{line}: never {wanted:?}: {text}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Starts the control; one that runs already dies first, as where the power fails.
    fn start(&mut self, line: &str) {
        self.kill();
        let line = format!("exec {line} 127.0.0.1:0");
        let control = self.command(&line).stdout(Stdio::null()).spawn().unwrap();
        self.control = Some(control);
        self.until("isocnc status", "power     off");
    }

    fn kill(&mut self) {
        if let Some(mut control) = self.control.take() {
            control.kill().unwrap();
            control.wait().unwrap();
        }
    }
}

impl Drop for Shell<'_> {
    fn drop(&mut self) {
        // The test may have failed because it has ended.
        if let Some(control) = &mut self.control {
            let _ = control.kill();
            let _ = control.wait();
        }
    }
}

#[test]
fn the_day_of_the_page_goes_as_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let machine = format!("day-{}", std::process::id());
    let text = machine_file(&machine)
        .replacen("kind = \"powerlink\"", "kind = \"memory\"", 1)
        .replacen("\ncycle_us", "\nstate_directory = \"state\"\ncycle_us", 1);
    // Tools are changed by hand.
    let (before, after) = text.split_once("[[hal.net]]\nname = \"tool-change-loop\"").unwrap();
    let after = &after[after.find("\n\n").unwrap()..];
    std::fs::write(folder.path().join("machine.toml"), format!("{before}{after}")).unwrap();
    let [program] = &blocks("gcode")[..] else {
        panic!("one program")
    };
    std::fs::write(folder.path().join("day.ngc"), program.join("\n")).unwrap();

    let mut shell = Shell {
        folder: folder.path(),
        machine,
        control: None,
    };
    let (mut lines, mut said) = (0, String::new());
    for line in blocks("sh").into_iter().flatten() {
        // What the page says of the answer comes when the machine has come that far.
        let (command, comment) = line.split_once('#').unwrap_or((line, ""));
        let command = command.trim();
        lines += 1;
        if command.starts_with("isocnc run ") {
            if shell.control.is_some() {
                // For the power to fail in.
                shell.run("isocnc program start --no-wait");
                shell.until("isocnc status", "waits ");
            }
            shell.start(command);
        } else if let Some(wanted) = comment.trim().strip_prefix("waits: ") {
            shell.until(command, wanted);
        } else if comment.contains("last: interrupted") {
            shell.until(command, "interrupted");
        } else if command == "isocnc tool-changed" {
            shell.run(command);
            shell.until("isocnc status", ": completed");
            let position = shell.run("isocnc status");
            assert!(position.contains("\nX             40.000     140.000\n"), "{position}");
        } else if command.ends_with("--from-line 8") {
            // It only says what it means: refused without --yes.
            let output = shell.command(command).output().unwrap();
            said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
            assert!(said.contains("line 8"), "{said}");
        } else {
            said = shell.run(command);
        }
    }
    assert!(lines > 20, "{lines} lines");
    assert!(
        said.contains("day.ngc") && said.contains("order: "),
        "the journal: {said}"
    );
}
