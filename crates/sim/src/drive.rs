//! A simulated servo drive: for each of its axes a CiA 402 device and a motor, whatever bus it hangs on.
//!
//! In:  its objects, a period after the other, and whether the bus leads it. Out: its objects; the motor's motion.
//!
//! A period is closed and the next one opened when the carrier says so: at the synchronous instant of its bus, or, when that stays
//! away, by the drive's own clock. Once the bus does not lead it any more it stops as 6007 says.

use super::SimError;
use super::built::{MAKER_ENTRIES, objects, quirks};
use super::faults::{FAULT_OBJECTS, check_order};
use super::motor::{Motor, MotorConfig};
use super::track::{Track, mm_to_counts};
use cia402::State;
use cia402::device::{self, DRIVE_OBJECTS, Delays, Demand, Device, Injected};
use cia402::profile::{AXES_MAX, object_of};
use config::{
    Config, DriveMode, FactorGroup, Homing, HomingBy, InputBits, Joint, JointLimits, Node, NodeIndex, Reactions,
    SimFaultKind, SpindleAxis, Sto, StopLimits, Switches,
};
use machine::fault_order::{FAULT, FaultOrder};
use obd::{AbortCode, Dictionary, EntryDef, Handle, Key};

/// Lines and octets that the objects of a drive take at most, beside those of its bus.
pub(super) const ENTRIES: usize = AXES_MAX as usize * (obd::lines_of(DRIVE_OBJECTS) + 1) + MAKER_ENTRIES;
pub(super) const OCTETS: usize = AXES_MAX as usize * (obd::octets_of(DRIVE_OBJECTS) + 8) + 8 * MAKER_ENTRIES;

/// 6007: quick stop.
const ABORT_QUICK_STOP: i16 = 3;
/// Greatest acceleration of the motor as a multiple of the joint's stop acceleration.
const MOTOR_RESERVE: f64 = 4.0;
/// Number of the transition to OPERATION ENABLED.
const ENABLE_OPERATION: usize = 4;
/// Longer than anybody waits for it.
const SLOW_NS: u32 = 4_000_000_000;

/// A drive that no joint uses still turns a motor: on a bench.
const BENCH: Joint = Joint {
    step: None,
    analog: None,
    node: 0,
    drive_axis: 0,
    mode: DriveMode::Csp,
    counts_per_unit: [10_000, 1],
    velocity_ratio: [1, 1],
    torque_per_mm_s2: None,
    amplifier_lag_s: None,
    reactions: Reactions {
        quick_stop: None,
        shutdown: None,
        disable: None,
        halt: None,
        fault: None,
        connection_lost: None,
    },
    factor_group: FactorGroup {
        encoder: None,
        velocity_encoder: None,
        gear: None,
        feed: None,
        velocity: None,
        compare_only: false,
    },
    pid: None,
    travel_mm: [-1000.0, 1000.0],
    limits: JointLimits {
        velocity_mm_s: 100.0,
        acceleration_mm_s2: 1000.0,
        jerk_mm_s3: 100_000.0,
    },
    stop: StopLimits {
        acceleration_mm_s2: 2000.0,
        jerk_mm_s3: 200_000.0,
    },
    following_error_mm: 2.0,
    homing: Homing {
        search_mm_s: 20.0,
        latch_mm_s: 2.0,
        position_mm: 0.0,
        sequence: None,
        absolute_encoder: false,
        moved_when_off_mm: 1.0,
        volatile: false,
        by: HomingBy::Drive {
            method: 37,
            acceleration_mm_s2: 500.0,
        },
    },
    compensation: None,
    unhomed_jog_mm_s: 10.0,
    touch_probe: None,
    switches: Switches {
        limits: false,
        bits: InputBits {
            limits: [0, 1],
            home: 2,
        },
    },
    home_count: 0,
    sto: None,
    squaring_offset_mm: 0.0,
};

/// Change of the speed of a spindle, turns/s².
const SPINDLE_RAMP_TURNS_S2: f64 = 2000.0 / 60.0;
/// Increments of a turn of the motor, and position units of a turn of the shaft, of a drive as it comes.
const FACTORY_INCREMENTS: u32 = 10_000;
/// Increments of a turn of a spindle whose drive counts in 1/min.
const SPINDLE_INCREMENTS: u32 = 10_000;

