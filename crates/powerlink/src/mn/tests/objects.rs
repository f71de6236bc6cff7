//! The managing node's object dictionary: the table against the profile, values of a running network, refusals.

use std::vec::Vec;

use obd::{AbortCode, Access, DataType, EntryDef, Objects, Value};

use super::*;

/// As in the profile, written by hand: index, first and last sub-index, octets (0: variable), access, default.
#[rustfmt::skip]
const PROFILE: &[(u16, u8, u8, usize, &str, i64)] = &[
    (0x1000, 0, 0, 4, "ro", 0), (0x1001, 0, 0, 1, "ro", 0), (0x1003, 0, 0, 1, "rw", 0), (0x1003, 1, 8, 0, "ro", 0),
    (0x1006, 0, 0, 4, "rws", 0), (0x1008, 0, 0, 0, "const", 0), (0x1009, 0, 0, 0, "const", 0),
    (0x100A, 0, 0, 0, "const", 0),
    (0x1018, 1, 1, 4, "ro", 0), (0x1018, 2, 2, 4, "ro", 0), (0x1018, 3, 3, 4, "ro", 0), (0x1018, 4, 4, 4, "ro", 0),
    (0x1020, 1, 1, 4, "rws", 0), (0x1020, 2, 2, 4, "rws", 0),
    (0x1030, 1, 1, 2, "ro", 1), (0x1030, 2, 2, 0, "const", 0), (0x1030, 3, 3, 1, "const", 6),
    (0x1030, 4, 4, 2, "const", 1518), (0x1030, 5, 5, 6, "const", 0), (0x1030, 6, 6, 0, "const", 0),
    (0x1030, 7, 7, 1, "ro", 1), (0x1030, 8, 8, 1, "rw", 1), (0x1030, 9, 9, 1, "ro", 1),
    (0x1300, 0, 0, 4, "rws", 15_000),
    (0x1400, 1, 1, 1, "rws", 0), (0x1400, 2, 2, 1, "rws", 0), (0x1600, 0, 0, 1, "rws", 0), (0x1600, 1, 254, 8, "rws", 0),
    (0x1800, 1, 1, 1, "rws", 0), (0x1800, 2, 2, 1, "rws", 0), (0x1A00, 0, 0, 1, "rws", 0), (0x1A00, 1, 254, 8, "rws", 0),
    (0x1C00, 1, 1, 4, "rw", 0), (0x1C00, 2, 2, 4, "ro", 0), (0x1C00, 3, 3, 4, "rws", 15),
    (0x1C02, 1, 1, 4, "rw", 0), (0x1C02, 2, 2, 4, "ro", 0), (0x1C02, 3, 3, 4, "rws", 15),
    (0x1C07, 1, 254, 4, "rw", 0), (0x1C08, 1, 254, 4, "ro", 0), (0x1C09, 1, 254, 4, "rws", 15),
    (0x1C12, 0, 0, 4, "rw", 1), (0x1C14, 0, 0, 4, "rws", 100_000),
    (0x1C15, 1, 254, 4, "rw", 0), (0x1C16, 1, 254, 4, "ro", 0), (0x1C17, 1, 254, 4, "rws", 15),
    (0x1E40, 1, 1, 2, "ro", 1), (0x1E40, 2, 2, 4, "ro", 0xC0A8_64F0), (0x1E40, 3, 3, 4, "ro", 0xFFFF_FF00),
    (0x1E40, 4, 4, 2, "ro", 50_000), (0x1E40, 5, 5, 4, "rws", 0xC0A8_64FE),
    (0x1E4A, 1, 1, 1, "rw", 0), (0x1E4A, 2, 2, 2, "rw", 64), (0x1E4A, 3, 3, 4, "ro", 0),
    (0x1F22, 1, 254, 0, "rw", 0), (0x1F26, 1, 254, 4, "rws", 0), (0x1F27, 1, 254, 4, "rws", 0),
    (0x1F52, 1, 1, 4, "ro", 0), (0x1F52, 2, 2, 4, "ro", 0),
    (0x1F53, 1, 254, 4, "rws", 0), (0x1F54, 1, 254, 4, "rws", 0),
    (0x1F80, 0, 0, 4, "rws", 0x0800), (0x1F81, 1, 254, 4, "rws", 0),
    (0x1F82, 0, 0, 4, "const", 0x0004_0B05), (0x1F83, 0, 0, 1, "const", 0x20),
    (0x1F84, 1, 254, 4, "rws", 0), (0x1F85, 1, 254, 4, "rws", 0), (0x1F86, 1, 254, 4, "rws", 0),
    (0x1F87, 1, 254, 4, "rws", 0), (0x1F88, 1, 254, 4, "rws", 0),
    (0x1F89, 1, 1, 4, "rws", 1_000_000), (0x1F89, 2, 2, 4, "rws", 500_000), (0x1F89, 3, 3, 4, "rws", 500_000),
    (0x1F89, 4, 4, 4, "rws", 5_000_000), (0x1F89, 5, 5, 4, "rws", 500_000),
    (0x1F8A, 1, 1, 4, "rws", 1_000), (0x1F8A, 2, 2, 4, "rws", 100_000),
    (0x1F8B, 1, 254, 2, "rws", 36), (0x1F8C, 0, 0, 1, "ro", 0x1C), (0x1F8D, 1, 254, 2, "rws", 36),
    (0x1F8E, 1, 254, 1, "ro", 0x1C), (0x1F8F, 1, 254, 1, "ro", 0x1C), (0x1F92, 1, 254, 4, "rws", 25_000),
    (0x1F93, 1, 1, 1, "ro", 240), (0x1F93, 2, 2, 1, "ro", 0),
    (0x1F98, 1, 1, 2, "const", 1490), (0x1F98, 2, 2, 2, "const", 1490), (0x1F98, 3, 3, 4, "const", 0),
    (0x1F98, 4, 4, 2, "rws", 36), (0x1F98, 5, 5, 2, "rws", 36), (0x1F98, 6, 6, 4, "const", 0),
    (0x1F98, 7, 7, 1, "rws", 0), (0x1F98, 8, 8, 2, "rws", 300), (0x1F98, 9, 9, 2, "rws", 2),
    (0x1F9A, 0, 0, 0, "rws", 0), (0x1F9B, 1, 254, 1, "rws", 0), (0x1F9E, 0, 0, 1, "rw", 0xFF),
    (0x1F9F, 1, 1, 1, "rw", 0), (0x1F9F, 2, 2, 1, "rw", 0), (0x1F9F, 3, 3, 1, "rw", 0), (0x1F9F, 4, 4, 0, "rw", 0),
    (0xA040, 1, 252, 1, "ro", 0), (0xA4C0, 1, 252, 1, "ro", 0),
];

