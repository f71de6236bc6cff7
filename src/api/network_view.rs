//! The network in words and numbers, as it is shown to people and other programs.
//!
//! In:  the machine file; what the managing node knows of each node, where a control runs.
//! Out: a [`NetworkView`], which goes through the control socket as JSON and is printed by `isocnc bus`.

use crate::bus::managing_node::{mn_config, node_configs};
use crate::bus::network;
use crate::config::{BusKind, Config, Identity, Mapped, Node, Profile};
use powerlink::mn::{self, Counters, Diagnosis, Fault, NetworkDiagnosis, Reason, Span};
use powerlink::sdo::command::Address;
use powerlink::wire::IdentResponse;
use serde::{Deserialize, Serialize};
use toml::de::DeTable;

/// The whole network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NetworkView {
    /// Name of the machine.
    pub machine: String,
    /// Machine file.
    pub file: String,
    /// Network interface; "memory" for the wire in memory.
    pub interface: String,
    /// Cycle, us.
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

/// One part of the cycle, us.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BudgetView {
    /// What it is for.
    pub part: String,
    /// The node that it is for.
    pub node: Option<u8>,
    /// Frames on the wire.
    pub wire_us: f64,
    /// Latency of the node; where it has not told one, what its time-out leaves for it.
    pub latency_us: f64,
    /// The longest it can take.
    pub worst_us: f64,
}

/// The network as it is now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NetworkLive {
    /// State of the managing node.
    pub nmt_state: String,
    /// Why it is not OPERATIONAL.
    pub why: Option<String>,
    /// Another managing node that was heard: its MAC and how many frames.
    pub foreign: Option<String>,
    /// SoCs sent.
    pub cycles: u64,
    /// Cycles left out because the next one was started too late.
    pub cycles_skipped: u64,
    /// Cycles cut off by the next one.
    pub cycles_overrun: u64,
    /// Asynchronous slots whose answer did not come in time.
    pub async_timeouts: u64,
    /// Frames that could not be read, or that nobody had asked for.
    pub bad_frames: u64,
}

/// One controlled node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodeView {
    /// Node id.
    pub id: u8,
    /// Its name.
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
    /// Object.
    pub index: u16,
    /// Sub-index.
    pub sub: u8,
    /// First bit in the payload.
    pub offset_bits: u32,
    /// Length in bits.
    pub bits: u8,
}

/// A node as it is now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodeLive {
    /// Process data are valid.
    pub operational: bool,
    /// State that the node reported last.
    pub nmt_state: String,
    /// State it should be in (0x1F8F).
    pub expected_nmt_state: String,
    /// Where its boot-up stands.
    pub stage: String,
    /// Why it is not operational.
    pub why: Option<Why>,
    /// The last thing that went wrong, also when it is operational again.
    pub last_fault: Option<String>,
    /// What it said it is.
    pub identity: Option<IdentityView>,
    /// The last errors it signalled, the newest first.
    pub errors: Vec<String>,
    /// Errors it signalled since the start.
    pub errors_total: u64,
    /// PReqs sent.
    pub polls: u64,
    /// PReqs without a PRes in time.
    pub lost: u64,
    /// Longest row of lost PRes.
    pub lost_in_row_max: u32,
    /// PRes that came too late.
    pub late: u64,
    /// PRes whose data were too short or of another mapping version.
    pub refused: u64,
    /// Longest time from PReq to PRes, us.
    pub response_max_us: f64,
    /// Boots begun.
    pub boots: u64,
    /// Times it was given up.
    pub faults: u64,
}

/// Why a node is not operational.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Why {
    /// In words.
    pub text: String,
    /// The object that it is about.
    pub object: Option<String>,
    /// Its value as it should be.
    pub expected: Option<String>,
    /// Its value as it is.
    pub actual: Option<String>,
}

