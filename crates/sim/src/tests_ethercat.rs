//! The main device of this project against the simulated machine, on virtual time.

use super::{SimMachine, test_config};
use bus::ethercat::setup;
use cia402::axis::{Axis, AxisConfig, AxisFault, Feedback, Request, Status};
use cia402::profile::State;
use config::{BusKind, Mapped, Node, Profile, SimFaultKind};
use ethercat::main::config::{ClockConfig, Config, DeviceConfig, Expected, PdoConfig, ProcessDataConfig, Times};
use ethercat::main::{DeviceState, MainDevice, PhaseConfig, PhaseLoop, SetupError};
use ethercat::wire::coe::Object;
use machine::fault_order::{FAULT, FaultOrder};

const MS: u64 = 1_000_000;
const X: usize = 0;
const IO: usize = 3;
const X_ID: u8 = 1;
const IO_ID: u8 = 10;

fn ethercat_config() -> config::Config {
    let mut config = test_config();
    config.bus.kind = BusKind::EthercatMemory;
    config
}

fn process_data(index: u16, mapped: &[Mapped]) -> ProcessDataConfig<'static> {
    let entries: Vec<u32> = mapped.iter().map(Mapped::entry).collect();
    let pdos = vec![PdoConfig {
        index,
        entries: entries.leak(),
    }];
    ProcessDataConfig {
        octets: mapped.iter().map(|object| u16::from(object.bits) / 8).sum(),
        pdos: pdos.leak(),
    }
}

fn device(node: &Node) -> DeviceConfig<'static> {
    DeviceConfig {
        outputs: process_data(0x1600, &node.outputs),
        inputs: process_data(0x1A00, &node.inputs),
        expected: Expected {
            vendor: node.identity.vendor_id,
            ..Expected::default()
        },
        clock: (node.profile == Profile::Cia402).then_some(ClockConfig {
            activate: 0x0300,
            shift_ns: (MS / 2) as i32,
            sync1_ns: 0,
        }),
        ..DeviceConfig::at(u16::from(node.id) - 1)
    }
}

/// A control in miniature: main device, one controller for each drive, outputs of the I/O node.
struct Rig {
    machine: SimMachine,
    main: Box<MainDevice<'static, 16, 4>>,
    phase: PhaseLoop,
    axes: Vec<Axis>,
    /// Commanded positions, counts.
    commanded: [i64; 3],
    outputs: [u8; 2],
    now_ns: u64,
    date_ns: u64,
}

impl Rig {
    fn new() -> Rig {
        let mut file = ethercat_config();
        // The machine is as it was put into service, the main device writes another mapping.
        let machine = SimMachine::new(&file).expect("a machine");
        for node in file.bus.nodes.iter_mut().filter(|node| node.profile == Profile::Cia402) {
            node.inputs.reverse();
        }
        let config = Config {
            cycle_ns: MS as u32,
            devices: file.bus.nodes.iter().map(device).collect::<Vec<_>>().leak(),
            lost_max: 2,
            times: Times::default(),
        };
        Rig::with(machine, config, 3)
    }

    /// The main device of a machine file, which nobody controls, in front of the machine of another one.
    fn of_file(file: config::Config, simulated: &config::Config) -> Rig {
        let file: &'static config::Config = Box::leak(Box::new(file));
        let plans: &'static [_] = bus::plan(file).leak();
        let tables: &'static [_] = setup::tables(file, plans).leak();
        let devices: &'static [_] = setup::devices(file, plans, tables).leak();
        let machine = SimMachine::new(simulated).unwrap_or_else(|error| panic!("{error}"));
        Rig::with(machine, setup::network(file, devices), 0)
    }

    fn with(machine: SimMachine, config: Config<'static>, axes: usize) -> Rig {
        let config = Box::leak(Box::new(config));
        Rig {
            machine,
            main: Box::new(MainDevice::new([0x10; 6], config).expect("it fits")),
            phase: PhaseLoop::new(PhaseConfig::of_cycle(MS as u32)),
            axes: (0..axes).map(|_| Axis::new(AxisConfig::default())).collect(),
            commanded: [0; 3],
            outputs: [0; 2],
            now_ns: MS,
            date_ns: 2 * MS,
        }
    }

