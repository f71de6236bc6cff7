//! The monitor, the last wall: looks at every commanded joint position before it leaves.
//!
//! In:  one position of each joint per cycle.
//! Out: greatest first, second and third differences per cycle time, how often they were over a limit, and the first joint that is far
//! over, or whose position is NaN ([`Trip`]). A command beyond travel, velocity or acceleration, or that is no number, does not
//! leave: in its place every joint comes to rest from what was sent last, within its stop limits ([`Monitor::watch`]).
//!
//! For a true motion with |jerk| <= J the third difference divided by T³ is a weighted mean of the jerk and never above
//! J, and likewise for velocity and acceleration: what is over is really over, but for rounding. RT.
//!
//! While the speed of the plan is being scaled (a hold, a stop, an override on its way), the limits of stops count.
//!
//! Nothing that is beyond its travel could stop at once, so a command is beyond it as soon as the joint could no longer come to rest
//! inside. Joints come to rest together, each as hard as it must for that, so that they stay near the straight line on which they
//! moved; one that would leave its travel on the way stops for itself.

use super::StopLimits;
use super::otg::segments::{Segments, State};

/// Limits of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorLimits {
    /// Velocity, acceleration and jerk of a plan, mm/s, mm/s², mm/s³ (degrees likewise).
    pub of_order: [f64; 3],
    /// The same while its speed is being scaled.
    pub scaling: [f64; 3],
    /// Least and greatest position, mm (degrees).
    pub travel: [f64; 2],
}

/// Greatest differences of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// Velocity, acceleration and jerk while the plan ran at a steady share of its speed.
    pub of_order: [f64; 3],
    /// Cycles over the limit of that moment, for each of them.
    pub over: [u64; 3],
}

/// What a limit is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// mm/s
    Velocity,
    /// mm/s²
    Acceleration,
    /// mm/s³
    Jerk,
}

impl Order {
    const ALL: [Order; 3] = [Order::Velocity, Order::Acceleration, Order::Jerk];

    /// Unit for a joint in mm.
    pub fn unit(self) -> &'static str {
        match self {
            Order::Velocity => "mm/s",
            Order::Acceleration => "mm/s²",
            Order::Jerk => "mm/s³",
        }
    }
}

impl std::fmt::Display for Order {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Order::Velocity => "velocity",
            Order::Acceleration => "acceleration",
            Order::Jerk => "jerk",
        })
    }
}

/// Why a command must not be followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trip {
    /// A position is NaN: there is no path any more.
    NotFinite {
        /// The joint.
        joint: usize,
    },
    /// A joint is commanded to move above a limit.
    Over {
        /// The joint.
        joint: usize,
        /// Of what.
        order: Order,
        /// Commanded, in [`Order::unit`].
        value: f64,
        /// Limit of that moment.
        limit: f64,
    },
    /// A joint is commanded to leave its travel, or moves towards its end so that it could not come to rest inside.
    Beyond {
        /// The joint.
        joint: usize,
        /// Where it would come to rest, mm (degrees).
        position: f64,
    },
}

impl Trip {
    /// Whether the command may leave all the same, as the way to rest begins with it.
    fn may_leave(&self) -> bool {
        matches!(self, Trip::Over { order: Order::Jerk, .. })
    }
}

/// Joints whose commands are watched (bit n: joint n).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watched {
    /// Those that move.
    pub moving: u64,
    /// Those whose travel counts.
    pub within_travel: u64,
}

/// Share by which a difference may pass its limit before it counts: rounding of positions.
const SLACK: f64 = 1e-6;
/// Share by which a difference may pass its limit before the machine is stopped.
const TRIP_SLACK: f64 = 0.01;
/// Cycles for which a change of scale is seen in a difference of third order.
const SCALING_SEEN: u8 = 4;
/// Rounding of a commanded position, mm.
const ROUNDING_MM: f64 = 1e-11;
/// Part of the limits of stops that a joint uses at the least to come to rest: what hardly moves stands before the others do.
const PART_MIN: f64 = 0.1;
/// The same against the travel, which a program may name to its last digit, mm.
const TRAVEL_SLACK_MM: f64 = crate::plan::TRAVEL_TOLERANCE + 1e-6;

