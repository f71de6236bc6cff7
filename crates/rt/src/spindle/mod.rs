//! The spindle: what it is told, and what its encoder says.
//!
//! In:  actions of the program, samples of the interpolation, the inputs of the nodes, pins.
//! Out: pins, the object that sets its speed; its place and speed for the interpolation.
//!
//! `Spindle::new` is made at start-up; the rest is RT.

mod drive;
mod feedback;
mod orientation;
mod others;

pub use others::Spindles;

use bus::layout::Field;
use bus::plan::NodePlan;
use bus::{InputImage, NodeIndex, NodeState, OutputImage};
use cia402::axis::{AxisFault, Request};
use config::{Config, SpindleEncoder};
use drive::SpindleDrive;
use feedback::{Feedback, Source};
use hal_pins::{Hal, HalError, Input, Output};
use machine::faults::{OrientFailure, SpeedNotReached};
use motion::canon::{Axis, OrientDirection, SpindleDirection};
use motion::element::Surface;
use motion::rt::{Sample, SpindleFeedback};
use orientation::Orientation;

/// Distance from the wanted speed that no encoder is fine enough to judge, 1/min.
const SPEED_SLACK_RPM: f64 = 5.0;
/// More than any spindle turns, 1/min: what stands for the speed at the centre, where none is enough.
const RPM_FINITE: f64 = 1e9;
/// Part of the speed that the axes can follow in a move in step with the spindle to which its override may raise it: the rest is
/// for what the spindle itself is faster.
const FOLLOWED: f64 = 0.99;
/// A change of the share of the feed that is not worth following.
const SHARE_STEP: f64 = 0.003;

/// What it is told: M3, M4, S.
#[derive(Clone, Copy, Debug)]
pub struct Commanded {
    /// As programmed; with a speed of the surface, the most.
    rpm: f64,
    direction: SpindleDirection,
    surface: Option<Surface>,
}

/// The object that sets the speed.
struct SpeedObject {
    node: NodeIndex,
    speed: Field,
    /// Value at one turn a minute.
    per_rpm: f64,
}

impl SpeedObject {
    /// `None`: the machine file has none.
    fn new(config: &Config, plans: &[NodePlan]) -> Option<SpeedObject> {
        let drive = config.spindle.drive?;
        let outputs = &plans.get(drive.node)?.outputs;
        let greatest = (1_u64 << (drive.speed.bits - 1)) - 1;
        Some(SpeedObject {
            node: drive.node,
            speed: outputs.find(drive.speed.index, drive.speed.sub)?,
            per_rpm: greatest as f64 / config.spindle.rpm_max,
        })
    }
}

/// What a spindle is told: whether and which way it turns, and its speed, as drives of spindles may ask for it.
struct TurnPins {
    on: Output<bool>,
    forward: Output<bool>,
    reverse: Output<bool>,
    rpm: Output<f64>,
    rpm_abs: Output<f64>,
    rps: Output<f64>,
    rps_abs: Output<f64>,
}

impl TurnPins {
    fn new(hal: &mut Hal, spindle: u8) -> Result<TurnPins, HalError> {
        let name = |pin: &str| format!("spindle.{spindle}.{pin}");
        Ok(TurnPins {
            on: hal.output(&name("on"))?,
            forward: hal.output(&name("forward"))?,
            reverse: hal.output(&name("reverse"))?,
            rpm: hal.output(&name("speed-out"))?,
            rpm_abs: hal.output(&name("speed-out-abs"))?,
            rps: hal.output(&name("speed-out-rps"))?,
            rps_abs: hal.output(&name("speed-out-rps-abs"))?,
        })
    }

    /// `forward`: which way it turns; `None`: it is to stand. RT.
    fn show(&mut self, forward: Option<bool>, rpm: f64) {
        self.on.set(forward.is_some());
        self.forward.set(forward == Some(true));
        self.reverse.set(forward == Some(false));
        self.rpm.set(rpm);
        self.rpm_abs.set(rpm.abs());
        self.rps.set(rpm / 60.0);
        self.rps_abs.set(rpm.abs() / 60.0);
    }

    fn is_on(&self) -> bool {
        self.on.get()
    }

    fn rpm(&self) -> f64 {
        self.rpm.get()
    }
}

