//! Every frame of a recorded boot, read and written back.
#![cfg(feature = "std")]

use powerlink::link::pcap::PcapReader;
use powerlink::nmt::{NmtCommand, NmtState};
use powerlink::wire::{Asnd, FRAME_LEN_MAX, FRAME_LEN_MIN, Frame, Header};

/// See `tests/data/README.md`.
const CAPTURE: &[u8] = include_bytes!("data/openpowerlink-node1-boot.pcap");

#[test]
fn every_frame_is_read_and_written_back_identically_up_to_padding() {
    let mut buffer = [0xA5; FRAME_LEN_MAX];
    for (number, captured) in (1..).zip(PcapReader::new(CAPTURE).unwrap()) {
        let octets = captured.unwrap().frame;
        let header = Header::parse(octets).unwrap_or_else(|error| panic!("frame {number}: {error}"));
        let frame = Frame::parse(octets).unwrap_or_else(|error| panic!("frame {number}: {error}"));
        buffer.fill(0xA5);
        let len = frame.emit(&header, &mut buffer).unwrap();
        assert_eq!(len, octets.len().max(FRAME_LEN_MIN), "frame {number}");
        assert_eq!(&buffer[..octets.len()], octets, "frame {number}");
        assert!(
            buffer[octets.len()..len].iter().all(|octet| *octet == 0),
            "frame {number}: padding"
        );
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
