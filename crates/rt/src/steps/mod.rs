//! Joints with step pulses: drives in this PC, which the control leads as those on the bus.
//!
//! In:  the payloads of such drives in the output image, once a cycle.
//! Out: their payloads in the input image; levels on the pins of a port, at every tick of the base rate.
//!
//! | part | thread |
//! |---|---|
//! | [`StepDrives`]: state machine of CiA 402, targets | cycle |
//! | [`Ticker`]: pulses ([`motion::rt::dda::StepGenerator`]), levels | time-out; where time is not that of the clock, and where levels are HAL pins, the cycle's own |
//!
//! What is computed in one cycle is run through in the next, from its first tick to its last, in even pulses. A cycle that is
//! left out is a pause of the motor. Position feedback is what was sent.

mod drive;
mod ticker;

#[cfg(test)]
mod tests;

pub use ticker::Ticker;

use bus::{InputImage, NodeIndex, OutputImage};
use config::{Config, Joint, SUBSTEPS, StepKind, StepPortKind};
use drive::StepDrive;
use host::step_port::StepPort;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

/// What both threads know of a joint. Lengths in parts of a step ([`SUBSTEPS`]).
#[derive(Debug, Default)]
struct SharedJoint {
    /// Where to be at the end of the next cycle, in two places by turns.
    targets: [AtomicI64; 2],
    /// Pulses sent, those back subtracted.
    made: AtomicI64,
    /// Where the simulated motor is, steps as bits of an f64.
    rotor: AtomicU64,
}

/// What the two threads share. The thread of the pulses may run in the midst of the other's writing: it reads targets that
/// are whole, of this cycle or of the one before.
#[derive(Debug)]
struct Shared {
    joints: Box<[SharedJoint]>,
    /// Targets written so far; the last of them lie at this number modulo 2.
    written: AtomicU64,
    /// Joints whose motor has current (bit n).
    enabled: AtomicU64,
    /// Cycles without a new target while a motor moved.
    pauses: AtomicU64,
    /// The port has refused a level.
    failed: AtomicBool,
}

/// What is to be seen of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepView {
    pub joint: usize,
    pub kind: StepKind,
    /// Pulses sent, those back subtracted.
    pub counts: i64,
    /// Pulses per second in the last cycle, those back negative.
    pub frequency_hz: f64,
    pub enabled: bool,
    /// Where a simulated motor is, steps; `None`: there is none.
    pub rotor_steps: Option<f64>,
    /// Levels of its two lines.
    pub levels: [bool; 2],
}

/// The joints with step pulses, for the cycle thread.
pub struct StepDrives {
    drives: Box<[StepDrive]>,
    /// Joint of each drive, its way of telling steps, and its place in the images.
    joints: Box<[(usize, StepKind, NodeIndex)]>,
    shared: Arc<Shared>,
    /// `None`: another thread has it.
    ticker: Option<Ticker>,
    /// Levels are HAL pins.
    by_pins: bool,
    simulated: bool,
    period_ns: u64,
    made_before: Box<[i64]>,
    frequency_hz: Box<[f64]>,
}

impl StepDrives {
    /// All at rest, without current; their pulses go nowhere until there is a port.
    pub fn new(config: &Config) -> StepDrives {
        let with_steps = || {
            let joints = config.joints.iter().enumerate();
            joints.filter_map(|(number, joint)| Some((number, joint, joint.step?)))
        };
        let drives: Box<[StepDrive]> = with_steps()
            .map(|(_, joint, _)| StepDrive::new(joint, stop_parts(joint, config.cycle_us)))
            .collect();
        let shared = Arc::new(Shared {
            joints: drives.iter().map(|_| SharedJoint::default()).collect(),
            written: AtomicU64::new(0),
            enabled: AtomicU64::new(0),
            pauses: AtomicU64::new(0),
            failed: AtomicBool::new(false),
        });
        let ticker = config.steps.as_ref().map(|steps| {
            let outputs = with_steps().map(|(_, _, step)| step);
            Ticker::new(steps, outputs, Arc::clone(&shared))
        });
        let port = config.steps.as_ref().map(|steps| &steps.port);
        StepDrives {
            joints: with_steps()
                .map(|(number, joint, step)| (number, step.kind, joint.node))
                .collect(),
            shared,
            ticker,
            by_pins: port == Some(&StepPortKind::Pins),
            simulated: port == Some(&StepPortKind::Simulated),
            period_ns: u64::from(config.cycle_us) * 1000,
            made_before: drives.iter().map(|_| 0).collect(),
            frequency_hz: drives.iter().map(|_| 0.0).collect(),
            drives,
        }
    }

