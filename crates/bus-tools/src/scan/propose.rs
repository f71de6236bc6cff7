//! `isocnc bus scan --write FILE`: nodes of a machine file from what answers.
//!
//! In:  answers of the nodes; how many inputs and outputs they have, by SDO; device files of a folder.
//! Out: a new machine file of nodes, their channels and names; or those that a file does not have yet, added to it. Nothing of a
//!      file is replaced.

use super::super::station::{Found, Parameters, Station};
use super::super::{Protocol, words};
use crate::proposal::{Node, Proposal};
use anyhow::{Context, bail, ensure};
use config::{self, Identity, Mapped};
use obd::device::{self, DeviceDescription};
use powerlink::sdo::ClientError;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use terminal::refusal::Refusal;

/// The profile in a device type (0x1000).
const PROFILE_IO: u32 = 401;
const PROFILE_DRIVE: u32 = 402;
/// Objects of CiA 401 that are asked for: index, bits of one, whether it is an output, name of its channels.
const OBJECTS: [(u16, u8, bool, &str); 4] = [
    (0x6000, 8, false, "input"),
    (0x6401, 16, false, "analog-input"),
    (0x6200, 8, true, "output"),
    (0x6411, 16, true, "analog-output"),
];
/// More objects of one kind than that are left to the user: payload and file stay small.
const OBJECTS_MAX: u8 = 32;
/// Largest device file that is looked at, octets.
pub(crate) const DEVICE_FILE_MAX: u64 = 4 * 1024 * 1024;

/// A node as it will stand in the file.
#[derive(Debug, PartialEq)]
pub(super) struct Module {
    pub(super) id: u8,
    pub(super) name: String,
    /// What it calls itself, where that is a name.
    own_name: Option<String>,
    is_drive: bool,
    identity: Identity,
    /// How many objects of each of [`OBJECTS`] it has, and how many of them will stand in the file.
    has: [u8; OBJECTS.len()],
    counts: [u8; OBJECTS.len()],
    /// Its device file, as the machine file names it.
    device_file: Option<String>,
}

pub(super) fn identity(found: &Found) -> Identity {
    let ident = &found.ident;
    Identity {
        device_type: Some(ident.device_type),
        vendor_id: Some(ident.vendor_id),
        product_code: Some(ident.product_code),
        revision: Some(ident.revision),
        serial: Some(ident.serial),
    }
}

/// What a node has, asked by SDO; `None`: neither a drive nor inputs and outputs.
///
/// # Errors
/// The link, or a node that stops answering.
pub(super) fn ask(
    station: Station,
    found: &Found,
    names: &mut Vec<String>,
    devices: &[(String, DeviceDescription)],
) -> anyhow::Result<(Station, Option<Module>)> {
    let is_drive = match found.ident.device_type & 0xFFFF {
        PROFILE_DRIVE => true,
        PROFILE_IO => false,
        _ => return Ok((station, None)),
    };
    let mut has = [0; OBJECTS.len()];
    let station = match is_drive {
        true => station,
        false => {
            let mut node = Parameters::new(station, *found);
            for (count, (index, ..)) in has.iter_mut().zip(OBJECTS) {
                let mut value = [0; 8];
                let started = node.client().start_read(index, 0);
                started.with_context(|| format!("node {}", found.id))?;
                // What it does not have, it refuses.
                match node.run(&[], &mut value)? {
                    Ok(0) | Err(ClientError::Aborted(_)) => {}
                    Ok(_) => *count = value[0],
                    Err(error) => bail!("node {}: {index:04X}h: {error}", found.id),
                }
            }
            node.close()?;
            node.into_station()
        }
    };
    let own = words::text(&found.ident.host_name)
        .to_ascii_lowercase()
        .replace([' ', '_'], "-");
    let plain = format!("{}-{}", if is_drive { "drive" } else { "io" }, found.id);
    // Another node may be called that.
    let numbered = (2..).map(|number| format!("{plain}-{number}"));
    let own_name = Some(own).filter(|own| config::is_name(own));
    let name = if let Some(own) = own_name.clone().filter(|own| !names.contains(own)) {
        own
    } else {
        let mut free = std::iter::once(plain.clone()).chain(numbered);
        free.find(|name| !names.contains(name)).unwrap_or(plain)
    };
    names.push(name.clone());
    let fits = |(_, device): &&(String, DeviceDescription)| {
        let identity = &device.identity;
        let same = (identity.vendor_id, identity.product_code);
        same == (Some(found.ident.vendor_id), Some(found.ident.product_code))
    };
    let device_file = devices.iter().find(fits).map(|(file, _)| file.clone());
    let module = Module {
        id: found.id,
        name,
        own_name,
        is_drive,
        identity: identity(found),
        has,
        counts: has.map(|count| count.min(OBJECTS_MAX)),
        device_file,
    };
    Ok((station, Some(module)))
}

