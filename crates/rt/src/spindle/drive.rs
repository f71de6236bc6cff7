//! A drive of CiA 402 that turns the spindle: an inverter or a servo, led by its speed.
//!
//! In:  the speed that the spindle is told; what the drive sends.
//! Out: its controlword and target; the speed that it has; what is wrong with it.
//!
//! It is switched on when the spindle is to turn, and off once it stands again. [`SpindleDrive::new`] is made at start-up; the rest
//! is RT.

use crate::drives::is_off;
use bus::layout::{Field, Layout};
use bus::plan::NodePlan;
use bus::{InputImage, NodeIndex, NodeState, OutputImage};
use cia402::axis::{Axis, AxisConfig, AxisFault, Feedback, Request, Setpoint, Status, Target};
use cia402::profile::{axis_of, object_of};
use config::{Config, SpindleAxis};

/// At this speed it counts as standing, 1/min.
const STANDS_RPM: f64 = 5.0;

/// The drive of the spindle.
#[derive(Debug)]
pub(super) struct SpindleDrive {
    node: NodeIndex,
    controlword: Field,
    target: Field,
    mode_field: Option<Field>,
    statusword: Field,
    velocity: Field,
    mode_display: Option<Field>,
    digital_inputs: Option<Field>,
    error_code: Option<Field>,
    /// Target for 1/min.
    per_rpm: f64,
    /// Most that its target changes in a cycle, 1/min; infinite where its own ramp counts.
    step_rpm: f64,
    axis: Axis,
    feedback: Feedback,
    setpoint: Setpoint,
    online: bool,
    measured_rpm: f64,
    told_rpm: f64,
}

impl SpindleDrive {
    /// `None`: the spindle has none, or the payloads of its node lack an object without which it is not run.
    pub(super) fn new(config: &Config, plans: &[NodePlan]) -> Option<SpindleDrive> {
        let of = config.spindle.axis?;
        let plan = plans.get(of.node)?;
        let find = |layout: &Layout, (index, sub)| layout.find(object_of(of.drive_axis, index), sub);
        let [above, below] = of.units_per_rpm.map(f64::from);
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        Some(SpindleDrive {
            node: of.node,
            controlword: find(&plan.outputs, (0x6040, 0))?,
            target: find(&plan.outputs, of.mode.target())?,
            mode_field: find(&plan.outputs, (0x6060, 0)),
            statusword: find(&plan.inputs, (0x6041, 0))?,
            velocity: find(&plan.inputs, of.mode.actual_velocity())?,
            mode_display: find(&plan.inputs, (0x6061, 0)),
            digital_inputs: find(&plan.inputs, (0x60FD, 0)),
            error_code: find(&plan.inputs, (0x603F, 0)),
            per_rpm: above / below,
            step_rpm: of.ramp_rpm_s.map_or(f64::INFINITY, |ramp| ramp * cycle_s),
            axis: Axis::new(AxisConfig {
                mode: of.mode,
                // A converter charges its link, and takes its ramp to brake, for longer than a servo: no power is cut meanwhile.
                step_timeout_ns: (config.spindle.speed_timeout_s * 1e9) as u64,
                ..AxisConfig::default()
            }),
            feedback: Feedback::default(),
            setpoint: Setpoint::default(),
            online: false,
            measured_rpm: 0.0,
            told_rpm: 0.0,
        })
    }

    /// Whether the control fills an object of its node.
    pub(super) fn fills(of: &SpindleAxis, (index, sub): (u16, u8)) -> bool {
        let own = [(0x6040, 0), (0x6060, 0), of.mode.target()];
        let (axis, index) = axis_of(index);
        axis == of.drive_axis && own.contains(&(index, sub))
    }

    /// Takes what the drive sent. RT.
    pub(super) fn read(&mut self, inputs: &InputImage, state: impl Fn(NodeIndex) -> NodeState) {
        self.online = state(self.node) == NodeState::Operational;
        if !inputs.fresh[self.node] {
            return;
        }
        let payload = inputs.payload.node(self.node);
        let read = |field: Option<Field>| field.map_or(0, |field| field.read_signed(payload));
        self.feedback = Feedback {
            statusword: self.statusword.read(payload) as u16,
            // A drive that does not say its mode is taken to follow the wish.
            mode_display: self
                .mode_display
                .map_or(self.setpoint.mode, |field| field.read_signed(payload) as i8),
            digital_inputs: read(self.digital_inputs) as u32,
            error_code: read(self.error_code) as u16,
            ..Feedback::default()
        };
        self.measured_rpm = self.velocity.read_signed(payload) as f64 / self.per_rpm;
    }

    /// Leads it to a speed, 1/min; `None`: it is to stand, and then off. RT.
    pub(super) fn lead(&mut self, now_ns: u64, rpm: Option<f64>, outputs: &mut OutputImage) {
        let wanted_rpm = rpm.unwrap_or(0.0);
        match self.axis.status() {
            Status::Disabled if rpm.is_some() => self.axis.request(Request::Enable),
            Status::Enabled if rpm.is_none() && self.told_rpm == 0.0 && self.stands() => {
                self.axis.request(Request::Disable);
            }
            _ => {}
        }
        self.told_rpm = match self.axis.status() {
            Status::Enabled => self.told_rpm + (wanted_rpm - self.told_rpm).clamp(-self.step_rpm, self.step_rpm),
            // One that turns still when it is switched on is led on from there.
            _ if self.step_rpm.is_finite() => self.measured_rpm,
            _ => 0.0,
        };
        let target = Target {
            // Within the numbers of its object: the speed is at most the highest one.
            velocity: (self.told_rpm * self.per_rpm).round() as i32,
            ..Target::default()
        };
        self.setpoint = self.axis.cycle(now_ns, self.online, &self.feedback, target);
        let payload = outputs.node_mut(self.node);
        self.controlword.write(payload, u64::from(self.setpoint.controlword));
        self.target.write(payload, self.setpoint.target_velocity as u64);
        if let Some(mode) = self.mode_field {
            mode.write(payload, self.setpoint.mode as u64);
        }
    }

    fn stands(&self) -> bool {
        self.measured_rpm.abs() <= STANDS_RPM
    }

    /// Asks it for something beside its speed. RT.
    pub(super) fn request(&mut self, request: Request) {
        self.axis.request(request);
    }

    /// The speed that it tells, 1/min. RT.
    pub(super) fn measured_rpm(&self) -> f64 {
        self.measured_rpm
    }

    /// Whether it follows its speed. RT.
    pub(super) fn is_enabled(&self) -> bool {
        self.axis.status() == Status::Enabled
    }

    /// Whether it is without power as far as can be known. RT.
    pub(super) fn is_off(&self) -> bool {
        is_off(&self.axis, self.online)
    }

    /// What is wrong with it. RT.
    pub(super) fn fault(&self) -> Option<AxisFault> {
        self.axis.fault()
    }
}
