//! What set-points ask of each joint.
//!
//! In:  positions of the joints, one per cycle, as they come.
//! Out: velocity, acceleration and jerk as differences of neighbouring set-points, which is what a drive sees.
//!
//! The machine rests before the first set-point and after the last. Behind cycles that were not run, a difference is known
//! once all set-points that it takes are.

use config::Config;
use motion::canon::{Axis, Position};
use motion::kinematics::{Kinematics, ToolFrame};

/// Velocity, acceleration, jerk.
pub(super) const ORDERS: usize = 3;
/// Their names.
pub(super) const NAMES: [&str; ORDERS] = ["velocity", "acceleration", "jerk"];

/// `joint 0 (X)`, or `joint 0` where it follows no axis.
pub(super) fn joint_name(joint: usize, axis: Option<char>) -> String {
    let axis = axis.map_or_else(String::new, |axis| format!(" ({axis})"));
    format!("joint {joint}{axis}")
}

/// Excess that is rounding and not motion, as a part of the limit.
const SLACK: f64 = 1e-6;

/// Rounding of a position against the travel, mm: as much as real time lets pass.
const TRAVEL_SLACK_MM: f64 = motion::plan::TRAVEL_TOLERANCE + 1e-6;

/// One joint on its way through a program.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    /// Letter of the axis that it follows; `None`: none.
    pub(super) axis: Option<Axis>,
    /// Greatest velocity, acceleration and jerk, mm (degrees) and s.
    pub(super) limits: [f64; ORDERS],
    /// The same where a hold or a stop, or a way out of one, scales time.
    pub(super) stop_limits: [f64; ORDERS],
    /// Least and greatest position, mm or degrees.
    travel: [f64; 2],
    /// How it is told to leave its travel, if it is: there, the machine would fault.
    pub(super) beyond_travel: Option<Beyond>,
    /// The last set-points, the latest first, mm or degrees, and how many of the cycles right before the latest were run, up to
    /// [`ORDERS`].
    last: Option<([f64; ORDERS + 1], usize)>,
    /// Velocity, acceleration and jerk in the cycle that ends at the latest, as far as they are known, else 0.
    pub(super) differences: [f64; ORDERS],
    /// What is asked of it at the most.
    pub(super) peaks: Peaks,
    /// The same where stop limits hold.
    pub(super) stop_peaks: Peaks,
    /// Whether it has moved at all.
    pub(super) moves: bool,
    cycle_s: f64,
}

/// What set-points ask of a joint at the most, by order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Peaks {
    /// Greatest amounts.
    pub(super) greatest: [f64; ORDERS],
    /// Cycles over the limit.
    pub(super) over: [u64; ORDERS],
    /// Where the greatest amounts are: cycle and line.
    pub(super) at: [(u64, u32); ORDERS],
}

/// How a joint leaves its travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beyond {
    /// Where it is the farthest beyond a limit, and which.
    pub(super) value: f64,
    pub(super) limit: f64,
    /// Cycle and line.
    pub(super) at: (u64, u32),
    /// Cycles in which it is beyond one.
    pub(super) cycles: u64,
}

