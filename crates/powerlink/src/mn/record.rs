//! What is remembered of one controlled node for people: its last IdentResponse, its last fault, its error entries.
//!
//! In:  from the node as it is identified, signals errors, is given up. Out: copies, to [`Diagnosis`](super::Diagnosis).
//! RT: no allocation, no locks, fixed size. Nothing the managing node does depends on it.

use super::fault::Fault;
use crate::wire::{ErrorEntry, IdentResponse};

/// Error entries kept of each node.
pub const ERRORS_KEPT: usize = 8;

/// The last fault of a node; kept when the node is up again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastFault {
    /// What it was.
    pub fault: Fault,
    /// When it was seen last, in ns.
    pub at_ns: u64,
    /// How many times the same kind of fault was seen without another kind in between.
    pub count: u32,
}

/// One error entry that a node signalled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct LoggedError {
    /// When it was read, in ns.
    pub at_ns: u64,
    /// As the node sent it, with the time it gave.
    pub entry: ErrorEntry,
}

/// The last [`ERRORS_KEPT`] error entries of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorLog {
    ring: [LoggedError; ERRORS_KEPT],
    /// Entries read since the start; the next one goes to this place of the ring.
    total: u64,
}

impl ErrorLog {
    const EMPTY: ErrorLog = ErrorLog {
        ring: [LoggedError {
            at_ns: 0,
            entry: ErrorEntry {
                entry_type: 0,
                code: 0,
                time: crate::wire::NetTime {
                    seconds: 0,
                    nanoseconds: 0,
                },
                info: [0; 8],
            },
        }; ERRORS_KEPT],
        total: 0,
    };

    fn push(&mut self, error: LoggedError) {
        // The remainder is below ERRORS_KEPT.
        self.ring[(self.total % ERRORS_KEPT as u64) as usize] = error;
        self.total += 1;
    }

    /// Entries read since the start, also those that are no longer kept.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// The entries that are kept, the newest first.
    pub fn newest_first(&self) -> impl Iterator<Item = &LoggedError> {
        let kept = self.total.min(ERRORS_KEPT as u64);
        (1..=kept).map(|back| &self.ring[((self.total - back) % ERRORS_KEPT as u64) as usize])
    }
}

/// All that is remembered of one node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    /// The last IdentResponse and when it came.
    pub(super) ident: Option<(u64, IdentResponse)>,
    pub(super) last_fault: Option<LastFault>,
    pub(super) errors: ErrorLog,
    /// Since when the node is looked for, or was when it was found.
    pub(super) searched_since_ns: u64,
}

impl Record {
    pub(super) const NEW: Record = Record {
        ident: None,
        last_fault: None,
        errors: ErrorLog::EMPTY,
        searched_since_ns: 0,
    };

    pub(super) fn identified(&mut self, now_ns: u64, ident: &IdentResponse) {
        self.ident = Some((now_ns, *ident));
    }

    pub(super) fn error(&mut self, now_ns: u64, entry: ErrorEntry) {
        self.errors.push(LoggedError { at_ns: now_ns, entry });
    }

    pub(super) fn fault(&mut self, now_ns: u64, fault: Fault) {
        let same_kind = |last: &LastFault| core::mem::discriminant(&last.fault) == core::mem::discriminant(&fault);
        let before = self.last_fault.filter(same_kind).map_or(0, |last| last.count);
        self.last_fault = Some(LastFault {
            fault,
            at_ns: now_ns,
            count: before.saturating_add(1),
        });
    }
}
