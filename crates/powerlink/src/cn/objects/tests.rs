//! The table against values written down from the profile, not from the table.

use super::super::keys::Keys;
use super::*;
use obd::{Access, Dictionary, Value};
use std::collections::BTreeMap;
use std::vec::Vec;

#[test]
fn the_constants_say_what_the_table_needs() {
    let dictionary = Dictionary::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&[COMMUNICATION_PROFILE]).unwrap();
    assert_eq!(dictionary.used(), (COMMUNICATION_ENTRIES, COMMUNICATION_BYTES));
    Keys::find(&dictionary).unwrap();
}

#[test]
fn storage_can_be_added() {
    const ENTRIES: usize = COMMUNICATION_ENTRIES + obd::lines_of(STORAGE);
    const BYTES: usize = COMMUNICATION_BYTES + obd::octets_of(STORAGE);
    let dictionary = Dictionary::<ENTRIES, BYTES>::new(&[COMMUNICATION_PROFILE, STORAGE]).unwrap();
    assert_eq!(dictionary.read(0x1010, 0).unwrap(), [4]);
    assert_eq!((SAVE, LOAD), (0x6576_6173, 0x6461_6F6C));
}

type Line = (u16, u8, u8, DataType, Access, Option<i64>);

/// Index, sub-indices, type, access, default; one line for each object of the profile that a controlled node has.
/// `None`: set for each node. Strings are left out of the defaults.
#[rustfmt::skip]
const EXPECTED: &[Line] = &[
    (0x1000, 0, 0, U32, RO, Some(0)),
    (0x1001, 0, 0, U8, RO, Some(0)),
    (0x1003, 0, 0, U8, RW, Some(0)),
    (0x1003, 1, 8, OctetString, RO, None),
    (0x1006, 0, 0, U32, RWS, Some(0)),
    (0x1008, 0, 0, VisibleString, CONST, None),
    (0x1009, 0, 0, VisibleString, CONST, None),
    (0x100A, 0, 0, VisibleString, CONST, None),
    (0x1018, 1, 4, U32, RO, Some(0)),
    (0x1020, 1, 2, U32, RWS, Some(0)),
    (0x1030, 1, 1, U16, RO, Some(1)),
    (0x1030, 2, 2, VisibleString, CONST, None),
    (0x1030, 3, 3, U8, CONST, Some(6)),
    (0x1030, 4, 4, U16, CONST, Some(1518)),
    (0x1030, 5, 5, Mac, CONST, None),
    (0x1030, 6, 6, VisibleString, CONST, None),
    (0x1030, 7, 7, U8, RO, Some(1)),
    (0x1030, 8, 8, U8, RW, Some(1)),
    (0x1030, 9, 9, Bool, RO, Some(1)),
    (0x1050, 1, 254, U32, RO, Some(0)),
    (0x1101, 1, 8, U32, RO, Some(0)),
    (0x1102, 1, 7, U32, RO, Some(0)),
    (0x1300, 0, 0, U32, RWS, Some(15_000)),
    (0x1400, 1, 2, U8, RWS, Some(0)), (0x1401, 1, 2, U8, RWS, Some(0)),
    (0x1402, 1, 2, U8, RWS, Some(0)), (0x1403, 1, 2, U8, RWS, Some(0)),
    (0x1600, 0, 0, U8, RWS, Some(0)), (0x1600, 1, 32, U64, RWS, Some(0)),
    (0x1601, 0, 0, U8, RWS, Some(0)), (0x1601, 1, 32, U64, RWS, Some(0)),
    (0x1602, 0, 0, U8, RWS, Some(0)), (0x1602, 1, 32, U64, RWS, Some(0)),
    (0x1603, 0, 0, U8, RWS, Some(0)), (0x1603, 1, 32, U64, RWS, Some(0)),
    (0x1800, 1, 2, U8, RWS, Some(0)),
    (0x1A00, 0, 0, U8, RWS, Some(0)), (0x1A00, 1, 32, U64, RWS, Some(0)),
    (0x1C0A, 1, 1, U32, RW, Some(0)), (0x1C0A, 2, 2, U32, RO, Some(0)), (0x1C0A, 3, 3, U32, RWS, Some(15)),
    (0x1C0B, 1, 1, U32, RW, Some(0)), (0x1C0B, 2, 2, U32, RO, Some(0)), (0x1C0B, 3, 3, U32, RWS, Some(15)),
    (0x1C0C, 1, 1, U32, RW, Some(0)), (0x1C0C, 2, 2, U32, RO, Some(0)), (0x1C0C, 3, 3, U32, RWS, Some(15)),
    (0x1C0D, 1, 1, U32, RW, Some(0)), (0x1C0D, 2, 2, U32, RO, Some(0)), (0x1C0D, 3, 3, U32, RWS, Some(15)),
    (0x1C0F, 1, 1, U32, RW, Some(0)), (0x1C0F, 2, 2, U32, RO, Some(0)), (0x1C0F, 3, 3, U32, RWS, Some(15)),
    (0x1C14, 0, 0, U32, RWS, Some(100_000)),
    (0x1E40, 1, 1, U16, RO, Some(1)),
    (0x1E40, 2, 2, Ip, RO, Some(0)),
    (0x1E40, 3, 3, Ip, RO, Some(0xFFFF_FF00)),
    (0x1E40, 4, 4, U16, RO, Some(50_000)),
    (0x1E40, 5, 5, Ip, RWS, Some(0xC0A8_64FE)),
    (0x1E4A, 1, 1, Bool, RO, Some(0)),
    (0x1E4A, 2, 2, U16, RWS, Some(64)),
    (0x1E4A, 3, 3, U32, RO, Some(0)),
    (0x1F52, 1, 2, U32, RO, Some(0)),
    (0x1F81, 1, 254, U32, RWS, Some(0)),
    (0x1F82, 0, 0, U32, CONST, Some(0x0004_8265)),
    (0x1F83, 0, 0, U8, CONST, Some(0x20)),
    (0x1F8C, 0, 0, U8, RO, Some(0x1C)),
    (0x1F8D, 1, 254, U16, RWS, Some(36)),
    (0x1F93, 1, 1, U8, RO, Some(0)),
    (0x1F93, 2, 2, Bool, RO, Some(0)),
    (0x1F98, 1, 2, U16, CONST, Some(1490)),
    (0x1F98, 3, 3, U32, CONST, Some(0)),
    (0x1F98, 4, 5, U16, RWS, Some(36)),
    (0x1F98, 6, 6, U32, CONST, Some(0)),
    (0x1F98, 7, 7, U8, RWS, Some(0)),
    (0x1F98, 8, 8, U16, RWS, Some(300)),
    (0x1F98, 9, 9, U16, RWS, Some(2)),
    (0x1F98, 10, 10, U8, RO, Some(0)),
    (0x1F98, 11, 14, U32, RO, Some(0)),
    (0x1F99, 0, 0, U32, RWS, Some(5_000_000)),
    (0x1F9A, 0, 0, VisibleString, RWS, None),
    (0x1F9B, 1, 254, U8, RWS, Some(0)),
    (0x1F9E, 0, 0, U8, RW, Some(0xFF)),
];
const CONST: Access = Access::Const;
const RO: Access = Access::ReadOnly;
const RW: Access = Access::ReadWrite;
const RWS: Access = Access::ReadWriteStored;

