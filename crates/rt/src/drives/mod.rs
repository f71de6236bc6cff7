//! Joints as drives on the bus: payload fields to millimetres and back.
//!
//! In:  the input image; commanded joint positions, mm.
//! Out: actual joint positions, mm; the output image.
//!
//! `motor mm = increments / ratio + zero`, where `zero` is the position at which the drive counts 0: its home point, or what
//! homing by the control has found. The motor stands beside its joint by the compensation of backlash and pitch errors, which
//! nobody outside of this file sees.
//!
//! A drive in CSP or IP holds the position that it is told. For one in CSV or CST the control closes the position loop
//! ([`Pid`], `[joint.pid]`): in each cycle from the command that the drive had when it took the position that has just come.
//! The loop works in the drive's own coordinates, which homing does not shift.

use super::homing::Found;
use super::shared::JointTrace;
use bus::layout::{Field, Layout};
use bus::plan::NodePlan;
use bus::{InputImage, NodeIndex, NodeState, OutputImage};
use cia402::axis::{Axis, AxisConfig, Feedback, HomingState, Request, Setpoint, Status, Target};
use cia402::profile::{axis_of, object_of};
use config::{
    Compensation, Config, DriveMode, HomingBy, HomingIndex, InputBits, JOINTS_MAX, Joint, Sto, targets,
    touch_probe_objects,
};
use motion::canon::Position;
use motion::kinematics::Kinematics;
use motion::rt::{JointCompensation, Pid, PidGains, Sample};

/// Whether the control fills an object of the drive of a joint itself; others have pins.
pub fn is_filled(joint: &Joint, (index, sub): (u16, u8)) -> bool {
    let (axis, index) = axis_of(index);
    if axis != joint.drive_axis {
        return false;
    }
    match (index, sub) {
        (0x6040 | 0x6060, 0) => true,
        (0x60B8, 0) => joint.touch_probe.is_some() || index_of(joint).is_some(),
        (0x60B1, 0) => joint.mode.is_position(),
        (0x60B2, 0) => joint.torque_per_mm_s2.is_some(),
        object => targets(joint.mode).contains(&object),
    }
}

/// The zero mark by which the control homes a joint, if it does.
fn index_of(joint: &Joint) -> Option<HomingIndex> {
    match joint.homing.by {
        HomingBy::Control(control) => control.index,
        HomingBy::Drive { .. } => None,
    }
}

/// A touch probe of a drive, which latches every zero mark of its encoder, or every edge of the machine's probe.
#[derive(Clone, Copy, Debug)]
struct Touch {
    /// Function, status; positions of the last rising and the last falling edge.
    fields: [Field; 4],
    /// How far the bits of this probe stand up in function and status.
    shift: u8,
    /// In the function, before they are moved up.
    bits: u64,
    /// What the positions were before.
    before: [i32; 2],
    /// No edge has been stored since: the next one that is counts, also at the very increment of the one before.
    cleared: [bool; 2],
    /// Positions of the first edges since then, as they came.
    found: [Option<i32>; 2],
    /// It is switched off, so that the drive forgets what it has stored.
    off: bool,
}

impl Touch {
    /// On, continuously, rising and falling edges of the probe's input.
    const FUNCTION: u64 = 0b0011_0011;
    /// On, continuously, zero marks in place of the input, which rise where they are.
    const ZERO_MARKS: u64 = 0b0001_0111;

    fn new(axis: u8, number: u8, outputs: &Layout, inputs: &Layout) -> Option<Touch> {
        let [function, status, rising, falling] = touch_probe_objects(axis, number);
        Some(Touch {
            fields: [
                outputs.find(function, 0)?,
                inputs.find(status, 0)?,
                inputs.find(rising, 0)?,
                inputs.find(falling, 0)?,
            ],
            shift: 8 * (number - 1),
            bits: Touch::FUNCTION,
            before: [0; 2],
            cleared: [false; 2],
            found: [None; 2],
            off: false,
        })
    }

    /// The same for zero marks, which have no falling edge.
    fn of_zero_marks(axis: u8, number: u8, outputs: &Layout, inputs: &Layout) -> Option<Touch> {
        let [function, status, rising, _] = touch_probe_objects(axis, number);
        let rising = inputs.find(rising, 0)?;
        Some(Touch {
            fields: [outputs.find(function, 0)?, inputs.find(status, 0)?, rising, rising],
            shift: 8 * (number - 1),
            bits: Touch::ZERO_MARKS,
            before: [0; 2],
            cleared: [false; 2],
            found: [None; 2],
            off: false,
        })
    }

