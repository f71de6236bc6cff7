//! How far from its date, how often: one row of bars per distribution under one axis.

use super::scale::{Labels, Log};
use super::{AXIS, BODY, CONTROL, CYCLICTEST, GRID, HEADING, INK, LEFT, RIGHT, SMALL, SOC, WAKEUP, caption, ticks};
use crate::Distribution;
use crate::report::JitterReport;
use crate::words::{far_end_listened, grouped, short_time};
use host::histogram::Bucket;
use plot::sheet::{Anchor, Face, Sheet};

/// Bars per decade.
const BARS: usize = 10;
/// Where the axis begins, µs: what is nearer counts as this.
const NEAREST_US: f64 = 0.01;
const ROW: f64 = 64.0;
/// Room for labels above the bars of a row.
const ABOVE: f64 = 32.0;

struct Row<'a> {
    name: &'static str,
    colour: &'static str,
    of: &'a Distribution,
    /// Least width of a bucket, ns: a whole µs of `cyclictest` is the µs that begins there.
    width_ns: u64,
    quantile_us: fn(&Distribution, f64) -> f64,
}

/// Draws from `top` on; gives the lower end.
pub(super) fn draw(sheet: &mut Sheet, report: &JitterReport, top: f64) -> f64 {
    let all = &report.all;
    let latency = |name, colour, of, width_ns| Row {
        name,
        colour,
        of,
        width_ns,
        quantile_us: Distribution::quantile_us,
    };
    let period = if far_end_listened(report) {
        "SoC period on the wire"
    } else {
        "SoC period, own clock"
    };
    let rows = [
        Row {
            quantile_us: Distribution::deviation_quantile_us,
            ..latency(period, SOC, &all.soc_period, 1)
        },
        latency("SoC sent by the control", CONTROL, &all.lateness, 1),
        latency("wake-up, own probe", WAKEUP, &all.wakeup, 1),
        latency("wake-up, cyclictest", CYCLICTEST, &all.cyclictest, 1000),
    ];
    let rows: Vec<&Row<'_>> = rows.iter().filter(|row| row.of.figures.n > 0).collect();
    sheet.text((LEFT.0, top), HEADING, "How far from its date, how often");
    let note = "Further left is better. All rounds together; both axes logarithmic. SoC period: distance from nominal, early or late.";
    sheet.text((LEFT.0, top + 18.0), SMALL, note);
    if rows.is_empty() {
        sheet.text((LEFT.0, top + 50.0), BODY, "Nothing was measured.");
        return top + 70.0;
    }
    let farthest_us = rows
        .iter()
        .map(|row| (row.quantile_us)(row.of, 1.0))
        .filter(|us| us.is_finite());
    let axis = Log::holding(NEAREST_US, farthest_us.fold(100.0, f64::max), AXIS);
    let bars: Vec<Vec<f64>> = rows
        .iter()
        .map(|row| bars(&row.of.histogram, row.width_ns, &axis))
        .collect();
    let most = bars.iter().flatten().copied().fold(10.0, f64::max);
    let first_top = top + 30.0;
    let base = first_top + rows.len() as f64 * (ABOVE + ROW);
    ticks(sheet, &axis, (first_top + ABOVE, base), short_time);
    for ((row, bars), at) in rows.iter().zip(&bars).zip(0..) {
        let top = first_top + f64::from(at) * (ABOVE + ROW);
        draw_row(sheet, row, bars, &axis, (top, most));
    }
    caption(sheet, base, "distance from the date that was due")
}

