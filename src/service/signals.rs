//! Ctrl-C, `kill`, a closed terminal: a wish to stop, never an end in mid motion.

use motion::cancel::Cancel;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

/// The last signal that asked for a stop.
#[derive(Clone, Debug)]
pub struct StopSignal {
    caught: Arc<AtomicI32>,
    cancel: Cancel,
}

impl StopSignal {
    /// Catches SIGINT, SIGTERM and SIGHUP (the terminal is gone) from now on. A SIGHUP that whoever started this process
    /// has it ignore, as `nohup` does, stays ignored.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn install() -> std::io::Result<StopSignal> {
        let (caught, cancel) = (Arc::new(AtomicI32::new(0)), Cancel::default());
        for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
            if signal == libc::SIGHUP && is_ignored(signal)? {
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
