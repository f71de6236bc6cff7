//! SDO information: which objects a device has.

use super::super::{WireError, put, slice, u16_at, u32_at};
use obd::AbortCode;

/// Octets in front of every request and answer.
const HEADER_LEN: usize = 4;
/// Opcode, bit 7: fragments follow.
const MORE: u8 = 0x80;
const LIST_REQUEST: u8 = 1;
const LIST_RESPONSE: u8 = 2;
const OBJECT_REQUEST: u8 = 3;
const OBJECT_RESPONSE: u8 = 4;
const ENTRY_REQUEST: u8 = 5;
const ENTRY_RESPONSE: u8 = 6;
/// Opcode of an answer that refuses.
pub const OPCODE_ERROR: u8 = 7;

/// Requests have odd opcodes below 7.
pub(super) fn is_request(opcode: u8) -> bool {
    matches!(opcode & !MORE, LIST_REQUEST | OBJECT_REQUEST | ENTRY_REQUEST)
}

/// Which objects a list has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListKind {
    /// No objects, but how many there are of each kind, from [`ListKind::All`] on.
    Counts,
    /// All.
    All,
    /// Those that can be mapped in a PDO to the device.
    RxPdo,
    /// Those that can be mapped in a PDO from the device.
    TxPdo,
    /// Those that are stored for a device that takes its place.
    Backup,
    /// Those that are set at every start.
    Settings,
    /// Any other number.
    Unknown(u16),
}

impl From<u16> for ListKind {
    fn from(number: u16) -> ListKind {
        match number {
            0 => ListKind::Counts,
            1 => ListKind::All,
            2 => ListKind::RxPdo,
            3 => ListKind::TxPdo,
            4 => ListKind::Backup,
            5 => ListKind::Settings,
            other => ListKind::Unknown(other),
        }
    }
}

impl From<ListKind> for u16 {
    fn from(kind: ListKind) -> u16 {
        match kind {
            ListKind::Counts => 0,
            ListKind::All => 1,
            ListKind::RxPdo => 2,
            ListKind::TxPdo => 3,
            ListKind::Backup => 4,
            ListKind::Settings => 5,
            ListKind::Unknown(other) => other,
        }
    }
}

/// What the main device wants to know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InfoRequest {
    /// Which objects there are.
    List(ListKind),
    /// What an object is.
    Object {
        /// Its index.
        index: u16,
    },
    /// What one of its entries is.
    Entry {
        /// Index.
        index: u16,
        /// Sub-index.
        sub: u8,
        /// Bits for what is wanted beside type, bits and access.
        wanted: u8,
    },
}

impl InfoRequest {
    pub(super) fn parse(body: &[u8]) -> Result<InfoRequest, WireError> {
        let data = slice(body, HEADER_LEN, body.len().saturating_sub(HEADER_LEN))?;
        match body[0] & !MORE {
            LIST_REQUEST => Ok(InfoRequest::List(u16_at(data, 0)?.into())),
            OBJECT_REQUEST => Ok(InfoRequest::Object {
                index: u16_at(data, 0)?,
            }),
            ENTRY_REQUEST => {
                let rest = slice(data, 0, 4)?;
                Ok(InfoRequest::Entry {
                    index: u16_at(data, 0)?,
                    sub: rest[2],
                    wanted: rest[3],
                })
            }
            got => Err(WireError::Service { got }),
        }
    }

    pub(super) fn length(&self) -> usize {
        match self {
            InfoRequest::List(_) | InfoRequest::Object { .. } => HEADER_LEN + 2,
            InfoRequest::Entry { .. } => HEADER_LEN + 4,
        }
    }

    pub(super) fn emit(&self, body: &mut [u8]) {
        match *self {
            InfoRequest::List(kind) => {
                body[0] = LIST_REQUEST;
                put(body, HEADER_LEN, u16::from(kind).to_le_bytes());
            }
            InfoRequest::Object { index } => {
                body[0] = OBJECT_REQUEST;
                put(body, HEADER_LEN, index.to_le_bytes());
            }
            InfoRequest::Entry { index, sub, wanted } => {
                body[0] = ENTRY_REQUEST;
                put(body, HEADER_LEN, index.to_le_bytes());
                put(body, HEADER_LEN + 2, [sub, wanted]);
            }
        }
    }
}

