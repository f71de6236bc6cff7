//! What lies along the way of one joint: limit switches, home switch, zero marks, hard stops.
//!
//! In:  the joint of the machine file: travel, homing method, position of the home point or of the home switch.
//! Out: positions in machine counts, laid so that homing finds the home point, or the switch, where the file says.

use config::{HomingBy, HomingByControl, Joint, SimJoint};

/// From the end of the travel to the limit switch, mm.
const LIMIT_MARGIN_MM: f64 = 2.0;
/// From the limit switch to the hard stop, mm.
const STOP_MARGIN_MM: f64 = 5.0;
/// Length of a home switch that is not as long as its side of the machine, mm.
const HOME_LENGTH_MM: f64 = 4.0;
/// Travel in one turn of the motor: from zero mark to zero mark, mm.
const TURN_MM: f64 = 5.0;

/// Positions in machine counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Track {
    /// Where the joint stands at power-on.
    pub(super) start: i64,
    /// The negative limit switch is active up to here.
    pub(super) negative_limit: i64,
    /// The positive limit switch is active from here.
    pub(super) positive_limit: i64,
    /// The home switch is active from here to there.
    pub(super) home: (i64, i64),
    /// Any zero mark.
    pub(super) mark: i64,
    /// From one zero mark to the next; above 0.
    pub(super) mark_distance: i64,
    /// Hard stop on the negative side.
    pub(super) stop_low: i64,
    /// Hard stop on the positive side.
    pub(super) stop_high: i64,
}

/// Which end of which switch a homing method looks for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Edge {
    NegativeLimit,
    PositiveLimit,
    HomeLeft,
    HomeRight,
}

/// How far the home switch reaches from its edge.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reach {
    Short,
    ToTheEnd,
}

/// For the methods 1 to 14, and 17 to 30 less 16: edge, direction in which it is crossed at last, reach of the switch.
const METHODS: [(Edge, f64, Reach); 14] = [
    (Edge::NegativeLimit, 1.0, Reach::Short),
    (Edge::PositiveLimit, -1.0, Reach::Short),
    (Edge::HomeLeft, -1.0, Reach::ToTheEnd),
    (Edge::HomeLeft, 1.0, Reach::ToTheEnd),
    (Edge::HomeRight, 1.0, Reach::ToTheEnd),
    (Edge::HomeRight, -1.0, Reach::ToTheEnd),
    (Edge::HomeLeft, -1.0, Reach::Short),
    (Edge::HomeLeft, 1.0, Reach::Short),
    (Edge::HomeRight, -1.0, Reach::Short),
    (Edge::HomeRight, 1.0, Reach::Short),
    (Edge::HomeRight, 1.0, Reach::Short),
    (Edge::HomeRight, -1.0, Reach::Short),
    (Edge::HomeLeft, 1.0, Reach::Short),
    (Edge::HomeLeft, -1.0, Reach::Short),
];

impl Track {
    /// The track of a joint; `start` is the position at power-on as a share of the travel. `special` has the last word.
    pub(super) fn for_joint(joint: &Joint, start: f64, special: Option<&SimJoint>) -> Track {
        let mut track = match joint.homing.by {
            HomingBy::Drive { method, .. } => Track::by_drive(joint, method, start),
            HomingBy::Control(HomingByControl {
                towards_positive,
                switch_mm,
                index,
                ..
            }) => {
                let switch_mm = special.and_then(|special| special.switch_mm).unwrap_or(switch_mm);
                // The zero mark lies behind the switch, half of the way within which it is looked for.
                let before_mm = index.map_or(0.0, |index| index.distance_mm.min(TURN_MM) / 2.0);
                Track::by_control(joint, towards_positive, switch_mm, before_mm, start)
            }
        };
        if let Some(start_mm) = special.and_then(|special| special.start_mm) {
            track.start = mm_to_counts(joint, start_mm).round() as i64;
        }
        track
    }

    /// The same places for a motor with so many increments for a count.
    pub(super) fn in_increments(self, of_count: f64) -> Track {
        let increments = |counts: i64| (counts as f64 * of_count).round() as i64;
        Track {
            start: increments(self.start),
            negative_limit: increments(self.negative_limit),
            positive_limit: increments(self.positive_limit),
            home: (increments(self.home.0), increments(self.home.1)),
            mark: increments(self.mark),
            mark_distance: increments(self.mark_distance).max(1),
            stop_low: increments(self.stop_low),
            stop_high: increments(self.stop_high),
        }
    }

