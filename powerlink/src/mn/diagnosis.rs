//! Diagnosis: what a node is, where its boot-up stands, and why it is not operational; the same of the network as a whole.
//!
//! In:  copies of fixed size that `reason` takes of the managing node. Out: words for people. Its clock counts from somewhere
//! that people do not see: times are in the copies only, for whoever knows what time it is.

use core::fmt;

use super::event::{ForeignSign, NodeState, NodeStatistics};
use super::fault::Fault;
use super::record::{ErrorLog, LastFault};
use super::stage::BootStage;
use super::startup::Assignment;
use crate::nmt::NmtState;
use crate::wire::IdentResponse;

/// Why a node is not operational.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The managing node does not look for nodes yet, or no longer.
    NetworkNotRunning {
        /// State of the managing node.
        state: NmtState,
    },
    /// It has answered no IdentRequest.
    NotAnswering {
        /// Since when it is looked for, in ns.
        since_ns: u64,
    },
    /// It was given up, was sent a ResetNode, and has not answered an IdentRequest since.
    GivenUp {
        /// Why.
        fault: Fault,
        /// When, in ns.
        since_ns: u64,
    },
    /// It must not go on as it is.
    Refused {
        /// Why.
        fault: Fault,
        /// When it is looked at again, in ns.
        again_ns: u64,
    },
    /// It is on its way, as the stage says.
    Booting {
        /// Where it stands.
        stage: BootStage,
    },
    /// It has done its part; the network has to go on first.
    WaitingForNetwork {
        /// State that the managing node has to reach.
        state: NmtState,
        /// The first mandatory node that holds the network; `None`: none does, see [`NetworkDiagnosis`].
        held_by: Option<u8>,
    },
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Reason::NetworkNotRunning { state } => {
                write!(f, "the managing node is in {state:?} and does not look for nodes")
            }
            Reason::NotAnswering { .. } => f.write_str("does not answer IdentRequests"),
            Reason::GivenUp { fault, .. } => write!(f, "{fault}; was reset and does not answer IdentRequests since"),
            Reason::Refused { fault, .. } => write!(f, "{fault}; tried again later"),
            Reason::Booting { stage } => write!(f, "{stage}"),
            Reason::WaitingForNetwork { state, held_by } => {
                write!(f, "waits for the network to be in {state:?}")?;
                match held_by {
                    Some(node) => write!(f, ", which mandatory node {node} holds back"),
                    None => Ok(()),
                }
            }
        }
    }
}

/// All that is known of one controlled node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// Node id.
    pub node: u8,
    /// What it is to the network.
    pub assignment: Assignment,
    /// State as the application sees it.
    pub state: NodeState,
    /// State it reported last; Off when nothing was heard since it is looked for.
    pub nmt_state: NmtState,
    /// State it should be in (0x1F8F).
    pub expected_nmt_state: NmtState,
    /// Where its boot-up stands.
    pub stage: BootStage,
    /// Why it is not operational; `None`: it is.
    pub reason: Option<Reason>,
    /// Its last IdentResponse: identity, software, configuration date, IP address, host name; and when it came, in ns. It is
    /// kept when the node is lost.
    pub ident: Option<(u64, IdentResponse)>,
    /// Why it was given up last; kept when it is up again.
    pub last_fault: Option<LastFault>,
    /// The last errors it signalled.
    pub errors: ErrorLog,
    /// Its figures.
    pub statistics: NodeStatistics,
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "node {}: ", self.node)?;
        match self.reason {
            Some(reason) => write!(f, "{reason}")?,
            None => f.write_str("operational")?,
        }
        match (self.reason, self.last_fault) {
            (Some(Reason::GivenUp { .. } | Reason::Refused { .. }), Some(LastFault { count, .. })) if count > 1 => {
                write!(f, " (the {count}. time)")
            }
            (Some(Reason::GivenUp { .. } | Reason::Refused { .. }), _) | (_, None) => Ok(()),
            (_, Some(LastFault { fault, count, .. })) => write!(f, " (last fault: {fault}; {count} in a row)"),
        }
    }
}

/// Why the network is not OPERATIONAL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkReason {
    /// NOT_ACTIVE: listening for another managing node.
    Listening {
        /// Until then, in ns, if nothing is heard.
        until_ns: u64,
    },
    /// NOT_ACTIVE, and another managing node was heard.
    ForeignMn(ForeignSign),
    /// The nodes are being woken and reset.
    Starting,
    /// PRE_OPERATIONAL_1 lasts at least that long (0x1F89/3).
    MinimumStay {
        /// End of the stay, in ns.
        until_ns: u64,
    },
    /// Mandatory nodes are not as far as the next state needs them.
    WaitingForNode {
        /// The next state.
        state: NmtState,
        /// The first of these nodes, in the order of the configuration.
        node: u8,
        /// Why it is not operational.
        why: Reason,
        /// How many nodes there are beside it.
        others: u32,
    },
    /// Everything is there for the next state.
    Due {
        /// The next state.
        state: NmtState,
        /// It is entered when the application says so (0x1F80 bits 7, 8, 2).
        by_application: bool,
    },
    /// The network is being taken down.
    ShuttingDown,
    /// The managing node takes no part in the network.
    NotRunning {
        /// Its state.
        state: NmtState,
    },
}

impl fmt::Display for NetworkReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            NetworkReason::Listening { .. } => f.write_str("listening for another managing node"),
            NetworkReason::ForeignMn(sign) => write!(f, "{sign}; silent until it has gone"),
            NetworkReason::Starting => f.write_str("waking and resetting the nodes"),
            NetworkReason::MinimumStay { .. } => {
                f.write_str("PRE_OPERATIONAL_1 has not lasted long enough (1F89h/03h)")
            }
            NetworkReason::WaitingForNode {
                state,
                node,
                why,
                others,
            } => {
                write!(f, "{state:?} waits for mandatory node {node}")?;
                match others {
                    0 => {}
                    1 => f.write_str(" and 1 other")?,
                    others => write!(f, " and {others} others")?,
                }
                write!(f, ": node {node} {why}")
            }
            NetworkReason::Due {
                state,
                by_application: true,
            } => write!(f, "{state:?} is next, when the application says so (1F80h)"),
            NetworkReason::Due { state, .. } => write!(f, "{state:?} is next"),
            NetworkReason::ShuttingDown => f.write_str("being taken down"),
            NetworkReason::NotRunning { state } => write!(f, "the managing node is in {state:?}"),
        }
    }
}

/// Another managing node on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForeignMn {
    /// By what it was heard last.
    pub sign: ForeignSign,
    /// When that was, in ns.
    pub heard_ns: u64,
    /// Frames of it, or of several, since the start.
    pub frames: u64,
}

/// The network as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkDiagnosis {
    /// State of the managing node.
    pub state: NmtState,
    /// Why it is not OPERATIONAL; `None`: it is.
    pub reason: Option<NetworkReason>,
    /// The last other managing node that was heard.
    pub foreign_mn: Option<ForeignMn>,
}

impl fmt::Display for NetworkDiagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "network: {:?}", self.state)?;
        if let Some(reason) = self.reason {
            write!(f, ": {reason}")?;
        }
        if let Some(foreign) = self.foreign_mn {
            write!(f, " ({}; {} frames)", foreign.sign, foreign.frames)?;
        }
        Ok(())
    }
}
