//! Every line against a PC made of a folder of files and of answers: one that is as it should be, changed in one place a
//! time.

mod cases;
mod fake;
mod report;

use super::*;
use cases::CASES;
use fake::{Answers, Fake};
use proptest::prelude::*;
use std::collections::BTreeSet;

fn names() -> BTreeSet<&'static str> {
    LINES.iter().map(|line| line.name).collect()
}

fn find<'a>(findings: &'a [Finding], name: &str) -> &'a Finding {
    let found = findings.iter().find(|finding| finding.line.name == name);
    found.unwrap_or_else(|| panic!("there is no line {name}"))
}

#[test]
fn names_stand_once_and_groups_stand_together() {
    assert_eq!(names().len(), LINES.len());
    let mut groups: Vec<Group> = LINES.iter().map(|line| line.group).collect();
    groups.dedup();
    let distinct: BTreeSet<_> = groups.iter().map(|group| group.name()).collect();
    assert_eq!(distinct.len(), groups.len());
}

#[test]
fn on_a_good_pc_every_line_is_ok() {
    let fake = Fake::good();
    let findings = examine(&fake.pc());
    assert_eq!(findings.len(), LINES.len());
    for finding in findings {
        assert_eq!(finding.state, State::Ok, "{}: {}", finding.line.name, finding.found);
        assert_eq!(finding.fix, None, "{}", finding.line.name);
    }
}

#[test]
fn every_change_is_found_by_its_line() {
    let mut wrong = Vec::new();
    for case in CASES {
        let mut fake = Fake::good();
        fake.change(case);
        let findings = examine(&fake.pc());
        let finding = find(&findings, case.line);
        let fix = finding.fix.as_deref().unwrap_or("");
        let has_fix = match case.state {
            State::Ok => fix.is_empty(),
            State::Missing => !fix.is_empty(),
            State::Unknown => true,
        };
        let told = finding.state == case.state && finding.found.contains(case.found) && fix.contains(case.fix);
        if !told || !has_fix {
            wrong.push(format!(
                "{case:?}\n  told {:?}, {:?}, fix {fix:?}",
                finding.state, finding.found
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_line_has_a_bad_case() {
    let bad = CASES.iter().filter(|case| case.state == State::Missing);
    let bad: BTreeSet<_> = bad.map(|case| case.line).collect();
    assert_eq!(bad, names());
}

#[test]
fn a_pc_that_tells_nothing_is_not_judged() {
    let mut fake = Fake::empty();
    fake.answers = Answers::none();
    for finding in examine(&fake.pc()) {
        assert_ne!(
            finding.state,
            State::Missing,
            "{}: {}",
            finding.line.name,
            finding.found
        );
    }
}

#[test]
fn what_was_not_named_or_wanted_has_no_line() {
    let mut fake = Fake::good();
    fake.target.test_time = None;
    fake.target.interface = None;
    let findings = examine(&fake.pc());
    let has = |group| findings.iter().filter(|finding| finding.line.group == group).count();
    assert_eq!(
        (has(Group::Measured), has(Group::Network)),
        (0, 1),
        "only that no interface was named"
    );
}

#[test]
fn no_single_file_is_needed() {
    let fake = Fake::good();
    for path in fake.paths() {
        fake.remove(&path);
        assert_eq!(examine(&fake.pc()).len(), LINES.len(), "without {path}");
        fake.write(&path, Fake::good_text(&path).as_bytes());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever files hold, every line says something and none panics.
    #[test]
    fn any_contents_are_survived(
        contents in proptest::collection::vec(any_contents(), 1..8),
        start in any::<usize>(),
    ) {
        let fake = Fake::good();
        for (nth, path) in fake.paths().iter().enumerate() {
            fake.write(path, &contents[start.wrapping_add(nth) % contents.len()]);
        }
        for finding in examine(&fake.pc()) {
            prop_assert!(!finding.found.is_empty(), "{}", finding.line.name);
        }
    }
}

/// Octets, text, and what looks like something that the kernel would write.
fn any_contents() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..64),
        ".{0,40}".prop_map(String::into_bytes),
        "(-?[0-9]{1,20}[ ,:/\n-]?){0,12}".prop_map(String::into_bytes),
        "(cpu3|CPU3|flags|nohz_full=|rcu_nocbs=|CONFIG_|kthreadd|irq/130-|[)\\[\\](]|24:|130:|irqbalance|=y|\n| |[0-9]{1,12}){0,24}"
            .prop_map(String::into_bytes),
    ]
}
