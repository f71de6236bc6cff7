//! When: the longest period of each interval, round after round, with overruns and stalls marked.

use super::scale::{Labels, Log};
use super::{ALARM, AXIS, BAD, BODY, CYCLICTEST, GRID, HEADING, INK, LEFT, LINE, SMALL, SOC, caption};
use crate::report::{JitterReport, Round};
use crate::words::{short_time, wrapped};
use plot::sheet::{Anchor, Face, Sheet};

const HEIGHT: f64 = 150.0;
/// Room above for the names of rounds and for marks.
const ABOVE: f64 = 40.0;
/// Between two rounds.
const GAP: f64 = 6.0;
/// Width of a line that stands for one or several intervals.
const NEEDLE: f64 = 2.0;
/// Least distance over nominal that is drawn, µs.
const NEAREST_US: f64 = 0.1;
/// Stalls that are told in words.
const TOLD: usize = 5;

/// A round on the axis.
struct Part<'a> {
    round: &'a Round,
    seconds: f64,
    from: f64,
    to: f64,
}

/// Draws from `top` on; gives the lower end.
pub(super) fn draw(sheet: &mut Sheet, report: &JitterReport, top: f64) -> f64 {
    sheet.text((LEFT.0, top), HEADING, "When: the latest SoC of each moment");
    let parts = parts(report);
    if parts.is_empty() {
        sheet.text(
            (LEFT.0, top + 24.0),
            BODY,
            "Nobody of ours listened at the far end of the wire.",
        );
        return top + 36.0;
    }
    let interval_s = parts
        .iter()
        .filter_map(|part| Some(part.round.soc_period.as_ref()?.interval_s));
    let shaded = if report.rounds.iter().any(Round::is_bad) {
        " Shaded: a round in which the PC stood still (in words below)."
    } else {
        ""
    };
    let left_out = match parts.iter().any(|part| floor(part.round).is_some()) {
        true => " Time in which the floor was measured is left out.",
        false => "",
    };
    let note = format!(
        "One line: the longest period of about {}.{shaded}{left_out}",
        short_time(interval_s.fold(0.0, f64::max) * 1e6)
    );
    let mut y = top + 18.0;
    for line in wrapped(&note, LINE) {
        sheet.text((LEFT.0, y), SMALL, &line);
        y += 15.0;
    }
    let worst = |part: &Part<'_>| {
        let longest = over_nominal(part).fold(0.0, f64::max);
        longest.max(floor(part.round).map_or(0.0, |(_, max_us)| max_us))
    };
    let most_us = parts.iter().map(worst).filter(|us| us.is_finite()).fold(10.0, f64::max);
    let half_us = f64::from(report.settings.cycle_us) / 2.0;
    let shows_half = most_us >= half_us;
    if shows_half {
        // Not in the picture: there it would stand over bars.
        let text = format!("from {}: a cycle was left out", short_time(half_us));
        sheet.line((LEFT.0, y - 4.0), (LEFT.0 + 28.0, y - 4.0), ALARM, 1.0, "6 3");
        sheet.text((LEFT.0 + 34.0, y), Face::new(12.0, ALARM), &text);
        y += 15.0;
    }
    let (ceiling, base) = (y + ABOVE, y + ABOVE + HEIGHT);
    let axis = Log::holding(NEAREST_US, most_us, (base, ceiling));
    for part in parts.iter().filter(|part| part.round.is_bad()) {
        sheet.rectangle((part.from, ceiling - 18.0), (part.to, base), BAD);
    }
    for tick in axis.ticks() {
        let y = axis.place(tick);
        sheet.line((AXIS.0 - 4.0, y), (AXIS.1, y), GRID, 1.0, "");
        sheet.text((AXIS.0 - 8.0, y + 4.0), BODY.at(Anchor::End), &short_time(tick));
    }
    sheet.text((LEFT.0, base - 24.0), Face::new(14.0, SOC).bold(), "longest period,");
    sheet.text((LEFT.0, base - 6.0), BODY, "less the nominal one");
    if shows_half {
        let y = axis.place(half_us);
        sheet.line((AXIS.0, y), (AXIS.1, y), ALARM, 1.0, "6 3");
    }
    for part in &parts {
        needles(sheet, part, &axis, (ceiling, base), half_us);
    }
    sheet.line((AXIS.0, base), (AXIS.1, base), INK, 1.0, "");
    words(sheet, &parts, &axis, ceiling);
    let below = times(sheet, &parts, base);
    stalls(sheet, report, below)
}

