//! Shared memory as 64-bit words, all of whose access is atomic.
//!
//! In:  a file and its mapping. Out: words; whether somebody has cut the file short.

use crate::guard::Guard;
use memmap2::MmapRaw;
use std::fs::File;

/// What the protocols of shared memory are written in; `tests/models.rs` builds them on another one, which tries every order in which
/// threads may see them.
pub(crate) use std::sync::atomic::AtomicU64;

/// A mapped file. The mapping stays until this is dropped.
pub(crate) struct Mapped {
    /// Dropped before the mapping.
    guard: Guard,
    map: MmapRaw,
}

impl Mapped {
    pub(crate) fn new(map: MmapRaw, file: &File) -> Mapped {
        Mapped {
            guard: Guard::new(&map, file),
            map,
        }
    }

    /// RT: its whole words.
    pub(crate) fn words(&self) -> &[AtomicU64] {
        // SAFETY: the words lie inside the mapping, which lives as long as `self`; it begins on a page, so they are aligned; this
        // memory is touched through atomics only, here and in every other process.
        unsafe { std::slice::from_raw_parts(self.map.as_mut_ptr().cast::<AtomicU64>(), self.map.len() / 8) }
    }

    /// Octets.
    pub(crate) fn len(&self) -> usize {
        self.map.len()
    }

    /// RT: whether part of the file is gone.
    pub(crate) fn is_lost(&self) -> bool {
        self.guard.is_lost()
    }
}
