//! Joints on a table: the payloads go straight to drives that follow without a lag.

use super::touch::Touch;
use super::*;
use bus::layout::Layout;
use cia402::device::{Control, DRIVE_OBJECTS, Delays, Demand, Device, Sensors};
use config::DriveMode;
use motion::rt::Pid;
use obd::{Dictionary, Scalar};
use std::path::Path;

const DEMO: &str = include_str!("../../../../configs/mill3-demo.toml");
const CYCLE_NS: u64 = 1_000_000;

/// The first joint of the demo machine and its drive.
struct Table {
    drives: Drives,
    plans: Vec<NodePlan>,
    outputs: OutputImage,
    inputs: InputImage,
    objects: Dictionary<{ obd::lines_of(DRIVE_OBJECTS) }, { obd::octets_of(DRIVE_OBJECTS) }>,
    device: Device,
    sensors: Sensors,
    demand: Demand,
    now_ns: u64,
    command_mm: f64,
    /// The next answer gets lost.
    stale: bool,
}

impl Table {
    /// `outputs` behind controlword and mode.
    fn new(mode: DriveMode, outputs: &[(u16, u8, u8)]) -> Table {
        Table::with(mode, outputs, None)
    }

    fn with(mode: DriveMode, outputs: &[(u16, u8, u8)], torque_per_mm_s2: Option<f64>) -> Table {
        let mut config = config::parse(DEMO, Path::new("m.toml")).unwrap();
        config.joints.truncate(1);
        config.joints[0].mode = mode;
        config.joints[0].torque_per_mm_s2 = torque_per_mm_s2;
        config.joints[0].velocity_ratio = [6, 1000];
        let always = [(0x6040, 0, 16), (0x6060, 0, 8)];
        let objects = always.iter().chain(outputs);
        config.bus.nodes[0].outputs = objects
            .map(|&(index, sub, bits)| config::Mapped { index, sub, bits })
            .collect();
        let plans = bus::plan(&config);
        let objects = Dictionary::new(&[DRIVE_OBJECTS]).unwrap();
        let device = Device::new(&objects, CYCLE_NS as u32, Delays::default()).unwrap();
        Table {
            drives: Drives::new(&config, &plans).unwrap(),
            outputs: OutputImage::new(plans.iter().map(|plan| plan.outputs.octets)),
            inputs: InputImage::new(plans.iter().map(|plan| plan.inputs.octets)),
            plans,
            objects,
            device,
            sensors: Sensors::default(),
            demand: Demand::default(),
            now_ns: 0,
            command_mm: 0.0,
            stale: false,
        }
    }

    /// One cycle, led by this.
    fn cycle(&mut self, effort: Option<Effort>) {
        self.now_ns += CYCLE_NS;
        self.inputs.fresh[0] = !self.stale;
        for field in &self.plans[0].inputs.fields {
            let octets = self.objects.read(field.object.index, field.object.sub).unwrap();
            let mut value = [0; 8];
            value[..octets.len()].copy_from_slice(octets);
            field.write(self.inputs.payload.node_mut(0), u64::from_le_bytes(value));
        }
        self.drives.read(&self.inputs, |_| NodeState::Operational);
        if let Some(effort) = effort {
            self.drives.drives[0].effort = effort;
        }
        self.drives.write(self.now_ns, &[self.command_mm], &mut self.outputs);
        for field in &self.plans[0].outputs.fields {
            let entry = self.objects.find(field.object.index, field.object.sub).unwrap();
            let value = field.read(self.outputs.node(0)).to_le_bytes();
            self.objects
                .set_octets(entry, &value[..usize::from(field.object.bits / 8)])
                .unwrap();
        }
        self.demand = self.device.cycle(&mut self.objects, &self.sensors, true);
        if self.demand.powered {
            let before = self.sensors.position;
            self.sensors.position = self.demand.position.round() as i64;
            self.sensors.velocity = (self.sensors.position - before) * 1000;
        }
    }

    fn enabled(mode: DriveMode, outputs: &[(u16, u8, u8)]) -> Table {
        let mut table = Table::new(mode, outputs);
        table.enable();
        table
    }