/// An IdentResponse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "named as the fields of the IdentResponse")]
pub struct IdentityView {
    pub device_type: u32,
    pub vendor_id: u32,
    pub product_code: u32,
    pub revision: u32,
    pub serial: u32,
    pub feature_flags: u32,
    pub response_time_us: f64,
    pub mtu: u16,
    pub poll_in_octets: u16,
    pub poll_out_octets: u16,
    pub configuration_date: u32,
    pub configuration_time: u32,
    pub software_date: u32,
    pub software_time: u32,
    pub ip_address: String,
    pub host_name: String,
}

impl From<&IdentResponse> for IdentityView {
    fn from(ident: &IdentResponse) -> IdentityView {
        let [a, b, c, d] = ident.ip_address.to_be_bytes();
        let name = &ident.host_name;
        let end = name.iter().position(|octet| *octet == 0).unwrap_or(name.len());
        IdentityView {
            device_type: ident.device_type,
            vendor_id: ident.vendor_id,
            product_code: ident.product_code,
            revision: ident.revision,
            serial: ident.serial,
            feature_flags: ident.feature_flags,
            response_time_us: f64::from(ident.response_time_ns) / 1e3,
            mtu: ident.mtu,
            poll_in_octets: ident.poll_in_size,
            poll_out_octets: ident.poll_out_size,
            configuration_date: ident.configuration_date,
            configuration_time: ident.configuration_time,
            software_date: ident.software_date,
            software_time: ident.software_time,
            ip_address: format!("{a}.{b}.{c}.{d}"),
            // Whatever a node says: no control characters on a terminal.
            host_name: name[..end].escape_ascii().to_string(),
        }
    }
}

impl NetworkView {
    /// What the machine file says.
    pub fn of(config: &Config) -> NetworkView {
        let lines = node_lines(config);
        let nodes = config.bus.nodes.iter().enumerate();
        NetworkView {
            machine: config.name.clone(),
            file: config.path.display().to_string(),
            interface: match config.bus.kind {
                BusKind::Powerlink => config.bus.interface.clone(),
                BusKind::Memory => "memory".into(),
            },
            cycle_us: config.cycle_us,
            async_slot_timeout_us: config.bus.async_slot_timeout_us,
            pres_lost_max: config.bus.pres_lost_max,
            budget: budget(config),
            live: None,
            nodes: nodes
                .map(|(place, node)| NodeView::of(node, lines.get(place).copied()))
                .collect(),
        }
    }
}

