//! The protocol of one capture, both of its sides, on words of shared memory; `tests/models.rs` tries it in every order in which
//! threads may see them.
//!
//! In:  words of the capture and of its ring, as `layout.rs` has them. Out: records, each whole and once; a count of those that were lost.

use crate::mapped::AtomicU64;
use std::sync::atomic::Ordering::{AcqRel, Acquire, Relaxed, Release};

/// Pins of one capture at the most.
pub const CHANNELS_MAX: usize = 32;

/// Words of a record before its values: number of the cycle, its date in ns.
pub(crate) const RECORD_HEAD: usize = 2;

/// Words of a capture.
pub(crate) mod of {
    pub(crate) const REQUEST: usize = 0;
    pub(crate) const CHANNELS: usize = 1;
    pub(crate) const READ: usize = 2;
    pub(crate) const READER: usize = 3;
    pub(crate) const SERVED: usize = 8;
    pub(crate) const WRITTEN: usize = 9;
    pub(crate) const LOST: usize = 10;
    pub(crate) const REFUSED: usize = 11;
    pub(crate) const CELLS: usize = 16;
}

/// Words of a capture, in all.
pub(crate) const CAPTURE_WORDS: usize = 64;

/// Records that a ring of so many words holds.
const fn depth(ring_words: usize, channels: usize) -> u64 {
    (ring_words / (RECORD_HEAD + channels)) as u64
}

/// The control's side. Nothing of it is read back from the memory.
#[derive(Clone, Copy)]
pub(crate) struct Server {
    request: u64,
    channels: usize,
    cells: [u32; CHANNELS_MAX],
    written: u64,
    /// Where the next record begins in the ring.
    place: usize,
    lost: u64,
}

impl Server {
    pub(crate) const IDLE: Server = Server {
        request: 0,
        channels: 0,
        cells: [0; CHANNELS_MAX],
        written: 0,
        place: 0,
        lost: 0,
    };

    /// RT: a cycle: its number and date, how many cells there are, and the value of each.
    pub(crate) fn serve(
        &mut self,
        capture: &[AtomicU64],
        ring: &[AtomicU64],
        head: [u64; RECORD_HEAD],
        cells: usize,
        value: impl Fn(usize) -> u64,
    ) {
        let request = capture[of::REQUEST].load(Acquire);
        if request != self.request {
            *self = Server::begin(capture, request, cells);
        }
        if self.channels == 0 {
            return;
        }
        let depth = depth(ring.len(), self.channels);
        let waiting = self.written.wrapping_sub(capture[of::READ].load(Acquire));
        if waiting >= depth {
            self.lost += 1;
            capture[of::LOST].store(self.lost, Relaxed);
            return;
        }
        let length = RECORD_HEAD + self.channels;
        let record = &ring[self.place..self.place + length];
        for (word, value) in record.iter().zip(head) {
            word.store(value, Relaxed);
        }
        for (word, cell) in record[RECORD_HEAD..].iter().zip(&self.cells) {
            word.store(value(*cell as usize), Relaxed);
        }
        self.written = self.written.wrapping_add(1);
        self.place += length;
        if self.place + length > depth as usize * length {
            self.place = 0;
        }
        capture[of::WRITTEN].store(self.written, Release);
    }

    /// RT: takes a request over, as far as it makes sense.
    fn begin(capture: &[AtomicU64], request: u64, cells: usize) -> Server {
        let mut server = Server {
            request,
            ..Server::IDLE
        };
        let channels = match usize::try_from(capture[of::CHANNELS].load(Relaxed)) {
            Ok(channels) if request != 0 && (1..=CHANNELS_MAX).contains(&channels) => channels,
            _ => 0,
        };
        let mut is_good = channels > 0 || request == 0;
        for (channel, cell) in server.cells.iter_mut().enumerate().take(channels) {
            match u32::try_from(capture[of::CELLS + channel].load(Relaxed)) {
                Ok(wanted) if (wanted as usize) < cells => *cell = wanted,
                _ => is_good = false,
            }
        }
        if is_good {
            server.channels = channels;
        }
        for (word, value) in [(of::WRITTEN, 0), (of::LOST, 0), (of::REFUSED, u64::from(!is_good))] {
            capture[word].store(value, Relaxed);
        }
        capture[of::SERVED].store(request, Release);
        server
    }
}

/// The reader's side.
pub(crate) struct Reader {
    request: u64,
    read: u64,
    is_served: bool,
}

impl Reader {
    /// Asks for cells, [`CHANNELS_MAX`] at the most. `process`: who asks; he has the capture for himself.
    pub(crate) fn ask(capture: &[AtomicU64], cells: impl ExactSizeIterator<Item = usize>, process: u32) -> Reader {
        // Another one than is served, whatever was asked for before.
        let last = |word: usize| capture[word].load(Acquire);
        let request = match last(of::REQUEST).max(last(of::SERVED)).wrapping_add(1) {
            0 => 1,
            request => request,
        };
        capture[of::CHANNELS].store(cells.len() as u64, Relaxed);
        capture[of::READ].store(0, Relaxed);
        capture[of::READER].store(u64::from(process), Relaxed);
        for (word, cell) in capture[of::CELLS..].iter().zip(cells) {
            word.store(cell as u64, Relaxed);
        }
        capture[of::REQUEST].store(request, Release);
        Reader {
            request,
            read: 0,
            is_served: false,
        }
    }

    /// Records that found the ring full, since the beginning.
    pub(crate) fn lost(&self, capture: &[AtomicU64]) -> u64 {
        match capture[of::SERVED].load(Acquire) == self.request {
            true => capture[of::LOST].load(Relaxed),
            false => 0,
        }
    }

    /// Hands out what has come since the last call, at most `most` records: head and values, as long as `record`; gives their number.
    /// Never waits.
    ///
    /// # Errors
    /// Another process writes where it may not.
    pub(crate) fn take(
        &mut self,
        capture: &[AtomicU64],
        ring: &[AtomicU64],
        most: usize,
        record: &mut [u64],
        mut each: impl FnMut(&[u64]),
    ) -> Result<usize, &'static str> {
        if capture[of::SERVED].load(Acquire) != self.request {
            return match self.is_served {
                false => Ok(0),
                true => Err("another process has taken this capture away"),
            };
        }
        self.is_served = true;
        if capture[of::REFUSED].load(Relaxed) != 0 {
            return Err("the control has refused the channels: another process has changed them");
        }
        let written = capture[of::WRITTEN].load(Acquire);
        let length = record.len();
        let depth = depth(ring.len(), length - RECORD_HEAD);
        let waiting = written.wrapping_sub(self.read);
        if waiting > depth {
            return Err("damaged: more records than its ring holds");
        }
        let count = usize::try_from(waiting).unwrap_or(usize::MAX).min(most);
        for _ in 0..count {
            let place = (self.read % depth) as usize * length;
            for (word, from) in record.iter_mut().zip(&ring[place..place + length]) {
                *word = from.load(Relaxed);
            }
            each(record);
            self.read = self.read.wrapping_add(1);
        }
        capture[of::READ].store(self.read, Release);
        Ok(count)
    }

    /// Gives the capture back, where it is not somebody else's meanwhile.
    pub(crate) fn give_back(&self, capture: &[AtomicU64]) {
        let _ = capture[of::REQUEST].compare_exchange(self.request, 0, AcqRel, Relaxed);
    }
}
