//! The picture of a jitter measurement: how far from its date, how often; when; and against what.
//!
//! In:  [`JitterReport`]. Out: one SVG, 1200 pixels wide, readable without colours.
//!
//! | part | file |
//! |---|---|
//! | distributions, one above the other | `histogram.rs` |
//! | longest periods over time | `maxima.rs` |
//! | ratios to the floor of the PC, with the goals | `ratios.rs` |

mod histogram;
mod maxima;
mod ratios;
mod scale;

use super::ratios::merged;
use super::report::{Ended, JitterReport, Medians, Pc, Round, Settings};
use super::words::{elided, ended, far_end_listened, grouped, pc, short_time, total, wrapped};
use analyser::SocReport;
use plot::sheet::{Anchor, Face, Sheet};

const WIDTH: f64 = 1200.0;
/// Left and right ends of what stands beside the axes, and of the axes.
const LEFT: (f64, f64) = (24.0, 210.0);
const AXIS: (f64, f64) = (268.0, 1164.0);
const RIGHT: f64 = 1190.0;

const INK: &str = "#222222";
const FAINT: &str = "#606060";
const GRID: &str = "#e2e2e2";
/// Colours that people with any colour vision can tell apart; every part is named in words as well.
const SOC: &str = "#0060a0";
const CONTROL: &str = "#3a96c8";
const WAKEUP: &str = "#b07000";
const CYCLICTEST: &str = "#d08a20";
const ALARM: &str = "#c04000";
/// Behind a round that met a stall.
const BAD: &str = "#f4e8dc";

const HEADING: Face = Face::new(16.0, INK).bold();
const BODY: Face = Face::new(13.0, INK);
const SMALL: Face = Face::new(12.0, FAINT);
/// Characters of `SMALL` that fit the width.
const LINE: usize = 155;

/// Draws a measurement.
pub fn svg(report: &JitterReport) -> String {
    let mut sheet = Sheet::new(WIDTH);
    let mut y = 34.0;
    let title = Face::new(20.0, INK).bold();
    for line in wrapped(&finding(report), 98) {
        sheet.text((LEFT.0, y), title, &line);
        y += 26.0;
    }
    let mut lines = vec![what(report), pc(report)];
    if let Some(comparison) = comparison(report) {
        lines.insert(0, comparison);
    }
    for line in lines.iter().flat_map(|line| wrapped(line, 145)) {
        sheet.text((LEFT.0, y), BODY, &line);
        y += 18.0;
    }
    y = histogram::draw(&mut sheet, report, y + 24.0);
    if !report.rounds.is_empty() {
        y = maxima::draw(&mut sheet, report, y + 40.0);
        y = ratios::draw(&mut sheet, report, y + 40.0);
    }
    sheet.finish(y + 16.0)
}

/// Draws the period of the SoC at the far end of a run, with the same axes.
pub fn soc_period_svg(soc: &SocReport) -> String {
    let round = Round {
        number: 1,
        soc_period: Some(soc.clone()),
        ..Round::default()
    };
    let report = JitterReport {
        version: String::new(),
        result: Ended::Completed,
        notes: Vec::new(),
        pc: Pc::default(),
        settings: Settings {
            cycle_us: soc.cycle_us,
            ..Settings::default()
        },
        medians: Medians::default(),
        medians_good_rounds: None,
        all: merged(std::slice::from_ref(&round)),
        rounds: vec![round],
    };
    let mut sheet = Sheet::new(WIDTH);
    sheet.text(
        (LEFT.0, 34.0),
        Face::new(20.0, INK).bold(),
        &format!("SoC period at {}", soc.interface),
    );
    let figures = format!(
        "cycle {} us: mean {:.3} us, max range {:.3} us, std dev {:.3} us, n {}",
        soc.cycle_us, soc.period_mean_us, soc.period_range_us, soc.period_std_us, soc.n
    );
    sheet.text((LEFT.0, 58.0), BODY, &figures);
    let y = histogram::draw(&mut sheet, &report, 92.0);
    let y = maxima::draw(&mut sheet, &report, y + 40.0);
    sheet.finish(y + 16.0)
}

/// Upright lines at the powers of ten of an axis from left to right, with their values below.
fn ticks(sheet: &mut Sheet, axis: &scale::Log, (top, base): (f64, f64), named: fn(f64) -> String) {
    for tick in axis.ticks() {
        let x = axis.place(tick);
        sheet.line((x, top), (x, base), GRID, 1.0, "");
        sheet.text((x, base + 17.0), BODY.at(Anchor::Middle), &named(tick));
    }
}

/// What an axis from left to right is of; gives the lower end.
fn caption(sheet: &mut Sheet, base: f64, text: &str) -> f64 {
    let middle = (AXIS.0 + AXIS.1) / 2.0;
    sheet.text((middle, base + 35.0), BODY.at(Anchor::Middle), text);
    base + 40.0
}

/// What was found, as one sentence.
fn finding(report: &JitterReport) -> String {
    let all = &report.all;
    let cycle = short_time(f64::from(report.settings.cycle_us));
    if all.soc_period.figures.n == 0 {
        return match all.lateness.figures.n {
            0 => "Jitter of the bus cycle: nothing was measured".into(),
            _ => format!(
                "Cycle of {cycle}: 99.9 % of the SoC sent within {} of their date",
                short_time(all.lateness.quantile_us(0.999))
            ),
        };
    }
    let overruns = match total(report, |round| round.control.overruns) {
        0 => "no cycle left out".into(),
        1 => "1 cycle left out".into(),
        overruns => format!("{} cycles left out", grouped(overruns)),
    };
    let own = if far_end_listened(report) {
        ""
    } else {
        " by its own clock"
    };
    format!(
        "SoC period of {cycle}{own}: 99.9 % within {}, std dev {}, range {}; {overruns}",
        short_time(all.soc_period.deviation_quantile_us(0.999)),
        short_time(all.soc_period.figures.std_us),
        short_time(all.soc_period.figures.range_us),
    )
}

/// The floor of the PC beside it.
fn comparison(report: &JitterReport) -> Option<String> {
    let all = &report.all;
    let (name, floor) = match (all.cyclictest.figures.n, all.wakeup.figures.n) {
        (0, 0) => return None,
        (0, _) => ("our own probe", &all.wakeup),
        _ => ("cyclictest", &all.cyclictest),
    };
    Some(format!(
        "A thread that does nothing but wake up on the same core ({name}): 99.9 % within {}, std dev {}, {} at worst.",
        short_time(floor.quantile_us(0.999)),
        short_time(floor.figures.std_us),
        short_time(floor.figures.max_us),
    ))
}

fn what(report: &JitterReport) -> String {
    let settings = &report.settings;
    format!(
        "{} cycles in {} while {} ran on {}; {}.",
        grouped(total(report, |round| round.control.cycles)),
        match report.rounds.len() {
            1 => "one round".into(),
            rounds => format!("{rounds} rounds"),
        },
        elided(&settings.program, 50),
        elided(&settings.machine, 30),
        ended(report)
    )
}

#[cfg(test)]
mod tests;
