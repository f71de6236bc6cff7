//! The state machine of a managing node.

use super::state::{NmtState, Reset};

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

/// State machine of the managing node (DS 301 ch. 7.1; state in 0x1F8C): the state `event` leads to from `state`, `None` where
/// it means nothing.
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
