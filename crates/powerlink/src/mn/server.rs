//! SDO server of the managing node: nodes and a diagnostic device (node 253) read its object dictionary.
//!
//! In:  SDO frames that are not for one of our clients; IdentResponses of the diagnostic device.
//! Out: answers, in slots that we grant to ourselves; slots for the diagnostic device.
//! RT: no allocation, no locks, bounded.

use super::objects::objects_of;
use super::state::{DiagnosticDevice, Grant, Mn, Own};
use crate::nmt::NmtState;
use crate::sdo::SERVICE_DATA_MAX;
use crate::sdo::command::Content;
use crate::sdo::sequence::{self, Con, Sequence};
use crate::wire::{self, Asnd, RequestedService, Requests};

/// A diagnostic device is looked for so often.
const SEARCH_NS: u64 = 1_000_000_000;
/// One that is there is asked so often whether it has something to send.
const ASK_NS: u64 = 20_000_000;
/// IdentRequests in a row without an answer after which it has gone.
const UNANSWERED_MAX: u8 = 5;

/// Whom an SDO frame of a node is for, as far as it says itself: only a client opens a connection and sends commands, only a
/// server answers them. `None`: both send such frames.
pub(super) fn is_for_server(service_data: &[u8]) -> Option<bool> {
    let sequence = Sequence::parse(service_data)?;
    match (sequence.received_con, sequence.sent_con) {
        (Con::None, Con::Init) | (Con::Init, Con::Valid | Con::Request) => return Some(true),
        (Con::Init, Con::Init) => return Some(false),
        (Con::None, Con::None | Con::Valid | Con::Request)
        | (Con::Init, Con::None)
        | (Con::Valid | Con::Request, Con::None | Con::Init | Con::Valid | Con::Request) => {}
    }
    match Content::parse(service_data.get(sequence::HEADER_LEN..)?) {
        Content::Command(command) => Some(!command.header.response),
        Content::Empty | Content::Malformed => None,
    }
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// An SDO frame of a configured node came: for our client of this node, or for our server.
    pub(super) fn receive_sdo(&mut self, now_ns: u64, index: usize, service_data: &[u8]) {
        let Some(node) = self.nodes.get_mut(index) else {
            return;
        };
        let id = node.config.id;
        let ours = is_for_server(service_data).unwrap_or(self.slot.server.serves(id) && !node.sdo.is_busy());
        if ours {
            self.serve(now_ns, id, service_data);
        } else {
            node.receive_sdo(now_ns, service_data);
        }
    }

    fn serve(&mut self, now_ns: u64, client: u8, service_data: &[u8]) {
        let mut objects = objects_of!(self, now_ns);
        self.slot.server.receive(client, service_data, &mut objects);
    }

    /// An ASnd of the diagnostic device came.
    pub(super) fn receive_diagnostic(&mut self, now_ns: u64, destination: u8, asnd: &Asnd<'_>) {
        let granted = self.close_slot_of(|grant| matches!(grant, Grant::Diagnostic { .. }));
        if !granted {
            self.counters.unexpected += 1;
        }
        if !matches!(destination, wire::node::MN | wire::node::BROADCAST) {
            return;
        }
        match asnd {
            Asnd::IdentResponse(ident) => self.diagnostic_reported(now_ns, ident.requests),
            Asnd::StatusResponse(status) => self.diagnostic_reported(now_ns, status.requests),
            Asnd::Sdo(data) => self.serve(now_ns, wire::node::DIAGNOSTIC, data),
            Asnd::NmtRequest(_) | Asnd::NmtCommand(_) | Asnd::SyncResponse(_) | Asnd::Other(_) => {
                self.counters.unexpected += u64::from(granted);
            }
        }
    }

    fn diagnostic_reported(&mut self, now_ns: u64, requests: Requests) {
        self.slot.diagnostic = DiagnosticDevice {
            requests,
            ask_ns: self.slot.diagnostic.ask_ns.min(now_ns + ASK_NS),
            present: true,
            unanswered: 0,
        };
    }

    /// The next answer of the server.
    pub(super) fn grant_server(&mut self) -> Option<Grant> {
        if self.slot.server.pending() == 0 {
            return None;
        }
        let mut data = [0; SERVICE_DATA_MAX];
        let (client, len) = self.slot.server.poll_transmit(&mut data)?;
        Some(self.write_asnd(client, &Asnd::Sdo(&data[..len]), Own::Sdo))
    }

    /// A slot for the diagnostic device: to send what it has, or to say whether it has something.
    pub(super) fn grant_diagnostic(&mut self, now_ns: u64) -> Option<Grant> {
        let searching = self.state.is_isochronous() || self.state == NmtState::PreOperational1;
        if !self.config.diagnostic_device || !searching {
            return None;
        }
        if self.slot.diagnostic.requests.count > 0 {
            self.slot.diagnostic.requests.count -= 1;
            let service = RequestedService::UnspecifiedInvite;
            // After the last one it may have more.
            self.slot.diagnostic.ask_ns = now_ns;
            return Some(Grant::Diagnostic { service });
        }
        if now_ns < self.slot.diagnostic.ask_ns {
            return None;
        }
        self.slot.diagnostic.ask_ns = now_ns
            + if self.slot.diagnostic.present {
                ASK_NS
            } else {
                SEARCH_NS
            };
        let service = RequestedService::IdentRequest;
        Some(Grant::Diagnostic { service })
    }

    /// The diagnostic device left its slot unused.
    pub(super) fn diagnostic_missed(&mut self) {
        if !self.slot.diagnostic.present {
            // It need not be there.
            return;
        }
        self.counters.async_timeouts += 1;
        self.slot.diagnostic.unanswered += 1;
        if self.slot.diagnostic.unanswered >= UNANSWERED_MAX {
            self.slot.diagnostic = DiagnosticDevice {
                ask_ns: self.slot.diagnostic.ask_ns,
                ..DiagnosticDevice::default()
            };
        }
    }
}
