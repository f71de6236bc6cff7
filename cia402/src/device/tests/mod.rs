use super::*;
use crate::axis::{Axis, AxisConfig, AxisFault, Feedback, HomingState, Mode, Request, Status, Target};
use proptest::prelude::*;

mod factors;
mod profiles;
mod tables;
mod touch;

const MS: u64 = 1_000_000;

/// Where a switch is active, motor counts, ends included.
type Range = (i64, i64);

/// A machine whose motor follows at once, with a drive on it and a controller that may lead it.
struct Rig {
    objects: Dictionary<{ obd::lines_of(DRIVE_OBJECTS) }, { obd::octets_of(DRIVE_OBJECTS) }>,
    device: Device,
    sensors: Sensors,
    demand: Demand,
    home: Range,
    /// The motor does not turn.
    blocked: bool,
    axis: Axis,
    now_ns: u64,
}

const NEGATIVE_LIMIT: i64 = -10_000;
const POSITIVE_LIMIT: i64 = 10_000;
/// Zero marks lie at `MARK + k * MARK_DISTANCE`.
const MARK: i64 = 150;
const MARK_DISTANCE: i64 = 400;

fn switch(active: impl Fn(i64) -> bool, from: i64, to: i64) -> Switch {
    let edge = (active(from) != active(to)).then(|| {
        // The last position with the level of `from` and the first with that of `to` are neighbours; show the active one.
        let (mut old, mut new) = (from, to);
        while (new - old).abs() > 1 {
            let middle = (old + new) / 2;
            if active(middle) == active(from) {
                old = middle
            } else {
                new = middle
            }
        }
        if active(to) { new } else { old }
    });
    Switch {
        active: active(to),
        edge,
    }
}

impl Rig {
    fn new(position: i64, home: Range) -> Rig {
        Rig::with(position, home, AxisConfig::default())
    }

    fn with(position: i64, home: Range, config: AxisConfig) -> Rig {
        let objects = Dictionary::new(&[DRIVE_OBJECTS]).unwrap();
        let device = Device::new(&objects, MS as u32, Delays::default()).unwrap();
        let mut rig = Rig {
            objects,
            device,
            sensors: Sensors {
                position,
                ..Sensors::default()
            },
            demand: Demand::default(),
            home,
            blocked: false,
            axis: Axis::new(config),
            now_ns: 0,
        };
        rig.turn(position);
        rig
    }

    fn turn(&mut self, to: i64) {
        let from = self.sensors.position;
        let (low, high) = self.home;
        let mark = |position: i64| (position - MARK).div_euclid(MARK_DISTANCE);
        let passed = mark(from.max(to)) * MARK_DISTANCE + MARK;
        self.sensors = Sensors {
            position: to,
            velocity: (to - from) * 1000,
            negative_limit: switch(|position| position <= NEGATIVE_LIMIT, from, to),
            positive_limit: switch(|position| position >= POSITIVE_LIMIT, from, to),
            torque: 0,
            home: switch(|position| (low..=high).contains(&position), from, to),
            probes: [
                switch(|position| (100..200).contains(&position), from, to),
                Switch::default(),
            ],
            index: (mark(from) != mark(to)).then_some(passed),
        };
    }

    /// One cycle of the drive alone.
    fn cycle(&mut self, connected: bool) {
        self.demand = self.device.cycle(&mut self.objects, &self.sensors, connected);
        let to = if self.demand.powered && !self.blocked {
            motion::round(self.demand.position)
        } else {
            self.sensors.position
        };
        self.turn(to);
    }

    fn write<T: obd::Scalar>(&mut self, index: u16, sub: u8, value: T) {
        let key = self.objects.key(index, sub).unwrap();
        self.objects.set(key, value);
    }

    fn read<T: obd::Scalar>(&self, index: u16, sub: u8) -> T {
        self.objects.get(self.objects.key(index, sub).unwrap())
    }

