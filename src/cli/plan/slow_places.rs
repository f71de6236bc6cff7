//! Where a program cannot have its feed, and why.
//!
//! In:  a program that was run down.
//! Out: its slowest places, each with the joint and the limit that comes nearest there; how much of the time the feed is
//! reached; stops on the way.

use super::joints::{NAMES, ORDERS};
use super::run_down::Work;
use serde::Serialize;
use std::collections::HashMap;

/// Places that are told.
const PLACES: usize = 5;
/// Below this share of the feed the machine stands.
const STOP: f64 = 1e-3;
/// From this share of the feed on it is reached.
const REACHED: f64 = 0.999;
/// Speed has risen out of a slow place where it is so many times as high.
const RISE: f64 = 1.5;

/// A place where speed is least.
#[derive(Clone, Debug, PartialEq, Serialize)]
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

/// Looks for them.
pub(super) fn feed_kept(work: &Work) -> FeedKept {
    // The same line may run several times, in a loop with another feed: its highest counts.
    let mut feeds: HashMap<u32, f64> = HashMap::new();
    for part in work.path.iter().filter(|part| !part.rapid && part.feed.is_finite()) {
        let feed = feeds.entry(part.line).or_insert(part.feed);
        *feed = feed.max(part.feed);
    }
    let share = |cycle: usize| {
        let now = &work.cycles[cycle];
        let feed = feeds.get(&now.line).copied().filter(|_| now.moving && !now.rapid);
        feed.map(|feed| now.speed_mm_s / feed)
    };
    let (mut fed, mut reached, mut stops) = (0_u64, 0_u64, 0);
    let mut before = None;
    let mut lowest: Vec<(f64, usize)> = Vec::new();
    let mut valley = Valley::default();
    for cycle in 0..work.cycles.len() {
        // It stands for those before it that were not run.
        let number = work.cycles[cycle].number;
        let cycles = before.replace(number).map_or(1, |before| number - before);
        match share(cycle) {
            Some(share) => {
                fed += cycles;
                reached += if share >= REACHED { cycles } else { 0 };
                match valley.add(share, cycle) {
                    Some((low, _)) if low < STOP => stops += 1,
                    Some(place) => lowest.push(place),
                    None => {}
                }
            }
            None => valley = Valley::default(),
        }
    }
    // The first of equals, so that the list is the same everywhere.
    lowest.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut places: Vec<SlowPlace> = Vec::new();
    for (share, cycle) in lowest {
        let now = &work.cycles[cycle];
        if share < REACHED && places.iter().all(|place| place.line != now.line) {
            let (limit_share, joint, order) = nearest_limit(work, cycle);
            places.push(SlowPlace {
                line: now.line,
                time_s: now.number as f64 * work.cycle_s,
                speed_mm_s: now.speed_mm_s,
                feed_mm_s: now.speed_mm_s / share,
                feed_share: share,
                joint,
                axis: work.joints.all[joint].axis.map(|axis| axis.letter()),
                limit: NAMES[order],
                limit_share,
            });
        }
        if places.len() == PLACES {
            break;
        }
    }
    FeedKept {
        at_feed_share: if fed == 0 { 1.0 } else { reached as f64 / fed as f64 },
        stops,
        slow_places: places,
    }
}

/// The greatest use of a limit around a cycle, its joint and its order.
fn nearest_limit(work: &Work, cycle: usize) -> (f64, usize, usize) {
    let mut best = (0.0, 0, 0);
    for around in cycle.saturating_sub(2)..=cycle + ORDERS {
        for (index, joint) in work.joints.all.iter().enumerate() {
            let differences = joint.differences(around);
            for (order, (difference, limit)) in differences.iter().zip(&joint.limits).enumerate() {
                let used = difference.abs() / limit;
                if used > best.0 {
                    best = (used, index, order);
                }
            }
        }
    }
    best
}

/// Follows a speed that falls and rises, and tells of every low between two highs.
#[derive(Clone, Copy, Debug, Default)]
struct Valley {
    /// Highest since the last low that was told; 0 at the beginning, where there is no way down.
    high: f64,
    /// Lowest since then.
    low: Option<(f64, usize)>,
}

impl Valley {
    fn add(&mut self, speed: f64, at: usize) -> Option<(f64, usize)> {
        if let Some((low, place)) = self.low {
            if speed < low {
                self.low = Some((speed, at));
            } else if speed > low * RISE + STOP {
                self.low = None;
                self.high = speed;
                return Some((low, place));
            }
        } else if speed * RISE < self.high {
            self.low = Some((speed, at));
        } else {
            self.high = self.high.max(speed);
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
        let told: Vec<_> = (speeds.iter().enumerate())
            .filter_map(|(at, speed)| valley.add(*speed, at))
            .collect();
        assert_eq!(told, [(0.3, 5), (0.0, 11)]);
    }
}
