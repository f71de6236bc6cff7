//! The report: every line fits, and what matters most comes first.

use super::fake::Fake;
use crate::doctor::{Finding, LINES, Latency, Level, Report, State, examine};

/// One finding for each name, as the line of that name would tell it.
fn finding(name: &str, state: State, fix: Option<&str>) -> Finding {
    Finding {
        line: LINES.iter().find(|line| line.name == name).unwrap(),
        state,
        found: "something".into(),
        fix: fix.map(str::to_owned),
        latency: None,
    }
}

fn report(findings: Vec<Finding>) -> Report {
    Report {
        about: vec!["a PC".into()],
        findings,
    }
}

#[test]
fn the_summary_has_each_cure_once_with_the_highest_level_first() {
    let report = report(vec![
        finding("isolated", State::Missing, Some("reboot")),
        finding("SCHED_FIFO", State::Missing, Some("grant")),
        finding("locked memory", State::Missing, Some("grant")),
        finding("nohz_full", State::Missing, Some("reboot")),
        finding("queues", State::Missing, Some("one queue")),
        finding("EEE", State::Unknown, Some("look as root")),
        finding("swap", State::Ok, None),
    ]);
    let text = report.to_string();
    let summary = text
        .split_once("\n\n")
        .and_then(|(_, rest)| rest.split_once("\n\n"))
        .unwrap()
        .1;
    assert_eq!(
        summary,
        "2 musts, 1 should and 2 infos missing; 1 cannot be told.\n\
         First do:\n  -> grant\n        for SCHED_FIFO, locked memory\n\
         Then, for better figures:\n  -> reboot\n        for isolated, nohz_full\n"
    );
    assert_eq!(Level::ALL.map(|level| report.missing(level)), [2, 1, 2]);
}

#[test]
fn a_line_has_state_name_found_wanted_and_level_and_its_cure_below() {
    let text = report(vec![finding("swap", State::Missing, Some("sudo swapoff -a"))]).to_string();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[2..6],
        [
            "                           found                                 wanted                      level",
            "memory",
            "  MISS swap                something                             none, or vm.swappiness 1    should",
            "       -> sudo swapoff -a",
        ]
    );
}

#[test]
fn whatever_is_found_fits_into_100_columns_and_no_command_is_broken_in_a_word() {
    let mut fake = Fake::good();
    fake.answers.addresses = Ok(vec!["fe80::fc00:fffe:1234:5678:9abc:def0".into(); 9]);
    fake.answers.fifo = Err("Ä".repeat(200));
    fake.answers.dma_latency = Err("not allowed".into());
    fake.write("/sys/devices/virtual/workqueue/cpumask", b"ffffffff,ffffffff");
    let text = report(examine(&fake.pc())).to_string();
    for line in text.lines() {
        assert!(line.chars().count() <= 100, "{line}");
        assert_eq!(line, line.trim_end());
    }
    assert!(text.contains("--no-deep-idle"), "{text}");
}

#[test]
fn every_wanted_value_and_name_fits_its_column() {
    for line in LINES {
        assert!(line.name.len() <= 19, "{}", line.name);
        assert!(line.wanted.len() <= 27, "{}: {}", line.name, line.wanted);
    }
}

#[test]
fn json_tells_the_same() {
    let mut measured = finding("wake-up latency", State::Missing, Some("look"));
    measured.latency = Some(Latency {
        n: 5,
        p50_us: 1.5,
        p99_us: 2.0,
        p99_9_us: 3.0,
        max_us: 60.0,
    });
    let json = report(vec![finding("swap", State::Ok, None), measured]).to_json();
    assert_eq!(
        json["missing"],
        serde_json::json!({ "must": 0, "should": 1, "info": 0 })
    );
    assert_eq!(json["unknown"], 0);
    assert_eq!(
        json["lines"][0],
        serde_json::json!({
            "name": "swap", "group": "memory", "level": "should", "state": "ok", "found": "something",
            "wanted": "none, or vm.swappiness 1", "fix": null,
        })
    );
    assert_eq!(json["lines"][1]["latency"]["p99_9_us"], 3.0);
    assert_eq!(json["lines"][1]["state"], "missing");
}
