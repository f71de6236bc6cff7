//! One line of an object table.
//!
//! A table is a `const` slice of [`EntryDef`]s written with the builder functions below, so that a whole device can be read
//! in one place:
//!
//! ```
//! use obd::{DataType, EntryDef};
//! const TABLE: &[EntryDef] = &[
//!     EntryDef::ro(0x1000, DataType::U32, "NMT_DeviceType_U32").default(0x000F_0191),
//!     EntryDef::rws(0x1006, DataType::U32, "NMT_CycleLen_U32").limits(400, 0xFFFF_FFFF),
//!     EntryDef::rws(0x1600, DataType::U64, "ObjectMapping").subs(1, 32),
//!     EntryDef::rw(0x607A, DataType::I32, "Target position").rpdo(),
//! ];
//! # assert_eq!(TABLE.len(), 4);
//! ```

use crate::DataType;

/// Octets in front of a value of variable length that hold its present length.
pub(crate) const LENGTH_PREFIX: usize = 2;

/// Who may read and write an object through SDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read only, never changes.
    Const,
    /// Read only; the device itself changes it.
    ReadOnly,
    /// An SDO may write it only.
    WriteOnly,
    /// Read and write.
    ReadWrite,
    /// Read and write; belongs to what is stored by 0x1010.
    ReadWriteStored,
}

impl Access {
    /// Whether an SDO may read the object.
    pub const fn readable(self) -> bool {
        !matches!(self, Access::WriteOnly)
    }

    /// Whether an SDO may write the object.
    pub const fn writable(self) -> bool {
        matches!(self, Access::WriteOnly | Access::ReadWrite | Access::ReadWriteStored)
    }
}

/// In which process data objects of this device an object may be mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PdoAccess {
    /// It may not be mapped.
    No,
    /// In PDOs that this device receives.
    Rpdo,
    /// In PDOs that this device transmits.
    Tpdo,
    /// It may be mapped both ways.
    Both,
}

/// A default value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Zero, or empty for types of variable length.
    Zero,
    /// For integer types.
    Integer(i64),
    /// Octets as on the wire.
    Octets(&'static [u8]),
}

/// Definition of one object or of a range of sub-indices that share it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EntryDef {
    /// Index of the object.
    pub index: u16,
    /// First sub-index of the range.
    pub sub_first: u8,
    /// Last sub-index of the range, included.
    pub sub_last: u8,
    /// Type of each value of the range.
    pub data_type: DataType,
    /// What an SDO may do with it.
    pub access: Access,
    /// In which PDOs it may be mapped.
    pub pdo: PdoAccess,
    /// Greatest length in octets for types of variable length; 0 for all others.
    pub capacity: u16,
    /// Value after start-up and after a reset.
    pub default: Value,
    /// Least value an SDO may write (integer types).
    pub low: Option<i64>,
    /// Greatest value an SDO may write (integer types).
    pub high: Option<i64>,
    /// Name as in the profile.
    pub name: &'static str,
}

impl EntryDef {
    /// A single object at sub-index 0 with default zero; the functions below change one property each.
    pub const fn new(index: u16, data_type: DataType, access: Access, name: &'static str) -> EntryDef {
        EntryDef {
            index,
            sub_first: 0,
            sub_last: 0,
            data_type,
            access,
            pdo: PdoAccess::No,
            capacity: 0,
            default: Value::Zero,
            low: None,
            high: None,
            name,
        }
    }

    /// A constant object.
    pub const fn constant(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
        EntryDef::new(index, data_type, Access::Const, name)
    }

    /// A read-only object.
    pub const fn ro(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
        EntryDef::new(index, data_type, Access::ReadOnly, name)
    }

    /// A write-only object.
    pub const fn wo(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
        EntryDef::new(index, data_type, Access::WriteOnly, name)
    }

    /// An object that can be read and written.
    pub const fn rw(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
        EntryDef::new(index, data_type, Access::ReadWrite, name)
    }

    /// An object that can be read, written and stored.
    pub const fn rws(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
        EntryDef::new(index, data_type, Access::ReadWriteStored, name)
    }

    /// At this sub-index.
    pub const fn sub(self, sub: u8) -> EntryDef {
        self.subs(sub, sub)
    }

