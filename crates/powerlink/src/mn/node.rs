//! One controlled node as the managing node sees it: its process data, its watch, what it needs of the asynchronous slot.
//!
//! In:  what the node sent (StatusResponse, PRes), lost polls, the time, the state of the network.
//! Out: input data, whether it needs an IdentRequest or a StatusRequest, events.
//! RT: no allocation, no locks, bounded. The way through the boot-up is in `boot`, what is written into it in `configure`.

use super::config::{BootTimes, NodeConfig};
use super::configure::ConfigurationManager;
use super::event::{Events, MnEvent, NodeState, NodeStatistics};
use super::fault::Fault;
use super::record::Record;
use super::sdo_command::{Job, SdoError};
use super::signalling::Signalling;
use super::stage::{BootStage, Chain, Order};
use super::startup::StartUp;
use crate::nmt::{NmtCommand, NmtState};
use crate::sdo::{Client, Timing};
use crate::wire::{Mac, PAYLOAD_MAX, Pres, Requests, StatusResponse};

/// Main version within a mapping version: only this is compared.
const MAIN_VERSION: u8 = 0xF0;
/// PRes in a row with a wrong NMT state that are tolerated (C_NMT_STATE_TOLERANCE).
const STATE_TOLERANCE_CYCLES: u32 = 5;
/// Between two StatusRequests to a node that has settled and is not polled: its only sign of life.
const SUPERVISION_NS: u64 = 100_000_000;
/// Longest pause between two invitations of a node that owes an SDO answer and is not polled.
const INVITE_PAUSE_SLOTS: u64 = 16;
/// Cycles between two requests to a node that does not answer.
const RETRY_CYCLES: u64 = 5;

/// What a node needs to know to take its next step: the time, and of the network.
#[derive(Clone, Copy, Debug)]
pub(super) struct Network {
    pub(super) now_ns: u64,
    pub(super) state: NmtState,
    pub(super) cycle_ns: u64,
    /// From one asynchronous slot to the next.
    pub(super) slot_ns: u64,
    /// Nodes the configuration manager is at work with.
    pub(super) being_configured: u32,
    pub(super) boot: BootTimes,
    pub(super) startup: StartUp,
    /// Ready nodes are started by the managing node.
    pub(super) starts_nodes: bool,
}

/// StatusRequests to a node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StatusRequests {
    pub(super) due_ns: u64,
    /// Unanswered in a row.
    pub(super) unanswered: u32,
    /// Another node asked for one.
    pub(super) asked: bool,
}

/// IdentRequests to a node; when the next is due is in its stage.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct IdentRequests {
    /// Another node asked for one.
    pub(super) asked: bool,
    /// One was sent and is not answered yet: only such an answer is believed.
    pub(super) open: bool,
}

/// A node that is not polled shows no RS when its SDO answer is ready: it is invited at this time, later again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Invitation {
    due_ns: u64,
    pause_ns: u64,
}

/// Process data exchanged with a node.
#[derive(Debug)]
pub(super) struct ProcessData {
    pub(super) output: [u8; PAYLOAD_MAX],
    pub(super) input: [u8; PAYLOAD_MAX],
    /// The input came in this cycle.
    pub(super) fresh: bool,
    pub(super) lost_in_row: u32,
}

/// One controlled node.
#[derive(Debug)]
pub(super) struct Node<'a> {
    pub(super) config: NodeConfig<'a>,
    pub(super) stage: BootStage,
    pub(super) state: NodeState,
    /// As last reported by the node.
    pub(super) nmt_state: NmtState,
    /// Learned from the IdentResponse.
    pub(super) mac: Mac,
    /// PReqs are sent.
    pub(super) polled: bool,
    /// Set-up of a chained node.
    pub(super) chain: Chain,
    pub(super) order: Option<Order>,
    /// An NMT request of this node that is answered with InvalidService.
    pub(super) reject: Option<NmtCommand>,
    pub(super) requests: Requests,
    pub(super) signalling: Signalling,
    pub(super) status: StatusRequests,
    pub(super) ident: IdentRequests,
    /// It was ready, and failed in an OPERATIONAL network.
    pub(super) dropped_out: bool,
    pub(super) invitation: Invitation,
    pub(super) manager: ConfigurationManager<'a>,
    pub(super) sdo: Client,
    /// What the application does with the SDO client.
    pub(super) job: Option<Job<'a>>,
    pub(super) wrong_state: u32,
    pub(super) data: ProcessData,
    pub(super) statistics: NodeStatistics,
    pub(super) record: Record,
}

