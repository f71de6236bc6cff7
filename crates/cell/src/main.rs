//! `isocnc-cell`: the supervisor of a cell of machines, and what people ask it.

use anyhow::Context;
use cell::ca::Ca;
use cell::core::Ask;
use cell::net::is_of_encryption;
use cell::plan::{self, Model};
use cell::serve::{self, Settings};
use cell::store::Wish;
use cell_link::message::PROGRAM_MAX;
use clap::{Args, Parser, Subcommand};
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use serde_json::{Value, json};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use tracing_subscriber::Layer;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// Open files that a supervisor makes use of, where the system allows that.
const FILES: u64 = 65_536;
/// Somebody who waits for so long is told so.
const SILENCE: Duration = Duration::from_secs(3);

/// The supervisor of a cell of machines.
#[derive(Parser)]
#[command(name = "isocnc-cell", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Args)]
struct Dir {
    /// State folder of the supervisor.
    #[arg(long, value_name = "STATE")]
    dir: PathBuf,
    /// For programs.
    #[arg(long)]
    json: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Certificates of a cell.
    #[command(subcommand)]
    Ca(CaCommand),
    /// Runs the supervisor, until Ctrl-C.
    Run {
        /// State folder; made where it is not there.
        #[arg(long, value_name = "STATE")]
        dir: PathBuf,
        /// Folder of the authority.
        #[arg(long)]
        ca: PathBuf,
        /// Where controls connect.
        #[arg(long, value_name = "ADDR:PORT", value_parser = place)]
        listen: SocketAddr,
        /// Another name or address by which controls reach this PC.
        #[arg(long, value_name = "NAME", value_parser = host)]
        name: Vec<String>,
        /// Where the page is.
        #[arg(long, value_name = "ADDR:PORT", value_parser = place)]
        page: Option<SocketAddr>,
        /// Journals, orders that are over and times of use are kept for so many days; 0: for ever.
        #[arg(long, value_name = "DAYS", default_value_t = 400, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(0..=36_500))]
        keep_days: u32,
    },
    /// All machines, and how they are.
    Machines {
        #[command(flatten)]
        dir: Dir,
        /// Says which class a machine is of.
        #[arg(long, value_name = "NAME=CLASS")]
        class: Option<String>,
        /// Takes a machine that is not reached off the list, with its journal and its times.
        #[arg(long, value_name = "NAME", conflicts_with = "class")]
        forget: Option<String>,
    },
    /// Sends a program to a machine, which checks it. Nothing runs by that.
    Upload {
        name: String,
        file: PathBuf,
        #[command(flatten)]
        dir: Dir,
    },
    /// Runs a program that was sent, where the machine is free and allows it.
    RunProgram {
        name: String,
        program: String,
        #[command(flatten)]
        dir: Dir,
    },
    /// Holds what runs on a machine.
    Hold {
        name: String,
        #[command(flatten)]
        dir: Dir,
    },
    /// Brings a machine to rest and gives up what runs.
    Stop {
        name: String,
        #[command(flatten)]
        dir: Dir,
    },
    /// What has happened at a machine.
    Journal {
        name: String,
        /// Entries behind this number, up to 500; without it, the last hundred.
        #[arg(long, value_name = "NUMBER", allow_negative_numbers = true)]
        since: Option<u64>,
        #[command(flatten)]
        dir: Dir,
    },
    /// Orders of parts.
    Queue {
        #[command(subcommand)]
        change: Option<Change>,
        /// State folder of the supervisor.
        // It is needed, and may stand behind what is to be done, which clap does not have both.
        #[arg(long, value_name = "STATE", global = true)]
        dir: Option<PathBuf>,
        /// For programs.
        #[arg(long, global = true)]
        json: bool,
    },
    /// Cost and feasibility of cells, as configs/cell-cost.toml says.
    Plan {
        file: PathBuf,
        /// The cheapest cell for so many axes.
        #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(plan::AXES_MAX)))]
        axes: Option<u32>,
        #[arg(long)]
        json: bool,
    },
}

