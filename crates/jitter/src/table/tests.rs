use super::*;
use crate::samples;
use proptest::prelude::*;

#[test]
fn every_report_fits_100_columns() {
    for report in samples::all() {
        let text = table(report);
        for line in text.lines() {
            assert!(line.chars().count() <= WIDTH, "{line}");
            assert_eq!(line, line.trim_end());
        }
        assert!(!text.contains("\n\n\n") && !text.ends_with('\n'), "{text}");
    }
}

/// The line that begins so.
fn line<'a>(text: &'a str, begins: &str) -> &'a str {
    text.lines()
        .find(|line| line.starts_with(begins))
        .unwrap_or_else(|| panic!("no line '{begins}' in\n{text}"))
}

fn cells<'a>(text: &'a str, begins: &str) -> Vec<&'a str> {
    line(text, begins)[begins.len()..].split_whitespace().collect()
}

#[test]
fn figures_stand_under_their_names() {
    let mut report = samples::one_round();
    report.all.soc_period = samples::distribution(1_000_000, [999_000, 1_000_000, 1_001_000, 1_000_000]);
    report.all.lateness = samples::distribution(0, [12; 9]);
    report.all.wakeup = samples::distribution(0, [5_000_000; 4]);
    report.all.cyclictest = samples::cyclictest([3; 2]);
    let text = table(&report);
    assert_eq!(cells(&text, "  cycle 1000"), ["1000.000", "2.000", "0.707", "4"]);
    assert_eq!(
        cells(&text, "  SoC period, early or late"),
        ["0.000", "1.000", "1.000", "1.000", "1.000", "4"]
    );
    assert_eq!(
        cells(&text, "  position error at 30 m/min, µm"),
        ["0.000", "0.500", "0.500", "0.500", "0.500"]
    );
    let latest = ["0.012", "0.012", "0.012", "0.012", "0.012", "9"];
    assert_eq!(cells(&text, "  control, beginning of a cycle late"), latest);
    assert_eq!(
        cells(&text, "  own probe, wake-up late"),
        ["5,000", "5,000", "5,000", "5,000", "5,000", "4"]
    );
    assert_eq!(
        cells(&text, "  goal on a tuned PC, real card"),
        ["<", "12", "<", "1", "20,000,000"]
    );
    assert!(!text.contains("clock of the bus"), "{text}");
    report.settings.sync0_us = Some(500.0);
    report.rounds[0].control.phase = Some(PhaseFigures {
        n: 9,
        mean_us: 0.25,
        std_us: 0.125,
        min_us: -0.5,
        max_us: 1.0,
        range_us: 1.5,
    });
    report.settings.protocol = "ethercat".into();
    report.settings.far_end = "simulated devices".into();
    let words = table(&report);
    assert!(
        !words.contains("SoC") && words.contains("frame period at the far end, µs"),
        "{words}"
    );
    assert_eq!(
        cells(&table(&report), "  cycle begins before SYNC0"),
        ["499.750", "1.500", "0.125", "9"]
    );
    assert_eq!(
        cells(&text, "  drives, motion, set-points"),
        ["3.200", "3.200", "4.800", "6.400", "1.600", "12.80"]
    );
    assert!(text.contains("cyclictest is not installed"), "{text}");
}

#[test]
fn goals_are_marked_kept_or_not() {
    let mut report = samples::quiet();
    let ratios = |p50, p99, p99_9, std| Some(Ratios { p50, p99, p99_9, std });
    report.medians.over_cyclictest = ratios(0.05, 0.21, 0.15, 0.11);
    report.medians.overruns_per_10000 = 0.5;
    report.all.soc_period.figures.std_us = 1.25;
    let text = table(&report);
    assert_eq!(
        cells(&text, "  over cyclictest, median of 5"),
        ["0.050", "0.21", "0.15", "0.11", "0.50", "1.250"]
    );
    let goal = |text: &str, begins| cells(text, begins).join(" ");
    let quiet = "  goal on a quiet PC, at most";
    assert_eq!(goal(&text, quiet), "0.05 ✓ 0.2 ✗ 0.15 ✓ 0.1 ✗ 0 ✗ 2 ✓");
    assert_eq!(
        goal(&text, "  goal on a busy PC, at most"),
        "0.15 ✓ 0.8 ✓ 1.5 ✓ 1 ✓ 5 ✓"
    );
    assert!(text.contains("by the median over cyclictest"));
    // NaN keeps no goal; without cyclictest the own probe judges; without either nothing does.
    report.medians.over_cyclictest = ratios(f64::NAN, 0.1, 0.1, 0.1);
    assert!(goal(&table(&report), quiet).starts_with("0.05 ✗ 0.2 ✓"));
    report.medians.over_cyclictest = None;
    let text = table(&report);
    assert_eq!(cells(&text, "  over cyclictest, median of 5"), ["-"; 6]);
    assert!(text.contains("by the median over own probe"));
    report.medians.over_wakeup = None;
    assert_eq!(goal(&table(&report), quiet), "0.05 0.2 0.15 0.1 0 2");
}

#[test]
fn bad_rounds_are_marked_and_explained() {
    let mut report = samples::very_bad();
    for round in &mut report.rounds {
        round.stalls.clear();
    }
    report.rounds[1].stalls = vec![
        "the host took 20 ms of the core".into(),
        "a SoC came 12.3 ms late".into(),
    ];
    let text = table(&report);
    assert_eq!(
        line(&text, "  2!"),
        "  2! the host took 20 ms of the core; a SoC came 12.3 ms late"
    );
    assert!(line(&text, "   2!").ends_with("2.5   20ms"), "{text}");
    assert!(line(&text, "   1 ").ends_with("2.5      0"), "{text}");
    assert!(text.contains("\"good rounds\""));
    assert!(!table(&samples::quiet()).contains('!'));
}

#[test]
fn what_was_not_measured_is_said() {
    assert!(table(&samples::empty()).ends_with("Nothing was measured."));
    let mut report = samples::without_far_end();
    report.notes = vec!["the machine stopped".into()];
    let text = table(&report);
    assert!(text.contains("isocnc jitter --interface IF --listen"), "{text}");
    assert!(text.contains("SoC period by its own clock, µs"), "{text}");
    assert!(text.ends_with("\n\nnote: the machine stopped"));
    assert!(table(&samples::huge()).contains("1.000e11"));
}

proptest! {
    #[test]
    fn no_report_panics(
        which in 0usize..6,
        floats in prop::collection::vec(any::<f64>(), samples::STRANGE),
        buckets in prop::collection::vec((any::<i64>(), any::<i64>(), any::<u64>()), 0..6),
        n in any::<u64>(),
        cycle_us in any::<u32>(),
        name in ".*",
    ) {
        let report = samples::strange(which, &floats, &buckets, n, cycle_us, &name);
        prop_assert!(!table(&report).is_empty());
        prop_assert!(!super::super::csv::histogram(&report).is_empty());
    }
}
