//! The toy bus of tests: in each cycle one frame to all devices and one back, and nothing else. No boot-up, no parameters.
//!
//! In:  images once a cycle. Out: a frame with the outputs of all nodes; of its answer, their inputs.
//!
//! | octets | frame to the devices | their answer |
//! |---|---|---|
//! | 0 to 13 | Ethernet header, type 88B5h (local experiments) | the same |
//! | 14 | 1 | 2 |
//! | 15 | number of the cycle, which wraps | the same |
//! | from 16 | outputs of each node | of each node 1 and its inputs, or 0 and octets without meaning |
//!
//! It is there so that what stands above the bus meets a third one, with devices that come as the machine file has them.

use crate::ethercat::open::raw_config;
use crate::ethercat::setup;
use crate::frames::FrameKind;
use crate::plan::NodePlan;
use crate::powerlink::link_failure;
use crate::protocol::{self, Run};
use crate::service::{
    BudgetView, Diagnose, Mailbox, MailboxError, MailboxFull, MailboxReply, MailboxRequest, NetworkLive, NodeLive,
};
use crate::watch::Watch;
use crate::{
    BusEvent, BusState, CycleReport, CyclicBus, FRAME_OCTETS_MAX, InputImage, NodeIndex, NodeState, NodeStatistics,
    Open, OutputImage, TimeReference, in_the_kernel,
};
use config::{Config, ConfigErrors, Mapped, wire_time_ns};
use powerlink::link::Link;
use powerlink::link::raw::RawLink;
use std::collections::VecDeque;
use std::sync::Arc;

/// Ethernet type of its frames.
pub const ETHER_TYPE: [u8; 2] = [0x88, 0xB5];
/// Where the kind of a frame lies, and the number of its cycle.
pub const KIND: usize = 14;
pub const NUMBER: usize = 15;
/// Where the process data begin.
pub const PAYLOAD: usize = 16;
/// Kinds of frames.
pub const TO_DEVICES: u8 = 1;
pub const ANSWER: u8 = 2;

/// What the devices take from the end of a frame to the beginning of their answer at most, ns.
const LATENCY_NS: u64 = 100_000;

/// What a frame of this type is, in the words of POWERLINK.
pub fn kind(frame: &[u8]) -> FrameKind {
    match frame.get(KIND) {
        Some(&TO_DEVICES) => FrameKind::Soc,
        Some(&ANSWER) => FrameKind::PRes,
        _ => FrameKind::Other,
    }
}

/// Octets of objects in a payload.
pub fn octets(mapped: &[Mapped]) -> usize {
    mapped.iter().map(|object| usize::from(object.bits / 8)).sum()
}

/// Octets of the frame to the devices and of their answer.
fn lengths(config: &Config) -> [usize; 2] {
    let nodes = &config.bus.nodes;
    let (outputs, inputs) = (
        nodes.iter().map(|node| octets(&node.outputs)),
        nodes.iter().map(|node| 1 + octets(&node.inputs)),
    );
    [PAYLOAD + outputs.sum::<usize>(), PAYLOAD + inputs.sum::<usize>()]
}

struct Node {
    outputs: usize,
    inputs: usize,
    mandatory: bool,
    state: NodeState,
    lost_in_row: u32,
    statistics: NodeStatistics,
}

/// The toy bus on a link.
pub struct Toy<L> {
    link: L,
    watch: Arc<Watch>,
    cycle_ns: u64,
    /// Cycles in a row without an answer that are ridden out.
    lost_max: u32,
    nodes: Box<[Node]>,
    frame: Box<[u8]>,
    answer: [u8; FRAME_OCTETS_MAX],
    /// The frame waits for its date.
    ready: bool,
    state: BusState,
    events: VecDeque<BusEvent>,
}

