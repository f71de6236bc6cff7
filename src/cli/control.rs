//! `isocnc status`, `on`, `off`, `home`, `program`, `mdi`, `hold`, `resume`, `reverse`, `single-block`, `stop`, `override`,
//! `tool-changed`, `alarm acknowledge`: clients of a running control.
//!
//! In:  the control socket of a machine, or of the only one that runs.
//! Out: a few lines or one JSON value. Exit code 1: the control refuses, or none runs.

use super::progress;
use crate::api::client::{Client, ClientError};
use crate::api::rpc::code;
use crate::host::signals::{StopSignal, exit_code};
use crate::host::terminal::{self, StatusLine};
use crate::machine::faults::SILENCED;
use crate::operator::program_reports::StandByReport;
use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use files::read::PROGRAM_MAX;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Which control, and how to print.
#[derive(Clone, Debug, Args)]
pub struct ControlArgs {
    /// Control of this machine; without it the only one that runs
    #[arg(long, global = true, value_name = "NAME")]
    pub(super) machine: Option<String>,
    /// Print JSON
    #[arg(long, global = true)]
    pub(super) json: bool,
    /// Take control from another client that has taken it
    #[arg(long, global = true)]
    take_over: bool,
}

/// Arguments of `status`.
#[derive(Clone, Debug, Args)]
pub struct StatusArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Print the whole state, then each change, one JSON value a line
    #[arg(long)]
    follow: bool,
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
    /// Check a program and keep it for `start`
    #[command(after_help = "Example: isocnc program load configs/sample-part.ngc")]
    Load {
        /// File, or - for standard input
        file: PathBuf,
    },
    /// Run the program that is loaded; drives are on and joints homed before
    #[command(after_help = "Example: isocnc program start")]
    Start {
        /// Begin before this line: says what that means, and does it with --yes
        #[arg(long, value_name = "N")]
        from_line: Option<u32>,
        /// What a start at a line means is right
        #[arg(long, requires = "from_line")]
        yes: bool,
        /// So many times in all, each behind the end of the one before
        #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "from_line",
              value_parser = clap::value_parser!(u32).range(1..))]
        repeat: u32,
        /// Dry: moves at feed run at this one, mm/min, spindle and coolant are not switched on, no part is counted
        #[arg(long, value_name = "FEED")]
        dry_run: Option<f64>,
        /// Return once the program has begun, not once it is over
        #[arg(long)]
        no_wait: bool,
    },
    /// Print what a program that was run did: the last one, or one of the last 50
    #[command(after_help = "Example: isocnc program report")]
    Report {
        /// Its number: the journal has it
        number: Option<u64>,
    },
    /// All at once: drives on, joints home that are not, load, start; drives stay on
    #[command(after_help = "Example: isocnc program run configs/sample-part.ngc")]
    Run {
        /// File, or - for standard input
        file: PathBuf,
        /// Return once the program has begun, not once it is over
        #[arg(long)]
        no_wait: bool,
    },
}

/// Arguments of `home`.
#[derive(Clone, Debug, Args)]
pub struct HomeArgs {
    #[command(flatten)]
    order: OrderArgs,
    /// Numbers of the joints; all without them
    joints: Vec<u8>,
}

