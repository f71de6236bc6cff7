//! The network as a whole: when the managing node itself takes the next step of the boot-up, and what the loss of a mandatory
//! node does to all.
//!
//! In:  the stages of all nodes, the time, the application's leave. Out: the managing node's own NMT state, commands to all.
//! RT: no allocation, no locks, bounded by the number of nodes.

use super::config::us_to_ns;
use super::event::{MnEvent, NodeState};
use super::node::Node;
use super::stage::BootStage;
use super::state::{BROADCAST_REPEAT, Broadcast, Gate, Mn, PendingBroadcast, Reduced, Shutdown};
use crate::nmt::{MnTrigger, NmtCommand, NmtState};

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// The nodes' next steps, and what they mean for the network; once a slot.
    pub(super) fn step_network(&mut self, now_ns: u64) {
        if self.shutdown != Shutdown::No {
            return;
        }
        if core::mem::take(&mut self.start.entered_pre_op_1) {
            self.begin_pre_op_1(now_ns);
        }
        let network = self.network(now_ns);
        let mut dropped_out = false;
        self.being_configured = 0;
        for node in self.nodes.iter_mut() {
            node.step(&network, &mut self.events);
            self.being_configured += u32::from(node.is_being_configured());
            dropped_out |= core::mem::take(&mut node.dropped_out) && node.config.assignment.mandatory;
        }
        if dropped_out {
            self.mandatory_dropped_out();
        }
        let startup = self.config.startup;
        match self.state {
            NmtState::PreOperational1 if self.start.reduced == Reduced::Ident => {
                let stayed_ns = now_ns.saturating_sub(self.start.pre_op_1_since_ns);
                if self.mandatory(Node::is_identified) {
                    // A node that takes no configuration here gets it in PRE_OPERATIONAL_2.
                    let since_ns = *self.start.identified_since_ns.get_or_insert(now_ns);
                    let waited = now_ns.saturating_sub(since_ns) >= us_to_ns(self.config.boot.timeout_pre_op_1_us);
                    if stayed_ns >= us_to_ns(self.config.boot.wait_pre_op_1_us)
                        && (waited || self.mandatory(|node| !node.is_being_configured()))
                        && self.may_enter(startup.application_enters_pre_operational_2, NmtState::PreOperational2)
                    {
                        self.trigger(MnTrigger::MandatoryIdentified);
                        let network = self.network(now_ns);
                        for node in self.nodes.iter_mut() {
                            node.cycle_begins(&network);
                        }
                    }
                } else if stayed_ns >= us_to_ns(self.config.boot.timeout_pre_op_1_us) && !self.start.missing_reported {
                    self.start.missing_reported = true;
                    self.report_missing();
                }
            }
            // Every state on the way is shown by a SoA at least.
            NmtState::PreOperational2 | NmtState::ReadyToOperate if self.soa_showed != Some(self.state) => {}
            NmtState::PreOperational2 if self.mandatory(Node::is_ready_to_operate) => {
                if self.may_enter(startup.application_enters_ready_to_operate, NmtState::ReadyToOperate) {
                    self.trigger(MnTrigger::MandatoryConfigured);
                }
            }
            NmtState::ReadyToOperate if self.mandatory(Node::is_ready) => {
                if self.may_enter(startup.application_enters_operational, NmtState::Operational) {
                    self.trigger(MnTrigger::MandatoryReady);
                    if startup.broadcast_start {
                        self.order_broadcast(Broadcast::Start, 1);
                    }
                }
            }
            // All were stopped because of an error, and may come up again now.
            NmtState::Operational if self.gate.open => {
                self.gate = Gate::default();
                self.start_again();
            }
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

    /// Whether this holds for every mandatory node.
    fn mandatory(&self, is: impl Fn(&Node<'a>) -> bool) -> bool {
        let mut mandatory = self.nodes.iter().filter(|node| node.config.assignment.mandatory);
        mandatory.all(is)
    }

    fn report_missing(&mut self) {
        self.slot.next_stranger = Some(1);
        for node in self.nodes.iter() {
            // One that answers and is another device has been told as that.
            if node.config.assignment.mandatory && !node.is_identified() && !node.is_refused() {
                self.events.push(MnEvent::Missing { node: node.config.id });
            }
        }
    }

    /// Whether the next state may be entered: at once, or, where 0x1F80 leaves it to the application, when it lets it.
    fn may_enter(&mut self, gated: bool, next: NmtState) -> bool {
        if !gated || (self.gate.open && self.gate.next == Some(next)) {
            self.gate = Gate::default();
            return true;
        }
        self.wait_for_application(next);
        false
    }

    fn wait_for_application(&mut self, next: NmtState) {
        if self.gate.next != Some(next) {
            self.gate = Gate {
                next: Some(next),
                open: false,
            };
            self.events.push(MnEvent::WaitsForApplication { next });
        }
    }

    fn order_broadcast(&mut self, what: Broadcast, left: u8) {
        self.slot.broadcast = Some(PendingBroadcast { what, left });
    }

    /// A mandatory node that was ready has failed while the network was OPERATIONAL; it is reset and booted again in any case.
    fn mandatory_dropped_out(&mut self) {
        let startup = self.config.startup;
        if startup.reset_all_on_error {
            let command = NmtCommand::ResetNode;
            self.events.push(MnEvent::AllOnError { command });
            self.start_again();
        } else if startup.stop_all_on_error {
            let command = NmtCommand::StopNode;
            self.events.push(MnEvent::AllOnError { command });
            self.order_broadcast(Broadcast::Stop, BROADCAST_REPEAT);
            self.wait_for_application(self.state_after_error());
        } else if !startup.stay_operational {
            self.start.reduced = Reduced::Ident;
            self.trigger(MnTrigger::MandatoryLost);
        }
    }

    fn state_after_error(&self) -> NmtState {
        if self.config.startup.stay_operational {
            NmtState::Operational
        } else {
            NmtState::PreOperational1
        }
    }

    /// Resets all nodes and boots them again: in the running network, or from PRE_OPERATIONAL_1.
    fn start_again(&mut self) {
        if self.config.startup.stay_operational {
            self.order_broadcast(Broadcast::Reset, BROADCAST_REPEAT);
        } else {
            self.start.reduced = Reduced::Reset;
            self.trigger(MnTrigger::MandatoryLost);
        }
    }

    /// PRE_OPERATIONAL_1 begins: every node is looked for. Nodes that a lost mandatory node or an error of our own has left
    /// without SoC are asked what they are, and reset where they still run.
    fn begin_pre_op_1(&mut self, now_ns: u64) {
        self.start.begin_pre_op_1(now_ns);
        self.clock.started_ns = None;
        self.slot.broadcast = None;
        self.gate = Gate::default();
        self.forget_all(now_ns);
    }

    fn forget_all(&mut self, now_ns: u64) {
        let network = self.network(now_ns);
        for node in self.nodes.iter_mut() {
            node.forget(&network);
            node.dropped_out = false;
            // A ResetNode that is due says why; every other order is void.
            node.order = node.order.filter(|order| order.command == NmtCommand::ResetNode);
            if node.state != NodeState::Faulted {
                node.set_state(NodeState::Absent, &mut self.events);
            }
        }
    }

    /// A command to all is on the wire.
    pub(super) fn broadcast_sent(&mut self, now_ns: u64) {
        let Some(PendingBroadcast { what, left }) = self.slot.broadcast else {
            return;
        };
        self.slot.broadcast = (left > 1).then_some(PendingBroadcast {
            what,
            left: left.saturating_sub(1),
        });
        let network = self.network(now_ns);
        match what {
            Broadcast::Start => {
                for node in self.nodes.iter_mut().filter(|node| node.stage == BootStage::Ready) {
                    node.started(&network);
                }
            }
            Broadcast::Stop => {
                for node in self.nodes.iter_mut().filter(|node| node.is_configured()) {
                    node.stopped(now_ns);
                    node.order = None;
                    node.stop_polling();
                    node.set_state(NodeState::Stopped, &mut self.events);
                }
            }
            Broadcast::Reset => self.forget_all(now_ns),
        }
    }
}
