//! Data types of objects and the Rust types that carry them.

/// Data type of an object; the code is the index of the type in the object dictionary (0x0001 ..), as used in device
/// descriptions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DataType {
    /// One octet, 0 or 1.
    Bool,
    /// INTEGER8.
    I8,
    /// INTEGER16.
    I16,
    /// INTEGER32.
    I32,
    /// INTEGER64.
    I64,
    /// UNSIGNED8.
    U8,
    /// UNSIGNED16.
    U16,
    /// UNSIGNED32.
    U32,
    /// UNSIGNED64.
    U64,
    /// REAL32.
    Real32,
    /// REAL64.
    Real64,
    /// VISIBLE_STRING of variable length, without a terminator.
    VisibleString,
    /// OCTET_STRING of variable length.
    OctetString,
    /// DOMAIN of variable length.
    Domain,
    /// MAC address, 6 octets (POWERLINK).
    Mac,
    /// IP address, sent as a little-endian UNSIGNED32 (POWERLINK).
    Ip,
    /// NETTIME: seconds and nanoseconds, each UNSIGNED32 (POWERLINK).
    NetTime,
}

impl DataType {
    /// Every type with its code.
    pub const CODES: [(u16, DataType); 17] = [
        (0x0001, DataType::Bool),
        (0x0002, DataType::I8),
        (0x0003, DataType::I16),
        (0x0004, DataType::I32),
        (0x0005, DataType::U8),
        (0x0006, DataType::U16),
        (0x0007, DataType::U32),
        (0x0008, DataType::Real32),
        (0x0009, DataType::VisibleString),
        (0x000A, DataType::OctetString),
        (0x000F, DataType::Domain),
        (0x0011, DataType::Real64),
        (0x0015, DataType::I64),
        (0x001B, DataType::U64),
        (0x0401, DataType::Mac),
        (0x0402, DataType::Ip),
        (0x0403, DataType::NetTime),
    ];

    /// The code used in device descriptions.
    pub const fn code(self) -> u16 {
        match self {
            DataType::Bool => 0x0001,
            DataType::I8 => 0x0002,
            DataType::I16 => 0x0003,
            DataType::I32 => 0x0004,
            DataType::U8 => 0x0005,
            DataType::U16 => 0x0006,
            DataType::U32 => 0x0007,
            DataType::Real32 => 0x0008,
            DataType::VisibleString => 0x0009,
            DataType::OctetString => 0x000A,
            DataType::Domain => 0x000F,
            DataType::Real64 => 0x0011,
            DataType::I64 => 0x0015,
            DataType::U64 => 0x001B,
            DataType::Mac => 0x0401,
            DataType::Ip => 0x0402,
            DataType::NetTime => 0x0403,
        }
    }

    /// The type of a code; `None` for codes this crate does not support.
    pub fn from_code(code: u16) -> Option<DataType> {
        DataType::CODES
            .iter()
            .find(|(known, _)| *known == code)
            .map(|(_, data_type)| *data_type)
    }

    /// Length in octets; `None` for types of variable length.
    pub const fn size(self) -> Option<usize> {
        match self {
            DataType::Bool | DataType::I8 | DataType::U8 => Some(1),
            DataType::I16 | DataType::U16 => Some(2),
            DataType::I32 | DataType::U32 | DataType::Real32 | DataType::Ip => Some(4),
            DataType::Mac => Some(6),
            DataType::I64 | DataType::U64 | DataType::Real64 | DataType::NetTime => Some(8),
            DataType::VisibleString | DataType::OctetString | DataType::Domain => None,
        }
    }

