//! What the file of the oscilloscope looks like: 64-bit words, native byte order, all access atomic.
//!
//! ```text
//! word 0   magic                         word 4   process id of the control
//!      1   layout version                     5   cycle time, ns
//!      2   captures                           6   cycles sampled so far
//!      3   words of a ring                    7   zero
//! 8 ..  64 per capture   [0] request: number of what is asked for, 0: nothing    written by the reader
//!                        [1] channels    [2] records read so far    [3] its process id
//!                        [8] number of the request that is being served          written by the control
//!                        [9] records written so far   [10] records lost   [11] 1: refused
//!                        [16..48] cells of the channels                           written by the reader
//!   ..  + ring per capture: records of 2 + channels words: number of the cycle, its date in ns, values
//! ```
//!
//! Octet 0 of the file is locked by the control, octet 1 + n by the reader of capture n.

use super::ring::CAPTURE_WORDS;
use crate::guard::Guard;
use memmap2::MmapRaw;
use std::fs::File;
use std::sync::atomic::{AtomicU64, Ordering};

/// Readers at a time.
pub const CAPTURES: usize = 4;

pub(super) const MAGIC: u64 = u64::from_le_bytes(*b"isocSCP\n");
pub(super) const VERSION: u64 = 1;
/// 3.8 s of 32 channels at 1 ms.
pub(super) const RING_WORDS: usize = 1 << 17;
const HEADER_WORDS: usize = 8;

/// Octets of the file.
pub(super) const FILE_LEN: usize = 8 * (HEADER_WORDS + CAPTURES * (CAPTURE_WORDS + RING_WORDS));

/// Words of the header.
pub(super) mod head {
    pub(crate) const MAGIC: usize = 0;
    pub(crate) const VERSION: usize = 1;
    pub(crate) const CAPTURES: usize = 2;
    pub(crate) const RING_WORDS: usize = 3;
    pub(crate) const PID: usize = 4;
    pub(crate) const PERIOD_NS: usize = 5;
    pub(crate) const SAMPLED: usize = 6;
}

/// The mapped words.
pub(super) struct Segment {
    /// Dropped before the mapping.
    guard: Guard,
    map: MmapRaw,
}

impl Segment {
    /// Lays out fresh, zeroed memory of [`FILE_LEN`] octets.
    pub(super) fn format(map: MmapRaw, file: &File, period_ns: u64) -> Segment {
        let guard = Guard::new(&map, file);
        let segment = Segment { guard, map };
        for (word, value) in [
            (head::VERSION, VERSION),
            (head::CAPTURES, CAPTURES as u64),
            (head::RING_WORDS, RING_WORDS as u64),
            (head::PID, u64::from(std::process::id())),
            (head::PERIOD_NS, period_ns),
        ] {
            segment.head(word).store(value, Ordering::Relaxed);
        }
        segment.head(head::MAGIC).store(MAGIC, Ordering::Release);
        segment
    }

    /// Memory that another process made; what it holds is to be checked.
    pub(super) fn unchecked(map: MmapRaw, file: &File) -> Segment {
        let guard = Guard::new(&map, file);
        Segment { guard, map }
    }

    /// RT: whether somebody has cut the file short. Whoever meets it tells the others: they would read zeros.
    pub(super) fn is_lost(&self) -> bool {
        if self.guard.is_lost() {
            self.head(head::MAGIC).store(0, Ordering::Relaxed);
        }
        self.head(head::MAGIC).load(Ordering::Relaxed) != MAGIC
    }

    /// RT: a word of the header.
    pub(super) fn head(&self, word: usize) -> &AtomicU64 {
        assert!(word < HEADER_WORDS);
        self.word(word)
    }

    /// RT: the words of a capture.
    pub(super) fn capture(&self, capture: usize) -> &[AtomicU64] {
        assert!(capture < CAPTURES);
        self.words(HEADER_WORDS + capture * CAPTURE_WORDS, CAPTURE_WORDS)
    }

    /// RT: those of its ring.
    pub(super) fn ring(&self, capture: usize) -> &[AtomicU64] {
        assert!(capture < CAPTURES);
        let first = HEADER_WORDS + CAPTURES * CAPTURE_WORDS + capture * RING_WORDS;
        self.words(first, RING_WORDS)
    }

    fn word(&self, index: usize) -> &AtomicU64 {
        &self.words(index, 1)[0]
    }

    fn words(&self, first: usize, count: usize) -> &[AtomicU64] {
        assert!(first + count <= self.map.len() / 8);
        // SAFETY: the words lie inside the mapping, which lives as long as `self`; the mapping begins on a page, so they are
        // aligned; this memory is touched through atomics only, here and in every other process.
        unsafe { std::slice::from_raw_parts(self.map.as_mut_ptr().cast::<AtomicU64>().add(first), count) }
    }
}
