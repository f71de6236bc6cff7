//! What real time needs from the PC: one core, FIFO priority, locked memory, no deep sleep.
//!
//! In:  `[rt]` of the machine file.
//! Out: a prepared process, real-time threads, and one [`Finding`] for each thing that is missing, with its cure.
//!
//! [`prepare_process`] runs once, before any thread of the control starts; [`enter_thread`] runs in each real-time thread
//! before its loop, and after it that thread allocates nothing. With `require = "strict"` anything missing is a refusal.

use super::rights::{self, Work};
use crate::config::{Require, Rt};
use core_affinity::CoreId;
use nix::errno::Errno;
use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
use nix::sys::signal::SigSet;
use nix::unistd::Pid;
use std::fmt;
use std::fs::{File, OpenOptions, read_to_string};
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
    thread_native_id,
};

/// Stack of a real-time thread, octets; all of it is real memory when memory is locked.
pub const STACK_SIZE: usize = 512 * 1024;
/// How much of the stack is touched before the first cycle.
const STACK_PREFAULT: usize = 256 * 1024;
/// Memory that the allocator gets and keeps from the start.
const HEAP_RESERVE: usize = 4 * 1024 * 1024;
const PAGE: usize = 4096;
/// Numbers of capabilities, as in `linux/capability.h`.
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;
const CPUIDLE_DRIVER: &str = "/sys/devices/system/cpu/cpuidle/current_driver";
const DMA_LATENCY: &str = "/dev/cpu_dma_latency";
/// The cure for most missing rights.
const RIGHTS: &str = "run as root, or grant 'rtprio 99' and 'memlock unlimited' in /etc/security/limits.d, or \
                      'setcap cap_sys_nice,cap_ipc_lock,cap_net_raw+ep' on the program";

/// What is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Item {
    /// PREEMPT_RT.
    Kernel,
    /// High-resolution timers.
    Timers,
    /// The core of the real-time threads.
    Core,
    /// SCHED_FIFO.
    Priority,
    /// Locked memory.
    Memory,
    /// No deep idle states.
    IdleStates,
    /// Blocked signals and timer slack of a real-time thread.
    Thread,
}

impl Item {
    /// A short name.
    pub const fn name(self) -> &'static str {
        match self {
            Item::Kernel => "kernel",
            Item::Timers => "timers",
            Item::Core => "core",
            Item::Priority => "priority",
            Item::Memory => "memory",
            Item::IdleStates => "idle states",
            Item::Thread => "thread",
        }
    }
}

/// One thing that is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// What was looked at.
    pub item: Item,
    /// What was found.
    pub what: String,
    /// How to change it.
    pub fix: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "real time, {}: {}; {}", self.item.name(), self.what, self.fix)
    }
}

/// `require = "strict"` and something is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// All that is missing.
    pub findings: Vec<Finding>,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "this PC lacks what rt.require = \"strict\" asks for (\"warn\" would run all the same):"
        )?;
        self.findings.iter().try_for_each(|finding| write!(f, "\n  {finding}"))
    }
}

impl std::error::Error for Refusal {}

/// What a real-time thread is there for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The bus cycle; runs at `rt.priority`.
    Cycle,
    /// The time limits; runs one above.
    Timeout,
    /// The simulated machine on the same PC: two above, so that it answers at once while the cycle thread waits for it,
    /// as real nodes do, whatever else the PC is busy with. Its answers take microseconds.
    Machine,
}

/// A process that is ready to start real-time threads. Keep it as long as they run.
#[derive(Debug)]
pub struct Process {
    /// The core of the real-time threads.
    pub cpu: usize,
    /// SCHED_FIFO priority of the cycle thread.
    pub priority: u8,
    /// What is missing; empty: nothing. For one warning each.
    pub findings: Vec<Finding>,
    /// Held open: all cores stay out of deep idle states until it is closed.
    _dma_latency: Option<File>,
    /// Spins where nothing else keeps the core awake.
    _keep_awake: Option<KeepAwake>,
}

