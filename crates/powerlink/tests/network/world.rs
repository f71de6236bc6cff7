//! A whole network on virtual time: one managing node, several controlled nodes, an intruder, all on one hub.
//!
//! In:  which nodes there are, how the wires treat frames, what happens to whom. Out: the run of the network, watched frame by
//! frame by [`Watch`]; the events of the managing node.

use std::collections::VecDeque;

use powerlink::link::simulated::{Arrival, Hub, Path, Station};
use powerlink::mn::{BootTimes, MnConfig, MnEvent, NodeConfig, NodeState};
use powerlink::nmt::NmtState;
use powerlink::wire::{FRAME_LEN_MAX, NetTime};

use super::device::{self, ANSWER_NS, Fields, MN_MAC, Node, PDO_BYTES, Pattern, Polling};
use super::supervision::Supervision;
use super::watch::Watch;

/// The managing node of these tests.
pub type Mn = powerlink::mn::Mn<'static, 8>;

/// Boot times of the tests: short, all different.
pub const BOOT: BootTimes = BootTimes {
    wait_not_active_us: 20_000,
    timeout_pre_op_1_us: 80_000,
    wait_pre_op_1_us: 30_000,
    timeout_pre_op_2_us: 400_000,
    timeout_ready_to_operate_us: 200_000,
    reset_pause_us: 10_000,
};
/// Lost PRes in a row that are ridden out.
pub const PRES_LOST_MAX: u32 = 3;
/// A cycle that would begin later than this share of the cycle is left out.
const LATE_SHARE: u64 = 8;
/// More steps than any cycle needs: a loop in the managing node is a failed test.
const STEPS_MAX: u32 = 2_000;

/// What a network is made of.
#[derive(Clone, Debug)]
pub struct Setup {
    pub seed: u64,
    pub mandatory: Vec<u8>,
    pub optional: Vec<u8>,
    pub cycle_ns: u64,
    pub path: Path,
    pub boot: BootTimes,
    /// Threshold of lost PRes, 0x1C09; 0: only those in a row count.
    pub pres_threshold: u32,
    /// Nodes that are not polled in every cycle.
    pub polling: Vec<(u8, Polling)>,
}

impl Setup {
    /// Mandatory nodes 1, 2, ... on good wires.
    pub fn new(seed: u64, nodes: u8) -> Setup {
        Setup {
            seed,
            mandatory: (1..=nodes).collect(),
            optional: Vec::new(),
            cycle_ns: device::CYCLE_NS,
            path: Path {
                jitter_ns: 2_000,
                ..Path::default()
            },
            boot: BOOT,
            pres_threshold: 0,
            polling: Vec::new(),
        }
    }

    pub fn polling_of(&self, id: u8) -> Polling {
        let own = self.polling.iter().find(|(node, _)| *node == id);
        own.map_or(Polling::EveryCycle, |(_, polling)| *polling)
    }
}

/// One controlled node with its cable.
pub struct Device {
    pub id: u8,
    pub station: Station,
    /// `None`: switched off.
    pub node: Option<Box<Node>>,
    outputs: Fields,
    inputs: Fields,
    supervision: Supervision,
    /// Cycle of the newest outputs.
    output_cycle: Option<u32>,
}

/// The managing node's step without the borrow.
enum Step {
    Send(usize),
    WaitUntil(u64),
    IsochronousDone,
    Idle,
}

/// An answer that a node is about to send.
struct Answer {
    at_ns: u64,
    device: usize,
    octets: Vec<u8>,
    cause: Arrival,
    excused: bool,
}

/// Says whether a frame of a node (by id) gets lost where it is sent.
pub type Vanish = Box<dyn FnMut(u8, &[u8]) -> bool>;