/// The bench of a drive that turns the spindle; its unit is a turn.
fn of_spindle(of: &SpindleAxis) -> Joint {
    let [units, rpm] = of.units_per_rpm.map(f64::from);
    let [velocity, per] = of.factor_group.velocity_ratio().map(f64::from);
    let of_turn = of.factor_group.units_per_turn();
    let increments = match (of_turn, of.mode) {
        (Some([units, turns]), _) => units as f64 / turns as f64,
        (None, DriveMode::Vl) => f64::from(SPINDLE_INCREMENTS),
        (None, _) => 60.0 * units / rpm * per / velocity,
    };
    let mut bench = BENCH;
    bench.mode = of.mode;
    bench.factor_group = of.factor_group;
    bench.counts_per_unit = [increments.round().clamp(1.0, f64::from(u32::MAX)) as u32, 1];
    bench.limits.acceleration_mm_s2 = SPINDLE_RAMP_TURNS_S2;
    bench.stop.acceleration_mm_s2 = 2.0 * SPINDLE_RAMP_TURNS_S2;
    bench
}

/// 603F: continuous over-current at the output.
const OVERCURRENT: u16 = 0x2310;

/// Values that the drive takes by SDO.
pub(super) fn check_write<const E: usize, const B: usize>(
    objects: &Dictionary<E, B>,
    index: u16,
    sub: u8,
    value: &[u8],
) -> Result<(), AbortCode> {
    match index {
        FAULT => check_order(value),
        _ => device::check_write(objects, index, sub, value),
    }
}

/// What a drive is made of; kept for the next power-on.
#[derive(Clone, Debug)]
struct Setup {
    node: Node,
    axes: Vec<AxisSetup>,
    period_ns: u32,
}

impl Setup {
    /// The device of an axis as it is when it is switched on.
    fn device<const E: usize, const B: usize>(&self, axis: u8, objects: &Dictionary<E, B>) -> Result<Device, SimError> {
        let of = &self.axes[usize::from(axis)];
        let device = Device::of_axis(objects, axis, self.period_ns, of.delays);
        let device = device.map_err(|error| SimError::new(&self.node, error))?;
        Ok(device.with_quirks(quirks(&self.node, &of.joint.factor_group)))
    }
}

/// The same of one axis.
#[derive(Clone, Debug)]
struct AxisSetup {
    joint: Joint,
    /// Increments of its motor for a position unit of the network.
    increments: f64,
    /// Of one that turns the spindle: its highest speed, 1/min.
    rpm_max: Option<f64>,
    delays: Delays,
}

/// One axis: the power section of a drive, and its motor.
#[derive(Debug)]
struct Axis {
    device: Device,
    motor: Motor,
    demand: Demand,
    /// The object in which it shows its safety circuit, where that is not 60FD.
    sto: Option<(Handle, Sto)>,
    /// Bit of 60FD that shows its lower limit switch.
    lower_limit: u8,
    /// Takes orders of what is to go wrong.
    order: Key<u64>,
    /// How long what was asked for lasts still, ns, in the order of [`SimFaultKind::WORDS`]; `None`: it is not there, or has no end.
    lasts_ns: [Option<u64>; SimFaultKind::WORDS.len()],
    /// Error code that 1001h and the bus have been told of.
    reported: u16,
}

/// Error codes (603F) that have come up in a period, one for each axis; 0: none.
pub(super) type Reports = [u16; AXES_MAX as usize];

#[derive(Debug)]
pub(super) struct Drive {
    setup: Setup,
    axes: Vec<Axis>,
    powered: bool,
    /// When its supply goes, and when it comes back, ns from now.
    supply_goes_ns: Option<u64>,
    supply_back_ns: Option<u64>,
    error_register: Key<u8>,
    /// Bits of 1001h that stand for the error codes of the axes.
    register_bits: u8,
    /// A reset of the application waits until the motors have stopped.
    reset_due: bool,
}

/// Tables of the objects of a drive, beside those of its bus.
pub(super) fn tables(config: &Config, index: NodeIndex) -> [&'static [EntryDef]; 2] {
    let count = axes(config, index);
    [
        objects(&config.bus.nodes[index], count),
        &FAULT_OBJECTS[..usize::from(count)],
    ]
}

