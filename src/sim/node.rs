//! What all simulated nodes have in common: how their controlled node is built.

use super::SimError;
use crate::config::Node;
use obd::Dictionary;
use powerlink::cn::{Cn, CnConfig};
use powerlink::wire::Mac;

/// 1F98h/3 of simulated nodes: they answer as soon as their process is woken.
const PRES_MAX_LATENCY_NS: u32 = 100_000;

/// MAC of a simulated node: locally administered, the node id last.
pub fn node_mac(id: u8) -> Mac {
    [0x02, 0x00, 0x00, 0x45, 0x50, id]
}

/// The controlled node of a node of the machine file: it shows the identity that the file expects.
pub(super) fn build<const ENTRIES: usize, const OCTETS: usize>(
    node: &Node,
    device_type: u32,
    mut objects: Dictionary<ENTRIES, OCTETS>,
    now_ns: u64,
) -> Result<Cn<ENTRIES, OCTETS>, SimError> {
    // Lost SoAs are counted only (1C0Ch/3 = 0): how long a node goes on alone is configured by its SoC and its polls.
    objects
        .find(0x1C0C, 3)
        .and_then(|threshold| objects.set_default(threshold, &[0; 4]))
        .map_err(|error| SimError::new(node, error))?;
    let identity = &node.identity;
    // Names beyond the length of the objects are cut; they are for people.
    let name = node
        .name
        .char_indices()
        .take_while(|(at, char)| at + char.len_utf8() <= 32)
        .last();
    let name = &node.name[..name.map_or(0, |(at, char)| at + char.len_utf8())];
    let config = CnConfig {
        node_id: node.id,
        mac: node_mac(node.id),
        device_type: identity.device_type.unwrap_or(device_type),
        vendor_id: identity.vendor_id.unwrap_or(0),
        product_code: identity.product_code.unwrap_or(0),
        revision: identity.revision.unwrap_or(0),
        serial: identity.serial.unwrap_or(u32::from(node.id)),
        device_name: name,
        host_name: name,
        pres_max_latency_ns: PRES_MAX_LATENCY_NS,
    };
    Cn::new(&config, objects, now_ns).map_err(|error| SimError::new(node, error))
}
