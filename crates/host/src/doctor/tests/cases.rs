//! What is changed on the good PC, and what the line then says.

use super::fake::{Answers, LATENCY, SMI_AFTER, silent};
use crate::doctor::{Coalescing, Latency, NoAnswer, Offload, State, Target, TimeStamps};

#[derive(Debug)]
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
    pub(super) answers: fn(&mut Answers, &mut Target),
}

const NOTHING: Case = Case {
    line: "",
    state: State::Unknown,
    found: "",
    fix: "",
    files: &[],
    gone: &[],
    answers: |_, _| {},
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

    const fn when(self, answers: fn(&mut Answers, &mut Target)) -> Case {
        Case { answers, ..self }
    }
}

const APPLY: &str = "sudo scripts/isolcpus.sh apply --cpus 3 --interface eth1";
const PERSIST: &str = "scripts/isolcpus.sh persist --cpus 3, then reboot";
const GRANT: &str = "sudo setcap cap_sys_nice,cap_ipc_lock,cap_net_raw+ep '/opt/iso cnc/isocnc'";
const SIBLINGS: &str = "/sys/devices/system/cpu/cpu3/topology/thread_siblings_list";
const FAIR: &str = "/sys/kernel/debug/sched/fair_server/cpu3/runtime";
const CONFIG: &str = "/boot/config-6.12.9-rt-amd64";
const HUGE: &str = "/sys/kernel/mm/transparent_hugepage/enabled";
const CLOCK: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
const CLOCKS: &str = "/sys/devices/system/clocksource/clocksource0/available_clocksource";

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
    unknown("preemption", "not in this kernel").without(&["/sys/kernel/realtime"]),
    unknown("preemption", "debugfs is not mounted").without(&["/sys/kernel/realtime", "/sys/kernel/debug"]),

    missing("kernel options", "without NO_HZ_FULL, RCU_NOCB_CPU", "take a kernel")
        .with(&[("/boot/config-6.12.9-rt-amd64", "CONFIG_HIGH_RES_TIMERS=y\nCONFIG_CPU_ISOLATION=y\n\
            # CONFIG_NO_HZ_FULL is not set\nCONFIG_RCU_NOCB_CPU=m\n")]),
    ok("kernel options", "all").without(&["/boot"]).with(&[("/proc/config.gz", "\u{1f}")])
        .when(|answers, _| answers.unzipped = Ok("CONFIG_HIGH_RES_TIMERS=y\nCONFIG_CPU_ISOLATION=y\nCONFIG_NO_HZ_FULL=y\n\
            CONFIG_RCU_NOCB_CPU=y\n".into())),
    unknown("kernel options", "neither /proc/config.gz nor /boot/config-6.12.9-rt-amd64").without(&["/boot"]),
    unknown("kernel options", "not here").without(&["/boot"]).with(&[("/proc/config.gz", "")]),

    missing("timer resolution", "4000000 ns", "highres=on").when(|answers, _| answers.timer_resolution_ns = Ok(4_000_000)),
    unknown("timer resolution", "not here").when(|answers, _| answers.timer_resolution_ns = Err("not here".into())),

    missing("virtual machine", "yes, KVMKVMKVM, QEMU", "a PC of its own")
        .with(&[("/sys/class/dmi/id/sys_vendor", "QEMU\n")])
        .when(|answers, _| answers.hypervisor = Some("KVMKVMKVM".into())),
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
    missing("SMI", "2 in 1 s", "legacy USB").with(&[("later:/dev/cpu/3/msr", SMI_AFTER)]),
    ok("SMI", "none (5 since the PC was switched on)"),
    unknown("SMI", "the driver msr is not loaded").without(&["/dev/cpu"]),
    // As of a processor that has no such register.
    unknown("SMI", "cannot be read").with(&[("/dev/cpu/3/msr", "")]),
    unknown("SMI", "does not count them").when(|answers, _| answers.hypervisor = Some("KVMKVMKVM".into())),

    unknown("TSC", "not an x86").with(&[("/proc/cpuinfo", "Features : fp asimd")]),

    missing("lock-up watchdog", "on, on cores 0-3", APPLY).with(&[("/proc/sys/kernel/watchdog_cpumask", "0-3")]),
    missing("lock-up watchdog", "on", APPLY).without(&["/proc/sys/kernel/watchdog_cpumask"]),
    ok("lock-up watchdog", "off").with(&[("/proc/sys/kernel/watchdog", "0"), ("/proc/sys/kernel/watchdog_cpumask", "x")]),
    unknown("lock-up watchdog", "holds \"on\"").with(&[("/proc/sys/kernel/watchdog", "on")]),

    missing("NMI watchdog", "on", "sudo sysctl kernel.nmi_watchdog=0").with(&[("/proc/sys/kernel/nmi_watchdog", "1")]),
    ok("NMI watchdog", "not in this kernel").without(&["/proc/sys/kernel/nmi_watchdog"]),
    unknown("NMI watchdog", "holds \"on\"").with(&[("/proc/sys/kernel/nmi_watchdog", "on")]),

    missing("workqueues", "cores 0-3", APPLY).with(&[("/sys/devices/virtual/workqueue/cpumask", "f")]),
    ok("workqueues", "cores 0").with(&[("/sys/devices/virtual/workqueue/cpumask", "00000000,00000001")]),
    unknown("workqueues", "holds \"all\"").with(&[("/sys/devices/virtual/workqueue/cpumask", "all")]),

    missing("kernel threads", "1: kswapd0", APPLY).with(&[("/proc/90/status", "Cpus_allowed_list:\t0-3\n")]),
    missing("kernel threads", "4: kswapd0, a, b and 1 more", APPLY).with(&[("/proc/90/status", "Cpus_allowed_list:3\n"),
        ("/proc/91/stat", "91 (a) S 2 0 0 0 -1 0"), ("/proc/91/status", "Cpus_allowed_list: 3"), ("/proc/91/comm", "a"),
        ("/proc/92/stat", "92 (b) S 2 0 0 0 -1 0"), ("/proc/92/status", "Cpus_allowed_list: 3"), ("/proc/92/comm", "b"),
        ("/proc/93/stat", "93 (c) S 2 0 0 0 -1 0"), ("/proc/93/status", "Cpus_allowed_list: 3"), ("/proc/93/comm", "c")]),
    ok("kernel threads", "none").with(&[("/proc/90/status", "Cpus_allowed_list: 3"),
        ("/proc/90/stat", "90 (kswapd0) S 2 0 0 0 -1 69238848 0")]),
    unknown("kernel threads", "hidden").without(&["/proc/2"]),

    missing("timer migration", "on", APPLY).with(&[("/proc/sys/kernel/timer_migration", "1")]),
    ok("timer migration", "not in this kernel").without(&["/proc/sys/kernel/timer_migration"]),
    unknown("timer migration", "no /proc").without(&["/proc/sys"]),

    missing("vm.stat_interval", "1 s", APPLY).with(&[("/proc/sys/vm/stat_interval", "1")]),
    ok("vm.stat_interval", "120 s").with(&[("/proc/sys/vm/stat_interval", "120")]),
    unknown("vm.stat_interval", "not a number").with(&[("/proc/sys/vm/stat_interval", "")]),

    missing("core", "core 3 is not online", "one of 0-2").with(&[("/sys/devices/system/cpu/online", "0-2")]),
    missing("core", "the only one", "two or more cores").with(&[("/sys/devices/system/cpu/online", "3")]),
    ok("core", "core 0 of 0-3, which keeps the time").when(|_, target| target.cpu = 0),
    unknown("core", "not a list of cores").with(&[("/sys/devices/system/cpu/online", "all")]),

    missing("other control", "process 50", "set rt.cpu in one of the machine files to another core, if both are to run at the same time")
        .with(&[("/proc/50/task/51/comm", "rt-cycle\n"), ("/proc/50/task/51/status", "Cpus_allowed_list:\t3\n")]),
    ok("other control", "none")
        .with(&[("/proc/50/task/51/comm", "rt-cycle\n"), ("/proc/50/task/51/status", "Cpus_allowed_list:\t2\n")]),
    unknown("other control", "hidden").without(&["/proc/2"]),

    missing("isolated", "core 2", PERSIST).with(&[("/sys/devices/system/cpu/isolated", "2")]),
    missing("isolated", "none", PERSIST).with(&[("/sys/devices/system/cpu/isolated", "\n")]),
    ok("isolated", "cores 2-3").with(&[("/sys/devices/system/cpu/isolated", "2-3")]),
    ok("isolated", "core 3 (cgroup)")
        .with(&[("/sys/devices/system/cpu/isolated", ""), ("/sys/fs/cgroup/cpuset.cpus.isolated", "3")]),
    unknown("isolated", "no /sys").without(&["/sys/devices/system/cpu/isolated"]),

    missing("nohz_full", "core 1", PERSIST).with(&[("/sys/devices/system/cpu/nohz_full", "1")]),
    missing("nohz_full", "none", PERSIST).with(&[("/sys/devices/system/cpu/nohz_full", "(null)")]),
    missing("nohz_full", "not in this kernel", "CONFIG_NO_HZ_FULL").without(&["/sys/devices/system/cpu/nohz_full"]),
    unknown("nohz_full", "not a list").with(&[("/sys/devices/system/cpu/nohz_full", "?")]),

    missing("rcu_nocbs", "none", PERSIST).with(&[("/proc/cmdline", "quiet")]),
    missing("rcu_nocbs", "core 2", PERSIST).with(&[("/proc/cmdline", "rcu_nocbs=2")]),
    ok("rcu_nocbs", "cores 2-3").with(&[("/proc/cmdline", "rcu_nocbs=1 nohz_full=2-N")]),
    ok("rcu_nocbs", "cores 0-3").with(&[("/proc/cmdline", "rcu_nocbs=all")]),
    unknown("rcu_nocbs", "no /proc/cmdline").without(&["/proc/cmdline"]),

    missing("SMT sibling", "core 1, 75 % busy", "persist --cpus 1,3, then reboot").with(&[(SIBLINGS, "1,3"),
        ("/proc/stat", "cpu1 0 0 0 0 0 0 0 0 0 0"), ("later:/proc/stat", "cpu1 50 0 25 20 5 0 0 0 0 0")]),
    missing("SMT sibling", "core 1", "persist --cpus 1,3").with(&[(SIBLINGS, "1,3")]),
    missing("SMT sibling", "core 0", "nosmt").with(&[(SIBLINGS, "0,3")]),
    missing("SMT sibling", "core 2", "nosmt")
        .with(&[(SIBLINGS, "2-3"), ("/sys/devices/system/cpu/online", "2-3"), ("/sys/devices/system/cpu/isolated", "")]),
    ok("SMT sibling", "core 2, isolated, too").with(&[(SIBLINGS, "2-3"), ("/sys/devices/system/cpu/isolated", "2-3")]),
    unknown("SMT sibling", "no /sys").without(&[SIBLINGS]),

    missing("interrupts", "2 interrupts: 30 nvme0q1 (came 7 times), 24 ahci", APPLY).with(&[
        ("/proc/irq/24/effective_affinity_list", "3"),
        ("/proc/irq/30/smp_affinity_list", "2-3"), ("/sys/kernel/irq/30/actions", "nvme0q1"),
        ("/proc/interrupts", " CPU0 CPU3\n 30: 0 100 MSI"), ("later:/proc/interrupts", " CPU0 CPU3\n 30: 0 107 MSI")]),
    missing("interrupts", "6 interrupts: 1 x,y, 2 of an unknown device, 3 of an unknown device, 4 of an unknown device and 2 more", APPLY).with(&[
        ("/sys/kernel/irq/1/actions", "x,y"), ("/proc/irq/1/smp_affinity_list", "3"), ("/proc/irq/2/smp_affinity_list", "3"),
        ("/proc/irq/3/smp_affinity_list", "3"), ("/proc/irq/4/smp_affinity_list", "3"),
        ("/proc/irq/5/smp_affinity_list", "3"), ("/proc/irq/6/smp_affinity_list", "3")]),
    missing("interrupts", "1 interrupt: 130 eth1-TxRx-0", "apply --cpus 3 --interface eth0").when(|_, target| target.interface = Some("eth0".into())),
    ok("interrupts", "none now; 1 would be allowed to").with(&[("/proc/irq/24/smp_affinity_list", "0-3")]),
    ok("interrupts", "none").with(&[("/proc/irq/31/smp_affinity_list", "3"), ("/sys/kernel/irq/31/actions", "\n")]),
    ok("interrupts", "none").without(&["/sys/class/net/eth1/device"]),
    ok("interrupts", "none").with(&[("link:/sys/class/net/eth1/device/subsystem", "../../bus/virtio"),
        ("/sys/class/net/eth1/msi_irqs/131", ""), ("/proc/irq/131/smp_affinity_list", "3")]),
    missing("interrupts", "1 interrupt: 131 pcieport", APPLY).with(&[("/sys/class/net/eth1/msi_irqs/131", ""),
        ("/proc/irq/131/smp_affinity_list", "3"), ("/sys/kernel/irq/131/actions", "pcieport")]),
    unknown("interrupts", "no /proc/irq").without(&["/proc/irq"]),

    missing("irqbalance", "running, leaves out none", APPLY)
        .with(&[("/proc/50/comm", "irqbalance"), ("/sys/devices/system/cpu/isolated", "")]),
    missing("irqbalance", "running, leaves out core 2", APPLY)
        .with(&[("/proc/50/comm", "irqbalance"), ("/proc/50/environ", "A=1\0IRQBALANCE_BANNED_CPULIST=2\0B=\0")]),
    ok("irqbalance", "leaves out cores 2-3")
        .with(&[("/proc/50/comm", "irqbalance"), ("/etc/default/irqbalance", "#x\nIRQBALANCE_BANNED_CPUS=\"c\"\n")]),
    ok("irqbalance", "leaves out core 3").with(&[("/proc/50/comm", "irqbalance")]),
    unknown("irqbalance", "hidden").without(&["/proc/2"]),

    missing("governor", "powersave", APPLY)
        .with(&[("/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "powersave")]),
    ok("governor", "powersave, fixed at 3600 MHz").with(&[
        ("/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "powersave"),
        ("/sys/devices/system/cpu/cpu3/cpufreq/scaling_min_freq", "3600000")]),
    ok("governor", "no frequency to set").without(&["/sys/devices/system/cpu/cpu3/cpufreq"]),
    unknown("governor", "not a word").with(&[("/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "")]),

    missing("idle states", "C6 170 us; /dev/cpu_dma_latency: not for you", "scripts/isolcpus.sh apply --cpus 3 --interface eth1 --no-deep-idle")
        .when(|answers, _| answers.dma_latency = Err("not for you".into())),
    ok("idle states", "C6 170 us; the control can forbid it"),
    ok("idle states", "none above 2 us (intel_idle)")
        .with(&[("/sys/devices/system/cpu/cpu3/cpuidle/state1/disable", "1")]),
    ok("idle states", "forbidden for this core")
        .with(&[("/sys/devices/system/cpu/cpu3/power/pm_qos_resume_latency_us", "n/a")]),
    ok("idle states", "never sleeps").with(&[("/proc/cmdline", "idle=poll")]),
    ok("idle states", "no idle driver").with(&[("/sys/devices/system/cpu/cpuidle/current_driver", "none")]),
    unknown("idle states", "no /sys").without(&["/sys/devices/system/cpu/cpu3/cpuidle"]),

    missing("throttling", "500000 of 1000000 us", "kernel.sched_rt_runtime_us=950000")
        .with(&[("/proc/sys/kernel/sched_rt_runtime_us", "500000")]),
    ok("throttling", "off").with(&[("/proc/sys/kernel/sched_rt_runtime_us", "-1")]),
    unknown("throttling", "no /proc").without(&["/proc/sys/kernel/sched_rt_period_us"]),

    missing("fair server", "500 of 1000 ms", "echo 50000000 | sudo tee /sys/kernel/debug").with(&[(FAIR, "500000000")]),
    ok("fair server", "0 of 1000 ms").with(&[(FAIR, "0")]),
    ok("fair server", "none before Linux 6.12").without(&["/sys/kernel/debug"])
        .with(&[("/proc/sys/kernel/osrelease", "6.1.0-31-rt-amd64")]),
    unknown("fair server", "debugfs is not mounted").without(&["/sys/kernel/debug"]),

    missing("the core itself", "not allowed", "CPUAffinity=")
        .when(|answers, _| answers.take_core = Err("not allowed".into())),
    missing("SCHED_FIFO", "not allowed", GRANT).when(|answers, _| answers.fifo = Err("not allowed".into())),
    missing("SCHED_FIFO", "not allowed", "echo 950000 | sudo tee /sys/fs/cgroup/cpu,cpuacct/x/cpu.rt_runtime_us")
        .with(&[("/proc/self/cgroup", "4:cpu,cpuacct:/x"), ("/sys/fs/cgroup/cpu,cpuacct/x/cpu.rt_runtime_us", "0")])
        .when(|answers, _| answers.fifo = Err("not allowed".into())),
    missing("SCHED_FIFO", "not allowed", "outside of the container").with(&[("/proc/self/uid_map", "0 1000 1\n")])
        .when(|answers, _| answers.fifo = Err("not allowed".into())),
    missing("raw socket", "not allowed", "--cap-add NET_RAW").with(&[("/proc/self/status", "CapBnd:\t00000000a80405fb\n")])
        .when(|answers, _| answers.raw_socket = Err("not allowed".into())),
    missing("locked memory", "too much", GRANT).when(|answers, _| answers.lock_memory = Err("too much".into())),
    missing("raw socket", "not allowed", GRANT).when(|answers, _| answers.raw_socket = Err("not allowed".into())),

    missing("huge pages", "madvise", APPLY).with(&[(HUGE, "always [madvise] never")]),
    ok("huge pages", "not in this kernel").without(&["/sys/kernel/mm/transparent_hugepage"]),
    unknown("huge pages", "not a choice").with(&[(HUGE, "never")]),
    unknown("huge pages", "no /sys").without(&["/sys/kernel/mm"]),

    missing("swap", "/dev/sda2", "sudo swapoff -a")
        .with(&[("/proc/swaps", "Filename Type Size Used Priority\n/dev/sda2 partition 999 0 -2\n")]),
    ok("swap", "/dev/sda2, hardly used").with(&[("/proc/sys/vm/swappiness", "1"),
        ("/proc/swaps", "Filename Type Size Used Priority\n/dev/sda2 partition 999 0 -2\n")]),
    unknown("swap", "headings").with(&[("/proc/swaps", "")]),

    missing("same pages (KSM)", "on", APPLY).with(&[("/sys/kernel/mm/ksm/run", "1")]),
    ok("same pages (KSM)", "not in this kernel").without(&["/sys/kernel/mm/ksm"]),
    unknown("same pages (KSM)", "not a number").with(&[("/sys/kernel/mm/ksm/run", "yes")]),

    missing("NUMA balancing", "on", APPLY).with(&[("/proc/sys/kernel/numa_balancing", "1")]),
    ok("NUMA balancing", "not in this kernel").without(&["/proc/sys/kernel/numa_balancing"]),

    missing("interface", "plk0 does not exist", "one of eth0, eth1")
        .when(|_, target| target.interface = Some("plk0".into())),
    missing("interface", "../eth1 does not exist", "").when(|_, target| target.interface = Some("../eth1".into())),
    unknown("interface", "none named").when(|_, target| target.interface = None),

    missing("link", "down", "ip link set eth1 up").with(&[("/sys/class/net/eth1/operstate", "down")]),
    ok("link", "up").with(&[("/sys/class/net/eth1/operstate", "unknown")]),
    unknown("link", "no /sys").without(&["/sys/class/net/eth1/operstate"]),

    missing("driver", "asix on usb", "PCI Express")
        .with(&[("link:/sys/class/net/eth1/device/subsystem", "../../../bus/usb")])
        .when(|answers, _| answers.driver = Ok("asix".into())),
    ok("driver", "veth, no device").without(&["/sys/class/net/eth1/device"])
        .when(|answers, _| answers.driver = Ok("veth".into())),
    unknown("driver", "not here").when(|answers, _| answers.driver = silent()),

    missing("coalescing", "rx 3 us, tx 0 us, adaptive", APPLY)
        .when(|answers, _| answers.coalescing = Ok(Coalescing { rx_usecs: 3, tx_usecs: 0, adaptive: true })),
    ok("coalescing", "none in this driver").when(|answers, _| answers.coalescing = Err(NoAnswer::NotSupported)),
    unknown("coalescing", "not here").when(|answers, _| answers.coalescing = silent()),

    missing("offloads", "gro, lro, gso, tso, rxvlan, txvlan",
        APPLY)
        .when(|answers, _| answers.offloads = Ok(Offload::ALL.to_vec())),
    unknown("offloads", "not here").when(|answers, _| answers.offloads = silent()),

    missing("EEE", "on", APPLY).when(|answers, _| answers.energy_efficient = Ok(true)),
    ok("EEE", "none in this driver").when(|answers, _| answers.energy_efficient = Err(NoAnswer::NotSupported)),
    unknown("EEE", "not here").when(|answers, _| answers.energy_efficient = silent()),

    missing("flow control", "on", APPLY).when(|answers, _| answers.flow_control = Ok(true)),
    unknown("flow control", "not here").when(|answers, _| answers.flow_control = silent()),

    missing("speed", "1000 Mbit/s full", "speed 100 duplex full").with(&[("/sys/class/net/eth1/speed", "1000")]),
    unknown("speed", "no speed").with(&[("/sys/class/net/eth1/speed", "-1")]),

    missing("IP addresses", "192.0.2.2, fe80::1", "ip addr flush dev eth1")
        .when(|answers, _| answers.addresses = Ok(vec!["192.0.2.2".into(), "fe80::1".into()])),
    unknown("IP addresses", "not here").when(|answers, _| answers.addresses = Err("not here".into())),

    missing("queues", "2", "ethtool -L eth1 combined 1").with(&[("/sys/class/net/eth1/queues/rx-1/rps_cpus", "0")]),
    unknown("queues", "no /sys").without(&["/sys/class/net/eth1/queues"]),

    missing("packet steering", "to cores 0-1", APPLY).with(&[("/sys/class/net/eth1/queues/rx-0/rps_cpus", "3")]),
    unknown("packet steering", "not a mask").with(&[("/sys/class/net/eth1/queues/rx-0/rps_cpus", "x")]),

    missing("interrupt thread", "irq/130-eth1: FIFO 50", "sudo chrt -f -p 85 77").with(&[("/proc/77/stat",
        "77 (irq/130-) eth1) S 2 0 0 0 -1 2129984 0 0 0 0 0 0 0 0 -51 0 1 0 100 0 0 0 0 0 0 0 0 0 0 \
        2147483647 0 0 0 0 17 3 50 1 0 0 0 0 0 0 0 0 0 0 0\n")]),
    ok("interrupt line", "by message (130)"),
    missing("interrupt line", "130 by line (IO-APIC)", "another slot").with(&[("/sys/kernel/irq/130/chip_name", "IO-APIC")]),
    missing("interrupt line", "130 shared: eth1,i801_smbus", "another slot")
        .with(&[("/sys/kernel/irq/130/actions", "eth1,i801_smbus")]),
    ok("interrupt line", "no device").without(&["/sys/class/net/eth1/device"]),
    unknown("interrupt line", "does not tell its interrupt").without(&["/sys/class/net/eth1/device/msi_irqs", "/sys/kernel/irq"]),

    ok("interrupt thread", "none").without(&["/proc/77"]),
    unknown("interrupt thread", "tells no priority").with(&[("/proc/77/stat", "77 (irq")]),
    unknown("interrupt thread", "hidden").without(&["/proc/2"]),

    ok("speed", "no device").without(&["/sys/class/net/eth1/device"]),
    ok("PCIe link power", "no device").without(&["/sys/class/net/eth1/device"]),
    missing("PCIe link power", "default", APPLY)
        .with(&[("/sys/module/pcie_aspm/parameters/policy", "[default] performance powersave")]),
    ok("PCIe link power", "pcie_aspm=off").without(&["/sys/module"]).with(&[("/proc/cmdline", "pcie_aspm=off")]),
    unknown("PCIe link power", "no /sys").without(&["/sys/module"]),

    missing("time stamps", "kernel", "i210")
        .when(|answers, _| answers.time_stamps = Ok(TimeStamps { hardware: false })),
    missing("time stamps", "kernel", "i210").when(|answers, _| answers.time_stamps = Err(NoAnswer::NotSupported)),
    unknown("time stamps", "not here").when(|answers, _| answers.time_stamps = silent()),

    missing("launch time", "no (r8169)", "i210").when(|answers, _| answers.driver = Ok("r8169".into())),
    unknown("launch time", "its name").when(|answers, _| answers.driver = Err(NoAnswer::NotSupported)),

    missing("RT group scheduling", "0 us for the group", "echo 950000 | sudo tee /sys/fs/cgroup/cpu/cpu.rt_runtime_us")
        .with(&[("/proc/self/cgroup", "1:cpu:/"), ("/sys/fs/cgroup/cpu/cpu.rt_runtime_us", "0")]),
    missing("RT group scheduling", "built in: real time in the root group only", "rt_group_sched=0")
        .with(&[(CONFIG, "CONFIG_RT_GROUP_SCHED=y")]),
    ok("RT group scheduling", "root group").with(&[(CONFIG, "CONFIG_RT_GROUP_SCHED=y"), ("/proc/self/cgroup", "0::/")]),
    ok("RT group scheduling", "950000 us for the group")
        .with(&[("/proc/self/cgroup", "1:cpu:/"), ("/sys/fs/cgroup/cpu/cpu.rt_runtime_us", "950000")]),
    unknown("RT group scheduling", "neither /proc/config.gz").without(&["/boot"]),

    missing("wake-up latency", "poor: max 50.1 us, p50 2.0, p99 4.0, p99.9 6.0", "cyclictest -q -m -p90 -i1000 -a3")
        .when(|answers, _| answers.wake_up = Ok(Latency { max_us: 50.1, ..LATENCY })),
    ok("wake-up latency", "very good: max 9.5 us"),
    ok("wake-up latency", "usable: max 50.0 us").when(|answers, _| answers.wake_up = Ok(Latency { max_us: 50.0, ..LATENCY })),
    unknown("wake-up latency", "no core").when(|answers, _| answers.wake_up = Err("no core".into())),

    missing("gaps", "of no use: max 3000.0 us", "hwlatdetect")
        .when(|answers, _| answers.gaps = Ok(Latency { max_us: 3000.0, ..LATENCY })),
    ok("gaps", "nothing").when(|answers, _| answers.gaps = Ok(Latency::default())),
    unknown("gaps", "no core").when(|answers, _| answers.gaps = Err("no core".into())),
];
