//! Ctrl-C, `kill`, a closed terminal: a wish to stop, never an end in mid motion.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

/// The last signal that asked for a stop.
#[derive(Clone, Debug)]
pub struct StopSignal(Arc<AtomicI32>);

impl StopSignal {
    /// Catches SIGINT, SIGTERM and SIGHUP (the terminal is gone) from now on.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn install() -> std::io::Result<StopSignal> {
        let caught = Arc::new(AtomicI32::new(0));
        for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
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

/// Exit code of a process that a signal asked to end: 130 for SIGINT, 143 for SIGTERM, 129 for SIGHUP.
pub fn exit_code(signal: i32) -> u8 {
    128 + signal as u8
}
