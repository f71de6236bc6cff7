//! The whole simulated machine at the far end of the wire.
//!
//! In:  the machine file; every frame of the managing node; the time.
//! Out: the frames that the nodes answer with, at once; the motion of their motors, worked out after the SoA.
//!
//! Methods that take a node id do what people do to a machine (pull a cable, switch off a drive) and return whether there is such
//! a node.

use super::SimError;
use super::carrier::{Carrier, Device};
use super::drive::Drive;
use super::faults::{self, Scripted};
use super::io::Io;
use super::protocol::simulated;
use super::sensors::Sensors;
use cia402::State;
use config::{Config, JOINTS_MAX, Joint};
use machine::fault_order::FaultOrder;
use powerlink::nmt::NmtState;

/// A machine that nobody looks after is looked at this often, ns.
const IDLE_NS: u64 = 100_000_000;
/// A drive: its node id, and which of the axes of that node it is. A node id alone is its first axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveId {
    pub node: u8,
    /// From 0.
    pub axis: u8,
}

impl From<u8> for DriveId {
    fn from(node: u8) -> DriveId {
        DriveId { node, axis: 0 }
    }
}

impl From<(u8, u8)> for DriveId {
    fn from((node, axis): (u8, u8)) -> DriveId {
        DriveId { node, axis }
    }
}

/// All nodes of a machine file.
#[derive(Debug)]
pub struct SimMachine {
    carrier: Box<dyn Carrier>,
    /// Ids of the nodes, in the order of the machine file.
    ids: Vec<u8>,
    /// Place of each joint's drive and the axis there, or of the I/O node of its amplifier; of one with step pulses none of these.
    joints: Vec<(usize, u8)>,
    /// `None`: there are none.
    sensors: Option<Sensors>,
    /// Where the loads were when the sensors looked last; `None`: they have not yet.
    loads_mm: Option<[f64; JOINTS_MAX]>,
    faults: Vec<Scripted>,
    now_ns: u64,
}

impl SimMachine {
    /// All nodes switched on at time 0 of their clock, on the bus of the machine file.
    pub fn new(config: &Config) -> Result<SimMachine, SimError> {
        let place = |joint: &Joint| {
            let place = joint.analog.map_or(joint.node, |analog| analog.node);
            (place, joint.drive_axis)
        };
        Ok(SimMachine {
            carrier: simulated(config).nodes(config)?,
            ids: config.bus.nodes.iter().map(|node| node.id).collect(),
            joints: config.joints.iter().map(place).collect(),
            sensors: Sensors::new(config),
            loads_mm: None,
            faults: faults::script(config),
            now_ns: 0,
        })
    }

    /// Takes one frame from the wire; answers go to `send` at once, before anything is worked out.
    ///
    /// RT: no locks; bounded by the number of nodes. No allocation while all nodes run; on EtherCAT they take memory for what
    /// they are told by mail, and for a change of their state.
    pub fn receive(&mut self, now_ns: u64, frame: &[u8], send: &mut dyn FnMut(&[u8])) {
        self.now_ns = now_ns;
        if self.carrier.receive(now_ns, frame, send) {
            self.work();
        }
    }

    /// What becomes of a period in which drives have moved.
    fn work(&mut self) {
        // Of where the loads are now, as the drives will tell it, too.
        self.sense();
        self.turn_encoder();
        self.go_wrong();
        self.carrier.work_io();
    }

    /// Lets go wrong what is due.
    fn go_wrong(&mut self) {
        for index in 0..self.faults.len() {
            let mut fault = self.faults[index];
            let id = self.ids[fault.place];
            if fault.is_due(self.now_ns, self.drive_state((id, fault.axis))) {
                fault.strike(self, id);
            }
            self.faults[index] = fault;
        }
    }

