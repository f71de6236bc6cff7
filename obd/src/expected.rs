//! What a device must say of itself.

/// A value that an object must have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Expected {
    /// Index of the object.
    pub index: u16,
    /// Sub-index of the object.
    pub sub: u8,
    /// Bits that count.
    pub mask: u32,
    /// Their values; up to four octets, little endian, as they stand in the object.
    pub value: u32,
}
