//! `cross`: what a node of POWERLINK reads from the PRes of others.
//!
//! In:  the entries of a node. Out: [`Cross`] traffic, once all nodes are known.

use super::bus_types::{Cross, Mapped, Node};
use super::document::Item;
use super::error::nearest;
use super::mapping::{self, Target};
use super::section::Section;
use obd::mapping::Direction;

/// An entry of `cross`, which can only be understood when all nodes are known.
pub(super) struct PendingCross<'d, 'l> {
    key: String,
    from: Item<'d, 'l>,
    read: Item<'d, 'l>,
    into: Item<'d, 'l>,
}

/// Reads them.
pub(super) fn pending_cross<'d, 'l>(section: &mut Section<'d, 'l>) -> Option<Vec<PendingCross<'d, 'l>>> {
    let is_array = (section.optional("cross")).is_none_or(|item| item.value.get_ref().as_array().is_some());
    let path = section.key("cross");
    let pending = section.tables("cross", |table, above: &[PendingCross<'d, 'l>]| {
        let from = table.required("from", "the name of the node that sends the object");
        let read = table.required("read", "the object of that node, like \"0x6064/32\"");
        let into = table.required("into", "the object of this node that takes it, like \"0x2010:1/32\"");
        Some(PendingCross {
            key: format!("{path}[{}]", above.len()),
            from: from?,
            read: read?,
            into: into?,
        })
    });
    pending.filter(|_| is_array)
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
        return entry.from.refused(&format!("{}.from", entry.key), rule);
    }
    complete.then_some(found)
}

fn one_cross(nodes: &[Node], own: usize, entry: &PendingCross<'_, '_>, taken: &[Mapped]) -> Option<Cross> {
    let key = |part: &str| format!("{}.{part}", entry.key);
    let name = entry.from.text(&key("from"))?;
    let Some(from) = nodes.iter().position(|node| node.name == name) else {
        let near = nearest(name, nodes.iter().map(|node| node.name.as_str()));
        return entry.from.no_word(&key("from"), "must be the name of a node", near);
    };
    if from == own {
        return entry.from.refused(&key("from"), "must be another node");
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
        return entry.read.refused(&key("read"), rule);
    }
    if read.bits != into.bits {
        let rule = format!("must have the length of what is read, {} bits", read.bits);
        return entry.into.refused(&key("into"), rule);
    }
    Some(Cross { from, read, into })
}
