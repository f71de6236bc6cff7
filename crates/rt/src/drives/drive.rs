//! One joint and its drive: what the drive sent, and what it is told.
//!
//! In:  its payload; the commanded position of the joint, mm. Out: the actual position, mm; its payload. RT but [`Drive::new`].

use super::touch::Probes;
use super::{is_filled, is_off};
use crate::homing::Found;
use crate::shared::JointTrace;
use bus::layout::{Field, Layout};
use bus::plan::NodePlan;
use bus::{InputImage, NodeIndex, NodeState, OutputImage};
use cia402::axis::{Axis, AxisConfig, Feedback, HomingState, Setpoint, Status, Target};
use cia402::profile::object_of;
use config::{Compensation, DriveMode, HomingBy, Joint, Sto, Switches, targets};
use motion::rt::{JointCompensation, Pid};

/// Objects of one drive in its payloads; those that are not mapped are `None`.
#[derive(Clone, Copy, Debug)]
struct Fields {
    controlword: Field,
    /// Of the mode in which the drive is run.
    target: Field,
    /// 60B1, as far as the control fills it.
    velocity_offset: Option<Field>,
    /// 60B2, as far as the control fills it.
    torque_offset: Option<Field>,
    mode: Option<Field>,
    statusword: Field,
    position: Field,
    following_error: Option<Field>,
    torque: Option<Field>,
    mode_display: Option<Field>,
    digital_inputs: Option<Field>,
    error_code: Option<Field>,
}

impl Fields {
    /// `None` if an object without which no drive can be run is not mapped.
    fn new(joint: &Joint, outputs: &Layout, inputs: &Layout) -> Option<Fields> {
        let find = |payload: &Layout, index, sub| payload.find(object_of(joint.drive_axis, index), sub);
        let filled = |index| {
            let field = find(outputs, index, 0);
            field.filter(|field| is_filled(joint, (field.object.index, 0)))
        };
        Some(Fields {
            controlword: find(outputs, 0x6040, 0)?,
            target: targets(joint.mode)
                .iter()
                .find_map(|(index, sub)| find(outputs, *index, *sub))?,
            velocity_offset: filled(0x60B1),
            torque_offset: filled(0x60B2),
            mode: find(outputs, 0x6060, 0),
            statusword: find(inputs, 0x6041, 0)?,
            position: find(inputs, 0x6064, 0)?,
            following_error: find(inputs, 0x60F4, 0),
            torque: find(inputs, 0x6077, 0),
            mode_display: find(inputs, 0x6061, 0),
            digital_inputs: find(inputs, 0x60FD, 0),
            error_code: find(inputs, 0x603F, 0),
        })
    }
}

/// What a loop of the control finds for a drive that holds no position itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Of the motor; of a drive in CSV.
    pub velocity_mm_s: f64,
    /// As a share of the rated torque: of a drive in CST.
    pub torque: f64,
}

/// What set-points take of speed and torque, for a drive that holds its position itself.
#[derive(Debug)]
struct FeedForward {
    increments_per_mm: f64,
    /// 60B2 for an acceleration of one increment/s², as a share of the rated torque.
    torque_per_increment: f64,
    cycle_s: f64,
    /// Place and speed of the set-point before, increments and increments/s; `None`: the drive did not follow.
    before: Option<[f64; 2]>,
}

impl FeedForward {
    /// The mean speed of the cycle, and its change from that of the cycle before. RT.
    fn step(&mut self, increments: f64) -> Effort {
        let velocity = self
            .before
            .map_or(0.0, |[before, _]| (increments - before) / self.cycle_s);
        let change = self.before.map_or(0.0, |[_, before]| velocity - before);
        self.before = Some([increments, velocity]);
        Effort {
            velocity_mm_s: velocity / self.increments_per_mm,
            torque: change / self.cycle_s * self.torque_per_increment,
        }
    }

    /// The drive does not follow. RT.
    fn restart(&mut self) {
        self.before = None;
    }
}

/// Where a drive counts 0, and whether that is where it was homed.
#[derive(Debug)]
struct Home {
    /// Position at which the drive counts 0.
    zero_mm: f64,
    /// `None`: the drive homes itself; else whether the control has homed it since it came on line.
    by_control: Option<bool>,
    /// It is to be homed again whenever it has been off.
    volatile: bool,
}

impl Home {
    fn new(joint: &Joint) -> Home {
        let [counts, units] = joint.counts_per_unit.map(f64::from);
        let (zero_mm, by_control) = match joint.homing.by {
            HomingBy::Drive { .. } => {
                let home_mm = joint.home_count as f64 * units / counts;
                (joint.homing.position_mm - home_mm, None)
            }
            HomingBy::Control(_) => (0.0, Some(false)),
        };
        Home {
            zero_mm,
            by_control,
            volatile: joint.homing.volatile,
        }
    }
}

