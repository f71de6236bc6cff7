//! A measured distribution as it stands in a report: figures, and a histogram from which others can be computed.
//!
//! In:  [`Jitter`] of a thread, buckets of a report, counts of a foreign tool.
//! Out: one distribution of several, quantiles, distances from the nominal without their sign.

use host::histogram::{Bucket, Jitter, Summary};
use serde::{Deserialize, Serialize};

/// Values around a nominal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// What the histogram counts from, ns: the cycle for periods, 0 for latencies.
    pub nominal_ns: u64,
    /// Number, mean, extremes, quantiles, µs.
    pub figures: Summary,
    /// Values as deviations from the nominal, from the least to the greatest.
    pub histogram: Vec<Bucket>,
}

impl From<&Jitter> for Distribution {
    fn from(jitter: &Jitter) -> Distribution {
        Distribution {
            nominal_ns: jitter.nominal_ns(),
            figures: jitter.summary(),
            histogram: jitter.buckets().collect(),
        }
    }
}

impl Distribution {
    /// One distribution of the values of several, which have the same nominal. Number, mean, standard deviation and extremes
    /// are exact; quantiles are read from the joined histogram.
    pub fn merge<'a>(parts: impl IntoIterator<Item = &'a Distribution>) -> Distribution {
        let mut merged = Distribution::default();
        for part in parts.into_iter().filter(|part| part.figures.n > 0) {
            if merged.figures.n == 0 {
                merged = part.clone();
                continue;
            }
            debug_assert_eq!(merged.nominal_ns, part.nominal_ns);
            let (a, b) = (merged.figures, part.figures);
            let n = a.n + b.n;
            let (share_a, share_b) = (a.n as f64 / n as f64, b.n as f64 / n as f64);
            let apart_us = b.mean_us - a.mean_us;
            let variance_us2 =
                share_a * a.std_us * a.std_us + share_b * b.std_us * b.std_us + share_a * share_b * apart_us * apart_us;
            let (min_us, max_us) = (a.min_us.min(b.min_us), a.max_us.max(b.max_us));
            merged.histogram = join(&merged.histogram, &part.histogram);
            merged.figures = Summary {
                n,
                mean_us: a.mean_us + share_b * apart_us,
                std_us: variance_us2.sqrt(),
                min_us,
                max_us,
                range_us: max_us - min_us,
                ..merged.figures
            };
        }
        merged.read_quantiles();
        merged
    }

    /// Reads the quantiles of the figures from the histogram; number and extremes must stand there.
    pub(super) fn read_quantiles(&mut self) {
        let quantile = |quantile| self.quantile_us(quantile);
        self.figures = Summary {
            p50_us: quantile(0.5),
            p90_us: quantile(0.9),
            p99_us: quantile(0.99),
            p99_9_us: quantile(0.999),
            p99_99_us: quantile(0.9999),
            ..self.figures
        };
    }

    /// Least value, to the width of a bucket, that at least this share (0 to 1) of the values are not above; 0 without
    /// values.
    pub fn quantile_us(&self, quantile: f64) -> f64 {
        let nominal_us = self.nominal_ns as f64 / 1000.0;
        let Some(to_ns) = quantile_of(self.histogram.iter().copied(), quantile) else {
            return 0.0;
        };
        // Not `clamp`: a report from a file may hold anything.
        (nominal_us + to_ns as f64 / 1000.0)
            .max(self.figures.min_us)
            .min(self.figures.max_us)
    }

    /// As [`Distribution::quantile_us`], of the distances from the nominal without their sign.
    pub fn deviation_quantile_us(&self, quantile: f64) -> f64 {
        let mut distances: Vec<Bucket> = self.histogram.iter().map(|bucket| without_sign(*bucket)).collect();
        distances.sort_unstable_by_key(|bucket| (bucket.to_ns, bucket.from_ns));
        let nominal_us = self.nominal_ns as f64 / 1000.0;
        let far_us = (nominal_us - self.figures.min_us).max(self.figures.max_us - nominal_us);
        quantile_of(distances, quantile).map_or(0.0, |to_ns| (to_ns as f64 / 1000.0).min(far_us))
    }
}

