//! One controlled node as the managing node sees it: its boot-up, its process data, its watch.
//!
//! In:  what the node sent (IdentResponse, StatusResponse, PRes, SDO), lost polls, the time, the state of the network.
//! Out: what the node needs next (an IdentRequest, a StatusRequest, an NMT command, an SDO frame), events.
//! RT: no allocation, no locks, bounded.
//!
//! The way of a node through the boot-up, see [`Stage`]:
//!
//! ```text
//! Search -> Configure -> CloseSdo -> ResetConfiguration -> Reidentify -> Enable -> WaitReady -> Check -> Ready
//!    ^                                                                                                     |
//!    |  lost, wrong state, time-out: ResetNode, and from the start                  WaitOperational <------+
//!    +-------------------------------------------------------------- Operational <--------+
//! ```

use obd::AbortCode;
use obd::cdc::CdcReader;

use super::NodeState;
use super::config::{BootTimes, NodeConfig};
use super::event::{Events, IdentityField, MnEvent, NodeStatistics};
use super::signalling::Signalling;
use crate::nmt::{NmtCommand, NmtState};
use crate::sdo::{Client, Timing};
use crate::wire::{IdentResponse, Mac, PAYLOAD_MAX, Pres, Requests, StatusResponse};

/// Good PRes in a row that the communication check asks for.
const CHECK_CYCLES: u32 = 3;
/// PRes in a row with a wrong NMT state that are tolerated (C_NMT_STATE_TOLERANCE).
const STATE_TOLERANCE_CYCLES: u32 = 5;
/// StatusRequests in a row without an answer after which a node that is not polled yet counts as lost.
const STATUS_UNANSWERED_MAX: u32 = 15;
/// Cycles between two requests to a node that does not answer.
const RETRY_CYCLES: u64 = 5;
/// An NMT command that has shown no effect is sent again after this time.
const COMMAND_RETRY_NS: u64 = 50_000_000;
/// A node that was refused (identity, configuration) is looked at again after this time.
const REFUSED_RETRY_NS: u64 = 5_000_000_000;
/// A configuration value without an answer for this time has failed.
const SDO_GIVE_UP_NS: u64 = 5_000_000_000;

/// Error codes sent in the data of a ResetNode.
pub(super) mod reset_reason {
    /// The application or the boot-up asks for it.
    pub(in crate::mn) const NONE: u16 = 0;
    /// E_NMT_BPO2: a step of the boot-up failed.
    pub(in crate::mn) const BOOT_FAILED: u16 = 0x8430;
    /// E_DLL_LOSS_PRES_TH.
    pub(in crate::mn) const LOSS_OF_PRES: u16 = 0x8243;
    /// E_NMT_NO_STATUS_RES.
    pub(in crate::mn) const NO_STATUS_RESPONSE: u16 = 0xF002;
    /// E_NMT_WRONG_STATE.
    pub(in crate::mn) const WRONG_STATE: u16 = 0x8480;
}

/// Where the boot-up of a node stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// IdentRequests until it answers.
    Search,
    /// Wrong identity, or it refused its configuration; looked at again later.
    Refused { until_ns: u64 },
    /// Identified; the configuration is being written.
    Configure,
    /// Everything is written; the SDO connection is being closed.
    CloseSdo,
    /// ResetConfiguration waits for a slot.
    ResetConfiguration,
    /// ResetConfiguration was sent; IdentRequests until the node is back.
    Reidentify { deadline_ns: u64 },
    /// Configured; waits for PRE_OPERATIONAL_2.
    Enable { deadline_ns: u64 },
    /// EnableReadyToOperate was ordered; waits for READY_TO_OPERATE.
    WaitReady { deadline_ns: u64, again_ns: u64 },
    /// Communication check: good PRes in a row.
    Check { deadline_ns: u64, good: u32 },
    /// Ready; waits for the network.
    Ready,
    /// StartNode was ordered; waits for OPERATIONAL.
    WaitOperational { deadline_ns: u64, again_ns: u64 },
    /// Done.
    Operational,
}

