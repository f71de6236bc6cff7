use super::*;
use crate::mapping::Direction;
use crate::{Access, PdoAccess};
use proptest::prelude::*;
use std::format;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

const SERVO: &str = include_str!("../../tests/data/servo.xdc");
const IO: &str = include_str!("../../tests/data/io.xdd");
const TERMINAL: &str = include_str!("../../tests/data/terminal.dcf");

fn read(text: &str) -> DeviceDescription {
    parse("d", text.as_bytes()).unwrap()
}

fn mistakes(text: &str) -> Vec<String> {
    match parse("d", text.as_bytes()) {
        Ok(_) => Vec::new(),
        Err(errors) => errors.lines().collect(),
    }
}

/// Replaces the only occurrence.
fn changed(text: &str, old: &str, new: &str) -> String {
    assert_eq!(text.matches(old).count(), 1, "{old:?} stands once in the file");
    text.replace(old, new)
}

#[test]
fn an_xdc_is_read_whole() {
    let servo = read(SERVO);
    assert_eq!(servo.notes, []);
    assert_eq!(servo.node_id, Some(7));
    assert_eq!(
        servo.identity,
        DeviceIdentity {
            vendor_name: "Example Drives".into(),
            product_name: "ED-402".into(),
            device_type: Some(0x0002_0192),
            vendor_id: Some(0xFACE),
            product_code: Some(0x402),
            revision: Some(0x0001_0003),
        }
    );
    assert_eq!(
        servo.features,
        Features {
            feature_flags: Some(0x0001_0265),
            cycle_us_min: Some(200),
            cycle_us_max: Some(10_000),
            pres_latency_ns: Some(30_000),
            soc_to_preq_ns: Some(1000),
            preq_octets_max: Some(64),
            pres_octets_max: Some(64),
            multiplexing: Some(true),
            chaining: Some(false),
            rpdo_channels: Some(2),
            rpdo_objects: Some(8),
            tpdo_objects: Some(8),
        }
    );
    let window = servo.object(0x6065, 0).unwrap();
    assert_eq!(
        (window.name.as_str(), window.bits()),
        ("Following error window", Some(32))
    );
    assert_eq!((window.access, window.pdo), (Some(Access::ReadWrite), PdoAccess::No));
    assert_eq!(
        SERVO
            .lines()
            .nth(window.line as usize - 1)
            .unwrap()
            .matches("6065")
            .count(),
        1
    );
    let exponent = servo.object(0x60C2, 2).unwrap();
    assert_eq!(exponent.name, "Interpolation time period.Exponent");
    assert_eq!(exponent.octets(7), Some(vec![0xFD]));
    // `optional` and `default` leave the direction to who may write the object.
    assert_eq!(servo.object(0x606C, 0).unwrap().pdo, PdoAccess::Tpdo);
    assert_eq!(servo.object(0x60FE, 1).unwrap().pdo, PdoAccess::Both);
    // Everything about this object stands in the parameter that it refers to.
    let notch = servo.object(0x2040, 0).unwrap();
    assert_eq!((notch.bits(), notch.access), (Some(16), Some(Access::ReadWrite)));
    assert_eq!(notch.high.as_ref().and_then(Value::integer), Some(4000));
    assert_eq!(notch.octets(1), Some(vec![0x34, 0x03]));
    let mapped: Vec<_> = servo
        .mapping(0x1A00)
        .iter()
        .map(|entry| (entry.index, entry.bit_offset, entry.bit_length))
        .collect();
    assert_eq!(mapped, [(0x6041, 0, 16), (0x6064, 16, 32)]);
}

