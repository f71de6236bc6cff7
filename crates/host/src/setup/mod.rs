//! What real time needs from the PC: one core, FIFO priority, locked memory, no deep sleep.
//!
//! In:  `[rt]` of the machine file.
//! Out: a prepared process, real-time threads, and one [`Finding`] for each thing that is missing, with its cure.
//!
//! [`prepare_process`] runs once, before any thread of the control starts; [`enter_thread`] runs in each real-time thread
//! before its loop, and after it that thread allocates nothing. With `require = "strict"` anything missing is a refusal.
//!
//! | what | where | against |
//! |---|---|---|
//! | one core for both threads (or one for each), the other threads of the process elsewhere | `cpu.rs` | other work; moves between caches |
//! | SCHED_FIFO | `priority.rs` | whatever else wants the core |
//! | locked memory, touched stacks and heap, no trimming | `memory.rs` | page faults in a cycle |
//! | no idle state that takes long to leave | `awake.rs` | late wake-ups |
//! | blocked signals, no timer slack | [`enter_core`] | handlers and 50 µs of slack on a real-time thread |
//!
//! That it holds is counted: page faults and switches of the cycle thread, in `rt::cycle_stats`.

mod awake;
mod cpu;
mod findings;
mod memory;
mod priority;
#[cfg(test)]
mod tests;

pub use findings::{Finding, Item, Refusal, by_cure};
pub use memory::keep_one_heap;

use crate::capabilities;
use crate::capabilities::Work;
use crate::other_controls::{self, OtherControl};
pub(crate) use awake::usual as usual_keep_awake;
use config::{KeepAwake, Require, Rt};

use awake::Awake;
use nix::errno::Errno;
use nix::sys::signal::{SigSet, Signal};
use std::fs::read_to_string;
use std::path::Path;

/// Stack of a real-time thread, octets; all of it is real memory when memory is locked.
pub const STACK_SIZE: usize = 512 * 1024;

/// What a real-time thread is there for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The bus cycle; runs at `rt.priority`.
    Cycle,
    /// The time limits; runs one above.
    Timeout,
    /// A program in Structured Text; runs below the cycle, those with shorter periods (lower numbers) above others.
    Logic(u8),
    /// The simulated machine on the same PC: two above, so that it answers at once while the cycle thread waits for it,
    /// as real nodes do, whatever else the PC is busy with. Its answers take microseconds.
    Machine,
}

/// A process that is ready to start real-time threads. Keep it as long as they run.
#[derive(Debug)]
pub struct Process {
    /// The core of the real-time threads.
    pub cpu: usize,
    /// That of the time-out thread, mostly the same.
    pub timeout_cpu: usize,
    /// SCHED_FIFO priority of the cycle thread.
    pub priority: u8,
    /// What is missing; empty: nothing. For one warning each.
    pub findings: Vec<Finding>,
    /// Keeps the core from idle states until it is dropped.
    awake: Awake,
}

/// Prepares the whole process: allocator, locked memory, idle states; tries in a thread of its own what every real-time
/// thread will need.
///
/// # Errors
/// [`Refusal`] if anything is missing and `rt.require` is strict.
pub fn prepare_process(rt: &Rt) -> Result<Process, Refusal> {
    let mut findings = Vec::new();
    findings.extend(findings::kernel(read_to_string("/sys/kernel/realtime").ok().as_deref()));
    findings.extend(findings::timers());
    let cpu = cpu::choose(
        rt.cpu,
        &cpu::online(),
        &cpu::isolated(),
        &other_controls(),
        &mut findings,
    );
    let timeout_cpu = cpu::choose_second(rt.timeout_cpu, cpu, &cpu::online(), &mut findings);
    findings.extend(cpu::keep_off(&[cpu, timeout_cpu], &rt.housekeeping_cpus));
    if rt.lock_memory {
        findings.extend(memory::lock());
    }
    let mut process = Process {
        cpu,
        timeout_cpu,
        priority: rt.priority,
        findings,
        awake: Awake::default(),
    };
    let choice = rt.keep_awake.unwrap_or_else(awake::usual);
    let missing = process.keep_awake(choice).err();
    process.findings.extend(missing);
    // The next thread gets the stack of this one, however large that is, and all of it is locked then.
    let thread = std::thread::Builder::new().stack_size(STACK_SIZE);
    let tried = std::thread::scope(|scope| {
        let tries = thread.spawn_scoped(scope, || enter_thread(Role::Timeout, &process));
        tries.ok().and_then(|tries| tries.join().ok())
    });
    process.findings.extend(tried.unwrap_or_default());
    match rt.require {
        Require::Strict if !process.findings.is_empty() => Err(Refusal {
            findings: process.findings,
        }),
        Require::Strict | Require::Warn => Ok(process),
    }
}

