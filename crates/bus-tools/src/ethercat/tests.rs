//! Devices that are asked, with simulated ones at the other end of a link.

use super::scan::{Module, ask, new_file, scan_on};
use super::*;
use crate::Protocol;
use crate::scan::ScanArgs;
use bus::ethercat::setup;
use ethercat::sub::models::{DriveModel, analog_terminal, coupler, digital_terminal};
use ethercat::sub::{IdealMotor, Segment, SubDevice, SubDeviceConfig, esi};
use machine::state::State;
use operator::console::Operator;
use operator::rehearsal::rehearse_on;
use powerlink::link::{LinkError, Received};
use sim::near_end::VirtualEthercat;
use sim::{NetConfig, SimMachine, VirtualNet};
use std::collections::VecDeque;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

/// A wire on virtual time: each frame comes back at once.
struct Wire {
    segment: Segment,
    now_ns: u64,
    answers: VecDeque<Vec<u8>>,
}

impl Wire {
    fn with(devices: impl IntoIterator<Item = SubDeviceConfig>) -> Wire {
        let mut segment = Segment::new();
        for device in devices {
            segment.push(SubDevice::new(device, 0), 300);
        }
        Wire {
            segment,
            now_ns: 1_000_000,
            answers: VecDeque::new(),
        }
    }

    fn new() -> Wire {
        let identity = |product| Identity {
            vendor: 2,
            product,
            revision: 1,
            serial: 9,
        };
        let drive = DriveModel {
            alias: 77,
            ..DriveModel::default()
        };
        let devices = [
            coupler(identity(1)),
            digital_terminal(identity(2)),
            analog_terminal(identity(3)).expect("a terminal"),
            drive.build(vec![Box::new(IdealMotor::default())]).expect("a drive"),
        ];
        Wire::with(devices)
    }
}

impl Link for Wire {
    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let mut octets = frame.to_vec();
        if self.segment.receive(self.now_ns, &mut octets).is_some() {
            self.answers.push_back(octets);
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let Some(octets) = self.answers.pop_front() else {
            self.now_ns = self.now_ns.max(deadline_ns);
            self.segment.poll(self.now_ns);
            return Ok(None);
        };
        self.now_ns += 20_000;
        buffer[..octets.len()].copy_from_slice(&octets);
        Ok(Some(Received {
            length: octets.len(),
            stamp_ns: None,
        }))
    }
}

const MAC: [u8; 6] = [0x12, 0, 0, 0, 0, 1];

fn modules() -> Vec<Module> {
    let mut wire = Wire::new();
    let found = lead(&mut wire, MAC, &[], |lead| lead.find()).expect("they answer");
    let devices: Vec<_> = found.iter().map(|found| asked(found.position)).collect();
    lead(&mut wire, MAC, &devices, |lead| {
        assert_eq!(lead.led(devices.len())?, []);
        let modules = found.iter().enumerate();
        modules.map(|(device, found)| ask(lead, device, *found)).collect()
    })
    .expect("they are led")
}

#[test]
fn devices_are_found_in_the_order_of_the_wire() {
    let mut wire = Wire::new();
    let found = lead(&mut wire, MAC, &[], |lead| lead.find()).expect("they answer");
    let shown: Vec<_> = found
        .iter()
        .map(|found| (found.position, found.identity.product, found.alias))
        .collect();
    let drive = DriveModel::default().identity.product;
    assert_eq!(shown, [(1, 1, 0), (2, 2, 0), (3, 3, 0), (4, drive, 77)]);
    // Nobody: no device, and no wait without end.
    wire.segment.cut(0);
    assert_eq!(
        lead(&mut wire, MAC, &[], |lead| lead.find()).expect("the link is there"),
        []
    );
}

#[test]
fn a_machine_file_is_written_that_is_taken() {
    let text = new_file(&modules(), Path::new("found.toml"), "eth1").expect("a file");
    let config = config::parse(&text, Path::new("found.toml")).unwrap_or_else(|errors| panic!("{errors}\n{text}"));
    let nodes: Vec<_> = config
        .bus
        .nodes
        .iter()
        .map(|node| (node.id, node.name.as_str(), node.inputs.len(), node.channels.len()))
        .collect();
    assert_eq!((nodes[0].0, nodes[0].1), (4, "simulated-servo-drive"));
    assert_eq!(nodes[1..], [(2, "io-2", 1, 16), (3, "simulated-analog-terminal", 4, 8)]);
    // The drive has a joint and an axis.
    let axes: Vec<_> = config
        .axes
        .iter()
        .map(|map| (map.axis.letter(), map.joints.clone()))
        .collect();
    assert_eq!((config.joints[0].node, axes), (0, vec![('X', vec![0])]));
    assert_eq!(nodes.len(), 3, "a coupler exchanges nothing");
}

