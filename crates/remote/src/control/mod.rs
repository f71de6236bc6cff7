//! `isocnc status`, `on`, `off`, `home`, `program`, `mdi`, `hold`, `resume`, `reverse`, `single-block`, `stop`, `override`,
//! `tool-changed`, `alarm acknowledge`, `fault`: clients of a running control.
//!
//! In:  the control socket of a machine, or of the only one that runs.
//! Out: a few lines or one JSON value. Exit code 1: the control refuses, or none runs.

mod status;
mod waiting;

use ::terminal::refusal::Refusal;
use anyhow::{Context, bail};
use api::client::{self, Client, ClientError};
use api::rpc::code;
use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand, ValueEnum};
use files::read::PROGRAM_MAX;
use host::signals::StopSignal;
use host::terminal;
use operator::program_reports::StandByReport;
use protocol::limits::SIM_FAULTS;
use protocol::params::{self, NoParams};
use protocol::{DescribedAxis, Message, Method, Nothing, Outlook, Overrides, State, method};
use serde::Serialize;
use serde_json::json;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

pub use status::{forced_words, parts_words};
pub use status::{power, status};
pub use waiting::Lasting;
use waiting::{LOOK, Words, give, give_by, wait};

/// Which control, and how to print.
#[derive(Clone, Debug, Args)]
pub struct ControlArgs {
    /// Control of this machine; without it that of ISOCNC_MACHINE, or the only one that runs
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
    #[arg(value_parser = PossibleValuesParser::new(SIM_FAULTS))]
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

/// Arguments of `spindle`.
#[derive(Clone, Debug, Args)]
pub struct SpindleArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Speed, rpm, counter-clockwise below 0; or off
    #[arg(allow_negative_numbers = true, value_parser = spindle_speed)]
    speed: f64,
}

/// # Errors
/// Neither a number nor `off`.
fn spindle_speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rpm) if rpm.is_finite() => Ok(rpm),
        _ if text.eq_ignore_ascii_case("off") => Ok(0.0),
        _ => Err("expected a speed in rpm, like 1200 or -1200, or off".into()),
    }
}

