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
//! only the reduced cycle: SoA and slot, one after the other at their own pace; nodes are found and configured there, and those
//! that come later in the running network. What a node needs is in `node`, who gets the asynchronous slot in `async_scheduler`.
//!
//! A node that is lost is reset and booted again while the others go on (NMT_StartUp object 0x1F80, bit 12 set, the default);
//! what a lost mandatory node means for the machine is up to the application. Bits 4, 6 and 12 choose otherwise: see `network`.

mod async_phase;
mod async_scheduler;
mod boot;
mod budget;
mod chaining;
mod check;
mod clock;
mod config;
mod configure;
mod cycle;
mod diagnosis;
mod event;
mod fault;
mod image;
mod network;
mod node;
mod nodes;
mod objects;
mod reason;
mod receive;
mod record;
mod sdo_command;
mod server;
mod service;
mod signalling;
mod stage;
mod startup;
mod state;
mod threshold;

pub use budget::{Budget, BudgetLine, Part, WorstCycle, wire_time_ns};
pub use check::MnConfigError;
pub use config::{BootTimes, DeviceInfo, Direction, Identity, MnConfig, NodeConfig, Stamp};
pub use cycle::Step;
pub use diagnosis::{At, Diagnosis, ForeignMn, NetworkDiagnosis, NetworkReason, Reason, Span};
pub use event::{
    Counters, EVENTS_MAX, ForeignSign, IdentityField, Malformed, MnEvent, NodeState, NodeStatistics, UnaskedAnswers,
};
pub use fault::{Fault, FaultValue};
pub use image::{CHANNEL_OCTETS_MAX, IMAGE_IN, IMAGE_OCTETS_MAX, IMAGE_OUT};
pub use obd::Expected;
pub use objects::{FEATURE_FLAGS, HISTORY_ENTRIES, MN_PROFILE, MnObjects};
pub use record::{ERRORS_KEPT, ErrorLog, LastFault, LoggedError};
pub use sdo_command::{SdoCommand, SdoError, SdoRefused, SdoResult};
pub use stage::BootStage;
pub use startup::{Assignment, RefusedBit, StartUp};
pub use state::Mn;
pub use threshold::Threshold;

pub use crate::ethernet_queue::{ETHERNET_FRAMES, QueueError};
use crate::nmt::{self, MnTrigger, NmtState};
use crate::wire;
use node::Network;
use state::{Grant, Phase, Shutdown};

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

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// Process data for a node, by its position in the configuration: the payload of its next PReq, its part of our PRes for a
    /// chained node; empty for a position without a node.
    pub fn output_mut(&mut self, node: usize) -> &mut [u8] {
        match self.nodes.get_mut(node) {
            Some(node) if node.config.assignment.chained => {
                let start = usize::from(node.config.pres_mn_offset);
                &mut self.pres_mn[start..start + usize::from(node.config.preq_bytes)]
            }
            Some(node) => &mut node.data.output[..usize::from(node.config.preq_bytes)],
            None => &mut [],
        }
    }

    /// The driver has seen a frame with a wrong check sum (E_DLL_CRC). It is counted; what a threshold does is the
    /// configuration's choice.
    pub fn crc_error(&mut self) {
        if self.counters.crc_errors.count_error(self.config.crc_threshold) {
            self.events.push(MnEvent::CrcThreshold);
            self.trigger(MnTrigger::CycleError);
        }
    }

    /// Whether the outputs may be used (RD of the PReq). It is sent only in OPERATIONAL, to nodes in READY_TO_OPERATE or
    /// OPERATIONAL.
    pub fn set_outputs_valid(&mut self, valid: bool) {
        self.outputs_valid = valid;
    }

    /// Input data of a node, by its position in the configuration; empty for a position without a node.
    pub fn input(&self, node: usize) -> Input<'_> {
        match self.nodes.get(node) {
            Some(node) => {
                let (data, fresh) = node.input();
                Input {
                    data,
                    fresh,
                    lost_in_row: node.data.lost_in_row,
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
        self.nodes.get(node).map_or(NodeState::Absent, |node| node.state)
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
            pres_version: 0,
            loss_of_pres: Threshold::ZERO,
            loss_of_status: Threshold::ZERO,
            lost_in_row_max: 0,
            response_ns_max: 0,
            slots_granted: 0,
            slots_unused: 0,
            boots: 0,
            objects_written: 0,
            faults: 0,
        };
        self.nodes.get(node).map_or(NONE, |node| &node.statistics)
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

    /// Has an Ethernet frame that is not POWERLINK (IP, for instance) sent in an asynchronous slot of our own. Short frames are
    /// padded; what waits at the end of the network is forgotten.
    ///
    /// # Errors
    /// [`QueueError`] when all places are taken, or for a frame that is POWERLINK or longer than the AsyncMTU (0x1F98/8).
    pub fn send_ethernet(&mut self, frame: &[u8]) -> Result<(), QueueError> {
        self.slot.ethernet.push(frame, self.config.async_mtu)
    }

    /// Lets the network take the step it waits for ([`MnEvent::WaitsForApplication`]); whether it does wait. Each step is let
    /// through once.
    pub fn go_on(&mut self) -> bool {
        self.gate.open = self.gate.next.is_some();
        self.gate.open
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
        let (index, deadline_ns) = if let Phase::AwaitPres { index, deadline_ns, .. } = self.phase {
            (index, deadline_ns)
        } else if let Phase::AwaitChain { deadline_ns, .. } = self.phase {
            (self.first_unheard()?, deadline_ns)
        } else {
            return None;
        };
        Some((self.nodes.get(index)?.config.id, deadline_ns))
    }

    /// The node (id) that has the asynchronous slot of this cycle and when the slot is over; for a thread that watches this one.
    /// `None` also where slots follow each other without cycles: there a slot that stays empty is how the network is searched.
    pub fn awaited_slot(&self) -> Option<(u8, u64)> {
        let Phase::AwaitAsnd { grant, deadline_ns, .. } = self.phase else {
            return None;
        };
        let id = match grant {
            Grant::Node { index, .. } => self.nodes.get(index)?.config.id,
            Grant::Diagnostic { .. } => wire::node::DIAGNOSTIC,
            Grant::Stranger { id } => id,
            Grant::NoService | Grant::Own(_) => return None,
        };
        self.state.is_isochronous().then_some((id, deadline_ns))
    }

    fn network(&self, now_ns: u64) -> Network {
        Network {
            now_ns,
            state: self.state,
            cycle_ns: u64::from(self.config.cycle_ns),
            slot_ns: u64::from(if self.state.is_isochronous() {
                self.config.cycle_ns
            } else {
                self.config.async_slot_timeout_ns
            }),
            being_configured: self.being_configured,
            boot: self.config.boot,
            startup: self.config.startup,
            // After an error that stopped all, nothing starts before the application says so.
            starts_nodes: self.gate.next.is_none(),
        }
    }

    /// Takes the managing node to the state the standard's table gives, if any.
    fn trigger(&mut self, trigger: MnTrigger) {
        if let Some(state) = nmt::mn_next(self.state, trigger) {
            self.start.entered_pre_op_1 = self.state.is_isochronous() && state == NmtState::PreOperational1;
            self.state = state;
            self.events.push(MnEvent::NmtStateChanged { state });
        }
    }

    fn poll_lost(&mut self, now_ns: u64, index: usize) {
        let network = self.network(now_ns);
        if let Some(node) = self.nodes.get_mut(index) {
            node.poll_lost(self.config.pres_lost_max, &network, &mut self.events);
        }
    }
}

#[cfg(test)]
mod tests;
