//! Against what: the SoC period over the wake-up latency of the same PC, with the goals as marks.

use super::scale::{Labels, Log};
use super::{ALARM, AXIS, BODY, HEADING, INK, LEFT, LINE, SMALL, SOC, WAKEUP, caption, ticks};
use crate::goals::GOALS;
use crate::ratios::Ratios;
use crate::report::{JitterReport, Round};
use crate::words::{ratio, wrapped};
use plot::sheet::{Anchor, Face, Sheet};

const ROW: f64 = 52.0;
const BAR: f64 = 13.0;

/// A figure of the ratios.
type Figure = fn(&Ratios) -> f64;

const FIGURES: [(&str, Figure); 4] = [
    ("half of all cycles", |ratios| ratios.p50),
    ("99 %", |ratios| ratios.p99),
    ("99.9 %", |ratios| ratios.p99_9),
    ("standard deviation", |ratios| ratios.std),
];

/// Draws from `top` on; gives the lower end.
pub(super) fn draw(sheet: &mut Sheet, report: &JitterReport, top: f64) -> f64 {
    sheet.text((LEFT.0, top), HEADING, "Against a thread that only wakes up");
    let medians = &report.medians;
    let (name, other) = match (medians.over_cyclictest, medians.over_wakeup) {
        (None, None) => {
            let why = "No ratios: either the SoC period or the wake-up latency was not measured.";
            sheet.text((LEFT.0, top + 24.0), BODY, why);
            return top + 36.0;
        }
        (Some(_), _) => ("cyclictest", "own probe"),
        (None, Some(_)) => ("own probe", ""),
    };
    let of: fn(&Round) -> Option<Ratios> = match name {
        "cyclictest" => |round| round.over_cyclictest,
        _ => |round| round.over_wakeup,
    };
    let rounds = match medians.rounds {
        1 => "the one round".into(),
        rounds => format!("median of {rounds} rounds"),
    };
    let hollow = if report.rounds.iter().any(Round::is_bad) {
        ", hollow if shaded above"
    } else {
        ""
    };
    let thin = if other.is_empty() {
        ""
    } else {
        "; thin bar: over our own probe"
    };
    let note = format!(
        "Distance of the SoC period from nominal divided by wake-up latency; left of 1 is better. Bar: {rounds} over {name}; dots: \
         each round{hollow}{thin}. Upright marks: the goals on a quiet and on a busy PC."
    );
    for (line, at) in wrapped(&note, LINE).iter().zip(0..) {
        sheet.text((LEFT.0, top + 18.0 + 15.0 * f64::from(at)), SMALL, line);
    }
    let each: Vec<(bool, Ratios)> = report
        .rounds
        .iter()
        .filter_map(|round| Some((round.is_bad(), of(round)?)))
        .collect();
    let main = medians.over_cyclictest.or(medians.over_wakeup).unwrap_or_default();
    let thin = medians.over_cyclictest.and(medians.over_wakeup);
    let drawn = each.iter().map(|(_, ratios)| ratios).chain([&main]).chain(&thin);
    let values: Vec<f64> = drawn
        .flat_map(|ratios| FIGURES.map(|(_, figure)| figure(ratios)))
        .filter(|value| value.is_finite() && *value > 0.0)
        .collect();
    let least = values.iter().copied().fold(0.02, f64::min).max(1e-4);
    let most = values.iter().copied().fold(5.0, f64::max).min(1e4);
    let axis = Log::holding(least, most, AXIS);
    let first = top + 70.0;
    let base = first + ROW * FIGURES.len() as f64;
    ticks(sheet, &axis, (first - 8.0, base), |tick| format!("{tick}"));
    let one = axis.place(1.0);
    sheet.line((one, first - 8.0), (one, base), INK, 2.0, "");
    for ((name, figure), at) in FIGURES.iter().zip(0..) {
        let y = first + ROW * f64::from(at) + 16.0;
        sheet.text((LEFT.0, y + BAR), Face::new(14.0, INK), name);
        let value = Face::new(16.0, SOC).bold().at(Anchor::End);
        sheet.text((AXIS.0 - 12.0, y + BAR), value, &ratio(figure(&main)));
        bar(sheet, &axis, figure(&main), (y, BAR), SOC);
        if let Some(thin) = &thin {
            bar(sheet, &axis, figure(thin), (y + BAR + 3.0, 4.0), WAKEUP);
        }
        for (bad, ratios) in &each {
            sheet.dot((axis.place(figure(ratios)), y + BAR / 2.0), 3.2, INK, !bad);
        }
        goals(sheet, &axis, *figure, y, figure(&main));
    }
    sheet.text((one, first - 12.0), BODY.at(Anchor::Middle), "1: as exact as a wake-up");
    sheet.line((AXIS.0, base), (AXIS.1, base), INK, 1.0, "");
    caption(sheet, base, "ratio, logarithmic: ← better, worse →")
}

/// A bar from 1 to a value.
fn bar(sheet: &mut Sheet, axis: &Log, value: f64, (top, height): (f64, f64), colour: &str) {
    if value.is_finite() {
        let (a, b) = (axis.place(1.0), axis.place(value));
        sheet.rectangle((a.min(b), top), (a.max(b), top + height), colour);
    }
}

/// The goals of a figure as marks, and whether the value of the bar keeps them.
fn goals(sheet: &mut Sheet, axis: &Log, figure: Figure, y: f64, value: f64) {
    let mut labels = Labels::new(SMALL, (AXIS.0, AXIS.1));
    for goal in GOALS {
        let most = figure(&goal.ratios);
        let x = axis.place(most);
        sheet.line((x, y - 5.0), (x, y + BAR + 5.0), ALARM, 2.5, "");
        let name = goal.name.split(' ').next().unwrap_or_default();
        let kept = if value <= most { "kept" } else { "missed" };
        let text = format!("{name} ≤ {most}: {kept}");
        if let Some((_, anchor)) = labels.find(x, &text, 1) {
            let beside = if anchor == Anchor::Start { -1.0 } else { 1.0 };
            sheet.text_over((x + beside, y - 8.0), Face::new(12.0, ALARM).at(anchor), &text);
        }
    }
}