/// One joint and the drive that moves it.
#[derive(Debug)]
pub struct Drive {
    pub(super) node: NodeIndex,
    fields: Fields,
    mode: DriveMode,
    increments_per_mm: f64,
    /// 60FF for 1 mm/s.
    pub(super) velocity_per_mm_s: f64,
    feed_forward: FeedForward,
    /// Of a drive that holds no position itself.
    pub(super) pid: Option<Pid>,
    /// For the next set-point.
    pub(super) effort: Effort,
    /// Whether an answer has come in this cycle.
    fresh: bool,
    /// Torque that it told of last, 1/1000 of the rated one; NaN: it does not.
    torque: f64,
    home: Home,
    following_error_max_mm: f64,
    /// Supervisor of the power state machine.
    pub(super) axis: Axis,
    feedback: Feedback,
    setpoint: Setpoint,
    online: bool,
    switches: Switches,
    sto: Option<(Field, Sto)>,
    /// What it sent last says that its safety circuit is open.
    sto_open: bool,
    pub(super) probes: Probes,
    command_mm: f64,
    command_before_mm: f64,
    compensation: Option<JointCompensation>,
}

impl Drive {
    /// `None` if the payloads lack an object that every drive needs.
    pub fn new(joint: &Joint, plan: &NodePlan, cycle_s: f64) -> Option<Drive> {
        let [counts, units] = joint.counts_per_unit.map(f64::from);
        let [above, below] = joint.velocity_ratio.map(f64::from);
        Some(Drive {
            node: joint.node,
            fields: Fields::new(joint, &plan.outputs, &plan.inputs)?,
            mode: joint.mode,
            increments_per_mm: counts / units,
            velocity_per_mm_s: counts / units * above / below,
            feed_forward: FeedForward {
                increments_per_mm: counts / units,
                torque_per_increment: joint.torque_per_mm_s2.unwrap_or(0.0) / 1000.0 * units / counts,
                cycle_s,
                before: None,
            },
            pid: joint.pid.map(|gains| Pid::new(gains, cycle_s)),
            effort: Effort::default(),
            fresh: false,
            torque: f64::NAN,
            home: Home::new(joint),
            following_error_max_mm: joint.following_error_mm,
            axis: Axis::new(AxisConfig {
                mode: joint.mode,
                ..AxisConfig::default()
            }),
            feedback: Feedback::default(),
            setpoint: Setpoint::default(),
            online: false,
            switches: joint.switches,
            sto: joint.sto.and_then(|sto| {
                let (index, sub) = sto.object;
                Some((plan.inputs.find(index, sub)?, sto))
            }),
            sto_open: false,
            probes: Probes::new(joint, plan),
            command_mm: 0.0,
            command_before_mm: 0.0,
            compensation: joint.compensation.as_ref().map(|compensation| {
                let Compensation {
                    backlash_mm,
                    table,
                    take_up,
                } = compensation;
                JointCompensation::new(table.clone(), *backlash_mm, *take_up, cycle_s)
            }),
        })
    }

    /// Takes what the drive sent. RT.
    pub(super) fn read(&mut self, inputs: &InputImage, state: NodeState) {
        self.online = state == NodeState::Operational;
        if !self.online {
            // It may have been switched off meanwhile, and then counts again.
            self.forget_home();
        }
        self.probes.begin_cycle();
        self.fresh = inputs.fresh[self.node];
        if !self.fresh {
            return;
        }
        let payload = inputs.payload.node(self.node);
        let read = |field: Option<Field>| field.map_or(0, |field| field.read_signed(payload));
        self.feedback = Feedback {
            statusword: self.fields.statusword.read(payload) as u16,
            position: self.fields.position.read_signed(payload) as i32,
            following_error: read(self.fields.following_error) as i32,
            // A drive that does not say its mode is taken to follow the wish.
            mode_display: self
                .fields
                .mode_display
                .map_or(self.setpoint.mode, |field| field.read_signed(payload) as i8),
            digital_inputs: read(self.fields.digital_inputs) as u32,
            error_code: read(self.fields.error_code) as u16,
        };
        if let Some(field) = self.fields.torque {
            self.torque = field.read_signed(payload) as f64;
        }
        self.probes.watch(payload);
        self.sto_open = self
            .sto
            .is_some_and(|(field, sto)| (field.read(payload) >> sto.bit & 1 == 1) == sto.active);
    }

