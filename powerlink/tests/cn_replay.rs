//! A recorded managing node boots our controlled node: every answer has to be the recorded one, octet for octet.

use obd::{DataType, Dictionary, EntryDef, lines_of, octets_of};
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, CnConfig, Events};
use powerlink::nmt::{NmtState, Reset};
use powerlink::wire::FRAME_LEN_MAX;

/// See `tests/data/README.md`.
const CAPTURE: &[u8] = include_bytes!("data/openpowerlink-node1-boot.pcap");
const NODE: u8 = 1;

/// The device of the recorded node: CiA 401 with four inputs and four outputs.
const DEVICE: &[EntryDef] = &[
    EntryDef::ro(0x6000, DataType::U8, "DigitalInput").subs(1, 4).tpdo(),
    EntryDef::rw(0x6200, DataType::U8, "DigitalOutput").subs(1, 4).rpdo(),
];
type Node = Cn<{ COMMUNICATION_ENTRIES + lines_of(DEVICE) }, { COMMUNICATION_BYTES + octets_of(DEVICE) }>;

struct Recorded {
    time_ns: u64,
    octets: &'static [u8],
}

/// Frames of a little-endian pcap file with microsecond stamps.
fn recorded_frames() -> Vec<Recorded> {
    let u32_at = |at: usize| u32::from_le_bytes(CAPTURE[at..at + 4].try_into().unwrap());
    assert_eq!(u32_at(0), 0xA1B2_C3D4);
    let (mut at, mut frames) = (24, Vec::new());
    while at < CAPTURE.len() {
        let time_ns = u64::from(u32_at(at)) * 1_000_000_000 + u64::from(u32_at(at + 4)) * 1000;
        let len = u32_at(at + 8) as usize;
        frames.push(Recorded {
            time_ns,
            octets: &CAPTURE[at + 16..at + 16 + len],
        });
        at += 16 + len;
    }
    frames
}

fn recorded_node(now_ns: u64) -> Node {
    let mut dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).unwrap();
    // What the recorded node has and ours has not: SDO over several ASnd in a cycle, a larger MTU.
    for (index, sub, value) in [
        (0x1F82, 0, &0x0001_0265_u32.to_le_bytes()[..]),
        (0x1F98, 8, &1500_u16.to_le_bytes()[..]),
    ] {
        let handle = dictionary.find(index, sub).unwrap();
        dictionary.set_default(handle, value).unwrap();
    }
    let config = CnConfig {
        node_id: NODE,
        mac: [0x02, 0x00, 0x5E, 0x00, 0x00, 0x02],
        device_type: 0x000F_0191,
        vendor_id: 0,
        product_code: 0,
        revision: 0x0002_0007,
        serial: 0,
        device_name: "replay",
        host_name: "01-ffffffff",
        pres_max_latency_ns: 50_000,
    };
    Node::new(&config, dictionary, now_ns).unwrap()
}

