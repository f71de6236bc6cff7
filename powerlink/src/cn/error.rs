//! What a controlled node does with errors: threshold counters, the history 0x1003 and error signalling to the MN.
//!
//! In:  errors as they happen, EA and ER of the managing node.
//! Out: EN and EC, the error entries of the next StatusResponse.

use obd::Dictionary;

use super::objects::{CounterKeys, HISTORY_ENTRIES, Keys};
use crate::wire::{ERROR_ENTRY_LEN, ErrorEntry};

/// Codes of errors that the communication profile defines (profile 2 in the entry type).
pub mod code {
    /// A received PDO is shorter than its mapping.
    pub const PDO_SHORT_RX: u16 = 0x8210;
    /// A received PDO has another mapping version.
    pub const PDO_MAP_VERSION: u16 = 0x8211;
    /// A PReq is longer than its payload limit.
    pub const PREQ_LIMIT: u16 = 0x8238;
    /// Threshold of lost PReqs reached.
    pub const LOSS_PREQ_THRESHOLD: u16 = 0x8242;
    /// Threshold of lost SoCs reached.
    pub const LOSS_SOC_THRESHOLD: u16 = 0x8245;
}

/// Entry type: the error has occurred (no "active" and "cleared" pair).
pub(super) const TYPE_OCCURRED: u16 = 0x3000;
/// Profile number of the communication profile in the entry type.
pub(super) const PROFILE_COMMUNICATION: u16 = 2;

/// What an error adds to a threshold counter; a good cycle takes 1 away.
const ERROR_WEIGHT: u32 = 8;

impl CounterKeys {
    /// Counts an error; true when the threshold is reached, and then the counter starts again. A threshold of 0 never is.
    pub(super) fn error<const E: usize, const B: usize>(&self, dictionary: &mut Dictionary<E, B>) -> bool {
        let cumulative = dictionary.get(self.cumulative).wrapping_add(1);
        dictionary.set(self.cumulative, cumulative);
        let threshold = dictionary.get(self.threshold);
        if threshold == 0 {
            return false;
        }
        let count = dictionary.get(self.count).saturating_add(ERROR_WEIGHT);
        let reached = count >= threshold;
        dictionary.set(self.count, if reached { 0 } else { count });
        reached
    }

    /// Counts a good cycle.
    pub(super) fn good<const E: usize, const B: usize>(&self, dictionary: &mut Dictionary<E, B>) {
        let count = dictionary.get(self.count);
        if count > 0 {
            dictionary.set(self.count, count - 1);
        }
    }
}

/// Puts an entry in front of the history 0x1003; the oldest falls out when it is full.
pub(super) fn record<const E: usize, const B: usize>(
    dictionary: &mut Dictionary<E, B>,
    keys: &Keys,
    entry: &ErrorEntry,
) {
    let count = usize::from(dictionary.get(keys.history_count)).min(HISTORY_ENTRIES);
    let mut newer = entry.to_octets();
    let kept = (count + 1).min(HISTORY_ENTRIES);
    for sub in 1..=kept as u8 {
        // The table defines every sub-index up to HISTORY_ENTRIES as 20 octets long.
        let Ok(handle) = dictionary.find(0x1003, sub) else {
            return;
        };
        let mut older = [0; ERROR_ENTRY_LEN];
        let octets = dictionary.octets(handle);
        older[..octets.len()].copy_from_slice(octets);
        if dictionary.set_octets(handle, &newer).is_err() {
            return;
        }
        newer = older;
    }
    dictionary.set(keys.history_count, kept as u8);
}

/// Errors that wait for the MN; the first causes are kept when it is full.
const QUEUE_LEN: usize = 8;
/// Entries in one StatusResponse: as many as fit in its shortest form.
const BATCH_LEN: usize = 2;

/// Error signalling: entries are shown in the StatusResponse, EN flips, the MN reads them and answers with EA = EN.
#[derive(Clone, Debug)]
pub(super) struct Signalling {
    exception_new: bool,
    exception_clear: bool,
    /// Last EA of the MN.
    acknowledged: bool,
    queue: [ErrorEntry; QUEUE_LEN],
    queued: usize,
    batch: [u8; BATCH_LEN * ERROR_ENTRY_LEN],
}

impl Signalling {
    /// After ResetCommunication: EC is set until the MN has taken ER back.
    pub(super) fn new() -> Signalling {
        Signalling {
            exception_new: false,
            exception_clear: true,
            acknowledged: false,
            queue: [ErrorEntry::default(); QUEUE_LEN],
            queued: 0,
            batch: [0; BATCH_LEN * ERROR_ENTRY_LEN],
        }
    }

    pub(super) fn exception_new(&self) -> bool {
        self.exception_new
    }

    pub(super) fn exception_clear(&self) -> bool {
        self.exception_clear
    }

    /// Octets of the entries to be shown now; zeros when there are none.
    pub(super) fn entries(&self) -> &[u8] {
        &self.batch
    }

    pub(super) fn push(&mut self, entry: ErrorEntry) {
        if self.queued < QUEUE_LEN {
            self.queue[self.queued] = entry;
            self.queued += 1;
        }
        self.show_next();
    }

