//! The control as a service of systemd: what it tells, over a socket of our own, and the unit file that goes with it.
//!
//! Nothing here needs systemd to run.

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use testing::PATIENCE;

/// Half a minute of motion.
const LONG: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5 Z0\nG1 X200 F400\nM2\n";
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
const UNIT: &str = include_str!("../configs/isocnc.service");

/// The machine of the demo on a wire in memory; it bears what a busy PC does to it.
fn machine() -> String {
    let mut text = include_str!("../configs/mill3-demo.toml").to_owned();
    for (given, own) in [
        (
            "name = \"mill3-demo\"",
            format!("name = \"systemd-{}\"", std::process::id()),
        ),
        ("kind = \"powerlink\"", "kind = \"memory\"".to_owned()),
        ("pres_lost_max = 20", "pres_lost_max = 100".to_owned()),
        ("following_error_mm = 2.0", "following_error_mm = 20.0".to_owned()),
        ("calibrate = true", "overruns_stop = 0\ncalibrate = true".to_owned()),
    ] {
        assert!(text.contains(given), "{given}");
        text = text.replace(given, &own);
    }
    text
}

/// A control that takes this test for systemd.
struct Service {
    process: Child,
    socket: UnixDatagram,
    _folder: TempDir,
    told: Vec<String>,
    /// A thread that this test has stopped.
    frozen: Option<i32>,
    _alone: MutexGuard<'static, ()>,
}

impl Service {
    fn start(watchdog: Duration) -> Service {
        // Two cycles on one core would take time from each other.
        let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        let [machine_file, program] = ["machine.toml", "part.ngc"].map(|name| folder.path().join(name));
        std::fs::write(&machine_file, machine()).unwrap();
        std::fs::write(&program, LONG).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        command.args(["run", "--json"]).arg(&machine_file).arg(&program);
        command.arg("--out").arg(folder.path().join("out"));
        command
            .env("NOTIFY_SOCKET", &path)
            .env("WATCHDOG_USEC", watchdog.as_micros().to_string())
            .env_remove("WATCHDOG_PID")
            .stdout(Stdio::null());
        Service {
            process: command.spawn().unwrap(),
            socket,
            _folder: folder,
            told: Vec::new(),
            frozen: None,
            _alone: alone,
        }
    }

    /// The next message, if one comes within this time.
    fn hear(&mut self, within: Duration) -> Option<String> {
        let mut octets = [0; 4096];
        self.socket.set_read_timeout(Some(within)).unwrap();
        let length = self.socket.recv(&mut octets).ok()?;
        let text = std::str::from_utf8(&octets[..length]).unwrap().to_owned();
        self.told.extend(text.lines().map(str::to_owned));
        Some(text)
    }

    fn hear_until(&mut self, line: &str) {
        let give_up = Instant::now() + PATIENCE;
        while !self.told.iter().any(|told| told.starts_with(line)) {
            assert!(Instant::now() < give_up, "never told {line}: {:?}", self.told);
            self.hear(Duration::from_millis(100));
        }
    }

    fn place(&self, line: &str) -> usize {
        let found = self.told.iter().position(|told| told.starts_with(line));
        found.unwrap_or_else(|| panic!("{line} was not told: {:?}", self.told))
    }

    fn is_running(&mut self) -> bool {
        if let Some(thread) = self.frozen {
            // A thread that is traced stays, even dead, until its tracer has heard of it; and its process as long.
            // SAFETY: without a place for the status no memory of ours is touched.
            unsafe { libc::waitpid(thread, std::ptr::null_mut(), libc::__WALL | libc::WNOHANG) };
        }
        self.process.try_wait().unwrap().is_none()
    }