/// The network.
pub struct World {
    pub hub: Hub,
    pub mn: Box<Mn>,
    pub mn_station: Station,
    pub devices: Vec<Device>,
    /// A station that keeps no rules.
    pub intruder: Station,
    /// Frames the intruder will send, in the order of time.
    pub intrusions: VecDeque<(u64, Vec<u8>)>,
    /// Frames that vanish where they are sent.
    pub vanish: Vanish,
    pub now_ns: u64,
    pub cycle_ns: u64,
    next_start_ns: u64,
    /// Cycles begun.
    pub cycle: u64,
    /// The managing node's thread is kept from running: before this step of the coming cycle, for this time.
    pub nap: Option<(u32, u64)>,
    napped: bool,
    watch: Watch,
    /// Events of the managing node, with the time they were taken.
    pub events: Vec<(u64, MnEvent)>,
    inbox: VecDeque<(Arrival, Vec<u8>)>,
    answers: VecDeque<Answer>,
    buffer: Box<[u8; FRAME_LEN_MAX]>,
    response: Box<[u8; FRAME_LEN_MAX]>,
}

impl World {
    pub fn new(setup: &Setup) -> World {
        // The managing node borrows its configuration; a test ends before that counts as a leak.
        let mut ids: Vec<_> = setup.mandatory.iter().map(|id| (*id, true)).collect();
        ids.extend(setup.optional.iter().map(|id| (*id, false)));
        let nodes: Vec<NodeConfig<'static>> = ids
            .iter()
            .map(|(id, mandatory)| {
                let polling = setup.polling_of(*id);
                let configuration = device::configuration(setup.cycle_ns, polling).leak();
                NodeConfig {
                    pres_threshold: setup.pres_threshold,
                    ..device::node_config(*id, *mandatory, polling, configuration)
                }
            })
            .collect();
        let mut pres_mn_bytes = None;
        let mut multiplex_cycles = 0;
        for (_, polling) in &setup.polling {
            match *polling {
                Polling::EveryCycle => {}
                Polling::Multiplexed { of, .. } => multiplex_cycles = of,
                Polling::Chained { offset } => pres_mn_bytes = pres_mn_bytes.max(Some(offset + PDO_BYTES as u16)),
            }
        }
        let config = MnConfig {
            pres_mn_bytes,
            multiplex_cycles,
            cycle_ns: setup.cycle_ns as u32,
            boot: setup.boot,
            pres_lost_max: PRES_LOST_MAX,
            nodes: nodes.leak(),
            mac: MN_MAC,
            ..MnConfig::default()
        };
        let mut hub = Hub::new(setup.seed);
        let mn_station = hub.attach(setup.path.clone());
        let devices: Vec<Device> = ids
            .iter()
            .map(|(id, _)| {
                let node = device::node(*id, 0);
                Device {
                    id: *id,
                    station: hub.attach(setup.path.clone()),
                    outputs: Fields::of(&node, 0x2000),
                    inputs: Fields::of(&node, 0x2001),
                    supervision: Supervision::new(&node, *id),
                    node: Some(Box::new(node)),
                    output_cycle: None,
                }
            })
            .collect();
        let intruder = hub.attach(Path::default());
        let ids: Vec<u8> = ids.iter().map(|(id, _)| *id).collect();
        World {
            watch: Watch::new(&ids, ids.len() + 2, setup),
            hub,
            mn: Box::new(Mn::new(config).unwrap()),
            mn_station,
            devices,
            intruder,
            intrusions: VecDeque::new(),
            vanish: Box::new(|_, _| false),
            now_ns: 0,
            cycle_ns: setup.cycle_ns,
            next_start_ns: 0,
            cycle: 0,
            nap: None,
            napped: false,
            events: Vec::new(),
            inbox: VecDeque::new(),
            answers: VecDeque::new(),
            buffer: Box::new([0; FRAME_LEN_MAX]),
            response: Box::new([0; FRAME_LEN_MAX]),
        }
    }

