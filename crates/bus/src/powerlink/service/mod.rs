//! The half of the bus that is not real time: requests of clients, and what the managing node knows, in words.
//!
//! In:  records and replies of the publisher (`publisher.rs`). Out: [`Mailbox`], [`Diagnose`].

use super::publisher::{Buffer, Order, Record, Reply};
use crate::service::{
    Diagnose, IdentityView, Mailbox, MailboxError, MailboxFull, MailboxReply, MailboxRequest, NetworkLive, NodeLive,
    Why,
};
use crate::{NodeIndex, SDO_ORDERS, SDO_VALUE_MAX};
use powerlink::mn::{Counters, Diagnosis, Fault, NetworkDiagnosis, NodeState, Reason, SdoCommand, SdoError, Span};
use powerlink::sdo::ClientError;
use powerlink::wire::IdentResponse;

/// This half's ends of the rings, and the latest of what came through them.
pub struct PowerlinkService {
    records: rtrb::Consumer<Record>,
    orders: rtrb::Producer<Order>,
    replies: rtrb::Consumer<Reply>,
    /// A buffer for each order under way.
    buffers: Vec<Buffer>,
    /// Orders under way that write: their replies have no value.
    writing: Vec<u64>,
    /// The latest record of the network and of each node.
    network: Option<(NetworkDiagnosis, Counters)>,
    nodes: Vec<Option<Diagnosis>>,
}

impl PowerlinkService {
    /// For a network of so many nodes.
    pub(super) fn new(
        nodes: usize,
        (records, orders, replies): (rtrb::Consumer<Record>, rtrb::Producer<Order>, rtrb::Consumer<Reply>),
    ) -> PowerlinkService {
        PowerlinkService {
            records,
            orders,
            replies,
            buffers: (0..SDO_ORDERS).map(|_| Box::new([0; SDO_VALUE_MAX])).collect(),
            writing: Vec::new(),
            network: None,
            nodes: vec![None; nodes],
        }
    }

    fn update(&mut self) {
        while let Ok(record) = self.records.pop() {
            match record {
                Record::Node(node, diagnosis) => {
                    if let Some(latest) = self.nodes.get_mut(node) {
                        *latest = Some(diagnosis);
                    }
                }
                Record::Network(network, counters) => self.network = Some((network, counters)),
            }
        }
    }
}

impl Mailbox for PowerlinkService {
    fn request(&mut self, request: MailboxRequest) -> Result<(), MailboxFull> {
        if self.orders.is_full() {
            return Err(MailboxFull);
        }
        let mut buffer = self.buffers.pop().ok_or(MailboxFull)?;
        let MailboxRequest {
            ticket,
            node,
            index,
            sub,
            value,
        } = request;
        let command = match value {
            Some(value) => {
                let octets = value.len().min(buffer.len());
                buffer[..octets].copy_from_slice(&value[..octets]);
                self.writing.push(ticket);
                SdoCommand::Write { index, sub, octets }
            }
            None => SdoCommand::Read { index, sub },
        };
        let order = Order {
            ticket,
            node,
            command,
            buffer,
        };
        // There is room: nobody else puts anything in.
        self.orders.push(order).map_err(|_| MailboxFull)
    }

    fn reply(&mut self) -> Option<MailboxReply> {
        // Also where nobody asks for them: a full ring would keep old ones.
        self.update();
        let Reply { ticket, result, buffer } = self.replies.pop().ok()?;
        let wrote = self.writing.iter().position(|writing| *writing == ticket);
        if let Some(place) = wrote {
            self.writing.swap_remove(place);
        }
        let result = match result {
            Ok(_) if wrote.is_some() => Ok(Vec::new()),
            Ok(octets) => Ok(buffer[..octets].to_vec()),
            Err(SdoError::Client(ClientError::Aborted(abort))) => Err(MailboxError::Aborted(abort)),
            Err(error) => Err(MailboxError::Failed(error.to_string())),
        };
        self.buffers.push(buffer);
        Some(MailboxReply { ticket, result })
    }
}

impl Diagnose for PowerlinkService {
    fn network(&mut self, now_ns: u64) -> Option<NetworkLive> {
        self.update();
        let (network, counters) = self.network.as_ref()?;
        Some(network_live(network, counters, now_ns))
    }

