//! The dictionary itself: definitions, values and defaults in arrays of fixed size.

use core::fmt;
use core::marker::PhantomData;

use crate::definition::LENGTH_PREFIX;
use crate::{AbortCode, DataType, EntryDef, Objects, Scalar, Value};

/// Definition of sub-index 0 of arrays and records whose table does not define it. A static, since its address tells it from
/// the lines of the tables.
static NUMBER_OF_ENTRIES: EntryDef = EntryDef::constant(0, DataType::U8, "NumberOfEntries");

/// Why a dictionary could not be built from its tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuildError {
    /// Two lines define the same object.
    Clash {
        /// Index of the object.
        index: u16,
        /// First sub-index that both lines define.
        sub: u8,
        /// Name in the line that came first.
        first: &'static str,
        /// Name in the other line.
        second: &'static str,
    },
    /// A line contradicts itself.
    BadDefinition {
        /// Index of the object.
        index: u16,
        /// First sub-index of the line.
        sub: u8,
        /// The rule it breaks.
        rule: &'static str,
    },
    /// `ENTRIES` is too small.
    TooManyEntries {
        /// Lines of all tables, and one for each number of entries (sub-index 0) that no line defines.
        need: usize,
        /// Lines that there is room for.
        have: usize,
    },
    /// `BYTES` is too small.
    TooManyBytes {
        /// Octets of all values.
        need: usize,
        /// Octets that there is room for.
        have: usize,
    },
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            BuildError::Clash {
                index,
                sub,
                first,
                second,
            } => {
                write!(
                    f,
                    "object {index:#06X}/{sub} is defined twice: \"{first}\" and \"{second}\""
                )
            }
            BuildError::BadDefinition { index, sub, rule } => write!(f, "object {index:#06X}/{sub}: {rule}"),
            BuildError::TooManyEntries { need, have } => {
                write!(f, "the tables need {need} entries, the dictionary has room for {have}")
            }
            BuildError::TooManyBytes { need, have } => {
                write!(f, "the values need {need} octets, the dictionary has room for {have}")
            }
        }
    }
}

impl core::error::Error for BuildError {}

/// Where one value lies; valid for the dictionary that gave it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Handle {
    slot: u16,
    sub: u8,
    /// First octet of the value, behind the length prefix.
    offset: u32,
    /// Octets of the value, or its capacity.
    size: u16,
    variable: bool,
}

impl Handle {
    /// Octets of the value; the greatest length for types of variable length.
    pub const fn size(self) -> usize {
        self.size as usize
    }

    /// Whether the length of the value may change.
    pub const fn is_variable(self) -> bool {
        self.variable
    }

    /// Sub-index of the value.
    pub const fn sub(self) -> u8 {
        self.sub
    }

    pub(crate) const fn offset(self) -> usize {
        self.offset as usize
    }
}

/// Where one value of the Rust type `T` lies; valid for the dictionary that gave it.
#[derive(Debug, PartialEq, Eq)]
pub struct Key<T> {
    offset: u32,
    scalar: PhantomData<T>,
}

impl<T> Clone for Key<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Key<T> {}

/// One line of the tables, placed.
#[derive(Clone, Copy, Debug)]
struct Slot {
    def: &'static EntryDef,
    index: u16,
    /// First octet of the first sub-index, length prefix included.
    offset: u32,
}

impl Slot {
    fn handle(&self, slot: usize, sub: u8) -> Handle {
        let variable = self.def.data_type.size().is_none();
        let prefix = if variable { LENGTH_PREFIX } else { 0 };
        let start = self.offset as usize + (sub - self.def.sub_first) as usize * self.def.stride();
        Handle {
            slot: slot as u16,
            sub,
            offset: (start + prefix) as u32,
            size: (self.def.stride() - prefix) as u16,
            variable,
        }
    }
}

/// Object dictionary with room for `ENTRIES` lines and `BYTES` octets of values.
///
/// Values of fixed length take their octets, those of variable length their capacity and 2 octets.
#[derive(Clone, Debug)]
pub struct Dictionary<const ENTRIES: usize, const BYTES: usize> {
    /// Sorted by index, then sub-index.
    slots: [Slot; ENTRIES],
    used: usize,
    values: [u8; BYTES],
    /// What `values` becomes by a reset.
    defaults: [u8; BYTES],
    used_bytes: usize,
}

