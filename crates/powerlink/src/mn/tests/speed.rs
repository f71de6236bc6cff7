//! How long a boot takes on virtual time, without and with losses.

use super::*;
use std::println;

/// Boot times of a machine in use.
const PRODUCT: BootTimes = BootTimes {
    wait_not_active_us: 500_000,
    timeout_pre_op_1_us: 500_000,
    wait_pre_op_1_us: 200_000,
    timeout_pre_op_2_us: 5_000_000,
    timeout_ready_to_operate_us: 500_000,
    reset_pause_us: 150_000,
};

/// Concise DCF with this many writes for this cycle.
fn writes(count: u8, cycle_ms: u32) -> Vec<u8> {
    let mut mapping = configuration_anew();
    let cycle = [0x06, 0x10, 0, 4, 0, 0, 0];
    let at = mapping.windows(cycle.len()).position(|window| window == cycle).unwrap() + cycle.len();
    mapping[at..at + 4].copy_from_slice(&(cycle_ms * 1000).to_le_bytes());
    let mut octets = std::vec![count, 0, 0, 0];
    for _ in mapping[0]..count {
        octets.extend([0x60, 0x60, 0, 1, 0, 0, 0, 8]);
    }
    octets.extend(&mapping[4..]);
    octets
}

fn network<'a>(nodes: &'a [NodeConfig<'a>], cycle_ms: u32) -> Net<'a> {
    Net::with(MnConfig {
        cycle_ns: cycle_ms * MS as u32,
        boot: PRODUCT,
        ..mn_config(nodes)
    })
}

/// Runs until all nodes are OPERATIONAL; the virtual time that takes, in ms.
fn boot_ms(net: &mut Net<'_>) -> u64 {
    let start_ns = net.now_ns;
    net.until(20_000, Net::all_operational);
    (net.now_ns - start_ns) / MS
}

#[test]
fn three_nodes_with_sixteen_writes_each_at_10_ms() {
    let configuration = writes(16, 10);
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    let mut net = network(&nodes, 10);
    let took_ms = boot_ms(&mut net);
    println!("3 nodes with 16 writes each at 10 ms: {took_ms} ms");
    assert!(took_ms <= 1000, "{took_ms} ms");
    for node in 0..3 {
        assert_eq!(net.mn.statistics(node).objects_written, 16);
    }
    check_order(&net.log, 0);
}

#[test]
fn a_lost_node_is_back_at_1_ms() {
    let configuration = writes(17, 1);
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    let mut net = network(&nodes, 1);
    boot_ms(&mut net);
    net.lose_pres.insert(2, 4);
    net.until(10, |net| net.mn.node_state(1) == NodeState::Faulted);
    let took_ms = boot_ms(&mut net);
    println!("one node with 17 writes at 1 ms, from its loss on: {took_ms} ms");
    assert!(took_ms <= 100, "{took_ms} ms");
    assert_eq!(net.mn.statistics(1).objects_written, 34);
}

/// Boots with 1 % of the ASnd lost, one for each seed: the times in ms, sorted.
fn lossy_boots_ms(cycle_ms: u32, seeds: u64) -> Vec<u64> {
    let configuration = writes(16, cycle_ms);
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    let boots = (0..seeds).map(|seed| {
        let mut net = network(&nodes, cycle_ms);
        net.lose_asnd = Some((SplitMix64::new(seed), 0.01));
        let took_ms = boot_ms(&mut net);
        let faults: u64 = (0..3).map(|node| net.mn.statistics(node).faults).sum();
        assert_eq!(faults, 0, "seed {seed}: {:?}", net.events);
        took_ms
    });
    let mut boots: Vec<_> = boots.collect();
    boots.sort_unstable();
    boots
}

#[test]
fn one_lost_asnd_in_a_hundred_makes_no_boot_twice_as_long() {
    for cycle_ms in [1, 10] {
        let configuration = writes(16, cycle_ms);
        let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
        let clean_ms = boot_ms(&mut network(&nodes, cycle_ms));
        let boots = lossy_boots_ms(cycle_ms, 200);
        let (median_ms, longest_ms) = (boots[100], boots[199]);
        println!("cycle {cycle_ms} ms: clean {clean_ms} ms; 1 % lost: median {median_ms} ms, longest {longest_ms} ms");
        assert!(longest_ms <= 2 * clean_ms, "{boots:?}");
    }
}

/// The same for one node that comes back while the network runs: every lost frame costs cycles there.
#[test]
fn one_lost_asnd_in_a_hundred_while_a_node_comes_back() {
    let configuration = writes(17, 1);
    let nodes = [1, 2, 3].map(|id| node_config(id, &configuration));
    let mut boots = Vec::new();
    for seed in 0..200 {
        let mut net = network(&nodes, 1);
        net.boot();
        net.lose_asnd = Some((SplitMix64::new(seed), 0.01));
        net.lose_pres.insert(2, 4);
        net.until(10, |net| net.mn.node_state(1) == NodeState::Faulted);
        boots.push(boot_ms(&mut net));
    }
    boots.sort_unstable();
    let (median_ms, longest_ms) = (boots[100], boots[199]);
    println!("back in the network at 1 ms, 1 % lost: median {median_ms} ms, longest {longest_ms} ms");
    assert!(longest_ms <= 500, "{boots:?}");
}
