//! Opens the managing node on a link.
//!
//! In:  a machine file; a network interface, or any link. Out: both halves of the bus, for the time of a call.

use super::managing_node::{mn_config, node_configs};
use super::network::plan;
use super::tap::Tap;
use super::{NODES_MAX, Powerlink, wall_clock};
use crate::watch::Watch;
use crate::{EthernetFrame, Open};
use anyhow::{Context, anyhow};
use config::{BusLink, Config};
use powerlink::link::Link;
use powerlink::link::pnet::PnetLink;
use powerlink::link::raw::{RawConfig, RawLink, Reception};
use powerlink::mn::MnConfig;
use powerlink::wire::node::MN;
use rtrb::Consumer;
use std::sync::Arc;

/// Look for an answer this long before sleeping for it, ns: longer than a quick node takes, too short to matter.
pub const ANSWER_SPIN_NS: u64 = 20_000;

/// As [`crate::with_interface`].
pub(crate) fn with_interface<T>(
    config: &Config,
    interface: &str,
    watch: Arc<Watch>,
    threads: fn(),
    warn: &mut dyn FnMut(&str),
    run: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
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

/// Opens the bus on a link, with the TAP device that the machine file wants.
fn with_tap<L: Link + Send, T>(
    config: &Config,
    interface: &str,
    link: L,
    mac: [u8; 6],
    watch: Arc<Watch>,
    threads: fn(),
    run: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
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

/// Opens the bus of a machine on a link for the time of a call. `ethernet`: frames of other programs.
///
/// # Errors
/// A network that cannot be, or what the call gives.
pub fn with_link<L: Link + Send, T>(
    config: &Config,
    link: L,
    mac: [u8; 6],
    watch: Arc<Watch>,
    ethernet: Option<Consumer<EthernetFrame>>,
    run: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let plans = plan(config);
    let nodes = node_configs(&config.bus, &plans);
    let network = mn_config(config, &nodes, mac);
    // Room for about as many nodes as there are: room for all 239 is over a megabyte, which is locked in memory.
    run(match nodes.len() {
        0..=8 => open::<L, 8>(network, link, watch, ethernet)?,
        9..=32 => open::<L, 32>(network, link, watch, ethernet)?,
        _ => open::<L, NODES_MAX>(network, link, watch, ethernet)?,
    })
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
