//! What a cycle is made of: multiplexed rounds, the managing node's own PRes, prescaler, waits, thresholds.

use super::*;

fn multiplexed(id: u8, cycle: u8, configuration: &[u8]) -> NodeConfig<'_> {
    NodeConfig {
        assignment: Assignment {
            multiplexed: true,
            ..Assignment::default()
        },
        multiplex_cycle: cycle,
        ..node_config(id, configuration)
    }
}

/// Frames of the last cycles: for each SoC its MC flag, and the nodes polled after it.
fn rounds(log: &[OnWire]) -> Vec<(bool, Vec<u8>)> {
    let mut rounds: Vec<(bool, Vec<u8>)> = Vec::new();
    for sent in log {
        match sent.frame() {
            Frame::Soc(soc) => rounds.push((soc.multiplexed_cycle, Vec::new())),
            Frame::Preq(preq) => {
                let node = sent.octets[15];
                assert_eq!(preq.multiplexed, node != 1, "MS is for multiplexed nodes");
                rounds.last_mut().unwrap().1.push(node);
            }
            _ => {}
        }
    }
    rounds
}

#[test]
fn multiplexed_nodes_are_polled_once_a_round_and_the_flag_toggles_with_it() {
    let configuration = configuration();
    let nodes = [
        node_config(1, &configuration),
        multiplexed(2, 1, &configuration),
        multiplexed(3, 3, &configuration),
        multiplexed(4, 3, &configuration),
    ];
    let mut net = Net::with(MnConfig {
        multiplex_cycles: 3,
        ..mn_config(&nodes)
    });
    net.boot();
    net.cycles(60);
    let before = net.mn.statistics(1).preq_sent;
    net.log.clear();
    net.cycles(300);
    assert_eq!(net.mn.statistics(1).preq_sent - before, 100);
    let rounds = rounds(&net.log);
    let first = rounds.iter().position(|round| round.1 == [1, 2]).unwrap();
    for (at, (toggle, polled)) in rounds[first..].iter().enumerate() {
        let expected: &[u8] = [&[1, 2][..], &[1], &[1, 3, 4]][at % 3];
        assert_eq!(polled, expected, "cycle {at}");
        assert_eq!(*toggle, rounds[first].0 ^ (at / 3 % 2 == 1), "cycle {at}");
    }
    check_order(&net.log, 0);
    assert!(net.all_operational());
    for (id, drive) in &net.drives {
        assert_eq!(
            drive.dictionary().read(0x1C0D, 1).unwrap(),
            [0; 4],
            "node {id} missed no PReq"
        );
    }
}

#[test]
fn a_lost_multiplexed_node_is_judged_by_its_own_polls() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), multiplexed(2, 2, &configuration)];
    let mut net = Net::with(MnConfig {
        multiplex_cycles: 4,
        ..mn_config(&nodes)
    });
    net.boot();
    net.lose_pres.insert(2, 3);
    net.cycles(12);
    assert_eq!(net.mn.statistics(1).pres_lost, 3);
    assert_eq!(
        net.mn.node_state(1),
        NodeState::Operational,
        "three in a row are ridden out"
    );
    net.cycles(4);
    net.lose_pres.insert(2, 4);
    net.cycles(16);
    assert_eq!(net.mn.statistics(1).pres_lost, 7);
    assert_eq!(net.mn.statistics(1).faults, 1);
}

#[test]
fn the_own_pres_carries_data_for_all_behind_the_polls() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::with(MnConfig {
        pres_mn_bytes: Some(3),
        pres_mn_version: 0x21,
        ..mn_config(&nodes)
    });
    net.mn.set_outputs_valid(true);
    net.mn.pres_mn[..3].copy_from_slice(&[7, 8, 9]);
    net.boot();
    net.log.clear();
    net.cycle();
    let order: Vec<(u8, u8)> = net.log.iter().map(|sent| (sent.octets[14], sent.source)).collect();
    assert_eq!(order[..5], [(1, 240), (3, 240), (4, 1), (4, 240), (5, 240)]);
    let Frame::Pres(pres) = net.log[3].frame() else {
        panic!()
    };
    assert_eq!(
        (pres.payload, pres.ready, pres.pdo_version),
        (&[7, 8, 9][..], true, 0x21)
    );
    assert_eq!(pres.nmt_state, NmtState::Operational);
    assert_eq!(net.log[3].octets.len(), 60);
    assert_eq!(net.log[3].octets[..6], multicast::PRES);
}

