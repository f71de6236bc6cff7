//! Threshold counter of the data link layer: an error weighs 8, a good cycle takes 1 away, reaching the threshold is an event
//! and starts the count again (objects 0x1C00, 0x1C02, 0x1C07 to 0x1C09, 0x1C15 to 0x1C17).

/// What an error adds.
const ERROR_WEIGHT: u32 = 8;

/// Counter of one kind of error, as its object shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Threshold {
    /// All errors so far.
    pub cumulative: u32,
    /// Rises by 8 with an error, falls by 1 with a good cycle.
    pub count: u32,
}

impl Threshold {
    /// No error yet.
    pub const ZERO: Threshold = Threshold {
        cumulative: 0,
        count: 0,
    };

    /// Counts an error; whether the threshold is reached. A threshold of 0 never is, and leaves the count at 0.
    pub(super) fn count_error(&mut self, threshold: u32) -> bool {
        self.cumulative = self.cumulative.wrapping_add(1);
        if threshold == 0 {
            return false;
        }
        self.count = self.count.saturating_add(ERROR_WEIGHT);
        let reached = self.count >= threshold;
        if reached {
            self.count = 0;
        }
        reached
    }

    /// Counts a good cycle.
    pub(super) fn count_good(&mut self) {
        self.count = self.count.saturating_sub(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_errors_close_together_reach_fifteen() {
        let mut counter = Threshold::ZERO;
        assert!(!counter.count_error(15));
        counter.count_good();
        assert_eq!((counter.cumulative, counter.count), (1, 7));
        assert!(counter.count_error(15));
        assert_eq!((counter.cumulative, counter.count), (2, 0));
        for _ in 0..20 {
            assert!(!counter.count_error(15));
            (0..8).for_each(|_| counter.count_good());
        }
        assert_eq!((counter.cumulative, counter.count), (22, 0));
    }

    #[test]
    fn a_threshold_of_zero_only_counts() {
        let mut counter = Threshold::ZERO;
        assert!((0..1000).all(|_| !counter.count_error(0)));
        assert_eq!((counter.cumulative, counter.count), (1000, 0));
    }
}
