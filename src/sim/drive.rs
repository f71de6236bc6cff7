//! A simulated servo drive: a POWERLINK controlled node, a CiA 402 device and a motor.
//!
//! In:  frames of the managing node, the time. Out: the frame to answer with; the motor's motion.
//!
//! The drive lives by the SoC: each one closes a period of the motor and opens the next. The work of a period is done
//! once the SoA has been answered, when nobody waits for this drive. When the SoC stays away for
//! [`FREE_RUN_PERIODS`] its periods go by its own clock; once its node gives the managing node up (1C0B, 1C14) it stops
//! as 6007 says.

use super::SimError;
use super::built::{MAKER_ENTRIES, objects, quirks};
use super::motor::{Motor, MotorConfig};
use super::track::{Track, mm_to_counts};
use crate::config::{
    Config, DriveMode, Homing, HomingBy, InputBits, Joint, JointLimits, Node, NodeIndex, Reactions, SimFaultKind,
    SimJoint, SpindleAxis, Sto, StopLimits,
};
use cia402::State;
use cia402::device::{DEVICE_TYPE, DRIVE_OBJECTS, Delays, Demand, Device, Injected, check_write};
use obd::{AbortCode, Dictionary, EntryDef, Handle, Key};
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, Events, QueueError};
use powerlink::nmt::{NmtState, Reset};
use powerlink::wire::FRAME_LEN_MAX;

const ENTRIES: usize = COMMUNICATION_ENTRIES + obd::lines_of(DRIVE_OBJECTS) + MAKER_ENTRIES;
const OCTETS: usize = COMMUNICATION_BYTES + obd::octets_of(DRIVE_OBJECTS) + 8 * MAKER_ENTRIES;

/// Periods without a SoC after which a drive goes on by its own clock.
pub(super) const FREE_RUN_PERIODS: u64 = 5;
/// Periods made up for at most after a pause, such as that of a stopped process.
const CATCH_UP_PERIODS: u32 = 20;
/// 6007: quick stop.
const ABORT_QUICK_STOP: i16 = 3;
/// Greatest acceleration of the motor as a multiple of the joint's stop acceleration.
const MOTOR_RESERVE: f64 = 4.0;
/// Number of the transition to OPERATION ENABLED.
const ENABLE_OPERATION: usize = 4;
/// Longer than anybody waits for it.
const SLOW_NS: u32 = 4_000_000_000;
/// Number of the device profile in error entries.
const PROFILE: u16 = 402;

/// A drive that no joint uses still turns a motor: on a bench.
const BENCH: Joint = Joint {
    step: None,
    analog: None,
    node: 0,
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
    limits_by_drive: false,
    input_bits: InputBits {
        limits: [0, 1],
        home: 2,
    },
    home_count: 0,
    sto: None,
    squaring_offset_mm: 0.0,
};

/// Change of the speed of a spindle, turns/s².
const SPINDLE_RAMP_TURNS_S2: f64 = 2000.0 / 60.0;
/// Increments of a turn of a spindle whose drive counts in 1/min.
const SPINDLE_INCREMENTS: u32 = 10_000;

/// The bench of a drive that turns the spindle; its unit is a turn.
fn of_spindle(of: &SpindleAxis) -> Joint {
    let [units, rpm] = of.units_per_rpm.map(f64::from);
    let increments = match of.mode {
        DriveMode::Vl => SPINDLE_INCREMENTS,
        _ => (60.0 * units / rpm).round().clamp(1.0, f64::from(u32::MAX)) as u32,
    };
    let mut bench = BENCH;
    bench.mode = of.mode;
    bench.counts_per_unit = [increments, 1];
    bench.limits.acceleration_mm_s2 = SPINDLE_RAMP_TURNS_S2;
    bench.stop.acceleration_mm_s2 = 2.0 * SPINDLE_RAMP_TURNS_S2;
    bench
}