#[test]
fn the_prescaler_flag_toggles_every_so_many_cycles() {
    for (prescaler, toggles) in [(0, 0), (1, 12), (2, 6), (4, 3)] {
        let mut net = Net::with(MnConfig {
            prescaler,
            ..mn_config(&[])
        });
        net.until(300, |net| net.mn.nmt_state() == NmtState::Operational);
        net.cycles(12);
        net.log.clear();
        net.cycles(13);
        let flags: Vec<bool> = net
            .log
            .iter()
            .filter_map(|sent| match sent.frame() {
                Frame::Soc(soc) => Some(soc.prescaled_slot),
                _ => None,
            })
            .collect();
        assert_eq!(flags.len(), 13);
        let changes = flags.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert_eq!(changes, toggles, "prescaler {prescaler}");
    }
}

#[test]
fn the_first_preq_waits_after_the_soc() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::with(MnConfig {
        soc_preq_wait_ns: 30_000,
        ..mn_config(&nodes)
    });
    net.boot();
    net.log.clear();
    net.cycle();
    // The wire of this test needs 7 µs a frame.
    assert_eq!(net.log[1].now_ns - net.log[0].now_ns, 37 * US);
    assert!(matches!(net.log[1].frame(), Frame::Preq(_)));
}

#[test]
fn a_cycle_that_is_ready_is_moved_to_a_later_date_or_given_up_and_nothing_else_of_it_changes() {
    let configuration = [];
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::with(mn_config(&nodes));
    net.boot();
    net.cycles(3);
    let before = *net.mn.counters();
    let polled = net.mn.statistics(0).preq_sent;
    let soc = |net: &mut Net<'_>| match net.mn.poll(net.now_ns) {
        Step::Send(frame) => match Frame::parse(frame) {
            Ok(Frame::Soc(soc)) => soc,
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    };
    net.log.clear();
    let date_ns = net.now_ns;
    net.mn.start_cycle(date_ns, NetTime::default());
    let time = NetTime {
        seconds: 7,
        nanoseconds: 8,
    };
    net.mn.start_cycle(date_ns + 3 * CYCLE_NS, time);
    net.now_ns = date_ns + 3 * CYCLE_NS;
    let moved = soc(&mut net);
    assert_eq!(moved.net_time, time);
    let after = *net.mn.counters();
    assert_eq!(after.cycles, before.cycles + 1);
    assert_eq!(after.cycles_skipped, before.cycles_skipped + 3);
    assert_eq!(
        after.cycles_overrun, before.cycles_overrun,
        "no error: nothing of the cycle was on the wire"
    );
    net.now_ns += CYCLE_NS;
    net.mn.start_cycle(net.now_ns, NetTime::default());
    // The SoA of the cycle that was cut off goes out first.
    assert!(matches!(net.mn.poll(net.now_ns), Step::Send(frame) if frame[14] == 5));
    let next = soc(&mut net);
    assert_eq!(next.relative_time_us - moved.relative_time_us, CYCLE_NS / 1000);

    net.now_ns += CYCLE_NS;
    net.mn.start_cycle(net.now_ns, NetTime::default());
    net.mn.abandon_cycle();
    assert!(matches!(
        net.mn.poll(net.now_ns),
        Step::IsochronousDone | Step::Idle | Step::WaitUntil(_)
    ));
    assert_eq!(net.mn.counters().cycles, after.cycles + 1);
    assert_eq!(net.mn.statistics(0).preq_sent, polled, "no poll without its SoC");
}

#[test]
fn exceeded_cycles_are_counted_and_only_a_threshold_starts_the_network_again() {
    for (threshold, survives) in [(0, true), (40, false)] {
        let mut net = Net::with(MnConfig {
            cycle_threshold: threshold,
            ..mn_config(&[])
        });
        net.until(300, |net| net.mn.nmt_state() == NmtState::Operational);
        net.cycles(10);
        for round in 0..5 {
            // The next cycle begins before anything but the SoC of this one was sent; what it then begins with is its SoA.
            net.mn.start_cycle(net.now_ns, NetTime::default());
            if round > 0 {
                assert!(matches!(net.mn.poll(net.now_ns), Step::Send(frame) if frame[14] == 5));
            }
            assert!(matches!(net.mn.poll(net.now_ns), Step::Send(frame) if frame[14] == 1));
            net.now_ns += CYCLE_NS;
        }
        net.mn.start_cycle(net.now_ns, NetTime::default());
        let counters = net.mn.counters();
        assert_eq!((counters.cycles_overrun, counters.cycle_exceeded.cumulative), (5, 5));
        assert_eq!(net.mn.nmt_state() == NmtState::Operational, survives);
        let soa = matches!(net.mn.poll(net.now_ns), Step::Send(frame) if frame[14] == 5);
        let soc = matches!(net.mn.poll(net.now_ns), Step::Send(frame) if frame[14] == 1);
        assert_eq!((soa, soc), (survives, survives), "no SoC once the network starts again");
        let expected = if survives { 0 } else { 1 };
        while let Some(event) = net.mn.pop_event() {
            net.events.push(event);
        }
        assert_eq!(net.count_events(|event| *event == MnEvent::CycleThreshold), expected);
        net.until(600, |net| net.mn.nmt_state() == NmtState::Operational);
    }
}

