//! `isocnc init`: a machine file to begin with.
//!
//! In:  options, answers of the user at a terminal or of a page ([`Page`]), or the nodes that answer on an interface, of either bus.
//! Out: a machine file that `isocnc check` accepts. It is written at once at the end: what is given up before leaves nothing.

use super::proposal::{Node, Proposal, Travel, letters};
use crate::{Protocol, scan};
use host::signals::end_by_interrupt;
use host::terminal::say;
use terminal::refusal::Refusal;

use anyhow::{Context, bail, ensure};
use clap::Args;
use serde::Deserialize;
use serde_json::{Value, json};
use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};

/// Arguments of `init`.
#[derive(Clone, Debug, Default, Args)]
pub struct InitArgs {
    /// Machine file to write
    file: PathBuf,
    /// Name of the machine
    #[arg(long)]
    name: Option<String>,
    /// Network interface of the bus
    #[arg(long, value_name = "IF")]
    interface: Option<String>,
    /// Take the nodes that answer on this interface, of POWERLINK or of EtherCAT; nothing is sent where another master is at work
    #[arg(long, value_name = "IF", conflicts_with_all = ["interface", "drives", "io"])]
    scan: Option<String>,
    /// Letters of the axes, one drive each
    #[arg(long, value_name = "LETTERS")]
    axes: Option<String>,
    /// Node ids of the drives, in the order of the axes
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    drives: Vec<u8>,
    /// Node ids of inputs and outputs
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    io: Vec<u8>,
    /// Increments of each drive and the mm or degrees that its axis moves by them, in the order of the axes
    #[arg(long, value_name = "COUNTS/UNITS", value_delimiter = ',', value_parser = scale)]
    scales: Vec<[u32; 2]>,
    /// Lower and upper end of each axis, mm or degrees, in the order of the axes
    #[arg(long, value_name = "LOWER:UPPER", value_delimiter = ',', allow_hyphen_values = true, value_parser = ends)]
    travels: Vec<Ends>,
    /// Greatest speed of each axis, mm/min or degrees/min, in the order of the axes
    #[arg(long, value_name = "SPEEDS", value_delimiter = ',', value_parser = speed)]
    speeds: Vec<f64>,
    /// For a PC without real time: nothing is refused for want of it, and late cycles are borne. Not for a machine
    #[arg(long)]
    to_try: bool,
    /// Cycle, µs
    #[arg(long, value_name = "US", default_value_t = 1000)]
    cycle_us: u32,
    /// Ask nothing: what no option gives is as usual
    #[arg(long)]
    yes: bool,
    /// Replace a file that is there
    #[arg(long)]
    force: bool,
}

/// Ends of an axis, mm or degrees.
type Ends = [f64; 2];

/// # Errors
/// No two whole numbers above 0.
fn scale(text: &str) -> Result<[u32; 2], String> {
    let (counts, units) = text.split_once('/').unwrap_or((text, "1"));
    match (counts.trim().parse(), units.trim().parse()) {
        (Ok(counts), Ok(units)) if counts > 0 && units > 0 => Ok([counts, units]),
        _ => Err("expected increments and the mm that they are, whole numbers like 10000/5".into()),
    }
}

/// # Errors
/// No two numbers, the first one below the other.
fn ends(text: &str) -> Result<Ends, String> {
    let numbers = text
        .split_once(':')
        .map(|(lower, upper)| (lower.trim().parse(), upper.trim().parse()));
    match numbers {
        Some((Ok(lower), Ok(upper))) if lower < upper => Ok([lower, upper]),
        _ => Err("expected the lower and the upper end in mm, like -5:205".into()),
    }
}

/// # Errors
/// No number above 0.
fn speed(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(speed) if speed > 0.0 && f64::is_finite(speed) => Ok(speed),
        _ => Err("expected a speed above 0 in mm/min, like 9000".into()),
    }
}

