//! A PC made of a folder of files and of answers.

use super::cases::Case;
use crate::doctor::{Coalescing, Latency, NoAnswer, Offload, Pc, Target, TimeStamps, Tries};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// A bare PC that is as it should be: core 3 of four is the one of the real-time threads, eth1 the field bus.
/// `link:` before a path: a symbolic link.
#[rustfmt::skip]
const GOOD: &[(&str, &str)] = &[
    ("/sys/kernel/realtime", "1\n"),
    ("/proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian 6.12.9-1\n"),
    ("/proc/sys/kernel/osrelease", "6.12.9-rt-amd64\n"),
    ("/etc/os-release", "NAME=Debian\nID=debian\n"),
    ("/boot/config-6.12.9-rt-amd64", "CONFIG_PREEMPT_RT=y\nCONFIG_HIGH_RES_TIMERS=y\nCONFIG_CPU_ISOLATION=y\n\
        CONFIG_NO_HZ_FULL=y\nCONFIG_RCU_NOCB_CPU=y\n# CONFIG_RT_GROUP_SCHED is not set\n"),
    ("/proc/cmdline", "root=/dev/sda1 isolcpus=managed_irq,domain,3 nohz_full=3 rcu_nocbs=3 irqaffinity=0-2\n"),

    ("/proc/cpuinfo", "processor\t: 0\nflags\t\t: fpu tsc constant_tsc nonstop_tsc\n"),
    ("/sys/class/dmi/id/sys_vendor", "Advantech\n"),
    ("/proc/stat", "cpu  9 9 9 9 9 9 9 0 0 0\ncpu3 1 2 3 4 5 6 7 0 0 0\n"),
    ("/sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
    ("/sys/devices/system/clocksource/clocksource0/available_clocksource", "tsc hpet acpi_pm\n"),

    ("/sys/devices/system/cpu/online", "0-3\n"),
    ("/sys/devices/system/cpu/possible", "0-3\n"),
    ("/sys/devices/system/cpu/isolated", "3\n"),
    ("/sys/devices/system/cpu/nohz_full", "3\n"),
    ("/sys/devices/system/cpu/cpu3/topology/thread_siblings_list", "3\n"),
    ("/proc/interrupts", "           CPU0       CPU1       CPU2       CPU3\n  24:  900  0  0  0  PCI-MSI ahci\n\
        130:  0  0  0  5000  PCI-MSI eth1\nLOC:  9  9  9  9  Local timer interrupts\n"),
    ("/proc/irq/24/smp_affinity_list", "0-2\n"),
    ("/proc/irq/24/effective_affinity_list", "0\n"),
    ("/sys/kernel/irq/24/actions", "ahci\n"),
    ("/proc/irq/130/smp_affinity_list", "3\n"),
    ("/proc/irq/130/effective_affinity_list", "3\n"),
    ("/sys/kernel/irq/130/actions", "eth1-TxRx-0\n"),
    ("/sys/kernel/irq/130/chip_name", "IR-PCI-MSIX-0000:02:00.0\n"),
    // Octets from 0x34 on are the count.
    ("/dev/cpu/3/msr", SMI_BEFORE),
    ("/proc/irq/default_smp_affinity", "7\n"),
    ("/proc/1/comm", "systemd\n"),
    ("/proc/2/comm", "kthreadd\n"),
    ("/proc/77/comm", "irq/130-eth1\n"),
    ("/proc/77/stat", "77 (irq/130-eth1) S 2 0 0 0 -1 2129984 0 0 0 0 0 0 0 0 -86 0 1 0 100 0 0 0 0 0 0 0 0 0 0 \
        2147483647 0 0 0 0 17 3 85 1 0 0 0 0 0 0 0 0 0 0 0\n"),

    ("/proc/90/comm", "kswapd0\n"),
    ("/proc/90/stat", "90 (kswapd0) S 2 0 0 0 -1 2129984 0\n"),
    ("/proc/90/status", "Name:\tkswapd0\nCpus_allowed_list:\t0-2\n"),

    ("/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "performance\n"),
    ("/sys/devices/system/cpu/cpu3/cpufreq/scaling_min_freq", "800000\n"),
    ("/sys/devices/system/cpu/cpu3/cpufreq/scaling_max_freq", "3600000\n"),
    ("/sys/devices/system/cpu/cpuidle/current_driver", "intel_idle\n"),
    ("/sys/devices/system/cpu/cpu3/power/pm_qos_resume_latency_us", "0\n"),
    ("/sys/devices/system/cpu/cpu3/cpuidle/state0/latency", "0\n"),
    ("/sys/devices/system/cpu/cpu3/cpuidle/state0/name", "POLL\n"),
    ("/sys/devices/system/cpu/cpu3/cpuidle/state0/disable", "0\n"),
    ("/sys/devices/system/cpu/cpu3/cpuidle/state1/latency", "170\n"),
    ("/sys/devices/system/cpu/cpu3/cpuidle/state1/name", "C6\n"),
    ("/sys/devices/system/cpu/cpu3/cpuidle/state1/disable", "0\n"),

    ("/proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
    ("/proc/sys/kernel/sched_rt_period_us", "1000000\n"),
    ("/sys/kernel/debug/sched/fair_server/cpu3/runtime", "50000000\n"),
    ("/sys/kernel/debug/sched/fair_server/cpu3/period", "1000000000\n"),
    ("/proc/self/status", "Name:\tisocnc\nCapBnd:\t000001ffffffffff\n"),
    ("/proc/self/uid_map", "         0          0 4294967295\n"),
    ("/proc/self/cgroup", "0::/user.slice\n"),

    ("/sys/kernel/mm/transparent_hugepage/enabled", "always madvise [never]\n"),
    ("/proc/swaps", "Filename\t\t\t\tType\t\tSize\t\tUsed\t\tPriority\n"),
    ("/proc/sys/vm/swappiness", "60\n"),
    ("/sys/kernel/mm/ksm/run", "0\n"),
    ("/proc/sys/kernel/numa_balancing", "0\n"),

    ("/sys/class/net/eth1/operstate", "up\n"),
    ("/sys/class/net/eth1/speed", "100\n"),
    ("/sys/class/net/eth1/duplex", "full\n"),
    ("/sys/class/net/eth1/device/msi_irqs/130", "msix\n"),
    ("link:/sys/class/net/eth1/device/subsystem", "../../bus/pci"),
    ("/sys/class/net/eth1/queues/rx-0/rps_cpus", "0\n"),
    ("/sys/class/net/eth1/queues/tx-0/xps_cpus", "8\n"),
    ("/sys/class/net/lo/operstate", "unknown\n"),
    ("/sys/class/net/eth0/operstate", "up\n"),
    ("/sys/module/pcie_aspm/parameters/policy", "default [performance] powersave powersupersave\n"),

    ("/proc/sys/kernel/watchdog", "1\n"),
    ("/proc/sys/kernel/watchdog_cpumask", "0-2\n"),
    ("/proc/sys/kernel/nmi_watchdog", "0\n"),
    ("/sys/devices/virtual/workqueue/cpumask", "7\n"),
    ("/proc/sys/kernel/timer_migration", "0\n"),
    ("/proc/sys/vm/stat_interval", "10\n"),
];

/// The registers of a core up to its count of system management interrupts, 5.
const SMI_BEFORE: &str = "0123456789012345678901234567890123456789012345678901\x05\0\0\0\0\0\0\0";
/// The same two interrupts later.
pub(super) const SMI_AFTER: &str = "0123456789012345678901234567890123456789012345678901\x07\0\0\0\0\0\0\0";

/// What only trying tells.
#[derive(Clone, Debug)]
pub(super) struct Answers {
    pub(super) timer_resolution_ns: Result<u64, String>,
    pub(super) hypervisor: Option<String>,
    pub(super) unzipped: Result<String, String>,
    pub(super) take_core: Result<(), String>,
    pub(super) fifo: Result<(), String>,
    pub(super) lock_memory: Result<(), String>,
    pub(super) raw_socket: Result<(), String>,
    pub(super) dma_latency: Result<(), String>,
    pub(super) addresses: Result<Vec<String>, String>,
    pub(super) driver: Result<String, NoAnswer>,
    pub(super) coalescing: Result<Coalescing, NoAnswer>,
    pub(super) offloads: Result<Vec<Offload>, NoAnswer>,
    pub(super) energy_efficient: Result<bool, NoAnswer>,
    pub(super) flow_control: Result<bool, NoAnswer>,
    pub(super) time_stamps: Result<TimeStamps, NoAnswer>,
    pub(super) wake_up: Result<Latency, String>,
    pub(super) gaps: Result<Latency, String>,
}

impl Answers {
    fn good() -> Answers {
        Answers {
            timer_resolution_ns: Ok(1),
            hypervisor: None,
            unzipped: refused(),
            take_core: Ok(()),
            fifo: Ok(()),
            lock_memory: Ok(()),
            raw_socket: Ok(()),
            dma_latency: Ok(()),
            addresses: Ok(vec![]),
            driver: Ok("igb".into()),
            coalescing: Ok(Coalescing {
                rx_usecs: 0,
                tx_usecs: 0,
                adaptive: false,
            }),
            offloads: Ok(vec![]),
            energy_efficient: Ok(false),
            flow_control: Ok(false),
            time_stamps: Ok(TimeStamps { hardware: true }),
            wake_up: Ok(LATENCY),
            gaps: Ok(LATENCY),
        }
    }

    /// Of a PC that tells nothing. What it was refused was really refused.
    pub(super) fn none() -> Answers {
        Answers {
            timer_resolution_ns: refused(),
            addresses: refused(),
            driver: silent(),
            coalescing: silent(),
            offloads: silent(),
            energy_efficient: silent(),
            flow_control: silent(),
            time_stamps: silent(),
            wake_up: refused(),
            gaps: refused(),
            ..Answers::good()
        }
    }
}

/// A good one.
pub(super) const LATENCY: Latency = Latency {
    n: 5000,
    p50_us: 2.0,
    p99_us: 4.0,
    p99_9_us: 6.0,
    max_us: 9.5,
};

fn refused<T>() -> Result<T, String> {
    Err("not here".into())
}

pub(super) fn silent<T>() -> Result<T, NoAnswer> {
    Err(NoAnswer::Refused("not here".into()))
}

/// A folder of files and the answers.
pub(super) struct Fake {
    folder: TempDir,
    pub(super) answers: Answers,
    pub(super) target: Target,
    /// Files that change while the PC is watched.
    later: Vec<(PathBuf, String)>,
}

impl Fake {
    pub(super) fn empty() -> Fake {
        Fake {
            // In memory where that can be had: there are thousands of small files.
            folder: tempfile::tempdir_in("/dev/shm")
                .or_else(|_| tempfile::tempdir())
                .unwrap(),
            answers: Answers::good(),
            target: Target {
                cpu: 3,
                cpu_from: "--cpu".into(),
                priority: 81,
                interface: Some("eth1".into()),
                test_time: Some(Duration::from_secs(5)),
                program: "/opt/iso cnc/isocnc".into(),
                isolcpus: Some("scripts/isolcpus.sh".into()),
            },
            later: Vec::new(),
        }
    }

    pub(super) fn good() -> Fake {
        let fake = Fake::empty();
        GOOD.iter().for_each(|(path, text)| fake.write(path, text.as_bytes()));
        fake
    }

    pub(super) fn good_text(path: &str) -> &'static str {
        GOOD.iter().find(|(own, _)| *own == path).unwrap().1
    }

    /// All files of the good PC.
    pub(super) fn paths(&self) -> Vec<String> {
        let files = GOOD.iter().filter(|(path, _)| path.starts_with('/'));
        files.map(|(path, _)| (*path).to_owned()).collect()
    }

    pub(super) fn pc(&self) -> Pc<'_> {
        Pc::new(self.folder.path(), self, self.target.clone(), Duration::from_secs(1))
    }

    pub(super) fn change(&mut self, case: &Case) {
        for (path, text) in case.files {
            match path.strip_prefix("later:") {
                Some(path) => self.later.push((self.at(path), (*text).to_owned())),
                None => self.write(path, text.as_bytes()),
            }
        }
        case.gone.iter().for_each(|path| self.remove(path));
        (case.answers)(&mut self.answers, &mut self.target);
    }

    pub(super) fn write(&self, path: &str, contents: &[u8]) {
        let (at, is_link) = match path.strip_prefix("link:") {
            Some(path) => (self.at(path), true),
            None => (self.at(path), false),
        };
        std::fs::create_dir_all(at.parent().unwrap()).unwrap();
        if is_link {
            let _ = std::fs::remove_file(&at);
            return symlink(std::str::from_utf8(contents).unwrap(), at).unwrap();
        }
        std::fs::write(at, contents).unwrap();
    }

    /// A file, or a folder with all that is in it.
    pub(super) fn remove(&self, path: &str) {
        let at = self.at(path);
        if at.is_dir() {
            std::fs::remove_dir_all(at).unwrap();
        } else {
            std::fs::remove_file(at).unwrap();
        }
    }

    fn is_asked_for(&self, interface: &str) {
        assert_eq!(Some(interface), self.target.interface.as_deref());
    }

    fn at(&self, path: &str) -> PathBuf {
        self.folder.path().join(path.trim_start_matches('/'))
    }
}

impl Tries for Fake {
    fn pause(&self, _: Duration) {
        self.later
            .iter()
            .for_each(|(path, text)| std::fs::write(path, text).unwrap());
    }

    fn timer_resolution_ns(&self) -> Result<u64, String> {
        self.answers.timer_resolution_ns.clone()
    }

    fn hypervisor(&self) -> Option<String> {
        self.answers.hypervisor.clone()
    }

    fn unzip(&self, _: &Path) -> Result<String, String> {
        self.answers.unzipped.clone()
    }

    fn take_core(&self, cpu: usize) -> Result<(), String> {
        assert_eq!(cpu, self.target.cpu);
        self.answers.take_core.clone()
    }

    fn fifo(&self, cpu: usize, priority: u8) -> Result<(), String> {
        assert_eq!((cpu, priority), (self.target.cpu, self.target.priority));
        self.answers.fifo.clone()
    }

    fn lock_memory(&self) -> Result<(), String> {
        self.answers.lock_memory.clone()
    }

    fn raw_socket(&self) -> Result<(), String> {
        self.answers.raw_socket.clone()
    }

    fn dma_latency(&self) -> Result<(), String> {
        self.answers.dma_latency.clone()
    }

    fn addresses(&self, interface: &str) -> Result<Vec<String>, String> {
        self.is_asked_for(interface);
        self.answers.addresses.clone()
    }

    fn driver(&self, interface: &str) -> Result<String, NoAnswer> {
        self.is_asked_for(interface);
        self.answers.driver.clone()
    }

    fn coalescing(&self, interface: &str) -> Result<Coalescing, NoAnswer> {
        self.is_asked_for(interface);
        self.answers.coalescing.clone()
    }

    fn offloads(&self, interface: &str) -> Result<Vec<Offload>, NoAnswer> {
        self.is_asked_for(interface);
        self.answers.offloads.clone()
    }

    fn energy_efficient(&self, interface: &str) -> Result<bool, NoAnswer> {
        self.is_asked_for(interface);
        self.answers.energy_efficient.clone()
    }

    fn flow_control(&self, interface: &str) -> Result<bool, NoAnswer> {
        self.is_asked_for(interface);
        self.answers.flow_control.clone()
    }

    fn time_stamps(&self, interface: &str) -> Result<TimeStamps, NoAnswer> {
        self.is_asked_for(interface);
        self.answers.time_stamps.clone()
    }

    fn wake_up(&self, _: usize, _: u8, time: Duration) -> Result<Latency, String> {
        assert_eq!(Some(time), self.target.test_time);
        self.answers.wake_up.clone()
    }

    fn gaps(&self, _: usize, _: u8, time: Duration) -> Result<Latency, String> {
        assert_eq!(Some(time), self.target.test_time);
        self.answers.gaps.clone()
    }
}
