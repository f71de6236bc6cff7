//! Where a program cannot have its feed, and why.
//!
//! In:  a program that is run down, cycle by cycle.
//! Out: its slowest places, each with the joint and the limit that comes nearest there; how much of the time the feed is
//! reached; stops on the way.

use super::joints::{Joints, NAMES, ORDERS};
use super::run_down::Cycle;
use motion::plan::Programmed;
use serde::Serialize;
use std::collections::VecDeque;

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

/// A place where speed is least.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct SlowPlace {
    pub(super) line: u32,
    pub(super) time_s: f64,
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

/// How the feed was kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct FeedKept {
    /// Share of the time of feed moves in which the programmed feed is reached.
    pub(super) at_feed_share: f64,
    /// Stops between moves, where nothing is to be done at rest.
    pub(super) stops: usize,
    /// The slowest places, the slowest first.
    pub(super) slow_places: Vec<SlowPlace>,
}

/// What is known of a cycle that is judged once those behind it are known.
#[derive(Clone, Copy, Debug)]
struct Seen {
    cycle: Cycle,
    /// For how many cycles it stands: those before it that were not run are counted to it.
    cycles: u64,
    used: (f64, usize, usize),
}

/// Looks for them while a program is run down.
#[derive(Debug)]
pub(super) struct FeedWatch {
    cycle_s: f64,
    /// Lines that come, in the order of the path, and their feeds, mm/s.
    feeds: VecDeque<(u32, f64)>,
    /// The line that was last looked for, and its feed if it has one.
    line: Option<(u32, Option<f64>)>,
    /// The latest cycles: limits are used around a slow place, not just in it.
    seen: VecDeque<Seen>,
    last: Option<u64>,
    fed: u64,
    reached: u64,
    valley: Valley,
    kept: FeedKept,
}

impl FeedWatch {
    pub(super) fn new(cycle_s: f64) -> FeedWatch {
        FeedWatch {
            cycle_s,
            feeds: VecDeque::new(),
            line: None,
            seen: VecDeque::new(),
            last: None,
            fed: 0,
            reached: 0,
            valley: Valley::default(),
            kept: FeedKept::default(),
        }
    }

    /// The programmed path goes on.
    pub(super) fn push_path(&mut self, part: &Programmed) {
        if part.rapid || !part.feed.is_finite() {
            return;
        }
        // The same line may have several feeds in a row: the highest counts.
        match self.feeds.back_mut() {
            Some((line, feed)) if *line == part.line => *feed = feed.max(part.feed),
            _ => self.feeds.push_back((part.line, part.feed)),
        }
    }

    /// The next cycle, and what it asks of the joints.
    pub(super) fn push(&mut self, cycle: Cycle, joints: &Joints) {
        let cycles = self.last.replace(cycle.number).map_or(1, |last| cycle.number - last);
        let used = joints.greatest_use();
        self.seen.push_back(Seen { cycle, cycles, used });
        if self.seen.len() > ORDERS {
            self.judge(self.seen.len() - 1 - ORDERS);
        }
        if self.seen.len() > BEHIND + 1 + ORDERS {
            self.seen.pop_front();
        }
    }

    /// What was found, once the machine has rested for [`ORDERS`] cycles.
    pub(super) fn finish(mut self, joints: &Joints) -> FeedKept {
        for place in &mut self.kept.slow_places {
            place.axis = joints.all[place.joint].axis.map(|axis| axis.letter());
        }
        self.kept.at_feed_share = match self.fed {
            0 => 1.0,
            fed => self.reached as f64 / fed as f64,
        };
        self.kept
    }

    fn feed(&mut self, line: u32) -> Option<f64> {
        if let Some((known, feed)) = self.line
            && known == line
        {
            return feed;
        }
        let place = self.feeds.iter().position(|(own, _)| *own == line);
        let feed = place.map(|place| {
            self.feeds.drain(..place);
            self.feeds[0].1
        });
        self.line = Some((line, feed));
        feed
    }

    fn judge(&mut self, at: usize) {
        let Some(Seen { cycle, cycles, .. }) = self.seen.get(at).copied() else {
            return;
        };
        let feed = self.feed(cycle.line).filter(|_| cycle.moving && !cycle.rapid);
        let Some(feed) = feed else {
            self.valley = Valley::default();
            return;
        };
        let share = cycle.speed_mm_s / feed;
        self.fed += cycles;
        self.reached += if share >= REACHED { cycles } else { 0 };
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
                line: cycle.line,
                time_s: cycle.number as f64 * self.cycle_s,
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
            Some((low, _)) if low < STOP => self.kept.stops += 1,
            Some((_, place)) => self.kept.add(place),
            None => {}
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
