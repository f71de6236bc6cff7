//! The boot-up of one controlled node, stage by stage.
//!
//! In:  IdentResponses, the NMT state the node reports, the time, the state of the network.
//! Out: the node's stage, NMT commands to it, events.
//! RT: no allocation, no locks, bounded.
//!
//! ```text
//! Search -> Configure -> CloseSdo -> ResetConfiguration -> Reidentify -> Enable -> WaitReady -> Check -> Ready
//!    ^                                                                                                     |
//!    |  lost, wrong state, time-out: ResetNode, and from the start                  WaitOperational <------+
//!    +-------------------------------------------------------------- Operational <--------+
//! ```

use super::config::{expected_stamp, us_to_ns};
use super::configure::timing;
use super::event::{Events, MnEvent, NodeState};
use super::fault::{Fault, reset_reason};
use super::node::{Network, Node};
use super::stage::{BootStage, Chain, Order};
use crate::nmt::{NmtCommand, NmtState};
use crate::wire::{IdentResponse, Mac};

/// Good PRes in a row that the communication check asks for.
const CHECK_CYCLES: u32 = 3;
/// An NMT command that has shown no effect is sent again after this time, or after some cycles if they take longer.
const COMMAND_RETRY_NS: u64 = 15_000_000;
const COMMAND_RETRY_CYCLES: u64 = 4;
/// ResetConfiguration goes out so often at the most. A node that has not heard it goes on with the cycle length it had, or
/// without a watch over the SoC; that it has heard it shows in its IdentResponse by date and time of the configuration.
const RESET_CONFIGURATION_MAX: u8 = 3;
/// Where they are not known, one that has not heard it answers like one that has: it goes out so often.
const RESET_CONFIGURATION_BLIND: u8 = 2;
/// A node is not asked who it is for this time after ResetConfiguration: the answer could be from before the reset.
const RESTART_NS: u64 = 4_000_000;
/// A node that was refused (identity, configuration) is looked at again after this time.
const REFUSED_RETRY_NS: u64 = 5_000_000_000;

impl<'a> Node<'a> {
    /// The node answers IdentRequests and is what it shall be.
    pub(super) fn is_identified(&self) -> bool {
        !matches!(self.stage, BootStage::Searching { .. } | BootStage::Refused { .. })
    }

    /// The node answers IdentRequests and is not what it shall be.
    pub(super) fn is_refused(&self) -> bool {
        matches!(self.stage, BootStage::Refused { .. })
    }

    /// The node holds its configuration, and the application may use its SDO client.
    pub(super) fn is_configured(&self) -> bool {
        self.is_identified() && !self.is_being_configured()
    }

    /// The configuration manager is at work with the node.
    pub(super) fn is_being_configured(&self) -> bool {
        matches!(
            self.stage,
            BootStage::Configuring { .. }
                | BootStage::ClosingSdo { .. }
                | BootStage::ResettingConfiguration { .. }
                | BootStage::Reidentifying { .. }
        )
    }

    /// The node has reached READY_TO_OPERATE, or is further.
    pub(super) fn is_ready_to_operate(&self) -> bool {
        self.is_ready() || matches!(self.stage, BootStage::CheckingCommunication { .. })
    }

    /// The node is READY_TO_OPERATE or further, and its communication was checked.
    pub(super) fn is_ready(&self) -> bool {
        matches!(
            self.stage,
            BootStage::Ready | BootStage::WaitingOperational { .. } | BootStage::Operational | BootStage::TakenOver
        )
    }

    /// The node must not go on as it is; it stays out for some seconds.
    pub(super) fn refuse(&mut self, network: &Network, fault: Fault, events: &mut Events) {
        self.give_up(network, fault, events);
        self.stage = BootStage::Refused {
            until_ns: network.now_ns + REFUSED_RETRY_NS,
        };
        self.set_state(NodeState::Faulted, events);
    }