#[test]
fn every_answer_is_the_recorded_one() {
    let frames = recorded_frames();
    let mut node = recorded_node(frames[0].time_ns);
    let mut response = [0xA5; FRAME_LEN_MAX];
    let mut states = vec![node.nmt_state()];
    let mut resets = Vec::new();
    let (mut answers, mut polls, mut outputs, mut syncs, mut missed) = (Vec::new(), 0, 0, 0, 0);
    for (position, frame) in frames.iter().enumerate() {
        if frame.octets[16] == NODE {
            continue;
        }
        // The recorded node answers after the frame, before the next one that is meant for it.
        let recorded = frames
            .get(position + 1)
            .map(|next| next.octets)
            .filter(|next| next[16] == NODE);
        // Its input is what its PRes says.
        if let Some(pres) = recorded.filter(|pres| pres[14] == 0x04 && pres[22] == 1) {
            let input = node.dictionary().key::<u8>(0x6000, 1).unwrap();
            node.dictionary_mut().set(input, pres[24]);
        }
        let reaction = node.receive(frame.time_ns, frame.octets, &mut response);
        let Events {
            sync,
            outputs: new_outputs,
            nmt_state,
            reset,
            soc_missed,
            communication_lost,
            ..
        } = reaction.events;
        assert_eq!(communication_lost, None);
        states.extend(nmt_state);
        resets.extend(reset);
        syncs += usize::from(sync.is_some());
        outputs += usize::from(new_outputs);
        missed += soc_missed;
        let answered = reaction.transmit.map(|len| &response[..len]);
        assert_eq!(
            answered, recorded,
            "answer to frame {position} of the file: {:02x?}",
            frame.octets
        );
        if let Some(answer) = answered {
            answers.push((answer[14], answer[17]));
            if answer[14] == 0x04 {
                polls += 1;
                let operational = answer[17] == 0xFD;
                assert_eq!(
                    answer[18] & 1 == 1,
                    operational,
                    "RD is set in OPERATIONAL and only there"
                );
            }
        }
    }

    use NmtState::{NotActive, Operational, PreOperational1, PreOperational2, ReadyToOperate};
    assert_eq!(
        states,
        [
            NotActive,
            PreOperational1,
            NotActive, // ResetNode to all
            PreOperational1,
            PreOperational2,
            NotActive, // ResetConfiguration after the download
            PreOperational1,
            PreOperational2,
            ReadyToOperate,
            Operational,
        ]
    );
    assert_eq!(resets, [Reset::Node, Reset::Configuration]);
    let count = |service| answers.iter().filter(|answer| **answer == (0x06, service)).count();
    assert_eq!((count(1), count(2), count(5)), IDENT_STATUS_SDO);
    assert_eq!((polls, syncs, outputs, missed), (POLLS, SYNCS, OUTPUTS, 0));

    // What the 16 writes of the download left behind; 0x1011/1 and 0x1010/1 were aborted.
    let read = |index, sub| node.dictionary().read(index, sub).unwrap();
    assert_eq!(read(0x1006, 0), 10_000_u32.to_le_bytes());
    assert_eq!(read(0x1020, 1), 12_580_u32.to_le_bytes());
    assert_eq!(read(0x1C0B, 3), 80_u32.to_le_bytes());
    assert_eq!(read(0x1C14, 0), 50_000_000_u32.to_le_bytes());
    assert_eq!(read(0x1600, 0), [1]);
    assert_eq!(read(0x1600, 1), 0x0008_0000_0001_6200_u64.to_le_bytes());
    assert_eq!(read(0x1A00, 1), 0x0008_0000_0001_6000_u64.to_le_bytes());
    assert_eq!(read(0x1F8C, 0), [0xFD]);
    let last_preq = frames.iter().rev().find(|frame| frame.octets[14] == 0x03).unwrap();
    assert_eq!(read(0x6200, 1), &last_preq.octets[24..25]);
}

/// Answers by service, counted in the capture with tshark.
const IDENT_STATUS_SDO: (usize, usize, usize) = (2, 7, 19);
/// PRes of the node.
const POLLS: usize = 224;
/// 244 SoCs, of which two only wake the node.
const SYNCS: usize = 242;
/// PReqs to the node in OPERATIONAL.
const OUTPUTS: usize = 15;

/// Four nodes in one process hear the same frames; the managing node that boots node 1 gets no answer from the others.
#[test]
fn other_nodes_keep_quiet() {
    let frames = recorded_frames();
    let mut response = [0; FRAME_LEN_MAX];
    for node_id in [2, 31, 110, 239] {
        let dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).unwrap();
        let config = CnConfig {
            node_id,
            mac: [2, 0, 0, 0, 0, node_id],
            device_type: 0,
            vendor_id: 0,
            product_code: 0,
            revision: 0,
            serial: 0,
            device_name: "",
            host_name: "",
            pres_max_latency_ns: 0,
        };
        let mut node = Node::new(&config, dictionary, frames[0].time_ns).unwrap();
        for frame in &frames {
            assert_eq!(node.receive(frame.time_ns, frame.octets, &mut response).transmit, None);
        }
        assert_eq!(node.nmt_state(), NmtState::PreOperational2);
    }
}
