//! A bell: whoever pauses until something is due wakes at once when somebody rings.
//!
//! For ordinary threads; real time neither rings nor listens.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// A bell that remembers a ring until it is heard.
#[derive(Debug, Default)]
pub struct WakeSignal {
    rung: Mutex<bool>,
    changed: Condvar,
}

impl WakeSignal {
    /// Wakes whoever waits, or the next one who does.
    pub fn ring(&self) {
        *self.rung.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.changed.notify_all();
    }

    /// Pauses until somebody rings, `most` at the longest.
    pub fn wait(&self, most: Duration) {
        let rung = self.rung.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.changed.wait_timeout_while(rung, most, |rung| !*rung);
        let (mut rung, _) = waited.unwrap_or_else(PoisonError::into_inner);
        *rung = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_is_not_lost_and_is_heard_once() {
        let bell = WakeSignal::default();
        bell.ring();
        // Would fail the test run by its length, not by a clock.
        bell.wait(Duration::from_secs(3600));
        bell.wait(Duration::from_millis(1));
    }

    #[test]
    fn a_waiting_thread_wakes() {
        let bell = WakeSignal::default();
        std::thread::scope(|scope| {
            scope.spawn(|| bell.wait(Duration::from_secs(3600)));
            bell.ring();
        });
    }
}
