//! Frames of Ethernet POWERLINK V2 as plain structs.
//!
//! In:  untrusted octets of one Ethernet frame, padded or not. Out: a [`Frame`], or why it is none.
//! And back: [`Frame::emit`] writes a whole frame into a dirty buffer, zeros in all reserved and padding octets.
//! RT: no allocation, no locks, bounded. Parsing never panics; unknown values of an octet are kept.
//!
//! Offsets count from the first octet of the Ethernet header; numbers are little endian, only the EtherType is not.

mod addresses;
mod asnd;
mod chaining;
mod ident;
mod poll;
mod status;
mod sync;

pub use asnd::{Asnd, COMMAND_DATA_LEN, NmtCommandFrame, NmtRequestFrame, Service, ServiceId};
pub use chaining::{SYNC_RESPONSE_LEN, SyncRequest, SyncResponse};
pub use ident::{IDENT_RESPONSE_LEN, IdentResponse};
pub use poll::{POLL_HEADER_LEN, Preq, Pres};
pub use status::{
    ERROR_ENTRIES_MAX, ERROR_ENTRY_LEN, ErrorEntries, ErrorEntry, STATUS_RESPONSE_LEN_MIN, StatusResponse,
};
pub use sync::{NetTime, RequestedService, SOA_LEN, SOC_LEN, Soa, Soc};

/// EtherType of Ethernet POWERLINK.
pub const ETHER_TYPE: u16 = 0x88AB;
/// Shortest Ethernet frame without FCS; shorter ones are padded with zeros.
pub const FRAME_LEN_MIN: usize = 60;
/// Longest Ethernet frame without FCS.
pub const FRAME_LEN_MAX: usize = 1514;
/// Most process data a PReq or PRes can carry, in octets.
pub const PAYLOAD_MAX: usize = 1490;
/// Smallest payload limit of PReq and PRes (objects 0x1F98/4, /5): with it the frame is an Ethernet minimum frame.
pub const PAYLOAD_LIMIT_MIN: usize = 36;
/// Octets of the Ethernet header and the three that all POWERLINK frames share.
pub const HEADER_LEN: usize = 17;
/// Protocol version sent in SoA and IdentResponse (object 0x1F83).
pub const EPL_VERSION: u8 = 0x20;

/// An Ethernet address.
pub type Mac = [u8; 6];

/// The multicast addresses of POWERLINK.
pub mod multicast {
    use super::Mac;
    /// Destination of every SoC.
    pub const SOC: Mac = [0x01, 0x11, 0x1E, 0x00, 0x00, 0x01];
    /// Destination of every PRes.
    pub const PRES: Mac = [0x01, 0x11, 0x1E, 0x00, 0x00, 0x02];
    /// Destination of every SoA.
    pub const SOA: Mac = [0x01, 0x11, 0x1E, 0x00, 0x00, 0x03];
    /// Destination of every ASnd.
    pub const ASND: Mac = [0x01, 0x11, 0x1E, 0x00, 0x00, 0x04];
    /// Active managing node indication.
    pub const AMNI: Mac = [0x01, 0x11, 0x1E, 0x00, 0x00, 0x05];
}

/// Node ids with a meaning of their own.
pub mod node {
    /// Addresses no node.
    pub const INVALID: u8 = 0;
    /// Highest id of a controlled node; 1 is the lowest.
    pub const CN_MAX: u8 = 239;
    /// The managing node.
    pub const MN: u8 = 240;
    /// Highest id of a redundant managing node; 241 is the lowest.
    pub const MN_MAX: u8 = 250;
    /// A diagnostic device.
    pub const DIAGNOSTIC: u8 = 253;
    /// A router to other networks.
    pub const ROUTER: u8 = 254;
    /// Addresses all nodes at once.
    pub const BROADCAST: u8 = 255;
}

/// Flag bits of the flag octets (see the field they are read into).
pub(crate) mod flag {
    pub(crate) const RD: u8 = 0x01;
    pub(crate) const ER: u8 = 0x02;
    pub(crate) const EA: u8 = 0x04;
    pub(crate) const EC: u8 = 0x08;
    pub(crate) const EN: u8 = 0x10;
    pub(crate) const MS: u8 = 0x20;
    pub(crate) const PS: u8 = 0x40;
    pub(crate) const MC: u8 = 0x80;
    pub(crate) const MR: u8 = 0x01;

    /// The bit where the flag is set, else nothing.
    pub(super) fn bit(set: bool, bit: u8) -> u8 {
        if set { bit } else { 0 }
    }
}

/// MessageType values. Bit 7 of the octet is no part of the type.
pub mod message {
    /// Start of cycle.
    pub const SOC: u8 = 0x01;
    /// PReq: poll request.
    pub const PREQ: u8 = 0x03;
    /// PRes: poll response.
    pub const PRES: u8 = 0x04;
    /// Start of asynchronous phase.
    pub const SOA: u8 = 0x05;
    /// ASnd: asynchronous send.
    pub const ASND: u8 = 0x06;
    /// Active managing node indication (redundancy).
    pub const AMNI: u8 = 0x07;
    /// Asynchronous invite (multiple ASnd).
    pub const AINV: u8 = 0x0D;
}

