//! Capture files (pcap): what was on the wire, for Wireshark and for tests.
//!
//! In:  frames with their time. Out: a file with nanosecond stamps; and back from files with micro- or nanoseconds, of
//! either byte order. Not RT.

use std::fmt;
use std::io::{self, Write};

/// Magic number of a file with nanosecond stamps.
const MAGIC_NS: u32 = 0xA1B2_3C4D;
/// Magic number of a file with microsecond stamps.
const MAGIC_US: u32 = 0xA1B2_C3D4;
/// LINKTYPE_ETHERNET.
const ETHERNET: u32 = 1;
const FILE_HEADER_LEN: usize = 24;
const FRAME_HEADER_LEN: usize = 16;
/// Longest frame the header of our files announces.
const SNAP_LEN: u32 = 65_535;

/// Writes a capture file.
#[derive(Debug)]
pub struct PcapWriter<W: Write> {
    out: W,
}

impl<W: Write> PcapWriter<W> {
    /// Writes the file header.
    ///
    /// # Errors
    /// What the writer refuses.
    pub fn new(mut out: W) -> io::Result<PcapWriter<W>> {
        let mut header = [0; FILE_HEADER_LEN];
        header[0..4].copy_from_slice(&MAGIC_NS.to_le_bytes());
        header[4..6].copy_from_slice(&2u16.to_le_bytes());
        header[6..8].copy_from_slice(&4u16.to_le_bytes());
        header[16..20].copy_from_slice(&SNAP_LEN.to_le_bytes());
        header[20..24].copy_from_slice(&ETHERNET.to_le_bytes());
        out.write_all(&header)?;
        Ok(PcapWriter { out })
    }

    /// Writes one frame; `stamp_ns` counts from 1970.
    ///
    /// # Errors
    /// What the writer refuses.
    pub fn write(&mut self, stamp_ns: u64, frame: &[u8]) -> io::Result<()> {
        let too_long = |_| io::Error::new(io::ErrorKind::InvalidInput, "a frame longer than 4 GiB");
        let len = u32::try_from(frame.len()).map_err(too_long)?;
        let mut header = [0; FRAME_HEADER_LEN];
        // Seconds are 32 bits in this format, good until 2106.
        header[0..4].copy_from_slice(&((stamp_ns / 1_000_000_000) as u32).to_le_bytes());
        header[4..8].copy_from_slice(&((stamp_ns % 1_000_000_000) as u32).to_le_bytes());
        header[8..12].copy_from_slice(&len.to_le_bytes());
        header[12..16].copy_from_slice(&len.to_le_bytes());
        self.out.write_all(&header)?;
        self.out.write_all(frame)
    }

    /// Writes what is buffered and gives the writer back.
    ///
    /// # Errors
    /// What the writer refuses.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

/// One frame of a capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Captured<'a> {
    /// Time since 1970.
    pub stamp_ns: u64,
    /// The frame as captured.
    pub frame: &'a [u8],
}

/// Why a capture cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PcapError {
    /// The first four octets are no magic number of this format.
    Magic {
        /// As a little endian number.
        got: u32,
    },
    /// The frames are not Ethernet.
    LinkType {
        /// As in the file.
        got: u32,
    },
    /// The file ends within a header or a frame.
    Truncated {
        /// Offset of what is incomplete.
        offset: usize,
        /// Octets it needs.
        need: usize,
        /// Octets that are left.
        got: usize,
    },
}

impl fmt::Display for PcapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            PcapError::Magic { got } => write!(f, "magic number {got:#010x} is not that of a pcap file"),
            PcapError::LinkType { got } => write!(f, "link type {got}, expected {ETHERNET} (Ethernet)"),
            PcapError::Truncated { offset, need, got } => {
                write!(f, "offset {offset}: expected {need} octets, {got} are left")
            }
        }
    }
}

impl std::error::Error for PcapError {}

/// Reads a capture from memory; yields its frames and at most one error.
#[derive(Clone, Debug)]
pub struct PcapReader<'a> {
    octets: &'a [u8],
    offset: usize,
    big_endian: bool,
    nanoseconds: bool,
    done: bool,
}

