//! `isocnc-cell`: the supervisor of a cell of machines, and what people ask it.

mod arguments;
mod words;

use anyhow::Context;
use arguments::{CaCommand, Change, Cli, Command, Dir};
use cell::ca::Ca;
use cell::core::Ask;
use cell::net::is_of_encryption;
use cell::plan::{self, Model};
use cell::serve::{self, Settings};
use cell::store::Wish;
use cell_link::message::PROGRAM_MAX;
use clap::{CommandFactory, Parser};
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use serde_json::{Value, json};
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use tracing_subscriber::Layer;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use words::{plain, word};

/// Open files that a supervisor makes use of, where the system allows that.
const FILES: u64 = 65_536;
/// Somebody who waits for so long is told so.
const SILENCE: Duration = Duration::from_secs(3);

fn main() -> ExitCode {
    cell_link::carrier::prepare();
    let as_json = wants_json(std::env::args_os());
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) if as_json && error.use_stderr() => {
            tell_as_json(&error.to_string());
            return ExitCode::from(2);
        }
        Err(error) => return show(&error),
    };
    match carry_out(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if as_json => {
            tell_as_json(&format!("{error:#}"));
            ExitCode::FAILURE
        }
        Err(error) => {
            let lines: Vec<String> = format!("{error:#}").lines().map(plain).collect();
            // Nobody else can be told.
            let _ = writeln!(files::printed::stderr(), "error: {}", lines.join("\n"));
            ExitCode::FAILURE
        }
    }
}

/// Shows help, or what is wrong with the words of a command line.
fn show(error: &clap::Error) -> ExitCode {
    let text = error.render();
    files::printed::tell(&text.to_string(), &text.ansi().to_string(), error.use_stderr());
    ExitCode::from(error.exit_code() as u8)
}

/// Whether errors are for a program to read; known before the arguments are, for these may be wrong.
fn wants_json(args: impl Iterator<Item = OsString>) -> bool {
    args.take_while(|word| word != "--").any(|word| word == "--json")
}

/// An error for a program, in the shape that `isocnc` has for all of its commands.
fn tell_as_json(text: &str) {
    let error = json!({ "file": null, "errors": [{ "rule": text.trim_end() }] });
    // Nobody else can be told.
    let _ = say(&format!("{error:#}\n"));
}

fn say(text: &str) -> anyhow::Result<()> {
    let mut out = files::printed::stdout();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        // Whoever reads has seen enough.
        Err(cause) if cause.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => Ok(written?),
    }
}

fn content(file: &Path) -> anyhow::Result<(String, Vec<u8>)> {
    let place = || format!("{}", file.display());
    let content = files::read::read(file, PROGRAM_MAX as u64).with_context(place)?;
    let name = file.file_name().and_then(|name| name.to_str());
    Ok((name.with_context(place)?.to_owned(), content))
}