#[derive(Clone, Copy, Debug)]
struct JointMonitor {
    limits: MonitorLimits,
    /// Last positions, the newest first.
    last: [f64; 4],
    seen: u8,
    peaks: Peaks,
    /// The way to rest, while there is one in place of commands.
    rest: Segments,
}

/// Watches all joints.
#[derive(Clone, Debug)]
pub struct Monitor {
    joints: Box<[JointMonitor]>,
    cycle_s: f64,
    /// Cycles for which the scaling of the plan's speed is still seen.
    scaling: u8,
    /// Since the way to rest began, s; `None`: commands leave as they come.
    resting_s: Option<f64>,
}

impl JointMonitor {
    /// What leaves for it.
    fn take(&mut self, position: f64) {
        let [q1, q2, q3, _] = self.last;
        self.last = [position, q1, q2, q3];
        self.seen = self.seen.saturating_add(1);
    }

    /// How the joint moves at its last position, as far as that can be told from those before it.
    fn state(&self, cycle_s: f64) -> State {
        let [q1, q2, q3, q4] = self.last;
        if self.seen < 4 {
            return State::resting(q1);
        }
        // Of constant jerk these are its differences; the mean of them lies in the middle of their cycles.
        let jerk = (q1 - 3.0 * q2 + 3.0 * q3 - q4) / cycle_s.powi(3);
        let acceleration = (q1 - 2.0 * q2 + q3) / (cycle_s * cycle_s) + jerk * cycle_s;
        let velocity = (q1 - q2) / cycle_s + cycle_s * (acceleration / 2.0 - jerk * cycle_s / 6.0);
        State {
            position: q1,
            velocity,
            acceleration,
        }
    }

    /// The shortest way to rest with a part of the limits of stops.
    fn rest_way(&self, state: State, part: f64) -> Segments {
        let [_, acceleration, jerk] = self.limits.scaling;
        let limits = StopLimits {
            acceleration: part * acceleration,
            jerk: part * part * jerk,
        };
        Segments::to_velocity(state, 0.0, limits)
    }

    /// The velocity to which what is left of the acceleration would lead it on the way to rest, if that is above its limit; `position`: the
    /// command of this cycle.
    fn too_fast(&self, position: f64, cycle_s: f64) -> Option<f64> {
        /// Part of the limit below which no acceleration leads above it in a plan.
        const NEAR: f64 = 0.5;
        let [velocity, _, jerk] = self.limits.scaling;
        if (position - self.last[0]).abs() <= NEAR * velocity * cycle_s || self.seen < 4 {
            return None;
        }
        let mut next = *self;
        next.take(position);
        let State {
            velocity: v,
            acceleration: a,
            ..
        } = next.state(cycle_s);
        let most = v.abs() + if a * v > 0.0 { a * a / (2.0 * jerk) } else { 0.0 };
        (most > velocity * (1.0 + TRIP_SLACK)).then_some(most)
    }

    /// How far positions from there to rest are beyond the travel, mm.
    fn beyond(&self, position: f64) -> f64 {
        let [low, high] = self.limits.travel;
        (low - position).max(position - high)
    }

