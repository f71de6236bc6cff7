//! Capture files: what was on the wire, for Wireshark and for tests.
//!
//! In:  frames with their time. Out: a pcap file with nanosecond stamps; and back from pcap files with micro- or nanoseconds and from
//! pcapng files, of either byte order. Not RT.

use std::fmt;
use std::io::{self, Write};
use std::vec::Vec;

/// Magic number of a file with nanosecond stamps.
const MAGIC_NS: u32 = 0xA1B2_3C4D;
/// Magic number of a file with microsecond stamps.
const MAGIC_US: u32 = 0xA1B2_C3D4;
/// First block of each section of a pcapng file; it reads the same in either byte order.
const SECTION: u32 = 0x0A0D_0D0A;
/// Byte order of a section.
const BYTE_ORDER: u32 = 0x1A2B_3C4D;
/// Blocks of a pcapng file: an interface, a frame without a stamp, a frame.
const INTERFACE: u32 = 1;
const SIMPLE: u32 = 3;
const ENHANCED: u32 = 6;
/// Type and length before a block, length behind it.
const BLOCK_LEN_MIN: u32 = 12;
/// Options of an interface: resolution of its stamps, s to add to them.
const RESOLUTION: u16 = 9;
const OFFSET: u16 = 14;
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
    /// A block of a pcapng file is none.
    Block {
        /// Its offset.
        offset: usize,
    },
}

impl fmt::Display for PcapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            PcapError::Magic { got } => write!(
                f,
                "magic number {got:#010x} is neither that of a pcap file nor of a pcapng file"
            ),
            PcapError::LinkType { got } => write!(f, "link type {got}, expected {ETHERNET} (Ethernet)"),
            PcapError::Block { offset } => write!(f, "offset {offset}: no block of a pcapng file"),
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
    /// Of a pcapng file; `None`: a pcap file.
    interfaces: Option<Vec<Interface>>,
    done: bool,
}