#[derive(Subcommand)]
enum CaCommand {
    /// Makes an authority.
    Init {
        #[arg(long, value_name = "CA")]
        dir: PathBuf,
    },
    /// Makes NAME.crt and NAME.key for a machine.
    Issue {
        name: String,
        #[arg(long, value_name = "CA")]
        dir: PathBuf,
    },
    /// A certificate counts no more: NAME, or NAME.N for one of several.
    Revoke {
        name: String,
        #[arg(long, value_name = "CA")]
        dir: PathBuf,
    },
    /// What was issued.
    List {
        #[arg(long, value_name = "CA")]
        dir: PathBuf,
        #[arg(long)]
        json: bool,
    },
}

#[derive(Subcommand)]
enum Change {
    /// Orders parts: machines that are free and fit make them, one after the other.
    Add {
        file: PathBuf,
        /// Parts.
        #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=100_000))]
        count: u32,
        /// Only machines of this class.
        #[arg(long, default_value = "")]
        class: String,
        /// Axes that a machine must have, like XYZA.
        #[arg(long, default_value = "")]
        axes: String,
        /// Travel that an axis must have, mm or degrees, like X=300.
        #[arg(long, value_name = "AXIS=LENGTH", value_parser = travel)]
        travel: Vec<(char, f64)>,
        /// Tools that must be in the table, like 1,4.
        #[arg(long, value_delimiter = ',', value_parser = tool)]
        tools: Vec<u32>,
    },
    /// No further part of an order is begun.
    Cancel {
        #[arg(value_parser = number)]
        order: i64,
    },
    /// A held order goes on.
    Resume {
        #[arg(value_parser = number)]
        order: i64,
    },
}

/// A name or an address that a certificate can be made for.
fn host(text: &str) -> Result<String, String> {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || ".-_:".contains(letter);
    match (1..=253).contains(&text.len()) && text.chars().all(is_plain) {
        true => Ok(text.to_owned()),
        false => Err("expected a name or an address by which controls reach this PC, like cell-pc.shop.lan".into()),
    }
}

fn tool(text: &str) -> Result<u32, String> {
    text.parse().map_err(|_| "expected numbers of tools, like 1,4".into())
}

fn number(text: &str) -> Result<i64, String> {
    text.parse()
        .map_err(|_| "expected the number of an order, as isocnc-cell queue tells it".into())
}

fn travel(text: &str) -> Result<(char, f64), String> {
    let parse = || {
        let (axis, length) = text.split_once('=')?;
        let mut letters = axis.chars();
        match (letters.next(), letters.next()) {
            (Some(letter), None) => {
                let length = length.parse().ok().filter(|length: &f64| length.is_finite())?;
                Some((letter.to_ascii_uppercase(), length))
            }
            _ => None,
        }
    };
    parse().ok_or_else(|| "expected an axis and a length, like X=300".into())
}

/// An address that others are told: its port stays the same.
fn place(text: &str) -> Result<SocketAddr, String> {
    let place: SocketAddr = text
        .parse()
        .map_err(|_| "expected an address and a port, like 192.168.1.10:7447")?;
    match place.port() {
        0 => Err("port 0 is another one each time".into()),
        _ => Ok(place),
    }
}

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
        Command::Machines { dir, class: None, .. } => answer(&dir, &Ask::Machines, machines),
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
        } => answer(&dir, &Ask::Journal { machine, since }, journal),
        Command::Queue { change, dir, json } => {
            let dir = dir.context("which supervisor? --dir STATE")?;
            let dir = Dir { dir, json };
            let ask = match change {
                None => return answer(&dir, &Ask::Queue, queue),
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
                    Ask::Add { wish, content }
                }
                Some(Change::Cancel { order }) => Ask::Cancel { order },
                Some(Change::Resume { order }) => Ask::Resume { order },
            };
            let done = match ask {
                Ask::Cancel { .. } => " is cancelled: no further part is begun",
                Ask::Resume { .. } => " goes on",
                _ => "",
            };
            answer(&dir, &ask, |order| format!("order {}{done}\n", order["order"]))
        }
        Command::Plan { file, axes, json } => plan(&file, axes, json),
    }
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

/// Text of others, which may be meant for a terminal.
fn plain(text: &str) -> String {
    let plain = |letter: char| if letter.is_control() { ' ' } else { letter };
    text.chars().map(plain).collect()
}

