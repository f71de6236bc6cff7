//! The pins of joints with step pulses, named as those of LinuxCNC's component `stepgen`.
//!
//! In:  what was sent. Out: pins. RT: nothing allocates but [`StepPins::new`].

use super::steps::{StepDrives, StepView};
use config::{Config, StepKind};
use hal_pins::{Hal, HalError, Output};

/// Those of one joint.
struct OfJoint {
    counts: Output<i64>,
    frequency: Output<f64>,
    enabled: Output<bool>,
    /// Where levels are pins: the two lines.
    lines: Option<[Output<bool>; 2]>,
    /// Of a simulated motor: place in steps; steps that it has lost.
    rotor: Option<(Output<f64>, Output<i64>)>,
    /// Pulses of a period of its field: what it loses is lost by these.
    period: i64,
}

/// Those of all of them.
pub struct StepPins {
    joints: Vec<OfJoint>,
    pauses: Option<Output<u64>>,
}

impl StepPins {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config, drives: &StepDrives) -> Result<StepPins, HalError> {
        let (by_pins, simulated) = drives.kind();
        let mut joints = Vec::new();
        for StepView { joint, kind, .. } in drives.views() {
            let name = |pin: &str| format!("stepgen.{joint}.{pin}");
            let names = match kind {
                StepKind::StepDirection => ["step", "dir"],
                StepKind::UpDown => ["up", "down"],
                StepKind::Quadrature => ["phase-a", "phase-b"],
            };
            let microsteps = config.steps.as_ref().map_or(1, |steps| steps.motor.microsteps);
            joints.push(OfJoint {
                counts: hal.output(&name("counts"))?,
                frequency: hal.output(&name("frequency"))?,
                enabled: hal.output(&name("enabled"))?,
                lines: match by_pins {
                    true => Some([hal.output(&name(names[0]))?, hal.output(&name(names[1]))?]),
                    false => None,
                },
                rotor: match simulated {
                    true => Some((hal.output(&name("rotor"))?, hal.output(&name("lost"))?)),
                    false => None,
                },
                period: 4 * i64::from(microsteps),
            });
        }
        let pauses = match joints.is_empty() {
            true => None,
            false => Some(hal.output("stepgen.pauses")?),
        };
        Ok(StepPins { joints, pauses })
    }

    /// Once a cycle. RT.
    pub fn show(&mut self, drives: &StepDrives) {
        for (pins, view) in self.joints.iter_mut().zip(drives.views()) {
            pins.counts.set(view.counts);
            pins.frequency.set(view.frequency_hz);
            pins.enabled.set(view.enabled);
            if let Some(lines) = &mut pins.lines {
                for (line, level) in lines.iter_mut().zip(view.levels) {
                    line.set(level);
                }
            }
            if let (Some((rotor, lost)), Some(steps)) = (&mut pins.rotor, view.rotor_steps) {
                rotor.set(steps);
                let periods = ((view.counts as f64 - steps) / pins.period as f64).round();
                lost.set(periods as i64 * pins.period);
            }
        }
        if let Some(pauses) = &mut self.pauses {
            pauses.set(drives.pauses());
        }
    }
}
