//! Work that the kernel does by itself, on whichever core it is not kept from.

use super::{Look, Pc, cures};

/// The soft lock-up detector wakes up on every core every few seconds.
pub(super) fn watchdog(pc: &Pc<'_>) -> Option<Look> {
    const SWITCH: &str = "/proc/sys/kernel/watchdog";
    Some(
        match (pc.number(SWITCH), pc.cpu_list("/proc/sys/kernel/watchdog_cpumask")) {
            (Ok(0), _) => Look::ok("off"),
            (Ok(_), Ok(cores)) => Look::judge(
                !cores.contains(pc.cpu()),
                format!("on, on cores {cores}"),
                cures::apply(pc),
            ),
            (Ok(_), Err(_)) => Look::missing("on", cures::apply(pc)),
            (Err(why), _) => Look::unread(pc, &why),
        },
    )
}

/// The hard lock-up detector is an interrupt that nothing holds off.
pub(super) fn nmi_watchdog(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.number("/proc/sys/kernel/nmi_watchdog") {
        Ok(0) => Look::ok("off"),
        Ok(_) => Look::missing("on", cures::sysctl("kernel.nmi_watchdog=0")),
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
        cures::apply(pc),
    ))
}

/// Timers of other cores may end up on this one.
pub(super) fn timer_migration(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.number("/proc/sys/kernel/timer_migration") {
        Ok(0) => Look::ok("off"),
        Ok(_) => Look::missing("on", cures::apply(pc)),
        Err(why) => Look::unread(pc, &why),
    })
}

/// Once in this time a worker counts pages on every core.
pub(super) fn stat_interval(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.number("/proc/sys/vm/stat_interval") {
        Ok(seconds) => Look::judge(seconds >= 10, format!("{seconds} s"), cures::apply(pc)),
        Err(why) => Look::unknown(why.to_string()),
    })
}
