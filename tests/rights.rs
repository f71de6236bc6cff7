//! The control with the rights that people give it: as root, as an ordinary user by way of the file (`setcap`), and with
//! limits only. Each runs a program against a simulated machine at the other end of a private wire, and meanwhile the rights
//! of each of its threads are looked at.
//!
//! Like `private_wire`, this program has no test harness and runs itself again for each case. Where the system refuses what
//! a case needs, it prints the reason and passes.

use isocnc::config;
use isocnc::host::netns::{NetnsError, private_wire};
use isocnc::sim::READY;
use nix::sys::resource::{RLIM_INFINITY, Resource, setrlimit};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use testing::PATIENCE;

const CASE: &str = "ISOCNC_TEST_RIGHTS";
const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const PART: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5 Z0\nG1 X15 F3000\nG0 Z5\nM2\n";
const NOBODY: u32 = 65_534;
/// Runs of a program on a PC that may stand still for longer than lost polls are ridden out.
const ATTEMPTS: u32 = 4;
const DAC_OVERRIDE: u64 = 1 << 1;
const IPC_LOCK: u64 = 1 << 14;
const SCHED_FIFO: &str = "1";

pub(crate) fn main() {
    if let Ok(case) = std::env::var(CASE) {
        match act(&case) {
            Ok(()) => println!("DONE"),
            Err(reason) => println!("REFUSED: {reason}"),
        }
        return;
    }
    for case in ["root", "file capabilities", "limits only"] {
        if !nix::unistd::geteuid().is_root() {
            println!("rights with {case} ... SKIPPED: run as root");
            continue;
        }
        let mut command = Command::new(std::env::current_exe().unwrap());
        let output = command.env(CASE, case).current_dir("/").output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{case}: {said}\n{errors}");
        match said.split_once("REFUSED: ") {
            Some((_, reason)) => println!("rights with {case} ... SKIPPED: {}", reason.trim()),
            None => println!("rights with {case} ... ok"),
        }
    }
}

/// One case, in a process of its own. `Err`: the system refuses what it needs.
fn act(case: &str) -> Result<(), String> {
    match private_wire("plk0", "plk1") {
        Ok(_) => {}
        Err(error @ NetnsError::Forbidden { .. }) => return Err(error.to_string()),
        Err(error) => panic!("{error}"),
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o755)).unwrap();
    let rig = Rig::new(folder.path());
    match case {
        "root" => rig.runs_without_rights(None),
        "file capabilities" => {
            let mut setcap = Command::new("setcap");
            setcap.arg("cap_sys_nice,cap_ipc_lock,cap_net_raw+ep").arg(&rig.binary);
            let done = setcap.output().map_err(|cause| format!("setcap: {cause}"))?;
            if !done.status.success() {
                return Err(format!("setcap: {}", String::from_utf8_lossy(&done.stderr).trim()));
            }
            if rig.run(NOBODY).spawn().and_then(|mut child| child.kill()).is_err() {
                return Err("a program with file capabilities may not be started here".into());
            }
            rig.runs_without_rights(Some(NOBODY));
        }
        "limits only" => {
            let limits = [(Resource::RLIMIT_RTPRIO, 99), (Resource::RLIMIT_MEMLOCK, RLIM_INFINITY)];
            for (resource, limit) in limits {
                if let Err(errno) = setrlimit(resource, limit, limit) {
                    println!("{resource:?} cannot be raised ({errno}): as without it");
                }
            }
            let output = rig.run(NOBODY).output().unwrap();
            let errors = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{errors}");
            assert!(errors.contains("raw sockets need CAP_NET_RAW"), "{errors}");
            assert!(errors.contains("setcap"), "the cure is told: {errors}");
        }
        other => panic!("unknown case {other}"),
    }
    Ok(())
}

/// A machine, a program, and a copy of the binary that every user may start.
struct Rig {
    binary: PathBuf,
    machine: PathBuf,
    program: PathBuf,
    out: PathBuf,
}

impl Rig {
    fn new(folder: &Path) -> Rig {
        let rig = Rig {
            binary: folder.join("isocnc"),
            machine: folder.join("machine.toml"),
            program: folder.join("part.ngc"),
            out: folder.join("out"),
        };
        std::fs::copy(env!("CARGO_BIN_EXE_isocnc"), &rig.binary).unwrap();
        let config = config::parse(MACHINE, Path::new("mill3-demo.toml")).unwrap();
        let name = format!("rights-{}", std::process::id());
        let text = MACHINE.replace(&format!("\"{}\"", config.name), &format!("\"{name}\""));
        std::fs::write(&rig.machine, text).unwrap();
        std::fs::write(&rig.program, PART).unwrap();
        std::fs::create_dir(&rig.out).unwrap();
        // A folder of that user's: root needs a right to write its report there.
        chown(&rig.out, Some(NOBODY), Some(NOBODY)).unwrap();
        rig
    }

