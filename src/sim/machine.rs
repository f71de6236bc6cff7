//! The whole simulated machine at the far end of the wire.
//!
//! In:  the machine file; every frame of the managing node; the time.
//! Out: the frames that the nodes answer with, at once; the motion of their motors, worked out after the SoA.
//!
//! The nodes hang on one wire: what one sends, the others hear. Methods that take a node id do what people do to a
//! machine (pull a cable, switch off a drive) and return whether there is such a node.

use super::SimError;
use super::amplifier::Amplifier;
use super::drive::Drive;
use super::faults::{self, FaultOrder, Scripted};
use super::io::Io;
use super::sensors::Sensors;
use super::spindle::Spindle;
use crate::config::{Config, JOINTS_MAX, Joint, Profile};
use cia402::State;
use powerlink::nmt::NmtState;
use powerlink::wire::{ETHER_TYPE, FRAME_LEN_MAX, message};

/// A machine that nobody looks after is looked at this often, ns.
const IDLE_NS: u64 = 100_000_000;
/// Where the message type lies in a frame.
const MESSAGE_TYPE: usize = 14;

#[derive(Debug)]
enum Device {
    Drive(Box<Drive>),
    Io(Box<Io>),
}

#[derive(Debug)]
struct Place {
    id: u8,
    device: Device,
    /// The node hangs on the wire.
    plugged: bool,
    /// PRes that get lost before others are sent.
    pres_to_drop: u32,
}

impl Place {
    fn receive(&mut self, now_ns: u64, frame: &[u8], response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        if !self.plugged {
            return None;
        }
        let length = match &mut self.device {
            Device::Drive(drive) => drive.receive(now_ns, frame, response),
            Device::Io(io) => io.receive(now_ns, frame, response),
        }?;
        self.on_the_wire(length, response)
    }

    /// What is due by the clock.
    fn poll(&mut self, now_ns: u64, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let length = match &mut self.device {
            Device::Drive(drive) => {
                drive.poll(now_ns);
                drive.poll_transmit(now_ns, response)
            }
            Device::Io(io) => {
                io.poll(now_ns);
                io.poll_transmit(now_ns, response)
            }
        }?;
        self.on_the_wire(length, response)
    }

    /// What of an answer really leaves the node.
    fn on_the_wire(&mut self, length: usize, response: &[u8; FRAME_LEN_MAX]) -> Option<usize> {
        if self.pres_to_drop > 0 && message_type(&response[..length]) == Some(message::PRES) {
            self.pres_to_drop -= 1;
            return None;
        }
        self.plugged.then_some(length)
    }
}

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
    places: Vec<Place>,
    /// Index into `places` of each joint's drive and the axis there, or of the I/O node of its amplifier; of one with step pulses none
    /// of these.
    joints: Vec<(usize, u8)>,
    /// `None`: there are none.
    sensors: Option<Sensors>,
    /// Where the loads were when the sensors looked last; `None`: they have not yet.
    loads_mm: Option<[f64; JOINTS_MAX]>,
    faults: Vec<Scripted>,
    response: Box<[u8; FRAME_LEN_MAX]>,
    /// What a node has sent, while the others hear it.
    answer: Box<[u8; FRAME_LEN_MAX]>,
    now_ns: u64,
}

impl SimMachine {
    /// All nodes switched on at time 0 of their clock.
    pub fn new(config: &Config) -> Result<SimMachine, SimError> {
        let period_ns = config.cycle_us.saturating_mul(1000);
        let mut places = Vec::new();
        for (index, node) in config.bus.nodes.iter().enumerate() {
            let device = match node.profile {
                Profile::Cia402 => Device::Drive(Box::new(Drive::new(node, (config, index), period_ns, 0)?)),
                Profile::Io => {
                    let signals = config.sim.signals.iter().filter(|signal| signal.node == index);
                    let signals: Vec<_> = signals.copied().collect();
                    let amplifiers: Vec<_> = Amplifier::at_node(config, index).collect();
                    let spindle = Spindle::new(config);
                    let io = Io::new(node, spindle, &signals, &amplifiers, period_ns.into(), 0)?;
                    Device::Io(Box::new(io))
                }
            };
            places.push(Place {
                id: node.id,
                device,
                plugged: true,
                pres_to_drop: 0,
            });
        }
        let place = |joint: &Joint| {
            let place = joint.analog.map_or(joint.node, |analog| analog.node);
            (place, joint.drive_axis)
        };
        let joints = config.joints.iter().map(place).collect();
        Ok(SimMachine {
            places,
            joints,
            sensors: Sensors::new(config),
            loads_mm: None,
            faults: faults::script(config),
            response: Box::new([0; FRAME_LEN_MAX]),
            answer: Box::new([0; FRAME_LEN_MAX]),
            now_ns: 0,
        })
    }

