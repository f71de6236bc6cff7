//! The cycle: SoC, the polls, SoA and the asynchronous slot, one step at a time; and the reduced cycle before.
//!
//! In:  the start of each cycle, the time. Out: frames in the order in which they may be on the wire.
//! RT: no allocation, no locks, bounded by the number of nodes.

use super::budget::wire_time_ns;
use super::config::us_to_ns;
use super::event::MnEvent;
use super::state::{Grant, Mn, Phase};
use crate::nmt::{MnTrigger, NmtState};
use crate::wire::{
    self, Header, NetTime, PAYLOAD_LIMIT_MIN, POLL_HEADER_LEN, Preq, Pres, RequestedService, Requests, SOA_LEN, Soa,
    Soc, multicast,
};

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
        for node in self.nodes.iter_mut().flatten() {
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
        let mut passed = 1;
        if let Some(last_ns) = self.cycle_started_ns {
            passed = (begin_ns.saturating_sub(last_ns) + cycle_ns / 2) / cycle_ns;
            let skipped = if moved { passed } else { passed.saturating_sub(1) };
            self.counters.cycles_skipped += skipped;
        }
        // The time base goes on along the grid, also over cycles that were left out.
        self.relative_time_us += if moved { passed } else { passed.max(1) } * (cycle_ns / 1000);
        self.cycle_started_ns = Some(begin_ns);
        self.net_time = net_time;
        if !moved {
            for node in self.nodes.iter_mut().flatten() {
                node.chain.heard = false;
            }
            self.exceeded = false;
            self.begin_round();
            self.toggle_prescaled_slot();
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

    /// The next cycle of the multiplexed round.
    fn begin_round(&mut self) {
        if self.config.multiplex_cycles == 0 {
            return;
        }
        if self.multiplex_cycle >= self.config.multiplex_cycles {
            self.multiplex_cycle = 1;
            self.round_toggle = !self.round_toggle;
        } else {
            self.multiplex_cycle += 1;
        }
    }

    /// The node at this position is polled in this cycle.
    fn is_polled_now(&self, index: usize) -> bool {
        self.node(index).is_some_and(|node| {
            let cycle = node.config.multiplex_cycle;
            node.polled && !node.config.assignment.chained && (cycle == 0 || cycle == self.multiplex_cycle)
        })
    }

    /// A cycle was not over when the next one began (E_DLL_CYCLE_EXCEED). It is counted and the network goes on, unless the
    /// configuration gives a threshold.
    fn cycle_exceeded(&mut self) {
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
                // The network has started again since the cycle was made ready.
                Phase::SocDue { .. } if !self.state.is_isochronous() => {
                    self.soa_owed = false;
                    self.phase = Phase::Idle;
                }
                Phase::SocDue { .. } if self.soa_owed => {
                    self.soa_owed = false;
                    if let Some(len) = self.write_owed_soa() {
                        return Action::Send(Buffer::Asnd, len);
                    }
                }
                Phase::SocDue { len } => {
                    self.phase = Phase::SocSent;
                    self.counters.cycles += 1;
                    if len > 0 {
                        return Action::Send(Buffer::Cycle, len);
                    }
                }
                Phase::SocSent => {
                    let wait_ns = u64::from(self.config.soc_preq_wait_ns);
                    self.phase = if wait_ns == 0 {
                        self.first_phase()
                    } else {
                        let until_ns = now_ns + wait_ns;
                        Phase::AfterSoc { until_ns }
                    };
                }
                Phase::AfterSoc { until_ns } => {
                    if now_ns < until_ns {
                        return Action::WaitUntil(until_ns);
                    }
                    self.phase = self.first_phase();
                }
                Phase::ChainDue => {
                    self.phase = Phase::ChainSent;
                    if let Some(len) = self.write_pres_mn() {
                        return Action::Send(Buffer::Cycle, len);
                    }
                }
                Phase::ChainSent => {
                    self.phase = match self.chain_deadline_ns(now_ns) {
                        Some(deadline_ns) => Phase::AwaitChain {
                            sent_ns: now_ns,
                            deadline_ns,
                        },
                        None => Phase::NextPreq { index: 0 },
                    };
                }
                Phase::AwaitChain { deadline_ns, .. } => {
                    if now_ns < deadline_ns && self.first_unheard().is_some() {
                        return Action::WaitUntil(deadline_ns);
                    }
                    self.chain_over(now_ns);
                    self.phase = Phase::NextPreq { index: 0 };
                }
                Phase::NextPreq { index } => {
                    let Some(index) = (index..self.config.nodes.len()).find(|at| self.is_polled_now(*at)) else {
                        self.phase = Phase::PresMnDue;
                        continue;
                    };
                    let poll_ns = self.node(index).map_or(0, |node| {
                        let payload = usize::from(node.config.preq_bytes).max(PAYLOAD_LIMIT_MIN);
                        wire_time_ns(POLL_HEADER_LEN + payload) + u64::from(node.config.pres_timeout_ns)
                    });
                    if !self.fits(now_ns, poll_ns) {
                        // The caller came late: a poll now would meet the next SoC on the wire.
                        self.cycle_exceeded();
                        self.phase = Phase::SoaDue;
                        continue;
                    }
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
                Phase::PresMnDue => {
                    self.phase = Phase::SoaDue;
                    // With a chain it went out before the polls.
                    if !self.has_chain
                        && let Some(len) = self.write_pres_mn()
                    {
                        return Action::Send(Buffer::Cycle, len);
                    }
                }
                Phase::SoaDue => {
                    if self.state.is_isochronous() && !self.fits(now_ns, wire_time_ns(SOA_LEN)) {
                        // Late, but never left out.
                        self.cycle_exceeded();
                        if !self.state.is_isochronous() {
                            self.phase = Phase::Idle;
                            continue;
                        }
                    }
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
                    Grant::NoService if self.state.is_isochronous() => self.phase = Phase::Idle,
                    Grant::NoService | Grant::Node { .. } | Grant::Diagnostic { .. } | Grant::Stranger { .. } => {
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
                            grant: Grant::NoService,
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
                    if let Some(action) = self.isochronous_done() {
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

    /// What takes `length_ns` from now on is over before the next cycle is due.
    fn fits(&self, now_ns: u64, length_ns: u64) -> bool {
        let cycle_ns = u64::from(self.config.cycle_ns);
        self.cycle_started_ns
            .is_none_or(|started_ns| now_ns.saturating_add(length_ns) <= started_ns.saturating_add(cycle_ns))
    }

    /// What follows the SoC.
    fn first_phase(&self) -> Phase {
        if self.has_chain {
            Phase::ChainDue
        } else {
            Phase::NextPreq { index: 0 }
        }
    }

    /// In [`Phase::Idle`]: an action, or `None` where a SoA of the reduced cycle is due.
    fn between_cycles(&mut self, now_ns: u64) -> Option<Action> {
        if let Some(action) = self.isochronous_done() {
            return Some(action);
        }
        match self.state {
            NmtState::NotActive => {
                let wait_ns = us_to_ns(self.config.boot.wait_not_active_us);
                let until_ns = *self.listen_until_ns.get_or_insert(now_ns + wait_ns);
                if now_ns < until_ns {
                    return Some(Action::WaitUntil(until_ns));
                }
                if self.config.startup.basic_ethernet {
                    self.trigger(MnTrigger::ListenOverBasicEthernet);
                    return Some(Action::Idle);
                }
                self.trigger(MnTrigger::ListenOver);
                self.pre_op_1_since_ns = now_ns;
                for node in self.nodes.iter_mut().flatten() {
                    node.record.searched_since_ns = now_ns;
                }
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

    fn isochronous_done(&mut self) -> Option<Action> {
        self.done_due.then(|| {
            self.done_due = false;
            Action::IsochronousDone
        })
    }

    /// The PS flag of the SoC toggles every so many cycles.
    fn toggle_prescaled_slot(&mut self) {
        let prescaler = u64::from(self.config.prescaler);
        // A multiple of 0 is only 0 itself: without a prescaler the flag stays as it is after the first cycle.
        if self.counters.cycles.is_multiple_of(prescaler) {
            self.prescaled_slot = !self.prescaled_slot;
        }
    }

    fn write_soc(&mut self) -> Option<usize> {
        let soc = Soc {
            multiplexed_cycle: self.round_toggle,
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

    /// Decides who gets the slot and writes the SoA that says so.
    fn write_soa(&mut self, now_ns: u64) -> (Grant, Option<usize>) {
        if self.state.is_isochronous() {
            self.step_network(now_ns);
            self.step_chain(now_ns);
        }
        let slot_ns = u64::from(self.config.async_slot_timeout_ns);
        let (grant, soa) = if self.state.is_isochronous() && !self.fits(now_ns, slot_ns) {
            (Grant::NoService, Soa::new(self.state, RequestedService::NoService, 0))
        } else {
            self.grant(now_ns)
        };
        self.counters.soa_sent += 1;
        self.soa_showed = Some(self.state);
        if !self.exceeded {
            self.counters.cycle_exceeded.count_good();
        }
        self.counters.crc_errors.count_good();
        let header = Header::multicast(multicast::SOA, self.config.mac, wire::node::MN);
        (grant, soa.emit(&header, &mut self.cycle_frame).ok())
    }

    /// The SoA of a cycle that was cut off; it grants no slot. The SoC lies ready in the buffer of the cycle.
    fn write_owed_soa(&mut self) -> Option<usize> {
        self.counters.soa_sent += 1;
        self.soa_showed = Some(self.state);
        let header = Header::multicast(multicast::SOA, self.config.mac, wire::node::MN);
        let soa = Soa::new(self.state, RequestedService::NoService, 0);
        soa.emit(&header, &mut self.asnd_frame).ok()
    }
}