impl Drive {
    /// A drive that is switched on; `objects` has its [`tables`].
    pub(super) fn new<const E: usize, const B: usize>(
        config: &Config,
        index: NodeIndex,
        period_ns: u32,
        objects: &mut Dictionary<E, B>,
    ) -> Result<Drive, SimError> {
        let node = &config.bus.nodes[index];
        let (setups, motors): (Vec<_>, Vec<_>) = (0..axes(config, index))
            .map(|axis| axis_setup(config, index, axis))
            .unzip();
        let setup = Setup {
            node: node.clone(),
            axes: setups,
            period_ns,
        };
        let failed = |error: AbortCode| SimError::new(node, error);
        let sto = node.drive.as_ref().and_then(|drive| drive.sto);
        let sto = sto.filter(|sto| sto.object != (0x60FD, 0));
        let bits = node
            .drive
            .as_ref()
            .map_or(InputBits::default(), |drive| drive.input_bits);
        let mut axes = Vec::new();
        for (number, (of, motor)) in (0..).zip(setup.axes.iter().zip(motors)) {
            commission(objects, number, &of.joint).map_err(failed)?;
            if let Some(rpm_max) = of.rpm_max {
                commission_spindle(objects, number, &of.joint, rpm_max).map_err(failed)?;
            }
            let find = |sto: Sto| objects.find(object_of(number, sto.object.0), sto.object.1).ok();
            axes.push(Axis {
                device: setup.device(number, objects)?,
                motor,
                demand: Demand::default(),
                sto: sto.and_then(|sto| Some((find(sto)?, sto))),
                lower_limit: bits.limits[0],
                order: objects.key(FAULT, number + 1).map_err(failed)?,
                lasts_ns: [None; SimFaultKind::WORDS.len()],
                reported: 0,
            });
        }
        Ok(Drive {
            axes,
            powered: true,
            supply_goes_ns: None,
            supply_back_ns: None,
            error_register: objects.key(0x1001, 0).map_err(failed)?,
            register_bits: 0,
            reset_due: false,
            setup,
        })
    }

