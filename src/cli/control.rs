//! `isocnc status`, `program run`, `enable`, `home`, `hold`, `resume`, `reverse`, `single-block`, `stop`, `override`,
//! `alarm acknowledge`: clients of a running control.
//!
//! In:  the control socket of a machine, or of the only one that runs.
//! Out: a few lines or one JSON value. Exit code 1: the control refuses, or none runs.

use crate::service::control::client::Client;
use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;

/// Which control, and how to print.
#[derive(Clone, Debug, Args)]
pub struct ControlArgs {
    /// Control of this machine; without it the only one that runs
    #[arg(long, global = true, value_name = "NAME")]
    pub(super) machine: Option<String>,
    /// Print JSON
    #[arg(long, global = true)]
    json: bool,
}

/// Arguments of `program`.
#[derive(Clone, Debug, Args)]
pub struct ProgramArgs {
    #[command(flatten)]
    control: ControlArgs,
    #[command(subcommand)]
    command: ProgramCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum ProgramCommand {
    /// Run a program on a control that stands by: drives on, homing, the program, drives off
    Run {
        /// File; the control must be allowed to read it
        file: PathBuf,
    },
}

/// Arguments of `alarm`.
#[derive(Clone, Debug, Args)]
pub struct AlarmArgs {
    #[command(flatten)]
    control: ControlArgs,
    #[command(subcommand)]
    command: AlarmCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum AlarmCommand {
    /// Allow motion again after a fault whose cause is gone; switches nothing on
    Acknowledge,
}

/// Arguments of `reverse`.
#[derive(Clone, Debug, Args)]
pub struct ReverseArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Percent of the speed at which the path was run
    #[arg(default_value_t = 100.0, allow_negative_numbers = true)]
    percent: f64,
}

/// Arguments of `single-block`.
#[derive(Clone, Debug, Args)]
pub struct SingleBlockArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Whether the program rests at the end of each block
    switch: Switch,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Switch {
    On,
    Off,
}

/// Arguments of `override`.
#[derive(Clone, Debug, Args)]
pub struct OverrideArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// What: the programmed feed, rapid moves, the speed of the spindle
    what: Overridden,
    /// Percent of what is programmed; 0 holds these moves
    #[arg(allow_negative_numbers = true)]
    percent: f64,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Overridden {
    Feed,
    Rapid,
    Spindle,
}

/// An order without parameters.
#[derive(Clone, Copy, Debug)]
pub enum Order {
    /// Switches drives on.
    Enable,
    /// Homes all joints.
    Home,
    /// Comes to rest on the path, keeps the program.
    Hold,
    /// Goes on after a hold.
    Resume,
    /// Comes to rest on the path, gives the program up.
    Stop,
}

/// Shows how a control is.
///
/// Exit code 1: its network is silenced, and it ends.
///
/// # Errors
/// No control answers.
pub fn status(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let status = call(args, "status", json!({}))?;
    print(args, &status, &words(&status));
    Ok(match status["state"] == "silenced" {
        true => ExitCode::FAILURE,
        false => ExitCode::SUCCESS,
    })
}

/// Gives an order.
///
/// # Errors
/// No control answers, or it refuses.
pub fn order(args: &ControlArgs, order: Order) -> anyhow::Result<ExitCode> {
    let (method, done) = match order {
        Order::Enable => ("enable", "drives go on and nothing moves; off again with: isocnc stop"),
        Order::Home => ("home", "homes; drives stay on then, off again with: isocnc stop"),
        Order::Hold => ("hold", "comes to rest on the path; go on with: isocnc resume"),
        Order::Resume => ("resume", "goes on"),
        Order::Stop => ("stop", "comes to rest on the path, then drives go off"),
    };
    let answer = call(args, method, json!({}))?;
    print(args, &answer, done);
    Ok(ExitCode::SUCCESS)
}

/// Runs a program.
///
/// # Errors
/// There is no such file; no control answers, or it refuses.
pub fn program(args: &ProgramArgs) -> anyhow::Result<ExitCode> {
    let ProgramCommand::Run { file } = &args.command;
    let path = std::fs::canonicalize(file).with_context(|| file.display().to_string())?;
    let path = path.to_str().context("the path is no UTF-8")?;
    let begun = call(&args.control, "program.run", json!({ "path": path }))?;
    let words = format!(
        "begun: {}, {} lines, {:.1} s planned; see: isocnc status",
        path,
        begun["lines"],
        begun["planned_time_s"].as_f64().unwrap_or(0.0)
    );
    print(&args.control, &begun, &words);
    Ok(ExitCode::SUCCESS)
}

/// Runs a program back along its path.
///
/// # Errors
/// No control answers, or it refuses.
pub fn reverse(args: &ReverseArgs) -> anyhow::Result<ExitCode> {
    let answer = call(&args.control, "reverse", json!({ "percent": args.percent }))?;
    let done = "goes back along the path; rest with: isocnc hold; forward with: isocnc resume";
    print(&args.control, &answer, done);
    Ok(ExitCode::SUCCESS)
}

/// Switches single block on or off.
///
/// # Errors
/// No control answers, or it refuses.
pub fn single_block(args: &SingleBlockArgs) -> anyhow::Result<ExitCode> {
    let on = args.switch == Switch::On;
    let answer = call(&args.control, "single_block", json!({ "on": on }))?;
    let done = match on {
        true => "rests at the end of each block; the next one with: isocnc resume",
        false => "blocks follow each other; a program that rests goes on with: isocnc resume",
    };
    print(&args.control, &answer, done);
    Ok(ExitCode::SUCCESS)
}

/// Turns an override.
///
/// # Errors
/// No control answers, or it refuses.
pub fn turn(args: &OverrideArgs) -> anyhow::Result<ExitCode> {
    let (name, acts) = match args.what {
        Overridden::Feed => ("feed", "feed_acts"),
        Overridden::Rapid => ("rapid", "feed_acts"),
        Overridden::Spindle => ("spindle", "spindle_acts"),
    };
    let answer = call(&args.control, "override", json!({ name: args.percent }))?;
    let mut words = overrides(&answer);
    if answer[acts] == false {
        words += "\nthe program has switched this override off at the moment (M49 to M51)";
    }
    print(&args.control, &answer, &words);
    Ok(ExitCode::SUCCESS)
}

/// Where the overrides stand, in words.
fn overrides(of: &Value) -> String {
    format!(
        "feed {} %, rapid {} %, spindle {} %",
        of["feed_percent"], of["rapid_percent"], of["spindle_percent"]
    )
}

/// Acknowledges.
///
/// # Errors
/// No control answers, or it refuses.
pub fn alarm(args: &AlarmArgs) -> anyhow::Result<ExitCode> {
    let AlarmCommand::Acknowledge = args.command;
    let answer = call(&args.control, "alarm.acknowledge", json!({}))?;
    print(&args.control, &answer, "acknowledged; drives stay off");
    Ok(ExitCode::SUCCESS)
}

fn call(args: &ControlArgs, method: &str, params: Value) -> anyhow::Result<Value> {
    let mut client = Client::connect(args.machine.as_deref())?;
    Ok(client.call(method, params)?)
}

pub(super) fn print(args: &ControlArgs, value: &Value, words: &str) {
    crate::service::progress::say(&match args.json {
        true => format!("{value}\n"),
        false => format!("{words}\n"),
    });
}

/// A status in words.
fn words(status: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap_or("unknown").to_owned();
    let mut lines = vec![
        format!("machine   {} ({})", text(&status["machine"]), text(&status["file"])),
        format!("state     {}, {}", text(&status["state"]), text(&status["step"])),
    ];
    if let Some(program) = status["program"].as_object() {
        let progress = match program["result"].as_str() {
            Some(result) => result.to_owned(),
            None => format!("line {} of {}", status["line"], program["lines"]),
        };
        let way = if status["direction"] == "reverse" {
            ", backward"
        } else {
            ""
        };
        lines.push(format!("program   {}: {progress}{way}", text(&program["name"])));
    }
    if status["single_block"] == true {
        lines.push("single    each block ends at rest".into());
    }
    let turned = ["feed_percent", "rapid_percent", "spindle_percent"].map(|what| status["override"][what] != 100.0);
    if status["override"].is_object() && turned.contains(&true) {
        lines.push(format!("override  {}", overrides(&status["override"])));
    }
    if let Some(obstruction) = status["obstruction"].as_str() {
        lines.push(obstruction.to_owned());
    }
    if let Some(alarm) = status["alarm"].as_str() {
        lines.push(format!("alarm     {alarm}"));
    }
    lines.push(format!(
        "cycles    {}, {} left out, {:.1} us late at most",
        status["cycles"],
        status["cycles_skipped"],
        status["late_max_us"].as_f64().unwrap_or(0.0)
    ));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_reads_as_sentences() {
        let mut status = json!({
            "machine": "mill3", "file": "mill3.toml", "state": "disabled", "step": "standing by", "program": null,
            "alarm": null, "cycles": 1000, "cycles_skipped": 0, "late_max_us": 12.34, "line": 7,
        });
        let waiting = "machine   mill3 (mill3.toml)\nstate     disabled, standing by\n\
                       cycles    1000, 0 left out, 12.3 us late at most";
        assert_eq!(words(&status), waiting);
        status["program"] = json!({ "name": "/p.ngc", "lines": 90, "planned_time_s": 1.0, "result": null });
        status["alarm"] = json!("x-drive lost");
        let said = words(&status);
        assert!(
            said.contains("\nprogram   /p.ngc: line 7 of 90\nalarm     x-drive lost\n"),
            "{said}"
        );
        status["direction"] = json!("reverse");
        status["single_block"] = json!(true);
        let said = words(&status);
        assert!(
            said.contains("/p.ngc: line 7 of 90, backward\nsingle    each block ends at rest\n"),
            "{said}"
        );
        status["direction"] = json!("forward");
        status["override"] = json!({ "feed_percent": 100.0, "rapid_percent": 100.0, "spindle_percent": 100.0 });
        assert!(!words(&status).contains("override"));
        status["override"]["feed_percent"] = json!(62.5);
        assert!(words(&status).contains("\noverride  feed 62.5 %, rapid 100.0 %, spindle 100.0 %\n"));
        status["program"]["result"] = json!("stopped");
        assert!(words(&status).contains("/p.ngc: stopped\n"));
    }
}
