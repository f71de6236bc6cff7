//! PRes chaining (EPSG DS 302-C): nodes that are not polled, but send their PRes one behind the other after ours.
//!
//! In:  what chained nodes say of their latency (SyncResponse). Out: the time at which each has to send (SyncRequest), the limit
//! by which all must have been heard.
//! RT: no allocation, no locks, bounded by the number of nodes.
//!
//! A chained node is set up in PRE_OPERATIONAL_2: asked for its latency, given its time, and from the answer on it counts as
//! polled. The first may begin when its latency is over; each further one when the frame before is through. A node whose
//! latency is learned later may shift those behind it, which are then given their new times while they run.

use super::budget::{GUARD_NS, wire_time_ns};
use super::fault::Fault;
use super::node::{Network, Node};
use super::stage::ChainStep;
use super::state::{Mn, Phase};
use crate::wire::{PAYLOAD_LIMIT_MIN, POLL_HEADER_LEN, SyncRequest, SyncResponse};

/// Cycles that a node goes on by its time without hearing our PRes.
const FALL_BACK_CYCLES: u64 = 5;
/// Cycles between two SyncRequests that stay without the right answer.
const RETRY_CYCLES: u64 = 5;
/// SyncRequests without the right answer after which the node has failed.
const TRIES_MAX: u32 = 64;

impl Node<'_> {
    fn is_chained(&self) -> bool {
        self.config.assignment.chained
    }

    /// A SyncRequest is needed.
    pub(super) fn wants_sync(&self, now_ns: u64) -> bool {
        self.is_chained()
            && self.is_identified()
            && self.order.is_none()
            && self.nmt_state.is_isochronous()
            && self.chain.step != ChainStep::Running
            && now_ns >= self.chain.due_ns
    }

    /// What the SyncRequest says, which is sent now.
    pub(super) fn sync_request(&mut self, network: &Network) -> SyncRequest {
        self.chain.due_ns = network.now_ns + RETRY_CYCLES * network.cycle_ns;
        self.chain.tries += 1;
        match self.chain.step {
            ChainStep::Measure => SyncRequest {
                destination: Some(self.mac),
                ..SyncRequest::default()
            },
            ChainStep::Set | ChainStep::Running => SyncRequest {
                pres_time_first_ns: Some(self.chain.pres_time_ns),
                fall_back_timeout_ns: u32::try_from(FALL_BACK_CYCLES * network.cycle_ns).ok(),
                destination: Some(self.mac),
                mode_set: true,
                ..SyncRequest::default()
            },
        }
    }

    /// Time that its PRes takes on the wire, in ns.
    fn pres_wire_ns(&self) -> u32 {
        let payload = usize::from(self.config.pres_bytes).max(PAYLOAD_LIMIT_MIN);
        // At most 1518 octets.
        wire_time_ns(POLL_HEADER_LEN + payload) as u32
    }
}

