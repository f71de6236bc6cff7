//! `isocnc tune`: how well joints follow what they are told.
//!
//! In:  a machine. Out: measurements of it, with pictures.
//!
//! `experiment.rs` runs a program to measure one joint; `analysis/` judges it (model of its amplifier, margins, gains). The loop
//! itself is `motion::rt::Pid`, its gains while it runs are pins (`rt::loop_pins`). Circles are judged by `operator::circularity`.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod analysis;
mod ball_bar;
mod experiment;
mod pid;
mod step;
mod sweep;

use clap::{Args, Subcommand};
use std::process::ExitCode;

/// Arguments of `tune`.
#[derive(Debug, Args)]
pub struct TuneArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Run circles both ways and judge how round they are, as with a ball bar, by what the drives tell. The machine moves.
    #[command(after_help = "Example: isocnc tune ball-bar machine.toml --radius 50 --feed 2000")]
    BallBar(ball_bar::BallBarArgs),
    /// Move one joint there and back, and show rise, overshoot, settling and following error, and what might be fed forward. The
    /// machine moves.
    #[command(after_help = "Example: isocnc tune step machine.toml --joint 0 --distance 20")]
    Step(step::StepArgs),
    /// Move one joint to and fro, faster and faster, and show its frequency response: bandwidth, resonance, margins. The machine
    /// moves.
    #[command(after_help = "Example: isocnc tune sweep machine.toml --joint 0 --high 100")]
    Sweep(sweep::SweepArgs),
    /// Find gains of a position loop that the control closes, with their stability margins, and try them. The machine moves.
    #[command(after_help = "Example: isocnc tune pid machine.toml --joint 0 --apply")]
    Pid(pid::PidArgs),
}

/// Measures.
///
/// # Errors
/// What the measurement lacks, or cannot write.
pub fn tune(args: &TuneArgs) -> anyhow::Result<ExitCode> {
    match &args.what {
        What::BallBar(args) => ball_bar::ball_bar(args),
        What::Step(args) => step::step(args),
        What::Sweep(args) => sweep::run(args),
        What::Pid(args) => pid::pid(args),
    }
}

#[cfg(test)]
mod tests {
    use crate::analysis::record::Record;
    use config::Config;
    use hal_pins::Hal;
    use machine::sequence::Outcome;
    use operator::rehearsal::rehearse;
    use rt::shared::Command;
    use rt::waiting::Waiting;
    use sim::NetConfig;

    pub(crate) const LOOP: &str = include_str!("../../../configs/loop3-demo.toml");

    /// The record of a joint, of a program on virtual time.
    pub(crate) fn rehearsed(config: &Config, joint: usize, text: &str) -> Record {
        rehearsed_with(config, joint, text, |_, _| panic!("the program rests nowhere"))
    }

    /// The same with somebody who turns pins at M0.
    pub(crate) fn rehearsed_with(
        config: &Config,
        joint: usize,
        text: &str,
        mut turn: impl FnMut(&Record, &Hal),
    ) -> Record {
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        rehearse(config, text.as_bytes(), NetConfig::clean(1), |run| {
            run.operator.shared().trace_joint(joint);
            run.operator.recorder.keep_joint();
            let rests = |waiting: Option<Waiting>| waiting == Some(Waiting::Operator);
            run.run_until(120_000, |run| {
                rests(run.operator.live().waiting) || run.operator.outcome().is_some()
            })?;
            if rests(run.operator.live().waiting) {
                run.run_until(20, |_| false)?;
                turn(&Record::new(run.operator.recorder.joint_samples(), cycle_s)?, &run.hal);
                run.operator.give(Command::Resume);
            }
            assert_eq!(run.run(120_000)?, Outcome::Completed, "{:#?}", run.operator.journal());
            Record::new(run.operator.recorder.joint_samples(), cycle_s)
        })
        .unwrap()
    }
}
