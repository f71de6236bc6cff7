//! `isocnc hal`: pins and nets of a running control, from another process; `import` is in `hal_import`.
//!
//! In:  the shared memory of the control, found by the name of its machine.
//! Out: lines or JSON on standard output; `set` changes an input that no net reaches.

mod graph;
mod scope;
mod show;

use super::hal_import::{self, ImportArgs};
use anyhow::{Context, anyhow, bail};
use api::methods::{pin as shown, value_json};
use glob::Pattern;
use graph::Graph;
use hal_pins::{AnyValue, Attached, Found, HalError, Kind, PinInfo, nearest};
use host::terminal::table;
use scope::ScopeArgs;
use serde_json::{Value as Json, json};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use terminal::refusal::Refusal;

/// Arguments of `isocnc hal`.
#[derive(Clone, Debug, clap::Args)]
pub struct HalArgs {
    /// Control of this machine; without it that of ISOCNC_MACHINE, or the only one that runs
    #[arg(long, global = true, value_name = "NAME")]
    pub machine: Option<String>,
    /// Print JSON
    #[arg(long, global = true)]
    pub json: bool,
    /// What to do
    #[command(subcommand)]
    pub command: HalCommand,
}

/// What `isocnc hal` does.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum HalCommand {
    /// All pins and nets: name, type, direction, value, net
    #[command(after_help = "Example: isocnc hal list joint.0")]
    List {
        /// Only names that begin so, or that a pattern fits: 'joint.*.f-error', '*in-0?'
        names: Vec<String>,
        /// Print names alone, one a line: for scripts, and for completion in shells
        #[arg(long = "names")]
        only_names: bool,
    },
    /// The value of pins or nets, one a line; of those that a pattern fits, with their names and units
    #[command(after_help = "Example: isocnc hal get joint.0.motor-pos-cmd motion.feed-hold")]
    Get {
        /// Names, or patterns as with list
        #[arg(required = true)]
        names: Vec<String>,
    },
    /// Translate HAL files of LinuxCNC into components and nets of a machine file; no control is needed
    Import(ImportArgs),
    /// Set an input that no net reaches, or all that a pattern fits
    #[command(after_help = "Example: isocnc hal set motion.feed-hold 1")]
    Set {
        /// Name of the pin, or a pattern as with list: then all that it fits, or none
        name: String,
        /// New value: 0, 1, false or true for a bit, else a number
        #[arg(allow_hyphen_values = true)]
        value: String,
    },
    /// Everything of pins or nets: type, direction, value, unit, net, writer, readers, aliases
    #[command(after_help = "Example: isocnc hal show motion.feed-hold")]
    Show {
        /// Names, or patterns as with list
        #[arg(required = true)]
        names: Vec<String>,
    },
    /// Show or record pins cycle by cycle, as an oscilloscope
    #[command(
        after_help = "Example: isocnc hal scope joint.0.f-error --trigger 'joint.0.f-error>0.05' --seconds 2 --svg error.svg"
    )]
    Scope(ScopeArgs),
    /// Draw nets and components, of a machine file or of a running control
    #[command(after_help = "Example: isocnc hal graph machine.toml --svg nets.svg")]
    Graph(GraphArgs),
    /// Print values as they change, until Ctrl-C or the end of the control
    #[command(after_help = "Example: isocnc hal watch joint.0.motor-pos-cmd --interval-ms 500")]
    Watch {
        /// Names, or patterns as with list; none: all
        names: Vec<String>,
        /// Time between two looks; changes in between are not seen
        #[arg(long, value_name = "MS", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=3_600_000))]
        interval_ms: u64,
    },
}

