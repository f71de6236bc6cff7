//! ESI files: one of ours, mistakes with their places, any octets.

use super::*;
use proptest::prelude::*;
use std::format;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

/// Written by the tests of the crate `ethercat`, of its simulated devices.
const SIMULATED: &str = include_str!("../../tests/data/simulated.esi.xml");

fn mistakes(text: &str) -> Vec<String> {
    match parse_esi("d", text.as_bytes()) {
        // Of devices and modules beside which others can be used.
        Ok(esi) => esi.notes.iter().map(|note| note.line("d")).collect(),
        Err(errors) => errors.lines().collect(),
    }
}

/// Replaces the first occurrence.
fn changed(old: &str, new: &str) -> String {
    assert!(SIMULATED.contains(old), "{old:?} stands in the file");
    SIMULATED.replacen(old, new, 1)
}

/// Records, arrays, plain objects; what is not listed is not there, and what the file does not tell is believed to be.
#[test]
fn a_dictionary_says_what_there_is_and_what_can_be_written() {
    let sub_item = |idx: &str, access: &str| {
        format!("<SubItem>{idx}<Name>s</Name><Type>U32</Type><Flags><Access>{access}</Access></Flags></SubItem>")
    };
    let types = format!(
        "<DataType><Name>U32</Name><BitSize>32</BitSize></DataType>\
         <DataType><Name>DT6099</Name>{}{}{}</DataType>\
         <DataType><Name>LIST</Name><ArrayInfo><LBound>1</LBound><Elements>3</Elements></ArrayInfo></DataType>\
         <DataType><Name>DT6080</Name>{}<SubItem><Name>Elements</Name><Type>LIST</Type></SubItem></DataType>",
        sub_item("<SubIdx>0</SubIdx>", "ro"),
        sub_item("<SubIdx>1</SubIdx>", "rw"),
        sub_item("<SubIdx>2</SubIdx>", "ro"),
        sub_item("<SubIdx>0</SubIdx>", "ro"),
    );
    let object = |index: &str, kind: &str, access: &str| {
        format!("<Object><Index>#x{index}</Index><Type>{kind}</Type><Flags><Access>{access}</Access></Flags></Object>")
    };
    let objects = [
        object("1008", "STRING(8)", "ro"),
        object("6065", "U32", "rw"),
        object("6099", "DT6099", "rw"),
        object("6080", "DT6080", "rw"),
        "<Object><Index>nonsense</Index></Object>".to_string(),
    ];
    let text = |objects: &str| {
        let of = format!(
            "<Profile><Dictionary><DataTypes>{types}</DataTypes><Objects>{objects}</Objects></Dictionary></Profile><Fmmu>"
        );
        let esi = parse_esi("d", changed("<Fmmu>", &of).as_bytes()).unwrap();
        esi.devices[0].dictionary.clone()
    };
    let dictionary = text(&objects.concat()).unwrap();
    for (index, sub, has, can_write) in [
        (0x6065, 0, true, true),
        (0x6065, 1, false, false),
        (0x6099, 0, true, false),
        (0x6099, 1, true, true),
        (0x6099, 2, true, false),
        (0x6099, 3, false, false),
        (0x6080, 3, true, true),
        (0x6080, 4, false, false),
        (0x60C2, 1, false, false),
        // A type that is nowhere told.
        (0x1008, 7, true, false),
    ] {
        let found = (dictionary.has(index, sub), dictionary.can_write(index, sub));
        assert_eq!(found, (has, can_write), "0x{index:04X}:{sub}");
    }
    // A file that has nothing of the profile is silent about it.
    let of_others = text(&objects[0]).unwrap();
    assert!(of_others.can_write(0x60C2, 1) && !of_others.has(0x1010, 1));
    assert_eq!(text(""), None);
}

