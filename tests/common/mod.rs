//! A control that stands by as a process, and its clients, for the tests that need one.

#![allow(dead_code, reason = "no test needs all of it")]

use isocnc::config;
use serde_json::Value;
use std::collections::HashMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const MACHINE: &str = include_str!("../../configs/mill3-demo.toml");
pub(crate) use testing::PATIENCE;

/// The machine file of the demo under this name, which bears that this PC is busy.
pub(crate) fn machine_file(machine: &str) -> String {
    let config = config::parse(MACHINE, Path::new("mill3-demo.toml")).unwrap();
    MACHINE
        .replace(&format!("\"{}\"", config.name), &format!("\"{machine}\""))
        .replace("\nlock_memory = true", "\noverruns_stop = 0\nlock_memory = true")
        .replace("pres_lost_max = 20", "pres_lost_max = 1000")
        .replace("following_error_mm = 2.0", "following_error_mm = 100.0")
}

/// A control that stands by, mostly over the wire in memory.
pub(crate) struct Control {
    pub(crate) process: Child,
    pub(crate) folder: TempDir,
    pub(crate) machine: String,
}

impl Control {
    pub(crate) fn start(name: &str, stdout: impl Into<Stdio>) -> Control {
        Control::start_in(tempfile::tempdir().unwrap(), name, stdout, str::to_owned)
    }

    /// In a folder with files of its own, for which the machine file may be `changed`.
    pub(crate) fn start_in(
        folder: TempDir,
        name: &str,
        stdout: impl Into<Stdio>,
        changed: fn(&str) -> String,
    ) -> Control {
        let machine = format!("{name}-{}", std::process::id());
        let text = machine_file(&machine).replacen("kind = \"powerlink\"", "kind = \"memory\"", 1);
        std::fs::write(folder.path().join("machine.toml"), changed(&text)).unwrap();
        Control::run(folder, machine, stdout)
    }

    /// Of the machine.toml in this folder, which names this machine.
    pub(crate) fn run(folder: TempDir, machine: String, stdout: impl Into<Stdio>) -> Control {
        let process = spawn(&folder, stdout);
        Control {
            process,
            folder,
            machine,
        }
    }

    /// Killed, and started once more.
    pub(crate) fn restart(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
        self.process = spawn(&self.folder, Stdio::null());
    }

    pub(crate) fn program(&self, name: &str, text: &str) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    /// The client's answer, or the errors that it answers.
    pub(crate) fn ask(&self, arguments: &[&str]) -> Result<Value, String> {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        let output = command
            .args(arguments)
            .args(["--json", "--machine", &self.machine])
            .output()
            .unwrap();
        match output.status.code() {
            Some(0) => Ok(serde_json::from_slice(&output.stdout).unwrap()),
            _ => {
                let errors: Value = serde_json::from_slice(&output.stdout).unwrap();
                let rules = errors["errors"].as_array().unwrap().iter();
                let rules: Vec<&str> = rules.map(|error| error["rule"].as_str().unwrap()).collect();
                Err(rules.join("\n"))
            }
        }
    }

    /// A client in words: its exit code, and all that it says.
    pub(crate) fn words(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        let output = command
            .args(arguments)
            .args(["--machine", &self.machine])
            .output()
            .unwrap();
        let text = |octets: &[u8]| String::from_utf8_lossy(octets).into_owned();
        (output.status.code(), text(&output.stdout) + &text(&output.stderr))
    }

    pub(crate) fn wait_for(&self, what: &str, done: impl Fn(&Value) -> bool) -> Value {
        let give_up = Instant::now() + PATIENCE;
        loop {
            let status = self.ask(&["status"]);
            if let Ok(status) = &status
                && done(status)
            {
                return status.clone();
            }
            assert!(Instant::now() < give_up, "never {what}: {status:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    pub(crate) fn refused(&self, arguments: &[&str], why: &str) {
        let said = self.ask(arguments).expect_err("a refusal");
        assert!(said.contains(why), "{said}");
    }
}

fn spawn(folder: &TempDir, stdout: impl Into<Stdio>) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
    let file = folder.path().join("machine.toml");
    command.arg("run").arg(file).arg("--json").stdout(stdout);
    testing::usual_signals(&mut command);
    command.spawn().unwrap()
}

impl Drop for Control {
    fn drop(&mut self) {
        // Gone already where the test went well.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A control in memory that stands by with a panel.
pub(crate) struct WithPanel {
    process: Child,
    pub(crate) folder: TempDir,
    addresses: HashMap<String, String>,
}

impl WithPanel {
    /// With these tables in its machine file, of which it tells addresses: `panel`, `grbl`, `shdr`.
    pub(crate) fn start(name: &str, tables: &str, told: &[&str]) -> WithPanel {
        let folder = tempfile::tempdir().unwrap();
        let machine = format!("{name}-{}", std::process::id());
        let text = machine_file(&machine).replacen("kind = \"powerlink\"", "kind = \"memory\"", 1);
        let file = folder.path().join("machine.toml");
        std::fs::write(&file, format!("{text}\n{tables}\n")).unwrap();
        let mut process = Command::new(env!("CARGO_BIN_EXE_isocnc"))
            .arg("run")
            .arg(&file)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut output = BufReader::new(process.stdout.take().unwrap());
        let mut addresses = HashMap::new();
        while !told.iter().all(|name| addresses.contains_key(*name)) {
            let mut line = String::new();
            assert!(output.read_line(&mut line).unwrap() > 0, "the control has ended");
            let Some((name, rest)) = line.trim_end().split_once(": ") else {
                continue;
            };
            let address = rest.split_once("://").map_or(rest, |(_, rest)| rest);
            let address = address.split('/').next().unwrap();
            if address.parse::<std::net::SocketAddr>().is_ok() {
                addresses.entry(name.to_owned()).or_insert_with(|| address.to_owned());
            }
        }
        // What it prints has to go somewhere.
        std::thread::spawn(move || std::io::copy(&mut output, &mut std::io::sink()));
        WithPanel {
            process,
            folder,
            addresses,
        }
    }

    /// Where it listens for this.
    pub(crate) fn address(&self, of: &str) -> &str {
        &self.addresses[of]
    }
}

impl Drop for WithPanel {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
