//! What moves memory about while threads run.

use super::{Look, Pc};
use crate::doctor::fixes;

/// khugepaged joins pages, and every core must forget the old ones.
pub(super) fn huge_pages(pc: &Pc<'_>) -> Option<Look> {
    const FILE: &str = "/sys/kernel/mm/transparent_hugepage/enabled";
    Some(match pc.chosen(FILE, '[', ']') {
        Ok(choice) => Look::judge(choice == "never", choice.clone(), fixes::apply(pc)),
        Err(why) => Look::unread(pc, &why),
    })
}

/// Locked memory is not swapped, but what the control asks of others is.
pub(super) fn swap(pc: &Pc<'_>) -> Option<Look> {
    let swaps = match pc.text("/proc/swaps") {
        Ok(swaps) => swaps,
        Err(why) => return Some(Look::unread(pc, &why)),
    };
    if !swaps.starts_with("Filename") {
        return Some(Look::unknown("/proc/swaps does not begin with its headings"));
    }
    let names = swaps.lines().skip(1).filter_map(|line| line.split_whitespace().next());
    let names: Vec<&str> = names.collect();
    let swappiness = pc.number("/proc/sys/vm/swappiness");
    Some(match (names.as_slice(), swappiness) {
        ([], _) => Look::ok("none"),
        (names, Ok(0 | 1)) => Look::ok(format!("{}, hardly used (vm.swappiness)", names.join(", "))),
        (names, _) => Look::missing(names.join(", "), "sudo swapoff -a, and take it out of /etc/fstab"),
    })
}

/// Merges equal pages.
pub(super) fn same_pages(pc: &Pc<'_>) -> Option<Look> {
    const FILE: &str = "/sys/kernel/mm/ksm/run";
    Some(match pc.number(FILE) {
        // 2: it has taken its work back and stopped.
        Ok(0 | 2) => Look::ok("off"),
        Ok(_) => Look::missing("on", fixes::apply(pc)),
        Err(why) => Look::unread(pc, &why),
    })
}

/// Takes pages away to see who asks for them.
pub(super) fn numa_balancing(pc: &Pc<'_>) -> Option<Look> {
    Some(match pc.number("/proc/sys/kernel/numa_balancing") {
        Ok(0) => Look::ok("off"),
        Ok(_) => Look::missing("on", fixes::apply(pc)),
        Err(why) => Look::unread(pc, &why),
    })
}
