//! `isocnc bus`: what is on the network, how it is, and why something on it does not work.
//!
//! In:  a capture, an interface, or a running control.
//! Out: tables and sentences, or JSON, on standard output. Exit code 0: all is well, 1: trouble found, 2: wrong usage.
//!
//! `scan` and `init` make a machine file of the nodes that answer (`proposal.rs`). What sends on an interface claims it first
//! (`bus::sender`). `network/` prints what `api::network_view` says of a network.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod budget;
pub mod check;
mod ethercat;
pub mod init;
pub mod network;
mod proposal;
pub mod scan;
pub mod sdo;
pub mod station;
pub mod trace;
pub mod value;
pub mod words;

use clap::{Args, Subcommand, ValueEnum};
use network::{NetworkArgs, Topic};
use std::io::ErrorKind;
use std::process::ExitCode;

/// Which frames an interface carries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Protocol {
    /// Ethernet POWERLINK
    #[default]
    Powerlink,
    /// EtherCAT: nodes are counted from 1 along the cable; they are led to PRE-OP, asked, and left in INIT
    Ethercat,
}

impl Protocol {
    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Protocol::Powerlink => "POWERLINK",
            Protocol::Ethercat => "EtherCAT",
        }
    }
}

/// Arguments of `bus`.
#[derive(Clone, Debug, Args)]
pub struct BusArgs {
    /// Print JSON
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: BusCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum BusCommand {
    /// Who is on an interface: asks every node id or position; only listens where another master is at work
    #[command(
        after_help = "Example: isocnc bus scan --interface eth1\nExample: isocnc bus scan --bus ethercat --interface eth1 --write machine.toml"
    )]
    Scan(scan::ScanArgs),
    /// Who is on the network of a machine: identity, and whether it is the expected one
    #[command(after_help = "Example: isocnc bus nodes configs/mill3-powerlink.toml")]
    Nodes(NetworkArgs),
    /// How they are: states, lost answers, errors, and why a node is not operational
    #[command(after_help = "Example: isocnc bus state")]
    State(NetworkArgs),
    /// Which object is where in the cyclic frames
    #[command(after_help = "Example: isocnc bus pdo configs/mill3-powerlink.toml")]
    Pdo(NetworkArgs),
    /// Read and write objects of a node
    Sdo(sdo::SdoArgs),
    /// Everything about the network on one page, to paste
    #[command(after_help = "Example: isocnc bus report")]
    Report(NetworkArgs),
    /// A capture in words: one line a frame, or a summary
    #[command(after_help = "Example: isocnc bus trace capture.pcap --node 3 --from 1.5")]
    Trace(trace::TraceArgs),
}

/// Runs the command.
///
/// # Errors
/// What keeps it from looking: a file, an interface, a control that is not there.
pub fn bus(args: &BusArgs) -> anyhow::Result<ExitCode> {
    let mut out = files::printed::buffered();
    let done = match &args.command {
        BusCommand::Scan(scan) => scan::scan(scan, args.json, &mut out),
        BusCommand::Nodes(network) => network::show(network, Topic::Nodes, args.json, &mut out),
        BusCommand::State(network) => network::show(network, Topic::State, args.json, &mut out),
        BusCommand::Pdo(network) => network::show(network, Topic::Pdo, args.json, &mut out),
        BusCommand::Sdo(sdo) => sdo::sdo(sdo, args.json, &mut out),
        BusCommand::Report(network) => network::show(network, Topic::Report, args.json, &mut out),
        BusCommand::Trace(trace) => trace::trace(trace, args.json, &mut out),
    };
    match done {
        // The reader of a pipe may have seen enough.
        Err(error) if is_broken_pipe(&error) => Ok(ExitCode::SUCCESS),
        done => done,
    }
}

/// Seconds to listen before anything is sent: never so short that a managing node with a slow cycle is missed.
fn listen_time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.3..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("expected seconds from 0.3 to 3600".into()),
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let cause = error.downcast_ref::<std::io::Error>();
    cause.is_some_and(|cause| cause.kind() == ErrorKind::BrokenPipe)
}
