//! Where a program cannot have its feed, and why.
//!
//! In:  a program that is run down, cycle by cycle.
//! Out: its slowest places, each with its reason, the joint and the limit that comes nearest there; how much of the time the feed is
//! reached, and what limits the rest; stops on the way.

use super::joints::{Joints, NAMES, ORDERS, joint_name};
use super::judge::Cycle;
use motion::canon::Axis;
use serde::Serialize;
use std::collections::VecDeque;
use std::fmt;

/// Places that are told.
const PLACES: usize = 5;
/// Below this share of the feed the machine stands.
const STOP: f64 = 1e-3;
/// From this share of the feed on it is reached.
const REACHED: f64 = 0.999;
/// Speed has risen out of a slow place where it is so many times as high.
const RISE: f64 = 1.5;
/// Limits that are used so many cycles before a slow place may be why it is slow.
const BEHIND: usize = 2;

/// From this share of a limit on it is what limits the speed.
const USED: f64 = 0.9;
/// A corner turns by more, degrees: what turns by less is a curve that was programmed as chords.
const CORNER_DEGREES: f64 = 10.0;

/// Why the feed is not reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(super) enum Reason {
    /// The spindle leads: feed by turns (G95), a thread, a tap.
    Spindle,
    /// The programmed path has a corner there, which the tolerance does not let pass any faster.
    Corner { degrees: f64 },
    /// A limit of a joint, on a curve, or before and behind a slower place.
    Joint,
    /// The curve that is within the tolerance of short moves or of a corner is sharper than the path.
    Tolerance,
    /// The end of what is planned; or the plan leaves something.
    #[default]
    LookAhead,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::Spindle => write!(f, "spindle"),
            Reason::Corner { degrees } => write!(f, "corner of {degrees:.0} degrees"),
            Reason::Joint => write!(f, "joint"),
            Reason::Tolerance => write!(f, "tolerance"),
            Reason::LookAhead => write!(f, "look-ahead"),
        }
    }
}

/// A place where speed is least.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct SlowPlace {
    pub(super) reason: Reason,
    pub(super) line: u32,
    pub(super) time_s: f64,
    /// X, Y, Z of the machine.
    pub(super) at_mm: [f64; 3],
    pub(super) speed_mm_s: f64,
    pub(super) feed_mm_s: f64,
    pub(super) feed_share: f64,
    /// The joint that is nearest to one of its limits there.
    pub(super) joint: usize,
    pub(super) axis: Option<char>,
    /// Which limit.
    pub(super) limit: &'static str,
    /// How much of it is used.
    pub(super) limit_share: f64,
}

impl SlowPlace {
    /// What is the matter there, without the line.
    pub(super) fn in_words(&self) -> String {
        if self.feed_share < STOP {
            return format!("stop: {}", self.reason);
        }
        format!(
            "{}; limited to {:.1} % of feed ({:.2} mm/s) by {} {} ({:.0} % of its limit)",
            self.reason,
            self.feed_share * 100.0,
            self.speed_mm_s,
            joint_name(self.joint, self.axis),
            self.limit,
            self.limit_share * 100.0
        )
    }
}

/// How the feed was kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct FeedKept {
    /// Share of the time of feed moves in which the programmed feed is reached.
    pub(super) at_feed_share: f64,
    /// Stops between moves, where nothing is to be done at rest.
    pub(super) stops: usize,
    /// The slowest places, the slowest first.
    pub(super) slow_places: Vec<SlowPlace>,
    /// The first stops.
    pub(super) stop_places: Vec<SlowPlace>,
    /// What limits the speed of feed moves, seconds: the feed itself; a limit of a joint; something else, before and behind corners
    /// mostly.
    pub(super) limited_by: Vec<LimitedBy>,
}

/// For how long something limits the speed of feed moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct LimitedBy {
    /// `feed`, `velocity`, `acceleration`, `jerk` or `other`.
    pub(super) what: &'static str,
    pub(super) joint: Option<usize>,
    pub(super) axis: Option<char>,
    pub(super) time_s: f64,
}

/// What is known of a cycle that is judged once those behind it are known.
#[derive(Clone, Copy, Debug)]
struct Seen {
    cycle: Cycle,
    /// For how many cycles it stands: those before it that were not run are counted to it.
    cycles: u64,
    used: (f64, usize, usize),
    on: On,
}

