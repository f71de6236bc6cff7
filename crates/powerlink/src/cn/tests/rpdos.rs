//! Several RPDOs: from the PReq, from the PResMN and from other nodes (cross traffic).

use super::*;

const fn entry(index: u16, offset_bits: u64, bits: u64) -> u64 {
    index as u64 | offset_bits << 32 | bits << 48
}

/// RPDO 0: 0x607A from the PReq. RPDO 1: 0x6060 from node 9. RPDO 2: 0x6040 from the PResMN. RPDO 3: nothing.
fn cross_traffic() -> Bench {
    let mut bench = Bench::new();
    bench.wake();
    let pdos = [
        (0, entry(0x607A, 0, 32)),
        (9, entry(0x6060, 8, 8)),
        (240, entry(0x6040, 0, 16)),
    ];
    for (number, (from, raw)) in (0..).zip(pdos) {
        bench.write(0x1400 + number, 1, &[from]).unwrap();
        bench.write(0x1600 + number, 1, &raw.to_le_bytes()).unwrap();
        bench.write(0x1600 + number, 0, &[1]).unwrap();
    }
    bench
}

fn operational(bench: &mut Bench) {
    bench.plain(NmtCommand::EnableReadyToOperate);
    bench.plain(NmtCommand::StartNode);
}

fn outputs(bench: &Bench) -> (i32, i8, u16) {
    let dictionary = bench.node.dictionary();
    (
        dictionary.get(dictionary.key(0x607A, 0).unwrap()),
        dictionary.get(dictionary.key(0x6060, 0).unwrap()),
        dictionary.get(dictionary.key(0x6040, 0).unwrap()),
    )
}

fn newest_error(bench: &Bench) -> u16 {
    let newest = bench.node.dictionary().read(0x1003, 1).unwrap();
    newest
        .get(2..4)
        .map_or(0, |code| u16::from_le_bytes([code[0], code[1]]))
}

#[test]
fn each_rpdo_reads_its_own_source() {
    let mut bench = cross_traffic();
    operational(&mut bench);
    assert!(!bench.pres_from(8, &[1, 2, 3, 4], true).outputs, "nobody reads node 8");
    assert!(bench.pres_from(9, &[0xEE, 8, 0xEE], true).outputs);
    assert_eq!(outputs(&bench), (0, 8, 0));
    assert!(bench.pres_from(node::MN, &[0x0F, 0x10], true).outputs);
    assert_eq!(outputs(&bench), (0, 8, 0x100F));
    bench.poll_with(&[1, 0, 0, 0]);
    assert_eq!(outputs(&bench), (1, 8, 0x100F));
    // RD = 0: the values stay.
    assert!(!bench.pres_from(9, &[0, 5], false).outputs);
    assert_eq!((outputs(&bench), newest_error(&bench)), ((1, 8, 0x100F), 0));
}

#[test]
fn two_rpdos_may_read_one_source() {
    let mut bench = cross_traffic();
    for number in [1, 2] {
        bench.write(0x1400 + number, 1, &[0]).unwrap();
    }
    operational(&mut bench);
    bench.poll_with(&[0x55, 0x66, 0x77, 0x11]);
    assert_eq!(outputs(&bench), (0x1177_6655, 0x66, 0x6655));
}

#[test]
fn faults_of_each_source_are_reported_once_and_by_their_name() {
    let mut bench = cross_traffic();
    bench.write(0x1401, 2, &[0x20]).unwrap();
    bench.write(0x1F8D, 240, &40_u16.to_le_bytes()).unwrap();
    operational(&mut bench);
    let count = |bench: &Bench| bench.node.dictionary().read(0x1003, 0).unwrap()[0];
    // The frames of this test bear version 0.
    bench.pres_from(9, &[0, 7], true);
    bench.pres_from(9, &[0, 7], true);
    assert_eq!((count(&bench), newest_error(&bench)), (1, error_code::PDO_MAP_VERSION));
    bench.pres_from(node::MN, &[0x0F], true);
    assert_eq!((count(&bench), newest_error(&bench)), (2, error_code::PDO_SHORT_RX));
    bench.pres_from(9, &[0; 37], true);
    assert_eq!(
        (count(&bench), newest_error(&bench)),
        (3, error_code::PRES_RX_LIMIT),
        "0x1F8D/9 is 36"
    );
    bench.pres_from(node::MN, &[0; 40], true);
    assert_eq!(count(&bench), 3, "0x1F8D/240 is 40");
    bench.pres_from(8, &[0; 60], true);
    assert_eq!(count(&bench), 3, "nobody reads node 8");
    assert_eq!(outputs(&bench), (0, 0, 0));
}

