//! A PC made of a folder of files and of answers.

use super::cases::Case;
use crate::doctor::{Pc, Target, Tries};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// A bare PC that is as it should be: core 3 of four is the one of the real-time threads.
const GOOD: &[(&str, &str)] = &[
    ("/sys/kernel/realtime", "1\n"),
    ("/proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian 6.12.9-1\n"),
    ("/proc/sys/kernel/osrelease", "6.12.9-rt-amd64\n"),
    ("/etc/os-release", "NAME=Debian\nID=debian\n"),
    (
        "/boot/config-6.12.9-rt-amd64",
        "CONFIG_PREEMPT_RT=y\nCONFIG_HIGH_RES_TIMERS=y\nCONFIG_CPU_ISOLATION=y\n\
        CONFIG_NO_HZ_FULL=y\nCONFIG_RCU_NOCB_CPU=y\n# CONFIG_RT_GROUP_SCHED is not set\n",
    ),
    (
        "/proc/cmdline",
        "root=/dev/sda1 isolcpus=managed_irq,domain,3 nohz_full=3 rcu_nocbs=3 irqaffinity=0-2\n",
    ),
    (
        "/proc/cpuinfo",
        "processor\t: 0\nflags\t\t: fpu tsc constant_tsc nonstop_tsc\n",
    ),
    ("/sys/class/dmi/id/sys_vendor", "Advantech\n"),
    ("/proc/stat", "cpu  9 9 9 9 9 9 9 0 0 0\ncpu3 1 2 3 4 5 6 7 0 0 0\n"),
    (
        "/sys/devices/system/clocksource/clocksource0/current_clocksource",
        "tsc\n",
    ),
    (
        "/sys/devices/system/clocksource/clocksource0/available_clocksource",
        "tsc hpet acpi_pm\n",
    ),
    ("/proc/sys/kernel/watchdog", "1\n"),
    ("/proc/sys/kernel/watchdog_cpumask", "0-2\n"),
    ("/proc/sys/kernel/nmi_watchdog", "0\n"),
    ("/sys/devices/virtual/workqueue/cpumask", "7\n"),
    ("/proc/sys/kernel/timer_migration", "0\n"),
    ("/proc/sys/vm/stat_interval", "10\n"),
];

/// What only trying tells.
#[derive(Clone, Debug)]
pub(super) struct Answers {
    pub(super) timer_resolution_ns: Result<u64, String>,
    pub(super) hypervisor: Option<String>,
    pub(super) unzipped: Result<String, String>,
}

impl Answers {
    fn good() -> Answers {
        Answers {
            timer_resolution_ns: Ok(1),
            hypervisor: None,
            unzipped: refused(),
        }
    }

    /// Of a PC that tells nothing.
    pub(super) fn none() -> Answers {
        Answers {
            timer_resolution_ns: refused(),
            hypervisor: None,
            unzipped: refused(),
        }
    }
}

fn refused<T>() -> Result<T, String> {
    Err("not here".into())
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
            folder: tempfile::tempdir().unwrap(),
            answers: Answers::good(),
            target: Target {
                cpu: 3,
                cpu_from: "--cpu".into(),
                priority: 81,
                interface: Some("eth1".into()),
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

    pub(super) fn paths(&self) -> Vec<String> {
        GOOD.iter().map(|(path, _)| (*path).to_owned()).collect()
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
        (case.answers)(&mut self.answers);
    }

    pub(super) fn write(&self, path: &str, contents: &[u8]) {
        let at = self.at(path);
        std::fs::create_dir_all(at.parent().unwrap()).unwrap();
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
}
