//! The network interface of the field bus.

use super::{Look, Pc};
use crate::doctor::experiments::NoAnswer;
use crate::doctor::fixes;

/// Drivers of NICs that can send a frame at a given time: Intel i210/i211, i225/i226; parts with a GMAC.
const LAUNCH_TIME: [&str; 4] = ["igb", "igc", "stmmaceth", "st_gmac"];

/// The interface, where one is named and there.
pub(super) fn present<'a>(pc: &'a Pc<'_>) -> Option<&'a str> {
    let name = pc.target.interface.as_deref()?;
    (is_interface_name(name) && pc.exists(&format!("/sys/class/net/{name}"))).then_some(name)
}

/// Whether it is made by software (veth, TAP): it has no link of its own.
fn is_virtual(pc: &Pc<'_>, name: &str) -> bool {
    !pc.exists(&format!("/sys/class/net/{name}/device"))
}

/// Whether it can be the name of an interface, and so part of a path.
pub fn is_interface_name(name: &str) -> bool {
    (1..16).contains(&name.len())
        && !matches!(name, "." | "..")
        && name.chars().all(|c| c.is_ascii_graphic() && c != '/')
}

/// Numbers of its interrupts.
pub(super) fn interrupts(pc: &Pc<'_>) -> Vec<String> {
    let Some(name) = present(pc) else {
        return Vec::new();
    };
    let folder = format!("/sys/class/net/{name}/device");
    // The driver of a virtual machine's interface is a device on top of the PCI device.
    let below = match pc.link_name(&format!("{folder}/subsystem")).as_deref() {
        Some("virtio") => "../msi_irqs",
        _ => "msi_irqs",
    };
    let mut numbers = pc.names(&format!("{folder}/{below}")).unwrap_or_default();
    // Others carry its name, as in enp2s0-TxRx-0.
    let is_ours = |action: &str| {
        let rest = action.strip_prefix(name);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['-', ':']))
    };
    let named = |number: &String| irq_actions(pc, number).is_some_and(|actions| actions.split(',').any(is_ours));
    numbers.extend(
        pc.names("/sys/kernel/irq")
            .unwrap_or_default()
            .into_iter()
            .filter(named),
    );
    numbers.sort();
    numbers.dedup();
    numbers
}

/// What has asked for an interrupt, with commas between; empty: nothing, so that it does not come.
pub(super) fn irq_actions(pc: &Pc<'_>, number: &str) -> Option<String> {
    pc.text(&format!("/sys/kernel/irq/{number}/actions")).ok()
}

