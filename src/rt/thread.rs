//! The cycle thread: when a cycle begins, and what fills the time up to the next one.
//!
//! In:  the grid of the cycle, the watch of the time-out thread.
//! Out: calls of [`Control::cycle`], each as near to its date as the PC can; the jitter of their beginnings.

use super::cycle::Control;
use super::jitter::{Jitter, Summary};
use super::timeout::Watch;
use super::wait::{Grid, monotonic_ns, wait_until};
use crate::bus::Fieldbus;
use crate::config::{Config, Rt};
use crate::machine::state::State;
use std::sync::atomic::{AtomicBool, Ordering};

/// Share of the cycle by which a cycle may begin late and still run; one that is later is left out.
const LATE_SHARE: u64 = 4;
/// Time before a cycle at which the bus is left alone, beyond the spin: the wake-up itself takes this long at most on a
/// quiet core.
const QUIET_NS: u64 = 30_000;

/// How a cycle thread ran.
#[derive(Clone, Debug)]
pub struct CycleFigures {
    /// Distance from one cycle's beginning to the next one's.
    pub period: Summary,
    /// How late cycles began.
    pub lateness: Summary,
    /// Duration of a cycle from its beginning to the end of its computing, with the exchange.
    pub busy: Summary,
    /// Cycles left out.
    pub skipped: u64,
}

/// Dates of the cycle of a machine.
pub fn grid(config: &Config) -> Grid {
    let period_ns = u64::from(config.cycle_us) * 1000;
    Grid {
        period_ns,
        phase_ns: u64::from(config.rt.phase_us) * 1000,
        late_max_ns: period_ns / LATE_SHARE,
    }
}

/// Runs cycles until the network is down or `stop` says so. RT, for a bus on CLOCK_MONOTONIC.
pub fn run<B: Fieldbus>(
    control: &mut Control<B>,
    grid: Grid,
    rt: &Rt,
    watch: &Watch,
    stop: &AtomicBool,
) -> CycleFigures {
    let spin_ns = u64::from(rt.spin_us) * 1000;
    let (mut period, mut lateness, mut busy) = (Jitter::new(grid.period_ns), Jitter::new(0), Jitter::new(0));
    let (mut cycle, mut skipped, mut all_skipped) = (0, 0, 0);
    let mut last_ns = None;
    let mut deadline_ns = grid.first_after(monotonic_ns());
    while control.state() != State::Down && !stop.load(Ordering::Acquire) {
        control.bus_mut().serve(deadline_ns.saturating_sub(spin_ns + QUIET_NS));
        let began_ns = wait_until(deadline_ns, spin_ns);
        watch.begin_cycle(cycle, deadline_ns);
        if !watch.soc_allowed() {
            control.silence();
        }
        let late_ns = began_ns - deadline_ns;
        control.cycle(late_ns, skipped, deadline_ns + grid.period_ns - spin_ns);
        watch.end_cycle(cycle);
        let ended_ns = monotonic_ns();
        lateness.record(late_ns);
        busy.record(ended_ns - began_ns);
        if let Some(last_ns) = last_ns.replace(began_ns)
            && skipped == 0
        {
            period.record(began_ns - last_ns);
        }
        let next = grid.next(deadline_ns, ended_ns);
        (deadline_ns, skipped) = (next.deadline_ns, next.skipped);
        all_skipped += skipped;
        cycle += 1;
    }
    watch.disarm();
    CycleFigures {
        period: period.summary(),
        lateness: lateness.summary(),
        busy: busy.summary(),
        skipped: all_skipped,
    }
}
