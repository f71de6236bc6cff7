//! What arrives: frames of the nodes, of another managing node, garbage.
//!
//! In:  any octets, and when they came. Out: the node they belong to is told; everything else is counted by reason.
//!
//! | frame | from | to | what it is |
//! |---|---|---|---|
//! | any that the standard does not know between these nodes | | | counted (`malformed`), nothing else |
//! | any that carries our own MAC | | | counted (`own_frames`), nothing else |
//! | SoC, PReq, PRes, SoA, ASnd, AInv | 240 | as the standard has it | another managing node |
//! | AMNI | 241..=250 | 255 | another managing node |
//! | PRes, ASnd, in NOT_ACTIVE | 1..=239, 253, 254 | as the standard has it | the third of a node: an answer to another managing node (`UnaskedAnswers`); before, counted (`unexpected`) |
//! | PRes, once we have sent | 1..=239 | 255 | the node's process data, if it was polled |
//! | ASnd, once we have sent | 1..=239, 253 | 240, 255 | the node's answer; it ends the slot that was the node's |
//!
//! RT: no allocation, no locks, bounded; never panics.

use super::config::us_to_ns;
use super::event::{ForeignSign, MnEvent};
use super::state::{Grant, Mn, Phase};
use crate::nmt::NmtState;
use crate::wire::{self, Asnd, Frame, Header, Pres};

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// Hands in a frame that arrived. Garbage is counted by reason and does nothing else; never panics.
    pub fn receive(&mut self, now_ns: u64, frame: &[u8]) {
        let (header, body) = match wire::accept(frame) {
            Ok(accepted) => accepted,
            Err(error) => return self.counters.malformed.count(error),
        };
        if header.source == self.config.mac {
            self.counters.own_frames += 1;
            return;
        }
        if header.is_from_managing_node() {
            return self.foreign_mn(now_ns, &header);
        }
        if self.state == NmtState::NotActive {
            if self.foreign.unasked.is_sign(header.source_node) {
                return self.foreign_mn(now_ns, &header);
            }
            self.counters.unexpected += 1;
            return;
        }
        match body {
            Frame::Pres(pres) => self.receive_pres(now_ns, &header, &pres),
            Frame::Asnd(asnd) => self.receive_asnd(now_ns, &header, &asnd),
            Frame::Soc(_) | Frame::Soa(_) | Frame::Preq(_) | Frame::Amni(_) | Frame::Ainv(_) => {
                self.counters.unexpected += 1;
            }
        }
    }

    fn foreign_mn(&mut self, now_ns: u64, header: &Header) {
        self.counters.foreign_mn_frames += 1;
        let sign = ForeignSign {
            id: header.source_node,
            mac: header.source,
        };
        if self.foreign.heard(now_ns, sign) {
            self.events.push(MnEvent::ForeignMn(sign));
        }
        if self.state == NmtState::NotActive {
            self.start.listen_until_ns = Some(now_ns + us_to_ns(self.config.boot.wait_not_active_us));
        }
    }

    fn receive_pres(&mut self, now_ns: u64, header: &Header, pres: &Pres<'_>) {
        let Some(index) = self.nodes.index_of(header.source_node) else {
            self.counters.unknown_node += 1;
            return;
        };
        if let Some(sent_ns) = self.awaits_chained(index) {
            if let Some(node) = self.nodes.get_mut(index) {
                node.chain.heard = true;
            }
            return self.polled_well(index, now_ns, sent_ns, pres);
        }
        let sent_ns = if let Phase::AwaitPres {
            index: awaited,
            sent_ns,
            ..
        } = self.phase
            && awaited == index
        {
            sent_ns
        } else if self.phase == (Phase::PreqSent { index }) {
            // It was faster than our return from sending.
            now_ns
        } else {
            match self.nodes.get_mut(index) {
                Some(node) if node.data.lost_in_row > 0 => node.statistics.pres_late += 1,
                Some(_) | None => self.counters.unexpected += 1,
            }
            return;
        };
        self.phase = Phase::NextPreq { index: index + 1 };
        self.polled_well(index, now_ns, sent_ns, pres);
    }

    /// The PRes of a node came in time; `sent_ns`: when it was asked for.
    fn polled_well(&mut self, index: usize, now_ns: u64, sent_ns: u64, pres: &Pres<'_>) {
        let network = self.network(now_ns);
        if let Some(node) = self.nodes.get_mut(index) {
            let response_ns = u32::try_from(now_ns.saturating_sub(sent_ns)).unwrap_or(u32::MAX);
            node.statistics.response_ns_max = node.statistics.response_ns_max.max(response_ns);
            node.polled_well(pres, &network, &mut self.events);
        }
    }

    fn receive_asnd(&mut self, now_ns: u64, header: &Header, asnd: &Asnd<'_>) {
        let Some(index) = self.nodes.index_of(header.source_node) else {
            if header.source_node == wire::node::DIAGNOSTIC && self.config.diagnostic_device {
                return self.receive_diagnostic(now_ns, header.destination_node, asnd);
            }
            let id = header.source_node;
            let asked = self.close_slot_of(|grant| grant == Grant::Stranger { id });
            match asnd {
                Asnd::IdentResponse(ident) if asked => self.events.push(MnEvent::Stranger {
                    node: id,
                    device_type: ident.device_type,
                    vendor_id: ident.vendor_id,
                    product_code: ident.product_code,
                    revision: ident.revision,
                    serial: ident.serial,
                }),
                _ => self.counters.unknown_node += 1,
            }
            return;
        };
        let granted = self.close_slot_of(|grant| matches!(grant, Grant::Node { index: target, .. } if target == index));
        if !granted {
            self.counters.unexpected += 1;
        }
        if !matches!(header.destination_node, wire::node::MN | wire::node::BROADCAST) {
            return;
        }
        let network = self.network(now_ns);
        let Some(node) = self.nodes.get_mut(index) else {
            return;
        };
        match asnd {
            Asnd::IdentResponse(ident) => {
                node.identified(header.source, ident, &network, &mut self.events);
            }
            Asnd::StatusResponse(status) => node.status(status, &network, &mut self.events),
            Asnd::Sdo(data) => self.receive_sdo(now_ns, index, data),
            Asnd::NmtRequest(request) => self.nmt_requested(index, request),
            Asnd::SyncResponse(response) => self.sync_response(index, response, now_ns),
            Asnd::NmtCommand(_) | Asnd::Other(_) => self.counters.unexpected += u64::from(granted),
        }
    }

    /// Ends the slot that was granted to the sender, if it was; whether it was. An answer that comes late is still true and is
    /// taken; only the slot is over.
    pub(super) fn close_slot_of(&mut self, is_sender: impl Fn(Grant) -> bool) -> bool {
        let granted = match self.phase {
            Phase::AwaitAsnd { grant, .. } | Phase::SoaSent { grant } => is_sender(grant),
            Phase::Idle
            | Phase::SocDue { .. }
            | Phase::SocSent
            | Phase::AfterSoc { .. }
            | Phase::ChainDue
            | Phase::ChainSent
            | Phase::AwaitChain { .. }
            | Phase::NextPreq { .. }
            | Phase::PresMnDue
            | Phase::PreqSent { .. }
            | Phase::AwaitPres { .. }
            | Phase::SoaDue
            | Phase::AsndSent => false,
        };
        if granted {
            self.phase = Phase::Idle;
        }
        granted
    }
}
