//! A recorded managing node boots our controlled node: every answer has to be the recorded one, octet for octet.

use obd::{DataType, Dictionary, EntryDef, lines_of, octets_of};
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, CnConfig, Events};
use powerlink::nmt::{NmtState, Reset};
use powerlink::wire::FRAME_LEN_MAX;

/// The boot of one node; see `tests/data/README.md`. The numbers were counted in the file with tshark.
struct Recording {
    capture: &'static [u8],
    node_id: u8,
    /// Last octet of the MAC address.
    mac: u8,
    host_name: &'static str,
    /// IdentResponses, StatusResponses and SDO frames of the node.
    ident_status_sdo: (usize, usize, usize),
    /// PRes of the node.
    polls: usize,
    /// SoCs; two of them only wake the node, before and after its reset.
    socs: usize,
    /// PReqs to the node in OPERATIONAL.
    outputs: usize,
    /// Answers in which our node says earlier that an SDO answer waits.
    quicker: usize,
}

/// PR 3, RS 1.
const GENERIC_WAITS: u8 = 0x19;

const RECORDINGS: [Recording; 3] = [
    Recording {
        capture: include_bytes!("data/openpowerlink-node1-boot.pcap"),
        node_id: 1,
        mac: 2,
        host_name: "01-ffffffff",
        ident_status_sdo: (2, 7, 19),
        polls: 224,
        socs: 244,
        outputs: 15,
        quicker: 0,
    },
    Recording {
        capture: include_bytes!("data/openpowerlink-node32-boot.pcap"),
        node_id: 32,
        mac: 3,
        host_name: "20-ffffffff",
        ident_status_sdo: (2, 8, 19),
        polls: 232,
        socs: 256,
        outputs: 16,
        quicker: 0,
    },
    Recording {
        capture: include_bytes!("data/openpowerlink-node110-boot.pcap"),
        node_id: 110,
        mac: 4,
        host_name: "6e-ffffffff",
        ident_status_sdo: (2, 6, 19),
        polls: 221,
        socs: 238,
        outputs: 17,
        quicker: 1,
    },
];

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
fn recorded_frames(capture: &'static [u8]) -> Vec<Recorded> {
    let u32_at = |at: usize| u32::from_le_bytes(capture[at..at + 4].try_into().unwrap());
    assert_eq!(u32_at(0), 0xA1B2_C3D4);
    let (mut at, mut frames) = (24, Vec::new());
    while at < capture.len() {
        let time_ns = u64::from(u32_at(at)) * 1_000_000_000 + u64::from(u32_at(at + 4)) * 1000;
        let len = u32_at(at + 8) as usize;
        frames.push(Recorded {
            time_ns,
            octets: &capture[at + 16..at + 16 + len],
        });
        at += 16 + len;
    }
    frames
}

fn recorded_node(recording: &Recording, now_ns: u64) -> Node {
    let mut dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).unwrap();
    // What the recorded node has otherwise: SDO over several ASnd in a cycle, a larger MTU, no watch over the SoA (most of
    // which the file leaves out).
    for (index, sub, value) in [
        (0x1F82, 0, &0x0001_0265_u32.to_le_bytes()[..]),
        (0x1C0C, 3, &0_u32.to_le_bytes()),
        (0x1F98, 8, &1500_u16.to_le_bytes()[..]),
    ] {
        let handle = dictionary.find(index, sub).unwrap();
        dictionary.set_default(handle, value).unwrap();
    }
    let config = CnConfig {
        node_id: recording.node_id,
        mac: [0x02, 0x00, 0x5E, 0x00, 0x00, recording.mac],
        device_type: 0x000F_0191,
        vendor_id: 0,
        product_code: 0,
        revision: 0x0002_0007,
        serial: 0,
        device_name: "replay",
        host_name: recording.host_name,
        pres_max_latency_ns: 50_000,
    };
    Node::new(&config, dictionary, now_ns).unwrap()
}

#[test]
fn every_answer_is_the_recorded_one() {
    for recording in &RECORDINGS {
        replay(recording);
    }
}

fn replay(recording: &Recording) {
    let node_id = recording.node_id;
    let frames = recorded_frames(recording.capture);
    let mut node = recorded_node(recording, frames[0].time_ns);
    let mut response = [0xA5; FRAME_LEN_MAX];
    let mut states = vec![node.nmt_state()];
    let mut resets = Vec::new();
    let (mut answers, mut polls, mut outputs, mut syncs, mut missed, mut quicker) = (Vec::new(), 0, 0, 0, 0, 0);
    for (position, frame) in frames.iter().enumerate() {
        if frame.octets[16] == node_id {
            continue;
        }
        // The recorded node answers after the frame, before the next one that is meant for it.
        let recorded = frames
            .get(position + 1)
            .map(|next| next.octets)
            .filter(|next| next[16] == node_id);
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
            cycle_error,
            ..
        } = reaction.events;
        assert_eq!(cycle_error, None);
        states.extend(nmt_state);
        resets.extend(reset);
        syncs += usize::from(sync.is_some());
        outputs += usize::from(new_outputs);
        missed += soc_missed;
        // RS is 1 as soon as an SDO is answered; the recorded node now and then had not got that far.
        if let (Some(_), Some(recorded)) = (reaction.transmit, recorded)
            && (response[19], recorded[19]) == (GENERIC_WAITS, 0)
            && matches!((recorded[14], recorded[17]), (0x04, _) | (0x06, 0x02))
        {
            response[19] = 0;
            quicker += 1;
        }
        let answered = reaction.transmit.map(|len| &response[..len]);
        assert_eq!(
            answered, recorded,
            "node {node_id}, answer to frame {position} of the file: {:02x?}",
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
    assert_eq!((count(1), count(2), count(5)), recording.ident_status_sdo);
    assert_eq!(
        (polls, syncs, outputs, missed, quicker),
        (
            recording.polls,
            recording.socs - 2,
            recording.outputs,
            0,
            recording.quicker
        )
    );
    assert_eq!(
        answers.len(),
        count(1) + count(2) + count(5) + polls,
        "nothing else is sent"
    );

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

/// Four nodes in one process hear the same frames; the managing node that boots node 1 gets no answer from the others.
#[test]
fn other_nodes_keep_quiet() {
    let frames = recorded_frames(RECORDINGS[0].capture);
    let mut response = [0; FRAME_LEN_MAX];
    for node_id in [2, 31, 110, 239] {
        let mut dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).unwrap();
        let soa_threshold = dictionary.find(0x1C0C, 3).unwrap();
        dictionary.set_default(soa_threshold, &[0; 4]).unwrap();
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
