//! What was found, for a person and for a program.
//!
//! In:  findings in the order of the lines. Out: aligned text of at most 100 columns that ends with what to do first, or
//! JSON.

use super::{Finding, Group, Level, State};
use serde_json::{Value as Json, json};
use std::fmt;

/// Widest line of the text, unless a single word is longer.
const WIDTH: usize = 100;
/// Widths of the columns: state, name, found, wanted; the level ends the line.
const COLUMNS: [usize; 4] = [4, 19, 37, 27];
/// Where text begins that belongs to a line.
const INDENT: usize = 7;

/// Everything that was found.
#[derive(Clone, Debug)]
pub struct Report {
    /// What was looked at, one line each.
    pub about: Vec<String>,
    /// Findings, in the order of the lines.
    pub findings: Vec<Finding>,
}

impl Report {
    /// How many lines of a level are missing.
    pub fn missing(&self, level: Level) -> usize {
        self.with_state(State::Missing)
            .filter(|finding| finding.line.level == level)
            .count()
    }

    fn with_state(&self, state: State) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(move |finding| finding.state == state)
    }

    /// Cures of one level, each once, with the names of the lines that it is for. One that a line of a higher level has
    /// asked for is not there again.
    fn cures(&self, level: Level) -> Vec<(&str, Vec<&'static str>)> {
        let mut cures: Vec<(&str, Level, Vec<&'static str>)> = Vec::new();
        // What was measured comes of all the others, and has no cure of its own.
        for finding in self
            .with_state(State::Missing)
            .filter(|finding| finding.line.group != Group::Measured)
        {
            let Some(fix) = finding.fix.as_deref() else {
                continue;
            };
            match cures.iter_mut().find(|(known, ..)| *known == fix) {
                Some((_, highest, names)) => {
                    *highest = (*highest).min(finding.line.level);
                    names.push(finding.line.name);
                }
                None => cures.push((fix, finding.line.level, vec![finding.line.name])),
            }
        }
        let of_level = cures.into_iter().filter(|(_, highest, _)| *highest == level);
        of_level.map(|(fix, _, names)| (fix, names)).collect()
    }

    /// The same for a program.
    pub fn to_json(&self) -> Json {
        let line = |finding: &Finding| {
            let mut line = json!({
                "name": finding.line.name,
                "group": finding.line.group.name(),
                "level": finding.line.level.name(),
                "state": finding.state.name(),
                "found": finding.found,
                "wanted": finding.line.wanted,
                "fix": finding.fix,
            });
            if let Some(latency) = &finding.latency {
                line["latency"] = json!({
                    "n": latency.n,
                    "p50_us": latency.p50_us,
                    "p99_us": latency.p99_us,
                    "p99_9_us": latency.p99_9_us,
                    "max_us": latency.max_us,
                });
            }
            line
        };
        let missing = Level::ALL.map(|level| (level.name().to_owned(), Json::from(self.missing(level))));
        json!({
            "about": self.about,
            "lines": self.findings.iter().map(line).collect::<Vec<_>>(),
            "missing": Json::Object(missing.into_iter().collect()),
            "unknown": self.with_state(State::Unknown).count(),
        })
    }

    fn write_lines(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut group: Option<Group> = None;
        write_cells(f, ["", "", "found", "wanted"], "level")?;
        for finding in &self.findings {
            if group.replace(finding.line.group) != Some(finding.line.group) {
                writeln!(f, "{}", finding.line.group.name())?;
            }
            let state = match finding.state {
                State::Ok => "ok",
                State::Missing => "MISS",
                State::Unknown => "?",
            };
            let cells = [state, finding.line.name, &finding.found, finding.line.wanted];
            write_cells(f, cells, finding.line.level.name())?;
            if let Some(fix) = &finding.fix {
                write_wrapped(f, INDENT, "-> ", fix)?;
            }
        }
        Ok(())
    }

    fn write_summary(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let missing = Level::ALL.map(|level| match self.missing(level) {
            1 => format!("1 {}", level.name()),
            count => format!("{count} {}s", level.name()),
        });
        let [musts, shoulds, infos] = missing;
        writeln!(
            f,
            "\n{musts}, {shoulds} and {infos} missing; {} cannot be told.",
            self.with_state(State::Unknown).count()
        )?;
        for (level, words) in [(Level::Must, "First do"), (Level::Should, "Then, for better figures")] {
            let cures = self.cures(level);
            if cures.is_empty() {
                continue;
            }
            writeln!(f, "{words}:")?;
            for (fix, names) in cures {
                write_wrapped(f, 2, "-> ", fix)?;
                write_wrapped(f, 5, "   for ", &names.join(", "))?;
            }
        }
        if self.missing(Level::Must) == 0 {
            writeln!(
                f,
                "No must is missing: the control runs. How late a cycle can be is up to what else is missing."
            )?;
        }
        if self
            .findings
            .iter()
            .any(|finding| finding.line.group == Group::Measured)
        {
            writeln!(
                f,
                "A short measurement shows what is wrong, not that all is right: that takes hours, with load."
            )?;
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.about.iter().try_for_each(|line| write_wrapped(f, 0, "", line))?;
        writeln!(f)?;
        self.write_lines(f)?;
        self.write_summary(f)
    }
}

/// One row; a cell that is too long goes on below itself.
fn write_cells(f: &mut fmt::Formatter<'_>, cells: [&str; 4], level: &str) -> fmt::Result {
    let mut rows = [0, 1, 2, 3].map(|nth| wrap(cells[nth], COLUMNS[nth], COLUMNS[nth]).into_iter());
    let mut level = level;
    loop {
        let row = rows.each_mut().map(Iterator::next);
        if row.iter().all(Option::is_none) && level.is_empty() {
            return Ok(());
        }
        let mut line = String::from(" ");
        for (cell, width) in row.into_iter().zip(COLUMNS) {
            line.push_str(&format!(" {:<width$}", cell.unwrap_or_default()));
        }
        writeln!(f, "{}", format!("{line} {level}").trim_end())?;
        level = "";
    }
}

/// Text after a mark; what goes on stands below its beginning. A word is never broken: it may be part of a command.
fn write_wrapped(f: &mut fmt::Formatter<'_>, indent: usize, mark: &str, text: &str) -> fmt::Result {
    let lines = wrap(text, WIDTH - indent - mark.len(), usize::MAX);
    let marks = std::iter::once(mark).chain(std::iter::repeat(""));
    let width = mark.len();
    marks
        .zip(lines)
        .try_for_each(|(mark, line)| writeln!(f, "{:indent$}{mark:<width$}{line}", ""))
}

/// Lines of at most `width` characters, broken between words; a longer word is broken where `word_max` ends.
fn wrap(text: &str, width: usize, word_max: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let letters: Vec<char> = word.chars().collect();
        for piece in letters.chunks(word_max) {
            let piece: String = piece.iter().collect();
            match lines.last_mut() {
                Some(line) if line.chars().count() + 1 + piece.chars().count() <= width => {
                    line.push(' ');
                    line.push_str(&piece);
                }
                _ => lines.push(piece),
            }
        }
    }
    lines
}
