//! `isocnc bus scan --bus ethercat`: who is on an interface, and a machine file of them.
//!
//! In:  a link. Out: a table or JSON; with --write nodes, what they exchange and channels for each input and output.

use super::{Found, Lead, asked, lead, refuse_other};
use crate::proposal::Node as ProposedNode;
use crate::scan::propose::{self, Written};
use crate::scan::{NOBODY_ON_BOTH, ScanArgs};
use crate::{Protocol, words};
use ::terminal::refusal::Refusal;
use anyhow::{Context, bail, ensure};
use config::{self, Config, Identity, Mapped, Node};
use ethercat::wire::sii::Identity as SiiIdentity;
use host::terminal;
use machine::modules::Modules;
use obd::device::{EsiDevice, EsiEntry, EsiFile, EsiPdo, parse_esi};
use powerlink::link::Link;
use serde_json::json;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// The profile in a device type (0x1000).
const PROFILE_DRIVE: u32 = 402;
/// Assignment of outputs and of inputs.
const ASSIGNMENTS: [u16; 2] = [0x1C12, 0x1C13];

/// A device, and what it says of itself.
#[derive(Clone, Debug)]
pub(super) struct Module {
    pub(super) found: Found,
    device_type: Option<u32>,
    name: String,
    /// What it exchanges as it comes: outputs, inputs; `None`: not in whole octets.
    exchanges: [Option<Vec<Mapped>>; 2],
    /// Which bits of each octet of those are something, by its ESI file or its EEPROM; `None`: all, as far as is known.
    used: [Option<Vec<u8>>; 2],
    /// Why it tells nothing of itself.
    why: Option<String>,
    /// Its name in the machine file; empty: by its kind and position.
    node_name: String,
    /// Its ESI file, as the machine file names it.
    device_file: Option<String>,
    /// Objects that hold numbers with a sign, by its ESI file.
    signed: Vec<Mapped>,
    /// What numbers are, by its ESI file: counts, positions of encoders, duty cycles.
    numbers: Vec<(Mapped, Number)>,
}

/// What a number of a device is, as far as the names of its ESI file tell.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Number {
    Counter,
    /// Where it has one, with the object of the count at its last index.
    Encoder {
        latch: Option<Mapped>,
    },
    /// The count at the last index: it belongs to an encoder.
    Latch,
    Pwm,
}

