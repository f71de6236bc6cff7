//! Keys that name a node of the bus, and what stands in its payloads.

use super::bus_types::{Mapped, Node};
use super::section::Section;

/// The node that `node` names by its id.
pub(super) fn node<'n>(
    section: &mut Section<'_, '_>,
    nodes: Option<&'n [Node]>,
    fits: impl Fn(&Node) -> bool,
) -> Option<(usize, &'n Node)> {
    let id = section.integer("node", 1..=239, None)?;
    let mut all = nodes?.iter().enumerate();
    let found = all.find(|(_, node)| node.id == id);
    if found.is_none() {
        section.wrong("node", "is no node of the bus");
    }
    let (index, node) = found?;
    if !fits(node) {
        return section.refused("node", "must be a node whose process data are exchanged in every cycle");
    }
    Some((index, node))
}

/// An object that stands in a payload; `Some(None)`: left out.
pub(super) fn object(
    section: &mut Section<'_, '_>,
    key: &'static str,
    required: bool,
    payload: Option<&Vec<Mapped>>,
    name: &str,
) -> Option<Option<Mapped>> {
    let Some((index, sub)) = section.object(key, required, "0x3000:1")? else {
        return Some(None);
    };
    let found = payload?
        .iter()
        .find(|object| (object.index, object.sub) == (index, sub));
    if found.is_none() {
        section.wrong(key, format!("does not stand among the `{name}` of the node"));
    }
    found.map(|object| Some(*object))
}

/// Notes an output that a channel writes.
pub(super) fn has_no_channel(section: &Section<'_, '_>, key: &str, node: &Node, object: Mapped) {
    if let Some(channel) = node.channels.iter().find(|it| it.output && it.object == object) {
        let name = &channel.name;
        let rule = format!("is the channel {name:?} of the node already: an output has one writer");
        section.wrong(key, rule);
    }
}
