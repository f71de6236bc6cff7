//! Drive side: what makes a servo drive of an object dictionary and a motor.
//!
//! In:  per bus cycle the received objects (controlword, mode, target) and the motor's [`Sensors`].
//! Out: per bus cycle the objects to send (statusword, actual values) and the [`Demand`] of the next period, which the
//!      position loop follows.
//!
//! Positions of the network are 32 bits, in the units of the factor group, and move with homing; inside, motor counts of 64 bits
//! never jump. The device
//! works on the values of a dictionary that somebody else owns and fills: it knows no bus.

mod factors;
mod homing;
mod modes;
mod motion;
mod objects;
mod power;
mod profiles;
mod quirks;
mod touch;
mod transitions;

pub use homing::{Sensors, Switch};
pub use motion::{Control, Demand};
pub use objects::{DEVICE_TYPE, DRIVE_OBJECTS, DRIVE_OBJECTS_WITH_DEMAND, SUPPORTED_MODES, check_write};
pub use power::{Delays, transition};
pub use quirks::{Injected, Quirks};

use crate::profile::{State, controlword, mode, statusword};
use factors::Factors;
use homing::Homing;
use motion::{Generator, round};
use obd::{AbortCode, Dictionary, Key};
use objects::Keys;
use power::Power;
use profiles::{SetPoints, Windows};

/// 603F: following error.
pub const ERROR_FOLLOWING: u16 = 0x8611;
/// 603F: communication monitoring.
pub const ERROR_COMMUNICATION: u16 = 0x8100;
/// 603F: safe torque off while enabled.
pub const ERROR_STO: u16 = 0x5441;
/// 603F: parameter wrong.
pub const ERROR_PARAMETER: u16 = 0x6320;

/// Bit of 60FE: the brake is closed; where 60FE:2 has it, too. Else the drive lifts it with the power.
const BRAKE: u32 = 1;

/// What the powered motor is doing.
#[derive(Clone, Copy, Debug)]
enum Activity {
    /// No torque.
    Off,
    /// What the mode says.
    Mode,
    /// Stops at this deceleration, then takes the transition.
    Stop { deceleration: f64, number: u8, to: State },
    /// Stops at this deceleration, and stands.
    Hold { deceleration: f64 },
}

/// Homing as the statusword shows it.
#[derive(Clone, Copy, Debug)]
enum HomingIndication {
    /// Not started, or stopped.
    Idle,
    Running(Homing),
    Attained,
    Failed,
}

/// A servo drive.
#[derive(Clone, Debug)]
pub struct Device {
    keys: Keys,
    period_ns: u32,
    power: Power,
    activity: Activity,
    generator: Generator,
    factors: Factors,
    /// Position of the network = motor position in its units + offset.
    offset: i64,
    mode: i8,
    homing: HomingIndication,
    start_bit: bool,
    set_points: SetPoints,
    /// A profile mode is where it was told to be.
    reached: bool,
    windows: Windows,
    /// The target is followed as it is.
    follows: bool,
    limited: bool,
    /// Demand at rest, actual position within 6067 of it for 6068.
    in_position: bool,
    following_error_ns: u64,
    error_code: u16,
    connected: bool,
    /// Bits of 60B9 that stand for stored edges, of each touch probe.
    probes_stored: [u16; 2],
    quirks: Quirks,
    /// Faults and changes from outside.
    pub injected: Injected,
}

impl Device {
    /// A drive that has just been switched on. `period_ns` is the bus cycle. Refuses dictionaries that lack one of
    /// [`DRIVE_OBJECTS`].
    ///
    /// # Errors
    /// [`AbortCode::NO_OBJECT`] and the like: an object of [`DRIVE_OBJECTS`] is missing or of another type.
    pub fn new<const ENTRIES: usize, const BYTES: usize>(
        objects: &Dictionary<ENTRIES, BYTES>,
        period_ns: u32,
        delays: Delays,
    ) -> Result<Device, AbortCode> {
        Device::of_axis(objects, 0, period_ns, delays)
    }