fn access(def: &EntryDef) -> &'static str {
    match def.access {
        Access::Const => "const",
        Access::ReadOnly => "ro",
        Access::WriteOnly => "wo",
        Access::ReadWrite => "rw",
        Access::ReadWriteStored => "rws",
    }
}

#[test]
fn the_table_is_that_of_the_profile() {
    let table: Vec<_> = MN_PROFILE
        .iter()
        .map(|def| {
            let default = match def.default {
                Value::Integer(value) => value,
                Value::Zero | Value::Octets(_) => 0,
            };
            let size = def.data_type.size().unwrap_or(0);
            (def.index, def.sub_first, def.sub_last, size, access(def), default)
        })
        .collect();
    for (ours, profile) in table.iter().zip(PROFILE) {
        assert_eq!(ours, profile, "{:04X}h", ours.0);
    }
    assert_eq!(table.len(), PROFILE.len());
    let limits = |index, sub| {
        let def = MN_PROFILE
            .iter()
            .find(|def| (def.index, def.sub_first) == (index, sub))
            .unwrap();
        (def.low, def.high)
    };
    assert_eq!(limits(0x1F98, 8), (Some(300), Some(1500)));
    assert_eq!(limits(0x1F98, 9), (Some(0), Some(1000)));
    assert_eq!(limits(0x1F8B, 1), (Some(36), Some(1490)));
    assert_eq!(limits(0x1300, 0).0, Some(100));
    assert_eq!(limits(0x1F8A, 2).0, Some(250));
}