    /// Positions of the last edges in a payload; `None`: there has been none. RT.
    fn read(&self, payload: &[u8]) -> [Option<i32>; 2] {
        let [_, status, edges @ ..] = self.fields;
        let status = status.read(payload) >> self.shift;
        [0, 1].map(|edge: usize| {
            let is_stored = status >> (edge + 1) & 1 == 1;
            is_stored.then(|| edges[edge].read_signed(payload) as i32)
        })
    }

    /// RT.
    fn watch(&mut self, payload: &[u8]) {
        self.off &= self.fields[1].read(payload) >> self.shift & 1 == 1;
        for (edge, last) in self.read(payload).into_iter().enumerate() {
            self.cleared[edge] |= last.is_none();
            if self.found[edge].is_none() {
                self.found[edge] = last.filter(|last| self.cleared[edge] || *last != self.before[edge]);
            }
        }
    }

    /// From now on edges count that come. A drive that has stored some is switched off until it says so: positions alone would not
    /// tell a second touch at the same increment. One that forgets nothing by that is told by its positions. RT.
    fn arm(&mut self) {
        for edge in 0..2 {
            if let Some(found) = self.found[edge].take() {
                (self.before[edge], self.cleared[edge], self.off) = (found, false, true);
            }
        }
    }

    /// 60B8, as far as it is its own. RT.
    fn function(&self) -> u64 {
        if self.off { 0 } else { self.bits << self.shift }
    }
}

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

/// One joint and the drive that moves it.
#[derive(Debug)]
pub struct Drive {
    node: NodeIndex,
    fields: Fields,
    mode: DriveMode,
    increments_per_mm: f64,
    /// 60FF for 1 mm/s.
    velocity_per_mm_s: f64,
    cycle_s: f64,
    /// 60B2 for an acceleration of one increment/s², as a share of the rated torque.
    torque_per_increment: f64,
    /// Place and speed of the set-point before, increments and increments/s; `None`: the drive did not follow.
    before: Option<[f64; 2]>,
    /// Of a drive that holds no position itself.
    pid: Option<Pid>,
    /// For the next set-point.
    effort: Effort,
    /// Whether an answer has come in this cycle.
    fresh: bool,
    /// Torque that it told of last, 1/1000 of the rated one; NaN: it does not.
    torque: f64,
    /// Position at which the drive counts 0.
    zero_mm: f64,
    /// `None`: the drive homes itself; else whether the control has homed it since it came on line.
    homed_by_control: Option<bool>,
    /// It is to be homed again whenever it has been off.
    volatile: bool,
    following_error_max_mm: f64,
    travel_mm: [f64; 2],
    /// Supervisor of the power state machine.
    axis: Axis,
    feedback: Feedback,
    setpoint: Setpoint,
    online: bool,
    limits_by_drive: bool,
    input_bits: InputBits,
    sto: Option<(Field, Sto)>,
    /// What it sent last says that its safety circuit is open.
    sto_open: bool,
    touch: Option<Touch>,
    /// Latches zero marks, for homing by the control.
    index: Option<Touch>,
    /// Where it has told of one in this cycle, increments.
    index_passed: Option<i32>,
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
            cycle_s,
            torque_per_increment: joint.torque_per_mm_s2.unwrap_or(0.0) / 1000.0 * units / counts,
            before: None,
            pid: joint.pid.map(|gains| Pid::new(gains, cycle_s)),
            effort: Effort::default(),
            fresh: false,
            torque: f64::NAN,
            zero_mm: match joint.homing.by {
                HomingBy::Drive { .. } => joint.homing.position_mm - joint.home_count as f64 * units / counts,
                HomingBy::Control(_) => 0.0,
            },
            homed_by_control: match joint.homing.by {
                HomingBy::Drive { .. } => None,
                HomingBy::Control(_) => Some(false),
            },
            volatile: joint.homing.volatile,
            following_error_max_mm: joint.following_error_mm,
            travel_mm: joint.travel_mm,
            axis: Axis::new(AxisConfig {
                mode: joint.mode,
                ..AxisConfig::default()
            }),
            feedback: Feedback::default(),
            setpoint: Setpoint::default(),
            online: false,
            limits_by_drive: joint.limits_by_drive,
            input_bits: joint.input_bits,
            sto: joint.sto.and_then(|sto| {
                let (index, sub) = sto.object;
                Some((plan.inputs.find(index, sub)?, sto))
            }),
            sto_open: false,
            touch: joint
                .touch_probe
                .and_then(|number| Touch::new(joint.drive_axis, number, &plan.outputs, &plan.inputs)),
            index: index_of(joint)
                .and_then(|index| Touch::of_zero_marks(joint.drive_axis, index.probe, &plan.outputs, &plan.inputs)),
            index_passed: None,
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
    fn read(&mut self, inputs: &InputImage, state: NodeState) {
        self.online = state == NodeState::Operational;
        if !self.online {
            // It may have been switched off meanwhile, and then counts again.
            self.forget_home();
        }
        self.index_passed = None;
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
        if let Some(touch) = &mut self.touch {
            touch.watch(payload);
        }
        if let Some(index) = &mut self.index {
            index.watch(payload);
            self.index_passed = index.found[0];
            // A mark that is passed again, there and back, is one again.
            index.arm();
        }
        self.sto_open = self
            .sto
            .is_some_and(|(field, sto)| (field.read(payload) >> sto.bit & 1 == 1) == sto.active);
    }

