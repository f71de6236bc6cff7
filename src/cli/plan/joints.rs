//! What set-points ask of each joint.
//!
//! In:  positions of the joints, one per cycle.
//! Out: velocity, acceleration and jerk as differences of neighbouring set-points, which is what a drive sees.
//!
//! The machine rests before the first set-point and after the last. Behind cycles that were not run, a difference is known
//! once all set-points that it takes are.

use crate::config::Config;
use motion::canon::{Axis, Position};
use motion::kinematics::{Kinematics, ToolFrame};

/// Velocity, acceleration, jerk.
pub(super) const ORDERS: usize = 3;
/// Their names.
pub(super) const NAMES: [&str; ORDERS] = ["velocity", "acceleration", "jerk"];
/// Excess that is rounding and not motion, as a part of the limit.
const SLACK: f64 = 1e-6;

/// Rounding of a position against the travel, mm: as much as real time lets pass.
const TRAVEL_SLACK_MM: f64 = 1e-6;

/// One joint on its way through a program.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    /// Letter of the axis that it follows; `None`: none.
    pub(super) axis: Option<Axis>,
    /// Greatest velocity, acceleration and jerk, mm (degrees) and s.
    pub(super) limits: [f64; ORDERS],
    /// Least and greatest position, mm or degrees.
    travel: [f64; 2],
    /// One per cycle that was run, mm or degrees.
    pub(super) positions: Vec<f64>,
    /// For each of them, how many of the cycles right before it were run, up to [`ORDERS`].
    known: Vec<u8>,
    cycle_s: f64,
}

/// What set-points ask of a joint at the most, by order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Peaks {
    /// Greatest amounts.
    pub(super) greatest: [f64; ORDERS],
    /// Cycles over the limit.
    pub(super) over: [u64; ORDERS],
    /// Where the greatest amounts are, as places among the set-points.
    pub(super) at: [usize; ORDERS],
}

/// How a joint leaves its travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beyond {
    /// Where it is the farthest beyond a limit, and which.
    pub(super) value: f64,
    pub(super) limit: f64,
    /// Place among the set-points.
    pub(super) at: usize,
    /// Cycles in which it is beyond one.
    pub(super) cycles: u64,
}

/// The joints of a machine, and the way to them.
pub(super) struct Joints {
    kinematics: Kinematics,
    now: Vec<f64>,
    /// In the order of the machine file.
    pub(super) all: Vec<Joint>,
}

impl Joints {
    pub(super) fn new(config: &Config) -> Joints {
        let kinematics = config.kinematics();
        let all: Vec<Joint> = (config.joints.iter().enumerate())
            .map(|(index, joint)| Joint {
                axis: kinematics.joints().get(index).and_then(|follows| follows.axis),
                limits: [
                    joint.limits.velocity_mm_s,
                    joint.limits.acceleration_mm_s2,
                    joint.limits.jerk_mm_s3,
                ],
                travel: joint.travel_mm,
                positions: Vec::new(),
                known: Vec::new(),
                cycle_s: f64::from(config.cycle_us) * 1e-6,
            })
            .collect();
        Joints {
            kinematics,
            now: vec![0.0; all.len()],
            all,
        }
    }

    /// Takes the set-point of a cycle, and whether the one before it was run as well. A position that the machine cannot take
    /// leaves the joints where they are.
    pub(super) fn push(&mut self, position: &Position, frame: &ToolFrame, follows: bool) {
        // The planner has refused such positions; and the peaks would tell of the jump behind them.
        let _ = self.kinematics.inverse(frame, &position.0, &mut self.now);
        for (joint, position) in self.all.iter_mut().zip(&self.now) {
            joint.positions.push(*position);
            let before = joint
                .known
                .last()
                .map_or(ORDERS as u8, |known| (known + 1).min(ORDERS as u8));
            joint.known.push(if follows { before } else { 0 });
        }
    }
}

