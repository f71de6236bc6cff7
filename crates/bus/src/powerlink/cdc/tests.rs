use super::*;
use crate::powerlink::managing_node::{mn_config, node_configs};
use crate::powerlink::network;
use obd::Objects;
use powerlink::mn::{Identity, Mn};
use proptest::prelude::*;
use std::path::Path;

const MAC: [u8; 6] = [2, 0, 0, 0, 0, 1];
/// Of a chained node: its outputs lie at octet 2 of the managing node's PRes, four of them.
const CHAINED_DCF: &[u8] = &[
    4, 0, 0, 0, //
    0x00, 0x14, 1, 1, 0, 0, 0, 240, //
    0x00, 0x14, 2, 1, 0, 0, 0, 0x30, //
    0x00, 0x16, 1, 8, 0, 0, 0, 0x00, 0x62, 1, 0, 16, 0, 32, 0, //
    0x00, 0x16, 0, 1, 0, 0, 0, 1,
];

/// Every kind of node.
fn nodes() -> Vec<NodeConfig<'static>> {
    let polled = NodeConfig {
        id: 1,
        identity: Identity {
            device_type: Some(0x0002_0192),
            serial: Some(7),
            ..Identity::default()
        },
        software: Some(Stamp { date: 15_000, time: 3 }),
        configuration_stamp: Some(Stamp { date: 15_001, time: 4 }),
        preq_version: 0x10,
        pres_version: 0x20,
        pres_threshold: 24,
        preq_bytes: 11,
        pres_bytes: 40,
        configuration: &[1, 0, 0, 0, 0x06, 0x10, 0, 4, 0, 0, 0, 0xE8, 0x03, 0, 0],
        ..NodeConfig::default()
    };
    let assignment = Assignment::default();
    vec![
        polled,
        NodeConfig {
            id: 5,
            assignment: Assignment {
                multiplexed: true,
                mandatory: false,
                ..assignment
            },
            multiplex_cycle: 2,
            pres_bytes: 1,
            ..NodeConfig::default()
        },
        NodeConfig {
            id: 9,
            assignment: Assignment {
                chained: true,
                ..assignment
            },
            pres_mn_offset: 2,
            preq_bytes: 4,
            preq_version: 0x30,
            pres_bytes: 3,
            configuration: CHAINED_DCF,
            ..NodeConfig::default()
        },
        NodeConfig {
            id: 200,
            assignment: Assignment {
                async_only: true,
                ..assignment
            },
            ..NodeConfig::default()
        },
    ]
}

fn whole<'a>(nodes: &'a [NodeConfig<'a>]) -> MnConfig<'a> {
    MnConfig {
        cycle_ns: 2_000_000,
        soc_preq_wait_ns: 1_000,
        async_slot_timeout_ns: 150_000,
        async_mtu: 1200,
        multiplex_cycles: 3,
        prescaler: 10,
        pres_mn_bytes: Some(6),
        pres_mn_version: 0x40,
        startup: StartUp {
            broadcast_start: true,
            ..StartUp::default()
        },
        crc_threshold: 15,
        cycle_threshold: 16,
        boot: BootTimes {
            wait_not_active_us: 1,
            timeout_pre_op_1_us: 2,
            ..BootTimes::default()
        },
        nodes,
        mac: MAC,
        ..MnConfig::default()
    }
}

fn writes(octets: &[u8]) -> Vec<CdcWrite<'_>> {
    CdcReader::new(octets).unwrap().map(|write| write.unwrap()).collect()
}

#[test]
fn nodes_come_first_and_last_and_everything_else_between() {
    let nodes = nodes();
    let octets = write(&whole(&nodes)).unwrap();
    // 81 1F sub, four octets, 00000007h: how every file of another tool begins, too.
    assert_eq!(octets[4..15], [0x81, 0x1F, 1, 4, 0, 0, 0, 7, 0, 0, 0]);
    let writes = writes(&octets);
    assert_eq!(octets[..4], (writes.len() as u32).to_le_bytes());
    let assigned = |write: &CdcWrite<'_>| {
        (
            write.index,
            write.sub,
            u32::from_le_bytes(write.value.try_into().unwrap()),
        )
    };
    let first: Vec<_> = writes[..4].iter().map(assigned).collect();
    assert_eq!(first, [1, 5, 9, 200].map(|id| (0x1F81, id, 7)));
    let last: Vec<_> = writes[writes.len() - 5..].iter().map(assigned).collect();
    let expected = [
        (240, 0x8000_1001),
        (1, 0x8000_000F),
        (5, 0x8000_0207),
        (9, 0x8000_400F),
        (200, 0x8000_010F),
    ];
    assert_eq!(last, expected.map(|(id, value)| (0x1F81, id, value)));
    let between = &writes[4..writes.len() - 5];
    assert!(between.iter().all(|write| write.index != 0x1F81));
    let configured = between.iter().filter(|write| write.index == 0x1F22);
    let configured: Vec<_> = configured.map(|write| (write.sub, write.value)).collect();
    assert_eq!(configured, [(1, nodes[0].configuration), (9, CHAINED_DCF)]);
}