/// Writes a machine file.
///
/// # Errors
/// A file that is there, an interface, or what makes no machine.
pub fn init(args: &InitArgs) -> anyhow::Result<ExitCode> {
    let file = args.file.display();
    let is_there = || std::fs::symlink_metadata(&args.file).is_ok();
    ensure!(
        args.force || !is_there(),
        "{file} is there already; --force replaces it"
    );
    let mut args = args.clone();
    let found = args.scan.as_deref().map(scan::nodes_on).transpose()?;
    if std::io::stdin().is_terminal() && !args.yes {
        let count = found
            .as_ref()
            .map(|(_, nodes)| nodes.iter().filter(|node| node.is_drive).count());
        end_by_interrupt()?;
        ask(
            &mut args,
            count,
            &mut std::io::stdin().lock(),
            &mut files::printed::stdout(),
        )?;
    }
    let text = checked(&args, found)?;
    ensure!(
        args.force || !is_there(),
        "{file} has come meanwhile; --force replaces it"
    );
    files::write(&args.file, text).with_context(|| format!("{file}: cannot be written"))?;
    say(&format!(
        "{file} is written. What was not given is as in an example: set scale, travel, limits and homing of each joint to those of\n\
         the machine, then: isocnc check {file}\n"
    ));
    if args.to_try {
        say(
            "It is for trying things on this PC. For a machine: require = \"strict\", and isocnc doctor says what the PC lacks.\n",
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// The text of the machine file, which `isocnc check` accepts.
fn checked(args: &InitArgs, found: Option<(Protocol, Vec<Node>)>) -> anyhow::Result<String> {
    let text = machine_file(args, found)?;
    // What the options say makes no machine.
    let config = config::parse(&text, &args.file).map_err(|errors| Refusal::from(errors).wrong_usage())?;
    bus::check(&config).map_err(Refusal::from)?;
    Ok(text)
}

/// The dialogue as a page in the browser. Values are those of docs/panel-api.md.
pub struct Page {
    args: InitArgs,
    /// What the last scan has found, and where.
    found: Mutex<Option<(String, Protocol, Vec<Node>)>>,
}

/// What somebody has typed into the page.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Answers {
    name: String,
    interface: String,
    /// Take the nodes of the last scan.
    scan: bool,
    axes: String,
    drives: Vec<u8>,
    io: Vec<u8>,
    scales: Vec<String>,
    travels: Vec<String>,
    speeds: Vec<String>,
    to_try: bool,
    cycle_us: u32,
}

/// Why a file is not written.
#[derive(Debug)]
pub enum NotWritten {
    /// One is there, and is not to be replaced.
    IsThere(String),
    /// The answers make no machine, or the disk does not take it.
    Wrong(String),
}

impl Page {
    /// A page that writes the file of these options, which are what it begins with.
    pub fn new(args: &InitArgs) -> Page {
        Page {
            args: args.clone(),
            found: Mutex::default(),
        }
    }

    /// The machine file that it writes.
    pub fn file(&self) -> &Path {
        &self.args.file
    }

    /// What the page begins with.
    pub fn begin(&self) -> Value {
        json!({
            "file": self.args.file.display().to_string(),
            "exists": self.is_there(),
            "name": self.args.name.clone().unwrap_or_else(|| usual_name(&self.args)),
            "real_time": is_real_time(),
            "interfaces": interfaces(),
            "cycle_us": self.args.cycle_us,
        })
    }

    /// Who answers on an interface. Takes seconds.
    ///
    /// # Errors
    /// Nobody does, or nothing can be asked, in words.
    pub fn scan(&self, interface: &str) -> Result<Value, String> {
        let (bus, nodes) = scan::nodes_on(interface).map_err(|error| format!("{error:#}"))?;
        let told: Vec<Value> = nodes
            .iter()
            .map(|node| json!({ "id": node.id, "name": node.name, "is_drive": node.is_drive }))
            .collect();
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        *found = Some((interface.to_owned(), bus, nodes));
        Ok(json!({ "bus": bus.name(), "nodes": told }))
    }

    /// The machine file that answers make.
    ///
    /// # Errors
    /// Why they make none, in words.
    pub fn check(&self, answers: &Value) -> Result<String, String> {
        let answers = Answers::deserialize(answers).map_err(|error| error.to_string())?;
        let found = self.found.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let found = match (answers.scan, found) {
            (false, _) => None,
            (true, Some((interface, bus, nodes))) if interface == answers.interface => Some((bus, nodes)),
            (true, _) => return Err(format!("{} has not been scanned", answers.interface)),
        };
        let args = answers.args(&self.args)?;
        checked(&args, found).map_err(|error| format!("{error:#}"))
    }

    /// Writes it.
    ///
    /// # Errors
    /// Why it is not written.
    pub fn write(&self, answers: &Value, replace: bool) -> Result<(), NotWritten> {
        let text = self.check(answers).map_err(NotWritten::Wrong)?;
        let file = self.args.file.display();
        if self.is_there() && !replace {
            return Err(NotWritten::IsThere(format!("{file} is there already")));
        }
        let written = files::write(&self.args.file, text);
        written.map_err(|error| NotWritten::Wrong(format!("{file}: cannot be written: {error}")))
    }

    fn is_there(&self) -> bool {
        std::fs::symlink_metadata(&self.args.file).is_ok()
    }
}

impl Answers {
    /// The options that say the same.
    fn args(self, usual: &InitArgs) -> Result<InitArgs, String> {
        fn all<T>(texts: &[String], read: fn(&str) -> Result<T, String>) -> Result<Vec<T>, String> {
            let read = |text: &String| read(text).map_err(|why| format!("{text}: {why}"));
            texts.iter().map(read).collect()
        }
        let interface = Some(self.interface);
        Ok(InitArgs {
            file: usual.file.clone(),
            name: Some(self.name),
            scan: interface.clone().filter(|_| self.scan),
            interface: interface.filter(|_| !self.scan),
            axes: Some(self.axes),
            drives: self.drives,
            io: self.io,
            scales: all(&self.scales, scale)?,
            travels: all(&self.travels, ends)?,
            speeds: all(&self.speeds, speed)?,
            to_try: self.to_try,
            cycle_us: self.cycle_us,
            yes: true,
            force: usual.force,
        })
    }
}

/// Network interfaces of this PC, by name.
fn interfaces() -> Vec<Value> {
    let class = Path::new("/sys/class/net");
    let entries = std::fs::read_dir(class).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name != "lo").collect();
    names.sort();
    let told = names.iter().map(|name| {
        let state = std::fs::read_to_string(class.join(name).join("operstate")).unwrap_or_default();
        json!({
            "name": name,
            "up": state.trim() == "up",
            "wireless": class.join(name).join("wireless").exists(),
        })
    });
    told.collect()
}

/// Asks for what no option gives; `drives`: how many are known. An empty answer is the usual one, in brackets.
fn ask(
    args: &mut InitArgs,
    drives: Option<usize>,
    input: &mut impl BufRead,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let mut answer = |question: &str, usual: &str| -> anyhow::Result<String> {
        write!(out, "{question} [{usual}]: ")?;
        out.flush()?;
        let mut line = String::new();
        ensure!(
            input.read_line(&mut line)? > 0,
            "nothing more to read: nothing is written"
        );
        Ok(match line.trim() {
            "" => usual.to_owned(),
            text => text.to_owned(),
        })
    };
    let ids = |text: &str| -> anyhow::Result<Vec<u8>> {
        let words = text
            .split([',', ' '])
            .filter(|word| !word.is_empty() && *word != "none");
        words
            .map(|word| word.parse().with_context(|| format!("{word}: no node id")))
            .collect()
    };
    if args.name.is_none() {
        args.name = Some(answer("Name of the machine", &usual_name(args))?);
    }
    if args.scan.is_none() && args.interface.is_none() {
        args.interface = Some(answer("Network interface of the bus", "eth1")?);
    }
    if args.axes.is_none() {
        args.axes = Some(answer(
            "Letters of the axes, one drive each",
            &letters(drives.unwrap_or(3)),
        )?);
    }
    if args.scan.is_none() && args.drives.is_empty() {
        let count = args.axes.as_deref().map_or(3, str::len);
        let usual: Vec<String> = (1..=count).map(|id| id.to_string()).collect();
        args.drives = ids(&answer("Node ids of their drives", &usual.join(","))?)?;
    }
    if args.scan.is_none() && args.io.is_empty() {
        args.io = ids(&answer("Node ids of inputs and outputs", "none")?)?;
    }
    ask_of_axes(args, &mut answer)?;
    if !args.to_try {
        let question = "A real machine needs a real-time PC, and its control refuses to run without one.\n\
                        For a machine, or to try things on this PC? (machine, try)";
        let usual = if is_real_time() { "machine" } else { "try" };
        args.to_try = match &*answer(question, usual)? {
            "try" => true,
            "machine" => false,
            other => bail!("{other}: expected machine or try"),
        };
    }
    Ok(())
}

/// Whether the kernel of this PC is one of real time.
fn is_real_time() -> bool {
    std::fs::read_to_string("/sys/kernel/realtime").is_ok_and(|text| text.trim() == "1")
}

/// Asks for scale, travel and speed of each axis.
fn ask_of_axes(
    args: &mut InitArgs,
    answer: &mut impl FnMut(&str, &str) -> anyhow::Result<String>,
) -> anyhow::Result<()> {
    let letters: Vec<char> = args
        .axes
        .iter()
        .flat_map(|axes| axes.to_ascii_uppercase().chars().collect::<Vec<_>>())
        .collect();
    let mut each = |what: &str, question: &str, usual: fn(char) -> &'static str| -> anyhow::Result<Vec<String>> {
        let asked = letters.iter().enumerate().map(|(number, letter)| {
            let what = if number == 0 {
                format!("{what}\n")
            } else {
                String::new()
            };
            answer(&format!("{what}{letter}: {question}"), usual(*letter))
        });
        asked.collect()
    };
    fn all<T>(texts: Vec<String>, read: fn(&str) -> Result<T, String>) -> anyhow::Result<Vec<T>> {
        let read = |text: String| read(&text).map_err(|why| anyhow::anyhow!("{text}: {why}"));
        texts.into_iter().map(read).collect()
    }
    if args.scales.is_empty() {
        let what = "Scale: how far an axis moves by how many increments of its drive. Increments of a turn are in the drive's manual.";
        args.scales = all(each(what, "increments/mm (or degrees)", |_| "10000/1")?, scale)?;
    }
    if args.travels.is_empty() {
        let what =
            "Travel: the ends that no program and no hand gets past, measured from where the axis is after homing.";
        let usual = |letter| if letter == 'Z' { "-105:5" } else { "-5:205" };
        args.travels = all(each(what, "lower:upper end, mm (or degrees)", usual)?, ends)?;
    }
    if args.speeds.is_empty() {
        let what = "Speed: begin with a tenth of what the axis is to reach.";
        args.speeds = all(
            each(what, "greatest speed, mm/min (or degrees/min)", |_| "1000")?,
            speed,
        )?;
    }
    Ok(())
}