impl<L: Link> Toy<L> {
    /// A bus that has sent nothing yet.
    pub fn new(config: &Config, link: L, mac: [u8; 6], watch: Arc<Watch>) -> Toy<L> {
        let nodes = config.bus.nodes.iter().map(|node| Node {
            outputs: octets(&node.outputs),
            inputs: octets(&node.inputs),
            mandatory: node.mandatory,
            state: NodeState::Absent,
            lost_in_row: 0,
            statistics: NodeStatistics::default(),
        });
        let mut frame = vec![0; lengths(config)[0]];
        frame[..6].fill(0xFF);
        frame[6..12].copy_from_slice(&mac);
        frame[12..14].copy_from_slice(&ETHER_TYPE);
        frame[KIND] = TO_DEVICES;
        Toy {
            link,
            watch,
            cycle_ns: 1000 * u64::from(config.cycle_us),
            lost_max: config.bus.pres_lost_max,
            nodes: nodes.collect(),
            frame: frame.into(),
            answer: [0; FRAME_OCTETS_MAX],
            ready: false,
            state: BusState::Booting,
            events: [BusEvent::Network(BusState::Booting)].into(),
        }
    }

    /// The link, for tests that steer a simulated wire.
    pub fn link_mut(&mut self) -> &mut L {
        &mut self.link
    }

    /// Waits for the answer of this cycle; its length, 0: none came.
    fn wait_for_answer(&mut self, until_ns: u64) -> usize {
        loop {
            match in_the_kernel(|| self.link.receive(&mut self.answer, until_ns)) {
                Ok(Some(received)) => {
                    let length = received.length.min(FRAME_OCTETS_MAX);
                    let is_it = FrameKind::of(&self.answer[..length]) == FrameKind::PRes
                        && self.answer[12..14] == ETHER_TYPE
                        && self.answer[NUMBER] == self.frame[NUMBER];
                    if is_it {
                        return length;
                    }
                    if self.link.now_ns() >= until_ns {
                        return 0;
                    }
                }
                Ok(None) => return 0,
                Err(error) => {
                    self.events.push_back(BusEvent::LinkFailed(link_failure(error)));
                    return 0;
                }
            }
        }
    }

    fn enter(&mut self, state: BusState) {
        self.state = state;
        self.events.push_back(BusEvent::Network(state));
    }
}

impl Node {
    /// One cycle with or without its answer; what happened.
    fn cycle(&mut self, node: NodeIndex, there: bool, lost_max: u32) -> Option<BusEvent> {
        self.lost_in_row = match there || self.state == NodeState::Absent {
            true => 0,
            false => self.lost_in_row + 1,
        };
        self.statistics.polls += 1;
        self.statistics.answers += u64::from(there);
        self.statistics.lost += u64::from(self.lost_in_row > 0);
        match (self.state, there) {
            (NodeState::Operational, false) if self.lost_in_row > lost_max => {
                self.state = NodeState::Faulted;
                Some(BusEvent::NodeLost(node))
            }
            (NodeState::Operational, _) | (_, false) => None,
            (_, true) => {
                self.state = NodeState::Operational;
                Some(BusEvent::NodeUp(node))
            }
        }
    }
}

impl<L: Link> CyclicBus for Toy<L> {
    fn prepare(&mut self, _begin_ns: u64, outputs: &OutputImage) {
        let mut at = PAYLOAD;
        for (node, of) in self.nodes.iter().enumerate() {
            self.frame[at..at + of.outputs].copy_from_slice(outputs.node(node));
            at += of.outputs;
        }
        self.ready = self.state != BusState::Down && self.watch.soc_allowed();
    }

    fn exchange(&mut self, deadline_ns: u64, inputs: &mut InputImage) -> CycleReport {
        let sent_ns = self.link.now_ns();
        let asked = std::mem::take(&mut self.ready) && self.watch.soc_allowed();
        let mut length = 0;
        if asked {
            self.frame[NUMBER] = self.frame[NUMBER].wrapping_add(1);
            if let Err(error) = in_the_kernel(|| self.link.send(&self.frame)) {
                self.events.push_back(BusEvent::LinkFailed(link_failure(error)));
            }
            // What has not come back by the half of the cycle is lost: the control computes in the other half.
            length = self.wait_for_answer(deadline_ns.min(sent_ns + self.cycle_ns / 2));
        }
        let mut at = PAYLOAD;
        let mut lost = 0;
        for (node, of) in self.nodes.iter_mut().enumerate() {
            let end = at + 1 + of.inputs;
            let there = end <= length && self.answer[at] == 1;
            if there {
                inputs.payload.node_mut(node).copy_from_slice(&self.answer[at + 1..end]);
            }
            at = end;
            if asked {
                self.events.extend(of.cycle(node, there, self.lost_max));
            }
            inputs.fresh[node] = there;
            inputs.lost_in_row[node] = of.lost_in_row;
            lost += u32::from(of.lost_in_row > 0);
        }
        let is_up = |of: &Node| !of.mandatory || of.state == NodeState::Operational;
        if self.state == BusState::Booting && self.nodes.iter().all(is_up) {
            self.enter(BusState::Operational);
        }
        CycleReport {
            sent_ns,
            started_ns: asked.then_some(sent_ns),
            done_ns: self.link.now_ns(),
            lost,
            time: TimeReference::Ours,
        }
    }

