use super::*;
use crate::samples;
use proptest::prelude::*;

/// Every text of a picture, after checking that it is well-formed XML.
fn texts(svg: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).unwrap_or_else(|error| panic!("{error}\n{svg}"));
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.map(|node| node.text().unwrap_or_default().to_owned()).collect()
}

fn says(svg: &str, wanted: &str) -> bool {
    texts(svg).iter().any(|text| text.contains(wanted))
}

#[test]
fn the_title_says_what_was_found() {
    let mut report = samples::one_round();
    report.all.soc_period = samples::distribution(1_000_000, [999_000, 1_000_000, 1_001_000, 1_000_000]);
    assert_eq!(
        finding(&report),
        "SoC period of 1 ms: 99.9 % within 1 µs, std dev 707 ns, range 2 µs; no cycle left out"
    );
    report.rounds[0].control.overruns = 1234;
    assert!(finding(&report).ends_with("; 1,234 cycles left out"));
    report.all.wakeup = samples::distribution(0, [5_000_000; 4]);
    let said = comparison(&report).unwrap();
    assert!(
        said.contains("(our own probe): 99.9 % within 5 ms, std dev 0 ns, 5 ms at worst"),
        "{said}"
    );
    assert_eq!(
        finding(&samples::empty()),
        "Jitter of the bus cycle: nothing was measured"
    );
    assert_eq!(comparison(&samples::empty()), None);
    assert!(finding(&samples::without_far_end()).starts_with("SoC period of 1 ms by its own clock: 99.9 % within "));
    let mut sent = samples::without_far_end();
    sent.all.soc_period = Default::default();
    assert!(finding(&sent).starts_with("Cycle of 1 ms: 99.9 % of the SoC sent within "));
}

#[test]
fn every_part_is_named_where_it_stands() {
    let svg = svg(&samples::quiet());
    for wanted in [
        "SoC period on the wire",
        "SoC sent by the control",
        "wake-up, own probe",
        "wake-up, cyclictest",
        "n = 100,000",
        "distance from the date that was due",
        "round 5",
        "100 s",
        "time with the program running",
        "cyclictest, per round",
        "1: as exact as a wake-up",
        "quiet ≤ 0.05: kept",
        "busy ≤ 1.5: kept",
        "ratio, logarithmic",
    ] {
        assert!(says(&svg, wanted), "{wanted}");
    }
    assert!(!says(&svg, "a cycle was left out"));
    assert!(svg.len() < 300_000, "{} octets", svg.len());
}

#[test]
fn overruns_stalls_and_missed_goals_are_marked() {
    let report = samples::very_bad();
    let svg = svg(&report);
    assert!(says(&svg, "from 500 µs: a cycle was left out"));
    assert!(says(&svg, "round 2! the host took 20 ms of the core"));
    assert!(says(&svg, "quiet ≤ 0.05: missed"));
    assert!(svg.contains("<polygon"));
    assert_eq!(svg.matches(BAD).count(), 5);
}

#[test]
fn what_is_missing_is_said() {
    assert!(says(&svg(&samples::empty()), "Nothing was measured."));
    let alone = svg(&samples::without_far_end());
    assert!(says(&alone, "Nobody of ours listened at the far end"));
    assert!(says(&alone, "SoC period, own clock"));
    let mut without_floor = samples::quiet();
    (without_floor.medians.over_cyclictest, without_floor.medians.over_wakeup) = (None, None);
    assert!(says(&svg(&without_floor), "No ratios"));
    assert!(says(&svg(&samples::one_round()), "own probe, per round"));
    assert!(texts(&svg(&samples::huge())).len() > 40);
}

#[test]
fn names_from_outside_are_no_markup() {
    let mut report = samples::one_round();
    report.settings.program = "<b>\u{1} & \"x\" \u{FFFE}".into();
    assert!(says(&svg(&report), "<b> & \"x\""));
}

proptest! {
    #[test]
    fn no_report_panics_and_every_picture_is_xml(
        which in 0usize..6,
        floats in prop::collection::vec(any::<f64>(), samples::STRANGE),
        buckets in prop::collection::vec((any::<i64>(), any::<i64>(), any::<u64>()), 0..6),
        n in any::<u64>(),
        cycle_us in any::<u32>(),
        name in any::<String>(),
    ) {
        let svg = svg(&samples::strange(which, &floats, &buckets, n, cycle_us, &name));
        prop_assert!(!texts(&svg).is_empty());
        prop_assert!(!svg.contains("NaN") || name.contains("NaN"));
    }
}