    /// A cycle with this controlword; returns the statusword.
    fn word(&mut self, controlword: u16) -> u16 {
        self.write(0x6040, 0, controlword);
        self.cycle(true);
        self.read(0x6041, 0)
    }

    /// A cycle in which the controller leads.
    fn lead(&mut self, commanded: impl Into<Target>) {
        let feedback = Feedback {
            statusword: self.read(0x6041, 0),
            position: self.read(0x6064, 0),
            following_error: self.read(0x60F4, 0),
            mode_display: self.read(0x6061, 0),
            digital_inputs: self.read(0x60FD, 0),
            error_code: self.read(0x603F, 0),
        };
        self.now_ns += MS;
        let setpoint = self.axis.cycle(self.now_ns, true, &feedback, commanded);
        self.write(0x6040, 0, setpoint.controlword);
        self.write(0x6060, 0, setpoint.mode);
        self.write(0x607A, 0, setpoint.target_position);
        self.write(0x60C1, 1, setpoint.target_position);
        self.write(0x60FF, 0, setpoint.target_velocity);
        self.write(0x6042, 0, setpoint.target_velocity as i16);
        self.write(0x6071, 0, setpoint.target_torque);
        self.write(0x60B1, 0, setpoint.velocity_offset);
        self.write(0x60B2, 0, setpoint.torque_offset);
        self.cycle(true);
    }

    /// Leads until the status is reached, at most this many cycles.
    fn lead_to(&mut self, status: Status, cycles: u32) {
        for _ in 0..cycles {
            if self.axis.status() == status {
                return;
            }
            self.lead(self.axis.target_position());
        }
        assert_eq!(self.axis.status(), status);
    }

    fn enable(&mut self) {
        self.lead_to(Status::Disabled, 100);
        self.axis.request(Request::Enable);
        self.lead_to(Status::Enabled, 100);
    }

    /// Enabled and moving at this speed, counts/s.
    fn moving(velocity: i64) -> Rig {
        let mut rig = Rig::new(0, (-1000, 1000));
        rig.enable();
        for _ in 0..20 {
            rig.lead(rig.axis.target_position() + velocity / 1000);
        }
        assert_eq!(rig.demand.velocity, velocity as f64);
        rig
    }
}

#[test]
fn the_controller_brings_the_drive_up_and_moves_it() {
    for mode in [Mode::Csp, Mode::Ip] {
        let mut rig = Rig::with(
            500,
            (-1000, 1000),
            AxisConfig {
                mode,
                ..AxisConfig::default()
            },
        );
        rig.enable();
        assert_eq!(rig.sensors.position, 500, "enabling moves nothing");
        for step in 1..=100 {
            rig.lead(500 + 7 * step);
        }
        assert_eq!((rig.sensors.position, rig.axis.status()), (1200, Status::Enabled));
        rig.axis.request(Request::Disable);
        rig.lead_to(Status::Disabled, 20);
        assert_eq!(rig.device.state(), State::SwitchOnDisabled);
    }
}

/// A drive that is enabled in a mode.
fn enabled_in(mode: Mode) -> Rig {
    let config = AxisConfig {
        mode,
        ..AxisConfig::default()
    };
    let mut rig = Rig::with(500, (-1000, 1000), config);
    rig.enable();
    assert_eq!((rig.sensors.position, rig.read::<i8>(0x6061, 0)), (500, mode.code()));
    rig
}

#[test]
fn a_velocity_leads_the_motor_and_stops_as_the_states_say() {
    let mut rig = enabled_in(Mode::Csv);
    let target = Target {
        position: 99_999,
        velocity: 3000,
        torque: 40,
    };
    for _ in 0..100 {
        rig.lead(target);
    }
    // 3 counts a period; the first one sends it.
    assert_eq!(
        rig.sensors.position, 800,
        "whatever the position is that nobody asks of it"
    );
    let demand = rig.demand;
    assert_eq!(
        (demand.control, demand.velocity, demand.torque),
        (Control::Velocity, 3000.0, 40.0)
    );
    assert_eq!((rig.read::<u16>(0x6041, 0), rig.read::<i32>(0x60F4, 0)), (0x1237, 0));
    assert_eq!(rig.read::<i32>(0x606B, 0), 3000);
    rig.axis.request(Request::QuickStop);
    rig.lead_to(Status::Disabled, 20);
    assert_eq!(rig.axis.fault(), None);
    assert_eq!(rig.device.state(), State::SwitchOnDisabled);
}

