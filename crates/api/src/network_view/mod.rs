//! The network in words and numbers, as it is shown to people and other programs.
//!
//! In:  the machine file; what the bus knows of each node, where a control runs.
//! Out: a [`NetworkView`], which goes through the control socket as JSON and is printed by `isocnc bus`.

use bus::service::{BudgetView, NetworkLive, NodeLive};
use config::{Config, Identity, Mapped, Node, Profile};
use serde::{Deserialize, Serialize};
use toml::de::DeTable;

/// The whole network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NetworkView {
    /// Name of the machine.
    pub machine: String,
    pub file: String,
    /// Network interface; "memory" for the wire in memory.
    pub interface: String,
    /// "powerlink", "ethercat" or "none": whose words its states are.
    #[serde(default)]
    pub protocol: String,
    pub cycle_us: u32,
    /// AsyncSlotTimeout (0x1F8A/2), us.
    pub async_slot_timeout_us: u32,
    /// Polls lost in a row that are ridden out.
    pub pres_lost_max: u32,
    /// How the cycle is spent, part by part.
    pub budget: Vec<BudgetView>,
    /// What is known while a control runs.
    pub live: Option<NetworkLive>,
    /// Controlled nodes in polling order.
    pub nodes: Vec<NodeView>,
}

/// One controlled node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodeView {
    pub id: u8,
    pub name: String,
    /// Line of its `[[bus.node]]` in the machine file.
    pub line: Option<usize>,
    /// The machine cannot run without it.
    pub mandatory: bool,
    /// "drive" or "io".
    pub profile: String,
    /// PRes time-out (0x1F92), us.
    pub pres_timeout_us: u32,
    /// Identity that the machine file asks for.
    pub expected: ExpectedIdentity,
    /// Objects in its PReq.
    pub outputs: Vec<MappedView>,
    /// Objects in its PRes.
    pub inputs: Vec<MappedView>,
    /// What is known while a control runs.
    pub live: Option<NodeLive>,
}

/// Identity that a node must have; `None`: any.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExpectedIdentity {
    /// 0x1000.
    pub device_type: Option<u32>,
    /// 0x1018/1.
    pub vendor_id: Option<u32>,
    /// 0x1018/2.
    pub product_code: Option<u32>,
    /// 0x1018/3.
    pub revision: Option<u32>,
    /// 0x1018/4.
    pub serial: Option<u32>,
}

/// One object in a payload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MappedView {
    pub index: u16,
    pub sub: u8,
    /// First bit in the payload.
    pub offset_bits: u32,
    /// Length in bits.
    pub bits: u8,
}

impl NetworkView {
    /// What the machine file says.
    pub fn from_config(config: &Config) -> NetworkView {
        let lines = node_lines(config);
        let nodes = config.bus.nodes.iter().enumerate();
        NetworkView {
            machine: config.name.clone(),
            file: config.path.display().to_string(),
            interface: match config.bus.kind {
                kind if kind.has_interface() => config.bus.interface.clone(),
                kind => kind.name().into(),
            },
            protocol: config.bus.kind.protocol().name().into(),
            cycle_us: config.cycle_us,
            async_slot_timeout_us: config.bus.async_slot_timeout_us,
            pres_lost_max: config.bus.pres_lost_max,
            budget: bus::budget(config),
            live: None,
            nodes: nodes
                .map(|(place, node)| NodeView::from_config(node, lines.get(place).copied()))
                .collect(),
        }
    }
}

/// Line of each `[[bus.node]]`, from 1; empty where the file is gone or not the same any more.
fn node_lines(config: &Config) -> Vec<usize> {
    let Ok(text) = files::read_text(&config.path, files::read::TEXT_MAX) else {
        return Vec::new();
    };
    let (document, _) = DeTable::parse_recoverable(&text);
    let nodes = document.get_ref().get("bus").and_then(|bus| {
        let nodes = bus.get_ref().get("node")?.get_ref().as_array()?;
        Some(nodes.iter().map(|node| node.span().start).collect::<Vec<_>>())
    });
    let nodes = nodes.unwrap_or_default();
    if nodes.len() != config.bus.nodes.len() {
        return Vec::new();
    }
    let line = |at: usize| {
        1 + text.as_bytes()[..at.min(text.len())]
            .iter()
            .filter(|octet| **octet == b'\n')
            .count()
    };
    nodes.into_iter().map(line).collect()
}

impl NodeView {
    fn from_config(node: &Node, line: Option<usize>) -> NodeView {
        let Identity {
            device_type,
            vendor_id,
            product_code,
            revision,
            serial,
        } = node.identity;
        NodeView {
            id: node.id,
            name: node.name.clone(),
            line,
            mandatory: node.mandatory,
            profile: match node.profile {
                Profile::Cia402 => "drive".into(),
                Profile::Io => "io".into(),
            },
            pres_timeout_us: node.pres_timeout_us,
            expected: ExpectedIdentity {
                device_type,
                vendor_id,
                product_code,
                revision,
                serial,
            },
            outputs: mapped(&node.outputs),
            inputs: mapped(&node.inputs),
            live: None,
        }
    }
}

fn mapped(objects: &[Mapped]) -> Vec<MappedView> {
    let mut offset_bits = 0;
    let place = |object: &Mapped| {
        let view = MappedView {
            index: object.index,
            sub: object.sub,
            offset_bits,
            bits: object.bits,
        };
        offset_bits += u32::from(object.bits);
        view
    };
    objects.iter().map(place).collect()
}

#[cfg(test)]
mod tests;