    /// Where it would come to rest, if that is beyond its travel; `position`: the command of this cycle.
    fn beyond_travel(&self, position: f64, cycle_s: f64) -> Option<f64> {
        let [_, acceleration, jerk] = self.limits.scaling;
        let speed = (position - self.last[0]).abs() / cycle_s;
        // Most are far from there.
        let stop_s = 2.0 * (speed / acceleration + acceleration / jerk);
        if self.beyond(position) + speed * stop_s < 0.0 {
            return None;
        }
        if self.beyond(position) > TRAVEL_SLACK_MM {
            return Some(position);
        }
        let mut next = *self;
        next.take(position);
        let rest = self.rest_way(next.state(cycle_s), 1.0);
        // The state is known but for what the jerk changes in a cycle.
        let slack = TRAVEL_SLACK_MM + self.limits.of_order[2] * cycle_s * cycle_s * (rest.duration_s() + 2.0 * cycle_s);
        let end = rest.end.position;
        (self.beyond(end) > slack).then_some(end)
    }
}

impl Monitor {
    /// A monitor that has seen nothing.
    pub fn new(limits: &[MonitorLimits], cycle_s: f64) -> Monitor {
        let joints = limits
            .iter()
            .map(|&limits| JointMonitor {
                limits,
                last: [0.0; 4],
                seen: 0,
                peaks: Peaks::default(),
                rest: Segments::none(State::default()),
            })
            .collect();
        Monitor {
            joints,
            cycle_s,
            scaling: 0,
            resting_s: None,
        }
    }

    /// Nothing moves that is watched: joints stand at `positions`, or are led by somebody else. What is on its way to rest is given
    /// up. RT.
    pub fn rest_at(&mut self, positions: &[f64]) {
        self.resting_s = None;
        for (joint, &position) in self.joints.iter_mut().zip(positions) {
            (joint.last, joint.seen) = ([position; 4], 4);
        }
    }

    /// Whether commands are replaced, and joints are still on their way to rest. RT.
    pub fn is_stopping(&self) -> bool {
        self.resting_s
            .is_some_and(|time_s| self.joints.iter().any(|joint| time_s < joint.rest.duration_s()))
    }

    /// Whether commands are replaced. RT.
    pub fn holds_back(&self) -> bool {
        self.resting_s.is_some()
    }

    /// Looks at the commands of a cycle as [`Monitor::check`] does and puts in their place what may leave. From one on that must not,
    /// all joints come to rest and stay there until [`Monitor::rest_at`]. RT.
    pub fn watch(&mut self, positions: &mut [f64], watched: Watched, scaling: bool) -> Option<Trip> {
        let is_set = |set: u64, joint: usize| set >> joint & 1 == 1;
        for (index, (joint, &position)) in self.joints.iter_mut().zip(&*positions).enumerate() {
            if !is_set(watched.moving, index) {
                (joint.last, joint.seen) = ([position; 4], 4);
            }
        }
        let trip = match self.resting_s {
            Some(_) => None,
            None => match self.judge(positions, watched, scaling) {
                Some(trip) if !trip.may_leave() => Some(trip),
                jerks => self.too_fast(positions, watched).or(jerks),
            },
        };
        if trip.is_some_and(|trip| !trip.may_leave()) {
            self.come_to_rest(watched);
        }
        if let Some(time_s) = &mut self.resting_s {
            *time_s += self.cycle_s;
            for (index, (joint, position)) in self.joints.iter().zip(&mut *positions).enumerate() {
                if is_set(watched.moving, index) {
                    *position = joint.rest.at(*time_s).position;
                }
            }
        }
        for (joint, &position) in self.joints.iter_mut().zip(&*positions) {
            joint.take(position);
        }
        trip
    }

    /// The first joint that what is left of its acceleration would lead above its velocity on the way to rest.
    fn too_fast(&self, positions: &[f64], watched: Watched) -> Option<Trip> {
        let mut joints = self.joints.iter().zip(positions).enumerate();
        joints.find_map(|(index, (joint, &position))| {
            let value = joint.too_fast(position, self.cycle_s)?;
            let over = Trip::Over {
                joint: index,
                order: Order::Velocity,
                value,
                limit: joint.limits.scaling[0],
            };
            (watched.moving >> index & 1 == 1).then_some(over)
        })
    }

