//! `[[bus.node]]`: one node, and what it reads from others.
//!
//! In:  a table of the machine file, the device file that it names.
//! Out: a [`Node`] that fits its device file.

use super::bus::{NAME_RULE, is_name, wire_time_ns};
use super::channels;
use super::device::{self, IsOurs};
use super::document::{Item, Section};
use super::drive::DriveUse;
use super::drive_profile;
use super::ethercat::{self, Esi};
use super::mapping::{self, AxisUse, Payload, Target};
use super::types::{
    BusClock, ConfigurationWrite, Cross, DeviceDescription, DriveMode, Exchange, Identity, Mapped, Node, Profile, Stamp,
};
use cia402::profile::object_of;
use obd::mapping::Direction;
use std::path::Path;

/// What an answer takes besides the latency of its device and its time on the wire, until this side has seen it, µs.
const HOST_ALLOWANCE_US: u32 = 100;
/// PRes time-out where no device file tells the latency, µs.
const PRES_TIMEOUT_US: u32 = 150;

/// Octets of a PRes before its payload.
const PRES_HEADER_OCTETS: usize = 24;

/// What a node is read against.
pub(super) struct Network<'a> {
    /// Folder of the machine file.
    pub(super) folder: &'a Path,
    pub(super) cycle_us: Option<u32>,
    /// Cycles of a multiplexed round.
    pub(super) multiplex_cycles: Option<u8>,
    /// What drives are there for.
    pub(super) uses: &'a [DriveUse],
    /// On EtherCAT: whose clock leads, where that is known; `None`: on another bus.
    pub(super) clock: Option<Option<BusClock>>,
}

/// Ids and names that are taken.
#[derive(Default)]
pub(super) struct Names {
    ids: Vec<u8>,
    names: Vec<String>,
}

/// An entry of `cross`, which can only be understood when all nodes are known.
pub(super) struct PendingCross<'d, 'l> {
    key: String,
    from: Item<'d, 'l>,
    read: Item<'d, 'l>,
    into: Item<'d, 'l>,
}

