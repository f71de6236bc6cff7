//! NMT_StartUp (0x1F80), bit by bit.

use super::*;
use std::string::ToString;

/// A network with these start-up bits, everything else as in the other tests.
fn network<'a>(nodes: &'a [NodeConfig<'a>], bits: u32) -> Net<'a> {
    Net::with(MnConfig {
        startup: StartUp::from_bits(bits).unwrap(),
        ..mn_config(nodes)
    })
}

const STAY: u32 = 1 << 12;
const CHECK_CONFIGURATION: u32 = 1 << 11;

/// The stamp a drive has from the start, as after a restore.
fn stamp_drive(net: &mut Net<'_>, id: u8, stamp: Stamp) {
    let dictionary = net.drives.get_mut(&id).unwrap().dictionary_mut();
    for (sub, value) in [(1, stamp.date), (2, stamp.time)] {
        let handle = dictionary.find(0x1020, sub).unwrap();
        dictionary.set_default(handle, &value.to_le_bytes()).unwrap();
    }
}

#[test]
fn bit_9_decides_whether_more_than_the_device_type_is_checked() {
    let configuration = configuration();
    let identity = Identity {
        device_type: Some(0x0002_0192),
        vendor_id: Some(99),
        ..Identity::default()
    };
    let nodes = [NodeConfig {
        identity,
        ..node_config(1, &configuration)
    }];
    network(&nodes, STAY).boot();
    let mut net = network(&nodes, STAY | 1 << 9);
    net.until(400, |net| net.mn.node_state(0) == NodeState::Faulted);
    let mismatch = MnEvent::IdentityMismatch {
        node: 1,
        field: IdentityField::VendorId,
        expected: 99,
        got: 1,
    };
    assert_eq!(net.count_events(|event| *event == mismatch), 1);

    // The device type is checked always.
    let nodes = [NodeConfig {
        identity: Identity {
            device_type: Some(7),
            ..Identity::default()
        },
        ..node_config(1, &configuration)
    }];
    let mut net = network(&nodes, STAY);
    net.until(400, |net| net.mn.node_state(0) == NodeState::Faulted);
}

#[test]
fn bit_10_decides_whether_the_software_is_checked() {
    let configuration = configuration();
    let mut nodes = [node_config(1, &configuration)];
    nodes[0].assignment.check_software = true;
    nodes[0].software = Some(Stamp { date: 14_000, time: 5 });
    let software = |net: &mut Net<'_>, date: u32, time: u32| {
        let dictionary = net.drives.get_mut(&1).unwrap().dictionary_mut();
        for (sub, value) in [(1, date), (2, time)] {
            let handle = dictionary.find(0x1F52, sub).unwrap();
            dictionary.set_default(handle, &value.to_le_bytes()).unwrap();
        }
    };
    network(&nodes, STAY).boot();
    for (date, time) in [(13_999, 5), (14_000, 6)] {
        let mut net = network(&nodes, STAY | 1 << 10);
        software(&mut net, date, time);
        net.until(400, |net| net.mn.node_state(0) == NodeState::Faulted);
        let mismatch = MnEvent::SoftwareMismatch {
            node: 1,
            expected: Stamp { date: 14_000, time: 5 },
            got: Stamp { date, time },
        };
        assert_eq!(net.count_events(|event| *event == mismatch), 1, "{:?}", net.events);
    }
    let mut net = network(&nodes, STAY | 1 << 10);
    software(&mut net, 14_000, 5);
    net.boot();

    nodes[0].software = None;
    let config = mn_config(&nodes);
    assert_eq!(
        Mn::<NODES>::new(config).unwrap_err().to_string(),
        "node 1: the software shall be checked (1F81h bit 5), and none is expected (1F53h, 1F54h)"
    );
}

#[test]
fn bit_11_decides_whether_a_current_configuration_is_written_again() {
    let configuration = configuration();
    let stamp = Stamp { date: 15_000, time: 77 };
    let nodes = [NodeConfig {
        configuration_stamp: Some(stamp),
        ..node_config(1, &configuration)
    }];
    // The node keeps its stamp beyond the reset, but this network does not ask for it.
    let mut net = network(&nodes, STAY);
    stamp_drive(&mut net, 1, stamp);
    net.boot();
    assert_eq!(net.mn.statistics(0).objects_written, 9);
    // The stamp is the expected one.
    let mut net = network(&nodes, STAY | CHECK_CONFIGURATION);
    stamp_drive(&mut net, 1, stamp);
    net.until(400, |net| net.mn.nodes.get(0).unwrap().is_configured());
    assert_eq!(net.mn.statistics(0).objects_written, 0);
    // Another one.
    let mut net = network(&nodes, STAY | CHECK_CONFIGURATION);
    stamp_drive(&mut net, 1, Stamp { date: 15_000, time: 78 });
    net.boot();
    assert_eq!(net.mn.statistics(0).objects_written, 9);
    // No stamp is no configuration.
    let nodes = [NodeConfig {
        configuration_stamp: Some(Stamp { date: 0, time: 0 }),
        ..node_config(1, &configuration)
    }];
    let mut net = network(&nodes, STAY | CHECK_CONFIGURATION);
    net.boot();
    assert_eq!(net.mn.statistics(0).objects_written, 9);
}

