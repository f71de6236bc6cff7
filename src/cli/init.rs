//! `isocnc init`: a machine file to begin with.
//!
//! In:  options, answers of the user, or the nodes that answer on an interface; `configs/mill3-powerlink.toml`, whose comments and
//! values the new file has.
//! Out: a machine file that `isocnc check` accepts. It is written at once at the end: what is given up before leaves nothing.

use super::bus::scan;
use crate::host::terminal::say;
use crate::operator::refusal::Refusal;
use crate::{bus, config};
use anyhow::{Context, bail, ensure};
use clap::Args;
use std::fmt::Write as _;
use std::io::{BufRead, IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;

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
    /// Take the nodes that answer on this interface; nothing is sent where a managing node is at work
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

const EXAMPLE: &str = include_str!("../../configs/mill3-powerlink.toml");
/// What the example is called and where it is.
const EXAMPLE_NAME: &str = "\"mill3\"";
const EXAMPLE_INTERFACE: &str = "\"enp2s0\"";
const EXAMPLE_CYCLE: &str = "cycle_us = 1000";
/// The profile in a device type (0x1000).
const PROFILE_IO: u32 = 401;
const PROFILE_DRIVE: u32 = 402;
/// Axes of a machine that says nothing else, as many as it has drives.
const LETTERS: &str = "XYZABCUVW";

/// A node of the new machine.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    id: u8,
    is_drive: bool,
    /// Keys by which it is known again.
    identity: String,
}

