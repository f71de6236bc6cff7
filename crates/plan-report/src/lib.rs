//! `isocnc plan`: a whole program planned off line, and judged.
//!
//! In:  machine file and part program.
//! Out: how long it takes and what it asks of every joint, as text or JSON; on demand set-points, paths and a picture.
//!
//! The program goes through the planner twice: once for the time that planning takes, once through the ring and the
//! interpolation of the machine, without a clock (`run_down`). What is judged is judged cycle by cycle: memory does not grow with the
//! program, but for the files of numbers that were asked for.
//!
//! | to learn | file |
//! |---|---|
//! | the run of the plan; what is judged of each of its cycles | `run_down.rs`; `judge.rs` |
//! | the operator from a file | `script.rs` |
//! | what takes the time; why a place is slow | `times.rs`; `slow_places.rs` |
//! | the page for a browser; pictures | `page.rs`; `picture/mod.rs` |
//! | which thread planned what; what threads and buffers bring | `timeline.rs`; `efficiency.rs` |
//! | the spindle of a plan without a machine | `ideal_spindle.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod ahead;
mod compare;
mod efficiency;
mod export;
mod ideal_spindle;
mod joints;
mod judge;
mod lines;
mod page;
mod picture;
mod report;
mod rests;
mod run_down;
mod script;
mod slow_places;
mod timeline;
mod times;

use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use compare::{Compared, Comparison};
use config::{self, Config};
use host::terminal::say;
use machine::tables::Tables;
use motion::cancel::Cancel;
use motion::plan::PlannerKind;
use program::text::{Reader, Text};
use program::{Doubt, FeedError, doubts, error_json, home};
use report::Report;
use run_down::{Wanted, Work};
use script::{Script, ScriptError};
use serde::Serialize;
use serde_json::{Value as Json, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// Longest script, octets.
const SCRIPT_MAX: u64 = 1 << 20;

/// Arguments of `plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Machine file.
    machine: PathBuf,
    /// Part program.
    program: PathBuf,
    /// How speed is chosen along the path, in place of what the machine file says.
    #[arg(long, value_enum)]
    planner: Option<PlannerName>,
    /// Threads that plan, the first one counted; left out: those of the machine file, or as many as there are cores. The plan
    /// does not depend on them.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=64))]
    threads: Option<u16>,
    /// Write one commanded position per cycle: `t,` and axis letters, s and mm.
    #[arg(long, value_name = "FILE.csv")]
    samples: Option<PathBuf>,
    /// Write the programmed path, before corners are rounded: lines `P`, `L` and `C` with feed.
    #[arg(long, value_name = "FILE.txt")]
    path: Option<PathBuf>,
    /// Write the smoothed path, a point per millisecond: section between rests, time, length, speed, feed, axes with derivatives.
    #[arg(long, value_name = "FILE.csv")]
    smoothed: Option<PathBuf>,
    /// Draw the tool path coloured by speed, and velocity, acceleration and jerk of every joint over time.
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Write one page for a browser: path, velocity, acceleration and jerk over time, slowest places, times, lines of the program.
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// What the operator does meanwhile, an order a line: `at 2.5 s feed 50`, `at line 120 hold`, `after 3 s resume`,
    /// `at rest reverse 50`; `rapid`, `spindle`, `single-block on`, `stop`.
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Plan it with another setting as well, and show both side by side: KEY=VALUE[,KEY=VALUE...] in place of what the machine file
    /// says (`program.planner=classic`, `joint.0.travel_mm=[0,300]`), or another machine file. May be given several times.
    #[arg(long, value_name = "SETTING", conflicts_with_all = ["samples", "path", "smoothed", "svg", "html"])]
    compare: Vec<String>,
    /// Draw which thread planned what, and when.
    #[arg(long, value_name = "FILE.svg", conflicts_with = "compare")]
    timeline: Option<PathBuf>,
    /// Plan with 1 to 8 threads (up to --threads) and, with planner "classic", several buffers and overlaps of the look-ahead, some
    /// rounds in turn: a table of what they bring, and a picture of it. Nothing else is judged.
    #[arg(long, value_name = "FILE.svg")]
    #[arg(conflicts_with_all = ["samples", "path", "smoothed", "svg", "html", "script", "compare", "timeline", "json"])]
    efficiency: Option<PathBuf>,
    /// Print JSON, errors too.
    #[arg(long)]
    json: bool,
}

/// The planners by their names in the machine file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlannerName {
    /// Nearly the shortest time that the limits of every joint allow.
    Optimal,
    /// Corner speeds and seven-phase slopes.
    Classic,
}

impl From<PlannerName> for PlannerKind {
    fn from(name: PlannerName) -> PlannerKind {
        match name {
            PlannerName::Optimal => PlannerKind::Optimal,
            PlannerName::Classic => PlannerKind::Classic,
        }
    }
}

