//! `isocnc bus scan`: who is on an interface.
//!
//! In:  an interface. Out: where a managing node is at work, what is heard of it and its nodes; else every node that answers
//! an IdentRequest; a machine file of them (`propose`), or how they differ from one.

pub(super) mod propose;

use super::Protocol;
use super::station::{ForeignMaster, Found, Station, listen};
use super::trace::Heard;
use super::words;
use crate::proposal::Node;
use ::terminal::refusal::Refusal;
use anyhow::ensure;
use api::client;
use bus::sender::SoleSender;
use bus::service::IdentityView;
use clap::Args;
use host::terminal::{self, StatusLine};
use machine::modules::Modules;
use obd::device::DeviceDescription;
use powerlink::link::Link;
use powerlink::link::raw::{RawConfig, RawLink};
use powerlink::wire::Mac;
use protocol::method;
use protocol::params::NoParams;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `bus scan`.
#[derive(Clone, Debug, Args)]
pub struct ScanArgs {
    /// Network interface
    #[arg(long, value_name = "IF")]
    pub(super) interface: String,
    /// What the interface carries; left out: POWERLINK is tried, and where nobody answers EtherCAT
    #[arg(long, value_enum)]
    pub(super) bus: Option<Protocol>,
    /// Listen this long for a managing node before sending anything, and where there is one, to it
    #[arg(long, value_name = "S", default_value = "1", value_parser = super::listen_time)]
    pub(super) listen: f64,
    /// Give each node this long to answer
    #[arg(long, value_name = "US", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    pub(super) answer_us: u32,
    /// Write a machine file of the nodes, their channels and names; what is there is never replaced
    #[arg(long, value_name = "FILE")]
    pub(super) write: Option<PathBuf>,
    /// Add the nodes that FILE does not have, and keep all else
    #[arg(long, requires = "write")]
    pub(super) add: bool,
    /// Folder of device files (XDD, XDC, EDS, DCF; of EtherCAT ESI, XML): those that fit are named in FILE
    #[arg(long, value_name = "FOLDER", requires = "write")]
    pub(super) devices: Option<PathBuf>,
}

/// Runs the command. Exit code 1: a managing node is at work, nobody answers, or two nodes have the same id.
///
/// # Errors
/// The interface.
pub(super) fn scan(args: &ScanArgs, as_json: bool, out: &mut impl Write) -> anyhow::Result<ExitCode> {
    if args.bus != Some(Protocol::Ethercat) {
        let link = open(&args.interface, Protocol::Powerlink)?;
        let mac = link.mac();
        let scanned = ask(Box::new(link), mac, Some(&args.interface), args, as_json)?;
        if args.bus.is_some() || !scanned.is_empty() {
            return tell(scanned, args, as_json, out);
        }
    }
    let mut link = open(&args.interface, Protocol::Ethercat)?;
    let mac = link.mac();
    let _sole = SoleSender::claim(&args.interface)?;
    super::ethercat::scan::scan_on(&mut link, mac, args, as_json, out)
}

/// A link that hears all nodes, also what is sent to another one.
///
/// # Errors
/// A control of this PC is at work on it: it would not be heard, because a socket does not hear what its own PC sends.
pub(super) fn open(interface: &str, bus: Protocol) -> anyhow::Result<RawLink> {
    for (machine, mut client) in client::all() {
        // A control that does not answer is not known to be at work here.
        let (Ok(status), Ok(network)) = (
            client.ask::<method::Status>(&NoParams {}),
            client.ask::<method::Network>(&NoParams {}),
        ) else {
            continue;
        };
        ensure!(
            network.0["interface"] != interface || !sees_our_interfaces(status.pid),
            "the control of machine \"{machine}\" is at work on {interface}: ask it, without --interface and with \
             --machine {machine}"
        );
    }
    let config = RawConfig {
        every_ether_type: bus == Protocol::Ethercat,
        promiscuous: true,
        ..RawConfig::default()
    };
    Ok(RawLink::open(interface, config)?)
}

/// Whether a process is in our network namespace: in another one, interfaces of the same name are others.
fn sees_our_interfaces(pid: u32) -> bool {
    let namespace = |process: &str| std::fs::read_link(format!("/proc/{process}/ns/net")).ok();
    let (own, other) = (namespace("self"), namespace(&pid.to_string()));
    // What cannot be told apart is taken for the same.
    own.is_none() || other.is_none() || own == other
}

/// Where neither bus has anybody.
pub(super) const NOBODY_ON_BOTH: &str = "nobody answers, neither nodes of POWERLINK nor devices of EtherCAT: are they on, connected to this \
     interface (EtherCAT: by the port IN of the first one), and its link up? ('ip link')";

