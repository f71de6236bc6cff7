//! SyncRequest and SyncResponse: how the managing node sets up PRes chaining (EPSG DS 302-C).
//!
//! With PRes chaining a node is not polled: it sends its PRes at a set time after the end of the managing node's own PRes.
//! The managing node measures the delays with SyncRequests, computes that time and sets it with another one.

use super::header::{Mac, SOA_LEN, WireError, array, check_len, put, u32_at};

/// Octets of a SyncResponse before padding.
pub const SYNC_RESPONSE_LEN: usize = 44;
/// Where the SyncRequest area of a SoA starts.
const REQUEST_AT: usize = 24;

/// Bits of SyncControl.
mod control {
    pub(super) const PRES_TIME_FIRST: u32 = 1;
    pub(super) const PRES_TIME_SECOND: u32 = 1 << 1;
    pub(super) const MN_DELAY_FIRST: u32 = 1 << 2;
    pub(super) const MN_DELAY_SECOND: u32 = 1 << 3;
    pub(super) const FALL_BACK_TIMEOUT: u32 = 1 << 4;
    pub(super) const DESTINATION: u32 = 1 << 5;
    pub(super) const MODE_RESET: u32 = 1 << 30;
    pub(super) const MODE_SET: u32 = 1 << 31;
}

/// Bits of SyncStatus.
mod status {
    pub(super) const PRES_TIME_FIRST: u32 = 1;
    pub(super) const PRES_TIME_SECOND: u32 = 1 << 1;
    pub(super) const MODE: u32 = 1 << 31;
}

/// SyncRequest (DS 302-C): the area of a SoA with `RequestedService::SyncRequest`. `None` is a field whose valid bit is clear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct SyncRequest {
    /// When the PRes is due after the end of the PResMN, over the first ring or line, in ns.
    pub pres_time_first_ns: Option<u32>,
    /// The same over the second, in ns.
    pub pres_time_second_ns: Option<u32>,
    /// Time from the managing node to this node, first, in ns.
    pub mn_delay_first_ns: Option<u32>,
    /// Time from the managing node to this node, second, in ns.
    pub mn_delay_second_ns: Option<u32>,
    /// How long the node goes on sending without a PResMN, in ns.
    pub fall_back_timeout_ns: Option<u32>,
    /// Only the node with this address is meant.
    pub destination: Option<Mac>,
    /// PResModeReset: the node is polled again.
    pub mode_reset: bool,
    /// PResModeSet: the node sends by time from now on.
    pub mode_set: bool,
}

impl SyncRequest {
    /// Reads the area of a SoA; a SoA that ends before it says nothing.
    pub(super) fn read(frame: &[u8]) -> SyncRequest {
        if frame.len() < SOA_LEN {
            return SyncRequest::default();
        }
        let bits = u32_at(frame, REQUEST_AT);
        let time = |bit, at| (bits & bit != 0).then(|| u32_at(frame, at));
        SyncRequest {
            pres_time_first_ns: time(control::PRES_TIME_FIRST, REQUEST_AT + 4),
            pres_time_second_ns: time(control::PRES_TIME_SECOND, REQUEST_AT + 8),
            mn_delay_first_ns: time(control::MN_DELAY_FIRST, REQUEST_AT + 12),
            mn_delay_second_ns: time(control::MN_DELAY_SECOND, REQUEST_AT + 16),
            fall_back_timeout_ns: time(control::FALL_BACK_TIMEOUT, REQUEST_AT + 20),
            destination: (bits & control::DESTINATION != 0).then(|| array(frame, REQUEST_AT + 24)),
            mode_reset: bits & control::MODE_RESET != 0,
            mode_set: bits & control::MODE_SET != 0,
        }
    }

    /// Writes the area of a SoA that is zero so far.
    pub(super) fn write(&self, frame: &mut [u8]) {
        let mut bits = 0;
        let times = [
            (self.pres_time_first_ns, control::PRES_TIME_FIRST),
            (self.pres_time_second_ns, control::PRES_TIME_SECOND),
            (self.mn_delay_first_ns, control::MN_DELAY_FIRST),
            (self.mn_delay_second_ns, control::MN_DELAY_SECOND),
            (self.fall_back_timeout_ns, control::FALL_BACK_TIMEOUT),
        ];
        for (position, (time_ns, bit)) in times.into_iter().enumerate() {
            if let Some(time_ns) = time_ns {
                bits |= bit;
                put(frame, REQUEST_AT + 4 + 4 * position, time_ns.to_le_bytes());
            }
        }
        if let Some(destination) = self.destination {
            bits |= control::DESTINATION;
            put(frame, REQUEST_AT + 24, destination);
        }
        if self.mode_reset {
            bits |= control::MODE_RESET;
        }
        if self.mode_set {
            bits |= control::MODE_SET;
        }
        put(frame, REQUEST_AT, bits.to_le_bytes());
    }
}

/// SyncResponse (DS 302-C): what a node measured and what is set in it, the answer to a SyncRequest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct SyncResponse {
    /// PResTimeFirstValid: a time is set.
    pub pres_time_first_valid: bool,
    /// PResTimeSecondValid: a time is set.
    pub pres_time_second_valid: bool,
    /// PResModeStatus: the node sends by time.
    pub mode_set: bool,
    /// How long the node takes from the end of a frame that asks for an answer to the start of that answer, in ns.
    pub latency_ns: u32,
    /// The other node whose SyncResponse was heard last, 0 where there was none.
    pub sync_node: u32,
    /// Time from the end of the SyncRequest to `sync_node` to the beginning of its SyncResponse, as heard by this node, in ns:
    /// the latency of `sync_node` and twice the way between the two.
    pub delay_ns: u32,
    /// The time that is set, in ns.
    pub pres_time_first_ns: u32,
    /// The time that is set, in ns.
    pub pres_time_second_ns: u32,
}

impl SyncResponse {
    pub(super) fn parse(frame: &[u8]) -> Result<SyncResponse, WireError> {
        check_len(frame, SYNC_RESPONSE_LEN)?;
        let bits = u32_at(frame, 20);
        Ok(SyncResponse {
            pres_time_first_valid: bits & status::PRES_TIME_FIRST != 0,
            pres_time_second_valid: bits & status::PRES_TIME_SECOND != 0,
            mode_set: bits & status::MODE != 0,
            latency_ns: u32_at(frame, 24),
            sync_node: u32_at(frame, 28),
            delay_ns: u32_at(frame, 32),
            pres_time_first_ns: u32_at(frame, 36),
            pres_time_second_ns: u32_at(frame, 40),
        })
    }

    pub(super) fn write(&self, frame: &mut [u8]) {
        let bit = |set: bool, bit: u32| if set { bit } else { 0 };
        let bits = bit(self.pres_time_first_valid, status::PRES_TIME_FIRST)
            | bit(self.pres_time_second_valid, status::PRES_TIME_SECOND)
            | bit(self.mode_set, status::MODE);
        put(frame, 20, bits.to_le_bytes());
        put(frame, 24, self.latency_ns.to_le_bytes());
        put(frame, 28, self.sync_node.to_le_bytes());
        put(frame, 32, self.delay_ns.to_le_bytes());
        put(frame, 36, self.pres_time_first_ns.to_le_bytes());
        put(frame, 40, self.pres_time_second_ns.to_le_bytes());
    }
}
