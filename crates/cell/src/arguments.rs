//! The command line of `isocnc-cell`.

use cell::plan;
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use std::net::SocketAddr;
use std::path::PathBuf;

/// The supervisor of a cell of machines.
#[derive(Parser)]
#[command(name = "isocnc-cell", version)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Args)]
pub(super) struct Dir {
    /// State folder of the supervisor.
    #[arg(long, value_name = "STATE")]
    pub(super) dir: PathBuf,
    /// For programs.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Subcommand)]
pub(super) enum Command {
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
    /// Runs a line of MDI on a machine that is free and allows it.
    Mdi {
        name: String,
        line: String,
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
    /// Inputs and outputs that the machine files name, of all machines or of one.
    Ports {
        /// Only of this machine.
        name: Option<String>,
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
    /// Prints the script by which a shell completes commands and options.
    Completions {
        #[arg(value_enum)]
        shell: Shell,
    },
    /// Writes pages of the manual, one for each command.
    Man {
        /// Folder for the pages; made where it is not there.
        folder: PathBuf,
    },
}

#[derive(Subcommand)]
pub(super) enum CaCommand {
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
pub(super) enum Change {
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
