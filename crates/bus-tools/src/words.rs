//! Numbers of the wire in words: states, objects, values, error codes.
//!
//! In:  what a frame or a node reports. Out: text that a person understands without the standard in hand, with the number
//! where it is needed to look further.

use cia402::profile::axis_of;
use obd::DataType;
use obd::mapping::MappingEntry;
use powerlink::error_code::ErrorCode;
use powerlink::nmt::NmtState;
use powerlink::wire::node;
use std::fmt::Write as _;

pub use bus::service::{mac, object};

/// Most octets of a value that are printed.
const OCTETS_SHOWN: usize = 16;

/// Name of an NMT state, short enough for a column.
pub fn state(state: NmtState) -> String {
    match state {
        NmtState::Off => "Off".into(),
        NmtState::Initialising => "Initialising".into(),
        NmtState::ResetApplication => "ResetApp".into(),
        NmtState::ResetCommunication => "ResetComm".into(),
        NmtState::ResetConfiguration => "ResetConf".into(),
        NmtState::NotActive => "NotActive".into(),
        NmtState::PreOperational1 => "PreOp1".into(),
        NmtState::PreOperational2 => "PreOp2".into(),
        NmtState::ReadyToOperate => "ReadyToOp".into(),
        NmtState::Operational => "Operational".into(),
        NmtState::Stopped => "Stopped".into(),
        NmtState::BasicEthernet => "BasicEth".into(),
        NmtState::Unknown(octet) => format!("0x{octet:02X}?"),
    }
}

/// A node id as a person says it.
pub fn node_name(id: u8) -> String {
    match id {
        node::MN => "the managing node".into(),
        node::DIAGNOSTIC => "the diagnostic device (253)".into(),
        node::BROADCAST => "all nodes".into(),
        id => format!("node {id}"),
    }
}

/// A node id in a column.
pub fn node_column(id: u8) -> String {
    match id {
        node::BROADCAST => "all".into(),
        id => id.to_string(),
    }
}

/// `octet` or `octets`, `node` or `nodes`.
pub fn counted(count: impl Into<u64>, what: &str) -> String {
    match count.into() {
        1 => format!("1 {what}"),
        count => format!("{count} {what}s"),
    }
}

/// Octets as hexadecimal numbers; long ones are cut, and say so.
pub fn octets(octets: &[u8]) -> String {
    let mut text = String::new();
    for octet in octets.iter().take(OCTETS_SHOWN) {
        // Writing to a String does not fail.
        let _ = write!(text, "{}{octet:02x}", if text.is_empty() { "" } else { " " });
    }
    if octets.len() > OCTETS_SHOWN {
        let _ = write!(text, " ... ({} octets)", octets.len());
    }
    text
}

/// Value of an object, as told by its length: a number, a mapping entry, text, or octets.
pub fn value(index: u16, sub: u8, value: &[u8]) -> String {
    if let (true, Ok(entry)) = (is_mapping(index) && sub > 0, <[u8; 8]>::try_from(value)) {
        let entry = MappingEntry::from_u64(u64::from_le_bytes(entry));
        if entry.to_u64() == 0 {
            return "nothing".into();
        }
        let object = object(entry.index, entry.sub);
        return format!("{object}, {} bits at bit {}", entry.bit_length, entry.bit_offset);
    }
    match value.len() {
        0 => "nothing".into(),
        1 | 2 | 4 | 8 => {
            let mut wide = [0; 8];
            wide[..value.len()].copy_from_slice(value);
            match u64::from_le_bytes(wide) {
                small @ 0..10 => small.to_string(),
                number if is_signature(index) && value.len() == 4 => format!("0x{number:08X} ({})", text(value)),
                number => format!("{number} (0x{number:X})"),
            }
        }
        _ if is_text(value) => format!("{:?}", text(value)),
        _ => octets(value),
    }
}

fn is_mapping(index: u16) -> bool {
    matches!(index, 0x1600..=0x16FF | 0x1A00..=0x1AFF)
}

