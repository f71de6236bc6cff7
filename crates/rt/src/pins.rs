//! The control's pins: what other components and other processes see of it, and what they may tell it.
//!
//! In:  values of a cycle; pins that others drive.
//! Out: shared memory; outputs of I/O nodes.
//!
//! Names are LinuxCNC's where LinuxCNC has one. [`Pins::new`] and the links are made at start-up; the rest is RT.

use super::components::{Lists, count_pins};
use super::drives::{Drives, is_filled};
use super::external::{self, ExternalPins};
use super::io_channels::{self, IoPins};
use super::io_pins::{InputPins, OutputPins};
use super::logic;
use super::loop_pins::LoopPins;
use super::override_pins::OverridePins;
use super::overrides::{Overridden, Overrides};
use super::recent::Second;
use super::spindle::{OtherSpindle, Spindle};
use super::step_pins::StepPins;
use super::steps::StepDrives;
use crate::cycle_stats::Timing;
use crate::desk::{DeskPins, SwitchPins};
use crate::jog_pins::JogPins;
use bus::layout::Field;
use bus::plan::NodePlan;
use bus::{BusState, CyclicBus, InputImage, OutputImage};
use cia402::profile::axis_of;
use config::{self, Config, ConfigErrors, Net, Profile};
use hal_pins::{CAPACITY_MAX, Hal, HalError, Input, Memory, Output};
use machine::faults::SpeedNotReached;
use machine::state::State;
use motion::canon::Axis;
use motion::element::{Action, Enables};
use motion::rt::{Sample, Shares};

/// Pins of the control that there is room for, beside those that the machine file asks for.
const CAPACITY: usize = 2048;

/// Pins and nets that there is to be room for.
pub fn capacity(config: &Config) -> usize {
    let declared =
        count_pins(config) + logic::count_pins(config) + external::count_pins(config) + io_channels::count_pins(config);
    (CAPACITY + declared + config.nets.len()).min(CAPACITY_MAX)
}

struct JointPins {
    motor_pos_cmd: Output<f64>,
    motor_pos_fb: Output<f64>,
    f_error: Output<f64>,
    homed: Output<bool>,
    amp_enabled: Output<bool>,
    home_switch: Input<bool>,
    /// Lower and upper.
    limit_switches: [Input<bool>; 2],
    homing: Output<bool>,
    hard_limits: [Output<bool>; 2],
}

/// A mapped object that a pin shows.
struct ObjectPin {
    node: usize,
    field: Field,
    value: ObjectValue,
}

/// What is left of a controlword that a pin has where no drive may be under power: quick stop, or no voltage.
const QUICK_STOP: u64 = 0x0002;

/// A mapped object that a pin sets: one that the control itself has no use for.
struct DrivenObject {
    node: usize,
    field: Field,
    pin: Input<i64>,
}

impl ObjectPin {
    fn show(&mut self, payload: &[u8]) {
        match &mut self.value {
            ObjectValue::Signed(pin) => pin.set(self.field.read_signed(payload)),
            ObjectValue::Unsigned(pin) => pin.set(self.field.read(payload)),
        }
    }
}

enum ObjectValue {
    Signed(Output<i64>),
    Unsigned(Output<u64>),
}

struct NodePins {
    state: Output<u32>,
    lost: Output<u64>,
}

/// All pins of the control.
pub struct Pins {
    memory: Memory,
    joints: Vec<JointPins>,
    axes: Vec<(Axis, Output<f64>)>,
    objects_received: Vec<ObjectPin>,
    objects_sent: Vec<ObjectPin>,
    objects_driven: Vec<DrivenObject>,
    /// Inputs and outputs of I/O nodes.
    pub io: IoPins,
    nodes: Vec<NodePins>,
    loops: Vec<LoopPins>,
    steps: StepPins,
    network_up: Output<bool>,

    machine_state: Output<u32>,
    fault: Output<bool>,
    program_line: Output<u32>,
    current_vel: Output<f64>,
    feed_hold: Input<bool>,
    adaptive_feed: Input<f64>,
    probe_input: Input<bool>,
    overrides: OverridePins,
    resume: Input<bool>,
    stop: Input<bool>,
    resume_before: bool,
    stop_before: bool,
    mains_ok: Input<bool>,
    /// M1 stops.
    pub optional_stop: SwitchPins,
    /// What the operator's loop keeps.
    pub desk: DeskPins,
    /// Wheels and keys.
    pub jog: JogPins,
    estop: EstopPins,
    /// An unwired net keeps the emergency stop chain open.
    held_open: bool,