fn word(value: &Value) -> String {
    plain(value.as_str().unwrap_or_default())
}

/// How wide a column must be.
fn width<'v>(values: impl Iterator<Item = &'v Value>) -> usize {
    values.filter_map(Value::as_str).map(str::len).max().unwrap_or(0)
}

fn all<'v>(value: &'v Value, key: &str) -> impl Iterator<Item = &'v Value> {
    value[key].as_array().into_iter().flatten()
}

fn machines(answer: &Value) -> String {
    let mut text = String::new();
    if all(answer, "machines").next().is_none() {
        return "no machine has spoken yet: isocnc-cell ca issue NAME --dir CA\n".into();
    }
    let names = width(all(answer, "machines").map(|machine| &machine["name"]));
    let classes = width(all(answer, "machines").map(|machine| &machine["class"]));
    for machine in all(answer, "machines") {
        let state = &machine["state"];
        let how = match machine["alive"] == true {
            true => state["alarm"].as_str().or(state["why_not"].as_str()).unwrap_or("ready"),
            false => "not reached; it works on alone",
        };
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{:names$} {:classes$} {:8} {}",
            word(&machine["name"]),
            word(&machine["class"]),
            word(&machine["use"]),
            plain(how)
        );
    }
    text
}

fn journal(answer: &Value) -> String {
    all(answer, "entries")
        .map(|entry| {
            format!(
                "{:>6} {:8} {}\n",
                entry["seq"].to_string(),
                word(&entry["kind"]),
                word(&entry["text"])
            )
        })
        .collect()
}

/// How something is, and why, where that says more.
fn with_note(is: &Value, note: &Value) -> String {
    match (word(is), word(note)) {
        (is, note) if note.is_empty() || note == is => is,
        (is, note) => format!("{is}: {note}"),
    }
}

fn queue(answer: &Value) -> String {
    let mut text = String::new();
    if all(answer, "orders").chain(all(answer, "attempts")).next().is_none() {
        return "no orders yet\n".into();
    }
    for order in all(answer, "orders") {
        let (done, count, under_way) = (&order["completed"], &order["count"], &order["under_way"]);
        let _ = writeln!(
            text,
            "order {} {} {done} of {count} parts, {under_way} under way, {} failed: {}",
            order["id"],
            word(&order["program"]),
            order["failed"],
            with_note(&order["state"], &order["note"]),
        );
        for unfit in all(order, "unfit").filter(|_| order["state"] == "open") {
            let _ = writeln!(
                text,
                "           not on {}: {}",
                word(&unfit["machine"]),
                word(&unfit["why"])
            );
        }
    }
    let names = width(all(answer, "attempts").map(|attempt| &attempt["machine"]));
    let programs = width(all(answer, "attempts").map(|attempt| &attempt["program"]));
    for attempt in all(answer, "attempts") {
        let _ = writeln!(
            text,
            "{:names$} {:programs$} {}",
            word(&attempt["machine"]),
            word(&attempt["program"]),
            with_note(&attempt["phase"], &attempt["note"]),
        );
    }
    text
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

    #[test]
    fn a_list_fits_the_terminal_and_tells_it_nothing() {
        let machine = |name: &str, alarm: &str| json!({ "name": name, "class": "", "use": "alarm", "alive": true, "state": { "alarm": alarm } });
        let told = json!({ "machines": [machine("mill-1", "hot\u{1b}[2J\nmill-9 ready"), machine("b", "cold")] });
        assert_eq!(
            machines(&told),
            "mill-1  alarm    hot [2J mill-9 ready\nb       alarm    cold\n"
        );
        let entry = json!({ "entries": [{ "seq": 1, "kind": "note", "text": "a\rb" }] });
        assert_eq!(journal(&entry), "     1 note     a b\n");
        let attempt = |phase: &str, note: &str| json!({ "machine": "m", "program": "p", "phase": phase, "note": note });
        let attempts = json!({ "attempts": [attempt("completed", "completed"), attempt("failed", "stopped"), attempt("running", "")] });
        assert_eq!(queue(&attempts), "m p completed\nm p failed: stopped\nm p running\n");
    }
}
