//! Network management: states, commands and the state machines of CN and MN as pure functions.
//!
//! In:  the state a node is in and what happened to it.
//! Out: the state it goes to, or `None` where the event means nothing in that state.
//! RT: no allocation, no locks, bounded.

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

/// NMT command id of an ASnd NMTCommand or NMTRequest. The extended forms address the nodes of a [`NodeList`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the names are the standard's")]
pub enum NmtCommand {
    /// Only in an NMTRequest: the MN shall send an IdentRequest to the target.
    IdentRequest,
    /// Only in an NMTRequest: the MN shall send a StatusRequest to the target.
    StatusRequest,
    StartNode,
    StopNode,
    EnterPreOperational2,
    EnableReadyToOperate,
    ResetNode,
    ResetCommunication,
    ResetConfiguration,
    SwReset,
    GoToStandby,
    StartNodeEx,
    StopNodeEx,
    EnterPreOperational2Ex,
    EnableReadyToOperateEx,
    ResetNodeEx,
    ResetCommunicationEx,
    ResetConfigurationEx,
    SwResetEx,
    NetHostNameSet,
    FlushArpEntry,
    PublishConfiguredNodes,
    PublishActiveNodes,
    PublishPreOperational1,
    PublishPreOperational2,
    PublishReadyToOperate,
    PublishOperational,
    PublishStopped,
    PublishNodeStates,
    PublishEmergencyNew,
    PublishTime,
    /// The answer of the MN to a request it does not serve; the data hold the id that was asked for.
    InvalidService,
    /// An id the standard does not define.
    Unknown(u8),
}

/// (octet, command): the ids of the standard, one a line.
const COMMANDS: [(u8, NmtCommand); 32] = [
    (0x01, NmtCommand::IdentRequest),
    (0x02, NmtCommand::StatusRequest),
    (0x21, NmtCommand::StartNode),
    (0x22, NmtCommand::StopNode),
    (0x23, NmtCommand::EnterPreOperational2),
    (0x24, NmtCommand::EnableReadyToOperate),
    (0x28, NmtCommand::ResetNode),
    (0x29, NmtCommand::ResetCommunication),
    (0x2A, NmtCommand::ResetConfiguration),
    (0x2B, NmtCommand::SwReset),
    (0x2C, NmtCommand::GoToStandby),
    (0x41, NmtCommand::StartNodeEx),
    (0x42, NmtCommand::StopNodeEx),
    (0x43, NmtCommand::EnterPreOperational2Ex),
    (0x44, NmtCommand::EnableReadyToOperateEx),
    (0x48, NmtCommand::ResetNodeEx),
    (0x49, NmtCommand::ResetCommunicationEx),
    (0x4A, NmtCommand::ResetConfigurationEx),
    (0x4B, NmtCommand::SwResetEx),
    (0x62, NmtCommand::NetHostNameSet),
    (0x63, NmtCommand::FlushArpEntry),
    (0x80, NmtCommand::PublishConfiguredNodes),
    (0x90, NmtCommand::PublishActiveNodes),
    (0x91, NmtCommand::PublishPreOperational1),
    (0x92, NmtCommand::PublishPreOperational2),
    (0x93, NmtCommand::PublishReadyToOperate),
    (0x94, NmtCommand::PublishOperational),
    (0x95, NmtCommand::PublishStopped),
    (0x96, NmtCommand::PublishNodeStates),
    (0xA0, NmtCommand::PublishEmergencyNew),
    (0xB0, NmtCommand::PublishTime),
    (0xFF, NmtCommand::InvalidService),
];

impl From<u8> for NmtCommand {
    fn from(octet: u8) -> Self {
        COMMANDS
            .iter()
            .find(|(id, _)| *id == octet)
            .map_or(NmtCommand::Unknown(octet), |(_, command)| *command)
    }
}

