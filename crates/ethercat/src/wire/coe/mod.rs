//! CANopen over EtherCAT: objects of a device by mailbox.
//!
//! In and out: the data of mails of [`Protocol::CoE`].

pub mod abort;
mod info;
mod sdo;

pub use info::{InfoRequest, InfoResponse, ListKind, OPCODE_ERROR};
pub use sdo::{Bytes4, Object, SDO_LEN, SdoRequest, SdoResponse, Segment, segment_room};

use super::mailbox::{self, Protocol};
use super::{WireError, put, slice, u16_at};

/// Octets in front of every service.
pub const HEADER_LEN: usize = 2;

/// Octets of the shortest mailbox that carries an SDO.
pub const MAILBOX_MIN: u16 = (mailbox::HEADER_LEN + HEADER_LEN + SDO_LEN) as u16;

/// Number of a service, bits 12 to 15 of the header.
pub mod service {
    /// Emergency.
    pub const EMERGENCY: u8 = 1;
    /// SDO request.
    pub const SDO_REQUEST: u8 = 2;
    /// SDO response.
    pub const SDO_RESPONSE: u8 = 3;
    /// SDO information.
    pub const INFO: u8 = 8;
}

/// What a mail of CoE carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message<'a> {
    /// The device reports an error; comes unasked.
    Emergency(Emergency),
    /// The main device asks for, or gives, the value of an object.
    Request(SdoRequest<'a>),
    /// The device answers.
    Response(SdoResponse<'a>),
    /// The main device asks which objects there are.
    InfoRequest(InfoRequest),
    /// The device answers.
    InfoResponse(InfoResponse<'a>),
}

impl<'a> Message<'a> {
    /// Reads the data of a mail; never panics.
    ///
    /// # Errors
    /// [`WireError`]: why it is none.
    pub fn parse(data: &'a [u8]) -> Result<Message<'a>, WireError> {
        let service = (u16_at(data, 0)? >> 12) as u8;
        let body = slice(data, HEADER_LEN, data.len() - HEADER_LEN)?;
        match service {
            service::EMERGENCY => Emergency::parse(body).map(Message::Emergency),
            service::SDO_REQUEST => SdoRequest::parse(body).map(Message::Request),
            service::SDO_RESPONSE => SdoResponse::parse(body).map(Message::Response),
            service::INFO => {
                let opcode = *body.first().ok_or(WireError::TooShort { need: 1, got: 0 })?;
                if info::is_request(opcode) {
                    InfoRequest::parse(body).map(Message::InfoRequest)
                } else {
                    InfoResponse::parse(body).map(Message::InfoResponse)
                }
            }
            got => Err(WireError::Service { got }),
        }
    }

    /// Writes a whole mail into a dirty mailbox.
    ///
    /// # Errors
    /// [`WireError::NoRoom`].
    pub fn emit(&self, counter: u8, mailbox: &mut [u8]) -> Result<(), WireError> {
        let (service, length) = match self {
            Message::Emergency(_) => (service::EMERGENCY, Emergency::LEN),
            Message::Request(request) => (service::SDO_REQUEST, request.length()),
            Message::Response(response) => (service::SDO_RESPONSE, response.length()),
            Message::InfoRequest(request) => (service::INFO, request.length()),
            Message::InfoResponse(response) => (service::INFO, response.length()),
        };
        let data = mailbox::start(mailbox, Protocol::CoE, counter, HEADER_LEN + length)?;
        put(data, 0, (u16::from(service) << 12).to_le_bytes());
        let body = &mut data[HEADER_LEN..];
        match self {
            Message::Emergency(emergency) => emergency.emit(body),
            Message::Request(request) => request.emit(body),
            Message::Response(response) => response.emit(body),
            Message::InfoRequest(request) => request.emit(body),
            Message::InfoResponse(response) => response.emit(body),
        }
        Ok(())
    }
}

/// An error that a device reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code; 0: the error is over.
    pub code: u16,
    /// 1001h.
    pub register: u8,
    /// Data of the maker.
    pub data: [u8; 5],
}

impl Emergency {
    const LEN: usize = 8;

    fn parse(body: &[u8]) -> Result<Emergency, WireError> {
        let body = slice(body, 0, Emergency::LEN)?;
        Ok(Emergency {
            code: u16_at(body, 0)?,
            register: body[2],
            data: [body[3], body[4], body[5], body[6], body[7]],
        })
    }

    fn emit(&self, body: &mut [u8]) {
        put(body, 0, self.code.to_le_bytes());
        body[2] = self.register;
        put(body, 3, self.data);
    }
}