    fn forget_home(&mut self) {
        self.axis.forget_home();
        self.homed_by_control = self.homed_by_control.map(|_| false);
    }

    /// Homing by the control begins: the motor stays where it is, and follows without compensation. RT.
    fn begin_homing(&mut self) {
        self.forget_home();
        if let Some(compensation) = &mut self.compensation {
            self.zero_mm -= compensation.correction_mm();
            compensation.restart();
        }
    }

    /// Homing by the control is done: positions count again, the motor stays where it is. RT.
    fn home_at(&mut self, found: &Found) {
        self.homed_by_control = Some(true);
        // The motor stood beside the joint by this when the switch closed.
        let beside_mm = self.compensation.as_ref().map_or(0.0, |compensation| {
            compensation.correction_at_mm(found.switch_mm, found.forward)
        });
        self.zero_mm += found.offset_mm + beside_mm;
        // Whole increments, so that rounding does not move the motor either.
        self.command_mm = self.to_mm(self.axis.target_position());
        self.command_before_mm = self.command_mm;
    }

    /// The drive still counts from where it was homed in an earlier session: `zero_mm` is the position at which it counts 0. RT.
    fn take_home(&mut self, zero_mm: f64) {
        self.zero_mm = zero_mm;
        match &mut self.homed_by_control {
            None => self.axis.take_for_homed(),
            Some(homed) => *homed = self.online,
        }
    }