impl<const NODES: usize> Mn<'_, NODES> {
    /// Our PRes is on the wire: the time until which the chain has to be through; `None` where no node of it is running.
    pub(super) fn chain_deadline_ns(&mut self, now_ns: u64) -> Option<u64> {
        let nodes = self.nodes.iter_mut();
        nodes
            .filter(|node| node.is_chained() && node.polled)
            .map(|node| {
                node.statistics.preq_sent += 1;
                let pres_ns = u64::from(node.chain.pres_time_ns) + u64::from(node.pres_wire_ns());
                now_ns + pres_ns + u64::from(node.config.pres_timeout_ns)
            })
            .max()
    }

    /// The first chained node whose PRes of this cycle has not come.
    pub(super) fn first_unheard(&self) -> Option<usize> {
        (0..self.config.nodes.len()).find(|at| {
            self.nodes
                .get(*at)
                .is_some_and(|node| node.is_chained() && node.polled && !node.chain.heard)
        })
    }

    /// The time of the chain is over: those that were not heard have missed their PRes.
    pub(super) fn chain_over(&mut self, now_ns: u64) {
        while let Some(index) = self.first_unheard() {
            if let Some(node) = self.nodes.get_mut(index) {
                node.chain.heard = true;
            }
            self.poll_lost(now_ns, index);
        }
    }

    /// A node has answered a SyncRequest.
    pub(super) fn sync_response(&mut self, index: usize, response: &SyncResponse, now_ns: u64) {
        let Some(node) = self.nodes.get_mut(index) else {
            return;
        };
        if !node.is_chained() || !node.is_identified() {
            self.counters.unexpected += 1;
            return;
        }
        match node.chain.step {
            ChainStep::Measure => {
                let before = node.chain;
                node.chain.latency_ns = response.latency_ns;
                node.chain.step = ChainStep::Set;
                node.chain.due_ns = now_ns;
                node.chain.tries = 0;
                if self.chain_fits() {
                    self.compute_pres_times(now_ns);
                } else if let Some(node) = self.nodes.get_mut(index) {
                    // Waiting for it would use up the cycle of all: it is asked again, and given up in the end.
                    node.chain = before;
                    self.counters.unexpected += 1;
                }
            }
            ChainStep::Set if response.mode_set && response.pres_time_first_ns == node.chain.pres_time_ns => {
                node.chain.step = ChainStep::Running;
                node.chain.tries = 0;
                node.polled = self.state.is_isochronous();
                // Its first PRes comes with the next cycle's.
                node.chain.heard = true;
            }
            ChainStep::Set | ChainStep::Running => {}
        }
    }

    /// Whether the nodes whose latency is known would all be through, or their time-outs over, in what the cycle leaves for the
    /// chain.
    fn chain_fits(&self) -> bool {
        let room_ns = self.chain_room_ns.unwrap_or(0);
        let mut next_ns = 0;
        let mut known = self
            .nodes
            .iter()
            .filter(|node| node.is_chained() && node.chain.step != ChainStep::Measure);
        known.all(|node| {
            let end_ns = u64::from(node.chain.latency_ns).max(next_ns) + u64::from(node.pres_wire_ns());
            next_ns = end_ns + u64::from(GUARD_NS);
            end_ns + u64::from(node.config.pres_timeout_ns) <= room_ns
        })
    }

    /// One node behind the other, in the order of the configuration.
    fn compute_pres_times(&mut self, now_ns: u64) {
        let mut next_ns = 0;
        for node in self.nodes.iter_mut().filter(|node| node.is_chained()) {
            if node.chain.step == ChainStep::Measure {
                continue;
            }
            let pres_time_ns = node.chain.latency_ns.max(next_ns);
            next_ns = pres_time_ns.saturating_add(node.pres_wire_ns() + GUARD_NS);
            if node.chain.pres_time_ns != pres_time_ns {
                node.chain.pres_time_ns = pres_time_ns;
                node.chain.step = ChainStep::Set;
                node.chain.due_ns = now_ns;
            }
        }
    }

    /// Chained nodes that never take their time are given up; once a slot.
    pub(super) fn step_chain(&mut self, now_ns: u64) {
        if self.chain_room_ns.is_none() {
            return;
        }
        let network = self.network(now_ns);
        for node in self.nodes.iter_mut() {
            if node.chain.tries > TRIES_MAX {
                let (requests, got) = (node.chain.tries, node.nmt_state);
                node.fail(&network, Fault::ChainFailed { requests, got }, &mut self.events);
            }
        }
    }

    /// Whether a PRes of this node is welcome now: the chain is running.
    pub(super) fn awaits_chained(&self, index: usize) -> Option<u64> {
        let sent_ns = if let Phase::AwaitChain { sent_ns, .. } = self.phase {
            sent_ns
        } else if self.phase == Phase::ChainSent {
            self.clock.started_ns?
        } else {
            return None;
        };
        let node = self.nodes.get(index)?;
        (node.is_chained() && node.polled && !node.chain.heard).then_some(sent_ns)
    }
}
