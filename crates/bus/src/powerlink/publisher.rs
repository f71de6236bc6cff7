//! What the cycle thread shows of the managing node, and the objects that it reads and writes for others.
//!
//! In:  orders to read or write one object, each with the buffer for its value.
//! Out: every few cycles a [`Record`] of one node or of the network, in turn; the buffers back, with results.
//!
//! RT in [`Publisher::publish`]: everything goes through rings of fixed size; what finds them full is left out until next time.

use super::service::PowerlinkService;
use crate::{NodeIndex, SDO_ORDERS, SDO_VALUE_MAX};
use powerlink::mn::{Counters, Diagnosis, Mn, NetworkDiagnosis, SdoCommand, SdoError};

/// Cycles from one record to the next: a network of 239 nodes has been shown within a second.
const RECORD_CYCLES: u64 = 4;
/// Records that can wait for the reader.
const RECORDS: usize = 64;

/// A part of the network at one moment.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "of fixed size, without allocation")]
pub(super) enum Record {
    Node(NodeIndex, Diagnosis),
    Network(NetworkDiagnosis, Counters),
}

/// A request on its way to the cycle thread.
pub(super) struct Order {
    pub(super) ticket: u64,
    pub(super) node: NodeIndex,
    pub(super) command: SdoCommand,
    pub(super) buffer: Buffer,
}

/// How it ended: octets of the value that was read, at the start of the buffer; 0 after a write.
pub(super) struct Reply {
    pub(super) ticket: u64,
    pub(super) result: Result<usize, SdoError>,
    pub(super) buffer: Buffer,
}

/// Memory for the value of an order. It goes through the rings, so that nothing is allocated or freed in real time.
pub(super) type Buffer = Box<[u8; SDO_VALUE_MAX]>;

/// Values of commands under way; those that are missing are with the managing node, which borrows them for as long as its
/// configuration: they are never freed.
pub(super) struct SdoBuffers<'a>([Option<&'a mut [u8]>; SDO_ORDERS]);

impl<'a> SdoBuffers<'a> {
    pub(super) fn new() -> SdoBuffers<'a> {
        SdoBuffers(std::array::from_fn(|_| Some(&mut *vec![0; SDO_VALUE_MAX].leak())))
    }

    /// RT: begins a command; the value to write stands at the start of `value`.
    fn request<const NODES: usize>(
        &mut self,
        mn: &mut Mn<'a, NODES>,
        node: NodeIndex,
        command: SdoCommand,
        value: &[u8],
    ) -> Result<(), SdoError> {
        let place = self.0.iter_mut().find(|place| place.is_some());
        let Some((place, buffer)) = place.and_then(|place| place.take().map(|buffer| (place, buffer))) else {
            return Err(SdoError::Busy);
        };
        let length = value.len().min(buffer.len());
        buffer[..length].copy_from_slice(&value[..length]);
        mn.sdo_request(node, command, buffer).map_err(|refused| {
            *place = Some(refused.buffer);
            refused.error
        })
    }

    /// RT: what became of it: octets that were read, now at the start of `value`. `None` while it runs, or when there is none.
    fn result<const NODES: usize>(
        &mut self,
        mn: &mut Mn<'a, NODES>,
        node: NodeIndex,
        value: &mut [u8],
    ) -> Option<Result<usize, SdoError>> {
        let ended = mn.sdo_result(node)?;
        let length = ended.result.unwrap_or(0).min(value.len()).min(ended.buffer.len());
        value[..length].copy_from_slice(&ended.buffer[..length]);
        // As many places as buffers.
        if let Some(place) = self.0.iter_mut().find(|place| place.is_none()) {
            *place = Some(ended.buffer);
        }
        Some(ended.result.map(|_| length))
    }
}

/// The cycle thread's ends of the rings.
pub(super) struct Publisher {
    pub(super) records: rtrb::Producer<Record>,
    orders: rtrb::Consumer<Order>,
    replies: rtrb::Producer<Reply>,
    /// For each node: the order that the bus carries out.
    running: Box<[Option<(u64, Buffer)>]>,
    /// Node of the next record; behind the last one it is the network's turn.
    next: NodeIndex,
}

/// Rings for a network of so many nodes. Not RT.
pub(super) fn rings(nodes: usize) -> (Publisher, PowerlinkService) {
    let (records_in, records) = rtrb::RingBuffer::new(RECORDS);
    let (orders, orders_out) = rtrb::RingBuffer::new(SDO_ORDERS);
    let (replies_in, replies) = rtrb::RingBuffer::new(SDO_ORDERS);
    let publisher = Publisher {
        records: records_in,
        orders: orders_out,
        replies: replies_in,
        running: (0..nodes).map(|_| None).collect(),
        next: 0,
    };
    let service = PowerlinkService::new(nodes, (records, orders, replies));
    (publisher, service)
}

impl Publisher {
    /// Shows the next part of the network when it is due, takes an order, gives back what has ended. RT: bounded by the number
    /// of nodes.
    pub(super) fn publish<'a, const NODES: usize>(
        &mut self,
        cycle: u64,
        mn: &mut Mn<'a, NODES>,
        buffers: &mut SdoBuffers<'a>,
    ) {
        if cycle.is_multiple_of(RECORD_CYCLES) && !self.records.is_full() {
            self.show(mn);
        }
        self.accept(mn, buffers);
        for node in 0..self.running.len() {
            let Some((_, buffer)) = &mut self.running[node] else {
                continue;
            };
            if let Some(result) = buffers.result(mn, node, &mut buffer[..])
                && let Some((ticket, buffer)) = self.running[node].take()
            {
                self.reply(ticket, result, buffer);
            }
        }
    }

    fn show<const NODES: usize>(&mut self, mn: &Mn<'_, NODES>) {
        let record = match mn.diagnosis(self.next) {
            Some(diagnosis) => Record::Node(self.next, diagnosis),
            None => Record::Network(mn.network_diagnosis(), *mn.counters()),
        };
        self.next = if matches!(record, Record::Network(..)) {
            0
        } else {
            self.next + 1
        };
        // There is room; should it be gone, the next one tells more anyway.
        let _ = self.records.push(record);
    }

    fn accept<'a, const NODES: usize>(&mut self, mn: &mut Mn<'a, NODES>, buffers: &mut SdoBuffers<'a>) {
        let Ok(Order {
            ticket,
            node,
            command,
            buffer,
        }) = self.orders.pop()
        else {
            return;
        };
        let place = self.running.get_mut(node);
        let result = match place {
            None => Err(SdoError::NoNode),
            Some(Some(_)) => Err(SdoError::Busy),
            Some(place @ None) => match buffers.request(mn, node, command, &buffer[..]) {
                Ok(()) => {
                    *place = Some((ticket, buffer));
                    return;
                }
                Err(error) => Err(error),
            },
        };
        self.reply(ticket, result, buffer);
    }

    fn reply(&mut self, ticket: u64, result: Result<usize, SdoError>, buffer: Buffer) {
        // There are as many places as buffers.
        let _ = self.replies.push(Reply { ticket, result, buffer });
    }
}