impl From<NmtCommand> for u8 {
    fn from(command: NmtCommand) -> u8 {
        if let NmtCommand::Unknown(octet) = command {
            return octet;
        }
        // The table holds every other command (a test walks all octets), so InvalidService is never made up here.
        COMMANDS
            .iter()
            .find(|(_, entry)| *entry == command)
            .map_or(0xFF, |(id, _)| *id)
    }
}

impl NmtCommand {
    /// The plain command an extended one carries to each node of its list; `None` for all others.
    pub fn plain(self) -> Option<NmtCommand> {
        let octet = u8::from(self);
        match octet {
            0x41..=0x4B => match NmtCommand::from(octet - 0x20) {
                NmtCommand::Unknown(_) => None,
                command => Some(command),
            },
            _ => None,
        }
    }

    /// The extended form of a plain command that changes the state of nodes; `None` for all others.
    pub fn extended(self) -> Option<NmtCommand> {
        let octet = u8::from(self);
        match octet {
            0x21..=0x2B => Some(NmtCommand::from(octet + 0x20)).filter(|extended| extended.plain() == Some(self)),
            _ => None,
        }
    }

    /// What this command asks of a CN's state machine, extended forms included (whether the node is on the list is
    /// for the caller to check); `None` for commands that are no state change.
    pub fn cn_event(self) -> Option<CnEvent> {
        match self.plain().unwrap_or(self) {
            NmtCommand::StartNode => Some(CnEvent::StartNode),
            NmtCommand::StopNode => Some(CnEvent::StopNode),
            NmtCommand::EnterPreOperational2 => Some(CnEvent::EnterPreOperational2),
            NmtCommand::EnableReadyToOperate => Some(CnEvent::ReadyToOperate),
            NmtCommand::ResetNode => Some(CnEvent::Reset(Reset::Node)),
            NmtCommand::ResetCommunication => Some(CnEvent::Reset(Reset::Communication)),
            NmtCommand::ResetConfiguration => Some(CnEvent::Reset(Reset::Configuration)),
            NmtCommand::SwReset => Some(CnEvent::Reset(Reset::Software)),
            NmtCommand::IdentRequest
            | NmtCommand::StatusRequest
            | NmtCommand::GoToStandby
            | NmtCommand::StartNodeEx
            | NmtCommand::StopNodeEx
            | NmtCommand::EnterPreOperational2Ex
            | NmtCommand::EnableReadyToOperateEx
            | NmtCommand::ResetNodeEx
            | NmtCommand::ResetCommunicationEx
            | NmtCommand::ResetConfigurationEx
            | NmtCommand::SwResetEx
            | NmtCommand::NetHostNameSet
            | NmtCommand::FlushArpEntry
            | NmtCommand::PublishConfiguredNodes
            | NmtCommand::PublishActiveNodes
            | NmtCommand::PublishPreOperational1
            | NmtCommand::PublishPreOperational2
            | NmtCommand::PublishReadyToOperate
            | NmtCommand::PublishOperational
            | NmtCommand::PublishStopped
            | NmtCommand::PublishNodeStates
            | NmtCommand::PublishEmergencyNew
            | NmtCommand::PublishTime
            | NmtCommand::InvalidService
            | NmtCommand::Unknown(_) => None,
        }
    }
}

/// Set of node ids as the extended NMT commands send it: bit (n mod 8) of octet (n div 8) is node n.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct NodeList(pub [u8; 32]);

impl NodeList {
    /// Adds a node.
    pub fn insert(&mut self, node: u8) {
        self.0[usize::from(node / 8)] |= 1 << (node % 8);
    }