fn usual_name(args: &InitArgs) -> String {
    let stem = args.file.file_stem().and_then(|stem| stem.to_str());
    stem.filter(|stem| !stem.is_empty()).unwrap_or("machine").to_owned()
}

/// One of which nothing but its id is known.
fn plain(id: u8, is_drive: bool) -> Node {
    Node {
        id,
        name: None,
        is_drive,
        keys: String::new(),
    }
}

/// What is known of each axis.
fn travels(args: &InitArgs) -> Vec<Travel> {
    let count = args.scales.len().max(args.travels.len()).max(args.speeds.len());
    let of = |axis: usize| Travel {
        scale: args.scales.get(axis).copied(),
        ends: args.travels.get(axis).copied(),
        speed_per_min: args.speeds.get(axis).copied(),
    };
    (0..count).map(of).collect()
}

/// The text of the machine file. `found`: nodes of a scan, and of which bus.
fn machine_file(args: &InitArgs, found: Option<(Protocol, Vec<Node>)>) -> anyhow::Result<String> {
    let Some(interface) = args.scan.as_ref().or(args.interface.as_ref()) else {
        bail!(Refusal::usage(
            "which network interface? --interface IF names it, --scan IF asks it for its nodes"
        ));
    };
    let with_nets = found.is_none();
    let (bus, nodes) = found.unwrap_or_else(|| {
        let usual = args.axes.as_deref().map_or(3, |axes| axes.chars().count()) as u8;
        let ids = if args.drives.is_empty() {
            (1..=usual).collect()
        } else {
            args.drives.clone()
        };
        let drives = ids.into_iter().map(|id| plain(id, true));
        let nodes = drives.chain(args.io.iter().map(|id| plain(*id, false))).collect();
        (Protocol::Powerlink, nodes)
    });
    let name = args.name.clone().unwrap_or_else(|| usual_name(args));
    let proposal = Proposal {
        by: "isocnc init",
        name: &name,
        bus,
        interface,
        cycle_us: args.cycle_us,
        axes: args.axes.as_deref(),
        travels: &travels(args),
        to_try: args.to_try,
        with_nets,
    };
    proposal.machine_file(nodes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(options: &[&str]) -> InitArgs {
        #[derive(clap::Parser)]
        struct Only {
            #[command(flatten)]
            args: InitArgs,
        }
        let words = ["init", "dir/mill.toml"].iter().chain(options);
        <Only as clap::Parser>::try_parse_from(words)
            .map(|only| only.args)
            .unwrap_or_else(|error| panic!("{error}"))
    }

    fn read(text: &str) -> config::Config {
        config::parse(text, "mill.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}\n{text}"))
    }

    #[test]
    fn options_alone_make_a_machine() {
        let args = args(&[
            "--interface",
            "eth7",
            "--axes",
            "xza",
            "--drives",
            "5,4,3",
            "--io",
            "20,21",
            "--cycle-us",
            "500",
        ]);
        let config = read(&machine_file(&args, None).unwrap());
        assert_eq!(
            (&*config.name, &*config.bus.interface, config.cycle_us),
            ("mill", "eth7", 500)
        );
        let ids: Vec<u8> = config.bus.nodes.iter().map(|node| node.id).collect();
        assert_eq!(ids, [5, 4, 3, 20, 21]);
        let joints: Vec<usize> = config.joints.iter().map(|joint| joint.node).collect();
        assert_eq!(joints, [0, 1, 2]);
        let axes: String = config.axes.iter().map(|map| map.axis.letter()).collect();
        assert_eq!(axes, "XZA");
        assert!(
            config.nets.iter().any(|net| net.targets == ["io.20.out-00"]),
            "{:?}",
            config.nets
        );
        assert_eq!(
            read(&machine_file(&self::args(&["--interface", "e"]), None).unwrap())
                .joints
                .len(),
            3
        );
    }

    #[test]
    fn what_options_give_of_each_axis_is_in_the_file_and_a_pc_to_try_on_is_borne() {
        let options = [
            "--interface",
            "e",
            "--scales",
            "4096/10,8192",
            "--travels=-1:2.5,0:9",
            "--speeds",
            "600",
        ];
        for (more, require, lost) in [
            (vec![], config::Require::Strict, 3),
            (vec!["--to-try"], config::Require::Warn, 200),
        ] {
            let config = read(&machine_file(&args(&[&options[..], &more].concat()), None).unwrap());
            let ends: Vec<[f64; 2]> = config.joints.iter().map(|joint| joint.travel_mm).collect();
            assert_eq!(ends, [[-1.0, 2.5], [0.0, 9.0], [-105.0, 5.0]]);
            let speeds: Vec<f64> = config.joints.iter().map(|joint| joint.limits.velocity_mm_s).collect();
            assert_eq!(speeds, [10.0, 150.0, 100.0]);
            assert_eq!((config.rt.require, config.bus.pres_lost_max), (require, lost));
        }
    }

    #[test]
    fn what_a_scan_finds_is_known_again() {
        let drive = Node {
            keys: "device_type = 0x00020192\nvendor_id = 0x2D\nproduct_code = 0x7\n".into(),
            ..plain(9, true)
        };
        let found = (Protocol::Powerlink, vec![plain(2, false), drive]);
        let config = read(&machine_file(&args(&["--scan", "eth1"]), Some(found)).unwrap());
        assert_eq!((config.joints.len(), config.bus.nodes[0].id), (1, 9));
        assert_eq!(config.bus.nodes[0].identity.vendor_id, Some(0x2D));
        assert_eq!(
            (config.bus.nodes[1].id, config.bus.nodes[1].identity.vendor_id),
            (2, None)
        );
    }

    #[test]
    fn what_makes_no_machine_is_refused() {
        let said = |options: &[&str], found| machine_file(&args(options), found).unwrap_err().to_string();
        assert!(said(&[], None).contains("--interface"));
        let two = said(&["--interface", "e", "--axes", "XY", "--drives", "1"], None);
        assert!(two.starts_with("2 axes (XY) and 1 drives"), "{two}");
        let still = Some((Protocol::Ethercat, vec![plain(1, false)]));
        assert!(said(&["--scan", "e", "--axes", "X"], still).starts_with("1 axes (X) and 0 drives"));
    }

    #[test]
    fn what_no_option_gives_is_asked_for_and_an_empty_line_is_the_usual() {
        let mut args = args(&["--name", "router"]);
        let mut said = Vec::new();
        let answers = "eth3\nxy\n\n10\n10000/5\n\n\n-1:99.5\n6000\n\ntry\n";
        ask(&mut args, None, &mut answers.as_bytes(), &mut said).unwrap();
        let said = String::from_utf8(said).unwrap();
        assert!(
            !said.contains("Name") && said.contains("Node ids of their drives [1,2]: "),
            "{said}"
        );
        let config = read(&machine_file(&args, None).unwrap());
        assert_eq!((&*config.name, &*config.bus.interface), ("router", "eth3"));
        assert_eq!((config.joints.len(), config.bus.nodes.len()), (2, 3));
        let [x, y] = &config.joints[..] else { panic!("two") };
        assert_eq!((x.travel_mm, y.travel_mm), ([-5.0, 205.0], [-1.0, 99.5]));
        assert_eq!((x.limits.velocity_mm_s, y.limits.velocity_mm_s), (100.0, 1000.0 / 60.0));
        assert_eq!(
            (config.rt.require, config.rt.late_max_us),
            (config::Require::Warn, Some(500))
        );
        for (answers, why) in [
            ("e\nx\n\n\n1000/0\n", "1000/0: expected increments"),
            ("e\nx\n\n\n\n5:5\n", "5:5: expected the lower and the upper end"),
            ("e\nx\n\n\n\n\n0\n", "0: expected a speed above 0"),
            ("e\nx\n\n\n\n\n\nperhaps\n", "perhaps: expected machine or try"),
        ] {
            let mut args = self::args(&["--name", "router"]);
            let refused = ask(&mut args, None, &mut answers.as_bytes(), &mut Vec::new()).unwrap_err();
            assert!(refused.to_string().starts_with(why), "{refused}");
        }

        let ended = ask(&mut self::args(&[]), None, &mut "mill\n".as_bytes(), &mut Vec::new()).unwrap_err();
        assert!(ended.to_string().contains("nothing is written"), "{ended}");
        let wrong = ask(
            &mut self::args(&[]),
            None,
            &mut "m\ne\nX\nfour\n".as_bytes(),
            &mut Vec::new(),
        )
        .unwrap_err();
        assert!(format!("{wrong:#}").contains("four: no node id"), "{wrong:#}");
    }
}
