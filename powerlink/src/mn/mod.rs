//! The managing node: runs the cycle, boots the controlled nodes, exchanges process data with them.
//!
//! In:  the start of every cycle, every frame that arrives, output data; the time comes with each call.
//! Out: frames to send and when to be called again ([`Step`]), input data, node states, events, counters.
//!
//! [`Mn`] does no I/O and never asks for the time. RT: no allocation, no locks; every call is bounded by the number of
//! nodes. One cycle, driven by the caller:
//!
//! ```text
//! at T:  start_cycle(now)
//! loop:  poll(now) -> Send(frame)        send it
//!                     WaitUntil(t)       receive until t; hand each frame to receive(now, frame), then poll again
//!                     IsochronousDone    inputs are complete: compute the next outputs, then poll on
//!                     Idle               nothing to do until the next start_cycle (frames may still be handed in)
//! ```
//!
//! A cycle is SoC, then PReq and PRes of each node, then SoA, then one asynchronous slot. In PRE_OPERATIONAL_1 there is
//! only the reduced cycle: SoA and slot, one after the other at their own pace. What a node needs is in `node`, who gets
//! the asynchronous slot in `slot`.
//!
//! The network is never restarted because of one node: a node that is lost is reset and booted again while the others go
//! on (NMT_StartUp object 0x1F80, bit 12 set); what a lost mandatory node means for the machine is up to the application.

mod config;
mod event;
mod node;
mod signalling;
mod slot;
mod startup;

pub use config::{BootTimes, Direction, Identity, MnConfig, MnConfigError, NodeConfig, Stamp};
pub use event::{Counters, EVENTS_MAX, IdentityField, Malformed, MnEvent, NodeStatistics};
pub use startup::{Assignment, RefusedBit, StartUp};

use crate::nmt::{self, MnTrigger, NmtState};
use crate::wire::{
    self, Asnd, FRAME_LEN_MAX, Frame, Header, Mac, NetTime, PAYLOAD_LIMIT_MIN, Preq, Pres, Soc, multicast,
};
use config::check;
use event::Events;
use node::{Network, Node, us};
use slot::{Grant, Shutdown, Turn};

/// NoService SoAs at the start of PRE_OPERATIONAL_1 that wake the nodes (C_DLL_PREOP1_START_CYCLES).
const WAKE_SOAS: u8 = 10;
/// The PS flag of the SoC toggles every so many cycles (object 0x1F98/9, its default).
const PRESCALER: u64 = 2;
/// Another managing node is reported again after it was silent for this time.
const FOREIGN_SILENCE_NS: u64 = 1_000_000_000;
/// Marks a node id without a node in the table from id to position.
const NOBODY: u8 = u8::MAX;

/// State of a controlled node as the application sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeState {
    /// Not heard of yet.
    Absent,
    /// Identified; being booted.
    Configuring,
    /// READY_TO_OPERATE, communication checked; waits for the network.
    Ready,
    /// OPERATIONAL: process data are valid.
    Operational,
    /// Lost, refused or failed; it is being looked for and booted again.
    Faulted,
}

/// What the caller does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step<'a> {
    /// Send this frame now, then poll again.
    Send(&'a [u8]),
    /// Receive until this time, but never past the start of the next cycle; hand in what comes, then poll again.
    WaitUntil(u64),
    /// Once after each `start_cycle`: all inputs of this cycle are in, or timed out, and the SoA is sent. In states
    /// without isochronous traffic it comes at once.
    IsochronousDone,
    /// Nothing to do until the next `start_cycle`.
    Idle,
}

/// Input data of one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Input<'a> {
    /// Process data of the last valid PRes, zeros before the first: as many octets as configured.
    pub data: &'a [u8],
    /// They came in this cycle (a PRes with RD).
    pub fresh: bool,
    /// Polls without a PRes since the last one.
    pub lost_in_row: u32,
}