#[test]
fn a_dcf_is_read_whole() {
    let terminal = read(TERMINAL);
    assert_eq!(terminal.format, Format::Text);
    assert_eq!(terminal.node_id, Some(0x21));
    let identity = &terminal.identity;
    assert_eq!(
        (identity.vendor_id, identity.product_code, identity.revision),
        (Some(0xBEEF), Some(16), Some(0x10000))
    );
    assert_eq!(identity.device_type, Some(0x000F_0191));
    let filters: Vec<_> = terminal
        .subs(0x2000)
        .iter()
        .map(|object| (object.name.as_str(), object.octets(1).unwrap()))
        .collect();
    assert_eq!(
        filters,
        [
            ("Filter.NumberOfEntries", vec![3]),
            ("Filter.Filter1", vec![10, 0]),
            ("Filter.Slow filter", vec![0xF4, 0x01]),
            ("Filter.Filter3", vec![10, 0]),
        ]
    );
    assert_eq!(
        terminal.object(0x2001, 0).unwrap().octets(0x21),
        Some(vec![0xA1, 0x01, 0, 0])
    );
    let offset = terminal.object(0x2002, 0).unwrap();
    assert_eq!(
        offset.actual.as_ref().and_then(Value::integer),
        Some(-2),
        "24 bits, written as octets"
    );
    assert_eq!(offset.octets(1), Some(vec![0xFE, 0xFF, 0xFF]));
    assert_eq!(terminal.object(0x6200, 1).unwrap().pdo, PdoAccess::Rpdo);
    assert_eq!(terminal.object(0x6000, 1).unwrap().pdo, PdoAccess::Tpdo);
    let writes = terminal.stored_parameters(0x21).writes;
    let objects: Vec<_> = writes.iter().map(|write| (write.index, write.sub)).collect();
    assert_eq!(objects, [(0x2000, 2), (0x2002, 0)]);
}

#[test]
fn what_differs_from_the_defaults_is_written_mappings_off_first_and_on_last() {
    let stored = read(SERVO).stored_parameters(5);
    let write = |index, sub, value: &[u8]| ConfigurationWrite {
        index,
        sub,
        value: value.to_vec(),
    };
    assert_eq!(
        stored.writes,
        [
            write(0x1601, 0, &[0]),
            write(0x1401, 1, &[3]),
            write(0x2010, 1, &[250, 0]),
            write(0x2010, 3, &0.75_f32.to_le_bytes()),
            write(0x2010, 4, &[0xFE, 0xFF]),
            write(0x2020, 0, &[0x45]),
            write(0x2040, 0, &[0x34, 0x03]),
            write(0x1601, 1, &[0x10, 0x20, 0x02, 0, 8, 0, 16, 0]),
            write(0x1601, 0, &[1]),
        ]
    );
    assert_eq!(stored.left_to_managing_node, [(0x1C14, 0)]);
    assert_eq!(stored.not_writable, [(0x2030, 0)]);
    assert_eq!(read(IO).stored_parameters(5), StoredParameters::default());
}

#[test]
fn a_mapping_is_taken_or_refused_with_the_reason() {
    let servo = read(SERVO);
    let refusal = |index, sub, bits, direction| servo.may_map(index, sub, bits, direction).unwrap_err().to_string();
    assert_eq!(
        servo.may_map(0x6040, 0, 16, Direction::Receive).unwrap().name,
        "Controlword"
    );
    assert_eq!(
        refusal(0x6042, 0, 16, Direction::Receive),
        "the device has no such object"
    );
    assert_eq!(
        refusal(0x60FE, 3, 32, Direction::Receive),
        "the device has no such sub-index; it has 0, 1, 2"
    );
    assert_eq!(refusal(0x6040, 0, 32, Direction::Receive), "Controlword has 16 bits");
    let only = refusal(0x6040, 0, 16, Direction::Transmit);
    assert_eq!(only, "Controlword can only be mapped into what the device receives");
    let only = refusal(0x6041, 0, 16, Direction::Receive);
    assert_eq!(only, "Statusword can only be mapped into what the device sends");
    assert_eq!(
        refusal(0x6065, 0, 32, Direction::Receive),
        "Following error window cannot be mapped"
    );
}

/// Text to replace, its replacement, what stands at the place of the mistake, and the mistake.
type Case = (&'static str, &'static str, &'static str, &'static str);

