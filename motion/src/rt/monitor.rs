//! The monitor: looks at every commanded joint position before it leaves.
//!
//! In:  one position of each joint per cycle.
//! Out: greatest first, second and third differences per cycle time, how often they were over a limit, and what must not
//! leave: the first joint that is far over, or whose position is NaN ([`Trip`]).
//!
//! For a true motion with |jerk| <= J the third difference divided by T³ is a weighted mean of the jerk and never above
//! J, and likewise for velocity and acceleration: what is over is really over, but for rounding. RT.
//!
//! While the speed of the plan is being scaled (a hold, a stop, an override on its way), the limits of stops count.

/// Limits of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorLimits {
    /// Velocity, acceleration and jerk of a plan, mm/s, mm/s², mm/s³ (degrees likewise).
    pub of_order: [f64; 3],
    /// The same while its speed is being scaled.
    pub scaling: [f64; 3],
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
}

/// Share by which a difference may pass its limit before it counts: rounding of positions.
const SLACK: f64 = 1e-6;
/// Share by which a difference may pass its limit before the machine is stopped.
const TRIP_SLACK: f64 = 0.01;
/// Cycles for which a change of scale is seen in a difference of third order.
const SCALING_SEEN: u8 = 4;
/// Rounding of a commanded position, mm.
const ROUNDING_MM: f64 = 1e-11;

#[derive(Clone, Copy, Debug)]
struct JointMonitor {
    limits: MonitorLimits,
    /// Last positions, the newest first.
    last: [f64; 3],
    seen: u8,
    peaks: Peaks,
}

/// Watches all joints.
#[derive(Clone, Debug)]
pub struct Monitor {
    joints: Box<[JointMonitor]>,
    cycle_s: f64,
    /// Cycles for which the scaling of the plan's speed is still seen.
    scaling: u8,
}

impl Monitor {
    /// A monitor that has seen nothing.
    pub fn new(limits: &[MonitorLimits], cycle_s: f64) -> Monitor {
        let joints = limits
            .iter()
            .map(|&limits| JointMonitor {
                limits,
                last: [0.0; 3],
                seen: 0,
                peaks: Peaks::default(),
            })
            .collect();
        Monitor {
            joints,
            cycle_s,
            scaling: 0,
        }
    }

    /// Forgets the last positions, not the peaks: after a jump that is none, such as homing. RT.
    pub fn restart(&mut self) {
        for joint in &mut self.joints {
            joint.seen = 0;
        }
    }

    /// Takes the positions of a cycle, `scaling` if the plan's speed is being scaled; returns the first joint whose
    /// position is NaN, else the first one that is more than a hundredth over a limit. RT.
    pub fn check(&mut self, positions: &[f64], scaling: bool) -> Option<Trip> {
        let (mut illegal, mut fast) = (None, None);
        self.scaling = if scaling {
            SCALING_SEEN
        } else {
            self.scaling.saturating_sub(1)
        };
        let steady = self.scaling == 0;
        for (index, (joint, &position)) in self.joints.iter_mut().zip(positions).enumerate() {
            if !position.is_finite() {
                illegal = illegal.or(Some(Trip::NotFinite { joint: index }));
                continue;
            }
            let [q1, q2, q3] = joint.last;
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
                    fast = fast.or(Some(Trip::Over {
                        joint: index,
                        order: Order::ALL[order],
                        value,
                        limit,
                    }));
                }
            }
            joint.last = [position, q1, q2];
            joint.seen = joint.seen.saturating_add(1);
        }
        illegal.or(fast)
    }

    /// Peaks of each joint so far.
    pub fn peaks(&self) -> impl Iterator<Item = (&MonitorLimits, &Peaks)> {
        self.joints.iter().map(|joint| (&joint.limits, &joint.peaks))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: MonitorLimits = MonitorLimits {
        of_order: [10.0, 100.0, 1000.0],
        scaling: [10.0, 200.0, 4000.0],
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
}