    fn node(&mut self, node: NodeIndex, now_ns: u64) -> Option<NodeLive> {
        self.update();
        let diagnosis = self.nodes.get(node)?.as_ref()?;
        Some(node_live(diagnosis, now_ns))
    }
}

impl From<&IdentResponse> for IdentityView {
    fn from(ident: &IdentResponse) -> IdentityView {
        let [a, b, c, d] = ident.ip_address.to_be_bytes();
        let name = &ident.host_name;
        let end = name.iter().position(|octet| *octet == 0).unwrap_or(name.len());
        IdentityView {
            device_type: ident.device_type,
            vendor_id: ident.vendor_id,
            product_code: ident.product_code,
            revision: ident.revision,
            serial: ident.serial,
            feature_flags: ident.feature_flags,
            response_time_us: f64::from(ident.response_time_ns) / 1e3,
            mtu: ident.mtu,
            poll_in_octets: ident.poll_in_size,
            poll_out_octets: ident.poll_out_size,
            configuration_date: ident.configuration_date,
            configuration_time: ident.configuration_time,
            software_date: ident.software_date,
            software_time: ident.software_time,
            ip_address: format!("{a}.{b}.{c}.{d}"),
            // Whatever a node says: no control characters on a terminal.
            host_name: name[..end].escape_ascii().to_string(),
        }
    }
}

/// A node as the managing node knows it; `now_ns` by its clock.
fn node_live(node: &Diagnosis, now_ns: u64) -> NodeLive {
    let statistics = &node.statistics;
    NodeLive {
        operational: node.state == NodeState::Operational,
        nmt_state: node.nmt_state.to_string(),
        expected_nmt_state: node.expected_nmt_state.to_string(),
        stage: node.stage.to_string(),
        why: node.reason.map(|reason| why(reason, now_ns)),
        last_fault: node.last_fault.map(|last| {
            let times = if last.count > 1 {
                format!(", {} times in a row", last.count)
            } else {
                String::new()
            };
            format!("{}{times}, {}", last.fault, ago(now_ns, last.at_ns))
        }),
        identity: node.ident.as_ref().map(|(_, ident)| ident.into()),
        errors: node
            .errors
            .newest_first()
            .map(|error| format!("{}, {}", error.entry, ago(now_ns, error.at_ns)))
            .collect(),
        errors_total: node.errors.total(),
        polls: statistics.preq_sent,
        lost: statistics.pres_lost,
        lost_in_row_max: statistics.lost_in_row_max,
        late: statistics.pres_late,
        refused: statistics.pres_short + statistics.pres_version,
        response_max_us: f64::from(statistics.response_ns_max) / 1e3,
        boots: statistics.boots,
        faults: statistics.faults,
    }
}

/// The network as the managing node knows it; `now_ns` by its clock.
fn network_live(network: &NetworkDiagnosis, counters: &Counters, now_ns: u64) -> NetworkLive {
    NetworkLive {
        nmt_state: network.state.to_string(),
        why: network.reason.map(|reason| reason.at(now_ns).to_string()),
        foreign: network.foreign_mn.map(|foreign| {
            format!(
                "{}, {} frames, the last {}",
                foreign.sign,
                foreign.frames,
                ago(now_ns, foreign.heard_ns)
            )
        }),
        cycles: counters.cycles,
        cycles_skipped: counters.cycles_skipped,
        cycles_overrun: counters.cycles_overrun,
        async_timeouts: counters.async_timeouts,
        bad_frames: counters.malformed.total() + counters.unexpected + counters.unknown_node,
    }
}

/// Why a node is not operational; `now_ns` by the clock of the managing node.
fn why(reason: Reason, now_ns: u64) -> Why {
    let text = reason.at(now_ns).to_string();
    match reason.fault() {
        Some(cause) => Why { text, ..fault(cause) },
        None => Why {
            text,
            object: None,
            expected: None,
            actual: None,
        },
    }
}

/// What went wrong with a node: object, what was expected, what came.
fn fault(fault: Fault) -> Why {
    Why {
        text: fault.to_string(),
        object: fault.object().map(|object| object.to_string()),
        expected: fault.expected().map(|value| value.to_string()),
        actual: fault.found().map(|value| value.to_string()),
    }
}

fn ago(now_ns: u64, at_ns: u64) -> String {
    format!("{} ago", Span(now_ns.saturating_sub(at_ns)))
}

#[cfg(test)]
mod tests;
