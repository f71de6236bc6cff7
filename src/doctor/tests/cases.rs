//! What is changed on the good PC, and what the line then says.

use super::fake::Answers;
use crate::doctor::State;

/// One change.
pub(super) struct Case {
    /// The line that must notice.
    pub(super) line: &'static str,
    pub(super) state: State,
    /// Stands in what was found.
    pub(super) found: &'static str,
    /// Stands in the cure.
    pub(super) fix: &'static str,
    /// Files with other contents; `later:` before the path: changed while the PC is watched.
    pub(super) files: &'static [(&'static str, &'static str)],
    /// Files and folders that are not there.
    pub(super) gone: &'static [&'static str],
    pub(super) answers: fn(&mut Answers),
}

const NOTHING: Case = Case {
    line: "",
    state: State::Unknown,
    found: "",
    fix: "",
    files: &[],
    gone: &[],
    answers: |_| {},
};

const fn ok(line: &'static str, found: &'static str) -> Case {
    Case {
        line,
        state: State::Ok,
        found,
        ..NOTHING
    }
}

const fn missing(line: &'static str, found: &'static str, fix: &'static str) -> Case {
    Case {
        line,
        state: State::Missing,
        found,
        fix,
        ..NOTHING
    }
}

const fn unknown(line: &'static str, found: &'static str) -> Case {
    Case {
        line,
        state: State::Unknown,
        found,
        ..NOTHING
    }
}

impl Case {
    const fn with(self, files: &'static [(&'static str, &'static str)]) -> Case {
        Case { files, ..self }
    }

    const fn without(self, gone: &'static [&'static str]) -> Case {
        Case { gone, ..self }
    }

    const fn when(self, answers: fn(&mut Answers)) -> Case {
        Case { answers, ..self }
    }
}

const APPLY: &str = "scripts/isolcpus.sh apply --cpus 3";
const CLOCK: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
const CLOCKS: &str = "/sys/devices/system/clocksource/clocksource0/available_clocksource";

