//! Concise DCF: the list of writes that configures one node (0x1F22/node), or a whole network when it is the file of a
//! managing node, where the lists of the nodes stand as values.
//!
//! In:  octets of a file or of an object. Out: the writes in order, or an error with the offset and what was expected; and
//! the other way round into a caller's buffer.
//!
//! Layout, all little endian: count u32, then per write index u16, sub-index u8, size u32, `size` octets of value.

use core::fmt;

/// Octets in front of each value.
const HEADER_LEN: usize = 7;
/// Octets of the count.
const COUNT_LEN: usize = 4;

/// One write of a concise DCF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CdcWrite<'a> {
    /// Index of the object.
    pub index: u16,
    /// Sub-index of the object.
    pub sub: u8,
    /// Value, little endian.
    pub value: &'a [u8],
}

/// What is wrong with the octets, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CdcError {
    /// The octets end before `expected`.
    Truncated {
        /// Where `expected` would start.
        offset: usize,
        /// What should stand there.
        expected: &'static str,
        /// Its length in octets.
        need: usize,
        /// Octets that are left.
        got: usize,
    },
    /// Octets follow after the last write that the count announces.
    Trailing {
        /// First octet too many.
        offset: usize,
        /// How many octets follow.
        got: usize,
    },
    /// The buffer of the writer is full.
    NoRoom {
        /// Octets the buffer would have to hold.
        need: usize,
        /// Octets of the buffer.
        have: usize,
    },
}

impl fmt::Display for CdcError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            CdcError::Truncated {
                offset,
                expected,
                need,
                got,
            } => {
                write!(
                    f,
                    "offset {offset}: expected {expected} of {need} octets, {got} are left"
                )
            }
            CdcError::Trailing { offset, got } => {
                write!(
                    f,
                    "offset {offset}: expected the end after the last counted write, {got} octets are left"
                )
            }
            CdcError::NoRoom { need, have } => write!(f, "{need} octets needed, the buffer holds {have}"),
        }
    }
}

impl core::error::Error for CdcError {}

/// Reads a concise DCF; yields its writes, at most one error, and then nothing more.
#[derive(Clone, Debug)]
pub struct CdcReader<'a> {
    octets: &'a [u8],
    offset: usize,
    left: u32,
    done: bool,
}

impl<'a> CdcReader<'a> {
    /// Reads the count.
    ///
    /// # Errors
    /// [`CdcError::Truncated`]: the count is cut short.
    pub fn new(octets: &'a [u8]) -> Result<Self, CdcError> {
        let mut reader = CdcReader {
            octets,
            offset: 0,
            left: 0,
            done: false,
        };
        let count = reader.cut(COUNT_LEN, "the number of writes")?;
        reader.left = u32::from_le_bytes([count[0], count[1], count[2], count[3]]);
        Ok(reader)
    }

    fn cut(&mut self, need: usize, expected: &'static str) -> Result<&'a [u8], CdcError> {
        let rest = &self.octets[self.offset..];
        let truncated = CdcError::Truncated {
            offset: self.offset,
            expected,
            need,
            got: rest.len(),
        };
        let taken = rest.get(..need).ok_or(truncated)?;
        self.offset += need;
        Ok(taken)
    }

    fn write(&mut self) -> Result<CdcWrite<'a>, CdcError> {
        let header = self.cut(HEADER_LEN, "index, sub-index and size of a write")?;
        let size = u32::from_le_bytes([header[3], header[4], header[5], header[6]]);
        let value = self.cut(usize::try_from(size).unwrap_or(usize::MAX), "a value")?;
        Ok(CdcWrite {
            index: u16::from_le_bytes([header[0], header[1]]),
            sub: header[2],
            value,
        })
    }
}

impl<'a> Iterator for CdcReader<'a> {
    type Item = Result<CdcWrite<'a>, CdcError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        if self.left == 0 {
            self.done = true;
            let got = self.octets.len() - self.offset;
            return (got > 0).then_some(Err(CdcError::Trailing {
                offset: self.offset,
                got,
            }));
        }
        self.left -= 1;
        let write = self.write();
        self.done = write.is_err();
        Some(write)
    }
}

/// Writes a concise DCF into a buffer.
#[derive(Debug)]
pub struct CdcWriter<'a> {
    octets: &'a mut [u8],
    len: usize,
    count: u32,
}

impl<'a> CdcWriter<'a> {
    /// Starts with no write.
    ///
    /// # Errors
    /// [`CdcError`]: there is no room for the count.
    pub fn new(octets: &'a mut [u8]) -> Result<Self, CdcError> {
        let have = octets.len();
        octets
            .get_mut(..COUNT_LEN)
            .ok_or(CdcError::NoRoom { need: COUNT_LEN, have })?
            .fill(0);
        Ok(CdcWriter {
            octets,
            len: COUNT_LEN,
            count: 0,
        })
    }

