use super::*;
use proptest::prelude::*;
use std::string::ToString;
use std::vec::Vec;

const COMMUNICATION: &[EntryDef] = &[
    EntryDef::rws(0x1006, DataType::U32, "NMT_CycleLen_U32").limits(400, 0xFFFF_FFFF),
    EntryDef::constant(0x1000, DataType::U32, "NMT_DeviceType_U32").default(0x000F_0191),
    EntryDef::constant(0x1008, DataType::VisibleString, "NMT_ManufactDevName_VS")
        .capacity(16)
        .default_octets(b"drive"),
    EntryDef::rws(0x1600, DataType::U8, "NumberOfEntries").limits(0, 32),
    EntryDef::rws(0x1600, DataType::U64, "ObjectMapping").subs(1, 32),
    EntryDef::ro(0x1018, DataType::U32, "Identity").subs(1, 4),
];
const DEVICE: &[EntryDef] = &[
    EntryDef::rw(0x6060, DataType::I8, "Modes of operation").limits(-1, 10),
    EntryDef::rw(0x607A, DataType::I32, "Target position").rpdo(),
    EntryDef::wo(0x2000, DataType::U16, "Password"),
    EntryDef::rw(0x2001, DataType::Bool, "Switch"),
    EntryDef::rw(0x2002, DataType::Domain, "Table").capacity(4),
];

type Small = Dictionary<16, 512>;

fn dictionary() -> Small {
    Dictionary::new(&[COMMUNICATION, DEVICE]).unwrap()
}

#[test]
fn tables_are_sorted_and_sub_index_0_is_added() {
    let dictionary = dictionary();
    // 11 lines and one number of entries (0x1018/0).
    assert_eq!(
        dictionary.used(),
        (12, 4 + 4 + (2 + 16) + 1 + 32 * 8 + 1 + 4 * 4 + 1 + 4 + 2 + 1 + (2 + 4))
    );
    let counted = (
        crate::lines_of(COMMUNICATION) + crate::lines_of(DEVICE),
        crate::octets_of(COMMUNICATION) + crate::octets_of(DEVICE),
    );
    assert_eq!(counted, dictionary.used());
    let indices: Vec<u16> = dictionary.lines().map(|(index, _)| index).collect();
    assert_eq!(
        indices,
        [
            0x1000, 0x1006, 0x1008, 0x1018, 0x1018, 0x1600, 0x1600, 0x2000, 0x2001, 0x2002, 0x6060, 0x607A
        ]
    );
    assert_eq!(dictionary.read(0x1018, 0).unwrap(), [4]);
    assert_eq!(
        dictionary.check_write(0x1018, 0, &[1]),
        Err(AbortCode::WRITE_OF_READ_ONLY)
    );
    assert_eq!(dictionary.read(0x1600, 0).unwrap(), [0]);
}

#[test]
fn defaults_come_from_the_table() {
    let dictionary = dictionary();
    assert_eq!(dictionary.read(0x1000, 0).unwrap(), [0x91, 0x01, 0x0F, 0x00]);
    assert_eq!(dictionary.read(0x1008, 0).unwrap(), b"drive");
    assert_eq!(dictionary.read(0x1600, 32).unwrap(), [0; 8]);
}

#[test]
fn missing_objects_and_missing_sub_indices_differ() {
    let dictionary = dictionary();
    assert_eq!(dictionary.read(0x1011, 1), Err(AbortCode::NO_OBJECT));
    assert_eq!(dictionary.read(0x0FFF, 0), Err(AbortCode::NO_OBJECT));
    assert_eq!(dictionary.read(0xFFFF, 255), Err(AbortCode::NO_OBJECT));
    assert_eq!(dictionary.read(0x1018, 5), Err(AbortCode::NO_SUB_INDEX));
    assert_eq!(dictionary.read(0x1600, 33), Err(AbortCode::NO_SUB_INDEX));
    assert_eq!(dictionary.read(0x1006, 1), Err(AbortCode::NO_SUB_INDEX));
}

#[test]
fn sdo_writes_are_checked_for_access_length_and_limits() {
    let mut dictionary = dictionary();
    let mut refused = |index, sub, value: &[u8]| dictionary.write(index, sub, value).unwrap_err();
    assert_eq!(refused(0x1000, 0, &[0; 4]), AbortCode::WRITE_OF_READ_ONLY);
    assert_eq!(refused(0x1006, 0, &[0; 5]), AbortCode::TOO_LONG);
    assert_eq!(refused(0x1006, 0, &[0; 3]), AbortCode::TOO_SHORT);
    assert_eq!(refused(0x1006, 0, &[]), AbortCode::TOO_SHORT);
    assert_eq!(refused(0x1006, 0, &399_u32.to_le_bytes()), AbortCode::VALUE_TOO_LOW);
    assert_eq!(refused(0x1600, 0, &[33]), AbortCode::VALUE_TOO_HIGH);
    assert_eq!(refused(0x6060, 0, &[0xFE]), AbortCode::VALUE_TOO_LOW);
    assert_eq!(refused(0x6060, 0, &[11]), AbortCode::VALUE_TOO_HIGH);
    assert_eq!(refused(0x2001, 0, &[2]), AbortCode::VALUE_RANGE);
    assert_eq!(refused(0x2002, 0, &[0; 5]), AbortCode::TOO_LONG);
    assert_eq!(dictionary.read(0x2000, 0), Err(AbortCode::READ_OF_WRITE_ONLY));
    assert_eq!(dictionary.read(0x1006, 0).unwrap(), [0; 4]);

    dictionary.write(0x1006, 0, &400_u32.to_le_bytes()).unwrap();
    dictionary.write(0x6060, 0, &[0xFF]).unwrap();
    dictionary.write(0x2000, 0, &[1, 2]).unwrap();
    dictionary.write(0x2002, 0, &[7, 8]).unwrap();
    assert_eq!(dictionary.read(0x1006, 0).unwrap(), [0x90, 0x01, 0, 0]);
    assert_eq!(dictionary.get(dictionary.key::<i8>(0x6060, 0).unwrap()), -1);
    assert_eq!(dictionary.get(dictionary.key::<u16>(0x2000, 0).unwrap()), 0x0201);
    assert_eq!(dictionary.read(0x2002, 0).unwrap(), [7, 8]);
}

