//! Writes the journal to the disk, in a thread of its own, because a disk takes its time.
//!
//! In:  entries, as they are noted. Out: the journal in the state folder. What cannot be written is tried again with the next
//! entry, and told once on standard error.

use crate::host::capabilities;
use crate::host::capabilities::Work;
use crate::machine::journal::{Entry, Journal};
use std::io::Write;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Receiver;

/// Entries that wait for a disk that takes none; older ones go.
const PENDING_MAX: usize = 20_000;

/// Ends when nobody can note anything any more. `treated`: number of the last entry that is on the disk, or cannot be.
pub(super) fn keep(mut journal: Journal, entries: &Receiver<Entry>, treated: &AtomicU64) {
    capabilities::give_up_or_warn(Work::Ordinary);
    let mut pending: Vec<Entry> = Vec::new();
    let mut failed = false;
    while let Ok(entry) = entries.recv() {
        pending.push(entry);
        pending.extend(entries.try_iter());
        let last = pending.last().map_or(0, |entry| entry.seq);
        match journal.append(&pending) {
            Ok(()) => {
                pending.clear();
                failed = false;
            }
            Err(error) => {
                if !std::mem::replace(&mut failed, true) {
                    let _ = writeln!(std::io::stderr(), "warning: the journal cannot be written: {error}");
                }
                let gone = pending.len().saturating_sub(PENDING_MAX);
                pending.drain(..gone);
            }
        }
        treated.store(last, Ordering::Release);
    }
}