    /// Whether the node is in the list.
    pub fn contains(&self, node: u8) -> bool {
        self.0[usize::from(node / 8)] & (1 << (node % 8)) != 0
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

/// The next step of the reset cascade, which runs through without waiting; `None` outside of it.
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

/// What can change the state of a controlled node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CnEvent {
    /// A SoC arrived.
    Soc,
    /// A SoA arrived.
    Soa,
    /// A PReq or a PRes arrived.
    PollFrame,
    /// No POWERLINK frame for the time of object 0x1F99.
    BasicEthernetTimeout,
    /// EnableReadyToOperate arrived and the application is configured; the caller brings both together.
    ReadyToOperate,
    /// NMT command StartNode.
    StartNode,
    /// NMT command StopNode.
    StopNode,
    /// NMT command EnterPreOperational2.
    EnterPreOperational2,
    /// A threshold of the data link layer error counters was reached (objects 0x1C0B..0x1C0F).
    CycleError,
    /// One of the four reset commands.
    Reset(Reset),
}

impl CnEvent {
    /// All of them, once each.
    pub const ALL: [CnEvent; 13] = [
        CnEvent::Soc,
        CnEvent::Soa,
        CnEvent::PollFrame,
        CnEvent::BasicEthernetTimeout,
        CnEvent::ReadyToOperate,
        CnEvent::StartNode,
        CnEvent::StopNode,
        CnEvent::EnterPreOperational2,
        CnEvent::CycleError,
        CnEvent::Reset(Reset::Software),
        CnEvent::Reset(Reset::Node),
        CnEvent::Reset(Reset::Communication),
        CnEvent::Reset(Reset::Configuration),
    ];
}

/// State machine of a controlled node: the state `event` leads to from `state`, `None` where it means nothing.
/// RT: no allocation, no locks, bounded.
pub fn cn_next(state: NmtState, event: CnEvent) -> Option<NmtState> {
    use CnEvent as E;
    use NmtState as S;
    match (state, event) {
        (
            S::NotActive
            | S::BasicEthernet
            | S::PreOperational1
            | S::PreOperational2
            | S::ReadyToOperate
            | S::Operational
            | S::Stopped,
            E::Reset(reset),
        ) => Some(reset.entry()),

        (S::NotActive, E::Soc | E::Soa) => Some(S::PreOperational1),
        (S::NotActive, E::BasicEthernetTimeout) => Some(S::BasicEthernet),
        (S::BasicEthernet, E::Soc | E::Soa | E::PollFrame) => Some(S::PreOperational1),
        (S::PreOperational1, E::Soc) => Some(S::PreOperational2),
        (S::PreOperational2, E::ReadyToOperate) => Some(S::ReadyToOperate),
        (S::ReadyToOperate, E::StartNode) => Some(S::Operational),
        (S::PreOperational2 | S::ReadyToOperate | S::Operational, E::StopNode) => Some(S::Stopped),
        (S::Operational | S::Stopped, E::EnterPreOperational2) => Some(S::PreOperational2),
        (S::PreOperational2 | S::ReadyToOperate | S::Operational | S::Stopped, E::CycleError) => {
            Some(S::PreOperational1)
        }

        (
            S::NotActive,
            E::PollFrame | E::ReadyToOperate | E::StartNode | E::StopNode | E::EnterPreOperational2 | E::CycleError,
        )
        | (
            S::BasicEthernet,
            E::BasicEthernetTimeout
            | E::ReadyToOperate
            | E::StartNode
            | E::StopNode
            | E::EnterPreOperational2
            | E::CycleError,
        )
        | (
            S::PreOperational1,
            E::Soa
            | E::PollFrame
            | E::BasicEthernetTimeout
            | E::ReadyToOperate
            | E::StartNode
            | E::StopNode
            | E::EnterPreOperational2
            | E::CycleError,
        )
        | (
            S::PreOperational2,
            E::Soc | E::Soa | E::PollFrame | E::BasicEthernetTimeout | E::StartNode | E::EnterPreOperational2,
        )
        | (
            S::ReadyToOperate,
            E::Soc | E::Soa | E::PollFrame | E::BasicEthernetTimeout | E::ReadyToOperate | E::EnterPreOperational2,
        )
        | (
            S::Operational,
            E::Soc | E::Soa | E::PollFrame | E::BasicEthernetTimeout | E::ReadyToOperate | E::StartNode,
        )
        | (
            S::Stopped,
            E::Soc | E::Soa | E::PollFrame | E::BasicEthernetTimeout | E::ReadyToOperate | E::StartNode | E::StopNode,
        )
        // The cascade runs through by itself, see `cascade`.
        | (
            S::Off
            | S::Initialising
            | S::ResetApplication
            | S::ResetCommunication
            | S::ResetConfiguration
            | S::Unknown(_),
            E::Soc
            | E::Soa
            | E::PollFrame
            | E::BasicEthernetTimeout
            | E::ReadyToOperate
            | E::StartNode
            | E::StopNode
            | E::EnterPreOperational2
            | E::CycleError
            | E::Reset(_),
        ) => None,
    }
}

/// What can change the state of the managing node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MnTrigger {
    /// MNWaitNotAct (object 0x1F89/1) passed and no other managing node was heard.
    ListenOver,
    /// The same, where the managing node shall be an ordinary Ethernet station (object 0x1F80, bit 13).
    ListenOverBasicEthernet,
    /// Every mandatory node is identified and checked, and MNWaitPreOp1 (0x1F89/3) has passed.
    MandatoryIdentified,
    /// Every mandatory node holds its configuration.
    MandatoryConfigured,
    /// Every mandatory node is READY_TO_OPERATE and its PRes came without error.
    MandatoryReady,
    /// A mandatory node was lost and the application wants the network booted again (object 0x1F80, bit 12 clear).
    MandatoryLost,
    /// A threshold of the MN's own cycle errors was reached and the application wants the network booted again.
    CycleError,
    /// A reset of the MN itself.
    Reset(Reset),
}