    /// From now on its periods take so long. Where that changes, the power section of each axis is as after power-on.
    pub(super) fn set_period<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        period_ns: u32,
    ) -> Result<(), SimError> {
        if period_ns == self.setup.period_ns {
            return Ok(());
        }
        self.setup.period_ns = period_ns;
        for (number, axis) in (0..).zip(&mut self.axes) {
            let injected = axis.device.injected;
            axis.device = self.setup.device(number, objects)?;
            axis.device.injected = injected;
        }
        Ok(())
    }

    /// A reset of the application is asked for; it waits until the motors have stopped.
    pub(super) fn reset(&mut self) {
        self.reset_due = true;
    }

    /// Ends one period of the motors and begins the next. `operational`: the bus leads it; how long it trusts its last set-point
    /// when nothing comes any more is the business of its carrier.
    ///
    /// RT: no allocation, no locks.
    pub(super) fn step<const E: usize, const B: usize>(
        &mut self,
        objects: &mut Dictionary<E, B>,
        operational: bool,
    ) -> Reports {
        self.go_wrong(objects);
        let period_s = f64::from(self.setup.period_ns) * 1e-9;
        let led = operational && !self.reset_due;
        let mut reports = Reports::default();
        let mut stopping = false;
        let mut told = false;
        for axis in &mut self.axes {
            let sensors = axis.motor.advance(&axis.demand, period_s);
            if !self.powered {
                axis.demand = Demand::default();
                continue;
            }
            axis.demand = axis.device.cycle(objects, &sensors, led);
            if let Some((handle, sto)) = axis.sto {
                let shown = axis.device.injected.sto_open == sto.active;
                let value = u64::from(shown) << sto.bit;
                // As long as it is; only a value of another length could be refused.
                let _ = objects.set_octets(handle, &value.to_le_bytes()[..handle.size()]);
            }
            stopping |= matches!(axis.device.state(), State::QuickStopActive | State::FaultReactionActive);
        }
        if !self.powered {
            return reports;
        }
        if self.reset_due && !stopping {
            self.reset_due = false;
            for axis in &mut self.axes {
                axis.device.reset();
                axis.demand = Demand::default();
            }
        }
        for (axis, report) in self.axes.iter_mut().zip(&mut reports) {
            let error_code = axis.device.error_code();
            if error_code != axis.reported {
                axis.reported = error_code;
                told = true;
                *report = error_code;
            }
        }
        if told {
            let bits = self
                .axes
                .iter()
                .fold(0, |bits, axis| bits | axis.device.error_register());
            let others = objects.get(self.error_register) & !self.register_bits;
            self.register_bits = bits;
            objects.set(self.error_register, others | bits);
        }
        reports
    }

    /// The machine's probe has changed after this share of the last period; a drive at which it is not wired does not know.
    pub(super) fn touch(&mut self, share: f64, closed: bool) {
        for (axis, of) in self.axes.iter_mut().zip(&self.setup.axes) {
            if let Some(number) = of.joint.touch_probe {
                axis.motor.touch(usize::from(number - 1), share, closed);
            }
        }
    }

    /// Takes orders of what is to go wrong, and mends what has lasted as long as it was to.
    fn go_wrong<const E: usize, const B: usize>(&mut self, objects: &mut Dictionary<E, B>) {
        let period_ns = u64::from(self.setup.period_ns);
        // Whether the time is over now.
        let is_over = |left_ns: &mut Option<u64>| {
            *left_ns = left_ns.map(|left_ns| left_ns.saturating_sub(period_ns));
            *left_ns == Some(0)
        };
        is_over(&mut self.supply_back_ns);
        if is_over(&mut self.supply_goes_ns) {
            self.supply_goes_ns = None;
            self.power_off();
        }
        for axis in 0..self.axes.len() {
            for at in 0..SimFaultKind::WORDS.len() {
                if is_over(&mut self.axes[axis].lasts_ns[at]) {
                    self.set_fault(axis, SimFaultKind::WORDS[at].1, None);
                }
            }
            let key = self.axes[axis].order;
            let value = objects.get(key);
            if value != 0 && self.powered {
                objects.set(key, 0);
                if let Some(order) = FaultOrder::of_value(value) {
                    self.fault(axis as u8, order);
                }
            }
        }
    }

    /// Lets something go wrong with an axis, or mends it; false: there is no such axis.
    pub(super) fn fault(&mut self, axis: u8, order: FaultOrder) -> bool {
        let axis = usize::from(axis);
        if axis >= self.axes.len() {
            return false;
        }
        let lasts_ns = u64::from(order.lasts_100ms) * 100_000_000;
        match order.kind {
            Some(kind) => self.set_fault(axis, kind, Some(lasts_ns)),
            None => {
                for (_, kind) in SimFaultKind::WORDS {
                    self.set_fault(axis, kind, None);
                }
            }
        }
        true
    }

    /// `lasts_ns`: how long; 0 has no end; `None`: it is mended.
    fn set_fault(&mut self, axis: usize, kind: SimFaultKind, lasts_ns: Option<u64>) {
        /// Until the supply goes, so that whoever has asked for it is still answered.
        const ANSWERED_NS: u64 = 100_000_000;
        let is_there = lasts_ns.is_some();
        let lasts_ns = lasts_ns.filter(|lasts_ns| *lasts_ns > 0);
        let axis = &mut self.axes[axis];
        let at = SimFaultKind::WORDS.iter().position(|(_, other)| *other == kind);
        if let Some(at) = at {
            axis.lasts_ns[at] = lasts_ns;
        }
        match kind {
            SimFaultKind::Overcurrent => {
                axis.device.injected.cause_stays = lasts_ns.is_some();
                if is_there {
                    axis.device.raise_fault(OVERCURRENT);
                }
            }
            SimFaultKind::FollowingError => axis.motor.jammed = is_there,
            SimFaultKind::LimitSwitch => {
                let bit = 1 << axis.lower_limit;
                let inputs = &mut axis.device.injected.digital_inputs;
                *inputs = if is_there { *inputs | bit } else { *inputs & !bit };
            }
            SimFaultKind::IndexMissing => axis.motor.index_missing = is_there,
            SimFaultKind::SlowEnable => {
                let mut delays = Delays::default();
                if is_there {
                    delays.0[ENABLE_OPERATION] = SLOW_NS;
                }
                axis.device.set_delays(delays);
            }
            SimFaultKind::PowerOff if is_there => {
                self.supply_goes_ns = Some(ANSWERED_NS);
                self.supply_back_ns = lasts_ns.map(|lasts_ns| lasts_ns + ANSWERED_NS);
            }
            // Who has no supply hears nothing: its time ends it.
            SimFaultKind::PowerOff => {}
            SimFaultKind::Sto => axis.device.injected.sto_open = is_there,
        }
    }

    /// Whether it is off, and its supply has come back.
    pub(super) fn supply_is_back(&self) -> bool {
        !self.powered && self.supply_back_ns == Some(0)
    }

    pub(super) fn power_off(&mut self) {
        self.powered = false;
        for axis in &mut self.axes {
            axis.demand = Demand::default();
        }
    }

    /// Whether it has its supply.
    pub(super) fn is_powered(&self) -> bool {
        self.powered
    }

    /// It starts from its defaults, which `objects` has again, and its encoders from zero. In place: nothing large goes over the
    /// stack of whoever switches it on.
    pub(super) fn power_on<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
    ) -> Result<(), SimError> {
        for (number, axis) in (0..).zip(&mut self.axes) {
            axis.motor.power_on();
            axis.device = self.setup.device(number, objects)?;
            (axis.demand, axis.reported) = (Demand::default(), 0);
        }
        (self.powered, self.reset_due) = (true, false);
        (self.supply_goes_ns, self.supply_back_ns) = (None, None);
        self.register_bits = 0;
        Ok(())
    }

    pub(super) fn raise_fault(&mut self, axis: u8, code: u16) -> bool {
        let axis = self.axes.get_mut(usize::from(axis));
        axis.map(|axis| axis.device.raise_fault(code)).is_some()
    }

    pub(super) fn jam(&mut self, axis: u8, jammed: bool) -> bool {
        let axis = self.axes.get_mut(usize::from(axis));
        axis.map(|axis| axis.motor.jammed = jammed).is_some()
    }

    pub(super) fn injected(&mut self, axis: u8) -> Option<&mut Injected> {
        Some(&mut self.axes.get_mut(usize::from(axis))?.device.injected)
    }

    pub(super) fn state(&self, axis: u8) -> Option<State> {
        Some(self.axes.get(usize::from(axis))?.device.state())
    }

    /// Turns since power-on, of a drive that turns the spindle.
    pub(super) fn turns(&self) -> Option<f64> {
        let axis = self.setup.axes.iter().position(|of| of.rpm_max.is_some())?;
        self.machine_position_mm(axis as u8)
    }

    /// Where the load of an axis is, mm: what a rule on the machine would show.
    pub(super) fn machine_position_mm(&self, axis: u8) -> Option<f64> {
        let axis = usize::from(axis);
        let (axis, of) = (self.axes.get(axis)?, &self.setup.axes[axis]);
        Some(axis.motor.machine_position() / (mm_to_counts(&of.joint, 1.0) * of.increments))
    }
}

