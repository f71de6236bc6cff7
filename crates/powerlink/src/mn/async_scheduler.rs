//! The asynchronous slot: who gets it, and what the managing node sends in it itself.
//!
//! In:  what every node needs, the time. Out: the SoA with its grant; the managing node's own ASnd.
//!
//! One ASnd a slot. NMT commands of the managing node go first (one frame for all nodes that wait for the same), NMT requests of
//! the nodes next (but never twice in a row while something else waits), then in turn: SyncRequests, StatusRequests, invitations
//! of nodes with something to send, SDO of the managing node, answers of its SDO server, the diagnostic device, Ethernet frames
//! of the application, IdentRequests. Within each use the nodes take turns.

use super::config::us_to_ns;
use super::event::MnEvent;
use super::fault::reset_reason;
use super::node::Node;
use super::stage::Order;
use super::state::{Grant, Mn, Own, PendingBroadcast, Phase, Reduced, SLOT_USES, Shutdown, SlotUse};
use crate::nmt::{NmtCommand, NmtState, NodeList};
use crate::sdo::SERVICE_DATA_MAX;
use crate::wire::{
    self, Asnd, COMMAND_DATA_LEN, Header, NmtCommandFrame, NmtRequestFrame, RequestedService, Requests, Soa, multicast,
};

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// Decides who gets the slot that begins now.
    pub(super) fn grant(&mut self, now_ns: u64) -> (Grant, Soa) {
        let grant = self.choose(now_ns);
        let soa = match grant {
            Grant::NoService => Soa::new(self.state, RequestedService::NoService, 0),
            Grant::Own(
                Own::Order { .. }
                | Own::Orders { .. }
                | Own::Reject
                | Own::ResetAll
                | Own::ResetEach { .. }
                | Own::Broadcast
                | Own::ShutDown,
            ) => Soa::new(self.state, RequestedService::NmtRequestInvite, wire::node::MN),
            Grant::Own(Own::Sdo | Own::Ethernet) => {
                Soa::new(self.state, RequestedService::UnspecifiedInvite, wire::node::MN)
            }
            Grant::Diagnostic { service } => Soa::new(self.state, service, wire::node::DIAGNOSTIC),
            Grant::Stranger { id } => Soa::new(self.state, RequestedService::IdentRequest, id),
            Grant::Node { index, service } => self.grant_node(now_ns, index, service),
        };
        (grant, soa)
    }

    fn grant_node(&mut self, now_ns: u64, index: usize, service: RequestedService) -> Soa {
        let mut soa = Soa::new(self.state, service, 0);
        let network = self.network(now_ns);
        if let Some(node) = self.nodes.get_mut(index) {
            soa.target = node.config.id;
            node.statistics.slots_granted += 1;
            if service == RequestedService::SyncRequest {
                soa.sync = node.sync_request(&network);
            }
            if service == RequestedService::StatusRequest {
                soa.exception_reset = node.signalling.exception_reset();
                soa.exception_acknowledge = node.signalling.exception_acknowledge();
            }
        }
        soa
    }

    fn choose(&mut self, now_ns: u64) -> Grant {
        match self.shutdown {
            Shutdown::No => {}
            Shutdown::Stop { .. } => return self.broadcast(NmtCommand::StopNode, Own::ShutDown),
            Shutdown::Reset { .. } => return self.broadcast(NmtCommand::ResetNode, Own::ShutDown),
            Shutdown::Done => return Grant::NoService,
        }
        if !self.state.is_isochronous()
            && let Some(grant) = self.choose_reduced(now_ns)
        {
            return grant;
        }
        if let Some(PendingBroadcast { what, .. }) = self.slot.broadcast {
            return self.broadcast(what.command(), Own::Broadcast);
        }
        if let Some(index) = self
            .nodes
            .find_from(self.slot.round_robin.order, |node| node.order.is_some())
        {
            self.slot.round_robin.order = index + 1;
            return self.order(index);
        }
        if let Some(index) = self.nodes.find_from(0, |node| node.reject.is_some()) {
            return self.reject(index);
        }
        if !self.slot.round_robin.nmt_request_last
            && let Some(grant) = self.invite_nmt_request()
        {
            return grant;
        }
        self.slot.round_robin.nmt_request_last = false;
        for step in 0..SLOT_USES.len() {
            let at = (self.slot.round_robin.kind + step) % SLOT_USES.len();
            if let Some(grant) = self.choose_use(SLOT_USES[at], at, now_ns) {
                self.slot.round_robin.kind = at + 1;
                return grant;
            }
        }
        self.invite_nmt_request().unwrap_or(Grant::NoService)
    }

    /// The start of PRE_OPERATIONAL_1; `None` once IdentRequests may go out.
    fn choose_reduced(&mut self, now_ns: u64) -> Option<Grant> {
        match self.start.reduced {
            Reduced::Wake { left } => {
                let keeps_alive = self.nodes.iter().any(|node| node.config.assignment.keep_alive);
                self.start.reduced = if left > 1 {
                    Reduced::Wake { left: left - 1 }
                } else if keeps_alive {
                    Reduced::ResetEach { index: 0 }
                } else {
                    Reduced::Reset
                };
                Some(Grant::NoService)
            }
            Reduced::ResetEach { index } => Some(self.reset_each(now_ns, index)),
            Reduced::Reset => Some(self.broadcast(NmtCommand::ResetNode, Own::ResetAll)),
            Reduced::Pause { until_ns } if now_ns < until_ns => Some(Grant::NoService),
            Reduced::Pause { .. } => {
                self.start.reduced = Reduced::Ident;
                None
            }
            Reduced::Ident => None,
        }
    }

    /// ResetNode to the next node that is not kept alive; a pause after the last one.
    fn reset_each(&mut self, now_ns: u64, from: usize) -> Grant {
        let next = (from..NODES).find_map(|index| {
            let node = self.nodes.get(index)?;
            (!node.config.assignment.keep_alive).then_some((index, node.config.id))
        });
        let Some((index, id)) = next else {
            self.pause_after_reset(now_ns);
            return Grant::NoService;
        };
        let reset = Asnd::NmtCommand(NmtCommandFrame::plain(NmtCommand::ResetNode));
        self.write_asnd(id, &reset, Own::ResetEach { index })
    }

    fn pause_after_reset(&mut self, now_ns: u64) {
        self.start.reduced = Reduced::Pause {
            until_ns: now_ns + us_to_ns(self.config.boot.reset_pause_us),
        };
    }

    /// A mandatory node is missing: who is on the network that should not be? Each id is asked once, before the missing one is asked
    /// again.
    fn grant_stranger(&mut self) -> Option<Grant> {
        if self.state.is_isochronous() {
            self.slot.next_stranger = None;
        }
        let from = self.slot.next_stranger?;
        let next = (from..=wire::node::CN_MAX).find(|id| self.nodes.index_of(*id).is_none());
        self.slot.next_stranger = next.map(|id| id + 1);
        next.map(|id| Grant::Stranger { id })
    }

    fn invite_nmt_request(&mut self) -> Option<Grant> {
        let wants = |node: &Node<'a>| {
            node.is_identified() && node.requests.count > 0 && node.requests.priority == Requests::PRIORITY_NMT
        };
        let index = self.nodes.find_from(self.slot.round_robin.nmt_request, wants)?;
        self.slot.round_robin.nmt_request = index + 1;
        self.slot.round_robin.nmt_request_last = true;
        self.count_down_requests(index);
        Some(Grant::Node {
            index,
            service: RequestedService::NmtRequestInvite,
        })
    }

    /// One request fewer, until the node says again how many it has.
    fn count_down_requests(&mut self, index: usize) {
        if let Some(node) = self.nodes.get_mut(index) {
            node.requests.count = node.requests.count.saturating_sub(1);
        }
    }

    fn choose_use(&mut self, kind: SlotUse, at: usize, now_ns: u64) -> Option<Grant> {
        let start = self.slot.round_robin.node[at];
        let isochronous = self.state.is_isochronous();
        let (index, service) = match kind {
            SlotUse::Server => return self.grant_server(),
            SlotUse::Diagnostic => return self.grant_diagnostic(now_ns),
            SlotUse::Ethernet => {
                self.slot.len = self.slot.ethernet.pop(&mut self.slot.frame)?;
                return Some(Grant::Own(Own::Ethernet));
            }
            SlotUse::Sdo => {
                let wants = |node: &Node<'a>| node.is_identified() && node.sdo.wants_to_transmit(now_ns);
                let index = self.nodes.find_from(start, wants)?;
                let grant = self.sdo(index, now_ns)?;
                self.slot.round_robin.node[at] = index + 1;
                return Some(grant);
            }
            SlotUse::Sync => {
                let wants = |node: &Node<'a>| isochronous && node.wants_sync(now_ns);
                (self.nodes.find_from(start, wants)?, RequestedService::SyncRequest)
            }
            SlotUse::Status => {
                let wants = |node: &Node<'a>| isochronous && node.wants_status(now_ns);
                (self.nodes.find_from(start, wants)?, RequestedService::StatusRequest)
            }
            SlotUse::Invite => {
                let index = self.nodes.find_from(start, |node| node.wants_invitation(now_ns))?;
                self.count_down_requests(index);
                (index, RequestedService::UnspecifiedInvite)
            }
            SlotUse::Ident => {
                if let Some(grant) = self.grant_stranger() {
                    return Some(grant);
                }
                let index = self.nodes.find_from(start, |node| node.wants_ident(now_ns))?;
                let network = self.network(now_ns);
                if let Some(node) = self.nodes.get_mut(index) {
                    node.ident_sent(&network);
                }
                (index, RequestedService::IdentRequest)
            }
        };
        self.slot.round_robin.node[at] = index + 1;
        Some(Grant::Node { index, service })
    }

    /// Writes an ASnd of our own.
    pub(super) fn write_asnd(&mut self, destination_node: u8, asnd: &Asnd<'_>, own: Own) -> Grant {
        let header = Header {
            destination: multicast::ASND,
            source: self.config.mac,
            destination_node,
            source_node: wire::node::MN,
        };
        match asnd.emit(&header, &mut self.slot.frame) {
            Ok(len) => {
                self.slot.len = len;
                Grant::Own(own)
            }
            // The buffer holds the longest frame; what cannot be written is not sent.
            Err(_) => Grant::NoService,
        }
    }

    fn broadcast(&mut self, command: NmtCommand, own: Own) -> Grant {
        self.write_asnd(
            wire::node::BROADCAST,
            &Asnd::NmtCommand(NmtCommandFrame::plain(command)),
            own,
        )
    }

    /// The NMT command that a node waits for. Where others wait for the same, and all understand it, they get it in one frame.
    fn order(&mut self, index: usize) -> Grant {
        let Some(node) = self.nodes.get(index) else {
            return Grant::NoService;
        };
        let (id, Some(order)) = (node.config.id, node.order) else {
            return Grant::NoService;
        };
        let (list, count) = self.with_the_same_order(order);
        if let Some(command) = order.command.extended().filter(|_| count > 1 && list.contains(id)) {
            let frame = NmtCommandFrame { command, data: list.0 };
            return self.write_asnd(wire::node::BROADCAST, &Asnd::NmtCommand(frame), Own::Orders { list });
        }
        let mut data = [0; COMMAND_DATA_LEN];
        data[..2].copy_from_slice(&order.reason.to_le_bytes());
        let command = order.command;
        self.write_asnd(
            id,
            &Asnd::NmtCommand(NmtCommandFrame { command, data }),
            Own::Order { index },
        )
    }

    /// Nodes that understand extended commands and wait for this one, and how many there are. In their frame is no room for a
    /// reason.
    fn with_the_same_order(&self, order: Order) -> (NodeList, usize) {
        let mut list = NodeList::default();
        let same = self.nodes.iter().filter(|node| {
            node.order == Some(order) && order.reason == reset_reason::NONE && node.understands_extended_commands()
        });
        let count = same.map(|node| list.insert(node.config.id)).count();
        (list, count)
    }

    fn reject(&mut self, index: usize) -> Grant {
        let Some(node) = self.nodes.get_mut(index) else {
            return Grant::NoService;
        };
        let Some(command) = node.reject.take() else {
            return Grant::NoService;
        };
        let mut data = [0; COMMAND_DATA_LEN];
        data[0] = command.into();
        let id = node.config.id;
        self.write_asnd(
            id,
            &Asnd::NmtCommand(NmtCommandFrame {
                command: NmtCommand::InvalidService,
                data,
            }),
            Own::Reject,
        )
    }

    fn sdo(&mut self, index: usize, now_ns: u64) -> Option<Grant> {
        let node = self.nodes.get_mut(index)?;
        let mut data = [0; SERVICE_DATA_MAX];
        // `None`: the command has just run out of time; there is nothing to send.
        let len = node.transmit_sdo(now_ns, &mut data)?;
        node.sdo_sent(now_ns);
        let id = node.config.id;
        Some(self.write_asnd(id, &Asnd::Sdo(&data[..len]), Own::Sdo))
    }

    /// Our own ASnd leaves now.
    pub(super) fn own_sent(&mut self, now_ns: u64, own: Own) {
        match own {
            Own::Order { index } => {
                let network = self.network(now_ns);
                if let Some(node) = self.nodes.get_mut(index) {
                    node.order_sent(&network);
                }
            }
            Own::Orders { list } => {
                let network = self.network(now_ns);
                let nodes = self.nodes.iter_mut();
                for node in nodes.filter(|node| list.contains(node.config.id)) {
                    node.order_sent(&network);
                }
            }
            Own::ResetAll => self.pause_after_reset(now_ns),
            Own::ResetEach { index } => self.start.reduced = Reduced::ResetEach { index: index + 1 },
            Own::Broadcast => self.broadcast_sent(now_ns),
            Own::ShutDown => {
                self.shutdown = self.shutdown.next();
                for node in self.nodes.iter_mut() {
                    node.polled = false;
                }
                if self.shutdown == Shutdown::Done {
                    self.state = NmtState::Off;
                    self.phase = Phase::Idle;
                    self.events.push(MnEvent::NmtStateChanged { state: self.state });
                }
            }
            Own::Reject | Own::Sdo | Own::Ethernet => {}
        }
    }

    /// The slot ended without an answer.
    pub(super) fn slot_over(&mut self, now_ns: u64, grant: Grant) {
        if matches!(grant, Grant::Diagnostic { .. }) {
            self.diagnostic_missed();
        }
        let Grant::Node { index, service } = grant else { return };
        self.counters.async_timeouts += 1;
        let network = self.network(now_ns);
        if let Some(node) = self.nodes.get_mut(index) {
            node.statistics.slots_unused += 1;
            if service == RequestedService::StatusRequest {
                node.status_missed(&network, &mut self.events);
            }
            if service == RequestedService::UnspecifiedInvite {
                node.invitation_unused(&network);
            }
        }
    }

    /// A node asks for an NMT service: Ident- and StatusRequests to configured nodes are served, commands are not.
    pub(super) fn nmt_requested(&mut self, index: usize, request: &NmtRequestFrame) {
        let target = self.nodes.with_id_mut(request.target);
        match (request.command, target) {
            (NmtCommand::IdentRequest, Some(target)) => target.ident.asked = true,
            (NmtCommand::StatusRequest, Some(target)) => target.status.asked = true,
            (command, _) => {
                if let Some(node) = self.nodes.get_mut(index) {
                    node.reject = Some(command);
                }
            }
        }
    }
}
