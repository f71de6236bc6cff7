//! Opens the main device on a link.
//!
//! In:  a machine file; a network interface, or any link. Out: both halves of the bus, for the time of a call.

use super::setup::{DEVICES_MAX, FRAMES_MAX, devices, network, tables};
use super::{Ethercat, setup};
use crate::Open;
use crate::watch::Watch;
use anyhow::anyhow;
use config::{BusClock, Config};
use ethercat::main::config::Config as Network;
use powerlink::link::Link;
use powerlink::link::raw::{RawConfig, RawLink, Reception};
use std::sync::Arc;

/// Look for an answer this long before sleeping for it, ns: the frame comes back within some tens of microseconds.
pub const ANSWER_SPIN_NS: u64 = 20_000;

/// How the interface of an EtherCAT bus is opened.
pub fn raw_config() -> RawConfig {
    RawConfig {
        every_ether_type: true,
        promiscuous: true,
        spin_ns: ANSWER_SPIN_NS,
        ..RawConfig::default()
    }
}

/// As [`crate::with_interface`].
pub(crate) fn with_interface<T>(
    config: &Config,
    interface: &str,
    watch: Arc<Watch>,
    warn: &mut dyn FnMut(&str),
    run: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let link = RawLink::open(interface, raw_config())?;
    if let reception @ Reception::Calls { .. } = link.reception() {
        warn(&format!("{interface}: {reception}"));
    }
    let mac = link.mac();
    with_link(config, link, mac, watch, run)
}

/// Opens the bus of a machine on a link for the time of a call.
///
/// # Errors
/// A network that cannot be, or what the call gives.
pub fn with_link<L: Link + Send, T>(
    config: &Config,
    link: L,
    mac: [u8; 6],
    watch: Arc<Watch>,
    run: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let plans = setup::plan(config);
    let tables = tables(config, &plans);
    let devices = devices(config, &plans, &tables);
    let network = network(config, &devices);
    // Room for about as many devices as there are, and for some that nobody expects.
    run(match devices.len() {
        0..=12 => open::<L, 16, 2>(config, &network, link, mac, watch)?,
        13..=56 => open::<L, 64, 4>(config, &network, link, mac, watch)?,
        _ => open::<L, DEVICES_MAX, FRAMES_MAX>(config, &network, link, mac, watch)?,
    })
}

/// On the heap, so that moving it does not fill the stack of the caller.
#[inline(never)]
fn open<'a, L: Link + Send + 'a, const N: usize, const F: usize>(
    config: &Config,
    network: &'a Network<'a>,
    link: L,
    mac: [u8; 6],
    watch: Arc<Watch>,
) -> anyhow::Result<Open<'a>> {
    let bus = new::<L, N, F>(config, network, link, mac, watch)?;
    let mut bus = Box::new(bus);
    let service = Box::new(bus.service());
    Ok(Open { cyclic: bus, service })
}

/// A main device on a link that has sent nothing yet.
///
/// # Errors
/// More devices than `N`, more frames than `F`.
pub fn new<'a, L: Link, const N: usize, const F: usize>(
    config: &Config,
    network: &'a Network<'a>,
    link: L,
    mac: [u8; 6],
    watch: Arc<Watch>,
) -> anyhow::Result<Ethercat<'a, L, N, F>> {
    let follows = config.bus.clock == BusClock::Bus;
    let mandatory = config.bus.nodes.iter().map(|node| node.mandatory);
    Ethercat::new(network, mac, link, watch, follows, mandatory).map_err(|error| anyhow!("network: {error}"))
}
