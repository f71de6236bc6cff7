//! Command layer: what one SDO frame asks or answers.
//!
//! Fixed header of 8 octets behind the sequence header: reserved, transaction id, flags, command id, segment size u16,
//! reserved u16; then `segment size` octets. Command data that do not fit in one frame are cut into segments; the first
//! one begins with their total size u32, which counts itself.

use core::fmt;
use core::ops::Range;

use obd::AbortCode;

/// Octets of the fixed command header.
pub const HEADER_LEN: usize = 8;
/// Octets in front of the value of WriteByIndex: index u16, sub-index u8, reserved u8.
pub const ADDRESS_LEN: usize = 4;

const FLAG_RESPONSE: u8 = 0x80;
const FLAG_ABORT: u8 = 0x40;
const SEGMENTATION: u8 = 0x30;

/// Octets of the size field that only the first segment of several carries; the field counts itself.
pub const TOTAL_LEN: usize = 4;
/// Most command data this crate sends in one frame, see [`SERVICE_DATA_MAX`](super::SERVICE_DATA_MAX).
pub const SEGMENT_MAX: usize = 256;

/// Commands (DS 301 ch. 6.3.2); this crate carries out those by index and aborts all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandId {
    /// Write one object.
    WriteByIndex,
    /// Read one object.
    ReadByIndex,
    /// Write all sub-indices of an object.
    WriteAllByIndex,
    /// Read all sub-indices of an object.
    ReadAllByIndex,
    /// Write an object by its name.
    WriteByName,
    /// Read an object by its name.
    ReadByName,
    /// Write a file.
    FileWrite,
    /// Read a file.
    FileRead,
    /// Write several objects.
    WriteMultipleByIndex,
    /// Read several objects.
    ReadMultipleByIndex,
    /// Agree on the segment size.
    MaximumSegmentSize,
    /// Link a name to an index.
    LinkNameToIndex,
    /// Any other command.
    Other(u8),
}

impl From<u8> for CommandId {
    fn from(octet: u8) -> Self {
        match octet {
            0x01 => CommandId::WriteByIndex,
            0x02 => CommandId::ReadByIndex,
            0x03 => CommandId::WriteAllByIndex,
            0x04 => CommandId::ReadAllByIndex,
            0x05 => CommandId::WriteByName,
            0x06 => CommandId::ReadByName,
            0x20 => CommandId::FileWrite,
            0x21 => CommandId::FileRead,
            0x31 => CommandId::WriteMultipleByIndex,
            0x32 => CommandId::ReadMultipleByIndex,
            0x70 => CommandId::MaximumSegmentSize,
            0x71 => CommandId::LinkNameToIndex,
            other => CommandId::Other(other),
        }
    }
}

impl From<CommandId> for u8 {
    fn from(id: CommandId) -> u8 {
        match id {
            CommandId::WriteByIndex => 0x01,
            CommandId::ReadByIndex => 0x02,
            CommandId::WriteAllByIndex => 0x03,
            CommandId::ReadAllByIndex => 0x04,
            CommandId::WriteByName => 0x05,
            CommandId::ReadByName => 0x06,
            CommandId::FileWrite => 0x20,
            CommandId::FileRead => 0x21,
            CommandId::WriteMultipleByIndex => 0x31,
            CommandId::ReadMultipleByIndex => 0x32,
            CommandId::MaximumSegmentSize => 0x70,
            CommandId::LinkNameToIndex => 0x71,
            CommandId::Other(other) => other,
        }
    }
}

/// How a transfer is cut into frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Segmentation {
    /// All data are in this frame.
    Expedited,
    /// First frame of several; carries the total size.
    Initiate,
    /// A frame in between.
    Segment,
    /// The last frame.
    Complete,
}

impl Segmentation {
    const fn from_flags(flags: u8) -> Segmentation {
        match flags & SEGMENTATION {
            0x00 => Segmentation::Expedited,
            0x10 => Segmentation::Initiate,
            0x20 => Segmentation::Segment,
            _ => Segmentation::Complete,
        }
    }