/// What a drive is made of; kept for the next power-on.
#[derive(Clone, Debug)]
struct Setup {
    node: Node,
    joint: Joint,
    /// Of a drive that turns the spindle: its highest speed, 1/min.
    rpm_max: Option<f64>,
    objects: &'static [EntryDef],
    period_ns: u32,
    delays: Delays,
}

#[derive(Debug)]
pub(super) struct Drive {
    setup: Setup,
    cn: Cn<ENTRIES, OCTETS>,
    device: Device,
    motor: Motor,
    demand: Demand,
    powered: bool,
    error_register: Key<u8>,
    /// The object in which it shows its safety circuit, where that is not 60FD.
    sto: Option<(Handle, Sto)>,
    /// Error code that 1001h and the error history have been told of.
    reported: u16,
    /// Bits of 1001h that stand for it.
    register_bits: u8,
    /// The last SoC, or the last period of the drive's own clock.
    period_start_ns: u64,
    /// The SoC came and its period has not been worked off.
    due: bool,
    free_running: bool,
    /// A reset of the application waits until the motor has stopped.
    reset_due: bool,
}

impl Drive {
    pub(super) fn new(
        node: &Node,
        joint: Option<&Joint>,
        (config, index): (&Config, NodeIndex),
        special: Option<&SimJoint>,
        period_ns: u32,
        now_ns: u64,
    ) -> Result<Drive, SimError> {
        let sim = &config.sim;
        let spindle = config.spindle.axis.filter(|of| of.node == index);
        let joint = match (joint, &spindle) {
            (Some(joint), _) => joint.clone(),
            (None, Some(of)) => of_spindle(of),
            (None, None) => BENCH,
        };
        let track = match spindle {
            Some(_) => Track::endless(joint.counts_per_unit[0].into()),
            None => Track::for_joint(&joint, sim.start, special),
        };
        let motor = MotorConfig {
            natural_frequency_rad_s: sim.natural_frequency_hz * std::f64::consts::TAU,
            damping: sim.damping,
            acceleration_max: MOTOR_RESERVE * mm_to_counts(&joint, joint.stop.acceleration_mm_s2),
        };
        let mut motor = Motor::new(motor, track);
        motor.index_missing = sim.is_faulty(index, SimFaultKind::IndexMissing);
        let mut delays = Delays::default();
        if sim.is_faulty(index, SimFaultKind::SlowEnable) {
            delays.0[ENABLE_OPERATION] = SLOW_NS;
        }
        Drive::switch_on(
            Setup {
                node: node.clone(),
                joint,
                rpm_max: spindle.map(|_| config.spindle.rpm_max),
                objects: objects(node),
                period_ns,
                delays,
            },
            motor,
            now_ns,
        )
    }

    fn switch_on(setup: Setup, motor: Motor, now_ns: u64) -> Result<Drive, SimError> {
        let node = &setup.node;
        let quirks = quirks(node);
        let mut objects: Dictionary<ENTRIES, OCTETS> =
            Dictionary::new(&[COMMUNICATION_PROFILE, setup.objects]).map_err(|error| SimError::new(node, error))?;
        commission(&mut objects, &setup.joint).map_err(|error| SimError::new(node, error))?;
        if let Some(rpm_max) = setup.rpm_max {
            commission_spindle(&mut objects, &setup.joint, rpm_max).map_err(|error| SimError::new(node, error))?;
        }
        let device =
            Device::new(&objects, setup.period_ns, setup.delays).map_err(|error| SimError::new(node, error))?;
        let device = device.with_quirks(quirks);
        let error_register = objects.key(0x1001, 0).map_err(|error| SimError::new(node, error))?;
        let sto = node.drive.as_ref().and_then(|drive| drive.sto);
        let sto = sto.filter(|sto| sto.object != (0x60FD, 0));
        let sto = sto.and_then(|sto| Some((objects.find(sto.object.0, sto.object.1).ok()?, sto)));
        let mut cn = super::node::build(node, DEVICE_TYPE, objects, now_ns)?;
        cn.set_write_check(check_write);
        Ok(Drive {
            cn,
            device,
            motor,
            demand: Demand::default(),
            powered: true,
            error_register,
            sto,
            reported: 0,
            register_bits: 0,
            period_start_ns: now_ns,
            due: false,
            free_running: true,
            reset_due: false,
            setup,
        })
    }