fn quantile_of(buckets: impl IntoIterator<Item = Bucket> + Clone, quantile: f64) -> Option<i64> {
    let count = |n: u64, bucket: Bucket| n.saturating_add(bucket.count);
    let n = buckets.clone().into_iter().fold(0, count);
    let wanted = ((quantile * n as f64).ceil() as u64).clamp(1, n.max(1));
    let mut seen = 0;
    buckets.into_iter().find_map(|bucket| {
        seen = count(seen, bucket);
        (seen >= wanted).then_some(bucket.to_ns)
    })
}

fn without_sign(bucket: Bucket) -> Bucket {
    if bucket.from_ns >= 0 {
        return bucket;
    }
    // A bucket never holds both signs.
    Bucket {
        from_ns: bucket.to_ns.saturating_neg(),
        to_ns: bucket.from_ns.saturating_neg(),
        count: bucket.count,
    }
}

/// Joins two ordered histograms; equal buckets become one.
fn join(a: &[Bucket], b: &[Bucket]) -> Vec<Bucket> {
    let mut joined: Vec<Bucket> = a.iter().chain(b).copied().collect();
    joined.sort_by_key(|bucket| (bucket.from_ns, bucket.to_ns));
    joined.dedup_by(|later, first| {
        let same = (later.from_ns, later.to_ns) == (first.from_ns, first.to_ns);
        if same {
            first.count += later.count;
        }
        same
    });
    joined
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn distribution(nominal_ns: u64, values_ns: &[u64]) -> Distribution {
        let mut jitter = Jitter::new(nominal_ns);
        values_ns.iter().for_each(|value_ns| jitter.record(*value_ns));
        Distribution::from(&jitter)
    }

    #[test]
    fn distances_by_hand() {
        // Distances 0, 10, 20, 30, 40 ns, early and late mixed.
        let periods = distribution(1000, &[1000, 990, 1020, 970, 1040]);
        let distance = |quantile| (periods.deviation_quantile_us(quantile) * 1000.0).round();
        assert_eq!([0.2, 0.4, 0.5, 0.8, 1.0].map(distance), [0.0, 10.0, 20.0, 30.0, 40.0]);
        assert_eq!(Distribution::default().deviation_quantile_us(0.5), 0.0);
        // The greatest distance is known better than its bucket.
        assert_eq!(distribution(0, &[1_000_000]).deviation_quantile_us(0.5), 1000.0);
    }

    #[test]
    fn nothing_merged_is_nothing() {
        let nothing = distribution(1000, &[]);
        let some = distribution(1000, &[1100, 900]);
        assert_eq!(Distribution::merge([&nothing]), Distribution::default());
        assert_eq!(Distribution::merge([&nothing, &some, &nothing]), some);
    }

    proptest! {
        #[test]
        fn merged_is_as_measured_at_once(
            values in prop::collection::vec(0u64..3_000_000, 1..200),
            cuts in prop::collection::vec(any::<prop::sample::Index>(), 0..4),
        ) {
            let mut at: Vec<usize> = cuts.iter().map(|cut| cut.index(values.len() + 1)).collect();
            at.extend([0, values.len()]);
            at.sort_unstable();
            let parts: Vec<_> = at.windows(2).map(|ends| distribution(1_000_000, &values[ends[0]..ends[1]])).collect();
            let (merged, whole) = (Distribution::merge(&parts), distribution(1_000_000, &values));
            prop_assert_eq!(&merged.histogram, &whole.histogram);
            let (a, b) = (merged.figures, whole.figures);
            prop_assert_eq!((a.n, a.min_us, a.max_us), (b.n, b.min_us, b.max_us));
            for (a, b) in [
                (a.mean_us, b.mean_us), (a.std_us, b.std_us), (a.range_us, b.range_us), (a.p50_us, b.p50_us), (a.p90_us, b.p90_us),
                (a.p99_us, b.p99_us), (a.p99_9_us, b.p99_9_us), (a.p99_99_us, b.p99_99_us),
            ] {
                prop_assert!((a - b).abs() < 1e-6, "{a} instead of {b}");
            }
        }
    }
}
