//! What the real-time threads ask of the kernel, counted by number while a control runs on a real veth pair, a program in Structured
//! Text beside it, and an oscilloscope of another process looks on.
//!
//! This program is the tracer (ptrace) of the control that it starts: it attaches to the threads `rt-cycle`, `rt-timeout` and
//! `rt-logic 0` one after the other and lets them run from call to call. That takes time, so the machine runs a cycle of 10 ms, and
//! nothing here looks at times: only which calls there are and how many to a cycle.
//!
//! No test harness, for a namespace is entered by a process of one thread. Where the system allows no private network or no
//! tracing, it prints the reason and passes.

use hal_pins::Attached;
use isocnc::host::netns::private_wire;
use isocnc::machine::state::State;
use nix::errno::Errno;
use nix::libc;
use nix::sys::ptrace::{self, Options};
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::Pid;
use powerlink::wire::message;
use std::collections::BTreeMap;
use std::fs::read_to_string;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use testing::PATIENCE;

const LOGIC: &str = include_str!("../configs/cell/plant.st");
/// Some minutes of motion, cut short by the end of the test.
const PROGRAM: &str = "G21 G90 G94 G54\nG0 X5 Y5\nG1 X200 F200\nM2\n";
const NODES: usize = 4;
/// Cycles that are looked at, and ticks of the time-out thread.
const CYCLES: usize = 200;
const TICKS: usize = 400;
/// Looks of the thread of the program in Structured Text.
const LOOKS: usize = 200;

/// What the cycle thread may ask for: to sleep, to send, to wait for an answer or fetch it, whether the interface still runs,
/// and under PREEMPT_RT the ways through the locks of the network (`crates/host/src/network_locks.rs`).
const CYCLE_CALLS: [i64; 8] = [
    libc::SYS_clock_nanosleep,
    libc::SYS_sendto,
    libc::SYS_ppoll,
    libc::SYS_recvmsg,
    libc::SYS_recvfrom,
    libc::SYS_getsockopt,
    libc::SYS_ioctl,
    libc::SYS_write,
];
/// What the time-out thread may ask for: to sleep; once in 1024 ticks, how long it has run; and at a tick at which the cycle
/// thread is overdue, as on a busy PC, how long that has run.
const TIMEOUT_CALLS: [i64; 2] = [libc::SYS_clock_nanosleep, libc::SYS_clock_gettime];

/// What a program in Structured Text may ask for: to sleep until its scan is due.
const LOGIC_CALLS: [i64; 1] = [libc::SYS_clock_nanosleep];

pub(crate) fn main() {
    if let Err(refused) = private_wire("plk0", "plk1") {
        println!("system_calls ... SKIPPED: {refused}");
        return;
    }
    let clock = read_to_string("/sys/devices/system/clocksource/clocksource0/current_clocksource").unwrap_or_default();
    if !matches!(
        clock.trim(),
        "tsc" | "kvm-clock" | "hyperv_clocksource_tsc_page" | "arch_sys_counter"
    ) {
        println!(
            "system_calls ... SKIPPED: each look at the clock source {} is a system call",
            clock.trim()
        );
        return;
    }
    if [POWERLINK, ETHERCAT].iter().all(|bus| count(bus).is_some()) {
        println!("system_calls ... ok");
    }
}

/// What is counted differently on each bus.
struct Bus {
    name: &'static str,
    machine: &'static str,
    /// Its own changes of the machine file.
    changes: &'static [(&'static str, &'static str)],
    /// Octet of a frame that says what it is.
    kind_at: u64,
    /// Whether such a frame begins a cycle.
    begins: fn(u8) -> bool,
    /// Whether the frames of a cycle, by that octet, are all that it has.
    check: fn(&[u8]) -> Result<bool, String>,
}

const POWERLINK: Bus = Bus {
    name: "POWERLINK",
    machine: include_str!("../configs/mill3-demo.toml"),
    changes: &[
        ("pres_timeout_us = 150", "pres_timeout_us = 1500"),
        ("async_slot_timeout_us = 150", "async_slot_timeout_us = 1500"),
        ("pres_lost_max = 20", "pres_lost_max = 900"),
    ],
    // The message type.
    kind_at: 14,
    begins: |kind| kind == message::SOC,
    check: |frames| {
        let counts = [message::SOC, message::PREQ, message::SOA, message::ASND]
            .map(|kind| frames.iter().filter(|frame| **frame == kind).count());
        // A cycle that the tracer has made late leaves polls out; none sends more than it should.
        let most = [1, NODES, 1, 1];
        if counts.iter().zip(most).any(|(count, most)| *count > most) || frames.len() != counts.iter().sum::<usize>() {
            return Err(format!(
                "frames {counts:?} (SoC, PReq, SoA, ASnd) in {} sends, at most {most:?}",
                frames.len()
            ));
        }
        Ok(counts[..3] == [1, NODES, 1])
    },
};