impl<const ENTRIES: usize, const BYTES: usize> Dictionary<ENTRIES, BYTES> {
    /// Builds the dictionary of all lines of `tables`, in any order. Arrays and records whose sub-index 0 is not defined get it
    /// as a constant: the highest sub-index.
    ///
    /// # Errors
    /// [`BuildError`]: a bad line, a value defined twice, or more of them than there is room for.
    pub fn new(tables: &[&'static [EntryDef]]) -> Result<Self, BuildError> {
        let all = || tables.iter().copied().flatten();
        if let Some((def, rule)) = all().find_map(|def| def.fault().map(|rule| (def, rule))) {
            return Err(BuildError::BadDefinition {
                index: def.index,
                sub: def.sub_first,
                rule,
            });
        }
        let lines = all().count();
        let lacks_sub_0 = |def: &EntryDef| !all().any(|other| other.index == def.index && other.sub_first == 0);
        let is_first_of_index =
            |position: usize, def: &EntryDef| !all().take(position).any(|other| other.index == def.index);
        let added = all()
            .enumerate()
            .filter(|(at, def)| lacks_sub_0(def) && is_first_of_index(*at, def))
            .count();
        let need = lines + added;
        if need > ENTRIES || need > u16::MAX as usize {
            return Err(BuildError::TooManyEntries { need, have: ENTRIES });
        }

        let mut dictionary = Dictionary {
            slots: [Slot {
                def: &NUMBER_OF_ENTRIES,
                index: 0,
                offset: 0,
            }; ENTRIES],
            used: 0,
            values: [0; BYTES],
            defaults: [0; BYTES],
            used_bytes: 0,
        };
        for (position, def) in all().enumerate() {
            if lacks_sub_0(def) && is_first_of_index(position, def) {
                dictionary.insert(Slot {
                    def: &NUMBER_OF_ENTRIES,
                    index: def.index,
                    offset: 0,
                });
            }
            dictionary.insert(Slot {
                def,
                index: def.index,
                offset: 0,
            });
        }
        dictionary.refuse_clashes()?;
        dictionary.place()?;
        dictionary.fill_defaults();
        Ok(dictionary)
    }

    /// Inserts in sorted order; the caller has checked the room.
    fn insert(&mut self, slot: Slot) {
        let key = |slot: &Slot| (slot.index, slot.def.sub_first);
        let at = self.slots[..self.used].partition_point(|other| key(other) <= key(&slot));
        self.slots.copy_within(at..self.used, at + 1);
        self.slots[at] = slot;
        self.used += 1;
    }

    fn refuse_clashes(&self) -> Result<(), BuildError> {
        for pair in self.slots[..self.used].windows(2) {
            if pair[0].index == pair[1].index && pair[0].def.sub_last >= pair[1].def.sub_first {
                return Err(BuildError::Clash {
                    index: pair[0].index,
                    sub: pair[1].def.sub_first,
                    first: pair[0].def.name,
                    second: pair[1].def.name,
                });
            }
        }
        Ok(())
    }

    fn place(&mut self) -> Result<(), BuildError> {
        let mut next = 0;
        for slot in &mut self.slots[..self.used] {
            slot.offset = next as u32;
            next += slot.def.stride() * ((slot.def.sub_last - slot.def.sub_first) as usize + 1);
        }
        if next > BYTES || next > u32::MAX as usize {
            return Err(BuildError::TooManyBytes {
                need: next,
                have: BYTES,
            });
        }
        self.used_bytes = next;
        Ok(())
    }

    fn fill_defaults(&mut self) {
        for at in 0..self.used {
            let slot = self.slots[at];
            for sub in slot.def.sub_first..=slot.def.sub_last {
                let handle = slot.handle(at, sub);
                if core::ptr::eq(slot.def, &NUMBER_OF_ENTRIES) {
                    self.values[handle.offset()] = self.highest_sub(slot.index);
                }
                match slot.def.default {
                    Value::Zero => {}
                    Value::Integer(value) => self.store(handle, &value.to_le_bytes()[..handle.size()]),
                    Value::Octets(octets) => self.store(handle, octets),
                }
            }
        }
        self.defaults = self.values;
    }

    fn highest_sub(&self, index: u16) -> u8 {
        self.slots[..self.used]
            .iter()
            .filter(|slot| slot.index == index)
            .map(|slot| slot.def.sub_last)
            .max()
            .unwrap_or(0)
    }

    /// Finds a value.
    ///
    /// # Errors
    /// [`AbortCode::NO_OBJECT`] without such an index, [`AbortCode::NO_SUB_INDEX`] without such a sub-index.
    pub fn find(&self, index: u16, sub: u8) -> Result<Handle, AbortCode> {
        let slots = &self.slots[..self.used];
        let after = slots.partition_point(|slot| (slot.index, slot.def.sub_first) <= (index, sub));
        if let Some(at) = after.checked_sub(1)
            && slots[at].index == index
        {
            if sub <= slots[at].def.sub_last {
                return Ok(slots[at].handle(at, sub));
            }
            return Err(AbortCode::NO_SUB_INDEX);
        }
        // Every index starts with a sub-index 0 but those whose table says otherwise.
        let has_index = slots.get(after).is_some_and(|slot| slot.index == index);
        Err(if has_index {
            AbortCode::NO_SUB_INDEX
        } else {
            AbortCode::NO_OBJECT
        })
    }

    /// Finds a value that is read or written as `T` without look-up.
    ///
    /// # Errors
    /// As [`Dictionary::find`], and [`AbortCode::LENGTH_MISMATCH`] when the object has another type.
    pub fn key<T: Scalar>(&self, index: u16, sub: u8) -> Result<Key<T>, AbortCode> {
        let handle = self.find(index, sub)?;
        if !T::fits(self.def(handle).data_type) {
            return Err(AbortCode::LENGTH_MISMATCH);
        }
        Ok(Key {
            offset: handle.offset,
            scalar: PhantomData,
        })
    }

    /// The line that defines a value.
    pub fn def(&self, handle: Handle) -> &'static EntryDef {
        self.slots[handle.slot as usize].def
    }