/// Axes that a drive has: those of its profile, and all that are used.
fn axes(config: &Config, index: NodeIndex) -> u8 {
    let of_profile = config.bus.nodes[index].drive.as_ref().map_or(1, |drive| drive.axes);
    let joints = config.joints.iter().filter(|joint| joint.node == index);
    let spindle = config.spindle.axis.filter(|of| of.node == index);
    let used = joints
        .map(|joint| joint.drive_axis)
        .chain(spindle.map(|of| of.drive_axis));
    used.map(|axis| axis + 1).max().unwrap_or(1).max(of_profile)
}

/// What an axis of a drive is made of, and its motor.
fn axis_setup(config: &Config, index: NodeIndex, axis: u8) -> (AxisSetup, Motor) {
    let sim = &config.sim;
    let here = |node: usize, drive_axis: u8| (node, drive_axis) == (index, axis);
    let number = config
        .joints
        .iter()
        .position(|joint| here(joint.node, joint.drive_axis));
    let spindle = config.spindle.axis.filter(|of| here(of.node, of.drive_axis));
    let joint = match (number, &spindle) {
        (Some(number), _) => config.joints[number].clone(),
        (None, Some(of)) => of_spindle(of),
        (None, None) => BENCH,
    };
    let track = match spindle {
        Some(_) => Track::endless(joint.counts_per_unit[0].into()),
        None => Track::for_joint(&joint, sim.start, number.and_then(|number| sim.joint(number))),
    };
    let increments = increments_of_unit(&joint.factor_group);
    let track = track.in_increments(increments);
    let motor = MotorConfig {
        natural_frequency_rad_s: sim.natural_frequency_hz * std::f64::consts::TAU,
        damping: sim.damping,
        acceleration_max: MOTOR_RESERVE * mm_to_counts(&joint, joint.stop.acceleration_mm_s2) * increments,
    };
    let mut motor = Motor::new(motor, track);
    motor.index_missing = sim.is_faulty(index, axis, SimFaultKind::IndexMissing);
    let mut delays = Delays::default();
    if sim.is_faulty(index, axis, SimFaultKind::SlowEnable) {
        delays.0[ENABLE_OPERATION] = SLOW_NS;
    }
    let setup = AxisSetup {
        joint,
        increments,
        rpm_max: spindle.map(|_| config.spindle.rpm_max),
        delays,
    };
    (setup, motor)
}