#[test]
fn a_limit_switch_lets_a_velocity_only_back() {
    let mut rig = enabled_in(Mode::Csv);
    rig.turn(POSITIVE_LIMIT);
    let velocity = |velocity| Target {
        velocity,
        ..Target::default()
    };
    rig.lead(velocity(5000));
    assert_eq!(
        (rig.sensors.position, rig.read::<u16>(0x6041, 0)),
        (POSITIVE_LIMIT, 0x0A37)
    );
    rig.lead(velocity(-5000));
    assert_eq!(
        (rig.sensors.position, rig.read::<u16>(0x6041, 0)),
        (POSITIVE_LIMIT - 5, 0x1237)
    );
}

#[test]
fn a_torque_leads_the_motor_up_to_the_greatest_one() {
    let mut rig = enabled_in(Mode::Cst);
    let torque = |torque| Target {
        torque,
        ..Target::default()
    };
    rig.lead(torque(-300));
    assert_eq!((rig.demand.control, rig.demand.torque), (Control::Torque, -300.0));
    assert_eq!(rig.read::<u16>(0x6041, 0), 0x1237);
    rig.lead(torque(3100));
    assert_eq!((rig.demand.torque, rig.read::<i16>(0x6074, 0)), (3000.0, 3000));
    assert_eq!(rig.read::<u16>(0x6041, 0), 0x1A37, "internal limit");
    // What moves is stopped by a ramp of the drive's own, from the speed that the motor has.
    rig.sensors.velocity = 100_000;
    rig.lead(torque(0));
    rig.axis.request(Request::Disable);
    rig.lead(torque(0));
    assert_eq!(rig.demand.control, Control::Position);
    assert!((80_000.0..100_000.0).contains(&rig.demand.velocity), "{:?}", rig.demand);
}

#[test]
fn states_show_their_statusword() {
    let mut rig = Rig::new(0, (0, 0));
    assert_eq!(rig.word(0), 0x0200, "not ready: self-test of 20 ms");
    let after: u16 = (0..19).map(|_| rig.word(0)).last().unwrap();
    assert_eq!(after, 0x0250);
    assert_eq!(rig.word(0x0006), 0x0231);
    let words: [u16; 6] = core::array::from_fn(|_| rig.word(0x000F));
    assert_eq!(
        words,
        [0x0231, 0x0231, 0x0231, 0x0231, 0x0231, 0x0233],
        "switching on takes 5 ms"
    );
    let enabling = (0..20).take_while(|_| rig.word(0x000F) == 0x0233).count();
    assert_eq!(enabling, 9, "and enabling 10 ms, of which the first has been seen");
    assert_eq!(rig.word(0x0007), 0x0233, "at rest the ramp of 605C = 1 ends at once");
    rig.device.injected.remote = false;
    assert_eq!(rig.word(0x0006), 0x0033, "a drive under local control does not obey");
    rig.device.injected.remote = true;
    rig.device.injected.warning = true;
    assert_eq!(rig.word(0x0006), 0x02B1);
}

#[test]
fn a_refused_transition_is_not_taken() {
    let mut rig = Rig::new(0, (0, 0));
    rig.device.injected.refused = 1 << 3;
    rig.lead_to(Status::Disabled, 100);
    rig.axis.request(Request::Enable);
    for _ in 0..1100 {
        rig.lead(0);
    }
    assert_eq!(
        rig.axis.fault(),
        Some(AxisFault::StepTimeout {
            step: crate::axis::Step::SwitchOn
        })
    );
}

