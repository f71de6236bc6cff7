//! The spindle: what it is told, and what its encoder says.
//!
//! In:  actions of the program, samples of the interpolation, the inputs of the nodes, pins.
//! Out: pins, the object that sets its speed; its place and speed for the interpolation.
//!
//! [`Spindle::new`] is made at start-up; the rest is RT.

use super::encoder::{Encoder, Speed};
use super::spindle_drive::SpindleDrive;
use bus::layout::Field;
use bus::plan::NodePlan;
use bus::{InputImage, NodeIndex, NodeState, OutputImage};
use cia402::axis::{AxisFault, Request};
use config::{Config, SpindleEncoder};
use hal_pins::{Hal, HalError, Input, Output};
use machine::faults::{OrientFailure, SpeedNotReached};
use motion::canon::{Axis, OrientDirection, SpindleDirection};
use motion::element::Surface;
use motion::rt::{Sample, SpindleFeedback};

/// Distance from the wanted speed that no encoder is fine enough to judge, 1/min.
const SPEED_SLACK_RPM: f64 = 5.0;

/// More than any spindle turns, 1/min: what stands for the speed at the centre, where none is enough.
const RPM_FINITE: f64 = 1e9;
/// Part of the speed that the axes can follow in a move in step with the spindle to which its override may raise it: the rest is
/// for what the spindle itself is faster.
const FOLLOWED: f64 = 0.99;
/// Cycles until the operator is told again that counts were lost.
const SLIP_QUIET_CYCLES: u32 = 10_000;
/// A change of the share of the feed that is not worth following.
const SHARE_STEP: f64 = 0.003;

/// What the program wants.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    /// As programmed; with a speed of the surface, the most.
    rpm: f64,
    direction: SpindleDirection,
    surface: Option<Surface>,
}

/// Where its place comes from.
enum Source {
    None,
    Pins {
        revs: Input<f64>,
        indexed: Input<bool>,
    },
    /// A counter of a node; shown to components.
    Counter {
        encoder: Encoder,
        revs: Output<f64>,
        indexed: Output<bool>,
    },
}

/// The object that sets the speed.
struct Drive {
    node: NodeIndex,
    speed: Field,
    /// Value at one turn a minute.
    per_rpm: f64,
}

/// The wanted speed, as drives of spindles may ask for it.
struct SpeedOut {
    rpm: Output<f64>,
    rpm_abs: Output<f64>,
    rps: Output<f64>,
    rps_abs: Output<f64>,
}

impl SpeedOut {
    fn new(hal: &mut Hal, spindle: u8) -> Result<SpeedOut, HalError> {
        let mut output = |pin: &str| hal.output(&format!("spindle.{spindle}.speed-out{pin}"));
        Ok(SpeedOut {
            rpm: output("")?,
            rpm_abs: output("-abs")?,
            rps: output("-rps")?,
            rps_abs: output("-rps-abs")?,
        })
    }

    /// RT.
    fn set(&mut self, rpm: f64) {
        self.rpm.set(rpm);
        self.rpm_abs.set(rpm.abs());
        self.rps.set(rpm / 60.0);
        self.rps_abs.set(rpm.abs() / 60.0);
    }
}

/// The spindle of the machine.
pub struct Spindle {
    on: Output<bool>,
    forward: Output<bool>,
    reverse: Output<bool>,
    speed_out: SpeedOut,
    speed_in: Output<f64>,
    at_speed: Input<bool>,
    orientation: Orientation,
    source: Source,
    drive: Option<Drive>,
    axis: Option<SpindleDrive>,

    cycle_s: f64,
    rpm_max: f64,
    tolerance: f64,
    lead_cycles: f64,
    timeout_s: f64,
    wanted: Option<Wanted>,
    /// The operator's override, a share.
    override_share: f64,
    /// Greatest speed in a move in step with the spindle that is under way, 1/min.
    followed_rpm: Option<f64>,
    /// Share to which this holds an override that is greater, until it is taken, and whether it was told.
    held: Option<f64>,
    is_held: bool,
    slip_quiet: u32,
    /// What it is told now, 1/min, above 0 with M3.
    rpm: f64,
    place: SpindleFeedback,
    speed: Speed,
    turns_per_cycle: f64,
    waited_s: f64,
    /// Share of the planned feed by turns that is wanted.
    share: f64,
    /// X of the last sample, machine.
    x_mm: f64,
}