/// Device files of a folder, named as seen from the folder of the machine file; what cannot be read as one is left out.
///
/// # Errors
/// The folder.
pub(super) fn devices(folder: &Path, machine_file: &Path) -> anyhow::Result<Vec<(String, DeviceDescription)>> {
    let parse = |path: &str, octets: &[u8]| device::parse(path, octets).ok();
    device_files(folder, machine_file, &["xdd", "xdc", "eds", "dcf"], parse)
}

/// The same of any kind of device file.
///
/// # Errors
/// The folder.
pub(crate) fn device_files<T>(
    folder: &Path,
    machine_file: &Path,
    extensions: &[&str],
    parse: impl Fn(&str, &[u8]) -> Option<T>,
) -> anyhow::Result<Vec<(String, T)>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("{}: cannot be read", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    let is_device = |path: &PathBuf| {
        let extension = path.extension().and_then(|extension| extension.to_str());
        extension.is_some_and(|it| extensions.contains(&it.to_ascii_lowercase().as_str()))
    };
    let beside = machine_file.parent().filter(|parent| !parent.as_os_str().is_empty());
    let beside = beside.unwrap_or(Path::new(".")).canonicalize().unwrap_or_default();
    let read = |path: PathBuf| {
        let octets = files::read(&path, DEVICE_FILE_MAX).ok()?;
        let device = parse(&path.display().to_string(), &octets)?;
        let whole = path.canonicalize().ok()?;
        let named = whole.strip_prefix(&beside).unwrap_or(&whole);
        Some((named.display().to_string(), device))
    };
    Ok(paths.into_iter().filter(is_device).filter_map(read).collect())
}

impl Module {
    /// What of it does not stand in the file, in words.
    pub(super) fn left_out(&self) -> impl Iterator<Item = String> {
        let kinds = OBJECTS.iter().zip(self.has.iter().zip(self.counts));
        let cut = kinds.filter(|(_, (has, count))| **has > *count);
        cut.map(|((index, ..), (has, count))| {
            format!(
                "{} (node {}): of {has} objects {index:04X}h the first {count} are in the file; add those that are wanted\n",
                self.name, self.id
            )
        })
    }

    fn objects(&self, output: bool) -> Vec<(Mapped, &'static str, u8)> {
        let kinds = OBJECTS
            .iter()
            .zip(self.counts)
            .filter(|((_, _, is_output, _), _)| *is_output == output);
        kinds
            .flat_map(|((index, bits, _, name), count)| {
                (1..=count).map(|sub| {
                    let object = Mapped {
                        index: *index,
                        sub,
                        bits: *bits,
                    };
                    (object, *name, sub - 1)
                })
            })
            .collect()
    }

    /// Its `[[bus.node]]`.
    fn text(&self) -> String {
        self.node().text(&self.name)
    }

    /// As a node of a new file.
    pub(super) fn node(&self) -> Node {
        Node {
            id: self.id,
            name: self.own_name.clone(),
            is_drive: self.is_drive,
            keys: self.keys(),
        }
    }

    fn keys(&self) -> String {
        let mut text = String::new();
        let hex = |value: Option<u32>| format!("0x{:08X}", value.unwrap_or_default());
        let identity = &self.identity;
        text += &format!(
            "device_type = {}\nvendor_id = {}\nproduct_code = {}\n",
            hex(identity.device_type),
            hex(identity.vendor_id),
            hex(identity.product_code)
        );
        text += &format!(
            "# serial = {}              # no other one of the same type may stand in its place\n",
            identity.serial.unwrap_or_default()
        );
        if let Some(file) = &self.device_file {
            text += &format!("device_file = {}\n", toml::Value::from(file.as_str()));
        }
        if self.is_drive {
            return text;
        }
        for (key, output) in [("inputs", false), ("outputs", true)] {
            let objects: Vec<String> = self
                .objects(output)
                .iter()
                .map(|(object, ..)| format!("\"{object}\""))
                .collect();
            text += &format!("{key} = [{}]\n", objects.join(", "));
        }
        text += "\n";
        for (object, kind, number) in self.objects(false).into_iter().chain(self.objects(true)) {
            let place = format!("object = \"0x{:04X}:{}\"", object.index, object.sub);
            if object.bits > 8 {
                text += &format!("[[bus.node.channel]]\nname = \"{kind}-{number}\"\n{place}\ntype = \"analog\"\n\n");
                continue;
            }
            for bit in 0..u32::from(object.bits) {
                let number = u32::from(number) * 8 + bit;
                text += &format!("[[bus.node.channel]]\nname = \"{kind}-{number:02}\"\n{place}\nbit = {bit}\n\n");
            }
        }
        text
    }
}