#[test]
fn quick_stop_takes_half_of_v_squared_over_a() {
    // 100,000 counts/s at 10,000,000 counts/s²: 10 ms, 500 counts. From the position before the stop, and with the
    // velocity straight over each period.
    for (option, end) in [(2, State::SwitchOnDisabled), (6, State::QuickStopActive)] {
        let mut rig = Rig::moving(100_000);
        rig.write(0x6085, 0, 10_000_000u32);
        rig.write(0x605A, 0, option as i16);
        let start = rig.sensors.position;
        for _ in 0..10 {
            assert_eq!(rig.word(0x0002) & 0x006F, 0x0007, "QUICK STOP ACTIVE");
        }
        rig.word(0x0002);
        assert_eq!((rig.sensors.position - start, rig.device.state()), (500, end));
    }
}

#[test]
fn quick_stop_options_0_and_5_to_8() {
    let mut rig = Rig::moving(100_000);
    rig.write(0x605A, 0, 0i16);
    rig.word(0x0002);
    assert!(!rig.demand.powered, "605A = 0 switches off at once");
    assert_eq!(rig.device.state(), State::SwitchOnDisabled);

    let mut rig = Rig::moving(100_000);
    rig.write(0x605A, 0, 6i16);
    for _ in 0..10 {
        rig.word(0x0002);
    }
    assert!(rig.demand.powered, "605A = 6 holds the position");
    for _ in 0..11 {
        rig.word(0x000F);
    }
    assert_eq!(rig.device.state(), State::OperationEnabled, "transition 16");

    let mut rig = Rig::moving(100_000);
    rig.word(0x0002);
    rig.word(0x000F);
    assert_eq!(rig.device.state(), State::QuickStopActive);
    for _ in 0..30 {
        rig.word(0x000F);
    }
    assert_eq!(rig.device.state(), State::SwitchOnDisabled, "not with 605A = 2");
}

#[test]
fn disabling_ramps_or_coasts_as_605c_says() {
    for (option, state_after) in [(1i16, State::OperationEnabled), (0, State::SwitchedOn)] {
        let mut rig = Rig::moving(100_000);
        rig.write(0x605C, 0, option);
        rig.word(0x0007);
        assert_eq!(rig.device.state(), state_after);
        for _ in 0..20 {
            rig.word(0x0007);
        }
        assert_eq!(rig.device.state(), State::SwitchedOn);
    }
}

#[test]
fn an_open_safety_circuit_takes_the_torque_and_lets_nothing_on() {
    for faults in [false, true] {
        let mut rig = Rig::moving(100_000);
        rig.device.injected.sto_faults = faults;
        rig.device.injected.sto_open = true;
        rig.word(0x000F);
        assert!(!rig.demand.powered, "no ramp");
        for word in [0x0000, 0x0080, 0x0000, 0x0006, 0x0007, 0x000F] {
            rig.word(word);
        }
        let (state, code) = match faults {
            true => (State::Fault, ERROR_STO),
            false => (State::SwitchOnDisabled, 0),
        };
        assert_eq!((rig.device.state(), rig.read::<u16>(0x603F, 0)), (state, code));
        assert_eq!(rig.read::<u32>(0x60FD, 0) >> 3 & 1, 1);
        rig.device.injected.sto_open = false;
        for word in [0x0000, 0x0080, 0x0000, 0x0006] {
            rig.word(word);
        }
        assert_eq!(rig.device.state(), State::ReadyToSwitchOn);
        assert_eq!(rig.read::<u32>(0x60FD, 0) >> 3 & 1, 0);
    }
}

