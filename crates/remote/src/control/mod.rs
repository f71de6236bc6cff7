//! `isocnc status`, `on`, `off`, `home`, `program`, `mdi`, `hold`, `resume`, `reverse`, `single-block`, `stop`, `override`,
//! `tool-changed`, `alarm acknowledge`, `fault`: clients of a running control.
//!
//! In:  the control socket of a machine, or of the only one that runs.
//! Out: a few lines or one JSON value. Exit code 1: the control refuses, or none runs.

mod status;
mod waiting;

use ::terminal::refusal::Refusal;
use anyhow::Context;
use api::client::{Client, ClientError};
use api::methods::sim_faults;
use api::rpc::code;
use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand, ValueEnum};
use files::read::PROGRAM_MAX;
use host::signals::StopSignal;
use host::terminal;
use operator::program_reports::StandByReport;
use serde_json::{Value, json};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

pub use status::{forced_words, parts_words};
pub use status::{power, status};
pub use waiting::Lasting;
use waiting::{LOOK, give, give_by, wait};

/// Which control, and how to print.
#[derive(Clone, Debug, Args)]
pub struct ControlArgs {
    /// Control of this machine; without it the only one that runs
    #[arg(long, global = true, value_name = "NAME")]
    pub(super) machine: Option<String>,
    /// Print JSON
    #[arg(long, global = true)]
    pub json: bool,
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
    /// Numbers of joints, or letters of axes; all joints without them
    #[arg(value_parser = joint_or_axis)]
    joints: Vec<JointOrAxis>,
}

/// What homes.
#[derive(Clone, Copy, Debug)]
enum JointOrAxis {
    Joint(u8),
    /// All joints of an axis.
    Axis(char),
}

/// # Errors
/// Neither a number nor a letter of an axis.
fn joint_or_axis(text: &str) -> Result<JointOrAxis, String> {
    let upper = text.to_ascii_uppercase();
    let mut letters = upper.chars();
    match (text.parse(), letters.next(), letters.next()) {
        (Ok(joint), ..) => Ok(JointOrAxis::Joint(joint)),
        (Err(_), Some(letter), None) if "XYZABCUVW".contains(letter) => Ok(JointOrAxis::Axis(letter)),
        _ => Err("expected the number of a joint, like 0, or the letter of an axis, like X".into()),
    }
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

/// Arguments of `fault`.
#[derive(Clone, Debug, Args)]
pub struct FaultArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// What goes wrong; none: all is mended
    #[arg(value_parser = PossibleValuesParser::new(sim_faults()))]
    kind: String,
    /// Id of the node
    #[arg(long, value_name = "N")]
    node: u8,
    /// Which of its axes, from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    axis: u8,
    /// For so many seconds; without it until `fault none`
    #[arg(long = "for", value_name = "S")]
    for_s: Option<f64>,
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

/// Looks whether a reset has had its effect.
const RESET_LOOKS: u32 = 10;
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

/// Lets something go wrong with a simulated drive, or mends it.
///
/// # Errors
/// No control answers, or it refuses, or the drive is no simulated one.
pub fn fault(args: &FaultArgs) -> anyhow::Result<ExitCode> {
    let FaultArgs {
        control,
        kind,
        node,
        axis,
        for_s,
    } = args;
    let mut params = json!({ "kind": kind, "node": node, "axis": axis });
    if let Some(for_s) = for_s {
        params["for_s"] = json!(for_s);
    }
    let answer = call(control, "sim.fault", params)?;
    let told = match (kind.as_str(), for_s) {
        ("none", _) => "simulated fault cleared; see: isocnc status".to_owned(),
        (kind, Some(for_s)) => format!("{kind} for {for_s} s; see: isocnc status"),
        (kind, None) => format!("{kind}; see: isocnc status"),
    };
    print(control, &answer, &told);
    Ok(ExitCode::SUCCESS)
}

/// Says that the tool is in the spindle that the program waits for.
///
/// # Errors
/// No control answers, or it refuses.
pub fn tool_changed(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    order(args, "tool.changed", "continues with this tool")
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
    let begin = |client: &mut Client| {
        let axes = match args.joints.iter().any(|wanted| matches!(wanted, JointOrAxis::Axis(_))) {
            true => client.call("machine.describe", json!({}))?["axes"].take(),
            false => Value::Null,
        };
        let params = match args.joints.is_empty() {
            true => json!({}),
            false => json!({ "joints": joints_of(&args.joints, &axes)? }),
        };
        Ok(client.call("home", params)?)
    };
    give_by(&args.order, Lasting::Home, begin, |_| "homes; drives stay on".into())
}

/// Numbers of the joints that are meant. `axes`: those of the machine.
///
/// # Errors
/// An axis that it does not have.
fn joints_of(wanted: &[JointOrAxis], axes: &Value) -> anyhow::Result<Vec<u64>> {
    let axes = axes.as_array().map(Vec::as_slice).unwrap_or_default();
    let mut joints = Vec::new();
    for wanted in wanted {
        match wanted {
            JointOrAxis::Joint(joint) => joints.push(u64::from(*joint)),
            JointOrAxis::Axis(letter) => {
                let letter = letter.to_string();
                let Some(axis) = axes.iter().find(|axis| axis["axis"] == letter.as_str()) else {
                    let known: Vec<&str> = axes.iter().filter_map(|axis| axis["axis"].as_str()).collect();
                    let text = format!("the machine has no axis {letter}; its axes are {}", known.join(", "));
                    return Err(Refusal::usage(text).into());
                };
                joints.extend(
                    axis["joints"]
                        .as_array()
                        .into_iter()
                        .flatten()
                        .filter_map(Value::as_u64),
                );
            }
        }
    }
    joints.sort_unstable();
    joints.dedup();
    Ok(joints)
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
        files::errln!("warning: {warning}");
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

pub fn call(args: &ControlArgs, method: &str, params: Value) -> anyhow::Result<Value> {
    Ok(connect(args)?.call(method, params)?)
}

/// Connects, and takes control away from whoever has taken it, if that is wanted; it is free then.
pub fn connect(args: &ControlArgs) -> anyhow::Result<Client> {
    let mut client = Client::connect(args.machine.as_deref())?;
    if args.take_over {
        client.call("control.take", json!({ "name": "isocnc", "force": true }))?;
        client.call("control.release", json!({}))?;
    }
    Ok(client)
}

pub fn print(args: &ControlArgs, value: &Value, words: &str) {
    terminal::say(&match args.json {
        true => format!("{value}\n"),
        false => format!("{words}\n"),
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_home_by_their_numbers_or_by_the_letters_of_their_axes() {
        let axes = json!([{ "axis": "X", "joints": [0, 3] }, { "axis": "Z", "joints": [2] }]);
        let meant = |words: &[&str]| {
            let wanted: Vec<_> = words
                .iter()
                .map(|word| joint_or_axis(word).expect("a joint or axis"))
                .collect();
            joints_of(&wanted, &axes)
        };
        assert_eq!(meant(&["x", "2"]).expect("joints"), [0, 2, 3]);
        assert_eq!(meant(&["1", "Z", "z"]).expect("joints"), [1, 2]);
        let refused = meant(&["Y"]).expect_err("no such axis");
        assert_eq!(refused.to_string(), "the machine has no axis Y; its axes are X, Z");
        assert_eq!(Refusal::code_of(&refused), 2);
        for word in ["XY", "Q", "-1", ""] {
            assert!(joint_or_axis(word).is_err(), "{word}");
        }
    }
}
