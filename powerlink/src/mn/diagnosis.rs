//! Diagnosis: what a node is, where its boot-up stands, and why it is not operational; the same of the network as a whole.
//!
//! In:  the managing node as it stands. Out: copies of fixed size, and words for people. Its clock counts from somewhere that
//! people do not see: times are in the copies only, for whoever knows what time it is.
//! RT: no allocation, no locks, bounded by the number of nodes.

use core::fmt;

use super::boot::Stage;
use super::event::ForeignSign;
use super::fault::Fault;
use super::network::Reduced;
use super::node::{Node, us};
use super::record::{ErrorLog, LastFault};
use super::slot::Shutdown;
use super::{Assignment, Mn, NodeState, NodeStatistics};
use crate::nmt::NmtState;
use crate::wire::IdentResponse;

/// Where the boot-up of a node stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BootStage {
    /// IdentRequests until it answers.
    Searching,
    /// It was refused, and is looked at again later.
    Refused,
    /// Identified; waits for the application to let it boot (0x1F81 bit 2 is clear).
    Held,
    /// Its configuration is being written.
    Configuring {
        /// Objects written so far.
        written: u32,
        /// The object that is being written.
        index: u16,
        /// Its sub-index.
        sub: u8,
    },
    /// Its configuration is written and is being put into use by ResetConfiguration.
    ResettingConfiguration,
    /// It restarts after ResetConfiguration; IdentRequests until it is back.
    Reidentifying,
    /// Configured; has to reach PRE_OPERATIONAL_2.
    WaitingPreOperational2,
    /// EnableReadyToOperate was sent; has to reach READY_TO_OPERATE.
    WaitingReadyToOperate,
    /// Its PRes are watched for a few cycles.
    CheckingCommunication,
    /// READY_TO_OPERATE; waits for the network.
    Ready,
    /// StartNode was sent; has to reach OPERATIONAL.
    WaitingOperational,
    /// Done.
    Operational,
    /// Found OPERATIONAL and kept alive (0x1F81 bit 4); waits for the network.
    TakenOver,
    /// In PRE_OPERATIONAL_2 by order of the application, until it orders READY_TO_OPERATE.
    BackInPreOperational2,
    /// Stopped, by order of the application or because a mandatory node dropped out (0x1F80 bit 6).
    Stopped,
}

impl fmt::Display for BootStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            BootStage::Searching => f.write_str("being looked for"),
            BootStage::Refused => f.write_str("refused"),
            BootStage::Held => f.write_str("waits for the application to boot it (1F81h bit 2 is clear)"),
            BootStage::Configuring {
                written: 0, index: 0, ..
            } => f.write_str("about to be configured"),
            BootStage::Configuring { written, index, sub } => write!(
                f,
                "being configured: {written} objects written, now {index:04X}h/{sub:02X}h"
            ),
            BootStage::ResettingConfiguration => f.write_str("configured, about to be reset by ResetConfiguration"),
            BootStage::Reidentifying => f.write_str("restarting after ResetConfiguration"),
            BootStage::WaitingPreOperational2 => f.write_str("on its way to PRE_OPERATIONAL_2"),
            BootStage::WaitingReadyToOperate => f.write_str("ordered to READY_TO_OPERATE"),
            BootStage::CheckingCommunication => f.write_str("in the communication check"),
            BootStage::Ready => f.write_str("ready"),
            BootStage::WaitingOperational => f.write_str("ordered to OPERATIONAL"),
            BootStage::Operational => f.write_str("operational"),
            BootStage::TakenOver => f.write_str("taken over as it was"),
            BootStage::BackInPreOperational2 => f.write_str("in PRE_OPERATIONAL_2 by order of the application"),
            BootStage::Stopped => f.write_str("stopped by order"),
        }
    }
}

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