/// What a dictionary made of the same table thinks of it: no line contradicts itself or another.
#[test]
fn the_table_is_sound() {
    // Only the lines of one entry: a whole dictionary of it would hold every array of 254 entries.
    static FIRST: std::sync::OnceLock<Vec<EntryDef>> = std::sync::OnceLock::new();
    let first = FIRST.get_or_init(|| {
        MN_PROFILE
            .iter()
            .map(|def| EntryDef {
                sub_last: def.sub_first,
                capacity: def.capacity.min(64),
                ..*def
            })
            .collect()
    });
    Dictionary::<200, 8192>::new(&[first]).unwrap();
}

fn read(net: &mut Net<'_>, index: u16, sub: u8) -> Result<Vec<u8>, AbortCode> {
    let mut out = [0xA5; 1600];
    let len = net.mn.objects(net.now_ns).sdo_read(index, sub, &mut out)?;
    assert!(
        out[len..].iter().all(|octet| *octet == 0xA5),
        "{index:04X}h/{sub}: more than it says"
    );
    Ok(out[..len].to_vec())
}

fn number(net: &mut Net<'_>, index: u16, sub: u8) -> u64 {
    let octets = read(net, index, sub).unwrap_or_else(|code| panic!("{index:04X}h/{sub}: {code}"));
    octets
        .iter()
        .rev()
        .fold(0, |number, octet| number << 8 | u64::from(*octet))
}

fn write(net: &mut Net<'_>, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
    net.mn.objects(net.now_ns).sdo_write(index, sub, value)
}

#[test]
fn every_object_can_be_read_before_and_while_the_network_runs() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(239, &configuration)];
    let mut net = Net::new(&nodes);
    for _ in 0..2 {
        for def in MN_PROFILE {
            for sub in def.sub_first..=def.sub_last {
                let value = read(&mut net, def.index, sub).unwrap();
                if let Some(size) = def.data_type.size() {
                    assert_eq!(value.len(), size, "{:04X}h/{sub}", def.index);
                }
            }
            let entries = read(&mut net, def.index, 0).unwrap();
            assert!(def.sub_last == 0 || entries.len() == 1, "{:04X}h/0", def.index);
        }
        net.boot();
    }
    assert_eq!(read(&mut net, 0x1F81, 0), Ok(std::vec![254]));
    assert_eq!(read(&mut net, 0x1018, 0), Ok(std::vec![4]));
    for (index, sub, code) in [
        (0x1002, 0, AbortCode::NO_OBJECT),
        (0x2000, 0, AbortCode::NO_OBJECT),
        (0x1403, 1, AbortCode::NO_OBJECT),
        (0x1018, 5, AbortCode::NO_SUB_INDEX),
        (0x1F81, 255, AbortCode::NO_SUB_INDEX),
        (0x1402, 3, AbortCode::NO_SUB_INDEX),
        (0x1006, 1, AbortCode::NO_SUB_INDEX),
    ] {
        assert_eq!(read(&mut net, index, sub), Err(code), "{index:04X}h/{sub}");
    }
    let mut short = [0; 3];
    let too_short = net.mn.objects(0).sdo_read(0x1000, 0, &mut short);
    assert_eq!(too_short, Err(AbortCode::OUT_OF_MEMORY));
}

