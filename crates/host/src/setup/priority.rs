//! SCHED_FIFO for a thread, and why it is refused.

use super::findings::{Finding, Item, RIGHTS};
use nix::errno::Errno;
use std::fs::read_to_string;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
    thread_native_id,
};

/// Numbers of capabilities, as in `linux/capability.h`.
pub(super) const CAP_IPC_LOCK: u32 = 14;
pub(super) const CAP_SYS_NICE: u32 = 23;

/// Makes the calling thread SCHED_FIFO, and looks whether it is.
pub(super) fn set_fifo(priority: u8) -> Option<Finding> {
    let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let set = ThreadPriority::try_from(priority)
        .map_err(str::to_owned)
        .and_then(|value| set_thread_priority_and_policy(thread_native_id(), value, fifo).map_err(refused_priority));
    // The system call itself: the function of this name refuses in musl.
    // SAFETY: 0 is the calling thread; the call touches no memory.
    let policy = unsafe { libc::syscall(libc::SYS_sched_getscheduler, 0) };
    let what = match set {
        Ok(()) if policy == libc::c_long::from(libc::SCHED_FIFO) => return None,
        Ok(()) => format!("SCHED_FIFO {priority} was set, but the policy is {policy}"),
        Err(cause) => format!("SCHED_FIFO {priority} is refused ({cause})"),
    };
    let cgroup = read_to_string("/proc/self/cgroup").unwrap_or_default();
    let fix = fifo_fix(has_capability(CAP_SYS_NICE), &cgroup);
    Some(Finding::new(Item::Priority, what, fix))
}

fn refused_priority(error: thread_priority::Error) -> String {
    match error {
        thread_priority::Error::OS(errno) => Errno::from_raw(errno).to_string(),
        other => other.to_string(),
    }
}

/// Why FIFO is refused. With the right to it, a kernel with CONFIG_RT_GROUP_SCHED is the one reason left.
pub(super) fn fifo_fix(has_right: bool, cgroup: &str) -> String {
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
pub(super) fn has_capability(number: u32) -> bool {
    let status = read_to_string("/proc/self/status").unwrap_or_default();
    let uid_map = read_to_string("/proc/self/uid_map").unwrap_or_default();
    is_initial_namespace(&uid_map) && effective_capabilities(&status) >> number & 1 == 1
}

pub(super) fn effective_capabilities(status: &str) -> u64 {
    let field = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    field
        .and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok())
        .unwrap_or(0)
}

pub(super) fn is_initial_namespace(uid_map: &str) -> bool {
    uid_map.split_whitespace().eq(["0", "0", "4294967295"])
}
