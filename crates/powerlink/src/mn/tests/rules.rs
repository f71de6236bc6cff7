//! Configuration checks, NMT requests, and octets of any kind.

use super::*;
use crate::wire::{IdentResponse, NmtRequestFrame, Requests, StatusResponse};
use proptest::prelude::*;
use std::string::{String, ToString};

fn refused(change: impl Fn(&mut MnConfig<'_>, &mut [NodeConfig<'_>; 2])) -> String {
    let mut nodes = [node_config(1, &[]), node_config(2, &[])];
    let mut config = MnConfig {
        nodes: &[],
        ..mn_config(&[])
    };
    change(&mut config, &mut nodes);
    let config = MnConfig {
        nodes: &nodes,
        ..config
    };
    Mn::<NODES>::new(config).expect_err("must be refused").to_string()
}

#[test]
fn a_configuration_is_refused_with_the_reason() {
    assert_eq!(
        refused(|config, _| config.cycle_ns = 1_000_500),
        "cycle of 1000500 ns: expected a whole number of microseconds above 0"
    );
    assert!(refused(|config, _| config.mac = multicast::SOC).contains("unicast"));
    assert!(refused(|config, _| config.async_slot_timeout_ns = 0).starts_with("node 240"));
    assert_eq!(refused(|_, nodes| nodes[1].id = 1), "two nodes have the id 1");
    assert_eq!(
        refused(|_, nodes| nodes[1].id = 240),
        "node id 240: controlled nodes have 1..=239"
    );
    assert_eq!(
        refused(|_, nodes| nodes[0].pres_bytes = 1491),
        "node 1: Pres of 1491 octets, at most 1490 fit into a frame"
    );
    assert!(refused(|_, nodes| nodes[1].pres_timeout_ns = 0).starts_with("node 2"));
    // Four minimum frames at 6720 ns, 100 + 900 µs, 150 µs.
    assert_eq!(
        refused(|_, nodes| nodes[1].pres_timeout_ns = 900_000),
        "the time-outs do not fit the cycle of 1000 us: 27 (frames) + 1000 (PRes) + 150 (async slot) = 1177 us"
    );
    assert!(refused(|_, nodes| nodes[0].configuration = &[1, 0, 0, 0, 5]).contains("concise DCF"));
    let many = [node_config(1, &[]); 9];
    let error = Mn::<NODES>::new(mn_config(&many)).err().unwrap();
    assert_eq!(error, MnConfigError::TooManyNodes { got: 9, most: 8 });
    let mut long = std::vec![1, 0, 0, 0, 0x34, 0x12, 1, 0, 2, 0, 0];
    long.extend([0; 512]);
    let nodes = [node_config(4, &long)];
    assert!(
        Mn::<NODES>::new(mn_config(&nodes)).is_ok(),
        "long values go in segments"
    );
}

/// A node that shows NMT requests and sends this one when it is invited.
#[test]
fn an_nmt_request_that_is_not_served_is_answered() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    net.cycles(60);
    net.log.clear();
    net.mn.nodes.get_mut(0).unwrap().requests = Requests {
        count: 1,
        priority: Requests::PRIORITY_NMT,
    };
    // The drive says RS = 0 with its next PRes, so the invitation comes only if that one is lost.
    net.lose_pres.insert(1, 1);
    net.cycle();
    let invited = Soa::new(NmtState::Operational, RequestedService::NmtRequestInvite, 1);
    assert!(net.log.iter().any(|sent| sent.frame() == Frame::Soa(invited)));
    let request = NmtRequestFrame {
        command: NmtCommand::StopNode,
        target: 1,
        data: [0; 32],
    };
    net.hear(
        Header::multicast(multicast::ASND, [2, 0, 0, 0, 0, 1], 1),
        &Frame::Asnd(Asnd::NmtRequest(request)),
    );
    net.cycles(2);
    let mut data = [0; 32];
    data[0] = 0x22;
    let answer = NmtCommandFrame {
        command: NmtCommand::InvalidService,
        data,
    };
    assert!(
        net.log
            .iter()
            .any(|sent| sent.frame() == Frame::Asnd(Asnd::NmtCommand(answer)) && sent.octets[15] == 1)
    );
    let request = NmtRequestFrame {
        command: NmtCommand::IdentRequest,
        target: 1,
        data: [0; 32],
    };
    net.hear(
        Header::multicast(multicast::ASND, [2, 0, 0, 0, 0, 1], 1),
        &Frame::Asnd(Asnd::NmtRequest(request)),
    );
    net.cycles(3);
    let ident = Soa::new(NmtState::Operational, RequestedService::IdentRequest, 1);
    assert!(net.log.iter().any(|sent| sent.frame() == Frame::Soa(ident)));
    assert!(net.all_operational());
    check_order(&net.log, 1);
}

