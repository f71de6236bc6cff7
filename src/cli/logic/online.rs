//! `isocnc logic watch`, `force`, `reload`: programs of a running control.
//!
//! In:  the control socket. Out: variables as a table or JSON, again where something has changed; a line for what was done.

use anyhow::{Context, bail};
use api::client::{Client, ClientError};
use clap::Args;
use host::signals::StopSignal;
use host::terminal::{self, say};
use protocol::{LogicVariable, LogicVariables, method, params};
use remote::control::{ControlArgs, ask, connect, print};
use serde_json::json;
use std::process::ExitCode;
use std::time::Duration;

/// Between two looks whether somebody has pressed Ctrl-C.
const SIGNAL_LOOK: Duration = Duration::from_millis(20);

/// Arguments of `watch`.
#[derive(Debug, Args)]
pub(super) struct WatchArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Name of the program or its file; may be left out where there is one
    program: Option<String>,
    /// Only this variable, structure, array or block
    #[arg(long, value_name = "NAME")]
    variable: Option<String>,
    /// Print all once and return
    #[arg(long)]
    once: bool,
    /// Time between two looks; changes in between are not seen
    #[arg(long, value_name = "MS", default_value_t = 200, value_parser = clap::value_parser!(u64).range(10..=3_600_000))]
    interval_ms: u64,
}

/// Arguments of `force`.
#[derive(Debug, Args)]
pub(super) struct ForceArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Name of the program or its file; may be left out where there is one
    #[arg(long, value_name = "PROGRAM")]
    program: Option<String>,
    /// The variable; with --release, all of them without it
    #[arg(required_unless_present = "release")]
    variable: Option<String>,
    /// BOOL as TRUE or FALSE, TIME as T#1s500ms or in milliseconds
    #[arg(required_unless_present = "release", allow_hyphen_values = true)]
    value: Option<String>,
    /// Let it be again what pins and the program make of it
    #[arg(long, conflicts_with = "value")]
    release: bool,
}

/// Arguments of `reload`.
#[derive(Debug, Args)]
pub(super) struct ReloadArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Name of the program or its file; may be left out where there is one
    program: Option<String>,
}

/// A program by its name, or by its file, which is looked for here and not where the control was started.
fn program(of: &Option<String>) -> Option<String> {
    let name = of.as_ref()?;
    let file = std::fs::canonicalize(name).ok().filter(|path| path.is_file());
    Some(
        file.and_then(|path| path.to_str().map(str::to_owned))
            .unwrap_or_else(|| name.clone()),
    )
}

/// All variables that are asked for, page by page, as if they were one.
fn look(client: &mut Client, asked: &params::LogicLook) -> Result<LogicVariables, ClientError> {
    let mut all = client.ask::<method::LogicLook>(asked)?;
    while all.more {
        let next = params::LogicLook {
            from: Some(all.variables.len() as u32),
            ..asked.clone()
        };
        let page = client.ask::<method::LogicLook>(&next)?;
        all.variables.extend(page.variables);
        all.more = page.more;
    }
    Ok(all)
}

/// Runs `watch`.
pub(super) fn watch(args: &WatchArgs) -> anyhow::Result<ExitCode> {
    let signal = StopSignal::install().context("signals")?;
    let mut client = connect(&args.control)?;
    let asked = params::LogicLook {
        program: program(&args.program),
        variable: args.variable.clone(),
        ..Default::default()
    };
    let mut last = Vec::new();
    loop {
        let shown = match look(&mut client, &asked) {
            Err(ClientError::Io { .. }) if !last.is_empty() => {
                bail!("the control has ended");
            }
            looked => looked?,
        };
        let all = shown.variables;
        let is_new = |at: usize| last.get(at) != all.get(at);
        let changed: Vec<&LogicVariable> = (0..all.len()).filter(|at| is_new(*at)).map(|at| &all[at]).collect();
        if !changed.is_empty() {
            match args.control.json {
                true => say(&format!(
                    "{}\n",
                    json!({ "program": shown.program, "time_ms": shown.time_ms, "variables": changed })
                )),
                false => say(&words(&changed)),
            }
        }
        if args.once {
            return Ok(ExitCode::SUCCESS);
        }
        last = all;
        for _ in 0..(args.interval_ms / SIGNAL_LOOK.as_millis() as u64).max(1) {
            if signal.caught().is_some() {
                return Ok(ExitCode::SUCCESS);
            }
            std::thread::sleep(SIGNAL_LOOK);
        }
    }
}

/// Line, name, type and value of each; what is forced says so.
fn words(variables: &[&LogicVariable]) -> String {
    let rows = variables.iter().map(|variable| {
        let forced = if variable.forced { "FORCED" } else { "" };
        vec![
            variable.line.to_string(),
            variable.name.clone(),
            variable.kind.clone(),
            variable.value.clone(),
            forced.to_owned(),
            variable.pin.clone().unwrap_or_default(),
        ]
    });
    terminal::table(&[">line", "name", "type", ">value", "", "pin"], rows)
}

/// Runs `force`.
pub(super) fn force(args: &ForceArgs) -> anyhow::Result<ExitCode> {
    let program = program(&args.program);
    if args.release {
        let wanted = params::LogicRelease {
            program,
            variable: args.variable.clone(),
        };
        let answer = ask::<method::LogicRelease>(&args.control, &wanted)?;
        print(&args.control, &answer, &format!("{} released", answer.released));
        return Ok(ExitCode::SUCCESS);
    }
    let (Some(variable), Some(value)) = (args.variable.clone(), args.value.clone()) else {
        bail!("a value is missing; --release ends forcing");
    };
    let wanted = params::LogicForce {
        program,
        variable,
        value,
    };
    let answer = ask::<method::LogicForce>(&args.control, &wanted)?;
    let forced = &answer.forced;
    print(
        &args.control,
        &answer,
        &format!("forced: {forced}; ends with isocnc logic force --release"),
    );
    Ok(ExitCode::SUCCESS)
}

/// Runs `reload`.
pub(super) fn reload(args: &ReloadArgs) -> anyhow::Result<ExitCode> {
    let program = program(&args.program);
    let answer = ask::<method::LogicReload>(&args.control, &params::LogicReload { program })?;
    let words = format!("replaced; {} values go on", answer.carried);
    print(&args.control, &answer, &words);
    Ok(ExitCode::SUCCESS)
}