/// Increments of a motor for a position unit of a drive with this factor group; what it leaves open is as drives come.
fn increments_of_unit(group: &FactorGroup) -> f64 {
    const OF_TURN: [u32; 2] = [FACTORY_INCREMENTS, 1];
    let quotient = |ratio: Option<[u32; 2]>, usual: [u32; 2]| {
        let [above, below] = ratio.unwrap_or(usual).map(f64::from);
        above / below
    };
    quotient(group.encoder, OF_TURN) * quotient(group.gear, [1, 1]) / quotient(group.feed, OF_TURN)
}

/// Sets the drive's parameters as whoever put the machine into service did; they outlive resets.
fn commission<const E: usize, const B: usize>(
    objects: &mut Dictionary<E, B>,
    axis: u8,
    joint: &Joint,
) -> Result<(), AbortCode> {
    let counts = |mm: f64| (mm_to_counts(joint, mm).round().clamp(1.0, f64::from(u32::MAX)) as u32).to_le_bytes();
    let [velocity, per] = joint.factor_group.velocity_ratio().map(f64::from);
    let velocity_units = |mm: f64| counts(mm * velocity / per);
    let homing = &joint.homing;
    let (method, acceleration_mm_s2) = match homing.by {
        HomingBy::Drive {
            method,
            acceleration_mm_s2,
        } => (method, acceleration_mm_s2),
        // As drives come out of the box: nobody asks this one to home.
        HomingBy::Control(_) => (0, joint.limits.acceleration_mm_s2),
    };
    let values: [(u16, u8, &[u8]); 9] = [
        (0x6007, 0, &ABORT_QUICK_STOP.to_le_bytes()),
        (0x6065, 0, &counts(joint.following_error_mm)),
        (0x6083, 0, &velocity_units(joint.limits.acceleration_mm_s2)),
        (0x6084, 0, &velocity_units(joint.limits.acceleration_mm_s2)),
        (0x6085, 0, &velocity_units(joint.stop.acceleration_mm_s2)),
        (0x6098, 0, &method.to_le_bytes()),
        (0x6099, 1, &velocity_units(homing.search_mm_s)),
        (0x6099, 2, &velocity_units(homing.latch_mm_s)),
        (0x609A, 0, &velocity_units(acceleration_mm_s2)),
    ];
    for (index, sub, octets) in values {
        let handle = objects.find(object_of(axis, index), sub)?;
        objects.set_default(handle, octets)?;
    }
    // What the control does not write it was given with its own tool.
    let kept = joint.factor_group.objects().filter(|_| joint.factor_group.compare_only);
    for (index, sub, value) in kept {
        let handle = objects.find(object_of(axis, index), sub)?;
        objects.set_default(handle, &value.to_le_bytes())?;
    }
    Ok(())
}

/// The same of a drive that turns the spindle: encoder, highest speed, ramps of VL.
fn commission_spindle<const E: usize, const B: usize>(
    objects: &mut Dictionary<E, B>,
    axis: u8,
    joint: &Joint,
    rpm_max: f64,
) -> Result<(), AbortCode> {
    let ramp_rpm_s = (60.0 * SPINDLE_RAMP_TURNS_S2) as u32;
    let increments = joint.counts_per_unit[0];
    let of_encoder = [(0x608F, 1, increments), (0x6092, 1, increments)];
    // With a factor group it is set, or was, as that says.
    let has_group = joint.factor_group.objects().next().is_some();
    let of_encoder = of_encoder.into_iter().filter(|_| !has_group);
    let values = [
        (0x6046, 2, rpm_max.ceil() as u32),
        (0x6048, 1, ramp_rpm_s),
        (0x6049, 1, ramp_rpm_s),
    ];
    for (index, sub, value) in of_encoder.chain(values) {
        let handle = objects.find(object_of(axis, index), sub)?;
        objects.set_default(handle, &value.to_le_bytes())?;
    }
    Ok(())
}
