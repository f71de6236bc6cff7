//! The seam between the simulated devices and the bus that carries them.
//!
//! A device is an object dictionary that it works on once in every period, as far as the bus leads it. A carrier gives it its
//! objects, its process data and its periods: [`Powerlink`](super::powerlink::Powerlink), [`Ethercat`](super::ethercat::Ethercat).

use super::SimError;
use super::drive::{self, Drive};
use super::io::{self, IO_OBJECTS, Io};
use config::{Config, NodeIndex, Profile};
use obd::{Dictionary, EntryDef};
use powerlink::nmt::NmtState;
use std::fmt;

/// A node of the machine file without its bus.
#[derive(Debug)]
pub(super) enum Device {
    Drive(Box<Drive>),
    Io(Box<Io>),
}

impl Device {
    /// What stands at a place of the machine file, switched on; `objects` has its [`tables`].
    pub(super) fn new<const E: usize, const B: usize>(
        config: &Config,
        index: NodeIndex,
        objects: &mut Dictionary<E, B>,
    ) -> Result<Device, SimError> {
        let period_ns = config.cycle_us.saturating_mul(1000);
        Ok(match config.bus.nodes[index].profile {
            Profile::Cia402 => Device::Drive(Box::new(Drive::new(config, index, period_ns, objects)?)),
            Profile::Io => Device::Io(Box::new(Io::new(config, index, period_ns.into(), objects)?)),
        })
    }

    /// 1000h where the machine file says nothing.
    pub(super) fn device_type(&self) -> u32 {
        match self {
            Device::Drive(_) => cia402::device::DEVICE_TYPE,
            Device::Io(_) => io::DEVICE_TYPE,
        }
    }

    pub(super) fn is_powered(&self) -> bool {
        match self {
            Device::Drive(drive) => drive.is_powered(),
            Device::Io(io) => io.is_powered(),
        }
    }

    /// Its supply goes; the motor of a drive runs out against its brake.
    pub(super) fn power_off(&mut self) {
        match self {
            Device::Drive(drive) => drive.power_off(),
            Device::Io(io) => io.power_off(),
        }
    }

    /// Its supply comes back; `objects` has its defaults again.
    pub(super) fn power_on<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
    ) -> Result<(), SimError> {
        match self {
            Device::Drive(drive) => drive.power_on(objects),
            Device::Io(io) => {
                io.power_on();
                Ok(())
            }
        }
    }
}

/// Tables of the objects of a node, beside those of its bus.
pub(super) fn tables(config: &Config, index: NodeIndex) -> Vec<&'static [EntryDef]> {
    match config.bus.nodes[index].profile {
        Profile::Cia402 => drive::tables(config, index).to_vec(),
        Profile::Io => vec![IO_OBJECTS],
    }
}

/// All nodes of the machine on their bus. A place is an index into the nodes of the machine file.
pub(super) trait Carrier: fmt::Debug + Send {
    /// Takes a frame from the wire; answers go to `send` at once. Whether the drives have moved since it last said so: the machine
    /// looks at its loads then, and has [`Carrier::work_io`] done.
    ///
    /// RT: no locks; bounded by the number of nodes. No allocation while all nodes run; on EtherCAT they take memory for what
    /// they are told by mail, and for a change of their state.
    fn receive(&mut self, now_ns: u64, frame: &[u8], send: &mut dyn FnMut(&[u8])) -> bool;

    /// Looks at the clock; as [`Carrier::receive`] otherwise.
    fn poll(&mut self, now_ns: u64, send: &mut dyn FnMut(&[u8])) -> bool;

    /// A cycle of the nodes of inputs and outputs.
    fn work_io(&mut self);

    /// When [`Carrier::poll`] is due if no frame comes before; `None`: never.
    fn next_poll_ns(&self) -> Option<u64>;

    fn device(&self, place: usize) -> &Device;

    fn device_mut(&mut self, place: usize) -> &mut Device;

    /// Whether the bus leads a node: its outputs count.
    fn is_operational(&self, place: usize) -> bool;

    /// Outputs 6200h/1 and /2 of a node of inputs and outputs.
    fn outputs(&self, place: usize) -> Option<[u8; 2]>;

    /// Pulls the network cable of a node, or plugs it in again.
    fn plug(&mut self, place: usize, plugged: bool);

    /// The next answers of a node to a cycle get lost.
    fn drop_answers(&mut self, place: usize, count: u32);

    fn power_off(&mut self, place: usize);

    /// Switches a node on again; false: it cannot be built again.
    fn power_on(&mut self, place: usize, now_ns: u64) -> bool;

    /// Has a node send a frame of another protocol when it may; what finds no room is lost.
    fn send_ethernet(&mut self, place: usize, frame: &[u8]);

    /// NMT state of a node; [`NmtState::Off`] while it is switched off. `None`: its bus has no such states.
    fn nmt_state(&self, place: usize) -> Option<NmtState>;
}
