//! The bus whose nodes are the simulated machine of a machine file, in this process.
//!
//! In:  a machine file. Out: both halves of its bus, for the time of a call; the far end of a wire for `simulate`.

use super::paced::Paced;
use super::protocol::simulated;
use super::{NetConfig, SimMachine, VirtualNet, serve};
use ::powerlink::link::memory;
use ::powerlink::link::raw::{RawConfig, RawLink};
use ::powerlink::mn::MnConfig;
use ::powerlink::wire::NetTime;
use anyhow::anyhow;
use bus::ethercat::{self, Ethercat, setup};
use bus::powerlink::managing_node::{mn_config, node_configs};
use bus::powerlink::open::ANSWER_SPIN_NS;
use bus::powerlink::{self, Powerlink};
use bus::watch::Watch;
use bus::{CyclicBus, Open};
use config::Config;
use host::setup::{Process, Role, STACK_SIZE, enter_thread};
use host::signals::StopOnDrop;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Address of the managing node on a wire in memory.
pub(super) const MEMORY_MAC: [u8; 6] = [0x02, 0, 0, 0, 0, 0xF0];

/// A wire in memory, with the machine in a thread of its own at the other end.
///
/// # Errors
/// A machine that cannot be simulated, or what the call gives.
pub fn with_memory<T>(
    config: &Config,
    watch: Arc<Watch>,
    process: &Process,
    run: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let (near, mut far) = memory::pair(ANSWER_SPIN_NS);
    let mut machine = SimMachine::new(config).map_err(|error| anyhow!("{error}"))?;
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let machine_thread = std::thread::Builder::new()
            .name("machine".into())
            .stack_size(STACK_SIZE)
            .spawn_scoped(scope, || {
                drop(enter_thread(Role::Machine, process));
                serve(&mut far, &mut machine, &stop, &mut |_| {}, &mut |_, _| {})
            })?;
        let ended = StopOnDrop(&stop);
        let done = bus::with_link(config, near, MEMORY_MAC, watch, run);
        drop(ended);
        // Our end of its link is gone by now: an error it gives is that.
        let _ = machine_thread.join();
        done
    })
}

/// A wire in memory on paced time.
///
/// # Errors
/// A machine that cannot be simulated, or what the call gives.
pub fn with_paced<T>(
    config: &Config,
    watch: Arc<Watch>,
    run: impl FnOnce(Open<'_>, Paced) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let machine = SimMachine::new(config).map_err(|error| anyhow!("{error}"))?;
    let wire = Paced::new(machine);
    bus::with_link(config, wire.clone(), MEMORY_MAC, watch, |open| run(open, wire))
}

/// Nodes for which there is room on virtual time; where there are more, for all that a bus can have.
const VIRTUAL_NODES: usize = 32;
/// Frames of a cycle of EtherCAT there.
const VIRTUAL_FRAMES: usize = 4;

/// POWERLINK on virtual time.
pub type VirtualPowerlink<'a, const NODES: usize = VIRTUAL_NODES> = Powerlink<'a, VirtualNet, NODES>;
/// EtherCAT on virtual time.
pub type VirtualEthercat<'a, const NODES: usize = VIRTUAL_NODES, const FRAMES: usize = VIRTUAL_FRAMES> =
    Ethercat<'a, VirtualNet, NODES, FRAMES>;
/// Any bus on virtual time.
pub type VirtualBus<'a> = Box<dyn VirtualWire + 'a>;

/// A bus whose time passes when it is told to.
pub trait VirtualTime: CyclicBus {
    /// Lets so much time pass.
    fn advance(&mut self, ns: u64);
}

/// A bus on a [`VirtualNet`].
pub trait VirtualWire: CyclicBus {
    /// The wire and the simulated machine behind it.
    fn net(&mut self) -> &mut VirtualNet;
}

impl<const NODES: usize> VirtualWire for VirtualPowerlink<'_, NODES> {
    fn net(&mut self) -> &mut VirtualNet {
        self.link_mut()
    }
}

impl<const NODES: usize, const FRAMES: usize> VirtualWire for VirtualEthercat<'_, NODES, FRAMES> {
    fn net(&mut self) -> &mut VirtualNet {
        self.link_mut()
    }
}