    fn enable(&mut self) {
        for _ in 0..100 {
            if self.drives.drives[0].status() == Status::Enabled {
                return;
            }
            self.cycle(None);
            self.drives.request(1, Request::Enable);
        }
        assert_eq!(self.drives.drives[0].status(), Status::Enabled);
    }

    fn object<T: Scalar>(&self, index: u16, sub: u8) -> T {
        self.objects.get(self.objects.key(index, sub).unwrap())
    }
}

#[test]
fn the_target_goes_into_the_object_of_the_mode_or_into_the_position_demand() {
    for (mode, index, sub) in [
        (DriveMode::Csp, 0x607A, 0),
        (DriveMode::Ip, 0x60C1, 1),
        (DriveMode::Csp, 0x6062, 0),
        (DriveMode::Ip, 0x6062, 0),
    ] {
        let mut table = Table::new(mode, &[(index, sub, 32)]);
        table.now_ns += CYCLE_NS;
        table.inputs.fresh[0] = true;
        let field = *table.plans[0]
            .inputs
            .fields
            .iter()
            .find(|field| field.object.index == 0x6064)
            .unwrap();
        field.write(table.inputs.payload.node_mut(0), 0xFFFF_FFF0);
        table.drives.read(&table.inputs, |_| NodeState::Operational);
        table.drives.write(table.now_ns, &[0.0], &mut table.outputs);
        let target = table.plans[0].outputs.find(index, sub).unwrap();
        assert_eq!(target.read_signed(table.outputs.node(0)), -16, "{mode:?} {index:04X}");
    }
}

#[test]
fn a_velocity_is_told_in_the_unit_of_the_drive_and_only_for_one_cycle() {
    let mut table = Table::enabled(DriveMode::Csv, &[(0x60FF, 0, 32), (0x60B2, 0, 16)]);
    let led = |velocity_mm_s: f64| Effort {
        velocity_mm_s,
        ..Effort::default()
    };
    table.cycle(Some(led(10.0)));
    // 10 mm/s are 100,000 increments/s, and 6 for a thousand of them.
    assert_eq!(table.object::<i32>(0x60FF, 0), 600);
    assert_eq!(
        (table.demand.control, table.demand.velocity),
        (Control::Velocity, 600.0)
    );
    table.cycle(None);
    assert_eq!(table.object::<i32>(0x60FF, 0), 0);
    // As far as numbers go, and no further.
    table.cycle(Some(led(1e300)));
    assert_eq!(table.object::<i32>(0x60FF, 0), i32::MAX);
    // The torque beside it belongs to whoever writes its pin.
    let config = config::parse(DEMO, Path::new("m.toml")).unwrap();
    let joint = Joint {
        mode: DriveMode::Csv,
        ..config.joints[0].clone()
    };
    assert!(is_filled(&joint, (0x60FF, 0)) && !is_filled(&joint, (0x60B2, 0)));
}

#[test]
fn a_torque_is_told_while_the_drive_is_enabled() {
    let mut table = Table::enabled(DriveMode::Cst, &[(0x6071, 0, 16)]);
    let effort = Effort {
        torque: 0.5,
        ..Effort::default()
    };
    table.cycle(Some(effort));
    assert_eq!(
        (table.demand.control, table.object::<i16>(0x6071, 0)),
        (Control::Torque, 500)
    );
    table.drives.request(1, Request::QuickStop);
    table.cycle(Some(effort));
    assert_eq!(table.object::<i16>(0x6071, 0), 0);
}

#[test]
fn a_drive_that_holds_its_position_is_not_led() {
    let mut table = Table::enabled(DriveMode::Csp, &[(0x607A, 0, 32), (0x60B2, 0, 16), (0x60FF, 0, 32)]);
    let effort = Effort {
        velocity_mm_s: 10.0,
        torque: 0.5,
    };
    table.cycle(Some(effort));
    table.cycle(Some(effort));
    assert_eq!((table.object::<i32>(0x60FF, 0), table.object::<i16>(0x60B2, 0)), (0, 0));
    assert_eq!(table.sensors.position, 0);
}