/// Store and restore take the words "save" and "load".
fn is_signature(index: u16) -> bool {
    matches!(index, 0x1010 | 0x1011)
}

/// Whether octets are printable text, zeros at the end aside.
pub fn is_text(octets: &[u8]) -> bool {
    let end = octets.iter().rposition(|octet| *octet != 0).map_or(0, |last| last + 1);
    end > 0 && octets[..end].iter().all(|octet| (0x20..0x7F).contains(octet))
}

/// Text without zeros at its end; what is not printable is escaped.
pub fn text(octets: &[u8]) -> String {
    let end = octets.iter().rposition(|octet| *octet != 0).map_or(0, |last| last + 1);
    octets[..end].escape_ascii().to_string()
}

/// Name of an object of the communication profile; empty for all others.
pub fn object_name(index: u16) -> &'static str {
    let series = match index {
        0x1400..=0x14FF => Some("RPDO communication"),
        0x1600..=0x16FF => Some("RPDO mapping"),
        0x1800..=0x18FF => Some("TPDO communication"),
        0x1A00..=0x1AFF => Some("TPDO mapping"),
        _ => None,
    };
    series.unwrap_or_else(|| named(&OBJECTS, index))
}

/// What an error code of an error entry or a ResetNode means; empty where the standard gives none.
pub fn error_name(code: u16) -> &'static str {
    ErrorCode::find(code).map_or("", |known| known.text)
}

/// Name of an object of the device profiles that drives and I/O have, with the axis of a device that has several; empty for all
/// others.
pub fn profile_object_name(index: u16) -> String {
    let (axis, of_first) = axis_of(index);
    match (named(&PROFILE_OBJECTS, of_first), axis) {
        ("", _) => String::new(),
        (name, 0) => name.to_owned(),
        (name, axis) => format!("{name} of axis {axis}"),
    }
}

/// Type of an object of the communication profile that its length does not tell.
pub fn object_type(index: u16, sub: u8) -> Option<DataType> {
    match (index, sub) {
        (0x1008..=0x100A | 0x1F9A, 0) | (0x1030, 2 | 6) => Some(DataType::VisibleString),
        (0x1030, 5) => Some(DataType::Mac),
        (0x1E40, 2 | 3 | 5) => Some(DataType::Ip),
        _ => None,
    }
}