/// Runs the command. Exit code 1: nobody answers, or a device does not come to PRE-OP.
///
/// # Errors
/// The link, another main device, a file that cannot be written.
pub(crate) fn scan_on(
    link: &mut dyn Link,
    mac: [u8; 6],
    args: &ScanArgs,
    as_json: bool,
    out: &mut impl Write,
) -> anyhow::Result<ExitCode> {
    let modules = modules_on(link, mac, (args.listen * 1e9) as u64)?;
    let mut trouble: Vec<String> = modules
        .iter()
        .filter_map(|module| Some(format!("position {}: {}", module.found.position, module.why.as_ref()?)))
        .collect();
    if modules.is_empty() {
        trouble.push(match args.bus {
            None => NOBODY_ON_BOTH.into(),
            Some(_) => {
                "nobody answers: are the devices on, is the cable in the port IN of the first one, and its link up? ('ip link'); \
                 without --bus nodes of POWERLINK are asked for, too"
                    .into()
            }
        });
    }
    let mut written = None;
    if let (Some(path), true) = (&args.write, trouble.is_empty()) {
        let (text, differences) = write(path, modules.clone(), args)?;
        trouble.extend(differences);
        written = Some(text);
    }
    if as_json {
        let nodes = modules.iter().map(Module::json).collect::<Vec<_>>();
        let all = json!({ "interface": args.interface, "bus": "ethercat", "nodes": nodes, "trouble": trouble, "written": written });
        writeln!(out, "{all:#}")?;
    } else {
        table(&args.interface, &modules, out)?;
        for trouble in &trouble {
            writeln!(out, "{trouble}")?;
        }
        if let Some(written) = &written {
            write!(out, "\n{written}")?;
        }
    }
    out.flush()?;
    Ok(match trouble.is_empty() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

/// All devices on a wire, and what they say of themselves.
///
/// # Errors
/// The link, another main device.
fn modules_on(link: &mut dyn Link, mac: [u8; 6], listen_ns: u64) -> anyhow::Result<Vec<Module>> {
    refuse_other(link, listen_ns)?;
    let found = lead(link, mac, &[], |lead| lead.find())?;
    let devices: Vec<_> = found.iter().map(|found| asked(found.position)).collect();
    lead(link, mac, &devices, |lead| {
        let why = lead.led(devices.len())?;
        let modules = found.iter().enumerate().map(|(device, found)| {
            let mut module = ask(lead, device, *found)?;
            let own = why.iter().find(|(of, _)| *of == device);
            module.why = own.map(|(_, error)| error.to_string());
            Ok(module)
        });
        let modules = modules.collect::<anyhow::Result<Vec<_>>>()?;
        lead.end()?;
        Ok(modules)
    })
}

/// Nodes of a new machine file, of all devices on a wire; none where nobody answers.
///
/// # Errors
/// The link, another main device, a device that does not come to PRE-OP.
pub(crate) fn nodes_on(link: &mut dyn Link, mac: [u8; 6], listen_ns: u64) -> anyhow::Result<Vec<ProposedNode>> {
    let modules = modules_on(link, mac, listen_ns)?;
    let failed = modules
        .iter()
        .find_map(|module| Some((module.found.position, module.why.as_ref()?)));
    if let Some((position, why)) = failed {
        bail!("position {position}: {why}");
    }
    Ok(nodes(&modules))
}

/// What a device says of itself.
pub(super) fn ask(lead: &mut Lead<'_, '_>, device: usize, found: Found) -> anyhow::Result<Module> {
    let mut module = Module {
        found,
        device_type: None,
        name: String::new(),
        exchanges: lead.octets(device).map(|octets| Some(plain(octets))),
        used: [None, None],
        why: None,
        node_name: String::new(),
        device_file: None,
        signed: Vec::new(),
        numbers: Vec::new(),
    };
    if !lead.has_objects(device) {
        // Of inputs and outputs that have no objects, those of the profile say what lies where.
        let [outputs, inputs] = &mut module.exchanges;
        for (objects, index) in [(outputs, 0x6200), (inputs, 0x6000)] {
            let own = objects.as_mut().into_iter().flatten();
            own.for_each(|object| object.index = index);
        }
        module.used = lead.used_bits(device);
        return Ok(module);
    }
    let mut number = |object| -> anyhow::Result<Option<u32>> {
        let value = lead.sdo(device, object, None)?.unwrap_or_default();
        let mut octets = [0; 4];
        let length = value.len().min(4);
        octets[..length].copy_from_slice(&value[..length]);
        Ok((length > 0).then_some(u32::from_le_bytes(octets)))
    };
    module.device_type = number((0x1000, 0))?;
    for (exchanges, assignment) in module.exchanges.iter_mut().zip(ASSIGNMENTS) {
        let mut objects = Some(Vec::new());
        for pdo in 1..=number((assignment, 0))?.unwrap_or(0).min(u32::from(u8::MAX)) as u8 {
            let Some(index) = number((assignment, pdo))? else {
                continue;
            };
            let index = index as u16;
            for sub in 1..=number((index, 0))?.unwrap_or(0).min(u32::from(u8::MAX)) as u8 {
                let entry = number((index, sub))?.unwrap_or(0);
                let object = Mapped {
                    index: (entry >> 16) as u16,
                    sub: (entry >> 8) as u8,
                    bits: entry as u8,
                };
                let is_whole = object.index >= 0x1000 && matches!(object.bits, 8 | 16 | 32 | 64);
                objects = objects.filter(|_| is_whole);
                objects
                    .iter_mut()
                    .for_each(|objects: &mut Vec<Mapped>| objects.push(object));
            }
        }
        *exchanges = objects;
    }
    let name = lead.sdo(device, (0x1008, 0), None)?.unwrap_or_default();
    module.name = words::text(&name);
    Ok(module)
}

/// So many octets, each an object.
fn plain(octets: u16) -> Vec<Mapped> {
    let object = |sub| Mapped {
        index: 0x6000,
        sub,
        bits: 8,
    };
    (1..=octets.min(u16::from(u8::MAX)) as u8).map(object).collect()
}

impl Module {
    fn is_drive(&self) -> bool {
        self.device_type.is_some_and(|of| of & 0xFFFF == PROFILE_DRIVE)
    }

    fn usual_name(&self) -> String {
        let kind = if self.is_drive() { "drive" } else { "io" };
        format!("{kind}-{}", self.found.position)
    }

    /// What it is, where it is: by its alias where the machine file goes by that.
    fn at(&self, config: &Config) -> (u8, Identity) {
        let Found {
            position,
            identity,
            alias,
        } = self.found;
        let mut nodes = config.bus.nodes.iter();
        let by_alias = |node: &&Node| node.ethercat.as_ref().and_then(|own| own.alias) == Some(alias);
        let id = nodes.find(by_alias).map_or(position, |node| node.id);
        let identity = Identity {
            device_type: self.device_type,
            vendor_id: Some(identity.vendor),
            product_code: Some(identity.product),
            revision: Some(identity.revision),
            serial: Some(identity.serial),
        };
        (id, identity)
    }

    /// Takes the names of what it exchanges from its ESI file, where that has as many octets as the device, and what of it has a sign.
    fn describe(&mut self, device: &EsiDevice) {
        let octets = |objects: &[Mapped]| objects.iter().map(|object| u32::from(object.bits) / 8).sum::<u32>();
        for ((own, used), is_output) in self.exchanges.iter_mut().zip(&mut self.used).zip([true, false]) {
            let Ok(of_file) = config::esi_assigned(device, is_output) else {
                continue;
            };
            let (of_file, bits): (Vec<Mapped>, Vec<u8>) = of_file.into_iter().unzip();
            if own.as_ref().is_none_or(|own| octets(own) == octets(&of_file)) {
                (*own, *used) = (Some(of_file), Some(bits));
            }
        }
        let entries = device
            .rx_pdos
            .iter()
            .chain(&device.tx_pdos)
            .flat_map(|pdo| &pdo.entries);
        // Names of IEC 61131-3, as ETG.2000 has them.
        let signed = entries.filter(|entry| matches!(entry.data_type.as_str(), "SINT" | "INT" | "DINT" | "LINT"));
        self.signed = signed.map(mapped).collect();
        self.numbers = device.tx_pdos.iter().flat_map(inputs).collect();
        self.numbers.extend(device.rx_pdos.iter().flat_map(outputs));
    }

    fn exchanges_nothing(&self) -> bool {
        self.exchanges
            .iter()
            .all(|objects| objects.as_ref().is_some_and(Vec::is_empty))
    }

    fn json(&self) -> serde_json::Value {
        let identity = self.found.identity;
        json!({
            "node": self.found.position,
            "alias": self.found.alias,
            "name": self.name,
            "device_type": self.device_type,
            "vendor_id": identity.vendor,
            "product_code": identity.product,
            "revision": identity.revision,
            "serial": identity.serial,
        })
    }

    /// Its `[[bus.node]]`.
    pub(super) fn text(&self) -> String {
        let name = match self.node_name.as_str() {
            "" => self.usual_name(),
            name => name.to_owned(),
        };
        self.node().text(&name)
    }

    /// What it calls itself, where that makes a name.
    fn own_name(&self) -> Option<String> {
        let plain = |c: char| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_lowercase()
            } else {
                '-'
            }
        };
        let name: String = self.name.chars().map(plain).collect();
        let name = name
            .split('-')
            .filter(|part| !part.is_empty())
            .collect::<Vec<_>>()
            .join("-");
        Some(name).filter(|name| config::is_name(name))
    }

    /// As a node of a new file.
    pub(super) fn node(&self) -> ProposedNode {
        ProposedNode {
            id: self.found.position,
            name: self.own_name(),
            is_drive: self.is_drive(),
            keys: self.keys(),
        }
    }

    fn keys(&self) -> String {
        let identity = self.found.identity;
        let mut text = format!(
            "vendor_id = 0x{:08X}\nproduct_code = 0x{:08X}\n# revision = 0x{:08X}\n# serial = {}\n",
            identity.vendor, identity.product, identity.revision, identity.serial
        );
        if let Some(file) = &self.device_file {
            text += &format!("device_file = {}\n", toml::Value::from(file.as_str()));
        }
        if self.is_drive() {
            text += "# What it exchanges is as the profile usually has it.\n";
            return text;
        }
        let [outputs, inputs] = &self.exchanges;
        for (key, objects) in [("inputs", inputs), ("outputs", outputs)] {
            match objects {
                Some(objects) => {
                    let objects: Vec<String> = objects.iter().map(|object| format!("\"{object}\"")).collect();
                    text += &format!("{key} = [{}]\n", objects.join(", "));
                }
                None => {
                    text += &format!(
                        "# {key}: bits or gaps, which are exchanged with an ESI file alone (device_file)\n{key} = []\n"
                    )
                }
            }
        }
        text += "\n";
        let [used_outputs, used_inputs] = &self.used;
        for (name, objects, used) in [("input", inputs, used_inputs), ("output", outputs, used_outputs)] {
            let objects = objects.iter().flatten();
            for (number, object) in objects.enumerate() {
                let used = used.as_ref().map_or(u8::MAX, |used| used[number]);
                let kind = self.numbers.iter().find(|(of, _)| of == object).map(|(_, kind)| *kind);
                text += &channel(name, number, object, used, self.signed.contains(object), kind);
            }
        }
        text
    }
}