    const fn flags(self) -> u8 {
        match self {
            Segmentation::Expedited => 0x00,
            Segmentation::Initiate => 0x10,
            Segmentation::Segment => 0x20,
            Segmentation::Complete => 0x30,
        }
    }
}

/// The fixed command header (DS 301 ch. 6.3.2) without the segment size, which follows from the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Chosen by the client, echoed by the server.
    pub transaction: u8,
    /// The server answers.
    pub response: bool,
    /// The data are an abort code.
    pub abort: bool,
    /// Place of this frame in the transfer.
    pub segmentation: Segmentation,
    /// What to do.
    pub id: CommandId,
}

/// Frames that command data of this length need.
pub const fn segments(len: usize) -> usize {
    if len <= SEGMENT_MAX {
        1
    } else {
        1 + (len - (SEGMENT_MAX - TOTAL_LEN)).div_ceil(SEGMENT_MAX)
    }
}

/// Segment `at` (from 0) of command data of `len` octets: its place in the transfer and the octets it carries.
pub fn segment(len: usize, at: usize) -> (Segmentation, Range<usize>) {
    let first = SEGMENT_MAX - TOTAL_LEN;
    if len <= SEGMENT_MAX {
        (Segmentation::Expedited, 0..len)
    } else if at == 0 {
        (Segmentation::Initiate, 0..first)
    } else {
        let start = (first + (at - 1) * SEGMENT_MAX).min(len);
        let end = (start + SEGMENT_MAX).min(len);
        let place = if end == len {
            Segmentation::Complete
        } else {
            Segmentation::Segment
        };
        (place, start..end)
    }
}

/// Writes the command header, the total size `len` if this is the first segment of several, and has `write` fill in
/// the `size` octets of data; returns the octets written. `None`: `out` is too short.
pub fn emit_segment(
    header: Header,
    len: usize,
    size: usize,
    out: &mut [u8],
    write: impl FnOnce(&mut [u8]),
) -> Option<usize> {
    let total = (len + TOTAL_LEN) as u32;
    let variable = match header.segmentation {
        Segmentation::Initiate => TOTAL_LEN,
        Segmentation::Expedited | Segmentation::Segment | Segmentation::Complete => 0,
    };
    let (fixed, rest) = out.split_first_chunk_mut()?;
    header.emit((variable + size) as u16, fixed);
    let rest = rest.get_mut(..variable + size)?;
    rest[..variable].copy_from_slice(&total.to_le_bytes()[..variable]);
    write(&mut rest[variable..]);
    Some(HEADER_LEN + variable + size)
}

/// Splits the data of the first segment of several into the length of all command data and those that it carries.
/// `None`: they are too short, or carry more than they announce.
pub fn split_initiate(data: &[u8]) -> Option<(usize, &[u8])> {
    let (total, data) = data.split_first_chunk::<TOTAL_LEN>()?;
    let len = (u32::from_le_bytes(*total) as usize).checked_sub(TOTAL_LEN)?;
    (data.len() <= len).then_some((len, data))
}

/// A received command with its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command<'a> {
    /// The fixed header in front of the data.
    pub header: Header,
    /// Command data of this frame.
    pub data: &'a [u8],
}

/// What stands behind a sequence header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content<'a> {
    /// No command: the frame acknowledges, opens or closes.
    Empty,
    /// A command, or an answer to one.
    Command(Command<'a>),
    /// Octets that announce more data than the frame holds.
    Malformed,
}