    /// Runs one cycle, up to the start of the next one.
    pub fn cycle(&mut self) {
        let nap = self.nap.take();
        if let Some((0, duration_ns)) = nap {
            self.sleep(duration_ns);
        }
        if self.now_ns > self.next_start_ns + self.cycle_ns / LATE_SHARE {
            self.next_start_ns += (self.now_ns - self.next_start_ns).div_ceil(self.cycle_ns) * self.cycle_ns;
            while self.advance(self.next_start_ns, true) {}
        }
        self.cycle += 1;
        self.next_start_ns += self.cycle_ns;
        for (index, device) in self.devices.iter().enumerate() {
            let octets = Pattern::new(self.cycle, device.id).octets();
            self.mn.output_mut(index).copy_from_slice(&octets);
        }
        self.mn.set_outputs_valid(true);
        self.watch.cycle_starts(self.now_ns, self.napped || nap.is_some());
        self.napped = nap.is_some();
        let net_time = NetTime {
            seconds: (self.now_ns / 1_000_000_000) as u32,
            nanoseconds: (self.now_ns % 1_000_000_000) as u32,
        };
        self.mn.start_cycle(self.now_ns, net_time);
        self.take_events();
        let done = self.steps(nap);
        while self.take_inbox() {}
        while self.advance(self.next_start_ns, true) {}
        assert!(
            done == 1 || nap.is_some(),
            "{}: IsochronousDone {done} times in a cycle",
            self.now_ns
        );
        self.watch.cycle_ends(self.now_ns, &self.mn);
    }

    /// The loop of the managing node's caller; how often inputs were complete.
    fn steps(&mut self, nap: Option<(u32, u64)>) -> u32 {
        let mut done = 0;
        for step in 1.. {
            assert!(
                step < STEPS_MAX,
                "{}: the managing node does not come to an end",
                self.now_ns
            );
            if let Some((at, duration_ns)) = nap
                && at == step
            {
                self.sleep(duration_ns);
            }
            if self.now_ns >= self.next_start_ns {
                break;
            }
            self.watch.mn_polled(self.now_ns);
            let step = match self.mn.poll(self.now_ns) {
                powerlink::mn::Step::Send(frame) => {
                    self.response[..frame.len()].copy_from_slice(frame);
                    Step::Send(frame.len())
                }
                powerlink::mn::Step::WaitUntil(until_ns) => Step::WaitUntil(until_ns),
                powerlink::mn::Step::IsochronousDone => Step::IsochronousDone,
                powerlink::mn::Step::Idle => Step::Idle,
            };
            self.take_events();
            match step {
                Step::Send(length) => {
                    let frame = &self.response[..length];
                    self.watch.mn_sends(self.now_ns, self.mn_station, frame);
                    if !(self.vanish)(powerlink::wire::node::MN, frame) {
                        // An unplugged cable is no error here.
                        let _ = self.hub.send(self.mn_station, self.now_ns, frame);
                        self.look_for_collision();
                    }
                }
                Step::WaitUntil(until_ns) => {
                    if !self.take_inbox() {
                        self.advance(until_ns.min(self.next_start_ns), true);
                    }
                }
                Step::IsochronousDone => {
                    done += 1;
                    self.watch.inputs(self.now_ns, &self.mn);
                }
                Step::Idle => break,
            }
        }
        done
    }

    fn look_for_collision(&mut self) {
        if let Some(collision) = self.hub.take_collision() {
            self.watch.collision(collision);
        }
    }

    /// Time passes and the managing node does not run.
    fn sleep(&mut self, duration_ns: u64) {
        self.advance(self.now_ns + duration_ns, false);
    }

    /// Hands the managing node a frame that arrived while it slept.
    fn take_inbox(&mut self) -> bool {
        let Some((arrival, octets)) = self.inbox.pop_front() else {
            return false;
        };
        let intruder = arrival.from == self.intruder;
        self.watch.mn_hears(self.now_ns, &octets, &arrival, intruder);
        self.mn.receive(self.now_ns, &octets);
        self.take_events();
        true
    }

    fn take_events(&mut self) {
        while let Some(event) = self.mn.pop_event() {
            self.watch.event(self.now_ns, &event);
            self.events.push((self.now_ns, event));
        }
    }

