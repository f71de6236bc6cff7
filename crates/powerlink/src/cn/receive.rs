//! The way of a received frame through a controlled node.
//!
//! In:  octets of one Ethernet frame and the time it arrived. Out: what has to be sent at once, and [`Events`].
//!
//! | frame | from | to | what it does |
//! |---|---|---|---|
//! | any that the standard does not know between these nodes; any that carries our own node id | | | nothing |
//! | SoC, SoA | 240 | 255 | cycle, invitation |
//! | PReq | 240 | us | outputs, and the PRes in answer; to another node: a sign of life of the network |
//! | PRes | 1..=240 | 255 | outputs of the RPDOs that read this node; of 240, the start of a chain |
//! | ASnd NMTCommand | 240 | us, 255 | the command |
//! | ASnd SDO | 1..=240, 253, 254 | us | a frame of an SDO client |
//! | ASnd SyncResponse | 1..=239 | any | the delay between its sender and us |
//! | AMNI, AInv, every other ASnd | | | nothing |

use super::controlled_node::Cn;
use super::error::PROFILE_COMMUNICATION;
use super::event::{Events, Reaction};
use super::objects::RPDOS;
use super::pdo::{Pdo, Received, Source};
use crate::nmt::{CnEvent, NmtState};
use crate::wire::{
    self, Asnd, FRAME_LEN_MAX, Frame, Header, PAYLOAD_MAX, Preq, Pres, RequestedService, Soa, Soc, multicast, node,
};

impl<const E: usize, const B: usize> Cn<E, B> {
    /// Takes one received Ethernet frame that arrived at `now_ns` (the receive stamp, where there is one: the watch over the SoC
    /// and the time of a chained PRes depend on it), and writes the frame that has to be sent at once into `response`. Frames
    /// that are malformed, that their sender may not send, or meant for others change nothing. RT: no allocation, no locks, bounded.
    pub fn receive(&mut self, now_ns: u64, frame: &[u8], response: &mut [u8; FRAME_LEN_MAX]) -> Reaction {
        self.receive_read(now_ns, wire::accept(frame).ok(), response)
    }