#[test]
fn a_file_is_read_whole() {
    let esi = parse_esi("d", SIMULATED.as_bytes()).unwrap();
    assert_eq!(
        (esi.vendor, esi.vendor_name.as_str(), &esi.notes),
        (0x0A1B, "isocnc", &vec![])
    );
    let names: Vec<&str> = esi.devices.iter().map(|device| device.name.as_str()).collect();
    assert_eq!(names, ["ISOCNC-SIM", "DIO-8-8"]);
    let drive = esi.find(0x0402_0001, None).unwrap();
    assert_eq!((drive.revision, drive.sync_managers.len()), (1, 4));
    assert_eq!(
        drive.sync_managers[2],
        EsiSyncManager {
            usage: EsiUsage::Outputs,
            start: 0x1100,
            default_size: 8,
            max_size: Some(256),
            control: 0x64,
            enable: true
        }
    );
    assert_eq!(drive.fmmus, [EsiUsage::Outputs, EsiUsage::Inputs]);
    let mapped: Vec<u32> = drive.rx_pdos[0].entries.iter().map(EsiEntry::mapping).collect();
    assert_eq!(mapped, [0x6040_0010, 0x6060_0008, 0x0000_0008, 0x607A_0020]);
    assert_eq!((drive.octets(true), drive.octets(false)), (8, 8));
    let coe = drive.coe.as_ref().unwrap();
    assert!(coe.assign && coe.configure && coe.complete_access && coe.information);
    assert_eq!(
        (coe.start[0].index, coe.start[0].sub, &coe.start[0].data),
        (0x6060, 0, &vec![8])
    );
    assert_eq!(coe.start[0].transitions, ["PS"]);
    assert_eq!((drive.op_modes[0].activate, drive.op_modes[1].activate), (0x300, 0));
    let terminal = &esi.devices[1];
    assert_eq!(
        (terminal.octets(true), terminal.octets(false), terminal.coe.is_some()),
        (1, 1, false)
    );
    assert!(terminal.op_modes.is_empty());
}

#[test]
fn revisions_are_found_as_near_as_they_come() {
    let esi = EsiFile {
        devices: [1, 3, 5]
            .map(|revision| EsiDevice {
                product: 7,
                revision,
                ..EsiDevice::default()
            })
            .to_vec(),
        ..EsiFile::default()
    };
    for (wanted, found) in [(None, 5), (Some(3), 3), (Some(4), 3), (Some(9), 5), (Some(0), 5)] {
        assert_eq!(
            esi.find(7, wanted).map(|device| device.revision),
            Some(found),
            "{wanted:?}"
        );
    }
    assert_eq!(esi.find(8, None), None);
}

#[test]
fn mistakes_have_their_places() {
    for (old, new, expected) in [
        (
            "#x00000A1B",
            "#xG",
            "Vendor Id = \"#xG\": expected an integer from 0 to 4294967295, decimal or #x",
        ),
        (
            "#x04020001",
            "#x1FFFFFFFF",
            "Type ProductCode = \"#x1FFFFFFFF\": expected an integer",
        ),
        (
            "#x1600",
            "#x1A00",
            "RxPdo Index = \"#x1A00\": expected an integer from 5632 to 6143",
        ),
        (
            "Sm=\"2\"",
            "Sm=\"9\"",
            "RxPdo Sm = \"9\": expected an integer from 0 to 3",
        ),
        (
            "<BitLen>16</BitLen>",
            "<BitLen>0</BitLen>",
            "PDO 0x1600 Entry BitLen = \"0\": expected an integer from 1 to 255",
        ),
        ("<BitLen>16</BitLen>", "", "PDO 0x1600 Entry BitLen: is missing"),
        (
            "<Data>08</Data>",
            "<Data>8</Data>",
            "InitCmd 0x6060 Data = \"8\": expected 1 to 4096 octets of two hex digits each",
        ),
        (
            "<Data>08</Data>",
            "<Data>+8</Data>",
            "InitCmd 0x6060 Data = \"+8\": expected 1 to 4096 octets",
        ),
        ("<Data>08</Data>", "", "InitCmd 0x6060 Data: is missing"),
        (
            "<Transition>PS",
            "<Transition>PX",
            "InitCmd 0x6060 Transition = \"PX\": expected a step",
        ),
        (
            "#x0300",
            "",
            "OpMode AssignActivate = \"\": expected an integer from 0 to 65535",
        ),
        (
            "MaxSize=\"256\"",
            "MaxSize=\"7\"",
            "Device ISOCNC-SIM Sm 2: its PDOs have 8 octets, its MaxSize is 7",
        ),
        ("#x1A00", "#x1A00</Index><Index>", ""),
    ] {
        let text = changed(old, new);
        let told = mistakes(&text);
        if expected.is_empty() {
            assert_eq!(told, [] as [&str; 0], "a second one is not looked at");
            continue;
        }
        assert!(
            told.iter().any(|line| line.contains(expected)),
            "{old} -> {new}: {told:?}"
        );
        // The place: where the change is.
        let line = SIMULATED[..SIMULATED.find(old).unwrap()].matches('\n').count() + 1;
        let near = told.iter().any(|told| {
            let row: usize = told.split(':').nth(1).unwrap().parse().unwrap();
            row <= line
        });
        assert!(near, "{old} in line {line}: {told:?}");
    }
    assert_eq!(
        mistakes("<Other/>"),
        ["d:1:1: root element = \"Other\": expected EtherCATInfo"]
    );
    assert_eq!(mistakes("<EtherCATInfo/>").len(), 2);
    assert_eq!(
        mistakes(""),
        ["d:1:1: expected XML: the document does not have a root node"]
    );
    let xdd = parse("d", SIMULATED.as_bytes()).unwrap_err().to_string();
    assert!(xdd.contains("this is an ESI file, of a device for EtherCAT"), "{xdd}");
}