#[test]
fn reading_back_gives_the_same_configuration() {
    let nodes = nodes();
    let config = whole(&nodes);
    let octets = write(&config).unwrap();
    let network = read(&octets).unwrap();
    assert_eq!(network.config(MAC), config);
    assert_eq!(network.others, []);
}

#[test]
fn the_demo_machine_comes_back_but_for_what_no_object_holds() {
    let text = include_str!("../../../../../configs/mill3-demo.toml");
    let config = config::parse(text, Path::new("m.toml")).unwrap();
    let plans = network::plan(&config);
    let nodes = node_configs(&config.bus, &plans);
    let config = mn_config(&config, &nodes, MAC);
    let octets = write(&config).unwrap();
    let network = read(&octets).unwrap();
    let read = network.config(MAC);
    let boot = BootTimes {
        reset_pause_us: config.boot.reset_pause_us,
        ..read.boot
    };
    assert_eq!(
        MnConfig {
            boot,
            pres_lost_max: config.pres_lost_max,
            ..read
        },
        config
    );
}

#[test]
fn another_managing_node_loses_a_node_after_as_many_polls_as_ours() {
    let text = include_str!("../../../../../configs/mill3-demo.toml");
    let machine = config::parse(text, Path::new("m.toml")).unwrap();
    let plans = network::plan(&machine);
    let mut nodes = node_configs(&machine.bus, &plans);
    nodes[1].pres_threshold = 24;
    let config = MnConfig {
        pres_lost_max: 20,
        ..mn_config(&machine, &nodes, MAC)
    };
    let octets = write_for_others(&config).unwrap();
    let thresholds = writes(&octets).into_iter().filter(|write| write.index == 0x1C09);
    let thresholds: Vec<_> = thresholds.map(|write| (write.sub, write.value[0])).collect();
    // 8 for each lost PRes, 21 of them.
    assert_eq!(thresholds, [(1, 168), (2, 24), (3, 168), (10, 168)]);
}

#[test]
fn every_value_is_the_one_that_the_managing_nodes_dictionary_shows() {
    let nodes = nodes();
    let config = whole(&nodes);
    let octets = write(&config).unwrap();
    let last: BTreeMap<_, _> = writes(&octets)
        .into_iter()
        .map(|write| ((write.index, write.sub), write.value))
        .collect();
    let mut mn = Box::new(Mn::<4>::new(config).unwrap());
    let mut objects = mn.objects(0);
    let mut value = [0; 1500];
    for ((index, sub), expected) in last {
        let length = objects.sdo_read(index, sub, &mut value);
        assert_eq!(
            length.map(|length| &value[..length]),
            Ok(expected),
            "0x{index:04X}:{sub}"
        );
    }
}

#[test]
fn what_our_managing_node_does_not_serve_is_told() {
    let file = |index, sub, value: &[u8]| {
        let mut file = File(Vec::new());
        file.0.push((index, sub, value.to_vec()));
        file.octets()
    };
    let error = |octets: &[u8]| read(octets).unwrap_err().to_string();
    assert_eq!(
        error(&file(0x1F80, 0, &[0, 0x40, 0, 0])),
        "1F80h/00h bit 14 (managing node redundancy) is not served"
    );
    assert_eq!(
        error(&file(0x1F81, 3, &[0x43, 0, 0, 0x80])),
        "1F81h/03h bit 6 (automatic update of the software) is not served"
    );
    assert_eq!(error(&file(0x1F98, 8, &[0; 4])), "0x1F98:8: expected 2 octets, got 4");
    assert_eq!(
        error(&[1, 0, 0, 0]),
        "offset 4: expected index, sub-index and size of a write of 7 octets, 0 are left"
    );
    let other = file(0x1E40, 2, &[1, 100, 168, 192]);
    assert_eq!(read(&other).unwrap().others, [(0x1E40, 2)]);
    assert_eq!(
        read(&[0, 0, 0, 0]).unwrap().config(MAC),
        MnConfig {
            mac: MAC,
            ..MnConfig::default()
        }
    );
}

#[test]
fn the_listing_shows_each_write_and_those_of_the_nodes_below() {
    let nodes = nodes();
    let octets = write(&whole(&nodes[..1])).unwrap();
    let text = listing(&octets).unwrap();
    let mut lines = text.lines();
    for expected in [
        "0x1F81:1   4 octets  0x00000007",
        "0x1006:0   4 octets  0x000007D0",
        "0x1F98:8   2 octets  0x04B0",
        "0x1A01:1   8 octets  0x000800000007A040",
        "0x1A01:11  8 octets  0x000800500011A040",
        "0x1A01:0   1 octets  0x0B",
        "0x1F22:1   15 octets, the configuration of node 1:",
        "    0x1006:0   4 octets  0x000003E8",
        "0x1F81:1   4 octets  0x8000000F",
    ] {
        assert!(
            lines.any(|line| line == expected),
            "no {expected:?}, in this order, in\n{text}"
        );
    }
    assert!(listing(&octets[..octets.len() - 1]).is_err());
}