fn check(text: &str, cases: &[Case]) {
    for (old, new, marker, expected) in cases {
        let text = changed(text, old, new);
        let at = text.find(marker).unwrap();
        let line = 1 + text[..at].matches('\n').count();
        let column = 1 + text[..at]
            .lines()
            .last()
            .filter(|_| !text[..at].ends_with('\n'))
            .map_or(0, |line| line.chars().count());
        assert_eq!(
            mistakes(&text),
            [format!("d:{line}:{column}{expected}")],
            "{new:?} for {old:?}"
        );
    }
}

#[test]
#[rustfmt::skip] // one case a line
fn each_mistake_of_an_xdd_has_its_place() {
    check(SERVO, &[
        ("index=\"6040\"", "index=\"0x40\"", "0x40\" name", ": object index = \"0x40\": expected 4 hex digits"),
        ("index=\"6040\"", "index=\"6041\"", "6041\" name=\"Status", ": object 0x6041: stands twice in the file"),
        ("index=\"6040\"", "", "<Object  name=\"Control", ": object index: is missing"),
        ("Controlword\" objectType=\"7\" dataType=\"0006\"", "Controlword\" objectType=\"7\"", "<Object index=\"6040\"", ": object 0x6040 dataType: is missing"),
        ("Controlword\" objectType=\"7\"", "Controlword\" objectType=\"4\"", "4\" dataType", ": object 0x6040 objectType = \"4\": expected 0, 2, 5, 6, 7, 8 or 9"),
        ("actualValue=\"250\"", "actualValue=\"2500\"", "2500\"", ": object 0x2010:1 actualValue = \"2500\": expected a value within the limits, from 1 to 1000"),
        ("actualValue=\"250\"", "actualValue=\"x\"", "x\" lowLimit=\"1\"", ": object 0x2010:1 actualValue = \"x\": expected an integer from 0 to 65535, decimal or with 0x"),
        ("actualValue=\"250\"", "actualValue=\"025\"", "025\"", ": object 0x2010:1 actualValue = \"025\": expected an integer from 0 to 65535, decimal or with 0x"),
        ("actualValue=\"0.75\"", "actualValue=\"1e99\"", "1e99", ": object 0x2010:3 actualValue = \"1e99\": expected a finite number"),
        ("lowLimit=\"1\"", "lowLimit=\"2000\"", "1000\"/>\n            <SubObject subIndex=\"02\" name=\"Feed", ": object 0x2010:1 highLimit = \"1000\": expected at least the low limit 2000"),
        ("$NODEID+0x40", "$NODEID-1", "$NODEID-1", ": object 0x2020 actualValue = \"$NODEID-1\": expected $NODEID, $NODEID+number or number+$NODEID"),
        ("uniqueIDRef=\"UID_NOTCH\"", "uniqueIDRef=\"UID\" dataType=\"0006\"", "UID\" dataType", ": object 0x2040 uniqueIDRef = \"UID\": expected the uniqueID of a parameter of this file"),
        ("PDOmapping=\"optional\"/>\n          <Object index=\"607A\"", "PDOmapping=\"yes\"/>\n          <Object index=\"607A\"", "yes\"/>", ": object 0x606C PDOmapping = \"yes\": expected no, default, optional, RPDO or TPDO"),
        ("NMTCycleTimeMin=\"200\"", "NMTCycleTimeMin=\"fast\"", "fast\"", ": GeneralFeatures NMTCycleTimeMin = \"fast\": expected an integer from 0 to 4294967295"),
        ("DLLCNPResChaining=\"false\"", "DLLCNPResChaining=\"no\"", "no\" NMTCN", ": CNFeatures DLLCNPResChaining = \"no\": expected true or false"),
        ("<vendorID>0x0000FACE", "<vendorID>FACE", "<vendorID>", ": vendorID = \"FACE\": expected an integer from 0 to 4294967295, decimal or with 0x"),
        ("<ObjectList>", "<ObjectList></ObjectList><ObjectList>", "<ObjectList>\n", ": ObjectList: expected one list of objects only"),
    ]);
}

