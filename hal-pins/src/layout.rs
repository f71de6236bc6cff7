//! What the shared memory looks like: 64-bit words, native byte order, all access atomic.
//!
//! ```text
//! word 0   magic                      word 4   entries in use (stored last: they are complete)
//!      1   layout version                  5   process id of the owner
//!      2   length of the file, octets      6,7 zero
//!      3   capacity, entries
//! 8 ..  8 + capacity                  value cells, one per entry
//!   ..  + 13 per entry                descriptors: [0] type, kind, name length  [1] net + 1  [2] source + 1
//!                                                  [3..11] name, padded with zeros  [11] alias + 1
//!                                                  [12] unit, padded with zeros
//! ```
//!
//! `alias + 1` is the entry of which this one is another name. `net + 1` is the entry of the net a pin is on, `source + 1` the entry whose cell holds the value of an input or a net;
//! 0 is none.

use crate::kind::{Kind, Type};
use crate::mapped::{AtomicU64, Mapped};
use crate::name::{NAME_LEN_MAX, check_name};
use crate::value::AnyValue;
use memmap2::MmapRaw;
use std::fs::File;
use std::sync::atomic::Ordering;

pub(crate) const MAGIC: u64 = u64::from_le_bytes(*b"isocHAL\n");
pub(crate) const VERSION: u64 = 2;
pub(crate) const HEADER_WORDS: usize = 8;
const NAME_WORDS: usize = NAME_LEN_MAX / 8;
const ALIAS_WORD: usize = 3 + NAME_WORDS;
const UNIT_WORD: usize = ALIAS_WORD + 1;
const DESCRIPTOR_WORDS: usize = UNIT_WORD + 1;

/// Longest unit of a value, octets.
pub const UNIT_LEN_MAX: usize = 8;

/// Most pins and nets of one machine.
pub const CAPACITY_MAX: usize = 65_536;

pub(crate) mod at {
    pub(crate) const MAGIC: usize = 0;
    pub(crate) const VERSION: usize = 1;
    pub(crate) const FILE_LEN: usize = 2;
    pub(crate) const CAPACITY: usize = 3;
    pub(crate) const COUNT: usize = 4;
    pub(crate) const PID: usize = 5;
}

/// One pin or net as described in the memory.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) value_type: Type,
    /// The net a pin is on.
    pub(crate) net: Option<usize>,
    /// Whose cell holds the value, if not its own.
    pub(crate) source: Option<usize>,
    /// The pin of which this is another name; kind and type are that one's.
    pub(crate) alias: Option<usize>,
    /// Unit of the value; may be empty. At most [`UNIT_LEN_MAX`] octets.
    pub(crate) unit: String,
}

/// The entry that a name means: that of an alias is the pin itself. An alias of an alias is never made, and never followed.
pub(crate) fn target(entries: &[Entry], index: usize) -> usize {
    entries[index].alias.unwrap_or(index)
}

/// Octets of the memory of so many pins and nets. `capacity` is at most [`CAPACITY_MAX`].
pub const fn file_len(capacity: usize) -> usize {
    8 * (HEADER_WORDS + capacity * (1 + DESCRIPTOR_WORDS))
}

/// The mapped words. The mapping stays until the last handle is gone.
pub(crate) struct Words {
    mapped: Mapped,
    capacity: usize,
}

impl Words {
    /// Lays out fresh, zeroed memory.
    pub(crate) fn format(map: MmapRaw, file: &File, capacity: usize) -> Words {
        assert!((1..=CAPACITY_MAX).contains(&capacity) && map.len() == file_len(capacity));
        let mapped = Mapped::new(map, file);
        let words = Words { mapped, capacity };
        words.word(at::VERSION).store(VERSION, Ordering::Relaxed);
        words
            .word(at::FILE_LEN)
            .store(file_len(capacity) as u64, Ordering::Relaxed);
        words.word(at::CAPACITY).store(capacity as u64, Ordering::Relaxed);
        words
            .word(at::PID)
            .store(u64::from(std::process::id()), Ordering::Relaxed);
        words.word(at::MAGIC).store(MAGIC, Ordering::Release);
        words
    }