#[test]
fn check_sum_errors_are_counted_against_their_threshold() {
    let mut net = Net::with(MnConfig {
        crc_threshold: 15,
        ..mn_config(&[])
    });
    net.until(300, |net| net.mn.nmt_state() == NmtState::Operational);
    net.mn.crc_error();
    net.cycles(8);
    net.mn.crc_error();
    assert_eq!(net.mn.nmt_state(), NmtState::Operational, "far apart");
    assert_eq!(
        net.mn.counters().crc_errors,
        Threshold {
            cumulative: 2,
            count: 8
        }
    );
    net.mn.crc_error();
    assert_eq!(net.mn.nmt_state(), NmtState::PreOperational1);
    net.until(600, |net| net.mn.nmt_state() == NmtState::Operational);
}

#[test]
fn ways_to_exchange_data_that_exclude_each_other_are_refused() {
    let text = |node: NodeConfig<'_>, multiplex_cycles| {
        let nodes = [node];
        let config = MnConfig {
            multiplex_cycles,
            ..mn_config(&nodes)
        };
        std::string::ToString::to_string(&Mn::<NODES>::new(config).expect_err("must be refused"))
    };
    assert_eq!(
        text(multiplexed(5, 4, &[]), 3),
        "node 5: multiplexed cycle 4: expected 1..=3 for a multiplexed node and 0 for another"
    );
    assert!(text(multiplexed(5, 0, &[]), 3).contains("multiplexed cycle 0"));
    let mut both = multiplexed(5, 1, &[]);
    both.assignment.chained = true;
    assert!(text(both, 3).contains("exclude each other"));
    let mut chained = node_config(5, &[]);
    chained.assignment.chained = true;
    assert!(text(chained, 0).contains("needs a PRes of the managing node"));
}

#[test]
fn scattered_losses_reach_a_threshold_and_a_threshold_of_zero_never_does() {
    let configuration = configuration();
    for (threshold, faults) in [(0, 0), (15, 1)] {
        let nodes = [NodeConfig {
            pres_threshold: threshold,
            ..node_config(1, &configuration)
        }];
        let mut net = Net::new(&nodes);
        net.boot();
        net.lose_pres.insert(1, 1);
        net.cycles(2);
        assert_eq!(net.mn.statistics(0).faults, 0);
        net.lose_pres.insert(1, 1);
        net.cycles(1);
        assert_eq!(net.mn.statistics(0).faults, faults, "8 - 1 + 8 = 15");
        assert_eq!(net.mn.statistics(0).loss_of_pres.cumulative, 2);
    }
}

#[test]
fn data_of_another_main_version_are_never_used() {
    let configuration = configuration();
    // The drives of these tests send version 0.
    for (version, fresh) in [(0x00, true), (0x0F, true), (0x10, false)] {
        let nodes = [NodeConfig {
            pres_version: version,
            ..node_config(1, &configuration)
        }];
        let mut net = Net::new(&nodes);
        net.boot();
        net.cycles(3);
        assert_eq!(net.mn.input(0).fresh, fresh, "version {version:#x}");
        assert_eq!(net.mn.statistics(0).pres_version > 0, !fresh);
        let reported = net.count_events(|event| {
            matches!(
                event,
                MnEvent::MappingVersion {
                    expected: 0x10,
                    got: 0,
                    ..
                }
            )
        });
        assert_eq!(reported, usize::from(!fresh), "once");
    }
}

#[test]
fn an_ordinary_ethernet_station_listens_and_then_sends_nothing() {
    let nodes = [node_config(1, &[])];
    let mut net = Net::with(MnConfig {
        startup: StartUp {
            basic_ethernet: true,
            ..StartUp::default()
        },
        ..mn_config(&nodes)
    });
    net.cycles(15);
    assert_eq!(net.mn.nmt_state(), NmtState::NotActive);
    net.cycles(200);
    assert_eq!(net.mn.nmt_state(), NmtState::BasicEthernet);
    assert!(net.log.is_empty());
    net.mn.shut_down();
    assert!(net.mn.is_shut_down());
}

#[test]
fn a_frame_of_the_application_goes_out_in_a_slot_of_our_own() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    net.cycles(60);
    net.log.clear();
    let mut frame = [0; 60];
    frame[12..14].copy_from_slice(&[0x08, 0x06]);
    for number in 0..2 {
        frame[20] = number;
        net.mn.send_ethernet(&frame).unwrap();
    }
    net.cycles(4);
    let sent: Vec<usize> = (0..net.log.len())
        .filter(|at| net.log[*at].octets[12] == 0x08)
        .collect();
    assert_eq!(sent.len(), 2);
    for (number, at) in sent.into_iter().enumerate() {
        assert_eq!(usize::from(net.log[at].octets[20]), number);
        let invited = Soa::new(NmtState::Operational, RequestedService::UnspecifiedInvite, 240);
        assert_eq!(net.log[at - 1].frame(), Frame::Soa(invited));
    }
    assert!(net.all_operational());
}