    /// At every sub-index from `first` to `last`, `last` included.
    pub const fn subs(mut self, first: u8, last: u8) -> EntryDef {
        self.sub_first = first;
        self.sub_last = last;
        self
    }

    /// May be mapped in a PDO that the device receives.
    pub const fn rpdo(mut self) -> EntryDef {
        self.pdo = PdoAccess::Rpdo;
        self
    }

    /// May be mapped in a PDO that the device transmits.
    pub const fn tpdo(mut self) -> EntryDef {
        self.pdo = PdoAccess::Tpdo;
        self
    }

    /// May be mapped both ways.
    pub const fn any_pdo(mut self) -> EntryDef {
        self.pdo = PdoAccess::Both;
        self
    }

    /// Default of an integer.
    pub const fn default(mut self, value: i64) -> EntryDef {
        self.default = Value::Integer(value);
        self
    }

    /// Default as octets on the wire; for strings the characters.
    pub const fn default_octets(mut self, octets: &'static [u8]) -> EntryDef {
        self.default = Value::Octets(octets);
        self
    }

    /// Greatest length in octets of a type of variable length.
    pub const fn capacity(mut self, octets: u16) -> EntryDef {
        self.capacity = octets;
        self
    }

    /// Least and greatest value that an SDO may write.
    pub const fn limits(mut self, low: i64, high: i64) -> EntryDef {
        self.low = Some(low);
        self.high = Some(high);
        self
    }

    /// Octets that each sub-index takes in a dictionary.
    pub(crate) const fn stride(&self) -> usize {
        match self.data_type.size() {
            Some(size) => size,
            None => LENGTH_PREFIX + self.capacity as usize,
        }
    }

    /// What is wrong with this line, if anything.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        if self.sub_first > self.sub_last {
            return Some("the first sub-index must not lie above the last");
        }
        let longest = match (self.data_type.size(), self.capacity) {
            (None, 0) => return Some("a type of variable length needs a capacity"),
            (Some(_), 1..) => return Some("a type of fixed length takes no capacity"),
            (Some(size), 0) => size,
            (None, capacity) => capacity as usize,
        };
        let within = |value: i64| {
            self.data_type
                .integer_range()
                .is_some_and(|(least, greatest)| (least..=greatest).contains(&(value as i128)))
        };
        if let (Some(low), Some(high)) = (self.low, self.high)
            && low > high
        {
            return Some("the low limit must not lie above the high limit");
        }
        if ![self.low, self.high].into_iter().flatten().all(within) {
            return Some("limits must lie within the range of an integer type");
        }
        match self.default {
            Value::Zero => None,
            Value::Integer(value) if !within(value) => Some("the default must lie within the range of an integer type"),
            Value::Integer(_) => None,
            Value::Octets(octets) if self.data_type.size().is_some_and(|size| size != octets.len()) => {
                Some("the default must be as long as its type")
            }
            Value::Octets(octets) if octets.len() > longest => Some("the default must fit in the capacity"),
            Value::Octets(_) => None,
        }
    }
}

/// Entries a dictionary needs for a table: its lines, and one for each sub-index 0 that the dictionary adds. Tables that share
/// no index can be summed up.
pub const fn lines_of(table: &[EntryDef]) -> usize {
    let mut lines = table.len();
    let mut at = 0;
    while at < table.len() {
        let (mut seen_before, mut has_sub_0, mut other) = (false, false, 0);
        while other < table.len() {
            if table[other].index == table[at].index {
                seen_before |= other < at;
                has_sub_0 |= table[other].sub_first == 0;
            }
            other += 1;
        }
        if !seen_before && !has_sub_0 {
            lines += 1;
        }
        at += 1;
    }
    lines
}

/// Octets of values a dictionary needs for a table, see [`lines_of`].
pub const fn octets_of(table: &[EntryDef]) -> usize {
    // One octet for each added sub-index 0.
    let mut octets = lines_of(table) - table.len();
    let mut at = 0;
    while at < table.len() {
        let def = &table[at];
        octets += def.stride() * (def.sub_last as usize - def.sub_first as usize + 1);
        at += 1;
    }
    octets
}