    fn serve(&mut self, _until_ns: u64) {}

    fn now_ns(&mut self) -> u64 {
        self.link.now_ns()
    }

    fn node_state(&self, node: NodeIndex) -> NodeState {
        self.nodes[node].state
    }

    fn state(&self) -> BusState {
        self.state
    }

    fn pop_event(&mut self) -> Option<BusEvent> {
        self.events.pop_front()
    }

    fn shut_down(&mut self) {
        if self.state != BusState::Down {
            self.enter(BusState::Down);
        }
    }

    fn statistics(&self, node: NodeIndex) -> NodeStatistics {
        self.nodes[node].statistics
    }

    fn publish(&mut self, _cycle: u64) {}
}

/// The other half: there are no parameters, and nothing is known but the process data.
#[derive(Default)]
struct Service(VecDeque<u64>);

impl Mailbox for Service {
    fn request(&mut self, request: MailboxRequest) -> Result<(), MailboxFull> {
        self.0.push_back(request.ticket);
        Ok(())
    }

    fn reply(&mut self) -> Option<MailboxReply> {
        let result = Err(MailboxError::Failed("the toy bus has no parameters".into()));
        self.0.pop_front().map(|ticket| MailboxReply { ticket, result })
    }
}

impl Diagnose for Service {
    fn network(&mut self, _now_ns: u64) -> Option<NetworkLive> {
        None
    }

    fn node(&mut self, _node: NodeIndex, _now_ns: u64) -> Option<NodeLive> {
        None
    }
}

/// The toy bus for a whole machine.
pub(crate) struct Master;

impl protocol::Master for Master {
    fn check(&self, config: &Config) -> Result<(), ConfigErrors> {
        let worst = self.worst_exchange_ns(config);
        let rule = match lengths(config).into_iter().max() {
            Some(most) if most > FRAME_OCTETS_MAX => {
                format!("make a frame of {most} octets, {FRAME_OCTETS_MAX} at most")
            }
            _ if worst > 500 * u64::from(config.cycle_us) => format!("take {} us, half a cycle at most", worst / 1000),
            _ => return Ok(()),
        };
        Err(config::bus_error(config, "node", rule))
    }

    /// What its devices have when they are switched on: as they are told it on EtherCAT.
    fn plan(&self, config: &Config) -> Vec<NodePlan> {
        setup::plan(config)
    }

    fn budget(&self, config: &Config) -> Vec<BudgetView> {
        let us = |ns: u64| ns as f64 / 1000.0;
        let worst_ns = self.worst_exchange_ns(config);
        vec![BudgetView {
            part: "frame to all devices and back".into(),
            node: None,
            wire_us: us(worst_ns - LATENCY_NS),
            latency_us: us(LATENCY_NS),
            worst_us: us(worst_ns),
        }]
    }

    fn worst_exchange_ns(&self, config: &Config) -> u64 {
        lengths(config).into_iter().map(wire_time_ns).sum::<u64>() + LATENCY_NS
    }

    fn with_interface(
        &self,
        config: &Config,
        interface: &str,
        watch: Arc<Watch>,
        _threads: fn(),
        _warn: &mut dyn FnMut(&str),
        run: Run<'_>,
    ) -> anyhow::Result<()> {
        let link = RawLink::open(interface, raw_config())?;
        let mac = link.mac();
        self.with_link(config, Box::new(link), mac, watch, run)
    }

    fn with_link(
        &self,
        config: &Config,
        link: Box<dyn Link + Send + '_>,
        mac: [u8; 6],
        watch: Arc<Watch>,
        run: Run<'_>,
    ) -> anyhow::Result<()> {
        run(Open {
            cyclic: Box::new(Toy::new(config, link, mac, watch)),
            service: Box::new(Service::default()),
        });
        Ok(())
    }
}