    /// Time passes until then, or until the managing node has been handed a frame: true.
    fn advance(&mut self, until_ns: u64, awake: bool) -> bool {
        loop {
            let deadlines = self
                .devices
                .iter()
                .filter_map(|device| device.node.as_ref()?.next_deadline_ns());
            let deadline_ns = deadlines.min().unwrap_or(u64::MAX);
            let answer_ns = self.answers.front().map_or(u64::MAX, |answer| answer.at_ns);
            let intrusion_ns = self.intrusions.front().map_or(u64::MAX, |intrusion| intrusion.0);
            let arrival_ns = self.hub.next_ns().unwrap_or(u64::MAX);
            let next_ns = deadline_ns.min(answer_ns).min(intrusion_ns).min(arrival_ns);
            if next_ns > until_ns {
                self.now_ns = self.now_ns.max(until_ns);
                return false;
            }
            self.now_ns = self.now_ns.max(next_ns);
            if deadline_ns == next_ns {
                for index in 0..self.devices.len() {
                    self.poll_device(index);
                }
            } else if answer_ns == next_ns {
                self.send_answer();
            } else if intrusion_ns == next_ns {
                if let Some((_, octets)) = self.intrusions.pop_front() {
                    self.watch.intruder_sends(self.now_ns, self.intruder, &octets);
                    let _ = self.hub.send(self.intruder, self.now_ns, &octets);
                    self.look_for_collision();
                }
            } else if self.arrive(awake) {
                return true;
            }
        }
    }

    /// The next frame arrives; true if the managing node was handed it.
    fn arrive(&mut self, awake: bool) -> bool {
        let Some(arrival) = self.hub.receive(self.now_ns, &mut self.buffer[..]) else {
            return false;
        };
        if arrival.to == self.mn_station {
            self.inbox.push_back((arrival, self.buffer[..arrival.length].to_vec()));
            return awake && self.take_inbox();
        }
        if let Some(index) = self.devices.iter().position(|device| device.station == arrival.to) {
            self.device_hears(index, arrival);
        }
        false
    }

    fn send_answer(&mut self) {
        let Some(answer) = self.answers.pop_front() else { return };
        let device = &self.devices[answer.device];
        if (self.vanish)(device.id, &answer.octets) || device.node.is_none() {
            return;
        }
        let Ok(frame) = powerlink::wire::Frame::parse(&answer.octets) else {
            panic!("{}: node {} sent {:02x?}", self.now_ns, device.id, answer.octets)
        };
        // The state when the answer was decided on is what the frame says; for ASnd it does not matter.
        let state = match frame {
            powerlink::wire::Frame::Pres(pres) => pres.nmt_state,
            _ => NmtState::PreOperational1,
        };
        let (now_ns, id) = (self.now_ns, device.id);
        self.watch
            .node_sends(now_ns, id, state, &answer.octets, &answer.cause, answer.excused);
        if self.hub.send(device.station, now_ns, &answer.octets).is_ok() {
            self.look_for_collision();
        }
    }

    fn poll_device(&mut self, index: usize) {
        let device = &mut self.devices[index];
        let Some(node) = &mut device.node else { return };
        let before = node.nmt_state();
        device.supervision.time(self.now_ns);
        node.poll(self.now_ns);
        device.supervision.compare(self.now_ns, node);
        let after = node.nmt_state();
        if before != after {
            self.watch.node_state(self.now_ns, device.id, before, after, None);
        }
        if let Some(length) = node.poll_transmit(self.now_ns, &mut self.response) {
            let octets = &self.response[..length];
            if !(self.vanish)(device.id, octets) {
                self.watch
                    .chained_sends(self.now_ns, device.id, device.station, after, octets);
                let _ = self.hub.send(device.station, self.now_ns, octets);
                self.look_for_collision();
            }
        }
    }

