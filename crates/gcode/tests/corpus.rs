//! Every case of `tests/corpus` through our interpreter: calls, refusals and parameters as expected, character by character.
//!
//! A case is a folder: `program.ngc` and what goes with it (`oracle/case.rs`), `expected.canon`, and where the case is
//! about them `expected.err`, `expected.print` and `expected.var`. The expected calls were printed by LinuxCNC's interpreter; where the newest one
//! prints differently than the packaged one, `differences.toml` names the case and says why.
//!
//! `ISOCNC_CORPUS_REGENERATE=1 cargo test -p isocnc-gcode --test all corpus` writes the expected files anew with the installed
//! interpreter. Those of cases in which it differs are kept, or written by the newest interpreter where they are missing.

use crate::oracle;

use std::{
    collections::{BTreeMap, BTreeSet},
    env, fs,
    path::Path,
};

use oracle::{
    case::{Case, corpus},
    ours,
};

/// Cases whose expected files are not the packaged interpreter's, with the reason.
fn differences() -> BTreeMap<String, String> {
    let text = include_str!("corpus/differences.toml");
    let table: toml::Table = text.parse().expect("differences.toml");
    let cases = table
        .get("case")
        .and_then(toml::Value::as_table)
        .expect("differences.toml: [case]");
    cases
        .iter()
        .map(|(name, reason)| (name.clone(), reason.as_str().expect("a reason").to_owned()))
        .collect()
}

/// Cases that our interpreter does not do yet.
fn pending() -> BTreeSet<String> {
    include_str!("corpus/pending.txt").lines().map(str::to_owned).collect()
}

/// What differs from the expected files; nothing if all is well.
fn difference(folder: &Path, case: &Case) -> Option<String> {
    let read = |file: &str| fs::read_to_string(folder.join(file)).ok();
    let ours = ours::run(case, oracle::Version::Newest);
    let expected = read("expected.canon").unwrap_or_default();
    if ours.canon != expected {
        return Some(first_difference(&expected, &ours.canon, &ours.errors));
    }
    let refusals: Vec<String> = read("expected.err")
        .unwrap_or_default()
        .lines()
        .map(str::to_owned)
        .collect();
    let wanted: Vec<&str> = refusals
        .iter()
        .map(String::as_str)
        .filter(|line| !line.starts_with('#'))
        .collect();
    if ours.errors.len() != wanted.len()
        || !ours
            .errors
            .iter()
            .zip(&wanted)
            .all(|(error, wanted)| names(error, wanted))
    {
        return Some(format!("refused:  {:?}\nexpected: {wanted:?}", ours.errors));
    }
    let expected = read("expected.print").unwrap_or_default();
    if ours.printed != expected {
        return Some(first_difference(&expected, &ours.printed, &[]));
    }
    if let Some(expected) = read("expected.var")
        && expected != ours.parameters
    {
        return Some(first_difference(&expected, &ours.parameters, &[]));
    }
    None
}

/// Whether an error is the expected one: `place: phrase`, the phrase anywhere in its text.
fn names(error: &str, wanted: &str) -> bool {
    let (place, phrase) = wanted.split_once(": ").expect("expected.err: place, colon, phrase");
    error
        .strip_prefix(place)
        .is_some_and(|text| text.starts_with(": ") && text.contains(phrase))
}

fn first_difference(expected: &str, ours: &str, errors: &[String]) -> String {
    let mut wanted = expected.lines();
    let mut got = ours.lines();
    let mut before = "";
    loop {
        match (wanted.next(), got.next()) {
            (None, None) => return "line ends differ".to_owned(),
            (Some(wanted), Some(got)) if wanted == got => before = got,
            (wanted, got) => {
                return format!(
                    "after     {before}\nexpected: {}\nours:     {}{}",
                    wanted.unwrap_or("(the end)"),
                    got.unwrap_or("(the end)"),
                    errors
                        .iter()
                        .map(|error| format!("\nrefused:  {error}"))
                        .collect::<String>()
                );
            }
        }
    }
}

#[test]
fn every_case_gives_what_is_expected() {
    let cases = corpus();
    if env::var_os("ISOCNC_CORPUS_REGENERATE").is_some() {
        regenerate(&cases);
    }
    let pending = pending();
    let mut failures = Vec::new();
    for (folder, case) in &cases {
        match (difference(folder, case), pending.contains(&case.name)) {
            (None, true) => failures.push(format!("== {}: passes, take it off pending.txt", case.name)),
            (Some(difference), false) => failures.push(format!("== {}\n{difference}", case.name)),
            (None, false) | (Some(_), true) => {}
        }
    }
    assert!(cases.len() >= 150, "{} cases: are they all there?", cases.len());
    assert!(
        failures.is_empty(),
        "{} of {} cases:\n{}",
        failures.len(),
        cases.len(),
        failures.join("\n")
    );
}

#[test]
fn lists_name_cases_that_exist() {
    let names: BTreeSet<String> = corpus().into_iter().map(|(_, case)| case.name).collect();
    for name in pending().iter().chain(differences().keys()) {
        assert!(names.contains(name), "{name} is no case");
    }
}

/// Writes what the installed interpreter makes of the cases.
fn regenerate(cases: &[(std::path::PathBuf, Case)]) {
    let packaged = oracle::find(oracle::Version::Packaged).expect("an interpreter to regenerate with");
    let newest = oracle::find(oracle::Version::Newest);
    let differences = differences();
    for (folder, case) in cases {
        let differs = differences.contains_key(&case.name);
        if differs && folder.join("expected.canon").exists() {
            continue;
        }
        let rs274 = if differs {
            newest.as_ref().unwrap_or(&packaged)
        } else {
            &packaged
        };
        let outcome = oracle::run(rs274, case);
        fs::write(folder.join("expected.canon"), &outcome.canon).expect("expected.canon");
        let refusals = folder.join("expected.err");
        if outcome.refusals.is_empty() {
            let _ = fs::remove_file(&refusals);
        } else {
            let known = fs::read_to_string(&refusals).unwrap_or_default();
            fs::write(&refusals, expected_refusals(&outcome, case, &known)).expect("expected.err");
        }
        if !outcome.printed.is_empty() {
            fs::write(folder.join("expected.print"), &outcome.printed).expect("expected.print");
        }
        if case.options.parameters_after {
            fs::write(folder.join("expected.var"), &outcome.parameters).expect("expected.var");
        }
    }
}

/// The file of expected refusals: what LinuxCNC says as remarks, our own words as they were. Words that were not there yet
/// are what our interpreter says of the same line, to be looked at; question marks where it says nothing of it.
fn expected_refusals(outcome: &oracle::Outcome, case: &Case, known: &str) -> String {
    let known: Vec<&str> = known.lines().filter(|line| !line.starts_with('#')).collect();
    let ours = ours::run(case, oracle::Version::Newest);
    let lines = case.all_lines();
    let mut text = String::new();
    for (index, refusal) in outcome.refusals.iter().enumerate() {
        text.push_str(&format!("# LinuxCNC: {}\n", refusal.message));
        let line = lines
            .iter()
            .position(|line| *line == refusal.line)
            .map_or(0, |line| line + 1);
        let said = ours
            .errors
            .get(index)
            .filter(|_| ours.error_lines.get(index).is_some_and(|at| *at as usize == line));
        match (known.get(index), said) {
            (Some(words), _) if !words.ends_with('?') => text.push_str(&format!("{words}\n")),
            (_, Some(said)) => text.push_str(&format!("{said}\n")),
            (_, None) => text.push_str(&format!("{line}:?: ?\n")),
        }
    }
    text
}