#[test]
fn the_configuration_is_shown_as_it_is() {
    let configuration = configuration();
    let mut nodes = [node_config(1, &configuration), node_config(5, &[])];
    nodes[0].identity.serial = Some(1);
    nodes[0].preq_version = 0x21;
    nodes[0].pres_version = 0x30;
    nodes[0].configuration_stamp = Some(Stamp { date: 20_000, time: 7 });
    nodes[1].preq_bytes = 40;
    nodes[1].assignment.mandatory = false;
    let mut net = Net::with(MnConfig {
        device: DeviceInfo {
            device_type: 0x0002_0192,
            vendor_id: 0x0000_0777,
            host_name: "mill",
            ..DeviceInfo::default()
        },
        pres_mn_bytes: Some(12),
        async_mtu: 1200,
        ..mn_config(&nodes)
    });
    for (index, sub, expected) in [
        (0x1000, 0, 0x0002_0192),
        (0x1006, 0, 1_000),
        (0x1018, 1, 0x777),
        (0x1F26, 1, 20_000),
        (0x1F27, 1, 7),
        (0x1F80, 0, 0x1E00),
        (0x1F81, 1, 0x8000_000F),
        (0x1F81, 5, 0x8000_0007),
        (0x1F81, 7, 0),
        (0x1F81, 240, 0x8000_1001),
        (0x1F84, 1, 0x0002_0192),
        (0x1F88, 1, 1),
        (0x1F88, 5, 0),
        (0x1F89, 1, 20_000),
        (0x1F89, 4, 400_000),
        (0x1F8A, 2, 150_000),
        (0x1F8B, 1, 36),
        (0x1F8B, 5, 40),
        (0x1F8D, 240, 36),
        (0x1F92, 1, 100_000),
        (0x1F92, 9, 25_000),
        (0x1F98, 5, 36),
        (0x1F98, 8, 1200),
        (0x1C09, 9, 15),
        // Channels: 0 our own PRes, then the nodes.
        (0x1800, 1, 0),
        (0x1801, 1, 1),
        (0x1801, 2, 0x21),
        (0x1802, 1, 5),
        (0x1401, 2, 0x30),
        // Octet by octet: twelve of our PRes, six and forty of the nodes' PReqs.
        (0x1A00, 0, 12),
        (0x1A00, 1, 0x0008_0000_0001_A040),
        (0x1A00, 12, 0x0008_0058_000C_A040),
        (0x1A01, 0, 6),
        (0x1A01, 1, 0x0008_0000_000D_A040),
        (0x1A02, 0, 40),
        (0x1A02, 1, 0x0008_0000_0013_A040),
        (0x1A02, 40, 0x0008_0138_003A_A040),
        (0x1601, 0, 6),
        (0x1601, 1, 0x0008_0000_0001_A4C0),
        (0x1601, 6, 0x0008_0028_0006_A4C0),
        (0x1600, 0, 0),
        (0x1600, 1, 0),
    ] {
        assert_eq!(number(&mut net, index, sub), expected, "{index:04X}h/{sub}");
    }
    assert_eq!(read(&mut net, 0x1F9A, 0), Ok(b"mill".to_vec()));
    assert_eq!(read(&mut net, 0x1030, 5), Ok(MN_MAC.to_vec()));
    assert_eq!(read(&mut net, 0x1F22, 1), Ok(configuration.clone()));
    assert_eq!(read(&mut net, 0x1F22, 5), Ok(Vec::new()));
    // In parts, as for a long one.
    let mut objects = net.mn.objects(0);
    assert_eq!(objects.sdo_read_parts(0x1F22, 1), Ok(Some(configuration.len())));
    assert_eq!(objects.sdo_read_parts(0x1F81, 1), Ok(None));
    let mut part = [0; 10];
    objects.sdo_read_part(0x1F22, 1, 20, &mut part).unwrap();
    assert_eq!(part[..], configuration[20..30]);
    let beyond = objects.sdo_read_part(0x1F22, 1, configuration.len() - 9, &mut part);
    assert_eq!(beyond, Err(AbortCode::GENERAL));
}

