//! ASnd: everything that is sent in the asynchronous slot.

use super::chaining::SyncResponse;
use super::header::{FRAME_LEN_MIN, Header, WireError, array, check_len, message, start};
use super::ident::{IDENT_RESPONSE_LEN, IdentResponse};
use super::status::StatusResponse;
use crate::nmt::{NmtCommand, NodeList};

/// Octets of command data in NMTCommand and NMTRequest.
pub const COMMAND_DATA_LEN: usize = 32;
/// Where the data of a service start.
const DATA_AT: usize = 18;

/// ServiceID of an ASnd (DS 301 ch. 4.6.1.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the names are the standard's")]
pub enum ServiceId {
    IdentResponse,
    StatusResponse,
    NmtRequest,
    NmtCommand,
    Sdo,
    SyncResponse,
    /// A value the standard does not define, or a manufacturer's.
    Unknown(u8),
}

impl From<u8> for ServiceId {
    fn from(octet: u8) -> Self {
        match octet {
            0x01 => ServiceId::IdentResponse,
            0x02 => ServiceId::StatusResponse,
            0x03 => ServiceId::NmtRequest,
            0x04 => ServiceId::NmtCommand,
            0x05 => ServiceId::Sdo,
            0x06 => ServiceId::SyncResponse,
            other => ServiceId::Unknown(other),
        }
    }
}

impl From<ServiceId> for u8 {
    fn from(id: ServiceId) -> u8 {
        match id {
            ServiceId::IdentResponse => 0x01,
            ServiceId::StatusResponse => 0x02,
            ServiceId::NmtRequest => 0x03,
            ServiceId::NmtCommand => 0x04,
            ServiceId::Sdo => 0x05,
            ServiceId::SyncResponse => 0x06,
            ServiceId::Unknown(octet) => octet,
        }
    }
}