#[test]
fn a_drive_that_holds_its_position_is_told_speed_and_torque_of_the_command() {
    let mut table = Table::with(
        DriveMode::Csp,
        &[(0x607A, 0, 32), (0x60B1, 0, 32), (0x60B2, 0, 16)],
        Some(0.05),
    );
    table.enable();
    let told = |table: &Table| (table.object::<i32>(0x60B1, 0), table.object::<i16>(0x60B2, 0));
    assert_eq!(told(&table), (0, 0));
    // 10 mm/s are 600 for this drive; from rest within a cycle they are 10,000 mm/s².
    for (step_mm, expected) in [
        (0.01, (600, 500)),
        (0.01, (600, 0)),
        (0.005, (300, -250)),
        (0.0, (0, -250)),
        (0.0, (0, 0)),
    ] {
        table.command_mm += step_mm;
        table.cycle(None);
        assert_eq!(told(&table), expected, "{step_mm}");
    }
    // What it was told before it was off says nothing of how it moves now.
    table.drives.request(1, Request::Disable);
    for _ in 0..50 {
        table.cycle(None);
    }
    table.command_mm = table.drives.drives[0].command_mm() + 1.0;
    table.enable();
    assert_eq!(told(&table), (0, 0));
}

const GAINS: PidGains = PidGains {
    p: 50.0,
    i: 0.0,
    d: 0.0,
    ff: [0.0, 1.0, 0.0, 0.0],
    bias: 0.0,
    dead_band: 0.0,
    error_max: 0.0,
    integral_max: 0.0,
    derivative_max: 0.0,
    ff_max: [0.0; 3],
    output_max: 180.0,
};

impl Table {
    /// A drive in CSV that takes 60FF for increments/s, with a loop around it.
    fn with_loop() -> Table {
        let mut table = Table::enabled(DriveMode::Csv, &[(0x60FF, 0, 32)]);
        table.drives.drives[0].velocity_per_mm_s = 10_000.0;
        table.drives.drives[0].pid = Some(Pid::new(GAINS, 1e-3));
        table.drives.drives[0].pid.as_mut().unwrap().restart(0.0);
        table
    }
}

#[test]
fn a_loop_around_a_velocity_brings_the_joint_where_it_is_told() {
    let mut table = Table::with_loop();
    for _ in 0..600 {
        table.command_mm = (table.command_mm + 0.01).min(2.0);
        table.cycle(None);
    }
    let drive = &table.drives.drives[0];
    assert!((drive.actual_mm() - 2.0).abs() <= 0.001, "{}", drive.actual_mm());
    assert!(
        drive.following_error_mm().abs() <= 0.001,
        "{}",
        drive.following_error_mm()
    );
    assert_eq!(drive.status(), Status::Enabled);
}

#[test]
fn a_loop_goes_on_evenly_where_an_answer_is_lost() {
    let mut table = Table::with_loop();
    let mut velocities = Vec::new();
    for cycle in 0..300 {
        table.command_mm += 0.01;
        table.stale = cycle > 200 && cycle % 3 != 0;
        table.cycle(None);
        velocities.push(table.object::<i32>(0x60FF, 0));
    }
    // 10 mm/s are 100,000 increments/s.
    let [least, most] = [velocities[200..].iter().min(), velocities[200..].iter().max()].map(|value| *value.unwrap());
    assert!(
        (99_000..101_000).contains(&least) && (99_000..101_000).contains(&most),
        "{least} to {most}"
    );
}

#[test]
fn a_loop_begins_anew_when_its_drive_is_enabled() {
    let mut table = Table::with_loop();
    for _ in 0..100 {
        table.command_mm += 0.01;
        table.cycle(None);
    }
    table.drives.request(1, Request::QuickStop);
    for _ in 0..200 {
        table.cycle(None);
        assert_eq!(table.object::<i32>(0x60FF, 0), 0);
    }
    // Nothing is left of the way that was still to go.
    let mut most = 0;
    for _ in 0..200 {
        table.drives.request(1, Request::Enable);
        table.command_mm = table.drives.drives[0].command_mm();
        table.cycle(None);
        most = most.max(table.object::<i32>(0x60FF, 0).abs());
    }
    assert_eq!(table.drives.drives[0].status(), Status::Enabled);
    assert!(most <= 600, "{most}");
}