#[test]
fn refused_mappings_and_their_abort_codes() {
    let cases = [
        (entry(0x6041, 0, 16), AbortCode::NOT_MAPPABLE),
        (entry(0x1F8C, 0, 8), AbortCode::NOT_MAPPABLE),
        (entry(0x6042, 0, 16), AbortCode::NO_OBJECT),
        (entry(0x6040, 0, 16) | 1 << 16, AbortCode::NO_SUB_INDEX),
        (entry(0x6040, 4, 16), AbortCode::PARAMETER_INCOMPATIBLE),
        (entry(0x6040, 0, 12), AbortCode::PARAMETER_INCOMPATIBLE),
        (entry(0x6040, 0, 8), AbortCode::PARAMETER_INCOMPATIBLE),
        (entry(0x6040, 36 * 8 - 8, 16), AbortCode::PDO_LENGTH),
        (entry(0x6060, 0xFFF8, 8), AbortCode::PDO_LENGTH),
    ];
    for number in 0..4 {
        for (raw, code) in cases {
            let mut bench = Bench::new();
            bench.wake();
            bench.write(0x1600 + number, 1, &raw.to_le_bytes()).unwrap();
            assert_eq!(bench.write(0x1600 + number, 0, &[1]), Err(code), "{raw:016x}");
        }
    }
    // Overlap, and one object twice.
    for second in [entry(0x6060, 8, 8), entry(0x6040, 16, 16)] {
        let mut bench = Bench::new();
        bench.wake();
        bench.write(0x1600, 1, &entry(0x6040, 0, 16).to_le_bytes()).unwrap();
        bench.write(0x1600, 2, &second.to_le_bytes()).unwrap();
        assert_eq!(bench.write(0x1600, 0, &[2]), Err(AbortCode::PARAMETER_INCOMPATIBLE));
        bench.write(0x1600, 0, &[1]).unwrap();
    }
}

#[test]
fn limits_and_sources_cannot_be_changed_under_a_mapping() {
    let mut bench = Bench::new();
    bench.wake();
    bench.write(0x1F8D, 9, &100_u16.to_le_bytes()).unwrap();
    bench.write(0x1401, 1, &[9]).unwrap();
    bench
        .write(0x1601, 1, &entry(0x6040, 80 * 8, 16).to_le_bytes())
        .unwrap();
    bench.write(0x1601, 0, &[1]).unwrap();
    let refused = Err(AbortCode::PARAMETER_INCOMPATIBLE);
    assert_eq!(bench.write(0x1F8D, 9, &81_u16.to_le_bytes()), refused);
    assert_eq!(bench.write(0x1401, 1, &[0]), refused, "the PReq has 36 octets");
    assert_eq!(bench.write(0x1F8D, 9, &82_u16.to_le_bytes()), Ok(()));
    assert_eq!(
        bench.write(0x1F8D, 8, &0_u16.to_le_bytes()),
        Ok(()),
        "nobody reads node 8"
    );
    operational(&mut bench);
    for (index, sub, value) in [
        (0x1401, 1, &[0][..]),
        (0x1403, 2, &[0]),
        (0x1603, 0, &[0]),
        (0x1F8D, 9, &[100, 0]),
    ] {
        assert_eq!(
            bench.write(index, sub, value),
            Err(AbortCode::DEVICE_STATE),
            "{index:04x}/{sub}"
        );
    }
}