impl Joint {
    /// Unit of its positions.
    pub(super) fn unit(&self) -> &'static str {
        if self.axis.is_some_and(Axis::is_rotary) {
            "degrees"
        } else {
            "mm"
        }
    }

    /// Velocity, acceleration and jerk in the cycle that ends at this set-point, as far as they are known, else 0; up to three
    /// cycles behind the last one there is still something to see.
    pub(super) fn differences(&self, cycle: usize) -> [f64; ORDERS] {
        let known = self.known.get(cycle).map_or(ORDERS, |known| usize::from(*known));
        let mut differences = self.all_differences(cycle);
        differences[known..].fill(0.0);
        differences
    }

    fn all_differences(&self, cycle: usize) -> [f64; ORDERS] {
        let at = |back: usize| {
            let index = cycle.saturating_sub(back).min(self.positions.len().saturating_sub(1));
            self.positions.get(index).copied().unwrap_or(0.0)
        };
        let [q0, q1, q2, q3] = [at(0), at(1), at(2), at(3)];
        let cycle_s = self.cycle_s;
        [
            (q0 - q1) / cycle_s,
            (q0 - 2.0 * q1 + q2) / cycle_s.powi(2),
            (q0 - 3.0 * q1 + 3.0 * q2 - q3) / cycle_s.powi(3),
        ]
    }

    /// Cycles in which there is something to see.
    pub(super) fn cycles(&self) -> usize {
        self.positions.len() + ORDERS
    }

    /// What is asked of it at the most.
    pub(super) fn peaks(&self) -> Peaks {
        let mut peaks = Peaks::default();
        for cycle in 0..self.cycles() {
            let differences = self.differences(cycle);
            let position = self
                .positions
                .get(cycle)
                .or(self.positions.last())
                .copied()
                .unwrap_or(0.0);
            // Positions carry rounding of their own size, which differences multiply.
            let rounding = 8.0 * f64::EPSILON * position.abs().max(1.0);
            for (order, difference) in differences.into_iter().enumerate() {
                let amount = difference.abs();
                if amount > peaks.greatest[order] {
                    (peaks.greatest[order], peaks.at[order]) = (amount, cycle);
                }
                let noise = rounding / self.cycle_s.powi(order as i32 + 1);
                peaks.over[order] += u64::from(amount > self.limits[order] * (1.0 + SLACK) + noise);
            }
        }
        peaks
    }

    /// Whether and where it is told to leave its travel: there, the machine would fault.
    pub(super) fn beyond_travel(&self) -> Option<Beyond> {
        let [low, high] = self.travel;
        let mut beyond: Option<Beyond> = None;
        for (at, &value) in self.positions.iter().enumerate() {
            let (excess, limit) = if low - value > value - high {
                (low - value, low)
            } else {
                (value - high, high)
            };
            if excess <= TRAVEL_SLACK_MM {
                continue;
            }
            let before = beyond.map_or(0, |beyond| beyond.cycles);
            let farthest = beyond.filter(|beyond| (beyond.value - beyond.limit).abs() >= excess);
            let now = Beyond {
                value,
                limit,
                at,
                cycles: 0,
            };
            beyond = Some(Beyond {
                cycles: before + 1,
                ..farthest.unwrap_or(now)
            });
        }
        beyond
    }

    /// Whether it moves at all.
    pub(super) fn moves(&self) -> bool {
        self.positions.windows(2).any(|pair| pair[0] != pair[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_reach_beyond_both_ends() {
        let joint = Joint {
            axis: Some(Axis::X),
            limits: [10.0, 50.0, 1500.0],
            travel: [5.0, 7.5],
            positions: vec![5.0, 5.0, 6.0, 8.0],
            known: vec![3; 4],
            cycle_s: 0.1,
        };
        let seen: Vec<[f64; 3]> = (0..joint.cycles()).map(|cycle| joint.differences(cycle)).collect();
        let expected = [
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [10.0, 100.0, 1000.0],
            [20.0, 100.0, 0.0],
            [0.0, -200.0, -3000.0],
            [0.0, 0.0, 2000.0],
            [0.0, 0.0, 0.0],
        ];
        for (seen, expected) in seen.iter().flatten().zip(expected.iter().flatten()) {
            assert!((seen - expected).abs() < 1e-9, "{seen} {expected}");
        }
        let peaks = joint.peaks();
        assert!((peaks.greatest[2] - 3000.0).abs() < 1e-9);
        assert_eq!((peaks.over, peaks.at[2]), ([1, 3, 2], 4));
        let beyond = joint.beyond_travel();
        assert_eq!(
            beyond,
            Some(Beyond {
                value: 8.0,
                limit: 7.5,
                at: 3,
                cycles: 1
            })
        );
    }

    #[test]
    fn behind_cycles_that_were_not_run_nothing_is_judged_that_is_not_known() {
        let joint = Joint {
            axis: Some(Axis::X),
            limits: [10.0, 50.0, 1500.0],
            travel: [0.0, 102.0],
            positions: vec![0.0, 0.5, 100.5, 101.0, 101.5, 102.0],
            known: vec![3, 3, 0, 1, 2, 3],
            cycle_s: 0.1,
        };
        assert_eq!(joint.differences(2), [0.0; 3]);
        assert_eq!(joint.differences(3), [5.0, 0.0, 0.0]);
        assert!(joint.differences(5)[2].abs() < 1e-9);
        assert_eq!(joint.peaks().over[0], 0);
        assert_eq!(joint.beyond_travel(), None);
    }
}
