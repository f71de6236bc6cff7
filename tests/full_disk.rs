//! A disk that is full: the result is printed all the same, file and cause are told, and nothing of an older file is lost.
//!
//! Needs root, for a small file system of its own; without, the tests say so and pass.

use nix::mount::{MsFlags, mount};
use nix::sched::{CloneFlags, unshare};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use testing::PATIENCE;

const PART: &str = "G21 G90 G94 G54 G64 P0.01\nG10 L2 P1 X5\nG1 X6 F1000\nM2\n";
const PARAMETERS: &str = "5221 20\n5222 20\n5223 -60\n";
const OLD: &str = "old";
const FULL: &str = "No space left on device";

/// A folder with a machine, a part, and a small disk in its folder `disk`, which this thread and its processes see.
///
/// `None`: not root, and it was told.
fn folder(machine: &str) -> Option<TempDir> {
    if !nix::unistd::geteuid().is_root() {
        println!("SKIPPED: only root can make a small disk");
        return None;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("our folder");
    write("m.toml", machine);
    write("part.ngc", PART);
    write("given.var", PARAMETERS);
    let disk = folder.path().join("disk");
    std::fs::create_dir(&disk).expect("our folder");
    unshare(CloneFlags::CLONE_NEWNS).expect("as root");
    let none = None::<&str>;
    mount(none, "/", none, MsFlags::MS_REC | MsFlags::MS_PRIVATE, none).expect("as root");
    mount(none, &disk, Some("tmpfs"), MsFlags::empty(), Some("size=256k")).expect("as root");
    Some(folder)
}

/// Leaves no room; the file that takes it.
fn fill(disk: &Path) -> PathBuf {
    let filler = disk.join("filler");
    let mut file = File::create(&filler).expect("room for a name");
    while file.write_all(&[0; 4096]).is_ok() {}
    filler
}

/// All names below a folder.
fn names_in(folder: &Path) -> Vec<PathBuf> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).expect("our folder") {
        let path = entry.expect("our folder").path();
        if path.is_dir() {
            names.extend(names_in(&path));
        }
        names.push(path);
    }
    names.sort();
    names
}

fn isocnc(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .expect("the binary runs")
}

#[test]
fn results_are_printed_and_older_files_stay_whole() {
    let Some(folder) = folder(include_str!("../configs/mill3-demo.toml")) else {
        return;
    };
    let disk = folder.path().join("disk");
    let older = ["samples.csv", "left.var", "net.cdc"].map(|name| disk.join(name));
    for path in &older {
        std::fs::write(path, OLD).expect("there is room yet");
    }
    for name in ["demo", "jitter"] {
        std::fs::create_dir(disk.join(name)).expect("there is room yet");
    }
    fill(&disk);
    let before = names_in(&disk);
    let cases: [(&[&str], &str, &str); 5] = [
        (
            &["plan", "m.toml", "part.ngc", "--samples", "disk/samples.csv"],
            "motion time",
            "disk/samples.csv",
        ),
        (
            &[
                "interpret",
                "part.ngc",
                "-v",
                "given.var",
                "--write-var",
                "disk/left.var",
            ],
            "PROGRAM_END()",
            "disk/left.var",
        ),
        (
            &["check", "m.toml", "--cdc", "disk/net.cdc"],
            "m.toml is good",
            "disk/net.cdc",
        ),
        (
            &[
                "demo",
                "--memory",
                "--machine",
                "m.toml",
                "--program",
                "part.ngc",
                "--out",
                "disk/demo",
            ],
            "result                 completed",
            "disk/demo/run.json",
        ),
        (
            &[
                "jitter",
                "--machine",
                "m.toml",
                "--program",
                "part.ngc",
                "--cycles",
                "200",
                "--rounds",
                "1",
                "--no-floor",
                "--out",
                "disk/jitter",
            ],
            "Rounds: SoC period",
            "disk/jitter/jitter.json",
        ),
    ];
    for (command, result, file) in cases {
        let output = isocnc(folder.path(), command);
        let said = String::from_utf8_lossy(&output.stdout);
        let errors = String::from_utf8_lossy(&output.stderr);
        if errors.contains("no private wire") {
            println!("{command:?} SKIPPED: {errors}");
            continue;
        }
        assert!(said.contains(result), "{command:?}: {said}{errors}");
        let told = errors.lines().last().unwrap_or_default();
        assert!(told.contains(file) && told.contains(FULL), "{command:?}: {errors}");
        assert_eq!(output.status.code(), Some(1), "{command:?}: {errors}");
        assert_eq!(names_in(&disk), before, "{command:?}: {errors}");
    }
    for path in &older {
        assert_eq!(std::fs::read_to_string(path).expect("it is there"), OLD);
    }
}