    pub spindle: Spindle,
    /// Those beside the first.
    pub others: Vec<OtherSpindle>,
    /// Those of the machine file.
    pub components: Lists,
    /// Programs in Structured Text.
    pub logic: logic::Ports,
    /// Those of other processes.
    pub external: ExternalPins,
    /// Inputs for which programs wait.
    pub inputs: InputPins,
    /// Outputs that programs set.
    pub outputs: OutputPins,
    flood: Output<bool>,
    mist: Output<bool>,
    /// Pocket 0 of the tool changer is the spindle.
    random_changer: bool,
    tool_prepare: Output<bool>,
    tool_prep_number: Output<u32>,
    tool_prep_pocket: Output<i32>,
    tool_prepared: Input<bool>,
    tool_change: Output<bool>,
    tool_changed: Input<bool>,
    /// The change under way has been asked for.
    tool_change_asked: bool,

    timing: TimingPins,
}

/// What an input of the control is while nothing is wired to it that should be: a switch that is touched, mains that have failed.
/// `None` for the emergency stop chain, which `Pins` keeps open, and for inputs that stop nothing.
fn stopped_value(pin: &str) -> Option<bool> {
    let is_limit = pin.starts_with("joint.") && (pin.ends_with(".neg-lim-sw-in") || pin.ends_with(".pos-lim-sw-in"));
    let is_home = pin.starts_with("joint.") && pin.ends_with(".home-sw-in");
    match pin {
        "motion.probe-input" | "motion.feed-hold" => Some(true),
        "iocontrol.0.mains-ok" => Some(false),
        _ => (is_limit || is_home).then_some(true),
    }
}

/// Whether a machine must not move while nothing is wired to an input of the control.
pub fn must_be_wired(pin: &str) -> bool {
    pin == "iocontrol.0.emc-enable-in" || stopped_value(pin).is_some()
}

/// Gives the targets of a net without a source the values which stop. True where the chain has to be kept open instead: it hangs on
/// the net, or what hangs on it is not known, as behind a component.
fn stop_unwired(hal: &Hal, net: &Net) -> Result<bool, HalError> {
    let mut keeps_open = false;
    for target in &net.targets {
        match stopped_value(target) {
            Some(value) => hal.set(target, value)?,
            None => {
                hal.check_reader(&net.name, target)?;
                keeps_open = true;
            }
        }
    }
    Ok(keeps_open)
}

/// The emergency stop chain.
struct EstopPins {
    /// True: the chain is closed.
    enable_in: Input<bool>,
    /// False: software wants the chain open.
    user_enable_out: Output<bool>,
    /// A pulse at a reset, for a latch.
    user_request_enable: Output<bool>,
    activate: Input<bool>,
    reset: Input<bool>,
    is_activated: Output<bool>,
    machine_is_on: Output<bool>,
    activate_before: bool,
    reset_before: bool,
    /// Cycles that the pulse still lasts.
    pulse: u32,
}

/// How long a reset asks the latch of the chain to close, cycles.
const RESET_PULSE: u32 = 100;

impl EstopPins {
    fn new(hal: &mut Hal) -> Result<EstopPins, HalError> {
        Ok(EstopPins {
            enable_in: hal.input("iocontrol.0.emc-enable-in", true)?,
            user_enable_out: hal.output("iocontrol.0.user-enable-out")?,
            user_request_enable: hal.output("iocontrol.0.user-request-enable")?,
            activate: hal.input("halui.estop.activate", false)?,
            reset: hal.input("halui.estop.reset", false)?,
            is_activated: hal.output("halui.estop.is-activated")?,
            machine_is_on: hal.output("halui.machine.is-on")?,
            activate_before: false,
            reset_before: false,
            pulse: 0,
        })
    }

    /// RT.
    fn show(&mut self, state: State) {
        let is_estop = state == State::Estop;
        self.is_activated.set(is_estop);
        self.user_enable_out.set(!is_estop || self.pulse > 0);
        self.user_request_enable.set(self.pulse > 0);
        self.pulse = self.pulse.saturating_sub(1);
        let is_on = match state {
            State::Ready
            | State::Homing
            | State::Jogging
            | State::Running
            | State::Held
            | State::Away
            | State::Returning
            | State::Stopping => true,
            State::Booting
            | State::Disabled
            | State::Enabling
            | State::Disabling
            | State::Faulted
            | State::ShuttingDown
            | State::Down
            | State::Silenced
            | State::Estop => false,
        };
        self.machine_is_on.set(is_on);
    }
}

