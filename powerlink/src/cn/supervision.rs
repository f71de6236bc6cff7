//! The watch over the managing node: SoC, SoA and PReq that stay away, and what the driver tells of the wire.
//!
//! In:  arrivals and the time; CRC errors and collisions from the driver.
//! Out: the counters 0x1C0A..0x1C0F (an error adds 8, a good cycle takes 1 away), and at a threshold the step back to
//!      PRE_OPERATIONAL_1 with an error code.

use super::error::{PROFILE_COMMUNICATION, code};
use super::keys::CounterKeys;
use super::{Cn, Events};
use crate::nmt::{CnEvent, NmtState};
use crate::wire::{Soa, Soc};

/// Bits of the error register 0x1001 that a cycle error sets: generic and communication.
const REGISTER_COMMUNICATION: u8 = 0x11;
/// Missed cycles that one look at the clock counts at most; bounds the work after a long pause.
pub(super) const MISSED_PER_CHECK_MAX: u32 = 32;

/// What reached the threshold of its counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CycleError {
    /// SoCs stayed away, threshold 0x1C0B/3.
    LossOfSoc,
    /// SoAs stayed away, threshold 0x1C0C/3.
    LossOfSoa,
    /// PReqs stayed away, threshold 0x1C0D/3.
    LossOfPreq,
    /// Collisions on the wire, threshold 0x1C0A/3.
    Collision,
    /// Frames with a wrong CRC, threshold 0x1C0F/3.
    Crc,
}

impl CycleError {
    /// The code in the error entry.
    pub fn code(self) -> u16 {
        match self {
            CycleError::LossOfSoc => code::LOSS_SOC_THRESHOLD,
            CycleError::LossOfSoa => code::LOSS_SOA_THRESHOLD,
            CycleError::LossOfPreq => code::LOSS_PREQ_THRESHOLD,
            CycleError::Collision => code::COLLISION_THRESHOLD,
            CycleError::Crc => code::CRC_THRESHOLD,
        }
    }
}

/// How the managing node polls this node, learnt from its PReqs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Polling {
    /// Not yet.
    Never,
    EveryCycle,
    /// The last PReq was for a multiplexed slot, that many cycles ago.
    Multiplexed {
        cycles_ago: u8,
    },
}

/// What is expected of the managing node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watch {
    /// 0x1006 when the configuration was activated; 0 switches the watch over the SoC off.
    cycle_ns: u64,
    /// 0x1F98/7 when the configuration was activated.
    multiplexed_cycles: u8,
    /// When the next SoC is overdue.
    soc_due_ns: Option<u64>,
    /// A SoC came and its SoA has not.
    soa_due: bool,
    /// A PReq came since the last SoC.
    polled: bool,
    polling: Polling,
    /// A frame with a wrong CRC came since the last SoC.
    crc_failed: bool,
    /// A frame collided since the last SoC.
    collided: bool,
    /// The last SoC and SoA and when they came: the wire may double a frame.
    last_soc: Option<(u64, Soc)>,
    last_soa: Option<(u64, Soa)>,
}

impl Watch {
    pub(super) const NONE: Watch = Watch {
        cycle_ns: 0,
        multiplexed_cycles: 0,
        soc_due_ns: None,
        soa_due: false,
        polled: false,
        polling: Polling::Never,
        crc_failed: false,
        collided: false,
        last_soc: None,
        last_soa: None,
    };

    pub(super) fn configure(&mut self, cycle_us: u32, multiplexed_cycles: u8) {
        self.cycle_ns = u64::from(cycle_us) * 1000;
        self.multiplexed_cycles = multiplexed_cycles;
    }

    /// Nothing is expected before the next SoC.
    pub(super) fn rest(&mut self) {
        *self = Watch {
            cycle_ns: self.cycle_ns,
            multiplexed_cycles: self.multiplexed_cycles,
            ..Watch::NONE
        };
    }

    pub(super) fn soc_due_ns(&self) -> Option<u64> {
        self.soc_due_ns
    }

    /// Whether a SoC is not that of a new cycle: less than half a cycle after the last one, and its time does not go on.
    pub(super) fn is_repeated_soc(&mut self, now_ns: u64, soc: &Soc) -> bool {
        let repeated = self.last_soc.is_some_and(|(at_ns, last)| {
            self.is_too_soon(at_ns, now_ns) && soc.relative_time_us <= last.relative_time_us
        });
        if !repeated {
            self.last_soc = Some((now_ns, *soc));
        }
        repeated
    }

