//! A wish that a long computation ends before it is done.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The wish; clones share it, and it is never taken back. A signal handler may utter it.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// The result is no longer needed.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Release);
    }

    /// Whether somebody has said so.
    #[inline]
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }
}
