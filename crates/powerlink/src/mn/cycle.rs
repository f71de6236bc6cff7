//! The cycle: its phases one after the other, and the isochronous ones: SoC, chain, polls, our own PRes. The rest is in
//! `async_phase`.
//!
//! In:  the start of each cycle, the time. Out: frames in the order in which they may be on the wire.
//! RT: no allocation, no locks, bounded by the number of nodes.

use super::budget::wire_time_ns;
use super::config::us_to_ns;
use super::event::MnEvent;
use super::state::{Mn, Phase};
use crate::nmt::{MnTrigger, NmtState};
use crate::wire::{self, Header, NetTime, PAYLOAD_LIMIT_MIN, POLL_HEADER_LEN, Preq, Pres, Requests, multicast};

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
    /// Begins the cycle of the date `begin_ns`; `net_time` is the wall clock for the SoC. A cycle that has not ended is cut
    /// off and counted: what was not sent of it is not sent any more. Cycles left out since the last start are counted.
    ///
    /// May be called ahead of the date, once the cycle before has had its time: the SoC then lies ready and the next
    /// [`Mn::poll`] hands it out at once. Called again before that poll, it moves the very same cycle to a later date.
    pub fn start_cycle(&mut self, begin_ns: u64, net_time: NetTime) {
        self.done_due = true;
        self.counters.events_dropped = self.events.dropped;
        // Also where no cycle runs (any more): what came in an earlier one is old.
        for node in self.nodes.iter_mut() {
            node.data.fresh = false;
        }
        if !self.state.is_isochronous() {
            return;
        }
        let moved = matches!(self.phase, Phase::SocDue { .. });
        if !moved {
            self.cut_off(begin_ns);
            if !self.state.is_isochronous() {
                // The threshold of exceeded cycles was reached.
                return;
            }
        }
        let cycle_ns = u64::from(self.config.cycle_ns);
        self.counters.cycles_skipped += self.clock.go_to(begin_ns, net_time, cycle_ns, moved);
        if !moved {
            for node in self.nodes.iter_mut() {
                node.chain.heard = false;
            }
            self.exceeded = false;
            self.clock.begin_round(self.config.multiplex_cycles);
            self.clock
                .toggle_prescaled_slot(self.counters.cycles, self.config.prescaler);
        }
        let len = self.write_soc().unwrap_or(0);
        self.phase = Phase::SocDue { len };
    }

    /// Gives up the cycle that [`Mn::start_cycle`] has made ready, if its SoC has not been handed out yet: nothing of it is
    /// sent.
    pub fn abandon_cycle(&mut self) {
        if let Phase::SocDue { .. } = self.phase {
            self.phase = Phase::Idle;
        }
    }

    /// Ends what is still open of the last cycle.
    fn cut_off(&mut self, now_ns: u64) {
        match self.phase {
            Phase::Idle | Phase::AsndSent => {}
            Phase::AwaitAsnd { grant, .. } => self.slot_over(now_ns, grant),
            Phase::PreqSent { index } | Phase::AwaitPres { index, .. } => {
                self.cut_off_before_soa();
                self.poll_lost(now_ns, index);
            }
            Phase::ChainSent | Phase::AwaitChain { .. } => {
                self.cut_off_before_soa();
                self.chain_over(now_ns);
            }
            Phase::SocSent
            | Phase::AfterSoc { .. }
            | Phase::ChainDue
            | Phase::NextPreq { .. }
            | Phase::PresMnDue
            | Phase::SoaDue => self.cut_off_before_soa(),
            Phase::SocDue { .. } | Phase::SoaSent { .. } => self.cycle_exceeded(),
        }
        self.phase = Phase::Idle;
    }

    /// No SoC follows a SoC: the nodes wait for the SoA between.
    fn cut_off_before_soa(&mut self) {
        self.soa_owed = true;
        self.cycle_exceeded();
    }

    /// The node at this position is polled in this cycle.
    fn is_polled_now(&self, index: usize) -> bool {
        self.nodes.get(index).is_some_and(|node| {
            let cycle = node.config.multiplex_cycle;
            node.polled && !node.config.assignment.chained && (cycle == 0 || cycle == self.clock.multiplex_cycle)
        })
    }

    /// A cycle was not over when the next one began (E_DLL_CYCLE_EXCEED). It is counted and the network goes on, unless the
    /// configuration gives a threshold.
    pub(super) fn cycle_exceeded(&mut self) {
        if core::mem::replace(&mut self.exceeded, true) {
            return;
        }
        self.counters.cycles_overrun += 1;
        if self.counters.cycle_exceeded.count_error(self.config.cycle_threshold) {
            self.events.push(MnEvent::CycleThreshold);
            self.trigger(MnTrigger::CycleError);
        }
    }

    /// What to do now. To be called again after each step but [`Step::Idle`].
    pub fn poll(&mut self, now_ns: u64) -> Step<'_> {
        match self.advance(now_ns) {
            Action::Send(Buffer::Cycle, len) => Step::Send(&self.cycle_frame[..len]),
            Action::Send(Buffer::Asnd, len) => Step::Send(&self.slot.frame[..len]),
            Action::WaitUntil(time_ns) => Step::WaitUntil(time_ns),
            Action::IsochronousDone => Step::IsochronousDone,
            Action::Idle => Step::Idle,
        }
    }

    /// Goes from phase to phase until there is something to do. Each turn of the loop leaves one phase; a poll walks over all
    /// nodes at most once.
    fn advance(&mut self, now_ns: u64) -> Action {
        loop {
            let action = match self.phase {
                Phase::Idle => self.between_cycles(now_ns),
                Phase::SocDue { len } => self.soc_due(len),
                Phase::SocSent => self.soc_sent(now_ns),
                Phase::AfterSoc { until_ns } => self.after_soc(now_ns, until_ns),
                Phase::ChainDue => self.chain_due(),
                Phase::ChainSent => self.chain_sent(now_ns),
                Phase::AwaitChain { deadline_ns, .. } => self.await_chain(now_ns, deadline_ns),
                Phase::NextPreq { index } => self.next_preq(now_ns, index),
                Phase::PreqSent { index } => self.preq_sent(now_ns, index),
                Phase::AwaitPres { index, deadline_ns, .. } => self.await_pres(now_ns, index, deadline_ns),
                Phase::PresMnDue => self.pres_mn_due(),
                Phase::SoaDue => self.soa_due(now_ns),
                Phase::SoaSent { grant } => self.soa_sent(now_ns, grant),
                Phase::AsndSent => self.asnd_sent(now_ns),
                Phase::AwaitAsnd {
                    grant,
                    deadline_ns,
                    looked,
                } => self.await_asnd(now_ns, grant, deadline_ns, looked),
            };
            if let Some(action) = action {
                return action;
            }
        }
    }

    fn soc_due(&mut self, len: usize) -> Option<Action> {
        if !self.state.is_isochronous() {
            // The network has started again since the cycle was made ready.
            self.soa_owed = false;
            self.phase = Phase::Idle;
            return None;
        }
        if core::mem::take(&mut self.soa_owed) {
            return self.write_owed_soa().map(|len| Action::Send(Buffer::Asnd, len));
        }
        self.phase = Phase::SocSent;
        self.counters.cycles += 1;
        (len > 0).then_some(Action::Send(Buffer::Cycle, len))
    }

    fn soc_sent(&mut self, now_ns: u64) -> Option<Action> {
        let wait_ns = u64::from(self.config.soc_preq_wait_ns);
        self.phase = if wait_ns == 0 {
            self.first_phase()
        } else {
            let until_ns = now_ns + wait_ns;
            Phase::AfterSoc { until_ns }
        };
        None
    }

    fn after_soc(&mut self, now_ns: u64, until_ns: u64) -> Option<Action> {
        if now_ns < until_ns {
            return Some(Action::WaitUntil(until_ns));
        }
        self.phase = self.first_phase();
        None
    }

    fn chain_due(&mut self) -> Option<Action> {
        self.phase = Phase::ChainSent;
        self.write_pres_mn().map(|len| Action::Send(Buffer::Cycle, len))
    }

    fn chain_sent(&mut self, now_ns: u64) -> Option<Action> {
        self.phase = match self.chain_deadline_ns(now_ns) {
            Some(deadline_ns) => Phase::AwaitChain {
                sent_ns: now_ns,
                deadline_ns,
            },
            None => Phase::NextPreq { index: 0 },
        };
        None
    }

    fn await_chain(&mut self, now_ns: u64, deadline_ns: u64) -> Option<Action> {
        if now_ns < deadline_ns && self.first_unheard().is_some() {
            return Some(Action::WaitUntil(deadline_ns));
        }
        self.chain_over(now_ns);
        self.phase = Phase::NextPreq { index: 0 };
        None
    }

    /// Polls the next node of this cycle, from this position on.
    fn next_preq(&mut self, now_ns: u64, from: usize) -> Option<Action> {
        let Some(index) = (from..self.config.nodes.len()).find(|at| self.is_polled_now(*at)) else {
            self.phase = Phase::PresMnDue;
            return None;
        };
        let poll_ns = self.nodes.get(index).map_or(0, |node| {
            let payload = usize::from(node.config.preq_bytes).max(PAYLOAD_LIMIT_MIN);
            wire_time_ns(POLL_HEADER_LEN + payload) + u64::from(node.config.pres_timeout_ns)
        });
        if !self.fits(now_ns, poll_ns) {
            // The caller came late: a poll now would meet the next SoC on the wire.
            self.cycle_exceeded();
            self.phase = Phase::SoaDue;
            return None;
        }
        self.phase = Phase::PreqSent { index };
        self.write_preq(index).map(|len| Action::Send(Buffer::Cycle, len))
    }

    fn preq_sent(&mut self, now_ns: u64, index: usize) -> Option<Action> {
        let node = self.nodes.get(index);
        let timeout_ns = node.map_or(0, |node| u64::from(node.config.pres_timeout_ns));
        self.phase = Phase::AwaitPres {
            index,
            sent_ns: now_ns,
            deadline_ns: now_ns + timeout_ns,
        };
        None
    }

    fn await_pres(&mut self, now_ns: u64, index: usize, deadline_ns: u64) -> Option<Action> {
        if now_ns < deadline_ns {
            return Some(Action::WaitUntil(deadline_ns));
        }
        self.poll_lost(now_ns, index);
        self.phase = Phase::NextPreq { index: index + 1 };
        None
    }

    fn pres_mn_due(&mut self) -> Option<Action> {
        self.phase = Phase::SoaDue;
        if self.chain_room_ns.is_some() {
            // With a chain it went out before the polls.
            return None;
        }
        self.write_pres_mn().map(|len| Action::Send(Buffer::Cycle, len))
    }

    /// What takes `length_ns` from now on is over before the next cycle is due.
    pub(super) fn fits(&self, now_ns: u64, length_ns: u64) -> bool {
        self.clock.fits(now_ns, length_ns, self.config.cycle_ns.into())
    }

    /// What follows the SoC.
    fn first_phase(&self) -> Phase {
        if self.chain_room_ns.is_some() {
            Phase::ChainDue
        } else {
            Phase::NextPreq { index: 0 }
        }
    }

    /// In [`Phase::Idle`]: nothing to do before the next cycle, or the SoA of the reduced cycle is due.
    fn between_cycles(&mut self, now_ns: u64) -> Option<Action> {
        if let Some(action) = self.isochronous_done() {
            return Some(action);
        }
        match self.state {
            NmtState::NotActive => {
                let wait_ns = us_to_ns(self.config.boot.wait_not_active_us);
                let until_ns = *self.start.listen_until_ns.get_or_insert(now_ns + wait_ns);
                if now_ns < until_ns {
                    return Some(Action::WaitUntil(until_ns));
                }
                if self.config.startup.basic_ethernet {
                    self.trigger(MnTrigger::ListenOverBasicEthernet);
                    return Some(Action::Idle);
                }
                self.trigger(MnTrigger::ListenOver);
                self.start.pre_op_1_since_ns = now_ns;
                for node in self.nodes.iter_mut() {
                    node.record.searched_since_ns = now_ns;
                }
            }
            NmtState::PreOperational1 => {
                self.step_network(now_ns);
                if self.state != NmtState::PreOperational1 {
                    // PRE_OPERATIONAL_2 begins with the next cycle's SoC.
                    return Some(Action::Idle);
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
            | NmtState::Unknown(_) => return Some(Action::Idle),
        }
        self.phase = Phase::SoaDue;
        None
    }

    pub(super) fn isochronous_done(&mut self) -> Option<Action> {
        self.done_due.then(|| {
            self.done_due = false;
            Action::IsochronousDone
        })
    }

    fn write_soc(&mut self) -> Option<usize> {
        self.clock
            .soc()
            .emit(
                &Header::multicast(multicast::SOC, self.config.mac, wire::node::MN),
                &mut self.cycle_frame,
            )
            .ok()
    }

    fn write_preq(&mut self, index: usize) -> Option<usize> {
        let node = self.nodes.get_mut(index)?;
        node.statistics.preq_sent += 1;
        let header = Header {
            destination: node.mac,
            source: self.config.mac,
            destination_node: node.config.id,
            source_node: wire::node::MN,
        };
        let node_takes_data = matches!(node.nmt_state, NmtState::ReadyToOperate | NmtState::Operational);
        let valid = self.outputs_valid && self.state == NmtState::Operational;
        let preq = Preq {
            multiplexed: node.config.multiplex_cycle != 0,
            exception_acknowledge: node.signalling.exception_acknowledge(),
            ready: valid && node_takes_data,
            pdo_version: node.config.preq_version,
            payload: node.output(),
        };
        let limit = usize::from(node.config.preq_bytes).max(PAYLOAD_LIMIT_MIN);
        preq.emit(&header, limit, &mut self.cycle_frame).ok()
    }

    /// The managing node's own process data for all; `None`: it sends none.
    fn write_pres_mn(&mut self) -> Option<usize> {
        let octets = usize::from(self.config.pres_mn_bytes?);
        let pres = Pres {
            nmt_state: self.state,
            multiplexed: false,
            exception_new: false,
            ready: self.outputs_valid && self.state == NmtState::Operational,
            requests: Requests::default(),
            pdo_version: self.config.pres_mn_version,
            payload: &self.pres_mn[..octets],
        };
        let header = Header::multicast(multicast::PRES, self.config.mac, wire::node::MN);
        pres.emit(&header, octets.max(PAYLOAD_LIMIT_MIN), &mut self.cycle_frame)
            .ok()
    }
}