/// How the cycle keeps its time.
struct TimingPins {
    lateness_ns: Output<i64>,
    late_max_ns: Output<i64>,
    exchange_ns: Output<i64>,
    compute_ns: Output<i64>,
    free_ns: Output<i64>,
    cycles: Output<u64>,
    skipped: Output<u64>,
    pres_lost: Output<u64>,
    /// The last second: period, lateness, exchange, computing, free time.
    seconds: [SecondPins; 5],
}

/// One quantity over the last second.
struct SecondPins {
    mean_ns: Output<f64>,
    std_ns: Output<f64>,
    min_ns: Output<i64>,
    p99_ns: Output<i64>,
    max_ns: Output<i64>,
}

impl SecondPins {
    fn new(hal: &mut Hal, quantity: &str) -> Result<SecondPins, HalError> {
        let name = |figure: &str| format!("rt.{quantity}-{figure}-ns");
        Ok(SecondPins {
            mean_ns: hal.output(&name("mean"))?,
            std_ns: hal.output(&name("std"))?,
            min_ns: hal.output(&name("min"))?,
            p99_ns: hal.output(&name("p99"))?,
            max_ns: hal.output(&name("max"))?,
        })
    }

    /// RT.
    fn show(&mut self, second: &Second) {
        self.mean_ns.set(second.mean_ns);
        self.std_ns.set(second.std_ns);
        self.min_ns.set(second.min_ns as i64);
        self.p99_ns.set(second.p99_ns as i64);
        self.max_ns.set(second.max_ns as i64);
    }
}

impl TimingPins {
    fn new(hal: &mut Hal) -> Result<TimingPins, HalError> {
        Ok(TimingPins {
            lateness_ns: hal.output("rt.servo-jitter-ns")?,
            late_max_ns: hal.output("rt.servo-late-max-ns")?,
            exchange_ns: hal.output("rt.exchange-ns")?,
            compute_ns: hal.output("rt.compute-ns")?,
            free_ns: hal.output("rt.free-ns")?,
            cycles: hal.output("rt.cycles")?,
            skipped: hal.output("rt.cycles-skipped")?,
            pres_lost: hal.output("rt.pres-lost")?,
            seconds: [
                SecondPins::new(hal, "period")?,
                SecondPins::new(hal, "servo-jitter")?,
                SecondPins::new(hal, "exchange")?,
                SecondPins::new(hal, "compute")?,
                SecondPins::new(hal, "free")?,
            ],
        })
    }
}

/// Numbers of drives in the names of their pins: that of their joint; those without one follow, in the order of the machine file.
struct DriveNumbers {
    /// Nodes and axes.
    of: Vec<(usize, u8)>,
}

impl DriveNumbers {
    fn new(config: &Config, plans: &[NodePlan]) -> DriveNumbers {
        let mut of: Vec<_> = config
            .joints
            .iter()
            .map(|joint| (joint.node, joint.drive_axis))
            .collect();
        for (index, (node, plan)) in config.bus.nodes.iter().zip(plans).enumerate() {
            if node.profile != Profile::Cia402 {
                continue;
            }
            for field in plan.outputs.fields.iter().chain(&plan.inputs.fields) {
                let axis = (index, axis_of(field.object.index).0);
                if !of.contains(&axis) {
                    of.push(axis);
                }
            }
        }
        DriveNumbers { of }
    }

    /// Of the drive that an object of a node belongs to.
    fn number(&self, node: usize, field: Field) -> usize {
        let axis = (node, axis_of(field.object.index).0);
        self.of.iter().position(|other| *other == axis).unwrap_or(self.of.len())
    }
}