/// An NMT command that waits for a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Order {
    pub(super) command: NmtCommand,
    /// Error code for the data of a ResetNode; 0: none.
    pub(super) reason: u16,
}

/// What a node needs to know of the network to take its next step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Network {
    pub(super) state: NmtState,
    pub(super) cycle_ns: u64,
    pub(super) boot: BootTimes,
}

/// One controlled node.
#[derive(Clone, Debug)]
pub(super) struct Node<'a> {
    pub(super) config: NodeConfig<'a>,
    pub(super) stage: Stage,
    pub(super) state: NodeState,
    /// As last reported by the node.
    pub(super) nmt_state: NmtState,
    /// Learned from the IdentResponse.
    pub(super) mac: Mac,
    /// PReqs are sent.
    pub(super) polled: bool,
    pub(super) order: Option<Order>,
    /// An NMT request of this node that is answered with InvalidService.
    pub(super) reject: Option<NmtCommand>,
    pub(super) requests: Requests,
    pub(super) signalling: Signalling,
    status_due_ns: u64,
    status_unanswered: u32,
    /// Another node asked for a StatusRequest or an IdentRequest to this one.
    pub(super) status_asked: bool,
    pub(super) ident_asked: bool,
    ident_due_ns: u64,
    /// Writes of the concise DCF that are still to come.
    writes: Option<CdcReader<'a>>,
    writing: (u16, u8),
    written: u32,
    pub(super) sdo: Client,
    wrong_state: u32,
    pub(super) output: [u8; PAYLOAD_MAX],
    input: [u8; PAYLOAD_MAX],
    fresh: bool,
    pub(super) lost_in_row: u32,
    pub(super) statistics: NodeStatistics,
}

