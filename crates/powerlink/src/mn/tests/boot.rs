//! From silence to OPERATIONAL, and down again.

use super::*;

#[test]
fn four_drives_come_up_in_the_order_of_the_standard() {
    let configuration = configuration();
    let nodes = [1, 2, 3, 10].map(|id| node_config(id, &configuration));
    let mut net = Net::new(&nodes);
    let cycles = net.boot();
    assert!(cycles < 400, "took {cycles} cycles of 1 ms");
    assert_eq!(net.mn.nmt_state(), NmtState::Operational);
    check_order(&net.log, 0);

    // Listening, then ten empty SoAs, then the reset of everybody.
    assert!(net.log[0].now_ns > 20 * MS);
    for sent in &net.log[..10] {
        assert!(
            matches!(sent.frame(), Frame::Soa(soa) if soa == Soa::new(NmtState::PreOperational1, RequestedService::NoService, 0))
        );
    }
    let invite = Soa::new(NmtState::PreOperational1, RequestedService::NmtRequestInvite, 240);
    assert_eq!(net.log[10].frame(), Frame::Soa(invite));
    assert_eq!(
        net.log[11].frame(),
        Frame::Asnd(Asnd::NmtCommand(NmtCommandFrame::plain(NmtCommand::ResetNode)))
    );
    assert_eq!(net.log[11].octets[15], 255);
    let first_soc = net
        .log
        .iter()
        .position(|sent| matches!(sent.frame(), Frame::Soc(_)))
        .unwrap();
    assert!(net.log[first_soc].now_ns - net.log[0].now_ns >= 30 * MS, "MNWaitPreOp1");
    assert!(
        net.log[first_soc..]
            .iter()
            .all(|sent| !matches!(sent.frame(), Frame::Soa(soa) if soa.nmt_state == NmtState::PreOperational1))
    );

    // Each node: its configuration active, twice, as it cannot be seen whether it has heard; ready, started; once each.
    let mut commands = net.commands();
    assert_eq!(commands.remove(0), (255, NmtCommand::ResetNode));
    for id in [1, 2, 3, 10] {
        let to_node: Vec<_> = commands.iter().filter(|sent| sent.0 == id).map(|sent| sent.1).collect();
        let expected = [
            NmtCommand::ResetConfiguration,
            NmtCommand::ResetConfiguration,
            NmtCommand::EnableReadyToOperate,
            NmtCommand::StartNode,
        ];
        assert_eq!(to_node, expected, "node {id}");
    }
    assert_eq!(commands.len(), 16);
    for (node, config) in nodes.iter().enumerate() {
        let statistics = net.mn.statistics(node);
        assert_eq!(
            (statistics.boots, statistics.objects_written, statistics.faults),
            (1, 9, 0)
        );
        assert_eq!(statistics.preq_sent, statistics.pres_received);
        assert_eq!(
            net.count_events(|event| *event == MnEvent::Configuring { node: config.id }),
            1
        );
    }
    let states: Vec<_> = net
        .events
        .iter()
        .filter_map(|event| match event {
            MnEvent::NmtStateChanged { state } => Some(*state),
            _ => None,
        })
        .collect();
    let expected = [
        NmtState::PreOperational1,
        NmtState::PreOperational2,
        NmtState::ReadyToOperate,
        NmtState::Operational,
    ];
    assert_eq!(states, expected);
    assert_eq!(net.mn.counters().malformed.total(), 0);
    assert_eq!(net.mn.counters().unexpected, 0);
}