#[test]
fn states_counters_and_process_data_are_live() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = Net::new(&nodes);
    assert_eq!((number(&mut net, 0x1F8C, 0), number(&mut net, 0x1F8E, 1)), (0x1C, 0x1C));
    net.boot();
    for (index, sub) in [(0x1F8C, 0), (0x1F8E, 1), (0x1F8F, 1), (0x1F8E, 240)] {
        assert_eq!(number(&mut net, index, sub), 0xFD, "{index:04X}h/{sub}");
    }
    assert_eq!(number(&mut net, 0x1001, 0), 0);
    net.mn.output_mut(1).copy_from_slice(&[1, 2, 3, 4, 5, 6]);
    let image: Vec<_> = (1..=13).map(|sub| number(&mut net, 0xA040, sub)).collect();
    assert_eq!(
        image,
        [0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 0],
        "behind the octets of node 1"
    );
    assert_eq!(number(&mut net, 0xA04F, 252), 0);
    assert_eq!(read(&mut net, 0xA050, 1), Err(AbortCode::NO_OBJECT));
    assert_eq!(read(&mut net, 0xA040, 253), Err(AbortCode::NO_SUB_INDEX));
    net.lose_pres.insert(1, 2);
    net.cycles(2);
    assert_eq!(number(&mut net, 0x1C07, 1), 2);
    write(&mut net, 0x1C07, 1, &[0; 4]).unwrap();
    assert_eq!((number(&mut net, 0x1C07, 1), number(&mut net, 0x1C07, 2)), (0, 0));
    assert_eq!(net.mn.statistics(0).pres_lost, 2, "the statistics are never reset");

    assert_eq!(number(&mut net, 0x1003, 0), 0);
    net.dead = std::vec![2];
    net.cycles(10);
    assert_eq!((number(&mut net, 0x1F8E, 2), number(&mut net, 0x1F8F, 2)), (0x1C, 0x1C));
    assert_eq!((number(&mut net, 0x1003, 0), number(&mut net, 0x1001, 0)), (1, 0x11));
    let entry = read(&mut net, 0x1003, 1).unwrap();
    assert_eq!(entry[..4], [0x02, 0x30, 0x43, 0x82], "loss of PRes");
    assert_eq!((entry.len(), entry[12]), (20, 2), "of node 2");
    assert_eq!(read(&mut net, 0x1003, 2), Ok(Vec::new()));
    assert_eq!(write(&mut net, 0x1003, 0, &[1]), Err(AbortCode::VALUE_TOO_HIGH));
    write(&mut net, 0x1003, 0, &[0]).unwrap();
    assert_eq!(number(&mut net, 0x1003, 0), 0);
}