/// What is known again after a restart: a full disk is told, and what was there stays.
#[test]
fn a_control_tells_that_its_state_is_not_kept_and_stays() {
    let name = format!("full-state-{}", std::process::id());
    let machine = include_str!("../configs/mill3-demo.toml")
        .replace("\"mill3-demo\"", &format!("\"{name}\""))
        .replacen("kind = \"powerlink\"", "kind = \"memory\"", 1)
        .replace("\n[machine]\n", "\n[machine]\nstate_directory = \"disk/state\"\n")
        // However busy this PC is.
        .replace("\nlock_memory = true", "\noverruns_stop = 0\nlock_memory = true")
        .replace("pres_lost_max = 20", "pres_lost_max = 1000");
    let Some(folder) = folder(&machine) else {
        return;
    };
    let disk = folder.path().join("disk");
    let control = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["run", "m.toml", "--json"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("the binary runs");
    let _control = Control(control);
    let parts = |target: &str| isocnc(folder.path(), &["parts", "target", target, "--machine", &name]);
    wait_for("begun", || match parts("7") {
        output if output.status.success() => Ok(()),
        output => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
    });
    let state = || std::fs::read_to_string(disk.join("state/state.json")).expect("it is there");
    assert!(state().contains("\"target\": 7"), "{}", state());
    let filler = fill(&disk);
    let output = parts("8");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains("not kept") && told.contains(FULL), "{told}");
    assert_eq!(String::from_utf8_lossy(&output.stdout), "parts 0 of 8\n");
    assert!(state().contains("\"target\": 7"), "{}", state());
    // It is kept as soon as there is room, without anybody asking.
    std::fs::remove_file(filler).expect("our file");
    wait_for("kept", || match state() {
        state if state.contains("\"target\": 8") => Ok(()),
        state => Err(state),
    });
    wait_for("in the journal", || {
        let journal = std::fs::read_to_string(disk.join("state/journal.jsonl")).expect("it is there");
        let told = journal.lines().any(|line| line.contains("not kept"));
        told.then_some(()).ok_or(journal)
    });
}

/// A control; it ends with the test.
struct Control(Child);

