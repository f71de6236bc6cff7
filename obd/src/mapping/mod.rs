//! PDO mapping: which octets of a cyclic payload are which object.
//!
//! In:  mapping entries as written to 0x1600.. (receive) and 0x1A00.. (transmit), a dictionary.
//! Out: a [`CopyPlan`], computed once, that then moves values between payload and dictionary without look-up.

use core::fmt;

use crate::{AbortCode, Dictionary, PdoAccess};

/// One mapping entry: `bit_length` bits at `bit_offset` of the payload are the value of `index`/`sub`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappingEntry {
    /// Index of the object.
    pub index: u16,
    /// Sub-index of the object.
    pub sub: u8,
    /// Position in the payload.
    pub bit_offset: u16,
    /// Length in the payload.
    pub bit_length: u16,
}

impl MappingEntry {
    /// Reads the UNSIGNED64 of the mapping object; bits 24..31 are reserved and ignored.
    pub const fn from_u64(raw: u64) -> MappingEntry {
        MappingEntry {
            index: raw as u16,
            sub: (raw >> 16) as u8,
            bit_offset: (raw >> 32) as u16,
            bit_length: (raw >> 48) as u16,
        }
    }

    /// The UNSIGNED64 of the mapping object.
    pub const fn to_u64(self) -> u64 {
        self.index as u64 | (self.sub as u64) << 16 | (self.bit_offset as u64) << 32 | (self.bit_length as u64) << 48
    }
}

/// Which way the data go, seen from the device that owns the dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Payload to dictionary (RPDO).
    Receive,
    /// Dictionary to payload (TPDO).
    Transmit,
}

/// Why a mapping was refused: the entry at `position` (0 is the first) and the abort code that the writer gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappingError {
    /// Position of the entry, from 0.
    pub position: usize,
    /// As it was asked for.
    pub entry: MappingEntry,
    /// Abort code for the SDO that wrote the mapping.
    pub code: AbortCode,
    /// The rule it breaks.
    pub rule: &'static str,
}

impl fmt::Display for MappingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let MappingEntry {
            index,
            sub,
            bit_offset,
            bit_length,
        } = self.entry;
        let MappingError {
            position, rule, code, ..
        } = self;
        write!(
            f,
            "mapping entry {} ({index:#06X}/{sub}, {bit_length} bits at bit {bit_offset}): {rule}: {code}",
            position + 1
        )
    }
}

impl core::error::Error for MappingError {}

/// The payload is shorter than the mapping needs; nothing was copied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PayloadTooShort {
    /// Octets the mapping needs.
    pub need: usize,
    /// Octets of the payload.
    pub got: usize,
}

impl fmt::Display for PayloadTooShort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the mapping needs {} octets, the payload has {}",
            self.need, self.got
        )
    }
}

impl core::error::Error for PayloadTooShort {}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Move {
    payload: u16,
    value: u32,
    octets: u16,
}

/// Up to `N` copies between a payload and the dictionary the plan was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CopyPlan<const N: usize> {
    copies: [Move; N],
    used: usize,
    payload_octets: usize,
}

impl<const N: usize> Default for CopyPlan<N> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const N: usize> CopyPlan<N> {
    /// A plan that copies nothing.
    pub const EMPTY: Self = CopyPlan {
        copies: [Move {
            payload: 0,
            value: 0,
            octets: 0,
        }; N],
        used: 0,
        payload_octets: 0,
    };

    /// Checks mapping entries against a dictionary and a payload limit in octets.
    ///
    /// Refused are objects that do not exist or may not be mapped this way, positions and lengths that are no whole octets,
    /// lengths other than the object's, overlaps, and payloads beyond the limit or `N` entries.
    ///
    /// # Errors
    /// [`MappingError`]: the first entry that is refused, and why.
    pub fn new<const ENTRIES: usize, const BYTES: usize>(
        dictionary: &Dictionary<ENTRIES, BYTES>,
        direction: Direction,
        entries: impl IntoIterator<Item = MappingEntry>,
        limit_octets: usize,
    ) -> Result<Self, MappingError> {
        let mut plan = Self::EMPTY;
        for (position, entry) in entries.into_iter().enumerate() {
            plan.add(dictionary, direction, entry, limit_octets)
                .map_err(|(code, rule)| MappingError {
                    position,
                    entry,
                    code,
                    rule,
                })?;
        }
        Ok(plan)
    }