#[test]
fn objects_are_read_and_written_and_refusals_are_told() {
    let mut wire = sdo::Wire::open(Box::new(Wire::new()), MAC, None, 4).expect("it is there");
    let vendor = DriveModel::default().identity.vendor;
    let ok = wire.ask((0x1018, 1), None).expect("the link");
    assert_eq!(ok, Ok(vendor.to_le_bytes().to_vec()));
    let refused = wire.ask((0x5FFF, 0), None).expect("the link");
    assert!(matches!(refused, Err(SetupError::Sdo { .. })), "{refused:?}");
    let none = sdo::Wire::open(Box::new(Wire::new()), MAC, None, 5)
        .err()
        .expect("there is none");
    assert!(
        none.to_string()
            .starts_with("nothing is at position 5: 4 devices answer"),
        "{none}"
    );
    let mut coupler = sdo::Wire::open(Box::new(Wire::new()), MAC, None, 1).expect("it is there");
    let none = coupler.ask((0x1000, 0), None).expect_err("no mailbox");
    assert!(none.to_string().contains("has no mailbox"), "{none}");
}

#[test]
fn another_main_device_is_heard_before_anything_is_sent() {
    let mut wire = Wire::new();
    assert_eq!(listen(&mut wire, 1_000_000).expect("the link"), None);
    let mut frame = vec![0xFF; 6];
    frame.extend([0x22, 1, 2, 3, 4, 5, 0x88, 0xA4, 0x0E, 0x10]);
    frame.resize(60, 0);
    wire.answers.push_back(frame);
    let other = refuse_other(&mut wire, 1_000_000).expect_err("it is heard");
    assert_eq!(
        other.to_string(),
        "another main device is at work (20:01:02:03:04:05): nothing was sent"
    );
}

/// What a scan with these arguments prints, and whether all was well.
fn scanned(wire: &mut dyn Link, path: &Path, add: bool, devices: Option<&Path>) -> (String, bool) {
    let args = ScanArgs {
        interface: "eth7".into(),
        bus: Some(Protocol::Ethercat),
        listen: 0.3,
        answer_us: 2000,
        write: Some(path.to_owned()),
        add,
        devices: devices.map(Path::to_owned),
    };
    let mut out = Vec::new();
    let code = scan_on(wire, MAC, &args, false, &mut out).expect("the link");
    let text = String::from_utf8(out).expect("text");
    (text, format!("{code:?}") == format!("{:?}", ExitCode::SUCCESS))
}

/// A simulated machine at the other end, on virtual time.
fn simulated(machine: &config::Config) -> VirtualNet {
    VirtualNet::new(SimMachine::new(machine).expect("simulated"), NetConfig::clean(1))
}

#[test]
fn a_file_that_a_scan_has_written_runs_on_the_devices_that_were_found() {
    for text in [
        include_str!("../../../../configs/mill3-ethercat.toml"),
        include_str!("../../../../configs/double2-ethercat.toml"),
    ] {
        let machine = config::parse(text, Path::new("m.toml")).expect("a machine");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("found.toml");
        let (told, well) = scanned(&mut simulated(&machine), &path, false, None);
        assert!(well && told.contains("is written"), "{told}");
        let found = config::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
        bus::check(&found).unwrap_or_else(|errors| panic!("{errors}"));
        assert_eq!(found.bus.nodes.len(), machine.bus.nodes.len());
        let plans = bus::plan(&found);
        let tables = setup::tables(&found, &plans);
        let devices = setup::devices(&found, &plans, &tables);
        let network = setup::network(&found, &devices);
        let bus: VirtualEthercat<'_> =
            bus::ethercat::open::new(&found, &network, simulated(&machine), MAC, Arc::default()).expect("it fits");
        let bus: sim::near_end::VirtualBus<'_> = Box::new(bus);
        rehearse_on(&found, b"", bus, Operator::standing_by, |run| {
            let up = run.run_until(10_000, |run| run.control.state() == State::Disabled)?;
            assert!(up, "{:#?}", run.operator.journal());
            Ok(())
        })
        .expect("a control");
    }
}