impl Drop for Control {
    fn drop(&mut self) {
        // Gone already where the test went well.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Asks until the answer is as wanted.
fn wait_for(what: &str, mut done: impl FnMut() -> Result<(), String>) {
    let give_up = Instant::now() + PATIENCE;
    while let Err(found) = done() {
        assert!(Instant::now() < give_up, "never {what}: {found}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_control_tells_that_its_parameters_are_not_kept_and_stays() {
    let name = format!("full-disk-{}", std::process::id());
    let machine = include_str!("../configs/mill3-demo.toml")
        .replace("\"mill3-demo\"", &format!("\"{name}\""))
        .replacen("kind = \"powerlink\"", "kind = \"memory\"", 1)
        .replace("\n[program]\n", "\n[program]\nparameter_file = \"disk/m.var\"\n")
        // However busy this PC is.
        .replace("\nlock_memory = true", "\noverruns_stop = 0\nlock_memory = true")
        .replace("pres_lost_max = 20", "pres_lost_max = 1000");
    let Some(folder) = folder(&machine) else {
        return;
    };
    let disk = folder.path().join("disk");
    std::fs::write(disk.join("m.var"), PARAMETERS).expect("there is room yet");
    let filler = fill(&disk);
    let journal = folder.path().join("journal");
    let control = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["run", "m.toml", "--json"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(File::create(&journal).expect("our folder"))
        .spawn()
        .expect("the binary runs");
    let mut control = Control(control);
    let told = || std::fs::read_to_string(&journal).expect("our folder");
    let program = || isocnc(folder.path(), &["program", "run", "part.ngc", "--machine", &name]);
    wait_for("begun", || match program() {
        output if output.status.success() => Ok(()),
        output => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
    });
    wait_for("told", || match told() {
        told if told.contains("not kept") && told.contains("m.var") && told.contains(FULL) => Ok(()),
        told => Err(told),
    });
    let parameters = || std::fs::read_to_string(disk.join("m.var")).expect("it is there");
    assert_eq!(parameters(), PARAMETERS);
    // It stays, and what it has in memory is kept as soon as there is room, without anybody asking.
    std::fs::remove_file(filler).expect("our file");
    wait_for("kept", || match parameters() {
        parameters if parameters.contains("5221\t5.000000\n") => Ok(()),
        parameters => Err(parameters),
    });
    kill(Pid::from_raw(control.0.id() as i32), Signal::SIGTERM).expect("our process");
    assert_eq!(testing::end(&mut control.0).code(), Some(143));
}

/// RETAIN variables of programs in Structured Text: as the rest of the state.
#[test]
fn a_control_tells_that_retained_variables_are_not_kept_and_keeps_them_once_there_is_room() {
    let name = format!("full-retain-{}", std::process::id());
    let machine = include_str!("../configs/mill3-demo.toml")
        .replace("\"mill3-demo\"", &format!("\"{name}\""))
        .replacen("kind = \"powerlink\"", "kind = \"memory\"", 1)
        .replace("\n[machine]\n", "\n[machine]\nstate_directory = \"disk/state\"\n")
        // However busy this PC is.
        .replace("\nlock_memory = true", "\noverruns_stop = 0\nlock_memory = true")
        .replace("pres_lost_max = 20", "pres_lost_max = 1000")
        + "[[logic]]\nfile = \"cell.st\"\nperiod_ms = 10\noverruns_stop = 0\n";
    let Some(folder) = folder(&machine) else {
        return;
    };
    let program = "PROGRAM cell VAR RETAIN n : LINT; END_VAR n := n + 1; END_PROGRAM";
    std::fs::write(folder.path().join("cell.st"), program).expect("our folder");
    let disk = folder.path().join("disk");
    let control = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["run", "m.toml", "--json"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("the binary runs");
    let _control = Control(control);
    let path = disk.join("state/logic-cell.retain");
    let kept = || -> Result<i64, String> {
        let text = std::fs::read(&path).map_err(|error| error.to_string())?;
        let kept = isocnc::machine::retain_file::parse(&text)?;
        let value = kept.variables.first().map(|variable| variable.value.parse());
        value.and_then(Result::ok).ok_or_else(|| "no value".into())
    };
    wait_for("kept", || kept().map(drop));
    let filler = fill(&disk);
    let status = || {
        let output = isocnc(folder.path(), &["status", "--json", "--machine", &name]);
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    wait_for("told", || match status() {
        status if status.contains("RETAIN variables are not kept") && status.contains(FULL) => Ok(()),
        status => Err(status),
    });
    let before = kept().expect("what was there is whole");
    std::fs::remove_file(filler).expect("our file");
    wait_for("kept again", || match kept() {
        Ok(n) if n > before => Ok(()),
        other => Err(format!("{other:?}")),
    });
}