    /// An axis of a device that has several: its objects lie 800h times its number behind [`DRIVE_OBJECTS`].
    ///
    /// # Errors
    /// As [`Device::new`].
    pub fn of_axis<const ENTRIES: usize, const BYTES: usize>(
        objects: &Dictionary<ENTRIES, BYTES>,
        axis: u8,
        period_ns: u32,
        delays: Delays,
    ) -> Result<Device, AbortCode> {
        Ok(Device {
            keys: Keys::find(objects, axis)?,
            period_ns,
            power: Power::new(delays),
            activity: Activity::Off,
            generator: Generator::default(),
            factors: Factors::default(),
            offset: 0,
            mode: mode::NONE,
            homing: HomingIndication::Idle,
            start_bit: false,
            set_points: SetPoints::default(),
            reached: false,
            windows: Windows::default(),
            follows: false,
            limited: false,
            in_position: false,
            following_error_ns: 0,
            error_code: 0,
            connected: false,
            probes_stored: [0; 2],
            quirks: Quirks::default(),
            injected: Injected::default(),
        })
    }

    /// The same drive, as it was built.
    #[must_use]
    pub fn with_quirks(self, quirks: Quirks) -> Device {
        Device { quirks, ..self }
    }

    /// From now on its transitions take so long.
    pub fn set_delays(&mut self, delays: Delays) {
        self.power.set_delays(delays);
    }

    /// Reset of the application: as after power-on, except that the encoder keeps its count and what was injected stays.
    pub fn reset(&mut self) {
        self.power.restart();
        self.activity = Activity::Off;
        self.mode = mode::NONE;
        self.homing = HomingIndication::Idle;
        self.error_code = 0;
        self.connected = false;
    }

    /// A fault inside the drive (transition 13). The first code stays until it is reset.
    pub fn raise_fault(&mut self, code: u16) {
        if self.error_code == 0 {
            self.error_code = code;
        }
    }

    /// State of the power section.
    pub fn state(&self) -> State {
        self.power.state()
    }

    /// 603F.
    pub fn error_code(&self) -> u16 {
        self.error_code
    }

    /// 1001h, from the group of the error code: bit 0 any, 1 current, 2 voltage, 3 temperature, 4 communication,
    /// 5 profile, 7 maker.
    pub fn error_register(&self) -> u8 {
        match self.error_code {
            0 => 0,
            0x2000..=0x2FFF => 0x03,
            0x3000..=0x3FFF => 0x05,
            0x4000..=0x4FFF => 0x09,
            0x8100..=0x81FF => 0x11,
            0xFF00..=0xFFFF => 0x81,
            _ => 0x21,
        }
    }

    /// Position of the network for one of the motor.
    fn shown(&self, counts: i64) -> i64 {
        self.factors.units(counts) + self.offset
    }

    /// Motor counts for a position of the network.
    fn counts(&self, shown: i64) -> f64 {
        self.factors.increments(shown - self.offset)
    }

    /// increments/s or increments/s² for a speed or a ramp of the network.
    fn speed_of<const E: usize, const B: usize>(&self, objects: &Dictionary<E, B>, key: Key<u32>) -> f64 {
        self.factors.speed(f64::from(objects.get(key)))
    }