#[test]
fn a_scan_adds_what_a_file_does_not_have_and_names_what_is_otherwise() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.toml");
    // By hand: a remark, a name, another device expected at 3; 4 is in the file as 9, found by its alias.
    let by_hand = "schema = 1\n# my cabinet\n[machine]\nname = \"mine\"\nkinematics = \"none\"\n[bus]\n\
                   kind = \"ethercat\"\ninterface = \"eth7\"\n\
                   [[bus.node]]\nid = 3\nname = \"gauges\"\nprofile = \"io\"\nproduct_code = 5\n\
                   [[bus.node]]\nid = 9\nname = \"x\"\nprofile = \"cia402\"\nalias = 77";
    std::fs::write(&path, by_hand).expect("our folder");
    let (told, well) = scanned(&mut Wire::new(), &path, false, None);
    assert!(
        !well && told.contains("is there already and was not changed: --add adds"),
        "{told}"
    );
    assert_eq!(std::fs::read_to_string(&path).expect("a file"), by_hand);
    let (told, well) = scanned(&mut Wire::new(), &path, true, None);
    assert!(!well, "{told}");
    let other = "gauges (node 3) is another device: expected product 0x00000005; found device type 0x00001389";
    assert!(told.contains(other), "{told}");
    assert!(told.contains("m.toml: 1 node added, all else kept."), "{told}");
    // Neither the coupler nor what was added or is found by its alias is strange.
    assert!(
        !told.contains("not in the machine file") && !told.contains("missing"),
        "{told}"
    );
    let written = std::fs::read_to_string(&path).expect("a file");
    assert!(written.starts_with(by_hand), "{written}");
    let config = config::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
    let nodes: Vec<_> = config
        .bus
        .nodes
        .iter()
        .map(|node| (node.id, node.name.as_str()))
        .collect();
    assert_eq!(nodes, [(3, "gauges"), (9, "x"), (2, "io-2")]);
    let (told, _) = scanned(&mut Wire::new(), &path, true, None);
    assert!(told.contains("m.toml has them all: not changed"), "{told}");
    assert_eq!(std::fs::read_to_string(&path).expect("a file"), written);
}

#[test]
fn esi_files_that_fit_are_named_and_those_that_cannot_be_used_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.toml");
    std::fs::write(folder.path().join("maker.xml"), esi::text().expect("a file")).expect("our folder");
    std::fs::write(folder.path().join("broken.xml"), "<EtherCATInfo>").expect("our folder");
    let drive = DriveModel::default()
        .build(vec![Box::new(IdealMotor::default())])
        .expect("a drive");
    let mut wire = Wire::with([drive, digital_terminal(esi::TERMINAL)]);
    let (told, well) = scanned(&mut wire, &path, false, Some(folder.path()));
    assert!(well, "{told}");
    let text = std::fs::read_to_string(&path).expect("a file");
    assert_eq!(text.matches("device_file = \"maker.xml\"").count(), 2, "{text}");
    // Its entries are bits, and have the names of its maker.
    assert!(text.contains("\noutputs = [\"0x7000:1/8\"]\n"), "{text}");
    config::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
}

/// An ESI file of the analog terminal: its inputs have a sign, its outputs have none.
#[test]
fn a_scan_tells_which_numbers_have_a_sign() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.toml");
    let entries = |index: u16, kind: &str| -> String {
        let entry = |sub| {
            format!(
                "<Entry><Index>#x{index:04X}</Index><SubIndex>{sub}</SubIndex><BitLen>16</BitLen><DataType>{kind}</DataType></Entry>"
            )
        };
        (1..=4).map(entry).collect()
    };
    let file = |inputs: &str| {
        format!(
            "<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices><Device><Type ProductCode=\"3\">AIO</Type>\
             <Sm>MBoxOut</Sm><Sm>MBoxIn</Sm><Sm>Outputs</Sm><Sm>Inputs</Sm>\
             <RxPdo Fixed=\"1\" Sm=\"2\"><Index>#x1600</Index>{}</RxPdo><TxPdo Fixed=\"1\" Sm=\"3\"><Index>#x1A00</Index>{}</TxPdo>\
             <Mailbox><CoE/></Mailbox></Device></Devices></Descriptions></EtherCATInfo>",
            entries(0x7000, "UINT"),
            entries(0x6000, inputs)
        )
    };
    for (inputs, signed) in [("INT", 4), ("UINT", 0)] {
        std::fs::write(folder.path().join("maker.xml"), file(inputs)).expect("our folder");
        let _ = std::fs::remove_file(&path);
        let identity = Identity {
            vendor: 2,
            product: 3,
            revision: 1,
            serial: 9,
        };
        let mut wire = Wire::with([analog_terminal(identity).expect("a terminal")]);
        let (told, well) = scanned(&mut wire, &path, false, Some(folder.path()));
        assert!(well, "{told}");
        let text = std::fs::read_to_string(&path).expect("a file");
        assert!(text.contains("device_file = \"maker.xml\""), "{told}{text}");
        let of_inputs = text
            .split("[[bus.node.channel]]")
            .filter(|channel| channel.contains("analog-input"));
        assert_eq!(
            of_inputs.filter(|channel| channel.contains("signed = true")).count(),
            signed,
            "{text}"
        );
        assert_eq!(text.matches("signed = true").count(), signed, "{text}");
        config::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
    }
}

