//! Statistics of the last second, for the pins: what a person who watches a running machine wants to see.
//!
//! In:  one value a cycle, ns.
//! Out: a [`Second`] whenever enough cycles have come together.
//!
//! RT: constant memory, constant time; the walk over the buckets once a second is bounded by their number.

/// Values are sorted into buckets by their highest bits: this many buckets for each power of two.
const SUB_BITS: u32 = 3;
/// Values up to 2^26 ns = 67 ms are told apart; the last bucket takes all beyond.
const TOP_BITS: u32 = 26;
const BUCKETS: usize = ((TOP_BITS - SUB_BITS + 1) as usize) << SUB_BITS;

/// Values of one second, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Second {
    pub mean_ns: f64,
    pub std_ns: f64,
    pub min_ns: u64,
    /// 99 % of the values are at or below this; up to 1/8 too high, never above the greatest.
    pub p99_ns: u64,
    pub max_ns: u64,
}

/// The second under way.
#[derive(Clone, Debug)]
pub struct Recent {
    /// Values are summed up as distances from it, which keeps the sum of squares exact.
    nominal_ns: u64,
    cycles: u32,
    n: u32,
    sum_ns: f64,
    sum_ns2: f64,
    min_ns: u64,
    max_ns: u64,
    buckets: [u16; BUCKETS],
}

impl Recent {
    /// Gives a [`Second`] every so many cycles, at most 65 535.
    pub fn new(nominal_ns: u64, cycles: u32) -> Recent {
        Recent {
            nominal_ns,
            cycles: cycles.clamp(1, u32::from(u16::MAX)),
            n: 0,
            sum_ns: 0.0,
            sum_ns2: 0.0,
            min_ns: u64::MAX,
            max_ns: 0,
            buckets: [0; BUCKETS],
        }
    }

    /// RT: takes a value in; gives the second that it completes.
    pub fn record(&mut self, value_ns: u64) -> Option<Second> {
        let distance_ns = value_ns as f64 - self.nominal_ns as f64;
        self.n += 1;
        self.sum_ns += distance_ns;
        self.sum_ns2 += distance_ns * distance_ns;
        self.min_ns = self.min_ns.min(value_ns);
        self.max_ns = self.max_ns.max(value_ns);
        self.buckets[bucket(value_ns)] += 1;
        if self.n < self.cycles {
            return None;
        }
        let n = f64::from(self.n);
        let mean_ns = self.sum_ns / n;
        let second = Second {
            mean_ns: self.nominal_ns as f64 + mean_ns,
            std_ns: (self.sum_ns2 / n - mean_ns * mean_ns).max(0.0).sqrt(),
            min_ns: self.min_ns,
            p99_ns: self.p99_ns(),
            max_ns: self.max_ns,
        };
        *self = Recent::new(self.nominal_ns, self.cycles);
        Some(second)
    }

    fn p99_ns(&self) -> u64 {
        let mut above = self.n / 100;
        for (bucket, count) in self.buckets.iter().enumerate().rev() {
            match above.checked_sub(u32::from(*count)) {
                Some(left) => above = left,
                None => return last(bucket).min(self.max_ns),
            }
        }
        self.min_ns
    }
}

fn bucket(value_ns: u64) -> usize {
    if value_ns < 1 << SUB_BITS {
        return value_ns as usize;
    }
    let octave = value_ns.ilog2();
    if octave >= TOP_BITS {
        return BUCKETS - 1;
    }
    let sub = (value_ns >> (octave - SUB_BITS)) as usize & ((1 << SUB_BITS) - 1);
    (((octave - SUB_BITS + 1) as usize) << SUB_BITS) + sub
}

/// Greatest value in a bucket.
fn last(bucket: usize) -> u64 {
    if bucket >= BUCKETS - 1 {
        return u64::MAX;
    }
    let next = bucket + 1;
    if next < 1 << SUB_BITS {
        return bucket as u64;
    }
    let shift = (next >> SUB_BITS) - 1;
    ((((1 << SUB_BITS) + (next & ((1 << SUB_BITS) - 1))) as u64) << shift) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_join_without_gaps() {
        for at in 0..BUCKETS - 1 {
            assert_eq!((bucket(last(at)), bucket(last(at) + 1)), (at, at + 1));
        }
        assert_eq!((bucket(0), bucket(u64::MAX)), (0, BUCKETS - 1));
        assert_eq!((last(8), last(16), last(17)), (8, 17, 19));
    }

    #[test]
    fn a_second_by_hand() {
        let mut recent = Recent::new(1_000_000, 200);
        for turn in 0..2 {
            for at in 0..199_u64 {
                let value_ns = if at < 2 { 1_200_000 } else { 1_000_000 - at % 2 };
                assert_eq!(recent.record(value_ns), None, "turn {turn}");
            }
            let second = recent.record(999_000).expect("200 values");
            // Two of 200 are above the 99 %.
            assert_eq!(
                (second.min_ns, second.p99_ns, second.max_ns),
                (999_000, 1_048_575, 1_200_000)
            );
            let mean_ns = 1_000_000.0 + (400_000.0 - 98.0 - 1_000.0 - 1.0) / 200.0;
            assert!((second.mean_ns - mean_ns).abs() < 1.0, "{second:?} {mean_ns}");
            assert!((second.std_ns - 19_900.0).abs() < 10.0, "{second:?}");
        }
    }

    #[test]
    fn wild_values_are_taken_in() {
        let mut recent = Recent::new(0, 2);
        assert_eq!(recent.record(u64::MAX), None);
        let second = recent.record(5).expect("two values");
        assert_eq!((second.min_ns, second.max_ns, second.p99_ns), (5, u64::MAX, u64::MAX));
    }
}
