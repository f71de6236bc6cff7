//! `isocnc bus`: what is on the network, how it is, and why something on it does not work.
//!
//! In:  a capture, an interface, or a running control.
//! Out: tables and sentences, or JSON, on standard output. Exit code 0: all is well, 1: trouble found, 2: wrong usage.

pub mod trace;
pub mod words;

use clap::{Args, Subcommand};
use std::io::{BufWriter, ErrorKind};
use std::process::ExitCode;

/// Arguments of `bus`.
#[derive(Clone, Debug, Args)]
pub struct BusArgs {
    /// Print JSON
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: BusCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum BusCommand {
    /// A capture in words: one line a frame, or a summary
    Trace(trace::TraceArgs),
}

/// Runs the command.
///
/// # Errors
/// What keeps it from looking: a file, an interface, a control that is not there.
pub fn bus(args: &BusArgs) -> anyhow::Result<ExitCode> {
    let mut out = BufWriter::new(std::io::stdout().lock());
    let done = match &args.command {
        BusCommand::Trace(trace) => trace::trace(trace, args.json, &mut out),
    };
    match done {
        // The reader of a pipe may have seen enough.
        Err(error) if is_broken_pipe(&error) => Ok(ExitCode::SUCCESS),
        done => done,
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let cause = error.downcast_ref::<std::io::Error>();
    cause.is_some_and(|cause| cause.kind() == ErrorKind::BrokenPipe)
}