    /// Lays out the ways to rest.
    fn come_to_rest(&mut self, watched: Watched) {
        let cycle_s = self.cycle_s;
        let mut longest_s = 0.0_f64;
        for joint in &mut self.joints {
            joint.rest = joint.rest_way(joint.state(cycle_s), 1.0);
            longest_s = longest_s.max(joint.rest.duration_s());
        }
        for (index, joint) in self.joints.iter_mut().enumerate() {
            let duration_s = joint.rest.duration_s();
            if duration_s <= 0.0 {
                continue;
            }
            let part = (duration_s / longest_s).max(PART_MIN);
            let together = joint.rest_way(joint.state(cycle_s), part);
            let counts = watched.within_travel >> index & 1 == 1;
            if !counts
                || together
                    .extent()
                    .into_iter()
                    .all(|place| joint.beyond(place) <= TRAVEL_SLACK_MM)
            {
                joint.rest = together;
            }
        }
        self.resting_s = Some(0.0);
    }

    /// Takes the positions of a cycle, `scaling` if the plan's speed is being scaled; returns the first joint whose
    /// position is NaN, else the first one that is more than a hundredth over a limit. RT.
    pub fn check(&mut self, positions: &[f64], scaling: bool) -> Option<Trip> {
        let all = Watched {
            moving: u64::MAX,
            within_travel: 0,
        };
        let trip = self.judge(positions, all, scaling);
        for (joint, &position) in self.joints.iter_mut().zip(positions) {
            joint.take(position);
        }
        trip
    }

    /// The worst that the positions of a cycle would do: what is no number, what is beyond travel, velocity or acceleration, what is
    /// beyond jerk.
    fn judge(&mut self, positions: &[f64], watched: Watched, scaling: bool) -> Option<Trip> {
        let (mut illegal, mut beyond, mut fast, mut jerks) = (None, None, None, None);
        self.scaling = if scaling {
            SCALING_SEEN
        } else {
            self.scaling.saturating_sub(1)
        };
        let steady = self.scaling == 0;
        for (index, (joint, &position)) in self.joints.iter_mut().zip(positions).enumerate() {
            if watched.moving >> index & 1 == 0 {
                continue;
            }
            if !position.is_finite() {
                illegal = illegal.or(Some(Trip::NotFinite { joint: index }));
                continue;
            }
            let [q1, q2, q3, _] = joint.last;
            let differences = [
                position - q1,
                position - 2.0 * q1 + q2,
                position - 3.0 * q1 + 3.0 * q2 - q3,
            ];
            let mut power = 1.0;
            let known = usize::from(joint.seen.min(3));
            for (order, difference) in differences.into_iter().enumerate().take(known) {
                power *= self.cycle_s;
                let value = (difference / power).abs();
                let rounding = f64::from(1_u32 << (order + 1)) * ROUNDING_MM / power;
                let limit = if steady {
                    joint.peaks.of_order[order] = joint.peaks.of_order[order].max(value);
                    joint.limits.of_order[order]
                } else {
                    joint.limits.scaling[order]
                };
                let over = value > limit * (1.0 + SLACK) + rounding;
                joint.peaks.over[order] += u64::from(over);
                if over && value > limit * (1.0 + TRIP_SLACK) + rounding {
                    let order = Order::ALL[order];
                    let first = if order == Order::Jerk { &mut jerks } else { &mut fast };
                    *first = first.or(Some(Trip::Over {
                        joint: index,
                        order,
                        value,
                        limit,
                    }));
                }
            }
            if watched.within_travel >> index & 1 == 1
                && let Some(position) = joint.beyond_travel(position, self.cycle_s)
            {
                beyond = beyond.or(Some(Trip::Beyond { joint: index, position }));
            }
        }
        illegal.or(fast).or(beyond).or(jerks)
    }