    /// Takes a frame; the octets of `response` that are to be sent at once.
    pub(super) fn receive(&mut self, now_ns: u64, frame: &[u8], response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        if !self.powered {
            return None;
        }
        let reaction = self.cn.receive(now_ns, frame, response);
        self.apply_events(now_ns, &reaction.events);
        reaction.transmit
    }

    /// Does the work of the period, if its SoC has come.
    pub(super) fn work(&mut self) {
        if self.due {
            self.due = false;
            self.step();
        }
    }

    pub(super) fn poll(&mut self, now_ns: u64) {
        if self.powered {
            let events = self.cn.poll(now_ns);
            self.apply_events(now_ns, &events);
        }
        if now_ns < self.own_period_ns() {
            return;
        }
        self.free_running = true;
        self.due = false;
        let period_ns = u64::from(self.setup.period_ns);
        for _ in 0..CATCH_UP_PERIODS {
            if now_ns < self.period_start_ns + period_ns {
                return;
            }
            self.period_start_ns += period_ns;
            self.step();
        }
        self.period_start_ns = now_ns;
    }

    /// The octets of `response` that are to be sent by the clock: the PRes of a chained node.
    pub(super) fn poll_transmit(&mut self, now_ns: u64, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        self.powered.then(|| self.cn.poll_transmit(now_ns, response)).flatten()
    }

    /// Has a frame that is not POWERLINK sent when the node is invited to.
    pub(super) fn send_ethernet(&mut self, frame: &[u8]) -> Result<(), QueueError> {
        self.cn.send_ethernet(frame)
    }

    pub(super) fn next_poll_ns(&self) -> u64 {
        let own_ns = self.own_period_ns();
        if self.powered {
            self.cn.next_deadline_ns().map_or(own_ns, |cn_ns| cn_ns.min(own_ns))
        } else {
            own_ns
        }
    }

    /// When the drive's own clock ends a period.
    fn own_period_ns(&self) -> u64 {
        let periods = if self.free_running { 1 } else { FREE_RUN_PERIODS };
        self.period_start_ns + periods * u64::from(self.setup.period_ns)
    }

    fn apply_events(&mut self, now_ns: u64, events: &Events) {
        if let Some(Reset::Software | Reset::Node) = events.reset {
            self.reset_due = true;
        }
        if events.sync.is_some() {
            // The SoA of the period before was lost.
            self.work();
            self.due = true;
            self.free_running = false;
            self.period_start_ns = now_ns;
        }
    }

    /// Ends one period of the motor and begins the next.
    fn step(&mut self) {
        let sensors = self.motor.advance(&self.demand, f64::from(self.setup.period_ns) * 1e-9);
        if !self.powered {
            self.demand = Demand::default();
            return;
        }
        // How long the drive trusts its last set-point without a SoC is the business of its node: 1C14 and 1C0B.
        let led = self.cn.nmt_state() == NmtState::Operational && !self.reset_due;
        self.demand = self.device.cycle(self.cn.dictionary_mut(), &sensors, led);
        if let Some((handle, sto)) = self.sto {
            let shown = self.device.injected.sto_open == sto.active;
            let value = u64::from(shown) << sto.bit;
            // As long as it is; only a value of another length could be refused.
            let _ = self
                .cn
                .dictionary_mut()
                .set_octets(handle, &value.to_le_bytes()[..handle.size()]);
        }
        let stopping = matches!(self.device.state(), State::QuickStopActive | State::FaultReactionActive);
        if self.reset_due && !stopping {
            self.reset_due = false;
            self.device.reset();
            self.demand = Demand::default();
        }
        let error_code = self.device.error_code();
        if error_code != self.reported {
            self.reported = error_code;
            if error_code != 0 {
                self.cn.report_error(PROFILE, error_code, [0; 8]);
            }
            let objects = self.cn.dictionary_mut();
            let others = objects.get(self.error_register) & !self.register_bits;
            self.register_bits = self.device.error_register();
            objects.set(self.error_register, others | self.register_bits);
        }
    }