impl<'a> Node<'a> {
    pub(super) fn new(config: NodeConfig<'a>) -> Node<'a> {
        Node {
            config,
            stage: Stage::Search,
            state: NodeState::Absent,
            nmt_state: NmtState::Off,
            mac: [0; 6],
            polled: false,
            order: None,
            reject: None,
            requests: Requests::default(),
            signalling: Signalling::new(),
            status_due_ns: 0,
            status_unanswered: 0,
            status_asked: false,
            ident_asked: false,
            ident_due_ns: 0,
            writes: None,
            writing: (0, 0),
            written: 0,
            sdo: Client::new(Timing::default()),
            wrong_state: 0,
            output: [0; PAYLOAD_MAX],
            input: [0; PAYLOAD_MAX],
            fresh: false,
            lost_in_row: 0,
            statistics: NodeStatistics::default(),
        }
    }

    /// The node answers IdentRequests and is what it shall be.
    pub(super) fn is_identified(&self) -> bool {
        !matches!(self.stage, Stage::Search | Stage::Refused { .. })
    }

    /// The node holds its configuration.
    pub(super) fn is_configured(&self) -> bool {
        match self.stage {
            Stage::Search
            | Stage::Refused { .. }
            | Stage::Configure
            | Stage::CloseSdo
            | Stage::ResetConfiguration
            | Stage::Reidentify { .. } => false,
            Stage::Enable { .. }
            | Stage::WaitReady { .. }
            | Stage::Check { .. }
            | Stage::Ready
            | Stage::WaitOperational { .. }
            | Stage::Operational => true,
        }
    }

    /// The node is READY_TO_OPERATE or further, and its communication was checked.
    pub(super) fn is_ready(&self) -> bool {
        matches!(
            self.stage,
            Stage::Ready | Stage::WaitOperational { .. } | Stage::Operational
        )
    }

    /// Input data, and whether they came in this cycle.
    pub(super) fn input(&self) -> (&[u8], bool) {
        (&self.input[..usize::from(self.config.pres_bytes)], self.fresh)
    }

    /// Payload of the next PReq.
    pub(super) fn output(&self) -> &[u8] {
        &self.output[..usize::from(self.config.preq_bytes)]
    }

    /// A new cycle begins.
    pub(super) fn start_cycle(&mut self) {
        self.fresh = false;
    }

    fn set_state(&mut self, state: NodeState, events: &mut Events) {
        if self.state != state {
            self.state = state;
            events.push(MnEvent::NodeStateChanged {
                node: self.config.id,
                state,
            });
        }
    }

    /// Everything that was learned from the node is void.
    fn forget(&mut self, now_ns: u64, network: &Network) {
        self.stage = Stage::Search;
        self.polled = false;
        self.requests = Requests::default();
        self.reject = None;
        self.fresh = false;
        self.lost_in_row = 0;
        self.wrong_state = 0;
        self.status_unanswered = 0;
        self.writes = None;
        self.nmt_state = NmtState::Off;
        // The ResetNode goes out first; a node that restarts answers nothing for a while anyway.
        self.ident_due_ns = now_ns + 2 * network.cycle_ns;
        self.restart_signalling(now_ns);
    }

    fn restart_signalling(&mut self, now_ns: u64) {
        self.signalling = Signalling::new();
        self.status_due_ns = now_ns;
    }

    /// Gives the node up; it is reset and booted from the start.
    pub(super) fn fail(&mut self, now_ns: u64, network: &Network, reason: u16, events: &mut Events) {
        self.forget(now_ns, network);
        self.statistics.faults += 1;
        self.order = Some(Order {
            command: NmtCommand::ResetNode,
            reason,
        });
        self.set_state(NodeState::Faulted, events);
    }

    /// As `fail`, but by wish of the application.
    pub(super) fn reset(&mut self, now_ns: u64, network: &Network, events: &mut Events) {
        self.forget(now_ns, network);
        self.order = Some(Order {
            command: NmtCommand::ResetNode,
            reason: reset_reason::NONE,
        });
        self.set_state(NodeState::Absent, events);
    }

    /// The node must not go on as it is; it stays out for some seconds.
    fn refuse(&mut self, now_ns: u64, network: &Network, events: &mut Events) {
        self.forget(now_ns, network);
        self.stage = Stage::Refused {
            until_ns: now_ns + REFUSED_RETRY_NS,
        };
        self.statistics.faults += 1;
        self.set_state(NodeState::Faulted, events);
    }

    /// The node needs an IdentRequest.
    pub(super) fn wants_ident(&self, now_ns: u64) -> bool {
        let searching = matches!(self.stage, Stage::Search | Stage::Reidentify { .. });
        self.order.is_none() && (self.ident_asked || (searching && now_ns >= self.ident_due_ns))
    }

    /// An IdentRequest was sent. In the reduced cycle it may be repeated at once, later after a few cycles.
    pub(super) fn ident_sent(&mut self, now_ns: u64, network: &Network) {
        self.ident_asked = false;
        let pause_cycles = if network.state == NmtState::PreOperational1 {
            0
        } else if matches!(self.stage, Stage::Reidentify { .. }) {
            2
        } else {
            RETRY_CYCLES
        };
        self.ident_due_ns = now_ns + pause_cycles * network.cycle_ns;
    }

    /// The node needs a StatusRequest: error signalling is being initialised, there are new errors, or its state is not
    /// known because it is not polled yet.
    pub(super) fn wants_status(&self, now_ns: u64) -> bool {
        let alive = self.is_identified()
            && !matches!(self.stage, Stage::ResetConfiguration | Stage::Reidentify { .. })
            && self.order.is_none();
        let wanted = self.signalling.wants_status() || !self.polled || self.status_asked;
        alive && wanted && now_ns >= self.status_due_ns
    }

    /// The StatusRequest got no answer.
    pub(super) fn status_missed(&mut self, now_ns: u64, network: &Network, events: &mut Events) {
        self.status_due_ns = now_ns + RETRY_CYCLES * network.cycle_ns;
        self.status_asked = false;
        self.status_unanswered += 1;
        if self.status_unanswered < STATUS_UNANSWERED_MAX {
            return;
        }
        if self.polled {
            // Its PRes show that it lives: it does without error signalling.
            self.signalling.give_up();
            self.status_unanswered = 0;
        } else {
            events.push(MnEvent::Lost {
                node: self.config.id,
                in_row: self.status_unanswered,
            });
            self.fail(now_ns, network, reset_reason::NO_STATUS_RESPONSE, events);
        }
    }

    /// The node reported its NMT state in an IdentResponse or StatusResponse.
    fn reported(&mut self, state: NmtState, network: &Network) {
        self.nmt_state = state;
        let waits_for_reset = matches!(self.stage, Stage::ResetConfiguration);
        if network.state.is_isochronous() && state.is_isochronous() && self.is_identified() && !waits_for_reset {
            self.polled = true;
        }
    }

    /// An IdentResponse came.
    pub(super) fn identified(
        &mut self,
        now_ns: u64,
        mac: Mac,
        ident: &IdentResponse,
        network: &Network,
        events: &mut Events,
    ) {
        match self.stage {
            Stage::Search => {}
            Stage::Reidentify { .. } => {
                self.requests = ident.requests;
                self.restart_signalling(now_ns);
                self.enable(now_ns, network);
                self.reported(ident.nmt_state, network);
                return;
            }
            Stage::Refused { .. }
            | Stage::Configure
            | Stage::CloseSdo
            | Stage::ResetConfiguration
            | Stage::Enable { .. }
            | Stage::WaitReady { .. }
            | Stage::Check { .. }
            | Stage::Ready
            | Stage::WaitOperational { .. }
            | Stage::Operational => return,
        }
        if self.order.is_some() {
            // It is about to be reset; what it says now is void.
            return;
        }
        if let Some((field, expected, got)) = self.mismatch(ident) {
            events.push(MnEvent::IdentityMismatch {
                node: self.config.id,
                field,
                expected,
                got,
            });
            self.refuse(now_ns, network, events);
            return;
        }
        match ident.nmt_state {
            NmtState::PreOperational1 | NmtState::PreOperational2 => {}
            // It runs with what some earlier network gave it, or is stopped: from the start.
            NmtState::ReadyToOperate
            | NmtState::Operational
            | NmtState::Stopped
            | NmtState::Off
            | NmtState::Initialising
            | NmtState::ResetApplication
            | NmtState::ResetCommunication
            | NmtState::ResetConfiguration
            | NmtState::NotActive
            | NmtState::BasicEthernet
            | NmtState::Unknown(_) => {
                self.order = Some(Order {
                    command: NmtCommand::ResetNode,
                    reason: reset_reason::WRONG_STATE,
                });
                return;
            }
        }
        self.mac = mac;
        self.requests = ident.requests;
        self.statistics.boots += 1;
        self.written = 0;
        self.status_unanswered = 0;
        self.lost_in_row = 0;
        self.restart_signalling(now_ns);
        events.push(MnEvent::Identified { node: self.config.id });
        self.set_state(NodeState::Configuring, events);
        // Checked when the managing node was made; an empty one has nothing to read.
        self.writes = CdcReader::new(self.config.configuration).ok();
        if self.configuration_is_current(ident) {
            self.enable(now_ns, network);
        } else {
            self.sdo = Client::new(timing(network.cycle_ns));
            self.stage = Stage::Configure;
        }
        self.reported(ident.nmt_state, network);
    }

    fn mismatch(&self, ident: &IdentResponse) -> Option<(IdentityField, u32, u32)> {
        let identity = &self.config.identity;
        [
            (IdentityField::DeviceType, identity.device_type, ident.device_type),
            (IdentityField::VendorId, identity.vendor_id, ident.vendor_id),
            (IdentityField::ProductCode, identity.product_code, ident.product_code),
            (IdentityField::Revision, identity.revision, ident.revision),
            (IdentityField::Serial, identity.serial, ident.serial),
        ]
        .into_iter()
        .find_map(|(field, expected, got)| expected.filter(|value| *value != got).map(|value| (field, value, got)))
    }

    /// Nothing to write: the configuration is empty, or the node reports the date and time (0x1020/1, /2) that it sets.
    fn configuration_is_current(&self, ident: &IdentResponse) -> bool {
        let Some(writes) = self.writes.clone() else { return true };
        let (mut date, mut time, mut count) = (0, 0, 0u32);
        for write in writes.flatten() {
            count += 1;
            if let (0x1020, Ok(value)) = (write.index, write.value.try_into()) {
                match write.sub {
                    1 => date = u32::from_le_bytes(value),
                    2 => time = u32::from_le_bytes(value),
                    _ => {}
                }
            }
        }
        let current = (ident.configuration_date, ident.configuration_time);
        count == 0 || (date != 0 && time != 0 && current == (date, time))
    }

    /// The isochronous cycle begins: what a node that was identified long ago has to do in time counts from now.
    pub(super) fn cycle_begins(&mut self, now_ns: u64, network: &Network) {
        if matches!(self.stage, Stage::Enable { .. }) {
            self.enable(now_ns, network);
        }
    }

    fn enable(&mut self, now_ns: u64, network: &Network) {
        self.stage = Stage::Enable {
            deadline_ns: now_ns + us(network.boot.timeout_pre_op_2_us),
        };
    }

    /// A StatusResponse came.
    pub(super) fn status(&mut self, now_ns: u64, status: &StatusResponse<'_>, network: &Network, events: &mut Events) {
        self.status_unanswered = 0;
        self.status_asked = false;
        self.requests = status.requests;
        self.status_due_ns = now_ns;
        self.reported(status.nmt_state, network);
        if self.signalling.status(status) {
            for entry in status.entries.iter() {
                events.push(MnEvent::ErrorEntry {
                    node: self.config.id,
                    entry,
                });
            }
        }
    }

    /// The PRes of this cycle came in time.
    pub(super) fn polled_well(&mut self, now_ns: u64, pres: &Pres<'_>, network: &Network, events: &mut Events) {
        self.statistics.pres_received += 1;
        self.lost_in_row = 0;
        self.nmt_state = pres.nmt_state;
        self.requests = pres.requests;
        self.signalling.polled(pres.exception_new);
        let length = usize::from(self.config.pres_bytes);
        if pres.ready {
            match pres.payload.get(..length) {
                Some(data) => {
                    self.input[..length].copy_from_slice(data);
                    self.fresh = true;
                }
                None => self.statistics.pres_short += 1,
            }
        }
        if let Stage::Check { good, .. } = &mut self.stage
            && pres.nmt_state == NmtState::ReadyToOperate
        {
            *good += 1;
        }
        self.check_state(now_ns, network, events);
    }

    /// Compares the NMT state with what the boot-up has led to; a few cycles of difference are tolerated.
    fn check_state(&mut self, now_ns: u64, network: &Network, events: &mut Events) {
        let got = self.nmt_state;
        let (expected, right) = match self.stage {
            Stage::Search | Stage::Refused { .. } | Stage::Reidentify { .. } => return,
            Stage::Configure | Stage::CloseSdo | Stage::ResetConfiguration | Stage::Enable { .. } => {
                (NmtState::PreOperational2, got == NmtState::PreOperational2)
            }
            Stage::WaitReady { .. } => (
                NmtState::ReadyToOperate,
                got == NmtState::PreOperational2 || got == NmtState::ReadyToOperate,
            ),
            Stage::Check { .. } | Stage::Ready => (NmtState::ReadyToOperate, got == NmtState::ReadyToOperate),
            Stage::WaitOperational { .. } => (
                NmtState::Operational,
                got == NmtState::ReadyToOperate || got == NmtState::Operational,
            ),
            Stage::Operational => (NmtState::Operational, got == NmtState::Operational),
        };
        if right {
            self.wrong_state = 0;
            return;
        }
        self.wrong_state += 1;
        if self.wrong_state > STATE_TOLERANCE_CYCLES {
            events.push(MnEvent::WrongState {
                node: self.config.id,
                expected,
                got,
            });
            self.fail(now_ns, network, reset_reason::WRONG_STATE, events);
        }
    }

    /// The PRes of this cycle did not come in time.
    pub(super) fn poll_lost(&mut self, now_ns: u64, lost_max: u32, network: &Network, events: &mut Events) {
        self.statistics.pres_lost += 1;
        self.lost_in_row += 1;
        self.statistics.lost_in_row_max = self.statistics.lost_in_row_max.max(self.lost_in_row);
        if let Stage::Check { good, .. } = &mut self.stage {
            *good = 0;
        }
        if self.lost_in_row > lost_max {
            let in_row = self.lost_in_row;
            events.push(MnEvent::Lost {
                node: self.config.id,
                in_row,
            });
            self.fail(now_ns, network, reset_reason::LOSS_OF_PRES, events);
            // The application still sees how long the data have been old.
            self.lost_in_row = in_row;
        }
    }

    /// The ordered NMT command is on the wire.
    pub(super) fn order_sent(&mut self, now_ns: u64, network: &Network) {
        let Some(order) = self.order.take() else { return };
        if order.command == NmtCommand::ResetConfiguration && self.stage == Stage::ResetConfiguration {
            self.polled = false;
            self.ident_due_ns = now_ns;
            self.stage = Stage::Reidentify {
                deadline_ns: now_ns + us(network.boot.timeout_pre_op_2_us),
            };
        }
    }

    /// The next step of the boot-up, once a slot.
    pub(super) fn step(&mut self, now_ns: u64, network: &Network, events: &mut Events) {
        // In the reduced cycle nodes are only looked for.
        if !network.state.is_isochronous() && !matches!(self.stage, Stage::Refused { .. }) {
            return;
        }
        match self.stage {
            Stage::Search => {}
            Stage::Refused { until_ns } => {
                if now_ns >= until_ns {
                    self.stage = Stage::Search;
                    self.ident_due_ns = now_ns;
                }
            }
            // A node that is not polled yet has not seen a SoC; its RS would not be seen either.
            Stage::Configure => {
                if self.polled {
                    self.configure(now_ns, network, events);
                }
            }
            Stage::CloseSdo => {
                if !self.sdo.wants_to_transmit(now_ns) {
                    self.order = Some(Order {
                        command: NmtCommand::ResetConfiguration,
                        reason: reset_reason::NONE,
                    });
                    self.stage = Stage::ResetConfiguration;
                }
            }
            Stage::ResetConfiguration => {}
            Stage::Reidentify { deadline_ns } => {
                self.check_time(now_ns, deadline_ns, NmtState::PreOperational1, network, events)
            }
            Stage::Enable { deadline_ns } => {
                if self.polled && self.nmt_state == NmtState::PreOperational2 {
                    self.ask_ready(now_ns, deadline_ns);
                } else {
                    self.check_time(now_ns, deadline_ns, NmtState::PreOperational2, network, events);
                }
            }
            Stage::WaitReady { deadline_ns, again_ns } => {
                if self.nmt_state == NmtState::ReadyToOperate {
                    self.order = None;
                    let deadline_ns = now_ns + us(network.boot.timeout_ready_to_operate_us);
                    self.stage = Stage::Check { deadline_ns, good: 0 };
                } else if now_ns >= again_ns && now_ns < deadline_ns {
                    self.ask_ready(now_ns, deadline_ns);
                } else {
                    self.check_time(now_ns, deadline_ns, NmtState::ReadyToOperate, network, events);
                }
            }
            Stage::Check { deadline_ns, good } => {
                if good >= CHECK_CYCLES {
                    self.stage = Stage::Ready;
                    self.set_state(NodeState::Ready, events);
                } else {
                    self.check_time(now_ns, deadline_ns, NmtState::ReadyToOperate, network, events);
                }
            }
            Stage::Ready => {
                if network.state == NmtState::Operational {
                    self.order = Some(Order {
                        command: NmtCommand::StartNode,
                        reason: reset_reason::NONE,
                    });
                    self.stage = Stage::WaitOperational {
                        deadline_ns: now_ns + us(network.boot.timeout_ready_to_operate_us),
                        again_ns: now_ns + COMMAND_RETRY_NS,
                    };
                }
            }
            Stage::WaitOperational { deadline_ns, again_ns } => {
                if self.nmt_state == NmtState::Operational {
                    self.order = None;
                    self.stage = Stage::Operational;
                    self.set_state(NodeState::Operational, events);
                } else if now_ns >= again_ns && now_ns < deadline_ns {
                    self.order = Some(Order {
                        command: NmtCommand::StartNode,
                        reason: reset_reason::NONE,
                    });
                    self.stage = Stage::WaitOperational {
                        deadline_ns,
                        again_ns: now_ns + COMMAND_RETRY_NS,
                    };
                } else {
                    self.check_time(now_ns, deadline_ns, NmtState::Operational, network, events);
                }
            }
            Stage::Operational => {}
        }
    }

    /// Orders READY_TO_OPERATE; again after a while, as an NMT command is never acknowledged.
    fn ask_ready(&mut self, now_ns: u64, deadline_ns: u64) {
        self.order = Some(Order {
            command: NmtCommand::EnableReadyToOperate,
            reason: reset_reason::NONE,
        });
        self.stage = Stage::WaitReady {
            deadline_ns,
            again_ns: now_ns + COMMAND_RETRY_NS,
        };
    }

    fn check_time(
        &mut self,
        now_ns: u64,
        deadline_ns: u64,
        expected: NmtState,
        network: &Network,
        events: &mut Events,
    ) {
        if now_ns >= deadline_ns {
            events.push(MnEvent::BootTimeout {
                node: self.config.id,
                expected,
                got: self.nmt_state,
            });
            self.fail(now_ns, network, reset_reason::BOOT_FAILED, events);
        }
    }

    /// Takes the result of the last write and starts the next one.
    fn configure(&mut self, now_ns: u64, network: &Network, events: &mut Events) {
        let (index, sub) = self.writing;
        let node = self.config.id;
        if self.sdo.is_busy() {
            let aborted = match self.sdo.result() {
                None => return,
                Some(Ok(_)) => None,
                Some(Err(crate::sdo::ClientError::Aborted(code))) => Some(code),
                Some(Err(
                    crate::sdo::ClientError::TimedOut { .. }
                    | crate::sdo::ClientError::BadAnswer(_)
                    | crate::sdo::ClientError::Busy
                    | crate::sdo::ClientError::TooLong { .. },
                )) => {
                    events.push(MnEvent::SdoFailed { node, index, sub });
                    self.fail(now_ns, network, reset_reason::BOOT_FAILED, events);
                    return;
                }
            };
            if let Some(code) = aborted {
                events.push(MnEvent::SdoAbort { node, index, sub, code });
                if !may_be_refused(index, code) {
                    self.refuse(now_ns, network, events);
                    self.order = Some(Order {
                        command: NmtCommand::ResetNode,
                        reason: reset_reason::BOOT_FAILED,
                    });
                    return;
                }
            } else {
                self.statistics.objects_written += 1;
            }
            self.written += 1;
        } else if self.written == 0 {
            events.push(MnEvent::Configuring { node });
        }
        let Some(Ok(write)) = self.writes.as_mut().and_then(Iterator::next) else {
            self.sdo.close();
            self.stage = Stage::CloseSdo;
            return;
        };
        self.writing = (write.index, write.sub);
        if self.sdo.start_write(write.index, write.sub, write.value).is_err() {
            events.push(MnEvent::SdoFailed {
                node,
                index: write.index,
                sub: write.sub,
            });
            self.fail(now_ns, network, reset_reason::BOOT_FAILED, events);
        }
    }
}

/// Storing and restoring parameters is optional: a node without these objects is configured all the same.
fn may_be_refused(index: u16, code: AbortCode) -> bool {
    (index == 0x1010 || index == 0x1011) && code == AbortCode::NO_OBJECT
}

/// Time limits of the SDO clients: a lost frame is repeated after a few rounds of the asynchronous slot.
fn timing(cycle_ns: u64) -> Timing {
    let first_timeout_ns = (20 * cycle_ns).max(20_000_000);
    Timing {
        first_timeout_ns,
        longest_timeout_ns: 8 * first_timeout_ns,
        give_up_ns: SDO_GIVE_UP_NS,
        acknowledge_delay_ns: first_timeout_ns / 2,
    }
}

pub(super) fn us(microseconds: u32) -> u64 {
    u64::from(microseconds) * 1000
}
