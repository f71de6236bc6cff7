//! `isocnc touch-off`, `offset`, `tool`: what a running control remembers, looked at and changed.
//!
//! In:  the control socket. Out: a table or one line, or one JSON value.

use super::control::{ControlArgs, call, parts_words, print, warn};
use clap::{Args, Subcommand};
use host::terminal::{self, table};
use serde_json::{Value, json};
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
    /// Set length, diameter or both of a tool; a length whose G43 is in force counts at once
    #[command(after_help = "Example: isocnc tool set 5 --length 12.3 --diameter 6")]
    Set {
        /// Number
        tool: u32,
        /// In the unit of the machine
        #[arg(long, allow_negative_numbers = true)]
        length: Option<f64>,
        /// In the unit of the machine
        #[arg(long, allow_negative_numbers = true)]
        diameter: Option<f64>,
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
    let params = match &args.command {
        None => None,
        Some(PartsCommand::Reset { count }) => Some(json!({ "count": count })),
        Some(PartsCommand::Target { parts }) => Some(json!({ "target": parts })),
    };
    if let Some(params) = params {
        let answer = call(&args.control, "parts.set", params)?;
        warn(&args.control, &answer);
    }
    let parts = &call(&args.control, "status", json!({}))?["parts"];
    let words = parts_words(parts).unwrap_or_else(|| "0".into());
    print(&args.control, parts, &format!("parts {words}"));
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
        let answer = call(&args.control, "journal.since", json!({ "seq": since }))?;
        let nothing = Vec::new();
        let entries = answer["entries"].as_array().unwrap_or(&nothing);
        for entry in entries {
            since = entry["seq"].as_u64().unwrap_or(since);
            print(&args.control, entry, &journal_line(entry));
        }
        if answer["more"] != true || entries.is_empty() {
            return Ok(ExitCode::SUCCESS);
        }
    }
}

/// Number, time of day in UTC, text.
fn journal_line(entry: &Value) -> String {
    let seconds = entry["unix_s"].as_f64().unwrap_or(0.0) as u64;
    let time = UNIX_EPOCH + Duration::from_secs(seconds);
    let text = entry["text"].as_str().unwrap_or_default();
    let line = format!(
        "{:>6}  {}  {text}{}",
        entry["seq"],
        humantime::format_rfc3339_seconds(time),
        record_words(entry)
    );
    match entry["kind"].as_str() {
        Some("alarm") => terminal::alarm(line).to_string(),
        _ => line,
    }
}