impl Node<'_> {
    fn boot_stage(&self) -> BootStage {
        match self.stage {
            Stage::Search => BootStage::Searching,
            Stage::Refused { .. } => BootStage::Refused,
            Stage::Held => BootStage::Held,
            Stage::Configure => {
                let writing = self.sdo.is_busy().then_some((self.writing.index, self.writing.sub));
                let (index, sub) = writing.unwrap_or((0, 0));
                BootStage::Configuring {
                    written: self.written,
                    index,
                    sub,
                }
            }
            Stage::CloseSdo | Stage::ResetConfiguration { .. } => BootStage::ResettingConfiguration,
            Stage::Reidentify { .. } => BootStage::Reidentifying,
            Stage::Enable { .. } => BootStage::WaitingPreOperational2,
            Stage::WaitReady { .. } => BootStage::WaitingReadyToOperate,
            Stage::Check { .. } => BootStage::CheckingCommunication,
            Stage::Ready => BootStage::Ready,
            Stage::WaitOperational { .. } => BootStage::WaitingOperational,
            Stage::Operational => BootStage::Operational,
            Stage::TakenOver => BootStage::TakenOver,
            Stage::BackInPreOperational2 { .. } => BootStage::BackInPreOperational2,
            Stage::Stopped { .. } => BootStage::Stopped,
        }
    }

    /// The state that the boot-up has led to (0x1F8F); NOT_ACTIVE for a node that is not there.
    pub(super) fn expected_nmt_state(&self, network: NmtState) -> NmtState {
        match self.stage {
            Stage::Search | Stage::Refused { .. } => NmtState::NotActive,
            Stage::Held
            | Stage::Configure
            | Stage::CloseSdo
            | Stage::ResetConfiguration { .. }
            | Stage::Reidentify { .. }
            | Stage::Enable { .. }
            | Stage::BackInPreOperational2 { .. } => {
                if network.is_isochronous() {
                    NmtState::PreOperational2
                } else {
                    NmtState::PreOperational1
                }
            }
            Stage::WaitReady { .. } | Stage::Check { .. } | Stage::Ready => NmtState::ReadyToOperate,
            Stage::WaitOperational { .. } | Stage::Operational | Stage::TakenOver => NmtState::Operational,
            Stage::Stopped { .. } => NmtState::Stopped,
        }
    }
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// All that is known of a node, by its position in the configuration; `None` for a position without a node.
    pub fn diagnosis(&self, node: usize) -> Option<Diagnosis> {
        let node = self.node(node)?;
        Some(Diagnosis {
            node: node.config.id,
            assignment: node.config.assignment,
            state: node.state,
            nmt_state: node.nmt_state,
            expected_nmt_state: node.expected_nmt_state(self.state),
            stage: node.boot_stage(),
            reason: self.reason(node),
            ident: node.record.ident,
            last_fault: node.record.last_fault,
            errors: node.record.errors,
            statistics: node.statistics,
        })
    }

    /// Why the network is not OPERATIONAL, and who else claims it.
    pub fn network_diagnosis(&self) -> NetworkDiagnosis {
        NetworkDiagnosis {
            state: self.state,
            reason: self.network_reason(),
            foreign_mn: self.foreign.map(|(heard_ns, sign)| ForeignMn {
                sign,
                heard_ns,
                frames: self.counters.foreign_mn_frames,
            }),
        }
    }

    pub(super) fn reason(&self, node: &Node<'a>) -> Option<Reason> {
        let given_up = node.record.last_fault.map(|last| last.fault);
        let since_ns = node.record.searched_since_ns;
        let stage = node.boot_stage();
        let network_runs = self.state == NmtState::PreOperational1 || self.state.is_isochronous();
        Some(match node.stage {
            Stage::Search if !network_runs => Reason::NetworkNotRunning { state: self.state },
            Stage::Search => match given_up.filter(|_| node.state == NodeState::Faulted) {
                Some(fault) => Reason::GivenUp { fault, since_ns },
                None => Reason::NotAnswering { since_ns },
            },
            Stage::Refused { until_ns } => match given_up {
                Some(fault) => Reason::Refused {
                    fault,
                    again_ns: until_ns,
                },
                None => Reason::Booting { stage },
            },
            // No PRE_OPERATIONAL_2 is entered before the network has left the reduced cycle.
            Stage::Enable { .. } if !self.state.is_isochronous() => self.waiting_for(NmtState::PreOperational2),
            Stage::Ready | Stage::TakenOver if self.state != NmtState::Operational => {
                self.waiting_for(NmtState::Operational)
            }
            Stage::Held
            | Stage::TakenOver
            | Stage::BackInPreOperational2 { .. }
            | Stage::Stopped { .. }
            | Stage::Configure
            | Stage::CloseSdo
            | Stage::ResetConfiguration { .. }
            | Stage::Reidentify { .. }
            | Stage::Enable { .. }
            | Stage::WaitReady { .. }
            | Stage::Check { .. }
            | Stage::Ready
            | Stage::WaitOperational { .. } => Reason::Booting { stage },
            Stage::Operational => return None,
        })
    }

    fn waiting_for(&self, state: NmtState) -> Reason {
        let held_by = self.holding().map(|(node, _)| node.config.id);
        Reason::WaitingForNetwork { state, held_by }
    }

    /// The state that the network has to reach next.
    fn next_state(&self) -> Option<NmtState> {
        match self.state {
            NmtState::PreOperational1 => Some(NmtState::PreOperational2),
            NmtState::PreOperational2 => Some(NmtState::ReadyToOperate),
            NmtState::ReadyToOperate => Some(NmtState::Operational),
            NmtState::Operational
            | NmtState::Off
            | NmtState::Initialising
            | NmtState::ResetApplication
            | NmtState::ResetCommunication
            | NmtState::ResetConfiguration
            | NmtState::NotActive
            | NmtState::BasicEthernet
            | NmtState::Stopped
            | NmtState::Unknown(_) => None,
        }
    }

    /// The first mandatory node that holds the network back, and how many more do.
    fn holding(&self) -> Option<(&Node<'a>, u32)> {
        let next = self.next_state()?;
        let far_enough = |node: &Node<'a>| {
            if next == NmtState::PreOperational2 {
                node.is_identified() && !node.is_being_configured()
            } else if next == NmtState::ReadyToOperate {
                node.is_ready_to_operate()
            } else {
                node.is_ready()
            }
        };
        let mut holding = self
            .nodes
            .iter()
            .flatten()
            .filter(|node| node.config.assignment.mandatory && !far_enough(node));
        let first = holding.next()?;
        // At most 239 nodes.
        Some((first, holding.count() as u32))
    }

    fn network_reason(&self) -> Option<NetworkReason> {
        if self.state == NmtState::Operational && self.shutdown == Shutdown::No {
            return None;
        }
        if !matches!(self.shutdown, Shutdown::No | Shutdown::Done) {
            return Some(NetworkReason::ShuttingDown);
        }
        let Some(state) = self.next_state() else {
            return Some(match (self.state, self.foreign) {
                (NmtState::NotActive, Some((_, sign))) => NetworkReason::ForeignMn(sign),
                (NmtState::NotActive, None) => NetworkReason::Listening {
                    until_ns: self.listen_until_ns.unwrap_or(0),
                },
                (state, _) => NetworkReason::NotRunning { state },
            });
        };
        let in_reduced_cycle = self.state == NmtState::PreOperational1;
        if in_reduced_cycle && self.reduced != Reduced::Ident {
            return Some(NetworkReason::Starting);
        }
        if let Some((node, others)) = self.holding()
            && let Some(why) = self.reason(node)
        {
            return Some(NetworkReason::WaitingForNode {
                state,
                node: node.config.id,
                why,
                others,
            });
        }
        let startup = &self.config.startup;
        let by_application = if state == NmtState::PreOperational2 {
            startup.application_enters_pre_operational_2
        } else if state == NmtState::ReadyToOperate {
            startup.application_enters_ready_to_operate
        } else {
            startup.application_enters_operational
        };
        Some(if in_reduced_cycle && !by_application {
            let until_ns = self.pre_op_1_since_ns + us(self.config.boot.wait_pre_op_1_us);
            NetworkReason::MinimumStay { until_ns }
        } else {
            NetworkReason::Due { state, by_application }
        })
    }
}
