//! Any frames at any time, alone and in the middle of a real network: the managing node never panics, never loops, and sends
//! only frames that can be read.
//!
//! Input: what becomes of each frame on the wire, in order, see [`fate`]; zeros let a network of two nodes boot and run.

use obd::{DataType, Dictionary, EntryDef, lines_of, octets_of};
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, CnConfig};
use powerlink::mn::{Assignment, BootTimes, Mn, MnConfig, NodeConfig, Step};
use powerlink::nmt::NmtState;
use powerlink::wire::{FRAME_LEN_MAX, Frame, NetTime};

const CYCLE_NS: u64 = 1_000_000;
/// What a node takes to answer.
const ANSWER_NS: u64 = 30_000;
/// Two mapped octets in each direction, 0x1006 = 1000, 0x1020/1 = 1.
const CONFIGURATION: &[u8] = &[
    6, 0, 0, 0, //
    0x00, 0x16, 1, 8, 0, 0, 0, 0x40, 0x60, 0, 0, 0, 0, 16, 0, //
    0x00, 0x1A, 1, 8, 0, 0, 0, 0x41, 0x60, 0, 0, 0, 0, 16, 0, //
    0x00, 0x16, 0, 1, 0, 0, 0, 1, //
    0x00, 0x1A, 0, 1, 0, 0, 0, 1, //
    0x06, 0x10, 0, 4, 0, 0, 0, 0xE8, 0x03, 0, 0, //
    0x20, 0x10, 1, 4, 0, 0, 0, 1, 0, 0, 0, //
];
const DEVICE: &[EntryDef] = &[
    EntryDef::rw(0x6040, DataType::U16, "Controlword").rpdo(),
    EntryDef::ro(0x6041, DataType::U16, "Statusword").tpdo(),
];
type Node = Cn<{ COMMUNICATION_ENTRIES + lines_of(DEVICE) }, { COMMUNICATION_BYTES + octets_of(DEVICE) }>;

fn node(id: u8) -> Box<Node> {
    let config = CnConfig {
        node_id: id,
        mac: [2, 0, 0, 0, 0, id],
        device_type: 0,
        vendor_id: 0,
        product_code: 0,
        revision: 0,
        serial: 0,
        device_name: "",
        host_name: "",
        pres_max_latency_ns: 0,
    };
    let dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).expect("a valid table");
    Box::new(Node::new(&config, dictionary, 0).expect("a valid configuration"))
}

/// What becomes of a frame, said by the next octets of the input: the frames that arrive instead of it, and how much later.
///
/// | first octet | |
/// |---|---|
/// | ..=0xBF | it arrives |
/// | 0xC0..=0xCF | it is lost |
/// | 0xD0..=0xDF | it arrives twice |
/// | 0xE0..=0xEF | damaged: the octet at the place said by the next octet is XORed with the one after it |
/// | 0xF0..=0xF7 | after it another frame: a length, and so many octets from octet 14 on |
/// | 0xF8..=0xFF | it arrives late, in units of 200 µs |
fn fate(rest: &mut &[u8], mut frame: Vec<u8>) -> (Vec<Vec<u8>>, u64) {
    let mut next = || {
        let (first, tail) = rest.split_first().unwrap_or((&0, &[]));
        *rest = tail;
        *first
    };
    match next() {
        ..=0xBF => (vec![frame], 0),
        0xC0..=0xCF => (Vec::new(), 0),
        0xD0..=0xDF => (vec![frame.clone(), frame], 0),
        0xE0..=0xEF => {
            let (place, flip) = (next(), next());
            if let Some(octet) = frame.get_mut(usize::from(place)) {
                *octet ^= flip;
            }
            (vec![frame], 0)
        }
        0xF0..=0xF7 => {
            let length = next();
            let mut other = vec![1, 0x11, 0x1E, 0, 0, 4, 2, 0, 0, 0, 0, 1, 0x88, 0xAB];
            other.extend((0..length).map(|_| next()));
            (vec![frame, other], 0)
        }
        late @ 0xF8.. => (vec![frame], u64::from(late - 0xF7) * 200_000),
    }
}

/// One run of the fuzzer; the state the managing node has reached when the input is used up.
pub fn run(input: &[u8]) -> NmtState {
    let configs = [1, 2].map(|id| NodeConfig {
        id,
        assignment: Assignment {
            mandatory: id == 1,
            ..Assignment::default()
        },
        pres_timeout_ns: 100_000,
        preq_bytes: 2,
        pres_bytes: 2,
        configuration: CONFIGURATION,
        ..NodeConfig::default()
    });
    let boot = BootTimes {
        wait_not_active_us: 0,
        wait_pre_op_1_us: 0,
        reset_pause_us: 0,
        ..BootTimes::default()
    };
    let config = MnConfig {
        cycle_ns: CYCLE_NS as u32,
        boot,
        nodes: &configs,
        mac: [2, 0, 0, 0, 0, 0xF0],
        ..MnConfig::default()
    };
    let mut mn = Box::new(Mn::<2>::new(config).expect("a valid configuration"));
    let mut nodes = [node(1), node(2)];
    let mut response = [0; FRAME_LEN_MAX];
    let (mut now_ns, mut rest) = (0, input);
    while !rest.is_empty() {
        let end_ns = now_ns + CYCLE_NS;
        mn.set_outputs_valid(true);
        mn.start_cycle(now_ns, NetTime::default());
        let mut answers: Vec<Vec<u8>> = Vec::new();
        for step in 0.. {
            assert!(step < 4000, "endless");
            match mn.poll(now_ns) {
                Step::Send(frame) => {
                    assert!(Frame::parse(frame).is_ok());
                    let (frames, late_ns) = fate(&mut rest, frame.to_vec());
                    now_ns += late_ns;
                    for frame in frames {
                        for node in &mut nodes {
                            if let Some(len) = node.receive(now_ns, &frame, &mut response).transmit {
                                answers.push(response[..len].to_vec());
                            }
                        }
                    }
                }
                Step::WaitUntil(until_ns) => {
                    if let Some(answer) = answers.pop() {
                        let (frames, late_ns) = fate(&mut rest, answer);
                        now_ns += ANSWER_NS + late_ns;
                        for frame in frames {
                            mn.receive(now_ns, &frame);
                        }
                    } else {
                        now_ns = now_ns.max(until_ns.min(end_ns));
                    }
                    if now_ns >= end_ns {
                        break;
                    }
                }
                Step::IsochronousDone => {}
                Step::Idle => break,
            }
        }
        now_ns = now_ns.max(end_ns);
        for node in &mut nodes {
            node.poll(now_ns);
        }
        while mn.pop_event().is_some() {}
        // A cycle in which nobody sends uses up input, too.
        rest = rest.get(1..).unwrap_or_default();
    }
    mn.nmt_state()
}