impl MnTrigger {
    /// All of them, once each.
    pub const ALL: [MnTrigger; 11] = [
        MnTrigger::ListenOver,
        MnTrigger::ListenOverBasicEthernet,
        MnTrigger::MandatoryIdentified,
        MnTrigger::MandatoryConfigured,
        MnTrigger::MandatoryReady,
        MnTrigger::MandatoryLost,
        MnTrigger::CycleError,
        MnTrigger::Reset(Reset::Software),
        MnTrigger::Reset(Reset::Node),
        MnTrigger::Reset(Reset::Communication),
        MnTrigger::Reset(Reset::Configuration),
    ];
}

/// State machine of the managing node: the state `event` leads to from `state`, `None` where it means nothing.
/// RT: no allocation, no locks, bounded.
pub fn mn_next(state: NmtState, event: MnTrigger) -> Option<NmtState> {
    use MnTrigger as E;
    use NmtState as S;
    match (state, event) {
        (
            S::NotActive
            | S::BasicEthernet
            | S::PreOperational1
            | S::PreOperational2
            | S::ReadyToOperate
            | S::Operational,
            E::Reset(reset),
        ) => Some(reset.entry()),

        (S::NotActive, E::ListenOver) => Some(S::PreOperational1),
        (S::NotActive, E::ListenOverBasicEthernet) => Some(S::BasicEthernet),
        (S::PreOperational1, E::MandatoryIdentified) => Some(S::PreOperational2),
        (S::PreOperational2, E::MandatoryConfigured) => Some(S::ReadyToOperate),
        (S::ReadyToOperate, E::MandatoryReady) => Some(S::Operational),
        (S::Operational, E::MandatoryLost) => Some(S::PreOperational1),
        (S::PreOperational2 | S::ReadyToOperate | S::Operational, E::CycleError) => Some(S::PreOperational1),

        (
            S::NotActive,
            E::MandatoryIdentified | E::MandatoryConfigured | E::MandatoryReady | E::MandatoryLost | E::CycleError,
        )
        | (
            S::PreOperational1,
            E::ListenOver | E::ListenOverBasicEthernet | E::MandatoryConfigured | E::MandatoryReady | E::MandatoryLost | E::CycleError,
        )
        | (S::PreOperational2, E::ListenOver | E::ListenOverBasicEthernet | E::MandatoryIdentified | E::MandatoryReady | E::MandatoryLost)
        | (S::ReadyToOperate, E::ListenOver | E::ListenOverBasicEthernet | E::MandatoryIdentified | E::MandatoryConfigured | E::MandatoryLost)
        | (S::Operational, E::ListenOver | E::ListenOverBasicEthernet | E::MandatoryIdentified | E::MandatoryConfigured | E::MandatoryReady)
        | (
            S::BasicEthernet,
            E::ListenOver
            | E::ListenOverBasicEthernet
            | E::MandatoryIdentified
            | E::MandatoryConfigured
            | E::MandatoryReady
            | E::MandatoryLost
            | E::CycleError,
        )
        // STOPPED is a state of controlled nodes only.
        | (
            S::Off
            | S::Initialising
            | S::ResetApplication
            | S::ResetCommunication
            | S::ResetConfiguration
            | S::Stopped
            | S::Unknown(_),
            E::ListenOver
            | E::ListenOverBasicEthernet
            | E::MandatoryIdentified
            | E::MandatoryConfigured
            | E::MandatoryReady
            | E::MandatoryLost
            | E::CycleError
            | E::Reset(_),
        ) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_octet_of_state_and_command_survives() {
        for octet in 0..=u8::MAX {
            assert_eq!(u8::from(NmtState::from(octet)), octet);
            assert_eq!(u8::from(NmtCommand::from(octet)), octet);
        }
        let named = (0..=u8::MAX)
            .filter(|octet| !matches!(NmtState::from(*octet), NmtState::Unknown(_)))
            .count();
        assert_eq!(named, NmtState::ALL.len());
    }

    #[test]
    fn octets_as_seen_on_the_wire() {
        // openpowerlink-mn-3cn-10ms.pcap, frames 1 (SoA), 964 (PRes), 12 (NMTCommand ResetNode).
        assert_eq!(NmtState::from(0x1D), NmtState::PreOperational1);
        assert_eq!(NmtState::from(0x5D), NmtState::PreOperational2);
        assert_eq!(NmtCommand::from(0x28), NmtCommand::ResetNode);
    }

    #[test]
    fn extended_commands_carry_their_plain_ones() {
        for octet in 0..=u8::MAX {
            let command = NmtCommand::from(octet);
            match command.plain() {
                Some(plain) => assert_eq!(plain.extended(), Some(command)),
                None => assert!(
                    command
                        .extended()
                        .is_none_or(|extended| extended.plain() == Some(command))
                ),
            }
        }
        assert_eq!(NmtCommand::GoToStandby.extended(), None);
        assert_eq!(NmtCommand::StartNodeEx.plain(), Some(NmtCommand::StartNode));
        assert_eq!(NmtCommand::SwResetEx.plain(), Some(NmtCommand::SwReset));
        assert_eq!(NmtCommand::StartNode.plain(), None);
        assert_eq!(NmtCommand::Unknown(0x45).plain(), None);
        let with_event = (0..=u8::MAX)
            .filter(|octet| NmtCommand::from(*octet).cn_event().is_some())
            .count();
        assert_eq!(with_event, 16, "eight plain and eight extended");
    }

    #[test]
    fn node_list_bits() {
        let mut list = NodeList::default();
        list.insert(1);
        list.insert(32);
        list.insert(110);
        assert_eq!((list.0[0], list.0[4], list.0[13]), (0x02, 0x01, 0x40));
        let found = (0..=u8::MAX).filter(|node| list.contains(*node)).count();
        assert_eq!(found, 3);
    }

    #[test]
    fn the_cascade_ends_in_not_active() {
        for (reset, steps) in [
            (Reset::Software, 4),
            (Reset::Node, 3),
            (Reset::Communication, 2),
            (Reset::Configuration, 1),
        ] {
            let mut state = reset.entry();
            for _ in 0..steps {
                state = cascade(state).unwrap();
            }
            assert_eq!(state, NmtState::NotActive);
            assert_eq!(cascade(state), None);
        }
    }

    /// The table of the standard, written out a second time as data: all pairs not listed change nothing.
    #[test]
    fn cn_transitions_are_exactly_those_of_the_table() {
        use NmtState::*;
        let mut table = std::vec![
            (NotActive, CnEvent::Soc, PreOperational1),
            (NotActive, CnEvent::Soa, PreOperational1),
            (NotActive, CnEvent::BasicEthernetTimeout, BasicEthernet),
            (BasicEthernet, CnEvent::Soc, PreOperational1),
            (BasicEthernet, CnEvent::Soa, PreOperational1),
            (BasicEthernet, CnEvent::PollFrame, PreOperational1),
            (PreOperational1, CnEvent::Soc, PreOperational2),
            (PreOperational2, CnEvent::ReadyToOperate, ReadyToOperate),
            (ReadyToOperate, CnEvent::StartNode, Operational),
            (PreOperational2, CnEvent::StopNode, Stopped),
            (ReadyToOperate, CnEvent::StopNode, Stopped),
            (Operational, CnEvent::StopNode, Stopped),
            (Operational, CnEvent::EnterPreOperational2, PreOperational2),
            (Stopped, CnEvent::EnterPreOperational2, PreOperational2),
            (PreOperational2, CnEvent::CycleError, PreOperational1),
            (ReadyToOperate, CnEvent::CycleError, PreOperational1),
            (Operational, CnEvent::CycleError, PreOperational1),
            (Stopped, CnEvent::CycleError, PreOperational1),
        ];
        for state in [
            NotActive,
            BasicEthernet,
            PreOperational1,
            PreOperational2,
            ReadyToOperate,
            Operational,
            Stopped,
        ] {
            for reset in Reset::ALL {
                table.push((state, CnEvent::Reset(reset), reset.entry()));
            }
        }
        let states = NmtState::ALL.into_iter().chain([Unknown(0x77)]);
        for state in states {
            for event in CnEvent::ALL {
                let expected = table
                    .iter()
                    .find(|row| row.0 == state && row.1 == event)
                    .map(|row| row.2);
                assert_eq!(cn_next(state, event), expected, "{state:?} on {event:?}");
            }
        }
    }

    #[test]
    fn mn_transitions_are_exactly_those_of_the_table() {
        use NmtState::*;
        let mut table = std::vec![
            (NotActive, MnTrigger::ListenOver, PreOperational1),
            (NotActive, MnTrigger::ListenOverBasicEthernet, BasicEthernet),
            (PreOperational1, MnTrigger::MandatoryIdentified, PreOperational2),
            (PreOperational2, MnTrigger::MandatoryConfigured, ReadyToOperate),
            (ReadyToOperate, MnTrigger::MandatoryReady, Operational),
            (Operational, MnTrigger::MandatoryLost, PreOperational1),
            (PreOperational2, MnTrigger::CycleError, PreOperational1),
            (ReadyToOperate, MnTrigger::CycleError, PreOperational1),
            (Operational, MnTrigger::CycleError, PreOperational1),
        ];
        for state in [
            NotActive,
            BasicEthernet,
            PreOperational1,
            PreOperational2,
            ReadyToOperate,
            Operational,
        ] {
            for reset in Reset::ALL {
                table.push((state, MnTrigger::Reset(reset), reset.entry()));
            }
        }
        for state in NmtState::ALL.into_iter().chain([Unknown(0x77)]) {
            for event in MnTrigger::ALL {
                let expected = table
                    .iter()
                    .find(|row| row.0 == state && row.1 == event)
                    .map(|row| row.2);
                assert_eq!(mn_next(state, event), expected, "{state:?} on {event:?}");
            }
        }
    }
}