    /// What turns has no ends and no switches.
    pub(super) fn endless(counts_per_turn: i64) -> Track {
        /// Further than anything turns.
        const FAR: i64 = i64::MAX / 4;
        Track {
            start: 0,
            negative_limit: -FAR,
            positive_limit: FAR,
            home: (-FAR, -FAR),
            mark: 0,
            mark_distance: counts_per_turn.max(1),
            stop_low: -FAR,
            stop_high: FAR,
        }
    }

    /// The home switch is closed from its place to the end; the limit switches lie beyond it and the travel.
    fn by_control(joint: &Joint, towards_positive: bool, mark_mm: f64, before_mm: f64, start: f64) -> Track {
        let switch_mm = mark_mm - if towards_positive { before_mm } else { -before_mm };
        let counts = |mm: f64| mm_to_counts(joint, mm).round() as i64;
        let [low_mm, high_mm] = joint.travel_mm;
        let negative_mm = low_mm.min(mark_mm) - LIMIT_MARGIN_MM;
        let positive_mm = high_mm.max(mark_mm) + LIMIT_MARGIN_MM;
        let (stop_low, stop_high) = (
            counts(negative_mm - STOP_MARGIN_MM),
            counts(positive_mm + STOP_MARGIN_MM),
        );
        Track {
            start: counts(low_mm + start * (high_mm - low_mm)),
            negative_limit: counts(negative_mm),
            positive_limit: counts(positive_mm),
            home: if towards_positive {
                (counts(switch_mm), stop_high)
            } else {
                (stop_low, counts(switch_mm))
            },
            mark: counts(mark_mm),
            mark_distance: counts(TURN_MM).max(1),
            stop_low,
            stop_high,
        }
    }

    fn by_drive(joint: &Joint, method: i8, start: f64) -> Track {
        let counts = |mm: f64| mm_to_counts(joint, mm).round() as i64;
        let [low_mm, high_mm] = joint.travel_mm;
        let point_mm = joint.homing.position_mm;
        let (number, to_mark_mm) = match method {
            method @ 1..=14 => (method, TURN_MM / 2.0),
            method @ 17..=30 => (method - 16, 0.0),
            // Without a switch: any; it lies at the home point.
            _ => (7, 0.0),
        };
        let (edge, direction, reach) = METHODS[usize::from(number.unsigned_abs()) - 1];
        let edge_mm = point_mm - direction * to_mark_mm;
        let negative_mm = if edge == Edge::NegativeLimit {
            edge_mm
        } else {
            low_mm - LIMIT_MARGIN_MM
        };
        let positive_mm = if edge == Edge::PositiveLimit {
            edge_mm
        } else {
            high_mm + LIMIT_MARGIN_MM
        };
        let (stop_low_mm, stop_high_mm) = (negative_mm - STOP_MARGIN_MM, positive_mm + STOP_MARGIN_MM);
        let home_mm = match (edge, reach) {
            (Edge::HomeLeft, Reach::ToTheEnd) => (edge_mm, stop_high_mm),
            (Edge::HomeLeft, Reach::Short) => (edge_mm, edge_mm + HOME_LENGTH_MM),
            (Edge::HomeRight, Reach::ToTheEnd) => (stop_low_mm, edge_mm),
            (Edge::HomeRight, Reach::Short) => (edge_mm - HOME_LENGTH_MM, edge_mm),
            (Edge::NegativeLimit | Edge::PositiveLimit, _) => (point_mm, point_mm),
        };
        let start_mm = match method {
            // Home is where the joint stands: whoever homes it has put it there.
            35 | 37 => point_mm,
            _ => low_mm + start * (high_mm - low_mm),
        };
        Track {
            start: counts(start_mm),
            negative_limit: counts(negative_mm),
            positive_limit: counts(positive_mm),
            home: (counts(home_mm.0), counts(home_mm.1)),
            mark: counts(point_mm),
            mark_distance: counts(TURN_MM).max(1),
            stop_low: counts(stop_low_mm),
            stop_high: counts(stop_high_mm),
        }
    }

