//! A simulated amplifier with an analog input, its motor and encoder, behind an I/O node.
//!
//! In:  command and enable output of the node. Out: the count of the encoder; where the load is.

use config::{AnalogOutput, Config, DriveMode, NodeIndex};

/// Lag of the speed loop, s.
const LAG_S: f64 = 4e-3;
/// Without power the load runs out by its friction: what is left of its speed after a millisecond.
const RUN_OUT_PER_MS: f64 = 0.95;

#[derive(Clone, Copy, Debug)]
pub(super) struct Amplifier {
    joint: usize,
    is: AnalogOutput,
    by_torque: bool,
    counts_per_mm: f64,
    /// What the rated torque accelerates with, mm/s².
    rated_mm_s2: f64,
    /// Where it stood at power-on.
    start_mm: f64,
    speed_mm_s: f64,
    way_mm: f64,
    /// The encoder has counted from there since power-on.
    zero_mm: f64,
}

impl Amplifier {
    /// Those of a node.
    pub(super) fn at_node(config: &Config, node: NodeIndex) -> impl Iterator<Item = Amplifier> {
        config.joints.iter().enumerate().filter_map(move |(number, joint)| {
            let is = joint.analog.filter(|analog| analog.node == node)?;
            let [counts, units] = joint.counts_per_unit.map(f64::from);
            let [low, high] = joint.travel_mm;
            let usual = low + config.sim.start * (high - low);
            Some(Amplifier {
                joint: number,
                is,
                by_torque: joint.mode == DriveMode::Cst,
                counts_per_mm: counts / units,
                rated_mm_s2: joint.stop.acceleration_mm_s2,
                start_mm: config
                    .sim
                    .joint(number)
                    .and_then(|special| special.start_mm)
                    .unwrap_or(usual),
                speed_mm_s: 0.0,
                way_mm: 0.0,
                zero_mm: 0.0,
            })
        })
    }

    pub(super) fn is(&self) -> &AnalogOutput {
        &self.is
    }

    /// One period; `told`: the value of the command.
    pub(super) fn advance(&mut self, told: i64, on: bool, period_s: f64) {
        let greatest = ((1_u64 << (self.is.command.bits - 1)) - 1) as f64;
        let value = told as f64 / greatest * self.is.full;
        let before = self.speed_mm_s;
        self.speed_mm_s = match (on, self.by_torque) {
            (false, _) => before * RUN_OUT_PER_MS.powf(period_s * 1e3),
            (true, false) => value + (before - value) * (-period_s / LAG_S).exp(),
            (true, true) => before + value * self.rated_mm_s2 * period_s,
        };
        self.way_mm += (before + self.speed_mm_s) / 2.0 * period_s;
    }

    /// Of the encoder.
    pub(super) fn count(&self) -> i64 {
        ((self.way_mm - self.zero_mm) * self.counts_per_mm).floor() as i64
    }

    /// Where the load of the joint is, if it is this one's.
    pub(super) fn load_mm(&self, joint: usize) -> Option<f64> {
        (joint == self.joint).then_some(self.start_mm + self.way_mm)
    }

    /// The same behind a new power-on: the load stands where it was left.
    pub(super) fn anew(&self) -> Amplifier {
        Amplifier {
            speed_mm_s: 0.0,
            zero_mm: self.way_mm,
            ..*self
        }
    }
}
