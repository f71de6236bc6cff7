//! Statistics of times in constant memory: how far a value is from its nominal, over any number of values.
//!
//! In:  one value a cycle from the cycle thread, or one SoC-to-SoC period a frame from the analyser, ns.
//! Out: [`Summary`] and the filled buckets, to reports and plots.

use serde::{Deserialize, Serialize};

/// Deviations below this are counted exactly, one bucket per nanosecond.
const EXACT: u64 = 1 << (SUB_BITS + 1);
/// Above, each power of two is divided into this many buckets: a bucket is at most 1/32 of its value wide.
const SUB_BITS: u32 = 5;
/// Deviations end at 2^34 ns = 17 s; the last bucket also takes all beyond.
const TOP_BITS: u32 = 34;
const BUCKETS: usize = EXACT as usize + ((TOP_BITS - SUB_BITS - 1) as usize) * (1 << SUB_BITS);

/// Count, mean, extremes, standard deviation and distribution of values around a nominal.
#[derive(Clone, Debug)]
pub struct Jitter {
    nominal_ns: u64,
    n: u64,
    /// Mean of the deviations and sum of their squared distances from it (Welford).
    mean_ns: f64,
    m2_ns2: f64,
    min_ns: i64,
    max_ns: i64,
    early: [u64; BUCKETS],
    late: [u64; BUCKETS],
}

/// What is known of the values; times in µs. All zero if there were none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of values.
    pub n: u64,
    pub mean_us: f64,
    /// Standard deviation (of the population).
    pub std_us: f64,
    pub min_us: f64,
    pub max_us: f64,
    /// Greatest minus least.
    pub range_us: f64,
    /// Half of the values are at or below this; read from buckets, at most 1/32 of the deviation too high.
    pub p50_us: f64,
    /// As `p50_us`, for 90 %.
    pub p90_us: f64,
    /// As `p50_us`, for 99 %.
    pub p99_us: f64,
    /// As `p50_us`, for 99.9 %.
    pub p99_9_us: f64,
    /// As `p50_us`, for 99.99 %.
    pub p99_99_us: f64,
}

/// One filled bucket: deviations from `from_ns` to `to_ns`, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bucket {
    /// Least deviation from the nominal.
    pub from_ns: i64,
    pub to_ns: i64,
    /// Values in it.
    pub count: u64,
}

impl Jitter {
    /// Statistics around a nominal; 0 for latenesses.
    pub fn new(nominal_ns: u64) -> Jitter {
        Jitter {
            nominal_ns,
            n: 0,
            mean_ns: 0.0,
            m2_ns2: 0.0,
            min_ns: i64::MAX,
            max_ns: i64::MIN,
            early: [0; BUCKETS],
            late: [0; BUCKETS],
        }
    }

    /// RT: takes a value in. No allocation, constant time.
    pub fn record(&mut self, value_ns: u64) {
        // Times are far below 2^63 ns; a wild value saturates.
        let deviation = i64::try_from(i128::from(value_ns) - i128::from(self.nominal_ns)).unwrap_or(i64::MAX);
        self.n += 1;
        let from_mean = deviation as f64 - self.mean_ns;
        self.mean_ns += from_mean / self.n as f64;
        self.m2_ns2 += from_mean * (deviation as f64 - self.mean_ns);
        self.min_ns = self.min_ns.min(deviation);
        self.max_ns = self.max_ns.max(deviation);
        let side = if deviation < 0 { &mut self.early } else { &mut self.late };
        side[bucket(deviation.unsigned_abs())] += 1;
    }

    /// RT: forgets all values.
    pub fn clear(&mut self) {
        let Jitter {
            nominal_ns: _,
            n,
            mean_ns,
            m2_ns2,
            min_ns,
            max_ns,
            early,
            late,
        } = self;
        (*n, *mean_ns, *m2_ns2, *min_ns, *max_ns) = (0, 0.0, 0.0, i64::MAX, i64::MIN);
        early.fill(0);
        late.fill(0);
    }

    /// Number of values.
    pub fn n(&self) -> u64 {
        self.n
    }

    /// RT: greatest value so far, ns; `None` before the first.
    pub fn max_ns(&self) -> Option<u64> {
        (self.n > 0).then(|| self.nominal_ns.saturating_add_signed(self.max_ns))
    }

    /// What the values are measured against, ns.
    pub fn nominal_ns(&self) -> u64 {
        self.nominal_ns
    }

    /// Least value that at least `quantile` (0 to 1) of all values are not above, ns, to the width of a bucket.
    pub fn value_at_quantile(&self, quantile: f64) -> u64 {
        if self.n == 0 {
            return 0;
        }
        let wanted = ((quantile * self.n as f64).ceil() as u64).clamp(1, self.n);
        let mut seen = 0;
        let mut deviation = self.max_ns;
        for bucket in self.buckets() {
            seen += bucket.count;
            if seen >= wanted {
                deviation = bucket.to_ns.clamp(self.min_ns, self.max_ns);
                break;
            }
        }
        self.nominal_ns.saturating_add_signed(deviation)
    }