/// Prepares the whole process: allocator, locked memory, idle states; tries in a thread of its own what every real-time
/// thread will need.
///
/// # Errors
/// [`Refusal`] if anything is missing and `rt.require` is strict.
pub fn prepare_process(rt: &Rt) -> Result<Process, Refusal> {
    let mut findings = Vec::new();
    findings.extend(kernel_finding(read_to_string("/sys/kernel/realtime").ok().as_deref()));
    findings.extend(timer_finding());
    let cpu = choose_cpu(rt.cpu, &online_cpus(), &mut findings);
    if rt.lock_memory {
        findings.extend(lock_memory());
    }
    let dma_latency = if rt.keep_awake {
        hold_dma_latency(&mut findings)
    } else {
        None
    };
    let keep_awake = (rt.keep_awake && dma_latency.is_none())
        .then(|| KeepAwake::spawn(cpu))
        .flatten();
    let mut process = Process {
        cpu,
        priority: rt.priority,
        findings,
        _dma_latency: dma_latency,
        _keep_awake: keep_awake,
    };
    let tried = std::thread::scope(|scope| scope.spawn(|| enter_thread(Role::Timeout, &process)).join());
    process.findings.extend(tried.unwrap_or_default());
    match rt.require {
        Require::Strict if !process.findings.is_empty() => Err(Refusal {
            findings: process.findings,
        }),
        Require::Strict | Require::Warn => Ok(process),
    }
}

/// Makes the calling thread a real-time thread: its core, its priority, no signals, a touched stack, and then no rights.
/// Allocates; nothing need be allocated after it. Gives what could not be had; [`prepare_process`] has found the same before.
pub fn enter_thread(role: Role, process: &Process) -> Vec<Finding> {
    let (priority, work) = match role {
        Role::Cycle => (process.priority, Work::RealTime),
        Role::Timeout => (process.priority + 1, Work::RealTime),
        Role::Machine => (process.priority + 2, Work::Ordinary),
    };
    let mut findings = enter_core(process.cpu, priority);
    if let Err(cause) = rights::give_up(work) {
        findings.push(Finding {
            item: Item::Thread,
            what: format!("rights that are no longer needed cannot be given up ({cause})"),
            fix: "report this: it should not happen".into(),
        });
    }
    findings
}

/// As [`enter_thread`], for a thread that has no part in a control: a probe. `priority` is that of SCHED_FIFO, 1 to 99.
pub fn enter_core(cpu: usize, priority: u8) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Err(errno) = SigSet::all().thread_block() {
        let what = format!("signals cannot be blocked ({errno})");
        findings.push(Finding {
            item: Item::Thread,
            what,
            fix: "report this: it should not happen".into(),
        });
    }
    // The core before the policy: a FIFO thread must never run, even for a moment, on a core that others need.
    findings.extend(pin(cpu));
    findings.extend(set_fifo(priority));
    // SAFETY: PR_SET_TIMERSLACK takes one number and touches no memory. FIFO threads have no slack; this is for the others.
    if unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) } != 0 {
        let what = format!("timer slack cannot be set ({})", Errno::last());
        findings.push(Finding {
            item: Item::Thread,
            what,
            fix: "report this: it should not happen".into(),
        });
    }
    prefault_stack();
    findings
}

fn kernel_finding(realtime: Option<&str>) -> Option<Finding> {
    (realtime.map(str::trim) != Some("1")).then(|| Finding {
        item: Item::Kernel,
        what: "this kernel is not PREEMPT_RT, so lateness has no bound".into(),
        fix: "install a real-time kernel (Debian: linux-image-rt-amd64; Ubuntu: linux-image-realtime)".into(),
    })
}

fn timer_finding() -> Option<Finding> {
    let resolution = nix::time::clock_getres(nix::time::ClockId::CLOCK_MONOTONIC).ok()?;
    let coarse = resolution.tv_sec() > 0 || resolution.tv_nsec() > 1;
    coarse.then(|| Finding {
        item: Item::Timers,
        what: format!("the clock moves in steps of {} ns", resolution.tv_nsec()),
        fix: "boot without 'highres=off' on a kernel with CONFIG_HIGH_RES_TIMERS=y".into(),
    })
}

/// Cores that are online. Never `core_affinity::get_core_ids`, which leaves isolated cores out.
fn online_cpus() -> Vec<usize> {
    let list = read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
    let cpus = cpu_list(&list);
    if cpus.is_empty() { vec![0] } else { cpus }
}

/// Reads the kernel's lists of cores: `0,2-3`.
fn cpu_list(list: &str) -> Vec<usize> {
    let range = |part: &str| -> Option<std::ops::RangeInclusive<usize>> {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.parse().ok()?..=last.parse().ok()?)
    };
    list.trim().split(',').filter_map(range).flatten().collect()
}