#[test]
fn gains_follow_their_pins_and_what_is_no_number_changes_nothing() {
    let mut table = Table::with_loop();
    let folder = tempfile::tempdir().unwrap();
    let mut hal = hal_pins::Hal::create_in(&[folder.path().to_owned()], "loops", 64).unwrap();
    let mut pins = super::super::loop_pins::LoopPins::new(&mut hal, 0, &GAINS).unwrap();
    let gains = |table: &Table| *table.drives.drives[0].position_loop().unwrap().gains();
    pins.turn(&mut table.drives, || false);
    assert_eq!(gains(&table), GAINS, "as the machine file has them");
    hal.set("pid.0.pgain", 55.0).unwrap();
    hal.set("pid.0.ff2", 0.01).unwrap();
    pins.turn(&mut table.drives, || false);
    let turned = PidGains {
        p: 55.0,
        ff: [0.0, 1.0, 0.01, 0.0],
        ..GAINS
    };
    assert_eq!(gains(&table), turned);
    for (pin, value) in [
        ("igain", f64::NAN),
        ("deadband", -1.0),
        ("pgain", -5.0),
        ("pgain", 0.0),
        ("ff1", 1e300),
    ] {
        let before = hal.reader::<f64>(&format!("pid.0.{pin}")).unwrap().get();
        hal.set(&format!("pid.0.{pin}"), value).unwrap();
        pins.turn(&mut table.drives, || false);
        assert_eq!(gains(&table), turned, "{pin} {value}");
        let shown = hal.reader::<f64>(&format!("pid.0.{pin}")).unwrap().get();
        assert_eq!(shown, before, "{pin} shows what is in force, not {value}");
    }
    // What reads as 0 because the file was cut short is no gain.
    hal.set("pid.0.pgain", 5.0).unwrap();
    pins.turn(&mut table.drives, || true);
    assert_eq!(gains(&table), turned);
    table.command_mm = 0.001;
    table.cycle(None);
    pins.show(&table.drives);
    let shown = |name: &str| hal.reader::<f64>(name).unwrap().get();
    assert!(shown("pid.0.output") != 0.0 && !hal.reader::<bool>("pid.0.saturated").unwrap().get());
    assert_eq!(
        shown("pid.0.error"),
        0.0,
        "the command before is where the joint stands"
    );
}

#[test]
fn a_second_touch_at_the_same_increment_is_seen_once_the_drive_has_forgotten_the_first() {
    let mapped = |objects: &[(u16, u8)]| {
        let objects = objects
            .iter()
            .map(|&(index, bits)| config::Mapped { index, sub: 0, bits });
        Layout::new(&objects.collect::<Vec<_>>())
    };
    let outputs = mapped(&[(0x60B8, 16)]);
    let inputs = mapped(&[(0x60B9, 16), (0x60BA, 32), (0x60BB, 32)]);
    let mut touch = Touch::new(0, 1, Touch::FUNCTION, &outputs, &inputs).unwrap();
    let mut payload = [0; 10];
    let mut tell = |touch: &mut Touch, status: u64, rising: i32| {
        touch.fields[1].write(&mut payload, status);
        touch.fields[2].write(&mut payload, rising as u64);
        touch.watch(&payload);
    };
    // What was stored before, and not where an edge was since.
    tell(&mut touch, 0b001, 0);
    tell(&mut touch, 0b011, 700);
    assert_eq!((touch.found, touch.function()), ([Some(700), None], Touch::FUNCTION));
    touch.arm();
    assert_eq!((touch.found, touch.function()), ([None; 2], 0));
    // The drive takes some cycles to see that it is off, and as many to see that it is on.
    tell(&mut touch, 0b011, 700);
    assert_eq!((touch.found, touch.function()), ([None; 2], 0));
    tell(&mut touch, 0b000, 700);
    assert_eq!((touch.found, touch.function()), ([None; 2], Touch::FUNCTION));
    tell(&mut touch, 0b001, 700);
    tell(&mut touch, 0b011, 700);
    assert_eq!(touch.found, [Some(700), None]);
    // One that forgets nothing is told by its positions.
    touch.arm();
    tell(&mut touch, 0b010, 700);
    tell(&mut touch, 0b011, 700);
    assert_eq!((touch.found, touch.function()), ([None; 2], Touch::FUNCTION));
    tell(&mut touch, 0b011, 701);
    assert_eq!(touch.found, [Some(701), None]);
}