/// What the cycle is made of. Latencies are those that the time-outs allow.
fn budget(config: &Config) -> Vec<BudgetView> {
    let plans = network::plan(config);
    let nodes = node_configs(&config.bus, &plans);
    // No address counts in it.
    let managing = mn_config(config, &nodes, [0; 6]);
    let us = |ns: u64| ns as f64 / 1e3;
    let view = |line: mn::BudgetLine| {
        let node = |place: usize| nodes.get(place).map(|node| node.id);
        let (part, node) = match line.part {
            mn::Part::Soc => ("SoC".into(), None),
            mn::Part::SocToPreq => ("pause before the first PReq".into(), None),
            mn::Part::Poll {
                node: place,
                preq_octets,
                pres_octets,
                multiplex_cycle,
            } => {
                let cycle = match multiplex_cycle {
                    0 => String::new(),
                    cycle => format!(", in cycle {cycle} of the round"),
                };
                (
                    format!("PReq of {preq_octets} and PRes of {pres_octets} octets{cycle}"),
                    node(place),
                )
            }
            mn::Part::PresMn { octets } => (format!("PRes of the managing node, {octets} octets"), None),
            mn::Part::Chained { node: place, octets } => (format!("chained PRes of {octets} octets"), node(place)),
            mn::Part::Chain => ("wait for the PRes chain".into(), None),
            mn::Part::Soa => ("SoA".into(), None),
            mn::Part::AsyncSlot { octets } => (format!("asynchronous slot, ASnd of up to {octets} octets"), None),
        };
        BudgetView {
            part,
            node,
            wire_us: us(line.wire_ns),
            latency_us: us(line.latency_ns),
            worst_us: us(line.worst_ns),
        }
    };
    mn::Budget::new(&managing, &[]).lines().map(view).collect()
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
    fn of(node: &Node, line: Option<usize>) -> NodeView {
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

impl NodeLive {
    /// A node as the managing node knows it; `now_ns` by its clock.
    pub fn of(node: &Diagnosis, now_ns: u64) -> NodeLive {
        let statistics = &node.statistics;
        NodeLive {
            operational: node.state == mn::NodeState::Operational,
            nmt_state: node.nmt_state.to_string(),
            expected_nmt_state: node.expected_nmt_state.to_string(),
            stage: node.stage.to_string(),
            why: node.reason.map(|reason| why(reason, now_ns)),
            last_fault: node.last_fault.map(|last| {
                let times = if last.count > 1 {
                    format!(", {} times in a row", last.count)
                } else {
                    String::new()
                };
                format!("{}{times}, {}", last.fault, ago(now_ns, last.at_ns))
            }),
            identity: node.ident.as_ref().map(|(_, ident)| ident.into()),
            errors: node
                .errors
                .newest_first()
                .map(|error| format!("{}, {}", error.entry, ago(now_ns, error.at_ns)))
                .collect(),
            errors_total: node.errors.total(),
            polls: statistics.preq_sent,
            lost: statistics.pres_lost,
            lost_in_row_max: statistics.lost_in_row_max,
            late: statistics.pres_late,
            refused: statistics.pres_short + statistics.pres_version,
            response_max_us: f64::from(statistics.response_ns_max) / 1e3,
            boots: statistics.boots,
            faults: statistics.faults,
        }
    }
}

impl NetworkLive {
    /// The network as the managing node knows it; `now_ns` by its clock.
    pub fn of(network: &NetworkDiagnosis, counters: &Counters, now_ns: u64) -> NetworkLive {
        NetworkLive {
            nmt_state: network.state.to_string(),
            why: network.reason.map(|reason| reason.at(now_ns).to_string()),
            foreign: network.foreign_mn.map(|foreign| {
                format!(
                    "{}, {} frames, the last {}",
                    foreign.sign,
                    foreign.frames,
                    ago(now_ns, foreign.heard_ns)
                )
            }),
            cycles: counters.cycles,
            cycles_skipped: counters.cycles_skipped,
            cycles_overrun: counters.cycles_overrun,
            async_timeouts: counters.async_timeouts,
            bad_frames: counters.malformed.total() + counters.unexpected + counters.unknown_node,
        }
    }
}

/// Why a node is not operational; `now_ns` by the clock of the managing node.
fn why(reason: Reason, now_ns: u64) -> Why {
    let text = reason.at(now_ns).to_string();
    match reason.fault() {
        Some(cause) => Why { text, ..fault(cause) },
        None => Why {
            text,
            object: None,
            expected: None,
            actual: None,
        },
    }
}

/// What went wrong with a node: object, what was expected, what came.
fn fault(fault: Fault) -> Why {
    Why {
        text: fault.to_string(),
        object: fault.object().map(|object| object.to_string()),
        expected: fault.expected().map(|value| value.to_string()),
        actual: fault.found().map(|value| value.to_string()),
    }
}

/// `0x1006` or `0x1018/1`.
pub fn object(index: u16, sub: u8) -> String {
    Address { index, sub }.to_string()
}

/// `01:11:1e:00:00:01`
pub fn mac(mac: [u8; 6]) -> String {
    mac.map(|octet| format!("{octet:02x}")).join(":")
}

fn ago(now_ns: u64, at_ns: u64) -> String {
    format!("{} ago", Span(now_ns.saturating_sub(at_ns)))
}

#[cfg(test)]
#[path = "network_view_tests.rs"]
mod tests;
