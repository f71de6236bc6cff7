//! The state machine of a controlled node.

use super::state::{NmtState, Reset};

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

/// State machine of a controlled node (DS 301 ch. 7.1; state in 0x1F8C): the state `event` leads to from `state`, `None` where
/// it means nothing.
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
