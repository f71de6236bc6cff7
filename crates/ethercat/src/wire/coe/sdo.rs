//! SDO: the value of an object, in one mail or in several.

use super::super::{WireError, array, put, slice, u16_at, u32_at};
use obd::AbortCode;

/// Octets of every SDO but segments and values that are longer.
pub const SDO_LEN: usize = 8;

/// Bits of the command octet.
mod bit {
    pub(super) const SIZE: u8 = 0x01;
    pub(super) const EXPEDITED: u8 = 0x02;
    pub(super) const COMPLETE: u8 = 0x10;
    pub(super) const LAST: u8 = 0x01;
    pub(super) const TOGGLE: u8 = 0x10;
}

/// Command, bits 5 to 7.
mod command {
    pub(super) const DOWNLOAD_SEGMENT: u8 = 0;
    pub(super) const DOWNLOAD: u8 = 1;
    pub(super) const UPLOAD: u8 = 2;
    pub(super) const UPLOAD_SEGMENT: u8 = 3;
    pub(super) const ABORT: u8 = 4;
    pub(super) const SEGMENT_RESPONSE: u8 = 0;
    pub(super) const DOWNLOAD_SEGMENT_RESPONSE: u8 = 1;
    pub(super) const UPLOAD_RESPONSE: u8 = 2;
    pub(super) const DOWNLOAD_RESPONSE: u8 = 3;
}

/// Most octets of a value that a segment can carry in a mailbox of this length.
pub const fn segment_room(mailbox: usize) -> usize {
    mailbox.saturating_sub(super::mailbox::HEADER_LEN + super::HEADER_LEN + 1)
}

/// One to four octets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bytes4 {
    octets: [u8; 4],
    length: u8,
}

impl Bytes4 {
    /// The octets of a value; `None` for none or for more than four.
    pub fn new(value: &[u8]) -> Option<Bytes4> {
        let mut octets = [0; 4];
        octets.get_mut(..value.len())?.copy_from_slice(value);
        (!value.is_empty()).then_some(Bytes4 {
            octets,
            length: value.len() as u8,
        })
    }

    /// The octets.
    pub fn octets(&self) -> &[u8] {
        &self.octets[..usize::from(self.length)]
    }

    /// Of an expedited SDO; one without a size has four octets.
    fn parse(command: u8, octets: [u8; 4]) -> Bytes4 {
        let unused = if command & bit::SIZE != 0 { command >> 2 & 3 } else { 0 };
        let length = 4 - unused;
        let mut value = [0; 4];
        value[..usize::from(length)].copy_from_slice(&octets[..usize::from(length)]);
        Bytes4 { octets: value, length }
    }

    fn bits(self) -> u8 {
        bit::EXPEDITED | bit::SIZE | (4 - self.length) << 2
    }
}

/// A part of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment<'a> {
    /// Alternates, 0 first.
    pub toggle: bool,
    /// No other one follows.
    pub last: bool,
    /// Its octets.
    pub data: &'a [u8],
}

impl<'a> Segment<'a> {
    fn parse(command: u8, data: &'a [u8]) -> Segment<'a> {
        // A mail has room for seven octets at least; only there it counts those that are not used.
        let unused = if data.len() <= 7 {
            usize::from(command >> 1 & 7)
        } else {
            0
        };
        Segment {
            toggle: command & bit::TOGGLE != 0,
            last: command & bit::LAST != 0,
            data: &data[..data.len().saturating_sub(unused)],
        }
    }

    fn length(&self) -> usize {
        1 + self.data.len().max(7)
    }

    fn emit(&self, command: u8, body: &mut [u8]) {
        let unused = 7_usize.saturating_sub(self.data.len()) as u8;
        let toggle = if self.toggle { bit::TOGGLE } else { 0 };
        body[0] = command << 5 | toggle | unused << 1 | u8::from(self.last);
        body[1..=self.data.len()].copy_from_slice(self.data);
    }
}

/// Object of an SDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Sub-index; with complete access the first one, 0 or 1.
    pub sub: u8,
    /// All sub-indices at once.
    pub complete: bool,
}