#[test]
fn process_data_go_there_and_back() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    net.mn
        .output_mut(1)
        .copy_from_slice(&[0x78, 0x56, 0x34, 0x12, 0x0F, 0x00]);
    {
        let drive = net.drives.get_mut(&2).unwrap();
        let (position, statusword) = (
            drive.dictionary().key::<i32>(0x6064, 0).unwrap(),
            drive.dictionary().key::<u16>(0x6041, 0).unwrap(),
        );
        drive.dictionary_mut().set(position, -2);
        drive.dictionary_mut().set(statusword, 0x0237);
    }
    net.cycles(2);
    let target = |net: &Net<'_>| {
        let dictionary = net.drives[&2].dictionary();
        dictionary.get(dictionary.key::<i32>(0x607A, 0).unwrap())
    };
    assert_eq!(target(&net), 0, "outputs are not valid yet: RD is 0");
    net.mn.set_outputs_valid(true);
    net.cycles(1);
    assert_eq!(target(&net), 0x1234_5678);
    let input = net.mn.input(1);
    assert_eq!(input.data, [0xFE, 0xFF, 0xFF, 0xFF, 0x37, 0x02]);
    assert!(input.fresh);
    assert_eq!(input.lost_in_row, 0);
    assert_eq!(net.mn.input(0).data, [0; 6]);
    assert_eq!(
        net.mn.input(7),
        Input {
            data: &[],
            fresh: false,
            lost_in_row: 0
        }
    );
    assert!(net.mn.output_mut(7).is_empty());
}

#[test]
fn a_configuration_that_is_there_is_not_written_again() {
    let octets = stamped_configuration();
    let nodes = [node_config(1, &octets)];
    let mut net = Net::new(&nodes);
    for (sub, value) in [(1, 20_000_u32), (2, 0x2211)] {
        let dictionary = net.drives.get_mut(&1).unwrap().dictionary_mut();
        let handle = dictionary.find(0x1020, sub).unwrap();
        dictionary.set_default(handle, &value.to_le_bytes()).unwrap();
    }
    net.until(600, |net| {
        net.mn.statistics(0).boots == 1 && net.mn.nodes.get(0).unwrap().is_configured()
    });
    assert_eq!(net.mn.statistics(0).objects_written, 0);
    assert_eq!(net.commands(), [(255, NmtCommand::ResetNode)], "no ResetConfiguration");
}

#[test]
fn a_node_that_holds_its_configuration_is_read_all_the_same() {
    let octets = stamped_configuration();
    for (value, comes_up) in [((CYCLE_NS / US) as u32, true), (7, false)] {
        // Not written, as 1006 of a node that holds its configuration is not.
        let expected = [obd::Expected {
            index: 0x1006,
            sub: 0,
            mask: u32::MAX,
            value,
        }];
        let nodes = [NodeConfig {
            expected: &expected,
            ..node_config(1, &octets)
        }];
        let mut net = Net::new(&nodes);
        let stored = [
            (0x1020, 1, 20_000),
            (0x1020, 2, 0x2211),
            (0x1006, 0, (CYCLE_NS / US) as u32),
        ];
        for (index, sub, value) in stored {
            let dictionary = net.drives.get_mut(&1).unwrap().dictionary_mut();
            let handle = dictionary.find(index, sub).unwrap();
            dictionary.set_default(handle, &value.to_le_bytes()).unwrap();
        }
        net.until(600, |net| match comes_up {
            true => net.mn.nodes.get(0).unwrap().is_configured(),
            false => net.mn.node_state(0) == NodeState::Faulted,
        });
        assert_eq!(net.mn.statistics(0).objects_written, 0);
        let is_reset = net.commands().contains(&(1, NmtCommand::ResetConfiguration));
        assert!(!is_reset, "nothing was written that it would put into use");
    }
}

#[test]
fn a_node_without_configuration_is_not_written_to() {
    let nodes = [NodeConfig {
        preq_bytes: 0,
        pres_bytes: 0,
        ..node_config(1, &[])
    }];
    let mut net = Net::new(&nodes);
    net.boot();
    assert_eq!(net.mn.statistics(0).objects_written, 0);
    let expected = [
        (255, NmtCommand::ResetNode),
        (1, NmtCommand::EnableReadyToOperate),
        (1, NmtCommand::StartNode),
    ];
    assert_eq!(net.commands(), expected);
}