    /// One bus cycle. `connected`: the node is OPERATIONAL and synchronised, so that the received objects count.
    ///
    /// RT: constant time, no allocation.
    pub fn cycle<const ENTRIES: usize, const BYTES: usize>(
        &mut self,
        objects: &mut Dictionary<ENTRIES, BYTES>,
        sensors: &Sensors,
        connected: bool,
    ) -> Demand {
        let keys = self.keys;
        if matches!(self.activity, Activity::Off) {
            self.generator.track(sensors.position);
            // With torque on, other units would be a jump.
            self.factors.update(objects, &keys, self.quirks.encoders);
        }
        // Who leads the drive by velocity or torque knows of positions himself.
        let following_error = match self.generator.control {
            Control::Position => self.factors.units(round(self.generator.position) - sensors.position),
            Control::Velocity | Control::Torque => 0,
        };
        let window = objects.get(keys.position_window);
        let is_near = self.generator.at_rest() && following_error.unsigned_abs() <= u64::from(window);
        let window_ms = objects.get(keys.position_window_ms);
        self.in_position = self.windows.position.holds(is_near, self.period_ns, window_ms);
        self.watch_following_error(objects, following_error);
        if self.power.advance(self.period_ns) {
            self.entered(objects, sensors);
        }
        self.watch_safety_circuit(objects, sensors);
        self.watch_connection(objects, sensors, connected);
        self.react_to_fault(objects, sensors);
        let controlword = objects.get(keys.controlword);
        if connected {
            if self.injected.remote {
                self.apply_controlword(objects, sensors, controlword);
            }
            self.choose_mode(objects.get(keys.mode), objects.get(keys.supported_modes));
        }
        self.advance_set_point(objects, sensors, controlword);
        let velocity = self.generator.velocity;
        let follows_badly = self.follows_badly(following_error, objects.get(keys.following_window));
        let mut word = self.statusword(follows_badly) | self.profile_bits(objects, sensors, follows_badly);
        if self.is_halted(controlword) {
            // Bit 10 then says that it stands.
            word &= !statusword::TARGET_REACHED;
            word |= if self.generator.at_rest() {
                statusword::TARGET_REACHED
            } else {
                0
            };
        }
        objects.set(keys.statusword, word);
        objects.set(keys.error_code, self.error_code);
        objects.set(keys.mode_display, self.mode);
        // The network's positions are the low 32 bits.
        objects.set(keys.position_internal, sensors.position as i32);
        objects.set(keys.position, self.shown(sensors.position) as i32);
        objects.set(keys.velocity, self.velocity_shown(sensors.velocity as f64) as i32);
        objects.set(keys.position_demand_internal, round(self.generator.position) as i32);
        if !self.quirks.target_in_demand {
            let demand = self.shown(round(self.generator.position));
            objects.set(keys.position_demand, demand as i32);
        }
        objects.set(keys.velocity_demand, self.velocity_shown(velocity) as i32);
        self.watch_probes(objects, sensors);
        let rpm = self.counts_per_rpm(objects);
        objects.set(keys.vl_demand, (velocity / rpm) as i16);
        objects.set(keys.vl_actual, (sensors.velocity as f64 / rpm) as i16);
        objects.set(keys.torque_demand, self.generator.torque as i16);
        objects.set(keys.torque, sensors.torque);
        objects.set(keys.following_error, following_error as i32);
        objects.set(keys.digital_inputs, self.digital_inputs(sensors));
        let powered = !matches!(self.activity, Activity::Off);
        Demand {
            powered,
            control: self.generator.control,
            position: self.generator.position,
            velocity,
            feed_forward: self.generator.feed_forward,
            brake: powered && objects.get(keys.outputs_mask) & objects.get(keys.outputs) & BRAKE != 0,
            torque: self.generator.torque,
        }
    }

    /// Velocity of the network for one of the motor, to the nearest unit.
    fn velocity_shown(&self, counts_s: f64) -> i64 {
        round(self.factors.velocity_units(counts_s))
    }

    fn period_s(&self) -> f64 {
        f64::from(self.period_ns) * 1e-9
    }

    fn watch_following_error<const E: usize, const B: usize>(&mut self, objects: &Dictionary<E, B>, error: i64) {
        let window = objects.get(self.keys.following_window);
        if window == u32::MAX || error.unsigned_abs() <= u64::from(window) {
            self.following_error_ns = 0;
            return;
        }
        self.following_error_ns += u64::from(self.period_ns);
        let limit_ns = u64::from(objects.get(self.keys.following_time_ms)) * 1_000_000;
        if self.following_error_ns > limit_ns {
            self.raise_fault(ERROR_FOLLOWING);
        }
    }

    /// A mode counts as soon as the drive has it; one that the drive lacks changes nothing.
    fn choose_mode(&mut self, wanted: i8, supported: u32) {
        if wanted != mode::NONE && wanted != self.mode && supported & mode::supported_bit(wanted) != 0 {
            self.mode = wanted;
            self.homing = HomingIndication::Idle;
            self.begin_mode();
        }
    }