/// An interface of a section of a pcapng file.
#[derive(Clone, Copy, Debug)]
struct Interface {
    link_type: u16,
    /// Octets of a frame that are kept at the most; 0: all.
    kept: u32,
    /// Parts of a second in which stamps count.
    per_s: u64,
    /// s to add to them.
    offset_s: i64,
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
            interfaces: None,
            done: false,
        };
        if octets.get(..4) == Some(&SECTION.to_le_bytes()) {
            reader.interfaces = Some(Vec::new());
            reader.section()?;
            return Ok(reader);
        }
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

    /// The head of a section, whose interfaces are its own.
    fn section(&mut self) -> Result<(), PcapError> {
        let offset = self.offset;
        let head = self.cut(12)?;
        self.big_endian = head[8..12] == BYTE_ORDER.to_be_bytes();
        if self.number(head, 8) != BYTE_ORDER {
            return Err(PcapError::Block { offset });
        }
        let length = self.number(head, 4);
        if length < BLOCK_LEN_MIN + 16 || !length.is_multiple_of(4) {
            return Err(PcapError::Block { offset });
        }
        self.cut(length as usize - 12)?;
        self.interfaces = Some(Vec::new());
        Ok(())
    }

    fn short(&self, octets: &[u8], at: usize) -> u16 {
        let octets = [octets[at], octets[at + 1]];
        if self.big_endian {
            u16::from_be_bytes(octets)
        } else {
            u16::from_le_bytes(octets)
        }
    }

    /// An interface; `None`: its block is too short.
    fn interface(&self, body: &[u8]) -> Option<Interface> {
        let fixed = body.get(..8)?;
        let mut interface = Interface {
            link_type: self.short(fixed, 0),
            kept: self.number(fixed, 4),
            per_s: 1_000_000,
            offset_s: 0,
        };
        let mut rest = &body[8..];
        while let Some(head) = rest.get(..4) {
            let (code, length) = (self.short(head, 0), usize::from(self.short(head, 2)));
            let value = rest.get(4..4 + length)?;
            match (code, value) {
                (0, _) => break,
                (RESOLUTION, [exponent]) => {
                    let (base, exponent) = if exponent & 0x80 == 0 {
                        (10_u64, *exponent)
                    } else {
                        (2, exponent & 0x7F)
                    };
                    // What no number holds is no resolution.
                    interface.per_s = base.checked_pow(exponent.into())?;
                }
                (OFFSET, &[a, b, c, d, e, g, h, i]) => {
                    let octets = [a, b, c, d, e, g, h, i];
                    interface.offset_s = match self.big_endian {
                        true => i64::from_be_bytes(octets),
                        false => i64::from_le_bytes(octets),
                    };
                }
                _ => {}
            }
            rest = rest.get(4 + length.next_multiple_of(4)..).unwrap_or_default();
        }
        Some(interface)
    }

    /// The next frame of a pcapng file; `None`: no further one.
    fn block(&mut self) -> Result<Option<Captured<'a>>, PcapError> {
        while self.offset < self.octets.len() {
            let offset = self.offset;
            let wrong = PcapError::Block { offset };
            if self.octets[offset..].starts_with(&SECTION.to_le_bytes()) {
                self.section()?;
                continue;
            }
            let head = self.cut(8)?;
            let (kind, length) = (self.number(head, 0), self.number(head, 4));
            if length < BLOCK_LEN_MIN || !length.is_multiple_of(4) {
                return Err(wrong);
            }
            let block = self.cut(length as usize - 8)?;
            let body = &block[..block.len() - 4];
            let of = |number: u32| {
                let interfaces = self.interfaces.as_deref().unwrap_or_default();
                let interface = interfaces.get(number as usize).ok_or(wrong)?;
                match u32::from(interface.link_type) {
                    ETHERNET => Ok(*interface),
                    got => Err(PcapError::LinkType { got }),
                }
            };
            match kind {
                INTERFACE => {
                    let interface = self.interface(body).ok_or(wrong)?;
                    self.interfaces.get_or_insert_default().push(interface);
                }
                ENHANCED => {
                    let fixed = body.get(..20).ok_or(wrong)?;
                    let interface = of(self.number(fixed, 0))?;
                    let stamp = u64::from(self.number(fixed, 4)) << 32 | u64::from(self.number(fixed, 8));
                    let frame = body[20..].get(..self.number(fixed, 12) as usize).ok_or(wrong)?;
                    let stamp_ns = interface.stamp_ns(stamp);
                    return Ok(Some(Captured { stamp_ns, frame }));
                }
                SIMPLE => {
                    let interface = of(0)?;
                    let whole = body.get(..4).map(|length| self.number(length, 0)).ok_or(wrong)?;
                    let kept = if interface.kept == 0 {
                        whole
                    } else {
                        whole.min(interface.kept)
                    };
                    let frame = body[4..].get(..kept as usize).ok_or(wrong)?;
                    return Ok(Some(Captured { stamp_ns: 0, frame }));
                }
                _ => {}
            }
        }
        Ok(None)
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
        let frame = match self.interfaces {
            None => self.frame(),
            Some(_) => self.block().transpose()?,
        };
        self.done = frame.is_err();
        Some(frame)
    }
}

impl Interface {
    /// Time since 1970 of a stamp.
    fn stamp_ns(&self, stamp: u64) -> u64 {
        let ns = u128::from(stamp) * 1_000_000_000 / u128::from(self.per_s);
        let ns = i128::try_from(ns).unwrap_or(i128::MAX);
        let whole = ns.saturating_add(i128::from(self.offset_s) * 1_000_000_000);
        u64::try_from(whole.max(0)).unwrap_or(u64::MAX)
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
        let mut file = [0; 24];
        file[..4].copy_from_slice(b"\x0a\x0d\x0d\x0b");
        let got = 0x0B0D_0D0A;
        assert_eq!(PcapReader::new(&file).unwrap_err(), PcapError::Magic { got });
        file[..4].copy_from_slice(&MAGIC_NS.to_le_bytes());
        file[20] = 113;
        assert_eq!(PcapReader::new(&file).unwrap_err(), PcapError::LinkType { got: 113 });
    }