    /// Takes one frame from the wire; answers go to `send` at once, before anything is worked out.
    ///
    /// RT: no allocation, no locks; bounded by the number of nodes.
    pub fn receive(&mut self, now_ns: u64, frame: &[u8], send: &mut dyn FnMut(&[u8])) {
        self.now_ns = now_ns;
        // No frame is answered by more than one node. The others hear its answer behind the frame, as on any wire.
        let mut answer = None;
        for index in 0..self.places.len() {
            if let Some(length) = self.places[index].receive(now_ns, frame, &mut self.response) {
                send(&self.response[..length]);
                std::mem::swap(&mut self.response, &mut self.answer);
                answer = Some((index, length));
            }
        }
        if let Some((from, length)) = answer {
            self.hear(now_ns, from, length);
        }
        if message_type(frame) == Some(message::SOA) {
            for place in &mut self.places {
                match &mut place.device {
                    Device::Drive(drive) => drive.work(),
                    Device::Io(_) => {}
                }
            }
            // Of where the loads are now, as the drives will tell it, too.
            self.sense();
            self.turn_encoder();
            self.go_wrong();
            for place in &mut self.places {
                match &mut place.device {
                    Device::Drive(_) => {}
                    Device::Io(io) => io.work(),
                }
            }
        }
    }

    /// Lets go wrong what is due.
    fn go_wrong(&mut self) {
        for index in 0..self.faults.len() {
            let mut fault = self.faults[index];
            let id = self.places[fault.place].id;
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
            for place in &mut self.places {
                if let Device::Drive(drive) = &mut place.device {
                    drive.touch(share, closed);
                }
            }
        }
        sensors.update_switches(&loads_mm[..count], &mut |node, bit, closed| {
            if let Device::Io(io) = &mut self.places[node].device {
                io.sense(bit, closed);
            }
        });
    }

    /// The encoder of a spindle that a drive of CiA 402 turns goes with it.
    fn turn_encoder(&mut self) {
        let turns = self.places.iter().find_map(|place| match &place.device {
            Device::Drive(drive) => drive.turns(),
            Device::Io(_) => None,
        });
        let Some(turns) = turns else { return };
        for place in &mut self.places {
            if let Device::Io(io) = &mut place.device {
                io.spindle_mut().led = Some(turns);
            }
        }
    }

    /// What a node has sent, in `answer`, comes to the others.
    fn hear(&mut self, now_ns: u64, from: usize, length: usize) {
        for other in (0..self.places.len()).filter(|other| *other != from) {
            // Nodes answer the managing node only; what they hear of each other is for cross traffic.
            self.places[other].receive(now_ns, &self.answer[..length], &mut self.response);
        }
    }

    /// Looks at the clock: losses of the managing node, drives that go on by themselves, chained nodes that send by time.
    ///
    /// RT: no allocation, no locks; bounded by the number of nodes.
    pub fn poll(&mut self, now_ns: u64, send: &mut dyn FnMut(&[u8])) {
        self.now_ns = now_ns;
        for index in 0..self.places.len() {
            if let Device::Drive(drive) = &self.places[index].device
                && drive.supply_is_back()
            {
                self.power_on(self.places[index].id);
            }
        }
        for index in 0..self.places.len() {
            if let Some(length) = self.places[index].poll(now_ns, &mut self.answer) {
                send(&self.answer[..length]);
                self.hear(now_ns, index, length);
            }
        }
    }

    /// Has a node send a frame that is not POWERLINK (IP) in its next asynchronous slot; false: there is no such node.
    /// What finds no room is lost, as on any network that is too slow for its traffic.
    pub fn send_ethernet(&mut self, node_id: u8, frame: &[u8]) -> bool {
        let device = self.place(node_id).map(|place| &mut place.device);
        device
            .map(|device| match device {
                Device::Drive(drive) => drive.send_ethernet(frame),
                Device::Io(io) => io.send_ethernet(frame),
            })
            .is_some()
    }

    /// When [`SimMachine::poll`] is due if no frame comes before.
    pub fn next_poll_ns(&self) -> u64 {
        let next = self.places.iter().filter_map(|place| match &place.device {
            Device::Drive(drive) => Some(drive.next_poll_ns()),
            Device::Io(io) => io.next_poll_ns(),
        });
        next.min().unwrap_or(self.now_ns + IDLE_NS)
    }

    fn place(&mut self, node_id: u8) -> Option<&mut Place> {
        self.places.iter_mut().find(|place| place.id == node_id)
    }