/// The rounds on the axis, as wide as they were long.
fn parts(report: &JitterReport) -> Vec<Part<'_>> {
    let mut parts: Vec<Part<'_>> = report
        .rounds
        .iter()
        .filter_map(|round| {
            let soc = round
                .soc_period
                .as_ref()
                .filter(|soc| !soc.interval_maxima_us.is_empty())?;
            let seconds = soc.interval_s * soc.interval_maxima_us.len() as f64;
            let seconds = if seconds.is_finite() && seconds > 0.0 {
                seconds.min(1e12)
            } else {
                1.0
            };
            Some(Part {
                round,
                seconds,
                from: 0.0,
                to: 0.0,
            })
        })
        .collect();
    let all_s: f64 = parts.iter().map(|part| part.seconds).sum();
    let gap = GAP.min(200.0 / parts.len().max(1) as f64);
    let width = AXIS.1 - AXIS.0 - gap * parts.len().saturating_sub(1) as f64;
    let mut from = AXIS.0;
    for part in &mut parts {
        part.from = from;
        part.to = from + width * part.seconds / all_s;
        from = part.to + gap;
    }
    parts
}

/// Longest periods over nominal, µs.
fn over_nominal<'a>(part: &'a Part<'_>) -> impl Iterator<Item = f64> + 'a {
    let soc = part.round.soc_period.iter();
    soc.flat_map(|soc| {
        soc.interval_maxima_us
            .iter()
            .map(move |us| us - f64::from(soc.cycle_us))
    })
}

/// The worst wake-up of a round, and by whom.
fn floor(round: &Round) -> Option<(&'static str, f64)> {
    let (name, latency) = round.floor.latency()?;
    Some((name, latency.figures.max_us))
}

fn needles(sheet: &mut Sheet, part: &Part<'_>, axis: &Log, (ceiling, base): (f64, f64), half_us: f64) {
    let values: Vec<f64> = over_nominal(part).collect();
    let columns = (((part.to - part.from) / NEEDLE) as usize).clamp(1, values.len().max(1));
    let width = (part.to - part.from) / columns as f64;
    for column in 0..columns {
        let range = column * values.len() / columns..(column + 1) * values.len() / columns;
        let longest_us = values[range].iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let left = part.from + width * column as f64;
        if longest_us <= 0.0 {
            continue;
        }
        let late = longest_us >= half_us;
        let colour = if late { ALARM } else { SOC };
        let top = axis.place(longest_us);
        sheet.rectangle((left, top.min(base - 1.0)), (left + width * 0.8, base), colour);
        if late {
            // A mark that is seen without colours, too.
            let x = left + width / 2.0;
            sheet.area(
                &[(x, ceiling - 3.0), (x - 5.0, ceiling - 12.0), (x + 5.0, ceiling - 12.0)],
                ALARM,
            );
        }
    }
}