#[test]
fn bit_1_starts_all_ready_nodes_by_one_broadcast() {
    let configuration = configuration();
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    let mut net = network(&nodes, STAY | 1 << 1);
    net.boot();
    let starts: Vec<_> = net
        .commands()
        .into_iter()
        .filter(|(_, command)| *command == NmtCommand::StartNode)
        .collect();
    assert_eq!(starts, [(255, NmtCommand::StartNode)]);
    // One that comes later is started alone.
    net.reset_node(1);
    net.log.clear();
    net.boot();
    assert_eq!(net.commands().last(), Some(&(2, NmtCommand::StartNode)));
    check_order(&net.log, 0);
}

#[test]
fn bits_7_8_and_2_let_the_application_take_the_steps_of_the_network() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = network(&nodes, STAY | 1 << 7 | 1 << 8 | 1 << 2);
    assert!(!net.mn.go_on(), "it does not wait yet");
    for (stays, next) in [
        (NmtState::PreOperational1, NmtState::PreOperational2),
        (NmtState::PreOperational2, NmtState::ReadyToOperate),
        (NmtState::ReadyToOperate, NmtState::Operational),
    ] {
        let waits = |net: &Net<'_>| net.count_events(|event| *event == MnEvent::WaitsForApplication { next });
        net.until(600, |net| waits(net) > 0);
        net.cycles(50);
        assert_eq!(net.mn.nmt_state(), stays);
        assert_eq!(waits(&net), 1);
        assert!(net.mn.go_on());
        net.cycles(2);
        assert_eq!(net.mn.nmt_state(), next);
    }
    net.boot();
    assert_eq!(net.mn.statistics(0).faults, 0);
}

/// Node 1 is dead from now on; runs until it is given up.
fn lose_node_1(net: &mut Net<'_>) {
    net.events.clear();
    net.log.clear();
    net.dead = std::vec![1];
    net.until(20, |net| net.mn.node_state(0) == NodeState::Faulted);
    net.dead.clear();
}

#[test]
fn bit_12_clear_starts_the_network_again_when_a_mandatory_node_is_lost() {
    let configuration = configuration_anew();
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    let mut net = network(&nodes, CHECK_CONFIGURATION);
    net.boot();
    lose_node_1(&mut net);
    net.until(3, |net| net.mn.nmt_state() == NmtState::PreOperational1);
    net.boot();
    assert_eq!(net.mn.nmt_state(), NmtState::Operational);
    assert!(
        net.commands().iter().all(|(target, _)| *target != 255),
        "no reset of all"
    );
    assert_eq!(net.mn.statistics(0).faults, 1);
    assert_eq!(net.mn.statistics(1).faults, 0);
    assert_eq!(net.mn.statistics(1).boots, 2);
    assert_eq!(net.mn.counters().cycles_skipped, 0, "the pause is no loss of cycles");

    // An optional node that is lost takes nobody with it, neither does one when the bit is set.
    let mut optional = nodes;
    optional[0].assignment.mandatory = false;
    for (nodes, bits) in [(&optional, 0), (&nodes, STAY)] {
        let mut net = network(nodes, bits);
        net.boot();
        lose_node_1(&mut net);
        net.boot();
        assert_eq!(
            net.count_events(|event| matches!(event, MnEvent::NmtStateChanged { .. })),
            0
        );
        assert_eq!(net.mn.statistics(1).boots, 1);
    }
}

#[test]
fn bit_4_resets_all_nodes_when_a_mandatory_one_is_lost() {
    let configuration = configuration();
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    for (stay, resets) in [(STAY, 2), (0, 1)] {
        // Bit 6 counts for nothing beside it.
        let mut net = network(&nodes, stay | 1 << 4 | 1 << 6);
        net.boot();
        lose_node_1(&mut net);
        let command = NmtCommand::ResetNode;
        net.until(5, |net| net.commands().contains(&(255, command)));
        net.boot();
        let pending_broadcast = net.commands().iter().filter(|sent| **sent == (255, command)).count();
        assert_eq!(pending_broadcast, resets);
        assert_eq!(net.count_events(|event| *event == MnEvent::AllOnError { command }), 1);
        let went_back = net.count_events(|event| {
            *event
                == MnEvent::NmtStateChanged {
                    state: NmtState::PreOperational1,
                }
        });
        assert_eq!(went_back, usize::from(stay == 0));
        for node in 0..3 {
            assert_eq!(net.mn.statistics(node).boots, 2);
        }
    }
}

#[test]
fn bit_6_stops_all_nodes_when_a_mandatory_one_is_lost_until_the_application_goes_on() {
    let configuration = configuration();
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    for (stay, after) in [(STAY, NmtState::Operational), (0, NmtState::PreOperational1)] {
        let mut net = network(&nodes, stay | 1 << 6);
        net.boot();
        lose_node_1(&mut net);
        net.until(5, |net| net.mn.node_state(1) == NodeState::Stopped);
        net.cycles(500);
        assert_eq!(net.mn.nmt_state(), NmtState::Operational);
        for (node, state) in [NodeState::Ready, NodeState::Stopped, NodeState::Stopped]
            .iter()
            .enumerate()
        {
            assert_eq!(net.mn.node_state(node), *state, "{:?}", net.events);
        }
        assert_eq!(net.drives[&2].nmt_state(), NmtState::Stopped);
        assert!(
            net.commands()
                .iter()
                .all(|(_, command)| *command != NmtCommand::StartNode)
        );
        assert_eq!(
            net.count_events(|event| *event == MnEvent::WaitsForApplication { next: after }),
            1
        );
        assert!(net.mn.go_on());
        net.boot();
        assert_eq!(net.mn.nmt_state(), NmtState::Operational);
        assert_eq!(net.mn.statistics(1).faults, 0);
    }
}
