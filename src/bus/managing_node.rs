//! What the managing node is told before it starts.
//!
//! In:  the checked machine description, the plans of its nodes.
//! Out: the configuration of `powerlink::mn`.

use super::network::NodePlan;
use crate::config::{Bus, Config, Exchange, Identity, Mapped, Node};
use powerlink::mn::{self, Assignment, BootTimes, MnConfig, NodeConfig};

/// What the managing node is told of the network.
pub fn mn_config<'a>(config: &Config, nodes: &'a [NodeConfig<'a>], mac: [u8; 6]) -> MnConfig<'a> {
    MnConfig {
        cycle_ns: config.cycle_us * 1000,
        boot: boot_times(),
        mac,
        ..network(&config.bus, nodes)
    }
}

/// What `[bus]` says of the network.
pub(crate) fn network<'a>(bus: &Bus, nodes: &'a [NodeConfig<'a>]) -> MnConfig<'a> {
    let features = bus
        .nodes
        .iter()
        .filter_map(|node| node.device.as_ref())
        .map(|device| &device.features);
    MnConfig {
        soc_preq_wait_ns: features
            .filter_map(|features| features.soc_to_preq_ns)
            .max()
            .unwrap_or(0),
        async_slot_timeout_ns: bus.async_slot_timeout_us * 1000,
        async_mtu: bus.async_mtu,
        multiplex_cycles: bus.multiplex_cycles,
        prescaler: bus.prescaler,
        pres_mn_bytes: pres_mn_octets(nodes),
        startup: bus.startup,
        pres_lost_max: bus.pres_lost_max,
        nodes,
        ..MnConfig::default()
    }
}

/// Longest time of each node from the end of a PReq to its PRes, ns, where its device file tells.
pub fn latencies(bus: &Bus) -> Vec<Option<u32>> {
    let latency = |node: &Node| node.device.as_ref().and_then(|device| device.features.pres_latency_ns);
    bus.nodes.iter().map(latency).collect()
}

/// Times of the boot-up: shorter than the defaults of the standard where waiting serves nobody. Another managing node
/// with a cycle of up to half a second is still heard.
fn boot_times() -> BootTimes {
    BootTimes {
        wait_not_active_us: 500_000,
        wait_pre_op_1_us: 200_000,
        reset_pause_us: 150_000,
        ..BootTimes::default()
    }
}

/// What the managing node is told of each node.
pub fn node_configs<'a>(bus: &Bus, plans: &'a [NodePlan]) -> Vec<NodeConfig<'a>> {
    let nodes = exchanges(bus).into_iter().zip(plans);
    nodes
        .map(|(node, plan)| NodeConfig {
            configuration: &plan.configuration,
            configuration_stamp: plan.stamp,
            ..node
        })
        .collect()
}

/// Octets of the managing node's own PRes; `None`: no node is chained.
pub(super) fn pres_mn_octets(nodes: &[NodeConfig<'_>]) -> Option<u16> {
    let of_chained = nodes.iter().filter(|node| node.assignment.chained);
    of_chained
        .map(|node| node.pres_mn_offset.saturating_add(node.preq_bytes))
        .max()
}

/// Each node without its configuration. The outputs of chained nodes lie one behind the other in the managing node's own PRes.
pub(crate) fn exchanges(bus: &Bus) -> Vec<NodeConfig<'static>> {
    let octets = |objects: &[Mapped]| objects.iter().map(|object| u16::from(object.bits / 8)).sum::<u16>();
    let mut pres_mn_end = 0_u16;
    let mut exchange = |node: &Node| {
        let chained = node.exchange == Exchange::Chained;
        let preq_bytes = octets(&node.outputs);
        let pres_mn_offset = if chained { pres_mn_end } else { 0 };
        if chained {
            pres_mn_end = pres_mn_end.saturating_add(preq_bytes);
        }
        let multiplex_cycle = match node.exchange {
            Exchange::Multiplexed(cycle) => cycle,
            Exchange::Polled | Exchange::Chained | Exchange::AsyncOnly => 0,
        };
        NodeConfig {
            id: node.id,
            assignment: Assignment {
                mandatory: node.mandatory,
                check_software: node.software.is_some(),
                async_only: node.exchange == Exchange::AsyncOnly,
                multiplexed: multiplex_cycle != 0,
                chained,
                ..Assignment::default()
            },
            multiplex_cycle,
            pres_timeout_ns: node.pres_timeout_us * 1000,
            identity: identity(node.identity),
            software: node.software,
            preq_version: node.pdo_version,
            pres_version: node.pdo_version,
            preq_bytes,
            pres_bytes: octets(&node.inputs),
            pres_mn_offset,
            ..NodeConfig::default()
        }
    };
    bus.nodes.iter().map(&mut exchange).collect()
}

fn identity(wanted: Identity) -> mn::Identity {
    mn::Identity {
        device_type: wanted.device_type,
        vendor_id: wanted.vendor_id,
        product_code: wanted.product_code,
        revision: wanted.revision,
        serial: wanted.serial,
    }
}
