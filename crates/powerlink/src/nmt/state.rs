//! The NMT states and their octets, and the resets that both kinds of nodes run through.

use core::fmt;

/// NMT state of a node as sent in one octet (object 0x1F8C).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NmtState {
    /// GS_OFF: not powered, or not started.
    Off,
    /// GS_INITIALISING: first step of the reset cascade (SwReset).
    Initialising,
    /// GS_RESET_APPLICATION: manufacturer and profile objects take their stored values (ResetNode).
    ResetApplication,
    /// GS_RESET_COMMUNICATION: communication objects take their stored values (ResetCommunication).
    ResetCommunication,
    /// GS_RESET_CONFIGURATION: the configuration in the object dictionary is made active (ResetConfiguration).
    ResetConfiguration,
    /// NOT_ACTIVE: listens only.
    NotActive,
    /// BASIC_ETHERNET: no managing node is there; ordinary Ethernet traffic is allowed.
    BasicEthernet,
    /// PRE_OPERATIONAL_1: reduced cycle, asynchronous traffic only.
    PreOperational1,
    /// PRE_OPERATIONAL_2: isochronous cycle runs, nodes are configured, process data are not valid.
    PreOperational2,
    /// READY_TO_OPERATE: configured; process data are exchanged but not valid.
    ReadyToOperate,
    /// OPERATIONAL: process data are valid.
    Operational,
    /// STOPPED (CN only): no process data.
    Stopped,
    /// An octet the standard does not define.
    Unknown(u8),
}

impl fmt::Display for NmtState {
    /// The name that the standard gives it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NmtState::Off => "OFF",
            NmtState::Initialising => "INITIALISING",
            NmtState::ResetApplication => "RESET_APPLICATION",
            NmtState::ResetCommunication => "RESET_COMMUNICATION",
            NmtState::ResetConfiguration => "RESET_CONFIGURATION",
            NmtState::NotActive => "NOT_ACTIVE",
            NmtState::BasicEthernet => "BASIC_ETHERNET",
            NmtState::PreOperational1 => "PRE_OPERATIONAL_1",
            NmtState::PreOperational2 => "PRE_OPERATIONAL_2",
            NmtState::ReadyToOperate => "READY_TO_OPERATE",
            NmtState::Operational => "OPERATIONAL",
            NmtState::Stopped => "STOPPED",
            NmtState::Unknown(octet) => return write!(f, "unknown state 0x{octet:02X}"),
        })
    }
}

impl NmtState {
    /// Every state the standard names, in the order of the enum.
    pub const ALL: [NmtState; 12] = [
        NmtState::Off,
        NmtState::Initialising,
        NmtState::ResetApplication,
        NmtState::ResetCommunication,
        NmtState::ResetConfiguration,
        NmtState::NotActive,
        NmtState::BasicEthernet,
        NmtState::PreOperational1,
        NmtState::PreOperational2,
        NmtState::ReadyToOperate,
        NmtState::Operational,
        NmtState::Stopped,
    ];

    /// PReq and PRes are exchanged with a node in this state.
    pub fn is_isochronous(self) -> bool {
        match self {
            NmtState::PreOperational2 | NmtState::ReadyToOperate | NmtState::Operational => true,
            NmtState::Off
            | NmtState::Initialising
            | NmtState::ResetApplication
            | NmtState::ResetCommunication
            | NmtState::ResetConfiguration
            | NmtState::NotActive
            | NmtState::BasicEthernet
            | NmtState::PreOperational1
            | NmtState::Stopped
            | NmtState::Unknown(_) => false,
        }
    }
}

impl From<u8> for NmtState {
    fn from(octet: u8) -> Self {
        match octet {
            0x00 => NmtState::Off,
            0x19 => NmtState::Initialising,
            0x29 => NmtState::ResetApplication,
            0x39 => NmtState::ResetCommunication,
            0x79 => NmtState::ResetConfiguration,
            0x1C => NmtState::NotActive,
            0x1E => NmtState::BasicEthernet,
            0x1D => NmtState::PreOperational1,
            0x5D => NmtState::PreOperational2,
            0x6D => NmtState::ReadyToOperate,
            0xFD => NmtState::Operational,
            0x4D => NmtState::Stopped,
            other => NmtState::Unknown(other),
        }
    }
}

impl From<NmtState> for u8 {
    fn from(state: NmtState) -> u8 {
        match state {
            NmtState::Off => 0x00,
            NmtState::Initialising => 0x19,
            NmtState::ResetApplication => 0x29,
            NmtState::ResetCommunication => 0x39,
            NmtState::ResetConfiguration => 0x79,
            NmtState::NotActive => 0x1C,
            NmtState::BasicEthernet => 0x1E,
            NmtState::PreOperational1 => 0x1D,
            NmtState::PreOperational2 => 0x5D,
            NmtState::ReadyToOperate => 0x6D,
            NmtState::Operational => 0xFD,
            NmtState::Stopped => 0x4D,
            NmtState::Unknown(octet) => octet,
        }
    }
}

/// Depth at which a node enters the reset cascade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// SwReset: all objects.
    Software,
    /// ResetNode: application and communication.
    Node,
    /// ResetCommunication, or an internal communication error.
    Communication,
    /// ResetConfiguration: the configuration just written becomes active.
    Configuration,
}

impl Reset {
    /// Every depth, deepest first.
    pub const ALL: [Reset; 4] = [Reset::Software, Reset::Node, Reset::Communication, Reset::Configuration];

    /// Where the cascade is entered.
    pub fn entry(self) -> NmtState {
        match self {
            Reset::Software => NmtState::Initialising,
            Reset::Node => NmtState::ResetApplication,
            Reset::Communication => NmtState::ResetCommunication,
            Reset::Configuration => NmtState::ResetConfiguration,
        }
    }
}

/// The next step of the reset cascade (DS 301 ch. 7.1), which runs through without waiting; `None` outside of it.
pub fn cascade(state: NmtState) -> Option<NmtState> {
    match state {
        NmtState::Initialising => Some(NmtState::ResetApplication),
        NmtState::ResetApplication => Some(NmtState::ResetCommunication),
        NmtState::ResetCommunication => Some(NmtState::ResetConfiguration),
        NmtState::ResetConfiguration => Some(NmtState::NotActive),
        NmtState::Off
        | NmtState::NotActive
        | NmtState::BasicEthernet
        | NmtState::PreOperational1
        | NmtState::PreOperational2
        | NmtState::ReadyToOperate
        | NmtState::Operational
        | NmtState::Stopped
        | NmtState::Unknown(_) => None,
    }
}
