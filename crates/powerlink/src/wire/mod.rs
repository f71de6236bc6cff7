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
mod header;
mod ident;
mod poll;
mod status;
mod sync;

pub use asnd::{Asnd, COMMAND_DATA_LEN, NmtCommandFrame, NmtRequestFrame, Service, ServiceId};
pub use chaining::{SYNC_RESPONSE_LEN, SyncRequest, SyncResponse};
pub use header::{
    EPL_VERSION, ETHER_TYPE, FRAME_LEN_MAX, FRAME_LEN_MIN, HEADER_LEN, Header, Mac, PAYLOAD_LIMIT_MIN, PAYLOAD_MAX,
    Requests, SOA_LEN, WireError, message, multicast, node,
};
pub use ident::{IDENT_RESPONSE_LEN, IdentResponse};
pub use poll::{POLL_HEADER_LEN, Preq, Pres};
pub use status::{
    ERROR_ENTRIES_MAX, ERROR_ENTRY_LEN, ErrorEntries, ErrorEntry, STATUS_RESPONSE_LEN_MIN, StatusResponse,
};
pub use sync::{NetTime, RequestedService, SOC_LEN, Soa, Soc};

use header::start;

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

#[cfg(test)]
mod tests;
