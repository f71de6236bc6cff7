//! Which of several files that are arriving makes room for another one.

use std::time::Duration;

/// A sender is not judged before this.
const GRACE: Duration = Duration::from_secs(5);
/// Octets a second below which it is slow: a hundredth of what a network of a shop carries.
const SLOW_PER_S: f64 = 128.0 * 1024.0;

/// Of files that have been arriving for so long and have so many octets, the one that makes room for another: the slowest, if it is
/// slow. `None`: all of them get on.
pub fn makes_room(arriving: impl IntoIterator<Item = (Duration, u64)>) -> Option<usize> {
    let rates = arriving
        .into_iter()
        .enumerate()
        .filter(|(_, (since, _))| *since >= GRACE);
    let rates = rates.map(|(at, (since, octets))| (at, octets as f64 / since.as_secs_f64()));
    let slowest = rates.min_by(|(_, a), (_, b)| a.total_cmp(b));
    slowest.filter(|(_, rate)| *rate < SLOW_PER_S).map(|(at, _)| at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slowest_goes_if_it_is_slow_and_has_had_time() {
        let s = Duration::from_secs;
        assert_eq!(makes_room([]), None);
        assert_eq!(makes_room([(s(4), 0), (s(0), 0)]), None, "they have just begun");
        assert_eq!(makes_room([(s(10), 10 << 20), (s(10), 2 << 20)]), None, "they get on");
        assert_eq!(makes_room([(s(10), 10 << 20), (s(100), 900), (s(10), 80)]), Some(2));
        assert_eq!(makes_room([(s(4), 0), (s(5), 0), (s(60), 100)]), Some(1));
    }
}
