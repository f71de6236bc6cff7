//! What takes the time of a program: by tool, and by operation.
//!
//! In:  the text, for its headings; every cycle that is run; the programmed path as it is left behind.
//! Out: times and lengths.
//!
//! An operation is what stands behind a heading, with one tool: a comment that has a line of its own, as CAM programs put one before
//! each operation, or a subroutine (O-word). Of comments in a row the first one is taken, or the one that calls itself an operation
//! or a toolpath; of such rows with no code between them the last. What comes again (a subroutine that is called twice) is added up. Memory is for [`ROWS_MAX`] operations; what comes
//! behind that many is added to the last one.

use super::ahead::Line;
use super::judge::Cycle;
use super::lines::each_line;
use super::script::Manner;
use machine::tables::Tables;
use motion::element::Action;
use motion::rt::{Sample, SampleState};
use program::text::Reader;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::ControlFlow;

/// Operations that the text shows; JSON has all of them.
const OPERATIONS_SHOWN: usize = 40;
/// Operations that are told apart.
const ROWS_MAX: usize = 256;
/// Characters of a name.
const NAME_MAX: usize = 60;
/// Octets of a line that are looked at.
const LINE_MAX: usize = 512;

/// What takes how long, s and mm.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Times {
    pub(super) time_s: f64,
    pub(super) cutting_s: f64,
    pub(super) rapid_s: f64,
    /// G4.
    pub(super) dwell_s: f64,
    /// At rest for the spindle, a stop or the plan; held.
    pub(super) waiting_s: f64,
    pub(super) cutting_mm: f64,
    pub(super) rapid_mm: f64,
    pub(super) tool_changes: u32,
}

impl Times {
    /// Whether there is anything in it to be read in seconds and metres.
    pub(super) fn counts(&self) -> bool {
        self.time_s >= 0.05 || self.cutting_mm > 0.0 || self.rapid_mm > 0.0
    }

    /// As cells of a table in a page.
    pub(super) fn cells(&self) -> String {
        let seconds = [self.time_s, self.cutting_s, self.rapid_s, self.dwell_s, self.waiting_s]
            .map(|time_s| format!("{time_s:.1}"));
        let metres = [self.cutting_mm, self.rapid_mm].map(|length_mm| format!("{:.3}", length_mm / 1e3));
        let cells = seconds.into_iter().chain(metres).chain([self.tool_changes.to_string()]);
        cells.map(|cell| format!("<td>{cell}</td>")).collect()
    }

    fn add(&mut self, other: &Times) {
        self.time_s += other.time_s;
        self.cutting_s += other.cutting_s;
        self.rapid_s += other.rapid_s;
        self.dwell_s += other.dwell_s;
        self.waiting_s += other.waiting_s;
        self.cutting_mm += other.cutting_mm;
        self.rapid_mm += other.rapid_mm;
        self.tool_changes += other.tool_changes;
    }
}

/// All with one tool; the time of its change counts to it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct OfTool {
    pub(super) tool: u32,
    /// As the program calls it (`(T1 D=6 flat end mill)`), else as the tool table does.
    pub(super) name: Option<String>,
    #[serde(flatten)]
    pub(super) times: Times,
}

/// An operation with its tool.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct OfOperation {
    /// Its heading; `None`: what stands before the first one.
    pub(super) name: Option<String>,
    /// Where the heading stands.
    pub(super) line: u32,
    pub(super) tool: u32,
    #[serde(flatten)]
    pub(super) times: Times,
}

/// What takes the time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct TimeTable {
    pub(super) tools: Vec<OfTool>,
    pub(super) operations: Vec<OfOperation>,
}

/// By tool, and by operation where there is more than one.
impl fmt::Display for TimeTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let operations: Vec<_> = self.operations.iter().filter(|own| own.times.counts()).collect();
        let head = "time s    cutting      rapid      dwell    waiting   cutting m     rapid m";
        writeln!(f, "tools           {head}  changes")?;
        for own in self.tools.iter().filter(|own| own.times.counts()) {
            let name = own.name.as_deref().unwrap_or_default();
            let tool = format!("T{}", own.tool);
            writeln!(f, "  {tool:13} {}  {:7}  {name}", own.times, own.times.tool_changes)?;
        }
        if operations.len() <= 1 {
            return Ok(());
        }
        writeln!(f, "operations      {head}")?;
        for own in operations.iter().take(OPERATIONS_SHOWN) {
            let name = own.name.as_deref().unwrap_or("before the first heading");
            let place = format!("line {}, T{}", own.line, own.tool);
            writeln!(f, "  {place:13} {}  {name}", own.times)?;
        }
        match operations.len().saturating_sub(OPERATIONS_SHOWN) {
            0 => Ok(()),
            more => writeln!(f, "                and {more} more: --json"),
        }
    }
}