pub(super) fn node<'d, 'l>(
    section: &mut Section<'d, 'l>,
    network: &Network<'_>,
    used: &mut Names,
) -> Option<(Node, Vec<PendingCross<'d, 'l>>)> {
    let id = section.integer("id", 1..=239, None).map(|id| id as u8);
    if let Some(id) = id {
        if used.ids.contains(&id) {
            section.wrong("id", "is taken by a node above");
        }
        used.ids.push(id);
    }
    let name = name(section, id);
    if let Some(name) = &name {
        // Of two nodes of one id, the default name is no mistake of its own.
        if used.names.contains(name) && section.optional("name").is_some() {
            section.wrong("name", "is taken by a node above");
        }
        used.names.push(name.clone());
    }
    let profile = section.word("profile", &[("cia402", Profile::Cia402), ("io", Profile::Io)], None);
    let mandatory = section.flag("mandatory", true);
    let drive = drive_profile::named(section, network.folder, profile);
    // With a profile or a device file that cannot be used, everything that it would tell is left unchecked.
    let known = drive.as_ref().and_then(Option::as_ref);
    let is_ethercat = network.clock.is_some();
    section.foreign(if is_ethercat {
        &ethercat::NODE_OF_POWERLINK
    } else {
        &ethercat::NODE_OF_ETHERCAT
    });
    let (device, esi) = if is_ethercat {
        (Some(None), ethercat::esi(section, network.folder))
    } else {
        let usual = known.and_then(|known| known.device_file.as_deref());
        (
            device::file(section, network.folder, network.cycle_us, usual),
            Some(None),
        )
    };
    let file = device.as_ref().and_then(Option::as_ref);
    let esi_file = esi.as_ref().and_then(Option::as_ref);
    let exchange = match is_ethercat {
        true => Some(Exchange::Polled),
        false => exchange(section, network, profile, file),
    };
    let identity = device::identity(section, file, known).map(|identity| match esi_file.map(Esi::identity) {
        Some(usual) => Identity {
            vendor_id: identity.vendor_id.or(usual.vendor_id),
            product_code: identity.product_code.or(usual.product_code),
            ..identity
        },
        None => identity,
    });
    let uses = network.uses.iter().filter(|it| Some(it.node) == id.map(i64::from));
    let mut axes: Vec<AxisUse> = uses
        .map(|it| AxisUse {
            axis: it.axis,
            mode: it.mode.or_else(|| Some(known?.usual_mode())).unwrap_or(DriveMode::Csp),
            is_spindle: it.is_spindle,
        })
        .collect();
    axes.sort_by_key(|axis| axis.axis);
    if axes.is_empty() {
        axes.push(AxisUse::BENCH);
    }
    let target = Target {
        profile,
        device: file,
        drive: known,
        axes: &axes,
        usual: [true, false].map(|outputs| esi_file.and_then(|esi| esi.usual(outputs))),
    };
    let (outputs, inputs) = if exchange == Some(Exchange::AsyncOnly) {
        for key in ["outputs", "inputs"] {
            if section.optional(key).is_some() {
                section.wrong(key, "cannot stand beside async_only: such a node has no process data");
            }
        }
        (Some(Vec::new()), Some(Vec::new()))
    } else {
        (
            mapping::payload(section, Payload::Outputs, &target),
            mapping::payload(section, Payload::Inputs, &target),
        )
    };
    let usual = known.map_or(Vec::new(), |known| of_axes(&known.writes, &axes));
    let is_ours: IsOurs = match is_ethercat {
        true => ethercat::set_by_main_device,
        false => obd::device::set_by_managing_node,
    };
    let (pres_timeout_us, software, pdo_version, own) = if let Some(clock) = network.clock {
        let around = ethercat::Around {
            cycle_us: network.cycle_us,
            clock,
            is_drive: profile == Some(Profile::Cia402),
            esi: esi_file,
        };
        let own = ethercat::node(section, &around, outputs.as_deref(), inputs.as_deref());
        (Some(PRES_TIMEOUT_US), Some(None), Some(0), own.map(Some))
    } else {
        let pres_timeout_us = pres_timeout(section, network.cycle_us, file, inputs.as_deref());
        let (software, pdo_version) = (stamp(section), section.integer("pdo_version", 0..=255, 0));
        (pres_timeout_us, software, pdo_version, Some(None))
    };
    let writes = device::writes(section, file, &usual, is_ours);
    let cross = match is_ethercat {
        true => Some(Vec::new()),
        false => pending_cross(section),
    };
    let payloads = inputs.as_deref().zip(outputs.as_deref());
    let channels = channels::channels(section, profile, file, payloads);
    let node = Node {
        id: id?,
        name: name?,
        profile: profile?,
        mandatory: mandatory?,
        pres_timeout_us: pres_timeout_us?,
        identity: identity?,
        outputs: outputs?,
        inputs: inputs?,
        exchange: exchange?,
        software: software?,
        pdo_version: pdo_version? as u8,
        drive: drive?,
        device: device?,
        writes: writes?,
        cross: Vec::new(),
        channels: channels?,
        ethercat: own?,
    };
    esi?;
    Some((node, cross?))
}

/// Writes of a profile for the axes in use: one for each where the object is of an axis, one where it is of the whole device.
fn of_axes(writes: &[ConfigurationWrite], axes: &[AxisUse]) -> Vec<ConfigurationWrite> {
    let of_axes = axes.iter().enumerate().flat_map(|(at, axis)| {
        let of_axis = move |write: &&ConfigurationWrite| at == 0 || object_of(axis.axis, write.index) != write.index;
        writes.iter().filter(of_axis).map(|write| ConfigurationWrite {
            index: object_of(axis.axis, write.index),
            ..write.clone()
        })
    });
    of_axes.collect()
}

fn name(section: &mut Section<'_, '_>, id: Option<u8>) -> Option<String> {
    match section.optional("name") {
        None => id.map(|id| format!("node-{id}")),
        Some(item) => {
            let text = item.text(&section.key("name"))?;
            let valid = is_name(text);
            if !valid {
                section.wrong("name", NAME_RULE);
            }
            valid.then(|| text.to_owned())
        }
    }
}

