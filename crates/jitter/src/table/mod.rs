//! The figures of a jitter measurement for people: at most 100 columns, the published form first.
//!
//! In:  [`JitterReport`]. Out: text for the terminal and for documents.

use super::Distribution;
use super::goals::{GOALS, Goal, TUNED_CYCLES, TUNED_RANGE_US, TUNED_STD_US};
use super::ratios::{Ratios, period};
use super::report::{JitterReport, Medians, Round};
use super::words::{elided, ended, far_end_listened, grouped, pc, ratio, short_time, total, us, wrapped};
use analyser::MICROMETRES_PER_US;
use config::{Protocol, ProtocolWords};
use host::histogram::Summary;
use rt::phase::PhaseFigures;
use std::fmt::Write;

/// Width of the text and of its first column.
const WIDTH: usize = 100;
const NAME: usize = 36;
/// Width of the other columns.
const CELL: usize = 10;
/// Width of a heading beside a sentence.
const HEADING: usize = 10;

/// The whole report as text, without a line end after its last line.
pub fn table(report: &JitterReport) -> String {
    let mut text = Text {
        words: Protocol::named(&report.settings.protocol)
            .unwrap_or(Protocol::Powerlink)
            .words(),
        lines: String::new(),
    };
    head(&mut text, report);
    if report.rounds.is_empty() {
        text.say("Nothing was measured.");
    } else {
        published(&mut text, report);
        lateness(&mut text, report);
        phase(&mut text, report);
        inside(&mut text, report);
        missed(&mut text, report);
        ratios(&mut text, report);
        rounds(&mut text, report);
    }
    for note in &report.notes {
        text.gap();
        text.say(&format!("note: {note}"));
    }
    text.lines.trim_end().to_owned()
}

fn head(text: &mut Text, report: &JitterReport) {
    let settings = &report.settings;
    text.say(&format!(
        "Jitter of the bus cycle: {} at {} µs while {} ran",
        settings.machine,
        grouped(settings.cycle_us.into()),
        elided(&settings.program, 60)
    ));
    text.told("PC", &pc(report));
    text.told("far end", &settings.far_end);
    text.told(
        "settings",
        &format!(
            "phase {} µs, spin {} µs, kept awake by: {}; priority {}, time-out thread every {} µs",
            settings.phase_us, settings.spin_us, settings.keep_awake, settings.priority, settings.timeout_us
        ),
    );
    text.told(
        "measured",
        &format!(
            "{} of {} rounds, {} of {} cycles; {}",
            report.rounds.len(),
            settings.rounds,
            grouped(total(report, |round| round.control.cycles)),
            grouped(settings.cycles),
            ended(report)
        ),
    );
    text.gap();
}

/// The form in which such measurements are published.
fn published(text: &mut Text, report: &JitterReport) {
    let listened = far_end_listened(report);
    let title = if listened {
        "SoC period at the far end, µs"
    } else {
        "SoC period by its own clock, µs"
    };
    text.row(title, ["mean", "max range", "std dev", "n"]);
    let figures = &report.all.soc_period.figures;
    let name = format!("  cycle {}", report.settings.cycle_us);
    if figures.n == 0 {
        text.row(&name, ["-", "-", "-", "0"]);
    } else {
        text.row(
            &name,
            [
                format!("{:.3}", figures.mean_us),
                us(figures.range_us),
                us(figures.std_us),
                count(figures.n),
            ],
        );
    }
    text.row(
        "  goal on a tuned PC, real card",
        [
            String::new(),
            format!("< {TUNED_RANGE_US}"),
            format!("< {TUNED_STD_US}"),
            grouped(TUNED_CYCLES),
        ],
    );
    if !listened {
        text.say("  nobody of ours listened at the far end; on a PC there: isocnc jitter --interface IF --listen");
    }
    text.gap();
}