impl Spindle {
    /// The spindle of the machine file.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config, plans: &[NodePlan]) -> Result<Spindle, HalError> {
        let spindle = &config.spindle;
        let counter = match spindle.encoder {
            Some(SpindleEncoder::Counter(counter)) => Encoder::new(counter, plans),
            Some(SpindleEncoder::Pins) | None => None,
        };
        let source = match (spindle.encoder, counter) {
            (Some(SpindleEncoder::Pins), _) => Source::Pins {
                revs: hal.input("spindle.0.revs", 0.0)?,
                indexed: hal.input("spindle.0.indexed", false)?,
            },
            (_, Some(encoder)) => Source::Counter {
                encoder,
                revs: hal.output("spindle.0.revs")?,
                indexed: hal.output("spindle.0.indexed")?,
            },
            (_, None) => Source::None,
        };
        let drive = spindle.drive.and_then(|drive| {
            let speed = plans
                .get(drive.node)?
                .outputs
                .find(drive.speed.index, drive.speed.sub)?;
            let greatest = (1_u64 << (drive.speed.bits - 1)) - 1;
            Some(Drive {
                node: drive.node,
                speed,
                per_rpm: greatest as f64 / spindle.rpm_max,
            })
        });
        Ok(Spindle {
            on: hal.output("spindle.0.on")?,
            forward: hal.output("spindle.0.forward")?,
            reverse: hal.output("spindle.0.reverse")?,
            speed_out: SpeedOut::new(hal, 0)?,
            speed_in: hal.output("spindle.0.speed-in")?,
            at_speed: hal.input("spindle.0.at-speed", true)?,
            orientation: Orientation::new(hal)?,
            source,
            drive,
            axis: SpindleDrive::new(config, plans),
            cycle_s: f64::from(config.cycle_us) * 1e-6,
            rpm_max: spindle.rpm_max,
            tolerance: spindle.speed_tolerance,
            lead_cycles: spindle.encoder_lead_cycles,
            timeout_s: spindle.speed_timeout_s,
            wanted: None,
            override_share: 1.0,
            followed_rpm: None,
            held: None,
            is_held: false,
            slip_quiet: 0,
            rpm: 0.0,
            place: SpindleFeedback::NONE,
            speed: Speed::new(),
            turns_per_cycle: 0.0,
            waited_s: 0.0,
            share: 1.0,
            x_mm: 0.0,
        })
    }

    /// Whether an object of a node is the spindle's own, so that nothing else shows or sets it.
    pub fn uses(config: &Config, node: NodeIndex, field: &Field) -> bool {
        let object = field.object;
        let of_drive = config
            .spindle
            .drive
            .is_some_and(|drive| (drive.node, drive.speed) == (node, object));
        let of_encoder = match config.spindle.encoder {
            Some(SpindleEncoder::Counter(counter)) => {
                counter.node == node && (counter.counter == object || counter.index == Some(object))
            }
            Some(SpindleEncoder::Pins) | None => false,
        };
        of_drive || of_encoder
    }

    /// Whether the control fills an object of a node for the drive that turns the spindle.
    pub fn fills(config: &Config, node: NodeIndex, object: (u16, u8)) -> bool {
        let of = config.spindle.axis.filter(|of| of.node == node);
        of.is_some_and(|of| SpindleDrive::fills(&of, object))
    }

    /// Takes what its drive sent, if it is one of CiA 402. RT.
    pub fn read_drive(&mut self, inputs: &InputImage, state: impl Fn(NodeIndex) -> NodeState) {
        if let Some(axis) = &mut self.axis {
            axis.read(inputs, state);
        }
    }

    /// Leads that drive; `may_turn`: the machine is on. RT.
    pub fn lead_drive(&mut self, now_ns: u64, may_turn: bool, outputs: &mut OutputImage) {
        if let Some(axis) = &mut self.axis {
            let rpm = self.wanted.filter(|_| may_turn).map(|_| self.rpm);
            axis.lead(now_ns, rpm, outputs);
        }
    }

    /// Asks that drive for something. RT.
    pub fn request(&mut self, request: Request) {
        if let Some(axis) = &mut self.axis {
            axis.request(request);
        }
    }

    /// What is wrong with that drive. RT.
    pub fn drive_fault(&self) -> Option<AxisFault> {
        self.axis.as_ref()?.fault()
    }

    /// Whether that drive is off, if there is one. RT.
    pub fn is_drive_off(&self) -> bool {
        self.axis.as_ref().is_none_or(SpindleDrive::is_off)
    }

    /// Looks at the encoder, and whether the spindle is at the angle of an M19. RT.
    pub fn update_feedback(&mut self, inputs: &InputImage) {
        self.orientation.look();
        self.place = match &mut self.source {
            Source::None => {
                if let Some(axis) = &self.axis {
                    self.speed_in.set(axis.measured_rpm() / 60.0);
                }
                return;
            }
            Source::Pins { revs, indexed } => SpindleFeedback {
                turns: revs.get(),
                indexed: indexed.get(),
            },
            Source::Counter { encoder, revs, indexed } => {
                let place = encoder.read(inputs, self.turns_per_cycle);
                revs.set(place.turns);
                indexed.set(place.indexed);
                place
            }
        };
        self.turns_per_cycle = self.speed.update(&self.place);
        self.speed_in.set(self.turns_per_cycle / self.cycle_s);
    }

    /// Counts by which its encoder was off at the last index: some were lost, or some that are none were counted. In a move in step
    /// with it (`in_step`) they are told as they are; else turns count from that index from now on, and it is told now and then.
    /// RT.
    pub fn take_slip(&mut self, in_step: bool) -> Option<i64> {
        self.slip_quiet = self.slip_quiet.saturating_sub(1);
        let Source::Counter { encoder, .. } = &mut self.source else {
            return None;
        };
        let slip = encoder.take_slip()?;
        if in_step {
            return Some(slip);
        }
        encoder.adopt_index();
        let told = self.slip_quiet == 0;
        self.slip_quiet = SLIP_QUIET_CYCLES;
        told.then_some(slip)
    }

    /// Where it will be when the axes are where this cycle's set-points bring them. RT.
    pub fn place(&self) -> SpindleFeedback {
        SpindleFeedback {
            turns: self.place.turns + self.lead_cycles * self.turns_per_cycle,
            ..self.place
        }
    }

    /// M3, M4, S. RT.
    pub fn command(&mut self, rpm: f64, direction: SpindleDirection, surface: Option<Surface>) {
        self.orientation.end();
        self.wanted = Some(Wanted {
            rpm,
            direction,
            surface,
        });
        self.waited_s = 0.0;
        self.publish(None);
    }

    /// M5. RT.
    pub fn stop(&mut self) {
        self.orientation.end();
        self.wanted = None;
        self.publish(None);
    }

    /// M19. RT.
    pub fn orient(&mut self, degrees: f64, direction: OrientDirection) {
        self.stop();
        self.orientation.begin(degrees, direction);
    }

    /// M19 Q: from here on the time counts; `None`: that for a speed. RT.
    pub fn await_oriented(&mut self, timeout_s: Option<f64>) {
        self.orientation.timeout_s = timeout_s.unwrap_or(self.timeout_s);
        self.orientation.waited_s = 0.0;
    }

    /// Whether the spindle is where M19 has sent it. RT.
    pub fn is_oriented(&mut self) -> bool {
        let orientation = &mut self.orientation;
        orientation.waited_s += self.cycle_s;
        orientation.state != Orienting::UnderWay
    }

    /// Why the angle of an M19 is not reached. RT.
    pub fn orient_failure(&self) -> Option<OrientFailure> {
        self.orientation.failure()
    }

    /// From the next [`Spindle::steer`] on, this share of the programmed speed. RT.
    pub fn set_override(&mut self, share: f64) {
        self.override_share = share;
    }

    /// Tells it its direction and speed of this cycle. RT.
    pub fn steer(&mut self, sample: &Sample) {
        self.x_mm = sample.position[Axis::X];
        self.followed_rpm = sample.turns_s_max.map(|turns_s| FOLLOWED * turns_s * 60.0);
        self.publish(sample.reversal);
    }

    /// The share to which a move in step with the spindle holds a greater override; told once each time. RT.
    pub fn take_held(&mut self) -> Option<f64> {
        self.held.take()
    }

    /// The speed under an override, of which the axes may allow less; what is programmed has been looked at by the planner.
    fn overridden(&mut self, programmed_rpm: f64) -> f64 {
        let wanted = self.override_share * programmed_rpm;
        let most = self.followed_rpm.map_or(f64::INFINITY, |most| most.max(programmed_rpm));
        let is_held = wanted.min(self.rpm_max) > most;
        if is_held && !self.is_held {
            self.held = Some(most / programmed_rpm);
        }
        self.is_held = is_held;
        wanted.min(most)
    }

    fn publish(&mut self, reversal: Option<f64>) {
        self.rpm = match self.wanted {
            None => 0.0,
            Some(wanted) => {
                // On the way back of a tap this much as fast.
                let scale = reversal.unwrap_or(1.0);
                let rpm = match wanted.surface {
                    None => self.overridden(scale * wanted.rpm),
                    // An override changes the speed of the surface; the highest speed stays.
                    Some(surface) => {
                        let programmed = surface.rpm(self.x_mm).min(RPM_FINITE);
                        self.overridden(scale * programmed).min(scale * wanted.rpm)
                    }
                };
                // What was programmed is within the highest speed; a quick way back, or an override, may not be.
                let rpm = rpm.min(self.rpm_max);
                match (wanted.direction, reversal) {
                    (SpindleDirection::Clockwise, None) | (SpindleDirection::Counterclockwise, Some(_)) => rpm,
                    (SpindleDirection::Counterclockwise, None) | (SpindleDirection::Clockwise, Some(_)) => -rpm,
                }
            }
        };
        let clockwise = self
            .wanted
            .map(|wanted| (wanted.direction == SpindleDirection::Clockwise) == reversal.is_none());
        self.on.set(clockwise.is_some());
        self.forward.set(clockwise == Some(true));
        self.reverse.set(clockwise == Some(false));
        self.speed_out.set(self.rpm);
    }

    /// Whether it has the speed that it is told: as the pin says, and the encoder, or else its drive, where there is one. RT.
    pub fn is_at_speed(&mut self) -> bool {
        let measured = self.measured_rpm();
        let off = measured.map_or(0.0, |measured| (measured - self.rpm).abs());
        let slack = SPEED_SLACK_RPM.max(self.rpm.abs() * self.tolerance);
        // A drive that is still on its way to its power has no speed of its own.
        let follows = self.axis.as_ref().is_none_or(SpindleDrive::is_enabled);
        let at_speed = self.wanted.is_none() || (self.at_speed.get() && follows && off <= slack);
        self.waited_s = if at_speed { 0.0 } else { self.waited_s + self.cycle_s };
        at_speed
    }

    /// Share of the planned feed of moves that go by its turns (G95): as it turns, or without an encoder as it is told to. A
    /// spindle that is faster than programmed is not followed. RT.
    pub fn feed_share(&mut self) -> f64 {
        let Some(wanted) = self.wanted else { return 0.0 };
        let rpm = self.measured_rpm().unwrap_or(self.rpm).abs();
        let share = if wanted.rpm > 0.0 {
            (rpm / wanted.rpm).min(1.0)
        } else {
            0.0
        };
        // The feed is not to tremble with the steps of the encoder.
        if (share - self.share).abs() > SHARE_STEP || share == 1.0 {
            self.share = share;
        }
        self.share
    }

    /// Whether its speed has been waited for too long. RT.
    pub fn late(&self) -> Option<SpeedNotReached> {
        (self.waited_s > self.timeout_s).then(|| SpeedNotReached {
            spindle: 0,
            wanted_rpm: self.rpm,
            measured_rpm: self.measured_rpm(),
        })
    }

    fn measured_rpm(&self) -> Option<f64> {
        match self.source {
            Source::None => self.axis.as_ref().map(SpindleDrive::measured_rpm),
            Source::Pins { .. } | Source::Counter { .. } => Some(self.turns_per_cycle / self.cycle_s * 60.0),
        }
    }

    /// Writes the object that sets its speed. RT.
    pub fn write(&self, outputs: &mut OutputImage) {
        if let Some(drive) = &self.drive {
            // Within the object's numbers: the speed is at most the highest one.
            let value = (self.rpm * drive.per_rpm).round() as i64;
            drive.speed.write(outputs.node_mut(drive.node), value as u64);
        }
    }
}