/// What the machine is on in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct On {
    /// As programmed and overridden, mm/s; `None`: no move at feed, or none that may move.
    pub(super) feed: Option<f64>,
    /// Whether the spindle decides how fast.
    pub(super) by_spindle: bool,
    /// Whether it is a curve that smoothing has put in place of programmed moves.
    pub(super) smoothed: bool,
    /// Sharpest corner of the programmed path at either end of its line.
    pub(super) corner_degrees: f64,
}

/// Looks for them while a program is run down.
#[derive(Debug)]
pub(super) struct FeedWatch {
    cycle_s: f64,
    /// The latest cycles: limits are used around a slow place, not just in it.
    seen: VecDeque<Seen>,
    last: Option<u64>,
    fed: u64,
    reached: u64,
    /// Cycles in which a limit is used, by joint and order.
    limited: Vec<[u64; ORDERS]>,
    valley: Valley,
    kept: FeedKept,
}

impl FeedWatch {
    pub(super) fn new(cycle_s: f64) -> FeedWatch {
        FeedWatch {
            cycle_s,
            seen: VecDeque::new(),
            last: None,
            fed: 0,
            reached: 0,
            limited: Vec::new(),
            valley: Valley::default(),
            kept: FeedKept::default(),
        }
    }

    /// The next cycle, and what it asks of the joints.
    pub(super) fn push(&mut self, cycle: Cycle, on: On, joints: &Joints) {
        let cycles = self.last.replace(cycle.number).map_or(1, |last| cycle.number - last);
        let used = joints.greatest_use();
        self.seen.push_back(Seen {
            cycle,
            cycles,
            used,
            on,
        });
        if self.seen.len() > ORDERS {
            self.judge(self.seen.len() - 1 - ORDERS);
        }
        if self.seen.len() > BEHIND + 1 + ORDERS {
            self.seen.pop_front();
        }
    }

    /// What was found, once the machine has rested for [`ORDERS`] cycles.
    pub(super) fn finish(mut self, joints: &Joints) -> FeedKept {
        let letter = |joint: usize| joints.all[joint].axis.map(|axis| axis.letter());
        let FeedKept {
            slow_places,
            stop_places,
            ..
        } = &mut self.kept;
        for place in slow_places.iter_mut().chain(stop_places) {
            place.axis = letter(place.joint);
        }
        self.kept.at_feed_share = match self.fed {
            0 => 1.0,
            fed => self.reached as f64 / fed as f64,
        };
        let seconds = |cycles: u64| cycles as f64 * self.cycle_s;
        let of_joints = self.limited.iter().enumerate().flat_map(|(joint, orders)| {
            (0..ORDERS).map(move |order| LimitedBy {
                what: NAMES[order],
                joint: Some(joint),
                axis: letter(joint),
                time_s: seconds(orders[order]),
            })
        });
        let used: u64 = self.limited.iter().flatten().sum();
        let plain = |what, cycles| LimitedBy {
            what,
            joint: None,
            axis: None,
            time_s: seconds(cycles),
        };
        let mut limited_by: Vec<LimitedBy> = of_joints
            .chain([
                plain("feed", self.reached),
                plain("other", self.fed - self.reached - used),
            ])
            .filter(|by| by.time_s > 0.0)
            .collect();
        limited_by.sort_by(|a, b| b.time_s.total_cmp(&a.time_s));
        self.kept.limited_by = limited_by;
        self.kept
    }