    /// Appends one write; on an error the list is as before.
    ///
    /// # Errors
    /// [`CdcError`]: there is no room for it.
    pub fn push(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), CdcError> {
        let need = self.len + HEADER_LEN + value.len();
        let have = self.octets.len();
        let no_room = CdcError::NoRoom { need, have };
        let size = u32::try_from(value.len()).map_err(|_| no_room)?;
        let target = self.octets.get_mut(self.len..need).ok_or(no_room)?;
        target[..2].copy_from_slice(&index.to_le_bytes());
        target[2] = sub;
        target[3..HEADER_LEN].copy_from_slice(&size.to_le_bytes());
        target[HEADER_LEN..].copy_from_slice(value);
        self.len = need;
        self.count += 1;
        self.octets[..COUNT_LEN].copy_from_slice(&self.count.to_le_bytes());
        Ok(())
    }

    /// The finished list.
    pub fn finish(self) -> &'a [u8] {
        &self.octets[..self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;
    use std::vec::Vec;

    /// Written by hand from the layout: 0x1006 = 1000, 0x1F98/4 = 36.
    const TWO_WRITES: [u8; 24] = [
        2, 0, 0, 0, // count
        0x06, 0x10, 0x00, 4, 0, 0, 0, 0xE8, 0x03, 0x00, 0x00, // 0x1006
        0x98, 0x1F, 0x04, 2, 0, 0, 0, 0x24, 0x00, // 0x1F98/4
    ];

    #[test]
    fn reads_fixed_octets() {
        let writes: Vec<_> = CdcReader::new(&TWO_WRITES).unwrap().collect();
        assert_eq!(
            writes,
            [
                Ok(CdcWrite {
                    index: 0x1006,
                    sub: 0,
                    value: &[0xE8, 3, 0, 0]
                }),
                Ok(CdcWrite {
                    index: 0x1F98,
                    sub: 4,
                    value: &[0x24, 0]
                }),
            ]
        );
    }

    #[test]
    fn writes_fixed_octets_into_a_dirty_buffer() {
        let mut buffer = [0xA5; 32];
        let mut writer = CdcWriter::new(&mut buffer).unwrap();
        writer.push(0x1006, 0, &1000_u32.to_le_bytes()).unwrap();
        writer.push(0x1F98, 4, &36_u16.to_le_bytes()).unwrap();
        assert_eq!(
            writer.push(0x1F98, 5, &36_u16.to_le_bytes()),
            Err(CdcError::NoRoom { need: 33, have: 32 })
        );
        assert_eq!(writer.finish(), TWO_WRITES);
    }

    #[test]
    fn errors_tell_the_place() {
        let text = |octets: &[u8]| match CdcReader::new(octets) {
            Err(error) => error.to_string(),
            Ok(reader) => reader.last().unwrap().unwrap_err().to_string(),
        };
        assert_eq!(
            text(&TWO_WRITES[..3]),
            "offset 0: expected the number of writes of 4 octets, 3 are left"
        );
        assert_eq!(
            text(&TWO_WRITES[..20]),
            "offset 15: expected index, sub-index and size of a write of 7 octets, 5 are left"
        );
        assert_eq!(
            text(&TWO_WRITES[..23]),
            "offset 22: expected a value of 2 octets, 1 are left"
        );
        let mut longer = TWO_WRITES.to_vec();
        longer.push(0);
        assert_eq!(
            text(&longer),
            "offset 24: expected the end after the last counted write, 1 octets are left"
        );
    }

    #[test]
    fn every_truncation_is_an_error() {
        for len in 0..TWO_WRITES.len() {
            let read: Result<Vec<_>, _> = CdcReader::new(&TWO_WRITES[..len]).and_then(Iterator::collect);
            assert!(
                matches!(read, Err(CdcError::Truncated { .. })),
                "{len} octets gave {read:?}"
            );
        }
    }

    proptest! {
        #[test]
        fn arbitrary_octets_end_without_panic(octets in proptest::collection::vec(any::<u8>(), 0..200)) {
            if let Ok(reader) = CdcReader::new(&octets) {
                prop_assert!(reader.count() <= octets.len());
            }
        }

        #[test]
        fn what_was_written_is_read(writes in proptest::collection::vec(
            (any::<u16>(), any::<u8>(), proptest::collection::vec(any::<u8>(), 0..20)), 0..10,
        )) {
            let mut buffer = [0xA5; 400];
            let mut writer = CdcWriter::new(&mut buffer).unwrap();
            for (index, sub, value) in &writes {
                writer.push(*index, *sub, value).unwrap();
            }
            let read: Vec<_> = CdcReader::new(writer.finish()).unwrap()
                .map(|write| write.map(|write| (write.index, write.sub, write.value.to_vec())).unwrap())
                .collect();
            prop_assert_eq!(read, writes);
        }
    }
}
