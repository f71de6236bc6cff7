//! What goes wrong on a wire, and that the network goes on.

use super::*;
use crate::wire::{ErrorEntry, Requests};

fn running<'a>(nodes: &'a [NodeConfig<'a>]) -> Net<'a> {
    let mut net = Net::new(nodes);
    net.boot();
    net.mn.set_outputs_valid(true);
    net.cycles(5);
    net.events.clear();
    net.log.clear();
    net
}

#[test]
fn lost_pres_are_ridden_out_with_the_last_value() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = running(&nodes);
    {
        let drive = net.drives.get_mut(&1).unwrap();
        let position = drive.dictionary().key::<i32>(0x6064, 0).unwrap();
        drive.dictionary_mut().set(position, 77);
    }
    net.cycles(2);
    net.lose_pres.insert(1, 3);
    for lost in 1..=3 {
        net.cycle();
        let input = net.mn.input(0);
        assert_eq!((input.fresh, input.lost_in_row, input.data[0]), (false, lost, 77));
        assert!(net.mn.input(1).fresh, "the other node is polled all the same");
    }
    net.cycle();
    let input = net.mn.input(0);
    assert_eq!((input.fresh, input.lost_in_row), (true, 0));
    let statistics = net.mn.statistics(0);
    assert_eq!(
        (statistics.pres_lost, statistics.lost_in_row_max, statistics.faults),
        (3, 3, 0)
    );
    assert_eq!(statistics.preq_sent, statistics.pres_received + 3);
    assert_eq!(net.mn.node_state(0), NodeState::Operational);
    assert!(net.events.is_empty(), "{:?}", net.events);
    check_order(&net.log, 3);
}

#[test]
fn one_more_and_the_node_is_lost_and_booted_again_while_the_others_go_on() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = running(&nodes);
    net.lose_pres.insert(1, 4);
    net.cycles(4);
    assert_eq!(net.mn.node_state(0), NodeState::Faulted);
    assert_eq!(net.mn.input(0).lost_in_row, 4);
    assert_eq!(
        net.count_events(|event| *event == MnEvent::Lost { node: 1, in_row: 4 }),
        1
    );
    net.until(500, Net::all_operational);
    assert_eq!(net.mn.nmt_state(), NmtState::Operational);
    assert_eq!(net.mn.statistics(0).boots, 2);
    assert_eq!((net.mn.statistics(1).pres_lost, net.mn.statistics(1).boots), (0, 1));
    let commands = net.commands();
    let expected = [
        (1, NmtCommand::ResetNode),
        (1, NmtCommand::ResetConfiguration),
        (1, NmtCommand::ResetConfiguration),
        (1, NmtCommand::EnableReadyToOperate),
        (1, NmtCommand::StartNode),
    ];
    assert_eq!(commands, expected);
    let reset = net
        .log
        .iter()
        .find(|sent| matches!(sent.frame(), Frame::Asnd(_)))
        .unwrap();
    assert_eq!(reset.octets[18..22], [0x28, 0, 0x43, 0x82], "the reason goes along");
    check_order(&net.log, 4);
}

#[test]
fn a_dead_node_does_not_stop_the_others_and_returns() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = running(&nodes);
    net.dead = std::vec![2];
    net.cycles(1000);
    assert_eq!(net.mn.node_state(1), NodeState::Faulted);
    assert_eq!(
        net.count_events(|event| matches!(event, MnEvent::Lost { node: 2, .. })),
        1
    );
    assert_eq!(net.mn.statistics(0).pres_lost, 0);
    check_order(&net.log, 4);
    // Power comes back: a new device.
    net.drives.insert(2, drive(2, net.now_ns));
    net.dead.clear();
    net.until(500, Net::all_operational);
    assert_eq!(net.mn.statistics(1).boots, 2);
}

#[test]
fn a_node_that_leaves_operational_by_itself_is_booted_again() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = running(&nodes);
    // A command of somebody else: the node is stopped, and does not answer polls any more.
    let stop = NmtCommandFrame::plain(NmtCommand::EnterPreOperational2);
    let mut octets = [0; FRAME_LEN_MAX];
    let header = Header {
        destination_node: 1,
        ..Header::multicast(multicast::ASND, MN_MAC, 240)
    };
    let len = Asnd::NmtCommand(stop).emit(&header, &mut octets).unwrap();
    net.drives
        .get_mut(&1)
        .unwrap()
        .receive(net.now_ns, &octets[..len], &mut [0; FRAME_LEN_MAX]);
    net.cycles(5);
    assert_eq!(
        net.mn.node_state(0),
        NodeState::Operational,
        "a few cycles are tolerated"
    );
    net.cycles(1);
    let wrong = MnEvent::WrongState {
        node: 1,
        expected: NmtState::Operational,
        got: NmtState::PreOperational2,
    };
    assert_eq!(net.count_events(|event| *event == wrong), 1);
    net.until(500, Net::all_operational);
}

