//! The network in words: of each node what it is expected to be, what is mapped and what is written.
//!
//! In:  the checked machine description, the plans of its nodes.
//! Out: text for a terminal, and the same as JSON.

use anyhow::Context;
use bus::ethercat::setup::{StartSource, start_values};
use bus::layout::Layout;
use bus::plan::{LeftOut, LeftOutReason, NodePlan};
use bus::powerlink::cdc;
use bus::powerlink::managing_node::{mn_config, node_configs};
use config::{Channel, ChannelKind, Config, EthercatNode, Exchange, Mapped, Node, Profile, SyncClock};
use ethercat::main::config::StartValue;
use powerlink::mn::{MnConfig, NodeConfig};
use serde_json::{Value as Json, json};
use std::fmt;
use std::path::Path;
use std::process::ExitCode;
use terminal::print;

/// An address, as a managing node must have one; it takes no part in what is shown.
const ANY_MAC: [u8; 6] = [2, 0, 0, 0, 0, 0xF0];
/// Columns of a terminal.
const COLUMNS: usize = 80;
/// Objects of one kind that are named where values are not written.
const LEFT_OUT_NAMED: usize = 6;

/// The concise DCF of the managing node.
///
/// # Errors
/// What cannot stand in one.
pub fn write_cdc(config: &Config, plans: &[NodePlan]) -> Result<Vec<u8>, cdc::CdcWriteError> {
    with_mn_config(config, plans, cdc::write_for_others)
}

/// Lists a concise DCF: exit code 0 if it can be read as one, 1 if not. What our managing node would refuse of it is told, too.
pub fn list_cdc(path: &Path) -> anyhow::Result<ExitCode> {
    let file = path.display();
    let octets = files::read(path, files::read::TEXT_MAX).with_context(|| format!("{file}: cannot be read"))?;
    match cdc::listing(&octets) {
        Ok(listing) => print(&listing)?,
        Err(error) => {
            files::errln!("{file}: {error}");
            return Ok(ExitCode::FAILURE);
        }
    }
    match cdc::read(&octets) {
        Ok(network) if network.others.is_empty() => {}
        Ok(network) => {
            let others = network.others.iter().map(|(index, sub)| format!("0x{index:04X}:{sub}"));
            let others = others.collect::<Vec<_>>().join(", ");
            files::errln!("{file}: our managing node has no use for {others}");
        }
        Err(error) => files::errln!("{file}: our managing node would refuse it: {error}"),
    }
    Ok(ExitCode::SUCCESS)
}

/// What the managing node would be told.
pub(crate) fn with_mn_config<R>(config: &Config, plans: &[NodePlan], then: impl FnOnce(&MnConfig<'_>) -> R) -> R {
    let nodes: Vec<NodeConfig<'_>> = node_configs(&config.bus, plans);
    then(&mn_config(config, &nodes, ANY_MAC))
}

pub(crate) fn profile_name(profile: Profile) -> &'static str {
    match profile {
        Profile::Cia402 => "cia402",
        Profile::Io => "io",
    }
}

/// How a node exchanges process data, where it is not polled in each cycle.
fn exchange(node: &Node) -> String {
    match node.exchange {
        Exchange::Polled => String::new(),
        Exchange::Multiplexed(cycle) => format!(", in cycle {cycle} of a round"),
        Exchange::Chained => ", chained".to_owned(),
        Exchange::AsyncOnly => ", asynchronous only".to_owned(),
    }
}