    /// Reads a value. RT: no look-up, no allocation, bounded.
    pub fn get<T: Scalar>(&self, key: Key<T>) -> T {
        T::load(&self.values[key.offset as usize..][..T::SIZE])
    }

    /// Writes a value as the application: access and limits are for SDO only. RT: no look-up, no allocation, bounded.
    pub fn set<T: Scalar>(&mut self, key: Key<T>, value: T) {
        value.store(&mut self.values[key.offset as usize..][..T::SIZE]);
    }

    /// Octets of a value at present, little endian. RT: no look-up, no allocation, bounded.
    pub fn octets(&self, handle: Handle) -> &[u8] {
        let start = handle.offset();
        &self.values[start..start + self.length(handle)]
    }

    /// Writes the octets of a value as the application: only the length is checked. RT: no look-up, no allocation, bounded.
    ///
    /// # Errors
    /// [`AbortCode::TOO_LONG`], [`AbortCode::TOO_SHORT`].
    pub fn set_octets(&mut self, handle: Handle, octets: &[u8]) -> Result<(), AbortCode> {
        check_length(handle, octets.len())?;
        self.store(handle, octets);
        Ok(())
    }

    /// Changes a value and what it becomes by a reset: for what only the running device knows, such as its node id.
    ///
    /// # Errors
    /// [`AbortCode::TOO_LONG`], [`AbortCode::TOO_SHORT`].
    pub fn set_default(&mut self, handle: Handle, octets: &[u8]) -> Result<(), AbortCode> {
        self.set_octets(handle, octets)?;
        let whole = whole(handle);
        self.defaults[whole.clone()].copy_from_slice(&self.values[whole]);
        Ok(())
    }

    /// Sets all values of the objects `first..=last` back to their defaults.
    pub fn restore_defaults(&mut self, first: u16, last: u16) {
        for slot in &self.slots[..self.used] {
            if (first..=last).contains(&slot.index) {
                let start = slot.offset as usize;
                let end = start + slot.def.stride() * ((slot.def.sub_last - slot.def.sub_first) as usize + 1);
                self.values[start..end].copy_from_slice(&self.defaults[start..end]);
            }
        }
    }

    /// Value of an object as an SDO reads it, little endian.
    ///
    /// # Errors
    /// As [`Dictionary::find`], and [`AbortCode::READ_OF_WRITE_ONLY`].
    pub fn read(&self, index: u16, sub: u8) -> Result<&[u8], AbortCode> {
        let handle = self.find(index, sub)?;
        if !self.def(handle).access.readable() {
            return Err(AbortCode::READ_OF_WRITE_ONLY);
        }
        Ok(self.octets(handle))
    }

