//! `isocnc run`: the control.

use crate::config;
use crate::service::job::{Job, run_and_report};
use crate::service::process::{Program, Wire};
use crate::service::signals::StopSignal;
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Machine file.
    machine: PathBuf,
    /// Part program.
    program: PathBuf,
    /// Folder for the report and its pictures.
    #[arg(long, default_value = "isocnc-out")]
    out: PathBuf,
    /// Print the report as JSON instead of text.
    #[arg(long)]
    json: bool,
}

/// Runs a part program from power-on to power-off.
pub fn run(args: &RunArgs) -> anyhow::Result<ExitCode> {
    let signal = StopSignal::install().context("signals")?;
    let config = match config::read(&args.machine) {
        Ok(config) => config,
        Err(errors) => {
            eprint!("{errors}");
            return Ok(ExitCode::FAILURE);
        }
    };
    let text = std::fs::read(&args.program).with_context(|| args.program.display().to_string())?;
    let wire = match config.bus.kind {
        config::BusKind::Powerlink => Wire::Interface(config.bus.interface.clone()),
        config::BusKind::Memory => Wire::Memory,
    };
    let job = Job {
        config: &config,
        program: Program {
            name: &args.program.display().to_string(),
            text: &text,
        },
        out: &args.out,
        json: args.json,
        signal,
        far_end: None,
    };
    run_and_report(job, wire)
}