impl Process {
    /// Changes how the core is kept awake. Where `/dev/cpu_dma_latency` is wanted and cannot be had, a thread does it.
    ///
    /// # Errors
    /// What cannot be had, with its cure.
    pub fn keep_awake(&mut self, choice: KeepAwake) -> Result<(), Finding> {
        // First end what there is: two ways at once would be none of both.
        self.awake = Awake::default();
        match Awake::hold(choice, self.cpu) {
            Ok(awake) => {
                self.awake = awake;
                Ok(())
            }
            Err(finding) => {
                if choice == KeepAwake::DmaLatency
                    && let Ok(awake) = Awake::hold(KeepAwake::IdleThread, self.cpu)
                {
                    self.awake = awake;
                }
                Err(finding)
            }
        }
    }

    /// How the core is kept awake now.
    pub fn kept_awake(&self) -> KeepAwake {
        self.awake.choice()
    }
}

/// Makes the calling thread a real-time thread: its core, its priority, no signals, a touched stack, and then no rights.
/// Allocates; nothing need be allocated after it. Gives what could not be had; [`prepare_process`] has found the same before.
pub fn enter_thread(role: Role, process: &Process) -> Vec<Finding> {
    let (priority, work) = match role {
        Role::Cycle => (process.priority, Work::RealTime),
        Role::Timeout => (process.priority + 1, Work::RealTime),
        Role::Logic(rank) => (process.priority.saturating_sub(1 + rank).max(1), Work::RealTime),
        Role::Machine => (process.priority + 2, Work::Ordinary),
    };
    let core = match role {
        Role::Timeout => process.timeout_cpu,
        Role::Cycle | Role::Logic(_) | Role::Machine => process.cpu,
    };
    let mut findings = enter_core(core, priority);
    if let Err(cause) = capabilities::give_up(work) {
        let what = format!("rights that are no longer needed cannot be given up ({cause})");
        findings.push(unexpected(what));
    }
    findings
}

/// The core of a machine file that names none: the last isolated one, else the last one online, that no other control has.
pub fn usual_core() -> usize {
    cpu::choose(
        None,
        &cpu::online(),
        &cpu::isolated(),
        &other_controls(),
        &mut Vec::new(),
    )
}

fn other_controls() -> Vec<OtherControl> {
    other_controls::find(Path::new("/proc"), std::process::id())
}

/// As [`enter_thread`], for a thread that has no part in a control: a probe. `priority` is that of SCHED_FIFO, 1 to 99.
pub fn enter_core(cpu: usize, priority: u8) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut blocked = SigSet::all();
    // Pins that are cut short: a thread that had it blocked would end the process before the handler can help.
    blocked.remove(Signal::SIGBUS);
    if let Err(errno) = blocked.thread_block() {
        findings.push(unexpected(format!("signals cannot be blocked ({errno})")));
    }
    // The core before the policy: a FIFO thread must never run, even for a moment, on a core that others need.
    findings.extend(cpu::pin(cpu));
    findings.extend(priority::set_fifo(priority));
    // SAFETY: PR_SET_TIMERSLACK takes one number and touches no memory. FIFO threads have no slack; this is for the others.
    if unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) } != 0 {
        findings.push(unexpected(format!("timer slack cannot be set ({})", Errno::last())));
    }
    memory::prefault_stack();
    findings
}

fn unexpected(what: String) -> Finding {
    Finding::new(Item::Thread, what, "report this: it should not happen")
}