/// What the device answers; a list that is longer than the mailbox comes in fragments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InfoResponse<'a> {
    /// A part of a list; the first part begins with the kind of the list.
    List {
        /// Fragments that follow.
        left: u16,
        /// Numbers of 16 bits.
        data: &'a [u8],
    },
    /// What an object is.
    Object {
        /// Its index.
        index: u16,
        /// Code of its type.
        data_type: u16,
        /// Highest sub-index.
        sub_max: u8,
        /// 7 variable, 8 array, 9 record.
        code: u8,
        /// Its name.
        name: &'a [u8],
    },
    /// What an entry is.
    Entry {
        /// Index.
        index: u16,
        /// Sub-index.
        sub: u8,
        /// What was asked for.
        wanted: u8,
        /// Code of its type.
        data_type: u16,
        /// Its length.
        bits: u16,
        /// Bits 0 to 2 read in PRE-OP, SAFE-OP, OP; 3 to 5 write; 6 in RxPDO, 7 in TxPDO.
        access: u16,
        /// Its name, behind what was asked for.
        data: &'a [u8],
    },
    /// The device refuses.
    Error(AbortCode),
}

impl<'a> InfoResponse<'a> {
    pub(super) fn parse(body: &'a [u8]) -> Result<InfoResponse<'a>, WireError> {
        let data = slice(body, HEADER_LEN, body.len().saturating_sub(HEADER_LEN))?;
        match body[0] & !MORE {
            LIST_RESPONSE => Ok(InfoResponse::List {
                left: u16_at(body, 2)?,
                data,
            }),
            OBJECT_RESPONSE => {
                let rest = slice(data, 0, 6)?;
                Ok(InfoResponse::Object {
                    index: u16_at(data, 0)?,
                    data_type: u16_at(data, 2)?,
                    sub_max: rest[4],
                    code: rest[5],
                    name: &data[6..],
                })
            }
            ENTRY_RESPONSE => {
                let rest = slice(data, 0, 10)?;
                Ok(InfoResponse::Entry {
                    index: u16_at(data, 0)?,
                    sub: rest[2],
                    wanted: rest[3],
                    data_type: u16_at(data, 4)?,
                    bits: u16_at(data, 6)?,
                    access: u16_at(data, 8)?,
                    data: &data[10..],
                })
            }
            OPCODE_ERROR => Ok(InfoResponse::Error(AbortCode(u32_at(data, 0)?))),
            got => Err(WireError::Service { got }),
        }
    }

    pub(super) fn length(&self) -> usize {
        HEADER_LEN
            + match self {
                InfoResponse::List { data, .. } => data.len(),
                InfoResponse::Object { name, .. } => 6 + name.len(),
                InfoResponse::Entry { data, .. } => 10 + data.len(),
                InfoResponse::Error(_) => 4,
            }
    }

    pub(super) fn emit(&self, body: &mut [u8]) {
        let (head, rest) = body.split_at_mut(HEADER_LEN);
        match *self {
            InfoResponse::List { left, data } => {
                head[0] = LIST_RESPONSE | if left > 0 { MORE } else { 0 };
                put(head, 2, left.to_le_bytes());
                rest.copy_from_slice(data);
            }
            InfoResponse::Object {
                index,
                data_type,
                sub_max,
                code,
                name,
            } => {
                head[0] = OBJECT_RESPONSE;
                put(rest, 0, index.to_le_bytes());
                put(rest, 2, data_type.to_le_bytes());
                put(rest, 4, [sub_max, code]);
                rest[6..].copy_from_slice(name);
            }
            InfoResponse::Entry {
                index,
                sub,
                wanted,
                data_type,
                bits,
                access,
                data,
            } => {
                head[0] = ENTRY_RESPONSE;
                put(rest, 0, index.to_le_bytes());
                put(rest, 2, [sub, wanted]);
                put(rest, 4, data_type.to_le_bytes());
                put(rest, 6, bits.to_le_bytes());
                put(rest, 8, access.to_le_bytes());
                rest[10..].copy_from_slice(data);
            }
            InfoResponse::Error(code) => {
                head[0] = OPCODE_ERROR;
                put(rest, 0, code.0.to_le_bytes());
            }
        }
    }
}