#[test]
fn a_mandatory_node_holds_the_network_and_an_optional_one_does_not() {
    let configuration = configuration();
    let nodes = [
        node_config(1, &configuration),
        NodeConfig {
            assignment: Assignment {
                mandatory: false,
                ..Assignment::default()
            },
            ..node_config(2, &configuration)
        },
    ];
    let mut net = Net::new(&nodes);
    net.dead = std::vec![1];
    net.cycles(300);
    assert_eq!(net.mn.nmt_state(), NmtState::PreOperational1);
    assert_eq!(net.count_events(|event| matches!(event, MnEvent::Missing { .. })), 1);
    assert_eq!(net.count_events(|event| *event == MnEvent::Missing { node: 1 }), 1);
    net.dead = std::vec![2];
    net.until(500, |net| net.mn.node_state(0) == NodeState::Operational);
    assert_eq!(net.mn.nmt_state(), NmtState::Operational);
    assert_eq!(net.drives[&1].nmt_state(), NmtState::Operational);
    // The optional one comes late, and is booted while the network runs.
    let cycles = net.mn.statistics(0).pres_lost;
    net.dead.clear();
    net.boot();
    assert_eq!(net.mn.statistics(0).pres_lost, cycles);
    check_order(&net.log, 0);
}

#[test]
fn a_network_without_mandatory_nodes_becomes_operational() {
    let mut net = Net::new(&[]);
    net.until(200, |net| net.mn.nmt_state() == NmtState::Operational);
    let soc = net
        .log
        .iter()
        .filter(|sent| matches!(sent.frame(), Frame::Soc(_)))
        .count() as u64;
    assert_eq!(net.mn.counters().cycles, soc);
}

#[test]
fn a_node_that_is_another_one_is_refused_and_named() {
    let configuration = configuration();
    let identity = Identity {
        vendor_id: Some(1),
        product_code: Some(7),
        ..Identity::default()
    };
    let nodes = [NodeConfig {
        identity,
        ..node_config(1, &configuration)
    }];
    let mut net = Net::new(&nodes);
    net.cycles(300);
    let mismatch = MnEvent::IdentityMismatch {
        node: 1,
        field: IdentityField::ProductCode,
        expected: 7,
        got: 2,
    };
    assert_eq!(net.count_events(|event| *event == mismatch), 1);
    assert_eq!(net.mn.node_state(0), NodeState::Faulted);
    assert_eq!(net.mn.nmt_state(), NmtState::PreOperational1);
    // Looked at again later: the device may have been exchanged.
    net.cycles(5000);
    assert_eq!(net.count_events(|event| *event == mismatch), 2);
}

#[test]
fn a_value_the_node_refuses_is_named() {
    let mut octets = configuration();
    octets[0] = 10;
    octets.extend([0x99, 0x29, 1, 1, 0, 0, 0, 5]);
    let nodes = [node_config(1, &octets)];
    let mut net = Net::new(&nodes);
    net.until(600, |net| net.mn.node_state(0) == NodeState::Faulted);
    let abort = MnEvent::SdoAbort {
        node: 1,
        index: 0x2999,
        sub: 1,
        code: obd::AbortCode::NO_OBJECT,
    };
    assert_eq!(net.count_events(|event| *event == abort), 1);
    assert_eq!(net.mn.statistics(0).objects_written, 9);
    assert_eq!(net.mn.nmt_state(), NmtState::PreOperational1);
    check_order(&net.log, 0);
}

#[test]
fn a_value_that_the_node_has_and_should_not_is_named_and_one_that_it_lacks_is_believed() {
    let configuration = configuration();
    let of = |index, mask, value| obd::Expected {
        index,
        sub: 0,
        mask,
        value,
    };
    // Its statusword is 0 before anything runs; there is no 2999.
    let good = [
        of(0x6041, 0xFFFF, 0),
        of(0x2999, 0xFF, 7),
        of(0x1006, u32::MAX, (CYCLE_NS / US) as u32),
    ];
    let nodes = [NodeConfig {
        expected: &good,
        ..node_config(1, &configuration)
    }];
    let mut net = Net::new(&nodes);
    net.until(600, |net| net.mn.node_state(0) == NodeState::Operational);
    let bad = [good[0], good[1], of(0x1006, 0x0000_FF00, 0x0100)];
    let nodes = [NodeConfig {
        expected: &bad,
        ..node_config(1, &configuration)
    }];
    let mut net = Net::new(&nodes);
    net.until(600, |net| net.mn.node_state(0) == NodeState::Faulted);
    let mismatch = MnEvent::ValueMismatch {
        node: 1,
        index: 0x1006,
        sub: 0,
        expected: 0x0100,
        got: 0x0300,
    };
    assert_eq!(net.count_events(|event| *event == mismatch), 1);
    assert_eq!(net.mn.nmt_state(), NmtState::PreOperational1);
}