#[test]
fn numbers_are_decimal_or_hexadecimal() {
    let file = |number: &str| changed("#x00000A1B", number);
    for (number, expected) in [
        ("42", 42),
        ("#x2A", 42),
        ("#X2a", 42),
        ("0042", 42),
        (" 42 ", 42),
        ("0", 0),
        ("#x0", 0),
    ] {
        assert_eq!(
            parse_esi("d", file(number).as_bytes()).unwrap().vendor,
            expected,
            "{number}"
        );
    }
    for number in ["", "-1", "0x2A", "#2A", "4 2", "#x", "4294967296"] {
        assert!(parse_esi("d", file(number).as_bytes()).is_err(), "{number:?}");
    }
}

/// A coupler with three slots: outputs that are usual, inputs of which one has to be there, and a place that is left open.
const MODULAR: &str = r##"<?xml version="1.0"?>
<EtherCATInfo Version="1.11">
  <Vendor><Id>#x0000FACE</Id><Name>Maker</Name></Vendor>
  <Descriptions>
    <Devices><Device Physics="YY">
      <Type ProductCode="#x00001000" RevisionNo="#x1">COUPLER</Type>
      <Sm StartAddress="#x1000">MBoxOut</Sm><Sm StartAddress="#x1080">MBoxIn</Sm>
      <Sm StartAddress="#x1100">Outputs</Sm><Sm StartAddress="#x1400">Inputs</Sm>
      <TxPdo Fixed="1" Sm="3"><Index>#x1AFF</Index><Name>State</Name>
        <Entry><Index>#xF100</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>State</Name><DataType>UINT</DataType></Entry>
      </TxPdo>
      <Mailbox><CoE PdoAssign="1"><InitCmd><Transition>PS</Transition><Index>#xF800</Index><SubIndex>1</SubIndex><Data>07</Data></InitCmd></CoE></Mailbox>
      <Slots SlotPdoIncrement="1" SlotIndexIncrement="#x10" DownloadModuleIdentList="1">
        <Slot MinInstances="0" MaxInstances="1"><Name>Outputs</Name>
          <ModuleIdent Default="1">#x21</ModuleIdent><ModuleClass><Class>IN</Class></ModuleClass></Slot>
        <Slot MinInstances="2" MaxInstances="2"><Name>Inputs</Name><ModuleIdent>#x20</ModuleIdent></Slot>
      </Slots>
    </Device></Devices>
    <Modules>
      <Module><Type ModuleIdent="#x20" ModuleClass="IN">DI4</Type><Name>Inputs</Name>
        <TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A00</Index><Exclude DependOnSlot="true">#x1A80</Exclude>
          <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>4</BitLen><DataType>BIT4</DataType></Entry>
          <Entry><Index>0</Index><BitLen>4</BitLen></Entry>
        </TxPdo>
      </Module>
      <Module><Type ModuleIdent="#x21">AO1</Type><Name>Output</Name>
        <RxPdo Fixed="1" Sm="2"><Index DependOnSlot="1">#x1600</Index>
          <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>17</SubIndex><BitLen>16</BitLen><DataType>INT</DataType></Entry>
        </RxPdo>
        <Mailbox><CoE><InitCmd><Transition>PS</Transition><Index DependOnSlot="1">#x8000</Index><SubIndex>2</SubIndex><Data>3412</Data></InitCmd></CoE></Mailbox>
      </Module>
    </Modules>
  </Descriptions>