    fn judge(&mut self, at: usize) {
        let Some(Seen {
            cycle,
            cycles,
            used,
            on,
        }) = self.seen.get(at).copied()
        else {
            return;
        };
        let Some(feed) = on.feed.filter(|_| cycle.moving && !cycle.rapid) else {
            self.valley = Valley::default();
            return;
        };
        let share = cycle.speed_mm_s / feed;
        self.fed += cycles;
        if share >= REACHED {
            self.reached += cycles;
        } else if let (part, joint, order) = used
            && part >= USED
        {
            self.limited.resize(self.limited.len().max(joint + 1), [0; ORDERS]);
            self.limited[joint][order] += cycles;
        }
        let nearest_limit = || {
            let around = self
                .seen
                .range(at.saturating_sub(BEHIND)..self.seen.len().min(at + ORDERS + 1));
            around
                .map(|seen| seen.used)
                .fold((0.0, 0, 0), |best, used| if used.0 > best.0 { used } else { best })
        };
        let place = || {
            let (limit_share, joint, order) = nearest_limit();
            SlowPlace {
                reason: on.reason(share < STOP, limit_share),
                line: cycle.line,
                time_s: cycle.number as f64 * self.cycle_s,
                at_mm: [Axis::X, Axis::Y, Axis::Z].map(|axis| cycle.position[axis]),
                speed_mm_s: cycle.speed_mm_s,
                feed_mm_s: feed,
                feed_share: share,
                joint,
                axis: None,
                limit: NAMES[order],
                limit_share,
            }
        };
        match self.valley.add(share, place) {
            Some((low, place)) if low < STOP => {
                self.kept.stops += 1;
                if self.kept.stop_places.len() < PLACES {
                    self.kept.stop_places.push(place);
                }
            }
            Some((_, place)) => self.kept.add(place),
            None => {}
        }
    }
}

impl On {
    /// Why the speed has a low there.
    fn reason(&self, stops: bool, limit_share: f64) -> Reason {
        let degrees = self.corner_degrees;
        match self {
            _ if self.by_spindle => Reason::Spindle,
            _ if (stops || self.smoothed) && degrees >= CORNER_DEGREES => Reason::Corner { degrees },
            _ if self.smoothed => Reason::Tolerance,
            _ if limit_share >= USED && !stops => Reason::Joint,
            _ => Reason::LookAhead,
        }
    }
}

impl FeedKept {
    /// Keeps the slowest places, one a line; the first of equals, so that the list is the same everywhere.
    fn add(&mut self, place: SlowPlace) {
        if place.feed_share >= REACHED {
            return;
        }
        let places = &mut self.slow_places;
        match places.iter().position(|own| own.line == place.line) {
            Some(own) if places[own].feed_share <= place.feed_share => return,
            Some(own) => drop(places.remove(own)),
            None => {}
        }
        let at = places.partition_point(|own| own.feed_share <= place.feed_share);
        places.insert(at, place);
        places.truncate(PLACES);
    }
}

/// Follows a speed that falls and rises, and tells of every low between two highs.
#[derive(Clone, Debug, Default)]
struct Valley {
    /// Highest since the last low that was told; 0 at the beginning, where there is no way down.
    high: f64,
    /// Lowest since then.
    low: Option<(f64, SlowPlace)>,
}

impl Valley {
    fn add(&mut self, speed: f64, place: impl FnOnce() -> SlowPlace) -> Option<(f64, SlowPlace)> {
        match &self.low {
            Some((low, _)) if speed < *low => self.low = Some((speed, place())),
            Some((low, _)) if speed > low * RISE + STOP => {
                self.high = speed;
                return self.low.take();
            }
            Some(_) => {}
            None if speed * RISE < self.high => self.low = Some((speed, place())),
            None => self.high = self.high.max(speed),
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_low_is_told_once_and_starts_and_ends_are_none() {
        let mut valley = Valley::default();
        let speeds = [0.0, 0.5, 1.0, 0.9, 0.4, 0.3, 0.35, 0.8, 0.7, 1.0, 0.5, 0.0, 0.6, 0.2];
        let told: Vec<_> = (1..)
            .zip(speeds)
            .filter_map(|(line, speed)| {
                let place = || SlowPlace {
                    line,
                    ..SlowPlace::default()
                };
                valley.add(speed, place)
            })
            .map(|(low, place)| (low, place.line))
            .collect();
        assert_eq!(told, [(0.3, 6), (0.0, 12)]);
    }

    #[test]
    fn the_slowest_place_of_a_line_is_kept_and_of_equals_the_first() {
        let mut kept = FeedKept::default();
        let places = [
            (1, 0.5),
            (2, 0.2),
            (1, 0.3),
            (1, 0.4),
            (3, 0.2),
            (4, 0.9999),
            (5, 0.6),
            (6, 0.7),
            (7, 0.1),
        ];
        for (line, feed_share) in places {
            kept.add(SlowPlace {
                line,
                feed_share,
                ..SlowPlace::default()
            });
        }
        let lines: Vec<u32> = kept.slow_places.iter().map(|place| place.line).collect();
        assert_eq!(lines, [7, 2, 3, 1, 5]);
    }
}
