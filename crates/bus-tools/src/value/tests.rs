use super::*;
use proptest::prelude::*;

#[test]
fn objects_as_people_write_them() {
    assert_eq!(object("0x1018:1"), Ok((0x1018, 1)));
    assert_eq!(object("0x1018/0x0a"), Ok((0x1018, 10)));
    assert_eq!(object("0X6040"), Ok((0x6040, 0)));
    for wrong in [
        "",
        "1018",
        "0x",
        "0x10180",
        "0x1018:",
        "0x1018:256",
        "0x1018:-1",
        "0x+1",
        "0x1018:+1",
        "x",
        "0x1018:1:2",
    ] {
        assert!(object(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn typed_values_to_octets() {
    for (text, data_type, octets) in [
        ("1", DataType::Bool, &[1][..]),
        ("true", DataType::Bool, &[1]),
        ("-2", DataType::I16, &[0xFE, 0xFF]),
        ("10000", DataType::U32, &[0x10, 0x27, 0, 0]),
        ("0x2710", DataType::U32, &[0x10, 0x27, 0, 0]),
        ("1.5", DataType::Real32, &[0, 0, 0xC0, 0x3F]),
        ("drive", DataType::VisibleString, b"drive"),
        ("0a1B", DataType::Domain, &[0x0A, 0x1B]),
        ("0a 1b", DataType::OctetString, &[0x0A, 0x1B]),
        ("02:00:00:00:00:ff", DataType::Mac, &[2, 0, 0, 0, 0, 0xFF]),
        // As captured: 192.168.100.1 is sent as 01 64 a8 c0.
        ("192.168.100.1", DataType::Ip, &[0x01, 0x64, 0xA8, 0xC0]),
        ("2.5", DataType::NetTime, &[2, 0, 0, 0, 5, 0, 0, 0]),
    ] {
        assert_eq!(encode(text, data_type).as_deref(), Ok(octets), "{text}");
    }
}

#[test]
fn what_does_not_fit_says_what_would() {
    for (text, data_type, expected) in [
        (
            "256",
            DataType::U8,
            "expected a whole number from 0 to 255 (u8), got \"256\"",
        ),
        (
            "-1",
            DataType::U16,
            "expected a whole number from 0 to 65535 (u16), got \"-1\"",
        ),
        (
            "0x",
            DataType::U8,
            "expected a whole number from 0 to 255 (u8), got \"0x\"",
        ),
        ("x", DataType::Real64, "expected a number (real64), got \"x\""),
        (
            "abc",
            DataType::Domain,
            "expected octets as pairs of hexadecimal digits, like 0a1b (domain), got \"abc\"",
        ),
        (
            "1.2.3",
            DataType::Ip,
            "expected an address like 192.168.100.1 (ip), got \"1.2.3\"",
        ),
    ] {
        assert_eq!(encode(text, data_type), Err(expected.to_owned()));
    }
    assert!(data_type("u33").unwrap_err().starts_with("expected one of bool, i8, "));
}

#[test]
fn values_by_type_and_by_guess() {
    for (octets, data_type, shown) in [
        (&[0x2D, 1, 0, 0][..], None, "301 (0x0000012D)"),
        (&[0xFE, 0xFF], None, "65534 or -2 (0xFFFE)"),
        (b"load", None, "1684107116 (0x64616F6C)  \"load\""),
        (b"x-drive\0", Some(DataType::VisibleString), "\"x-drive\""),
        (b"openPOWER", None, "\"openPOWER\""),
        (&[1, 2, 3], None, "01 02 03"),
        (&[], None, "empty"),
        (&[0xFE, 0xFF], Some(DataType::I16), "-2 (0xFFFE)"),
        (&[0x01, 0x64, 0xA8, 0xC0], Some(DataType::Ip), "192.168.100.1"),
        // The type does not fit: what came counts.
        (&[7], Some(DataType::U32), "7 (0x07)"),
    ] {
        assert_eq!(show(octets, data_type), shown);
    }
    assert_eq!(to_json(&[0xFF], None)["signed"], -1);
    assert_eq!(to_json(&[1, 2, 3], None)["unsigned"], Json::Null);
}

proptest! {
    #[test]
    fn nothing_panics_and_values_lead_there_and_back(octets in prop::collection::vec(any::<u8>(), 0..20), text in ".{0,12}") {
        for (name, own) in TYPES {
            prop_assert_eq!(data_type(name), Ok(own));
            prop_assert_eq!(type_name(own), name);
            let shown = show(&octets, Some(own));
            let _ = (encode(&text, own), object(&text), to_json(&octets, Some(own)));
            // What is printed as a number is read as one.
            if own.integer_range().is_some() && own != DataType::Ip && own != DataType::Bool && own.size() == Some(octets.len()) {
                let number = shown.split(' ').next().unwrap();
                prop_assert_eq!(encode(number, own), Ok(octets.clone()));
            }
        }
    }
}