    /// Where the levels go from now on. Not RT.
    pub fn set_port(&mut self, port: Box<dyn StepPort + Send>) {
        if let Some(ticker) = &mut self.ticker {
            ticker.set_port(port);
        }
    }

    /// What makes the pulses, for a thread that keeps the base rate; `None`: nobody else is to. Not RT.
    pub fn take_ticker(&mut self) -> Option<Ticker> {
        match self.by_pins {
            true => None,
            false => self.ticker.take(),
        }
    }

    /// What the drives tell, behind the exchange of the bus. RT.
    pub fn read(&mut self, now_ns: u64, inputs: &mut InputImage) {
        if let Some(ticker) = &mut self.ticker {
            ticker.run_cycle(now_ns, self.period_ns);
        }
        let failed = self.shared.failed.load(Ordering::Relaxed);
        for (number, drive) in self.drives.iter_mut().enumerate() {
            let made = self.shared.joints[number].made.load(Ordering::Relaxed);
            let way = (made - self.made_before[number]) as f64;
            self.frequency_hz[number] = way * 1e9 / self.period_ns as f64;
            self.made_before[number] = made;
            let (_, _, node) = self.joints[number];
            drive.tell(made * i64::from(SUBSTEPS), failed, inputs.payload.node_mut(node));
            inputs.fresh[node] = true;
        }
    }

    /// What the drives are told, at the end of the cycle. RT.
    pub fn write(&mut self, outputs: &OutputImage) {
        if self.drives.is_empty() {
            return;
        }
        let written = self.shared.written.load(Ordering::Relaxed) + 1;
        let mut enabled = 0;
        for (number, drive) in self.drives.iter_mut().enumerate() {
            let joint = &self.shared.joints[number];
            let made = self.made_before[number] * i64::from(SUBSTEPS);
            let target = drive.obey(made, outputs.node(self.joints[number].2));
            joint.targets[(written & 1) as usize].store(target, Ordering::Relaxed);
            enabled |= u64::from(drive.has_current()) << number;
        }
        self.shared.enabled.store(enabled, Ordering::Relaxed);
        self.shared.written.store(written, Ordering::Release);
    }

    /// Cycles without a new target while a motor moved.
    pub fn pauses(&self) -> u64 {
        self.shared.pauses.load(Ordering::Relaxed)
    }

    /// How the joints are. RT.
    pub fn views(&self) -> impl Iterator<Item = StepView> {
        let levels = self.ticker.as_ref().map_or(&[][..], Ticker::levels);
        self.joints
            .iter()
            .enumerate()
            .map(move |(number, (joint, kind, _))| StepView {
                joint: *joint,
                kind: *kind,
                counts: self.made_before[number],
                frequency_hz: self.frequency_hz[number],
                enabled: self.drives[number].has_current(),
                rotor_steps: self
                    .simulated
                    .then(|| f64::from_bits(self.shared.joints[number].rotor.load(Ordering::Relaxed))),
                levels: levels.get(number).copied().unwrap_or_default(),
            })
    }

    /// Whether levels are HAL pins, and whether motors are simulated.
    pub fn kind(&self) -> (bool, bool) {
        (self.by_pins, self.simulated)
    }
}

/// How much slower a drive that stops by itself becomes from cycle to cycle, parts of a step per cycle.
fn stop_parts(joint: &Joint, cycle_us: u32) -> i64 {
    let [counts, units] = joint.counts_per_unit.map(f64::from);
    let cycle_s = f64::from(cycle_us) * 1e-6;
    let parts = joint.stop.acceleration_mm_s2 * counts / units * cycle_s * cycle_s;
    (parts.round() as i64).max(1)
}