    /// The machine's probe has changed after this share of the last period; a drive at which it is not wired does not know.
    pub(super) fn touch(&mut self, share: f64, closed: bool) {
        if let Some(number) = self.setup.joint.touch_probe {
            self.motor.touch(usize::from(number - 1), share, closed);
        }
    }

    pub(super) fn power_off(&mut self) {
        self.powered = false;
        self.demand = Demand::default();
    }

    pub(super) fn power_on(&mut self, now_ns: u64) -> Result<(), SimError> {
        let mut motor = self.motor.clone();
        motor.power_on();
        *self = Drive::switch_on(self.setup.clone(), motor, now_ns)?;
        Ok(())
    }

    pub(super) fn raise_fault(&mut self, code: u16) {
        self.device.raise_fault(code);
    }

    pub(super) fn jam(&mut self, jammed: bool) {
        self.motor.jammed = jammed;
    }

    pub(super) fn injected(&mut self) -> &mut Injected {
        &mut self.device.injected
    }

    pub(super) fn nmt_state(&self) -> NmtState {
        if self.powered {
            self.cn.nmt_state()
        } else {
            NmtState::Off
        }
    }

    pub(super) fn state(&self) -> State {
        self.device.state()
    }

    /// Turns since power-on, of a drive that turns the spindle.
    pub(super) fn turns(&self) -> Option<f64> {
        self.setup.rpm_max.map(|_| self.machine_position_mm())
    }

    /// Where the load is, mm: what a rule on the machine would show.
    pub(super) fn machine_position_mm(&self) -> f64 {
        self.motor.machine_position() / mm_to_counts(&self.setup.joint, 1.0)
    }
}

/// Sets the drive's parameters as whoever put the machine into service did; they outlive resets.
fn commission(objects: &mut Dictionary<ENTRIES, OCTETS>, joint: &Joint) -> Result<(), AbortCode> {
    let counts = |mm: f64| (mm_to_counts(joint, mm).round().clamp(1.0, f64::from(u32::MAX)) as u32).to_le_bytes();
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
        (0x6083, 0, &counts(joint.limits.acceleration_mm_s2)),
        (0x6084, 0, &counts(joint.limits.acceleration_mm_s2)),
        (0x6085, 0, &counts(joint.stop.acceleration_mm_s2)),
        (0x6098, 0, &method.to_le_bytes()),
        (0x6099, 1, &counts(homing.search_mm_s)),
        (0x6099, 2, &counts(homing.latch_mm_s)),
        (0x609A, 0, &counts(acceleration_mm_s2)),
    ];
    for (index, sub, octets) in values {
        let handle = objects.find(index, sub)?;
        objects.set_default(handle, octets)?;
    }
    Ok(())
}

/// The same of a drive that turns the spindle: encoder, highest speed, ramps of VL.
fn commission_spindle(objects: &mut Dictionary<ENTRIES, OCTETS>, joint: &Joint, rpm_max: f64) -> Result<(), AbortCode> {
    let ramp_rpm_s = (60.0 * SPINDLE_RAMP_TURNS_S2) as u32;
    let values = [
        (0x608F, 1, joint.counts_per_unit[0]),
        (0x6046, 2, rpm_max.ceil() as u32),
        (0x6048, 1, ramp_rpm_s),
        (0x6049, 1, ramp_rpm_s),
    ];
    for (index, sub, value) in values {
        let handle = objects.find(index, sub)?;
        objects.set_default(handle, &value.to_le_bytes())?;
    }
    Ok(())
}
