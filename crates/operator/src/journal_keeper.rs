//! Writes the journal to the disk, in a thread of its own, because a disk takes its time.
//!
//! In:  entries, as they are noted. Out: the journal in the state folder. What cannot be written is tried again, and told: once on
//! standard error, and with every answer that something was kept.

use host::capabilities;
use host::capabilities::Work;
use machine::journal::{Entry, Journal};
use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

/// Entries that wait for a disk that takes none; older ones go.
const PENDING_MAX: usize = 20_000;
/// Between two attempts where no entry comes.
const AGAIN: Duration = Duration::from_secs(1);

/// How far the journal is on the disk.
#[derive(Debug, Default)]
pub struct Kept {
    /// Number of the last entry that is there, or cannot be.
    treated: AtomicU64,
    fails: AtomicBool,
}

impl Kept {
    /// All entries up to this number are there.
    pub fn begin(&self, last: u64) {
        self.treated.store(last, Ordering::Release);
    }

    /// Number of the last entry that is there, or cannot be.
    pub fn last(&self) -> u64 {
        self.treated.load(Ordering::Acquire)
    }

    /// Whether the entries up to this number are there, or cannot be.
    pub fn has(&self, seq: u64) -> bool {
        self.last() >= seq
    }

    /// Whether the last attempt failed.
    pub fn fails(&self) -> bool {
        self.fails.load(Ordering::Relaxed)
    }
}

/// Ends when nobody can note anything any more.
pub(super) fn keep(mut journal: Journal, entries: &Receiver<Entry>, kept: &Kept) {
    capabilities::give_up_or_warn(Work::Ordinary);
    let mut pending: Vec<Entry> = Vec::new();
    let mut last = 0;
    loop {
        let wait = if pending.is_empty() { Duration::MAX } else { AGAIN };
        match entries.recv_timeout(wait) {
            Ok(entry) => pending.push(entry),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        pending.extend(entries.try_iter());
        last = pending.last().map_or(last, |entry| entry.seq);
        let written = journal.append(&pending);
        let failed_before = kept.fails.swap(written.is_err(), Ordering::Relaxed);
        match written {
            Ok(()) => pending.clear(),
            Err(error) => {
                if !failed_before {
                    let _ = writeln!(
                        files::printed::stderr(),
                        "warning: the journal cannot be written: {error}"
                    );
                }
                let gone = pending.len().saturating_sub(PENDING_MAX);
                pending.drain(..gone);
            }
        }
        kept.treated.store(last, Ordering::Release);
    }
    // What waits for room gets a last chance.
    let _ = journal.append(&pending);
}
