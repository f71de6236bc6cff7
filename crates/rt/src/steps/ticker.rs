//! Pulses at the base rate.
//!
//! In:  a target per cycle of each joint; ticks. Out: levels for the pins of a port; pulses sent. RT.

use super::Shared;
use config::{SUBSTEPS, StepKind, StepOutput, Steps};
use host::step_port::{Nowhere, StepPort};
use motion::rt::dda::{Levels, StepGenerator};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// One joint.
#[derive(Debug)]
struct Channel {
    generator: StepGenerator,
    kind: StepKind,
    /// Masks of its two lines.
    lines: [u32; 2],
    enable: u32,
    /// Pulses end within the tick in which they begin.
    is_brief: bool,
}

impl Channel {
    /// What its lines are in the next tick: for all of it, and for the length of a brief pulse.
    fn tick(&mut self) -> ([bool; 2], [bool; 2]) {
        let Levels { step, direction } = self.generator.tick();
        match self.kind {
            StepKind::StepDirection if self.is_brief => ([false, direction], [step, false]),
            StepKind::StepDirection => ([step, direction], [false; 2]),
            StepKind::UpDown => {
                let pulse = [step && direction, step && !direction];
                match self.is_brief {
                    true => ([false; 2], pulse),
                    false => (pulse, [false; 2]),
                }
            }
            StepKind::Quadrature => {
                let phase = self.generator.made().rem_euclid(4);
                ([matches!(phase, 1 | 2), matches!(phase, 2 | 3)], [false; 2])
            }
        }
    }

    fn mask(&self, levels: [bool; 2]) -> u32 {
        let line = |number: usize| if levels[number] { self.lines[number] } else { 0 };
        line(0) | line(1)
    }
}

/// Makes the pulses of all joints.
pub struct Ticker {
    shared: Arc<Shared>,
    channels: Box<[Channel]>,
    levels: Box<[[bool; 2]]>,
    port: Box<dyn StepPort + Send>,
    inverted: u32,
    pulse_ns: u64,
    tick_ns: u64,
    /// Targets taken so far.
    taken: u64,
    moves: bool,
}

impl Ticker {
    pub(super) fn new(steps: &Steps, outputs: impl Iterator<Item = StepOutput>, shared: Arc<Shared>) -> Ticker {
        let bit = |bit: u8| 1_u32 << bit;
        let channels: Box<[Channel]> = outputs
            .map(|output| Channel {
                generator: StepGenerator::new(output.timing).expect("the machine file is checked"),
                kind: output.kind,
                lines: output.lines.map(bit),
                enable: output.enable.map_or(0, bit),
                is_brief: output.timing.high_ticks == 0,
            })
            .collect();
        Ticker {
            shared,
            levels: channels.iter().map(|_| [false; 2]).collect(),
            channels,
            port: Box::new(Nowhere),
            inverted: steps.inverted,
            pulse_ns: steps.pulse_ns.into(),
            tick_ns: steps.tick_ns.into(),
            taken: 0,
            moves: false,
        }
    }

    pub(super) fn set_port(&mut self, port: Box<dyn StepPort + Send>) {
        self.port = port;
    }

    /// Levels of the two lines of each joint in the last tick.
    pub(super) fn levels(&self) -> &[[bool; 2]] {
        &self.levels
    }

    /// A cycle begins: what was computed in the one before is where to be at its end. RT.
    pub fn begin_cycle(&mut self) {
        let written = self.shared.written.load(Ordering::Acquire);
        if written == self.taken {
            if self.moves {
                self.shared.pauses.fetch_add(1, Ordering::Relaxed);
            }
            self.moves = false;
            return;
        }
        self.taken = written;
        self.moves = false;
        for (channel, joint) in self.channels.iter_mut().zip(&self.shared.joints) {
            let target = joint.targets[(written & 1) as usize].load(Ordering::Relaxed);
            let before = channel.generator.is_at_rest();
            channel.generator.command(target as f64 / f64::from(SUBSTEPS));
            self.moves |= !channel.generator.is_at_rest() || !before;
        }
    }

    /// One tick. RT.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn tick(&mut self, now_ns: u64) {
        let enabled = self.shared.enabled.load(Ordering::Relaxed);
        let (mut all, mut brief) = (0, 0);
        for (number, channel) in self.channels.iter_mut().enumerate() {
            let (levels, pulses) = channel.tick();
            self.levels[number] = levels;
            all |= channel.mask(levels);
            brief |= channel.mask(pulses);
            if enabled >> number & 1 == 1 {
                all |= channel.enable;
            }
            let joint = &self.shared.joints[number];
            joint.made.store(channel.generator.made(), Ordering::Relaxed);
            if let Some(rotor) = self.port.rotor(number) {
                joint.rotor.store(rotor.to_bits(), Ordering::Relaxed);
            }
        }
        let levels = all ^ self.inverted;
        let taken = match brief {
            0 => self.port.write(now_ns, levels),
            brief => self.port.pulse(now_ns, levels, brief, self.pulse_ns),
        };
        // What was refused once may have cost a pulse, whatever comes behind it.
        if !taken {
            self.shared.failed.store(true, Ordering::Relaxed);
        }
    }

    /// Whether nothing changes before the next cycle. RT.
    pub fn is_at_rest(&self) -> bool {
        self.channels.iter().all(|channel| channel.generator.is_at_rest())
    }

    /// All ticks of a cycle at once, for time that is not that of the clock. RT.
    pub(super) fn run_cycle(&mut self, now_ns: u64, period_ns: u64) {
        self.begin_cycle();
        for tick in 0..period_ns / self.tick_ns {
            self.tick(now_ns + tick * self.tick_ns);
        }
    }
}

impl Drop for Ticker {
    /// Every line as it is without power.
    fn drop(&mut self) {
        self.port.write(0, self.inverted);
    }
}