    /// As [`receive`](Self::receive), of a frame that [`wire::accept`] has read once for several nodes; `None`: it was refused.
    pub fn receive_read(
        &mut self,
        now_ns: u64,
        frame: Option<(Header, Frame<'_>)>,
        response: &mut [u8; FRAME_LEN_MAX],
    ) -> Reaction {
        let mut reaction = Reaction::default();
        self.run_timers(now_ns, &mut reaction.events);
        let Some((header, frame)) = frame else {
            return reaction;
        };
        // What says that it is from this node is from another one with the same id.
        if header.source_node == self.node_id {
            return reaction;
        }
        let to_us = header.destination_node == self.node_id;
        let events = &mut reaction.events;
        match frame {
            Frame::Soc(soc) => self.receive_soc(now_ns, soc, events),
            Frame::Soa(soa) => reaction.transmit = self.receive_soa(now_ns, &soa, response, events),
            Frame::Preq(preq) => {
                self.apply_traffic(CnEvent::PollFrame, now_ns, events);
                if to_us {
                    reaction.transmit = self.receive_preq(&preq, response, events);
                }
            }
            Frame::Pres(pres) => {
                self.apply_traffic(CnEvent::PollFrame, now_ns, events);
                if header.source_node == node::MN {
                    self.start_chain(now_ns);
                }
                self.take_pres(header.source_node, &pres, events);
            }
            Frame::Asnd(asnd) => self.receive_asnd(now_ns, &header, &asnd, events),
            Frame::Amni(_) | Frame::Ainv(_) => {}
        }
        reaction
    }

    /// Until when this node rests: before that time a PReq to another node does nothing here, and the PRes of one no more than
    /// [`overhear`](Self::overhear) does. No timer runs out, no reset waits, and its state is none that such a frame ends. 0: it does
    /// not rest.
    pub fn rests_until_ns(&self) -> u64 {
        let listens = matches!(self.state, NmtState::NotActive | NmtState::BasicEthernet);
        match listens || self.reset_requested.is_some() {
            true => 0,
            false => self.next_deadline_ns().unwrap_or(u64::MAX),
        }
    }

    /// The PRes of another controlled node, while this one rests: as [`receive`](Self::receive), and quicker. RT as that.
    pub fn overhear(&mut self, from: u8, pres: &Pres<'_>) {
        if from != self.node_id {
            self.take_pres(from, pres, &mut Events::default());
        }
    }

    fn receive_soc(&mut self, now_ns: u64, soc: Soc, events: &mut Events) {
        self.net_time = soc.net_time;
        self.chaining.cancel();
        self.apply_traffic(CnEvent::Soc, now_ns, events);
        if !self.expects_soc() || self.watch.is_repeated_soc(now_ns, &soc) {
            return;
        }
        self.count(self.keys.telegrams.cycles);
        events.sync = Some(soc);
        self.begin_cycle(now_ns, events);
    }

    fn receive_preq(
        &mut self,
        preq: &Preq<'_>,
        response: &mut [u8; FRAME_LEN_MAX],
        events: &mut Events,
    ) -> Option<usize> {
        // A chained node has its slot behind the PResMN.
        if !self.state.is_isochronous() || self.chaining.is_enabled() {
            return None;
        }
        self.count(self.keys.telegrams.isochronous_received);
        self.take_preq(preq.multiplexed);
        self.signalling_step(|signalling| signalling.acknowledge(preq.exception_acknowledge));
        let pdo = Pdo {
            source: Source::Preq,
            version: preq.pdo_version,
            ready: preq.ready,
            payload: preq.payload,
        };
        self.receive_pdo(&pdo, events);
        self.emit_pres(preq.multiplexed, response)
    }

    /// The PRes; the node is in a state that sends it.
    pub(super) fn emit_pres(&mut self, multiplexed: bool, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let mut payload = [0; PAYLOAD_MAX];
        self.pdos.transmit(&self.dictionary, &mut payload);
        let pres = Pres {
            nmt_state: self.state,
            multiplexed,
            exception_new: self.signalling.exception_new(),
            ready: self.state == NmtState::Operational,
            requests: self.requests(),
            pdo_version: self.pdos.transmit_version,
            payload: &payload[..self.pdos.transmit_octets()],
        };
        let header = Header::multicast(multicast::PRES, self.mac, self.node_id);
        let len = pres.emit(&header, self.pdos.transmit_limit, response).ok()?;
        self.count(self.keys.telegrams.isochronous_sent);
        Some(len)
    }

    fn take_pres(&mut self, from: u8, pres: &Pres<'_>, events: &mut Events) {
        if !self.state.is_isochronous() {
            return;
        }
        self.count(self.keys.telegrams.isochronous_received);
        let pdo = Pdo {
            source: Source::Pres(from),
            version: pres.pdo_version,
            ready: pres.ready,
            payload: pres.payload,
        };
        self.receive_pdo(&pdo, events);
    }

    fn receive_pdo(&mut self, pdo: &Pdo<'_>, events: &mut Events) {
        let operational = self.state == NmtState::Operational;
        if !operational && self.state != NmtState::ReadyToOperate {
            return;
        }
        if let Err(fault) = self.pdos.check_preq(pdo) {
            self.drop_pdo(fault);
            return;
        }
        for number in 0..RPDOS {
            match self.pdos.receive(number, &mut self.dictionary, pdo, operational) {
                Received::Valid => events.outputs = true,
                Received::NewFault(code) => self.drop_pdo(Some(code)),
                Received::Ignored | Received::SameFault => {}
            }
        }
    }

    /// A received PDO was dropped for a reason that is reported unless it was before.
    fn drop_pdo(&mut self, fault: Option<u16>) {
        if let Some(code) = fault {
            self.report_error(PROFILE_COMMUNICATION, code, [0; 8]);
        }
    }

    fn receive_soa(
        &mut self,
        now_ns: u64,
        soa: &Soa,
        response: &mut [u8; FRAME_LEN_MAX],
        events: &mut Events,
    ) -> Option<usize> {
        self.chaining.cancel();
        self.take_soa();
        self.apply_traffic(CnEvent::Soa, now_ns, events);
        // In the reduced cycle of PRE_OPERATIONAL_1 the next SoA may follow at once.
        let repeated = self.expects_soc() && self.watch.is_repeated_soa(now_ns, soa);
        if !self.communicates() || repeated {
            return None;
        }
        if soa.service == RequestedService::SyncRequest {
            self.receive_sync_request(now_ns, soa);
            if !self.is_meant(&soa.sync) {
                return None;
            }
        }
        if soa.target == self.node_id {
            self.answer_invitation(soa, response)
        } else {
            None
        }
    }

    fn receive_asnd(&mut self, now_ns: u64, header: &Header, asnd: &Asnd<'_>, events: &mut Events) {
        let to_us = header.destination_node == self.node_id;
        let to_all = header.destination_node == node::BROADCAST;
        if to_us || to_all {
            self.count(self.keys.telegrams.asynchronous_received);
        }
        match asnd {
            Asnd::NmtCommand(command) if header.source_node == node::MN && (to_us || to_all) => {
                self.receive_nmt_command(now_ns, command, events);
            }
            Asnd::Sdo(service_data) if to_us && self.communicates() => {
                self.receive_sdo(header.source_node, service_data, events);
            }
            Asnd::SyncResponse(_) => self.receive_sync_response(now_ns, header.source_node),
            Asnd::NmtCommand(_)
            | Asnd::Sdo(_)
            | Asnd::IdentResponse(_)
            | Asnd::StatusResponse(_)
            | Asnd::NmtRequest(_)
            | Asnd::Other(_) => {}
        }
    }
}
