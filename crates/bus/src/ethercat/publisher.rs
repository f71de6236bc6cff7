//! What the cycle thread shows of the main device, and the objects that it reads and writes for others.
//!
//! In:  orders to read or write one object, each with the buffer for its value.
//! Out: every few cycles a [`Record`] of one node or of the network, in turn; the buffers back, with results.
//!
//! RT in [`Publisher::publish`]: everything goes through rings of fixed size; what finds them full is left out until next time.

use super::Counted;
use super::service::EthercatService;
use crate::{NodeIndex, SDO_ORDERS, SDO_VALUE_MAX};
use ethercat::main::{Counters, Diagnosis, MainDevice, Punctuality, SetupError};
use ethercat::wire::coe::Object;

/// Cycles from one record to the next: a network of 239 nodes has been shown within a second.
const RECORD_CYCLES: u64 = 4;
/// Records that can wait for the reader.
const RECORDS: usize = 64;

/// A part of the network at one moment.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "of fixed size, without allocation")]
pub(super) enum Record {
    Node(NodeIndex, Diagnosis, Counted, Option<Punctuality>),
    Network {
        stage: &'static str,
        devices: usize,
        operational: bool,
        counters: Counters,
    },
}

/// A request on its way to the cycle thread.
pub(super) struct Order {
    pub(super) ticket: u64,
    pub(super) node: NodeIndex,
    pub(super) object: Object,
    /// Octets at the start of the buffer that are written; `None`: the object is read.
    pub(super) write: Option<usize>,
    pub(super) buffer: Buffer,
}

/// How it ended: octets of the value that was read, at the start of the buffer; 0 after a write.
pub(super) struct Reply {
    pub(super) ticket: u64,
    pub(super) result: Result<usize, Refused>,
    pub(super) buffer: Buffer,
}

/// Why an order was not carried out.
#[derive(Clone, Copy, Debug)]
pub(super) enum Refused {
    /// There is no such node.
    NoNode,
    Failed(SetupError),
}

/// Memory for the value of an order. It goes through the rings, so that nothing is allocated or freed in real time.
pub(super) type Buffer = Box<[u8; SDO_VALUE_MAX]>;

/// The cycle thread's ends of the rings.
pub(super) struct Publisher {
    records: rtrb::Producer<Record>,
    orders: rtrb::Consumer<Order>,
    replies: rtrb::Producer<Reply>,
    /// Orders that the main device carries out: its number, the ticket, the buffer.
    running: [Option<(usize, u64, Buffer)>; SDO_ORDERS],
    nodes: usize,
    /// Node of the next record; behind the last one it is the network's turn.
    next: NodeIndex,
}

/// Rings for a network of so many nodes. Not RT.
pub(super) fn rings(nodes: usize) -> (Publisher, EthercatService) {
    let (records_in, records) = rtrb::RingBuffer::new(RECORDS);
    let (orders, orders_out) = rtrb::RingBuffer::new(SDO_ORDERS);
    let (replies_in, replies) = rtrb::RingBuffer::new(SDO_ORDERS);
    let publisher = Publisher {
        records: records_in,
        orders: orders_out,
        replies: replies_in,
        running: [const { None }; SDO_ORDERS],
        nodes,
        next: 0,
    };
    let service = EthercatService::new(nodes, (records, orders, replies));
    (publisher, service)
}

impl Publisher {
    /// Shows the next part of the network when it is due, takes an order, gives back what has ended. RT: bounded.
    pub(super) fn publish<const N: usize, const F: usize>(
        &mut self,
        cycle: u64,
        main: &mut MainDevice<'_, N, F>,
        counted: &[Counted],
    ) {
        if cycle.is_multiple_of(RECORD_CYCLES) && !self.records.is_full() {
            self.show(main, counted);
        }
        self.accept(main);
        for place in 0..SDO_ORDERS {
            let Some((order, _, buffer)) = &mut self.running[place] else {
                continue;
            };
            let Some(result) = main.sdo_result(*order) else {
                continue;
            };
            let result = result.map(|value| {
                let octets = value.len().min(buffer.len());
                buffer[..octets].copy_from_slice(&value[..octets]);
                octets
            });
            if let Some((_, ticket, buffer)) = self.running[place].take() {
                self.reply(ticket, result.map_err(Refused::Failed), buffer);
            }
        }
    }

    fn show<const N: usize, const F: usize>(&mut self, main: &MainDevice<'_, N, F>, counted: &[Counted]) {
        let node = self.next;
        let of_node = main.diagnosis(node).zip(counted.get(node));
        let record = match of_node {
            Some((diagnosis, counted)) => Record::Node(node, diagnosis, *counted, main.punctuality(node)),
            None => Record::Network {
                stage: main.stage_text(),
                devices: main.count(),
                operational: main.is_operational(),
                counters: main.counters(),
            },
        };
        self.next = if node < self.nodes { node + 1 } else { 0 };
        // There is room; should it be gone, the next one tells more anyway.
        let _ = self.records.push(record);
    }

    fn accept<const N: usize, const F: usize>(&mut self, main: &mut MainDevice<'_, N, F>) {
        let Some(place) = self.running.iter().position(Option::is_none) else {
            return;
        };
        let Ok(Order {
            ticket,
            node,
            object,
            write,
            buffer,
        }) = self.orders.pop()
        else {
            return;
        };
        if node >= self.nodes {
            self.reply(ticket, Err(Refused::NoNode), buffer);
            return;
        }
        let order = match write {
            Some(octets) => main.sdo_write(node, object, &buffer[..octets.min(SDO_VALUE_MAX)]),
            None => main.sdo_read(node, object),
        };
        match order {
            Some(order) => self.running[place] = Some((order, ticket, buffer)),
            // As many places as orders: it cannot be.
            None => self.reply(ticket, Err(Refused::Failed(SetupError::Gone)), buffer),
        }
    }

    fn reply(&mut self, ticket: u64, result: Result<usize, Refused>, buffer: Buffer) {
        // There are as many places as buffers.
        let _ = self.replies.push(Reply { ticket, result, buffer });
    }
}