/// `multiplex`, `chained` and `async_only`, of which only one can be.
fn exchange(
    section: &mut Section<'_, '_>,
    network: &Network<'_>,
    profile: Option<Profile>,
    device: Option<&DeviceDescription>,
) -> Option<Exchange> {
    let multiplex = match section.optional("multiplex") {
        None => Some(None),
        Some(item) => item
            .integer(&section.key("multiplex"), 1..=254)
            .map(|cycle| Some(cycle as u8)),
    };
    let chained = section.flag("chained", false);
    let async_only = section.flag("async_only", false);
    let features = device.map(|device| &device.features);
    let cannot = |what: &str| {
        device.map_or(String::new(), |device| {
            format!("is not for this device: {} says {what}", device.file)
        })
    };
    match (multiplex?, chained?, async_only?) {
        (None, false, false) => Some(Exchange::Polled),
        (Some(cycle), false, false) => {
            let cycles = network.multiplex_cycles?;
            if cycle > cycles {
                let rule = match cycles {
                    0 => "needs bus.multiplex_cycles, the number of cycles of a round".to_owned(),
                    cycles => format!("must be an integer from 1 to {cycles}, the cycles of a round"),
                };
                section.wrong("multiplex", rule);
                return None;
            }
            if features.is_some_and(|features| features.multiplexing == Some(false)) {
                section.wrong("multiplex", cannot("DLLCNFeatureMultiplex=\"false\""));
                return None;
            }
            Some(Exchange::Multiplexed(cycle))
        }
        (None, true, false) => {
            if features.is_some_and(|features| features.chaining == Some(false)) {
                section.wrong("chained", cannot("DLLCNPResChaining=\"false\""));
                return None;
            }
            Some(Exchange::Chained)
        }
        (None, false, true) if profile == Some(Profile::Cia402) => {
            section.wrong("async_only", "cannot be: a drive is not run without process data");
            None
        }
        (None, false, true) => Some(Exchange::AsyncOnly),
        (multiplex, chained, _) => {
            let key = if multiplex.is_none() && chained {
                "chained"
            } else {
                "async_only"
            };
            let key = if multiplex.is_some() { "multiplex" } else { key };
            section.wrong(
                key,
                "cannot stand together: multiplex, chained and async_only exclude each other",
            );
            None
        }
    }
}

/// The PRes time-out; left out: from the latency that the device file tells.
fn pres_timeout(
    section: &mut Section<'_, '_>,
    cycle_us: Option<u32>,
    device: Option<&DeviceDescription>,
    inputs: Option<&[Mapped]>,
) -> Option<u32> {
    let cycle_us = i64::from(cycle_us.unwrap_or(10_000));
    let octets: usize = inputs
        .unwrap_or(&[])
        .iter()
        .map(|object| usize::from(object.bits / 8))
        .sum();
    let wire_ns = wire_time_ns(PRES_HEADER_OCTETS + octets);
    let latency = device.and_then(|device| Some((device, device.features.pres_latency_ns?)));
    let answer_us = latency.map(|(_, latency_ns)| (u64::from(latency_ns) + wire_ns).div_ceil(1000) as u32);
    let default_us = answer_us.map_or(PRES_TIMEOUT_US, |answer_us| answer_us.saturating_add(HOST_ALLOWANCE_US));
    let timeout_us = section.integer("pres_timeout_us", 1..=cycle_us, i64::from(default_us))? as u32;
    if let (Some((device, latency_ns)), Some(answer_us)) = (latency, answer_us)
        && timeout_us < answer_us
    {
        let rule = format!(
            "must be at least {answer_us}: by {} the device may take {latency_ns} ns, its PRes {wire_ns} ns on the wire",
            device.file
        );
        section.wrong("pres_timeout_us", rule);
        return None;
    }
    Some(timeout_us)
}

/// `software_date` and `software_time`: both or none.
fn stamp(section: &mut Section<'_, '_>) -> Option<Option<Stamp>> {
    const MS_OF_DAY: i64 = 24 * 60 * 60 * 1000;
    let mut part = |key, most| match section.optional(key) {
        None => Some(None),
        Some(item) => item
            .integer(&section.key(key), 0..=most)
            .map(|value| Some(value as u32)),
    };
    let (date, time) = (
        part("software_date", i64::from(u32::MAX)),
        part("software_time", MS_OF_DAY - 1),
    );
    match (date?, time?) {
        (None, None) => Some(None),
        (Some(date), Some(time)) => Some(Some(Stamp { date, time })),
        (None, Some(_)) => {
            section.wrong(
                "software_date",
                "is missing: software_time is only checked together with it",
            );
            None
        }
        (Some(_), None) => {
            section.wrong(
                "software_time",
                "is missing: software_date is only checked together with it",
            );
            None
        }
    }
}

