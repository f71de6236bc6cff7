//! PReq and PRes: the process data of one controlled node, there and back.

use super::header::{
    FRAME_LEN_MIN, Header, PAYLOAD_LIMIT_MIN, PAYLOAD_MAX, Requests, WireError, check_len, flag, message, start, u16_at,
};
use crate::nmt::NmtState;

/// Octets before the payload of a PReq or PRes.
pub const POLL_HEADER_LEN: usize = 24;
const _: () = assert!(POLL_HEADER_LEN + PAYLOAD_LIMIT_MIN == FRAME_LEN_MIN);

/// Poll request: the managing node's output data for one node, which answers at once with its PRes
/// (DS 301 ch. 4.6.1.1; payload limit 0x1F8B).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preq<'a> {
    /// MS: the node is polled in multiplexed cycles.
    pub multiplexed: bool,
    /// EA: exception acknowledge.
    pub exception_acknowledge: bool,
    /// RD: the payload is valid.
    pub ready: bool,
    /// Mapping version; main version in the high nibble.
    pub pdo_version: u8,
    /// Process data: as many octets as the size field says.
    pub payload: &'a [u8],
}

impl<'a> Preq<'a> {
    pub(super) fn parse(frame: &'a [u8]) -> Result<Preq<'a>, WireError> {
        let payload = payload(frame)?;
        Ok(Preq {
            multiplexed: frame[18] & flag::MS != 0,
            exception_acknowledge: frame[18] & flag::EA != 0,
            ready: frame[18] & flag::RD != 0,
            pdo_version: frame[20],
            payload,
        })
    }

    /// Writes the frame as long as a payload of `payload_limit` octets (object 0x1F8B) makes it; returns its length.
    ///
    /// # Errors
    /// [`WireError::NoRoom`] in a buffer that is too short, [`WireError::TooLong`] for a payload beyond its limit.
    pub fn emit(&self, header: &Header, payload_limit: usize, buffer: &mut [u8]) -> Result<usize, WireError> {
        let frame = start_poll(header, message::PREQ, payload_limit, self.payload, buffer)?;
        frame[18] = flag::bit(self.multiplexed, flag::MS)
            | flag::bit(self.exception_acknowledge, flag::EA)
            | flag::bit(self.ready, flag::RD);
        frame[20] = self.pdo_version;
        Ok(frame.len())
    }
}

/// Poll response: the input data of one node, multicast so that every node can read them (DS 301 ch. 4.6.1.1; payload limit
/// 0x1F8D).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pres<'a> {
    /// State of the sender.
    pub nmt_state: NmtState,
    /// MS: the node is polled in multiplexed cycles.
    pub multiplexed: bool,
    /// EN: exception new; flips when there are new error entries to fetch.
    pub exception_new: bool,
    /// RD: the payload is valid.
    pub ready: bool,
    /// PR and RS: asynchronous requests waiting at the sender.
    pub requests: Requests,
    /// Mapping version; main version in the high nibble.
    pub pdo_version: u8,
    /// Process data: as many octets as the size field says.
    pub payload: &'a [u8],
}

impl<'a> Pres<'a> {
    pub(super) fn parse(frame: &'a [u8]) -> Result<Pres<'a>, WireError> {
        let payload = payload(frame)?;
        Ok(Pres {
            nmt_state: NmtState::from(frame[17]),
            multiplexed: frame[18] & flag::MS != 0,
            exception_new: frame[18] & flag::EN != 0,
            ready: frame[18] & flag::RD != 0,
            requests: Requests::from_octet(frame[19]),
            pdo_version: frame[20],
            payload,
        })
    }

    /// Writes the frame as long as a payload of `payload_limit` octets (object 0x1F98/5) makes it; returns its length.
    ///
    /// # Errors
    /// [`WireError::NoRoom`] in a buffer that is too short, [`WireError::TooLong`] for a payload beyond its limit.
    pub fn emit(&self, header: &Header, payload_limit: usize, buffer: &mut [u8]) -> Result<usize, WireError> {
        let frame = start_poll(header, message::PRES, payload_limit, self.payload, buffer)?;
        frame[17] = self.nmt_state.into();
        frame[18] = flag::bit(self.multiplexed, flag::MS)
            | flag::bit(self.exception_new, flag::EN)
            | flag::bit(self.ready, flag::RD);
        frame[19] = self.requests.to_octet();
        frame[20] = self.pdo_version;
        Ok(frame.len())
    }
}

/// The valid payload: the size field is believed only as far as the frame reaches; what follows is padding.
fn payload(frame: &[u8]) -> Result<&[u8], WireError> {
    check_len(frame, POLL_HEADER_LEN)?;
    let size = usize::from(u16_at(frame, 22));
    let room = (frame.len() - POLL_HEADER_LEN).min(PAYLOAD_MAX);
    if size > room {
        return Err(WireError::PayloadSize { size, room });
    }
    Ok(&frame[POLL_HEADER_LEN..POLL_HEADER_LEN + size])
}

fn start_poll<'b>(
    header: &Header,
    message_type: u8,
    payload_limit: usize,
    payload: &[u8],
    buffer: &'b mut [u8],
) -> Result<&'b mut [u8], WireError> {
    if payload.len() > PAYLOAD_MAX {
        return Err(WireError::NoRoom {
            need: payload.len(),
            got: PAYLOAD_MAX,
        });
    }
    let frame = start(
        header,
        message_type,
        POLL_HEADER_LEN + payload_limit.max(payload.len()),
        buffer,
    )?;
    // At most 1490, checked above.
    frame[22..24].copy_from_slice(&(payload.len() as u16).to_le_bytes());
    frame[POLL_HEADER_LEN..POLL_HEADER_LEN + payload.len()].copy_from_slice(payload);
    Ok(frame)
}
