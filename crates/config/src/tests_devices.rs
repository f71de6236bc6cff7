//! Device files and what stands beside them: one case per rule.

use super::tests::{changed, check, messages};
use super::*;
use obd::PdoAccess;

/// A node with a device file; `cargo test` runs in the folder above `obd`.
const SERVO: &str = "id = 1\nprofile = \"cia402\"\ndevice_file = \"../../obd/tests/data/servo.xdc\"";
const IO: &str = "id = 2\nprofile = \"io\"\ndevice_file = \"../../obd/tests/data/io.xdd\"";

/// The small machine with these two nodes.
fn machine(servo: &str, io: &str) -> String {
    changed("id = 1\nprofile = \"cia402\"", servo).replace("id = 2\nprofile = \"io\"", io)
}

fn read(text: &str) -> Config {
    parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// Messages about the first node with `lines` behind its device file, without the place, which is always its own line.
fn of_servo(lines: &str) -> Vec<String> {
    let text = machine(&format!("{SERVO}\n{lines}"), IO);
    let rows = 9 + lines.matches('\n').count();
    messages(&text)
        .into_iter()
        .map(|message| {
            let (place, rest) = message
                .split_once(": bus.node[0].")
                .unwrap_or_else(|| panic!("{message}"));
            let line: usize = place.split(':').nth(1).unwrap().parse().unwrap();
            assert!((6..=rows + 1).contains(&line), "{message}");
            rest.to_owned()
        })
        .collect()
}

#[test]
fn a_device_file_fills_in_what_the_machine_file_leaves_out() {
    let config = read(&machine(SERVO, IO));
    let [servo, io] = &config.bus.nodes[..] else {
        panic!("two nodes")
    };
    let identity = Identity {
        device_type: Some(0x0002_0192),
        vendor_id: Some(0xFACE),
        product_code: Some(0x402),
        revision: None,
        serial: None,
    };
    assert_eq!(servo.identity, identity);
    // 30 us latency, 6.72 us on the wire, 100 us for this side.
    assert_eq!((servo.pres_timeout_us, io.pres_timeout_us), (137, 147));
    let objects = |list: &[Mapped]| list.iter().map(Mapped::to_string).collect::<Vec<_>>();
    assert_eq!(objects(&servo.outputs), ["0x6040/16", "0x607A/32"]);
    assert_eq!(objects(&servo.inputs), ["0x6041/16", "0x6064/32"]);
    assert_eq!(objects(&io.outputs), ["0x6200:1/8"]);
    assert_eq!(objects(&io.inputs), ["0x6000:1/8", "0x6401:1/16"]);
    let device = servo.device.as_ref().unwrap();
    assert_eq!(device.object(0x6040, 0).unwrap().pdo, PdoAccess::Rpdo);
}

#[test]
fn keys_of_a_node_and_of_the_bus_arrive() {
    let bus = "kind = \"memory\"\nmultiplex_cycles = 4\nasync_mtu = 300\nprescaler = 10\nstartup = [\"check-identity\", \"reset-all-on-error\"]";
    let servo = format!(
        "{SERVO}\nmultiplex = 3\npdo_version = 0x10\nsoftware_date = 15000\nsoftware_time = 1000\nsdo = [{{ object = \"0x2010:1\", value = 300 }}, {{ object = \"0x2010:3\", value = 0.25 }}]"
    );
    let io = format!("{IO}\nchained = true");
    let config = read(&machine(&servo, &io).replace("kind = \"memory\"", bus));
    let bus = &config.bus;
    assert_eq!((bus.multiplex_cycles, bus.async_mtu, bus.prescaler), (4, 300, 10));
    assert_eq!(bus.startup, Some(1 << 9 | 1 << 4));
    let servo = &bus.nodes[0];
    assert_eq!((servo.exchange, servo.pdo_version), (Exchange::Multiplexed(3), 0x10));
    assert_eq!(
        servo.software,
        Some(Stamp {
            date: 15_000,
            time: 1000
        })
    );
    let write = |sub, value: &[u8]| ConfigurationWrite {
        index: 0x2010,
        sub,
        value: value.to_vec(),
    };
    assert_eq!(
        servo.writes,
        [write(1, &[0x2C, 0x01]), write(3, &0.25_f32.to_le_bytes())]
    );
    assert_eq!(bus.nodes[1].exchange, Exchange::Chained);
    assert_eq!(read(&machine(SERVO, IO)).bus.startup, None);
}

#[test]
fn the_link_is_raw_unless_another_is_chosen() {
    let link = |key: &str| {
        let bus = format!("kind = \"powerlink\"\ninterface = \"eth1\"\n{key}");
        read(&changed("kind = \"memory\"", &bus)).bus.link
    };
    assert_eq!(link(""), BusLink::Raw);
    assert_eq!(link("link = \"raw\""), BusLink::Raw);
    assert_eq!(link("link = \"pnet\""), BusLink::Pnet);
    let in_memory = changed("kind = \"memory\"", "kind = \"memory\"\nlink = \"raw\"");
    assert_eq!(read(&in_memory).bus.link, BusLink::Raw);
}

#[test]
fn cross_traffic_finds_its_nodes() {
    let servo =
        format!("{SERVO}\nname = \"x\"\ncross = [{{ from = \"io\", read = \"0x6401:1/16\", into = \"0x2010:2/16\" }}]");
    let config = read(&machine(&servo, &format!("{IO}\nname = \"io\"")));
    let object = |index, sub| Mapped { index, sub, bits: 16 };
    assert_eq!(
        config.bus.nodes[0].cross,
        [Cross {
            from: 1,
            read: object(0x6401, 1),
            into: object(0x2010, 2)
        }]
    );
}

#[test]
fn the_longest_asnd_follows_the_slot_where_it_is_left_out() {
    let mtu = |slot: &str| {
        read(&changed("kind = \"memory\"", &format!("kind = \"memory\"\n{slot}")))
            .bus
            .async_mtu
    };
    assert_eq!(mtu(""), 1500);
    // 1250 octets of 80 ns: 1212 of them are ASnd, 38 stand around it.
    assert_eq!(mtu("async_slot_timeout_us = 100"), 1212);
    assert_eq!(mtu("async_slot_timeout_us = 5"), 300);
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_the_network() {
    let memory = "\"memory\"";
    check(&[
        (memory, "\"memory\"\nasync_mtu = 299", &["m.toml:6:13: bus.async_mtu = 299: must be an integer from 300 to 1500"]),
        (memory, "\"memory\"\nasync_mtu = 1500\nasync_slot_timeout_us = 120", &[
            "m.toml:6:13: bus.async_mtu = 1500: takes 124 us on the wire, async_slot_timeout_us leaves 120",
        ]),
        (memory, "\"memory\"\nlink = \"pnet\"", &["m.toml:6:8: bus.link = \"pnet\": needs a bus on a network interface"]),
        (memory, "\"powerlink\"\ninterface = \"eth1\"\nlink = \"pcap\"", &["m.toml:7:8: bus.link = \"pcap\": must be \"raw\" or \"pnet\""]),
        (memory, "\"memory\"\nprescaler = 1001", &["m.toml:6:13: bus.prescaler = 1001: must be an integer from 0 to 1000"]),
        (memory, "\"memory\"\nmultiplex_cycles = 255", &["m.toml:6:20: bus.multiplex_cycles = 255: must be an integer from 0 to 254"]),
        (memory, "\"memory\"\nstartup = [\"check-idendity\"]", &[
            "m.toml:6:12: bus.startup[0] = \"check-idendity\": must be one of start-all-by-broadcast, reset-all-on-error, stop-all-on-error, check-identity, check-software, check-configuration, no-return-to-preop1; did you mean \"check-identity\"?",
        ]),
        (memory, "\"memory\"\nstartup = [\"no-auto-operational\", \"redundancy\", 9]", &[
            "m.toml:6:12: bus.startup[0] = \"no-auto-operational\": is refused: bit 2 of 0x1F80 is not served, the control always lets the network go on by itself",
            "m.toml:6:35: bus.startup[1] = \"redundancy\": is refused: bit 14 of 0x1F80 is not served, there is one managing node",
            "m.toml:6:49: bus.startup[2] = 9: must be a string, is an integer",
        ]),
        ("profile = \"io\"", "profile = \"io\"\nmultiplex = 2", &[
            "m.toml:12:13: bus.node[1].multiplex = 2: needs bus.multiplex_cycles, the number of cycles of a round",
        ]),
        ("profile = \"io\"", "profile = \"io\"\nmultiplex = 0", &["m.toml:12:13: bus.node[1].multiplex = 0: must be an integer from 1 to 254"]),
        ("profile = \"io\"", "profile = \"io\"\nchained = true\nasync_only = true", &[
            "m.toml:12:11: bus.node[1].chained = true: cannot stand together: multiplex, chained and async_only exclude each other",
        ]),
        ("profile = \"io\"", "profile = \"io\"\nasync_only = true\ninputs = []", &[
            "m.toml:13:10: bus.node[1].inputs = []: cannot stand beside async_only: such a node has no process data",
        ]),
        ("profile = \"cia402\"", "profile = \"cia402\"\nasync_only = true", &[
            "m.toml:9:14: bus.node[0].async_only = true: cannot be: a drive is not run without process data",
        ]),
        ("profile = \"io\"", "profile = \"io\"\nsoftware_date = 1", &[
            "m.toml:9:1: bus.node[1].software_time: is missing: software_date is only checked together with it",
        ]),
        ("profile = \"io\"", "profile = \"io\"\nsdo = 5", &["m.toml:12:7: bus.node[1].sdo = 5: must be an array of tables: [[bus.node[1].sdo]], is an integer"]),
        ("profile = \"io\"", "profile = \"io\"\nsdo = [{ object = \"0x2010\", value = 256, bits = 8 }, { object = \"0x2010\", value = 1 }]", &[
            "m.toml:12:37: bus.node[1].sdo[0].value = 256: must be an integer from -128 to 255",
            "m.toml:12:54: bus.node[1].sdo[1].bits: is missing: the length of the object, which no device file tells",
        ]),
        ("profile = \"io\"", "profile = \"io\"\nsdo = [{ object = \"0x1006\", value = 1, bits = 32 }, { object = \"2010\", value = 1, bits = 8 }, { object = \"0x2010\", value = 0.5, bits = 32, bit = 1 }]", &[
            "m.toml:12:19: bus.node[1].sdo[0].object = \"0x1006\": is set by the control from the other keys of this file",
            "m.toml:12:64: bus.node[1].sdo[1].object = \"2010\": must be an object, like \"0x2010:3\" or \"0x6065\"",
            "m.toml:12:124: bus.node[1].sdo[2].value = 0.5: must be an integer: no device file says that it is a real number",
            "m.toml:12:140: bus.node[1].sdo[2].bit: unknown key; did you mean `bits`?",
        ]),
        ("profile = \"io\"", "profile = \"io\"\nsdo = [{ object = \"0x2010\", value = 1, bits = 12 }, { object = \"0x2011\", value = 1, bits = 8 }, { object = \"0x2011:0\", value = 1, bits = 8 }]", &[
            "m.toml:12:47: bus.node[1].sdo[0].bits = 12: must be whole octets",
            "m.toml:12:108: bus.node[1].sdo[2].object = \"0x2011:0\": is written by an entry above",
        ]),
        ("profile = \"io\"", "profile = \"io\"\ncross = [{ from = \"node-2\", read = \"0x6064/32\", into = \"0x2000/32\" }, { from = \"nod-1\", read = \"0x6064/32\", into = \"0x2000/32\" }, { from = \"node-1\", read = \"0x6065/32\", into = \"0x2000/32\" }, { from = \"node-1\", read = \"0x6064/32\", into = \"0x6200:1/8\" }, { from = \"node-1\", read = \"0x6064/32\" }]", &[
            "m.toml:12:254: bus.node[1].cross[4].into: is missing: the object of this node that takes it, like \"0x2010:1/32\"",
        ]),
        ("profile = \"io\"", "profile = \"io\"\ncross = [{ from = \"node-2\", read = \"0x6064/32\", into = \"0x2000/32\" }, { from = \"nod-1\", read = \"0x6064/32\", into = \"0x2000/32\" }, { from = \"node-1\", read = \"0x6065/32\", into = \"0x2000/32\" }, { from = \"node-1\", read = \"0x6064/32\", into = \"0x6200:1/8\" }, { from = \"node-1\", read = \"0x6064/32\", into = \"0x2000/16\" }]", &[
            "m.toml:12:19: bus.node[1].cross[0].from = \"node-2\": must be another node",
            "m.toml:12:80: bus.node[1].cross[1].from = \"nod-1\": must be the name of a node; did you mean \"node-1\"?",
            "m.toml:12:157: bus.node[1].cross[2].read = \"0x6065/32\": must stand among the inputs of node-1: 0x6041/16, 0x6061/8, 0x60FD/32, 0x603F/16, 0x6064/32, 0x60F4/32",
            "m.toml:12:238: bus.node[1].cross[3].into = \"0x6200:1/8\": is mapped twice",
            "m.toml:12:300: bus.node[1].cross[4].into = \"0x2000/16\": must have the length of what is read, 32 bits",
        ]),
    ]);
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_a_device_file() {
    let file = "../../obd/tests/data/servo.xdc";
    let cases: [(&str, &[&str]); 14] = [
        ("vendor_id = 1", &["vendor_id = 1: must be what ../../obd/tests/data/servo.xdc says: 0x0000FACE"]),
        ("vendor_id = 0xFACE", &[]),
        ("outputs = [\"0x6040/16\", \"0x607A/32\", \"0x6071/16\"]", &["outputs[2] = \"0x6071/16\": does not fit ../../obd/tests/data/servo.xdc: the device has no such object"]),
        ("outputs = [\"0x6040/16\", \"0x607A/32\", \"0x60FE:3/32\"]", &["outputs[2] = \"0x60FE:3/32\": does not fit ../../obd/tests/data/servo.xdc: the device has no such sub-index; it has 0, 1, 2"]),
        ("outputs = [\"0x6040/16\", \"0x607A/32\", \"0x6041/16\"]", &["outputs[2] = \"0x6041/16\": does not fit ../../obd/tests/data/servo.xdc: Statusword can only be mapped into what the device sends"]),
        ("outputs = [\"0x6040/16\", \"0x607A/32\", \"0x2010:2/32\"]", &["outputs[2] = \"0x2010:2/32\": does not fit ../../obd/tests/data/servo.xdc: Tuning.FeedForward has 16 bits"]),
        ("outputs = [\"0x6040/16\", \"0x607A/32\", \"0x6065/32\"]", &["outputs[2] = \"0x6065/32\": does not fit ../../obd/tests/data/servo.xdc: Following error window cannot be mapped"]),
        ("pres_timeout_us = 36", &["pres_timeout_us = 36: must be at least 37: by ../../obd/tests/data/servo.xdc the device may take 30000 ns, its PRes 6720 ns on the wire"]),
        ("chained = true", &["chained = true: is not for this device: ../../obd/tests/data/servo.xdc says DLLCNPResChaining=\"false\""]),
        ("sdo = [{ object = \"0x2011\", value = 1 }]", &["sdo[0].object = \"0x2011\": does not stand in ../../obd/tests/data/servo.xdc"]),
        ("sdo = [{ object = \"0x6041\", value = 1 }]", &["sdo[0].object = \"0x6041\": cannot be written: Statusword is read only"]),
        ("sdo = [{ object = \"0x2010:1\", value = 1, bits = 32 }]", &["sdo[0].bits = 32: must be 16, the length that the device file gives it"]),
        ("sdo = [{ object = \"0x2010:1\", value = 1001 }]", &["sdo[0].value = 1001: must be an integer from 1 to 1000"]),
        ("sdo = [{ object = \"0x2010:3\", value = \"x\" }]", &["sdo[0].value = \"x\": must be a number, is a string"]),
    ];
    for (lines, expected) in cases {
        assert_eq!(of_servo(lines), expected, "{lines}");
    }
    // An RPDO of this device takes at most 8 objects of at most 64 octets.
    let nine = "outputs = [\"0x6040/16\", \"0x607A/32\", \"0x60FE:1/32\", \"0x6060/8\", \"0x2010:2/16\"]";
    assert_eq!(of_servo(nine), [""; 0]);
    let text = machine(SERVO, IO).replace(file, "../../obd/tests/data/none.xdc");
    let text = text.replace("name = \"small\"", "name = \"small\"\ncycle_us = 300");
    assert_eq!(messages(&text), [
        "m.toml:10:15: bus.node[0].device_file = \"../../obd/tests/data/none.xdc\": cannot be read: No such file or directory (os error 2)",
        "m.toml:14:15: bus.node[1].device_file = \"../../obd/tests/data/io.xdd\": describes a device for cycles from 400 to 10000 us, machine.cycle_us is 300",
    ]);
    let text = changed("id = 1\nprofile = \"cia402\"", "id = 1\nprofile = \"cia402\"\ndevice_file = \"../../obd/tests/data/io.xdd\"");
    let unfit = |key: &str, object: &str| format!("m.toml:6:1: bus.node[0].{key}: is missing: of what the profile usually has, {object} does not fit ../../obd/tests/data/io.xdd: the device has no such object");
    let expected: Vec<String> = ["0x6040/16", "0x6060/8", "0x60FE:1/32", "0x607A/32"].map(|object| unfit("outputs", object)).into();
    assert_eq!(messages(&text)[..4], expected);
}

#[test]
fn reactions_of_a_drive_are_those_that_its_device_file_offers() {
    let with = |line: &str| {
        machine(SERVO, IO).replace("[joint.homing]", &format!("[joint.reactions]\n{line}\n[joint.homing]"))
    };
    let all = "quick_stop = 6\nconnection_lost = 2";
    let text = changed("[joint.homing]", &format!("[joint.reactions]\n{all}\n[joint.homing]"));
    let reactions = read(&text).joints[0].reactions;
    assert_eq!(reactions.writes().collect::<Vec<_>>(), [(0x605A, 6), (0x6007, 2)]);
    assert_eq!(Reactions::default().writes().collect::<Vec<_>>(), [(0x605A, 2)]);
    assert_eq!(messages(&with("quick_stop = 5")), [""; 0]);
    let expected = [
        (
            "halt = 1",
            "halt = 1: the drive has no 0x605D: it does not stand in ../../obd/tests/data/servo.xdc",
        ),
        (
            "fault = 40000",
            "fault = 40000: must be an integer from -32768 to 32767",
        ),
        ("stop = 1", "stop: unknown key"),
    ];
    for (line, rule) in expected {
        let found = messages(&with(line));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains(&format!("joint[0].reactions.{rule}")), "{found:?}");
    }
    let (folder, text) = with_modes("0x000003E5");
    let file = folder.path().join("servo.xdc");
    let narrow = std::fs::read_to_string(&file).unwrap();
    let narrow = narrow.replacen(
        "lowLimit=\"-32768\" highLimit=\"32767\"",
        "lowLimit=\"0\" highLimit=\"2\"",
        1,
    );
    std::fs::write(&file, narrow).unwrap();
    let text = text.replace("[joint.homing]", "[joint.reactions]\nquick_stop = 6\n[joint.homing]");
    let errors = parse(&text, &folder.path().join("m.toml")).unwrap_err().to_string();
    assert!(
        errors.contains("joint[0].reactions.quick_stop = 6: this drive offers 0 to 2 for 0x605A, as "),
        "{errors}"
    );
}

/// The device file of the servo with a line about the modes that it has.
fn with_modes(supported: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let object = format!(
        "<Object index=\"6502\" name=\"Supported drive modes\" objectType=\"7\" dataType=\"0007\" accessType=\"const\" defaultValue=\"{supported}\"/>"
    );
    let before = "<Object index=\"60FD\"";
    let file = include_str!("../../../obd/tests/data/servo.xdc").replace(before, &format!("{object}{before}"));
    std::fs::write(folder.path().join("servo.xdc"), file).unwrap();
    let text = changed(
        "id = 1\nprofile = \"cia402\"",
        "id = 1\nprofile = \"cia402\"\ndevice_file = \"servo.xdc\"",
    );
    (folder, text)
}

#[test]
fn a_mode_that_the_device_file_does_not_offer_is_refused_with_those_that_it_does() {
    for (supported, rules) in [
        ("0x000003E5", vec![]),
        ("0x00000000", vec![]),
        (
            "0x00000025",
            vec!["joint[0].mode: must be one that servo.xdc offers (6502h): PP, PV, HM; it is \"csp\""],
        ),
        (
            "0x00000080",
            vec!["joint[0].homing: must be by = \"control\": servo.xdc offers no homing (6502h), only CSP"],
        ),
    ] {
        let (folder, text) = with_modes(supported);
        let found = match parse(&text, &folder.path().join("m.toml")) {
            Ok(_) => Vec::new(),
            Err(errors) => errors.lines().collect(),
        };
        let prefix = format!("{}/", folder.path().display());
        let found: Vec<String> = found.iter().map(|line| line.replace(&prefix, "")).collect();
        assert_eq!(found.len(), rules.len(), "{supported}: {found:#?}");
        for (found, rule) in found.iter().zip(rules) {
            assert!(found.ends_with(rule), "{supported}: {found}");
        }
    }
}

#[test]
fn the_mapping_of_a_drive_follows_its_mode() {
    let objects = |list: &[Mapped]| list.iter().map(Mapped::to_string).collect::<Vec<_>>();
    let with = |mode: &str, outputs: &str| {
        changed(
            "id = 1\nprofile = \"cia402\"",
            &format!("id = 1\nprofile = \"cia402\"{outputs}"),
        )
        .replace("node = 1", &format!("node = 1\nmode = \"{mode}\""))
    };
    let config = read(&with("ip", ""));
    assert_eq!(config.joints[0].mode, DriveMode::Ip);
    assert_eq!(
        objects(&config.bus.nodes[0].outputs),
        ["0x6040/16", "0x6060/8", "0x60FE:1/32", "0x60C1:1/32"]
    );
    assert_eq!(
        messages(&with("ip", "\noutputs = [\"0x6040/16\", \"0x607A/32\"]")),
        [
            "m.toml:9:11: bus.node[0].outputs = [\"0x6040/16\", \"0x607A/32\"]: must hold \"0x60C1:1/32\": a drive is not run in mode \"ip\" without it"
        ]
    );
    // Some drives take the position demand for the target.
    for mode in ["csp", "ip"] {
        let config = read(&with(mode, "\noutputs = [\"0x6062/32\", \"0x6040/16\"]"));
        assert_eq!(objects(&config.bus.nodes[0].outputs), ["0x6062/32", "0x6040/16"]);
    }
}

#[test]
fn mistakes_of_a_device_file_are_told_with_both_places() {
    let folder = tempfile::tempdir().unwrap();
    let broken = include_str!("../../../obd/tests/data/io.xdd").replace("accessType=\"rw\"", "accessType=\"rx\"");
    std::fs::write(folder.path().join("io.xdd"), broken).unwrap();
    let text = changed("profile = \"io\"", "profile = \"io\"\ndevice_file = \"io.xdd\"");
    let path = folder.path().join("m.toml");
    let errors = parse(&text, &path).unwrap_err();
    let lines: Vec<String> = errors.lines().collect();
    assert_eq!(lines.len(), 11, "ten mistakes and how many more there are: {lines:#?}");
    let first = &lines[0];
    assert!(
        first.starts_with(&format!(
            "{}:12:15: bus.node[1].device_file = \"io.xdd\": ",
            path.display()
        )),
        "{first}"
    );
    assert!(
        first.ends_with(": object 0x1006 accessType = \"rx\": expected const, ro, wo, rw or rws"),
        "{first}"
    );
    assert!(lines[10].ends_with("more mistakes"), "{}", lines[10]);
}