impl<'a> Node<'a> {
    pub(super) fn new(config: NodeConfig<'a>) -> Node<'a> {
        Node {
            config,
            stage: BootStage::Searching { ident_due_ns: 0 },
            state: NodeState::Absent,
            nmt_state: NmtState::Off,
            mac: [0; 6],
            polled: false,
            chain: Chain::NEW,
            order: None,
            reject: None,
            requests: Requests::default(),
            signalling: Signalling::new(),
            status: StatusRequests::default(),
            ident: IdentRequests::default(),
            dropped_out: false,
            invitation: Invitation::default(),
            manager: ConfigurationManager::IDLE,
            sdo: Client::new(Timing::default()),
            job: None,
            wrong_state: 0,
            data: ProcessData {
                output: [0; PAYLOAD_MAX],
                input: [0; PAYLOAD_MAX],
                fresh: false,
                lost_in_row: 0,
            },
            statistics: NodeStatistics::default(),
            record: Record::NEW,
        }
    }

    /// Input data, and whether they came in this cycle.
    pub(super) fn input(&self) -> (&[u8], bool) {
        (&self.data.input[..usize::from(self.config.pres_bytes)], self.data.fresh)
    }

    /// Payload of the next PReq.
    pub(super) fn output(&self) -> &[u8] {
        &self.data.output[..usize::from(self.config.preq_bytes)]
    }

    pub(super) fn set_state(&mut self, state: NodeState, events: &mut Events) {
        if self.state != state {
            self.state = state;
            events.push(MnEvent::NodeStateChanged {
                node: self.config.id,
                state,
            });
        }
    }

    /// Everything that was learned from the node is void.
    pub(super) fn forget(&mut self, network: &Network) {
        self.end_job(SdoError::NodeReset);
        // The ResetNode goes out first; a node that restarts answers nothing for a while anyway.
        self.stage = BootStage::Searching {
            ident_due_ns: network.now_ns + 2 * network.cycle_ns,
        };
        self.record.searched_since_ns = network.now_ns;
        self.polled = false;
        self.chain = Chain::NEW;
        self.requests = Requests::default();
        self.reject = None;
        self.data.fresh = false;
        self.data.lost_in_row = 0;
        self.ident.open = false;
        self.wrong_state = 0;
        self.status.unanswered = 0;
        self.manager = ConfigurationManager::IDLE;
        self.nmt_state = NmtState::Off;
        self.restart_signalling(network.now_ns);
    }

    pub(super) fn restart_signalling(&mut self, now_ns: u64) {
        self.signalling = Signalling::new();
        self.status.due_ns = now_ns;
    }

    /// Gives the node up; it is reset and booted from the start.
    pub(super) fn fail(&mut self, network: &Network, fault: Fault, events: &mut Events) {
        self.give_up(network, fault, events);
        self.order = Some(Order {
            command: NmtCommand::ResetNode,
            reason: fault.error_code(),
        });
        self.set_state(NodeState::Faulted, events);
    }

    pub(super) fn give_up(&mut self, network: &Network, fault: Fault, events: &mut Events) {
        self.record.fault(network.now_ns, fault);
        events.push(fault.event(self.config.id));
        self.dropped_out |= self.is_ready() && network.state == NmtState::Operational;
        self.forget(network);
        self.statistics.faults += 1;
    }

    /// As `fail`, but by wish of the application.
    pub(super) fn reset(&mut self, network: &Network, events: &mut Events) {
        self.forget(network);
        self.command(NmtCommand::ResetNode);
        self.set_state(NodeState::Absent, events);
    }

    /// The node needs an IdentRequest.
    pub(super) fn wants_ident(&self, now_ns: u64) -> bool {
        let due = matches!(
            self.stage,
            BootStage::Searching { ident_due_ns } | BootStage::Reidentifying { ident_due_ns, .. } if now_ns >= ident_due_ns
        );
        self.order.is_none() && (self.ident.asked || due)
    }

    /// An IdentRequest was sent. In the reduced cycle it may be repeated at once, later after a few cycles.
    pub(super) fn ident_sent(&mut self, network: &Network) {
        self.ident.asked = false;
        self.ident.open = true;
        let pause_cycles = if network.state == NmtState::PreOperational1 {
            0
        } else if matches!(self.stage, BootStage::Reidentifying { .. }) {
            2
        } else {
            RETRY_CYCLES
        };
        if let BootStage::Searching { ident_due_ns } | BootStage::Reidentifying { ident_due_ns, .. } = &mut self.stage {
            *ident_due_ns = network.now_ns + pause_cycles * network.cycle_ns;
        }
    }

    /// The node needs a StatusRequest: error signalling is being initialised, there are new errors, or its state is not
    /// known because it is not polled yet.
    pub(super) fn wants_status(&self, now_ns: u64) -> bool {
        let alive = self.is_identified()
            && !matches!(
                self.stage,
                BootStage::ResettingConfiguration { .. } | BootStage::Reidentifying { .. }
            )
            && self.order.is_none();
        let wanted = self.signalling.wants_status() || !self.polled || self.status.asked;
        alive && wanted && now_ns >= self.status.due_ns
    }

    /// The node has something to send: it says so, or it owes an SDO answer and has no PRes to say so.
    pub(super) fn wants_invitation(&self, now_ns: u64) -> bool {
        let asks = self.requests.count > 0 && self.requests.priority != Requests::PRIORITY_NMT;
        let owes = !self.polled && now_ns >= self.invitation.due_ns && self.sdo.awaits_answer(now_ns);
        self.is_identified() && (asks || owes)
    }

    /// An SDO frame goes out to the node; it may be invited at once.
    pub(super) fn sdo_sent(&mut self, now_ns: u64) {
        self.invitation.due_ns = now_ns;
        self.invitation.pause_ns = 0;
    }

    /// The node was invited and sent nothing.
    pub(super) fn invitation_unused(&mut self, network: &Network) {
        self.invitation.pause_ns =
            (2 * self.invitation.pause_ns).clamp(network.slot_ns, INVITE_PAUSE_SLOTS * network.slot_ns);
        self.invitation.due_ns = network.now_ns + self.invitation.pause_ns;
    }

    /// The StatusRequest got no answer.
    pub(super) fn status_missed(&mut self, network: &Network, events: &mut Events) {
        self.status.due_ns = network.now_ns + RETRY_CYCLES * network.cycle_ns;
        self.status.asked = false;
        self.status.unanswered = self.status.unanswered.saturating_add(1);
        if !self.statistics.loss_of_status.count_error(self.config.status_threshold) {
            return;
        }
        if self.polled {
            // Its PRes show that it lives: it does without error signalling.
            self.signalling.give_up();
            self.status.unanswered = 0;
        } else {
            let in_row = self.status.unanswered;
            self.fail(network, Fault::StatusLost { in_row }, events);
        }
    }

    /// The node reported its NMT state in an IdentResponse or StatusResponse.
    pub(super) fn reported(&mut self, state: NmtState, network: &Network) {
        self.nmt_state = state;
        let waits_for_reset = matches!(self.stage, BootStage::ResettingConfiguration { .. });
        // A chained node counts as polled from the answer on by which it takes its time.
        let by_poll = !self.config.assignment.chained && !self.config.assignment.async_only;
        if network.state.is_isochronous()
            && state.is_isochronous()
            && self.is_identified()
            && !waits_for_reset
            && by_poll
        {
            self.polled = true;
        }
    }

    /// A StatusResponse came.
    pub(super) fn status(&mut self, status: &StatusResponse<'_>, network: &Network, events: &mut Events) {
        self.status.unanswered = 0;
        self.statistics.loss_of_status.count_good();
        self.status.asked = false;
        self.requests = status.requests;
        self.reported(status.nmt_state, network);
        let pause_ns = if self.is_settled() { SUPERVISION_NS } else { 0 };
        self.status.due_ns = network.now_ns + pause_ns;
        if self.signalling.status(status) {
            for entry in status.entries.iter() {
                self.record.error(network.now_ns, entry);
                events.push(MnEvent::ErrorEntry {
                    node: self.config.id,
                    entry,
                });
            }
        }
        let stopped = matches!(self.stage, BootStage::Stopped { .. });
        if network.state.is_isochronous() && (self.config.assignment.async_only || stopped) {
            self.check_state(network, events);
        }
    }

    /// Nothing is expected to change, and it is not polled.
    fn is_settled(&self) -> bool {
        if let BootStage::Stopped { .. } = self.stage {
            return self.nmt_state == NmtState::Stopped;
        }
        let waits = matches!(
            self.stage,
            BootStage::Ready | BootStage::Operational | BootStage::TakenOver
        );
        waits && self.config.assignment.async_only && !self.signalling.wants_status()
    }

    /// The PRes of this cycle came in time.
    pub(super) fn polled_well(&mut self, pres: &Pres<'_>, network: &Network, events: &mut Events) {
        self.statistics.pres_received += 1;
        self.data.lost_in_row = 0;
        self.nmt_state = pres.nmt_state;
        self.requests = pres.requests;
        self.signalling.polled(pres.exception_new);
        self.statistics.loss_of_pres.count_good();
        let length = usize::from(self.config.pres_bytes);
        let versions = (self.config.pres_version & MAIN_VERSION, pres.pdo_version & MAIN_VERSION);
        if pres.ready && versions.0 != 0 && versions.0 != versions.1 {
            if self.statistics.pres_version == 0 {
                events.push(MnEvent::MappingVersion {
                    node: self.config.id,
                    expected: self.config.pres_version,
                    got: pres.pdo_version,
                });
            }
            self.statistics.pres_version += 1;
        } else if pres.ready {
            match pres.payload.get(..length) {
                Some(data) => {
                    self.data.input[..length].copy_from_slice(data);
                    self.data.fresh = true;
                }
                None => self.statistics.pres_short += 1,
            }
        }
        // A node that sends less than was mapped has lost its configuration: its data would never be used.
        if let BootStage::CheckingCommunication { good, .. } = &mut self.stage
            && pres.nmt_state == NmtState::ReadyToOperate
            && pres.payload.len() >= length
        {
            *good += 1;
        }
        self.check_state(network, events);
    }

    /// Compares the NMT state with what the boot-up has led to; a few cycles of difference are tolerated.
    pub(super) fn check_state(&mut self, network: &Network, events: &mut Events) {
        let got = self.nmt_state;
        let (expected, right) = match self.stage {
            // What it holds is read while it goes on.
            BootStage::Configuring { .. } | BootStage::ClosingSdo { .. }
                if self.config.assignment.keep_alive && got == NmtState::Operational =>
            {
                (NmtState::Operational, true)
            }
            BootStage::Searching { .. } | BootStage::Refused { .. } | BootStage::Reidentifying { .. } => return,
            BootStage::Configuring { .. }
            | BootStage::ClosingSdo { .. }
            | BootStage::ResettingConfiguration { .. }
            | BootStage::WaitingPreOperational2 { .. } => (NmtState::PreOperational2, got == NmtState::PreOperational2),
            // Ordered again until it happens.
            BootStage::Stopped { .. } => (NmtState::Stopped, got.is_isochronous() || got == NmtState::Stopped),
            BootStage::WaitingReadyToOperate { .. } => (
                NmtState::ReadyToOperate,
                got == NmtState::PreOperational2 || got == NmtState::ReadyToOperate,
            ),
            BootStage::CheckingCommunication { .. } | BootStage::Ready => {
                (NmtState::ReadyToOperate, got == NmtState::ReadyToOperate)
            }
            BootStage::WaitingOperational { .. } => (
                NmtState::Operational,
                got == NmtState::ReadyToOperate || got == NmtState::Operational,
            ),
            BootStage::Operational | BootStage::TakenOver => (NmtState::Operational, got == NmtState::Operational),
        };
        if right {
            self.wrong_state = 0;
            return;
        }
        self.wrong_state += 1;
        if self.wrong_state > STATE_TOLERANCE_CYCLES {
            self.fail(network, Fault::WrongState { expected, got }, events);
        }
    }

    /// The PRes of this cycle did not come in time.
    pub(super) fn poll_lost(&mut self, lost_max: u32, network: &Network, events: &mut Events) {
        self.statistics.pres_lost += 1;
        self.data.lost_in_row = self.data.lost_in_row.saturating_add(1);
        self.statistics.lost_in_row_max = self.statistics.lost_in_row_max.max(self.data.lost_in_row);
        if let BootStage::CheckingCommunication { good, .. } = &mut self.stage {
            *good = 0;
        }
        let threshold_reached = self.statistics.loss_of_pres.count_error(self.config.pres_threshold);
        if self.data.lost_in_row > lost_max || threshold_reached {
            let in_row = self.data.lost_in_row;
            self.fail(network, Fault::PresLost { in_row }, events);
            // The application still sees how long the data have been old.
            self.data.lost_in_row = in_row;
        }
    }
}
