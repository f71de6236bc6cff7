use super::*;
use crate::{DataType, EntryDef};
use std::string::ToString;

const TABLE: &[EntryDef] = &[
    EntryDef::rw(0x6040, DataType::U16, "controlword").rpdo(),
    EntryDef::ro(0x6041, DataType::U16, "statusword").tpdo(),
    EntryDef::rw(0x6060, DataType::I8, "mode wanted").rpdo(),
    EntryDef::ro(0x6064, DataType::I32, "position actual").tpdo(),
    EntryDef::rw(0x607A, DataType::I32, "target position").any_pdo(),
    EntryDef::rw(0x6076, DataType::U32, "rated torque"),
    EntryDef::rw(0x6200, DataType::U8, "outputs").subs(1, 4).rpdo(),
    EntryDef::rw(0x2000, DataType::Domain, "blob").capacity(8).any_pdo(),
];

type Small = Dictionary<16, 64>;

fn dictionary() -> Small {
    Dictionary::new(&[TABLE]).unwrap()
}

fn entry(index: u16, bit_offset: u16, bit_length: u16) -> MappingEntry {
    MappingEntry {
        index,
        sub: 0,
        bit_offset,
        bit_length,
    }
}

#[test]
fn entry_of_the_captured_network() {
    // openpowerlink-mn-3cn-10ms.pcap maps 8 bits at bit 0 of 0x6200/1.
    let captured = MappingEntry {
        index: 0x6200,
        sub: 1,
        bit_offset: 0,
        bit_length: 8,
    };
    assert_eq!(MappingEntry::from_u64(0x0008_0000_0001_6200), captured);
    assert_eq!(captured.to_u64(), 0x0008_0000_0001_6200);
    assert_eq!(MappingEntry::from_u64(0x0010_0028_0000_6041), entry(0x6041, 40, 16));
}

#[test]
fn scatter_and_gather_move_the_octets_the_entries_name() {
    let mut dictionary = dictionary();
    let receive: CopyPlan<4> = CopyPlan::new(
        &dictionary,
        Direction::Receive,
        [entry(0x607A, 0, 32), entry(0x6060, 32, 8), entry(0x6040, 40, 16)],
        7,
    )
    .unwrap();
    assert_eq!((receive.payload_octets(), receive.len()), (7, 3));
    receive
        .scatter(&[0x78, 0x56, 0x34, 0x12, 8, 0x0F, 0x01, 0xEE], &mut dictionary)
        .unwrap();
    assert_eq!(dictionary.get(dictionary.key::<i32>(0x607A, 0).unwrap()), 0x1234_5678);
    assert_eq!(dictionary.get(dictionary.key::<i8>(0x6060, 0).unwrap()), 8);
    assert_eq!(dictionary.get(dictionary.key::<u16>(0x6040, 0).unwrap()), 0x010F);

    dictionary.set(dictionary.key::<i32>(0x6064, 0).unwrap(), -2);
    dictionary.set(dictionary.key::<u16>(0x6041, 0).unwrap(), 0x0237);
    let transmit: CopyPlan<4> = CopyPlan::new(
        &dictionary,
        Direction::Transmit,
        [entry(0x6041, 8, 16), entry(0x6064, 32, 32)],
        36,
    )
    .unwrap();
    let mut payload = [0xA5; 9];
    transmit.gather(&dictionary, &mut payload).unwrap();
    assert_eq!(payload, [0xA5, 0x37, 0x02, 0xA5, 0xFE, 0xFF, 0xFF, 0xFF, 0xA5]);
}

#[test]
fn a_short_payload_changes_nothing() {
    let mut dictionary = dictionary();
    let plan: CopyPlan<2> = CopyPlan::new(
        &dictionary,
        Direction::Receive,
        [entry(0x6040, 0, 16), entry(0x607A, 16, 32)],
        36,
    )
    .unwrap();
    assert_eq!(
        plan.scatter(&[1; 5], &mut dictionary),
        Err(PayloadTooShort { need: 6, got: 5 })
    );
    assert_eq!(dictionary.read(0x6040, 0).unwrap(), [0, 0]);
    assert_eq!(
        plan.gather(&dictionary, &mut [0; 5]),
        Err(PayloadTooShort { need: 6, got: 5 })
    );
}