/// What an alarm or a program is about beside its text, in brackets.
fn record_words(entry: &Value) -> String {
    let mut words = Vec::new();
    if let Some(alarm) = entry["alarm"].as_object() {
        let text = |name: &str| alarm[name].as_str().unwrap_or_default().to_owned();
        words.push(format!("{} {}", text("code"), text("severity")));
        if alarm["first_cause"] != entry["seq"] {
            words.push(format!("follows from {}", alarm["first_cause"]));
        }
        if let (Some(program), Some(line)) = (alarm["program"].as_str(), alarm["line"].as_u64()) {
            words.push(format!("{program}:{line}"));
        }
        words.push(format!("was {}", text("state")));
        if let Some(how) = alarm["acknowledged"].as_object() {
            words.push(format!("acknowledged by {}", how["by"].as_str().unwrap_or_default()));
        }
    }
    if let Some(program) = entry["program"]
        .as_object()
        .filter(|program| program["result"].is_string())
    {
        words.push(format!("line {}", program["line"]));
        if let Some(deviation_mm) = program["deviation_max_mm"].as_f64() {
            words.push(format!("{deviation_mm:.4} mm off its path at most"));
        }
        if let Some(report) = program["report"].as_u64() {
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
    let mut params = json!({ "axis": axis, "value": args.value });
    let (what, value) = match (&args.tool, &args.system) {
        (Some(tool), _) => {
            params["tool"] = json!(tool);
            (format!("tool {tool}, once its length is in force (G43)"), args.value)
        }
        (None, Some(system)) => {
            params["system"] = json!(system);
            (system.to_uppercase(), args.value)
        }
        (None, None) => ("the work system in force".to_owned(), args.value),
    };
    let answer = call(&args.control, "touch_off", params)?;
    warn(&args.control, &answer);
    print(&args.control, &answer, &format!("{axis} reads {value} in {what}"));
    Ok(ExitCode::SUCCESS)
}

/// Lists or sets work offsets.
///
/// # Errors
/// No control answers, or it refuses.
pub fn offset(args: &OffsetArgs) -> anyhow::Result<ExitCode> {
    match &args.command {
        OffsetCommand::List => {
            let offsets = call(&args.control, "offset.list", json!({}))?;
            print(&args.control, &offsets, &offset_table(&offsets));
        }
        OffsetCommand::Set { system, axis, value } => {
            let (system, axis) = (system.to_uppercase(), axis.to_uppercase());
            let (params, words) = match axis.as_str() {
                "R" => (
                    json!({ "system": system, "rotation_degrees": value }),
                    format!("{system} is turned by {value} degrees about Z of its origin"),
                ),
                _ => (
                    json!({ "system": system, "axis": axis, "value": value }),
                    format!("the origin of {system} is at {axis} {value} in the machine"),
                ),
            };
            let answer = call(&args.control, "offset.set", params)?;
            warn(&args.control, &answer);
            print(&args.control, &answer, &words);
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
            let tools = call(&args.control, "tool.list", json!({}))?;
            print(&args.control, &tools, &tool_table(&tools));
        }
        ToolCommand::Set { tool, length, diameter } => {
            let mut params = json!({ "tool": tool });
            let mut words = vec![format!("tool {tool}")];
            for (name, value) in [("length", length), ("diameter", diameter)] {
                if let Some(value) = value {
                    params[name] = json!(value);
                    words.push(format!("{name} {value}"));
                }
            }
            let answer = call(&args.control, "tool.set", params)?;
            warn(&args.control, &answer);
            print(&args.control, &answer, &words.join(", "));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn number(value: &Value) -> String {
    value.as_f64().map_or_else(String::new, |value| format!("{value:.4}"))
}

fn offset_table(offsets: &Value) -> String {
    let nothing = Vec::new();
    let systems = offsets["systems"].as_array().unwrap_or(&nothing);
    let axes: Vec<&String> = systems
        .first()
        .and_then(|system| system["origin"].as_object())
        .map(|origin| origin.keys().collect())
        .unwrap_or_default();
    let letters: Vec<String> = axes.iter().map(|axis| format!(">{axis}")).collect();
    let mut head = vec!["system"];
    head.extend(letters.iter().map(String::as_str));
    head.push(">R degrees");
    let row = |name: String, origin: &Value, degrees: &Value| {
        let mut row = vec![name];
        row.extend(axes.iter().map(|axis| number(&origin[axis.as_str()])));
        row.push(number(degrees));
        row
    };
    let mut rows: Vec<Vec<String>> = systems
        .iter()
        .map(|system| {
            let mark = if system["active"] == true { " *" } else { "" };
            let name = format!("{}{mark}", system["system"].as_str().unwrap_or_default());
            row(name, &system["origin"], &system["rotation_degrees"])
        })
        .collect();
    let mark = if offsets["g92_active"] == true { " *" } else { "" };
    rows.push(row(format!("G92{mark}"), &offsets["g92"], &Value::Null));
    let unit = offsets["unit"].as_str().unwrap_or_default();
    format!("{}* in force; {unit}, machine coordinates", table(&head, rows))
}

fn tool_table(tools: &Value) -> String {
    let nothing = Vec::new();
    let head = ["tool", ">pocket", ">length", ">diameter", "remark"];
    let in_spindle = &tools["in_spindle"];
    let rows: Vec<Vec<String>> = tools["tools"]
        .as_array()
        .unwrap_or(&nothing)
        .iter()
        .map(|tool| {
            let mark = if tool["tool"] == *in_spindle { " *" } else { "" };
            vec![
                format!("{}{mark}", tool["tool"]),
                tool["pocket"].to_string(),
                number(&tool["length"]),
                number(&tool["diameter"]),
                tool["remark"].as_str().unwrap_or_default().to_owned(),
            ]
        })
        .collect();
    let unit = tools["unit"].as_str().unwrap_or_default();
    format!("{}* in the spindle; {unit}", table(&head, rows))
}