/// Name of the pin of a CiA 402 object; LinuxCNC drivers' names where there is one.
fn object_name(joint: usize, field: Field) -> String {
    let (_, index) = axis_of(field.object.index);
    let sub = field.object.sub;
    let name = match (index, sub) {
        (0x603F, 0) => "error-code",
        (0x6040, 0) => "controlword",
        (0x6041, 0) => "statusword",
        (0x6060, 0) => "opmode",
        (0x6061, 0) => "opmode-display",
        (0x6042, 0) => "vl-target-velocity",
        (0x6043, 0) => "vl-velocity-demand",
        (0x6044, 0) => "vl-actual-velocity",
        (0x6064, 0) => "drv-actual-position",
        (0x606C, 0) => "drv-actual-velocity",
        (0x6077, 0) => "drv-actual-torque",
        (0x6078, 0) => "drv-actual-current",
        (0x6079, 0) => "drv-dc-link-voltage",
        (0x6071, 0) => "drv-target-torque",
        (0x607A, 0) => "drv-target-position",
        (0x60FF, 0) => "drv-target-velocity",
        (0x60B1, 0) => "velocity-offset",
        (0x60B2, 0) => "torque-offset",
        (0x60F4, 0) => "drv-following-error",
        (0x60FD, 0) => "digital-inputs",
        (0x60FE, 1) => "digital-outputs",
        _ => return format!("cia402.{joint}.object-{index:04x}-{sub:02x}"),
    };
    format!("cia402.{joint}.{name}")
}

/// Whether the number in an object has a sign, for objects without which it would read wrong.
fn is_signed(index: u16) -> bool {
    matches!(
        axis_of(index).1,
        0x6042..=0x6044 | 0x6060..=0x6064 | 0x6069..=0x606C | 0x6071 | 0x6074 | 0x6077 | 0x6078 | 0x607A | 0x60B0..=0x60B2 | 0x60F4 | 0x60FA | 0x60FF
    )
}

/// Why the pins of a machine cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PinsError {
    /// The shared memory, or a pin of our own.
    #[error(transparent)]
    Hal(#[from] HalError),
    /// Nets and components of the machine file, at their places there.
    #[error("{0}")]
    Nets(ConfigErrors),
}

/// Pins of a component that cannot be had: at its place in the machine file.
fn refused(config: &Config, kind: &str, number: usize, error: &HalError) -> PinsError {
    PinsError::Nets(config::component_error(config, kind, number, error))
}