#[test]
fn faults_stop_by_605e_and_reset_on_the_edge_once_the_cause_is_gone() {
    let mut rig = Rig::moving(100_000);
    rig.device.injected.cause_stays = true;
    rig.device.raise_fault(0x3210);
    rig.device.raise_fault(0x4310);
    assert_eq!(rig.word(0x000F) & 0x004F, 0x000F);
    assert!(rig.demand.powered && rig.demand.velocity < 100_000.0, "605E = 2 ramps");
    for _ in 0..20 {
        rig.word(0x000F);
    }
    assert_eq!((rig.device.state(), rig.read::<u16>(0x603F, 0)), (State::Fault, 0x3210));
    assert!(!rig.demand.powered);
    for word in [0x0000, 0x0080] {
        rig.word(word);
    }
    assert_eq!(rig.device.state(), State::Fault, "the cause is still there");
    rig.device.injected.cause_stays = false;
    rig.word(0x0080);
    assert_eq!(rig.device.state(), State::Fault, "no edge");
    rig.word(0x0000);
    assert_eq!(rig.word(0x0080), 0x0250);
    assert_eq!(rig.read::<u16>(0x603F, 0), 0);

    let mut rig = Rig::moving(100_000);
    rig.write(0x605E, 0, 0i16);
    rig.device.raise_fault(0x2310);
    rig.word(0x000F);
    assert_eq!(
        (rig.device.state(), rig.demand.powered),
        (State::Fault, false),
        "605E = 0 coasts"
    );
    assert_eq!(rig.device.error_register(), 0x03);
}

#[test]
fn a_following_error_beyond_window_and_time_is_fault_8611() {
    let mut rig = Rig::moving(10_000);
    rig.write(0x6065, 0, 50u32);
    rig.write(0x6066, 0, 3u16);
    rig.blocked = true;
    let start = rig.axis.target_position();
    for step in 1..=20 {
        rig.lead(start + 10 * step);
        if rig.axis.fault().is_some() {
            // Error 60 is seen one cycle after the sixth step; beyond 3 ms three cycles later.
            assert_eq!(step, 11);
            break;
        }
        let beyond = rig.read::<i32>(0x60F4, 0) > 50;
        assert_eq!(rig.read::<u16>(0x6041, 0) & statusword::MODE_ERROR != 0, beyond);
    }
    assert_eq!(rig.axis.fault(), Some(AxisFault::Drive { error_code: 0x8611 }));
}

#[test]
fn a_lost_connection_does_what_6007_says() {
    let quick = [State::QuickStopActive, State::SwitchOnDisabled];
    for (option, states) in [
        (0i16, [State::OperationEnabled; 2]),
        (1, [State::FaultReactionActive, State::Fault]),
        (2, [State::SwitchOnDisabled; 2]),
        (3, quick),
    ] {
        let mut rig = Rig::moving(100_000);
        rig.write(0x6007, 0, option);
        rig.cycle(false);
        assert_eq!(rig.device.state(), states[0], "{option}");
        for _ in 0..20 {
            rig.cycle(false);
        }
        assert_eq!(rig.device.state(), states[1], "{option}");
        rig.cycle(true);
        assert_eq!(
            rig.device.state(),
            states[1],
            "the old enable operation in 6040 starts nothing"
        );
    }
}

#[test]
fn limits_hold_the_target_and_show_bit_11() {
    let mut rig = Rig::moving(1000);
    rig.write(0x607D, 1, -100i32);
    rig.write(0x607D, 2, 100i32);
    rig.write(0x607A, 0, 500i32);
    let word = rig.word(0x000F);
    assert_eq!((rig.sensors.position, word & 0x1800), (100, 0x0800));
    rig.write(0x607A, 0, 99i32);
    assert_eq!(rig.word(0x000F) & 0x1800, 0x1000);

    let mut rig = Rig::new(POSITIVE_LIMIT, (-1000, 1000));
    rig.enable();
    rig.lead(i64::from(POSITIVE_LIMIT as i32) + 5);
    assert_eq!(rig.sensors.position, POSITIVE_LIMIT, "not further onto a limit switch");
    rig.lead(POSITIVE_LIMIT - 5);
    assert_eq!(rig.sensors.position, POSITIVE_LIMIT - 5, "but off it");
}