/// What M19 has come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Orienting {
    /// No M19 holds the spindle.
    Not,
    /// On its way to the angle.
    UnderWay,
    /// There, and held.
    Done,
}

/// M19: what turns the spindle to an angle is a component or the spindle's drive.
struct Orientation {
    orient: Output<bool>,
    angle: Output<f64>,
    mode: Output<i32>,
    is_oriented: Input<bool>,
    fault: Input<i32>,
    locked: Output<bool>,
    brake: Output<bool>,
    state: Orienting,
    timeout_s: f64,
    waited_s: f64,
}

impl Orientation {
    fn new(hal: &mut Hal) -> Result<Orientation, HalError> {
        Ok(Orientation {
            orient: hal.output("spindle.0.orient")?,
            angle: hal.output("spindle.0.orient-angle")?,
            mode: hal.output("spindle.0.orient-mode")?,
            is_oriented: hal.input("spindle.0.is-oriented", false)?,
            fault: hal.input("spindle.0.orient-fault", 0)?,
            locked: hal.output("spindle.0.locked")?,
            brake: hal.output("spindle.0.brake")?,
            state: Orienting::Not,
            timeout_s: f64::INFINITY,
            waited_s: 0.0,
        })
    }

    fn begin(&mut self, degrees: f64, direction: OrientDirection) {
        self.angle.set(degrees);
        self.mode.set(match direction {
            OrientDirection::Shortest => 0,
            OrientDirection::Clockwise => 1,
            OrientDirection::Counterclockwise => 2,
        });
        (self.timeout_s, self.waited_s) = (f64::INFINITY, 0.0);
        self.set(Orienting::UnderWay);
    }