    /// A pcapng file: a section, two interfaces with stamps of their own, frames of either kind, a block that nobody knows.
    fn next_generation(big_endian: bool) -> Vec<u8> {
        let long = |value: u32| {
            if big_endian {
                value.to_be_bytes()
            } else {
                value.to_le_bytes()
            }
        };
        let short = |value: u16| {
            if big_endian {
                value.to_be_bytes()
            } else {
                value.to_le_bytes()
            }
        };
        let block = |kind: u32, body: &[u8]| {
            let mut octets = Vec::new();
            let padded = body.len().next_multiple_of(4);
            octets.extend(long(kind));
            octets.extend(long(12 + padded as u32));
            octets.extend(body);
            octets.resize(8 + padded, 0);
            octets.extend(long(12 + padded as u32));
            octets
        };
        let interface = |options: &[u8]| {
            let mut body = Vec::new();
            body.extend(short(1));
            body.extend(short(0));
            body.extend(long(2));
            body.extend(options);
            block(INTERFACE, &body)
        };
        let frame = |number: u32, stamp: u64, octets: &[u8]| {
            let mut body = Vec::new();
            for value in [number, (stamp >> 32) as u32, stamp as u32, octets.len() as u32, 99] {
                body.extend(long(value));
            }
            body.extend(octets);
            block(ENHANCED, &body)
        };
        let mut section = Vec::new();
        section.extend(long(BYTE_ORDER));
        section.extend(short(1));
        section.extend(short(0));
        section.extend([0xFF; 8]);
        let mut nanoseconds = Vec::new();
        nanoseconds.extend(short(RESOLUTION));
        nanoseconds.extend(short(1));
        nanoseconds.extend([9, 0, 0, 0]);
        nanoseconds.extend(long(0));
        let simple = [&long(3)[..], &[7, 8]].concat();
        [
            block(SECTION, &section),
            interface(&[]),
            interface(&nanoseconds),
            block(0x0BAD, &[1, 2, 3]),
            frame(1, 7_000_000_123, &[0x55]),
            frame(0, 8_000_001, &[0x66, 0x77, 0x88]),
            block(SIMPLE, &simple),
        ]
        .concat()
    }

    #[test]
    fn pcapng_of_either_byte_order_is_read() {
        for big_endian in [false, true] {
            let file = next_generation(big_endian);
            let frames: Vec<_> = PcapReader::new(&file).unwrap().collect::<Result<_, _>>().unwrap();
            let expected: [(u64, &[u8]); 3] = [
                (7_000_000_123, &[0x55]),
                (8_000_001_000, &[0x66, 0x77, 0x88]),
                // Two octets are kept of each frame.
                (0, &[7, 8]),
            ];
            let expected = expected.map(|(stamp_ns, frame)| Captured { stamp_ns, frame });
            assert_eq!(frames, expected, "{big_endian}");
            // Sections follow each other, each with interfaces of its own.
            let twice = [&file[..], &next_generation(!big_endian)].concat();
            assert_eq!(PcapReader::new(&twice).unwrap().filter(Result::is_ok).count(), 6);
            for cut in 0..file.len() {
                let frames = PcapReader::new(&file[..cut]).map(|reader| reader.filter(Result::is_ok).count());
                assert!(frames.is_ok_and(|frames| frames < 3) || cut < 28, "{cut}");
            }
        }
    }

    proptest! {
        #[test]
        fn any_change_of_a_pcapng_file_ends(at in 0_usize..200, octet in any::<u8>(), big_endian in any::<bool>()) {
            let mut file = next_generation(big_endian);
            let at = at % file.len();
            file[at] = octet;
            if let Ok(reader) = PcapReader::new(&file) {
                prop_assert!(reader.count() <= file.len());
            }
        }

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