fn draw_row(sheet: &mut Sheet, row: &Row<'_>, bars: &[f64], axis: &Log, (top, most): (f64, f64)) {
    let base = top + ABOVE + ROW;
    let height = Log::holding(0.1, most, (base, top + ABOVE));
    sheet.text(
        (LEFT.0, base - ROW / 2.0 - 4.0),
        Face::new(14.0, row.colour).bold(),
        row.name,
    );
    sheet.text(
        (LEFT.0, base - ROW / 2.0 + 14.0),
        BODY,
        &format!("n = {}", grouped(row.of.figures.n)),
    );
    let ticks = height.ticks().filter(|tick| *tick >= 1.0);
    let step = if height.ends().1 > 1e6 { 4 } else { 2 };
    for tick in ticks.step_by(step) {
        let y = height.place(tick);
        sheet.line((AXIS.0 - 4.0, y), (AXIS.1, y), GRID, 1.0, "");
        sheet.text((AXIS.0 - 7.0, y + 4.0), SMALL.at(Anchor::End), &count(tick));
    }
    let width = (AXIS.1 - AXIS.0) / bars.len() as f64;
    for (bar, at) in bars.iter().zip(0..) {
        let left = AXIS.0 + f64::from(at) * width;
        if *bar > 0.0 {
            sheet.rectangle(
                (left + 0.5, height.place(bar.max(1.0))),
                (left + width - 0.5, base),
                row.colour,
            );
        }
    }
    sheet.line((AXIS.0, base), (AXIS.1, base), INK, 1.0, "");
    let mut labels = Labels::new(SMALL, (AXIS.0 - 60.0, RIGHT));
    for (name, quantile) in [("half", 0.5), ("max", 1.0), ("99.9 %", 0.999)] {
        let value_us = (row.quantile_us)(row.of, quantile);
        let x = axis.place(value_us);
        let text = format!("{name} {}", short_time(value_us));
        let Some((line, anchor)) = labels.find(x, &text, 2) else {
            continue;
        };
        let y = top + ABOVE - 3.0 - 13.0 * line as f64;
        sheet.line((x, y - 9.0), (x, base), INK, 1.0, "3 2");
        let beside = if anchor == Anchor::Start { 4.0 } else { -4.0 };
        sheet.text((x + beside, y), Face::new(SMALL.size, INK).at(anchor), &text);
    }
}

/// Numbers of values per bar. A bucket that covers several bars is spread over them evenly.
fn bars(histogram: &[Bucket], width_ns: u64, axis: &Log) -> Vec<f64> {
    let (from_us, to_us) = axis.ends();
    let decades = (to_us / from_us).log10().round();
    let mut bars = vec![0.0; decades as usize * BARS];
    let last = bars.len() - 1;
    let place = |ns: u64| {
        let us = (ns as f64 / 1000.0).max(from_us);
        ((us / from_us).log10() * BARS as f64).clamp(0.0, bars.len() as f64)
    };
    let mut spread = Vec::new();
    for bucket in histogram {
        let (a, b) = (bucket.from_ns.unsigned_abs(), bucket.to_ns.unsigned_abs());
        let (near, far) = (place(a.min(b)), place(a.max(b).saturating_add(width_ns)));
        spread.push((near, far, bucket.count as f64));
    }
    for (near, far, count) in spread {
        let (first, end) = ((near as usize).min(last), (far.ceil() as usize).min(last + 1));
        for (at, bar) in bars.iter_mut().enumerate().take(end.max(first + 1)).skip(first) {
            let overlap = far.min(at as f64 + 1.0) - near.max(at as f64);
            let share = if far - near > 1e-9 {
                (overlap / (far - near)).clamp(0.0, 1.0)
            } else {
                1.0
            };
            *bar += count * share;
        }
    }
    bars
}

/// `1`, `100`, `10k`, `1M`.
fn count(value: f64) -> String {
    match value {
        value if value < 999.0 => format!("{value:.0}"),
        value if value < 999e3 => format!("{:.0}k", value / 1e3),
        value if value < 999e6 => format!("{:.0}M", value / 1e6),
        value if value < 999e9 => format!("{:.0}G", value / 1e9),
        value => format!("{value:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_hold_all_values_where_they_belong() {
        let axis = Log::holding(0.01, 100.0, AXIS);
        let bucket = |from_ns, to_ns, count| Bucket { from_ns, to_ns, count };
        // 0: the first bar; 1 µs early and late: the bar from 1 µs; far beyond: the last.
        let found = bars(
            &[
                bucket(-1007, -1000, 2),
                bucket(0, 0, 5),
                bucket(1000, 1001, 3),
                bucket(i64::MAX - 1, i64::MAX, 1),
            ],
            1,
            &axis,
        );
        assert_eq!(found.len(), 40);
        assert_eq!((found[0], found[20], found[39]), (5.0, 5.0, 1.0));
        assert!((found.iter().sum::<f64>() - 11.0).abs() < 1e-9);
        // A whole µs of cyclictest from 1 to 2: three bars, for log10(2) = 0.301.
        let found = bars(&[bucket(1000, 1000, 30)], 1000, &axis);
        let filled: Vec<usize> = (0..40).filter(|at| found[*at] > 0.0).collect();
        assert_eq!(filled, [20, 21, 22, 23]);
        assert!((found.iter().sum::<f64>() - 30.0).abs() < 1e-9);
        assert!((found[20] - 30.0 / 3.0103).abs() < 0.01, "{}", found[20]);
    }

    #[test]
    fn counts_are_short() {
        assert_eq!(
            [1.0, 100.0, 1e4, 1e6, 1e10, 1e13].map(count),
            ["1", "100", "10k", "1M", "10G", "1e13"]
        );
    }
}