fn mapped(entry: &EsiEntry) -> Mapped {
    Mapped {
        index: entry.index,
        sub: entry.sub,
        bits: entry.bits,
    }
}

/// Whether an entry is a number that is called so.
fn is_called(entry: &EsiEntry, names: &[&str]) -> bool {
    let name = entry.name.trim().to_ascii_lowercase();
    entry.index != 0 && matches!(entry.bits, 16 | 32) && names.contains(&name.as_str())
}

/// Counters and encoders of a PDO that the device sends, by the names that terminals give them: ENC Status with Counter value and Latch
/// value, CNT Inputs with Counter value.
fn inputs(pdo: &EsiPdo) -> Vec<(Mapped, Number)> {
    let find = |names: &[&str]| pdo.entries.iter().find(|entry| is_called(entry, names)).map(mapped);
    let name = pdo.name.to_ascii_lowercase();
    let is_encoder = name
        .split([' ', '_', '-'])
        .any(|word| matches!(word, "enc" | "encoder" | "fb"));
    let count = find(&["counter value", "counter"]).or_else(|| find(&["position"]).filter(|_| is_encoder));
    let latch = find(&["latch value"]);
    let latch = latch.filter(|latch| count.is_some_and(|count| count.bits == latch.bits));
    let kind = match is_encoder || latch.is_some() {
        true => Number::Encoder { latch },
        false => Number::Counter,
    };
    let counts = count.map(|count| (count, kind));
    counts
        .into_iter()
        .chain(latch.filter(|_| count.is_some()).map(|latch| (latch, Number::Latch)))
        .collect()
}

