//! `isocnc status`, `program run`, `enable`, `home`, `hold`, `resume`, `reverse`, `single-block`, `stop`, `override`,
//! `alarm acknowledge`: clients of a running control.
//!
//! In:  the control socket of a machine, or of the only one that runs.
//! Out: a few lines or one JSON value. Exit code 1: the control refuses, or none runs.

use crate::api::client::Client;
use crate::host::signals::{StopSignal, exit_code};
use crate::host::terminal::{self, StatusLine};
use crate::machine::faults::SILENCED;
use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Which control, and how to print.
#[derive(Clone, Debug, Args)]
pub struct ControlArgs {
    /// Control of this machine; without it the only one that runs
    #[arg(long, global = true, value_name = "NAME")]
    pub(super) machine: Option<String>,
    /// Print JSON
    #[arg(long, global = true)]
    pub(super) json: bool,
}

/// Arguments of `program`.
#[derive(Clone, Debug, Args)]
pub struct ProgramArgs {
    #[command(flatten)]
    control: ControlArgs,
    #[command(subcommand)]
    command: ProgramCommand,
}

/// Which control, how to print, and whether to wait for the end of what is ordered.
#[derive(Clone, Debug, Args)]
pub struct OrderArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Return once the order is given, not once it is carried out
    #[arg(long)]
    no_wait: bool,
}