/// Plans a program and runs it down without a clock: exit code 0 if it can be run and keeps all limits.
///
/// # Errors
/// Files that cannot be read or written.
pub fn plan(args: &PlanArgs) -> anyhow::Result<ExitCode> {
    // A long program is planned for minutes: what is in the way of its files is told before.
    let files = [
        &args.samples,
        &args.path,
        &args.smoothed,
        &args.svg,
        &args.html,
        &args.timeline,
        &args.efficiency,
    ];
    for file in files.into_iter().flatten() {
        files::check(file).with_context(|| file.display().to_string())?;
    }
    let text = Text::read(&args.program).with_context(|| args.program.display().to_string())?;
    let text = Reader::from(&text);
    if !args.compare.is_empty() {
        return compare(args, text);
    }
    if let Some(file) = &args.efficiency {
        return measured(args, text, file);
    }
    let (config, tables, mut work) = planned(args, machine(args, None)?, text)?;
    if !args.json {
        tables
            .warnings()
            .iter()
            .for_each(|warning| files::errln!("warning: {warning}"));
    }
    let report = Report::new(&config, &work);
    let name = args.program.display().to_string();
    let doubts = doubts(&config, &tables, (&name, text), home(&config), &Cancel::default());
    // What was found out first: a disk may be full.
    if args.json {
        let told = Told {
            report: &report,
            warnings: tables.warnings(),
            doubts: &doubts,
        };
        say(&format!("{}\n", serde_json::to_string_pretty(&told)?));
    } else {
        say(&report.to_string());
    }
    let wrong = report.wrong();
    if !args.json {
        let program = args.program.display();
        wrong
            .iter()
            .for_each(|(line, what)| files::errln!("{program}:{line}: {what}"));
        for (line, what) in report.left_out() {
            let script = args.script.as_deref().unwrap_or(&args.program).display();
            files::errln!("{script}:{line}: never came: {what}");
        }
        if let Some((line, what)) = report.planning.real_time_factor.warning() {
            files::errln!("{program}:{line}: warning: {what}");
        }
        doubts.iter().for_each(|doubt| files::errln!("warning: {doubt}"));
    }
    let put = |file: &Path, text: String| files::write(file, text).with_context(|| file.display().to_string());
    for (file, lines) in [
        (&args.samples, work.judged.samples.take()),
        (&args.path, work.judged.path.take()),
    ] {
        if let Some((file, lines)) = file.as_ref().zip(lines) {
            put(file, lines)?;
        }
    }
    if let Some(file) = &args.smoothed {
        let feeds = std::mem::take(&mut work.judged.feeds);
        let points = export::smoothed(&config, &tables, (&name, text), feeds);
        put(file, points.map_err(|error| anyhow!(error.located(&name)))?)?;
    }
    if let Some((file, recording)) = args.svg.as_ref().zip(work.judged.recording.as_ref()) {
        let name = args.program.file_name().unwrap_or_default().to_string_lossy();
        put(file, picture::picture(&name, &config, recording, &work.judged, &report))?;
    }
    if let Some((file, record)) = args.timeline.as_ref().zip(work.timeline.as_ref()) {
        let name = args.program.file_name().unwrap_or_default().to_string_lossy();
        let title = format!("{name} on {}: who plans what", config.name);
        let (blocks, seconds, threads) = (work.judged.blocks, work.planned.wall_time_s, work.planned.threads);
        let rate = blocks as f64 / seconds;
        let figures = format!("{blocks} blocks in {seconds:.3} s, {rate:.0} blocks/s, {threads} threads");
        put(file, timeline::picture(&[title, figures], record))?;
    }
    if let Some(file) = &args.html {
        let page = page::Page {
            name: &args.program.file_name().unwrap_or_default().to_string_lossy(),
            text,
            config: &config,
            work: &work,
            report: &report,
            doubts: &doubts,
        };
        let html = page.html().with_context(|| args.program.display().to_string())?;
        put(file, html.unwrap_or_default())?;
    }
    Ok(if wrong.is_empty() && report.left_out().is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The report for programs, and what people are told beside it.
#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    report: &'a Report,
    /// What of the machine's tables counts for nothing.
    warnings: Vec<String>,
    doubts: &'a [Doubt],
}

/// The program planned with each setting, side by side: exit code 0 if it can be run with all of them.
fn compare(args: &PlanArgs, text: Reader<'_>) -> anyhow::Result<ExitCode> {
    let mut compare = Vec::new();
    for setting in std::iter::once(None).chain(args.compare.iter().map(Some)) {
        let (config, _, work) = planned(args, machine(args, setting)?, text)?;
        compare.push(Compared {
            setting: setting.map_or("as given", String::as_str).to_owned(),
            report: Report::new(&config, &work),
        });
    }
    let comparison = Comparison { compare };
    if args.json {
        say(&format!("{}\n", serde_json::to_string_pretty(&comparison)?));
    } else {
        say(&comparison.to_string());
    }
    let mut code = ExitCode::SUCCESS;
    for Compared { setting, report } in &comparison.compare {
        for (line, what) in report.wrong() {
            code = ExitCode::FAILURE;
            if !args.json {
                files::errln!("{}:{line}: {setting}: {what}", args.program.display());
            }
        }
    }
    Ok(code)
}

/// The machine, with a setting of its own.
fn machine(args: &PlanArgs, setting: Option<&String>) -> Result<Config, Refusal> {
    let mut config = match setting {
        Some(setting) => compare::machine(&args.machine, setting)?,
        None => bus::read(&args.machine)?,
    };
    let own_planner = setting.is_some_and(|setting| setting.contains("program.planner"));
    if let Some(name) = args.planner.filter(|_| !own_planner) {
        config.program.planner = name.into();
    }
    Ok(config)
}

/// The program planned for a machine.
fn planned(args: &PlanArgs, config: Config, text: Reader<'_>) -> Result<(Config, Tables, Work), Refusal> {
    let script = (args.script.as_ref())
        .map(|file| read_script(file, config.program.planner))
        .transpose()?;
    let (tables, name) = checked(args, &config, text)?;
    match run_down::run_down(
        &config,
        &tables,
        (&name, text),
        args.threads.map(usize::from),
        Wanted {
            samples: args.samples.is_some(),
            path: args.path.is_some(),
            feeds: args.smoothed.is_some(),
            picture: args.svg.is_some() || args.html.is_some() || (args.json && args.compare.is_empty()),
            script,
            timeline: args.timeline.is_some(),
        },
    ) {
        Ok(work) => Ok((config, tables, work)),
        Err(error) => Err(refused(&name, &error)),
    }
}

/// What threads, buffers and overlaps bring.
fn measured(args: &PlanArgs, text: Reader<'_>, file: &Path) -> anyhow::Result<ExitCode> {
    let config = machine(args, None)?;
    let (tables, name) = checked(args, &config, text)?;
    let threads = args.threads.map_or(8, usize::from);
    let efficiency = efficiency::measure(&config, &tables, (&name, text), threads);
    let efficiency = efficiency.map_err(|error| refused(&name, &error))?;
    say(&efficiency.to_string());
    let program = args.program.file_name().unwrap_or_default().to_string_lossy();
    let title = format!("{program} on {}: efficiency of threads", config.name);
    files::write(file, efficiency.picture(&title)).with_context(|| file.display().to_string())?;
    Ok(ExitCode::SUCCESS)
}

/// A program that cannot be planned.
fn refused(name: &str, error: &FeedError) -> Refusal {
    let listed = error_json(error.of_text());
    let json = json!({ "file": name, "errors": [listed] });
    Refusal::new(error.render(name), json)
}

/// The tables of a machine, and the name of the program, whose text has no error.
fn checked(args: &PlanArgs, config: &Config, text: Reader<'_>) -> Result<(Tables, String), Refusal> {
    let plain = |file: &Path, error: &dyn std::fmt::Display| Refusal::of_file(&file.display().to_string(), error);
    config::check_planner(config).map_err(|rule| plain(&args.machine, &format!("--planner classic: {rule}")))?;
    let tables = Tables::read(config).map_err(Refusal::from)?;
    let name = args.program.display().to_string();
    if config.joints.is_empty() {
        let rule = format!("cannot be planned: {}", config.without_joints());
        return Err(plain(&args.program, &format!("{name}: {rule}")));
    }
    let errors = program::check_text(config, &tables, &name, text, gcode::CheckLimits::default());
    if !errors.is_empty() {
        let shown: Vec<String> = errors.iter().map(|error| error.render(&name)).collect();
        let listed: Vec<Json> = errors.iter().map(error_json).collect();
        let json = json!({ "file": name, "errors": listed });
        return Err(Refusal::new(shown.join("\n\n"), json));
    }
    Ok((tables, name))
}

fn read_script(file: &Path, planner: PlannerKind) -> Result<Script, Refusal> {
    let name = file.display().to_string();
    let text = files::read(file, SCRIPT_MAX).map_err(|error| Refusal::of_file(&name, format!("{name}: {error}")))?;
    Script::parse(files::without_mark(&text), planner).map_err(|ScriptError { line, rule }| {
        let json = json!({ "file": name, "errors": [{ "line": line, "rule": rule }] });
        Refusal::new(format!("{name}:{line}: {rule}"), json)
    })
}