fn carry_out(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Ca(command) => authority(command),
        Command::Run {
            dir,
            ca,
            listen,
            name,
            page,
            keep_days,
        } => run(Settings {
            state: dir,
            ca,
            listen,
            names: name,
            page,
            keep_days,
        }),
        Command::Machines {
            dir,
            forget: Some(machine),
            ..
        } => answer(&dir, &Ask::Forget { machine }, |gone| {
            let name = word(&gone["machine"]);
            format!(
                "{name} is off the list; with a certificate that counts it is back once it speaks: \
                 isocnc-cell ca revoke {name} --dir CA\n"
            )
        }),
        Command::Machines { dir, class: None, .. } => answer(&dir, &Ask::Machines, words::machines),
        Command::Machines {
            dir,
            class: Some(class),
            ..
        } => {
            let (machine, class) = class.split_once('=').context("--class: expected NAME=CLASS")?;
            let ask = Ask::SetClass {
                machine: machine.into(),
                class: class.into(),
            };
            answer(&dir, &ask, |_| format!("{machine} is of class {class:?}\n"))
        }
        Command::Upload {
            name: machine,
            file,
            dir,
        } => {
            let (name, content) = content(&file)?;
            let ask = Ask::Upload { machine, name, content };
            answer(&dir, &ask, |stored| {
                let time = stored["outlook"]["planned_time_s"].as_f64().unwrap_or_default();
                let warning = stored["outlook"]["warning"]
                    .as_str()
                    .map(|text| format!("warning: {}\n", plain(text)));
                let (program, machine) = (word(&stored["program"]), word(&stored["machine"]));
                format!(
                    "{program} is on {machine}, and right; it takes {time:.0} s\n{}",
                    warning.unwrap_or_default()
                )
            })
        }
        Command::RunProgram {
            name: machine,
            program,
            dir,
        } => {
            let ask = Ask::RunProgram { machine, program };
            answer(&dir, &ask, |order| {
                format!("order {}: {}\n", word(&order["id"]), word(&order["phase"]))
            })
        }
        Command::Ports { name, dir } => answer(&dir, &Ask::Ports { machine: name }, words::ports),
        Command::Mdi { name, line, dir } => {
            let machine = name.clone();
            answer(&dir, &Ask::Mdi { machine, line }, |_| format!("{name} runs it\n"))
        }
        Command::Hold { name, dir } => {
            let machine = name.clone();
            answer(&dir, &Ask::Hold { machine }, |_| format!("{name} holds\n"))
        }
        Command::Stop { name, dir } => {
            let machine = name.clone();
            answer(&dir, &Ask::Stop { machine }, |_| format!("{name} stops\n"))
        }
        Command::Journal {
            name: machine,
            since,
            dir,
        } => answer(&dir, &Ask::Journal { machine, since }, words::journal),
        Command::Queue { change, dir, json } => {
            let dir = dir.context("which supervisor? --dir STATE")?;
            queue(&Dir { dir, json }, change)
        }
        Command::Plan { file, axes, json } => plan(&file, axes, json),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "isocnc-cell", &mut script);
            say(&String::from_utf8_lossy(&script))
        }
        Command::Man { folder } => {
            let place = || format!("{}", folder.display());
            files::make_folder(&folder).with_context(place)?;
            clap_mangen::generate_to(Cli::command(), &folder).with_context(place)
        }
    }
}

/// Shows the orders of parts, or changes them.
fn queue(dir: &Dir, change: Option<Change>) -> anyhow::Result<()> {
    let (ask, done) = match change {
        None => return answer(dir, &Ask::Queue, words::queue),
        Some(Change::Add {
            file,
            count,
            class,
            axes,
            travel,
            tools,
        }) => {
            let (program, content) = content(&file)?;
            let wish = Wish {
                program,
                count,
                class,
                axes,
                travel,
                tools,
            };
            (Ask::Add { wish, content }, "")
        }
        Some(Change::Cancel { order }) => (Ask::Cancel { order }, " is cancelled: no further part is begun"),
        Some(Change::Resume { order }) => (Ask::Resume { order }, " goes on"),
    };
    answer(dir, &ask, |order| format!("order {}{done}\n", order["order"]))
}

fn authority(command: CaCommand) -> anyhow::Result<()> {
    match command {
        CaCommand::Init { dir } => {
            let ca = Ca::init(&dir)?;
            say(&format!(
                "{}: of every control and of the supervisor; ca.key beside it is the secret of the cell\n",
                ca.certificate().display()
            ))
        }
        CaCommand::Issue { name, dir } => {
            let one = Ca::of(&dir).issue(&name)?;
            let dir = dir.display();
            say(&format!(
                "{dir}/{name}.crt, {dir}/{name}.key: certificate {} of {name}\n",
                one.name()
            ))
        }
        CaCommand::Revoke { name, dir } => {
            let count = Ca::of(&dir).revoke(&name)?;
            say(&format!(
                "{count} revoked; a supervisor that runs knows within seconds\n"
            ))
        }
        CaCommand::List { dir, json } => {
            let issued = Ca::of(&dir).issued()?;
            if json {
                return say(&(serde_json::to_string_pretty(&issued)? + "\n"));
            }
            let lines = issued.iter().map(|one| {
                let state = if one.revoked_unix_s.is_some() {
                    "revoked"
                } else {
                    "valid"
                };
                format!("{:36} {state}\n", one.name())
            });
            say(&lines.collect::<String>())
        }
    }
}