#[test]
#[rustfmt::skip] // one case a line
fn each_mistake_of_an_eds_has_its_place() {
    check(TERMINAL, &[
        ("[1018sub1]", "[1018sub1", "[1018sub1", " = \"[1018sub1\": expected a section, like [1018sub1]"),
        ("[1018sub1]\n", "[1018sub0]\n", "[1018sub0]\nParameterName=Vendor", ": section [1018sub0]: stands twice in the file"),
        ("[6200]", "[6201]", "[6200sub0]", ": object 0x6200:0: expected a section [6200] for the object itself"),
        ("AccessType=rww", "AccessType=rx", "rx", ": object 0x6200:1 accesstype = \"rx\": expected const, ro, wo, rw, rwr or rww"),
        ("2=500", "2=5000", "5000", ": object 0x2000:2 actualValue = \"5000\": expected a value within the limits, from 0 to 1000"),
        ("=0xFFFFFE", "=0x1FFFFFE", "0x1FFFFFE", ": object 0x2002 parametervalue = \"0x1FFFFFE\": expected an integer from -8388608 to 8388607, decimal or with 0x"),
        ("NodeID=0x21", "NodeID=260", "260", ": [devicecomissioning] nodeid = \"260\": expected an integer from 0 to 239, decimal or with 0x"),
        ("NrOfTXPDO=1", "NrOfTXPDO", "NrOfTXPDO", " = \"NrOfTXPDO\": expected key=value"),
        ("DefaultValue=10\n", "DefaultValue=10\nDefaultValue=11\n", "DefaultValue=11", ": key DefaultValue: stands twice in its section"),
        ("ObjectType=0x8\nDataType=0x0006", "ObjectType=0x8", "[2000]", ": object 0x2000 datatype: is missing"),
    ]);
}

#[test]
fn all_mistakes_come_together_in_the_order_of_the_file_and_are_limited() {
    let two = changed(
        &changed(SERVO, "actualValue=\"250\"", "actualValue=\"x\""),
        "NMTCycleTimeMin=\"200\"",
        "NMTCycleTimeMin=\"\u{b5}\"",
    );
    let two = mistakes(&two);
    assert_eq!(two.len(), 2);
    assert!(
        two[0].contains("0x2010:1") && two[1].contains("NMTCycleTimeMin"),
        "{two:?}"
    );
    let many = format!("[1000]\nDataType=7\n{}", "x\n".repeat(250));
    let errors = parse("d", many.as_bytes()).unwrap_err();
    assert_eq!((errors.mistakes.len(), errors.more), (100, 150));
    assert!(errors.to_string().ends_with("\nd: 150 more mistakes"));
}

#[test]
fn a_default_outside_its_limits_is_odd_but_no_reason_to_refuse_a_device() {
    let text = changed(
        SERVO,
        "defaultValue=\"100\" actualValue=\"250\"",
        "defaultValue=\"0\" actualValue=\"250\"",
    );
    let notes = read(&text).notes;
    assert_eq!(notes.len(), 1);
    assert_eq!(notes[0].subject, "object 0x2010:1 defaultValue");
    assert_eq!(notes[0].rule, "expected a value within the limits, from 1 to 1000");
}