    fn thread(&self, name: &str) -> i32 {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.process.id())).unwrap();
        let mut tasks = tasks.flatten().filter(|task| {
            let comm = std::fs::read_to_string(task.path().join("comm"));
            comm.is_ok_and(|comm| comm.trim() == name)
        });
        let task = tasks.next().expect("a thread of this name");
        task.file_name().to_str().unwrap().parse().unwrap()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // Gone already where the test went well.
        let _ = self.process.kill();
        while self.is_running() {
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

#[test]
fn a_service_tells_what_it_does_from_start_to_end() {
    let mut service = Service::start(Duration::from_secs(2));
    service.hear_until("STATUS=running");
    assert!(service.place("STATUS=booting") < service.place("READY=1"));
    assert!(service.place("READY=1") < service.place("STATUS=enabling"));
    assert!(service.place("STATUS=ready") < service.place("STATUS=homing"));
    assert!(
        service.place("WATCHDOG=1") < service.place("STATUS=running"),
        "booting and homing take seconds"
    );
    assert!(!service.told.iter().any(|told| told.starts_with("STOPPING")));
    // A sign of life later it is well on its way, so that it takes a while to stop.
    let signs = |service: &Service| service.told.iter().filter(|told| *told == "WATCHDOG=1").count();
    let before = signs(&service);
    while signs(&service) == before {
        service.hear(Duration::from_millis(100));
    }
    kill(Pid::from_raw(service.process.id() as i32), Signal::SIGTERM).unwrap();
    service.hear_until("STATUS=down");
    assert!(service.place("STOPPING=1") < service.place("STATUS=stopping"));
    assert_eq!(testing::end(&mut service.process).code(), Some(143));
    let ready = service.told.iter().filter(|told| *told == "READY=1").count();
    assert_eq!(ready, 1);
}

#[test]
fn a_hung_cycle_thread_gives_no_sign_of_life() {
    let mut service = Service::start(Duration::from_secs(2));
    service.hear_until("STATUS=running");
    service.told.clear();
    service.hear_until("WATCHDOG=1");
    let cycle = service.thread("rt-cycle");
    if let Err(reason) = freeze(cycle) {
        println!("a_hung_cycle_thread ... SKIPPED: one thread cannot be stopped: {reason}");
        return;
    }
    service.frozen = Some(cycle);
    service.told.clear();
    // Until the control takes its cycle thread for dead and ends; systemd would have ended it before.
    while service.is_running() {
        service.hear(Duration::from_millis(100));
    }
    assert_eq!(testing::end(&mut service.process).code(), Some(3), "to be restarted");
    let signs = service.told.iter().filter(|told| *told == "WATCHDOG=1").count();
    assert!(
        signs <= 1,
        "{signs} signs; one is for cycles before it hung: {:?}",
        service.told
    );
}

#[test]
fn a_control_whose_time_out_thread_hangs_comes_to_rest_and_ends_to_be_started_anew() {
    let mut service = Service::start(Duration::from_secs(2));
    service.hear_until("STATUS=running");
    let watcher = service.thread("rt-timeout");
    if let Err(reason) = freeze(watcher) {
        println!("a_control_whose_time_out_thread_hangs ... SKIPPED: one thread cannot be stopped: {reason}");
        return;
    }
    service.frozen = Some(watcher);
    service.hear_until("STATUS=down");
    assert!(
        service.place("STATUS=stopping") < service.place("STATUS=down"),
        "{:?}",
        service.told
    );
    let alarm = service
        .told
        .iter()
        .find(|told| told.contains("alarm: the time-out thread hung"));
    assert!(alarm.is_some(), "{:?}", service.told);
    while service.is_running() {
        service.hear(Duration::from_millis(100));
    }
    assert_eq!(testing::end(&mut service.process).code(), Some(3));
}

/// Stops one thread of a child.
fn freeze(thread: i32) -> std::io::Result<()> {
    for request in [libc::PTRACE_SEIZE, libc::PTRACE_INTERRUPT] {
        // SAFETY: neither request takes memory of ours.
        if unsafe { libc::ptrace(request, thread, 0, 0) } != 0 {
            return Err(std::io::Error::last_os_error());
        }
    }
    Ok(())
}

/// `key=value` lines by section; a key that is given twice keeps both.
fn unit() -> BTreeMap<(String, String), Vec<String>> {
    let mut section = String::new();
    let mut keys: BTreeMap<_, Vec<String>> = BTreeMap::new();
    for line in UNIT
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
    {
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            section = name.to_owned();
            continue;
        }
        let (key, value) = line.split_once('=').unwrap_or_else(|| panic!("{line:?} is no setting"));
        keys.entry((section.clone(), key.to_owned()))
            .or_default()
            .push(value.to_owned());
    }
    keys
}

