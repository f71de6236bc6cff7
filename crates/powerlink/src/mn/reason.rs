//! Why a node is not operational, and why the network is not: found from the managing node as it stands.
//!
//! In:  stages, states, the record of each node. Out: a [`Diagnosis`] of a node, a [`NetworkDiagnosis`].
//! RT: no allocation, no locks, bounded by the number of nodes.

use super::config::us_to_ns;
use super::diagnosis::{Diagnosis, ForeignMn, NetworkDiagnosis, NetworkReason, Reason};
use super::event::NodeState;
use super::node::Node;
use super::stage::BootStage;
use super::state::{Mn, Reduced, Shutdown};
use crate::nmt::NmtState;

impl Node<'_> {
    /// The state that the boot-up has led to (0x1F8F); NOT_ACTIVE for a node that is not there.
    pub(super) fn expected_nmt_state(&self, network: NmtState) -> NmtState {
        match self.stage {
            BootStage::Searching { .. } | BootStage::Refused { .. } => NmtState::NotActive,
            BootStage::Configuring { .. }
            | BootStage::ClosingSdo { .. }
            | BootStage::ResettingConfiguration { .. }
            | BootStage::Reidentifying { .. }
            | BootStage::WaitingPreOperational2 { .. } => {
                if network.is_isochronous() {
                    NmtState::PreOperational2
                } else {
                    NmtState::PreOperational1
                }
            }
            BootStage::WaitingReadyToOperate { .. } | BootStage::CheckingCommunication { .. } | BootStage::Ready => {
                NmtState::ReadyToOperate
            }
            BootStage::WaitingOperational { .. } | BootStage::Operational | BootStage::TakenOver => {
                NmtState::Operational
            }
            BootStage::Stopped { .. } => NmtState::Stopped,
        }
    }
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// All that is known of a node, by its position in the configuration; `None` for a position without a node.
    pub fn diagnosis(&self, node: usize) -> Option<Diagnosis> {
        let node = self.nodes.get(node)?;
        Some(Diagnosis {
            node: node.config.id,
            assignment: node.config.assignment,
            state: node.state,
            nmt_state: node.nmt_state,
            expected_nmt_state: node.expected_nmt_state(self.state),
            stage: node.stage,
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
            foreign_mn: self.foreign.last.map(|(heard_ns, sign)| ForeignMn {
                sign,
                heard_ns,
                frames: self.counters.foreign_mn_frames,
            }),
        }
    }

    pub(super) fn reason(&self, node: &Node<'a>) -> Option<Reason> {
        let given_up = node.record.last_fault.map(|last| last.fault);
        let since_ns = node.record.searched_since_ns;
        let stage = node.stage;
        let network_runs = self.state == NmtState::PreOperational1 || self.state.is_isochronous();
        Some(match node.stage {
            BootStage::Searching { .. } if !network_runs => Reason::NetworkNotRunning { state: self.state },
            BootStage::Searching { .. } => match given_up.filter(|_| node.state == NodeState::Faulted) {
                Some(fault) => Reason::GivenUp { fault, since_ns },
                None => Reason::NotAnswering { since_ns },
            },
            BootStage::Refused { until_ns } => match given_up {
                Some(fault) => Reason::Refused {
                    fault,
                    again_ns: until_ns,
                },
                None => Reason::Booting { stage },
            },
            // No PRE_OPERATIONAL_2 is entered before the network has left the reduced cycle.
            BootStage::WaitingPreOperational2 { .. } if !self.state.is_isochronous() => {
                self.waiting_for(NmtState::PreOperational2)
            }
            BootStage::Ready | BootStage::TakenOver if self.state != NmtState::Operational => {
                self.waiting_for(NmtState::Operational)
            }
            BootStage::TakenOver
            | BootStage::Stopped { .. }
            | BootStage::Configuring { .. }
            | BootStage::ClosingSdo { .. }
            | BootStage::ResettingConfiguration { .. }
            | BootStage::Reidentifying { .. }
            | BootStage::WaitingPreOperational2 { .. }
            | BootStage::WaitingReadyToOperate { .. }
            | BootStage::CheckingCommunication { .. }
            | BootStage::Ready
            | BootStage::WaitingOperational { .. } => Reason::Booting { stage },
            BootStage::Operational => return None,
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
            return Some(match (self.state, self.foreign.last) {
                (NmtState::NotActive, Some((_, sign))) => NetworkReason::ForeignMn(sign),
                (NmtState::NotActive, None) => NetworkReason::Listening {
                    until_ns: self.start.listen_until_ns.unwrap_or(0),
                },
                (state, _) => NetworkReason::NotRunning { state },
            });
        };
        let in_reduced_cycle = self.state == NmtState::PreOperational1;
        if in_reduced_cycle && self.start.reduced != Reduced::Ident {
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
            let until_ns = self.start.pre_op_1_since_ns + us_to_ns(self.config.boot.wait_pre_op_1_us);
            NetworkReason::MinimumStay { until_ns }
        } else {
            NetworkReason::Due { state, by_application }
        })
    }
}