    /// The zero mark that is passed on the way from one position to another: the first of them, if there are more.
    pub(super) fn mark_between(&self, from: i64, to: i64) -> Option<i64> {
        let turn = |position: i64| (position - self.mark).div_euclid(self.mark_distance);
        let (start, end) = (turn(from), turn(to));
        if end > start {
            Some(self.mark + (start + 1) * self.mark_distance)
        } else if end < start {
            Some(self.mark + start * self.mark_distance)
        } else {
            None
        }
    }
}

/// Drive increments of a length.
pub(super) fn mm_to_counts(joint: &Joint, mm: f64) -> f64 {
    mm * f64::from(joint.counts_per_unit[0]) / f64::from(joint.counts_per_unit[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_config;

    #[test]
    fn the_demo_machines_switches_lie_where_its_homing_methods_need_them() {
        let config = test_config();
        let x = Track::for_joint(&config.joints[0], 0.5, None);
        assert_eq!((x.negative_limit, x.positive_limit), (-70_000, 3_070_000));
        assert_eq!(
            x.home,
            (-120_000, 0),
            "method 21: active on the whole negative side, up to machine zero"
        );
        assert_eq!((x.start, x.stop_low, x.stop_high), (1_500_000, -120_000, 3_120_000));
        let z = Track::for_joint(&config.joints[2], 0.0, None);
        assert_eq!(
            z.home,
            (0, 40_000),
            "method 23: a short switch whose left edge is machine zero"
        );
        assert_eq!(
            (z.start, z.negative_limit, z.positive_limit),
            (-1_050_000, -1_070_000, 70_000)
        );
    }

    #[test]
    fn the_zero_mark_behind_the_edge_is_the_home_point() {
        let mut joint = test_config().joints[0].clone();
        joint.homing.position_mm = 7.0;
        for (method, edge) in [
            (1, 45_000),
            (2, 95_000),
            (5, 45_000),
            (6, 95_000),
            (3, 95_000),
            (10, 45_000),
        ] {
            joint.homing.by = HomingBy::Drive {
                method,
                acceleration_mm_s2: 500.0,
            };
            let track = Track::for_joint(&joint, 0.5, None);
            let edges = [track.negative_limit, track.positive_limit, track.home.0, track.home.1];
            assert!(edges.contains(&edge), "method {method}: {edges:?}");
            let beyond = edge + if edge < 70_000 { 30_000 } else { -30_000 };
            assert_eq!(track.mark_between(edge, beyond), Some(70_000));
        }
    }

    #[test]
    fn a_home_switch_for_the_control_reaches_from_its_place_to_the_end() {
        let mut joint = test_config().joints[0].clone();
        let mut control = HomingByControl {
            towards_positive: false,
            switch: config::HomeSwitch::Drive,
            switch_mm: -8.0,
            search_distance_mm: 400.0,
            release_distance_mm: 5.0,
            resolution_mm: 1e-3,
            bounce_s: 0.02,
            skew_mm: None,
            index: None,
        };
        joint.homing.by = HomingBy::Control(control);
        let track = Track::for_joint(&joint, 0.5, None);
        // The limit switch lies behind it.
        assert_eq!((track.home, track.negative_limit), ((-150_000, -80_000), -100_000));
        control.towards_positive = true;
        joint.homing.by = HomingBy::Control(control);
        let special = SimJoint {
            joint: 0,
            start_mm: Some(12.0),
            switch_mm: Some(306.0),
            input: None,
        };
        let track = Track::for_joint(&joint, 0.5, Some(&special));
        assert_eq!((track.home, track.positive_limit), ((3_060_000, 3_130_000), 3_080_000));
        assert_eq!(track.start, 120_000);
    }

    #[test]
    fn marks_are_passed_both_ways_and_counted_once() {
        let track = Track {
            mark: 150,
            mark_distance: 400,
            ..Track::for_joint(&test_config().joints[0], 0.5, None)
        };
        let passed = |path: &[i64]| -> Vec<i64> {
            path.windows(2)
                .filter_map(|step| track.mark_between(step[0], step[1]))
                .collect()
        };
        assert_eq!(passed(&[100, 149, 150, 151, 550]), [150, 550]);
        assert_eq!(passed(&[551, 550, 549, 149]), [550, 150]);
        assert_eq!(passed(&[-650, -650, -251, -250]), [-250]);
    }
}