    fn pass_until(&mut self, until_ns: u64) {
        while self.now_ns < until_ns {
            let due_ns = self.machine.next_poll_ns().max(self.now_ns + 1);
            self.now_ns = due_ns.min(until_ns);
            self.machine
                .poll(self.now_ns, &mut |_| panic!("devices send nothing by themselves"));
        }
    }

    /// A frame goes through all devices, at once.
    fn exchange(&mut self, frame: &[u8]) {
        let mut answer = None;
        self.machine
            .receive(self.now_ns, frame, &mut |octets| answer = Some(octets.to_vec()));
        if let Some(answer) = answer {
            self.main.receive(self.now_ns, &answer);
        }
    }

    fn cycle(&mut self) {
        self.control();
        let frames = self.main.prepare();
        self.pass_until(self.date_ns);
        for number in 0..frames {
            let frame = self.main.frame(number).to_vec();
            self.exchange(&frame);
        }
        let late_ns = self.main.late_ns();
        while self.now_ns < self.date_ns + MS * 9 / 10 {
            if let Some(frame) = self.main.service_frame(self.now_ns).map(<[u8]>::to_vec) {
                self.exchange(&frame);
            }
            self.pass_until(self.now_ns + 20_000);
        }
        self.main.finish_cycle(self.now_ns);
        let moved_ns = match late_ns {
            Some(late_ns) => self.phase.correct(late_ns),
            None => self.phase.hold(),
        };
        self.date_ns = (self.date_ns + MS).wrapping_add_signed(moved_ns);
    }

    fn control(&mut self) {
        for (index, axis) in self.axes.iter_mut().enumerate() {
            let online = self.main.device_state(index) == DeviceState::Operational;
            let data = self.main.inputs(index);
            let word = |at: usize| u16::from_le_bytes([data[at], data[at + 1]]);
            let long = |at: usize| i32::from_le_bytes(data[at..at + 4].try_into().expect("four"));
            let feedback = Feedback {
                error_code: word(0),
                digital_inputs: long(2) as u32,
                mode_display: data[6] as i8,
                following_error: long(7),
                position: long(11),
                statusword: word(15),
            };
            if axis.status() != Status::Enabled {
                self.commanded[index] = axis.target_position();
            }
            let setpoint = axis.cycle(self.now_ns, online, &feedback, self.commanded[index]);
            if axis.status() != Status::Enabled {
                self.commanded[index] = axis.target_position();
            }
            let output = self.main.outputs_mut(index);
            output[..2].copy_from_slice(&setpoint.controlword.to_le_bytes());
            output[2..6].copy_from_slice(&setpoint.target_position.to_le_bytes());
            output[6] = setpoint.mode as u8;
        }
        if !self.axes.is_empty() {
            self.main.outputs_mut(IO).copy_from_slice(&self.outputs);
        }
    }

