//! The kernel, the machine below it and its clock.

use super::{Look, Pc, Unread};
use crate::doctor::fixes;

const CLOCKSOURCE: &str = "/sys/devices/system/clocksource/clocksource0";

/// Whether lateness has a bound.
pub(super) fn preempt_rt(pc: &Pc<'_>) -> Option<Look> {
    let version = pc.text("/proc/sys/kernel/version");
    let release = pc.text("/proc/sys/kernel/osrelease").unwrap_or_default();
    if pc.text("/sys/kernel/realtime").as_deref() == Ok("1") {
        return Some(Look::ok(format!("yes, {release}")));
    }
    let words = match &version {
        Ok(version) => version.split_whitespace(),
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    // `#1 SMP PREEMPT_RT Debian 6.12.9`, or `#1 SMP PREEMPT_DYNAMIC @0`.
    let model = words.into_iter().find(|word| word.starts_with("PREEMPT"));
    Some(match model {
        Some("PREEMPT_RT") => Look::ok(format!("yes, {release}")),
        model => Look::missing(
            format!("no, {release} {}", model.unwrap_or("without preemption")),
            realtime_kernel(pc),
        ),
    })
}

/// How this distribution calls its real-time kernel.
fn realtime_kernel(pc: &Pc<'_>) -> &'static str {
    let release = pc.text("/etc/os-release").unwrap_or_default();
    let id = release.lines().find_map(|line| line.strip_prefix("ID=")).unwrap_or("");
    match id.trim_matches('"') {
        "debian" | "raspbian" => "sudo apt install linux-image-rt-amd64, then reboot into it",
        "ubuntu" => {
            "sudo apt install linux-realtime (up to 24.04: sudo pro enable realtime-kernel), then reboot into it"
        }
        "fedora" | "rhel" | "rocky" | "almalinux" | "centos" => "sudo dnf install kernel-rt, then reboot into it",
        "arch" | "manjaro" => "sudo pacman -S linux-rt, then reboot into it",
        "opensuse-leap" | "opensuse-tumbleweed" | "sles" => "sudo zypper install kernel-rt, then reboot into it",
        _ => "install the real-time kernel of your distribution (Debian: linux-image-rt-amd64), then reboot into it",
    }
}

/// How soon an ordinary kernel lets a thread go.
pub(super) fn preemption(pc: &Pc<'_>) -> Option<Look> {
    const FILE: &str = "/sys/kernel/debug/sched/preempt";
    if pc.text("/sys/kernel/realtime").as_deref() == Ok("1") {
        return Some(Look::ok("real-time kernel"));
    }
    let mode = match pc.chosen(FILE, '(', ')') {
        Ok(mode) => mode,
        Err(why) => match pc.boot_value("preempt") {
            Ok(Some(mode)) => mode,
            Ok(None) | Err(_) => return Some(debugfs_unread(pc, &why)),
        },
    };
    Some(Look::judge(mode == "full", mode, fixes::boot_with("preempt=full")))
}

/// A file below `/sys/kernel/debug` tells nothing: why, and how to see it.
pub(super) fn debugfs_unread(pc: &Pc<'_>, why: &Unread) -> Look {
    match why {
        Unread::Absent(_) if pc.exists("/sys/kernel/debug/sched") => Look::unknown("not in this kernel"),
        Unread::Absent(_) => Look::unknown("debugfs is not mounted")
            .with_fix("sudo mount -t debugfs none /sys/kernel/debug, then sudo isocnc doctor"),
        Unread::Refused(why) => Look::unknown(why).with_fix(fixes::AS_ROOT),
    }
}

/// What the kernel was built with.
pub(super) fn options(pc: &Pc<'_>) -> Option<Look> {
    const WANTED: [&str; 4] = ["HIGH_RES_TIMERS", "CPU_ISOLATION", "NO_HZ_FULL", "RCU_NOCB_CPU"];
    let config = match config(pc) {
        Ok(config) => config,
        Err(why) => return Some(Look::unknown(why)),
    };
    let lacking: Vec<&str> = WANTED.into_iter().filter(|name| !is_built_in(&config, name)).collect();
    let fix = "take a kernel that has them: Debian's linux-image-rt-amd64 and Ubuntu's linux-realtime do";
    Some(match lacking.as_slice() {
        [] => Look::ok("all built in"),
        lacking => Look::missing(format!("without {}", lacking.join(", ")), fix),
    })
}

/// The configuration of the running kernel.
pub(super) fn config(pc: &Pc<'_>) -> Result<String, String> {
    const COMPRESSED: &str = "/proc/config.gz";
    let release = pc.text("/proc/sys/kernel/osrelease").map_err(|why| why.to_string())?;
    let plain = [
        format!("/boot/config-{release}"),
        format!("/lib/modules/{release}/config"),
    ];
    let found = plain.iter().find_map(|path| pc.text(path).ok());
    let text = match found {
        Some(text) => text,
        None if pc.exists(COMPRESSED) => pc.tries.unzip(&pc.at(COMPRESSED))?,
        None => return Err(format!("neither {COMPRESSED} nor {} can be read", plain[0])),
    };
    if text.contains("CONFIG_") {
        Ok(text)
    } else {
        Err("the kernel configuration holds no options".into())
    }
}

/// Whether `CONFIG_name=y` stands in a kernel configuration.
pub(super) fn is_built_in(config: &str, name: &str) -> bool {
    let value = |line: &str| {
        line.strip_prefix("CONFIG_")?
            .strip_prefix(name)?
            .strip_prefix('=')
            .map(|value| value == "y")
    };
    config.lines().find_map(value).unwrap_or(false)
}

/// Without them a wait ends on a tick.
pub(super) fn timers(pc: &Pc<'_>) -> Option<Look> {
    let fix = fixes::boot_with("highres=on (and remove highres=off, nohz=off)");
    Some(match pc.tries.timer_resolution_ns() {
        Ok(ns) => Look::judge(ns == 1, format!("{ns} ns"), fix),
        Err(why) => Look::unknown(format!("clock_getres: {why}")),
    })
}

/// A virtual machine stops whenever its host wants to.
pub(super) fn virtual_machine(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "use a PC of its own: nothing inside a virtual machine gives lateness a bound";
    let vendor = pc.text("/sys/class/dmi/id/sys_vendor").unwrap_or_default();
    let cpuinfo = pc.text("/proc/cpuinfo");
    let flagged = cpuinfo
        .as_ref()
        .is_ok_and(|text| has_flags(text, &["hypervisor"]) == Some(true));
    let name = match pc.tries.hypervisor() {
        Some(name) => name,
        None if flagged => String::new(),
        None => {
            return Some(match cpuinfo {
                Ok(_) if vendor.is_empty() => Look::ok("no"),
                Ok(_) => Look::ok(format!("no, {vendor}")),
                Err(why) => Look::unknown(why.to_string()),
            });
        }
    };
    let named: Vec<&str> = [name.as_str(), vendor.as_str()]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect();
    let found = match named.as_slice() {
        [] => "yes".to_owned(),
        named => format!("yes, {}", named.join(", ")),
    };
    Some(Look::missing(found, FIX))
}

/// Time that the host took away from the core.
pub(super) fn steal(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "give the virtual machine cores of its own on the host (CPU pinning), or use a PC of its own";
    let [before, after] = &pc.activity.stat;
    let ticks = |text: &str| stolen(text, pc.cpu());
    Some(match (ticks(before), ticks(after)) {
        (Some(before), Some(after)) => {
            // A tick of /proc/stat is 10 ms.
            let grown = after.saturating_sub(before) * 10;
            let found = format!(
                "{grown} ms in {:.1} s, {} s since boot",
                pc.activity.seconds,
                after / 100
            );
            Look::judge(grown == 0, found, FIX)
        }
        _ => Look::unknown(format!(
            "/proc/stat has no line of core {} with the time stolen",
            pc.cpu()
        )),
    })
}

/// The 8th number of the core's line.
fn stolen(stat: &str, cpu: usize) -> Option<u64> {
    let name = format!("cpu{cpu}");
    let line = stat
        .lines()
        .find(|line| line.split_whitespace().next() == Some(&name))?;
    // Beyond 2^53 ms no PC has run.
    line.split_whitespace()
        .nth(8)?
        .parse()
        .ok()
        .filter(|ticks| *ticks < 1 << 53)
}

/// What the time is read from.
pub(super) fn clocksource(pc: &Pc<'_>) -> Option<Look> {
    /// Read without a system call; the first two of a PC, the others of their virtual machine or processor.
    const GOOD: [&str; 6] = [
        "tsc",
        "kvm-clock",
        "hyperv_clocksource_tsc_page",
        "arch_sys_counter",
        "riscv_clocksource",
        "timebase",
    ];
    let current = format!("{CLOCKSOURCE}/current_clocksource");
    let name = match pc.word(&current) {
        Ok(name) => name,
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    let available = pc
        .text(&format!("{CLOCKSOURCE}/available_clocksource"))
        .unwrap_or_default();
    let fix = match available.split_whitespace().any(|other| other == "tsc") {
        true => fixes::write("tsc", &current),
        false => "sudo dmesg | grep -i tsc tells why; with constant_tsc and nonstop_tsc: boot with tsc=reliable".into(),
    };
    Some(Look::judge(
        GOOD.contains(&name.as_str()),
        name.escape_default().to_string(),
        fix,
    ))
}

/// Whether the TSC runs evenly and always.
pub(super) fn tsc(pc: &Pc<'_>) -> Option<Look> {
    let cpuinfo = match pc.text("/proc/cpuinfo") {
        Ok(cpuinfo) => cpuinfo,
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    let lacking: Vec<&str> = ["constant_tsc", "nonstop_tsc"]
        .into_iter()
        .filter(|flag| has_flags(&cpuinfo, &[flag]) == Some(false))
        .collect();
    let fix = "use a newer processor; in a virtual machine: pass the host's processor through (-cpu host)";
    Some(match (has_flags(&cpuinfo, &[]), lacking.as_slice()) {
        (None, _) => Look::unknown("/proc/cpuinfo has no line \"flags\" (not an x86 processor)"),
        (Some(_), []) => Look::ok("both"),
        (Some(_), lacking) => Look::missing(format!("without {}", lacking.join(", ")), fix),
    })
}

/// What the firmware does behind the kernel's back stops all cores, and nothing can hold it off.
pub(super) fn smi(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "BIOS: switch off legacy USB, fan control by SMI, ECC logging; update it; else another mainboard";
    if pc.tries.hypervisor().is_some() {
        return Some(Look::unknown("a virtual machine does not count them"));
    }
    Some(match pc.activity.smi.as_ref()? {
        [Ok(before), Ok(after)] if before == after => Look::ok(format!("none ({after} since the PC was switched on)")),
        [Ok(before), Ok(after)] => {
            let came = after.wrapping_sub(*before);
            Look::missing(format!("{came} in {} s", pc.activity.seconds), FIX)
        }
        [Err(Unread::Absent(_)), _] => {
            Look::unknown("not counted: the driver msr is not loaded").with_fix("sudo modprobe msr")
        }
        [Err(why), _] | [_, Err(why)] => Look::unknown(format!("not counted: {why}")),
    })
}

/// Whether the processor has all of them; `None`: it does not say.
fn has_flags(cpuinfo: &str, wanted: &[&str]) -> Option<bool> {
    let line = cpuinfo.lines().find(|line| line.starts_with("flags"))?;
    let flags: Vec<&str> = line.split_whitespace().collect();
    Some(wanted.iter().all(|flag| flags.contains(flag)))
}