    /// Least and greatest value of an integer type; `None` for all others.
    pub const fn integer_range(self) -> Option<(i128, i128)> {
        match self {
            DataType::Bool => Some((0, 1)),
            DataType::I8 => Some((i8::MIN as i128, i8::MAX as i128)),
            DataType::I16 => Some((i16::MIN as i128, i16::MAX as i128)),
            DataType::I32 => Some((i32::MIN as i128, i32::MAX as i128)),
            DataType::I64 => Some((i64::MIN as i128, i64::MAX as i128)),
            DataType::U8 => Some((0, u8::MAX as i128)),
            DataType::U16 => Some((0, u16::MAX as i128)),
            DataType::U32 | DataType::Ip => Some((0, u32::MAX as i128)),
            DataType::U64 => Some((0, u64::MAX as i128)),
            DataType::Real32
            | DataType::Real64
            | DataType::VisibleString
            | DataType::OctetString
            | DataType::Domain
            | DataType::Mac
            | DataType::NetTime => None,
        }
    }

    /// Reads an integer of this type from its octets; `None` for other types and wrong lengths.
    pub(crate) fn integer(self, octets: &[u8]) -> Option<i128> {
        let (least, _) = self.integer_range()?;
        if Some(octets.len()) != self.size() {
            return None;
        }
        let mut wide = [0; 8];
        wide[..octets.len()].copy_from_slice(octets);
        let raw = u64::from_le_bytes(wide);
        if least < 0 {
            let unused_bits = 64 - 8 * octets.len() as u32;
            Some((((raw << unused_bits) as i64) >> unused_bits) as i128)
        } else {
            Some(raw as i128)
        }
    }
}

mod sealed {
    pub trait Sealed {}
}

/// A Rust type that can stand for a value in the dictionary.
pub trait Scalar: sealed::Sealed + Copy {
    /// Whether an object of this data type may be read and written as `Self`.
    fn fits(data_type: DataType) -> bool;
    /// Octets of the value on the wire.
    const SIZE: usize;
    /// Reads `SIZE` octets, little endian.
    fn load(octets: &[u8]) -> Self;
    /// Writes `SIZE` octets, little endian.
    fn store(self, octets: &mut [u8]);
}

macro_rules! scalar {
    ($($rust:ty: $($data_type:ident)|+;)*) => {$(
        impl sealed::Sealed for $rust {}
        impl Scalar for $rust {
            fn fits(data_type: DataType) -> bool {
                matches!(data_type, $(DataType::$data_type)|+)
            }
            const SIZE: usize = core::mem::size_of::<$rust>();
            fn load(octets: &[u8]) -> Self {
                let mut array = [0; core::mem::size_of::<$rust>()];
                array.copy_from_slice(octets);
                <$rust>::from_le_bytes(array)
            }
            fn store(self, octets: &mut [u8]) {
                octets.copy_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}

scalar! {
    u8: U8 | Bool;
    u16: U16;
    u32: U32 | Ip;
    u64: U64;
    i8: I8;
    i16: I16;
    i32: I32;
    i64: I64;
    f32: Real32;
    f64: Real64;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_lead_there_and_back() {
        for (code, data_type) in DataType::CODES {
            assert_eq!(data_type.code(), code);
            assert_eq!(DataType::from_code(code), Some(data_type));
        }
        let known = (0..=u16::MAX)
            .filter(|code| DataType::from_code(*code).is_some())
            .count();
        assert_eq!(known, DataType::CODES.len());
    }

    #[test]
    fn integers_keep_their_sign() {
        assert_eq!(DataType::I8.integer(&[0xFF]), Some(-1));
        assert_eq!(DataType::U8.integer(&[0xFF]), Some(255));
        assert_eq!(DataType::I32.integer(&[0, 0, 0, 0x80]), Some(i32::MIN as i128));
        assert_eq!(
            DataType::I64.integer(&[0xFE, 255, 255, 255, 255, 255, 255, 255]),
            Some(-2)
        );
        assert_eq!(
            DataType::U64.integer(&[0xFE, 255, 255, 255, 255, 255, 255, 255]),
            Some(u64::MAX as i128 - 1)
        );
        assert_eq!(DataType::U16.integer(&[1]), None);
        assert_eq!(DataType::Real32.integer(&[0; 4]), None);
    }
}