    /// Lets the sensors look at the loads.
    fn sense(&mut self) {
        let Some(sensors) = &self.sensors else { return };
        let mut loads_mm = [0.0; JOINTS_MAX];
        let count = self.joints.len();
        for (joint, load_mm) in loads_mm.iter_mut().enumerate().take(count) {
            *load_mm = self.joint_position_mm(joint).unwrap_or(0.0);
        }
        let before_mm = self.loads_mm.replace(loads_mm).unwrap_or(loads_mm);
        if let Some((share, closed)) = sensors.touch(&before_mm[..count], &loads_mm[..count]) {
            for place in 0..self.ids.len() {
                if let Device::Drive(drive) = self.carrier.device_mut(place) {
                    drive.touch(share, closed);
                }
            }
        }
        sensors.update_switches(&loads_mm[..count], &mut |node, bit, closed| {
            if let Device::Io(io) = self.carrier.device_mut(node) {
                io.sense(bit, closed);
            }
        });
    }

    /// The encoder of a spindle that a drive of CiA 402 turns goes with it.
    fn turn_encoder(&mut self) {
        let mut places = 0..self.ids.len();
        let turns = places.find_map(|place| match self.carrier.device(place) {
            Device::Drive(drive) => drive.turns(),
            Device::Io(_) => None,
        });
        let Some(turns) = turns else { return };
        for place in 0..self.ids.len() {
            if let Device::Io(io) = self.carrier.device_mut(place) {
                io.spindle_mut().led = Some(turns);
            }
        }
    }

    /// Looks at the clock: losses of the managing node, drives that go on by themselves, chained nodes that send by time.
    ///
    /// RT as [`SimMachine::receive`].
    pub fn poll(&mut self, now_ns: u64, send: &mut dyn FnMut(&[u8])) {
        self.now_ns = now_ns;
        for place in 0..self.ids.len() {
            if let Device::Drive(drive) = self.carrier.device(place)
                && drive.supply_is_back()
            {
                self.carrier.power_on(place, now_ns);
            }
        }
        if self.carrier.poll(now_ns, send) {
            self.work();
        }
    }

    /// Has a node send a frame that is not of its bus (IP) when it may; false: there is no such node.
    /// What finds no room is lost, as on any network that is too slow for its traffic.
    pub fn send_ethernet(&mut self, node_id: u8, frame: &[u8]) -> bool {
        let place = self.place(node_id);
        place.map(|place| self.carrier.send_ethernet(place, frame)).is_some()
    }

    /// When [`SimMachine::poll`] is due if no frame comes before.
    pub fn next_poll_ns(&self) -> u64 {
        self.carrier.next_poll_ns().unwrap_or(self.now_ns + IDLE_NS)
    }

    fn place(&self, node_id: u8) -> Option<usize> {
        self.ids.iter().position(|id| *id == node_id)
    }

    fn drive(&mut self, node_id: u8) -> Option<&mut Drive> {
        match self.carrier.device_mut(self.place(node_id)?) {
            Device::Drive(drive) => Some(drive),
            Device::Io(_) => None,
        }
    }

    fn io(&mut self, node_id: u8) -> Option<&mut Io> {
        match self.carrier.device_mut(self.place(node_id)?) {
            Device::Io(io) => Some(io),
            Device::Drive(_) => None,
        }
    }

    /// A fault inside a drive; see [`cia402::error_text`] for codes.
    pub fn raise_drive_fault(&mut self, id: impl Into<DriveId>, error_code: u16) -> bool {
        let id = id.into();
        self.drive(id.node)
            .is_some_and(|drive| drive.raise_fault(id.axis, error_code))
    }

    /// Warning bit, remote bit and refusals of a drive.
    pub fn drive_injected(&mut self, id: impl Into<DriveId>) -> Option<&mut cia402::device::Injected> {
        let id = id.into();
        self.drive(id.node)?.injected(id.axis)
    }

    /// Lets something go wrong with an axis of a drive, or mends it.
    pub fn fault(&mut self, id: impl Into<DriveId>, order: FaultOrder) -> bool {
        let id = id.into();
        self.drive(id.node).is_some_and(|drive| drive.fault(id.axis, order))
    }

    /// Jams what a drive moves, or lets it go.
    pub fn jam(&mut self, id: impl Into<DriveId>, jammed: bool) -> bool {
        let id = id.into();
        self.drive(id.node).is_some_and(|drive| drive.jam(id.axis, jammed))
    }

