//! The distributions of a jitter measurement as a table for other programs.
//!
//! In:  [`JitterReport`]. Out: comma separated values, one line per bin, in order.

use super::Distribution;
use super::report::JitterReport;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The header. Bins are times in µs from the date that was due: from the nominal period for the SoC period, from the date of
/// waking up for latencies. Both ends of a bin belong to it. The rest of the columns are numbers of values.
pub const HEADER: &str =
    "from_us,to_us,soc_period_off_nominal,control_lateness,wakeup_probe_lateness,cyclictest_latency";

/// All rounds together: bins that any of the distributions fills, with the counts of each. The bins of `cyclictest` are whole
/// µs and lines of their own.
pub fn histogram(report: &JitterReport) -> String {
    let all = &report.all;
    let mut bins: BTreeMap<(i64, i64), [u64; 4]> = BTreeMap::new();
    for (column, of) in [&all.soc_period, &all.lateness, &all.wakeup, &all.cyclictest]
        .into_iter()
        .enumerate()
    {
        let Distribution { histogram, .. } = of;
        for bucket in histogram {
            let counts = bins.entry((bucket.from_ns, bucket.to_ns)).or_default();
            counts[column] = counts[column].saturating_add(bucket.count);
        }
    }
    let mut text = format!("{HEADER}\n");
    for ((from_ns, to_ns), [soc, lateness, wakeup, cyclictest]) in bins {
        let (from, to) = (in_us(from_ns), in_us(to_ns));
        let _ = writeln!(text, "{from},{to},{soc},{lateness},{wakeup},{cyclictest}");
    }
    text
}

/// Exact: ns with a decimal point. The ends of the outermost bins are open.
fn in_us(ns: i64) -> String {
    match ns {
        i64::MAX => "inf".into(),
        ns if ns <= -i64::MAX => "-inf".into(),
        _ => {
            let sign = if ns < 0 { "-" } else { "" };
            format!("{sign}{}.{:03}", ns.unsigned_abs() / 1000, ns.unsigned_abs() % 1000)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn bins_by_hand() {
        let mut report = samples::empty();
        assert_eq!(histogram(&report), format!("{HEADER}\n"));
        report.all.soc_period = samples::distribution(1_000_000, [999_000, 1_000_000, 1_000_000, 1_000_007]);
        report.all.wakeup = samples::distribution(0, [7, 12_345]);
        report.all.cyclictest = samples::cyclictest([0, 12, 12]);
        let expected = format!(
            "{HEADER}\n\
             -1.007,-0.992,1,0,0,0\n\
             0.000,0.000,2,0,0,1\n\
             0.007,0.007,1,0,1,0\n\
             12.000,12.000,0,0,0,2\n\
             12.288,12.543,0,0,1,0\n"
        );
        assert_eq!(histogram(&report), expected);
        assert_eq!(
            [i64::MIN, -i64::MAX, -1, i64::MAX].map(in_us),
            ["-inf", "-inf", "-0.001", "inf"]
        );
    }

    #[test]
    fn no_value_is_lost() {
        for report in samples::all() {
            let mut sums = [0_u64; 4];
            for line in histogram(report).lines().skip(1) {
                let cells: Vec<&str> = line.split(',').collect();
                assert_eq!(cells.len(), 6, "{line}");
                for (sum, cell) in sums.iter_mut().zip(&cells[2..]) {
                    *sum += cell.parse::<u64>().unwrap();
                }
            }
            let all = &report.all;
            let parts = [&all.soc_period, &all.lateness, &all.wakeup, &all.cyclictest];
            assert_eq!(
                sums,
                parts.map(|part| part.histogram.iter().map(|bucket| bucket.count).sum::<u64>())
            );
        }
    }
}