/// The SoC beside the floor of the PC.
fn lateness(text: &mut Text, report: &JitterReport) {
    let all = &report.all;
    text.row("Away from its date, µs", ["p50", "p99", "p99.9", "p99.99", "max", "n"]);
    let period = &all.soc_period;
    let row = |scale: f64, n: String| {
        let [p50, p99, p99_9, p99_99, max] =
            [0.5, 0.99, 0.999, 0.9999, 1.0].map(|quantile| us(scale * period.deviation_quantile_us(quantile)));
        [p50, p99, p99_9, p99_99, max, n]
    };
    if period.figures.n > 0 {
        text.row("  SoC period, early or late", row(1.0, count(period.figures.n)));
        text.row(
            "  position error at 30 m/min, µm",
            row(MICROMETRES_PER_US, String::new()),
        );
    }
    let cyclictest = report.rounds.iter().find_map(|round| round.floor.cyclictest.as_ref());
    let cyclictest = cyclictest.map_or("  cyclictest".into(), |found| {
        format!("  cyclictest {}, wake-up late", elided(&found.version, 8))
    });
    for (name, of) in [
        ("  control, beginning of a cycle late", &all.lateness),
        ("  own probe, wake-up late", &all.wakeup),
        (&cyclictest, &all.cyclictest),
    ] {
        let Distribution { figures, .. } = of;
        if figures.n > 0 {
            let of = [
                figures.p50_us,
                figures.p99_us,
                figures.p99_9_us,
                figures.p99_99_us,
                figures.max_us,
            ]
            .map(us);
            let [p50, p99, p99_9, p99_99, max] = of;
            text.row(name, [p50, p99, p99_9, p99_99, max, count(figures.n)]);
        }
    }
    let scans: Vec<_> = report
        .rounds
        .iter()
        .filter_map(|round| round.floor.gaps.as_ref())
        .collect();
    if let Some(first) = scans.first() {
        let longest_us = scans.iter().map(|scan| scan.gaps.figures.max_us).fold(0.0, f64::max);
        let seconds: f64 = scans.iter().map(|scan| scan.scanned_s).sum();
        let gaps = scans
            .iter()
            .map(|scan| scan.gaps.figures.n)
            .fold(0, u64::saturating_add);
        text.say(&format!(
            "  the core by itself stood still for {} at most ({} gaps of {} and more in {seconds:.0} s)",
            short_time(longest_us),
            grouped(gaps),
            short_time(first.threshold_us),
        ));
    }
    let mut told: Vec<&String> = report.rounds.iter().flat_map(|round| &round.floor.notes).collect();
    told.dedup();
    told.iter().for_each(|note| text.say(&format!("  {note}")));
    text.gap();
}

/// How cycles lie to the pulses by which the drives live, where the clock of the bus leads.
fn phase(text: &mut Text, report: &JitterReport) {
    let phases = report.rounds.iter().filter_map(|round| round.control.phase.as_ref());
    let phases: Vec<&PhaseFigures> = phases.collect();
    if phases.is_empty() {
        return;
    }
    text.row("Phase to the clock of the bus, µs", ["mean", "range", "std dev", "n"]);
    let (name, behind_us) = match report.settings.sync0_us {
        Some(sync0_us) => ("  cycle begins before SYNC0", sync0_us),
        None => ("  cycle begins before its time there", 0.0),
    };
    let n = phases.iter().map(|phase| phase.n).fold(0, u64::saturating_add);
    let mean_us = phases.iter().map(|phase| phase.mean_us * (phase.n as f64 / n as f64));
    let worst = |of: fn(&PhaseFigures) -> f64| phases.iter().map(|phase| of(phase)).fold(0.0, f64::max);
    text.row(
        name,
        [
            format!("{:.3}", behind_us - mean_us.sum::<f64>()),
            us(worst(|phase| phase.range_us)),
            us(worst(|phase| phase.std_us)),
            count(n),
        ],
    );
    text.gap();
}

/// What a cycle is filled with.
fn inside(text: &mut Text, report: &JitterReport) {
    text.row(
        "Inside a cycle, µs (worst round)",
        ["mean", "p50", "p99", "p99.9", "least", "most"],
    );
    type Part = fn(&Round) -> &Summary;
    let parts: [(&str, Part); 4] = [
        ("  awake after its date", |round| &round.control.wake_up),
        ("  exchange with the drives", |round| &round.control.exchange),
        ("  drives, motion, set-points", |round| &round.control.compute),
        ("  free until the next cycle", |round| &round.control.free),
    ];
    for (name, of) in parts {
        let figures: Vec<&Summary> = report.rounds.iter().map(of).filter(|figures| figures.n > 0).collect();
        if figures.is_empty() {
            text.row(name, ["-"; 6]);
            continue;
        }
        let n: f64 = figures.iter().map(|figures| figures.n as f64).sum();
        let mean = figures
            .iter()
            .map(|figures| figures.mean_us * (figures.n as f64 / n))
            .sum();
        let each = |of: fn(&Summary) -> f64| figures.iter().map(move |figures| of(figures));
        let worst = |of| each(of).fold(f64::NEG_INFINITY, f64::max);
        let least = each(|figures| figures.min_us).fold(f64::INFINITY, f64::min);
        let cells = [
            mean,
            worst(|figures| figures.p50_us),
            worst(|figures| figures.p99_us),
            worst(|figures| figures.p99_9_us),
            least,
            worst(|figures| figures.max_us),
        ];
        text.row(name, cells.map(us));
    }
    text.gap();
}