/// Arguments of `coolant`.
#[derive(Clone, Debug, Args)]
pub struct CoolantArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Which of them
    which: Coolant,
    /// What it is to be
    switch: Switch,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Coolant {
    Flood,
    Mist,
    Both,
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

/// Gives an order that is carried out at once; `done` says what comes of it.
fn order<M: Method<Answer = Nothing>>(args: &ControlArgs, params: &M::Params, done: &str) -> anyhow::Result<ExitCode> {
    let answer = ask::<M>(args, params)?;
    print(args, &answer, done);
    Ok(ExitCode::SUCCESS)
}

/// Goes on after a hold; away from the path, returns to it first.
fn resume(args: &OrderArgs) -> anyhow::Result<ExitCode> {
    let signal = StopSignal::install().context("signals")?;
    let mut client = connect(&args.control)?;
    let answer = client.ask::<method::Resume>(&NoParams {})?;
    let Some(legs) = &answer.returns else {
        print(&args.control, &answer, "goes on");
        return Ok(ExitCode::SUCCESS);
    };
    let way = format!(
        "returns to the path: {}",
        legs.iter().map(Message::to_string).collect::<Vec<_>>().join(", then ")
    );
    if args.no_wait {
        print(&args.control, &answer, &format!("{way}\nthere it waits; {GOES_ON}"));
        return Ok(ExitCode::SUCCESS);
    }
    if !args.control.json {
        terminal::say(&format!("{way}\n"));
    }
    // It sets out once the hand rests.
    let give_up = Instant::now() + SETS_OUT;
    while client.ask::<method::Status>(&NoParams {})?.state == State::Away && Instant::now() < give_up {
        std::thread::sleep(LOOK);
    }
    wait(&mut client, &args.control, Lasting::Return, &signal)
}

/// Gives up what the program waits for.
///
/// # Errors
/// No control answers, or it refuses.
pub fn skip(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let answer = ask::<method::Skip>(args, &NoParams {})?;
    print(args, &answer, &format!("left out: {}", answer.skips));
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
    let wanted = params::SimFault {
        node: *node,
        kind: kind.clone(),
        axis: Some(*axis),
        for_s: *for_s,
    };
    let told = match (kind.as_str(), for_s) {
        ("none", _) => "simulated fault cleared; see: isocnc status".to_owned(),
        (kind, Some(for_s)) => format!("{kind} for {for_s} s; see: isocnc status"),
        (kind, None) => format!("{kind}; see: isocnc status"),
    };
    order::<method::SimFault>(control, &wanted, &told)
}

/// Says that the tool is in the spindle that the program waits for.
///
/// # Errors
/// No control answers, or it refuses.
pub fn tool_changed(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    order::<method::ToolChanged>(args, &NoParams {}, "continues with this tool")
}

/// Switches drives on or off, or stops, and waits until that is done. Ctrl-C ends the waiting, and nothing else.
///
/// # Errors
/// No control answers, or it refuses.
pub fn lasting(args: &OrderArgs, order: Lasting) -> anyhow::Result<ExitCode> {
    let plain = |begun: &'static str| move |_: &Nothing| Words::new(begun);
    match order {
        Lasting::On => give::<method::On>(args, order, &NoParams {}, plain("drives go on, and nothing moves")),
        Lasting::Off => give::<method::Off>(args, order, &NoParams {}, plain("comes to rest, then drives go off")),
        Lasting::Stop => {
            let begun = plain("comes to rest on the path; drives stay on");
            give::<method::Stop>(args, order, &NoParams {}, begun)
        }
        Lasting::Home => {
            let begun = plain("homes; drives stay on");
            give::<method::Home>(args, order, &params::Home::default(), begun)
        }
        Lasting::Hold => {
            let begun = plain("comes to rest on the path; go on with: isocnc resume");
            give::<method::Hold>(args, order, &NoParams {}, begun)
        }
        Lasting::Program => {
            let begin = params::ProgramStart::default();
            give::<method::ProgramStart>(args, order, &begin, |begun| Words {
                text: "begun; see: isocnc status".into(),
                warning: begun.warning.clone(),
            })
        }
        Lasting::Mdi => bail!("a line of MDI is missing"),
        Lasting::Return => resume(args),
    }
}

/// Homes joints.
///
/// # Errors
/// No control answers, or it refuses.
pub fn home(args: &HomeArgs) -> anyhow::Result<ExitCode> {
    let begin = |client: &mut Client| {
        let axes = match args.joints.iter().any(|wanted| matches!(wanted, JointOrAxis::Axis(_))) {
            true => client.ask::<method::Describe>(&NoParams {})?.axes,
            false => Vec::new(),
        };
        let joints = match args.joints.is_empty() {
            true => None,
            false => Some(joints_of(&args.joints, &axes)?),
        };
        Ok(client.ask::<method::Home>(&params::Home { joints })?)
    };
    give_by(&args.order, Lasting::Home, begin, |_| {
        Words::new("homes; drives stay on")
    })
}

/// Numbers of the joints that are meant. `axes`: those of the machine.
///
/// # Errors
/// An axis that it does not have.
fn joints_of(wanted: &[JointOrAxis], axes: &[DescribedAxis]) -> anyhow::Result<Vec<u64>> {
    let mut joints = Vec::new();
    for wanted in wanted {
        match wanted {
            JointOrAxis::Joint(joint) => joints.push(u64::from(*joint)),
            JointOrAxis::Axis(letter) => {
                let letter = letter.to_string();
                let Some(axis) = axes.iter().find(|axis| axis.axis == letter) else {
                    let known: Vec<&str> = axes.iter().map(|axis| axis.axis.as_str()).collect();
                    let text = format!("the machine has no axis {letter}; its axes are {}", known.join(", "));
                    return Err(Refusal::usage(text).into());
                };
                joints.extend(axis.joints.iter().map(|joint| *joint as u64));
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
        let history = ask::<method::MdiHistory>(&args.order.control, &NoParams {})?;
        print(&args.order.control, &history, &history.lines.join("\n"));
        return Ok(ExitCode::SUCCESS);
    }
    let line = args.line.clone().unwrap_or_default();
    give::<method::Mdi>(&args.order, Lasting::Mdi, &params::Mdi { line }, |begun| Words {
        text: "begun".into(),
        warning: begun.warning.clone(),
    })
}

/// Loads, starts or runs a program, and waits for its end.
///
/// # Errors
/// There is no such file; no control answers, or it refuses.
pub fn program(args: &ProgramArgs) -> anyhow::Result<ExitCode> {
    let control = &args.control;
    let (file, start, no_wait) = match &args.command {
        ProgramCommand::Load { file } => {
            let loaded = ask_with::<method::ProgramLoad>(&mut connect(control)?, file)?;
            warn(control, loaded.warning.as_deref());
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
            let begin = params::ProgramStart {
                from_line: *from_line,
                yes: from_line.map(|_| *yes),
                repeat: from_line.is_none().then_some(*repeat),
                dry_run_feed_mm_min: *dry_run,
                revision: None,
            };
            (None, begin, *no_wait)
        }
        ProgramCommand::Report { number } => {
            let answer = ask::<method::ProgramReport>(control, &params::ProgramReport { number: *number })?;
            let report: StandByReport =
                serde_json::from_value(json!(answer)).context("the control sends another report")?;
            print(control, &answer, report.to_string().trim_end());
            return Ok(ExitCode::SUCCESS);
        }
        ProgramCommand::Run { file, no_wait } => (Some(file), params::ProgramStart::default(), *no_wait),
    };
    let args = OrderArgs {
        control: control.clone(),
        no_wait,
    };
    let begin = |client: &mut Client| match file {
        Some(file) => ask_with::<method::ProgramRun>(client, file),
        None => Ok(client.ask::<method::ProgramStart>(&start)?),
    };
    give_by(&args, Lasting::Program, begin, |begun: &Outlook| Words {
        text: format!("{}; see: isocnc status", outlook("begun", begun)),
        warning: begun.warning.clone(),
    })
}

/// Asks for something with a program: by its path, and where the control cannot read it, by sending it.
fn ask_with<M: Method<Params = params::Program>>(client: &mut Client, file: &Path) -> anyhow::Result<M::Answer> {
    let uploaded = |upload| params::Program {
        upload: Some(upload),
        ..Default::default()
    };
    if file == Path::new("-") {
        let mut text = Vec::new();
        std::io::stdin().lock().take(PROGRAM_MAX + 1).read_to_end(&mut text)?;
        let upload = client.upload("standard input", text.as_slice(), text.len() as u64)?;
        return Ok(client.ask::<M>(&uploaded(upload))?);
    }
    let path = std::fs::canonicalize(file).with_context(|| file.display().to_string())?;
    let path = path.to_str().context("the path is no UTF-8")?;
    let by_path = params::Program {
        path: Some(path.to_owned()),
        ..Default::default()
    };
    match client.ask::<M>(&by_path) {
        Err(ClientError::Refused(error)) if error.code == code::UNREADABLE => {
            let program = files::open(file).with_context(|| path.to_owned())?;
            let octets = program.metadata()?.len();
            let upload = client.upload(path, program, octets)?;
            Ok(client.ask::<M>(&uploaded(upload))?)
        }
        answer => Ok(answer?),
    }
}

/// What a program comes to, in words.
fn outlook(done: &str, of: &Outlook) -> String {
    format!(
        "{done}: {}, {} lines, {:.1} s planned",
        of.program, of.lines, of.planned_time_s
    )
}

pub(super) fn warn(control: &ControlArgs, warning: Option<&str>) {
    if let Some(warning) = warning.filter(|_| !control.json) {
        files::errln!("warning: {warning}");
    }
}

/// Runs a program back along its path.
///
/// # Errors
/// No control answers, or it refuses.
pub fn reverse(args: &ReverseArgs) -> anyhow::Result<ExitCode> {
    let done = "goes back along the path; rest with: isocnc hold; forward with: isocnc resume";
    let percent = Some(args.percent);
    order::<method::Reverse>(&args.control, &params::Reverse { percent }, done)
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
    switch::<method::OptionalStop>(args, done)
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
    switch::<method::BlockDelete>(args, done)
}

fn switch<M>(args: &SwitchArgs, done: &str) -> anyhow::Result<ExitCode>
where
    M: Method<Params = params::Switch, Answer = Nothing>,
{
    let on = args.switch == Switch::On;
    order::<M>(&args.control, &params::Switch { on }, done)
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
    switch::<method::SingleBlock>(args, done)
}

/// Turns the spindle by hand.
///
/// # Errors
/// No control answers, or it refuses.
pub fn spindle(args: &SpindleArgs) -> anyhow::Result<ExitCode> {
    let done = match args.speed {
        0.0 => "spindle off".to_owned(),
        rpm => format!("spindle at {rpm} rpm"),
    };
    let wanted = params::Spindle { speed_rpm: args.speed };
    order::<method::Spindle>(&args.control, &wanted, &done)
}

/// Switches coolant by hand.
///
/// # Errors
/// No control answers, or it refuses.
pub fn coolant(args: &CoolantArgs) -> anyhow::Result<ExitCode> {
    let on = args.switch == Switch::On;
    let of = |which| (args.which == which || args.which == Coolant::Both).then_some(on);
    let wanted = params::Coolant {
        flood: of(Coolant::Flood),
        mist: of(Coolant::Mist),
    };
    let name = match args.which {
        Coolant::Flood => "flood",
        Coolant::Mist => "mist",
        Coolant::Both => "flood and mist",
    };
    let done = format!("{name} {}", if on { "on" } else { "off" });
    order::<method::Coolant>(&args.control, &wanted, &done)
}

/// Turns an override.
///
/// # Errors
/// No control answers, or it refuses.
pub fn set_overrides(args: &OverrideArgs) -> anyhow::Result<ExitCode> {
    let mut wanted = params::Override::default();
    *match args.what {
        Overridden::Feed => &mut wanted.feed,
        Overridden::Rapid => &mut wanted.rapid,
        Overridden::Spindle => &mut wanted.spindle,
    } = Some(args.percent);
    let answer = ask::<method::Override>(&args.control, &wanted)?;
    let mut words = overrides(&answer);
    let acts = match args.what {
        Overridden::Feed | Overridden::Rapid => answer.feed_acts,
        Overridden::Spindle => answer.spindle_acts,
    };
    if !acts {
        words += "\nthe program has switched this override off at the moment (M49 to M51)";
    }
    print(&args.control, &answer, &words);
    Ok(ExitCode::SUCCESS)
}

/// Where the overrides stand, in words.
fn overrides(of: &Overrides) -> String {
    format!(
        "feed {:?} %, rapid {:?} %, spindle {:?} %",
        of.feed_percent, of.rapid_percent, of.spindle_percent
    )
}

/// Stops at once, or resets that.
///
/// # Errors
/// No control answers, or it refuses.
pub fn estop(args: &EstopArgs) -> anyhow::Result<ExitCode> {
    match args.command {
        None => order::<method::Estop>(
            &args.control,
            &NoParams {},
            "emergency stop; over with: isocnc estop reset",
        ),
        Some(EstopCommand::Reset) => reset_estop(&args.control),
    }
}

/// Tells what came of a reset: a chain that stays open lets the stop stand.
fn reset_estop(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let mut client = connect(args)?;
    client.ask::<method::EstopReset>(&NoParams {})?;
    for _ in 0..RESET_LOOKS {
        let status = client.ask::<method::Status>(&NoParams {})?;
        if status.state != State::Estop {
            print(args, &status, "reset; drives stay off: isocnc on");
            return Ok(ExitCode::SUCCESS);
        }
        std::thread::sleep(LOOK);
    }
    let status = client.ask::<method::Status>(&NoParams {})?;
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
    order::<method::Acknowledge>(&args.control, &NoParams {}, "acknowledged; drives stay off")
}

/// Asks the control that is meant.
///
/// # Errors
/// No control answers, or it refuses.
pub fn ask<M: Method>(args: &ControlArgs, params: &M::Params) -> anyhow::Result<M::Answer> {
    Ok(connect(args)?.ask::<M>(params)?)
}

/// Connects, and takes control away from whoever has taken it, if that is wanted; it is free then.
pub fn connect(args: &ControlArgs) -> anyhow::Result<Client> {
    let mut client = client::connect(args.machine.as_deref())?;
    if args.take_over {
        let by_force = params::TakeControl {
            name: Some("isocnc".into()),
            force: Some(true),
        };
        client.ask::<method::TakeControl>(&by_force)?;
        client.ask::<method::ReleaseControl>(&NoParams {})?;
    }
    Ok(client)
}

/// Prints an answer, as JSON or in words.
pub fn print(args: &ControlArgs, answer: &impl Serialize, words: &str) {
    terminal::say(&match args.json {
        true => format!("{}\n", json!(answer)),
        false => format!("{words}\n"),
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_home_by_their_numbers_or_by_the_letters_of_their_axes() {
        let axis = |axis: &str, joints: &[usize]| DescribedAxis {
            axis: axis.into(),
            joints: joints.to_vec(),
            ..DescribedAxis::default()
        };
        let axes = [axis("X", &[0, 3]), axis("Z", &[2])];
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
