//! Opens the main device on a link.
//!
//! In:  a machine file; a network interface, or any link. Out: both halves of the bus, for the time of a call.

use super::setup::{DEVICES_MAX, FRAMES_MAX, devices, network, tables};
use super::{Ethercat, setup};
use crate::Open;
use crate::plan::NodePlan;
use crate::protocol::{Master, Run};
use crate::service::BudgetView;
use crate::watch::Watch;
use anyhow::anyhow;
use config::{BusClock, Config, ConfigErrors};
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

/// EtherCAT for a whole machine.
pub(crate) struct MainDevice;

impl Master for MainDevice {
    fn check(&self, config: &Config) -> Result<(), ConfigErrors> {
        setup::check(config)
    }

    fn plan(&self, config: &Config) -> Vec<NodePlan> {
        setup::plan(config)
    }

    fn budget(&self, config: &Config) -> Vec<BudgetView> {
        setup::budget(config)
    }

    fn worst_exchange_ns(&self, config: &Config) -> u64 {
        setup::worst_exchange_ns(config)
    }

    fn with_interface(
        &self,
        config: &Config,
        interface: &str,
        watch: Arc<Watch>,
        _threads: fn(),
        warn: &mut dyn FnMut(&str),
        run: Run<'_>,
    ) -> anyhow::Result<()> {
        let link = RawLink::open(interface, raw_config())?;
        if let reception @ Reception::Calls { .. } = link.reception() {
            warn(&format!("{interface}: {reception}"));
        }
        let mac = link.mac();
        with_link(config, link, mac, watch, run)
    }

    fn with_link(
        &self,
        config: &Config,
        link: Box<dyn Link + Send + '_>,
        mac: [u8; 6],
        watch: Arc<Watch>,
        run: Run<'_>,
    ) -> anyhow::Result<()> {
        with_link(config, link, mac, watch, run)
    }
}

/// As [`crate::with_link`].
fn with_link<L: Link + Send>(
    config: &Config,
    link: L,
    mac: [u8; 6],
    watch: Arc<Watch>,
    run: Run<'_>,
) -> anyhow::Result<()> {
    let plans = setup::plan(config);
    let tables = tables(config, &plans);
    let devices = devices(config, &plans, &tables);
    let network = network(config, &devices);
    // Room for about as many devices as there are, and for some that nobody expects.
    run(match devices.len() {
        0..=12 => open::<L, 16, 2>(config, &network, link, mac, watch)?,
        13..=56 => open::<L, 64, 4>(config, &network, link, mac, watch)?,
        _ => open::<L, DEVICES_MAX, FRAMES_MAX>(config, &network, link, mac, watch)?,
    });
    Ok(())
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
