//! What the bus chip of a device has.
//!
//! In:  its registers from 0000h on. Out: the same as plain values.

use crate::wire::register::{self, feature};
use crate::wire::u16_at;

/// Addresses of a device end here.
const MEMORY_END_MAX: u32 = 0x1_0000;

#[derive(Clone, Copy, Debug)]
pub(in crate::main) struct Chip {
    features: u16,
    pub(super) fmmus: u8,
    pub(super) sync_managers: u8,
    /// Where its memory ends.
    pub(super) memory_end: u32,
    /// The state machine is emulated: AL status mirrors AL control, the acknowledgement with it.
    pub(super) emulated: bool,
}

impl Chip {
    /// Nothing was read yet.
    pub(super) const UNKNOWN: Chip = Chip {
        features: 0,
        fmmus: 0,
        sync_managers: 0,
        memory_end: MEMORY_END_MAX,
        emulated: false,
    };

    /// Of what came from [`register::TYPE`] on; what is missing there it has not.
    pub(super) fn parse(data: &[u8]) -> Chip {
        let count = |at| data.get(at).map_or(0, |count: &u8| (*count).min(16));
        Chip {
            features: u16_at(data, 8).unwrap_or(0),
            fmmus: count(4),
            sync_managers: count(5),
            // One that tells none has all that there can be.
            memory_end: match data.get(6) {
                None | Some(0) => MEMORY_END_MAX,
                Some(kib) => MEMORY_END_MAX.min(u32::from(register::MEMORY) + 1024 * u32::from(*kib)),
            },
            emulated: false,
        }
    }

    pub(in crate::main) fn has_clock(&self) -> bool {
        self.features & feature::DC != 0
    }

    /// Times of its clock have 64 bits.
    pub(in crate::main) fn has_wide_clock(&self) -> bool {
        self.features & feature::DC_64 != 0
    }

    pub(super) fn has_lrw(&self) -> bool {
        self.features & feature::NO_LRW == 0
    }
}
