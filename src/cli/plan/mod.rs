//! `isocnc plan`: a whole program planned off line, and judged.
//!
//! In:  machine file and part program.
//! Out: how long it takes and what it asks of every joint, as text or JSON; on demand set-points, paths and a picture.
//!
//! The program goes through the planner twice: once for the time that planning takes, once through the ring and the
//! interpolation of the machine, without a clock (`run_down`). What is judged is judged cycle by cycle: memory does not grow with the
//! program, but for the files of numbers that were asked for.

mod export;
mod ideal_spindle;
mod joints;
mod picture;
mod report;
mod run_down;
mod slow_places;

use crate::bus;
use crate::config::{self, Config};
use crate::machine::tables::Tables;
use crate::operator::refusal::Refusal;
use crate::program::text::{Reader, Text};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use motion::plan::PlannerKind;
use report::Report;
use run_down::{Wanted, Work};
use serde_json::{Value as Json, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

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
    /// Threads that plan, the first one counted; left out: as many as there are cores. The plan does not depend on them.
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
    let text = Text::read(&args.program).with_context(|| args.program.display().to_string())?;
    let text = Reader::from(&text);
    let (config, tables, mut work) = planned(args, text)?;
    let report = Report::new(&config, &work);
    // What was found out first: a disk may be full.
    if args.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{report}");
    }
    let wrong = report.wrong();
    if !args.json {
        let program = args.program.display();
        wrong
            .iter()
            .for_each(|(line, what)| eprintln!("{program}:{line}: {what}"));
    }
    let put = |file: &Path, text: String| files::write(file, text).with_context(|| file.display().to_string());
    for (file, lines) in [(&args.samples, work.samples.take()), (&args.path, work.path.take())] {
        if let Some((file, lines)) = file.as_ref().zip(lines) {
            put(file, lines)?;
        }
    }
    if let Some(file) = &args.smoothed {
        let name = args.program.display().to_string();
        let feeds = std::mem::take(&mut work.feeds);
        let points = export::smoothed(&config, &tables, (&name, text), feeds);
        put(file, points.map_err(|error| anyhow!(error.located(&name)))?)?;
    }
    if let Some((file, recording)) = args.svg.as_ref().zip(work.recording.as_ref()) {
        let name = args.program.file_name().unwrap_or_default().to_string_lossy();
        put(file, picture::picture(&name, &config, recording, &work, &report))?;
    }
    Ok(if wrong.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The machine, and the program planned for it.
fn planned(args: &PlanArgs, text: Reader<'_>) -> Result<(Config, Tables, Work), Refusal> {
    let mut config = bus::read(&args.machine)?;
    if let Some(name) = args.planner {
        config.program.planner = name.into();
    }
    let plain = |file: &Path, error: &dyn std::fmt::Display| Refusal::of_file(&file.display().to_string(), error);
    config::check_planner(&config).map_err(|rule| plain(&args.machine, &format!("--planner classic: {rule}")))?;
    let tables = Tables::read(&config).map_err(|error| plain(&args.machine, &error))?;
    let name = args.program.display().to_string();
    if config.joints.is_empty() {
        let rule = format!("cannot be planned: {}", config.without_joints());
        return Err(plain(&args.program, &format!("{name}: {rule}")));
    }
    let errors = crate::program::check_text(&config, &tables, &name, text, gcode::CheckLimits::default());
    if !errors.is_empty() {
        let shown: Vec<String> = errors.iter().map(|error| error.render(&name)).collect();
        let listed: Vec<Json> = errors.iter().map(error_json).collect();
        let json = json!({ "file": name, "errors": listed });
        return Err(Refusal::new(shown.join("\n\n"), json));
    }
    match run_down::run_down(
        &config,
        &tables,
        (&name, text),
        args.threads.map(usize::from),
        Wanted {
            samples: args.samples.is_some(),
            path: args.path.is_some(),
            feeds: args.smoothed.is_some(),
            picture: args.svg.is_some(),
        },
    ) {
        Ok(work) => Ok((config, tables, work)),
        Err(error) => {
            let listed = error_json(error.of_text());
            let json = json!({ "file": name, "errors": [listed] });
            Err(Refusal::new(error.render(&name), json))
        }
    }
}

fn error_json(error: &gcode::Error) -> Json {
    json!({
        "file": (!error.file.is_empty()).then_some(&error.file),
        "line": error.line,
        "column": error.column,
        "text": error.text,
        "rule": error.kind.to_string(),
    })
}