#[test]
fn an_interpolation_time_other_than_the_cycle_is_refused() {
    for (digits, power, fits) in [
        (1u8, -3i8, true),
        (10, -4, true),
        (5, -4, false),
        (1, -2, false),
        (255, 0, false),
    ] {
        let mut rig = Rig::new(0, (0, 0));
        rig.write(0x60C2, 1, digits);
        rig.write(0x60C2, 2, power);
        rig.lead_to(Status::Disabled, 100);
        rig.axis.request(Request::Enable);
        for _ in 0..50 {
            rig.lead(0);
        }
        let expected = if fits {
            None
        } else {
            Some(AxisFault::Drive { error_code: 0x6320 })
        };
        assert_eq!(rig.axis.fault(), expected, "{digits} {power}");
    }
}

#[test]
fn modes_methods_and_options_that_it_lacks_are_refused() {
    assert_eq!(SUPPORTED_MODES, 0x0000_03EF);
    let refused = Err(AbortCode::VALUE_RANGE);
    let objects = Rig::new(0, (0, 0)).objects;
    for (mode, result) in [
        (8, Ok(())),
        (7, Ok(())),
        (6, Ok(())),
        (0, Ok(())),
        (9, Ok(())),
        (10, Ok(())),
        (1, Ok(())),
        (4, Ok(())),
        (5, refused),
        (11, refused),
        (-1, refused),
    ] {
        assert_eq!(check_write(&objects, 0x6060, 0, &[mode as i8 as u8]), result, "{mode}");
    }
    let methods = (-128..=127)
        .filter(|method: &i32| check_write(&objects, 0x6098, 0, &[*method as u8]).is_ok())
        .count();
    assert_eq!(methods, 14 + 14 + 4);
    assert_eq!(check_write(&objects, 0x605A, 0, &[3, 0]), refused);
    assert_eq!(check_write(&objects, 0x605A, 0, &[6, 0]), Ok(()));
    assert_eq!(check_write(&objects, 0x607A, 0, &[0; 4]), Ok(()));
}

#[test]
fn the_table_makes_a_dictionary() {
    let objects: Dictionary<{ obd::lines_of(DRIVE_OBJECTS) }, { obd::octets_of(DRIVE_OBJECTS) }> =
        Dictionary::new(&[DRIVE_OBJECTS]).unwrap();
    assert_eq!(objects.read(0x6502, 0), Ok(&[0xEF, 3, 0, 0][..]));
    assert_eq!(objects.read(0x67FF, 0), Ok(&[0x92, 0x01, 0x02, 0x00][..]));
    assert_eq!(objects.read(0x60C2, 2), Ok(&[0xFD][..]));
}

/// Homes by a method; returns the motor position of the home point.
fn home(method: i8, start: i64, home: Range, search: u32) -> i64 {
    let mut rig = Rig::new(start, home);
    rig.write(0x6098, 0, method);
    rig.write(0x6099, 1, search);
    rig.write(0x6099, 2, 2_000u32);
    rig.write(0x609A, 0, 1_000_000u32);
    rig.enable();
    rig.axis.request(Request::Home);
    rig.lead(0);
    rig.lead_to(Status::Enabled, 100_000);
    assert_eq!(rig.axis.homing(), HomingState::Homed);
    let home = rig.sensors.position - i64::from(rig.read::<i32>(0x6064, 0));
    let stays = rig.sensors.position;
    for _ in 0..10 {
        rig.lead(rig.axis.target_position());
    }
    assert_eq!(rig.sensors.position, stays, "back in the cyclic mode without a jump");
    home
}

const SHORT: Range = (-1000, 1000);
const RIGHT: Range = (-1000, i64::MAX);
const LEFT: Range = (i64::MIN, 1000);