fn choose_cpu(wanted: Option<usize>, online: &[usize], findings: &mut Vec<Finding>) -> usize {
    let last = online.last().copied().unwrap_or(0);
    let mut missing = |what, fix: &str| {
        findings.push(Finding {
            item: Item::Core,
            what,
            fix: fix.into(),
        })
    };
    match wanted {
        Some(cpu) if !online.contains(&cpu) => {
            missing(
                format!("core {cpu} is not online, core {last} is taken"),
                "set rt.cpu to a core that is, or leave it out",
            );
            last
        }
        Some(cpu) => cpu,
        None => {
            if online.len() == 1 {
                missing(
                    "there is only one core, shared with everything else".into(),
                    "use a PC with two or more cores",
                );
            }
            last
        }
    }
}

fn lock_memory() -> Option<Finding> {
    // Without the right to lock all of it, MCL_FUTURE would let later allocations fail; so ask first.
    let unlimited = getrlimit(Resource::RLIMIT_MEMLOCK).is_ok_and(|(soft, _)| soft == RLIM_INFINITY);
    if !unlimited && !has_capability(CAP_IPC_LOCK) {
        let what = "memory may not be locked: a page fault can stop a cycle".into();
        return Some(Finding {
            item: Item::Memory,
            what,
            fix: RIGHTS.into(),
        });
    }
    #[cfg(target_env = "gnu")]
    // SAFETY: mallopt sets numbers of the allocator and touches no memory of ours.
    unsafe {
        // Never give memory back and never map per allocation: both would fault, or interrupt the RT core, later.
        libc::mallopt(libc::M_TRIM_THRESHOLD, -1);
        libc::mallopt(libc::M_MMAP_MAX, 0);
        libc::mallopt(libc::M_ARENA_MAX, 1);
    }
    if let Err(errno) = mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE) {
        let what = format!("memory cannot be locked ({errno})");
        return Some(Finding {
            item: Item::Memory,
            what,
            fix: RIGHTS.into(),
        });
    }
    let mut reserve = vec![0u8; HEAP_RESERVE];
    reserve.iter_mut().step_by(PAGE).for_each(|octet| *octet = 1);
    std::hint::black_box(&reserve);
    None
}

/// Writes one octet per page of the stack that the thread will use.
#[inline(never)]
fn prefault_stack() {
    let mut stack = [0u8; STACK_PREFAULT];
    for page in stack.chunks_mut(PAGE) {
        page[0] = 1;
        std::hint::black_box(&*page);
    }
}

fn hold_dma_latency(findings: &mut Vec<Finding>) -> Option<File> {
    let driver = read_to_string(CPUIDLE_DRIVER).unwrap_or_default();
    if matches!(driver.trim(), "" | "none") {
        // No idle states that the file could forbid (most virtual machines): the spinning thread does it.
        return None;
    }
    let held = OpenOptions::new().write(true).open(DMA_LATENCY).and_then(|mut file| {
        file.write_all(&0i32.to_ne_bytes())?;
        Ok(file)
    });
    held.inspect_err(|cause| {
        findings.push(Finding {
            item: Item::IdleStates,
            what: format!("{DMA_LATENCY} cannot be held ({cause}); a thread spins on the core instead"),
            fix: "run as root, or open the file to a group with a udev rule".into(),
        });
    })
    .ok()
}

fn pin(cpu: usize) -> Option<Finding> {
    let missing = |what| {
        let fix = "allow the core to this process: taskset, CPUAffinity= or the cpuset of its cgroup; or set rt.cpu";
        Some(Finding {
            item: Item::Core,
            what,
            fix: fix.into(),
        })
    };
    let this = Pid::from_raw(0);
    if !core_affinity::set_for_current(CoreId { id: cpu }) {
        // The crate tells only that it failed; ask again for the reason.
        let mut only = CpuSet::new();
        if let Err(errno) = only.set(cpu).and_then(|()| sched_setaffinity(this, &only)) {
            return missing(format!("core {cpu} cannot be taken ({errno})"));
        }
    }
    let only_this =
        |set: &CpuSet| (0..CpuSet::count()).all(|other| set.is_set(other).unwrap_or(false) == (other == cpu));
    match sched_getaffinity(this) {
        Ok(set) if only_this(&set) => None,
        Ok(_) => missing(format!("core {cpu} was asked for, but the thread may run elsewhere")),
        Err(errno) => missing(format!("the core of the thread cannot be read ({errno})")),
    }
}