impl<const NODES: usize> VirtualTime for VirtualPowerlink<'_, NODES> {
    fn advance(&mut self, ns: u64) {
        self.net().advance(ns);
    }
}

impl VirtualTime for VirtualBus<'_> {
    fn advance(&mut self, ns: u64) {
        self.net().advance(ns);
    }
}

/// A wire on virtual time, with disturbances.
///
/// # Errors
/// A machine that cannot be simulated, or what the call gives.
pub fn with_virtual<T>(
    config: &Config,
    net: NetConfig,
    run: impl FnOnce(VirtualBus<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let machine = SimMachine::new(config).map_err(|error| anyhow!("{error}"))?;
    let link = VirtualNet::new(machine, net);
    let mut given = None;
    let run = Box::new(|bus: VirtualBus<'_>| given = Some(run(bus)));
    simulated(config).with_virtual(config, link, Arc::new(Watch::default()), run)?;
    given.unwrap_or_else(|| Err(anyhow!("the bus was not opened")))
}

/// The managing node of a machine on virtual time.
pub(super) fn with_virtual_powerlink(
    config: &Config,
    link: VirtualNet,
    watch: Arc<Watch>,
    run: Box<dyn FnOnce(VirtualBus<'_>) + '_>,
) -> anyhow::Result<()> {
    let plans = bus::plan(config);
    let nodes = node_configs(&config.bus, &plans);
    let network = mn_config(config, &nodes, MEMORY_MAC);
    run(match nodes.len() {
        0..=VIRTUAL_NODES => virtual_powerlink::<VIRTUAL_NODES>(network, link, watch)?,
        _ => virtual_powerlink::<{ powerlink::NODES_MAX }>(network, link, watch)?,
    });
    Ok(())
}

/// The main device of a machine on virtual time.
pub(super) fn with_virtual_ethercat(
    config: &Config,
    link: VirtualNet,
    watch: Arc<Watch>,
    run: Box<dyn FnOnce(VirtualBus<'_>) + '_>,
) -> anyhow::Result<()> {
    let plans = bus::plan(config);
    let tables = setup::tables(config, &plans);
    let devices = setup::devices(config, &plans, &tables);
    let network = setup::network(config, &devices);
    run(match devices.len() {
        0..=VIRTUAL_NODES => virtual_ethercat::<VIRTUAL_NODES, VIRTUAL_FRAMES>(config, &network, link, watch)?,
        _ => virtual_ethercat::<{ setup::DEVICES_MAX }, { setup::FRAMES_MAX }>(config, &network, link, watch)?,
    });
    Ok(())
}

/// On the heap, so that it is not in the frame of the caller, whatever there is room for.
#[inline(never)]
fn virtual_powerlink<'a, const NODES: usize>(
    network: MnConfig<'a>,
    link: VirtualNet,
    watch: Arc<Watch>,
) -> anyhow::Result<VirtualBus<'a>> {
    match VirtualPowerlink::<NODES>::new(network, link, watch, NetTime::default) {
        Ok(bus) => Ok(Box::new(bus)),
        Err(error) => Err(anyhow!("{error}")),
    }
}

/// As [`virtual_powerlink`].
#[inline(never)]
fn virtual_ethercat<'a, const NODES: usize, const FRAMES: usize>(
    config: &Config,
    network: &'a ::ethercat::main::config::Config<'a>,
    link: VirtualNet,
    watch: Arc<Watch>,
) -> anyhow::Result<VirtualBus<'a>> {
    let bus: VirtualEthercat<'a, NODES, FRAMES> = ethercat::open::new(config, network, link, MEMORY_MAC, watch)?;
    Ok(Box::new(bus))
}

/// The far end of a wire: an interface on which the machine of a machine file answers.
///
/// # Errors
/// What the system refuses.
pub fn far_end(config: &Config, interface: &str) -> anyhow::Result<RawLink> {
    let config = RawConfig {
        spin_ns: 0,
        promiscuous: true,
        every_ether_type: simulated(config).takes_every_frame(),
        ..RawConfig::default()
    };
    Ok(RawLink::open(interface, config)?)
}