    /// The buckets that hold values, from the earliest to the latest.
    pub fn buckets(&self) -> impl Iterator<Item = Bucket> + '_ {
        let early = (0..BUCKETS).rev().map(|i| Bucket {
            from_ns: -last(i),
            to_ns: -first(i),
            count: self.early[i],
        });
        let late = (0..BUCKETS).map(|i| Bucket {
            from_ns: first(i),
            to_ns: last(i),
            count: self.late[i],
        });
        early.chain(late).filter(|bucket| bucket.count > 0)
    }

    pub fn summary(&self) -> Summary {
        if self.n == 0 {
            return Summary::default();
        }
        let us = |deviation_ns: f64| (self.nominal_ns as f64 + deviation_ns) / 1000.0;
        let quantile = |quantile| self.value_at_quantile(quantile) as f64 / 1000.0;
        Summary {
            n: self.n,
            mean_us: us(self.mean_ns),
            std_us: (self.m2_ns2 / self.n as f64).max(0.0).sqrt() / 1000.0,
            min_us: us(self.min_ns as f64),
            max_us: us(self.max_ns as f64),
            range_us: (self.max_ns as f64 - self.min_ns as f64) / 1000.0,
            p50_us: quantile(0.5),
            p90_us: quantile(0.9),
            p99_us: quantile(0.99),
            p99_9_us: quantile(0.999),
            p99_99_us: quantile(0.9999),
        }
    }
}

/// RT: the bucket of a deviation without its sign.
fn bucket(deviation: u64) -> usize {
    if deviation < EXACT {
        return deviation as usize;
    }
    let octave = deviation.ilog2();
    if octave >= TOP_BITS {
        return BUCKETS - 1;
    }
    let sub = (deviation >> (octave - SUB_BITS)) as usize & ((1 << SUB_BITS) - 1);
    EXACT as usize + ((octave - SUB_BITS - 1) as usize) * (1 << SUB_BITS) + sub
}

/// Least deviation in a bucket.
fn first(bucket: usize) -> i64 {
    if bucket < EXACT as usize {
        return bucket as i64;
    }
    let above = bucket - EXACT as usize;
    let octave = (above >> SUB_BITS) as u32 + SUB_BITS + 1;
    let sub = (above & ((1 << SUB_BITS) - 1)) as i64;
    (1 << octave) + (sub << (octave - SUB_BITS))
}

/// Greatest deviation in a bucket.
fn last(bucket: usize) -> i64 {
    if bucket == BUCKETS - 1 {
        i64::MAX
    } else {
        first(bucket + 1) - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn buckets_join_without_gaps() {
        for i in 0..BUCKETS - 1 {
            assert_eq!(bucket(first(i) as u64), i);
            assert_eq!(bucket(last(i) as u64), i);
            assert_eq!(last(i) + 1, first(i + 1));
        }
        assert_eq!(bucket(u64::MAX), BUCKETS - 1);
        assert_eq!((first(64), last(64), first(96), last(96)), (64, 65, 128, 131));
    }

    #[test]
    fn figures_by_hand() {
        let mut jitter = Jitter::new(1_000_000);
        assert_eq!(jitter.summary(), Summary::default());
        // Deviations -3000, -1000, 1000, 3000 ns: mean 0, variance (9 + 1 + 1 + 9) / 4 = 5 µs².
        for value_ns in [999_000, 1_003_000, 997_000, 1_001_000] {
            jitter.record(value_ns);
        }
        let summary = jitter.summary();
        assert_eq!(
            (
                summary.n,
                summary.mean_us,
                summary.min_us,
                summary.max_us,
                summary.range_us
            ),
            (4, 1000.0, 997.0, 1003.0, 6.0)
        );
        assert!((summary.std_us - 5f64.sqrt()).abs() < 1e-12);
        assert_eq!(jitter.max_ns(), Some(1_003_000));
        // -1000 lies in the bucket from -1007 to -992.
        assert_eq!(jitter.value_at_quantile(0.5), 1_000_000 - 992);
        assert_eq!(jitter.value_at_quantile(1.0), 1_003_000);
        jitter.clear();
        assert_eq!(
            (jitter.summary(), jitter.buckets().count(), jitter.max_ns()),
            (Summary::default(), 0, None)
        );
    }

    proptest! {
        #[test]
        fn quantiles_are_within_a_bucket_of_the_sorted_values(
            mut values in prop::collection::vec(0u64..40_000_000_000, 1..300),
            quantile in 0.0f64..=1.0,
        ) {
            let mut jitter = Jitter::new(1_000_000);
            values.iter().for_each(|value| jitter.record(*value));
            values.sort_unstable();
            let exact = values[((quantile * values.len() as f64).ceil() as usize).clamp(1, values.len()) - 1];
            let found = jitter.value_at_quantile(quantile);
            prop_assert!(found >= exact);
            let deviation = exact.abs_diff(1_000_000);
            prop_assert!(deviation >= first(BUCKETS - 1) as u64 || found - exact <= deviation / 32, "{found} for {exact}");
            prop_assert_eq!(jitter.buckets().map(|bucket| bucket.count).sum::<u64>(), values.len() as u64);
        }
    }
}