impl<'a> Content<'a> {
    /// Reads the octets behind the sequence header. Never panics.
    pub fn parse(octets: &'a [u8]) -> Content<'a> {
        let Some((header, rest)) = octets.split_at_checked(HEADER_LEN) else {
            return if octets.iter().all(|octet| *octet == 0) {
                Content::Empty
            } else {
                Content::Malformed
            };
        };
        if header[3] == 0 {
            return Content::Empty;
        }
        let size = u16::from_le_bytes([header[4], header[5]]) as usize;
        let Some(data) = rest.get(..size) else {
            return Content::Malformed;
        };
        let flags = header[2];
        Content::Command(Command {
            header: Header {
                transaction: header[1],
                response: flags & FLAG_RESPONSE != 0,
                abort: flags & FLAG_ABORT != 0,
                segmentation: Segmentation::from_flags(flags),
                id: CommandId::from(header[3]),
            },
            data,
        })
    }
}

impl Header {
    /// Writes the header; `size` is the number of data octets that follow in this frame.
    pub fn emit(&self, size: u16, out: &mut [u8; HEADER_LEN]) {
        let response = if self.response { FLAG_RESPONSE } else { 0 };
        let abort = if self.abort { FLAG_ABORT } else { 0 };
        let [low, high] = size.to_le_bytes();
        let flags = response | abort | self.segmentation.flags();
        *out = [0, self.transaction, flags, self.id.into(), low, high, 0, 0];
    }
}

/// Object address in front of the data of WriteByIndex and ReadByIndex. In words `0x1006` or `0x1018/1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// Index of the object.
    pub index: u16,
    /// Sub-index of the object.
    pub sub: u8,
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X}", self.index)?;
        match self.sub {
            0 => Ok(()),
            sub => write!(f, "/{sub}"),
        }
    }
}

impl Address {
    /// Splits command data into address and value; `None` when they are too short.
    pub fn split(data: &[u8]) -> Option<(Address, &[u8])> {
        let (address, value) = data.split_at_checked(ADDRESS_LEN)?;
        Some((
            Address {
                index: u16::from_le_bytes([address[0], address[1]]),
                sub: address[2],
            },
            value,
        ))
    }

    /// Writes the address.
    pub fn emit(self, out: &mut [u8; ADDRESS_LEN]) {
        let [low, high] = self.index.to_le_bytes();
        *out = [low, high, self.sub, 0];
    }
}

/// Reads the data of an abort.
pub fn abort_code(data: &[u8]) -> Option<AbortCode> {
    Some(AbortCode(u32::from_le_bytes(data.get(..4)?.try_into().ok()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captured_write_of_1006h() {
        // openpowerlink-mn-3cn-10ms.pcap, frame 1481, octets 22..38: 0x1006 = 10 000.
        let octets = [0, 3, 0, 1, 8, 0, 0, 0, 0x06, 0x10, 0, 0, 0x10, 0x27, 0, 0, 0, 0];
        let Content::Command(command) = Content::parse(&octets) else {
            panic!("no command")
        };
        let header = Header {
            transaction: 3,
            response: false,
            abort: false,
            segmentation: Segmentation::Expedited,
            id: CommandId::WriteByIndex,
        };
        assert_eq!(command.header, header);
        let (address, value) = Address::split(command.data).unwrap();
        assert_eq!(
            (address, value),
            (Address { index: 0x1006, sub: 0 }, &[0x10, 0x27, 0, 0][..])
        );
        let (mut out, mut at) = ([0xA5; HEADER_LEN], [0xA5; ADDRESS_LEN]);
        header.emit(8, &mut out);
        address.emit(&mut at);
        assert_eq!((&out[..], &at[..]), (&octets[..8], &octets[8..12]));
    }

    #[test]
    fn captured_abort() {
        // openpowerlink-mn-3cn-10ms.pcap, frame 1197, octets 22..34: answer to the write of 0x1011/1.
        let octets = [0, 0, 0xC0, 1, 4, 0, 0, 0, 0, 0, 2, 6];
        let Content::Command(command) = Content::parse(&octets) else {
            panic!("no command")
        };
        assert!(command.header.response && command.header.abort);
        assert_eq!(abort_code(command.data), Some(AbortCode::NO_OBJECT));
        for len in 1..octets.len() {
            assert_eq!(abort_code(&octets[8..len.max(8)]), None);
            let expected = if len <= 2 { Content::Empty } else { Content::Malformed };
            assert_eq!(Content::parse(&octets[..len]), expected, "{len} octets");
        }
    }

    #[test]
    fn all_command_ids_lead_there_and_back() {
        for octet in 0..=u8::MAX {
            assert_eq!(u8::from(CommandId::from(octet)), octet);
        }
    }

    #[test]
    fn segmentation_flags_lead_there_and_back() {
        for flags in [0x00, 0x10, 0x20, 0x30] {
            assert_eq!(Segmentation::from_flags(flags | 0xC0).flags(), flags);
        }
    }
}
