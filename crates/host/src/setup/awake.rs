//! A core that never falls into an idle state from which it takes long to wake.
//!
//! In:  a choice of the machine file or of the calibration.
//! Out: [`Awake`], which holds what it takes until it is dropped.

use super::STACK_SIZE;
use super::cpu::set_affinity;
use super::findings::{Finding, Item};
use crate::capabilities;
use crate::capabilities::Work;
use config::KeepAwake;
use nix::sys::signal::SigSet;
use nix::unistd::{Pid, gettid};
use std::fs::{File, OpenOptions, read_to_string};
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;

const CPUIDLE_DRIVER: &str = "/sys/devices/system/cpu/cpuidle/current_driver";
const DMA_LATENCY: &str = "/dev/cpu_dma_latency";

/// What keeps the core awake; `default()` is nothing.
#[derive(Debug, Default)]
pub(super) enum Awake {
    /// Nothing does.
    #[default]
    Nothing,
    /// Held open at 0: all cores stay out of deep idle states until it is closed.
    DmaLatency {
        _file: File,
    },
    /// The time-out thread does: it looks at every tick, needed or not.
    Ticks,
    IdleThread {
        _thread: IdleThread,
    },
}

impl Awake {
    /// # Errors
    /// What cannot be had.
    pub(super) fn hold(choice: KeepAwake, core: usize) -> Result<Awake, Finding> {
        match choice {
            KeepAwake::None => Ok(Awake::Nothing),
            KeepAwake::Ticks => Ok(Awake::Ticks),
            KeepAwake::DmaLatency => hold_dma_latency(),
            KeepAwake::IdleThread => IdleThread::spawn(core)
                .map(|thread| Awake::IdleThread { _thread: thread })
                .map_err(|what| {
                    Finding::new(
                        Item::IdleStates,
                        format!("no thread can keep core {core} awake: {what}"),
                        "set rt.keep_awake to \"dma-latency\", \"ticks\" or \"none\"",
                    )
                }),
        }
    }

    pub(super) fn choice(&self) -> KeepAwake {
        match self {
            Awake::Nothing => KeepAwake::None,
            Awake::Ticks => KeepAwake::Ticks,
            Awake::DmaLatency { .. } => KeepAwake::DmaLatency,
            Awake::IdleThread { .. } => KeepAwake::IdleThread,
        }
    }
}

/// What most PCs of this kind do best with: without a driver for idle states (most virtual machines) the file would have no
/// effect, and an idle core is halted, which takes a hypervisor long to end.
pub(crate) fn usual() -> KeepAwake {
    if has_idle_states(&read_to_string(CPUIDLE_DRIVER).unwrap_or_default()) {
        KeepAwake::DmaLatency
    } else {
        KeepAwake::IdleThread
    }
}

/// Whether `/dev/cpu_dma_latency` has any effect, by the name of the idle driver.
pub(super) fn has_idle_states(driver: &str) -> bool {
    !matches!(driver.trim(), "" | "none")
}

fn hold_dma_latency() -> Result<Awake, Finding> {
    if !has_idle_states(&read_to_string(CPUIDLE_DRIVER).unwrap_or_default()) {
        return Err(Finding::new(
            Item::IdleStates,
            format!("{DMA_LATENCY} has no effect on this PC, whose kernel has no driver for idle states"),
            "set rt.keep_awake to \"idle-thread\", or leave it out",
        ));
    }
    let held = OpenOptions::new().write(true).open(DMA_LATENCY).and_then(|mut file| {
        // 0 µs may pass from idle to running, as a number of 4 octets.
        file.write_all(&0i32.to_ne_bytes())?;
        Ok(Awake::DmaLatency { _file: file })
    });
    held.map_err(|cause| {
        Finding::new(
            Item::IdleStates,
            format!("{DMA_LATENCY} cannot be held ({cause}); a thread spins on the core instead"),
            "run as root, or open the file to a group with a udev rule",
        )
    })
}

/// A thread of the lowest priority that spins on the real-time core, so that it never halts.
///
/// SCHED_IDLE belongs to the fair class, with the least weight there is: every other thread pushes it off, a FIFO thread
/// within a context switch. It is the one loop of the process that leaves the core no gap, and it may:
/// - the throttling of real time (up to Linux 6.11) counts FIFO and RR threads only;
/// - the fair server (from 6.12 on) takes the core for its 50 ms only if the fair class has had less than 50 ms of the last
///   second. This thread is always ready, so the server is always armed; but our FIFO threads leave more than 5 % of the
///   core (the spin is bounded, each cycle sleeps), this thread gets that, and the server has nothing to make up for. The same
///   thread would make it strike if a cycle thread hung in a loop: 50 ms in each second, which does not matter any more then.
#[derive(Debug)]
pub(super) struct IdleThread {
    stop: Arc<AtomicBool>,
}

impl IdleThread {
    /// Waits for nothing that the thread does behind all others: on a busy PC that is seconds away.
    ///
    /// # Errors
    /// The thread could not be put behind all others: spinning at an ordinary priority, it would do harm.
    pub(super) fn spawn(core: usize) -> Result<IdleThread, String> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let (ready, is_ready) = mpsc::sync_channel(1);
        let run = move || {
            let entered = enter();
            let spins = entered.is_ok();
            // Whoever waits for it cannot be gone.
            let _ = ready.send(entered);
            // Without the processor's hint for waiting loops, by which hypervisors tell a guest that waits from one that works.
            while spins && !stopped.load(Ordering::Relaxed) {}
        };
        std::thread::Builder::new()
            .name("keep-awake".into())
            .stack_size(STACK_SIZE)
            .spawn(run)
            .map_err(|error| error.to_string())?;
        // From now on an error ends the thread, too.
        let thread = IdleThread { stop };
        let id = is_ready.recv().unwrap_or_else(|_| Err("it ended".into()))?;
        // The policy before the core: there it is never an ordinary thread.
        put_behind_all(id)?;
        set_affinity(id, core)?;
        Ok(thread)
    }

    #[cfg(test)]
    pub(super) fn stop_flag(&self) -> Arc<AtomicBool> {
        self.stop.clone()
    }
}

/// The calling thread without signals and rights.
fn enter() -> Result<Pid, String> {
    SigSet::all()
        .thread_block()
        .map_err(|errno| format!("signals cannot be blocked ({errno})"))?;
    capabilities::give_up(Work::RealTime).map_err(|cause| format!("rights cannot be given up ({cause})"))?;
    Ok(gettid())
}

/// Puts a thread of this process behind all others.
fn put_behind_all(thread: Pid) -> Result<(), String> {
    let nothing = libc::sched_param { sched_priority: 0 };
    // The system call itself: the function of this name refuses in musl.
    // SAFETY: `nothing` lives through the call.
    let set = unsafe {
        libc::syscall(
            libc::SYS_sched_setscheduler,
            thread.as_raw(),
            libc::SCHED_IDLE,
            &raw const nothing,
        )
    };
    match set {
        0 => Ok(()),
        _ => Err(format!("SCHED_IDLE is refused ({})", nix::errno::Errno::last())),
    }
}

impl Drop for IdleThread {
    fn drop(&mut self) {
        // It ends when it runs next. On a core that others keep busy that may take seconds, in which it does no harm either.
        self.stop.store(true, Ordering::Relaxed);
    }
}
