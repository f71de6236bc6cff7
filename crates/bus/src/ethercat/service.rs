//! The half of the bus that is not real time: requests of clients, and what the main device knows, in words.
//!
//! In:  records and replies of the publisher (`publisher.rs`). Out: [`Mailbox`], [`Diagnose`].

use super::Counted;
use super::publisher::{Buffer, Order, Record, Refused, Reply};
use crate::service::{
    Diagnose, IdentityView, Mailbox, MailboxError, MailboxFull, MailboxReply, MailboxRequest, NetworkLive, NodeLive,
    Why,
};
use crate::{NodeIndex, SDO_ORDERS, SDO_VALUE_MAX};
use ethercat::main::{Counters, DeviceState, Diagnosis, Event, Punctuality, SetupError};
use ethercat::wire::coe::Object;
use ethercat::wire::register::AlState;

/// What is known of a node.
type Known = (Diagnosis, Counted, Option<Punctuality>);

/// This half's ends of the rings, and the latest of what came through them.
pub struct EthercatService {
    records: rtrb::Consumer<Record>,
    orders: rtrb::Producer<Order>,
    replies: rtrb::Consumer<Reply>,
    /// A buffer for each order under way.
    buffers: Vec<Buffer>,
    network: Option<NetworkLive>,
    nodes: Vec<Option<Known>>,
}

impl EthercatService {
    /// For a network of so many nodes.
    pub(super) fn new(
        nodes: usize,
        (records, orders, replies): (rtrb::Consumer<Record>, rtrb::Producer<Order>, rtrb::Consumer<Reply>),
    ) -> EthercatService {
        EthercatService {
            records,
            orders,
            replies,
            buffers: (0..SDO_ORDERS).map(|_| Box::new([0; SDO_VALUE_MAX])).collect(),
            network: None,
            nodes: vec![None; nodes],
        }
    }

    fn update(&mut self) {
        while let Ok(record) = self.records.pop() {
            match record {
                Record::Node(node, diagnosis, counted, punctuality) => {
                    if let Some(latest) = self.nodes.get_mut(node) {
                        *latest = Some((diagnosis, counted, punctuality));
                    }
                }
                Record::Network {
                    stage,
                    devices,
                    operational,
                    counters,
                } => self.network = Some(network_live(stage, devices, operational, counters)),
            }
        }
    }
}

impl Mailbox for EthercatService {
    fn request(&mut self, request: MailboxRequest) -> Result<(), MailboxFull> {
        if self.orders.is_full() {
            return Err(MailboxFull);
        }
        let mut buffer = self.buffers.pop().ok_or(MailboxFull)?;
        let write = request.value.map(|value| {
            let octets = value.len().min(buffer.len());
            buffer[..octets].copy_from_slice(&value[..octets]);
            octets
        });
        let order = Order {
            ticket: request.ticket,
            node: request.node,
            object: Object {
                index: request.index,
                sub: request.sub,
                complete: false,
            },
            write,
            buffer,
        };
        // There is room: nobody else puts anything in.
        self.orders.push(order).map_err(|_| MailboxFull)
    }

    fn reply(&mut self) -> Option<MailboxReply> {
        // Also where nobody asks for them: a full ring would keep old ones.
        self.update();
        let Reply { ticket, result, buffer } = self.replies.pop().ok()?;
        let result = match result {
            Ok(octets) => Ok(buffer[..octets].to_vec()),
            Err(Refused::Failed(SetupError::Sdo { code, .. })) => Err(MailboxError::Aborted(code)),
            Err(Refused::Failed(error)) => Err(MailboxError::Failed(error.to_string())),
            Err(Refused::NoNode) => Err(MailboxError::Failed("there is no such node".into())),
        };
        self.buffers.push(buffer);
        Some(MailboxReply { ticket, result })
    }
}

impl Diagnose for EthercatService {
    fn network(&mut self, _now_ns: u64) -> Option<NetworkLive> {
        self.update();
        self.network.clone()
    }

    fn node(&mut self, node: NodeIndex, _now_ns: u64) -> Option<NodeLive> {
        self.update();
        self.nodes.get(node)?.as_ref().map(node_live)
    }
}

fn network_live(stage: &str, devices: usize, operational: bool, counters: Counters) -> NetworkLive {
    NetworkLive {
        nmt_state: if operational { AlState::Op } else { AlState::Init }.to_string(),
        why: (!operational).then(|| format!("{stage}; {devices} devices are on the wire")),
        foreign: (counters.foreign > 0).then(|| format!("another main device, {} frames", counters.foreign)),
        cycles: counters.cycles.into(),
        cycles_skipped: 0,
        cycles_overrun: 0,
        async_timeouts: counters.services_lost.into(),
        bad_frames: counters.late.into(),
    }
}

fn node_live((diagnosis, counted, punctuality): &Known) -> NodeLive {
    let text = |error: SetupError| Why {
        text: error.to_string(),
        ..of_object(error)
    };
    let position = diagnosis
        .position
        .map(|position| format!(" at position {}", position + 1));
    let punctuality = punctuality.map(|of| format!("; {of}"));
    NodeLive {
        operational: diagnosis.state == DeviceState::Operational,
        nmt_state: diagnosis.al_state.to_string(),
        expected_nmt_state: AlState::Op.to_string(),
        stage: format!(
            "{}{}{}",
            diagnosis.stage,
            position.unwrap_or_default(),
            punctuality.unwrap_or_default()
        ),
        why: diagnosis.why.map(text),
        last_fault: counted.last_fault.map(fault_text),
        identity: diagnosis.identity.map(|identity| IdentityView {
            device_type: diagnosis.device_type.unwrap_or(0),
            vendor_id: identity.vendor,
            product_code: identity.product,
            revision: identity.revision,
            serial: identity.serial,
            ..IdentityView::default()
        }),
        errors: counted.last_error.iter().map(|code| format!("{code:04X}h")).collect(),
        errors_total: counted.errors,
        polls: counted.polls,
        lost: counted.lost,
        lost_in_row_max: counted.lost_in_row_max,
        late: 0,
        refused: counted.refused,
        response_max_us: counted.response_ns_max as f64 / 1e3,
        boots: counted.boots,
        faults: counted.faults,
    }
}

/// What went wrong with a device, told of itself.
fn fault_text(fault: Event) -> String {
    match fault {
        Event::Failed { error, .. } => error.to_string(),
        Event::Left { at, code, .. } => format!("left OP and was in {at}: {code}"),
        Event::Lost {
            working_counter,
            expected,
            ..
        } => format!("lost, with a working counter of {working_counter} and not {expected}"),
        other => other.to_string(),
    }
}

/// The object that an error is about, as it should be and as it is.
fn of_object(error: SetupError) -> Why {
    let (object, expected, actual) = match error {
        SetupError::Differs {
            object,
            expected,
            found,
        } => (Some(object), Some(expected), Some(found)),
        SetupError::Sdo { object, .. } | SetupError::SdoTimeout { object } => (Some(object), None, None),
        _ => (None, None, None),
    };
    let number = |value: u32| format!("0x{value:08X}");
    Why {
        text: String::new(),
        object: object.map(|object| crate::service::object(object.index, object.sub)),
        expected: expected.map(number),
        actual: actual.map(number),
    }
}