/// Where the cycle stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Between cycles; in the reduced cycle the next SoA may go out.
    Idle,
    /// The SoC is to be sent.
    SocDue,
    /// The next PReq goes to this node or one behind it.
    NextPreq { index: usize },
    /// The PReq was handed out; its time-out starts when the caller comes back from sending.
    PreqSent { index: usize },
    /// The node has to answer until then.
    AwaitPres {
        index: usize,
        sent_ns: u64,
        deadline_ns: u64,
    },
    /// The SoA is to be sent.
    SoaDue,
    /// The SoA was handed out.
    SoaSent { grant: Grant },
    /// Our own ASnd was handed out.
    AsndSent,
    /// Somebody else has the slot until then. `looked`: the caller has received since the deadline.
    AwaitAsnd {
        grant: Grant,
        deadline_ns: u64,
        looked: bool,
    },
}

/// Where the start of PRE_OPERATIONAL_1 stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reduced {
    /// NoService SoAs that are still to be sent.
    Wake { left: u8 },
    /// The ResetNode broadcast is next.
    Reset,
    /// The nodes restart.
    Pause { until_ns: u64 },
    /// IdentRequests.
    Ident,
}

/// Which buffer a frame to be sent lies in.
#[derive(Clone, Copy, Debug)]
enum Buffer {
    Cycle,
    Asnd,
}

/// [`Step`] without the borrow.
#[derive(Clone, Copy, Debug)]
enum Action {
    Send(Buffer, usize),
    WaitUntil(u64),
    IsochronousDone,
    Idle,
}