proptest! {
    #[test]
    fn any_octets_and_every_truncation_are_read_or_refused(octets in prop::collection::vec(any::<u8>(), 0..200), at in 0usize..600) {
        let _ = (read(&octets), listing(&octets));
        let nodes = nodes();
        let good = write(&whole(&nodes)).unwrap();
        if at < good.len() {
            prop_assert!(read(&good[..at]).is_err());
            prop_assert!(listing(&good[..at]).is_err());
        }
    }

    #[test]
    fn a_changed_octet_never_panics(at in 0usize..2000, octet in any::<u8>()) {
        let nodes = nodes();
        let mut file = write(&whole(&nodes)).unwrap();
        let at = at % file.len();
        file[at] = octet;
        let _ = (read(&file).map(|network| network.config(MAC).cycle_ns), listing(&file));
    }
}

#[test]
fn process_data_are_mapped_octet_by_octet_and_each_octet_once() {
    let text = include_str!("../../../../../configs/mill3-demo.toml");
    let config = config::parse(text, Path::new("m.toml")).unwrap();
    let plans = network::plan(&config);
    let nodes = node_configs(&config.bus, &plans);
    let octets = write(&mn_config(&config, &nodes, MAC)).unwrap();
    let mut places = Vec::new();
    for (at, node) in nodes.iter().enumerate() {
        for (mapping, image, size) in [(0x1600, 0xA4C0, node.pres_bytes), (0x1A00, 0xA040, node.preq_bytes)] {
            let mapping = mapping + at as u16 + 1;
            let of_channel = writes(&octets).into_iter().filter(|write| write.index == mapping);
            let (counts, entries): (Vec<_>, Vec<_>) = of_channel.partition(|write| write.sub == 0);
            let counts: Vec<_> = counts.iter().map(|write| write.value[0]).collect();
            assert_eq!(counts, [0, size as u8], "off before, on after its entries");
            assert_eq!(entries.len(), usize::from(size));
            for (octet, write) in entries.iter().enumerate() {
                let entry = MappingEntry::from_u64(u64::from_le_bytes(write.value.try_into().unwrap()));
                assert_eq!(usize::from(write.sub), octet + 1);
                assert_eq!((entry.bit_offset, entry.bit_length), (8 * octet as u16, 8));
                assert!((image..image + 16).contains(&entry.index) && (1..=252).contains(&entry.sub));
                places.push((entry.index, entry.sub));
            }
        }
    }
    let all = places.len();
    places.sort_unstable();
    places.dedup();
    assert_eq!(
        (places.len(), all),
        (
            all,
            nodes
                .iter()
                .map(|node| usize::from(node.preq_bytes + node.pres_bytes))
                .sum()
        )
    );
}

#[test]
fn what_cannot_be_mapped_octet_by_octet_is_refused() {
    let long = |id, octets| NodeConfig {
        id,
        pres_bytes: octets,
        ..NodeConfig::default()
    };
    let refused = |nodes: &[NodeConfig<'_>]| {
        let nodes = MnConfig {
            nodes,
            ..MnConfig::default()
        };
        write(&nodes).unwrap_err().to_string()
    };
    assert_eq!(
        refused(&[long(3, 255)]),
        "node 3: 255 octets of process data, at most 254 can be mapped octet by octet"
    );
    let many: Vec<_> = (1..=16).map(|id| long(id, 253)).collect();
    assert_eq!(
        refused(&many),
        "4048 octets of process data in one direction, the process image holds 4032"
    );
}

/// Date and time of each node's configuration stand in the file twice: what the node is told, and what it is expected to show.
#[test]
fn an_unchanged_node_is_known_by_its_stamp() {
    let text = include_str!("../../../../../configs/mill3-demo.toml");
    let stamps = |text: &str| {
        let config = config::parse(text, Path::new("m.toml")).unwrap();
        let plans = network::plan(&config);
        let nodes = node_configs(&config.bus, &plans);
        let octets = write(&mn_config(&config, &nodes, MAC)).unwrap();
        let file: BTreeMap<_, _> = writes(&octets)
            .into_iter()
            .map(|write| ((write.index, write.sub), write.value.to_vec()))
            .collect();
        let of_node = |node: &NodeConfig<'_>| {
            let own = writes(node.configuration);
            let last: Vec<_> = own[own.len() - 2..]
                .iter()
                .map(|write| (write.index, write.sub))
                .collect();
            assert_eq!(last, [(0x1020, 1), (0x1020, 2)], "at the end, when all else is written");
            let [date, time] = [own[own.len() - 2].value, own[own.len() - 1].value].map(<[u8]>::to_vec);
            assert_eq!((&file[&(0x1F26, node.id)], &file[&(0x1F27, node.id)]), (&date, &time));
            assert!(date != [0; 4] && time != [0; 4]);
            (date, time)
        };
        nodes.iter().map(of_node).collect::<Vec<_>>()
    };
    let before = stamps(text);
    assert_eq!(stamps(text), before, "the same machine, the same stamps");
    let changed = text.replacen("following_error_mm = ", "following_error_mm = 1", 1);
    assert_ne!(changed, text);
    let after = stamps(&changed);
    assert_ne!(after[0], before[0], "its drive is told another limit");
    assert_eq!(after[1..], before[1..]);
}