impl Object {
    fn parse(body: &[u8]) -> Result<Object, WireError> {
        Ok(Object {
            index: u16_at(body, 1)?,
            sub: slice(body, 3, 1)?[0],
            complete: body[0] & bit::COMPLETE != 0,
        })
    }

    fn emit(&self, command: u8, body: &mut [u8]) {
        body[0] = command << 5 | if self.complete { bit::COMPLETE } else { 0 };
        put(body, 1, self.index.to_le_bytes());
        body[3] = self.sub;
    }
}

/// What the main device wants of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoRequest<'a> {
    /// Take a value of up to four octets.
    DownloadExpedited {
        /// Where to.
        object: Object,
        /// The value.
        value: Bytes4,
    },
    /// Take a value of `total` octets, of which the first are here; segments follow where there are more.
    Download {
        /// Where to.
        object: Object,
        /// Octets of the whole value.
        total: u32,
        /// The first of them.
        data: &'a [u8],
    },
    /// Take a further part.
    DownloadSegment(Segment<'a>),
    /// Give a value.
    Upload(Object),
    /// Give a further part.
    UploadSegment {
        /// Alternates, 0 first.
        toggle: bool,
    },
    /// The transfer is given up.
    Abort {
        /// Of which object.
        object: Object,
        /// Why.
        code: AbortCode,
    },
}

impl<'a> SdoRequest<'a> {
    pub(super) fn parse(body: &'a [u8]) -> Result<SdoRequest<'a>, WireError> {
        slice(body, 0, SDO_LEN)?;
        let first = body[0];
        match first >> 5 {
            command::DOWNLOAD if first & bit::EXPEDITED != 0 => Ok(SdoRequest::DownloadExpedited {
                object: Object::parse(body)?,
                value: Bytes4::parse(first, array(body, 4)?),
            }),
            command::DOWNLOAD => {
                let total = u32_at(body, 4)?;
                let data = &body[SDO_LEN..];
                let used = data.len().min(usize::try_from(total).unwrap_or(usize::MAX));
                Ok(SdoRequest::Download {
                    object: Object::parse(body)?,
                    total,
                    data: &data[..used],
                })
            }
            command::DOWNLOAD_SEGMENT => Ok(SdoRequest::DownloadSegment(Segment::parse(first, &body[1..]))),
            command::UPLOAD => Object::parse(body).map(SdoRequest::Upload),
            command::UPLOAD_SEGMENT => Ok(SdoRequest::UploadSegment {
                toggle: first & bit::TOGGLE != 0,
            }),
            command::ABORT => Ok(SdoRequest::Abort {
                object: Object::parse(body)?,
                code: AbortCode(u32_at(body, 4)?),
            }),
            _ => Err(WireError::Service { got: first }),
        }
    }

    pub(super) fn length(&self) -> usize {
        match self {
            SdoRequest::Download { data, .. } => SDO_LEN + data.len(),
            SdoRequest::DownloadSegment(segment) => segment.length(),
            _ => SDO_LEN,
        }
    }

    pub(super) fn emit(&self, body: &mut [u8]) {
        match self {
            SdoRequest::DownloadExpedited { object, value } => {
                object.emit(command::DOWNLOAD, body);
                body[0] |= value.bits();
                put(body, 4, value.octets);
            }
            SdoRequest::Download { object, total, data } => {
                object.emit(command::DOWNLOAD, body);
                body[0] |= bit::SIZE;
                put(body, 4, total.to_le_bytes());
                body[SDO_LEN..].copy_from_slice(data);
            }
            SdoRequest::DownloadSegment(segment) => segment.emit(command::DOWNLOAD_SEGMENT, body),
            SdoRequest::Upload(object) => object.emit(command::UPLOAD, body),
            SdoRequest::UploadSegment { toggle } => {
                body[0] = command::UPLOAD_SEGMENT << 5 | if *toggle { bit::TOGGLE } else { 0 };
            }
            SdoRequest::Abort { object, code } => {
                object.emit(command::ABORT, body);
                put(body, 4, code.0.to_le_bytes());
            }
        }
    }
}

/// What the device answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoResponse<'a> {
    /// The value, or its first part, was taken.
    DownloadDone(Object),
    /// A part was taken.
    DownloadSegmentDone {
        /// That of the segment.
        toggle: bool,
    },
    /// A value of up to four octets.
    UploadExpedited {
        /// Of which object.
        object: Object,
        /// The value.
        value: Bytes4,
    },
    /// A value of `total` octets, of which the first are here; segments follow where there are more.
    Upload {
        /// Of which object.
        object: Object,
        /// Octets of the whole value.
        total: u32,
        /// The first of them.
        data: &'a [u8],
    },
    /// A further part.
    UploadSegment(Segment<'a>),
    /// The device refuses.
    Abort {
        /// Of which object.
        object: Object,
        /// Why.
        code: AbortCode,
    },
}

impl<'a> SdoResponse<'a> {
    /// Of which object it is; segments do not say.
    pub const fn object(&self) -> Option<Object> {
        match self {
            SdoResponse::DownloadDone(object)
            | SdoResponse::UploadExpedited { object, .. }
            | SdoResponse::Upload { object, .. }
            | SdoResponse::Abort { object, .. } => Some(*object),
            SdoResponse::DownloadSegmentDone { .. } | SdoResponse::UploadSegment(_) => None,
        }
    }

