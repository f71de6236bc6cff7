//! `isocnc logic`: Structured Text of a machine, without a machine.
//!
//! In:  a file of Structured Text; for a run a table of inputs over time (CSV).
//! Out: what is wrong with it, or the longest scan in steps and in time on this PC; for a run a table of outputs.

mod online;
mod table;

use anyhow::Context;
use clap::{Args, Subcommand};
use files::read::TEXT_MAX;
use logic::{Diagnostic, Logic, Runtime, Severity, duration};
use rt::logic::budget::{self, Budget};
use serde_json::{Value as Json, json};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use table::Table;
use terminal::print;
use terminal::refusal::Refusal;

/// Share of the period that the longest scan may take.
const SHARE_MAX: f64 = 0.5;

/// Arguments of `logic`.
#[derive(Debug, Args)]
pub struct LogicArgs {
    #[command(subcommand)]
    command: LogicCommand,
}

#[derive(Debug, Subcommand)]
enum LogicCommand {
    /// Compile a file: all errors at once, located, or how long a scan takes.
    #[command(after_help = "Example: isocnc logic check configs/logic/lubrication.st")]
    Check(CheckArgs),
    /// Run a file beside a table of inputs; print a table of outputs.
    #[command(after_help = "Example: isocnc logic run configs/logic/door.st --inputs configs/logic/door.csv")]
    Run(RunArgs),
    /// Show variables of a program of a running control as they change, until Ctrl-C
    #[command(after_help = "Example: isocnc logic watch cell --variable phase")]
    Watch(online::WatchArgs),
    /// Give a variable of a running control a value, whatever pins and the program make of it, or release it
    #[command(after_help = "Example: isocnc logic force door_closed 1")]
    Force(online::ForceArgs),
    /// Let the changed file of a program take the place of the one that runs, while the machine rests
    #[command(after_help = "Example: isocnc logic reload cell")]
    Reload(online::ReloadArgs),
}

#[derive(Debug, Args)]
struct CheckArgs {
    /// Structured Text
    file: PathBuf,
    /// Time from one scan to the next, ms
    #[arg(long, value_name = "MS", default_value = "10", value_parser = period)]
    period_ms: i64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Structured Text
    file: PathBuf,
    /// Inputs over time, CSV: t_ms and names of inputs; a row holds from its time on
    #[arg(long, value_name = "FILE.csv")]
    inputs: PathBuf,
    /// Time from one scan to the next, ms
    #[arg(long, value_name = "MS", default_value = "10", value_parser = period)]
    period_ms: i64,
    /// Other variables to be printed, too
    #[arg(long, value_name = "NAMES")]
    watch: Vec<String>,
}

/// A period as it is written, in nanoseconds.
fn period(text: &str) -> Result<i64, String> {
    let period_ns = duration::of_milliseconds(text).filter(|period| (1..=3_600_000_000_000).contains(period));
    period_ns.ok_or_else(|| "a period is above 0 and up to 3600000 ms".to_owned())
}

/// Runs the command.
///
/// # Errors
/// A program or table that is wrong, output that cannot be written.
pub fn logic(args: &LogicArgs) -> anyhow::Result<ExitCode> {
    match &args.command {
        LogicCommand::Check(args) => check(args),
        LogicCommand::Run(args) => run(args),
        LogicCommand::Watch(args) => online::watch(args),
        LogicCommand::Force(args) => online::force(args),
        LogicCommand::Reload(args) => online::reload(args),
    }
}

fn compile(path: &Path) -> anyhow::Result<Logic> {
    let name = path.display().to_string();
    let text = files::read_text(path, TEXT_MAX).with_context(|| name.clone())?;
    logic::compile(&text).map_err(|told| {
        let shown = told
            .iter()
            .map(|one| format!("{}\n\n", one.render(&name)))
            .collect::<String>();
        let errors: Vec<&Diagnostic> = told.iter().filter(|one| one.severity == Severity::Error).collect();
        let count = match errors.len() {
            1 => "1 error".to_owned(),
            count => format!("{count} errors"),
        };
        let as_json = errors.iter().map(|one| diagnostic_json(one)).collect::<Vec<_>>();
        Refusal::new(
            format!("{shown}{name}: {count}"),
            json!({ "file": name, "errors": as_json }),
        )
        .into()
    })
}

