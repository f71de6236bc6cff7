//! What the managing node is told before it starts.
//!
//! In:  the checked machine description, the plans of its nodes.
//! Out: the configuration of `powerlink::mn`.

use super::network::plan;
use crate::plan::NodePlan;
use crate::service::BudgetView;
use config::{Bus, Config, Exchange, Identity, Mapped, Node, Stamp};
use powerlink::mn::{self, Assignment, BootTimes, Budget, MnConfig, NodeConfig, StartUp};
use powerlink::wire::PAYLOAD_MAX;

/// What the managing node is told of the network.
pub fn mn_config<'a>(config: &Config, nodes: &'a [NodeConfig<'a>], mac: [u8; 6]) -> MnConfig<'a> {
    MnConfig {
        cycle_ns: config.cycle_us * 1000,
        boot: boot_times(),
        mac,
        ..network(&config.bus, nodes)
    }
}

/// Whether the network fits its cycle, and what the chained nodes are sent fits one frame.
///
/// # Errors
/// Why it does not.
pub(crate) fn check(config: &Config) -> Result<(), String> {
    let nodes = exchanges(&config.bus);
    let network = mn_config(config, &nodes, [0; 6]);
    let too_many = |octets: &u16| usize::from(*octets) > PAYLOAD_MAX;
    if let Some(octets) = network.pres_mn_bytes.filter(too_many) {
        return Err(format!(
            "the outputs of the chained nodes share one frame of {PAYLOAD_MAX} octets, and have {octets}"
        ));
    }
    let worst = Budget::new(&network, &latencies(&config.bus)).worst();
    if worst.total_ns() > u64::from(network.cycle_ns) {
        return Err(format!(
            "the time-outs do not fit the cycle of {} us: {worst}",
            config.cycle_us
        ));
    }
    Ok(())
}

/// What the cycle is made of. Latencies are those that the time-outs allow.
pub(crate) fn budget(config: &Config) -> Vec<BudgetView> {
    let plans = plan(config);
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

/// The longest that SoC, polls, SoA and asynchronous slot can take, ns.
pub(crate) fn worst_exchange_ns(config: &Config) -> u64 {
    let nodes = exchanges(&config.bus);
    let network = mn_config(config, &nodes, [0; 6]);
    Budget::new(&network, &latencies(&config.bus)).worst().total_ns()
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
        // The reader of the file refuses bits that are not served.
        startup: bus
            .startup
            .map_or(StartUp::default(), |bits| StartUp::from_bits(bits).unwrap_or_default()),
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
            expected: &plan.expected,
            configuration_stamp: plan.stamp.map(stamp),
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
            software: node.software.map(stamp),
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

fn stamp(Stamp { date, time }: Stamp) -> mn::Stamp {
    mn::Stamp { date, time }
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

#[cfg(test)]
mod tests {
    use config::wire_time_ns;
    use powerlink::mn;

    const DEMO: &str = include_str!("../../../../configs/mill3-demo.toml");

    /// How a machine file is refused that has one thing in another way than that of the demo.
    fn refusal(from: &str, to: &str) -> String {
        assert!(DEMO.contains(from), "{from}");
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), DEMO.replacen(from, to, 1)).expect("it can be written");
        match crate::read(file.path()) {
            Ok(_) => String::new(),
            Err(errors) => errors.to_string().replace(&file.path().display().to_string(), "m.toml"),
        }
    }

    #[test]
    fn a_network_that_does_not_fit_its_cycle_is_refused_at_its_place() {
        assert_eq!(refusal("pres_timeout_us = 150", "pres_timeout_us = 359"), "");
        let refused = refusal("pres_timeout_us = 150", "pres_timeout_us = 360");
        let line = 1 + DEMO.lines().position(|line| line == "[[bus.node]]").expect("a node");
        let wanted = format!(
            "m.toml:{line}:1: bus.node: the time-outs do not fit the cycle of 1000 us: 41 (frames) + 810 (PRes) + 150 \
             (async slot) = 1001 us"
        );
        assert!(refused.contains(&wanted), "{refused}");
    }

    #[test]
    fn a_frame_takes_as_long_in_the_machine_file_as_on_the_wire() {
        assert!((0..1600).all(|octets| wire_time_ns(octets) == mn::wire_time_ns(octets)));
    }
}
