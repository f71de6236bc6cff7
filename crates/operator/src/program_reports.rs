//! Reports of the programs that a control has run: the last ones are kept, in its state folder if it has one.
//!
//! In:  a report when a program is over. Out: `reports/NUMBER.json` in the state folder; reports for whoever asks.

use super::report::ProgramReport;
use machine::safe_file::{self, Disk};
use machine::state_file::Parts;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

/// Reports that are kept.
const REPORTS_MAX: usize = 50;
/// Alarms and warnings of one report that are kept.
const TOLD_MAX: usize = 50;
/// Longest report that is read, octets.
const REPORT_MAX: u64 = 1 << 18;

/// The report of a program that stand-by has run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StandByReport {
    /// Counts the programs of this machine.
    pub number: u64,
    /// Name of the machine.
    pub machine: String,
    /// When it began, seconds since 1970, UTC.
    pub begun_unix_s: f64,
    /// Seconds from begin to end.
    pub took_s: f64,
    /// Parts behind it.
    pub parts: Parts,
    /// Cycles that were left out meanwhile.
    pub cycles_skipped: u64,
    /// What the program did.
    #[serde(flatten)]
    pub run: ProgramReport,
}

/// In words.
impl fmt::Display for StandByReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let begun = UNIX_EPOCH + Duration::from_secs(self.begun_unix_s.max(0.0) as u64);
        writeln!(
            f,
            "report {}             begun {}, {:.1} s from begin to end, parts {}",
            self.number,
            humantime::format_rfc3339_seconds(begun),
            self.took_s,
            self.parts
        )?;
        write!(f, "{}", self.run)?;
        writeln!(f, "cycles left out        {}", self.cycles_skipped)
    }
}

/// The reports that are known, the latest last.
#[derive(Debug, Default)]
pub(super) struct Reports {
    known: VecDeque<StandByReport>,
}

impl Reports {
    /// Those of a state folder; what is none of them is left where it is.
    pub(super) fn read(folder: &Path) -> Reports {
        let mut numbers = numbers(folder);
        numbers.drain(..numbers.len().saturating_sub(REPORTS_MAX));
        let read = |number: u64| {
            let text = files::read(&path(folder, number), REPORT_MAX).ok()?;
            let report: StandByReport = serde_json::from_slice(&text).ok()?;
            (report.number == number).then_some(report)
        };
        Reports {
            known: numbers.into_iter().filter_map(read).collect(),
        }
    }

    /// Number of the next report; `programs`: how many programs there were as far as the state of the machine knows.
    pub(super) fn next_number(&self, programs: u64) -> u64 {
        self.known
            .back()
            .map_or(0, |last| last.number)
            .max(programs)
            .saturating_add(1)
    }

    /// Keeps a report, bounded in size.
    pub(super) fn add(&mut self, mut report: StandByReport) -> StandByReport {
        report.run.alarms.truncate(TOLD_MAX);
        report.run.warnings.truncate(TOLD_MAX);
        if self.known.len() == REPORTS_MAX {
            self.known.pop_front();
        }
        self.known.push_back(report.clone());
        report
    }

    /// The report of this number, or the latest one.
    ///
    /// # Errors
    /// There is none; which there are.
    pub(super) fn find(&self, number: Option<u64>) -> Result<&StandByReport, String> {
        let found = match number {
            None => self.known.back(),
            Some(number) => self.known.iter().find(|report| report.number == number),
        };
        found.ok_or_else(|| match (self.known.front(), self.known.back()) {
            (Some(first), Some(last)) => {
                format!(
                    "there is no such report: the last ones are {} to {}",
                    first.number, last.number
                )
            }
            _ => "no program has been run".into(),
        })
    }
}

/// Writes a report to the state folder, and takes away the oldest one where there are too many.
pub(super) fn save(folder: &Path, report: &StandByReport) -> io::Result<()> {
    let mut text = serde_json::to_vec_pretty(report)?;
    text.push(b'\n');
    std::fs::create_dir_all(folder.join(FOLDER))?;
    safe_file::put(&mut Disk, &path(folder, report.number), &text)?;
    let numbers = numbers(folder);
    for number in &numbers[..numbers.len().saturating_sub(REPORTS_MAX)] {
        std::fs::remove_file(path(folder, *number))?;
    }
    Ok(())
}

const FOLDER: &str = "reports";

fn path(folder: &Path, number: u64) -> PathBuf {
    folder.join(FOLDER).join(format!("{number:06}.json"))
}

/// Numbers of the reports in a state folder, ascending.
fn numbers(folder: &Path) -> Vec<u64> {
    let entries = std::fs::read_dir(folder.join(FOLDER)).into_iter().flatten().flatten();
    let mut numbers: Vec<u64> = entries
        .filter_map(|entry| entry.file_name().to_str()?.strip_suffix(".json")?.parse().ok())
        .collect();
    numbers.sort_unstable();
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::console::Alarm;

    fn report(number: u64) -> StandByReport {
        let alarm = Alarm {
            time_s: 1.0,
            cause: "x-drive lost".into(),
        };
        StandByReport {
            number,
            machine: "mill".into(),
            begun_unix_s: 1.75e9,
            took_s: 2.5,
            parts: Parts::default(),
            cycles_skipped: 0,
            run: ProgramReport {
                program: "part.ngc".into(),
                result: protocol::Outcome::Faulted,
                timed_out_step: None,
                alarms: vec![alarm; 200],
                warnings: Vec::new(),
                line_reached: 3,
                lines: 4,
                planned_time_s: 2.0,
                real_time_factor: Default::default(),
                motion_time_s: 1.5,
                starved_cycles: 0,
                following_error_max_mm: 0.01,
                following_error_max_line: 2,
                deviation: None,
            },
        }
    }

    #[test]
    fn the_last_reports_are_kept_and_no_more() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let mut reports = Reports::read(folder);
        assert_eq!(reports.find(None).unwrap_err(), "no program has been run");
        assert_eq!((reports.next_number(0), reports.next_number(7)), (1, 8));
        for number in 1..=70 {
            assert_eq!(reports.next_number(0), number);
            save(folder, &reports.add(report(number))).unwrap();
        }
        // What is no report is nobody's.
        std::fs::write(folder.join("reports/000071.json"), "{}").unwrap();
        std::fs::write(folder.join("reports/notes.txt"), "mine").unwrap();
        std::fs::create_dir(folder.join("reports/000069.json.d")).unwrap();
        for reports in [reports, Reports::read(folder)] {
            let last = reports.find(None).unwrap();
            assert_eq!((last.number, last.run.alarms.len()), (70, TOLD_MAX));
            let first = reports.known.front().unwrap().number;
            assert!((21..=22).contains(&first), "{first}");
            assert_eq!(reports.find(Some(50)).unwrap().number, 50);
            let said = reports.find(Some(3)).unwrap_err();
            assert!(
                said.starts_with("there is no such report: the last ones are 2"),
                "{said}"
            );
        }
        assert_eq!(numbers(folder).len(), REPORTS_MAX + 1);
        let longest = std::fs::metadata(path(folder, 70)).unwrap().len();
        assert!(longest < REPORT_MAX / 8, "{longest}");
    }
}