/// The columns of a table.
impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Times {
            time_s,
            cutting_s,
            rapid_s,
            dwell_s,
            waiting_s,
            cutting_mm,
            rapid_mm,
            ..
        } = self;
        write!(
            f,
            "{time_s:6.1} {cutting_s:10.1} {rapid_s:10.1} {dwell_s:10.1} {waiting_s:10.1} {:11.3} {:11.3}",
            cutting_mm / 1e3,
            rapid_mm / 1e3
        )
    }
}

/// What a text says of its operations and tools.
#[derive(Clone, Debug, Default, PartialEq)]
struct Headings {
    /// Lines from which on another one holds, in their order, and which: `None`, the beginning.
    from: Vec<(u32, Option<usize>)>,
    names: Vec<(u32, String)>,
    tools: BTreeMap<u32, String>,
}

/// Adds up.
#[derive(Debug)]
pub(super) struct TimeWatch {
    headings: Headings,
    cycle_s: f64,
    tool: u32,
    remarks: BTreeMap<u32, String>,
    rows: Vec<OfOperation>,
    /// Of the row under way, and the line for which it was found.
    row: usize,
    line: Option<u32>,
    last: Option<u64>,
}

impl TimeWatch {
    pub(super) fn new(text: Reader<'_>, tables: &Tables, cycle_s: f64) -> TimeWatch {
        let remarks = (tables.tools().tools()).map(|tool| (tool.number, name(&tool.remark)));
        let mut watch = TimeWatch {
            headings: Headings::of(text),
            cycle_s,
            tool: tables.tool_in_spindle(),
            remarks: remarks.filter(|(_, remark)| !remark.is_empty()).collect(),
            rows: Vec::new(),
            row: 0,
            line: None,
            last: None,
        };
        watch.enter(0);
        watch
    }

    /// The next cycle.
    pub(super) fn push(&mut self, cycle: &Cycle, sample: &Sample, manner: Manner) {
        if cycle.line == 0 {
            // Nothing has been planned yet.
            return;
        }
        let cycles = self.last.replace(cycle.number).map_or(1, |last| cycle.number - last);
        let changed = match sample.action {
            Some(Action::ChangeTool { tool }) => Some(tool),
            _ => None,
        };
        self.tool = changed.unwrap_or(self.tool);
        if self.line != Some(cycle.line) || changed.is_some() {
            self.enter(cycle.line);
        }
        let time_s = cycles as f64 * self.cycle_s;
        let times = &mut self.rows[self.row].times;
        times.time_s += time_s;
        times.tool_changes += u32::from(changed.is_some());
        let held = manner.feed == 0.0 && sample.velocity_mm_s == 0.0;
        *match sample.state {
            SampleState::Moving | SampleState::Dwelling if held => &mut times.waiting_s,
            SampleState::Moving if cycle.rapid => &mut times.rapid_s,
            SampleState::Moving => &mut times.cutting_s,
            SampleState::Dwelling => &mut times.dwell_s,
            SampleState::Acting | SampleState::Starved | SampleState::Finished => &mut times.waiting_s,
        } += time_s;
    }

    /// A line of the path is left behind.
    pub(super) fn leave(&mut self, line: &Line) {
        let row = self.find(line.line);
        let times = &mut self.rows[row].times;
        times.cutting_mm += line.feed_mm;
        times.rapid_mm += line.rapid_mm;
    }

    fn enter(&mut self, line: u32) {
        self.row = self.find(line);
        self.line = Some(line);
    }

    fn find(&mut self, line: u32) -> usize {
        let heading = self.headings.at(line);
        let (at, name) = heading.map_or((0, None), |(at, name)| (*at, Some(name)));
        let known = self
            .rows
            .iter()
            .rposition(|row| row.line == at && row.tool == self.tool);
        known.unwrap_or_else(|| {
            if self.rows.len() < ROWS_MAX {
                self.rows.push(OfOperation {
                    name: name.cloned(),
                    line: at,
                    tool: self.tool,
                    times: Times::default(),
                });
            }
            self.rows.len() - 1
        })
    }