fn missed(text: &mut Text, report: &JitterReport) {
    let missing = total(report, |round| {
        round.soc_period.as_ref().map_or(0, |soc| soc.breaks.soc_missing)
    });
    text.say(&format!(
        "Missed: {} cycles left out ({:.2} per 10,000); {} SoC missing on the wire; {} answers of drives lost",
        grouped(total(report, |round| round.control.overruns)),
        report.all.overruns_per_10000,
        grouped(missing),
        grouped(total(report, |round| round.control.pres_lost)),
    ));
    let thread =
        |of: fn(&rt::cycle_stats::ThreadUsage) -> u64| grouped(total(report, |round| of(&round.control.thread)));
    text.say(&format!(
        "Cycle thread: {} page faults, given way to other threads {} times",
        thread(|usage| usage.page_faults),
        thread(|usage| usage.preemptions)
    ));
    let mut faults: Vec<&String> = report.rounds.iter().flat_map(|round| &round.control.faults).collect();
    faults.dedup();
    faults
        .iter()
        .for_each(|fault| text.say(&format!("  stopped by: {fault}")));
    text.gap();
}

/// The SoC period over the floor, with the goals beside.
fn ratios(text: &mut Text, report: &JitterReport) {
    let names = ["p50", "p99", "p99.9", "std dev", "overruns", "std dev, µs"];
    text.row("Ratio to the floor of the same round", names);
    text.say("  distance of the SoC period from nominal / wake-up latency; below 1: better than a wake-up");
    let std_us = report.all.soc_period.figures.std_us;
    let (mut judged, mut judged_over) = (None, "");
    let all = ("median", Some(&report.medians));
    let good = ("good rounds", report.medians_good_rounds.as_ref());
    for (which, medians) in [all, good] {
        let Some(medians) = medians else { continue };
        for (over, found) in [
            ("cyclictest", medians.over_cyclictest),
            ("own probe", medians.over_wakeup),
        ] {
            let name = format!("  over {over}, {which} of {}", medians.rounds);
            let Some(found) = found else {
                text.row(&name, ["-"; 6]);
                continue;
            };
            let [p50, p99, p99_9, std] = found.figures().map(ratio);
            if judged.is_none() {
                (judged, judged_over) = (Some(found), over);
                let overruns = format!("{:.2}", medians.overruns_per_10000);
                text.row(&name, [p50, p99, p99_9, std, overruns, us(std_us)]);
            } else {
                text.row(&name, [p50, p99, p99_9, std, String::new(), String::new()]);
            }
        }
    }
    for goal in GOALS {
        text.row(
            &format!("  goal on a {}, at most", goal.name),
            against(&goal, judged, &report.medians, std_us),
        );
    }
    if judged.is_some() {
        text.say(&format!(
            "  ✓ kept, ✗ not kept, by the median over {judged_over}; overruns per 10,000 cycles"
        ));
    }
    text.gap();
}

/// The figures of a goal, each marked whether it is kept.
fn against(goal: &Goal, found: Option<Ratios>, medians: &Medians, std_us: f64) -> [String; 6] {
    let [p50, p99, p99_9, std] = goal.ratios.figures();
    let found = found.map(|found| found.figures());
    let ratio_of = |at: usize| found.map(|found| found[at]);
    let others = found.map(|_| (medians.overruns_per_10000, std_us));
    let cell = |most: f64, found: Option<f64>| match found {
        None => format!("{most}  "),
        Some(found) if found <= most => format!("{most} ✓"),
        // NaN is not kept either.
        Some(_) => format!("{most} ✗"),
    };
    [
        cell(p50, ratio_of(0)),
        cell(p99, ratio_of(1)),
        cell(p99_9, ratio_of(2)),
        cell(std, ratio_of(3)),
        cell(goal.overruns_per_10000, others.map(|others| others.0)),
        goal.std_us
            .map_or(String::new(), |most| cell(most, others.map(|others| others.1))),
    ]
}

