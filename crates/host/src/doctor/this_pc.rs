//! The PC that this runs on.
//!
//! In:  questions of the lines. Out: what the system gives. Each try has a thread or a process of its own, so that it ends
//! with it.

use super::ethtool;
use crate::doctor::experiments::{Coalescing, Latency, NoAnswer, Offload, TimeStamps, Tries};
use crate::histogram::Summary;
use crate::latency::{GAP_NS, GapScan, WakeUp};
use crate::setup::{Finding, Item, enter_core};
use nix::errno::Errno;
use nix::sys::mman::{MapFlags, MlockAllFlags, ProtFlags, mlockall, mmap_anonymous};
use nix::sys::socket::{AddressFamily, SockFlag, SockType, SockaddrLike as _, socket};
use nix::sys::wait::{WaitStatus, waitpid};
use nix::unistd::{ForkResult, fork};
use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

const DMA_LATENCY: &str = "/dev/cpu_dma_latency";
/// Memory that a process must get while all of it is locked: more than the control asks for.
const LOCKED_LEN: NonZeroUsize = NonZeroUsize::new(64 << 20).unwrap();
/// Distance of two wake-ups: a cycle of the control.
const PERIOD_NS: u64 = 1_000_000;
/// Off the scheduler tick, as the cycle of the control.
const PHASE_NS: u64 = 370_000;

/// The PC that this runs on.
#[derive(Clone, Copy, Debug)]
pub struct ThisPc;

impl Tries for ThisPc {
    fn pause(&self, time: Duration) {
        std::thread::sleep(time);
    }

    fn timer_resolution_ns(&self) -> Result<u64, String> {
        let resolution = nix::time::clock_getres(nix::time::ClockId::CLOCK_MONOTONIC).map_err(in_words)?;
        Ok(u64::try_from(Duration::from(resolution).as_nanos()).unwrap_or(u64::MAX))
    }