#[derive(Clone, Debug, Subcommand)]
enum ProgramCommand {
    /// Run a program on a control that stands by: drives on, homing, the program, drives off
    #[command(after_help = "Example: isocnc program run configs/sample-part.ngc")]
    Run {
        /// File; the control must be allowed to read it
        file: PathBuf,
        /// Return once the program has begun, not once it is over
        #[arg(long)]
        no_wait: bool,
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
    #[command(after_help = "Example: isocnc alarm acknowledge")]
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

/// Between two looks while an order is carried out.
const LOOK: Duration = Duration::from_millis(50);
/// Pause between two lines about it where the output is no terminal.
const PAUSE: Duration = Duration::from_secs(5);

/// An order that takes its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasting {
    /// Switches drives on.
    Enable,
    /// Homes all joints.
    Home,
    /// Comes to rest on the path, gives the program up.
    Stop,
    /// Runs a program.
    Program,
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

/// Gives an order without parameters that is carried out at once; `done` says what comes of it.
fn order(args: &ControlArgs, method: &str, done: &str) -> anyhow::Result<ExitCode> {
    let answer = call(args, method, json!({}))?;
    print(args, &answer, done);
    Ok(ExitCode::SUCCESS)
}

/// Comes to rest on the path, keeps the program.
///
/// # Errors
/// No control answers, or it refuses.
pub fn hold(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    order(args, "hold", "comes to rest on the path; go on with: isocnc resume")
}

/// Goes on after a hold.
///
/// # Errors
/// No control answers, or it refuses.
pub fn resume(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    order(args, "resume", "goes on")
}

/// Gives an order and waits until it is carried out. Ctrl-C ends the waiting, and nothing else.
///
/// # Errors
/// No control answers, or it refuses.
pub fn lasting(args: &OrderArgs, order: Lasting) -> anyhow::Result<ExitCode> {
    let (method, begun) = match order {
        Lasting::Enable => ("enable", "drives go on and nothing moves; off again with: isocnc stop"),
        Lasting::Home => ("home", "homes; drives stay on then, off again with: isocnc stop"),
        Lasting::Stop => ("stop", "comes to rest on the path, then drives go off"),
        Lasting::Program => ("program.run", "begun"),
    };
    let signal = StopSignal::install().context("signals")?;
    let mut client = Client::connect(args.control.machine.as_deref())?;
    let answer = client.call(method, json!({}))?;
    if args.no_wait {
        print(&args.control, &answer, begun);
        return Ok(ExitCode::SUCCESS);
    }
    wait(&mut client, &args.control, order, &signal)
}

/// Runs a program, and waits for its end.
///
/// # Errors
/// There is no such file; no control answers, or it refuses.
pub fn program(args: &ProgramArgs) -> anyhow::Result<ExitCode> {
    let ProgramCommand::Run { file, no_wait } = &args.command;
    let signal = StopSignal::install().context("signals")?;
    let path = std::fs::canonicalize(file).with_context(|| file.display().to_string())?;
    let path = path.to_str().context("the path is no UTF-8")?;
    let mut client = Client::connect(args.control.machine.as_deref())?;
    let begun = client.call("program.run", json!({ "path": path }))?;
    let words = format!(
        "begun: {}, {} lines, {:.1} s planned; see: isocnc status",
        path,
        begun["lines"],
        begun["planned_time_s"].as_f64().unwrap_or(0.0)
    );
    if let Some(warning) = begun["warning"].as_str().filter(|_| !args.control.json) {
        eprintln!("warning: {warning}");
    }
    if *no_wait {
        print(&args.control, &begun, &words);
        return Ok(ExitCode::SUCCESS);
    }
    if !args.control.json {
        terminal::say(&format!("{words}\n"));
    }
    wait(&mut client, &args.control, Lasting::Program, &signal)
}

/// Waits until an order is carried out. Exit code 1: it was not.
fn wait(client: &mut Client, args: &ControlArgs, order: Lasting, signal: &StopSignal) -> anyhow::Result<ExitCode> {
    let mut line = StatusLine::new("{wide_msg}", PAUSE, args.json);
    loop {
        let status = match client.call("status", json!({})) {
            Ok(status) => status,
            // A control that was started for one program ends with it.
            Err(_) if order == Lasting::Stop => json!({ "step": "done", "state": "down" }),
            Err(error) => return Err(error.into()),
        };
        if let Some(end) = end_of(order, &status) {
            drop(line);
            let (words, code) = match end {
                Ok(words) => (words, ExitCode::SUCCESS),
                Err(words) => (words, ExitCode::FAILURE),
            };
            print(args, &status, &words);
            return Ok(code);
        }
        if let Some(signal) = signal.caught() {
            drop(line);
            print(
                args,
                &status,
                "not waited for any longer; the control goes on: isocnc status, isocnc stop",
            );
            return Ok(ExitCode::from(exit_code(signal)));
        }
        if line.is_due() {
            let words = on_the_way(&status);
            line.show(|bar| bar.set_message(words.clone()), || words.clone());
        }
        std::thread::sleep(LOOK);
    }
}

/// What came of an order: done, or why not; `None`: neither yet.
fn end_of(order: Lasting, status: &Value) -> Option<Result<String, String>> {
    let (step, state) = (status["step"].as_str()?, status["state"].as_str()?);
    let failed = || {
        let alarm = status["alarm"]
            .as_str()
            .map(|cause| terminal::alarm(format!("alarm: {cause}")).to_string());
        Some(Err(
            alarm.unwrap_or_else(|| format!("given up: the machine is {state} ({step})"))
        ))
    };
    let is_over = matches!(step, "standing by" | "done") && matches!(state, "disabled" | "faulted" | "down");
    match (order, step, state) {
        (.., "silenced") => Some(Err(terminal::alarm(SILENCED).to_string())),
        (Lasting::Enable, "set-up", "ready" | "jogging") => {
            Some(Ok("drives are on; off again with: isocnc stop".into()))
        }
        (Lasting::Home, "set-up", "ready" | "jogging") => {
            Some(Ok("homed; drives are on, off again with: isocnc stop".into()))
        }
        (Lasting::Stop, ..) if is_over => Some(Ok("at rest, drives are off".into())),
        (Lasting::Program, ..) if is_over => match status["program"]["result"].as_str()? {
            "completed" => Some(Ok("completed; drives are off".into())),
            "stopped" => Some(Err("stopped before its end; drives are off".into())),
            _ => failed(),
        },
        (Lasting::Enable | Lasting::Home, ..) if is_over => failed(),
        (Lasting::Enable | Lasting::Home | Lasting::Stop | Lasting::Program, ..) => None,
    }
}

/// How far an order is, as one line.
fn on_the_way(status: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap_or("unknown").to_owned();
    let step = text(&status["step"]);
    match status["step"].as_str() {
        Some("program") => format!(
            "line {} of {}  {}",
            status["line"],
            status["program"]["lines"],
            text(&status["state"])
        ),
        _ => step,
    }
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
pub fn set_overrides(args: &OverrideArgs) -> anyhow::Result<ExitCode> {
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
    order(&args.control, "alarm.acknowledge", "acknowledged; drives stay off")
}

fn call(args: &ControlArgs, method: &str, params: Value) -> anyhow::Result<Value> {
    let mut client = Client::connect(args.machine.as_deref())?;
    Ok(client.call(method, params)?)
}

pub(super) fn print(args: &ControlArgs, value: &Value, words: &str) {
    terminal::say(&match args.json {
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
        lines.push(terminal::alarm(format!("alarm     {alarm}")).to_string());
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
    fn whoever_waits_hears_that_the_network_is_silenced() {
        for order in [Lasting::Enable, Lasting::Home, Lasting::Stop, Lasting::Program] {
            let ended = end_of(order, &json!({ "step": "program", "state": "silenced" }));
            let said = ended.expect("an end").expect_err("no success");
            assert_eq!(console::strip_ansi_codes(&said), SILENCED);
        }
    }

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

    #[test]
    fn an_order_ends_when_it_is_carried_out_or_has_failed() {
        let status = |step: &str, state: &str| json!({ "step": step, "state": state, "alarm": null, "program": null });
        let end = |order, step, state| end_of(order, &status(step, state)).map(|end| end.is_ok());
        assert_eq!(end(Lasting::Enable, "switching drives on", "enabling"), None);
        assert_eq!(end(Lasting::Enable, "set-up", "enabling"), None);
        assert_eq!(end(Lasting::Enable, "set-up", "ready"), Some(true));
        assert_eq!(end(Lasting::Home, "homing", "ready"), None);
        assert_eq!(end(Lasting::Home, "set-up", "ready"), Some(true));
        assert_eq!(end(Lasting::Home, "standing by", "stopping"), None);
        assert_eq!(end(Lasting::Home, "standing by", "disabled"), Some(false));
        assert_eq!(end(Lasting::Stop, "switching drives off", "disabling"), None);
        assert_eq!(end(Lasting::Stop, "standing by", "disabled"), Some(true));
        assert_eq!(end(Lasting::Stop, "done", "down"), Some(true));
        let mut over = status("standing by", "disabled");
        assert_eq!(end_of(Lasting::Program, &status("program", "running")), None);
        over["program"] = json!({ "result": "completed" });
        assert_eq!(
            end_of(Lasting::Program, &over),
            Some(Ok("completed; drives are off".into()))
        );
        over["program"]["result"] = json!("stopped");
        assert!(end_of(Lasting::Program, &over).is_some_and(|end| end.is_err()));
        over["program"]["result"] = json!("faulted");
        over["alarm"] = json!("x-drive lost");
        let said = end_of(Lasting::Program, &over)
            .and_then(Result::err)
            .unwrap_or_default();
        assert_eq!(console::strip_ansi_codes(&said), "alarm: x-drive lost");
    }
}