/// An ESI file of the same terminal as one that counts and switches: the names are those of makers.
#[test]
fn a_scan_proposes_counters_encoders_and_duty_cycles_by_their_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.toml");
    let entries = |index: u16, names: [&str; 4]| -> String {
        let entry = |(sub, name): (usize, &str)| {
            format!(
                "<Entry><Index>#x{index:04X}</Index><SubIndex>{sub}</SubIndex><BitLen>16</BitLen><Name>{name}</Name>\
                 <DataType>UINT</DataType></Entry>"
            )
        };
        (1..).zip(names).map(entry).collect()
    };
    let file = |pdo: &str, inputs, outputs| {
        format!(
            "<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices><Device><Type ProductCode=\"3\">CNT</Type>\
             <Sm>MBoxOut</Sm><Sm>MBoxIn</Sm><Sm>Outputs</Sm><Sm>Inputs</Sm>\
             <RxPdo Fixed=\"1\" Sm=\"2\"><Index>#x1600</Index><Name>PWM Output Channel 1</Name>{}</RxPdo>\
             <TxPdo Fixed=\"1\" Sm=\"3\"><Index>#x1A00</Index><Name>{pdo}</Name>{}</TxPdo>\
             <Mailbox><CoE/></Mailbox></Device></Devices></Descriptions></EtherCATInfo>",
            entries(0x7000, outputs),
            entries(0x6000, inputs)
        )
    };
    let others = ["PWM output", "Set counter value", "Analog output", ""];
    let encoder = ["Status", "Counter value", "Latch value", "Error counter"];
    for (pdo, inputs, wanted, unwanted) in [
        (
            "ENC Status",
            encoder,
            "name = \"encoder-1\"\nobject = \"0x6000:2\"\ntype = \"encoder\"\nlatch = \"0x6000:3\"",
            "counter-",
        ),
        (
            "CNT Inputs",
            ["Counter value", "", "", ""],
            "name = \"counter-0\"\nobject = \"0x6000:1\"\ntype = \"counter\"",
            "encoder-",
        ),
        (
            "FB Inputs",
            ["Status", "Position", "", ""],
            "name = \"encoder-1\"\nobject = \"0x6000:2\"\ntype = \"encoder\"\n\n",
            "latch",
        ),
        (
            "AI Inputs",
            ["Position", "Error counter", "", ""],
            "name = \"analog-input-0\"",
            "counter-",
        ),
    ] {
        std::fs::write(folder.path().join("maker.xml"), file(pdo, inputs, others)).expect("our folder");
        let _ = std::fs::remove_file(&path);
        let identity = Identity {
            vendor: 2,
            product: 3,
            revision: 1,
            serial: 9,
        };
        let mut wire = Wire::with([analog_terminal(identity).expect("a terminal")]);
        let (told, well) = scanned(&mut wire, &path, false, Some(folder.path()));
        assert!(well, "{told}");
        let text = std::fs::read_to_string(&path).expect("a file");
        assert!(text.contains(wanted) && !text.contains(unwanted), "{pdo}: {text}");
        assert!(
            text.contains("name = \"pwm-0\"\nobject = \"0x7000:1\"\ntype = \"pwm\"\n"),
            "{text}"
        );
        config::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
    }
}