fn run(settings: Settings) -> anyhow::Result<()> {
    // Zenoh tells of clients that the encryption refuses as warnings, and much else at lower levels.
    let filter = tracing_subscriber::filter::Targets::new()
        .with_target("cell", tracing::Level::INFO)
        .with_target("zenoh_link_tls", tracing::Level::WARN)
        .with_default(tracing::Level::ERROR);
    tracing_subscriber::registry()
        .with(filter)
        .with(&serve::REFUSALS)
        .with(
            tracing_subscriber::fmt::layer()
                .with_writer(files::printed::stderr)
                .with_ansi(files::printed::shows_colours(&io::stderr()))
                .with_target(true)
                .with_filter(tracing_subscriber::filter::filter_fn(|metadata| {
                    !is_of_encryption(metadata)
                })),
        )
        .init();
    // Each control has one, and each stranger until its handshake is given up.
    let files = getrlimit(Resource::RLIMIT_NOFILE)
        .and_then(|(soft, hard)| setrlimit(Resource::RLIMIT_NOFILE, soft.max(hard.min(FILES)), hard));
    if let Err(cause) = files {
        tracing::warn!("no more open files than before: {cause}");
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register_conditional_default(signal, Arc::clone(&stop))?;
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let page = settings
        .page
        .map(|page| format!(", page: http://{page}/"))
        .unwrap_or_default();
    serve::run(&settings, &stop, || {
        say(&format!("listening at {}{page}\n", settings.listen))
    })
}

/// Asks the supervisor of a folder and prints what it says.
fn answer(dir: &Dir, ask: &Ask, text: impl Fn(&Value) -> String) -> anyhow::Result<()> {
    let (waits, is_answered) = channel::<()>();
    std::thread::spawn(move || {
        if is_answered.recv_timeout(SILENCE) == Err(RecvTimeoutError::Timeout) {
            // Nobody else can be told.
            let _ = writeln!(
                files::printed::stderr(),
                "no answer yet; Ctrl-C ends the waiting, not what was ordered"
            );
        }
    });
    let answer = serve::ask(&dir.dir, ask);
    drop(waits);
    let answer = answer?;
    match dir.json {
        true => say(&(serde_json::to_string_pretty(&answer)? + "\n")),
        false => say(&text(&answer)),
    }
}

fn plan(file: &Path, axes: Option<u32>, json: bool) -> anyhow::Result<()> {
    let place = || format!("{}", file.display());
    let text = files::read_text(file, 1 << 20).with_context(place)?;
    let model = Model::read(&text).map_err(anyhow::Error::msg).with_context(place)?;
    let judged = match axes {
        Some(axes) => vec![
            model
                .cheapest(axes)
                .with_context(|| format!("no cell of {axes} axes can be built within these limits"))?,
        ],
        None => model.configurations.iter().map(|one| model.judge(one)).collect(),
    };
    match json {
        true => say(&(serde_json::to_string_pretty(&judged)? + "\n")),
        false => say(&plan::table(&judged)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_stands_before_or_behind_what_is_to_be_done_with_the_queue() {
        let add = ["add", "p.ngc", "--count", "5"];
        for words in [
            [&["isocnc-cell", "queue", "--dir", "state"], &add[..]].concat(),
            [&["isocnc-cell", "queue"], &add[..], &["--dir", "state"]].concat(),
        ] {
            let read = Cli::try_parse_from(&words).map(|cli| cli.command);
            let Ok(Command::Queue { change, dir, .. }) = read else {
                panic!("{words:?} is refused");
            };
            assert_eq!(dir.as_deref(), Some(Path::new("state")));
            assert!(matches!(change, Some(Change::Add { count: 5, .. })));
        }
        let without = Cli::parse_from(["isocnc-cell", "queue"]);
        let error = carry_out(without.command).unwrap_err().to_string();
        assert!(error.contains("--dir STATE"), "{error}");
        for (count, why) in [("-1", "-1 is not in 1..=100000"), ("0", "0 is not in 1..=100000")] {
            let words = ["isocnc-cell", "queue", "add", "p.ngc", "--count", count];
            let Err(error) = Cli::try_parse_from(words) else {
                panic!("{count} is taken")
            };
            assert!(error.to_string().contains(why), "{error}");
        }
    }
}
