//! What the kernel has counted of a thread: the proof that it neither faulted nor was pushed off its core.
//!
//! In:  the calling thread. Out: [`ThreadUsage`]; between the first cycle and the last all of it but the sleeps stays 0.

use nix::sys::resource::{UsageWho, getrusage};
use serde::{Deserialize, Serialize};

/// Counts since the thread began, or between two looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ThreadUsage {
    /// Pages that were mapped without reading from a disk.
    pub minor_faults: u64,
    /// Pages that were read from a disk.
    pub major_faults: u64,
    /// How often the thread went to sleep by itself: about once a cycle.
    pub sleeps: u64,
    /// How often another thread took the core; one of higher priority, as the time-out thread does.
    pub preemptions: u64,
}

impl ThreadUsage {
    /// What has come since an earlier look.
    #[must_use]
    pub fn since(self, earlier: ThreadUsage) -> ThreadUsage {
        ThreadUsage {
            minor_faults: self.minor_faults.saturating_sub(earlier.minor_faults),
            major_faults: self.major_faults.saturating_sub(earlier.major_faults),
            sleeps: self.sleeps.saturating_sub(earlier.sleeps),
            preemptions: self.preemptions.saturating_sub(earlier.preemptions),
        }
    }
}

/// The counts of the calling thread. RT: one system call, no allocation; for before the first cycle and after the last.
pub fn thread_usage() -> ThreadUsage {
    let count = |count: i64| u64::try_from(count).unwrap_or(0);
    // The kernel refuses no thread its own counts.
    getrusage(UsageWho::RUSAGE_THREAD).map_or(ThreadUsage::default(), |usage| ThreadUsage {
        minor_faults: count(usage.minor_page_faults()),
        major_faults: count(usage.major_page_faults()),
        sleeps: count(usage.voluntary_context_switches()),
        preemptions: count(usage.involuntary_context_switches()),
    })
}