#[test]
fn errors_a_node_signals_are_fetched_once() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = running(&nodes);
    // Until the hand-shake that starts error signalling is over.
    net.cycles(50);
    for code in [0x1234, 0x5678] {
        net.drives
            .get_mut(&1)
            .unwrap()
            .report_error(402, code, [1, 2, 3, 4, 5, 6, 7, 8]);
        net.cycles(20);
        let reported = |event: &MnEvent| {
            matches!(event, MnEvent::ErrorEntry { node: 1, entry: ErrorEntry { code: got, info, .. } }
                if *got == code && *info == [1, 2, 3, 4, 5, 6, 7, 8])
        };
        assert_eq!(net.count_events(reported), 1, "{code:#x}: {:?}", net.events);
    }
    check_order(&net.log, 0);
}

#[test]
fn lost_sdo_frames_and_commands_only_cost_time() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    // The node is deaf for a while again and again, shorter than what makes it lost.
    for round in 0..400 {
        net.dead = if round % 8 == 7 { std::vec![1] } else { Vec::new() };
        net.cycle();
        if net.all_operational() {
            break;
        }
    }
    assert!(
        net.all_operational(),
        "{:?} {:?}",
        net.mn.nodes.get(0).unwrap().stage,
        net.events
    );
    assert_eq!(net.mn.statistics(0).objects_written, 9);
    assert_eq!(net.mn.statistics(0).faults, 0);
}

#[test]
fn another_managing_node_keeps_this_one_silent() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    let header = Header::multicast(multicast::SOC, FOREIGN_MAC, 240);
    for _ in 0..100 {
        net.cycles(1);
        net.hear(header, &Frame::Soc(Soc::default()));
    }
    net.cycles(1);
    assert_eq!(net.mn.nmt_state(), NmtState::NotActive);
    assert!(net.log.is_empty());
    assert_eq!(
        net.count_events(|event| *event == MnEvent::ForeignMn(FOREIGN)),
        1,
        "not once a frame"
    );
    assert_eq!(net.mn.counters().foreign_mn_frames, 100);
    // It goes away.
    net.boot();
}

/// Answers that nobody asked for, of nodes that were polled until a moment ago: the network starts as it would without them.
#[test]
fn stray_answers_do_not_delay_the_start() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut quiet = Net::new(&nodes);
    let mut net = Net::new(&nodes);
    for cycle in 0..100 {
        quiet.cycles(1);
        net.cycles(1);
        assert_eq!(net.mn.nmt_state(), quiet.mn.nmt_state(), "cycle {cycle}");
        let Some(id) = [1, 2, 1, 2].get(cycle) else {
            continue;
        };
        let stray = Pres {
            nmt_state: NmtState::Operational,
            multiplexed: false,
            exception_new: false,
            ready: true,
            requests: Requests::default(),
            pdo_version: 0,
            payload: &[9; 6],
        };
        net.hear(
            Header::multicast(multicast::PRES, FOREIGN_MAC, *id),
            &Frame::Pres(stray),
        );
    }
    assert_eq!(net.count_events(|event| matches!(event, MnEvent::ForeignMn(_))), 0);
    assert_eq!(net.mn.counters().foreign_mn_frames, 0);
    net.boot();
}

#[test]
fn another_managing_node_on_a_running_network_is_reported() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = running(&nodes);
    let header = Header::multicast(multicast::SOA, FOREIGN_MAC, 240);
    net.hear(
        header,
        &Frame::Soa(Soa::new(NmtState::PreOperational1, RequestedService::NoService, 0)),
    );
    net.cycles(3);
    assert_eq!(net.events, [MnEvent::ForeignMn(FOREIGN)]);
    assert_eq!(net.mn.nmt_state(), NmtState::Operational);
}