    #[cfg(target_arch = "x86_64")]
    fn hypervisor(&self) -> Option<String> {
        use std::arch::x86_64::__cpuid;
        /// Leaf 1, ECX: the bit that every hypervisor sets and no processor does.
        const PRESENT: u32 = 1 << 31;
        if __cpuid(1).ecx & PRESENT == 0 {
            return None;
        }
        let leaf = __cpuid(0x4000_0000);
        let name = [leaf.ebx, leaf.ecx, leaf.edx].map(u32::to_le_bytes);
        let printable = name.as_flattened().iter().filter(|octet| octet.is_ascii_graphic());
        Some(printable.map(|octet| char::from(*octet)).collect())
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn hypervisor(&self) -> Option<String> {
        None
    }

    fn unzip(&self, path: &Path) -> Result<String, String> {
        let output = std::process::Command::new("gzip").arg("-dc").arg(path).output();
        let output = output.map_err(|error| format!("gzip cannot be started ({error})"))?;
        if !output.status.success() {
            return Err(format!("gzip cannot read {}", path.display()));
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    fn take_core(&self, cpu: usize) -> Result<(), String> {
        refused(cpu, 1, Item::Core)
    }

    fn fifo(&self, cpu: usize, priority: u8) -> Result<(), String> {
        refused(cpu, priority, Item::Priority)
    }

    fn lock_memory(&self) -> Result<(), String> {
        // A process of its own, as what is locked belongs to a process.
        // SAFETY: until it exits the child calls only functions that are safe after a fork of a threaded process: system
        // calls, without allocation.
        match unsafe { fork() }.map_err(in_words)? {
            ForkResult::Child => {
                let flags = MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE;
                let rights = ProtFlags::PROT_READ | ProtFlags::PROT_WRITE;
                let tried = mlockall(flags).and_then(|()| {
                    // SAFETY: memory of its own at a place that the kernel chooses; nothing is read or written there.
                    unsafe { mmap_anonymous(None, LOCKED_LEN, rights, MapFlags::MAP_PRIVATE) }.map(drop)
                });
                let code = tried.map_or_else(|errno| errno as i32, |()| 0);
                // SAFETY: ends the process without running anything of the parent's.
                unsafe { libc::_exit(code) }
            }
            ForkResult::Parent { child } => match waitpid(child, None).map_err(in_words)? {
                WaitStatus::Exited(_, 0) => Ok(()),
                WaitStatus::Exited(_, libc::ENOMEM | libc::EAGAIN) => Err("more than the limit (ulimit -l)".into()),
                WaitStatus::Exited(_, errno) => Err(in_words(Errno::from_raw(errno))),
                other => Err(format!("the try was ended: {other:?}")),
            },
        }
    }

    fn raw_socket(&self) -> Result<(), String> {
        // Protocol 0: it receives nothing.
        let tried = socket(AddressFamily::Packet, SockType::Raw, SockFlag::SOCK_CLOEXEC, None);
        tried.map(drop).map_err(in_words)
    }

    fn dma_latency(&self) -> Result<(), String> {
        let opened = OpenOptions::new().write(true).open(DMA_LATENCY);
        opened.map(drop).map_err(|error| error.to_string())
    }

    fn addresses(&self, interface: &str) -> Result<Vec<String>, String> {
        let all = nix::ifaddrs::getifaddrs().map_err(in_words)?;
        let own = all
            .filter(|entry| entry.interface_name == interface)
            .filter_map(|entry| entry.address);
        let ip = |address: nix::sys::socket::SockaddrStorage| match address.family()? {
            AddressFamily::Inet => Some(address.as_sockaddr_in()?.ip().to_string()),
            AddressFamily::Inet6 => Some(address.as_sockaddr_in6()?.ip().to_string()),
            _ => None,
        };
        Ok(own.filter_map(ip).collect())
    }

    fn driver(&self, interface: &str) -> Result<String, NoAnswer> {
        ethtool::driver(interface)
    }

    fn coalescing(&self, interface: &str) -> Result<Coalescing, NoAnswer> {
        ethtool::coalescing(interface)
    }

    fn offloads(&self, interface: &str) -> Result<Vec<Offload>, NoAnswer> {
        ethtool::offloads(interface)
    }

    fn energy_efficient(&self, interface: &str) -> Result<bool, NoAnswer> {
        ethtool::energy_efficient(interface)
    }

    fn flow_control(&self, interface: &str) -> Result<bool, NoAnswer> {
        ethtool::flow_control(interface)
    }

    fn time_stamps(&self, interface: &str) -> Result<TimeStamps, NoAnswer> {
        ethtool::time_stamps(interface)
    }

    fn wake_up(&self, cpu: usize, priority: u8, time: Duration) -> Result<Latency, String> {
        refused(cpu, priority, Item::Core)?;
        // Held while it runs, as the control and cyclictest do it. Where it is refused, a line of its own says so.
        let _awake = hold_awake();
        let probe = WakeUp {
            cpu,
            priority,
            period_ns: PERIOD_NS,
            phase_ns: PHASE_NS,
            spin_ns: 0,
            cycles: 1,
        };
        let figures = probe.lasting(time).run(&AtomicBool::new(false));
        measured(figures.lateness.summary(), figures.lateness.n(), &figures.findings)
    }

    fn gaps(&self, cpu: usize, priority: u8, time: Duration) -> Result<Latency, String> {
        refused(cpu, priority, Item::Core)?;
        let scan = GapScan {
            cpu,
            priority,
            threshold_ns: GAP_NS,
            duration: time,
        };
        let figures = scan.run(&AtomicBool::new(false));
        measured(figures.gaps.summary(), figures.reads, &figures.findings)
    }
}

fn in_words(errno: Errno) -> String {
    errno.desc().to_owned()
}

/// Lets a thread of its own have core and priority, and tells whether it was refused one of them.
fn refused(cpu: usize, priority: u8, item: Item) -> Result<(), String> {
    if cpu >= nix::sched::CpuSet::count() {
        return Err(format!("core {cpu} is beyond what a thread can ask for"));
    }
    let thread = std::thread::Builder::new().spawn(move || enter_core(cpu, priority));
    let thread = thread.map_err(|error| format!("no thread can be had ({error})"))?;
    let findings = thread.join().map_err(|_| "the try failed")?;
    let found = findings.into_iter().find(|finding| finding.item == item);
    found.map_or(Ok(()), |finding| Err(finding.what))
}

fn hold_awake() -> io::Result<File> {
    let mut file = OpenOptions::new().write(true).open(DMA_LATENCY)?;
    file.write_all(&0i32.to_ne_bytes())?;
    Ok(file)
}

/// The figures, if the thread that measured them had its core and its priority.
fn measured(figures: Summary, looks: u64, findings: &[Finding]) -> Result<Latency, String> {
    if let Some(finding) = findings.first() {
        return Err(format!("not measured: {}", finding.what));
    }
    if looks == 0 {
        return Err("not measured: no thread could be had".into());
    }
    Ok(Latency {
        n: figures.n,
        p50_us: figures.p50_us,
        p99_us: figures.p99_us,
        p99_9_us: figures.p99_9_us,
        max_us: figures.max_us,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_try_ends_and_leaves_nothing_behind() {
        let locked = || std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let locked = || {
            locked()
                .lines()
                .find(|line| line.starts_with("VmLck"))
                .map(str::to_owned)
        };
        let before = locked();
        assert!(ThisPc.timer_resolution_ns().is_ok());
        // Given or refused: both are answers.
        let _ = (
            ThisPc.lock_memory(),
            ThisPc.raw_socket(),
            ThisPc.dma_latency(),
            ThisPc.hypervisor(),
        );
        let _ = (ThisPc.take_core(0), ThisPc.fifo(0, 1));
        assert_eq!(locked(), before);
        // SAFETY: 0 is the calling thread; the call touches no memory.
        assert_eq!(unsafe { libc::sched_getscheduler(0) }, libc::SCHED_OTHER);
        assert!(ThisPc.take_core(8191).is_err());
        assert_eq!(ThisPc.addresses("no-such-one"), Ok(vec![]));
        assert!(ThisPc.addresses("lo").is_ok());
        assert!(ThisPc.unzip(Path::new("/nowhere")).is_err());
    }

    #[test]
    fn figures_count_only_with_core_and_priority() {
        let finding = Finding {
            item: Item::Core,
            what: "core 9 cannot be taken".into(),
            fix: String::new(),
        };
        let refused = measured(Summary::default(), 1, &[finding]).unwrap_err();
        assert_eq!(refused, "not measured: core 9 cannot be taken");
        assert!(measured(Summary::default(), 0, &[]).is_err());
        assert_eq!(measured(Summary::default(), 1, &[]), Ok(Latency::default()));
    }
}