</EtherCATInfo>
"##;

#[test]
fn modules_that_are_usual_stand_in_their_slots() {
    let esi = parse_esi("d", MODULAR.as_bytes()).unwrap();
    let device = &esi.devices[0];
    let mapped = |pdos: &[EsiPdo]| -> Vec<(u16, Vec<u32>)> {
        let of = |pdo: &EsiPdo| (pdo.index, pdo.entries.iter().map(EsiEntry::mapping).collect());
        pdos.iter().map(of).collect()
    };
    assert_eq!(mapped(&device.rx_pdos), [(0x1600, vec![0x7000_1110])]);
    let inputs = [
        (0x1AFF, vec![0xF100_0110]),
        // The second and the third slot.
        (0x1A01, vec![0x6010_0104, 0x0000_0004]),
        (0x1A02, vec![0x6020_0104, 0x0000_0004]),
    ];
    assert_eq!(mapped(&device.tx_pdos), inputs);
    assert_eq!((device.octets(true), device.octets(false)), (2, 4));
    let excluded: Vec<&[u16]> = device.tx_pdos.iter().map(|pdo| &pdo.excluded[..]).collect();
    assert_eq!(excluded, [&[][..], &[0x1A81], &[0x1A82]]);
    assert_eq!(device.open_slot, None);
    // Which module is in there is not told.
    let open = MODULAR.replace(" Default=\"1\"", "");
    let esi = parse_esi("d", open.as_bytes()).unwrap();
    assert_eq!(esi.devices[0].open_slot.as_deref(), Some("slot \"Outputs\" in line 14"));
    assert_eq!(esi.devices[0].rx_pdos, []);
}

/// Index, sub-index and octets of the commands of the coupler.
fn commands(device: &EsiDevice) -> Vec<(u16, u8, Vec<u8>)> {
    let coe = device.coe.as_ref().expect("a mailbox");
    let all = coe.start.iter();
    all.map(|command| (command.index, command.sub, command.data.clone()))
        .collect()
}

#[test]
fn modules_that_are_chosen_bring_pdos_and_commands_of_their_slots() {
    let with = |modules: &[u32]| {
        let choice = EsiChoice {
            product: 0x1000,
            revision: 1,
            modules,
        };
        parse_esi_with("d", MODULAR.as_bytes(), Some(choice)).unwrap()
    };
    let esi = with(&[0, 0, 0x20]);
    let device = &esi.devices[0];
    let pdos = |pdos: &[EsiPdo]| -> Vec<u16> { pdos.iter().map(|pdo| pdo.index).collect() };
    assert_eq!(
        (pdos(&device.rx_pdos), pdos(&device.tx_pdos)),
        (vec![], vec![0x1AFF, 0x1A02])
    );
    assert_eq!((&device.modules, &device.open_slot), (&vec![0, 0, 0x20], &None));
    let ident = |ident: u32| ident.to_le_bytes().to_vec();
    let list = [(0xF030, 0, vec![0]), (0xF030, 1, ident(0)), (0xF030, 2, ident(0))];
    let rest = [(0xF030, 3, ident(0x20)), (0xF030, 0, vec![3]), (0xF800, 1, vec![7])];
    assert_eq!(commands(device), [list, rest].concat());
    // The list of modules, the commands of the device, those of its modules as far behind as their slots.
    let esi = with(&[0x21]);
    let device = &esi.devices[0];
    assert_eq!(
        commands(device),
        [
            (0xF030, 0, vec![0]),
            (0xF030, 1, ident(0x21)),
            (0xF030, 0, vec![1]),
            (0xF800, 1, vec![7]),
            (0x8000, 2, vec![0x34, 0x12])
        ]
    );
    // A class is all of its modules; the second and the third slot are two places for one kind.
    let slot = |name: &str, modules: &[u32], is_needed| EsiSlot {
        name: name.to_string(),
        modules: modules.to_vec(),
        is_needed,
    };
    let inputs = slot("Inputs", &[0x20], true);
    assert_eq!(
        device.slots,
        [slot("Outputs", &[0x21, 0x20], false), inputs.clone(), inputs]
    );
    let names: Vec<(u32, &str)> = esi.modules.iter().map(|it| (it.ident, it.name.as_str())).collect();
    assert_eq!(names, [(0x20, "DI4"), (0x21, "AO1")]);
    // A choice for another device changes nothing.
    let other = EsiChoice {
        product: 0x1000,
        revision: 2,
        modules: &[],
    };
    let usual = parse_esi("d", MODULAR.as_bytes()).unwrap();
    assert_eq!(parse_esi_with("d", MODULAR.as_bytes(), Some(other)).unwrap(), usual);
    assert_eq!(usual.devices[0].modules, [0x21, 0x20, 0x20]);
    // Without the attribute the device is not told.
    let untold = MODULAR.replace(" DownloadModuleIdentList=\"1\"", "");
    let esi = parse_esi("d", untold.as_bytes()).unwrap();
    assert_eq!(commands(&esi.devices[0])[0], (0xF800, 1, vec![7]));
    // What has no mailbox cannot be told.
    let mute = MODULAR.replacen("<Mailbox><CoE PdoAssign=\"1\">", "<Mailbox><Other>", 1);
    let mute = mute.replacen("</CoE></Mailbox>", "</Other></Mailbox>", 1);
    assert_eq!(
        mistakes(&mute),
        ["d:13:7: Slots: have start-up commands, but the device has no CoE mailbox"]
    );
}