    fn forget_home(&mut self) {
        self.axis.forget_home();
        self.home.by_control = self.home.by_control.map(|_| false);
    }

    /// Homing by the control begins: the motor stays where it is, and follows without compensation. RT.
    pub(super) fn begin_homing(&mut self) {
        self.forget_home();
        if let Some(compensation) = &mut self.compensation {
            self.home.zero_mm -= compensation.correction_mm();
            compensation.restart();
        }
    }

    /// Homing by the control is done: positions count again, the motor stays where it is. RT.
    pub(super) fn home_at(&mut self, found: &Found) {
        self.home.by_control = Some(true);
        // The motor stood beside the joint by this when the switch closed.
        let beside_mm = self.compensation.as_ref().map_or(0.0, |compensation| {
            compensation.correction_at_mm(found.switch_mm, found.forward)
        });
        self.home.zero_mm += found.offset_mm + beside_mm;
        // Whole increments, so that rounding does not move the motor either.
        self.command_mm = self.to_mm(self.axis.target_position());
        self.command_before_mm = self.command_mm;
    }

    /// The drive still counts from where it was homed in an earlier session: `zero_mm` is the position at which it counts 0. RT.
    pub(super) fn take_home(&mut self, zero_mm: f64) {
        self.home.zero_mm = zero_mm;
        match &mut self.home.by_control {
            None => self.axis.take_for_homed(),
            Some(homed) => *homed = self.online,
        }
    }

    /// Tells the drive where to be; a drive that is not enabled is kept where it is, so that enabling never jumps. RT.
    pub(super) fn write(&mut self, now_ns: u64, command_mm: f64, outputs: &mut OutputImage) {
        let motor_mm = self.compensated(command_mm);
        let increments = (motor_mm - self.home.zero_mm) * self.increments_per_mm;
        let effort = match self.mode.is_position() {
            true => self.feed_forward.step(increments),
            false => {
                self.close_loop(motor_mm);
                // What is not found anew in a cycle is 0.
                std::mem::take(&mut self.effort)
            }
        };
        let target = Target {
            position: increments.round() as i64,
            velocity: (effort.velocity_mm_s * self.velocity_per_mm_s).round() as i32,
            torque: (effort.torque * 1000.0).round() as i16,
        };
        self.setpoint = self.axis.cycle(now_ns, self.online, &self.feedback, target);
        if self.home.volatile && self.is_off() {
            self.forget_home();
        }
        self.command_before_mm = self.command_mm;
        let following = self.axis.status() == Status::Enabled;
        if !following {
            self.feed_forward.restart();
        }
        self.command_mm = if following {
            command_mm
        } else {
            self.to_mm(self.axis.target_position())
        };

        let payload = outputs.node_mut(self.node);
        self.fields
            .controlword
            .write(payload, u64::from(self.setpoint.controlword));
        let target = match self.mode {
            DriveMode::Csp | DriveMode::Ip | DriveMode::Pp => self.setpoint.target_position as u64,
            DriveMode::Csv | DriveMode::Pv | DriveMode::Vl => self.setpoint.target_velocity as u64,
            DriveMode::Cst | DriveMode::Tq => self.setpoint.target_torque as u64,
        };
        self.fields.target.write(payload, target);
        if let Some(offset) = self.fields.velocity_offset {
            offset.write(payload, self.setpoint.velocity_offset as u64);
        }
        if let Some(offset) = self.fields.torque_offset {
            offset.write(payload, self.setpoint.torque_offset as u64);
        }
        self.probes.write(payload);
        if let Some(mode) = self.fields.mode {
            mode.write(payload, self.setpoint.mode as u64);
        }
    }

    /// One period of the position loop, with the motor to be at `motor_mm`. It begins anew when the drive is enabled. RT.
    fn close_loop(&mut self, motor_mm: f64) {
        let Some(pid) = &mut self.pid else { return };
        let place_mm = |increments: i64| increments as f64 / self.increments_per_mm;
        if !self.online || self.axis.status() != Status::Enabled {
            pid.restart(place_mm(self.axis.actual_position()));
            return;
        }
        let command_mm = motor_mm - self.home.zero_mm;
        let output = match self.fresh {
            true => pid.step(command_mm, place_mm(self.axis.position_in(&self.feedback))),
            false => pid.step_blind(command_mm),
        };
        match self.mode {
            DriveMode::Csv => self.effort.velocity_mm_s = output,
            DriveMode::Cst => self.effort.torque = output,
            _ => {}
        }
    }

    /// The position loop that the control closes for it, if it does.
    pub fn position_loop(&self) -> Option<&Pid> {
        self.pid.as_ref()
    }