/// The configuration of a drive with further writes of four octets.
fn configuration_with(writes: &[(u16, u8, [u8; 4])]) -> Vec<u8> {
    let mut octets = configuration();
    octets[0] += writes.len() as u8;
    for (index, sub, value) in writes {
        octets.extend(index.to_le_bytes());
        octets.extend([*sub, 4, 0, 0, 0]);
        octets.extend(value);
    }
    octets
}

#[test]
fn what_a_node_may_lack_does_not_stop_its_boot_up() {
    let lacks = [
        (0x1010, 1, *b"save"),
        (0x1C0E, 3, [40, 0, 0, 0]),
        (0x1C0D, 4, [40, 0, 0, 0]),
    ];
    let octets = configuration_with(&lacks);
    let nodes = [node_config(1, &octets)];
    let mut net = Net::new(&nodes);
    net.boot();
    for (index, sub, _) in lacks {
        let named = |event: &MnEvent| matches!(event, MnEvent::SdoAbort { index: at, sub: part, .. } if (*at, *part) == (index, sub));
        assert_eq!(net.count_events(named), 1, "0x{index:04X}/{sub}");
    }
    assert_eq!(net.mn.statistics(0).objects_written, 9);
}

#[test]
fn an_optional_object_that_refuses_its_value_does() {
    // A multiplexed round of four octets: the object has one.
    let octets = configuration_with(&[(0x1F98, 7, [4, 0, 0, 0])]);
    let nodes = [node_config(1, &octets)];
    let mut net = Net::new(&nodes);
    net.until(600, |net| net.mn.node_state(0) == NodeState::Faulted);
    let abort = |event: &MnEvent| {
        matches!(
            event,
            MnEvent::SdoAbort {
                index: 0x1F98,
                sub: 7,
                ..
            }
        )
    };
    assert_eq!(net.count_events(abort), 1);
}

#[test]
fn the_network_is_taken_down_in_order() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    let before = net.log.len();
    net.mn.shut_down();
    let cycles = net.until(20, |net| net.mn.is_shut_down());
    assert_eq!(cycles, 4);
    let expected = [
        NmtCommand::StopNode,
        NmtCommand::StopNode,
        NmtCommand::ResetNode,
        NmtCommand::ResetNode,
    ];
    let commands = net.commands();
    assert_eq!(commands[commands.len() - 4..], expected.map(|command| (255, command)));
    assert_eq!(net.mn.nmt_state(), NmtState::Off);
    for drive in net.drives.values() {
        assert_eq!(drive.nmt_state(), NmtState::NotActive);
    }
    let polls_after_stop = net.log[before..]
        .iter()
        .skip_while(|sent| !matches!(sent.frame(), Frame::Asnd(_)))
        .filter(|sent| matches!(sent.frame(), Frame::Preq(_)))
        .count();
    assert_eq!(polls_after_stop, 0, "a stopped node is not polled");
    let after = net.log.len();
    net.cycles(5);
    assert_eq!(net.log.len(), after, "silence");

    let mut early = Net::new(&nodes);
    early.cycle();
    early.mn.shut_down();
    assert!(early.mn.is_shut_down(), "nothing was sent yet");
}

#[test]
fn a_long_wait_for_one_node_does_not_use_up_the_time_of_another() {
    let nodes = [1, 2].map(|id| NodeConfig {
        preq_bytes: 0,
        pres_bytes: 0,
        ..node_config(id, &[])
    });
    let mut net = Net::new(&nodes);
    net.dead = std::vec![2];
    net.cycles(1000);
    assert_eq!(net.mn.nmt_state(), NmtState::PreOperational1);
    net.dead.clear();
    net.boot();
    assert_eq!(
        net.count_events(|event| matches!(event, MnEvent::BootTimeout { .. })),
        0
    );
    assert_eq!(net.mn.statistics(0).boots, 1);
}

