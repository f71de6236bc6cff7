//! `[[bus.node]]`: one node, and what it reads from others.
//!
//! In:  a table of the machine file, the device file that it names.
//! Out: a [`Node`] that fits its device file.

use super::bus_types::{Exchange, Identity, Node, Profile};
use super::channels;
use super::cross::PendingCross;
use super::device;
use super::drive_profile;
use super::esi::Esi;
use super::mapping::{self, AxisUse, Payload, Target};
use super::modes::DriveMode;
use super::protocol::{Network, NodeFacts};
use super::section::Section;
use super::values::{NAME_RULE, is_name};
use cia402::profile::object_of;
use obd::device::ConfigurationWrite;

/// Ids and names that are taken.
#[derive(Default)]
pub(super) struct Names {
    ids: Vec<u8>,
    names: Vec<String>,
}

pub(super) fn node<'d, 'l>(
    section: &mut Section<'d, 'l>,
    network: &Network<'_>,
    used: &mut Names,
) -> Option<(Node, Vec<PendingCross<'d, 'l>>)> {
    let id = section.integer("id", 1..=239, None);
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
    let keys = network.keys;
    section.foreign(keys.foreign_of_node());
    let (device, esi) = keys.device_file(section, network, known);
    let file = device.as_ref().and_then(Option::as_ref);
    let esi_file = esi.as_ref().and_then(Option::as_ref);
    let exchange = keys.exchange(section, network, profile, file);
    let identity =
        device::identity(section, file, known.map_or(Identity::default(), |known| known.identity)).map(|identity| {
            match esi_file.map(Esi::identity) {
                Some(usual) => Identity {
                    vendor_id: identity.vendor_id.or(usual.vendor_id),
                    product_code: identity.product_code.or(usual.product_code),
                    ..identity
                },
                None => identity,
            }
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
    let own = keys.node(
        section,
        network,
        &NodeFacts {
            is_drive: profile == Some(Profile::Cia402),
            device: file,
            esi: esi_file,
            outputs: outputs.as_deref(),
            inputs: inputs.as_deref(),
        },
    );
    let writes = device::writes(section, file, &usual, keys.written_by_master());
    let cross = keys.cross(section);
    let payloads = inputs.as_deref().zip(outputs.as_deref());
    let types = esi_file.map_or(Vec::new(), Esi::types);
    let channels = channels::channels(section, profile, file, &types, payloads);
    let own = own?;
    let node = Node {
        id: id?,
        name: name?,
        profile: profile?,
        mandatory: mandatory?,
        pres_timeout_us: own.pres_timeout_us,
        identity: identity?,
        outputs: outputs?,
        inputs: inputs?,
        exchange: exchange?,
        software: own.software,
        pdo_version: own.pdo_version,
        drive: drive?,
        device: device?,
        writes: writes?,
        cross: Vec::new(),
        channels: channels?,
        ethercat: own.ethercat,
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
    match section.optional_text("name")? {
        None => id.map(|id| format!("node-{id}")),
        Some(text) if is_name(text) => Some(text.to_owned()),
        Some(_) => section.refused("name", NAME_RULE),
    }
}
