//! The device of these tests: a controlled node whose process data show whether they are whole and how old they are.
//!
//! In:  the number of a cycle. Out: a pattern of three fields that belong together, written and checked at both ends.

use obd::cdc::CdcWriter;
use obd::{DataType, Dictionary, EntryDef, Key, lines_of, octets_of};
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, CnConfig};
use powerlink::mn::{Assignment, Identity, NodeConfig};
use powerlink::wire::Mac;

/// Length of the cycle of all tests unless they say otherwise, in ns.
pub const CYCLE_NS: u64 = 1_000_000;
/// What a node takes to answer, in ns.
pub const ANSWER_NS: u64 = 15_000;
/// Time-out of every PRes, in ns.
pub const PRES_TIMEOUT_NS: u32 = 60_000;
/// MAC of the managing node.
pub const MN_MAC: Mac = [2, 0, 0, 0, 0, 0xF0];
/// Writes of the configuration of a node that is polled in every cycle.
pub const WRITES: u64 = 17;
/// Octets of process data in each direction.
pub const PDO_BYTES: usize = 10;

/// Room in the object 0x2002: takes several segments.
pub const BLOB_BYTES: usize = 1_000;

const DEVICE_TYPE: u32 = 0x000F_0191;
const PRODUCT: u32 = 0x50;
/// Outputs 0x2000, inputs 0x2001: number, its complement, and a mix of both. 0x2002 has nothing to do with them.
const DEVICE: &[EntryDef] = &[
    EntryDef::rw(0x2000, DataType::U32, "number").sub(1).rpdo(),
    EntryDef::rw(0x2000, DataType::U32, "complement").sub(2).rpdo(),
    EntryDef::rw(0x2000, DataType::U16, "mix").sub(3).rpdo(),
    EntryDef::ro(0x2001, DataType::U32, "number").sub(1).tpdo(),
    EntryDef::ro(0x2001, DataType::U32, "complement").sub(2).tpdo(),
    EntryDef::ro(0x2001, DataType::U16, "mix").sub(3).tpdo(),
    EntryDef::rw(0x2002, DataType::Domain, "blob").capacity(BLOB_BYTES as u16),
];
/// A controlled node with that device.
pub type Node = Cn<{ COMMUNICATION_ENTRIES + lines_of(DEVICE) }, { COMMUNICATION_BYTES + octets_of(DEVICE) }>;

/// The number of a cycle and the node it is meant for, three times over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// Cycle in the upper 24 bits, node id below.
    pub number: u32,
    complement: u32,
    mix: u16,
}

impl Pattern {
    pub fn new(cycle: u64, node: u8) -> Pattern {
        let number = ((cycle as u32) << 8) | u32::from(node);
        Pattern {
            number,
            complement: !number,
            mix: (number ^ (number >> 13)) as u16,
        }
    }

    pub fn cycle(self) -> u32 {
        self.number >> 8
    }

    pub fn octets(self) -> [u8; PDO_BYTES] {
        let mut octets = [0; PDO_BYTES];
        octets[0..4].copy_from_slice(&self.number.to_le_bytes());
        octets[4..8].copy_from_slice(&self.complement.to_le_bytes());
        octets[8..10].copy_from_slice(&self.mix.to_le_bytes());
        octets
    }

    pub fn from_octets(octets: &[u8]) -> Pattern {
        Pattern {
            number: u32::from_le_bytes(octets[0..4].try_into().unwrap()),
            complement: u32::from_le_bytes(octets[4..8].try_into().unwrap()),
            mix: u16::from_le_bytes(octets[8..10].try_into().unwrap()),
        }
    }

    /// All fields are of one cycle, and of this node.
    pub fn is_whole(self, node: u8) -> bool {
        self == Pattern::new(u64::from(self.cycle()), node)
    }
}

/// Where a node keeps its pattern.
#[derive(Clone, Copy)]
pub struct Fields {
    number: Key<u32>,
    complement: Key<u32>,
    mix: Key<u16>,
}

impl Fields {
    pub fn of(node: &Node, index: u16) -> Fields {
        let dictionary = node.dictionary();
        Fields {
            number: dictionary.key(index, 1).unwrap(),
            complement: dictionary.key(index, 2).unwrap(),
            mix: dictionary.key(index, 3).unwrap(),
        }
    }

    pub fn read(&self, node: &Node) -> Pattern {
        Pattern {
            number: node.dictionary().get(self.number),
            complement: node.dictionary().get(self.complement),
            mix: node.dictionary().get(self.mix),
        }
    }