/// Duty cycles of a PDO that the device takes.
fn outputs(pdo: &EsiPdo) -> Vec<(Mapped, Number)> {
    let entries = pdo
        .entries
        .iter()
        .filter(|entry| is_called(entry, &["pwm output", "pwm", "duty cycle", "duty"]));
    entries.map(|entry| (mapped(entry), Number::Pwm)).collect()
}

/// Channels of an object: one for each bit of an octet that is used, else one of its value.
fn channel(name: &str, number: usize, object: &Mapped, used: u8, is_signed: bool, kind: Option<Number>) -> String {
    let place = format!("object = \"0x{:04X}:{}\"", object.index, object.sub);
    let head = |name: &str| format!("[[bus.node.channel]]\nname = \"{name}-{number}\"\n{place}\n");
    match kind {
        Some(Number::Counter) => return head("counter") + "type = \"counter\"\n\n",
        Some(Number::Encoder { latch: None }) => return head("encoder") + "type = \"encoder\"\n\n",
        Some(Number::Encoder { latch: Some(latch) }) => {
            let latch = format!("latch = \"0x{:04X}:{}\"", latch.index, latch.sub);
            return head("encoder") + &format!("type = \"encoder\"\n{latch}\n\n");
        }
        // It stands at its encoder.
        Some(Number::Latch) => return String::new(),
        Some(Number::Pwm) => return head("pwm") + "type = \"pwm\"\n\n",
        None => {}
    }
    if object.bits > 8 {
        let signed = if is_signed { "signed = true\n" } else { "" };
        return format!(
            "[[bus.node.channel]]\nname = \"analog-{name}-{number}\"\n{place}\ntype = \"analog\"\n{signed}\n"
        );
    }
    let bit = |bit: usize| {
        let number = number * 8 + bit;
        format!("[[bus.node.channel]]\nname = \"{name}-{number:02}\"\n{place}\nbit = {bit}\n\n")
    };
    (0..8).filter(|bit| used >> bit & 1 != 0).map(bit).collect()
}

