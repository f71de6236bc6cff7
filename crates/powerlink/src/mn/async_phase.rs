//! The asynchronous phase, which ends every cycle and is all there is of a reduced one: the SoA, then the slot that it grants.
//!
//! In:  whom `async_scheduler` chooses, the time. Out: the SoA, our own ASnd, the wait for that of another node.
//! RT: no allocation, no locks, bounded by the number of nodes.

use super::budget::wire_time_ns;
use super::cycle::{Action, Buffer};
use super::state::{Grant, Mn, Phase};
use crate::wire::{self, Header, RequestedService, SOA_LEN, Soa, multicast};

impl<const NODES: usize> Mn<'_, NODES> {
    pub(super) fn soa_due(&mut self, now_ns: u64) -> Option<Action> {
        if self.state.is_isochronous() && !self.fits(now_ns, wire_time_ns(SOA_LEN)) {
            // Late, but never left out.
            self.cycle_exceeded();
            if !self.state.is_isochronous() {
                self.phase = Phase::Idle;
                return None;
            }
        }
        let (grant, len) = self.write_soa(now_ns);
        self.phase = Phase::SoaSent { grant };
        len.map(|len| Action::Send(Buffer::Cycle, len))
    }

    pub(super) fn soa_sent(&mut self, now_ns: u64, grant: Grant) -> Option<Action> {
        match grant {
            Grant::Own(own) => {
                self.phase = Phase::AsndSent;
                self.own_sent(now_ns, own);
                self.counters.asnd_sent += 1;
                return Some(Action::Send(Buffer::Asnd, self.slot.len));
            }
            Grant::NoService if self.state.is_isochronous() => self.phase = Phase::Idle,
            Grant::NoService | Grant::Node { .. } | Grant::Diagnostic { .. } | Grant::Stranger { .. } => {
                self.phase = self.slot_of(now_ns, grant);
            }
        }
        None
    }

    pub(super) fn asnd_sent(&mut self, now_ns: u64) -> Option<Action> {
        self.phase = if self.state.is_isochronous() {
            Phase::Idle
        } else {
            // The slot is ours to its end: no second ASnd may meet this one.
            self.slot_of(now_ns, Grant::NoService)
        };
        None
    }

    fn slot_of(&self, now_ns: u64, grant: Grant) -> Phase {
        Phase::AwaitAsnd {
            grant,
            deadline_ns: now_ns + u64::from(self.config.async_slot_timeout_ns),
            looked: false,
        }
    }

    pub(super) fn await_asnd(&mut self, now_ns: u64, grant: Grant, deadline_ns: u64, looked: bool) -> Option<Action> {
        if let Some(action) = self.isochronous_done() {
            return Some(action);
        }
        // The caller may have computed since the SoA: it looks at the wire before the slot counts as unused.
        if now_ns < deadline_ns || !looked {
            self.phase = Phase::AwaitAsnd {
                grant,
                deadline_ns,
                looked: now_ns >= deadline_ns,
            };
            return Some(Action::WaitUntil(deadline_ns));
        }
        self.slot_over(now_ns, grant);
        self.phase = Phase::Idle;
        None
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
    pub(super) fn write_owed_soa(&mut self) -> Option<usize> {
        self.counters.soa_sent += 1;
        self.soa_showed = Some(self.state);
        let header = Header::multicast(multicast::SOA, self.config.mac, wire::node::MN);
        let soa = Soa::new(self.state, RequestedService::NoService, 0);
        soa.emit(&header, &mut self.slot.frame).ok()
    }
}