    /// Whether a SoA is the last one again: the same within half a cycle. Its invitation was answered.
    pub(super) fn is_repeated_soa(&mut self, now_ns: u64, soa: &Soa) -> bool {
        let repeated = self
            .last_soa
            .is_some_and(|(at_ns, last)| self.is_too_soon(at_ns, now_ns) && *soa == last);
        if !repeated {
            self.last_soa = Some((now_ns, *soa));
        }
        repeated
    }

    fn is_too_soon(&self, last_ns: u64, now_ns: u64) -> bool {
        now_ns.saturating_sub(last_ns) < self.cycle_ns / 2
    }

    fn take_preq(&mut self, multiplexed: bool) {
        self.polled = true;
        self.polling = if multiplexed {
            Polling::Multiplexed { cycles_ago: 0 }
        } else {
            Polling::EveryCycle
        };
    }

    /// A cycle is over: whether its PReq was due and did not come.
    fn misses_preq(&mut self) -> bool {
        let polled = core::mem::take(&mut self.polled);
        match self.polling {
            Polling::Never => false,
            Polling::EveryCycle => !polled,
            Polling::Multiplexed { .. } if polled => false,
            Polling::Multiplexed { cycles_ago } => {
                let cycles_ago = cycles_ago.saturating_add(1);
                // Which cycle is this node's is known only where the length of the round is.
                let due = self.multiplexed_cycles != 0 && cycles_ago >= self.multiplexed_cycles;
                self.polling = Polling::Multiplexed {
                    cycles_ago: if due { 0 } else { cycles_ago },
                };
                due
            }
        }
    }
}

impl<const E: usize, const B: usize> Cn<E, B> {
    /// The driver saw a frame with a wrong CRC (object 0x1C0F).
    pub fn report_crc_error(&mut self, now_ns: u64) -> Events {
        let mut events = Events::default();
        self.watch.crc_failed = true;
        let counter = self.keys.crc;
        self.fail(counter, CycleError::Crc, now_ns, &mut events);
        events
    }

    /// The driver saw a collision (object 0x1C0A).
    pub fn report_collision(&mut self, now_ns: u64) -> Events {
        let mut events = Events::default();
        self.watch.collided = true;
        let counter = self.keys.collision;
        self.fail(counter, CycleError::Collision, now_ns, &mut events);
        events
    }

    /// A SoC came in a state that expects it: the last cycle is judged, the next one begins.
    pub(super) fn begin_cycle(&mut self, now_ns: u64, events: &mut Events) {
        self.keys.loss_of_soc.good(&mut self.dictionary);
        for (failed, counter) in [
            (core::mem::take(&mut self.watch.crc_failed), self.keys.crc),
            (core::mem::take(&mut self.watch.collided), self.keys.collision),
        ] {
            if !failed {
                counter.good(&mut self.dictionary);
            }
        }
        self.watch_soc(now_ns);
        self.end_cycle(now_ns, events);
        let exchanges = matches!(self.state, NmtState::ReadyToOperate | NmtState::Operational);
        if self.watch.misses_preq() && exchanges && !self.chaining.is_enabled() {
            let counter = self.keys.loss_of_preq;
            self.fail(counter, CycleError::LossOfPreq, now_ns, events);
        }
        self.watch.soa_due = self.expects_soc();
    }

    pub(super) fn take_soa(&mut self) {
        if core::mem::take(&mut self.watch.soa_due) {
            self.keys.loss_of_soa.good(&mut self.dictionary);
        }
    }

    pub(super) fn take_preq(&mut self, multiplexed: bool) {
        self.watch.take_preq(multiplexed);
        self.keys.loss_of_preq.good(&mut self.dictionary);
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
            let counter = self.keys.loss_of_soc;
            self.fail(counter, CycleError::LossOfSoc, now_ns, events);
            self.end_cycle(now_ns, events);
        }
    }

    /// The cycle is over, with or without its SoA.
    fn end_cycle(&mut self, now_ns: u64, events: &mut Events) {
        if core::mem::take(&mut self.watch.soa_due) {
            let counter = self.keys.loss_of_soa;
            self.fail(counter, CycleError::LossOfSoa, now_ns, events);
        }
    }

    fn watch_soc(&mut self, now_ns: u64) {
        let tolerance_ns = u64::from(self.dictionary.get(self.keys.soc_tolerance_ns));
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