/// Home points by hand: edges at -1000 and 1000, limits at -10,000 and 10,000, marks at 150 + 400 k.
const HOME_POINTS: [(i8, Range, i64); 28] = [
    (1, SHORT, -9850),
    (2, SHORT, 9750),
    (3, RIGHT, -1050),
    (4, RIGHT, -650),
    (5, LEFT, 1350),
    (6, LEFT, 950),
    (7, SHORT, -1050),
    (8, SHORT, -650),
    (9, SHORT, 950),
    (10, SHORT, 1350),
    (11, SHORT, 1350),
    (12, SHORT, 950),
    (13, SHORT, -650),
    (14, SHORT, -1050),
    (17, SHORT, -10_000),
    (18, SHORT, 10_000),
    (19, RIGHT, -1000),
    (20, RIGHT, -1000),
    (21, LEFT, 1000),
    (22, LEFT, 1000),
    (23, SHORT, -1000),
    (24, SHORT, -1000),
    (25, SHORT, 1000),
    (26, SHORT, 1000),
    (27, SHORT, 1000),
    (28, SHORT, 1000),
    (29, SHORT, -1000),
    (30, SHORT, -1000),
];

#[test]
fn every_homing_method_finds_its_point_from_everywhere() {
    for (method, range, point) in HOME_POINTS {
        for start in [-10_500, -5000, -1001, -900, 0, 900, 1001, 5000, 10_500] {
            assert_eq!(
                home(method, start, range, 20_000),
                point,
                "method {method} from {start}"
            );
        }
    }
}

#[test]
fn a_home_switch_that_is_run_over_is_found_all_the_same() {
    // 70,000 counts/s need 2450 counts to stop; the switch is 2001 wide.
    for (method, range, point) in HOME_POINTS {
        for start in [-4000, 4000] {
            assert_eq!(
                home(method, start, range, 70_000),
                point,
                "method {method} from {start}"
            );
        }
    }
}

#[test]
fn homing_to_a_mark_or_here() {
    assert_eq!(home(33, 0, SHORT, 20_000), -250);
    assert_eq!(home(34, 0, SHORT, 20_000), 150);
    assert_eq!(home(35, 77, SHORT, 20_000), 77);
    assert_eq!(home(37, -77, SHORT, 20_000), -77);
}

#[test]
fn home_offset_is_taken_away_from_the_position_at_home() {
    let mut rig = Rig::new(123, SHORT);
    rig.write(0x607C, 0, 5000i32);
    rig.enable();
    rig.axis.request(Request::Home);
    rig.lead(0);
    rig.lead_to(Status::Enabled, 100);
    assert_eq!(rig.read::<i32>(0x6064, 0), -5000);
    assert_eq!(rig.axis.actual_position(), -5000);
}

#[test]
fn homing_without_a_switch_shows_the_error() {
    let mut rig = Rig::new(0, (i64::MAX, i64::MAX));
    rig.write(0x6098, 0, 23i8);
    rig.enable();
    rig.axis.request(Request::Home);
    for _ in 0..2000 {
        rig.lead(0);
    }
    assert_eq!(
        rig.axis.fault(),
        Some(AxisFault::Homing(crate::axis::HomingFault::Drive))
    );
}

#[test]
fn positions_wrap_at_32_bits_and_motion_goes_on() {
    let mut rig = Rig::new(i64::from(i32::MAX) - 3, (0, 0));
    rig.enable();
    // Out of the way of the limit switch of this track.
    for _ in 0..5 {
        let target = rig.axis.target_position();
        rig.sensors.positive_limit = Switch::default();
        rig.lead(target + 2);
    }
    assert_eq!(rig.sensors.position, i64::from(i32::MAX) + 7);
    assert_eq!(
        rig.read::<i32>(0x6064, 0),
        i32::MIN + 4,
        "the position before the last step"
    );
}

