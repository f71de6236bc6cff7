//! What a controlled node sends in the asynchronous slot.
//!
//! In:  invitations of the managing node (SoA), answers of the SDO server, Ethernet frames of the application.
//! Out: exactly one frame for an invitation, or none where nothing waits; RS and PR, by which the node asks for invitations.
//!
//! SDO answers and the application's frames take turns. The node asks for no NMT services.

use super::access::Access;
use super::controlled_node::Cn;
use super::event::Events;
use super::objects::HOST_NAME_LEN;
use crate::ethernet_queue::QueueError;
use crate::nmt::NmtState;
use crate::sdo::SERVICE_DATA_MAX;
use crate::wire::{
    Asnd, ErrorEntries, FRAME_LEN_MAX, Header, IdentResponse, RequestedService, Requests, Soa, StatusResponse,
    multicast, node,
};

impl<const E: usize, const B: usize> Cn<E, B> {
    /// Has an Ethernet frame that is not POWERLINK sent (IP, for instance): in an asynchronous slot when the node is invited
    /// to, or at once in BASIC_ETHERNET (see [`poll_transmit`](Self::poll_transmit)). Short frames are padded. Frames that still
    /// wait at a ResetConfiguration or a deeper reset are forgotten. RT: no allocation, no locks, bounded.
    ///
    /// # Errors
    /// [`QueueError`] when all places are taken, or for a frame that is POWERLINK or longer than the AsyncMTU (0x1F98/8).
    pub fn send_ethernet(&mut self, frame: &[u8]) -> Result<(), QueueError> {
        self.outbox.frames.push(frame, self.async_mtu)
    }

    /// RS and PR: how many frames wait.
    pub(super) fn requests(&self) -> Requests {
        match self.sdo.pending() + self.outbox.frames.len() {
            0 => Requests::default(),
            waiting => Requests {
                count: waiting.min(7) as u8,
                priority: Requests::PRIORITY_GENERIC,
            },
        }
    }

    /// The one frame that answers an invitation to this node; `None` where nothing waits.
    pub(super) fn answer_invitation(&mut self, soa: &Soa, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let len = match soa.service {
            RequestedService::IdentRequest => self.emit_ident(response),
            RequestedService::StatusRequest => {
                // The answer still shows the flags as they were before this request.
                let len = self.emit_status(response);
                self.take_status_request(soa);
                len
            }
            RequestedService::UnspecifiedInvite => self.emit_generic(response),
            RequestedService::SyncRequest => self.emit_sync(response),
            RequestedService::NoService | RequestedService::NmtRequestInvite | RequestedService::Unknown(_) => None,
        };
        if len.is_some() {
            self.count(self.keys.telegrams.asynchronous_sent);
        }
        len
    }

    pub(super) fn receive_sdo(&mut self, client: u8, service_data: &[u8], events: &mut Events) {
        self.count(self.keys.telegrams.sdo_received);
        let mut access = Access {
            dictionary: &mut self.dictionary,
            keys: &self.keys,
            state: self.state,
            check: self.check,
            written: None,
            written_several: false,
            reset: None,
            storage: None,
        };
        self.sdo.receive(client, service_data, &mut access);
        let Access {
            written,
            written_several,
            reset,
            storage,
            ..
        } = access;
        events.written = written;
        events.written_several = written_several;
        events.storage = storage;
        if reset.is_some() {
            self.reset_requested = reset;
        }
    }

    fn emit_ident(&self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let (dictionary, keys) = (&self.dictionary, &self.keys);
        let mut host_name = [0; HOST_NAME_LEN];
        let name = dictionary.read(0x1F9A, 0).unwrap_or(&[]);
        host_name[..name.len()].copy_from_slice(name);
        let ident = IdentResponse {
            requests: self.requests(),
            nmt_state: self.state,
            feature_flags: dictionary.get(keys.feature_flags),
            mtu: dictionary.get(keys.timing.async_mtu),
            poll_in_size: dictionary.get(keys.timing.preq_limit),
            poll_out_size: dictionary.get(keys.timing.pres_limit),
            response_time_ns: dictionary.get(keys.timing.pres_max_latency_ns),
            device_type: dictionary.get(keys.device_type),
            vendor_id: dictionary.get(keys.identity[0]),
            product_code: dictionary.get(keys.identity[1]),
            revision: dictionary.get(keys.identity[2]),
            serial: dictionary.get(keys.identity[3]),
            configuration_date: self.configuration.0,
            configuration_time: self.configuration.1,
            software_date: dictionary.get(keys.software.date),
            software_time: dictionary.get(keys.software.time),
            ip_address: dictionary.get(keys.ip.address),
            subnet_mask: dictionary.get(keys.ip.subnet_mask),
            default_gateway: dictionary.get(keys.ip.default_gateway),
            host_name,
            ..IdentResponse::default()
        };
        self.emit_asnd(node::BROADCAST, &Asnd::IdentResponse(ident), response)
    }

    fn emit_status(&self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let mut static_errors = [0; 8];
        static_errors[0] = self.dictionary.get(self.keys.error_register);
        let status = StatusResponse {
            exception_clear: self.signalling.exception_clear(),
            exception_new: self.signalling.exception_new(),
            requests: self.requests(),
            nmt_state: self.state,
            static_errors,
            entries: ErrorEntries(self.signalling.entries()),
        };
        self.emit_asnd(node::BROADCAST, &Asnd::StatusResponse(status), response)
    }

    fn emit_generic(&mut self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let frame_first = self.outbox.has_frame() && (!self.outbox.frame_was_last || self.sdo.pending() == 0);
        self.outbox.frame_was_last = frame_first;
        if frame_first {
            return self.outbox.pop_frame(response);
        }
        let mut service_data = [0; SERVICE_DATA_MAX];
        let (client, len) = self.sdo.poll_transmit(&mut service_data)?;
        self.count(self.keys.telegrams.sdo_sent);
        self.emit_asnd(client, &Asnd::Sdo(&service_data[..len]), response)
    }

    pub(super) fn emit_asnd(
        &self,
        destination_node: u8,
        asnd: &Asnd<'_>,
        response: &mut [u8; FRAME_LEN_MAX],
    ) -> Option<usize> {
        let header = Header {
            destination: multicast::ASND,
            source: self.mac,
            destination_node,
            source_node: self.node_id,
        };
        asnd.emit(&header, response).ok()
    }

    /// Whether the node may send when it is invited.
    pub(super) fn communicates(&self) -> bool {
        self.state == NmtState::PreOperational1 || self.expects_soc()
    }
}
