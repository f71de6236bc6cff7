//! The references in `docs/` are made of what the code does: this makes their tables anew and compares.
//!
//! In:  the code; the documents as they are, for what is written by hand: all text outside of the marked parts, and the last
//! column of tables that have one.
//! Out: nothing, or the first line that differs. `REFERENCES=write cargo test --test references` writes the documents; a row
//! that is new gets an empty last column, to be filled in by hand.

#[path = "../house.rs"]
mod house;
#[path = "../isolcpus/main.rs"]
mod isolcpus;
#[path = "../pages.rs"]
mod pages;
#[path = "../rt_sources.rs"]
mod rt_sources;

mod alarms;
mod commands;
mod components;
mod drive_profiles;
mod faults;
mod machine_file;
mod messages;
mod pins;
mod socket;
mod source;
mod states;
mod stops;
mod typescript;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const BEGIN: &str = "<!-- made by tests/references: do not edit but for the last column -->";
const END: &str = "<!-- end -->";

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn is_to_be_written() -> bool {
    std::env::var_os("REFERENCES").is_some_and(|value| value == "write")
}

/// What is written by hand in the tables of a document: heading and first column to the last column.
struct ByHand(BTreeMap<(String, String), String>);

impl ByHand {
    fn of(text: &str) -> ByHand {
        let mut cells = BTreeMap::new();
        let mut heading = String::new();
        for line in text.lines() {
            if line.starts_with('#') {
                heading = line.to_owned();
            } else if let Some(row) = line.strip_prefix("| ").and_then(|line| line.strip_suffix(" |")) {
                let first = row.split(" | ").next().unwrap_or_default();
                let last = row.rsplit(" | ").next().unwrap_or_default();
                cells.insert((heading.clone(), first.to_owned()), last.trim().to_owned());
            }
        }
        ByHand(cells)
    }

    fn cell(&self, heading: &str, first: &str) -> &str {
        let key = (heading.to_owned(), first.to_owned());
        self.0.get(&key).map_or("", String::as_str)
    }
}

/// A row of a table; what would end a cell is written otherwise.
fn row(cells: &[&str]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    format!("| {} |\n", cells.join(" | "))
}

/// The head of a table.
fn head(names: &[&str]) -> String {
    format!("{}|{}\n", row(names), "---|".repeat(names.len()))
}

/// A part of a document that is code between back quotes.
fn code(text: &str) -> String {
    format!("`{text}`")
}

/// Compares a file with what it should be, or writes it.
fn compare(path: &str, wanted: &str) {
    let file = root(path);
    if is_to_be_written() {
        return std::fs::write(&file, wanted).unwrap_or_else(|error| panic!("{path}: {error}"));
    }
    let found = std::fs::read_to_string(&file).unwrap_or_default();
    let lines = found.lines().zip(wanted.lines()).enumerate();
    let differs = lines.into_iter().find(|(_, (found, wanted))| found != wanted);
    let place = differs.map_or_else(String::new, |(number, (found, wanted))| {
        format!("\nline {}: {found}\nshould be: {wanted}", number + 1)
    });
    assert!(
        found == wanted,
        "{path} is not what the code says: REFERENCES=write cargo test --test references writes it anew{place}"
    );
}

/// Compares the marked part of a document with what `make` makes of the cells written by hand; each of these must be there.
fn check(path: &str, make: impl FnOnce(&ByHand) -> String) {
    let found = std::fs::read_to_string(root(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
    let (before, rest) = found.split_once(BEGIN).unwrap_or_else(|| panic!("{path}: no {BEGIN}"));
    let (made, after) = rest.split_once(END).unwrap_or_else(|| panic!("{path}: no {END}"));
    let table = make(&ByHand::of(made));
    compare(path, &format!("{before}{BEGIN}\n\n{table}\n{END}{after}"));
    let empty: Vec<&str> = table.lines().filter(|line| line.ends_with("|  |")).collect();
    assert!(
        empty.is_empty(),
        "{path}: the last column is to be written by hand in\n{}",
        empty.join("\n")
    );
}
