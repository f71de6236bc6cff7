//! The place and the speed of the spindle, by its encoder.
//!
//! In:  a counter of a node, or pins of components. Out: turns, speed; counts that were lost; pins.
//!
//! RT: nothing allocates but what makes the pins.

use super::drive::SpindleDrive;
use crate::encoder::{Encoder, Speed};
use bus::InputImage;
use bus::plan::NodePlan;
use config::{Config, SpindleEncoder};
use hal_pins::{Hal, HalError, Input, Output};
use motion::rt::SpindleFeedback;

/// Cycles until the operator is told again that counts were lost.
const SLIP_QUIET_CYCLES: u32 = 10_000;

/// Where its place comes from.
pub(super) enum Source {
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

impl Source {
    pub(super) fn new(hal: &mut Hal, config: &Config, plans: &[NodePlan]) -> Result<Source, HalError> {
        let encoder = match config.spindle.encoder {
            Some(SpindleEncoder::Pins) => {
                return Ok(Source::Pins {
                    revs: hal.input("spindle.0.revs", 0.0)?,
                    indexed: hal.input("spindle.0.indexed", false)?,
                });
            }
            Some(SpindleEncoder::Counter(counter)) => Encoder::new(counter, plans),
            None => None,
        };
        let Some(encoder) = encoder else {
            return Ok(Source::None);
        };
        Ok(Source::Counter {
            encoder,
            revs: hal.output("spindle.0.revs")?,
            indexed: hal.output("spindle.0.indexed")?,
        })
    }
}

/// What the encoder of the spindle says.
pub(super) struct Feedback {
    source: Source,
    speed_in: Output<f64>,
    place: SpindleFeedback,
    speed: Speed,
    turns_per_cycle: f64,
    lead_cycles: f64,
    cycle_s: f64,
    slip_quiet: u32,
}

impl Feedback {
    pub(super) fn new(hal: &mut Hal, config: &Config, source: Source) -> Result<Feedback, HalError> {
        Ok(Feedback {
            source,
            speed_in: hal.output("spindle.0.speed-in")?,
            place: SpindleFeedback::NONE,
            speed: Speed::new(),
            turns_per_cycle: 0.0,
            lead_cycles: config.spindle.encoder_lead_cycles,
            cycle_s: f64::from(config.cycle_us) * 1e-6,
            slip_quiet: 0,
        })
    }

    /// Once in every cycle; without an encoder `drive` shows its speed. RT.
    pub(super) fn update(&mut self, inputs: &InputImage, drive: Option<&SpindleDrive>) {
        self.place = match &mut self.source {
            Source::None => {
                if let Some(drive) = drive {
                    self.speed_in.set(drive.measured_rpm() / 60.0);
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

    /// As [`Spindle::take_slip`](super::Spindle::take_slip). RT.
    pub(super) fn take_slip(&mut self, in_step: bool) -> Option<i64> {
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

    /// Where the spindle will be when the axes are where this cycle's set-points bring them. RT.
    pub(super) fn place(&self) -> SpindleFeedback {
        SpindleFeedback {
            turns: self.place.turns + self.lead_cycles * self.turns_per_cycle,
            ..self.place
        }
    }

    /// Measured speed, 1/min; `None`: there is no encoder. RT.
    pub(super) fn rpm(&self) -> Option<f64> {
        match self.source {
            Source::None => None,
            Source::Pins { .. } | Source::Counter { .. } => Some(self.turns_per_cycle / self.cycle_s * 60.0),
        }
    }
}
