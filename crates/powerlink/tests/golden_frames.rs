//! Every kind of frame that another vendor's stack sent in two whole recordings, read and written back.
#![cfg(feature = "std")]

use powerlink::link::pcap::PcapReader;
use powerlink::nmt::{NmtCommand, NmtState};
use powerlink::wire::{Asnd, FRAME_LEN_MAX, FRAME_LEN_MIN, Frame, Header, node};

/// See `tests/data/README.md`.
const CAPTURE: &[u8] = include_bytes!("data/openpowerlink-node1-boot.pcap");

/// What is left of two captures of all nodes: name, octets of the file, frames.
const DISTINCT: [(&str, &[u8], usize); 2] = [
    (
        "10 ms",
        include_bytes!("data/openpowerlink-3cn-10ms-distinct.pcap"),
        275,
    ),
    (
        "50 ms",
        include_bytes!("data/openpowerlink-3cn-50ms-distinct.pcap"),
        266,
    ),
];

#[test]
fn every_frame_is_read_and_written_back_identically_up_to_padding() {
    assert_eq!(read_and_write_back("node 1", CAPTURE), 798);
    for (name, capture, frames) in DISTINCT {
        assert_eq!(read_and_write_back(name, capture), frames, "{name}");
    }
}

/// How many frames the file has.
fn read_and_write_back(name: &str, capture: &[u8]) -> usize {
    let mut buffer = [0xA5; FRAME_LEN_MAX];
    let mut frames = 0;
    for (number, captured) in (1..).zip(PcapReader::new(capture).unwrap()) {
        let octets = captured.unwrap().frame;
        let header = Header::parse(octets).unwrap_or_else(|error| panic!("{name}: frame {number}: {error}"));
        let frame = Frame::parse(octets).unwrap_or_else(|error| panic!("{name}: frame {number}: {error}"));
        buffer.fill(0xA5);
        let len = frame.emit(&header, &mut buffer).unwrap();
        assert_eq!(len, octets.len().max(FRAME_LEN_MIN), "{name}: frame {number}");
        assert_eq!(&buffer[..octets.len()], octets, "{name}: frame {number}");
        assert!(
            buffer[octets.len()..len].iter().all(|octet| *octet == 0),
            "{name}: frame {number}: padding"
        );
        frames = number;
    }
    frames
}

#[test]
fn the_captures_show_every_service_of_three_nodes() {
    for (name, capture, _) in DISTINCT {
        let mut seen = [[0; 5]; 3];
        for captured in PcapReader::new(capture).unwrap() {
            let octets = captured.unwrap().frame;
            let header = Header::parse(octets).unwrap();
            let Some(node) = [1, 32, 110].iter().position(|id| *id == header.source_node) else {
                assert_eq!(header.source_node, node::MN, "{name}");
                continue;
            };
            let service = match Frame::parse(octets).unwrap() {
                Frame::Asnd(Asnd::IdentResponse(_)) => 0,
                Frame::Asnd(Asnd::StatusResponse(_)) => 1,
                Frame::Asnd(Asnd::Sdo(_)) => 2,
                Frame::Pres(_) => 3,
                Frame::Asnd(_) | Frame::Soc(_) | Frame::Preq(_) | Frame::Soa(_) | Frame::Amni(_) | Frame::Ainv(_) => 4,
            };
            seen[node][service] += 1;
        }
        for node in seen {
            // Before and after the configuration, 17 commands with their answers and the four steps of the connection.
            assert_eq!((node[0], node[4]), (2, 0), "{name}: {seen:?}");
            assert!(node[1] >= 3 && node[2] >= 19 && node[3] >= 5, "{name}: {seen:?}");
        }
    }
}

#[test]
fn the_capture_tells_the_boot_of_one_node() {
    let mut commands = Vec::new();
    let mut states = Vec::new();
    let mut sdo = 0;
    for captured in PcapReader::new(CAPTURE).unwrap() {
        match Frame::parse(captured.unwrap().frame).unwrap() {
            Frame::Asnd(Asnd::NmtCommand(command)) => commands.push(command.command),
            Frame::Asnd(Asnd::Sdo(_)) => sdo += 1,
            Frame::Pres(pres) if states.last() != Some(&pres.nmt_state) => states.push(pres.nmt_state),
            Frame::Soc(_) | Frame::Preq(_) | Frame::Pres(_) | Frame::Soa(_) | Frame::Asnd(_) => {}
            Frame::Amni(_) | Frame::Ainv(_) => panic!("not in this capture"),
        }
    }
    let expected = [
        NmtCommand::ResetNode,
        NmtCommand::ResetConfiguration,
        NmtCommand::EnableReadyToOperate,
        NmtCommand::StartNode,
    ];
    assert_eq!(commands, expected);
    assert_eq!(
        states,
        [
            NmtState::PreOperational2,
            NmtState::ReadyToOperate,
            NmtState::Operational
        ]
    );
    assert!(sdo > 32, "16 writes, each with an answer: {sdo} SDO frames");
}
