//! Any frames at any time, mixed with what the device and the application do.

use super::*;
use crate::wire::{self, HEADER_LEN, SyncRequest};
use proptest::prelude::*;
use std::{format, vec};

/// One thing that happens to a node.
#[derive(Clone, Debug)]
enum Step {
    /// Octets as they come.
    Octets(Vec<u8>),
    /// A frame of the managing node: message type, destination node, octets behind the header.
    Frame(u8, u8, Vec<u8>),
    /// A frame of another node.
    Other(u8, u8, Vec<u8>),
    Soa(u8, u8, SyncRequest),
    Command(u8),
    /// An SDO frame that makes it to the command layer: command, index, value.
    Sdo(u8, u16, Vec<u8>),
    Poll,
    SendEthernet(usize),
    Report(u16),
    Crc,
}

fn step() -> impl Strategy<Value = Step> {
    let body = || proptest::collection::vec(any::<u8>(), 0..80);
    let message = || prop::sample::select(vec![1, 3, 4, 5, 6, 7, 0x0D, 0x83]);
    let node = || prop::sample::select(vec![NODE, NODE, 7, 240, 255, 0]);
    let service = prop::sample::select(vec![0, 1, 2, 3, 6, 0xFF, 0x77]);
    let time = || proptest::option::of(prop::sample::select(vec![0_u32, 1000, 500_000, u32::MAX]));
    let request =
        (time(), time(), any::<bool>(), any::<bool>()).prop_map(|(first, fall_back, set, reset)| SyncRequest {
            pres_time_first_ns: first,
            fall_back_timeout_ns: fall_back,
            mode_set: set,
            mode_reset: reset,
            ..SyncRequest::default()
        });
    let objects = prop::sample::select(vec![
        0x1003, 0x1006, 0x1400, 0x1600, 0x1601, 0x1A00, 0x1C0B, 0x1F8D, 0x1F98, 0x1F9E, 0x6060, 0x1010,
    ]);
    prop_oneof![
        1 => proptest::collection::vec(any::<u8>(), 0..120).prop_map(Step::Octets),
        3 => (message(), node(), body()).prop_map(|(message, node, body)| Step::Frame(message, node, body)),
        2 => (message(), prop::sample::select(vec![1, 7, 240]), body())
            .prop_map(|(message, from, body)| Step::Other(message, from, body)),
        4 => (service, node(), request).prop_map(|(service, node, request)| Step::Soa(service, node, request)),
        2 => prop::sample::select(vec![0x21, 0x22, 0x23, 0x24, 0x28, 0x2A, 0x62, 0xFF]).prop_map(Step::Command),
        2 => (any::<u8>(), objects, proptest::collection::vec(any::<u8>(), 0..10))
            .prop_map(|(command, index, value)| Step::Sdo(command, index, value)),
        2 => Just(Step::Poll),
        1 => (0_usize..1600).prop_map(Step::SendEthernet),
        1 => any::<u16>().prop_map(Step::Report),
        1 => Just(Step::Crc),
    ]
}

fn frame(message: u8, to: u8, from: u8, body: &[u8]) -> Vec<u8> {
    let mut octets = vec![0; HEADER_LEN];
    octets[12..17].copy_from_slice(&[0x88, 0xAB, message, to, from]);
    octets.extend(body);
    octets
}

/// The octets of a step that is a frame.
fn octets_of(step: &Step) -> Option<Vec<u8>> {
    match step {
        Step::Octets(octets) => Some(octets.clone()),
        Step::Frame(message, to, body) => Some(frame(*message, *to, node::MN, body)),
        Step::Other(message, from, body) => Some(frame(*message, 255, *from, body)),
        Step::Soa(service, target, sync) => {
            let soa = Soa {
                sync: *sync,
                ..Soa::new(NmtState::Operational, RequestedService::from(*service), *target)
            };
            let mut octets = vec![0; 60];
            soa.emit(&Header::multicast(multicast::SOA, MN_MAC, node::MN), &mut octets)
                .unwrap();
            Some(octets)
        }
        Step::Command(command) => Some(frame(6, NODE, node::MN, &[4, *command, 0, b'x'])),
        Step::Sdo(command, index, value) => {
            let mut body = vec![5, 0x02, 0x06, 0, 0, 0, 1, 0, *command, 4 + value.len() as u8, 0, 0, 0];
            body.extend(index.to_le_bytes());
            body.extend([1, 0]);
            body.extend(value);
            Some(frame(6, NODE, node::MN, &body))
        }
        Step::Poll | Step::SendEthernet(_) | Step::Report(_) | Step::Crc => None,
    }
}

