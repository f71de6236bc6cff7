//! What a controlled node does with a frame of every type, from every sender, to every receiver, in every state.

use super::*;
use crate::wire;
use std::format;
use std::vec;

/// The node whose PRes is read by the second RPDO.
const READ_FROM: u8 = 9;
const STATES: [NmtState; 7] = [
    NmtState::NotActive,
    NmtState::BasicEthernet,
    NmtState::PreOperational1,
    NmtState::PreOperational2,
    NmtState::ReadyToOperate,
    NmtState::Operational,
    NmtState::Stopped,
];

/// A node in this state: RPDO 0 reads 0x607A from the PReq, RPDO 1 reads 0x6060 from node 9.
fn node_in(state: NmtState) -> Node {
    let mut bench = Bench::new();
    if state == NmtState::BasicEthernet {
        bench.node.poll(u64::from(u32::MAX) * US);
    } else if state == NmtState::PreOperational1 {
        bench.soa(RequestedService::NoService, 0);
    } else if state != NmtState::NotActive {
        bench.wake();
        for (number, (from, raw)) in [(0, 0x0020_0000_0000_607A_u64), (READ_FROM, 0x0008_0000_0000_6060)]
            .into_iter()
            .enumerate()
        {
            let number = number as u16;
            bench.write(0x1400 + number, 1, &[from]).unwrap();
            bench.write(0x1600 + number, 1, &raw.to_le_bytes()).unwrap();
            bench.write(0x1600 + number, 0, &[1]).unwrap();
        }
        let commands: &[NmtCommand] = match state {
            NmtState::ReadyToOperate => &[NmtCommand::EnableReadyToOperate],
            NmtState::Operational => &[NmtCommand::EnableReadyToOperate, NmtCommand::StartNode],
            NmtState::Stopped => &[NmtCommand::StopNode],
            _ => &[],
        };
        for command in commands {
            bench.plain(*command);
        }
    }
    assert_eq!(bench.node.nmt_state(), state);
    bench.node
}

/// A frame that asks for as much as its type can: data with RD for everybody, an invitation of this node, StopNode, a
/// connection for SDO.
fn frames(message_type: u8, from: u8, to: u8) -> Vec<Vec<u8>> {
    let tails: &[&[u8]] = match message_type & 0x7F {
        3 | 4 => &[&[0xFD, 1, 0, 0, 0, 8, 0, 0x55, 0x66, 0x77, 0x08, 0, 0, 0, 0]],
        5 => &[&[0xFD, 0, 0, 0x01, NODE, 0x20]],
        6 => &[&[4, 0x22, 0], &[5, 0x00, 0x01, 0, 0]],
        _ => &[&[]],
    };
    let frame = |tail: &&[u8]| {
        let mut octets = vec![0; 60];
        octets[6..12].copy_from_slice(&[2, 0, 0, 0, 0, from]);
        octets[12..17].copy_from_slice(&[0x88, 0xAB, message_type, to, from]);
        octets[17..17 + tail.len()].copy_from_slice(tail);
        octets
    };
    tails.iter().map(frame).collect()
}

/// What is to be seen of a node that was handed a frame.
#[derive(Debug, PartialEq, Eq)]
struct Seen {
    /// It answers at once.
    answers: bool,
    /// It took outputs over.
    outputs: bool,
    /// It is at the synchronous instant.
    sync: bool,
    /// It has something to send when it is invited.
    owes: bool,
    state: NmtState,
}