    /// Loses the next answers of a node to a cycle.
    pub fn drop_pres(&mut self, node_id: u8, count: u32) -> bool {
        let place = self.place(node_id);
        place.map(|place| self.carrier.drop_answers(place, count)).is_some()
    }

    /// Pulls the network cable of a node, or plugs it in again; the node itself goes on.
    pub fn plug(&mut self, node_id: u8, plugged: bool) -> bool {
        self.place(node_id)
            .map(|place| self.carrier.plug(place, plugged))
            .is_some()
    }

    /// Switches a node off; the motor of a drive runs out against its brake.
    pub fn power_off(&mut self, node_id: u8) -> bool {
        self.place(node_id).map(|place| self.carrier.power_off(place)).is_some()
    }

    /// Switches a node on again: it starts from its defaults, and the encoder of a drive from zero.
    pub fn power_on(&mut self, node_id: u8) -> bool {
        let now_ns = self.now_ns;
        let place = self.place(node_id);
        place.is_some_and(|place| self.carrier.power_on(place, now_ns))
    }

    /// Switches all nodes on, on a clock that shows `now_ns`.
    pub fn switch_on(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
        for place in 0..self.ids.len() {
            self.carrier.power_on(place, now_ns);
        }
    }

    /// What is wired to the inputs 6000h/2 of an I/O node.
    pub fn set_inputs(&mut self, node_id: u8, wired: u8) -> bool {
        self.io(node_id).map(|io| io.set_inputs(wired)).is_some()
    }

    /// Holds the shaft of the spindle behind an I/O node, or lets it go.
    pub fn block_spindle(&mut self, node_id: u8, blocked: bool) -> bool {
        self.io(node_id).map(|io| io.spindle_mut().blocked = blocked).is_some()
    }

    /// The encoder of the spindle behind an I/O node counts so many that are none; below 0: it loses some.
    pub fn slip_encoder(&mut self, node_id: u8, counts: i64) -> bool {
        self.io(node_id).map(|io| io.spindle_mut().slipped += counts).is_some()
    }

    /// Turns of the spindle behind an I/O node, whole at its index: what a mark on the chuck would show.
    pub fn spindle_turns(&self, node_id: u8) -> Option<f64> {
        match self.carrier.device(self.place(node_id)?) {
            Device::Io(io) => Some(io.spindle().turns_from_index()),
            Device::Drive(_) => None,
        }
    }

    /// Outputs 6200h/1 and /2 of an I/O node as they act on the machine.
    pub fn outputs(&self, node_id: u8) -> Option<[u8; 2]> {
        self.carrier.outputs(self.place(node_id)?)
    }

    /// NMT state of a node; [`NmtState::Off`] while it is switched off. `None`: there is no such node, or its bus has no such states.
    pub fn nmt_state(&self, node_id: u8) -> Option<NmtState> {
        self.carrier.nmt_state(self.place(node_id)?)
    }

    /// Whether a node has its supply.
    pub fn is_powered(&self, node_id: u8) -> Option<bool> {
        Some(self.carrier.device(self.place(node_id)?).is_powered())
    }

    /// Whether the bus leads a node.
    pub fn is_operational(&self, node_id: u8) -> Option<bool> {
        Some(self.carrier.is_operational(self.place(node_id)?))
    }

    /// State of a drive's power section.
    pub fn drive_state(&self, id: impl Into<DriveId>) -> Option<State> {
        let id = id.into();
        match self.carrier.device(self.place(id.node)?) {
            Device::Drive(drive) => drive.state(id.axis),
            Device::Io(_) => None,
        }
    }

    /// Where the load of a joint is, machine coordinates in mm (degrees): what a rule on the machine would show, whatever
    /// the drive and the control believe.
    pub fn joint_position_mm(&self, joint: usize) -> Option<f64> {
        let &(place, axis) = self.joints.get(joint)?;
        if place >= self.ids.len() {
            return None;
        }
        match self.carrier.device(place) {
            Device::Drive(drive) => drive.machine_position_mm(axis),
            Device::Io(io) => io.load_mm(joint),
        }
    }
}