    /// Position of the motor for that of the joint. A motor that does not follow keeps its compensation. RT.
    fn compensated(&mut self, command_mm: f64) -> f64 {
        let is_homed = self.is_homed();
        let Some(compensation) = &mut self.compensation else {
            return command_mm;
        };
        match self.axis.status() {
            Status::Enabled if is_homed => compensation.step(command_mm),
            Status::Homing => {
                // Afterwards the motor counts again, and which way it came is not known.
                compensation.restart();
                command_mm
            }
            // Without a home nobody knows of what place the error would be.
            Status::Enabled
            | Status::Offline
            | Status::Disabled
            | Status::Enabling
            | Status::Disabling
            | Status::QuickStopping
            | Status::Faulted(_) => {
                compensation.hold();
                command_mm + compensation.correction_mm()
            }
        }
    }

    /// Actual position, mm in the machine.
    pub fn actual_mm(&self) -> f64 {
        self.to_mm(self.axis.actual_position())
    }

    /// Where its touch probe has found an edge, mm; 0 the rising one, 1 the falling one. RT.
    pub(super) fn touched_mm(&self, edge: usize) -> Option<f64> {
        self.latched_mm(self.probes.touched(edge))
    }

    /// Where it has passed a zero mark, if it has told so in this cycle, mm. RT.
    pub fn index_mm(&self) -> Option<f64> {
        self.latched_mm(self.probes.index_passed())
    }

    /// A position of 32 bits near the actual one, mm.
    fn latched_mm(&self, latched: Option<i32>) -> Option<f64> {
        let (found, actual) = (latched?, self.axis.actual_position());
        Some(self.to_mm(actual + i64::from(found.wrapping_sub(actual as i32))))
    }

    fn to_mm(&self, increments: i64) -> f64 {
        let motor_mm = increments as f64 / self.increments_per_mm + self.home.zero_mm;
        let compensation = self.compensation.as_ref();
        motor_mm - compensation.map_or(0.0, JointCompensation::correction_mm)
    }

    /// Last command, mm in the machine.
    pub fn command_mm(&self) -> f64 {
        self.command_mm
    }

    /// Command that the drive had when it took the position it reports, less that position, mm.
    pub fn following_error_mm(&self) -> f64 {
        match self.fields.following_error {
            Some(_) if self.mode.is_position() => f64::from(self.feedback.following_error) / self.increments_per_mm,
            Some(_) | None => self.command_before_mm - self.actual_mm(),
        }
    }

    pub(super) fn trace(&self) -> JointTrace {
        JointTrace {
            command_mm: self.command_mm,
            actual_mm: self.actual_mm(),
            following_error_mm: self.following_error_mm(),
            // As it was sent, in whole units of the object.
            output: match (&self.pid, self.mode) {
                (None, _) => f64::NAN,
                (Some(_), DriveMode::Cst) => f64::from(self.setpoint.target_torque) / 1000.0,
                (Some(_), _) => f64::from(self.setpoint.target_velocity) / self.velocity_per_mm_s,
            },
            torque: self.torque,
            fresh: self.fresh,
        }
    }

    /// Whether the drive shows a warning.
    pub fn warns(&self) -> bool {
        self.axis.warning()
    }

    /// Whether it says that its safety circuit is open.
    pub fn is_sto_open(&self) -> bool {
        self.online && self.sto_open
    }

    /// Whether it says that its lower, and its upper limit switch is closed.
    pub fn limit_switches(&self) -> [bool; 2] {
        let closed = self.switches.limits(self.feedback.digital_inputs);
        closed.map(|closed| self.online && closed)
    }

    /// Whether it says that its home switch is closed.
    pub fn home_switch(&self) -> bool {
        self.switches.home(self.feedback.digital_inputs)
    }

    /// Greatest following error allowed, mm.
    pub fn following_error_max_mm(&self) -> f64 {
        self.following_error_max_mm
    }

    /// Where the supervisor is.
    pub fn status(&self) -> Status {
        self.axis.status()
    }

    /// Whether the machine position is known.
    pub fn is_homed(&self) -> bool {
        self.home.by_control.unwrap_or(self.axis.homing() == HomingState::Homed)
    }

    /// Whether the drive is without power as far as can be known, and no fault reset is under way in it.
    pub fn is_off(&self) -> bool {
        is_off(&self.axis, self.online)
    }

    /// What the drive counts, and the position at which it counts 0, mm; `None`: it is off line.
    pub fn place(&self) -> Option<(i64, f64)> {
        let is_read = self.axis.status() != Status::Offline && self.online;
        is_read.then(|| (self.axis.actual_position(), self.home.zero_mm))
    }
}
