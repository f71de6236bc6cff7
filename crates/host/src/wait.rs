//! Waiting for a date: sleep on the absolute clock, then spin the last microseconds.
//!
//! In:  a [`Grid`] of dates `k * period + phase` of CLOCK_MONOTONIC.
//! Out: the thread runs on at the date; whole cycles that could not be kept are skipped and counted.

use nix::errno::Errno;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};
use std::time::Duration;

/// RT: now, ns of CLOCK_MONOTONIC. Read without a system call where the clock source allows it.
pub fn monotonic_ns() -> u64 {
    clock_ns(ClockId::CLOCK_MONOTONIC)
}

/// RT: processor time of the calling thread, ns. A system call.
pub fn thread_cpu_ns() -> u64 {
    clock_ns(ClockId::CLOCK_THREAD_CPUTIME_ID)
}

/// Processor time of the calling thread, s. A system call.
pub fn thread_cpu_s() -> f64 {
    thread_cpu_ns() as f64 * 1e-9
}

/// The clock of the calling thread's processor time, for other threads of the process.
pub fn thread_cpu_clock() -> Option<libc::clockid_t> {
    let mut clock = 0;
    // SAFETY: the calling thread lives, and `clock` may be written.
    let failed = unsafe { libc::pthread_getcpuclockid(libc::pthread_self(), &raw mut clock) };
    (failed == 0).then_some(clock)
}

/// RT: processor time by the clock of a thread, ns; `None` where it has ended. A system call.
pub fn cpu_ns(clock: libc::clockid_t) -> Option<u64> {
    let time = clock_gettime(ClockId::from_raw(clock)).ok()?;
    Some(time.tv_sec() as u64 * 1_000_000_000 + time.tv_nsec() as u64)
}

fn clock_ns(clock: ClockId) -> u64 {
    // These clocks exist on every Linux and the kernel fills in sane values: an error cannot come.
    clock_gettime(clock).map_or(0, |time| time.tv_sec() as u64 * 1_000_000_000 + time.tv_nsec() as u64)
}

/// Dates at which cycles begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Distance of two dates, above 0.
    pub period_ns: u64,
    /// Offset from whole periods: keeps the cycle off the scheduler tick, which comes on whole milliseconds.
    pub phase_ns: u64,
    /// A date that has passed by no more than this is still kept, late; one that has passed by more is skipped.
    pub late_max_ns: u64,
}

/// The next date of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Next {
    pub deadline_ns: u64,
    /// Whole cycles left out before it.
    pub skipped: u64,
}

impl Grid {
    /// The first date after `now_ns`.
    pub fn first_after(&self, now_ns: u64) -> u64 {
        let phase_ns = self.phase_ns % self.period_ns;
        if now_ns < phase_ns {
            return phase_ns;
        }
        phase_ns + ((now_ns - phase_ns) / self.period_ns + 1) * self.period_ns
    }

    /// RT: the date after `deadline_ns`, on the old grid whatever happened: never `now + period`, which would drift.
    pub fn next(&self, deadline_ns: u64, now_ns: u64) -> Next {
        self.keep(deadline_ns + self.period_ns, now_ns)
    }

    /// RT: the date `deadline_ns` itself while it may still be kept, else the next one that may.
    pub fn keep(&self, deadline_ns: u64, now_ns: u64) -> Next {
        let late_ns = now_ns.saturating_sub(deadline_ns);
        // The least number of periods after which the date has passed by no more than is allowed.
        let skipped = late_ns.saturating_sub(self.late_max_ns).div_ceil(self.period_ns);
        Next {
            deadline_ns: deadline_ns + skipped * self.period_ns,
            skipped,
        }
    }
}

/// Time to the next whole multiple of `period` on CLOCK_MONOTONIC, above 0: how long an ordinary thread pauses that looks at
/// something now and then. It wakes with the scheduler's tick, which the cycle keeps away from; a pause of `period` would wake
/// it at any phase, and on a core that it shares with the cycle thread, sometimes with an interrupt just at the SoC.
pub fn to_next(period: Duration) -> Duration {
    let period_ns = (period.as_nanos() as u64).max(1);
    Duration::from_nanos(period_ns - monotonic_ns() % period_ns)
}

/// RT: returns at `deadline_ns` or at once if that has passed; spins for the last `spin_ns`. Gives the time now, ns.
///
/// One system call, and one more for every signal that comes in between (RT threads block them all).
///
/// The spin does nothing but look at the clock. Sending something that the socket refuses, so that code and caches of the way
/// to the network are warm at the date, was tried and made the period on a veth pair three times as uneven.
pub fn wait_until(deadline_ns: u64, spin_ns: u64) -> u64 {
    sleep_until(deadline_ns.saturating_sub(spin_ns));
    spin_until(deadline_ns)
}

