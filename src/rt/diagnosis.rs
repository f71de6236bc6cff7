//! What the cycle thread shows of the bus, and the parameters that it reads and writes for others.
//!
//! In:  orders to read or write one object, each with the buffer for its value.
//! Out: every few cycles a [`Record`] of one node or of the network, in turn; the buffers back, with results.
//!
//! RT in [`Outlet::attend`]: everything goes through rings of fixed size; what finds them full is left out until next time.

use crate::bus::{Fieldbus, NodeIndex, SDO_ORDERS, SDO_VALUE_MAX};
use powerlink::mn::{Counters, Diagnosis, NetworkDiagnosis, SdoCommand, SdoError};

/// Cycles from one record to the next: a network of 239 nodes has been shown within a second.
const RECORD_CYCLES: u64 = 4;
/// Records that can wait for the reader.
const RECORDS: usize = 64;

/// A part of the bus at one moment.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "of fixed size, without allocation")]
pub enum Record {
    /// One node.
    Node(NodeIndex, Diagnosis),
    /// The network as a whole.
    Network(NetworkDiagnosis, Counters),
}

/// An order to read or write one object of one node.
#[derive(Debug)]
pub struct SdoOrder {
    /// Comes back with the result.
    pub ticket: u64,
    /// Which node.
    pub node: NodeIndex,
    /// What to do; the value to write stands at the start of the buffer.
    pub command: SdoCommand,
    /// Memory for the value.
    pub buffer: Buffer,
}

/// How an order ended.
#[derive(Debug)]
pub struct SdoReply {
    /// That of the order.
    pub ticket: u64,
    /// Octets of the value that was read, at the start of the buffer; 0 after a write.
    pub result: Result<usize, SdoError>,
    /// The buffer of the order.
    pub buffer: Buffer,
}

/// Memory for the value of an order. It goes through the rings, so that nothing is allocated or freed in real time.
pub type Buffer = Box<[u8; SDO_VALUE_MAX]>;

/// The cycle thread's ends of the rings.
pub struct Outlet {
    records: rtrb::Producer<Record>,
    orders: rtrb::Consumer<SdoOrder>,
    replies: rtrb::Producer<SdoReply>,
    /// For each node: the order that the bus carries out.
    running: Box<[Option<(u64, Buffer)>]>,
    /// Node of the next record; behind the last one it is the network's turn.
    next: NodeIndex,
}

/// The other ends.
pub struct Inlet {
    /// What the bus is like.
    pub records: rtrb::Consumer<Record>,
    /// Orders; there is room for all that have a buffer.
    pub orders: rtrb::Producer<SdoOrder>,
    /// Results.
    pub replies: rtrb::Consumer<SdoReply>,
    /// A buffer for each order under way.
    pub buffers: Vec<Buffer>,
}

/// Rings for a bus of so many nodes. Not RT.
pub fn rings(nodes: usize) -> (Outlet, Inlet) {
    let (records_in, records) = rtrb::RingBuffer::new(RECORDS);
    let (orders, orders_out) = rtrb::RingBuffer::new(SDO_ORDERS);
    let (replies_in, replies) = rtrb::RingBuffer::new(SDO_ORDERS);
    let outlet = Outlet {
        records: records_in,
        orders: orders_out,
        replies: replies_in,
        running: (0..nodes).map(|_| None).collect(),
        next: 0,
    };
    let inlet = Inlet {
        records,
        orders,
        replies,
        buffers: (0..SDO_ORDERS).map(|_| Box::new([0; SDO_VALUE_MAX])).collect(),
    };
    (outlet, inlet)
}

impl Outlet {
    /// Shows the next part of the bus when it is due, takes an order, gives back what has ended. RT: bounded by the number of
    /// nodes.
    pub fn attend(&mut self, cycle: u64, bus: &mut impl Fieldbus) {
        if cycle.is_multiple_of(RECORD_CYCLES) && !self.records.is_full() {
            self.show(bus);
        }
        self.take_order(bus);
        for node in 0..self.running.len() {
            let Some((_, buffer)) = &mut self.running[node] else {
                continue;
            };
            if let Some(result) = bus.sdo_result(node, &mut buffer[..])
                && let Some((ticket, buffer)) = self.running[node].take()
            {
                self.reply(ticket, result, buffer);
            }
        }
    }

    fn show(&mut self, bus: &impl Fieldbus) {
        let record = match bus.diagnosis(self.next) {
            Some(diagnosis) => Record::Node(self.next, diagnosis),
            None => {
                let (network, counters) = bus.network_diagnosis();
                Record::Network(network, counters)
            }
        };
        self.next = if matches!(record, Record::Network(..)) {
            0
        } else {
            self.next + 1
        };
        // There is room; should it be gone, the next one tells more anyway.
        let _ = self.records.push(record);
    }

    fn take_order(&mut self, bus: &mut impl Fieldbus) {
        let Ok(SdoOrder {
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
            Some(place @ None) => match bus.sdo_request(node, command, &buffer[..]) {
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
        let _ = self.replies.push(SdoReply { ticket, result, buffer });
    }
}
