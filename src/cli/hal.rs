//! `isocnc hal`: pins and nets of a running control, from another process; `import` is in `hal_import`.
//!
//! In:  the shared memory of the control, found by the name of its machine.
//! Out: lines or JSON on standard output; `set` changes an input that no net reaches.

use super::hal_import::{self, ImportArgs};
use crate::host::terminal::table;
use anyhow::{Context, bail};
use glob::Pattern;
use hal_pins::{AnyValue, Attached, Found, PinInfo};
use serde_json::{Value as Json, json};
use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Arguments of `isocnc hal`.
#[derive(Clone, Debug, clap::Args)]
pub struct HalArgs {
    /// Name of the machine; may be left out while exactly one control runs
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
    /// Set an input that no net reaches
    #[command(after_help = "Example: isocnc hal set motion.feed-hold 1")]
    Set {
        /// Name of the pin
        name: String,
        /// New value: 0, 1, false or true for a bit, else a number
        #[arg(allow_hyphen_values = true)]
        value: String,
    },
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

/// Runs the command.
///
/// # Errors
/// No control, an unknown name, a value that cannot be set, a damaged file.
pub fn hal(args: &HalArgs) -> anyhow::Result<ExitCode> {
    if let HalCommand::Import(import) = &args.command {
        return hal_import::import(import, args.json);
    }
    let machine = match &args.machine {
        Some(machine) => machine.clone(),
        None => the_only_one(hal_pins::find())?,
    };
    let pins = Attached::attach(&machine)?;
    let mut out = std::io::stdout().lock();
    match run(&args.command, args.json, &pins, &mut out) {
        // The reader of a pipe may have seen enough.
        Err(error)
            if error
                .downcast_ref::<std::io::Error>()
                .is_some_and(|cause| cause.kind() == ErrorKind::BrokenPipe) => {}
        done => done?,
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
                "several controls are running: choose one with --machine: {}",
                names.join(", ")
            )
        }
    }
}

fn run(command: &HalCommand, as_json: bool, pins: &Attached, out: &mut impl Write) -> anyhow::Result<()> {
    match command {
        HalCommand::List { names } => {
            let patterns = names.iter().map(|name| pattern(name)).collect::<Result<Vec<_>, _>>()?;
            let is_wanted = |pin: &PinInfo| {
                let fits = |(name, pattern): (&String, &Option<Pattern>)| match pattern {
                    Some(pattern) => pattern.matches(&pin.name),
                    None => pin.name.starts_with(name.as_str()),
                };
                names.is_empty() || names.iter().zip(&patterns).any(fits)
            };
            let list: Vec<PinInfo> = pins.list()?.into_iter().filter(is_wanted).collect();
            if as_json {
                writeln!(out, "{:#}", Json::from_iter(list.iter().map(to_json)))?;
            } else {
                write_table(&list, out)?;
            }
        }
        HalCommand::Get { names } => {
            let plain = !names.iter().any(|name| is_pattern(name));
            for pin in &chosen(pins, names)? {
                match as_json {
                    true => writeln!(out, "{}", to_json(pin))?,
                    false if plain => writeln!(out, "{}", pin.value)?,
                    false => writeln!(out, "{}  {}", pin.name, with_unit(pin))?,
                }
            }
        }
        // Needs no control: it is done before one is looked for.
        HalCommand::Import(_) => {}
        HalCommand::Set { name, value } => {
            let value_type = pins.get(name)?.value_type();
            pins.set(
                name,
                AnyValue::parse(value_type, value).with_context(|| format!("pin '{name}'"))?,
            )?;
            if as_json {
                writeln!(out, "{}", to_json(&pins.get(name)?))?;
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

/// The pins and nets that names and patterns mean, each once.
fn chosen(pins: &Attached, names: &[String]) -> anyhow::Result<Vec<PinInfo>> {
    let mut chosen: Vec<PinInfo> = Vec::new();
    for name in names {
        let found = match pattern(name)? {
            None => vec![pins.get(name)?],
            Some(pattern) => {
                let fits = |pin: &PinInfo| pattern.matches(&pin.name);
                let found: Vec<PinInfo> = pins.list()?.into_iter().filter(fits).collect();
                if found.is_empty() {
                    bail!("no pin or net fits '{name}'");
                }
                found
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
            eprintln!("the control has ended");
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

fn to_json(pin: &PinInfo) -> Json {
    json!({
        "name": pin.name,
        "type": pin.value_type().name(),
        "direction": pin.kind.short(),
        "value": value_json(pin.value),
        "net": pin.net,
        "source": pin.source,
        "alias_of": pin.alias_of,
        "unit": if pin.unit.is_empty() { Json::Null } else { pin.unit.as_str().into() },
    })
}

fn value_json(value: AnyValue) -> Json {
    match value {
        AnyValue::Bit(value) => value.into(),
        AnyValue::S32(value) => value.into(),
        AnyValue::U32(value) => value.into(),
        AnyValue::S64(value) => value.into(),
        AnyValue::U64(value) => value.into(),
        AnyValue::Float(value) => value.into(),
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
        assert_eq!(said[4].as_ref().unwrap_err(), "no pin or net fits 'joint.1.*'");
        assert!(
            said[5].as_ref().unwrap_err().starts_with("'joint.[': "),
            "{:?}",
            said[5]
        );
        assert_eq!(names(&said[6]), Vec::<String>::new());
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
            "several controls are running: choose one with --machine: a (process 1), b (process 2)"
        );
    }
}