#[test]
fn a_long_value_of_the_configuration_goes_in_segments() {
    let value: Vec<u8> = (0..900_u32).map(|at| at as u8).collect();
    let mut long = configuration();
    long[0] += 1;
    long.extend([0x00, 0x2F, 0, 0x84, 3, 0, 0]);
    long.extend(&value);
    let nodes = [node_config(1, &long)];
    let mut net = Net::new(&nodes);
    net.boot();
    assert_eq!(net.drives[&1].dictionary().read(0x2F00, 0), Ok(&value[..]));
    let statistics = net.mn.statistics(0);
    assert_eq!((statistics.objects_written, statistics.faults), (10, 0));
    // Sent once each: 900 octets and the address in four frames, flags 0x10, 0x20, 0x20, 0x30.
    let flags: Vec<_> = net
        .log
        .iter()
        .filter(|sent| sent.source == 240 && matches!(sent.frame(), Frame::Asnd(Asnd::Sdo(_))))
        .map(|sent| sent.octets[24])
        .filter(|flags| *flags != 0)
        .collect();
    assert_eq!(flags, [0x10, 0x20, 0x20, 0x30]);
}

/// Bit 5 of 0x1F82 decides who is told by a list and who alone.
#[test]
fn nodes_that_wait_for_the_same_command_get_it_in_one_frame() {
    let nodes = [1, 2, 3, 4].map(|id| NodeConfig {
        preq_bytes: 0,
        pres_bytes: 0,
        ..node_config(id, &[])
    });
    for plain_only in [None, Some(3)] {
        let mut net = Net::new(&nodes);
        if let Some(id) = plain_only {
            let dictionary = net.drives.get_mut(&id).unwrap().dictionary_mut();
            let handle = dictionary.find(0x1F82, 0).unwrap();
            dictionary.set_default(handle, &5_u32.to_le_bytes()).unwrap();
        }
        net.boot();
        let extended = net.extended_commands();
        assert!(extended.contains(&NmtCommand::StartNodeEx), "{extended:?}");
        let starts = |id| {
            net.commands()
                .iter()
                .filter(|sent| **sent == (id, NmtCommand::StartNode))
                .count()
        };
        assert_eq!([1, 2, 3, 4].map(starts), [1; 4]);
        let alone = net.log.iter().filter(|sent| {
            let start = NmtCommandFrame::plain(NmtCommand::StartNode);
            matches!(sent.frame(), Frame::Asnd(Asnd::NmtCommand(frame)) if frame == start)
        });
        let alone: Vec<_> = alone.map(|sent| sent.octets[15]).collect();
        assert_eq!(alone, Vec::from_iter(plain_only));
        check_order(&net.log, 0);
    }
}

#[test]
fn a_lost_reset_configuration_leaves_no_node_with_what_it_had_before() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    net.lose_command = Some(NmtCommand::ResetConfiguration);
    net.boot();
    assert_eq!(net.lose_command, None);
    // By it the cycle length becomes active: without, a node may have no watch over the SoC.
    assert_eq!(net.resets, [(1, Reset::Node), (1, Reset::Configuration)]);
    assert_eq!((net.mn.statistics(0).boots, net.mn.statistics(0).faults), (1, 0));
}

/// Concise DCF with date and time of the configuration: ten writes.
pub(super) fn stamped_configuration() -> Vec<u8> {
    let mut octets = configuration();
    octets[0] = 10;
    octets.extend([0x20, 0x10, 2, 4, 0, 0, 0, 0x11, 0x22, 0, 0]);
    octets
}

#[test]
fn reset_configuration_is_sent_once_to_a_node_that_shows_that_it_has_heard_it() {
    let configuration = stamped_configuration();
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    let mut net = Net::new(&nodes);
    net.boot();
    for id in [1, 2, 3] {
        let to_node: Vec<_> = net
            .commands()
            .iter()
            .filter(|sent| sent.0 == id)
            .map(|sent| sent.1)
            .collect();
        let expected = [
            NmtCommand::ResetConfiguration,
            NmtCommand::EnableReadyToOperate,
            NmtCommand::StartNode,
        ];
        assert_eq!(to_node, expected, "node {id}");
    }
}

