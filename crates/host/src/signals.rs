//! Ctrl-C, `kill`, a closed terminal: a wish to stop, never an end in mid motion.
//!
//! Every other signal that would end or freeze the process by default is without effect; SIGKILL and SIGSTOP cannot be caught,
//! and those of a defect (SIGSEGV and the like) are one.

use motion::cancel::Cancel;
use nix::sys::signal::{SigHandler, Signal, signal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

/// Wishes to stop: Ctrl-C, Ctrl-\, `kill`, a closed terminal, power that fails, a limit of processor time that is reached.
const STOPPING: [libc::c_int; 6] = [
    libc::SIGINT,
    libc::SIGTERM,
    libc::SIGHUP,
    libc::SIGQUIT,
    libc::SIGPWR,
    libc::SIGXCPU,
];
/// Without effect: somebody's mistake, or Ctrl-Z, which would freeze the cycle with the process.
const HARMLESS: [libc::c_int; 8] = [
    libc::SIGUSR1,
    libc::SIGUSR2,
    libc::SIGALRM,
    libc::SIGVTALRM,
    libc::SIGPROF,
    libc::SIGIO,
    libc::SIGSTKFLT,
    libc::SIGTSTP,
];

/// The last signal that asked for a stop.
#[derive(Clone, Debug)]
pub struct StopSignal {
    caught: Arc<AtomicI32>,
    cancel: Cancel,
}

impl StopSignal {
    /// Catches every signal of `STOPPING` from now on, and has the others do nothing. A SIGHUP that whoever started this
    /// process has it ignore, as `nohup` does, stays ignored; so does SIGQUIT.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn install() -> std::io::Result<StopSignal> {
        let (caught, cancel) = (Arc::new(AtomicI32::new(0)), Cancel::default());
        for signal in STOPPING {
            if matches!(signal, libc::SIGHUP | libc::SIGQUIT) && is_ignored(signal)? {
                continue;
            }
            let (caught, cancel) = (Arc::clone(&caught), cancel.clone());
            let handler = move || {
                caught.store(signal, Ordering::Relaxed);
                cancel.cancel();
            };
            // SAFETY: storing to two atomics is all that the handler does.
            unsafe { signal_hook::low_level::register(signal, handler) }?;
        }
        // Caught and not ignored: processes that are started from here have them as usual.
        for signal in HARMLESS.into_iter().chain(libc::SIGRTMIN()..=libc::SIGRTMAX()) {
            // SAFETY: the handler does nothing.
            unsafe { signal_hook::low_level::register(signal, || {}) }?;
        }
        // A terminal would refuse what is printed for as long as these are caught, and freeze the process by default. A file
        // that has become too large is an error of whoever writes it.
        for ignored in [Signal::SIGTTOU, Signal::SIGTTIN, Signal::SIGXFSZ] {
            // SAFETY: no handler is given.
            unsafe { signal(ignored, SigHandler::SigIgn) }?;
        }
        Ok(StopSignal { caught, cancel })
    }

    /// The signal that came, if one did.
    pub fn caught(&self) -> Option<i32> {
        Some(self.caught.load(Ordering::Relaxed)).filter(|signal| *signal != 0)
    }
}

impl StopSignal {
    /// Ends checks of programs when a signal comes.
    pub fn cancel(&self) -> &Cancel {
        &self.cancel
    }
}

/// Ctrl-C ends this process, even if a script has started it in its background: somebody at a terminal is asked, and may have
/// enough of it.
///
/// # Errors
/// If the system refuses.
pub fn end_by_interrupt() -> std::io::Result<()> {
    // SAFETY: no handler is put in.
    unsafe { signal(Signal::SIGINT, SigHandler::SigDfl) }?;
    Ok(())
}

fn is_ignored(signal: i32) -> std::io::Result<bool> {
    // SAFETY: an action of zeros is a valid one.
    let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
    // SAFETY: without a new action the call only fills in the present one.
    match unsafe { libc::sigaction(signal, std::ptr::null(), &mut action) } {
        0 => Ok(action.sa_sigaction == libc::SIG_IGN),
        _ => Err(std::io::Error::last_os_error()),
    }
}

/// Exit code of a process that a signal asked to end: 130 for SIGINT, 143 for SIGTERM, 129 for SIGHUP, 131 for SIGQUIT.
pub fn exit_code(signal: i32) -> u8 {
    128 + signal as u8
}

/// Ends threads also where the one that would end them panics: a scope waits for all of them.
pub struct StopOnDrop<'a>(pub &'a AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}