/// All changes.
#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    missing("PREEMPT_RT", "no, 6.18 PREEMPT_DYNAMIC", "linux-image-rt-amd64").without(&["/sys/kernel/realtime"])
        .with(&[("/proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC @0"), ("/proc/sys/kernel/osrelease", "6.18")]),
    missing("PREEMPT_RT", "without preemption", "linux-realtime").without(&["/sys/kernel/realtime"])
        .with(&[("/proc/sys/kernel/version", "#1 SMP"), ("/etc/os-release", "ID=ubuntu")]),
    ok("PREEMPT_RT", "yes, 6.12.9").without(&["/sys/kernel/realtime"]),
    unknown("PREEMPT_RT", "no /proc/sys/kernel/version").without(&["/sys/kernel/realtime", "/proc/sys/kernel/version"]),

    missing("preemption", "voluntary", "preempt=full").without(&["/sys/kernel/realtime"])
        .with(&[("/sys/kernel/debug/sched/preempt", "none (voluntary) full lazy")]),
    ok("preemption", "full").without(&["/sys/kernel/realtime"])
        .with(&[("/sys/kernel/debug/sched/preempt", "none voluntary (full) lazy")]),
    ok("preemption", "full").without(&["/sys/kernel/realtime"]).with(&[("/proc/cmdline", "quiet preempt=full")]),
    unknown("preemption", "no /sys/kernel/debug/sched/preempt").without(&["/sys/kernel/realtime"]),

    missing("kernel options", "without NO_HZ_FULL, RCU_NOCB_CPU", "take a kernel")
        .with(&[("/boot/config-6.12.9-rt-amd64", "CONFIG_HIGH_RES_TIMERS=y\nCONFIG_CPU_ISOLATION=y\n\
            # CONFIG_NO_HZ_FULL is not set\nCONFIG_RCU_NOCB_CPU=m\n")]),
    ok("kernel options", "all").without(&["/boot"]).with(&[("/proc/config.gz", "\u{1f}")])
        .when(|answers| answers.unzipped = Ok("CONFIG_HIGH_RES_TIMERS=y\nCONFIG_CPU_ISOLATION=y\nCONFIG_NO_HZ_FULL=y\n\
            CONFIG_RCU_NOCB_CPU=y\n".into())),
    unknown("kernel options", "neither /proc/config.gz nor /boot/config-6.12.9-rt-amd64").without(&["/boot"]),
    unknown("kernel options", "not here").without(&["/boot"]).with(&[("/proc/config.gz", "")]),

    missing("timer resolution", "4000000 ns", "highres=on").when(|answers| answers.timer_resolution_ns = Ok(4_000_000)),
    unknown("timer resolution", "not here").when(|answers| answers.timer_resolution_ns = Err("not here".into())),

    missing("virtual machine", "yes, KVMKVMKVM, QEMU", "a PC of its own")
        .with(&[("/sys/class/dmi/id/sys_vendor", "QEMU\n")])
        .when(|answers| answers.hypervisor = Some("KVMKVMKVM".into())),
    missing("virtual machine", "yes, Advantech", "").with(&[("/proc/cpuinfo", "flags : tsc hypervisor lahf_lm")]),
    ok("virtual machine", "no").without(&["/sys/class/dmi"]),

    missing("stolen time", "30 ms in 1.0 s, 1 s since boot", "CPU pinning")
        .with(&[("/proc/stat", "cpu3 1 2 3 4 5 6 7 100 0 0"), ("later:/proc/stat", "cpu3 1 2 3 4 5 6 7 103 0 0")]),
    ok("stolen time", "0 ms in 1.0 s, 1 s since boot").with(&[("/proc/stat", "cpu3 1 2 3 4 5 6 7 100 0 0")]),
    unknown("stolen time", "core 3").with(&[("/proc/stat", "cpu30 1 2 3 4 5 6 7 8 9")]),
    unknown("stolen time", "core 3").with(&[("/proc/stat", "cpu3 1 2 3 4 5 6 7")]),

    missing("clock source", "hpet", "echo tsc | sudo tee").with(&[(CLOCK, "hpet\n")]),
    missing("clock source", "acpi_pm", "tsc=reliable").with(&[(CLOCK, "acpi_pm\n"), (CLOCKS, "hpet acpi_pm\n")]),
    ok("clock source", "kvm-clock").with(&[(CLOCK, "kvm-clock\n")]),
    unknown("clock source", "no /sys/devices").without(&[CLOCK]),

    missing("TSC", "without nonstop_tsc", "newer processor").with(&[("/proc/cpuinfo", "flags : tsc constant_tsc")]),
    unknown("TSC", "not an x86").with(&[("/proc/cpuinfo", "Features : fp asimd")]),

    missing("lock-up watchdog", "on, on cores 0-3", APPLY).with(&[("/proc/sys/kernel/watchdog_cpumask", "0-3")]),
    missing("lock-up watchdog", "on", APPLY).without(&["/proc/sys/kernel/watchdog_cpumask"]),
    ok("lock-up watchdog", "off").with(&[("/proc/sys/kernel/watchdog", "0"), ("/proc/sys/kernel/watchdog_cpumask", "x")]),
    unknown("lock-up watchdog", "holds \"on\"").with(&[("/proc/sys/kernel/watchdog", "on")]),

    missing("NMI watchdog", "on", "sudo sysctl kernel.nmi_watchdog=0").with(&[("/proc/sys/kernel/nmi_watchdog", "1")]),
    unknown("NMI watchdog", "no /proc").without(&["/proc/sys/kernel/nmi_watchdog"]),

    missing("workqueues", "cores 0-3", APPLY).with(&[("/sys/devices/virtual/workqueue/cpumask", "f")]),
    ok("workqueues", "cores 0").with(&[("/sys/devices/virtual/workqueue/cpumask", "00000000,00000001")]),
    unknown("workqueues", "holds \"all\"").with(&[("/sys/devices/virtual/workqueue/cpumask", "all")]),

    missing("timer migration", "on", APPLY).with(&[("/proc/sys/kernel/timer_migration", "1")]),
    unknown("timer migration", "no /proc").without(&["/proc/sys/kernel/timer_migration"]),

    missing("vm.stat_interval", "1 s", APPLY).with(&[("/proc/sys/vm/stat_interval", "1")]),
    ok("vm.stat_interval", "120 s").with(&[("/proc/sys/vm/stat_interval", "120")]),
    unknown("vm.stat_interval", "not a number").with(&[("/proc/sys/vm/stat_interval", "")]),
];
