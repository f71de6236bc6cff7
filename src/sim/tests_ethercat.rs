//! The main device of this project against the simulated machine, on virtual time.

use super::{FaultOrder, SimMachine, test_config};
use crate::config::{BusKind, Mapped, Node, Profile, SimFaultKind};
use cia402::axis::{Axis, AxisConfig, AxisFault, Feedback, Request, Status};
use cia402::profile::State;
use ethercat::main::config::{ClockConfig, Config, DeviceConfig, Expected, PdoConfig, ProcessDataConfig, Times};
use ethercat::main::{DeviceState, MainDevice, PhaseConfig, PhaseLoop};
use ethercat::wire::coe::Object;

const MS: u64 = 1_000_000;
const X: usize = 0;
const IO: usize = 3;
const X_ID: u8 = 1;
const IO_ID: u8 = 10;

fn ethercat_config() -> crate::config::Config {
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
        let config = Box::leak(Box::new(Config {
            cycle_ns: MS as u32,
            devices: file.bus.nodes.iter().map(device).collect::<Vec<_>>().leak(),
            lost_max: 2,
            times: Times::default(),
        }));
        Rig {
            machine,
            main: Box::new(MainDevice::new([0x10; 6], config).expect("it fits")),
            phase: PhaseLoop::new(PhaseConfig::of_cycle(MS as u32)),
            axes: (0..3).map(|_| Axis::new(AxisConfig::default())).collect(),
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
        self.main.outputs_mut(IO).copy_from_slice(&self.outputs);
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
        index: super::FAULT,
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