/// One node with everything that it will be told.
pub fn write_node(f: &mut fmt::Formatter<'_>, config: &Config, node: &Node, plan: &NodePlan) -> fmt::Result {
    let how = match &node.ethercat {
        None => format!("PRes within {} us, ", node.pres_timeout_us),
        Some(_) => String::new(),
    };
    writeln!(
        f,
        "  {:>3}  {:<12} {:<7} {:<9} {how}{} octets out, {} in{}",
        node.id,
        node.name,
        profile_name(node.profile),
        if node.mandatory { "mandatory" } else { "optional" },
        plan.outputs.octets,
        plan.inputs.octets,
        exchange(node),
    )?;
    if let Some(own) = &node.ethercat {
        write_ethercat(f, node, own)?;
    }
    if let Some(drive) = &node.drive {
        writeln!(f, "       drive     {}: {}", drive.name, drive.description)?;
    }
    if let Some(device) = &node.device {
        let identity = &device.identity;
        writeln!(
            f,
            "       device    {}: {} {}",
            device.file, identity.vendor_name, identity.product_name
        )?;
        for note in &device.notes {
            writeln!(f, "                 {}", note.line(&device.file))?;
        }
    }
    let expected: Vec<String> = identity(node)
        .into_iter()
        .filter_map(|(name, value)| Some(format!("{name} 0x{:08X}", value?)))
        .collect();
    let expected = if expected.is_empty() {
        "not checked".to_owned()
    } else {
        expected.join(", ")
    };
    writeln!(f, "       identity  {expected}")?;
    if let Some(software) = node.software {
        writeln!(f, "       software  date {}, time {}", software.date, software.time)?;
    }
    write_layout(f, "out", &plan.outputs, node)?;
    write_layout(f, "in", &plan.inputs, node)?;
    for cross in &node.cross {
        let source = &config.bus.nodes[cross.from].name;
        writeln!(f, "       cross     {} of {source} into {}", cross.read, cross.into)?;
    }
    match &node.ethercat {
        Some(_) => write_start(f, node, plan)?,
        None => {
            let octets = plan.configuration.len();
            let values = plan.writes.len();
            writeln!(f, "       writes    {values} values, {octets} octets of concise DCF")?;
        }
    }
    for (reason, why) in [
        (LeftOutReason::NotInDevice, "not in the device"),
        (LeftOutReason::ManagingNodeSets, "left to the managing node"),
        (LeftOutReason::NotWritable, "cannot be written"),
    ] {
        let left_out: Vec<&LeftOut> = plan
            .left_out
            .iter()
            .filter(|left_out| left_out.reason == reason)
            .collect();
        if !left_out.is_empty() {
            let named = left_out.iter().take(LEFT_OUT_NAMED);
            let named: Vec<String> = named
                .map(|object| format!("0x{:04X}:{}", object.index, object.sub))
                .collect();
            let more = left_out.len().saturating_sub(LEFT_OUT_NAMED);
            let more = if more > 0 {
                format!(" and {more} more")
            } else {
                String::new()
            };
            writeln!(f, "       without   {}{more}: {why}", named.join(", "))?;
        }
    }
    Ok(())
}

/// Where a node of EtherCAT is found, what it follows, what is assigned.
fn write_ethercat(f: &mut fmt::Formatter<'_>, node: &Node, own: &EthercatNode) -> fmt::Result {
    let place = match own.alias {
        Some(alias) => format!("alias {alias}"),
        None => format!("position {}", node.id),
    };
    let clock = match own.clock {
        None => "runs with the frames".to_owned(),
        Some(SyncClock { shift_ns, sync1_ns, .. }) => {
            let sync1 = match sync1_ns {
                0 => String::new(),
                ns => format!(", SYNC1 {} us behind it", ns / 1000),
            };
            format!("follows SYNC0, {} us behind the date{sync1}", shift_ns / 1000)
        }
    };
    let pdos = own.outputs.iter().chain(&own.inputs);
    let pdos: Vec<String> = pdos
        .map(|pdo| match pdo.entries.is_empty() {
            true => format!("0x{:04X}", pdo.index),
            false => format!("0x{:04X} (written)", pdo.index),
        })
        .collect();
    writeln!(f, "       found     at {place}; {clock}; PDOs {}", pdos.join(", "))
}

/// What a device of EtherCAT will be told before it moves anything, in the order in which it is written.
fn write_start(f: &mut fmt::Formatter<'_>, node: &Node, plan: &NodePlan) -> fmt::Result {
    /// Octets in a line, and lines of a value.
    const ROW: usize = 16;
    const ROWS: usize = 4;
    let count = start_values(node, plan).count();
    let order = if count == 0 { "" } else { ", in this order:" };
    writeln!(f, "       writes    {count} values{order}")?;
    for (start, source) in start_values(node, plan) {
        let object = object_text(&start);
        let value = start.value;
        let is_number = !start.complete && value.len() <= 8;
        let text = match is_number {
            // As many digits as it has octets.
            true => value
                .iter()
                .rev()
                .fold("0x".to_owned(), |text, octet| format!("{text}{octet:02X}")),
            false => format!("{} octets", value.len()),
        };
        let from = source_text(source);
        let line = format!("                 {object:<10} {text:<18} {from}");
        writeln!(f, "{}", shortened(&line, COLUMNS))?;
        if is_number {
            continue;
        }
        for row in value.chunks(ROW).take(ROWS) {
            let octets: Vec<String> = row.iter().map(|octet| format!("{octet:02X}")).collect();
            writeln!(f, "                   {}", octets.join(" "))?;
        }
        if let more @ 1.. = value.len().saturating_sub(ROW * ROWS) {
            writeln!(f, "                   {more} more octets: --json has them")?;
        }
    }
    Ok(())
}

