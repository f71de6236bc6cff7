//! PRes chaining with controlled nodes of this crate.

use super::*;

/// Process data of a chained drive come in our PRes: the same mapping, from node 240, `offset` octets further on.
fn chained_configuration(offset: u64) -> Vec<u8> {
    let mut octets = [0; 400];
    let mut writer = CdcWriter::new(&mut octets).unwrap();
    let bits = offset * 8;
    for (index, sub, raw) in [
        (0x1600, 1, 0x0020_0000_0000_607A_u64 + (bits << 32)),
        (0x1600, 2, 0x0010_0020_0000_6040 + (bits << 32)),
        (0x1A00, 1, 0x0020_0000_0000_6064),
        (0x1A00, 2, 0x0010_0020_0000_6041),
    ] {
        writer.push(index, sub, &raw.to_le_bytes()).unwrap();
    }
    writer.push(0x1400, 1, &[240]).unwrap();
    writer.push(0x1600, 0, &[2]).unwrap();
    writer.push(0x1A00, 0, &[2]).unwrap();
    writer.push(0x1006, 0, &1000_u32.to_le_bytes()).unwrap();
    writer.finish().to_vec()
}

fn chained(id: u8, offset: u16, configuration: &[u8]) -> NodeConfig<'_> {
    NodeConfig {
        assignment: Assignment {
            chained: true,
            ..Assignment::default()
        },
        pres_mn_offset: offset,
        pres_timeout_ns: 50_000,
        ..node_config(id, configuration)
    }
}