#[test]
fn a_pres_that_comes_late_is_counted_and_thrown_away() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = running(&nodes);
    net.lose_pres.insert(1, 1);
    net.cycle();
    let late = Pres {
        nmt_state: NmtState::Operational,
        multiplexed: false,
        exception_new: false,
        ready: true,
        requests: Requests::default(),
        pdo_version: 0,
        payload: &[9; 6],
    };
    net.hear(
        Header::multicast(multicast::PRES, [2, 0, 0, 0, 0, 1], 1),
        &Frame::Pres(late),
    );
    assert_eq!(net.mn.statistics(0).pres_late, 1);
    assert_ne!(net.mn.input(0).data, [9; 6]);
    assert!(!net.mn.input(0).fresh);
    // Of a node that is not ours: counted, nothing else.
    net.hear(
        Header::multicast(multicast::PRES, [2, 0, 0, 0, 0, 9], 99),
        &Frame::Pres(late),
    );
    assert_eq!(net.mn.counters().unknown_node, 1);
}

#[test]
fn a_node_can_be_reset() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = running(&nodes);
    net.reset_node(0);
    assert_eq!(net.mn.node_state(0), NodeState::Absent);
    net.until(500, Net::all_operational);
    assert_eq!((net.mn.statistics(0).boots, net.mn.statistics(0).faults), (2, 0));
    assert_eq!(net.mn.statistics(1).boots, 1);
}

#[test]
fn a_late_cycle_is_counted_and_nothing_is_sent_twice() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = running(&nodes);
    net.cycle();
    let relative_time = |net: &Net<'_>| {
        net.log
            .iter()
            .rev()
            .find_map(|sent| match sent.frame() {
                Frame::Soc(soc) => Some(soc.relative_time_us),
                _ => None,
            })
            .unwrap()
    };
    let before_us = relative_time(&net);
    let cycles = net.mn.counters().cycles;
    // Two and a half cycles go by.
    net.now_ns += 2 * CYCLE_NS + 400 * US;
    net.log.clear();
    net.cycle();
    assert_eq!(net.mn.counters().cycles, cycles + 1);
    assert_eq!(net.mn.counters().cycles_skipped, 2);
    assert_eq!(relative_time(&net), before_us + 3000);
    assert_eq!(
        net.log
            .iter()
            .filter(|sent| matches!(sent.frame(), Frame::Soc(_)))
            .count(),
        1
    );
    assert_eq!(net.mn.nmt_state(), NmtState::Operational);
    // Half a cycle late is still this cycle.
    net.now_ns += 400 * US;
    net.cycle();
    assert_eq!(net.mn.counters().cycles_skipped, 2);
}

#[test]
fn a_cycle_cut_off_by_the_next_one_is_not_made_up_for() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration)];
    let mut net = running(&nodes);
    // The caller sends SoC and PReq, and then nothing happens until the next start.
    net.mn.start_cycle(net.now_ns, NetTime::default());
    assert!(matches!(net.mn.poll(net.now_ns), Step::Send(_)));
    assert!(matches!(net.mn.poll(net.now_ns), Step::Send(_)));
    let sent_ns = net.now_ns;
    assert_eq!(net.mn.poll(sent_ns), Step::WaitUntil(sent_ns + 100_000));
    assert_eq!(net.mn.outstanding(), Some((1, sent_ns + 100_000)));
    net.now_ns += CYCLE_NS;
    net.cycle();
    assert_eq!(net.mn.counters().cycles_overrun, 1);
    assert_eq!(net.mn.statistics(0).pres_lost, 1);
    assert_eq!(net.mn.outstanding(), None);
    let kinds: Vec<_> = net.log.iter().map(|sent| sent.octets[14]).collect();
    // Its SoA is not left out: nodes wait for one between two SoCs.
    assert_eq!(kinds[..5], [0x05, 0x01, 0x03, 0x04, 0x05]);
}

#[test]
fn events_nobody_takes_are_counted() {
    let mut events = Events::new();
    for node in 0..100 {
        events.push(MnEvent::Identified { node });
    }
    assert_eq!(events.dropped, 36);
    for node in 0..64 {
        assert_eq!(events.pop(), Some(MnEvent::Identified { node }));
    }
    assert_eq!(events.pop(), None);
    events.push(MnEvent::Missing { node: 7 });
    assert_eq!(events.pop(), Some(MnEvent::Missing { node: 7 }));
}
