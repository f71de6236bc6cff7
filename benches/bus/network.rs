//! The network that is measured: as many small drives as wanted, six octets of process data each way.
//!
//! In:  the number of nodes, the cycle. Out: what the managing node is told, and all controlled nodes in one responder.

use obd::{DataType, Dictionary, EntryDef, lines_of, octets_of};
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, CnConfig};
use powerlink::mn::{BootTimes, MnConfig, NodeConfig};
use powerlink::wire::{FRAME_LEN_MAX, Mac, message};

/// Octets of process data in each PReq and each PRes.
pub(crate) const PAYLOAD: usize = 6;

const DEVICE: &[EntryDef] = &[
    EntryDef::rw(0x6040, DataType::U16, "controlword").rpdo(),
    EntryDef::ro(0x6041, DataType::U16, "statusword").tpdo(),
    EntryDef::ro(0x6064, DataType::I32, "position").tpdo(),
    EntryDef::rw(0x607A, DataType::I32, "target").rpdo(),
];
const LINES: usize = COMMUNICATION_ENTRIES + lines_of(DEVICE);
const OCTETS: usize = COMMUNICATION_BYTES + octets_of(DEVICE);
type Drive = Cn<LINES, OCTETS>;

/// Waits as short as they may be: what is measured begins when all nodes are operational.
const BOOT: BootTimes = BootTimes {
    wait_not_active_us: 20_000,
    timeout_pre_op_1_us: 5_000_000,
    wait_pre_op_1_us: 20_000,
    timeout_pre_op_2_us: 30_000_000,
    timeout_ready_to_operate_us: 30_000_000,
    reset_pause_us: 10_000,
};

/// MAC of a controlled node.
fn node_mac(id: u8) -> Mac {
    [2, 0, 0, 0x45, 0x50, id]
}

/// What the managing node is told of nodes 1 to `count`, mapped and configured from the start.
pub(crate) fn node_configs(count: usize, pres_timeout_ns: u32) -> Vec<NodeConfig<'static>> {
    (1..=count as u8)
        .map(|id| NodeConfig {
            id,
            pres_timeout_ns,
            preq_bytes: PAYLOAD as u16,
            pres_bytes: PAYLOAD as u16,
            ..NodeConfig::default()
        })
        .collect()
}

/// What the managing node is told.
pub(crate) fn mn_config<'a>(nodes: &'a [NodeConfig<'a>], cycle_us: u32, mac: Mac) -> MnConfig<'a> {
    MnConfig {
        cycle_ns: cycle_us * 1000,
        // Nodes on the same core answer before `send` returns; what is left is for the look at the link.
        async_slot_timeout_ns: 20_000,
        boot: BOOT,
        pres_lost_max: 1000,
        nodes,
        mac,
        ..MnConfig::default()
    }
}

/// Its 0x1006 is 0, so it does not watch over the SoC: both loops take turns.
fn drive(id: u8) -> Drive {
    let mut objects: Dictionary<LINES, OCTETS> =
        Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).expect("a good dictionary");
    let mut default = |index, sub, octets: &[u8]| {
        let handle = objects.find(index, sub).expect("an object");
        objects.set_default(handle, octets).expect("a value that fits");
    };
    for (index, sub, entry) in [
        (0x1600, 1, 0x0020_0000_0000_607A_u64),
        (0x1600, 2, 0x0010_0020_0000_6040),
        (0x1A00, 1, 0x0020_0000_0000_6064),
        (0x1A00, 2, 0x0010_0020_0000_6041),
    ] {
        default(index, sub, &entry.to_le_bytes());
    }
    default(0x1600, 0, &[2]);
    default(0x1A00, 0, &[2]);
    let config = CnConfig {
        node_id: id,
        mac: node_mac(id),
        device_type: 0x0002_0192,
        vendor_id: 0,
        product_code: 0,
        revision: 0,
        serial: u32::from(id),
        device_name: "bench",
        host_name: "bench",
        pres_max_latency_ns: 10_000,
    };
    Cn::new(&config, objects, 0).expect("a good configuration")
}

/// All controlled nodes. Position `n` is node `n + 1`.
pub(crate) struct Responder {
    drives: Vec<Drive>,
    response: Box<[u8; FRAME_LEN_MAX]>,
}

impl Responder {
    pub(crate) fn new(count: usize) -> Responder {
        Responder {
            drives: (1..=count as u8).map(drive).collect(),
            response: Box::new([0; FRAME_LEN_MAX]),
        }
    }

    /// Takes a frame of the managing node; answers go to `send` at once. Who is not meant does not see it: polls and
    /// invitations are for one node, and nobody here reads another node's PRes.
    pub(crate) fn receive(&mut self, now_ns: u64, frame: &[u8], mut send: impl FnMut(&[u8])) {
        let [kind, destination] = [frame[14] & 0x7F, frame[15]];
        let (first, others) = match kind {
            message::PREQ => (destination, false),
            message::SOA => (frame[21], true),
            message::PRES => return,
            _ if destination == powerlink::wire::node::BROADCAST => (0, true),
            _ => (destination, false),
        };
        if let Some(drive) = usize::from(first).checked_sub(1).and_then(|at| self.drives.get_mut(at))
            && let Some(length) = drive.receive(now_ns, frame, &mut self.response).transmit
        {
            send(&self.response[..length]);
        }
        if others {
            for drive in self.drives.iter_mut().filter(|drive| drive.node_id() != first) {
                drive.receive(now_ns, frame, &mut self.response);
            }
        }
    }

    /// Looks at the clock for all nodes.
    pub(crate) fn poll(&mut self, now_ns: u64) {
        for drive in &mut self.drives {
            drive.poll(now_ns);
        }
    }
}