#[test]
fn a_round_may_be_as_long_as_its_octet_counts() {
    let configuration = configuration();
    let nodes = [NodeConfig {
        assignment: Assignment {
            multiplexed: true,
            ..Assignment::default()
        },
        multiplex_cycle: 255,
        ..node_config(1, &configuration)
    }];
    let mut net = Net::with(MnConfig {
        multiplex_cycles: 255,
        ..mn_config(&nodes)
    });
    net.until(4000, |net| net.mn.nmt_state() == NmtState::PreOperational2);
    net.until(1000, |net| net.mn.statistics(0).preq_sent == 1);
    let apart = net.until(1000, |net| net.mn.statistics(0).preq_sent == 2);
    assert_eq!(apart, 255);
}

#[test]
fn what_came_in_a_cycle_that_ended_the_network_is_not_fresh_in_the_next() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::with(MnConfig {
        cycle_threshold: 8,
        ..mn_config(&nodes)
    });
    net.boot();
    net.mn.start_cycle(net.now_ns, NetTime::default());
    while let Step::Send(frame) = net.mn.poll(net.now_ns) {
        let frame = frame.to_vec();
        net.transmit(frame);
    }
    assert!(net.deliver(net.now_ns + CYCLE_NS), "its PRes");
    assert!(net.mn.input(0).fresh);
    // The caller comes back too late for the rest of the cycle.
    net.now_ns += CYCLE_NS;
    net.mn.start_cycle(net.now_ns, NetTime::default());
    assert_eq!(net.mn.nmt_state(), NmtState::PreOperational1);
    assert!(!net.mn.input(0).fresh);
}

/// The caller's thread may be kept from running at any place of a cycle, for any time.
#[test]
fn between_two_socs_there_is_always_a_soa_wherever_the_caller_stalls() {
    let configuration = configuration();
    let nodes = [1, 2].map(|id| node_config(id, &configuration));
    let mut net = Net::new(&nodes);
    net.boot();
    let mut cycle_ns = net.now_ns;
    for polls in 0..14 {
        for stall_ns in (0..2_500_000).step_by(83_000) {
            net.log.clear();
            net.mn.start_cycle(cycle_ns, NetTime::default());
            net.now_ns = cycle_ns;
            for _ in 0..polls {
                if let Step::Send(frame) = net.mn.poll(net.now_ns) {
                    let frame = frame.to_vec();
                    net.transmit(frame);
                }
                while net.deliver(net.now_ns) {}
            }
            net.now_ns += stall_ns;
            // What is due is sent until the date of the next cycle that can be kept.
            let next_ns = cycle_ns + (net.now_ns - cycle_ns).div_ceil(CYCLE_NS).max(1) * CYCLE_NS;
            for _ in 0..40 {
                if net.now_ns >= next_ns {
                    break;
                }
                match net.mn.poll(net.now_ns) {
                    Step::Send(frame) => {
                        let frame = frame.to_vec();
                        net.transmit(frame);
                    }
                    Step::WaitUntil(until_ns) => {
                        if !net.deliver(until_ns.min(next_ns)) {
                            net.now_ns = until_ns.min(next_ns).max(net.now_ns);
                        }
                    }
                    Step::IsochronousDone => {}
                    Step::Idle => break,
                }
            }
            net.coming.clear();
            cycle_ns = next_ns.max(net.now_ns);
            net.mn.start_cycle(cycle_ns, NetTime::default());
            net.now_ns = cycle_ns;
            for _ in 0..3 {
                if let Step::Send(frame) = net.mn.poll(net.now_ns) {
                    let frame = frame.to_vec();
                    net.transmit(frame);
                }
            }
            let kinds: Vec<_> = net
                .log
                .iter()
                .map(|sent| sent.octets[14])
                .filter(|kind| matches!(kind, 1 | 5))
                .collect();
            let place = std::format!("{polls} polls, then a stall of {stall_ns} ns: {kinds:x?}");
            for pair in kinds.windows(2) {
                assert_ne!(pair, [1, 1], "{place}");
                assert_ne!(pair, [5, 5], "{place}");
            }
            // Back to even cycles.
            net.coming.clear();
            cycle_ns += CYCLE_NS;
            net.now_ns = cycle_ns;
            net.cycles(3);
            cycle_ns = net.now_ns;
        }
    }
    assert_eq!(net.mn.nmt_state(), NmtState::Operational);
}