    /// Tells the drive where to be; a drive that is not enabled is kept where it is, so that enabling never jumps. RT.
    fn write(&mut self, now_ns: u64, command_mm: f64, outputs: &mut OutputImage) {
        let motor_mm = self.compensated(command_mm);
        let increments = (motor_mm - self.zero_mm) * self.increments_per_mm;
        let effort = match self.mode.is_position() {
            true => self.feed_forward(increments),
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
        if self.volatile && self.is_off() {
            self.forget_home();
        }
        self.command_before_mm = self.command_mm;
        let following = self.axis.status() == Status::Enabled;
        if !following {
            self.before = None;
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
        let probes = [&self.touch, &self.index].map(Option::as_ref);
        if let Some(probe) = probes[0].or(probes[1]) {
            let functions = probes.iter().flatten().map(|probe| probe.function());
            probe.fields[0].write(payload, functions.fold(0, |all, one| all | one));
        }
        if let Some(mode) = self.fields.mode {
            mode.write(payload, self.setpoint.mode as u64);
        }
    }

    /// What a set-point takes of speed and torque, for a drive that holds its position itself: the mean speed of the cycle, and
    /// its change from that of the cycle before. RT.
    fn feed_forward(&mut self, increments: f64) -> Effort {
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

    /// One period of the position loop, with the motor to be at `motor_mm`. It begins anew when the drive is enabled. RT.
    fn close_loop(&mut self, motor_mm: f64) {
        let Some(pid) = &mut self.pid else { return };
        let place_mm = |increments: i64| increments as f64 / self.increments_per_mm;
        if !self.online || self.axis.status() != Status::Enabled {
            pid.restart(place_mm(self.axis.actual_position()));
            return;
        }
        let command_mm = motor_mm - self.zero_mm;
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
    fn touched_mm(&self, edge: usize) -> Option<f64> {
        self.latched_mm(self.touch.as_ref()?.found[edge])
    }

    /// Where it has passed a zero mark, if it has told so in this cycle, mm. RT.
    pub fn index_mm(&self) -> Option<f64> {
        self.latched_mm(self.index_passed)
    }

    /// A position of 32 bits near the actual one, mm.
    fn latched_mm(&self, latched: Option<i32>) -> Option<f64> {
        let (found, actual) = (latched?, self.axis.actual_position());
        Some(self.to_mm(actual + i64::from(found.wrapping_sub(actual as i32))))
    }

    fn to_mm(&self, increments: i64) -> f64 {
        let motor_mm = increments as f64 / self.increments_per_mm + self.zero_mm;
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

    fn trace(&self) -> JointTrace {
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
        let told = self.online && self.limits_by_drive;
        let inputs = self.feedback.digital_inputs;
        self.input_bits.limits.map(|bit| told && inputs >> bit & 1 == 1)
    }

    /// Whether it says that its home switch is closed.
    pub fn home_switch(&self) -> bool {
        self.feedback.digital_inputs >> self.input_bits.home & 1 == 1
    }

    /// Greatest following error allowed, mm.
    pub fn following_error_max_mm(&self) -> f64 {
        self.following_error_max_mm
    }

    /// Soft limits, mm.
    pub fn travel_mm(&self) -> [f64; 2] {
        self.travel_mm
    }

    /// Where the supervisor is.
    pub fn status(&self) -> Status {
        self.axis.status()
    }

    /// Whether the machine position is known.
    pub fn is_homed(&self) -> bool {
        self.homed_by_control
            .unwrap_or(self.axis.homing() == HomingState::Homed)
    }

    /// Whether the drive is without power as far as can be known, and no fault reset is under way in it.
    pub fn is_off(&self) -> bool {
        match self.axis.status() {
            Status::Disabled => true,
            Status::Faulted(_) => !self.axis.is_resetting(),
            // A drive that has just come on line may be under power still, from an earlier run.
            Status::Offline => !self.online,
            Status::Enabling | Status::Enabled | Status::Homing | Status::Disabling | Status::QuickStopping => false,
        }
    }

    /// What the drive counts, and the position at which it counts 0, mm; `None`: it is off line.
    pub fn place(&self) -> Option<(i64, f64)> {
        let is_read = self.axis.status() != Status::Offline && self.online;
        is_read.then(|| (self.axis.actual_position(), self.zero_mm))
    }

    /// What came from the drive last.
    pub fn feedback(&self) -> &Feedback {
        &self.feedback
    }

    /// What went to the drive last.
    pub fn setpoint(&self) -> &Setpoint {
        &self.setpoint
    }
}

#[derive(Debug)]
pub struct Drives {
    drives: Box<[Drive]>,
}

impl Drives {
    /// One drive for each joint; the error is the joint whose payloads lack an object that every drive needs.
    pub fn new(config: &Config, plans: &[NodePlan]) -> Result<Drives, usize> {
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        let drives: Result<Box<[Drive]>, usize> = config
            .joints
            .iter()
            .enumerate()
            .map(|(index, joint)| Drive::new(joint, &plans[joint.node], cycle_s).ok_or(index))
            .collect();
        Ok(Drives { drives: drives? })
    }

    /// Takes what the drives sent; `state` tells of each node. RT.
    pub fn read(&mut self, inputs: &InputImage, state: impl Fn(NodeIndex) -> NodeState) {
        for drive in &mut self.drives {
            drive.read(inputs, state(drive.node));
        }
    }

    /// Tells the drives where to be: one position per joint, mm. RT.
    pub fn write(&mut self, now_ns: u64, command_mm: &[f64], outputs: &mut OutputImage) {
        for (drive, &command_mm) in self.drives.iter_mut().zip(command_mm) {
            drive.write(now_ns, command_mm, outputs);
        }
    }

    /// The last cycle of a joint; zeros where there is none. RT.
    pub fn trace(&self, joint: usize) -> JointTrace {
        self.drives.get(joint).map_or(JointTrace::NONE, Drive::trace)
    }

    /// So many cycles were left out. RT.
    pub fn leave_out(&mut self, cycles: u64) {
        for pid in self.drives.iter_mut().filter_map(|drive| drive.pid.as_mut()) {
            pid.leave_out(cycles);
        }
    }

    /// Other gains of the position loop of a joint, if the control closes it. RT.
    pub fn set_gains(&mut self, joint: usize, gains: PidGains) {
        if let Some(pid) = self.drives.get_mut(joint).and_then(|drive| drive.pid.as_mut()) {
            pid.set_gains(gains);
        }
    }

    /// Asks the joints of `which` (bit n: joint n) for something. RT.
    pub fn request(&mut self, which: u64, request: Request) {
        for (index, drive) in self.drives.iter_mut().enumerate() {
            if which >> index & 1 == 1 {
                drive.axis.request(request);
            }
        }
    }

    /// Asks the drives that home themselves now for something. RT.
    pub fn request_of_homing(&mut self, request: Request) {
        for drive in &mut self.drives {
            if drive.status() == Status::Homing {
                drive.axis.request(request);
            }
        }
    }

    /// Joints whose drives home themselves now (bit n: joint n). RT.
    pub fn homing(&self) -> u64 {
        let drives = self.drives.iter().enumerate();
        drives.fold(0, |mask, (joint, drive)| {
            mask | u64::from(drive.status() == Status::Homing) << joint
        })
    }

    /// The first joint whose drive says that its safety circuit is open. RT.
    pub fn sto_open(&self) -> Option<usize> {
        self.drives.iter().position(Drive::is_sto_open)
    }

    /// Joints of whose lower, and of whose upper limit switch drives say that it is closed (bit n: joint n). RT.
    pub fn limit_switches(&self) -> [u64; 2] {
        let mut closed = [0; 2];
        for (joint, drive) in self.drives.iter().enumerate() {
            for (closed, switch) in closed.iter_mut().zip(drive.limit_switches()) {
                *closed |= u64::from(switch) << joint;
            }
        }
        closed
    }

    /// Whether every drive shows a status that `wanted` accepts. RT.
    pub fn all(&self, wanted: impl Fn(&Drive) -> bool) -> bool {
        self.drives.iter().all(wanted)
    }

    /// Where the axes were measured, as the tool of `sample` is held; where no place of the axes is known, that of `sample`. RT.
    pub fn measured(&self, kinematics: &Kinematics, sample: &Sample) -> Position {
        let mut actual_mm = [0.0; JOINTS_MAX];
        for (actual_mm, drive) in actual_mm.iter_mut().zip(&self.drives) {
            *actual_mm = drive.actual_mm();
        }
        kinematics
            .forward(&sample.frame, &actual_mm[..self.drives.len()])
            .unwrap_or(sample.position)
    }

    /// What the touch probes have latched so far counts no more. RT.
    pub fn arm_touch_probes(&mut self) {
        for drive in &mut self.drives {
            if let Some(touch) = &mut drive.touch {
                touch.arm();
            }
        }
    }

    /// Where the drives have latched since then that the probe closed, and that it opened, as the tool of `sample` is held; each
    /// once all of them have. RT.
    pub fn touched(&self, kinematics: &Kinematics, sample: &Sample) -> [Option<Position>; 2] {
        [0, 1].map(|edge| {
            let mut places_mm = [0.0; JOINTS_MAX];
            for (place_mm, drive) in places_mm.iter_mut().zip(&self.drives) {
                *place_mm = drive.touched_mm(edge)?;
            }
            kinematics.forward(&sample.frame, &places_mm[..self.drives.len()])
        })
    }

    /// Homing of the joints of `which` (bit n: joint n) by the control begins. RT.
    pub fn begin_homing(&mut self, which: u64) {
        for (index, drive) in self.drives.iter_mut().enumerate() {
            if which >> index & 1 == 1 {
                drive.begin_homing();
            }
        }
    }

    /// A drive still counts from where it was homed in an earlier session. RT.
    pub fn take_home(&mut self, joint: usize, zero_mm: f64) {
        if let Some(drive) = self.drives.get_mut(joint) {
            drive.take_home(zero_mm);
        }
    }

    /// A joint has been homed by the control. RT.
    pub fn home_at(&mut self, joint: usize, found: &Found) {
        if let Some(drive) = self.drives.get_mut(joint) {
            drive.home_at(found);
        }
    }

    /// The drives in the order of the joints.
    pub fn iter(&self) -> std::slice::Iter<'_, Drive> {
        self.drives.iter()
    }
}

#[cfg(test)]
mod tests;
