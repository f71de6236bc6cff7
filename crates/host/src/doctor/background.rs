//! Work that the kernel does by itself, on whichever core it is not kept from.

use super::{Cpus, Look, Pc};
use crate::doctor::fixes;

/// The soft lock-up detector wakes up on every core every few seconds.
pub(super) fn watchdog(pc: &Pc<'_>) -> Option<Look> {
    const SWITCH: &str = "/proc/sys/kernel/watchdog";
    Some(
        match (pc.number(SWITCH), pc.cpu_list("/proc/sys/kernel/watchdog_cpumask")) {
            (Ok(0), _) => Look::ok("off"),
            (Ok(_), Ok(cores)) => Look::judge(
                !cores.contains(pc.cpu()),
                format!("on, on cores {cores}"),
                fixes::apply(pc),
            ),
            (Ok(_), Err(_)) => Look::missing("on", fixes::apply(pc)),
            (Err(why), _) => Look::unread(pc, &why),
        },
    )
}

/// The hard lock-up detector is an interrupt that nothing holds off.
pub(super) fn nmi_watchdog(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.number("/proc/sys/kernel/nmi_watchdog") {
        Ok(0) => Look::ok("off"),
        Ok(_) => Look::missing("on", fixes::sysctl("kernel.nmi_watchdog=0")),
        Err(why) => Look::unread(pc, &why),
    })
}

/// Where work runs that is bound to no core.
pub(super) fn workqueues(pc: &Pc<'_>) -> Option<Look> {
    let all = match pc.cpu_mask("/sys/devices/virtual/workqueue/cpumask") {
        Ok(all) => all,
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    // A queue's own mask only narrows the general one.
    Some(Look::judge(
        !all.contains(pc.cpu()),
        format!("cores {all}"),
        fixes::apply(pc),
    ))
}

/// Timers of other cores may end up on this one.
pub(super) fn timer_migration(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.number("/proc/sys/kernel/timer_migration") {
        Ok(0) => Look::ok("off"),
        Ok(_) => Look::missing("on", fixes::apply(pc)),
        Err(why) => Look::unread(pc, &why),
    })
}

/// Once in this time a worker counts pages on every core.
pub(super) fn stat_interval(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.number("/proc/sys/vm/stat_interval") {
        Ok(seconds) => Look::judge(seconds >= 10, format!("{seconds} s"), fixes::apply(pc)),
        Err(why) => Look::unknown(why.to_string()),
    })
}

/// Kernel threads that may run on the core and could run elsewhere.
pub(super) fn kernel_threads(pc: &Pc<'_>) -> Option<Look> {
    const NAMED: usize = 3;
    let processes = match pc.processes() {
        Ok(processes) => processes,
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    // The thread of an interrupt follows the interrupt.
    let movable = processes
        .into_iter()
        .filter(|(pid, comm)| !comm.starts_with("irq/") && is_movable(pc, pid));
    let here = movable.filter(|(pid, _)| allowed_cores(pc, pid).is_some_and(|cores| cores.contains(pc.cpu())));
    let names: Vec<String> = here.map(|(_, comm)| comm).collect();
    Some(match names.len() {
        0 => Look::ok("none"),
        count @ 1..=NAMED => Look::missing(format!("{count}: {}", names.join(", ")), fixes::apply(pc)),
        count => {
            let named = names[..NAMED].join(", ");
            Look::missing(format!("{count}: {named} and {} more", count - NAMED), fixes::apply(pc))
        }
    })
}

/// Whether a process is a kernel thread that is not bound for good.
fn is_movable(pc: &Pc<'_>, pid: &str) -> bool {
    /// Number of kthreadd, the parent of all kernel threads.
    const KTHREADD: u64 = 2;
    /// `linux/sched.h`: user land may not move it.
    const PF_NO_SETAFFINITY: u64 = 0x0400_0000;
    // As in proc(5), fields 4 and 9.
    let fields = (pc.process_field(pid, 4), pc.process_field(pid, 9));
    matches!(fields, (Some(KTHREADD), Some(flags)) if flags & PF_NO_SETAFFINITY == 0)
}

fn allowed_cores(pc: &Pc<'_>, pid: &str) -> Option<Cpus> {
    let status = pc.text(&format!("/proc/{pid}/status")).ok()?;
    let list = status
        .lines()
        .find_map(|line| line.strip_prefix("Cpus_allowed_list:"))?;
    Cpus::parse_list(list)
}