impl Pins {
    /// Makes all pins and links them as the machine file says.
    ///
    /// # Errors
    /// Shared memory too small; every net that names a pin that does not exist or is driven twice.
    pub fn new(hal: &mut Hal, config: &Config, plans: &[NodePlan], steps: &StepDrives) -> Result<Pins, PinsError> {
        let mut joints = Vec::new();
        for joint in 0..config.joints.len() {
            let name = |pin: &str| format!("joint.{joint}.{pin}");
            joints.push(JointPins {
                motor_pos_cmd: hal.output(&name("motor-pos-cmd"))?,
                motor_pos_fb: hal.output(&name("motor-pos-fb"))?,
                f_error: hal.output(&name("f-error"))?,
                homed: hal.output(&name("homed"))?,
                amp_enabled: hal.output(&name("amp-enabled"))?,
                home_switch: hal.input(&name("home-sw-in"), false)?,
                limit_switches: [
                    hal.input(&name("neg-lim-sw-in"), false)?,
                    hal.input(&name("pos-lim-sw-in"), false)?,
                ],
                homing: hal.output(&name("homing"))?,
                hard_limits: [
                    hal.output(&name("neg-hard-limit"))?,
                    hal.output(&name("pos-hard-limit"))?,
                ],
            });
        }
        let mut axes = Vec::new();
        for map in &config.axes {
            let letter = map.axis.letter().to_ascii_lowercase();
            axes.push((map.axis, hal.output(&format!("axis.{letter}.pos-cmd"))?));
        }
        let (mut objects_received, mut objects_sent, mut objects_driven) = (Vec::new(), Vec::new(), Vec::new());
        let mut nodes = Vec::new();
        let drives = DriveNumbers::new(config, plans);
        for (index, (node, plan)) in config.bus.nodes.iter().zip(plans).enumerate() {
            nodes.push(NodePins {
                state: hal.output(&format!("plk.{}.state", node.id))?,
                lost: hal.output(&format!("plk.{}.pres-lost", node.id))?,
            });
            if node.profile != Profile::Cia402 {
                continue;
            }
            for &field in &plan.inputs.fields {
                let number = drives.number(index, field);
                objects_received.push(object_pin(hal, number, index, field)?);
            }
            for &field in &plan.outputs.fields {
                let object = (field.object.index, field.object.sub);
                let number = drives.number(index, field);
                let joint = config.joints.get(number);
                let of_joint = joint.is_some_and(|joint| is_filled(joint, object));
                if of_joint || Spindle::fills(config, index, object) {
                    objects_sent.push(object_pin(hal, number, index, field)?);
                } else {
                    let pin = hal.input(&object_name(number, field), 0)?;
                    objects_driven.push(DrivenObject {
                        node: index,
                        field,
                        pin,
                    });
                }
            }
        }
        let with_loop = config.joints.iter().enumerate();
        let with_loop = with_loop.filter_map(|(joint, of_joint)| Some((joint, of_joint.pid.as_ref()?)));
        let loops = with_loop
            .map(|(joint, gains)| LoopPins::new(hal, joint, gains))
            .collect::<Result<_, _>>()?;
        let mut pins = Pins {
            joints,
            axes,
            objects_received,
            objects_sent,
            objects_driven,
            io: IoPins::new(hal, config, plans)?,
            nodes,
            loops,
            steps: StepPins::new(hal, config, steps)?,
            memory: hal.memory(),
            network_up: hal.output("plk.operational")?,
            machine_state: hal.output("motion.machine-state")?,
            fault: hal.output("motion.fault")?,
            program_line: hal.output("motion.program-line")?,
            current_vel: hal.output("motion.current-vel")?,
            feed_hold: hal.input("motion.feed-hold", false)?,
            adaptive_feed: hal.input("motion.adaptive-feed", 1.0)?,
            probe_input: hal.input("motion.probe-input", false)?,
            overrides: OverridePins::new(hal)?,
            resume: hal.input("halui.program.resume", false)?,
            stop: hal.input("halui.program.stop", false)?,
            resume_before: false,
            stop_before: false,
            mains_ok: hal.input("iocontrol.0.mains-ok", true)?,
            optional_stop: SwitchPins::new(hal, "halui.program.optional-stop")?,
            desk: DeskPins::new(hal)?,
            jog: JogPins::new(hal, config)?,
            estop: EstopPins::new(hal)?,
            held_open: false,
            spindle: Spindle::new(hal, config, plans)?,
            others: (1..config.spindle.count)
                .map(|number| OtherSpindle::new(hal, config, number))
                .collect::<Result<_, _>>()?,
            components: Lists::new(hal, config)
                .map_err(|(number, error)| refused(config, "component", number, &error))?,
            logic: logic::Ports::claim(hal, config)
                .map_err(|(number, error)| PinsError::Nets(config::logic_error(config, number, &error.to_string())))?,
            external: ExternalPins::new(hal, config)
                .map_err(|(number, error)| refused(config, "external", number, &error))?,
            inputs: InputPins::new(hal, config)?,
            outputs: OutputPins::new(hal, config)?,
            flood: hal.output("iocontrol.0.coolant-flood")?,
            mist: hal.output("iocontrol.0.coolant-mist")?,
            tool_prepare: hal.output("iocontrol.0.tool-prepare")?,
            tool_prep_number: hal.output("iocontrol.0.tool-prep-number")?,
            tool_prep_pocket: hal.output("iocontrol.0.tool-prep-pocket")?,
            // A changer that prepares nothing is always ready.
            random_changer: config.tools.changer == gcode::ToolChanger::Random,
            tool_prepared: hal.input("iocontrol.0.tool-prepared", true)?,
            tool_change: hal.output("iocontrol.0.tool-change")?,
            tool_changed: hal.input("iocontrol.0.tool-changed", false)?,
            tool_change_asked: false,
            timing: TimingPins::new(hal)?,
        };
        let mut refused = Vec::new();
        for (number, net) in config.nets.iter().enumerate() {
            let linked = match net.is_unwired() {
                true => stop_unwired(hal, net).map(|keeps_open| pins.held_open |= keeps_open),
                false => hal.link(&net.name, &net.source, &net.targets),
            };
            if let Err(error) = linked {
                refused.push((number, error));
            }
        }
        if !refused.is_empty() {
            return Err(PinsError::Nets(config::net_errors(config, &refused)));
        }
        pins.logic.bind(hal, config).map_err(PinsError::Nets)?;
        Ok(pins)
    }

    /// Gains of position loops as pins have them. RT.
    pub fn turn_loops(&self, drives: &mut Drives) {
        for pins in &self.loops {
            pins.turn(drives, || self.memory.is_lost());
        }
    }

    /// Whether the switch for feed hold is on.
    pub fn is_feed_hold(&self) -> bool {
        self.feed_hold.get()
    }