impl<'a> PcapReader<'a> {
    /// Reads the file header.
    ///
    /// # Errors
    /// [`PcapError`]: it is not a capture of Ethernet frames.
    pub fn new(octets: &'a [u8]) -> Result<PcapReader<'a>, PcapError> {
        let mut reader = PcapReader {
            octets,
            offset: 0,
            big_endian: false,
            nanoseconds: false,
            done: false,
        };
        let header = reader.cut(FILE_HEADER_LEN)?;
        let magic = u32::from_le_bytes([header[0], header[1], header[2], header[3]]);
        (reader.big_endian, reader.nanoseconds) = match magic {
            MAGIC_US => (false, false),
            MAGIC_NS => (false, true),
            _ if magic.swap_bytes() == MAGIC_US => (true, false),
            _ if magic.swap_bytes() == MAGIC_NS => (true, true),
            _ => return Err(PcapError::Magic { got: magic }),
        };
        match reader.number(header, 20) {
            ETHERNET => Ok(reader),
            got => Err(PcapError::LinkType { got }),
        }
    }

    fn cut(&mut self, need: usize) -> Result<&'a [u8], PcapError> {
        let rest = &self.octets[self.offset..];
        let taken = rest.get(..need).ok_or(PcapError::Truncated {
            offset: self.offset,
            need,
            got: rest.len(),
        })?;
        self.offset += need;
        Ok(taken)
    }

    fn number(&self, octets: &[u8], at: usize) -> u32 {
        let octets = [octets[at], octets[at + 1], octets[at + 2], octets[at + 3]];
        if self.big_endian {
            u32::from_be_bytes(octets)
        } else {
            u32::from_le_bytes(octets)
        }
    }

    fn frame(&mut self) -> Result<Captured<'a>, PcapError> {
        let header = self.cut(FRAME_HEADER_LEN)?;
        let fraction = u64::from(self.number(header, 4)) * if self.nanoseconds { 1 } else { 1000 };
        let stamp_ns = u64::from(self.number(header, 0)) * 1_000_000_000 + fraction;
        let frame = self.cut(self.number(header, 8) as usize)?;
        Ok(Captured { stamp_ns, frame })
    }
}

impl<'a> Iterator for PcapReader<'a> {
    type Item = Result<Captured<'a>, PcapError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done || self.offset == self.octets.len() {
            return None;
        }
        let frame = self.frame();
        self.done = frame.is_err();
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn octets_of_a_file_as_the_format_says() {
        let mut writer = PcapWriter::new(Vec::new()).unwrap();
        writer
            .write(0x0102_0304 * 1_000_000_000 + 0x0A0B_0C0D, &[0xEE, 0xFF])
            .unwrap();
        let file = writer.finish().unwrap();
        let expected = [
            0x4D, 0x3C, 0xB2, 0xA1, 2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0, 0, 1, 0, 0, 0, // file
            4, 3, 2, 1, 0x0D, 0x0C, 0x0B, 0x0A, 2, 0, 0, 0, 2, 0, 0, 0, 0xEE, 0xFF,
        ];
        assert_eq!(file, expected);
    }

    #[test]
    fn microseconds_of_either_byte_order_are_read() {
        let mut little = Vec::new();
        let mut big = Vec::new();
        for (value, octets) in [
            (MAGIC_US, 4),
            (0x0002_0004, 4),
            (0, 4),
            (0, 4),
            (99, 4),
            (1, 4),
            (7, 4),
            (8, 4),
            (1, 4),
            (1, 4),
        ] {
            assert_eq!(octets, 4);
            little.extend(u32::to_le_bytes(value));
            big.extend(u32::to_be_bytes(value));
        }
        for mut file in [little, big] {
            file.push(0x55);
            let frames: Vec<_> = PcapReader::new(&file).unwrap().collect();
            assert_eq!(
                frames,
                [Ok(Captured {
                    stamp_ns: 7_000_008_000,
                    frame: &[0x55]
                })]
            );
            for cut in 25..file.len() {
                let last = PcapReader::new(&file[..cut]).unwrap().last().unwrap();
                assert!(matches!(last, Err(PcapError::Truncated { .. })), "{cut}: {last:?}");
            }
            for cut in 0..24 {
                assert!(PcapReader::new(&file[..cut]).is_err());
            }
        }
    }

    #[test]
    fn other_files_are_refused() {
        let got = u32::from_le_bytes(*b"\x0a\x0d\x0d\x0a");
        let mut file = [0; 24];
        file[..4].copy_from_slice(b"\x0a\x0d\x0d\x0a");
        assert_eq!(PcapReader::new(&file).unwrap_err(), PcapError::Magic { got });
        file[..4].copy_from_slice(&MAGIC_NS.to_le_bytes());
        file[20] = 113;
        assert_eq!(PcapReader::new(&file).unwrap_err(), PcapError::LinkType { got: 113 });
    }

    proptest! {
        #[test]
        fn any_octets_never_panic_and_end(mut octets in proptest::collection::vec(any::<u8>(), 0..300), known in any::<bool>()) {
            if known && octets.len() >= 24 {
                octets[..4].copy_from_slice(&MAGIC_NS.to_le_bytes());
                octets[20..24].copy_from_slice(&[1, 0, 0, 0]);
            }
            if let Ok(reader) = PcapReader::new(&octets) {
                prop_assert!(reader.count() <= 300);
            }
        }
    }
}