/// The operator's override of the speed.
#[derive(Default)]
struct Override {
    share: f64,
    /// Greatest speed in a move in step with the spindle that is under way, 1/min.
    followed_rpm: Option<f64>,
    /// Share to which this holds an override that is greater, until it is taken, and whether it was told.
    held: Option<f64>,
    is_held: bool,
}

impl Override {
    /// The speed under it, of which the axes may allow less; what is programmed has been looked at by the planner.
    fn speed(&mut self, programmed_rpm: f64, rpm_max: f64) -> f64 {
        let wanted = self.share * programmed_rpm;
        let most = self.followed_rpm.map_or(f64::INFINITY, |most| most.max(programmed_rpm));
        let is_held = wanted.min(rpm_max) > most;
        if is_held && !self.is_held {
            self.held = Some(most / programmed_rpm);
        }
        self.is_held = is_held;
        wanted.min(most)
    }
}

/// The spindle of the machine.
pub struct Spindle {
    pins: TurnPins,
    feedback: Feedback,
    at_speed: Input<bool>,
    orientation: Orientation,
    speed_object: Option<SpeedObject>,
    drive: Option<SpindleDrive>,
    cycle_s: f64,
    rpm_max: f64,
    tolerance: f64,
    timeout_s: f64,
    wanted: Option<Commanded>,
    overridden: Override,
    /// What it is told now, 1/min, above 0 with M3.
    rpm: f64,
    waited_s: f64,
    /// Share of the planned feed by turns that is wanted.
    share: f64,
    /// X of the last sample, machine.
    x_mm: f64,
}