    /// Peaks of each joint so far.
    pub fn peaks(&self) -> impl Iterator<Item = (&MonitorLimits, &Peaks)> {
        self.joints.iter().map(|joint| (&joint.limits, &joint.peaks))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rt::{MotionLimits, TrajectoryGenerator};
    use proptest::prelude::*;

    const LIMITS: MonitorLimits = MonitorLimits {
        of_order: [10.0, 100.0, 1000.0],
        scaling: [10.0, 200.0, 4000.0],
        travel: [f64::NEG_INFINITY, f64::INFINITY],
    };

    #[test]
    fn a_cubic_shows_its_jerk() {
        let mut monitor = Monitor::new(&[LIMITS], 0.01);
        for cycle in 0..20 {
            let t = f64::from(cycle) * 0.01;
            monitor.check(&[500.0 * t.powi(3) / 6.0], false);
        }
        let (_, peaks) = monitor.peaks().next().unwrap();
        assert!((peaks.of_order[2] - 500.0).abs() < 1e-3, "{peaks:?}");
        assert_eq!(peaks.over, [0, 0, 0]);
    }

    #[test]
    fn a_jump_is_over_every_limit_and_counted() {
        let mut monitor = Monitor::new(&[LIMITS], 0.01);
        for position in [0.0, 0.0, 0.0, 0.0, 1.0] {
            monitor.check(&[position], false);
        }
        assert_eq!(monitor.peaks().next().unwrap().1.over, [1, 1, 1]);
    }

    #[test]
    fn what_is_no_number_is_named() {
        let mut monitor = Monitor::new(&[LIMITS, LIMITS], 0.01);
        assert_eq!(
            monitor.check(&[0.0, f64::NAN], false),
            Some(Trip::NotFinite { joint: 1 })
        );
    }

    #[test]
    fn what_is_a_hundredth_over_trips_with_its_order_and_what_is_less_is_only_counted() {
        // One of the three limits at a time is what the motion of 500 mm/s³ passes by the given share.
        let t = 0.19;
        let motion = [500.0 * t * t / 2.0, 500.0 * t, 500.0];
        for (order, name) in [Order::Velocity, Order::Acceleration, Order::Jerk]
            .into_iter()
            .enumerate()
        {
            for (share, trips) in [(1.009, false), (1.04, true)] {
                let mut of_order = motion.map(|value| value * 1.5);
                // The difference of a cycle ends at t or before it: velocity and acceleration are a little below.
                let greatest = [500.0 * (t - 0.005_f64).powi(2) / 2.0, 500.0 * (t - 0.01), 500.0][order];
                of_order[order] = greatest / share;
                let limits = MonitorLimits {
                    of_order,
                    scaling: of_order,
                    ..LIMITS
                };
                let mut monitor = Monitor::new(&[LIMITS, limits], 0.01);
                let mut seen = None;
                for cycle in 0..20 {
                    let t = f64::from(cycle) * 0.01;
                    seen = seen.or(monitor.check(&[0.0, 500.0 * t.powi(3) / 6.0], false));
                }
                assert_eq!(seen.is_some(), trips, "{name} {share}: {seen:?}");
                assert!(monitor.peaks().nth(1).unwrap().1.over[order] > 0, "{name} {share}");
                if let Some(Trip::Over {
                    joint,
                    order,
                    value,
                    limit,
                }) = seen
                {
                    assert_eq!((joint, order), (1, name));
                    assert!(
                        value > limit * 1.01 && limit == limits.of_order[order as usize],
                        "{value} {limit}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_change_of_scale_is_judged_by_the_limits_of_stops() {
        // 3000 mm/s3: above the plan's limit, within that of stops.
        for (scaling, over) in [(false, 17), (true, 0)] {
            let mut monitor = Monitor::new(&[LIMITS], 0.01);
            for cycle in 0..20 {
                let t = f64::from(cycle) * 0.01;
                monitor.check(&[3000.0 * t.powi(3) / 6.0], scaling);
            }
            let (_, peaks) = monitor.peaks().next().unwrap();
            assert_eq!(peaks.over[2], over, "{peaks:?}");
            assert_eq!(peaks.of_order[2] > 0.0, !scaling);
        }
    }

    /// Velocity 100, acceleration 1000, jerk 20,000; stops twice and four times as hard.
    const HARD: MonitorLimits = MonitorLimits {
        of_order: [100.0, 1000.0, 20_000.0],
        scaling: [100.0, 2000.0, 80_000.0],
        travel: [-50.0, 50.0],
    };
    const T: f64 = 1e-3;
    const ALL: Watched = Watched {
        moving: u64::MAX,
        within_travel: u64::MAX,
    };

    /// A joint on its way to and fro within its limits: places in each cycle.
    fn to_and_fro(targets: &[f64]) -> Vec<f64> {
        let limits = MotionLimits {
            velocity: 100.0,
            acceleration: 1000.0,
            jerk: 20_000.0,
        };
        let stop = StopLimits {
            acceleration: 2000.0,
            jerk: 80_000.0,
        };
        let mut joint = TrajectoryGenerator::new(0.0, limits, stop, T);
        let mut places = vec![0.0];
        for &target in targets {
            joint.go_to(target, 100.0);
            while !joint.is_at_rest() {
                places.push(joint.step().position);
            }
        }
        places
    }

    /// What may go wrong with the commands of all joints from a cycle on.
    #[derive(Clone, Copy, Debug)]
    enum Wrong {
        Jump(f64),
        NotANumber,
        Frozen,
        Doubled,
        Speed(f64),
    }

    fn wrong() -> impl Strategy<Value = Wrong> {
        prop_oneof![
            (1e-6..200.0_f64).prop_map(Wrong::Jump),
            (-200.0..-1e-6_f64).prop_map(Wrong::Jump),
            Just(Wrong::NotANumber),
            Just(Wrong::Frozen),
            Just(Wrong::Doubled),
            (-300.0..300.0_f64).prop_map(Wrong::Speed),
        ]
    }

    impl Wrong {
        fn command(self, places: &[f64], cycle: usize, from: usize) -> f64 {
            let place = |cycle: usize| places[cycle.min(places.len() - 1)];
            let late = cycle - from;
            match self {
                Wrong::Jump(by) => place(cycle) + by,
                Wrong::NotANumber => f64::NAN,
                Wrong::Frozen => place(from - 1),
                Wrong::Doubled => place(from + 2 * late + 1),
                Wrong::Speed(by) => place(cycle) + by * T * (late + 1) as f64,
            }
        }
    }

    proptest! {
        #[test]
        fn whatever_is_commanded_nothing_leaves_that_is_over_a_limit(
            targets in prop::array::uniform2(prop::collection::vec(-50.0..50.0_f64, 1..4)), from in 1_usize..1500, wrong in wrong(),
            which in 0_usize..2,
        ) {
            let places = targets.map(|targets| to_and_fro(&targets));
            let from = from.min(places[which].len() - 1).max(1);
            let mut monitor = Monitor::new(&[HARD; 2], T);
            monitor.rest_at(&[0.0; 2]);
            let (mut left, mut trip) = (vec![[0.0; 2]; 4], None);
            for cycle in 1..from + 2000 {
                let mut commands = [0, 1].map(|joint| places[joint][cycle.min(places[joint].len() - 1)]);
                if cycle >= from {
                    commands[which] = wrong.command(&places[which], cycle, from);
                }
                let found = monitor.watch(&mut commands, ALL, false);
                prop_assert!(found.is_none() || cycle >= from, "{found:?} in cycle {cycle}, before {from}");
                trip = trip.or(found.filter(|trip| !trip.may_leave()));
                left.push(commands);
                let last = &left[left.len() - 4..];
                for joint in [0, 1] {
                    let [q4, q3, q2, q1] = [0, 1, 2, 3].map(|k| last[k][joint]);
                    let v = (q1 - q2) / T;
                    let a = (q1 - 2.0 * q2 + q3) / T.powi(2);
                    let [_, a_max, j_max] = if trip.is_some() { HARD.scaling } else { HARD.of_order };
                    prop_assert!(q1.is_finite() && v.abs() <= 101.0 + 1e-6, "{v} mm/s in cycle {cycle}");
                    prop_assert!(a.abs() <= a_max * 1.01 + 0.1, "{a} mm/s2 in cycle {cycle}");
                    prop_assert!((-50.01..=50.01).contains(&q1), "{q1} mm in cycle {cycle}");
                    // What the jerk was is known but for a change of it in the last cycles.
                    let j = (q1 - 3.0 * q2 + 3.0 * q3 - q4) / T.powi(3);
                    if trip.is_some() {
                        prop_assert!(j.abs() <= j_max + 3.0 * HARD.of_order[2], "{j} mm/s3 in cycle {cycle}");
                    }
                }
            }
            if trip.is_some() {
                prop_assert!(monitor.holds_back() && !monitor.is_stopping(), "at rest, and kept there");
                let [.., before, last] = &left[..] else { unreachable!() };
                prop_assert_eq!(before, last);
                monitor.rest_at(last);
                prop_assert!(!monitor.holds_back());
            }
        }
    }

    #[test]
    fn joints_that_moved_along_a_line_come_to_rest_near_it() {
        let mut monitor = Monitor::new(&[HARD, HARD], T);
        monitor.rest_at(&[0.0; 2]);
        let places = to_and_fro(&[40.0]);
        let mut last = [0.0; 2];
        for (cycle, place) in places.iter().enumerate() {
            let mut commands = [*place, 0.5 * place];
            if cycle >= 300 {
                commands[0] += 5.0;
            }
            let trip = monitor.watch(&mut commands, ALL, false);
            assert_eq!(trip.is_some(), cycle == 300, "{trip:?} in cycle {cycle}");
            last = commands;
            assert!((last[1] - 0.5 * last[0]).abs() < 0.03, "{last:?} in cycle {cycle}");
        }
        assert!(last[0] > places[300] && last[0] < places[300] + 10.0, "{last:?}");
    }

    #[test]
    fn a_joint_that_moves_towards_the_end_of_its_travel_stops_before_it() {
        let mut monitor = Monitor::new(&[HARD], T);
        monitor.rest_at(&[40.0]);
        let (mut position, mut trip) = (40.0, None);
        let ramp = to_and_fro(&[40.0]);
        for place in ramp.iter().map(|place| 40.0 + place).chain([80.0; 500]) {
            let mut commands = [place];
            trip = trip.or(monitor.watch(&mut commands, ALL, false));
            [position] = commands;
        }
        assert!(matches!(trip, Some(Trip::Beyond { joint: 0, .. })), "{trip:?}");
        assert!(position > 49.0 && position <= 50.0 + 1e-2, "{position}");
        // One that counts no travel goes on.
        let free = Watched {
            within_travel: 0,
            ..ALL
        };
        let mut monitor = Monitor::new(&[HARD], T);
        monitor.rest_at(&[40.0]);
        for place in &ramp {
            assert_eq!(monitor.watch(&mut [40.0 + place], free, false), None);
        }
    }

    #[test]
    fn a_joint_led_by_somebody_else_is_not_touched() {
        let mut monitor = Monitor::new(&[HARD, HARD], T);
        let first = Watched {
            moving: 1,
            within_travel: 3,
        };
        monitor.rest_at(&[0.0; 2]);
        for second in [0.0, 30.0, f64::NAN, -700.0] {
            let mut commands = [0.0, second];
            assert_eq!(monitor.watch(&mut commands, first, false), None);
            assert_eq!(commands[1].to_bits(), second.to_bits());
        }
        let mut commands = [f64::NAN, 3.0];
        assert_eq!(
            monitor.watch(&mut commands, first, false),
            Some(Trip::NotFinite { joint: 0 })
        );
        assert_eq!(commands, [0.0, 3.0]);
    }
}