/// A machine file of these devices. What exchanges nothing, such as a coupler, is left out.
///
/// # Errors
/// None that nodes alone could have.
pub(super) fn new_file(modules: &[Module], path: &Path, interface: &str) -> anyhow::Result<String> {
    propose::new_file(nodes(modules), Protocol::Ethercat, path, interface)
}

fn nodes(modules: &[Module]) -> Vec<ProposedNode> {
    let exchange = modules.iter().filter(|module| !module.exchanges_nothing());
    exchange.map(Module::node).collect()
}

/// Writes a machine file or adds to it: what was done, and what is otherwise than a file said that was there.
fn write(path: &Path, mut modules: Vec<Module>, args: &ScanArgs) -> anyhow::Result<(String, Vec<String>)> {
    let file = path.display();
    let (mut names, mut before, mut differences) = (Vec::new(), None, Vec::new());
    if std::fs::symlink_metadata(path).is_ok() {
        let config = config::read(path).map_err(Refusal::from)?;
        ensure!(
            config.bus.kind.protocol() == config::Protocol::Ethercat,
            "{file} is of another bus (bus.kind = \"{}\"): nothing was written",
            config.bus.kind.name()
        );
        let is_known = |id: u8| config.bus.nodes.iter().any(|node| node.id == id);
        // A coupler that the file leaves out is not missed there.
        modules.retain(|module| is_known(module.at(&config).0) || !module.exchanges_nothing());
        let found: Vec<(u8, Identity)> = modules.iter().map(|module| module.at(&config)).collect();
        let all = Modules::new(&config).differences(&found);
        if !args.add {
            let text = format!(
                "{file} is there already and was not changed: --add adds the devices that it does not have, and keeps all else\n"
            );
            return Ok((text, all.into_iter().map(|difference| difference.text).collect()));
        }
        // What has moved is in the file already; what is added is no longer strange.
        let has_moved = |id: u8| all.iter().any(|difference| difference.moved_to == Some(id));
        modules.retain(|module| {
            let (id, _) = module.at(&config);
            !is_known(id) && !has_moved(id)
        });
        let is_added = |id: u8| modules.iter().any(|module| module.found.position == id);
        let stays = all
            .into_iter()
            .filter(|difference| !difference.stranger.is_some_and(is_added));
        differences.extend(stays.map(|difference| difference.text));
        if modules.is_empty() {
            return Ok((propose::told(path, &Written::Unchanged), differences));
        }
        names.extend(config.bus.nodes.iter().map(|node| node.name.clone()));
        before =
            Some(files::read_text(path, files::read::TEXT_MAX).with_context(|| format!("{file}: cannot be read"))?);
    } else {
        modules.retain(|module| !module.exchanges_nothing());
        ensure!(
            !modules.is_empty(),
            "no drive and no inputs or outputs answered: nothing to write"
        );
    }
    for module in &mut modules {
        let plain = module.own_name().unwrap_or_else(|| module.usual_name());
        let numbered = (2..).map(|number| format!("{plain}-{number}"));
        let mut free = std::iter::once(plain.clone()).chain(numbered);
        module.node_name = free.find(|name| !names.contains(name)).unwrap_or(plain);
        names.push(module.node_name.clone());
    }
    let unused = match &args.devices {
        Some(folder) => name_device_files(&mut modules, folder, path)?,
        None => String::new(),
    };
    let count = modules.len();
    let (text, written) = match before {
        Some(before) => (
            propose::added(&before, modules.iter().map(Module::text)),
            Written::Added(count),
        ),
        None => (new_file(&modules, path, &args.interface)?, Written::New(count)),
    };
    // Never a file that would be refused.
    let config = config::parse(&text, path).map_err(Refusal::from)?;
    bus::check(&config).map_err(Refusal::from)?;
    files::write(path, text).with_context(|| format!("{file}: cannot be written"))?;
    Ok((propose::told(path, &written) + &unused, differences))
}