impl Spindle {
    /// The spindle of the machine file.
    fn new(hal: &mut Hal, config: &Config, plans: &[NodePlan]) -> Result<Spindle, HalError> {
        let spindle = &config.spindle;
        let source = Source::new(hal, config, plans)?;
        Ok(Spindle {
            pins: TurnPins::new(hal, 0)?,
            feedback: Feedback::new(hal, config, source)?,
            at_speed: hal.input("spindle.0.at-speed", true)?,
            orientation: Orientation::new(hal)?,
            speed_object: SpeedObject::new(config, plans),
            drive: SpindleDrive::new(config, plans),
            cycle_s: f64::from(config.cycle_us) * 1e-6,
            rpm_max: spindle.rpm_max,
            tolerance: spindle.speed_tolerance,
            timeout_s: spindle.speed_timeout_s,
            wanted: None,
            overridden: Override {
                share: 1.0,
                ..Override::default()
            },
            rpm: 0.0,
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
        if let Some(drive) = &mut self.drive {
            drive.read(inputs, state);
        }
    }

    /// Leads that drive; `may_turn`: the machine is on. RT.
    pub fn lead_drive(&mut self, now_ns: u64, may_turn: bool, outputs: &mut OutputImage) {
        if let Some(drive) = &mut self.drive {
            let rpm = self.wanted.filter(|_| may_turn).map(|_| self.rpm);
            drive.lead(now_ns, rpm, outputs);
        }
    }

    /// Asks that drive for something. RT.
    pub fn request(&mut self, request: Request) {
        if let Some(drive) = &mut self.drive {
            drive.request(request);
        }
    }

    /// What is wrong with that drive. RT.
    pub fn drive_fault(&self) -> Option<AxisFault> {
        self.drive.as_ref()?.fault()
    }

    /// Whether that drive is off, if there is one. RT.
    pub fn is_drive_off(&self) -> bool {
        self.drive.as_ref().is_none_or(SpindleDrive::is_off)
    }

    /// Looks at the encoder, and whether the spindle is at the angle of an M19. RT.
    pub fn update_feedback(&mut self, inputs: &InputImage) {
        self.orientation.look();
        self.feedback.update(inputs, self.drive.as_ref());
    }

    /// Counts by which its encoder was off at the last index: some were lost, or some that are none were counted. In a move in step
    /// with it (`in_step`) they are told as they are; else turns count from that index from now on, and it is told now and then.
    /// RT.
    pub fn take_slip(&mut self, in_step: bool) -> Option<i64> {
        self.feedback.take_slip(in_step)
    }

    /// Where it will be when the axes are where this cycle's set-points bring them. RT.
    pub fn place(&self) -> SpindleFeedback {
        self.feedback.place()
    }

    /// M3, M4, S. RT.
    pub fn command(&mut self, rpm: f64, direction: SpindleDirection, surface: Option<Surface>) {
        self.orientation.end();
        self.wanted = Some(Commanded {
            rpm,
            direction,
            surface,
        });
        self.waited_s = 0.0;
        self.publish(None);
    }

    /// By hand: at this speed, 1/min, clockwise above 0; 0: it stops. RT.
    pub fn turn(&mut self, rpm: f64) {
        match rpm {
            0.0 => self.stop(),
            _ if rpm > 0.0 => self.command(rpm, SpindleDirection::Clockwise, None),
            _ => self.command(-rpm, SpindleDirection::Counterclockwise, None),
        }
    }

    /// What it is told; `None`: to stand. RT.
    pub fn commanded(&self) -> Option<Commanded> {
        self.wanted
    }

    /// It is told again what it was told before. RT.
    pub fn restore(&mut self, commanded: Option<Commanded>) {
        match commanded {
            Some(Commanded {
                rpm,
                direction,
                surface,
            }) => self.command(rpm, direction, surface),
            None => self.stop(),
        }
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
        self.orientation.begin_wait(timeout_s.unwrap_or(self.timeout_s));
    }

    /// Whether the spindle is where M19 has sent it. RT.
    pub fn is_oriented(&mut self) -> bool {
        self.orientation.is_over(self.cycle_s)
    }

    /// Why the angle of an M19 is not reached. RT.
    pub fn orient_failure(&self) -> Option<OrientFailure> {
        self.orientation.failure()
    }

    /// From the next [`Spindle::steer`] on, this share of the programmed speed. RT.
    pub fn set_override(&mut self, share: f64) {
        self.overridden.share = share;
    }

    /// Tells it its direction and speed of this cycle. RT.
    pub fn steer(&mut self, sample: &Sample) {
        self.x_mm = sample.position[Axis::X];
        self.overridden.followed_rpm = sample.turns_s_max.map(|turns_s| FOLLOWED * turns_s * 60.0);
        self.publish(sample.reversal);
    }

    /// The share to which a move in step with the spindle holds a greater override; told once each time. RT.
    pub fn take_held(&mut self) -> Option<f64> {
        self.overridden.held.take()
    }

    fn publish(&mut self, reversal: Option<f64>) {
        self.rpm = match self.wanted {
            None => 0.0,
            Some(wanted) => {
                let mut overridden = |programmed_rpm| self.overridden.speed(programmed_rpm, self.rpm_max);
                // On the way back of a tap this much as fast.
                let scale = reversal.unwrap_or(1.0);
                let rpm = match wanted.surface {
                    None => overridden(scale * wanted.rpm),
                    // An override changes the speed of the surface; the highest speed stays.
                    Some(surface) => {
                        let programmed = surface.rpm(self.x_mm).min(RPM_FINITE);
                        overridden(scale * programmed).min(scale * wanted.rpm)
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
        self.pins.show(clockwise, self.rpm);
    }

    /// Whether it has the speed that it is told: as the pin says, and the encoder, or else its drive, where there is one. RT.
    pub fn is_at_speed(&mut self) -> bool {
        let measured = self.measured_rpm();
        let off = measured.map_or(0.0, |measured| (measured - self.rpm).abs());
        let slack = SPEED_SLACK_RPM.max(self.rpm.abs() * self.tolerance);
        // A drive that is still on its way to its power has no speed of its own.
        let follows = self.drive.as_ref().is_none_or(SpindleDrive::is_enabled);
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

    /// By its encoder, or else by its drive, where there is one.
    fn measured_rpm(&self) -> Option<f64> {
        let by_drive = || self.drive.as_ref().map(SpindleDrive::measured_rpm);
        self.feedback.rpm().or_else(by_drive)
    }

    /// Writes the object that sets its speed. RT.
    pub fn write(&self, outputs: &mut OutputImage) {
        if let Some(object) = &self.speed_object {
            // Within the object's numbers: the speed is at most the highest one.
            let value = (self.rpm * object.per_rpm).round() as i64;
            object.speed.write(outputs.node_mut(object.node), value as u64);
        }
    }
}