const ETHERCAT: Bus = Bus {
    name: "EtherCAT",
    machine: include_str!("../configs/mill3-ethercat.toml"),
    changes: &[("lost_max = 20", "lost_max = 900")],
    // The index of the first datagram: that of the cycle, or from 80h on of a service.
    kind_at: 17,
    begins: |kind| kind < SERVICES_FROM,
    check: |frames| {
        let services = frames[1..].iter().filter(|kind| **kind >= SERVICES_FROM).count();
        if frames.len() != 1 + services || services > SERVICES {
            return Err(format!(
                "frames {frames:02X?}: one with process data, then {SERVICES} of services at most"
            ));
        }
        Ok(true)
    },
};

/// Indices of the datagrams of services begin here.
const SERVICES_FROM: u8 = 0x80;
/// Frames of services in a cycle of 10 ms: a look into the mailboxes of all drives, and what one that is full brings.
const SERVICES: usize = 4;

/// Counts on a bus; `None`, with the reason printed, where tracing is not allowed.
fn count(bus: &Bus) -> Option<()> {
    let folder = tempfile::tempdir().expect("a folder");
    let name = format!("system-calls-{}-{}", bus.kind_at, std::process::id());
    let machine = folder.path().join("machine.toml");
    let its_name = bus.machine.lines().find(|line| line.starts_with("name = "));
    let new_name = format!("name = \"{name}\"");
    let usual = [
        (its_name.expect("a name"), &new_name[..]),
        ("cycle_us = 1000", "cycle_us = 10000"),
        ("following_error_mm = 2.0", "following_error_mm = 20.0"),
        ("calibrate = true", "calibrate = false"),
    ];
    let mut text = bus.machine.to_owned();
    for (from, to) in usual.iter().chain(bus.changes) {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    text += "[[logic]]\nfile = \"plant.st\"\nperiod_ms = 10\n";
    std::fs::write(folder.path().join("plant.st"), LOGIC).expect("our folder");
    std::fs::write(&machine, text).expect("our folder");
    let program = folder.path().join("program.ngc");
    std::fs::write(&program, PROGRAM).expect("our folder");

    let _simulated = Running::start(&["simulate", path(&machine), "--interface", "plk1"], true);
    // In stand-by: on a busy PC the machine may stop with an alarm meanwhile, and its threads go on all the same.
    let control = Running::start(&["run", path(&machine)], false);
    set_in_motion(&name, &program);
    let mut scope = Running::start(
        &["hal", "scope", "--machine", &name, "--follow", "joint.*.motor-*"],
        false,
    );

    let tid = thread(control.pid(), "rt-cycle").expect("the cycle thread");
    let begins = |call: &&Call| call.frame.is_some_and(bus.begins);
    let calls = trace(tid, bus, |calls| calls.iter().filter(begins).count() > CYCLES)?;
    let cycles = cycles(bus, &calls);
    check_cycles(bus, &cycles, &CYCLE_CALLS).unwrap_or_else(|wrong| panic!("{wrong}"));
    // The same with an expectation that is wrong: it is found.
    let without_send: Vec<i64> = CYCLE_CALLS
        .into_iter()
        .filter(|call| *call != libc::SYS_sendto)
        .collect();
    let wrong = check_cycles(bus, &cycles, &without_send).expect_err("a call that is not allowed");
    assert!(wrong.contains(&format!("system call {}", libc::SYS_sendto)), "{wrong}");
    let doubled: Vec<Vec<Call>> = cycles.iter().map(|cycle| [&cycle[..], &cycle[..]].concat()).collect();
    let wrong = check_cycles(bus, &doubled, &CYCLE_CALLS).expect_err("each frame twice");
    assert!(wrong.contains("frames"), "{wrong}");
    println!(
        "{}: rt-cycle: {} cycles; {}",
        bus.name,
        cycles.len(),
        summary(&cycles.concat(), cycles.len())
    );

    let tid = thread(control.pid(), "rt-timeout").expect("the time-out thread");
    let calls = trace(tid, bus, |calls| calls.len() > TICKS)?;
    check_calls(&calls, &TIMEOUT_CALLS).unwrap_or_else(|wrong| panic!("{wrong}"));
    let sleeps = calls
        .iter()
        .filter(|call| call.number == libc::SYS_clock_nanosleep)
        .count();
    let own_time = calls.iter().filter(|call| call.asks_for_own_time()).count();
    assert!(
        own_time <= 1 + TICKS / 1024,
        "its own time once in 1024 ticks, not {own_time} times in {sleeps}"
    );
    assert!(
        calls.len() <= 2 * sleeps + own_time + 1,
        "one more call a tick at the most: {}",
        summary(&calls, sleeps)
    );
    check_calls(&calls, &[]).expect_err("nothing is allowed");
    println!("{}: rt-timeout: {sleeps} ticks; {}", bus.name, summary(&calls, sleeps));

    let tid = thread(control.pid(), "rt-logic 0").expect("the thread of the program");
    let calls = trace(tid, bus, |calls| calls.len() > LOOKS)?;
    check_calls(&calls, &LOGIC_CALLS).unwrap_or_else(|wrong| panic!("{wrong}"));
    println!("{}: rt-logic 0: {}", bus.name, summary(&calls, calls.len()));
    assert!(
        scope.0.try_wait().expect("our child").is_none(),
        "the oscilloscope looks on"
    );
    Some(())
}

/// One call, as it was entered.
#[derive(Clone, Copy, Debug)]
struct Call {
    number: i64,
    /// The first argument; of a look at a clock, which one.
    argument: u64,
    /// What the frame is that is sent, by the octet of its bus.
    frame: Option<u8>,
}

impl Call {
    fn asks_for_own_time(&self) -> bool {
        self.number == libc::SYS_clock_gettime && self.argument == libc::CLOCK_THREAD_CPUTIME_ID as u64
    }
}

/// The calls of each cycle, from its first frame to before that of the next; what was begun and not ended is left out.
fn cycles(bus: &Bus, calls: &[Call]) -> Vec<Vec<Call>> {
    let begins = |at: &usize| calls[*at].frame.is_some_and(bus.begins);
    let begins: Vec<usize> = (0..calls.len()).filter(begins).collect();
    begins.windows(2).map(|pair| calls[pair[0]..pair[1]].to_vec()).collect()
}

fn check_calls(calls: &[Call], allowed: &[i64]) -> Result<(), String> {
    match calls.iter().find(|call| !allowed.contains(&call.number)) {
        Some(call) => Err(format!(
            "system call {} is not one that real time may make",
            call.number
        )),
        None => Ok(()),
    }
}

fn check_cycles(bus: &Bus, cycles: &[Vec<Call>], allowed: &[i64]) -> Result<(), String> {
    let mut complete = 0;
    for (at, cycle) in cycles.iter().enumerate() {
        check_calls(cycle, allowed)?;
        let frames: Vec<u8> = cycle.iter().filter_map(|call| call.frame).collect();
        complete += usize::from((bus.check)(&frames).map_err(|wrong| format!("cycle {at}: {wrong}"))?);
        // One for each sleep: a date that has passed is slept for again.
        let of = |number: i64| cycle.iter().filter(|call| call.number == number).count();
        let locks_max = if is_preempt_rt() {
            of(libc::SYS_clock_nanosleep)
        } else {
            0
        };
        for (number, lock) in [
            (libc::SYS_ioctl, "soft interrupts"),
            (libc::SYS_write, "packets' memory"),
        ] {
            let passes = of(number);
            if passes > locks_max {
                return Err(format!(
                    "cycle {at}: {passes} ways through the lock of {lock}, at most {locks_max}"
                ));
            }
        }
        // Each receive sleeps at the most once for its answer and once more for a frame that is none; the look at the
        // interface comes once a millisecond.
        let waits = cycle.len() - frames.len();
        if waits > 60 {
            return Err(format!(
                "cycle {at}: {waits} calls beside the sends: {}",
                summary(cycle, 1)
            ));
        }
    }
    if complete == 0 {
        return Err(format!("no complete cycle among {}", cycles.len()));
    }
    Ok(())
}

fn is_preempt_rt() -> bool {
    read_to_string("/sys/kernel/realtime").is_ok_and(|text| text.trim() == "1")
}

/// How often each call was made to a cycle, on average.
fn summary(calls: &[Call], cycles: usize) -> String {
    let mut counts = BTreeMap::<i64, usize>::new();
    for call in calls {
        *counts.entry(call.number).or_default() += 1;
    }
    let name = |number: i64| match number {
        libc::SYS_clock_nanosleep => "clock_nanosleep".to_owned(),
        libc::SYS_sendto => "sendto".to_owned(),
        libc::SYS_ppoll => "ppoll".to_owned(),
        libc::SYS_recvmsg => "recvmsg".to_owned(),
        libc::SYS_recvfrom => "recvfrom".to_owned(),
        libc::SYS_getsockopt => "getsockopt".to_owned(),
        libc::SYS_ioctl => "ioctl".to_owned(),
        libc::SYS_write => "write".to_owned(),
        libc::SYS_clock_gettime => "clock_gettime".to_owned(),
        number => format!("system call {number}"),
    };
    let each = |(number, count): (&i64, &usize)| format!("{} {:.2}", name(*number), *count as f64 / cycles as f64);
    counts.iter().map(each).collect::<Vec<_>>().join(", ")
}

/// The calls that a thread makes until there are enough; `None`, with the reason printed, where tracing is not allowed.
fn trace(tid: Pid, bus: &Bus, enough: impl Fn(&[Call]) -> bool) -> Option<Vec<Call>> {
    match ptrace::seize(tid, Options::PTRACE_O_TRACESYSGOOD) {
        Ok(()) => {}
        Err(errno @ (Errno::EPERM | Errno::ENOSYS)) => {
            println!("system_calls ... SKIPPED: tracing is not allowed here ({errno})");
            return None;
        }
        Err(errno) => panic!("thread {tid}: {errno}"),
    }
    ptrace::interrupt(tid).expect("our tracee");
    let mut calls = Vec::new();
    let give_up = Instant::now() + PATIENCE;
    loop {
        match waitpid(tid, Some(WaitPidFlag::__WALL)).expect("our tracee") {
            WaitStatus::PtraceSyscall(_) => calls.extend(entered(tid, bus)),
            WaitStatus::Exited(..) | WaitStatus::Signaled(..) => {
                panic!("thread {tid} ended after {} calls", calls.len())
            }
            _ => {}
        }
        if enough(&calls) {
            break;
        }
        assert!(Instant::now() < give_up, "only {} calls in {PATIENCE:?}", calls.len());
        ptrace::syscall(tid, None).expect("our tracee");
    }
    ptrace::detach(tid, None).expect("our tracee");
    Some(calls)
}

/// The call that a stopped thread is about to make; `None` where it comes back from one.
fn entered(tid: Pid, bus: &Bus) -> Option<Call> {
    let info = ptrace::syscall_info(tid).expect("a stopped thread");
    if info.op != libc::PTRACE_SYSCALL_INFO_ENTRY {
        return None;
    }
    // SAFETY: `op` says that the kernel has filled in the part of an entry.
    let entry = unsafe { info.u.entry };
    let number = entry.nr as i64;
    let frame = (number == libc::SYS_sendto).then(|| {
        let word = ptrace::read(tid, (entry.args[1] + bus.kind_at) as ptrace::AddressType);
        word.expect("the frame that is sent").to_ne_bytes()[0]
    });
    Some(Call {
        number,
        argument: entry.args[0],
        frame,
    })
}

/// The thread of this name in a process.
fn thread(process: u32, name: &str) -> Option<Pid> {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).ok()?;
    tasks.flatten().find_map(|task| {
        let comm = read_to_string(task.path().join("comm")).ok()?;
        let tid = task.file_name().to_str()?.parse().ok()?;
        (comm.trim() == name).then(|| Pid::from_raw(tid))
    })
}