    fn end(&mut self) {
        self.set(Orienting::Not);
    }

    fn set(&mut self, state: Orienting) {
        self.state = state;
        self.orient.set(state == Orienting::UnderWay);
        self.locked.set(state == Orienting::Done);
        self.brake.set(state == Orienting::Done);
    }

    /// Once in every cycle.
    fn look(&mut self) {
        if self.state == Orienting::UnderWay && self.is_oriented.get() && self.fault.get() == 0 {
            self.set(Orienting::Done);
        }
    }

    fn failure(&self) -> Option<OrientFailure> {
        if self.state != Orienting::UnderWay {
            return None;
        }
        match self.fault.get() {
            0 => (self.waited_s > self.timeout_s).then_some(OrientFailure::Late {
                degrees: self.angle.get(),
                timeout_s: self.timeout_s,
            }),
            code => Some(OrientFailure::Fault { code }),
        }
    }
}

/// A spindle beside the first: its pins. Components or its drive follow them.
pub struct OtherSpindle {
    number: u8,
    on: Output<bool>,
    forward: Output<bool>,
    reverse: Output<bool>,
    speed_out: SpeedOut,
    at_speed: Input<bool>,
    waits: bool,
    rpm_max: f64,
    cycle_s: f64,
    timeout_s: f64,
    waited_s: f64,
}