#[test]
fn any_text_may_stand_as_the_default_of_octets_but_not_as_what_is_written() {
    let octets = |key: &str| format!("{TERMINAL}\n[2003]\nDataType=0x000A\nAccessType=rw\n{key}=@ABCD\n");
    let default = read(&octets("DefaultValue"));
    assert_eq!(default.notes.len(), 1);
    assert_eq!(default.object(0x2003, 0).unwrap().octets(1), None);
    let actual = mistakes(&octets("ParameterValue"));
    assert_eq!(actual.len(), 1);
    assert!(
        actual[0].ends_with("object 0x2003 parametervalue = \"@ABCD\": expected octets as pairs of hex digits"),
        "{actual:?}"
    );
    let xml = "name=\"SerialText\" objectType=\"7\" dataType=\"0009\"";
    assert_eq!(read(&changed(SERVO, xml, &xml.replace("0009", "000A"))).notes, []);
    let text = changed(SERVO, xml, &xml.replace("0009", "000A")).replace("defaultValue=\"A1\"", "defaultValue=\"?\"");
    assert_eq!(read(&text).notes.len(), 1);
}

#[test]
fn what_is_no_device_description_is_refused() {
    assert_eq!(mistakes(""), ["d: expected a device description, is empty"]);
    assert_eq!(mistakes("\u{feff} \n"), ["d: expected a device description, is empty"]);
    assert_eq!(
        mistakes("<a/>"),
        ["d:1:1: root element = \"a\": expected ISO15745ProfileContainer"]
    );
    assert_eq!(
        mistakes("<ISO15745ProfileContainer/>"),
        ["d:1:1: ObjectList: is missing: the objects of the device"]
    );
    assert_eq!(
        mistakes("[FileInfo]\n"),
        ["d:2:1: expected at least one object, like [1000]"]
    );
    assert!(mistakes("<a>\n<b></a>")[0].starts_with("d:2:4: expected XML: "));
    let utf_16 = parse("d", &[0xFF, 0xFE, b'<', 0]).unwrap_err();
    assert_eq!(utf_16.to_string(), "d: expected UTF-8 or ISO 8859-1, is UTF-16");
    let long = vec![b' '; FILE_OCTETS_MAX + 1];
    assert_eq!(
        parse("d", &long).unwrap_err().mistakes[0].rule,
        "expected at most 16777216 octets, is 16777217 octets long"
    );
    let deep = "<ISO15745ProfileContainer>".repeat(200_000) + &"</ISO15745ProfileContainer>".repeat(200_000);
    assert!(
        mistakes(&deep)[0].ends_with("expected at most 64 elements inside each other"),
        "{:?}",
        mistakes(&deep)
    );
    // As many attributes as fit were compared with each other: ten minutes for a file of the greatest length.
    let attributes: String = (0..500_000).map(|number| std::format!(" a{number}='>'")).collect();
    let crowded = std::format!(
        "<!-- {} --><ISO15745ProfileContainer{attributes}/>",
        "a='b' ".repeat(300)
    );
    assert_eq!(
        mistakes(&crowded),
        ["d:1:1810: expected at most 256 attributes of an element"]
    );
    let names: String = (0..1001).map(|number| std::format!("<a xmlns='{number}'/>")).collect();
    assert_eq!(
        mistakes(&std::format!(
            "<ISO15745ProfileContainer>{names}</ISO15745ProfileContainer>"
        )),
        ["d:1:1: expected at most 1000 declarations of namespaces"]
    );
    let bomb = "<!DOCTYPE a [<!ENTITY b \"bb\">]><ISO15745ProfileContainer>&b;</ISO15745ProfileContainer>";
    assert!(mistakes(bomb)[0].contains("expected XML: "), "{:?}", mistakes(bomb));
}

#[test]
fn old_tools_write_iso_8859_1() {
    let octets = changed(TERMINAL, "ET-16", "ET-\u{0}")
        .replace('\u{0}', "\u{7f}")
        .into_bytes();
    let octets: Vec<u8> = octets
        .iter()
        .map(|octet| if *octet == 0x7F { 0xB5 } else { *octet })
        .collect();
    assert_eq!(parse("d", &octets).unwrap().identity.product_name, "ET-\u{b5}");
}

