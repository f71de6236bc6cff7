//! The cycle: SoC, the polls, SoA and the asynchronous slot, one step at a time; and the reduced cycle before.
//!
//! In:  the start of each cycle, the time. Out: frames in the order in which they may be on the wire.
//! RT: no allocation, no locks, bounded by the number of nodes.

use super::node::us;
use super::slot::Grant;
use super::{Mn, Step};
use crate::nmt::{MnTrigger, NmtState};
use crate::wire::{self, Header, NetTime, PAYLOAD_LIMIT_MIN, Preq, Soc, multicast};

/// The PS flag of the SoC toggles every so many cycles (object 0x1F98/9, its default).
const PRESCALER: u64 = 2;

/// Where the cycle stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
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

/// Which buffer a frame to be sent lies in.
#[derive(Clone, Copy, Debug)]
pub(super) enum Buffer {
    Cycle,
    Asnd,
}

/// [`Step`] without the borrow.
#[derive(Clone, Copy, Debug)]
pub(super) enum Action {
    Send(Buffer, usize),
    WaitUntil(u64),
    IsochronousDone,
    Idle,
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
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

    pub(super) fn advance(&mut self, now_ns: u64) -> Action {
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
