//! The time-out thread: every time limit is looked at within 50 µs of its end, while the cycle thread computes or sleeps.
//!
//! In:  what the cycle thread says of itself and of the frames it waits for, in [`Watch`] (atomics only).
//! Out: a poll or async slot that is over is taken away from the cycle thread; late and hung cycles are reported; a hung
//!      cycle thread may send no SoC any more, and the drives stop by its loss. Reports go through a fixed ring.
//!
//! A cycle thread hangs that computes and does not come to the end of its cycle. One that does not get the core (of another
//! process, of the host of a virtual machine) is late: it goes on where it was, and nodes that have given up are lost and
//! reported. Its processor time tells the two apart; it costs a system call at each look that finds it overdue for that long.
//!
//! Its ticks lie on a grid in whose gaps the cycle begins. It sleeps over those at which nothing can be due: a tick takes the
//! core from the cycle thread, in a virtual machine for far longer than the thread itself runs (`benches/timeout.rs`).
//!
//! All decisions are in `watchdog.rs`, which knows no clock; [`TimeoutThread`] gives them one.

mod watchdog;

pub use bus::watch::{Counters, Watch};
pub use watchdog::{Event, Limits, Report, Watchdog};

use crate::steps::Ticker;
use host::setup::{Process, Role, STACK_SIZE, enter_thread};
use host::wait::{monotonic_ns, sleep_until, thread_cpu_ns, wait_until};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use watchdog::LOOK_AGAIN_NS;

/// Ticks between two looks at the thread's own processor time, which cost a system call each.
const CPU_TIME_TICKS: u64 = 1024;
/// The thread is given so many of these times to end.
const END_LOOKS: u32 = 500;
/// Reports that fit the ring until somebody reads them; more are counted and dropped.
pub const REPORTS: usize = 256;

/// The running thread. Dropping it ends it.
pub struct TimeoutThread {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl TimeoutThread {
    /// Starts the thread; reports go into `reports`. `steps`: whose pulses it makes.
    ///
    /// # Errors
    /// If no thread can be had.
    pub fn spawn(
        process: Arc<Process>,
        watch: Arc<Watch>,
        limits: Limits,
        mut reports: rtrb::Producer<Report>,
        mut steps: Option<Ticker>,
    ) -> std::io::Result<TimeoutThread> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let run = move || {
            // What is missing was found and told by `prepare_process`.
            drop(enter_thread(Role::Timeout, &process));
            run(&stopped, watch, limits, &mut reports, steps.as_mut());
        };
        let thread = std::thread::Builder::new()
            .name("rt-timeout".into())
            .stack_size(STACK_SIZE)
            .spawn(run)?;
        Ok(TimeoutThread {
            stop,
            thread: Some(thread),
        })
    }
}

impl Drop for TimeoutThread {
    /// Waits for its end, which comes with its next look. One that hangs is left behind: it has nothing of anybody else's.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else { return };
        for _ in 0..END_LOOKS {
            if thread.is_finished() {
                // A panic of the thread has been printed; there is nothing more to do about it here.
                let _ = thread.join();
                return;
            }
            sleep_until(monotonic_ns() + LOOK_AGAIN_NS);
        }
    }
}

/// RT: the loop of the thread.
fn run(
    stop: &AtomicBool,
    watch: Arc<Watch>,
    limits: Limits,
    reports: &mut rtrb::Producer<Report>,
    mut steps: Option<&mut Ticker>,
) {
    let mut watchdog = Watchdog::new(watch.clone(), limits);
    let start_ns = monotonic_ns();
    let mut date_ns = limits.tick_at_or_after(start_ns);
    let mut ticks = 0u64;
    let mut cycle = 0;
    while !stop.load(Ordering::Acquire) {
        let now_ns = wait_until(date_ns, 0);
        // Pulses first: they are what the distance of ticks is heard of.
        let pulses_ns = steps.as_deref_mut().map(|steps| {
            if limits.cycle_at(date_ns) != cycle {
                cycle = limits.cycle_at(date_ns);
                steps.begin_cycle();
            }
            steps.tick(now_ns);
            match steps.is_at_rest() {
                true => limits.begins_at(cycle + 1),
                // One that comes late leaves out the next tick rather than make a pulse too short.
                false => now_ns + limits.tick_ns / 2,
            }
        });
        let due_ns = watchdog.tick(now_ns, |report| {
            if reports.push(report).is_err() {
                watch.reports_dropped.fetch_add(1, Ordering::Relaxed);
            }
        });
        ticks += 1;
        if ticks.is_multiple_of(CPU_TIME_TICKS) {
            watch.cpu_ns.store(thread_cpu_ns(), Ordering::Relaxed);
            watch.wall_ns.store(now_ns - start_ns, Ordering::Relaxed);
        }
        // Later than half a tick: the ticks that would have been there meanwhile are missed, needed or not.
        let missed = (now_ns - date_ns + limits.tick_ns / 2) / limits.tick_ns;
        watch.missed_ticks.fetch_add(missed, Ordering::Relaxed);
        let due_ns = pulses_ns.map_or(due_ns, |pulses_ns| due_ns.min(pulses_ns));
        date_ns = limits.tick_at_or_after(due_ns.max(date_ns + 1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::{KeepAwake, Rt};

    #[test]
    fn the_thread_ticks_reports_and_ends() {
        let rt = Rt {
            keep_awake: Some(KeepAwake::None),
            lock_memory: false,
            ..Rt::default()
        };
        let process = Arc::new(host::setup::prepare_process(&rt).unwrap());
        let watch = Arc::new(Watch::default());
        let (producer, mut consumer) = rtrb::RingBuffer::new(REPORTS);
        watch.begin_poll(5, 1);
        let thread = TimeoutThread::spawn(
            process,
            watch.clone(),
            Limits::new(1_000_000, 50_000, 3),
            producer,
            None,
        )
        .unwrap();
        while watch.counters().ticks < 2 * CPU_TIME_TICKS {
            std::thread::yield_now();
        }
        drop(thread);
        let counters = watch.counters();
        assert_eq!(counters.polls_lost, 1);
        assert_eq!(consumer.pop().unwrap().event, Event::PresTimeout { node: 5 });
        assert!(consumer.pop().is_err());
        assert!(counters.cpu_share > 0.0 && counters.cpu_share <= 1.0, "{counters:?}");
        assert_eq!(Arc::strong_count(&watch), 1);
    }
}
