//! `isocnc run`: the control.

use crate::services;
use anyhow::Context;
use clap::Args;
use host::signals::StopSignal;
use operator::session::{Program, Wire};
use operator::single_run::{Job, run_and_report};
use operator::standby::stand_by;
use program::text::{Reader, Text};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Machine file.
    machine: PathBuf,
    /// Part program; without it the control stands by for 'isocnc program run'.
    program: Option<PathBuf>,
    /// Folder for the report and its pictures [default: isocnc-out]
    #[arg(long, requires = "program")]
    out: Option<PathBuf>,
    /// Serve the operator panel in the browser there [default: that of the machine file, 127.0.0.1:8402]
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, value_parser = panel_address)]
    panel: Option<Option<SocketAddr>>,
    /// Print the report as JSON instead of text; without a program the journal, one JSON object a line.
    #[arg(long)]
    json: bool,
}

/// Runs a part program from power-on to power-off, or stands by for programs.
pub fn run(args: &RunArgs) -> anyhow::Result<ExitCode> {
    let signal = StopSignal::install().context("signals")?;
    let config = bus::read(&args.machine).map_err(Refusal::from)?;
    let wire = match config.bus.kind {
        kind if kind.has_interface() => Wire::Interface(config.bus.interface.clone()),
        _ => Wire::Memory,
    };
    let services = services::of(&config, args.panel, args.json, args.program.is_none())?;
    let Some(program) = &args.program else {
        return stand_by(&config, wire, args.json, signal, services);
    };
    let text = Text::read(program).with_context(|| program.display().to_string())?;
    let job = Job {
        config: &config,
        program: Program {
            name: &program.display().to_string(),
            text: Reader::from(&text),
        },
        out: args.out.as_deref().unwrap_or(Path::new("isocnc-out")),
        json: args.json,
        signal,
        services,
        far_end: None,
    };
    run_and_report(job, wire)
}

/// An address of the panel.
///
/// # Errors
/// It is none.
pub(super) fn panel_address(text: &str) -> Result<SocketAddr, String> {
    let rule = "expected an address and a port, like 127.0.0.1:8402; --panel without one stands behind all other words";
    text.parse().map_err(|_| rule.to_owned())
}