/// What a scan comes to.
enum Scanned {
    /// A managing node is at work; nothing was sent.
    Foreign(ForeignMaster, Box<Heard>),
    Nodes(Vec<Found>, Box<Station>),
}

impl Scanned {
    /// Nobody was heard and nobody answered.
    fn is_empty(&self) -> bool {
        matches!(self, Scanned::Nodes(found, _) if found.is_empty())
    }
}

/// Nodes of a new machine file, of all that answer on an interface, and their bus: POWERLINK, or EtherCAT where nobody does.
///
/// # Errors
/// The interface; a master that is at work there, nobody who answers, or two nodes of one id.
pub(crate) fn nodes_on(interface: &str) -> anyhow::Result<(Protocol, Vec<Node>)> {
    let args = ScanArgs {
        interface: interface.to_owned(),
        bus: None,
        listen: 1.0,
        answer_us: 2000,
        write: None,
        add: false,
        devices: None,
    };
    let link = open(interface, Protocol::Powerlink)?;
    let mac = link.mac();
    match ask(Box::new(link), mac, Some(interface), &args, false)? {
        Scanned::Foreign(foreign, _) => anyhow::bail!("{foreign}: nothing was asked"),
        Scanned::Nodes(found, station) if !found.is_empty() => {
            if let Some(trouble) = troubles(&found).first() {
                anyhow::bail!("{trouble}");
            }
            let (modules, left_out) = modules_of(*station, &found, &[], &mut Vec::new(), &[])?;
            terminal::say(&left_out.iter().map(|told| format!("{told}\n")).collect::<String>());
            return Ok((Protocol::Powerlink, modules.iter().map(propose::Module::node).collect()));
        }
        Scanned::Nodes(..) => {}
    }
    let mut link = open(interface, Protocol::Ethercat)?;
    let mac = link.mac();
    let _sole = SoleSender::claim(interface)?;
    let nodes = super::ethercat::scan::nodes_on(&mut link, mac, (args.listen * 1e9) as u64)?;
    anyhow::ensure!(!nodes.is_empty(), NOBODY_ON_BOTH);
    Ok((Protocol::Ethercat, nodes))
}

fn ask(
    mut link: Box<dyn Link>,
    mac: Mac,
    interface: Option<&str>,
    args: &ScanArgs,
    as_json: bool,
) -> anyhow::Result<Scanned> {
    let mut heard = Heard::default();
    let listen_ns = (args.listen * 1e9) as u64;
    let foreign = listen(&mut *link, listen_ns, &mut |now_ns, frame| heard.add(now_ns, frame))?;
    if let Some(foreign) = foreign {
        return Ok(Scanned::Foreign(foreign, Box::new(heard)));
    }
    // Listened already.
    let mut station = Station::take_over(link, mac, interface, 0)?;
    let progress = StatusLine::beside_output("asking node {pos}", as_json);
    let found = station.scan(u64::from(args.answer_us) * 1000, &mut |id| {
        progress.set_position(id.into())
    })?;
    drop(progress);
    Ok(Scanned::Nodes(found, Box::new(station)))
}

