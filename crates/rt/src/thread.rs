//! The cycle thread: when a cycle begins, and what fills the time up to the next one.
//!
//! In:  the grid of the cycle, the watch of the time-out thread.
//! Out: calls of [`MotionController::cycle`], each as near to its date as the PC can; the figures of all cycles.

use super::cycle::MotionController;
use super::timeout::Watch;
use crate::cycle_stats::{CycleFigures, CycleTimes, Recorder};
use bus::{CyclicBus, TimeReference};
use config::Config;
use host::network_locks::NetworkLocks;
use host::spin::Spin;
use host::wait::{Grid, monotonic_ns, sleep_until, spin_until, thread_cpu_clock};
use machine::state::State;
use std::sync::atomic::{AtomicBool, Ordering};

/// Time before a cycle at which the bus is left alone, beyond the spin: the wake-up itself takes this long at most on a
/// quiet core.
const QUIET_NS: u64 = 30_000;

/// Dates come nearer to those of the bus by so much in a cycle at the most, ns: the drives see no more than that.
const STEER_MAX_NS: f64 = 1000.0;
/// Shares of an error that are taken out at once, and that count as drift of the clocks, a cycle: settled within some hundred
/// cycles, without overshoot.
const STEER_SHARE: f64 = 1.0 / 16.0;
const STEER_DRIFT_SHARE: f64 = 1.0 / 1024.0;

/// Leads the dates of cycles to the clock of the bus, where it is the one that counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Steering {
    /// What the clocks part by in a cycle, ns.
    drift_ns: f64,
}

impl Steering {
    /// By how much the next cycle begins later than a period behind this one, ns.
    pub fn shift_ns(&mut self, time: TimeReference) -> i64 {
        let late_ns = match time {
            TimeReference::Ours => return 0,
            TimeReference::Bus { late_ns } => late_ns,
            // The dates go on as the clocks have run apart so far.
            TimeReference::Unheard => 0,
        };
        let wanted_ns = self.drift_ns - late_ns as f64 * STEER_SHARE;
        let shift_ns = wanted_ns.clamp(-STEER_MAX_NS, STEER_MAX_NS);
        // On the way from a large error nothing is learned of the drift.
        if shift_ns == wanted_ns {
            self.drift_ns -= late_ns as f64 * STEER_DRIFT_SHARE;
        }
        shift_ns.round() as i64
    }
}

/// Dates of the cycle of a machine.
pub fn grid(config: &Config) -> Grid {
    let period_ns = u64::from(config.cycle_us) * 1000;
    Grid {
        period_ns,
        phase_ns: u64::from(config.rt.phase_us(config.cycle_us)) * 1000,
        late_max_ns: u64::from(config.rt.late_max_us(config.cycle_us)) * 1000,
    }
}

/// Runs cycles until the network is down or `stop` says so. RT, for a bus on CLOCK_MONOTONIC.
pub fn run(
    control: &mut MotionController<dyn CyclicBus + '_>,
    grid: Grid,
    spin: &mut Spin,
    watch: &Watch,
    mut recorder: Recorder,
    stop: &AtomicBool,
) -> Box<CycleFigures> {
    let locks = NetworkLocks::open();
    watch.set_cpu_clock(thread_cpu_clock());
    let (mut cycle, mut skipped) = (0, 0);
    let mut deadline_ns = grid.first_after(monotonic_ns());
    let mut steering = Steering::default();
    recorder.begin();
    while control.state() != State::Down && !stop.load(Ordering::Acquire) {
        let spin_ns = spin.ns();
        control.serve(deadline_ns.saturating_sub(spin_ns + QUIET_NS));
        control.prepare(deadline_ns);
        let wake_ns = deadline_ns.saturating_sub(spin_ns);
        let sleeps = monotonic_ns() < wake_ns;
        sleep_until(wake_ns);
        locks.pass();
        if sleeps {
            spin.add_wakeup(monotonic_ns().saturating_sub(wake_ns));
        }
        let woke_ns = spin_until(deadline_ns);
        // What wakes up too late for its date waits for another one: a SoC is late by no more than the grid bears, or left out.
        let keep = grid.keep(deadline_ns, woke_ns);
        if keep.skipped > 0 {
            deadline_ns = keep.deadline_ns;
            skipped += keep.skipped;
            watch.leave_out(deadline_ns, grid.period_ns);
            continue;
        }
        if !watch.soc_allowed() {
            control.inhibit_soc();
        }
        watch.begin_cycle(cycle, deadline_ns);
        let next_ns = deadline_ns + grid.period_ns;
        let exchange_ends_ns = next_ns - spin_ns;
        let report = control.cycle(woke_ns - deadline_ns, skipped, exchange_ends_ns);
        // What was cut short goes on between the cycles, as far as it still fits.
        let whole = report.done_ns < exchange_ends_ns;
        watch.end_cycle(cycle, control.network_is_up() && whole);
        let ended_ns = monotonic_ns();
        recorder.record(&CycleTimes {
            deadline_ns,
            woke_ns,
            soc_ns: report.started_ns,
            exchanged_ns: report.done_ns,
            ended_ns,
            next_ns,
            skipped,
            pres_lost: report.lost,
            phase_ns: report.time.late_ns(),
        });
        control.show_timing(recorder.timing());
        let begun_ns = deadline_ns.saturating_add_signed(steering.shift_ns(report.time));
        let next = grid.next(begun_ns, ended_ns);
        (deadline_ns, skipped) = (next.deadline_ns, next.skipped);
        cycle += 1;
    }
    watch.disarm();
    recorder.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Clocks that part by 80 ppm, and half a period of 1 ms at the beginning.
    #[test]
    fn the_clock_of_the_bus_is_followed_in_small_steps() {
        let (period_ns, bus_period_ns) = (1_000_000.0, 1_000_080.0);
        let mut steering = Steering::default();
        let (mut ours_ns, mut bus_ns) = (0.0, 500_000.0);
        let mut late_ns = 0.0;
        for cycle in 0..5000 {
            late_ns = ours_ns - bus_ns;
            let shift_ns = steering.shift_ns(TimeReference::Bus {
                late_ns: late_ns as i64,
            });
            assert!(shift_ns.abs() <= 1000, "cycle {cycle}: {shift_ns}");
            ours_ns += period_ns + shift_ns as f64;
            bus_ns += bus_period_ns;
        }
        assert!(late_ns.abs() < 20.0, "{late_ns} ns");
        assert!((steering.drift_ns - 80.0).abs() < 2.0, "{steering:?}");
        assert_eq!(steering.shift_ns(TimeReference::Ours), 0);
    }
}