    fn add<const ENTRIES: usize, const BYTES: usize>(
        &mut self,
        dictionary: &Dictionary<ENTRIES, BYTES>,
        direction: Direction,
        entry: MappingEntry,
        limit_octets: usize,
    ) -> Result<(), (AbortCode, &'static str)> {
        let handle = dictionary
            .find(entry.index, entry.sub)
            .map_err(|code| (code, "the object must exist"))?;
        let mappable = match (direction, dictionary.def(handle).pdo) {
            (_, PdoAccess::Both) | (Direction::Receive, PdoAccess::Rpdo) | (Direction::Transmit, PdoAccess::Tpdo) => {
                true
            }
            (_, PdoAccess::No) | (Direction::Receive, PdoAccess::Tpdo) | (Direction::Transmit, PdoAccess::Rpdo) => {
                false
            }
        };
        if !mappable {
            return Err((AbortCode::NOT_MAPPABLE, "the object must be mappable in this direction"));
        }
        if handle.is_variable() {
            return Err((AbortCode::NOT_MAPPABLE, "an object of variable length cannot be mapped"));
        }
        if !entry.bit_offset.is_multiple_of(8) || !entry.bit_length.is_multiple_of(8) {
            return Err((
                AbortCode::PARAMETER_INCOMPATIBLE,
                "offset and length must be whole octets",
            ));
        }
        let (start, octets) = (entry.bit_offset / 8, entry.bit_length / 8);
        if octets as usize != handle.size() {
            return Err((
                AbortCode::PARAMETER_INCOMPATIBLE,
                "the length must be the length of the object",
            ));
        }
        let end = start as usize + octets as usize;
        if end > limit_octets {
            return Err((AbortCode::PDO_LENGTH, "the payload limit must hold the entry"));
        }
        let others = &self.copies[..self.used];
        if others
            .iter()
            .any(|other| (start as usize) < (other.payload + other.octets) as usize && (other.payload as usize) < end)
        {
            return Err((
                AbortCode::PARAMETER_INCOMPATIBLE,
                "entries must not overlap in the payload",
            ));
        }
        if direction == Direction::Receive && others.iter().any(|other| other.value as usize == handle.offset()) {
            return Err((
                AbortCode::PARAMETER_INCOMPATIBLE,
                "a received object must be mapped only once",
            ));
        }
        if self.used == N {
            return Err((AbortCode::PDO_LENGTH, "the device supports no more mapping entries"));
        }
        self.copies[self.used] = Move {
            payload: start,
            value: handle.offset() as u32,
            octets,
        };
        self.used += 1;
        self.payload_octets = self.payload_octets.max(end);
        Ok(())
    }

    /// Octets of payload up to the end of the last entry.
    pub const fn payload_octets(&self) -> usize {
        self.payload_octets
    }

    /// Number of entries.
    pub const fn len(&self) -> usize {
        self.used
    }

    /// Whether the plan copies nothing.
    pub const fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Copies a received payload into the dictionary. RT: no look-up, no allocation, bounded by `N`.
    ///
    /// # Errors
    /// [`PayloadTooShort`]; nothing is copied then.
    pub fn scatter<const ENTRIES: usize, const BYTES: usize>(
        &self,
        payload: &[u8],
        dictionary: &mut Dictionary<ENTRIES, BYTES>,
    ) -> Result<(), PayloadTooShort> {
        self.check(payload.len())?;
        let values = dictionary.values_mut();
        for copy in &self.copies[..self.used] {
            let (from, to, octets) = (copy.payload as usize, copy.value as usize, copy.octets as usize);
            values[to..to + octets].copy_from_slice(&payload[from..from + octets]);
        }
        Ok(())
    }

    /// Copies the dictionary into a payload to be sent; octets between entries are left as they are.
    /// RT: no look-up, no allocation, bounded by `N`.
    ///
    /// # Errors
    /// [`PayloadTooShort`]; nothing is copied then.
    pub fn gather<const ENTRIES: usize, const BYTES: usize>(
        &self,
        dictionary: &Dictionary<ENTRIES, BYTES>,
        payload: &mut [u8],
    ) -> Result<(), PayloadTooShort> {
        self.check(payload.len())?;
        let values = dictionary.values();
        for copy in &self.copies[..self.used] {
            let (to, from, octets) = (copy.payload as usize, copy.value as usize, copy.octets as usize);
            payload[to..to + octets].copy_from_slice(&values[from..from + octets]);
        }
        Ok(())
    }

    fn check(&self, got: usize) -> Result<(), PayloadTooShort> {
        if got < self.payload_octets {
            Err(PayloadTooShort {
                need: self.payload_octets,
                got,
            })
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests;