/// The joints of a machine, and the way to them.
pub(super) struct Joints {
    kinematics: Kinematics,
    now: Vec<f64>,
    /// Cycles for which stop limits hold yet.
    stopping: usize,
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
                stop_limits: [
                    joint.limits.velocity_mm_s,
                    joint.stop.acceleration_mm_s2,
                    joint.stop.jerk_mm_s3,
                ],
                travel: joint.travel_mm,
                beyond_travel: None,
                last: None,
                differences: [0.0; ORDERS],
                peaks: Peaks::default(),
                stop_peaks: Peaks::default(),
                moves: false,
                cycle_s: f64::from(config.cycle_us) * 1e-6,
            })
            .collect();
        Joints {
            kinematics,
            now: vec![0.0; all.len()],
            stopping: 0,
            all,
        }
    }

    /// Time is scaled in the cycle that comes: what is seen of that, in it and in those behind it, has to keep the stop limits.
    pub(super) fn scale(&mut self) {
        self.stopping = ORDERS + 1;
    }

    /// Takes the set-point of a cycle, and whether the one before it was run as well. A position that the machine cannot take
    /// leaves the joints where they are.
    pub(super) fn push(&mut self, position: &Position, frame: &ToolFrame, place: (u64, u32), follows: bool) {
        // The planner has refused such positions; and the peaks would tell of the jump behind them.
        let _ = self.kinematics.inverse(frame, &position.0, &mut self.now);
        let stops = self.take_stop();
        for (joint, position) in self.all.iter_mut().zip(&self.now) {
            joint.push(*position, place, follows, stops);
            joint.judge_travel(*position, place);
        }
    }

    /// A cycle behind the last set-point: the machine rests, and up to [`ORDERS`] cycles long there is still something to see.
    pub(super) fn rest(&mut self, place: (u64, u32)) {
        let stops = self.take_stop();
        for joint in &mut self.all {
            if let Some(([latest, ..], _)) = joint.last {
                joint.push(latest, place, true, stops);
            }
        }
    }

    /// Whether stop limits hold in this cycle.
    fn take_stop(&mut self) -> bool {
        let stops = self.stopping > 0;
        self.stopping = self.stopping.saturating_sub(1);
        stops
    }

    /// The greatest use of a limit in the latest cycle, its joint and its order.
    pub(super) fn greatest_use(&self) -> (f64, usize, usize) {
        let mut best = (0.0, 0, 0);
        for (index, joint) in self.all.iter().enumerate() {
            for (order, (difference, limit)) in joint.differences.iter().zip(&joint.limits).enumerate() {
                let used = difference.abs() / limit;
                if used > best.0 {
                    best = (used, index, order);
                }
            }
        }
        best
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

    fn push(&mut self, position: f64, place: (u64, u32), follows: bool, stops: bool) {
        let ([q1, q2, q3, _], known) = self.last.unwrap_or(([position; ORDERS + 1], ORDERS));
        let known = if follows { (known + 1).min(ORDERS) } else { 0 };
        self.moves |= position != q1;
        self.last = Some(([position, q1, q2, q3], known));
        let cycle_s = self.cycle_s;
        self.differences = [
            (position - q1) / cycle_s,
            (position - 2.0 * q1 + q2) / cycle_s.powi(2),
            (position - 3.0 * q1 + 3.0 * q2 - q3) / cycle_s.powi(3),
        ];
        self.differences[known..].fill(0.0);
        // Positions carry rounding of their own size, which differences multiply.
        let rounding = 8.0 * f64::EPSILON * position.abs().max(1.0);
        let (peaks, limits) = if stops {
            (&mut self.stop_peaks, &self.stop_limits)
        } else {
            (&mut self.peaks, &self.limits)
        };
        for (order, difference) in self.differences.into_iter().enumerate() {
            let amount = difference.abs();
            if amount > peaks.greatest[order] {
                (peaks.greatest[order], peaks.at[order]) = (amount, place);
            }
            let noise = rounding / cycle_s.powi(order as i32 + 1);
            peaks.over[order] += u64::from(amount > limits[order] * (1.0 + SLACK) + noise);
        }
    }

    fn judge_travel(&mut self, value: f64, place: (u64, u32)) {
        let [low, high] = self.travel;
        let (excess, limit) = if low - value > value - high {
            (low - value, low)
        } else {
            (value - high, high)
        };
        if excess <= TRAVEL_SLACK_MM {
            return;
        }
        let now = Beyond {
            value,
            limit,
            at: place,
            cycles: 0,
        };
        let before = self.beyond_travel;
        let farthest = before.filter(|beyond| (beyond.value - beyond.limit).abs() >= excess);
        self.beyond_travel = Some(Beyond {
            cycles: before.map_or(0, |beyond| beyond.cycles) + 1,
            ..farthest.unwrap_or(now)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint() -> Joint {
        Joint {
            axis: Some(Axis::X),
            limits: [10.0, 50.0, 1500.0],
            travel: [5.0, 7.5],
            beyond_travel: None,
            last: None,
            differences: [0.0; ORDERS],
            peaks: Peaks::default(),
            stop_limits: [10.0, 500.0, 15_000.0],
            stop_peaks: Peaks::default(),
            moves: false,
            cycle_s: 0.1,
        }
    }

    #[test]
    fn differences_reach_beyond_both_ends() {
        let mut joint = joint();
        let mut seen = Vec::new();
        for (cycle, position) in [5.0, 5.0, 6.0, 8.0, 8.0, 8.0, 8.0].into_iter().enumerate() {
            joint.push(position, (cycle as u64, 1), true, false);
            seen.push(joint.differences);
        }
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
        let peaks = joint.peaks;
        assert!((peaks.greatest[2] - 3000.0).abs() < 1e-9);
        assert_eq!((peaks.over, peaks.at[2], joint.moves), ([1, 3, 2], (4, 1), true));
    }

    #[test]
    fn the_farthest_place_beyond_the_travel_is_told() {
        let mut joint = joint();
        for (cycle, position) in [5.0, 5.0, 6.0, 7.6, 8.0, 7.6, 7.0].into_iter().enumerate() {
            joint.judge_travel(position, (cycle as u64, 1));
        }
        let beyond = Beyond {
            value: 8.0,
            limit: 7.5,
            at: (4, 1),
            cycles: 3,
        };
        assert_eq!(joint.beyond_travel, Some(beyond));
    }

    #[test]
    fn behind_cycles_that_were_not_run_nothing_is_judged_that_is_not_known() {
        let mut joint = joint();
        let mut seen = Vec::new();
        for (position, follows) in [
            (0.0, true),
            (0.5, true),
            (100.5, false),
            (101.0, true),
            (101.5, true),
            (102.0, true),
        ] {
            joint.push(position, (0, 1), follows, false);
            seen.push(joint.differences);
        }
        assert_eq!(seen[2], [0.0; 3]);
        assert_eq!(seen[3], [5.0, 0.0, 0.0]);
        assert!(seen[5][2].abs() < 1e-9);
        assert_eq!(joint.peaks.over[0], 0);
    }
}
