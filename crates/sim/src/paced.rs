//! The wire in memory on paced time: virtual time that goes with the clock, and waits for whoever is late.
//!
//! In:  frames of the managing node through [`Link`]. Out: frames of the simulated machine; a date that has come.
//!
//! On a PC that keeps no cycle every date of the machine is kept all the same: while the PC does something else, time stands
//! still for the control and its machine. So what it shows is right, and says nothing about the PC. No RT link: it allocates.

use super::{NetConfig, SimMachine, VirtualNet};
use bus::CyclicBus;
use host::wait::Grid;
use host::wait::{monotonic_ns, sleep_until};
use machine::state::State;
use powerlink::link::{Link, LinkError, Received};
use rt::cycle::MotionController;
use rt::cycle_stats::{CycleFigures, CycleTimes, Recorder};
use rt::thread::Steering;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Who is late by less than this makes it up: a busy PC wakes a thread up rarely, but then lets it run.
const MADE_UP_NS: u64 = 200_000_000;
/// Start of all that is random: nothing that shows.
const SEED: u64 = 1;

/// The wire; a clone is the same wire.
#[derive(Clone, Debug)]
pub struct Paced(Arc<Mutex<VirtualNet>>);

/// Holds time back for a thread that is late.
#[derive(Debug, Default)]
pub struct Pace {
    /// How far virtual time is behind CLOCK_MONOTONIC, ns.
    behind_ns: u64,
}

impl Paced {
    /// The wire to a machine that is switched on now.
    pub fn new(machine: SimMachine) -> Paced {
        let net = VirtualNet::starting_at(machine, NetConfig::clean(SEED), monotonic_ns());
        Paced(Arc::new(Mutex::new(net)))
    }

    /// Virtual time, ns.
    pub fn time_ns(&self) -> u64 {
        self.net().time_ns()
    }

    /// Lets virtual time pass until a date.
    pub fn advance_to(&self, date_ns: u64) {
        let mut net = self.net();
        let ahead_ns = date_ns.saturating_sub(net.time_ns());
        net.advance(ahead_ns);
    }

    fn net(&self) -> MutexGuard<'_, VirtualNet> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Pace {
    /// Returns at a virtual date or, if that has passed, at once. If it has passed by more than can be made up, time has stood
    /// still for the rest.
    pub fn wait_until(&mut self, date_ns: u64) {
        self.behind_ns = self.stood_still(date_ns, monotonic_ns());
        sleep_until(date_ns + self.behind_ns);
    }

    fn stood_still(&self, date_ns: u64, now_ns: u64) -> u64 {
        self.behind_ns.max(now_ns.saturating_sub(date_ns + MADE_UP_NS))
    }
}

impl Link for Paced {
    fn now_ns(&mut self) -> u64 {
        self.time_ns()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.net().send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        self.net().receive(buffer, deadline_ns)
    }
}

/// Runs cycles on paced time until the network is down or `stop` says so; `wire` is that of the bus. Not RT: a thread that is
/// late holds time back instead.
pub fn run_paced(
    control: &mut MotionController<dyn CyclicBus + '_>,
    grid: Grid,
    wire: &Paced,
    mut recorder: Recorder,
    stop: &AtomicBool,
) -> Box<CycleFigures> {
    let mut pace = Pace::default();
    let mut deadline_ns = grid.first_after(wire.time_ns());
    let mut steering = Steering::default();
    recorder.begin();
    while control.state() != State::Down && !stop.load(Ordering::Acquire) {
        control.serve(deadline_ns);
        control.prepare(deadline_ns);
        pace.wait_until(deadline_ns);
        wire.advance_to(deadline_ns);
        let next_ns = deadline_ns + grid.period_ns;
        let report = control.cycle(0, 0, next_ns);
        recorder.record(&CycleTimes {
            deadline_ns,
            woke_ns: deadline_ns,
            soc_ns: report.started_ns,
            exchanged_ns: report.done_ns,
            ended_ns: report.done_ns,
            next_ns,
            skipped: 0,
            pres_lost: report.lost,
            phase_ns: report.time.late_ns(),
        });
        control.show_timing(recorder.timing());
        deadline_ns = next_ns.saturating_add_signed(steering.shift_ns(report.time));
    }
    recorder.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_little_is_made_up_and_for_the_rest_time_stands_still() {
        let mut pace = Pace::default();
        assert_eq!(pace.stood_still(2_000, 1_500), 0);
        assert_eq!(pace.stood_still(2_000, 2_000 + MADE_UP_NS), 0);
        pace.behind_ns = pace.stood_still(2_000, 9_000 + MADE_UP_NS);
        assert_eq!(pace.behind_ns, 7_000);
        // In time again: a virtual millisecond takes one of the clock.
        assert_eq!(pace.stood_still(3_000, 9_500), 7_000);
        assert_eq!(pace.stood_still(4_000, 11_001 + MADE_UP_NS), 7_001);
    }
}