/// Managing node with room for `NODES` controlled nodes (about 4 kB each).
#[derive(Clone, Debug)]
pub struct Mn<'a, const NODES: usize> {
    config: MnConfig<'a>,
    state: NmtState,
    phase: Phase,
    reduced: Reduced,
    nodes: [Option<Node<'a>>; NODES],
    /// Position of a node id in `nodes`.
    index_of: [u8; 256],
    outputs_valid: bool,
    done_due: bool,
    /// End of listening in NOT_ACTIVE; set by the first call that brings the time.
    listen_until_ns: Option<u64>,
    pre_op_1_since_ns: u64,
    missing_reported: bool,
    foreign_heard_ns: Option<u64>,
    cycle_started_ns: Option<u64>,
    net_time: NetTime,
    relative_time_us: u64,
    prescaled_slot: bool,
    turn: Turn,
    shutdown: Shutdown,
    events: Events,
    counters: Counters,
    cycle_frame: [u8; FRAME_LEN_MAX],
    asnd_frame: [u8; FRAME_LEN_MAX],
    asnd_len: usize,
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// A managing node in NOT_ACTIVE. Everything it relies on later is checked here.
    pub fn new(config: MnConfig<'a>) -> Result<Self, MnConfigError> {
        check(&config, NODES.min(usize::from(wire::node::CN_MAX)))?;
        let mut index_of = [NOBODY; 256];
        for (index, node) in config.nodes.iter().enumerate() {
            // At most 239 nodes, checked above.
            index_of[usize::from(node.id)] = index as u8;
        }
        Ok(Mn {
            config,
            state: NmtState::NotActive,
            phase: Phase::Idle,
            reduced: Reduced::Wake { left: WAKE_SOAS },
            nodes: core::array::from_fn(|index| config.nodes.get(index).map(|node| Node::new(*node))),
            index_of,
            outputs_valid: false,
            done_due: false,
            listen_until_ns: None,
            pre_op_1_since_ns: 0,
            missing_reported: false,
            foreign_heard_ns: None,
            cycle_started_ns: None,
            net_time: NetTime::default(),
            relative_time_us: 0,
            prescaled_slot: false,
            turn: Turn::default(),
            shutdown: Shutdown::No,
            events: Events::new(),
            counters: Counters::default(),
            cycle_frame: [0; FRAME_LEN_MAX],
            asnd_frame: [0; FRAME_LEN_MAX],
            asnd_len: 0,
        })
    }

    /// Begins the cycle that starts now; `net_time` is the wall clock for the SoC. A cycle that has not ended is cut off
    /// and counted: what was not sent of it is not sent any more. Cycles left out since the last start are counted.
    pub fn start_cycle(&mut self, now_ns: u64, net_time: NetTime) {
        self.done_due = true;
        self.counters.events_dropped = self.events.dropped;
        if !self.state.is_isochronous() {
            return;
        }
        self.cut_off(now_ns);
        let cycle_ns = u64::from(self.config.cycle_ns);
        let mut passed = 1;
        if let Some(last_ns) = self.cycle_started_ns {
            passed = (now_ns.saturating_sub(last_ns) + cycle_ns / 2) / cycle_ns;
            self.counters.cycles_skipped += passed.saturating_sub(1);
        }
        // The time base goes on along the grid, also over cycles that were left out.
        self.relative_time_us += passed.max(1) * (cycle_ns / 1000);
        self.cycle_started_ns = Some(now_ns);
        self.net_time = net_time;
        for node in self.nodes.iter_mut().flatten() {
            node.start_cycle();
        }
        self.phase = Phase::SocDue;
    }

    /// Ends what is still open of the last cycle.
    fn cut_off(&mut self, now_ns: u64) {
        match self.phase {
            Phase::Idle | Phase::AsndSent => {}
            Phase::AwaitAsnd { grant, .. } => self.slot_over(now_ns, grant),
            Phase::PreqSent { index } | Phase::AwaitPres { index, .. } => {
                self.counters.cycles_overrun += 1;
                self.poll_lost(now_ns, index);
            }
            Phase::SocDue | Phase::NextPreq { .. } | Phase::SoaDue | Phase::SoaSent { .. } => {
                self.counters.cycles_overrun += 1;
            }
        }
        self.phase = Phase::Idle;
    }

    /// What to do now. To be called again after each step but [`Step::Idle`].
    pub fn poll(&mut self, now_ns: u64) -> Step<'_> {
        match self.advance(now_ns) {
            Action::Send(Buffer::Cycle, len) => Step::Send(&self.cycle_frame[..len]),
            Action::Send(Buffer::Asnd, len) => Step::Send(&self.asnd_frame[..len]),
            Action::WaitUntil(time_ns) => Step::WaitUntil(time_ns),
            Action::IsochronousDone => Step::IsochronousDone,
            Action::Idle => Step::Idle,
        }
    }

    fn advance(&mut self, now_ns: u64) -> Action {
        // Each turn of the loop leaves one phase; a poll walks over all nodes at most once.
        loop {
            match self.phase {
                Phase::Idle => match self.between_cycles(now_ns) {
                    Some(action) => return action,
                    None => self.phase = Phase::SoaDue,
                },
                Phase::SocDue => {
                    self.phase = Phase::NextPreq { index: 0 };
                    if let Some(len) = self.write_soc() {
                        return Action::Send(Buffer::Cycle, len);
                    }
                }
                Phase::NextPreq { index } => {
                    let Some(index) = (index..NODES).find(|at| self.node(*at).is_some_and(|node| node.polled)) else {
                        self.phase = Phase::SoaDue;
                        continue;
                    };
                    self.phase = Phase::PreqSent { index };
                    if let Some(len) = self.write_preq(index) {
                        return Action::Send(Buffer::Cycle, len);
                    }
                }
                Phase::PreqSent { index } => {
                    let timeout_ns = self
                        .node(index)
                        .map_or(0, |node| u64::from(node.config.pres_timeout_ns));
                    let deadline_ns = now_ns + timeout_ns;
                    self.phase = Phase::AwaitPres {
                        index,
                        sent_ns: now_ns,
                        deadline_ns,
                    };
                }
                Phase::AwaitPres { index, deadline_ns, .. } => {
                    if now_ns < deadline_ns {
                        return Action::WaitUntil(deadline_ns);
                    }
                    self.poll_lost(now_ns, index);
                    self.phase = Phase::NextPreq { index: index + 1 };
                }
                Phase::SoaDue => {
                    let (grant, len) = self.write_soa(now_ns);
                    self.phase = Phase::SoaSent { grant };
                    if let Some(len) = len {
                        return Action::Send(Buffer::Cycle, len);
                    }
                }
                Phase::SoaSent { grant } => match grant {
                    Grant::Own(own) => {
                        self.phase = Phase::AsndSent;
                        self.own_sent(now_ns, own);
                        self.counters.asnd_sent += 1;
                        return Action::Send(Buffer::Asnd, self.asnd_len);
                    }
                    Grant::Nobody if self.state.is_isochronous() => self.phase = Phase::Idle,
                    Grant::Nobody | Grant::Node { .. } => {
                        let deadline_ns = now_ns + u64::from(self.config.async_slot_timeout_ns);
                        self.phase = Phase::AwaitAsnd {
                            grant,
                            deadline_ns,
                            looked: false,
                        };
                    }
                },
                Phase::AsndSent => {
                    self.phase = if self.state.is_isochronous() {
                        Phase::Idle
                    } else {
                        // The slot is ours to its end: no second ASnd may meet this one.
                        let deadline_ns = now_ns + u64::from(self.config.async_slot_timeout_ns);
                        Phase::AwaitAsnd {
                            grant: Grant::Nobody,
                            deadline_ns,
                            looked: false,
                        }
                    };
                }
                Phase::AwaitAsnd {
                    grant,
                    deadline_ns,
                    looked,
                } => {
                    if let Some(action) = self.take_done() {
                        return action;
                    }
                    // The caller may have computed since the SoA: it looks at the wire before the slot counts as unused.
                    if now_ns < deadline_ns || !looked {
                        self.phase = Phase::AwaitAsnd {
                            grant,
                            deadline_ns,
                            looked: now_ns >= deadline_ns,
                        };
                        return Action::WaitUntil(deadline_ns);
                    }
                    self.slot_over(now_ns, grant);
                    self.phase = Phase::Idle;
                }
            }
        }
    }

    /// In [`Phase::Idle`]: an action, or `None` where a SoA of the reduced cycle is due.
    fn between_cycles(&mut self, now_ns: u64) -> Option<Action> {
        if let Some(action) = self.take_done() {
            return Some(action);
        }
        match self.state {
            NmtState::NotActive => {
                let wait_ns = us(self.config.boot.wait_not_active_us);
                let until_ns = *self.listen_until_ns.get_or_insert(now_ns + wait_ns);
                if now_ns < until_ns {
                    return Some(Action::WaitUntil(until_ns));
                }
                self.trigger(MnTrigger::ListenOver);
                self.pre_op_1_since_ns = now_ns;
                None
            }
            NmtState::PreOperational1 => {
                self.step_network(now_ns);
                // PRE_OPERATIONAL_2 begins with the next cycle's SoC.
                if self.state == NmtState::PreOperational1 {
                    None
                } else {
                    Some(Action::Idle)
                }
            }
            NmtState::PreOperational2
            | NmtState::ReadyToOperate
            | NmtState::Operational
            | NmtState::Off
            | NmtState::Initialising
            | NmtState::ResetApplication
            | NmtState::ResetCommunication
            | NmtState::ResetConfiguration
            | NmtState::BasicEthernet
            | NmtState::Stopped
            | NmtState::Unknown(_) => Some(Action::Idle),
        }
    }

    fn take_done(&mut self) -> Option<Action> {
        self.done_due.then(|| {
            self.done_due = false;
            Action::IsochronousDone
        })
    }

    /// Hands in a frame that arrived. Garbage is counted by reason and does nothing else; never panics.
    pub fn receive(&mut self, now_ns: u64, frame: &[u8]) {
        let (header, body) = match Header::parse(frame).and_then(|header| Ok((header, Frame::parse(frame)?))) {
            Ok(parsed) => parsed,
            Err(error) => return self.counters.malformed.count(error),
        };
        if header.source == self.config.mac {
            self.counters.own_frames += 1;
            return;
        }
        match body {
            Frame::Soc(_) | Frame::Soa(_) | Frame::Preq(_) | Frame::Amni(_) => self.foreign_mn(now_ns, header.source),
            Frame::Pres(pres) => self.receive_pres(now_ns, &header, &pres),
            Frame::Asnd(asnd) => self.receive_asnd(now_ns, &header, &asnd),
            Frame::Ainv(_) => self.counters.unexpected += 1,
        }
    }

    fn foreign_mn(&mut self, now_ns: u64, mac: Mac) {
        self.counters.foreign_mn_frames += 1;
        let silent = self
            .foreign_heard_ns
            .is_none_or(|heard_ns| now_ns >= heard_ns + FOREIGN_SILENCE_NS);
        self.foreign_heard_ns = Some(now_ns);
        if silent {
            self.events.push(MnEvent::ForeignMn { mac });
        }
        if self.state == NmtState::NotActive {
            self.listen_until_ns = Some(now_ns + us(self.config.boot.wait_not_active_us));
        }
    }

    fn receive_pres(&mut self, now_ns: u64, header: &Header, pres: &Pres<'_>) {
        let Some(index) = self.index_of(header.source_node) else {
            self.counters.unknown_node += 1;
            return;
        };
        let sent_ns = match self.phase {
            Phase::AwaitPres {
                index: awaited,
                sent_ns,
                ..
            } if awaited == index => sent_ns,
            // It was faster than our return from sending.
            Phase::PreqSent { index: awaited } if awaited == index => now_ns,
            Phase::AwaitPres { .. }
            | Phase::PreqSent { .. }
            | Phase::Idle
            | Phase::SocDue
            | Phase::NextPreq { .. }
            | Phase::SoaDue
            | Phase::SoaSent { .. }
            | Phase::AsndSent
            | Phase::AwaitAsnd { .. } => {
                match self.nodes.get_mut(index).and_then(Option::as_mut) {
                    Some(node) if node.lost_in_row > 0 => node.statistics.pres_late += 1,
                    Some(_) | None => self.counters.unexpected += 1,
                }
                return;
            }
        };
        self.phase = Phase::NextPreq { index: index + 1 };
        let network = self.network();
        if let Some(node) = self.nodes.get_mut(index).and_then(Option::as_mut) {
            let response_ns = u32::try_from(now_ns.saturating_sub(sent_ns)).unwrap_or(u32::MAX);
            node.statistics.response_ns_max = node.statistics.response_ns_max.max(response_ns);
            node.polled_well(now_ns, pres, &network, &mut self.events);
        }
    }

    fn receive_asnd(&mut self, now_ns: u64, header: &Header, asnd: &Asnd<'_>) {
        let Some(index) = self.index_of(header.source_node) else {
            self.counters.unknown_node += 1;
            return;
        };
        let granted = match self.phase {
            Phase::AwaitAsnd {
                grant: Grant::Node { index: target, .. },
                ..
            }
            | Phase::SoaSent {
                grant: Grant::Node { index: target, .. },
            } => target == index,
            Phase::AwaitAsnd { .. }
            | Phase::SoaSent { .. }
            | Phase::Idle
            | Phase::SocDue
            | Phase::NextPreq { .. }
            | Phase::PreqSent { .. }
            | Phase::AwaitPres { .. }
            | Phase::SoaDue
            | Phase::AsndSent => false,
        };
        // An answer that comes late is still true and is taken; only the slot is over.
        if granted {
            self.phase = Phase::Idle;
        } else {
            self.counters.unexpected += 1;
        }
        if !matches!(header.destination_node, wire::node::MN | wire::node::BROADCAST) {
            return;
        }
        let network = self.network();
        let Some(node) = self.nodes.get_mut(index).and_then(Option::as_mut) else {
            return;
        };
        match asnd {
            Asnd::IdentResponse(ident) => {
                node.identified(now_ns, header.source, ident, &network, &mut self.events);
            }
            Asnd::StatusResponse(status) => node.status(now_ns, status, &network, &mut self.events),
            Asnd::Sdo(data) => node.sdo.receive(now_ns, data),
            Asnd::NmtRequest(request) => self.nmt_requested(index, request),
            Asnd::NmtCommand(_) | Asnd::SyncResponse(_) | Asnd::Other(_) => {
                self.counters.unexpected += u64::from(granted)
            }
        }
    }

    /// Payload of the next PReq to a node, by its position in the configuration; empty for a position without a node.
    pub fn output_mut(&mut self, node: usize) -> &mut [u8] {
        match self.nodes.get_mut(node) {
            Some(Some(node)) => &mut node.output[..usize::from(node.config.preq_bytes)],
            Some(None) | None => &mut [],
        }
    }

    /// Whether the outputs may be used (RD of the PReq). It is sent only to nodes in READY_TO_OPERATE or OPERATIONAL.
    pub fn set_outputs_valid(&mut self, valid: bool) {
        self.outputs_valid = valid;
    }

    /// Input data of a node, by its position in the configuration; empty for a position without a node.
    pub fn input(&self, node: usize) -> Input<'_> {
        match self.node(node) {
            Some(node) => {
                let (data, fresh) = node.input();
                Input {
                    data,
                    fresh,
                    lost_in_row: node.lost_in_row,
                }
            }
            None => Input {
                data: &[],
                fresh: false,
                lost_in_row: 0,
            },
        }
    }

    /// State of a node, by its position in the configuration; Absent for a position without a node.
    pub fn node_state(&self, node: usize) -> NodeState {
        self.node(node).map_or(NodeState::Absent, |node| node.state)
    }

    /// State of the managing node.
    pub fn nmt_state(&self) -> NmtState {
        self.state
    }

    /// Figures of a node, by its position in the configuration; zeros for a position without a node.
    pub fn statistics(&self, node: usize) -> &NodeStatistics {
        const NONE: &NodeStatistics = &NodeStatistics {
            preq_sent: 0,
            pres_received: 0,
            pres_lost: 0,
            pres_late: 0,
            pres_short: 0,
            lost_in_row_max: 0,
            response_ns_max: 0,
            slots_granted: 0,
            slots_unused: 0,
            boots: 0,
            objects_written: 0,
            faults: 0,
        };
        self.node(node).map_or(NONE, |node| &node.statistics)
    }

    /// What happened on the wire.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The oldest event that was not taken yet.
    pub fn pop_event(&mut self) -> Option<MnEvent> {
        let event = self.events.pop();
        self.counters.events_dropped = self.events.dropped;
        event
    }

    /// Resets a node, by its position in the configuration, and boots it again.
    pub fn reset_node(&mut self, node: usize) {
        let network = self.network();
        let now_ns = self.cycle_started_ns.unwrap_or(0);
        if let Some(Some(node)) = self.nodes.get_mut(node) {
            node.reset(now_ns, &network, &mut self.events);
        }
    }

    /// Takes the network down in order: StopNode to all, ResetNode to all, then silence. Cycles go on until
    /// [`is_shut_down`](Self::is_shut_down).
    pub fn shut_down(&mut self) {
        if self.shutdown != Shutdown::No {
            return;
        }
        self.shutdown = Shutdown::begin(self.state);
        if self.shutdown == Shutdown::Done {
            self.state = NmtState::Off;
            self.phase = Phase::Idle;
            self.events.push(MnEvent::NmtStateChanged { state: self.state });
        }
    }

    /// The network is down; nothing is sent any more.
    pub fn is_shut_down(&self) -> bool {
        self.shutdown == Shutdown::Done
    }

    /// The node (id) whose PRes is awaited now and when it is due; for a thread that watches this one.
    pub fn outstanding(&self) -> Option<(u8, u64)> {
        match self.phase {
            Phase::AwaitPres { index, deadline_ns, .. } => self.node(index).map(|node| (node.config.id, deadline_ns)),
            Phase::Idle
            | Phase::SocDue
            | Phase::NextPreq { .. }
            | Phase::PreqSent { .. }
            | Phase::SoaDue
            | Phase::SoaSent { .. }
            | Phase::AsndSent
            | Phase::AwaitAsnd { .. } => None,
        }
    }

    fn node(&self, index: usize) -> Option<&Node<'a>> {
        self.nodes.get(index).and_then(Option::as_ref)
    }

    fn index_of(&self, id: u8) -> Option<usize> {
        match self.index_of[usize::from(id)] {
            NOBODY => None,
            index => Some(usize::from(index)),
        }
    }

    fn network(&self) -> Network {
        Network {
            state: self.state,
            cycle_ns: u64::from(self.config.cycle_ns),
            boot: self.config.boot,
        }
    }

    /// Takes the managing node to the state the standard's table gives, if any.
    fn trigger(&mut self, trigger: MnTrigger) {
        if let Some(state) = nmt::mn_next(self.state, trigger) {
            self.state = state;
            self.events.push(MnEvent::NmtStateChanged { state });
        }
    }

    fn poll_lost(&mut self, now_ns: u64, index: usize) {
        let network = self.network();
        if let Some(Some(node)) = self.nodes.get_mut(index) {
            node.poll_lost(now_ns, self.config.pres_lost_max, &network, &mut self.events);
        }
    }

    /// The nodes' next steps, and what they mean for the network; once a slot.
    fn step_network(&mut self, now_ns: u64) {
        if self.shutdown != Shutdown::No {
            return;
        }
        let network = self.network();
        for node in self.nodes.iter_mut().flatten() {
            node.step(now_ns, &network, &mut self.events);
        }
        let mandatory = |is: fn(&Node<'a>) -> bool| {
            self.nodes
                .iter()
                .flatten()
                .filter(|node| node.config.assignment.mandatory)
                .all(is)
        };
        match self.state {
            NmtState::PreOperational1 if self.reduced == Reduced::Ident => {
                let stayed_ns = now_ns.saturating_sub(self.pre_op_1_since_ns);
                if mandatory(Node::is_identified) {
                    if stayed_ns >= us(self.config.boot.wait_pre_op_1_us) {
                        self.trigger(MnTrigger::MandatoryIdentified);
                        for node in self.nodes.iter_mut().flatten() {
                            node.cycle_begins(now_ns, &network);
                        }
                    }
                } else if stayed_ns >= us(self.config.boot.timeout_pre_op_1_us) && !self.missing_reported {
                    self.missing_reported = true;
                    for node in self
                        .nodes
                        .iter()
                        .flatten()
                        .filter(|node| node.config.assignment.mandatory)
                    {
                        if !node.is_identified() {
                            self.events.push(MnEvent::Missing { node: node.config.id });
                        }
                    }
                }
            }
            NmtState::PreOperational2 if mandatory(Node::is_configured) => {
                self.trigger(MnTrigger::MandatoryConfigured);
            }
            NmtState::ReadyToOperate if mandatory(Node::is_ready) => self.trigger(MnTrigger::MandatoryReady),
            NmtState::PreOperational1
            | NmtState::PreOperational2
            | NmtState::ReadyToOperate
            | NmtState::Operational
            | NmtState::Off
            | NmtState::Initialising
            | NmtState::ResetApplication
            | NmtState::ResetCommunication
            | NmtState::ResetConfiguration
            | NmtState::NotActive
            | NmtState::BasicEthernet
            | NmtState::Stopped
            | NmtState::Unknown(_) => {}
        }
    }

    fn write_soc(&mut self) -> Option<usize> {
        if self.counters.cycles.is_multiple_of(PRESCALER) {
            self.prescaled_slot = !self.prescaled_slot;
        }
        self.counters.cycles += 1;
        let soc = Soc {
            multiplexed_cycle: false,
            prescaled_slot: self.prescaled_slot,
            net_time: self.net_time,
            relative_time_us: self.relative_time_us,
        };
        soc.emit(
            &Header::multicast(multicast::SOC, self.config.mac, wire::node::MN),
            &mut self.cycle_frame,
        )
        .ok()
    }

    fn write_preq(&mut self, index: usize) -> Option<usize> {
        let node = self.nodes.get_mut(index)?.as_mut()?;
        node.statistics.preq_sent += 1;
        let header = Header {
            destination: node.mac,
            source: self.config.mac,
            destination_node: node.config.id,
            source_node: wire::node::MN,
        };
        let node_takes_data = matches!(node.nmt_state, NmtState::ReadyToOperate | NmtState::Operational);
        let preq = Preq {
            multiplexed: false,
            exception_acknowledge: node.signalling.exception_acknowledge(),
            ready: self.outputs_valid && node_takes_data,
            pdo_version: 0,
            payload: node.output(),
        };
        let limit = usize::from(node.config.preq_bytes).max(PAYLOAD_LIMIT_MIN);
        preq.emit(&header, limit, &mut self.cycle_frame).ok()
    }

    /// Decides who gets the slot and writes the SoA that says so.
    fn write_soa(&mut self, now_ns: u64) -> (Grant, Option<usize>) {
        if self.state.is_isochronous() {
            self.step_network(now_ns);
        }
        let (grant, soa) = self.grant(now_ns);
        self.counters.soa_sent += 1;
        let header = Header::multicast(multicast::SOA, self.config.mac, wire::node::MN);
        (grant, soa.emit(&header, &mut self.cycle_frame).ok())
    }
}

#[cfg(test)]
mod tests;