    fn cycles(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    fn until(&mut self, cycles: u32, what: &str, mut done: impl FnMut(&Rig) -> bool) {
        for _ in 0..cycles {
            if done(self) {
                return;
            }
            self.cycle();
        }
        let events: Vec<String> = std::iter::from_fn(|| self.main.pop_event())
            .map(|event| event.to_string())
            .collect();
        panic!("not within {cycles} cycles: {what}; {events:?}");
    }

    /// A value of the first device by SDO.
    fn read(&mut self, object: Object) -> Option<Result<Vec<u8>, SetupError>> {
        let number = self.main.sdo_read(0, object).expect("room for an order");
        (0..200).find_map(|_| {
            self.cycle();
            Some(self.main.sdo_result(number)?.map(<[u8]>::to_vec))
        })
    }

    fn all(&self, status: Status) -> bool {
        self.axes.iter().all(|axis| axis.status() == status)
    }

    fn enabled() -> Rig {
        let mut rig = Rig::new();
        rig.until(3000, "all in OP", |rig| rig.main.is_operational());
        rig.until(200, "drives disabled", |rig| rig.all(Status::Disabled));
        for axis in &mut rig.axes {
            axis.request(Request::Enable);
        }
        rig.until(200, "drives enabled", |rig| rig.all(Status::Enabled));
        rig
    }

    /// X at 100 mm/s, after 100 cycles of acceleration.
    fn ramp(&mut self, cycles: i64) {
        for cycle in 1..=cycles {
            self.commanded[X] += 10 * cycle.min(100);
            self.cycle();
        }
    }

    fn x_mm(&self) -> f64 {
        self.machine.joint_position_mm(X).expect("a joint")
    }
}

#[test]
fn drives_with_couplers_between_them_come_to_op_and_follow() {
    let mut rig = Rig::enabled();
    for id in [1, 2, 3, 10] {
        assert_eq!(rig.machine.is_operational(id), Some(true), "{id}");
    }
    let before_mm = rig.x_mm();
    rig.ramp(300);
    let commanded_mm = rig.commanded[X] as f64 / 10_000.0;
    rig.cycles(300);
    assert!(commanded_mm > 20.0);
    assert!((rig.x_mm() - before_mm - commanded_mm).abs() < 0.0002, "{}", rig.x_mm());
    assert!(rig.all(Status::Enabled));
}

#[test]
fn outputs_switch_and_inputs_come_back_and_all_drop_without_a_main_device() {
    let mut rig = Rig::enabled();
    rig.outputs = [0b101, 0b1];
    rig.machine.set_inputs(IO_ID, 0x40);
    rig.cycles(4);
    assert_eq!(rig.machine.outputs(IO_ID), Some([0b101, 0b1]));
    assert_eq!(rig.main.inputs(IO), [0b101, 0x40]);
    rig.pass_until(rig.now_ns + 300 * MS);
    assert_eq!(rig.machine.outputs(IO_ID), Some([0, 0]));
    assert_eq!(rig.machine.drive_state(X_ID), Some(State::SwitchOnDisabled));
}

#[test]
fn a_lost_frame_is_ridden_out() {
    let mut rig = Rig::enabled();
    rig.ramp(200);
    rig.machine.drop_pres(X_ID, 1);
    rig.ramp(50);
    assert!(rig.all(Status::Enabled) && rig.main.is_operational());
}

#[test]
fn a_drive_without_its_supply_runs_out_and_comes_back_with_a_new_encoder_zero() {
    let mut rig = Rig::enabled();
    rig.ramp(200);
    let order = FaultOrder {
        kind: Some(SimFaultKind::PowerOff),
        lasts_100ms: 3,
    };
    // It is the last on its way to nobody: those behind it are cut off with it.
    assert!(rig.machine.fault(X_ID, order));
    for _ in 0..200 {
        if rig.machine.is_operational(X_ID) == Some(true) {
            rig.commanded[X] += 1000;
            rig.cycle();
        }
    }
    assert_eq!(rig.machine.is_operational(X_ID), Some(false));
    let start_mm = rig.x_mm();
    rig.cycles(200);
    let run_out_mm = rig.x_mm() - start_mm;
    assert!(run_out_mm > 1.0 && run_out_mm < 5.0, "{run_out_mm}");
    assert_eq!(rig.axes[X].status(), Status::Faulted(AxisFault::Lost));
    rig.until(5000, "back", |rig| rig.main.is_operational());
    rig.cycles(50);
    assert_eq!(rig.axes[X].actual_position(), 0);
}

#[test]
fn a_fault_is_ordered_by_sdo_and_anything_else_refused() {
    let mut rig = Rig::enabled();
    let object = Object {
        index: FAULT,
        sub: 1,
        complete: false,
    };
    let order = FaultOrder {
        kind: Some(SimFaultKind::Overcurrent),
        lasts_100ms: 0,
    };
    let mut bad = order.octets();
    bad[7] ^= 1;
    for (octets, is_taken) in [(bad, false), (order.octets(), true)] {
        let number = rig.main.sdo_write(X, object, &octets).expect("room for an order");
        let mut result = None;
        for _ in 0..200 {
            rig.cycle();
            result = rig.main.sdo_result(number).map(|result| result.is_ok());
            if result.is_some() {
                break;
            }
        }
        assert_eq!(result, Some(is_taken));
    }
    rig.until(10, "fault", |rig| {
        rig.axes[X].fault() == Some(AxisFault::Drive { error_code: 0x2310 })
    });
    assert!(
        rig.main.is_operational(),
        "a fault of a drive is no fault of the network"
    );
}

#[test]
fn a_node_without_room_for_its_process_data_is_refused() {
    let mut config = ethercat_config();
    let many = Mapped {
        index: 0x6401,
        sub: 1,
        bits: 64,
    };
    config.bus.nodes[IO].inputs = vec![many; 129];
    let error = SimMachine::new(&config).expect_err("too much");
    assert_eq!(
        error.to_string(),
        "simulated node 10 (io): 1032 octets in one direction: a simulated device has room for 1024"
    );
}

/// A coupler of a maker: an output module or an input module in its first slot, input modules in the others.
const COUPLER: &str = r##"<?xml version="1.0"?>
<EtherCATInfo><Vendor><Id>#xFACE</Id></Vendor><Descriptions>
  <Devices><Device><Type ProductCode="#x1000" RevisionNo="#x1">COUPLER</Type>
    <Sm>MBoxOut</Sm><Sm>MBoxIn</Sm><Sm>Outputs</Sm><Sm>Inputs</Sm>
    <Mailbox><CoE PdoAssign="1" CompleteAccess="1"><InitCmd CompleteAccess="1">
      <Transition>PS</Transition><Index>#xF800</Index><SubIndex>0</SubIndex><Data>0200 0A00 0B00</Data></InitCmd></CoE></Mailbox>
    <Slots SlotPdoIncrement="1" SlotIndexIncrement="#x10" DownloadModuleIdentList="1">
      <Slot MinInstances="0" MaxInstances="3"><Name>Any</Name><ModuleIdent>#x20</ModuleIdent><ModuleIdent>#x21</ModuleIdent></Slot>
    </Slots>
  </Device></Devices>
  <Modules>
    <Module><Type ModuleIdent="#x20">DI4</Type>
      <TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A00</Index>
        <Entry><Index DependOnSlot="1">#x6800</Index><SubIndex>1</SubIndex><BitLen>4</BitLen></Entry>
        <Entry><Index>0</Index><BitLen>4</BitLen></Entry></TxPdo></Module>
    <Module><Type ModuleIdent="#x21">AO1</Type>
      <RxPdo Fixed="1" Sm="2"><Index DependOnSlot="1">#x1600</Index>
        <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>17</SubIndex><BitLen>16</BitLen></Entry></RxPdo>
      <Mailbox><CoE><InitCmd><Transition>PS</Transition><Index DependOnSlot="1">#x8000</Index><SubIndex>2</SubIndex>
        <Data>34120000</Data></InitCmd></CoE></Mailbox></Module>
  </Modules>
</Descriptions></EtherCATInfo>"##;

/// A machine of this coupler with these modules.
fn modular(modules: &str) -> config::Config {
    of_esi(COUPLER, &format!("modules = {modules}"))
}

/// A machine of the device of an ESI file, with further keys.
fn of_esi(esi: &str, keys: &str) -> config::Config {
    let file = tempfile::NamedTempFile::new().expect("a file");
    std::fs::write(file.path(), esi).expect("it can be written");
    let text = format!(
        "schema = 1\n[machine]\nname = \"small\"\nkinematics = \"none\"\n[bus]\nkind = \"ethercat-memory\"\n[[bus.node]]\nid = 1\n\
         profile = \"io\"\ndevice_file = \"{}\"\n{keys}\n",
        file.path().display()
    );
    config::parse(&text, std::path::Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn a_coupler_with_chosen_modules_comes_to_op_and_was_told_of_them() {
    let config = modular("[\"AO1\", \"\", \"0x20\"]");
    let mut rig = Rig::of_file(config.clone(), &config);
    rig.until(3000, "in OP", |rig| rig.main.is_operational());
    for (index, sub, expected) in [
        (0xF030, 0, &[3][..]),
        (0xF030, 1, &[0x21, 0, 0, 0]),
        (0xF030, 2, &[0; 4]),
        (0xF030, 3, &[0x20, 0, 0, 0]),
        // The device's own command, and that of its module.
        (0xF800, 2, &[0x0B, 0]),
        (0x8000, 2, &[0x34, 0x12, 0, 0]),
        (0x1C12, 1, &[0x00, 0x16]),
        (0x1C13, 1, &[0x02, 0x1A]),
    ] {
        let complete = false;
        let value = rig.read(Object { index, sub, complete });
        assert_eq!(value, Some(Ok(expected.to_vec())), "0x{index:04X}:{sub}");
    }
    assert_eq!((rig.main.outputs_mut(0).len(), rig.main.inputs(0).len()), (2, 1));
}

/// Modules of the same process data, so that nothing else tells them apart.
#[test]
fn a_coupler_with_other_modules_says_so() {
    let simulated = modular("[\"AO1\", \"\", \"DI4\"]");
    let mut file = simulated.clone();
    let own = file.bus.nodes[0].ethercat.as_mut().expect("of EtherCAT");
    let third = own
        .start
        .iter_mut()
        .find(|command| (command.index, command.sub) == (0xF030, 3));
    third.expect("the list").value[0] = 0x22;
    let mut rig = Rig::of_file(file, &simulated);
    rig.cycles(3000);
    assert!(!rig.main.is_operational());
    let told: Vec<String> = std::iter::from_fn(|| rig.main.pop_event())
        .map(|event| event.to_string())
        .collect();
    assert!(
        told.iter()
            .any(|line| line.contains("modules differ from those configured")),
        "{told:?}"
    );
}

/// As much as a simulated device has room for, both ways: three buffers of each lie side by side in its memory.
#[test]
fn most_process_data_of_both_directions_do_not_meet_in_the_memory_of_a_device() {
    const OCTETS: usize = 1024;
    let pdo = |kind: &str, manager: u8, pdo: u16, object: u16| {
        let entry = |sub: usize| {
            format!("<Entry><Index>#x{object:04X}</Index><SubIndex>{sub}</SubIndex><BitLen>64</BitLen></Entry>")
        };
        let entries: String = (1..=OCTETS / 8).map(entry).collect();
        format!("<{kind} Fixed=\"1\" Sm=\"{manager}\"><Index>#x{pdo:04X}</Index>{entries}</{kind}>")
    };
    let esi = format!(
        "<EtherCATInfo><Vendor><Id>#xFACE</Id></Vendor><Descriptions><Devices><Device><Type ProductCode=\"7\">WIDE</Type>\
         <Sm>MBoxOut</Sm><Sm>MBoxIn</Sm><Sm>Outputs</Sm><Sm>Inputs</Sm>{}{}<Mailbox><CoE PdoAssign=\"1\"/></Mailbox>\
         </Device></Devices></Descriptions></EtherCATInfo>",
        pdo("RxPdo", 2, 0x1600, 0x3800),
        pdo("TxPdo", 3, 0x1A00, 0x3900)
    );
    let config = of_esi(&esi, "");
    let mut rig = Rig::of_file(config.clone(), &config);
    rig.until(3000, "in OP", |rig| rig.main.is_operational());
    for round in 0..9_u8 {
        for (at, octet) in rig.main.outputs_mut(0).iter_mut().enumerate() {
            *octet = (at as u8).wrapping_mul(31).wrapping_add(round) | 1;
        }
        rig.cycle();
        assert_eq!(rig.main.inputs(0), [0; OCTETS], "{round}");
    }
    let last: Vec<u8> = rig.main.outputs_mut(0)[OCTETS - 8..].to_vec();
    let object = Object {
        index: 0x3800,
        sub: (OCTETS / 8) as u8,
        complete: false,
    };
    assert_eq!(rig.read(object), Some(Ok(last)));
}