fn config<'a>(nodes: &'a [NodeConfig<'a>]) -> MnConfig<'a> {
    MnConfig {
        pres_mn_bytes: Some(12),
        ..mn_config(nodes)
    }
}

/// Frames of one cycle without SoC: (message type, source, time since the frame before in ns).
fn one_cycle(net: &mut Net<'_>) -> Vec<(u8, u8, u64)> {
    net.log.clear();
    net.cycle();
    let mut log = net.log.clone();
    log.sort_by_key(|sent| sent.now_ns);
    log.windows(2)
        .map(|pair| {
            let [before, sent] = pair else { unreachable!() };
            (sent.octets[14], sent.source, sent.now_ns - before.now_ns)
        })
        .collect()
}

#[test]
fn chained_nodes_are_set_up_and_send_one_behind_the_other_before_the_polls() {
    let configurations = [chained_configuration(0), chained_configuration(6), configuration()];
    let nodes = [
        chained(1, 0, &configurations[0]),
        node_config(2, &configurations[2]),
        chained(3, 6, &configurations[1]),
    ];
    let mut net = Net::with(config(&nodes));
    net.mn.set_outputs_valid(true);
    net.mn.output_mut(0).copy_from_slice(&[1, 2, 3, 4, 5, 6]);
    net.mn.output_mut(2).copy_from_slice(&[7, 8, 9, 10, 11, 12]);
    net.boot();
    net.cycles(60);
    for (id, position) in [(1, [1_u8, 2, 3, 4]), (3, [7, 8, 9, 10])] {
        assert!(net.drives[&id].is_chained());
        assert_eq!(
            net.drives[&id].dictionary().read(0x607A, 0).unwrap(),
            position,
            "node {id}"
        );
    }
    assert!(!net.drives[&2].is_chained());
    let cycle = one_cycle(&mut net);
    let order: Vec<(u8, u8)> = cycle.iter().map(|(message, source, _)| (*message, *source)).collect();
    assert_eq!(order[..6], [(4, 240), (4, 1), (4, 3), (3, 240), (4, 2), (5, 240)]);
    // The first after its latency of 20 µs, the second when the 60 octets of the first (6720 ns) and the guard are through.
    assert_eq!(cycle[1].2, ANSWER_NS + 7 * US);
    assert_eq!(cycle[2].2, 6_720 + 1_000);
    for node in 0..3 {
        assert!(net.mn.input(node).fresh, "position {node}");
        assert_eq!(net.mn.statistics(node).pres_lost, 0);
    }
    let before = net.mn.statistics(0).preq_sent;
    net.cycles(10);
    assert_eq!(net.mn.statistics(0).preq_sent - before, 10);
    check_order(&net.log, 0);
}

#[test]
fn a_lost_chained_pres_is_counted_and_a_lost_node_comes_back() {
    let configuration = chained_configuration(0);
    let nodes = [chained(1, 0, &configuration)];
    let mut net = Net::with(config(&nodes));
    net.boot();
    net.cycles(10);
    net.lose_pres.insert(1, 3);
    net.cycles(3);
    assert_eq!(net.mn.statistics(0).pres_lost, 3);
    assert_eq!(net.mn.input(0).lost_in_row, 3);
    assert_eq!(net.mn.node_state(0), NodeState::Operational, "ridden out");
    net.cycle();
    assert!(net.mn.input(0).fresh);
    net.lose_pres.insert(1, 4);
    net.cycles(5);
    assert_eq!(net.mn.node_state(0), NodeState::Faulted);
    assert_eq!(net.mn.nmt_state(), NmtState::Operational, "the network goes on");
    let cycles = net.boot();
    assert!(cycles < 500, "{cycles} cycles");
    assert!(net.drives[&1].is_chained());
}

#[test]
fn a_node_that_never_answers_a_sync_request_is_given_up_and_tried_again() {
    let configuration = chained_configuration(0);
    let nodes = [chained(1, 0, &configuration)];
    let mut net = Net::with(config(&nodes));
    net.refuse_sync = true;
    net.cycles(1500);
    assert!(net.mn.statistics(0).faults >= 1);
    assert_ne!(net.mn.nmt_state(), NmtState::Operational);
    net.refuse_sync = false;
    net.boot();
}

#[test]
fn a_latency_that_does_not_fit_the_cycle_costs_the_node_and_not_the_network() {
    let configurations = [chained_configuration(0), configuration()];
    let nodes = [chained(1, 0, &configurations[0]), node_config(2, &configurations[1])];
    let mut net = Net::with(config(&nodes));
    // The last would be over within the cycle, but leave no time for the poll and the asynchronous slot.
    for latency_ns in [u32::MAX, CYCLE_NS as u32, 800_000] {
        let handle = net.drives[&1].dictionary().find(0x1F98, 3).unwrap();
        let drive = net.drives.get_mut(&1).unwrap();
        drive
            .dictionary_mut()
            .set_default(handle, &latency_ns.to_le_bytes())
            .unwrap();
        let (overruns, faults) = (net.mn.counters().cycles_overrun, net.mn.statistics(0).faults);
        net.cycles(1500);
        assert!(net.mn.statistics(0).faults > faults, "{latency_ns} ns");
        assert_eq!(net.mn.counters().cycles_overrun, overruns, "{latency_ns} ns");
        assert_eq!(net.mn.input(1).lost_in_row, 0);
    }
}

#[test]
fn an_unasked_sync_response_of_a_node_that_was_not_found_does_nothing() {
    let configuration = chained_configuration(0);
    let nodes = [chained(1, 0, &configuration)];
    let mut net = Net::with(config(&nodes));
    net.dead.push(1);
    net.cycles(100);
    let answer = SyncResponse {
        mode_set: true,
        pres_time_first_ns: 20_000,
        latency_ns: 20_000,
        ..SyncResponse::default()
    };
    let header = Header {
        destination: multicast::ASND,
        source: [2, 0, 0, 0, 0, 1],
        destination_node: 240,
        source_node: 1,
    };
    let before = net.mn.counters().unexpected;
    net.hear(header, &Frame::Asnd(Asnd::SyncResponse(answer)));
    net.hear(header, &Frame::Asnd(Asnd::SyncResponse(answer)));
    assert!(net.mn.counters().unexpected >= before + 2);
    net.dead.clear();
    net.boot();
    assert_eq!(net.mn.statistics(0).faults, 0);
}