/// One line per round.
fn rounds(text: &mut Text, report: &JitterReport) {
    const WIDTHS: [usize; 11] = [5, 9, 9, 9, 9, 10, 12, 9, 9, 7, 7];
    let line = |cells: [String; 11]| -> String {
        let cells = cells.iter().zip(WIDTHS).map(|(cell, width)| format!("{cell:>width$}"));
        cells.collect::<String>().trim_end().to_owned()
    };
    text.say("Rounds: SoC period and wake-up latency, µs");
    let names = [
        "", "std dev", "range", "p99.9", "max", "overruns", "floor", "p99.9", "max", "load", "steal",
    ];
    text.line(&line(names.map(str::to_owned)));
    for round in &report.rounds {
        let period = period(round);
        let measured = |value: f64| if period.figures.n > 0 { us(value) } else { "-".into() };
        let floor = round.floor.latency().map(|(name, latency)| (name, latency.figures));
        let load = round.load_with_program;
        let steal_ms = load.steal_ms + round.load_at_floor.steal_ms;
        let mark = if round.is_bad() { '!' } else { ' ' };
        text.line(&line([
            format!("{}{mark}", round.number),
            measured(period.figures.std_us),
            measured(period.figures.range_us),
            measured(period.deviation_quantile_us(0.999)),
            measured(period.deviation_quantile_us(1.0)),
            grouped(round.control.overruns),
            floor.map_or("-".into(), |(name, _)| name.into()),
            floor.map_or("-".into(), |(_, figures)| us(figures.p99_9_us)),
            floor.map_or("-".into(), |(_, figures)| us(figures.max_us)),
            format!("{:.1}", load.load_average_after.min(9999.0)),
            if steal_ms > 0.0 {
                short_time(steal_ms * 1000.0).replace(' ', "")
            } else {
                "0".into()
            },
        ]));
    }
    let bad: Vec<&Round> = report.rounds.iter().filter(|round| round.is_bad()).collect();
    for round in &bad {
        text.say(&format!("  {}! {}", round.number, round.stalls.join("; ")));
    }
    if !bad.is_empty() {
        text.say("  ! says more of the PC than of the control; such rounds count in all figures but \"good rounds\".");
    }
}

/// Name and cells at their places; few cells are wider.
fn padded<const N: usize>(name: &str, cells: [impl AsRef<str>; N]) -> String {
    let mut line = format!("{name:<NAME$}");
    for (at, cell) in cells.iter().enumerate() {
        let width = if N <= 4 || at + 1 == N { CELL + 2 } else { CELL };
        let _ = write!(line, "{:>width$}", cell.as_ref());
    }
    line
}

/// A number of values that fits its column.
fn count(n: u64) -> String {
    if n < 1_000_000_000 {
        grouped(n)
    } else {
        format!("{:.3e}", n as f64)
    }
}

/// Lines under each other.
struct Text {
    lines: String,
    words: ProtocolWords,
}

impl Text {
    fn line(&mut self, line: &str) {
        self.lines.push_str(line.trim_end());
        self.lines.push('\n');
    }

    /// In the words of the bus.
    fn worded(&self, text: &str) -> String {
        text.replace("SoC", self.words.frame)
    }

    fn row<const N: usize>(&mut self, name: &str, cells: [impl AsRef<str>; N]) {
        self.line(&padded(&self.worded(name), cells));
    }

    /// A sentence, on several lines if it must; those that follow are indented by two more.
    fn say(&mut self, sentence: &str) {
        let sentence = &self.worded(sentence);
        let indent = sentence.len() - sentence.trim_start().len();
        for (at, line) in wrapped(sentence, WIDTH - indent - 2).iter().enumerate() {
            let more = if at == 0 { 0 } else { 2 };
            self.line(&format!("{:width$}{line}", "", width = indent + more));
        }
    }

    /// A sentence in a column of its own beside a heading.
    fn told(&mut self, heading: &str, sentence: &str) {
        for (at, line) in wrapped(sentence, WIDTH - HEADING).iter().enumerate() {
            let heading = if at == 0 { heading } else { "" };
            self.line(&format!("{heading:<HEADING$}{line}"));
        }
    }

    /// An empty line, once.
    fn gap(&mut self) {
        if !self.lines.is_empty() && !self.lines.ends_with("\n\n") {
            self.lines.push('\n');
        }
    }
}

#[cfg(test)]
mod tests;
