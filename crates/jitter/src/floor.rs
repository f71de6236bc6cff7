//! The floor of the PC: what the core can do with nothing of ours on it.
//!
//! In:  a core, a period, a time for each of three probes.
//! Out: [`Floor`]: wake-up latency by our own probe and by `cyclictest`, gaps of a spinning thread.

use super::cyclictest::{self, CyclictestError};
use super::distribution::Distribution;
use super::report::{Floor, Gaps};
use host::latency::{GAP_NS, GapScan, WakeUp};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Pause between two looks at a probe.
const LOOK: Duration = Duration::from_millis(20);
/// SCHED_FIFO priority of our probes, as that of `cyclictest`.
const PRIORITY: u8 = 90;

/// How the floor is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    pub core: usize,
    /// Period of wake-ups, µs.
    pub cycle_us: u32,
    /// Length of each probe, s.
    pub seconds: u64,
}

impl Plan {
    /// Measures. `look` is called every few milliseconds and may end it; what was measured by then is kept.
    pub fn measure(&self, look: &mut dyn FnMut() -> ControlFlow<()>) -> Floor {
        let mut floor = Floor::default();
        let duration = Duration::from_secs(self.seconds);
        let wake_up = WakeUp {
            cpu: self.core,
            priority: PRIORITY,
            period_ns: u64::from(self.cycle_us) * 1000,
            phase_ns: 0,
            spin_ns: 0,
            cycles: 0,
        };
        let figures = watched(look, |stop| wake_up.lasting(duration).run(stop));
        if figures.lateness.n() > 0 {
            floor.wakeup = Some(Distribution::from(&figures.lateness));
            floor.wakeup_skipped = figures.skipped;
        }
        floor.notes.extend(figures.findings.iter().map(ToString::to_string));
        if look().is_break() {
            return floor;
        }

        match cyclictest::run(self.core, self.cycle_us, self.seconds, look) {
            Ok(found) => floor.cyclictest = Some(found),
            Err(
                error @ (CyclictestError::NotInstalled
                | CyclictestError::System(_)
                | CyclictestError::Failed { .. }
                | CyclictestError::Output { .. }),
            ) => floor.notes.push(error.to_string()),
        }
        if look().is_break() {
            return floor;
        }

        let scan = GapScan {
            cpu: self.core,
            priority: PRIORITY,
            threshold_ns: GAP_NS,
            duration,
        };
        let figures = watched(look, |stop| scan.run(stop));
        if figures.scanned_ns > 0 {
            floor.gaps = Some(Gaps::from(&figures));
        }
        floor
    }
}

/// Runs a probe and looks meanwhile.
fn watched<T: Send>(look: &mut dyn FnMut() -> ControlFlow<()>, probe: impl FnOnce(&AtomicBool) -> T + Send) -> T {
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let probe = scope.spawn(|| probe(&stop));
        while !probe.is_finished() {
            if look().is_break() {
                stop.store(true, Ordering::Relaxed);
            }
            std::thread::sleep(LOOK);
        }
        match probe.join() {
            Ok(found) => found,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: Plan = Plan {
        core: 0,
        cycle_us: 1000,
        seconds: 1,
    };

    #[test]
    fn every_probe_says_what_it_found_or_why_it_did_not() {
        let floor = PLAN.measure(&mut || ControlFlow::Continue(()));
        assert_eq!(floor.wakeup.expect("it needs nothing").figures.n, 1000);
        let gaps = floor.gaps.expect("it needs nothing");
        assert!(gaps.scanned_s > 0.0);
        match floor.cyclictest {
            Some(found) => assert!(found.latency.figures.n > 0),
            None => assert!(
                floor.notes.iter().any(|note| note.contains("cyclictest")),
                "{:?}",
                floor.notes
            ),
        }
    }

    #[test]
    fn an_end_in_midst_keeps_what_there_is() {
        let mut looks = 0;
        let floor = PLAN.measure(&mut || {
            looks += 1;
            if looks > 3 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        let wakeup = floor.wakeup.expect("the first probe had begun");
        assert!((1..1000).contains(&wakeup.figures.n), "{}", wakeup.figures.n);
        assert_eq!((floor.cyclictest, floor.gaps), (None, None));
    }
}