    /// Whether a switch keeps jogs from beginning.
    pub fn is_jog_barred(&self) -> bool {
        self.is_feed_hold() || self.jog.is_barred()
    }

    /// Shares of the planned speed for a program that runs.
    ///
    /// `motion.adaptive-feed` may change in every cycle, far too often to plan again each time: it scales time, which the
    /// interpolation does along a ramp within the stop limits, whatever comes how often. NaN holds the machine.
    pub fn shares(&self, overrides: &Overrides) -> Shares {
        let [feed, rapid] = overrides.of_time();
        // Not `clamp`, which lets NaN pass: any component may write this pin.
        #[allow(clippy::manual_clamp, reason = "max and min turn NaN into 0")]
        let adaptive = self.adaptive_feed.get().max(0.0).min(1.0);
        Shares {
            switch: if self.feed_hold.get() { 0.0 } else { 1.0 },
            feed,
            rapid,
            adaptive,
            ..Shares::FULL
        }
    }

    /// Takes in what pins want of the overrides; the spindle follows its own.
    pub fn follow_overrides(&mut self, overrides: &Overrides, enables: Enables) {
        self.overrides.update(overrides);
        let factor = if enables.spindle_override {
            overrides.share(Overridden::Spindle)
        } else {
            1.0
        };
        self.spindle.set_override(factor);
    }

    /// Whether the resume pin has risen since the last call.
    pub fn take_resume(&mut self) -> bool {
        let now = self.resume.get();
        let before = std::mem::replace(&mut self.resume_before, now);
        now && !before
    }

    /// Whether the file of the pins was cut short: values are lost.
    pub fn are_lost(&self) -> bool {
        self.memory.is_lost()
    }

    /// Whether an unwired net keeps the emergency stop chain open, whatever its pin says.
    pub fn is_held_open(&self) -> bool {
        self.held_open
    }

    /// Whether the pin of the emergency stop chain says that it is open.
    pub fn is_chain_open(&self) -> bool {
        !self.estop.enable_in.get()
    }

    /// Whether the pin that orders an emergency stop has risen since the last call, and the one that resets it.
    pub fn take_estop(&mut self) -> [bool; 2] {
        let pins = &mut self.estop;
        let now = [pins.activate.get(), pins.reset.get()];
        let before = [
            std::mem::replace(&mut pins.activate_before, now[0]),
            std::mem::replace(&mut pins.reset_before, now[1]),
        ];
        [0, 1].map(|pin| now[pin] && !before[pin])
    }

    /// Asks the latch of the chain to close.
    pub fn request_enable(&mut self) {
        self.estop.pulse = RESET_PULSE;
    }

    /// Asks no longer.
    pub fn forget_enable(&mut self) {
        self.estop.pulse = 0;
    }

    /// Whether the latch is still being asked.
    pub fn is_enable_requested(&self) -> bool {
        self.estop.pulse > 0
    }

    /// Joints whose lower, and whose upper limit switch is closed (bit n: joint n).
    pub fn limit_switches(&self) -> [u64; 2] {
        let mut closed = [0; 2];
        for (joint, pins) in self.joints.iter().enumerate() {
            for (closed, switch) in closed.iter_mut().zip(&pins.limit_switches) {
                *closed |= u64::from(switch.get()) << joint;
            }
        }
        closed
    }

    /// Whether the machine has its mains.
    pub fn is_mains_ok(&self) -> bool {
        self.mains_ok.get()
    }

    /// Whether the stop pin has risen since the last call.
    pub fn take_stop(&mut self) -> bool {
        let now = self.stop.get();
        let before = std::mem::replace(&mut self.stop_before, now);
        now && !before
    }

    /// Does what a block without motion asks for.
    pub fn begin_action(&mut self, action: Action) {
        match action {
            Action::SpindleOn {
                rpm,
                direction,
                surface,
            } => self.spindle.command(rpm, direction, surface),
            Action::SpindleOff => self.spindle.stop(),
            Action::OrientSpindle { degrees, direction } => self.spindle.orient(degrees, direction),
            Action::AwaitOriented { timeout_s } => self.spindle.await_oriented(timeout_s),
            Action::TurnSpindle { spindle, rpm } => {
                if let Some(other) = self.other(spindle) {
                    other.turn(rpm);
                }
            }
            Action::Mist(on) => self.mist.set(on),
            Action::Flood(on) => self.flood.set(on),
            Action::SetTool { tool } => self.desk.set_tool(tool),
            Action::ChangeTool { .. } => self.tool_change_asked = false,
            Action::SetDigital { index, on } => self.outputs.set_digital(index, on),
            Action::SetAnalog { index, value } => self.outputs.set_analog(index, value),
            Action::AwaitInput { input, mode, timeout_s } => self.inputs.await_input(input, mode, timeout_s),
            Action::ProgramEnd => self.all_off(),
            Action::SelectTool { .. }
            | Action::AwaitSpindle
            | Action::UserCode { .. }
            | Action::ProgramStop
            | Action::OptionalStop
            | Action::TextEnd
            | Action::Modes { .. }
            | Action::Message { .. } => {}
        }
    }

