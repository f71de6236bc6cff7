//! The watch over the managing node: SoC, SoA and PReq that stay away, and what the driver tells of the wire.
//!
//! In:  arrivals and the time; CRC errors and collisions from the driver.
//! Out: the counters 0x1C0A..0x1C0F (an error adds 8, a good cycle takes 1 away), and at a threshold the step back to
//!      PRE_OPERATIONAL_1 with an error code.

use super::controlled_node::Cn;
use super::error::PROFILE_COMMUNICATION;
use super::event::Events;
use super::keys::CounterKeys;
use super::watch::CycleError;
use crate::nmt::{CnEvent, NmtState};

/// Bits of the error register 0x1001 that a cycle error sets: generic and communication.
const REGISTER_COMMUNICATION: u8 = 0x11;
/// Missed cycles that one look at the clock counts at most; bounds the work after a long pause.
pub(super) const MISSED_PER_CHECK_MAX: u32 = 32;

impl<const E: usize, const B: usize> Cn<E, B> {
    /// The driver saw a frame with a wrong CRC (object 0x1C0F).
    pub fn report_crc_error(&mut self, now_ns: u64) -> Events {
        let mut events = Events::default();
        self.watch.crc_failed = true;
        let counter = self.keys.losses.crc;
        self.fail(counter, CycleError::Crc, now_ns, &mut events);
        events
    }

    /// The driver saw a collision (object 0x1C0A).
    pub fn report_collision(&mut self, now_ns: u64) -> Events {
        let mut events = Events::default();
        self.watch.collided = true;
        let counter = self.keys.losses.collision;
        self.fail(counter, CycleError::Collision, now_ns, &mut events);
        events
    }

    /// A SoC came in a state that expects it: the last cycle is judged, the next one begins.
    pub(super) fn begin_cycle(&mut self, now_ns: u64, events: &mut Events) {
        self.keys.losses.soc.good(&mut self.dictionary);
        for (failed, counter) in [
            (core::mem::take(&mut self.watch.crc_failed), self.keys.losses.crc),
            (core::mem::take(&mut self.watch.collided), self.keys.losses.collision),
        ] {
            if !failed {
                counter.good(&mut self.dictionary);
            }
        }
        self.watch_soc(now_ns);
        self.end_cycle(now_ns, events);
        let exchanges = matches!(self.state, NmtState::ReadyToOperate | NmtState::Operational);
        if self.watch.misses_preq() && exchanges && !self.chaining.is_enabled() {
            let counter = self.keys.losses.preq;
            self.fail(counter, CycleError::LossOfPreq, now_ns, events);
        }
        self.watch.soa_due = self.expects_soc();
    }

    pub(super) fn take_soa(&mut self) {
        if core::mem::take(&mut self.watch.soa_due) {
            self.keys.losses.soa.good(&mut self.dictionary);
        }
    }

    pub(super) fn take_preq(&mut self, multiplexed: bool) {
        self.watch.take_preq(multiplexed);
        self.keys.losses.preq.good(&mut self.dictionary);
    }

    /// Counts the SoCs that are overdue.
    pub(super) fn count_overdue_socs(&mut self, now_ns: u64, events: &mut Events) {
        for look in 0..=MISSED_PER_CHECK_MAX {
            let Some(due_ns) = self.watch.soc_due_ns.filter(|due_ns| now_ns >= *due_ns) else {
                return;
            };
            if look == MISSED_PER_CHECK_MAX {
                self.watch.soc_due_ns = Some(now_ns.saturating_add(self.watch.cycle_ns));
                return;
            }
            self.watch.soc_due_ns = Some(due_ns.saturating_add(self.watch.cycle_ns));
            events.soc_missed += 1;
            let counter = self.keys.losses.soc;
            self.fail(counter, CycleError::LossOfSoc, now_ns, events);
            self.end_cycle(now_ns, events);
        }
    }

    /// The cycle is over, with or without its SoA.
    fn end_cycle(&mut self, now_ns: u64, events: &mut Events) {
        if core::mem::take(&mut self.watch.soa_due) {
            let counter = self.keys.losses.soa;
            self.fail(counter, CycleError::LossOfSoa, now_ns, events);
        }
    }

    fn watch_soc(&mut self, now_ns: u64) {
        let tolerance_ns = u64::from(self.dictionary.get(self.keys.losses.soc_tolerance_ns));
        let cycle_ns = self.watch.cycle_ns;
        self.watch.soc_due_ns = (cycle_ns > 0).then(|| now_ns.saturating_add(cycle_ns).saturating_add(tolerance_ns));
    }

    /// Counts an error. At the threshold it is reported, and the node waits in PRE_OPERATIONAL_1 for the managing node;
    /// states without a cycle only count.
    fn fail(&mut self, counter: CounterKeys, error: CycleError, now_ns: u64, events: &mut Events) {
        if !counter.error(&mut self.dictionary) || !self.expects_soc() {
            return;
        }
        let register = self.dictionary.get(self.keys.error_register) | REGISTER_COMMUNICATION;
        self.set_error_register(register);
        self.report_error(PROFILE_COMMUNICATION, error.code(), [0; 8]);
        events.cycle_error = events.cycle_error.or(Some(error));
        self.event(CnEvent::CycleError, now_ns, events);
    }

    /// The managing node has taken the node up again.
    pub(super) fn clear_cycle_errors(&mut self) {
        let register = self.dictionary.get(self.keys.error_register) & !REGISTER_COMMUNICATION;
        self.set_error_register(register);
    }
}
