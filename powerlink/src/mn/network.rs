//! The network as a whole: when the managing node itself takes the next step of the boot-up.
//!
//! In:  the stages of all nodes, the time. Out: the managing node's own NMT state.
//! RT: no allocation, no locks, bounded by the number of nodes.

use super::Mn;
use super::event::MnEvent;
use super::node::{Node, us};
use super::slot::Shutdown;
use crate::nmt::{MnTrigger, NmtState};

/// Where the start of PRE_OPERATIONAL_1 stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reduced {
    /// NoService SoAs that are still to be sent.
    Wake { left: u8 },
    /// The ResetNode broadcast is next.
    Reset,
    /// The nodes restart.
    Pause { until_ns: u64 },
    /// IdentRequests.
    Ident,
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// The nodes' next steps, and what they mean for the network; once a slot.
    pub(super) fn step_network(&mut self, now_ns: u64) {
        if self.shutdown != Shutdown::No {
            return;
        }
        let network = self.network();
        for node in self.nodes.iter_mut().flatten() {
            node.step(now_ns, &network, &mut self.events);
        }
        let mandatory = |is: fn(&Node<'a>) -> bool| {
            self.nodes
                .iter()
                .flatten()
                .filter(|node| node.config.assignment.mandatory)
                .all(is)
        };
        match self.state {
            NmtState::PreOperational1 if self.reduced == Reduced::Ident => {
                let stayed_ns = now_ns.saturating_sub(self.pre_op_1_since_ns);
                if mandatory(Node::is_identified) {
                    if stayed_ns >= us(self.config.boot.wait_pre_op_1_us) {
                        self.trigger(MnTrigger::MandatoryIdentified);
                        for node in self.nodes.iter_mut().flatten() {
                            node.cycle_begins(now_ns, &network);
                        }
                    }
                } else if stayed_ns >= us(self.config.boot.timeout_pre_op_1_us) && !self.missing_reported {
                    self.missing_reported = true;
                    for node in self
                        .nodes
                        .iter()
                        .flatten()
                        .filter(|node| node.config.assignment.mandatory)
                    {
                        if !node.is_identified() {
                            self.events.push(MnEvent::Missing { node: node.config.id });
                        }
                    }
                }
            }
            NmtState::PreOperational2 if mandatory(Node::is_configured) => {
                self.trigger(MnTrigger::MandatoryConfigured);
            }
            NmtState::ReadyToOperate if mandatory(Node::is_ready) => self.trigger(MnTrigger::MandatoryReady),
            NmtState::PreOperational1
            | NmtState::PreOperational2
            | NmtState::ReadyToOperate
            | NmtState::Operational
            | NmtState::Off
            | NmtState::Initialising
            | NmtState::ResetApplication
            | NmtState::ResetCommunication
            | NmtState::ResetConfiguration
            | NmtState::NotActive
            | NmtState::BasicEthernet
            | NmtState::Stopped
            | NmtState::Unknown(_) => {}
        }
    }
}
