//! `isocnc tune`: how well joints follow what they are told.
//!
//! In:  a machine. Out: measurements of it, with pictures.

mod ball_bar;

use clap::{Args, Subcommand};
use std::process::ExitCode;

/// Arguments of `tune`.
#[derive(Debug, Args)]
pub(super) struct TuneArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Run circles both ways and judge how round they are, as with a ball bar, by what the drives tell. The machine moves.
    #[command(after_help = "Example: isocnc tune ball-bar machine.toml --radius 50 --feed 2000")]
    BallBar(ball_bar::BallBarArgs),
}

/// Measures.
///
/// # Errors
/// What the measurement lacks, or cannot write.
pub(super) fn tune(args: &TuneArgs) -> anyhow::Result<ExitCode> {
    match &args.what {
        What::BallBar(args) => ball_bar::ball_bar(args),
    }
}
