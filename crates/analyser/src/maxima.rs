//! The greatest value of each interval of a measurement, in constant memory however long it takes.
//!
//! In:  values, each with the time since the beginning.
//! Out: at most [`INTERVALS`] maxima. When they would be more, each two neighbours become one of twice the width.

pub const INTERVALS: usize = 1024;
/// Width of an interval at first, ns.
const FIRST_WIDTH_NS: u64 = 50_000_000;

/// Maxima over time.
#[derive(Clone, Debug)]
pub(super) struct Maxima {
    width_ns: u64,
    values: Vec<u64>,
}

impl Default for Maxima {
    fn default() -> Maxima {
        Maxima {
            width_ns: FIRST_WIDTH_NS,
            values: Vec::with_capacity(INTERVALS),
        }
    }
}

impl Maxima {
    /// Takes a value in that was seen so long after the beginning.
    pub(super) fn add(&mut self, since_begin_ns: u64, value: u64) {
        while since_begin_ns / self.width_ns >= INTERVALS as u64 {
            self.halve();
        }
        let index = (since_begin_ns / self.width_ns) as usize;
        if self.values.len() <= index {
            self.values.resize(index + 1, 0);
        }
        self.values[index] = self.values[index].max(value);
    }

    /// Width of an interval, s.
    pub(super) fn width_s(&self) -> f64 {
        self.width_ns as f64 * 1e-9
    }

    /// The maxima in order of time; 0 where there was no value.
    pub(super) fn values(&self) -> &[u64] {
        &self.values
    }

    fn halve(&mut self) {
        let half = self.values.len().div_ceil(2);
        for i in 0..half {
            let (first, second) = (self.values[2 * i], self.values.get(2 * i + 1).copied());
            self.values[i] = first.max(second.unwrap_or(0));
        }
        self.values.truncate(half);
        self.width_ns = self.width_ns.saturating_mul(2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn maxima_by_hand() {
        let mut maxima = Maxima::default();
        for (at_ms, value) in [(0, 5), (49, 7), (50, 3), (149, 4), (20, 6), (250, 1)] {
            maxima.add(at_ms * 1_000_000, value);
        }
        assert_eq!((maxima.values(), maxima.width_s()), (&[7, 3, 4, 0, 0, 1][..], 0.05));
        // 1024 intervals of 50 ms are full after 51.2 s.
        maxima.add(51_199_999_999, 2);
        assert_eq!((maxima.values().len(), maxima.width_s()), (1024, 0.05));
        maxima.add(51_200_000_000, 9);
        assert_eq!((maxima.values().len(), maxima.width_s()), (513, 0.1));
        assert_eq!((&maxima.values()[..4], maxima.values()[511]), (&[7, 4, 1, 0][..], 2));
        assert_eq!(maxima.values()[512], 9);
    }

    proptest! {
        #[test]
        fn whatever_the_times_the_memory_is_bounded_and_no_maximum_is_lost(
            values in prop::collection::vec((any::<u64>(), 1u64..1000), 1..50),
        ) {
            let mut maxima = Maxima::default();
            for (at_ns, value) in &values {
                maxima.add(*at_ns, *value);
                prop_assert!(maxima.values().len() <= INTERVALS);
            }
            prop_assert_eq!(maxima.values().iter().max(), values.iter().map(|(_, value)| value).max());
        }
    }
}
