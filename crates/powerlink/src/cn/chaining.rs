//! PRes chaining (EPSG DS 302-C): the node is not polled but sends its PRes at a set time after the end of the PResMN.
//!
//! In:  SyncRequests to this node (times, mode), the PResMN that starts each chain; SyncRequests to other nodes and their
//!      answers, from which the delay between the nodes is measured.
//! Out: when the PRes is due; SyncResponses.
//!
//! Times of arrival are those of the ends of frames.

use super::controlled_node::Cn;
use crate::wire::{Asnd, FRAME_LEN_MAX, Soa, SyncRequest, SyncResponse, node};

/// A SyncRequest on a wire of 100 Mbit/s: preamble, 60 octets, FCS.
const SYNC_REQUEST_WIRE_NS: u64 = (8 + 60 + 4) * 80;
/// Least time between two frames on a wire of 100 Mbit/s: 12 octets.
const INTER_FRAME_GAP_NS: u64 = 12 * 80;

impl<const E: usize, const B: usize> Cn<E, B> {
    /// Whether the PRes follows the PResMN (PRes chaining) instead of a PReq.
    pub fn is_chained(&self) -> bool {
        self.chaining.is_enabled()
    }

    /// A SyncRequest to any node.
    pub(super) fn receive_sync_request(&mut self, now_ns: u64, soa: &Soa) {
        if soa.target != self.node_id {
            self.chaining.asked = Some((soa.target, now_ns));
            return;
        }
        if !self.is_meant(&soa.sync) {
            return;
        }
        let SyncRequest {
            pres_time_first_ns,
            pres_time_second_ns,
            mn_delay_first_ns,
            mn_delay_second_ns,
            fall_back_timeout_ns,
            destination: _,
            mode_reset,
            mode_set,
        } = soa.sync;
        let keys = self.keys.chaining;
        for (value_ns, key) in [
            (pres_time_first_ns, keys.pres_time_first_ns),
            (pres_time_second_ns, keys.pres_time_second_ns),
            (mn_delay_first_ns, keys.mn_delay_first_ns),
            (mn_delay_second_ns, keys.mn_delay_second_ns),
        ] {
            if let Some(value_ns) = value_ns {
                self.dictionary.set(key, value_ns);
            }
        }
        let chaining = &mut self.chaining;
        chaining.pres_time_first_ns = pres_time_first_ns.or(chaining.pres_time_first_ns);
        chaining.pres_time_second_ns = pres_time_second_ns.or(chaining.pres_time_second_ns);
        chaining.fall_back_timeout_ns = fall_back_timeout_ns.unwrap_or(chaining.fall_back_timeout_ns);
        // A reset goes before a set; without a time there is nothing to follow.
        if mode_reset {
            self.switch_chaining(false, now_ns);
        } else if mode_set && chaining.pres_time_first_ns.is_some() {
            self.switch_chaining(true, now_ns);
        }
    }

    /// The answer to a SyncRequest to this node, after it has taken effect.
    pub(super) fn emit_sync(&mut self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let chaining = &self.chaining;
        let (sync_node, delay_ns) = chaining.measured.unwrap_or((node::INVALID, 0));
        let answer = SyncResponse {
            pres_time_first_valid: chaining.pres_time_first_ns.is_some(),
            pres_time_second_valid: chaining.pres_time_second_ns.is_some(),
            mode_set: chaining.on,
            latency_ns: self.dictionary.get(self.keys.timing.pres_max_latency_ns),
            sync_node: u32::from(sync_node),
            delay_ns,
            pres_time_first_ns: chaining.pres_time_first_ns.unwrap_or(0),
            pres_time_second_ns: chaining.pres_time_second_ns.unwrap_or(0),
        };
        self.emit_asnd(node::MN, &Asnd::SyncResponse(answer), response)
    }

    /// Whether a SyncRequest to this node id is for this node: no address, or its own.
    pub(super) fn is_meant(&self, request: &SyncRequest) -> bool {
        request.destination.is_none_or(|destination| destination == self.mac)
    }

    /// Another node answered a SyncRequest: how long it took from here.
    pub(super) fn receive_sync_response(&mut self, now_ns: u64, from: u8) {
        self.chaining.measured = match self.chaining.asked.take() {
            Some((asked, at_ns)) if asked == from => {
                let delay_ns = now_ns.saturating_sub(at_ns).saturating_sub(SYNC_REQUEST_WIRE_NS);
                // Clocks may be too coarse for it, and 0 says to managing nodes that nothing was measured.
                let delay_ns = delay_ns.max(INTER_FRAME_GAP_NS);
                Some((from, u32::try_from(delay_ns).unwrap_or(u32::MAX)))
            }
            Some(_) | None => None,
        };
    }

    /// The PResMN ended at `now_ns`: the chain of this cycle has started.
    pub(super) fn start_chain(&mut self, now_ns: u64) {
        if !self.chaining.on || !self.state.is_isochronous() {
            return;
        }
        let time_ns = u64::from(self.chaining.pres_time_first_ns.unwrap_or(0));
        self.chaining.transmit_at_ns = Some(now_ns.saturating_add(time_ns));
        self.chaining.watch(now_ns);
    }

    /// The PRes of this cycle, when it is due.
    pub(super) fn poll_chained_pres(&mut self, now_ns: u64, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        self.chaining.transmit_at_ns.filter(|at_ns| now_ns >= *at_ns)?;
        self.chaining.cancel();
        self.emit_pres(false, response)
    }

    pub(super) fn switch_chaining(&mut self, on: bool, now_ns: u64) {
        self.chaining.switch(on, now_ns);
        self.dictionary.set(self.keys.chaining.mode, u8::from(on));
    }
}