impl OtherSpindle {
    /// The spindle of a number, 1 or more.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config, number: u8) -> Result<OtherSpindle, HalError> {
        let name = |pin: &str| format!("spindle.{number}.{pin}");
        let spindle = &config.spindle;
        Ok(OtherSpindle {
            number,
            on: hal.output(&name("on"))?,
            forward: hal.output(&name("forward"))?,
            reverse: hal.output(&name("reverse"))?,
            speed_out: SpeedOut::new(hal, number)?,
            at_speed: hal.input(&name("at-speed"), true)?,
            waits: spindle.wait_for_speed,
            rpm_max: spindle.rpm_max,
            cycle_s: f64::from(config.cycle_us) * 1e-6,
            timeout_s: spindle.speed_timeout_s,
            waited_s: 0.0,
        })
    }

    /// Its speed, below 0 counter-clockwise; `None`: it is to stand. RT.
    pub fn turn(&mut self, rpm: Option<f64>) {
        let speed = rpm.unwrap_or(0.0).clamp(-self.rpm_max, self.rpm_max);
        self.on.set(rpm.is_some());
        self.forward.set(rpm.is_some_and(|rpm| !rpm.is_sign_negative()));
        self.reverse.set(rpm.is_some_and(f64::is_sign_negative));
        self.speed_out.set(speed);
        self.waited_s = 0.0;
    }

    /// Whether it has the speed that it is told, if that is to be waited for. RT.
    pub fn is_at_speed(&mut self) -> bool {
        let at_speed = !self.waits || !self.on.get() || self.at_speed.get();
        self.waited_s = if at_speed { 0.0 } else { self.waited_s + self.cycle_s };
        at_speed
    }

    /// Whether its speed has been waited for too long. RT.
    pub fn late(&self) -> Option<SpeedNotReached> {
        (self.waited_s > self.timeout_s).then(|| SpeedNotReached {
            spindle: self.number,
            wanted_rpm: self.speed_out.rpm.get(),
            measured_rpm: None,
        })
    }
}
