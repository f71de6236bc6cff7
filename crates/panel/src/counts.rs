//! What the panel has counted since it began, for `/metrics`.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Counters; readable by any thread at any time.
#[derive(Debug, Default)]
pub struct Counts {
    /// Clients of `/rpc` now.
    pub(crate) clients: AtomicU64,
    /// Clients that were dropped because they did not read what they had asked for.
    pub(crate) slow_dropped: AtomicU64,
    /// Clients that were dropped because nothing was heard of them.
    pub(crate) silent_dropped: AtomicU64,
    /// Requests of pages of others, unknown hosts or without a right.
    pub(crate) refused: AtomicU64,
}

impl Counts {
    pub(crate) fn add(count: &AtomicU64) {
        count.fetch_add(1, Relaxed);
    }

    /// Clients of `/rpc` now.
    pub fn clients(&self) -> u64 {
        self.clients.load(Relaxed)
    }

    /// Clients dropped so far because they did not read.
    pub fn slow_dropped(&self) -> u64 {
        self.slow_dropped.load(Relaxed)
    }

    /// Clients dropped so far because nothing was heard of them.
    pub fn silent_dropped(&self) -> u64 {
        self.silent_dropped.load(Relaxed)
    }

    /// Requests refused so far for who asked, or for whose page.
    pub fn refused(&self) -> u64 {
        self.refused.load(Relaxed)
    }
}