    /// An IdentResponse came.
    pub(super) fn identified(&mut self, mac: Mac, ident: &IdentResponse, network: &Network, events: &mut Events) {
        if !core::mem::take(&mut self.ident.open) {
            return;
        }
        self.record.identified(network.now_ns, ident);
        if let BootStage::Reidentifying { sent, .. } = self.stage {
            if sent < RESET_CONFIGURATION_MAX && self.missed_its_reset(ident) {
                self.order_reset_configuration(sent);
                return;
            }
            self.requests = ident.requests;
            self.restart_signalling(network.now_ns);
            self.enable(network);
            self.reported(ident.nmt_state, network);
            return;
        }
        if !matches!(self.stage, BootStage::Searching { .. }) {
            return;
        }
        if self.order.is_some() {
            // It is about to be reset; what it says now is void.
            return;
        }
        if let Some(fault) = self.mismatch(ident, network) {
            self.refuse(network, fault, events);
            return;
        }
        let keep_alive = self.config.assignment.keep_alive && self.configuration_is_current(ident, network);
        match ident.nmt_state {
            NmtState::PreOperational1 | NmtState::PreOperational2 => {}
            NmtState::Operational if keep_alive => {}
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
        self.status.unanswered = 0;
        self.data.lost_in_row = 0;
        self.restart_signalling(network.now_ns);
        events.push(MnEvent::Identified { node: self.config.id });
        self.set_state(NodeState::Configuring, events);
        if self.begin_configuration(ident, network) {
            self.stage = BootStage::Configuring {
                written: 0,
                index: 0,
                sub: 0,
            };
        } else if ident.nmt_state == NmtState::Operational {
            self.stage = BootStage::TakenOver;
        } else {
            self.enable(network);
        }
        self.reported(ident.nmt_state, network);
    }

    /// The isochronous cycle begins: what a node that was identified long ago has to do in time counts from now.
    pub(super) fn cycle_begins(&mut self, network: &Network) {
        if matches!(self.stage, BootStage::WaitingPreOperational2 { .. }) {
            self.enable(network);
        }
        self.sdo.set_timing(timing(network));
        if self.stage == BootStage::TakenOver {
            self.polled = !self.config.assignment.async_only;
        }
    }

    pub(super) fn enable(&mut self, network: &Network) {
        self.stage = BootStage::WaitingPreOperational2 {
            deadline_ns: network.now_ns + us_to_ns(network.boot.timeout_pre_op_2_us),
        };
    }

    /// The ordered NMT command is on the wire.
    pub(super) fn order_sent(&mut self, network: &Network) {
        let Some(order) = self.order.take() else { return };
        if matches!(self.stage, BootStage::Stopped { .. }) {
            self.stop_polling();
            self.status.due_ns = network.now_ns;
        }
        // The wait for the slot does not count.
        if let BootStage::WaitingReadyToOperate { again_ns, .. }
        | BootStage::WaitingOperational { again_ns, .. }
        | BootStage::Stopped { again_ns } = &mut self.stage
        {
            *again_ns = network.now_ns + command_retry_ns(network);
        }
        if let (NmtCommand::ResetConfiguration, BootStage::ResettingConfiguration { sent }) =
            (order.command, self.stage)
        {
            self.stop_polling();
            let sent = sent + 1;
            if sent < RESET_CONFIGURATION_BLIND && expected_stamp(&self.config).is_none() {
                self.order_reset_configuration(sent);
                return;
            }
            self.stage = BootStage::Reidentifying {
                ident_due_ns: network.now_ns + RESTART_NS,
                deadline_ns: network.now_ns + us_to_ns(network.boot.timeout_pre_op_2_us),
                sent,
            };
        }
    }

    /// The next step of the boot-up, once a slot.
    pub(super) fn step(&mut self, network: &Network, events: &mut Events) {
        // In the reduced cycle nodes are looked for and configured, as its slots follow each other without a pause.
        let reduced = !network.state.is_isochronous();
        if reduced && !self.is_being_configured() && !matches!(self.stage, BootStage::Refused { .. }) {
            return;
        }
        match self.stage {
            BootStage::Searching { .. } => {}
            BootStage::Refused { until_ns } => {
                if network.now_ns >= until_ns {
                    self.stage = BootStage::Searching {
                        ident_due_ns: network.now_ns,
                    };
                }
            }
            // In the cycle a node that is not polled yet is about to be.
            BootStage::Configuring { .. } => {
                if self.takes_part() || reduced {
                    self.configure(network, events);
                }
            }
            BootStage::ClosingSdo { was_current } => {
                if self.sdo.wants_to_transmit(network.now_ns) {
                } else if was_current && self.nmt_state == NmtState::Operational {
                    self.stage = BootStage::TakenOver;
                    self.polled = !reduced && !self.config.assignment.async_only;
                } else if was_current {
                    self.enable(network);
                } else {
                    self.order_reset_configuration(0);
                }
            }
            BootStage::ResettingConfiguration { .. } => {}
            BootStage::Reidentifying { deadline_ns, .. } => {
                self.check_time(deadline_ns, NmtState::PreOperational1, network, events)
            }
            BootStage::WaitingPreOperational2 { deadline_ns } => {
                if self.takes_part() && self.nmt_state == NmtState::PreOperational2 {
                    self.ask_ready(network.now_ns, deadline_ns);
                } else {
                    self.check_time(deadline_ns, NmtState::PreOperational2, network, events);
                }
            }
            BootStage::WaitingReadyToOperate { deadline_ns, again_ns } => {
                if self.nmt_state == NmtState::ReadyToOperate {
                    self.order = None;
                    let deadline_ns = network.now_ns + us_to_ns(network.boot.timeout_ready_to_operate_us);
                    self.stage = BootStage::CheckingCommunication { deadline_ns, good: 0 };
                } else if network.now_ns >= again_ns && network.now_ns < deadline_ns {
                    self.ask_ready(network.now_ns, deadline_ns);
                } else {
                    self.check_time(deadline_ns, NmtState::ReadyToOperate, network, events);
                }
            }
            BootStage::CheckingCommunication { deadline_ns, good } => {
                // Without polls there is no communication that could be checked.
                if good >= CHECK_CYCLES || self.config.assignment.async_only {
                    self.stage = BootStage::Ready;
                    self.set_state(NodeState::Ready, events);
                } else {
                    self.check_time(deadline_ns, NmtState::ReadyToOperate, network, events);
                }
            }
            BootStage::Ready => {
                if network.state == NmtState::Operational && network.starts_nodes {
                    self.command(NmtCommand::StartNode);
                    self.started(network);
                }
            }
            BootStage::WaitingOperational { deadline_ns, again_ns } => {
                if self.nmt_state == NmtState::Operational {
                    self.order = None;
                    self.stage = BootStage::Operational;
                    self.set_state(NodeState::Operational, events);
                } else if network.now_ns >= again_ns && network.now_ns < deadline_ns {
                    self.command(NmtCommand::StartNode);
                    self.stage = BootStage::WaitingOperational {
                        deadline_ns,
                        again_ns: network.now_ns + COMMAND_RETRY_NS,
                    };
                } else {
                    self.check_time(deadline_ns, NmtState::Operational, network, events);
                }
            }
            BootStage::Operational => {}
            BootStage::TakenOver => {
                if network.state == NmtState::Operational && self.nmt_state == NmtState::Operational {
                    self.stage = BootStage::Operational;
                    self.set_state(NodeState::Operational, events);
                }
            }
            BootStage::Stopped { again_ns } => {
                if self.nmt_state.is_isochronous() && network.now_ns >= again_ns {
                    self.stop(network.now_ns);
                }
            }
        }
    }

    /// What the managing node learns of it does not have to wait for a first poll.
    fn takes_part(&self) -> bool {
        self.polled || self.config.assignment.async_only
    }

    /// Bit 5 of its feature flags (0x1F82), as last reported.
    pub(super) fn understands_extended_commands(&self) -> bool {
        const EXTENDED_COMMANDS: u32 = 1 << 5;
        let flags = self.record.ident.map_or(0, |(_, ident)| ident.feature_flags);
        flags & EXTENDED_COMMANDS != 0
    }

    /// Orders ResetConfiguration, of which so many were sent.
    fn order_reset_configuration(&mut self, sent: u8) {
        self.command(NmtCommand::ResetConfiguration);
        self.stage = BootStage::ResettingConfiguration { sent };
    }

    /// Orders an NMT command.
    pub(super) fn command(&mut self, command: NmtCommand) {
        let reason = reset_reason::NONE;
        self.order = Some(Order { command, reason });
    }

    /// StartNode is on its way, to this node alone or to all.
    pub(super) fn started(&mut self, network: &Network) {
        self.stage = BootStage::WaitingOperational {
            deadline_ns: network.now_ns + us_to_ns(network.boot.timeout_ready_to_operate_us),
            again_ns: network.now_ns + command_retry_ns(network),
        };
    }

    /// Orders STOPPED; again after a while.
    fn stop(&mut self, now_ns: u64) {
        self.command(NmtCommand::StopNode);
        self.stopped(now_ns);
    }

    /// A stopped or reset node answers no polls, and leaves its chain, at the latest after a few cycles: it is set up again.
    pub(super) fn stop_polling(&mut self) {
        self.ident.open = false;
        self.polled = false;
        self.chain = Chain::NEW;
    }

    /// StopNode is on its way, to this node alone or to all.
    pub(super) fn stopped(&mut self, now_ns: u64) {
        self.stage = BootStage::Stopped {
            again_ns: now_ns + COMMAND_RETRY_NS,
        };
    }

    /// Orders READY_TO_OPERATE; again after a while, as an NMT command is never acknowledged.
    fn ask_ready(&mut self, now_ns: u64, deadline_ns: u64) {
        self.command(NmtCommand::EnableReadyToOperate);
        self.stage = BootStage::WaitingReadyToOperate {
            deadline_ns,
            again_ns: now_ns + COMMAND_RETRY_NS,
        };
    }

    fn check_time(&mut self, deadline_ns: u64, expected: NmtState, network: &Network, events: &mut Events) {
        if network.now_ns >= deadline_ns {
            let got = self.nmt_state;
            self.fail(network, Fault::BootTimeout { expected, got }, events);
        }
    }
}

fn command_retry_ns(network: &Network) -> u64 {
    COMMAND_RETRY_NS.max(COMMAND_RETRY_CYCLES * network.cycle_ns)
}
