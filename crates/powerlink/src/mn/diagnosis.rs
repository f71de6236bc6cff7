//! Diagnosis: what a node is, where its boot-up stands, and why it is not operational; the same of the network as a whole.
//!
//! In:  copies of fixed size that `reason` takes of the managing node. Out: the only words for them, and the object, the expected
//! and the found value for programs. Times are by the clock of the managing node: [`At`] makes spans of them.

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
        /// What was found wrong.
        fault: Fault,
        /// When, in ns.
        since_ns: u64,
    },
    /// It must not go on as it is.
    Refused {
        /// What was found wrong.
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

/// All that is known of one controlled node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// Node id, 1..=239.
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
    /// Counts since the start.
    pub statistics: NodeStatistics,
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
        /// State of the managing node.
        state: NmtState,
    },
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

/// A [`Reason`] or a [`NetworkReason`] with the time that it is now, in ns by the clock of the managing node: its words name
/// spans of time instead of only what they are about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct At<T> {
    reason: T,
    now_ns: Option<u64>,
}

impl Reason {
    /// Its words at this time, in ns.
    pub fn at(self, now_ns: u64) -> At<Reason> {
        At {
            reason: self,
            now_ns: Some(now_ns),
        }
    }

    /// The fault behind it.
    pub fn fault(self) -> Option<Fault> {
        match self {
            Reason::GivenUp { fault, .. } | Reason::Refused { fault, .. } => Some(fault),
            Reason::NetworkNotRunning { .. }
            | Reason::NotAnswering { .. }
            | Reason::Booting { .. }
            | Reason::WaitingForNetwork { .. } => None,
        }
    }
}

impl NetworkReason {
    /// Its words at this time, in ns.
    pub fn at(self, now_ns: u64) -> At<NetworkReason> {
        At {
            reason: self,
            now_ns: Some(now_ns),
        }
    }
}

/// A span of time in ns, in seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span(pub u64);

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{} s", self.0 / 1_000_000_000, self.0 / 100_000_000 % 10)
    }
}

impl<T> At<T> {
    fn since(&self, then_ns: u64) -> Option<Span> {
        self.now_ns.map(|now_ns| Span(now_ns.saturating_sub(then_ns)))
    }

    fn until(&self, then_ns: u64) -> Option<Span> {
        self.now_ns.map(|now_ns| Span(then_ns.saturating_sub(now_ns)))
    }
}

impl fmt::Display for At<Reason> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.reason {
            Reason::NetworkNotRunning { state } => {
                write!(f, "the managing node is in {state} and does not look for nodes")
            }
            Reason::NotAnswering { since_ns } => {
                f.write_str("does not answer IdentRequests")?;
                if let Some(span) = self.since(since_ns) {
                    write!(f, "; looked for since {span}")?;
                }
                f.write_str(": is it on, connected, and set to this node id?")
            }
            Reason::GivenUp { fault, since_ns } => match self.since(since_ns) {
                Some(span) => write!(f, "{fault}; was reset and has not answered for {span}"),
                None => write!(f, "{fault}; was reset and has not answered since"),
            },
            Reason::Refused { fault, again_ns } => match self.until(again_ns) {
                Some(span) => write!(f, "{fault}; tried again in {span}"),
                None => write!(f, "{fault}; tried again later"),
            },
            Reason::Booting { stage } => stage.fmt(f),
            Reason::WaitingForNetwork {
                state,
                held_by: Some(node),
            } => write!(
                f,
                "ready, but the network is not {state}: mandatory node {node} holds it back"
            ),
            Reason::WaitingForNetwork { state, held_by: None } => {
                write!(f, "ready; waits for the network to be {state}")
            }
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        At {
            reason: *self,
            now_ns: None,
        }
        .fmt(f)
    }
}

impl fmt::Display for At<NetworkReason> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.reason {
            NetworkReason::Listening { until_ns } => {
                f.write_str("listens for another managing node")?;
                self.until(until_ns).map_or(Ok(()), |span| write!(f, " for {span}"))
            }
            NetworkReason::ForeignMn(sign) => write!(f, "{sign}; silent until it has gone"),
            NetworkReason::Starting => f.write_str("wakes and resets the nodes"),
            NetworkReason::MinimumStay { until_ns } => {
                write!(f, "stays in {}", NmtState::PreOperational1)?;
                self.until(until_ns).map_or(Ok(()), |span| write!(f, " for {span}"))
            }
            NetworkReason::WaitingForNode {
                state,
                node,
                why,
                others,
            } => {
                write!(f, "{state} waits for mandatory node {node}")?;
                match others {
                    0 => {}
                    1 => f.write_str(" and 1 other")?,
                    others => write!(f, " and {others} others")?,
                }
                let why = At {
                    reason: why,
                    now_ns: self.now_ns,
                };
                write!(f, ": {why}")
            }
            NetworkReason::Due {
                state,
                by_application: false,
            } => write!(f, "{state} is next"),
            NetworkReason::Due {
                state,
                by_application: true,
            } => write!(f, "waits for the application to enter {state}"),
            NetworkReason::ShuttingDown => f.write_str("is being taken down"),
            NetworkReason::NotRunning { state } => write!(f, "the managing node is in {state}"),
        }
    }
}
