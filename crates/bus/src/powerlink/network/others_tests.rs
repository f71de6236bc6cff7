//! What nodes are told of others: of payloads that they read, and of polls that they are not to wait for.

use super::*;

/// A network of three nodes; the first has 40 octets of outputs and of inputs.
fn demo() -> Config {
    let text = include_str!("../../../../../configs/mill3-demo.toml");
    let mut config = config::parse(text, std::path::Path::new("m.toml")).unwrap();
    let objects = |index| (1..=10).map(move |sub| Mapped { index, sub, bits: 32 }).collect();
    config.bus.nodes[0].outputs = objects(0x2100);
    config.bus.nodes[0].inputs = objects(0x2200);
    config
}

/// Values of an object in the order of its writes; little endian.
fn values(plan: &NodePlan, index: u16, sub: u8) -> Vec<u64> {
    let writes = plan
        .writes
        .iter()
        .filter(|write| (write.index, write.sub) == (index, sub));
    let value = |octets: &[u8]| {
        octets
            .iter()
            .rev()
            .fold(0, |value, octet| (value << 8) | u64::from(*octet))
    };
    writes.map(|write| value(&write.value)).collect()
}

fn position(plan: &NodePlan, index: u16, sub: u8) -> usize {
    let is = |write: &ConfigurationWrite| (write.index, write.sub) == (index, sub);
    plan.writes.iter().position(is).expect("is written")
}

#[test]
fn payloads_beyond_36_octets_get_their_limits_between_the_counts() {
    let plans = plan(&demo());
    let wide = &plans[0];
    assert_eq!((values(wide, 0x1F98, 4), values(wide, 0x1F98, 5)), (vec![40], vec![40]));
    assert_eq!(
        (values(wide, 0x1600, 0), values(wide, 0x1A00, 0)),
        (vec![0, 10], vec![0, 10])
    );
    assert!(position(wide, 0x1600, 0) < position(wide, 0x1F98, 4));
    assert!(position(wide, 0x1F98, 4) < position(wide, 0x1600, 1));
    let none = Vec::new();
    assert_eq!(
        (values(&plans[1], 0x1F98, 4), values(&plans[1], 0x1F98, 5)),
        (none.clone(), none)
    );
}

#[test]
fn a_node_that_reads_another_is_told_of_it_and_of_its_payload() {
    let mut config = demo();
    let source = config.bus.nodes[0].id;
    config.bus.nodes[1].cross = vec![config::Cross {
        from: 0,
        read: config.bus.nodes[0].inputs[9],
        into: Mapped {
            index: 0x2300,
            sub: 1,
            bits: 32,
        },
    }];
    let plans = plan(&config);
    let reader = &plans[1];
    assert_eq!(values(reader, 0x1F81, source), [3]);
    assert_eq!(values(reader, 0x1F8D, source), [40]);
    assert_eq!(values(reader, 0x1401, 1), [u64::from(source)]);
    // 32 bits at bit 288, the last of the 40 octets.
    assert_eq!(values(reader, 0x1601, 1), [0x0020_0120_0001_2300]);
    assert!(position(reader, 0x1F8D, source) < position(reader, 0x1601, 1));
    assert!(values(&plans[0], 0x1F8D, source).is_empty());
}

#[test]
fn chained_nodes_are_told_of_the_managing_nodes_own_payload() {
    let mut config = demo();
    for node in &mut config.bus.nodes {
        node.exchange = Exchange::Chained;
    }
    let whole = config
        .bus
        .nodes
        .iter()
        .map(|node| u64::from(octets(&node.outputs)))
        .sum::<u64>();
    assert!(whole > 40);
    for plan in plan(&config) {
        assert_eq!(values(&plan, 0x1400, 1), [240]);
        assert_eq!(values(&plan, 0x1F81, 240), [0x1001]);
        assert_eq!(values(&plan, 0x1F8D, 240), [whole]);
        assert!(values(&plan, 0x1F98, 4).is_empty());
    }
}

#[test]
fn a_node_without_polls_does_not_wait_for_them() {
    let mut config = demo();
    let node = &mut config.bus.nodes[1];
    node.exchange = Exchange::AsyncOnly;
    (node.outputs, node.inputs) = (Vec::new(), Vec::new());
    let plans = plan(&config);
    assert_eq!(values(&plans[1], 0x1C0D, 3), [0]);
    assert_ne!(values(&plans[0], 0x1C0D, 3), [0]);
    assert!(values(&plans[1], 0x1600, 0).is_empty());
}

#[test]
fn all_watches_over_the_cycle_follow_the_socs_that_may_be_lost() {
    let mut config = demo();
    for (lost_max, thresholds) in [(0, [8, 32]), (3, [24, 32]), (100, [800, 800])] {
        config.bus.soc_lost_max = Some(lost_max);
        config.bus.pres_lost_max = 3;
        let plan = &plan(&config)[0];
        let cycle_ns = u64::from(config.cycle_us) * 1000;
        assert_eq!(values(plan, 0x1C14, 0), [u64::from(lost_max) * cycle_ns]);
        assert_eq!(
            (values(plan, 0x1C0B, 3), values(plan, 0x1C0D, 3)),
            (vec![thresholds[0]], vec![thresholds[1]])
        );
    }
    // 0 switches them off.
    config.bus.soc_lost_max = None;
    let plan = &plan(&config)[0];
    assert_eq!([0x1C0B, 0x1C0D].map(|counter| values(plan, counter, 3)), [[0], [0]]);
    assert_eq!(values(plan, 0x1C14, 0), [u64::from(u32::MAX)]);
}