    /// Whether the program may go on behind an action.
    pub fn action_done(&mut self, action: Action) -> bool {
        match action {
            Action::ChangeTool { tool } => {
                // The magazine still turns.
                if self.tool_prepare.get() {
                    return false;
                }
                // A tool that is there is asked for by nobody; that there is none, somebody has to see.
                if !self.tool_change_asked && tool != 0 && self.desk.tool() == tool {
                    return true;
                }
                // `tool-changed` still up from the change before must not answer for this one: it has to fall first.
                if !self.tool_change_asked {
                    self.tool_change_asked = !self.tool_changed.get();
                    self.tool_change.set(self.tool_change_asked);
                    return false;
                }
                let done = self.tool_changed.get();
                if done {
                    // Whoever sees the request fall reads the new one.
                    self.desk.set_tool(tool);
                    self.tool_change.set(false);
                }
                done
            }
            Action::AwaitSpindle => self.spindle.is_at_speed(),
            Action::AwaitOriented { .. } => self.spindle.is_oriented(),
            Action::TurnSpindle { spindle, .. } => self.other(spindle).is_none_or(|other| other.is_at_speed()),
            // More of the plan says when.
            Action::UserCode { .. } => false,
            Action::AwaitInput { .. } => self.inputs.is_over(),
            // The operator says when.
            Action::ProgramStop => false,
            // The switch for optional stops is off.
            Action::OptionalStop => true,
            Action::SpindleOn { .. }
            | Action::SpindleOff
            | Action::OrientSpindle { .. }
            | Action::Mist(_)
            | Action::Flood(_)
            | Action::SelectTool { .. }
            | Action::SetTool { .. }
            | Action::SetDigital { .. }
            | Action::SetAnalog { .. }
            | Action::ProgramEnd
            | Action::TextEnd
            | Action::Modes { .. }
            | Action::Message { .. } => true,
        }
    }

    /// Asks the changer to have a tool ready, while the program goes on. `pocket`: where it is, as far as anybody knows.
    pub fn prepare_tool(&mut self, tool: u32, pocket: Option<u32>) {
        self.tool_prep_number.set(tool);
        self.tool_prep_pocket
            .set(pocket.and_then(|pocket| i32::try_from(pocket).ok()).unwrap_or(-1));
        // Where pocket 0 is the spindle, there is nothing to fetch.
        let is_there = self.random_changer && tool != 0 && self.desk.tool() == tool;
        self.tool_prepare.set(!is_there);
    }

    /// Once a cycle: the tool may be ready, so that the change can begin.
    pub fn see_prepared_tool(&mut self) {
        if self.tool_prepare.get() && self.tool_prepared.get() {
            self.tool_prepare.set(false);
        }
    }

    /// The operator says that the tool is changed.
    pub fn end_tool_change(&mut self) {
        self.tool_prepare.set(false);
        self.tool_change.set(false);
    }

    /// A spindle whose speed has been waited for too long.
    pub fn late(&self) -> Option<SpeedNotReached> {
        let others = || self.others.iter().find_map(OtherSpindle::late);
        self.spindle.late().or_else(others)
    }

    fn other(&mut self, spindle: u8) -> Option<&mut OtherSpindle> {
        self.others.get_mut(usize::from(spindle).checked_sub(1)?)
    }

    /// Spindles and coolant off. The outputs of programs keep what they have, as in LinuxCNC.
    pub fn all_off(&mut self) {
        self.spindle.stop();
        for other in &mut self.others {
            other.turn(None);
        }
        self.mist.set(false);
        self.flood.set(false);
        self.tool_prepare.set(false);
        self.tool_change.set(false);
    }