    /// EA came in a PReq, or in a SoA with a StatusRequest to this node.
    pub(super) fn acknowledge(&mut self, exception_acknowledge: bool) {
        self.acknowledged = exception_acknowledge;
        if self.acknowledged == self.exception_new {
            self.batch.fill(0);
        }
        self.show_next();
    }

    /// ER came in a SoA with a StatusRequest to this node.
    pub(super) fn reset(&mut self, exception_reset: bool) {
        if exception_reset {
            self.exception_new = false;
            self.acknowledged = false;
            self.batch.fill(0);
        }
        self.exception_clear = exception_reset;
        self.show_next();
    }

    /// Shows the next entries when the MN has read the last ones.
    fn show_next(&mut self) {
        if self.exception_clear || self.queued == 0 || self.acknowledged != self.exception_new {
            return;
        }
        let shown = self.queued.min(BATCH_LEN);
        self.batch.fill(0);
        for (octets, entry) in self.batch.chunks_exact_mut(ERROR_ENTRY_LEN).zip(&self.queue[..shown]) {
            octets.copy_from_slice(&entry.to_octets());
        }
        self.queue.copy_within(shown..self.queued, 0);
        self.queued -= shown;
        self.exception_new = !self.exception_new;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
    use crate::wire::ErrorEntries;
    use std::vec::Vec;

    fn entry(code: u16) -> ErrorEntry {
        ErrorEntry {
            entry_type: TYPE_OCCURRED | PROFILE_COMMUNICATION,
            code,
            ..ErrorEntry::default()
        }
    }

    fn shown(signalling: &Signalling) -> Vec<u16> {
        ErrorEntries(signalling.entries())
            .iter()
            .map(|entry| entry.code)
            .collect()
    }

    #[test]
    fn counters_weigh_errors_by_eight_and_start_again_at_the_threshold() {
        let mut dictionary =
            Dictionary::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&[COMMUNICATION_PROFILE]).unwrap();
        let counter = Keys::find(&dictionary).unwrap().loss_of_soc;
        let read = |dictionary: &Dictionary<_, _>| (dictionary.get(counter.cumulative), dictionary.get(counter.count));
        // The default of 15: two errors close together.
        assert!(!counter.error(&mut dictionary));
        assert_eq!(read(&dictionary), (1, 8));
        counter.good(&mut dictionary);
        assert!(counter.error(&mut dictionary), "7 + 8 reaches 15");
        assert_eq!(read(&dictionary), (2, 0));
        assert!(!counter.error(&mut dictionary));
        for _ in 0..9 {
            counter.good(&mut dictionary);
        }
        assert_eq!(read(&dictionary), (3, 0));
        // 80: the tenth error in a row.
        dictionary.set(counter.threshold, 80);
        let reached: Vec<u32> = (1..=20).filter(|_| counter.error(&mut dictionary)).collect();
        assert_eq!(reached, [10, 20]);
        dictionary.set(counter.threshold, 0);
        assert!((0..100).all(|_| !counter.error(&mut dictionary)));
        assert_eq!(read(&dictionary), (123, 0));
    }

    #[test]
    fn the_history_shows_the_newest_first() {
        let mut dictionary =
            Dictionary::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&[COMMUNICATION_PROFILE]).unwrap();
        let keys = Keys::find(&dictionary).unwrap();
        for code in 1..=10 {
            record(&mut dictionary, &keys, &entry(code));
        }
        assert_eq!(dictionary.read(0x1003, 0).unwrap(), [8]);
        for sub in 1..=8 {
            assert_eq!(
                dictionary.read(0x1003, sub).unwrap(),
                entry(11 - u16::from(sub)).to_octets()
            );
        }
    }

    #[test]
    fn entries_wait_until_the_handshake_is_over_and_each_batch_until_the_last_was_read() {
        let mut signalling = Signalling::new();
        for code in 1..=3 {
            signalling.push(entry(code));
        }
        signalling.reset(true);
        assert_eq!(
            (
                signalling.exception_clear(),
                signalling.exception_new(),
                shown(&signalling).len()
            ),
            (true, false, 0)
        );
        signalling.reset(false);
        assert_eq!(
            (signalling.exception_clear(), signalling.exception_new()),
            (false, true)
        );
        assert_eq!(shown(&signalling), [1, 2]);
        signalling.acknowledge(false);
        assert_eq!(
            (signalling.exception_new(), shown(&signalling)),
            (true, std::vec![1, 2])
        );
        signalling.acknowledge(true);
        assert_eq!((signalling.exception_new(), shown(&signalling)), (false, std::vec![3]));
        signalling.acknowledge(true);
        assert_eq!(shown(&signalling), [3]);
        signalling.acknowledge(false);
        assert_eq!((signalling.exception_new(), shown(&signalling).len()), (false, 0));
    }

    #[test]
    fn a_full_queue_keeps_the_first_causes() {
        let mut signalling = Signalling::new();
        for code in 1..=20 {
            signalling.push(entry(code));
        }
        signalling.reset(false);
        let mut seen = Vec::new();
        while !shown(&signalling).is_empty() {
            seen.extend(shown(&signalling));
            signalling.acknowledge(signalling.exception_new());
        }
        assert_eq!(seen, [1, 2, 3, 4, 5, 6, 7, 8]);
    }
}
