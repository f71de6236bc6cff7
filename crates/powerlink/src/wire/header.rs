//! What all frames share: lengths, addresses, the header, and reading and writing numbers in them.

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
/// Octets of a SoA with its SyncRequest area, before padding.
pub const SOA_LEN: usize = 54;
/// Protocol version sent in SoA and IdentResponse (object 0x1F83).
pub const EPL_VERSION: u8 = 0x20;

/// An Ethernet address.
pub type Mac = [u8; 6];

/// The multicast addresses of POWERLINK (DS 301 ch. 4.6).
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
pub(super) mod flag {
    pub(in crate::wire) const RD: u8 = 0x01;
    pub(in crate::wire) const ER: u8 = 0x02;
    pub(in crate::wire) const EA: u8 = 0x04;
    pub(in crate::wire) const EC: u8 = 0x08;
    pub(in crate::wire) const EN: u8 = 0x10;
    pub(in crate::wire) const MS: u8 = 0x20;
    pub(in crate::wire) const PS: u8 = 0x40;
    pub(in crate::wire) const MC: u8 = 0x80;
    pub(in crate::wire) const MR: u8 = 0x01;

    /// The bit where the flag is set, else nothing.
    pub(in crate::wire) fn bit(set: bool, bit: u8) -> u8 {
        if set { bit } else { 0 }
    }
}

/// MessageType values (DS 301 ch. 4.6.1.1). Bit 7 of the octet is no part of the type.
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

/// Addresses of a frame (DS 301 ch. 4.5, 4.6): the first 17 octets without EtherType and MessageType.
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

/// RS and PR (DS 301 ch. 4.2.4.1.2): how many asynchronous requests a node has queued, and the priority of the highest.
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

    pub(super) fn from_octet(octet: u8) -> Requests {
        Requests {
            count: octet & 0x07,
            priority: (octet >> 3) & 0x07,
        }
    }

    pub(super) fn to_octet(self) -> u8 {
        self.count.min(7) | ((self.priority & 0x07) << 3)
    }
}

/// Checks the length of an untrusted frame.
pub(super) fn check_len(frame: &[u8], need: usize) -> Result<(), WireError> {
    if frame.len() < need {
        Err(WireError::TooShort { need, got: frame.len() })
    } else {
        Ok(())
    }
}

/// Starts a frame of `len` octets, at least 60: header written, everything after it zero.
pub(super) fn start<'b>(
    header: &Header,
    message_type: u8,
    len: usize,
    buffer: &'b mut [u8],
) -> Result<&'b mut [u8], WireError> {
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
pub(super) fn array<const N: usize>(frame: &[u8], at: usize) -> [u8; N] {
    let mut octets = [0; N];
    octets.copy_from_slice(&frame[at..at + N]);
    octets
}

pub(super) fn u16_at(frame: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(array(frame, at))
}

pub(super) fn u32_at(frame: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(frame, at))
}

pub(super) fn put<const N: usize>(frame: &mut [u8], at: usize, octets: [u8; N]) {
    frame[at..at + N].copy_from_slice(&octets);
}
