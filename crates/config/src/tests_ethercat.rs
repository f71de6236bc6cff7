//! Keys of EtherCAT: one case a rule.

use super::tests::{changed, messages};
use super::*;

/// The small machine on EtherCAT, with lines behind `[bus]`, its drive and its terminal.
fn machine(bus: &str, drive: &str, io: &str) -> String {
    changed("kind = \"memory\"", &format!("kind = \"ethercat-memory\"\n{bus}"))
        .replace("profile = \"cia402\"", &format!("profile = \"cia402\"\n{drive}"))
        .replace("profile = \"io\"", &format!("profile = \"io\"\n{io}"))
}

fn read(text: &str) -> Config {
    parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

fn own(node: &Node) -> &EthercatNode {
    node.ethercat.as_ref().expect("a node of EtherCAT")
}

#[test]
fn a_drive_follows_sync0_in_the_middle_and_maps_what_the_machine_file_has() {
    let config = read(&machine("", "outputs = [\"0x6040/16\", \"0x607A/32\"]", ""));
    assert_eq!(
        (config.bus.kind, config.bus.clock),
        (BusKind::EthercatMemory, BusClock::Bus)
    );
    let [drive, io] = &config.bus.nodes[..] else {
        panic!("two nodes")
    };
    let clock = SyncClock {
        activate: 0x0300,
        shift_ns: 500_000,
        sync1_ns: 0,
    };
    assert_eq!((own(drive).clock, own(io).clock), (Some(clock), None));
    let entries = vec![0x6040_0010, 0x607A_0020];
    assert_eq!(own(drive).outputs, [Pdo { index: 0x1600, entries }]);
    assert_eq!(own(drive).inputs[0].index, 0x1A00);
}

/// Each axis has a PDO of its own, as far behind that of the one before as the file says.
#[test]
fn pdos_of_axes_lie_as_far_apart_as_the_machine_file_says() {
    let outputs = "outputs = [\"0x6040/16\", \"0x607A/32\", \"0x2001/16\", \"0x6840/16\", \"0x687A/32\"]\n";
    let of = |step: &str| {
        read(&machine(
            "",
            &format!("{outputs}{step}"),
            "outputs = [\"0x6200:1/8\", \"0x7000:1/16\"]",
        ))
    };
    let pdo = |index, entries: &[u32]| Pdo {
        index,
        entries: entries.to_vec(),
    };
    let first = [0x6040_0010, 0x607A_0020, 0x2001_0010];
    let second = [0x6840_0010, 0x687A_0020];
    for (step, index) in [("", 0x1610), ("pdo_step = 1", 0x1601), ("pdo_step = 64", 0x1640)] {
        let config = of(step);
        assert_eq!(
            own(&config.bus.nodes[0]).outputs,
            [pdo(0x1600, &first), pdo(index, &second)]
        );
        // Objects of a terminal are of no axis.
        let terminal = pdo(0x1600, &[0x6200_0108, 0x7000_0110]);
        assert_eq!(own(&config.bus.nodes[1]).outputs, [terminal]);
    }
    let all = [first.as_slice(), &second].concat();
    assert_eq!(own(&of("pdo_step = 0").bus.nodes[0]).outputs, [pdo(0x1600, &all)]);
    let mixed = "outputs = [\"0x6040/16\", \"0x6840/16\", \"0x607A/32\", \"0x687A/32\"]";
    let [refused] = &messages(&machine("", mixed, ""))[..] else {
        panic!("one message")
    };
    let rule = "must hold the objects of axis 0 one behind the other: each axis has a PDO of its own (pdo_step = 0: one for all)";
    assert!(refused.ends_with(rule), "{refused}");
    assert_eq!(messages(&machine("", &format!("{mixed}\npdo_step = 0"), "")), [""; 0]);
}

#[test]
fn keys_of_ethercat_arrive() {
    let drive = "alias = 7\nshift_us = -20\nsync1_us = 100\nwatchdog_ms = 50";
    let config = read(&machine("lost_max = 5", drive, "dc = true"));
    assert_eq!(config.bus.pres_lost_max, 5);
    let [drive, io] = &config.bus.nodes[..] else {
        panic!("two nodes")
    };
    let clock = SyncClock {
        activate: 0x0700,
        shift_ns: -20_000,
        sync1_ns: 100_000,
    };
    assert_eq!((own(drive).alias, own(drive).watchdog_ms), (Some(7), Some(50)));
    assert_eq!(own(drive).clock, Some(clock));
    assert!(own(io).clock.is_some());
    let config = read(&machine("clock = \"own\"", "", ""));
    assert_eq!(own(&config.bus.nodes[0]).clock, None);
}

#[test]
#[rustfmt::skip] // one case a line
fn keys_that_mean_nothing_are_refused_with_the_reason() {
    for (bus, drive, refused) in [
        ("prescaler = 2", "", "m.toml:6:1: bus.prescaler: cannot be here: EtherCAT has no SoC"),
        ("multiplex_cycles = 2", "", "m.toml:6:1: bus.multiplex_cycles: cannot be here: EtherCAT exchanges all devices in each cycle"),
        ("pres_lost_max = 2", "", "m.toml:6:1: bus.pres_lost_max: cannot be here: the frames of EtherCAT have no PRes: use lost_max"),
        ("tap = \"tap0\"", "", "m.toml:6:1: bus.tap: cannot be here: IP over EtherCAT (EoE) is not served"),
        ("", "pres_timeout_us = 100", "m.toml:10:1: bus.node[0].pres_timeout_us: cannot be here: EtherCAT asks all devices by the same frames"),
        ("", "async_only = true", "m.toml:10:1: bus.node[0].async_only: cannot be here: leave outputs and inputs empty"),
        ("clock = \"own\"", "dc = true", "m.toml:10:6: bus.node[0].dc = true: needs bus.clock = \"bus\": SYNC0 comes by the clock of the bus"),
        ("", "dc = false\nshift_us = 3", "m.toml:11:12: bus.node[0].shift_us = 3: needs dc = true: without a clock there is no SYNC0"),
        ("", "shift_us = 1001", "m.toml:10:12: bus.node[0].shift_us = 1001: must be an integer from -1000 to 1000"),
        ("", "alias = 0", "m.toml:10:9: bus.node[0].alias = 0: must be an integer from 1 to 65535"),
        ("", "sdo = [{ object = \"0x1C12:1\", value = 0, bits = 16 }]", "m.toml:10:19: bus.node[0].sdo[0].object = \"0x1C12:1\": is set by the control from the other keys of this file"),
    ] {
        assert_eq!(messages(&machine(bus, drive, "")), [refused]);
    }
    for (bus, drive, refused) in [
        ("lost_max = 3", "", "m.toml:6:1: bus.lost_max: cannot be here: is for EtherCAT: use pres_lost_max"),
        ("", "alias = 3", "m.toml:10:1: bus.node[0].alias: cannot be here: is for EtherCAT: on POWERLINK the id is the address"),
    ] {
        let text = machine(bus, drive, "").replace("ethercat-memory", "memory");
        assert_eq!(messages(&text), [refused]);
    }
}

/// An ESI file of one device: a PDO that is fixed, one that can be written, SYNC0 with a shift of its own.
const ESI: &str = r##"<?xml version="1.0"?>
<EtherCATInfo Version="1.6">
  <Vendor><Id>#x0000FACE</Id><Name>Maker</Name></Vendor>
  <Descriptions><Devices><Device>
    <Type ProductCode="#x00000402" RevisionNo="#x00010000">SERVO</Type>
    <Name>Servo</Name>
    <Sm StartAddress="#x1000" ControlByte="#x26" Enable="1" DefaultSize="128">MBoxOut</Sm>
    <Sm StartAddress="#x1080" ControlByte="#x22" Enable="1" DefaultSize="128">MBoxIn</Sm>
    <Sm StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
    <Sm StartAddress="#x1400" ControlByte="#x20" Enable="1">Inputs</Sm>
    <RxPdo Fixed="FIXED" Sm="2"><Index>#x1600</Index><Name>Out</Name>
      <Entry><Index>#x6040</Index><SubIndex>0</SubIndex><BitLen>16</BitLen><Name>Controlword</Name><DataType>UINT</DataType></Entry>
      <Entry><Index>#x607A</Index><SubIndex>0</SubIndex><BitLen>32</BitLen><Name>Target</Name><DataType>DINT</DataType></Entry>
    </RxPdo>
    <TxPdo Sm="3"><Index>#x1A00</Index><Name>In</Name>
      <Entry><Index>#x6041</Index><SubIndex>0</SubIndex><BitLen>16</BitLen><Name>Statusword</Name><DataType>UINT</DataType></Entry>
      <Entry><Index>#x6064</Index><SubIndex>0</SubIndex><BitLen>32</BitLen><Name>Position</Name><DataType>DINT</DataType></Entry>
    </TxPdo>
    <Mailbox><CoE SdoInfo="1" PdoAssign="1" PdoConfig="1"/></Mailbox>
    <Dc><OpMode><Name>DC</Name><AssignActivate>#x300</AssignActivate></OpMode></Dc>
  </Device></Devices></Descriptions>
</EtherCATInfo>
"##;

/// The machine whose drive has this ESI file.
fn with_esi(esi: &str, drive: &str) -> (tempfile::NamedTempFile, String) {
    let file = tempfile::NamedTempFile::new().expect("a file");
    std::fs::write(file.path(), esi).expect("it can be written");
    let drive = format!("device_file = \"{}\"\n{drive}", file.path().display());
    let text = machine("", &drive, "");
    (file, text)
}

#[test]
fn an_esi_file_fills_in_identity_process_data_and_clock() {
    let config = read(&with_esi(&ESI.replace("FIXED", "1"), "").1);
    let drive = &config.bus.nodes[0];
    assert_eq!(
        (
            drive.identity.vendor_id,
            drive.identity.product_code,
            drive.identity.revision
        ),
        (Some(0xFACE), Some(0x402), None)
    );
    let objects = |list: &[Mapped]| list.iter().map(Mapped::to_string).collect::<Vec<_>>();
    assert_eq!(objects(&drive.outputs), ["0x6040/16", "0x607A/32"]);
    // They stay as the device has them.
    assert_eq!(
        own(drive).outputs,
        [Pdo {
            index: 0x1600,
            entries: Vec::new()
        }]
    );
    assert_eq!(own(drive).clock.map(|clock| clock.activate), Some(0x0300));
}

#[test]
fn what_a_device_cannot_do_by_its_esi_file_is_refused_at_its_place() {
    let other = "outputs = [\"0x6040/16\", \"0x6060/8\", \"0x607A/32\"]";
    let (file, text) = with_esi(&ESI.replace("FIXED", "1"), other);
    let name = file.path().display();
    assert_eq!(
        messages(&text),
        [format!(
            "m.toml:11:11: bus.node[0].outputs = [\"0x6040/16\", \"0x6060/8\", \"0x607A/32\"]: do not fit {name}: PDO 0x1600 \
             cannot be changed; it has 0x1600 with 0x6040/16, 0x607A/32"
        )]
    );
    // One that can be written is.
    assert_eq!(messages(&with_esi(&ESI.replace("FIXED", "0"), other).1), [""; 0]);
    let (_file, text) = with_esi(&ESI.replace("FIXED", "0"), "product_code = 5");
    let [refused] = &messages(&text)[..] else {
        panic!("one message")
    };
    assert!(
        refused.ends_with("has no device with product_code 0x00000005, only 0x00000402 (SERVO)"),
        "{refused}"
    );
    let (_file, text) = with_esi("<EtherCATInfo>", "");
    assert!(
        messages(&text)[0].contains("is no ESI file that can be used"),
        "{:?}",
        messages(&text)
    );
}

/// The memory of a device holds process data three times, up to what the file says lies behind them.
#[test]
fn process_data_that_do_not_fit_the_memory_of_an_esi_file_are_refused_with_the_sum() {
    let told = |esi: &str| {
        let objects: Vec<String> = (0x2000..0x2020).map(|index| format!("\"0x{index:04X}/64\"")).collect();
        let outputs = format!("outputs = [\"0x6040/16\", \"0x607A/32\", {}]", objects.join(", "));
        let (file, text) = with_esi(&esi.replace("FIXED", "0"), &outputs);
        let all = messages(&text);
        assert_eq!(all.len(), 1, "{all:?}");
        all[0].replace(&file.path().display().to_string(), "FILE")
    };
    let sum =
        "do not fit SyncManager 2: 3 x 262 octets from 0x1100 on end at 0x1412, by FILE SyncManager 3 begins at 0x1400";
    assert!(told(ESI).ends_with(sum), "{}", told(ESI));
    let limited = ESI.replace("ControlByte=\"#x64\"", "ControlByte=\"#x64\" MaxSize=\"200\"");
    let most = "do not fit SyncManager 2: they have 262 octets, by FILE it holds 200";
    assert!(told(&limited).ends_with(most), "{}", told(&limited));
}

/// A terminal as makers describe them: a PDO a channel, with bits, gaps and a value.
const TERMINAL: &str = r##"<?xml version="1.0"?>
<EtherCATInfo Version="1.6">
  <Vendor><Id>#x0000FACE</Id><Name>Maker</Name></Vendor>
  <Descriptions><Devices><Device>
    <Type ProductCode="#x00000003" RevisionNo="#x00010000">MIXED</Type>
    <Sm StartAddress="#x0F00" ControlByte="#x44" Enable="1">Outputs</Sm>
    <Sm StartAddress="#x1000" ControlByte="#x20" Enable="1">Inputs</Sm>
    <RxPdo Fixed="1" Sm="0"><Index>#x1600</Index>
      <Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><DataType>BOOL</DataType></Entry></RxPdo>
    <RxPdo Fixed="1" Sm="0"><Index>#x1601</Index>
      <Entry><Index>#x7010</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><DataType>BOOL</DataType></Entry></RxPdo>
    <TxPdo Fixed="1" Sm="1"><Index>#x1A00</Index>
      <Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><DataType>BOOL</DataType></Entry>
      <Entry><Index>#x6000</Index><SubIndex>3</SubIndex><BitLen>2</BitLen><DataType>BIT2</DataType></Entry>
      <Entry><Index>#x0</Index><BitLen>18</BitLen></Entry>
      <Entry><Index>#x6000</Index><SubIndex>15</SubIndex><BitLen>1</BitLen><DataType>BOOL</DataType></Entry>
      <Entry><Index>#x0</Index><BitLen>2</BitLen></Entry>
      <Entry><Index>#x6000</Index><SubIndex>17</SubIndex><BitLen>16</BitLen><DataType>INT</DataType></Entry></TxPdo>
  </Device></Devices></Descriptions>
</EtherCATInfo>
"##;

/// The machine whose terminal has this ESI file.
fn with_terminal(esi: &str, io: &str) -> (tempfile::NamedTempFile, String) {
    let file = tempfile::NamedTempFile::new().expect("a file");
    std::fs::write(file.path(), esi).expect("it can be written");
    let io = format!("device_file = \"{}\"\n{io}", file.path().display());
    let text = machine("", "", &io);
    (file, text)
}

/// Bits of several PDOs share an octet; an octet in which nothing begins has a name all the same.
#[test]
fn bits_and_gaps_of_an_esi_file_are_gathered_into_octets() {
    let config = read(&with_terminal(TERMINAL, "").1);
    let io = &config.bus.nodes[1];
    let objects = |list: &[Mapped]| list.iter().map(Mapped::to_string).collect::<Vec<_>>();
    assert_eq!(objects(&io.outputs), ["0x7000:1/8"]);
    assert_eq!(
        objects(&io.inputs),
        ["0x6000:1/8", "0x5FFF:2/8", "0x6000:15/8", "0x6000:17/16"]
    );
    let pdo = |index| Pdo {
        index,
        entries: Vec::new(),
    };
    assert_eq!(own(io).outputs, [pdo(0x1600), pdo(0x1601)]);
    assert_eq!(own(io).inputs, [pdo(0x1A00)]);
    // The same written out; anything else does not fit what is fixed.
    let inputs = "inputs = [\"0x6000:1/8\", \"0x5FFF:2/8\", \"0x6000:15/8\", \"0x6000:17/16\"]";
    assert_eq!(messages(&with_terminal(TERMINAL, inputs).1), [""; 0]);
    let [refused] = &messages(&with_terminal(TERMINAL, "inputs = [\"0x6000:17/16\"]").1)[..] else {
        panic!("one message")
    };
    assert!(
        refused.contains("the device has no mailbox by which its PDOs could be changed"),
        "{refused}"
    );
}

/// Inputs and outputs run with the frames where their file has a mode for that; where clocks are asked for, shifts are those of the file.
#[test]
fn clocks_and_types_are_as_the_esi_file_has_them() {
    let free = "<OpMode><Name>FreeRun</Name><AssignActivate>#x0</AssignActivate></OpMode>";
    let dc = "<OpMode><Name>DC</Name><AssignActivate>#x700</AssignActivate><ShiftTimeSync0>30000</ShiftTimeSync0>\
              <CycleTimeSync1 Factor=\"1\">0</CycleTimeSync1><ShiftTimeSync1>250000</ShiftTimeSync1></OpMode>";
    let read_with = |modes: &str, io: &str| {
        let esi = TERMINAL.replace("  </Device>", &format!("<Dc>{modes}</Dc></Device>"));
        read(&with_terminal(&esi, io).1)
    };
    let clock_of = |modes: &str, io: &str| own(&read_with(modes, io).bus.nodes[1]).clock;
    let both = [free, dc].concat();
    assert_eq!(clock_of(&both, ""), None);
    let wanted = SyncClock {
        activate: 0x0700,
        shift_ns: 530_000,
        sync1_ns: 250_000,
    };
    assert_eq!(clock_of(&both, "dc = true"), Some(wanted));
    assert_eq!(clock_of(dc, ""), Some(wanted), "it has no other mode");
    let moved = SyncClock {
        shift_ns: 100_000,
        sync1_ns: 7_000,
        ..wanted
    };
    assert_eq!(clock_of(dc, "shift_us = 100\nsync1_us = 7"), Some(moved));
    let config = read_with(free, "");
    let io = &config.bus.nodes[1];
    let kinds: Vec<ObjectKind> = io.inputs.iter().map(|object| io.object_kind(*object)).collect();
    let bits = ObjectKind::Bits;
    assert_eq!(kinds, [bits, bits, bits, ObjectKind::Signed]);
}

/// What a device does not have needs no empty list; what it has and does not assign by itself has to be chosen.
#[test]
fn a_list_that_is_left_out_is_what_the_esi_file_assigns() {
    let told = |esi: &str, io: &str| {
        let (file, text) = with_terminal(esi, io);
        let all = messages(&text);
        all.iter()
            .map(|line| line.replace(&file.path().display().to_string(), "FILE"))
            .collect::<Vec<_>>()
    };
    let start = TERMINAL.find("<TxPdo").expect("inputs");
    let end = TERMINAL.find("</TxPdo>").expect("inputs") + "</TxPdo>".len();
    let outputs_only = format!("{}{}", &TERMINAL[..start], &TERMINAL[end..]);
    let config = read(&with_terminal(&outputs_only, "").1);
    let io = &config.bus.nodes[1];
    assert_eq!(
        (io.outputs.len(), &io.inputs[..], &own(io).inputs[..]),
        (1, &[][..], &[][..])
    );
    assert_eq!(
        told(&outputs_only, "inputs = [\"0x6000:1/8\"]"),
        [
            "m.toml:15:10: bus.node[1].inputs = [\"0x6000:1/8\"]: must be [] or left out: by FILE the device has no inputs"
        ]
    );
    // Of PDOs that are only there if somebody wants them, nobody wants one.
    let optional = TERMINAL.replace("<TxPdo Fixed=\"1\" Sm=\"1\">", "<TxPdo Fixed=\"1\">");
    assert_eq!(read(&with_terminal(&optional, "").1).bus.nodes[1].inputs, []);
    let none = optional.replace("<RxPdo Fixed=\"1\" Sm=\"0\">", "<RxPdo Fixed=\"1\">");
    let told = told(&none, "outputs = []");
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(
        told[0].ends_with(
            "bus.node[1].inputs: are missing: FILE assigns none; list the objects of PDOs of the device, or [] for none: it has \
             0x1A00 with 0x6000:1/8, 0x5FFF:2/8, 0x6000:15/8, 0x6000:17/16"
        ),
        "{told:?}"
    );
}

#[test]
fn an_entry_of_an_esi_file_that_cannot_be_exchanged_is_named() {
    let told = |esi: &str| {
        let (file, text) = with_terminal(esi, "");
        let all = messages(&text);
        assert_eq!(all.len(), 1, "{all:?}");
        all[0].replace(&file.path().display().to_string(), "FILE")
    };
    let crossing = TERMINAL.replace("<BitLen>18</BitLen>", "<BitLen>20</BitLen>").replace(
        "<BitLen>1</BitLen><DataType>BOOL</DataType></Entry>\n      <Entry><Index>#x0</Index><BitLen>2</BitLen>",
        "<BitLen>2</BitLen><DataType>BIT2</DataType></Entry>\n      <Entry><Index>#x0</Index><BitLen>7</BitLen>",
    );
    assert!(
        told(&crossing).ends_with(
            "has inputs that cannot be exchanged as they are: PDO 0x1A00: entry 0x6000:15 has 2 bits from bit 7 of an octet on; \
             exchanged are 8, 16, 32 and 64 bits from bit 0 on, and what lies within one octet"
        ),
        "{}",
        told(&crossing)
    );
}

/// A coupler whose slots are open: a machine file has to say what stands in them.
const COUPLER: &str = r##"<?xml version="1.0"?>
<EtherCATInfo><Vendor><Id>#xFACE</Id></Vendor><Descriptions>
  <Devices><Device><Type ProductCode="#x1000" RevisionNo="#x1">COUPLER</Type>
    <Sm>MBoxOut</Sm><Sm>MBoxIn</Sm><Sm>Outputs</Sm><Sm>Inputs</Sm>
    <Mailbox><CoE PdoAssign="1"><InitCmd><Transition>SO</Transition><Index>#x2000</Index><SubIndex>1</SubIndex><Data>07</Data></InitCmd>
      <InitCmd><Transition>PS</Transition><Index>#x1C12</Index><SubIndex>0</SubIndex><Data>00</Data></InitCmd></CoE></Mailbox>
    <Slots SlotPdoIncrement="1" SlotIndexIncrement="#x10" DownloadModuleIdentList="1">
      <Slot MinInstances="0" MaxInstances="1"><Name>Outputs</Name><ModuleIdent>#x21</ModuleIdent><ModuleIdent>#x22</ModuleIdent></Slot>
      <Slot MinInstances="1" MaxInstances="1"><Name>Any</Name><ModuleIdent>#x20</ModuleIdent><ModuleIdent>#x21</ModuleIdent></Slot>
    </Slots>
  </Device></Devices>
  <Modules>
    <Module><Type ModuleIdent="#x20">DI4</Type><TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A00</Index>
      <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen></Entry></TxPdo></Module>
    <Module><Type ModuleIdent="#x21">AO1</Type><RxPdo Fixed="1" Sm="2"><Index DependOnSlot="1">#x1600</Index>
      <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>17</SubIndex><BitLen>16</BitLen></Entry></RxPdo>
      <Mailbox><CoE><InitCmd><Transition>PS</Transition><Index DependOnSlot="1">#x8000</Index><SubIndex>2</SubIndex>
        <Data>3412</Data></InitCmd></CoE></Mailbox></Module>
    <Module><Type ModuleIdent="#x22">AO1</Type></Module>
  </Modules>
</Descriptions></EtherCATInfo>"##;

#[test]
fn modules_of_slots_are_chosen_by_type_or_number() {
    let (_file, text) = with_terminal(COUPLER, "modules = [\"0x21\", \"DI4\"]");
    let config = read(&text);
    let io = &config.bus.nodes[1];
    let objects = |list: &[Mapped]| list.iter().map(Mapped::to_string).collect::<Vec<_>>();
    assert_eq!(objects(&io.outputs), ["0x7000:17/16"]);
    assert_eq!(objects(&io.inputs), ["0x6010:1/8"]);
    assert_eq!(own(io).modules, [0x21, 0x20]);
    // Not what is for SAFE-OP, nor what the control assigns itself.
    let start: Vec<(u16, u8)> = own(io).start.iter().map(|it| (it.index, it.sub)).collect();
    assert_eq!(start, [(0xF030, 0), (0xF030, 1), (0xF030, 2), (0xF030, 0), (0x8000, 2)]);
    // The first slot may be empty.
    let config = read(&with_terminal(COUPLER, "modules = [\"\", \"AO1\"]").1);
    assert_eq!(objects(&config.bus.nodes[1].outputs), ["0x7010:17/16"]);
    assert_eq!(config.bus.nodes[1].inputs, []);
    assert_eq!(own(&config.bus.nodes[1]).modules, [0, 0x21]);
}

#[test]
#[rustfmt::skip] // one case a line
fn modules_that_cannot_be_are_refused_at_their_places() {
    let slot = "slot 2 (Any) cannot be empty: it takes DI4 (0x20), AO1 (0x21)";
    for (modules, refused) in [
        ("", "device_file = \"FILE\": does not tell what COUPLER exchanges: slot \"Outputs\" in line 8 may hold one of several modules, and none of them is usual (ModuleIdent Default): modules of the node chooses them".to_owned()),
        ("modules = [\"\", \"DO4\"]", "modules[1] = \"DO4\": is no module of the device file, by its type or as ModuleIdent like \"0x21\"; did you mean \"DI4\"?".to_owned()),
        ("modules = [\"\", \"0x99\"]", "modules[1] = \"0x99\": is no module of the device file, by its type or as ModuleIdent like \"0x21\"".to_owned()),
        ("modules = [\"DI4\", \"DI4\"]", "modules[0] = \"DI4\": cannot stand in slot 1 (Outputs), which takes AO1 (0x21), AO1 (0x22)".to_owned()),
        ("modules = [\"AO1\", \"DI4\"]", "modules[0] = \"AO1\": is the type of several modules: one of 0x21, 0x22".to_owned()),
        ("modules = [\"\", \"DI4\", \"DI4\"]", "modules[2] = \"DI4\": is too many: COUPLER has 2 slots".to_owned()),
        ("modules = [\"\", \"\"]", format!("modules[1] = \"\": {slot}")),
        ("modules = [\"\"]", format!("modules = [\"\"]: ends before {slot}")),
        ("modules = [\"\", 32]", "modules[1] = 32: must be a string, is an integer".to_owned()),
        ("modules = \"DI4\"", "modules = \"DI4\": must be an array, is a string".to_owned()),
    ] {
        let (file, text) = with_terminal(COUPLER, modules);
        let told: Vec<String> = messages(&text).iter().map(|line| line.replace(&file.path().display().to_string(), "FILE")).collect();
        let place = |line: &str| line.splitn(4, ':').nth(3).map(|line| line.trim().trim_start_matches("bus.node[1].").to_owned());
        assert_eq!(told.iter().filter_map(|line| place(line)).collect::<Vec<_>>(), [refused], "{modules}");
        // The line of the key.
        let line = text.lines().position(|line| line.starts_with(if modules.is_empty() { "device_file" } else { "modules" })).map(|at| at + 1);
        assert!(told[0].starts_with(&format!("m.toml:{}:", line.unwrap_or(0))), "{told:?}");
    }
    let (_file, text) = with_terminal(TERMINAL, "modules = [\"DI4\"]");
    assert!(messages(&text)[0].ends_with("modules[0] = \"DI4\": is too many: MIXED has 0 slots"), "{:?}", messages(&text));
    let alone = machine("", "", "modules = [\"DI4\"]");
    assert!(messages(&alone)[0].ends_with("needs device_file, an ESI file: it tells slots and modules"), "{:?}", messages(&alone));
}

/// An odd device of a file refuses only whoever asks for it.
#[test]
fn only_the_device_that_is_asked_for_is_judged() {
    let second = "<Device><Type ProductCode=\"#x77\" RevisionNo=\"#x1\">ODD</Type><RxPdo><Index>#x1800</Index></RxPdo></Device></Devices>";
    let esi = ESI.replace("FIXED", "0").replace("</Devices>", second);
    let asked = |product: &str| {
        let (file, text) = with_esi(&esi, &format!("product_code = {product}"));
        let told = messages(&text);
        drop(file);
        told
    };
    assert_eq!(asked("0x402"), [""; 0]);
    let told = asked("0x77");
    assert!(
        told[0].contains("cannot be used for ODD: ")
            && told[0].contains("RxPdo Index = \"#x1800\": expected an integer"),
        "{told:?}"
    );
}