    fn device_hears(&mut self, index: usize, arrival: Arrival) {
        self.poll_device(index);
        let device = &mut self.devices[index];
        let Some(node) = &mut device.node else { return };
        let octets = &self.buffer[..arrival.length];
        let before = node.nmt_state();
        device.supervision.frame(self.now_ns, octets);
        let reaction = node.receive(self.now_ns, octets, &mut self.response);
        device.supervision.compare(self.now_ns, node);
        let after = node.nmt_state();
        if before != after {
            self.watch
                .node_state(self.now_ns, device.id, before, after, Some(octets));
        }
        let excused = arrival.from == self.intruder;
        if reaction.events.outputs && !arrival.faults.corrupted && !excused {
            let pattern = device.outputs.read(node);
            let (now_ns, id) = (self.now_ns, device.id);
            assert!(pattern.is_whole(id), "{now_ns}: torn output of node {id}: {pattern:x?}");
            let newest = device.output_cycle.replace(pattern.cycle());
            assert!(
                newest.is_none_or(|newest| newest <= pattern.cycle()) || arrival.faults.any(),
                "{now_ns}: stale output of node {id}: {pattern:x?} after {newest:x?}"
            );
        }
        if reaction.events.sync.is_some() {
            device.inputs.write(node, Pattern::new(self.cycle, device.id));
        }
        if let Some(length) = reaction.transmit {
            self.answers.push_back(Answer {
                at_ns: self.now_ns + ANSWER_NS,
                device: index,
                octets: self.response[..length].to_vec(),
                cause: arrival,
                excused,
            });
        }
    }

    /// Switches a device off, or on again.
    pub fn power(&mut self, index: usize, on: bool) {
        let device = &mut self.devices[index];
        device.node = on.then(|| Box::new(device::node(device.id, self.now_ns)));
        device.output_cycle = None;
        if let Some(node) = &device.node {
            device.supervision = Supervision::new(node, device.id);
        }
        self.hub.plug(device.station, on);
    }

    /// All nodes, and the managing node, are OPERATIONAL.
    pub fn is_operational(&self) -> bool {
        let nodes = 0..self.devices.len();
        self.mn.nmt_state() == NmtState::Operational
            && nodes
                .into_iter()
                .all(|index| self.mn.node_state(index) == NodeState::Operational)
    }

    /// Runs cycles until everything is OPERATIONAL; how many. Fails after `most`.
    pub fn run_until_operational(&mut self, most: u64) -> u64 {
        for cycles in 0..most {
            if self.is_operational() {
                return cycles;
            }
            self.cycle();
        }
        let states: Vec<_> = self
            .devices
            .iter()
            .map(|device| (device.id, device.node.as_ref().map(|node| node.nmt_state())))
            .collect();
        let last = &self.events[self.events.len().saturating_sub(20)..];
        panic!(
            "{}: not OPERATIONAL after {most} cycles: MN {:?}, nodes {states:?}, last events {last:#?}",
            self.now_ns,
            self.mn.nmt_state()
        );
    }

    /// Runs some cycles; data go both ways, to and from every node.
    pub fn check_data(&mut self) {
        self.run(10);
        for (index, device) in self.devices.iter().enumerate() {
            let input = Pattern::from_octets(self.mn.input(index).data).cycle();
            let output = device.output_cycle.unwrap_or(0);
            let oldest = self.cycle as u32 - 5;
            let (now_ns, id) = (self.now_ns, device.id);
            assert!(
                input >= oldest && output >= oldest,
                "{now_ns}: node {id} is OPERATIONAL, but its data are old: {input}, {output} in cycle {}",
                self.cycle
            );
        }
    }

    /// Events of the managing node that say something is wrong.
    pub fn troubles(&self) -> Vec<&MnEvent> {
        let events = self.events.iter().map(|(_, event)| event);
        let is_trouble = |event: &&MnEvent| match event {
            MnEvent::NmtStateChanged { .. } | MnEvent::Identified { .. } | MnEvent::Configuring { .. } => false,
            MnEvent::NodeStateChanged { state, .. } => *state == NodeState::Faulted,
            _ => true,
        };
        events.filter(is_trouble).collect()
    }

    /// Runs so many cycles.
    pub fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// Changes how the wires to the managing node and to all nodes treat frames.
    pub fn set_paths(&mut self, change: impl Fn(&mut Path)) {
        change(self.hub.path_mut(self.mn_station));
        for device in &self.devices {
            change(self.hub.path_mut(device.station));
        }
    }
}