#[test]
fn every_object_is_as_the_profile_has_it_and_there_are_no_others() {
    let mut expected = BTreeMap::new();
    for &(index, first, last, data_type, access, default) in EXPECTED {
        for sub in first..=last {
            assert!(expected.insert((index, sub), (data_type, access, default)).is_none());
        }
    }
    let mut unexpected = Vec::new();
    for def in COMMUNICATION_PROFILE {
        for sub in def.sub_first..=def.sub_last {
            let Some((data_type, access, default)) = expected.remove(&(def.index, sub)) else {
                unexpected.push((def.index, sub));
                continue;
            };
            let place = (def.index, sub);
            assert_eq!((def.data_type, def.access), (data_type, access), "{place:04x?}");
            let is = match def.default {
                Value::Zero => Some(0),
                Value::Integer(value) => Some(value),
                Value::Octets(_) => None,
            };
            assert!(
                default.is_none() || is == default,
                "{place:04x?}: default {is:?}, expected {default:?}"
            );
        }
    }
    assert_eq!(unexpected, []);
    assert_eq!(expected.into_keys().collect::<Vec<_>>(), []);
}

#[test]
fn ranges() {
    let dictionary = Dictionary::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&[COMMUNICATION_PROFILE]).unwrap();
    let takes = |index, sub, value: &[u8]| dictionary.check_write(index, sub, value).is_ok();
    #[rustfmt::skip]
    let ranges: [(u16, u8, u32, u32); 10] = [
        // index, sub, least, greatest
        (0x1400, 1, 0, 254),
        (0x1600, 0, 0, 32),
        (0x1800, 1, 0, 0),
        (0x1E4A, 2, 1, 255),
        (0x1F8D, 240, 0, 1490),
        (0x1F98, 4, 36, 1490),
        (0x1F98, 5, 36, 1490),
        (0x1F98, 8, 300, 1500),
        (0x1F98, 9, 0, 1000),
        (0x1003, 0, 0, 0),
    ];
    for (index, sub, least, greatest) in ranges {
        let size = dictionary.find(index, sub).unwrap().size();
        let write = |value: u32| takes(index, sub, &value.to_le_bytes()[..size]);
        assert!(write(least) && write(greatest), "{index:04x}/{sub}");
        assert!(!write(greatest + 1), "{index:04x}/{sub}: {greatest} is the greatest");
        assert!(
            least == 0 || !write(least - 1),
            "{index:04x}/{sub}: {least} is the least"
        );
    }
    assert!(!takes(0x1006, 0, &99_u32.to_le_bytes()) && takes(0x1006, 0, &100_u32.to_le_bytes()));
    assert_eq!(dictionary.read(0x1F98, 0).unwrap(), [14]);
    assert_eq!(dictionary.read(0x1E40, 5).unwrap(), [0xFE, 0x64, 0xA8, 0xC0]);
}
