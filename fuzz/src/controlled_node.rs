//! Any frames at any time: the controlled node never panics, sends only when it is invited or due, and only frames that can
//! be read.
//!
//! Input: a list of (gap in units of 10 µs, length, octets of a frame from octet 14 on); a length of 0 looks at the clock.

use obd::{DataType, Dictionary, EntryDef, lines_of, octets_of};
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, CnConfig};
use powerlink::wire::{FRAME_LEN_MAX, Frame};

const NODE: u8 = 1;
const DEVICE: &[EntryDef] = &[
    EntryDef::rw(0x6040, DataType::U16, "Controlword").rpdo(),
    EntryDef::ro(0x6041, DataType::U16, "Statusword").tpdo(),
];
type Node = Cn<{ COMMUNICATION_ENTRIES + lines_of(DEVICE) }, { COMMUNICATION_BYTES + octets_of(DEVICE) }>;

/// One run of the fuzzer.
pub fn run(input: &[u8]) {
    let config = CnConfig {
        node_id: NODE,
        mac: [2, 0, 0, 0, 0, NODE],
        device_type: 0x0002_0192,
        vendor_id: 0,
        product_code: 0,
        revision: 0,
        serial: 0,
        device_name: "",
        host_name: "",
        pres_max_latency_ns: 0,
    };
    let dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).expect("a valid table");
    let mut node = Node::new(&config, dictionary, 0).expect("a valid configuration");
    let mut response = [0; FRAME_LEN_MAX];
    let (mut now_ns, mut rest) = (0, input);
    while let [gap, length, tail @ ..] = rest {
        let (body, tail) = tail.split_at(usize::from(*length).min(tail.len()));
        rest = tail;
        now_ns += u64::from(*gap) * 10_000;
        if body.is_empty() {
            node.poll(now_ns);
            if let Some(len) = node.poll_transmit(now_ns, &mut response) {
                assert!(node.is_chained());
                assert!(Frame::parse(&response[..len]).is_ok());
            }
            continue;
        }
        let mut frame = [1, 0x11, 0x1E, 0, 0, 4, 2, 0, 0, 0, 0, 0xF0, 0x88, 0xAB].to_vec();
        frame.extend(body);
        if let Some(len) = node.receive(now_ns, &frame, &mut response).transmit {
            let polled = frame[14] & 0x7F == 3 && frame[15] == NODE;
            let invited = frame[14] & 0x7F == 5 && frame[21] == NODE;
            assert!(polled || invited, "sent without being invited");
            assert!(Frame::parse(&response[..len]).is_ok());
        }
    }
}