/// The table of what a node accepts from whom.
fn expected(state: NmtState, octets: &[u8]) -> Seen {
    use NmtState::{BasicEthernet, NotActive, Operational, PreOperational1, PreOperational2, Stopped};
    let [kind, to, from, service] = [octets[14] & 0x7F, octets[15], octets[16], octets[17]];
    let nothing = Seen {
        answers: false,
        outputs: false,
        sync: false,
        owes: false,
        state,
    };
    // Isochronous traffic of anybody, and the managing node's cycle, wake a node from BASIC_ETHERNET.
    let woken = if state == BasicEthernet { PreOperational1 } else { state };
    match (kind, from, to) {
        (1, 240, 255) => {
            let state = match state {
                NotActive | BasicEthernet => PreOperational1,
                PreOperational1 => PreOperational2,
                other => other,
            };
            let sync = state.is_isochronous() || state == Stopped;
            Seen { sync, state, ..nothing }
        }
        (5, 240, 255) => {
            let state = if state == NotActive { PreOperational1 } else { woken };
            let answers = true;
            Seen {
                answers,
                state,
                ..nothing
            }
        }
        (3, 240, NODE) => Seen {
            answers: state.is_isochronous(),
            outputs: state == Operational,
            state: woken,
            ..nothing
        },
        (3, 240, 1..=239) => Seen {
            state: woken,
            ..nothing
        },
        (4, NODE, _) => nothing,
        (4, 1..=240, 255) => Seen {
            outputs: state == Operational && from == READ_FROM,
            state: woken,
            ..nothing
        },
        (6, 240, NODE | 255) if service == 4 => Seen {
            state: if state.is_isochronous() { Stopped } else { state },
            ..nothing
        },
        (6, NODE, _) => nothing,
        (6, 1..=240 | 253 | 254, NODE) if service == 5 => Seen {
            owes: !matches!(state, NotActive | BasicEthernet),
            ..nothing
        },
        _ => nothing,
    }
}

fn hand_in(node: &mut Node, octets: &[u8]) -> Seen {
    let mut response = [0; FRAME_LEN_MAX];
    let reaction = node.receive(0, octets, &mut response);
    Seen {
        answers: reaction.transmit.is_some(),
        outputs: reaction.events.outputs,
        sync: reaction.events.sync.is_some(),
        owes: node.requests().count > 0,
        state: node.nmt_state(),
    }
}

#[test]
fn every_frame_from_every_sender_to_every_receiver_in_every_state() {
    for state in STATES {
        let fresh = node_in(state);
        // It stands still until a frame is accepted.
        let mut still = fresh.clone();
        let before = format!("{still:?}");
        let mut executed = 0;
        for message_type in [0, 1, 2, 3, 4, 5, 6, 7, 8, 13, 0x7F, 0x83, 0x84] {
            for from in 0..=u8::MAX {
                for to in 0..=u8::MAX {
                    for octets in frames(message_type, from, to) {
                        let expected = expected(state, &octets);
                        let place = || {
                            format!(
                                "{state:?}: {message_type:#x} from {from} to {to}: {:02x?}",
                                &octets[17..31]
                            )
                        };
                        let does_nothing = expected == self::expected(state, &[0; 60]);
                        if !does_nothing {
                            executed += 1;
                            assert_eq!(hand_in(&mut fresh.clone(), &octets), expected, "{}", place());
                        } else if wire::accept(&octets).is_err() || from == NODE {
                            assert_eq!(hand_in(&mut still, &octets), expected, "{}", place());
                        } else if to == NODE || to == 255 || from == 240 {
                            // Counted, and the silence is over; nothing else.
                            let mut node = fresh.clone();
                            assert_eq!(hand_in(&mut node, &octets), expected, "{}", place());
                            let device = |node: &Node| {
                                let read = |index| node.dictionary().read(index, 0).unwrap().to_vec();
                                [read(0x607A), read(0x6060), read(0x1F8C)]
                            };
                            assert_eq!(device(&node), device(&fresh), "{}", place());
                        } else {
                            assert_eq!(hand_in(&mut still, &octets), expected, "{}", place());
                        }
                    }
                }
            }
        }
        assert_eq!(format!("{still:?}"), before, "{state:?}");
        assert!(executed > 0);
    }
}

/// The frame that wrote outputs: a PRes of "node 0", as 0x1400/1 = 0 means the PReq.
#[test]
fn a_pres_of_no_node_is_not_taken_for_the_preq() {
    let mut bench = Bench::new();
    bench.start();
    for from in [0, 241, 250, 253, 254, 255] {
        let events = bench.pres_from(from, &OUTPUTS, true);
        assert_eq!(events, Events::default(), "PRes of {from}");
    }
    assert!(bench.poll_with(&OUTPUTS).is_some());
    assert!(bench.events.last().unwrap().outputs);
}
