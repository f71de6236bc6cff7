//! The check of a whole program before anything moves.
//!
//! In:  program text; what the machine remembers; where it begins.
//! Out: all that is wrong with it, or what it comes to.

use super::outline::Outline;
use super::real_time::{Measure, RealTimeFactor};
use super::text::Reader;
use super::waits::Waits;
use super::{Begin, Feeder, Progress, folder, home, planned_settings};
use config::{Config, UserCodes};
use gcode::CheckLimits;
use host::wait::thread_cpu_s;
use machine::motion_settings::plan_settings;
use machine::tables::Tables;
use motion::cancel::Cancel;
use motion::canon::Position;
use motion::plan::Over;
use serde_json::{Value as Json, json};
use std::fmt;
use std::time::{Duration, Instant};

/// Why a program cannot be run; shown with its place in the text.
#[derive(Debug)]
pub struct ProgramErrors {
    shown: String,
    /// For programs, each as an object.
    errors: Vec<Json>,
    is_cancelled: bool,
}

impl fmt::Display for ProgramErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.shown)
    }
}

impl std::error::Error for ProgramErrors {}

impl ProgramErrors {
    pub fn count(&self) -> usize {
        self.errors.len()
    }

    /// For programs: `rule`, and where they are known `file`, `line`, `column` and `text` of the line.
    pub fn to_json(&self) -> &[Json] {
        &self.errors
    }

    /// Whether there is nothing wrong but that nobody wants the program any more.
    pub fn is_cancelled(&self) -> bool {
        self.is_cancelled
    }
}

/// What a whole program comes to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overview {
    /// Last line with something to do.
    pub lines: u32,
    /// Planned time, s.
    pub time_s: f64,
    /// Greatest deviation from the path that the program allows its moves (G64), mm; 0: none.
    pub tolerance_mm: f64,
    /// How much quicker than motion the calling thread has planned it; no other helped.
    pub real_time: RealTimeFactor,
    /// What is left of it at any place.
    pub outline: Outline,
    /// Tools that it changes to, each once, in the order of their first use.
    pub tools: Vec<u32>,
}

/// An error of a program for programs.
pub fn error_json(error: &gcode::Error) -> Json {
    json!({
        "file": (!error.file.is_empty()).then_some(&error.file),
        "line": error.line,
        "column": error.column,
        "text": error.text,
        "rule": error.kind.to_string(),
    })
}

/// All errors of the text; what a machine can do is not looked at. `path`: of the program.
pub fn check_text(
    config: &Config,
    tables: &Tables,
    path: &str,
    text: Reader<'_>,
    limits: CheckLimits,
) -> Vec<gcode::Error> {
    check_from(config, tables, path, text, home(config), limits)
}

fn check_from(
    config: &Config,
    tables: &Tables,
    path: &str,
    text: Reader<'_>,
    at: Position,
    limits: CheckLimits,
) -> Vec<gcode::Error> {
    let mut settings = planned_settings(config, tables, at);
    if let Some(folder) = folder(path) {
        settings.subroutine_folders.insert(0, folder.to_owned());
    }
    let errors = gcode::check_on(text, || Ok(text), settings, Waits::new(UserCodes::default()).1, limits);
    errors.unwrap_or_else(|error| vec![not_readable(&error)])
}

/// The text of a program cannot be read.
fn not_readable(error: &std::io::Error) -> gcode::Error {
    gcode::Error {
        file: String::new(),
        line: 1,
        column: 1,
        text: String::new(),
        span: 0..0,
        kind: gcode::ErrorKind::NotReadable {
            reason: error.to_string(),
        },
        calls: Vec::new(),
    }
}

/// Interprets and plans the whole program without moving anything, so that all errors are found before it starts. `cancel` ends
/// it at once; time and memory that it takes are limited.
///
/// # Errors
/// All errors of the text, or the first one of the plan: a limit of the machine, or of the check.
pub fn check<'t>(
    config: &Config,
    tables: &Tables,
    path: &str,
    text: impl Into<Reader<'t>>,
    begin: &Begin,
    cancel: &Cancel,
) -> Result<Overview, ProgramErrors> {
    let text = text.into();
    let limits = CheckLimits {
        cancel: cancel.clone(),
        ..CheckLimits::default()
    };
    let failed = |shown: String, error: Json| ProgramErrors {
        shown,
        errors: vec![error],
        is_cancelled: cancel.is_cancelled(),
    };
    let failed_at =
        |line: u32, rule: String| failed(format!("{path}:{line}: {rule}"), json!({ "line": line, "rule": rule }));
    if config.joints.is_empty() {
        let rule = format!("cannot be run: {}", config.without_joints());
        return Err(failed(format!("{path}: {rule}"), json!({ "rule": rule })));
    }
    let mut budget = Budget::new(limits.time);
    // Of what was typed the first mistake is enough.
    let errors = match begin {
        Begin::Program { at } => check_from(config, tables, path, text, *at, limits.clone()),
        // Of a start in its middle, or of a dry run, it was found at the check of the whole.
        Begin::Mdi { .. } | Begin::FromLine { .. } | Begin::Dry { .. } => Vec::new(),
    };
    if !errors.is_empty() {
        let shown: Vec<String> = errors.iter().map(|error| error.render(path)).collect();
        return Err(ProgramErrors {
            shown: shown.join("\n\n"),
            errors: errors.iter().map(error_json).collect(),
            is_cancelled: cancel.is_cancelled(),
        });
    }
    let mut overview = Overview::default();
    let mut broken_off = None;
    let measure = Measure::new(thread_cpu_s).judging(&plan_settings(config, begin.at()));
    let mut feeder = Feeder::new(config, tables, text, begin.at(), measure)
        .beside(path)
        .within(limits)
        .beginning(begin);
    loop {
        match feeder.pump() {
            Ok(Progress::Done) => break,
            Ok(Progress::Working | Progress::RingFull | Progress::Waiting) => {}
            // Where a probe will really touch is not known: what follows may be elsewhere, and is judged when it is there.
            Err(error) if feeder.waits.has_assumed() && error.is_of_a_place() && !cancel.is_cancelled() => {
                let line = feeder.line();
                broken_off = Some(format!("what follows line {line} depends on where the probe touches"));
                break;
            }
            Err(error) => return Err(failed(error.render(path), error_json(error.of_text()))),
        }
        if let Some(over) = feeder.sink().over() {
            return Err(failed_at(over.line, over_limits(&over)));
        }
        if let Some(limit) = budget.passed() {
            return Err(failed_at(feeder.line(), limit));
        }
        feeder.ideal_path();
        overview.lines = overview.lines.max(feeder.line());
    }
    overview.lines = overview.lines.max(feeder.line());
    let assumes = broken_off.or_else(|| feeder.assumes());
    let lead = std::mem::take(&mut feeder.lead);
    let measure = feeder.sink();
    overview.time_s = measure.time_s();
    overview.real_time = measure.real_time_factor();
    overview.tools = measure.tools().to_vec();
    overview.outline = measure.outline().assuming(assumes).leading(&lead);
    overview.tolerance_mm = feeder.tolerance_mm();
    Ok(overview)
}