    /// Copies pins into the payloads, as far as the control does not fill them itself, and shows what it sends.
    /// `commanded`: drives may be under power; a drive without a joint whose controlword is a pin is else told to stop.
    pub fn write_outputs(&mut self, commanded: bool, outputs: &mut OutputImage) {
        for object in &self.objects_driven {
            let value = object.pin.get() as u64;
            let value = match commanded || object.field.object.index != 0x6040 {
                true => value,
                false => value & QUICK_STOP,
            };
            object.field.write(outputs.node_mut(object.node), value);
        }
        for object in &mut self.objects_sent {
            object.show(outputs.node(object.node));
        }
        self.io.write(outputs);
        self.spindle.write(outputs);
    }

    /// Shows whether a fault has stopped the machine and is not acknowledged.
    pub fn show_fault(&mut self, is_fault: bool) {
        self.fault.set(is_fault);
    }

    /// Shows joints with step pulses.
    pub fn show_steps(&mut self, drives: &StepDrives) {
        self.steps.show(drives);
    }

    /// Shows how the last cycle kept its time.
    pub fn show_timing(&mut self, timing: &Timing) {
        let pins = &mut self.timing;
        pins.lateness_ns.set(timing.lateness_ns as i64);
        pins.late_max_ns.set(timing.late_max_ns as i64);
        pins.exchange_ns.set(timing.exchange_ns as i64);
        pins.compute_ns.set(timing.compute_ns as i64);
        pins.free_ns.set(timing.free_ns as i64);
        pins.cycles.set(timing.cycles);
        pins.skipped.set(timing.skipped);
        pins.pres_lost.set(timing.pres_lost);
        let second = &timing.second;
        let seconds = [
            &second.period,
            &second.lateness,
            &second.exchange,
            &second.compute,
            &second.free,
        ];
        for (pins, second) in pins.seconds.iter_mut().zip(seconds) {
            pins.show(second);
        }
    }

    /// Shows what the nodes sent, so that what follows in this cycle sees it behind every net.
    pub fn show_inputs(&mut self, inputs: &InputImage) {
        for object in &mut self.objects_received {
            object.show(inputs.payload.node(object.node));
        }
        self.io.show(inputs);
    }

    /// Whether the home switch of a joint is closed, as its pin has it.
    pub fn home_switch(&self, joint: usize) -> bool {
        self.joints.get(joint).is_some_and(|pins| pins.home_switch.get())
    }

    /// Whether the probe is in contact.
    pub fn probe_input(&self) -> bool {
        self.probe_input.get()
    }

    /// Shows the values of a cycle.
    pub fn publish(&mut self, bus: &mut dyn CyclicBus, drives: &Drives, sample: &Sample, state: State) {
        for (pins, drive) in self.joints.iter_mut().zip(drives.iter()) {
            pins.motor_pos_cmd.set(drive.command_mm());
            pins.motor_pos_fb.set(drive.actual_mm());
            pins.f_error.set(drive.following_error_mm());
            pins.homed.set(drive.is_homed());
            pins.amp_enabled.set(drive.status() == cia402::axis::Status::Enabled);
            pins.homing.set(drive.status() == cia402::axis::Status::Homing);
            let by_drive = drive.limit_switches();
            for ((shown, switch), by_drive) in pins.hard_limits.iter_mut().zip(&pins.limit_switches).zip(by_drive) {
                shown.set(switch.get() || by_drive);
            }
        }
        for pins in &mut self.loops {
            pins.show(drives);
        }
        for (axis, pos_cmd) in &mut self.axes {
            pos_cmd.set(sample.position[*axis]);
        }
        for (node, pins) in self.nodes.iter_mut().enumerate() {
            pins.state.set(bus.node_state(node) as u32);
            pins.lost.set(bus.statistics(node).lost);
        }
        self.network_up.set(bus.state() == BusState::Operational);
        self.machine_state.set(state as u32);
        self.estop.show(state);
        self.program_line.set(sample.line);
        self.current_vel.set(sample.velocity_mm_s);
    }
}

fn object_pin(hal: &mut Hal, joint: usize, node: usize, field: Field) -> Result<ObjectPin, HalError> {
    let name = object_name(joint, field);
    let value = if is_signed(field.object.index) {
        ObjectValue::Signed(hal.output(&name)?)
    } else {
        ObjectValue::Unsigned(hal.output(&name)?)
    };
    Ok(ObjectPin { node, field, value })
}
