//! StatusResponse: state and errors of a node, the answer to a StatusRequest.

use super::header::{Requests, WireError, array, check_len, flag, put, u16_at, u32_at};
use super::sync::NetTime;
use crate::nmt::NmtState;

/// Octets of the shortest StatusResponse: room for two error entries.
pub const STATUS_RESPONSE_LEN_MIN: usize = 72;
/// Octets of one error entry.
pub const ERROR_ENTRY_LEN: usize = 20;
/// Most error entries in one StatusResponse.
pub const ERROR_ENTRIES_MAX: usize = 13;
/// Where the error entries start.
const ENTRIES_AT: usize = 32;

/// State and errors of a node: StatusResponse (DS 301 ch. 7.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatusResponse<'a> {
    /// EC: exception clear; error signalling is being initialised.
    pub exception_clear: bool,
    /// EN: exception new; flips when there are new error entries.
    pub exception_new: bool,
    /// PR and RS: asynchronous requests waiting at the sender.
    pub requests: Requests,
    /// State of the sender.
    pub nmt_state: NmtState,
    /// StaticErrorBitField: octet 0 is a copy of the error register 0x1001.
    pub static_errors: [u8; 8],
    /// Error and event entries.
    pub entries: ErrorEntries<'a>,
}

impl<'a> StatusResponse<'a> {
    pub(super) fn parse(frame: &'a [u8]) -> Result<StatusResponse<'a>, WireError> {
        check_len(frame, ENTRIES_AT)?;
        Ok(StatusResponse {
            exception_clear: frame[18] & flag::EC != 0,
            exception_new: frame[18] & flag::EN != 0,
            requests: Requests::from_octet(frame[19]),
            nmt_state: NmtState::from(frame[20]),
            static_errors: array(frame, 24),
            entries: ErrorEntries(&frame[ENTRIES_AT..]),
        })
    }

    /// Octets of the frame before padding.
    pub(super) fn frame_len(&self) -> usize {
        (ENTRIES_AT + self.entries.0.len()).max(STATUS_RESPONSE_LEN_MIN)
    }

    pub(super) fn write(&self, frame: &mut [u8]) {
        frame[18] = flag::bit(self.exception_clear, flag::EC) | flag::bit(self.exception_new, flag::EN);
        frame[19] = self.requests.to_octet();
        frame[20] = self.nmt_state.into();
        put(frame, 24, self.static_errors);
        frame[ENTRIES_AT..ENTRIES_AT + self.entries.0.len()].copy_from_slice(self.entries.0);
    }
}

/// The octets of a list of error entries; iterate to read them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct ErrorEntries<'a>(
    /// 20 octets an entry; the list ends with an entry type 0 or with the frame.
    pub &'a [u8],
);

impl ErrorEntries<'_> {
    /// The entries up to the end mark; never more than 13.
    pub fn iter(&self) -> impl Iterator<Item = ErrorEntry> + '_ {
        self.0
            .chunks_exact(ERROR_ENTRY_LEN)
            .take(ERROR_ENTRIES_MAX)
            .map(ErrorEntry::read)
            .take_while(|entry| entry.entry_type != 0)
    }
}

/// One error or event (20 octets), as in a StatusResponse and in the error history 0x1003.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct ErrorEntry {
    /// 0x8000 status entry, else history entry; 0x4000 also for the emergency queue; 0x3000 mode (0x1000 active,
    /// 0x2000 cleared, 0x3000 occurred); 0x0FFF profile (1 vendor, 2 DS 301, else CiA profile number).
    pub entry_type: u16,
    /// Error code; its meaning depends on the profile.
    pub code: u16,
    /// When it happened.
    pub time: NetTime,
    /// Additional information, by the maker of the device or the profile.
    pub info: [u8; 8],
}

impl ErrorEntry {
    /// Reads 20 octets; the caller has checked the length.
    fn read(octets: &[u8]) -> ErrorEntry {
        ErrorEntry {
            entry_type: u16_at(octets, 0),
            code: u16_at(octets, 2),
            time: NetTime {
                seconds: u32_at(octets, 4),
                nanoseconds: u32_at(octets, 8),
            },
            info: array(octets, 12),
        }
    }

    /// The 20 octets of this entry.
    pub fn to_octets(&self) -> [u8; ERROR_ENTRY_LEN] {
        let mut octets = [0; ERROR_ENTRY_LEN];
        put(&mut octets, 0, self.entry_type.to_le_bytes());
        put(&mut octets, 2, self.code.to_le_bytes());
        put(&mut octets, 4, self.time.seconds.to_le_bytes());
        put(&mut octets, 8, self.time.nanoseconds.to_le_bytes());
        put(&mut octets, 12, self.info);
        octets
    }
}
