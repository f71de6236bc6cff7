//! What a controlled node does with errors: threshold counters, the history 0x1003 and error signalling to the MN.
//!
//! In:  errors as they happen, EA and ER of the managing node.
//! Out: EN and EC, the error entries of the next StatusResponse.

use obd::Dictionary;

use super::keys::{CounterKeys, Keys};
use super::objects::HISTORY_ENTRIES;
use crate::wire::{ERROR_ENTRIES_MAX, ERROR_ENTRY_LEN, ErrorEntry, STATUS_RESPONSE_LEN_MIN};

/// Codes of errors that the communication profile defines (profile 2 in the entry type).
pub mod code {
    /// Threshold of collisions reached.
    pub const COLLISION_THRESHOLD: u16 = 0x8163;
    /// Threshold of frames with a wrong CRC reached.
    pub const CRC_THRESHOLD: u16 = 0x8164;
    /// A received PDO is shorter than its mapping.
    pub const PDO_SHORT_RX: u16 = 0x8210;
    /// A received PDO has another mapping version.
    pub const PDO_MAP_VERSION: u16 = 0x8211;
    /// A PReq is longer than its payload limit.
    pub const PREQ_LIMIT: u16 = 0x8238;
    /// A PRes of another node is longer than its payload limit.
    pub const PRES_RX_LIMIT: u16 = 0x823A;
    /// Threshold of lost PReqs reached.
    pub const LOSS_PREQ_THRESHOLD: u16 = 0x8242;
    /// Threshold of lost SoAs reached.
    pub const LOSS_SOA_THRESHOLD: u16 = 0x8244;
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
const QUEUE_LEN: usize = 16;
/// Octets of entries in the shortest StatusResponse: room for two.
const ENTRIES_LEN_MIN: usize = STATUS_RESPONSE_LEN_MIN - 32;

/// Error signalling: entries are shown in the StatusResponse, EN flips, the MN reads them and answers with EA = EN.
#[derive(Clone, Debug)]
pub(super) struct Signalling {
    exception_new: bool,
    exception_clear: bool,
    /// Last EA of the MN.
    acknowledged: bool,
    queue: [ErrorEntry; QUEUE_LEN],
    queued: usize,
    /// The entries that are shown, zeros behind them.
    batch: [u8; ERROR_ENTRIES_MAX * ERROR_ENTRY_LEN],
    batch_len: usize,
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
            batch: [0; ERROR_ENTRIES_MAX * ERROR_ENTRY_LEN],
            batch_len: 0,
        }
    }

    pub(super) fn exception_new(&self) -> bool {
        self.exception_new
    }

    pub(super) fn exception_clear(&self) -> bool {
        self.exception_clear
    }

    /// Octets of the entries to be shown now, filled up with zeros to the length of the shortest StatusResponse.
    pub(super) fn entries(&self) -> &[u8] {
        &self.batch[..self.batch_len.max(ENTRIES_LEN_MIN)]
    }

    /// Queues an entry; false when there is no room for it.
    pub(super) fn push(&mut self, entry: ErrorEntry) -> bool {
        let room = self.queued < QUEUE_LEN;
        if room {
            self.queue[self.queued] = entry;
            self.queued += 1;
        }
        self.show_next();
        room
    }

    /// EA came in a PReq, or in a SoA with a StatusRequest to this node.
    pub(super) fn acknowledge(&mut self, exception_acknowledge: bool) {
        self.acknowledged = exception_acknowledge;
        if self.acknowledged == self.exception_new {
            self.clear_batch();
        }
        self.show_next();
    }

    /// ER came in a SoA with a StatusRequest to this node.
    pub(super) fn reset(&mut self, exception_reset: bool) {
        if exception_reset {
            self.exception_new = false;
            self.acknowledged = false;
            self.clear_batch();
        }
        self.exception_clear = exception_reset;
        self.show_next();
    }

    fn clear_batch(&mut self) {
        self.batch.fill(0);
        self.batch_len = 0;
    }

    /// Shows the next entries when the MN has read the last ones.
    fn show_next(&mut self) {
        if self.exception_clear || self.queued == 0 || self.acknowledged != self.exception_new {
            return;
        }
        let shown = self.queued.min(ERROR_ENTRIES_MAX);
        self.clear_batch();
        self.batch_len = shown * ERROR_ENTRY_LEN;
        for (octets, entry) in self.batch.chunks_exact_mut(ERROR_ENTRY_LEN).zip(&self.queue[..shown]) {
            octets.copy_from_slice(&entry.to_octets());
        }
        self.queue.copy_within(shown..self.queued, 0);
        self.queued -= shown;
        self.exception_new = !self.exception_new;
    }
}

#[cfg(test)]
mod tests;