/// A limit that the plan does not keep, in words.
fn over_limits(over: &Over) -> String {
    let Over {
        line: _,
        joint,
        order,
        value,
        limit,
    } = *over;
    format!(
        "over limits, not run: joint {joint} would pass its {order} limit, {value:.1} of {limit:.1}; a defect of the planner: \
         program.planner = \"classic\" may plan it"
    )
}

/// Memory that a check may take, octets: beside a machine that stands by it is locked, and wanted by others.
const CHECK_MEMORY_MAX: u64 = 512 << 20;

/// Time and memory that a check may still take.
struct Budget {
    began: Instant,
    time: Duration,
    /// When memory was looked at last, and what the process had at the beginning.
    looked: Instant,
    before: Option<u64>,
}

impl Budget {
    fn new(time: Duration) -> Budget {
        Budget {
            began: Instant::now(),
            time,
            looked: Instant::now(),
            before: resident(),
        }
    }

    /// The limit that has been passed, in words. To be asked often.
    fn passed(&mut self) -> Option<String> {
        let now = Instant::now();
        if now - self.looked < Duration::from_millis(20) {
            return None;
        }
        self.looked = now;
        if now - self.began > self.time {
            let seconds = self.time.as_secs();
            return Some(format!("the check may take {seconds} s and has only come so far"));
        }
        let taken = resident()?.saturating_sub(self.before?);
        let most = CHECK_MEMORY_MAX >> 20;
        (taken > CHECK_MEMORY_MAX).then(|| format!("the check may take {most} MiB of memory, and has only come so far"))
    }
}

/// Memory of this process, octets; `None` where the kernel does not tell.
fn resident() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kib << 10)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn demo() -> (Config, Tables) {
        let config = config::parse(include_str!("../../../configs/mill3-demo.toml"), Path::new("demo.toml")).unwrap();
        let tables = Tables::read(&config).unwrap();
        (config, tables)
    }

    #[test]
    fn what_the_moves_may_be_off_is_what_the_program_says_of_them() {
        let (config, tables) = demo();
        let tolerance_mm = |text: &str| {
            let checked = check(
                &config,
                &tables,
                "p.ngc",
                text.as_bytes(),
                &Begin::at_home(&config),
                &Cancel::default(),
            );
            checked.expect("a program").tolerance_mm
        };
        assert_eq!(tolerance_mm("G21 G90 G64 P0.05\nG1 X1 F100\nG64 P0.2\nM2\n"), 0.05);
        assert_eq!(
            tolerance_mm("G21 G90 G64\nG1 X1 F100\nM2\n"),
            config.program.tolerance_mm
        );
        assert_eq!(tolerance_mm("G21 G90 G61\nG1 X1 F100\nM2\n"), 0.0);
    }

    #[test]
    fn a_check_tells_the_tools_that_a_program_changes_to() {
        let (config, tables) = demo();
        let text = b"G21 G90\nT3 M6\nG0 X1\nT1\nG0 X2\nM6\nT3 M6\nT0 M6\nM2\n";
        let begin = Begin::at_home(&config);
        let checked = check(&config, &tables, "p.ngc", text, &begin, &Cancel::default());
        assert_eq!(checked.expect("a program").tools, [3, 1, 0]);
    }

    #[test]
    fn a_check_tells_how_quick_planning_is() {
        let (config, tables) = demo();
        let text = b"G21 G90 G64 P0.05\nG1 X100 F1000\nY50\nX0\nM2\n";
        let checked = check(
            &config,
            &tables,
            "p.ngc",
            text,
            &Begin::at_home(&config),
            &Cancel::default(),
        )
        .expect("a program");
        assert!(checked.real_time.whole.is_some_and(|whole| whole > 0.0), "{checked:?}");
    }
}