/// Names the ESI files of a folder that fit; which of them cannot be used, in words.
fn name_device_files(modules: &mut [Module], folder: &Path, machine_file: &Path) -> anyhow::Result<String> {
    let parse = |path: &str, octets: &[u8]| parse_esi(path, octets).ok();
    let files = propose::device_files(folder, machine_file, &["xml"], parse)?;
    let mut unused = String::new();
    for module in modules {
        let SiiIdentity {
            vendor,
            product,
            revision,
            ..
        } = module.found.identity;
        let own = |(file, esi): &'_ (String, EsiFile)| {
            let of_maker = (esi.vendor == vendor).then_some(esi)?;
            Some((file.clone(), of_maker.find(product, Some(revision))?.clone()))
        };
        let Some((file, device)) = files.iter().find_map(own) else {
            continue;
        };
        if let Some(mistake) = device.mistakes.first() {
            let why = mistake.line(&file);
            unused += &format!("{} is without device_file = {file:?}: {why}\n", module.usual_name());
            continue;
        }
        let plain = module.clone();
        module.describe(&device);
        module.device_file = Some(file.clone());
        let alone = new_file(std::slice::from_ref(module), machine_file, "eth0")?;
        if let Err(errors) = config::parse(&alone, machine_file) {
            *module = plain;
            let errors = errors.to_string();
            let why = errors.lines().next().unwrap_or_default();
            unused += &format!("{} is without device_file = {file:?}: {why}\n", module.usual_name());
        }
    }
    Ok(unused)
}

fn table(interface: &str, modules: &[Module], out: &mut impl Write) -> std::io::Result<()> {
    if modules.is_empty() {
        return Ok(());
    }
    let rows = modules.iter().map(|module| {
        let hex = |value: u32| format!("0x{value:08X}");
        let Found {
            position,
            identity,
            alias,
        } = module.found;
        vec![
            position.to_string(),
            if alias == 0 { String::new() } else { alias.to_string() },
            module.device_type.map_or(String::new(), hex),
            hex(identity.vendor),
            hex(identity.product),
            hex(identity.revision),
            identity.serial.to_string(),
            module.name.clone(),
        ]
    });
    let heading = [
        ">position",
        ">alias",
        "device type",
        "vendor",
        "product",
        "revision",
        "serial",
        "name",
    ];
    let devices = words::counted(modules.len() as u64, "device");
    write!(out, "{devices} on {interface}\n\n{}", terminal::table(&heading, rows))
}