#[test]
#[rustfmt::skip] // one case a line
fn values_become_the_octets_of_their_type() {
    let cases: [(&str, u16, Option<&[u8]>); 26] = [
        ("true", 0x0001, Some(&[1])), ("0", 0x0001, Some(&[0])), ("2", 0x0001, None),
        ("-1", 0x0002, Some(&[0xFF])), ("0xFF", 0x0002, Some(&[0xFF])), ("0x100", 0x0002, None), ("128", 0x0002, None),
        ("-32768", 0x0003, Some(&[0, 0x80])), ("0xFFFFFFFE", 0x0004, Some(&[0xFE, 0xFF, 0xFF, 0xFF])),
        ("255", 0x0005, Some(&[0xFF])), ("-1", 0x0005, None), ("08", 0x0005, None), ("00", 0x0005, Some(&[0])),
        ("+5", 0x0005, None), ("5 ", 0x0005, Some(&[5])), ("0x", 0x0005, None), ("5.0", 0x0005, None),
        ("0xFFFFFFFFFFFFFFFF", 0x001B, Some(&[0xFF; 8])), ("0x10000000000000000", 0x001B, None),
        ("0.5", 0x0008, Some(&[0, 0, 0, 0x3F])), ("0x3F000000", 0x0008, Some(&[0, 0, 0, 0x3F])), ("inf", 0x0008, None),
        ("192.168.100.1", 0x0402, Some(&[1, 0x64, 0xA8, 0xC0])), ("00:0a-0B 0c0D0e", 0x0401, Some(&[0, 10, 11, 12, 13, 14])),
        ("\u{b5}m", 0x0009, Some(&[0xC2, 0xB5, b'm'])), ("abc", 0x000A, None),
    ];
    for (text, code, expected) in cases {
        let value = Value::parse(text, Some(TypeCode(code))).ok().and_then(|value| value.octets(1));
        assert_eq!(value.as_deref(), expected, "{text:?} of type {code:#06x}");
    }
    let sum = Value::parse("0xF0+$NODEID", Some(TypeCode(5))).unwrap();
    assert_eq!((sum.octets(15), sum.octets(16), sum.integer()), (Some(vec![0xFF]), None, None));
    let own = Value::parse("anything", Some(TypeCode(0x0040))).unwrap();
    assert_eq!(own.octets(1), None, "a type that only the file defines");
}

proptest! {
    #[test]
    fn any_octets_are_refused_without_panic(octets in prop::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(parse("d", &octets).is_err());
    }

    #[test]
    fn a_mutilated_file_never_panics(
        which in 0usize..3, at in 0usize..20_000, drop in 0usize..60, put in "[<>\\[\\]/\"=$;#\\na-z0-9. µ]{0,8}",
    ) {
        let text = [SERVO, IO, TERMINAL][which].as_bytes();
        let at = at % text.len();
        let end = (at + drop).min(text.len());
        let mutilated = [&text[..at], put.as_bytes(), &text[end..]].concat();
        match parse("d", &mutilated) {
            Ok(description) => {
                for node in [0, 1, 255] {
                    description.stored_parameters(node);
                }
                description.mapping(0x1600);
                let _ = description.may_map(0x6040, 0, 16, Direction::Receive);
            }
            Err(errors) => {
                prop_assert!(errors.mistakes.iter().all(|mistake| !mistake.rule.contains("was lost")), "{}", errors);
                prop_assert!(errors.mistakes.iter().all(|mistake| mistake.place.is_some()), "{}", errors);
            }
        }
    }

    #[test]
    fn a_truncated_xdd_is_refused(at in 0..IO.trim_end().len()) {
        prop_assert!(parse("d", &IO.as_bytes()[..at]).is_err());
    }

    #[test]
    fn any_value_of_any_type_is_read_or_refused(text in "[$NODEIDnodeidxX0-9a-f+. -]{0,24}", code in 0u16..0x404) {
        if let Ok(value) = Value::parse(&text, Some(TypeCode(code)))
            && let Some(octets) = value.octets(255)
            && let Some(bits) = TypeCode(code).bits()
        {
            prop_assert_eq!(octets.len(), usize::from(bits) / 8);
        }
    }
}
