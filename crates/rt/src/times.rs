//! How long the parts of cycles took, counted in fixed buckets that anybody may read at any time.
//!
//! In:  the times of each cycle, from the cycle thread alone. Out: counts since the start, for pictures and for Prometheus.
//!
//! RT: a constant time; nothing but stores.

use super::cycle_stats::Timing;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Upper edges of times, ns; one more bucket takes what lies beyond.
const TIMES_NS: &[i64] = &[
    1_000, 2_000, 3_000, 5_000, 7_000, 10_000, 15_000, 20_000, 30_000, 50_000, 70_000, 100_000, 150_000, 200_000,
    300_000, 500_000, 700_000, 1_000_000, 2_000_000, 5_000_000,
];
/// Upper edges of what a period differs from the cycle, ns.
const DIFFERENCES_NS: &[i64] = &[
    -500_000, -200_000, -100_000, -50_000, -20_000, -10_000, -5_000, -2_000, -1_000, -500, 0, 500, 1_000, 2_000, 5_000,
    10_000, 20_000, 50_000, 100_000, 200_000, 500_000,
];
/// Buckets at the most.
const BUCKETS_MAX: usize = 22;

/// Counts of values up to each edge.
#[derive(Debug)]
pub struct Histogram {
    edges_ns: &'static [i64],
    counts: [AtomicU64; BUCKETS_MAX],
    sum_ns: AtomicU64,
}

impl Histogram {
    const fn new(edges_ns: &'static [i64]) -> Histogram {
        assert!(edges_ns.len() < BUCKETS_MAX);
        Histogram {
            edges_ns,
            counts: [const { AtomicU64::new(0) }; BUCKETS_MAX],
            sum_ns: AtomicU64::new(0),
        }
    }

    /// Takes a value in. RT; of one thread.
    fn record(&self, value_ns: i64) {
        let count = &self.counts[self.edges_ns.partition_point(|edge| *edge < value_ns)];
        count.store(count.load(Relaxed) + 1, Relaxed);
        let sum_ns = self.sum_ns.load(Relaxed).wrapping_add_signed(value_ns);
        self.sum_ns.store(sum_ns, Relaxed);
    }

    /// Upper edges of its buckets but the last, which has none, ns.
    pub fn edges_ns(&self) -> &'static [i64] {
        self.edges_ns
    }

    /// Values in each bucket: one more than there are edges.
    pub fn counts(&self) -> impl Iterator<Item = u64> + '_ {
        let counts = self.counts.iter().take(self.edges_ns.len() + 1);
        counts.map(|count| count.load(Relaxed))
    }

    /// Sum of all values, ns.
    pub fn sum_ns(&self) -> i64 {
        self.sum_ns.load(Relaxed) as i64
    }
}

/// Histograms of the cycle.
#[derive(Debug)]
pub struct CycleHistograms {
    /// What the distance from one SoC to the next differs from the cycle.
    pub period: Histogram,
    /// How long after its date a SoC was sent.
    pub lateness: Histogram,
    /// From the SoC to the end of the exchange.
    pub exchange: Histogram,
    /// From there to the end of the cycle.
    pub compute: Histogram,
}

impl Default for CycleHistograms {
    fn default() -> CycleHistograms {
        CycleHistograms {
            period: Histogram::new(DIFFERENCES_NS),
            lateness: Histogram::new(TIMES_NS),
            exchange: Histogram::new(TIMES_NS),
            compute: Histogram::new(TIMES_NS),
        }
    }
}

impl CycleHistograms {
    /// Takes a cycle in. RT.
    pub fn record(&self, timing: &Timing) {
        if let Some(difference_ns) = timing.period_difference_ns {
            self.period.record(difference_ns);
        }
        for (histogram, ns) in [
            (&self.lateness, timing.lateness_ns),
            (&self.exchange, timing.exchange_ns),
            (&self.compute, timing.compute_ns),
        ] {
            histogram.record(i64::try_from(ns).unwrap_or(i64::MAX));
        }
    }

    /// Each with its name.
    pub fn all(&self) -> [(&'static str, &Histogram); 4] {
        [
            ("period", &self.period),
            ("lateness", &self.lateness),
            ("exchange", &self.exchange),
            ("compute", &self.compute),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_is_in_the_bucket_whose_edge_it_does_not_pass() {
        let times = CycleHistograms::default();
        for (edges, histogram) in [(DIFFERENCES_NS, &times.period), (TIMES_NS, &times.lateness)] {
            assert!(edges.windows(2).all(|pair| pair[0] < pair[1]));
            for edge in edges {
                histogram.record(*edge);
            }
            histogram.record(edges[0] + 1);
            histogram.record(edges[edges.len() - 1] + 1);
            let counts: Vec<u64> = histogram.counts().collect();
            let mut wanted = vec![1; edges.len() + 1];
            wanted[1] += 1;
            assert_eq!(counts, wanted);
            let sum: i64 = edges.iter().sum::<i64>() + edges[0] + 1 + edges[edges.len() - 1] + 1;
            assert_eq!(histogram.sum_ns(), sum);
        }
    }

    #[test]
    fn a_cycle_without_a_period_counts_the_rest() {
        let times = CycleHistograms::default();
        times.record(&Timing::default());
        times.record(&Timing {
            period_difference_ns: Some(-700),
            ..Timing::default()
        });
        let counted = times.all().map(|(_, histogram)| histogram.counts().sum::<u64>());
        assert_eq!(counted, [1, 2, 2, 2]);
        assert_eq!(times.period.sum_ns(), -700);
    }
}