fn diagnostic_json(told: &Diagnostic) -> Json {
    json!({ "line": told.line, "column": told.column, "rule": told.kind.to_string() })
}

fn check(args: &CheckArgs) -> anyhow::Result<ExitCode> {
    let name = args.file.display().to_string();
    let logic = Arc::new(compile(&args.file)?);
    let budget = budget::check(&logic, args.period_ms as u64, SHARE_MAX);
    let Budget { steps, scan_us, share } = budget.map_err(|too_long| {
        let rule = &too_long.rule;
        let mut errors: Vec<Json> = too_long
            .loops
            .iter()
            .map(|at| json!({ "line": at.0, "column": at.1, "rule": rule }))
            .collect();
        if errors.is_empty() {
            errors.push(json!({ "rule": rule }));
        }
        Refusal::new(too_long.at(&name), json!({ "file": name, "errors": errors }))
    })?;
    let names = |variables: Vec<String>| {
        if variables.is_empty() {
            "none".to_owned()
        } else {
            variables.join(", ")
        }
    };
    let inputs: Vec<String> = logic.inputs().map(|variable| logic.name(variable)).collect();
    let outputs: Vec<String> = logic.outputs().map(|variable| logic.name(variable)).collect();
    print(&if args.json {
        let warnings = logic.warnings().iter().map(diagnostic_json).collect::<Vec<_>>();
        let json = json!({
            "file": name, "errors": [], "warnings": warnings, "inputs": inputs, "outputs": outputs, "steps": steps,
            "instructions": logic.instructions(), "values": logic.values(), "scan_us": scan_us, "share": share,
        });
        format!("{json:#}\n")
    } else {
        let told = logic
            .warnings()
            .iter()
            .map(|told| format!("{}\n\n", told.render(&name)));
        format!(
            "{}{name}: good\ninputs   {}\noutputs  {}\nprogram  {} instructions, {} values\nscan     {steps} steps at most, \
             about {scan_us:.1} us on this PC: {:.2} % of a period of {} ms\n",
            told.collect::<String>(),
            names(inputs),
            names(outputs),
            logic.instructions(),
            logic.values(),
            share * 100.0,
            duration::milliseconds(args.period_ms)
        )
    })?;
    Ok(ExitCode::SUCCESS)
}

fn run(args: &RunArgs) -> anyhow::Result<ExitCode> {
    let name = args.file.display().to_string();
    let logic = Arc::new(compile(&args.file)?);
    let inputs = files::read_text(&args.inputs, TEXT_MAX).with_context(|| args.inputs.display().to_string())?;
    let place = args.inputs.display().to_string();
    let table = Table::read(&inputs, &logic).map_err(|rule| Refusal::of_file(&place, format!("{place}:{rule}")))?;
    let columns =
        table::columns(&logic, &args.watch).map_err(|rule| Refusal::of_file(&name, format!("{name}: {rule}")))?;
    let mut runtime = Runtime::new(Arc::clone(&logic));
    let mut output = files::printed::buffered();
    let printed =
        table::print(&table, &columns, &mut runtime, args.period_ms, &mut output).and_then(|()| output.flush());
    match printed {
        // The reader of a pipe may have seen enough.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {}
        printed => printed?,
    }
    if let Some(fault) = runtime.fault() {
        let times = runtime.faults();
        let rule = format!("{}; {times} times in all", fault.wrong);
        let error = json!({ "line": fault.line, "column": fault.column, "rule": rule });
        let text = format!("{name}:{}:{}: {rule}", fault.line, fault.column);
        return Err(Refusal::new(text, json!({ "file": name, "errors": [error] })).into());
    }
    Ok(ExitCode::SUCCESS)
}