/// Prints what a scan has come to, and writes the machine file that is asked for.
fn tell(scanned: Scanned, args: &ScanArgs, as_json: bool, out: &mut impl Write) -> anyhow::Result<ExitCode> {
    let (found, station) = match scanned {
        Scanned::Nodes(found, station) => (found, *station),
        Scanned::Foreign(foreign, heard) => {
            tell_foreign(foreign, *heard, args, as_json, out)?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let mut trouble = troubles(&found);
    let mut written = None;
    if let (Some(path), true) = (&args.write, trouble.is_empty()) {
        let (text, differences) = write(path, args, &found, station)?;
        trouble.extend(differences);
        written = Some(text);
    }
    match as_json {
        true => {
            let nodes = found.iter().map(|found| {
                json!({
                    "node": found.id,
                    "mac": words::mac(found.mac),
                    "nmt_state": words::state(found.ident.nmt_state),
                    "identity": IdentityView::from(&found.ident),
                })
            });
            let nodes = nodes.collect::<Vec<_>>();
            writeln!(
                out,
                "{:#}",
                json!({ "interface": args.interface, "bus": "powerlink", "nodes": nodes, "trouble": trouble, "written": written })
            )?;
        }
        false => {
            table(&args.interface, &found, &trouble, out)?;
            if let Some(written) = &written {
                write!(out, "\n{written}")?;
            }
        }
    }
    out.flush()?;
    Ok(if trouble.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Writes a machine file or adds to it: what was done, and what is otherwise than a file said that was there.
fn write(path: &Path, args: &ScanArgs, found: &[Found], station: Station) -> anyhow::Result<(String, Vec<String>)> {
    let mut differences = Vec::new();
    let (mut names, mut moved) = (Vec::new(), Vec::new());
    if std::fs::symlink_metadata(path).is_ok() {
        let config = config::read(path).map_err(Refusal::from)?;
        let identities: Vec<_> = found.iter().map(|found| (found.id, propose::identity(found))).collect();
        let found = Modules::new(&config).differences(&identities);
        if !args.add {
            let text = format!(
                "{} is there already and was not changed: --add adds the nodes that it does not have, and keeps all else\n",
                path.display()
            );
            return Ok((text, found.into_iter().map(|difference| difference.text).collect()));
        }
        names.extend(config.bus.nodes.iter().map(|node| node.name.clone()));
        // One that has moved is in the file already, and what is to be done about it is told; what is added is no longer strange.
        moved.extend(found.iter().filter_map(|difference| difference.moved_to));
        let stays = found.into_iter().filter(|difference| difference.stranger.is_none());
        differences.extend(stays.map(|difference| difference.text));
    }
    let devices = match &args.devices {
        Some(folder) => propose::devices(folder, path)?,
        None => Vec::new(),
    };
    let (modules, others) = modules_of(station, found, &moved, &mut names, &devices)?;
    differences.extend(others);
    let left_out: String = modules.iter().flat_map(propose::Module::left_out).collect();
    let written = propose::write(path, args.add, modules, &args.interface)?;
    Ok((propose::told(path, &written) + &left_out, differences))
}

/// What nodes have, but for those of `left_out`, and which are neither drives nor inputs and outputs.
///
/// # Errors
/// The link, or a node that stops answering.
fn modules_of(
    mut station: Station,
    found: &[Found],
    left_out: &[u8],
    names: &mut Vec<String>,
    devices: &[(String, DeviceDescription)],
) -> anyhow::Result<(Vec<propose::Module>, Vec<String>)> {
    let (mut modules, mut others) = (Vec::new(), Vec::new());
    for found in found.iter().filter(|found| !left_out.contains(&found.id)) {
        let (back, module) = propose::ask(station, found, names, devices)?;
        station = back;
        match module {
            Some(module) => modules.push(module),
            None => others.push(format!(
                "node {} is left out of the file: its profile is {}, neither 401 nor 402",
                found.id,
                found.ident.device_type & 0xFFFF
            )),
        }
    }
    Ok((modules, others))
}

fn tell_foreign(
    foreign: ForeignMaster,
    heard: Heard,
    args: &ScanArgs,
    as_json: bool,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    if as_json {
        let report = heard.into_json()?;
        let foreign = foreign.to_string();
        writeln!(
            out,
            "{:#}",
            json!({ "interface": args.interface, "managing_node": foreign, "heard": report })
        )?;
    } else {
        writeln!(out, "{foreign}.")?;
        writeln!(
            out,
            "Beside a control of this PC, 'isocnc bus nodes' shows more. Heard within {} s:\n",
            args.listen
        )?;
        heard.print(out)?;
    }
    Ok(out.flush()?)
}

fn troubles(found: &[Found]) -> Vec<String> {
    if found.is_empty() {
        return vec![
            "nobody answers: are the nodes on, connected to this interface, and its link up? ('ip link'); without --bus devices of \
             EtherCAT are looked for, too"
                .into(),
        ];
    }
    found
        .windows(2)
        .filter(|pair| pair[0].id == pair[1].id)
        .map(|pair| {
            format!(
                "two nodes have the id {}: {} and {}; give one of them another id",
                pair[0].id,
                words::mac(pair[0].mac),
                words::mac(pair[1].mac)
            )
        })
        .collect()
}

fn table(interface: &str, found: &[Found], trouble: &[String], out: &mut impl Write) -> std::io::Result<()> {
    if !found.is_empty() {
        let nodes = words::counted(found.len() as u64, "node");
        let rows = found.iter().map(|Found { id, mac, ident }| {
            let hex = |value: u32| format!("0x{value:08X}");
            vec![
                id.to_string(),
                words::mac(*mac),
                words::state(ident.nmt_state).to_string(),
                hex(ident.device_type),
                hex(ident.vendor_id),
                hex(ident.product_code),
                hex(ident.revision),
                ident.serial.to_string(),
                words::text(&ident.host_name),
            ]
        });
        let heading = [
            ">id",
            "address",
            "state",
            "device type",
            "vendor",
            "product",
            "revision",
            "serial",
            "name",
        ];
        write!(out, "{nodes} on {interface}\n\n{}", terminal::table(&heading, rows))?;
    }
    if !trouble.is_empty() && !found.is_empty() {
        writeln!(out)?;
    }
    trouble.iter().try_for_each(|trouble| writeln!(out, "{trouble}"))
}

#[cfg(test)]
mod tests;