/// Groups order and align what modules exchange: used is what they leave where it is.
#[test]
fn groups_of_modules_that_would_move_process_data_are_told() {
    const DI8: &str = "<Module><Type ModuleIdent=\"#x22\" ModulePdoGroup=\"0\">DI8</Type><TxPdo Fixed=\"1\" Sm=\"3\">\
        <Index DependOnSlot=\"1\">#x1A00</Index><Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen></Entry></TxPdo></Module>";
    let told = |octets: &str, modules: &[u32]| {
        let groups = std::format!("<ModulePdoGroup Alignment=\"{octets}\" RxPdo=\"#x17F4\" TxPdo=\"#x1BF4\"/></Slots>");
        let file = MODULAR.replace("</Slots>", &groups).replace(
            "<Type ModuleIdent=\"#x20\" ModuleClass=\"IN\">",
            "<Type ModuleIdent=\"#x20\" ModuleClass=\"IN\" ModulePdoGroup=\"1\">",
        );
        let file = file.replace("</Modules>", &std::format!("{DI8}</Modules>"));
        let choice = EsiChoice {
            product: 0x1000,
            revision: 1,
            modules,
        };
        let esi = parse_esi_with("d", file.as_bytes(), Some(choice)).unwrap();
        esi.devices[0].moved_by_group.clone()
    };
    // No modules, modules in the order of their groups, outputs of two octets.
    for (octets, modules) in [
        ("2", &[][..]),
        ("1", &[0x22, 0x20]),
        ("", &[0x22, 0x20]),
        ("2", &[0x21]),
    ] {
        assert_eq!(told(octets, modules), None, "{octets} {modules:?}");
    }
    let rule = |octets: u32| {
        std::format!(
            "process data of its modules are ordered and aligned by groups (ModulePdoGroup in line 17), by no rule that is public; used are \
             modules in the order of their groups, each PDO of which fills {octets} octets or a multiple of that"
        )
    };
    assert_eq!(told("2", &[0x22, 0x20]), Some(rule(2)));
    assert_eq!(told("1", &[0x20, 0x22]), Some(rule(1)));
}