/// Why octets are no POWERLINK frame, or a frame cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireError {
    /// The frame ends before a field that must be there.
    TooShort {
        /// Octets the frame must have at least.
        need: usize,
        /// Octets it has.
        got: usize,
    },
    /// The frame is longer than Ethernet allows.
    TooLong {
        /// Octets it has.
        got: usize,
    },
    /// EtherType other than 0x88AB.
    EtherType {
        /// What stands in place of 0x88AB.
        got: u16,
    },
    /// A message type the standard does not define.
    MessageType {
        /// The octet without bit 7.
        got: u8,
    },
    /// The size field of a PReq or PRes promises more than the frame holds, or more than the standard allows.
    PayloadSize {
        /// Value of the size field.
        size: usize,
        /// Octets after the poll header, at most 1490.
        room: usize,
    },
    /// No node of this id sends frames of this type.
    Source {
        /// The message type.
        message_type: u8,
        /// Node id of the sender.
        got: u8,
    },
    /// No frame of this type goes to a node of this id.
    Destination {
        /// The message type.
        message_type: u8,
        /// Node id of the receiver.
        got: u8,
    },
    /// Emitting: the buffer or the frame is too small for what shall be sent.
    NoRoom {
        /// Octets that it needs.
        need: usize,
        /// Octets there are.
        got: usize,
    },
}

impl core::fmt::Display for WireError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            WireError::TooShort { need, got } => write!(f, "frame has {got} octets, needs {need}"),
            WireError::TooLong { got } => write!(f, "frame has {got} octets, Ethernet allows {FRAME_LEN_MAX}"),
            WireError::EtherType { got } => write!(f, "EtherType is {got:#06x}, expected {ETHER_TYPE:#06x}"),
            WireError::MessageType { got } => write!(f, "unknown message type {got:#04x}"),
            WireError::PayloadSize { size, room } => {
                write!(f, "size field says {size} octets, there is room for {room}")
            }
            WireError::Source { message_type, got } => {
                write!(f, "node {got} cannot be the sender of message type {message_type:#04x}")
            }
            WireError::Destination { message_type, got } => {
                write!(f, "message type {message_type:#04x} does not go to node {got}")
            }
            WireError::NoRoom { need, got } => write!(f, "{need} octets do not fit into {got}"),
        }
    }
}

impl core::error::Error for WireError {}

/// Addresses of a frame: the first 17 octets without EtherType and MessageType.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Destination MAC: multicast or the node's own.
    pub destination: Mac,
    /// MAC of the sender.
    pub source: Mac,
    /// Destination node id; filter on this, not on the MAC.
    pub destination_node: u8,
    /// Node id of the sender.
    pub source_node: u8,
}

impl Header {
    /// Reads the addresses of an untrusted frame; never panics.
    ///
    /// # Errors
    /// [`WireError::TooShort`], [`WireError::EtherType`].
    pub fn parse(frame: &[u8]) -> Result<Header, WireError> {
        check_len(frame, HEADER_LEN)?;
        if frame.len() > FRAME_LEN_MAX {
            return Err(WireError::TooLong { got: frame.len() });
        }
        let ether_type = u16::from_be_bytes([frame[12], frame[13]]);
        if ether_type != ETHER_TYPE {
            return Err(WireError::EtherType { got: ether_type });
        }
        Ok(Header {
            destination: array(frame, 0),
            source: array(frame, 6),
            destination_node: frame[15],
            source_node: frame[16],
        })
    }

    /// Addresses of a frame from `source_node` to all nodes.
    pub fn multicast(destination: Mac, source: Mac, source_node: u8) -> Header {
        Header {
            destination,
            source,
            destination_node: node::BROADCAST,
            source_node,
        }
    }

    /// A managing node has sent it, active or redundant.
    pub fn is_from_managing_node(&self) -> bool {
        (node::MN..=node::MN_MAX).contains(&self.source_node)
    }

    fn emit(&self, message_type: u8, frame: &mut [u8]) {
        frame[0..6].copy_from_slice(&self.destination);
        frame[6..12].copy_from_slice(&self.source);
        frame[12..14].copy_from_slice(&ETHER_TYPE.to_be_bytes());
        frame[14] = message_type;
        frame[15] = self.destination_node;
        frame[16] = self.source_node;
    }
}

/// Reads an untrusted frame as a node has to: one that the standard does not let its sender send to its receiver is not read
/// further. Never panics.
///
/// # Errors
/// [`WireError`]: why the frame is left alone.
pub fn accept(frame: &[u8]) -> Result<(Header, Frame<'_>), WireError> {
    let header = Header::parse(frame)?;
    let parsed = Frame::parse(frame)?;
    addresses::check_addresses(parsed.message_type(), header.source_node, header.destination_node)?;
    Ok((header, parsed))
}