/// A machine file of these nodes, named after its own.
///
/// # Errors
/// None that nodes alone could have.
pub(crate) fn new_file(nodes: Vec<Node>, bus: Protocol, path: &Path, interface: &str) -> anyhow::Result<String> {
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    let proposal = Proposal {
        by: "isocnc bus scan",
        name: stem.filter(|stem| config::is_name(stem)).unwrap_or("machine"),
        bus,
        interface,
        cycle_us: 1000,
        axes: None,
        travels: &[],
        to_try: false,
        with_nets: false,
    };
    proposal.machine_file(nodes)
}

/// The text of a file with more nodes behind all that is there.
pub(crate) fn added(text: &str, nodes: impl Iterator<Item = String>) -> String {
    let gap = if text.ends_with('\n') { "\n" } else { "\n\n" };
    let mut whole = format!("{text}{gap}# Added by `isocnc bus scan`.\n");
    whole.extend(nodes);
    whole.truncate(whole.trim_end().len());
    whole.push('\n');
    whole
}

/// What becomes of a file.
pub(crate) enum Written {
    New(usize),
    Added(usize),
    Unchanged,
}

/// Writes the file, or adds to it what it does not have.
///
/// # Errors
/// A file that is there without `add`, one that is wrong already, or what makes no machine.
pub(super) fn write(path: &Path, add: bool, modules: Vec<Module>, interface: &str) -> anyhow::Result<Written> {
    let file = path.display();
    let (text, written) = if std::fs::symlink_metadata(path).is_ok() {
        ensure!(
            add,
            "{file} is there already, nothing was written: --add adds the nodes that it does not have, and keeps all else"
        );
        let config = config::read(path).map_err(Refusal::from)?;
        let is_new = |module: &Module| {
            let nodes = &config.bus.nodes;
            let is_there = nodes.iter().any(|node| node.id == module.id);
            // One that has moved is the same module.
            let moved = nodes
                .iter()
                .any(|node| node.identity.serial.is_some() && node.identity.fits(&module.identity));
            !is_there && !moved
        };
        let mut modules: Vec<Module> = modules.into_iter().filter(is_new).collect();
        for module in &mut modules {
            if config.bus.nodes.iter().any(|node| node.name == module.name) {
                module.name = format!("{}-{}", if module.is_drive { "drive" } else { "io" }, module.id);
            }
        }
        if modules.is_empty() {
            return Ok(Written::Unchanged);
        }
        let text = files::read_text(path, files::read::TEXT_MAX).with_context(|| format!("{file}: cannot be read"))?;
        (
            added(&text, modules.iter().map(Module::text)),
            Written::Added(modules.len()),
        )
    } else {
        if modules.is_empty() {
            bail!("no drive and no inputs or outputs answered: nothing to write");
        }
        let count = modules.len();
        let nodes = modules.iter().map(Module::node).collect();
        (
            new_file(nodes, Protocol::Powerlink, path, interface)?,
            Written::New(count),
        )
    };
    // Never a file that would be refused.
    let config = config::parse(&text, path).map_err(Refusal::from)?;
    bus::check(&config).map_err(Refusal::from)?;
    files::write(path, text).with_context(|| format!("{file}: cannot be written"))?;
    Ok(written)
}

/// What was done, in words.
pub(crate) fn told(path: &Path, written: &Written) -> String {
    let (file, nodes) = (path.display(), |count: &usize| words::counted(*count as u64, "node"));
    let mut text = String::new();
    // A String takes everything.
    let _ = match written {
        Written::New(count) => writeln!(text, "{file} is written: {}. Next: isocnc check {file}", nodes(count)),
        Written::Added(count) => writeln!(
            text,
            "{file}: {} added, all else kept. Next: isocnc check {file}",
            nodes(count)
        ),
        Written::Unchanged => writeln!(text, "{file} has them all: not changed"),
    };
    text
}