fn pending_cross<'d, 'l>(section: &mut Section<'d, 'l>) -> Option<Vec<PendingCross<'d, 'l>>> {
    let no_array = section
        .optional("cross")
        .is_some_and(|item| item.value.get_ref().as_array().is_none());
    let path = section.key("cross");
    let mut pending = Vec::new();
    let mut complete = !no_array;
    for (index, mut table) in section.sections("cross").into_iter().enumerate() {
        let from = table.required("from", "the name of the node that sends the object");
        let read = table.required("read", "the object of that node, like \"0x6064/32\"");
        let into = table.required("into", "the object of this node that takes it, like \"0x2010:1/32\"");
        match (from, read, into) {
            (Some(from), Some(read), Some(into)) => {
                let key = format!("{path}[{index}]");
                pending.push(PendingCross { key, from, read, into });
            }
            _ => complete = false,
        }
        table.done();
    }
    complete.then_some(pending)
}

/// Cross traffic of the node at `own`, when all nodes are known.
pub(super) fn cross(nodes: &[Node], own: usize, pending: &[PendingCross<'_, '_>]) -> Option<Vec<Cross>> {
    let mut found: Vec<Cross> = Vec::new();
    let mut complete = true;
    for entry in pending {
        // What the PReq brings and what is read from others is received, and an object has one source.
        let mut taken = nodes[own].outputs.clone();
        taken.extend(found.iter().map(|cross| cross.into));
        match one_cross(nodes, own, entry, &taken) {
            Some(cross) => found.push(cross),
            None => complete = false,
        }
    }
    let mut sources: Vec<usize> = found.iter().map(|cross| cross.from).collect();
    sources.sort_unstable();
    sources.dedup();
    let channels = nodes[own]
        .device
        .as_ref()
        .and_then(|device| Some((device, device.features.rpdo_channels?)));
    if let (Some((device, channels)), Some(entry)) = (channels, pending.first())
        && sources.len() + 1 > usize::from(channels)
    {
        let rule = format!(
            "needs {} RPDOs, one for each node that is read and one for the PReq; {} says {channels}",
            sources.len() + 1,
            device.file
        );
        entry
            .from
            .log
            .wrong(entry.from.value.span(), &format!("{}.from", entry.key), rule, None);
        complete = false;
    }
    complete.then_some(found)
}

fn one_cross(nodes: &[Node], own: usize, entry: &PendingCross<'_, '_>, taken: &[Mapped]) -> Option<Cross> {
    let key = |part: &str| format!("{}.{part}", entry.key);
    let log = entry.from.log;
    let name = entry.from.text(&key("from"))?;
    let Some(from) = nodes.iter().position(|node| node.name == name) else {
        let hint = super::error::nearest(name, nodes.iter().map(|node| node.name.as_str()));
        let hint = hint.map(|near| format!("did you mean {near:?}?"));
        log.wrong(
            entry.from.value.span(),
            &key("from"),
            "must be the name of a node",
            hint,
        );
        return None;
    };
    if from == own {
        log.wrong(entry.from.value.span(), &key("from"), "must be another node", None);
        return None;
    }
    let anything = Target {
        profile: None,
        device: None,
        drive: None,
        axes: &[],
        usual: [None, None],
    };
    let read = mapping::mapped(entry.read, &key("read"), Direction::Transmit, &anything, &[]);
    let this = Target {
        profile: Some(nodes[own].profile),
        device: nodes[own].device.as_ref(),
        drive: nodes[own].drive.as_ref(),
        axes: &[],
        usual: [None, None],
    };
    let into = mapping::mapped(entry.into, &key("into"), Direction::Receive, &this, taken);
    let (read, into) = (read?, into?);
    if !nodes[from].inputs.contains(&read) {
        let inputs: Vec<_> = nodes[from].inputs.iter().map(Mapped::to_string).collect();
        let rule = format!("must stand among the inputs of {name}: {}", inputs.join(", "));
        log.wrong(entry.read.value.span(), &key("read"), rule, None);
        return None;
    }
    if read.bits != into.bits {
        let rule = format!("must have the length of what is read, {} bits", read.bits);
        log.wrong(entry.into.value.span(), &key("into"), rule, None);
        return None;
    }
    Some(Cross { from, read, into })
}
