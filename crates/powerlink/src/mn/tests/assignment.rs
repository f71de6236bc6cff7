//! NMT_NodeAssignment (0x1F81), bit by bit. Bit 3 (mandatory) is in `boot`, bit 5 (software) in `startup`.

use super::*;
use std::string::{String, ToString};

/// Why a managing node with this one node is refused.
fn refused(change: impl FnOnce(&mut MnConfig<'_>, &mut NodeConfig<'_>)) -> String {
    let configuration = configuration();
    let mut node = node_config(1, &configuration);
    let mut config = mn_config(&[]);
    change(&mut config, &mut node);
    let nodes = [node];
    let config = MnConfig {
        nodes: &nodes,
        ..config
    };
    Mn::<NODES>::new(config).expect_err("must be refused").to_string()
}

#[test]
fn bits_that_cannot_go_together_are_refused_by_name() {
    assert_eq!(
        refused(|_, node| node.assignment.automatic_start = false),
        "node 1: a node that waits for the application to boot it (1F81h bit 2 is clear) is not served"
    );
    assert_eq!(
        refused(|_, node| node.assignment.async_only = true),
        "node 1: a node that is never polled (1F81h bit 8) has no process data"
    );
    assert_eq!(
        refused(|_, node| node.assignment.keep_alive = true),
        "node 1: a node that is kept alive (1F81h bit 4) needs date and time of its configuration (1F26h, 1F27h)"
    );
    assert_eq!(
        refused(|config, node| {
            config.startup.check_configuration = false;
            node.assignment.keep_alive = true;
        }),
        "node 1: a node that is kept alive (1F81h bit 4) needs the configuration check (1F80h bit 11)"
    );
}

fn optional_bits(bits: u32) -> Assignment {
    Assignment::from_bits(1, 0x8000_0003 | bits).unwrap().unwrap()
}

#[test]
fn bit_4_takes_a_running_node_over_as_it_is() {
    let (stamped, plain) = (boot::stamped_configuration(), configuration());
    let kept_alive = |expected| {
        let mut nodes = [
            NodeConfig {
                configuration_stamp: expected,
                ..node_config(1, &stamped)
            },
            node_config(2, &plain),
        ];
        nodes[0].assignment.keep_alive = true;
        nodes
    };
    // The stamp that the configuration itself writes, and another one.
    for (expected, kept) in [(None, true), (Some(Stamp { date: 15_000, time: 78 }), false)] {
        let nodes = kept_alive(None);
        let mut before = Net::new(&nodes);
        before.boot();
        // The managing node is started anew; the nodes do not watch the SoC.
        let nodes = kept_alive(expected);
        let mut net = Net::new(&nodes);
        net.drives = before.drives;
        net.now_ns = before.now_ns;
        for drive in net.drives.values_mut() {
            let dictionary = drive.dictionary_mut();
            let handle = dictionary.find(0x1C0B, 3).unwrap();
            dictionary.set_octets(handle, &[0; 4]).unwrap();
        }
        net.boot();
        let statistics = net.mn.statistics(0);
        assert_eq!((statistics.boots, statistics.faults), (1, 0));
        assert_eq!(statistics.objects_written, if kept { 0 } else { 10 });
        let commands = net.commands();
        assert!(commands.iter().all(|(target, _)| *target != 255), "no reset of all");
        assert_eq!(commands.iter().all(|(target, _)| *target != 1), kept, "{commands:?}");
        assert_eq!(commands[0], (2, NmtCommand::ResetNode));
        check_order(&net.log, 0);
    }
}

#[test]
fn a_running_node_is_read_before_it_is_taken_over() {
    let stamped = boot::stamped_configuration();
    for (value, kept) in [((CYCLE_NS / US) as u32, true), (7, false)] {
        let expected = [obd::Expected {
            index: 0x1006,
            sub: 0,
            mask: u32::MAX,
            value,
        }];
        let nodes = |expected| {
            let mut nodes = [NodeConfig {
                expected,
                ..node_config(1, &stamped)
            }];
            nodes[0].assignment.keep_alive = true;
            nodes
        };
        let before_nodes = nodes(&[]);
        let mut before = Net::new(&before_nodes);
        before.boot();
        let nodes = nodes(&expected);
        let mut net = Net::new(&nodes);
        net.drives = before.drives;
        net.now_ns = before.now_ns;
        for drive in net.drives.values_mut() {
            let dictionary = drive.dictionary_mut();
            let handle = dictionary.find(0x1C0B, 3).unwrap();
            dictionary.set_octets(handle, &[0; 4]).unwrap();
        }
        net.until(600, |net| match kept {
            true => net.mn.node_state(0) == NodeState::Operational,
            false => net.mn.node_state(0) == NodeState::Faulted,
        });
        assert_eq!(net.mn.statistics(0).objects_written, 0);
        let told = net.count_events(|event| matches!(event, MnEvent::ValueMismatch { index: 0x1006, .. }));
        assert_eq!(told, usize::from(!kept));
        if kept {
            assert!(
                net.commands().iter().all(|(target, _)| *target != 1),
                "{:?}",
                net.commands()
            );
            net.cycles(1000);
            assert_eq!(
                (net.mn.statistics(0).faults, net.mn.node_state(0)),
                (0, NodeState::Operational)
            );
        }
    }
}

#[test]
fn bit_8_boots_and_watches_a_node_without_polls() {
    let configuration = configuration();
    let nodes = [
        NodeConfig {
            assignment: optional_bits(1 << 2 | 1 << 3 | 1 << 8),
            preq_bytes: 0,
            pres_bytes: 0,
            status_threshold: 15,
            ..node_config(1, &configuration)
        },
        node_config(2, &configuration),
    ];
    let mut net = Net::new(&nodes);
    net.boot();
    assert_eq!(net.mn.statistics(0).objects_written, 9);
    assert_eq!(net.mn.statistics(0).preq_sent, 0);
    assert_eq!(net.drives[&1].nmt_state(), NmtState::Operational);
    net.log.clear();
    net.cycles(1000);
    let asked = net
        .log
        .iter()
        .filter(|sent| matches!(sent.frame(), Frame::Soa(Soa { target: 1, .. })))
        .count();
    assert!((9..=10).contains(&asked), "{asked} StatusRequests, one every 100 ms");
    // Two unanswered requests reach the threshold of 15; it comes back by itself.
    net.dead = std::vec![1];
    net.until(200, |net| net.mn.node_state(0) == NodeState::Faulted);
    let loss = net.mn.statistics(0).loss_of_status;
    assert_eq!((loss.cumulative, loss.count), (2, 0));
    assert_eq!(
        net.count_events(|event| *event == MnEvent::Lost { node: 1, in_row: 2 }),
        1
    );
    net.dead.clear();
    net.boot();
    // It leaves OPERATIONAL by itself.
    let stop = NmtCommandFrame::plain(NmtCommand::EnterPreOperational2);
    let header = Header::multicast(multicast::ASND, MN_MAC, 240);
    let mut octets = [0; FRAME_LEN_MAX];
    let len = Frame::Asnd(Asnd::NmtCommand(stop)).emit(&header, &mut octets).unwrap();
    octets[15] = 1;
    let now_ns = net.now_ns;
    let mut response = [0; FRAME_LEN_MAX];
    net.drives
        .get_mut(&1)
        .unwrap()
        .receive(now_ns, &octets[..len], &mut response);
    net.until(1000, |net| net.mn.node_state(0) == NodeState::Faulted);
    net.boot();
}
