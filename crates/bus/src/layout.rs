//! Where each mapped object lies in a payload.
//!
//! In:  the list of mapped objects of a node from the machine file.
//! Out: fields that read and write little-endian numbers at fixed places, and the same list as PDO mapping entries.

use config::Mapped;

/// One object in a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The object and its length.
    pub object: Mapped,
    pub offset: usize,
}

impl Field {
    fn octets(self) -> usize {
        usize::from(self.object.bits / 8)
    }

    /// The value, zero-extended. RT.
    #[inline]
    pub fn read(self, payload: &[u8]) -> u64 {
        let mut value = [0; 8];
        if let Some(octets) = payload.get(self.offset..self.offset + self.octets()) {
            value[..octets.len()].copy_from_slice(octets);
        }
        u64::from_le_bytes(value)
    }

    /// The value, sign-extended. RT.
    #[inline]
    pub fn read_signed(self, payload: &[u8]) -> i64 {
        let unused = 64 - u32::from(self.object.bits);
        ((self.read(payload) << unused) as i64) >> unused
    }

    /// Writes the low octets of `value`. RT.
    #[inline]
    pub fn write(self, payload: &mut [u8], value: u64) {
        if let Some(octets) = payload.get_mut(self.offset..self.offset + self.octets()) {
            let length = octets.len();
            octets.copy_from_slice(&value.to_le_bytes()[..length]);
        }
    }
}

/// All objects of a payload, one behind the other without gaps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Fields in the order of the payload.
    pub fields: Vec<Field>,
    /// Length of the payload, octets.
    pub octets: usize,
}

impl Layout {
    /// Places the objects in their order.
    pub fn new(objects: &[Mapped]) -> Layout {
        let mut octets = 0;
        let fields = objects
            .iter()
            .map(|&object| {
                let field = Field { object, offset: octets };
                octets += field.octets();
                field
            })
            .collect();
        Layout { fields, octets }
    }

    /// The field of an object.
    pub fn find(&self, index: u16, sub: u8) -> Option<Field> {
        self.fields
            .iter()
            .copied()
            .find(|field| (field.object.index, field.object.sub) == (index, sub))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn mapped(index: u16, sub: u8, bits: u8) -> Mapped {
        Mapped { index, sub, bits }
    }

    #[test]
    fn fields_follow_each_other_and_keep_their_sign() {
        let layout = Layout::new(&[mapped(0x6041, 0, 16), mapped(0x6061, 0, 8), mapped(0x6064, 0, 32)]);
        assert_eq!(layout.octets, 7);
        let payload = [0x37, 0x92, 0x08, 0xFE, 0xFF, 0xFF, 0xFF];
        let read = |index| layout.find(index, 0).unwrap().read_signed(&payload);
        assert_eq!(layout.find(0x6041, 0).unwrap().read(&payload), 0x9237);
        assert_eq!(read(0x6061), 8);
        assert_eq!(read(0x6064), -2);
        assert_eq!(layout.find(0x6064, 1), None);
    }

    #[test]
    fn writing_touches_only_the_field() {
        let layout = Layout::new(&[mapped(0x6040, 0, 16), mapped(0x607A, 0, 32)]);
        let mut payload = [0xA5; 8];
        layout.find(0x607A, 0).unwrap().write(&mut payload, -2_i64 as u64);
        assert_eq!(payload, [0xA5, 0xA5, 0xFE, 0xFF, 0xFF, 0xFF, 0xA5, 0xA5]);
    }

    #[test]
    fn a_short_payload_reads_as_zero() {
        let field = Layout::new(&[mapped(0x6064, 0, 32)]).fields[0];
        assert_eq!(field.read(&[1, 2]), 0);
    }
}