/// What a frame says, without its addresses (see [`Header`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame<'a> {
    /// Start of cycle.
    Soc(Soc),
    /// PReq: poll request.
    Preq(Preq<'a>),
    /// PRes: poll response.
    Pres(Pres<'a>),
    /// Start of asynchronous phase.
    Soa(Soa),
    /// ASnd: asynchronous send.
    Asnd(Asnd<'a>),
    /// Active managing node indication; recognised only, the octets after the header are kept.
    Amni(&'a [u8]),
    /// Asynchronous invite; recognised only, the octets after the header are kept.
    Ainv(&'a [u8]),
}

impl<'a> Frame<'a> {
    /// Reads an untrusted frame; never panics.
    ///
    /// # Errors
    /// [`WireError`]: why the frame cannot be read.
    pub fn parse(frame: &'a [u8]) -> Result<Frame<'a>, WireError> {
        Header::parse(frame)?;
        match frame[14] & 0x7F {
            message::SOC => Soc::parse(frame).map(Frame::Soc),
            message::PREQ => Preq::parse(frame).map(Frame::Preq),
            message::PRES => Pres::parse(frame).map(Frame::Pres),
            message::SOA => Soa::parse(frame).map(Frame::Soa),
            message::ASND => Asnd::parse(frame).map(Frame::Asnd),
            message::AMNI => Ok(Frame::Amni(&frame[HEADER_LEN..])),
            message::AINV => Ok(Frame::Ainv(&frame[HEADER_LEN..])),
            got => Err(WireError::MessageType { got }),
        }
    }

    /// The MessageType octet.
    pub fn message_type(&self) -> u8 {
        match self {
            Frame::Soc(_) => message::SOC,
            Frame::Preq(_) => message::PREQ,
            Frame::Pres(_) => message::PRES,
            Frame::Soa(_) => message::SOA,
            Frame::Asnd(_) => message::ASND,
            Frame::Amni(_) => message::AMNI,
            Frame::Ainv(_) => message::AINV,
        }
    }

    /// Writes the whole frame into the start of `buffer`, padded to at least 60 octets, and returns its length.
    /// PReq and PRes that must be as long as a payload limit: see [`Preq::emit`] and [`Pres::emit`].
    ///
    /// # Errors
    /// [`WireError::NoRoom`] in a buffer that is too short, [`WireError::TooLong`] for data that no frame holds.
    pub fn emit(&self, header: &Header, buffer: &mut [u8]) -> Result<usize, WireError> {
        match self {
            Frame::Soc(soc) => soc.emit(header, buffer),
            Frame::Preq(preq) => preq.emit(header, 0, buffer),
            Frame::Pres(pres) => pres.emit(header, 0, buffer),
            Frame::Soa(soa) => soa.emit(header, buffer),
            Frame::Asnd(asnd) => asnd.emit(header, buffer),
            Frame::Amni(data) | Frame::Ainv(data) => {
                let frame = start(header, self.message_type(), HEADER_LEN + data.len(), buffer)?;
                frame[HEADER_LEN..HEADER_LEN + data.len()].copy_from_slice(data);
                Ok(frame.len())
            }
        }
    }
}

/// RS and PR: how many asynchronous requests a node has queued, and the priority of the highest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Requests {
    /// RS: number of queued requests; 7 means 7 or more.
    pub count: u8,
    /// PR: 7 is an NMT request, anything else is generic (3 is what is seen on the wire).
    pub priority: u8,
}

impl Requests {
    /// PR of NMT requests.
    pub const PRIORITY_NMT: u8 = 7;
    /// PR of SDO and other generic requests.
    pub const PRIORITY_GENERIC: u8 = 3;

    fn from_octet(octet: u8) -> Requests {
        Requests {
            count: octet & 0x07,
            priority: (octet >> 3) & 0x07,
        }
    }

    fn to_octet(self) -> u8 {
        self.count.min(7) | ((self.priority & 0x07) << 3)
    }
}

/// Checks the length of an untrusted frame.
fn check_len(frame: &[u8], need: usize) -> Result<(), WireError> {
    if frame.len() < need {
        Err(WireError::TooShort { need, got: frame.len() })
    } else {
        Ok(())
    }
}

/// Starts a frame of `len` octets, at least 60: header written, everything after it zero.
fn start<'b>(header: &Header, message_type: u8, len: usize, buffer: &'b mut [u8]) -> Result<&'b mut [u8], WireError> {
    let len = len.max(FRAME_LEN_MIN);
    if len > FRAME_LEN_MAX {
        return Err(WireError::NoRoom {
            need: len,
            got: FRAME_LEN_MAX,
        });
    }
    let got = buffer.len();
    let frame = buffer.get_mut(..len).ok_or(WireError::NoRoom { need: len, got })?;
    frame[HEADER_LEN..].fill(0);
    header.emit(message_type, frame);
    Ok(frame)
}

/// `N` octets at `at`; the caller has checked the length.
fn array<const N: usize>(frame: &[u8], at: usize) -> [u8; N] {
    let mut octets = [0; N];
    octets.copy_from_slice(&frame[at..at + N]);
    octets
}

fn u16_at(frame: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(array(frame, at))
}

fn u32_at(frame: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(frame, at))
}

fn put<const N: usize>(frame: &mut [u8], at: usize, octets: [u8; N]) {
    frame[at..at + N].copy_from_slice(&octets);
}

#[cfg(test)]
mod tests;