#[test]
fn a_lost_reset_configuration_is_seen_and_sent_again() {
    let configuration = stamped_configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    let cycles = {
        let mut clean = Net::new(&nodes);
        clean.boot()
    };
    net.lose_command = Some(NmtCommand::ResetConfiguration);
    let lost = net.boot();
    assert_eq!(net.lose_command, None);
    assert_eq!(net.resets, [(1, Reset::Node), (1, Reset::Configuration)]);
    let sent = net.commands();
    let resets = sent.iter().filter(|sent| **sent == (1, NmtCommand::ResetConfiguration));
    assert_eq!(resets.count(), 2, "{sent:?}");
    assert_eq!((net.mn.statistics(0).boots, net.mn.statistics(0).faults), (1, 0));
    assert!(lost <= cycles + 20, "{lost} cycles, without loss {cycles}");
}

/// A node that never shows the stamp that was written into it is not held up for ever.
#[test]
fn a_node_without_a_stamp_of_its_configuration_comes_up_all_the_same() {
    let configuration = configuration();
    let nodes = [NodeConfig {
        configuration_stamp: Some(Stamp { date: 15_000, time: 77 }),
        ..node_config(1, &configuration)
    }];
    let mut net = Net::new(&nodes);
    net.boot();
    let sent = net.commands();
    let resets = sent.iter().filter(|sent| **sent == (1, NmtCommand::ResetConfiguration));
    assert_eq!(resets.count(), 3, "{sent:?}");
}

/// States of the managing node as its SoAs show them, each once, with those of the mandatory nodes at the first SoA of it.
fn states_shown(net: &Net<'_>) -> Vec<NmtState> {
    let mut shown = Vec::new();
    for sent in &net.log {
        if let Frame::Soa(soa) = sent.frame()
            && shown.last() != Some(&soa.nmt_state)
        {
            shown.push(soa.nmt_state);
        }
    }
    shown
}

#[test]
fn every_state_on_the_way_is_shown_and_ready_to_operate_only_when_the_nodes_are() {
    let all = [
        NmtState::PreOperational1,
        NmtState::PreOperational2,
        NmtState::ReadyToOperate,
        NmtState::Operational,
    ];
    // Without nodes nothing holds the network up.
    let mut net = Net::new(&[]);
    net.until(200, |net| net.mn.nmt_state() == NmtState::Operational);
    net.cycle();
    assert_eq!(states_shown(&net), all);

    let configuration = configuration();
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    let mut net = Net::new(&nodes);
    net.mn.set_outputs_valid(true);
    for _ in 0..2000 {
        net.cycle();
        let shown = net.log.iter().rev().find_map(|sent| match sent.frame() {
            Frame::Soa(soa) => Some(soa.nmt_state),
            _ => None,
        });
        if shown == Some(NmtState::ReadyToOperate) {
            let states = net.drives.values().map(Drive::nmt_state);
            assert!(
                states.into_iter().all(|state| state == NmtState::ReadyToOperate),
                "{:?}",
                net.drives[&1].nmt_state()
            );
        }
        if net.all_operational() {
            break;
        }
    }
    assert_eq!(states_shown(&net), all);
    // RD: only since the managing node is OPERATIONAL, and then to all.
    let mut state = NmtState::PreOperational1;
    let mut polls = [0, 0];
    for sent in &net.log {
        match sent.frame() {
            Frame::Soa(soa) => state = soa.nmt_state,
            Frame::Preq(preq) => {
                assert!(
                    !preq.ready || state == NmtState::Operational,
                    "RD in {state:?} at {}",
                    sent.now_ns
                );
                polls[usize::from(preq.ready)] += 1;
            }
            _ => {}
        }
    }
    assert!(polls[0] > 0 && polls[1] > 0, "{polls:?}");
}