    fn drive(&mut self, node_id: u8) -> Option<&mut Drive> {
        match &mut self.place(node_id)?.device {
            Device::Drive(drive) => Some(drive),
            Device::Io(_) => None,
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

    /// Loses the next PRes of a node.
    pub fn drop_pres(&mut self, node_id: u8, count: u32) -> bool {
        self.place(node_id).map(|place| place.pres_to_drop = count).is_some()
    }

    /// Pulls the network cable of a node, or plugs it in again; the node itself goes on.
    pub fn plug(&mut self, node_id: u8, plugged: bool) -> bool {
        self.place(node_id).map(|place| place.plugged = plugged).is_some()
    }

    /// Switches a node off; the motor of a drive runs out against its brake.
    pub fn power_off(&mut self, node_id: u8) -> bool {
        let device = self.place(node_id).map(|place| &mut place.device);
        device
            .map(|device| match device {
                Device::Drive(drive) => drive.power_off(),
                Device::Io(io) => io.power_off(),
            })
            .is_some()
    }

    /// Switches a node on again: it starts from its defaults, and the encoder of a drive from zero.
    pub fn power_on(&mut self, node_id: u8) -> bool {
        let now_ns = self.now_ns;
        let device = self.place(node_id).map(|place| &mut place.device);
        device.is_some_and(|device| {
            // What was built once from the same dictionary can be built again.
            match device {
                Device::Drive(drive) => drive.power_on(now_ns).is_ok(),
                Device::Io(io) => {
                    io.power_on(now_ns);
                    true
                }
            }
        })
    }

    /// Switches all nodes on, on a clock that shows `now_ns`.
    pub fn switch_on(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
        for index in 0..self.places.len() {
            self.power_on(self.places[index].id);
        }
    }

    /// What is wired to the inputs 6000h/2 of an I/O node.
    pub fn set_inputs(&mut self, node_id: u8, wired: u8) -> bool {
        match self.place(node_id).map(|place| &mut place.device) {
            Some(Device::Io(io)) => {
                io.set_inputs(wired);
                true
            }
            Some(Device::Drive(_)) | None => false,
        }
    }

    /// Holds the shaft of the spindle behind an I/O node, or lets it go.
    pub fn block_spindle(&mut self, node_id: u8, blocked: bool) -> bool {
        match self.place(node_id).map(|place| &mut place.device) {
            Some(Device::Io(io)) => {
                io.spindle_mut().blocked = blocked;
                true
            }
            Some(Device::Drive(_)) | None => false,
        }
    }

    /// The encoder of the spindle behind an I/O node counts so many that are none; below 0: it loses some.
    pub fn slip_encoder(&mut self, node_id: u8, counts: i64) -> bool {
        match self.place(node_id).map(|place| &mut place.device) {
            Some(Device::Io(io)) => {
                io.spindle_mut().slipped += counts;
                true
            }
            Some(Device::Drive(_)) | None => false,
        }
    }

    /// Turns of the spindle behind an I/O node, whole at its index: what a mark on the chuck would show.
    pub fn spindle_turns(&self, node_id: u8) -> Option<f64> {
        let place = self.places.iter().find(|place| place.id == node_id)?;
        match &place.device {
            Device::Io(io) => Some(io.spindle().turns_from_index()),
            Device::Drive(_) => None,
        }
    }

    /// Outputs 6200h/1 and /2 of an I/O node as they act on the machine.
    pub fn outputs(&self, node_id: u8) -> Option<[u8; 2]> {
        self.places
            .iter()
            .filter(|place| place.id == node_id)
            .find_map(|place| match &place.device {
                Device::Io(io) => Some(io.outputs()),
                Device::Drive(_) => None,
            })
    }

    /// NMT state of a node; [`NmtState::Off`] while it is switched off.
    pub fn nmt_state(&self, node_id: u8) -> Option<NmtState> {
        self.places
            .iter()
            .find(|place| place.id == node_id)
            .map(|place| match &place.device {
                Device::Drive(drive) => drive.nmt_state(),
                Device::Io(io) => io.nmt_state(),
            })
    }

    /// State of a drive's power section.
    pub fn drive_state(&self, id: impl Into<DriveId>) -> Option<State> {
        let id = id.into();
        self.places
            .iter()
            .filter(|place| place.id == id.node)
            .find_map(|place| match &place.device {
                Device::Drive(drive) => drive.state(id.axis),
                Device::Io(_) => None,
            })
    }

    /// Where the load of a joint is, machine coordinates in mm (degrees): what a rule on the machine would show, whatever
    /// the drive and the control believe.
    pub fn joint_position_mm(&self, joint: usize) -> Option<f64> {
        let &(place, axis) = self.joints.get(joint)?;
        match &self.places.get(place)?.device {
            Device::Drive(drive) => drive.machine_position_mm(axis),
            Device::Io(io) => io.load_mm(joint),
        }
    }
}

/// Message type of a POWERLINK frame.
fn message_type(frame: &[u8]) -> Option<u8> {
    let ether_type = frame.get(12..14)?;
    (ether_type == ETHER_TYPE.to_be_bytes())
        .then(|| frame.get(MESSAGE_TYPE).map(|octet| octet & 0x7F))
        .flatten()
}
