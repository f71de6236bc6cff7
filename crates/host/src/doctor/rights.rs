//! What the process is given when it asks, and what the scheduler leaves it.

use super::kernel::{config, debugfs_unread, is_built_in};
use super::{Look, Pc, Unread};
use crate::doctor::fixes;

/// All that the control needs.
const RIGHTS: &str = "cap_sys_nice,cap_ipc_lock,cap_net_raw+ep";
/// The same where the process cannot have it, whoever it belongs to.
const UNCONTAINED: &str = "run it outside of the container, or give that --cap-add SYS_NICE --cap-add IPC_LOCK \
                           --cap-add NET_RAW --ulimit rtprio=99 --ulimit memlock=-1 (not a rootless one)";
/// CAP_NET_RAW, CAP_IPC_LOCK, CAP_SYS_NICE, as in `linux/capability.h`.
const CAPABILITIES: u64 = 1 << 13 | 1 << 14 | 1 << 23;
const RUNTIME: &str = "/proc/sys/kernel/sched_rt_runtime_us";
const PERIOD: &str = "/proc/sys/kernel/sched_rt_period_us";

/// Whether a thread may have the core.
pub(super) fn take_core(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "allow the core to this process: CPUAffinity= of its unit, taskset, or the cpuset of its cgroup";
    Some(match pc.tries.take_core(pc.cpu()) {
        Ok(()) => Look::ok("given"),
        Err(why) => Look::missing(why, FIX),
    })
}

/// Whether a thread may run before all others.
pub(super) fn fifo(pc: &Pc<'_>) -> Option<Look> {
    let priority = pc.target.priority;
    Some(match pc.tries.fifo(pc.cpu(), priority) {
        Ok(()) => Look::ok(format!("priority {priority} given")),
        // With a group that has no time even root is refused.
        Err(why) => Look::missing(why, group_without_time(pc).unwrap_or_else(|| grant(pc))),
    })
}

/// Whether no page of the process ever has to be fetched.
pub(super) fn locked_memory(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.tries.lock_memory() {
        Ok(()) => Look::ok("given"),
        Err(why) => Look::missing(why, grant(pc)),
    })
}

/// Whether frames can be sent and received.
pub(super) fn raw_socket(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.tries.raw_socket() {
        Ok(()) => Look::ok("given"),
        Err(why) => Look::missing(why, grant(pc)),
    })
}

/// How rights are granted: to the file of the program, so that nobody has to be root, unless a container keeps them from it.
fn grant(pc: &Pc<'_>) -> String {
    let status = pc.text("/proc/self/status").unwrap_or_default();
    let bounding = status.lines().find_map(|line| line.strip_prefix("CapBnd:"));
    let bounding = bounding.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok());
    let lacks = bounding.is_some_and(|bounding| bounding & CAPABILITIES != CAPABILITIES);
    if lacks || pc.is_user_namespace() {
        UNCONTAINED.into()
    } else {
        format!("sudo setcap {RIGHTS} {}", fixes::word(&pc.target.program))
    }
}

/// How much of each second the kernel leaves to real time. From Linux 6.12 on the fair server does this.
pub(super) fn throttling(pc: &Pc<'_>) -> Option<Look> {
    let (runtime, period) = match (pc.number(RUNTIME), pc.number(PERIOD)) {
        (Ok(runtime), Ok(period)) => (runtime, period),
        (Err(why), _) | (_, Err(why)) => return Some(Look::unknown(why.to_string())),
    };
    if runtime == -1 {
        return Some(Look::ok("off"));
    }
    // Below that the control itself would be stopped; as it sleeps in each cycle it never needs all.
    let enough = runtime >= 0 && i128::from(runtime) * 10 >= i128::from(period) * 9;
    let found = format!("{runtime} of {period} us");
    Some(Look::judge(
        enough,
        found,
        fixes::sysctl("kernel.sched_rt_runtime_us=950000"),
    ))
}

/// What the scheduler keeps for ordinary threads that wait for the core.
pub(super) fn fair_server(pc: &Pc<'_>) -> Option<Look> {
    let folder = format!("/sys/kernel/debug/sched/fair_server/cpu{}", pc.cpu());
    let file = |name: &str| pc.number(&format!("{folder}/{name}"));
    let (runtime_ns, period_ns) = match (file("runtime"), file("period")) {
        (Ok(runtime), Ok(period)) => (runtime, period),
        (Err(why), _) | (_, Err(why)) => {
            return Some(match before_fair_server(pc) {
                Some(true) => Look::ok("none before Linux 6.12"),
                Some(false) | None => debugfs_unread(pc, &why),
            });
        }
    };
    let small = runtime_ns >= 0 && i128::from(runtime_ns) * 10 <= i128::from(period_ns);
    let found = format!("{} of {} ms", runtime_ns / 1_000_000, period_ns / 1_000_000);
    Some(Look::judge(
        small,
        found,
        fixes::write("50000000", &format!("{folder}/runtime")),
    ))
}

fn before_fair_server(pc: &Pc<'_>) -> Option<bool> {
    let release = pc.text("/proc/sys/kernel/osrelease").ok()?;
    let mut numbers = release
        .split(|c: char| !c.is_ascii_digit())
        .map(|part| part.parse::<u32>().ok());
    Some((numbers.next()??, numbers.next()??) < (6, 12))
}

/// Kernels with CONFIG_RT_GROUP_SCHED give real time per control group.
pub(super) fn group_scheduling(pc: &Pc<'_>) -> Option<Look> {
    if let Some((path, time)) = group_time(pc) {
        return Some(match time {
            Ok(time) => Look::judge(
                time != 0,
                format!("{time} us for the group of this process"),
                fixes::write("950000", &path),
            ),
            Err(why) => Look::unknown(why.to_string()),
        });
    }
    let config = match config(pc) {
        Ok(config) => config,
        Err(why) => return Some(Look::unknown(why)),
    };
    if !is_built_in(&config, "RT_GROUP_SCHED") {
        return Some(Look::ok("none"));
    }
    const FIX: &str = "run outside of control groups that have the controller cpu, or boot with rt_group_sched=0";
    Some(Look::judge(
        in_root_group(pc),
        "built in: real time in the root group only",
        FIX,
    ))
}

fn in_root_group(pc: &Pc<'_>) -> bool {
    pc.text("/proc/self/cgroup")
        .is_ok_and(|groups| groups.lines().all(|line| line.ends_with(":/")))
}

/// Real time of the control group (version 1) of this process in each period, us, and the file that holds it.
fn group_time(pc: &Pc<'_>) -> Option<(String, Result<i64, Unread>)> {
    let groups = pc.text("/proc/self/cgroup").ok()?;
    let path = groups.lines().find_map(|line| {
        let (controllers, path) = line.split_once(':')?.1.split_once(':')?;
        let is_cpu = controllers.split(',').any(|controller| controller == "cpu");
        is_cpu.then(|| {
            format!(
                "/sys/fs/cgroup/{controllers}{}/cpu.rt_runtime_us",
                path.trim_end_matches('/')
            )
        })
    })?;
    match pc.number(&path) {
        Err(Unread::Absent(_)) => None,
        time => Some((path, time)),
    }
}

fn group_without_time(pc: &Pc<'_>) -> Option<String> {
    let (path, time) = group_time(pc)?;
    (time == Ok(0)).then(|| fixes::write("950000", &path))
}