fn set_fifo(priority: u8) -> Option<Finding> {
    let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let set = ThreadPriority::try_from(priority)
        .map_err(str::to_owned)
        .and_then(|value| set_thread_priority_and_policy(thread_native_id(), value, fifo).map_err(refused_priority));
    // SAFETY: 0 is the calling thread; the call touches no memory.
    let policy = unsafe { libc::sched_getscheduler(0) };
    let what = match set {
        Ok(()) if policy == libc::SCHED_FIFO => return None,
        Ok(()) => format!("SCHED_FIFO {priority} was set, but the policy is {policy}"),
        Err(cause) => format!("SCHED_FIFO {priority} is refused ({cause})"),
    };
    let cgroup = read_to_string("/proc/self/cgroup").unwrap_or_default();
    let fix = fifo_fix(has_capability(CAP_SYS_NICE), &cgroup);
    Some(Finding {
        item: Item::Priority,
        what,
        fix,
    })
}

fn refused_priority(error: thread_priority::Error) -> String {
    match error {
        thread_priority::Error::OS(errno) => Errno::from_raw(errno).to_string(),
        other => other.to_string(),
    }
}

/// Why FIFO is refused. With the right to it, a kernel with CONFIG_RT_GROUP_SCHED is the one reason left.
fn fifo_fix(has_right: bool, cgroup: &str) -> String {
    if !has_right {
        return RIGHTS.to_owned();
    }
    let group = cgroup.lines().find_map(|line| {
        let (_, rest) = line.split_once(':')?;
        let (controllers, path) = rest.split_once(':')?;
        controllers
            .split(',')
            .any(|controller| controller == "cpu")
            .then_some((controllers, path))
    });
    match group {
        Some((controllers, path)) => format!(
            "the kernel gives real time per group (CONFIG_RT_GROUP_SCHED): write 950000 to \
             /sys/fs/cgroup/{controllers}{path}/cpu.rt_runtime_us, or move the process to the root group"
        ),
        None => {
            "the kernel gives real time per group (CONFIG_RT_GROUP_SCHED): start the process in the root cgroup, or \
                 boot a kernel without it"
                .to_owned()
        }
    }
}

/// Whether the process has a right over the whole PC; rights inside a user namespace do not count.
fn has_capability(number: u32) -> bool {
    let status = read_to_string("/proc/self/status").unwrap_or_default();
    let uid_map = read_to_string("/proc/self/uid_map").unwrap_or_default();
    is_initial_namespace(&uid_map) && effective_capabilities(&status) >> number & 1 == 1
}

fn effective_capabilities(status: &str) -> u64 {
    let field = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    field
        .and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok())
        .unwrap_or(0)
}

fn is_initial_namespace(uid_map: &str) -> bool {
    uid_map.split_whitespace().eq(["0", "0", "4294967295"])
}

/// A thread of the lowest priority that spins on the real-time core, so that it never halts.
#[derive(Debug)]
struct KeepAwake {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl KeepAwake {
    /// `None` where the thread could not be put behind all others: a spinning thread of ordinary priority would do harm.
    fn spawn(cpu: usize) -> Option<KeepAwake> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let run = move || {
            let blocked = SigSet::all().thread_block().is_ok();
            let nothing = libc::sched_param { sched_priority: 0 };
            // SAFETY: 0 is the calling thread; `nothing` lives through the call.
            let idle = unsafe { libc::sched_setscheduler(0, libc::SCHED_IDLE, &nothing) } == 0;
            if blocked && idle && pin(cpu).is_none() && rights::give_up(Work::RealTime).is_ok() {
                while !stopped.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name("keep-awake".into())
            .stack_size(STACK_SIZE)
            .spawn(run)
            .ok()?;
        Some(KeepAwake {
            stop,
            thread: Some(thread),
        })
    }
}

impl Drop for KeepAwake {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // The thread cannot panic; a failed join would change nothing.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rt(require: Require) -> Rt {
        Rt {
            cpu: Some(9_999),
            priority: 80,
            timeout_us: 50,
            phase_us: 370,
            spin_us: 50,
            keep_awake: false,
            lock_memory: false,
            require,
        }
    }

    #[test]
    fn lists_of_cores() {
        assert_eq!(cpu_list("0-1\n"), [0, 1]);
        assert_eq!(cpu_list("0,2-4,7"), [0, 2, 3, 4, 7]);
        assert_eq!(cpu_list("\n"), [0usize; 0]);
        assert!(!online_cpus().is_empty());
    }