/// Runs a program as soon as the machine stands by, and waits until it moves.
fn set_in_motion(machine: &str, program: &Path) {
    let give_up = Instant::now() + PATIENCE;
    let running = (State::Running as u32).to_string();
    let order = ["program", "run", path(program), "--no-wait", "--machine", machine];
    let mut is_ordered = false;
    loop {
        if !is_ordered {
            let mut isocnc = Command::new(env!("CARGO_BIN_EXE_isocnc"));
            let said = isocnc.args(order).output().expect("the binary runs");
            is_ordered = said.status.success();
        }
        let state = Attached::attach(machine).and_then(|pins| pins.get("motion.machine-state"));
        if state.is_ok_and(|pin| pin.value.to_string() == running) {
            return;
        }
        assert!(Instant::now() < give_up, "{machine} does not run");
        sleep(Duration::from_millis(50));
    }
}

fn path(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// A process of ours.
struct Running(Child);

impl Running {
    fn start(arguments: &[&str], wait_for_ready: bool) -> Running {
        let mut process = Command::new(env!("CARGO_BIN_EXE_isocnc"))
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(if wait_for_ready { Stdio::piped() } else { Stdio::null() })
            .spawn()
            .expect("the binary runs");
        if wait_for_ready {
            let mut line = String::new();
            let stdout = process.stdout.take().expect("a pipe");
            BufReader::new(stdout).read_line(&mut line).expect("a line");
            assert_eq!(line.trim(), "ready");
        }
        Running(process)
    }

    fn pid(&self) -> u32 {
        self.0.id()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Ours, and of no more use.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