    /// Whether an SDO may write a value of `len` octets to an object, as far as can be told before they come.
    ///
    /// # Errors
    /// The abort code of the first check that fails.
    pub fn check_write_length(&self, index: u16, sub: u8, len: usize) -> Result<Handle, AbortCode> {
        let handle = self.find(index, sub)?;
        if !self.def(handle).access.writable() {
            return Err(AbortCode::WRITE_OF_READ_ONLY);
        }
        check_length(handle, len)?;
        Ok(handle)
    }

    /// Whether an SDO may write `value` to an object; nothing is changed.
    ///
    /// # Errors
    /// The abort code of the first check that fails.
    pub fn check_write(&self, index: u16, sub: u8, value: &[u8]) -> Result<Handle, AbortCode> {
        let handle = self.check_write_length(index, sub, value.len())?;
        let def = self.def(handle);
        if let Some(number) = def.data_type.integer(value) {
            if def.data_type == DataType::Bool && number > 1 {
                return Err(AbortCode::VALUE_RANGE);
            }
            if def.low.is_some_and(|low| number < low as i128) {
                return Err(AbortCode::VALUE_TOO_LOW);
            }
            if def.high.is_some_and(|high| number > high as i128) {
                return Err(AbortCode::VALUE_TOO_HIGH);
            }
        }
        Ok(handle)
    }

    /// Writes an object as an SDO does: existence, access, length and limits are checked, in this order.
    ///
    /// # Errors
    /// The abort code of the first check that fails; nothing is changed then.
    pub fn write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<Handle, AbortCode> {
        let handle = self.check_write(index, sub, value)?;
        self.store(handle, value);
        Ok(handle)
    }

    /// All lines with their index, in the order of index and sub-index.
    pub fn lines(&self) -> impl Iterator<Item = (u16, &'static EntryDef)> + '_ {
        self.slots[..self.used].iter().map(|slot| (slot.index, slot.def))
    }

    /// Lines and octets in use, to choose `ENTRIES` and `BYTES`.
    pub fn used(&self) -> (usize, usize) {
        (self.used, self.used_bytes)
    }

    fn length(&self, handle: Handle) -> usize {
        if !handle.variable {
            return handle.size();
        }
        let prefix = handle.offset() - LENGTH_PREFIX;
        u16::from_le_bytes([self.values[prefix], self.values[prefix + 1]]) as usize
    }

    /// Stores octets whose length was checked.
    fn store(&mut self, handle: Handle, octets: &[u8]) {
        let start = handle.offset();
        if handle.variable {
            self.values[start - LENGTH_PREFIX..start].copy_from_slice(&(octets.len() as u16).to_le_bytes());
        }
        self.values[start..start + octets.len()].copy_from_slice(octets);
    }

    pub(crate) fn values(&self) -> &[u8; BYTES] {
        &self.values
    }

    pub(crate) fn values_mut(&mut self) -> &mut [u8; BYTES] {
        &mut self.values
    }
}

impl<const ENTRIES: usize, const BYTES: usize> Objects for Dictionary<ENTRIES, BYTES> {
    fn sdo_read(&mut self, index: u16, sub: u8, out: &mut [u8]) -> Result<usize, AbortCode> {
        let value = self.read(index, sub)?;
        out.get_mut(..value.len())
            .ok_or(AbortCode::OUT_OF_MEMORY)?
            .copy_from_slice(value);
        Ok(value.len())
    }

    fn sdo_write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
        self.write(index, sub, value).map(|_| ())
    }

    /// Always as a whole; but what cannot be written is refused at once.
    fn sdo_write_parts(&mut self, index: u16, sub: u8, len: usize) -> Result<bool, AbortCode> {
        self.check_write_length(index, sub, len).map(|_| false)
    }
}

fn check_length(handle: Handle, len: usize) -> Result<(), AbortCode> {
    if len > handle.size() {
        Err(AbortCode::TOO_LONG)
    } else if len < handle.size() && !handle.variable {
        Err(AbortCode::TOO_SHORT)
    } else {
        Ok(())
    }
}

/// All octets of a value, length prefix included.
fn whole(handle: Handle) -> core::ops::Range<usize> {
    let prefix = if handle.variable { LENGTH_PREFIX } else { 0 };
    handle.offset() - prefix..handle.offset() + handle.size()
}

#[cfg(test)]
mod tests;