fn named(table: &[(u16, &'static str)], number: u16) -> &'static str {
    table
        .iter()
        .find(|(own, _)| *own == number)
        .map_or("", |(_, name)| name)
}

/// (index, name): objects of CiA 401 and CiA 402 that are often mapped.
const PROFILE_OBJECTS: [(u16, &str); 20] = [
    (0x6000, "digital inputs"),
    (0x6200, "digital outputs"),
    (0x6401, "analogue inputs"),
    (0x6411, "analogue outputs"),
    (0x603F, "error code"),
    (0x6040, "controlword"),
    (0x6041, "statusword"),
    (0x6060, "mode of operation"),
    (0x6061, "mode displayed"),
    (0x6064, "actual position"),
    (0x606C, "actual velocity"),
    (0x6071, "target torque"),
    (0x6077, "actual torque"),
    (0x607A, "target position"),
    (0x60B1, "velocity offset"),
    (0x60B2, "torque offset"),
    (0x60F4, "following error"),
    (0x60FD, "digital inputs"),
    (0x60FE, "digital outputs"),
    (0x60FF, "target velocity"),
];

/// (index, name): objects of the communication profile.
pub const OBJECTS: [(u16, &str); 47] = [
    (0x1000, "device type"),
    (0x1001, "error register"),
    (0x1003, "error history"),
    (0x1006, "cycle length, us"),
    (0x1008, "device name"),
    (0x1009, "hardware version"),
    (0x100A, "software version"),
    (0x1010, "store parameters"),
    (0x1011, "restore parameters"),
    (0x1018, "identity"),
    (0x1020, "configuration date and time"),
    (0x1030, "network interface"),
    (0x1050, "relative latency"),
    (0x1101, "diagnostic counters"),
    (0x1102, "error counters"),
    (0x1300, "SDO time-out, ms"),
    (0x1C00, "CRC errors"),
    (0x1C02, "cycle time exceeded"),
    (0x1C07, "loss of PRes, total"),
    (0x1C08, "loss of PRes, counter"),
    (0x1C09, "loss of PRes, threshold"),
    (0x1C0A, "collisions"),
    (0x1C0B, "loss of SoC"),
    (0x1C0C, "loss of SoA"),
    (0x1C0D, "loss of PReq"),
    (0x1C0F, "CRC errors"),
    (0x1C14, "loss of SoC tolerance, ns"),
    (0x1E40, "IP address"),
    (0x1E4A, "IP group"),
    (0x1F22, "concise DCF"),
    (0x1F26, "expected configuration date"),
    (0x1F27, "expected configuration time"),
    (0x1F52, "application software date and time"),
    (0x1F80, "start-up"),
    (0x1F81, "node assignment"),
    (0x1F82, "feature flags"),
    (0x1F83, "POWERLINK version"),
    (0x1F84, "expected device type"),
    (0x1F8B, "PReq payload limit"),
    (0x1F8C, "NMT state"),
    (0x1F8D, "PRes payload limit"),
    (0x1F92, "PRes time-out, ns"),
    (0x1F93, "node id"),
    (0x1F98, "cycle timing"),
    (0x1F99, "basic Ethernet time-out, us"),
    (0x1F9A, "host name"),
    (0x1F9B, "multiplexed cycle"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_order_so_that_nothing_stands_twice() {
        assert!(OBJECTS.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!(object_name(0x1A05), "TPDO mapping");
        assert_eq!(object_name(0x2000), "");
        assert_eq!(profile_object_name(0x6041), "statusword");
        assert_eq!(profile_object_name(0x6841), "statusword of axis 1");
        assert_eq!(profile_object_name(0x2041), "");
        assert_eq!(error_name(0x8243), "too many answers to polls were missed");
    }

    #[test]
    fn values_by_their_length() {
        assert_eq!(value(0x1006, 0, &[0x10, 0x27, 0, 0]), "10000 (0x2710)");
        assert_eq!(value(0x1600, 0, &[1]), "1");
        // The mapping entry of the captures' controlled nodes.
        let entry = 0x0008_0000_0001_6200u64.to_le_bytes();
        assert_eq!(value(0x1600, 1, &entry), "0x6200/1, 8 bits at bit 0");
        assert_eq!(value(0x1600, 1, &[0; 8]), "nothing");
        assert_eq!(value(0x2000, 0, &entry), "2251799813775872 (0x8000000016200)");
        assert_eq!(value(0x1008, 0, b"drive\0"), "\"drive\"");
        assert_eq!(value(0x1011, 1, b"load"), "0x64616F6C (load)");
        assert_eq!(value(0x2000, 0, &[1, 2, 3]), "01 02 03");
        assert_eq!(value(0x2000, 0, &[]), "nothing");
        let long = octets(&[0xAB; 20]);
        assert!(long.ends_with("ab ... (20 octets)"), "{long}");
    }

    #[test]
    fn names_of_nodes_objects_and_addresses() {
        assert_eq!(
            (object(0x1006, 0), object(0x1018, 1)),
            ("0x1006".into(), "0x1018/1".into())
        );
        assert_eq!(mac([1, 0x11, 0x1E, 0, 0, 0xAB]), "01:11:1e:00:00:ab");
        assert_eq!(
            (counted(1u8, "octet"), counted(2u8, "octet")),
            ("1 octet".into(), "2 octets".into())
        );
        assert_eq!(node_name(3), "node 3");
        assert_eq!(node_column(255), "all");
    }
}
