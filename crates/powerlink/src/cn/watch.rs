//! What is expected of the managing node, and what reaches a threshold when it stays away.

use super::error::code;
use crate::wire::{Soa, Soc};

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
pub(super) enum Polling {
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
    pub(super) cycle_ns: u64,
    /// 0x1F98/7 when the configuration was activated.
    pub(super) multiplexed_cycles: u8,
    /// When the next SoC is overdue.
    pub(super) soc_due_ns: Option<u64>,
    /// A SoC came and its SoA has not.
    pub(super) soa_due: bool,
    /// A PReq came since the last SoC.
    pub(super) polled: bool,
    pub(super) polling: Polling,
    /// A frame with a wrong CRC came since the last SoC.
    pub(super) crc_failed: bool,
    /// A frame collided since the last SoC.
    pub(super) collided: bool,
    /// The last SoC and SoA and when they came: the wire may double a frame.
    pub(super) last_soc: Option<(u64, Soc)>,
    pub(super) last_soa: Option<(u64, Soa)>,
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

    pub(super) fn is_too_soon(&self, last_ns: u64, now_ns: u64) -> bool {
        now_ns.saturating_sub(last_ns) < self.cycle_ns / 2
    }

    pub(super) fn take_preq(&mut self, multiplexed: bool) {
        self.polled = true;
        self.polling = if multiplexed {
            Polling::Multiplexed { cycles_ago: 0 }
        } else {
            Polling::EveryCycle
        };
    }

    /// A cycle is over: whether its PReq was due and did not come.
    pub(super) fn misses_preq(&mut self) -> bool {
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