    pub fn write(&self, node: &mut Node, pattern: Pattern) {
        let dictionary = node.dictionary_mut();
        dictionary.set(self.number, pattern.number);
        dictionary.set(self.complement, pattern.complement);
        dictionary.set(self.mix, pattern.mix);
    }
}

/// MAC of a controlled node.
pub fn mac(id: u8) -> Mac {
    [2, 0, 0, 0, 1, id]
}

/// A node that was just switched on.
pub fn node(id: u8, now_ns: u64) -> Node {
    let config = CnConfig {
        node_id: id,
        mac: mac(id),
        device_type: DEVICE_TYPE,
        vendor_id: 1,
        product_code: PRODUCT,
        revision: 3,
        serial: u32::from(id),
        device_name: "test device",
        host_name: "",
        pres_max_latency_ns: ANSWER_NS as u32,
    };
    let dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).unwrap();
    Node::new(&config, dictionary, now_ns).unwrap()
}

/// How a node takes part in the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polling {
    /// In every cycle.
    EveryCycle,
    /// In this cycle of a round of so many.
    Multiplexed { cycle: u8, of: u8 },
    /// Not at all: it sends by time after the PRes of the managing node, where its outputs begin at this octet.
    Chained { offset: u16 },
}

/// Concise DCF of a node: [`WRITES`], the mapping among them, and one more where the node is not polled in every cycle. The
/// times fit the length of the cycle.
pub fn configuration(cycle_ns: u64, polling: Polling) -> Vec<u8> {
    let mut octets = [0; 600];
    let mut writer = CdcWriter::new(&mut octets).unwrap();
    let mut push = |index, sub, value: &[u8]| writer.push(index, sub, value).unwrap();
    let (first_bit, writes) = match polling {
        Polling::EveryCycle => (0, WRITES as u8),
        Polling::Multiplexed { of, .. } => {
            push(0x1F98, 7, &[of]);
            (0, WRITES as u8 + 1)
        }
        Polling::Chained { offset } => {
            push(0x1400, 1, &[powerlink::wire::node::MN]);
            (u64::from(offset) * 8, WRITES as u8 + 1)
        }
    };
    for (mapping, object, first_bit) in [(0x1600, 0x2000_u64, first_bit), (0x1A00, 0x2001, 0)] {
        push(mapping, 0, &[0]);
        for (sub, offset, length) in [(1_u8, 0_u64, 32_u64), (2, 32, 32), (3, 64, 16)] {
            let entry = object | u64::from(sub) << 16 | (first_bit + offset) << 32 | length << 48;
            push(mapping, sub, &entry.to_le_bytes());
        }
        push(mapping, 0, &[3]);
    }
    push(0x1006, 0, &((cycle_ns / 1_000) as u32).to_le_bytes());
    // Ten lost SoCs, SoAs or PReqs close together, as a real network sets it; the default of 15 means two.
    for counter in [0x1C0B, 0x1C0C, 0x1C0D] {
        push(counter, 3, &80_u32.to_le_bytes());
    }
    push(0x1C14, 0, &((cycle_ns * 3 / 10) as u32).to_le_bytes());
    push(0x1020, 1, &20_000_u32.to_le_bytes());
    push(0x1020, 2, &1_u32.to_le_bytes());
    let octets = writer.finish().to_vec();
    assert_eq!(octets[0], writes);
    octets
}

/// What the managing node is told about a node.
pub fn node_config(id: u8, mandatory: bool, polling: Polling, configuration: &[u8]) -> NodeConfig<'_> {
    NodeConfig {
        id,
        multiplex_cycle: match polling {
            Polling::Multiplexed { cycle, .. } => cycle,
            Polling::EveryCycle | Polling::Chained { .. } => 0,
        },
        pres_mn_offset: match polling {
            Polling::Chained { offset } => offset,
            Polling::EveryCycle | Polling::Multiplexed { .. } => 0,
        },
        assignment: Assignment {
            mandatory,
            multiplexed: matches!(polling, Polling::Multiplexed { .. }),
            chained: matches!(polling, Polling::Chained { .. }),
            ..Assignment::default()
        },
        pres_timeout_ns: PRES_TIMEOUT_NS,
        identity: Identity {
            device_type: Some(DEVICE_TYPE),
            vendor_id: Some(1),
            product_code: Some(PRODUCT),
            revision: Some(3),
            serial: Some(u32::from(id)),
        },
        preq_bytes: PDO_BYTES as u16,
        pres_bytes: PDO_BYTES as u16,
        configuration,
        ..NodeConfig::default()
    }
}
