//! What the managing node does with a frame of every type, from every sender, to every receiver, in every state.

use super::*;
use std::format;
use std::string::ToString;

const STATES: [NmtState; 5] = [
    NmtState::NotActive,
    NmtState::PreOperational1,
    NmtState::PreOperational2,
    NmtState::ReadyToOperate,
    NmtState::Operational,
];

/// How a frame is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counted {
    message_type: u64,
    source: u64,
    destination: u64,
    foreign: u64,
    other: u64,
}

fn counted(mn: &Mn<'_, NODES>) -> Counted {
    let counters = mn.counters();
    Counted {
        message_type: counters.malformed.message_type,
        source: counters.malformed.source,
        destination: counters.malformed.destination,
        foreign: counters.foreign_mn_frames,
        other: counters.unexpected + counters.unknown_node,
    }
}

/// The table of what a managing node accepts from whom. `other`: it is told apart by what is being waited for.
/// `answers`: how many `from` gave before in NOT_ACTIVE.
fn expected(state: NmtState, kind: u8, from: u8, to: u8, answers: &mut [u8; 256]) -> Counted {
    let mut counted = Counted::default();
    let (from_any, to_any): (&[core::ops::RangeInclusive<u8>], &[core::ops::RangeInclusive<u8>]) = match kind {
        1 | 5 => (&[240..=240], &[255..=255]),
        3 => (&[240..=240], &[1..=239]),
        4 => (&[1..=240], &[255..=255]),
        6 => (&[1..=240, 253..=254], &[1..=240, 253..=255]),
        7 => (&[241..=250], &[255..=255]),
        13 => (&[240..=240], &[1..=240, 253..=255]),
        _ => {
            counted.message_type = 1;
            return counted;
        }
    };
    let counter = if !from_any.iter().any(|range| range.contains(&from)) {
        &mut counted.source
    } else if !to_any.iter().any(|range| range.contains(&to)) {
        &mut counted.destination
    } else if (240..=250).contains(&from) {
        &mut counted.foreign
    } else if state == NmtState::NotActive {
        let heard = &mut answers[usize::from(from)];
        *heard = heard.saturating_add(1);
        if *heard < 3 {
            &mut counted.other
        } else {
            &mut counted.foreign
        }
    } else {
        &mut counted.other
    };
    *counter = 1;
    counted
}

fn octets(message_type: u8, from: u8, to: u8) -> [u8; 60] {
    let mut octets = [0; 60];
    octets[6..12].copy_from_slice(&FOREIGN_MAC);
    octets[12..17].copy_from_slice(&[0x88, 0xAB, message_type, to, from]);
    // PReq, PRes: OPERATIONAL, RD, six octets; ASnd: of a service that nobody knows.
    let tail: &[u8] = match message_type & 0x7F {
        6 => &[0xA5],
        _ => &[0xFD, 1, 0, 0, 0, 6, 0, 9, 9, 9, 9, 9, 9],
    };
    octets[17..17 + tail.len()].copy_from_slice(tail);
    octets
}

/// A network in this state, which stays there, between two cycles.
fn net_in<'a>(state: NmtState, nodes: &'a [NodeConfig<'a>]) -> Net<'a> {
    let startup = StartUp {
        application_enters_pre_operational_2: state == NmtState::PreOperational1,
        application_enters_ready_to_operate: state == NmtState::PreOperational2,
        application_enters_operational: state == NmtState::ReadyToOperate,
        ..StartUp::default()
    };
    let mut net = Net::with(MnConfig {
        startup,
        ..mn_config(nodes)
    });
    if state != NmtState::NotActive {
        net.cycles(400);
    }
    assert_eq!(net.mn.nmt_state(), state);
    net.events.clear();
    net
}

#[test]
fn every_frame_from_every_sender_to_every_receiver_in_every_state() {
    let configuration = configuration();
    let nodes = [1, 2].map(|id| node_config(id, &configuration));
    for state in STATES {
        let mut net = net_in(state, &nodes);
        let mut answers = [0; 256];
        let (states, input) = ([0, 1].map(|at| net.mn.node_state(at)), net.mn.input(0).data.to_vec());
        for message_type in [0, 1, 2, 3, 4, 5, 6, 7, 8, 13, 0x7F] {
            for from in 0..=u8::MAX {
                for to in 0..=u8::MAX {
                    // Nobody has a slot: an ASnd to somebody else is not ours to judge.
                    net.mn.phase = Phase::Idle;
                    let before = counted(&net.mn);
                    net.mn.receive(net.now_ns, &octets(message_type, from, to));
                    let after = counted(&net.mn);
                    let got = Counted {
                        message_type: after.message_type - before.message_type,
                        source: after.source - before.source,
                        destination: after.destination - before.destination,
                        foreign: after.foreign - before.foreign,
                        other: after.other - before.other,
                    };
                    let expected = expected(state, message_type, from, to, &mut answers);
                    assert_eq!(got, expected, "{state:?}: {message_type} from {from} to {to}");
                    // Silence between two, so that each is told.
                    net.now_ns += 2_000 * MS;
                    let sign = ForeignSign {
                        id: from,
                        mac: FOREIGN_MAC,
                    };
                    let told = (expected.foreign > 0).then_some(MnEvent::ForeignMn(sign));
                    assert_eq!(
                        net.mn.pop_event(),
                        told,
                        "{state:?}: {message_type} from {from} to {to}"
                    );
                }
            }
        }
        assert_eq!(net.mn.nmt_state(), state);
        assert_eq!([0, 1].map(|at| net.mn.node_state(at)), states, "{state:?}");
        assert_eq!(net.mn.input(0).data, input, "{state:?}");
    }
}

/// While node 1 is polled, nothing but its own PRes to all ends the poll.
#[test]
fn only_its_own_pres_answers_a_poll() {
    let configuration = configuration();
    let nodes = [1, 2].map(|id| node_config(id, &configuration));
    for state in &STATES[2..] {
        let mut net = net_in(*state, &nodes);
        net.mn.start_cycle(net.now_ns, NetTime::default());
        while net.mn.outstanding().is_none() {
            net.mn.poll(net.now_ns);
        }
        let input = net.mn.input(0).data.to_vec();
        for message_type in 0..=0x7F {
            for from in 0..=u8::MAX {
                for to in 0..=u8::MAX {
                    if (message_type, from, to) != (4, 1, 255) {
                        net.mn.receive(net.now_ns, &octets(message_type, from, to));
                    }
                }
            }
        }
        let node = net.mn.outstanding().map(|(node, _)| node);
        assert_eq!((node, net.mn.input(0).data), (Some(1), &input[..]), "{state:?}");
        net.mn.receive(net.now_ns, &octets(4, 1, 255));
        assert_eq!(net.mn.outstanding(), None);
        assert_eq!(net.mn.input(0).data, [9; 6], "{state:?}");
    }
}

#[test]
fn what_is_told_names_who_was_heard() {
    let told = |id| MnEvent::ForeignMn(ForeignSign { id, mac: FOREIGN_MAC }).to_string();
    let own = |id| format!("another managing node is on the wire: 02:00:00:00:00:ee, node id {id}");
    assert_eq!((told(240), told(250)), (own(240), own(250)));
    assert_eq!(
        told(3),
        "another managing node is on the wire, perhaps on this PC: node 3 (02:00:00:00:00:ee) answers one"
    );
}