proptest! {
    /// Whatever is written to the drive: torque only in the three powered states, and no panic.
    #[test]
    fn torque_is_on_in_powered_states_only(
        words in prop::collection::vec(
            (any::<u16>(), any::<i32>(), any::<i8>(), any::<bool>(), 0..4u16, any::<u16>()), 0..150,
        ),
        options in prop::array::uniform6(any::<i16>()),
    ) {
        let mut rig = Rig::new(0, SHORT);
        for (sub, option) in options.iter().enumerate() {
            rig.write([0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E][sub], 0, *option);
        }
        for (word, target, mode, connected, usual, fault) in words {
            rig.write(0x6040, 0, [word, 0x0006, 0x000F, 0x001F][usize::from(usual)]);
            rig.write(0x607A, 0, target);
            rig.write(0x60C1, 1, target);
            rig.write(0x6060, 0, if usual == 3 { 6 } else { mode });
            if fault < 400 {
                rig.device.raise_fault(fault);
            }
            rig.cycle(connected);
            let powered =
                matches!(rig.device.state(), State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive);
            prop_assert!(powered || !rig.demand.powered);
            prop_assert_eq!(crate::profile::state(rig.read(0x6041, 0)), Some(rig.device.state()));
        }
    }
}

/// Every build of a drive that the profile leaves open, against what it changes.
#[test]
fn a_drive_is_as_it_was_built() {
    let homed = |home_offset_adds: bool| {
        let mut rig = Rig::new(500, (0, 0));
        let quirks = Quirks {
            home_offset_adds,
            ..Quirks::default()
        };
        rig.device = rig.device.with_quirks(quirks);
        rig.write(0x6098, 0, 37_i8);
        rig.write(0x607C, 0, 70_i32);
        rig.enable();
        rig.write(0x6060, 0, 6_i8);
        rig.word(0x0F);
        rig.word(0x1F);
        rig.word(0x1F);
        rig.read::<i32>(0x6064, 0)
    };
    assert_eq!([homed(false), homed(true)], [-70, 70]);

    let mut rig = Rig::new(NEGATIVE_LIMIT, (NEGATIVE_LIMIT, 0));
    rig.device = rig.device.with_quirks(Quirks {
        input_bits: [16, 17, 20],
        sto: (24, false),
        homing_methods: 1 << 35,
        ..Quirks::default()
    });
    rig.cycle(true);
    assert_eq!(rig.read::<u32>(0x60FD, 0), 1 << 16 | 1 << 20 | 1 << 24);
    rig.device.injected.sto_open = true;
    rig.cycle(true);
    assert_eq!(rig.read::<u32>(0x60FD, 0), 1 << 16 | 1 << 20);
    rig.device.injected.sto_open = false;
    rig.write(0x6098, 0, 37_i8);
    rig.enable();
    rig.write(0x6060, 0, 6_i8);
    rig.word(0x0F);
    assert_eq!(rig.word(0x1F) & statusword::MODE_ERROR, statusword::MODE_ERROR);

    // 605A is 2: the profile has it switched off at the end of the stop.
    for stays_in_quick_stop in [false, true] {
        let mut rig = Rig::new(0, (0, 0));
        rig.device = rig.device.with_quirks(Quirks {
            stays_in_quick_stop,
            ..Quirks::default()
        });
        rig.enable();
        for _ in 0..100 {
            rig.word(0x02);
        }
        let stopped = match stays_in_quick_stop {
            true => State::QuickStopActive,
            false => State::SwitchOnDisabled,
        };
        assert_eq!(rig.device.state(), stopped);
        // Transition 16 is none that it takes.
        rig.word(0x0F);
        assert_eq!(rig.device.state(), stopped);
        rig.word(0x00);
        assert_eq!(rig.device.state(), State::SwitchOnDisabled);
    }

    let mut rig = Rig::new(0, (0, 0));
    let key = rig.objects.find(0x6502, 0).unwrap();
    rig.objects
        .set_default(key, &mode::supported_bit(7).to_le_bytes())
        .unwrap();
    let offered = [7_i8, 8].map(|code| check_write(&rig.objects, 0x6060, 0, &[code as u8]).is_ok());
    assert_eq!(offered, [true, false]);
    rig.write(0x6060, 0, 8_i8);
    rig.cycle(true);
    assert_eq!(rig.read::<i8>(0x6061, 0), 0);
}