/// Whether there is such an interface.
pub(super) fn interface(pc: &Pc<'_>) -> Option<Look> {
    let Some(name) = pc.target.interface.as_deref() else {
        return Some(
            Look::unknown("none named").with_fix("isocnc doctor --interface IF, or isocnc doctor MACHINE.toml"),
        );
    };
    let others: Vec<String> = match pc.names("/sys/class/net") {
        Ok(names) => names.into_iter().filter(|other| other != "lo").collect(),
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    Some(match (present(pc), others.as_slice()) {
        (Some(name), _) => Look::ok(name),
        (None, []) => Look::missing(
            format!("{name} does not exist, nor does any other"),
            "ip link shows what there is",
        ),
        (None, others) => {
            let fix = format!(
                "set bus.interface in the machine file, or --interface, to one of {}",
                others.join(", ")
            );
            Look::missing(format!("{name} does not exist"), fix)
        }
    })
}

/// Whether the cable is in.
pub(super) fn link(pc: &Pc<'_>) -> Option<Look> {
    let name = present(pc)?;
    let state = pc.word(&format!("/sys/class/net/{name}/operstate"));
    Some(match state.as_deref() {
        // A driver that does not tell counts as up to the kernel, too.
        Ok("up" | "unknown") => Look::ok("up"),
        Ok(state) => Look::missing(
            state,
            format!("sudo ip link set {name} up, and look at the cable and the far end"),
        ),
        Err(why) => Look::unknown(why.to_string()),
    })
}

/// What sort of NIC.
pub(super) fn driver(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "use a NIC on PCI Express (Intel i210, i225, i226): frames wait in a USB adapter";
    let name = present(pc)?;
    let driver = match pc.tries.driver(name) {
        Ok(driver) => driver,
        Err(NoAnswer::NotSupported) => return Some(Look::unknown("the driver does not tell its name")),
        Err(NoAnswer::Refused(why)) => return Some(Look::unknown(why)),
    };
    let bus = pc.link_name(&format!("/sys/class/net/{name}/device/subsystem"));
    let found = match bus.as_deref() {
        None => format!("{driver}, no device"),
        Some(bus) => format!("{driver} on {bus}"),
    };
    Some(Look::judge(bus.as_deref() != Some("usb"), found, FIX))
}

/// Speed and duplex of the link.
pub(super) fn speed(pc: &Pc<'_>) -> Option<Look> {
    let name = present(pc)?;
    if is_virtual(pc, name) {
        return Some(Look::ok("no device: no wire"));
    }
    let file = |file: &str| format!("/sys/class/net/{name}/{file}");
    let speed = match pc.number(&file("speed")) {
        Ok(speed) if speed > 0 => speed,
        // -1, or an error: the link is down or has none.
        Ok(_) | Err(_) => return Some(Look::unknown("the link tells no speed")),
    };
    let duplex = pc.word(&file("duplex")).unwrap_or_default();
    let found = format!("{speed} Mbit/s {duplex}");
    // Controlled nodes are 100BASE-TX; half duplex behind a hub, full duplex to one node or a switch inside a drive.
    let fix = format!("sudo ethtool -s {name} speed 100 duplex full autoneg off");
    Some(Look::judge(speed == 100, found.trim_end(), fix))
}

/// Frames of the IP stack would come between those of the bus.
pub(super) fn addresses(pc: &Pc<'_>) -> Option<Look> {
    let name = present(pc)?;
    let fix = format!(
        "sudo ip addr flush dev {name}; sudo sysctl net.ipv6.conf.{name}.disable_ipv6=1 (no IP on it any more)"
    );
    Some(match pc.tries.addresses(name) {
        Ok(addresses) if addresses.is_empty() => Look::ok("none"),
        Ok(addresses) => Look::missing(addresses.join(", "), fix),
        Err(why) => Look::unknown(why),
    })
}

/// Whether the NIC waits for more frames before it tells of one.
pub(super) fn coalescing(pc: &Pc<'_>) -> Option<Look> {
    let name = present(pc)?;
    let fix = fixes::apply(pc);
    Some(match pc.tries.coalescing(name) {
        Ok(set) => {
            let mut found = format!("rx {} us, tx {} us", set.rx_usecs, set.tx_usecs);
            if set.adaptive {
                found.push_str(", adaptive");
            }
            Look::judge(set.rx_usecs == 0 && set.tx_usecs == 0 && !set.adaptive, found, fix)
        }
        Err(NoAnswer::NotSupported) => Look::ok("none in this driver"),
        Err(NoAnswer::Refused(why)) => Look::unknown(why),
    })
}

/// Whether frames are gathered on their way.
pub(super) fn offloads(pc: &Pc<'_>) -> Option<Look> {
    let name = present(pc)?;
    Some(match pc.tries.offloads(name) {
        Ok(on) if on.is_empty() => Look::ok("off"),
        Ok(on) => {
            let names: Vec<&str> = on.iter().map(|offload| offload.name()).collect();
            Look::missing(names.join(", "), fixes::apply(pc))
        }
        Err(NoAnswer::NotSupported) => Look::ok("none in this driver"),
        Err(NoAnswer::Refused(why)) => Look::unknown(why),
    })
}

/// Whether the link sleeps between frames.
pub(super) fn energy_efficient(pc: &Pc<'_>) -> Option<Look> {
    Some(on_or_off(pc, pc.tries.energy_efficient(present(pc)?)))
}

/// Whether the far end may stop our frames.
pub(super) fn flow_control(pc: &Pc<'_>) -> Option<Look> {
    Some(on_or_off(pc, pc.tries.flow_control(present(pc)?)))
}

fn on_or_off(pc: &Pc<'_>, on: Result<bool, NoAnswer>) -> Look {
    match on {
        Ok(on) => Look::judge(!on, if on { "on" } else { "off" }, fixes::apply(pc)),
        Err(NoAnswer::NotSupported) => Look::ok("none in this driver"),
        Err(NoAnswer::Refused(why)) => Look::unknown(why),
    }
}

/// One queue has one interrupt to place.
pub(super) fn queues(pc: &Pc<'_>) -> Option<Look> {
    let name = present(pc)?;
    Some(match pc.names(&format!("/sys/class/net/{name}/queues")) {
        Ok(queues) => {
            let count = queues.iter().filter(|queue| queue.starts_with("rx-")).count();
            Look::judge(
                count <= 1,
                count.to_string(),
                format!("sudo ethtool -L {name} combined 1"),
            )
        }
        Err(why) => Look::unknown(why.to_string()),
    })
}

/// Whether received frames go to another core first.
pub(super) fn packet_steering(pc: &Pc<'_>) -> Option<Look> {
    let name = present(pc)?;
    let folder = format!("/sys/class/net/{name}/queues");
    let queues = pc.names(&folder).unwrap_or_default();
    let masks = queues.iter().filter(|queue| queue.starts_with("rx-"));
    let masks: Result<Vec<_>, _> = masks
        .map(|queue| pc.cpu_mask(&format!("{folder}/{queue}/rps_cpus")))
        .collect();
    Some(match masks {
        Ok(masks) => match masks.iter().find(|mask| !mask.is_empty()) {
            None => Look::ok("off"),
            Some(mask) => Look::missing(format!("to {}", super::core::cores(mask)), fixes::apply(pc)),
        },
        Err(why) => Look::unknown(why.to_string()),
    })
}

/// Whether the NIC has an interrupt of its own: on a line that others share, their handlers run first or in between.
pub(super) fn interrupt_line(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "another slot or driver, or MSI in its BIOS: a line is shared and slow";
    let name = present(pc)?;
    if is_virtual(pc, name) {
        return Some(Look::ok("no device: no interrupt"));
    }
    let numbers = interrupts(pc);
    if numbers.is_empty() {
        return Some(Look::unknown("the kernel does not tell its interrupt"));
    }
    let mut own = Vec::new();
    for number in &numbers {
        let chip = match pc.text(&format!("/sys/kernel/irq/{number}/chip_name")) {
            Ok(chip) => chip,
            Err(why) => return Some(Look::unknown(why.to_string())),
        };
        let actions = irq_actions(pc, number).unwrap_or_default();
        if actions.contains(',') {
            return Some(Look::missing(
                format!("{number} shared: {}", actions.escape_debug()),
                FIX,
            ));
        }
        // MSI of a virtio device of a virtual machine, of an IOMMU (IR-PCI-MSI), of other buses.
        if !chip.contains("MSI") {
            return Some(Look::missing(
                format!("{number} by line ({})", chip.escape_debug()),
                FIX,
            ));
        }
        own.push(number.as_str());
    }
    Some(Look::ok(format!("by message ({})", own.join(", "))))
}

/// On a kernel with interrupt threads: whether the NIC's comes before the others.
pub(super) fn interrupt_thread(pc: &Pc<'_>) -> Option<Look> {
    /// Above the default of all interrupt threads, 50.
    const PRIORITY_MIN: u64 = 85;
    /// Its field in `/proc/PID/stat`.
    const RT_PRIORITY: usize = 40;
    present(pc)?;
    let processes = match pc.processes() {
        Ok(processes) => processes,
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    let numbers = interrupts(pc);
    // `irq/36-eth0`, cut to 15 characters.
    let is_ours = |comm: &str| {
        let number = comm.strip_prefix("irq/").and_then(|rest| rest.split('-').next());
        number.is_some_and(|number| numbers.iter().any(|own| own == number))
    };
    let ours: Vec<_> = processes.into_iter().filter(|(_, comm)| is_ours(comm)).collect();
    if ours.is_empty() {
        return Some(Look::ok("none: frames come in the interrupt"));
    }
    let priority = |pid: &str| pc.process_field(pid, RT_PRIORITY);
    let low = ours
        .iter()
        .find(|(pid, _)| priority(pid).is_none_or(|priority| priority < PRIORITY_MIN));
    Some(match low {
        None => Look::ok(format!("FIFO {PRIORITY_MIN} or more")),
        Some((pid, comm)) => match priority(pid) {
            Some(priority) => Look::missing(
                format!("{comm}: FIFO {priority}"),
                format!("sudo chrt -f -p {PRIORITY_MIN} {pid}"),
            ),
            None => Look::unknown(format!("/proc/{pid}/stat tells no priority")),
        },
    })
}

/// Whether the PCI Express link of the NIC sleeps.
pub(super) fn link_power(pc: &Pc<'_>) -> Option<Look> {
    const FILE: &str = "/sys/module/pcie_aspm/parameters/policy";
    let name = present(pc)?;
    if is_virtual(pc, name) {
        return Some(Look::ok("no device: no link"));
    }
    if pc.boot_value("pcie_aspm").ok().flatten().as_deref() == Some("off") {
        return Some(Look::ok("pcie_aspm=off"));
    }
    Some(match pc.chosen(FILE, '[', ']') {
        Ok(policy) => Look::judge(policy == "performance", policy.clone(), fixes::apply(pc)),
        Err(why) => Look::unread(pc, &why),
    })
}

/// Who can tell when a frame was on the wire.
pub(super) fn time_stamps(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "none by software; a NIC with a clock (Intel i210, i225, i226) measures on the wire";
    let name = present(pc)?;
    Some(match pc.tries.time_stamps(name) {
        Ok(stamps) if stamps.hardware => Look::ok("hardware"),
        Ok(_) | Err(NoAnswer::NotSupported) => Look::missing("kernel", FIX),
        Err(NoAnswer::Refused(why)) => Look::unknown(why),
    })
}

/// Whether the NIC can send the SoC by its own clock.
pub(super) fn launch_time(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "none by software; Intel i210, i225 and i226 (drivers igb, igc) can";
    let name = present(pc)?;
    Some(match pc.tries.driver(name) {
        Ok(driver) if LAUNCH_TIME.contains(&driver.as_str()) => Look::ok(format!("yes ({driver}, with ETF)")),
        Ok(driver) => Look::missing(format!("no ({driver})"), FIX),
        Err(NoAnswer::NotSupported) => Look::unknown("the driver does not tell its name"),
        Err(NoAnswer::Refused(why)) => Look::unknown(why),
    })
}
