//! SoC and SoA: the two multicasts by which the managing node times the network.

use super::chaining::SyncRequest;
use super::header::{EPL_VERSION, Header, SOA_LEN, WireError, array, check_len, flag, message, put, start, u32_at};
use crate::nmt::NmtState;

/// Octets of a SoC before padding.
pub const SOC_LEN: usize = 36;
/// Octets of a SoA without the SyncRequest area, which older nodes may leave out.
const SOA_LEN_MIN: usize = 24;

/// NetTime: wall-clock time of the managing node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, PartialOrd, Ord)]
pub struct NetTime {
    /// Seconds since 1970-01-01.
    pub seconds: u32,
    /// Nanoseconds within the second.
    pub nanoseconds: u32,
}

/// Start of cycle (DS 301 ch. 4.6.1.1; period 0x1006).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Soc {
    /// MC: toggles when a round of multiplexed nodes is complete.
    pub multiplexed_cycle: bool,
    /// PS: toggles every `Prescaler` cycles (object 0x1F98/9).
    pub prescaled_slot: bool,
    /// Wall-clock time of the start of the cycle.
    pub net_time: NetTime,
    /// Time since the network was initialised; grows by the cycle length each cycle, in µs.
    pub relative_time_us: u64,
}

impl Soc {
    /// Reads an untrusted frame whose header has been checked; never panics.
    pub(super) fn parse(frame: &[u8]) -> Result<Soc, WireError> {
        check_len(frame, SOC_LEN)?;
        Ok(Soc {
            multiplexed_cycle: frame[18] & flag::MC != 0,
            prescaled_slot: frame[18] & flag::PS != 0,
            net_time: NetTime {
                seconds: u32_at(frame, 20),
                nanoseconds: u32_at(frame, 24),
            },
            relative_time_us: u64::from_le_bytes(array(frame, 28)),
        })
    }

    /// Writes the frame; returns its length, 60.
    ///
    /// # Errors
    /// [`WireError::NoRoom`] in a buffer that is too short.
    pub fn emit(&self, header: &Header, buffer: &mut [u8]) -> Result<usize, WireError> {
        let frame = start(header, message::SOC, SOC_LEN, buffer)?;
        frame[18] = flag::bit(self.multiplexed_cycle, flag::MC) | flag::bit(self.prescaled_slot, flag::PS);
        put(frame, 20, self.net_time.seconds.to_le_bytes());
        put(frame, 24, self.net_time.nanoseconds.to_le_bytes());
        put(frame, 28, self.relative_time_us.to_le_bytes());
        Ok(frame.len())
    }
}

/// RequestedServiceID: what the SoA invites its target to send.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RequestedService {
    /// No node may send in the slot.
    NoService,
    /// The node answers with an IdentResponse.
    IdentRequest,
    /// The node answers with a StatusResponse.
    StatusRequest,
    /// NMTRequest; or NMTCommand, where the target is the managing node itself.
    NmtRequestInvite,
    /// The node answers with a SyncResponse.
    SyncRequest,
    /// Any generic ASnd, such as SDO.
    UnspecifiedInvite,
    /// A value the standard does not define, or a manufacturer's.
    Unknown(u8),
}

impl From<u8> for RequestedService {
    fn from(octet: u8) -> Self {
        match octet {
            0x00 => RequestedService::NoService,
            0x01 => RequestedService::IdentRequest,
            0x02 => RequestedService::StatusRequest,
            0x03 => RequestedService::NmtRequestInvite,
            0x06 => RequestedService::SyncRequest,
            0xFF => RequestedService::UnspecifiedInvite,
            other => RequestedService::Unknown(other),
        }
    }
}

impl From<RequestedService> for u8 {
    fn from(service: RequestedService) -> u8 {
        match service {
            RequestedService::NoService => 0x00,
            RequestedService::IdentRequest => 0x01,
            RequestedService::StatusRequest => 0x02,
            RequestedService::NmtRequestInvite => 0x03,
            RequestedService::SyncRequest => 0x06,
            RequestedService::UnspecifiedInvite => 0xFF,
            RequestedService::Unknown(octet) => octet,
        }
    }
}

/// Start of asynchronous phase (DS 301 ch. 4.6.1.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Soa {
    /// State of the managing node.
    pub nmt_state: NmtState,
    /// EA: exception acknowledge, for the target of a StatusRequest.
    pub exception_acknowledge: bool,
    /// ER: exception reset, for the target of a StatusRequest.
    pub exception_reset: bool,
    /// Who may send: what.
    pub service: RequestedService,
    /// Who may send: node id; 0 with NoService.
    pub target: u8,
    /// Protocol version, 0x20.
    pub epl_version: u8,
    /// MR: a redundant managing node is active.
    pub redundancy_active: bool,
    /// What a [`RequestedService::SyncRequest`] says; read and sent with that service only, else the area is zero.
    pub sync: SyncRequest,
}

impl Soa {
    /// A SoA that grants the asynchronous slot to `target`, flags clear.
    pub fn new(nmt_state: NmtState, service: RequestedService, target: u8) -> Soa {
        Soa {
            nmt_state,
            exception_acknowledge: false,
            exception_reset: false,
            service,
            target,
            epl_version: EPL_VERSION,
            redundancy_active: false,
            sync: SyncRequest::default(),
        }
    }

    pub(super) fn parse(frame: &[u8]) -> Result<Soa, WireError> {
        check_len(frame, SOA_LEN_MIN)?;
        let service = RequestedService::from(frame[20]);
        Ok(Soa {
            nmt_state: NmtState::from(frame[17]),
            exception_acknowledge: frame[18] & flag::EA != 0,
            exception_reset: frame[18] & flag::ER != 0,
            service,
            target: frame[21],
            epl_version: frame[22],
            redundancy_active: frame[23] & flag::MR != 0,
            sync: if service == RequestedService::SyncRequest {
                SyncRequest::read(frame)
            } else {
                SyncRequest::default()
            },
        })
    }

    /// Writes the frame; returns its length, 60.
    ///
    /// # Errors
    /// [`WireError::NoRoom`] in a buffer that is too short.
    pub fn emit(&self, header: &Header, buffer: &mut [u8]) -> Result<usize, WireError> {
        let frame = start(header, message::SOA, SOA_LEN, buffer)?;
        frame[17] = self.nmt_state.into();
        frame[18] = flag::bit(self.exception_acknowledge, flag::EA) | flag::bit(self.exception_reset, flag::ER);
        frame[20] = self.service.into();
        frame[21] = self.target;
        frame[22] = self.epl_version;
        frame[23] = flag::bit(self.redundancy_active, flag::MR);
        if self.service == RequestedService::SyncRequest {
            self.sync.write(frame);
        }
        Ok(frame.len())
    }
}