#[test]
fn the_unit_leaves_real_time_its_rights_and_never_starts_a_program() {
    let unit = unit();
    let service = |key: &str| -> Vec<&str> {
        let found = unit.get(&("Service".to_owned(), key.to_owned()));
        found.into_iter().flatten().map(String::as_str).collect()
    };
    for (key, value) in [
        ("Type", "notify"),
        ("NotifyAccess", "main"),
        ("LimitRTPRIO", "99"),
        ("LimitMEMLOCK", "infinity"),
        ("CapabilityBoundingSet", "CAP_NET_RAW"),
        ("AmbientCapabilities", "CAP_NET_RAW"),
        ("NoNewPrivileges", "yes"),
        ("DeviceAllow", "/dev/cpu_dma_latency rw"),
        ("SuccessExitStatus", "143"),
    ] {
        assert_eq!(service(key), [value], "{key}");
    }
    for key in [
        "RestrictRealtime",
        "PrivateDevices",
        "PrivateNetwork",
        "PrivateUsers",
        "CPUSchedulingPolicy",
    ] {
        assert_eq!(
            service(key),
            [""; 0],
            "{key} would take away what real time or the bus needs"
        );
    }
    let [watchdog] = service("WatchdogSec")[..] else {
        panic!("one WatchdogSec")
    };
    assert!(watchdog.parse::<u32>().unwrap() > 0);
    // What is started, again and again: a machine and no program, so that nothing moves by itself.
    let [command] = service("ExecStart")[..] else {
        panic!("one ExecStart")
    };
    let words: Vec<&str> = command.split_whitespace().collect();
    assert_eq!(words, ["/usr/local/bin/isocnc", "run", "/etc/isocnc/machine.toml"]);
}

#[test]
fn systemd_finds_nothing_wrong_with_the_unit() {
    if Command::new("systemd-analyze").arg("--version").output().is_err() {
        println!("systemd_finds_nothing_wrong_with_the_unit ... SKIPPED: no systemd-analyze here");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("isocnc.service");
    // The program and its user are not installed where it is tested.
    let unit = UNIT
        .replace("/usr/local/bin/isocnc", env!("CARGO_BIN_EXE_isocnc"))
        .replace("User=isocnc\nGroup=isocnc\n", "");
    std::fs::write(&path, unit).unwrap();
    let (good, said) = verify(&path);
    assert!(good, "{said}");
    assert!(!said.contains("isocnc.service:"), "{said}");
}

fn verify(unit: &Path) -> (bool, String) {
    let mut command = Command::new("systemd-analyze");
    let output = command.args(["verify", "--man=no"]).arg(unit).output().unwrap();
    (
        output.status.success(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

/// The journal of a service shows how grave a line is (`journalctl -p warning`); a terminal is spared the numbers.
#[test]
fn lines_for_the_journal_of_systemd_begin_with_their_priority() {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let [machine_file, output] = ["machine.toml", "output"].map(|name| folder.path().join(name));
    std::fs::write(&machine_file, machine()).unwrap();
    for to_journal in [true, false] {
        let file = std::fs::File::create(&output).unwrap();
        let number = file.metadata().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        command.arg("run").arg(&machine_file).stdout(file);
        if to_journal {
            command.env("JOURNAL_STREAM", format!("{}:{}", number.dev(), number.ino()));
        }
        let mut control = command.spawn().unwrap();
        let give_up = Instant::now() + PATIENCE;
        let text = loop {
            let text = std::fs::read_to_string(&output).unwrap();
            if text.contains("machine disabled") {
                break text;
            }
            assert!(
                Instant::now() < give_up && control.try_wait().unwrap().is_none(),
                "{text}"
            );
            std::thread::sleep(Duration::from_millis(20));
        };
        kill(Pid::from_raw(control.id() as i32), Signal::SIGTERM).unwrap();
        testing::end(&mut control);
        let line = text.lines().find(|line| line.ends_with("machine disabled")).unwrap();
        assert_eq!(line.starts_with("<6>"), to_journal, "{text}");
    }
}

#[test]
fn a_log_that_nobody_can_mean_is_refused_with_what_can_be_meant() {
    for (variable, value) in [("ISOCNC_LOG", "loud"), ("ISOCNC_LOG_FORMAT", "xml")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        let refused = command.arg("schema").env(variable, value).output().unwrap();
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(
            said.contains(variable) && said.contains(value) && said.contains("expected"),
            "{said}"
        );
    }
}