#[test]
fn what_must_not_be_written_is_refused_with_the_right_code() {
    let nodes = [node_config(1, &[])];
    let mut net = Net::new(&nodes);
    net.boot();
    for def in MN_PROFILE {
        let size = def.data_type.size().unwrap_or(4);
        let before = read(&mut net, def.index, def.sub_first);
        let refused = write(&mut net, def.index, def.sub_first, &[0xFE; 70_000][..size + 70_000 - 8]);
        let read_only = matches!(def.access, Access::Const | Access::ReadOnly);
        let expected = if read_only {
            AbortCode::WRITE_OF_READ_ONLY
        } else {
            AbortCode::TOO_LONG
        };
        assert_eq!(refused, Err(expected), "{:04X}h/{}", def.index, def.sub_first);
        assert_eq!(read(&mut net, def.index, def.sub_first), before);
        if !read_only && def.data_type.size().is_some() {
            assert_eq!(
                write(&mut net, def.index, def.sub_first, &[]),
                Err(AbortCode::TOO_SHORT)
            );
        }
        if def.data_type == DataType::Bool && !read_only {
            assert_eq!(
                write(&mut net, def.index, def.sub_first, &[2]),
                Err(AbortCode::VALUE_RANGE)
            );
        }
    }
    for (index, sub, value, code) in [
        (0x1F98, 8, &299_u16.to_le_bytes()[..], AbortCode::VALUE_TOO_LOW),
        (0x1F98, 8, &1501_u16.to_le_bytes(), AbortCode::VALUE_TOO_HIGH),
        (0x1F98, 8, &1500_u16.to_le_bytes(), AbortCode::DEVICE_STATE),
        (0x1F8B, 1, &35_u16.to_le_bytes(), AbortCode::VALUE_TOO_LOW),
        (0x1006, 0, &2_000_u32.to_le_bytes(), AbortCode::DEVICE_STATE),
        (0x1F81, 1, &0_u32.to_le_bytes(), AbortCode::DEVICE_STATE),
        (0x1F22, 1, &[0; 4], AbortCode::DEVICE_STATE),
        (0x1600, 0, &[0], AbortCode::DEVICE_STATE),
        (0x1C09, 2, &[0; 4], AbortCode::DEVICE_STATE),
        (0x1F9E, 0, &[0x28], AbortCode::LOCAL_CONTROL),
        (0x1018, 9, &[0], AbortCode::NO_SUB_INDEX),
        (0x3000, 0, &[0], AbortCode::NO_OBJECT),
    ] {
        assert_eq!(write(&mut net, index, sub, value), Err(code), "{index:04X}h/{sub}");
    }
    assert!(net.all_operational());
}

#[test]
fn thresholds_are_taken_at_once() {
    let nodes = [node_config(1, &[])];
    let mut net = Net::new(&nodes);
    net.boot();
    write(&mut net, 0x1C09, 1, &16_u32.to_le_bytes()).unwrap();
    assert_eq!(number(&mut net, 0x1C09, 1), 16);
    net.lose_pres.insert(1, 2);
    net.cycles(1);
    assert_eq!(
        (net.mn.node_state(0), number(&mut net, 0x1C08, 1)),
        (NodeState::Operational, 8)
    );
    net.cycles(1);
    assert_eq!(net.mn.node_state(0), NodeState::Faulted);
}

#[test]
fn requests_for_nmt_services_are_carried_out() {
    let nodes = [node_config(1, &[]), node_config(2, &[])];
    let mut net = Net::new(&nodes);
    net.boot();
    net.cycles(100);
    let asked = |net: &Net<'_>, service, target| {
        let is =
            |sent: &&OnWire| matches!(sent.frame(), Frame::Soa(soa) if (soa.service, soa.target) == (service, target));
        net.log.iter().filter(is).count()
    };
    let ask = |net: &mut Net<'_>, command: u8, target: u8| {
        write(net, 0x1F9F, 2, &[command]).unwrap();
        write(net, 0x1F9F, 3, &[target]).unwrap();
        assert_eq!(number(net, 0x1F9F, 3), u64::from(target));
        let done = write(net, 0x1F9F, 1, &[1]);
        net.log.clear();
        net.cycles(20);
        done
    };
    ask(&mut net, 0x01, 2).unwrap();
    assert_eq!(asked(&net, RequestedService::IdentRequest, 2), 1);
    ask(&mut net, 0x02, 1).unwrap();
    assert_eq!(asked(&net, RequestedService::StatusRequest, 1), 1);
    assert_eq!(ask(&mut net, 0x01, 9), Err(AbortCode::VALUE_RANGE), "no such node");
    assert_eq!(ask(&mut net, 0x28, 1), Err(AbortCode::DEVICE_STATE), "it takes part");
    assert_eq!(ask(&mut net, 0x22, 1), Err(AbortCode::LOCAL_CONTROL));
    assert!(net.all_operational());
    assert_eq!(net.commands(), []);
}
