//! Ctrl-C, `kill`, a closed terminal: a wish to stop, never an end in mid motion.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

/// The last signal that asked for a stop.
#[derive(Clone, Debug)]
pub struct StopSignal(Arc<AtomicI32>);

impl StopSignal {
    /// Catches SIGINT, SIGTERM and SIGHUP (the terminal is gone) from now on. A SIGHUP that whoever started this process
    /// has it ignore, as `nohup` does, stays ignored.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn install() -> std::io::Result<StopSignal> {
        let caught = Arc::new(AtomicI32::new(0));
        for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
            if signal == libc::SIGHUP && is_ignored(signal)? {
                continue;
            }
            let caught = Arc::clone(&caught);
            // SAFETY: storing to an atomic is all that the handler does.
            unsafe { signal_hook::low_level::register(signal, move || caught.store(signal, Ordering::Relaxed)) }?;
        }
        Ok(StopSignal(caught))
    }

    /// The signal that came, if one did.
    pub fn caught(&self) -> Option<i32> {
        Some(self.0.load(Ordering::Relaxed)).filter(|signal| *signal != 0)
    }
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

/// Exit code of a process that a signal asked to end: 130 for SIGINT, 143 for SIGTERM, 129 for SIGHUP.
pub fn exit_code(signal: i32) -> u8 {
    128 + signal as u8
}
