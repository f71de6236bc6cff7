//! The core of the real-time threads: which one, and a thread's way onto it.

use super::findings::{Finding, Item};
use crate::other_controls::OtherControl;
use core_affinity::CoreId;
use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::unistd::Pid;
use std::fs::read_to_string;

/// Cores that are online. Not those in the affinity mask of the process, which leaves isolated cores out.
pub(super) fn online() -> Vec<usize> {
    let cpus = list(&read_to_string("/sys/devices/system/cpu/online").unwrap_or_default());
    if cpus.is_empty() { vec![0] } else { cpus }
}

/// Cores on which nothing runs that does not ask for them (boot parameter `isolcpus`).
pub(super) fn isolated() -> Vec<usize> {
    list(&read_to_string("/sys/devices/system/cpu/isolated").unwrap_or_default())
}

/// Reads the kernel's lists of cores: `0,2-3`.
pub(super) fn list(list: &str) -> Vec<usize> {
    let range = |part: &str| -> Option<std::ops::RangeInclusive<usize>> {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.parse().ok()?..=last.parse().ok()?)
    };
    list.trim().split(',').filter_map(range).flatten().collect()
}

/// The wanted core; left out, the last isolated one, else the last one: interrupts and the kernel's own work prefer the
/// first. One that another control has only where there is no other: two threads of one real-time priority do not share
/// a core, the one waits until the other sleeps.
pub(super) fn choose(
    wanted: Option<usize>,
    online: &[usize],
    isolated: &[usize],
    others: &[OtherControl],
    findings: &mut Vec<Finding>,
) -> usize {
    let last = online.last().copied().unwrap_or(0);
    let is_free = |cpu: &usize| others.iter().all(|other| other.cpu != *cpu);
    let isolated = || isolated.iter().rev().filter(|cpu| online.contains(cpu)).copied();
    let free = isolated().chain(online.iter().rev().copied()).find(is_free);
    let best = match wanted {
        None => free,
        Some(_) => None,
    };
    let best = best.or_else(|| isolated().next()).unwrap_or(last);
    let cpu = wanted.filter(|cpu| online.contains(cpu)).unwrap_or(best);
    if let Some(OtherControl { process, .. }) = others.iter().find(|other| other.cpu == cpu) {
        let what = format!("core {cpu} is also that of another control, process {process}: each disturbs the other");
        let fix = match free {
            Some(free) => format!("set rt.cpu of one of them to another core: {free} is free"),
            None => "end one of them, or use a PC with more cores".to_owned(),
        };
        findings.push(Finding::new(Item::Core, what, fix));
    }
    match wanted {
        Some(cpu) if !online.contains(&cpu) => {
            let what = format!("core {cpu} is not online, core {best} is taken");
            let fix = "set rt.cpu to a core that is, or leave it out";
            findings.push(Finding::new(Item::Core, what, fix));
            best
        }
        Some(cpu) => cpu,
        None => {
            if online.len() == 1 {
                let what = "there is only one core, shared with everything else";
                findings.push(Finding::new(Item::Core, what, "use a PC with two or more cores"));
            }
            best
        }
    }
}

/// The core of the time-out thread: the wanted one, where it is online.
pub(super) fn choose_second(
    wanted: Option<usize>,
    first: usize,
    online: &[usize],
    findings: &mut Vec<Finding>,
) -> usize {
    match wanted {
        Some(cpu) if !online.contains(&cpu) => {
            let what = format!("core {cpu} for the time-out thread is not online, core {first} is taken");
            let fix = "set rt.timeout_cpu to a core that is, or leave it out";
            findings.push(Finding::new(Item::Core, what, fix));
            first
        }
        wanted => wanted.unwrap_or(first),
    }
}

/// Keeps the calling thread, and the threads that it starts, on the cores for housekeeping; without any, off the cores of the real-time
/// threads, which go there by themselves. A planner or a reader of files would be interrupted there at once, but what the kernel does for
/// it, its timers and its caches stay in the way. Where there is no other core, nothing is changed; it is no finding either.
pub(super) fn keep_off(taken: &[usize], housekeeping: &[usize]) -> Option<Finding> {
    let this = Pid::from_raw(0);
    let allowed = sched_getaffinity(this).ok()?;
    let wanted = |cpu: &usize| match housekeeping {
        [] => !taken.contains(cpu) && allowed.is_set(*cpu).unwrap_or(false),
        some => some.contains(cpu),
    };
    let mut others = CpuSet::new();
    for cpu in (0..CpuSet::count()).filter(wanted) {
        others.set(cpu).ok()?;
    }
    let is_set = others == CpuSet::new() || sched_setaffinity(this, &others).is_ok();
    // Without a list, a core less is a wish: the thread does its work anywhere.
    (!is_set && !housekeeping.is_empty()).then(|| {
        let what = format!("none of the cores {housekeeping:?} for housekeeping can be taken");
        Finding::new(
            Item::Core,
            what,
            "set rt.housekeeping_cpus to cores that are online, or leave it out",
        )
    })
}

/// Puts a thread on one core for good; number 0: the calling thread.
///
/// # Errors
/// Why it cannot be there.
pub(super) fn set_affinity(thread: Pid, cpu: usize) -> Result<(), String> {
    // The crate moves the calling thread only, and panics for numbers that no set of cores has room for.
    let is_set = thread.as_raw() == 0 && cpu < CpuSet::count() && core_affinity::set_for_current(CoreId { id: cpu });
    if is_set {
        return Ok(());
    }
    // Nor does it say why it failed.
    let mut only = CpuSet::new();
    only.set(cpu)
        .and_then(|()| sched_setaffinity(thread, &only))
        .map_err(|errno| format!("core {cpu} cannot be taken ({errno})"))
}

/// Puts the calling thread on one core for good.
pub(super) fn pin(cpu: usize) -> Option<Finding> {
    let missing = |what| {
        let fix = "allow the core to this process: taskset, CPUAffinity= or the cpuset of its cgroup; or set rt.cpu";
        Some(Finding::new(Item::Core, what, fix))
    };
    let this = Pid::from_raw(0);
    if let Err(what) = set_affinity(this, cpu) {
        return missing(what);
    }
    let only_this =
        |set: &CpuSet| (0..CpuSet::count()).all(|other| set.is_set(other).unwrap_or(false) == (other == cpu));
    match sched_getaffinity(this) {
        Ok(set) if only_this(&set) => None,
        Ok(_) => missing(format!("core {cpu} was asked for, but the thread may run elsewhere")),
        Err(errno) => missing(format!("the core of the thread cannot be read ({errno})")),
    }
}