/// What lies in the gaps of an ESI file is nothing that could have a name.
#[test]
fn a_scan_proposes_no_channels_for_gaps() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.toml");
    let entry = |index: &str, sub: u8, bits: u8| {
        format!("<Entry><Index>{index}</Index><SubIndex>{sub}</SubIndex><BitLen>{bits}</BitLen></Entry>")
    };
    let inputs = [
        entry("#x6000", 1, 1),
        entry("#x6000", 2, 2),
        entry("0", 0, 2),
        entry("#x6000", 3, 1),
        entry("0", 0, 2),
    ];
    let file = format!(
        "<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices><Device><Type ProductCode=\"2\">DIO</Type>\
         <Sm>Outputs</Sm><Sm>Inputs</Sm><RxPdo Fixed=\"1\" Sm=\"0\"><Index>#x1600</Index>{}</RxPdo>\
         <TxPdo Fixed=\"1\" Sm=\"1\"><Index>#x1A00</Index>{}</TxPdo></Device></Devices></Descriptions></EtherCATInfo>",
        entry("0", 0, 8),
        inputs.concat()
    );
    std::fs::write(folder.path().join("maker.xml"), file).expect("our folder");
    let identity = Identity {
        vendor: 2,
        product: 2,
        revision: 1,
        serial: 9,
    };
    let mut wire = Wire::with([digital_terminal(identity)]);
    let (told, well) = scanned(&mut wire, &path, false, Some(folder.path()));
    assert!(well, "{told}");
    let text = std::fs::read_to_string(&path).expect("a file");
    assert!(text.contains("outputs = [\"0x5FFF:1/8\"]"), "{told}{text}");
    let channels: Vec<&str> = text.split("[[bus.node.channel]]\n").skip(1).collect();
    let named = |name: &str, bit: u8| format!("name = \"{name}\"\nobject = \"0x6000:1\"\nbit = {bit}");
    let expected = [("input-00", 0), ("input-01", 1), ("input-02", 2), ("input-05", 5)];
    let expected = expected.map(|(name, bit)| named(name, bit));
    assert_eq!(
        channels.iter().map(|it| it.trim()).collect::<Vec<_>>(),
        expected,
        "{text}"
    );
    config::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
}

/// Without an ESI file, the EEPROM of a terminal says which bits are something, and the PDOs of a device with objects.
#[test]
fn a_scan_without_an_esi_file_proposes_no_channels_for_gaps() {
    let identity = Identity {
        vendor: 2,
        product: 2,
        revision: 1,
        serial: 9,
    };
    let mut terminal = digital_terminal(identity);
    // Entries 2 and 6 of the inputs become gaps.
    for sub in [2, 6] {
        let is_entry = |octets: &[u8]| octets[..3] == [0x00, 0x60, sub] && octets[5] == 1;
        let at = terminal.eeprom.windows(8).position(is_entry).expect("an entry");
        terminal.eeprom[at + 1] = 0;
    }
    let mut analog = analog_terminal(identity).expect("a terminal");
    analog
        .objects
        .preset(0x1A00, 2, &0x0000_0010_u32.to_le_bytes())
        .expect("an entry");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.toml");
    let (told, well) = scanned(&mut Wire::with([terminal, analog]), &path, false, None);
    assert!(well, "{told}");
    let text = std::fs::read_to_string(&path).expect("a file");
    let [first, second] = [1, 2].map(|id| text.split("[[bus.node]]\n").nth(id).expect("a node"));
    let bits = |name: &str| -> Vec<&str> {
        let channels = first.split("[[bus.node.channel]]\n").skip(1);
        let own = channels.filter(|channel| channel.starts_with(&format!("name = \"{name}-")));
        own.filter_map(|channel| channel.trim().rsplit("bit = ").next())
            .collect()
    };
    assert_eq!(bits("input"), ["0", "2", "3", "4", "6", "7"], "{text}");
    assert_eq!(bits("output").len(), 8, "{text}");
    assert!(
        second.contains("# inputs: bits or gaps, which are exchanged with an ESI file alone"),
        "{text}"
    );
    assert!(
        !second.contains("name = \"analog-input") && second.contains("name = \"analog-output"),
        "{text}"
    );
    config::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
}

/// Devices that nobody asks for stay where they are.
#[test]
fn only_the_device_that_is_asked_is_led_to_pre_op() {
    let mut wire = Wire::new();
    let states = lead(&mut wire, MAC, &[asked(3)], |lead| {
        assert_eq!(lead.led(1)?, []);
        let found = lead.sdo(0, (0x1018, 2), None)?;
        assert_eq!(found, Ok(3_u32.to_le_bytes().to_vec()));
        Ok(())
    });
    states.expect("it is led");
    let states: Vec<AlState> = (0..4).map(|at| wire.segment.device(at).state()).collect();
    assert_eq!(states, [AlState::Init, AlState::Init, AlState::PreOp, AlState::Init]);
}