#[test]
fn keys_have_the_type_of_the_object() {
    let mut dictionary = dictionary();
    assert_eq!(dictionary.key::<u32>(0x607A, 0), Err(AbortCode::LENGTH_MISMATCH));
    assert_eq!(dictionary.key::<u16>(0x6060, 0), Err(AbortCode::LENGTH_MISMATCH));
    let target = dictionary.key::<i32>(0x607A, 0).unwrap();
    dictionary.set(target, i32::MIN);
    assert_eq!(dictionary.get(target), i32::MIN);
    assert_eq!(dictionary.read(0x607A, 0).unwrap(), [0, 0, 0, 0x80]);
    let mapping = dictionary.key::<u64>(0x1600, 32).unwrap();
    dictionary.set(mapping, 0x0008_0000_0001_6200);
    assert_eq!(dictionary.read(0x1600, 32).unwrap(), [0x00, 0x62, 0x01, 0, 0, 0, 8, 0]);
    assert_eq!(dictionary.read(0x1600, 31).unwrap(), [0; 8]);
}

#[test]
fn a_reset_restores_a_range_of_objects() {
    let mut dictionary = dictionary();
    let name = dictionary.find(0x1008, 0).unwrap();
    dictionary.set_default(name, b"drive of the X axis").unwrap_err();
    dictionary.set_default(name, b"X").unwrap();
    dictionary.write(0x1006, 0, &1000_u32.to_le_bytes()).unwrap();
    dictionary.write(0x607A, 0, &7_i32.to_le_bytes()).unwrap();
    dictionary.set_octets(name, b"Y").unwrap();
    dictionary.restore_defaults(0x1000, 0x1FFF);
    assert_eq!(dictionary.read(0x1006, 0).unwrap(), [0; 4]);
    assert_eq!(dictionary.read(0x1008, 0).unwrap(), b"X");
    assert_eq!(dictionary.read(0x607A, 0).unwrap(), [7, 0, 0, 0]);
}

#[test]
fn bad_tables_are_refused_with_the_reason() {
    let build = |tables: &[&'static [EntryDef]]| Dictionary::<4, 32>::new(tables).unwrap_err().to_string();
    const TWICE: &[EntryDef] = &[EntryDef::ro(0x1600, DataType::U64, "one").subs(1, 4)];
    const OVERLAP: &[EntryDef] = &[EntryDef::ro(0x1600, DataType::U64, "two").subs(4, 5)];
    assert_eq!(
        build(&[TWICE, OVERLAP]),
        "object 0x1600/4 is defined twice: \"one\" and \"two\""
    );
    assert_eq!(
        build(&[TWICE]),
        "the values need 33 octets, the dictionary has room for 32"
    );
    assert_eq!(
        build(&[COMMUNICATION]),
        "the tables need 7 entries, the dictionary has room for 4"
    );
    const DEFAULT: &[EntryDef] = &[EntryDef::ro(0x2000, DataType::U8, "byte").default(256)];
    assert_eq!(
        build(&[DEFAULT]),
        "object 0x2000/0: the default must lie within the range of an integer type"
    );
    const CAPACITY: &[EntryDef] = &[EntryDef::ro(0x2000, DataType::Domain, "blob")];
    assert_eq!(
        build(&[CAPACITY]),
        "object 0x2000/0: a type of variable length needs a capacity"
    );
    const LIMITS: &[EntryDef] = &[EntryDef::rw(0x2000, DataType::U8, "byte").limits(2, 1)];
    assert_eq!(
        build(&[LIMITS]),
        "object 0x2000/0: the low limit must not lie above the high limit"
    );
}

#[test]
fn a_reader_with_little_room_is_told() {
    let mut dictionary = dictionary();
    assert_eq!(
        dictionary.sdo_read(0x1000, 0, &mut [0; 3]),
        Err(AbortCode::OUT_OF_MEMORY)
    );
    let mut out = [0xA5; 5];
    assert_eq!(dictionary.sdo_read(0x1000, 0, &mut out), Ok(4));
    assert_eq!(out, [0x91, 0x01, 0x0F, 0x00, 0xA5]);
}

proptest! {
    #[test]
    fn a_write_changes_one_object_or_none(
        index in prop_oneof![Just(0x1006_u16), Just(0x1600), Just(0x2000), Just(0x2001), Just(0x2002), Just(0x6060), any::<u16>()],
        sub in 0_u8..40,
        value in proptest::collection::vec(any::<u8>(), 0..10),
    ) {
        let mut dictionary = dictionary();
        let before = dictionary.values;
        let written = dictionary.write(index, sub, &value);
        match written {
            Ok(handle) => {
                prop_assert_eq!(dictionary.octets(handle), &value[..]);
                let whole = whole(handle);
                prop_assert_eq!(&dictionary.values[..whole.start], &before[..whole.start]);
                prop_assert_eq!(&dictionary.values[whole.end..], &before[whole.end..]);
            }
            Err(_) => prop_assert_eq!(dictionary.values, before),
        }
    }
}