#[test]
fn bad_mappings_give_the_code_of_the_profile_and_the_position() {
    let dictionary = dictionary();
    let refused = |direction, entries: &[MappingEntry]| {
        let error = CopyPlan::<2>::new(&dictionary, direction, entries.iter().copied(), 6).unwrap_err();
        (error.position, error.code)
    };
    use Direction::{Receive, Transmit};
    let good = entry(0x607A, 0, 32);
    assert_eq!(
        refused(Receive, &[good, entry(0x6041, 32, 16)]),
        (1, AbortCode::NOT_MAPPABLE)
    );
    assert_eq!(refused(Transmit, &[entry(0x6040, 0, 16)]), (0, AbortCode::NOT_MAPPABLE));
    assert_eq!(refused(Transmit, &[entry(0x6076, 0, 32)]), (0, AbortCode::NOT_MAPPABLE));
    assert_eq!(refused(Transmit, &[entry(0x2000, 0, 64)]), (0, AbortCode::NOT_MAPPABLE));
    assert_eq!(refused(Transmit, &[entry(0x6FFF, 0, 64)]), (0, AbortCode::NO_OBJECT));
    assert_eq!(
        refused(
            Receive,
            &[MappingEntry {
                sub: 5,
                ..entry(0x6200, 0, 8)
            }]
        ),
        (0, AbortCode::NO_SUB_INDEX)
    );
    assert_eq!(
        refused(Receive, &[entry(0x6040, 4, 16)]),
        (0, AbortCode::PARAMETER_INCOMPATIBLE)
    );
    assert_eq!(
        refused(Receive, &[entry(0x607A, 0, 16)]),
        (0, AbortCode::PARAMETER_INCOMPATIBLE)
    );
    assert_eq!(
        refused(Receive, &[good, entry(0x6040, 24, 16)]),
        (1, AbortCode::PARAMETER_INCOMPATIBLE)
    );
    assert_eq!(
        refused(Receive, &[entry(0x6040, 0, 16), entry(0x6040, 16, 16)]),
        (1, AbortCode::PARAMETER_INCOMPATIBLE)
    );
    assert_eq!(
        refused(Receive, &[good, entry(0x6040, 40, 16)]),
        (1, AbortCode::PDO_LENGTH)
    );
    let third = MappingEntry {
        sub: 1,
        ..entry(0x6200, 40, 8)
    };
    assert_eq!(
        refused(Receive, &[good, entry(0x6060, 32, 8), third]),
        (2, AbortCode::PDO_LENGTH)
    );
    assert_eq!(
        refused(Receive, &[entry(0x6040, 0xFFF8, 16)]),
        (0, AbortCode::PDO_LENGTH)
    );
}

#[test]
fn an_object_may_be_sent_twice() {
    let mut dictionary = dictionary();
    dictionary.set(dictionary.key::<u16>(0x6041, 0).unwrap(), 0x1234);
    let plan: CopyPlan<2> = CopyPlan::new(
        &dictionary,
        Direction::Transmit,
        [entry(0x6041, 0, 16), entry(0x6041, 16, 16)],
        4,
    )
    .unwrap();
    let mut payload = [0; 4];
    plan.gather(&dictionary, &mut payload).unwrap();
    assert_eq!(payload, [0x34, 0x12, 0x34, 0x12]);
}

#[test]
fn the_error_names_object_place_and_rule() {
    let error = CopyPlan::<2>::new(&dictionary(), Direction::Receive, [entry(0x6041, 32, 16)], 36).unwrap_err();
    assert_eq!(
        error.to_string(),
        "mapping entry 1 (0x6041/0, 16 bits at bit 32): the object must be mappable in this direction: \
         0x06040041 (object cannot be mapped to the PDO)"
    );
}

proptest::proptest! {
    #[test]
    fn arbitrary_entries_never_reach_outside(
        raw in proptest::collection::vec(proptest::prelude::any::<u64>(), 0..6),
        payload in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..40),
    ) {
        let mut dictionary = dictionary();
        let indices = [0x6040, 0x6060, 0x607A, 0x6200, 0x2000, 0x7000];
        let entries = raw.iter().map(|raw| MappingEntry {
            index: indices[(raw % 6) as usize],
            ..MappingEntry::from_u64(*raw & 0x0038_00F8_0003_FFFF)
        });
        if let Ok(plan) = CopyPlan::<4>::new(&dictionary, Direction::Receive, entries, 36) {
            let fits = plan.scatter(&payload, &mut dictionary).is_ok();
            proptest::prop_assert_eq!(fits, payload.len() >= plan.payload_octets());
        }
    }
}