/// Asynchronous send. Boxes nothing: the large IdentResponse is copied, the others borrow from the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(clippy::large_enum_variant, reason = "no alloc; frames are read one at a time")]
pub enum Asnd<'a> {
    /// Identity of a node.
    IdentResponse(IdentResponse),
    /// State and errors of a node.
    StatusResponse(StatusResponse<'a>),
    /// A CN asks the MN for an NMT service.
    NmtRequest(NmtRequestFrame),
    /// The MN commands one node or all.
    NmtCommand(NmtCommandFrame),
    /// SDO container: from the first octet of the sequence layer (octet 18) to the end of the frame, padding included.
    Sdo(&'a [u8]),
    /// Times of PRes chaining that a node measured or holds.
    SyncResponse(SyncResponse),
    /// Any other service, kept as it came.
    Other(Service<'a>),
}

/// A service this crate does not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Service<'a> {
    /// ServiceID, octet 17 of the frame.
    pub id: ServiceId,
    /// From octet 18 to the end of the frame, padding included.
    pub data: &'a [u8],
}

impl<'a> Asnd<'a> {
    pub(super) fn parse(frame: &'a [u8]) -> Result<Asnd<'a>, WireError> {
        check_len(frame, DATA_AT)?;
        match ServiceId::from(frame[17]) {
            ServiceId::IdentResponse => IdentResponse::parse(frame).map(Asnd::IdentResponse),
            ServiceId::StatusResponse => StatusResponse::parse(frame).map(Asnd::StatusResponse),
            ServiceId::NmtRequest => NmtRequestFrame::parse(frame).map(Asnd::NmtRequest),
            ServiceId::NmtCommand => NmtCommandFrame::parse(frame).map(Asnd::NmtCommand),
            ServiceId::Sdo => Ok(Asnd::Sdo(&frame[DATA_AT..])),
            ServiceId::SyncResponse => SyncResponse::parse(frame).map(Asnd::SyncResponse),
            id @ ServiceId::Unknown(_) => Ok(Asnd::Other(Service {
                id,
                data: &frame[DATA_AT..],
            })),
        }
    }

    /// Which service it is.
    pub fn service_id(&self) -> ServiceId {
        match self {
            Asnd::IdentResponse(_) => ServiceId::IdentResponse,
            Asnd::StatusResponse(_) => ServiceId::StatusResponse,
            Asnd::NmtRequest(_) => ServiceId::NmtRequest,
            Asnd::NmtCommand(_) => ServiceId::NmtCommand,
            Asnd::Sdo(_) => ServiceId::Sdo,
            Asnd::SyncResponse(_) => ServiceId::SyncResponse,
            Asnd::Other(service) => service.id,
        }
    }

    /// Writes the frame, padded to at least 60 octets; returns its length.
    ///
    /// # Errors
    /// [`WireError::NoRoom`] in a buffer that is too short, [`WireError::TooLong`] for data that no frame holds.
    pub fn emit(&self, header: &Header, buffer: &mut [u8]) -> Result<usize, WireError> {
        let len = match self {
            Asnd::IdentResponse(_) => IDENT_RESPONSE_LEN,
            Asnd::StatusResponse(status) => status.frame_len(),
            Asnd::NmtRequest(_) | Asnd::NmtCommand(_) | Asnd::SyncResponse(_) => FRAME_LEN_MIN,
            Asnd::Sdo(data) => DATA_AT + data.len(),
            Asnd::Other(service) => DATA_AT + service.data.len(),
        };
        let frame = start(header, message::ASND, len, buffer)?;
        frame[17] = self.service_id().into();
        match self {
            Asnd::IdentResponse(ident) => ident.write(frame),
            Asnd::StatusResponse(status) => status.write(frame),
            Asnd::NmtRequest(request) => request.write(frame),
            Asnd::NmtCommand(command) => command.write(frame),
            Asnd::Sdo(data) => frame[DATA_AT..DATA_AT + data.len()].copy_from_slice(data),
            Asnd::SyncResponse(response) => response.write(frame),
            Asnd::Other(service) => frame[DATA_AT..DATA_AT + service.data.len()].copy_from_slice(service.data),
        }
        Ok(frame.len())
    }
}

/// NMTCommand (DS 301 ch. 7.3): the target is the destination node of the frame, 255 for all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NmtCommandFrame {
    /// What to do.
    pub command: NmtCommand,
    /// Command data: the node list of extended and publishing commands, else zeros.
    pub data: [u8; COMMAND_DATA_LEN],
}

impl NmtCommandFrame {
    /// A plain command.
    pub fn plain(command: NmtCommand) -> NmtCommandFrame {
        NmtCommandFrame {
            command,
            data: [0; COMMAND_DATA_LEN],
        }
    }

    /// A command to the nodes of a list.
    pub fn extended(command: NmtCommand, nodes: NodeList) -> NmtCommandFrame {
        NmtCommandFrame { command, data: nodes.0 }
    }

    /// The node list of an extended command.
    pub fn nodes(&self) -> NodeList {
        NodeList(self.data)
    }

    fn parse(frame: &[u8]) -> Result<NmtCommandFrame, WireError> {
        // Command data may be left out by a sender that does not pad: what is not there counts as zero.
        check_len(frame, 20)?;
        Ok(NmtCommandFrame {
            command: NmtCommand::from(frame[18]),
            data: command_data(frame),
        })
    }

    fn write(&self, frame: &mut [u8]) {
        frame[18] = self.command.into();
        frame[20..20 + COMMAND_DATA_LEN].copy_from_slice(&self.data);
    }
}

/// NMTRequest (DS 301 ch. 7.3; as 0x1F9F does it from outside): a CN asks for an NMT service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NmtRequestFrame {
    /// What the MN shall do.
    pub command: NmtCommand,
    /// To which node.
    pub target: u8,
    /// Command data, zero where the command has none.
    pub data: [u8; COMMAND_DATA_LEN],
}

impl NmtRequestFrame {
    fn parse(frame: &[u8]) -> Result<NmtRequestFrame, WireError> {
        check_len(frame, 20)?;
        Ok(NmtRequestFrame {
            command: NmtCommand::from(frame[18]),
            target: frame[19],
            data: command_data(frame),
        })
    }

    fn write(&self, frame: &mut [u8]) {
        frame[18] = self.command.into();
        frame[19] = self.target;
        frame[20..20 + COMMAND_DATA_LEN].copy_from_slice(&self.data);
    }
}

/// Octets 20..52, zeros where the frame ends before.
fn command_data(frame: &[u8]) -> [u8; COMMAND_DATA_LEN] {
    if frame.len() >= 20 + COMMAND_DATA_LEN {
        return array(frame, 20);
    }
    let mut data = [0; COMMAND_DATA_LEN];
    let there = &frame[20..];
    data[..there.len()].copy_from_slice(there);
    data
}