    /// Checks the header of memory that another process made. The error says what was found.
    pub(crate) fn check(map: MmapRaw, file: &File) -> Result<Words, String> {
        if map.len() < file_len(1) || !map.len().is_multiple_of(8) {
            return Err(format!("{} octets are no pins of a control: too short", map.len()));
        }
        let mapped = Mapped::new(map, file);
        let words = Words { mapped, capacity: 0 };
        let header = |index| words.word(index).load(Ordering::Acquire);
        if header(at::MAGIC) != MAGIC {
            return Err(format!(
                "not the pins of a control: begins with {:#018x}, not {MAGIC:#018x}",
                header(at::MAGIC)
            ));
        }
        if header(at::VERSION) != VERSION {
            return Err(format!(
                "layout {} of another version of isocnc; this one knows {VERSION}",
                header(at::VERSION)
            ));
        }
        let capacity = usize::try_from(header(at::CAPACITY)).unwrap_or(usize::MAX);
        if !(1..=CAPACITY_MAX).contains(&capacity) {
            return Err(format!("damaged: capacity {capacity}, expected 1 to {CAPACITY_MAX}"));
        }
        let len = words.mapped.len();
        if len != file_len(capacity) || header(at::FILE_LEN) != len as u64 {
            return Err(format!(
                "damaged: {len} octets, expected {} for {capacity} entries",
                file_len(capacity)
            ));
        }
        Ok(Words { capacity, ..words })
    }

    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }

    /// RT: whether somebody has cut the file short: what was lost reads as zeros until it is written again.
    #[inline]
    pub(crate) fn is_lost(&self) -> bool {
        // Where somebody else was the first to touch what was gone, there is no fault here.
        self.mapped.is_lost() || self.word(at::MAGIC).load(Ordering::Relaxed) != MAGIC
    }

    /// Entries that are complete; never above the capacity.
    pub(crate) fn count(&self) -> Result<usize, String> {
        let count = self.word(at::COUNT).load(Ordering::Acquire);
        match usize::try_from(count) {
            Ok(count) if count <= self.capacity => Ok(count),
            _ => Err(format!(
                "damaged: {count} entries in use, but room for {}",
                self.capacity
            )),
        }
    }

    pub(crate) fn pid(&self) -> u32 {
        u32::try_from(self.word(at::PID).load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// RT: the value cell of an entry below the capacity.
    #[inline]
    pub(crate) fn cell(&self, entry: usize) -> &AtomicU64 {
        assert!(entry < self.capacity);
        self.word(HEADER_WORDS + entry)
    }

    /// Describes an entry; readers see it after [`Words::publish`].
    pub(crate) fn write(&self, index: usize, entry: &Entry) {
        let name = entry.name.as_bytes();
        let meta = u64::from(entry.value_type as u8) | u64::from(entry.kind as u8) << 8 | (name.len() as u64) << 16;
        self.descriptor(index, 0).store(meta, Ordering::Relaxed);
        let mut padded = [0; NAME_LEN_MAX];
        padded[..name.len()].copy_from_slice(name);
        for (word, octets) in padded.chunks_exact(8).enumerate() {
            let mut eight = [0; 8];
            eight.copy_from_slice(octets);
            self.descriptor(index, 3 + word)
                .store(u64::from_le_bytes(eight), Ordering::Relaxed);
        }
        let mut unit = [0; UNIT_LEN_MAX];
        let length = entry.unit.len().min(UNIT_LEN_MAX);
        unit[..length].copy_from_slice(&entry.unit.as_bytes()[..length]);
        self.descriptor(index, UNIT_WORD)
            .store(u64::from_le_bytes(unit), Ordering::Relaxed);
        self.write_links(index, entry);
    }

    /// Stores what an entry is connected with.
    pub(crate) fn write_links(&self, index: usize, entry: &Entry) {
        let link = |to: Option<usize>| to.map_or(0, |to| to as u64 + 1);
        self.descriptor(index, 1).store(link(entry.net), Ordering::Release);
        self.descriptor(index, 2).store(link(entry.source), Ordering::Release);
        self.descriptor(index, ALIAS_WORD)
            .store(link(entry.alias), Ordering::Release);
    }

    /// Makes the first `count` entries visible.
    pub(crate) fn publish(&self, count: usize) {
        self.word(at::COUNT).store(count as u64, Ordering::Release);
    }

    /// Reads a descriptor that may be damaged.
    pub(crate) fn read(&self, index: usize, count: usize) -> Result<Entry, String> {
        debug_assert!(count <= self.capacity);
        let damaged = |what: String| format!("damaged: entry {index} has {what}");
        let load = |word| self.descriptor(index, word).load(Ordering::Acquire);
        let meta = load(0);
        let value_type = Type::from_octet(meta as u8).ok_or_else(|| damaged(format!("type {}", meta as u8)))?;
        let kind = Kind::from_octet((meta >> 8) as u8).ok_or_else(|| damaged(format!("kind {}", (meta >> 8) as u8)))?;
        let name_len = usize::try_from(meta >> 16).unwrap_or(usize::MAX);
        if name_len > NAME_LEN_MAX {
            return Err(damaged(format!("a name of {name_len} octets")));
        }
        let mut padded = [0; NAME_LEN_MAX];
        for (word, octets) in padded.chunks_exact_mut(8).enumerate() {
            octets.copy_from_slice(&load(3 + word).to_le_bytes());
        }
        let name = std::str::from_utf8(&padded[..name_len]).map_err(|_| damaged("a name that is no text".into()))?;
        check_name(name).map_err(|error| damaged(error.to_string()))?;
        let link = |word| match usize::try_from(load(word)) {
            Ok(0) => Ok(None),
            Ok(to) if to <= count => Ok(Some(to - 1)),
            _ => Err(damaged(format!(
                "a link to entry {} of {count}",
                load(word).wrapping_sub(1)
            ))),
        };
        let unit = load(UNIT_WORD).to_le_bytes();
        let unit = std::str::from_utf8(&unit).map_err(|_| damaged("a unit that is no text".into()))?;
        let unit = unit.trim_end_matches('\0');
        if unit.contains(char::is_control) {
            return Err(damaged("a unit that cannot be shown".into()));
        }
        Ok(Entry {
            name: name.to_owned(),
            kind,
            value_type,
            net: link(1)?,
            source: link(2)?,
            alias: link(ALIAS_WORD)?,
            unit: unit.to_owned(),
        })
    }

    /// The value an entry shows.
    pub(crate) fn value(&self, index: usize, entry: &Entry) -> AnyValue {
        AnyValue::from_cell(
            entry.value_type,
            self.cell(entry.source.unwrap_or(index)).load(Ordering::Acquire),
        )
    }

    fn descriptor(&self, entry: usize, word: usize) -> &AtomicU64 {
        assert!(entry < self.capacity && word < DESCRIPTOR_WORDS);
        self.word(HEADER_WORDS + self.capacity + entry * DESCRIPTOR_WORDS + word)
    }

    #[inline]
    fn word(&self, index: usize) -> &AtomicU64 {
        &self.mapped.words()[index]
    }
}