/// Names of rounds, and the worst wake-up in each.
fn words(sheet: &mut Sheet, parts: &[Part<'_>], axis: &Log, ceiling: f64) {
    let mut labels = Labels::new(SMALL, (AXIS.0, AXIS.1));
    for part in parts {
        let mark = if part.round.is_bad() { "!" } else { "" };
        let overruns = part.round.soc_period.as_ref().map_or(0, |soc| soc.breaks.overruns);
        let overruns = match overruns {
            0 => String::new(),
            1 => ", 1 overrun".into(),
            overruns => format!(", {overruns} overruns"),
        };
        let full = format!("round {}{mark}{overruns}", part.round.number);
        let short = format!("{}{mark}", part.round.number);
        let room = part.to - part.from;
        let text = [full, short].into_iter().find(|text| SMALL.width(text) < room);
        if let Some(text) = text.filter(|text| labels.find(part.from, text, 1).is_some()) {
            sheet.text((part.from + 2.0, ceiling - 22.0), Face::new(12.0, INK), &text);
        }
    }
    let mut told = false;
    for part in parts {
        let Some((name, max_us)) = floor(part.round) else {
            continue;
        };
        let y = axis.place(max_us);
        sheet.line((part.from, y), (part.to, y), CYCLICTEST, 2.5, "");
        if !told {
            told = true;
            let y = y.min(ceiling + HEIGHT - 62.0);
            sheet.text((LEFT.0, y), Face::new(14.0, CYCLICTEST).bold(), "worst wake-up,");
            sheet.text((LEFT.0, y + 18.0), BODY, &format!("{name}, per round"));
        }
    }
}

/// Time under the axis, at the ends of rounds; gives the lower end.
fn times(sheet: &mut Sheet, parts: &[Part<'_>], base: f64) -> f64 {
    let mut labels = Labels::new(BODY, (AXIS.0 - 80.0, AXIS.1 + 80.0));
    let all_s: f64 = parts.iter().map(|part| part.seconds).sum();
    let mut end_s = 0.0;
    let mut ends = vec![(AXIS.0, 0.0)];
    for part in parts {
        end_s += part.seconds;
        ends.push((part.to, end_s));
    }
    // The last first: it says how long all of it was.
    let last = ends.len() - 1;
    ends.swap(1.min(last), last);
    for (x, end_s) in ends {
        let text = duration(end_s, all_s);
        if labels.find(x, &text, 1).is_some() {
            sheet.text((x, base + 17.0), BODY.at(Anchor::Middle), &text);
        }
    }
    caption(sheet, base, "time with the program running")
}

/// A time in the unit that the whole fits.
fn duration(seconds: f64, all_s: f64) -> String {
    match all_s {
        all_s if all_s < 600.0 => format!("{seconds:.0} s"),
        all_s if all_s < 36_000.0 => format!("{:.0} min", seconds / 60.0),
        all_s if all_s < 1e6 => format!("{:.1} h", seconds / 3600.0),
        _ => format!("{:.0} d", seconds / 86_400.0),
    }
}

/// What happened in the shaded rounds.
fn stalls(sheet: &mut Sheet, report: &JitterReport, mut y: f64) -> f64 {
    let bad: Vec<&Round> = report.rounds.iter().filter(|round| round.is_bad()).collect();
    if !bad.is_empty() {
        y += 6.0;
    }
    for round in bad.iter().take(TOLD) {
        let text = format!("round {}! {}", round.number, round.stalls.join("; "));
        for line in wrapped(&text, LINE - 2).into_iter().take(3) {
            y += 16.0;
            sheet.text((LEFT.0, y), Face::new(12.0, INK), &line);
        }
    }
    if bad.len() > TOLD {
        y += 16.0;
        let more = format!("and {} rounds more", bad.len() - TOLD);
        sheet.text((LEFT.0, y), Face::new(12.0, INK), &more);
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn rounds_fill_the_axis_in_order_and_as_wide_as_they_were_long() {
        let mut report = samples::quiet();
        if let Some(soc) = &mut report.rounds[1].soc_period {
            soc.interval_s *= 3.0;
        }
        let parts = parts(&report);
        assert_eq!(parts.len(), 5);
        assert_eq!(parts[0].from, AXIS.0);
        assert!((parts[4].to - AXIS.1).abs() < 1e-6);
        let width = |at: usize| parts[at].to - parts[at].from;
        assert!((width(1) / width(0) - 3.0).abs() < 1e-6);
        assert!((parts[1].from - parts[0].to - GAP).abs() < 1e-9);
    }

    #[test]
    fn durations_are_told_in_the_unit_of_the_whole() {
        assert_eq!(
            [(20.0, 100.0), (90.0, 1000.0), (1800.0, 40_000.0), (86_400.0, 1e7)].map(|(s, all)| duration(s, all)),
            ["20 s", "2 min", "0.5 h", "1 d"]
        );
    }
}
