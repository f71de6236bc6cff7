//! Pins of the machine: its joints and axes, its mains, and what it is doing.
//!
//! In:  drives, the sample and the state of a cycle; limit and home switches that others drive.
//! Out: pins, named as LinuxCNC names them where it does; the switches.
//!
//! RT: nothing allocates but the functions that make pins.

use super::drives::Drives;
use super::loop_pins::LoopPins;
use super::step_pins::StepPins;
use super::steps::StepDrives;
use super::timing_pins::TimingPins;
use crate::cycle_stats::Timing;
use bus::{BusState, CyclicBus};
use cia402::axis::Status;
use config::Config;
use hal_pins::{Hal, HalError, Input, Memory, Output};
use machine::state::State;
use motion::canon::Axis;
use motion::rt::Sample;

/// Those of one joint.
pub(super) struct JointPins {
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

impl JointPins {
    pub(super) fn new(hal: &mut Hal, joint: usize) -> Result<JointPins, HalError> {
        let name = |pin: &str| format!("joint.{joint}.{pin}");
        Ok(JointPins {
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
        })
    }
}

/// Where each axis is told to be.
pub(super) struct AxisPins(Vec<(Axis, Output<f64>)>);

impl AxisPins {
    pub(super) fn new(hal: &mut Hal, config: &Config) -> Result<AxisPins, HalError> {
        let of_axis = config.axes.iter().map(|map| {
            let letter = map.axis.letter().to_ascii_lowercase();
            Ok((map.axis, hal.output(&format!("axis.{letter}.pos-cmd"))?))
        });
        of_axis.collect::<Result<_, _>>().map(AxisPins)
    }
}

/// What the machine is doing.
pub(super) struct StatePins {
    network_up: Output<bool>,
    machine_state: Output<u32>,
    fault: Output<bool>,
    program_line: Output<u32>,
    current_vel: Output<f64>,
    in_position: Output<bool>,
}

impl StatePins {
    pub(super) fn new(hal: &mut Hal) -> Result<StatePins, HalError> {
        Ok(StatePins {
            network_up: hal.output("plk.operational")?,
            machine_state: hal.output("motion.machine-state")?,
            fault: hal.output("motion.fault")?,
            program_line: hal.output("motion.program-line")?,
            current_vel: hal.output("motion.current-vel")?,
            in_position: hal.output("motion.in-position")?,
        })
    }
}

/// What the cycle shows of the machine, and the switches at its joints.
pub struct MachinePins {
    pub(super) memory: Memory,
    pub(super) joints: Vec<JointPins>,
    pub(super) axes: AxisPins,
    pub(super) loops: Vec<LoopPins>,
    pub(super) steps: StepPins,
    pub(super) state: StatePins,
    pub(super) mains_ok: Input<bool>,
    pub(super) timing: TimingPins,
}

impl MachinePins {
    /// Whether the file of the pins was cut short: values are lost.
    pub fn are_lost(&self) -> bool {
        self.memory.is_lost()
    }

    /// Whether the machine has its mains.
    pub fn is_mains_ok(&self) -> bool {
        self.mains_ok.get()
    }

    /// Shows whether all joints have reached where they are sent.
    pub fn show_in_position(&mut self, in_position: bool) {
        self.state.in_position.set(in_position);
    }

    /// Whether the home switch of a joint is closed, as its pin has it.
    pub fn home_switch(&self, joint: usize) -> bool {
        self.joints.get(joint).is_some_and(|pins| pins.home_switch.get())
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

    /// Gains of position loops as pins have them.
    pub fn turn_loops(&self, drives: &mut Drives) {
        for pins in &self.loops {
            pins.turn(drives, || self.are_lost());
        }
    }

    /// Shows joints with step pulses.
    pub fn show_steps(&mut self, drives: &StepDrives) {
        self.steps.show(drives);
    }

    /// Shows how the last cycle kept its time.
    pub fn show_timing(&mut self, timing: &Timing) {
        self.timing.show(timing);
    }

    /// Shows the values of a cycle. `is_fault`: a fault has stopped the machine and is not acknowledged.
    pub fn publish(&mut self, bus: &dyn CyclicBus, drives: &Drives, sample: &Sample, state: State, is_fault: bool) {
        for (pins, drive) in self.joints.iter_mut().zip(drives.iter()) {
            pins.motor_pos_cmd.set(drive.command_mm());
            pins.motor_pos_fb.set(drive.actual_mm());
            pins.f_error.set(drive.following_error_mm());
            pins.homed.set(drive.is_homed());
            pins.amp_enabled.set(drive.status() == Status::Enabled);
            pins.homing.set(drive.status() == Status::Homing);
            let by_drive = drive.limit_switches();
            for ((shown, switch), by_drive) in pins.hard_limits.iter_mut().zip(&pins.limit_switches).zip(by_drive) {
                shown.set(switch.get() || by_drive);
            }
        }
        for pins in &mut self.loops {
            pins.show(drives);
        }
        for (axis, pos_cmd) in &mut self.axes.0 {
            pos_cmd.set(sample.position[*axis]);
        }
        let pins = &mut self.state;
        pins.network_up.set(bus.state() == BusState::Operational);
        pins.machine_state.set(state as u32);
        pins.fault.set(is_fault);
        pins.program_line.set(sample.line);
        pins.current_vel.set(sample.velocity_mm_s);
    }
}