    pub(super) fn finish(mut self) -> TimeTable {
        // Headings behind which nothing happens.
        self.rows.retain(|row| row.times != Times::default());
        let mut tools: Vec<OfTool> = Vec::new();
        for row in &self.rows {
            match tools.iter_mut().find(|own| own.tool == row.tool) {
                Some(own) => own.times.add(&row.times),
                None => tools.push(OfTool {
                    tool: row.tool,
                    name: (self.headings.tools.get(&row.tool))
                        .or(self.remarks.get(&row.tool))
                        .cloned(),
                    times: row.times.clone(),
                }),
            }
        }
        TimeTable {
            tools,
            operations: self.rows,
        }
    }
}

impl Headings {
    fn of(text: Reader<'_>) -> Headings {
        let mut headings = Headings::default();
        // Whether the line before was a heading; whether there was no code since the last one; the heading around a subroutine.
        let (mut in_row, mut follows, mut outer) = (false, false, None);
        // A text that cannot be read any further has no more headings; whoever plans it says so.
        let _ = each_line(text, LINE_MAX, |line, octets| {
            // Most lines are moves, and there may be millions of them.
            let Some(&first) = octets.iter().find(|octet| !octet.is_ascii_whitespace()) else {
                in_row = false;
                return ControlFlow::Continue(());
            };
            if !matches!(first, b'(' | b';' | b'/' | b'N' | b'n' | b'O' | b'o') {
                follows = false;
                return ControlFlow::Continue(());
            }
            let code = String::from_utf8_lossy(octets);
            let code = without_number(&code);
            match comment(code) {
                Some(own) => {
                    if let Some((number, of_tool)) = tool_comment(own) {
                        headings.tools.entry(number).or_insert_with(|| name(of_tool));
                    } else if let Some(own) = heading(own) {
                        let before = headings.names.last().filter(|_| follows);
                        let is_better = match before.map(|(_, before)| calls_itself(before)) {
                            None => true,
                            Some(calls) if calls == calls_itself(&own) => !in_row,
                            Some(calls) => !calls,
                        };
                        if is_better {
                            headings.push(line, own, follows);
                        }
                        (in_row, follows) = (true, true);
                    }
                }
                None => {
                    follows = false;
                    match subroutine(code) {
                        Some((own, "sub")) => {
                            outer = Some(headings.from.last().and_then(|(_, own)| *own));
                            headings.push(line, own, false);
                        }
                        Some((_, "endsub")) => {
                            if let Some(outer) = outer.take() {
                                headings.from.push((line, outer));
                            }
                        }
                        Some(_) | None => {}
                    }
                }
            }
            if headings.names.len() >= 16 * ROWS_MAX {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        headings
    }

    fn push(&mut self, line: u32, name: String, instead: bool) {
        if instead {
            self.names.pop();
            self.from.pop();
        }
        self.from.push((line, Some(self.names.len())));
        self.names.push((line, name));
    }

    /// The heading that holds at a line.
    fn at(&self, line: u32) -> Option<&(u32, String)> {
        let place = self.from.partition_point(|(from, _)| *from <= line);
        let (_, own) = self.from.get(place.checked_sub(1)?)?;
        self.names.get((*own)?)
    }
}

/// A line without block delete and number.
fn without_number(line: &str) -> &str {
    let line = line.trim().trim_start_matches('/').trim_start();
    match line.strip_prefix(['N', 'n']) {
        Some(rest) => rest
            .trim_start_matches(|c: char| c.is_ascii_digit() || c == '.')
            .trim_start(),
        None => line,
    }
}

/// The text of a comment that has a line of its own.
fn comment(code: &str) -> Option<&str> {
    let in_parentheses = || {
        code.strip_prefix('(')?
            .strip_suffix(')')
            .filter(|own| !own.contains(')'))
    };
    code.strip_prefix(';').or_else(in_parentheses).map(str::trim)
}

/// A comment that is a heading: neither one that does something, nor one that ends an operation, nor a rule of dashes.
fn heading(comment: &str) -> Option<String> {
    let lower = comment.to_ascii_lowercase();
    let word = lower.split(',').next().unwrap_or_default().trim();
    let does = matches!(
        word,
        "msg"
            | "debug"
            | "print"
            | "log"
            | "logopen"
            | "logappend"
            | "logclose"
            | "probeopen"
            | "probeclose"
            | "axis"
            | "abort"
            | "py"
    );
    let ends = ["finish ", "end of ", "end "].iter().any(|end| lower.starts_with(end));
    let says = comment.chars().any(char::is_alphanumeric);
    let rules = ['-', '=', '*', '#', '_', '.', ' '];
    (says && !does && !ends).then(|| name(comment.trim_matches(rules)))
}

/// Whether a heading says that it is one.
fn calls_itself(heading: &str) -> bool {
    let lower = heading.to_ascii_lowercase();
    ["begin operation", "operation", "toolpath"]
        .iter()
        .any(|word| lower.starts_with(word))
}

/// `T1 D=6 flat end mill`, as CAM programs list their tools.
fn tool_comment(comment: &str) -> Option<(u32, &str)> {
    let rest = comment.strip_prefix(['T', 't'])?;
    let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    let (number, rest) = rest.split_at(digits);
    let rest = rest.strip_prefix([' ', '=', ':', '\t'])?.trim();
    Some((number.parse().ok()?, rest))
}

/// `o100 sub`: name and word.
fn subroutine(code: &str) -> Option<(String, &str)> {
    let rest = code.strip_prefix(['O', 'o'])?;
    let end = rest.find(|c: char| c.is_ascii_whitespace())?;
    let (own, rest) = rest.split_at(end);
    Some((name(&format!("o{own}")), rest.split_whitespace().next()?))
}

fn name(text: &str) -> String {
    let text = text.trim();
    match text.char_indices().nth(NAME_MAX) {
        Some((end, _)) => text[..end].to_owned() + "...",
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<(u32, String)> {
        let headings = Headings::of(text.into());
        let lines = 1..=text.lines().count() as u32;
        let mut found: Vec<(u32, String)> = Vec::new();
        for line in lines {
            let name = headings.at(line).map_or("-", |(_, name)| name);
            if found.last().is_none_or(|(_, last)| last != name) {
                found.push((line, name.to_owned()));
            }
        }
        found
    }

    #[test]
    fn operations_are_found_as_cam_programs_write_them() {
        // As the posts of Fusion, FreeCAD and Vectric do.
        let fusion = "%\n(1001)\n(T1 D=6. CR=0. - ZMIN=-5. - flat end mill)\nN10 G90 G94\n\n(2D POCKET1)\nN20 T1 M6\nG0 X1\n\
                      N30 (BORE)\nG1 X2\nM30\n%\n";
        let expected = [(1, "-"), (2, "1001"), (6, "2D POCKET1"), (9, "BORE")];
        assert_eq!(found(fusion), expected.map(|(line, name)| (line, name.to_owned())));
        let tools = Headings::of(fusion.into()).tools;
        assert_eq!(tools[&1], "D=6. CR=0. - ZMIN=-5. - flat end mill");
        let freecad = "G21\n(Begin operation: Profile)\n(Path: Profile)\n(Compensated Tool Path. Diameter: 5.0)\nG1 X1\n\
                       (Finish operation: Profile)\n(Begin operation: Drilling)\nG1 X2\n";
        let expected = [
            (1, "-"),
            (2, "Begin operation: Profile"),
            (7, "Begin operation: Drilling"),
        ];
        assert_eq!(found(freecad), expected.map(|(line, name)| (line, name.to_owned())));
        let prose = "(What it is,)\n(in two lines)\n\n( --- face --- )\n(over all)\nG1 X1\n";
        assert_eq!(found(prose), [(1, "-".to_owned()), (4, "face".to_owned())]);
        let vectric = "( Toolpath:- Pocket 1 )\n(------)\n(MSG, go)\nG1 X1\n;Toolpath: 2\nG1 X2 (not one)\n";
        let expected = [(1, "Toolpath:- Pocket 1"), (5, "Toolpath: 2")];
        assert_eq!(found(vectric), expected.map(|(line, name)| (line, name.to_owned())));
    }

    #[test]
    fn a_subroutine_is_an_operation_and_behind_it_the_one_before_goes_on() {
        let text = "(face)\nG1 X1\no<bore> sub\nG1 Z-1\no<bore> endsub\nG1 X2\no<bore> call\n";
        let expected = [(1, "face"), (3, "o<bore>"), (5, "face")];
        assert_eq!(found(text), expected.map(|(line, name)| (line, name.to_owned())));
    }

    #[test]
    fn any_text_has_headings_of_a_length_that_can_be_shown() {
        let long = format!(
            "({})\nG1 X1\n(\u{e4}\u{fffd})\n(())\n()\n(\nN\no\nO5\n/\n",
            "x".repeat(5000)
        );
        let headings = Headings::of((&long).into());
        assert!(
            headings
                .names
                .iter()
                .all(|(_, name)| name.chars().count() <= NAME_MAX + 3)
        );
        assert_eq!(Headings::of((&[0xff; 100]).into()), Headings::default());
        let many: String = (0..100_000).map(|k| format!("(part {k})\nG1 X1\n")).collect();
        assert!(Headings::of((&many).into()).names.len() <= 16 * ROWS_MAX);
    }
}