    pub(super) fn parse(body: &'a [u8]) -> Result<SdoResponse<'a>, WireError> {
        slice(body, 0, SDO_LEN)?;
        let first = body[0];
        match first >> 5 {
            command::DOWNLOAD_RESPONSE => Object::parse(body).map(SdoResponse::DownloadDone),
            command::DOWNLOAD_SEGMENT_RESPONSE => Ok(SdoResponse::DownloadSegmentDone {
                toggle: first & bit::TOGGLE != 0,
            }),
            command::UPLOAD_RESPONSE if first & bit::EXPEDITED != 0 => Ok(SdoResponse::UploadExpedited {
                object: Object::parse(body)?,
                value: Bytes4::parse(first, array(body, 4)?),
            }),
            command::UPLOAD_RESPONSE => {
                let total = u32_at(body, 4)?;
                let data = &body[SDO_LEN..];
                let used = data.len().min(usize::try_from(total).unwrap_or(usize::MAX));
                Ok(SdoResponse::Upload {
                    object: Object::parse(body)?,
                    total,
                    data: &data[..used],
                })
            }
            command::SEGMENT_RESPONSE => Ok(SdoResponse::UploadSegment(Segment::parse(first, &body[1..]))),
            command::ABORT => Ok(SdoResponse::Abort {
                object: Object::parse(body)?,
                code: AbortCode(u32_at(body, 4)?),
            }),
            _ => Err(WireError::Service { got: first }),
        }
    }

    pub(super) fn length(&self) -> usize {
        match self {
            SdoResponse::Upload { data, .. } => SDO_LEN + data.len(),
            SdoResponse::UploadSegment(segment) => segment.length(),
            _ => SDO_LEN,
        }
    }

    pub(super) fn emit(&self, body: &mut [u8]) {
        match self {
            SdoResponse::DownloadDone(object) => object.emit(command::DOWNLOAD_RESPONSE, body),
            SdoResponse::DownloadSegmentDone { toggle } => {
                body[0] = command::DOWNLOAD_SEGMENT_RESPONSE << 5 | if *toggle { bit::TOGGLE } else { 0 };
            }
            SdoResponse::UploadExpedited { object, value } => {
                object.emit(command::UPLOAD_RESPONSE, body);
                body[0] |= value.bits();
                put(body, 4, value.octets);
            }
            SdoResponse::Upload { object, total, data } => {
                object.emit(command::UPLOAD_RESPONSE, body);
                body[0] |= bit::SIZE;
                put(body, 4, total.to_le_bytes());
                body[SDO_LEN..].copy_from_slice(data);
            }
            SdoResponse::UploadSegment(segment) => segment.emit(command::SEGMENT_RESPONSE, body),
            SdoResponse::Abort { object, code } => {
                object.emit(command::ABORT, body);
                put(body, 4, code.0.to_le_bytes());
            }
        }
    }
}