    #[test]
    fn the_core_is_the_wanted_or_the_last_one() {
        let mut findings = Vec::new();
        assert_eq!(choose_cpu(None, &[0, 1, 3], &mut findings), 3);
        assert_eq!(choose_cpu(Some(1), &[0, 1, 3], &mut findings), 1);
        assert!(findings.is_empty());
        assert_eq!(choose_cpu(Some(2), &[0, 1, 3], &mut findings), 3);
        assert_eq!(choose_cpu(None, &[0], &mut findings), 0);
        let lines: Vec<String> = findings.iter().map(Finding::to_string).collect();
        assert_eq!(
            lines,
            [
                "real time, core: core 2 is not online, core 3 is taken; set rt.cpu to a core that is, or leave it out",
                "real time, core: there is only one core, shared with everything else; use a PC with two or more cores",
            ]
        );
    }

    #[test]
    fn rights_inside_a_user_namespace_do_not_count() {
        assert!(is_initial_namespace("         0          0 4294967295\n"));
        assert!(!is_initial_namespace("         0       1000          1\n"));
        let status = "Name:\tx\nCapPrm:\t0000000000000000\nCapEff:\t0000000000804000\n";
        assert_eq!(effective_capabilities(status), 1 << CAP_SYS_NICE | 1 << CAP_IPC_LOCK);
        assert_eq!(effective_capabilities(""), 0);
    }

    #[test]
    fn refused_priorities_are_explained() {
        assert_eq!(fifo_fix(false, "1:cpu:/x\n"), RIGHTS);
        let v1 = fifo_fix(true, "2:memory:/\n1:cpu,cpuacct:/system.slice\n0::/\n");
        assert!(
            v1.contains("/sys/fs/cgroup/cpu,cpuacct/system.slice/cpu.rt_runtime_us"),
            "{v1}"
        );
        assert!(fifo_fix(true, "2:cpuset:/\n0::/user.slice\n").contains("root cgroup"));
    }

    #[test]
    fn only_one_says_preempt_rt() {
        assert_eq!(kernel_finding(Some("1\n")), None);
        for other in [None, Some("0\n"), Some("")] {
            assert_eq!(kernel_finding(other).unwrap().item, Item::Kernel);
        }
    }

    #[test]
    fn strict_refuses_with_all_findings_and_warn_runs_with_the_same() {
        let refusal = prepare_process(&rt(Require::Strict)).unwrap_err();
        let process = prepare_process(&rt(Require::Warn)).unwrap();
        assert_eq!(refusal.findings, process.findings);
        assert!(
            refusal
                .to_string()
                .contains("\n  real time, core: core 9999 is not online"),
            "{refusal}"
        );
        assert_eq!(Some(&process.cpu), online_cpus().last());
    }

    #[test]
    fn a_thread_enters_real_time_or_says_what_is_missing() {
        let process = prepare_process(&Rt {
            cpu: None,
            ..rt(Require::Warn)
        })
        .unwrap();
        let enter = || {
            let findings = enter_thread(Role::Cycle, &process);
            let blocked = SigSet::thread_get_mask()
                .unwrap()
                .contains(nix::sys::signal::Signal::SIGINT);
            let cores = sched_getaffinity(Pid::from_raw(0)).unwrap();
            let alone = (0..CpuSet::count())
                .filter(|cpu| cores.is_set(*cpu).unwrap())
                .eq([process.cpu]);
            // SAFETY: 0 is the calling thread; the call touches no memory.
            let fifo = unsafe { libc::sched_getscheduler(0) } == libc::SCHED_FIFO;
            (findings, blocked, alone, fifo)
        };
        let (findings, blocked, alone, fifo) = std::thread::scope(|scope| scope.spawn(enter).join().unwrap());
        let misses = |item| findings.iter().any(|finding| finding.item == item);
        assert!(blocked);
        assert_eq!(alone, !misses(Item::Core));
        assert_eq!(fifo, !misses(Item::Priority));
    }

    #[test]
    fn the_spinning_thread_ends_when_it_is_dropped() {
        let awake = KeepAwake::spawn(*online_cpus().last().unwrap()).unwrap();
        let stop = awake.stop.clone();
        drop(awake);
        assert!(stop.load(Ordering::Relaxed));
        assert_eq!(Arc::strong_count(&stop), 1, "the thread is gone");
    }
}
