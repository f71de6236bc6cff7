//! The clock of the cycle: which cycle it is, when it began, and what its SoC says.
//!
//! In:  the date of each cycle. Out: the SoC, the cycle of the multiplexed round, what still fits into the cycle.
//! RT: no allocation, no locks, bounded.

use crate::wire::{NetTime, Soc};

/// The cycle that runs, or is made ready.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CycleClock {
    /// Its date; `None` before the first cycle of a start.
    pub(super) started_ns: Option<u64>,
    /// Its number in the multiplexed round, from 1; 0 before the first.
    pub(super) multiplex_cycle: u8,
    net_time: NetTime,
    relative_time_us: u64,
    prescaled_slot: bool,
    /// MC of the SoC.
    round_toggle: bool,
}

impl CycleClock {
    /// Goes on to the cycle of the date `begin_ns`, or moves the one made ready to that date. Returns the cycles skipped between.
    pub(super) fn go_to(&mut self, begin_ns: u64, net_time: NetTime, cycle_ns: u64, moved: bool) -> u64 {
        let passed = self
            .started_ns
            .map(|last_ns| (begin_ns.saturating_sub(last_ns) + cycle_ns / 2) / cycle_ns);
        let (steps, skipped) = match (passed, moved) {
            (None, _) => (1, 0),
            (Some(passed), true) => (passed, passed),
            (Some(passed), false) => (passed.max(1), passed.saturating_sub(1)),
        };
        // The time base goes on along the grid, also over cycles that were skipped.
        self.relative_time_us += steps * (cycle_ns / 1000);
        self.started_ns = Some(begin_ns);
        self.net_time = net_time;
        skipped
    }

    /// The next cycle of a multiplexed round of so many; 0: there is none.
    pub(super) fn begin_round(&mut self, multiplex_cycles: u8) {
        if multiplex_cycles == 0 {
            return;
        }
        if self.multiplex_cycle >= multiplex_cycles {
            self.multiplex_cycle = 1;
            self.round_toggle = !self.round_toggle;
        } else {
            self.multiplex_cycle += 1;
        }
    }

    /// PS of the SoC toggles every `prescaler` cycles.
    pub(super) fn toggle_prescaled_slot(&mut self, cycles: u64, prescaler: u16) {
        // A multiple of 0 is only 0 itself: without a prescaler the flag stays as it is after the first cycle.
        if cycles.is_multiple_of(prescaler.into()) {
            self.prescaled_slot = !self.prescaled_slot;
        }
    }

    /// What takes `length_ns` from now on is over before the next cycle is due.
    pub(super) fn fits(&self, now_ns: u64, length_ns: u64, cycle_ns: u64) -> bool {
        self.started_ns
            .is_none_or(|started_ns| now_ns.saturating_add(length_ns) <= started_ns.saturating_add(cycle_ns))
    }

    /// What the cycle begins with.
    pub(super) fn soc(&self) -> Soc {
        Soc {
            multiplexed_cycle: self.round_toggle,
            prescaled_slot: self.prescaled_slot,
            net_time: self.net_time,
            relative_time_us: self.relative_time_us,
        }
    }
}