/// Nobody can keep the slot for himself: the others still get theirs.
#[test]
fn a_node_that_always_wants_the_slot_starves_nobody() {
    let configuration = configuration();
    let nodes = [
        NodeConfig {
            assignment: Assignment {
                mandatory: false,
                ..Assignment::default()
            },
            ..node_config(1, &configuration)
        },
        node_config(2, &configuration),
    ];
    let mut net = Net::new(&nodes);
    for _ in 0..600 {
        for priority in [Requests::PRIORITY_NMT, Requests::PRIORITY_GENERIC] {
            if let Some(node) = net.mn.nodes.get_mut(0)
                && node.is_identified()
            {
                node.requests = Requests { count: 7, priority };
            }
        }
        net.cycle();
        if net.mn.node_state(1) == NodeState::Operational {
            return;
        }
    }
    panic!("node 2 is {:?}", net.mn.nodes.get(1).unwrap().stage);
}

/// Frames that look right, from any node, at any time.
fn any_frame() -> impl Strategy<Value = Vec<u8>> {
    let octets = proptest::collection::vec(any::<u8>(), 0..80);
    let shaped = (octets.clone(), 0u8..16, 0u8..9, 0u8..4).prop_map(|(mut octets, kind, service, source)| {
        if octets.len() > 18 {
            octets[..6].copy_from_slice(&multicast::ASND);
            octets[6..12].copy_from_slice(&[2, 0, 0, 0, 0, source]);
            octets[12..17].copy_from_slice(&[0x88, 0xAB, kind, 240, source]);
            octets[17] = service;
        }
        octets
    });
    prop_oneof![octets, shaped]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_octets_at_any_time_never_panic(
        frames in proptest::collection::vec((any_frame(), 0u64..3000), 1..200), booted in any::<bool>(),
    ) {
        let configuration = configuration();
        let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
        let mut net = Net::new(&nodes);
        if booted {
            net.boot();
        }
        for (frame, gap_us) in frames {
            let mut start_ns = net.now_ns + CYCLE_NS;
            net.mn.receive(net.now_ns, &frame);
            net.now_ns += gap_us * US;
            let mut steps = 0;
            while net.now_ns >= start_ns {
                net.mn.start_cycle(start_ns, NetTime::default());
                start_ns += CYCLE_NS;
            }
            loop {
                steps += 1;
                prop_assert!(steps < 1000, "endless");
                match net.mn.poll(net.now_ns) {
                    Step::Send(frame) => prop_assert!(Frame::parse(frame).is_ok()),
                    Step::WaitUntil(time_ns) => {
                        net.mn.receive(net.now_ns, &frame);
                        if time_ns >= start_ns {
                            break;
                        }
                        net.now_ns = net.now_ns.max(time_ns);
                    }
                    Step::IsochronousDone => {}
                    Step::Idle => break,
                }
            }
            while net.mn.pop_event().is_some() {}
        }
    }
}

/// The largest answers a node can give are taken as they are.
#[test]
fn answers_with_extreme_values_change_nothing_they_should_not() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    let header = Header::multicast(multicast::ASND, [2, 0, 0, 0, 0, 1], 1);
    let ident = IdentResponse {
        device_type: u32::MAX,
        nmt_state: NmtState::Unknown(0x77),
        ..IdentResponse::default()
    };
    net.hear(header, &Frame::Asnd(Asnd::IdentResponse(ident)));
    let entries = [0xFF; 1480];
    let status = StatusResponse {
        exception_clear: true,
        exception_new: false,
        requests: Requests { count: 7, priority: 7 },
        nmt_state: NmtState::Unknown(0x77),
        static_errors: [0xFF; 8],
        entries: crate::wire::ErrorEntries(&entries),
    };
    net.hear(header, &Frame::Asnd(Asnd::StatusResponse(status)));
    assert_eq!(net.mn.counters().unexpected, 2);
    net.cycles(10);
    assert!(net.all_operational());
}