/// Arguments of `isocnc hal graph`.
#[derive(Clone, Debug, clap::Args)]
pub struct GraphArgs {
    /// Machine file; without it the nets of a running control
    file: Option<PathBuf>,
    /// Write a picture
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write the graph for graphviz; without --svg and --dot it is printed
    #[arg(long, value_name = "FILE")]
    dot: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// No control, an unknown name, a value that cannot be set, a damaged file.
pub fn hal(args: &HalArgs) -> anyhow::Result<ExitCode> {
    if let HalCommand::Import(import) = &args.command {
        return hal_import::import(import, args.json);
    }
    let mut out = files::printed::stdout();
    let done = match &args.command {
        HalCommand::Graph(GraphArgs {
            file: Some(file),
            svg,
            dot,
        }) => {
            let config = bus::read(file).map_err(Refusal::from)?;
            write_graph(&Graph::of_file(&config), svg.as_deref(), dot.as_deref(), &mut out)
        }
        command => on_a_control(args, command, &mut out),
    };
    match done {
        // The reader of a pipe may have seen enough.
        Err(error)
            if error
                .downcast_ref::<std::io::Error>()
                .is_some_and(|cause| cause.kind() == ErrorKind::BrokenPipe) =>
        {
            Ok(ExitCode::SUCCESS)
        }
        done => done,
    }
}

fn on_a_control(args: &HalArgs, command: &HalCommand, out: &mut impl Write) -> anyhow::Result<ExitCode> {
    let machine = match api::client::chosen(args.machine.as_deref()) {
        Some(machine) => machine,
        None => the_only_one(hal_pins::find())?,
    };
    let pins = Attached::attach(&machine)?;
    match command {
        HalCommand::Scope(wanted) => scope::scope(wanted, &machine, &pins, args.json, out),
        HalCommand::Graph(GraphArgs { svg, dot, .. }) => {
            let graph = Graph::of_pins(&machine, &pins.list()?);
            write_graph(&graph, svg.as_deref(), dot.as_deref(), out)
        }
        command => run(command, args.json, &pins, out).map(|()| ExitCode::SUCCESS),
    }
}

fn write_graph(
    graph: &Graph,
    svg: Option<&Path>,
    dot: Option<&Path>,
    out: &mut impl Write,
) -> anyhow::Result<ExitCode> {
    if let Some(path) = svg {
        files::write(path, graph.svg()).with_context(|| path.display().to_string())?;
    }
    match dot {
        Some(path) => files::write(path, graph.dot()).with_context(|| path.display().to_string())?,
        None if svg.is_none() => out.write_all(graph.dot().as_bytes())?,
        None => {}
    }
    Ok(ExitCode::SUCCESS)
}

fn the_only_one(running: Vec<Found>) -> anyhow::Result<String> {
    match &running[..] {
        [only] => Ok(only.machine.clone()),
        [] => bail!("no control is running (or it runs as another user): start one with 'isocnc run' or 'isocnc demo'"),
        several => {
            let names: Vec<String> = several
                .iter()
                .map(|found| format!("{} (process {})", found.machine, found.pid))
                .collect();
            bail!(
                "several controls are running: choose one with --machine or ISOCNC_MACHINE: {}",
                names.join(", ")
            )
        }
    }
}

fn run(command: &HalCommand, as_json: bool, pins: &Attached, out: &mut impl Write) -> anyhow::Result<()> {
    match command {
        HalCommand::List { names, only_names } => {
            let all = pins.list()?;
            let mut is_wanted = vec![names.is_empty(); all.len()];
            for name in names {
                let pattern = pattern(name)?;
                let fits = |pin: &PinInfo| match &pattern {
                    Some(pattern) => pattern.matches(&pin.name),
                    None => pin.name.starts_with(name.as_str()),
                };
                let mut found = false;
                for (pin, is_wanted) in all.iter().zip(&mut is_wanted) {
                    let fits = fits(pin);
                    (found, *is_wanted) = (found || fits, *is_wanted || fits);
                }
                if !found {
                    return Err(nothing_fits(name, &all));
                }
            }
            let wanted = all.into_iter().zip(is_wanted).filter(|(_, is_wanted)| *is_wanted);
            let list: Vec<PinInfo> = wanted.map(|(pin, _)| pin).collect();
            if *only_names {
                for pin in &list {
                    writeln!(out, "{}", pin.name)?;
                }
            } else if as_json {
                writeln!(out, "{:#}", Json::from_iter(list.iter().map(|of| json!(shown(of)))))?;
            } else {
                write_table(&list, out)?;
            }
        }
        HalCommand::Get { names } => {
            let plain = !names.iter().any(|name| is_pattern(name));
            for pin in &chosen(pins, names)? {
                match as_json {
                    true => writeln!(out, "{}", json!(shown(pin)))?,
                    false if plain => writeln!(out, "{}", pin.value)?,
                    false => writeln!(out, "{}  {}", pin.name, with_unit(pin))?,
                }
            }
        }
        HalCommand::Show { names } => {
            let all = pins.list()?;
            for pin in chosen(pins, names)? {
                match as_json {
                    true => writeln!(out, "{}", show::json(&pin, &all))?,
                    false => out.write_all(show::text(&pin, &all).as_bytes())?,
                }
            }
        }
        // Done by `hal` and `on_a_control`.
        HalCommand::Import(_) | HalCommand::Scope(_) | HalCommand::Graph(_) => {}
        HalCommand::Set { name, value } => {
            let found = chosen(pins, std::slice::from_ref(name))?;
            let mut values = Vec::new();
            for pin in &found {
                let value = AnyValue::parse(pin.value_type(), value).with_context(|| format!("pin '{}'", pin.name))?;
                // Of several, all are set or none.
                if found.len() > 1 && (pin.kind != Kind::Input || pin.net.is_some()) {
                    let why = match &pin.net {
                        Some(net) if pin.kind == Kind::Input => format!("it is on net '{net}'"),
                        _ => format!("it is {}", pin.kind),
                    };
                    return Err(HalError::NotSettable {
                        name: pin.name.clone(),
                        why,
                    }
                    .into());
                }
                values.push(value);
            }
            for (pin, value) in found.iter().zip(values) {
                pins.set(&pin.name, value)?;
                if as_json {
                    writeln!(out, "{}", json!(shown(&pins.get(&pin.name)?)))?;
                }
            }
        }
        HalCommand::Watch { names, interval_ms } => {
            watch(names, Duration::from_millis(*interval_ms), as_json, pins, out)?
        }
    }
    out.flush()?;
    Ok(())
}

fn is_pattern(name: &str) -> bool {
    name.contains(['*', '?', '['])
}

/// The pattern that a name is, if it is one.
fn pattern(name: &str) -> anyhow::Result<Option<Pattern>> {
    is_pattern(name)
        .then(|| Pattern::new(name).with_context(|| format!("'{name}'")))
        .transpose()
}

/// Nothing fits a pattern, or begins so; with the nearest name or beginning of one.
fn nothing_fits(name: &str, all: &[PinInfo]) -> anyhow::Error {
    let plain: String = name.chars().filter(|letter| !matches!(letter, '*' | '?')).collect();
    let plain = plain.trim_end_matches('.');
    let beginnings = all.iter().flat_map(|pin| {
        let ends = pin.name.match_indices('.').map(|(end, _)| end);
        ends.chain([pin.name.len()]).map(|end| &pin.name[..end])
    });
    let hint = nearest(plain, beginnings).map_or_else(String::new, |near| format!("; did you mean '{near}'?"));
    anyhow!("no pin or net fits '{name}'{hint}")
}

/// The pins and nets that names and patterns mean, each once.
fn chosen(pins: &Attached, names: &[String]) -> anyhow::Result<Vec<PinInfo>> {
    let mut chosen: Vec<PinInfo> = Vec::new();
    for name in names {
        let found = match pattern(name)? {
            None => vec![pins.get(name)?],
            Some(pattern) => {
                let fits = |pin: &PinInfo| pattern.matches(&pin.name);
                let all = pins.list()?;
                if !all.iter().any(fits) {
                    return Err(nothing_fits(name, &all));
                }
                all.into_iter().filter(fits).collect()
            }
        };
        let is_new = |pin: &PinInfo| !chosen.iter().any(|other| other.name == pin.name);
        let found: Vec<PinInfo> = found.into_iter().filter(is_new).collect();
        chosen.extend(found);
    }
    Ok(chosen)
}

fn watch(
    names: &[String],
    interval: Duration,
    as_json: bool,
    pins: &Attached,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let start = Instant::now();
    let mut last: Vec<PinInfo> = Vec::new();
    loop {
        // Asked before the look, so that the last values of a control that ends are printed.
        let running = pins.is_running();
        let now = match names {
            [] => pins.list()?,
            names => chosen(pins, names)?,
        };
        let t_s = start.elapsed().as_secs_f64();
        for (index, pin) in now.iter().enumerate() {
            // Most often in the same place: pins are only ever added.
            let same = |before: &&PinInfo| before.name == pin.name;
            let before = last.get(index).filter(same).or_else(|| last.iter().find(same));
            if before.is_some_and(|before| same_value(before.value, pin.value)) {
                continue;
            }
            match as_json {
                true => writeln!(
                    out,
                    "{}",
                    json!({ "t_s": t_s, "name": pin.name, "value": value_json(pin.value) })
                )?,
                false => writeln!(out, "{t_s:10.3}  {}  {}", pin.name, pin.value)?,
            }
        }
        out.flush()?;
        if !running {
            files::errln!("the control has ended");
            return Ok(());
        }
        last = now;
        std::thread::sleep(interval);
    }
}

/// Equal, or both not a number: NaN that stays is no change.
fn same_value(a: AnyValue, b: AnyValue) -> bool {
    a == b || matches!((a, b), (AnyValue::Float(a), AnyValue::Float(b)) if a.is_nan() && b.is_nan())
}

fn write_table(list: &[PinInfo], out: &mut impl Write) -> std::io::Result<()> {
    let rows = list.iter().map(|pin| {
        let net = match (&pin.net, &pin.source, &pin.alias_of) {
            (Some(net), ..) => net.clone(),
            (None, Some(source), _) => format!("from {source}"),
            (None, None, Some(pin)) => format!("is {pin}"),
            (None, None, None) => String::new(),
        };
        vec![
            pin.name.clone(),
            pin.value_type().to_string(),
            pin.kind.short().into(),
            with_unit(pin),
            net,
        ]
    });
    out.write_all(table(&["name", "type", "dir", ">value", "net"], rows).as_bytes())
}

/// The value, and behind it its unit where one is known.
fn with_unit(pin: &PinInfo) -> String {
    match pin.unit.as_str() {
        "" => pin.value.to_string(),
        unit => format!("{} {unit}", pin.value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use hal_pins::Hal;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: HalArgs,
    }

    /// Runs a command line against a control with a few pins.
    fn on_a_control(lines: &[&str]) -> Vec<Result<String, String>> {
        let dir = tempfile::tempdir().unwrap();
        let dirs = [dir.path().to_owned()];
        let mut hal = Hal::create_in(&dirs, "mill3", 8).unwrap();
        hal.output::<f64>("joint.0.motor-pos-cmd").unwrap().set(-12.5);
        hal.input("drive.0.target", 0.0).unwrap();
        hal.input("motion.feed-hold", false).unwrap();
        hal.link("x-pos-cmd", "joint.0.motor-pos-cmd", &["drive.0.target"])
            .unwrap();
        let pins = Attached::attach_in(&dirs, "mill3").unwrap();
        let run_line = |line: &&str| {
            let cli = Cli::try_parse_from(std::iter::once("hal").chain(line.split(' ')))
                .map_err(|error| error.to_string())?;
            let mut out = Vec::new();
            run(&cli.args.command, cli.args.json, &pins, &mut out).map_err(|error| format!("{error:#}"))?;
            Ok(String::from_utf8(out).unwrap())
        };
        lines.iter().map(run_line).collect()
    }

    #[test]
    fn list_shows_every_pin_with_its_net() {
        let said = on_a_control(&["list", "list motion --json"]);
        let table = "\
name                   type   dir  value  net
joint.0.motor-pos-cmd  float  out  -12.5  x-pos-cmd
drive.0.target         float  in   -12.5  x-pos-cmd
motion.feed-hold       bit    in   false
x-pos-cmd              float  net  -12.5  from joint.0.motor-pos-cmd
";
        assert_eq!(said[0].as_deref(), Ok(table));
        let list: Json = serde_json::from_str(said[1].as_ref().unwrap()).unwrap();
        let pin = json!([{ "name": "motion.feed-hold", "type": "bit", "direction": "in", "value": false, "net": null, "source": null, "alias_of": null, "unit": null }]);
        assert_eq!(list, pin);
    }

    #[test]
    fn patterns_choose_pins_in_every_command_that_reads() {
        let said = on_a_control(&[
            "list joint.0.*",
            "list *cmd motion",
            "get *.target x-pos-cmd",
            "get joint.?.motor-pos-cmd drive.[0-3].* joint.* --json",
            "get joint.1.*",
            "get joint.[",
            "list nothing.*",
        ]);
        let names = |said: &Result<String, String>| -> Vec<String> {
            let rows = said.as_ref().unwrap().lines().skip(1);
            rows.map(|row| row.split_whitespace().next().unwrap().to_owned())
                .collect()
        };
        assert_eq!(names(&said[0]), ["joint.0.motor-pos-cmd"]);
        assert_eq!(
            names(&said[1]),
            ["joint.0.motor-pos-cmd", "motion.feed-hold", "x-pos-cmd"]
        );
        assert_eq!(said[2].as_deref(), Ok("drive.0.target  -12.5\nx-pos-cmd  -12.5\n"));
        assert_eq!(said[3].as_ref().unwrap().lines().count(), 2);
        assert_eq!(
            said[4].as_ref().unwrap_err(),
            "no pin or net fits 'joint.1.*'; did you mean 'joint.0'?"
        );
        assert!(
            said[5].as_ref().unwrap_err().starts_with("'joint.[': "),
            "{:?}",
            said[5]
        );
        assert_eq!(said[6].as_ref().unwrap_err(), "no pin or net fits 'nothing.*'");
    }

    #[test]
    fn names_alone_are_for_scripts_and_a_miss_has_a_hint() {
        let said = on_a_control(&[
            "list --names joint",
            "list motoin",
            "get motion.feed-hodl.*",
            "list x-pos-cmd --names",
        ]);
        assert_eq!(said[0].as_deref(), Ok("joint.0.motor-pos-cmd\n"));
        assert_eq!(
            said[1].as_ref().unwrap_err(),
            "no pin or net fits 'motoin'; did you mean 'motion'?"
        );
        let near = "no pin or net fits 'motion.feed-hodl.*'; did you mean 'motion.feed-hold'?";
        assert_eq!(said[2].as_ref().unwrap_err(), near);
        assert_eq!(said[3].as_deref(), Ok("x-pos-cmd\n"));
    }

    #[test]
    fn show_tells_everything_of_a_pin() {
        let said = on_a_control(&[
            "show drive.0.target",
            "show x-pos-cmd joint.0.motor-pos-cmd --json",
            "show motion.*",
            "show motion.feed-hodl",
        ]);
        let text = "\
drive.0.target
  type       float
  direction  in
  value      -12.5
  unit       none is known
  net        x-pos-cmd
  writer     joint.0.motor-pos-cmd
  readers    drive.0.target
";
        assert_eq!(said[0].as_deref(), Ok(text));
        let lines: Vec<Json> = said[1]
            .as_ref()
            .unwrap()
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        for line in &lines {
            assert_eq!(
                (&line["writer"], &line["readers"]),
                (&json!("joint.0.motor-pos-cmd"), &json!(["drive.0.target"]))
            );
        }
        assert!(
            said[2]
                .as_ref()
                .unwrap()
                .contains("writer     none: isocnc hal set changes it")
        );
        assert!(
            said[3]
                .as_ref()
                .unwrap_err()
                .contains("did you mean 'motion.feed-hold'?")
        );
    }

    #[test]
    fn a_pattern_sets_all_that_it_fits_or_none() {
        let said = on_a_control(&[
            "set motion.* 1",
            "get motion.feed-hold",
            "set *o*n* 0",
            "get motion.feed-hold",
            "set nothing.* 1",
        ]);
        assert_eq!(said[1].as_deref(), Ok("true\n"));
        let refused = said[2].as_ref().unwrap_err();
        assert!(
            refused.starts_with("'joint.0.motor-pos-cmd' cannot be set: it is an output"),
            "{refused}"
        );
        assert_eq!(said[3].as_deref(), Ok("true\n"));
        assert!(said[4].is_err());
    }

    #[test]
    fn get_and_set() {
        let said = on_a_control(&[
            "get x-pos-cmd motion.feed-hold",
            "set motion.feed-hold 1",
            "get motion.feed-hold",
            "set motion.feed-hold -2",
            "set drive.0.target -1.5",
            "get motion.feed-hodl",
            "get",
        ]);
        assert_eq!(said[0].as_deref(), Ok("-12.5\nfalse\n"));
        assert_eq!(said[1].as_deref(), Ok(""));
        assert_eq!(said[2].as_deref(), Ok("true\n"));
        let refused = |index: usize| said[index].as_ref().unwrap_err().as_str();
        assert_eq!(
            refused(3),
            "pin 'motion.feed-hold': '-2' is no bit: expected 0, 1, false or true"
        );
        assert_eq!(refused(4), "'drive.0.target' cannot be set: it is on net 'x-pos-cmd'");
        assert_eq!(
            refused(5),
            "no pin or net 'motion.feed-hodl'; did you mean 'motion.feed-hold'?"
        );
        assert!(refused(6).contains("required"));
    }

    #[test]
    fn watch_prints_changes_until_the_control_ends() {
        let dir = tempfile::tempdir().unwrap();
        let dirs = [dir.path().to_owned()];
        let mut hal = Hal::create_in(&dirs, "mill3", 8).unwrap();
        hal.output::<u32>("a.count").unwrap().set(5);
        let pins = Attached::attach_in(&dirs, "mill3").unwrap();
        drop(hal);
        let mut out = Vec::new();
        watch(&[], Duration::from_millis(1), true, &pins, &mut out).unwrap();
        let line: Json = serde_json::from_slice(&out).unwrap();
        assert_eq!((&line["name"], &line["value"]), (&json!("a.count"), &json!(5)));
        assert!(same_value(AnyValue::Float(f64::NAN), AnyValue::Float(f64::NAN)));
        assert!(!same_value(AnyValue::Float(0.0), AnyValue::Float(1.0)));
    }

    #[test]
    fn the_machine_may_be_left_out_if_there_is_one() {
        let found = |machine: &str, pid| Found {
            machine: machine.into(),
            pid,
            path: machine.into(),
        };
        assert_eq!(the_only_one(vec![found("a", 1)]).unwrap(), "a");
        assert!(
            the_only_one(vec![])
                .unwrap_err()
                .to_string()
                .starts_with("no control is running")
        );
        let several = the_only_one(vec![found("a", 1), found("b", 2)])
            .unwrap_err()
            .to_string();
        assert_eq!(
            several,
            "several controls are running: choose one with --machine or ISOCNC_MACHINE: a (process 1), b (process 2)"
        );
    }
}