/// `0x60C2:1`, `0x8000:all` with complete access.
fn object_text(start: &StartValue<'_>) -> String {
    let StartValue { index, sub, .. } = *start;
    match start.complete {
        true => format!("0x{index:04X}:all"),
        false => format!("0x{index:04X}:{sub}"),
    }
}

fn source_text(source: StartSource<'_>) -> String {
    match source {
        StartSource::DeviceFile("") => "device file".to_owned(),
        StartSource::DeviceFile(comment) => {
            let words: Vec<&str> = comment.split_whitespace().collect();
            format!("device file: {}", words.join(" "))
        }
        StartSource::DriveProfile(name) => format!("drive profile {name}"),
        StartSource::MachineFile => "machine file".to_owned(),
        StartSource::Control => "control".to_owned(),
    }
}

/// A line with so many columns at most.
fn shortened(line: &str, columns: usize) -> String {
    match line.char_indices().nth(columns) {
        None => line.to_owned(),
        Some(_) => line.chars().take(columns - 3).chain("...".chars()).collect(),
    }
}

fn identity(node: &Node) -> [(&'static str, Option<u32>); 5] {
    let identity = &node.identity;
    [
        ("device type", identity.device_type),
        ("vendor", identity.vendor_id),
        ("product", identity.product_code),
        ("revision", identity.revision),
        ("serial", identity.serial),
    ]
}

/// What a device file calls an object.
fn name<'a>(node: &'a Node, object: &Mapped) -> Option<&'a str> {
    let object = node.device.as_ref()?.object(object.index, object.sub)?;
    Some(object.name.as_str())
}

/// One line for each object: direction, first bit, length, object and its name.
fn write_layout(f: &mut fmt::Formatter<'_>, direction: &str, layout: &Layout, node: &Node) -> fmt::Result {
    for field in &layout.fields {
        let Mapped { index, sub, bits } = field.object;
        let object = format!("0x{index:04X}:{sub}");
        let here = node.channels.iter().filter(|channel| channel.object == field.object);
        let channels = here.filter(|channel| channel.output == (direction == "out"));
        let mut words: Vec<String> = channels.map(described).collect();
        words.extend(name(node, &field.object).map(str::to_owned));
        let line = format!(
            "       {direction:<9} bit {:>4}  {bits:>2} bits  {object:<10} {}",
            8 * field.offset,
            words.join(", ")
        );
        writeln!(f, "{}", line.trim_end())?;
    }
    Ok(())
}

/// A channel as the list of objects has it: name, bit, unit.
fn described(channel: &Channel) -> String {
    match channel.kind {
        ChannelKind::Bit { bit } | ChannelKind::Relay { bit } => format!("{} (bit {bit})", channel.name),
        _ if channel.unit.is_empty() => channel.name.clone(),
        _ => format!("{} ({})", channel.name, channel.unit),
    }
}

/// One node as JSON.
pub fn node_json(node: &Node, plan: &NodePlan) -> Json {
    let layout = |layout: &Layout| {
        let fields = layout.fields.iter().map(|field| {
            json!({
                "object": format!("0x{:04X}:{}", field.object.index, field.object.sub),
                "name": name(node, &field.object),
                "bits": field.object.bits,
                "bit_offset": 8 * field.offset,
            })
        });
        fields.collect::<Vec<_>>()
    };
    let identity = identity(node).map(|(name, value)| (name.replace(' ', "_"), json!(value)));
    // A concise DCF lists those of POWERLINK (--cdc).
    let writes = start_values(node, plan)
        .filter(|_| node.ethercat.is_some())
        .map(|(start, source)| {
            json!({
                "object": object_text(&start),
                "octets": start.value.iter().map(|octet| format!("{octet:02X}")).collect::<String>(),
                "from": source_text(source),
            })
        });
    let writes: Vec<Json> = writes.collect();
    json!({
        "id": node.id,
        "name": node.name,
        "profile": profile_name(node.profile),
        "mandatory": node.mandatory,
        "drive": node.drive.as_ref().map(|drive| &drive.name),
        "device_file": node.device.as_ref().map(|device| &device.file),
        "identity": identity.into_iter().collect::<serde_json::Map<_, _>>(),
        "pres_timeout_us": node.pres_timeout_us,
        "output_octets": plan.outputs.octets,
        "input_octets": plan.inputs.octets,
        "outputs": layout(&plan.outputs),
        "inputs": layout(&plan.inputs),
        "configuration_writes": match node.ethercat {
            Some(_) => writes.len(),
            None => plan.writes.len(),
        },
        "writes": writes,
        "configuration_left_out": plan.left_out.len(),
    })
}