    fn run(&self, user: u32) -> Command {
        let mut command = Command::new(&self.binary);
        command
            .arg("run")
            .arg(&self.machine)
            .arg(&self.program)
            .arg("--out")
            .arg(&self.out);
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        command.uid(user).gid(user);
        command
    }

    /// Runs a program to its end; while it runs, no thread has a right that it does not need.
    fn runs_without_rights(&self, user: Option<u32>) {
        for attempt in 1..=ATTEMPTS {
            let machine = self.far_machine();
            let mut control = self.run(user.unwrap_or(0)).spawn().unwrap();
            let fifo = watch(&mut control);
            let Output { status, stderr, .. } = control.wait_with_output().unwrap();
            let errors = String::from_utf8_lossy(&stderr).into_owned();
            drop(machine);
            let report = std::fs::read_to_string(self.out.join("run.json")).unwrap_or_default();
            assert!(!report.is_empty(), "no report: {errors}");
            let refused = errors.contains("real time, priority");
            assert_eq!(fifo, Some(!refused), "SCHED_FIFO; {errors}");
            if status.success() {
                return;
            }
            println!("attempt {attempt}: {status}\n{report}\n{errors}");
        }
        panic!("no run was completed");
    }

    fn far_machine(&self) -> FarMachine {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        command.arg("simulate").arg(&self.machine);
        command
            .args(["--interface", "plk1", "--with-parent"])
            .arg(std::process::id().to_string())
            .stdout(Stdio::piped());
        let mut process = command.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        assert_eq!(line.trim(), READY);
        FarMachine(process)
    }
}

struct FarMachine(Child);

impl Drop for FarMachine {
    fn drop(&mut self) {
        // Gone already in the ordinary case.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A thread as the kernel shows it.
#[derive(Debug)]
struct Thread {
    name: String,
    permitted: u64,
    effective: u64,
    no_new_privileges: bool,
    fifo: bool,
}

/// Waits until the control has given up its rights, and checks them; whether its cycle thread is SCHED_FIFO. `None`: it
/// ended before.
fn watch(control: &mut Child) -> Option<bool> {
    let give_up = Instant::now() + PATIENCE;
    loop {
        if control.try_wait().unwrap().is_some() {
            return None;
        }
        let threads = threads(control.id());
        let names: Vec<&str> = threads.iter().map(|thread| thread.name.as_str()).collect();
        let started = ["rt-cycle", "rt-timeout", "service"]
            .iter()
            .all(|name| names.contains(name));
        if started && threads.iter().all(|thread| thread.no_new_privileges) {
            for thread in &threads {
                let kept = match thread.name.as_str() {
                    "rt-cycle" | "rt-timeout" | "keep-awake" => 0,
                    "isocnc" => IPC_LOCK | DAC_OVERRIDE,
                    _ => IPC_LOCK,
                };
                assert_eq!(thread.permitted & !kept, 0, "{thread:?}");
                assert_eq!(thread.effective & !IPC_LOCK, 0, "{thread:?}");
            }
            return threads
                .iter()
                .find(|thread| thread.name == "rt-cycle")
                .map(|thread| thread.fifo);
        }
        assert!(Instant::now() < give_up, "rights are kept: {threads:#?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn threads(process: u32) -> Vec<Thread> {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task"))
        .into_iter()
        .flatten()
        .flatten();
    // A thread may end while it is looked at.
    tasks.filter_map(|task| thread(&task.path())).collect()
}

fn thread(task: &Path) -> Option<Thread> {
    let status = std::fs::read_to_string(task.join("status")).ok()?;
    let field = |name: &str| {
        status
            .lines()
            .find_map(|line| line.strip_prefix(name)?.strip_prefix(":\t"))
    };
    let set = |name| u64::from_str_radix(field(name)?, 16).ok();
    let stat = std::fs::read_to_string(task.join("stat")).ok()?;
    // The 41st field is the policy; the name before the third may contain anything.
    let (_, behind_name) = stat.rsplit_once(") ")?;
    Some(Thread {
        name: field("Name")?.to_owned(),
        permitted: set("CapPrm")?,
        effective: set("CapEff")?,
        no_new_privileges: field("NoNewPrivs")? == "1",
        fifo: behind_name.split_whitespace().nth(41 - 3)? == SCHED_FIFO,
    })
}
