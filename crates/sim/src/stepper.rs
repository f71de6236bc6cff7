//! Simulated stepper motors at the pins of the step port.
//!
//! In:  levels of the pins. Out: where each rotor is.
//!
//! A rotor is drawn to the field by a torque that goes with the sine of the angle between them, four full steps a period, and
//! that becomes less with speed: half of it at the speed that the machine file gives. More acceleration than that, and the rotor
//! falls out of step: it is left behind by whole periods of the field, and nobody tells the control.

use config::{Config, SUBSTEPS, StepKind, StepOutput, StepPortKind, Steps};
use host::step_port::StepPort;

/// Damping of the rotor's swing about the field, share of the critical.
const DAMPING: f64 = 0.3;
/// The field's speed is a mean over this time, s: pulses alone have none.
const FIELD_S: f64 = 2e-3;
/// Motion is worked out in parts no longer than this, ns.
const PART_NS: u64 = 25_000;
/// Of a longer time only this much, ns: a motor at rest stays there.
const TIME_MAX_NS: u64 = 2_000_000;

/// One motor. Lengths in pulses.
#[derive(Debug)]
struct Stepper {
    output: StepOutput,
    /// Full torque as an acceleration, pulses/s², and the speed at which half of it is left, pulses/s.
    acceleration: f64,
    half_speed: f64,
    /// Pulses of a full step.
    microsteps: f64,
    lines: [bool; 2],
    powered: bool,
    field: i64,
    field_speed: f64,
    rotor: f64,
    speed: f64,
}

impl Stepper {
    /// What the driver of the motor makes of its lines.
    fn see(&mut self, lines: [bool; 2]) {
        let rises = |line: usize| lines[line] && !self.lines[line];
        self.field += match self.output.kind {
            StepKind::StepDirection if rises(0) => 2 * i64::from(lines[1]) - 1,
            StepKind::StepDirection => 0,
            StepKind::UpDown => i64::from(rises(0)) - i64::from(rises(1)),
            StepKind::Quadrature => {
                let phase = |[a, b]: [bool; 2]| i64::from(a ^ b) + 2 * i64::from(b);
                match (phase(lines) - phase(self.lines)).rem_euclid(4) {
                    1 => 1,
                    3 => -1,
                    _ => 0,
                }
            }
        };
        self.lines = lines;
    }

    fn advance(&mut self, ns: u64) {
        if !self.powered {
            // Without current it stands by its friction.
            (self.speed, self.field_speed) = (0.0, 0.0);
            return;
        }
        let parts = ns.div_ceil(PART_NS);
        let s = ns as f64 * 1e-9 / parts.max(1) as f64;
        let period = 4.0 * self.microsteps;
        let swing = (self.acceleration * std::f64::consts::TAU / period).sqrt();
        for _ in 0..parts {
            let torque = self.acceleration / (1.0 + self.speed.abs() / self.half_speed);
            let angle = (self.field as f64 - self.rotor) * std::f64::consts::TAU / period;
            let damping = 2.0 * DAMPING * swing * (self.field_speed - self.speed);
            // It is the same current that damps: no more than the torque there is.
            let pull = (torque * angle.sin() + damping).clamp(-torque, torque);
            self.speed += pull * s;
            self.rotor += self.speed * s;
        }
    }
}

/// Simulated motors for a machine file that wants them.
pub fn port(config: &Config) -> Option<Box<dyn StepPort + Send>> {
    let steps = config.steps.as_ref()?;
    (steps.port == StepPortKind::Simulated).then(|| Box::new(SimSteppers::new(config, steps)) as _)
}

/// All motors of a machine.
#[derive(Debug)]
struct SimSteppers {
    motors: Box<[Stepper]>,
    inverted: u32,
    last_ns: Option<u64>,
    fields: Box<[i64]>,
}

impl SimSteppers {
    /// All at rest at 0.
    fn new(config: &Config, steps: &Steps) -> SimSteppers {
        let motors: Box<[Stepper]> = config
            .joints
            .iter()
            .filter_map(|joint| {
                let output = joint.step?;
                let [parts, units] = joint.counts_per_unit.map(f64::from);
                let steps_per_mm = parts / units / f64::from(SUBSTEPS);
                Some(Stepper {
                    output,
                    acceleration: steps.motor.acceleration * joint.stop.acceleration_mm_s2 * steps_per_mm,
                    half_speed: steps.motor.speed * joint.limits.velocity_mm_s * steps_per_mm,
                    microsteps: steps.motor.microsteps.into(),
                    lines: [false; 2],
                    powered: output.enable.is_none(),
                    field: 0,
                    field_speed: 0.0,
                    rotor: 0.0,
                    speed: 0.0,
                })
            })
            .collect();
        SimSteppers {
            inverted: steps.inverted,
            last_ns: None,
            fields: motors.iter().map(|_| 0).collect(),
            motors,
        }
    }

    fn see(&mut self, levels: u32) {
        let high = |bit: u8| (levels ^ self.inverted) >> bit & 1 == 1;
        for motor in &mut self.motors {
            motor.powered = motor.output.enable.is_none_or(high);
            let lines = motor.output.lines.map(high);
            motor.see(lines);
        }
    }
}

impl StepPort for SimSteppers {
    fn write(&mut self, now_ns: u64, levels: u32) -> bool {
        let ns = self
            .last_ns
            .map_or(0, |last_ns| now_ns.saturating_sub(last_ns))
            .min(TIME_MAX_NS);
        self.last_ns = Some(now_ns);
        for (motor, before) in self.motors.iter_mut().zip(&mut self.fields) {
            let s = ns as f64 * 1e-9;
            if s > 0.0 {
                let speed = (motor.field - *before) as f64 / s;
                motor.field_speed += (speed - motor.field_speed) * (s / FIELD_S).min(1.0);
                *before = motor.field;
            }
            motor.advance(ns);
        }
        self.see(levels);
        true
    }

    fn pulse(&mut self, now_ns: u64, levels: u32, pulses: u32, _pulse_ns: u64) -> bool {
        self.write(now_ns, levels ^ pulses);
        self.see(levels);
        true
    }

    fn rotor(&self, joint: usize) -> Option<f64> {
        Some(self.motors.get(joint)?.rotor)
    }
}