/// RT: sleeps until `date_ns` or does not if that has passed; the kernel wakes the thread some time after it.
pub fn sleep_until(date_ns: u64) {
    let wake = TimeSpec::from_duration(Duration::from_nanos(date_ns));
    while clock_nanosleep(ClockId::CLOCK_MONOTONIC, ClockNanosleepFlags::TIMER_ABSTIME, &wake) == Err(Errno::EINTR) {}
}

/// RT: reads the clock until it is `deadline_ns`. Gives the time now, ns.
///
/// Without the processor's hint for waiting loops: many of them in a row make a hypervisor believe that the thread waits
/// for a lock, and give the core to another guest in the very last microseconds.
pub fn spin_until(deadline_ns: u64) -> u64 {
    loop {
        let now_ns = monotonic_ns();
        if now_ns >= deadline_ns {
            return now_ns;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GRID: Grid = Grid {
        period_ns: 1_000_000,
        phase_ns: 370_000,
        late_max_ns: 100_000,
    };

    #[test]
    fn dates_lie_on_the_grid() {
        assert_eq!(GRID.first_after(0), 370_000);
        assert_eq!(GRID.first_after(370_000), 1_370_000);
        assert_eq!(GRID.first_after(5_369_999), 5_370_000);
        let wrapped = Grid {
            phase_ns: 2_370_000,
            ..GRID
        };
        assert_eq!(wrapped.first_after(5_369_999), 5_370_000);
    }

    #[test]
    fn late_cycles_are_kept_up_to_the_limit_and_skipped_whole_beyond() {
        let next = |now_ns| GRID.next(1_370_000, now_ns);
        assert_eq!(
            next(1_400_000),
            Next {
                deadline_ns: 2_370_000,
                skipped: 0
            }
        );
        assert_eq!(
            next(2_470_000),
            Next {
                deadline_ns: 2_370_000,
                skipped: 0
            }
        );
        assert_eq!(
            next(2_470_001),
            Next {
                deadline_ns: 3_370_000,
                skipped: 1
            }
        );
        assert_eq!(
            next(3_470_000),
            Next {
                deadline_ns: 3_370_000,
                skipped: 1
            }
        );
        assert_eq!(
            next(9_999_999),
            Next {
                deadline_ns: 10_370_000,
                skipped: 8
            }
        );
    }

    #[test]
    fn pauses_end_on_whole_periods() {
        let period = Duration::from_millis(10);
        for _ in 0..100 {
            let before_ns = monotonic_ns();
            let pause_ns = to_next(period).as_nanos() as u64;
            let after_ns = monotonic_ns();
            assert!((1..=10_000_000).contains(&pause_ns));
            let phase_ns = (before_ns + pause_ns) % 10_000_000;
            assert!(
                phase_ns == 0 || phase_ns >= 10_000_000u64.saturating_sub(after_ns - before_ns),
                "{phase_ns} ns after a whole period, measured within {} ns",
                after_ns - before_ns
            );
        }
    }

    #[test]
    fn waiting_never_returns_early() {
        let start_ns = monotonic_ns();
        for (ahead_ns, spin_ns) in [(0, 0), (200_000, 0), (200_000, 50_000), (20_000, 1_000_000)] {
            let deadline_ns = monotonic_ns() + ahead_ns;
            assert!(wait_until(deadline_ns, spin_ns) >= deadline_ns);
        }
        assert!(wait_until(start_ns, 0) > start_ns);
        assert!(
            wait_until(0, 50_000) > start_ns,
            "a date before the spin time is no underflow"
        );
    }

    proptest! {
        #[test]
        fn the_next_date_is_on_the_grid_and_the_first_that_may_be_kept(
            period_ns in 1u64..10_000_000, late_max_ns in 0u64..10_000_000, k in 0u64..1_000_000, gone_ns in 0u64..100_000_000,
        ) {
            let grid = Grid { period_ns, phase_ns: 0, late_max_ns };
            let deadline_ns = k * period_ns;
            let now_ns = deadline_ns + gone_ns;
            let next = grid.next(deadline_ns, now_ns);
            prop_assert_eq!(next.deadline_ns, deadline_ns + (1 + next.skipped) * period_ns);
            prop_assert!(now_ns.saturating_sub(next.deadline_ns) <= late_max_ns);
            prop_assert!(next.skipped == 0 || now_ns - (next.deadline_ns - period_ns) > late_max_ns);
        }
    }
}