impl Node {
    /// One of which nothing but its id is known.
    fn new(id: u8, is_drive: bool) -> Node {
        let identity = String::new();
        Node { id, is_drive, identity }
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
    let found = args.scan.as_deref().map(nodes_on).transpose()?;
    if std::io::stdin().is_terminal() && !args.yes {
        let count = found
            .as_ref()
            .map(|nodes| nodes.iter().filter(|node| node.is_drive).count());
        ask(&mut args, count, &mut std::io::stdin().lock(), &mut std::io::stdout())?;
    }
    let text = machine_file(&args, found)?;
    let config = config::parse(&text, &args.file).map_err(Refusal::from)?;
    bus::check(&config).map_err(Refusal::from)?;
    ensure!(
        args.force || !is_there(),
        "{file} has come meanwhile; --force replaces it"
    );
    files::write(&args.file, text).with_context(|| format!("{file}: cannot be written"))?;
    say(&format!(
        "{file} is written. Scale, travel, limits and homing of each joint are those of an example: set them to those of the\n\
         machine, then: isocnc check {file}\n"
    ));
    Ok(ExitCode::SUCCESS)
}

/// The drives and the inputs and outputs that answer on an interface.
fn nodes_on(interface: &str) -> anyhow::Result<Vec<Node>> {
    let found = scan::nodes_on(interface)?;
    let mut nodes = Vec::new();
    for found in found {
        let ident = &found.ident;
        let is_drive = match ident.device_type & 0xFFFF {
            PROFILE_DRIVE => true,
            PROFILE_IO => false,
            profile => {
                say(&format!(
                    "node {} is left out: its profile is {profile}, neither 401 nor 402\n",
                    found.id
                ));
                continue;
            }
        };
        let identity = format!(
            "device_type = 0x{:08X}\nvendor_id = 0x{:08X}\nproduct_code = 0x{:08X}\n",
            ident.device_type, ident.vendor_id, ident.product_code
        );
        nodes.push(Node {
            id: found.id,
            is_drive,
            identity,
        });
    }
    Ok(nodes)
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
    Ok(())
}

fn usual_name(args: &InitArgs) -> String {
    let stem = args.file.file_stem().and_then(|stem| stem.to_str());
    stem.filter(|stem| !stem.is_empty()).unwrap_or("machine").to_owned()
}

fn letters(count: usize) -> String {
    LETTERS.chars().take(count).collect()
}

/// The text of the machine file. `found`: nodes of a scan.
fn machine_file(args: &InitArgs, found: Option<Vec<Node>>) -> anyhow::Result<String> {
    let Some(interface) = args.scan.as_ref().or(args.interface.as_ref()) else {
        bail!("which network interface? --interface IF names it, --scan IF asks it for its nodes");
    };
    let mut nodes = found.unwrap_or_else(|| {
        let usual = args.axes.as_deref().map_or(3, |axes| axes.chars().count()) as u8;
        let ids = if args.drives.is_empty() {
            (1..=usual).collect()
        } else {
            args.drives.clone()
        };
        let drives = ids.into_iter().map(|id| Node::new(id, true));
        drives.chain(args.io.iter().map(|id| Node::new(*id, false))).collect()
    });
    nodes.sort_by_key(|node| !node.is_drive);
    let drives: Vec<&Node> = nodes.iter().filter(|node| node.is_drive).collect();
    let axes = args
        .axes
        .clone()
        .map_or_else(|| letters(drives.len()), |axes| axes.to_ascii_uppercase());
    let count = axes.chars().count();
    ensure!(
        count == drives.len() && count > 0,
        "{count} axes ({axes}) and {} drives: each axis has one drive; more drives of an axis are added in the file",
        drives.len()
    );
    let quoted = |text: &str| toml::Value::from(text).to_string();
    let between = |from: &str, to: &str| -> &'static str {
        let rest = EXAMPLE.split_once(from).map_or("", |(_, rest)| rest);
        rest.split_once(to).map_or(rest, |(part, _)| part)
    };
    let name = args.name.clone().unwrap_or_else(|| usual_name(args));
    let head = between("schema = 1", "[[bus.node]]");
    let head = head.replacen(EXAMPLE_NAME, &quoted(&name), 1);
    let head = head.replacen(EXAMPLE_INTERFACE, &quoted(interface), 1);
    let head = head.replacen(EXAMPLE_CYCLE, &format!("cycle_us = {}", args.cycle_us), 1);
    let mut text = format!(
        "# Written by `isocnc init`: set scale, travel, limits and homing of each joint to those of the machine.\n\
         # `isocnc check` names every mistake; `isocnc schema > machine.schema.json` and a first line\n\
         # `#:schema ./machine.schema.json` show in an editor what each key means.\nschema = 1{head}"
    );
    for node in &nodes {
        let letter = drives
            .iter()
            .position(|drive| *drive == node)
            .and_then(|joint| axes.chars().nth(joint));
        let (name, profile) = match letter {
            Some(letter) => (format!("{}-drive", letter.to_ascii_lowercase()), "cia402"),
            None => (format!("io-{}", node.id), "io"),
        };
        let id = node.id;
        write!(
            text,
            "[[bus.node]]\nid = {id}\nname = \"{name}\"\nprofile = \"{profile}\"\n{}\n",
            node.identity
        )?;
    }
    // Three joints stand there: one with remarks, a plain one, and one that homes upward.
    let joints: Vec<&str> = between("[[joint]]\n", "[[axis]]").split("[[joint]]\n").collect();
    for (letter, drive) in axes.chars().zip(&drives) {
        let joint = joints[if letter == 'Z' { 2 } else { 1 }];
        let keys = joint.split_once('\n').map_or("", |(_, keys)| keys);
        write!(text, "# {letter}\n[[joint]]\nnode = {}\n{keys}", drive.id)?;
    }
    for (joint, letter) in axes.chars().enumerate() {
        write!(text, "[[axis]]\nletter = \"{letter}\"\njoints = [{joint}]\n\n")?;
    }
    let zeros: Vec<String> = axes
        .to_ascii_lowercase()
        .chars()
        .map(|letter| format!("{letter} = 0.0"))
        .collect();
    write!(
        text,
        "[offsets]\ng54 = {{ {} }}\n\n[spindle]{}",
        zeros.join(", "),
        between("[spindle]", "# I/O as")
    )?;
    if let Some(io) = nodes.iter().find(|node| !node.is_drive) {
        let nets = between("# I/O as", "\u{0}").replace("io.10.", &format!("io.{}.", io.id));
        write!(text, "# I/O as{nets}")?;
    }
    Ok(text)
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
    fn the_example_has_all_that_is_taken_from_it() {
        for part in [
            EXAMPLE_NAME,
            EXAMPLE_INTERFACE,
            EXAMPLE_CYCLE,
            "schema = 1",
            "[spindle]",
            "# I/O as",
        ] {
            assert_eq!(EXAMPLE.matches(part).count(), 1, "{part}");
        }
        assert_eq!(EXAMPLE.matches("[[joint]]\nnode = ").count(), 3);
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
    fn what_a_scan_finds_is_known_again() {
        let drive = Node {
            identity: "device_type = 0x00020192\nvendor_id = 0x2D\nproduct_code = 0x7\n".into(),
            ..Node::new(9, true)
        };
        let found = vec![Node::new(2, false), drive];
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
        assert!(said(&["--scan", "e"], Some(vec![Node::new(1, false)])).starts_with("0 axes"));
    }

    #[test]
    fn what_no_option_gives_is_asked_for_and_an_empty_line_is_the_usual() {
        let mut args = args(&["--name", "router"]);
        let mut said = Vec::new();
        ask(&mut args, None, &mut "eth3\nxy\n\n10\n".as_bytes(), &mut said).unwrap();
        let said = String::from_utf8(said).unwrap();
        assert!(
            !said.contains("Name") && said.contains("Node ids of their drives [1,2]: "),
            "{said}"
        );
        let config = read(&machine_file(&args, None).unwrap());
        assert_eq!((&*config.name, &*config.bus.interface), ("router", "eth3"));
        assert_eq!((config.joints.len(), config.bus.nodes.len()), (2, 3));

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
