//! `isocnc touch-off`, `offset`, `tool`: what a running control remembers, looked at and changed.
//!
//! In:  the control socket. Out: a table or one line, or one JSON value.

use super::control::{ControlArgs, ask, parts_words, print, warn};
use clap::{Args, Subcommand};
use host::terminal::{self, table};
use protocol::{Entry, EntryKind, Offsets, Tool, ToolLife, Tools, method, params};
use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::{Duration, UNIX_EPOCH};

/// Arguments of `touch-off`.
#[derive(Clone, Debug, Args)]
pub struct TouchOffArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Axis letter
    axis: String,
    /// What the axis reads then where it stands, in the unit of the machine
    #[arg(allow_negative_numbers = true)]
    value: f64,
    /// Work system, G54 to G59.3; the one in force without it
    #[arg(long, conflicts_with = "tool")]
    system: Option<String>,
    /// The length of this tool is what changes, not the work system
    #[arg(long)]
    tool: Option<u32>,
}

/// Arguments of `offset`.
#[derive(Clone, Debug, Args)]
pub struct OffsetArgs {
    #[command(flatten)]
    control: ControlArgs,
    #[command(subcommand)]
    command: OffsetCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum OffsetCommand {
    /// Origins of all work systems
    #[command(after_help = "Example: isocnc offset list")]
    List,
    /// Put the origin of a work system on one axis to a value, in machine coordinates; or turn it
    #[command(after_help = "Example: isocnc offset set G55 X 1")]
    Set {
        /// G54 to G59.3
        system: String,
        /// Axis letter, or R: rotation about Z of its origin, degrees, counter-clockwise from above
        axis: String,
        /// Machine coordinate, in the unit of the machine
        #[arg(allow_negative_numbers = true)]
        value: f64,
    },
}

/// Arguments of `tool`.
#[derive(Clone, Debug, Args)]
pub struct ToolArgs {
    #[command(flatten)]
    control: ControlArgs,
    #[command(subcommand)]
    command: ToolCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum ToolCommand {
    /// The tool table
    #[command(after_help = "Example: isocnc tool list")]
    List,
    /// Set length, diameter, wear or life of a tool; a length whose G43 is in force counts at once
    #[command(after_help = "Example: isocnc tool set 5 --length 12.3 --life-minutes 45 --sister 15")]
    Set {
        /// Number
        tool: u32,
        /// In the unit of the machine
        #[arg(long, allow_negative_numbers = true)]
        length: Option<f64>,
        /// In the unit of the machine
        #[arg(long, allow_negative_numbers = true)]
        diameter: Option<f64>,
        /// To be added to the length since it was measured
        #[arg(long, allow_negative_numbers = true)]
        length_wear: Option<f64>,
        /// To be added to the diameter since it was measured
        #[arg(long, allow_negative_numbers = true)]
        diameter_wear: Option<f64>,
        /// Minutes that it may be used; 0: as long as one likes
        #[arg(long)]
        life_minutes: Option<f64>,
        /// Parts that it may be used for; 0: as many as one likes
        #[arg(long)]
        life_parts: Option<u32>,
        /// Minutes that it has been used; 0 for a new one
        #[arg(long)]
        used_minutes: Option<f64>,
        /// Parts that it has been used for; 0 for a new one
        #[arg(long)]
        used_parts: Option<u32>,
        /// The tool that is called in its place when its life is over; 0: none
        #[arg(long)]
        sister: Option<u32>,
    },
}

/// Arguments of `parts`.
#[derive(Clone, Debug, Args)]
pub struct PartsArgs {
    #[command(flatten)]
    control: ControlArgs,
    #[command(subcommand)]
    command: Option<PartsCommand>,
}

#[derive(Clone, Debug, Subcommand)]
enum PartsCommand {
    /// Count from 0, or from another number on
    #[command(after_help = "Example: isocnc parts reset")]
    Reset {
        /// Parts that are there already
        #[arg(default_value_t = 0)]
        count: u32,
    },
    /// How many are wanted
    #[command(after_help = "Example: isocnc parts target 50")]
    Target {
        /// Parts; 0: nobody says
        parts: u32,
    },
}

/// Shows or sets the counter of parts.
///
/// # Errors
/// No control answers.
pub fn parts(args: &PartsArgs) -> anyhow::Result<ExitCode> {
    let wanted = args.command.as_ref().map(|command| match command {
        PartsCommand::Reset { count } => (Some(*count), None),
        PartsCommand::Target { parts } => (None, Some(*parts)),
    });
    if let Some((count, target)) = wanted {
        let kept = ask::<method::PartsSet>(&args.control, &params::PartsSet { count, target })?;
        warn(&args.control, kept.warning.as_deref());
    }
    let parts = ask::<method::Status>(&args.control, &params::NoParams {})?.parts;
    let words = parts_words(&parts).unwrap_or_else(|| "0".into());
    print(&args.control, &parts, &format!("parts {words}"));
    Ok(ExitCode::SUCCESS)
}

/// Arguments of `journal`.
#[derive(Clone, Debug, Args)]
pub struct JournalArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Only entries behind this number
    #[arg(long, default_value_t = 0)]
    since: u64,
}

/// Prints the journal of a running control.
///
/// # Errors
/// No control answers.
pub fn journal(args: &JournalArgs) -> anyhow::Result<ExitCode> {
    let mut since = args.since;
    loop {
        let journal = ask::<method::JournalSince>(&args.control, &params::JournalSince { seq: Some(since) })?;
        for entry in &journal.entries {
            since = entry.seq;
            print(&args.control, entry, &journal_line(entry));
        }
        if !journal.more || journal.entries.is_empty() {
            return Ok(ExitCode::SUCCESS);
        }
    }
}

/// Number, time of day in UTC, text.
fn journal_line(entry: &Entry) -> String {
    let time = UNIX_EPOCH + Duration::from_secs(entry.unix_s as u64);
    let line = format!(
        "{:>6}  {}  {}{}",
        entry.seq,
        humantime::format_rfc3339_seconds(time),
        entry.text,
        record_words(entry)
    );
    match entry.kind {
        EntryKind::Alarm => terminal::alarm(line).to_string(),
        EntryKind::Warning | EntryKind::Note => line,
    }
}

/// What an alarm or a program is about beside its text, in brackets.
fn record_words(entry: &Entry) -> String {
    let mut words = Vec::new();
    if let Some(alarm) = &entry.alarm {
        words.push(format!("{} {}", alarm.code, alarm.severity));
        if alarm.first_cause != entry.seq {
            words.push(format!("follows from {}", alarm.first_cause));
        }
        if let (Some(program), Some(line)) = (&alarm.program, alarm.line) {
            words.push(format!("{program}:{line}"));
        }
        words.push(format!("was {}", alarm.state));
        if let Some(how) = &alarm.acknowledged {
            words.push(format!("acknowledged by {}", how.by));
        }
    }
    if let Some(program) = entry.program.as_ref().filter(|program| program.result.is_some()) {
        words.push(match program.line {
            Some(line) => format!("line {line}"),
            None => "line null".into(),
        });
        if let Some(deviation_mm) = program.deviation_max_mm {
            words.push(format!("{deviation_mm:.4} mm off its path at most"));
        }
        if let Some(report) = program.report {
            words.push(format!("report {report}"));
        }
    }
    match words.is_empty() {
        true => String::new(),
        false => format!("  [{}]", words.join(", ")),
    }
}

/// Touches off.
///
/// # Errors
/// No control answers, or it refuses.
pub fn touch_off(args: &TouchOffArgs) -> anyhow::Result<ExitCode> {
    let axis = args.axis.to_uppercase();
    let value = args.value;
    let what = match (&args.tool, &args.system) {
        (Some(tool), _) => format!("tool {tool}, once its length is in force (G43)"),
        (None, Some(system)) => system.to_uppercase(),
        (None, None) => "the work system in force".to_owned(),
    };
    let wanted = params::TouchOff {
        axis: axis.clone(),
        value,
        system: args.system.clone(),
        tool: args.tool,
    };
    let kept = ask::<method::TouchOff>(&args.control, &wanted)?;
    warn(&args.control, kept.warning.as_deref());
    print(&args.control, &kept, &format!("{axis} reads {value} in {what}"));
    Ok(ExitCode::SUCCESS)
}

/// Lists or sets work offsets.
///
/// # Errors
/// No control answers, or it refuses.
pub fn offset(args: &OffsetArgs) -> anyhow::Result<ExitCode> {
    match &args.command {
        OffsetCommand::List => {
            let offsets = ask::<method::OffsetList>(&args.control, &params::NoParams {})?;
            print(&args.control, &offsets, &offset_table(&offsets));
        }
        OffsetCommand::Set { system, axis, value } => {
            let (system, axis) = (system.to_uppercase(), axis.to_uppercase());
            let mut wanted = params::OffsetSet {
                system: Some(system.clone()),
                ..Default::default()
            };
            let words = if axis == "R" {
                wanted.rotation_degrees = Some(*value);
                format!("{system} is turned by {value} degrees about Z of its origin")
            } else {
                (wanted.axis, wanted.value) = (Some(axis.clone()), Some(*value));
                format!("the origin of {system} is at {axis} {value} in the machine")
            };
            let kept = ask::<method::OffsetSet>(&args.control, &wanted)?;
            warn(&args.control, kept.warning.as_deref());
            print(&args.control, &kept, &words);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Lists or sets tools.
///
/// # Errors
/// No control answers, or it refuses.
pub fn tool(args: &ToolArgs) -> anyhow::Result<ExitCode> {
    match &args.command {
        ToolCommand::List => {
            let tools = ask::<method::ToolList>(&args.control, &params::NoParams {})?;
            print(&args.control, &tools, &tool_table(&tools));
        }
        ToolCommand::Set {
            tool,
            length,
            diameter,
            length_wear,
            diameter_wear,
            life_minutes,
            life_parts,
            used_minutes,
            used_parts,
            sister,
        } => {
            let number = |count: &Option<u32>| count.map(f64::from);
            let given = [
                ("length", *length),
                ("diameter", *diameter),
                ("length wear", *length_wear),
                ("diameter wear", *diameter_wear),
                ("life in minutes", *life_minutes),
                ("life in parts", number(life_parts)),
                ("minutes used", *used_minutes),
                ("parts made", number(used_parts)),
                ("sister", number(sister)),
            ];
            let mut words = vec![format!("tool {tool}")];
            let given = given
                .into_iter()
                .filter_map(|(name, value)| Some(format!("{name} {}", value?)));
            words.extend(given);
            let wanted = params::ToolSet {
                tool: *tool,
                length: *length,
                diameter: *diameter,
                length_wear: *length_wear,
                diameter_wear: *diameter_wear,
                life_minutes: *life_minutes,
                life_parts: *life_parts,
                used_minutes: *used_minutes,
                used_parts: *used_parts,
                sister: *sister,
                ..Default::default()
            };
            let kept = ask::<method::ToolSet>(&args.control, &wanted)?;
            warn(&args.control, kept.warning.as_deref());
            print(&args.control, &kept, &words.join(", "));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn number(value: f64) -> String {
    format!("{value:.4}")
}

fn offset_table(offsets: &Offsets) -> String {
    let axes: Vec<&String> = offsets
        .systems
        .first()
        .map(|system| system.origin.keys().collect())
        .unwrap_or_default();
    let letters: Vec<String> = axes.iter().map(|axis| format!(">{axis}")).collect();
    let mut head = vec!["system"];
    head.extend(letters.iter().map(String::as_str));
    head.push(">R degrees");
    let row = |name: &str, is_active: bool, origin: &BTreeMap<String, f64>, degrees: Option<f64>| {
        let mark = if is_active { " *" } else { "" };
        let mut row = vec![format!("{name}{mark}")];
        row.extend(
            axes.iter()
                .map(|axis| origin.get(*axis).copied().map(number).unwrap_or_default()),
        );
        row.push(degrees.map(number).unwrap_or_default());
        row
    };
    let systems = offsets.systems.iter();
    let mut rows: Vec<Vec<String>> = systems
        .map(|of| row(&of.system, of.active, &of.origin, Some(of.rotation_degrees)))
        .collect();
    rows.push(row("G92", offsets.g92_active, &offsets.g92, None));
    format!(
        "{}* in force; {}, machine coordinates",
        table(&head, rows),
        offsets.unit
    )
}

fn tool_table(tools: &Tools) -> String {
    let has = |what: fn(&Tool) -> bool| tools.tools.iter().any(what);
    let wears = has(|tool| tool.length_wear != 0.0 || tool.diameter_wear != 0.0);
    let lives = has(|tool| tool.life != ToolLife::default());
    let mut head = vec!["tool", ">pocket", ">length", ">diameter"];
    head.extend(wears.then_some([">wear", ">of diameter"]).into_iter().flatten());
    head.extend(lives.then_some([">min", ">parts", ">sister"]).into_iter().flatten());
    head.push("remark");
    let share = |used: String, of: Option<String>| match of {
        Some(of) => format!("{used} of {of}"),
        None => used,
    };
    let rows = tools.tools.iter().map(|tool| {
        let mark = if tool.tool == tools.in_spindle { " *" } else { "" };
        let life = &tool.life;
        let mut row = vec![
            format!("{}{mark}", tool.tool),
            tool.pocket.to_string(),
            number(tool.length),
            number(tool.diameter),
        ];
        if wears {
            row.extend([number(tool.length_wear), number(tool.diameter_wear)]);
        }
        if lives {
            row.extend([
                share(
                    format!("{:.1}", life.used_minutes),
                    life.minutes.map(|of| of.to_string()),
                ),
                share(life.used_parts.to_string(), life.parts.map(|of| of.to_string())),
                life.sister.map_or_else(|| "-".to_owned(), |sister| sister.to_string()),
            ]);
        }
        row.push(tool.remark.clone());
        row
    });
    format!("{}* in the spindle; {}", table(&head, rows), tools.unit)
}
