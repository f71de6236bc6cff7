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
    net.until(400, |net| net.mn.nodes[0].as_ref().unwrap().is_configured());
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
fn a_start_by_broadcast_and_by_the_application_is_refused() {
    let config = MnConfig {
        startup: StartUp::from_bits(1 << 1 | 1 << 3).unwrap(),
        ..mn_config(&[])
    };
    assert_eq!(
        Mn::<NODES>::new(config).unwrap_err().to_string(),
        "node 240: nodes are started by a broadcast (1F80h bit 1), or by the application (bit 3), not by both"
    );
}