#[test]
fn slots_that_cannot_be_are_refused_at_their_places() {
    for (old, new, told) in [
        (
            "<ModuleIdent Default=\"1\">#x21",
            "<ModuleIdent Default=\"1\">#x22",
            "d:15: Slot ModuleIdent = \"#x22\": is no module of this file",
        ),
        (
            "SlotPdoIncrement=\"1\"",
            "SlotPdoIncrement=\"0\"",
            "d:21: TxPdo 0x1A00: stands twice in the device",
        ),
        (
            "SlotPdoIncrement=\"1\"",
            "SlotPdoIncrement=\"512\"",
            "d:21: TxPdo Index = \"#x1A00\": becomes 0x1C00 by the number of its slot, which is none",
        ),
        (
            "SlotIndexIncrement=\"#x10\"",
            "SlotIndexIncrement=\"#xFFFF\"",
            "d:22: PDO 0x1A01 Entry Index = \"#x6000\": becomes 0x15FFF by the number of its slot, which is none",
        ),
        (
            "ModuleIdent=\"#x20\"",
            "ModuleIdent=\"?\"",
            "d:20: Type ModuleIdent = \"?\": expected an integer from 0 to 4294967295, decimal or #x",
        ),
        ("MaxInstances=\"2\"", "MaxInstances=\"255\"", ""),
        (
            "MinInstances=\"0\" MaxInstances=\"1\"",
            "MinInstances=\"0\" MaxInstances=\"255\"",
            "d:16: Slot = \"Inputs\": is beyond the 256 slots that a device can have",
        ),
    ] {
        assert!(MODULAR.contains(old), "{old}");
        let without_column = |line: String| {
            let parts: Vec<&str> = line.splitn(4, ':').collect();
            format!("{}:{}:{}", parts[0], parts[1], parts[3])
        };
        let lines: Vec<String> = mistakes(&MODULAR.replacen(old, new, 1))
            .into_iter()
            .map(without_column)
            .collect();
        if told.is_empty() {
            assert_eq!(lines, [""; 0], "{old} -> {new}");
            continue;
        }
        assert!(lines.iter().any(|line| line == told), "{old} -> {new}: {lines:#?}");
    }
}

proptest! {
    #[test]
    fn any_octets_are_read_or_refused(octets in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = parse_esi("d", &octets);
    }

    /// A file whose text is cut, doubled or changed somewhere.
    #[test]
    fn any_change_of_a_file_is_read_or_refused(
        at in 0..SIMULATED.len(), length in 0_usize..200, octets in prop::collection::vec(any::<u8>(), 0..20), is_modular: bool
    ) {
        let mut file = if is_modular { MODULAR } else { SIMULATED }.as_bytes().to_vec();
        let at = at % file.len();
        let end = (at + length).min(file.len());
        file.splice(at..end, octets);
        match parse_esi("d", &file) {
            Ok(esi) => prop_assert!(!esi.devices.is_empty()),
            Err(errors) => {
                prop_assert!(!errors.mistakes.is_empty());
                prop_assert!(!errors.to_string().contains("was lost"));
            }
        }
    }
}

/// Of two devices one is odd: the other one can be used, and only a file without any that can is refused.
#[test]
fn what_is_wrong_in_a_device_is_its_own() {
    let odd = changed("<BitLen>16", "<BitLen>?");
    let esi = parse_esi("d", odd.as_bytes()).unwrap();
    let told: Vec<usize> = esi.devices.iter().map(|device| device.mistakes.len()).collect();
    assert_eq!(told, [1, 0]);
    assert!(
        esi.devices[0].mistakes[0]
            .line("d")
            .contains("BitLen = \"?\": expected an integer"),
        "{esi:?}"
    );
    assert_eq!(esi.notes, esi.devices[0].mistakes);
    let whole = parse_esi("d", SIMULATED.as_bytes()).unwrap();
    assert_eq!(esi.devices[1], whole.devices[1]);
    // No kind, so that nobody can ask for it: noted.
    let unnamed = changed("ProductCode=\"#x04020001\"", "ProductCode=\"?\"");
    let esi = parse_esi("d", unnamed.as_bytes()).unwrap();
    assert_eq!((esi.devices.len(), esi.notes.len()), (1, 1));
    // Both are odd.
    let (start, end) = odd.rsplit_once("<BitLen>1<").unwrap();
    let errors = parse_esi("d", format!("{start}<BitLen>!<{end}").as_bytes()).unwrap_err();
    assert_eq!(errors.mistakes.len(), 2, "{errors}");
    // What is wrong in the vendor is wrong in all.
    assert!(parse_esi("d", changed("#x00000A1B", "?").as_bytes()).is_err());
}
