//! The core of the real-time threads, and who else comes there.

use super::pc::{ISOLATED, ONLINE};
use super::{Cpus, Look, Pc, Unread};
use crate::doctor::fixes;
use crate::other_controls;
use std::collections::BTreeMap;

const CPU: &str = "/sys/devices/system/cpu";

/// Whether there is such a core, and another one for everything else.
pub(super) fn core(pc: &Pc<'_>) -> Option<Look> {
    let online = match pc.cpu_list(ONLINE) {
        Ok(online) => online,
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    let cpu = pc.cpu();
    Some(if !online.contains(cpu) {
        let fix = format!("set rt.cpu in the machine file, or --cpu, to one of {online}");
        Look::missing(format!("core {cpu} is not online"), fix)
    } else if online.len() == 1 {
        Look::missing(
            "the only one",
            "use a PC with two or more cores: one is for everything else",
        )
    } else {
        let boot = if cpu == 0 {
            ", which keeps the time for all: better another"
        } else {
            ""
        };
        Look::ok(format!("core {cpu} of {online}{boot}"))
    })
}

/// Whether the core is that of another control as well.
pub(super) fn other_control(pc: &Pc<'_>) -> Option<Look> {
    if let Err(why) = pc.processes() {
        return Some(Look::unknown(why.to_string()));
    }
    let others = other_controls::find(&pc.at("/proc"), std::process::id());
    // A control that asks for this look is no other one.
    let asks = nix::unistd::getppid().as_raw();
    let mut others = others
        .iter()
        .filter(|other| i64::from(other.process) != i64::from(asks));
    let here = others.find(|other| other.cpu == pc.cpu());
    Some(match here {
        None => Look::ok("none"),
        Some(other) => {
            let fix = "set rt.cpu in one of the machine files to another core, if both are to run at the same time";
            Look::missing(format!("process {}", other.process), fix)
        }
    })
}

/// Cores that the scheduler leaves alone: since boot, or as an isolated partition of control groups.
fn isolated_cores(pc: &Pc<'_>) -> Result<(Cpus, Cpus), Unread> {
    let partitions = pc.cpu_list("/sys/fs/cgroup/cpuset.cpus.isolated").unwrap_or_default();
    match pc.cpu_list(ISOLATED) {
        Ok(boot) => Ok((boot, partitions)),
        Err(_) if !partitions.is_empty() => Ok((Cpus::default(), partitions)),
        Err(why) => Err(why),
    }
}

/// Whether ordinary threads stay away.
pub(super) fn isolated(pc: &Pc<'_>) -> Option<Look> {
    Some(match isolated_cores(pc) {
        Ok((boot, _)) if boot.contains(pc.cpu()) => Look::ok(cores(&boot)),
        Ok((_, partitions)) if partitions.contains(pc.cpu()) => Look::ok(format!("{} (cgroup)", cores(&partitions))),
        Ok((boot, _)) => Look::missing(cores(&boot), fixes::persist(pc)),
        Err(why) => Look::unknown(why.to_string()),
    })
}

/// Whether the tick stops while one thread runs.
pub(super) fn nohz_full(pc: &Pc<'_>) -> Option<Look> {
    let path = format!("{CPU}/nohz_full");
    let list = match pc.text(&path).as_deref() {
        // A mask that was never made.
        Ok("(null)" | "") => Ok(Cpus::default()),
        _ => pc.cpu_list(&path),
    };
    Some(match list {
        Ok(list) => Look::judge(list.contains(pc.cpu()), cores(&list), fixes::persist(pc)),
        Err(Unread::Absent(_)) if pc.exists(CPU) => Look::missing(
            "not in this kernel",
            "take a kernel with CONFIG_NO_HZ_FULL (the gain is small)",
        ),
        Err(why) => Look::unknown(why.to_string()),
    })
}

/// Whether callbacks of RCU run elsewhere.
pub(super) fn rcu_nocbs(pc: &Pc<'_>) -> Option<Look> {
    let possible = pc.cpu_list(&format!("{CPU}/possible")).unwrap_or_default();
    // The one implies the other.
    let mut lists = Vec::new();
    for name in ["rcu_nocbs", "nohz_full"] {
        match pc.boot_value(name) {
            Ok(list) => lists.extend(list.and_then(|list| Cpus::parse_boot_list(&list, &possible))),
            Err(why) => return Some(Look::unknown(why.to_string())),
        }
    }
    let list = lists.iter().find(|list| list.contains(pc.cpu()));
    Some(match list.or(lists.first()) {
        Some(list) => Look::judge(list.contains(pc.cpu()), cores(list), fixes::persist(pc)),
        None => Look::missing("none", fixes::persist(pc)),
    })
}

fn siblings(pc: &Pc<'_>) -> Result<Cpus, Unread> {
    pc.cpu_list(&format!("{CPU}/cpu{}/topology/thread_siblings_list", pc.cpu()))
}

/// The core and those that share its units.
pub(super) fn with_siblings(pc: &Pc<'_>) -> Cpus {
    siblings(pc).unwrap_or_default().with(pc.cpu())
}

/// Whether something is left for all other work when those that share the core's units are isolated with it: not core 0,
/// which keeps the time, and one more core at least.
pub(super) fn can_isolate_siblings(pc: &Pc<'_>) -> bool {
    let taken = with_siblings(pc);
    let online = pc.cpu_list(ONLINE).unwrap_or_default();
    !taken.contains(0) && online.iter().any(|cpu| !taken.contains(cpu))
}

/// Whether another thread shares the core's units.
pub(super) fn sibling(pc: &Pc<'_>) -> Option<Look> {
    let siblings = match siblings(pc) {
        Ok(all) => all.without(pc.cpu()),
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    let Some(last) = siblings.last() else {
        return Some(Look::ok("none"));
    };
    let (boot, partitions) = isolated_cores(pc).unwrap_or_default();
    let alone = siblings
        .iter()
        .all(|cpu| boot.contains(cpu) || partitions.contains(cpu));
    let found = match (alone, busy_percent(pc, last)) {
        (true, _) => format!("{}, isolated, too", cores(&siblings)),
        (false, Some(busy)) => format!("{}, {busy} % busy", cores(&siblings)),
        (false, None) => cores(&siblings),
    };
    let fix = match can_isolate_siblings(pc) {
        true => fixes::persist(pc),
        false => fixes::boot_with("nosmt"),
    };
    Some(Look::judge(alone, found, fix))
}

/// How busy a core was while the PC was watched; `None`: it cannot be told.
fn busy_percent(pc: &Pc<'_>, cpu: usize) -> Option<u64> {
    let name = format!("cpu{cpu}");
    // user nice system idle iowait irq softirq steal
    let ticks = |stat: &str| -> Option<(u64, u64)> {
        let line = stat
            .lines()
            .find(|line| line.split_whitespace().next() == Some(&name))?;
        let ticks: Vec<u64> = line
            .split_whitespace()
            .skip(1)
            .take(8)
            .map_while(|word| word.parse().ok())
            .collect();
        let idle = ticks.get(3)?.checked_add(*ticks.get(4)?)?;
        Some((ticks.iter().try_fold(0u64, |sum, part| sum.checked_add(*part))?, idle))
    };
    let [before, after] = &pc.activity.stat;
    let ((all, idle), (all_after, idle_after)) = (ticks(before)?, ticks(after)?);
    let (all, idle) = (all_after.checked_sub(all)?, idle_after.checked_sub(idle)?);
    // Ten ticks at least: with less, a share means nothing.
    (all >= 10).then(|| all.saturating_sub(idle).saturating_mul(100) / all)
}

/// An interrupt that may come to the core.
struct Irq {
    number: String,
    name: String,
    comes: u64,
}

/// Interrupts that are sent to the core, those of the field bus aside.
pub(super) fn interrupts(pc: &Pc<'_>) -> Option<Look> {
    const FOLDER: &str = "/proc/irq";
    let numbers = match pc.names(FOLDER) {
        Ok(names) => names.into_iter().filter(|name| name.parse::<u32>().is_ok()),
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    let growth = interrupt_growth(&pc.activity.interrupts, pc.cpu());
    let own = super::nic::interrupts(pc);
    let (mut there, mut allowed) = (Vec::new(), 0);
    // What nothing has asked for does not come.
    let comes = |number: &String| super::nic::irq_actions(pc, number).as_deref() != Some("");
    for number in numbers.filter(|number| !own.contains(number) && comes(number)) {
        let list = |file| pc.cpu_list(&format!("{FOLDER}/{number}/{file}")).ok();
        let may = list("smp_affinity_list").is_some_and(|list| list.contains(pc.cpu()));
        // Where an interrupt may go to several cores, the kernel has chosen one; old kernels do not tell.
        let effective = list("effective_affinity_list").filter(|list| !list.is_empty());
        if effective.map_or(may, |list| list.contains(pc.cpu())) {
            let name = irq_name(pc, &number);
            let comes = growth.get(&number).copied().unwrap_or(0);
            there.push(Irq { number, name, comes });
        } else {
            allowed += usize::from(may);
        }
    }
    if there.is_empty() {
        return Some(Look::ok(match allowed {
            0 => "none".to_owned(),
            allowed => format!("none now; {allowed} would be allowed to"),
        }));
    }
    // The busiest first; otherwise in the order of their numbers.
    there.sort_by_key(|irq| std::cmp::Reverse(irq.comes));
    Some(Look::missing(irq_list(&there), fixes::apply(pc)))
}

/// `3 interrupts: 36 virtio1-req.0 (came 120 times), 26 ttyS0, 31 ...`.
fn irq_list(irqs: &[Irq]) -> String {
    const NAMED: usize = 4;
    let one = |irq: &Irq| match irq.comes {
        0 => format!("{} {}", irq.number, irq.name),
        comes => format!("{} {} (came {comes} times)", irq.number, irq.name),
    };
    let named: Vec<String> = irqs.iter().take(NAMED).map(one).collect();
    let more = match irqs.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let count = match irqs.len() {
        1 => "1 interrupt".to_owned(),
        count => format!("{count} interrupts"),
    };
    format!("{count}: {}{more}", named.join(", "))
}

/// What has asked for an interrupt, for a person.
fn irq_name(pc: &Pc<'_>, number: &str) -> String {
    let actions = super::nic::irq_actions(pc, number).unwrap_or_else(|| "of an unknown device".into());
    actions.escape_debug().to_string()
}

/// How often each interrupt came to the core while the PC was watched.
fn interrupt_growth(interrupts: &[String; 2], cpu: usize) -> BTreeMap<String, u64> {
    let counts = |text: &str| -> Option<BTreeMap<String, u64>> {
        let name = format!("CPU{cpu}");
        let column = text.lines().next()?.split_whitespace().position(|word| word == name)?;
        let count = |line: &str| {
            let (number, rest) = line.split_once(':')?;
            Some((
                number.trim().to_owned(),
                rest.split_whitespace().nth(column)?.parse().ok()?,
            ))
        };
        Some(text.lines().skip(1).filter_map(count).collect())
    };
    let [before, after] = interrupts;
    let before = counts(before).unwrap_or_default();
    let grown = counts(after)
        .unwrap_or_default()
        .into_iter()
        .map(|(number, after): (String, u64)| {
            let grown = after.saturating_sub(before.get(&number).copied().unwrap_or(after));
            (number, grown)
        });
    grown.collect()
}

/// A daemon that puts interrupts where it likes.
pub(super) fn irqbalance(pc: &Pc<'_>) -> Option<Look> {
    let pid = match pc.process("irqbalance") {
        Ok(Some(pid)) => pid,
        Ok(None) => return Some(Look::ok("not running")),
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    // What it was started with counts; its file is read at its next start.
    let settings = pc.text(&format!("/proc/{pid}/environ")).or_else(|_| {
        let files = ["/etc/default/irqbalance", "/etc/sysconfig/irqbalance"];
        files.iter().find_map(|path| pc.text(path).ok()).ok_or(())
    });
    let banned = settings.ok().and_then(|settings| banned_cores(&settings));
    // Where it is told nothing it leaves isolated cores alone.
    let spared = match banned {
        Some(banned) => banned,
        None => isolated_cores(pc).unwrap_or_default().0,
    };
    let found = format!("running, leaves out {}", cores(&spared));
    Some(Look::judge(spared.contains(pc.cpu()), found, fixes::apply(pc)))
}

/// From `NAME=value` settings, one a line or with zeros between.
fn banned_cores(settings: &str) -> Option<Cpus> {
    let value = |name: &str| {
        let mut settings = settings.split(['\0', '\n']).map(str::trim).rev();
        let value = settings.find_map(|setting| setting.strip_prefix(name)?.strip_prefix('='))?;
        Some(value.trim_matches(['"', '\'']).to_owned())
    };
    let list = value("IRQBALANCE_BANNED_CPULIST").and_then(|list| Cpus::parse_list(&list));
    list.or_else(|| Cpus::parse_mask(&value("IRQBALANCE_BANNED_CPUS")?))
}

/// `none`, `core 3`, `cores 2-3`.
pub(super) fn cores(cpus: &Cpus) -> String {
    match cpus.len() {
        0 => "none".into(),
        1 => format!("core {cpus}"),
        _ => format!("cores {cpus}"),
    }
}
