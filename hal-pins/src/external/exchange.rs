//! What a control and the process of an external component pass each other: whole records of values, in 64-bit words of
//! shared memory; `docs/external-components.md` has all of it for those who write such a process.
//!
//! A record is `number, tag, values .., check`. Each direction has room for two of them and a word with the number of the
//! latest: number n lies in the first place where n is even, in the second where it is odd, so that the record before stays
//! whole while one is being written. Whoever writes does so without waiting; whoever reads takes a record only if its check fits.
//! So neither the order in which the words of a record become visible nor a writer that is killed between two of them matters,
//! and no lock is needed.

use crate::mapped::AtomicU64;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

/// Words of a record beside its values.
const FRAME: usize = 3;
/// Tries to take a record while its writer writes on.
const TRIES: usize = 3;

/// Words of the header.
pub(crate) mod at {
    pub(crate) const MAGIC: usize = 0;
    pub(crate) const VERSION: usize = 1;
    pub(crate) const FILE_LEN: usize = 2;
    pub(crate) const PINS: usize = 3;
    pub(crate) const INPUTS: usize = 4;
    pub(crate) const HEARTBEAT_MS: usize = 5;
    pub(crate) const PID: usize = 6;
    /// Those below are written by the process.
    pub(crate) const SESSION: usize = 8;
    pub(crate) const HOLDER: usize = 9;
    pub(crate) const LATEST_OUTPUTS: usize = 10;
    pub(crate) const CLAIMS: usize = 11;
    /// Those below by the control, in every cycle.
    pub(crate) const ENDED: usize = 12;
    pub(crate) const LATEST_INPUTS: usize = 13;
}

pub(crate) const HEADER_WORDS: usize = 16;

/// Where records of one direction lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Channel {
    /// Word with the number of the latest one.
    latest: usize,
    /// First word of the first place.
    first: usize,
    /// Values of a record.
    pub(crate) values: usize,
}

/// Words of two records of so many values.
pub(crate) const fn channel_words(values: usize) -> usize {
    2 * (values + FRAME)
}

/// The check of a record: each word changes all bits of what follows, so that a mixture of two records has another one.
pub(crate) fn mix(check: u64, word: u64) -> u64 {
    let mixed = (check ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    mixed ^ mixed >> 32
}

impl Channel {
    pub(crate) fn new(latest: usize, first: usize, values: usize) -> Channel {
        Channel { latest, first, values }
    }

    fn start(&self, number: u64) -> usize {
        self.first + (number & 1) as usize * (self.values + FRAME)
    }

    /// RT: writes the record of this number, which follows on that of the one before; for the one writer of a channel.
    pub(crate) fn put(&self, words: &[AtomicU64], number: u64, tag: u64, values: impl IntoIterator<Item = u64>) {
        let start = self.start(number);
        let mut check = 1;
        for (word, value) in [number, tag].into_iter().chain(values).enumerate() {
            words[start + word].store(value, Relaxed);
            check = mix(check, value);
        }
        words[start + self.values + FRAME - 1].store(check, Relaxed);
        // Release: whoever sees this number finds the record, or a later one.
        words[self.latest].store(number, Release);
    }

    /// RT: takes the latest record if its number is not `known`; gives its number and its tag. Where there is none, or none that is
    /// whole, `values` are those of nothing.
    pub(crate) fn take(&self, words: &[AtomicU64], known: u64, values: &mut [u64]) -> Option<(u64, u64)> {
        (0..TRIES).find_map(|_| {
            let latest = words[self.latest].load(Acquire);
            if latest == known || latest == 0 {
                return None;
            }
            let start = self.start(latest);
            let load = |word: usize| words[start + word].load(Relaxed);
            let (number, tag) = (load(0), load(1));
            let mut check = mix(mix(1, number), tag);
            for (word, value) in values.iter_mut().enumerate() {
                *value = load(2 + word);
                check = mix(check, *value);
            }
            let is_whole = number == latest && check == load(self.values + FRAME - 1);
            is_whole.then_some((number, tag))
        })
    }
}

/// What happens to an external component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A process writes its outputs from now on.
    Attached,
    /// Another process has taken over before the heartbeat of the one before was over: outputs kept their values until the new one
    /// wrote.
    TakenOver,
    /// Its process has given it up; outputs have their safe values.
    Released,
    /// Its process has not renewed its heartbeat in time; outputs have their safe values.
    Lost,
    /// Its file was cut short by another process and is not touched any more; outputs have their safe values.
    CutShort,
}

/// The control's side: whom it believes, and for how long.
#[derive(Debug)]
pub(crate) struct Receiver {
    channel: Channel,
    /// Cycles without a record that are borne.
    limit: u64,
    session: u64,
    /// Number of the last record of that session; 0: there was none.
    number: u64,
    /// Session that may not write any more.
    ended: u64,
    /// Cycles since the last record.
    age: u64,
    alive: bool,
}

impl Receiver {
    pub(crate) fn new(channel: Channel, limit: u64) -> Receiver {
        Receiver {
            channel,
            limit: limit.max(1),
            session: 0,
            number: 0,
            ended: 0,
            age: 0,
            alive: false,
        }
    }

    pub(crate) fn is_alive(&self) -> bool {
        self.alive
    }

    /// RT: the session that may not write any more.
    pub(crate) fn ended(&self) -> u64 {
        self.ended
    }

    /// RT: looks for a record, `cycles` after the last look. Where there is one, `fresh` is true and `values` are its own.
    pub(crate) fn look(&mut self, words: &[AtomicU64], cycles: u64, values: &mut [u64]) -> (bool, Option<Change>) {
        let session = words[at::SESSION].load(Acquire);
        if session != self.session {
            (self.session, self.number) = (session, 0);
            if session == 0 {
                let was_alive = std::mem::take(&mut self.alive);
                return (false, was_alive.then_some(Change::Released));
            }
            if !self.alive {
                self.age = 0;
            }
        }
        if session == 0 || session == self.ended {
            return (false, None);
        }
        if let Some((number, tag)) = self.channel.take(words, self.number, values)
            && tag == session
        {
            let is_first = std::mem::replace(&mut self.number, number) == 0;
            let was_alive = std::mem::replace(&mut self.alive, true);
            self.age = 0;
            let change = match (was_alive, is_first) {
                (false, _) => Some(Change::Attached),
                (true, true) => Some(Change::TakenOver),
                (true, false) => None,
            };
            return (true, change);
        }
        self.age = self.age.saturating_add(cycles);
        if self.age <= self.limit {
            return (false, None);
        }
        // A claim that never wrote is ended, too, but nothing of it was ever shown.
        self.ended = session;
        let was_alive = std::mem::take(&mut self.alive);
        (false, was_alive.then_some(Change::Lost))
    }
}
