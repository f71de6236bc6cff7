//! NMT commands and their octets, and the list of nodes that an extended one is for.

use super::controlled_node::CnEvent;
use super::state::Reset;

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

/// (octet, command): the ids of the standard (DS 301 ch. 7.3.1), one a line.
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