    /// Moves the set-point on by one period.
    fn advance_set_point<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        word: u16,
    ) {
        let keys = self.keys;
        let period_s = self.period_s();
        self.follows = false;
        self.limited = false;
        match self.activity {
            Activity::Off => {
                self.generator.track(sensors.position);
                if self.power.state() == State::FaultReactionActive {
                    self.power.start_transition(14, State::Fault);
                }
            }
            Activity::Hold { deceleration } => {
                self.generator.approach(0.0, deceleration, period_s);
            }
            Activity::Stop {
                deceleration,
                number,
                to,
            } => {
                // The motor gets the period in which its speed becomes zero before the torque may go.
                if self.generator.at_rest() || deceleration.is_infinite() {
                    self.activity = Activity::Hold { deceleration };
                    self.power.start_transition(number, to);
                    self.entered(objects, sensors);
                } else {
                    self.generator.approach(0.0, deceleration, period_s);
                }
            }
            Activity::Mode if self.connected && word & controlword::HALT != 0 => {
                let option = objects.get(keys.halt_option);
                let ramp = if option == 2 {
                    keys.quick_deceleration
                } else {
                    keys.deceleration
                };
                self.generator.approach(0.0, self.speed_of(objects, ramp), period_s);
                self.homing = HomingIndication::Idle;
            }
            Activity::Mode => match self.mode {
                mode::CYCLIC_SYNCHRONOUS_POSITION => self.follow(objects, sensors, keys.target),
                mode::INTERPOLATED_POSITION if word & controlword::MODE_START != 0 => {
                    self.follow(objects, sensors, keys.interpolation_target);
                }
                mode::CYCLIC_SYNCHRONOUS_VELOCITY => self.follow_velocity(objects, sensors),
                mode::CYCLIC_SYNCHRONOUS_TORQUE => self.follow_torque(objects, sensors),
                mode::HOMING => self.home(objects, sensors, word),
                mode::PROFILE_POSITION => self.position_profile(objects, sensors, word),
                mode::VELOCITY => self.speed(objects, sensors, word),
                mode::PROFILE_VELOCITY => self.velocity_profile(objects, sensors),
                mode::PROFILE_TORQUE => self.torque_profile(objects, sensors),
                _ => {
                    self.generator
                        .approach(0.0, self.speed_of(objects, keys.deceleration), period_s);
                }
            },
        }
        self.start_bit = word & controlword::MODE_START != 0;
    }

    /// Whether *halt* holds it in a mode in which bit 10 has a meaning.
    fn is_halted(&self, word: u16) -> bool {
        let tells = matches!(
            self.mode,
            mode::PROFILE_POSITION | mode::PROFILE_VELOCITY | mode::PROFILE_TORQUE | mode::HOMING
        );
        let halts = self.connected && word & controlword::HALT != 0;
        tells && halts && matches!(self.activity, Activity::Mode)
    }

    /// Bit 13 of the modes with a position.
    fn follows_badly(&self, following_error: i64, window: u32) -> bool {
        let error = window != u32::MAX && following_error.unsigned_abs() > u64::from(window);
        error || self.error_code == ERROR_FOLLOWING
    }

    fn statusword(&self, follows_badly: bool) -> u16 {
        let state = self.power.state();
        let mut word = state.statusword();
        let mut set = |on: bool, bits: u16| word |= if on { bits } else { 0 };
        set(state != State::NotReadyToSwitchOn, statusword::VOLTAGE_ENABLED);
        set(self.injected.remote, statusword::REMOTE);
        set(self.injected.warning, statusword::WARNING);
        set(self.limited, statusword::INTERNAL_LIMIT);
        match self.mode {
            mode::HOMING => {
                set(
                    self.in_position && !matches!(self.homing, HomingIndication::Running(_)),
                    statusword::TARGET_REACHED,
                );
                set(matches!(self.homing, HomingIndication::Attained), statusword::MODE_ACK);
                set(matches!(self.homing, HomingIndication::Failed), statusword::MODE_ERROR);
            }
            mode::INTERPOLATED_POSITION | mode::CYCLIC_SYNCHRONOUS_VELOCITY | mode::CYCLIC_SYNCHRONOUS_TORQUE => {
                set(self.follows, statusword::MODE_ACK);
            }
            mode::PROFILE_POSITION | mode::VELOCITY | mode::PROFILE_VELOCITY | mode::PROFILE_TORQUE => {}
            _ => {
                set(self.follows, statusword::MODE_ACK);
                set(follows_badly, statusword::MODE_ERROR);
            }
        }
        word
    }

    /// 60FD: limit switches, home switch and safety circuit at the bits where this drive has them.
    fn digital_inputs(&self, sensors: &Sensors) -> u32 {
        let [negative, positive, home] = self.quirks.input_bits;
        let (sto, while_open) = self.quirks.sto;
        let shown = [
            (negative, sensors.negative_limit.active),
            (positive, sensors.positive_limit.active),
            (home, sensors.home.active),
            (sto, self.injected.sto_open == while_open),
        ];
        let shown = shown.into_iter().filter(|(bit, on)| *on && *bit < 32);
        shown.fold(self.injected.digital_inputs, |word, (bit, _)| word | 1 << bit)
    }
}

#[cfg(test)]
mod tests;