/// Whether the managing node lets this node send with this frame.
fn invites(octets: &[u8]) -> bool {
    let from_mn = octets.get(16) == Some(&node::MN);
    match octets.get(14).map(|octet| octet & 0x7F) {
        Some(3) => from_mn && octets[15] == NODE,
        Some(5) => from_mn && octets.get(21) == Some(&NODE),
        _ => false,
    }
}

/// The node after a frame between others as it takes one while it rests; `None`: it does not rest, or the frame is no such.
fn passed_by(cn: &Node, now_ns: u64, octets: &[u8]) -> Option<Node> {
    let (header, frame) = wire::accept(octets).ok().filter(|_| now_ns < cn.rests_until_ns())?;
    let mut cn = cn.clone();
    match frame {
        Frame::Preq(_) if header.destination_node != NODE => {}
        Frame::Pres(pres) if header.source_node != node::MN => cn.overhear(header.source_node, &pres),
        _ => return None,
    }
    Some(cn)
}

fn apply(bench: &mut Bench, step: &Step) -> Result<(), TestCaseError> {
    let now_ns = bench.now_ns;
    if let Some(octets) = octets_of(step) {
        let passed = passed_by(&bench.node, now_ns, &octets);
        let reaction = bench.node.receive(now_ns, &octets, &mut bench.response);
        if let Some(passed) = passed {
            prop_assert_eq!(reaction.transmit, None);
            prop_assert_eq!(format!("{passed:?}"), format!("{:?}", bench.node));
        }
        if let Some(len) = reaction.transmit {
            prop_assert!(invites(&octets), "sent without being invited");
            let sent = &bench.response[..len];
            prop_assert!((60..=FRAME_LEN_MAX).contains(&len));
            if sent[12..14] == [0x88, 0xAB] {
                let header = Header::parse(sent).unwrap();
                prop_assert_eq!((header.source, header.source_node), (MAC, NODE));
                prop_assert!(Frame::parse(sent).is_ok());
            }
        }
        return Ok(());
    }
    match step {
        Step::Poll => {
            bench.node.poll(now_ns);
            let due = bench.node.next_deadline_ns();
            let sent = bench.node.poll_transmit(now_ns, &mut bench.response);
            prop_assert!(sent.is_none() || due.is_some_and(|due_ns| due_ns <= now_ns));
            prop_assert!(
                sent.is_none() || bench.node.is_chained() || bench.node.nmt_state() == NmtState::BasicEthernet
            );
        }
        // A full queue is an error, not a panic.
        Step::SendEthernet(len) => drop(bench.node.send_ethernet(&vec![8; *len])),
        Step::Report(code) => bench.node.report_error(402, *code, [0; 8]),
        Step::Crc => drop(bench.node.report_crc_error(now_ns)),
        Step::Octets(_) | Step::Frame(..) | Step::Other(..) | Step::Soa(..) | Step::Command(_) | Step::Sdo(..) => {}
    }
    Ok(())
}

#[test]
fn a_node_rests_while_it_is_led_and_listens_before() {
    let mut bench = Bench::new();
    assert_eq!(bench.node.rests_until_ns(), 0);
    bench.start();
    let now_ns = bench.now_ns;
    let heard = bench.node.dictionary().read(0x1101, 2).unwrap().to_vec();
    for (message, to, from, counts) in [(3, 7, node::MN, 0), (4, 255, 7, 1)] {
        let passed = passed_by(&bench.node, now_ns, &frame(message, to, from, &[0; 60])).expect("it rests");
        let now_heard = passed.dictionary().read(0x1101, 2).unwrap();
        assert_eq!(now_heard[0], heard[0] + counts);
    }
}

proptest! {
    #[test]
    fn nothing_panics_and_nothing_is_sent_without_an_invitation(
        started in any::<bool>(), steps in proptest::collection::vec((step(), 0_u64..2_000_000), 1..120),
    ) {
        let mut bench = Bench::new();
        if started {
            bench.start();
            // An SDO connection that takes commands.
            for handshake in [[0x00, 0x01], [0x01, 0x02]] {
                bench.send(multicast::ASND, NODE, &Frame::Asnd(Asnd::Sdo(&[handshake[0], handshake[1], 0, 0])));
                bench.soa(RequestedService::UnspecifiedInvite, NODE);
            }
        }
        for (step, pause_ns) in &steps {
            bench.now_ns += pause_ns;
            apply(&mut bench, step)?;
            let state = bench.node.nmt_state();
            prop_assert_eq!(bench.node.dictionary().read(0x1F8C, 0).unwrap(), &[u8::from(state)][..]);
            prop_assert!(!bench.node.is_chained() || bench.node.state.is_isochronous()
                || matches!(state, NmtState::Stopped | NmtState::PreOperational1));
        }
    }
}
