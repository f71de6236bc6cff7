//! Opens the managing node on a link.
//!
//! In:  a machine file; a network interface, or any link. Out: both halves of the bus, for the time of a call.

use super::managing_node::{self, mn_config, node_configs};
use super::network::plan;
use super::tap::Tap;
use super::{NODES_MAX, Powerlink, wall_clock};
use crate::plan::NodePlan;
use crate::protocol::{Master, Run};
use crate::service::BudgetView;
use crate::watch::Watch;
use crate::{EthernetFrame, Open};
use anyhow::{Context, anyhow};
use config::{BusLink, Config, ConfigErrors};
use powerlink::link::Link;
use powerlink::link::pnet::PnetLink;
use powerlink::link::raw::{RawConfig, RawLink, Reception};
use powerlink::mn::MnConfig;
use powerlink::wire::node::MN;
use rtrb::Consumer;
use std::sync::Arc;

/// Look for an answer this long before sleeping for it, ns: longer than a quick node takes, too short to matter.
pub const ANSWER_SPIN_NS: u64 = 20_000;

/// POWERLINK for a whole machine.
pub(crate) struct ManagingNode;

impl Master for ManagingNode {
    fn check(&self, config: &Config) -> Result<(), ConfigErrors> {
        managing_node::check(config).map_err(|rule| config::bus_error(config, "node", rule))
    }

    fn plan(&self, config: &Config) -> Vec<NodePlan> {
        plan(config)
    }

    fn budget(&self, config: &Config) -> Vec<BudgetView> {
        managing_node::budget(config)
    }

    fn worst_exchange_ns(&self, config: &Config) -> u64 {
        managing_node::worst_exchange_ns(config)
    }

    fn with_interface(
        &self,
        config: &Config,
        interface: &str,
        watch: Arc<Watch>,
        threads: fn(),
        warn: &mut dyn FnMut(&str),
        run: Run<'_>,
    ) -> anyhow::Result<()> {
        match config.bus.link {
            BusLink::Raw => {
                let raw = RawConfig {
                    spin_ns: ANSWER_SPIN_NS,
                    ..RawConfig::default()
                };
                let link = RawLink::open(interface, raw)?;
                if let reception @ Reception::Calls { .. } = link.reception() {
                    warn(&format!("{interface}: {reception}"));
                }
                let mac = link.mac();
                with_tap(config, interface, link, mac, watch, threads, run)
            }
            BusLink::Pnet => {
                let link = PnetLink::open(interface, ANSWER_SPIN_NS)?;
                warn(&format!(
                    "{interface}: each frame passes libpnet by two or three system calls, as bus.link = \"pnet\" asks for"
                ));
                let mac = link.mac();
                with_tap(config, interface, link, mac, watch, threads, run)
            }
        }
    }

    fn with_link(
        &self,
        config: &Config,
        link: Box<dyn Link + Send + '_>,
        mac: [u8; 6],
        watch: Arc<Watch>,
        run: Run<'_>,
    ) -> anyhow::Result<()> {
        with_link(config, link, mac, watch, None, run)
    }
}

/// Opens the bus on a link, with the TAP device that the machine file wants.
fn with_tap<L: Link + Send>(
    config: &Config,
    interface: &str,
    link: L,
    mac: [u8; 6],
    watch: Arc<Watch>,
    threads: fn(),
    run: Run<'_>,
) -> anyhow::Result<()> {
    let tap = match &config.bus.tap {
        Some(name) => {
            let tap = Tap::open(name, interface, mac, MN, config.bus.async_mtu)?;
            Some(tap.start(threads).context("TAP device")?)
        }
        None => None,
    };
    let (_bridge, frames) = tap.unzip();
    with_link(config, link, mac, watch, frames, run)
}

/// As [`crate::with_link`]. `ethernet`: frames of other programs.
fn with_link<L: Link + Send>(
    config: &Config,
    link: L,
    mac: [u8; 6],
    watch: Arc<Watch>,
    ethernet: Option<Consumer<EthernetFrame>>,
    run: Run<'_>,
) -> anyhow::Result<()> {
    let plans = plan(config);
    let nodes = node_configs(&config.bus, &plans);
    let network = mn_config(config, &nodes, mac);
    // Room for about as many nodes as there are: room for all 239 is over a megabyte, which is locked in memory.
    run(match nodes.len() {
        0..=8 => open::<L, 8>(network, link, watch, ethernet)?,
        9..=32 => open::<L, 32>(network, link, watch, ethernet)?,
        _ => open::<L, NODES_MAX>(network, link, watch, ethernet)?,
    });
    Ok(())
}

/// On the heap, so that moving it does not fill the stack of the caller.
#[inline(never)]
fn open<'a, L: Link + Send + 'a, const NODES: usize>(
    config: MnConfig<'a>,
    link: L,
    watch: Arc<Watch>,
    ethernet: Option<Consumer<EthernetFrame>>,
) -> anyhow::Result<Open<'a>> {
    let mut bus = match Powerlink::<L, NODES>::new(config, link, watch, wall_clock) {
        Ok(bus) => Box::new(bus),
        Err(error) => return Err(anyhow!("network: {error}")),
    };
    if let Some(frames) = ethernet {
        bus.set_ethernet_source(frames);
    }
    let service = Box::new(bus.service());
    Ok(Open { cyclic: bus, service })
}