/// Arguments of `mdi`.
#[derive(Clone, Debug, Args)]
pub struct MdiArgs {
    #[command(flatten)]
    order: OrderArgs,
    /// A line of G-code
    #[arg(required_unless_present = "history")]
    line: Option<String>,
    /// Print the lines that were typed last
    #[arg(long, conflicts_with_all = ["line", "no_wait"])]
    history: bool,
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

/// Arguments of `estop`.
#[derive(Clone, Debug, Args)]
pub struct EstopArgs {
    #[command(flatten)]
    control: ControlArgs,
    #[command(subcommand)]
    command: Option<EstopCommand>,
}

#[derive(Clone, Debug, Subcommand)]
enum EstopCommand {
    /// The emergency stop is over; switches nothing on
    #[command(after_help = "Example: isocnc estop reset")]
    Reset,
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

/// Arguments of `single-block`, `optional-stop` and `block-delete`.
#[derive(Clone, Debug, Args)]
pub struct SwitchArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Whether it is to count
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
/// Looks whether a reset has had its effect.
const RESET_LOOKS: u32 = 10;
/// Pause between two lines about it where the output is no terminal.
const PAUSE: Duration = Duration::from_secs(5);

/// An order that takes its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasting {
    /// Switches drives on.
    On,
    /// To rest, then switches drives off.
    Off,
    /// Homes joints.
    Home,
    /// Comes to rest on the path, gives the program up.
    Stop,
    /// Runs a program.
    Program,
    /// Runs a line of G-code.
    Mdi,
    /// Comes to rest on the path, keeps the program.
    Hold,
    /// Goes on after a hold; away from the path, returns to it.
    Return,
}

/// Shows how a control is.
///
/// Exit code 1: its network is silenced, and it ends.
///
/// # Errors
/// No control answers.
pub fn status(args: &StatusArgs) -> anyhow::Result<ExitCode> {
    if args.follow {
        return follow(&args.control);
    }
    let status = call(&args.control, "status", json!({}))?;
    print(&args.control, &status, &words(&status));
    Ok(match status["state"] == "silenced" {
        true => ExitCode::FAILURE,
        false => ExitCode::SUCCESS,
    })
}

/// Prints changes until the control ends.
fn follow(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let mut client = connect(args)?;
    let mut value = client.call("subscribe", json!({}))?;
    loop {
        // Whoever reads them may be gone.
        if writeln!(std::io::stdout(), "{value}").is_err() {
            return Ok(ExitCode::SUCCESS);
        }
        value = client.notification()?["params"].take();
    }
}

/// Longest that a machine takes to set out on its way back.
const SETS_OUT: Duration = Duration::from_secs(2);

const GOES_ON: &str = "go on with: isocnc resume";

/// Gives an order without parameters that is carried out at once; `done` says what comes of it.
fn order(args: &ControlArgs, method: &str, done: &str) -> anyhow::Result<ExitCode> {
    let answer = call(args, method, json!({}))?;
    print(args, &answer, done);
    Ok(ExitCode::SUCCESS)
}

/// Goes on after a hold; away from the path, returns to it first.
fn resume(args: &OrderArgs) -> anyhow::Result<ExitCode> {
    let signal = StopSignal::install().context("signals")?;
    let mut client = connect(&args.control)?;
    let answer = client.call("resume", json!({}))?;
    warn(&args.control, &answer);
    let Some(legs) = answer["returns"].as_array() else {
        print(&args.control, &answer, "goes on");
        return Ok(ExitCode::SUCCESS);
    };
    let way = legs
        .iter()
        .filter_map(Value::as_str)
        .collect::<Vec<_>>()
        .join(", then ");
    let way = format!("returns to the path: {way}");
    if args.no_wait {
        print(&args.control, &answer, &format!("{way}\nthere it waits; {GOES_ON}"));
        return Ok(ExitCode::SUCCESS);
    }
    if !args.control.json {
        terminal::say(&format!("{way}\n"));
    }
    // It sets out once the hand rests.
    let give_up = Instant::now() + SETS_OUT;
    while client.call("status", json!({}))?["state"] == "away" && Instant::now() < give_up {
        std::thread::sleep(LOOK);
    }
    wait(&mut client, &args.control, Lasting::Return, &signal)
}

/// Gives up what the program waits for.
///
/// # Errors
/// No control answers, or it refuses.
pub fn skip(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let answer = call(args, "skip", json!({}))?;
    let what = answer["skips"].as_str().unwrap_or_default();
    print(args, &answer, &format!("left out: {what}"));
    Ok(ExitCode::SUCCESS)
}

/// Says that the tool is in the spindle that the program waits for.
///
/// # Errors
/// No control answers, or it refuses.
pub fn tool_changed(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    order(args, "tool.changed", "goes on with this tool")
}

/// Switches drives on or off, or stops, and waits until that is done. Ctrl-C ends the waiting, and nothing else.
///
/// # Errors
/// No control answers, or it refuses.
pub fn lasting(args: &OrderArgs, order: Lasting) -> anyhow::Result<ExitCode> {
    let (method, begun) = match order {
        Lasting::On => ("on", "drives go on, and nothing moves"),
        Lasting::Off => ("off", "comes to rest, then drives go off"),
        Lasting::Stop => ("stop", "comes to rest on the path; drives stay on"),
        Lasting::Home => ("home", "homes; drives stay on"),
        Lasting::Program => ("program.start", "begun; see: isocnc status"),
        Lasting::Mdi => ("mdi", "begun"),
        Lasting::Hold => ("hold", "comes to rest on the path; go on with: isocnc resume"),
        Lasting::Return => return resume(args),
    };
    give(args, order, method, json!({}), |_| begun.to_owned())
}

/// Homes joints.
///
/// # Errors
/// No control answers, or it refuses.
pub fn home(args: &HomeArgs) -> anyhow::Result<ExitCode> {
    let params = match args.joints.is_empty() {
        true => json!({}),
        false => json!({ "joints": args.joints }),
    };
    give(&args.order, Lasting::Home, "home", params, |_| {
        "homes; drives stay on".into()
    })
}

/// Runs a line of G-code.
///
/// # Errors
/// No control answers, or it refuses.
pub fn mdi(args: &MdiArgs) -> anyhow::Result<ExitCode> {
    if args.history {
        let history = call(&args.order.control, "mdi.history", json!({}))?;
        let lines = history["lines"].as_array().map(Vec::as_slice).unwrap_or_default();
        let lines: Vec<&str> = lines.iter().filter_map(Value::as_str).collect();
        print(&args.order.control, &history, &lines.join("\n"));
        return Ok(ExitCode::SUCCESS);
    }
    let params = json!({ "line": args.line });
    give(&args.order, Lasting::Mdi, "mdi", params, |_| "begun".into())
}

/// Loads, starts or runs a program, and waits for its end.
///
/// # Errors
/// There is no such file; no control answers, or it refuses.
pub fn program(args: &ProgramArgs) -> anyhow::Result<ExitCode> {
    let control = &args.control;
    let (file, params, no_wait) = match &args.command {
        ProgramCommand::Load { file } => {
            let loaded = ask_with(&mut connect(control)?, "program.load", file)?;
            warn(control, &loaded);
            let words = outlook("loaded", &loaded);
            print(control, &loaded, &format!("{words}; run it with: isocnc program start"));
            return Ok(ExitCode::SUCCESS);
        }
        ProgramCommand::Start {
            from_line,
            yes,
            repeat,
            dry_run,
            no_wait,
        } => {
            let mut params = match from_line {
                Some(line) => json!({ "from_line": line, "yes": yes }),
                None => json!({ "repeat": repeat }),
            };
            if let Some(feed) = dry_run {
                params["dry_run_feed_mm_min"] = json!(feed);
            }
            (None, params, *no_wait)
        }
        ProgramCommand::Report { number } => {
            let params = number.map_or_else(|| json!({}), |number| json!({ "number": number }));
            let answer = call(control, "program.report", params)?;
            let report: StandByReport =
                serde_json::from_value(answer.clone()).context("the control sends another report")?;
            print(control, &answer, report.to_string().trim_end());
            return Ok(ExitCode::SUCCESS);
        }
        ProgramCommand::Run { file, no_wait } => (Some(file), json!({}), *no_wait),
    };
    let args = OrderArgs {
        control: control.clone(),
        no_wait,
    };
    let begin = |client: &mut Client| match file {
        Some(file) => ask_with(client, "program.run", file),
        None => Ok(client.call("program.start", params)?),
    };
    give_by(&args, Lasting::Program, begin, |begun| {
        format!("{}; see: isocnc status", outlook("begun", begun))
    })
}

/// Asks for something with a program: by its path, and where the control cannot read it, by sending it.
fn ask_with(client: &mut Client, method: &str, file: &Path) -> anyhow::Result<Value> {
    if file == Path::new("-") {
        let mut text = Vec::new();
        std::io::stdin().lock().take(PROGRAM_MAX + 1).read_to_end(&mut text)?;
        let upload = client.upload("standard input", text.as_slice(), text.len() as u64)?;
        return Ok(client.call(method, json!({ "upload": upload }))?);
    }
    let path = std::fs::canonicalize(file).with_context(|| file.display().to_string())?;
    let path = path.to_str().context("the path is no UTF-8")?;
    match client.call(method, json!({ "path": path })) {
        Err(ClientError::Refused(error)) if error.code == code::UNREADABLE => {
            let program = files::open(file).with_context(|| path.to_owned())?;
            let octets = program.metadata()?.len();
            let upload = client.upload(path, program, octets)?;
            Ok(client.call(method, json!({ "upload": upload }))?)
        }
        answer => Ok(answer?),
    }
}

/// What a program comes to, in words.
fn outlook(done: &str, of: &Value) -> String {
    format!(
        "{done}: {}, {} lines, {:.1} s planned",
        of["program"].as_str().unwrap_or("program"),
        of["lines"],
        of["planned_time_s"].as_f64().unwrap_or(0.0)
    )
}

pub(super) fn warn(control: &ControlArgs, begun: &Value) {
    if let Some(warning) = begun["warning"].as_str().filter(|_| !control.json) {
        eprintln!("warning: {warning}");
    }
}

/// Gives an order, and waits until it is carried out if that is wanted.
fn give(
    args: &OrderArgs,
    order: Lasting,
    method: &str,
    params: Value,
    words: impl FnOnce(&Value) -> String,
) -> anyhow::Result<ExitCode> {
    give_by(args, order, |client| Ok(client.call(method, params)?), words)
}

/// The same, where more than one thing has to be asked.
fn give_by(
    args: &OrderArgs,
    order: Lasting,
    begin: impl FnOnce(&mut Client) -> anyhow::Result<Value>,
    words: impl FnOnce(&Value) -> String,
) -> anyhow::Result<ExitCode> {
    let signal = StopSignal::install().context("signals")?;
    let mut client = connect(&args.control)?;
    client.wait_until(Some(signal.cancel().clone()));
    let begun = begin(&mut client);
    client.wait_until(None);
    let begun = match (begun, signal.caught()) {
        (Err(error), Some(signal)) if matches!(error.downcast_ref(), Some(ClientError::GivenUp)) => {
            print(&args.control, &json!({}), "given up before it began");
            return Ok(ExitCode::from(exit_code(signal)));
        }
        (begun, _) => begun?,
    };
    warn(&args.control, &begun);
    let words = words(&begun);
    if args.no_wait {
        print(&args.control, &begun, &words);
        return Ok(ExitCode::SUCCESS);
    }
    if !args.control.json && order == Lasting::Program {
        terminal::say(&format!("{words}\n"));
    }
    wait(&mut client, &args.control, order, &signal)
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
    if state == "silenced" {
        return Some(Err(terminal::alarm(SILENCED).to_string()));
    }
    // A control that was started for one program ends with it.
    let is_over = step == "done";
    let job = status["job"].as_str();
    let lasts = match order {
        // What waits rests as well.
        Lasting::Hold => state == "running" && status["waiting"].is_null(),
        Lasting::Return => state == "returning",
        _ => job.is_none() && !is_over,
    };
    if lasts {
        return None;
    }
    let drives = match state {
        "ready" | "jogging" => "drives are on",
        _ => "drives are off",
    };
    let alarm = status["alarm"].as_str();
    let failed = |words: String| {
        let alarm = alarm.map(|cause| terminal::alarm(format!("alarm: {cause}")).to_string());
        Some(Err(alarm.unwrap_or(words)))
    };
    match order {
        Lasting::Off if matches!(state, "ready" | "jogging") => None,
        Lasting::Stop if matches!(state, "jogging" | "stopping") => None,
        Lasting::Off | Lasting::Stop => Some(Ok(format!("at rest, {drives}"))),
        Lasting::Hold => match state {
            "running" | "held" | "away" => Some(Ok(format!("at rest on the path; {GOES_ON}"))),
            // Of a jog.
            "ready" | "jogging" => Some(Ok("comes to rest".into())),
            _ => failed(format!("no program is held: the machine is {state} ({step})")),
        },
        Lasting::Return => match state {
            "held" => Some(Ok(format!("on the path again; {GOES_ON}"))),
            _ => failed(format!("not back on the path: the machine is {state} ({step})")),
        },
        Lasting::On | Lasting::Home | Lasting::Program | Lasting::Mdi => match job {
            Some("completed") => Some(Ok(match order {
                Lasting::Home => format!("homed; {drives}"),
                Lasting::Program | Lasting::Mdi => format!("completed; {drives}"),
                Lasting::On | Lasting::Off | Lasting::Stop | Lasting::Hold | Lasting::Return => drives.to_owned(),
            })),
            Some("stopped") => failed(format!("stopped before its end; {drives}")),
            _ => failed(format!("given up: the machine is {state} ({step})")),
        },
    }
}

/// How far an order is, as one line.
fn on_the_way(status: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap_or("unknown").to_owned();
    if let Some(waiting) = status["waiting"]["text"].as_str() {
        return format!("waits: {waiting}; {}", text(&status["waiting"]["release"]));
    }
    match (status["step"].as_str(), status["mode"].as_str()) {
        (Some("program"), Some("mdi")) => text(&status["state"]),
        (Some("program"), _) => format!(
            "line {} of {}  {}",
            status["line"],
            status["program"]["lines"],
            text(&status["state"])
        ),
        _ => text(&status["step"]),
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

/// Switches M1 on or off.
///
/// # Errors
/// No control answers, or it refuses.
pub fn optional_stop(args: &SwitchArgs) -> anyhow::Result<ExitCode> {
    let done = match args.switch {
        Switch::On => "stops at M1",
        Switch::Off => "does not stop at M1; one that has stopped goes on with: isocnc resume",
    };
    switch(args, "optional_stop", done)
}

/// Switches block delete on or off.
///
/// # Errors
/// No control answers, or it refuses.
pub fn block_delete(args: &SwitchArgs) -> anyhow::Result<ExitCode> {
    let done = match args.switch {
        Switch::On => "lines that begin with / are left out",
        Switch::Off => "lines that begin with / are run",
    };
    switch(args, "block_delete", done)
}

fn switch(args: &SwitchArgs, method: &str, done: &str) -> anyhow::Result<ExitCode> {
    let answer = call(&args.control, method, json!({ "on": args.switch == Switch::On }))?;
    print(&args.control, &answer, done);
    Ok(ExitCode::SUCCESS)
}

/// Switches single block on or off.
///
/// # Errors
/// No control answers, or it refuses.
pub fn single_block(args: &SwitchArgs) -> anyhow::Result<ExitCode> {
    let done = match args.switch {
        Switch::On => "rests at the end of each block; the next one with: isocnc resume",
        Switch::Off => "blocks follow each other; a program that rests goes on with: isocnc resume",
    };
    switch(args, "single_block", done)
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

/// Stops at once, or resets that.
///
/// # Errors
/// No control answers, or it refuses.
pub fn estop(args: &EstopArgs) -> anyhow::Result<ExitCode> {
    match args.command {
        None => order(&args.control, "estop", "emergency stop; over with: isocnc estop reset"),
        Some(EstopCommand::Reset) => reset_estop(&args.control),
    }
}

/// Tells what came of a reset: a chain that stays open lets the stop stand.
fn reset_estop(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let mut client = connect(args)?;
    client.call("estop.reset", json!({}))?;
    for _ in 0..RESET_LOOKS {
        let status = client.call("status", json!({}))?;
        if status["state"] != "estop" {
            print(args, &status, "reset; drives stay off: isocnc on");
            return Ok(ExitCode::SUCCESS);
        }
        std::thread::sleep(LOOK);
    }
    let status = client.call("status", json!({}))?;
    print(
        args,
        &status,
        "the emergency stop stands, its chain is still open: release the button that opened it, then isocnc estop reset",
    );
    Ok(ExitCode::FAILURE)
}

/// Acknowledges.
///
/// # Errors
/// No control answers, or it refuses.
pub fn alarm(args: &AlarmArgs) -> anyhow::Result<ExitCode> {
    let AlarmCommand::Acknowledge = args.command;
    order(&args.control, "alarm.acknowledge", "acknowledged; drives stay off")
}

pub(super) fn call(args: &ControlArgs, method: &str, params: Value) -> anyhow::Result<Value> {
    Ok(connect(args)?.call(method, params)?)
}

/// Connects, and takes control away from whoever has taken it, if that is wanted; it is free then.
pub(super) fn connect(args: &ControlArgs) -> anyhow::Result<Client> {
    let mut client = Client::connect(args.machine.as_deref())?;
    if args.take_over {
        client.call("control.take", json!({ "name": "isocnc", "force": true }))?;
        client.call("control.release", json!({}))?;
    }
    Ok(client)
}

pub(super) fn print(args: &ControlArgs, value: &Value, words: &str) {
    terminal::say(&match args.json {
        true => format!("{value}\n"),
        false => format!("{words}\n"),
    });
}

/// Parts made, and wanted; `None`: none of them.
pub(super) fn parts_words(parts: &Value) -> Option<String> {
    match (parts["count"].as_u64()?, parts["target"].as_u64()) {
        (0, None) => None,
        (count, None) => Some(count.to_string()),
        (count, Some(target)) => Some(format!("{count} of {target}")),
    }
}

/// Whether the machine can move, and what is in the way.
fn power_words(status: &Value) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(power) = status["power"].as_str() {
        lines.push(format!("power     {power}"));
    }
    for end in ["lower", "upper"] {
        let joints = status["limit_switches"][end].as_array().into_iter().flatten();
        lines.extend(joints.map(|joint| format!("limit     the {end} switch of joint {joint} is closed")));
    }
    if let Some(next) = status["next"].as_str() {
        lines.push(format!("next      {next}"));
    }
    lines
}

/// Tells whether the machine can move, and what is in the way.
///
/// # Errors
/// No control answers.
pub fn power(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let status = call(args, "status", json!({}))?;
    let mut lines = power_words(&status);
    let numbers = |list: &Value| -> Vec<String> {
        let joints = list.as_array().into_iter().flatten();
        joints.map(Value::to_string).collect()
    };
    let homed = numbers(&status["homed"]);
    let last = lines.len().saturating_sub(usize::from(status["next"].is_string()));
    lines.insert(
        last,
        match homed.is_empty() {
            true => "homed     no joint".to_owned(),
            false => format!("homed     joints {}", homed.join(" ")),
        },
    );
    if let Some(alarm) = status["alarm"].as_str() {
        lines.insert(last, terminal::alarm(format!("alarm     {alarm}")).to_string());
    }
    let kept = ["power", "estop_chain_open", "homed", "limit_switches", "alarm", "next"];
    let answer: serde_json::Map<String, Value> = kept
        .iter()
        .map(|key| ((*key).to_owned(), status[*key].clone()))
        .collect();
    print(args, &Value::Object(answer), &lines.join("\n"));
    Ok(ExitCode::SUCCESS)
}

/// A status in words.
fn words(status: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap_or("unknown").to_owned();
    let mut lines = vec![
        format!("machine   {} ({})", text(&status["machine"]), text(&status["file"])),
        format!("state     {}, {}", text(&status["state"]), text(&status["step"])),
    ];
    lines.extend(power_words(status));
    if status["control"]["taken"] == true {
        let (name, process) = (text(&status["control"]["name"]), &status["control"]["process"]);
        lines.push(format!("control   {name} (process {process})"));
    }
    if let Some(waiting) = status["waiting"].as_object() {
        let (what, release) = (text(&waiting["text"]), text(&waiting["release"]));
        lines.push(format!("waits     {what}; {release}"));
    }
    if let Some(mdi) = status["mdi"].as_array().filter(|mdi| !mdi.is_empty()) {
        let mdi: Vec<&str> = mdi.iter().filter_map(Value::as_str).collect();
        lines.push(format!("mdi       {}", mdi.join(" | ")));
    }
    if let Some(program) = status["program"].as_object() {
        let progress = match program["result"].as_str() {
            Some(result) => result.to_owned(),
            None if status["step"] != "program" => "loaded".to_owned(),
            None => {
                let how_far = progress::words(|name| &status[name]);
                let more = match status["runs_left"].as_u64() {
                    Some(left @ 1..) => format!(", {left} times more"),
                    _ => String::new(),
                };
                let dry = if program.get("dry_run") == Some(&Value::Bool(true)) {
                    "dry run, "
                } else {
                    ""
                };
                format!("{dry}line {} of {}, {how_far}{more}", status["line"], program["lines"])
            }
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
    if let Some(degrees) = status["work_rotation_degrees"]
        .as_f64()
        .filter(|degrees| *degrees != 0.0)
    {
        lines.push(format!(
            "rotation  the work system in force is turned by {degrees} degrees"
        ));
    }
    if let Some(last) = status["last_program"]
        .as_object()
        .filter(|_| status["program"].is_null())
    {
        let (name, result) = (text(&last["name"]), text(&last["result"]));
        lines.push(match result.as_str() {
            "loaded" | "completed" => format!("last      {name}: {result}"),
            _ => format!("last      {name}: {result}, line {} was reached", last["line"]),
        });
    }
    if let Some(parts) = parts_words(&status["parts"]) {
        lines.push(format!("parts     {parts}"));
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
        for order in [Lasting::On, Lasting::Home, Lasting::Stop, Lasting::Program] {
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
            "elapsed_s": 12.0, "remaining_s": 30.2, "done_percent": 28.4,
        });
        let waiting = "machine   mill3 (mill3.toml)\nstate     disabled, standing by\n\
                       cycles    1000, 0 left out, 12.3 us late at most";
        assert_eq!(words(&status), waiting);
        status["program"] = json!({ "name": "/p.ngc", "lines": 90, "planned_time_s": 1.0, "result": null });
        assert!(words(&status).contains("\nprogram   /p.ngc: loaded\n"));
        status["power"] = json!("off");
        status["next"] = json!("isocnc on");
        assert!(words(&status).contains("\npower     off\nnext      isocnc on\n"));
        status["step"] = json!("program");
        status["alarm"] = json!("x-drive lost");
        let said = words(&status);
        assert!(
            said.contains("\nprogram   /p.ngc: line 7 of 90, 12 s, 30 s to go, 28 % done\nalarm     x-drive lost\n"),
            "{said}"
        );
        status["direction"] = json!("reverse");
        status["single_block"] = json!(true);
        let said = words(&status);
        assert!(
            said.contains("28 % done, backward\nsingle    each block ends at rest\n"),
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
        let status = |step: &str, state: &str, job: Option<&str>| json!({ "step": step, "state": state, "job": job, "alarm": null });
        let end = |order, step, state, job| {
            let end = end_of(order, &status(step, state, job))?;
            Some(end.map_err(|said| console::strip_ansi_codes(&said).into_owned()))
        };
        let by = "standing by";
        let done = |said: &str| Some(Ok(said.to_owned()));
        let failed = |said: &str| Some(Err(said.to_owned()));
        assert_eq!(end(Lasting::On, "switching drives on", "enabling", None), None);
        assert_eq!(end(Lasting::On, by, "ready", Some("completed")), done("drives are on"));
        assert_eq!(end(Lasting::Home, "homing", "ready", None), None);
        assert_eq!(
            end(Lasting::Home, by, "ready", Some("completed")),
            done("homed; drives are on")
        );
        assert_eq!(
            end(Lasting::Home, by, "disabled", Some("stopped")),
            failed("stopped before its end; drives are off")
        );
        assert_eq!(end(Lasting::Off, by, "ready", Some("completed")), None);
        assert_eq!(
            end(Lasting::Off, by, "disabled", Some("completed")),
            done("at rest, drives are off")
        );
        assert_eq!(
            end(Lasting::Stop, by, "ready", Some("stopped")),
            done("at rest, drives are on")
        );
        assert_eq!(
            end(Lasting::Stop, "done", "down", None),
            done("at rest, drives are off")
        );
        assert_eq!(end(Lasting::Program, "program", "running", None), None);
        assert_eq!(
            end(Lasting::Program, by, "ready", Some("completed")),
            done("completed; drives are on")
        );
        assert_eq!(
            end(Lasting::On, by, "disabled", Some("timed out")),
            failed("given up: the machine is disabled (standing by)")
        );
        let mut over = status(by, "faulted", Some("faulted"));
        over["alarm"] = json!("x-drive lost");
        let said = end_of(Lasting::Program, &over)
            .and_then(Result::err)
            .unwrap_or_default();
        assert_eq!(console::strip_ansi_codes(&said), "alarm: x-drive lost");
    }
}
